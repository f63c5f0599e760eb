//! Numerical closure of the mechanism at home, and its mobility there.

use std::fmt;

use crate::model::Model;
use crate::numeric::{rank_and_columns, solve_pivoted};
use crate::sym::Graph;
use crate::sym::eval::Evaluator;

use super::gap::{Gap, gaps};
use super::rows::Equations;
use super::search::{branch_of_home, closed_states_near};
use super::singular::check_regular;
use super::units::Units;

/// Largest residual of a closed mechanism, in the mechanism's units.
const CLOSURE_TOLERANCE: f64 = 1e-12;
/// Pivots below this fraction of the largest count as zero in a rank.
const RANK_TOLERANCE: f64 = 1e-8;
/// Distances from the span of the columns chosen before, as fractions of a column's norm, at which
/// a column is accepted as independent; the largest that yields enough columns is used.
const SPAN_DISTANCES: [f64; 4] = [0.1, 0.01, 1e-4, RANK_TOLERANCE];
/// Largest entries of A, in the mechanism's units, that count as rounding errors.
const MAX_ROUNDING: f64 = 1e-13;
/// Largest number of steps of Newton's method.
const MAX_NEWTON_STEPS: usize = 100;
/// Largest change of a coordinate in a step, rad or units of length, so that the iteration stays on
/// the branch on which it started.
const MAX_STEP: f64 = 0.5;
/// How often a step is halved if the residual would grow.
const MAX_HALVINGS: usize = 12;
/// Largest residual of loops that were closed over all coordinates to find the mobility.
const MOBILITY_TOLERANCE: f64 = 1e-9;

/// The reason why a mechanism has no usable home.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum HomeProblem {
    /// The loops cannot be closed from the stated home.
    NotClosed {
        /// The largest residual at the end of the iteration, m or rad.
        residual: f64,
        /// The gaps of the open cuts there, the widest first.
        gaps: Vec<Gap>,
        /// Closed states with home's independent coordinates, the closest to home first: one value
        /// per coordinate, rad or m. If there is none, a state with other independent coordinates,
        /// if one was found.
        near: Vec<Vec<f64>>,
    },
    /// The number of independent coordinates is not the mobility.
    Mobility {
        /// Degrees of freedom at home.
        mobility: usize,
        /// A valid choice of independent coordinates.
        choice: Vec<usize>,
        /// The reason why the given choice is not valid.
        mismatch: Mismatch,
    },
    /// The number of independent coordinates is the mobility, but the dependent coordinates do not
    /// follow from them.
    NotIndependent {
        /// A valid choice of independent coordinates.
        choice: Vec<usize>,
        /// The reason why the given choice is not valid.
        mismatch: Mismatch,
    },
    /// Home is singular: the mechanism has fewer degrees of freedom at all closed states beside it.
    Singular {
        /// Degrees of freedom at home, to first order.
        mobility: usize,
        /// Degrees of freedom beside home.
        beside: usize,
        /// A home that was tried: it closes, and is regular.
        remedy: Option<RegularHome>,
    },
}

/// A home from which the loops close at a regular state.
#[derive(Clone, Debug, PartialEq)]
pub struct RegularHome {
    /// The home, rad or m, by coordinate: only the values that need to be given differ from those of
    /// the spec.
    pub home: Vec<f64>,
    /// The closed state, rad or m, by coordinate.
    pub closed: Vec<f64>,
    /// The independent coordinates with which it was tried.
    pub independent: Vec<usize>,
}

/// How independent coordinates fail to determine the rates of the others at home.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Mismatch {
    /// The dependent coordinates that can move while the independent ones are at rest.
    pub free: Vec<usize>,
    /// The independent coordinates whose rates cannot be chosen independently of each other.
    pub tied: Vec<usize>,
}

impl fmt::Display for HomeProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotClosed { residual, .. } => write!(
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
            Self::Singular {
                mobility, beside, ..
            } => write!(
                f,
                "home is singular: the mechanism has {mobility} degrees of freedom there, and {beside} \
                 beside it"
            ),
        }
    }
}

