//! Hypotheses on the zeros of positions: a measured coordinate of which a constant is to be subtracted.

use super::grams::{Fit, Grams, Stored};
use super::{Change, MIN_GAIN_PER_COLUMN, Reading, Sample, quality};
use regen_runtime::BaseModel;

/// Relative errors below this are normal, and no zero is doubted.
pub(super) const MIN_DOUBTED_ERROR: f64 = 0.03;
/// The largest number of states at which the effect of an offset is computed.
const STATES: usize = 150;
/// The step by which that is differentiated, rad or m.
const STEP: f64 = 1e-4;
/// The largest number of steps of Gauss and Newton.
const MAX_STEPS: usize = 8;
/// The largest change of a zero in one of them, rad or m.
const MAX_CHANGE: f64 = 0.3;
/// The part of an offset below which a step of it no longer matters.
const SETTLED: f64 = 1e-3;
/// The part of the squared residuals that the first step may leave.
const MAX_LEFT: f64 = 0.85;
/// The number of coordinates of which the offset is computed to the end.
const TRIED: usize = 2;

/// Finds the measured coordinate whose zero, if it is another one, explains the errors.
pub(super) fn search<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    grams: &Grams,
    now: &Fit,
) -> Option<Change> {
    let measured = sample.measured.len();
    let every = sample.states.len().div_ceil(STATES).max(1);
    let plain = Reading::plain(model.info().actuated.len());
    let start = Reading::plain(measured);
    let few = Grams::of(model, sample, &start, every)?;
    let first = few.fit(&plain, &[])?;
    let mut first_steps: Vec<(usize, f64, f64)> = (0..measured)
        .filter_map(|k| {
            let (step, left) = step_of(model, sample, &start, every, &few, &first, k)?;
            Some((k, step, left))
        })
        .collect();
    // a zero that is wrong by much is no minimum, but in its direction
    first_steps.retain(|(_, _, left)| *left < MAX_LEFT);
    first_steps.sort_by(|a, b| a.2.total_cmp(&b.2));
    let mut best: Option<(f64, Vec<Reading>, usize)> = None;
    for (k, step, _) in first_steps.into_iter().take(TRIED) {
        let Some((error, found)) = settled(model, sample, every, &first, k, step) else {
            continue;
        };
        if best.as_ref().is_none_or(|best| error < best.0) {
            best = Some((error, found, k));
        }
    }
    let (error, mut positions, k) = best?;
    if quality(&first.errors) < MIN_GAIN_PER_COLUMN * error {
        return None;
    }
    // few states leave some noise in it
    let all = (sample.states.len())
        .div_ceil(grams.stored.len().max(1))
        .max(1);
    let own = Grams::of(model, sample, &positions, all)?;
    let fit = own.fit(&plain, &[])?;
    let (step, _) = step_of(model, sample, &positions, all, &own, &fit, k)?;
    positions.get_mut(k)?.offset += step;
    let own = Grams::of(model, sample, &positions, all)?;
    let after = own.fit(&plain, &[]).filter(|_| own.closes())?;
    let worst = |fit: &Fit| fit.errors.iter().fold(0.0, |m: f64, e| m.max(*e));
    let is_explained = MIN_GAIN_PER_COLUMN * worst(&after) < worst(now);
    let gain = quality(&now.errors) / quality(&after.errors);
    (is_explained && gain >= MIN_GAIN_PER_COLUMN).then(|| Change {
        efforts: plain,
        positions,
        offsets: vec![0.0; model.info().actuated.len()],
        before: now.errors.clone(),
        after: after.errors,
        sign: false,
    })
}

/// The product of errors and the readings with the offset of coordinate `k` that Gauss and Newton find.
fn settled<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    every: usize,
    first: &Fit,
    k: usize,
    step: f64,
) -> Option<(f64, Vec<Reading>)> {
    let plain = Reading::plain(model.info().actuated.len());
    let mut positions = Reading::plain(sample.measured.len());
    let mut least = quality(&first.errors);
    let mut step = step;
    for _ in 0..MAX_STEPS {
        let mut next = positions.clone();
        next.get_mut(k)?.offset += step.clamp(-MAX_CHANGE, MAX_CHANGE);
        let grams = Grams::of(model, sample, &next, every).filter(Grams::closes)?;
        let fit = grams.fit(&plain, &[])?;
        let error = quality(&fit.errors);
        if error >= least {
            step *= 0.4;
            continue;
        }
        (least, positions) = (error, next);
        let size = positions.get(k)?.offset.abs();
        step = step_of(model, sample, &positions, every, &grams, &fit, k)?.0;
        if step.abs() < SETTLED * size {
            break;
        }
    }
    Some((least, positions))
}

/// The step of Gauss and Newton of the offset of coordinate `k`, and the part of the weighted residuals that
/// it leaves.
fn step_of<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    positions: &[Reading],
    every: usize,
    grams: &Grams,
    fit: &Fit,
    k: usize,
) -> Option<(f64, f64)> {
    let mut moved = positions.to_vec();
    moved.get_mut(k)?.offset += STEP;
    let ahead = Grams::of(model, sample, &moved, every)?;
    let rows = grams.rows();
    let weights: Vec<f64> = (fit.errors.iter().zip(&fit.spreads))
        .map(|(error, spread)| 1.0 / (error * spread).max(f64::MIN_POSITIVE))
        .collect();
    let pairs = pairs(&grams.stored, &ahead.stored);
    // the change of the residuals with the offset, without what the parameters make good
    let mut slopes = Vec::with_capacity(pairs.len() * rows);
    let mut residuals = Vec::with_capacity(pairs.len() * rows);
    for (own, other) in &pairs {
        for (i, weight) in weights.iter().enumerate() {
            let left = own.residual(i, &fit.values);
            slopes.push(weight * (other.residual(i, &fit.values) - left) / STEP);
            residuals.push(weight * left);
        }
    }
    let stored: Vec<&Stored> = pairs.iter().map(|(own, _)| *own).collect();
    let free = grams.without_parameters(&stored, &weights, &slopes)?;
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(x, y)| x * y).sum() };
    let square = dot(&free, &free);
    // an offset that the parameters make good, as of a first joint about gravity, has no slope
    if square < 1e-12 * dot(&slopes, &slopes) || square <= 0.0 {
        return None;
    }
    let along = dot(&free, &residuals);
    let whole = dot(&residuals, &residuals);
    let step = -along / square;
    (whole > 0.0 && step.is_finite()).then(|| (step, 1.0 - along * along / (square * whole)))
}

/// The equations of the states that both have.
fn pairs<'s>(one: &'s [Stored], other: &'s [Stored]) -> Vec<(&'s Stored, &'s Stored)> {
    let same = |own: &'s Stored| {
        let place = other.binary_search_by_key(&own.state, |o| o.state).ok()?;
        Some((own, other.get(place)?))
    };
    one.iter().filter_map(same).collect()
}
