//! Continuation along a straight line in the independent coordinates, on one branch.

use alloc::vec;
use alloc::vec::Vec;

use super::lu::{Lu, entry};
use super::newton::{Correction, NEARLY, Newton, largest};
use super::{ClosureError, Outcome};
use crate::{Condition, Model, Status};

/// The most that any coordinate moves in one step, rad or units of length.
const LONGEST: f64 = 0.25;

/// The corrector's move, relative to the predictor's.
const CORRECTION: f64 = 0.25;

/// How far A_e may change in one step, see [`Lu::distance`]: half of what could be singular.
const CHANGE: f64 = 0.5;

/// The shortest step, in the independent coordinates relative to 1 + their size.
const SHORTEST: f64 = 1e-12;

/// Enough for a path of thousands of rad.
const MOST_STEPS: usize = 50_000;

/// A state on the branch, with its A_e.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub(super) q: Vec<f64>,
    pub(super) condition: Condition<f64>,
    lu: Lu,
}

/// Why a step was not taken.
#[derive(Clone, Copy)]
enum Refusal {
    /// The corrector's reason, with the residual where it stopped.
    NotClosed(f64),
    /// The corrector moved far, or A_e changed much.
    OffBranch,
}

impl Point {
    /// The state `q` with its A_e.
    pub(super) fn new<M: Model<f64> + ?Sized>(
        newton: &mut Newton<'_, M>,
        q: Vec<f64>,
    ) -> Result<Self, ClosureError> {
        let (lu, condition) = factored(newton, &q)?;
        Ok(Self { q, condition, lu })
    }

    /// The model's condition, or the pivots of A_e as they are if those are worse: what a
    /// model scales its pivots by is its own choice.
    pub(super) fn worst(&self) -> Condition<f64> {
        self.condition.worst(Condition {
            pivot: self.lu.ratio(),
        })
    }
}

/// Below this pivot the condition is looked at more closely: in the middle of a workspace it is
/// not worth its time.
const DOUBTFUL: f64 = 0.1;

/// The model's condition and, where its pivot is doubtful, the condition number of A_e if that is
/// worse: several pivots that are only small may make a matrix that is nearly singular, where
/// rates are not those of the independent coordinates any more.
pub(super) fn doubted<M: Model<f64> + ?Sized>(
    newton: &mut Newton<'_, M>,
    q: &[f64],
    condition: Condition<f64>,
) -> Result<Condition<f64>, ClosureError> {
    if newton.dependent.is_empty() || condition.pivot >= DOUBTFUL {
        return Ok(condition);
    }
    let pivot = factored(newton, q)?.0.reciprocal_condition();
    Ok(condition.worst(Condition { pivot }))
}

/// The factored rows at `q`, and the model's condition there.
fn factored<M: Model<f64> + ?Sized>(
    newton: &mut Newton<'_, M>,
    q: &[f64],
) -> Result<(Lu, Condition<f64>), ClosureError> {
    let matrix = compared(newton, q)?;
    let condition = newton.condition(q)?;
    Ok((Lu::new(&matrix, newton.dependent.len()), condition))
}

/// A_e, or all rows of A in the dependent columns where there are redundant ones: each of A_e's
/// rows may lose its pivot while the mechanism has no singularity.
fn compared<M: Model<f64> + ?Sized>(
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
/// [`Outcome::Closed`], and the number of steps taken.
pub(super) fn follow<M: Model<f64> + ?Sized>(
    newton: &mut Newton<'_, M>,
    start: &Point,
    target: &[f64],
) -> Result<(Point, Outcome, usize), ClosureError> {
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
    let shortest = if length > SHORTEST * size {
        SHORTEST * size / length
    } else {
        1.0
    };

    // that far is more steps than are taken: a measured value of 1e300 need not try them
    if length > LONGEST * MOST_STEPS as f64 {
        let residual = newton.residual(&start.q)?;
        let outcome = Outcome::NotClosed { at: 0.0, residual };
        return Ok((start.clone(), outcome, 0));
    }
    let mut point = start.clone();
    let mut done = 0.0;
    let mut wish = 1.0;
    let mut steps = 0;
    while done < 1.0 {
        let mut tangent = vec![0.0; point.q.len()];
        let Newton {
            model, independent, ..
        } = newton;
        let _ = model.velocities(&point.q, independent, &line, &mut tangent)?;
        let speed = largest(&tangent);
        let mut part = f64::min(wish, LONGEST / speed.max(LONGEST)).min(1.0 - done);
        // A rest shorter than the shortest step would not be seen by the corrector.
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
                wish = if change < 0.5 * CHANGE {
                    2.0 * part
                } else {
                    part
                };
                let condition = point.worst();
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
                wish = 0.5 * part;
                if wish < shortest {
                    let outcome = refused(&point, refusal, done);
                    return Ok((point, outcome, steps));
                }
            }
        }
        steps += 1;
        if steps == MOST_STEPS {
            let residual = newton.residual(&point.q)?;
            return Ok((point, Outcome::NotClosed { at: done, residual }, steps));
        }
    }
    Ok((point, Outcome::Closed, steps))
}

/// What it means that no step from here is short enough.
fn refused(point: &Point, refusal: Refusal, at: f64) -> Outcome {
    let condition = point.worst();
    // At a fold the pivot falls as the square root of the distance, which SHORTEST bounds.
    if condition.status() != Status::Regular {
        return Outcome::Singular { at, condition };
    }
    match refusal {
        Refusal::NotClosed(residual) => Outcome::NotClosed { at, residual },
        Refusal::OffBranch => Outcome::BranchLost { at },
    }
}

/// One step to the independent coordinates `to`: predictor along the tangent, corrector, and
/// the checks that it is on the branch. Returns the new point and how far A_e changed.
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
    let reach = CORRECTION * part * largest(tangent);
    match newton.correct(&mut q, reach)? {
        Correction::Converged => {}
        Correction::Refused => return Ok(Err(Refusal::OffBranch)),
        Correction::Failed => {
            return Ok(Err(Refusal::NotClosed(newton.residual(&q)?)));
        }
    }
    let residual = newton.residual(&q)?;
    let matrix = compared(newton, &q)?;
    let change = point.lu.distance(&matrix);
    let (lu, condition) = (
        Lu::new(&matrix, newton.dependent.len()),
        newton.condition(&q)?,
    );
    // Steps may end without closing redundant rows, where least squares have a minimum.
    let closes = !newton.redundant() || residual <= NEARLY * newton.tolerance(&q)?;
    if !(residual.is_finite() && closes) {
        return Ok(Err(Refusal::NotClosed(residual)));
    }
    // NaN is no small change.
    let near = change <= CHANGE;
    if !near {
        return Ok(Err(Refusal::OffBranch));
    }
    Ok(Ok((Point { q, condition, lu }, change)))
}
