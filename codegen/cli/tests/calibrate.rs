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
    let moved = |from: &dyn Fn(usize) -> usize| {
        let mut moved = rows.clone();
        for (k, row) in moved.iter_mut().enumerate() {
            row[6..].copy_from_slice(&rows[from(k)][6..]);
        }
        moved
    };
    let late = moved(&|k| (k + 1) % rows.len());
    let shuffled = moved(&|k| 7 * k % 40);
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
        (
            PLAN.to_owned(),
            changed(&|row| row[1] += 90.0),
            "`offset: deg(-90)`",
        ),
        (
            PLAN.to_owned(),
            changed(&|row| row[6..9].rotate_left(1)),
            "x, y and z are to be along the axes of the rotations",
        ),
        (PLAN.to_owned(), late, "the readings one row after"),
        (PLAN.to_owned(), shuffled, "are not of the same poses"),
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
            !doubts.is_empty() && doubts.iter().all(|one| one.contains(told)),
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

/// A plan, its simulated measurements with a change of each row, and what is said of them.
fn said_of(name: &str, measure: &str, plan: [&str; 2], change: &dyn Fn(&mut [f64])) -> String {
    let dir = scratch("calibrate_said");
    let spec = root().join(format!("robots/{name}.yaml"));
    let spec = spec.to_str().unwrap();
    let write = |plan: &str| {
        let text = format!("{plan}calibrate:\n  noise: 2e-5\n{measure}");
        fs::write(dir.join("plan.yaml"), text).unwrap();
    };
    write(plan[0]);
    let words = [
        "calibrate",
        spec,
        "plan.yaml",
        "--simulate",
        "poses.csv",
        "--poses",
        "40",
    ];
    regen(&dir, &words).ended(0);
    let text = fs::read_to_string(dir.join("poses.csv")).unwrap();
    let mut lines = text.lines();
    let mut out = format!("{}\n", lines.next().unwrap());
    for line in lines {
        let mut row: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
        change(&mut row);
        let row: Vec<String> = row.iter().map(f64::to_string).collect();
        out += &(row.join(",") + "\n");
    }
    fs::write(dir.join("poses.csv"), out).unwrap();
    write(&format!("{}runs: [{{files: [poses.csv]}}]\n", plan[1]));
    let run = regen(&dir, &["calibrate", spec, "plan.yaml"]);
    run.out + &run.err
}

#[test]
fn mistakes_are_told_of_wires_directions_encoders_and_angles_too() {
    let wires = "  measure: [{distance: 3, length: l, from: [0.5, 0.3, 1.5], unit: mm}]\n";
    let down = "  measure: [{gravity: 6, direction: [x, y, z]}, {distance: 6, length: l, from: [1, 0, 0]}]\n";
    let angles = |columns: &str, unit: &str| {
        format!(
            "  measure: [{{pose: 6, position: [x, y, z], rotation: {{{columns}}}, angles: {unit}}}]\n"
        )
    };
    let none: &dyn Fn(&mut [f64]) = &|_| {};
    let encoders = "columns: {q1: q1, q2: q2, q3: q3, q4: q4}\n";
    for (name, measure, plan, change, told) in [
        ("3rps", wires, ["", ""], none, ""),
        (
            "3rps",
            &wires.replace(", unit: mm", ""),
            ["", ""],
            &|row| row[3] *= 1000.0,
            "1000 times as large",
        ),
        ("puma560", down, ["", ""], none, ""),
        (
            "puma560",
            down,
            ["", ""],
            &|row| row[6..9].iter_mut().for_each(|x| *x = -*x),
            "points up",
        ),
        ("fivebar", "", [encoders; 2], none, ""),
        (
            "fivebar",
            "",
            [encoders; 2],
            &|row| row.swap(0, 1),
            "'q1' and 'q2' exchanged",
        ),
        (
            "fivebar",
            "",
            [encoders; 2],
            &|row| row[1] += std::f64::consts::FRAC_PI_2,
            "`offset: deg(-90)`",
        ),
        (
            "puma560",
            &angles("rpy: [a, b, c]", "rad"),
            ["", ""],
            &|row| row.swap(9, 11),
            "as yaw, pitch and roll",
        ),
        (
            "puma560",
            &angles("rpy: [a, b, c]", "rad"),
            ["", ""],
            &|row| row[9..].iter_mut().for_each(|x| *x = x.to_degrees()),
            "give the measurement `angles: deg`",
        ),
        (
            "puma560",
            &angles("rpy: [a, b, c]", "rad"),
            ["", "columns: {'q*': {column: 'q*', unit: deg}}\n"],
            none,
            "angles in radians",
        ),
    ] {
        let said = said_of(name, measure, plan, change);
        if told.is_empty() {
            assert!(!said.contains("warning"), "{name}: {said}");
        } else {
            assert!(said.contains(told), "{told}: {said}");
        }
    }
}

