//! The commands from a log to identified parameters and their validation, as a user runs them.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use crate::common::{Run, regen, regen_with, root, scratch};
use serde_json::{Value, json};

/// A cart on a rail with a pendulum: both coordinates are measured and have efforts.
const CART: &str = "\
name: cart
gravity: [0, 0, -9.81]
geometry: {l: 0.5}
limbs:
  - name: arm
    joints:
      - {name: x, type: prismatic, axis: x, body: cart, actuated: true, friction: linear}
      - {name: q, type: revolute, axis: y, body: rod, actuated: true}
home: {x: 0.1, q: 0.3}
";

/// A log of the cart, with forces from the base regressor of `regen eval`, a base frequency of 0.2
/// Hz and 3 harmonics.
fn log(dir: &Path, samples: u32, seed: f64) -> String {
    let states: Vec<Value> = (0..samples)
        .map(|k| {
            let (q, qd, qdd) = motion(f64::from(k) * 0.02, seed);
            json!({"independent": {"q": q, "qd": qd, "qdd": qdd}})
        })
        .collect();
    let input = serde_json::to_string(&states).unwrap();
    let found = regen_with(
        dir,
        &["eval", "cart.yaml", "--states", "-", "--format", "json"],
        &input,
    )
    .ended(0)
    .json();
    let mut text = "t,x,q,tau_x,tau_q\n".to_owned();
    for (k, state) in found.as_array().unwrap().iter().enumerate() {
        let time = f64::from(u32::try_from(k).unwrap()) * 0.02;
        let (q, _, _) = motion(time, seed);
        let _ = write!(text, "{time},{},{}", q[0], q[1]);
        for (r, row) in state["base_regressor"]
            .as_array()
            .unwrap()
            .iter()
            .enumerate()
        {
            let columns = row.as_array().unwrap().iter().enumerate();
            let force: f64 = columns.map(|(j, w)| w.as_f64().unwrap() * beta(j)).sum();
            // a little deterministic noise
            let noise = 1e-3 * ((k * 37 + r * 11 + 5) as f64 * seed).sin();
            let _ = write!(text, ",{}", force + noise);
        }
        text.push('\n');
    }
    text
}

fn beta(column: usize) -> f64 {
    1.0 + 0.5 * column as f64
}

fn motion(t: f64, seed: f64) -> ([f64; 2], [f64; 2], [f64; 2]) {
    let mut out = ([0.1, 0.3], [0.0; 2], [0.0; 2]);
    for j in 1..=3 {
        let w = std::f64::consts::TAU * 0.2 * f64::from(j);
        for i in 0..2 {
            let phase = seed * f64::from(j) + i as f64;
            let size = [0.1, 0.4][i] / f64::from(j);
            let (s, c) = (w * t + phase).sin_cos();
            out.0[i] += size * s;
            out.1[i] += size * w * c;
            out.2[i] -= size * w * w * s;
        }
    }
    out
}

const READING: [&str; 2] = ["--fourier", "0.2,3"];

fn run(dir: &Path, args: &[&str]) -> Run {
    let all: Vec<&str> = args.iter().copied().chain(READING).collect();
    regen(dir, &all)
}

/// Equations are decimated after the filter, but instruments are computed at every state before it.
#[test]
fn instruments_are_computed_for_decimated_equations() {
    let dir = scratch("thinned");
    let guide = root().join("runtime/guide/fivebar");
    for name in ["fivebar.yaml", "run1.csv"] {
        fs::copy(guide.join(name), dir.join(name)).unwrap();
    }
    let identify = |more: &[&str]| {
        let args = [
            "identify",
            "fivebar.yaml",
            "run1.csv",
            "--butterworth",
            "4,20",
        ];
        let rest = ["--iv", "--no-suspicion", "--format", "json"];
        regen(&dir, &[&args[..], &rest, more].concat())
            .ended(0)
            .json()
    };
    let (all, some) = (identify(&[]), identify(&["--decimate", "5"]));
    let equations = |found: &Value| found["equations"].as_f64().unwrap();
    assert!((equations(&all) / equations(&some) - 5.0).abs() < 0.1);
    let rows = |found: &Value| found["parameters"].as_array().unwrap().clone();
    for (a, b) in rows(&all).iter().zip(rows(&some)) {
        let off = a["value"].as_f64().unwrap() - b["value"].as_f64().unwrap();
        assert!(off.abs() < 3.0 * a["sigma"].as_f64().unwrap(), "{a} {b}");
    }
}

