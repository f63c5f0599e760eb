//! Every feature of the spec's format, one per row, with a spec that has it and one that does not.
//! The second derivation gives different results for the two, and the engine agrees with it on
//! both, which it could not if it ignored the feature.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;

use regen_codegen::diag::Source;
use regen_codegen::spec::{self, Spec};
use regen_tests::derived::Derived;
use regen_tests::engine::{Engine, Naive, check_engine};
use regen_tests::reference::Mechanism;

/// A feature, the piece of the spec without it, and the same piece with it.
type Row = (&'static str, &'static str, &'static str);

const TREE: &str = "\
name: plain
limbs:
  - name: limb1
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true}
      - {name: q2, type: revolute, dh: {a: 0.3}, body: 2, actuated: true}
  - name: limb2
    joints:
      - {name: q3, type: revolute, dh: {d: 0.1}, body: 3, actuated: true}
";

const TREE_FEATURES: [Row; 48] = [
    ("gravity", "limbs:", "gravity: [1, -2, -9]\nlimbs:"),
    ("geometry", "a: 0.3", "a: 2*l"),
    ("geometry in terms of earlier names", "a: 0.3", "a: m"),
    ("from a body", "name: limb2", "name: limb2\n    from: 2"),
    (
        "from a body of a later limb",
        "name: limb1",
        "name: limb1\n    from: 3",
    ),
    (
        "base, xyz",
        "name: limb2",
        "name: limb2\n    base: {xyz: [0.1, 0.2, 0.3]}",
    ),
    (
        "base, rpy",
        "name: limb2",
        "name: limb2\n    base: {rpy: [0.1, 0.2, 0.3]}",
    ),
    ("order of limbs", "name: q3", "name: q0"),
    (
        "type prismatic",
        "q2, type: revolute",
        "q2, type: prismatic",
    ),
    (
        "type cylindrical",
        "q2, type: revolute",
        "q2, type: cylindrical",
    ),
    (
        "type universal",
        "q2, type: revolute",
        "q2, type: universal",
    ),
    (
        "type spherical",
        "q2, type: revolute",
        "q2, type: spherical",
    ),
    (
        "type fixed",
        "q2, type: revolute, dh: {a: 0.3}, body: 2, actuated: true",
        "q2, type: fixed, dh: {a: 0.3}, body: 2",
    ),
    (
        "fixed without a name",
        "name: q2, type: revolute, dh: {a: 0.3}, body: 2, actuated: true",
        "type: fixed, dh: {a: 0.3}, body: 2",
    ),
    ("dh, alpha", "dh: {a: 0.3}", "dh: {a: 0.3, alpha: 0.4}"),
    ("dh, a", "dh: {a: 0.3}", "dh: {a: 0.4}"),
    ("dh, d", "dh: {a: 0.3}", "dh: {a: 0.3, d: 0.4}"),
    ("dh, theta", "dh: {a: 0.3}", "dh: {a: 0.3, theta: 0.4}"),
    (
        "dh, a before theta",
        "dh: {a: 0.3}",
        "dh: {a: 0.3, theta: pi}",
    ),
    (
        "origin, xyz",
        "dh: {a: 0.3}",
        "origin: {xyz: [0.3, 0.1, 0]}",
    ),
    (
        "origin, rpy",
        "dh: {a: 0.3}",
        "origin: {xyz: [0.3, 0, 0], rpy: [0.1, 0.2, 0.3]}",
    ),
    ("axis x", "dh: {a: 0.3}", "dh: {a: 0.3}, axis: x"),
    ("axis y", "dh: {a: 0.3}", "dh: {a: 0.3}, axis: y"),
    (
        "axis x of a prismatic joint",
        "q2, type: revolute",
        "q2, axis: x, type: prismatic",
    ),
    (
        "massless body",
        "name: q1, type: revolute, body: 1",
        "name: q1, type: revolute",
    ),
    ("label of a body", "body: 2", "body: wrist"),
    ("actuated", "body: 2, actuated: true}", "body: 2}"),
    ("friction viscous", "body: 2", "body: 2, friction: viscous"),
    ("friction coulomb", "body: 2", "body: 2, friction: coulomb"),
    ("friction linear", "body: 2", "body: 2, friction: linear"),
    (
        "friction coulomb_asymmetric",
        "body: 2",
        "body: 2, friction: coulomb_asymmetric",
    ),
    (
        "friction asymmetric",
        "body: 2",
        "body: 2, friction: asymmetric",
    ),
    ("offset", "body: 2", "body: 2, offset: true"),
    ("rotor_inertia", "body: 2", "body: 2, rotor_inertia: true"),
    (
        "independent, in another order",
        "limbs:",
        "independent: [q3, q1, q2]\nlimbs:",
    ),
    ("couplings", "body: 2, actuated: true}", "body: 2}"),
    ("expression: product and quotient", "a: 0.3", "a: 0.3*4/5"),
    (
        "expression: sum and difference",
        "a: 0.3",
        "a: 0.3 + 0.4 - 0.2",
    ),
    ("expression: power", "a: 0.3", "a: 0.3^2"),
    (
        "expression: minus binds less than a power",
        "a: 0.3",
        "a: -0.3^2",
    ),
    (
        "expression: powers associate to the right",
        "a: 0.3",
        "a: 0.9^2^3",
    ),
    ("expression: sqrt", "a: 0.3", "a: sqrt(0.3)"),
    ("expression: sin", "a: 0.3", "a: sin(0.2)"),
    ("expression: cos", "a: 0.3", "a: cos(0.2)"),
    ("expression: tan", "a: 0.3", "a: tan(0.2)"),
    ("expression: deg", "a: 0.3", "a: deg(20)"),
    ("expression: pi", "a: 0.3", "a: pi/7"),
    ("expression: exponent", "a: 0.3", "a: 2e-1"),
];

