//! Faults of measurement, injected into logs of simulated robots: each is found, with its rows and
//! columns, and logs without faults give no warning.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{Run, regen, regen_with, root, scratch};

/// A log as cells; the header is the first row.
#[derive(Clone)]
struct Log(Vec<Vec<String>>);

impl Log {
    fn read(path: &Path) -> Self {
        let text = fs::read_to_string(path).unwrap();
        let row = |line: &str| line.split(',').map(str::to_owned).collect();
        Self(text.lines().map(row).collect())
    }

    fn text(&self) -> String {
        let lines = self.0.iter().map(|row| row.join(",") + "\n");
        lines.collect()
    }

    fn column(&self, name: &str) -> usize {
        self.0[0].iter().position(|c| c == name).unwrap()
    }

    /// Changes the numbers of a column; rows are counted from 0 after the header.
    fn each(&self, name: &str, change: impl Fn(usize, f64) -> f64) -> Self {
        let mut out = self.clone();
        let column = self.column(name);
        for (k, row) in out.0.iter_mut().skip(1).enumerate() {
            row[column] = change(k, row[column].parse().unwrap()).to_string();
        }
        out
    }

    fn swapped(&self, a: &str, b: &str) -> Self {
        let mut out = self.clone();
        let (a, b) = (self.column(a), self.column(b));
        out.0[0].swap(a, b);
        out
    }

    fn value(&self, name: &str, row: usize) -> f64 {
        self.0[row + 1][self.column(name)].parse().unwrap()
    }
}

/// The five-bar of the guide with its logs.
fn bench(test: &str) -> (PathBuf, Log) {
    let dir = scratch(test);
    let guide = root().join("runtime/guide/fivebar");
    fs::copy(guide.join("fivebar.yaml"), dir.join("r.yaml")).unwrap();
    (dir, Log::read(&guide.join("run1.csv")))
}

/// Options to use every fifth state, where many fits are compared.
const SOME: [&str; 2] = ["--decimate", "5"];

fn identify(dir: &Path, text: &str, more: &[&str]) -> Run {
    fs::write(dir.join("log.csv"), text).unwrap();
    let args = ["identify", "r.yaml", "log.csv", "--butterworth", "4,20"];
    regen(dir, &[&args[..], more].concat())
}

