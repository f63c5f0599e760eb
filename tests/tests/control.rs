//! Compiled functions for controllers give what the interpreted ones give, at one state and in
//! single precision, and tell by their condition where the mass matrix is not positive definite.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use regen_codegen::Mechanism;
use regen_codegen::diag::Source;
use regen_codegen::robot::{FunctionKind, Robot};
use regen_interpreted::Interpreted;
use regen_runtime::function::{Argument, Sizes};
use regen_runtime::{Arguments, ControlFunction, ControlModel, LoopClosure, Model, Status};
use regen_tests::files;

fn derived(name: &str) -> Robot {
    let file = files::robots().join(format!("{name}.yaml"));
    let text = std::fs::read_to_string(file).unwrap();
    let mechanism = Mechanism::open(&Source::new(name, text)).unwrap();
    mechanism.robot(&FunctionKind::ALL).unwrap()
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
    let phi = (0..robot.parameters.len()).map(|k| match k / 10 < robot.bodies.len() {
        true => body[k % 10] * (1.0 + 0.1 * wave(k, 0.0)),
        false => 0.2,
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
                entries.iter_mut().for_each(|x| *x = -*x);
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
