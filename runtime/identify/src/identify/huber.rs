//! The passes of Huber's reweighting, in which most equations keep the weight 1, and one step of his
//! estimate of values and scales.

use super::equation_builder::Equations;
use super::passes::predictions;
use super::replay::Replay;
use crate::estimate::huber::{self as loss, Partition};
use crate::estimate::{Accumulator, Estimate, EstimateError, FactorSet, QrFactor, Weighting};
use crate::states::Source;
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
    let weights = effort_weights(&scales, weighting);
    let factor = set.combined(&weights)?;
    let mut next = Estimate::of(&factor)?;
    next.efforts.clone_from(&previous.efforts);
    for (effort, (sigma, weight)) in next.efforts.iter_mut().zip(scales.iter().zip(&weights)) {
        effort.sigma = *sigma;
        effort.weight = *weight;
    }
    Ok((next, factor))
}

/// The largest number of passes of [`partitioned`]; a few suffice.
const MAX_PARTITIONS: usize = 10;

/// A start near Huber's estimate, from least squares: the equations are divided into those within
/// the bound and those beyond, and values and scales solved for with that division, until it no
/// longer changes or the passes are over. This comes near in a few passes where reweighting takes
/// dozens; reweighting ends the search from here. `None` where a division determines nothing.
pub(super) fn partitioned<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    passes: &mut Reweighting,
    start: &Estimate,
    bound: f64,
    weighting: Weighting,
) -> Result<Option<Estimate>, S::Error> {
    let mut at = start.clone();
    for k in 0..MAX_PARTITIONS {
        let sigmas: Vec<f64> = at.efforts.iter().map(|e| e.sigma).collect();
        let huber = Huber {
            values: &at.values,
            sigmas: &sigmas,
            bound,
        };
        let mut partition = Partition::new(sigmas.len(), at.values.len());
        // the scales of least squares are too large for the residuals within the bound
        let set = if k == 0 {
            scale_pass(replay, &huber, &mut partition)?;
            None
        } else {
            Some(passes.divide(replay, &huber, &mut partition)?)
        };
        let Some(scales) = partition.scales(&sigmas, at.values.len(), bound) else {
            return Ok(None);
        };
        let mut change = 0.0_f64;
        for ((effort, scale), old) in at.efforts.iter_mut().zip(&scales).zip(&sigmas) {
            change = change.max((scale / old - 1.0).abs());
            effort.sigma = *scale;
        }
        let Some(set) = set else { continue };
        let weights = effort_weights(&scales, weighting);
        let factor = set.combined(&weights)?;
        let Some(values) = partition.values(&factor, &weights, &scales, bound) else {
            return Ok(None);
        };
        let pairs = values.iter().zip(&at.values).enumerate();
        change = pairs.fold(change, |m, (k, (a, b))| {
            m.max((a - b).abs() / start.sigma(k).max(f64::MIN_POSITIVE))
        });
        at.values = values;
        if change < loss::TOLERANCE_DEVIATIONS {
            break;
        }
    }
    Ok(Some(at))
}

/// Sums up the residuals within the bound without reducing any equation.
fn scale_pass<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    huber: &Huber<'_>,
    partition: &mut Partition,
) -> Result<(), S::Error> {
    let mut fitted = Vec::new();
    replay.visit(&mut |equations| {
        predictions(equations, huber.values, &mut fitted);
        for (effort, weight) in equations.weights.iter().enumerate() {
            if *weight != 0.0 {
                let residual = (equations.tau[effort] - fitted[effort]) * weight;
                partition.add(effort, residual, huber.size(effort, residual) > huber.bound);
            }
        }
        Ok(())
    })
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
        self.passed(replay, huber, None)
    }

    /// Reduces the equations within the bound, and adds up what the others exert, in `partition`.
    fn divide<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
        &mut self,
        replay: &mut Replay<'_, M, S>,
        huber: &Huber<'_>,
        partition: &mut Partition,
    ) -> Result<FactorSet, S::Error> {
        Ok(self.passed(replay, huber, Some(partition))?.0)
    }

    fn passed<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
        &mut self,
        replay: &mut Replay<'_, M, S>,
        huber: &Huber<'_>,
        mut partition: Option<&mut Partition>,
    ) -> Result<(FactorSet, Vec<f64>), S::Error> {
        if let Some(inner) = self.inner.take() {
            let mut members = Members::Known(&inner.members);
            let (found, holds) = pass(replay, huber, &mut members, partition.as_deref_mut())?;
            if holds {
                let mut set = inner.set.clone();
                set.merge(&found.outer)?;
                self.inner = Some(inner);
                return Ok((set, found.psi_squares));
            }
        }
        let mut members = Vec::new();
        if let Some(partition) = partition.as_deref_mut() {
            partition.clear();
        }
        let (found, _) = pass(replay, huber, &mut Members::Chosen(&mut members), partition)?;
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

/// One pass; also returns whether all known members are within the bound. With a partition, equations
/// beyond the bound are added to it and not reduced.
fn pass<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    huber: &Huber<'_>,
    members: &mut Members<'_>,
    mut partition: Option<&mut Partition>,
) -> Result<(Reduced, bool), S::Error> {
    let origin = replay.origin();
    let (mut inner, mut outer) = (Accumulator::new(&origin), Accumulator::new(&origin));
    let mut psi_squares = vec![0.0; origin.efforts.len()];
    let mut holds = true;
    let mut at = 0;
    let mut push =
        |equations: &Equations<'_>, effort: usize, fitted: f64| -> Result<(), EstimateError> {
            let (tau, weight) = (equations.tau[effort], equations.weights[effort]);
            let residual = (tau - fitted) * weight;
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
            if let Some(partition) = partition.as_deref_mut() {
                let is_beyond = size > huber.bound;
                partition.add(effort, residual, is_beyond);
                if is_beyond && !is_member {
                    let row = entries.iter().step_by(count.max(1));
                    partition.pull(effort, row, weight * residual.signum());
                    return Ok(());
                }
            }
            if is_member {
                // false for NaN
                holds &= size <= huber.bound;
                return Ok(());
            }
            // the cost of a row is the square of its factor
            outer.push(effort, entries, count, tau, weight * huber_weight.sqrt())
        };
    let mut fitted = Vec::new();
    replay.visit(&mut |equations| {
        predictions(equations, huber.values, &mut fitted);
        for (effort, weight) in equations.weights.iter().enumerate() {
            if *weight != 0.0 {
                push(equations, effort, fitted[effort])?;
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

/// The weight of each effort's equations, from the scale of its residuals.
fn effort_weights(scales: &[f64], weighting: Weighting) -> Vec<f64> {
    let weight = |sigma: &f64| match weighting {
        Weighting::Equal => 1.0,
        Weighting::PerEffort => 1.0 / sigma,
    };
    scales.iter().map(weight).collect()
}