/// A log without motion gives no predictions if states at rest are left out: the message contains
/// the remedy.
#[test]
fn for_a_log_at_rest_the_message_says_why_nothing_is_predicted() {
    let dir = scratch("rest");
    // equations of a joint without friction are used at rest too, so this joint gets friction
    let with_friction = CART.replace(
        "body: rod, actuated: true",
        "body: rod, actuated: true, friction: linear",
    );
    fs::write(dir.join("cart.yaml"), with_friction).unwrap();
    fs::write(dir.join("a.csv"), log(&dir, 400, 1.3)).unwrap();
    let mut still = "t,x,q,tau_x,tau_q\n".to_owned();
    for k in 0..400 {
        let _ = writeln!(still, "{},0.1,0.3,0.01,-1.5", 0.02 * f64::from(k));
    }
    fs::write(dir.join("still.csv"), still).unwrap();
    run(&dir, &["identify", "cart.yaml", "a.csv", "--out", "p.json"]).ended(0);
    let validate = |more: &[&str]| {
        let args = ["validate", "cart.yaml", "p.json", "still.csv"];
        regen(&dir, &[&args[..], more].concat()).ended(0)
    };
    let dropped = validate(&[]);
    assert!(
        dropped.err.contains("still.csv: all 398 samples rest"),
        "{}",
        dropped.err
    );
    assert!(
        dropped.err.contains("--standstill keep predicts them"),
        "{}",
        dropped.err
    );
    let kept = validate(&["--standstill", "keep", "--format", "json"]);
    assert!(!kept.err.contains("rest"), "{}", kept.err);
    let rms = &kept.json()["models"][0]["logs"][0]["relative_rms"];
    assert!(rms.as_f64().unwrap() > 0.0, "{rms}");
    // for a log with motion there is no such message
    let moving = regen(&dir, &["validate", "cart.yaml", "p.json", "a.csv"]).ended(0);
    assert!(!moving.err.contains("rest"), "{}", moving.err);
}

#[test]
fn logs_become_parameters_that_predict_other_logs() {
    let dir = scratch("identify");
    fs::write(dir.join("cart.yaml"), CART).unwrap();
    for (name, seed) in [("a.csv", 1.3), ("b.csv", 2.1), ("c.csv", 0.7)] {
        fs::write(dir.join(name), log(&dir, 400, seed)).unwrap();
    }
    let found = run(
        &dir,
        &[
            "identify",
            "cart.yaml",
            "a.csv",
            "b.csv",
            "--cross",
            "--out",
            "p.json",
            "--format",
            "json",
        ],
    )
    .ended(0)
    .json();
    let parameters = found["parameters"].as_array().unwrap();
    for (j, row) in parameters.iter().enumerate() {
        let off = row["value"].as_f64().unwrap() - beta(j);
        assert!(off.abs() < 0.01, "{row}");
        assert_eq!(row["status"], "well", "{row}");
    }
    let unit = |label: &str| {
        let row = parameters.iter().find(|r| r["label"] == label).unwrap();
        row["unit"].as_str().unwrap().to_owned()
    };
    assert_eq!(
        (unit("Fv(x)").as_str(), unit("Fc(x)").as_str()),
        ("N s/m", "N")
    );
    // friction changes its sign with the velocity between samples, so rows near it are left out, and
    // those below a twentieth of the rms speed
    let taken = found["equations"].as_u64().unwrap();
    let left = found["left_out"]["resting"].as_array().unwrap();
    let left: u64 = left.iter().map(|n| n.as_u64().unwrap()).sum();
    assert_eq!(taken + left, 1600);
    assert!(left < 120, "{left}");
    for cross in found["cross"].as_array().unwrap() {
        assert!(cross["relative_absolute"].as_f64().unwrap() < 1.0);
    }

    // QR factors of the logs give the same values, in any order
    for name in ["a", "b"] {
        let (log, out) = (format!("{name}.csv"), format!("{name}.json"));
        run(&dir, &["observe", "cart.yaml", &log, "--out", &out]).ended(0);
    }
    let merged = |args: [&str; 2]| {
        let all = [
            "identify",
            "cart.yaml",
            "--format",
            "json",
            "--from",
            args[0],
            args[1],
        ];
        regen(&dir, &all).ended(0)
    };
    let one = merged(["a.json", "b.json"]);
    assert_eq!(one.out, merged(["b.json", "a.json"]).out);
    for (a, b) in one.json()["parameters"]
        .as_array()
        .unwrap()
        .iter()
        .zip(parameters)
    {
        let (a, b) = (a["value"].as_f64().unwrap(), b["value"].as_f64().unwrap());
        assert!((a / b - 1.0).abs() < 1e-12, "{a} {b}");
    }

    let text = run(&dir, &["validate", "cart.yaml", "p.json", "c.csv"])
        .ended(0)
        .out;
    assert!(
        text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );
    let checked = run(
        &dir,
        &[
            "validate",
            "cart.yaml",
            "p.json",
            "c.csv",
            "--format",
            "json",
        ],
    )
    .ended(0)
    .json();
    let error = checked["models"][0]["logs"][0]["relative_absolute"]
        .as_f64()
        .unwrap();
    assert!(error < 1.0, "{error}");
    let text = run(&dir, &["identify", "cart.yaml", "a.csv"]).ended(0).out;
    assert!(
        text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );
    assert!(text.contains("eps_RA") && text.contains("N s/m"), "{text}");
}

