//! Loops given on the command line: a tree in URDF becomes the four-bar of `robots/`.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::Path;

use crate::common::{assert_has, imported_with, refused_with};
use regen_codegen::diag::Source;
use regen_codegen::interpret::run;
use regen_codegen::pipeline::{BaseSource, derive_with};
use regen_codegen::robot::{FunctionKind, Robot};
use regen_import::{Options, import};

/// `robots/fourbar.yaml` opened at its cut, in the same frames.
const TREE: &str = r#"<robot name="fourbar">
  <link name="ground"/>
  <link name="crank"><inertial><origin xyz="0.06 0 0"/><mass value="0.24"/>
    <inertia ixx="2e-5" ixy="0" ixz="0" iyy="2.88e-4" iyz="0" izz="2.88e-4"/></inertial></link>
  <link name="coupler"><inertial><origin xyz="0.175 0 0"/><mass value="0.70"/>
    <inertia ixx="5e-5" ixy="0" ixz="0" iyy="7.15e-3" iyz="0" izz="7.15e-3"/></inertial></link>
  <link name="rocker"><inertial><origin xyz="0.15 0 0"/><mass value="0.60"/>
    <inertia ixx="4e-5" ixy="0" ixz="0" iyy="4.5e-3" iyz="0" izz="4.5e-3"/></inertial></link>
  <joint name="q1" type="continuous"><parent link="ground"/><child link="crank"/>
    <origin rpy="1.5707963 0 0"/><axis xyz="0 0 1"/></joint>
  <joint name="q2" type="continuous"><parent link="crank"/><child link="coupler"/>
    <origin xyz="0.12 0 0"/><axis xyz="0 0 1"/></joint>
  <joint name="q3" type="continuous"><parent link="ground"/><child link="rocker"/>
    <origin xyz="0.4 0 0" rpy="1.5707963 0 0"/><axis xyz="0 0 1"/></joint>
</robot>"#;

fn words(list: &[&str]) -> Vec<String> {
    list.iter().map(|w| (*w).to_owned()).collect()
}

fn with_cut(cut: &str) -> Options {
    Options {
        cuts: words(&[cut]),
        actuated: words(&["q1"]),
        home: words(&["q1=pi/3", "q2=-0.4656", "q3=1.73"]),
        ..Options::default()
    }
}

fn robot(text: &str) -> Robot {
    derive_with(&Source::new("spec.yaml", text), BaseSource::Skip).unwrap()
}

/// The regressor at home, with nonzero velocities and accelerations.
fn regressor(robot: &Robot) -> Vec<f64> {
    let call = |kind: FunctionKind, inputs: &[&[f64]]| {
        run(&robot.function(kind).unwrap().program, inputs).0
    };
    let q = &robot.home;
    let qd = call(FunctionKind::Velocities, &[q, &[0.7]]);
    let qdd = call(FunctionKind::Accelerations, &[q, &qd, &[-1.3]]);
    call(FunctionKind::Regressor, &[q, &qd, &qdd])
}

#[test]
fn a_tree_with_a_cut_is_the_four_bar_that_was_written_by_hand() {
    let options = with_cut("pin:revolute:coupler@0.35,0,0:rocker@0.30,0,0");
    let spec = imported_with(TREE, &options).spec;
    assert_has(
        &spec,
        "between: [{body: coupler, xyz: [0.35, 0, 0]}, {body: rocker, xyz: [0.3, 0, 0]}]",
    );
    assert_has(&spec, "home: {q1: pi/3, q2: -0.4656, q3: 1.73}");
    assert!(!spec.contains("independent:"), "{spec}");
    let by_hand = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/fourbar.yaml");
    let by_hand = robot(&std::fs::read_to_string(by_hand).unwrap());
    let imported = robot(&spec);
    assert_eq!(imported.home.len(), by_hand.home.len());
    let (ours, theirs) = (regressor(&imported), regressor(&by_hand));
    assert_eq!(ours.len(), theirs.len());
    let largest = theirs.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    for (x, y) in ours.iter().zip(&theirs) {
        assert!((x - y).abs() < 1e-12 * largest, "{x} {y}");
    }
    assert!(largest > 0.1);
}

