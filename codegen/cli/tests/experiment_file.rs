//! Experiment files in place of logs and options.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;
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

/// An arm of one joint about a horizontal axis with a sensor of two forces and a moment, which carries a
/// tool; nothing is known of the arm's drive.
const SENSOR: &str = "\
name: sensor
limbs:
  - name: arm
    base: {rpy: [pi/2, 0, 0]}
    joints:
      - {name: j1, type: revolute, body: 1, actuated: true}
      - {name: fx, type: prismatic, axis: x, origin: {xyz: [0.4, 0, 0]}, actuated: true, offset: true}
      - {name: fy, type: prismatic, axis: y, actuated: true, offset: true}
      - {name: tz, type: revolute, axis: z, body: tool, actuated: true, offset: true}
";

/// A log of that arm as a force and torque sensor writes it: the angle in degrees, and the three values with
/// their offsets. The tool has 1.5 kg at (0.1, -0.05) m, and 0.01 kg m^2 about its centre of mass.
fn wrenches() -> String {
    let mut text = "t,angle,Fx,Fy,Mz\n".to_owned();
    let (mass, [x, y], inertia) = (1.5, [0.1, -0.05], 0.01);
    for k in 0..800 {
        let t = 0.01 * f64::from(k);
        let terms = [(0.6, 1.3, 0.0), (0.4, 2.9, 1.0)].map(|(a, w, p): (f64, f64, f64)| {
            let angle = w * t + p;
            [
                a * angle.sin(),
                a * w * angle.cos(),
                -a * w * w * angle.sin(),
            ]
        });
        let [q, v, a] = [0, 1, 2].map(|part| terms[0][part] + terms[1][part]);
        let noise = |seed: f64| 1e-3 * (seed * f64::from(k * k % 997)).sin();
        let force = [
            mass * (-v * v * (0.4 + x) - a * y + 9.81 * q.sin()),
            mass * (a * (0.4 + x) - v * v * y + 9.81 * q.cos()),
        ];
        let moment = inertia * a + x * force[1] - y * force[0];
        let _ = writeln!(
            text,
            "{t},{},{},{},{}",
            q.to_degrees(),
            force[0] + 1.3 + noise(1.1),
            force[1] - 2.1 + noise(2.3),
            moment + 0.05 + 0.1 * noise(3.7)
        );
    }
    text
}

/// The values of the parameters that a run found, by their labels.
fn labelled(json: &Value) -> Vec<(String, f64)> {
    let rows = json["parameters"].as_array().unwrap().iter();
    let row = |r: &Value| {
        (
            r["label"].as_str().unwrap().to_owned(),
            r["value"].as_f64().unwrap(),
        )
    };
    rows.map(row).collect()
}

#[test]
fn a_tool_behind_a_force_and_torque_sensor_is_identified_without_the_efforts_of_the_arm() {
    let dir = scratch("sensor");
    fs::write(dir.join("sensor.yaml"), SENSOR).unwrap();
    fs::write(dir.join("log.csv"), wrenches()).unwrap();
    let runs = "\
columns:
  j1: {column: angle, unit: deg}
  f*: {constant: [0, 0]}
  tz: {constant: 0, unit: deg}
  tau_j*: unmeasured
  tau_fx: Fx
  tau_fy: Fy
  tau_tz: Mz
runs: [{files: [log.csv]}]
";
    fs::write(dir.join("runs.yaml"), runs).unwrap();
    let filter = ["--butterworth", "4,10"];
    let read = [&["identify", "sensor.yaml", "runs.yaml"][..], &filter].concat();
    let run = regen(&dir, &[&read[..], &["--format", "json"]].concat()).ended(0);
    let found = labelled(&run.json());
    let truth = [
        ("mx(tool)", 0.15),
        ("my(tool)", -0.075),
        ("Izz(tool)", 0.01 + 1.5 * (0.1 * 0.1 + 0.05 * 0.05)),
        ("m(tool)", 1.5),
        ("Fo(fx)", 1.3),
        ("Fo(fy)", -2.1),
        ("Fo(tz)", 0.05),
    ];
    assert_eq!(found.len(), truth.len(), "{found:?}");
    for (label, value) in truth {
        let (_, own) = found.iter().find(|row| row.0 == label).unwrap();
        assert!((own - value).abs() < 1e-3, "{label}: {own} and not {value}");
    }
    // what is left out is told, and nothing else is wrong
    let left_out = "left out: Izz(1), mx(1), my(1)";
    assert!(run.err.contains(left_out), "{}", run.err);
    assert!(!run.err.contains("warning"), "{}", run.err);
    assert_eq!(run.json()["unmeasured"], serde_json::json!(["j1"]));
    let text = regen(&dir, &read).ended(0).out;
    assert!(text.contains("the equations of j1 are left out"), "{text}");
    assert!(!text.contains("NaN"), "{text}");

    // the options say the same, and so does a spec that leaves them out
    let columns = [
        "j1=angle:deg",
        "fx=constant:0",
        "fy=constant:0",
        "tz=constant:0:deg",
        "tau_j1=unmeasured",
        "tau_fx=Fx",
        "tau_fy=Fy",
        "tau_tz=Mz",
    ];
    let mut args = vec!["identify", "sensor.yaml", "log.csv", "--format", "json"];
    args.extend(filter);
    args.extend(columns.iter().flat_map(|own| ["--column", own]));
    assert_eq!(labelled(&regen(&dir, &args).ended(0).json()), found);
    let dropped = "base: {drop: [\"Izz(1)\", \"mx(1)\", \"my(1)\"]}";
    fs::write(dir.join("dropped.yaml"), format!("{SENSOR}{dropped}\n")).unwrap();
    args[1] = "dropped.yaml";
    let again = regen(&dir, &args).ended(0);
    assert_eq!((labelled(&again.json()), again.err.as_str()), (found, ""));
    // predictions leave them out by themselves
    regen(&dir, &[&read[..], &["--out", "p.json"]].concat()).ended(0);
    let words = ["validate", "sensor.yaml", "p.json", "runs.yaml"];
    let predicted = regen(&dir, &words).ended(0);
    let told = "p.json lacks Izz(1), mx(1), my(1)";
    assert!(predicted.err.contains(told), "{}", predicted.err);
    // other estimators leave the same out
    for more in [
        &["--iv"][..],
        &["--huber", "1.345"],
        &["--delay", "auto"],
        &["--feasible"],
    ] {
        regen(&dir, &[&read[..], more].concat()).ended(0);
    }
}

