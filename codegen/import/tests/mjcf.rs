//! MJCF, feature by feature: a file with the feature gives the same spec as one that writes it in
//! full, and a different one from a file without it.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use crate::common::{assert_has, imported, imported_with, notes, parsed, refused};
use regen_codegen::diag::Source;
use regen_import::{Base, Options, import};

const INERTIAL: &str = r#"<inertial mass="2" pos="0 0.1 0.2" diaginertia="0.03 0.02 0.015"/>"#;

/// One body with the given elements, angles in radians.
fn single(inside: &str) -> String {
    format!(
        r#"<mujoco model="m"><compiler angle="radian"/><worldbody>
        <body name="a" pos="0.1 0.2 0.3">{INERTIAL}{inside}</body></worldbody></mujoco>"#
    )
}

/// A pendulum whose body has the given orientation.
fn oriented(orientation: &str) -> String {
    single("<joint name=\"q\"/>").replace("pos=\"0.1 0.2 0.3\"", orientation)
}

fn spec(text: &str) -> String {
    imported(text).spec
}

/// Asserts that the feature has the effect of its long form, and that it has an effect.
#[track_caller]
fn assert_same(feature: &str, in_full: &str, without: &str) {
    assert_eq!(spec(feature), spec(in_full));
    assert_ne!(spec(feature), spec(without), "the test cannot fail");
}

#[test]
fn orientations_are_written_in_five_ways() {
    let full = oriented("quat=\"0.7071067811865476 0.7071067811865476 0 0\"");
    let none = oriented("");
    for same in [
        "quat=\"2 2 0 0\"",
        "quat=\"0.707107 0.707107 0 0\"",
        "euler=\"1.5707963267948966 0 0\"",
        "euler=\"1.5708 0 0\"",
        "axisangle=\"3 0 0 1.5708\"",
        "xyaxes=\"1 0 0 0 0 1\"",
        "xyaxes=\"1 0 0 0.5 0 2\"",
        "zaxis=\"0 -2 0\"",
    ] {
        assert_same(&oriented(same), &full, &none);
    }
    assert_has(&spec(&full), "rpy: [pi/2, 0, 0]");
}

#[test]
fn quaternions_of_few_digits_are_the_turns_that_they_print() {
    let text = oriented("quat=\"0.499998 0.5 0.5 -0.500002\"");
    let exact = oriented("quat=\"1 1 1 -1\"");
    assert_eq!(spec(&text), spec(&exact));
    assert_has(&notes(&imported(&text)), "as a turn of axes onto axes");
    let options = Options {
        exact: true,
        ..Options::default()
    };
    assert_ne!(imported_with(&text, &options).spec, spec(&exact));
    // a rotation by 15 degrees
    assert_has(
        &spec(&oriented("quat=\"0.991445 0 0.130526 0\"")),
        "rpy: [0, pi/12, 0]",
    );
}

#[test]
fn the_sequence_of_euler_angles_counts_and_small_letters_move_along() {
    let angles = |sequence: &str, euler: &str| {
        oriented(&format!("euler=\"{euler}\""))
            .replace("<compiler", &format!("<compiler eulerseq=\"{sequence}\""))
    };
    // rotations about fixed axes equal those about moving axes in the opposite order
    assert_same(
        &angles("XYZ", "0.3 0.5 0.7"),
        &angles("zyx", "0.7 0.5 0.3"),
        &angles("xyz", "0.3 0.5 0.7"),
    );
    // roll, pitch, yaw
    assert_has(&spec(&angles("XYZ", "0.3 0.5 0.7")), "rpy: [0.3, 0.5, 0.7]");
    assert_has(
        &refused(&angles("xyw", "0 0 0")),
        "'xyw' is not a sequence of three axes",
    );
}

#[test]
fn angles_are_degrees_unless_the_compiler_setting_is_radian() {
    let joint = "<joint name=\"q\" range=\"-90 45\" ref=\"30\"/>";
    let degrees = single(joint)
        .replace("<compiler angle=\"radian\"/>", "")
        .replace("pos=\"0.1 0.2 0.3\"", "axisangle=\"0 0 1 60\"");
    let spec = spec(&degrees);
    assert_has(&spec, "position: [-pi/2, pi/4]");
    assert_has(&spec, "home: {q: pi/6}");
    assert_has(&spec, "rpy: [0, 0, pi/6]");
}

