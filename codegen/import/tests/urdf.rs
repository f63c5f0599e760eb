//! URDF, feature by feature, and the errors for invalid files.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use crate::common::{assert_has, imported, imported_with, notes, parsed, refused, refused_with};
use regen_codegen::diag::Source;
use regen_codegen::pipeline::{BaseSource, derive_with};
use regen_codegen::spec::JointKind;
use regen_import::{Base, Options};

fn massive(name: &str) -> String {
    format!(
        r#"<link name="{name}"><inertial><origin xyz="0 0.1 0.2"/><mass value="2"/>
        <inertia ixx="0.03" ixy="0" ixz="0" iyy="0.02" iyz="0.001" izz="0.01"/></inertial></link>"#
    )
}

fn joint(name: &str, kind: &str, parent: &str, child: &str, inside: &str) -> String {
    format!(
        r#"<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
        {inside}</joint>"#
    )
}

fn robot(parts: &[String]) -> String {
    format!(
        "<robot name=\"r\">\n<link name=\"base\"/>\n{}\n</robot>",
        parts.join("\n")
    )
}

/// One joint with one link.
fn single(kind: &str, inside: &str) -> String {
    robot(&[massive("a"), joint("q", kind, "base", "a", inside)])
}

#[test]
fn an_axis_is_a_coordinate_axis_where_it_can_be() {
    for (axis, line) in [
        (
            "0 0 1",
            "{name: q, type: revolute, body: a, actuated: true}",
        ),
        (
            "0 1 0",
            "{name: q, type: revolute, axis: y, body: a, actuated: true}",
        ),
        (
            "2 0 0",
            "{name: q, type: revolute, axis: x, body: a, actuated: true}",
        ),
        (
            "0 0 -1",
            "{name: q, type: revolute, origin: {rpy: [pi, 0, 0]}, body: a, actuated: true}",
        ),
        (
            "0 -1 0",
            "{name: q, type: revolute, origin: {rpy: [pi, 0, 0]}, axis: y, body: a, actuated: true}",
        ),
        (
            "-1 0 0",
            "{name: q, type: revolute, origin: {rpy: [0, 0, pi]}, axis: x, body: a, actuated: true}",
        ),
        (
            "0 1 1",
            "{name: q, type: revolute, origin: {rpy: [-pi/4, 0, 0]}, body: a, actuated: true}",
        ),
    ] {
        let spec = imported(&single("continuous", &format!("<axis xyz=\"{axis}\"/>"))).spec;
        assert_has(&spec, line);
    }
    // x is the default axis
    assert_has(&imported(&single("continuous", "")).spec, "axis: x");
}

#[test]
fn inertias_are_moved_into_frames_that_are_turned() {
    let spec = imported(&single("continuous", "<axis xyz=\"0 0 -1\"/>")).spec;
    assert_has(
        &spec,
        "a: {mass: 2, com: [0, -0.1, -0.2], inertia: [0.03, 0, 0, 0.02, 0.001, 0.01]}  # frame at \
         {rpy: [pi, 0, 0]} of a",
    );
    let plain = imported(&single("continuous", "<axis xyz=\"0 0 1\"/>")).spec;
    assert_has(
        &plain,
        "a: {mass: 2, com: [0, 0.1, 0.2], inertia: [0.03, 0, 0, 0.02, 0.001, 0.01]}\n",
    );
}

#[test]
fn the_rotation_of_an_inertial_frame_is_applied() {
    let text = single("continuous", "").replace(
        "<origin xyz=\"0 0.1 0.2\"/>",
        "<origin xyz=\"0 0.1 0.2\" rpy=\"0 0 1.5707963267948966\"/>",
    );
    assert_has(
        &imported(&text).spec,
        "inertia: [0.02, 0, -0.001, 0.03, 0, 0.01]",
    );
}

#[test]
fn limits_and_friction_are_imported() {
    let text = single(
        "revolute",
        r#"<limit lower="-1" upper="2" effort="30" velocity="4"/>
        <dynamics damping="0.5" friction="0.25"/>"#,
    );
    let spec = imported(&text).spec;
    assert_has(
        &spec,
        "limits: {position: [-1, 2], velocity: [-4, 4], effort: [-30, 30]}",
    );
    assert_has(&spec, "friction: linear");
    assert_has(&spec, "nominal: {Fv: 0.5, Fc: 0.25}");
    let only = |dynamics: &str| imported(&single("prismatic", dynamics)).spec;
    assert_has(&only("<dynamics damping=\"0.5\"/>"), "friction: viscous");
    assert_has(&only("<dynamics friction=\"0.5\"/>"), "friction: coulomb");
    assert!(!only("<dynamics damping=\"0\"/>").contains("friction"));
}

