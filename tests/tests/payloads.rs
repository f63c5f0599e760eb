//! Payloads: bodies that are carried in some runs only, so that runs with and without them separate
//! their parameters from the robot's.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use nalgebra::{DMatrix, DVector};
use regen_codegen::Mechanism as Derivation;
use regen_codegen::base::{Analysis, BaseParameter};
use regen_codegen::diag::Source;
use regen_codegen::robot::Robot;
use regen_codegen::signature::FunctionKind;
use regen_codegen::spec::Payloads;
use regen_tests::derived::Derived;
use regen_tests::engine::Engine;
use regen_tests::reference::{Mechanism, Random};

fn file(path: &str) -> String {
    let path = format!("{}/../{path}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(path).unwrap()
}

/// A robot of `robots/` with a load on one of its bodies, in a limb of its own.
fn loaded(robot: &str, on: &str) -> String {
    let text = file(&format!("robots/{robot}.yaml"));
    let limb = format!(
        "limbs:\n  - name: tool\n    from: {on}\n    joints:\n      \
         - {{type: fixed, origin: {{xyz: [0.05, 0.02, 0.1], rpy: [0, pi/5, 0]}}, body: load, payload: true}}\n"
    );
    text.replacen("limbs:\n", &limb, 1)
}

fn robots() -> [(&'static str, String, usize); 3] {
    [
        (
            "an arm of three joints",
            file("tests/fixtures/mechanisms/payload.yaml"),
            10,
        ),
        // a body that moves in all ways: all ten parameters
        ("PUMA 560", loaded("puma560", "6"), 10),
        // in a vertical plane: the moment of inertia, two moments and the mass
        ("a five-bar", loaded("fivebar", "2"), 4),
    ]
}

fn analysed(text: &str, payloads: Payloads) -> (Robot, Analysis) {
    let mechanism = Derivation::open(&Source::new("payload.yaml", text)).unwrap();
    let mechanism = mechanism.with_payloads(payloads);
    let analysis = mechanism.analysis().unwrap().clone();
    assert!(analysis.complete);
    (mechanism.robot(&[]).unwrap(), analysis)
}

/// The labels and coefficients of a base parameter, sorted by label.
fn labelled_terms(robot: &Robot, parameter: &BaseParameter) -> Vec<(String, f64)> {
    let terms = parameter.terms.iter();
    let mut terms: Vec<(String, f64)> = terms
        .map(|t| (robot.parameters[t.column].label.clone(), t.value.to_f64()))
        .collect();
    terms.sort_by(|a, b| a.0.cmp(&b.0));
    terms
}

#[test]
fn base_parameters_have_the_rank_of_runs_with_and_without_the_payload() {
    for (name, text, of_payload) in robots() {
        let (robot, analysis) = analysed(&text, Payloads::Apart);
        let is_payload = |p: &&BaseParameter| robot.payload_of(p.column).is_some();
        let own = analysis.base.parameters.iter().filter(is_payload).count();
        assert_eq!(own, of_payload, "{name}");
        // those of the payload come last
        let last = analysis.base.parameters.iter().rev().take(own);
        assert_eq!(last.filter(is_payload).count(), own, "{name}");
        let certificate = analysis.certificate.as_ref().unwrap();
        assert_eq!(certificate.rank, analysis.base.rank(), "{name}");
        assert!(certificate.is_certain(), "{name}: {certificate:?}");

        let mechanism = Mechanism::from_yaml(&text).unwrap();
        let columns = robot.parameters.len();
        let count = 4 * columns / mechanism.dof();
        let mut w = DMatrix::zeros(2 * count * mechanism.dof(), columns);
        let states = mechanism.random_states(5, 2 * count).unwrap();
        for (k, state) in states.iter().enumerate() {
            let mut rows = mechanism
                .regressor(&state.q, &state.qd, &state.qdd)
                .unwrap();
            if k % 2 == 0 {
                for column in (0..columns).filter(|c| robot.payload_of(*c).is_some()) {
                    rows.column_mut(column).fill(0.0);
                }
            }
            w.rows_mut(k * mechanism.dof(), mechanism.dof())
                .copy_from(&rows);
        }
        let mut scaled = w.clone();
        for mut column in scaled.column_iter_mut() {
            let norm = column.norm();
            column /= if norm > 1e-9 { norm } else { f64::INFINITY };
        }
        let values = scaled.singular_values();
        let largest = values.max();
        let rank = values.iter().filter(|v| **v > 1e-10 * largest).count();
        assert_eq!(rank, analysis.base.rank(), "{name}");
        // the forces of any parameters are those of their base parameters, in both kinds of runs
        let mut random = Random::new(7);
        let phi = DVector::from_vec(random.vector(columns, 1.0));
        let mut kept = DVector::zeros(columns);
        for parameter in &analysis.base.parameters {
            let terms = parameter.terms.iter();
            kept[parameter.column] = terms.map(|t| t.value.to_f64() * phi[t.column]).sum();
        }
        let (forces, again) = (&w * &phi, &w * kept);
        assert!((&forces - again).amax() < 1e-12 * forces.amax(), "{name}");
    }
}

#[test]
fn the_base_of_the_robot_alone_is_that_without_the_payload() {
    for (name, text, _) in robots() {
        let (apart, with) = analysed(&text, Payloads::Apart);
        let (absent, without) = analysed(&text, Payloads::Absent);
        assert!(absent.bodies.iter().all(|body| body != "load"), "{name}");
        let own = with.base.parameters.iter();
        let own: Vec<_> = own
            .filter(|p| apart.payload_of(p.column).is_none())
            .map(|p| labelled_terms(&apart, p))
            .collect();
        let alone = without.base.parameters.iter();
        let alone: Vec<_> = alone.map(|p| labelled_terms(&absent, p)).collect();
        assert_eq!(own.len(), alone.len(), "{name}");
        for (a, b) in own.iter().zip(&alone) {
            let same = a.len() == b.len()
                && a.iter()
                    .zip(b)
                    .all(|(x, y)| x.0 == y.0 && (x.1 - y.1).abs() <= 1e-12 * x.1.abs());
            assert!(same, "{name}: {a:?} {b:?}");
        }
        // a payload that is always carried is a body like all others
        let (_, carried) = analysed(&text, Payloads::Carried);
        let (_, unmarked) = analysed(&text.replace(", payload: true", ""), Payloads::Apart);
        assert_eq!(carried.base, unmarked.base, "{name}");
        assert!(carried.base.rank() < with.base.rank(), "{name}");
    }
}

#[test]
fn converted_parameters_of_robot_and_payload_do_not_mix() {
    let text = file("tests/fixtures/mechanisms/payload.yaml");
    let derived = Derived::new("payload.yaml", &text).unwrap();
    let nominal: Vec<f64> = derived
        .robot
        .nominal
        .iter()
        .map(|value| value.unwrap_or(0.0))
        .collect();
    let mut alone = nominal.clone();
    for (column, value) in alone.iter_mut().enumerate() {
        if derived.robot.payload_of(column).is_some() {
            *value = 0.0;
        }
    }
    let base = |phi: &[f64]| derived.call(FunctionKind::ToBase, &[phi]).unwrap();
    let (with, without) = (base(&nominal), base(&alone));
    let parameters = &derived.robot.analysis.as_ref().unwrap().base.parameters;
    for ((a, b), parameter) in with.iter().zip(&without).zip(parameters) {
        let payload = derived.robot.payload_of(parameter.column).is_some();
        // exactly, since no coefficient joins the two groups
        let expected = if payload { 0.0 } else { *a };
        assert_eq!(b.to_bits(), expected.to_bits(), "{parameter:?}");
    }
    assert!(
        with.iter()
            .zip(&without)
            .any(|(a, b)| a.to_bits() != b.to_bits())
    );
}
