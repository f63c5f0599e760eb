//! Detects mistakes in a log that was read without an error: columns that are swapped, of flipped
//! sign, shifted or in another unit.
//!
//! One pass over a sample of the log's states computes a Gram matrix for each equation: of the base
//! regressor's columns, and of every measured effort in the place of each effort that acts on the
//! equation. Each hypothesis on the efforts is then a small least-squares problem without another
//! pass. A hypothesis on the positions needs a pass of its own, over fewer states, and is tried
//! only where changes of efforts do not explain the errors.

mod cut_off;
mod drifts;
mod efforts;
mod facts;
mod far;
mod grams;
mod implausible;
mod judge;
mod motion_noise;
mod noise;
mod parts;
mod positions;
mod rectified;
#[cfg(test)]
pub(crate) mod swings_for_tests;
mod trial;
mod unknowns;
mod useless;
mod whole_log;
mod words;

pub use cut_off::CutOff;
pub use drifts::{Drift, Drifting};
pub use facts::{NegativeParameter, Nominal, Shift};
pub use far::FarEffort;
pub use judge::{EffortChange, Remedy, Suspicion, contradiction, suspicions};
pub use noise::{NoiseAlone, noise_alone};
pub use parts::Parts;
pub use trial::{Trial, short_trial, trial, weightless};
pub use whole_log::WholeFit;
pub use words::LogColumns;

use crate::data::{Measured, STATES, Sample, Spikes};
use grams::{Fit, Grams};
use implausible::implausible_count;
use motion_noise::{is_noise_of_motion, with_noise};
use regen_runtime::BaseModel;

/// The column that a quantity is read from, and the factor on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// The quantity whose column is read: an index into `Info::actuated` for efforts, into the
    /// measured coordinates for positions.
    pub from: usize,
    /// The factor that the column is multiplied by.
    pub factor: f64,
    /// What is added, for positions, rad or m.
    pub offset: f64,
}

impl Reading {
    /// Every quantity read from its own column.
    fn plain(count: usize) -> Vec<Self> {
        let own = |from| Self {
            from,
            factor: 1.0,
            offset: 0.0,
        };
        (0..count).map(own).collect()
    }
}

/// An assignment of columns with which a log fits far better, or equally well with fewer
/// implausible parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// The reading of each effort, in the order of `Info::actuated`.
    pub efforts: Vec<Reading>,
    /// The reading of each measured coordinate.
    pub positions: Vec<Reading>,
    /// The constant offset of each effort, N or N m; 0 where there is none.
    pub offsets: Vec<f64>,
    /// The factor on the times.
    pub times: f64,
    /// The measured coordinates whose positions are late, each with its delay, s.
    pub late: Vec<(usize, f64)>,
    /// How late all efforts are, s.
    pub behind: f64,
    /// The errors of the equations without the change: rms of the residuals over rms of the efforts
    /// about their mean, or a tenth of their rms if that is more. Empty where the loops do not close.
    pub before: Vec<f64>,
    /// The errors with the change.
    pub after: Vec<f64>,
    /// Whether the change only flips signs: the errors stay about the same, but friction or inertia
    /// is negative without it.
    pub sign: bool,
    /// Whether the errors are over what changes of the efforts, which are weights for the most part.
    pub beside_weights: bool,
    /// Another change that explains the sample about as well; the whole log tells which is right.
    pub rival: Option<Box<Self>>,
}

impl Change {
    /// No change.
    fn none(efforts: usize, positions: usize) -> Self {
        Self {
            efforts: Reading::plain(efforts),
            positions: Reading::plain(positions),
            offsets: vec![0.0; efforts],
            times: 1.0,
            late: Vec::new(),
            behind: 0.0,
            before: Vec::new(),
            after: Vec::new(),
            sign: false,
            beside_weights: false,
            rival: None,
        }
    }

    /// Whether it only takes constants from efforts.
    fn has_constants_only(&self) -> bool {
        let none = Self::none(self.efforts.len(), self.positions.len());
        self.efforts == none.efforts
            && Self {
                offsets: none.offsets,
                ..self.clone()
            }
            .has_efforts_only()
    }

