//! Interpolates rows of uneven steps onto an even grid of times, and signals between samples.
//!
//! Positions, velocities and efforts are all interpolated by the cubic through the two samples on
//! either side. A line would take from a signal of frequency f, sampled every h, the part
//! `(pi f h)^2 / 3` between the samples (1 % at 5 Hz and 100 Hz), the cubic one of fourth order;
//! and if the efforts were interpolated by lines and the positions by cubics, the two sides of the
//! equations of motion would be smoothed differently, which biases the parameters.

use std::collections::VecDeque;

use super::problem::DataError;
use super::reader::{EffortSet, LogRow, RowSink};

/// Rows that one is interpolated between: two on either side.
const POINTS: usize = 4;
/// How far after the last row a time of the grid may be, in steps of the grid, because of rounding.
const TIME_TOLERANCE: f64 = 1e-6;

/// The value at time `t` of the polynomial through samples, relative to that of the sample `near`
/// (an index), so that a constant signal stays exactly constant.
///
/// - `points`: times and values.
pub(super) fn polynomial(points: &[(f64, f64)], near: usize, t: f64) -> f64 {
    let Some(&(_, middle)) = points.get(near) else {
        return f64::NAN;
    };
    let mut sum = 0.0;
    for (i, (own, value)) in points.iter().enumerate() {
        let mut part = value - middle;
        for (j, (other, _)) in points.iter().enumerate() {
            if i != j {
                part *= (t - other) / (own - other);
            }
        }
        sum += part;
    }
    middle + sum
}

/// The entries at time `t`, between the rows `left` and `left + 1` of some consecutive ones.
///
/// - `rows`: times with entries, at least those two; of more than four, the nearest ones count.
pub(super) fn between(rows: &VecDeque<(f64, Vec<f64>)>, left: usize, t: f64) -> Vec<f64> {
    let start = left.saturating_sub(1);
    let end = (left + 3).min(rows.len());
    let entries = rows.get(left).map_or(0, |row| row.1.len());
    let mut points = Vec::with_capacity(POINTS);
    let value = |entry: usize| {
        points.clear();
        for (time, values) in rows.range(start..end) {
            points.push((*time, values.get(entry).copied().unwrap_or(f64::NAN)));
        }
        polynomial(&points, left - start, t)
    };
    (0..entries).map(value).collect()
}

/// Rows of a log on an even grid, which starts with the first row.
pub(super) struct Resampler {
    step: f64,
    /// The time of the first row, s.
    start: Option<f64>,
    /// The time of the last row, s.
    last: Option<f64>,
    /// The number of the next time of the grid.
    next: u64,
    /// The last rows of the present segment: time and the other entries.
    recent: VecDeque<(f64, Vec<f64>)>,
    /// The lines of these rows, and whether they are interpolated across a gap.
    lines: VecDeque<(u64, bool, EffortSet)>,
    /// Whether the next row of the grid follows the last one without a gap.
    follows: bool,
}

impl Resampler {
    /// A grid of this rate, Hz.
    pub(super) fn new(rate: f64) -> Self {
        Self {
            step: 1.0 / rate,
            start: None,
            last: None,
            next: 0,
            recent: VecDeque::with_capacity(POINTS),
            lines: VecDeque::with_capacity(POINTS),
            follows: false,
        }
    }

    /// Adds the next row of the log, and calls `each` with the rows of the grid that are now known.
    pub(super) fn push(
        &mut self,
        row: &LogRow,
        follows: bool,
        each: &mut RowSink<'_>,
    ) -> Result<(), DataError> {
        if !follows {
            self.finish(each)?;
        }
        let Some((&time, values)) = row.values.split_first() else {
            return Ok(());
        };
        // where the clock was set back, the grid begins anew
        if self.last.replace(time).is_some_and(|last| time < last) {
            (self.start, self.next) = (None, 0);
        }
        self.start.get_or_insert(time);
        if self.recent.len() == POINTS {
            self.recent.pop_front();
            self.lines.pop_front();
        }
        self.recent.push_back((time, values.to_vec()));
        self.lines.push_back((row.line, row.bridged, row.unknown));
        // a time is known once there are two rows after it
        match self.recent.len().checked_sub(3) {
            Some(left) => self.emit(left, each),
            None => Ok(()),
        }
    }

    /// Calls `each` with the remaining rows of a segment, after which there is a gap.
    pub(super) fn finish(&mut self, each: &mut RowSink<'_>) -> Result<(), DataError> {
        if let Some(left) = self.recent.len().checked_sub(2) {
            self.emit(left, each)?;
        }
        self.recent.clear();
        self.lines.clear();
        self.follows = false;
        Ok(())
    }

