//! The state of the instruments' motion at the time of a row.

use super::MotionSeries;
use regen_runtime::{ClosureError, LoopClosure, Model, Outcome, SizeError, State};

/// Time may differ by so many roundings, and by [`SAME_TIME`].
const ROUNDINGS: f64 = 4.0;
/// Two times are the same up to this, s, and to roundings: every pass reads the same times.
const SAME_TIME: f64 = 1e-9;

/// Finds the samples of a motion for rows that are passed in order, log after log, and closes the
/// loops there.
pub(crate) struct TrackedMotion<'m, M: ?Sized> {
    closure: LoopClosure<'m, M>,
    cursor: Cursor,
    /// The index of the sample that was found last.
    last: Option<usize>,
}

/// A state of the motion.
pub(crate) struct TrackedState {
    pub(crate) state: State,
    /// Whether the motion has no gap between this state and the one that was found before.
    pub(crate) follows: bool,
}

impl<'m, M: Model<f64> + ?Sized> TrackedMotion<'m, M> {
    pub(crate) fn new(model: &'m M) -> Result<Self, ClosureError> {
        Ok(Self {
            closure: LoopClosure::new(model)?,
            cursor: Cursor::default(),
            last: None,
        })
    }

    /// The state at a time, s; `None` where the motion has no sample or its loops do not close.
    ///
    /// # Errors
    /// When the motion is not that of the model.
    pub(crate) fn state_at(
        &mut self,
        motion: &MotionSeries,
        time: f64,
    ) -> Result<Option<TrackedState>, SizeError> {
        let Some(at) = self.cursor.find(motion.times(), time) else {
            return Ok(None);
        };
        if !motion.follows(at) {
            self.closure.restart();
        }
        let before = self.last.replace(at);
        let [q_i, qd_i, qdd_i] = motion.state(at);
        match self.closure.track_state(q_i, qd_i, qdd_i) {
            Ok(state) if state.outcome == Outcome::Closed => Ok(Some(TrackedState {
                state,
                follows: before.is_some_and(|k| k + 1 == at) && motion.follows(at),
            })),
            Err(ClosureError::Size(error)) => Err(error),
            Ok(_) | Err(_) => Ok(None),
        }
    }

    /// Begins with the first sample again.
    pub(crate) fn restart(&mut self) {
        self.cursor = Cursor::default();
        self.last = None;
        self.closure.restart();
    }
}

/// Finds times in those of several logs one after the other, of which each may begin anew.
#[derive(Clone, Copy, Debug, Default)]
struct Cursor {
    /// The index at which the search goes on.
    next: usize,
    /// The index of the first sample of the present log.
    log: usize,
    /// The time that was searched last.
    time: Option<f64>,
}

impl Cursor {
    /// The index of a time, s, after the ones that were found before; `None` if the present log lacks
    /// it. A time before the last one is of the next log.
    fn find(&mut self, times: &[f64], time: f64) -> Option<usize> {
        let same = SAME_TIME + ROUNDINGS * f64::EPSILON * time.abs();
        if self.time.is_some_and(|last| time < last - same) {
            while self.is_in_log(times) {
                self.next += 1;
            }
            self.log = self.next;
        }
        self.time = Some(time);
        while self.is_in_log(times) {
            let own = times.get(self.next)?;
            if *own > time + same {
                return None;
            }
            self.next += 1;
            if *own >= time - same {
                return Some(self.next - 1);
            }
        }
        None
    }

    /// Whether the next sample is of the present log: in a log, times increase.
    fn is_in_log(&self, times: &[f64]) -> bool {
        let before = (self.next > self.log).then(|| times.get(self.next - 1));
        match (times.get(self.next), before.flatten()) {
            (Some(next), Some(before)) => next > before,
            (next, _) => next.is_some(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(times: &[f64], rows: &[f64]) -> Vec<Option<usize>> {
        let mut cursor = Cursor::default();
        rows.iter().map(|t| cursor.find(times, *t)).collect()
    }

    #[test]
    fn rows_beyond_the_end_of_a_log_are_not_found_in_the_next_one() {
        // motions lack the first and last row of each log
        let times = [1.0, 2.0, 1.0, 2.0, 3.0, 1.0];
        let rows = [0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0, 3.0, 4.0, 0.0, 1.0, 2.0];
        assert_eq!(
            found(&times, &rows),
            [
                None,
                Some(0),
                Some(1),
                None,
                None,
                Some(2),
                Some(3),
                Some(4),
                None,
                None,
                Some(5),
                None
            ]
        );
        // only some rows of each log
        let some = [2.0, 0.0, 3.0, 1.0];
        assert_eq!(found(&times, &some), [Some(1), None, Some(4), Some(5)]);
        // logs of one clock
        let on = [1.0, 2.0, 5.0, 6.0];
        assert_eq!(
            found(&on, &[2.0, 3.0, 4.0, 5.0]),
            [Some(1), None, None, Some(2)]
        );
    }

    #[test]
    fn times_since_1970_are_told_apart_by_microseconds() {
        let times: Vec<f64> = (0..100).map(|k| 1.76e9 + 0.001 * f64::from(k)).collect();
        let rows: Vec<f64> = times.iter().skip(7).step_by(10).copied().collect();
        let expected: Vec<_> = (7..100).step_by(10).map(Some).collect();
        assert_eq!(found(&times, &rows), expected);
        assert_eq!(found(&times, &[1.76e9 + 0.0105]), [None]);
    }
}
