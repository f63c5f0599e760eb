//! Cutoffs of the filter that is chosen.
//!
//! Below the best cutoff least squares loses what the efforts tell, above it noise of the positions biases the
//! parameters and disturbs the equations. Each cutoff of a
//! geometric grid is tried on the log itself, at a rate that suits it: the covariance of its estimate
//! is what noise leaves unknown, and simulation and extrapolation give the bias (errors in variables).
//! Noise that neither knows of, such as that of a wandering clock, shows where an estimate differs from
//! those of lower cutoffs by more than the deviations of both (Lepskii, 1991), unless two higher cutoffs
//! contradict the lower one together: then it bends the motion. All three are errors of efforts. Their mean squares are
//! estimated from few independent samples, so that the smallest is so partly by chance: what is chosen is the mean of all
//! cutoffs, weighted by their inverse. The search ends some cutoffs above the best one, unless these leave far less of an
//! effort.
//!
//! The filter is of the second order: the weight of a frequency, the fourth power of the filter's gain,
//! then falls as slowly as the noise of accelerations grows beside that of the efforts, which is nearly
//! what generalised least squares would do. On simulated logs it is more accurate at its best cutoff
//! than the fourth order at its own, and depends less on the cutoff.

use std::borrow::Borrow;

use regen_runtime::BaseModel;

use super::Session;
use super::choice::{is_uneven, rate_of};
use super::motion_noise::{NoisyLogs, is_undetermined, rates, size_of, weighted};
use crate::data::{DataError, Logs, NoiseLevels};
use crate::estimate::QrFactor;
use crate::friction::with_linear_friction;
use crate::identify::{self, Identified, Options};
use crate::signals::Method;
use crate::states::{Source, nonlinear_joints};

/// The order of the filters that are tried.
pub(super) const ORDER: usize = 2;
/// Cutoffs of the grid between 1 and 10 Hz; the others are these times powers of ten.
const DECADE: [f64; 4] = [1.0, 1.8, 3.2, 5.6];
/// The lowest cutoff has so many periods in the logs.
const MIN_PERIODS: f64 = 10.0;
/// The highest cutoff over the rate of the rows.
const MAX_CUTOFF_RATIO: f64 = 0.3;
/// From one cutoff to the next, the bias by noise of the motion grows by about this factor: noise of
/// accelerations has a power with the fifth power of the cutoff.
const GROWTH: f64 = 20.0;
/// And at least by this one, where the noise is not white: the third power of the cutoff.
const LEAST_GROWTH: f64 = 5.6;
/// A bias below this part of the deviation is not computed, but taken as grown.
const NEGLIGIBLE: f64 = 0.02;
/// The largest number of rows of each log on which cutoffs are tried.
pub(super) const MAX_ROWS: usize = 1 << 17;
/// A bias counts as much as a variance if it is half as large as the deviation: an interval that is
/// moved by more does not hold the truth as often as it says.
pub(super) const BIAS_WEIGHT: f64 = 4.0;
/// The square of a difference of two estimates is by chance at most this many times the sum of their
/// variances.
const CHANCE: f64 = 4.0;
/// A cutoff is better than a lower one if its mean square error is smaller by this part.
const BETTER: f64 = 0.03;
/// Cutoffs with at most this many times the smallest mean square error may be chosen.
const AS_GOOD: f64 = 1.7;
/// A filter that leaves more than this many times the residuals that a filter of a higher cutoff leaves bends
/// the motion: of the same errors it would leave less.
const BENT: f64 = 1.5;
/// What a filter leaves of an effort, eps_RA in percent, from which on the motion may lie above its cutoff.
const MIN_LEFT: f64 = 3.0;
/// So many cutoffs in a row that are not better than the best one end the search.
const PATIENCE: usize = 2;
/// A higher cutoff with so many times the mean square error of the best one ends it too: noise of the motion
/// only grows, and its weight in the mean is small.
const HOPELESS: f64 = 10.0;
/// The estimate with one cutoff.
pub(super) struct Trial {
    pub(super) cutoff: f64,
    values: Vec<f64>,
    covariance: Vec<f64>,
    /// Independent changes of all values, see [`MotionBias`](super::motion_noise::MotionBias).
    bias: Vec<Vec<f64>>,
    pub(super) factor: QrFactor,
    /// See [`MotionBias`](super::motion_noise::MotionBias).
    signal: Vec<f64>,
    /// The standard deviation of the residuals of each effort.
    residuals: Vec<f64>,
    /// The part of each effort that is left, eps_RA, percent.
    left: Vec<f64>,
    /// The largest residual of all efforts, in standard deviations.
    pub(super) largest: f64,
    /// Whether an effort has less than three equations for two of the parameters in them: it is fitted with its
    /// noise, which then seems smaller than it is.
    is_scarce: bool,
}

