//! Completes measured coordinates to whole states of motion by the closure equations.

use crate::qr_update::{reduce, substitute};
use regen_runtime::{ClosureError, LoopClosure, Model, Outcome, SizeError, State};

/// Most Gauss-Newton steps; usually two or three suffice.
const MAX_STEPS: usize = 30;
/// A step below this, rad or m, ends the iteration: rounding of angles and metres.
const STEP_TOLERANCE: f64 = 1e-13;
/// A pivot below this part of the largest means that the measured coordinates do not determine
/// the motion.
const MIN_PIVOT_RATIO: f64 = 1e-9;

/// Computes all coordinates and their derivatives from measured ones, sample by sample on one
/// assembly branch.
///
/// Measured coordinates may be the independent ones, others that determine them, or more than
/// needed. Unless they are the independent ones, they are fused by least squares, each divided by
/// its standard deviation.
#[derive(Debug)]
pub struct Completion<'m, M: ?Sized> {
    model: &'m M,
    closure: LoopClosure<'m, M>,
    measured: Vec<usize>,
    weights: Vec<f64>,
    /// For each independent coordinate, its index among the measured ones; `None` unless exactly
    /// the independent coordinates are measured.
    direct: Option<Vec<usize>>,
    /// The independent coordinates of the last state, rad or m.
    last: Vec<f64>,
}

/// Result of completing a sample.
#[derive(Clone, Debug, PartialEq)]
pub enum Completed {
    /// All coordinates, velocities and accelerations.
    State(State),
    /// The loops could not be closed there.
    Open(Outcome),
    /// The measured coordinates do not determine the state there.
    Unmeasured,
}

impl<'m, M: Model<f64> + ?Sized> Completion<'m, M> {
    /// Prepares the completion of a model's states.
    ///
    /// - `measured`: the measured coordinates, as indices into `Info::coordinates`;
    /// - `deviations`: the standard deviation of each, rad or m.
    ///
    /// # Errors
    /// When the lists differ in length, a coordinate does not exist or is given twice, fewer
    /// than the degrees of freedom are measured, or a deviation is not positive.
    pub fn new(model: &'m M, measured: &[usize], deviations: &[f64]) -> Result<Self, ClosureError> {
        let info = model.info();
        let wrong = |expected, got| {
            ClosureError::Size(SizeError {
                argument: "measured",
                expected,
                got,
            })
        };
        if measured.len() != deviations.len() {
            return Err(wrong(measured.len(), deviations.len()));
        }
        if measured.len() < info.dof() {
            return Err(wrong(info.dof(), measured.len()));
        }
        for (k, coordinate) in measured.iter().enumerate() {
            if *coordinate >= info.coordinates.len() || measured[..k].contains(coordinate) {
                return Err(ClosureError::Partition {
                    coordinate: *coordinate,
                });
            }
        }
        if let Some(index) = deviations.iter().position(|d| !(*d > 0.0 && d.is_finite())) {
            return Err(ClosureError::NotFinite {
                argument: "deviations",
                index,
            });
        }
        let place = |c: &usize| measured.iter().position(|m| m == c);
        let direct = if measured.len() == info.dof() {
            info.independent.iter().map(place).collect()
        } else {
            None
        };
        let home = info.home.to_vec();
        let last = info.independent.iter().map(|&c| home[c]).collect();
        Ok(Self {
            model,
            closure: LoopClosure::new(model)?,
            measured: measured.to_vec(),
            weights: deviations.iter().map(|d| 1.0 / d).collect(),
            direct,
            last,
        })
    }

    /// Starts from the home position again, for the next log.
    pub fn restart(&mut self) {
        self.closure.restart();
        let info = self.model.info();
        self.last = info.independent.iter().map(|&c| info.home[c]).collect();
    }

