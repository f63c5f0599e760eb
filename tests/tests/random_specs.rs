//! Some hundred random mechanisms: every comparison with the second derivation, closure rows
//! against finite differences, the closure along a path and back, invalid variants.
//! `tests/records/random.md` records a run of ten thousand.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::collections::{BTreeMap, BTreeSet};

use regen_tests::derived::Derived;
use regen_tests::engine::check_pair;
use regen_tests::random::{self, Sample, TOPOLOGIES, cut_word};
use regen_tests::{files, reference::Mechanism, sample_size};

/// The number of seeds: `RANDOM_SPECS`, or by default the first part of the seeds of `.ci/full`.
fn seeds() -> u64 {
    let asked = std::env::var("RANDOM_SPECS").ok();
    let usual = sample_size(240, 30);
    asked.and_then(|n| n.parse().ok()).unwrap_or(usual)
}

fn sample(seed: u64) -> Sample {
    random::sample(seed).sample.unwrap()
}

/// Checks every fourth seed, so that the four tests run in parallel; a failing spec is shrunk and
/// printed.
fn check_seeds(first: u64) {
    for seed in (first..seeds()).step_by(4) {
        let sample = sample(seed);
        if let Err(error) = random::check_sample(&sample, seed, 1) {
            let small = random::shrink(sample, &|s| random::check_sample(s, seed, 1).is_err());
            panic!("seed {seed}: {error}\n{}", small.text);
        }
    }
}

#[test]
fn random_mechanisms_agree_with_the_second_derivation_1() {
    check_seeds(0);
}

#[test]
fn random_mechanisms_agree_with_the_second_derivation_2() {
    check_seeds(1);
}

#[test]
fn random_mechanisms_agree_with_the_second_derivation_3() {
    check_seeds(2);
}

#[test]
fn random_mechanisms_agree_with_the_second_derivation_4() {
    check_seeds(3);
}

#[test]
fn bad_variants_of_random_mechanisms_give_errors_at_the_mistake() {
    for seed in 0..seeds().max(240) / 10 {
        random::check_invalid_variants(&sample(seed), seed)
            .unwrap_or_else(|e| panic!("seed {seed}: {e}"));
    }
}

/// Checks the specs of a folder of `fixtures/random/`.
fn check_folder(folder: &str) {
    let folder = files::fixtures().join("random").join(folder);
    for path in files::list(&folder, "yaml").unwrap() {
        let text = std::fs::read_to_string(&path).unwrap();
        let mechanism = Mechanism::from_yaml(&text).unwrap();
        // A number at the end of the file's name is a seed for which states or paths failed.
        let stem = path.file_stem().unwrap().to_str().unwrap();
        let failed_seed = stem.rsplit('_').next().unwrap().parse::<u64>().ok();
        for seed in (0..2).chain(failed_seed) {
            random::check_text(&text, &mechanism, seed, 1)
                .unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        }
    }
}

#[test]
fn every_kind_of_part_is_drawn() {
    let mut drawn = BTreeSet::new();
    for seed in 0..300 {
        let sample = sample(seed);
        let (draft, mechanism) = (&sample.draft, &sample.mechanism);
        drawn.insert(draft.topology.to_owned());
        drawn.insert(draft.group.to_owned());
        for joint in draft.joints() {
            drawn.insert(format!("joint {}", joint.kind.word()));
            drawn.insert(format!("friction {}", joint.friction));
            drawn.insert(format!("body {}", joint.body.is_some()));
        }
        for cut in &draft.cuts {
            let moving = cut.a.body.is_some() && cut.b.is_some();
            drawn.insert(format!("cut {} {moving}", cut_word(cut.kind)));
        }
        drawn.insert(format!("couplings {}", !draft.couplings.is_empty()));
        let (motors, freedoms) = (mechanism.actuated.len(), mechanism.dof());
        drawn.insert(format!("motors {:?}", motors.cmp(&freedoms)));
    }
    let mut expected: BTreeSet<String> = TOPOLOGIES.map(String::from).into();
    let groups = ["space", "plane", "sphere", "translation", "schoenflies"];
    expected.extend(groups.map(String::from));
    expected.extend(random::Kind::ALL.map(|k| format!("joint {}", k.word())));
    for friction in [
        "none",
        "viscous",
        "coulomb",
        "linear",
        "coulomb_asymmetric",
        "asymmetric",
        "stribeck",
        "atan",
        "power",
    ] {
        expected.insert(format!("friction {friction}"));
    }
    for place in ["true", "false"] {
        expected.insert(format!("body {place}"));
        expected.insert(format!("couplings {place}"));
        for cut in [
            "spherical",
            "universal",
            "revolute",
            "prismatic",
            "helical",
            "cylindrical",
            "fixed",
        ] {
            expected.insert(format!("cut {cut} {place}"));
        }
    }
    for order in ["Less", "Equal", "Greater"] {
        expected.insert(format!("motors {order}"));
    }
    let missing: Vec<_> = expected.difference(&drawn).collect();
    assert!(missing.is_empty(), "{missing:?}");
}

/// Specs that failed once, with a comment on the failure.
#[test]
fn specs_that_failed_once_agree_with_the_second_derivation() {
    check_folder("kept");
}

/// Specs made by hand: nested loops, passive spin, gears in a loop on an arm.
#[test]
fn nasty_mechanisms_agree_with_the_second_derivation() {
    check_folder("nasty");
}

/// A mechanism with a cut's joint in the tree and a rigid cut behind it is the same mechanism: for
/// every kind of cut, on the world and on two moving bodies.
#[test]
fn a_loop_opened_elsewhere_has_the_same_regressor() {
    let mut pairs: BTreeMap<String, usize> = BTreeMap::new();
    for seed in 0..400 {
        let sample = sample(seed);
        for (at, cut) in sample.draft.cuts.iter().enumerate() {
            let moving = cut.a.body.is_some() && cut.b.is_some();
            let place = if moving { "two bodies" } else { "the world" };
            let count = pairs
                .entry(format!("{} on {place}", cut_word(cut.kind)))
                .or_default();
            if *count == 1 {
                continue;
            }
            *count += 1;
            let (text, mechanism) = random::opened_elsewhere(&sample, at).unwrap();
            let first = Derived::without_base("first.yaml", &sample.text).unwrap();
            let second = Derived::without_base("second.yaml", &text)
                .unwrap_or_else(|e| panic!("seed {seed}: {e}\n{text}"));
            check_pair((&first, &sample.mechanism), (&second, &mechanism), seed, 1)
                .unwrap_or_else(|e| panic!("seed {seed}: {e}\n{}\n{text}", sample.text));
        }
    }
    assert_eq!(pairs.len(), 14, "seven kinds at two places: {pairs:?}");
    assert!(pairs.values().all(|n| *n == 1), "{pairs:?}");
}

#[test]
fn a_seed_gives_the_same_spec_every_time() {
    assert_eq!(sample(5).text, sample(5).text);
    assert_ne!(sample(5).text, sample(6).text);
}
