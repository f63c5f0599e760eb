//! Parameters written back to URDF: the right numbers in the right frames, and no other byte
//! changed.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use crate::common::{assert_has, attempt, imported, imported_with, parsed, published};
use regen_codegen::diag::Source;
use regen_import::{BodyParameters, Exported, JointParameters, Options, Parameters, export};

fn tried(urdf: &str, spec: &str, parameters: &Parameters) -> Result<Exported, String> {
    let labels = parameters
        .bodies
        .iter()
        .map(|b| &b.0)
        .chain(parameters.joints.iter().map(|j| &j.0));
    let json: Vec<String> = labels.map(|l| format!("\"{l}\"")).collect();
    let given = Source::new("fit.json", json.join("\n"));
    let urdf = Source::new("robot.urdf", urdf);
    let mut reader = |name: &str| match name {
        "more.xml" => Ok(INCLUDED.as_bytes().to_vec()),
        _ => Err("there is none".to_owned()),
    };
    let spec = Source::new("spec.yaml", spec);
    export(&urdf, &mut reader, &spec, &given, parameters).map_err(|reports| {
        let lines: Vec<String> = reports.iter().map(ToString::to_string).collect();
        lines.join("\n")
    })
}

#[track_caller]
fn exported(urdf: &str, spec: &str, parameters: &Parameters) -> String {
    tried(urdf, spec, parameters)
        .unwrap_or_else(|e| panic!("{e}"))
        .text
}

fn of_friction(viscous: Option<f64>, coulomb: Option<f64>) -> JointParameters {
    JointParameters {
        viscous,
        coulomb,
        ..JointParameters::default()
    }
}

/// Parameters of a body that no file contains.
fn body(k: usize) -> BodyParameters {
    let x = 0.01 * (k + 1) as f64;
    BodyParameters {
        mass: 1.5 + x,
        com: [x, -2.0 * x, 0.3 + x],
        inertia: [0.3 + x / 10.0, 0.01, -0.02, 0.25, 0.03 - x / 20.0, 0.2],
    }
}

fn of_bodies(bodies: Vec<(String, BodyParameters)>) -> Parameters {
    Parameters {
        bodies,
        joints: Vec::new(),
    }
}

/// A text without the numbers of inertias.
fn without_inertias(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(start) = rest.find("<inertial>") {
        let end = start + rest[start..].find("</inertial>").unwrap();
        out.push_str(&rest[..start]);
        // text between the numbers is kept
        out.extend(
            rest[start..end]
                .chars()
                .filter(|c| !"0123456789.eE-+".contains(*c)),
        );
        rest = &rest[end..];
    }
    out + rest
}

/// A round trip: every body gets new values, and importing the changed file returns them.
#[track_caller]
fn assert_round_trip(file: &str, locked: &[&str]) -> Vec<String> {
    let source = published(file);
    let options = Options {
        lock: locked.iter().map(ToString::to_string).collect(),
        ..Options::default()
    };
    let spec = attempt(&source, &options).unwrap().spec;
    let labels = parsed(&spec).body_labels();
    let bodies = labels.iter().enumerate().map(|(k, l)| (l.clone(), body(k)));
    let parameters = of_bodies(bodies.collect());
    let written = tried(&source.text, &spec, &parameters).unwrap_or_else(|e| panic!("{e}"));
    let urdf = written.text;
    assert_ne!(urdf, source.text);
    assert_eq!(
        without_inertias(&urdf),
        without_inertias(&source.text),
        "{file}"
    );
    let again = parsed(&imported_with(&urdf, &options).spec);
    assert_eq!(again.bodies.len(), parameters.bodies.len());
    for (label, values) in &parameters.bodies {
        let (_, read) = again.bodies.iter().find(|b| b.0.value == *label).unwrap();
        // rotated tensors are written with twelve digits
        let close = |x: f64, y: f64| assert!((x - y).abs() < 1e-11, "{file}, {label}: {x} {y}");
        close(read.mass.value.to_f64(), values.mass);
        for k in 0..3 {
            close(read.com[k].value.to_f64(), values.com[k]);
        }
        for k in 0..6 {
            close(read.inertia[k].value.to_f64(), values.inertia[k]);
        }
    }
    written.notes.iter().map(ToString::to_string).collect()
}

