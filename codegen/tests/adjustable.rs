//! Functions with an adjustable geometry against those of descriptions with other numbers.
#![allow(clippy::unwrap_used)]

use regen_codegen::Mechanism;
use regen_codegen::diag::Source;
use regen_codegen::interpret;
use regen_codegen::robot::{FunctionKind, Robot};
use regen_codegen::spec::{edit::with_geometry, parse};

/// A planar loop with springs, a screw that carries a tool, and angles; one of its lengths follows from
/// another.
const TEXT: &str = include_str!("../../tests/fixtures/adjustable/adjustable.yaml");

const OTHER: [(&str, &str); 7] = [
    ("g0", "9.7"),
    ("a", "0.31"),
    ("c", "0.345"),
    ("tilt", "0.27"),
    ("lift", "0.015"),
    ("base", "0.49"),
    ("slope", "-2.5"),
];

fn kinds() -> Vec<FunctionKind> {
    FunctionKind::ALL.to_vec()
}

fn constant(text: &str) -> Robot {
    let mechanism = Mechanism::open(&Source::new("test.yaml", text)).unwrap();
    mechanism.robot(&kinds()).unwrap()
}

fn adjustable() -> Robot {
    let mechanism = Mechanism::open(&Source::new("test.yaml", TEXT)).unwrap();
    mechanism.source_robot(&kinds()).unwrap()
}

/// The description with other numbers.
fn changed() -> String {
    let spec = parse(&Source::new("test.yaml", TEXT)).unwrap();
    with_geometry(TEXT, &spec, &OTHER).unwrap()
}

fn run(robot: &Robot, kind: FunctionKind, arguments: &[&[f64]]) -> Vec<f64> {
    interpret::run(&robot.function(kind).unwrap().program, arguments).0
}

/// A closed state near home with these independent coordinates.
fn closed(robot: &Robot, independent: [f64; 3]) -> Vec<f64> {
    let mut q = robot.home.clone();
    for (c, value) in robot.independent.iter().zip(independent) {
        q[*c] += value;
    }
    for _ in 0..20 {
        let step = run(robot, FunctionKind::NewtonStep, &[&q]);
        for (c, d) in robot.dependent.iter().zip(step) {
            q[*c] += d;
        }
    }
    let residual = run(robot, FunctionKind::Constraints, &[&q]);
    assert!(residual.iter().all(|x| x.abs() < 1e-12), "{residual:?}");
    q
}

/// Compares every function at closed states of a robot with constants.
fn compare(expected: &Robot, geometry: &[f64]) {
    let own = adjustable();
    let mut draw = 0.37_f64;
    let mut next = || {
        draw = (draw * 997.0 + 0.123).fract();
        draw - 0.5
    };
    let mut compared = 0;
    for _ in 0..5 {
        let q = closed(expected, [0.4 * next(), 0.4 * next(), 0.4 * next()]);
        let dof = expected.independent.len();
        let independent: Vec<f64> = (0..dof).map(|_| 2.0 * next()).collect();
        let qd = run(expected, FunctionKind::Velocities, &[&q, &independent]);
        let again: Vec<f64> = (0..dof).map(|_| 2.0 * next()).collect();
        let qdd = run(expected, FunctionKind::Accelerations, &[&q, &qd, &again]);
        // bodies as they are stated, so that the mass matrix has an inverse
        let phi: Vec<f64> = expected
            .nominal
            .iter()
            .map(|x| x.unwrap_or(0.5 + next()))
            .collect();
        // the rows of A_e are in the order of pivots, which is that of the numbers
        let others = own
            .functions
            .iter()
            .filter(|f| f.kind != FunctionKind::DependentJacobian);
        for function in others {
            let program = &expected.function(function.kind).unwrap().program;
            let arguments: Vec<&[f64]> = program
                .arguments
                .iter()
                .map(|argument| match (argument.name.as_str(), argument.len) {
                    ("q", _) => &q[..],
                    ("qd", _) => &qd[..],
                    ("qdd", _) => &qdd[..],
                    ("phi", _) => &phi[..],
                    (_, len) => &phi[..len],
                })
                .collect();
            let expected = interpret::run(program, &arguments).0;
            let with: Vec<&[f64]> = arguments.iter().copied().chain([geometry]).collect();
            let found = interpret::run(&function.program, &with).0;
            let size = expected.iter().fold(1.0_f64, |size, x| size.max(x.abs()));
            for (a, b) in expected.iter().zip(&found) {
                // some hundred roundings of numbers of this size
                let off = (a - b).abs() / size;
                assert!(off < 1e-12, "{}: {a} {b}", function.kind.name());
            }
            compared += expected.len();
        }
    }
    assert!(compared > 1000);
}

#[test]
fn functions_with_the_stated_geometry_are_those_of_constants() {
    let geometry: Vec<f64> = adjustable().adjustable.iter().map(|own| own.1).collect();
    assert_eq!(geometry, [9.81, 0.3, 0.35, 0.2, 0.012, 0.5, 3.0]);
    compare(&constant(TEXT), &geometry);
}

#[test]
fn functions_with_another_geometry_are_those_of_a_description_with_its_numbers() {
    let geometry = OTHER.map(|(_, text)| text.parse().unwrap());
    compare(&constant(&changed()), &geometry);
}

#[test]
fn every_function_but_those_of_base_parameters_takes_the_geometry_last() {
    let robot = adjustable();
    let names: Vec<&str> = robot.adjustable.iter().map(|own| own.0.as_str()).collect();
    assert_eq!(names, OTHER.map(|own| own.0));
    let bases = constant(TEXT).functions.len() - robot.functions.len();
    assert_eq!(bases, 7);
    for function in &robot.functions {
        let last = function.program.arguments.last().unwrap();
        assert_eq!((last.name.as_str(), last.len), ("geometry", 7));
    }
    assert!(robot.analysis.is_none());
}

#[test]
fn other_commands_see_constants() {
    let robot = constant(TEXT);
    assert!(robot.adjustable.is_empty());
    let regressor = robot.function(FunctionKind::Regressor).unwrap();
    assert_eq!(regressor.program.arguments.len(), 3);
}
