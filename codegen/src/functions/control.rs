//! Functions for controllers and optimisers: momentum, Coriolis matrix, forward dynamics, and the
//! derivatives of both dynamics along the closure.
//!
//! With qd = J qd_i, the columns J_k of J and the rows A qd = 0 of the loops, J changes along the
//! closure by A_e dJ_l / dq_k = b(J_k, J_l), where b is the symmetric bilinear form of the bias
//! b(qd, qd). So with V_k = dJ/dq_k qd_i, which is also the rate of J_k:
//!
//! - p = J^T p_tree and dT/dq_i = J^T dT/dq + V^T p_tree;
//! - C = J^T (C_tree J + M_tree V);
//! - the reduced efforts J^T tau change by q_k by J^T (dtau/dq J_k + dtau/dqd V_k + M_tree dqdd/dq_k)
//!   and by tau . dJ/dq_k = b(J_k, J_l) . mu, with A_e^T mu = tau_e.

use crate::dynamics::{
    self, Reduction, TreeKinematics, coriolis_and_mass, momentum_rate_columns, tree_derivatives,
    velocities_as_accelerations,
};
use crate::kinematics::{LinkMotion, Rates, centres, motions, twists};
use crate::sym::{Ex, Graph, System};

use super::closure::{all_accelerations, rates_without_qdd};
use super::dynamics::{column_groups, name_columns, reduction};
use super::{Context, Groups, group};

type Matrix = Vec<Vec<Ex>>;

/// The given velocities with gravity and zero accelerations.
fn given_velocities(cx: &mut Context<'_>) -> Rates {
    let qd = cx.symbols.qd_nodes(cx.g);
    Rates {
        gravity: true,
        ..rates_without_qdd(qd.clone(), qd)
    }
}

/// The given velocities with gravity, and all accelerations from the independent ones.
fn rates_of(cx: &mut Context<'_>, qdd_i: &[Ex]) -> Rates {
    let qd = cx.symbols.qd_nodes(cx.g);
    let coasting = rates_without_qdd(qd.clone(), qd);
    let qdd = all_accelerations(cx, qdd_i, &coasting);
    Rates {
        qdd,
        gravity: true,
        ..coasting
    }
}

/// The links' motions at accelerations that equal the velocities.
fn velocities(cx: &mut Context<'_>, qd: &[Ex]) -> Vec<LinkMotion> {
    motions(cx.g, cx.frames, &velocities_as_accelerations(qd), None)
}

/// The links' velocities, and their motions at rest with gravity.
fn velocities_and_rest(cx: &mut Context<'_>, qd: &[Ex]) -> [Vec<LinkMotion>; 2] {
    let still = vec![Ex::ZERO; qd.len()];
    let rest = Rates {
        gravity: true,
        ..rates_without_qdd(still.clone(), still)
    };
    [velocities(cx, qd), motions(cx.g, cx.frames, &rest, None)]
}

/// The rate V of J, by coordinate and independent one.
fn reduction_rate(cx: &mut Context<'_>, j: &Reduction, qd: &[Ex]) -> Matrix {
    let (n, dof) = (cx.model.coordinates.len(), j.width());
    let mut rate = vec![vec![Ex::ZERO; dof]; n];
    let Some(closure) = &cx.closed.closure else {
        return rate;
    };
    let columns: Vec<Vec<Ex>> = (0..dof)
        .map(|k| {
            let polar = rates_without_qdd(j.column(k), qd.to_vec());
            closure.bias(cx.g, cx.frames, cx.model, &polar)
        })
        .collect();
    let rows = transposed(&columns);
    let solution = closure.solve(cx.g, cx.model, &rows);
    for (c, row) in cx.model.dependent.iter().zip(solution) {
        rate[*c] = row;
    }
    rate
}

fn transposed(columns: &[Vec<Ex>]) -> Matrix {
    let rows = columns.first().map_or(0, Vec::len);
    (0..rows)
        .map(|r| columns.iter().map(|column| column[r]).collect())
        .collect()
}

