//! `regen simulate` as a user runs it.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::Path;

use crate::common::{regen, root, scratch};

fn robot(name: &str) -> String {
    root().join("robots").join(name).display().to_string()
}

/// The columns of a log with their headers.
fn columns(path: &Path) -> Vec<(String, Vec<f64>)> {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let heads = lines.next().unwrap().split(',');
    let mut columns: Vec<(String, Vec<f64>)> = heads.map(|h| (h.to_owned(), vec![])).collect();
    for line in lines {
        for (column, cell) in columns.iter_mut().zip(line.split(',')) {
            column.1.push(cell.parse().unwrap());
        }
    }
    columns
}

#[test]
fn a_minute_keeps_loops_closed_to_a_nanometre_and_energy_to_a_microjoule() {
    let dir = scratch("simulate_minute");
    let spec = robot("3rps.yaml");
    let args = ["simulate", &spec, "--out", "log.csv", "--duration", "60"];
    let json = regen(&dir, &[&args[..], &["--format", "json"]].concat())
        .ended(0)
        .json();
    let run = &json["runs"][0];
    assert_eq!(run["samples"], 6001);
    assert!(run["drift"].as_f64().unwrap() < 1e-9, "{run}");
    assert!(run["imbalance"].as_f64().unwrap() < 1e-6, "{run}");
    // it moved, and followed the reference closely
    assert!(run["kinetic"].as_f64().unwrap() > 1e-3, "{run}");
    assert!(run["tracking"].as_f64().unwrap() < 0.01, "{run}");
}

#[test]
fn identification_finds_the_friction_that_was_simulated() {
    let dir = scratch("simulate_identify");
    fs::write(
        dir.join("arm.yaml"),
        "\
name: arm
gravity: [0, 0, -9.81]
limbs:
  - name: arm
    joints:
      - {name: x, type: prismatic, axis: x, body: cart, actuated: true,
         friction: viscous, nominal: {Fv: 4.0}, limits: {position: [-0.5, 0.5]}}
      - {name: q, type: revolute, axis: y, body: rod, actuated: true,
         friction: viscous, nominal: {Fv: 0.3}, limits: {position: [-2, 2]}}
home: {x: 0.1, q: 0.3}
bodies:
  cart: {mass: 3.0, com: [0, 0, 0], inertia: [0.01, 0, 0, 0.01, 0, 0.01]}
  rod: {mass: 1.0, com: [0, 0, -0.2], inertia: [0.02, 0, 0, 0.02, 0, 0.001]}
",
    )
    .unwrap();
    regen(
        &dir,
        &[
            "simulate",
            "arm.yaml",
            "--out",
            "log.csv",
            "--bandwidth",
            "6",
        ],
    )
    .ended(0);
    let fit = ["identify", "arm.yaml", "log.csv", "--format", "json"];
    let found = regen(&dir, &[&fit[..], &["--butterworth", "4,15"]].concat())
        .ended(0)
        .json();
    // the identified parameters can be simulated in turn
    let out = [&fit[..], &["--butterworth", "4,15", "--out", "p.json"]].concat();
    regen(&dir, &out).ended(0);
    let again = [
        "simulate",
        "arm.yaml",
        "--parameters",
        "p.json",
        "--out",
        "again.csv",
    ];
    regen(&dir, &[&again[..], &["--bandwidth", "6"]].concat()).ended(0);
    let [first, second] = ["log.csv", "again.csv"].map(|name| columns(&dir.join(name)));
    for ((head, a), (_, b)) in first.iter().zip(&second) {
        let size = a.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let pairs = a.iter().zip(b);
        let off = pairs.fold(0.0_f64, |m, (x, y)| m.max((x - y).abs()));
        // friction is found to 3 percent, and is a part of the efforts
        assert!(off < 0.03 * size, "{head}: {off} of {size}");
    }
    let rows = found["parameters"].as_array().unwrap();
    let value = |label: &str| {
        let row = rows.iter().find(|r| r["label"] == label).unwrap();
        row["value"].as_f64().unwrap()
    };
    // the remaining error is due to differentiation and the filter: a twentieth of a percent; an
    // effort half a sample early, 5 ms of 1.6 s per radian, would give 2 percent
    for (label, truth) in [("Fv(x)", 4.0), ("Fv(q)", 0.3), ("mx(rod)", 0.0)] {
        let off = (value(label) - truth).abs();
        assert!(
            off < 5e-4 * f64::max(truth, 0.1),
            "{label} {}",
            value(label)
        );
    }
}

