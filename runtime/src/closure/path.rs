//! Continuation along a straight line in the independent coordinates, on one branch.

use alloc::vec;
use alloc::vec::Vec;

use super::lu::{Lu, entry};
use super::newton::{Correction, Newton, PATH_TOLERANCE_FACTOR, largest};
use super::{ClosureError, Outcome};
use crate::{Condition, Model, Status};

/// The most that any coordinate moves in one predictor step, rad or units of length.
const MAX_PREDICTOR_MOVE: f64 = 0.25;

/// The most that the corrector may move, relative to the predictor.
const MAX_CORRECTION_RATIO: f64 = 0.25;

/// The most that A_e may change in one step, as [`Lu::distance`]: half of the distance 1 at which
/// it could be singular.
const MAX_MATRIX_CHANGE: f64 = 0.5;

/// The shortest step in the independent coordinates, relative to 1 + their size.
const MIN_RELATIVE_STEP: f64 = 1e-12;

/// Bound on the number of continuation steps, enough for a path of thousands of rad.
pub(super) const MAX_STEPS: usize = 50_000;

/// The continuation steps of a solve.
#[derive(Clone, Copy)]
pub(super) struct Steps {
    /// Their number, refused ones included.
    pub(super) taken: usize,
    /// Whether the solve ended because it would have taken more than it may.
    pub(super) cut: bool,
}

/// A closed state on the branch, with its A_e.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub(super) q: Vec<f64>,
    pub(super) condition: Condition<f64>,
    lu: Lu,
}

/// Why a continuation step was refused.
#[derive(Clone, Copy)]
enum Refusal {
    /// The corrector found no closed state; the residual where it stopped.
    NotClosed(f64),
    /// The corrector moved too far, or A_e changed too much, to be sure of the branch.
    OffBranch,
}

impl Point {
    /// Factors A_e at the closed state `q`.
    pub(super) fn new<M: Model<f64> + ?Sized>(
        newton: &mut Newton<'_, M>,
        q: Vec<f64>,
    ) -> Result<Self, ClosureError> {
        let (lu, condition) = factor_at(newton, &q)?;
        Ok(Self { q, condition, lu })
    }

    /// The worse of the model's condition and of the pivot ratio of A_e itself, since each model
    /// scales its pivots in its own manner.
    pub(super) fn worst_condition(&self) -> Condition<f64> {
        self.condition.worst(Condition {
            pivot: self.lu.ratio(),
        })
    }
}

/// Below this pivot of A_e its condition number is computed too; in the middle of a workspace that
/// would only cost time.
const SUSPECT_PIVOT: f64 = 0.1;

/// The model's condition or, where its pivot is below [`SUSPECT_PIVOT`], the reciprocal condition
/// number of A_e if that is worse: several pivots that are each only small can make a nearly
/// singular matrix, whose dependent rates are wrong.
pub(super) fn refine_condition<M: Model<f64> + ?Sized>(
    newton: &mut Newton<'_, M>,
    q: &[f64],
    condition: Condition<f64>,
) -> Result<Condition<f64>, ClosureError> {
    if newton.dependent.is_empty() || condition.pivot >= SUSPECT_PIVOT {
        return Ok(condition);
    }
    let pivot = factor_at(newton, q)?.0.reciprocal_condition();
    Ok(condition.worst(Condition { pivot }))
}

/// The factored matrix at `q`, and the model's condition.
fn factor_at<M: Model<f64> + ?Sized>(
    newton: &mut Newton<'_, M>,
    q: &[f64],
) -> Result<(Lu, Condition<f64>), ClosureError> {
    let matrix = dependent_matrix(newton, q)?;
    let condition = newton.condition(q)?;
    Ok((Lu::new(&matrix, newton.dependent.len()), condition))
}

/// A_e or, where there are redundant rows, the dependent columns of A with all rows: the rows that
/// A_e selects may lose a pivot where the mechanism has no singularity.
fn dependent_matrix<M: Model<f64> + ?Sized>(
    newton: &mut Newton<'_, M>,
    q: &[f64],
) -> Result<Vec<f64>, ClosureError> {
    if newton.redundant() {
        return Ok(newton.dependent_columns(q)?);
    }
    let mut matrix = vec![0.0; newton.dependent.len() * newton.dependent.len()];
    newton.model.dependent_jacobian(q, &mut matrix)?;
    Ok(matrix)
}

