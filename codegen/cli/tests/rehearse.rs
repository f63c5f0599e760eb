//! `regen rehearse` as a user runs it.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{Run, regen, root, scratch};
use serde_json::Value;

/// A cart with a pendulum.
const SPEC: &str = "\
name: crane
gravity: [0, 0, -9.81]
limbs:
  - name: arm
    joints:
      - {name: x, type: prismatic, axis: x, body: cart, actuated: true, friction: linear,
         nominal: {Fv: 4.0, Fc: 1.0}}
      - {name: q, type: revolute, axis: y, body: rod, actuated: true, friction: linear,
         nominal: {Fv: 0.3, Fc: 0.2}}
bodies:
  cart: {mass: 3, com: [0, 0, 0], inertia: [0.1, 0, 0, 0.1, 0, 0.1]}
  rod: {mass: 1, com: [0.02, 0, -0.3], inertia: [0.03, 0, 0, 0.03, 0, 0.01]}
";

const MOTION: &str = r#"{
  "format": "regen-trajectory", "robot": "crane", "coordinates": ["x", "q"], "base_frequency": 0.5,
  "harmonics": 3, "cosine": [[0.3, -0.2, 0.1], [0.9, 0.2, -0.4]],
  "sine": [[0.2, 0.1, -0.3], [0.5, -0.8, 0.6]], "offset": [0.1, 0.2]
}"#;

fn prepared(test: &str) -> PathBuf {
    let dir = scratch(test);
    fs::write(dir.join("crane.yaml"), SPEC).unwrap();
    fs::write(dir.join("m.json"), MOTION).unwrap();
    dir
}

fn run(dir: &Path, words: &str) -> Run {
    let args: Vec<&str> = words.split_whitespace().collect();
    regen(dir, &args)
}

/// The command line to which the tests add options.
const CRANE: &str = "rehearse crane.yaml --trajectory m.json --noise 1e-5,0.02 --perturb 0.1 --duration 4 --step 0.005 \
                     --bandwidth 6 --butterworth 4,15";

#[test]
fn a_rehearsal_of_a_correct_model_passes_with_consistent_numbers() {
    let dir = prepared("rehearse_passes");
    let words = format!("{CRANE} --seeds 10 --score 75");
    let text = run(&dir, &format!("{CRANE} --seeds 1")).ended(0).out;
    assert!(text.lines().all(|l| l.chars().count() <= 80), "{text}");
    assert!(text.contains("passed") && text.contains("eps_RA"), "{text}");
    let json = run(&dir, &format!("{words} --format json")).ended(0).json();
    assert_eq!(json["version"], 1);
    assert_eq!(
        (&json["seeds"], &json["failed"]),
        (&10.into(), &Value::Array(vec![]))
    );
    let of = |value: &Value, key: &str| value[key].as_f64().unwrap();
    let rows = json["parameters"].as_array().unwrap();
    let least = rows
        .iter()
        .map(|row| of(row, "within"))
        .fold(10.0, f64::min);
    assert!((of(&json, "least") - 100.0 * least / 10.0).abs() < 1e-9);
    for row in rows {
        let sigma = of(row, "sigma");
        assert!(of(row, "rms") < 2.5 * sigma, "{row}");
        assert!(of(row, "bias").abs() < 2.0, "{row}");
        assert_eq!(row["is_low"], false, "{row}");
    }
    // the error in a fresh run is its noise, so the true parameters predict it no better
    let [ours, truth] = ["relative_absolute", "relative_absolute_of_truth"].map(|k| of(&json, k));
    assert!(truth > 0.01 && ours < 1.1 * truth, "{ours} {truth}");
    // the true values are those of the log that `simulate` writes from the same seed
    let same = "simulate crane.yaml --trajectory m.json --perturb 0.1 --exact --out exact.csv \
                --duration 4 --bandwidth 6";
    run(&dir, same).ended(0);
    let exact = run(&dir, "identify crane.yaml exact.csv --format json")
        .ended(0)
        .json();
    for (row, exact) in rows.iter().zip(exact["parameters"].as_array().unwrap()) {
        let (truth, exact) = (of(row, "truth"), of(exact, "value"));
        assert!(
            (truth - exact).abs() < 0.01 * truth.abs().max(0.1),
            "{row} {exact}"
        );
    }
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let dir = prepared("rehearse_threads");
    let words = format!("{CRANE} --seeds 3 --score 0 --format json --threads");
    let [one, three] = ["1", "3"].map(|threads| run(&dir, &format!("{words} {threads}")).ended(0));
    assert_eq!(one.out, three.out);
}

