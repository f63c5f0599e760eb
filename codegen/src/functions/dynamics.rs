//! Dynamic functions: regressors, forces and the mass matrix.

use crate::dynamics::{self, Reduction, TreeKinematics};
use crate::kinematics::{LinkMotion, Rates, centres, motions, twists};
use crate::model::{Model, Parameter};
use crate::sym::Ex;

use super::closure::{all_accelerations, all_velocities, rates_without_qdd};
use super::{Context, Groups, group};

pub(super) fn reduction(cx: &mut Context<'_>) -> Reduction {
    let x = match &cx.closed.closure {
        Some(closure) => closure.solve_x(cx.g, cx.model),
        None => Vec::new(),
    };
    Reduction::new(cx.g, cx.model, &x)
}

pub(super) fn link_motions(cx: &mut Context<'_>, rates: &Rates) -> Vec<LinkMotion> {
    let names: Vec<String> = cx.model.links.iter().map(|l| l.name.clone()).collect();
    motions(cx.g, cx.frames, rates, Some(&names))
}

/// The rates of the functions' arguments: q, qd and qdd of all coordinates, with gravity.
fn given_rates(cx: &mut Context<'_>) -> Rates {
    let qd = cx.symbols.qd_nodes(cx.g);
    Rates {
        rd: qd.clone(),
        qd,
        qdd: cx.symbols.qdd_nodes(cx.g),
        gravity: true,
    }
}

/// The columns of W for given rates; columns that are not `wanted` may take more operations.
fn columns_of(cx: &mut Context<'_>, rates: &Rates, wanted: &[bool]) -> Vec<Vec<Ex>> {
    let j = reduction(cx);
    let motions = link_motions(cx, rates);
    let twists = twists(cx.g, cx.frames, cx.model);
    let tree = TreeKinematics {
        frames: cx.frames,
        twists: &twists,
        centres: &centres(cx.g, cx.frames, cx.model),
    };
    let columns = dynamics::reduced_regressor(cx.g, cx.model, &motions, &tree, rates, &j, wanted);
    name_columns(cx, &columns);
    columns
}

pub(super) fn name_columns(cx: &mut Context<'_>, columns: &[Vec<Ex>]) {
    for (column, parameter) in columns.iter().zip(&cx.model.parameters) {
        for (entry, i) in column.iter().zip(&cx.model.independent) {
            let row = &cx.model.coordinates[*i].name;
            cx.g.name(*entry, || format!("w_{}_{row}", parameter.label));
        }
    }
}

/// The columns of W for the rates of the arguments; columns that are not `wanted` may take more
/// operations.
pub(super) fn regressor_columns(cx: &mut Context<'_>, wanted: &[bool]) -> Vec<Vec<Ex>> {
    let rates = given_rates(cx);
    columns_of(cx, &rates, wanted)
}

/// The title of the columns that follow those of the bodies.
pub(super) fn remaining_columns(model: &Model) -> &'static str {
    let mut parameters = model.parameters.iter();
    let springs = parameters.any(Parameter::is_spring_or_term);
    if springs {
        "friction, rotors (Eq. 14-19) and springs"
    } else {
        "friction and rotors (Eq. 14-19)"
    }
}

/// The columns of W as groups of expressions: one per body, one for friction and rotors.
fn regressor_groups(cx: &mut Context<'_>, rates: &Rates) -> Groups {
    let columns = columns_of(cx, rates, &vec![true; cx.model.parameters.len()]);
    column_groups(cx, &columns)
}

/// The columns of a regressor as groups of expressions, as [`regressor_groups`].
pub(super) fn column_groups(cx: &Context<'_>, columns: &[Vec<Ex>]) -> Groups {
    let mut groups = Vec::new();
    let (inertial, rest) = columns.split_at(10 * cx.model.bodies.len());
    for (body, columns) in cx.model.bodies.iter().zip(inertial.chunks(10)) {
        let title = format!("body {}: Ixx Ixy Ixz Iyy Iyz Izz mx my mz m", body.label);
        groups.push(group(title, columns.concat()));
    }
    if !rest.is_empty() {
        groups.push(group(remaining_columns(cx.model), rest.concat()));
    }
    groups
}