    /// Calls `each` with the rows of the grid up to the row after the recent row `left`.
    fn emit(&mut self, left: usize, each: &mut RowSink<'_>) -> Result<(), DataError> {
        /// The number of steps up to which each time has a number of its own: 2^53.
        const MOST: f64 = 9_007_199_254_740_992.0;
        let (Some((before, _)), Some((after, _)), Some(mut start)) =
            (self.recent.get(left), self.recent.get(left + 1), self.start)
        else {
            return Ok(());
        };
        let (before, after) = (*before, *after);
        let tolerance = TIME_TOLERANCE * self.step;
        // a gap leaves out the times within it
        let mut passed = ((before - tolerance - start) / self.step).ceil();
        if passed >= MOST {
            // after so long a gap the grid begins anew
            (self.start, self.next) = (Some(before), 0);
            (start, passed) = (before, 0.0);
        }
        #[allow(
            clippy::cast_sign_loss,
            reason = "the next line replaces negative numbers by 0"
        )]
        let passed = passed.max(0.0) as u64;
        if passed > self.next {
            self.next = passed;
        }
        loop {
            let time = start + self.next as f64 * self.step;
            if time > after + tolerance {
                return Ok(());
            }
            self.next += 1;
            let mut values = between(&self.recent, left, time);
            values.insert(0, time);
            let (line, ..) = self.lines.get(left).copied().unwrap_or_default();
            let mut row = LogRow {
                line,
                values,
                ..LogRow::default()
            };
            for (_, bridged, unknown) in self.lines.iter().skip(left).take(2) {
                row.bridged |= bridged;
                row.unknown = row.unknown.or(*unknown);
            }
            each(&row, self.follows)?;
            self.follows = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rows of the grid from times and values of a log, whose gaps are before the marked rows.
    fn grid(rate: f64, rows: &[(f64, f64)], gaps: &[usize]) -> Vec<(f64, f64, bool)> {
        let mut out = Vec::new();
        let mut each = |row: &LogRow, follows: bool| {
            out.push((row.values[0], row.values[1], follows));
            Ok(())
        };
        let mut resampler = Resampler::new(rate);
        for (k, (t, x)) in rows.iter().enumerate() {
            let row = LogRow {
                line: k as u64,
                values: vec![*t, *x],
                ..LogRow::default()
            };
            let follows = k > 0 && !gaps.contains(&k);
            resampler.push(&row, follows, &mut each).unwrap();
        }
        resampler.finish(&mut each).unwrap();
        out
    }

    /// A clock of steps of 10 and 12 ms.
    fn uneven(count: u32) -> Vec<f64> {
        let mut t = 5.0;
        let mut step = |k: u32| {
            t += if k.is_multiple_of(3) { 0.012 } else { 0.01 };
            t
        };
        (0..count).map(&mut step).collect()
    }

    #[test]
    fn the_grid_begins_anew_after_a_gap_that_has_no_number_of_steps() {
        let rows = [(0.0, 1.0), (0.5, 2.0), (1e300, 3.0)];
        assert_eq!(
            grid(2.0, &rows, &[2]),
            [(0.0, 1.0, false), (0.5, 2.0, true)]
        );
        let rows = [(0.0, 1.0), (0.5, 2.0), (1e17, 3.0), (1e17 + 16.0, 4.0)];
        let found = grid(0.125, &rows, &[2]);
        assert_eq!(found.len(), 4);
        assert_eq!(
            (found[1], found[3]),
            ((1e17, 3.0, false), (1e17 + 16.0, 4.0, true))
        );
    }

    #[test]
    fn the_grid_has_the_exact_values_of_a_cubic_and_of_a_constant() {
        let cubic = |t: f64| 2.0 - t + 3.0 * (t - 5.0).powi(2) - 5.0 * (t - 5.0).powi(3);
        let times = uneven(200);
        let rows: Vec<(f64, f64)> = times.iter().map(|t| (*t, cubic(*t))).collect();
        let found = grid(100.0, &rows, &[]);
        let last = times[times.len() - 1];
        let whole = ((last - times[0]) / 0.01 + 1e-6).floor();
        assert!((found.len() as f64 - 1.0 - whole).abs() < 0.5);
        assert!(!found[0].2 && found[1..].iter().all(|row| row.2));
        for (k, (t, x, _)) in found.iter().enumerate() {
            assert!((t - times[0] - 0.01 * k as f64).abs() < 1e-9);
            // the ends have a neighbour on one side only
            if (1..found.len() - 2).contains(&k) {
                assert!((x - cubic(*t)).abs() < 1e-11, "{k}");
            }
        }
        let constant: Vec<(f64, f64)> = times.iter().map(|t| (*t, 0.1)).collect();
        assert!(
            grid(100.0, &constant, &[])
                .iter()
                .all(|row| row.1.to_bits() == 0.1_f64.to_bits())
        );
    }

    #[test]
    fn nothing_is_interpolated_over_a_gap_and_the_grid_continues_after_it() {
        let mut rows: Vec<(f64, f64)> = (0..10).map(|k| (0.01 * f64::from(k), 0.0)).collect();
        rows.extend((0..10).map(|k| (1.003 + 0.01 * f64::from(k), 1.0)));
        let found = grid(100.0, &rows, &[10]);
        assert!(found.iter().all(|(t, x, _)| (*t < 0.5) == (*x == 0.0)));
        let second = found.iter().position(|row| row.0 > 0.5).unwrap();
        assert_eq!(second, 10);
        assert!((found[second].0 - 1.01).abs() < 1e-9 && !found[second].2 && found[second + 1].2);
        // finer grids have more rows than the log
        assert_eq!(grid(200.0, &rows[..10], &[]).len(), 19);
    }
}
