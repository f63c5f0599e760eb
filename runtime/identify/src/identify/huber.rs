//! Huber's weights, and one step of his estimate of values and scales.

use statrs::distribution::{Continuous, ContinuousCDF, Normal};

use super::passes::{Source, reduce};
use super::replay::Replay;
use crate::estimate::{Estimate, QrFactor, Weighting};
use regen_runtime::BaseModel;

/// The estimate that Huber's weights are computed from.
pub(super) struct Huber<'a> {
    /// The base parameters, SI.
    pub(super) values: &'a [f64],
    /// The standard deviation of each effort's residuals, N or N m, or J.
    pub(super) sigmas: &'a [f64],
    /// Huber's bound in standard deviations.
    pub(super) bound: f64,
}

impl Huber<'_> {
    /// Huber's weight of an equation with this residual (N or N m, or J): 1 within the bound, less
    /// beyond.
    pub(super) fn weight(&self, effort: usize, residual: f64) -> f64 {
        let sigma = self.sigmas.get(effort).copied().unwrap_or(1.0);
        let size = residual.abs() / sigma;
        if size > self.bound {
            self.bound / size
        } else {
            1.0
        }
    }
}

/// One step of Huber's estimate of values and scales (his second proposal) from the `previous` one:
/// the scales, one standard deviation for each effort, are such that the bounded residuals have the
/// variance they would have for normal noise.
pub(super) fn reweighted<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    previous: &Estimate,
    bound: f64,
    weighting: Weighting,
) -> Result<(Estimate, QrFactor), S::Error> {
    let sigmas: Vec<f64> = previous.efforts.iter().map(|e| e.sigma).collect();
    let huber = Huber {
        values: &previous.values,
        sigmas: &sigmas,
        bound,
    };
    let (set, psi_squares) = reduce(replay, Some(&huber))?;
    let normal = Normal::standard();
    // the expectation of psi^2 for standard normal residuals: that of u^2 within the bound, and
    // bound^2 in both tails
    let tail_probability = normal.sf(bound);
    let square_within_bound = 1.0 - 2.0 * tail_probability - 2.0 * bound * normal.pdf(bound);
    let expected_square = (2.0 * bound * bound).mul_add(tail_probability, square_within_bound);
    let equations: usize = set.factors().iter().map(QrFactor::rows).sum();
    // degrees of freedom per equation
    let freedom_ratio = 1.0 - previous.values.len() as f64 / equations.max(1) as f64;
    let scales = psi_squares.iter().zip(set.factors()).zip(&sigmas);
    let scales = scales.map(|((squares, factor), old)| {
        let variance = squares / (expected_square * freedom_ratio * factor.rows() as f64);
        if variance > 0.0 {
            variance.sqrt()
        } else {
            *old
        }
    });
    let scales: Vec<f64> = scales.collect();
    let weights: Vec<f64> = scales
        .iter()
        .map(|sigma| match weighting {
            Weighting::Equal => 1.0,
            Weighting::PerEffort => 1.0 / sigma,
        })
        .collect();
    let factor = set.combined(&weights)?;
    let mut next = Estimate::of(&factor)?;
    next.efforts.clone_from(&previous.efforts);
    for (effort, (sigma, weight)) in next.efforts.iter_mut().zip(scales.iter().zip(&weights)) {
        effort.sigma = *sigma;
        effort.weight = *weight;
    }
    Ok((next, factor))
}
