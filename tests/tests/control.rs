//! Compiled functions for controllers give what the interpreted ones give, at one state and in
//! single precision, and tell by their condition where the mass matrix is not positive definite;
//! named frames move as the second derivation says. `regen-verify` compares the functions with each
//! other and with differences.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;

use regen_codegen::Mechanism;
use regen_codegen::diag::Source;
use regen_codegen::robot::{FunctionKind, Robot};
use regen_codegen::signature::Needs;
use regen_interpreted::Interpreted;

use regen_runtime::function::{Argument, Sizes};
use regen_runtime::{Arguments, ControlFunction, ControlModel, LoopClosure, Model, Status};
use regen_tests::files;
use regen_tests::reference::{Mechanism as Reference, State};

/// All functions that need no base parameters, whose derivation takes longer.
fn without_base() -> Vec<FunctionKind> {
    let all = FunctionKind::ALL.into_iter();
    all.filter(|kind| kind.signature().needs != Needs::Base)
        .collect()
}

fn derived(name: &str) -> Robot {
    let file = files::robots().join(format!("{name}.yaml"));
    let text = std::fs::read_to_string(file).unwrap();
    let mechanism = Mechanism::open(&Source::new(name, text)).unwrap();
    mechanism.robot(&without_base()).unwrap()
}

/// A closed state near home with nominal or made-up parameters, as the entries of each argument.
fn arguments(robot: &Robot, model: &Interpreted<'_>) -> Vec<(Argument, Vec<f64>)> {
    let wave = |k: usize, phase: f64| 0.3 * (1.7 * k as f64 + phase).sin();
    let mut closure = LoopClosure::new(model).unwrap();
    let dof = robot.independent.len();
    let q_i: Vec<f64> = robot.independent.iter().map(|c| robot.home[*c]).collect();
    let q_i: Vec<f64> = q_i
        .iter()
        .enumerate()
        .map(|(k, q)| q + wave(k, 0.4))
        .collect();
    let rates = |phase: f64| (0..dof).map(|k| 2.0 * wave(k, phase)).collect::<Vec<_>>();
    let state = closure.solve_state(&q_i, &rates(1.0), &rates(2.0)).unwrap();
    assert!(state.outcome.is_closed());
    let body = [0.3, 0.01, 0.02, 0.2, 0.01, 0.25, 0.1, 0.05, 0.02, 1.5];
    let phi = (0..robot.parameters.len()).map(|k| {
        if k / 10 < robot.bodies.len() {
            body[k % 10] * (1.0 + 0.1 * wave(k, 0.0))
        } else {
            0.2
        }
    });
    vec![
        (Argument::Q, state.q),
        (Argument::Qd, state.qd),
        (Argument::Qdd, state.qdd),
        (Argument::TauI, rates(3.0)),
        (Argument::Phi, phi.collect()),
    ]
}

fn given<T>(all: &[(Argument, Vec<T>)]) -> Arguments<'_, T> {
    let all = all.iter();
    all.fold(Arguments::EMPTY, |given, (argument, entries)| {
        given.with(*argument, entries)
    })
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most: f64, x| most.max(x.abs()))
}

#[test]
fn compiled_functions_give_what_the_interpreted_ones_give() {
    for (name, compiled) in regen_robots::CONTROLLED {
        let robot = derived(name);
        let model = Interpreted::new(&robot);
        let sizes = Sizes::of(&Model::<f64>::info(&model));
        let arguments = arguments(&robot, &model);
        for function in ControlFunction::ALL {
            let mut found = vec![f64::NAN; sizes.output(function.signature())];
            let mut expected = found.clone();
            let condition = compiled.eval_control(function, given(&arguments), &mut found);
            let condition = condition.unwrap();
            let theirs = model.eval_control(function, given(&arguments), &mut expected);
            assert!((condition.pivot - theirs.unwrap().pivot).abs() < 1e-12);
            let apart = found.iter().zip(&expected).map(|(a, b)| a - b);
            let apart = largest(&apart.collect::<Vec<_>>());
            // rounding of fused products
            assert!(
                apart <= 1e-12 * largest(&expected),
                "{name} {function:?}: {apart:e}"
            );
        }
    }
}

#[test]
fn single_precision_is_the_same_to_its_digits() {
    let robot = derived("fivebar");
    let model = Interpreted::new(&robot);
    let sizes = Sizes::of(&Model::<f64>::info(&model));
    let arguments = arguments(&robot, &model);
    let narrow: Vec<(Argument, Vec<f32>)> = arguments
        .iter()
        .map(|(argument, entries)| (*argument, entries.iter().map(|x| *x as f32).collect()))
        .collect();
    for function in ControlFunction::ALL {
        let mut found = vec![f32::NAN; sizes.output(function.signature())];
        let mut expected = vec![f64::NAN; found.len()];
        let robot = regen_generated::fivebar::Fivebar;
        let condition = robot.eval_control(function, given(&narrow), &mut found);
        assert!(condition.unwrap().is_regular());
        let condition = robot.eval_control(function, given(&arguments), &mut expected);
        assert!(condition.unwrap().is_regular());
        let apart = found.iter().zip(&expected).map(|(a, b)| f64::from(*a) - b);
        let apart = largest(&apart.collect::<Vec<_>>());
        // some hundred roundings of 6e-8
        assert!(
            apart <= 2e-5 * largest(&expected),
            "{function:?}: {apart:e}"
        );
    }
}

