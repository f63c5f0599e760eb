//! The nominal values of the shipped robots are those of their sources, their bodies are physical,
//! and their forces agree with another program or the source.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::collections::BTreeMap;

use nalgebra::{DVector, Matrix4};
use regen_tests::files;
use regen_tests::reference::Mechanism;

fn robot(name: &str) -> Mechanism {
    files::mechanism(&files::robots().join(format!("{name}.yaml"))).unwrap()
}

/// The value of a parameter by its label.
fn value(mechanism: &Mechanism, label: &str) -> f64 {
    let phi = mechanism.nominal_parameters().expect("nominal values");
    let labels = mechanism.labels();
    phi[labels.iter().position(|l| l == label).expect(label)]
}

#[test]
fn rps3_reproduces_the_cad_column_of_table_8_and_table_5() {
    for name in ["3rps", "3rps_friction"] {
        let m = robot(name);
        let v = |label: &str| value(&m, label);
        let a = 0.4563;
        let third = 3.0_f64.sqrt() / 3.0;
        let rows = [
            (
                v("mx(3)") + third * v("my(3)") - a * (v("m(3)") + v("m(2)")),
                -2.47,
            ),
            (
                v("m(5)") - 2.0 * third / a * v("my(3)") + v("m(3)") + v("m(2)"),
                10.83,
            ),
            (v("m(7)") + 2.0 * third / a * v("my(3)"), 5.42),
        ];
        for (ours, printed) in rows {
            // The table prints two decimals.
            assert!((ours - printed).abs() <= 0.005, "{name}: {ours} {printed}");
        }
        for sum in [
            ["Izz(4)", "Iyy(5)"],
            ["Izz(6)", "Iyy(7)"],
            ["Izz(1)", "Iyy(2)"],
        ] {
            let ours = v(sum[0]) + v(sum[1]);
            assert!((ours - 0.1555).abs() < 5e-5, "{name}: {sum:?} {ours}");
        }
    }
}

#[test]
fn rps3_friction_has_the_parameters_of_model_1() {
    let m = robot("3rps_friction");
    assert_eq!(m.parameters.len(), 70 + 9);
    for q in ["q2", "q7", "q9"] {
        for (symbol, nominal) in [("Fv", 3272.0), ("Fc", 228.0), ("J", 483.1)] {
            let ours = value(&m, &format!("{symbol}({q})"));
            assert!((ours - nominal).abs() < 1e-9, "{symbol}({q}): {ours}");
        }
    }
}

#[test]
fn every_body_has_a_physical_nominal_inertia() {
    let mut bodies = 0;
    for file in files::list(&files::robots(), "yaml").unwrap() {
        let m = files::mechanism(&file).unwrap();
        for body in &m.bodies {
            let missing = || panic!("{}: body {} has no nominal inertia", m.name, body.label);
            let p = body.nominal.unwrap_or_else(missing);
            bodies += 1;
            let half = (p[0] + p[3] + p[5]) / 2.0;
            // The pseudo-inertia of a physical body is positive definite.
            #[rustfmt::skip]
            let pseudo = Matrix4::new(
                half - p[0], -p[1], -p[2], p[6],
                -p[1], half - p[3], -p[4], p[7],
                -p[2], -p[4], half - p[5], p[8],
                p[6], p[7], p[8], p[9],
            );
            assert!(
                pseudo.cholesky().is_some(),
                "{}: body {}",
                m.name,
                body.label
            );
        }
    }
    assert!(bodies >= 100, "only {bodies} nominal bodies");
}

/// The forces of the actuators at a state, from the nominal values, N or N m.
fn forces(m: &Mechanism, q: &[f64], qd: &[f64], qdd: &[f64]) -> DVector<f64> {
    let phi = m.nominal_parameters().expect("nominal values");
    m.regressor(q, qd, qdd).unwrap() * DVector::from_vec(phi)
}