impl Trial {
    /// The estimate of a fit whose values are corrected for the bias by noise of the motion, which its deviations contain.
    ///
    /// - `cutoff`: that of its filter, Hz.
    pub(super) fn of_corrected(found: &Identified, cutoff: f64) -> Self {
        Self {
            cutoff,
            values: found.estimate.values.clone(),
            covariance: found.deviations.within_runs().to_vec(),
            bias: Vec::new(),
            signal: found.factor.r().to_vec(),
            residuals: found.estimate.efforts.iter().map(|own| own.sigma).collect(),
            left: Vec::new(),
            largest: 0.0,
            is_scarce: false,
            factor: found.factor.clone(),
        }
    }

    /// The estimate from a motion without noise.
    ///
    /// - `cutoff`: the one that it is compared with, Hz.
    pub(super) fn of_exact_motion(found: Identified, cutoff: f64) -> Self {
        Self {
            cutoff,
            bias: Vec::new(),
            signal: found.factor.r().to_vec(),
            covariance: found.deviations.within_runs().to_vec(),
            residuals: Vec::new(),
            left: Vec::new(),
            largest: 0.0,
            is_scarce: false,
            values: found.estimate.values,
            factor: found.factor,
        }
    }
}

/// The mean squares of the errors of the predicted efforts with one cutoff, in weighted units.
#[derive(Clone, Copy, Default)]
pub(super) struct Errors {
    pub(super) variance: f64,
    pub(super) bias: f64,
    pub(super) apart: f64,
}

impl Errors {
    pub(super) fn sum(self) -> f64 {
        self.variance + BIAS_WEIGHT * self.bias + self.apart
    }
}
/// The cutoffs that were tried.
pub(super) struct Search {
    pub(super) trials: Vec<Trial>,
    pub(super) errors: Vec<Errors>,
    /// The chosen cutoff, Hz, and the index of the closest trial; `None` if no trial succeeded.
    pub(super) chosen: Option<(f64, usize)>,
}

/// Tries cutoffs in rising order, until more of them are not better.
pub(super) fn search<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    logs: &Logs<'_, M>,
) -> Result<Search, DataError> {
    let levels = logs.noise_levels();
    let durations = logs.durations();
    let rate = durations
        .iter()
        .map(|(step, _)| 1.0 / step)
        .fold(f64::INFINITY, f64::min);
    let length: f64 = durations.iter().map(|(_, length)| length).sum();
    let mut trials: Vec<Trial> = Vec::new();
    let mut errors = Vec::new();
    let mut best = 0;
    for cutoff in cutoffs(MIN_PERIODS / length, MAX_CUTOFF_RATIO * rate) {
        let known = trials.last().map_or(KnownBias::None, KnownBias::OfLower);
        match trial(session, logs, &levels, (cutoff, rate), known) {
            Ok(found) => trials.push(found),
            Err(error) if is_uneven(&error) => return Err(error),
            Err(error) if is_undetermined(&error) => continue,
            Err(error) => return Err(error),
        }
        // the errors of efforts are those in the data of the best cutoff
        for _ in 0..2 {
            errors = all_errors(&trials, best);
            let before = best;
            best = lowest(&errors);
            if best == before {
                break;
            }
        }
        if is_over(&errors, best) && !leaves_less(trials.last(), trials.get(best)) {
            break;
        }
    }
    Ok(Search {
        chosen: central(&trials, &errors),
        trials,
        errors,
    })
}

