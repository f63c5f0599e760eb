//! Constant efforts of joints: their columns, their place in the base, and random mechanisms with
//! them against the second derivation.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use regen_codegen::signature::FunctionKind;
use regen_tests::base::Derivation;
use regen_tests::derived::Derived;
use regen_tests::engine::Engine;
use regen_tests::random_checks::{agrees_with_reference, has_numeric_rank, trees_and_loops};
use regen_tests::reference::Mechanism;

/// A slide with a geared motor beside it: m = 3 x, with offsets of both.
const GEARED: &str = "\
name: geared
limbs:
  - name: slide
    joints:
      - {name: x, type: prismatic, body: cart, actuated: true, offset: true}
  - name: drive
    base: {xyz: [1, 0, 0]}
    joints:
      - {name: m, type: revolute, body: rotor, friction: stribeck, offset: true, rotor_inertia: true}
couplings: {m: 3*x}
";

#[test]
fn the_regressor_of_a_geared_pair_is_that_computed_by_hand() {
    let engine = Derived::new("geared.yaml", GEARED).unwrap();
    let names = engine.names();
    let parameters = &names.parameters;
    let last: Vec<&str> = parameters
        .iter()
        .rev()
        .take(3)
        .map(String::as_str)
        .collect();
    assert_eq!(last, ["J(m)", "Fo(m)", "Fo(x)"]);
    let (q, qd, qdd) = ([0.2, 0.6], [-0.7, -2.1], [0.5, 1.5]);
    let w = engine
        .matrix(FunctionKind::Regressor, &[&q, &qd, &qdd])
        .unwrap();
    let at = |label: &str| parameters.iter().position(|p| p == label).unwrap();
    // virtual work: Fo(x) dx + Fo(m) dm with dm = 3 dx, whatever the motion
    assert!((w[(0, at("Fo(x)"))] - 1.0).abs() < 1e-15);
    assert!((w[(0, at("Fo(m)"))] - 3.0).abs() < 1e-15);

    let mut phi = vec![0.0; parameters.len()];
    phi[at("Fo(x)")] = -0.4;
    phi[at("Fo(m)")] = 0.3;
    let total = -0.4 + 3.0 * 0.3;
    let gravity = engine.call(FunctionKind::Gravity, &[&q, &phi]).unwrap();
    assert!((gravity[0] - total).abs() < 1e-15, "it remains at rest");
    let bias = engine
        .call(FunctionKind::BiasForces, &[&q, &qd, &phi])
        .unwrap();
    assert!(bias[0].abs() < 1e-15, "no velocity causes it");
}

/// Adds offsets to some joints of a random spec: those with a rotor, and those with asymmetric
/// friction, whose offset is not identifiable by itself.
fn with_offsets(text: &str) -> String {
    let lines = text.lines().map(|line| {
        if line.contains("rotor_inertia: true") || line.contains("asymmetric") {
            line.replace(", rotor_inertia:", ", offset: true, rotor_inertia:")
        } else {
            line.to_owned()
        }
    });
    lines.collect::<Vec<_>>().join("\n") + "\n"
}

#[test]
fn random_mechanisms_with_offsets_agree_with_the_second_derivation() {
    let mut offsets = 0;
    for (seed, random) in trees_and_loops(8, 8).unwrap() {
        let text = with_offsets(&random.text);
        let mechanism = Mechanism::from_yaml(&text).unwrap();
        offsets += mechanism.offset.iter().filter(|o| **o).count();
        agrees_with_reference(&mechanism, &text, seed).unwrap_or_else(|e| panic!("{e}"));
    }
    assert!(offsets > 10, "{offsets}");
}

#[test]
fn the_base_of_random_mechanisms_with_offsets_has_the_rank_of_singular_values() {
    for (seed, mut random) in trees_and_loops(10, 5).unwrap() {
        random.text = with_offsets(&random.text);
        let derivation = if random.is_tree {
            Derivation::new(&random.text).unwrap()
        } else {
            Derivation::completed(&random.text).unwrap()
        };
        has_numeric_rank(&derivation, &random, seed, 1e-10).unwrap_or_else(|e| panic!("{e}"));
    }
}
