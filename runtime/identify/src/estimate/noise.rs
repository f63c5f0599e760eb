//! Autoregressive models of residuals, from which the correlation time of the noise follows.

use core::f64::consts::PI;

use serde::{Deserialize, Serialize};

/// The highest order of an autoregression.
pub const ORDER: usize = 6;
/// White noise, as a fraction of the variance, that is added to the autocovariance before a fit: a
/// low-pass filter leaves almost nothing at high frequencies, and without the addition the fit
/// would invert almost nothing.
const WHITE_PART: f64 = 1e-3;

/// A stationary autoregression: each value is a weighted sum of the previous values plus an
/// innovation that cannot be predicted from them. Read backwards in time it has the same
/// coefficients (Brockwell and Davis, 1991, section 8.3).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Autoregression {
    /// The weights of the previous values, the most recent first.
    pub coefficients: Vec<f64>,
    /// The variance of the values.
    pub variance: f64,
    /// The variance of the innovations, in the same unit as `variance`.
    pub innovation: f64,
    /// The number of coefficients that were fitted to values: none of those that a filter gives.
    #[serde(default)]
    pub fitted: usize,
}

/// The autoregression of a filter has at most so many coefficients.
const MAX_FILTER_ORDER: usize = 40;
/// It has enough of them if its spectrum is that of the filter within this part, at these parts of the frequency at
/// which the filter has halved the power.
const SPECTRUM_PART: f64 = 0.02;
const CHECKED_FREQUENCIES: [f64; 4] = [0.0, 0.3, 0.6, 0.9];
/// Spectra are computed at so many frequencies.
const FREQUENCIES: usize = 1024;

impl Autoregression {
    /// White noise of this variance.
    pub fn white(variance: f64) -> Self {
        Self {
            coefficients: Vec::new(),
            variance,
            innovation: variance,
            fitted: 0,
        }
    }

    /// Fits an autoregression (Levinson and Durbin) of the order that Akaike's criterion chooses,
    /// at most [`ORDER`].
    ///
    /// - `variance`: of the values; `autocorrelation`: at lags 1, 2, ...; `samples`: the number of
    ///   values from which both were computed.
    ///
    /// ```
    /// use regen_identify::estimate::Autoregression;
    ///
    /// let found = Autoregression::fit(2.0, &[0.9, 0.81, 0.729, 0.6561], 10_000);
    /// assert!((found.coefficients[0] - 0.9).abs() < 0.01);
    /// // (1 + 0.9) / (1 - 0.9) samples carry as much information as one independent sample
    /// assert!((found.correlation_length() - 19.0).abs() < 0.5);
    /// assert_eq!(Autoregression::fit(2.0, &[0.0, 0.0], 10_000).correlation_length(), 1.0);
    /// ```
    pub fn fit(variance: f64, autocorrelation: &[f64], samples: usize) -> Self {
        Self::white(1.0).fit_behind(variance, autocorrelation, samples)
    }

    /// The noise behind this filter: white noise that passed it, or an autoregression that passed it, or one that
    /// did not, whichever Akaike's criterion chooses.
    ///
    /// - `self`: of [`of_filter`](Self::of_filter), or white without a filter;
    /// - `autocorrelation`: at as many lags as the filter has coefficients, and [`ORDER`] more; with fewer the
    ///   filter is taken for none.
    pub(crate) fn fit_behind(
        &self,
        variance: f64,
        autocorrelation: &[f64],
        samples: usize,
    ) -> Self {
        let mut best = Self::white(variance);
        // a variance that is NaN is refused too
        if !(variance > 0.0 && variance.is_finite()) {
            return best;
        }
        let at = |lag: usize| match lag {
            0 => 1.0 + WHITE_PART,
            _ => autocorrelation.get(lag - 1).copied().unwrap_or(0.0),
        };
        let mut least = f64::INFINITY;
        let is_filtered = (1..=autocorrelation.len()).contains(&self.coefficients.len());
        let filters = [Self::white(1.0), self.clone()];
        for filter in filters.iter().take(1 + usize::from(is_filtered)) {
            let weights = filter.polynomial();
            let most = ORDER.min(autocorrelation.len() + 1 - weights.len());
            // the autocovariance of the values before the filter
            let before = (0..=most.min(samples / 4)).map(|lag| {
                let terms = weights.iter().enumerate().map(|(i, a)| {
                    let own = weights.iter().enumerate();
                    let own = own.map(|(j, b)| b * at((lag + i).abs_diff(j)));
                    a * own.sum::<f64>()
                });
                terms.sum::<f64>()
            });
            let before: Vec<f64> = before.collect();
            let mut consider = |fitted: &[f64], remaining: f64| {
                let own = samples as f64 * libm::log(remaining) + 2.0 * fitted.len() as f64;
                if own < least {
                    least = own;
                    best.coefficients = product(&weights, fitted);
                    best.fitted = fitted.len();
                    // the addition to the variance of what no coefficient explains is no part of it
                    best.innovation = variance
                        * if fitted.is_empty() {
                            filter.innovation
                        } else {
                            remaining
                        };
                }
                true
            };
            consider(&[], before.first().copied().unwrap_or(1.0));
            levinson(&before, &mut consider);
        }
        best
    }

