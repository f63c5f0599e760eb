//! The first pass over a log: range, extremes, encoder step and monotonicity of every column.

use regen_identify::data::{DataError, Differences, Encoder, RawLog};
use serde::Serialize;

use crate::clock::median;

/// The number of rises from which the usual rise of a column is computed.
const STEP_ROWS: usize = 1001;
/// The largest number of problems that are listed.
const LISTED_PROBLEMS: usize = 5;

/// How often a column is at one of its extremes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Extreme {
    /// The value.
    pub value: f64,
    /// The share of the rows with this value, from 0 to 1.
    pub share: f64,
    /// The largest number of consecutive rows with this value.
    pub longest: usize,
}

/// Counts the rows at the largest value so far.
#[derive(Clone, Copy, Debug, Default)]
struct Highest {
    value: Option<f64>,
    count: usize,
    run: usize,
    longest: usize,
}

impl Highest {
    fn push(&mut self, value: f64) {
        if self.value.is_none_or(|most| value > most) {
            *self = Self {
                value: Some(value),
                ..Self::default()
            };
        }
        #[allow(clippy::float_cmp, reason = "a signal at its bound repeats exactly")]
        if self.value == Some(value) {
            self.count += 1;
            self.run += 1;
            self.longest = self.longest.max(self.run);
        } else {
            self.run = 0;
        }
    }

    fn extreme(self, rows: usize) -> Extreme {
        Extreme {
            value: self.value.unwrap_or(0.0),
            share: self.count as f64 / rows.max(1) as f64,
            longest: self.longest,
        }
    }
}

/// The results of the first pass for a column.
#[derive(Clone, Debug, Default)]
pub(crate) struct Survey {
    pub(crate) low: Extreme,
    pub(crate) high: Extreme,
    pub(crate) encoder: Encoder,
    /// The share of rows whose value is larger than that of the row before.
    pub(crate) rising: f64,
    /// The share of rows whose value is smaller than that of the row before.
    pub(crate) falling: f64,
    /// The median of the first rises.
    pub(crate) usual_rise: f64,
    /// The standard deviation over the log.
    pub(crate) deviation: f64,
}

impl Survey {
    pub(crate) fn is_constant(&self) -> bool {
        self.low.value >= self.high.value
    }
}

/// The results of the first pass.
#[derive(Clone, Debug, Default)]
pub(crate) struct Surveyed {
    pub(crate) rows: usize,
    /// The number of rows that cannot be used.
    pub(crate) unusable: usize,
    /// The problems of the first of these, in words.
    pub(crate) problems: Vec<String>,
    /// The time as the reader finds it, then the columns that have numbers.
    pub(crate) columns: Vec<Survey>,
}

/// Accumulates the survey of one column.
#[derive(Clone, Debug, Default)]
struct Pass {
    highest: Highest,
    /// The highest of the negated values.
    lowest: Highest,
    differences: Differences,
    first: f64,
    last: Option<f64>,
    sums: [f64; 2],
    rising: usize,
    falling: usize,
    rises: Vec<f64>,
}

impl Pass {
    fn push(&mut self, value: f64) {
        self.highest.push(value);
        self.lowest.push(-value);
        self.differences.push(value, self.last.is_some());
        match self.last {
            None => self.first = value,
            Some(last) if value > last => {
                self.rising += 1;
                if self.rises.len() < STEP_ROWS {
                    self.rises.push(value - last);
                }
            }
            Some(last) => self.falling += usize::from(value < last),
        }
        let off = value - self.first;
        self.sums[0] += off;
        self.sums[1] += off * off;
        self.last = Some(value);
    }

    fn finish(self, rows: usize) -> Survey {
        let n = rows.max(1) as f64;
        let low = self.lowest.extreme(rows);
        let mean = self.sums[0] / n;
        Survey {
            low: Extreme {
                value: -low.value,
                ..low
            },
            high: self.highest.extreme(rows),
            encoder: self.differences.finish(),
            rising: self.rising as f64 / n,
            falling: self.falling as f64 / n,
            usual_rise: median(&self.rises),
            deviation: (self.sums[1] / n - mean * mean).max(0.0).sqrt(),
        }
    }
}

/// Makes the first pass over a log.
///
/// # Errors
/// If a file cannot be read.
pub(crate) fn survey(log: &RawLog) -> Result<Surveyed, DataError> {
    let mut out = Surveyed::default();
    let mut passes = vec![Pass::default(); log.numbers().len() + 1];
    log.visit(&mut |row| match row {
        Ok((_, values)) => {
            out.rows += 1;
            for (pass, value) in passes.iter_mut().zip(values) {
                pass.push(*value);
            }
        }
        Err(problem) => {
            out.unusable += 1;
            if out.problems.len() < LISTED_PROBLEMS {
                out.problems.push(problem.to_string());
            }
        }
    })?;
    let rows = out.rows;
    out.columns = passes.into_iter().map(|pass| pass.finish(rows)).collect();
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_at_its_bound_has_a_large_share_and_a_long_run() {
        let mut pass = Pass::default();
        for k in 0..1000 {
            let swing = 3.0 * (0.05 * f64::from(k)).sin();
            pass.push(swing.clamp(-4.0, 2.0));
        }
        let found = pass.finish(1000);
        // a sine of amplitude 3 is above 2 for this part of a period
        let share = 0.5 - (2.0_f64 / 3.0).asin() / std::f64::consts::PI;
        assert!((found.high.share - share).abs() < 0.02, "{found:?}");
        assert!(found.high.longest > 20 && found.low.longest == 1);
        assert!((found.low.value + 3.0).abs() < 0.01);
    }

    #[test]
    fn rows_that_repeat_a_value_neither_rise_nor_fall() {
        let mut pass = Pass::default();
        for value in [1.0, 1.0, 1.0, 2.0, 2.0, 0.0, 0.0, 0.0] {
            pass.push(value);
        }
        let found = pass.finish(8);
        assert_eq!((found.rising, found.falling), (0.125, 0.125));
    }
}
