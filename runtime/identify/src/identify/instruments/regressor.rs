//! The instruments as columns beside those of the regressor.

use super::MotionSeries;
use crate::estimate::EstimateError;
use crate::identify::equation_builder::StateSample;
use crate::identify::stream::Columns;
use regen_runtime::{BaseModel, ClosureError, LoopClosure, Outcome, Status};

/// The regressor at the motion of the instruments.
pub(crate) struct InstrumentRegressor<'m, M: ?Sized> {
    model: &'m M,
    closure: LoopClosure<'m, M>,
    motion: MotionSeries,
    /// The index of the last sample in `motion`.
    last: Option<usize>,
    /// The positions at that sample, of all coordinates.
    q: Vec<f64>,
}

impl<'m, M: BaseModel<f64> + ?Sized> InstrumentRegressor<'m, M> {
    pub(crate) fn new(model: &'m M, motion: MotionSeries) -> Result<Self, EstimateError> {
        let closure = LoopClosure::new(model).map_err(|why| match why {
            ClosureError::Size(error) => EstimateError::from(error),
            _ => EstimateError::NoConvergence,
        })?;
        Ok(Self {
            model,
            closure,
            motion,
            last: None,
            q: Vec::new(),
        })
    }

    /// The positions of all coordinates at the sample that was filled last.
    pub(crate) fn positions(&self) -> &[f64] {
        &self.q
    }
}

impl<M: BaseModel<f64> + ?Sized> Columns for InstrumentRegressor<'_, M> {
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
        self.q = state.q;
        Ok(condition.status() != Status::Singular)
    }

    fn restart(&mut self) {
        self.last = None;
        self.closure.restart();
    }
}