    /// Whether it only reads efforts from other columns, or multiplied.
    fn has_efforts_only(&self) -> bool {
        let none = Self {
            efforts: self.efforts.clone(),
            before: self.before.clone(),
            after: self.after.clone(),
            sign: self.sign,
            beside_weights: self.beside_weights,
            rival: self.rival.clone(),
            ..Self::none(self.efforts.len(), self.positions.len())
        };
        *self == none
    }

    /// Whether it leaves an effort unexplained that was explained better without it, or the worst of them about as
    /// unexplained as before and no other one far better explained: one that is noise is explained by nothing.
    fn harms(&self) -> bool {
        let (left, was) = (worst(&self.after), worst(&self.before));
        let is_useless = left > MAX_EXPLAINED_ERROR
            && was > 0.0
            && left > MAX_LEFT_OF_WORST * was
            && !is_beside_noise(&self.before, &self.after);
        is_useless || is_less_explained(&self.before, &self.after)
    }

    /// Whether it contains times, or a delay of all efforts.
    fn is_of_times(&self) -> bool {
        (self.times - 1.0).abs() > f64::EPSILON || self.behind != 0.0
    }

    /// How many numbers it contains that the equations told.
    fn number_count(&self) -> i32 {
        let offsets = self.offsets.iter().filter(|own| **own != 0.0).count();
        let zeros = self
            .positions
            .iter()
            .filter(|own| own.offset != 0.0)
            .count();
        let rate = usize::from((self.times - 1.0).abs() > f64::EPSILON);
        let behind = usize::from(self.behind != 0.0);
        i32::try_from(offsets + zeros + rate + behind + self.late.len()).unwrap_or(i32::MAX)
    }

    /// This change, and another one of what is read with it.
    fn then(&self, next: &Self) -> Self {
        let after = |own: &Reading, first: &[Reading]| {
            let first = first.get(own.from).copied().unwrap_or(*own);
            Reading {
                from: first.from,
                factor: own.factor * first.factor,
                offset: own.factor * first.offset + own.offset,
            }
        };
        let both = |first: &[Reading], next: &[Reading]| -> Vec<Reading> {
            next.iter().map(|own| after(own, first)).collect()
        };
        let offset = |(own, more): (&Reading, &f64)| {
            more + own.factor * self.offsets.get(own.from).unwrap_or(&0.0)
        };
        let place = |k: usize| self.positions.get(k).map_or(k, |own| own.from);
        let late = next.late.iter().map(|(k, own)| (place(*k), *own));
        Self {
            efforts: both(&self.efforts, &next.efforts),
            positions: both(&self.positions, &next.positions),
            offsets: next.efforts.iter().zip(&next.offsets).map(offset).collect(),
            times: self.times * next.times,
            late: self.late.iter().copied().chain(late).collect(),
            behind: self.behind + next.behind,
            before: self.before.clone(),
            after: next.after.clone(),
            sign: self.sign || next.sign,
            beside_weights: self.beside_weights || next.beside_weights,
            rival: None,
        }
    }
}

impl Sample {
    /// The sample as it is read with a change.
    fn read_with(&self, change: &Change) -> Self {
        let read = |values: &[f64], all: &[Reading], factor: f64, part: f64| -> Vec<f64> {
            let one = |own: &Reading| {
                let value = values.get(own.from).copied().unwrap_or(f64::NAN);
                (own.factor * value + part * own.offset) * factor
            };
            all.iter().map(one).collect()
        };
        let state = |(place, state): (usize, &Measured)| {
            let mut motion = state.motion.clone();
            let late = |k: usize| {
                let own = change.late.iter().filter(|own| own.0 == k);
                own.map(|own| own.1).sum::<f64>() - change.behind
            };
            for (k, late) in (0..self.measured.len()).map(|k| (k, late(k))) {
                if late == 0.0 {
                    continue;
                }
                let more = unknowns::later(&self.states, place, k, late);
                for (values, more) in motion.iter_mut().zip(more) {
                    values.iter_mut().skip(k).take(1).for_each(|x| *x += more);
                }
            }
            let [q, qd, qdd] = &motion;
            let efforts = read(&state.efforts, &change.efforts, 1.0, 0.0);
            let rate = 1.0 / change.times;
            Measured {
                time: state.time * change.times,
                motion: [
                    read(q, &change.positions, 1.0, 1.0),
                    read(qd, &change.positions, rate, 0.0),
                    read(qdd, &change.positions, rate * rate, 0.0),
                ],
                efforts: efforts
                    .iter()
                    .zip(&change.offsets)
                    .map(|(u, c)| u - c)
                    .collect(),
                resting: (change.positions.iter())
                    .map(|own| state.resting.get(own.from) == Some(&true))
                    .collect(),
            }
        };
        let noise = |own: &Reading| {
            let noise = self.acceleration_noise.get(own.from).copied();
            noise.unwrap_or(0.0) * own.factor.abs() / change.times.powi(2)
        };
        Self {
            states: self.states.iter().enumerate().map(state).collect(),
            step: self.step * change.times,
            acceleration_noise: change.positions.iter().map(noise).collect(),
            ..self.clone()
        }
    }
}