/// The values of the identified parameters, and eps_RA in percent.
fn identified(dir: &Path, spec: &str, log: &str) -> (Vec<f64>, f64) {
    let found = regen(dir, &["identify", spec, log, "--format", "json"]).ended(0);
    let found = found.json();
    let rows = found["parameters"].as_array().unwrap();
    let values = rows.iter().map(|r| r["value"].as_f64().unwrap()).collect();
    (values, found["relative_absolute"].as_f64().unwrap())
}

/// Central differences at 100 Hz have errors of 1e-4 to 1e-3 of the motion's derivatives; a log
/// whose efforts are half a sample ahead of its motion exceeds these bounds tenfold.
#[test]
fn default_logs_without_noise_give_the_parameters_that_were_simulated() {
    let dir = scratch("simulate_unbiased");
    fs::write(
        dir.join("arm.yaml"),
        "\
name: arm
gravity: [0, 0, -9.81]
limbs:
  - name: arm
    base: {rpy: [pi/2, 0, 0]}
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true,
         friction: viscous, nominal: {Fv: 0.4}, limits: {position: [-2, 2]}}
      - {name: q2, type: revolute, dh: {a: 0.4}, body: 2, actuated: true,
         friction: viscous, nominal: {Fv: 0.2}, limits: {position: [-2, 2]}}
home: {q1: 0.3, q2: 0.5}
bodies:
  1: {mass: 3.0, com: [0.2, 0, 0], inertia: [0.01, 0, 0, 0.05, 0, 0.05]}
  2: {mass: 1.5, com: [0.15, 0, 0], inertia: [0.005, 0, 0, 0.02, 0, 0.02]}
",
    )
    .unwrap();
    for spec in [
        "arm.yaml".to_owned(),
        robot("fivebar.yaml"),
        robot("3rps.yaml"),
    ] {
        let simulate = ["simulate", &spec, "--out"];
        regen(&dir, &[&simulate[..], &["log.csv"]].concat()).ended(0);
        regen(&dir, &[&simulate[..], &["exact.csv", "--exact"]].concat()).ended(0);
        let (found, error) = identified(&dir, &spec, "log.csv");
        let (truth, exact) = identified(&dir, &spec, "exact.csv");
        // each row of an exact log is consistent, up to rounding
        assert!(exact < 1e-8, "{spec}: {exact} %");
        assert!(error < 0.01, "{spec}: {error} %");
        for (found, truth) in found.iter().zip(&truth) {
            let off = (found - truth).abs();
            assert!(off < 0.01 * truth.abs().max(0.1), "{spec}: {found} {truth}");
        }
    }
}

#[test]
fn the_true_parameters_of_a_perturbed_robot_simulate_the_same_log() {
    let dir = scratch("simulate_truth");
    // friction that is linear and friction that is not
    let text = fs::read_to_string(robot("fivebar.yaml")).unwrap();
    assert!(!text.contains("friction:"));
    let law = "friction: stribeck, nominal: {Fc: 0.3, Fs: 0.4, vs: 0.1, delta: 2, Fv: 0.2}, actuated: true";
    let text = text.replacen("actuated: true", law, 1);
    fs::write(dir.join("robot.yaml"), text).unwrap();
    let args = ["simulate", "robot.yaml", "--duration", "0.2"];
    let drawn = [
        "--perturb",
        "0.1",
        "--truth",
        "truth.yaml",
        "--out",
        "a.csv",
    ];
    regen(&dir, &[&args[..], &drawn].concat()).ended(0);
    let truth = fs::read_to_string(dir.join("truth.yaml")).unwrap();
    assert!(truth.contains("Fs(q1)"), "{truth}");
    let again = [
        "--parameters",
        "truth.yaml",
        "--truth",
        "again.yaml",
        "--out",
        "b.csv",
    ];
    regen(&dir, &[&args[..], &again].concat()).ended(0);
    assert_eq!(fs::read_to_string(dir.join("again.yaml")).unwrap(), truth);
    // the controllers are tuned to the true parameters there
    let start = |name: &str| columns(&dir.join(name))[0].1[0].to_bits();
    assert_eq!(start("a.csv"), start("b.csv"));
}