#[test]
fn constants_and_unmeasured_efforts_are_refused_where_they_mean_nothing() {
    let dir = scratch("no_columns");
    fs::write(dir.join("sensor.yaml"), SENSOR).unwrap();
    fs::write(dir.join("log.csv"), wrenches()).unwrap();
    for (columns, says) in [
        ("qd_fx: {constant: 0}", "only a position can be constant"),
        ("tau_fx: {constant: 0}", "is `unmeasured`"),
        ("fx: unmeasured", "only an effort can be `unmeasured`"),
        ("fx: {constant: 0, factor: 2}", "a constant has no 'factor'"),
        ("fx: {constant: 0, unit: N}", "not measured in N"),
        ("fx: {unit: m}", "lacks the key 'column'"),
        ("f*: {constant: [0, 0, 0]}", "3 values for 2 coordinates"),
    ] {
        let text = format!("columns:\n  {columns}\nruns: [{{files: [log.csv]}}]\n");
        fs::write(dir.join("runs.yaml"), text).unwrap();
        let run = regen(&dir, &["identify", "sensor.yaml", "runs.yaml"]).ended(3);
        assert!(run.err.contains(says), "{columns}: {}", run.err);
        assert!(run.err.contains("runs.yaml:2"), "{columns}: {}", run.err);
    }
    let all = [
        "fx=constant:0",
        "fy=constant:0",
        "tz=constant:0",
        "j1=angle:deg",
    ];
    let mut args = vec!["identify", "sensor.yaml", "log.csv"];
    args.extend(all.iter().flat_map(|own| ["--column", own]));
    let args_of_all = args.len();
    // an effort without a column is told how it is left out
    let run = regen(&dir, &args).ended(3);
    assert!(run.err.contains("tau_j1=unmeasured"), "{}", run.err);
    let none = ["tau_j1", "tau_fx", "tau_fy", "tau_tz"].map(|name| format!("{name}=unmeasured"));
    args.extend(none.iter().flat_map(|own| ["--column", own.as_str()]));
    let run = regen(&dir, &args).ended(3);
    assert!(
        run.err.contains("every equation contains an effort"),
        "{}",
        run.err
    );
    let mut args: Vec<&str> = args.into_iter().take(args_of_all).collect();
    let measured = ["tau_j1=unmeasured", "tau_fx=Fx", "tau_fy=Fy", "tau_tz=Mz"];
    args.extend(measured.iter().flat_map(|own| ["--column", own]));
    args.extend(["--energy", "0.5"]);
    let run = regen(&dir, &args).ended(3);
    assert!(
        run.err.contains("needs the power of every effort"),
        "{}",
        run.err
    );
}

/// Two links in a vertical plane with friction, and poses of them in which one joint moves at a time, so that
/// positions and efforts repeat and jump.
fn poses(dir: &Path) {
    let spec = "\
name: arm
limbs:
  - name: arm
    base: {rpy: [pi/2, 0, 0]}
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true, friction: linear}
      - {name: q2, type: revolute, dh: {a: 0.4}, body: 2, actuated: true, friction: linear}
";
    fs::write(dir.join("arm.yaml"), spec).unwrap();
    let mut text = "pose,q1,q2,tau_q1,tau_q2\n".to_owned();
    for k in 0..40 {
        let at = |n: i32| 2.5 * (7.7 * f64::from(n)).sin();
        let (q1, q2) = (at(k / 4), at(100 + k));
        let noise = |seed: f64| 0.01 * (seed * f64::from(k)).sin();
        // the first moments of the second link about its joint, and of both about the first
        let second = 9.81 * (0.3 * (q1 + q2).cos() - 0.02 * (q1 + q2).sin());
        let first = 9.81 * (1.1 * q1.cos() - 0.05 * q1.sin()) + second;
        let (first, second) = (first + noise(91.7), second + noise(57.3));
        let _ = writeln!(text, "{k},{q1},{q2},{first},{second}");
    }
    fs::write(dir.join("poses.csv"), text).unwrap();
}