#[test]
fn limits_without_effect_are_left_out() {
    let text = single(
        "revolute",
        r#"<limit lower="0" upper="0" effort="0" velocity="inf"/>"#,
    );
    let imported = imported(&text);
    assert!(!imported.spec.contains("limits:"), "{}", imported.spec);
    assert_has(
        &notes(&imported),
        "robot.xml:6:9: the limits of 'q' leave no range",
    );
}

#[test]
fn printed_angles_are_multiples_of_pi_unless_numbers_are_wanted_exactly() {
    let text = single(
        "continuous",
        r#"<origin xyz="0.1 0 1e-12" rpy="1.5708 0 0"/><axis xyz="0 0 1"/>"#,
    );
    let taken = imported(&text);
    assert_has(&taken.spec, "origin: {xyz: [0.1, 0, 0], rpy: [pi/2, 0, 0]}");
    assert_has(&notes(&taken), "took 1.5708 as pi/2");
    assert_has(&notes(&taken), "took 1e-12 as 0");
    let options = Options {
        exact: true,
        ..Options::default()
    };
    let exact = imported_with(&text, &options);
    assert_has(
        &exact.spec,
        "origin: {xyz: [0.1, 0, 1e-12], rpy: [1.5708, 0, 0]}",
    );
    assert!(!notes(&exact).contains("took"));
}

/// The reason for this rule: axes that are only nearly parallel have other base parameters.
#[test]
fn printed_angles_decide_about_base_parameters() {
    let text = robot(&[
        massive("a"),
        massive("b"),
        joint("q1", "continuous", "base", "a", "<axis xyz=\"0 1 0\"/>"),
        joint(
            "q2",
            "continuous",
            "a",
            "b",
            "<origin xyz=\"0.5 0 0\" rpy=\"3.1416 0 0\"/><axis xyz=\"0 1 0\"/>",
        ),
    ]);
    let rank = |exact: bool| {
        let options = Options {
            exact,
            ..Options::default()
        };
        let text = Source::new("r.yaml", imported_with(&text, &options).spec);
        let robot = derive_with(&text, BaseSource::Derivation).unwrap();
        robot.analysis.unwrap().base.rank()
    };
    // a planar arm of two joints in a vertical plane
    assert_eq!(rank(false), 6);
    assert!(rank(true) > 6);
}

#[test]
fn rows_of_denavit_and_hartenberg_are_written_as_such() {
    let text = robot(&[
        massive("a"),
        massive("b"),
        joint(
            "q1",
            "continuous",
            "base",
            "a",
            r#"<origin xyz="0 0 0.3"/><axis xyz="0 0 1"/>"#,
        ),
        joint(
            "q2",
            "continuous",
            "a",
            "b",
            r#"<origin xyz="0.1 -0.2 0" rpy="1.5707963267948966 0 0"/><axis xyz="0 0 1"/>"#,
        ),
    ]);
    let spec = imported(&text).spec;
    assert_has(
        &spec,
        "{name: q1, type: revolute, dh: {d: 0.3}, body: a, actuated: true}",
    );
    assert_has(&spec, "dh: {alpha: pi/2, a: 0.1, d: 0.2}");
    // a pose with an offset along the third axis is not a Denavit-Hartenberg row
    let spec = imported(&text.replace("0.1 -0.2 0", "0.1 -0.2 0.3")).spec;
    assert_has(&spec, "origin: {xyz: [0.1, -0.2, 0.3], rpy: [pi/2, 0, 0]}");
    assert!(!spec.contains("dh:"), "{spec}");
}

#[test]
fn links_without_mass_fold_into_origins_and_others_stay() {
    let text = robot(&[
        "<link name=\"flange\"/>".to_owned(),
        massive("a"),
        massive("tool"),
        joint("q", "continuous", "base", "a", ""),
        joint("f1", "fixed", "a", "flange", "<origin xyz=\"0 0 0.1\"/>"),
        joint("f2", "fixed", "flange", "tool", "<origin xyz=\"0.2 0 0\"/>"),
    ]);
    let spec = imported(&text).spec;
    assert_has(
        &spec,
        "- {type: fixed, origin: {xyz: [0.2, 0, 0.1]}, body: tool}",
    );
    assert!(!spec.contains("flange"), "{spec}");
}