#[test]
fn exported_files_differ_from_the_original_only_in_the_numbers() {
    // upkie has frames rotated against the links' frames, ur5e rotated inertial frames,
    // trifingerpro tensors with all nine entries
    assert_round_trip("upkie-description/upkie.urdf", &[]);
    assert_round_trip("airo-models/ur5e.urdf", &[]);
    assert_round_trip("robot-properties-fingers/trifingerpro.urdf", &[]);
    assert_round_trip("jvrc-description/jvrc1.urdf", &[]);
}

#[test]
fn joints_that_the_spec_has_locked_are_found_where_they_are() {
    // at the base, between coordinates, at the last body, and two whose axes are parallel
    let file = "airo-models/ur5e.urdf";
    for locked in [
        &["shoulder_pan_joint=0.4"][..],
        &["elbow_joint=-0.5"],
        &["wrist_3_joint=0.7"],
        &[
            "shoulder_pan_joint=0.4",
            "elbow_joint=-0.5",
            "wrist_3_joint=0.7",
        ],
    ] {
        let notes = assert_round_trip(file, locked).join("\n");
        for own in locked {
            let (name, value) = own.split_once('=').unwrap();
            assert_has(
                &notes,
                &format!("the spec has '{name}' locked at {value}00000"),
            );
        }
    }
    // a joint that is locked at 0, as those without a coordinate were taken always
    assert_eq!(assert_round_trip(file, &["elbow_joint"]), [""; 0]);
    // several trees
    let file = "robot-properties-fingers/trifingerpro.urdf";
    assert_round_trip(file, &["finger_middle_to_lower_joint_120=-1.1"]);
}

#[test]
fn a_slide_locked_below_an_arm_does_not_change_it() {
    let lifted = ARM.replace(
        "<joint name=\"q\"",
        "<link name=\"lift\"/><joint name=\"l\" type=\"prismatic\"><parent link=\"base\"/><child \
         link=\"lift\"/><axis xyz=\"0 1 0\"/><limit lower=\"0\" upper=\"1\" effort=\"9\" \
         velocity=\"1\"/></joint>\n  <joint name=\"q\"",
    );
    let lifted = lifted.replace(
        "<parent link=\"base\"/><child link=\"a\"/>",
        "<parent link=\"lift\"/><child link=\"a\"/><origin xyz=\"0.2 0 0\" rpy=\"0.1 0 0\"/>",
    );
    let options = Options {
        lock: vec!["l=0.25".to_owned()],
        ..Options::default()
    };
    let spec = imported_with(&lifted, &options).spec;
    let found = tried(&lifted, &spec, &one(plain())).unwrap();
    assert_has(&found.text, "xyz=\"0 0.01 0.2\"");
    let notes: Vec<String> = found.notes.iter().map(ToString::to_string).collect();
    assert_has(&notes.join("\n"), "'l' locked at 0.250000");
    // of a body whose frame is its own, where the joint is cannot be told
    let own = spec.replacen("body: a,", "", 1).replacen(
        "\nbodies:",
        "      - {type: fixed, origin: {xyz: [0, 0, 0.05]}, body: a}\n\nbodies:",
        1,
    );
    let own = own.replacen("rpy: [0.1, 0, 0]", "rpy: [0.3, 0, 0]", 1);
    let found = tried(&lifted, &own, &one(plain()));
    assert_has(
        &found.unwrap_err(),
        "does not move with the link of that name",
    );
}

const ARM: &str = r#"<robot name="arm">
  <!-- kept -->
  <link name="base"/>
  <link name="a">
    <inertial>
      <origin rpy="0 0 0" xyz="0 0 0.1"/>
      <mass value="2"/>
      <inertia ixx="0.03" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.015"/>
    </inertial>
  </link>
  <joint name="q"   type='continuous' >
    <parent link="base"/><child link="a"/>
    <axis xyz="0 0 1"/>
    <dynamics damping='0.5'/>
  </joint>
</robot>
"#;

fn one(values: BodyParameters) -> Parameters {
    of_bodies(vec![("a".to_owned(), values)])
}

