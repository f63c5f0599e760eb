//! Coverage of the intervals for simulated logs without noise, where the only errors come from the
//! differentiation of positions.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use crate::common::{regen, root, scratch};
use serde_json::Value;

/// The parameters that `regen identify` prints.
fn parameters(dir: &Path, spec: &str, log: &str, options: &[&str]) -> Vec<Value> {
    let words = ["identify", spec, log, "--format", "json"];
    let json = regen(dir, &[&words[..], options].concat()).ended(0).json();
    json["parameters"].as_array().unwrap().clone()
}

/// Simulates a motion without noise, and compares each interval and each status with the true
/// value.
#[track_caller]
fn assert_intervals_contain_the_truth(
    robot: &str,
    motion: &str,
    simulated: &[&str],
    friction: &[(&str, f64)],
    readings: &[&[&str]],
) {
    let name = Path::new(robot).file_stem().unwrap().to_str().unwrap();
    let dir = scratch(&format!("intervals_{name}"));
    let spec = root().join(robot).display().to_string();
    fs::write(dir.join("motion.json"), motion).unwrap();
    let words = ["simulate", &spec, "--trajectory", "motion.json", "--out"];
    regen(&dir, &[&words[..], &["log.csv"], simulated].concat()).ended(0);
    regen(
        &dir,
        &[&words[..], &["exact.csv", "--exact"], simulated].concat(),
    )
    .ended(0);
    let exact = parameters(&dir, &spec, "exact.csv", &[]);
    let mut truth: BTreeMap<&str, f64> = exact
        .iter()
        .map(|p| (p["label"].as_str().unwrap(), p["value"].as_f64().unwrap()))
        .collect();
    // simulated friction changes its sign smoothly, which biases the result from the exact log
    // slightly, so the simulated coefficients are used
    truth.extend(friction.iter().copied());
    for options in readings {
        for found in parameters(&dir, &spec, "log.csv", options) {
            let truth = truth[found["label"].as_str().unwrap()];
            let (low, high) = (
                found["low"].as_f64().unwrap(),
                found["high"].as_f64().unwrap(),
            );
            assert!(
                low <= truth && truth <= high,
                "{options:?}, truly {truth}: {found}"
            );
            let status = found["status"].as_str().unwrap();
            assert!(
                status == "well" || status == "zero within its error",
                "{options:?}: {found}"
            );
        }
    }
}

#[test]
fn intervals_of_a_platform_contain_the_true_values_without_noise() {
    assert_intervals_contain_the_truth(
        "robots/3rps.yaml",
        r#"{"format": "regen-trajectory", "robot": "rps3", "coordinates": ["q2", "q7", "q9"],
            "base_frequency": 0.13333, "harmonics": 5, "offset": [0.5908, 0.5963, 0.5927],
            "cosine": [[-0.0201, -0.0212, -0.0066, 0.0113, -0.0352],
                       [-0.0653, 0.001, 0.0234, -0.0347, -0.0513],
                       [-0.0823, 0.0263, -0.0173, 0.007, -0.0487]],
            "sine": [[-0.0967, 0.0065, 0.0062, -0.0006, -0.06],
                     [-0.0446, 0.064, -0.0424, 0.0523, 0.0173],
                     [-0.0353, -0.0511, -0.0301, -0.0393, 0.0298]]}"#,
        &[],
        &[],
        &[&[], &["--butterworth", "4,20"]],
    );
}

#[test]
fn intervals_of_a_five_bar_with_friction_contain_the_true_values_without_noise() {
    assert_intervals_contain_the_truth(
        "runtime/guide/fivebar/fivebar.yaml",
        r#"{"format": "regen-trajectory", "robot": "picker", "coordinates": ["q1", "q3"],
            "base_frequency": 0.2, "harmonics": 5, "offset": [2.2022, 0.9745],
            "cosine": [[0.2654, -0.0032, 0.3107, -0.0139, -0.1297],
                       [0.239, 0.0008, 0.1711, -0.0416, 0.0511]],
            "sine": [[0.0564, -0.0014, 0.2261, -0.0155, -0.2252],
                     [-0.4922, -0.0158, 0.0011, 0.0098, 0.0114]]}"#,
        &"--settle 5 --duration 5 --bandwidth 20 --step 0.0025"
            .split(' ')
            .collect::<Vec<_>>(),
        &[
            ("Fv(q1)", 0.03),
            ("Fc(q1)", 0.05),
            ("Fv(q3)", 0.03),
            ("Fc(q3)", 0.05),
        ],
        &[&[]],
    );
}

/// Writes the spec of a pendulum with this friction law, and a log of it with an arctangent.
fn pendulum(dir: &Path, law: &str) {
    let spec = "\
name: pendulum
gravity: [0, 0, -9.81]
limbs:
  - name: arm
    joints:
      - {name: q1, type: revolute, dh: {alpha: pi/2}, body: a, actuated: true, friction: LAW}
bodies:
  a: {mass: 1, com: [0.3, 0, 0], inertia: [0, 0, 0, 0.02, 0, 0.02]}
";
    fs::write(dir.join("pendulum.yaml"), spec.replace("LAW", law)).unwrap();
    let mut log = "t,q1,tau_q1\n".to_owned();
    for k in 0..2000 {
        let t = 0.01 * f64::from(k);
        let (q, qd) = (
            t.sin() + 0.3 * (2.7 * t).cos(),
            t.cos() - 0.81 * (2.7 * t).sin(),
        );
        let qdd = -t.sin() - 2.187 * (2.7 * t).cos();
        let friction = 0.4 * (qd / 0.05).atan() + 0.3 * qd;
        let noise = 0.01 * (12.9898 * f64::from(k * k % 1009)).sin();
        let tau = 0.11 * qdd + 0.3 * 9.81 * q.cos() + friction + noise;
        writeln!(log, "{t:.2},{q},{tau}").unwrap();
    }
    fs::write(dir.join("log.csv"), log).unwrap();
}

