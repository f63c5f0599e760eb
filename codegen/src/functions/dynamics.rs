//! Dynamic functions: regressors, forces, mass matrix.

use crate::dynamics::{self, Reduction, Ways};
use crate::kinematics::{LinkMotion, Rates, centres, motions, twists};
use crate::optimize::Request;
use crate::sym::Ex;

use super::closure::{all_accelerations, all_velocities, rates_without_qdd};
use super::{Context, group, output};

fn reduction(cx: &mut Context<'_>) -> Reduction {
    let x = match &cx.closed.closure {
        Some(closure) => closure.solve_x(cx.g, cx.model),
        None => Vec::new(),
    };
    Reduction::new(cx.g, cx.model, &x)
}

fn link_motions(cx: &mut Context<'_>, rates: &Rates) -> Vec<LinkMotion> {
    let names: Vec<String> = cx.model.links.iter().map(|l| l.name.clone()).collect();
    motions(cx.g, cx.frames, rates, Some(&names))
}

/// The ordinary motion: everything given.
fn given_rates(cx: &mut Context<'_>) -> Rates {
    let qd = cx.symbols.qd_nodes(cx.g);
    Rates {
        rd: qd.clone(),
        qd,
        qdd: cx.symbols.qdd_nodes(cx.g),
        gravity: true,
    }
}

/// The columns of W for a motion; those that are not wanted may take more operations.
fn columns_of(cx: &mut Context<'_>, rates: &Rates, wanted: &[bool]) -> Vec<Vec<Ex>> {
    let j = reduction(cx);
    let motions = link_motions(cx, rates);
    let twists = twists(cx.g, cx.frames, cx.model);
    let ways = Ways {
        twists: &twists,
        centres: &centres(cx.g, cx.frames, cx.model),
    };
    let columns = dynamics::reduced_regressor(cx.g, cx.model, &motions, &ways, rates, &j, wanted);
    for (column, parameter) in columns.iter().zip(&cx.model.parameters) {
        for (entry, i) in column.iter().zip(&cx.model.independent) {
            let row = &cx.model.coordinates[*i].name;
            cx.g.name(*entry, || format!("w_{}_{row}", parameter.label));
        }
    }
    columns
}

/// The columns of W for the motion given; those that are not wanted may take more operations.
pub(super) fn regressor_columns(cx: &mut Context<'_>, wanted: &[bool]) -> Vec<Vec<Ex>> {
    let rates = given_rates(cx);
    columns_of(cx, &rates, wanted)
}

/// The columns of W in groups: one per body, one for friction and rotors.
fn regressor_groups(cx: &mut Context<'_>, rates: &Rates) -> Vec<(String, Vec<Ex>)> {
    let columns = columns_of(cx, rates, &vec![true; cx.model.parameters.len()]);
    let mut groups = Vec::new();
    let (inertial, rest) = columns.split_at(10 * cx.model.bodies.len());
    for (body, columns) in cx.model.bodies.iter().zip(inertial.chunks(10)) {
        let title = format!("body {}: Ixx Ixy Ixz Iyy Iyz Izz mx my mz m", body.label);
        groups.push(group(title, columns.concat()));
    }
    if !rest.is_empty() {
        groups.push(group("friction and rotors (Eq. 14-19)", rest.concat()));
    }
    groups
}

pub(super) fn regressor(cx: &mut Context<'_>) -> Request {
    let rates = given_rates(cx);
    let groups = regressor_groups(cx, &rates);
    let shape = [cx.model.parameters.len(), cx.model.independent.len()];
    Request {
        arguments: vec![cx.symbols.q(), cx.symbols.qd(), cx.symbols.qdd()],
        output: output(
            "w",
            &shape,
            "column by column: `w[c][r]` multiplies `PARAMETERS[c]` in the equation of `INDEPENDENT[r]`",
        ),
        groups,
    }
}

pub(super) fn slotine_li(cx: &mut Context<'_>) -> Request {
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
    let groups = regressor_groups(cx, &rates);
    let shape = [cx.model.parameters.len(), cx.model.independent.len()];
    Request {
        arguments: vec![
            cx.symbols.q(),
            cx.symbols.qd(),
            cx.symbols.qd_r(),
            cx.symbols.qdd_r(),
        ],
        output: output(
            "y",
            &shape,
            "column by column: Y phi = M qdd_r + C(q, qd) qd_r + g, with dM/dt - 2 C skew",
        ),
        groups,
    }
}

