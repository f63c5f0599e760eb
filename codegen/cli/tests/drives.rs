//! Drives, from the description to identified parameters, as a user runs it.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::Path;

use crate::common::{regen, scratch};
use serde_json::Value;

fn wrist(dir: &Path) {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/fixtures/mechanisms/differential_wrist.yaml"
    );
    fs::copy(path, dir.join("wrist.yaml")).unwrap();
}

fn run(dir: &Path, line: &str) -> String {
    let words: Vec<&str> = line.split(' ').collect();
    regen(dir, &words).ended(0).out
}

#[test]
fn motors_of_a_differential_are_identified_from_their_own_logs() {
    let dir = scratch("drives");
    wrist(&dir);
    run(
        &dir,
        "excite wrist.yaml --out t.json --seed 1 --harmonics 4 --starts 1 --frequency 0.4",
    );
    run(
        &dir,
        "simulate wrist.yaml --trajectory t.json --noise 1e-4,1e-4 --duration 5 --seed 3 --out log.csv",
    );
    // the log has columns of the motors and none of the joints
    let log = fs::read_to_string(dir.join("log.csv")).unwrap();
    let header = log.lines().find(|line| line.starts_with('t')).unwrap();
    assert_eq!(header, "t,m4,m5,m6,tau_m4,tau_m5,tau_m6");
    run(
        &dir,
        "identify wrist.yaml log.csv --out p.json --bodies found.yaml --feasible",
    );
    let text = fs::read_to_string(dir.join("p.json")).unwrap();
    let file: Value = serde_json::from_str(&text).unwrap();
    let rows = file["parameters"].as_array().unwrap();
    for (label, actual) in [
        ("Fo(m4)", 0.01),
        ("Fo(m6)", 0.008),
        ("Fc(m5)", 0.012),
        ("Fc(m6)", 0.015),
    ] {
        let row = rows.iter().find(|row| row["label"] == label);
        let row = row.unwrap_or_else(|| panic!("{label}: {text}"));
        let value = row["value"].as_f64().unwrap();
        let sigma = row["sigma"].as_f64().unwrap();
        assert!(sigma < 0.1 * actual, "{label}: {value} {sigma}");
        assert!(
            (value - actual).abs() < 4.0 * sigma,
            "{label}: {value} {sigma}"
        );
    }
    // the identified values replace the nominal ones in the entries of the motors
    let found = fs::read_to_string(dir.join("found.yaml")).unwrap();
    let motor = found
        .lines()
        .find(|line| line.starts_with("  m5:"))
        .unwrap();
    assert!(
        motor.starts_with("  m5: {of: n*(q5 + q6), friction: linear,"),
        "{motor}"
    );
    assert!(!motor.contains("Fo: -0.006}"), "{motor}");
    run(&dir, "check found.yaml");
}

#[test]
fn every_command_supports_drives() {
    let dir = scratch("drives_commands");
    wrist(&dir);
    let info: Value = serde_json::from_str(&run(&dir, "info wrist.yaml --format json")).unwrap();
    assert_eq!(info["independent"], serde_json::json!(["m4", "m5", "m6"]));
    assert_eq!(info["coordinates"][5], "m6");
    let check = run(&dir, "check wrist.yaml");
    assert!(check.contains("drive m4 is 50 q4 + 1.04719"), "{check}");
    assert!(check.contains("drive m6 is 32 q5 - 32 q6"), "{check}");
    let base = run(&dir, "base wrist.yaml");
    assert!(
        base.contains("J(m5)") && !base.contains("INCOMPLETE"),
        "{base}"
    );
    let verified = run(&dir, "verify wrist.yaml");
    assert!(!verified.contains("FAILS"), "{verified}");
    // equal turns of both motors turn q5 alone
    fs::write(
        dir.join("states.json"),
        r#"[{"independent": {"q": [1.0471975511965976, 6.4, 6.4], "qd": [0, 0, 0], "qdd": [0, 0, 0]}}]"#,
    )
    .unwrap();
    let found = run(&dir, "eval wrist.yaml --states states.json --format json");
    let found: Value = serde_json::from_str(&found).unwrap();
    let q: Vec<f64> = serde_json::from_value(found[0]["q"].clone()).unwrap();
    for (q, known) in q.iter().zip([0.0, 0.2, 0.0]) {
        assert!((q - known).abs() < 1e-13, "{found}");
    }
    let page = run(&dir, "view wrist.yaml --out wrist.html");
    assert!(!page.contains("error"), "{page}");
    let page = fs::read_to_string(dir.join("wrist.html")).unwrap();
    // the page sweeps the motors but draws no joint for them
    assert!(
        page.contains("\"m5\"") && !page.contains("\"name\":\"m5\",\"kind\""),
        "motors"
    );
}
