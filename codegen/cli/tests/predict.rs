//! `regen validate --predict` as a user runs it.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;

use crate::common::{regen, scratch};

/// A cart with nonlinear friction.
const SPEC: &str = "\
name: cart
limbs:
  - name: arm
    joints:
      - {name: x, type: prismatic, axis: x, body: 1, actuated: true, friction: lugre,
         nominal: {Fc: 1.0, Fs: 1.6, vs: 0.2, Fv: 2.0}}
bodies:
  1: {mass: 3, com: [0, 0, 0], inertia: [1, 0, 0, 1, 0, 1]}
";

/// Columns by title; cells that are empty are `None`.
fn columns(text: &str) -> Vec<(String, Vec<Option<f64>>)> {
    let mut lines = text.lines();
    let titles = lines.next().unwrap().split(',').map(str::to_owned);
    let mut columns: Vec<_> = titles.map(|title| (title, Vec::new())).collect();
    for line in lines {
        for ((_, column), cell) in columns.iter_mut().zip(line.split(',')) {
            column.push(cell.parse().ok());
        }
    }
    columns
}

#[test]
fn predicted_efforts_are_written_for_every_log_and_give_the_printed_error() {
    let dir = scratch("predict");
    fs::write(dir.join("cart.yaml"), SPEC).unwrap();
    let run = |words: &str| {
        let args: Vec<&str> = words.split_whitespace().collect();
        regen(&dir, &args)
    };
    run("simulate cart.yaml --out log.csv --noise 1e-6,0.02 --bandwidth 6 --runs 2").ended(0);
    // one model has linear parameters only, the other one nonlinear friction too
    run("identify cart.yaml log-1.csv --butterworth 4,10 --out linear.json").ended(0);
    run("identify cart.yaml log-1.csv --butterworth 4,10 --friction --draws 0 --out whole.json")
        .ended(0);
    let words = "validate cart.yaml whole.json log-1.csv log-2.csv --beside linear.json --butterworth 4,10 \
                 --predict out.csv --format json";
    let ended = run(words).ended(0);
    assert!(ended.err.contains("out.csv: written"), "{}", ended.err);
    let json = ended.json();
    let text = fs::read_to_string(dir.join("out.csv")).unwrap();
    let all = columns(&text);
    let titles: Vec<&str> = all.iter().map(|(title, _)| title.as_str()).collect();
    assert_eq!(titles, ["run", "t", "tau_x", "predicted_x", "predicted2_x"]);
    let value = |column: usize, row: usize| all[column].1[row];
    for (model, column) in [(0, 3), (1, 4)] {
        for log in 0..2 {
            let rows = (0..all[0].1.len()).filter(|r| value(0, *r) == Some((log + 1) as f64));
            let residuals = rows.filter_map(|r| Some(value(2, r)? - value(column, r)?));
            let residuals: Vec<f64> = residuals.collect();
            let printed = &json["models"][model]["logs"][log]["efforts"][0];
            assert_eq!(printed["samples"].as_u64().unwrap(), residuals.len() as u64);
            let rms =
                (residuals.iter().map(|x| x * x).sum::<f64>() / residuals.len() as f64).sqrt();
            let printed = printed["rms"].as_f64().unwrap();
            assert!((rms - printed).abs() < 1e-6 * printed, "{rms} {printed}");
        }
    }
    // one log needs no `run` column; a missing folder is created
    run("validate cart.yaml linear.json log-1.csv --butterworth 4,10 --predict new/one.csv")
        .ended(0);
    let one = fs::read_to_string(dir.join("new/one.csv")).unwrap();
    assert!(one.starts_with("t,tau_x,predicted_x\n"), "{one}");
    let refused = run("validate cart.yaml linear.json log-1.csv --predict /dev/null/one.csv");
    assert_eq!(refused.code, 5, "{}", refused.err);
}
