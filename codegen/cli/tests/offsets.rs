//! Constant efforts of joints from a simulated log to identified parameters, as a user runs it.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::Path;

use crate::common::{regen, scratch};
use serde_json::Value;

/// An arm in a vertical plane with offsets of both signs; `FRICTION` stands for the law and the
/// nominal values of q1.
const ARM: &str = "\
name: arm
limbs:
  - name: arm
    base: {rpy: [pi/2, 0, 0]}
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true, limits: {position: [-2, 2], velocity: [-6, 6]}, FRICTION, offset: true}
      - {name: q2, type: revolute, dh: {a: 0.4}, body: 2, actuated: true, limits: {position: [-2, 2], velocity: [-6, 6]}, friction: viscous, offset: true, nominal: {Fv: 0.2, Fo: 0.7}}
bodies:
  1: {mass: 2, com: [0.2, 0.01, 0], inertia: [0.01, 0, 0, 0.05, 0, 0.05]}
  2: {mass: 1, com: [0.1, 0.02, 0], inertia: [0.01, 0, 0, 0.02, 0, 0.02]}
";

/// Writes the arm with a friction law and nominal values of q1, and a log of a simulated run with
/// noise.
fn simulated(dir: &Path, friction: &str) {
    fs::write(dir.join("arm.yaml"), ARM.replace("FRICTION", friction)).unwrap();
    let excite = "excite arm.yaml --out t.json --seed 1 --harmonics 4 --starts 1";
    run(dir, excite);
    let simulate = "simulate arm.yaml --trajectory t.json --noise 1e-5,0.02 --seed 3 --out log.csv";
    run(dir, simulate);
}

fn run(dir: &Path, line: &str) -> String {
    let words: Vec<&str> = line.split(' ').collect();
    regen(dir, &words).ended(0).out
}

/// Value and standard deviation of a base parameter in a parameter file.
fn found(dir: &Path, label: &str) -> (f64, f64) {
    let text = fs::read_to_string(dir.join("p.json")).unwrap();
    let file: Value = serde_json::from_str(&text).unwrap();
    let rows = file["parameters"].as_array().unwrap();
    let row = rows.iter().find(|r| r["label"] == label);
    let row = row.unwrap_or_else(|| panic!("{label}: {text}"));
    (
        row["value"].as_f64().unwrap(),
        row["sigma"].as_f64().unwrap(),
    )
}

#[test]
fn offsets_are_recovered_from_a_simulated_log_with_their_signs() {
    let dir = scratch("offsets_linear");
    simulated(
        &dir,
        "friction: linear, nominal: {Fv: 0.3, Fc: 0.5, Fo: -1.2}",
    );
    for feasible in ["", " --feasible"] {
        run(
            &dir,
            &format!("identify arm.yaml log.csv --out p.json{feasible}"),
        );
        for (label, actual) in [("Fo(q1)", -1.2), ("Fo(q2)", 0.7)] {
            let (value, sigma) = found(&dir, label);
            assert!(sigma < 0.02, "{label}: {value} {sigma}");
            assert!(
                (value - actual).abs() < 3.0 * sigma,
                "{label}: {value} {sigma}"
            );
        }
    }
    // the energy balance of the simulation contains the work of the constant efforts
    let log = run(
        &dir,
        "simulate arm.yaml --trajectory t.json --out again.csv --format json",
    );
    let log: Value = serde_json::from_str(&log).unwrap();
    let imbalance = log["runs"][0]["imbalance"].as_f64();
    assert!(imbalance.is_some_and(|x| x.abs() < 1e-6), "{log}");
}

#[test]
fn an_offset_beside_nonlinear_friction_stays_a_linear_column() {
    let dir = scratch("offsets_stribeck");
    simulated(
        &dir,
        "friction: lugre, nominal: {Fc: 0.5, Fs: 0.8, vs: 0.5, Fv: 0.3, Fo: -1.2}",
    );
    run(&dir, "identify arm.yaml log.csv --friction --out p.json");
    let (value, sigma) = found(&dir, "Fo(q1)");
    assert!((value + 1.2).abs() < 0.02, "{value} {sigma}");
}