/// The cutoffs of the grid within these bounds, Hz.
fn cutoffs(least: f64, most: f64) -> Vec<f64> {
    let decades = (-3..=5).flat_map(|power| {
        let unit = 10_f64.powi(power);
        DECADE.iter().map(move |x| x * unit)
    });
    let all = decades.filter(|c| (least..=most).contains(c));
    // decimals, as they are printed
    all.map(|c| format!("{c:.6}").parse().unwrap_or(c))
        .collect()
}

/// What is known of the bias of a trial from another one.
#[derive(Clone, Copy)]
pub(super) enum KnownBias<'a> {
    /// Nothing.
    None,
    /// The bias with the next lower cutoff, which is taken where noise of the motion is far too small to matter
    /// with this one.
    OfLower(&'a Trial),
    /// The bias of the same equations with another loss.
    OfEquations(&'a Trial),
}

/// The estimate with a filter.
pub(super) fn trial<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    logs: &Logs<'_, M>,
    levels: &[Vec<NoiseLevels>],
    (cutoff, rate): (f64, f64),
    known: KnownBias<'_>,
) -> Result<Trial, DataError> {
    let method = Method::Butterworth {
        order: ORDER,
        cutoff,
    };
    let [every, decimation] = rates(rate, cutoff);
    let thinned = logs.thinned(method, every, decimation)?;
    let mut noisy = NoisyLogs::new(&thinned, levels, cutoff);
    let is_linear = nonlinear_joints(session.model).is_empty();
    let found = fitted(session, &mut noisy, false)?;
    let weights: Vec<f64> = found.estimate.efforts.iter().map(|e| e.weight).collect();
    let mut efforts = found.estimate.efforts.iter().zip(&found.contained);
    let is_scarce = efforts.any(|(effort, parameters)| 2 * effort.rows < 3 * parameters);
    let is_negligible = |lower: &Trial| {
        let size = size_of(&lower.bias, lower.values.len());
        let mut pairs = size.iter().enumerate();
        pairs.all(|(k, bias)| GROWTH * bias < NEGLIGIBLE * found.deviations.sigma(k))
    };
    let known = match known {
        KnownBias::OfLower(lower) => is_negligible(lower).then_some((lower, GROWTH)),
        KnownBias::OfEquations(own) => Some((own, 1.0)),
        KnownBias::None => None,
    };
    let (mut correction, mut signal) = (None, found.factor.r().to_vec());
    let bias: Vec<Vec<f64>> = if let Some((other, growth)) = known {
        let grown = |own: &Vec<f64>| own.iter().map(|bias| growth * bias).collect();
        other.bias.iter().map(grown).collect()
    } else {
        // Huber's weights are of the equations, those of the bias of the efforts alone
        let without = (session.options.huber.is_none()).then_some(&found.factor);
        let biased = noisy.bias(without, found.deviations.within_runs(), |logs| {
            weighted(
                session,
                (&weights, &found.static_friction),
                !is_linear,
                logs,
            )
        });
        let biased = biased?;
        correction = Some(biased.correction);
        signal = biased.signal;
        biased.changes
    };
    let correction = correction.unwrap_or_else(|| vec![0.0; found.estimate.values.len()]);
    let pairs = found.estimate.values.iter().zip(&correction);
    Ok(Trial {
        cutoff,
        values: pairs.map(|(x, bias)| x - bias).collect(),
        bias,
        residuals: found.estimate.efforts.iter().map(|own| own.sigma).collect(),
        left: found
            .errors
            .iter()
            .map(|own| own.relative_absolute)
            .collect(),
        largest: (found.errors.iter().zip(&found.estimate.efforts))
            .map(|(own, fit)| own.largest / fit.sigma)
            .fold(0.0, f64::max),
        is_scarce,
        covariance: found.deviations.within_runs().to_vec(),
        factor: found.factor,
        signal,
    })
}