#[test]
fn classes_of_defaults_complete_the_elements() {
    let classes = r#"<default><joint axis="1 0 0" damping="0.5"/>
        <default class="outer"><joint damping="2" armature="0.1"/>
          <default class="inner"><joint axis="0 1 0"/></default></default></default><worldbody>"#;
    let with = |joint: &str, body: &str| {
        single(joint)
            .replace("<worldbody>", classes)
            .replace("<body name=\"a\"", &format!("<body name=\"a\" {body}"))
    };
    let none = single("<joint name=\"q\"/>");
    for (class, body, full) in [
        ("", "", "axis=\"1 0 0\" damping=\"0.5\""),
        (
            "class=\"outer\"",
            "",
            "axis=\"1 0 0\" damping=\"2\" armature=\"0.1\"",
        ),
        (
            "class=\"inner\"",
            "",
            "axis=\"0 1 0\" damping=\"2\" armature=\"0.1\"",
        ),
        (
            "",
            "childclass=\"inner\"",
            "axis=\"0 1 0\" damping=\"2\" armature=\"0.1\"",
        ),
        (
            "class=\"outer\"",
            "childclass=\"inner\"",
            "axis=\"1 0 0\" damping=\"2\" armature=\"0.1\"",
        ),
        (
            "class=\"inner\" damping=\"3\"",
            "",
            "axis=\"0 1 0\" damping=\"3\" armature=\"0.1\"",
        ),
    ] {
        let feature = with(&format!("<joint name=\"q\" {class}/>"), body);
        assert_same(
            &feature,
            &single(&format!("<joint name=\"q\" {full}/>")),
            &none,
        );
    }
    let complaint = refused(&with("<joint name=\"q\" class=\"iner\"/>", ""));
    assert_has(&complaint, "no class of defaults is called 'iner'");
}

#[test]
fn included_files_are_read_in_place() {
    let part = "<mujoco><joint name=\"q\" axis=\"0 1 0\"/></mujoco>";
    let source = Source::new("robot.xml", single("<include file=\"part.xml\"/>"));
    let mut reader = |name: &str| match name {
        "part.xml" => Ok(part.as_bytes().to_vec()),
        _ => Err("there is none".to_owned()),
    };
    let with = import(&source, &mut reader, &Options::default()).unwrap();
    assert_eq!(
        with.spec,
        spec(&single("<joint name=\"q\" axis=\"0 1 0\"/>"))
    );
    // an error in the included file has its place there
    let mut broken = |_: &str| Ok(b"<mujoco>\n<joint axis=\"0 0 0\"/></mujoco>".to_vec());
    let reports = import(&source, &mut broken, &Options::default()).unwrap_err();
    assert_has(
        &reports[0].to_string(),
        "part.xml:2:14: axis has no direction",
    );
    assert_has(
        &refused(&source.text),
        "robot.xml:2:123: cannot read the included file 'part.xml'",
    );
    let twice = single("<include file=\"part.xml\"/><include file=\"part.xml\"/>");
    let twice = Source::new("robot.xml", twice);
    let reports = import(&twice, &mut reader, &Options::default()).unwrap_err();
    assert_has(
        &reports[0].to_string(),
        "'part.xml' is included more than once",
    );
    let includes: Vec<String> = (0..101)
        .map(|k| format!("<include file=\"{k}.xml\"/>"))
        .collect();
    let many = Source::new("robot.xml", single(&includes.concat()));
    let mut empty = |_: &str| Ok(b"<mujoco/>".to_vec());
    let reports = import(&many, &mut empty, &Options::default()).unwrap_err();
    assert_has(&reports[0].to_string(), "more than 100 files are included");
}

#[test]
fn frames_between_bodies_move_their_contents() {
    assert_same(
        &single(
            "<frame pos=\"0 0 1\" euler=\"1.5708 0 0\"><joint name=\"q\" pos=\"0 1 0\" axis=\"0 1 0\"/></frame>",
        ),
        &single("<joint name=\"q\" pos=\"0 0 2\" axis=\"0 0 1\"/>"),
        &single("<joint name=\"q\" pos=\"0 1 0\" axis=\"0 1 0\"/>"),
    );
}

