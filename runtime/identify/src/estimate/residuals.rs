//! Statistics of the residuals: errors, whiteness, and covariances that account for
//! autocorrelation.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::factor::size;
use super::products::OuterProducts;
use super::solution::inverse_gram;
use super::{Autoregression, EstimateError, QrFactor};

/// How well one effort is predicted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EffortError {
    /// The effort's name.
    pub name: String,
    /// The number of samples.
    pub samples: usize,
    /// The relative absolute error eps_RA in percent (Eq. 33), around the effort's own mean; infinite where the
    /// effort is the same throughout.
    pub relative_absolute: f64,
    /// The root mean square of the residuals, N or N m.
    pub rms: f64,
    /// The root mean square of the residuals in percent of that of the measured effort.
    pub relative_rms: f64,
    /// The largest absolute residual, N or N m.
    pub largest: f64,
    /// The autocorrelation of the residuals at lags 1, 2, ...
    pub autocorrelation: Vec<f64>,
    /// The probability of at least this autocorrelation if the residuals were white (Ljung and
    /// Box, 1978).
    #[serde(rename = "white")]
    pub whiteness_p_value: f64,
}

/// Residuals count as correlated when white ones would have this little probability of at least
/// their autocorrelation.
const MIN_WHITE_PROBABILITY: f64 = 0.01;
/// An effort counts as explained when the root mean square of its residuals is at most this
/// percentage of that of the effort.
const MAX_EXPLAINED_RMS_PERCENT: f64 = 50.0;
/// Residuals whose autocorrelations at the first [`SLOW_LAGS`] lags have a larger mean are slower than
/// filtered noise.
const MIN_SLOW_AUTOCORRELATION: f64 = 0.7;
const SLOW_LAGS: usize = 5;
/// The first lag at which filtered noise has forgotten itself.
const FIRST_LATE_LAG: usize = 10;
/// Residuals whose autocorrelations from there on have a larger root mean square are those of a motion, and so many
/// deviations of chance.
const MIN_LATE_AUTOCORRELATION: f64 = 0.25;
const MIN_LATE_DEVIATIONS: f64 = 2.5;

impl EffortError {
    /// Whether the residuals are correlated in time; `None` where too few of them are known.
    pub fn is_correlated(&self) -> Option<bool> {
        (!self.whiteness_p_value.is_nan()).then_some(self.whiteness_p_value < MIN_WHITE_PROBABILITY)
    }

    /// Whether the model explains the effort: the root mean square of the residuals is at most half
    /// of that of the effort. An effort that is always zero has no relative error and counts as not
    /// explained.
    ///
    /// ```
    /// use regen_identify::estimate::EffortError;
    ///
    /// let error = EffortError {
    ///     name: "q1".to_owned(),
    ///     samples: 100,
    ///     relative_absolute: 60.0,
    ///     rms: 2.0,
    ///     relative_rms: 55.0,
    ///     largest: 7.0,
    ///     autocorrelation: vec![0.5],
    ///     whiteness_p_value: 1e-6,
    /// };
    /// assert!(!error.is_explained());
    /// assert_eq!(error.is_correlated(), Some(true));
    /// // means of two rows have three quarters of the variance
    /// assert!(error.of_means().is_explained());
    /// // those of an effort that is noise alone have no more of it explained
    /// let noise = EffortError { relative_rms: 100.0, autocorrelation: vec![0.0; 20], ..error };
    /// assert!(!noise.of_means().is_explained());
    /// ```
    pub fn is_explained(&self) -> bool {
        self.relative_rms <= MAX_EXPLAINED_RMS_PERCENT && !self.misses_change()
    }

    /// The error of the means of as many consecutive rows as autocorrelations are known: what is left of noise that
    /// no filter removed says nothing of the model.
    #[must_use]
    pub fn of_means(&self) -> Self {
        let rows = (self.autocorrelation.len() + 1) as f64;
        let lags = self.autocorrelation.iter().zip(1_u32..);
        let sum: f64 = lags.map(|(x, lag)| (1.0 - f64::from(lag) / rows) * x).sum();
        let part = ((1.0 + 2.0 * sum) / rows).clamp(0.0, 1.0);
        let left = (self.relative_rms / 100.0).powi(2);
        // of an effort that is noise alone, its own means are smaller, too
        let explained = (1.0 - left).max(0.0);
        let of_means = part * left / (explained + part * left);
        let relative_rms = if left.is_finite() && left > 0.0 {
            100.0 * of_means.sqrt()
        } else {
            self.relative_rms
        };
        Self {
            relative_rms,
            ..self.clone()
        }
    }

