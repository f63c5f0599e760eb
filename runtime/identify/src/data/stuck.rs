//! Encoders: their step, and when they stop telling.
//!
//! A position that stands exactly still is no fault: robots rest, and stiction stops a slow motion
//! within a row. It is one where the position then jumps to where the motion has gone meanwhile,
//! or where a fast motion ends within a row and never comes back.

/// Rows that must be exactly alike.
const ALIKE: usize = 8;
/// Rows that must be alike at the end of a log.
const NEVER: usize = 32;
/// Changes before them that tell how fast the position was.
const BEFORE: usize = 4;
/// Of the change before, what is left in the next row if it goes on as the last ones did: a
/// motion that is braked has none.
const UNBRAKED: f64 = 0.5;
/// Slower than this part of the usual change between rows, a motion may be stopped by friction.
const MOVING: f64 = 0.5;
/// The same in steps of the encoder.
const STEPS: f64 = 4.0;
/// What was lost, by going on as before or by the jump at the end, in usual changes and in steps
/// of the encoder: a coarse encoder that is turned slowly loses one.
const LOST: f64 = 8.0;
/// A motion that starts is faster in the next row; an encoder that wakes jumps by what several
/// rows have moved. So much larger the jump is than the next change.
const JUMP: f64 = 4.0;
/// Changes that are looked at.
const CHANGES: usize = 4001;
/// Stretches that are remembered until the usual change is known.
const REMEMBERED: usize = 4096;
/// A change below this part of the position is rounding of a number and no step.
const ROUNDING: f64 = 1e-10;
/// Changes alike within this part are the same number of steps.
const SAME: f64 = 1e-3;
/// Changes that must be alike, so that they are a step.
const OFTEN: usize = 5;
/// How far a whole number of steps may be from one: rounding of decimals.
const WHOLE: f64 = 0.1;
/// The part of the changes of a moving robot that are not larger than the one it makes regularly.
const REGULAR: f64 = 0.9;

/// How a position changes between rows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Steps {
    /// The encoder's: the smallest change that is frequent; 0 where none is.
    pub(super) encoder: f64,
    /// What nine of ten changes of a moving joint are not above.
    pub(super) regular: f64,
    /// Their median.
    usual: f64,
}

impl Steps {
    /// Of changes that are not zero.
    fn of(changes: &[f64]) -> Self {
        let mut sorted = changes.to_vec();
        sorted.sort_by(f64::total_cmp);
        let alike = |k: &usize| sorted[k + OFTEN - 1] <= sorted[*k] * (1.0 + SAME);
        let encoder = (0..(sorted.len() + 1).saturating_sub(OFTEN)).find(alike);
        // a motion that repeats itself has changes that are alike, and are no multiples of one
        let encoder = encoder.filter(|k| counted(&sorted, sorted[*k]));
        #[allow(clippy::cast_sign_loss, reason = "a part of a length")]
        let regular = (REGULAR * sorted.len() as f64) as usize;
        Self {
            encoder: encoder.map_or(0.0, |k| sorted[k]),
            regular: sorted.get(regular).copied().unwrap_or(0.0),
            usual: if sorted.is_empty() {
                0.0
            } else {
                super::problem::median(&sorted)
            },
        }
    }
}

/// Whether nearly all changes are whole multiples of a step.
fn counted(changes: &[f64], step: f64) -> bool {
    let whole = |change: &&f64| {
        let steps = **change / step;
        (steps - steps.round()).abs() <= WHOLE
    };
    changes.iter().filter(whole).count() as f64 >= REGULAR * changes.len() as f64
}

/// Rows over which a position stood still though the robot did not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Stuck {
    /// The entry of the kept rows.
    pub(super) entry: usize,
    /// The first row that repeats its forerunner.
    pub(super) first: u64,
    pub(super) last: u64,
}

/// One position on its way through a file.
#[derive(Clone, Debug, Default)]
pub(super) struct PositionHistory {
    value: Option<f64>,
    /// The last changes.
    recent: [f64; BEFORE],
    /// Rows that repeat `value`, the first and the last of them, and the speed before.
    alike: usize,
    span: (u64, u64),
    speed: f64,
    changes: Vec<f64>,
    stretches: Vec<RepeatedRows>,
    /// Whether the last stretch waits for the change behind its jump.
    waking: bool,
}

