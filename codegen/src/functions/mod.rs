//! The functions that a robot gets, each as a request for expressions.

mod base;
mod closure;
mod dynamics;
mod symbols;

pub use symbols::Symbols;

use crate::base::Base;
use crate::constraints::Closed;
use crate::kinematics::Frames;
use crate::model::Model;
use crate::optimize::{Output, Request};
use crate::robot::FunctionKind;
use crate::sym::{Ex, Graph};

/// A derivation in progress: everything the functions draw on.
#[derive(Debug)]
pub struct Context<'a> {
    /// Where expressions are built.
    pub g: &'a mut Graph,
    /// The mechanism.
    pub model: &'a Model,
    /// Its frames.
    pub frames: &'a Frames,
    /// Its loops.
    pub closed: &'a Closed,
    /// Its symbols.
    pub symbols: Symbols,
    /// Its base parameters, where they were derived.
    pub base: Option<&'a Base>,
}

/// The request for a function; `None` where the robot does not have it.
pub fn request(cx: &mut Context<'_>, kind: FunctionKind) -> Option<Request> {
    // rows that hold by themselves leave nothing to solve, but are rows
    let rows = !cx.model.cuts.is_empty() || !cx.model.couplings.is_empty();
    if kind.needs_rows() && !rows || kind.needs_solve() && cx.closed.closure.is_none() {
        return None;
    }
    if kind.needs_base() {
        // a robot without base parameters has nothing to compute from them
        let base = cx.base.filter(|b| b.rank() > 0)?;
        return base_request(cx, base, kind);
    }
    match kind {
        FunctionKind::Constraints => Some(closure::constraints(cx)),
        FunctionKind::Jacobian => Some(closure::jacobian(cx)),
        FunctionKind::Bias => Some(closure::bias(cx)),
        FunctionKind::NewtonStep => closure::newton_step(cx),
        FunctionKind::DependentJacobian => closure::dependent_jacobian(cx),
        FunctionKind::Velocities => Some(closure::velocities(cx)),
        FunctionKind::Accelerations => Some(closure::accelerations(cx)),
        FunctionKind::Regressor => Some(dynamics::regressor(cx)),
        FunctionKind::InverseDynamics => Some(dynamics::inverse_dynamics(cx)),
        FunctionKind::Gravity => Some(dynamics::gravity(cx)),
        FunctionKind::BiasForces => Some(dynamics::bias_forces(cx)),
        FunctionKind::MassMatrix => Some(dynamics::mass_matrix(cx)),
        FunctionKind::SlotineLi => Some(dynamics::slotine_li(cx)),
        FunctionKind::Efforts => Some(dynamics::efforts(cx)),
        FunctionKind::Poses => Some(closure::poses(cx)),
        FunctionKind::Cones => closure::cones(cx),
        _ => None,
    }
}

fn base_request(cx: &mut Context<'_>, base: &Base, kind: FunctionKind) -> Option<Request> {
    Some(match kind {
        FunctionKind::BaseRegressor => base::base_regressor(cx, base),
        FunctionKind::ToBase => base::to_base(cx, base),
        FunctionKind::FromBase => base::parameters_from_base(cx, base),
        FunctionKind::BaseInverseDynamics => base::forces(cx, base, dynamics::Motion::Given),
        FunctionKind::BaseGravity => base::forces(cx, base, dynamics::Motion::Rest),
        FunctionKind::BaseBiasForces => base::forces(cx, base, dynamics::Motion::Coasting),
        FunctionKind::BaseMassMatrix => base::mass_matrix(cx, base),
        _ => return None,
    })
}

fn output(name: &str, shape: &[usize], doc: &str) -> Output {
    Output {
        name: name.to_owned(),
        shape: shape.to_vec(),
        doc: doc.to_owned(),
    }
}

fn group(title: impl Into<String>, values: Vec<Ex>) -> (String, Vec<Ex>) {
    (title.into(), values)
}