    /// Computes the state at measured positions, velocities and accelerations (rad or m, per s and
    /// per s^2), in the order of the measured coordinates, on the branch of the last state.
    ///
    /// # Errors
    /// When a length does not fit or a value is not finite.
    pub fn complete(
        &mut self,
        q: &[f64],
        qd: &[f64],
        qdd: &[f64],
    ) -> Result<Completed, ClosureError> {
        for (argument, values) in [("q", q), ("qd", qd), ("qdd", qdd)] {
            if values.len() != self.measured.len() {
                return Err(ClosureError::Size(SizeError {
                    argument,
                    expected: self.measured.len(),
                    got: values.len(),
                }));
            }
        }
        if let Some(places) = &self.direct {
            let pick = |values: &[f64]| -> Vec<f64> { places.iter().map(|&p| values[p]).collect() };
            let state = self.closure.track_state(&pick(q), &pick(qd), &pick(qdd))?;
            return Ok(match state.outcome {
                Outcome::Closed => Completed::State(state),
                other => Completed::Open(other),
            });
        }
        self.fuse(q, qd, qdd)
    }

    /// Finds the independent coordinates by Gauss-Newton steps, then their derivatives.
    fn fuse(&mut self, q: &[f64], qd: &[f64], qdd: &[f64]) -> Result<Completed, ClosureError> {
        let mut q_i = self.last.clone();
        let mut solution = self.closure.track(&q_i)?;
        for _ in 0..MAX_STEPS {
            if !solution.outcome.is_closed() {
                return Ok(Completed::Open(solution.outcome));
            }
            let columns = self.columns(&solution.q)?;
            let off: Vec<f64> = q
                .iter()
                .zip(&self.measured)
                .map(|(y, &m)| y - solution.q[m])
                .collect();
            let Some(step) = self.least_squares(&columns, &off) else {
                return Ok(Completed::Unmeasured);
            };
            for (value, step) in q_i.iter_mut().zip(&step) {
                *value += step;
            }
            solution = self.closure.track(&q_i)?;
            if step.iter().all(|s| s.abs() < STEP_TOLERANCE) {
                break;
            }
        }
        if !solution.outcome.is_closed() {
            return Ok(Completed::Open(solution.outcome));
        }
        let columns = self.columns(&solution.q)?;
        let Some(qd_i) = self.least_squares(&columns, qd) else {
            return Ok(Completed::Unmeasured);
        };
        let n = solution.q.len();
        let mut all = vec![0.0; n];
        let mut without = vec![0.0; n];
        // `track` has already checked the condition of these solves
        let _ = self.model.velocities(&solution.q, &qd_i, &mut all)?;
        let still = vec![0.0; q_i.len()];
        let _ = self
            .model
            .accelerations(&solution.q, &all, &still, &mut without)?;
        let rest: Vec<f64> = qdd
            .iter()
            .zip(&self.measured)
            .map(|(y, &m)| y - without[m])
            .collect();
        let Some(qdd_i) = self.least_squares(&columns, &rest) else {
            return Ok(Completed::Unmeasured);
        };
        let state = self.closure.track_state(&q_i, &qd_i, &qdd_i)?;
        self.last = q_i;
        Ok(match state.outcome {
            Outcome::Closed => Completed::State(state),
            other => Completed::Open(other),
        })
    }

    /// The weighted Jacobian of the measured coordinates by the independent ones, column-major.
    fn columns(&self, q: &[f64]) -> Result<Vec<f64>, ClosureError> {
        let dof = self.last.len();
        let mut out = Vec::with_capacity(dof * self.measured.len());
        let mut all = vec![0.0; q.len()];
        for k in 0..dof {
            let mut unit = vec![0.0; dof];
            unit[k] = 1.0;
            let _ = self.model.velocities(q, &unit, &mut all)?;
            let entries = self.measured.iter().zip(&self.weights);
            out.extend(entries.map(|(&m, w)| all[m] * w));
        }
        Ok(out)
    }

    fn least_squares(&self, columns: &[f64], side: &[f64]) -> Option<Vec<f64>> {
        let (dof, rows) = (self.last.len(), self.measured.len());
        let (mut r, mut z) = (vec![0.0; dof * dof], vec![0.0; dof]);
        let mut block = columns.to_vec();
        let mut side: Vec<f64> = side.iter().zip(&self.weights).map(|(y, w)| y * w).collect();
        reduce(&mut r, &mut z, &mut block, &mut side, rows);
        let pivots = (0..dof).map(|k| r[k * dof + k]);
        let largest = pivots.clone().fold(0.0, f64::max);
        if pivots.into_iter().any(|p| p <= MIN_PIVOT_RATIO * largest) {
            return None;
        }
        substitute(&r, &z)
    }
}
