//! Loops, couplings and motors that robot files describe beside their tree: all formats of the same
//! five-bar are the same robot.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::collections::BTreeSet;

use crate::common::{
    assert_has, attempt, imported, imported_with, notes, parsed, published, refused, refused_with,
};
use regen_codegen::base::Term;
use regen_codegen::diag::Source;
use regen_codegen::pipeline::{BaseSource, derive_with};
use regen_import::{BodyParameters, JointParameters, Options, Parameters, export, import};

/// The links of a five-bar in the plane of x and z, with their first joints' places.
pub(crate) const LINKS: [(&str, f64, f64); 4] = [
    ("a", 0.1, 0.5),
    ("b", 0.15, 0.7),
    ("c", 0.12, 0.6),
    ("d", 0.16, 0.8),
];

/// A five-bar in URDF, opened at its tip.
pub(crate) fn five_bar(rest: &str) -> String {
    let links = LINKS.map(|(name, x, mass)| {
        format!(
            "<link name=\"{name}\"><inertial><origin xyz=\"{x} 0 0.01\"/><mass value=\"{mass}\"/>\
             <inertia ixx=\"0.001\" ixy=\"0\" ixz=\"0\" iyy=\"0.02\" iyz=\"0\" izz=\"0.02\"/></inertial></link>"
        )
    });
    let joint = |name: &str, parent: &str, child: &str, x: f64, pitch: f64| {
        format!(
            "<joint name=\"{name}\" type=\"continuous\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
             <origin xyz=\"{x} 0 0\" rpy=\"0 {pitch} 0\"/><axis xyz=\"0 1 0\"/></joint>"
        )
    };
    format!(
        "<robot name=\"five\"><link name=\"ground\"/>{}{}{}{}{}{rest}</robot>",
        links.concat(),
        joint("q1", "ground", "a", 0.0, -2.0),
        joint("p1", "a", "b", 0.2, 1.2),
        joint("q2", "ground", "c", 0.3, -1.1),
        joint("p2", "c", "d", 0.2, -1.2),
    )
}

/// The base parameters of a spec.
pub(crate) fn base(spec: &str) -> Vec<String> {
    let robot = derive_with(&Source::new("spec.yaml", spec), BaseSource::Derivation).unwrap();
    let base = &robot.analysis.as_ref().unwrap().base;
    let parameters = base.parameters.iter();
    let term = |t: &Term| format!("{:.9} {}", t.value.to_f64(), t.column);
    let sum = |terms: &[Term]| terms.iter().map(term).collect::<Vec<_>>().join(" + ");
    parameters.map(|p| sum(&p.terms)).collect()
}

pub(crate) fn cuts(spec: &str) -> String {
    let start = spec.find("\ncuts:").unwrap_or_else(|| panic!("{spec}"));
    let end = spec[start..].find("\n\n").unwrap();
    spec[start..start + end].to_owned()
}

#[test]
fn each_way_to_close_a_loop_in_urdf_is_a_cut() {
    let tip = "<origin xyz=\"0.35 0 0\"/>";
    let ball = "{body: b, xyz: [0.35, 0, 0]}, {body: d, xyz: [0.35, 0, 0]}";
    let about_y = "{body: b, xyz: [0.35, 0, 0], rpy: [-pi/2, 0, 0]}";
    for (closing, kind, part) in [
        (
            format!(
                "<loop name=\"tip\" type=\"continuous\"><predecessor link=\"b\">{tip}</predecessor>\
                 <successor link=\"d\">{tip}</successor></loop>"
            ),
            "revolute",
            about_y,
        ),
        (
            "<constraint name=\"tip\" type=\"revolute\"><parent link=\"b\"/><parent_origin xyz=\"0.35 0 0\"/>\
             <parent_axis xyz=\"0 1 0\"/><child link=\"d\"/><child_origin xyz=\"0.35 0 0\"/>\
             <child_axis xyz=\"0 1 0\"/></constraint>"
                .to_owned(),
            "revolute",
            about_y,
        ),
        (
            "<loop_constraint name=\"tip\"><parent link=\"b\"/><parent_origin xyz=\"0.35 0 0\"/>\
             <child link=\"d\"/><child_origin xyz=\"0.35 0 0\"/></loop_constraint>"
                .to_owned(),
            "spherical",
            ball,
        ),
        (
            "<drake:ball_constraint name=\"tip\"><drake:ball_constraint_body_A name=\"b\"/>\
             <drake:ball_constraint_body_B name=\"d\"/><drake:ball_constraint_p_AP value=\"0.35 0 0\"/>\
             <drake:ball_constraint_p_BQ value=\"0.35 0 0\"/></drake:ball_constraint>"
                .to_owned(),
            "spherical",
            ball,
        ),
        (
            "<gazebo><joint name=\"tip\" type=\"revolute\"><parent>b</parent><child>d</child>\
             <pose>0.35 0 0 0 0 0</pose><axis><xyz>0 1 0</xyz></axis></joint></gazebo>"
                .to_owned(),
            "revolute",
            "{body: d, xyz: [0.35, 0, 0], rpy: [-pi/2, 0, 0]}",
        ),
    ] {
        let found = imported(&five_bar(&closing));
        let told = notes(&found);
        assert!(!told.contains("not used"), "{closing}\n{told}");
        let cuts = cuts(&found.spec);
        assert_has(&cuts, "name: tip");
        assert_has(&cuts, &format!("joint: {kind}"));
        assert_has(&cuts, part);
        assert_eq!(parsed(&found.spec).cuts.len(), 1);
        assert_eq!(found.spec.matches("actuated: true").count(), 2);
    }
    for (wrong, complaint) in [
        (
            "<loop name=\"t\"><predecessor link=\"b\"/></loop>",
            "<loop> has no <successor>",
        ),
        (
            "<constraint type=\"floppy\"><parent link=\"b\"/><child link=\"d\"/></constraint>",
            "a loop cannot be closed by a joint of type 'floppy'",
        ),
        (
            "<constraint><parent link=\"b\"/><child link=\"x\"/></constraint>",
            "no link is called 'x'",
        ),
        (
            "<constraint type=\"universal\"><parent link=\"b\"/><child link=\"d\"/><axis xyz=\"1 0 0\"/></constraint>",
            "universal closure 'closure' has one axis",
        ),
        (
            "<drake:ball_constraint><drake:ball_constraint_body_A name=\"b\"/></drake:ball_constraint>",
            "has no <drake:ball_constraint_body_B>",
        ),
    ] {
        assert_has(&refused(&five_bar(wrong)), complaint);
    }
}

