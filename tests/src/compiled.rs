//! Compiled engines: every `regen_runtime::Model`, checked in or of the macro.

use nalgebra::DMatrix;
use regen_codegen::robot::FunctionKind;
use regen_runtime::{Condition, Model, SizeError, Status};

use crate::engine::{Answer, Engine, Names};

/// A model as an engine.
pub struct Compiled<'a>(pub &'a dyn Model<f64>);

impl Compiled<'_> {
    fn call(&self, kind: FunctionKind, inputs: &[&[f64]]) -> Answer<Vec<f64>> {
        call_model(self.0, kind, inputs)
    }

    /// The regressors' shape: columns of dof entries.
    fn columns(&self, kind: FunctionKind, inputs: &[&[f64]]) -> Answer<DMatrix<f64>> {
        let flat = self.call(kind, inputs)?;
        let info = self.0.info();
        Ok(DMatrix::from_column_slice(
            info.dof(),
            info.parameters.len(),
            &flat,
        ))
    }
}

fn call_model(model: &dyn Model<f64>, kind: FunctionKind, inputs: &[&[f64]]) -> Answer<Vec<f64>> {
    let info = model.info();
    let (n, dof, dependent) = (info.coordinates.len(), info.dof(), info.dependent.len());
    let size = match kind {
        FunctionKind::Constraints | FunctionKind::Bias => info.rows,
        FunctionKind::Jacobian => info.rows * n,
        FunctionKind::NewtonStep => dependent,
        FunctionKind::DependentJacobian => dependent * dependent,
        FunctionKind::Velocities | FunctionKind::Accelerations => n,
        FunctionKind::Regressor | FunctionKind::SlotineLi => dof * info.parameters.len(),
        FunctionKind::MassMatrix => dof * dof,
        FunctionKind::InverseDynamics
        | FunctionKind::Gravity
        | FunctionKind::BiasForces
        | FunctionKind::Efforts => dof,
        FunctionKind::Poses => 12 * info.bodies.len(),
        FunctionKind::Cones => info.cones.len(),
        other => return Err(format!("{} is no method of Model", other.name())),
    };
    // What is not written stays recognisable.
    let mut out = vec![f64::NAN; size];
    let o = &mut out;
    let regular = |done: Result<(), SizeError>| done.map(|()| Condition { pivot: 1.0 });
    let condition = match (kind, inputs) {
        (FunctionKind::Constraints, [q]) => regular(model.constraints(q, o)),
        (FunctionKind::Jacobian, [q]) => regular(model.jacobian(q, o)),
        (FunctionKind::Bias, [q, qd]) => regular(model.bias(q, qd, o)),
        (FunctionKind::NewtonStep, [q]) => model.newton_step(q, o),
        (FunctionKind::DependentJacobian, [q]) => regular(model.dependent_jacobian(q, o)),
        (FunctionKind::Velocities, [q, v]) => model.velocities(q, v, o),
        (FunctionKind::Accelerations, [q, qd, a]) => model.accelerations(q, qd, a, o),
        (FunctionKind::Regressor, [q, qd, qdd]) => model.regressor(q, qd, qdd, o),
        (FunctionKind::InverseDynamics, [q, qd, qdd, phi]) => {
            model.inverse_dynamics(q, qd, qdd, phi, o)
        }
        (FunctionKind::Gravity, [q, phi]) => model.gravity(q, phi, o),
        (FunctionKind::BiasForces, [q, qd, phi]) => model.bias_forces(q, qd, phi, o),
        (FunctionKind::MassMatrix, [q, phi]) => model.mass_matrix(q, phi, o),
        (FunctionKind::SlotineLi, [q, qd, v, a]) => model.slotine_li(q, qd, v, a, o),
        (FunctionKind::Efforts, [q, tau]) => model.efforts(q, tau, o),
        (FunctionKind::Poses, [q]) => regular(model.poses(q, o)),
        (FunctionKind::Cones, [q]) => regular(model.cones(q, o)),
        _ => return Err(format!("{}: {} arguments", kind.name(), inputs.len())),
    };
    let condition = condition.map_err(|e| format!("{}: {e}", kind.name()))?;
    match condition.status() {
        Status::Singular => Err(format!("{}: {condition:?}", kind.name())),
        _ => Ok(out),
    }
}

impl Engine for Compiled<'_> {
    fn names(&self) -> Names {
        let info = self.0.info();
        let all = |list: &[&str]| list.iter().map(|s| (*s).to_owned()).collect();
        let pick = |list: &[usize]| {
            let names = list.iter().map(|k| info.coordinates[*k].to_owned());
            names.collect()
        };
        Names {
            coordinates: all(info.coordinates),
            independent: pick(info.independent),
            actuated: pick(info.actuated),
            parameters: all(info.parameters),
            bodies: all(info.bodies),
            cuts: info
                .cuts
                .iter()
                .map(|c| (c.name.to_owned(), c.rows))
                .collect(),
            cones: info
                .cones
                .iter()
                .map(|c| (c.name.to_owned(), c.greatest))
                .collect(),
            nominal: info.nominal.to_vec(),
        }
    }

    fn home(&self) -> Vec<f64> {
        self.0.info().home.to_vec()
    }

    fn constraints(&self, q: &[f64]) -> Answer<Vec<f64>> {
        self.call(FunctionKind::Constraints, &[q])
    }

    fn jacobian(&self, q: &[f64]) -> Answer<DMatrix<f64>> {
        let flat = self.call(FunctionKind::Jacobian, &[q])?;
        Ok(DMatrix::from_row_slice(self.0.info().rows, q.len(), &flat))
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
        self.columns(FunctionKind::Regressor, &[q, qd, qdd])
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
        let flat = self.call(FunctionKind::MassMatrix, &[q, phi])?;
        let dof = self.0.info().dof();
        Ok(DMatrix::from_row_slice(dof, dof, &flat))
    }

    fn slotine_li(
        &self,
        q: &[f64],
        qd: &[f64],
        qd_r_i: &[f64],
        qdd_r_i: &[f64],
    ) -> Answer<DMatrix<f64>> {
        self.columns(FunctionKind::SlotineLi, &[q, qd, qd_r_i, qdd_r_i])
    }

    fn efforts(&self, q: &[f64], tau_actuated: &[f64]) -> Answer<Vec<f64>> {
        self.call(FunctionKind::Efforts, &[q, tau_actuated])
    }

    fn poses(&self, q: &[f64]) -> Answer<Vec<[f64; 12]>> {
        let flat = self.call(FunctionKind::Poses, &[q])?;
        Ok(flat.as_chunks::<12>().0.to_vec())
    }

    fn cones(&self, q: &[f64]) -> Answer<Vec<f64>> {
        self.call(FunctionKind::Cones, &[q])
    }
}
