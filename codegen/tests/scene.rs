//! The scene from which pictures are drawn.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::Path;

use regen_codegen::Mechanism;
use regen_codegen::diag::Source;
use regen_codegen::interpret;
use regen_codegen::pipeline::{BaseSource, derive_with};
use regen_codegen::robot::FunctionKind;
use regen_codegen::scene::Scene;

fn source(robot: &str) -> Source {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../robots/{robot}.yaml"));
    Source::new(robot, fs::read_to_string(path).unwrap())
}

#[test]
fn bodies_are_drawn_at_the_derived_poses() {
    for robot in [
        "3rps",
        "delta",
        "stewart",
        "hybrid",
        "ur5e",
        "tree_branch",
        "palletiser",
    ] {
        let source = source(robot);
        let scene = Mechanism::open(&source).unwrap().scene();
        let derived = derive_with(&source, BaseSource::Skip).unwrap();
        let poses = derived.function(FunctionKind::Poses).unwrap();
        // any coordinates, whether the loops are closed or not
        let n = derived.coordinates.len();
        let q: Vec<f64> = (0..n).map(|k| (1.3 * k as f64 + 0.4).sin()).collect();
        let (expected, _) = interpret::run(&poses.program, &[&q]);
        let frames = scene.frames(&q);
        assert_eq!(expected.len(), 12 * scene.bodies.len());
        for (body, expected) in scene.bodies.iter().zip(expected.chunks(12)) {
            for (ours, theirs) in frames[body.link].iter().zip(expected) {
                // a sum of some twenty products of entries of magnitude 1
                assert!(
                    (ours - theirs).abs() < 1e-13,
                    "{robot}, body {}",
                    body.label
                );
            }
        }
    }
}

#[test]
fn the_frames_of_cuts_coincide_at_home_and_separate_elsewhere() {
    let source = source("3rps");
    let scene = Mechanism::open(&source).unwrap().scene();
    let derived = derive_with(&source, BaseSource::Skip).unwrap();
    let gap = |q: &[f64]| {
        let frames = scene.frames(q);
        let cuts = scene.cuts.iter().map(|cut| Scene::ends(&frames, cut));
        cuts.flat_map(|[a, b]| [0, 1, 2].map(|i: usize| (a[i] - b[i]).abs()))
            .fold(0.0, f64::max)
    };
    assert!(gap(&derived.home) < 1e-12);
    let mut open = derived.home.clone();
    open[0] += 0.1;
    assert!(gap(&open) > 0.01);
}

#[test]
fn joints_and_cuts_of_a_body_are_among_its_points() {
    // the platform of the 3-RPS: its origin at the first leg, and the corners at its cuts
    let scene = Mechanism::open(&source("3rps")).unwrap().scene();
    let platform = scene.bodies.iter().find(|b| b.label == "3").unwrap();
    let a = 0.4563;
    let corners = [[0.0; 3], [a, 0.0, 0.0], [a / 2.0, a * 0.75_f64.sqrt(), 0.0]];
    assert_eq!(platform.points.len(), 3);
    for (point, corner) in platform.points.iter().zip(corners) {
        for (x, y) in point.iter().zip(corner) {
            assert!((x - y).abs() < 1e-15);
        }
    }
    // a spherical joint is one joint with three coordinates
    let names: Vec<(&str, usize)> = scene
        .joints
        .iter()
        .map(|j| (j.name.as_str(), j.coordinates.len()))
        .collect();
    assert_eq!(names[2], ("s1", 3));
    // the six corners of the Stewart platform, without the frame's origin between them
    let scene = Mechanism::open(&source("stewart")).unwrap().scene();
    let most = scene.bodies.iter().map(|b| b.points.len()).max();
    assert_eq!(most, Some(6));
}

fn fixture(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join(format!("../tests/fixtures/mechanisms/{name}.yaml"));
    let source = Source::new(name, fs::read_to_string(path).unwrap());
    Mechanism::open(&source).unwrap().scene()
}

#[test]
fn springs_are_drawn_between_their_described_points() {
    let scene = fixture("springs");
    let (q1, q2) = (1.9_f64, 1.2_f64);
    let frames = scene.frames(&scene.home);
    // the plane of the five-bar is x and z of the world
    let polar = |x: f64, r: f64, q: f64| [x + r * q.cos(), 0.0, r * q.sin()];
    let beside = [
        0.1 * q1.cos() - 0.05 * q1.sin(),
        0.0,
        0.1 * q1.sin() + 0.05 * q1.cos(),
    ];
    let expected = [
        ("tie", false, [polar(0.0, 0.2, q1), polar(0.2, 0.2, q2)]),
        ("gas", true, [beside, [-0.3, 0.0, 0.0]]),
    ];
    assert_eq!(scene.springs.len(), expected.len());
    for (spring, (name, is_constant, tips)) in scene.springs.iter().zip(expected) {
        assert_eq!(
            (spring.name.as_str(), spring.is_constant),
            (name, is_constant)
        );
        for (ours, theirs) in spring.tips(&frames).iter().zip(tips) {
            for (a, b) in ours.iter().zip(theirs) {
                assert!((a - b).abs() < 1e-14, "{name}");
            }
        }
    }
    let [spring] = &scene.joint_springs[..] else {
        panic!("one spring at a joint");
    };
    assert_eq!((spring.name.as_str(), spring.turns), ("q1", true));
    assert!((spring.rest - 1.5).abs() < 1e-15);
}

#[test]
fn drives_are_linear_forms_of_joints_and_payloads_are_marked() {
    let scene = fixture("tendons");
    let names: Vec<&str> = scene.drives.iter().map(|d| d.name.as_str()).collect();
    assert_eq!(names, ["flexor", "crossed"]);
    for (drive, sign) in scene.drives.iter().zip([1.0, -1.0]) {
        assert_eq!(drive.terms, [(0, 0.008), (1, sign * 0.006)]);
        assert!(drive.constant == 0.0 && drive.is_actuated);
    }
    let scene = fixture("payload");
    let payloads = scene.bodies.iter().filter(|body| body.is_payload);
    assert_eq!(
        payloads.map(|b| b.label.as_str()).collect::<Vec<_>>(),
        ["load"]
    );
}