/// Joints that yield are found with everything else, and what is written and cannot be is said.
#[test]
fn compliances_are_found_from_the_efforts_of_the_stated_masses() {
    let (dir, _) = prepared("calibrate_compliance");
    let unknown = "q*,q2.compliance,q3.compliance";
    let plan = PLAN.replace("unit: mm", "unit: mm, noise: 5e-5, noise_of_angles: 1e-4");
    fs::write(dir.join("plan.yaml"), plan).unwrap();
    let of = |words: &str| {
        let mut words: Vec<&str> = words.split(' ').collect();
        words.extend(["--format", "json"]);
        regen(&dir, &words).ended(0).json()
    };
    let simulate = "calibrate arm.yaml plan.yaml --simulate poses.csv --poses 40 --unknown";
    let truth = of(&format!("{simulate} {unknown}"));
    let found = of(&format!("calibrate arm.yaml plan.yaml --unknown {unknown}"));
    let row = |found: &Value, name: &str| {
        let mut rows = found["estimates"].as_array().unwrap().iter();
        rows.find(|own| own["name"] == name).unwrap().clone()
    };
    for name in ["q2.compliance", "q3.compliance"] {
        let (own, planted) = (row(&found, name), row(&truth, name));
        assert_eq!(own["unit"], "rad/(N m)");
        let [value, sigma] = ["value", "sigma"].map(|key| own[key].as_f64().unwrap());
        let planted = planted["value"].as_f64().unwrap();
        assert!(
            planted > 0.0 && (value - planted).abs() < 4.0 * sigma,
            "{own} {planted}"
        );
    }
    // rigid joints do not fit the same poses: chi-square in its deviations from its mean
    let off = |found: &Value| {
        let [chi, degrees] =
            ["chi_square", "degrees_of_freedom"].map(|key| found[key].as_f64().unwrap());
        (chi - degrees) / (2.0 * degrees).sqrt()
    };
    let rigid = of("calibrate arm.yaml plan.yaml --unknown q*");
    assert!(
        off(&rigid) > 10.0 && off(&found).abs() < 4.0,
        "{} {}",
        off(&rigid),
        off(&found)
    );
    // the spec has no place for them, and without masses there are no efforts
    let words = format!("calibrate arm.yaml plan.yaml --unknown {unknown} --geometry new.yaml");
    let written = regen(&dir, &words.split(' ').collect::<Vec<_>>()).ended(0);
    assert!(written.err.contains("q3.compliance"), "{}", written.err);
    let text = fs::read_to_string(dir.join("arm.yaml")).unwrap();
    let at = text.find("\nbodies:").unwrap();
    let after = text[at + 1..]
        .find("\n\n")
        .map_or(text.len(), |k| at + 1 + k);
    fs::write(dir.join("arm.yaml"), text[..at].to_owned() + &text[after..]).unwrap();
    let words = "calibrate arm.yaml plan.yaml --unknown q3.compliance";
    let refused = regen(&dir, &words.split(' ').collect::<Vec<_>>()).ended(3);
    assert!(
        refused.err.contains("states no value of") && refused.err.contains("mx(3)"),
        "{}",
        refused.err
    );
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

    // the log that only the plan names is no file to write to
    let poses = fs::read(dir.join("poses.csv")).unwrap();
    for output in ["--geometry", "--report"] {
        let words = ["calibrate", "delta.yaml", "plan.yaml", output, "poses.csv"];
        let err = regen(&dir, &words).ended(2).err;
        assert!(err.contains("would be read and overwritten"), "{err}");
        assert_eq!(fs::read(dir.join("poses.csv")).unwrap(), poses);
    }
}

