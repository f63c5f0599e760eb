//! `regen inspect`: what logs contain, before anything is fitted.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::sync::Arc;

use crate::common::{regen, root, scratch};
use parquet::data_type::DoubleType;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use serde_json::Value;

/// The path of a file of the guide's five-bar.
fn guide(name: &str) -> String {
    let path = root().join("runtime/guide/fivebar").join(name);
    path.display().to_string()
}

/// The log of the guide without its header, the efforts of both joints exchanged and one reversed.
fn changed(text: &str) -> String {
    let rows = text.lines().skip(1).map(|line| {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        let [t, q1, q3, tau1, tau3] = cells[..] else {
            panic!("{line}")
        };
        format!("{t},{q1},{q3},{},{tau1}\n", -tau3)
    });
    rows.collect()
}

#[test]
fn the_spec_may_be_given_before_the_logs() {
    let dir = scratch("inspect_spec_first");
    let run = |args: &[&str]| regen(&dir, args).ended(0).out;
    let (spec, log) = (guide("fivebar.yaml"), guide("run1.csv"));
    let named = run(&["inspect", &log, "--spec", &spec]);
    assert_eq!(run(&["inspect", &spec, &log]), named);
    assert!(named.contains("can identify of"), "{named}");
}

#[test]
fn angles_that_look_in_degrees_are_proposed_in_degrees() {
    let dir = scratch("inspect_degrees");
    let log = fs::read_to_string(guide("run1.csv")).unwrap();
    let mut rows = vec!["t,pos_a,pos_b,tau_q1,tau_q3".to_owned()];
    rows.extend(log.lines().skip(1).map(|line| {
        let mut cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        cells[1..3].iter_mut().for_each(|q| *q = q.to_degrees());
        let cells: Vec<String> = cells.iter().map(f64::to_string).collect();
        cells.join(",")
    }));
    fs::write(dir.join("log.csv"), rows.join("\n")).unwrap();
    let spec = guide("fivebar.yaml");
    let args = ["inspect", "log.csv", "--spec", &spec, "--out", "runs.yaml"];
    let printed = regen(&dir, &args).ended(0).out;
    assert!(
        printed.contains("look to be in: `pos_a`, `pos_b`"),
        "{printed}"
    );
    let proposed = fs::read_to_string(dir.join("runs.yaml")).unwrap();
    assert_eq!(proposed.matches("unit: deg").count(), 2, "{proposed}");
    let args = ["identify", &spec, "runs.yaml", "--format", "json"];
    let found = regen(&dir, &args).ended(0).json();
    assert!(
        found["relative_absolute"].as_f64().unwrap() < 1.0,
        "{found}"
    );
}

#[test]
fn a_first_experiment_file_is_proposed_that_identify_accepts() {
    let dir = scratch("inspect_proposal");
    let run = |args: &[&str]| regen(&dir, args).ended(0);
    let spec = guide("fivebar.yaml");
    let (log, json) = (guide("run1.csv"), ["--format", "json"]);
    let args = [
        "inspect",
        &log,
        "--spec",
        &spec,
        "--out",
        "runs.yaml",
        "--report",
        "page.html",
    ];
    let found = run(&[&args[..], &json].concat()).json();
    assert_eq!(found["version"], 2);
    let joints = found["logs"][0]["joints"].as_array().unwrap();
    assert_eq!(joints.len(), 2);
    assert_eq!(
        (
            &joints[1]["name"],
            &joints[1]["position"],
            &joints[1]["effort"]
        ),
        (&Value::from("q3"), &Value::from(3), &Value::from(5))
    );
    let written = fs::read_to_string(dir.join("runs.yaml")).unwrap();
    assert_eq!(found["proposal"].as_str().unwrap(), written);
    let page = fs::read_to_string(dir.join("page.html")).unwrap();
    assert!(page.contains("What these logs can identify") && page.contains("<svg"));
    let fit = run(&[&["identify", &spec, "runs.yaml"], &json[..]].concat()).json();
    assert!(fit["parameters"].as_array().unwrap().len() > 5);
    // the experiment file can be inspected in place of its log, here without the spec
    let again = run(&["inspect", "runs.yaml", "--format", "json"]).json();
    assert_eq!(again["logs"][0]["joints"], found["logs"][0]["joints"]);
    assert_eq!(again["prediction"], Value::Null);
    // an existing experiment file is not overwritten
    let second = regen(&dir, &args).ended(5);
    assert!(
        second.err.contains("runs.yaml") && second.err.contains("--out"),
        "{}",
        second.err
    );
}