#[test]
fn without_a_second_frame_the_loop_is_closed_at_zero() {
    // with all links on a line: the coupler's end is at (0.47, 0), in the rocker's frame at 0.07
    let options = Options {
        cuts: words(&["pin:spherical:coupler@0.35,0,0.1:rocker"]),
        home: words(&["q1=0.3"]),
        ..Options::default()
    };
    let spec = imported_with(TREE, &options).spec;
    assert_has(&spec, "{body: rocker, xyz: [0.07, 0, 0.1]}");
}

#[test]
fn two_names_are_frames_that_are_held_together() {
    let tips = "<link name=\"tip\"/><joint name=\"t\" type=\"fixed\"><parent link=\"coupler\"/>\
                <child link=\"tip\"/><origin xyz=\"0.35 0 0\"/></joint>\
                <link name=\"socket\"/><joint name=\"s\" type=\"fixed\"><parent link=\"rocker\"/>\
                <child link=\"socket\"/><origin xyz=\"0.30 0 0\"/></joint></robot>";
    let tree = TREE.replace("</robot>", tips);
    let named = imported_with(&tree, &with_cut("pin:revolute:tip:socket")).spec;
    let cut = "pin:revolute:coupler@0.35,0,0:rocker@0.30,0,0";
    assert_eq!(named, imported_with(TREE, &with_cut(cut)).spec);
    // a frame of numbers is given in the named one
    let mixed = with_cut("pin:revolute:tip@-0.05,0,0:rocker@0.25,0,0");
    let cut = with_cut("pin:revolute:coupler@0.3,0,0:rocker@0.25,0,0");
    assert_eq!(
        imported_with(&tree, &mixed).spec,
        imported_with(TREE, &cut).spec
    );
}

#[test]
fn without_named_motors_the_independent_joint_is_actuated() {
    let options = Options {
        actuated: Vec::new(),
        ..with_cut("pin:revolute:coupler@0.35,0,0:rocker@0.30,0,0")
    };
    let spec = imported_with(TREE, &options).spec;
    assert_eq!(spec.matches("actuated: true").count(), 1, "{spec}");
    assert!(!spec.contains("independent:"), "{spec}");
}

#[test]
fn frames_of_a_cut_may_be_rotated_and_fixed_to_the_world() {
    let options = with_cut("s:universal:coupler@0.35,0,0,0,pi/2,-2*pi/3:rocker@0.3,0,0");
    assert_has(
        &imported_with(TREE, &options).spec,
        "{body: coupler, xyz: [0.35, 0, 0], rpy: [0, pi/2, -2*pi/3]}",
    );
    let options = Options {
        cuts: words(&["s:spherical:world@0.4,0,0,0,0,pi/2:rocker"]),
        ..Options::default()
    };
    assert_has(
        &imported_with(TREE, &options).spec,
        "between: [{body: world, xyz: [0.4, 0, 0], rpy: [0, 0, pi/2]}, {body: rocker, rpy: ",
    );
}

#[test]
fn wrong_cuts_are_refused_with_the_place_in_the_word() {
    for (cut, complaint) in [
        (
            "pin",
            "cuts:1:1: a cut has four parts between colons, not 1 (for instance",
        ),
        (
            "pin:hinge:coupler:rocker",
            "cuts:1:5: unknown joint type 'hinge' (cuts are spherical",
        ),
        (
            "p-n:revolute:coupler:rocker",
            "cuts:1:1: 'p-n' cannot be a cut's name",
        ),
        (
            "pin:revolute:couple:rocker",
            "cuts:1:14: no body is called 'couple' (the file's bodies and frames are world, ground",
        ),
        (
            "pin:revolute:coupler@1,2:rocker",
            "cuts:1:22: a frame has 3 or 6 numbers, not 2",
        ),
        (
            "pin:revolute:coupler@1,x,3:rocker",
            "cuts:1:24: 'x' is not a number",
        ),
        (
            "pin:revolute:coupler@1,2,3@4:rocker",
            "cuts:1:28: a second '@'",
        ),
    ] {
        assert_has(&refused_with(TREE, &with_cut(cut)), complaint);
    }
    let far = with_cut("pin:revolute:coupler@0.35,0,0:rocker@3,0,0");
    let said = refused_with(TREE, &far);
    assert_has(&said, "the loops do not close");
    assert_has(&said, "cut 'pin' gapes by");
    assert_has(&said, "no closed state was found");
    for (actuated, home, complaint) in [
        ("q4", "q1=0", "actuated:1:1: no joint is called 'q4'"),
        ("q1", "q4=0", "home:1:1: 'q4=0' gives no coordinate a value"),
        ("q1", "q1=x", "home:1:1: 'q1=x' gives no coordinate a value"),
    ] {
        let options = Options {
            actuated: words(&[actuated]),
            home: words(&[home]),
            ..with_cut("pin:revolute:coupler@0.35,0,0:rocker@0.3,0,0")
        };
        assert_has(&refused_with(TREE, &options), complaint);
    }
}