/// Follows the branch from a regular, closed point to the independent coordinates `target`.
///
/// Returns the last state on the branch, which is at `target` if the outcome is
/// [`Outcome::Closed`], and the steps taken, at most `max_steps`.
pub(super) fn follow<M: Model<f64> + ?Sized>(
    newton: &mut Newton<'_, M>,
    start: &Point,
    target: &[f64],
    max_steps: usize,
) -> Result<(Point, Outcome, Steps), ClosureError> {
    let origin: Vec<f64> = newton
        .independent
        .iter()
        .map(|at| entry(&start.q, *at))
        .collect();
    let line: Vec<f64> = target
        .iter()
        .zip(&origin)
        .map(|(to, from)| to - from)
        .collect();
    let size = 1.0 + largest(target).max(largest(&origin));
    let length = largest(&line);
    let shortest = if length > MIN_RELATIVE_STEP * size {
        MIN_RELATIVE_STEP * size / length
    } else {
        1.0
    };

    // the line needs more than the steps allowed, for instance to a measured value of 1e300
    if length > MAX_PREDICTOR_MOVE * max_steps as f64 {
        let residual = newton.residual(&start.q)?;
        let outcome = Outcome::NotClosed { at: 0.0, residual };
        let none = Steps {
            taken: 0,
            cut: true,
        };
        return Ok((start.clone(), outcome, none));
    }
    let mut point = start.clone();
    let mut done = 0.0;
    let mut proposed = 1.0;
    let mut steps = Steps {
        taken: 0,
        cut: false,
    };
    while done < 1.0 {
        let mut tangent = vec![0.0; point.q.len()];
        let Newton {
            model, independent, ..
        } = newton;
        let _ = model.velocities(&point.q, independent, &line, &mut tangent)?;
        let speed = largest(&tangent);
        let mut part =
            f64::min(proposed, MAX_PREDICTOR_MOVE / speed.max(MAX_PREDICTOR_MOVE)).min(1.0 - done);
        // a remainder shorter than the shortest step is taken in this step
        if 1.0 - done - part < shortest {
            part = 1.0 - done;
        }
        let last = part >= 1.0 - done;
        let to = if last {
            target.to_vec()
        } else {
            let at = done + part;
            origin.iter().zip(&line).map(|(x, d)| x + at * d).collect()
        };
        match step(newton, &point, &tangent, part, &to)? {
            Ok((next, change)) => {
                done = if last { 1.0 } else { done + part };
                point = next;
                proposed = if change < 0.5 * MAX_MATRIX_CHANGE {
                    2.0 * part
                } else {
                    part
                };
                let condition = point.worst_condition();
                if condition.status() == Status::Singular {
                    return Ok((
                        point,
                        Outcome::Singular {
                            at: done,
                            condition,
                        },
                        steps,
                    ));
                }
            }
            Err(refusal) => {
                proposed = 0.5 * part;
                if proposed < shortest {
                    let outcome = failed_outcome(&point, refusal, done);
                    return Ok((point, outcome, steps));
                }
            }
        }
        steps.taken += 1;
        if steps.taken >= max_steps && done < 1.0 {
            steps.cut = true;
            let residual = newton.residual(&point.q)?;
            return Ok((point, Outcome::NotClosed { at: done, residual }, steps));
        }
    }
    Ok((point, Outcome::Closed, steps))
}

/// The outcome where even the shortest step from `point` is refused.
fn failed_outcome(point: &Point, refusal: Refusal, at: f64) -> Outcome {
    let condition = point.worst_condition();
    // At a fold the pivot falls as the square root of the distance, which MIN_RELATIVE_STEP bounds.
    if condition.status() != Status::Regular {
        return Outcome::Singular { at, condition };
    }
    match refusal {
        Refusal::NotClosed(residual) => Outcome::NotClosed { at, residual },
        Refusal::OffBranch => Outcome::BranchLost { at },
    }
}

/// One step to the independent coordinates `to`: predictor along the tangent, corrector, and the
/// checks that the new state is on the branch. Returns the new state and how far A_e changed.
fn step<M: Model<f64> + ?Sized>(
    newton: &mut Newton<'_, M>,
    point: &Point,
    tangent: &[f64],
    part: f64,
    to: &[f64],
) -> Result<Result<(Point, f64), Refusal>, ClosureError> {
    let mut q = point.q.clone();
    for (q, tangent) in q.iter_mut().zip(tangent) {
        *q += part * tangent;
    }
    for (at, x) in newton.independent.iter().zip(to) {
        if let Some(q) = q.get_mut(*at) {
            *q = *x;
        }
    }
    let reach = MAX_CORRECTION_RATIO * part * largest(tangent);
    match newton.correct(&mut q, reach)? {
        Correction::Converged => {}
        Correction::Refused => return Ok(Err(Refusal::OffBranch)),
        Correction::Failed => {
            return Ok(Err(Refusal::NotClosed(newton.residual(&q)?)));
        }
    }
    let residual = newton.residual(&q)?;
    let matrix = dependent_matrix(newton, &q)?;
    let change = point.lu.distance(&matrix);
    let (lu, condition) = (
        Lu::new(&matrix, newton.dependent.len()),
        newton.condition(&q)?,
    );
    // The least-squares steps may end at a minimum where redundant rows are not closed.
    let closes = !newton.redundant() || residual <= PATH_TOLERANCE_FACTOR * newton.tolerance(&q)?;
    if !(residual.is_finite() && closes) {
        return Ok(Err(Refusal::NotClosed(residual)));
    }
    // the comparison is false for NaN
    let near = change <= MAX_MATRIX_CHANGE;
    if !near {
        return Ok(Err(Refusal::OffBranch));
    }
    Ok(Ok((Point { q, condition, lu }, change)))
}
