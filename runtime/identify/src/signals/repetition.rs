//! Finds the period of signals that repeat themselves, and the Fourier series that fits them.

use super::{FourierFit, SignalError};

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
/// The least part of the log that is compared.
const MIN_OVERLAP: f64 = 0.2;
/// The least part of the whole variance that the compared parts must have, since rest at the
/// beginning and at the end is no period.
const MIN_VARIANCE: f64 = 0.3;
/// The largest number of points of the trace that are compared.
const POINTS: usize = 2048;

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

fn variance(values: &[f64]) -> f64 {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    values.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / n
}

impl Repetition {
    /// Finds the common period of signals; `None` if they do not repeat.
    ///
    /// - `times`: of the samples, evenly spaced, s; `signals`: their values, as many each.
    pub fn of_signals(times: &[f64], signals: &[&[f64]]) -> Option<Self> {
        let n = times.len();
        let every = n.div_ceil(POINTS).max(1);
        let thin =
            |values: &&[f64]| -> Vec<f64> { values.iter().step_by(every).copied().collect() };
        let thinned: Vec<Vec<f64>> = signals.iter().map(thin).collect();
        let moving = thinned.iter().filter(|values| variance(values) > 0.0);
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
/// A harmonic belongs to a motion if its amplitude is above so many standard deviations.
const MIN_AMPLITUDE: f64 = 4.5;
/// The largest part of the variance of a signal that its series leaves: a motion that differs from period to
/// period by more is another one.
const MAX_LEFT_PART: f64 = 1e-4;
/// The half width of the interval in which a frequency is sought, in cycles of the highest harmonic along the
/// samples: within it the fit has one optimum.
const BRACKET_CYCLES: f64 = 0.3;
/// The part by which the period of a repetition may be wrong.
const PERIOD_ERROR: f64 = 3e-3;
/// Steps of a search for the frequency, each of which narrows the interval by the golden ratio.
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

/// The frequency (Hz) and the number of harmonics of the Fourier series that fits the signals of all logs; `None`
/// if they do not repeat, or have more harmonics than can be told from noise.
pub(crate) fn fitting_series(logs: &[Sampled]) -> Option<(f64, usize)> {
    let thinned: Vec<Sampled> = logs
        .iter()
        .map(|own| {
            let every = own.times.len().div_ceil(FITTED_ROWS).max(1);
            let thin = |x: &Vec<f64>| -> Vec<f64> { x.iter().step_by(every).copied().collect() };
            let moving = own.signals.iter().filter(|x| variance(x) > 0.0);
            Sampled {
                times: thin(&own.times),
                signals: moving.map(thin).collect(),
            }
        })
        .collect();
    let (mut frequency, mut longest, mut rows) = (0.0, 0.0_f64, usize::MAX);
    for Sampled { times, signals } in logs {
        let moving = signals.iter().filter(|x| variance(x) > 0.0);
        let moving: Vec<&[f64]> = moving.map(Vec::as_slice).collect();
        let own = 1.0 / Repetition::of_signals(times, &moving)?.seconds;
        if frequency > 0.0 && (own / frequency - 1.0_f64).abs() > 2.0 * PERIOD_ERROR {
            return None;
        }
        frequency = own;
        longest = longest.max(times.last()? - times.first()?);
        rows = rows.min(times.len().min(FITTED_ROWS));
    }
    let most = MAX_HARMONICS.min(rows / ROWS_PER_COEFFICIENT / 2);
    let misfit = |frequency: f64, harmonics: usize| -> Option<f64> {
        let mut sum = 0.0;
        for Sampled { times, signals } in &thinned {
            let fit = fitted(times, signals, frequency, harmonics).ok()?;
            for (own, signal) in fit.residual_squares().iter().zip(signals) {
                let all = variance(signal) * signal.len() as f64;
                sum += libm::log(own / all + f64::EPSILON * f64::EPSILON);
            }
        }
        sum.is_finite().then_some(sum)
    };
    let highest = |frequency: f64, harmonics: usize| -> Option<usize> {
        let mut highest = 0;
        for Sampled { times, signals } in &thinned {
            let fit = fitted(times, signals, frequency, harmonics).ok()?;
            let count = times.len().checked_sub(1 + 2 * harmonics);
            let count = count.filter(|n| *n > 0)? as f64;
            let squares = fit.residual_squares();
            let series = fit.finish().ok()?;
            for (k, own) in squares.iter().enumerate() {
                let sigma = (own / count * 2.0 / times.len() as f64).sqrt();
                let (_, cosines, sines) = series.coefficients(k);
                let pairs = cosines.iter().zip(&sines).enumerate();
                let above = pairs.filter(|(_, (a, b))| a.hypot(**b) > MIN_AMPLITUDE * sigma);
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
    for Sampled { times, signals } in &thinned {
        let left = fitted(times, signals, frequency, harmonics)
            .ok()?
            .residual_squares();
        let mut pairs = left.iter().zip(signals);
        if pairs.any(|(left, own)| *left > MAX_LEFT_PART * variance(own) * own.len() as f64) {
            return None;
        }
    }
    // decimals, as they are printed
    let rounded = format!("{frequency:.8e}").parse().unwrap_or(frequency);
    Some((rounded, harmonics))
}

fn fitted(
    times: &[f64],
    signals: &[Vec<f64>],
    frequency: f64,
    harmonics: usize,
) -> Result<FourierFit, SignalError> {
    let mut fit = FourierFit::new(frequency, harmonics, signals.len())?;
    let mut row = vec![0.0; signals.len()];
    for (k, time) in times.iter().enumerate() {
        for (entry, signal) in row.iter_mut().zip(signals) {
            *entry = signal.get(k).copied().unwrap_or(f64::NAN);
        }
        fit.push(*time, &row)?;
    }
    Ok(fit.reduced())
}

/// Where a function with one optimum in an interval is lowest, by golden section.
fn lowest(
    [mut low, mut high]: [f64; 2],
    steps: usize,
    value: impl Fn(f64) -> Option<f64>,
) -> Option<f64> {
    let (mut a, mut b) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
    let (mut of_a, mut of_b) = (value(a)?, value(b)?);
    for _ in 0..steps {
        if of_a < of_b {
            (high, b, of_b) = (b, a, of_a);
            a = high - GOLDEN * (high - low);
            of_a = value(a)?;
        } else {
            (low, a, of_a) = (a, b, of_b);
            b = low + GOLDEN * (high - low);
            of_b = value(b)?;
        }
    }
    Some(0.5 * (low + high))
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
            let (frequency, harmonics) = fitting_series(&[sampled(0.01, rows, noise)]).unwrap();
            assert_eq!(harmonics, 6, "{rows} {noise}");
            assert!(
                (frequency / 0.213_456 - 1.0).abs() < error,
                "{frequency} {rows} {noise}"
            );
        }
        // two logs with the same period, and with another one
        let mut other = sampled(0.02, 2000, 1e-4);
        let both = [sampled(0.01, 3000, 1e-4), other.clone()];
        assert_eq!(fitting_series(&both).unwrap().1, 6);
        let mut slower = other.clone();
        slower.times.iter_mut().for_each(|t| *t *= 1.1);
        assert_eq!(fitting_series(&[sampled(0.01, 3000, 1e-4), slower]), None);
        // corners have harmonics without end
        for x in other.signals.iter_mut().flatten() {
            *x = x.signum();
        }
        assert_eq!(fitting_series(&[other]), None);
    }
}
