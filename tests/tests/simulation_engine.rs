//! The simulated robot compared with another engine: Pinocchio's constraint dynamics on mechanisms
//! that were built there from their dimensions (`tests/tools/vectors/simulation.py`).
#![allow(clippy::unwrap_used, clippy::expect_used)]

use regen_experiment::simulate::{Forward, ForwardOutcome, Settings, Termination, simulate};
use regen_generated::{fivebar, rps3};
use regen_runtime::{LoopClosure, Model};
use serde_json::Value;

/// The relative tolerance of accelerations. The vectors' constraints hold to 1e-14 m, and the
/// solves on either side multiply rounding by the condition of mass matrix and A_e, below 1e3 here:
/// the product is about 1e-12. Measured: 4e-15.
const ACCELERATION_TOLERANCE: f64 = 1e-12;
/// The tolerance of positions, rad or m, and velocities at the end of the run. The end in the
/// vectors changes by 3e-13 when the step is halved; a step of the run here may have an error of
/// 1e-12. Measured: 3e-12.
const RUN_TOLERANCE: f64 = 1e-10;

fn numbers(value: &Value) -> Vec<f64> {
    let values = value.as_array().unwrap().iter();
    values.map(|x| x.as_f64().unwrap()).collect()
}

fn vectors(robot: &str) -> Value {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/fixtures/computed/simulation.json"
    );
    let text = std::fs::read_to_string(path).unwrap();
    let all: Value = serde_json::from_str(&text).unwrap();
    let robots = all["robots"].as_array().unwrap();
    robots.iter().find(|r| r["robot"] == robot).unwrap().clone()
}

/// The largest difference, relative to the largest entry or 1 if that is larger.
fn apart(ours: &[f64], theirs: &[f64]) -> f64 {
    assert_eq!(ours.len(), theirs.len());
    let size = theirs.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
    let pairs = ours.iter().zip(theirs);
    pairs.fold(0.0_f64, |m, (a, b)| m.max((a - b).abs())) / size
}

fn assert_agrees(model: &dyn Model) {
    let info = model.info();
    let vectors = vectors(info.name);
    let names: Vec<&str> = vectors["coordinates"]
        .as_array()
        .unwrap()
        .iter()
        .map(|n| n.as_str().unwrap())
        .collect();
    assert_eq!(names, info.coordinates);
    let phi = info.nominal_parameters().unwrap();
    let mut forward = Forward::new(model, &phi).unwrap();
    let (n, dof) = (names.len(), info.dof());
    let mut worst: f64 = 0.0;
    let states = vectors["states"].as_array().unwrap();
    assert_eq!(states.len(), 12);
    for state in states {
        let [q, qd, effort, theirs] = ["q", "qd", "effort", "qdd"].map(|key| numbers(&state[key]));
        let mut reduced = vec![0.0; dof];
        let _ = model.generalized_forces(&q, &effort, &mut reduced).unwrap();
        let mut qdd_i = vec![0.0; dof];
        let outcome = forward
            .accelerations(&q, &qd, &reduced, &mut qdd_i)
            .unwrap();
        assert!(matches!(outcome, ForwardOutcome::Solved(_)));
        let mut ours = vec![0.0; n];
        let _ = model.accelerations(&q, &qd, &qdd_i, &mut ours).unwrap();
        worst = worst.max(apart(&ours, &theirs));
    }
    println!("{}: accelerations {worst:e} apart", info.name);
    assert!(worst < ACCELERATION_TOLERANCE, "{worst:e}");

    let run = &vectors["run"];
    let [q, qd, effort, end_q, end_qd] =
        ["q", "qd", "effort", "end_q", "end_qd"].map(|key| numbers(&run[key]));
    let independent =
        |all: &[f64]| -> Vec<f64> { info.independent.iter().map(|c| all[*c]).collect() };
    let (start_q, start_qd) = (independent(&q), independent(&qd));
    // the vectors are on the branch of home
    let closed = LoopClosure::new(model).unwrap().solve(&start_q).unwrap();
    assert!(apart(&closed.q, &q) < 1e-12);
    let start = |_: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
        q.copy_from_slice(&start_q);
        qd.copy_from_slice(&start_qd);
        qdd.fill(0.0);
    };
    let settings = Settings {
        duration: run["duration"].as_f64().unwrap(),
        offset: effort,
        tolerance: 1e-12,
        ..Settings::default()
    };
    let log = simulate(model, &phi, &start, &settings).unwrap();
    assert_eq!(log.ended, Termination::Complete);
    let (last_q, last_qd) = (&log.q[log.q.len() - n..], &log.qd[log.qd.len() - n..]);
    // the mechanism moved
    assert!(apart(last_q, &q) > 1e-2);
    let (in_q, in_qd) = (apart(last_q, &end_q), apart(last_qd, &end_qd));
    println!("{}: end of the run {in_q:e} and {in_qd:e} apart", info.name);
    assert!(
        in_q < RUN_TOLERANCE && in_qd < RUN_TOLERANCE,
        "{in_q:e} {in_qd:e}"
    );
}

#[test]
fn a_spatial_platform_moves_as_in_another_engine() {
    assert_agrees(&rps3::Rps3);
}

#[test]
fn a_planar_linkage_moves_as_in_another_engine() {
    assert_agrees(&fivebar::Fivebar);
}