fn sum(g: &mut Graph, a: &[Vec<Ex>], b: &[Vec<Ex>]) -> Matrix {
    let rows = a.iter().zip(b);
    rows.map(|(a, b)| a.iter().zip(b).map(|(a, b)| g.add(*a, *b)).collect())
        .collect()
}

fn product(g: &mut Graph, a: &[Vec<Ex>], b: &[Vec<Ex>]) -> Matrix {
    let columns = transposed(b);
    a.iter()
        .map(|row| columns.iter().map(|column| g.dot(row, column)).collect())
        .collect()
}

pub(super) fn momentum(cx: &mut Context<'_>) -> Groups {
    let phi = cx.symbols.phi_nodes(cx.g);
    let qd = cx.symbols.qd_nodes(cx.g);
    let rates = velocities_as_accelerations(&qd);
    let velocities = velocities(cx, &qd);
    let p = dynamics::joint_efforts(cx.g, cx.frames, cx.model, &velocities, &rates, &phi);
    let j = reduction(cx);
    vec![group("p = M qd_i", j.reduce(cx.g, &p))]
}

pub(super) fn momentum_rate(cx: &mut Context<'_>) -> Groups {
    let phi = cx.symbols.phi_nodes(cx.g);
    let rates = given_velocities(cx);
    let [velocities, rest] = velocities_and_rest(cx, &rates.qd);
    let links = [&velocities[..], &rest];
    let momentum = dynamics::momentum(cx.g, cx.frames, cx.model, links, &rates, &phi);
    let j = reduction(cx);
    let j_rate = reduction_rate(cx, &j, &rates.qd);
    let mut rate = j.reduce(cx.g, &momentum.rate);
    for (entry, column) in rate.iter_mut().zip(transposed(&j_rate)) {
        let turning = cx.g.dot(&column, &momentum.p);
        *entry = cx.g.add(*entry, turning);
    }
    vec![group("dp/dt - tau", rate)]
}

pub(super) fn momentum_rate_regressor(cx: &mut Context<'_>) -> Groups {
    let rates = given_velocities(cx);
    let [velocities, rest] = velocities_and_rest(cx, &rates.qd);
    let j = reduction(cx);
    let j_rate = reduction_rate(cx, &j, &rates.qd);
    let twists = twists(cx.g, cx.frames, cx.model);
    let tree = TreeKinematics {
        frames: cx.frames,
        twists: &twists,
        centres: &centres(cx.g, cx.frames, cx.model),
    };
    let links = [&velocities[..], &rest];
    let columns = momentum_rate_columns(cx.g, cx.model, &tree, links, &rates, (&j, &j_rate));
    name_columns(cx, &columns);
    column_groups(cx, &columns)
}

pub(super) fn coriolis_matrix(cx: &mut Context<'_>) -> Groups {
    let phi = cx.symbols.phi_nodes(cx.g);
    let qd = cx.symbols.qd_nodes(cx.g);
    let velocities = velocities(cx, &qd);
    let [coriolis, mass] = coriolis_and_mass(cx.g, cx.frames, cx.model, &velocities, &phi);
    let j = reduction(cx);
    let j_rate = reduction_rate(cx, &j, &qd);
    let own = j.times(cx.g, &coriolis);
    let carried = product(cx.g, &mass, &j_rate);
    let all = sum(cx.g, &own, &carried);
    let reduced = j.reduce_rows(cx.g, &all);
    vec![group("C", reduced.concat())]
}

pub(super) fn forward_dynamics(cx: &mut Context<'_>) -> Groups {
    let phi = cx.symbols.phi_nodes(cx.g);
    let (qdd_i, _) = accelerations(cx, &phi);
    vec![group("qdd_i", qdd_i)]
}