#[test]
fn predicted_deviations_are_those_of_the_fit() {
    let dir = scratch("inspect_prediction");
    let run = |args: &[&str]| regen(&dir, args).ended(0).json();
    let (spec, log) = (guide("fivebar.yaml"), guide("run1.csv"));
    let shared = ["--butterworth", "4,20", "--format", "json"];
    let found = run(&[&["inspect", &log, "--spec", &spec], &shared[..]].concat());
    let fit = run(&[&["identify", &spec, &log], &shared[..]].concat());
    let predicted = found["prediction"]["parameters"].as_array().unwrap();
    let fitted = fit["parameters"].as_array().unwrap();
    assert_eq!(predicted.len(), fitted.len());
    let ratios = predicted.iter().zip(fitted).map(|(a, b)| {
        assert_eq!(a["label"], b["label"]);
        b["sigma"].as_f64().unwrap() / a["sigma"].as_f64().unwrap()
    });
    let ratios: Vec<f64> = ratios.collect();
    // the prediction takes the noise from high frequencies, where steps of friction add a little;
    // the fit takes it and its correlation from residuals of some periods
    assert!(ratios.iter().all(|r| (0.5..1.5).contains(r)), "{ratios:?}");
}

/// The log of the guide, its efforts some rows behind.
fn late(text: &str, rows: usize) -> String {
    let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    let mut out = lines[0].join(",") + "\n";
    for (now, before) in lines[1 + rows..].iter().zip(&lines[1..]) {
        out.push_str(&[&now[..3], &before[3..]].concat().join(","));
        out.push('\n');
    }
    out
}

#[test]
fn efforts_that_are_logged_late_are_told_by_the_equations_of_the_robot() {
    let dir = scratch("inspect_late");
    let text = fs::read_to_string(guide("run1.csv")).unwrap();
    let time = |row: usize| -> f64 {
        let line = text.lines().nth(row).unwrap();
        line.split(',').next().unwrap().parse().unwrap()
    };
    let step = time(2) - time(1);
    for rows in [0, 3] {
        fs::write(dir.join("late.csv"), late(&text, rows)).unwrap();
        let spec = guide("fivebar.yaml");
        let found = regen(&dir, &["inspect", &spec, "late.csv", "--format", "json"]);
        let found = found.ended(0).json();
        let efforts = found["logs"][0]["efforts"].as_array().unwrap();
        assert_eq!(efforts.len(), 2);
        for effort in efforts {
            let [seconds, sigma] = [0, 1].map(|k| effort["delay"][k].as_f64().unwrap());
            let expected = rows as f64 * step;
            assert!((seconds - expected).abs() < 4.0 * sigma, "{rows}: {effort}");
        }
        let proposed = found["proposal"].as_str().unwrap();
        assert_eq!(proposed.contains("delay: auto"), rows > 0, "{proposed}");
        let notes = found["logs"][0]["notes"].to_string();
        assert_eq!(notes.contains("behind the motion"), rows > 0, "{notes}");
    }
}

