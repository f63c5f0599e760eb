//! The engine's functions for random mechanisms, compared with the second derivation.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use regen_tests::derived::Derived;
use regen_tests::engine::{ORACLES, check_engine, check_oracle};
use regen_tests::reference::Mechanism;
use regen_tests::{files, random_spec};

/// Checks random specs; a failure prints the spec.
fn check_random(specs: impl Iterator<Item = String>) {
    for (seed, spec) in (0..).zip(specs) {
        let mechanism = Mechanism::from_yaml(&spec).unwrap();
        let derived =
            Derived::without_base("random.yaml", &spec).unwrap_or_else(|e| panic!("{e}\n{spec}"));
        let checked = check_engine(&derived, &mechanism, seed, 2);
        checked.unwrap_or_else(|e| panic!("{e}\n{spec}"));
    }
}

#[test]
fn random_trees_agree_with_the_second_derivation() {
    check_random((0..15).map(random_spec::tree));
}

#[test]
fn random_loops_agree_with_the_second_derivation() {
    check_random((0..30).map(|seed| random_spec::closed_loop(seed).unwrap()));
}

#[test]
fn random_screws_agree_with_the_second_derivation() {
    check_random((0..8).map(random_spec::screw_tree));
    check_random((0..16).map(|seed| random_spec::screw_loop(seed).unwrap()));
}

#[test]
fn derived_functions_agree_with_the_published_vectors_to_1e_11() {
    for name in ORACLES {
        let file = files::oracle().join(format!("{name}.yaml"));
        check_oracle(&Derived::from_file(&file).unwrap(), name).unwrap();
    }
}