fn plain() -> BodyParameters {
    BodyParameters {
        mass: 2.5,
        com: [0.0, 0.01, 0.2],
        inertia: [0.04, 0.001, 0.0, 0.03, 0.0, 0.02],
    }
}

#[test]
fn numbers_are_replaced_in_place() {
    let spec = imported(ARM).spec;
    let expected = ARM
        .replace("xyz=\"0 0 0.1\"", "xyz=\"0 0.01 0.2\"")
        .replace("value=\"2\"", "value=\"2.5\"")
        .replace(
            "ixx=\"0.03\" ixy=\"0\" ixz=\"0\" iyy=\"0.02\" iyz=\"0\" izz=\"0.015\"",
            "ixx=\"0.04\" ixy=\"0.001\" ixz=\"0\" iyy=\"0.03\" iyz=\"0\" izz=\"0.02\"",
        );
    assert_eq!(exported(ARM, &spec, &one(plain())), expected);
    // without parameters nothing is changed
    assert_eq!(exported(ARM, &spec, &Parameters::default()), ARM);
}

#[test]
fn missing_elements_of_an_inertia_are_written() {
    let spec = imported(ARM).spec;
    for lacking in [
        ARM.replace("<origin rpy=\"0 0 0\" xyz=\"0 0 0.1\"/>", ""),
        ARM.replace(" xyz=\"0 0 0.1\"", ""),
        ARM.replace("<mass value=\"2\"/>", ""),
    ] {
        let urdf = exported(&lacking, &spec, &one(plain()));
        let again = imported(&urdf).spec;
        assert_has(
            &again,
            "a: {mass: 2.5, com: [0, 0.01, 0.2], inertia: [0.04, 0.001, 0, 0.03, 0, 0.02]}",
        );
    }
}

#[test]
fn friction_is_replaced_or_added_and_its_other_parts_are_unchanged() {
    let spec = imported(ARM).spec;
    let friction = |viscous, coulomb| Parameters {
        bodies: Vec::new(),
        joints: vec![("q".to_owned(), of_friction(viscous, coulomb))],
    };
    let urdf = exported(ARM, &spec, &friction(Some(0.75), None));
    assert_eq!(urdf, ARM.replace("damping='0.5'", "damping='0.75'"));
    let urdf = exported(ARM, &spec, &friction(Some(0.75), Some(0.25)));
    assert_eq!(
        urdf,
        ARM.replace(
            "<dynamics damping='0.5'",
            "<dynamics friction=\"0.25\" damping='0.75'"
        )
    );
    let bare = ARM.replace("    <dynamics damping='0.5'/>\n", "");
    let urdf = exported(&bare, &spec, &friction(Some(0.75), None));
    let written = "type='continuous' >\n    <dynamics damping=\"0.75\"/>\n    <parent";
    assert_eq!(
        urdf,
        bare.replace("type='continuous' >\n    <parent", written)
    );
    assert_has(
        &tried(ARM, &spec, &friction(Some(-1.0), None)).unwrap_err(),
        "q: the damping is negative or not finite",
    );
}

#[test]
fn a_spec_with_frames_of_its_own_is_understood() {
    // the body's frame is rotated by a fixed joint, and its label stays the same
    let spec = imported(ARM).spec.replace(
        "- {name: q, type: revolute, body: a, actuated: true, friction: viscous, nominal: {Fv: 0.5}}",
        "- {name: q, type: revolute, actuated: true}\n      - {type: fixed, origin: {xyz: [0, 0, 0.05], rpy: [pi/2, 0, 0]}, body: a}",
    );
    assert_has(&spec, "type: fixed");
    let urdf = exported(ARM, &spec, &one(plain()));
    // y of the body is z of the link, z is -y
    assert_has(&urdf, "xyz=\"0 -0.2 0.06\"");
    assert_has(
        &urdf,
        "ixx=\"0.04\" ixy=\"0\" ixz=\"0.001\" iyy=\"0.02\" iyz=\"0\" izz=\"0.03\"",
    );
}

