//! Brings rows with an uneven clock onto an even grid of times, so that their spectra show the noise
//! of the values and not the unevenness of the clock.
//!
//! Interpolation between rows would smooth the noise as well. Each value is therefore that of the
//! nearest row, moved along a cubic that is fitted to the rows around it: it has all of that row's
//! noise, and hardly any of that of the others.

/// The number of rows on either side of the nearest one that the cubic is fitted to.
const SIDE: usize = 3;
/// The number of coefficients of the cubic.
const COEFFICIENTS: usize = 4;
/// The least number of rows that a cubic is fitted to; with fewer, values are those of the nearest
/// row.
const MIN_ROWS: usize = COEFFICIENTS + 1;
/// The number of rows that are kept until they are passed on.
const BLOCK: usize = 1024;

/// A row that is by less than this many steps before the last one is left out.
const REPEATED_STEPS: f64 = 3.0;

/// Receives a row on the grid: the line of the nearest row of the log, whether it follows the row
/// before without a gap, its time in s, and its values.
pub(crate) type Receive<'a> = dyn FnMut(u64, bool, f64, &[f64]) + 'a;

/// Rows on their way to an even grid.
#[derive(Clone, Debug)]
pub(crate) struct Regrid {
    step: f64,
    rows: Vec<(u64, f64, Vec<f64>)>,
    /// The time of the first row behind the last gap.
    origin: f64,
    /// The number of grid points behind it so far.
    count: usize,
}

impl Regrid {
    /// - `step`: the step of the grid, s.
    pub(crate) fn new(step: f64) -> Self {
        Self {
            step,
            rows: Vec::new(),
            origin: 0.0,
            count: 0,
        }
    }

    /// Takes a row of the log, and passes rows on if enough have come.
    ///
    /// - `follows`: whether the row follows the one before without a gap.
    pub(crate) fn push(
        &mut self,
        line: u64,
        follows: bool,
        time: f64,
        values: &[f64],
        receive: &mut Receive<'_>,
    ) {
        // such a row is repeated or exchanged with its neighbour, and is no gap
        if let Some((_, last, _)) = self.rows.last()
            && time <= *last
            && time > last - REPEATED_STEPS * self.step
        {
            return;
        }
        if !follows {
            self.finish(receive);
            self.origin = time;
        }
        self.rows.push((line, time, values.to_vec()));
        if self.rows.len() >= BLOCK {
            let until = self.rows[self.rows.len() - 1 - SIDE].1;
            self.pass(until, receive);
            let gone = self.nearest(self.next()).saturating_sub(2 * SIDE);
            self.rows.drain(..gone);
        }
    }

    /// Passes on what is left, and forgets all rows: at a gap, or at the end of the log.
    pub(crate) fn finish(&mut self, receive: &mut Receive<'_>) {
        if let Some(last) = self.rows.last() {
            self.pass(last.1, receive);
        }
        self.rows.clear();
        self.count = 0;
    }

    /// The time of the next grid point, s.
    fn next(&self) -> f64 {
        self.origin + self.count as f64 * self.step
    }

    /// The index of the row whose time is nearest; the times ascend.
    fn nearest(&self, time: f64) -> usize {
        let after = self.rows.partition_point(|row| row.1 < time);
        let off = |k: usize| {
            self.rows
                .get(k)
                .map_or(f64::INFINITY, |r| (r.1 - time).abs())
        };
        match after.checked_sub(1) {
            Some(before) if off(before) <= off(after) => before,
            _ => after,
        }
    }

    /// Passes on the grid points up to a time.
    fn pass(&mut self, until: f64, receive: &mut Receive<'_>) {
        // the grid's last point may be beyond the last row by rounding
        while self.next() <= until + 1e-6 * self.step {
            let time = self.next();
            let near = self.nearest(time);
            let Some((line, at, values)) = self.rows.get(near) else {
                return;
            };
            let from = near.saturating_sub(SIDE);
            let around = &self.rows[from..(near + SIDE + 1).min(self.rows.len())];
            let places: Vec<f64> = around.iter().map(|r| (r.1 - time) / self.step).collect();
            let factors = shift_factors(&places, (at - time) / self.step);
            let mut out = values.clone();
            for (factor, (_, _, values)) in factors.iter().zip(around) {
                for (out, value) in out.iter_mut().zip(values) {
                    *out += factor * value;
                }
            }
            // the factors add up to zero but for rounding: a column that rests is left exactly as it is
            for (k, out) in out.iter_mut().enumerate() {
                #[allow(clippy::float_cmp, reason = "only exact repetitions are rest")]
                let rests = around.iter().all(|row| row.2.get(k) == values.get(k));
                if let (true, Some(value)) = (rests, values.get(k)) {
                    *out = *value;
                }
            }
            receive(*line, self.count > 0, time, &out);
            self.count += 1;
        }
    }
}

