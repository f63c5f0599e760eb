//! Valid specs: the values that are read from them.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::Path;

use regen_codegen::diag::Source;
use regen_codegen::spec::{Axis, Friction, JointFrame, Spec, parse};
use regen_codegen::sym::Number;

fn read(text: &str) -> Spec {
    parse(&Source::new("test.yaml", text))
        .unwrap_or_else(|report| panic!("{}", report.render(false)))
}

fn oracle(name: &str) -> Spec {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../tests/fixtures/oracle")
        .join(name);
    read(&std::fs::read_to_string(path).unwrap())
}

#[test]
fn the_oracle_files_are_valid_and_number_their_coordinates_in_order() {
    let rps3 = oracle("3rps.yaml");
    assert_eq!(
        rps3.coordinates(),
        ["q1", "q2", "s1.1", "s1.2", "s1.3", "q6", "q7", "q8", "q9"]
    );
    assert_eq!(rps3.body_labels(), ["1", "2", "3", "4", "5", "6", "7"]);
    assert_eq!(rps3.parameters().len(), 70);
    assert_eq!(rps3.parameters()[12], "Ixz(2)");
    assert_eq!(rps3.cuts.len(), 2);
    assert_eq!(rps3.base.eliminate.len(), 3);

    let tree = oracle("tree_branch.yaml");
    assert_eq!(tree.coordinates(), ["t1", "t2", "a1.1", "a1.2", "a2", "b1"]);
    assert_eq!(tree.limbs[1].from.as_ref().unwrap().value, "mast");

    assert_eq!(oracle("fivebar.yaml").coordinates().len(), 4);
    assert_eq!(oracle("puma560.yaml").coordinates().len(), 6);
}

/// All keys of the format in one spec.
const FULL: &str = r#"
name: everything   # a comment
description: >
  two lines
  become one
gravity: [0, 0, -g]
geometry:
  g: 9.81
  a: 0.4563
  r: a/sqrt(3)
limbs:
  - name: trunk
    joints:
      - {name: q1, type: revolute, axis: y, dh: {alpha: pi/2, d: 2*r}, body: torso, actuated: true,
         friction: asymmetric, rotor_inertia: true, nominal: {Fv: 2, Fc+: 3, Fc-: 4, J: 0.1},
         limits: {position: [-pi, pi], velocity: [-1, 1], acceleration: [-2, 2], jerk: [-9, 9], effort: [-3, 3]}}
      - {type: fixed, origin: {xyz: [0, 0, 1], rpy: [0, 0, deg(90)]}, body: 01}
  - name: arm
    from: torso
    base: {xyz: [a, 0, 0]}
    joints:
      - name: s1
        type: spherical
        limits: {cone: 0.6}
        friction: viscous
      - {name: c1, type: cylindrical, body: 1}
      - {name: u1, type: universal}
      - {name: p1, type: prismatic, axis: x, body: 2, rotor_inertia: true}
cuts:
  - {name: s2, joint: spherical, between: [{body: 2, xyz: [a, 0, 0], rpy: [0, 0, pi]}, {body: world}], limits: {cone: 1}}
independent: [q1, s1.1]
couplings: {p1: -q1/2 + 1e-3}
home: {q1: 0.6, s1.1: 5*pi/6}
bodies:
  torso: {mass: 3.1, com: [0, 0.2, 0], inertia: [1, 0, 0, 1, 0, 1]}
base:
  eliminate: [m(2), "Fc+(q1)"]
  zero: [mx(1), Ixy(2) + a/2*my(2)]
  equal: [[torso, 1], [01, 2]]
  drop: [Ixx(torso)]
"#;

#[test]
fn every_field_is_read() {
    let spec = read(FULL);
    assert_eq!(spec.description.as_deref(), Some("two lines become one"));
    assert_eq!(
        spec.gravity[2].value,
        Number::parse_decimal("-9.81").unwrap()
    );
    assert_eq!(spec.geometry[2].0.value, "r");
    let [q1, fixed] = spec.limbs[0].joints.as_slice() else {
        panic!("two joints")
    };
    assert_eq!((q1.axis, q1.friction), (Axis::Y, Friction::Asymmetric));
    assert!(q1.actuated && q1.rotor_inertia);
    assert_eq!(q1.nominal_value("Fv+").unwrap().value, Number::from_i64(2));
    assert_eq!(q1.nominal_value("Fc-").unwrap().value, Number::from_i64(4));
    assert!(q1.nominal_value("Fs").is_none());
    assert_eq!(
        q1.limits.effort.as_ref().unwrap()[0].value,
        Number::from_i64(-3)
    );
    let JointFrame::Dh { alpha, theta, .. } = &q1.frame else {
        panic!("a DH row")
    };
    assert_eq!(alpha.value, Number::pi().div(&Number::from_i64(2)).unwrap());
    assert!(theta.value.is_zero());
    assert!(fixed.name.is_none());
    assert!(matches!(fixed.frame, JointFrame::Origin(_)));
    assert_eq!(fixed.body.as_ref().unwrap().value, "01");
    let cone = spec.limbs[1].joints[0].limits.cone.as_ref().unwrap();
    assert_eq!(cone.value, Number::ratio(3, 5).unwrap());
    assert!(spec.cuts[0].sides[1].body.is_none());
    assert_eq!(spec.independent.as_ref().unwrap().value.len(), 2);
    assert_eq!(
        spec.couplings[0].1.terms[0].1.value,
        Number::ratio(-1, 2).unwrap()
    );
    assert_eq!(
        spec.couplings[0].1.constant.value,
        Number::ratio(1, 1000).unwrap()
    );
    assert_eq!(spec.home[1].0.value, "s1.1");
    assert_eq!(spec.bodies[0].1.com[1].value, Number::ratio(1, 5).unwrap());
    assert_eq!(spec.base.eliminate[1].value, "Fc+(q1)");
    assert_eq!(spec.base.zero[1].terms.len(), 2);
    assert_eq!(spec.base.equal[1][0].value, "01");
}

