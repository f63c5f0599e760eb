//! The motion at which the instruments are computed.

use crate::estimate::EstimateError;
use crate::estimate::require;
use crate::signals::{Butterworth, Method, SignalError};
use crate::states::Source;
use regen_runtime::Model;

/// The order of the filter that smooths a measured motion; it runs forward and backward.
const FILTER_ORDER: usize = 4;
/// Least number of samples of a run that can be smoothed: the filter extends both ends.
const MIN_RUN_SAMPLES: usize = 3 * (FILTER_ORDER + 1) + 2;
/// Ratio of each cutoff frequency that is tried to the previous one: four to an octave.
const CUTOFF_RATIO: f64 = 1.189_207_115_002_721;
/// Allowed variance of what smoothing removes, over that of the noise of the positions.
const REMOVED_NOISE_RATIO: f64 = 1.1;
/// Allowed standard deviation of what smoothing removes in addition, over that of the coordinate:
/// instruments that follow the motion to this part are as good as exact ones, and a lower cutoff
/// leaves less noise in them.
const REMOVED_MOTION_PART: f64 = 0.005;

/// The motion of the independent coordinates: positions, velocities and accelerations, sample by
/// sample.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionSeries {
    dof: usize,
    times: Vec<f64>,
    /// Whether each sample follows the one before it without a gap.
    follows: Vec<bool>,
    /// For each sample: dof positions, dof velocities, dof accelerations.
    values: Vec<f64>,
}

impl MotionSeries {
    /// Creates a motion without samples, of a robot with `dof` independent coordinates.
    pub fn new(dof: usize) -> Self {
        Self {
            dof,
            times: Vec::new(),
            follows: Vec::new(),
            values: Vec::new(),
        }
    }

    /// Adds a sample.
    ///
    /// - `time`: s, after that of the sample it follows;
    /// - `q_i`, `qd_i`, `qdd_i`: the independent coordinates and their derivatives, dof each;
    /// - `follows`: whether the sample follows the one before it without a gap.
    ///
    /// # Errors
    /// When a length is not dof.
    pub fn push(
        &mut self,
        time: f64,
        [q_i, qd_i, qdd_i]: [&[f64]; 3],
        follows: bool,
    ) -> Result<(), EstimateError> {
        for values in [q_i, qd_i, qdd_i] {
            require("motion", self.dof, values.len())?;
        }
        self.times.push(time);
        self.follows.push(follows && !self.follows.is_empty());
        for values in [q_i, qd_i, qdd_i] {
            self.values.extend_from_slice(values);
        }
        Ok(())
    }

    /// Adds a run of samples whose motion is not known: NaN.
    ///
    /// - `times`: s; they increase.
    pub fn push_unknown(&mut self, times: &[f64]) {
        for (k, time) in times.iter().enumerate() {
            self.times.push(*time);
            self.follows.push(k > 0);
            self.values
                .extend(core::iter::repeat_n(f64::NAN, 3 * self.dof));
        }
    }

    /// Reads the measured motion of a log.
    ///
    /// # Errors
    /// When the log cannot be read.
    pub fn recorded<M: Model<f64> + ?Sized, S: Source + ?Sized>(
        model: &M,
        source: &mut S,
    ) -> Result<Self, S::Error> {
        let info = model.info();
        let mut out = Self::new(info.dof());
        source.visit(&mut |row| {
            let pick = |all: &[f64]| -> Vec<f64> {
                let independent = info.independent.iter();
                independent.filter_map(|c| all.get(*c).copied()).collect()
            };
            let [q, qd, qdd] = [row.q, row.qd, row.qdd].map(pick);
            out.push(row.time, [&q, &qd, &qdd], row.follows)
        })?;
        Ok(out)
    }

    /// The number of samples.
    pub fn len(&self) -> usize {
        self.times.len()
    }

    /// Whether there are no samples.
    pub fn is_empty(&self) -> bool {
        self.times.is_empty()
    }