#[test]
fn motors_that_no_file_names_are_at_the_base_and_told() {
    let tip = "<origin xyz=\"0.35 0 0\"/>";
    let closing = format!(
        "<loop name=\"tip\" type=\"continuous\"><predecessor link=\"b\">{tip}</predecessor>\
         <successor link=\"d\">{tip}</successor></loop>"
    );
    let found = imported(&five_bar(&closing));
    let spec = parsed(&found.spec);
    let joints = spec.limbs.iter().flat_map(|limb| &limb.joints);
    let motors = joints.filter(|joint| joint.actuated);
    let motors: Vec<&str> = motors
        .map(|joint| joint.name.as_ref().unwrap().value.as_str())
        .collect();
    assert_eq!(motors, ["q1", "q2"]);
    let told = "no motors are named: q1, q2 have them here, as many as the robot has degrees of freedom (actuated \
                NAME,NAME names others)";
    assert_has(&notes(&found), told);
    let options = Options {
        actuated: vec!["q1".to_owned(), "p1".to_owned()],
        ..Options::default()
    };
    let chosen = imported_with(&five_bar(&closing), &options);
    assert!(!notes(&chosen).contains("no motors"), "{}", notes(&chosen));
}

#[test]
fn closed_states_are_proposed_that_the_spec_may_start_from() {
    // a rigid closure in a plane, whose rows depend on each other, out of reach where the motors are at 0
    let closing = "<link name=\"socket\"/><joint name=\"p3\" type=\"continuous\"><parent link=\"d\"/>\
                   <child link=\"socket\"/><origin xyz=\"0.1 0 0\"/><axis xyz=\"0 1 0\"/></joint>\
                   <constraint name=\"tip\" type=\"fixed\"><parent link=\"b\"/><parent_origin xyz=\"0.1 0 0\"/>\
                   <child link=\"socket\"/></constraint>";
    let text = five_bar(closing).replace(
        "xyz=\"0.3 0 0\" rpy=\"0 -1.1 0\"",
        "xyz=\"0.5 0 0\" rpy=\"0 1.1 0\"",
    );
    let motors = Options {
        actuated: vec!["q1".to_owned(), "q2".to_owned()],
        ..Options::default()
    };
    let complaint = refused_with(&text, &motors);
    assert_has(&complaint, "the loops close from `home ");
    let home = complaint.split("`home ").nth(1).unwrap();
    let home = home[..home.find('`').unwrap()].split(',');
    let options = Options {
        home: home.map(str::to_owned).collect(),
        ..motors
    };
    assert!(!options.home.is_empty(), "{complaint}");
    let spec = imported_with(&text, &options).spec;
    // no half turn, no other mobility
    let robot = derive_with(&Source::new("spec.yaml", spec.as_str()), BaseSource::Skip);
    assert_eq!(
        robot
            .unwrap_or_else(|e| panic!("{e}\n{spec}"))
            .independent
            .len(),
        2
    );
}

#[test]
fn axes_that_point_apart_are_those_of_the_same_hinge() {
    let constraint = |axis: &str| {
        let text = format!(
            "<constraint name=\"tip\" type=\"revolute\"><parent link=\"b\"/><parent_origin xyz=\"0.35 0 0\"/>\
             <parent_axis xyz=\"0 1 0\"/><child link=\"d\"/><child_origin xyz=\"0.35 0 0\"/>\
             <child_axis xyz=\"{axis}\"/></constraint>"
        );
        imported(&five_bar(&text)).spec
    };
    assert_eq!(constraint("0 -1 0"), constraint("0 1 0"));
}