#[test]
fn a_joint_off_the_bodys_frame_moves_the_frame() {
    let spec = spec(&single("<joint name=\"q\" pos=\"0 0 0.5\"/>"));
    assert_has(&spec, "origin: {xyz: [0.1, 0.2, 0.8]}");
    assert_has(&spec, "com: [0, 0.1, -0.3]");
    assert_has(&spec, "# frame at {xyz: [0, 0, 0.5]} of a");
}

#[test]
fn several_joints_on_a_body_are_a_chain_with_one_body() {
    let text = single(
        "<joint name=\"x\" type=\"slide\" axis=\"1 0 0\"/>\
         <joint name=\"q\" axis=\"0 1 0\" pos=\"0 0 0.5\"/><joint name=\"r\" axis=\"0 0 1\"/>",
    );
    let spec = parsed(&spec(&text));
    assert_eq!(spec.coordinates(), ["x", "q", "r"]);
    assert_eq!(spec.body_labels(), ["a"]);
    let joints = &spec.limbs[0].joints;
    assert!(joints[0].body.is_none() && joints[1].body.is_none() && joints[2].body.is_some());
}

#[test]
fn balls_are_spherical_joints() {
    let spec = spec(&single("<joint name=\"q\" type=\"ball\" damping=\"0.1\"/>"));
    assert_has(&spec, "type: spherical");
    // friction of a spec's ball would resist the rates of its angles
    assert!(!spec.contains("friction"), "{spec}");
    assert_has(&spec, "independent: [q.1, q.2, q.3]");
}

#[test]
fn free_joints_become_chains_and_are_reported() {
    for free in [
        "<freejoint name=\"f\"/>",
        "<joint name=\"f\" type=\"free\"/>",
    ] {
        let text = single(free);
        let made = imported(&text);
        let coordinates = parsed(&made.spec).coordinates();
        assert_eq!(
            coordinates,
            ["f_x", "f_y", "f_z", "f_turn.1", "f_turn.2", "f_turn.3"]
        );
        assert_has(
            &notes(&made),
            "free joint 'f' is written as three slides and a ball",
        );
    }
    let two = single(
        "<freejoint/><body name=\"b\"><inertial mass=\"1\" pos=\"0 0 1\" diaginertia=\"1 1 1\"/>\
         <joint name=\"q\"/></body>",
    );
    let fixed = Options {
        base: Some(Base::Fixed),
        ..Options::default()
    };
    assert_eq!(
        parsed(&imported_with(&two, &fixed).spec).coordinates(),
        ["q"]
    );
}

#[test]
fn ranges_limit_where_they_are_in_force() {
    let spec = |joint: &str| {
        spec(&single(&format!(
            "<joint name=\"q\" range=\"-1 2\" {joint}/>"
        )))
    };
    let off = |text: String| text.replace("<compiler", "<compiler autolimits=\"false\"");
    assert_has(&spec(""), "limits: {position: [-1, 2]}");
    assert!(!spec("limited=\"false\"").contains("limits:"));
    let bare = off(single("<joint name=\"q\" range=\"-1 2\"/>"));
    assert!(!imported(&bare).spec.contains("limits:"));
    let said = off(single(
        "<joint name=\"q\" range=\"-1 2\" limited=\"true\"/>",
    ));
    assert_has(&imported(&said).spec, "limits: {position: [-1, 2]}");
}

#[test]
fn friction_and_rotors_are_nominal_values() {
    let spec = spec(&single(
        "<joint name=\"q\" damping=\"0.5\" frictionloss=\"0.2\" armature=\"0.01\"/>",
    ));
    assert_has(&spec, "nominal: {Fv: 0.5, Fc: 0.2, J: 0.01}");
    let made = imported(&single(
        "<joint name=\"q\" stiffness=\"3\" springref=\"0.4\"/>",
    ));
    assert_has(&made.spec, "spring: {rest: 0.4}");
    assert_has(&made.spec, "nominal: {K: 3}");
}