#[test]
fn runs_differ_in_noise_and_the_same_seed_gives_the_same_files() {
    let dir = scratch("simulate_runs");
    let spec = robot("fivebar.yaml");
    let with = |seed: &str, out: &str| {
        let args = ["simulate", &spec, "--duration", "0.3", "--runs", "2"];
        let noise = [
            "--noise",
            "1e-4,0.01",
            "--quantum",
            "1e-5,0.001",
            "--perturb",
            "0.1",
        ];
        let rest = ["--seed", seed, "--out", out];
        regen(&dir, &[&args[..], &noise, &rest].concat()).ended(0);
    };
    with("3", "a.csv");
    with("3", "b.csv");
    with("4", "c.csv");
    let read = |name: &str| fs::read_to_string(dir.join(name)).unwrap();
    assert_eq!(read("a-1.csv"), read("b-1.csv"));
    assert_eq!(read("a-2.csv"), read("b-2.csv"));
    assert_ne!(read("a-1.csv"), read("a-2.csv"));
    assert_ne!(read("a-1.csv"), read("c-1.csv"));
    for (head, values) in columns(&dir.join("a-1.csv")) {
        let step = match head.as_str() {
            "t" => continue,
            h if h.starts_with("tau_") => 1e-3,
            _ => 1e-5,
        };
        for x in values {
            // the printed number is the double nearest to a multiple of the step
            assert!((x / step - (x / step).round()).abs() < 1e-6, "{head} {x}");
        }
    }
}

#[test]
fn exact_logs_contain_every_coordinate_with_its_rates() {
    let dir = scratch("simulate_exact");
    let spec = robot("3rps.yaml");
    let args = ["simulate", &spec, "--out", "log.csv", "--duration", "0.2"];
    regen(&dir, &[&args[..], &["--settle", "0.1", "--exact"]].concat()).ended(0);
    let columns = columns(&dir.join("log.csv"));
    assert_eq!(columns.len(), 1 + 3 * 9 + 3);
    let find = |head: &str| &columns.iter().find(|c| c.0 == head).unwrap().1;
    assert_eq!(find("t").len(), 21);
    assert!(find("t")[0].abs() < 1e-12);
    // central differences of positions are the velocities, up to T^2/6 times a jerk below 10 m/s^3
    let (q, qd) = (find("s1.2"), find("qd_s1.2"));
    for k in 1..20 {
        let rate = (q[k + 1] - q[k - 1]) / 0.02;
        assert!((rate - qd[k]).abs() < 2e-4, "{rate} {}", qd[k]);
    }
}

#[test]
fn a_simulation_that_fails_is_reported_and_writes_no_file() {
    let dir = scratch("simulate_wrong");
    let spec = robot("fivebar.yaml");
    let says = |args: &[&str], code: i32, text: &str| {
        let base = ["simulate", &spec, "--out", "log.csv"];
        let run = regen(&dir, &[&base[..], args].concat()).ended(code);
        assert!(run.err.contains(text), "{}", run.err);
        assert_eq!(fs::read_dir(&dir).unwrap().count(), 1, "{args:?}");
    };
    fs::write(dir.join("p.json"), "{\"m(9)\": 1}").unwrap();
    says(
        &["--parameters", "p.json"],
        3,
        "`m(9)`: this is not a parameter of fivebar",
    );
    says(&["--parameters", "none.json"], 5, "cannot read none.json");
    says(
        &["--pid", "q2=1,2,3"],
        3,
        "`q2` is not an actuated joint; these are q1, q3",
    );
    says(&["--pid", "1,2"], 2, "KP,KI,KD");
    says(&["--step", "0"], 3, "--step must be above 0");
    for sensors in [["--noise", "1e-5,0.1"], ["--quantum", "1e-6"]] {
        says(&[&["--exact"], &sensors[..]].concat(), 2, "without sensors");
    }
    says(&["--perturb", "1"], 3, "--perturb");
    fs::write(dir.join("p.json"), "{\"m(2)\": -9}").unwrap();
    says(&["--parameters", "p.json"], 4, "not positive definite");
    // a controller this slow does not stabilise it
    says(&["--pid", "0,0,0", "--duration", "9"], 4, "ended after");
}

#[test]
fn bodies_without_any_value_are_named_in_short() {
    let dir = scratch("simulate_bare");
    let text = fs::read_to_string(robot("fivebar.yaml")).unwrap();
    let given = |line: &&str| !line.starts_with("  2: {mass") && !line.starts_with("  4: {mass");
    let bare: Vec<&str> = text.lines().filter(given).collect();
    fs::write(dir.join("bare.yaml"), bare.join("\n")).unwrap();
    let run = regen(&dir, &["simulate", "bare.yaml", "--out", "log.csv"]).ended(3);
    assert!(
        run.err
            .contains("no nominal values of body 2, body 4; give"),
        "{}",
        run.err
    );
}

