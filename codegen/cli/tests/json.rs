//! The JSON output of `info`, `eval` and the identification.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::Path;

use crate::common::{oracle, regen, regen_with, scratch, workspace};
use serde_json::{Value, json};

fn keys(value: &Value) -> Vec<&str> {
    let mut keys: Vec<&str> = value
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect();
    keys.sort_unstable();
    keys
}

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap())
        .collect()
}

fn oracle_json(name: &str) -> Value {
    serde_json::from_str(&fs::read_to_string(oracle(&format!("{name}.json"))).unwrap()).unwrap()
}

#[test]
fn info_has_the_keys_and_names_of_the_format() {
    let dir = scratch("info");
    for name in ["fivebar", "puma560", "tree_branch", "3rps"] {
        let file = oracle(&format!("{name}.yaml"));
        let info = regen(&dir, &["info", &file, "--format", "json"])
            .ended(0)
            .json();
        let expected = oracle_json(name);
        assert_eq!(
            keys(&info),
            [
                "coordinates",
                "cuts",
                "dof",
                "home",
                "independent",
                "operations",
                "parameters",
                "robot"
            ]
        );
        for key in ["robot", "coordinates", "independent", "parameters"] {
            assert_eq!(info[key], expected[key], "{name}: {key}");
        }
        assert_eq!(info["dof"], info["independent"].as_array().unwrap().len());
        assert_eq!(keys(&info["operations"]), ["add", "div", "mul", "sincos"]);
        assert!(info["operations"]["mul"].as_u64().unwrap() > 0);
    }
    let info = regen(&dir, &["info", &oracle("3rps.yaml"), "--format", "json"]).json();
    assert_eq!(
        info["cuts"],
        json!([{"name": "s2", "rows": 3}, {"name": "s3", "rows": 3}])
    );
}

#[test]
fn eval_uses_full_states_as_given_and_agrees_with_the_oracle() {
    let dir = scratch("eval-full");
    for name in ["fivebar", "puma560", "tree_branch", "3rps"] {
        let expected = oracle_json(name);
        let inputs: Vec<Value> = expected["states"]
            .as_array()
            .unwrap()
            .iter()
            .map(|s| json!({"q": s["q"], "qd": s["qd"], "qdd": s["qdd"]}))
            .collect();
        let file = oracle(&format!("{name}.yaml"));
        let args = ["eval", &file, "--states", "-", "--format", "json"];
        let out = regen_with(&dir, &args, &Value::from(inputs).to_string())
            .ended(0)
            .json();
        let states = expected["states"].as_array().unwrap();
        assert_eq!(out.as_array().unwrap().len(), states.len());
        for (got, want) in out.as_array().unwrap().iter().zip(states) {
            assert_eq!(
                keys(got),
                [
                    "base_regressor",
                    "bias",
                    "jacobian",
                    "q",
                    "qd",
                    "qdd",
                    "regressor",
                    "residual"
                ]
            );
            for key in ["q", "qd", "qdd"] {
                assert_eq!(
                    got[key], want[key],
                    "{name}: {key} is given back to the last bit"
                );
            }
            let rows = |v: &Value| {
                v["regressor"]
                    .as_array()
                    .unwrap()
                    .iter()
                    .map(numbers)
                    .collect()
            };
            let (got, want): (Vec<Vec<f64>>, Vec<Vec<f64>>) = (rows(got), rows(want));
            assert_eq!(got.len(), want.len());
            for (a, b) in got.iter().zip(&want) {
                assert_eq!(a.len(), b.len());
                let scale = b.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
                let error = a
                    .iter()
                    .zip(b)
                    .fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
                assert!(error <= 1e-11 * scale, "{name}: {error} of {scale}");
            }
        }
    }
}

