//! Completes measured coordinates to whole states of motion by the closure equations.

use crate::qr_update::{reduce, substitute};
use crate::turned::turn;
use regen_batch::TrajectoryClosure;
use regen_runtime::{ClosureError, Model, Outcome, SizeError, Solution, State};

/// The largest number of Gauss-Newton steps; usually two or three suffice.
pub(super) const MAX_STEPS: usize = 30;
/// A step below this, rad or m, ends the iteration: it is of the size of rounding errors.
pub(super) const STEP_TOLERANCE: f64 = 1e-13;
/// Where a limit is set, the measured coordinates count as fused if the last step was below this,
/// relative to 1 + the coordinate.
const FUSED_STEP: f64 = 1e-6;
/// The continuation steps that the states of a log may take at first: half of them reach 1250 rad from
/// home.
const FIRST_STEPS: usize = 10_000;
/// How many more they may take for each state: enough for 4 rad from one to the next; most take one step,
/// or none.
const STEPS_PER_STATE: usize = 16;
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
    pub(super) model: &'m M,
    pub(super) closure: TrajectoryClosure<'m, M>,
    pub(super) measured: Vec<usize>,
    pub(super) weights: Vec<f64>,
    /// For each independent coordinate, its index among the measured ones; `None` unless exactly
    /// the independent coordinates are measured.
    direct: Option<Vec<usize>>,
    /// The independent coordinates of the last state, rad or m.
    pub(super) last: Vec<f64>,
    /// The most continuation steps to a state; `None` without a limit.
    max_steps: Option<usize>,
    /// Whether the work of [`complete_many`](Self::complete_many) is counted, which its first call begins.
    bounded: bool,
}

/// States of motion of consecutive samples. The entries of each state are consecutive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CompletedStates {
    /// The number of coordinates of a state.
    pub coordinates: usize,
    /// All coordinates of each state, rad or m; NaN for a state that was not found.
    pub q: Vec<f64>,
    /// Their velocities, rad/s or m/s.
    pub qd: Vec<f64>,
    /// Their accelerations, rad/s^2 or m/s^2.
    pub qdd: Vec<f64>,
    /// Whether each state was found.
    pub outcomes: Vec<Completeness>,
}

impl CompletedStates {
    /// The coordinates, velocities and accelerations of one state.
    pub fn state(&self, index: usize) -> [&[f64]; 3] {
        let entries = index * self.coordinates..(index + 1) * self.coordinates;
        [&self.q, &self.qd, &self.qdd].map(|all| all.get(entries.clone()).unwrap_or_default())
    }
}