    /// The standard deviation of what the residuals leave of the effort about its mean, N or N m: what the model
    /// explains of it.
    pub fn explained(&self) -> f64 {
        let part = self.relative_absolute / 100.0;
        let square = (self.rms / part).powi(2) - self.rms.powi(2);
        square.max(0.0).sqrt()
    }

    /// Whether most of the change of the effort is left, and so slowly, or swinging so long, that it is no noise: a
    /// constant, such as a weight, makes the residuals small beside the effort, and explains nothing of its change.
    pub fn misses_change(&self) -> bool {
        let first = self.autocorrelation.iter().take(SLOW_LAGS);
        let mean = first.sum::<f64>() / SLOW_LAGS as f64;
        let late = self.autocorrelation.get(FIRST_LATE_LAG - 1..);
        let late = late
            .filter(|late| late.len() > SLOW_LAGS)
            .unwrap_or_default();
        let squares = late.iter().map(|x| x * x).sum::<f64>();
        let rms = (squares / late.len().max(1) as f64).sqrt();
        let chance = (SLOW_LAGS as f64 / self.samples.max(1) as f64).sqrt();
        let swings = rms > MIN_LATE_AUTOCORRELATION.max(MIN_LATE_DEVIATIONS * chance);
        self.relative_absolute > MAX_EXPLAINED_RMS_PERCENT
            && (mean > MIN_SLOW_AUTOCORRELATION || swings)
    }
}

/// Sums over the residuals of one effort, in order of time.
#[derive(Clone, Debug)]
struct Sums {
    /// The effort's mean over all samples, N or N m.
    mean: f64,
    samples: usize,
    /// Sum of the absolute residuals.
    absolute: f64,
    /// Sum of the absolute deviations of the measured effort from `mean`.
    spread: f64,
    /// Sum of the squared measured effort.
    measured: f64,
    /// Sum of the residuals.
    sum: f64,
    largest: f64,
    /// Sums of e(t) e(t - l), l = 0, 1, ...: entry 0 is the sum of squared residuals.
    lagged: Vec<f64>,
    /// The last residuals, the newest first.
    recent: VecDeque<f64>,
}

/// An effort whose mean deviation from its mean is below this part of it is the same throughout, but for rounding.
const MAX_CONSTANT_PART: f64 = 1e-9;

impl Sums {
    /// eps_RA in percent: infinite where the effort is the same throughout, NaN where it is so and explained.
    fn relative_absolute(&self) -> f64 {
        let rounding = MAX_CONSTANT_PART * (self.measured * self.samples as f64).sqrt();
        match (self.spread > rounding, self.absolute > rounding) {
            (true, _) => 100.0 * self.absolute / self.spread,
            (false, true) => f64::INFINITY,
            (false, false) => f64::NAN,
        }
    }
}

/// Collects the residuals of all efforts in order of time, and computes their statistics.
///
/// ```
/// use regen_identify::estimate::Residuals;
///
/// let mut residuals = Residuals::new(&["q1".to_owned()], &[2.0], 1);
/// for (measured, predicted) in [(1.0, 1.5), (3.0, 2.5)] {
///     residuals.push(&[measured], &[predicted])?;
/// }
/// // (0.5 + 0.5) / (1 + 1) and sqrt((0.25 + 0.25) / 2)
/// assert_eq!(residuals.relative_absolute(), 50.0);
/// assert_eq!(residuals.efforts()[0].rms, 0.5);
/// # Ok::<(), regen_identify::estimate::EstimateError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Residuals {
    names: Vec<String>,
    sums: Vec<Sums>,
}