#[test]
fn a_rehearsal_with_unsuitable_settings_exits_with_1() {
    let dir = prepared("rehearse_fails");
    let stribeck = run(
        &dir,
        &format!("{CRANE} --seeds 4 --unmodelled stribeck=2,4"),
    )
    .ended(1);
    assert!(stribeck.out.contains("not modelled"), "{}", stribeck.out);
    assert!(stribeck.err.contains("below 90 %: F"), "{}", stribeck.err);
    // positions of coarse encoders without an option: the filter is chosen from each log
    let bare = CRANE.replace("--butterworth 4,15", "--quantum 1e-3");
    let bare = run(&dir, &format!("{bare} --seeds 4 --format json")).ended(0);
    let json = bare.json();
    assert_eq!(json["passed"], true);
    // the true parameters predict the fresh run behind the filters that were chosen too
    let of_truth = json["relative_absolute_of_truth"].as_f64().unwrap();
    assert!(of_truth < 1.1 * json["relative_absolute"].as_f64().unwrap());
    // simulated controllers tuned to the estimate, not to the parameters the robot was tuned to
    let tuned = CRANE.replace("--butterworth 4,15", "--estimator didim --loop-bandwidth 6");
    let tuned = run(&dir, &format!("{tuned} --seeds 2 --format json")).ended(1);
    assert!(
        tuned.json()["least"].as_f64().unwrap() < 50.0,
        "{}",
        tuned.out
    );
    // a cutoff so low that no equation is left: every seed fails and is counted
    let low = CRANE.replace("4,15", "4,0.5");
    let low = run(&dir, &format!("{low} --seeds 2 --format json")).ended(1);
    assert_eq!(low.json()["failed"].as_array().unwrap().len(), 2);
    assert!(low.err.contains("no seed has an estimate"), "{}", low.err);
}

#[test]
fn every_estimator_is_rehearsed() {
    let dir = prepared("rehearse_estimators");
    let short = format!("{CRANE} --seeds 1 --score 0");
    for (more, name) in [
        ("--huber 1.345 --estimator huber", "least squares"),
        ("--estimator iv --reference", "instrumental variables"),
        ("--feasible --draws 10", "physically feasible least squares"),
        ("--estimator didim --reference --settle 2", "DIDIM"),
        ("--estimator response", "responses to commands"),
    ] {
        let mut words = format!("{short} {more} --format json");
        if more.contains("response") {
            // which compares positions as they are logged
            words = words.replace("--butterworth 4,15", "");
        }
        let json = run(&dir, &words).ended(0).json();
        assert_eq!(json["estimator"], name, "{more}");
        assert_eq!(json["failed"], serde_json::json!([]), "{more}");
        // one seed may miss some parameters, but not most of them
        assert!(json["within"].as_f64().unwrap() >= 50.0, "{more}: {json}");
    }
}

#[test]
fn didim_along_the_motion_begins_with_it_as_the_simulated_robot_did() {
    let dir = prepared("rehearse_begins");
    // the beginning of a loop of 3 Hz is in the log for seconds
    let soft = "rehearse crane.yaml --trajectory m.json --noise 0,1e-3 --perturb 0.1 --duration 4 --step 0.005 \
                --bandwidth 3 --estimator didim --reference --seeds 1 --score 0 --format json";
    for settle in ["0", "0.3"] {
        let json = run(&dir, &format!("{soft} --settle {settle}"))
            .ended(0)
            .json();
        for row in json["parameters"].as_array().unwrap() {
            let [rms, truth] = ["rms", "truth"].map(|key| row[key].as_f64().unwrap());
            assert!(rms < 2e-3 * (1.0 + truth.abs()), "{settle}: {row}");
        }
    }
}

