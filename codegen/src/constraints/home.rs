//! Closing the mechanism at home, numerically, and its mobility there.

use std::fmt;

use crate::model::Model;
use crate::numeric::{rank_and_columns, solve_pivoted};
use crate::sym::Graph;
use crate::sym::eval::Evaluator;

use super::rows::Equations;
use super::units::Units;

/// Closed: no residual above this, in the mechanism's units.
const CLOSED: f64 = 1e-12;
/// Pivots below this part of the largest are rank deficiencies.
const RANK_TOLERANCE: f64 = 1e-8;
/// How far columns should be from those chosen before, as a part of them.
const APART: [f64; 4] = [0.1, 0.01, 1e-4, RANK_TOLERANCE];
/// Entries of A, in the mechanism's units, that are nothing but rounding.
const ROUNDING: f64 = 1e-13;
const MAX_STEPS: usize = 100;

/// Why there is no usable home.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum HomeProblem {
    /// The loops cannot be closed from the given start.
    NotClosed {
        /// Largest residual that was left.
        residual: f64,
    },
    /// The number of independent coordinates is not the mobility.
    Mobility {
        /// Degrees of freedom at home.
        mobility: usize,
        /// A valid choice of independent coordinates.
        choice: Vec<usize>,
    },
    /// The number fits, but the dependent coordinates do not follow from these.
    NotIndependent {
        /// A valid choice of independent coordinates.
        choice: Vec<usize>,
    },
}

impl fmt::Display for HomeProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotClosed { residual } => write!(
                f,
                "the loops do not close at home (residual {residual:.2e}, in m and rad)"
            ),
            Self::Mobility { mobility, .. } => write!(
                f,
                "the mechanism has {mobility} degrees of freedom at home, and another number of \
                 independent coordinates"
            ),
            Self::NotIndependent { .. } => f.write_str(
                "the dependent coordinates do not follow from the independent ones at home",
            ),
        }
    }
}

impl std::error::Error for HomeProblem {}

/// Evaluates f and A of a mechanism over all coordinates.
#[derive(Debug)]
pub struct NumericLoops<'g> {
    evaluator: Evaluator<'g>,
    rows: usize,
    coordinates: usize,
    /// Row and column of each entry of A that is not always zero.
    filled: Vec<(usize, usize)>,
    units: Units,
}

impl<'g> NumericLoops<'g> {
    /// From the equations in the world. The coordinates must be the graph's
    /// first symbols, in order.
    pub fn new(g: &'g Graph, equations: &Equations, model: &Model) -> Self {
        let mut roots = equations.residual.clone();
        let mut filled = Vec::new();
        for (i, row) in equations.jacobian.iter().enumerate() {
            for (c, entry) in row.iter().enumerate().filter(|(_, e)| !e.is_zero()) {
                roots.push(*entry);
                filled.push((i, c));
            }
        }
        NumericLoops {
            evaluator: Evaluator::new(g, roots),
            filled,
            rows: equations.residual.len(),
            coordinates: model.coordinates.len(),
            units: Units::of(model),
        }
    }

    /// The units of [`NumericLoops::normal`].
    pub fn units(&self) -> &Units {
        &self.units
    }

    /// f and A at a state, in the mechanism's units.
    pub fn normal(&self, q: &[f64]) -> (Vec<f64>, Vec<Vec<f64>>) {
        let (mut f, mut a) = self.at(q);
        for (f, unit) in f.iter_mut().zip(&self.units.rows) {
            *f /= unit;
        }
        for &(i, c) in &self.filled {
            a[i][c] *= self.units.coordinates[c] / self.units.rows[i];
        }
        (f, a)
    }

    /// f and A at a state.
    pub fn at(&self, q: &[f64]) -> (Vec<f64>, Vec<Vec<f64>>) {
        let mut values = self.evaluator.run(q);
        let entries = values.split_off(self.rows);
        let mut a = vec![vec![0.0; self.coordinates]; self.rows];
        for (&(i, c), entry) in self.filled.iter().zip(entries) {
            a[i][c] = entry;
        }
        (values, a)
    }