impl Residuals {
    /// Starts a collection.
    ///
    /// - `means`: each effort's mean over all samples, N or N m (Eq. 33);
    /// - `lags`: the number of lags at which the autocorrelation is computed.
    pub fn new(names: &[String], means: &[f64], lags: usize) -> Self {
        let one = |mean: f64| Sums {
            mean,
            samples: 0,
            absolute: 0.0,
            spread: 0.0,
            measured: 0.0,
            sum: 0.0,
            largest: 0.0,
            lagged: vec![0.0; lags + 1],
            recent: VecDeque::with_capacity(lags + 1),
        };
        let all = means.iter().copied().chain(core::iter::repeat(0.0));
        Self {
            names: names.to_vec(),
            sums: all.take(names.len()).map(one).collect(),
        }
    }

    /// Starts a new run: the next sample does not follow the last one in time.
    pub fn interrupt(&mut self) {
        for sums in &mut self.sums {
            sums.recent.clear();
        }
    }

    /// Adds a sample of all efforts, measured and predicted, N or N m.
    ///
    /// # Errors
    /// When a length does not fit.
    pub fn push(&mut self, measured: &[f64], predicted: &[f64]) -> Result<(), EstimateError> {
        self.push_used(measured, predicted, &vec![true; measured.len()])
    }

    /// Like [`push`](Self::push), but skips the efforts whose entry in `used` is false; their
    /// lagged products start anew.
    ///
    /// # Errors
    /// When a length does not fit.
    pub fn push_used(
        &mut self,
        measured: &[f64],
        predicted: &[f64],
        used: &[bool],
    ) -> Result<(), EstimateError> {
        size("measured", self.sums.len(), measured.len())?;
        size("predicted", self.sums.len(), predicted.len())?;
        size("used", self.sums.len(), used.len())?;
        let pairs = measured.iter().zip(predicted).zip(used);
        for (sums, ((m, p), used)) in self.sums.iter_mut().zip(pairs) {
            if !used {
                sums.recent.clear();
                continue;
            }
            let e = m - p;
            sums.samples += 1;
            sums.absolute += e.abs();
            sums.spread += (m - sums.mean).abs();
            sums.measured += m * m;
            sums.sum += e;
            sums.largest = sums.largest.max(e.abs());
            if sums.recent.len() == sums.lagged.len() {
                sums.recent.pop_back();
            }
            sums.recent.push_front(e);
            for (sum, past) in sums.lagged.iter_mut().zip(&sums.recent) {
                *sum += e * past;
            }
        }
        Ok(())
    }

    /// The models of each effort's noise: its residuals as an autoregression. For up to
    /// [`ORDER`](super::ORDER) coefficients there must be as many lags.
    pub fn autoregressions(&self) -> Vec<Autoregression> {
        let efforts = self.efforts();
        let fit =
            |e: &EffortError| Autoregression::fit(e.rms * e.rms, &e.autocorrelation, e.samples);
        efforts.iter().map(fit).collect()
    }

    /// The errors of each effort.
    pub fn efforts(&self) -> Vec<EffortError> {
        let one = |(name, sums): (&String, &Sums)| {
            let squares = sums.lagged.first().copied().unwrap_or(0.0);
            let samples = sums.samples.max(1) as f64;
            let autocorrelation: Vec<f64> = sums
                .lagged
                .iter()
                .skip(1)
                .map(|s| if squares > 0.0 { s / squares } else { 0.0 })
                .collect();
            EffortError {
                name: name.clone(),
                samples: sums.samples,
                relative_absolute: sums.relative_absolute(),
                rms: (squares / samples).sqrt(),
                relative_rms: 100.0 * (squares / sums.measured).sqrt(),
                largest: sums.largest,
                whiteness_p_value: ljung_box(&autocorrelation, sums.samples),
                autocorrelation,
            }
        };
        self.names.iter().zip(&self.sums).map(one).collect()
    }

    /// The root mean square of the residuals of all efforts in percent of that of all measured
    /// efforts. It is meaningful only if all efforts have the same unit.
    pub fn relative_rms(&self) -> f64 {
        let residual: f64 = self.sums.iter().filter_map(|s| s.lagged.first()).sum();
        let measured: f64 = self.sums.iter().map(|s| s.measured).sum();
        100.0 * (residual / measured).sqrt()
    }

    /// The relative absolute error over all efforts in percent (Eq. 33).
    pub fn relative_absolute(&self) -> f64 {
        let absolute: f64 = self.sums.iter().map(|s| s.absolute).sum();
        let spread: f64 = self.sums.iter().map(|s| s.spread).sum();
        100.0 * absolute / spread
    }
}