impl std::error::Error for HomeProblem {}

/// Evaluates f and A (Eq. 6-7) numerically, over all rows and coordinates.
#[derive(Debug)]
pub struct NumericLoops<'g> {
    evaluator: Evaluator<'g>,
    rows: usize,
    coordinates: usize,
    /// Row and column of each entry of A that is not identically zero.
    filled: Vec<(usize, usize)>,
    units: Units,
}

impl<'g> NumericLoops<'g> {
    /// Prepares the evaluation of the equations in the world frame; rows behind those of the model, such as
    /// [`half_turns`](super::half_turns), are numbers without a unit. The coordinates must be the graph's first
    /// symbols, in order.
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

    /// f and A at `q`, scaled to the mechanism's units; `q` is in the spec's units.
    pub fn normal(&self, q: &[f64]) -> (Vec<f64>, Vec<Vec<f64>>) {
        let (mut f, mut a) = self.at(q);
        for (f, unit) in f.iter_mut().zip(&self.units.rows) {
            *f /= unit;
        }
        for &(i, c) in &self.filled {
            let unit = self.units.rows.get(i).copied().unwrap_or(1.0);
            a[i][c] *= self.units.coordinates[c] / unit;
        }
        (f, a)
    }

    /// f and A at `q`, in the spec's units.
    pub fn at(&self, q: &[f64]) -> (Vec<f64>, Vec<Vec<f64>>) {
        let mut values = self.evaluator.run(q);
        let entries = values.split_off(self.rows);
        let mut a = vec![vec![0.0; self.coordinates]; self.rows];
        for (&(i, c), entry) in self.filled.iter().zip(entries) {
            a[i][c] = entry;
        }
        (values, a)
    }

    /// Closes the loops by Newton's method over the coordinates in `free`, with shorter steps if
    /// the residual would grow. Returns the largest remaining residual, in the mechanism's units,
    /// and the pivot ratio of the last step.
    pub fn close(&self, q: &mut Vec<f64>, free: &[usize]) -> (f64, f64) {
        let (mut f, mut a) = self.normal(q);
        let mut ratio = 1.0;
        for _ in 0..MAX_NEWTON_STEPS {
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
            let size = solved
                .solution
                .iter()
                .fold(0.0_f64, |m, x| m.max(x[0].abs()));
            let mut scale = (MAX_STEP / size).min(1.0);
            let mut better = None;
            for _ in 0..MAX_HALVINGS {
                let mut next = q.clone();
                for (c, step) in free.iter().zip(&solved.solution) {
                    next[*c] += scale * step[0] * self.units.coordinates[*c];
                }
                let (nf, na) = self.normal(&next);
                let after = largest(&nf);
                // close to the solution, a full step may change nothing but rounding errors
                if after < before || (before < CLOSURE_TOLERANCE && after <= 2.0 * before) {
                    better = Some((next, nf, na, after));
                    break;
                }
                scale *= 0.5;
            }
            let Some((next, nf, na, after)) = better else {
                break;
            };
            let done = before < CLOSURE_TOLERANCE && after >= before;
            (*q, f, a) = (next, nf, na);
            if done {
                break;
            }
        }
        (largest(&f), ratio)
    }
}

