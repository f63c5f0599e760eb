//! `regen identify --estimator`: the estimators that simulate the controlled robot, as a user runs
//! them, and the aliases of the others.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{Run, regen, scratch};
use serde_json::Value;

/// An upright pendulum with friction.
const SPEC: &str = "\
name: swing
gravity: [0, 0, -9.81]
limbs:
  - name: arm
    base: {rpy: [pi/2, 0, 0]}
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true, friction: linear,
         nominal: {Fv: 0.3, Fc: 0.2}, limits: {position: [-1.5, 1.5]}}
home: {q1: -0.4}
bodies:
  1: {mass: 2.0, com: [0.2, 0.05, 0], inertia: [0.01, 0, 0, 0.05, 0, 0.05]}
";

/// A motion that shows inertia, weight and friction.
const MOTION: &str = r#"{
  "format": "regen-trajectory", "robot": "swing", "coordinates": ["q1"], "base_frequency": 0.5,
  "harmonics": 3, "cosine": [[0.5, -0.3, 0.1]], "sine": [[0.8, 0.6, -0.5]], "offset": [-0.4]
}"#;

/// The true values, of which those of the spec are up to 10 % off.
const TRUTH: &str =
    r#"{"Izz(1)": 0.145, "mx(1)": 0.42, "my(1)": 0.092, "Fv(q1)": 0.33, "Fc(q1)": 0.185}"#;

/// A folder with the spec, a motion, a log of it and the controllers' gains.
fn prepared(test: &str) -> PathBuf {
    let dir = scratch(test);
    fs::write(dir.join("swing.yaml"), SPEC).unwrap();
    fs::write(dir.join("m.json"), MOTION).unwrap();
    fs::write(dir.join("truth.json"), TRUTH).unwrap();
    let words = "simulate swing.yaml --trajectory m.json --parameters truth.json --seed 3 --noise 1e-5,0.01 \
                 --duration 2 --settle 2 --step 0.005 --bandwidth 8";
    run(
        &dir,
        &format!("{words} --commands --controller gains.yaml --out run.csv"),
    )
    .ended(0);
    dir
}

fn run(dir: &Path, words: &str) -> Run {
    let args: Vec<&str> = words.split_whitespace().collect();
    regen(dir, &args)
}

/// Asserts that every parameter is within four of its standard deviations of the truth, and that
/// these are below a tenth of the largest value.
fn assert_true(found: &Value) {
    let truth: Value = serde_json::from_str(TRUTH).unwrap();
    let rows = found["parameters"].as_array().unwrap();
    assert_eq!(rows.len(), 5, "{found}");
    for row in rows {
        let of = |key: &str| row[key].as_f64().unwrap();
        let truth = truth[row["label"].as_str().unwrap()].as_f64().unwrap();
        assert!(
            (of("value") - truth).abs() < 4.0 * of("sigma"),
            "{row} {truth}"
        );
        assert!(of("sigma") < 0.04, "{row}");
    }
}

#[test]
fn responses_and_efforts_give_the_parameters_in_the_common_result() {
    let dir = prepared("simulated_result");
    let words = "identify swing.yaml run.csv --controller gains.yaml --format json --estimator";
    let found = run(&dir, &format!("{words} response --window 0.5 --out p.json"))
        .ended(0)
        .json();
    assert_eq!(found["method"], "response");
    assert_eq!(found["simulated"]["response"]["windows"], 4);
    assert_eq!(found["efforts"][0]["name"], "q1");
    assert_true(&found);
    let file = fs::read_to_string(dir.join("p.json")).unwrap();
    assert!(file.contains("output error of responses"), "{file}");
    run(&dir, "validate swing.yaml p.json run.csv").ended(0);

    // along the commands of the log, and along the trajectory of which they are samples
    let commands = run(&dir, &format!("{words} didim")).ended(0).json();
    assert_eq!(commands["method"], "DIDIM");
    assert_true(&commands);
    let text = run(
        &dir,
        "identify swing.yaml run.csv --estimator didim --reference m.json --loop-bandwidth 8",
    );
    assert!(text.ended(0).out.contains("  rounds"), "");
}