/// The probability that white noise has autocorrelations at least as large (Ljung and Box, 1978);
/// NaN for too few samples.
fn ljung_box(autocorrelation: &[f64], samples: usize) -> f64 {
    let t = samples as f64;
    let lags = autocorrelation.len();
    if samples <= lags + 1 || lags == 0 {
        return f64::NAN;
    }
    let terms = autocorrelation.iter().zip(1_u32..);
    let q: f64 = terms.map(|(r, l)| r * r / (t - f64::from(l))).sum();
    let q = t * (t + 2.0) * q;
    ChiSquared::new(lags as f64).map_or(f64::NAN, |c| c.sf(q))
}

/// The average relative error eps_AV of parameters against exact ones (Eq. 34), as a fraction.
///
/// # Errors
/// When the lengths differ.
///
/// ```
/// use regen_identify::estimate::average_relative_error;
/// assert_eq!(average_relative_error(&[2.0, -4.0], &[1.0, -4.0]), Ok(0.25));
/// ```
pub fn average_relative_error(exact: &[f64], estimated: &[f64]) -> Result<f64, EstimateError> {
    size("estimated", exact.len(), estimated.len())?;
    let errors = exact
        .iter()
        .zip(estimated)
        .map(|(e, x)| ((e - x) / e).abs());
    Ok(errors.sum::<f64>() / exact.len() as f64)
}

/// The number of independent stretches of a log in a covariance with Bartlett's weights, which is its
/// degrees of freedom: 1.5 times the number of samples over the bandwidth (Priestley, 1981, table 6.2).
pub(crate) fn bartlett_stretches(samples: usize, bandwidth: usize) -> f64 {
    (1.5 * samples as f64 / bandwidth.max(1) as f64).max(1.0)
}

/// The factor of a covariance with Bartlett's weights for what residuals lack of the noise, as a fit
/// leaves their scores without a mean: 1 / (1 - b + b^2/3) for lags up to the part b of the samples
/// (the expectation of the limit of Kiefer and Vogelsang, 2005).
pub(crate) fn bartlett_growth(samples: usize, bandwidth: usize) -> f64 {
    let lags = bandwidth.saturating_sub(1);
    let part = (lags as f64 / samples.max(1) as f64).min(1.0);
    1.0 / (1.0 - part + part * part / 3.0)
}

/// The covariance of estimates whose residuals are correlated in time and across efforts (Newey and
/// West, 1987), computed in one pass and in memory that does not grow with the log.
///
/// The scores are u(t) = sum over efforts of w(t) e(t). Weighting the products u(t) u(t-l)^T by
/// Bartlett's 1 - l/B is the same as adding up the squares of the sums over all windows of B
/// samples, because each pair l apart is in B - l windows. So one running sum over the last B
/// samples is enough.
#[derive(Clone, Debug)]
pub struct Autocorrelated {
    bandwidth: usize,
    /// The scores in the current window, the oldest first.
    recent: VecDeque<Vec<f64>>,
    /// The score that left the window last, whose memory is used again.
    spare: Vec<f64>,
    /// Their sum.
    window: Vec<f64>,
    /// The sum of the squares (outer products) of the window sums.
    squares: OuterProducts,
}

impl Autocorrelated {
    /// Starts for n parameters with the window length `bandwidth`: lags up to `bandwidth - 1`
    /// count, at least lag 0.
    pub fn new(parameters: usize, bandwidth: usize) -> Self {
        Self {
            bandwidth: bandwidth.max(1),
            recent: VecDeque::new(),
            spare: Vec::new(),
            window: vec![0.0; parameters],
            squares: OuterProducts::new(parameters, true),
        }
    }

    /// Adds the score of a sample, n entries: the weighted rows times their weighted residuals,
    /// summed over the efforts.
    ///
    /// # Errors
    /// When the length does not fit.
    pub fn push(&mut self, score: &[f64]) -> Result<(), EstimateError> {
        size("score", self.window.len(), score.len())?;
        for (sum, u) in self.window.iter_mut().zip(score) {
            *sum += u;
        }
        let mut own = core::mem::take(&mut self.spare);
        own.clear();
        own.extend_from_slice(score);
        self.recent.push_back(own);
        self.add_window();
        if self.recent.len() == self.bandwidth {
            self.drop_oldest();
        }
        Ok(())
    }

