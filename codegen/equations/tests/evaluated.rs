//! SymPy evaluates the emitted script to the values of the interpreter. Skipped with a message
//! where python3 or SymPy is missing.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use regen_codegen::Mechanism;
use regen_codegen::diag::Source;
use regen_codegen::interpret;
use regen_codegen::robot::{FunctionKind, Robot};
use regen_equations::{EquationSet, Parameters, Style, equations, kinds};

/// A robot of the repository with these functions.
fn robot(file: &str, kinds: &[FunctionKind]) -> Robot {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots");
    let text = std::fs::read_to_string(path.join(file)).unwrap();
    let source = Source::new(file, &text);
    let mechanism = Mechanism::open(&source).unwrap();
    mechanism.robot_in_names(kinds).unwrap()
}

/// Irregular values near home.
fn values(robot: &Robot, argument: &str, count: usize) -> Vec<f64> {
    let wave = |k: usize| (0.4 + 1.7 * k as f64 + argument.len() as f64).sin();
    let each = (0..count).map(|k| match argument {
        "q" => robot.home[k] + 0.1 * wave(k),
        "geometry" => robot.adjustable[k].1 * (1.0 + 0.01 * wave(k)),
        _ => wave(k),
    });
    each.collect()
}

#[test]
fn sympy_evaluates_to_what_is_computed() {
    let sympy = Command::new("python3")
        .args(["-c", "import sympy"])
        .output();
    if !sympy.is_ok_and(|output| output.status.success()) {
        eprintln!("left out: there is no python3 with sympy");
        return;
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("equations");
    std::fs::create_dir_all(&folder).unwrap();
    for (file, of, parameters) in [
        ("scara.yaml", EquationSet::Regressor, Parameters::All),
        ("fivebar.yaml", EquationSet::Regressor, Parameters::Base),
        (
            "3rps_friction.yaml",
            EquationSet::Regressor,
            Parameters::Base,
        ),
        ("fivebar.yaml", EquationSet::Dynamics, Parameters::Base),
        ("fivebar.yaml", EquationSet::X, Parameters::All),
        ("slider_crank.yaml", EquationSet::Jacobian, Parameters::All),
        // names that follow from others, and a coupling
        ("3rrr.yaml", EquationSet::Closure, Parameters::All),
        ("palletiser.yaml", EquationSet::Dynamics, Parameters::Base),
        ("scara.yaml", EquationSet::Mass, Parameters::All),
        ("fivebar.yaml", EquationSet::Mass, Parameters::Base),
        ("scara.yaml", EquationSet::Coriolis, Parameters::All),
        ("fivebar.yaml", EquationSet::Coriolis, Parameters::Base),
        ("fivebar.yaml", EquationSet::Gravity, Parameters::Base),
        ("slider_crank.yaml", EquationSet::Gravity, Parameters::All),
        ("fivebar.yaml", EquationSet::Frames, Parameters::All),
    ] {
        let kinds = kinds(of, parameters);
        let robot = robot(file, &kinds);
        let kind = kinds[0];
        let program = &robot.function(kind).unwrap().program;
        let mut script = equations(&robot, of, parameters, Style::Sympy).unwrap();
        let mut inputs = Vec::new();
        let mut given = String::new();
        for argument in &program.arguments {
            let mut numbers = values(&robot, &argument.name, argument.len);
            let mut name = argument.name.as_str();
            if !(of == EquationSet::X && name == "qd_i") {
                let shown = if of == EquationSet::Coriolis && name == "phi" {
                    // kept parameters have the values of the base parameters, and the others none
                    name = if parameters == Parameters::Base {
                        "beta"
                    } else {
                        name
                    };
                    kept_alone(&robot, &mut numbers)
                } else {
                    numbers.clone()
                };
                write!(given, "**dict(zip({name}_, {shown:?})), ").unwrap();
            }
            inputs.push(numbers);
        }
        write!(
            script,
            "\nfor value in evaluate({{{given}}}).T:\n    print(f'{{float(value):.17g}}')\n"
        )
        .unwrap();
        let name = format!("{}_{of:?}_{parameters:?}.py", robot.name);
        std::fs::write(folder.join(&name), script).unwrap();
        let mut command = Command::new("python3");
        let output = command.arg(&name).current_dir(&folder).output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{name}: {errors}");
        let printed = String::from_utf8(output.stdout).unwrap();
        let found: Vec<f64> = printed.lines().map(|line| line.parse().unwrap()).collect();
        let expected = expected(&robot, of, kind, &mut inputs);
        assert_eq!(found.len(), expected.len(), "{name}");
        let largest = expected.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        for (found, expected) in found.iter().zip(&expected) {
            let error = (found - expected).abs() / largest;
            assert!(error <= 1e-12, "{name}: {found} instead of {expected}");
        }
    }
}

/// Sets parameters to zero that the base does not keep, and returns those that it keeps; all of them where no base was
/// derived.
fn kept_alone(robot: &Robot, phi: &mut [f64]) -> Vec<f64> {
    let Some(analysis) = &robot.analysis else {
        return phi.to_vec();
    };
    let kept = analysis.base.parameters.iter().filter(|p| !p.dropped);
    let kept: Vec<usize> = kept.map(|p| p.column).collect();
    for (column, value) in phi.iter_mut().enumerate() {
        if !kept.contains(&column) {
            *value = 0.0;
        }
    }
    kept.iter().map(|column| phi[*column]).collect()
}

/// What the interpreter computes, column by column.
fn expected(
    robot: &Robot,
    of: EquationSet,
    kind: FunctionKind,
    inputs: &mut [Vec<f64>],
) -> Vec<f64> {
    let program = &robot.function(kind).unwrap().program;
    let run = |inputs: &[Vec<f64>]| {
        let slices: Vec<&[f64]> = inputs.iter().map(Vec::as_slice).collect();
        interpret::run(program, &slices).0
    };
    match of {
        EquationSet::X => {
            let mut columns = Vec::new();
            for k in 0..robot.independent.len() {
                inputs[1].fill(0.0);
                inputs[1][k] = 1.0;
                let velocities = run(inputs);
                columns.extend(robot.dependent.iter().map(|row| -velocities[*row]));
            }
            columns
        }
        EquationSet::Jacobian => {
            let rows = run(inputs);
            let n = robot.coordinates.len();
            let order = (0..n).flat_map(|c| (0..robot.rows).map(move |r| r * n + c));
            order.map(|at| rows[at]).collect()
        }
        EquationSet::Mass | EquationSet::Coriolis | EquationSet::Frames => {
            let rows = run(inputs);
            let dof = robot.independent.len();
            let order = (0..dof).flat_map(|c| (c..rows.len()).step_by(dof));
            order.map(|at| rows[at]).collect()
        }
        _ => run(inputs),
    }
}
