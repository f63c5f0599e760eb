//! Finds the period of a motion that repeats itself.

use serde::Serialize;

use crate::gather::Trace;

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

/// A periodic motion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Period {
    /// The period, s.
    pub seconds: f64,
    /// Its inverse, Hz.
    pub frequency: f64,
    /// The number of periods in the log.
    pub repetitions: f64,
    /// The rms difference between periods over the rms of the motion, percent.
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

/// How far a multiple of a period may be from a whole number of them.
const MAX_PART: f64 = 0.03;
/// From this ratio on the whole number is not less certain.
const MAX_TIMES: f64 = 10.0;

/// Finds the common period of some columns of a trace; `None` if the motion does not repeat.
///
/// Between the points of a coarse trace a short period is no minimum, but one of its multiples is; the
/// beginning of the log shows the period itself.
pub(crate) fn period(trace: &Trace, positions: &[usize]) -> Option<Period> {
    let whole = repeated(trace, positions)?;
    let mut count = 1.0;
    // from level to level, so that rounding of a large ratio does not matter
    for found in trace
        .finer
        .iter()
        .rev()
        .filter_map(|own| repeated(own, positions))
    {
        let ratio = whole.seconds / count / found.seconds;
        let times = ratio.round();
        if times > 1.0 && (ratio - times).abs() < MAX_PART * times.min(MAX_TIMES) {
            count *= times;
        }
    }
    Some(Period {
        seconds: whole.seconds / count,
        frequency: whole.frequency * count,
        repetitions: whole.repetitions * count,
        ..whole
    })
}

/// The period of the points of one trace.
fn repeated(trace: &Trace, positions: &[usize]) -> Option<Period> {
    let n = trace.times.len();
    let every = n.div_ceil(POINTS).max(1);
    let thin = |column: &usize| -> Option<Vec<f64>> {
        let values = trace.columns.get(*column)?;
        Some(values.iter().step_by(every).copied().collect())
    };
    let thinned: Vec<Vec<f64>> = positions.iter().filter_map(thin).collect();
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
        (b <= a && b <= c && bottom < MAX_PERIOD_DIFFERENCE).then_some((lag as f64 + shift, bottom))
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
    let span = trace.times.last()? - trace.times.first()?;
    let step = span / (n - 1).max(1) as f64 * every as f64;
    let seconds = lag * step;
    (seconds > 0.0).then(|| Period {
        seconds,
        frequency: 1.0 / seconds,
        repetitions: span / seconds,
        difference: 100.0 * (2.0 * bottom).sqrt(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Noise;

    fn trace(seconds: f64, signals: &[&dyn Fn(f64) -> f64]) -> Trace {
        let times: Vec<f64> = (0..4000).map(|k| seconds * f64::from(k) / 4000.0).collect();
        let mut noise = Noise::new(5);
        let column = |f: &&dyn Fn(f64) -> f64| {
            let value = |t: &f64| f(*t) + 1e-3 * noise.normal();
            times.iter().map(value).collect()
        };
        Trace {
            columns: signals.iter().map(column).collect(),
            times,
            ..Trace::default()
        }
    }

    #[test]
    fn the_period_of_a_motion_is_found_and_not_that_of_one_joint() {
        let w = core::f64::consts::TAU / 6.47;
        let one = |t: f64| (w * t).sin() + 0.5 * (3.0 * w * t).cos();
        let two = |t: f64| (2.0 * w * t).sin();
        let found = period(&trace(40.0, &[&one, &two]), &[0, 1]).unwrap();
        assert!((found.seconds / 6.47 - 1.0).abs() < 2e-3, "{found:?}");
        assert!((found.repetitions - 40.0 / 6.47).abs() < 0.02 && found.difference < 2.0);
        // a motion that does not repeat, a log shorter than its period, and rests at both ends
        let grows = |t: f64| t * (0.9 * t).sin();
        assert_eq!(period(&trace(40.0, &[&grows]), &[0]), None);
        assert_eq!(period(&trace(6.0, &[&one, &two]), &[0, 1]), None);
        let once = |t: f64| {
            if (15.0..25.0).contains(&t) {
                (1.7 * (t - 15.0)).sin()
            } else {
                0.0
            }
        };
        assert_eq!(period(&trace(40.0, &[&once]), &[0]), None);
    }

    #[test]
    fn the_period_is_found_between_the_samples_of_the_thinned_log() {
        // a whole number of points and a quarter, and a half, and three quarters
        for part in [0.25, 0.5, 0.75] {
            let seconds = (150.0 + part) * 0.04;
            let w = core::f64::consts::TAU / seconds;
            let times: Vec<f64> = (0..1000).map(|k| 0.04 * f64::from(k)).collect();
            let trace = Trace {
                columns: vec![times.iter().map(|t| (w * t).sin()).collect()],
                times,
                ..Trace::default()
            };
            let found = period(&trace, &[0]).unwrap();
            assert!(
                (found.seconds - seconds).abs() < 0.05 * 0.04,
                "{part} {found:?}"
            );
        }
    }

    #[test]
    fn the_period_of_a_long_log_is_the_shortest_and_no_multiple() {
        // the points of the whole log are 31.25 to a period, and do not meet it
        let motion = |t: f64| {
            let w = core::f64::consts::TAU / 5.0;
            (w * t).sin() + 0.5 * (4.0 * w * t).cos() + 0.4 * (5.0 * w * t).sin()
        };
        for rows in [4000_u32, 40_001, 80_001, 400_001] {
            let mut trace = Trace::default();
            for k in 0..rows {
                let t = 0.0025 * f64::from(k);
                trace.push(t, &[motion(t)]);
            }
            let found = period(&trace, &[0]);
            if rows == 4000 {
                // two periods
                assert!(
                    found.is_some_and(|f| (f.seconds - 5.0).abs() < 0.05),
                    "{found:?}"
                );
                continue;
            }
            let found = found.unwrap();
            assert!((found.seconds - 5.0).abs() < 0.01, "{rows} {found:?}");
            let count = 0.0025 * f64::from(rows) / 5.0;
            assert!(
                (found.repetitions / count - 1.0).abs() < 0.01,
                "{rows} {found:?}"
            );
        }
    }

    #[test]
    fn a_period_of_few_samples_is_found() {
        let w = core::f64::consts::TAU / 0.31;
        let times: Vec<f64> = (0..1500).map(|k| 0.01 * f64::from(k)).collect();
        let trace = Trace {
            columns: vec![times.iter().map(|t| (w * t).sin()).collect()],
            times,
            ..Trace::default()
        };
        let found = period(&trace, &[0]).unwrap();
        assert!((found.seconds - 0.31).abs() < 1e-3, "{found:?}");
    }
}