#[test]
fn a_log_that_begins_with_the_motion_is_simulated_from_there_along_the_trajectory() {
    let dir = prepared("simulated_at_once");
    for (words, log) in [("", "once.csv"), ("--settle 2", "later.csv")] {
        run(
            &dir,
            &format!(
                "simulate swing.yaml --trajectory m.json --bandwidth 2 --controller soft.yaml {words} --out {log}"
            ),
        )
        .ended(0);
        let found = run(
            &dir,
            &format!("identify swing.yaml {log} --estimator didim --reference m.json --controller soft.yaml"),
        )
        .ended(0);
        assert!(!found.err.contains("differs"), "{log}: {}", found.err);
    }
}

#[test]
fn rounds_that_do_not_converge_leave_no_estimate() {
    let dir = prepared("simulated_unsettled");
    // efforts ten times as large, with the wrong sign: those of a mass below zero, with which nothing can
    // be simulated
    let text = fs::read_to_string(dir.join("run.csv")).unwrap();
    let head: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let place = head.iter().position(|h| *h == "tau_q1").unwrap();
    let mut turned = head.join(",") + "\n";
    for line in text.lines().skip(1) {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        cells[place] = (-10.0 * cells[place].parse::<f64>().unwrap()).to_string();
        turned += &(cells.join(",") + "\n");
    }
    fs::write(dir.join("turned.csv"), turned).unwrap();
    let words =
        "identify swing.yaml turned.csv --estimator didim --controller gains.yaml --out n.json";
    let ended = run(&dir, words).ended(4);
    assert!(ended.err.contains("did not converge"), "{}", ended.err);
    assert!(
        ended.out.is_empty() && !dir.join("n.json").exists(),
        "{}",
        ended.out
    );
}

#[test]
fn an_experiment_file_defines_how_commands_are_read_and_the_controllers() {
    let dir = prepared("simulated_experiment");
    let text = fs::read_to_string(dir.join("run.csv")).unwrap();
    let head: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let place = |title: &str| head.iter().position(|h| *h == title).unwrap();
    // positions and commands side by side, with semicolons and decimal commas
    for (file, titles) in [
        ("a.csv", &["t", "q1"][..]),
        ("b.csv", &["t", "cmd_q1", "tau_q1"]),
    ] {
        let row = |line: &str| {
            let cells: Vec<&str> = line.split(',').collect();
            let own: Vec<&str> = titles.iter().map(|t| cells[place(t)]).collect();
            own.join(";").replace('.', ",").replace("cmd_q1", "goal") + "\n"
        };
        fs::write(dir.join(file), text.lines().map(row).collect::<String>()).unwrap();
    }
    let gains = fs::read_to_string(dir.join("gains.yaml")).unwrap();
    let gains = format!("      {}\n", gains.trim_end().replace('\n', "\n      "));
    let runs = format!(
        "process: {{delay: auto}}\nruns:\n  - files: [a.csv, b.csv]\n    \
         commands: {{q*: goal}}\n    controller:\n{gains}  - {{files: run.csv, use: validate}}\n"
    );
    fs::write(dir.join("runs.yaml"), runs).unwrap();
    let words = "--format json --estimator";
    for estimator in ["response --window 0.5", "didim"] {
        let identify = |log: &str| {
            run(
                &dir,
                &format!("identify swing.yaml {log} {words} {estimator}"),
            )
        };
        let found = identify("runs.yaml").ended(0);
        let says = "does not use these keys of the experiment file: delay, runs to validate on";
        assert!(found.err.contains(says), "{}", found.err);
        let plain = identify("run.csv --controller gains.yaml").ended(0).json();
        assert_eq!(found.json()["parameters"], plain["parameters"]);
    }
    // instruments follow the trajectory with the same gains; those of the options win
    let iv = |more: &str| {
        let words = "identify swing.yaml runs.yaml --delay q1=0 --no-suspicion --format json --iv";
        let found = run(&dir, &format!("{words} --reference m.json {more}"));
        found.ended(0).json()["parameters"].clone()
    };
    assert_ne!(iv(""), iv("--pid 900,3000,40"));
}