/// The results of checking a log.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Findings {
    /// The change of columns that explains the errors, if there is one.
    pub change: Option<Change>,
    /// The efforts that are far from what the model explains in a part of the log, and matter.
    pub far: Vec<FarEffort>,
    /// The efforts that are cut off.
    pub cut_off: Vec<CutOff>,
    /// The efforts without their sign: indices into `Info::actuated`; no other mistake is searched then.
    pub rectified: Vec<usize>,
    /// The parts of a log that needs other parameters in each; there is no change then.
    pub parts: Option<Parts>,
    /// The efforts that drift; only where no change explains the errors.
    pub drifts: Vec<Drift>,
    /// The comparison of each equation's effort with that of the nominal bodies, where they can be
    /// compared; efforts are read with the change.
    pub nominal: Vec<Nominal>,
    /// The errors of the equations without a change, as in [`Change::before`].
    pub errors: Vec<f64>,
    /// The coordinates whose friction drives the joint, with its power over the efforts' power
    /// (negative).
    pub driving: Vec<(usize, f64)>,
    /// Friction and rotor parameters identified as negative that matter for the errors; only where
    /// no change explains them.
    pub negative: Vec<NegativeParameter>,
    /// Efforts with a constant offset that direction-dependent friction has absorbed; only where no
    /// change explains them.
    pub shifts: Vec<Shift>,
}

/// The largest number of states used for a hypothesis on positions, unless the parameters need
/// more.
const MAX_POSITION_STATES: usize = 240;
/// The smallest number of equations per base parameter for a hypothesis on positions.
const MIN_EQUATIONS_PER_PARAMETER: usize = 3;
/// Relative errors above this are not explained.
const UNEXPLAINED_ERROR: f64 = 0.25;
/// The factor by which a change may increase the error of an effort that it leaves unexplained.
const MAX_HARM: f64 = 1.2;
/// The part of the largest error that a change may leave if that effort stays unexplained.
const MAX_LEFT_OF_WORST: f64 = 0.7;
/// A fit leaves this part of an effort that is noise at most.
const MAX_LEFT_OF_NOISE: f64 = 1.05;
/// Relative errors above this cause hypotheses on positions to be tried.
const DOUBTED_ERROR: f64 = 0.1;
/// The factor by which a change must reduce the product of errors for each column that it changes:
/// halving is not an accident.
const MIN_GAIN_PER_COLUMN: f64 = 2.0;
/// The largest number of changes found one after the other.
const MAX_LOOKS: usize = 4;
/// With a smaller correlation in time, residuals of any size are noise.
const MAX_CORRELATION_OF_WHITE: f64 = 0.2;
/// Relative errors below this are normal if what is left is noise.
const MIN_DOUBTED_ERROR: f64 = 0.03;
/// The factor by which the product of errors must be smaller with numbers than with columns that are read in another
/// way, and for each number more.
const MIN_GAIN_OF_NUMBERS: f64 = 1.5;
/// The factor by which the product of errors must be smaller without the states that are far off.
const MIN_GAIN_OF_REST: f64 = 1.2;
/// The smallest offset that is reported, relative to the rms of its effort.
const MIN_OFFSET_PART: f64 = 0.05;
/// The largest offset, relative to the same: what is larger is no constant of an effort, but hides another mistake.
const MAX_OFFSET_PART: f64 = 10.0;
/// The largest relative error at which an effort counts as explained after a change.
const MAX_EXPLAINED_ERROR: f64 = 0.5;

