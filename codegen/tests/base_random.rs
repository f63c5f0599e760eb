//! Random trees with special and with skew geometry: layer 1 finds as many base parameters as
//! random states show.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;

use crate::base_support::{base, evaluate};
use proptest::prelude::*;
use regen_codegen::base::certificate::certify;

/// A joint with its placement.
#[derive(Clone, Debug)]
struct RandomJoint {
    kind: &'static str,
    axis: &'static str,
    xyz: [&'static str; 3],
    rpy: [&'static str; 3],
    massless: bool,
    rotor: bool,
    friction: &'static str,
}

#[derive(Clone)]
struct RandomTree {
    gravity: &'static str,
    joints: Vec<RandomJoint>,
    /// Index of the first joint of a second limb, and the body of the first limb, or the ground, on
    /// which it starts.
    branch: Option<(usize, usize)>,
}

/// Zero and right angles most of the time, so that axes meet, are parallel or coincide; also angles
/// in rational proportion, and skew ones.
fn angle() -> impl Strategy<Value = &'static str> {
    prop_oneof![
        6 => Just("0"),
        3 => prop::sample::select(vec!["pi/2", "-pi/2", "pi"]),
        1 => prop::sample::select(vec!["pi/3", "pi/4", "0.3", "-0.6", "0.9", "1.234"]),
    ]
}

/// Geometry names, of which two are equal by value and two are multiples.
fn length() -> impl Strategy<Value = &'static str> {
    prop_oneof![
        6 => Just("0"),
        3 => prop::sample::select(vec!["a", "b", "-a", "2*c"]),
        1 => prop::sample::select(vec!["0.17", "a - b", "sqrt(c)", "-0.41", "a*c"]),
    ]
}

prop_compose! {
    fn joint()(
        kind in prop_oneof![
            6 => Just("revolute"),
            3 => Just("prismatic"),
            1 => prop::sample::select(vec!["cylindrical", "universal", "spherical", "fixed"]),
        ],
        axis in prop::sample::select(vec!["z", "x", "y"]),
        xyz in [length(), length(), length()],
        rpy in [angle(), angle(), angle()],
        massless in prop::bool::weighted(0.2),
        rotor in prop::bool::weighted(0.3),
        friction in prop_oneof![
            6 => Just("none"),
            1 => prop::sample::select(vec!["viscous", "linear", "coulomb_asymmetric", "asymmetric"]),
        ],
    ) -> RandomJoint {
        RandomJoint { kind, axis, xyz, rpy, massless, rotor, friction }
    }
}

prop_compose! {
    fn tree()(
        gravity in prop::sample::select(vec![
            "0, 0, -9.81", "0, 0, -9.81", "0, -9.81, 0", "0, 0, 0", "1.2, -3.4, -8.9", "0, -3.4, -8.9",
        ]),
        joints in prop::collection::vec(joint(), 1..6),
        branch in prop::option::weighted(0.3, (1_usize..4, 0_usize..4)),
    ) -> RandomTree {
        RandomTree { gravity, joints, branch }
    }
}

impl RandomTree {
    /// The spec's text; `None` if nothing moves or nothing has mass.
    fn text(&self) -> Option<String> {
        let mut text = format!(
            "name: tree\ngravity: [{}]\ngeometry: {{a: 0.3, b: 0.3, c: 0.15}}\nlimbs:\n",
            self.gravity
        );
        let mut moves = false;
        let mut bodies: Vec<usize> = Vec::new();
        for (i, joint) in self.joints.iter().enumerate() {
            let branches = self.branch.filter(|(at, _)| *at == i);
            if i == 0 || branches.is_some() {
                let from = branches.and_then(|(_, on)| bodies.get(on));
                let from = from.map_or("world".to_owned(), |b| format!("b{b}"));
                let _ = write!(text, "  - name: limb{i}\n    from: {from}\n    joints:\n");
            }
            let place = |v: &[&str; 3]| v.join(", ");
            let _ = write!(
                text,
                "      - {{name: q{i}, type: {}, origin: {{xyz: [{}], rpy: [{}]}}",
                joint.kind,
                place(&joint.xyz),
                place(&joint.rpy)
            );
            let single = matches!(joint.kind, "revolute" | "prismatic");
            if single {
                let _ = write!(text, ", axis: {}", joint.axis);
            }
            if joint.kind != "fixed" {
                moves = true;
                let _ = write!(
                    text,
                    ", actuated: true, rotor_inertia: {}, friction: {}",
                    joint.rotor, joint.friction
                );
            }
            if !joint.massless {
                let _ = write!(text, ", body: b{i}");
                bodies.push(i);
            }
            text.push_str("}\n");
        }
        (moves && !bodies.is_empty()).then_some(text)
    }
}

