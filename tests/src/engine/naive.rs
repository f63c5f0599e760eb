//! The reference behind the interface of an engine, to test the checks themselves.

use nalgebra::{DMatrix, DVector};
use regen_codegen::signature::FunctionKind;

use super::check::{apply, names};
use super::{Answer, Engine, Names};
use crate::reference::{Mechanism, Parameter};

/// The reference as an engine.
pub struct Naive<'a> {
    mechanism: &'a Mechanism,
    home: Vec<f64>,
}

impl Naive<'_> {
    /// Computes the closed home configuration.
    ///
    /// # Errors
    /// When home does not close.
    pub fn new(mechanism: &Mechanism) -> Answer<Naive<'_>> {
        Ok(Naive {
            mechanism,
            home: mechanism.home()?,
        })
    }
}

impl Engine for Naive<'_> {
    fn names(&self) -> Names {
        names(self.mechanism)
    }

    fn home(&self) -> Vec<f64> {
        self.home.clone()
    }

    fn call(&self, kind: FunctionKind, inputs: &[&[f64]]) -> Answer<Vec<f64>> {
        let m = self.mechanism;
        let rows = |matrix: &DMatrix<f64>| matrix.transpose().as_slice().to_vec();
        let columns = |matrix: &DMatrix<f64>| matrix.as_slice().to_vec();
        let (q, x, y, z) = match *inputs {
            [q] => (q, &[][..], &[][..], &[][..]),
            [q, x] => (q, x, &[][..], &[][..]),
            [q, x, y] => (q, x, y, &[][..]),
            [q, x, y, z] => (q, x, y, z),
            _ => return Err(format!("{}: {} arguments", kind.name(), inputs.len())),
        };
        Ok(match kind {
            FunctionKind::Constraints => m.constraints(q),
            FunctionKind::Jacobian => rows(&m.jacobian(q)),
            FunctionKind::Bias => m.bias(q, x),
            FunctionKind::NewtonStep => self.newton_step(q)?,
            FunctionKind::Velocities => m.velocities(q, x)?,
            FunctionKind::Accelerations => m.accelerations(q, x, y)?,
            FunctionKind::Regressor => columns(&m.regressor(q, x, y)?),
            FunctionKind::InverseDynamics => self.inverse_dynamics(q, x, y, z)?,
            FunctionKind::Gravity => self.gravity(q, x)?,
            FunctionKind::BiasForces => self.bias_forces(q, x, y)?,
            FunctionKind::MassMatrix => rows(&self.mass_matrix(q, x)?),
            FunctionKind::AdaptiveRegressor => columns(&self.adaptive_regressor(q, x, y, z)?),
            FunctionKind::GeneralizedForces => self.efforts(q, x)?,
            FunctionKind::Poses => m.poses(q).concat(),
            FunctionKind::Cones => m.cone_cosines(q),
            // functions of base parameters and of controllers are compared in tests of their own
            _ => {
                return Err(format!("{} is unknown to the reference", kind.name()));
            }
        })
    }
}

impl Naive<'_> {
    fn newton_step(&self, q: &[f64]) -> Answer<Vec<f64>> {
        let f = DVector::from_vec(self.mechanism.constraints(q));
        let a = self.mechanism.jacobian(q);
        let step = self
            .mechanism
            .solve_dependent(&a, &DMatrix::from_columns(&[-f]))?;
        Ok(step.as_slice().to_vec())
    }

    fn inverse_dynamics(
        &self,
        q: &[f64],
        qd: &[f64],
        qdd: &[f64],
        phi: &[f64],
    ) -> Answer<Vec<f64>> {
        Ok(apply(&self.mechanism.regressor(q, qd, qdd)?, phi).0)
    }

    fn gravity(&self, q: &[f64], phi: &[f64]) -> Answer<Vec<f64>> {
        let rest = vec![0.0; q.len()];
        self.inverse_dynamics(q, &rest, &rest, phi)
    }

    fn bias_forces(&self, q: &[f64], qd: &[f64], phi: &[f64]) -> Answer<Vec<f64>> {
        let none = vec![0.0; self.mechanism.dof()];
        let qdd = self.mechanism.accelerations(q, qd, &none)?;
        let all = self.inverse_dynamics(q, qd, &qdd, phi)?;
        let gravity = self.gravity(q, phi)?;
        Ok(all.iter().zip(&gravity).map(|(a, g)| a - g).collect())
    }

    fn mass_matrix(&self, q: &[f64], phi: &[f64]) -> Answer<DMatrix<f64>> {
        let rest = vec![0.0; q.len()];
        let dof = self.mechanism.dof();
        let gravity = DVector::from_vec(self.gravity(q, phi)?);
        let mut out = DMatrix::zeros(dof, dof);
        for j in 0..dof {
            let mut unit = vec![0.0; dof];
            unit[j] = 1.0;
            let qdd = self.mechanism.accelerations(q, &rest, &unit)?;
            let tau = DVector::from_vec(self.inverse_dynamics(q, &rest, &qdd, phi)?);
            out.set_column(j, &(tau - &gravity));
        }
        Ok((&out + out.transpose()) / 2.0)
    }

    /// The adaptive regressor in the Christoffel form: the symmetric bilinear form of the efforts
    /// that are quadratic in the velocities.
    fn adaptive_regressor(
        &self,
        q: &[f64],
        qd: &[f64],
        qd_r_i: &[f64],
        qdd_r_i: &[f64],
    ) -> Answer<DMatrix<f64>> {
        let m = self.mechanism;
        let rest = vec![0.0; q.len()];
        let n = m.null_space(q)?;
        let n_rate = m.null_space_rate(q, qd)?;
        let v_i = DVector::from_column_slice(qd_r_i);
        let qd_r = &n * &v_i;
        let qdd_r = &n * DVector::from_column_slice(qdd_r_i) + n_rate * &v_i;
        let motion = DVector::from_column_slice(qd);
        let (sum, difference) = (&motion + &qd_r, &motion - &qd_r);
        let quadratic = m.tree_regressor(q, sum.as_slice(), &rest)
            - m.tree_regressor(q, difference.as_slice(), &rest);
        let mut tree = m.tree_regressor(q, &rest, qdd_r.as_slice()) + quadratic / 4.0;
        let on_reference = m.tree_regressor(q, qd_r.as_slice(), &rest);
        let on_motion = m.tree_regressor(q, qd, &rest);
        for (j, p) in m.parameters.iter().enumerate() {
            if matches!(p, Parameter::Friction(..)) {
                tree.set_column(j, &on_reference.column(j));
            }
            if matches!(p, Parameter::Term(_)) {
                tree.set_column(j, &on_motion.column(j));
            }
        }
        Ok(n.transpose() * tree)
    }

    fn efforts(&self, q: &[f64], tau_actuated: &[f64]) -> Answer<Vec<f64>> {
        let mut tau = vec![0.0; q.len()];
        for (k, value) in self.mechanism.actuated.iter().zip(tau_actuated) {
            tau[*k] = *value;
        }
        self.mechanism.reduce(q, &tau)
    }
}