#[test]
fn a_coupling_of_urdf_plus_ties_angles_against_the_link_that_carries_both() {
    let coupling = |first: &str, second: &str| {
        let text = format!(
            "<coupling name=\"belt\"><predecessor link=\"{first}\"/><successor link=\"{second}\"/>\
             <ratio value=\"-2\"/></coupling>"
        );
        imported(&five_bar(&text)).spec
    };
    assert_has(&coupling("a", "c"), "couplings:\n  q2: -2*q1\n");
    // a belt over two joints
    assert_has(&coupling("b", "c"), "couplings:\n  q2: -2*p1 - 2*q1\n");
    assert_has(&coupling("a", "d"), "couplings:\n  p2: -2*q1 - q2\n");
    let wrong =
        "<coupling><predecessor link=\"b\"/><successor link=\"a\"/><ratio value=\"1\"/></coupling>";
    assert_has(&refused(&five_bar(wrong)), "no joint moves the successor");
}

#[test]
fn a_robot_yaml_beside_the_file_closes_its_loops() {
    let tips = ["b", "d"].map(|link| {
        format!(
            "<link name=\"tip_{link}\"/><joint name=\"t{link}\" type=\"fixed\"><parent link=\"{link}\"/>\
             <child link=\"tip_{link}\"/><origin xyz=\"0.35 0 0\"/></joint>"
        )
    });
    let urdf = Source::new("five.urdf", five_bar(&tips.concat()));
    let with = |yaml: &'static str| {
        let mut reader = |name: &str| match name {
            "robot.yaml" => Ok(yaml.as_bytes().to_vec()),
            _ => Err("there is none".to_owned()),
        };
        import(&urdf, &mut reader, &Options::default())
    };
    let closed = "closed_loop: [[tip_b, tip_d]]\ntype: ['6d']\nname_mot: [q1]\n";
    let found = with(closed).unwrap();
    assert_has(&cuts(&found.spec), "joint: fixed");
    assert_has(
        &notes(&found),
        "robot.yaml:1:1: 1 loops are closed as this file says",
    );
    let found =
        with("name_mot: q\nclosed_loop:\n- [tip_b, tip_d]\ntype: [3D]\nother: 1\n").unwrap();
    assert_has(&cuts(&found.spec), "joint: spherical");
    assert_eq!(found.spec.matches("actuated: true").count(), 2);
    assert_has(
        &notes(&found),
        "robot.yaml:5:1: not used in robot.yaml: other",
    );
    // frames may be joints, and joints of other kinds
    let kinds = "closed_loop: [[tb, td]]\ntype: ['3d']\njoint_name: [p1, p2, q2]\n\
                 joint_type: [UJOINT_YZ, SPHERICAL, FIXED]\n";
    let found = with(kinds).unwrap();
    for part in [
        "{name: p1_y, type: revolute, origin: {xyz: [0.2, 0, 0], rpy: [0, 1.2, 0]}, axis: y}",
        "{name: p1_z, type: revolute, body: b",
        "name: p2\n        type: spherical",
    ] {
        assert_has(&found.spec, part);
    }
    assert!(!found.spec.contains("name: q2"), "{}", found.spec);
    let wrong =
        with("closed_loop: [[tb, td]]\ntype: ['3d']\njoint_name: [p1]\njoint_type: [UJOINT_YW]\n");
    assert_has(
        &wrong.unwrap_err()[0].to_string(),
        "the joint 'p1' cannot become 'UJOINT_YW'",
    );
    // a spec of that name says nothing about the file
    let other = with("name: five\nlimbs: []\n").unwrap();
    assert!(!other.spec.contains("cuts:"), "{}", other.spec);
    assert_has(
        &notes(&other),
        "robot.yaml:1:1: not read: it closes no loops, and names no motors",
    );
    let wrong = with("closed_loop: [[tip_b, tip_d]]\ntype: ['3d', '6d']\n").unwrap_err();
    assert_has(&wrong[0].to_string(), "2 types of 1 closed loops");
    let other = with("name_mot: wheel\nclosed_loop: [[tip_b, tip_d]]\ntype: ['3d']\n").unwrap();
    assert_has(&notes(&other), "robot.yaml:1:1: no joint is called so");
    // what cannot be read might close loops
    for (text, message) in [
        (
            "closed_loop: [[tip_b, tip_d]\ntype: ['6d']\n",
            "no YAML: line 2 column 5: ",
        ),
        ("closed_loop: tip_b tip_d\n", "closed_loop is no list"),
        (
            "# é\nclosed_loop: [[\"tip\\x5fz\", tip_d]]\ntype: ['6d']\n",
            "no link is called 'tip_z'",
        ),
    ] {
        assert_has(&with(text).unwrap_err()[0].to_string(), message);
    }
    let wrong = with("closed_loop: [[tip_b, tip]]\ntype: ['3d']\n").unwrap_err();
    assert_has(&wrong[0].to_string(), "no link is called 'tip'");
}

