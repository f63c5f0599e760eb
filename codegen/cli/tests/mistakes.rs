//! Common mistakes in specs, logs and command lines, with the answer to each. The table is a
//! snapshot, to be read by a person.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use crate::common::{regen, root, scratch};

/// The first error of a run: its message, its place and the remedy.
fn first_error(name: &str, code: i32, err: &str) -> String {
    let mut text = format!("## {name} (exit {code})\n");
    let mut errors = 0;
    for line in err.lines() {
        let line = line.trim_end();
        errors += usize::from(line.starts_with("error"));
        let place = line.trim_start().starts_with("--> ");
        let help = line.trim_start().starts_with("= ");
        let source = line.contains(" | ") || line.trim_start() == "|" || line.ends_with(" |");
        if errors <= 1 && !line.is_empty() && (place || help || !source) {
            let _ = writeln!(text, "{line}");
        }
    }
    if errors > 1 {
        let _ = writeln!(text, "and {} more", errors - 1);
    }
    text
}

#[test]
fn every_mistake_in_a_description_is_answered_with_its_place() {
    let dir = scratch("mistakes_specs");
    let mut table = String::new();
    let mut files: Vec<_> = fs::read_dir(root().join("tests/fixtures/invalid"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "yaml"))
        .map(|path| path.file_name().unwrap().to_str().unwrap().to_owned())
        .collect();
    files.sort();
    assert!(files.len() >= 50, "{}", files.len());
    for name in files {
        fs::copy(
            root().join("tests/fixtures/invalid").join(&name),
            dir.join(&name),
        )
        .unwrap();
        let run = regen(&dir, &["info", &name]).ended(3);
        assert!(run.out.is_empty(), "{}", run.out);
        assert!(run.err.contains(&format!("--> {name}:")), "{}", run.err);
        table += &first_error(&name, run.code, &run.err);
    }
    insta::assert_snapshot!("specs", table);
}

/// Writes the log of the guide with changed rows.
fn log(dir: &Path, change: impl FnOnce(&mut Vec<String>)) {
    let text = fs::read_to_string(root().join("runtime/guide/fivebar/run1.csv")).unwrap();
    let mut lines: Vec<String> = text.lines().take(801).map(str::to_owned).collect();
    change(&mut lines);
    fs::write(dir.join("log.csv"), lines.join("\n") + "\n").unwrap();
}

/// Replaces a cell.
fn cell(lines: &mut [String], row: usize, column: usize, with: &str) {
    let mut cells: Vec<&str> = lines[row].split(',').collect();
    cells[column] = with;
    lines[row] = cells.join(",");
}

