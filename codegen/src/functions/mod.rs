//! The functions that a robot can have, each as a request for a program.

mod base;
mod closure;
mod control;
mod dynamics;
mod frames;
mod symbols;

pub use symbols::Symbols;

use crate::base::Base;
use crate::constraints::Closed;
use crate::kinematics::Frames;
use crate::model::Model;
use crate::optimize::{self, Output, Request};
use crate::signature::{Argument, FunctionKind, GEOMETRY, Needs, Size};
use crate::sym::{Ex, Graph, SymbolId};

/// The results of the derivation that the functions are built from.
#[derive(Debug)]
pub struct Context<'a> {
    /// The graph to which the expressions are added.
    pub g: &'a mut Graph,
    /// The mechanism.
    pub model: &'a Model,
    /// The frames of its links.
    pub frames: &'a Frames,
    /// Its closed home and the solution of its closure equations.
    pub closed: &'a Closed,
    /// The symbols of the functions' arguments.
    pub symbols: Symbols,
    /// Its base parameters, if they were derived.
    pub base: Option<&'a Base>,
}

/// The expressions that a function computes, in the order of its output, grouped under titles.
type Groups = Vec<(String, Vec<Ex>)>;

/// Builds the request for a function; `None` if the robot does not have it.
pub fn request(cx: &mut Context<'_>, kind: FunctionKind) -> Option<Request> {
    let signature = kind.signature();
    if !has(cx, signature.needs) {
        return None;
    }
    let groups = groups(cx, kind)?;
    let arguments = signature.arguments.iter();
    let arguments = arguments
        .map(|a| argument(cx, *a))
        .collect::<Option<Vec<_>>>()?;
    let geometry = cx.symbols.geometry.clone();
    let geometry = (!geometry.is_empty()).then(|| {
        let argument = optimize::Argument {
            name: GEOMETRY.name.to_owned(),
            len: geometry.len(),
            doc: GEOMETRY.doc.to_owned(),
        };
        (argument, geometry)
    });
    let lengths = signature.shape.outer_first().into_iter();
    Some(Request {
        arguments: arguments.into_iter().chain(geometry).collect(),
        output: Output {
            name: signature.output.to_owned(),
            shape: lengths.map(|size| length(cx, size)).collect(),
            doc: signature.output_doc.to_owned(),
        },
        groups,
    })
}

fn has(cx: &Context<'_>, needs: Needs) -> bool {
    match needs {
        Needs::Nothing => true,
        // where the rows always hold there is nothing to solve, but the robot has functions of them
        Needs::Rows => cx.model.is_closed(),
        Needs::Dependent => cx.closed.closure.is_some(),
        Needs::Cones => !cx.model.cones.is_empty(),
        Needs::Frames => !cx.model.frames.is_empty(),
        // a robot without base parameters has nothing to compute from them
        Needs::Base => cx.base.is_some_and(|base| base.rank() > 0),
    }
}

