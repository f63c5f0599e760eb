//! Finds the period of signals that repeat themselves, and the Fourier series that fits them.

use core::ops::Range;

use super::{Fourier, FourierFit, SignalError};

/// Lags are searched from where the mean square difference between a signal and the shifted signal,
/// divided by twice the variance, first exceeds this.
const DEPARTED_DIFFERENCE: f64 = 0.3;
/// The largest mean square difference, in the same measure, between periods of a motion.
const MAX_PERIOD_DIFFERENCE: f64 = 0.02;
/// A shorter period is preferred if its difference is at most this many times the smallest one,
/// plus [`EQUIVALENT_DIFFERENCE`].
const EQUIVALENT_RATIO: f64 = 4.0;
/// A difference of this size is rounding and noise.
const EQUIVALENT_DIFFERENCE: f64 = 2e-4;
/// The largest difference, in the same measure, between a point and the same one of the next period where a part of a
/// log repeats itself.
const MAX_POINT_DIFFERENCE: f64 = 4e-3;
/// The least part of a log that may repeat itself without the others.
const MIN_PART: f64 = 0.4;
/// A part that repeats itself is taken without one of so many points at ends that are not those of the log, until
/// its series tells where it ends.
const PART_MARGIN: usize = 20;
/// A series fits where it leaves at most this many times the mean squares that it leaves elsewhere.
const MAX_LEFT_RATIO: f64 = 2.0;
/// The clock wanders if another time for each row explains more than this part of what a series leaves.
const CLOCK_PART: f64 = 0.5;
/// A signal turns where the square of its velocity is below this part of the mean square.
const SLOW_PART: f64 = 0.1;
/// The least number of such rows.
const MIN_SLOW_ROWS: usize = 20;
/// The largest power of noise at frequencies of the motion over that at high ones.
const MAX_NOISE_RATIO: f64 = 2.0;
/// The least part of the log that is compared.
const MIN_OVERLAP: f64 = 0.2;
/// The least part of the whole variance that the compared parts must have, since rest at the
/// beginning and at the end is no period.
const MIN_VARIANCE: f64 = 0.3;
/// How a motion repeats itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Repetition {
    /// The period, s.
    pub seconds: f64,
    /// The rms difference between periods over the rms of the motion.
    pub difference: f64,
}

/// The mean squared difference of some signals between times `lag` points apart, over twice their
/// variance there, averaged over the signals; `None` if they move too little there.
///
/// - `whole`: the variance of each signal over the whole log.
fn difference(signals: &[&[f64]], whole: &[f64], lag: usize) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0.0);
    let (mut moving, mut all) = (0.0, 0.0);
    for (values, whole) in signals.iter().zip(whole) {
        let n = values.len().checked_sub(lag)?;
        let (early, late) = (&values[..n], &values[lag..]);
        let own = 0.5 * (variance(early) + variance(late));
        moving += (own / whole).min(1.0);
        all += 1.0;
        if own > 0.0 {
            let pairs = early.iter().zip(late);
            let squares: f64 = pairs.map(|(a, b)| (a - b) * (a - b)).sum();
            sum += squares / n as f64 / (2.0 * own);
            count += 1.0;
        }
    }
    (count > 0.0 && moving >= MIN_VARIANCE * all).then(|| sum / count)
}

/// Whether a signal changes at all: the variance of a constant is not 0 where its mean is rounded.
fn moves(values: &[f64]) -> bool {
    let first = values.first();
    first.is_some_and(|first| values.iter().any(|x| (x - first).abs() > 0.0))
}

fn variance(values: &[f64]) -> f64 {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    values.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / n
}

impl Repetition {
    /// The largest number of points of signals that are compared.
    pub const POINTS: usize = 2048;

    /// Finds the common period of signals; `None` if they do not repeat.
    ///
    /// - `times`: of the samples, evenly spaced, s; `signals`: their values, as many each.
    pub fn of_signals(times: &[f64], signals: &[&[f64]]) -> Option<Self> {
        let n = times.len();
        let every = n.div_ceil(Repetition::POINTS).max(1);
        let thin =
            |values: &&[f64]| -> Vec<f64> { values.iter().step_by(every).copied().collect() };
        let thinned: Vec<Vec<f64>> = signals.iter().map(thin).collect();
        let moving = thinned.iter().filter(|values| moves(values));
        let signals: Vec<&[f64]> = moving.map(Vec::as_slice).collect();
        let points = signals.first()?.len();
        let whole: Vec<f64> = signals.iter().map(|values| variance(values)).collect();
        let longest = ((1.0 - MIN_OVERLAP) * points as f64).floor();
        #[allow(clippy::cast_sign_loss, reason = "positive")]
        let longest = longest as usize;
        let found: Vec<Option<f64>> = (0..longest)
            .map(|lag| difference(&signals, &whole, lag))
            .collect();
        let left = found
            .iter()
            .position(|d| d.is_some_and(|d| d > DEPARTED_DIFFERENCE))?;
        let at = |lag: usize| found.get(lag).copied().flatten();
        let valleys = (left + 1..longest.saturating_sub(1)).filter_map(|lag| {
            let (a, b, c) = (at(lag - 1)?, at(lag)?, at(lag + 1)?);
            // the minimum of the parabola through the three, since lags are whole numbers of points
            let bend = a - 2.0 * b + c;
            let shift = if bend > 0.0 {
                0.5 * (a - c) / bend
            } else {
                0.0
            };
            let bottom = (b - 0.25 * (a - c) * shift).max(0.0);
            (b <= a && b <= c && bottom < MAX_PERIOD_DIFFERENCE)
                .then_some((lag as f64 + shift, bottom))
        });
        let valleys: Vec<(f64, f64)> = valleys.collect();
        let least = valleys.iter().map(|v| v.1).fold(f64::INFINITY, f64::min);
        let first = valleys
            .iter()
            .find(|v| v.1 <= EQUIVALENT_RATIO * least + EQUIVALENT_DIFFERENCE)?;
        // noise splits a valley into several, of which the deepest counts
        let near = valleys
            .iter()
            .filter(|v| v.0 < first.0 + first.0 / 20.0 + 3.0 && v.0 >= first.0);
        let (lag, bottom) = *near.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let span = times.last()? - times.first()?;
        let step = span / (n - 1).max(1) as f64 * every as f64;
        let seconds = lag * step;
        (seconds > 0.0).then(|| Self {
            seconds,
            difference: (2.0 * bottom).sqrt(),
        })
    }
}

