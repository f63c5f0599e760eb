//! Autoregressive models of residuals, from which the correlation time of the noise follows.

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
}

impl Autoregression {
    /// White noise of this variance.
    pub fn white(variance: f64) -> Self {
        Self {
            coefficients: Vec::new(),
            variance,
            innovation: variance,
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
        let mut best = Self::white(variance);
        // a variance that is NaN is refused too
        if !(variance > 0.0 && variance.is_finite()) {
            return best;
        }
        let at = |lag: usize| match lag {
            0 => 1.0 + WHITE_PART,
            _ => autocorrelation.get(lag - 1).copied().unwrap_or(0.0),
        };
        let mut coefficients: Vec<f64> = Vec::new();
        let mut remaining = at(0);
        let criterion = |remaining: f64, order: usize| {
            samples as f64 * libm::log(remaining) + 2.0 * order as f64
        };
        let mut least = criterion(remaining, 0);
        for order in 1..=ORDER.min(autocorrelation.len()).min(samples / 4) {
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
            let own = criterion(remaining, order);
            if own < least {
                least = own;
                best.coefficients.clone_from(&coefficients);
                best.innovation = variance * remaining;
            }
        }
        best
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

    /// The innovation: a value minus its prediction from its neighbours.
    ///
    /// - `at(k)`: the value k samples away; `at(0)` is the value itself.
    pub(super) fn innovation_of(&self, at: impl Fn(usize) -> f64) -> f64 {
        let known = self.coefficients.iter().zip(1..);
        at(0) - known.map(|(a, lag)| a * at(lag)).sum::<f64>()
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