    /// Ends the run: the next sample does not follow the last one in time, so no window spans both.
    pub fn interrupt(&mut self) {
        if !self.recent.is_empty() {
            // a run shorter than a window lies entirely inside several windows
            for _ in self.recent.len() + 1..self.bandwidth {
                self.add_window();
            }
        }
        while !self.recent.is_empty() {
            self.add_window();
            self.drop_oldest();
        }
        self.window.fill(0.0);
    }

    fn drop_oldest(&mut self) {
        if let Some(oldest) = self.recent.pop_front() {
            for (sum, u) in self.window.iter_mut().zip(&oldest) {
                *sum -= u;
            }
            self.spare = oldest;
        }
    }

    fn add_window(&mut self) {
        self.squares.push(&self.window, &self.window);
    }

    /// The covariance (W^T W)^-1 S (W^T W)^-1 of the estimate from this weighted factor, corrected
    /// for the degrees of freedom that the parameters take; n x n, column-major.
    ///
    /// # Errors
    /// When sizes do not fit or the factor is singular.
    pub fn covariance(mut self, factor: &QrFactor) -> Result<Vec<f64>, EstimateError> {
        self.interrupt();
        let n = self.window.len();
        size("columns", n, factor.columns())?;
        let bread = inverse_gram(factor).ok_or(EstimateError::NoConvergence)?;
        let rows = factor.rows() as f64;
        let spare = factor.rows().saturating_sub(n).max(1) as f64;
        let scale = rows / spare / self.bandwidth as f64;
        let squares = self.squares.take();
        let meat = |i: usize, j: usize| squares[i.min(j) * n + i.max(j)];
        let mut half = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..n {
                half[j * n + i] = (0..n).map(|k| meat(i, k) * bread[j * n + k]).sum();
            }
        }
        let mut out = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..=i {
                let sum: f64 = (0..n).map(|k| bread[i * n + k] * half[j * n + k]).sum();
                out[i * n + j] = scale * sum;
                out[j * n + i] = scale * sum;
            }
        }
        Ok(out)
    }
}

#[cfg(test)]
mod tests {
    use super::{EffortError, bartlett_growth};

    #[test]
    fn what_white_noise_lacks_about_its_mean_is_given_back() {
        for (samples, bandwidth) in [(64_usize, 1_usize), (64, 17), (250, 60), (1000, 400)] {
            let (n, window) = (samples as f64, bandwidth as f64);
            // about their mean, samples l apart have the covariance -(1 - l/n)/n in place of none
            let lags = (1..bandwidth).map(|l| (1.0 - l as f64 / window) * (1.0 - l as f64 / n));
            let expected = 1.0 - 1.0 / n - 2.0 / n * lags.sum::<f64>();
            let corrected = expected * n / (n - 1.0) * bartlett_growth(samples, bandwidth);
            assert!(
                (corrected - 1.0).abs() < 5e-3,
                "{samples}, {bandwidth}: {corrected}"
            );
        }
    }

    #[test]
    fn residuals_that_swing_on_are_told_from_filtered_noise() {
        let of = |samples: usize, autocorrelation: &dyn Fn(f64) -> f64| EffortError {
            name: "q1".to_owned(),
            samples,
            relative_absolute: 110.0,
            rms: 1.0,
            relative_rms: 15.0,
            largest: 3.0,
            autocorrelation: (1..=20).map(|k| autocorrelation(f64::from(k))).collect(),
            whiteness_p_value: 0.0,
        };
        let swings = |lag: f64| (0.3 * lag).cos() * (-0.03 * lag).exp();
        let noise = |lag: f64| (0.3 * lag).cos() * (-0.3 * lag).exp();
        assert!(of(250, &swings).misses_change());
        assert!(!of(250, &noise).misses_change());
        // of few samples chance swings as far
        assert!(!of(60, &swings).misses_change());
        assert!(of(60, &|_| 0.9).misses_change());
        let explained = EffortError {
            relative_absolute: 40.0,
            ..of(250, &swings)
        };
        assert!(!explained.misses_change());
    }
}