fn groups(cx: &mut Context<'_>, kind: FunctionKind) -> Option<Groups> {
    let base = cx.base;
    Some(match kind {
        FunctionKind::Constraints => closure::constraints(cx),
        FunctionKind::Jacobian => closure::jacobian(cx),
        FunctionKind::Bias => closure::bias(cx),
        FunctionKind::NewtonStep => closure::newton_step(cx)?,
        FunctionKind::DependentJacobian => closure::dependent_jacobian(cx)?,
        FunctionKind::Velocities => closure::velocities(cx),
        FunctionKind::Accelerations => closure::accelerations(cx),
        FunctionKind::Regressor => dynamics::regressor(cx),
        FunctionKind::InverseDynamics => dynamics::inverse_dynamics(cx),
        FunctionKind::Gravity => dynamics::gravity(cx),
        FunctionKind::BiasForces => dynamics::bias_forces(cx),
        FunctionKind::MassMatrix => dynamics::mass_matrix(cx),
        FunctionKind::AdaptiveRegressor => dynamics::adaptive_regressor(cx),
        FunctionKind::GeneralizedForces => dynamics::generalized_forces(cx),
        FunctionKind::Poses => closure::poses(cx),
        FunctionKind::Cones => closure::cones(cx),
        FunctionKind::BaseRegressor => base::base_regressor(cx, base?),
        FunctionKind::ToBase => base::to_base(cx, base?),
        FunctionKind::FromBase => base::parameters_from_base(cx, base?),
        FunctionKind::BaseInverseDynamics => base::forces(cx, base?, dynamics::Motion::Given),
        FunctionKind::BaseGravity => base::forces(cx, base?, dynamics::Motion::Rest),
        FunctionKind::BaseBiasForces => base::forces(cx, base?, dynamics::Motion::Coasting),
        FunctionKind::BaseMassMatrix => base::mass_matrix(cx, base?),
        FunctionKind::Momentum => control::momentum(cx),
        FunctionKind::MomentumRate => control::momentum_rate(cx),
        FunctionKind::MomentumRegressor => dynamics::momentum_regressor(cx),
        FunctionKind::MomentumRateRegressor => control::momentum_rate_regressor(cx),
        FunctionKind::CoriolisMatrix => control::coriolis_matrix(cx),
        FunctionKind::ForwardDynamics => control::forward_dynamics(cx),
        FunctionKind::InverseDynamicsDerivatives => control::inverse_dynamics_derivatives(cx),
        FunctionKind::ForwardDynamicsDerivatives => control::forward_dynamics_derivatives(cx),
        FunctionKind::FramePose => frames::pose(cx),
        FunctionKind::FrameJacobian => frames::jacobian(cx),
        FunctionKind::FrameJacobianRate => frames::jacobian_rate(cx),
    })
}

/// An argument and its symbols; `None` if it needs base parameters that the robot lacks.
fn argument(
    cx: &mut Context<'_>,
    argument: Argument,
) -> Option<(optimize::Argument, Vec<SymbolId>)> {
    let symbols = symbols(cx, argument)?;
    let row = argument.row();
    let argument = optimize::Argument {
        name: row.name.to_owned(),
        len: symbols.len(),
        doc: row.doc.to_owned(),
    };
    Some((argument, symbols))
}

fn symbols(cx: &mut Context<'_>, argument: Argument) -> Option<Vec<SymbolId>> {
    let independent = |all: &[SymbolId]| cx.model.independent.iter().map(|c| all[*c]).collect();
    Some(match argument {
        Argument::Q => cx.symbols.q.clone(),
        Argument::Qd => cx.symbols.qd.clone(),
        Argument::Qdd => cx.symbols.qdd.clone(),
        Argument::QdI => independent(&cx.symbols.qd),
        Argument::QddI => independent(&cx.symbols.qdd),
        Argument::QdRI => cx.symbols.qd_r.clone(),
        Argument::QddRI => cx.symbols.qdd_r.clone(),
        Argument::Phi => cx.symbols.phi.clone(),
        Argument::TauActuated => cx.symbols.tau.clone(),
        Argument::TauI => cx.symbols.tau_i.clone(),
        Argument::Beta => base::beta(cx, cx.base?),
        Argument::Free => base::free(cx, cx.base?),
    })
}

fn length(cx: &Context<'_>, size: Size) -> usize {
    let model = cx.model;
    match size {
        Size::Coordinates => model.coordinates.len(),
        Size::Independent => model.independent.len(),
        Size::Dependent => model.dependent.len(),
        Size::Actuated => model.actuated.len(),
        Size::Rows => model.rows(),
        Size::Parameters => model.parameters.len(),
        Size::Bodies => model.bodies.len(),
        Size::Cones => model.cones.len(),
        Size::Base => cx.base.map_or(0, Base::rank),
        Size::Free => cx.base.map_or(0, |base| base.null.len()),
        Size::Pose => 12,
        Size::Frames => model.frames.len(),
        Size::FrameRates => 6 * model.frames.len(),
        Size::State => 2 * model.independent.len(),
        Size::StateEfforts => 3 * model.independent.len(),
    }
}

fn group(title: impl Into<String>, values: Vec<Ex>) -> (String, Vec<Ex>) {
    (title.into(), values)
}