/// From some starts the loop does not close; the words that are given then close it.
#[test]
fn where_the_loops_do_not_close_a_home_that_does_is_given() {
    let mut options = with_cut("pin:revolute:coupler@0.35,0,0:rocker@0.30,0,0");
    options.names.home = "--home";
    let mut refusals = 0;
    for (q2, q3) in (0..9).flat_map(|k| (0..9).map(move |l| (k, l))) {
        let at = |name: &str, k: i32| format!("{name}={}", 0.77 * f64::from(k - 4));
        options.home = vec!["q1=pi/3".to_owned(), at("q2", q2), at("q3", q3)];
        let source = Source::new("robot.xml", TREE);
        let mut none = |_: &str| Err("there is none".to_owned());
        let Err(reports) = import(&source, &mut none, &options) else {
            continue;
        };
        let said = reports[0].to_string();
        assert_has(&said, "cut 'pin' gapes by");
        let near = said.split("`--home ").nth(1).unwrap();
        let near = near.split('`').next().unwrap();
        options.home = near.split(',').map(str::to_owned).collect();
        assert_has(&imported_with(TREE, &options).spec, "q1: 1.047198");
        refusals += 1;
    }
    assert!(refusals > 0);
}

/// A parallelogram drawn flat, as CAD exports have it, in both formats.
#[test]
fn a_loop_drawn_flat_is_refused_with_a_home_from_which_it_is_imported() {
    let body = |name: &str| {
        format!(
            "<link name=\"{name}\"><inertial><origin xyz=\"0.1 0 0\"/><mass value=\"1\"/>\
             <inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.01\" iyz=\"0\" izz=\"0.01\"/></inertial></link>"
        )
    };
    let joint = |name: &str, parent: &str, child: &str, x: &str| {
        format!(
            "<joint name=\"{name}\" type=\"continuous\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
             <origin xyz=\"{x} 0 0\"/><axis xyz=\"0 1 0\"/></joint>"
        )
    };
    let urdf = format!(
        "<robot name=\"flat\"><link name=\"ground\"/>{}{}{}{}{}{}</robot>",
        body("crank"),
        body("coupler"),
        body("rocker"),
        joint("q1", "ground", "crank", "0"),
        joint("q2", "crank", "coupler", "0.2"),
        joint("q3", "ground", "rocker", "0.6"),
    );
    let inertial = "<inertial pos=\"0.1 0 0\" mass=\"1\" diaginertia=\"0.01 0.01 0.01\"/>";
    let mjcf = format!(
        "<mujoco model=\"flat\"><compiler angle=\"radian\"/><worldbody>\
         <body name=\"crank\">{inertial}<joint name=\"q1\" axis=\"0 1 0\"/>\
         <body name=\"coupler\" pos=\"0.2 0 0\">{inertial}<joint name=\"q2\" axis=\"0 1 0\"/></body></body>\
         <body name=\"rocker\" pos=\"0.6 0 0\">{inertial}<joint name=\"q3\" axis=\"0 1 0\"/></body></worldbody>\
         <equality><connect body1=\"coupler\" body2=\"rocker\" anchor=\"0.6 0 0\"/></equality>\
         <actuator><motor joint=\"q1\"/></actuator></mujoco>"
    );
    let with_loop = Options {
        cuts: words(&["pin:revolute:coupler@0.6,0,0,pi/2,0,0:rocker@0.2,0,0,pi/2,0,0"]),
        ..Options::default()
    };
    for (text, mut options) in [(urdf, with_loop), (mjcf, Options::default())] {
        options.names.home = "--home";
        let said = refused_with(&text, &options);
        assert!(said.contains("home is singular"), "{said}");
        let home = said.split("`--home ").nth(1).unwrap();
        let home = home.split('`').next().unwrap();
        options.home = home.split(',').map(str::to_owned).collect();
        let spec = imported_with(&text, &options).spec;
        assert_has(&spec, "home: {q1: 0.6}");
        // one freedom: the motor's, which needs no list
        assert!(!spec.contains("independent:"), "{spec}");
    }
}