#[test]
fn branches_start_from_bodies_and_chains_are_long() {
    let text = robot(&[
        massive("a"),
        massive("b"),
        massive("c"),
        massive("d"),
        joint("qa", "continuous", "base", "a", ""),
        joint("qb", "continuous", "a", "b", "<origin xyz=\"0 0 1\"/>"),
        joint("qc", "continuous", "a", "c", "<origin xyz=\"0 0 2\"/>"),
        joint("qd", "continuous", "c", "d", ""),
    ]);
    let spec = parsed(&imported(&text).spec);
    let limbs: Vec<(&str, Option<&str>, usize)> = spec
        .limbs
        .iter()
        .map(|l| {
            let from = l.from.as_ref().map(|f| f.value.as_str());
            (l.name.value.as_str(), from, l.joints.len())
        })
        .collect();
    assert_eq!(limbs, [("d", None, 3), ("b", Some("a"), 1)]);
    assert_eq!(spec.coordinates(), ["qa", "qc", "qd", "qb"]);
}

#[test]
fn a_massless_link_that_branches_is_a_body_and_is_reported() {
    let text = robot(&[
        "<link name=\"hub\"/>".to_owned(),
        massive("b"),
        massive("c"),
        joint("qa", "continuous", "base", "hub", ""),
        joint("qb", "continuous", "hub", "b", ""),
        joint("qc", "continuous", "hub", "c", ""),
    ]);
    let imported = imported(&text);
    assert_has(&imported.spec, "hub: {mass: 0}");
    assert_has(&notes(&imported), "'hub' has no mass");
    assert_eq!(parsed(&imported.spec).body_labels(), ["hub", "b", "c"]);
}

#[test]
fn joints_that_move_no_mass_are_left_out() {
    let text = robot(&[
        massive("a"),
        "<link name=\"eye\"/>".to_owned(),
        joint("q", "continuous", "base", "a", ""),
        joint("look", "continuous", "a", "eye", ""),
    ]);
    let imported = imported(&text);
    assert_eq!(parsed(&imported.spec).coordinates(), ["q"]);
    assert_has(&notes(&imported), "joint 'look' moves no mass: left out");
}

#[test]
fn a_joint_that_mimics_is_coupled() {
    let mimic = r#"<mimic joint="q1" multiplier="-2" offset="0.5"/>"#;
    let text = robot(&[
        massive("a"),
        massive("b"),
        joint("q1", "continuous", "base", "a", ""),
        joint("q2", "continuous", "a", "b", mimic),
    ]);
    let spec = imported(&text).spec;
    assert_has(&spec, "couplings:\n  q2: -2*q1 + 0.5\n");
    assert_eq!(spec.matches("actuated: true").count(), 1);
    let complaint = refused(&text.replace("mimic joint=\"q1\"", "mimic joint=\"q3\""));
    assert_has(&complaint, "no joint with one coordinate is called 'q3'");
}

#[test]
fn transmissions_determine_the_motors() {
    let text = robot(&[
        massive("a"),
        massive("b"),
        joint("q1", "continuous", "base", "a", ""),
        joint("q2", "continuous", "a", "b", ""),
        "<transmission name=\"t\"><joint name=\"q2\"/></transmission>".to_owned(),
    ]);
    let spec = imported(&text).spec;
    assert_has(
        &spec,
        "{name: q2, type: revolute, axis: x, body: b, actuated: true}",
    );
    assert_has(&spec, "{name: q1, type: revolute, axis: x, body: a}");
    assert_has(&spec, "independent: [q1, q2]");
}

#[test]
fn floating_and_planar_joints_are_chains() {
    let kinds = |text: &str| -> Vec<JointKind> {
        let spec = parsed(&imported(text).spec);
        spec.limbs[0].joints.iter().map(|j| j.kind.value).collect()
    };
    use JointKind::{Prismatic, Revolute, Spherical};
    assert_eq!(
        kinds(&single("floating", "")),
        [Prismatic, Prismatic, Prismatic, Spherical]
    );
    assert_eq!(
        kinds(&single("planar", "<axis xyz=\"0 0 1\"/>")),
        [Prismatic, Prismatic, Revolute]
    );
}

#[test]
fn the_base_floats_or_is_fixed_as_requested() {
    let base = |base: Base| Options {
        base: Some(base),
        ..Options::default()
    };
    let text = robot(&[massive("a"), joint("q", "continuous", "base", "a", "")])
        .replace("<link name=\"base\"/>", &massive("base"));
    let spec = parsed(&imported_with(&text, &base(Base::Floating)).spec);
    assert_eq!(
        spec.coordinates(),
        [
            "base_x",
            "base_y",
            "base_z",
            "base_turn.1",
            "base_turn.2",
            "base_turn.3",
            "q"
        ]
    );
    assert_eq!(spec.body_labels(), ["base", "a"]);
    let floating = single("floating", "");
    let hung = robot(&[
        massive("a"),
        massive("b"),
        joint("f", "floating", "base", "a", ""),
        joint("q", "continuous", "a", "b", ""),
    ]);
    assert_eq!(parsed(&imported(&hung).spec).coordinates().len(), 7);
    assert_has(
        &refused_with(&floating, &base(Base::Fixed)),
        "nothing with mass moves",
    );
}