/// Least squares of the rows of logs; friction that is not among the base parameters is linear.
pub(super) fn fitted<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    logs: &mut (impl Source<Error = DataError> + ?Sized),
    finds_delays: bool,
) -> Result<Identified, DataError> {
    let options = Options {
        lags: 1,
        finds_delays,
        ..session.options
    };
    if nonlinear_joints(session.model).is_empty() {
        identify::identify(session.model, session.kind, &options, logs)
    } else {
        with_linear_friction(session.model, &options, logs)
    }
}

/// The errors of all trials along the motion of the best one.
pub(super) fn all_errors<T: Borrow<Trial>>(trials: &[T], best: usize) -> Vec<Errors> {
    let Some(own) = trials.get(best).map(T::borrow) else {
        return Vec::new();
    };
    let rows = own.factor.rows().max(1) as f64;
    let n = own.factor.columns();
    // motion that is noise is none that efforts are predicted for
    let times = |x: &[f64]| {
        let mut out = vec![0.0; n];
        for (column, value) in own.signal.chunks_exact(n.max(1)).zip(x) {
            for (sum, entry) in out.iter_mut().zip(column) {
                *sum += entry * value;
            }
        }
        out
    };
    let square = |x: &[f64]| times(x).iter().map(|x| x * x).sum::<f64>() / rows;
    let variance = |covariance: &[f64]| {
        // the trace of S C S^T: S times the columns of C, then times the rows of that
        let columns = covariance.chunks_exact(n.max(1)).map(times);
        let columns: Vec<Vec<f64>> = columns.collect();
        let mut sum = 0.0;
        for k in 0..n {
            let row: Vec<f64> = columns
                .iter()
                .map(|c| c.get(k).copied().unwrap_or(0.0))
                .collect();
            sum += times(&row).get(k).copied().unwrap_or(0.0);
        }
        sum / rows
    };
    // whether a trial's filter bends the motion, as a higher cutoff shows
    let is_bent = |k: usize| {
        let own = trials.get(k).map(T::borrow);
        let mut higher = trials.iter().skip(k + 1).map(T::borrow);
        own.is_some_and(|own| {
            higher.any(|other| {
                let mut pairs = own.residuals.iter().zip(&other.residuals);
                !other.is_scarce && pairs.any(|(own, other)| *own > BENT * other)
            })
        })
    };
    // where no cutoff leaves enough equations, all are compared as they are
    let all_scarce = trials.iter().all(|own| own.borrow().is_scarce);
    let places = 0..trials.len();
    let alone: Vec<Errors> = (places.clone().zip(trials.iter().map(T::borrow)))
        .map(|(k, trial)| Errors {
            variance: if trial.is_scarce && !all_scarce || is_bent(k) {
                f64::INFINITY
            } else {
                variance(&trial.covariance)
            },
            bias: trial.bias.iter().map(|own| square(own)).sum(),
            apart: 0.0,
        })
        .collect();
    // the mean square of what two trials differ by, and what both know of their errors
    let compared = |a: usize, b: usize| {
        let own = trials.get(a).map(T::borrow).zip(alone.get(a));
        let other = trials.get(b).map(T::borrow).zip(alone.get(b));
        let ((own, own_errors), (other, other_errors)) = own.zip(other)?;
        let pairs = own.values.iter().zip(&other.values);
        let difference: Vec<f64> = pairs.map(|(a, b)| a - b).collect();
        let known = |errors: &Errors| errors.variance + errors.bias;
        let explained = known(own_errors) + known(other_errors);
        Some((square(&difference), CHANCE * explained)).filter(|own| own.1.is_finite())
    };
    let compared: Vec<Vec<Option<(f64, f64)>>> = places
        .clone()
        .map(|a| (0..a).map(|b| compared(a, b)).collect())
        .collect();
    let pair = |lower: usize, higher: usize| *compared.get(higher)?.get(lower)?;
    let is_refuted = |k: usize| {
        let mut pairs =
            (k + 1..trials.len()).flat_map(|i| (i + 1..trials.len()).map(move |j| (i, j)));
        pairs.any(|(i, j)| refutes(pair(k, i), pair(k, j), pair(i, j)))
    };
    let refuted: Vec<bool> = places.clone().map(is_refuted).collect();
    // a lower cutoff that is not counted says nothing of others
    let counts = |k: &usize| refuted.get(*k) == Some(&false);
    let mut all = alone.clone();
    for (k, own) in all.iter_mut().enumerate() {
        if refuted.get(k) == Some(&true) {
            own.variance = f64::INFINITY;
        }
        for (difference, chance) in (0..k).filter(counts).filter_map(|lower| pair(lower, k)) {
            own.apart = own.apart.max(difference - chance);
        }
    }
    all
}