#[test]
fn a_spec_of_another_robot_is_refused() {
    let spec = imported(&ARM.replace("0 0 1\"/>", "0 1 0\"/>")).spec;
    let complaint = tried(ARM, &spec, &one(plain())).unwrap_err();
    assert_has(&complaint, "spec.yaml:12:");
    assert_has(
        &complaint,
        "body 'a' does not move with the link of that name",
    );
    let renamed = imported(&ARM.replace("\"a\"", "\"b\"")).spec;
    let complaint = tried(ARM, &renamed, &one(plain())).unwrap_err();
    assert_has(
        &complaint,
        "fit.json:1:1: a: the spec has no body 'a' (its bodies are b)",
    );
}

#[test]
fn values_that_no_body_can_have_are_refused() {
    let spec = imported(ARM).spec;
    let with = |change: &dyn Fn(&mut BodyParameters)| {
        let mut values = plain();
        change(&mut values);
        tried(ARM, &spec, &one(values)).unwrap_err()
    };
    assert_has(&with(&|v| v.mass = 0.0), "fit.json:1:1: a: a mass of 0 kg");
    assert_has(&with(&|v| v.mass = -1.0), "a mass of -1 kg");
    assert_has(
        &with(&|v| v.mass = f64::NAN),
        "a value that is not a number",
    );
    assert_has(
        &with(&|v| v.inertia[0] = -0.01),
        "not positive semidefinite",
    );
    assert_has(&with(&|v| v.inertia[1] = 0.05), "not positive semidefinite");
    assert_has(
        &with(&|v| v.inertia[0] = 0.06),
        "breaks the triangle inequality",
    );
}

#[test]
fn friction_that_is_unchanged_or_has_no_joint_is_reported() {
    let spec = imported(ARM).spec;
    let given = |name: &str, viscous, coulomb| Parameters {
        bodies: Vec::new(),
        joints: vec![(name.to_owned(), of_friction(viscous, coulomb))],
    };
    let notes = |spec: &str, parameters: &Parameters| -> Vec<String> {
        let found = tried(ARM, spec, parameters).unwrap();
        found.notes.iter().map(ToString::to_string).collect()
    };
    // a new Coulomb friction does not remove the old damping from the file
    let printed_notes = notes(&spec, &given("q", None, Some(0.25)));
    assert_eq!(printed_notes.len(), 1, "{printed_notes:?}");
    assert_has(
        &printed_notes[0],
        "damping=\"0.5\" of joint 'q' stays: no new one is given",
    );
    assert!(notes(&spec, &given("q", Some(1.0), Some(0.25))).is_empty());
    assert!(notes(&spec, &given("q", None, None)).is_empty());
    // the spec has a massless drive in addition, without a joint in the file
    let limb = "limbs:\n  - name: drives\n    joints:\n      - {name: motor, type: revolute, \
                friction: viscous, rotor_inertia: true}\n";
    let more = spec.replacen("limbs:\n", limb, 1);
    let printed_notes = notes(&more, &given("motor", Some(1.0), None));
    assert_eq!(printed_notes.len(), 1, "{printed_notes:?}");
    assert_has(&printed_notes[0], "no joint for the coordinate 'motor'");
    let geared = spec.replacen(
        "limbs:\n",
        "drives: {motor: {of: 50*q, friction: viscous, rotor_inertia: true}}\nlimbs:\n",
        1,
    );
    let printed_notes = notes(&geared, &given("motor", Some(1.0), None));
    assert_eq!(printed_notes.len(), 1, "{printed_notes:?}");
    assert_has(&printed_notes[0], "no joint for the drive 'motor'");
}

#[test]
fn labels_and_joints_that_the_file_lacks_are_refused() {
    let spec = imported(ARM).spec;
    let other = of_bodies(vec![("z".to_owned(), plain())]);
    assert_has(
        &tried(ARM, &spec, &other).unwrap_err(),
        "the spec has no body 'z'",
    );
    let joint = Parameters {
        bodies: Vec::new(),
        joints: vec![("p".to_owned(), JointParameters::default())],
    };
    assert_has(
        &tried(ARM, &spec, &joint).unwrap_err(),
        "no joint of the URDF file is called 'p'",
    );
    assert_has(
        &tried("<rob/>", &spec, &other).unwrap_err(),
        "<rob> is none of URDF, MJCF, SDF and USD",
    );
}