/// Prints the text of the spec.
impl std::fmt::Debug for RandomTree {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.text().unwrap_or_default())
    }
}

/// Compares layer 1 with random states in multiple precision, and every coefficient with its value.
fn compare_with_states(text: &str) {
    let (model, found) = base(text);
    let home = vec![0.1; model.coordinates.len()];
    let certificate = certify(&model, &home, 3).unwrap().certificate();
    assert!(certificate.is_certain(), "{certificate:?}\n{text}");
    assert_eq!(found.trees, 1);
    assert_eq!(found.parameters.len(), certificate.rank, "\n{text}");
    let terms: Vec<_> = found.parameters.iter().flat_map(|p| &p.terms).collect();
    let texts: Vec<String> = terms.iter().map(|t| t.coefficient.to_string()).collect();
    for (term, value) in terms.iter().zip(evaluate(text, &texts)) {
        // a coefficient that is too long to be read is written as its number
        let error = value.sub(&term.value);
        let small = error.to_f64().abs() <= 1e-16 * term.value.to_f64().abs();
        assert!(
            error.is_zero() || !term.value.is_exact() && small,
            "{} is {value}, not {}\n{text}",
            term.coefficient,
            term.value
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        // the environment variable PROPTEST_CASES sets another number
        cases: std::env::var("PROPTEST_CASES").ok().and_then(|n| n.parse().ok()).unwrap_or(60),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn layer_1_finds_as_many_base_parameters_as_random_states_show(tree in tree()) {
        if let Some(text) = tree.text() {
            compare_with_states(&text);
        }
    }
}

/// An arm of single joints: type, axis and origin.
fn arm(gravity: &str, joints: &[(&str, &str, &str)]) -> String {
    let mut text = format!(
        "name: arm\ngravity: [{gravity}]\ngeometry: {{a: 0.3}}\nlimbs:\n  - name: arm\n    joints:\n"
    );
    for (i, (kind, axis, origin)) in joints.iter().enumerate() {
        let _ = writeln!(
            text,
            "      - {{name: q{i}, type: {kind}, origin: {{{origin}}}, axis: {axis}, actuated: true, body: b{i}}}"
        );
    }
    text
}

#[test]
fn two_joints_on_one_axis_need_more_states_than_rows_suggest() {
    // without gravity, and with few different rates of the second joint, each state adds only one
    // row to the rank
    compare_with_states(&arm(
        "0, 0, 0",
        &[
            ("revolute", "z", ""),
            ("revolute", "y", "xyz: [a, 0, 0], rpy: [pi/3, 0, 0]"),
            ("revolute", "y", ""),
        ],
    ));
}

#[test]
fn a_sum_of_roots_is_printed_with_its_sign() {
    compare_with_states(&arm(
        "0, 0, -9.81",
        &[
            ("revolute", "z", ""),
            ("revolute", "z", ""),
            ("prismatic", "z", "rpy: [0, pi/3, 0]"),
            ("revolute", "x", "rpy: [0.3, pi/4, 0]"),
        ],
    ));
}

#[test]
fn expressions_too_long_to_read_are_numbers() {
    compare_with_states(&arm(
        "0, 0, -9.81",
        &[
            ("revolute", "x", ""),
            ("prismatic", "z", "rpy: [0, 0.3, 0.3]"),
            ("revolute", "z", "rpy: [0, 0, -0.6]"),
        ],
    ));
}
