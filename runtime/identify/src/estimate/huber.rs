//! Huber's loss, quadratic for small residuals and linear beyond a bound, with scales that are found
//! together with the parameters (his second proposal).
//!
//! P. J. Huber, "Robust Estimation of a Location Parameter", Annals of Mathematical Statistics 35(1),
//! 1964.

use statrs::distribution::{Continuous, ContinuousCDF, Normal};

use super::{Estimate, EstimateError, FactorSet, QrFactor};

/// Largest number of passes of the reweighting.
pub(crate) const MAX_PASSES: usize = 50;
/// The reweighting ends once no parameter changes by more than this many standard deviations.
pub(crate) const TOLERANCE_DEVIATIONS: f64 = 1e-6;

/// The weight of an equation: 1 while its residual is within `bound` times `sigma`, less beyond.
pub(crate) fn weight(residual: f64, sigma: f64, bound: f64) -> f64 {
    let size = residual.abs() / sigma;
    if size > bound { bound / size } else { 1.0 }
}

/// The next scale of each effort: with it the bounded residuals have the variance that they would
/// have for normal noise.
///
/// - `psi_squares`: for each effort, the sum of the squares of the weight times the residual at the
///   scales `sigmas`;
/// - `parameters`: the number of fitted parameters.
pub(crate) fn scales(
    set: &FactorSet,
    psi_squares: &[f64],
    sigmas: &[f64],
    parameters: usize,
    bound: f64,
) -> Vec<f64> {
    let normal = Normal::standard();
    // the expectation of psi^2 for standard normal residuals: that of u^2 within the bound, and
    // bound^2 in both tails
    let tail_probability = normal.sf(bound);
    let square_within_bound = 1.0 - 2.0 * tail_probability - 2.0 * bound * normal.pdf(bound);
    let expected_square = (2.0 * bound * bound).mul_add(tail_probability, square_within_bound);
    let equations: usize = set.factors().iter().map(QrFactor::rows).sum();
    // degrees of freedom per equation
    let freedom_ratio = 1.0 - parameters as f64 / equations.max(1) as f64;
    let scales = psi_squares.iter().zip(set.factors()).zip(sigmas);
    let scales = scales.map(|((squares, factor), old)| {
        let variance = squares / (expected_square * freedom_ratio * factor.rows() as f64);
        if variance > 0.0 {
            variance.sqrt()
        } else {
            *old
        }
    });
    scales.collect()
}

/// Sums over psi, the weighted residuals that are bounded by Huber's weight.
#[derive(Default)]
pub(crate) struct PsiSums {
    /// The sum of psi^2.
    pub(crate) squares: f64,
    /// The number of equations whose residual is within Huber's bound.
    pub(crate) within_bound: usize,
    /// The number of equations.
    pub(crate) equations: usize,
}

impl PsiSums {
    /// The fraction of residuals within the bound.
    pub(crate) fn fraction_within_bound(&self) -> f64 {
        self.within_bound as f64 / self.equations.max(1) as f64
    }

    /// The covariance for white residuals.
    ///
    /// Huber (1973): (W^T W)^-1 times the mean of psi^2 over the squared fraction of residuals
    /// within the bound; the covariance of least squares is (W^T W)^-1 times the variance of its
    /// residuals, which is replaced here.
    ///
    /// - `effort_weighted`: the equations with the weights of the efforts, but without Huber's.
    pub(crate) fn covariance(&self, effort_weighted: &QrFactor) -> Result<Vec<f64>, EstimateError> {
        let least_squares = Estimate::of(effort_weighted)?;
        let degrees_of_freedom = least_squares.degrees_of_freedom.max(1) as f64;
        let least_squares_variance =
            effort_weighted.squared_residual(&least_squares.values)? / degrees_of_freedom;
        let variance = self.squares / degrees_of_freedom / self.fraction_within_bound().powi(2);
        let scale = if least_squares_variance > 0.0 {
            variance / least_squares_variance
        } else {
            0.0
        };
        Ok(least_squares.covariance.iter().map(|c| c * scale).collect())
    }
}
