//! The reference agrees with the published vectors.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use nalgebra::DMatrix;
use regen_tests::engine::row_error;
use regen_tests::files;
use serde_json::Value;

fn numbers(value: &Value) -> Vec<f64> {
    let items = value.as_array().expect("a list");
    items.iter().map(|v| v.as_f64().unwrap()).collect()
}

fn matrix(value: &Value) -> DMatrix<f64> {
    let rows: Vec<Vec<f64>> = value.as_array().unwrap().iter().map(numbers).collect();
    DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j])
}

fn texts(value: &Value) -> Vec<String> {
    let items = value.as_array().expect("a list");
    items.iter().map(|v| v.as_str().unwrap().into()).collect()
}

fn agrees(name: &str) {
    let mechanism = files::mechanism(&files::oracle().join(format!("{name}.yaml"))).unwrap();
    let text = std::fs::read_to_string(files::oracle().join(format!("{name}.json"))).unwrap();
    let oracle: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(mechanism.coordinates, texts(&oracle["coordinates"]));
    assert_eq!(mechanism.labels(), texts(&oracle["parameters"]));
    let independent: Vec<&String> = mechanism
        .independent
        .iter()
        .map(|k| &mechanism.coordinates[*k])
        .collect();
    assert_eq!(independent, texts(&oracle["independent"]).iter().collect::<Vec<_>>());
    let states = oracle["states"].as_array().unwrap();
    assert!(states.len() >= 6);
    let mut worst = (0.0_f64, 0.0_f64);
    for state in states {
        let [q, qd, qdd] = ["q", "qd", "qdd"].map(|key| numbers(&state[key]));
        let ours = mechanism.regressor(&q, &qd, &qdd).unwrap();
        worst.0 = worst.0.max(row_error(&ours, &matrix(&state["regressor"])));
        if mechanism.rows() > 0 {
            let ours = mechanism.jacobian(&q);
            worst.1 = worst.1.max(row_error(&ours, &matrix(&state["jacobian"])));
        }
    }
    assert!(worst.0 <= 1e-10, "{name}: regressor {:e}", worst.0);
    assert!(worst.1 <= 1e-10, "{name}: jacobian {:e}", worst.1);
    println!("{name}: regressor {:e}, jacobian {:e}", worst.0, worst.1);
}

#[test]
fn puma560_matches_its_published_vectors() {
    agrees("puma560");
}

#[test]
fn branched_tree_matches_its_published_vectors() {
    agrees("tree_branch");
}

#[test]
fn fivebar_matches_its_published_vectors() {
    agrees("fivebar");
}

#[test]
fn rps3_matches_its_published_vectors() {
    agrees("3rps");
}