#[test]
fn wrong_controllers_of_an_experiment_file_are_reported_with_their_place() {
    let dir = prepared("simulated_wrong");
    let told = |run_of: &str, estimator: &str, code: i32| {
        fs::write(dir.join("runs.yaml"), format!("runs:\n  - {run_of}\n")).unwrap();
        let words = format!("identify swing.yaml runs.yaml --estimator {estimator}");
        run(&dir, &words).ended(code).err
    };
    let missing = told("{files: run.csv, controller: {}}", "didim", 3);
    assert!(
        missing.contains("runs.yaml:2:") && missing.contains("`q1`: this actuated joint has no"),
        "{missing}"
    );
    let unsaid = told("{files: run.csv}", "response", 2);
    assert!(
        unsaid.contains("run.csv: --controller") && unsaid.contains("`controller` of the run"),
        "{unsaid}"
    );
    let estimated = "{files: run.csv, controller: {q1: {kp: {estimate: 1}}}}";
    assert!(told(estimated, "didim", 3).contains("leave `estimate` out"));
    let late = "{files: run.csv, controller: {q1: {kp: 1}, signals: {q1: {delay: 0.01}}}}";
    assert!(told(late, "didim", 3).contains("leave `signals` out"));
    for (keys, says) in [
        ("latency: 0.5", "`latency`: write the number of rows"),
        ("velocity_latency: 1", "has `damping: velocity`"),
        ("latency: 1, action: continuous", "have no latency"),
    ] {
        let wrong = format!("{{files: run.csv, controller: {{q1: {{kp: 1}}, {keys}}}}}");
        let told = told(&wrong, "didim", 3);
        assert!(
            told.contains("runs.yaml:2:") && told.contains(says),
            "{keys}: {told}"
        );
    }
}

#[test]
fn a_simulated_motion_that_departs_from_the_measured_one_is_reported() {
    let dir = prepared("simulated_departure");
    let words = "identify swing.yaml run.csv --estimator didim --format json";
    let known = run(&dir, &format!("{words} --controller gains.yaml")).ended(0);
    assert!(
        !known.err.contains("differs from the measured"),
        "{}",
        known.err
    );
    let percent = |found: &Run| {
        let found = found.json();
        let own = &found["simulated"]["didim"]["departures"][0];
        assert_eq!(own["name"], "q1");
        own["percent"].as_f64().unwrap()
    };
    assert!(percent(&known) < 0.1, "{}", percent(&known));
    // without gains, the bandwidth is that of the controllers, from the motion: 8 Hz
    let found = run(&dir, words).ended(0);
    assert!(percent(&found) < 0.3, "{}", percent(&found));
    let bandwidth = found.json()["simulated"]["didim"]["bandwidth"]
        .as_f64()
        .unwrap();
    assert!((bandwidth - 8.0).abs() < 0.5, "{bandwidth}");
    let tuned = run(&dir, &format!("{words} --loop-bandwidth 5")).ended(0);
    assert!(percent(&tuned) > 1.0, "{}", percent(&tuned));
    assert!(
        tuned
            .err
            .contains("the simulated motion differs from the measured one in q1"),
        "{}",
        tuned.err
    );
}

#[test]
fn undetermined_controller_parameters_are_named_and_exit_with_4() {
    let dir = prepared("simulated_open");
    let gains = "q1: {kp: {estimate: 100}, ki: {estimate: 400}, kd: {estimate: 2}, \
                 offset: {estimate: 0}}\n";
    fs::write(dir.join("unknown.yaml"), gains).unwrap();
    let found = run(
        &dir,
        "identify swing.yaml run.csv --estimator response --controller unknown.yaml --window 5",
    )
    .ended(4);
    assert!(found.out.contains("estimated too"), "{}", found.out);
    assert!(found.out.contains("undetermined"), "{}", found.out);
    assert!(found.err.contains("do not determine"), "{}", found.err);
    assert!(
        found.err.contains("the common scale of Izz(1)"),
        "{}",
        found.err
    );
}