/// Whether two higher cutoffs show that a lower one bends the motion: what noise of the motion moves grows with the
/// cutoff, so that it would set these two apart at least as far as it does the lower two.
///
/// - mean squares of the differences, and the largest of them by chance: of the lowest cutoff and the others, and of
///   these.
fn refutes(lower: Option<(f64, f64)>, far: Option<(f64, f64)>, higher: Option<(f64, f64)>) -> bool {
    let (Some(lower), Some(far), Some(higher)) = (lower, far, higher) else {
        return false;
    };
    let is_beyond = |(difference, chance): (f64, f64)| difference > chance;
    is_beyond(lower) && is_beyond(far) && higher.0 <= higher.1 && higher.1 < lower.0
}

/// The parts of a given cutoff that [`moved_by_cutoff`] compares it with.
const LOWER_PARTS: [f64; 2] = [0.3, 0.1];

/// By how much the filter of a fit moves the values, SI, as lower cutoffs show: noise of the motion that differences of
/// its positions do not show, such as that of a wandering clock, biases the more the higher the cutoff is. `None` where
/// the values of lower cutoffs are the same within the deviations of both, or the motion passes no Butterworth filter.
///
/// - `given`: the fit with the filter of the logs.
///
/// # Errors
/// When a log cannot be read.
pub(super) fn moved_by_cutoff<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    logs: &Logs<'_, M>,
    given: Trial,
) -> Result<Option<Vec<f64>>, DataError> {
    // trials have linear friction where it is nonlinear, and so other unknowns
    if !logs.is_differentiated() || !nonlinear_joints(session.model).is_empty() {
        return Ok(None);
    }
    let kept = logs.in_memory(MAX_ROWS)?;
    let (levels, rate) = (kept.noise_levels(), rate_of(&kept));
    let length: f64 = kept.durations().iter().map(|(_, length)| length).sum();
    let mut trials = Vec::new();
    for part in LOWER_PARTS {
        let cutoff = part * given.cutoff;
        if cutoff * length < MIN_PERIODS {
            continue;
        }
        match trial(session, &kept, &levels, (cutoff, rate), KnownBias::None) {
            Ok(found) => trials.push(found),
            Err(error) if is_undetermined(&error) => {}
            Err(error) => return Err(error),
        }
    }
    trials.sort_by(|a, b| a.cutoff.total_cmp(&b.cutoff));
    let lower = trials.len();
    trials.push(given);
    let errors = all_errors(&trials, lower);
    let is_apart = errors.last().is_some_and(|own| own.apart > 0.0);
    let best = errors.get(..lower).map_or(0, lowest);
    let is_counted = errors.get(best).is_some_and(|own| own.sum().is_finite());
    let (Some(given), Some(best)) = (trials.last(), trials.get(best)) else {
        return Ok(None);
    };
    let pairs = given.values.iter().zip(&best.values);
    Ok((lower > 0 && is_apart && is_counted)
        .then(|| pairs.map(|(own, other)| own - other).collect()))
}

/// Whether the last filter leaves a far smaller part of an effort that the best one does not explain: the motion is
/// above the best cutoff, which a higher one may show to bend it.
fn leaves_less(last: Option<&Trial>, best: Option<&Trial>) -> bool {
    last.zip(best).is_some_and(|(last, best)| {
        let mut pairs = last.left.iter().zip(&best.left);
        pairs.any(|(last, best)| *best > MIN_LEFT && best.is_finite() && BENT * last < *best)
    })
}

