//! The instruments as columns beside those of the regressor.

use std::rc::Rc;

use crate::estimate::EstimateError;
use crate::identify::stream::Columns;
use crate::states::MotionSeries;
use crate::states::StateSample;
use crate::states::TrackedMotion;
use regen_runtime::{BaseModel, ClosureError, Status};

/// The regressor at the motion of the instruments.
pub(crate) struct InstrumentRegressor<'m, M: ?Sized> {
    model: &'m M,
    tracked: TrackedMotion<'m, M>,
    motion: Rc<MotionSeries>,
    /// The positions at the sample that was filled last, of all coordinates.
    q: Vec<f64>,
}

impl<'m, M: BaseModel<f64> + ?Sized> InstrumentRegressor<'m, M> {
    pub(crate) fn new(model: &'m M, motion: Rc<MotionSeries>) -> Result<Self, EstimateError> {
        let tracked = TrackedMotion::new(model).map_err(|why| match why {
            ClosureError::Size(error) => EstimateError::from(error),
            _ => EstimateError::NoConvergence,
        })?;
        Ok(Self {
            model,
            tracked,
            motion,
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
        let Some(found) = self.tracked.state_at(&self.motion, row.time)? else {
            return Ok(false);
        };
        let state = found.state;
        let condition = self
            .model
            .base_regressor(&state.q, &state.qd, &state.qdd, out)?;
        self.q = state.q;
        Ok(condition.status() != Status::Singular)
    }

    fn restart(&mut self) {
        self.tracked.restart();
    }
}