#[test]
fn labels_come_in_the_order_of_the_format() {
    let spec = read(FULL);
    let coordinates = [
        "q1", "s1.1", "s1.2", "s1.3", "c1.1", "c1.2", "u1.1", "u1.2", "p1",
    ];
    assert_eq!(spec.coordinates(), coordinates);
    assert_eq!(spec.body_labels(), ["torso", "01", "1", "2"]);
    let parameters = spec.parameters();
    assert_eq!(parameters[..3], ["Ixx(torso)", "Ixy(torso)", "Ixz(torso)"]);
    assert_eq!(parameters[19], "m(01)");
    let rest = [
        "Fv+(q1)", "Fc+(q1)", "Fv-(q1)", "Fc-(q1)", "Fv(s1.1)", "Fv(s1.2)", "Fv(s1.3)", "J(q1)",
        "J(p1)",
    ];
    assert_eq!(parameters[40..], rest);
}

#[test]
fn a_pitch_is_read_as_the_lead_per_radian_with_its_names() {
    let spec = read(
        "name: r
geometry: {p: 0.02}
limbs:
  - name: l
    joints:
      - {name: q1, type: helical, pitch: -p/4, axis: y, body: b, actuated: true}
      - {name: q2, type: revolute, body: c}
cuts:
  - {name: c, joint: helical, pitch: pi, between: [{body: world}, {body: c}]}
",
    );
    let joint = &spec.limbs[0].joints[0];
    assert_eq!(spec.coordinates(), ["q1", "q2"]);
    assert_eq!(joint.axis, Axis::Y);
    let two_pi = Number::pi().mul(&Number::from_i64(2));
    let pitch = Number::ratio(-1, 200).unwrap();
    let lead = joint.lead.as_ref().unwrap();
    assert_eq!(lead.value, pitch.div(&two_pi).unwrap());
    assert!(spec.limbs[0].joints[1].lead.is_none());
    let half = Number::ratio(1, 2).unwrap();
    assert_eq!(spec.cuts[0].lead.as_ref().unwrap().value, half);
    assert_eq!(spec.cuts[0].kind.value.equations(), 5);
}

#[test]
fn missing_fields_have_the_values_of_the_format() {
    let spec = read(
        "name: r\nlimbs: [{name: l, joints: [{name: q, type: revolute, body: b, actuated: true}]}]\n",
    );
    assert!(spec.gravity[0].value.is_zero() && spec.gravity[1].value.is_zero());
    let down = Number::parse_decimal("-9.81").unwrap();
    assert_eq!(spec.gravity[2].value, down);
    let limb = &spec.limbs[0];
    assert!(limb.from.is_none());
    assert!(
        limb.base
            .xyz
            .iter()
            .chain(&limb.base.rpy)
            .all(|entry| entry.value.is_zero())
    );
    let joint = &limb.joints[0];
    assert_eq!((joint.axis, joint.friction), (Axis::Z, Friction::None));
    assert!(!joint.rotor_inertia && joint.nominal.is_empty());
    assert!(spec.independent.is_none() && spec.home_span.is_none() && spec.base.zero.is_empty());
}

#[test]
fn block_and_flow_style_windows_lines_and_a_byte_order_mark_read_the_same() {
    let block = "name: r\nlimbs:\n- name: l\n  joints:\n  - name: q\n    type: revolute\n    body: 1\n    actuated: true\n    dh:\n      a: 1/2\n";
    let flow = "{name: r, limbs: [{name: 'l', joints: [{name: \"q\", type: revolute, body: 1, actuated: true, dh: {a: '1/2'}}]}]}";
    let windows = block.replace('\n', "\r\n");
    let marked = format!("\u{feff}{block}");
    let aliased = "name: r\nhome: {q: &half 1/2}\nlimbs: [{name: l, joints: [{name: q, type: revolute, body: 1, actuated: true, dh: {a: *half}}]}]";
    for text in [block, flow, &windows, &marked, aliased] {
        let spec = read(text);
        let joint = &spec.limbs[0].joints[0];
        let JointFrame::Dh { a, .. } = &joint.frame else {
            panic!("a DH row")
        };
        assert_eq!(a.value, Number::ratio(1, 2).unwrap(), "{text}");
        let name = joint.name.as_ref().unwrap();
        assert_eq!(
            text[name.span.start..name.span.end].trim_matches('"'),
            "q",
            "{text}"
        );
    }
}

#[test]
fn spans_find_the_words_that_they_belong_to() {
    for file in [
        "3rps.yaml",
        "fivebar.yaml",
        "puma560.yaml",
        "tree_branch.yaml",
    ] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("../tests/fixtures/oracle")
            .join(file);
        let text = std::fs::read_to_string(path).unwrap();
        let spec = read(&text);
        for joint in spec.limbs.iter().flat_map(|limb| &limb.joints) {
            for word in joint.name.iter().chain(&joint.body) {
                assert_eq!(text[word.span.start..word.span.end], word.value);
            }
        }
        for (name, value) in &spec.home {
            assert_eq!(text[name.span.start..name.span.end], name.value);
            assert!(name.span.end < value.span.start);
        }
    }
}

#[test]
fn the_robots_of_this_repository_are_valid() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../robots");
    let mut count = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path
            .extension()
            .is_some_and(|extension| extension == "yaml")
        {
            let spec = read(&std::fs::read_to_string(&path).unwrap());
            assert!(!spec.coordinates().is_empty());
            count += 1;
        }
    }
    assert!(count > 0);
}
