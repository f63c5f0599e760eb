//! `regen excite` as a user sees it.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::Path;

use crate::common::{self, regen};

/// Options of a small search.
const SMALL: [&str; 12] = [
    "--harmonics",
    "3",
    "--samples",
    "20",
    "--steps",
    "2",
    "--starts",
    "2",
    "--frequency",
    "0.5",
    "--format",
    "json",
];

fn robots() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots"))
}

fn excite(more: &[&str]) -> common::Run {
    let mut args = vec!["excite", "fivebar.yaml"];
    args.extend(SMALL);
    args.extend(more);
    regen(robots(), &args)
}

#[test]
fn the_same_seed_writes_the_same_file_and_prints_which_limits_are_near() {
    let dir = std::env::temp_dir().join(format!("regen-excite-{}", std::process::id()));
    let limits = ["--limit", LIMITS[0], "--limit", LIMITS[1], "--threads"];
    let run = |threads: &str, name: &str| {
        let path = dir.join(name);
        let mut args = limits.to_vec();
        let text = path.display().to_string();
        args.extend([threads, "--out", text.as_str()]);
        let json = excite(&args).ended(0).json();
        (json, fs::read(&path).unwrap())
    };
    let (json, one) = run("1", "a.json");
    let (_, two) = run("2", "b.json");
    fs::remove_dir_all(&dir).unwrap();
    assert_eq!(one, two);
    let file: serde_json::Value = serde_json::from_slice(&one).unwrap();
    assert_eq!(file, json["trajectory"]);
    assert_eq!(file["format"], "regen-trajectory");
    assert_eq!(file["sine"][0].as_array().unwrap().len(), 3);
    assert!(file["criterion"]["scaled_condition"].as_f64().unwrap() > 1.0);
    let kept = json["limits"].as_array().unwrap();
    assert!(!kept.is_empty());
    assert!(
        kept.iter()
            .all(|limit| limit["left"].as_f64().unwrap() >= 0.0)
    );
}

const LIMITS: [&str; 2] = ["q1.position=0.5,2.5", "q3.position=0.5,2.5"];

/// The motion that this start ends with can only be reduced to the limits in large steps.
#[test]
fn a_single_start_ends_with_a_motion_and_not_with_standing_still() {
    let file = common::root().join("runtime/guide/fivebar/fivebar.yaml");
    let file = file.display().to_string();
    let options = "--harmonics 5 --frequency 0.2 --starts 1 --steps 20 --seed 3 --format json";
    let args: Vec<&str> = ["excite", file.as_str()]
        .into_iter()
        .chain(options.split(' '))
        .collect();
    let json = common::regen(&std::env::temp_dir(), &args).ended(0).json();
    let condition = json["trajectory"]["criterion"]["scaled_condition"].as_f64();
    assert!(condition.is_some_and(|condition| condition < 1e3), "{json}");
}

#[test]
fn obstacles_to_a_search_are_reported_with_their_exit_code() {
    // no range, no such coordinate, no such cone: wrong input
    let open = excite(&[]).ended(3);
    assert!(open.err.contains("--limit q1.position="), "{}", open.err);
    let unknown = excite(&["--limit", "q99.position=0,1"]).ended(3);
    assert!(unknown.err.contains("no coordinate q99"), "{}", unknown.err);
    let cone = excite(&["--cone", "q1=1"]).ended(3);
    assert!(cone.err.contains("no cone of q1"), "{}", cone.err);
    excite(&["--limit", "q1.position=1"]).ended(2);
    // a range without any state far enough from a singularity: no trajectory
    let narrow = [
        "--limit", LIMITS[0], "--limit", LIMITS[1], "--margin", "1000",
    ];
    let none = excite(&narrow).ended(4);
    assert!(
        none.err.contains("distance from singularities"),
        "{}",
        none.err
    );
}

/// A search with very many starts, interrupted after the given number of seconds.
#[cfg(unix)]
fn interrupted(dir: &Path, seconds: u64) -> (Option<i32>, String) {
    let spec = robots().join("../runtime/guide/fivebar/fivebar.yaml");
    let spec = spec.to_str().unwrap();
    let args = "--harmonics 2 --samples 20 --frequency 0.5 --steps 3 --starts 100000 --threads 1 \
                --out t.json";
    let args = ["excite", spec].into_iter().chain(args.split_whitespace());
    let child = common::command(dir, &args.collect::<Vec<_>>())
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(std::time::Duration::from_secs(seconds));
    let asked = std::process::Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(asked.success());
    let output = child.wait_with_output().unwrap();
    (
        output.status.code(),
        String::from_utf8(output.stderr).unwrap(),
    )
}

#[cfg(unix)]
#[test]
fn an_interrupted_search_ends_by_itself_and_writes_its_best_trajectory() {
    let dir = common::scratch("excite_interrupted");
    // On a busy machine the search may not have begun: it is repeated with more time.
    let ended = [2, 8, 32]
        .into_iter()
        .map(|seconds| interrupted(&dir, seconds))
        .find(|(_, told)| !told.is_empty() && dir.join("t.json").exists());
    let (code, told) = ended.expect("a search that winds down");
    assert_eq!(code, Some(130), "{told}");
    assert!(
        told.contains("interrupted: the best so far is written to t.json"),
        "{told}"
    );
}