    /// Newton's method over the coordinates in `free`, damped where the
    /// residual would grow. Returns the largest residual that is left, in the mechanism's units,
    /// and the pivot ratio of the last step.
    pub fn close(&self, q: &mut Vec<f64>, free: &[usize]) -> (f64, f64) {
        let (mut f, mut a) = self.normal(q);
        let mut ratio = 1.0;
        for _ in 0..MAX_STEPS {
            let before = largest(&f);
            if before == 0.0 {
                break;
            }
            let matrix = select(&a, free);
            let rhs = f.iter().map(|x| vec![-x]).collect();
            let solved = solve_pivoted(matrix, rhs);
            ratio = solved.pivot_ratio;
            if ratio == 0.0 {
                break;
            }
            // bounded, so that the iteration keeps to the branch it started on
            let size = solved
                .solution
                .iter()
                .fold(0.0_f64, |m, x| m.max(x[0].abs()));
            let mut scale = (0.5 / size).min(1.0);
            let mut better = None;
            for _ in 0..12 {
                let mut next = q.clone();
                for (c, step) in free.iter().zip(&solved.solution) {
                    next[*c] += scale * step[0] * self.units.coordinates[*c];
                }
                let (nf, na) = self.normal(&next);
                let after = largest(&nf);
                // a full step close to the solution may leave rounding only
                if after < before || (before < CLOSED && after <= 2.0 * before) {
                    better = Some((next, nf, na, after));
                    break;
                }
                scale *= 0.5;
            }
            let Some((next, nf, na, after)) = better else {
                break;
            };
            let done = before < CLOSED && after >= before;
            (*q, f, a) = (next, nf, na);
            if done {
                break;
            }
        }
        (largest(&f), ratio)
    }
}

/// The columns of a matrix that are named.
pub(super) fn select(a: &[Vec<f64>], columns: &[usize]) -> Vec<Vec<f64>> {
    a.iter()
        .map(|row| columns.iter().map(|&c| row[c]).collect())
        .collect()
}

fn largest(f: &[f64]) -> f64 {
    let worst = f.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    if f.iter().any(|x| x.is_nan()) {
        f64::INFINITY
    } else {
        worst
    }
}

/// The home configuration, closed: independent coordinates keep their values.
///
/// # Errors
/// Where the loops do not close, or the independent coordinates do not fit the
/// mobility.
pub fn close_home(loops: &NumericLoops<'_>, model: &Model) -> Result<Vec<f64>, HomeProblem> {
    let start: Vec<f64> = model.home.iter().map(crate::sym::Number::to_f64).collect();
    let size = 1.0 + largest(&loops.normal(&start).0);
    let mut q = start.clone();
    let (open, _) = loops.close(&mut q, &model.dependent);
    if open <= CLOSED * size {
        check_mobility(loops, model, &q)?;
        return Ok(q);
    }
    // perhaps the choice is wrong: close with all coordinates and look there
    let mut all = start;
    let every = (0..model.coordinates.len()).collect::<Vec<_>>();
    let (any_residual, _) = close_least(loops, &mut all, &every);
    if any_residual <= 1e-9 * size {
        check_mobility(loops, model, &all)?;
    }
    // what is told is in the spec's units
    let residual = largest(&loops.at(&q).0);
    Err(HomeProblem::NotClosed { residual })
}

/// Newton with more unknowns than equations: the pivot columns move.
fn close_least(loops: &NumericLoops<'_>, q: &mut Vec<f64>, free: &[usize]) -> (f64, f64) {
    let mut last = (f64::INFINITY, 0.0);
    for _ in 0..4 {
        let (_, a) = loops.normal(q);
        let (rank, columns) = rank_and_columns(select(&a, free), RANK_TOLERANCE);
        if rank == 0 {
            break;
        }
        let chosen: Vec<usize> = columns.iter().map(|&c| free[c]).collect();
        last = loops.close(q, &chosen);
        if last.0 <= CLOSED {
            break;
        }
    }
    last
}

