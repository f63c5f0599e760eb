//! The judgement can fail: an engine with one wrong answer is refused, and the reason names it.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use nalgebra::DMatrix;
use regen_tests::engine::{Answer, Engine, Naive, Names, check_engine};
use regen_tests::files;
use regen_tests::reference::Mechanism;

/// The mistakes that are tried, each with the comparison that must notice it.
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
    ("slotine_li", "dM/dt - 2C skew"),
    ("efforts", "efforts"),
    ("poses", "poses"),
    ("cones", "cones"),
];

/// An engine that is right but for one method, off by a part in a million.
struct Wrong<'a> {
    right: Naive<'a>,
    mistake: &'static str,
}

impl Wrong<'_> {
    fn list(&self, method: &str, mut right: Vec<f64>) -> Vec<f64> {
        if self.mistake == method {
            for value in &mut right {
                *value += 1e-6 * value.abs().max(1e-3);
            }
        }
        right
    }

    fn matrix(&self, method: &str, right: DMatrix<f64>) -> DMatrix<f64> {
        if self.mistake == method {
            right * (1.0 + 1e-6)
        } else {
            right
        }
    }
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
        self.list("home", self.right.home())
    }
    fn constraints(&self, q: &[f64]) -> Answer<Vec<f64>> {
        Ok(self.list("constraints", self.right.constraints(q)?))
    }
    fn jacobian(&self, q: &[f64]) -> Answer<DMatrix<f64>> {
        Ok(self.matrix("jacobian", self.right.jacobian(q)?))
    }
    fn bias(&self, q: &[f64], qd: &[f64]) -> Answer<Vec<f64>> {
        Ok(self.list("bias", self.right.bias(q, qd)?))
    }
    fn newton_step(&self, q: &[f64]) -> Answer<Vec<f64>> {
        // A slightly wrong step still converges; one that is a third short does not in ten.
        let short = if self.mistake == "newton_step" {
            0.7
        } else {
            1.0
        };
        Ok(self
            .right
            .newton_step(q)?
            .iter()
            .map(|x| x * short)
            .collect())
    }
    fn velocities(&self, q: &[f64], qd_i: &[f64]) -> Answer<Vec<f64>> {
        Ok(self.list("velocities", self.right.velocities(q, qd_i)?))
    }
    fn accelerations(&self, q: &[f64], qd: &[f64], qdd_i: &[f64]) -> Answer<Vec<f64>> {
        Ok(self.list("accelerations", self.right.accelerations(q, qd, qdd_i)?))
    }
    fn regressor(&self, q: &[f64], qd: &[f64], qdd: &[f64]) -> Answer<DMatrix<f64>> {
        Ok(self.matrix("regressor", self.right.regressor(q, qd, qdd)?))
    }
    fn inverse_dynamics(
        &self,
        q: &[f64],
        qd: &[f64],
        qdd: &[f64],
        phi: &[f64],
    ) -> Answer<Vec<f64>> {
        let right = self.right.inverse_dynamics(q, qd, qdd, phi)?;
        Ok(self.list("inverse_dynamics", right))
    }
    fn gravity(&self, q: &[f64], phi: &[f64]) -> Answer<Vec<f64>> {
        Ok(self.list("gravity", self.right.gravity(q, phi)?))
    }
    fn bias_forces(&self, q: &[f64], qd: &[f64], phi: &[f64]) -> Answer<Vec<f64>> {
        Ok(self.list("bias_forces", self.right.bias_forces(q, qd, phi)?))
    }
    fn mass_matrix(&self, q: &[f64], phi: &[f64]) -> Answer<DMatrix<f64>> {
        Ok(self.matrix("mass_matrix", self.right.mass_matrix(q, phi)?))
    }
    fn slotine_li(
        &self,
        q: &[f64],
        qd: &[f64],
        qd_r_i: &[f64],
        qdd_r_i: &[f64],
    ) -> Answer<DMatrix<f64>> {
        let right = self.right.slotine_li(q, qd, qd_r_i, qdd_r_i)?;
        // Off where the references rest, so that the split and not the sum is wrong.
        let resting = qdd_r_i.iter().all(|x| x.abs() < 1e-12);
        Ok(if resting {
            self.matrix("slotine_li", right)
        } else {
            right
        })
    }
    fn efforts(&self, q: &[f64], tau_actuated: &[f64]) -> Answer<Vec<f64>> {
        Ok(self.list("efforts", self.right.efforts(q, tau_actuated)?))
    }
    fn poses(&self, q: &[f64]) -> Answer<Vec<[f64; 12]>> {
        let mut poses = self.right.poses(q)?;
        if self.mistake == "poses" {
            poses[0][9] += 1e-6;
        }
        Ok(poses)
    }
    fn cones(&self, q: &[f64]) -> Answer<Vec<f64>> {
        Ok(self.list("cones", self.right.cones(q)?))
    }
}

fn judge(mechanism: &Mechanism, mistake: &'static str) -> Result<(), String> {
    let right = Naive::new(mechanism)?;
    check_engine(&Wrong { right, mistake }, mechanism, 2, 2).map(|_| ())
}

#[test]
fn each_wrong_answer_is_refused_by_name() {
    let mechanism = files::mechanism(&files::robots().join("3rps_friction.yaml")).unwrap();
    judge(&mechanism, "none").unwrap();
    for (mistake, comparison) in MISTAKES {
        let reason = judge(&mechanism, mistake).expect_err(mistake);
        assert!(reason.contains(comparison), "{mistake}: {reason}");
    }
}

#[test]
fn names_in_another_order_are_refused() {
    let mechanism = files::mechanism(&files::robots().join("fivebar.yaml")).unwrap();
    let reason = judge(&mechanism, "names").expect_err("swapped labels");
    assert!(reason.contains("parameters"), "{reason}");
}