#[test]
fn exchanged_and_reversed_efforts_of_a_log_without_header_are_reported() {
    let dir = scratch("inspect_exchanged");
    let text = fs::read_to_string(guide("run1.csv")).unwrap();
    fs::write(dir.join("raw.csv"), changed(&text)).unwrap();
    let run = regen(&dir, &["inspect", "raw.csv"]).ended(0);
    for note in [
        "column 4 is taken for the effort of q1 and follows the motion of q2",
        "column 4 has the opposite sign of the motion of q2",
        "column 5 is taken for the effort of q2 and follows the motion of q1",
    ] {
        let printed = run.out.replace("\n    ", " ");
        assert!(printed.contains(note), "{note}\n{}", run.out);
    }
    assert!(
        !run.out.contains("column 5 has the opposite"),
        "{}",
        run.out
    );
}

#[test]
fn with_the_spec_a_reversed_effort_is_reported_with_its_remedy() {
    let dir = scratch("inspect_doubts");
    let text = fs::read_to_string(guide("run1.csv")).unwrap();
    let flipped = |line: &str| {
        let (before, last) = line.rsplit_once(',').unwrap();
        let flipped = last.parse::<f64>().map(|x| (-x).to_string());
        format!("{before},{}", flipped.unwrap_or_else(|_| last.to_owned()))
    };
    let rows: Vec<String> = text.lines().map(flipped).collect();
    fs::write(dir.join("flipped.csv"), rows.join("\n") + "\n").unwrap();
    let spec = guide("fivebar.yaml");
    let run = |log: &str| {
        let args = ["inspect", log, "--spec", &spec, "--format", "json"];
        regen(&dir, &args).ended(0).json()
    };
    let doubts = run("flipped.csv")["doubts"].clone();
    let remedy = doubts[0]["remedy"].as_str().unwrap();
    assert!(remedy.contains("tau_q3=tau_q3*-1"), "{doubts}");
    assert_eq!(
        run(&guide("run1.csv"))["doubts"],
        Value::from(Vec::<Value>::new())
    );
}

#[test]
fn files_that_are_no_logs_are_refused_with_their_place() {
    let dir = scratch("inspect_wrong");
    fs::write(dir.join("short.csv"), "t,q1\n0,1\n0.1,x\n").unwrap();
    fs::write(
        dir.join("runs.yaml"),
        "runs:\n  - {files: a.csv, rows: 3}\n",
    )
    .unwrap();
    fs::write(dir.join("empty.csv"), "").unwrap();
    for (args, code, words) in [
        (
            &["inspect", "short.csv"][..],
            3,
            &["short.csv", "64", "row 3", "`x` in column `q1`"][..],
        ),
        (&["inspect", "runs.yaml"], 3, &["runs.yaml:2", "`rows`"]),
        (&["inspect", "none.csv"], 5, &["none.csv"]),
        (&["inspect", "empty.csv"], 3, &["empty.csv", "empty"]),
        (&["inspect"], 2, &["LOG"]),
    ] {
        let run = regen(&dir, args).ended(code);
        for word in words {
            assert!(run.err.contains(word), "{args:?}: {word}\n{}", run.err);
        }
    }
}

/// Writes the log of a CSV text as Parquet, in groups of rows.
fn as_parquet(text: &str, path: &std::path::Path) {
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<f64>> = lines
        .map(|line| line.split(',').map(|x| x.parse().unwrap()).collect())
        .collect();
    let fields = header.iter().map(|name| format!("required double {name};"));
    let message = format!("message log {{ {} }}", fields.collect::<String>());
    let schema = Arc::new(parse_message_type(&message).unwrap());
    let file = fs::File::create(path).unwrap();
    let mut writer = SerializedFileWriter::new(file, schema, Arc::default()).unwrap();
    for rows in rows.chunks(700) {
        let mut out = writer.next_row_group().unwrap();
        let mut column = 0;
        while let Some(mut to) = out.next_column().unwrap() {
            let values: Vec<f64> = rows.iter().map(|row| row[column]).collect();
            to.typed::<DoubleType>()
                .write_batch(&values, None, None)
                .unwrap();
            to.close().unwrap();
            column += 1;
        }
        out.close().unwrap();
    }
    writer.close().unwrap();
}

