//! Rows of a log with another motion in place of the measured one.

use super::layout::ColumnLayout;
use super::problem::DataError;
use super::reader::LogRow;
use crate::states::{MotionSeries, TrackedMotion};
use regen_runtime::Model;

/// Replaces the measured motion of rows, which are passed in order of time, log after log.
pub(super) struct ReplacedRows<'a, M: ?Sized> {
    motion: &'a MotionSeries,
    tracked: TrackedMotion<'a, M>,
}

impl<'a, M: Model<f64> + ?Sized> ReplacedRows<'a, M> {
    pub(super) fn new(model: &'a M, motion: &'a MotionSeries) -> Result<Self, DataError> {
        Ok(Self {
            motion,
            tracked: TrackedMotion::new(model)?,
        })
    }

    /// Writes the motion at the time of a row into its measured entries; returns whether it has no gap
    /// since the row before, or `None`, with the row as it was, where it has no state at this time.
    pub(super) fn replace(
        &mut self,
        layout: &ColumnLayout,
        row: &mut LogRow,
    ) -> Result<Option<bool>, DataError> {
        let time = row.values.first().copied().unwrap_or(f64::NAN);
        let Some(found) = self.tracked.state_at(self.motion, time)? else {
            return Ok(None);
        };
        let state = &found.state;
        for (place, coordinate) in layout.measured.iter().enumerate() {
            let derivative = |of: &[Option<usize>]| of.get(place).copied().flatten();
            let entries = [
                (Some(layout.positions().start + place), &state.q),
                (derivative(&layout.velocities), &state.qd),
                (derivative(&layout.accelerations), &state.qdd),
            ];
            for (entry, values) in entries {
                let entry = entry.and_then(|entry| row.values.get_mut(entry));
                if let Some((entry, value)) = entry.zip(values.get(*coordinate)) {
                    *entry = *value;
                }
            }
        }
        Ok(Some(found.follows))
    }
}