#[test]
fn motors_are_where_actuators_and_tendons_pull() {
    let two = single(
        "<joint name=\"q1\"/><body name=\"b\"><inertial mass=\"1\" pos=\"0 1 0\" diaginertia=\"1 1 1\"/>\
         <joint name=\"q2\" axis=\"1 0 0\"/></body>",
    );
    let with = |section: &str| spec(&two.replace("</mujoco>", &format!("{section}</mujoco>")));
    assert_eq!(with("").matches("actuated: true").count(), 2);
    let one = with("<actuator><motor joint=\"q2\" gear=\"3\" ctrlrange=\"-2 2\"/></actuator>");
    assert_has(&one, "q2_motor: {of: 3*q2, limits: {effort: [-2, 2]}}");
    assert!(!one.contains("actuated: true"), "{one}");
    let direct = with("<actuator><motor joint=\"q2\" ctrlrange=\"-2 2\"/></actuator>");
    assert_has(
        &direct,
        "{name: q2, type: revolute, axis: x, body: b, actuated: true, limits: {effort: [-2, 2]}}",
    );
    assert_eq!(direct.matches("actuated: true").count(), 1);
    // all actuators share their defaults
    let by_class = two.replace(
        "<worldbody>",
        "<default><general gear=\"-7\"/></default><worldbody>",
    );
    let position =
        "<actuator><position name=\"m\" joint=\"q2\"/><velocity joint=\"q2\"/></actuator>";
    let by_class = spec(&by_class.replace("</mujoco>", &format!("{position}</mujoco>")));
    assert_has(&by_class, "drives:\n  m: {of: -7*q2}\n\n");
    let pulled = with(
        "<tendon><fixed name=\"t\"><joint joint=\"q1\" coef=\"1\"/></fixed></tendon>\
         <actuator><position tendon=\"t\"/></actuator>",
    );
    assert_has(
        &pulled,
        "name: q1, type: revolute, origin: {xyz: [0.1, 0.2, 0.3]}, body: a, actuated: true",
    );
    assert_eq!(pulled.matches("actuated: true").count(), 1);
    // a tendon over two joints is a motor of its own, beside that of one of them
    let tendon = |arms: [&str; 2], of_tendon: &str| {
        with(&format!(
            "<tendon><fixed name=\"pull\" {of_tendon}><joint joint=\"q1\" coef=\"{}\"/>\
             <joint joint=\"q2\" coef=\"{}\"/></fixed></tendon>\
             <actuator><motor tendon=\"pull\" gear=\"2\" ctrlrange=\"0 5\"/>\
             <motor joint=\"q2\"/></actuator>",
            arms[0], arms[1]
        ))
    };
    let geared = tendon(["0.5", "-0.5"], "");
    assert_has(&geared, "pull: {of: q1 - q2, limits: {effort: [0, 5]}}");
    assert_eq!(geared.matches("actuated: true").count(), 1);
    assert!(!geared.contains("independent:"), "{geared}");
    let pulled = tendon(
        ["0.01", "0.008"],
        "damping=\"3\" frictionloss=\"0.2\" range=\"-0.1 0.1\"",
    );
    assert_has(
        &pulled,
        "pull: {of: 0.02*q1 + 0.016*q2, type: prismatic, friction: linear, \
         limits: {position: [-0.2, 0.2], effort: [0, 5]}, nominal: {Fv: 0.75, Fc: 0.1}}",
    );
    // a tendon alone leaves a freedom, which one of its joints keeps
    let alone = with(
        "<tendon><fixed name=\"q1\"><joint joint=\"q1\" coef=\"0.5\"/>\
         <joint joint=\"q2\" coef=\"1\"/></fixed></tendon>\
         <actuator><position tendon=\"q1\"/></actuator>",
    );
    assert_has(&alone, "q1_2: {of: 0.5*q1 + q2}");
    assert!(!alone.contains("actuated: true"), "{alone}");
    assert_has(&alone, "independent: [q1, q1_2]");
    let wrong = two.replace(
        "</mujoco>",
        "<actuator><motor joint=\"q3\"/></actuator></mujoco>",
    );
    assert_has(&refused(&wrong), "no joint is called 'q3'");
}