/// The given columns of a matrix.
pub(super) fn select<T: Copy>(a: &[Vec<T>], columns: &[usize]) -> Vec<Vec<T>> {
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

/// The home configuration with closed loops; the independent coordinates keep their values.
///
/// If Newton's method from home does not close the loops, closed states are searched from many
/// starts. One of them is used only if home indicates it clearly: each dependent coordinate is within
/// 0.5 (rad, or the mechanism's units of length) of home and has its sign, and no other state is
/// within 1 in all coordinates. Otherwise the states are part of the error.
///
/// # Errors
/// If the loops do not close, or the independent coordinates do not fit the mobility, or home is
/// singular.
pub fn close_home(loops: &NumericLoops<'_>, model: &Model) -> Result<Vec<f64>, HomeProblem> {
    close_from_home(loops, model, &|q| {
        let fitting = fits_mobility(loops, model, q);
        check_regular(loops, model, q, fitting.is_ok())?;
        fitting
    })
}

/// As [`close_home`], with what a closed state must pass.
pub(super) fn close_from_home(
    loops: &NumericLoops<'_>,
    model: &Model,
    check: &dyn Fn(&[f64]) -> Result<(), HomeProblem>,
) -> Result<Vec<f64>, HomeProblem> {
    let start: Vec<f64> = model.home.iter().map(crate::sym::Number::to_f64).collect();
    let size = 1.0 + largest(&loops.normal(&start).0);
    let mut q = start.clone();
    let (open, _) = loops.close(&mut q, &model.dependent);
    if open <= CLOSURE_TOLERANCE * size {
        check(&q)?;
        return Ok(q);
    }
    let mut near = closed_states_near(loops, model);
    if let Some(branch) = branch_of_home(loops, model, &near) {
        check(&branch)?;
        return Ok(branch);
    }
    // the choice of independent coordinates may be wrong: close over all coordinates and check the
    // mobility there
    let mut all = start;
    let every = (0..model.coordinates.len()).collect::<Vec<_>>();
    let (any_residual, _) = close_least(loops, &mut all, &every);
    if any_residual <= MOBILITY_TOLERANCE * size {
        match check(&all) {
            // it is not home that is singular: what counts is the mobility beside this state
            Err(HomeProblem::Singular { beside, remedy, .. }) => {
                let choice = remedy.map(|home| home.independent);
                if let Some(choice) = choice.filter(|choice| *choice != model.independent) {
                    return Err(HomeProblem::Mobility {
                        mobility: beside,
                        choice,
                        mismatch: Mismatch::default(),
                    });
                }
            }
            other => other?,
        }
        if near.is_empty() {
            near.push(all);
        }
    }
    // the reported residual is in the spec's units
    let residual = largest(&loops.at(&q).0);
    Err(HomeProblem::NotClosed {
        residual,
        gaps: gaps(loops, model, &q),
        near,
    })
}

/// Newton's method with more unknowns than equations: the pivot columns are chosen anew up to four
/// times.
pub(super) fn close_least(
    loops: &NumericLoops<'_>,
    q: &mut Vec<f64>,
    free: &[usize],
) -> (f64, f64) {
    let mut last = (f64::INFINITY, 0.0);
    for _ in 0..4 {
        let (_, a) = loops.normal(q);
        let (rank, columns) = rank_and_columns(select(&a, free), RANK_TOLERANCE);
        if rank == 0 {
            break;
        }
        let chosen: Vec<usize> = columns.iter().map(|&c| free[c]).collect();
        last = loops.close(q, &chosen);
        if last.0 <= CLOSURE_TOLERANCE {
            break;
        }
    }
    last
}

/// The rows of a cut that always holds are rounding errors and add no rank.
pub(super) fn without_rounding(mut a: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    if a.iter().flatten().all(|x| x.abs() < MAX_ROUNDING) {
        for row in &mut a {
            row.fill(0.0);
        }
    }
    a
}

/// Whether the independent coordinates fit the mobility at a closed state.
///
/// # Errors
/// [`HomeProblem::Mobility`] or [`HomeProblem::NotIndependent`].
pub(super) fn fits_mobility(
    loops: &NumericLoops<'_>,
    model: &Model,
    q: &[f64],
) -> Result<(), HomeProblem> {
    let a = without_rounding(loops.normal(q).1);
    let n = model.coordinates.len();
    let (rank, _) = rank_and_columns(a.clone(), RANK_TOLERANCE);
    let mobility = n - rank;
    if mobility != model.independent.len() {
        let choice = valid_choice(&a, model, rank);
        let mismatch = mismatch(&a, model);
        return Err(HomeProblem::Mobility {
            mobility,
            choice,
            mismatch,
        });
    }
    let (dependent_rank, _) = rank_and_columns(select(&a, &model.dependent), RANK_TOLERANCE);
    if dependent_rank < model.dependent.len() {
        let choice = valid_choice(&a, model, rank);
        let mismatch = mismatch(&a, model);
        return Err(HomeProblem::NotIndependent { choice, mismatch });
    }
    Ok(())
}

/// Which dependent coordinates the independent ones do not determine, and which independent ones
/// are not free.
fn mismatch(a: &[Vec<f64>], model: &Model) -> Mismatch {
    let a_e = select(a, &model.dependent);
    let (rank, _) = rank_and_columns(a_e.clone(), RANK_TOLERANCE);
    // a rate is determined if the row that holds it fast adds nothing to the rows of A_e
    let is_free = |k: usize| {
        let mut held = a_e.clone();
        let mut row = vec![0.0; model.dependent.len()];
        row[k] = 1.0;
        held.push(row);
        rank_and_columns(held, RANK_TOLERANCE).0 > rank
    };
    // a rate can be chosen if the rows can follow it alone: if its column is in the span of A_e
    let is_tied = |c: usize| {
        let mut with = a_e.clone();
        for (row, full) in with.iter_mut().zip(a) {
            row.push(full[c]);
        }
        rank_and_columns(with, RANK_TOLERANCE).0 > rank
    };
    let places = 0..model.dependent.len();
    let free = places.filter(|k| is_free(*k)).map(|k| model.dependent[k]);
    let tied = model.independent.iter().copied().filter(|c| is_tied(*c));
    Mismatch {
        free: free.collect(),
        tied: tied.collect(),
    }
}

/// A valid choice of independent coordinates, actuated ones if possible.
pub(super) fn valid_choice(a: &[Vec<f64>], model: &Model, rank: usize) -> Vec<usize> {
    let n = model.coordinates.len();
    // prefer coupled coordinates as dependent ones: they are dependent in any case
    let keys = model.couplings.iter().map(|c| c.key);
    let mut order: Vec<usize> = keys.filter(|c| !model.drives.contains(c)).collect();
    // then passive ones, the later first: they are more often the passive end of a chain
    let passive = (0..n).rev().filter(|c| !model.actuated.contains(c));
    order.extend(passive.chain(model.actuated.iter().rev().copied()));
    // take the best-conditioned choice that is complete
    let chosen = SPAN_DISTANCES.map(|apart| dependent_columns(a, &order, rank, apart));
    let full = chosen.iter().find(|d| d.len() == rank);
    let dependent = full.unwrap_or(&chosen[SPAN_DISTANCES.len() - 1]);
    (0..n).filter(|c| !dependent.contains(c)).collect()
}

/// At most `rank` linearly independent columns, taken in a given order: the part of a column that
/// is orthogonal to those before must exceed `apart` times the column's norm.
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
        // the comparison is also false for NaN
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
        // the second column is twice the first, the third is negligible beside the others
        let a = vec![vec![1.0, 2.0, 0.0, 0.5], vec![0.0, 0.0, 1e-12, 3.0]];
        assert_eq!(dependent_columns(&a, &[0, 1, 2, 3], 2, 0.1), [0, 3]);
        assert_eq!(dependent_columns(&a, &[2, 1, 0, 3], 2, 0.1), [1, 3]);
        // no column is chosen twice, and no more than `rank` are chosen
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
        // both columns are at the same angle to the first
        let a = vec![vec![1.0, 50.0, 0.02], vec![0.0, 2.5, 0.001]];
        for column in [1, 2] {
            assert_eq!(dependent_columns(&a, &[0, column], 2, 0.1), [0]);
            assert_eq!(dependent_columns(&a, &[0, column], 2, 0.01), [0, column]);
        }
    }
}
