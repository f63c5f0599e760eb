//! Stretches in which an effort is far from what the model explains of it.

use super::Sample;
use super::grams::{Fit, Grams};

/// The smallest residual of such a state, in robust deviations.
const MIN_DEVIATIONS: f64 = 12.0;
/// The same, to be left out of a first fit.
const DOUBTED_DEVIATIONS: f64 = 5.0;
/// The same, in the rms of the effort's residuals if it were not explained at all.
const MIN_PART: f64 = 0.5;
/// The largest part of the states in which an effort is far off: more is no burst.
const MAX_FAR_PART: f64 = 0.1;
/// The largest number of stretches of an effort.
const MAX_STRETCHES: usize = 3;
/// States further apart than this many usual distances belong to two stretches.
const MAX_APART: usize = 3;
/// A median absolute deviation times this is a standard deviation.
const DEVIATION_OF_MEDIAN: f64 = 1.4826;

/// An effort that is far from what the model explains of it in a part of a log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FarEffort {
    /// The effort: an index into `Info::actuated`.
    pub effort: usize,
    /// The times of the first and the last state that is far off, s.
    pub times: [f64; 2],
    /// The largest residual, N or N m.
    pub largest: f64,
    /// The robust standard deviation of the residuals.
    pub usual: f64,
}

/// The states in which an effort is further off than chance: a fit that they spoil is made without them.
pub(super) fn doubted(grams: &Grams, fit: &Fit) -> Vec<usize> {
    let mut out = Vec::new();
    for i in (0..grams.rows()).filter(|i| grams.only_effort(*i).is_some()) {
        let residuals: Vec<(usize, f64)> = (grams.stored.iter())
            .filter(|own| own.has(i))
            .map(|own| (own.state, own.residual(i, &fit.values).abs()))
            .collect();
        let mut sizes: Vec<f64> = residuals.iter().map(|own| own.1).collect();
        sizes.sort_by(f64::total_cmp);
        let median = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
        let least = DOUBTED_DEVIATIONS * DEVIATION_OF_MEDIAN * median;
        let far = residuals.iter().filter(|own| own.1 > least);
        let far: Vec<usize> = far.map(|own| own.0).collect();
        if (far.len() as f64) < MAX_FAR_PART * residuals.len() as f64 {
            out.extend(far);
        }
    }
    out.sort_unstable();
    out.dedup();
    out
}

/// The efforts that are far off in a few stretches, and the states of these.
pub(super) fn efforts(sample: &Sample, grams: &Grams, fit: &Fit) -> (Vec<FarEffort>, Vec<usize>) {
    let (mut out, mut states) = (Vec::new(), Vec::new());
    for i in 0..grams.rows() {
        let Some(effort) = grams.only_effort(i) else {
            continue;
        };
        let residuals: Vec<(usize, f64)> = grams
            .stored
            .iter()
            .filter(|own| own.has(i))
            .map(|own| (own.state, own.residual(i, &fit.values)))
            .collect();
        let mut sizes: Vec<f64> = residuals.iter().map(|(_, r)| r.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let (Some(median), Some(spread)) = (sizes.get(sizes.len() / 2), fit.spreads.get(i)) else {
            continue;
        };
        let least = (MIN_DEVIATIONS * DEVIATION_OF_MEDIAN * median).max(MIN_PART * spread);
        let far: Vec<usize> = (0..residuals.len())
            .filter(|k| residuals.get(*k).is_some_and(|(_, r)| r.abs() > least))
            .collect();
        let is_rare = (far.len() as f64) < MAX_FAR_PART * residuals.len() as f64;
        let (Some(first), Some(last), true) = (far.first(), far.last(), is_rare) else {
            continue;
        };
        let apart = far.windows(2).filter(|pair| pair[1] - pair[0] > MAX_APART);
        if apart.count() >= MAX_STRETCHES {
            continue;
        }
        let time = |k: &usize| {
            let state = residuals.get(*k).and_then(|own| sample.states.get(own.0));
            state.map_or(f64::NAN, |state| state.time)
        };
        out.push(FarEffort {
            effort,
            times: [time(first), time(last)],
            largest: sizes.last().copied().unwrap_or(0.0),
            usual: DEVIATION_OF_MEDIAN * median,
        });
        states.extend(
            far.iter()
                .filter_map(|k| residuals.get(*k))
                .map(|own| own.0),
        );
    }
    // several that are off at once are so for another reason, such as a position
    let is_alone = |own: &FarEffort| {
        let meets = |other: &&FarEffort| {
            other.effort != own.effort
                && own.times[0] <= other.times[1]
                && other.times[0] <= own.times[1]
        };
        out.iter().find(meets).is_none()
    };
    if !out.iter().all(is_alone) {
        return (Vec::new(), Vec::new());
    }
    states.sort_unstable();
    states.dedup();
    (out, states)
}