#[test]
fn gravity_and_the_models_name_are_imported() {
    let text = single("<joint name=\"q\"/>");
    assert_has(&spec(&text), "name: m\n");
    assert_has(&spec(&text), "gravity: [0, 0, -9.81]");
    let turned = text.replace("<worldbody>", "<option gravity=\"0 -9.8 0\"/><worldbody>");
    assert_has(&spec(&turned), "gravity: [0, -9.8, 0]");
}

#[test]
fn a_full_inertia_is_the_same_as_one_by_its_axes() {
    let text = single("<joint name=\"q\"/>");
    let full = text.replace(
        "diaginertia=\"0.03 0.02 0.015\"",
        "fullinertia=\"0.03 0.02 0.015 0 0 0\"",
    );
    assert_eq!(spec(&full), spec(&text));
    let off = text.replace(
        "diaginertia=\"0.03 0.02 0.015\"",
        "fullinertia=\"0.03 0.02 0.015 1e-3 2e-3 3e-3\"",
    );
    assert_has(
        &spec(&off),
        "inertia: [0.03, 0.001, 0.002, 0.02, 0.003, 0.015]",
    );
    let turned = text.replace("<inertial ", "<inertial quat=\"1 0 0 1\" ");
    assert_has(&spec(&turned), "inertia: [0.02, 0, 0, 0.03, 0, 0.015]");
}

/// A body with the given geoms.
fn solid(geoms: &str) -> String {
    single(&format!("<joint name=\"q\"/>{geoms}")).replace(INERTIAL, "")
}

#[test]
fn geoms_give_the_inertia_of_bodies_without_one() {
    // computed by hand, with a mass of 6 kg each
    for (geom, inertia) in [
        ("type=\"sphere\" size=\"0.5\"", "0.6, 0, 0, 0.6, 0, 0.6"),
        ("size=\"0.5\"", "0.6, 0, 0, 0.6, 0, 0.6"),
        (
            "type=\"box\" size=\"0.1 0.2 0.3\"",
            "0.26, 0, 0, 0.2, 0, 0.1",
        ),
        ("type=\"ellipsoid\" size=\"1 2 3\"", "15.6, 0, 0, 12, 0, 6"),
        (
            "type=\"cylinder\" size=\"0.2 0.5\"",
            "0.56, 0, 0, 0.56, 0, 0.12",
        ),
        (
            "type=\"cylinder\" size=\"0.2\" fromto=\"-0.5 0 0 0.5 0 0\"",
            "0.12, 0, 0, 0.56, 0, 0.56",
        ),
    ] {
        let spec = spec(&solid(&format!("<geom mass=\"6\" {geom}/>")));
        assert_has(&spec, &format!("a: {{mass: 6, inertia: [{inertia}]}}"));
    }
    // mass as density times volume, and two geoms combined
    let spec = |geoms: &str| spec(&solid(geoms));
    assert_has(
        &spec("<geom type=\"box\" size=\"0.1 0.1 0.1\"/>"),
        "a: {mass: 8, ",
    );
    assert_has(
        &spec("<geom type=\"box\" size=\"0.1 0.1 0.1\" density=\"500\"/>"),
        "a: {mass: 4, ",
    );
    let two = "<geom mass=\"1\" size=\"0.5\" pos=\"1 0 0\"/><geom mass=\"3\" size=\"0.5\" pos=\"-1 0 0\"/>";
    assert_has(
        &spec(two),
        "a: {mass: 4, com: [-0.5, 0, 0], inertia: [0.4, 0, 0, 3.4, 0, 3.4]}",
    );
}

