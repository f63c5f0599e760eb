//! Encoders that stop telling: a position that stands exactly still where motion does not.

use std::prelude::v1::*;
use std::vec;

/// Rows that must be exactly alike.
const ALIKE: usize = 8;
/// Changes before them that tell how fast the position was.
const BEFORE: usize = 4;
/// Of the change before, what is left in the next row if it goes on as the last ones did: a
/// motion that is braked has none.
const UNBRAKED: f64 = 0.5;
/// Slower than this part of the usual change between rows is no motion.
const MOVING: f64 = 0.05;
/// What was lost, by going on as before or by the jump at the end, in usual changes and in the
/// smallest ones: a coarse encoder that is turned slowly loses one.
const LOST: f64 = 8.0;
/// Changes from which the usual one is found.
const CHANGES: usize = 1001;
/// Stretches that are remembered until the usual change is known.
const REMEMBERED: usize = 4096;

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
pub(super) struct Watch {
    value: Option<f64>,
    /// The last changes.
    recent: [f64; BEFORE],
    /// Rows that repeat `value`, the first and the last of them, and the speed before.
    alike: usize,
    span: (u64, u64),
    speed: f64,
    smallest: f64,
    changes: Vec<f64>,
    stretches: Vec<Stretch>,
}

#[derive(Clone, Copy, Debug)]
struct Stretch {
    rows: usize,
    span: (u64, u64),
    /// Change per row before, all in one direction and not braked; 0 otherwise.
    speed: f64,
    /// Change at the end; 0 where nothing follows.
    jump: f64,
}

impl Watch {
    /// The next row.
    pub(super) fn push(&mut self, line: u64, value: f64) {
        let Some(before) = self.value.replace(value) else {
            return;
        };
        let change = value - before;
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
            self.close(change.abs());
            if self.smallest == 0.0 || change.abs() < self.smallest {
                self.smallest = change.abs();
            }
            if self.changes.len() < CHANGES {
                self.changes.push(change.abs());
            }
        }
        self.recent.rotate_left(1);
        self.recent[BEFORE - 1] = change;
    }

    /// Nothing follows what came, or not without a gap.
    pub(super) fn pause(&mut self) {
        self.close(0.0);
        self.value = None;
        self.recent = [0.0; BEFORE];
    }

    fn close(&mut self, jump: f64) {
        let rows = core::mem::take(&mut self.alike);
        if rows + 1 >= ALIKE && self.stretches.len() < REMEMBERED {
            self.stretches.push(Stretch {
                rows,
                span: self.span,
                speed: self.speed,
                jump,
            });
        }
    }

    /// The stretches in which the encoder was stuck.
    pub(super) fn finish(mut self, entry: usize) -> Vec<Stuck> {
        self.pause();
        let usual = super::problem::median(&self.changes);
        let lost = LOST * usual.max(self.smallest);
        let mut out = vec![];
        for stretch in &self.stretches {
            let went_on = stretch.speed >= MOVING * usual
                && stretch.speed * stretch.rows as f64 > LOST * self.smallest;
            if went_on || stretch.jump > lost {
                out.push(Stuck {
                    entry,
                    first: stretch.span.0,
                    last: stretch.span.1,
                });
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(values: impl IntoIterator<Item = f64>) -> Vec<(u64, u64)> {
        let mut watch = Watch::default();
        for (line, value) in values.into_iter().enumerate() {
            watch.push(line as u64, value);
        }
        let found = watch.finish(1);
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
    }
}
