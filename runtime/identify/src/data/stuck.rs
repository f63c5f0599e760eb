//! Finds the resolution of encoders, and the rows in which an encoder was stuck.
//!
//! A position that repeats exactly is not a fault in itself: robots rest, and stiction stops a slow
//! motion within a row. It is a fault if the position then jumps by the motion of the meantime, or
//! if a fast motion ends within a row and the position never changes again.

/// Least number of consecutive rows with exactly the same position.
const MIN_REPEATED_ROWS: usize = 8;
/// The same if the position repeats up to the end of the log or to a gap.
const MIN_REPEATED_ROWS_AT_END: usize = 32;
/// Number of changes before the repeated rows from which the speed there is computed.
const SPEED_CHANGES: usize = 4;
/// At this ratio or above, the motion was not braked before the position began to repeat. The ratio
/// is the next change, extrapolated linearly from the last ones, over their mean. It is 1 at
/// constant speed, and 0 for a joint that is about to come to rest.
const MIN_UNBRAKED_RATIO: f64 = 0.5;
/// A joint at this speed or above is not stopped by friction within a row. The speed is the change
/// per row, as a multiple of the median change.
const MIN_SPEED_CHANGES: f64 = 0.5;
/// The same speed as a multiple of the encoder's step.
const MIN_SPEED_STEPS: f64 = 4.0;
/// An encoder that was stuck jumps by more than this multiple of the median change, and of the
/// encoder's step, when it works again. A coarse encoder in slow motion also repeats values, but
/// jumps by one step only.
const MIN_JUMP: f64 = 8.0;
/// Such a jump also exceeds this multiple of the change in the next row: it is the motion of
/// several rows. A joint that starts from rest moves further in the next row than in the first.
const MIN_JUMP_RATIO: f64 = 4.0;
/// The largest number of changes that are stored for the statistics.
const MAX_CHANGES: usize = 4001;
/// The largest number of stretches of repeated rows that are stored until the median change is
/// known, at the end of the file.
const MAX_STRETCHES: usize = 4096;
/// A change up to this fraction of the position is rounding of the printed number, not motion.
const RELATIVE_ROUNDING: f64 = 1e-10;
/// Changes that differ by at most this fraction count as equal.
const RELATIVE_TOLERANCE: f64 = 1e-3;
/// Number of equal changes whose size counts as the encoder's step.
const MIN_EQUAL_CHANGES: usize = 5;
/// How far a change may be from a whole number of steps, in steps, since files contain rounded
/// decimals.
const WHOLE_STEP_TOLERANCE: f64 = 0.1;
/// The quantile of the changes up to which they count as regular. It is also the least fraction of
/// changes that must be whole multiples of the encoder's step.
const REGULAR_QUANTILE: f64 = 0.9;
/// The median of the differences of second order of white noise, over its standard deviation: sqrt(6) times that of
/// the absolute value of a normal variable.
const BEND_OF_NOISE: f64 = 1.652;

/// Sizes of the changes of a position between rows, rad or m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct PositionChanges {
    /// The encoder's step (resolution): the smallest frequent change, if nearly all changes are
    /// multiples of it; else 0.
    pub(super) encoder: f64,
    /// The 0.9-quantile of the changes.
    pub(super) regular: f64,
    /// The median of the changes, without those that are 0 or rounding.
    usual: f64,
    /// The standard deviation of noise with the differences of second order of the position.
    pub(super) noise: f64,
}