    /// The times, s.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Whether a sample follows the one before it without a gap.
    pub fn follows(&self, at: usize) -> bool {
        self.follows.get(at).copied().unwrap_or(false)
    }

    /// Positions, velocities and accelerations of a sample (dof each); NaN where they are not known, and
    /// empty if there is no such sample.
    pub fn state(&self, at: usize) -> [&[f64]; 3] {
        let start = 3 * self.dof * at;
        [0, 1, 2].map(|d| {
            let from = start + d * self.dof;
            self.values.get(from..from + self.dof).unwrap_or_default()
        })
    }

    /// The runs of consecutive samples.
    pub fn runs(&self) -> Vec<core::ops::Range<usize>> {
        let mut out = Vec::new();
        let mut start = 0;
        for k in 1..=self.len() {
            if k == self.len() || !self.follows(k) {
                out.push(start..k);
                start = k;
            }
        }
        out
    }

    /// The positions of one coordinate in a run.
    fn positions(&self, run: &core::ops::Range<usize>, coordinate: usize) -> Vec<f64> {
        let places = run.clone().map(|k| 3 * self.dof * k + coordinate);
        places.filter_map(|k| self.values.get(k).copied()).collect()
    }

    /// Smooths the positions by a zero-phase filter and differentiates them; returns this motion,
    /// and the filter's cutoff frequency in Hz. Runs too short for the filter have no motion: they are NaN.
    ///
    /// Without a given cutoff, the lowest one that removes little but noise is chosen: what the
    /// filter removes has no more variance than white noise of the size that the fourth
    /// differences of the positions show (Morozov's discrepancy principle), and half a percent of
    /// the motion.
    ///
    /// # Errors
    /// When the sampling is not uniform, no run is long enough, or the cutoff does not suit it.
    ///
    /// ```
    /// use regen_identify::states::MotionSeries;
    ///
    /// // 1 Hz with an error of 1 mrad that changes its sign from sample to sample
    /// let mut measured = MotionSeries::new(1);
    /// for k in 0..1000 {
    ///     let t = 0.01 * f64::from(k);
    ///     let error = if k % 2 == 0 { 1e-3 } else { -1e-3 };
    ///     let q = (core::f64::consts::TAU * t).sin() + error;
    ///     measured.push(t, [&[q], &[0.0], &[0.0]], true)?;
    /// }
    /// let (smooth, cutoff) = measured.smoothed(None)?;
    /// assert!(cutoff > 1.0 && cutoff < 10.0, "{cutoff}");
    /// let velocity = smooth.state(500)[1][0];
    /// assert!((velocity - core::f64::consts::TAU).abs() < 0.05, "{velocity}");
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub fn smoothed(&self, cutoff: Option<f64>) -> Result<(Self, f64), SignalError> {
        let runs = self.runs();
        let longest = runs.iter().max_by_key(|run| run.len());
        let Some(longest) = longest.filter(|run| run.len() >= MIN_RUN_SAMPLES) else {
            return Err(SignalError::TooFew {
                samples: longest.map_or(0, core::ops::Range::len),
                needed: MIN_RUN_SAMPLES,
            });
        };
        let cutoff = match cutoff {
            Some(given) => given,
            None => self.lowest_cutoff(longest)?,
        };
        let method = Method::Butterworth {
            order: FILTER_ORDER,
            cutoff,
        };
        let mut out = Self::new(self.dof);
        for run in &runs {
            let Some(times) = self.times.get(run.clone()) else {
                continue;
            };
            if run.len() < MIN_RUN_SAMPLES {
                out.push_unknown(times);
                continue;
            }
            let pad = padding(times, cutoff)?;
            let around = mirrored(times, pad);
            let mut all = Vec::with_capacity(self.dof);
            for k in 0..self.dof {
                let positions = mirrored(&self.positions(run, k), pad);
                all.push(method.differentiate(&around, &positions)?);
            }
            for (k, time) in times.iter().enumerate() {
                out.times.push(*time);
                out.follows.push(k > 0);
                out.values.extend(all.iter().map(|one| one.value[pad + k]));
                out.values.extend(all.iter().map(|one| one.rate[pad + k]));
                out.values
                    .extend(all.iter().map(|one| one.acceleration[pad + k]));
            }
        }
        Ok((out, cutoff))
    }