/// The factors with which the values of some rows make up the difference between the cubic that
/// fits them best at 0 and at another place; empty with too few rows.
///
/// - `places`: where the rows are.
fn shift_factors(places: &[f64], from: f64) -> Vec<f64> {
    if places.len() < MIN_ROWS {
        return Vec::new();
    }
    // polynomials that are orthogonal on the places: each times the place, less the parts of those
    // before it; the values at the rows are followed by those at 0 and at the other place
    let n = places.len();
    let all: Vec<f64> = places.iter().copied().chain([0.0, from]).collect();
    let mut found: Vec<Vec<f64>> = vec![vec![1.0; n + 2]];
    let product =
        |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).take(n).map(|(a, b)| a * b).sum() };
    let mut out = vec![0.0; n];
    for _ in 1..COEFFICIENTS {
        let Some(last) = found.last() else { break };
        let mut next: Vec<f64> = last.iter().zip(&all).map(|(p, x)| p * x).collect();
        for own in &found {
            let part = product(&next, own) / product(own, own);
            for (next, own) in next.iter_mut().zip(own) {
                *next -= part * own;
            }
        }
        let change = next[n] - next[n + 1];
        let size = product(&next, &next);
        // rows at equal times have no cubic
        if size.is_nan() || size <= 0.0 {
            break;
        }
        for (out, own) in out.iter_mut().zip(&next) {
            *out += own * change / size;
        }
        found.push(next);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Noise;

    /// The values on the grid of a function of time, logged at uneven times with noise.
    fn regridded(f: impl Fn(f64) -> f64, sigma: f64) -> (Vec<f64>, Vec<f64>) {
        let mut noise = Noise::new(4);
        let mut grid = Regrid::new(0.01);
        let (mut times, mut values) = (Vec::new(), Vec::new());
        let mut receive = |_: u64, _: bool, time: f64, row: &[f64]| {
            times.push(time);
            values.push(row[0]);
        };
        for k in 0..5000_u64 {
            let t = 0.01 * k as f64
                + if k > 0 {
                    0.004 * (noise.even() - 0.5)
                } else {
                    0.0
                };
            grid.push(k, k > 0, t, &[f(t) + sigma * noise.normal()], &mut receive);
        }
        grid.finish(&mut receive);
        (times, values)
    }

    #[test]
    fn a_motion_is_that_at_the_times_of_the_grid() {
        let (times, values) = regridded(|t| (9.0 * t).sin(), 0.0);
        assert!(times.len() >= 4999);
        for (k, (t, value)) in times.iter().zip(&values).enumerate() {
            assert!((t - 0.01 * k as f64).abs() < 1e-9);
            // the error of a cubic over 0.06 s; that of the nearest row alone is 9 rad/s times 2 ms
            assert!((value - (9.0 * t).sin()).abs() < 2e-5, "{t} {value}");
        }
    }

    #[test]
    fn rows_that_repeat_a_time_are_left_out_and_break_nothing() {
        let mut grid = Regrid::new(0.01);
        let mut breaks = 0;
        let mut receive = |_: u64, follows: bool, time: f64, row: &[f64]| {
            breaks += usize::from(!follows);
            assert!((row[0] - time).abs() < 1e-9);
        };
        for k in 0..3000_u64 {
            let t = 0.01 * k as f64;
            grid.push(k, k > 0, t, &[t], &mut receive);
            if k % 100 == 50 {
                grid.push(k, false, t, &[9.0], &mut receive);
            }
        }
        grid.finish(&mut receive);
        assert_eq!(breaks, 1);
    }

    #[test]
    fn noise_is_neither_smoothed_nor_increased() {
        let (_, values) = regridded(|_| 0.0, 1.0);
        let variance = values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64;
        // of 5000 values the rms has a standard deviation of 1 %, and the slope adds as much
        assert!((variance.sqrt() - 1.0).abs() < 0.05, "{variance}");
    }
}