    /// White noise behind a filter, with variance 1: of the lowest order that has the filter's spectrum. White noise if
    /// there is no such order up to 40.
    ///
    /// - `autocorrelation`: at lags 1, 2, ... until the filter has forgotten a value.
    pub(crate) fn of_filter(autocorrelation: &[f64]) -> Self {
        let all: Vec<f64> = [1.0 + WHITE_PART]
            .into_iter()
            .chain(autocorrelation.iter().copied())
            .collect();
        let exact = |cycles: f64| {
            let lags = autocorrelation.iter().zip(1_u32..);
            let sum: f64 = lags
                .map(|(x, lag)| x * libm::cos(2.0 * PI * cycles * f64::from(lag)))
                .sum();
            1.0 + 2.0 * sum
        };
        // the first frequency with half the power
        let half = (0..FREQUENCIES)
            .map(|k| 0.5 * k as f64 / FREQUENCIES as f64)
            .find(|cycles| exact(*cycles) < 0.5 * exact(0.0))
            .unwrap_or(0.5);
        let mut found = Self::white(1.0);
        let most = all.get(..=MAX_FILTER_ORDER).unwrap_or(&all);
        levinson(most, &mut |coefficients, remaining| {
            let own = Self {
                coefficients: coefficients.to_vec(),
                variance: 1.0,
                innovation: remaining,
                fitted: 0,
            };
            let agrees = |part: f64| {
                let cycles = part * half;
                (own.spectrum(cycles) / exact(cycles) - 1.0).abs() < SPECTRUM_PART
            };
            let is_enough = CHECKED_FREQUENCIES.into_iter().all(agrees);
            if is_enough {
                found = own;
            }
            !is_enough
        });
        found
    }

    /// The number of samples that carry as much information on a mean as one independent sample:
    /// the sum of the autocorrelation over the lags of both signs; at least 1.
    pub fn correlation_length(&self) -> f64 {
        let memory = self.level() / self.variance;
        if memory.is_finite() {
            memory.max(1.0)
        } else {
            1.0
        }
    }

    /// The spectrum at frequency 0: the variance of white noise with as much of it there.
    pub(crate) fn level(&self) -> f64 {
        let sum = 1.0 - self.coefficients.iter().sum::<f64>();
        self.innovation / (sum * sum)
    }

    /// The variance of white noise with as much of it at a frequency, in cycles per sample.
    fn spectrum(&self, cycles: f64) -> f64 {
        let (sin, cos) = libm::sincos(-2.0 * PI * cycles);
        // 1 - a_1 z - a_2 z^2 - ... from the last term on
        let (mut real, mut imaginary) = (0.0, 0.0);
        for weight in self.polynomial().iter().rev() {
            (real, imaginary) = (
                real * cos - imaginary * sin + weight,
                real * sin + imaginary * cos,
            );
        }
        self.innovation / (real * real + imaginary * imaginary)
    }

    /// The autocovariance at lags 0, 1, ..., so many of them.
    pub(crate) fn autocovariance(&self, lags: usize) -> Vec<f64> {
        let middle = |k: usize| (k as f64 + 0.5) / (2 * FREQUENCIES) as f64;
        let mut out = vec![0.0; lags];
        for k in 0..FREQUENCIES {
            let own = self.spectrum(middle(k)) / FREQUENCIES as f64;
            let cos = libm::cos(2.0 * PI * middle(k));
            // cos((l + 1) x) = 2 cos(x) cos(l x) - cos((l - 1) x)
            let (mut before, mut at) = (cos, 1.0);
            for sum in &mut out {
                *sum += own * at;
                (before, at) = (at, 2.0 * cos * at - before);
            }
        }
        out
    }

    /// 1, and the coefficients with the other sign.
    fn polynomial(&self) -> Vec<f64> {
        [1.0]
            .into_iter()
            .chain(self.coefficients.iter().map(|a| -a))
            .collect()
    }

    /// The innovation: a value minus its prediction from its neighbours.
    ///
    /// - `at(k)`: the value k samples away; `at(0)` is the value itself.
    pub(super) fn innovation_of(&self, at: impl Fn(usize) -> f64) -> f64 {
        let known = self.coefficients.iter().zip(1..);
        at(0) - known.map(|(a, lag)| a * at(lag)).sum::<f64>()
    }
}