/// Rows that the frequency is found from, at most.
const FITTED_ROWS: usize = 4096;
/// The most harmonics of a series.
const MAX_HARMONICS: usize = 40;
/// Rows for each coefficient of a series, at least.
const ROWS_PER_COEFFICIENT: usize = 8;
/// A harmonic belongs to a motion if its amplitude is above so many times that of noise.
const MIN_AMPLITUDE: f64 = 4.0;
/// The noise of a harmonic is that at so many frequencies between harmonics on either side of it.
const NEARBY: usize = 6;
/// The largest part of the variance of a signal that its series leaves: a motion that differs from period to
/// period by more is another one.
const MAX_LEFT_PART: f64 = 1e-4;
/// The half width of the interval in which a frequency is sought, in cycles of the highest harmonic along the
/// samples: within it the fit has one optimum.
const BRACKET_CYCLES: f64 = 0.3;
/// The part by which the period of a repetition may be wrong.
const PERIOD_ERROR: f64 = 3e-3;
/// A search for the frequency narrows the interval as so many steps by the golden ratio.
const STEPS: usize = 10;
/// The same of the last search.
const LAST_STEPS: usize = 26;
/// Harmonics are looked for up to twice the known ones, and so many more.
const SPARE_HARMONICS: usize = 6;
/// The golden ratio less one.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Signals of one log.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sampled {
    /// The times, evenly spaced, s.
    pub(crate) times: Vec<f64>,
    /// The values of each signal.
    pub(crate) signals: Vec<Vec<f64>>,
}

/// The Fourier series of a motion that repeats itself.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FittingSeries {
    /// The frequency of the fundamental, Hz.
    pub(crate) frequency: f64,
    /// The number of harmonics.
    pub(crate) harmonics: usize,
    /// The first and the last time of each log between which it repeats itself, s; `None` if all of them do as a
    /// whole.
    pub(crate) parts: Option<Vec<[f64; 2]>>,
    /// Whether what the series leaves of the signals is no motion: noise that is as large at the frequencies of the
    /// motion as at higher ones, or mostly the velocities, times one number for each row, since the rows are not
    /// where their clock says.
    pub(crate) leaves_noise: bool,
}

/// The Fourier series that fits the signals of all logs, or a part of each; `None` if they do not repeat, or have
/// more harmonics than can be told from noise.
pub(crate) fn fitting_series(logs: &[Sampled]) -> Option<FittingSeries> {
    let moving: Vec<Sampled> = logs.iter().map(Sampled::moving).collect();
    let mut frequency = 0.0;
    let mut parts = Vec::with_capacity(moving.len());
    for log in &moving {
        let (part, own) = repeating(log)?;
        if frequency > 0.0 && (own / frequency - 1.0_f64).abs() > 2.0 * PERIOD_ERROR {
            return None;
        }
        frequency = own;
        parts.push(part);
    }
    let are_whole = |parts: &[Range<usize>]| {
        let mut pairs = parts.iter().zip(&moving);
        pairs.all(|(part, log)| *part == (0..log.times.len()))
    };
    let cut = |parts: &[Range<usize>]| -> Vec<Sampled> {
        let pairs = moving.iter().zip(parts);
        pairs.map(|(log, part)| log.cut(part.clone())).collect()
    };
    let mut logs = cut(&parts);
    let mut found = of_repeating(&logs, frequency)?;
    if !are_whole(&parts) {
        // the series tells where it ends better than differences between periods
        for (part, log) in parts.iter_mut().zip(&moving) {
            *part = fitting_part(log, part, found)?;
        }
        logs = cut(&parts);
        found = of_repeating(&logs, found.0)?;
    }
    let (frequency, harmonics) = found;
    let (mut squares, mut left, mut is_far) = (0.0, 0.0, false);
    let mut ratios = Vec::new();
    for log in &logs {
        let thinned = log.thinned();
        let fit = thinned.fitted(frequency, harmonics).ok()?;
        let residuals = fit.residual_squares();
        let mut pairs = residuals.iter().zip(&thinned.signals);
        is_far |= pairs.any(|(own, x)| *own > MAX_LEFT_PART * variance(x) * x.len() as f64);
        let series = fit.finish().ok()?;
        ratios.extend(log.noise_ratios(&series));
        let [own, own_left] = wandering(log, &series);
        squares += own;
        left += own_left;
    }
    let clock_wanders = left < (1.0 - CLOCK_PART) * squares;
    if is_far && !clock_wanders {
        return None;
    }
    let time = |log: &Sampled, k: usize| log.times.get(k).copied();
    let pairs = moving.iter().zip(&parts);
    let times = pairs.map(|(log, part)| Some([time(log, part.start)?, time(log, part.end - 1)?]));
    Some(FittingSeries {
        frequency,
        harmonics,
        parts: if are_whole(&parts) {
            None
        } else {
            times.collect()
        },
        leaves_noise: clock_wanders
            || ratios.iter().sum::<f64>() < MAX_NOISE_RATIO * ratios.len() as f64,
    })
}