/// The accelerations of the independent coordinates that the efforts cause, and the mass matrix.
fn accelerations(cx: &mut Context<'_>, phi: &[Ex]) -> (Vec<Ex>, Matrix) {
    let still = vec![Ex::ZERO; cx.model.independent.len()];
    let rates = rates_of(cx, &still);
    let motions = motions(cx.g, cx.frames, &rates, None);
    let bias = dynamics::joint_efforts(cx.g, cx.frames, cx.model, &motions, &rates, phi);
    let j = reduction(cx);
    let bias = j.reduce(cx.g, &bias);
    let tree = dynamics::mass_matrix(cx.g, cx.frames, cx.model, phi);
    let mass = j.reduce_matrix(cx.g, &tree);
    let tau = cx.symbols.tau_i_nodes(cx.g);
    let left = tau.iter().zip(bias);
    let left: Matrix = left.map(|(tau, bias)| vec![cx.g.sub(*tau, bias)]).collect();
    let qdd_i = solve_mass(cx.g, &mass, left);
    (qdd_i.concat(), mass)
}

/// The solution of `M Z = rhs` for a mass matrix M, by `M = L^T D L` from the tips inward, which
/// keeps the zeros of branches (Featherstone, 2005).
///
/// The guard's pivots are those of D relative to the diagonal of M: none is above 1 and all are
/// positive if M is positive definite. If one is not, the guarded system is made singular, so that
/// the condition tells it.
fn solve_mass(g: &mut Graph, mass: &[Vec<Ex>], rhs: Matrix) -> Matrix {
    let n = mass.len();
    let mut a = mass.to_vec();
    let mut factors = vec![vec![Ex::ZERO; n]; n];
    let mut inverses = vec![Ex::ZERO; n];
    let mut solution = rhs.clone();
    let mut pivots = Vec::new();
    let mut is_definite = Ex::ONE;
    for k in (0..n).rev() {
        let pivot = a[k][k];
        let inverse = g.div(Ex::ONE, pivot).unwrap_or(Ex::ZERO);
        inverses[k] = inverse;
        for i in 0..k {
            let factor = g.mul(a[k][i], inverse);
            factors[k][i] = factor;
            let row = a[k].clone();
            for (entry, other) in a[i].iter_mut().zip(&row).take(i + 1) {
                let change = g.mul(factor, *other);
                *entry = g.sub(*entry, change);
            }
            for side in 0..solution[k].len() {
                let change = g.mul(factor, solution[k][side]);
                solution[i][side] = g.sub(solution[i][side], change);
            }
        }
        let relative = g.div(pivot, mass[k][k]).unwrap_or(Ex::ZERO);
        let is_positive = g.positive(pivot);
        pivots.push((g.mul(is_positive, relative), 1.0));
        is_definite = g.mul(is_definite, is_positive);
    }
    for (k, inverse) in inverses.iter().enumerate() {
        for side in 0..solution[k].len() {
            let mut entry = g.mul(*inverse, solution[k][side]);
            for i in 0..k {
                let change = g.mul(factors[k][i], solution[i][side]);
                entry = g.sub(entry, change);
            }
            solution[k][side] = entry;
        }
    }
    let mut matrix = mass.to_vec();
    if let Some(row) = matrix.first_mut() {
        for entry in row {
            *entry = g.mul(is_definite, *entry);
        }
    }
    let sides = rhs.first().map_or(0, Vec::len);
    let id = g.add_system(System {
        matrix,
        rhs,
        fixed: solution,
        pivots,
    });
    (0..n)
        .map(|row| (0..sides).map(|side| g.solved(id, row, side)).collect())
        .collect()
}

