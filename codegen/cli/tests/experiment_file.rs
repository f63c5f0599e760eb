//! Experiment files in place of logs and options.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{regen, root, scratch};
use serde_json::Value;

/// The spec of the guide's five-bar.
fn spec() -> String {
    root()
        .join("runtime/guide/fivebar/fivebar.yaml")
        .display()
        .to_string()
}

/// The entries of a log of the guide.
fn rows(name: &str) -> Vec<Vec<String>> {
    let text = fs::read_to_string(root().join("runtime/guide/fivebar").join(name)).unwrap();
    let row = |line: &str| line.split(',').map(str::to_owned).collect();
    text.lines().map(row).collect()
}

/// Writes a log of the guide as a robot's controller might: positions in degrees of motors with
/// gears, with decimal commas and without header; torques as currents in a file of their own.
fn raw(dir: &Path, name: &str) {
    let (mut positions, mut currents) = (String::new(), "i1;i3\n".to_owned());
    for row in &rows(&format!("{name}.csv"))[1..] {
        let numbers: Vec<f64> = row.iter().map(|text| text.parse().unwrap()).collect();
        let line = |values: &[f64]| {
            let texts: Vec<String> = values.iter().map(f64::to_string).collect();
            texts.join(";").replace('.', ",") + "\n"
        };
        let turn = |q: f64, gear: f64| q.to_degrees() * gear;
        positions += &line(&[
            1e3 * numbers[0],
            turn(numbers[1], 45.0),
            turn(numbers[2], -48.0),
        ]);
        currents += &line(&[numbers[3] / 0.12, numbers[4] / -0.1]);
    }
    fs::write(dir.join(format!("{name}_pos.csv")), positions).unwrap();
    fs::write(dir.join(format!("{name}_cur.csv")), currents).unwrap();
}

const RUNS: &str = "\
columns:
  q1: {column: 2, unit: deg, factor: 1/45}
  q3: {column: 3, unit: deg, factor: -1/48}
  tau_q1: {column: i1, unit: A, gain: 0.12}
  tau_q3: {column: i3, unit: A, gain: -1/10}
rate: 400
process:
  filter: {butterworth: {order: 4, cutoff: 20}}
runs:
  - {files: [run1_pos.csv, run1_cur.csv], rows: [101, 1900]}
  - {files: [run2_pos.csv, run2_cur.csv], use: validate}
";

/// A folder with an experiment file, and one with its logs beside it.
fn experiment(test: &str, text: &str) -> PathBuf {
    let dir = scratch(test);
    fs::create_dir_all(dir.join("logs")).unwrap();
    for name in ["run1", "run2"] {
        raw(&dir.join("logs"), name);
    }
    fs::write(dir.join("runs.yaml"), text).unwrap();
    dir
}

fn values(json: &Value) -> Vec<f64> {
    let parameters = json["parameters"].as_array().unwrap().iter();
    parameters.map(|p| p["value"].as_f64().unwrap()).collect()
}

fn assert_close(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().zip(expected) {
        assert!(
            // noise that is added to raw and to prepared rows differs in its last digits, and so does what
            // it biases, by a part of a deviation
            (a - b).abs() <= 2e-2 * b.abs().max(5e-3),
            "{found:?} {expected:?}"
        );
    }
}

#[test]
fn raw_files_are_identified_as_the_prepared_log_and_options_win() {
    let dir = experiment("experiment_file", RUNS);
    // the same rows by hand
    let cut: String = rows("run1.csv")
        .iter()
        .enumerate()
        .filter(|(k, _)| *k == 0 || (101..=1900).contains(k))
        .map(|(_, row)| row.join(",") + "\n")
        .collect();
    fs::write(dir.join("cut.csv"), cut).unwrap();
    let run = |args: &[&str]| regen(&dir, args).ended(0);
    let json = ["--format", "json"];
    let identify = |args: &[&str]| run(&[&["identify", &spec()], args, &json].concat()).json();
    let by_file = identify(&["runs.yaml", "--logs", "logs", "--out", "p.json"]);
    let by_hand = identify(&["cut.csv", "--butterworth", "4,20"]);
    assert_close(&values(&by_file), &values(&by_hand));
    // runs to validate are predicted, with their names
    let predicted = &by_file["models"][0]["logs"];
    assert_eq!(
        predicted[0]["log"],
        "logs/run1_pos.csv + run1_cur.csv, rows 101 to 1900"
    );
    assert_eq!(predicted[1]["log"], "logs/run2_pos.csv + run2_cur.csv");
    assert!(
        predicted[1]["relative_absolute"].as_f64().unwrap() < 3.0,
        "{predicted}"
    );
    let validated = run(&[
        &["validate", &spec(), "p.json", "runs.yaml", "--logs", "logs"],
        &json[..],
    ]
    .concat());
    assert_eq!(
        validated.json()["models"][0]["logs"][0]["relative_absolute"],
        predicted[1]["relative_absolute"]
    );

    // options win over the file, logs beside it are read in place of its runs
    let filtered = identify(&["runs.yaml", "--logs", "logs", "--butterworth", "4,10"]);
    assert_close(
        &values(&filtered),
        &values(&identify(&["cut.csv", "--butterworth", "4,10"])),
    );
    let observed = run(&[
        &[
            "observe",
            &spec(),
            "runs.yaml",
            "--logs",
            "logs",
            "--out",
            "f.json",
        ],
        &json[..],
    ]
    .concat());
    assert_eq!(observed.json()["files"][0]["rows"], 1800);
    assert_eq!(
        values(&identify(&["--from", "f.json"])).len(),
        values(&by_file).len()
    );
    let prepared = dir.join("prepared.yaml");
    fs::write(
        &prepared,
        "process: {filter: {butterworth: {order: 4, cutoff: 20}}}\n",
    )
    .unwrap();
    assert_close(
        &values(&identify(&["prepared.yaml", "cut.csv"])),
        &values(&by_hand),
    );
}