/// The frequency (Hz) and the number of harmonics of the series that fits logs that repeat themselves.
///
/// - `frequency`: close to that of the fundamental.
fn of_repeating(logs: &[Sampled], mut frequency: f64) -> Option<(f64, usize)> {
    let thinned: Vec<Sampled> = logs.iter().map(Sampled::thinned).collect();
    let (mut longest, mut rows) = (0.0_f64, usize::MAX);
    for log in &thinned {
        longest = longest.max(log.length());
        rows = rows.min(log.times.len());
    }
    let most = MAX_HARMONICS.min(rows / ROWS_PER_COEFFICIENT / 2);
    let misfit = |frequency: f64, harmonics: usize| -> Option<f64> {
        let mut sum = 0.0;
        for log in &thinned {
            let fit = log.fitted(frequency, harmonics).ok()?;
            for (own, signal) in fit.residual_squares().iter().zip(&log.signals) {
                let all = variance(signal) * signal.len() as f64;
                sum += libm::log(own / all + f64::EPSILON * f64::EPSILON);
            }
        }
        sum.is_finite().then_some(sum)
    };
    let highest = |frequency: f64, harmonics: usize| -> Option<usize> {
        let mut highest = 0;
        for log in &thinned {
            let fit = log.fitted(frequency, harmonics).ok()?;
            log.times.len().checked_sub(2 + 2 * harmonics)?;
            let series = fit.finish().ok()?;
            let noise = log.noise_between(&series);
            for (k, noise) in noise.iter().enumerate() {
                let (_, cosines, sines) = series.coefficients(k);
                let pairs = cosines.iter().zip(&sines).zip(noise).enumerate();
                let above = pairs.filter(|(_, ((a, b), own))| a.hypot(**b) > MIN_AMPLITUDE * **own);
                highest = highest.max(above.map(|(j, _)| j + 1).max().unwrap_or(0));
            }
        }
        Some(highest)
    };
    let mut width = PERIOD_ERROR * frequency;
    let mut harmonics = 1;
    loop {
        width = width.min(BRACKET_CYCLES / (longest * harmonics as f64));
        let range = [frequency - width, frequency + width];
        frequency = lowest(range, STEPS, |f| misfit(f, harmonics))?;
        let found = highest(frequency, (2 * harmonics + SPARE_HARMONICS).min(most))?;
        if found <= harmonics {
            harmonics = found;
            break;
        }
        harmonics = found;
    }
    if harmonics == 0 || harmonics == most {
        // of a motion with as many harmonics, more are left out
        return None;
    }
    let range = [frequency - width, frequency + width];
    frequency = lowest(range, LAST_STEPS, |f| misfit(f, harmonics))?;
    // decimals, as they are printed
    let rounded = format!("{frequency:.8e}").parse().unwrap_or(frequency);
    Some((rounded, harmonics))
}

/// The rows of a log that repeat themselves, all or those between a start and an end, with the frequency, Hz; `None`
/// if none do.
fn repeating(log: &Sampled) -> Option<(Range<usize>, f64)> {
    let of_log = |log: &Sampled| {
        let signals: Vec<&[f64]> = log.signals.iter().map(Vec::as_slice).collect();
        Repetition::of_signals(&log.times, &signals).map(|own| 1.0 / own.seconds)
    };
    let rows = log.times.len();
    if let Some(frequency) = of_log(log) {
        return Some((0..rows, frequency));
    }
    let every = rows.div_ceil(Repetition::POINTS).max(1);
    let signals = log.thinned_by(every).signals;
    let points = signals.first()?.len();
    let whole: Vec<f64> = signals.iter().map(|x| variance(x)).collect();
    let spread = |part: Range<usize>| {
        let pairs = signals.iter().zip(&whole);
        let own = pairs.map(|(x, all)| (variance(&x[part.clone()]) / all).min(1.0));
        own.sum::<f64>() / signals.len() as f64
    };
    let apart = |lag: usize, k: usize| {
        let pairs = signals.iter().zip(&whole);
        let squares = pairs.map(|(x, all)| (x[k + lag] - x[k]) * (x[k + lag] - x[k]) / all);
        squares.sum::<f64>() / (2 * signals.len()) as f64
    };
    let has_departed = |lag: usize| {
        let all = (0..points - lag).map(|k| apart(lag, k)).sum::<f64>();
        all > DEPARTED_DIFFERENCE * (points - lag) as f64
    };
    let left = (1..points).find(|lag| has_departed(*lag))?;
    let mut best = 0..0;
    for lag in left + 1..points {
        let mut first = 0;
        for k in 0..=points - lag {
            if k < points - lag && apart(lag, k) < MAX_POINT_DIFFERENCE {
                continue;
            }
            let own = first..k + lag;
            let overlap = (k - first) as f64;
            if k > first
                && own.len() > best.len()
                && overlap > MIN_OVERLAP * own.len() as f64
                && spread(first..k) > MIN_VARIANCE
            {
                best = own;
            }
            first = k + 1;
        }
    }
    if (best.len() as f64) < MIN_PART * points as f64 {
        return None;
    }
    // a motion begins and ends gradually
    let margin = best.len() / PART_MARGIN;
    let start = best.start + if best.start > 0 { margin } else { 0 };
    let is_last = best.end == points;
    let end = if is_last {
        rows
    } else {
        (best.end - margin) * every
    };
    let part = start * every..end;
    Some((part.clone(), of_log(&log.cut(part))?))
}

