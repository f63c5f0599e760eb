//! Compiled engines: every `regen_runtime::Model`, checked in or of the macro.

use regen_codegen::robot::FunctionKind;
use regen_runtime::{Condition, Model, SizeError, Status};

use crate::engine::{Answer, Names};
use crate::functions::Functions;

/// A model as an engine.
pub struct Compiled<'a>(pub &'a dyn Model<f64>);

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

impl Functions for Compiled<'_> {
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

    fn rows(&self) -> usize {
        self.0.info().rows
    }

    fn dof(&self) -> usize {
        self.0.info().dof()
    }

    fn call(&self, kind: FunctionKind, inputs: &[&[f64]]) -> Answer<Vec<f64>> {
        call_model(self.0, kind, inputs)
    }
}