/// A chain of eight revolute joints, straight at home, whose end is cut to a frame on the ground,
/// with the first well-conditioned choice of `freedoms` independent coordinates.
fn chain(cut: &str, freedoms: usize) -> String {
    let mut text = "name: chain\nlimbs:\n  - name: limb1\n    joints:\n".to_owned();
    for (at, axis) in ["z", "y", "x", "z", "y", "x", "y", "z"].iter().enumerate() {
        let n = at + 1;
        let _ = writeln!(
            text,
            "      - {{name: q{n}, type: revolute, axis: {axis}, origin: {{xyz: [0.2, {}, {}]}}, body: {n}}}",
            [0.1, -0.2, 0.15, 0.0][at % 4],
            [0.0, 0.1, -0.1][at % 3],
        );
    }
    let _ = writeln!(text, "cuts:\n  - {{name: c, {cut}}}");
    let choices = (0..256_u32).filter(|set| set.count_ones() as usize == freedoms);
    let mut specs = choices.map(|set| {
        let names = (0..8).filter(|k| set & (1 << k) != 0);
        let names: Vec<String> = names.map(|k| format!("q{}", k + 1)).collect();
        format!("{text}independent: [{}]\n", names.join(", "))
    });
    specs
        .find(|spec| {
            let mechanism = Mechanism::from_yaml(spec).unwrap();
            let home = mechanism.home();
            home.is_ok_and(|home| mechanism.conditioning(&home) > 0.004)
        })
        .unwrap_or_else(|| panic!("{cut}: no choice"))
}

const CLOSED: &str = "between: [{body: 8}, {body: world, xyz: [1.6, 0.1, 0.1]}]";

/// The kinds of cuts, with the mobility of the chain with each.
const CUTS: [(&str, usize); 6] = [
    ("spherical", 5),
    ("universal", 4),
    ("cylindrical", 4),
    ("revolute", 3),
    ("prismatic", 3),
    ("fixed", 2),
];

/// Cuts that differ in one feature from a spherical cut at the end.
const CUT_FEATURES: [(&str, &str); 5] = [
    (
        "between: xyz of frame A",
        "joint: spherical, between: [{body: 8, xyz: [0.1, 0, 0]}, {body: world, xyz: [1.7, 0.1, 0.1]}]",
    ),
    (
        "between: another body",
        "joint: spherical, between: [{body: 7}, {body: world, xyz: [1.4, 0.0, 0.0]}]",
    ),
    (
        "between: the world first",
        "joint: spherical, between: [{body: world, xyz: [1.6, 0.1, 0.1]}, {body: 8}]",
    ),
    (
        "between: two moving bodies",
        "joint: spherical, between: [{body: 8}, {body: 1, xyz: [1.4, 0.0, 0.1]}]",
    ),
    (
        "between: rpy",
        "joint: universal, between: [{body: 8, rpy: [0, 0.3, 0]}, {body: world, xyz: [1.6, 0.1, 0.1], rpy: [0.2, 0, 0]}]",
    ),
];