#[test]
fn names_that_are_no_identifiers_are_replaced_and_reported() {
    let text = single("continuous", "").replace("\"a\"", "\"arm-link 1\"");
    let imported = imported(&text);
    assert_has(&imported.spec, "body: arm_link_1");
    assert_has(&notes(&imported), "'arm-link 1' is arm_link_1");
    let named = Options {
        name: Some("my-arm".to_owned()),
        ..Options::default()
    };
    assert_eq!(imported_with(&text, &named).name, "my_arm");
}

#[test]
fn undeclared_prefixes_do_not_move_places() {
    let text = single("hinge", "").replace(
        "<link name=\"base\"/>",
        "<drake:group x:y=\"1\"/><link name=\"base\"/>",
    );
    let complaint = refused(&text);
    assert_has(&complaint, "robot.xml:5:23: unknown joint type 'hinge'");
}

#[test]
fn wrong_files_are_refused_with_the_place_and_a_remedy() {
    let two = robot(&[
        massive("a"),
        massive("b"),
        joint("q", "fixed", "base", "a", ""),
    ]);
    let q2 = joint("q2", "continuous", "b", "a", "");
    for (text, complaint) in [
        (
            "<robot name=\"r\">\n  <link name=\"a\">\n</robot>".to_owned(),
            "robot.xml:3:1: the file is not XML",
        ),
        (
            "<robot><link name=\"a\" </robot>".to_owned(),
            "robot.xml:1:23: the file is not XML",
        ),
        (
            format!(
                "<robot>\n<!-- = -->\n<link name=\"=\"{}/></robot>",
                " a=''".repeat(100_000)
            ),
            "robot.xml:3:5012: more than 1000 attributes in an element",
        ),
        (
            format!("<robot>{}</robot>", "<a xmlns:b='c'/>".repeat(10_001)),
            "robot.xml:1:160011: more than 10000 namespaces",
        ),
        (String::new(), "robot.xml:1:1: the file is not XML"),
        (
            "<urdf/>".to_owned(),
            "robot.xml:1:1: <urdf> is none of URDF, MJCF, SDF and USD",
        ),
        ("<robot name=\"r\"/>".to_owned(), "no link is the root"),
        (two.clone(), "a second link that no joint carries"),
        (
            two.replace("</robot>", &format!("{q2}</robot>")),
            "is the child of another joint already",
        ),
        (
            single("continuous", "").replace("link=\"base\"", "link=\"bas\""),
            "robot.xml:5:49: no link is called 'bas'",
        ),
        (
            single("continuous", "").replace("name=\"a\"", "name=\"base\""),
            "another link is called 'base' already",
        ),
        (single("hinge", ""), "unknown joint type 'hinge'"),
        (
            single("continuous", "<axis xyz=\"0 0 0\"/>"),
            "xyz has no direction",
        ),
        (
            single("continuous", "<axis xyz=\"0 0\"/>"),
            "xyz has 2 numbers, not 3",
        ),
        (
            single("continuous", "<origin xyz=\"0 a 0\"/>"),
            "xyz: 'a' is not a finite number",
        ),
        (
            single("continuous", "").replace("value=\"2\"", "value=\"-2\""),
            "a negative mass",
        ),
        (
            single("continuous", "").replace("<mass value=\"2\"/>", "<mass/>"),
            "<mass> has no value",
        ),
        (
            "<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\"><xacro:arm/></robot>".to_owned(),
            "a xacro macro, not yet URDF (expand the macros first",
        ),
        (single("fixed", ""), "nothing with mass moves"),
    ] {
        assert_has(&refused(&text), complaint);
    }
}

#[test]
fn inertias_that_are_not_physical_are_refused_or_reported() {
    let with = |ixx: &str| single("continuous", "").replace("ixx=\"0.03\"", ixx);
    let complaint = refused(&with("ixx=\"-0.03\""));
    assert_has(&complaint, "robot.xml:3:1: no body has the inertia of 'a'");
    let long = imported(&with("ixx=\"0.05\""));
    assert_has(
        &notes(&long),
        "no body has the inertia of 'a': it breaks the triangle inequality",
    );
    assert!(!notes(&imported(&with("ixx=\"0.02\""))).contains("triangle"));
}

#[test]
fn all_errors_are_reported_at_once() {
    let text = single("continuous", "<axis xyz=\"0 0\"/><origin xyz=\"0 a 0\"/>");
    assert_eq!(refused(&text).lines().count(), 2);
}