/// The rows about a part of a log that the series of this part fits, but for a quarter of the shortest period at an
/// end that is not that of the log.
///
/// - `series`: the frequency, Hz, and the number of harmonics.
fn fitting_part(
    log: &Sampled,
    part: &Range<usize>,
    (frequency, harmonics): (f64, usize),
) -> Option<Range<usize>> {
    let own = log.cut(part.clone());
    let fit = own.thinned().fitted(frequency, harmonics).ok()?;
    let series = fit.finish().ok()?;
    let rows = log.times.len();
    let step = (log.length() / rows as f64).max(f64::MIN_POSITIVE);
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positive and small"
    )]
    let margin = (0.25 / (frequency * harmonics as f64) / step).ceil() as usize;
    let block = margin.div_ceil(4).max(1);
    // squares of what the series leaves, over those within the part
    let mut squares = vec![0.0; rows];
    for (k, x) in log.signals.iter().enumerate() {
        let left = |row: usize| {
            let time = log.times.get(row).copied().unwrap_or(f64::NAN);
            let own = x.get(row).copied().unwrap_or(f64::NAN) - series.at(k, time)[0];
            own * own
        };
        let inside = part.clone().map(left).sum::<f64>() / part.len() as f64;
        for (row, sum) in squares.iter_mut().enumerate() {
            *sum = f64::max(*sum, left(row) / inside);
        }
    }
    let fits = |rows: &[f64]| {
        rows.iter().sum::<f64>() < MAX_LEFT_RATIO * log.signals.len() as f64 * rows.len() as f64
    };
    let before = squares.get(..part.start)?.rchunks(block);
    let before = before.take_while(|own| fits(own)).map(<[f64]>::len);
    let after = squares.get(part.end..)?.chunks(block);
    let after = after.take_while(|own| fits(own)).map(<[f64]>::len);
    let (start, end) = (
        part.start - before.sum::<usize>(),
        part.end + after.sum::<usize>(),
    );
    let start = if start > 0 { start + margin } else { 0 };
    let end = if end < rows {
        end.checked_sub(margin)?
    } else {
        rows
    };
    (start < end).then_some(start..end)
}

/// The sum of the squares of what a series leaves of the signals, each over its mean square, and what of that is left
/// if each row may be at another time, which is not that of whole periods; corrected for the number that is fitted to
/// each row.
fn wandering(log: &Sampled, series: &Fourier) -> [f64; 2] {
    let n = log.signals.len();
    let left: Vec<Vec<[f64; 2]>> = log
        .times
        .iter()
        .enumerate()
        .map(|(row, time)| {
            let pairs = series.all(*time).into_iter().zip(&log.signals);
            let left = pairs.map(|([q, qd, _], x)| [x.get(row).copied().unwrap_or(q) - q, qd]);
            left.collect()
        })
        .collect();
    let weights: Vec<f64> = (0..n)
        .map(|k| {
            let own = left.iter().filter_map(|row| row.get(k));
            let sum = own.map(|own| own[0] * own[0]).sum::<f64>();
            left.len() as f64 / sum.max(f64::MIN_POSITIVE)
        })
        .collect();
    let sums = |rows: &[Vec<[f64; 2]>]| {
        let mut sums = [0.0; 3];
        for row in rows {
            for ([e, v], weight) in row.iter().zip(&weights) {
                sums[0] += weight * e * e;
                sums[1] += weight * e * v;
                sums[2] += weight * v * v;
            }
        }
        sums
    };
    let explained = |[_, ev, vv]: [f64; 3]| if vv > 0.0 { ev * ev / vv } else { 0.0 };
    let all: f64 = left.chunks(1).map(|row| sums(row)[0]).sum();
    let by_rows: f64 = left.chunks(1).map(|row| explained(sums(row))).sum();
    // a clock that is as far off for whole periods is another motion, of another speed
    let shortest = log.length() * series.frequency() * series.harmonics() as f64;
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positive"
    )]
    let block = (left.len() as f64 / shortest.max(1.0)).ceil() as usize;
    let by_blocks: f64 = left
        .chunks(block.max(1))
        .map(|rows| explained(sums(rows)))
        .sum();
    if n > 1 {
        let rest = (all - by_rows) * n as f64 / (n as f64 - 1.0);
        return [all, rest + by_blocks];
    }
    // another time for each row explains a single signal whatever it is: but then nothing is left where it turns
    let single = left.iter().filter_map(|row| row.first());
    let speed = single.clone().map(|[_, v]| v * v).sum::<f64>() / left.len() as f64;
    let slow = single.filter(|[_, v]| v * v < SLOW_PART * speed);
    let slow: Vec<f64> = slow.map(|[e, _]| e * e).collect();
    if slow.len() < MIN_SLOW_ROWS {
        return [all, all];
    }
    let mean = slow.iter().sum::<f64>() / slow.len() as f64;
    let weight = weights.first().copied().unwrap_or(1.0);
    [all, mean * weight * left.len() as f64 + by_blocks]
}

