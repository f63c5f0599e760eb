//! Equality constraints of MJCF: loops and couplings.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use crate::common::{assert_has, imported, refused};

fn spec(text: &str) -> String {
    imported(text).spec
}

/// Two pendulums side by side, with the given equality constraints.
fn pair(equality: &str) -> String {
    let body = |name: &str, joint: &str, x: f64| {
        format!(
            "<body name=\"{name}\" pos=\"{x} 0 0\"><inertial mass=\"1\" pos=\"0 0 -0.2\" \
             diaginertia=\"0.1 0.1 0.1\"/><joint name=\"{joint}\" axis=\"0 1 0\"/>"
        )
    };
    format!(
        "<mujoco model=\"m\"><compiler angle=\"radian\"/><worldbody>{}{}\
         <site name=\"tip\" pos=\"0 0 -0.3\"/></body></body>{}<site name=\"end\" pos=\"0 0 -0.3\"/>\
         </body></worldbody><equality>{equality}</equality></mujoco>",
        body("a", "qa", 0.0),
        body("b", "qb", 0.5),
        body("c", "qc", 0.4),
    )
}

#[test]
fn a_connect_is_a_spherical_cut_where_the_bodies_are_at_zero() {
    let by_bodies = spec(&pair(
        "<connect name=\"pin\" body1=\"b\" body2=\"c\" anchor=\"0 0 -0.3\"/>",
    ));
    assert_has(
        &by_bodies,
        "{name: pin, joint: spherical, between: [{body: b, xyz: [0, 0, -0.3]}, {body: c, xyz: [0.1, 0, -0.3]}]}",
    );
    // a planar loop of three joints: one degree of freedom
    assert_eq!(
        by_bodies.matches("actuated: true").count(),
        1,
        "{by_bodies}"
    );
    let to_world = spec(&pair("<connect body1=\"b\" anchor=\"0 0 -0.3\"/>"));
    assert_has(
        &to_world,
        "[{body: b, xyz: [0, 0, -0.3]}, {body: world, xyz: [0.5, 0, -0.3]}]",
    );
    let by_sites = pair("<connect name=\"pin\" site1=\"tip\" site2=\"end\"/>")
        .replace("pos=\"0.4 0 0\"", "pos=\"0.5 0 0\"");
    assert_has(
        &spec(&by_sites),
        "between: [{body: b, xyz: [0, 0, -0.3]}, {body: c, xyz: [0, 0, -0.3]}]",
    );
    assert!(
        !spec(&pair(
            "<connect active=\"false\" body1=\"b\" body2=\"c\" anchor=\"0 0 0\"/>"
        ))
        .contains("cuts:")
    );
    for (equality, complaint) in [
        (
            "<connect body2=\"c\" anchor=\"0 0 0\"/>",
            "<connect> has no body1",
        ),
        (
            "<connect body1=\"d\" anchor=\"0 0 0\"/>",
            "no body is called 'd'",
        ),
        (
            "<connect site1=\"d\" site2=\"end\"/>",
            "no site is called 'd'",
        ),
        (
            "<distance geom1=\"d\" geom2=\"e\"/>",
            "a <distance> equality cannot be expressed",
        ),
    ] {
        assert_has(&refused(&pair(equality)), complaint);
    }
}

#[test]
fn a_weld_is_a_fixed_cut() {
    let welded = "<mujoco model=\"m\"><worldbody><body name=\"a\" pos=\"0 0 1\"><freejoint name=\"f\"/>\
        <inertial mass=\"1\" pos=\"0 0 0\" diaginertia=\"1 1 1\"/><body name=\"c\"><joint name=\"q\"/>\
        <inertial mass=\"1\" pos=\"0 0 0\" diaginertia=\"1 1 1\"/></body></body></worldbody>\
        <equality><weld name=\"w\" body1=\"a\"/></equality></mujoco>";
    let at_zero = spec(welded);
    assert_has(
        &at_zero,
        "{name: w, joint: fixed, between: [{body: a, xyz: [0, 0, -1]}, {body: world}]}",
    );
    assert_has(&at_zero, "name: q, type: revolute");
    let relative = welded.replace("body1=\"a\"/>", "body1=\"a\" relpose=\"0 0 -1 1 0 0 0\"/>");
    assert_eq!(spec(&relative), at_zero);
    let elsewhere = welded.replace(
        "body1=\"a\"/>",
        "body1=\"a\" relpose=\"0 0.1 -1 1 0 0 0\"/>",
    );
    assert_has(&spec(&elsewhere), "{body: a, xyz: [0, 0.1, -1]}");
}

#[test]
fn equal_joints_are_coupled_as_far_as_they_are_linear() {
    let coupled = |inside: &str| pair(&format!("<joint joint1=\"qc\" {inside}/>"));
    for (inside, line) in [
        ("joint2=\"qa\"", "qc: qa\n"),
        (
            "joint2=\"qa\" polycoef=\"0.5 -2 0 0 0\"",
            "qc: -2*qa + 0.5\n",
        ),
        ("joint2=\"qa\" polycoef=\"0 1\"", "qc: qa\n"),
        ("polycoef=\"0.5 0 0 0 0\"", "qc: 0.5\n"),
    ] {
        assert_has(&spec(&coupled(inside)), &format!("couplings:\n  {line}"));
    }
    // the equality is relative to the reference values
    let referred =
        coupled("joint2=\"qa\" polycoef=\"0 2\"").replace("name=\"qa\"", "name=\"qa\" ref=\"0.1\"");
    assert_has(&spec(&referred), "qc: 2*qa - 0.2\n");
    let bent = refused(&coupled("joint2=\"qa\" polycoef=\"0 1 0.5\""));
    assert_has(&bent, "a coupling that is not linear");
    assert_has(
        &refused(&coupled("joint2=\"qd\"")),
        "no hinge or slide is called 'qd'",
    );
}

#[test]
fn a_motor_may_be_at_a_joint_that_follows() {
    let text = pair("<joint joint1=\"qc\" joint2=\"qa\"/>");
    let motors = |joints: &[&str]| -> String {
        let motors: Vec<String> = joints
            .iter()
            .map(|j| format!("<motor joint=\"{j}\"/>"))
            .collect();
        let section = format!("<actuator>{}</actuator></mujoco>", motors.concat());
        spec(&text.replace("</mujoco>", &section))
    };
    for joints in [&["qc"][..], &["qb", "qc"], &["qa", "qb", "qc"]] {
        let spec = motors(joints);
        assert_eq!(
            spec.matches("actuated: true").count(),
            joints.len(),
            "{spec}"
        );
        assert_has(&spec, "independent: [qa, qb]");
    }
    assert!(!motors(&["qa", "qb"]).contains("independent:"));
}
