//! All coordinates at a state, with their derivatives.

use crate::Number;

/// All coordinates at a state, with their derivatives by the independent ones.
#[derive(Clone, Debug, Default)]
pub(crate) struct Posture {
    pub(crate) q: Vec<f64>,
    pub(crate) qd: Vec<f64>,
    /// dq/dq_i, n x dof, column by column.
    pub(crate) reach: Vec<f64>,
    /// The derivatives of all velocities by the independent positions, n x dof, column by column;
    /// empty without derivatives.
    pub(crate) turning: Vec<f64>,
    /// Coordinates and velocities as numbers with derivatives, one pair for every [`DIRECTIONS`](crate::DIRECTIONS)
    /// directions of the state.
    pub(super) numbers: Vec<[Vec<Number>; 2]>,
}

impl Posture {
    /// The row of dq/dq_i of one coordinate.
    pub(crate) fn row(&self, coordinate: usize) -> impl Iterator<Item = f64> {
        let n = self.q.len().max(1);
        self.reach.iter().skip(coordinate).step_by(n).copied()
    }

    /// The derivatives of one velocity by the independent positions.
    pub(crate) fn turning_row(&self, coordinate: usize) -> impl Iterator<Item = f64> {
        let n = self.q.len().max(1);
        self.turning.iter().skip(coordinate).step_by(n).copied()
    }
}
