//! The nominal values of the shipped robots are those of their sources, and bodies could exist.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use nalgebra::Matrix4;
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
fn every_nominal_body_is_physically_consistent() {
    let mut bodies = 0;
    for file in files::list(&files::robots(), "yaml").unwrap() {
        let m = files::mechanism(&file).unwrap();
        for body in &m.bodies {
            let Some(p) = body.nominal else { continue };
            bodies += 1;
            let half = (p[0] + p[3] + p[5]) / 2.0;
            // The pseudo-inertia of a body that can exist is positive definite.
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
    assert!(bodies >= 27, "only {bodies} nominal bodies");
}