/// All quantities of the second derivation at a fixed state, including home and names.
fn fingerprint(mechanism: &Mechanism) -> (String, Vec<f64>) {
    let n = mechanism.n();
    let number = |k: usize, step: f64| 0.3 + step * k as f64;
    let at = |step: f64| -> Vec<f64> { (0..n).map(|k| number(k, step)).collect() };
    let (q, qd, qdd) = (at(0.17), at(-0.23), at(0.31));
    let names = Naive::new(mechanism).unwrap().names();
    let mut values = mechanism.poses(&q).concat();
    values.extend(mechanism.constraints(&q));
    values.extend(mechanism.tree_regressor(&q, &qd, &qdd).iter());
    values.extend(mechanism.home().unwrap());
    (format!("{names:?}"), values)
}

/// Checks that the engine agrees with the second derivation on both specs, and that the second
/// derivation differs between them.
fn check(feature: &str, without: &str, with: &str) {
    let mut fingerprints = Vec::new();
    for text in [without, with] {
        let mechanism =
            Mechanism::from_yaml(text).unwrap_or_else(|e| panic!("{feature}: {e}\n{text}"));
        let derived = Derived::without_base("feature.yaml", text)
            .unwrap_or_else(|e| panic!("{feature}: {e}\n{text}"));
        check_engine(&derived, &mechanism, 3, 1).unwrap_or_else(|e| panic!("{feature}: {e}"));
        fingerprints.push(fingerprint(&mechanism));
    }
    let ((names, values), (other_names, other_values)) = (&fingerprints[0], &fingerprints[1]);
    let same = values.len() == other_values.len()
        && values
            .iter()
            .zip(other_values)
            .all(|(a, b)| (a - b).abs() <= 1e-9);
    assert!(names != other_names || !same, "{feature} changes nothing");
}

#[test]
fn every_feature_of_limbs_and_scalars_changes_the_results() {
    for (feature, without, with) in TREE_FEATURES {
        assert!(TREE.contains(without), "{feature}");
        let mut text = TREE.replacen(without, with, 1);
        if with.contains("2*l") || with.contains("a: m") {
            text = text.replacen("limbs:", "geometry: {l: 0.25, m: l^2}\nlimbs:", 1);
        }
        if feature == "couplings" {
            text.push_str("couplings: {q2: 0.5*q1 - q3 + 0.2}\n");
        }
        // The default independent coordinates are the actuated ones.
        if feature == "actuated" {
            text.push_str("independent: [q1, q2, q3]\n");
        }
        check(feature, TREE, &text);
    }
}

#[test]
fn every_kind_of_cut_changes_the_results() {
    let open = "name: chain\nlimbs: [{name: limb1, joints: [{name: q1, type: revolute, body: 1, actuated: true}]}]\n";
    let specs: Vec<(&str, String)> = CUTS
        .iter()
        .map(|(kind, freedoms)| (*kind, chain(&format!("joint: {kind}, {CLOSED}"), *freedoms)))
        .collect();
    // Each must differ from the one before, the first from the open chain.
    let mut before = open.to_owned();
    for (kind, spec) in specs {
        check(kind, &before, &spec);
        before = spec;
    }
}

#[test]
fn every_feature_of_cuts_and_of_home_changes_the_results() {
    let freedoms = |kind: &str| CUTS.iter().find(|c| c.0 == kind).unwrap().1;
    for (feature, cut) in CUT_FEATURES {
        let kind = if cut.contains("universal") {
            "universal"
        } else {
            "spherical"
        };
        let without = chain(&format!("joint: {kind}, {CLOSED}"), freedoms(kind));
        check(feature, &without, &chain(cut, freedoms(kind)));
    }
    // Home: the independent coordinates stay as written, the others follow.
    let plain = chain(&format!("joint: revolute, {CLOSED}"), 3);
    let (_, list) = plain.split_once("independent: [").unwrap();
    let names: Vec<&str> = list.trim_end().trim_end_matches(']').split(", ").collect();
    let home = format!("{plain}home: {{{}: 0.1}}\n", names[0]);
    check("home", &plain, &home);
    let (old, new) = (names.join(", "), [names[2], names[0], names[1]].join(", "));
    check("independent", &plain, &plain.replace(&old, &new));
}