/// Whether no cutoff above the last one is worth a trial.
///
/// - `best`: the index of the best one.
fn is_over(errors: &[Errors], best: usize) -> bool {
    let best_sum = errors.get(best).map_or(f64::INFINITY, |own| own.sum());
    // an estimate that is only apart from lower ones may be the right one, as the next cutoff shows
    let last = errors
        .last()
        .map_or(f64::INFINITY, |own| Errors { apart: 0.0, ..*own }.sum());
    // the next one costs as much as all before it, and its bias is at least this
    let next = errors.last().map_or(0.0, |own| {
        BIAS_WEIGHT * LEAST_GROWTH * LEAST_GROWTH * own.bias
    });
    let is_hopeless = |sum: f64| sum.is_finite() && sum > HOPELESS * best_sum;
    errors.len() > best + PATIENCE
        || errors.len() > best + 1 && (is_hopeless(last) || is_hopeless(next))
}

/// The index of the trial with the smallest error; of those that are nearly as good the first.
fn lowest(errors: &[Errors]) -> usize {
    let mut best: Option<(usize, f64)> = None;
    for (k, own) in errors.iter().map(|own| own.sum()).enumerate() {
        if own.is_finite() && best.is_none_or(|(_, least)| own < (1.0 - BETTER) * least) {
            best = Some((k, own));
        }
    }
    best.map_or(0, |(k, _)| k)
}

/// The mean of all cutoffs on a logarithmic scale, each with the inverse of its mean square error as
/// weight, Hz, with two digits; with it the index of the closest cutoff that was tried. Where that one is
/// far worse than the best, the closest that is nearly as good is taken in its place.
fn central(trials: &[Trial], errors: &[Errors]) -> Option<(f64, usize)> {
    // where no cutoff leaves enough equations for deviations, only the biases are known
    let is_known = errors.iter().any(|own| own.sum().is_finite());
    let sum = |own: &Errors| {
        if is_known {
            own.sum()
        } else {
            BIAS_WEIGHT * own.bias
        }
    };
    let pairs = trials.iter().zip(errors).enumerate();
    let counted: Vec<(usize, f64, f64)> = pairs
        .map(|(k, (trial, own))| (k, libm::log(trial.cutoff), sum(own)))
        .filter(|own| own.2.is_finite())
        .collect();
    let least = counted.iter().fold(f64::INFINITY, |m, own| m.min(own.2));
    let (mut weights, mut mean) = (0.0, 0.0);
    for (_, log, sum) in &counted {
        let weight = if *sum > 0.0 { least / sum } else { 1.0 };
        weights += weight;
        mean += weight * log;
    }
    mean /= weights;
    let closest = |good: f64| {
        let good = counted.iter().filter(move |own| own.2 <= good);
        good.min_by(|a, b| (a.1 - mean).abs().total_cmp(&(b.1 - mean).abs()))
    };
    let (any, good) = (closest(f64::INFINITY)?, closest(AS_GOOD * least)?);
    if any.0 == good.0 {
        let cutoff = libm::exp(mean);
        // decimals, as they are printed
        Some((format!("{cutoff:.1e}").parse().unwrap_or(cutoff), good.0))
    } else {
        Some((trials.get(good.0)?.cutoff, good.0))
    }
}

/// The root of a mean square over that of the efforts, percent.
pub(super) fn percent_of(square: f64, efforts: f64) -> f64 {
    100.0 * (square / efforts).sqrt()
}