/// Searches for a change of columns with which a log fits far better, and checks the fit for
/// results that are physically impossible. What is left after a change is looked at again, as mistakes hide
/// one another.
///
/// - `own`: a factor for each effort that belongs to its joint and not to its column, such as a
///   torque constant: it stays with the joint where columns are exchanged; 1 where there is none.
/// - `estimate`: the base parameters identified from the whole log, and their standard deviations.
/// - `step`: called with the number of hypotheses tried so far and in total.
pub fn look<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    own: &[f64],
    estimate: Option<(&[f64], &[f64])>,
    step: &mut dyn FnMut(usize, usize),
) -> Findings {
    let known = with_noise(model, sample);
    let sample = known.as_ref().unwrap_or(sample);
    // other mistakes hide a unit from the equations, but not from the limits
    if let Some(units) = facts::units_by_limits(model, sample) {
        let found = look_from(model, &sample.read_with(&units), own, None, step);
        let errors = errors_of(model, sample);
        let mut change = match &found.change {
            Some(more) => units.then(more),
            None => Change {
                after: found.errors.clone(),
                ..units
            },
        };
        change.before.clone_from(&errors);
        let is_better = errors.is_empty() || quality(&change.after) < quality(&errors);
        if !change.after.is_empty() && is_better && !change.harms() {
            let (of_units, left) = (quality(&change.after), worst(&change.after));
            let found = Findings {
                change: Some(change),
                errors,
                ..found
            };
            if left < MIN_DOUBTED_ERROR {
                return found;
            }
            // a sign may bring a position beyond its limits as well
            let other = look_from(model, sample, own, estimate, step);
            let best = other.change.as_ref().map(|own| quality(&own.after));
            return match best {
                Some(best) if best < of_units => other,
                _ => found,
            };
        }
    }
    look_from(model, sample, own, estimate, step)
}

/// The errors of the equations of a sample as it is; empty if the loops do not close.
fn errors_of<M: BaseModel<f64> + ?Sized>(model: &M, sample: &Sample) -> Vec<f64> {
    let every = sample
        .states
        .len()
        .div_ceil(MAX_POSITION_STATES.max(least_states(model)));
    let plain = Reading::plain(sample.measured.len());
    let grams = Grams::of_hypothesis(model, sample, &plain, every.max(1));
    let fit = grams
        .filter(Grams::closes)
        .and_then(|own| own.fit(&Reading::plain(model.info().actuated.len()), &[]));
    fit.map(|own| own.errors).unwrap_or_default()
}

/// As [`look`], from the sample as it is.
fn look_from<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    own: &[f64],
    estimate: Option<(&[f64], &[f64])>,
    step: &mut dyn FnMut(usize, usize),
) -> Findings {
    let mut out = look_once(model, sample, own, estimate, step);
    let first = out.clone();
    for _ in 1..MAX_LOOKS {
        let Some(change) = &out.change else { break };
        let read = sample.read_with(change);
        let next = with_noise(model, &read);
        let next = look_once(model, next.as_ref().unwrap_or(&read), own, None, step);
        let both = next.change.as_ref().map(|more| change.then(more));
        out.nominal = next.nominal;
        out.driving = next.driving;
        out.far = next.far;
        let Some(both) = both else { break };
        out.change = Some(both);
    }
    // mistakes hide one another, so that only the last of several changes tells
    if out.change.as_ref().is_some_and(Change::harms) {
        out = Findings {
            change: None,
            ..first
        };
    }
    out
}

