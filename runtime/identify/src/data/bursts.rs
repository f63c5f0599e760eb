//! Finds rows at which a position jumps: away and back, or for good. No joint moves so.

/// Number of changes before a jump, and after the return, that are compared with it.
const CALM: usize = 5;
/// The smallest jump, in the largest change of the rows before it: motion and noise grow by less.
const MIN_CHANGES: f64 = 12.0;
/// The smallest jump, in the regular changes of the log.
const MIN_REGULAR: f64 = 3.0;
/// The largest change of calm rows, relative to the jump.
const MAX_CALM_PART: f64 = 0.1;
/// The largest distance of the position after the run from where the motion leads to, relative to the
/// jump.
const MAX_MOVED_PART: f64 = 0.25;
/// The largest number of rows of a run.
const MAX_ROWS: usize = 1000;
/// A step of more than this many times the one before it leaves rows out.
const MAX_STEPS: f64 = 1.5;
/// The largest number of rows that are kept of all runs.
const MAX_KEPT: usize = 10_000;

/// A row whose position is not that of the joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OffRow {
    /// The number of the row.
    pub(super) line: u64,
    /// The position, rad or m.
    pub(super) value: f64,
    /// The position that those before and after the run lead to.
    pub(super) around: f64,
    /// The size of the jump.
    jump: f64,
}

/// A row at which a position jumps and does not come back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Jump {
    /// The number of the row.
    pub(super) line: u64,
    /// The change from the row before, rad or m.
    pub(super) by: f64,
}

/// A run that has begun and has not ended.
#[derive(Clone, Debug)]
struct Run {
    /// The position before the jump.
    before: f64,
    jump: f64,
    /// The mean change of the rows before it.
    rate: f64,
    /// The rows since the jump.
    rows: Vec<(u64, f64)>,
    /// Whether the rows just before and after the jump are calm, and the clock is even: it is no motion.
    is_sharp: bool,
}

/// Looks for runs in one position, row by row.
#[derive(Clone, Debug, Default)]
pub(super) struct BurstFinder {
    last: Option<f64>,
    /// The last changes, the newest at the end, and the number of them.
    changes: [f64; CALM],
    count: usize,
    run: Option<Run>,
    found: Vec<OffRow>,
    jumps: Vec<Jump>,
    /// The time of the last row and its step from the one before, s.
    time: f64,
    step: f64,
}

impl BurstFinder {
    /// Adds the position (rad or m) of the row at `line` and a time in s.
    pub(super) fn push(&mut self, line: u64, time: f64, value: f64) {
        let step = time - core::mem::replace(&mut self.time, time);
        // rows that are missing are no jump
        let is_even = step < MAX_STEPS * core::mem::replace(&mut self.step, step);
        let Some(before) = self.last.replace(value) else {
            return;
        };
        let change = value - before;
        let usual = largest(&self.changes);
        if self.run.is_none()
            && self.count >= CALM
            && usual > 0.0
            && change.abs() > MIN_CHANGES * usual
        {
            self.run = Some(Run {
                before,
                jump: change.abs(),
                rate: mean(&self.changes),
                rows: Vec::new(),
                is_sharp: is_even,
            });
        }
        self.changes.rotate_left(1);
        self.changes[CALM - 1] = change;
        self.count += 1;
        if let Some(run) = &mut self.run {
            run.rows.push((line, value));
            if (2..=CALM + 1).contains(&run.rows.len()) {
                run.is_sharp &= is_even && change.abs() < MAX_CALM_PART * run.jump;
            }
            self.judge();
        }
    }

    /// Forgets the rows before a gap.
    pub(super) fn pause(&mut self) {
        self.settle();
        *self = Self {
            found: core::mem::take(&mut self.found),
            jumps: core::mem::take(&mut self.jumps),
            ..Self::default()
        };
    }

    /// Ends the run if its last rows are calm and where the motion before leads to.
    fn judge(&mut self) {
        let Some(run) = &self.run else { return };
        if run.rows.len() > MAX_ROWS {
            self.settle();
            return;
        }
        let Some(off) = run.rows.len().checked_sub(CALM + 1).filter(|off| *off > 0) else {
            return;
        };
        let pair = run.rows.get(off - 1).zip(run.rows.get(off));
        let Some(((_, last), (_, after))) = pair else {
            return;
        };
        // a shift that stays may meet the old path again, but does not jump to it
        let usual = largest(&self.changes);
        let returns =
            (after - last).abs() > MIN_CHANGES * usual && usual < MAX_CALM_PART * run.jump;
        let expected = run.before + 0.5 * (run.rate + mean(&self.changes)) * (off + 1) as f64;
        let is_back = (after - expected).abs() <= MAX_MOVED_PART * run.jump;
        // a jump to another place is a second one
        if returns && run.is_sharp && off > CALM && !is_back {
            let next = Run {
                before: *last,
                jump: (after - last).abs(),
                rate: run.rate,
                rows: run.rows.get(off..).unwrap_or_default().to_vec(),
                is_sharp: true,
            };
            self.settle();
            self.run = Some(next);
            return;
        }
        if !returns || !is_back {
            return;
        }
        let per_row = (after - run.before) / (off + 1) as f64;
        for (k, (line, value)) in run.rows.iter().take(off).enumerate() {
            let around = run.before + per_row * (k + 1) as f64;
            let is_off = (value - around).abs() > MAX_CALM_PART * run.jump;
            if is_off && self.found.len() < MAX_KEPT {
                self.found.push(OffRow {
                    line: *line,
                    value: *value,
                    around: format!("{around:.5e}").parse().unwrap_or(around),
                    jump: run.jump,
                });
            }
        }
        self.run = None;
    }