/// Which part of the forces is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Motion {
    /// All of them, for the motion given.
    Given,
    /// Gravity alone, at rest.
    Rest,
    /// Velocities alone: no gravity, and no acceleration of the independent
    /// coordinates.
    Coasting,
}

/// J^T K phi for a motion; the parameters are the last argument.
pub(super) fn forces(cx: &mut Context<'_>, motion: Motion, phi: &[Ex]) -> Request {
    let n = cx.model.coordinates.len();
    let (rates, mut arguments, doc) = match motion {
        Motion::Given => (
            given_rates(cx),
            vec![cx.symbols.q(), cx.symbols.qd(), cx.symbols.qdd()],
            "(K_i - X^T K_e) phi, N m or N, in the order of `INDEPENDENT`",
        ),
        Motion::Rest => {
            let still = vec![Ex::ZERO; n];
            let rates = Rates {
                gravity: true,
                ..rates_without_qdd(still.clone(), still)
            };
            (
                rates,
                vec![cx.symbols.q()],
                "the efforts that hold the mechanism at rest",
            )
        }
        Motion::Coasting => {
            let qd = cx.symbols.qd_nodes(cx.g);
            let mut rates = rates_without_qdd(qd.clone(), qd);
            let still = vec![Ex::ZERO; cx.model.independent.len()];
            rates.qdd = all_accelerations(cx, &still, &rates);
            (
                rates,
                vec![cx.symbols.q(), cx.symbols.qd()],
                "Coriolis, centrifugal and friction efforts: inverse dynamics at qdd_i = 0, less gravity",
            )
        }
    };
    let motions = link_motions(cx, &rates);
    let tau = dynamics::joint_efforts(cx.g, cx.frames, cx.model, &motions, &rates, phi);
    let j = reduction(cx);
    let tau = j.reduce(cx.g, &tau);
    arguments.push(cx.symbols.phi());
    Request {
        arguments,
        output: output("tau", &[cx.model.independent.len()], doc),
        groups: vec![group("tau", tau)],
    }
}

pub(super) fn inverse_dynamics(cx: &mut Context<'_>) -> Request {
    let phi = cx.symbols.phi_nodes(cx.g);
    forces(cx, Motion::Given, &phi)
}

pub(super) fn gravity(cx: &mut Context<'_>) -> Request {
    let phi = cx.symbols.phi_nodes(cx.g);
    forces(cx, Motion::Rest, &phi)
}

pub(super) fn bias_forces(cx: &mut Context<'_>) -> Request {
    let phi = cx.symbols.phi_nodes(cx.g);
    forces(cx, Motion::Coasting, &phi)
}

pub(super) fn mass_matrix(cx: &mut Context<'_>) -> Request {
    let phi = cx.symbols.phi_nodes(cx.g);
    mass_matrix_of(cx, &phi)
}

/// M for parameters given as expressions; they are the last argument.
pub(super) fn mass_matrix_of(cx: &mut Context<'_>, phi: &[Ex]) -> Request {
    let tree = dynamics::mass_matrix(cx.g, cx.frames, cx.model, phi);
    let j = reduction(cx);
    let matrix = j.reduce_matrix(cx.g, &tree);
    let width = matrix.len();
    Request {
        arguments: vec![cx.symbols.q(), cx.symbols.phi()],
        output: output(
            "m",
            &[width, width],
            "M = J^T M_tree J, J = [1; -X]; rotors included",
        ),
        groups: vec![group("M", matrix.into_iter().flatten().collect())],
    }
}

pub(super) fn efforts(cx: &mut Context<'_>) -> Request {
    let measured = cx.symbols.tau_nodes(cx.g);
    let mut tau = vec![Ex::ZERO; cx.model.coordinates.len()];
    for (c, value) in cx.model.actuated.iter().zip(measured) {
        tau[*c] = value;
    }
    let j = reduction(cx);
    let reduced = j.reduce(cx.g, &tau);
    Request {
        arguments: vec![cx.symbols.q(), cx.symbols.tau()],
        output: output(
            "left",
            &[cx.model.independent.len()],
            "tau_i - X^T tau_e (Eq. 10): what W phi must equal",
        ),
        groups: vec![group("tau_i - X^T tau_e (Eq. 10)", reduced)],
    }
}
