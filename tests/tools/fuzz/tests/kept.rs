//! Runs every reader on the inputs in `kept/`, on the repository's own files, and on random
//! mutations of both. The long runs are those of the fuzz targets; `kept/` contains the inputs that
//! they found.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::{Path, PathBuf};

/// The length of the longest file that is used, bytes; other tests read longer files.
const MAX_SEED_BYTES: u64 = 4000;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../..")
}

/// The short files of a directory, in the order of their names, with these extensions, or all if
/// none is given.
fn files(directory: &str, kinds: &[&str]) -> Vec<Vec<u8>> {
    let path = root().join(directory);
    let Ok(entries) = fs::read_dir(&path) else {
        return Vec::new();
    };
    let mut paths: Vec<PathBuf> = entries.map(|e| e.unwrap().path()).collect();
    paths.retain(|path| {
        let kind = path.extension().and_then(|e| e.to_str()).unwrap_or("");
        path.is_file()
            && (kinds.is_empty() || kinds.contains(&kind))
            && fs::metadata(path).unwrap().len() <= MAX_SEED_BYTES
    });
    paths.sort();
    paths.iter().map(|path| fs::read(path).unwrap()).collect()
}

/// A generator of pseudo-random numbers (splitmix64).
struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % bound.max(1) as u64) as usize
    }
}

/// Pieces of text that are significant to one of the readers.
const PIECES: [&[u8]; 28] = [
    b"{",
    b"}",
    b"[",
    b"]",
    b": ",
    b"\n",
    b",",
    b"\"",
    b"&a ",
    b"*a",
    b"<<: ",
    b"(",
    b")",
    b"^",
    b"sqrt(",
    b"1e999",
    b"1e-400",
    b"nan",
    b"-1",
    b"0",
    b"pi",
    b"\0",
    b"\xff\xff\xff\xff\x7f",
    b"\xef\xbb\xbf",
    b"<",
    b"/>",
    b"&#0;",
    b"9999999999999999999",
];

/// One of the inputs after one to four random changes.
fn mutated(seeds: &[Vec<u8>], random: &mut Random) -> Vec<u8> {
    let mut bytes = seeds[random.below(seeds.len())].clone();
    for _ in 0..=random.below(4) {
        let at = random.below(bytes.len() + 1);
        let end = (at + 1 + random.below(24)).min(bytes.len());
        match random.below(6) {
            0 if at < bytes.len() => bytes[at] ^= 1 << random.below(8),
            1 if at < bytes.len() => bytes[at] = random.below(256) as u8,
            2 => drop(bytes.drain(at..end)),
            3 => {
                let piece = bytes[at..end].to_vec();
                let to = random.below(bytes.len() + 1);
                bytes.splice(to..to, piece);
            }
            4 => {
                let other = &seeds[random.below(seeds.len())];
                let from = random.below(other.len() + 1);
                bytes.truncate(at);
                bytes.extend(&other[from..]);
            }
            _ => drop(bytes.splice(at..at, PIECES[random.below(PIECES.len())].iter().copied())),
        }
    }
    bytes
}

/// Runs a target on all its inputs in `kept/`, on these files of the repository, and on mutations.
#[track_caller]
fn run_target(target: &str, own: &[(&str, &[&str])], mutations: usize) {
    let (_, run) = regen_fuzz::TARGETS
        .into_iter()
        .find(|(name, _)| *name == target)
        .unwrap();
    let mut seeds = files(&format!("tests/tools/fuzz/kept/{target}"), &[]);
    let kept = seeds.len();
    for (directory, kinds) in own {
        seeds.extend(files(directory, kinds));
    }
    assert!(kept > 1, "{target}: {kept} kept");
    for seed in &seeds {
        run(seed);
    }
    let mut random = Random(1);
    for _ in 0..mutations {
        run(&mutated(&seeds, &mut random));
    }
}

#[test]
fn every_description_is_read_or_refused() {
    let own: [(&str, &[&str]); 3] = [
        ("tests/fixtures/invalid", &["yaml"]),
        ("tests/fixtures/oracle", &["yaml"]),
        ("tests/fixtures/mechanisms", &["yaml"]),
    ];
    run_target("yaml", &own, 1500);
}

#[test]
fn every_expression_has_a_value_or_an_error() {
    run_target("expression", &[], 3000);
}

#[test]
fn every_short_description_is_derived_or_refused() {
    run_target("derive", &[("tests/fixtures/mechanisms", &["yaml"])], 60);
}

#[test]
fn every_short_description_is_refused_or_becomes_c_that_compiles() {
    let derived = ("tests/tools/fuzz/kept/derive", &["yaml"][..]);
    run_target("c", &[derived], 40);
}

#[test]
fn every_csv_log_gives_equations_or_an_error() {
    run_target("csv", &[], 1500);
}

#[test]
fn every_parquet_log_gives_equations_or_an_error() {
    let lists = (
        "tests/fixtures/bags/lerobot/data/chunk-000",
        &["parquet"][..],
    );
    run_target("parquet", &[lists], 3000);
}

#[test]
fn every_recording_gives_equations_or_an_error() {
    run_target("bag", &[("tests/fixtures/bags", &["mcap"])], 1500);
}

#[test]
fn every_file_of_arrays_gives_equations_or_an_error() {
    run_target("arrays", &[("tests/fixtures/arrays", &[])], 3000);
}

#[test]
fn every_robot_file_of_other_programs_is_imported_or_refused() {
    run_target(
        "import",
        &[
            ("tests/fixtures/import/gymnasium-robotics", &["xml"]),
            ("tests/fixtures/import/closed", &["usda"]),
        ],
        300,
    );
}

#[test]
fn every_factor_file_is_read_or_refused() {
    run_target("factors", &[], 500);
}

#[test]
fn every_experiment_file_is_read_or_refused() {
    run_target("experiment", &[("robots/measured", &["yaml"])], 1500);
}

#[test]
fn each_target_of_cargo_fuzz_calls_its_reader() {
    for (name, _) in regen_fuzz::TARGETS {
        let text =
            fs::read_to_string(root().join(format!("tests/tools/fuzz/fuzz_targets/{name}.rs")))
                .unwrap();
        assert!(
            text.contains(&format!("regen_fuzz::{name}(input)")),
            "{text}"
        );
    }
}