#[test]
fn a_capsule_is_a_cylinder_between_half_spheres() {
    let spec = parsed(&spec(&solid(
        "<geom type=\"capsule\" size=\"0.1 0.2\" density=\"1000\"/>",
    )));
    let (r, l) = (0.1_f64, 0.4_f64);
    let pi = std::f64::consts::PI;
    let middle = 1000.0 * pi * r * r * l;
    let ball = 1000.0 * 4.0 / 3.0 * pi * r * r * r;
    // one half sphere about its centre of mass, then by the parallel axis theorem
    let half = ball / 2.0 * (0.4 - 9.0 / 64.0) * r * r;
    let across = middle * (3.0 * r * r + l * l) / 12.0
        + 2.0 * (half + ball / 2.0 * (l / 2.0 + 3.0 / 8.0 * r) * (l / 2.0 + 3.0 / 8.0 * r));
    let along = middle * r * r / 2.0 + ball * 0.4 * r * r;
    let body = &spec.bodies[0].1;
    let close = |x: f64, y: f64| (x - y).abs() < 1e-11 * y;
    assert!(close(body.mass.value.to_f64(), middle + ball));
    assert!(close(body.inertia[0].value.to_f64(), across));
    assert!(close(body.inertia[5].value.to_f64(), along));
}

#[test]
fn a_compiler_setting_decides_which_inertias_count() {
    let both = single("<joint name=\"q\"/><geom mass=\"6\" size=\"0.5\"/>");
    let by_compiler =
        |setting: &str| spec(&both.replace("<compiler", &format!("<compiler {setting}")));
    assert_has(&by_compiler(""), "a: {mass: 2, ");
    assert_has(&by_compiler("inertiafromgeom=\"true\""), "a: {mass: 6, ");
    let bare = solid("<geom mass=\"6\" size=\"0.5\"/>");
    let none = bare.replace("<compiler", "<compiler inertiafromgeom=\"false\"");
    assert_has(&refused(&none), "nothing with mass moves");
    let group = bare.replace("<compiler", "<compiler inertiagrouprange=\"1 2\"");
    assert_has(&refused(&group), "nothing with mass moves");
    assert_has(
        &spec(&group.replace("<geom", "<geom group=\"2\"")),
        "a: {mass: 6, ",
    );
    assert_has(&by_compiler("settotalmass=\"7\""), "a: {mass: 7, ");
}

#[test]
fn a_body_of_meshes_and_solids_has_no_values_and_is_reported() {
    let text =
        solid("<geom type=\"mesh\" mesh=\"m\"/><geom mass=\"1\" size=\"0.5\" pos=\"0 0 1\"/>");
    let made = imported(&text);
    assert_has(&made.spec, "# The file states no mass of: a");
    assert!(!made.spec.contains("mass: 1"), "{}", made.spec);
    assert_has(
        &notes(&made),
        "bodies without values, since their mass is in meshes that are not read (no mesh is called 'm'): 'a'",
    );
}

#[test]
fn a_reference_shifts_the_coordinate_and_home() {
    let text = single("<joint name=\"q\" ref=\"0.5\"/>");
    let spec = spec(&text);
    assert_has(&spec, "origin: {xyz: [0.1, 0.2, 0.3], rpy: [0, 0, -0.5]}");
    assert_has(&spec, "home: {q: 0.5}");
    let slide = imported(&single("<joint name=\"q\" type=\"slide\" ref=\"0.5\"/>")).spec;
    assert_has(&slide, "origin: {xyz: [0.1, 0.2, -0.2]}");
}

#[test]
fn unnamed_bodies_and_joints_get_names() {
    let text = single("<joint/>").replace("name=\"a\"", "");
    assert_has(&spec(&text), "name: body1_joint");
    assert_has(&spec(&text), "body: body1");
}

#[test]
fn unsupported_elements_are_refused_with_a_remedy() {
    for (text, complaint) in [
        (
            single("<joint type=\"screw\"/>"),
            "unknown joint type 'screw'",
        ),
        (
            single("<replicate count=\"3\"/>"),
            "<replicate> is not expanded (save the compiled model",
        ),
        (
            single("<joint/>").replace("<compiler", "<compiler coordinate=\"global\""),
            "global coordinates",
        ),
        (
            single("<joint/>").replace("mass=\"2\"", ""),
            "<inertial> has no mass",
        ),
        (
            single("<joint/><body name=\"a\"/>"),
            "another body is called 'a' already",
        ),
        (oriented("quat=\"0 0 0 0\""), "a quaternion of length zero"),
        (oriented("zaxis=\"0 0 0\""), "zaxis gives no direction"),
        ("<mujoco/>".to_owned(), "there is no body"),
    ] {
        assert_has(&refused(&text), complaint);
    }
}