impl Sampled {
    /// The signals that move.
    fn moving(&self) -> Self {
        let moving = self.signals.iter().filter(|x| moves(x));
        Self {
            times: self.times.clone(),
            signals: moving.cloned().collect(),
        }
    }

    /// One of so many rows.
    fn thinned_by(&self, every: usize) -> Self {
        let thin = |x: &Vec<f64>| -> Vec<f64> { x.iter().step_by(every).copied().collect() };
        Self {
            times: thin(&self.times),
            signals: self.signals.iter().map(thin).collect(),
        }
    }

    /// At most [`FITTED_ROWS`] of the rows.
    fn thinned(&self) -> Self {
        self.thinned_by(self.times.len().div_ceil(FITTED_ROWS).max(1))
    }

    /// Some of the rows.
    fn cut(&self, rows: Range<usize>) -> Self {
        let cut = |x: &Vec<f64>| x.get(rows.clone()).unwrap_or_default().to_vec();
        Self {
            times: cut(&self.times),
            signals: self.signals.iter().map(cut).collect(),
        }
    }

    /// From the first to the last row, s.
    fn length(&self) -> f64 {
        match (self.times.first(), self.times.last()) {
            (Some(first), Some(last)) => last - first,
            _ => 0.0,
        }
    }

    /// The fit of a series.
    fn fitted(&self, frequency: f64, harmonics: usize) -> Result<FourierFit, SignalError> {
        let mut fit = FourierFit::new(frequency, harmonics, self.signals.len())?;
        let mut row = vec![0.0; self.signals.len()];
        for (k, time) in self.times.iter().enumerate() {
            for (entry, signal) in row.iter_mut().zip(&self.signals) {
                *entry = signal.get(k).copied().unwrap_or(f64::NAN);
            }
            fit.push(*time, &row)?;
        }
        Ok(fit.reduced())
    }

    /// What a series leaves of each signal.
    fn left(&self, series: &Fourier) -> Vec<Vec<f64>> {
        let mut out = vec![Vec::with_capacity(self.times.len()); self.signals.len()];
        for (row, time) in self.times.iter().enumerate() {
            let own = series.all(*time).into_iter().zip(&self.signals);
            for (out, ([q, ..], x)) in out.iter_mut().zip(own) {
                out.push(x.get(row).copied().unwrap_or(q) - q);
            }
        }
        out
    }

    /// For each signal, the squared amplitudes of what a series leaves at half the frequency of the fundamental and
    /// halfway between harmonics.
    ///
    /// - `left`: see [`left`](Self::left).
    fn between(&self, series: &Fourier, left: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let n = left.len();
        let mut sums = vec![[0.0; 2]; n * (series.harmonics() + 1)];
        for (row, time) in self.times.iter().enumerate() {
            for (j, sums) in sums.chunks_exact_mut(n.max(1)).enumerate() {
                let angle = core::f64::consts::TAU * series.frequency() * (j as f64 + 0.5) * time;
                let (sin, cos) = libm::sincos(angle);
                for ([a, b], left) in sums.iter_mut().zip(left) {
                    let own = left.get(row).copied().unwrap_or(0.0);
                    *a += cos * own;
                    *b += sin * own;
                }
            }
        }
        let scale = 2.0 / self.times.len().max(1) as f64;
        let square = |[a, b]: &[f64; 2]| scale * scale * (a * a + b * b);
        let of_signal = |k: usize| sums.iter().skip(k).step_by(n).map(square).collect();
        (0..n).map(of_signal).collect()
    }

    /// For each signal and harmonic, the amplitude that noise alone gives it, rms: that of what the series leaves at
    /// frequencies between harmonics nearby, since noise need not be white, and at least that of white noise with
    /// the same differences from row to row, since the errors of an encoder's steps repeat themselves too.
    fn noise_between(&self, series: &Fourier) -> Vec<Vec<f64>> {
        let left = self.left(series);
        let squares = self.between(series, &left);
        let of_harmonic = |own: &[f64], j: usize, white: f64| {
            let near = (j + 1).saturating_sub(NEARBY)..(j + 1 + NEARBY).min(own.len());
            let near = own.get(near).unwrap_or_default();
            let mean = near.iter().sum::<f64>() / near.len().max(1) as f64;
            mean.max(white).sqrt()
        };
        let of_signal = |(own, left): (&Vec<f64>, &Vec<f64>)| {
            let white = white_square(left);
            let all = (0..series.harmonics()).map(|j| of_harmonic(own, j, white));
            all.collect()
        };
        squares.iter().zip(&left).map(of_signal).collect()
    }