/// The error about a five-bar whose tips are welded, one of them in this place.
fn refused_tips(origin: &str) -> String {
    let tips = [("b", "xyz=\"0.35 0 0\""), ("d", origin)].map(|(link, origin)| {
        format!(
            "<link name=\"tip_{link}\"/><joint name=\"t{link}\" type=\"fixed\"><parent link=\"{link}\"/>\
             <child link=\"tip_{link}\"/><origin {origin}/></joint>"
        )
    });
    let urdf = Source::new("five.urdf", five_bar(&tips.concat()));
    let mut reader = |name: &str| match name {
        "robot.yaml" => Ok(b"closed_loop: [[tip_b, tip_d]]\ntype: ['6d']\n".to_vec()),
        _ => Err("there is none".to_owned()),
    };
    let found = import(&urdf, &mut reader, &Options::default());
    found.unwrap_err()[0].to_string()
}

#[test]
fn loops_that_no_state_closes_are_told_with_their_gaps_and_what_would_close_them() {
    // the axes of a five-bar are parallel, so that its tips never turn to each other
    let turned = refused_tips("xyz=\"0.35 0 0\" rpy=\"0.3 0 0\"");
    assert_has(&turned, "the loops do not close, wherever they start");
    assert_has(&turned, "cut 'tip_b_tip_d' gapes by");
    assert_has(&turned, "they close where cuts hold points alone");
    let apart = refused_tips("xyz=\"0.35 0.1 0\"");
    assert_has(
        &apart,
        "at the nearest state that was found cut 'tip_b_tip_d' gapes by 0.1 m",
    );
    assert_has(&apart, "contradict one another, or joints are missing");
}

#[test]
fn transmissions_are_drives_with_their_ratio_and_rotor() {
    let with = |transmission: &str| imported(&five_bar(transmission)).spec;
    let simple = |joint: &str, inside: &str| {
        format!(
            "<transmission name=\"t\"><type>transmission_interface/SimpleTransmission</type>\
             <joint name=\"{joint}\"/><actuator name=\"m_{joint}\">{inside}</actuator></transmission>"
        )
    };
    let geared = with(&format!(
        "{}{}",
        simple(
            "q1",
            "<mechanicalReduction>100</mechanicalReduction><motorInertia>3.2e-5</motorInertia>"
        ),
        simple("q2", "<mechanicalReduction>-51</mechanicalReduction>")
    ));
    assert_has(
        &geared,
        "drives:\n  m_q1: {of: 100*q1, rotor_inertia: true, nominal: {J: 3.2e-5}}\n  m_q2: {of: -51*q2}\n",
    );
    let direct = with(&simple("q1", "<motorInertia>0.1</motorInertia>"));
    assert_has(
        &direct,
        "actuated: true\n        rotor_inertia: true\n        nominal: {J: 0.1}",
    );
    assert!(!direct.contains("drives:"), "{direct}");
    let drake = with(&simple(
        "q1",
        "<drake:gear_ratio value=\"7\"/><drake:rotor_inertia value=\"1e-4\"/>",
    ));
    assert_has(
        &drake,
        "m_q1: {of: 7*q1, rotor_inertia: true, nominal: {J: 0.0001}}",
    );
    let control = with(
        "<ros2_control name=\"c\" type=\"system\"><joint name=\"q1\"><command_interface name=\"effort\"/></joint>\
         <transmission name=\"t\"><plugin>transmission_interface/SimpleTransmission</plugin>\
         <actuator name=\"m\" role=\"actuator1\"/><joint name=\"q1\" role=\"joint1\">\
         <mechanical_reduction>9</mechanical_reduction></joint></transmission></ros2_control>",
    );
    assert_has(&control, "m: {of: 9*q1}");
    let differential = with(
        "<transmission name=\"t\"><type>transmission_interface/DifferentialTransmission</type>\
         <actuator name=\"m2\"><role>actuator2</role><mechanicalReduction>-20</mechanicalReduction></actuator>\
         <actuator name=\"m1\"><role>actuator1</role><mechanicalReduction>10</mechanicalReduction></actuator>\
         <joint name=\"q1\"><role>joint1</role></joint>\
         <joint name=\"p1\"><role>joint2</role><mechanicalReduction>2</mechanicalReduction></joint></transmission>",
    );
    assert_has(&differential, "m1: {of: 10*q1 + 20*p1}");
    assert_has(&differential, "m2: {of: -20*q1 + 40*p1}");
    let still = five_bar(&simple(
        "q1",
        "<mechanicalReduction>0</mechanicalReduction>",
    ));
    assert_has(&refused(&still), "the motor 'm_q1' has a ratio of 0");
    // drives have friction and rotors with the option, unless their joints have them
    let options = Options {
        geared: true,
        ..Options::default()
    };
    let text = five_bar(&simple(
        "q2",
        "<mechanicalReduction>5</mechanicalReduction>",
    ));
    assert_has(
        &imported_with(&text, &options).spec,
        "m_q2: {of: 5*q2, friction: linear, rotor_inertia: true}",
    );
}

