//! Bridges gaps and dropouts that are shorter than the memory of a filter.
//!
//! A filter that runs over evenly spaced rows starts anew behind a gap, and gives nothing until it has
//! settled: with a gap every second, it gives nothing at all. So the missing entries of short gaps are
//! interpolated by a polynomial through the rows on both sides. Only the filter of the states uses
//! them; rows with them are marked, and give no equation.

use std::collections::VecDeque;

use nalgebra::{DMatrix, DVector};

use super::problem::DataError;
use super::reader::{LogRow, RowSink};
use crate::signals::Method;

/// The longest gap that is bridged, in periods of the filter's cutoff frequency: half a period of the
/// fastest motion that passes.
const BRIDGED_PERIODS: f64 = 1.0;
/// The same for a local regression, in half widths of its window.
const BRIDGED_WIDTHS: f64 = 0.5;
/// The least number of rows on either side of a gap that it is interpolated from.
const MIN_SIDE: usize = 5;
/// The largest number of these rows.
const MAX_SIDE: usize = 256;
/// The degrees of the polynomials of positions, the highest one first.
const DEGREES: [usize; 3] = [7, 5, 3];
/// A polynomial of a lower degree is used if its residuals have at most this many times the variance of
/// the one of the highest degree: it passes less noise.
const MAX_VARIANCE_RATIO: f64 = 1.1;
/// The largest number of rows that are held until the rows after a gap suffice.
const MAX_PENDING: usize = 8192;
/// How far a step may be from the usual one, as a part of it; the filter allows no more.
const STEP_TOLERANCE: f64 = 0.1;
/// Times are sums of rounded steps.
const TIME_TOLERANCE: f64 = 1e-9;

/// How gaps are bridged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bridging {
    /// The longest gap that is bridged, from the row before to the row after, s.
    pub(super) longest: f64,
    /// Whether rows are interpolated: a local regression needs none.
    pub(super) interpolates: bool,
    /// Whether rows need even steps.
    pub(super) even: bool,
}

impl Bridging {
    /// How gaps are bridged with this method; `None` if it has no memory.
    ///
    /// - `even`: whether its rows need even steps.
    pub(super) fn of(method: Method, even: bool) -> Option<Self> {
        match method {
            Method::Butterworth { cutoff, .. } => Some(Self {
                longest: BRIDGED_PERIODS / cutoff,
                interpolates: true,
                even,
            }),
            Method::Local { half_width } => Some(Self {
                longest: BRIDGED_WIDTHS * half_width,
                interpolates: false,
                even: false,
            }),
            Method::Central | Method::Fourier { .. } => None,
        }
    }

    /// The number of rows that are missing in a step of time that is bridged; `None` if it is not, or if they are
    /// more than are held.
    ///
    /// - `step`: from the row before to the row after, s; `usual`: the usual step, s.
    pub(super) fn missing_rows(self, step: f64, usual: f64) -> Option<usize> {
        if !self.spans(step) || self.even && !is_even(step, usual) {
            return None;
        }
        let steps = (step / usual).round();
        #[allow(clippy::cast_sign_loss, reason = "at least 1")]
        (steps <= MAX_PENDING as f64).then(|| steps.max(1.0) as usize - 1)
    }

    /// Whether a gap of this length is bridged, s.
    pub(super) fn spans(self, seconds: f64) -> bool {
        seconds > 0.0 && seconds <= self.longest * (1.0 + TIME_TOLERANCE)
    }
}

/// Whether a step of time is a whole number of usual ones.
pub(super) fn is_even(step: f64, usual: f64) -> bool {
    let steps = (step / usual).round();
    steps >= 1.0 && (step / usual / steps - 1.0).abs() <= STEP_TOLERANCE
}

/// How many gaps and dropouts of a log were bridged, and at how many it was divided.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bridged {
    /// The number of gaps and dropouts that were bridged.
    pub count: usize,
    /// The number of rows in them that are missing or have repeated entries.
    pub rows: usize,
    /// The number of rows of the largest one.
    pub largest: usize,
    /// The number of gaps and dropouts at which the log was divided.
    pub cuts: usize,
    /// The longest time that is bridged, s; 0 if none is.
    pub longest: f64,
}