#[test]
fn gravity_is_identified_from_poses_at_rest_by_an_option_or_a_key() {
    let dir = scratch("poses");
    poses(&dir);
    let json = ["--format", "json"];
    let option = ["identify", "arm.yaml", "poses.csv", "--poses"];
    let run = regen(&dir, &[&option[..], &json].concat()).ended(0);
    let found = labelled(&run.json());
    let truth = [
        ("mx(1)", 1.1),
        ("my(1)", 0.05),
        ("mx(2)", 0.3),
        ("my(2)", 0.02),
    ];
    assert_eq!(found.len(), truth.len(), "{found:?}");
    for (label, value) in truth {
        let (_, own) = found.iter().find(|row| row.0 == label).unwrap();
        assert!((own - value).abs() < 2e-3, "{label}: {own} and not {value}");
    }
    // neither a clock, nor a joint without motion, nor repeated rows are doubted
    assert!(!run.err.contains("warning"), "{}", run.err);
    assert!(
        run.err.contains("left out: ") && run.err.contains("Fc(q2)"),
        "{}",
        run.err
    );
    let runs = "process: {motion: poses}\nruns: [{files: [poses.csv]}]\n";
    fs::write(dir.join("runs.yaml"), runs).unwrap();
    let by_key = ["identify", "arm.yaml", "runs.yaml"];
    let by_key = regen(&dir, &[&by_key[..], &json].concat()).ended(0);
    assert_eq!(labelled(&by_key.json()), found);

    // what was left out is left out of predictions too
    regen(&dir, &[&option[..], &["--out", "p.json"]].concat()).ended(0);
    let words = ["validate", "arm.yaml", "p.json", "poses.csv", "--poses"];
    let run = regen(&dir, &[&words[..], &json].concat()).ended(0);
    assert!(run.err.contains("p.json lacks Izz(1), "), "{}", run.err);
    let error = &run.json()["models"][0]["logs"][0]["relative_absolute"];
    assert!(error.as_f64().unwrap() < 1.0, "{error}");

    // poses have no frequencies: the noise is what their equations leave
    let words = ["inspect", "poses.csv", "--poses", "--spec", "arm.yaml"];
    let run = regen(&dir, &[&words[..], &json].concat()).ended(0);
    let json_of = run.json();
    let noise = json_of["prediction"]["noise"].as_array().unwrap();
    assert_eq!(noise.len(), 2, "{noise:?}");
    for own in noise {
        let sigma = own["sigma"].as_f64().unwrap();
        assert!((0.003..0.02).contains(&sigma), "{own}");
    }

    // without either the option is proposed, and what needs motion refuses it
    let run = regen(&dir, &option[..3]).ended(3);
    assert!(run.err.contains("need none with `--poses`"), "{}", run.err);
    let run = regen(&dir, &[&option[..], &["--feasible"]].concat()).ended(3);
    assert!(
        run.err.contains("physical parameters need inertias"),
        "{}",
        run.err
    );
    let run = regen(&dir, &[&option[..], &["--energy", "1"]].concat()).ended(2);
    assert!(run.err.contains("cannot be used with"), "{}", run.err);
    // poses that are read as a motion are told, and no sign, unit or rate is made of what their differences say
    let mut text = "pose,q1,q2,tau_q1,tau_q2\n".to_owned();
    for k in 0..60 {
        let random = |seed: i32| (43758.5453 * (12.9898 * f64::from(seed)).sin()).fract();
        let (q1, q2) = (2.0 * random(k), 2.0 * random(k + 100));
        let second = 9.81 * 0.3 * (q1 + q2).cos();
        let first = 9.81 * 1.1 * q1.cos() + second;
        let _ = writeln!(text, "{k},{q1},{q2},{first},{second}");
    }
    fs::write(dir.join("jumps.csv"), text).unwrap();
    let run = regen(&dir, &["identify", "arm.yaml", "jumps.csv", "--rate", "1"]);
    assert_ne!(run.code, 0, "{}", run.out);
    assert!(
        run.err
            .contains("as separate poses do, which are read with --poses"),
        "{}",
        run.err
    );
    assert!(
        !run.err.contains("ead it with") && !run.err.contains("looks"),
        "{}",
        run.err
    );
    let text =
        "process: {motion: poses, filter: none, delay: auto}\nruns: [{files: [poses.csv]}]\n";
    fs::write(dir.join("runs.yaml"), text).unwrap();
    let run = regen(&dir, &["identify", "arm.yaml", "runs.yaml"]).ended(3);
    for key in ["'filter' is for motion", "'delay' is for motion"] {
        assert!(run.err.contains(key), "{key}: {}", run.err);
    }
}
