//! `regen calibrate`: planted mistakes are told with their causes, and clean measurements are not.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::common::{Run, regen, root, scratch};

/// A camera that sees the last body of an arm.
const PLAN: &str = "\
columns:
  q*: {column: \"j*\", unit: deg}
calibrate:
  measure:
    - {pose: 6, position: [x, y, z], rotation: {quaternion_wxyz: [qw, qx, qy, qz]}, unit: mm}
runs:
  - {files: [poses.csv]}
";

/// A folder with an arm, the plan and 40 simulated poses: their titles and numbers.
fn prepared(name: &str) -> (std::path::PathBuf, Vec<Vec<f64>>) {
    let dir = scratch(name);
    fs::copy(root().join("robots/puma560.yaml"), dir.join("arm.yaml")).unwrap();
    fs::write(dir.join("plan.yaml"), PLAN).unwrap();
    let words = "calibrate arm.yaml plan.yaml --simulate poses.csv --poses 40 --seed 4";
    regen(&dir, &words.split(' ').collect::<Vec<_>>()).ended(0);
    let text = fs::read_to_string(dir.join("poses.csv")).unwrap();
    let rows = text.lines().skip(1);
    let numbers = rows.map(|row| row.split(',').map(|x| x.parse().unwrap()).collect());
    (dir.clone(), numbers.collect())
}

/// The calibration of changed poses with a changed plan.
fn run(dir: &Path, plan: &str, rows: &[Vec<f64>]) -> Run {
    let mut text = "j1,j2,j3,j4,j5,j6,x,y,z,qw,qx,qy,qz\n".to_owned();
    for row in rows {
        let row: Vec<String> = row.iter().map(f64::to_string).collect();
        text += &(row.join(",") + "\n");
    }
    fs::write(dir.join("poses.csv"), text).unwrap();
    fs::write(dir.join("plan.yaml"), plan).unwrap();
    regen(
        dir,
        &["calibrate", "arm.yaml", "plan.yaml", "--format", "json"],
    )
}

#[test]
fn mistakes_in_poses_are_told_with_their_causes_and_clean_ones_are_not() {
    let (dir, rows) = prepared("calibrate_mistakes");
    let changed = |change: &dyn Fn(&mut Vec<f64>)| {
        let mut rows = rows.clone();
        rows.iter_mut().for_each(change);
        rows
    };
    let clean = run(&dir, PLAN, &rows).ended(0).json();
    assert_eq!(clean["doubts"].as_array().unwrap().len(), 0, "{clean}");
    assert_eq!(
        (&clean["poses"], &clean["outliers"]),
        (&40.into(), &Value::Array(Vec::new()))
    );
    let turned = |row: &mut Vec<f64>| (10..13).for_each(|k| row[k] = -row[k]);
    for (plan, rows, told) in [
        (
            PLAN.replace(", unit: mm", ""),
            rows.clone(),
            "1000 times as large",
        ),
        (PLAN.replace(", unit: deg", ""), rows.clone(), "`unit: deg`"),
        (
            PLAN.replace("_wxyz", "_xyzw"),
            rows.clone(),
            "as `quaternion_wxyz`",
        ),
        (PLAN.to_owned(), changed(&turned), "as their inverse"),
        (
            PLAN.to_owned(),
            changed(&|row| row.swap(6, 7)),
            "mirror image",
        ),
        (
            PLAN.to_owned(),
            changed(&|row| row[8] = -row[8]),
            "mirror image",
        ),
        (
            PLAN.to_owned(),
            changed(&|row| row[1] = -row[1]),
            "other sign of 'q2'",
        ),
        (
            PLAN.to_owned(),
            changed(&|row| row[5] = -row[5]),
            "other sign of 'q6'",
        ),
        (
            PLAN.to_owned(),
            changed(&|row| row.swap(3, 5)),
            "'q4' and 'q6' exchanged",
        ),
    ] {
        let found = run(&dir, &plan, &rows);
        // where nothing fits, the cause is told with the error
        if found.code == 4 {
            assert!(found.err.contains(told), "{told}: {}", found.err);
            continue;
        }
        let found = found.ended(0).json();
        let doubts = found["doubts"].as_array().unwrap().iter();
        let doubts: Vec<&str> = doubts.filter_map(Value::as_str).collect();
        assert!(
            matches!(doubts[..], [one] if one.contains(told)),
            "{told}: {doubts:?}"
        );
    }
    let mut twice = rows.clone();
    twice.insert(10, rows[3].clone());
    let found = run(&dir, PLAN, &twice).ended(0).json();
    assert!(
        found["doubts"][0]
            .as_str()
            .unwrap()
            .starts_with("row 12 repeats row 5"),
        "{found}"
    );
    let mut wild = rows.clone();
    wild[7][6] += 20.0;
    let found = run(&dir, PLAN, &wild).ended(0).json();
    assert_eq!(found["outliers"], serde_json::json!([9]));
}

#[test]
fn names_of_the_geometry_are_written_into_the_description_and_nothing_else_changes() {
    let dir = scratch("calibrate_names");
    let text = fs::read_to_string(root().join("robots/delta.yaml")).unwrap();
    fs::write(dir.join("delta.yaml"), &text).unwrap();
    let plan = "calibrate:\n  unknown: [lc, l]\n  measure:\n    - {point: platform, position: [x, y, z]}\n";
    fs::write(dir.join("plan.yaml"), plan).unwrap();
    let words = "calibrate delta.yaml plan.yaml --simulate poses.csv --format json";
    let truth = regen(&dir, &words.split(' ').collect::<Vec<_>>())
        .ended(0)
        .json();
    fs::write(
        dir.join("plan.yaml"),
        format!("{plan}runs:\n  - {{files: [poses.csv]}}\n"),
    )
    .unwrap();
    let words = "calibrate delta.yaml plan.yaml --geometry new.yaml --format json";
    let found = regen(&dir, &words.split(' ').collect::<Vec<_>>())
        .ended(0)
        .json();
    let written = fs::read_to_string(dir.join("new.yaml")).unwrap();
    let mut restored = written.clone();
    for (own, other) in found["estimates"]
        .as_array()
        .unwrap()
        .iter()
        .zip(truth["estimates"].as_array().unwrap())
    {
        let of = |row: &Value, key: &str| row[key].as_f64().unwrap();
        assert!(
            (of(own, "value") - of(other, "value")).abs() < 5.0 * of(own, "sigma"),
            "{own} {other}"
        );
        let line = format!("{}: {:?}", own["name"].as_str().unwrap(), of(own, "value"));
        assert!(written.contains(&line), "{line}");
        restored = restored.replace(
            &line,
            &format!("{}: {}", own["name"].as_str().unwrap(), of(own, "nominal")),
        );
    }
    assert_eq!(restored, text);
    // errors of placements have no place in the description yet
    let words = "calibrate delta.yaml plan.yaml --unknown q1 --geometry new.yaml";
    let run = regen(&dir, &words.split(' ').collect::<Vec<_>>()).ended(2);
    assert!(run.err.contains("errors of placements"), "{}", run.err);
}

#[test]
fn what_is_wrong_in_a_plan_is_told_with_its_place() {
    let (dir, _) = prepared("calibrate_plans");
    for (from, to, told) in [
        (
            "pose: 6",
            "pose: 66",
            "'66' is no frame and no body of the robot",
        ),
        (
            "qw, qx",
            "qv, qx",
            "it has no column 'qv'; did you mean 'qw'?",
        ),
        (
            "calibrate:\n",
            "calibrate:\n  unknown: [q2.alfa]\n",
            "did you mean 'q2.alpha'?",
        ),
        (
            "position: [x, y, z]",
            "position: [x, y]",
            "expected 3 entries, found 2",
        ),
        (
            "quaternion_wxyz: [qw",
            "quaternion_wxyz: [x",
            "are no rotation",
        ),
    ] {
        fs::write(dir.join("plan.yaml"), PLAN.replacen(from, to, 1)).unwrap();
        let run = regen(&dir, &["calibrate", "arm.yaml", "plan.yaml"]);
        assert_eq!(run.code, 3, "{told}: {}", run.err);
        assert!(run.err.contains(told), "{told}: {}", run.err);
    }
    fs::write(dir.join("plan.yaml"), "runs: [{files: [poses.csv]}]\n").unwrap();
    let run = regen(&dir, &["calibrate", "arm.yaml", "plan.yaml"]).ended(3);
    assert!(run.err.contains("no key `calibrate`"), "{}", run.err);
}