impl Bridged {
    /// Counts a gap or dropout of so many rows that was bridged.
    pub(super) fn add(&mut self, rows: usize) {
        self.count += 1;
        self.rows += rows;
        self.largest = self.largest.max(rows);
    }
}

/// Rows whose missing entries, which are NaN, are interpolated.
pub(super) struct Bridge {
    bridging: Bridging,
    /// The usual step, s.
    step: f64,
    /// The entries that are positions or their derivatives.
    motion: core::ops::Range<usize>,
    /// The number of rows on either side that are kept.
    side: usize,
    /// The last complete rows before those that wait.
    before: VecDeque<LogRow>,
    /// Rows that wait, the first of which is incomplete.
    waiting: Vec<LogRow>,
    /// The number of complete rows at the end of those that wait, and of incomplete ones.
    after: usize,
    missing: usize,
    /// Whether the next row that is passed on follows the last one.
    follows: bool,
    /// The time of the last row, s.
    last: Option<f64>,
    counts: Bridged,
}

impl Bridge {
    /// - `step`: the usual step, s; `motion`: the entries that are positions or their derivatives.
    pub(super) fn new(bridging: Bridging, step: f64, motion: core::ops::Range<usize>) -> Self {
        let longest = bridging.longest;
        #[allow(clippy::cast_sign_loss, reason = "clamped")]
        let side = (longest / step)
            .ceil()
            .clamp(MIN_SIDE as f64, MAX_SIDE as f64) as usize;
        Self {
            bridging,
            step,
            motion,
            side,
            before: VecDeque::with_capacity(side),
            waiting: Vec::new(),
            after: 0,
            missing: 0,
            follows: false,
            last: None,
            counts: Bridged {
                longest,
                ..Bridged::default()
            },
        }
    }

    /// Takes the next row, and passes on what is known by now.
    pub(super) fn push(
        &mut self,
        row: &LogRow,
        follows: bool,
        each: &mut RowSink<'_>,
    ) -> Result<(), DataError> {
        let time = row.values.first().copied().unwrap_or(f64::NAN);
        let last = self.last.replace(time);
        if let (false, Some(last)) = (follows, last) {
            let step = time - last;
            if let Some(missing) = self.bridging.missing_rows(step, self.step) {
                for k in 1..=missing {
                    let mut values = vec![f64::NAN; row.values.len()];
                    if let Some(first) = values.first_mut() {
                        *first = last + step * k as f64 / (missing + 1) as f64;
                    }
                    let between = LogRow {
                        line: row.line,
                        values,
                        bridged: true,
                        ..LogRow::default()
                    };
                    self.add(between, each)?;
                }
            } else {
                self.counts.cuts += usize::from(step > 0.0 && self.follows);
                self.end(each)?;
            }
        }
        // nearly all rows are complete, and none waits
        if self.waiting.is_empty() && is_complete(row) {
            each(row, self.follows)?;
            self.follows = true;
            self.remember(row);
            return Ok(());
        }
        self.add(row.clone(), each)
    }

    /// Ends the run before the next row.
    pub(super) fn divide(&mut self, each: &mut RowSink<'_>) -> Result<(), DataError> {
        self.last = None;
        self.end(each)
    }

    /// Passes on the rest.
    pub(super) fn finish(mut self, each: &mut RowSink<'_>) -> Result<Bridged, DataError> {
        self.end(each)?;
        Ok(self.counts)
    }

    /// Keeps a copy of a complete row, in the memory of the oldest one.
    fn remember(&mut self, row: &LogRow) {
        let mut own = if self.before.len() == self.side {
            self.before.pop_front().unwrap_or_default()
        } else {
            LogRow::default()
        };
        own.clone_from(row);
        self.before.push_back(own);
    }