#[test]
fn mistakes_are_shown_in_the_file_before_the_robot_is_derived() {
    let text = RUNS
        .replace("tau_q3", "tau_q2")
        .replace("cutoff", "cut_off")
        .replace("1/45", "1/o45");
    let dir = experiment("experiment_mistakes", &text);
    fs::write(dir.join("p.json"), "{}").unwrap();
    for command in ["identify", "observe", "validate", "report"] {
        let spec = spec();
        let out = ["--out", "out"];
        let args: Vec<&str> = match command {
            "identify" => vec![command, &spec, "runs.yaml"],
            "observe" => [&[command, &*spec, "runs.yaml"], &out[..]].concat(),
            "validate" => vec![command, &spec, "p.json", "runs.yaml"],
            _ => [&[command, &*spec, "p.json", "runs.yaml"], &out[..]].concat(),
        };
        let found = regen(&dir, &args).ended(3);
        assert!(found.out.is_empty(), "{}", found.out);
        for words in [
            "`columns`, `q1`, `factor`: expected a number or an expression such as 1/45, found '1/o45'",
            "--> runs.yaml:2:38",
            "q2 is not actuated: it has no effort",
            "unknown key 'cut_off'; did you mean 'cutoff'?",
            "a Butterworth filter lacks the key 'cutoff'",
        ] {
            assert!(
                found.err.contains(words),
                "{command}: {words}\n{}",
                found.err
            );
        }
        assert!(!dir.join("out").exists());
    }
}

#[test]
fn entries_that_a_command_cannot_use_are_refused_with_their_place_and_a_remedy() {
    let text = RUNS.replace("gain: 0.12", "gain: unknown").replace(
        "use: validate}",
        "use: validate, payload: {m: 2.8, com: unknown}}",
    );
    let dir = experiment("experiment_unused", &text);
    let found = regen(&dir, &["identify", &spec(), "runs.yaml", "--logs", "logs"]).ended(3);
    for words in [
        "`runs`, entry 2, `payload`: the spec has no body that is a payload",
        "mark the body `payload: true`",
    ] {
        assert!(found.err.contains(words), "{words}\n{}", found.err);
    }
    let text = RUNS.replace("gain: 0.12", "gain: unknown");
    fs::write(dir.join("runs.yaml"), text).unwrap();
    let line = [
        "observe",
        &spec(),
        "runs.yaml",
        "--logs",
        "logs",
        "--out",
        "f.json",
    ];
    let found = regen(&dir, &line).ended(3);
    for words in [
        "`columns`, the effort of q1: this command or estimator does not identify unknown gains",
        "give the torque constant with the gear",
        "runs.yaml:4:39",
    ] {
        assert!(found.err.contains(words), "{words}\n{}", found.err);
    }
    let none = regen(&dir, &["identify", &spec(), "runs.yaml", "runs.yaml"]).ended(2);
    assert!(
        none.err.contains("one experiment file at a time"),
        "{}",
        none.err
    );
    let folder = regen(
        &dir,
        &["identify", &spec(), "logs/run1_pos.csv", "--logs", "logs"],
    )
    .ended(2);
    assert!(folder.err.contains("none is given"), "{}", folder.err);
}

/// With `REGEN_UPDATE=1` in the environment the file is written instead of compared.
#[test]
fn the_schema_of_experiment_files_beside_the_robots_is_fresh() {
    let path = root().join("robots/runs.schema.json");
    let printed = regen(&root(), &["schema", "experiment"]).ended(0).out;
    if std::env::var_os("REGEN_UPDATE").is_some() {
        fs::write(&path, &printed).unwrap();
    }
    let written = fs::read_to_string(&path).unwrap().replace("\r\n", "\n");
    assert!(
        written == printed,
        "robots/runs.schema.json is stale: run `REGEN_UPDATE=1 cargo test -p regen-cli --test all experiment_file`"
    );
}