fn check_mobility(loops: &NumericLoops<'_>, model: &Model, q: &[f64]) -> Result<(), HomeProblem> {
    let (_, mut a) = loops.normal(q);
    // cuts that hold by themselves leave rows of rounding, and no rank
    if a.iter().flatten().all(|x| x.abs() < ROUNDING) {
        for row in &mut a {
            row.fill(0.0);
        }
    }
    let n = model.coordinates.len();
    let (rank, _) = rank_and_columns(a.clone(), RANK_TOLERANCE);
    let mobility = n - rank;
    if mobility != model.independent.len() {
        let choice = valid_choice(&a, model, rank);
        return Err(HomeProblem::Mobility { mobility, choice });
    }
    let (dependent_rank, _) = rank_and_columns(select(&a, &model.dependent), RANK_TOLERANCE);
    if dependent_rank < model.dependent.len() {
        let choice = valid_choice(&a, model, rank);
        return Err(HomeProblem::NotIndependent { choice });
    }
    Ok(())
}

/// A set of coordinates from which the others follow: actuated ones where
/// possible.
fn valid_choice(a: &[Vec<f64>], model: &Model, rank: usize) -> Vec<usize> {
    let n = model.coordinates.len();
    // coupled coordinates are dependent in any case
    let mut order: Vec<usize> = model.couplings.iter().map(|c| c.key).collect();
    // later coordinates are more often the passive end of a branch
    let passive = (0..n).rev().filter(|c| !model.actuated.contains(c));
    order.extend(passive.chain(model.actuated.iter().rev().copied()));
    // well-conditioned where possible
    let chosen = APART.map(|apart| dependent_columns(a, &order, rank, apart));
    let full = chosen.iter().find(|d| d.len() == rank);
    let dependent = full.unwrap_or(&chosen[APART.len() - 1]);
    (0..n).filter(|c| !dependent.contains(c)).collect()
}

/// At most `rank` columns, in a given order, that are not near the span of
/// those before: what is left of a column is above a part of it.
fn dependent_columns(a: &[Vec<f64>], order: &[usize], rank: usize, apart: f64) -> Vec<usize> {
    let largest = a
        .iter()
        .flatten()
        .fold(0.0_f64, |m, x| if x.abs() > m { x.abs() } else { m });
    let mut basis: Vec<Vec<f64>> = Vec::new();
    let mut chosen = Vec::new();
    for &c in order {
        if chosen.len() == rank {
            break;
        }
        let column: Vec<f64> = a.iter().map(|row| row[c]).collect();
        let size = dot(&column, &column).sqrt();
        let mut rest = column;
        for b in &basis {
            let along = dot(b, &rest);
            for (x, y) in rest.iter_mut().zip(b) {
                *x -= along * y;
            }
        }
        let left = dot(&rest, &rest).sqrt();
        // also false for NaN
        if left > apart * size && size > RANK_TOLERANCE * largest && !chosen.contains(&c) {
            basis.push(rest.iter().map(|x| x / left).collect());
            chosen.push(c);
        }
    }
    chosen
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_chosen_in_order_unless_they_follow_or_are_nothing() {
        // the second is twice the first, the third is nothing beside the others
        let a = vec![vec![1.0, 2.0, 0.0, 0.5], vec![0.0, 0.0, 1e-12, 3.0]];
        assert_eq!(dependent_columns(&a, &[0, 1, 2, 3], 2, 0.1), [0, 3]);
        assert_eq!(dependent_columns(&a, &[2, 1, 0, 3], 2, 0.1), [1, 3]);
        // no column twice, and no more than asked for
        assert_eq!(dependent_columns(&a, &[3, 3, 0], 2, 0.1), [3, 0]);
        assert_eq!(dependent_columns(&a, &[3, 0], 1, 0.1), [3]);
    }

    #[test]
    fn a_column_near_the_span_is_left_to_a_smaller_distance() {
        let a = vec![vec![1.0, 1.0, 0.0], vec![0.0, 0.01, 1.0]];
        assert_eq!(dependent_columns(&a, &[0, 1, 2], 2, 0.1), [0, 2]);
        assert_eq!(dependent_columns(&a, &[0, 1, 2], 2, 1e-4), [0, 1]);
    }

    #[test]
    fn a_column_s_distance_counts_as_a_part_of_its_length() {
        // both are at the same angle to the first
        let a = vec![vec![1.0, 50.0, 0.02], vec![0.0, 2.5, 0.001]];
        for column in [1, 2] {
            assert_eq!(dependent_columns(&a, &[0, column], 2, 0.1), [0]);
            assert_eq!(dependent_columns(&a, &[0, column], 2, 0.01), [0, column]);
        }
    }
}