    /// Adds a row to those that wait.
    fn add(&mut self, mut row: LogRow, each: &mut RowSink<'_>) -> Result<(), DataError> {
        let complete = is_complete(&row);
        row.bridged |= !complete;
        if !complete && self.waiting.is_empty() && self.before.len() < MIN_SIDE {
            // too little is known of the motion before
            self.cut();
            return Ok(());
        }
        let time = row.values.first().copied().unwrap_or(0.0);
        self.waiting.push(row);
        self.after = if complete { self.after + 1 } else { 0 };
        self.missing = if complete { 0 } else { self.missing + 1 };
        if !complete {
            let begin = self.waiting.len().checked_sub(self.missing + 1);
            let begin = begin
                .and_then(|begin| self.waiting.get(begin))
                .or(self.before.back())
                .and_then(|row| row.values.first());
            let longest = self.bridging.longest + 0.5 * self.step;
            if begin.is_some_and(|begin| time + self.step - begin > longest) {
                return self.end(each);
            }
        }
        if self.after >= self.side || self.waiting.len() >= MAX_PENDING {
            self.fill(each)?;
        }
        Ok(())
    }

    /// Ends the run: passes on what can be interpolated, and forgets incomplete rows at the end.
    fn end(&mut self, each: &mut RowSink<'_>) -> Result<(), DataError> {
        self.fill(each)?;
        self.cut();
        Ok(())
    }

    /// The next row that is passed on does not follow the last one.
    fn cut(&mut self) {
        self.before.clear();
        self.waiting.clear();
        (self.after, self.missing) = (0, 0);
        self.follows = false;
    }

    /// Interpolates the rows that wait, and passes them on.
    fn fill(&mut self, each: &mut RowSink<'_>) -> Result<(), DataError> {
        while self.waiting.last().is_some_and(|row| !is_complete(row)) {
            self.waiting.pop();
        }
        let mut waiting = core::mem::take(&mut self.waiting);
        // too few rows behind the last gap: they are a segment of their own
        let mut rest = Vec::new();
        if self.after < MIN_SIDE {
            let end = waiting
                .iter()
                .rposition(|row| !is_complete(row))
                .map_or(0, |k| k + 1);
            rest = waiting.split_off(end);
            while waiting.last().is_some_and(|row| !is_complete(row)) {
                waiting.pop();
            }
        }
        self.interpolate(&mut waiting);
        let mut gap = 0;
        for row in &waiting {
            if row.bridged {
                gap += 1;
            } else if gap > 0 {
                self.counts.add(core::mem::take(&mut gap));
            }
            each(row, self.follows)?;
            self.follows = true;
        }
        for row in waiting.iter().filter(|row| !row.bridged) {
            self.remember(row);
        }
        if !rest.is_empty() {
            self.cut();
            self.counts.cuts += 1;
            for row in &rest {
                each(row, self.follows)?;
                self.follows = true;
                self.remember(row);
            }
        }
        (self.after, self.missing) = (0, 0);
        Ok(())
    }

    /// Replaces the missing entries of rows.
    fn interpolate(&self, rows: &mut [LogRow]) {
        let width = rows.first().map_or(0, |row| row.values.len());
        for entry in 1..width {
            let value = |row: &LogRow| row.values.get(entry).copied().unwrap_or(f64::NAN);
            let time = |row: &LogRow| row.values.first().copied().unwrap_or(f64::NAN);
            let known: Vec<(f64, f64)> = self
                .before
                .iter()
                .chain(rows.iter())
                .map(|row| (time(row), value(row)))
                .filter(|(_, x)| x.is_finite())
                .collect();
            let mut place = 0;
            while place < rows.len() {
                let gap = rows[place..]
                    .iter()
                    .take_while(|row| value(row).is_nan())
                    .count();
                if gap == 0 {
                    place += 1;
                    continue;
                }
                let middle = known.partition_point(|(t, _)| *t < time(&rows[place]));
                let side = gap.clamp(MIN_SIDE, self.side);
                let around = &known[middle.saturating_sub(side)..(middle + side).min(known.len())];
                let fit = Polynomial::through(around, self.motion.contains(&entry));
                for row in &mut rows[place..place + gap] {
                    let t = time(row);
                    if let Some(slot) = row.values.get_mut(entry) {
                        *slot = fit.at(t);
                    }
                }
                place += gap;
            }
        }
    }
}

/// Whether no entry of a row is missing.
fn is_complete(row: &LogRow) -> bool {
    row.values.iter().all(|x| x.is_finite())
}