/// An arm of MuJoCo: a hinge with a spring, and a slide in a class of its own.
const MJCF: &str = r#"<mujoco model="arm">
  <compiler angle="radian"/>
  <default><default class="soft"><joint damping="3"/></default></default>
  <worldbody>
    <body name="a" pos="0 0 0.5">
      <inertial pos="0 0 0.1" quat="0.8 0.6 0 0" mass="2" diaginertia="0.03 0.02 0.015"/>
      <joint name="q" axis="0 1 0" damping="0.5" stiffness="4" springref="0.2"/>
      <body name="b" pos="0.1 0 0.3">
        <!-- kept -->
        <joint name="s" type="slide" class="soft" axis="1 0 0"/>
        <geom type="sphere" size="0.1" density="100"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"#;

/// A body in a file of its own.
const INCLUDED: &str = r#"<mujoco><worldbody><body name="b"><joint name="s" type="slide"/>
  <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>"#;

#[test]
fn bodies_rotors_and_springs_are_written_into_mjcf() {
    let spec = imported(MJCF).spec;
    let whole = JointParameters {
        armature: Some(0.25),
        stiffness: Some(5.5),
        others: vec!["Fo".to_owned()],
        ..of_friction(Some(0.75), Some(0.125))
    };
    let parameters = Parameters {
        bodies: vec![("a".to_owned(), plain()), ("b".to_owned(), body(3))],
        joints: vec![
            ("q".to_owned(), whole),
            ("s".to_owned(), of_friction(Some(2.0), None)),
        ],
    };
    let found = tried(MJCF, &spec, &parameters).unwrap();
    let expected = MJCF
        .replace(
            "pos=\"0 0 0.1\" quat=\"0.8 0.6 0 0\" mass=\"2\" diaginertia=\"0.03 0.02 0.015\"",
            "fullinertia=\"0.04 0.03 0.02 0.001 0 0\" pos=\"0 0.01 0.2\" mass=\"2.5\"",
        )
        .replace(
            "<joint name=\"q\" axis=\"0 1 0\" damping=\"0.5\" stiffness=\"4\"",
            "<joint frictionloss=\"0.125\" armature=\"0.25\" name=\"q\" axis=\"0 1 0\" \
             damping=\"0.75\" stiffness=\"5.5\"",
        )
        .replace(
            "        <!-- kept -->",
            "        <inertial pos=\"0.04 -0.08 0.34\" mass=\"1.54\" \
             fullinertia=\"0.304 0.25 0.2 0.01 -0.02 0.028\"/>\n        <!-- kept -->",
        )
        .replace("<joint name=\"s\"", "<joint damping=\"2\" name=\"s\"");
    assert_eq!(found.text, expected);
    let notes: Vec<String> = found.notes.iter().map(ToString::to_string).collect();
    assert_eq!(notes.len(), 1, "{notes:?}");
    assert_has(&notes[0], "Fo(q) is left out: MJCF has no constant efforts");
    // and the changed file says the same to an import
    let again = imported(&found.text).spec;
    for part in [
        "a: {mass: 2.5, com: [0, 0.01, 0.2], inertia: [0.04, 0.001, 0, 0.03, 0, 0.02]}",
        "b: {mass: 1.54, com: [0.04, -0.08, 0.34]",
        "nominal: {Fv: 0.75, Fc: 0.125, J: 0.25, K: 5.5}",
    ] {
        assert_has(&again, part);
    }
}

#[test]
fn mjcf_settings_that_would_change_the_written_values_are_refused() {
    let spec = imported(MJCF).spec;
    let setting =
        |text: &str| MJCF.replace("angle=\"radian\"", &format!("angle=\"radian\" {text}"));
    for (file, words) in [
        (
            setting("settotalmass=\"5\""),
            "settotalmass=\"5\" scales all masses",
        ),
        (
            setting("inertiafromgeom=\"true\""),
            "inertiafromgeom=\"true\" replaces all inertias",
        ),
    ] {
        assert_has(&tried(&file, &spec, &one(plain())).unwrap_err(), words);
    }
    let shared = MJCF.replace("<worldbody>", "<include file=\"more.xml\"/><worldbody>");
    let shared = shared
        .replace("name=\"b\"", "name=\"c\"")
        .replace("name=\"s\"", "name=\"t\"");
    let mut reader = |_: &str| Ok(INCLUDED.as_bytes().to_vec());
    let source = Source::new("robot.xml", shared.clone());
    let spec = regen_import::import(&source, &mut reader, &Options::default())
        .unwrap()
        .spec;
    let elsewhere = of_bodies(vec![("b".to_owned(), plain())]);
    assert_has(
        &tried(&shared, &spec, &elsewhere).unwrap_err(),
        "body 'b' is in an included file",
    );
}

