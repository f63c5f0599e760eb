//! Finds the period of a motion that repeats itself.

use regen_identify::signals::Repetition;
use serde::Serialize;

use crate::gather::Trace;

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
    let columns = positions.iter().filter_map(|k| trace.columns.get(*k));
    let signals: Vec<&[f64]> = columns.map(Vec::as_slice).collect();
    let found = Repetition::of_signals(&trace.times, &signals)?;
    Some(Period {
        seconds: found.seconds,
        frequency: 1.0 / found.seconds,
        repetitions: (trace.times.last()? - trace.times.first()?) / found.seconds,
        difference: 100.0 * found.difference,
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