/// The change that explains most, and what is impossible without one.
fn look_once<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    own: &[f64],
    estimate: Option<(&[f64], &[f64])>,
    step: &mut dyn FnMut(usize, usize),
) -> Findings {
    let info = model.info();
    let mut out = Findings::default();
    let every = sample.states.len().div_ceil(STATES).max(1);
    let plain = Reading::plain(sample.measured.len());
    let mut grams = Grams::of(model, sample, &plain, every);
    let rest;
    let mut sample = sample;
    if let Some((far, left, others)) = grams
        .as_ref()
        .and_then(|own| without_far(model, sample, own, every))
    {
        (out.far, grams, rest) = (far, Some(others), left);
        sample = &rest;
    }
    let mut best: Option<Change> = None;
    let mut fits = None;
    let read = Reading::plain(info.actuated.len());
    if let Some(grams) = &grams
        && let Some(now) = grams.fit(&read, &[])
    {
        out.errors.clone_from(&now.errors);
        out.rectified = rectified::search(sample, grams, &now);
        if !out.rectified.is_empty() {
            return out;
        }
        best = efforts::search(model, grams, own, &now);
        let of_motion = best
            .as_ref()
            .and_then(|c| positions::signs(model, sample, c));
        best = of_motion.or(best);
        fits = Some(now);
    }
    let open = grams.as_ref().is_none_or(|grams| !grams.closes()) || fits.is_none();
    let correlation = match (&grams, &fits) {
        (Some(grams), Some(now)) => trial::correlation(sample, grams, now),
        _ => 1.0,
    };
    // no motion that is read in another way explains noise
    let is_noise = (grams.iter().zip(&fits)).any(|(grams, now)| is_noise_of_motion(grams, now));
    let doubted =
        worst(&out.errors) > DOUBTED_ERROR && correlation > MAX_CORRELATION_OF_WHITE && !is_noise;
    let wrong = open || doubted || facts::beyond_limits(model, sample);
    if wrong && let Some(found) = positions::search(model, sample, own, open, best.as_ref(), step) {
        best = Some(found);
    }
    if let (Some(grams), Some(now)) = (&grams, &fits) {
        if best.is_none() && correlation > MAX_CORRELATION_OF_WHITE && !is_noise {
            let found = efforts::in_noise(model, grams, own, now);
            best = found.filter(|change| leaves_noise(model, sample, change, now));
        }
        best = best.or_else(|| efforts::signs(model, grams, now));
        let is_normal = is_noise
            || worst(&now.errors) < MIN_DOUBTED_ERROR
                && correlation < trial::MAX_CORRELATION_OF_NOISE;
        if !is_normal {
            best = with_numbers(best, || unknowns::search(model, sample, grams, now));
            let numbers = best.as_ref();
            let sign = numbers.and_then(|own| positions::sign_for_numbers(model, sample, own));
            best = sign.or(best);
        } else if best.is_none() {
            best = unknowns::constants(model, sample, grams, now);
        }
        if best.is_none() && correlation > trial::MAX_CORRELATION_OF_NOISE && !is_noise {
            best = efforts::beside_weights(model, grams, own);
        }
        let parts = parts::search(sample, grams, now);
        let is_less = |own: &Parts| {
            let other = best.as_ref().map(|best| quality(&best.after));
            other.is_none_or(|other| MIN_GAIN_OF_NUMBERS * quality(&own.after) < other)
        };
        out.parts = parts.filter(is_less);
        out.cut_off = cut_off::search(sample, grams, now);
        if !out.cut_off.is_empty() {
            out.parts = None;
        }
        if out.parts.is_some() || !out.cut_off.is_empty() {
            best = None;
        }
        out.nominal = facts::nominal(model, grams, &read);
        out.driving = facts::driving(model, grams, now);
        if best.is_none() && out.parts.is_none() && out.cut_off.is_empty() {
            out.drifts = drifts::search(sample, grams, now);
        }
        if let (None, None, Some((values, sigmas))) = (&best, &out.parts, estimate) {
            out.negative = facts::negative(model, grams, now, values, sigmas);
            out.shifts = facts::shifts(model, grams, now, values, sigmas);
        }
    }
    if let Some(change) = &mut best
        && change.positions.is_empty()
    {
        change.positions = plain;
    }
    out.change = best;
    out
}

/// Whether what a change of efforts leaves is noise, and is less than without it by more than chance.
fn leaves_noise<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    change: &Change,
    before: &Fit,
) -> bool {
    let mut change = change.clone();
    change.positions = Reading::plain(sample.measured.len());
    let read = sample.read_with(&change);
    let every = read.states.len().div_ceil(STATES).max(1);
    let grams = Grams::of(model, &read, &change.positions, every);
    let Some((grams, fit)) = grams.and_then(|grams| {
        let fit = grams.fit(&Reading::plain(change.efforts.len()), &[])?;
        Some((grams, fit))
    }) else {
        return false;
    };
    let correlation = trial::correlation(&read, &grams, &fit);
    let independent = grams.stored.len() as f64 * (1.0 - correlation) / (1.0 + correlation);
    let gain = unknowns::log_errors(before) - unknowns::log_errors(&fit);
    correlation < MAX_CORRELATION_OF_WHITE
        && 2.0 * independent * gain > unknowns::MIN_DEVIATIONS * unknowns::MIN_DEVIATIONS
}