#[test]
fn parameters_without_a_place_are_reported_and_unknown_ones_refused() {
    let spec = imported(ARM).spec;
    let springy = spec.replace(
        "friction: viscous,",
        "friction: viscous, terms: {cog: sin(6*q)},",
    );
    let given = |others: &[&str]| Parameters {
        bodies: Vec::new(),
        joints: vec![(
            "q".to_owned(),
            JointParameters {
                stiffness: Some(2.0),
                others: others.iter().map(|s| (*s).to_owned()).collect(),
                ..of_friction(Some(1.0), None)
            },
        )],
    };
    let found = tried(ARM, &springy, &given(&["cog"])).unwrap();
    let notes: Vec<String> = found.notes.iter().map(ToString::to_string).collect();
    assert_has(
        &notes.join("\n"),
        "cog(q) is left out: URDF has no effort terms",
    );
    assert_has(&notes.join("\n"), "K(q) is left out: URDF has no springs");
    assert_has(
        &tried(ARM, &springy, &given(&["Fs"])).unwrap_err(),
        "q: the joint has no parameter 'Fs'",
    );
}

#[test]
fn encoder_zeros_that_are_shifted_in_the_spec_are_followed() {
    // the coordinates of the first and the third joint are counted from other zeros
    let source = published("airo-models/ur5e.urdf");
    let spec = attempt(&source, &Options::default()).unwrap().spec;
    let moved = spec
        .replacen("dh: {alpha: pi/2}", "dh: {alpha: pi/2, theta: 0.3}", 1)
        .replacen("dh: {a: -0.425}", "dh: {a: -0.425, theta: -0.4}", 1);
    let labels = parsed(&spec).body_labels();
    let bodies: Vec<_> = labels
        .iter()
        .enumerate()
        .map(|(k, l)| (l.clone(), body(k)))
        .collect();
    let found = tried(&source.text, &moved, &of_bodies(bodies.clone())).unwrap();
    let unshifted = exported(&source.text, &spec, &of_bodies(bodies));
    // the shifts are found up to rounding
    let numbers = |text: &str| -> Vec<f64> {
        let words = text.split(['"', ' ']);
        words.filter_map(|word| word.parse().ok()).collect()
    };
    let (found_numbers, expected) = (numbers(&found.text), numbers(&unshifted));
    assert_eq!(found_numbers.len(), expected.len());
    for (found, expected) in found_numbers.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
    let notes: Vec<String> = found.notes.iter().map(ToString::to_string).collect();
    assert_eq!(notes.len(), 2, "{notes:?}");
    assert_has(
        &notes[0],
        "'shoulder_lift_joint' from another zero: in the file it is more by 0.300000",
    );
}

#[test]
fn a_spring_that_rests_elsewhere_in_the_spec_is_reported() {
    let spec = imported(MJCF).spec;
    assert_has(&spec, "rest: 0.2");
    let stiff = JointParameters {
        stiffness: Some(5.5),
        ..of_friction(None, None)
    };
    let parameters = Parameters {
        bodies: Vec::new(),
        joints: vec![("q".to_owned(), stiff)],
    };
    for (rest, expected) in [("rest: 0.2", false), ("rest: 0.3", true)] {
        let found = tried(MJCF, &spec.replace("rest: 0.2", rest), &parameters).unwrap();
        let notes: Vec<String> = found.notes.iter().map(ToString::to_string).collect();
        let told = notes.join("\n").contains("is relaxed at 0.2");
        assert_eq!(told, expected, "{notes:?}");
    }
}