    /// The lowest cutoff frequency that removes little but noise, Hz.
    fn lowest_cutoff(&self, run: &core::ops::Range<usize>) -> Result<f64, SignalError> {
        let times = self.times.get(run.clone()).unwrap_or_default();
        let span = times.last().zip(times.first());
        let span = span.map_or(f64::NAN, |(last, first)| last - first);
        let step = span / (times.len().max(2) - 1) as f64;
        let columns: Vec<Vec<f64>> = (0..self.dof).map(|k| self.positions(run, k)).collect();
        let noises: Vec<f64> = columns.iter().map(|x| noise(x)).collect();
        let highest = 0.4 / step;
        let lowest = (4.0 / span).min(highest);
        let mut cutoff = lowest;
        while cutoff < highest {
            let filter = Butterworth::new(FILTER_ORDER, cutoff, step)?;
            let pad = padding(times, cutoff)?;
            // the extension of both ends is a guess, so the samples near them are not compared
            let inside = if 4 * pad < times.len() {
                pad..times.len() - pad
            } else {
                0..times.len()
            };
            let mut suffices = true;
            for (x, noise) in columns.iter().zip(&noises) {
                let smooth = filter.zero_phase(&mirrored(x, pad))?;
                let pairs = x.iter().zip(smooth.iter().skip(pad));
                let squares = pairs.map(|(a, b)| (a - b) * (a - b));
                let squares: f64 = squares.skip(inside.start).take(inside.len()).sum();
                let part = 1.0 - 2.0 * cutoff * step;
                let allowed = REMOVED_NOISE_RATIO * part * noise
                    + REMOVED_MOTION_PART * REMOVED_MOTION_PART * variance(x);
                if squares / inside.len() as f64 > allowed {
                    suffices = false;
                    break;
                }
            }
            if suffices {
                return Ok(cutoff);
            }
            cutoff *= CUTOFF_RATIO;
        }
        Ok(highest)
    }
}

/// The number of samples by which both ends are extended: until the filter has settled.
fn padding(times: &[f64], cutoff: f64) -> Result<usize, SignalError> {
    let span = times.last().zip(times.first());
    let span = span.map_or(f64::NAN, |(last, first)| last - first);
    let most = times.len().saturating_sub(1);
    let filter = Butterworth::new(FILTER_ORDER, cutoff, span / most as f64)?;
    Ok(filter.settling().clamp(1, most.max(1)))
}

/// Samples with both ends extended by their mirror image about the end point.
fn mirrored(x: &[f64], pad: usize) -> Vec<f64> {
    let (Some(first), Some(last)) = (x.first(), x.last()) else {
        return Vec::new();
    };
    let before = x.iter().skip(1).take(pad).rev().map(|v| 2.0 * first - v);
    let after = x.iter().rev().skip(1).take(pad).map(|v| 2.0 * last - v);
    before.chain(x.iter().copied()).chain(after).collect()
}

fn variance(x: &[f64]) -> f64 {
    let count = x.len().max(1) as f64;
    let mean = x.iter().sum::<f64>() / count;
    x.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / count
}

/// The variance of white noise from fourth differences, whose squared weights add up to 70.
fn noise(x: &[f64]) -> f64 {
    let fourth = |w: &[f64]| w[0] - 4.0 * w[1] + 6.0 * w[2] - 4.0 * w[3] + w[4];
    let squares: f64 = x.windows(5).map(|w| fourth(w) * fourth(w)).sum();
    squares / (70.0 * x.len().saturating_sub(4).max(1) as f64)
}