/// The rms before and after of a calibration, and what it changed.
fn fitted(dir: &Path, words: &str) -> (Vec<[f64; 2]>, Value) {
    let words: Vec<&str> = words.split(' ').collect();
    let found = regen(dir, &words).ended(0).json();
    let measured = found["measured"].as_array().unwrap().iter();
    let of = |row: &Value, key: &str| row[key].as_f64().unwrap();
    let rms = measured.map(|row| [of(row, "before"), of(row, "after")]);
    (rms.collect(), found)
}

#[test]
fn errors_of_placements_are_written_into_a_description_that_then_fits_as_it_is() {
    let dir = scratch("calibrate_placements");
    for (name, tip) in [("puma560", "6"), ("delta", "platform"), ("fivebar", "tip")] {
        let text = fs::read_to_string(root().join(format!("robots/{name}.yaml"))).unwrap();
        // a frame that holds the errors of what is observed
        let on = if name == "fivebar" {
            tip.to_owned()
        } else {
            "tool".to_owned()
        };
        let text = if name == "fivebar" {
            text
        } else {
            format!("{text}\nframes:\n  - {{name: tool, body: {tip}, xyz: [0.01, 0, 1/10]}}\n")
        };
        fs::write(dir.join("robot.yaml"), &text).unwrap();
        let plan = format!(
            "calibrate:\n  noise: 0\n  measure:\n    - {{pose: {on}, position: [x, y, z], \
             rotation: {{rpy: [a, b, c]}}, instrument: known}}\n"
        );
        fs::write(dir.join("plan.yaml"), &plan).unwrap();
        let words = "calibrate robot.yaml plan.yaml --simulate poses.csv --poses 30 --perturb 2e-3";
        regen(&dir, &words.split(' ').collect::<Vec<_>>()).ended(0);
        fs::write(
            dir.join("plan.yaml"),
            plan + "runs:\n  - {files: [poses.csv]}\n",
        )
        .unwrap();
        let words = "calibrate robot.yaml plan.yaml --format json --geometry new.yaml";
        let (first, _) = fitted(&dir, words);
        let (then, _) = fitted(&dir, "calibrate new.yaml plan.yaml --format json");
        for ([before, after], [again, _]) in first.iter().zip(&then) {
            assert!(*before > 5.0 * after, "{name}: {before} {after}");
            // what was found is the description now: nothing of the residuals is left to it
            assert!(
                (again / after - 1.0).abs() < 1e-3,
                "{name}: {again} {after}"
            );
        }
        // every line of the description but those of changed placements stays
        let written = fs::read_to_string(dir.join("new.yaml")).unwrap();
        let kept = |line: &&str| line.trim_start().starts_with('#') || line.is_empty();
        let lines: Vec<&str> = text.lines().filter(kept).collect();
        let others: Vec<&str> = written.lines().filter(kept).collect();
        assert_eq!(lines, others, "{name}");
    }
}

#[test]
fn scales_of_encoders_are_found_where_they_are_named_and_what_cannot_be_written_is_said() {
    let (dir, rows) = prepared("calibrate_scales");
    let mut rows = rows;
    for row in &mut rows {
        // the reading times the scale is the angle
        row[2] /= 1.004;
    }
    let plan = PLAN.replace(
        "calibrate:\n",
        "calibrate:\n  unknown: [q2, q3, q3.scale]\n",
    );
    let found = run(&dir, &plan, &rows).ended(0).json();
    let estimates = found["estimates"].as_array().unwrap();
    let scale = estimates
        .iter()
        .find(|own| own["name"] == "q3.scale")
        .unwrap();
    let [value, sigma] = ["value", "sigma"].map(|key| scale[key].as_f64().unwrap());
    // the other joints have errors here too, which are not unknown
    assert!((value - 1.004).abs() < 2e-3 && sigma < 1e-3, "{scale}");
    let words = "calibrate arm.yaml plan.yaml --geometry new.yaml";
    let written = regen(&dir, &words.split(' ').collect::<Vec<_>>()).ended(0);
    assert!(
        written.err.contains("not written are q3.scale"),
        "{}",
        written.err
    );
    let words = "calibrate arm.yaml plan.yaml --geometry none.yaml --unknown q3.scale";
    let refused = regen(&dir, &words.split(' ').collect::<Vec<_>>()).ended(2);
    assert!(refused.err.contains("nothing to write"), "{}", refused.err);
    assert!(!dir.join("none.yaml").exists());
}