#[derive(Clone, Copy, Debug)]
struct RepeatedRows {
    rows: usize,
    span: (u64, u64),
    /// Change per row before, all in one direction and not braked; 0 otherwise.
    speed: f64,
    /// Change at the end; `None` where nothing follows.
    jump: Option<f64>,
    /// The change after that.
    next: f64,
}

impl PositionHistory {
    /// The next row.
    pub(super) fn push(&mut self, line: u64, value: f64) {
        let Some(before) = self.value.replace(value) else {
            return;
        };
        let change = value - before;
        let moved = change.abs() > ROUNDING * value.abs();
        if core::mem::take(&mut self.waking)
            && let Some(last) = self.stretches.last_mut()
        {
            last.next = change.abs();
        }
        if change == 0.0 {
            if self.alike == 0 {
                self.span.0 = line;
                let one_way =
                    self.recent.iter().all(|c| *c > 0.0) || self.recent.iter().all(|c| *c < 0.0);
                let mean = self.recent.iter().sum::<f64>() / BEFORE as f64;
                let [first, .., last] = self.recent;
                let next = last + (last - first) / (BEFORE - 1) as f64;
                let unbraked = next / mean >= UNBRAKED;
                self.speed = if one_way && unbraked { mean.abs() } else { 0.0 };
            }
            self.alike += 1;
            self.span.1 = line;
        } else {
            self.close(Some(change.abs()));
            if moved && self.changes.len() < CHANGES {
                self.changes.push(change.abs());
            }
        }
        self.recent.rotate_left(1);
        self.recent[BEFORE - 1] = change;
    }

    /// Nothing follows what came, or not without a gap.
    pub(super) fn pause(&mut self) {
        self.close(None);
        self.value = None;
        self.waking = false;
        self.recent = [0.0; BEFORE];
    }

    fn close(&mut self, jump: Option<f64>) {
        let rows = core::mem::take(&mut self.alike);
        if rows + 1 >= ALIKE && self.stretches.len() < REMEMBERED {
            self.waking = jump.is_some();
            self.stretches.push(RepeatedRows {
                rows,
                span: self.span,
                speed: self.speed,
                jump,
                next: 0.0,
            });
        }
    }

    /// The stretches in which the encoder was stuck, and how it steps.
    pub(super) fn finish(mut self, entry: usize) -> (Vec<Stuck>, Steps) {
        self.pause();
        let steps = Steps::of(&self.changes);
        let lost = LOST * steps.usual.max(steps.encoder);
        let mut out = vec![];
        for stretch in &self.stretches {
            let stuck = match stretch.jump {
                Some(jump) => jump > lost && jump > JUMP * stretch.next,
                None => {
                    stretch.rows >= NEVER
                        && stretch.speed > 0.0
                        && stretch.speed >= (MOVING * steps.usual).max(STEPS * steps.encoder)
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
        (out, steps)
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

    /// A swing of 2 s, sampled at 100 Hz.
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
                let told = found((0..500).map(value));
                let lost = (swing(start + rows) - swing(start)).abs();
                // nothing was lost where the swing comes back to the place
                if lost > 0.3 || start == 97 {
                    let (first, last) = (start as u64 + 1, (start + rows) as u64 - 1);
                    assert_eq!(told, [(first, last)], "{start} {rows}");
                }
            }
        }
    }

    #[test]
    fn one_that_never_wakes_is_found() {
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
        // a joint that is held
        assert_eq!(found((0..1000).map(|_| 0.3)), []);
        assert_eq!(found((0..5000).map(|_| 0.3 * 0.022_222)), []);
    }

    #[test]
    fn stiction_that_stops_a_slow_motion_is_no_fault() {
        // a swing whose slow ends stand still, as a joint with stiction does, and then goes on
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
        // the same lift at rest until the log ends
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
        // rounding of the numbers is no step
        let coarse =
            steps(&mut (0..1000).map(|k| (swing(k) * 50.0).round() * 0.003 + 1e-16 * k as f64));
        assert!((coarse.encoder - 0.003).abs() < 1e-9, "{coarse:?}");
        // nor are the changes of a smooth signal
        let smooth = steps(&mut (0..150).map(|k| 0.01 * f64::from(k).powi(3)));
        assert!(smooth.encoder <= 0.0, "{smooth:?}");
        assert!(smooth.regular > 0.0, "{smooth:?}");
    }
}