#[test]
fn eval_closes_independent_states_from_home() {
    let dir = scratch("eval-independent");
    let states =
        r#"[{"independent": {"q": [0.6, 0.62, 0.58], "qd": [0.1, 0, -0.1], "qdd": [1, 2, 3]}}]"#;
    fs::write(dir.join("in.json"), states).unwrap();
    let file = oracle("3rps.yaml");
    let args = ["eval", &file, "--states", "in.json", "--format", "json"];
    let out = regen(&dir, &args).ended(0).json();
    let state = &out[0];
    let info = regen(&dir, &["info", &file, "--format", "json"]).json();
    let place = |name: &str| {
        let all = info["coordinates"].as_array().unwrap();
        all.iter().position(|c| c == name).unwrap()
    };
    for (name, q) in [("q2", 0.6), ("q7", 0.62), ("q9", 0.58)] {
        assert_eq!(state["q"][place(name)], q);
    }
    let residual = numbers(&state["residual"]);
    assert_eq!(residual.len(), 6);
    assert!(residual.iter().all(|r| r.abs() < 1e-12), "{residual:?}");
    let (qd, qdd, bias) = (
        numbers(&state["qd"]),
        numbers(&state["qdd"]),
        numbers(&state["bias"]),
    );
    for (row, b) in state["jacobian"].as_array().unwrap().iter().zip(bias) {
        let row = numbers(row);
        let dot = |v: &[f64]| row.iter().zip(v).map(|(a, b)| a * b).sum::<f64>();
        assert!(dot(&qd).abs() < 1e-12, "A qd = 0");
        assert!((dot(&qdd) - b).abs() < 1e-11, "A qdd = b");
    }
}

#[test]
fn trees_have_no_closure() {
    let dir = scratch("eval-tree");
    let six = "[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]";
    let states = format!(r#"[{{"q": {six}, "qd": {six}, "qdd": {six}}}]"#);
    let file = oracle("puma560.yaml");
    let args = ["eval", &file, "--states", "-", "--format", "json"];
    let out = regen_with(&dir, &args, &states).ended(0).json();
    for key in ["residual", "jacobian", "bias"] {
        assert_eq!(out[0][key], json!([]), "{key}");
    }
}

#[test]
fn no_states_give_no_results() {
    let dir = scratch("eval-none");
    let args = [
        "eval",
        &oracle("fivebar.yaml"),
        "--states",
        "-",
        "--format",
        "json",
    ];
    assert_eq!(regen_with(&dir, &args, "[]").ended(0).out, "[]\n");
}

#[test]
fn the_main_job_verifies_every_oracle_robot() {
    let dir = workspace("main-job", &[]);
    for name in ["fivebar", "puma560", "tree_branch", "3rps"] {
        let file = oracle(&format!("{name}.yaml"));
        let out = dir.join("generated/src").display().to_string();
        let run = regen(&dir, &[&file, "--out", &out, "--format", "json"]).ended(0);
        let summary = run.json();
        assert_eq!(summary["base"]["complete"], true, "{name}");
        assert_eq!(
            summary["base"]["rank"],
            summary["base"]["certificate"]["rank"]
        );
        let checks = summary["checks"].as_array().unwrap();
        assert!(checks.len() >= 15, "{checks:?}");
        assert!(checks.iter().all(|c| c["ok"] == true), "{checks:?}");
        let source = summary["source"].as_str().unwrap();
        assert!(Path::new(source).is_file(), "{source}");
    }
}

#[test]
fn the_human_tables_fit_80_columns() {
    let dir = workspace("tables", &[]);
    let file = oracle("fivebar.yaml");
    let states = r#"[{"independent": {"q": [], "qd": [], "qdd": []}}]"#;
    let info = regen(&dir, &["info", &file]).ended(0);
    let main = regen(&dir, &[&file, "--out", "."]).ended(0);
    let wrong = regen_with(&dir, &["eval", &file, "--states", "-"], states).ended(3);
    assert!(wrong.err.contains("has 0 entries"), "{}", wrong.err);
    assert!(main.out.contains("11 base parameters"), "{}", main.out);
    assert!(main.out.contains("in 96 digits"), "{}", main.out);
    for line in info.out.lines().chain(main.out.lines()) {
        assert!(line.chars().count() <= 80, "{line}");
    }
}