    /// For each signal, the power of what a series leaves at the frequencies of the motion over that of white noise
    /// with the same differences from row to row.
    fn noise_ratios(&self, series: &Fourier) -> Vec<f64> {
        let left = self.left(series);
        let pairs = self.between(series, &left).into_iter().zip(&left);
        let ratio = |(between, left): (Vec<f64>, &Vec<f64>)| {
            let mean = between.iter().sum::<f64>() / between.len() as f64;
            mean / white_square(left).max(f64::MIN_POSITIVE)
        };
        pairs.map(ratio).collect()
    }
}

/// The squared amplitude, at any frequency, of white noise with the same differences from row to row.
fn white_square(left: &[f64]) -> f64 {
    let rows = left.len().max(1) as f64;
    let steps = left
        .windows(2)
        .map(|pair| (pair[1] - pair[0]) * (pair[1] - pair[0]));
    4.0 * (0.5 * steps.sum::<f64>() / rows) / rows
}

/// Where a function with one optimum in an interval is lowest, by parabolas through its three lowest places, and
/// by golden section where these lead nowhere (Brent, 1973, Algorithms for Minimization without Derivatives).
///
/// - `steps`: the place is known as well as by so many steps of golden section.
fn lowest(
    [mut low, mut high]: [f64; 2],
    steps: usize,
    value: impl Fn(f64) -> Option<f64>,
) -> Option<f64> {
    let near = 0.25 * (high - low) * libm::pow(GOLDEN, steps as f64);
    let first = high - GOLDEN * (high - low);
    let mut best = (first, value(first)?);
    let (mut second, mut third) = (best, best);
    // the last step and the one before it
    let (mut step, mut before) = (0.0_f64, 0.0_f64);
    for _ in 0..2 * steps {
        let middle = 0.5 * (low + high);
        if (best.0 - middle).abs() + 0.5 * (high - low) <= 2.0 * near {
            break;
        }
        let parabola = vertex(best, second, third).filter(|own| {
            // within the interval, and less than half of the step before the last one
            own.abs() < 0.5 * before.abs() && (low..=high).contains(&(best.0 + own))
        });
        before = step;
        step = if let Some(own) = parabola {
            let place = best.0 + own;
            if (place - low).min(high - place) < 2.0 * near {
                near.copysign(middle - best.0)
            } else {
                own
            }
        } else {
            before = if best.0 < middle { high } else { low } - best.0;
            (1.0 - GOLDEN) * before
        };
        if step.abs() < near {
            step = near.copysign(step);
        }
        let place = best.0 + step;
        let found = (place, value(place)?);
        if found.1 <= best.1 {
            if step > 0.0 {
                low = best.0;
            } else {
                high = best.0;
            }
            (best, second, third) = (found, best, second);
        } else {
            if step > 0.0 {
                high = place;
            } else {
                low = place;
            }
            if found.1 <= second.1 || second.0.to_bits() == best.0.to_bits() {
                (second, third) = (found, second);
            } else if found.1 <= third.1 || third.0.to_bits() == second.0.to_bits() {
                third = found;
            }
        }
    }
    Some(best.0)
}

