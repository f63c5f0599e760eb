//! Rows of a log with another motion in place of the measured one.

use super::layout::ColumnLayout;
use super::problem::DataError;
use super::reader::LogRow;
use crate::identify::MotionSeries;
use regen_runtime::{ClosureError, LoopClosure, Model, Outcome};

/// Replaces the measured motion of rows, which are passed in order of time.
pub(super) struct ReplacedRows<'a, M: ?Sized> {
    motion: &'a MotionSeries,
    closure: LoopClosure<'a, M>,
    /// The index in `motion` of the sample that was found last.
    last: Option<usize>,
}

impl<'a, M: Model<f64> + ?Sized> ReplacedRows<'a, M> {
    pub(super) fn new(model: &'a M, motion: &'a MotionSeries) -> Result<Self, DataError> {
        Ok(Self {
            motion,
            closure: LoopClosure::new(model)?,
            last: None,
        })
    }

    /// Writes the motion at the time of a row into its measured entries; returns false, with the row
    /// as it was, where the motion has no sample or its loops cannot be closed.
    pub(super) fn replace(
        &mut self,
        layout: &ColumnLayout,
        row: &mut LogRow,
    ) -> Result<bool, DataError> {
        let time = row.values.first().copied().unwrap_or(f64::NAN);
        let Some(at) = self.motion.find(self.last, time) else {
            return Ok(false);
        };
        if !self.motion.follows(at) {
            self.closure.restart();
        }
        self.last = Some(at);
        let [q_i, qd_i, qdd_i] = self.motion.state(at);
        let state = match self.closure.track_state(q_i, qd_i, qdd_i) {
            Ok(state) if state.outcome == Outcome::Closed => state,
            Err(ClosureError::Size(error)) => return Err(error.into()),
            Ok(_) | Err(_) => return Ok(false),
        };
        for (place, coordinate) in layout.measured.iter().enumerate() {
            let entries = [
                (Some(layout.positions().start + place), &state.q),
                (layout.velocities.get(place).copied().flatten(), &state.qd),
                (
                    layout.accelerations.get(place).copied().flatten(),
                    &state.qdd,
                ),
            ];
            for (entry, values) in entries {
                let entry = entry.and_then(|entry| row.values.get_mut(entry));
                if let Some((entry, value)) = entry.zip(values.get(*coordinate)) {
                    *entry = *value;
                }
            }
        }
        Ok(true)
    }
}
