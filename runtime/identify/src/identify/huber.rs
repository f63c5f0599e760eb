//! Huber's weights, and one step of his estimate of values and scales.

use super::passes::{Source, reduce};
use super::replay::Replay;
use crate::estimate::huber as loss;
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
        loss::weight(residual, sigma, self.bound)
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
    let scales = loss::scales(&set, &psi_squares, &sigmas, previous.values.len(), bound);
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