pub(super) fn regressor(cx: &mut Context<'_>) -> Groups {
    let rates = given_rates(cx);
    regressor_groups(cx, &rates)
}

/// The regressor of the momentum: that of accelerations that equal the velocities, at rest.
pub(super) fn momentum_regressor(cx: &mut Context<'_>) -> Groups {
    let qd = cx.symbols.qd_nodes(cx.g);
    let rates = dynamics::velocities_as_accelerations(&qd);
    regressor_groups(cx, &rates)
}

pub(super) fn adaptive_regressor(cx: &mut Context<'_>) -> Groups {
    let (qd_r, qdd_r) = cx.symbols.reference_nodes(cx.g);
    let rd = all_velocities(cx, &qd_r);
    let qd = cx.symbols.qd_nodes(cx.g);
    let polar = rates_without_qdd(qd.clone(), rd.clone());
    let qdd = all_accelerations(cx, &qdd_r, &polar);
    let rates = Rates {
        qd,
        rd,
        qdd,
        gravity: true,
    };
    regressor_groups(cx, &rates)
}

/// The motion for which forces are computed, which selects a part of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Motion {
    /// The given velocities and accelerations, with gravity: all forces.
    Given,
    /// At rest, with gravity: the forces of gravity, springs and offsets.
    Rest,
    /// The given velocities, zero accelerations of the independent coordinates, and no gravity: the
    /// forces that the velocities cause.
    Coasting,
}

/// The forces J^T K phi of a motion.
pub(super) fn forces(cx: &mut Context<'_>, motion: Motion, phi: &[Ex]) -> Groups {
    let n = cx.model.coordinates.len();
    let rates = match motion {
        Motion::Given => given_rates(cx),
        Motion::Rest => {
            let still = vec![Ex::ZERO; n];
            Rates {
                gravity: true,
                ..rates_without_qdd(still.clone(), still)
            }
        }
        Motion::Coasting => {
            let qd = cx.symbols.qd_nodes(cx.g);
            let mut rates = rates_without_qdd(qd.clone(), qd);
            let still = vec![Ex::ZERO; cx.model.independent.len()];
            rates.qdd = all_accelerations(cx, &still, &rates);
            rates
        }
    };
    let motions = link_motions(cx, &rates);
    let tau = dynamics::joint_efforts(cx.g, cx.frames, cx.model, &motions, &rates, phi);
    let j = reduction(cx);
    let tau = j.reduce(cx.g, &tau);
    vec![group("tau", tau)]
}

pub(super) fn inverse_dynamics(cx: &mut Context<'_>) -> Groups {
    let phi = cx.symbols.phi_nodes(cx.g);
    forces(cx, Motion::Given, &phi)
}

pub(super) fn gravity(cx: &mut Context<'_>) -> Groups {
    let phi = cx.symbols.phi_nodes(cx.g);
    forces(cx, Motion::Rest, &phi)
}

pub(super) fn bias_forces(cx: &mut Context<'_>) -> Groups {
    let phi = cx.symbols.phi_nodes(cx.g);
    forces(cx, Motion::Coasting, &phi)
}

pub(super) fn mass_matrix(cx: &mut Context<'_>) -> Groups {
    let phi = cx.symbols.phi_nodes(cx.g);
    mass_matrix_of(cx, &phi)
}

/// The mass matrix over the independent coordinates, for parameters given as expressions.
pub(super) fn mass_matrix_of(cx: &mut Context<'_>, phi: &[Ex]) -> Groups {
    let tree = dynamics::mass_matrix(cx.g, cx.frames, cx.model, phi);
    let j = reduction(cx);
    let matrix = j.reduce_matrix(cx.g, &tree);
    vec![group("M", matrix.into_iter().flatten().collect())]
}

pub(super) fn generalized_forces(cx: &mut Context<'_>) -> Groups {
    let measured = cx.symbols.tau_nodes(cx.g);
    let mut tau = vec![Ex::ZERO; cx.model.coordinates.len()];
    for (c, value) in cx.model.actuated.iter().zip(measured) {
        tau[*c] = value;
    }
    let j = reduction(cx);
    let reduced = j.reduce(cx.g, &tau);
    vec![group("tau_i - X^T tau_e (Eq. 10)", reduced)]
}