#[test]
fn a_log_is_inspected_alike_as_csv_and_as_parquet() {
    let dir = scratch("inspect_parquet");
    let text = fs::read_to_string(guide("run1.csv")).unwrap();
    fs::write(dir.join("run.csv"), &text).unwrap();
    as_parquet(&text, &dir.join("run.parquet"));
    let spec = guide("fivebar.yaml");
    let found = |log: &str| {
        let args = ["inspect", log, "--spec", &spec, "--format", "json"];
        let mut found = regen(&dir, &args).ended(0).json();
        assert_eq!(found["logs"][0]["log"], log);
        found["logs"][0]["log"] = Value::Null;
        found["proposal"] = Value::Null;
        found
    };
    assert_eq!(found("run.parquet"), found("run.csv"));
}

#[test]
fn a_first_experiment_file_for_currents_has_unknown_gains_that_identify_finds() {
    let dir = scratch("inspect_currents");
    let text = fs::read_to_string(guide("run1.csv")).unwrap();
    // drives of 8 and 12 N m/A
    let current = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        let [t, q1, q3, tau1, tau3] = cells[..] else {
            panic!("{line}")
        };
        match (tau1.parse::<f64>(), tau3.parse::<f64>()) {
            (Ok(a), Ok(b)) => format!("{t},{q1},{q3},{},{}", a / 8.0, b / 12.0),
            _ => "t,q1,q3,current_q1 [A],current_q3 [A]".to_owned(),
        }
    };
    let rows: Vec<String> = text.lines().map(current).collect();
    fs::write(dir.join("log.csv"), rows.join("\n") + "\n").unwrap();
    let spec = guide("fivebar.yaml");
    let json = ["--format", "json"];
    let run = |args: &[&str]| regen(&dir, &[args, &json].concat()).ended(0).json();
    let found = run(&["inspect", "log.csv", "--spec", &spec, "--out", "runs.yaml"]);
    let written = fs::read_to_string(dir.join("runs.yaml")).unwrap();
    assert!(written.contains("unit: A, gain: 1}"), "{written}");
    assert!(written.contains("unit: A, gain: unknown}"), "{written}");
    // sigmas in units of current are not compared with nominal values, by inspect of the log and of
    // the file
    for found in [found, run(&["inspect", "runs.yaml", "--spec", &spec])] {
        let prediction = &found["prediction"];
        for parameter in prediction["parameters"].as_array().unwrap() {
            assert_eq!(parameter["percent"], Value::Null, "{parameter}");
            assert_eq!(parameter["status"], "determined", "{parameter}");
        }
        let notes = prediction["notes"].to_string();
        assert!(notes.contains("units of current"), "{notes}");
    }
    let fit = run(&["identify", &spec, "runs.yaml"]);
    let gains = fit["gains"].as_array().unwrap();
    let value = gains[0]["value"].as_f64().unwrap();
    // in proportion to the first, from a log with noise of a percent
    assert!((value / (12.0 / 8.0) - 1.0).abs() < 0.05, "{value}");
}

#[test]
fn columns_whose_names_and_order_say_nothing_are_told_apart_by_their_noise() {
    let dir = scratch("inspect_plain");
    let log = fs::read_to_string(guide("run1.csv")).unwrap();
    let mut rows = vec!["t,a,b,c,d".to_owned()];
    rows.extend(log.lines().skip(1).map(|line| {
        let cells: Vec<&str> = line.split(',').collect();
        format!(
            "{},{},{},{},{}",
            cells[0], cells[3], cells[1], cells[4], cells[2]
        )
    }));
    fs::write(dir.join("log.csv"), rows.join("\n")).unwrap();
    let spec = guide("fivebar.yaml");
    regen(&dir, &["inspect", &spec, "log.csv", "--out", "runs.yaml"]).ended(0);
    let proposed = fs::read_to_string(dir.join("runs.yaml")).unwrap();
    for (own, column) in [("q1", "b"), ("q3", "d"), ("tau_q1", "a"), ("tau_q3", "c")] {
        let line = format!("  {own}: {{column: {column}}}\n");
        assert!(proposed.contains(&line), "{proposed}");
    }
}