/// Random rows where faults begin, from a fixed seed.
fn places() -> Vec<usize> {
    let draw = |seed: u64| {
        let mixed = (seed + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        100 + (mixed >> 40) as usize % 1700
    };
    (0..4).map(draw).collect()
}

#[test]
fn logs_without_a_fault_are_read_without_a_message() {
    let (dir, log) = bench("clean_logs");
    let other = Log::read(&root().join("runtime/guide/fivebar/run2.csv"));
    for log in [log, other] {
        let run = identify(&dir, &log.text(), &[]).ended(0);
        assert_eq!(run.err, "");
        // a missing line end in the last line is not a fault
        assert_eq!(identify(&dir, log.text().trim_end(), &[]).ended(0).err, "");
    }
    // other robots, with coarse encoders and noise, at rest at both ends
    for (robot, quantum, noise, seed) in [
        ("fourbar", "1e-4", "0,0.01", "1"),
        ("slider_crank", "0", "1e-5,0.01", "2"),
        ("scara", "1e-3", "1e-5,0.1", "3"),
    ] {
        let spec = root().join(format!("robots/{robot}.yaml"));
        fs::copy(spec, dir.join("r.yaml")).unwrap();
        let args = ["simulate", "r.yaml", "--perturb", "0.2", "--out", "s.csv"];
        let noise = ["--quantum", quantum, "--noise", noise, "--seed", seed];
        regen(&dir, &[&args[..], &noise].concat()).ended(0);
        let text = fs::read_to_string(dir.join("s.csv")).unwrap();
        let run = identify(&dir, &text, &[]);
        for word in ["stuck", "swapped", "flipped", "clock", "saturated", "cut"] {
            assert!(!run.err.contains(word), "{robot}: {}", run.err);
        }
    }
}

#[test]
fn stuck_encoders_are_found_with_their_rows() {
    let (dir, log) = bench("stuck_encoders");
    for (k, start) in places().into_iter().enumerate() {
        let name = ["q1", "q3"][k % 2];
        let rows = 80 + 40 * k;
        let held = log.value(name, start);
        let freeze = |row: usize, x: f64| {
            if (start..start + rows).contains(&row) {
                held
            } else {
                x
            }
        };
        let run = identify(&dir, &log.each(name, freeze).text(), &[]).ended(3);
        // the row that is repeated first is line start + 2
        let (first, last) = (start + 3, (start + rows + 1).min(2002));
        let told = format!("row {first}: column `{name}` stands still at {held} until row {last}");
        assert!(run.err.contains(&told), "{told}\n{}", run.err);
        assert!(run.err.contains("stuck encoder"), "{}", run.err);
        let drop = ["--problems", "drop"];
        let run = identify(&dir, &log.each(name, freeze).text(), &drop).ended(0);
        assert!(
            run.err
                .contains(&format!("{} rows or gaps", last - first + 1)),
            "{}",
            run.err
        );
    }
}

#[test]
fn runs_of_outliers_are_found_with_their_rows() {
    let (dir, log) = bench("bursts");
    for place in places() {
        for length in [1, 4, 6, 15] {
            let inside = |k: usize| (place..place + length).contains(&k);
            let jumps = |k: usize| [0.5, -0.4, 0.6][k % 3];
            let faulty = log.each("q1", |k, x| if inside(k) { x + jumps(k) } else { x });
            let run = identify(&dir, &faulty.text(), &["--problems", "fail"]);
            assert_eq!(run.code, 3, "{}", run.err);
            let said = format!("{length} row");
            assert!(run.err.contains(&said), "{place} {length}\n{}", run.err);
            assert!(
                run.err.contains("in column `q1` is an outlier"),
                "{}",
                run.err
            );
            let _ = identify(&dir, &faulty.text(), &["--problems", "drop"]).ended(0);
        }
        // a burst in which some rows are off by their effort only
        let inside = |k: usize| (place..place + 6).contains(&k);
        let is_right = |k: usize| [1, 4].contains(&(k - place));
        let faulty = log.each("q1", |k, x| {
            x + if inside(k) && !is_right(k) { 0.5 } else { 0.0 }
        });
        let jump = |k: usize| [40.0, -40.0][k % 2];
        let faulty = faulty.each("tau_q1", |k, x| if inside(k) { x + jump(k) } else { x });
        let run = identify(&dir, &faulty.text(), &["--problems", "fail"]);
        assert_eq!(run.code, 3, "{}", run.err);
        assert!(run.err.contains("6 rows cannot be used"), "{}", run.err);
        assert!(
            run.err.contains("in column `tau_q1` is an outlier"),
            "{}",
            run.err
        );
    }
}

#[test]
fn a_jump_of_the_clock_is_found_with_its_row() {
    let (dir, log) = bench("clocks");
    for start in places() {
        for jump in [-0.4, 0.4] {
            let set = log.each("t", |row, t| if row < start { t } else { t + jump });
            let run = identify(&dir, &set.text(), &["--problems", "fail"]).ended(3);
            let told = if jump < 0.0 {
                format!("row {}: the clock jumps back by 0.3975", start + 2)
            } else {
                format!("row {}: a gap of 0.4025", start + 2)
            };
            assert!(run.err.contains("1 row cannot be used"), "{}", run.err);
            assert!(run.err.contains(&told), "{told}\n{}", run.err);
        }
    }
}

/// The rows of `stretches` with these columns as in the row before the stretch.
fn late(log: &Log, columns: &[&str], stretches: &[(usize, usize)]) -> Log {
    columns.iter().fold(log.clone(), |late, name| {
        late.each(name, |row, x| {
            let held = stretches
                .iter()
                .find(|(first, rows)| (*first..first + rows).contains(&row));
            held.map_or(x, |(first, _)| log.value(name, first - 1))
        })
    })
}

#[test]
fn short_dropouts_and_gaps_are_bridged_and_long_ones_divide_the_log() {
    let (dir, log) = bench("dropouts");
    let all = ["q1", "q3", "tau_q1", "tau_q3"];
    let stretches: Vec<(usize, usize)> = (0..12).map(|k| (90 + 151 * k, 7 + k % 9)).collect();
    let rows: usize = stretches.iter().map(|own| own.1).sum();
    let json = |log: &Log, more: &[&str]| {
        let more = [&["--format", "json"], more].concat();
        let run = identify(&dir, &log.text(), &more).ended(0);
        (run.json(), run.err)
    };
    let (whole, _) = json(&log, &[]);
    let repeated = late(&log, &all, &stretches);
    let mut thinned = log.clone();
    let is_kept = |row: usize| {
        let held = |own: &&(usize, usize)| (own.0..own.0 + own.1).contains(&row);
        stretches.iter().find(held).is_none()
    };
    let mut row = 0;
    thinned.0.retain(|_| {
        row += 1;
        row < 2 || is_kept(row - 2)
    });
    for (changed, name) in [(&repeated, "repeated"), (&thinned, "thinned")] {
        let (found, told) = json(changed, &[]);
        let line = format!(
            "12 gaps or dropouts of up to 15 rows were bridged: {rows} rows (6.1 %) are interpolated"
        );
        assert!(told.contains(&line), "{name}: {told}");
        let gaps = &found["files"][0]["gaps"];
        assert_eq!(
            (&gaps["bridged"], &gaps["rows"]),
            (&12.into(), &rows.into())
        );
        assert_eq!(found["files"][0]["dropped"], 0);
        let error = |json: &serde_json::Value| json["relative_absolute"].as_f64().unwrap();
        assert!(
            error(&found) < 2.0 * error(&whole),
            "{name}: {}",
            error(&found)
        );
        let pairs = found["parameters"].as_array().unwrap().iter();
        for (own, other) in pairs.zip(whole["parameters"].as_array().unwrap()) {
            let value = |json: &serde_json::Value| json["value"].as_f64().unwrap();
            let off = (value(own) - value(other)) / own["sigma"].as_f64().unwrap();
            assert!(off.abs() < 3.0, "{name}: {own} {other}");
        }
    }
    // no option is needed for a long one either, which is told with its rows
    let long = late(&repeated, &all, &[(1020, 100)]);
    let (found, told) = json(&long, &[]);
    assert_eq!(found["files"][0]["gaps"]["cuts"], 1);
    assert_eq!(found["files"][0]["dropped"], 100);
    assert!(
        told.contains("1 more, longer than the 0.0500 s that the filter bridges"),
        "{told}"
    );
    assert!(
        told.contains("rows 1022 to 1121: columns `q1`, `q3`"),
        "{told}"
    );
    let run = identify(&dir, &repeated.text(), &["--problems", "fail"]).ended(3);
    assert!(
        run.err.contains("rows 92 to 98: columns `q1`"),
        "{}",
        run.err
    );
}

#[test]
fn rows_that_two_logs_share_are_told() {
    let (dir, log) = bench("same_rows");
    fs::write(dir.join("copy.csv"), log.text()).unwrap();
    let run = identify(&dir, &log.text(), &["copy.csv"]).ended(0);
    let told = "copy.csv: 100 % of its rows are rows of log.csv too";
    assert!(run.err.contains(told), "{}", run.err);
    let run = identify(&dir, &log.text(), &["--against", "copy.csv"]).ended(0);
    let told = "copy.csv: 100 % of its rows are rows of log.csv, which is identified from";
    assert!(run.err.contains(told), "{}", run.err);
    let other = root().join("runtime/guide/fivebar/run2.csv");
    let other = ["--against", other.to_str().unwrap()];
    let run = identify(&dir, &log.text(), &other).ended(0);
    assert!(!run.err.contains("of its rows"), "{}", run.err);
}

#[test]
fn saturated_efforts_are_found_with_their_rows() {
    let (dir, log) = bench("saturation");
    let drop = ["--problems", "drop", "--format", "json"];
    let whole = identify(&dir, &log.text(), &drop).ended(0).json();
    for name in ["tau_q1", "tau_q3"] {
        let largest = (0..2001)
            .map(|k| log.value(name, k).abs())
            .fold(0.0, f64::max);
        let flat = 0.7 * largest;
        let cut = log.each(name, |_, x| x.clamp(-flat, flat));
        let run = identify(&dir, &cut.text(), &[]).ended(3);
        let told = format!("column `{name}` stands still at its extreme");
        assert!(run.err.contains(&told), "{}", run.err);
        // the first four consecutive rows
        let first = (0..1998)
            .find(|k| (0..4).all(|d| log.value(name, k + d).abs() >= flat))
            .unwrap();
        assert!(
            run.err.contains(&format!("rows {} to ", first + 2)),
            "{}",
            run.err
        );
        // the equations of the other effort stay, and what is left is right
        let run = identify(&dir, &cut.text(), &drop).ended(0);
        assert!(
            run.err
                .contains("where an effort is saturated its equations only"),
            "{}",
            run.err
        );
        let found = run.json();
        for (own, all) in found["efforts"]
            .as_array()
            .unwrap()
            .iter()
            .zip(whole["efforts"].as_array().unwrap())
        {
            let (own_count, all_count) = (own["equations"].as_u64(), all["equations"].as_u64());
            if name.ends_with(own["name"].as_str().unwrap()) {
                assert!(own_count < all_count);
            } else {
                assert_eq!(own_count, all_count);
            }
        }
        for (own, all) in found["parameters"]
            .as_array()
            .unwrap()
            .iter()
            .zip(whole["parameters"].as_array().unwrap())
        {
            let figure = |of: &serde_json::Value, key: &str| of[key].as_f64().unwrap();
            let apart = (figure(own, "value") - figure(all, "value")).abs();
            // the same noise is in both
            assert!(apart < 4.0 * figure(own, "sigma"), "{name}: {own} {all}");
        }
    }
}

/// Consecutive rows with one fault are one line, however many they are.
#[test]
fn consecutive_rows_are_listed_as_one() {
    let (dir, log) = bench("consecutive");
    let mut broken = log.clone();
    let column = broken.column("tau_q1");
    for row in 300..=420 {
        broken.0[row][column] = "nan".to_owned();
    }
    broken.0[500][column] = "nan".to_owned();
    let run = identify(&dir, &broken.text(), &[]).ended(3);
    let fault = "`nan` in column `tau_q1` is not a finite number";
    let listed: Vec<&str> = run.err.lines().filter(|l| l.contains(fault)).collect();
    let wanted = [
        format!("  rows 301 to 421: {fault}"),
        format!("  row 501: {fault}"),
    ];
    assert_eq!(listed, wanted, "{}", run.err);
    assert!(run.err.contains("122 rows cannot be used"), "{}", run.err);
}

#[test]
fn a_file_that_is_no_text_is_reported_as_such() {
    let (dir, log) = bench("no_text");
    let wide: Vec<u8> = log
        .text()
        .encode_utf16()
        .flat_map(u16::to_le_bytes)
        .collect();
    fs::write(dir.join("wide.csv"), wide).unwrap();
    let run = regen(&dir, &["identify", "r.yaml", "wide.csv"]).ended(3);
    assert!(run.err.contains("no text in UTF-8"), "{}", run.err);
}

#[test]
#[cfg(unix)]
fn pipes_and_devices_are_refused_as_logs_wherever_they_are_named() {
    let (dir, log) = bench("pipe");
    std::os::unix::fs::symlink("/dev/zero", dir.join("endless.csv")).unwrap();
    fs::write(dir.join("runs.yaml"), "runs: [{files: [endless.csv]}]\n").unwrap();
    for args in [
        &["identify", "r.yaml", "/dev/stdin"][..],
        &["identify", "r.yaml", "runs.yaml"],
        &["inspect", "/dev/stdin"],
    ] {
        let run = regen_with(&dir, args, &log.text());
        let said = run.err.contains("this is a pipe or a device");
        assert!(run.code != 0 && said, "{args:?}: {}", run.err);
    }
}

/// Doubtful numbers are used on request, with or without a message; values that are not numbers are
/// left out, always with a message.
#[test]
fn doubtful_rows_are_used_on_request_and_printed_on_request() {
    let (dir, log) = bench("kept_rows");
    let json = |log: &Log, more: &[&str]| {
        let more = [&["--standstill", "keep", "--format", "json"], more].concat();
        let run = identify(&dir, &log.text(), &more).ended(0);
        (run.json(), run.err)
    };
    let held = log.value("q1", 700);
    let frozen = |row: usize, x: f64| {
        if (700..800).contains(&row) { held } else { x }
    };
    let doubtful = log
        .each("q1", frozen)
        .each("q3", |row, x| if row == 1500 { x + 0.5 } else { x });
    let (whole, silent) = json(&log, &[]);
    assert_eq!(beyond_length(&silent), "");

    // by default nothing is computed, and the rows are listed with the option for both remedies
    let run = identify(&dir, &doubtful.text(), &[]).ended(3);
    for word in ["a stuck encoder", "is an outlier", "--problems"] {
        assert!(run.err.contains(word), "{word}\n{}", run.err);
    }
    assert_eq!(run.out, "");

    let (dropped, told) = json(&doubtful, &["--problems", "drop"]);
    // the row where the encoder stops is a good one
    assert!(told.contains("100 rows or gaps were left out"), "{told}");
    assert_eq!(dropped["files"][0]["dropped"], 100);
    assert!(dropped["equations"].as_u64() < whole["equations"].as_u64());

    let (kept, silent) = json(&doubtful, &["--problems", "keep"]);
    assert_eq!(beyond_length(&silent), "");
    assert_eq!(kept["equations"], whole["equations"]);
    assert_eq!(kept["files"][0]["rows"], 2001);
    assert_eq!(kept["files"][0]["dropped"], 0);

    let (tell, told) = json(&doubtful, &["--problems", "tell"]);
    assert!(
        told.contains("100 rows or gaps are doubtful; those that are numbers are used"),
        "{told}"
    );
    assert!(told.contains("a stuck encoder"), "{told}");
    assert!(told.contains("row 1502: 1.91392"), "{told}");
    assert!(told.contains("is an outlier"), "{told}");
    // the same rows give the same fit
    assert_eq!(tell["parameters"], kept["parameters"]);
    assert_eq!(tell["files"], kept["files"]);

    // no option uses a value that is not a number
    let broken = {
        let mut out = doubtful.clone();
        let column = out.column("tau_q1");
        out.0[1200][column] = "NaN".to_owned();
        out
    };
    for (policy, says) in [
        (
            "keep",
            "rows that cannot be kept were left out: 1 x not a number",
        ),
        ("tell", "`NaN` in column `tau_q1` is not a finite number"),
    ] {
        let (found, told) = json(&broken, &["--problems", policy]);
        assert!(told.contains(says), "{told}");
        assert_eq!(found["files"][0]["dropped"], 1);
        assert_eq!(found["files"][0]["rows"], 2000);
    }
}

#[test]
fn a_last_row_that_is_cut_anywhere_is_found() {
    let (dir, mut log) = bench("cut_rows");
    log.0.truncate(602);
    let mut found = 0;
    let text = log.text();
    let row = text.trim_end().lines().last().unwrap().len();
    for kept in (1..row).step_by(7) {
        let cut = &text[..text.len() - 1 - row + kept];
        let run = identify(&dir, cut, &[]);
        // leaving out the last digits of a number has no effect
        let end = |text: &str| -> f64 {
            let number = text.trim_end().rsplit(',').next().unwrap();
            number.parse().unwrap_or(f64::NAN)
        };
        if run.code == 0 && (end(cut) - end(&text)).abs() < 1e-9 {
            continue;
        }
        let run = run.ended(3);
        assert!(run.err.contains("row 602: "), "{kept}\n{}", run.err);
        found += 1;
    }
    assert!(found > row / 7 - 3, "{found}");
}

/// The messages without the one that the log is short, which these tests do not check.
fn beyond_length(messages: &str) -> String {
    let lines = messages.lines();
    let other = lines.filter(|line| !line.contains("too few to know how uncertain"));
    other.collect()
}

#[test]
fn swapped_and_turned_columns_are_named_with_the_remedy() {
    let (dir, log) = bench("swapped_columns");
    let identify =
        |dir: &Path, text: &str, more: &[&str]| identify(dir, text, &[&SOME[..], more].concat());
    let clean = identify(&dir, &log.text(), &[]).ended(0).out;
    let turned = |name: &str| log.each(name, |_, x| -x);
    for (changed, columns) in [
        (
            log.swapped("tau_q1", "tau_q3"),
            &["`tau_q1`", "`tau_q3`", "swapped"][..],
        ),
        (log.swapped("q1", "q3"), &["`q1`", "`q3`", "swapped"]),
        (turned("tau_q3"), &["`tau_q3`", "flipped"]),
        (turned("q1"), &["`q1`", "flipped"]),
    ] {
        let run = identify(&dir, &changed.text(), &[]);
        // the first warning may be about the log's length
        let told = run.err.lines().find(|line| line.contains("read it with"));
        let warning = told.unwrap_or_default();
        for word in columns {
            assert!(warning.contains(word), "{columns:?}\n{}", run.err);
        }
        // what was not tried is not listed beside what was
        assert!(!run.err.contains("look at the columns"), "{}", run.err);
        // read with the suggested options, the log is as good as the unchanged one
        let (_, remedy) = warning.split_once("read it with ").unwrap();
        let options: Vec<&str> = remedy.split(' ').map(|x| x.trim_matches('\'')).collect();
        let run = identify(&dir, &changed.text(), &options).ended(0);
        assert_eq!(beyond_length(&run.err), "");
        assert_eq!(run.out, clean);
    }
    let upside = turned("tau_q1").each("tau_q3", |_, x| -x);
    let run = identify(&dir, &upside.text(), &["--report", "page.html"]).ended(0);
    let told = "columns `tau_q1`, `tau_q3` look as if their signs were flipped";
    assert!(run.err.contains(told), "{}", run.err);
    let page = std::fs::read_to_string(dir.join("page.html")).unwrap();
    assert!(page.contains(told) && page.contains("may have been misread"));
    // with `--no-suspicion` nothing is searched for
    let run = identify(&dir, &upside.text(), &["--no-suspicion"]).ended(0);
    assert_eq!(beyond_length(&run.err), "");
}

#[test]
fn the_json_contains_the_suspicion() {
    let (dir, log) = bench("swapped_json");
    let identify =
        |dir: &Path, text: &str, more: &[&str]| identify(dir, text, &[&SOME[..], more].concat());
    let text = log.swapped("tau_q1", "tau_q3").text();
    let json = identify(&dir, &text, &["--format", "json"]).ended(0).json();
    let found = &json["suspicions"][0];
    assert_eq!(found["file"], "log.csv");
    assert!(found["changed"].as_f64().unwrap() < 0.5 * found["error"].as_f64().unwrap());
    let json = identify(&dir, &log.text(), &["--format", "json"])
        .ended(0)
        .json();
    assert!(json.get("suspicions").is_none());
}

/// The error of all efforts.
fn error_of(run: &Run) -> f64 {
    run.json()["relative_absolute"].as_f64().unwrap()
}

#[test]
fn a_position_that_jumps_for_good_is_refused_with_its_row_and_divides_the_log() {
    let (dir, log) = bench("jumps_for_good");
    let clean = identify(&dir, &log.text(), &["--format", "json"]).ended(0);
    // two stretches in the wrong order, with times that go on
    let mut swapped = log.clone();
    let order = log.0[1..501]
        .iter()
        .chain(&log.0[1201..])
        .chain(&log.0[501..1201]);
    for (k, own) in order.enumerate() {
        swapped.0[k + 1].clone_from(own);
        swapped.0[k + 1][0].clone_from(&log.0[k + 1][0]);
    }
    let shifted = log.each("q3", |row, x| if row < 1271 { x } else { x + 0.3 });
    for (faulty, row) in [(&swapped, 502), (&shifted, 1273)] {
        let run = identify(&dir, &faulty.text(), &[]).ended(3);
        assert!(
            run.err.contains(&format!("row {row}: column")),
            "{}",
            run.err
        );
        assert!(run.err.contains("not come back"), "{}", run.err);
    }
    let options = ["--problems", "drop", "--format", "json"];
    let run = identify(&dir, &swapped.text(), &options).ended(0);
    assert!(
        error_of(&run) < 1.2 * error_of(&clean),
        "{}",
        error_of(&run)
    );
}

#[test]
fn the_zero_of_a_position_that_is_not_that_of_the_spec_is_told_with_its_size() {
    let (dir, log) = bench("zeros");
    let clean = identify(&dir, &log.text(), &["--format", "json"]).ended(0);
    for (name, zero) in [("q1", 0.05), ("q3", -0.05)] {
        let text = log.each(name, |_, x| x + zero).text();
        let run = identify(&dir, &text, &[]).ended(0);
        let (_, told) = run.err.split_once(":offset:").expect(&run.err);
        let size: f64 = told.trim().trim_end_matches('\'').parse().unwrap();
        // this log itself fits best with zeros that are 1.5 mrad off, which its noise does
        assert!((size + zero).abs() < 0.002, "{size} {zero}");
        let option = format!("{name}={name}:offset:{size}");
        let run = identify(&dir, &text, &["--column", &option, "--format", "json"]).ended(0);
        assert!(
            error_of(&run) < 1.2 * error_of(&clean),
            "{}",
            error_of(&run)
        );
    }
    // with the filter that is chosen, a small one of either of two that explain almost the same, and a large one by
    // which loops do not close
    for (name, zero, exit) in [("q1", 0.05, 0), ("q3", 0.03, 0), ("q1", 0.15, 3)] {
        fs::write(dir.join("z.csv"), log.each(name, |_, x| x + zero).text()).unwrap();
        let run = regen(&dir, &["identify", "r.yaml", "z.csv"]).ended(exit);
        let (_, told) = run
            .err
            .split_once(&format!("{name}={name}:offset:"))
            .expect(&run.err);
        let size: f64 = told.split('\'').next().unwrap().parse().unwrap();
        assert!((size + zero).abs() < 0.002, "{size} {zero}");
    }
}

#[test]
fn a_constant_in_an_effort_is_told_where_parameters_take_most_of_it_up() {
    let (dir, log) = bench("constants");
    let text = log.each("tau_q1", |_, x| x + 0.1).text();
    let run = identify(&dir, &text, &["--format", "json"]).ended(0);
    // the errors are those of a good log
    assert!(error_of(&run) < 2.0, "{}", error_of(&run));
    let told = run
        .err
        .split_once("column `tau_q1` contains a constant of ");
    let size = told.and_then(|(_, told)| told.split(' ').next()?.parse::<f64>().ok());
    let size = size.expect(&run.err);
    assert!((size - 0.1).abs() < 0.02, "{size}");
}

#[test]
fn an_effort_that_is_far_off_in_a_part_of_the_log_is_told_with_a_remedy_that_works() {
    let (dir, log) = bench("far_efforts");
    let clean = identify(&dir, &log.text(), &["--format", "json"])
        .ended(0)
        .json();
    for (name, first, rows) in [("tau_q1", 400, 40), ("tau_q3", 1290, 25)] {
        let off = |row: usize, x: f64| {
            if (first..first + rows).contains(&row) {
                x + 30.0
            } else {
                x
            }
        };
        let text = log.each(name, off).text();
        let run = identify(&dir, &text, &[]).ended(0);
        let told = format!("column `{name}` is up to ");
        assert!(run.err.contains(&told), "{}", run.err);
        assert!(run.err.contains("Give --huber 1.345"), "{}", run.err);
        let options = ["--huber", "1.345", "--format", "json"];
        let run = identify(&dir, &text, &options).ended(0);
        assert!(!run.err.contains(&told), "{}", run.err);
        let pairs = run.json()["parameters"].as_array().unwrap().clone();
        for (own, other) in pairs.iter().zip(clean["parameters"].as_array().unwrap()) {
            let value = |json: &serde_json::Value| json["value"].as_f64().unwrap();
            let off = (value(own) - value(other)) / own["sigma"].as_f64().unwrap();
            assert!(off.abs() < 4.0, "{name}: {own} {other}");
        }
    }
}

#[test]
fn efforts_that_are_the_same_throughout_are_named_and_have_no_error_that_is_printed() {
    let (dir, log) = bench("constant_efforts");
    for value in [0.0, 1e-310, 1.25] {
        let text = log.each("tau_q3", |_, _| value).text();
        let run = identify(&dir, &text, &[]).ended(0);
        let told = "column `tau_q3` is the same in all rows";
        assert!(run.err.contains(told), "{value}: {}", run.err);
        let row = run.out.lines().find(|line| line.starts_with("  q3 "));
        let words: Vec<&str> = row.unwrap().split_whitespace().collect();
        assert_eq!(words[3], "-", "{words:?}");
    }
    let text = log
        .each("tau_q1", |_, _| 0.0)
        .each("tau_q3", |_, _| 0.0)
        .text();
    let run = identify(&dir, &text, &[]).ended(3);
    assert!(run.err.contains("all efforts are 0"), "{}", run.err);
    assert!(run.err.contains("`tau_q1`, `tau_q3`"), "{}", run.err);
}

#[test]
fn copies_and_columns_that_are_seldom_new_are_named() {
    let (dir, log) = bench("copied_columns");
    let mut copied = log.clone();
    let (from, to) = (log.column("tau_q1"), log.column("tau_q3"));
    for row in copied.0.iter_mut().skip(1) {
        row[to] = row[from].clone();
    }
    let run = identify(&dir, &copied.text(), &[]);
    let told = "columns `tau_q1` and `tau_q3` have the same values in all rows";
    assert!(run.err.contains(told), "{}", run.err);
    for (name, every) in [("q1", 4), ("tau_q3", 9)] {
        let late = log.each(name, |row, _| log.value(name, row / every * every));
        let run = identify(&dir, &late.text(), &[]).ended(0);
        let told = format!("column `{name}` has a new value only every {every} rows");
        assert!(run.err.contains(&told), "{}", run.err);
        assert!(!run.err.contains("saturated"), "{}", run.err);
    }
}

#[test]
fn a_wrong_unit_of_time_is_told_where_no_filter_can_be_chosen() {
    let (dir, log) = bench("slow_clocks");
    let text = log.each("t", |_, t| 1e6 * t).text();
    fs::write(dir.join("log.csv"), text).unwrap();
    let run = regen(&dir, &["identify", "r.yaml", "log.csv"]);
    assert!(
        run.err.contains("column `t` looks like us and not s"),
        "{}",
        run.err
    );
}

#[test]
fn velocities_of_another_clock_or_order_are_told_with_all_columns() {
    let (dir, log) = bench("velocities");
    let mut with = log.clone();
    with.0[0].extend(["qd_q1", "qd_q3"].map(str::to_owned));
    let step = log.value("t", 1) - log.value("t", 0);
    for row in 0..log.0.len() - 1 {
        for name in ["q1", "q3"] {
            let (before, after) = (row.saturating_sub(1), (row + 1).min(log.0.len() - 2));
            let change = log.value(name, after) - log.value(name, before);
            let rate = change / (step * (after - before) as f64);
            with.0[row + 1].push(rate.to_string());
        }
    }
    let run = identify(&dir, &with.swapped("qd_q1", "qd_q3").text(), &[]).ended(3);
    let told = "--column qd_q1=qd_q3 --column qd_q3=qd_q1";
    assert!(run.err.contains(told), "{}", run.err);
    let options: Vec<&str> = told.split(' ').collect();
    let _ = identify(&dir, &with.swapped("qd_q1", "qd_q3").text(), &options).ended(0);
    let run = identify(&dir, &with.each("t", |_, t| 2.5 * t).text(), &[]).ended(3);
    assert!(run.err.contains("--column 't=t*0.4'"), "{}", run.err);
    // the equations tell that the positions are those in another order, and not the velocities
    let faulty = with.swapped("q1", "q3").text();
    let run = identify(&dir, &faulty, &options).ended(0);
    let told = ["q1=q3", "q3=q1", "qd_q1=qd_q1", "qd_q3=qd_q3"].map(|a| format!("--column '{a}'"));
    for option in &told {
        assert!(run.err.contains(option), "{}", run.err);
    }
    let swapped = ["--column", "q1=q3", "--column", "q3=q1", "--format", "json"];
    let clean = identify(&dir, &with.text(), &["--format", "json"]).ended(0);
    let mended = identify(&dir, &faulty, &swapped).ended(0);
    let errors = [error_of(&mended), error_of(&clean)];
    assert!(errors[0] < 1.01 * errors[1], "{errors:?}");
}