/// The way from the first of three places, each with its value, to the vertex of the parabola through them; `None` if
/// they are on a line.
fn vertex(a: (f64, f64), b: (f64, f64), c: (f64, f64)) -> Option<f64> {
    let (of_b, of_c) = ((a.0 - b.0) * (a.1 - c.1), (a.0 - c.0) * (a.1 - b.1));
    let step = 0.5 * ((a.0 - c.0) * of_c - (a.0 - b.0) * of_b) / (of_b - of_c);
    step.is_finite().then_some(step)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    fn sampled(step: f64, rows: usize, noise: f64) -> Sampled {
        let w = core::f64::consts::TAU * 0.213_456;
        let mut random = crate::intervals::Random(7);
        let times: Vec<f64> = (0..rows).map(|k| step * k as f64).collect();
        let mut column = |f: &dyn Fn(f64) -> f64| -> Vec<f64> {
            times
                .iter()
                .map(|t| f(*t) + noise * random.normal())
                .collect()
        };
        let first = column(&|t| (w * t).sin() + 0.3 * (3.0 * w * t).cos());
        let second = column(&|t| 0.2 * (2.0 * w * t).cos() - 0.05 * (6.0 * w * t).sin());
        Sampled {
            times,
            signals: vec![first, second],
        }
    }

    #[test]
    fn the_series_of_a_motion_has_its_frequency_and_its_harmonics() {
        for (rows, noise, error) in [(3000, 1e-4, 2e-6), (20_000, 1e-3, 1e-6), (3000, 0.0, 1e-7)] {
            let found = fitting_series(&[sampled(0.01, rows, noise)]).unwrap();
            assert_eq!((found.harmonics, found.parts), (6, None), "{rows} {noise}");
            assert!(found.leaves_noise || noise == 0.0, "{rows} {noise}");
            let frequency = found.frequency;
            assert!(
                (frequency / 0.213_456 - 1.0).abs() < error,
                "{frequency} {rows} {noise}"
            );
        }
        // two logs with the same period, and with another one
        let mut other = sampled(0.02, 2000, 1e-4);
        let both = [sampled(0.01, 3000, 1e-4), other.clone()];
        assert_eq!(fitting_series(&both).unwrap().harmonics, 6);
        let mut slower = other.clone();
        slower.times.iter_mut().for_each(|t| *t *= 1.1);
        assert_eq!(fitting_series(&[sampled(0.01, 3000, 1e-4), slower]), None);
        // corners have harmonics without end
        for x in other.signals.iter_mut().flatten() {
            *x = x.signum();
        }
        assert_eq!(fitting_series(&[other]), None);
    }

    #[test]
    fn a_start_and_a_stop_are_no_part_of_a_series() {
        let mut log = sampled(0.01, 2000, 1e-4);
        for signal in &mut log.signals {
            for (k, x) in signal.iter_mut().enumerate() {
                // at rest for 1 s, and from rest for 2 s
                let start = ((k as f64 - 100.0) / 200.0).clamp(0.0, 1.0);
                let stop = ((1950.0 - k as f64) / 100.0).clamp(0.0, 1.0);
                *x *= start * start * (3.0 - 2.0 * start) * stop * stop * (3.0 - 2.0 * stop);
            }
        }
        let found = fitting_series(std::slice::from_ref(&log)).unwrap();
        assert_eq!(found.harmonics, 6);
        assert!((found.frequency / 0.213_456 - 1.0).abs() < 1e-5);
        let parts = found.parts.unwrap();
        let [[start, end]] = parts[..] else {
            panic!("{parts:?}");
        };
        assert!(
            (3.0..3.5).contains(&start) && (18.0..18.5).contains(&end),
            "{start} {end}"
        );
        // without a part that repeats itself
        let half = log.cut(0..900);
        assert_eq!(fitting_series(&[half]), None);
    }

    #[test]
    fn rows_beside_their_clock_are_told_from_noise_of_the_signals() {
        let mut random = crate::intervals::Random(3);
        let mut log = sampled(0.01, 3000, 0.0);
        let shifts: Vec<f64> = (0..3000).map(|_| 3e-3 * random.normal()).collect();
        let w = core::f64::consts::TAU * 0.213_456;
        for (row, shift) in shifts.iter().enumerate() {
            let t = log.times[row] + shift;
            log.signals[0][row] =
                (w * t).sin() + 0.3 * (3.0 * w * t).cos() + 1e-4 * random.normal();
            log.signals[1][row] = 0.2 * (2.0 * w * t).cos() - 0.05 * (6.0 * w * t).sin();
        }
        let found = fitting_series(std::slice::from_ref(&log)).unwrap();
        assert_eq!(found.harmonics, 6);
        assert!(found.leaves_noise);
        // a single signal tells so where it turns
        log.signals.remove(0);
        assert!(
            fitting_series(std::slice::from_ref(&log))
                .unwrap()
                .leaves_noise
        );
        for x in &mut log.signals[0] {
            *x += 1e-2 * random.normal();
        }
        assert_eq!(fitting_series(&[log]), None);
    }

    /// Two signals with harmonics up to the given one, at 0.2 Hz.
    fn of_harmonics(harmonics: usize, rows: usize, step: f64) -> Sampled {
        let mut random = crate::intervals::Random(9);
        let times: Vec<f64> = (0..rows).map(|k| step * k as f64).collect();
        let mut signal = |phase: f64| -> Vec<f64> {
            let value = |t: &f64| {
                let one = |j: usize| {
                    let angle = core::f64::consts::TAU * 0.2 * j as f64 * t;
                    (angle + phase * j as f64).sin() / (j * j) as f64
                };
                (1..=harmonics).map(one).sum::<f64>() + 1e-5 * random.normal()
            };
            times.iter().map(value).collect()
        };
        Sampled {
            signals: vec![signal(0.3), signal(1.9)],
            times,
        }
    }

    #[test]
    fn as_many_harmonics_are_found_as_a_motion_has() {
        for harmonics in [1, 9, 23] {
            let found = fitting_series(&[of_harmonics(harmonics, 4000, 0.01)]).unwrap();
            assert_eq!(found.harmonics, harmonics);
            assert!(
                (found.frequency / 0.2 - 1.0).abs() < 1e-6,
                "{}",
                found.frequency
            );
            assert!(found.leaves_noise && found.parts.is_none());
        }
    }

    #[test]
    fn the_period_of_a_repetition_does_not_depend_on_sizes_or_on_signals_at_rest() {
        let times: Vec<f64> = (0..1000).map(|k| 0.02 * f64::from(k)).collect();
        let wave = |size: f64| -> Vec<f64> {
            let angle = |t: &f64| core::f64::consts::TAU * t / 3.21;
            times.iter().map(|t| size * angle(t).sin()).collect()
        };
        let still = vec![0.7; 1000];
        for size in [1e-3, 1.0, 50.0] {
            let own = wave(size);
            for signals in [
                vec![own.as_slice()],
                vec![&still, &own],
                vec![&own, &still, &still],
            ] {
                let found = Repetition::of_signals(&times, &signals).unwrap();
                assert!((found.seconds / 3.21 - 1.0).abs() < 1e-4, "{found:?}");
                assert!(found.difference < 1e-2, "{found:?}");
            }
        }
        assert_eq!(Repetition::of_signals(&times, &[&still]), None);
        // a ripple before and behind the only large motion is no period, whatever else is at rest
        let ripple = |k: u32| libm::sin(core::f64::consts::TAU * f64::from(k) / 100.0);
        let once = |k: u32| {
            if (400..600).contains(&k) {
                1.0
            } else {
                1e-3 * ripple(k)
            }
        };
        let once: Vec<f64> = (0..1000).map(once).collect();
        assert_eq!(Repetition::of_signals(&times, &[&once]), None);
        assert_eq!(
            Repetition::of_signals(&times, &[&once, &still, &still]),
            None
        );
    }

    #[test]
    fn the_lowest_place_of_an_interval_is_found_in_few_steps_where_it_is_smooth() {
        use std::cell::Cell;
        let calls = Cell::new(0);
        let found = |place: f64, shape: fn(f64) -> f64| {
            calls.set(0);
            let value = |x: f64| {
                calls.set(calls.get() + 1);
                Some(shape(x - place))
            };
            lowest([-3.0, 2.0], 36, value).unwrap()
        };
        // 36 steps of golden section narrow an interval of 5 to 1.5e-7
        for place in [-2.9, -1.3, 0.4, 2.0] {
            let smooth = found(place, |x| x * x + 0.1 * x * x * x);
            assert!((smooth - place).abs() < 1.5e-7, "{smooth} {place}");
            // at a bound no parabola is within the interval
            assert!(place > 1.9 || calls.get() < 15, "{}", calls.get());
            for sharp in [(|x| libm::log(x * x + 1e-30)) as fn(f64) -> f64, f64::abs] {
                let found = found(place, sharp);
                assert!((found - place).abs() < 1.5e-7, "{found} {place}");
                assert!(calls.get() < 73);
            }
        }
        assert_eq!(lowest([0.0, 1.0], 5, |_| None), None);
    }

    #[test]
    fn noise_between_harmonics_is_the_amplitude_that_white_noise_gives_a_harmonic() {
        let log = sampled(0.01, 4000, 0.1);
        let series = log.fitted(0.213_456, 8).unwrap().finish().unwrap();
        // sqrt(4 / rows) times the deviation
        let expected = 0.1 * (4.0_f64 / 4000.0).sqrt();
        let found = log.noise_between(&series);
        assert_eq!((found.len(), found[0].len()), (2, 8));
        for own in found.iter().flatten() {
            assert!((0.6..1.6).contains(&(own / expected)), "{own} {expected}");
        }
        for own in log.noise_ratios(&series) {
            assert!((0.3..2.0).contains(&own), "{own}");
        }
        // noise at the frequencies of the motion is seen although it hardly changes from row to row
        let mut slow = log.clone();
        for (row, t) in log.times.iter().enumerate() {
            let angle = core::f64::consts::TAU * 0.213_456 * 2.5 * t;
            slow.signals[0][row] += 0.2 * (angle + 0.4).sin();
        }
        let series = slow.fitted(0.213_456, 8).unwrap().finish().unwrap();
        let amplitude = slow.between(&series, &slow.left(&series))[0][2].sqrt();
        assert!((amplitude / 0.2 - 1.0).abs() < 0.1, "{amplitude}");
        assert!(slow.noise_ratios(&series)[0] > 10.0);
    }

    #[test]
    fn what_a_clock_explains_is_no_noise_and_noise_is_not_explained_by_one() {
        let series = {
            let log = sampled(0.01, 3000, 0.0);
            log.fitted(0.213_456, 6).unwrap().finish().unwrap()
        };
        // the signals of rows that are late by so much
        let late = |by: &mut dyn FnMut(f64) -> f64| {
            let mut log = sampled(0.01, 3000, 0.0);
            for (row, time) in log.times.iter().enumerate() {
                let at = series.all(time + by(*time));
                for (signal, [q, ..]) in log.signals.iter_mut().zip(at) {
                    signal[row] = q;
                }
            }
            let [all, left] = wandering(&log, &series);
            left / all
        };
        let noise = wandering(&sampled(0.01, 3000, 1e-3), &series);
        assert!((0.9..1.1).contains(&(noise[1] / noise[0])), "{noise:?}");
        let mut random = crate::intervals::Random(3);
        let by_rows = late(&mut |_| 1e-3 * random.normal());
        assert!(by_rows < 0.03, "{by_rows}");
        let quickly = late(&mut |t| 1e-3 * libm::sin(25.0 * t));
        assert!(quickly < 0.1, "{quickly}");
        // what is late for whole periods is another motion
        let slowly = late(&mut |t| 1e-3 * libm::sin(0.5 * t));
        assert!(slowly > 0.9, "{slowly}");
    }

    #[test]
    fn a_part_that_repeats_itself_is_the_same_at_any_speed() {
        let starting = |slower: f64| {
            let mut log = sampled(0.01, 2000, 1e-4);
            for signal in &mut log.signals {
                for (k, x) in signal.iter_mut().enumerate() {
                    let start = (k as f64 / 300.0).clamp(0.0, 1.0);
                    *x *= start * start * (3.0 - 2.0 * start);
                }
            }
            log.times.iter_mut().for_each(|t| *t *= slower);
            let found = fitting_series(&[log]).unwrap();
            found.parts.unwrap()[0].map(|time| time / slower)
        };
        let own = starting(1.0);
        assert!(
            (3.0..3.6).contains(&own[0]) && (own[1] - 19.99).abs() < 1e-9,
            "{own:?}"
        );
        for slower in [0.1, 30.0] {
            let other = starting(slower);
            assert!((own[0] - other[0]).abs() < 0.015, "{own:?} {other:?}");
        }
    }
}