/// Whether the state of a sample was found, and if not, why.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Completeness {
    /// The state was found, with closed loops.
    Closed,
    /// The loops could not be closed there.
    Open(Outcome),
    /// The measured coordinates do not determine the state there.
    Unmeasured,
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
            closure: TrajectoryClosure::new(model)?,
            measured: measured.to_vec(),
            weights: deviations.iter().map(|d| 1.0 / d).collect(),
            direct,
            last,
            max_steps: None,
            bounded: false,
        })
    }

    /// Counts a state of [`complete`](Self::complete) as open if it takes more continuation steps than
    /// this, or if the measured coordinates are not fused: for columns that may be wrong, whose
    /// states would each cost a long search that fails.
    pub(crate) fn limited(mut self, steps: usize) -> Self {
        self.max_steps = Some(steps);
        self
    }

    /// The number of continuation steps of all states so far: the work that was done beside that of
    /// blocks of states that are near each other.
    pub fn steps_taken(&self) -> usize {
        self.closure.steps_taken()
    }

    /// The number of searches for a state that ended because others had taken too many steps.
    pub fn given_up(&self) -> usize {
        self.closure.given_up()
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
            let closure = self.closure.single()?;
            if let Some(most) = self.max_steps {
                closure.limit_steps(most);
            }
            let state = closure.track_state(&pick(q), &pick(qd), &pick(qdd))?;
            return Ok(match state.outcome {
                Outcome::Closed => Completed::State(state),
                other => Completed::Open(other),
            });
        }
        self.fuse(q, qd, qdd)
    }

    /// The states of consecutive samples, as by [`complete`](Self::complete). If the independent
    /// coordinates are measured, many states are computed at once.
    ///
    /// The work is bounded by the number of samples: where many states do not close, as with columns
    /// that are wrong, the searches for the others are short, and [`given_up`](Self::given_up) counts
    /// those that ended before they were finished.
    ///
    /// - `motion`: for each measured coordinate the series of its positions, velocities and
    ///   accelerations; `samples`: the indices into these series.
    ///
    /// # Errors
    /// As [`complete`](Self::complete).
    pub fn complete_many(
        &mut self,
        motion: &[[Vec<f64>; 3]],
        samples: &[usize],
    ) -> Result<CompletedStates, ClosureError> {
        if !self.bounded {
            self.bounded = true;
            self.closure.allow_steps(FIRST_STEPS);
        }
        self.closure.allow_steps(STEPS_PER_STATE * samples.len());
        let n = self.model.info().coordinates.len();
        let pick = |place: usize, part: usize| {
            let series = motion.get(place).map(|m| m[part].as_slice());
            let series = series.unwrap_or_default();
            let value = move |k: &usize| series.get(*k).copied().unwrap_or(f64::NAN);
            samples.iter().map(value)
        };
        let mut states = CompletedStates {
            coordinates: n,
            q: vec![f64::NAN; n * samples.len()],
            qd: vec![f64::NAN; n * samples.len()],
            qdd: vec![f64::NAN; n * samples.len()],
            outcomes: Vec::with_capacity(samples.len()),
        };
        if let Some(places) = &self.direct {
            let part = |part: usize| -> Vec<f64> {
                places.iter().flat_map(|place| pick(*place, part)).collect()
            };
            let [q, qd, qdd] = [0, 1, 2].map(part);
            let found = self.closure.track(samples.len(), &q, &qd, &qdd)?;
            for (out, series) in [
                (&mut states.q, &found.q),
                (&mut states.qd, &found.qd),
                (&mut states.qdd, &found.qdd),
            ] {
                turn(series, samples.len(), out, n);
            }
            states
                .outcomes
                .extend(found.outcomes.into_iter().map(|outcome| match outcome {
                    Outcome::Closed => Completeness::Closed,
                    other => Completeness::Open(other),
                }));
            return Ok(states);
        }
        if let Some(fused) = self.fuse_many(motion, samples)? {
            return Ok(fused);
        }
        for (at, k) in samples.iter().enumerate() {
            let row = |part: usize| -> Vec<f64> {
                let value = |m: &[Vec<f64>; 3]| m[part].get(*k).copied().unwrap_or(f64::NAN);
                motion.iter().map(value).collect()
            };
            let found = match self.complete(&row(0), &row(1), &row(2))? {
                Completed::State(state) => {
                    let entries = at * n..(at + 1) * n;
                    for (out, values) in [
                        (&mut states.q, &state.q),
                        (&mut states.qd, &state.qd),
                        (&mut states.qdd, &state.qdd),
                    ] {
                        if let Some(out) = out.get_mut(entries.clone()) {
                            out.copy_from_slice(values);
                        }
                    }
                    Completeness::Closed
                }
                Completed::Open(outcome) => Completeness::Open(outcome),
                Completed::Unmeasured => Completeness::Unmeasured,
            };
            states.outcomes.push(found);
        }
        Ok(states)
    }

    /// Follows the loops to `q_i`, with at most the rest of the steps that are allowed for a state.
    fn follow(&mut self, q_i: &[f64], taken: &mut usize) -> Result<Solution, ClosureError> {
        let left = self
            .max_steps
            .map(|most| most.saturating_sub(*taken).max(1));
        let closure = self.closure.single()?;
        if let Some(left) = left {
            closure.limit_steps(left);
        }
        let solution = closure.track(q_i)?;
        *taken += solution.steps;
        Ok(solution)
    }

    /// Finds the independent coordinates by Gauss-Newton steps, then their derivatives.
    fn fuse(&mut self, q: &[f64], qd: &[f64], qdd: &[f64]) -> Result<Completed, ClosureError> {
        let mut q_i = self.last.clone();
        let mut taken = 0;
        let mut solution = self.follow(&q_i, &mut taken)?;
        let mut moved = f64::INFINITY;
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
            solution = self.follow(&q_i, &mut taken)?;
            let sizes = step.iter().zip(&q_i);
            moved = sizes.fold(0.0, |m, (s, q)| f64::max(m, s.abs() / (1.0 + q.abs())));
            if step.iter().all(|s| s.abs() < STEP_TOLERANCE) {
                break;
            }
        }
        if !solution.outcome.is_closed() {
            return Ok(Completed::Open(solution.outcome));
        }
        if self.max_steps.is_some() && moved > FUSED_STEP {
            return Ok(Completed::Open(Outcome::NotClosed {
                at: 1.0,
                residual: solution.residual,
            }));
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
        let state = self.closure.single()?.track_state(&q_i, &qd_i, &qdd_i)?;
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

    pub(super) fn least_squares(&self, columns: &[f64], side: &[f64]) -> Option<Vec<f64>> {
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