    /// Ends a run that does not come back, which is a jump for good.
    fn settle(&mut self) {
        let Some(run) = self.run.take() else { return };
        if let Some((line, value)) = run
            .rows
            .first()
            .filter(|_| run.is_sharp && run.rows.len() > CALM)
            && self.jumps.len() < MAX_KEPT
        {
            self.jumps.push(Jump {
                line: *line,
                by: value - run.before,
            });
        }
    }

    /// The rows that are off, and the jumps for good, by far more than the regular changes of the position.
    pub(super) fn finish(mut self, regular: f64) -> (Vec<OffRow>, Vec<Jump>) {
        self.settle();
        let least = MIN_REGULAR * regular;
        self.found.retain(|row| row.jump > least);
        self.jumps.retain(|jump| jump.by.abs() > least);
        (self.found, self.jumps)
    }
}

fn largest(changes: &[f64]) -> f64 {
    changes.iter().fold(0.0, |m: f64, c| m.max(c.abs()))
}

fn mean(changes: &[f64]) -> f64 {
    changes.iter().sum::<f64>() / changes.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The lines that are off in a swinging position, to whose row `k` the other is added.
    fn found(off: impl Fn(usize) -> f64) -> Vec<u64> {
        let (found, _) = both(off);
        found
    }

    /// The same, and the lines at which it jumps for good.
    fn both(off: impl Fn(usize) -> f64) -> (Vec<u64>, Vec<u64>) {
        let mut finder = BurstFinder::default();
        for k in 0..2000_usize {
            let noise = (k * 7919 % 1009) as f64 / 1009.0 - 0.5;
            let value = (0.01 * k as f64).sin() + 1e-4 * noise + off(k);
            finder.push(k as u64, 0.01 * k as f64, value);
        }
        let (found, jumps) = finder.finish(0.01);
        (
            found.iter().map(|row| row.line).collect(),
            jumps.iter().map(|jump| jump.line).collect(),
        )
    }

    #[test]
    fn rows_of_a_run_of_any_length_are_off_and_others_are_not() {
        assert_eq!(found(|_| 0.0), [0; 0]);
        for (first, length) in [(500, 1), (500, 4), (157, 6), (700, 12)] {
            let run = first..first + length;
            let own = run.clone();
            let expected: Vec<u64> = run.map(|k| k as u64).collect();
            let jumps = |k: usize| [2.0, -1.5, 2.5, 1.8, -2.0, -2.2][k % 6];
            assert_eq!(
                found(|k| if own.contains(&k) { jumps(k) } else { 0.0 }),
                expected
            );
            // a shift, and its return
            assert_eq!(
                found(|k| if own.contains(&k) { 2.0 } else { 0.0 }),
                expected
            );
        }
        // an encoder that loses its count does not come back
        for first in [600, 1300, 1990] {
            let lost = |k: usize| if k < first { 0.0 } else { 2.0 };
            assert_eq!(both(lost), (vec![], vec![first as u64]));
        }
        // a burst is no jump for good
        let burst = |k: usize| if (900..940).contains(&k) { 2.0 } else { 0.0 };
        assert_eq!(both(burst).1, [0; 0]);
        // a motion that starts from rest
        let start = |k: usize| {
            if k < 900 {
                0.0
            } else {
                1e-5 * ((k - 900) as f64).powi(2)
            }
        };
        assert_eq!(both(start), (vec![], vec![]));
    }

    #[test]
    fn a_burst_is_found_if_the_calm_rows_behind_it_still_fit_into_the_memory() {
        let burst = |length: usize| {
            let mut finder = BurstFinder::default();
            for k in 0..2500_usize {
                let off = if (500..500 + length).contains(&k) {
                    3.0
                } else {
                    0.0
                };
                finder.push(k as u64, 0.01 * k as f64, 0.02 * k as f64 + off);
            }
            finder.finish(0.02).0.len()
        };
        let most = MAX_ROWS - CALM - 1;
        assert_eq!((burst(most), burst(most + 1)), (most, 0));
    }

    #[test]
    fn rows_that_are_off_and_jumps_are_told_with_their_sizes() {
        let finished = |off: &dyn Fn(usize) -> f64| {
            let mut finder = BurstFinder::default();
            for k in 0..1000_usize {
                let noise = (k * 7919 % 1009) as f64 / 1009.0 - 0.5;
                finder.push(
                    k as u64,
                    0.01 * k as f64,
                    7.0 + 0.02 * k as f64 + 1e-4 * noise + off(k),
                );
            }
            finder.finish(0.02)
        };
        let (rows, _) = finished(&|k| if (500..510).contains(&k) { 3.0 } else { 0.0 });
        assert_eq!(rows.len(), 10);
        for row in rows {
            let around = 7.0 + 0.02 * row.line as f64;
            assert!((row.around - around).abs() < 1e-2, "{row:?}");
            assert!((row.value - around - 3.0).abs() < 1e-2, "{row:?}");
        }
        let (_, jumps) = finished(&|k| if k >= 600 { -3.0 } else { 0.0 });
        assert_eq!(jumps.len(), 1);
        assert!((jumps[0].by + 2.98).abs() < 1e-2, "{jumps:?}");
    }
}