/// The table beside nonlinear friction is that of least squares with linear friction.
#[test]
fn least_squares_beside_nonlinear_friction_has_the_deviations_of_plain_least_squares() {
    let dir = scratch("intervals_beside");
    let identify = |law: &str, options: &str| {
        pendulum(&dir, law);
        // weighed, as least squares alone leaves more equations beside rests out where noise is small
        let line = format!(
            "identify pendulum.yaml log.csv --butterworth 4,5 --decimate 2 --standstill weigh --format json {options}"
        );
        let words: Vec<&str> = line.split(' ').collect();
        regen(&dir, &words).ended(0).json()
    };
    let plain = identify("linear", "--no-suspicion");
    let beside = identify("atan", "--friction --draws 0");
    let rows = beside["least_squares"].as_array().unwrap();
    let find = |label: &Value| {
        let mut all = plain["parameters"].as_array().unwrap().iter();
        all.find(|row| row["label"] == *label).unwrap()
    };
    assert_eq!(rows.len(), 5, "{rows:?}");
    for row in rows {
        let own = find(&row["label"]);
        // plain least squares puts back into its residuals what few parameters took from them
        for (key, part) in [("value", 1e-6), ("sigma", 2e-2)] {
            let (found, expected) = (row[key].as_f64().unwrap(), own[key].as_f64().unwrap());
            assert!((found / expected - 1.0).abs() < part, "{key}: {row} {own}");
        }
        let white = own["sigma_white"].as_f64().unwrap();
        assert!((own["sigma"].as_f64().unwrap() / white - 1.0).abs() > 0.1);
    }
}

#[test]
fn intervals_of_nonlinear_friction_from_rows_far_apart_come_with_a_warning() {
    let dir = scratch("intervals_friction");
    pendulum(&dir, "atan");
    let warned = |options: &str| {
        let line = format!("identify pendulum.yaml log.csv --friction {options}");
        let words: Vec<&str> = line.split(' ').collect();
        let ended = regen(&dir, &words).ended(0);
        ended
            .err
            .contains("nonlinear friction (q1) are likely to be too small")
    };
    assert!(warned("--butterworth 4,20 --draws 6"));
    assert!(!warned("--butterworth 4,5 --draws 6"));
    // without intervals there is nothing to warn of
    assert!(!warned("--butterworth 4,20 --draws 0"));
}

/// A filter hides how a joint turns at its reversals, which no residual shows: the intervals are wider than
/// those of the noise.
#[test]
fn intervals_of_nonlinear_friction_contain_what_the_filter_hides() {
    let dir = scratch("intervals_reversals");
    let spec = "\
name: arm
gravity: [0, 0, -9.81]
limbs:
  - name: arm
    joints:
      - {name: q1, type: revolute, dh: {alpha: pi/2}, body: a, actuated: true, friction: stribeck,
         offset: true, nominal: {Fc: 2, Fs: 3, vs: 0.1, delta: 1.5, Fv: 1.5, Fo: 0.1}}
bodies:
  a: {mass: 4, com: [0.3, 0, 0], inertia: [0.02, 0, 0, 0.1, 0, 0.1]}
";
    fs::write(dir.join("arm.yaml"), spec).unwrap();
    let motion = r#"{"format": "regen-trajectory", "robot": "arm", "coordinates": ["q1"],
        "base_frequency": 0.2, "harmonics": 3, "offset": [0.3],
        "cosine": [[0.6, -0.3, 0.1]], "sine": [[0.2, 0.3, -0.1]]}"#;
    fs::write(dir.join("motion.json"), motion).unwrap();
    let line = "rehearse arm.yaml --trajectory motion.json --friction --noise 1e-5,0.05 --bandwidth 10 \
                --step 0.001 --duration 10 --butterworth 4,8 --seeds 2 --draws 40 --score 100";
    let words: Vec<&str> = line.split_whitespace().collect();
    regen(&dir, &words).ended(0);
}

#[test]
fn the_steps_of_a_reduction_have_the_errors_of_the_table_on_logs_not_used() {
    let folder = root().join("runtime/guide/fivebar");
    let words = "identify fivebar.yaml run1.csv --reduce --against run2.csv --format json";
    let words: Vec<&str> = words.split(' ').collect();
    let found = regen(&folder, &words).ended(0).json();
    let steps = found["reduction"].as_array().unwrap();
    let error = |step: &Value| step["relative_absolute"].as_f64().unwrap();
    let models = found["models"].as_array().unwrap();
    for (model, step) in models.iter().zip([&steps[0], &steps[steps.len() - 1]]) {
        let table = error(&model["logs"][1]);
        // joints rest in this log, one at a time: the rows of the others count
        assert!((error(step) / table - 1.0).abs() < 1e-9, "{model} {step}");
    }
    assert_eq!(models.len(), 2);
}
