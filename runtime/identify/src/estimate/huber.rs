//! Huber's loss, quadratic for small residuals and linear beyond a bound, with scales that are found
//! together with the parameters (his second proposal).
//!
//! P. J. Huber, "Robust Estimation of a Location Parameter", Annals of Mathematical Statistics 35(1),
//! 1964.

use statrs::distribution::{Continuous, ContinuousCDF, Normal};

use crate::qr_update::substitute;

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
    let expected_square = expected_square(bound);
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

/// The expectation of psi^2 for standard normal residuals: that of u^2 within the bound, and bound^2 in
/// both tails.
fn expected_square(bound: f64) -> f64 {
    let normal = Normal::standard();
    let tail_probability = normal.sf(bound);
    let square_within_bound = 1.0 - 2.0 * tail_probability - 2.0 * bound * normal.pdf(bound);
    (2.0 * bound * bound).mul_add(tail_probability, square_within_bound)
}

/// Sums over the equations within Huber's bound, and over those beyond.
#[derive(Clone, Debug)]
pub(crate) struct Partition {
    parameters: usize,
    /// For each effort, the sum of the squared residuals within the bound.
    squares: Vec<f64>,
    /// The numbers of equations of each effort, and of those beyond the bound.
    equations: Vec<usize>,
    beyond: Vec<usize>,
    /// The sum of the rows beyond the bound, each with the sign of its residual: `parameters` for
    /// each effort.
    pulls: Vec<f64>,
}

impl Partition {
    pub(crate) fn new(efforts: usize, parameters: usize) -> Self {
        Self {
            parameters,
            squares: vec![0.0; efforts],
            equations: vec![0; efforts],
            beyond: vec![0; efforts],
            pulls: vec![0.0; efforts * parameters],
        }
    }

    pub(crate) fn clear(&mut self) {
        *self = Self::new(self.squares.len(), self.parameters);
    }

    /// Adds the weighted residual of an equation.
    pub(crate) fn add(&mut self, effort: usize, residual: f64, is_beyond: bool) {
        self.equations[effort] += 1;
        if is_beyond {
            self.beyond[effort] += 1;
        } else {
            self.squares[effort] += residual * residual;
        }
    }

    /// Adds the row of an equation beyond the bound, times `factor`.
    pub(crate) fn pull<'a>(
        &mut self,
        effort: usize,
        row: impl Iterator<Item = &'a f64>,
        factor: f64,
    ) {
        let own = &mut self.pulls[effort * self.parameters..][..self.parameters];
        for (sum, w) in own.iter_mut().zip(row) {
            *sum += factor * w;
        }
    }

    /// The scales with which the bounded residuals have the variance that they would have for normal
    /// noise, if no equation passes the bound; `None` if too many are beyond it.
    pub(crate) fn scales(&self, old: &[f64], parameters: usize, bound: f64) -> Option<Vec<f64>> {
        let all: usize = self.equations.iter().sum();
        let expected = expected_square(bound) * (1.0 - parameters as f64 / all.max(1) as f64);
        let each = self.squares.iter().zip(&self.equations).zip(&self.beyond);
        each.zip(old)
            .map(|(((squares, count), beyond), old)| {
                let rest = expected * *count as f64 - bound * bound * *beyond as f64;
                match squares / rest {
                    variance if variance > 0.0 && variance.is_finite() => Some(variance.sqrt()),
                    _ if *squares == 0.0 => Some(*old),
                    _ => None,
                }
            })
            .collect()
    }

    /// The parameters at which the equations within the bound, reduced to `factor`, balance those
    /// beyond it; `None` if they do not determine them.
    ///
    /// - `weights`: the factor of each effort; `scales`: its standard deviation.
    pub(crate) fn values(
        &self,
        factor: &QrFactor,
        weights: &[f64],
        scales: &[f64],
        bound: f64,
    ) -> Option<Vec<f64>> {
        let n = factor.columns();
        let mut g = vec![0.0; n];
        let pulls = self.pulls.chunks_exact(n.max(1));
        for (pull, (weight, sigma)) in pulls.zip(weights.iter().zip(scales)) {
            for (sum, x) in g.iter_mut().zip(pull) {
                *sum += weight * weight * bound * sigma * x;
            }
        }
        // R^T R x = R^T z + g
        let mut side = Vec::with_capacity(n);
        for (k, column) in factor.r().chunks_exact(n.max(1)).enumerate() {
            let known: f64 = column.iter().zip(&side).map(|(r, y)| r * y).sum();
            side.push((g[k] - known) / column[k]);
        }
        let side: Vec<f64> = side.iter().zip(factor.z()).map(|(y, z)| y + z).collect();
        let values = substitute(factor.r(), &side)?;
        values.iter().all(|x| x.is_finite()).then_some(values)
    }
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