#[test]
fn a_log_without_positions_is_described_before_the_proposal_fails() {
    let dir = scratch("inspect_nothing");
    let rows = (0..200).map(|k| format!("{},{}\n", f64::from(k) * 0.01, 30 + k / 50));
    let text = "t,J1 MotorTemp [degC]\n".to_owned() + &rows.collect::<String>();
    fs::write(dir.join("log.csv"), text).unwrap();
    let spec = guide("fivebar.yaml");
    let with_spec = ["inspect", "log.csv", "--spec", &spec, "--out", "runs.yaml"];
    let ended = regen(&dir, &with_spec).ended(3);
    assert!(ended.out.contains("MotorTemp"), "{}", ended.out);
    assert!(!ended.err.contains("--spec"), "{}", ended.err);
    assert!(ended.err.contains("--column"), "{}", ended.err);
    let ended = regen(&dir, &["inspect", "log.csv", "--out", "runs.yaml"]).ended(3);
    assert!(ended.err.contains("give --spec"), "{}", ended.err);
    assert!(!dir.join("runs.yaml").exists());
}

#[test]
fn runs_with_a_payload_are_described_and_predicted_from_those_without_one() {
    let dir = scratch("inspect_payload");
    let spec = root().join("tests/fixtures/mechanisms/payload.yaml");
    let spec = spec.display().to_string();
    let run = |line: &str| {
        let words: Vec<&str> = line.split(' ').collect();
        let (command, rest) = words.split_first().unwrap();
        regen(&dir, &[&[*command, &spec], rest].concat()).ended(0)
    };
    run("excite --payload carried --out m.json --seed 1 --harmonics 3 --starts 1 --frequency 0.4");
    for payload in ["none", "carried"] {
        run(&format!(
            "simulate --payload {payload} --trajectory m.json --noise 1e-6,0.01 --seed 3 --out {payload}.csv"
        ));
    }
    let with = |payload: &str| format!("  - {{files: [carried.csv], payload: {payload}}}\n");
    let bare = "  - {files: [none.csv]}\n";
    let of =
        |q: &str| format!("  {q}: {q}\n  tau_{q}: {{column: tau_{q}, unit: A, gain: unknown}}\n");
    let columns = format!("columns:\n{}runs:\n", ["q1", "q2", "q3"].map(of).concat());
    for (name, runs, note) in [
        (
            "both.yaml",
            format!("{bare}{}", with("{m: 2.2}")),
            "1 of 2 carry one",
        ),
        ("loaded.yaml", with("unknown"), "which all runs carry"),
    ] {
        fs::write(dir.join(name), format!("{columns}{runs}")).unwrap();
        let found = run(&format!("inspect {name} --format json")).json();
        assert_eq!(
            found["logs"].as_array().unwrap().len(),
            runs.lines().count()
        );
        let prediction = &found["prediction"];
        let notes = prediction["notes"].to_string();
        assert!(notes.contains(note), "{notes}");
        let proposed = found["proposal"].as_str().unwrap();
        assert!(proposed.contains(&runs), "{proposed}");
        let parameters = prediction["parameters"].as_array().unwrap();
        assert!(
            parameters.iter().any(|p| p["sigma"].is_number()),
            "{prediction}"
        );
        // without the robot, nothing says what may be carried
        let args = ["inspect", name, "--format", "json"];
        assert_eq!(
            regen(&dir, &args).ended(0).json()["prediction"],
            Value::Null
        );
    }
}
