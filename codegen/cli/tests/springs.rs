//! Springs and effort terms from a simulated log to identified parameters, as a user runs it.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::Path;

use crate::common::{regen, scratch};
use serde_json::Value;

/// A parallel arm in a vertical plane: a five-bar whose drives have springs, cogging and drag, with a
/// spring between two of its bodies and a gas spring to the ground.
const FIVEBAR: &str = "\
name: sprung
geometry: {l: 0.3}
limbs:
  - name: left
    base: {rpy: [pi/2, 0, 0]}
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true, limits: {position: [1.4, 2.4], velocity: [-4, 4]}, friction: linear, spring: {rest: 1.5}, terms: {cog: sin(12*q)}, nominal: {Fv: 0.2, Fc: 0.1, K: 3, cog: 0.3}}
      - {name: p1, type: revolute, dh: {a: l}, body: 2}
  - name: right
    base: {xyz: [0.2, 0, 0], rpy: [pi/2, 0, 0]}
    joints:
      - {name: q2, type: revolute, body: 3, actuated: true, limits: {position: [0.7, 1.7], velocity: [-4, 4]}, friction: viscous, offset: true, terms: {drag: abs(qd)*qd}, nominal: {Fv: 0.1, Fo: 0.4, drag: 0.08}}
      - {name: p2, type: revolute, dh: {a: l}, body: 4}
cuts:
  - {name: tip, joint: revolute, between: [{body: 2, xyz: [l, 0, 0]}, {body: 4, xyz: [l, 0, 0]}]}
springs:
  - {name: tie, between: [{body: 1, xyz: [0.2, 0, 0]}, {body: 3, xyz: [0.2, 0, 0]}], length: 0.1, nominal: {k: 150}}
  - {name: gas, between: [{body: 1, xyz: [0.1, 0.05, 0]}, {body: world, xyz: [-0.3, 0, 0]}], constant: true, nominal: {f: -20}}
home: {q1: 1.9, p1: -1.2, q2: 1.2, p2: 1.2}
bodies:
  1: {mass: 1, com: [0.15, 0.01, 0], inertia: [0.001, 0, 0, 0.01, 0, 0.01]}
  2: {mass: 0.8, com: [0.12, 0.01, 0], inertia: [0.001, 0, 0, 0.008, 0, 0.008]}
  3: {mass: 1.1, com: [0.16, -0.01, 0], inertia: [0.001, 0, 0, 0.01, 0, 0.01]}
  4: {mass: 0.7, com: [0.14, 0.02, 0], inertia: [0.001, 0, 0, 0.007, 0, 0.007]}
";

fn run(dir: &Path, line: &str) -> String {
    let words: Vec<&str> = line.split(' ').collect();
    regen(dir, &words).ended(0).out
}

#[test]
fn springs_are_recovered_from_a_simulated_log_and_balance_its_energy() {
    let dir = scratch("springs");
    fs::write(dir.join("r.yaml"), FIVEBAR).unwrap();
    run(
        &dir,
        "excite r.yaml --out t.json --seed 1 --harmonics 5 --starts 1",
    );
    let simulated = "simulate r.yaml --trajectory t.json --noise 1e-6,0.005 --seed 3 --out log.csv";
    let report = run(&dir, &format!("{simulated} --format json"));
    let report: Value = serde_json::from_str(&report).unwrap();
    let imbalance = report["runs"][0]["imbalance"].as_f64();
    assert!(imbalance.is_some_and(|x| x.abs() < 1e-5), "{report}");

    for feasible in ["", " --feasible"] {
        run(
            &dir,
            &format!("identify r.yaml log.csv --out p.json{feasible}"),
        );
        let file = fs::read_to_string(dir.join("p.json")).unwrap();
        let file: Value = serde_json::from_str(&file).unwrap();
        let rows = file["parameters"].as_array().unwrap();
        for (label, actual) in [
            ("K(q1)", 3.0),
            ("cog(q1)", 0.3),
            ("Fo(q2)", 0.4),
            ("drag(q2)", 0.08),
            ("k(tie)", 150.0),
            ("f(gas)", -20.0),
        ] {
            let row = rows.iter().find(|r| r["label"] == label);
            let row = row.unwrap_or_else(|| panic!("{label}: {file}"));
            let (value, sigma) = (row["value"].as_f64(), row["sigma"].as_f64());
            let (value, sigma) = (value.unwrap(), sigma.unwrap());
            assert!(
                (value - actual).abs() < 4.0 * sigma.max(1e-3 * actual.abs()),
                "{label}{feasible}: {value} {sigma}"
            );
        }
    }
    // `--bodies` writes the identified values into the spec, also those of springs
    run(
        &dir,
        "identify r.yaml log.csv --feasible --out p.json --bodies found.yaml",
    );
    let found = fs::read_to_string(dir.join("found.yaml")).unwrap();
    assert!(
        !found.contains("k: 150}") && found.contains("K: "),
        "{found}"
    );
    assert!(found.contains("f: -"), "{found}");
}