#[test]
fn a_five_bar_passes_with_every_seed() {
    let dir = scratch("rehearse_loop");
    let spec = root().join("runtime/guide/fivebar/fivebar.yaml");
    fs::copy(spec, dir.join("fivebar.yaml")).unwrap();
    let motion = r#"{"format":"regen-trajectory","robot":"picker","coordinates":["q1","q3"],
        "base_frequency":0.5,"harmonics":2,"offset":[2.0,1.1],
        "cosine":[[0.1,0.05],[0.05,-0.08]],"sine":[[0.15,0.05],[-0.12,0.06]]}"#;
    fs::write(dir.join("m.json"), motion).unwrap();
    let words = "rehearse fivebar.yaml --trajectory m.json --noise 1e-5,0.01 --bandwidth 10 --perturb 0.05 \
                 --duration 8 --butterworth 4,20 --seeds 4 --score 100 --keep logs --format json";
    let json = run(&dir, words).ended(0).json();
    assert_eq!(json["parameters"].as_array().unwrap().len(), 15);
    let log = fs::read_to_string(dir.join("logs/seed3-run1.csv")).unwrap();
    assert!(log.starts_with("t,q1,q3,cmd_q1,cmd_q3,tau_q1,tau_q3\n"));
}

#[test]
fn an_experiment_file_gives_the_durations_of_runs_with_and_without_logs() {
    let dir = prepared("rehearse_planned");
    let runs = "rate: 250\nprocess:\n  filter: {butterworth: {order: 4, cutoff: 15}}\n  delay: auto\n\
                columns: {x: {column: 2, unit: mm}}\nruns:\n  - {files: a.csv, rows: [1, 751]}\n  \
                - {files: b.csv, times: [1, 3]}\n  - {files: c.csv}\n  \
                - {files: there.csv}\n  \
                - {files: d.csv, use: validate}\n";
    fs::write(dir.join("runs.yaml"), runs).unwrap();
    let rows = (0..301).map(|k| format!("{},0.1,0.2\n", 5 * k));
    let log = "n,place,q\n".to_owned() + &rows.collect::<String>();
    fs::write(dir.join("there.csv"), log).unwrap();
    let words = "rehearse crane.yaml runs.yaml --trajectory m.json --noise 1e-5,0.02 --bandwidth 6 \
                 --seeds 1 --score 0 --format json";
    let json = run(&dir, words).ended(0).json();
    assert_eq!(json["durations"], serde_json::json!([3.0, 2.0, 2.0, 1.2]));
    assert_eq!(json["step"], 0.004);
    assert_eq!(json["failed"], serde_json::json!([]));
}

#[test]
fn mistakes_of_a_rehearsal_are_reported_with_the_remedy() {
    let dir = prepared("rehearse_wrong");
    let plain = SPEC
        .replace(" friction: linear,", "")
        .replace(
            "nominal: {Fv: 4.0, Fc: 1.0}",
            "rotor_inertia: true, nominal: {J: 0}",
        )
        .replace(
            "nominal: {Fv: 0.3, Fc: 0.2}",
            "rotor_inertia: true, nominal: {J: 0}",
        );
    fs::write(dir.join("plain.yaml"), plain).unwrap();
    fs::write(dir.join("bare.yaml"), SPEC.split("bodies:").next().unwrap()).unwrap();
    for (words, code, message) in [
        ("rehearse crane.yaml --seeds 0", 2, "at least 1"),
        (
            "rehearse crane.yaml --score 120",
            3,
            "--score is a percentage",
        ),
        ("rehearse crane.yaml --confidence 1", 3, "--confidence"),
        ("rehearse crane.yaml --perturb 1", 3, "--perturb"),
        (
            "rehearse crane.yaml --unmodelled ripple=1",
            2,
            "stribeck=PART",
        ),
        ("rehearse crane.yaml --unmodelled stribeck=-1", 2, "above 0"),
        (
            "rehearse plain.yaml --unmodelled stribeck=1",
            3,
            "no joint has",
        ),
        ("rehearse bare.yaml", 3, "no nominal values of body cart"),
        (
            "rehearse crane.yaml --column q=angle",
            2,
            "--column is for logs",
        ),
        (
            "rehearse crane.yaml --estimator iv --feasible",
            2,
            "--feasible",
        ),
        (
            "rehearse crane.yaml --estimator didim --energy 0.1",
            2,
            "--energy",
        ),
        ("rehearse crane.yaml --feasible --draws 0", 3, "--draws 0"),
        (
            "rehearse crane.yaml --trajectory m.json --estimator iv --reference --settle 0.5",
            3,
            "--settle: the time to settle must be whole periods",
        ),
        ("rehearse crane.yaml --butterworth 4,80", 3, "80"),
        ("rehearse crane.yaml none.csv --runs 2", 2, "--runs"),
    ] {
        let found = run(&dir, words).ended(code);
        assert!(found.err.contains(message), "{words}: {}", found.err);
    }
}

