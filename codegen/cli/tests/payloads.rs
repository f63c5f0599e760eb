//! Payloads, from the description to parameters identified with and without them.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::fs;
use std::path::Path;

use common::{regen, scratch};
use serde_json::Value;

fn arm(dir: &Path) {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/fixtures/mechanisms/payload.yaml"
    );
    fs::copy(path, dir.join("arm.yaml")).unwrap();
}

fn run(dir: &Path, line: &str, code: i32) -> (String, String) {
    let words: Vec<&str> = line.split(' ').collect();
    let ended = regen(dir, &words).ended(code);
    (ended.out, ended.err)
}

#[test]
fn the_table_of_base_parameters_has_the_payload_s_behind_the_robot_s() {
    let dir = scratch("payload_base");
    arm(&dir);
    let (table, _) = run(&dir, "base arm.yaml", 0);
    let (robot, load) = table.split_once("payload load:\n").unwrap();
    assert!(
        robot.contains("J(q3)") && !robot.contains("(load)"),
        "{table}"
    );
    assert!(
        load.contains("mx(load)") && !load.contains("(fore)"),
        "{table}"
    );
    let (json, _) = run(&dir, "base arm.yaml --format json", 0);
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["payloads"][0]["body"], "load");
    let rows = json["base"].as_array().unwrap();
    let of_load = rows.iter().filter(|row| row["payload"] == "load").count();
    assert_eq!(json["payloads"][0]["rank"], of_load);
    assert_eq!(json["certificate"]["rank"], rows.len());
    let (markdown, _) = run(&dir, "base arm.yaml --format markdown", 0);
    assert!(markdown.contains("| | payload load: | |"), "{markdown}");
    let (verified, _) = run(&dir, "verify arm.yaml", 0);
    assert!(!verified.contains("FAILS"), "{verified}");
}

#[test]
fn runs_say_whether_they_carry_the_payload() {
    let dir = scratch("payload_identify");
    arm(&dir);
    for line in [
        "excite arm.yaml",
        "simulate arm.yaml --out log.csv",
        "identify arm.yaml log.csv",
    ] {
        let (_, err) = run(&dir, line, 3);
        assert!(
            err.contains("arm.yaml has the payload 'load': say whether it is carried"),
            "{line}: {err}"
        );
    }
    fs::write(
        dir.join("bare.yaml"),
        fs::read_to_string(dir.join("arm.yaml"))
            .unwrap()
            .replace(", payload: true", ""),
    )
    .unwrap();
    let (_, err) = run(&dir, "simulate bare.yaml --out log.csv --payload none", 3);
    assert!(err.contains("bare.yaml has no payload"), "{err}");

    run(
        &dir,
        "excite arm.yaml --payload carried --out t.json --seed 1 --harmonics 3 --starts 1 --frequency 0.4",
        0,
    );
    for payload in ["none", "carried"] {
        let of = format!("--payload {payload}");
        run(
            &dir,
            &format!(
                "simulate arm.yaml --trajectory t.json --noise 1e-5,0.01 --seed 3 --out {payload}.csv {of}"
            ),
            0,
        );
        run(
            &dir,
            &format!("identify arm.yaml {payload}.csv --out {payload}.json {of}"),
            0,
        );
        let text = fs::read_to_string(dir.join(format!("{payload}.json"))).unwrap();
        let file: Value = serde_json::from_str(&text).unwrap();
        let rows = file["parameters"].as_array().unwrap();
        let of_load = |row: &Value| {
            row["combination"]
                .as_str()
                .is_some_and(|c| c.contains("(load)"))
        };
        assert_eq!(rows.iter().any(of_load), payload == "carried", "{text}");
    }
    // parameters of the robot with the load are not those of the robot without
    let (_, err) = run(
        &dir,
        "validate arm.yaml none.json none.csv --payload carried",
        3,
    );
    assert!(err.contains("none.json"), "{err}");
}