#[test]
fn arms_agree_with_pinocchio_in_the_frames_of_their_sources() {
    let path = files::fixtures().join("computed/nominal.json");
    let text = std::fs::read_to_string(path).unwrap();
    let vectors: BTreeMap<String, Vec<BTreeMap<String, Vec<f64>>>> =
        serde_json::from_str(&text).unwrap();
    assert_eq!(vectors.len(), 4);
    for (name, states) in &vectors {
        let m = robot(name);
        assert_eq!(states.len(), 6, "{name}");
        for state in states {
            let ours = forces(&m, &state["q"], &state["qd"], &state["qdd"]);
            let theirs = DVector::from_column_slice(&state["tau"]);
            // The tolerance covers the rounding of both: the file has the digits of the source.
            let error = (&ours - &theirs).amax();
            assert!(error <= 1e-11 * theirs.amax(), "{name}: {ours} {theirs}");
        }
    }
}

#[test]
fn the_gravity_of_the_puma_is_that_measured_in_its_paper() {
    // Armstrong, Khatib, Burdick (1986): the printed constants of gravity, N m, and its terms.
    let [g1, g2, g3, g4, g5] = [-37.2, -8.44, 1.02, 0.249, -0.0282];
    let m = robot("puma560");
    for q in [
        [0.3, -0.4, 0.9, 0.2, -0.7, 0.1],
        [-1.0, -1.4, 1.2, -0.5, 0.8, 2.0],
        [2.0, 0.4, -0.3, 1.1, 0.4, -1.0],
    ] {
        let ours = forces(&m, &q, &[0.0; 6], &[0.0; 6]);
        let ((s2, c2), (s23, c23)) = (q[1].sin_cos(), (q[1] + q[2]).sin_cos());
        let ((s4, c4), (s5, c5)) = (q[3].sin_cos(), q[4].sin_cos());
        let elbow = g2 * s23 + g4 * c23 + g5 * (s23 * c5 + c23 * c4 * s5);
        let wrist = g5 * (c23 * s5 + s23 * c4 * c5);
        let theirs = [
            0.0,
            g1 * c2 + elbow + g3 * s2,
            elbow,
            -g5 * s23 * s4 * s5,
            wrist,
            0.0,
        ];
        for (joint, (ours, theirs)) in ours.iter().zip(theirs).enumerate() {
            // The paper prints three digits: half a unit of the last digit of g1 and g2, plus the
            // difference from the masses and lengths that it prints too.
            assert!(
                (ours - theirs).abs() < 0.06,
                "joint {joint}: {ours} {theirs}"
            );
        }
    }
}

#[test]
fn actuators_can_hold_every_robot_at_home() {
    let mut limits = 0;
    for file in files::list(&files::robots(), "yaml").unwrap() {
        let m = files::mechanism(&file).unwrap();
        let home = m.home().unwrap();
        let zero = vec![0.0; m.n()];
        let phi = DVector::from_vec(m.nominal_parameters().unwrap());
        let gravity = m.regressor(&home, &zero, &zero).unwrap() * phi;
        let text = std::fs::read_to_string(&file).unwrap();
        let spec: serde_json::Value = serde_saphyr::from_str(&text).unwrap();
        for limb in spec["limbs"].as_array().unwrap() {
            for joint in limb["joints"].as_array().unwrap() {
                let Some(efforts) = joint["limits"]["effort"].as_array() else {
                    continue;
                };
                let name = joint["name"].as_str().unwrap();
                let at = |k: &usize| m.coordinates[*k] == name;
                let row = m.independent.iter().position(at).expect(name);
                let bound = |i: usize| efforts[i].as_f64().unwrap();
                limits += 1;
                assert!(
                    (bound(0)..=bound(1)).contains(&gravity[row]),
                    "{}: {name} needs {}",
                    m.name,
                    gravity[row]
                );
            }
        }
    }
    assert!(limits >= 50, "only {limits} limits of efforts");
}