/// The mean square of the weighted efforts of a factor.
pub(super) fn mean_square(factor: &QrFactor) -> f64 {
    let squares: f64 = factor.z().iter().map(|z| z * z).sum::<f64>() + factor.rss();
    squares / factor.rows().max(1) as f64
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    /// A trial of one parameter with this value, deviation and residuals.
    fn trial_of(cutoff: f64, value: f64, deviation: f64, residual: f64) -> Trial {
        let mut factor = QrFactor::new(vec!["a".to_owned()]);
        factor.push_block(&[1.0; 100], &[value; 100]).unwrap();
        Trial {
            cutoff,
            values: vec![value],
            covariance: vec![deviation * deviation],
            bias: Vec::new(),
            signal: factor.r().to_vec(),
            factor,
            residuals: vec![residual],
            left: vec![100.0 * residual],
            largest: 1.0,
            is_scarce: false,
        }
    }

    impl Search {
        /// Trials of one parameter at these cutoffs, of which the one at `place` is chosen.
        pub(in crate::session) fn of_cutoffs(cutoffs: [f64; 3], place: usize) -> Self {
            let trials = cutoffs.map(|cutoff| trial_of(cutoff, 1.0, 0.1, 0.1));
            Self {
                errors: all_errors(&trials, 1),
                chosen: trials.get(place).map(|own| (own.cutoff, place)),
                trials: trials.into(),
            }
        }
    }

    #[test]
    fn a_cutoff_whose_residuals_fall_with_higher_ones_bends_the_motion_and_says_nothing() {
        let bent = trial_of(1.8, 5.0, 0.1, 0.3);
        let trials = [
            bent,
            trial_of(3.2, 1.0, 0.01, 0.1),
            trial_of(5.6, 1.0, 0.01, 0.11),
        ];
        let errors = all_errors(&trials, 1);
        assert!(errors[0].sum().is_infinite());
        assert!(errors[1].sum() < 1e-3 && errors[2].sum() < 1e-3);
        let (cutoff, place) = central(&trials, &errors).unwrap();
        assert!(
            (3.0..6.0).contains(&cutoff) && place > 0,
            "{cutoff} {place}"
        );
        // noise leaves larger residuals behind higher cutoffs, which are then judged by lower ones
        let noisy = [trial_of(1.8, 1.0, 0.01, 0.1), trial_of(3.2, 5.0, 0.01, 0.3)];
        let errors = all_errors(&noisy, 0);
        assert!(errors[0].sum() < 1e-3 && errors[1].apart > 1.0);
    }

    #[test]
    fn a_lower_cutoff_that_two_higher_ones_contradict_together_says_nothing() {
        let bent = || trial_of(0.32, 5.0, 0.1, 0.1);
        let trials = [
            bent(),
            trial_of(0.56, 1.0, 0.02, 0.1),
            trial_of(1.0, 1.01, 0.02, 0.1),
        ];
        let errors = all_errors(&trials, 1);
        assert!(errors[0].sum().is_infinite());
        assert!(errors[1].sum() < 1e-3 && errors[2].sum() < 1e-3);
        // one alone may be biased, as two may that differ as much as noise of the motion lets them
        for higher in [5.0, 2.0, -3.0] {
            let trials = [
                bent(),
                trial_of(0.56, 1.0, 0.02, 0.1),
                trial_of(1.0, higher, 0.02, 0.1),
            ];
            let errors = all_errors(&trials, 1);
            assert!(errors[0].sum() < 0.1, "{higher}");
            assert!(errors[1].apart > 1.0, "{higher}");
        }
        // and two whose deviations hide a difference of that size tell nothing of it
        let trials = [
            bent(),
            trial_of(0.56, 1.0, 0.02, 0.1),
            trial_of(1.0, 1.0, 3.0, 0.1),
        ];
        assert!(all_errors(&trials, 1)[0].sum() < 0.1);
    }

    #[test]
    fn cutoffs_rise_evenly_from_one_bound_to_the_other() {
        for (least, most) in [(0.01, 300.0), (0.2, 0.2), (1.7, 2.9)] {
            let found = cutoffs(least, most);
            assert!(
                found.iter().all(|own| (least..=most).contains(own)),
                "{found:?}"
            );
            let steps = found.windows(2).map(|pair| pair[1] / pair[0]);
            assert!(
                steps.clone().all(|step| (1.7..1.9).contains(&step)),
                "{found:?}"
            );
        }
        let all = cutoffs(0.01, 300.0);
        assert!((all[0] - 0.01).abs() < 1e-12 && all[all.len() - 1] > 170.0);
    }

    #[test]
    fn the_search_ends_behind_a_cutoff_that_is_far_worse_or_several_that_are_worse() {
        let of = |sums: &[f64]| -> Vec<Errors> {
            let one = |variance: &f64| Errors {
                variance: *variance,
                ..Errors::default()
            };
            sums.iter().map(one).collect()
        };
        assert!(!is_over(&of(&[4.0, 1.0]), 1));
        assert!(!is_over(&of(&[4.0, 1.0, 2.0]), 1));
        assert!(is_over(&of(&[4.0, 1.0, 2.0, 1.5]), 1));
        assert!(is_over(&of(&[4.0, 1.0, 11.0]), 1));
        // one that is apart from the lower one may be right
        let mut apart = of(&[1.0, 1.0]);
        apart[1].apart = 20.0;
        assert!(!is_over(&apart, 0));
        // one that leaves too few equations says nothing
        assert!(!is_over(&of(&[4.0, 1.0, f64::INFINITY]), 1));
        // the next one has a bias that noise of the motion made far larger
        for (bias, ends) in [(0.05, false), (0.1, true)] {
            let mut biased = of(&[4.0, 1.0, 1.5]);
            biased[2].bias = bias;
            assert_eq!(is_over(&biased, 1), ends);
            // it is tried where the last one is the best
            assert!(!is_over(&biased, 2));
        }
    }

    #[test]
    fn the_chosen_trial_is_the_one_closest_to_the_mean_cutoff() {
        let trials = [1.0, 3.2, 10.0].map(|cutoff| trial_of(cutoff, 1.0, 0.1, 0.1));
        let (cutoff, place) = central(&trials, &all_errors(&trials, 1)).unwrap();
        assert!(
            (cutoff / 3.2 - 1.0).abs() < 0.05 && place == 1,
            "{cutoff} {place}"
        );
        // of exact equations too, which have no errors
        let exact = [1.0, 3.2, 10.0].map(|cutoff| trial_of(cutoff, 1.0, 0.0, 0.1));
        let (cutoff, place) = central(&exact, &all_errors(&exact, 1)).unwrap();
        assert!(
            (cutoff / 3.2 - 1.0).abs() < 0.05 && place == 1,
            "{cutoff} {place}"
        );
    }

    #[test]
    fn the_search_goes_on_where_higher_cutoffs_leave_less_of_an_effort() {
        let left = |percent: f64| trial_of(1.0, 1.0, 0.1, percent / 100.0);
        let goes_on = |last: f64, best: f64| leaves_less(Some(&left(last)), Some(&left(best)));
        assert!(goes_on(4.0, 12.0) && goes_on(0.1, 3.1));
        assert!(!goes_on(12.0, 12.0) && !goes_on(9.0, 12.0));
        // so little may be noise
        assert!(!goes_on(0.1, 2.9) && !leaves_less(None, Some(&left(12.0))));
    }

    #[test]
    fn a_difference_is_apart_beyond_what_deviations_and_biases_of_both_explain() {
        let with = |value: f64, bias: f64| {
            let mut own = trial_of(3.2, value, 0.01, 0.1);
            own.bias = vec![vec![bias]];
            own
        };
        let apart = |value: f64, bias: f64| {
            let trials = [trial_of(1.8, 1.0, 0.01, 0.1), with(value, bias)];
            all_errors(&trials, 0)[1].apart
        };
        // the square of the difference less four times the sum of the mean squares
        let expected = 0.09 - CHANCE * (2.0 * 1e-4 + 0.01);
        assert!((apart(1.3, 0.1) - expected).abs() < 1e-9);
        assert!(apart(1.15, 0.1) <= 0.0 && apart(1.15, 0.0) > 0.02);
    }

    #[test]
    fn a_part_of_the_efforts_is_a_root_of_mean_squares() {
        assert!((percent_of(4.0, 100.0) - 20.0).abs() < 1e-12);
        assert!((percent_of(225.0, 100.0) - 150.0).abs() < 1e-12);
    }
}