/// A polynomial in Legendre's ones over a range of time.
struct Polynomial {
    middle: f64,
    half: f64,
    /// The mean of the values.
    mean: f64,
    coefficients: Vec<f64>,
}

impl Polynomial {
    /// Fits a polynomial by least squares; a line if the values are not a smooth motion.
    fn through(points: &[(f64, f64)], is_motion: bool) -> Self {
        let (first, last) = (points.first(), points.last());
        let (a, b) = first.zip(last).map_or((0.0, 1.0), |(a, b)| (a.0, b.0));
        let count = points.len();
        let mut out = Self {
            middle: 0.5 * (a + b),
            half: (0.5 * (b - a)).max(f64::MIN_POSITIVE),
            mean: points.iter().map(|p| p.1).sum::<f64>() / count.max(1) as f64,
            coefficients: Vec::new(),
        };
        // a constant stays exactly constant
        if let Some((_, constant)) = first.filter(|own| {
            let mut others = points.iter();
            others.all(|other| other.1.to_bits() == own.1.to_bits())
        }) {
            out.mean = *constant;
            return out;
        }
        let degrees: &[usize] = if is_motion { &DEGREES } else { &[1] };
        // two points more than coefficients, so that residuals tell of the noise
        let most = count.saturating_sub(3).max(1);
        let mut best: Option<(f64, Vec<f64>)> = None;
        for degree in degrees.iter().map(|degree| (*degree).min(most)) {
            let rows = points
                .iter()
                .map(|(t, _)| legendre(degree, (t - out.middle) / out.half));
            let rows: Vec<Vec<f64>> = rows.collect();
            let w = DMatrix::from_fn(count, degree + 1, |i, j| rows[i][j]);
            let x = DVector::from_iterator(count, points.iter().map(|p| p.1 - out.mean));
            let Ok(found) = w.clone().svd(true, true).solve(&x, 1e-12) else {
                continue;
            };
            let rest = (&w * &found - x).norm_squared();
            let variance = rest / (count as f64 - degree as f64 - 1.0).max(1.0);
            let suffices = best
                .as_ref()
                .is_none_or(|(least, _)| variance <= MAX_VARIANCE_RATIO * least);
            if suffices {
                let least = best.as_ref().map_or(variance, |(least, _)| *least);
                best = Some((least, found.iter().copied().collect()));
            }
        }
        out.coefficients = best.map(|(_, found)| found).unwrap_or_default();
        out
    }

    fn at(&self, t: f64) -> f64 {
        let degree = self.coefficients.len().saturating_sub(1);
        let values = legendre(degree, (t - self.middle) / self.half);
        let terms = self.coefficients.iter().zip(values).map(|(c, p)| c * p);
        self.mean + terms.sum::<f64>()
    }
}