/// The change, or that of numbers instead if it explains more.
fn with_numbers(found: Option<Change>, numbers: impl FnOnce() -> Option<Change>) -> Option<Change> {
    let Some(found) = found else { return numbers() };
    // a constant is one of several numbers that may be wrong
    let is_constant = found.has_constants_only();
    if found.sign || (!is_constant && worst(&found.after) < DOUBTED_ERROR) {
        return Some(found);
    }
    let better = numbers().filter(|own| {
        let more = if is_constant {
            own.number_count() - found.number_count()
        } else {
            1
        };
        quality(&own.after) * MIN_GAIN_OF_NUMBERS.powi(more) <= quality(&found.after)
    });
    better.or(Some(found))
}

/// The efforts that are far off in a part of the log, the sample without these states and its sums; `None` if
/// there are none, or the rest is explained no better without them.
fn without_far<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    grams: &Grams,
    every: usize,
) -> Option<(Vec<FarEffort>, Sample, Grams)> {
    let read = Reading::plain(model.info().actuated.len());
    let plain = Reading::plain(sample.measured.len());
    let without = |states: &[usize]| Sample {
        states: (sample.states.iter().enumerate())
            .filter(|(k, _)| states.binary_search(k).is_err())
            .map(|(_, state)| state.clone())
            .collect(),
        ..sample.clone()
    };
    let now = grams.fit(&read, &[])?;
    let doubted = far::doubted(grams, &now);
    if doubted.is_empty() {
        return None;
    }
    let fit = Grams::of(model, &without(&doubted), &plain, every)?.fit(&read, &[])?;
    let (efforts, states) = far::efforts(sample, grams, &fit);
    if efforts.is_empty() {
        return None;
    }
    let rest = without(&states);
    let others = Grams::of(model, &rest, &plain, every)?;
    let fit = others.fit(&read, &[])?;
    // the search goes on with what is explained better
    (quality(&now.errors) > MIN_GAIN_OF_REST * quality(&fit.errors))
        .then_some((efforts, rest, others))
}

/// The number of states that give as many equations for each parameter as are needed at least.
fn least_states<M: BaseModel<f64> + ?Sized>(model: &M) -> usize {
    let columns = model.base_info().base.len();
    (MIN_EQUATIONS_PER_PARAMETER * columns).div_ceil(model.info().dof().max(1))
}

/// Whether an effort is left unexplained that was explained better: fits to other columns differ a little by chance.
fn is_less_explained(before: &[f64], after: &[f64]) -> bool {
    let mut pairs = before.iter().zip(after);
    pairs.any(|(before, after)| *after > UNEXPLAINED_ERROR.max(MAX_HARM * before))
}

/// Whether what is left is noise, which nothing explains, and another effort is explained far better.
fn is_beside_noise(before: &[f64], after: &[f64]) -> bool {
    let mut pairs = before.iter().zip(after);
    worst(after) < MAX_LEFT_OF_NOISE
        && pairs.any(|(own, after)| *own > DOUBTED_ERROR.max(MIN_GAIN_PER_COLUMN * after))
}

/// The largest error.
fn worst(errors: &[f64]) -> f64 {
    errors.iter().fold(0.0, |m: f64, e| m.max(*e))
}

/// The product of the errors, each taken as 1 % at least: smaller ones do not matter.
fn quality(errors: &[f64]) -> f64 {
    errors.iter().map(|e| e.max(0.01)).product()
}

/// The smallest error that is compared where changes of the spec and of columns both explain a log.
const LEAST_COMPARED: f64 = 1e-4;

/// The geometric mean of the errors, percent.
fn left_of(errors: &[f64]) -> f64 {
    let logs = errors.iter().map(|own| libm::log(own.max(LEAST_COMPARED)));
    100.0 * libm::exp(logs.sum::<f64>() / errors.len().max(1) as f64)
}
