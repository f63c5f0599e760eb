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
/// A trace with fewer points to a period does not show it.
const MIN_POINTS: f64 = 8.0;
/// The part of a variance that is left in means over many periods, at most.
const MAX_LEFT: f64 = 0.01;

/// Finds the common period of some columns of a trace; `None` if the motion does not repeat.
///
/// Between the points of a coarse trace a short period is no minimum, but one of its multiples is, or, with few
/// points to a period, a beat of both; the beginning of the log shows the period itself.
pub(crate) fn period(trace: &Trace, positions: &[usize]) -> Option<Period> {
    let mut shortest: Option<Period> = None;
    let mut last = None;
    // from level to level, so that rounding of a large ratio does not matter
    for level in trace.finer.iter().chain([trace]) {
        let found = repeated(level, positions);
        last = match shortest {
            Some(known) if known.seconds < MIN_POINTS * level.step() => {
                let is_known = found.is_some() || level.moves_less(trace.finer.first(), positions);
                let of_level = Period {
                    repetitions: level.span() / known.seconds,
                    ..known
                };
                is_known.then_some(of_level)
            }
            Some(known) => found.map(|own| own.divided_by(known)),
            None => found,
        };
        shortest = last.or(shortest);
    }
    last
}

impl Period {
    /// The period of which this one is a multiple, if that is close to `known`.
    fn divided_by(self, known: Self) -> Self {
        let ratio = self.seconds / known.seconds;
        let times = ratio.round();
        if times <= 1.0 || (ratio - times).abs() >= MAX_PART * times.min(MAX_TIMES) {
            return self;
        }
        Self {
            seconds: self.seconds / times,
            frequency: self.frequency * times,
            repetitions: self.repetitions * times,
            ..self
        }
    }
}

impl Trace {
    fn span(&self) -> f64 {
        let ends = self.times.first().zip(self.times.last());
        ends.map_or(0.0, |(first, last)| last - first)
    }

    /// The time between the points in which a period is sought, s.
    fn step(&self) -> f64 {
        let points = self.times.len().clamp(2, Repetition::POINTS);
        self.span() / (points - 1) as f64
    }

    /// Whether what moves in another trace has nearly vanished in the means of this one.
    fn moves_less(&self, other: Option<&Self>, positions: &[usize]) -> bool {
        let variance = |trace: &Self, k: usize| -> f64 {
            let values = trace.columns.get(k).map(Vec::as_slice).unwrap_or_default();
            let n = values.len().max(1) as f64;
            let mean = values.iter().sum::<f64>() / n;
            values.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / n
        };
        other.is_some_and(|other| {
            let mut positions = positions.iter();
            positions.all(|k| variance(self, *k) <= MAX_LEFT * variance(other, *k))
        })
    }
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
        // of 6 million rows the points are means over more than a period
        for rows in [4000_u32, 40_001, 80_001, 400_001, 1_500_000, 6_000_000] {
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
    fn a_long_log_that_repeats_at_its_beginning_only_has_no_period() {
        let mut trace = Trace::default();
        for k in 0..1_500_000_u32 {
            let t = 0.0025 * f64::from(k);
            let late = (t - 900.0).max(0.0);
            trace.push(t, &[(1.2 * t + 1e-4 * late * late).sin()]);
        }
        assert_eq!(period(&trace, &[0]), None);
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