impl PositionChanges {
    /// The statistics of the absolute values of changes, none of them 0, and of those of their differences.
    fn of(changes: &[f64], bends: &[f64]) -> Self {
        let mut sorted = changes.to_vec();
        sorted.sort_by(f64::total_cmp);
        let repeats = |k: &usize| {
            sorted[k + MIN_EQUAL_CHANGES - 1] <= sorted[*k] * (1.0 + RELATIVE_TOLERANCE)
        };
        let encoder = (0..(sorted.len() + 1).saturating_sub(MIN_EQUAL_CHANGES)).find(repeats);
        // a periodic motion repeats its changes too, but they are not multiples of one step
        let encoder = encoder.filter(|k| counted(&sorted, sorted[*k]));
        #[allow(clippy::cast_sign_loss, reason = "a part of a length")]
        let regular = (REGULAR_QUANTILE * sorted.len() as f64) as usize;
        Self {
            encoder: encoder.map_or(0.0, |k| sorted[k]),
            regular: sorted.get(regular).copied().unwrap_or(0.0),
            usual: if sorted.is_empty() {
                0.0
            } else {
                super::problem::median(&sorted)
            },
            noise: if bends.is_empty() {
                0.0
            } else {
                super::problem::median(bends) / BEND_OF_NOISE
            },
        }
    }
}

/// Whether nearly all changes are whole multiples of a step.
fn counted(changes: &[f64], step: f64) -> bool {
    let whole = |change: &&f64| {
        let steps = **change / step;
        (steps - steps.round()).abs() <= WHOLE_STEP_TOLERANCE
    };
    changes.iter().filter(whole).count() as f64 >= REGULAR_QUANTILE * changes.len() as f64
}

/// Rows over which an encoder repeated its position while the joint moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Stuck {
    /// The index of the position in [`LogRow::values`](super::reader::LogRow::values).
    pub(super) entry: usize,
    /// The line of the first row that repeats the position of the row before.
    pub(super) first: u64,
    /// The line of the last such row.
    pub(super) last: u64,
}

/// Statistics of one position, updated row by row through a file.
#[derive(Clone, Debug, Default)]
pub(super) struct PositionHistory {
    /// The position in the last row; `None` at the start and after a gap.
    value: Option<f64>,
    /// The last changes with their signs, the newest at the end.
    recent: [f64; SPEED_CHANGES],
    /// Number of rows that repeat `value` so far.
    repeats: usize,
    /// The lines of the first and the last of these rows.
    span: (u64, u64),
    /// The value of [`RepeatedRows::speed`] for these rows.
    speed: f64,
    /// The absolute values of the changes, for the statistics.
    changes: Vec<f64>,
    /// Those of the differences of changes.
    bends: Vec<f64>,
    stretches: Vec<RepeatedRows>,
    /// Whether the last row ended a stretch by a jump, so that the next change is stored in
    /// [`RepeatedRows::next`].
    follows_jump: bool,
}

/// A stretch of rows that repeat one position.
#[derive(Clone, Copy, Debug)]
struct RepeatedRows {
    /// Number of rows that repeat the position of the row before.
    rows: usize,
    /// The lines of the first and the last of them.
    span: (u64, u64),
    /// The mean change per row just before the stretch, rad or m, if the motion had one direction
    /// and was not braked; 0 otherwise.
    speed: f64,
    /// The absolute change at the end of the stretch; `None` if no row follows, or only after a gap.
    jump: Option<f64>,
    /// The absolute change in the row after the jump; 0 without one.
    next: f64,
}

impl PositionHistory {
    /// Adds the position (rad or m) of the row at `line`.
    pub(super) fn push(&mut self, line: u64, value: f64) {
        let Some(before) = self.value.replace(value) else {
            return;
        };
        let change = value - before;
        let moved = change.abs() > RELATIVE_ROUNDING * value.abs();
        if core::mem::take(&mut self.follows_jump)
            && let Some(last) = self.stretches.last_mut()
        {
            last.next = change.abs();
        }
        if change == 0.0 {
            if self.repeats == 0 {
                self.span.0 = line;
                let one_way =
                    self.recent.iter().all(|c| *c > 0.0) || self.recent.iter().all(|c| *c < 0.0);
                let mean = self.recent.iter().sum::<f64>() / SPEED_CHANGES as f64;
                let [first, .., last] = self.recent;
                let next = last + (last - first) / (SPEED_CHANGES - 1) as f64;
                let unbraked = next / mean >= MIN_UNBRAKED_RATIO;
                self.speed = if one_way && unbraked { mean.abs() } else { 0.0 };
            }
            self.repeats += 1;
            self.span.1 = line;
        } else {
            self.close(Some(change.abs()));
            if moved && self.changes.len() < MAX_CHANGES {
                self.changes.push(change.abs());
                let last = self.recent[SPEED_CHANGES - 1];
                self.bends.push((change - last).abs());
            }
        }
        self.recent.rotate_left(1);
        self.recent[SPEED_CHANGES - 1] = change;
    }