/// The derivatives of the reduced efforts by the independent coordinates and by their velocities,
/// for a motion with gravity that keeps the loops closed.
fn slopes(cx: &mut Context<'_>, rates: &Rates, phi: &[Ex]) -> [Matrix; 2] {
    let links = motions(cx.g, cx.frames, rates, None);
    let velocities = velocities(cx, &rates.qd);
    let symbols = [cx.symbols.q.clone(), cx.symbols.qd.clone()];
    let symbols = symbols.each_ref().map(Vec::as_slice);
    let links = [&links[..], &velocities];
    let tree = tree_derivatives(cx.g, cx.frames, cx.model, links, rates, symbols, phi);
    let j = reduction(cx);
    let mut by_q = j.times(cx.g, &tree.by_q);
    let mut by_qd = j.times(cx.g, &tree.by_qd);
    let Some(closure) = &cx.closed.closure else {
        return [by_q, by_qd].map(|slopes| j.reduce_rows(cx.g, &slopes));
    };
    let dof = j.width();
    let j_rate = reduction_rate(cx, &j, &rates.qd);
    // the dependent accelerations change by 2 V where qd_i does
    let twice = sum(cx.g, &j_rate, &j_rate);
    let pushed = product(cx.g, &tree.by_qdd, &twice);
    by_qd = sum(cx.g, &by_qd, &pushed);
    let columns: Vec<Vec<Ex>> = transposed(&j_rate)
        .iter()
        .enumerate()
        .map(|(k, column)| {
            let along = [&j.column(k)[..], column];
            closure.acceleration_slopes(cx.g, (cx.frames, cx.model), rates, symbols, along)
        })
        .collect();
    let solution = closure.solve(cx.g, cx.model, &transposed(&columns));
    let mut qdd_by_q = vec![vec![Ex::ZERO; dof]; cx.model.coordinates.len()];
    for (c, row) in cx.model.dependent.iter().zip(solution) {
        qdd_by_q[*c] = row;
    }
    for (slopes, rates) in [(&tree.by_qd, &j_rate), (&tree.by_qdd, &qdd_by_q)] {
        let more = product(cx.g, slopes, rates);
        by_q = sum(cx.g, &by_q, &more);
    }
    let mut by_q = j.reduce_rows(cx.g, &by_q);
    let by_qd = j.reduce_rows(cx.g, &by_qd);
    let dependent = cx.model.dependent.iter();
    let efforts: Vec<Ex> = dependent.map(|c| tree.efforts[*c]).collect();
    let multipliers = closure.solve_transposed(cx.g, cx.model, &efforts);
    let pairs = (0..dof).flat_map(|k| (0..=k).map(move |l| (k, l)));
    for (k, l) in pairs {
        let polar = rates_without_qdd(j.column(k), j.column(l));
        let bias = closure.bias(cx.g, cx.frames, cx.model, &polar);
        let turning = cx.g.dot(&bias, &multipliers);
        by_q[k][l] = cx.g.add(by_q[k][l], turning);
        if l != k {
            by_q[l][k] = cx.g.add(by_q[l][k], turning);
        }
    }
    [by_q, by_qd]
}

pub(super) fn inverse_dynamics_derivatives(cx: &mut Context<'_>) -> Groups {
    let phi = cx.symbols.phi_nodes(cx.g);
    let mut rates = given_velocities(cx);
    rates.qdd = cx.symbols.qdd_nodes(cx.g);
    let [by_q, by_qd] = slopes(cx, &rates, &phi);
    vec![
        group("by q_i", transposed(&by_q).concat()),
        group("by qd_i", transposed(&by_qd).concat()),
    ]
}

pub(super) fn forward_dynamics_derivatives(cx: &mut Context<'_>) -> Groups {
    let phi = cx.symbols.phi_nodes(cx.g);
    let (qdd_i, mass) = accelerations(cx, &phi);
    let rates = rates_of(cx, &qdd_i);
    let slopes = slopes(cx, &rates, &phi);
    let dof = mass.len();
    let rhs = (0..dof).map(|row| {
        let own = slopes.iter().flat_map(|slopes| slopes[row].iter());
        let mut side: Vec<Ex> = own.map(|slope| cx.g.neg(*slope)).collect();
        side.extend((0..dof).map(|k| if k == row { Ex::ONE } else { Ex::ZERO }));
        side
    });
    let rhs: Matrix = rhs.collect();
    let solution = transposed(&solve_mass(cx.g, &mass, rhs));
    let parts = solution.chunks(dof.max(1));
    let titles = ["by q_i", "by qd_i", "by tau_i"].into_iter();
    titles
        .zip(parts)
        .map(|(title, part)| group(title, part.concat()))
        .collect()
}