#[test]
fn limits_of_acceleration_and_jerk_are_those_of_the_spec() {
    let text = five_bar("").replacen(
        "<axis",
        "<limit effort=\"9\" velocity=\"2\" acceleration=\"20\" jerk=\"300\"/><axis",
        1,
    );
    let found = imported(&text);
    assert_has(
        &found.spec,
        "limits: {velocity: [-2, 2], acceleration: [-20, 20], jerk: [-300, 300], effort: [-9, 9]}",
    );
    assert!(!notes(&found).contains("jerk"), "{}", notes(&found));
}

#[test]
fn a_rotation_by_a_quaternion_is_read() {
    let turned = |origin: &str| {
        let text = five_bar("").replacen("<origin xyz=\"0.1 0 0.01\"/>", origin, 1);
        imported(&text).spec
    };
    assert_eq!(
        turned("<origin xyz=\"0.1 0 0.01\" quat_xyzw=\"0 0 1 0\"/>"),
        turned("<origin xyz=\"0.1 0 0.01\" rpy=\"0 0 3.14159265358979\"/>")
    );
}

#[test]
fn springs_between_points_are_springs_of_the_spec() {
    let mjcf = |tendon: &str| {
        format!(
            "<mujoco model=\"m\"><worldbody><site name=\"s0\" pos=\"0 0 0.1\"/>\
             <body name=\"a\"><inertial pos=\"0.1 0 0\" mass=\"2\" diaginertia=\"0.02 0.03 0.04\"/>\
             <joint name=\"q\" axis=\"0 1 0\"/><site name=\"s1\" pos=\"0.3 0 0.5\"/></body></worldbody>\
             <tendon>{tendon}</tendon></mujoco>"
        )
    };
    let sites = "<site site=\"s0\"/><site site=\"s1\"/>";
    let spec = |attributes: &str| {
        imported(&mjcf(&format!(
            "<spatial name=\"T\" {attributes}>{sites}</spatial>"
        )))
        .spec
    };
    let between = "between: [{body: world, xyz: [0, 0, 0.1]}, {body: a, xyz: [0.3, 0, 0.5]}]";
    let stiff = spec("stiffness=\"150\" springlength=\"0.4\"");
    assert_has(
        &stiff,
        &format!("name: T\n    {between}\n    length: 0.4\n    nominal: {{k: 150}}"),
    );
    // relaxed as drawn: a triangle of 3, 4, 5
    assert_has(&spec("stiffness=\"150\""), "length: 0.5\n");
    for (tendon, why) in [
        (
            format!("<spatial name=\"T\">{sites}</spatial>"),
            "T, since it has no spring",
        ),
        (
            format!("<spatial name=\"T\" stiffness=\"1\">{sites}<site site=\"s0\"/></spatial>"),
            "T, since it is no line between two points",
        ),
        (
            format!("<spatial name=\"T\" stiffness=\"1\" springlength=\"0 1\">{sites}</spatial>"),
            "T, since it is slack over a range",
        ),
    ] {
        let found = imported(&mjcf(&tendon));
        assert_has(&notes(&found), why);
        assert!(!found.spec.contains("springs:"), "{}", found.spec);
    }
    let damped = format!("<spatial stiffness=\"1\" damping=\"2\">{sites}</spatial>");
    assert_has(
        &notes(&imported(&mjcf(&damped))),
        "not used in <spatial>: damping",
    );
    let drake = "<drake:linear_spring_damper><drake:linear_spring_damper_body_A name=\"ground\"/>\
                 <drake:linear_spring_damper_p_AP value=\"0 0 0.5\"/>\
                 <drake:linear_spring_damper_body_B name=\"b\"/>\
                 <drake:linear_spring_damper_p_BQ value=\"0.1 0 0\"/>\
                 <drake:linear_spring_damper_free_length value=\"0.2\"/>\
                 <drake:linear_spring_damper_stiffness value=\"90\"/>\
                 </drake:linear_spring_damper>";
    assert_has(
        &imported(&five_bar(drake)).spec,
        "between: [{body: world, xyz: [0, 0, 0.5]}, {body: b, xyz: [0.1, 0, 0]}]\n    length: 0.2\n",
    );
    let gazebo = "<gazebo reference=\"p1\"><springStiffness>3</springStiffness>\
                  <springReference>0.2</springReference></gazebo>";
    assert_has(
        &imported(&five_bar(gazebo)).spec,
        "spring: {rest: 0.2}\n        nominal: {K: 3}",
    );
}

#[test]
fn a_flag_that_disables_equalities_takes_them_out() {
    let text = |flag: &str| {
        format!(
            "<mujoco><option><flag {flag}/></option><worldbody><body name=\"a\">\
             <inertial pos=\"0 0 1\" mass=\"1\" diaginertia=\"1 1 1\"/><joint name=\"q\"/>\
             <body name=\"b\"><inertial pos=\"0 0 1\" mass=\"1\" diaginertia=\"1 1 1\"/><joint name=\"p\"/></body>\
             </body></worldbody><equality><joint joint1=\"q\" joint2=\"p\"/></equality></mujoco>"
        )
    };
    for flag in ["equality=\"disable\"", "constraint=\"disable\""] {
        let found = imported(&text(flag));
        assert!(!found.spec.contains("couplings:"), "{}", found.spec);
        assert_has(
            &notes(&found),
            "equalities are left out, since a flag disables them",
        );
    }
    assert_has(&imported(&text("equality=\"enable\"")).spec, "couplings:");
}