#[test]
fn factors_of_combinations_are_expressions_in_lengths_where_they_are_structural() {
    let (dir, _) = prepared("calibrate_exact");
    let table = regen(&dir, &["calibrate", "arm.yaml", "plan.yaml"])
        .ended(0)
        .out;
    let combination = table
        .lines()
        .find(|line| line.starts_with("  q2.theta +"))
        .unwrap();
    // Hayati's shift of an axis parallel to the one before is a turn over the link's length
    assert!(combination.contains("+ q3.b/a2"), "{table}");
    let combination = table
        .lines()
        .find(|line| line.starts_with("  q2.d +"))
        .unwrap();
    assert!(combination.contains("- a3 q4.beta"), "{table}");
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

#[test]
fn poses_are_chosen_in_the_columns_and_units_of_the_plan_and_fit_as_well_as_is_said() {
    let (dir, _) = prepared("calibrate_poses");
    let words = "excite arm.yaml --calibrate 20 --measure plan.yaml --out chosen.csv --format json";
    let words: Vec<&str> = words.split(' ').collect();
    let found = regen(&dir, &words).ended(0).json();
    let text = fs::read_to_string(dir.join("chosen.csv")).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("j1,j2,j3,j4,j5,j6"));
    let rows: Vec<Vec<f64>> = lines
        .map(|row| row.split(',').map(|x| x.parse().unwrap()).collect())
        .collect();
    assert_eq!(rows.len(), 20);
    // degrees, within the limits of the spec
    for (k, [low, high]) in [[-160.0, 160.0], [-225.0, 45.0], [-45.0, 225.0]]
        .into_iter()
        .enumerate()
    {
        let column = rows.iter().map(|row| row[k]);
        let [least, most] = [f64::min, f64::max].map(|of| column.clone().reduce(of).unwrap());
        assert!(
            low <= least && most <= high && most - least > 90.0,
            "{least} {most}"
        );
    }
    let choice = &found["choice"];
    for index in choice["indices"].as_array().unwrap() {
        let of = |key: &str| index[key].as_f64().unwrap();
        // others than the determinant follow it, but are not what is chosen by
        let is_sought = ["O1", "log det"].contains(&index["name"].as_str().unwrap());
        assert!(!is_sought || of("chosen") > of("random"), "{index}");
    }
    let sigmas = found["estimates"].as_array().unwrap().iter();
    let sigmas: Vec<f64> = sigmas.map(|own| own["sigma"].as_f64().unwrap()).collect();
    let random = choice["random_sigmas"].as_array().unwrap().iter();
    let random: Vec<f64> = random.map(|own| own.as_f64().unwrap()).collect();
    let worst = |all: &[f64]| all.iter().copied().fold(0.0, f64::max);
    assert!(worst(&sigmas) < worst(&random), "{sigmas:?} {random:?}");
    // the table has the same numbers
    let table = regen(&dir, &words[..6]).ended(0);
    assert!(
        table.out.contains("puma560, 20 poses of 240"),
        "{}",
        table.out
    );
    // limits are kept, and such that leave too few poses are told
    let some = [
        &words[..6],
        &["--limit", "q1.position=0.1,0.2", "--format", "json"],
    ]
    .concat();
    let narrow = regen(&dir, &some).ended(0).json();
    assert_eq!(narrow["estimates"].as_array().unwrap().len(), sigmas.len());
    let text = fs::read_to_string(dir.join("chosen.csv")).unwrap();
    assert_eq!(text.lines().count(), 21, "an output that was not asked for");
    let none = [&words[..3], &["2", "--measure", "plan.yaml"]].concat();
    let run = regen(&dir, &none).ended(3);
    assert!(run.err.contains("do not suffice"), "{}", run.err);
}

#[test]
fn other_commands_say_that_they_do_not_calibrate() {
    let dir = scratch("calibrate_unused");
    let guide = root().join("runtime/guide/fivebar");
    for name in ["fivebar.yaml", "run1.csv"] {
        fs::copy(guide.join(name), dir.join(name)).unwrap();
    }
    let plan = "calibrate: {noise: 1e-5}\nruns: [{files: [run1.csv]}]\n";
    fs::write(dir.join("plan.yaml"), plan).unwrap();
    let run = regen(&dir, &["inspect", "plan.yaml", "--spec", "fivebar.yaml"]).ended(0);
    assert!(
        run.err.contains("`calibrate` is not used here"),
        "{}",
        run.err
    );
}