#[test]
fn mistakes_in_logs_and_factors_are_reported() {
    let dir = scratch("identify-errors");
    fs::write(dir.join("cart.yaml"), CART).unwrap();
    let good = log(&dir, 200, 1.3);
    fs::write(dir.join("a.csv"), &good).unwrap();

    let bad = good.replace("\n0.1,", "\n0.1,x");
    fs::write(dir.join("bad.csv"), bad).unwrap();
    let run_bad = run(&dir, &["identify", "cart.yaml", "bad.csv"]).ended(3);
    assert!(run_bad.err.contains("row 7: `x0."), "{}", run_bad.err);
    assert!(run_bad.err.contains("--problems drop"), "{}", run_bad.err);
    let dropped = run(
        &dir,
        &["identify", "cart.yaml", "bad.csv", "--problems", "drop"],
    )
    .ended(0);
    assert!(
        dropped
            .err
            .contains("warning: bad.csv: 1 row or gap was left out"),
        "{}",
        dropped.err
    );

    let missing = regen(&dir, &["identify", "cart.yaml", "none.csv"]).ended(5);
    assert!(
        missing.err.contains("cannot read none.csv"),
        "{}",
        missing.err
    );
    let column = [
        "identify",
        "cart.yaml",
        "a.csv",
        "--column",
        "tau_x=i1:A*0.1",
    ];
    let unknown = regen(&dir, &column).ended(3);
    assert!(
        unknown.err.contains("there is no column `i1`"),
        "{}",
        unknown.err
    );
    let unit = ["identify", "cart.yaml", "a.csv", "--column", "x=x:inch"];
    assert!(regen(&dir, &unit).ended(2).err.contains("the unit `inch`"));

    // at rest only gravity acts
    let mut still = "t,x,q,tau_x,tau_q\n".to_owned();
    for k in 0..50 {
        let _ = writeln!(still, "{},0.1,0.3,0,{}", f64::from(k) * 0.02, 1.0);
    }
    fs::write(dir.join("still.csv"), still).unwrap();
    let still = regen(&dir, &["identify", "cart.yaml", "still.csv"]).ended(4);
    assert!(still.err.contains("undetermined: "), "{}", still.err);

    // QR factors of another geometry
    run(&dir, &["observe", "cart.yaml", "a.csv", "--out", "a.json"]).ended(0);
    fs::write(dir.join("up.yaml"), CART.replace("-9.81", "-1.62")).unwrap();
    let mix = regen(&dir, &["identify", "up.yaml", "--from", "a.json"]).ended(3);
    assert!(mix.err.contains("digest"), "{}", mix.err);
    run(&dir, &["identify", "cart.yaml", "a.csv", "--out", "p.json"]).ended(0);
    let mix = run(&dir, &["validate", "up.yaml", "p.json", "a.csv"]).ended(3);
    assert!(mix.err.contains("digest"), "{}", mix.err);
    fs::write(dir.join("part.json"), "{\"Fv(x)\": 1}").unwrap();
    let part = run(&dir, &["validate", "cart.yaml", "part.json", "a.csv"]).ended(3);
    assert!(part.err.contains("values are missing for"), "{}", part.err);
}