/// The five-bar in SDF, with poses relative to whatever is convenient.
pub(crate) fn five_bar_in_sdf() -> String {
    let links = LINKS.map(|(name, x, mass)| {
        let (around, pose) = match name {
            "a" => ("ground", "0 0 0 0 -2 0"),
            "b" => ("end_of_a", "0 0 0 0 1.2 0"),
            "c" => ("__model__", "0.3 0 0 0 -1.1 0"),
            _ => ("c", "0.2 0 0 0 -1.2 0"),
        };
        format!(
            "<link name=\"{name}\"><pose relative_to=\"{around}\">{pose}</pose>\
             <inertial><pose>{x} 0 0.01 0 0 0</pose><mass>{mass}</mass><inertia><ixx>0.001</ixx><iyy>0.02</iyy>\
             <izz>0.02</izz></inertia></inertial></link>"
        )
    });
    let joint = |name: &str, parent: &str, child: &str, pose: &str| {
        format!(
            "<joint name=\"{name}\" type=\"revolute\">{pose}<parent>{parent}</parent><child>{child}</child>\
             <axis><xyz>0 1 0</xyz></axis></joint>"
        )
    };
    format!(
        "<sdf version=\"1.9\"><model name=\"five\"><link name=\"ground\"><inertial><mass>1</mass>\
         <inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial></link>\
         <joint name=\"hold\" type=\"fixed\"><parent>world</parent><child>ground</child></joint>\
         <frame name=\"end_of_a\" attached_to=\"a\"><pose>0.2 0 0 0 0 0</pose></frame>{}{}{}{}{}{}</model></sdf>",
        links.concat(),
        joint("q1", "ground", "a", ""),
        joint("p1", "a", "b", ""),
        joint("q2", "ground", "c", ""),
        joint("p2", "c", "d", ""),
        joint("tip", "b", "d", "<pose>0.35 0 0 0 0 0</pose>"),
    )
}

#[test]
fn the_same_five_bar_has_the_same_base_parameters_in_each_format() {
    let sdf = imported(&five_bar_in_sdf());
    let told = notes(&sdf);
    assert!(!told.contains("not used"), "{told}");
    assert_has(
        &told,
        "joints that close loops have no coordinate, friction or limits in the spec: tip",
    );
    let urdf = imported(&five_bar(
        "<gazebo><joint name=\"tip\" type=\"revolute\"><parent>b</parent><child>d</child>\
         <pose>0.35 0 0 0 0 0</pose><axis><xyz>0 1 0</xyz></axis></joint></gazebo>",
    ));
    // what differs is the header alone
    let content = |spec: &str| spec[spec.find("\nlimbs:").unwrap()..].to_owned();
    assert_eq!(content(&sdf.spec), content(&urdf.spec));
    let body = |name: &str, joint: &str, place: &str, inside: &str| {
        let (_, x, mass) = LINKS.iter().find(|(own, ..)| *own == name).unwrap();
        format!(
            "<body name=\"{name}\" {place}><joint name=\"{joint}\" axis=\"0 1 0\"/>\
             <inertial pos=\"{x} 0 0.01\" mass=\"{mass}\" diaginertia=\"0.001 0.02 0.02\"/>{inside}</body>"
        )
    };
    let b = body(
        "b",
        "p1",
        "pos=\"0.2 0 0\" euler=\"0 1.2 0\"",
        "<site name=\"tb\"/>",
    );
    let d = body(
        "d",
        "p2",
        "pos=\"0.2 0 0\" euler=\"0 -1.2 0\"",
        "<site name=\"td\" pos=\"0.35 0 0\"/>",
    );
    let mjcf = format!(
        "<mujoco model=\"five\"><compiler angle=\"radian\"/><worldbody>{}{}</worldbody><equality>\
         <connect name=\"tip\" body1=\"d\" body2=\"b\" anchor=\"0.35 0 0\"/></equality></mujoco>",
        body("a", "q1", "euler=\"0 -2 0\"", &b),
        body("c", "q2", "pos=\"0.3 0 0\" euler=\"0 -1.1 0\"", &d),
    );
    let of_urdf = base(&urdf.spec);
    assert_eq!(of_urdf, base(&imported(&mjcf).spec));
    assert_eq!(of_urdf.len(), 11);
}

/// The base parameters by the names of bodies, in any order.
fn base_by_name(spec: &str) -> BTreeSet<String> {
    let robot = derive_with(&Source::new("spec.yaml", spec), BaseSource::Derivation).unwrap();
    let labels = robot.labels();
    let base = &robot.analysis.as_ref().unwrap().base;
    let term = |t: &Term| format!("{:.8} {}", t.value.to_f64(), labels[t.column]);
    // of sqrt(3), which stands in the files as digits
    let counts = |t: &&Term| t.value.to_f64().abs() > 1e-9;
    let sum = |terms: &[Term]| {
        terms
            .iter()
            .filter(counts)
            .map(term)
            .collect::<Vec<_>>()
            .join(" + ")
    };
    base.parameters.iter().map(|p| sum(&p.terms)).collect()
}