#[test]
fn missing_and_wrong_inputs_of_simulated_fits_are_reported_with_the_remedy() {
    let dir = prepared("simulated_wrong_inputs");
    let text = fs::read_to_string(dir.join("run.csv")).unwrap();
    fs::write(dir.join("bare.csv"), text.replace("cmd_q1", "target")).unwrap();
    fs::write(dir.join("typo.yaml"), "q1: {kp: 40, kt: 2}\n").unwrap();
    fs::write(dir.join("other.yaml"), "q2: {kp: 40}\n").unwrap();
    let response = "identify swing.yaml run.csv --estimator response";
    for (words, code, says) in [
        (response.to_owned(), 2, "--controller FILE"),
        (
            format!("{response} --controller typo.yaml"),
            3,
            "q1.kt: unknown key",
        ),
        (
            format!("{response} --controller other.yaml"),
            3,
            "q2: this is not an actuated",
        ),
        (
            format!("{response} --controller gains.yaml --window 0"),
            3,
            "--window",
        ),
        (
            format!("{response} --controller gains.yaml --feasible"),
            2,
            "--feasible",
        ),
        (
            format!("{response} --controller gains.yaml --delay q1=0.1"),
            2,
            "--delay",
        ),
        (
            "identify swing.yaml run.csv --reference m.json".to_owned(),
            2,
            "--reference",
        ),
        (
            "identify swing.yaml run.csv --iv --estimator ls".to_owned(),
            2,
            "--iv",
        ),
        (
            "identify swing.yaml run.csv --estimator didim --start m.json".to_owned(),
            3,
            "m.json",
        ),
        (
            "identify swing.yaml bare.csv --estimator response --controller gains.yaml".to_owned(),
            3,
            "--command q1=COLUMN",
        ),
        (
            "identify swing.yaml bare.csv --estimator didim".to_owned(),
            3,
            "--reference",
        ),
    ] {
        let found = run(&dir, &words).ended(code);
        assert!(found.err.contains(says), "{words}: {}", found.err);
    }
    let named = "identify swing.yaml bare.csv --estimator response --controller gains.yaml \
                 --command q1=target:rad";
    run(&dir, named).ended(0);
}

#[test]
fn options_and_estimators_of_the_same_name_are_the_same() {
    let dir = prepared("simulated_alias");
    for [option, estimator] in [["--iv", "iv"], ["--huber 1.345", "huber"], ["", "ls"]] {
        let words = "identify swing.yaml run.csv --butterworth 4,20 --format json";
        let old = run(&dir, &format!("{words} {option}")).ended(0).out;
        let new = run(&dir, &format!("{words} --estimator {estimator}"))
            .ended(0)
            .out;
        assert_eq!(old, new);
    }
}

/// A cart on a rail.
const CART: &str = "\
name: cart
gravity: [0, 0, -9.81]
limbs:
  - name: axis
    joints:
      - {name: x, type: prismatic, axis: x, body: car, actuated: true, friction: linear,
         nominal: {Fv: 20, Fc: 5}}
bodies:
  car: {mass: 9}
";

/// Writes the log of a cart of 10 kg with 15 N s/m and 6 N of friction, whose controller, at rows of 2 ms, has
/// an inner loop of the velocity as it was `late` rows before: kp e + ki integral(e) - kd v - kv (x - x(0)).
fn write_cart(dir: &Path, name: &str, [kp, ki, kd, kv]: [f64; 4], late: usize) {
    let (step, parts) = (2e-3, 20);
    let (mut x, mut v, mut sum) = (0.0, 0.0, 0.0);
    let mut velocities = vec![0.0; late + 1];
    let mut rows = "t,x,goal,tau_x\n".to_owned();
    let mut held = 0.0;
    for k in 0..2000 {
        let t = step * f64::from(k);
        let goal = 0.1 * (1.0 - (3.0 * t).cos()) + 0.03 * (1.0 - (11.0 * t).cos());
        let error = goal - x;
        velocities.insert(0, v);
        sum += error * step;
        let effort = kp * error + ki * sum - kd * velocities[late] - kv * x;
        let _ = writeln!(rows, "{t},{x},{goal},{}", f64::midpoint(held, effort));
        held = effort;
        for _ in 0..parts {
            let h = step / f64::from(parts);
            let rate = |v: f64| (effort - 15.0 * v - 6.0 * (v / 1e-3).tanh()) / 10.0;
            let middle = v + 0.5 * h * rate(v);
            x += h * middle;
            v += h * rate(middle);
        }
    }
    fs::write(dir.join(name), rows).unwrap();
}