/// A change of a file, and what is then said.
type Change = (fn(&mut Value), &'static str);

#[test]
fn parameters_and_factors_that_no_run_of_this_robot_wrote_are_refused_with_the_place() {
    let dir = scratch("identify-foreign");
    fs::write(dir.join("cart.yaml"), CART).unwrap();
    fs::write(dir.join("a.csv"), log(&dir, 200, 1.3)).unwrap();
    run(&dir, &["observe", "cart.yaml", "a.csv", "--out", "a.json"]).ended(0);
    run(&dir, &["identify", "cart.yaml", "a.csv", "--out", "p.json"]).ended(0);
    let read = |name: &str| -> Value {
        serde_json::from_str(&fs::read_to_string(dir.join(name)).unwrap()).unwrap()
    };
    // what is printed has all that a file has
    let printed = run(
        &dir,
        &["identify", "cart.yaml", "a.csv", "--format", "json"],
    )
    .ended(0)
    .out;
    fs::write(dir.join("printed.json"), printed).unwrap();
    run(&dir, &["validate", "cart.yaml", "printed.json", "a.csv"]).ended(0);
    let changes: [Change; 13] = [
        (
            |file| file["robot"] = "arm".into(),
            "robot: is `arm`, and the spec's robot is `cart`",
        ),
        (
            |file| file["version"] = 2.into(),
            "version: is 2, and this program reads 1",
        ),
        (
            |file| file["parametres"] = 2.into(),
            "parametres: files of parameters have no such key",
        ),
        (
            |file| file["parameters"][1] = file["parameters"][0].clone(),
            "parameters, row 2: `",
        ),
        (
            |file| file["parameters"][1]["label"] = "Fv(z)".into(),
            "parameters, row 2: `Fv(z)` is none of cart's",
        ),
        (
            |file| file["parameters"][0]["unit"] = "lb".into(),
            "parameters, row 1: the unit of `",
        ),
        (
            |file| file["model"] = "0".into(),
            "these are parameters of cart with the digest 0",
        ),
        (
            |file| file["parameters"][1]["valeu"] = 1.into(),
            "parameters, row 2, valeu: there is no such key",
        ),
        (
            |file| file["parameters"][1] = serde_json::json!({"label": "x"}),
            "parameters, row 2: the key `value` is missing",
        ),
        (
            |file| file["parameters"][0]["value"] = "1,5".into(),
            "parameters, row 1, value: a number is needed, and not \"1,5\"",
        ),
        (
            |file| file["parameters"][0]["sigma"] = "small".into(),
            "parameters, row 1, sigma: a number is needed",
        ),
        (
            |file| file["parameters"][0] = 3.into(),
            "parameters, row 1: a row with the keys label",
        ),
        (
            |file| {
                file["gains"] =
                    serde_json::json!([{"effort": "x", "value": 1, "unit": "N/A", "sgima": 1}]);
            },
            "gains, row 1, sgima: there is no such key",
        ),
    ];
    for (change, says) in changes {
        let mut file = read("p.json");
        change(&mut file);
        fs::write(dir.join("q.json"), file.to_string()).unwrap();
        for args in [
            &["validate", "cart.yaml", "q.json", "a.csv"][..],
            &["report", "cart.yaml", "q.json", "a.csv", "--out", "r"],
            &[
                "simulate",
                "cart.yaml",
                "--parameters",
                "q.json",
                "--duration",
                "1",
                "--out",
                "s.csv",
            ],
        ] {
            let refused = regen(&dir, args).ended(3);
            let named = refused.err.contains(says) && refused.err.contains("--> q.json:1:");
            assert!(named, "{args:?} {says}: {}", refused.err);
        }
    }
    // in YAML, a row is at its line
    let yaml = run(
        &dir,
        &["identify", "cart.yaml", "a.csv", "--out", "good.yaml"],
    );
    yaml.ended(0);
    let good = fs::read_to_string(dir.join("good.yaml")).unwrap();
    let second = good.match_indices("combination:").nth(1).unwrap().0;
    let line = good[..second].lines().count();
    let wrong =
        good[..second].to_owned() + &good[second..].replacen("combination", "combinaton", 1);
    fs::write(dir.join("q.yaml"), wrong).unwrap();
    let refused = regen(&dir, &["validate", "cart.yaml", "q.yaml", "a.csv"]).ended(3);
    let place = format!("--> q.yaml:{line}:");
    assert!(
        refused
            .err
            .contains("row 2, combinaton: there is no such key")
            && refused.err.contains(&place),
        "{place} {}",
        refused.err
    );
    for (text, says) in [
        (
            "{\"Fv(x)\": 1,\n\"Fv(x)\": 2}",
            "the key `Fv(x)` is given twice at line 2",
        ),
        ("{\"Fv(z)\": 1}", "`Fv(z)`: cart has no such parameter"),
    ] {
        fs::write(dir.join("q.json"), text).unwrap();
        let refused = regen(&dir, &["validate", "cart.yaml", "q.json", "a.csv"]).ended(3);
        assert!(refused.err.contains(says), "{}", refused.err);
    }
    let changes: [Change; 7] = [
        (
            |file| file["kind"] = "energy".into(),
            "`kind` is `energy` and has to be `forces` or `energy over 0.5 s`",
        ),
        (
            |file| file["kind"] = "energy over 0.5 s".into(),
            "`efforts` is `x, q` and has to be `energy`",
        ),
        (
            |file| file["efforts"][1] = "x".into(),
            "has the effort `x` twice",
        ),
        (
            |file| file["efforts"][1] = "z".into(),
            "`efforts` is `x, z` and has to be `x, q`",
        ),
        (
            |file| file["robot"] = "arm".into(),
            "`robot` is `arm` and has to be `cart`",
        ),
        (
            |file| file["factors"][0]["rows"] = 0.into(),
            "rows is 0, and the factor has entries",
        ),
        (
            |file| file["factors"][0]["r"][1] = 1.into(),
            "r: the entry 1, in row 1 and column 0, is below the diagonal and not zero",
        ),
    ];
    for (change, says) in changes {
        let mut file = read("a.json");
        change(&mut file);
        fs::write(dir.join("b.json"), file.to_string()).unwrap();
        let refused = regen(&dir, &["identify", "cart.yaml", "--from", "b.json"]).ended(3);
        let named = refused.err.contains("b.json: ") && refused.err.contains(says);
        assert!(named, "{says}: {}", refused.err);
    }
}

/// A five-bar with encoder noise of 0.1 mrad, differentiated twice at 200 Hz: the error of least
/// squares is more than five standard deviations, that of `--iv` is less, with measured and with
/// simulated instruments.
#[test]
fn instrumental_variables_are_not_biased_by_noise_of_positions() {
    let dir = scratch("identify-iv");
    let spec = root().join("robots/fivebar.yaml").display().to_string();
    let motion = r#"{"format":"regen-trajectory","robot":"fivebar","coordinates":["q1","q3"],
        "base_frequency":0.5,"harmonics":2,"offset":[2.0,1.1],
        "cosine":[[0.1,0.05],[0.05,-0.08]],"sine":[[0.15,0.05],[-0.12,0.06]]}"#;
    fs::write(dir.join("t.json"), motion).unwrap();
    let simulate = ["simulate", &spec, "--trajectory", "t.json", "--out"];
    let noisy = ["--step", "0.005", "--noise", "1e-4,0.02", "--duration", "6"];
    regen(&dir, &[&simulate[..], &["log.csv"], &noisy].concat()).ended(0);
    regen(&dir, &[&simulate[..], &["exact.csv", "--exact"]].concat()).ended(0);
    let fit = |more: &[&str]| {
        let all = [&["identify", &spec, "--format", "json"], more].concat();
        regen(&dir, &all).ended(0).json()
    };
    let exact = fit(&["exact.csv"]);
    let truth: Vec<f64> = exact["parameters"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| p["value"].as_f64().unwrap())
        .collect();
    let worst = |rows: &Value| {
        let rows = rows.as_array().unwrap().iter().zip(&truth);
        let off = rows.map(|(p, truth)| {
            (p["value"].as_f64().unwrap() - truth).abs() / p["sigma"].as_f64().unwrap()
        });
        off.fold(0.0, f64::max)
    };
    for more in [&[][..], &["--reference", "t.json"]] {
        let found = fit(&[&["log.csv", "--iv"], more].concat());
        assert_eq!(found["method"], "instrumental variables");
        let (least, ours) = (worst(&found["least_squares"]), worst(&found["parameters"]));
        // the largest of eleven errors is beyond 3.5 standard deviations in one of 200 logs
        assert!(ours < 3.5, "{more:?}: {ours}");
        // behind the filter that is chosen, noise does not bias least squares either
        assert!(least < 3.5, "{more:?}: {least}");
        let instruments = &found["instruments"];
        assert!(
            instruments["probability"].as_f64().unwrap() > 1e-3,
            "{instruments}"
        );
    }
    for refused in [
        "--huber=1.3",
        "--cross",
        "--energy=0.1",
        "--reduce",
        "--feasible",
    ] {
        regen(&dir, &["identify", &spec, "log.csv", "--iv", refused]).ended(2);
    }
    regen(
        &dir,
        &["identify", &spec, "log.csv", "--reference", "t.json"],
    )
    .ended(2);
}

