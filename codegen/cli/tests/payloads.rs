//! Payloads, from the description to parameters identified with and without them, and gains of drives.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::Path;

use crate::common::{regen, scratch};
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
fn runs_must_state_whether_they_carry_the_payload() {
    let dir = scratch("payload_identify");
    arm(&dir);
    fs::write(dir.join("log.csv"), "t,q1\n").unwrap();
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

/// The currents of two joints are of unknown gain; the third effort is measured.
const RUNS: &str = "\
columns:
  tau_q1: {column: tau_q1, unit: A, factor: 1/8, gain: unknown}
  tau_q2: {column: tau_q2, unit: A, factor: -1/12, gain: unknown}
  tau_q3: {column: tau_q3, unit: A, factor: 1/3, gain: unknown}
process: {filter: {butterworth: {order: 4, cutoff: 20}}}
runs:
  - {files: none.csv}
  - {files: carried.csv, payload: {m: 2.2}}
  - {files: carried.csv, payload: unknown, use: validate}
";

fn json(dir: &Path, line: &str) -> Value {
    let (out, _) = run(dir, &format!("{line} --format json"), 0);
    serde_json::from_str(&out).unwrap()
}

#[test]
fn gains_from_a_payload_in_another_unit_are_told_by_the_nominal_bodies() {
    let dir = scratch("payload_grams");
    arm(&dir);
    simulated(&dir, 1, "--noise 1e-5,0.01 --seed 3");
    for (mass, is_told) in [("2.2", false), ("2200", true), ("0.022", true)] {
        let runs = RUNS.replace("m: 2.2", &format!("m: {mass}"));
        fs::write(dir.join("runs.yaml"), runs).unwrap();
        let (_, err) = run(&dir, "identify arm.yaml runs.yaml", 0);
        assert_eq!(err.contains("compare the masses (kg)"), is_told, "{err}");
        if is_told {
            let (_, told) = err.split_once("parameters are about ").expect(&err);
            let (times, _) = told.split_once(" times").unwrap();
            let times: f64 = times.parse().unwrap();
            let stated = mass.parse::<f64>().unwrap() / 2.2;
            assert!((times / stated - 1.0).abs() < 0.2, "{mass}: {err}");
        }
        let (_, err) = run(&dir, "identify arm.yaml runs.yaml --no-suspicion", 0);
        assert!(!err.contains("compare the masses"), "{mass}: {err}");
    }
}

/// The value of an entry, which has a deviation and is within five of them of the truth.
fn close(row: &Value, truth: f64) -> f64 {
    let number = |key: &str| row[key].as_f64().unwrap_or(f64::NAN);
    let (value, sigma) = (number("value"), number("sigma"));
    assert!(sigma > 0.0 && number("low") < number("high"), "{row}");
    assert!(
        (value - truth).abs() < 5.0 * sigma + 0.01 * truth.abs(),
        "{row}"
    );
    sigma
}

/// Simulates a run without the load and one with it, along an exciting motion.
///
/// - `seed`: of the motion; `options`: of `simulate`.
fn simulated(dir: &Path, seed: u32, options: &str) {
    let excite =
        "excite arm.yaml --payload carried --out t.json --harmonics 3 --starts 1 --frequency 0.4";
    run(dir, &format!("{excite} --seed {seed}"), 0);
    for payload in ["none", "carried"] {
        let out = format!("--out {payload}.csv --payload {payload}");
        let line = format!("simulate arm.yaml --trajectory t.json {options} {out}");
        run(dir, &line, 0);
    }
}

/// Writes the runs with every effort in the row after its own; returns the time of a row.
fn late(dir: &Path) -> f64 {
    let mut step = 0.0;
    for name in ["none", "carried"] {
        let text = fs::read_to_string(dir.join(format!("{name}.csv"))).unwrap();
        let rows: Vec<Vec<&str>> = text.lines().map(|l| l.split(',').collect()).collect();
        let mut out = rows[0].join(",") + "\n";
        for pair in rows[1..].windows(2) {
            let cells = rows[0].iter().enumerate().map(|(k, title)| {
                let before = title.starts_with("tau_");
                pair[usize::from(!before)][k]
            });
            out += &(cells.collect::<Vec<_>>().join(",") + "\n");
        }
        let time = |row: usize| rows[row][0].parse::<f64>().unwrap();
        step = time(2) - time(1);
        fs::write(dir.join(format!("late_{name}.csv")), out).unwrap();
    }
    let runs = RUNS.replace("files: ", "files: late_");
    fs::write(dir.join("late.yaml"), runs).unwrap();
    step
}

#[test]
fn gains_and_loads_are_identified_validated_and_refused_if_their_scale_is_undetermined() {
    let dir = scratch("payload_gains");
    arm(&dir);
    // samples that are rare enough for what they leave unknown
    simulated(
        &dir,
        1,
        "--noise 1e-6,0.01 --seed 3 --step 0.01 --bandwidth 3",
    );
    fs::write(dir.join("runs.yaml"), RUNS).unwrap();
    let fit = "identify arm.yaml runs.yaml --covariance --out fit.json --report page.html";
    let found = json(&dir, fit);
    for (k, gain) in [8.0, -12.0, 3.0].into_iter().enumerate() {
        close(&found["gains"][k], gain);
        assert_eq!(found["gains"][k]["unit"], "N m/A");
    }
    let load = &found["payloads"][0];
    assert_eq!(load["body"], "load");
    let value = |name: &str| {
        let values = load["values"].as_array().unwrap();
        values.iter().find(|row| row["name"] == name).unwrap()
    };
    assert_eq!(
        (&value("m")["value"], &value("m")["known"]),
        (&2.2.into(), &true.into())
    );
    close(value("cx"), 0.02);
    close(value("cz"), 0.04);
    let of_run = &found["models"][0]["logs"][0];
    assert!(
        of_run["relative_absolute"].as_f64().unwrap() < 10.0,
        "{of_run}"
    );
    let page = fs::read_to_string(dir.join("page.html")).unwrap();
    assert!(page.contains("Identification of payload"));

    // the file predicts each run with what it carries, and the table says all of it
    let validated = json(&dir, "validate arm.yaml fit.json runs.yaml");
    let error = &validated["models"][0]["logs"][0];
    assert_eq!(error["relative_absolute"], of_run["relative_absolute"]);
    let (table, _) = run(&dir, "identify arm.yaml runs.yaml", 0);
    // the whole way from the logs to the deviations: the change by other derivatives is in them
    let sampling = "and what sampling leaves unknown of the motion";
    for words in ["gain ", "payload load", "given", sampling] {
        assert!(table.contains(words), "{words}\n{table}");
    }
    let refused = run(&dir, "validate arm.yaml fit.json none.csv", 3).1;
    assert!(refused.contains("state what is carried"), "{refused}");

    let unknown = RUNS.replace("{m: 2.2}", "unknown");
    fs::write(dir.join("unknown.yaml"), unknown).unwrap();
    let (_, err) = run(&dir, "identify arm.yaml unknown.yaml", 4);
    let words = "nothing determines the scale of gain(q1), gain(q2), gain(q3)";
    assert!(err.contains(words), "{err}");
    // outliers in units of measurement, and physical parameters, of the same runs
    let robust = json(&dir, "identify arm.yaml runs.yaml --estimator huber");
    assert_eq!(robust["method"], "Huber's estimate with gains and payloads");
    let line = "identify arm.yaml runs.yaml --feasible --draws 20 --bodies bodies.yaml";
    let physical = json(&dir, line);
    for (k, gain) in [8.0, -12.0, 3.0].into_iter().enumerate() {
        close(&robust["gains"][k], gain);
        close(&physical["gains"][k], gain);
    }
    assert_eq!(physical["method"], "feasible with gains and payloads");
    let models = physical["models"].as_array().unwrap();
    assert_eq!(models.len(), 2, "{models:?}");
    assert!(models[1]["gap"].as_f64().unwrap() < 1e-4, "{models:?}");
    let written = fs::read_to_string(dir.join("bodies.yaml")).unwrap();
    assert!(
        written.contains("load:") && written.contains("mass: 2.2"),
        "{written}"
    );
    let instruments = json(&dir, "identify arm.yaml runs.yaml --iv");
    let deviations = instruments["deviations"].as_str().unwrap();
    assert!(deviations.contains(sampling), "{deviations}");
    for (k, gain) in [8.0, -12.0, 3.0].into_iter().enumerate() {
        close(&instruments["gains"][k], gain);
    }
    assert!(
        instruments["instruments"]["rounds"].is_u64(),
        "{instruments}"
    );
    for (line, words) in [
        ("--friction", "--friction does not work with unknown gains"),
        (
            "--feasible --covariance --out f.json",
            "--covariance needs least squares",
        ),
        (
            "--estimator response",
            "--estimator response does not work with unknown gains",
        ),
        ("--payload none", "leave out --payload"),
    ] {
        let (_, err) = run(&dir, &format!("identify arm.yaml runs.yaml {line}"), 2);
        assert!(err.contains(words), "{line}: {err}");
    }
    // efforts that are a row late in all runs: the delay is found, and gains stay
    let step = late(&dir);
    let late = fs::read_to_string(dir.join("late.yaml")).unwrap();
    let (filter, _) = late
        .split_once("runs:")
        .unwrap()
        .0
        .rsplit_once('\n')
        .unwrap();
    let (_, filter) = filter.rsplit_once('\n').unwrap();
    assert!(filter.starts_with("process:"), "{filter}");
    fs::write(dir.join("open.yaml"), late.replace(filter, "")).unwrap();
    // a filter that is given, and one that is chosen
    for runs in ["late.yaml --delay auto", "open.yaml"] {
        let delayed = json(&dir, &format!("identify arm.yaml {runs}"));
        for (k, gain) in [8.0, -12.0, 3.0].into_iter().enumerate() {
            close(&delayed["gains"][k], gain);
            let found = delayed["corrected_delays"][k][1].as_f64().unwrap();
            // dry friction changes sign between two samples, which blurs a delay by a good quarter of a step
            assert!((found - step).abs() < 0.3 * step, "{runs}: {found} {step}");
        }
    }
    let (_, err) = run(&dir, "observe arm.yaml runs.yaml --out f.json", 3);
    assert!(
        err.contains("does not identify unknown gains")
            && err.contains("does not support runs with a payload"),
        "{err}"
    );
}

#[test]
fn gains_and_loads_are_found_from_the_efforts_of_each_run_s_own_simulation() {
    let dir = scratch("payload_didim");
    arm(&dir);
    simulated(
        &dir,
        1,
        "--noise 1e-6,0.05 --seed 3 --bandwidth 5 --step 0.005",
    );
    fs::write(dir.join("runs.yaml"), RUNS).unwrap();
    let line = "identify arm.yaml runs.yaml --estimator didim --loop-bandwidth 5 --reference t.json \
                --out fit.json";
    let found = json(&dir, line);
    for (k, gain) in [8.0, -12.0, 3.0].into_iter().enumerate() {
        close(&found["gains"][k], gain);
    }
    assert_eq!(found["method"], "DIDIM with gains and payloads");
    let rounds = &found["simulated"]["didim"];
    assert_eq!(rounds["bandwidth"], 5.0, "{rounds}");
    let values = found["payloads"][0]["values"].as_array().unwrap();
    let cz = values.iter().find(|row| row["name"] == "cz").unwrap();
    assert!(close(cz, 0.04) < 1e-3, "{cz}");
    // the parameters predict the runs with what they carry
    let validated = json(&dir, "validate arm.yaml fit.json runs.yaml");
    let error = &validated["models"][0]["logs"][0]["relative_absolute"];
    assert!(error.as_f64().unwrap() < 10.0, "{error}");
}

#[test]
fn a_load_is_weighed_on_a_robot_that_was_identified_without_it() {
    let dir = scratch("payload_weighed");
    arm(&dir);
    simulated(&dir, 2, "--noise 1e-6,0.01 --seed 5");
    let line = "identify arm.yaml none.csv --payload none --butterworth 4,20 --out";
    run(&dir, &format!("{line} exact.json"), 0);
    run(&dir, &format!("{line} robot.json --covariance"), 0);
    let line = "identify arm.yaml carried.csv --payload unknown --butterworth 4,20";
    let (_, err) = run(&dir, line, 2);
    assert!(
        err.contains("--payload unknown needs the parameters of the robot without it"),
        "{err}"
    );
    let (_, err) = run(&dir, &format!("{line} --parameters exact.json"), 0);
    assert!(err.contains("has no covariance"), "{err}");
    let exact = json(&dir, &format!("{line} --parameters exact.json"));
    let whole = json(
        &dir,
        &format!("{line} --parameters robot.json --out load.json"),
    );
    let mass = |found: &Value| close(&found["payloads"][0]["values"][0], 2.2);
    assert!(mass(&whole) > mass(&exact));
    // the load is in the base parameters that were written
    let error = json(
        &dir,
        "validate arm.yaml load.json carried.csv --payload carried --butterworth 4,20",
    );
    let error = error["models"][0]["logs"][0]["relative_absolute"].as_f64();
    assert!(error.unwrap() < 10.0);
}
