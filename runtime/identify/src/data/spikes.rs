//! Finds rows in which an effort jumps and is back in the next row: spikes, which no drive gives.

use std::collections::VecDeque;

use super::problem::median;
use super::sample::Spikes;

/// The smallest jump and return of a spike, in median changes between rows: noise has changes of a few.
const MIN_CHANGES: f64 = 30.0;
/// The same in the third largest change between the rows around it: the noise of a stretch is no spike.
const MIN_LOCAL_CHANGES: f64 = 10.0;
/// Number of rows on either side of a spike that are compared with it.
const NEIGHBOURS: usize = 5;
/// The smallest jump and return of a spike, relative to the standard deviation of the effort.
const MIN_SPREAD_PART: f64 = 0.5;
/// The largest part of the rows that are spikes: a controller that chatters has more.
const MAX_PART: f64 = 0.05;
/// Number of changes that their median is taken of.
const MAX_CHANGES: usize = 16_384;
/// Number of the largest jumps that are kept, however long the log is; as many spikes are chatter too.
const MAX_KEPT: usize = 16_384;

/// A row in which an effort is not what acted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spike {
    /// The number of the row.
    pub(super) line: u64,
    /// The time from the row before to the row after, s.
    pub(super) seconds: f64,
    /// The jump, N or N m.
    size: f64,
}

/// Looks for spikes in the efforts of rows that come one by one.
#[derive(Clone, Debug)]
pub(super) struct SpikeFinder {
    efforts: Vec<Effort>,
    rows: usize,
}

/// What is known of one effort.
#[derive(Clone, Debug, Default)]
struct Effort {
    /// The last rows without a gap: the value, the time in s and the row's number.
    last: VecDeque<(f64, f64, u64)>,
    changes: Vec<f64>,
    /// The largest jumps with a return.
    jumps: Vec<Spike>,
    first: f64,
    sum: f64,
    squares: f64,
}

impl SpikeFinder {
    /// Looks in this many efforts.
    pub(super) fn new(efforts: usize) -> Self {
        Self {
            efforts: vec![Effort::default(); efforts],
            rows: 0,
        }
    }

    /// Takes the next row.
    ///
    /// - `line`: its number; `time`: s; `values`: its efforts.
    pub(super) fn push(&mut self, line: u64, time: f64, values: &[f64]) {
        for (own, value) in self.efforts.iter_mut().zip(values) {
            if self.rows == 0 {
                own.first = *value;
            }
            own.push((*value, time, line));
        }
        self.rows += 1;
    }

    /// Starts anew: the next row does not follow the last one.
    pub(super) fn pause(&mut self) {
        self.efforts.iter_mut().for_each(|own| own.last.clear());
    }

    /// The spikes of each effort, the largest first; none of efforts that have many.
    pub(super) fn finish(self) -> Vec<Vec<Spike>> {
        let rows = self.rows.max(1) as f64;
        let one = |own: Effort| {
            let spread = (own.squares / rows - (own.sum / rows).powi(2))
                .max(0.0)
                .sqrt();
            let least = (MIN_CHANGES * median(&own.changes)).max(MIN_SPREAD_PART * spread);
            let mut found = own.jumps;
            found.retain(|spike| spike.size > least);
            let is_rare = found.len() < MAX_KEPT && (found.len() as f64) < MAX_PART * rows;
            if is_rare { found } else { Vec::new() }
        };
        self.efforts.into_iter().map(one).collect()
    }
}

/// What is said of the spikes of an effort; `None` if there are none.
///
/// - `effort`: its index.
pub(super) fn said_of(effort: usize, spikes: &[Spike]) -> Option<Spikes> {
    Some(Spikes {
        effort,
        rows: spikes.len(),
        largest: spikes.iter().fold(0.0, |m: f64, own| m.max(own.size)),
        row: spikes.iter().map(|own| own.line).min()?,
    })
}

impl Effort {
    /// Takes the value of the next row, and judges the one in the middle of the last ones.
    fn push(&mut self, row: (f64, f64, u64)) {
        let value = row.0;
        let off = value - self.first;
        self.sum += off;
        self.squares += off * off;
        if let Some((last, ..)) = self.last.back() {
            let change = (value - last).abs();
            if change > 0.0 && self.changes.len() < MAX_CHANGES {
                self.changes.push(change);
            }
        }
        self.last.push_back(row);
        if self.last.len() > 2 * NEIGHBOURS + 1 {
            self.last.pop_front();
        }
        if self.last.len() == 2 * NEIGHBOURS + 1 {
            self.judge();
        }
    }