/// `tests/tools/vectors/closed.py` writes the files.
#[test]
fn loops_have_the_same_base_parameters_in_urdf_plus_sdf_mjcf_and_usd() {
    for (name, motors) in [
        ("fivebar", "q1,q2"),
        ("delta3", "q1,q2,q3"),
        ("excavator", "swing,slide1,slide2,slide3"),
    ] {
        let options = Options {
            actuated: motors.split(',').map(str::to_owned).collect(),
            ..Options::default()
        };
        let of = |kind: &str| {
            let file = published(&format!("closed/{name}.{kind}"));
            let found = attempt(&file, &options);
            base_by_name(&found.unwrap_or_else(|e| panic!("{name}.{kind}: {e}")).spec)
        };
        let urdf = of("urdf");
        assert!(urdf.len() > 10, "{name}");
        // bodies of USD have mass, and those of a universal joint have none
        let kinds = ["sdf", "xml", "usda"];
        for kind in &kinds[..if name == "delta3" { 2 } else { 3 }] {
            let apart: Vec<_> = urdf.symmetric_difference(&of(kind)).cloned().collect();
            assert!(apart.is_empty(), "{name}.{kind}: {apart:#?}");
        }
    }
}

#[test]
fn names_and_poses_of_sdf_follow_their_scopes() {
    let whole = five_bar_in_sdf();
    let spec = |text: &str| {
        let spec = imported(text).spec;
        spec[spec.find("\nlimbs:").unwrap()..].to_owned()
    };
    // in a world, which has gravity
    let world = whole
        .replace("<model name=\"five\">", "<world name=\"w\"><gravity>0 0 -1.62</gravity><model name=\"five\">")
        .replace("</model>", "</model><model name=\"ground\"><static>true</static><link name=\"l\"/></model></world>");
    assert_eq!(spec(&world), spec(&whole));
    let found = imported(&world);
    assert_has(&found.spec, "gravity: [0, 0, -1.62]");
    assert_has(&notes(&found), "models without joints are left out: ground");
    // degrees, quaternions and axes in other frames are the same
    let turned = whole
        .replace(
            ">0 0 0 0 1.2 0<",
            " degrees=\"true\">0 0 0 0 68.75493541569878 0<",
        )
        .replacen("<xyz>", "<xyz expressed_in=\"world\">", 1);
    let [a, b] = [&turned, &whole].map(|text| imported(text));
    assert_has(&a.spec, "name: p1");
    let number = |spec: &str| {
        let at = spec.find("name: p1").unwrap();
        let rpy = &spec[at + spec[at..].find("rpy: [0, ").unwrap() + 9..];
        rpy[..rpy.find(',').unwrap()].parse::<f64>().unwrap()
    };
    assert!((number(&a.spec) - number(&b.spec)).abs() < 1e-12);
    // a joint whose child is nearer to the root turns the other way round
    let reversed = whole.replacen(
        "<parent>ground</parent><child>a</child>",
        "<parent>a</parent><child>ground</child>",
        1,
    );
    assert_has(&spec(&reversed), "body: a");
    // old files have their axes in the model's frame
    let old = whole.replace("version=\"1.9\"", "version=\"1.4\"");
    assert_eq!(spec(&old), spec(&whole));
    let x = |version: &str| {
        let turned = whole.replace("<xyz>0 1 0</xyz>", "<xyz>1 0 0</xyz>");
        let turned = turned.replace("<joint name=\"tip\"", "<extra/><joint name=\"tip\"");
        let open = &turned[..turned.find("<extra/>").unwrap()];
        spec(&format!("{open}</model></sdf>").replace("1.9", version))
    };
    assert_ne!(x("1.4"), x("1.9"));
    for (from, to, complaint) in [
        (
            "<child>d</child>",
            "<child>e</child>",
            "nothing is called 'e'",
        ),
        ("\"c\">0.2", "\"e\">0.2", "nothing is called 'e'"),
        (
            "\"__model__\">",
            "\"c\">",
            "the pose of 'c' is relative to itself",
        ),
        (
            "<frame ",
            "<include><uri>model://arm</uri></include><frame ",
            "the model 'model://arm' is in another file",
        ),
        (
            "type=\"revolute\"",
            "type=\"screw\"",
            "a joint of type 'screw' cannot be expressed",
        ),
        ("0 0 0 0 -2 0", "0 0 0", "a pose of 6 numbers stands here"),
        (
            "<model name=\"five\">",
            "<model name=\"five\"><link name=\"loose\"/>",
            "no joint connects",
        ),
    ] {
        assert_has(&refused(&whole.replacen(from, to, 1)), complaint);
    }
}