/// Controllers that do not follow the motion make a log of another one.
#[test]
fn a_motion_that_is_hardly_followed_gives_a_warning() {
    let dir = scratch("simulate_stray");
    let spec = robot("fivebar.yaml");
    let simulate = |bandwidth: &str| {
        let words = [
            "simulate",
            &spec,
            "--out",
            "log.csv",
            "--duration",
            "4",
            "--bandwidth",
            bandwidth,
        ];
        regen(&dir, &words).ended(0).err
    };
    let slow = simulate("1.5");
    assert!(
        slow.contains("is off the motion by up to") && slow.contains("leave --bandwidth"),
        "{slow}"
    );
    let fast = simulate("10");
    assert!(!fast.contains("off the motion"), "{fast}");
}

/// A joint that carries little beside one that carries much, as wrists do, and drives that reach their limits.
fn wrist(dir: &Path, effort: f64, frequency: f64) {
    let spec = "\
name: wrist
gravity: [0, 0, -9.81]
limbs:
  - name: arm
    base: {rpy: [pi/2, 0, 0]}
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true, limits: {effort: [-EFFORT, EFFORT]}}
      - {name: q2, type: revolute, dh: {a: 0.4}, body: 2, actuated: true}
bodies:
  1: {mass: 3.0, com: [0.2, 0, 0], inertia: [0.01, 0, 0, 0.05, 0, 0.05]}
  2: {mass: 0.2, com: [0.02, 0, 0], inertia: [1e-4, 0, 0, 1e-4, 0, 1e-4]}
";
    fs::write(
        dir.join("wrist.yaml"),
        spec.replace("EFFORT", &effort.to_string()),
    )
    .unwrap();
    let motion = format!(
        r#"{{"format": "regen-trajectory", "robot": "wrist", "coordinates": ["q1", "q2"], "harmonics": 2,
           "base_frequency": {frequency}, "offset": [0.1, 0.2], "cosine": [[0.5, 0.2], [0.3, -0.6]],
           "sine": [[-0.2, 0.3], [0.6, 0.1]]}}"#
    );
    fs::write(dir.join("t.json"), motion).unwrap();
}

#[test]
fn controllers_that_are_chosen_follow_the_motion_and_can_be_pinned() {
    let dir = scratch("simulate_follows");
    wrist(&dir, 100.0, 1.0);
    let simulate = |more: &str| {
        let line = format!(
            "simulate wrist.yaml --trajectory t.json --noise 1e-5,0.01 --format json {more}"
        );
        let words: Vec<&str> = line.split_whitespace().collect();
        regen(&dir, &words).ended(0).json()
    };
    let found = simulate("--out a.csv");
    let following = &found["following"];
    let of = |key: &str| following[key].as_f64().unwrap();
    assert!(of("off") < 0.05 && of("bandwidth") > 3.0, "{following}");
    assert_eq!(found["step"], following["step"]);
    // the slower ones that were tried do not follow it closely
    let others = following["others"].as_array().unwrap();
    let is_off =
        |trial: &serde_json::Value| !trial["ended"].is_null() || trial["off"].as_f64() > Some(0.05);
    assert!(
        !others.is_empty() && others.iter().all(is_off),
        "{following}"
    );
    let pinned = simulate(&format!(
        "--out b.csv --bandwidth {} --step {}",
        of("bandwidth"),
        of("step")
    ));
    assert!(pinned["following"].is_null());
    let read = |name: &str| fs::read_to_string(dir.join(name)).unwrap();
    assert_eq!(read("a.csv"), read("b.csv"));
    // a time between samples that is given stays
    let slow = simulate("--out c.csv --step 0.004");
    assert_eq!(slow["step"], 0.004);
    assert!(slow["following"]["off"].as_f64() < Some(0.2), "{slow}");
}

#[test]
fn a_motion_that_no_controllers_follow_is_an_error_and_writes_no_log() {
    let dir = scratch("simulate_beyond");
    wrist(&dir, 12.0, 2.0);
    let line = [
        "simulate",
        "wrist.yaml",
        "--trajectory",
        "t.json",
        "--out",
        "log.csv",
    ];
    let refused = regen(&dir, &line).ended(4);
    for words in [
        "no controllers follow the motion",
        "at its limit in up to",
        "--bandwidth HZ",
    ] {
        assert!(refused.err.contains(words), "{}", refused.err);
    }
    assert!(!dir.join("log.csv").exists());
    // what the robot then does can be asked for
    let asked = regen(&dir, &[&line[..], &["--bandwidth", "12"]].concat()).ended(0);
    assert!(
        asked.err.contains("is off the motion by up to"),
        "{}",
        asked.err
    );
    assert!(dir.join("log.csv").exists());
}
