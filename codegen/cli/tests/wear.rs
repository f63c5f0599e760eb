//! Friction that grows over weeks, from factor files of each week, as a user finds it.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::Path;

use crate::common::{regen, scratch};
use serde_json::Value;

/// An arm in a vertical plane; `DRY` stands for the dry friction of q1, N m.
const ARM: &str = "\
name: arm
limbs:
  - name: arm
    base: {rpy: [pi/2, 0, 0]}
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true, limits: {position: [-2, 2], velocity: [-6, 6]}, friction: linear, nominal: {Fv: 0.3, Fc: DRY}}
      - {name: q2, type: revolute, dh: {a: 0.4}, body: 2, actuated: true, limits: {position: [-2, 2], velocity: [-6, 6]}, friction: linear, nominal: {Fv: 0.2, Fc: 0.4}}
bodies:
  1: {mass: 2, com: [0.2, 0.01, 0], inertia: [0.01, 0, 0, 0.05, 0, 0.05]}
  2: {mass: 1, com: [0.1, 0.02, 0], inertia: [0.01, 0, 0, 0.02, 0, 0.02]}
";

fn run(dir: &Path, line: &str) {
    let words: Vec<&str> = line.split(' ').collect();
    let _ = regen(dir, &words).ended(0);
}

/// Value and standard deviation of a parameter of the robot that factor files tell.
fn told(dir: &Path, factors: &str, label: &str) -> (f64, f64) {
    run(
        dir,
        &format!("identify arm.yaml --from {factors} --out p.json"),
    );
    let text = fs::read_to_string(dir.join("p.json")).unwrap();
    let file: Value = serde_json::from_str(&text).unwrap();
    let rows = file["parameters"].as_array().unwrap();
    let row = rows.iter().find(|row| row["label"] == label).unwrap();
    let number = |key: &str| row[key].as_f64().unwrap();
    (number("value"), number("sigma"))
}

/// The logs are deleted once they are reduced.
#[test]
fn friction_that_grows_is_told_by_the_factors_of_each_week() {
    let dir = scratch("wear");
    let weeks = [0.50, 0.50, 0.60, 0.75];
    fs::write(dir.join("arm.yaml"), ARM.replace("DRY", "0.50")).unwrap();
    run(
        &dir,
        "excite arm.yaml --out t.json --seed 1 --harmonics 4 --starts 1",
    );
    for (week, dry) in weeks.iter().enumerate() {
        fs::write(dir.join("worn.yaml"), ARM.replace("DRY", &dry.to_string())).unwrap();
        let simulate =
            "simulate worn.yaml --trajectory t.json --noise 1e-5,0.02 --out log.csv --seed";
        run(&dir, &format!("{simulate} {week}"));
        let observe = "observe arm.yaml log.csv --butterworth 4,20 --out";
        run(&dir, &format!("{observe} {week}.factors"));
        fs::remove_file(dir.join("log.csv")).unwrap();
    }
    let of = |label: &str| -> Vec<(f64, f64)> {
        let each = (0..weeks.len()).map(|week| told(&dir, &format!("{week}.factors"), label));
        each.collect()
    };
    // how many deviations two weeks differ by
    let apart = |a: (f64, f64), b: (f64, f64)| (a.0 - b.0).abs() / a.1.hypot(b.1);
    let (worn, same) = (of("Fc(q1)"), of("Fc(q2)"));
    for (week, (value, sigma)) in worn.iter().enumerate() {
        assert!(
            (value - weeks[week]).abs() < 3.0 * sigma && *sigma < 0.02,
            "week {week}: {value} {sigma}"
        );
        assert!(apart(same[week], same[0]) < 3.0, "{same:?}");
    }
    assert!(apart(worn[1], worn[0]) < 3.0, "{worn:?}");
    assert!(apart(worn[2], worn[0]) > 3.0, "{worn:?}");
    assert!(apart(worn[3], worn[2]) > 3.0, "{worn:?}");
    // all weeks in which nothing changed are one identification, more certain than each
    let (both, sigma) = told(&dir, "0.factors 1.factors", "Fc(q1)");
    assert!(
        (both - weeks[0]).abs() < 3.0 * sigma && sigma < worn[0].1,
        "{both} {sigma}"
    );
}
