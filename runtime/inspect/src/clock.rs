//! The clock of a log: its rate, how even its steps are, and where rows are missing.

use serde::Serialize;

/// A step longer than this many usual ones is a gap.
const GAP_STEPS: f64 = 3.0;
/// The part of the usual step by which steps of an even clock differ at most: filters refuse more.
const EVEN_PART: f64 = 0.1;
/// The largest number of steps that are stored, spread over the whole log.
const MAX_STEPS: usize = 8192;
/// The largest number of gaps that are listed.
const LISTED_GAPS: usize = 10;

/// Where the times of the rows come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ClockSource {
    /// A column of the log.
    Column,
    /// The stated rate.
    Rate,
    /// The velocities, at the rate at which their integrals are the changes of the positions.
    Velocities,
    /// Nothing gives the time: frequencies are per row and not in Hz.
    #[default]
    Unknown,
}

/// A place where rows are missing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Gap {
    /// The line of a CSV file, or the row of another, behind the gap.
    pub row: u64,
    /// The length of the gap, s.
    pub seconds: f64,
}

/// The clock of a log.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Clock {
    /// Where the times come from.
    pub source: ClockSource,
    /// The number of the column of time, from 1.
    pub column: Option<usize>,
    /// The unit of that column.
    pub unit: &'static str,
    /// The first and the last time, s.
    pub span: [f64; 2],
    /// The median rate, Hz; rows per row where nothing gives the time.
    pub rate: f64,
    /// The smallest and the largest step between rows without a gap, s.
    pub steps: [f64; 2],
    /// The standard deviation of these steps, s.
    pub jitter: f64,
    /// Whether all of these steps differ from the usual one by less than a tenth, as filters need.
    pub even: bool,
    /// The number of gaps: steps of more than three usual ones.
    pub gaps: usize,
    /// The first gaps.
    pub first_gaps: Vec<Gap>,
    /// The number of rows whose time is not after that of the row before.
    pub backwards: usize,
}

/// The median of some numbers; 0 without any.
pub(crate) fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

/// Computes the clock of a log row by row.
#[derive(Clone, Debug)]
pub(crate) struct ClockPass {
    usual: f64,
    first: Option<f64>,
    last: Option<f64>,
    /// Every `every`-th step, for the median.
    stored: Vec<f64>,
    every: usize,
    /// The number of steps so far, without gaps.
    count: usize,
    /// The sums of their differences from the usual step, and of the squares of these.
    sums: [f64; 2],
    /// The smallest and the largest of them, s.
    ends: [f64; 2],
    clock: Clock,
}

impl ClockPass {
    /// Starts without rows.
    ///
    /// - `usual`: the median step of the first rows, s.
    pub(crate) fn new(usual: f64) -> Self {
        Self {
            usual,
            first: None,
            last: None,
            stored: Vec::new(),
            every: 1,
            count: 0,
            sums: [0.0; 2],
            ends: [f64::INFINITY, f64::NEG_INFINITY],
            clock: Clock::default(),
        }
    }

    /// Adds the row at this time; returns whether it follows the one before without a gap.
    pub(crate) fn push(&mut self, row: u64, time: f64) -> bool {
        let Some(last) = self.last.replace(time) else {
            self.first = Some(time);
            return false;
        };
        let step = time - last;
        if step <= 0.0 || step.is_nan() {
            self.clock.backwards += 1;
            return false;
        }
        if step > GAP_STEPS * self.usual {
            self.clock.gaps += 1;
            if self.clock.first_gaps.len() < LISTED_GAPS {
                self.clock.first_gaps.push(Gap { row, seconds: step });
            }
            return false;
        }
        if self.count.is_multiple_of(self.every) {
            self.stored.push(step);
            if self.stored.len() == MAX_STEPS {
                self.every *= 2;
                let mut k = 0;
                self.stored.retain(|_| {
                    k += 1;
                    k % 2 == 1
                });
            }
        }
        self.count += 1;
        let off = step - self.usual;
        self.sums[0] += off;
        self.sums[1] += off * off;
        self.ends = [self.ends[0].min(step), self.ends[1].max(step)];
        true
    }

    pub(crate) fn finish(self) -> Clock {
        let n = self.count.max(1) as f64;
        let mean = self.sums[0] / n;
        let median = median(&self.stored);
        let far = |step: f64| (step - median).abs() > EVEN_PART * median;
        let steps = if self.count == 0 { [0.0; 2] } else { self.ends };
        Clock {
            span: [self.first.unwrap_or(0.0), self.last.unwrap_or(0.0)],
            rate: if median > 0.0 { 1.0 / median } else { 0.0 },
            steps,
            jitter: (self.sums[1] / n - mean * mean).max(0.0).sqrt(),
            even: !steps.into_iter().any(far),
            ..self.clock
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rate_jitter_gaps_and_steps_back_are_found() {
        let mut pass = ClockPass::new(0.01);
        let mut time = 5.0;
        let mut follows = 0;
        for k in 0..1000_u64 {
            time += match k {
                300 => 0.5,
                600 => -0.002,
                k if k % 4 == 0 => 0.012,
                _ => 0.01,
            };
            follows += usize::from(pass.push(k + 2, time));
        }
        let clock = pass.finish();
        assert_eq!(follows, 997);
        assert!((clock.rate - 100.0).abs() < 1e-6 && !clock.even);
        assert_eq!((clock.gaps, clock.backwards), (1, 1));
        assert_eq!(clock.first_gaps[0].row, 302);
        assert!((clock.first_gaps[0].seconds - 0.5).abs() < 1e-9);
        // steps of 10 ms, a quarter of them of 12
        assert!((clock.jitter - 0.002 * (3.0_f64 / 16.0).sqrt()).abs() < 1e-5);
    }
}