fn parsed(text: &str) -> Spec {
    spec::parse(&Source::new("feature.yaml", text)).unwrap()
}

/// Values without a column are in the validated spec: limits, nominal values, nonlinear friction.
#[test]
fn every_value_for_simulation_is_read() {
    let with = |from: &str, to: &str| parsed(&TREE.replacen(from, to, 1));
    let joint = |spec: &Spec| spec.limbs[0].joints[1].clone();
    assert_eq!(
        with("limbs:", "description: an arm\nlimbs:")
            .description
            .as_deref(),
        Some("an arm")
    );
    let limits = "body: 2, limits: {position: [-1, 1], velocity: [-2, 2], acceleration: [-3, 3], jerk: [-5, 5], effort: [-4, 4]}";
    let limits = joint(&with("body: 2", limits)).limits;
    let upper = [
        limits.position,
        limits.velocity,
        limits.acceleration,
        limits.effort,
        limits.jerk,
    ]
    .map(|l| l.unwrap()[1].value.to_f64());
    assert_eq!(upper.map(|x| x.round() as i32), [1, 2, 3, 4, 5]);
    for kind in ["spherical", "universal"] {
        let text = format!("q2, limits: {{cone: 0.6}}, type: {kind}");
        let cone = joint(&with("q2, type: revolute", &text)).limits.cone;
        assert!((cone.unwrap().value.to_f64() - 0.6).abs() < 1e-15);
    }
    let nominal = "body: 2, friction: linear, offset: true, rotor_inertia: true, spring: {rest: 0.5}, terms: {cog: cos(q)}, nominal: {Fv: 3, Fc: 2, Fo: -1, J: 1, K: 2, cog: -1}";
    let nominal = joint(&with("body: 2", nominal)).nominal;
    let names: Vec<&str> = nominal.iter().map(|n| n.0.value.as_str()).collect();
    assert_eq!(names, ["Fv", "Fc", "Fo", "J", "K", "cog"]);
    let body = "bodies: {2: {mass: 3, com: [0.1, 0, 0], inertia: [1, 0, 0, 1, 0, 1]}}\nlimbs:";
    let bodies = with("limbs:", body).bodies;
    assert!((bodies[0].1.mass.value.to_f64() - 3.0).abs() < 1e-15);
    // Nonlinear friction is stored with the joint and has no column.
    for (word, values) in [
        ("stribeck", "Fc: 1, Fs: 2, vs: 0.1, delta: 2, Fv: 1"),
        ("atan", "Fc: 1, Fv1: 1, Fv2: 2, Fv3: 3"),
        ("power", "Fc: 1, Fv: 1, delta: 0.5"),
        ("lugre", "Fc: 1, Fs: 2, vs: 0.1, Fv: 1"),
    ] {
        let text = TREE.replacen(
            "body: 2",
            &format!("body: 2, friction: {word}, nominal: {{{values}}}"),
            1,
        );
        let friction = format!("{:?}", joint(&parsed(&text)).friction).to_lowercase();
        assert_eq!(friction, word);
        let plain = Derived::without_base("plain.yaml", TREE).unwrap().names();
        let names = Derived::without_base("friction.yaml", &text)
            .unwrap()
            .names();
        assert_eq!(names.parameters, plain.parameters, "{word} adds no column");
    }
}

/// Choices about the base parameters change only these.
#[test]
fn every_choice_about_base_parameters_changes_them() {
    let labels = |choice: &str| -> Vec<String> {
        let text = TREE.replacen("limbs:", &format!("{choice}limbs:"), 1);
        let derived = Derived::new("base.yaml", &text).unwrap();
        let base = &derived.robot.analysis.unwrap().base;
        let kept = base.parameters.iter().filter(|p| !p.dropped);
        kept.map(|p| derived.robot.parameters[p.column].label.clone())
            .collect()
    };
    let plain = labels("");
    assert!(plain.contains(&"Izz(1)".to_owned()), "{plain:?}");
    let eliminated = labels("base: {eliminate: [mx(2)]}\n");
    assert_eq!(plain.len(), eliminated.len());
    let zero = labels("base: {zero: [mx(2)]}\n");
    assert_eq!(zero.len() + 1, plain.len());
    let equal = labels("base: {equal: [[2, 3]]}\n");
    assert_ne!(equal, plain);
    let dropped = labels(&format!("base: {{drop: ['{}']}}\n", plain[0]));
    assert_eq!(dropped, plain[1..]);
}