#[test]
fn columns_of_a_log_that_are_not_used_are_named_once() {
    let dir = scratch("identify_unused");
    fs::write(dir.join("cart.yaml"), CART).unwrap();
    let plain = log(&dir, 300, 1.0);
    fs::write(dir.join("plain.csv"), &plain).unwrap();
    let more = |line: (usize, &str)| match line {
        (0, names) => format!("{names},index,header.stamp,cmd_x,qd_q,heat,force_z\n"),
        (k, row) => format!("{row},{k},{k},0.1,0.2,{},0.3\n", 20 + k % 3),
    };
    let wide: String = plain.lines().enumerate().map(more).collect();
    for name in ["a.csv", "b.csv"] {
        fs::write(dir.join(name), &wide).unwrap();
    }
    let said = |args: &[&str]| regen(&dir, args).ended(0).err;
    let note = "note: 2 columns of a.csv and 1 other log are not used: `heat`, `force_z`; `regen inspect` says what they \
                look like";
    let both = [
        "identify",
        "cart.yaml",
        "a.csv",
        "b.csv",
        "--butterworth",
        "4,5",
    ];
    let told = said(
        &[
            &both[..],
            &["--velocities", "computed", "--out", "params.json"],
        ]
        .concat(),
    );
    assert_eq!(told.matches("not used").count(), 1, "{told}");
    assert!(told.contains(note), "{told}");
    let told = said(&["validate", "cart.yaml", "params.json", "a.csv", "b.csv"]);
    assert!(told.contains(note), "{told}");
    let args = [
        "identify",
        "cart.yaml",
        "a.csv",
        "--butterworth",
        "4,5",
        "--format",
        "json",
    ];
    let found = regen(&dir, &args).ended(0).json();
    assert_eq!(found["files"][0]["unused"], json!(["heat", "force_z"]));
    let args = [
        "validate",
        "cart.yaml",
        "params.json",
        "a.csv",
        "--format",
        "json",
    ];
    let found = regen(&dir, &args).ended(0).json();
    assert_eq!(
        found["unused"][0],
        json!({"file": "a.csv", "columns": ["heat", "force_z"]})
    );
    // nothing is said where there are none, or where columns are chosen
    for more in [&["plain.csv"][..], &["a.csv", "--column", "tau_x=tau_x"]] {
        let told = said(&[&["identify", "cart.yaml", "--butterworth", "4,5"], more].concat());
        assert!(!told.contains("not used"), "{told}");
    }
}