/// The coefficients of an autoregression of values that are one.
///
/// - `weights`: 1, and the coefficients of the one with the other sign; `others`: those of the other.
fn product(weights: &[f64], others: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; weights.len() + others.len()];
    let others = [-1.0].into_iter().chain(others.iter().copied());
    for (j, b) in others.enumerate() {
        for (sum, a) in out.iter_mut().skip(j).zip(weights) {
            *sum += a * b;
        }
    }
    out.split_off(1)
}

/// Passes on the coefficients of the autoregressions of order 1, 2, ... with an autocovariance, and the variance of
/// their innovations (Levinson and Durbin), while `each` returns true.
///
/// - `autocovariance`: at lags 0, 1, ...
pub(crate) fn levinson(autocovariance: &[f64], each: &mut dyn FnMut(&[f64], f64) -> bool) {
    let at = |lag: usize| autocovariance.get(lag).copied().unwrap_or(0.0);
    let mut coefficients: Vec<f64> = Vec::new();
    let mut remaining = at(0);
    for order in 1..autocovariance.len() {
        let known = coefficients.iter().enumerate();
        let predicted: f64 = known.map(|(k, a)| a * at(order - 1 - k)).sum();
        let reflection = (at(order) - predicted) / remaining;
        if reflection.is_nan() || reflection.abs() >= 1.0 {
            break;
        }
        let backwards: Vec<f64> = coefficients.iter().rev().copied().collect();
        for (a, b) in coefficients.iter_mut().zip(backwards) {
            *a -= reflection * b;
        }
        coefficients.push(reflection);
        remaining *= 1.0 - reflection * reflection;
        if !each(&coefficients, remaining) {
            break;
        }
    }
}

/// The Cholesky factor of a symmetric positive definite matrix: `a = L L^T`, column-major, zero
/// above the diagonal; `None` if the matrix is not positive definite.
pub(crate) fn cholesky(a: &[f64], n: usize) -> Option<Vec<f64>> {
    let mut l = vec![0.0; n * n];
    for j in 0..n {
        for i in j..n {
            let sum: f64 = (0..j).map(|k| l[k * n + i] * l[k * n + j]).sum();
            let rest = a[j * n + i] - sum;
            if i == j {
                if rest.is_nan() || rest <= 0.0 {
                    return None;
                }
                l[j * n + j] = rest.sqrt();
            } else {
                l[j * n + i] = rest / l[j * n + j];
            }
        }
    }
    Some(l)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signals::Smoothing;

    /// The autocorrelation of white noise behind a filter at equations so far apart, in periods of its cutoff.
    fn behind(order: usize, hundredths: usize) -> Vec<f64> {
        let smoothing = Smoothing::Butterworth { order, cutoff: 1.0 };
        smoothing.noise_autocorrelation(0.01, hundredths).unwrap()
    }

    #[test]
    fn white_noise_behind_a_filter_has_the_spectrum_of_the_filter() {
        for order in 1..=6 {
            let autocorrelation = behind(order, 10);
            let exact = 1.0 + 2.0 * autocorrelation.iter().sum::<f64>();
            let filter = Autoregression::of_filter(&autocorrelation);
            let found = filter.fit_behind(3.0, &autocorrelation, 1000);
            assert_eq!(found.fitted, 0, "{order}");
            let length = found.correlation_length();
            assert!((length / exact - 1.0).abs() < SPECTRUM_PART, "{order}");
            // the power is halved twice, forward and backward, at the cutoff
            let part = found.spectrum(0.1) / found.level();
            assert!((part - 0.25).abs() < 0.02, "{order} {part}");
            let variance = found.autocovariance(1)[0];
            assert!((variance / 3.0 - 1.0).abs() < 0.01, "{order} {variance}");
        }
        // six coefficients do not have the spectrum of a steep filter
        let steep = behind(4, 6);
        let exact = 1.0 + 2.0 * steep.iter().sum::<f64>();
        let without = Autoregression::fit(3.0, &steep, 1000);
        assert!((without.correlation_length() / exact - 1.0).abs() > 0.2);
    }

    #[test]
    fn noise_that_is_not_white_before_a_filter_is_fitted() {
        let filter = Autoregression::of_filter(&behind(4, 10));
        // slower than the filter is
        let slow: Vec<f64> = (1..=60)
            .map(|lag| libm::pow(0.95, f64::from(lag)))
            .collect();
        let found = filter.fit_behind(1.0, &slow, 1000);
        assert!(found.fitted > 0);
        assert!((found.correlation_length() / 39.0 - 1.0).abs() < 0.1);
        // too few lags for the filter
        let few = filter.fit_behind(1.0, &slow[..6], 1000);
        assert_eq!(few, Autoregression::fit(1.0, &slow[..6], 1000));
    }
}
