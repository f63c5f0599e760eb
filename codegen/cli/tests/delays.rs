//! Efforts that are logged late: `--delay auto` of commands that do not identify.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::Path;

use crate::common::{regen, scratch};
use serde_json::Value;

const ARM: &str = "\
name: arm
gravity: [0, 0, -9.81]
limbs:
  - name: arm
    joints:
      - {name: x, type: prismatic, axis: x, body: cart, actuated: true,
         friction: viscous, nominal: {Fv: 4.0}, limits: {position: [-0.5, 0.5]}}
      - {name: q, type: revolute, axis: y, body: rod, actuated: true,
         friction: viscous, nominal: {Fv: 0.3}, limits: {position: [-2, 2]}}
home: {x: 0.1, q: 0.3}
bodies:
  cart: {mass: 3.0, com: [0, 0, 0], inertia: [0.01, 0, 0, 0.01, 0, 0.01]}
  rod: {mass: 1.0, com: [0, 0, -0.2], inertia: [0.02, 0, 0, 0.02, 0, 0.001]}
";

/// Several frequencies, since a delay of one frequency alone is as well friction.
const MOTION: &str = r#"{
  "format": "regen-trajectory", "robot": "arm", "coordinates": ["x", "q"], "base_frequency": 0.5,
  "harmonics": 3, "cosine": [[0.1, -0.07, 0.05], [0.4, 0.2, -0.2]],
  "sine": [[0.07, 0.04, -0.1], [0.3, -0.4, 0.3]], "offset": [0.1, 0.2]
}"#;

/// Rows by which the efforts of x are late, and those of q.
const LATE: [usize; 2] = [1, 3];
/// The time between rows, s.
const STEP: f64 = 0.01;

/// Writes `late.csv`: the log with each effort as many rows later.
fn shift(dir: &Path) {
    let text = fs::read_to_string(dir.join("log.csv")).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().map(|l| l.split(',').collect()).collect();
    let late = |title: &str| match title {
        "tau_x" => LATE[0],
        "tau_q" => LATE[1],
        _ => 0,
    };
    let mut out = rows[0].join(",") + "\n";
    for row in 1 + LATE[1]..rows.len() {
        let cells = rows[0].iter().enumerate();
        let cells = cells.map(|(k, title)| rows[row - late(title)][k]);
        out += &(cells.collect::<Vec<_>>().join(",") + "\n");
    }
    fs::write(dir.join("late.csv"), out).unwrap();
}

#[test]
fn observe_and_validate_find_the_delays_that_were_put_in() {
    let dir = scratch("delays");
    fs::write(dir.join("arm.yaml"), ARM).unwrap();
    fs::write(dir.join("m.json"), MOTION).unwrap();
    let run = |line: &str| {
        let words: Vec<&str> = line.split(' ').collect();
        let ended = regen(&dir, &words).ended(0);
        serde_json::from_str::<Value>(&ended.out).unwrap()
    };
    run(
        "simulate arm.yaml --trajectory m.json --duration 6 --noise 1e-6,0.001 --bandwidth 6 --out \
         log.csv --format json",
    );
    shift(&dir);
    let read = "--butterworth 4,15 --format json";
    let right = run(&format!(
        "identify arm.yaml log.csv --out right.json {read}"
    ));
    let values = |found: &Value| -> Vec<f64> {
        let rows = found["parameters"].as_array().unwrap();
        rows.iter()
            .map(|row| row["value"].as_f64().unwrap())
            .collect()
    };
    let close = |found: &Value| {
        let delays = found["corrected_delays"].as_array().unwrap();
        assert_eq!(delays.len(), 2, "{found}");
        for (delay, rows) in delays.iter().zip(LATE) {
            let (seconds, truth) = (delay[1].as_f64().unwrap(), STEP * rows as f64);
            assert!((seconds - truth).abs() < 0.1 * truth, "{delay}");
        }
    };

    // observed with the delays that were found, the log gives the parameters of the log before
    let line = format!("observe arm.yaml late.csv --delay auto --out late.factors {read}");
    close(&run(&line));
    let found = run("identify arm.yaml --from late.factors --format json");
    for (a, b) in values(&found).iter().zip(values(&right)) {
        assert!((a - b).abs() < 0.02 * b.abs().max(0.05), "{a} {b}");
    }

    // predictions fit once the delays are corrected
    let error = |found: &Value| {
        found["models"][0]["logs"][0]["relative_rms"]
            .as_f64()
            .unwrap()
    };
    let line = format!("validate arm.yaml right.json late.csv {read}");
    let before = run(&line);
    assert!(before["corrected_delays"].is_null(), "{before}");
    let after = run(&format!("{line} --delay auto"));
    close(&after);
    // so is a report, which finds them from the same logs
    let line =
        "report arm.yaml right.json late.csv --butterworth 4,15 --delay auto --out late.html";
    regen(&dir, &line.split(' ').collect::<Vec<_>>()).ended(0);
    assert!(error(&after) < 0.2 * error(&before), "{before} {after}");
}
