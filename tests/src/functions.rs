//! Engines whose quantities are all functions of the derivation, called by their kind.

use nalgebra::DMatrix;
use regen_codegen::robot::FunctionKind;

use crate::engine::{Answer, Engine, Names};

/// What an engine must have to be called function by function.
pub trait Functions {
    /// The names of its parts.
    fn names(&self) -> Names;
    /// The closed state that everything starts from.
    fn home(&self) -> Vec<f64>;
    /// The rows of f, all of them.
    fn rows(&self) -> usize;
    /// The number of independent coordinates.
    fn dof(&self) -> usize;
    /// A function's results, as they are stored; nothing where there is no such function.
    ///
    /// # Errors
    /// Where the engine says that the state is singular, or that sizes are wrong.
    fn call(&self, kind: FunctionKind, inputs: &[&[f64]]) -> Answer<Vec<f64>>;
}

/// A result stored column by column, each over the independent coordinates.
fn columns(engine: &impl Functions, kind: FunctionKind, inputs: &[&[f64]]) -> Answer<DMatrix<f64>> {
    let (rows, values) = (engine.dof(), engine.call(kind, inputs)?);
    let columns = values.len() / rows;
    Ok(DMatrix::from_column_slice(rows, columns, &values))
}

impl<F: Functions> Engine for F {
    fn names(&self) -> Names {
        Functions::names(self)
    }

    fn home(&self) -> Vec<f64> {
        Functions::home(self)
    }

    fn constraints(&self, q: &[f64]) -> Answer<Vec<f64>> {
        self.call(FunctionKind::Constraints, &[q])
    }

    fn jacobian(&self, q: &[f64]) -> Answer<DMatrix<f64>> {
        let values = self.call(FunctionKind::Jacobian, &[q])?;
        Ok(DMatrix::from_row_slice(self.rows(), q.len(), &values))
    }

    fn bias(&self, q: &[f64], qd: &[f64]) -> Answer<Vec<f64>> {
        self.call(FunctionKind::Bias, &[q, qd])
    }

    fn newton_step(&self, q: &[f64]) -> Answer<Vec<f64>> {
        self.call(FunctionKind::NewtonStep, &[q])
    }

    fn velocities(&self, q: &[f64], qd_i: &[f64]) -> Answer<Vec<f64>> {
        self.call(FunctionKind::Velocities, &[q, qd_i])
    }

    fn accelerations(&self, q: &[f64], qd: &[f64], qdd_i: &[f64]) -> Answer<Vec<f64>> {
        self.call(FunctionKind::Accelerations, &[q, qd, qdd_i])
    }

    fn regressor(&self, q: &[f64], qd: &[f64], qdd: &[f64]) -> Answer<DMatrix<f64>> {
        columns(self, FunctionKind::Regressor, &[q, qd, qdd])
    }

    fn inverse_dynamics(
        &self,
        q: &[f64],
        qd: &[f64],
        qdd: &[f64],
        phi: &[f64],
    ) -> Answer<Vec<f64>> {
        self.call(FunctionKind::InverseDynamics, &[q, qd, qdd, phi])
    }

    fn gravity(&self, q: &[f64], phi: &[f64]) -> Answer<Vec<f64>> {
        self.call(FunctionKind::Gravity, &[q, phi])
    }

    fn bias_forces(&self, q: &[f64], qd: &[f64], phi: &[f64]) -> Answer<Vec<f64>> {
        self.call(FunctionKind::BiasForces, &[q, qd, phi])
    }

    fn mass_matrix(&self, q: &[f64], phi: &[f64]) -> Answer<DMatrix<f64>> {
        columns(self, FunctionKind::MassMatrix, &[q, phi])
    }

    fn slotine_li(
        &self,
        q: &[f64],
        qd: &[f64],
        qd_r_i: &[f64],
        qdd_r_i: &[f64],
    ) -> Answer<DMatrix<f64>> {
        columns(self, FunctionKind::SlotineLi, &[q, qd, qd_r_i, qdd_r_i])
    }

    fn efforts(&self, q: &[f64], tau_actuated: &[f64]) -> Answer<Vec<f64>> {
        self.call(FunctionKind::Efforts, &[q, tau_actuated])
    }

    fn poses(&self, q: &[f64]) -> Answer<Vec<[f64; 12]>> {
        let values = self.call(FunctionKind::Poses, &[q])?;
        let (poses, _) = values.as_chunks::<12>();
        Ok(poses.to_vec())
    }

    fn cones(&self, q: &[f64]) -> Answer<Vec<f64>> {
        self.call(FunctionKind::Cones, &[q])
    }
}
