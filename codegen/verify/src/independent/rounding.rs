//! How far two computations of the same forces may differ at a state.
//!
//! The program's own error is bounded operation by operation ([`Rounded`]). The second
//! derivation is another program: its error is bounded by the roundings along its longest chain,
//! [`CHAIN`] for each coordinate and row, each no more than a roundoff of the largest term of the
//! row, and by the condition of A_e where it solves for X.

use nalgebra::DMatrix;
use regen_codegen::interpret::{self, Double, Precision, Rounded};
use regen_codegen::robot::{FunctionKind, Robot};
use regen_reference::{Mechanism, State};

use crate::error::VerifyError;
use crate::vector::{dot, larger, size};

/// Roundings for each coordinate on the way from the ground to a force: two products of 4x4
/// matrices (8 in a row each), two recursions of velocity and acceleration (16 each), the wrench
/// and its projection (16).
const CHAIN: f64 = 64.0;

/// What the second derivation says at a state, and how far off both may be.
pub(crate) struct Compared {
    /// K of the tree, coordinates by parameters.
    pub(crate) tree: DMatrix<f64>,
    /// K_i - X^T K_e.
    pub(crate) reduced: DMatrix<f64>,
    /// X^T's rows with the identity: dof by coordinates.
    pub(crate) projection: DMatrix<f64>,
    /// The roundoff that counts: of numbers, or of a state that is closed to no more, times the
    /// condition of A_e and the length of the chain.
    pub(crate) unit: f64,
}

impl Compared {
    pub(crate) fn at(reference: &Mechanism, state: &State) -> Result<Self, VerifyError> {
        let State { q, qd, qdd } = state;
        let projection = reference
            .null_space(q)
            .map_err(VerifyError::NoForces)?
            .transpose();
        let tree = reference.tree_regressor(q, qd, qdd);
        Ok(Self {
            reduced: &projection * &tree,
            tree,
            projection,
            unit: unit(reference, q),
        })
    }

    /// The largest term that entry (row, column) of the reduced regressor is a sum of.
    pub(crate) fn term(&self, row: usize, column: usize) -> f64 {
        (0..self.tree.nrows())
            .map(|k| (self.projection[(row, k)] * self.tree[(k, column)]).abs())
            .fold(0.0, larger)
    }

    /// The largest term of a row.
    pub(crate) fn row(&self, row: usize) -> f64 {
        (0..self.tree.ncols())
            .map(|column| self.term(row, column))
            .fold(0.0, larger)
    }
}

/// Roundings in a row.
fn chain(reference: &Mechanism) -> f64 {
    CHAIN * (reference.n() + reference.rows()) as f64
}

/// How far open loops may be that are closed but for roundings, relative to their terms.
pub(crate) fn closed(reference: &Mechanism) -> f64 {
    chain(reference) * Double::UNIT
}

/// A state's unit of error in the second derivation: see [`Compared::unit`].
pub(crate) fn unit(reference: &Mechanism, q: &[f64]) -> f64 {
    let chain = chain(reference);
    if reference.dependent.is_empty() {
        return chain * Double::UNIT;
    }
    // a state that is open by more than roundings is an error, not an excuse
    let open = openness(reference, q).min(closed(reference));
    chain * (Double::UNIT + open) / reference.conditioning(q)
}

/// By how much the loops are open at a state, row by row relative to what the row's terms add up
/// to.
pub(crate) fn openness(reference: &Mechanism, q: &[f64]) -> f64 {
    let f: Vec<f64> = reference.constraints(q);
    let a = reference.jacobian(q);
    let scale = a
        .row_iter()
        .map(|row| {
            let terms = row.iter().zip(q);
            terms.map(|(a, q)| a.abs() * larger(1.0, q.abs())).sum()
        })
        .fold(0.0, larger);
    // NaN stays
    if scale == 0.0 { 0.0 } else { size(&f) / scale }
}

/// The program's reduced regressor, column by column, with the bounds of its errors in `P`.
pub(crate) fn regressor<P: Precision>(robot: &Robot, state: &State) -> Vec<Rounded<P>> {
    let exact = |v: &[f64]| -> Vec<Rounded<P>> { v.iter().map(|x| Rounded::exact(*x)).collect() };
    let (q, qd, qdd) = (exact(&state.q), exact(&state.qd), exact(&state.qdd));
    robot
        .function(FunctionKind::Regressor)
        .map_or_else(Vec::new, |function| {
            interpret::run(&function.program, &[&q, &qd, &qdd]).0
        })
}

/// The same in double precision, with 0 for what is nothing but rounding: columns may then be
/// scaled up however short they are, as in millimetres beside tonnes.
pub(crate) fn certain(robot: &Robot, state: &State) -> Vec<f64> {
    regressor::<Double>(robot, state)
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

/// The forces of parameters by the program, and the bound of their error.
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

/// The sizes of the forces' terms, row by row, of parameters that the reference multiplies.
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

/// The forces of parameters by the second derivation.
pub(crate) fn reference_forces(compared: &Compared, phi: &[f64]) -> Vec<f64> {
    let rows = compared.reduced.row_iter();
    rows.map(|row| {
        let row: Vec<f64> = row.iter().copied().collect();
        dot(&row, phi)
    })
    .collect()
}
