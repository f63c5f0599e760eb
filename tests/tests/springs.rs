//! Springs, constant pulls and effort terms: their columns by hand, against the second derivation on
//! random mechanisms, and the rank of the base beside singular values.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;

use regen_codegen::signature::FunctionKind;
use regen_tests::base::Derivation;
use regen_tests::derived::Derived;
use regen_tests::engine::Engine;
use regen_tests::random_checks::{agrees_with_reference, has_numeric_rank, trees_and_loops};
use regen_tests::reference::Mechanism;

/// A pendulum with a spring from its tip to a point above its pivot, as in a desk lamp.
const LAMP: &str = "\
name: lamp
limbs:
  - name: arm
    base: {rpy: [pi/2, 0, 0]}
    joints:
      - {name: q, type: revolute, body: arm, actuated: true, spring: {rest: 0.25}, terms: {cog: cos(4*q), drag: abs(qd)*qd, mixed: (1 + qd)*q^2}}
springs:
  - {name: long, between: [{body: arm, xyz: [0.4, 0, 0]}, {body: world, xyz: [0, 0, 0.3]}], length: 0.1}
  - {name: open, between: [{body: arm, xyz: [0.4, 0, 0]}, {body: world, xyz: [0, 0, 0.3]}]}
  - {name: gas, between: [{body: arm, xyz: [0.4, 0, 0]}, {body: world, xyz: [0, 0, 0.3]}], constant: true}
";

#[test]
fn the_columns_of_a_lamp_are_those_computed_by_hand() {
    let engine = Derived::new("lamp.yaml", LAMP).unwrap();
    let parameters = engine.names().parameters;
    let labels: Vec<&str> = parameters[10..].iter().map(String::as_str).collect();
    let expected = [
        "K(q)", "cog(q)", "drag(q)", "mixed(q)", "k(long)", "k(open)", "kl(open)", "f(gas)",
    ];
    assert_eq!(labels, expected);
    let (q, qd, qdd) = (0.7_f64, -1.3, 0.4);
    let w = engine
        .matrix(FunctionKind::Regressor, &[&[q], &[qd], &[qdd]])
        .unwrap();
    // the law of cosines: d^2 = a^2 + b^2 - 2 a b sin(q), since q is counted from the horizontal
    let (a, b) = (0.4, 0.3);
    let d = (a * a + b * b - 2.0 * a * b * q.sin()).sqrt();
    let slope = -a * b * q.cos() / d;
    let by_hand = [
        q - 0.25,
        (4.0 * q).cos(),
        qd.abs() * qd,
        (1.0 + qd) * q * q,
        (d - 0.1) * slope,
        d * slope,
        -slope,
        slope,
    ];
    for (k, expected) in by_hand.iter().enumerate() {
        let found = w[(0, 10 + k)];
        assert!((found - expected).abs() < 1e-14, "{}: {found}", labels[k]);
    }
    // gravity includes every effort at rest: all but the drag, and q^2 of the mixed term; the bias
    // forces are the rest
    let phi: Vec<f64> = (0..18).map(|k| if k < 10 { 0.0 } else { 1.0 }).collect();
    let gravity = engine.call(FunctionKind::Gravity, &[&[q], &phi]).unwrap()[0];
    let bias = engine
        .call(FunctionKind::BiasForces, &[&[q], &[qd], &phi])
        .unwrap()[0];
    let at_rest: f64 = by_hand.iter().sum::<f64>() - by_hand[2] - qd * q * q;
    assert!((gravity - at_rest).abs() < 1e-13, "{gravity} {at_rest}");
    assert!((bias - by_hand[2] - qd * q * q).abs() < 1e-13, "{bias}");
}

/// Adds springs and effort terms to a random spec: both at all joints that move, and springs
/// between the world and some bodies and between two bodies.
fn with_springs(text: &str, rates: bool) -> String {
    let drag = if rates { ", drag: abs(qd)*qd*q" } else { "" };
    let keys = format!(
        ", spring: {{rest: 0.3}}, terms: {{soft: q^3, cog: sin(3*q){drag}}}, rotor_inertia:"
    );
    let mut out = text.replace(", rotor_inertia:", &keys);
    let mechanism = Mechanism::from_yaml(text).unwrap();
    out.push_str("springs:\n");
    for (k, body) in mechanism.bodies.iter().enumerate().take(3) {
        let force = ["length: 0.15", "constant: true", "nominal: {k: 2, kl: 0.5}"][k % 3];
        let label = &body.label;
        writeln!(
            out,
            "  - {{name: s{k}, between: [{{body: world, xyz: [2, 1, 0.{k}5]}}, \
             {{body: {label}, xyz: [0.1, -0.2, 0.3]}}], {force}}}"
        )
        .unwrap();
    }
    if let [first, .., last] = &mechanism.bodies[..] {
        writeln!(
            out,
            "  - {{name: inner, between: [{{body: {}, xyz: [0.3, 0.2, 2]}}, \
             {{body: {}, xyz: [0.1, 0, -3]}}], length: 1}}",
            last.label, first.label
        )
        .unwrap();
    }
    out
}

#[test]
fn random_mechanisms_with_springs_agree_with_the_second_derivation() {
    let mut springs = 0;
    for (seed, random) in trees_and_loops(6, 6).unwrap() {
        let text = with_springs(&random.text, seed % 2 == 0);
        let mechanism = Mechanism::from_yaml(&text).unwrap();
        springs += mechanism.springs.len() + mechanism.terms.len();
        agrees_with_reference(&mechanism, &text, seed).unwrap_or_else(|e| panic!("{e}"));
    }
    assert!(springs > 40, "{springs}");
}

#[test]
fn the_base_of_random_mechanisms_with_springs_has_the_rank_of_singular_values() {
    for (seed, mut random) in trees_and_loops(3, 2).unwrap() {
        random.text = with_springs(&random.text, seed % 2 == 0);
        let derivation = Derivation::completed(&random.text).unwrap();
        has_numeric_rank(&derivation, &random, seed, 1e-9).unwrap_or_else(|e| panic!("{e}"));
    }
}