#[test]
fn gearboxes_and_mimics_of_sdf_are_couplings() {
    let open = five_bar_in_sdf();
    let open = format!(
        "{}</model></sdf>",
        &open[..open.find("<joint name=\"tip\"").unwrap()]
    );
    let with = |more: &str| imported(&open.replace("</model>", &format!("{more}</model>"))).spec;
    let gearbox = |axis2: &str| {
        with(&format!(
            "<joint name=\"g\" type=\"gearbox\"><parent>a</parent><child>c</child>\
             <gearbox_ratio>3</gearbox_ratio><gearbox_reference_body>ground</gearbox_reference_body>\
             <axis><xyz expressed_in=\"world\">0 1 0</xyz></axis><axis2><xyz expressed_in=\"world\">{axis2}</xyz>\
             </axis2></joint>"
        ))
    };
    assert_has(&gearbox("0 1 0"), "couplings:\n  q2: -3*q1\n");
    assert_has(&gearbox("0 -1 0"), "couplings:\n  q2: 3*q1\n");
    let mimic = "<axis><mimic joint=\"q1\"><multiplier>2</multiplier><offset>0.1</offset>\
                 <reference>0.3</reference></mimic><xyz>0 1 0</xyz></axis></joint><link name=\"e\"/>";
    let last = "<child>c</child><axis><xyz>0 1 0</xyz></axis></joint>";
    let text = open
        .replace(last, &format!("<child>c</child>{mimic}"))
        .replace("<link name=\"e\"/>", "");
    assert_has(&imported(&text).spec, "couplings:\n  q2: 2*q1 - 0.5\n");
}

#[test]
fn values_go_back_into_files_with_loops_and_come_out_again() {
    let closing = "<constraint name=\"tip\" type=\"revolute\"><parent link=\"b\"/><parent_origin xyz=\"0.35 0 0\"/>\
                   <child link=\"d\"/><child_origin xyz=\"0.35 0 0\"/></constraint>";
    let turned = five_bar_in_sdf().replacen(
        "0.1 0 0.01 0 0 0",
        " 0.1 0 0.01  0 0 1.5707963267948966 ",
        1,
    );
    for (text, is_sdf) in [
        (five_bar(closing), false),
        (five_bar_in_sdf(), true),
        (turned, true),
    ] {
        let spec = imported(&text).spec;
        let file = Source::new("robot.xml", text.as_str());
        let a = BodyParameters {
            mass: 0.55,
            com: [0.11, 0.001, 0.012],
            inertia: [0.003, 0.0001, 0.0002, 0.021, 0.0003, 0.022],
        };
        let q1 = JointParameters {
            viscous: Some(0.7),
            coulomb: Some(0.3),
            stiffness: is_sdf.then_some(4.0),
            ..JointParameters::default()
        };
        let fit = Parameters {
            bodies: vec![("a".to_owned(), a)],
            joints: vec![("q1".to_owned(), q1)],
        };
        let given = Source::new("fit", "\"a\" \"q1\"");
        let mut none = |_: &str| Err("there is none".to_owned());
        let source = Source::new("spec.yaml", spec.as_str());
        let out =
            export(&file, &mut none, &source, &given, &fit).unwrap_or_else(|e| panic!("{e:?}"));
        assert_eq!(out.values, if is_sdf { 13 } else { 12 });
        let again = imported(&out.text).spec;
        assert_has(&again, "friction: linear");
        assert_has(&again, "Fv: 0.7, Fc: 0.3");
        assert_eq!(again.contains("K: 4"), is_sdf);
        // the loop, and all else of other bodies, is as before
        assert_eq!(cuts(&again), cuts(&spec));
        let line = |spec: &str, name: &str| {
            let line = spec
                .lines()
                .find(|line| line.starts_with(&format!("  {name}: {{mass")));
            line.unwrap_or_else(|| panic!("{spec}")).to_owned()
        };
        for other in ["b", "c", "d"] {
            assert_eq!(line(&again, other), line(&spec, other));
        }
        let numbers = |line: &str| -> Vec<f64> {
            let separated = line.replace(['[', ']', '{', '}', ','], " ");
            separated
                .split_whitespace()
                .filter_map(|word| word.parse().ok())
                .collect()
        };
        let expected = [&[a.mass][..], &a.com, &a.inertia].concat();
        for (x, y) in numbers(&line(&again, "a")).iter().zip(&expected) {
            assert!((x - y).abs() < 1e-12, "{x} {y}\n{}", out.text);
        }
        assert_eq!(numbers(&line(&again, "a")).len(), 10);
    }
    let auto = five_bar_in_sdf().replacen(
        "<inertial><pose>0.1",
        "<inertial auto=\"true\"><pose>0.1",
        1,
    );
    let source = Source::new("spec.yaml", imported(&five_bar_in_sdf()).spec);
    let fit = Parameters {
        bodies: vec![(
            "a".to_owned(),
            BodyParameters {
                mass: 1.0,
                com: [0.0; 3],
                inertia: [1.0, 0.0, 0.0, 1.0, 0.0, 1.0],
            },
        )],
        joints: Vec::new(),
    };
    let mut none = |_: &str| Err("there is none".to_owned());
    let given = Source::new("fit", "\"a\"");
    let refused = export(
        &Source::new("robot.xml", auto),
        &mut none,
        &source,
        &given,
        &fit,
    );
    let complaint = refused.unwrap_err()[0].to_string();
    assert_has(&complaint, "the inertia of 'a' has auto=\"true\"");
}