    fn judge(&mut self) {
        let pairs = self.last.iter().zip(self.last.iter().skip(1));
        let mut changes: Vec<f64> = pairs.map(|(a, b)| b.0 - a.0).collect();
        let own: Vec<f64> = changes.drain(NEIGHBOURS - 1..=NEIGHBOURS).collect();
        let time = |place: usize| self.last.get(place).map(|row| row.1);
        let seconds = time(NEIGHBOURS + 1).zip(time(NEIGHBOURS - 1));
        let line = self.last.get(NEIGHBOURS).map(|row| row.2);
        if let ([there, back], Some((line, (after, before)))) = (&own[..], line.zip(seconds))
            && there * back < 0.0
        {
            let size = there.abs().min(back.abs());
            let mut changes: Vec<f64> = changes.into_iter().map(f64::abs).collect();
            changes.sort_by(f64::total_cmp);
            // another spike near by has two changes
            let usual = changes.iter().rev().nth(2).copied().unwrap_or(0.0);
            if size > MIN_LOCAL_CHANGES * usual {
                self.keep(Spike {
                    line,
                    seconds: after - before,
                    size,
                });
            }
        }
    }

    /// Keeps a jump if it is one of the largest ones.
    fn keep(&mut self, jump: Spike) {
        self.jumps.push(jump);
        if self.jumps.len() >= 2 * MAX_KEPT {
            self.jumps.sort_by(|a, b| b.size.total_cmp(&a.size));
            self.jumps.truncate(MAX_KEPT);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The spikes in an effort of 2000 rows.
    fn found(effort: impl Fn(usize) -> f64) -> Vec<Spikes> {
        found_in(2000, effort)
    }

    fn found_in(rows: usize, effort: impl Fn(usize) -> f64) -> Vec<Spikes> {
        let mut finder = SpikeFinder::new(1);
        for k in 0..rows {
            if k == 1000 {
                finder.pause();
            }
            finder.push(k as u64 + 2, 0.01 * k as f64, &[effort(k)]);
        }
        let found = finder.finish();
        assert!(
            found
                .iter()
                .flatten()
                .all(|own| (own.seconds - 0.02).abs() < 1e-9)
        );
        let each = found.iter().enumerate();
        each.filter_map(|(effort, own)| said_of(effort, own))
            .collect()
    }

    /// A swing with noise.
    fn clean(k: usize) -> f64 {
        let noise = ((k * 7919) % 1009) as f64 / 1009.0 - 0.5;
        (0.01 * k as f64).sin() * 10.0 + 0.2 * noise
    }

    #[test]
    fn rows_that_jump_and_are_back_at_once_are_spikes() {
        let spikes = found(|k| {
            clean(k)
                + if [300, 700, 1200].contains(&k) {
                    50.0
                } else {
                    0.0
                }
        });
        assert_eq!((spikes.len(), spikes[0].rows, spikes[0].row), (1, 3, 302));
        assert!((spikes[0].largest - 50.0).abs() < 1.0, "{spikes:?}");
    }

    #[test]
    fn noise_steps_chatter_and_gaps_are_no_spikes() {
        assert_eq!(found(clean), []);
        // friction turns its sign
        assert_eq!(
            found(|k| clean(k) + if k % 400 < 200 { 30.0 } else { -30.0 }),
            []
        );
        // two rows in five
        assert_eq!(found(|k| clean(k) + if k % 5 < 2 { 30.0 } else { 0.0 }), []);
        // one row in nineteen, of more than are kept
        let chatter = |k: usize| clean(k) + if k.is_multiple_of(19) { 50.0 } else { 0.0 };
        assert_eq!(found_in(40_000, chatter), []);
        // a stretch with more noise
        let noise = |k: usize| 60.0 * (((k * 7919) % 1009) as f64 / 1009.0 - 0.5);
        let noisy = |k: usize| clean(k) + if k / 100 == 7 { noise(k) } else { 0.0 };
        assert_eq!(found(noisy), []);
        // the row behind the gap and the one before it are not neighbours
        assert_eq!(found(|k| clean(k) + if k == 1000 { 50.0 } else { 0.0 }), []);
        // an effort at rest that is measured in steps
        assert_eq!(found(|k| if k % 3 == 0 { 0.01 } else { 0.0 }), []);
    }
}