#[test]
fn a_mass_matrix_that_is_not_positive_definite_is_told_by_the_condition() {
    for name in ["fivebar", "puma560", "tree_branch"] {
        let robot = derived(name);
        let model = Interpreted::new(&robot);
        let mut arguments = arguments(&robot, &model);
        let dof = robot.independent.len();
        let run = |arguments: &[(Argument, Vec<f64>)], function: ControlFunction, length: usize| {
            let mut out = vec![0.0; length];
            let condition = model.eval_control(function, given(arguments), &mut out);
            condition.unwrap().status()
        };
        let both = [
            (ControlFunction::ForwardDynamics, dof),
            (ControlFunction::ForwardDynamicsDerivatives, 3 * dof * dof),
        ];
        for (function, length) in both {
            assert_eq!(run(&arguments, function, length), Status::Regular, "{name}");
        }
        // a body of negative mass and inertia, as an estimate without bounds may have it
        for (argument, entries) in &mut arguments {
            if *argument == Argument::Phi {
                for entry in entries {
                    *entry = -*entry;
                }
            }
        }
        for (function, length) in both {
            assert_eq!(
                run(&arguments, function, length),
                Status::Singular,
                "{name}"
            );
        }
    }
}

type Matrix = [[f64; 4]; 4];

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    core::array::from_fn(|i| core::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()))
}

/// The velocity of the frame's origin and its angular velocity, from the frame and its rate: the
/// product dR/dt R^T has the entries of the angular velocity. Of the second derivative it gives the
/// accelerations, since the rest of it is symmetric.
fn twist(pose: &Matrix, rate: &Matrix) -> [f64; 6] {
    let entry = |i: usize, j: usize| (0..3).map(|k| rate[i][k] * pose[j][k]).sum::<f64>();
    let about = |i: usize, j: usize| (entry(i, j) - entry(j, i)) / 2.0;
    let [x, y, z] = [0, 1, 2].map(|k| rate[k][3]);
    [x, y, z, about(2, 1), about(0, 2), about(1, 0)]
}

/// A frame at 0.1, -0.2, 0.3 m, turned by 0.4 about x, then -0.5 about y, then 0.6 about z.
fn placed() -> Matrix {
    let turn = |axis: usize, angle: f64| -> Matrix {
        let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut m = Matrix::default();
        for (k, row) in m.iter_mut().enumerate() {
            row[k] = 1.0;
        }
        (m[i][i], m[j][j]) = (angle.cos(), angle.cos());
        (m[j][i], m[i][j]) = (angle.sin(), -angle.sin());
        m
    };
    let mut m = product(&turn(2, 0.6), &product(&turn(1, -0.5), &turn(0, 0.4)));
    (m[0][3], m[1][3], m[2][3]) = (0.1, -0.2, 0.3);
    m
}

#[test]
fn named_frames_move_as_the_second_derivation_says() {
    for name in ["ur5e", "tree_branch", "fourbar", "3rps"] {
        let file = files::robots().join(format!("{name}.yaml"));
        let text = std::fs::read_to_string(file).unwrap();
        let reference = Reference::from_yaml(&text).unwrap();
        let bodies = &reference.bodies;
        let mut text = format!("{text}\nframes:\n");
        for (k, body) in bodies.iter().enumerate() {
            let pose = "xyz: [0.1, -0.2, 0.3], rpy: [0.4, -0.5, 0.6]";
            let label = &body.label;
            writeln!(text, "  - {{name: f{k}, body: {label:?}, {pose}}}").unwrap();
        }
        let mechanism = Mechanism::open(&Source::new(name, text)).unwrap();
        let robot = mechanism.robot(&without_base()).unwrap();
        let model = Interpreted::new(&robot);
        let (count, dof) = (bodies.len(), robot.independent.len());
        for State { q, qd, qdd } in reference.random_states(7, 3).unwrap() {
            let (mut poses, mut bias) = (vec![0.0; 12 * count], vec![0.0; 6 * count]);
            let mut jacobian = vec![0.0; 6 * count * dof];
            model.frame_pose(&q, &mut poses).unwrap();
            assert!(
                model
                    .frame_jacobian(&q, &mut jacobian)
                    .unwrap()
                    .is_regular()
            );
            assert!(
                model
                    .frame_jacobian_rate(&q, &qd, &mut bias)
                    .unwrap()
                    .is_regular()
            );
            let motions = reference.motions(&q, &qd, &qdd);
            for (k, body) in bodies.iter().enumerate() {
                let motion = &motions[body.node];
                let [pose, rate, second] =
                    [&motion.pose, &motion.rate, &motion.second].map(|m| product(m, &placed()));
                let mut expected: Vec<f64> = (0..3).flat_map(|i| pose[i][..3].to_vec()).collect();
                expected.extend((0..3).map(|i| pose[i][3]));
                expected.extend(twist(&pose, &rate));
                expected.extend(twist(&pose, &second));
                let mut found = poses[12 * k..12 * k + 12].to_vec();
                let row = |axis: usize, of: &[f64]| -> f64 {
                    let row = &jacobian[(6 * k + axis) * dof..(6 * k + axis + 1) * dof];
                    let rates = robot.independent.iter().map(|c| of[*c]);
                    row.iter()
                        .zip(rates)
                        .map(|(entry, rate)| entry * rate)
                        .sum()
                };
                found.extend((0..6).map(|axis| row(axis, &qd)));
                found.extend((0..6).map(|axis| row(axis, &qdd) + bias[6 * k + axis]));
                let apart = found.iter().zip(&expected).map(|(a, b)| a - b);
                let apart = largest(&apart.collect::<Vec<_>>());
                // rounding; states of loops are closed to 1e-14 and some hundred times that in rates
                assert!(
                    apart <= 1e-12 * (1.0 + largest(&expected)),
                    "{name} {}: {apart:e}",
                    body.label
                );
            }
        }
    }
}
