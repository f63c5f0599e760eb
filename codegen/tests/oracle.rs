//! Comparison of the interpreted regressor and Jacobian with vectors from an independent
//! implementation.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use regen_codegen::diag::Source;
use regen_codegen::interpret::run;
use regen_codegen::pipeline::derive;
use regen_codegen::robot::{FunctionKind, Robot};
use serde_json::Value;

fn numbers(value: &Value) -> Vec<f64> {
    let list = value.as_array().unwrap();
    list.iter().map(|x| x.as_f64().unwrap()).collect()
}

fn oracle(name: &str) -> (Robot, Value) {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/fixtures/oracle");
    let text = std::fs::read_to_string(format!("{folder}/{name}.yaml")).unwrap();
    let vectors = std::fs::read_to_string(format!("{folder}/{name}.json")).unwrap();
    let robot =
        derive(&Source::new(format!("{name}.yaml"), text)).unwrap_or_else(|e| panic!("{e}"));
    (robot, serde_json::from_str(&vectors).unwrap())
}

/// The largest difference in a row, relative to the row's largest entry; rows of rounding errors
/// (below 1e-12 in metres and radians) count as equal.
fn row_error(x: &[f64], y: &[f64]) -> f64 {
    assert_eq!(x.len(), y.len());
    let size = y.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let worst = x
        .iter()
        .zip(y)
        .fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
    if worst < 1e-12 && size < 1e-12 {
        0.0
    } else {
        worst / size
    }
}

fn check(name: &str) {
    let (robot, vectors) = oracle(name);
    let labels = |key: &str| -> Vec<String> {
        let list = vectors[key].as_array().unwrap();
        list.iter()
            .map(|v| v.as_str().unwrap().to_owned())
            .collect()
    };
    assert_eq!(robot.coordinates, labels("coordinates"));
    assert_eq!(robot.labels(), labels("parameters"));
    let independent: Vec<String> = robot
        .independent
        .iter()
        .map(|c| robot.coordinates[*c].clone())
        .collect();
    assert_eq!(independent, labels("independent"));
    let dof = robot.independent.len();
    for state in vectors["states"].as_array().unwrap() {
        let [q, qd, qdd] = ["q", "qd", "qdd"].map(|k| numbers(&state[k]));
        let regressor = &robot.function(FunctionKind::Regressor).unwrap().program;
        let (columns, condition) = run(regressor, &[&q, &qd, &qdd]);
        assert!(condition > 1e-3);
        for (i, row) in state["regressor"].as_array().unwrap().iter().enumerate() {
            let found: Vec<f64> = columns.iter().skip(i).step_by(dof).copied().collect();
            let error = row_error(&found, &numbers(row));
            // both are in double precision, with a condition number below a thousand
            assert!(
                error < 1e-11,
                "{name}: regressor row {i} is off by {error:e}"
            );
        }
        if let Some(rows) = state["jacobian"].as_array() {
            let jacobian = &robot.function(FunctionKind::Jacobian).unwrap().program;
            let (found, _) = run(jacobian, &[&q]);
            for (row, found) in rows.iter().zip(found.chunks(q.len())) {
                let error = row_error(found, &numbers(row));
                assert!(error < 1e-11, "{name}: Jacobian row is off by {error:e}");
            }
        }
    }
}

#[test]
fn serial_regressor_agrees_with_the_oracle() {
    check("puma560");
}

#[test]
fn branched_regressor_agrees_with_the_oracle() {
    check("tree_branch");
}

#[test]
fn planar_loop_agrees_with_the_oracle() {
    check("fivebar");
}

#[test]
fn spatial_loops_agree_with_the_oracle() {
    check("3rps");
}
