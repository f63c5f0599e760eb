//! The passes of Huber's reweighting, in which most equations keep the weight 1, and one step of his
//! estimate of values and scales.

use super::equation_builder::{EquationBuilder, Equations};
use super::passes::{Source, predicted};
use super::replay::Replay;
use crate::estimate::huber as loss;
use crate::estimate::{Accumulator, Estimate, EstimateError, FactorSet, QrFactor, Weighting};
use regen_runtime::BaseModel;

/// Equations whose residual is below this part of Huber's bound are taken as [`Inner`] ones: their
/// residuals change little from pass to pass, so that they rarely pass the bound.
const INNER_PART: f64 = 0.75;

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
    /// The size of a residual (N or N m, or J) in standard deviations.
    fn size(&self, effort: usize, residual: f64) -> f64 {
        residual.abs() / self.sigmas.get(effort).copied().unwrap_or(1.0)
    }

    /// Huber's weight of an equation with this residual (N or N m, or J).
    pub(super) fn weight(&self, effort: usize, residual: f64) -> f64 {
        loss::weight(self.size(effort, residual), 1.0, self.bound)
    }
}

/// One step of Huber's estimate of values and scales (his second proposal) from the `previous` one:
/// the scales, one standard deviation for each effort, are such that the bounded residuals have the
/// variance they would have for normal noise.
pub(super) fn reweighted<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    passes: &mut Reweighting,
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
    let (set, psi_squares) = passes.reduce(replay, &huber)?;
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

/// Equations well within Huber's bound, reduced once and used again as long as all of them are within
/// the bound.
struct Inner {
    set: FactorSet,
    /// For each equation, in the order of the passes, whether it is one of them.
    members: Vec<bool>,
}

/// The reduction of a log with Huber's weights, pass by pass.
#[derive(Default)]
pub(super) struct Reweighting {
    inner: Option<Inner>,
}

impl Reweighting {
    /// Reduces a log to one QR factor for each effort, with Huber's weights. The second result is,
    /// for each effort, the sum of the squares of Huber's weight times the residual, N^2 or (N m)^2,
    /// or J^2 for energy balances.
    pub(super) fn reduce<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
        &mut self,
        replay: &mut Replay<'_, M, S>,
        huber: &Huber<'_>,
    ) -> Result<(FactorSet, Vec<f64>), S::Error> {
        if let Some(inner) = self.inner.take() {
            let (found, holds) = pass(replay, huber, &mut Members::Known(&inner.members))?;
            if holds {
                let mut set = inner.set.clone();
                set.merge(&found.outer)?;
                self.inner = Some(inner);
                return Ok((set, found.psi_squares));
            }
        }
        let mut members = Vec::new();
        let (found, _) = pass(replay, huber, &mut Members::Chosen(&mut members))?;
        let mut set = found.inner.clone();
        set.merge(&found.outer)?;
        self.inner = Some(Inner {
            set: found.inner,
            members,
        });
        Ok((set, found.psi_squares))
    }
}

/// Which equations are [`Inner`] ones.
enum Members<'a> {
    /// They were reduced in an earlier pass.
    Known(&'a [bool]),
    /// They are chosen, listed and reduced in this pass.
    Chosen(&'a mut Vec<bool>),
}

/// What a pass reduced.
struct Reduced {
    inner: FactorSet,
    outer: FactorSet,
    psi_squares: Vec<f64>,
}

/// One pass; also returns whether all known members are within the bound.
fn pass<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    huber: &Huber<'_>,
    members: &mut Members<'_>,
) -> Result<(Reduced, bool), S::Error> {
    let origin = EquationBuilder::new(replay.model(), replay.kind()).origin();
    let (mut inner, mut outer) = (Accumulator::new(&origin), Accumulator::new(&origin));
    let mut psi_squares = vec![0.0; origin.efforts.len()];
    let mut holds = true;
    let mut at = 0;
    let mut push = |equations: &Equations<'_>, effort: usize| -> Result<(), EstimateError> {
        let (tau, weight) = (equations.tau[effort], equations.weights[effort]);
        let residual = (tau - predicted(equations, effort, huber.values)) * weight;
        let size = huber.size(effort, residual);
        let huber_weight = loss::weight(size, 1.0, huber.bound);
        if let Some(sum) = psi_squares.get_mut(effort) {
            *sum += (huber_weight * residual).powi(2);
        }
        let (entries, count) = (&equations.w[effort..], equations.tau.len());
        let is_member = match members {
            Members::Known(members) => members.get(at).copied().unwrap_or(false),
            Members::Chosen(members) => {
                let is_member = size <= INNER_PART * huber.bound;
                members.push(is_member);
                if is_member {
                    inner.push(effort, entries, count, tau, weight)?;
                }
                is_member
            }
        };
        at += 1;
        if is_member {
            // false for NaN
            holds &= size <= huber.bound;
            return Ok(());
        }
        // the cost of a row is the square of its factor
        outer.push(effort, entries, count, tau, weight * huber_weight.sqrt())
    };
    replay.visit(&mut |equations| {
        for (effort, weight) in equations.weights.iter().enumerate() {
            if *weight != 0.0 {
                push(equations, effort)?;
            }
        }
        Ok(())
    })?;
    let reduced = Reduced {
        inner: inner.finish()?,
        outer: outer.finish()?,
        psi_squares,
    };
    Ok((reduced, holds))
}