#[test]
fn nonlinear_friction_is_scored_against_the_simulated_one() {
    let dir = prepared("rehearse_friction");
    let spec = SPEC.replace(
        "nominal: {Fv: 4.0, Fc: 1.0}",
        "nominal: {Fc: 2.0, Fv: 3.0, delta: 0.5}",
    );
    let spec = spec.replacen("friction: linear", "friction: power", 1);
    fs::write(dir.join("power.yaml"), spec).unwrap();
    let words = "rehearse power.yaml --trajectory m.json --noise 1e-5,0.02 --perturb 0.1 --friction \
                 --butterworth 4,15 --duration 6 --bandwidth 6 --draws 20 --seeds 3 --score 0 --format json";
    let json = run(&dir, words).ended(0).json();
    assert_eq!(json["failed"], Value::Array(vec![]));
    let rows = json["parameters"].as_array().unwrap();
    let of = |value: &Value, key: &str| value[key].as_f64().unwrap();
    for (label, nominal) in [
        ("Fc+(x)", 2.0),
        ("Fc-(x)", 2.0),
        ("Fv(x)", 3.0),
        ("delta(x)", 0.5),
    ] {
        let row = rows.iter().find(|row| row["label"] == label).unwrap();
        let truth = of(row, "truth");
        assert!((truth / nominal - 1.0).abs() <= 0.1, "{row}");
        // Coulomb friction and a power of the velocity are hardly told apart
        let error = (of(row, "mean") - truth).abs();
        assert!(error < 3.0 * of(row, "sigma"), "{row}");
    }
    // the true model has the friction too: what it leaves is noise and what the filter does
    let [ours, exact] = ["relative_absolute", "relative_absolute_of_truth"].map(|k| of(&json, k));
    assert!(
        exact > 0.01 && exact < 5.0 && ours < 1.2 * exact,
        "{ours} {exact}"
    );
    // least squares does not seek it
    let json = run(
        &dir,
        &words.replace("--friction ", "").replace("--draws 20", ""),
    )
    .ended(0)
    .json();
    let rows = json["parameters"].as_array().unwrap();
    assert!(
        rows.iter()
            .all(|row| !row["label"].as_str().unwrap().starts_with("delta"))
    );
    assert!((of(&json, "relative_absolute_of_truth") - exact).abs() < 1e-9);
}

