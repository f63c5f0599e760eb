//! The equations of a log with instruments as additional columns.

use super::MotionSeries;
use crate::estimate::EstimateError;
use crate::identify::equation_builder::{EquationKind, Equations, StateSample};
use crate::identify::passes::Source;
use crate::identify::stream::{Columns, LeftOut, equations};
use regen_runtime::{BaseModel, ClosureError, LoopClosure, Outcome, Status};

/// The regressor at the motion of the instruments.
struct InstrumentRegressor<'a, 'm, M: ?Sized> {
    model: &'m M,
    closure: LoopClosure<'m, M>,
    motion: &'a MotionSeries,
    /// The index of the last sample in `motion`.
    last: Option<usize>,
}

impl<M: BaseModel<f64> + ?Sized> Columns for InstrumentRegressor<'_, '_, M> {
    fn count(&self) -> usize {
        self.model.base_info().base.len()
    }

    fn fill(
        &mut self,
        row: &StateSample<'_>,
        _: &[f64],
        out: &mut [f64],
    ) -> Result<bool, EstimateError> {
        let Some(at) = self.motion.find(self.last, row.time) else {
            return Ok(false);
        };
        if !self.motion.follows(at) {
            self.closure.restart();
        }
        self.last = Some(at);
        let [q_i, qd_i, qdd_i] = self.motion.state(at);
        let state = self.closure.track_state(q_i, qd_i, qdd_i);
        let state = match state {
            Ok(state) => state,
            Err(ClosureError::Size(error)) => return Err(error.into()),
            Err(_) => return Ok(false),
        };
        if state.outcome != Outcome::Closed {
            return Ok(false);
        }
        let condition = self
            .model
            .base_regressor(&state.q, &state.qd, &state.qdd, out)?;
        Ok(condition.status() != Status::Singular)
    }
}

/// The largest number of values that are stored: 64 MiB; longer logs are read again in each pass.
const MAX_NUMBERS: usize = 1 << 23;

/// A log with its instruments: equations with 2 r columns, W and then Z.
pub(super) struct Log<'a, M: ?Sized, S: ?Sized> {
    model: &'a M,
    source: &'a mut S,
    motion: MotionSeries,
    /// All samples after the first pass, unless there are too many.
    stored: Vec<Sample>,
    pub(super) left_out: LeftOut,
}

struct Sample {
    time: f64,
    w: Vec<f64>,
    tau: Vec<f64>,
    weights: Vec<f64>,
    follows: bool,
}

impl<'a, M: BaseModel<f64> + ?Sized, S: Source + ?Sized> Log<'a, M, S> {
    pub(super) fn new(model: &'a M, source: &'a mut S) -> Self {
        Self {
            model,
            source,
            motion: MotionSeries::new(model.info().dof()),
            stored: Vec::new(),
            left_out: LeftOut::default(),
        }
    }

    /// Replaces the motion from which the instruments are computed.
    pub(super) fn set_motion(&mut self, motion: MotionSeries) {
        self.motion = motion;
        self.stored.clear();
    }

    /// Passes all equations to `each`; their columns are those of W, and then those of Z.
    pub(super) fn visit(
        &mut self,
        each: &mut dyn FnMut(&Equations<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), S::Error> {
        if !self.stored.is_empty() {
            for sample in &self.stored {
                each(&Equations {
                    time: sample.time,
                    w: &sample.w,
                    tau: &sample.tau,
                    weights: &sample.weights,
                    follows: sample.follows,
                })?;
            }
            return Ok(());
        }
        let mut at = InstrumentRegressor {
            model: self.model,
            closure: LoopClosure::new(self.model).map_err(|why| match why {
                ClosureError::Size(error) => EstimateError::from(error),
                _ => EstimateError::NoConvergence,
            })?,
            motion: &self.motion,
            last: None,
        };
        let mut numbers = 0;
        let mut stored = Vec::new();
        self.left_out = equations(
            self.model,
            EquationKind::Forces,
            self.source,
            &mut at,
            &mut |rows| {
                if rows.tau.is_empty() {
                    return Ok(());
                }
                numbers += rows.w.len() + 2 * rows.tau.len();
                if numbers <= MAX_NUMBERS {
                    stored.push(Sample {
                        time: rows.time,
                        w: rows.w.to_vec(),
                        tau: rows.tau.to_vec(),
                        weights: rows.weights.to_vec(),
                        follows: rows.follows,
                    });
                }
                each(rows)
            },
        )?;
        if numbers <= MAX_NUMBERS {
            self.stored = stored;
        }
        Ok(())
    }
}
