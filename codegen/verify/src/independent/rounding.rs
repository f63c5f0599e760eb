//! Bounds of the rounding errors by which two computations of the same forces may differ at a
//! state.
//!
//! The error of the robot's functions is bounded operation by operation ([`Rounded`]). The error of
//! the second derivation is bounded by the number of roundings along its longest chain,
//! [`ROUNDINGS_PER_COORDINATE`] for each coordinate and row, each at most a roundoff of the largest
//! term of the row, and by the condition of A_e, since it solves for X.

use nalgebra::DMatrix;
use regen_codegen::interpret::{self, Double, Precision, Rounded};
use regen_codegen::robot::{FunctionKind, Robot};
use regen_reference::{Mechanism, State};

use crate::error::VerifyError;
use crate::vector::{dot, larger, max_abs};

/// Roundings for each coordinate on the path from the ground to a force: two products of 4x4
/// matrices (8 in a row each), two recursions of velocity and acceleration (16 each), the wrench
/// and its projection (16).
const ROUNDINGS_PER_COORDINATE: f64 = 64.0;

/// The results of the second derivation at a state, with their error.
pub(crate) struct Compared {
    /// The regressor K of the tree: one row per coordinate, one column per parameter.
    pub(crate) tree: DMatrix<f64>,
    /// The reduced regressor K_i - X^T K_e.
    pub(crate) reduced: DMatrix<f64>,
    /// The projection on the independent coordinates, the identity and -X^T: one row per
    /// independent coordinate, one column per coordinate.
    pub(crate) projection: DMatrix<f64>,
    /// The relative error: the roundoff of numbers, and of a state that satisfies the closure
    /// equations no better, times the condition of A_e and the length of the chain.
    pub(crate) unit: f64,
}

impl Compared {
    pub(crate) fn at(reference: &Mechanism, state: &State) -> Result<Self, VerifyError> {
        let State { q, qd, qdd } = state;
        let projection = reference
            .null_space(q)
            .map_err(VerifyError::ReferenceFailed)?
            .transpose();
        let tree = reference.tree_regressor(q, qd, qdd);
        Ok(Self {
            reduced: &projection * &tree,
            tree,
            projection,
            unit: unit(reference, q),
        })
    }

    /// The largest term of the sum that is entry (row, column) of the reduced regressor.
    pub(crate) fn term(&self, row: usize, column: usize) -> f64 {
        (0..self.tree.nrows())
            .map(|k| (self.projection[(row, k)] * self.tree[(k, column)]).abs())
            .fold(0.0, larger)
    }

    /// The largest term in a row of the reduced regressor.
    pub(crate) fn row(&self, row: usize) -> f64 {
        (0..self.tree.ncols())
            .map(|column| self.term(row, column))
            .fold(0.0, larger)
    }
}

/// Number of roundings in a row.
fn chain(reference: &Mechanism) -> f64 {
    ROUNDINGS_PER_COORDINATE * (reference.n() + reference.rows()) as f64
}

/// Bound of the closure residual of a state that is closed up to rounding, relative to its terms.
pub(crate) fn closed_residual_bound(reference: &Mechanism) -> f64 {
    chain(reference) * Double::UNIT
}

/// The relative error of the second derivation at a state: see [`Compared::unit`].
pub(crate) fn unit(reference: &Mechanism, q: &[f64]) -> f64 {
    let chain = chain(reference);
    if reference.dependent.is_empty() {
        return chain * Double::UNIT;
    }
    // a larger closure residual is an error of the state, and must not widen the bound
    let open = relative_residual(reference, q).min(closed_residual_bound(reference));
    chain * (Double::UNIT + open) / reference.conditioning(q)
}

/// The closure residual at a state, relative to the largest sum of the terms in a row.
pub(crate) fn relative_residual(reference: &Mechanism, q: &[f64]) -> f64 {
    let f: Vec<f64> = reference.constraints(q);
    let a = reference.jacobian(q);
    let scale = a
        .row_iter()
        .map(|row| {
            let terms = row.iter().zip(q);
            terms.map(|(a, q)| a.abs() * larger(1.0, q.abs())).sum()
        })
        .fold(0.0, larger);
    // a NaN is propagated
    if scale == 0.0 {
        0.0
    } else {
        max_abs(&f) / scale
    }
}

/// The robot's reduced regressor, column by column, with the bounds of its errors in `P`.
pub(crate) fn regressor<P: Precision>(robot: &Robot, state: &State) -> Vec<Rounded<P>> {
    regressor_of(robot, state, 0.0)
}

/// The same for a state that is known to so many roundoffs.
fn regressor_of<P: Precision>(robot: &Robot, state: &State, roundoffs: f64) -> Vec<Rounded<P>> {
    let known = |v: &[f64]| -> Vec<Rounded<P>> {
        let error = roundoffs * P::UNIT * larger(1.0, max_abs(v));
        v.iter().map(|x| Rounded::within(*x, error)).collect()
    };
    let (q, qd, qdd) = (known(&state.q), known(&state.qd), known(&state.qdd));
    robot
        .function(FunctionKind::Regressor)
        .map_or_else(Vec::new, |function| {
            interpret::run(&function.program, &[&q, &qd, &qdd]).0
        })
}

/// Roundoffs to which the states of closed loops are known: their closure ends within a few.
const STATE_ROUNDOFFS: f64 = 32.0;

/// The regressor in double precision, with 0 for entries within their error bounds: columns may
/// then be scaled up however short they are, as in a spec in millimetres and tonnes. An entry that is 0 where
/// the loops close, such as of a body that does not turn, is as large as the error of the state.
pub(crate) fn certain(robot: &Robot, state: &State) -> Vec<f64> {
    let closes = robot.function(FunctionKind::Constraints).is_some();
    let roundoffs = if closes { STATE_ROUNDOFFS } else { 0.0 };
    regressor_of::<Double>(robot, state, roundoffs)
        .iter()
        .map(|x| {
            if x.value.abs() <= x.error {
                0.0
            } else {
                x.value
            }
        })
        .collect()
}

/// The robot's forces for given parameters, with the bounds of their errors.
pub(crate) fn forces(w: &[Rounded<Double>], phi: &[f64], dof: usize) -> Vec<(f64, f64)> {
    (0..dof)
        .map(|row| {
            let entries = w.iter().skip(row).step_by(dof.max(1));
            let terms = entries.zip(phi);
            let mut sum = Rounded::exact(0.0);
            for (entry, phi) in terms {
                sum = sum + *entry * Rounded::exact(*phi);
            }
            (sum.value, sum.error)
        })
        .collect()
}

/// For each force, the sum of the magnitudes of its terms for given parameters, by the second
/// derivation.
pub(crate) fn terms(compared: &Compared, phi: &[f64]) -> Vec<f64> {
    (0..compared.reduced.nrows())
        .map(|row| {
            let columns = phi.iter().enumerate();
            columns
                .map(|(column, phi)| compared.term(row, column) * phi.abs())
                .sum()
        })
        .collect()
}

/// The forces for given parameters by the second derivation.
pub(crate) fn reference_forces(compared: &Compared, phi: &[f64]) -> Vec<f64> {
    let rows = compared.reduced.row_iter();
    rows.map(|row| {
        let row: Vec<f64> = row.iter().copied().collect();
        dot(&row, phi)
    })
    .collect()
}