/// A crane whose rod carries a load in the second run; both efforts are logged as currents.
#[test]
fn gains_and_a_payload_are_scored_against_the_simulated_ones() {
    let dir = prepared("rehearse_loads");
    let hook = "      - {type: fixed, origin: {xyz: [0, 0, -0.2]}, body: load, payload: true}\nbodies:\n  \
                load: {mass: 0.4, com: [0.02, 0, -0.05], inertia: [0.004, 0, 0, 0.004, 0, 0.002]}\n";
    fs::write(dir.join("hook.yaml"), SPEC.replacen("bodies:\n", hook, 1)).unwrap();
    let runs = "columns:\n  tau_x: {column: 4, unit: A, gain: unknown}\n  tau_q: {column: 5, unit: A, \
                gain: unknown}\nprocess:\n  filter: {butterworth: {order: 4, cutoff: 15}}\nruns:\n  \
                - {files: a.csv}\n  - {files: b.csv, payload: {m: 0.5}}\n";
    fs::write(dir.join("runs.yaml"), runs).unwrap();
    let words = "rehearse hook.yaml runs.yaml --trajectory m.json --noise 1e-5,0.02 --perturb 0.1 \
                 --duration 4 --bandwidth 6 --gain x=-8 --seeds 4 --score 60 --format json";
    let json = run(&dir, words).ended(0).json();
    assert_eq!(json["failed"], Value::Array(vec![]));
    let rows = json["parameters"].as_array().unwrap();
    let row = |label: &str| rows.iter().find(|row| row["label"] == label);
    let of = |value: &Value, key: &str| value[key].as_f64().unwrap();
    for (label, truth) in [("gain(x)", -8.0), ("gain(q)", 1.0)] {
        let row = row(label).unwrap();
        assert!((of(row, "truth") - truth).abs() < 1e-12, "{row}");
        assert!((of(row, "mean") / truth - 1.0).abs() < 0.05, "{row}");
        assert!(
            of(row, "sigma") > 0.0 && row["within"].as_u64().unwrap() >= 3,
            "{row}"
        );
    }
    // the load is perturbed like the other bodies, but its mass is given
    let centre = row("cz of load").unwrap();
    let truth = of(centre, "truth");
    assert!((truth + 0.05).abs() < 0.03, "{centre}");
    assert!((of(centre, "mean") - truth).abs() < 0.02, "{centre}");
    assert!(row("m of load").is_none());
    // the mass is 0.5 kg, so the first moment of the load about its hook is half of cz
    let moment = row("mz(load)").unwrap();
    assert!(
        (of(moment, "truth") - 0.5 * truth).abs() < 1e-12,
        "{moment}"
    );
    let [ours, exact] = ["relative_absolute", "relative_absolute_of_truth"].map(|k| of(&json, k));
    assert!(exact > 0.01 && ours < 1.2 * exact, "{ours} {exact}");

    for own in ["iv --reference", "didim"] {
        let words = words.replace("--seeds 4", &format!("--seeds 2 --estimator {own}"));
        let json = run(&dir, &words).ended(0).json();
        assert_eq!(json["failed"], Value::Array(vec![]), "{own}");
        let rows = json["parameters"].as_array().unwrap();
        for (label, truth) in [("gain(x)", -8.0), ("gain(q)", 1.0)] {
            let row = rows.iter().find(|row| row["label"] == label).unwrap();
            assert!((of(row, "mean") / truth - 1.0).abs() < 0.05, "{own}: {row}");
            assert_eq!(row["within"], 2, "{own}: {row}");
        }
    }

    // logs that exist give durations and rate, also while their gains are unknown
    let mut log = "t,x,q,i_x,i_q\n".to_owned();
    for k in 0..=500 {
        let t = 0.004 * f64::from(k);
        writeln!(
            log,
            "{t:.3},{:.5},{:.5},0.1,0.2",
            0.1 * t.sin(),
            0.2 * t.cos()
        )
        .unwrap();
    }
    for name in ["a.csv", "b.csv"] {
        fs::write(dir.join(name), &log).unwrap();
    }
    let planned = words
        .replace("--duration 4 ", "")
        .replace("--seeds 4 --score 60", "--seeds 1 --score 0");
    let json = run(&dir, &planned).ended(0).json();
    assert_eq!(json["durations"], serde_json::json!([2.0, 2.0]));
    assert_eq!(json["step"], 0.004);

    let words = words.replace("--seeds 4", "--estimator response --seeds 1");
    let refused = run(&dir, &words).ended(3);
    assert!(
        refused.err.contains("gains and payloads"),
        "{}",
        refused.err
    );
}
