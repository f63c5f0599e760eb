//! The functions of base parameters give the same results as those of all parameters: interpreted
//! for every spec, compiled for the checked-in robots.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use regen_codegen::interpret::run;
use regen_codegen::robot::{FunctionKind, Robot};
use regen_generated::{fivebar::Fivebar, rps3::Rps3, rps3_friction::Rps3Friction};
use regen_runtime::BaseModel;
use regen_tests::derived::Derived;
use regen_tests::files;
use regen_tests::reference::Random;

/// The tolerance relative to the largest entry, for some hundred products of results of a solve.
const TOLERANCE: f64 = 1e-10;

fn call(robot: &Robot, kind: FunctionKind, inputs: &[&[f64]]) -> Vec<f64> {
    run(&robot.function(kind).unwrap().program, inputs).0
}

fn assert_close(ours: &[f64], theirs: &[f64], what: &str) {
    assert_eq!(ours.len(), theirs.len(), "{what}");
    let size = theirs.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
    for (a, b) in ours.iter().zip(theirs) {
        assert!((a - b).abs() <= TOLERANCE * size, "{what}: {a} against {b}");
    }
}

#[test]
fn base_functions_agree_with_the_full_ones() {
    use FunctionKind as F;
    for folder in [files::robots(), files::oracle(), files::mechanisms()] {
        for path in files::list(&folder, "yaml").unwrap() {
            let mechanism = files::mechanism(&path).unwrap();
            let robot = Derived::from_file(&path).unwrap().robot;
            let name = &robot.name;
            let analysis = robot.analysis.as_ref().unwrap();
            assert_eq!(
                analysis.base.null.len()
                    + analysis.base.parameters.len()
                    + analysis.base.known.len(),
                robot.parameters.len()
            );
            let mut random = Random::new(3);
            let dof = robot.independent.len();
            for state in mechanism.random_states(17, 3).unwrap() {
                let (q, qd, qdd) = (&state.q, &state.qd, &state.qdd);
                let phi = random.vector(robot.parameters.len(), 1.0);
                let beta = call(&robot, F::ToBase, &[&phi]);
                let w = call(&robot, F::BaseRegressor, &[q, qd, qdd]);
                let product: Vec<f64> = (0..dof)
                    .map(|r| beta.iter().zip(w.chunks(dof)).map(|(b, c)| b * c[r]).sum())
                    .collect();
                let tau = call(&robot, F::InverseDynamics, &[q, qd, qdd, &phi]);
                assert_close(&product, &tau, &format!("{name}: W_red beta"));
                let from_base = call(&robot, F::BaseInverseDynamics, &[q, qd, qdd, &beta]);
                assert_close(&from_base, &tau, &format!("{name}: inverse dynamics"));
                // A constant effort that the base parameters combine with Coulomb friction acts at
                // rest and friction does not: the forces at rest are then those of the parameters
                // that have these base parameters and zeros in place of the eliminated ones.
                let has_offset = robot.parameters.iter().any(|p| p.label.starts_with("Fo("));
                let zeros = vec![0.0; analysis.base.null.len()];
                let with_zeros = call(&robot, F::FromBase, &[&beta, &zeros]);
                let equivalent = if has_offset { &with_zeros } else { &phi };
                for (base, full, inputs) in [
                    (F::BaseGravity, F::Gravity, vec![q.as_slice()]),
                    (F::BaseMassMatrix, F::MassMatrix, vec![q.as_slice()]),
                    (
                        F::BaseBiasForces,
                        F::BiasForces,
                        vec![q.as_slice(), qd.as_slice()],
                    ),
                ] {
                    let with = |last: &[f64], kind| {
                        let mut inputs = inputs.clone();
                        inputs.push(last);
                        call(&robot, kind, &inputs)
                    };
                    let what = format!("{name}: {}", base.name());
                    assert_close(&with(&beta, base), &with(equivalent, full), &what);
                }
                // the reverse direction, with arbitrary values of the eliminated parameters
                let free = random.vector(analysis.base.null.len(), 1.0);
                let other = call(&robot, F::FromBase, &[&beta, &free]);
                assert_close(
                    &call(&robot, F::ToBase, &[&other]),
                    &beta,
                    &format!("{name}: back"),
                );
                let same = call(&robot, F::InverseDynamics, &[q, qd, qdd, &other]);
                assert_close(&same, &tau, &format!("{name}: other parameters"));
            }
        }
    }
}

#[test]
fn eliminated_parameters_of_phi_are_recovered_exactly() {
    let robot = Derived::from_file(&files::robots().join("3rps.yaml"))
        .unwrap()
        .robot;
    let base = &robot.analysis.as_ref().unwrap().base;
    let phi = Random::new(9).vector(robot.parameters.len(), 1.0);
    let beta = call(&robot, FunctionKind::ToBase, &[&phi]);
    let free: Vec<f64> = base.null.iter().map(|n| phi[n.column]).collect();
    let again = call(&robot, FunctionKind::FromBase, &[&beta, &free]);
    assert_close(
        &again,
        &phi,
        "phi from its base parameters and eliminated ones",
    );
}

fn check_compiled(model: &dyn BaseModel<f64>) {
    let info = model.info();
    let (dof, p) = (info.dof(), info.parameters.len());
    let base = model.base_info();
    assert!(base.complete);
    let rank = base.base.len();
    assert_eq!(rank + base.free.len(), p);
    let phi = Random::new(5).vector(p, 1.0);
    let mut beta = vec![0.0; rank];
    model.to_base(&phi, &mut beta).unwrap();
    for (parameter, value) in base.base.iter().zip(&beta) {
        let sum: f64 = parameter.terms.iter().map(|t| t.value * phi[t.index]).sum();
        assert!((sum - value).abs() < 1e-12);
        assert_eq!(parameter.terms[0].parameter, parameter.label);
        assert_eq!(info.parameters[parameter.terms[0].index], parameter.label);
    }
    let q = info.home;
    let n = q.len();
    let mut tau = vec![0.0; dof];
    let mut base_gravity = vec![0.0; dof];
    let _ = model.base_gravity(q, &beta, &mut base_gravity).unwrap();
    let mut gravity = vec![0.0; dof];
    let _ = model.gravity(q, &phi, &mut gravity).unwrap();
    assert_close(&base_gravity, &gravity, info.name);
    let mut velocities = vec![0.0; n];
    let _ = model
        .velocities(q, &vec![0.4; dof], &mut velocities)
        .unwrap();
    let mut accelerations = vec![0.0; n];
    let _ = model
        .accelerations(q, &velocities, &vec![0.1; dof], &mut accelerations)
        .unwrap();
    let _ = model
        .inverse_dynamics(q, &velocities, &accelerations, &phi, &mut tau)
        .unwrap();
    let mut from_base = vec![0.0; dof];
    let _ = model
        .base_inverse_dynamics(q, &velocities, &accelerations, &beta, &mut from_base)
        .unwrap();
    assert_close(&from_base, &tau, info.name);
}

#[test]
fn compiled_models_agree_with_their_base_parameters() {
    check_compiled(&Rps3);
    check_compiled(&Rps3Friction);
    check_compiled(&Fivebar);
}
