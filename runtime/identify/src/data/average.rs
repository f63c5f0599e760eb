//! The mean over several periods of a periodic trajectory.

use super::layout::ColumnLayout;

/// The variance of an effort at a sample is estimated with at least this many degrees of freedom: a
/// few periods alone would give erratic weights, so the samples on both sides are pooled with it.
const DEGREES_OF_FREEDOM: f64 = 40.0;
/// The smallest variance of an effort relative to its mean variance over the period; bounds the
/// weights.
const MIN_RELATIVE_VARIANCE: f64 = 1e-4;

/// Means and variances over the periods, here called runs, at each sample of the period (Welford's
/// method).
pub(super) struct Average {
    step: f64,
    period: f64,
    start: Option<f64>,
    efforts: core::ops::Range<usize>,
    samples: Vec<Phase>,
}

/// A row of means over the runs, and the weights of its efforts.
pub(super) type Averaged = (Vec<f64>, Vec<f64>);

/// The statistics of one sample of the period.
#[derive(Clone)]
struct Phase {
    /// The number of runs that reached the sample.
    runs: f64,
    means: Vec<f64>,
    /// Sums of squared deviations from the means.
    squares: Vec<f64>,
}

impl Average {
    pub(super) fn new(period: f64, step: f64, layout: &ColumnLayout) -> Result<Self, String> {
        let samples = (period / step).round();
        if !(2.0..1e8).contains(&samples) {
            return Err(format!("a period of {period} s has no samples of {step} s"));
        }
        // a larger remainder would add up to half a step after ten runs
        if (samples - period / step).abs() > 0.05 {
            return Err(format!(
                "the period of {period} s is not a whole number of steps of {step} s: runs cannot \
                 be averaged"
            ));
        }
        let width = layout.channels.len();
        let empty = Phase {
            runs: 0.0,
            means: vec![0.0; width],
            squares: vec![0.0; width],
        };
        #[allow(clippy::cast_sign_loss, reason = "it is at least 2")]
        let samples = vec![empty; samples as usize];
        Ok(Self {
            step,
            period,
            start: None,
            efforts: layout.efforts(),
            samples,
        })
    }

    pub(super) fn push(&mut self, values: &[f64]) {
        let time = values[0];
        let start = *self.start.get_or_insert(time);
        let place = ((time - start).rem_euclid(self.period) / self.step).round();
        #[allow(clippy::cast_sign_loss, reason = "a remainder is not negative")]
        let place = place as usize % self.samples.len();
        let phase = &mut self.samples[place];
        phase.runs += 1.0;
        for (entry, value) in values.iter().enumerate() {
            let off = value - phase.means[entry];
            phase.means[entry] += off / phase.runs;
            phase.squares[entry] += off * (value - phase.means[entry]);
        }
    }

    /// The mean run. Each row has the weights of its efforts: the usual standard deviation of a
    /// mean over the period, divided by that of this row.
    pub(super) fn finish(self) -> Result<Vec<Averaged>, String> {
        if self.samples.iter().any(|phase| phase.runs < 2.0) {
            return Err(format!(
                "not every sample of the period of {} s was run twice: log at least two whole \
                 runs",
                self.period
            ));
        }
        let start = self.start.unwrap_or(0.0);
        // the usual variance of one run's effort
        let usual: Vec<f64> = self
            .efforts
            .clone()
            .map(|e| {
                let squares: f64 = self.samples.iter().map(|p| p.squares[e]).sum();
                let spare: f64 = self.samples.iter().map(|p| p.runs - 1.0).sum();
                squares / spare
            })
            .collect();
        let most = self.samples.iter().map(|p| p.runs).fold(0.0, f64::max);
        let n = self.samples.len();
        #[allow(clippy::cast_sign_loss, reason = "every sample was run twice or more")]
        let aside = (0.5 * DEGREES_OF_FREEDOM / (most - 1.0)).ceil() as usize;
        let aside = aside.min(n / 2);
        let rows = self.samples.iter().enumerate().map(|(k, phase)| {
            let mut values = phase.means.clone();
            values[0] = start + k as f64 * self.step;
            let around = || (0..=2 * aside).map(|d| &self.samples[(k + n + d - aside) % n]);
            let spare: f64 = around().map(|p| p.runs - 1.0).sum();
            let weights = self.efforts.clone().zip(&usual).map(|(e, usual)| {
                let variance = around().map(|p| p.squares[e]).sum::<f64>() / spare;
                if *usual > 0.0 {
                    let part = (variance / usual).max(MIN_RELATIVE_VARIANCE);
                    (phase.runs / most / part).sqrt()
                } else {
                    1.0
                }
            });
            (values, weights.collect())
        });
        Ok(rows.collect())
    }
}