    /// Ends the current stretch without a jump, at a gap in the log or at its end.
    pub(super) fn pause(&mut self) {
        self.close(None);
        self.value = None;
        self.follows_jump = false;
        self.recent = [0.0; SPEED_CHANGES];
    }

    /// Stores the current stretch, if it is long enough to be judged.
    fn close(&mut self, jump: Option<f64>) {
        let rows = core::mem::take(&mut self.repeats);
        if rows + 1 >= MIN_REPEATED_ROWS && self.stretches.len() < MAX_STRETCHES {
            self.follows_jump = jump.is_some();
            self.stretches.push(RepeatedRows {
                rows,
                span: self.span,
                speed: self.speed,
                jump,
                next: 0.0,
            });
        }
    }

    /// The stretches in which the encoder was stuck, with `entry` as their [`Stuck::entry`], and the
    /// statistics of its changes.
    pub(super) fn finish(mut self, entry: usize) -> (Vec<Stuck>, PositionChanges) {
        self.pause();
        let changes = PositionChanges::of(&self.changes, &self.bends);
        let lost = MIN_JUMP * changes.usual.max(changes.encoder);
        let mut out = vec![];
        for stretch in &self.stretches {
            let stuck = match stretch.jump {
                Some(jump) => jump > lost && jump > MIN_JUMP_RATIO * stretch.next,
                None => {
                    stretch.rows >= MIN_REPEATED_ROWS_AT_END
                        && stretch.speed > 0.0
                        && stretch.speed
                            >= (MIN_SPEED_CHANGES * changes.usual)
                                .max(MIN_SPEED_STEPS * changes.encoder)
                }
            };
            if stuck {
                out.push(Stuck {
                    entry,
                    first: stretch.span.0,
                    last: stretch.span.1,
                });
            }
        }
        (out, changes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(values: impl IntoIterator<Item = f64>) -> Vec<(u64, u64)> {
        let mut watch = PositionHistory::default();
        for (line, value) in values.into_iter().enumerate() {
            watch.push(line as u64, value);
        }
        let found = watch.finish(1).0;
        found.iter().map(|s| (s.first, s.last)).collect()
    }

    /// A sine of amplitude 1 and period 2 s, sampled at 100 Hz.
    fn swing(row: usize) -> f64 {
        (core::f64::consts::PI * row as f64 / 100.0).sin()
    }

    #[test]
    fn a_frozen_value_is_found_wherever_it_begins() {
        for start in [1, 40, 50, 97, 180] {
            for rows in [15, 60, 300] {
                let value = |row: usize| {
                    swing(if row < start + rows {
                        row.min(start)
                    } else {
                        row
                    })
                };
                let stuck = found((0..500).map(value));
                let lost = (swing(start + rows) - swing(start)).abs();
                // no jump is visible where the swing comes back to the same position
                if lost > 0.3 || start == 97 {
                    let (first, last) = (start as u64 + 1, (start + rows) as u64 - 1);
                    assert_eq!(stuck, [(first, last)], "{start} {rows}");
                }
            }
        }
    }

    #[test]
    fn a_value_frozen_to_the_end_is_found() {
        assert_eq!(found((0..500).map(|k| swing(k.min(100)))), [(101, 499)]);
    }

    #[test]
    fn rest_and_coarse_encoders_are_left_alone() {
        // turning points of coarse encoders, steps per row of 0.3 to 30 counts
        for counts in [10.0, 100.0, 1000.0] {
            assert_eq!(found((0..1000).map(|k| (swing(k) * counts).round())), []);
        }
        // an encoder that is read less often than rows are written
        assert_eq!(found((0..1000).map(|k| swing(k / 10 * 10))), []);
        // a start and an end at rest, with the acceleration of a robot
        let eased = |k: f64| k - (core::f64::consts::TAU * k).sin() / core::f64::consts::TAU;
        let moved = |k: usize| eased((k as f64 / 300.0 - 1.0).clamp(0.0, 1.0));
        assert_eq!(found((0..1000).map(moved)), []);
        assert_eq!(found((0..1000).map(|k| (moved(k) * 4096.0).round())), []);
        // a joint that does not move
        assert_eq!(found((0..1000).map(|_| 0.3)), []);
        assert_eq!(found((0..5000).map(|_| 0.3 * 0.022_222)), []);
    }

    #[test]
    fn stiction_that_stops_a_slow_motion_is_no_fault() {
        // a swing that stiction stops at its slow ends, and that then goes on
        let stopped = |row: usize| {
            let slow = swing(row).abs() > 0.9;
            if slow {
                0.9_f64.copysign(swing(row))
            } else {
                swing(row)
            }
        };
        assert_eq!(found((0..1000).map(stopped)), []);
        // a coarse encoder that comes to rest from two steps a row, and starts with four
        let mut coarse: Vec<f64> = (0..400).map(|k| (swing(k) * 40.0).round()).collect();
        let last = *coarse.last().unwrap();
        coarse.extend((1..6).map(|k| last + 2.0 * f64::from(k)));
        coarse.extend([last + 10.0; 20]);
        coarse.extend((1..6).map(|k| last + 10.0 + 4.0 * f64::from(k)));
        let coarse = coarse.into_iter().map(|counts| counts * 0.003);
        assert_eq!(found(coarse), []);
        // a slow lift that comes to rest until the log ends
        let lift = |k: usize| 3e-3 * 0.01 * k.min(200) as f64 + 1e-5 * swing(k.min(200));
        assert_eq!(found((0..285).map(lift)).len(), 0);
    }

    #[test]
    fn the_step_of_an_encoder_is_the_smallest_change_that_is_frequent() {
        let steps = |values: &mut dyn Iterator<Item = f64>| {
            let mut watch = PositionHistory::default();
            values.for_each(|value| watch.push(0, value));
            watch.finish(1).1
        };
        // rounding of the numbers is not a step
        let coarse =
            steps(&mut (0..1000).map(|k| (swing(k) * 50.0).round() * 0.003 + 1e-16 * k as f64));
        assert!((coarse.encoder - 0.003).abs() < 1e-9, "{coarse:?}");
        // nor are the changes of a smooth signal
        let smooth = steps(&mut (0..150).map(|k| 0.01 * f64::from(k).powi(3)));
        assert!(smooth.encoder <= 0.0, "{smooth:?}");
        assert!(smooth.regular > 0.0, "{smooth:?}");
    }

    #[test]
    fn a_motion_that_turns_round_or_brakes_may_rest_until_the_log_ends() {
        // turns round in the rows before it rests, which chatter does
        let chatters = |k: usize| if k < 300 { swing(k) } else { swing(300) };
        let chatter = |k: usize| {
            let off = if (290..300).contains(&k) && k.is_multiple_of(2) {
                0.1
            } else {
                0.0
            };
            chatters(k) + off
        };
        assert_eq!(found((0..500).map(chatter)), []);
        // one that brakes: each change is half of the one before
        let brakes = |k: usize| {
            let rest = 0.1 * (1.0 - 0.5_f64.powf(k.clamp(100, 104) as f64 - 100.0));
            swing(k.min(100)) - rest
        };
        assert_eq!(found((0..500).map(brakes)), []);
    }
}
