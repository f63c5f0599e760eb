//! Every function of every robot in single precision: the error is within the computed bound of the
//! rounding error.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::PathBuf;

use regen_codegen::diag::Source;
use regen_codegen::interpret::{Rounded, Single, run};
use regen_codegen::pipeline::{BaseSource, derive_with};
use regen_codegen::robot::Robot;

fn robots() -> Vec<Robot> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../robots");
    let entries = std::fs::read_dir(folder).unwrap();
    let mut files: Vec<PathBuf> = entries.map(|e| e.unwrap().path()).collect();
    files.retain(|p| p.extension().is_some_and(|e| e == "yaml"));
    files.sort();
    files
        .iter()
        .map(|path| {
            let text = std::fs::read_to_string(path).unwrap();
            let source = Source::new(path.display().to_string(), text);
            derive_with(&source, BaseSource::Skip).unwrap()
        })
        .collect()
}

/// A pseudorandom number in [-1, 1).
fn random(state: &mut u64) -> f64 {
    *state = state
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

/// At states about home, closed or not, since the functions accept any coordinates.
#[test]
fn no_function_of_any_robot_leaves_its_bound_in_single_precision() {
    let mut seed = 5;
    let (mut compared, mut unbounded) = (0, 0);
    for robot in robots() {
        for _ in 0..3 {
            for function in &robot.functions {
                let program = &function.program;
                let arguments: Vec<Vec<f32>> = program
                    .arguments
                    .iter()
                    .map(|argument| {
                        let home = |k: usize| match argument.name.as_str() {
                            "q" => robot.home.get(k).copied().unwrap_or(0.0),
                            _ => 0.0,
                        };
                        // masses and moments of inertia are those of bodies
                        let is_large = |k: usize| {
                            let own = robot.parameters.get(k).filter(|_| argument.name == "phi");
                            let mut names = ["Ixx(", "Iyy(", "Izz(", "m("].into_iter();
                            own.is_some_and(|own| names.any(|name| own.label.starts_with(name)))
                        };
                        let range = match argument.name.as_str() {
                            "q" => 0.05,
                            "phi" => 0.1,
                            _ => 1.0,
                        };
                        (0..argument.len)
                            .map(|k| {
                                let middle = home(k) + f64::from(is_large(k));
                                (middle + range * random(&mut seed)) as f32
                            })
                            .collect()
                    })
                    .collect();
                let slices: Vec<&[f32]> = arguments.iter().map(Vec::as_slice).collect();
                let (single, _) = run(program, &slices);
                let exact: Vec<Vec<Rounded<Single>>> = arguments
                    .iter()
                    .map(|a| a.iter().map(|x| Rounded::exact(f64::from(*x))).collect())
                    .collect();
                let slices: Vec<&[Rounded<Single>]> = exact.iter().map(Vec::as_slice).collect();
                let (bounds, _) = run(program, &slices);
                assert_eq!(single.len(), bounds.len());
                for (found, bound) in single.iter().zip(&bounds) {
                    let error = (f64::from(*found) - bound.value).abs();
                    compared += 1;
                    unbounded += usize::from(!bound.error.is_finite());
                    // the value in double precision has a rounding error itself
                    assert!(
                        error <= bound.error * (1.0 + 1e-6),
                        "{} {:?}: {error:e} {bound:?}",
                        robot.name,
                        function.kind
                    );
                }
            }
        }
    }
    assert!(compared > 20_000, "{compared}");
    // if a pivot may be zero in single precision there is no bound, and the conditioning shows this
    assert!(unbounded * 100 < compared, "{unbounded} of {compared}");
}