/// The name of a mistake, the change of the log, and further arguments.
type Mistake = (&'static str, fn(&mut Vec<String>), &'static [&'static str]);

const LOGS: [Mistake; 23] = [
    (
        "no time",
        |l| l[0] = l[0].replacen("t,", "seconds,", 1),
        &[],
    ),
    (
        "no position of a motor",
        |l| l[0] = l[0].replace("q3", "motor2"),
        &[],
    ),
    (
        "no effort of a motor",
        |l| l[0] = l[0].replace("tau_q3", "current"),
        &[],
    ),
    (
        "a column twice",
        |l| l[0] = l[0].replace("q3,tau_q1", "q1,tau_q1"),
        &[],
    ),
    ("text for a number", |l| cell(l, 7, 1, "n/a"), &[]),
    ("NaN", |l| cell(l, 7, 3, "nan"), &[]),
    ("decimal commas", |l| l[3] = l[3].replace('.', ","), &[]),
    ("a row cut short", |l| l[800] = l[800][..20].to_owned(), &[]),
    ("times out of order", |l| l.swap(30, 31), &[]),
    ("the same time twice", |l| l[31] = l[30].clone(), &[]),
    (
        "a gap",
        |l| drop(l.drain(100..160)),
        &["--problems", "fail"],
    ),
    (
        "the clock jumps back",
        |l| (400..420).for_each(|k| cell(l, k, 0, "0.5")),
        &[],
    ),
    ("an encoder jumps a turn", |l| cell(l, 200, 1, "8.4"), &[]),
    ("no header", |l| drop(l.remove(0)), &[]),
    (
        "blanks in names between blanks",
        |l| {
            for row in l.iter_mut() {
                *row = row.replace(',', " ");
            }
            l[0] = l[0].replace(' ', " [si] ");
        },
        &[],
    ),
    ("an empty cell", |l| cell(l, 7, 1, ""), &[]),
    ("only a header", |l| l.truncate(1), &[]),
    ("nothing", Vec::clear, &[]),
    ("nine rows", |l| l.truncate(10), &[]),
    (
        "an assignment of no column",
        |_| {},
        &["--column", "q1=motor 1:deg"],
    ),
    ("an unknown unit", |_| {}, &["--column", "q1=q3:inch"]),
    ("an assignment to nothing", |_| {}, &["--column", "q9=q3"]),
    (
        "a filter above half the sampling",
        |_| {},
        &["--butterworth", "4,500"],
    ),
];

#[test]
fn every_mistake_in_a_log_is_answered_with_its_rows() {
    let dir = scratch("mistakes_logs");
    let spec = root().join("runtime/guide/fivebar/fivebar.yaml");
    fs::copy(spec, dir.join("fivebar.yaml")).unwrap();
    let mut table = String::new();
    for (name, change, more) in LOGS {
        log(&dir, change);
        let mut args = vec!["identify", "fivebar.yaml", "log.csv", "--out", "p.json"];
        args.extend(more);
        let run = regen(&dir, &args);
        assert!(
            run.code != 0 && run.code != 101,
            "{name}\n{}\n{}",
            run.out,
            run.err
        );
        assert!(!dir.join("p.json").exists(), "{name}");
        table += &first_error(name, run.code, &run.err);
    }
    insta::assert_snapshot!("logs", table);
}

#[test]
fn options_without_effect_unknown_names_and_units_of_the_wrong_kind_are_refused() {
    let dir = scratch("mistakes_options");
    let guide = root().join("runtime/guide/fivebar/fivebar.yaml");
    fs::copy(guide, dir.join("fivebar.yaml")).unwrap();
    let run = |words: &str| regen(&dir, &words.split(' ').collect::<Vec<&str>>());
    run("excite fivebar.yaml --out t.json --seed 1 --harmonics 5 --starts 1 --frequency 0.2")
        .ended(0);
    run("simulate fivebar.yaml --trajectory t.json --step 0.005 --duration 10 --out log.csv --noise 1e-6,0.01")
        .ended(0);
    run("observe fivebar.yaml log.csv --butterworth 4,10 --out f.json").ended(0);
    run("identify fivebar.yaml --from f.json").ended(0);
    for (words, says) in [
        (
            "identify fivebar.yaml log.csv --delay q9=0.1",
            "`q9`, whose delay is given, is none of q1 q3",
        ),
        (
            "identify fivebar.yaml log.csv --deviation q9=1",
            "`q9`, whose standard deviation",
        ),
        ("identify fivebar.yaml log.csv --energy 0", "above 0"),
        ("identify fivebar.yaml log.csv --energy -1", "above 0"),
        ("identify fivebar.yaml log.csv --energy nan", "above 0"),
        (
            "identify fivebar.yaml log.csv --column tau_q1=tau_q1:deg",
            "`deg` is no unit of `tau_q1`",
        ),
        (
            "identify fivebar.yaml log.csv --column q1=q1:Nm",
            "`Nm` is no unit of `q1`",
        ),
        (
            "identify fivebar.yaml log.csv --column t=t:A",
            "`A` is no unit of `t`",
        ),
        (
            "identify fivebar.yaml log.csv --column q3=q1",
            "read as two quantities",
        ),
        (
            "identify fivebar.yaml log.csv --rate 100",
            "a rate is stated too",
        ),
        (
            "identify fivebar.yaml log.csv --bandwidth 100000",
            "is too long for",
        ),
        (
            "identify fivebar.yaml --from f.json --butterworth 4,20",
            "--butterworth has no effect",
        ),
        (
            "identify fivebar.yaml --from f.json --delay auto",
            "--delay has no effect",
        ),
        (
            "identify fivebar.yaml --from f.json --no-suspicion",
            "--no-suspicion has no effect",
        ),
        (
            "identify fivebar.yaml log.csv --settle 1",
            "--settle has no effect",
        ),
        (
            "identify fivebar.yaml log.csv --window 2",
            "--window has no effect",
        ),
        (
            "identify fivebar.yaml log.csv --estimator didim --window 2",
            "--window has no effect",
        ),
        (
            "simulate fivebar.yaml --no-friction --friction-width 0.1 --out x.csv",
            "--friction-width has no effect",
        ),
        (
            "simulate fivebar.yaml --friction-width 1e-300 --out x.csv",
            "--friction-width 1e-300 is below",
        ),
        (
            "rehearse fivebar.yaml --estimator ls --huber 2",
            "--huber has no effect",
        ),
    ] {
        let ended = run(words);
        assert!(
            [2, 3].contains(&ended.code) && ended.err.contains(says),
            "{words}: {} {}",
            ended.code,
            ended.err
        );
    }
}
