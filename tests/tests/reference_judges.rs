//! The checks can fail: an engine with one wrong result is refused, and the error names it.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use regen_codegen::signature::{FunctionKind, Shape};
use regen_tests::engine::{Answer, Engine, Naive, Names, check_engine};
use regen_tests::files;
use regen_tests::reference::Mechanism;

/// The wrong results that are tried, each with the comparison that must detect it.
const MISTAKES: [(&str, &str); 16] = [
    ("constraints", "constraints"),
    ("jacobian", "jacobian"),
    ("bias", "bias"),
    ("newton_step", "newton_step"),
    ("velocities", "velocities"),
    ("accelerations", "accelerations"),
    ("regressor", "lagrange"),
    ("regressor", "equation 1"),
    ("inverse_dynamics", "inverse dynamics"),
    ("gravity", "gravity"),
    ("bias_forces", "M qdd + bias"),
    ("mass_matrix", "mass matrix"),
    ("adaptive_regressor", "dM/dt - 2C skew"),
    ("generalized_forces", "efforts"),
    ("poses", "poses"),
    ("cones", "cones"),
];

/// An engine that is right except for one method, whose result has a relative error of 1e-6.
struct Wrong<'a> {
    right: Naive<'a>,
    mistake: &'static str,
}

impl Engine for Wrong<'_> {
    fn names(&self) -> Names {
        let mut names = self.right.names();
        if self.mistake == "names" {
            names.parameters.swap(0, 1);
        }
        names
    }

    fn home(&self) -> Vec<f64> {
        self.right.home()
    }

    fn call(&self, kind: FunctionKind, inputs: &[&[f64]]) -> Answer<Vec<f64>> {
        let mut values = self.right.call(kind, inputs)?;
        if self.mistake != kind.name() {
            return Ok(values);
        }
        let resting = |accelerations: &[f64]| accelerations.iter().all(|x| x.abs() < 1e-12);
        let part = 1e-6;
        if kind == FunctionKind::Poses {
            values[9] += part;
        } else if kind == FunctionKind::NewtonStep {
            // A slightly wrong step still converges; one that is a third too short does not
            // converge in ten steps.
            for x in &mut values {
                *x *= 0.7;
            }
        } else if kind == FunctionKind::AdaptiveRegressor && !resting(inputs[3]) {
            // only results at zero reference accelerations are wrong, so that C is wrong and Y on
            // the motion is right
        } else if let Shape::Vector(_) = kind.signature().shape {
            for value in &mut values {
                *value += part * value.abs().max(1e-3);
            }
        } else {
            for x in &mut values {
                *x *= 1.0 + part;
            }
        }
        Ok(values)
    }
}

/// Checks the reference with a mistake.
fn check(mechanism: &Mechanism, mistake: &'static str) -> Result<(), String> {
    let right = Naive::new(mechanism)?;
    check_engine(&Wrong { right, mistake }, mechanism, 2, 2).map(|_| ())
}

#[test]
fn each_wrong_result_is_refused_by_name() {
    let mechanism = files::mechanism(&files::robots().join("3rps_friction.yaml")).unwrap();
    check(&mechanism, "none").unwrap();
    for (mistake, comparison) in MISTAKES {
        let reason = check(&mechanism, mistake).expect_err(mistake);
        assert!(reason.contains(comparison), "{mistake}: {reason}");
    }
}

#[test]
fn names_in_another_order_are_refused() {
    let mechanism = files::mechanism(&files::robots().join("fivebar.yaml")).unwrap();
    let reason = check(&mechanism, "names").expect_err("swapped labels");
    assert!(reason.contains("parameters"), "{reason}");
}