#[test]
fn logged_efforts_that_contradict_a_response_are_told_with_the_latency_that_was_tried() {
    let dir = scratch("simulated_against");
    fs::write(dir.join("cart.yaml"), CART).unwrap();
    let gains = "x: {kp: 20000, kd: 500, damping: velocity}\n";
    fs::write(dir.join("gains.yaml"), gains).unwrap();
    fs::write(
        dir.join("late.yaml"),
        gains.to_owned() + "velocity_latency: 1\n",
    )
    .unwrap();
    fs::write(
        dir.join("always.yaml"),
        gains.to_owned() + "action: continuous\n",
    )
    .unwrap();
    let fit = |log: &str, controller: &str, estimator: &str| {
        let words = "identify cart.yaml LOG --command x=goal --format json --estimator";
        let words = format!("{words} {estimator} --controller {controller}").replace("LOG", log);
        run(&dir, &words).ended(0)
    };
    let of = |found: &Value, label: &str| {
        let rows = found["parameters"].as_array().unwrap().clone();
        rows.into_iter().find(|row| row["label"] == label).unwrap()
    };
    let mass = |found: &Value| of(found, "m(car)")["value"].as_f64().unwrap();

    write_cart(&dir, "now.csv", [20000.0, 0.0, 500.0, 0.0], 0);
    let right = fit("now.csv", "gains.yaml", "response");
    assert!(!right.err.contains("contradict"), "{}", right.err);
    let efforts = &right.json()["simulated"]["response"]["efforts"];
    assert!(
        efforts["relative_absolute"].as_f64().unwrap() < 4.0,
        "{efforts}"
    );
    assert!((mass(&right.json()) - 10.0).abs() < 0.1);

    write_cart(&dir, "late.csv", [20000.0, 0.0, 500.0, 0.0], 1);
    let wrong = fit("late.csv", "gains.yaml", "response");
    assert!((mass(&wrong.json()) - 10.0).abs() > 0.5, "{}", wrong.out);
    assert!(
        wrong.err.contains("contradict this estimate"),
        "{}",
        wrong.err
    );
    assert!(
        wrong
            .err
            .contains("`velocity_latency: 1` in the controllers, which was tried"),
        "{}",
        wrong.err
    );
    let mended = fit("late.csv", "late.yaml", "response");
    assert!(!mended.err.contains("contradict"), "{}", mended.err);
    assert!((mass(&mended.json()) - 10.0).abs() < 0.1, "{}", mended.out);

    // commands that are held, followed all the time, look half a row early: friction becomes negative
    let always = fit("now.csv", "always.yaml", "response");
    let viscous = of(&always.json(), "Fv(x)");
    assert!(
        viscous["value"].as_f64().unwrap() < 0.0 && viscous["status"] == "negative",
        "{viscous}"
    );
    assert!(
        always.err.contains("`action: sampled` in the controllers"),
        "{}",
        always.err
    );
}

#[test]
fn cascades_with_and_without_integrals_are_simulated_by_didim_and_response_alike() {
    let dir = scratch("simulated_cascades");
    fs::write(dir.join("cart.yaml"), CART).unwrap();
    // P and P, with the velocity of the row before too; with an integral of the position; P and PI
    for (ki, kv, late) in [
        (0.0, 0.0, 0),
        (0.0, 0.0, 1),
        (60000.0, 0.0, 0),
        (120_000.0, 3000.0, 0),
    ] {
        write_cart(&dir, "run.csv", [20000.0, ki, 500.0, kv], late);
        let gains = format!(
            "x: {{kp: 20000, ki: {ki}, kd: 500, ki_velocity: {kv}, damping: velocity}}\nvelocity_latency: {late}\n"
        );
        fs::write(dir.join("gains.yaml"), gains).unwrap();
        for estimator in ["didim", "response"] {
            let words =
                "identify cart.yaml run.csv --command x=goal --format json --controller gains.yaml";
            let found = run(&dir, &format!("{words} --estimator {estimator}")).ended(0);
            let has_warned = ["differs", "contradict"]
                .iter()
                .any(|word| found.err.contains(word));
            assert!(!has_warned, "{estimator} {ki} {kv} {late}: {}", found.err);
            let found = found.json();
            for (label, truth) in [("m(car)", 10.0), ("Fv(x)", 15.0), ("Fc(x)", 6.0)] {
                let rows = found["parameters"].as_array().unwrap();
                let row = rows.iter().find(|row| row["label"] == label).unwrap();
                let value = row["value"].as_f64().unwrap();
                assert!(
                    (value / truth - 1.0).abs() < 0.03,
                    "{estimator} {ki} {kv} {late} {label}: {row}"
                );
            }
        }
    }
    // much faster than the log
    fs::write(
        dir.join("gains.yaml"),
        "x: {kp: 20000, kd: 500, damping: velocity}\naction: continuous\n",
    )
    .unwrap();
    let words =
        "identify cart.yaml run.csv --command x=goal --estimator didim --controller gains.yaml";
    run(&dir, words).ended(0);
}