/// Legendre's polynomials up to a degree.
fn legendre(degree: usize, u: f64) -> Vec<f64> {
    let mut out = Vec::with_capacity(degree + 1);
    let (mut before, mut own) = (0.0, 1.0);
    for k in 0..=degree {
        out.push(own);
        let n = k as f64;
        let next = ((2.0 * n + 1.0) * u * own - n * before) / (n + 1.0);
        (before, own) = (own, next);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn legendre_polynomials_are_those_of_the_textbook() {
        let u = 0.4;
        let expected = [
            1.0,
            u,
            0.5 * (3.0 * u * u - 1.0),
            0.5 * (5.0 * u * u * u - 3.0 * u),
            0.125 * (35.0 * u * u * u * u - 30.0 * u * u + 3.0),
        ];
        let found = legendre(4, u);
        assert!(
            found
                .iter()
                .zip(expected)
                .all(|(a, b)| (a - b).abs() < 1e-15),
            "{found:?}"
        );
    }

    #[test]
    fn a_smooth_motion_is_bridged_exactly_and_an_effort_by_a_line() {
        let motion = |t: f64| 3.0 + t - 2.0 * t.powi(3) + t.powi(5) - 0.3 * t.powi(7);
        let times = (0..24).map(|k| 5.0 + 0.1 * f64::from(if k < 12 { k } else { k + 8 }));
        let points: Vec<(f64, f64)> = times.map(|t| (t, motion(t - 6.5))).collect();
        let fit = Polynomial::through(&points, true);
        for t in [6.2, 6.5, 6.9] {
            assert!((fit.at(t) - motion(t - 6.5)).abs() < 1e-9, "{t}");
        }
        let line: Vec<(f64, f64)> = points.iter().map(|(t, _)| (*t, 2.0 - 3.0 * t)).collect();
        let fit = Polynomial::through(&line, false);
        assert!((fit.at(6.5) - (2.0 - 3.0 * 6.5)).abs() < 1e-9);
        assert_eq!(fit.coefficients.len(), 2);
        // a constant stays so to the bit
        let still: Vec<(f64, f64)> = points.iter().map(|(t, _)| (*t, 0.1)).collect();
        assert!((Polynomial::through(&still, true).at(6.5) - 0.1).abs() <= 0.0);
    }

    #[test]
    fn noise_is_bridged_by_the_lowest_degree_that_leaves_as_little() {
        let mut random = crate::intervals::Random(3);
        let points: Vec<(f64, f64)> = (0..40)
            .map(|k| (0.1 * f64::from(k), 1e-3 * random.normal()))
            .collect();
        let fit = Polynomial::through(&points, true);
        assert_eq!(fit.coefficients.len(), 4);
        assert!(fit.at(2.0).abs() < 1e-3);
    }

    /// What a filter with a cutoff of 5 Hz makes of rows at these times, and the counts.
    fn bridged(rows: &[LogRow]) -> (Vec<(f64, bool)>, Bridged) {
        let bridging = Bridging::of(
            Method::Butterworth {
                order: 2,
                cutoff: 5.0,
            },
            true,
        );
        let mut out = Vec::new();
        let mut bridge = Bridge::new(
            bridging.unwrap_or(Bridging {
                longest: 0.0,
                interpolates: true,
                even: true,
            }),
            0.01,
            1..2,
        );
        let mut each = |row: &LogRow, follows: bool| {
            out.push((row.values[0], follows));
            assert!((row.values[1] - row.values[0].sin()).abs() < 1e-6 && !row.values[1].is_nan());
            Ok(())
        };
        let mut last: Option<f64> = None;
        for row in rows {
            let time = row.values[0];
            let follows = last.is_some_and(|last| time - last < 0.015);
            assert!(bridge.push(row, follows, &mut each).is_ok());
            last = Some(time);
        }
        let counts = bridge.finish(&mut each);
        (out, counts.unwrap_or_default())
    }

    fn row(k: usize) -> LogRow {
        let time = 0.01 * k as f64;
        LogRow {
            line: k as u64,
            values: vec![time, time.sin()],
            ..LogRow::default()
        }
    }

    #[test]
    fn a_gap_of_more_rows_than_are_held_is_not_bridged() {
        let bridging = Bridging {
            longest: 0.2,
            interpolates: true,
            even: false,
        };
        assert_eq!(bridging.missing_rows(0.05, 1e-5), Some(4999));
        assert_eq!(bridging.missing_rows(0.19, 1e-5), None);
        assert_eq!(bridging.missing_rows(0.19, 1e-300), None);
    }

    #[test]
    fn missing_rows_are_put_in_at_even_times() {
        let rows: Vec<LogRow> = (0..100)
            .filter(|k| !(40..45).contains(k))
            .map(row)
            .collect();
        let (out, counts) = bridged(&rows);
        assert_eq!(
            (out.len(), counts.count, counts.rows, counts.cuts),
            (100, 1, 5, 0)
        );
        for (k, (time, follows)) in out.iter().enumerate() {
            assert!((time - 0.01 * k as f64).abs() < 1e-12 && *follows == (k > 0));
        }
    }

    #[test]
    fn as_many_rows_behind_a_gap_as_a_polynomial_needs_continue_the_run() {
        let with = |behind: usize| {
            let rows: Vec<LogRow> = (0..45 + behind)
                .filter(|k| !(40..45).contains(k))
                .map(row)
                .collect();
            bridged(&rows).1
        };
        assert_eq!((with(MIN_SIDE).count, with(MIN_SIDE).cuts), (1, 0));
        assert_eq!((with(MIN_SIDE - 1).count, with(MIN_SIDE - 1).cuts), (0, 1));
    }
}
