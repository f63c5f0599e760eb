//! Hypotheses on single numbers that the equations determine: a constant in an effort, the zero of a
//! position and its ratio, the rate of the rows, how late a position is, or all efforts are. Those that
//! explain the errors together are found by Gauss and Newton.

use super::grams::{Fit, Grams, Stored, solve};
use super::trial::{MAX_CORRELATION_OF_NOISE, correlation};
use core::cell::Cell;

use super::{
    Change, DOUBTED_ERROR, MAX_CORRELATION_OF_WHITE, MAX_EXPLAINED_ERROR, MAX_OFFSET_PART,
    MIN_DOUBTED_ERROR, MIN_GAIN_PER_COLUMN, MIN_OFFSET_PART, Measured, Reading, Sample,
    implausible_count, least_states, quality, worst,
};
use regen_runtime::{BaseModel, Motion};

/// The number of states at which numbers are compared, unless the parameters need more.
const STATES: usize = 100;
/// How many states are computed before that ends, for many parameters how many passes over the fewest, and for long
/// logs as many as in two passes over them.
const MAX_WORK: usize = 3000;
const MIN_PASSES: usize = 30;
/// The step by which the effect of a number is differentiated, rad, m or s.
const STEP: f64 = 1e-4;
/// The largest number of steps of Gauss and Newton, of shorter ones where one explains no more, and of longer ones
/// where it explains more.
const MAX_STEPS: usize = 4;
const MAX_SHORTER: usize = 3;
const MAX_LONGER: usize = 3;
/// The largest change of a number in one of them, rad, m or s, and that of the logarithm of a rate.
const MAX_CHANGE: f64 = 0.5;
const MAX_CHANGE_OF_RATE: f64 = 0.8;
/// A step that reduces the sum of the logarithms of the errors by less is the last.
const SETTLED: f64 = 0.01;
/// The largest number of unknowns of which a step is computed for each that is added, and the part of what the
/// first of them explains that they do, too; of how many of these the optimum is computed, and how many are added.
const TRIED: usize = 4;
const NEARLY: f64 = 0.2;
const SETTLED_TO_THE_END: usize = 2;
const MOST: usize = 3;
/// The deviations by which chance would have to explain the errors as well as an unknown does.
pub(super) const MIN_DEVIATIONS: f64 = 6.0;
/// The same of a constant in an effort, alone, at few states.
const MIN_DEVIATIONS_OF_CONSTANT: f64 = 3.0;
/// The deviations of a number up to which it may be a round one.
const MAX_DEVIATIONS_OF_ROUND: f64 = 3.0;
/// The factor by which an unknown must reduce the product of errors.
const MIN_GAIN: f64 = 1.1;
/// The same, where it changes the motion.
const MIN_GAIN_OF_MOTION: f64 = 1.5;
/// The factor by which the product of errors may be larger with another number that is fitted to the whole log, too.
const MAX_GAIN_OVER_RIVAL: f64 = 2.0;
/// The factor by which the error of an effort may be larger with a delay of all.
const MAX_LOSS_WITH_ALL: f64 = 1.05;
/// The smallest relative error that is compared.
const LEAST_ERROR: f64 = 1e-3;
/// The largest delay of a position or of the efforts, s; the smallest is a step of the log.
const MAX_LATE: f64 = 0.5;
/// The delays of all efforts from which one is looked for, s.
const DELAYS: [f64; 5] = [-0.1, 0.05, 0.12, 0.2, 0.3];
/// The zeros of a position from which one is looked for, in standard deviations of its motion.
const PARTS_OF_SWING: [f64; 6] = [-0.8, -0.4, -0.2, 0.2, 0.4, 0.8];
/// The ratios of a position by which it is looked for: less may be an error of the geometry.
const RATIOS: core::ops::Range<f64> = 1.2..30.0;
/// Ratios of gears are whole numbers, or a turn, if they are nearer than this part.
const MAX_OFF_RATIO: f64 = 0.02;
/// The factors by which a rate is looked for: a clock is more exact, and more is another unit.
const RATES: core::ops::Range<f64> = 1.05..10.0;
/// Rates of rows are round: one of these times a power of ten, nearer than the first part, and than chance allows if
/// not nearer than the second.
const ROUND: [f64; 10] = [1.0, 1.2, 1.25, 2.0, 2.5, 3.0, 10.0 / 3.0, 4.0, 5.0, 8.0];
const MAX_OFF_ROUND: f64 = 0.1;
const MAX_OFF_SURELY: f64 = 0.02;
/// The same of a rate that a clock gives.
const MAX_OFF_CLOCK: f64 = 0.01;
/// The distance from a quarter of a turn from which on that is tried, rad.
const MAX_OFF_QUARTER: f64 = 0.05;

/// What one number changes.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Unknown {
    /// The constant in an effort.
    Effort(usize),
    /// What is added to a position.
    Position(usize),
    /// The logarithm of the factor on the times.
    Rate,
    /// How late a position is, s.
    Late(usize),
    /// The logarithm of the factor on a position and its derivatives.
    Ratio(usize),
    /// How late all efforts are, s.
    Behind,
}

/// Numbers that were tried.
#[derive(Clone)]
struct Tried {
    values: Vec<(Unknown, f64)>,
    /// The states, read with them.
    states: Sample,
    grams: Grams,
    fit: Fit,
}

/// Fits to some of the states of a sample, of which only so many are computed.
struct Search<'a, M: ?Sized> {
    model: &'a M,
    sample: &'a Sample,
    /// Every how manieth state is used.
    every: usize,
    /// How many states may still be computed.
    left: Cell<usize>,
    /// For each equation: rms of the efforts about their mean without numbers, see [`Fit`].
    spreads: &'a [f64],
}

/// Finds the numbers that explain the errors, if that is no chance: zeros, constants and single delays, or else, or
/// where these leave much, a ratio or the delay of all efforts.
pub(super) fn search<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    grams: &Grams,
    now: &Fit,
) -> Option<Change> {
    // several that are late may be efforts that are early
    let first = search_among(model, sample, grams, now, &unknowns(model, sample));
    if first
        .as_ref()
        .is_some_and(|own| worst(&own.after) < DOUBTED_ERROR && own.late.len() < 2)
    {
        return first;
    }
    let ratios = (0..sample.measured.len()).map(Unknown::Ratio);
    let others: Vec<Unknown> = ratios.chain([Unknown::Behind]).collect();
    let second = search_among(model, sample, grams, now, &others);
    let is_better = |own: &Change| {
        first.as_ref().is_none_or(|first| {
            let more = own.number_count() - first.number_count();
            quality(&own.after) * MIN_GAIN.powi(more) < quality(&first.after)
        })
    };
    second.filter(is_better).or(first)
}

/// As [`search`], among some unknowns.
fn search_among<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    grams: &Grams,
    now: &Fit,
    unknowns: &[Unknown],
) -> Option<Change> {
    let least = least_states(model);
    if sample.states.len() < least {
        return None;
    }
    let few = Search {
        model,
        sample,
        every: sample.states.len().div_ceil(STATES.max(least)).max(1),
        left: Cell::new(MAX_WORK.max(MIN_PASSES * least).max(2 * sample.whole)),
        spreads: &now.spreads,
    };
    let mut found = few.of(Vec::new())?;
    // beyond a part of a swing no slope leads to a delay, nor to a zero where loops do not close
    let least = |a: &Tried, b: &Tried| log_errors(&a.fit).total_cmp(&log_errors(&b.fit));
    let begun = few
        .far_starts(&found, unknowns)
        .into_iter()
        .filter_map(|starts| {
            let best = starts
                .into_iter()
                .filter_map(|own| few.of(vec![own]))
                .min_by(least)?;
            Some(few.settled(best))
        });
    let begun = begun.min_by(least);
    if let Some(own) = begun.filter(|own| few.matters(own) && own.adds_to(&found)) {
        found = own;
    }
    let mut rival = None;
    for _ in 0..MOST {
        let mut ended = few.with_one_more(&found, unknowns).into_iter();
        let Some(more) = ended.next().map(|more| few.without_needless(more)) else {
            break;
        };
        if log_errors(&more.fit) >= log_errors(&found.fit) {
            break;
        }
        found = more;
        rival = ended.next().filter(|own| own.values.len() == 1);
        // what is left is noise, which more numbers explain by chance only
        if found.correlation() < MAX_CORRELATION_OF_NOISE {
            break;
        }
    }
    if found.values.is_empty() {
        return None;
    }
    // few states leave some noise in the numbers
    let stored = grams.stored.len().max(1);
    let all = Search {
        every: sample.states.len().div_ceil(stored).max(1),
        left: Cell::new(usize::MAX),
        ..few
    };
    let found = all.of(found.values)?;
    let found = all.settled(found);
    let found = all.rounded(found)?;
    let of_motion = |own: &(Unknown, f64)| !matches!(own.0, Unknown::Effort(_));
    let is_explained = (!found.values.iter().any(of_motion) || found.explains(now, sample))
        && found.explains_constants();
    let count = found.values.len() as f64;
    let is_certain = found.likelihood_gain(now) > count * MIN_DEVIATIONS * MIN_DEVIATIONS;
    let gain = gain_over(now, &found.fit);
    let plausible =
        implausible_count(model, &found.grams, &found.fit) <= implausible_count(model, grams, now);
    let is_told = is_certain && plausible && is_explained && gain >= libm::pow(MIN_GAIN, count);
    let rival = rival.filter(|_| is_told && found.values.len() == 1);
    let rival = rival.and_then(|own| Some(all.settled(all.of(own.values)?)));
    let rival = rival
        .filter(|own| all.matters(own) && gain_over(&own.fit, &found.fit) < MAX_GAIN_OVER_RIVAL);
    is_told.then(|| Change {
        rival: rival.map(|own| Box::new(own.change(model, sample, now))),
        ..found.change(model, sample, now)
    })
}

/// Finds the constants in efforts that explain the errors of a log in which these are small, if that is no chance:
/// parameters of weights take most of a constant up, and are off by many of their deviations.
pub(super) fn constants<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    grams: &Grams,
    now: &Fit,
) -> Option<Change> {
    let efforts = model.info().actuated.len();
    let plain = Reading::plain(efforts);
    let mut offsets: Vec<usize> = Vec::new();
    let mut least = log_errors(now);
    for _ in 0..MOST.min(efforts) {
        let more = (0..efforts).filter(|k| !offsets.contains(k));
        let more = more.filter_map(|k| {
            let tried = [offsets.as_slice(), &[k]].concat();
            Some((log_errors(&grams.fit(&plain, &tried)?), tried))
        });
        let Some((errors, tried)) = more.min_by(|a, b| a.0.total_cmp(&b.0)) else {
            break;
        };
        if errors + libm::log(MIN_GAIN) > least {
            break;
        }
        (least, offsets) = (errors, tried);
    }
    if offsets.is_empty() {
        return None;
    }
    let fit = grams.fit(&plain, &offsets)?;
    let values = fit.values.get(grams.columns()..)?;
    let all = Search {
        model,
        sample,
        every: sample
            .states
            .len()
            .div_ceil(grams.stored.len().max(1))
            .max(1),
        left: Cell::new(usize::MAX),
        spreads: &now.spreads,
    };
    let values = offsets.iter().map(|k| Unknown::Effort(*k)).zip(values);
    let values: Vec<(Unknown, f64)> = values.map(|(of, value)| (of, *value)).collect();
    if !values.iter().all(|own| all.is_large(own)) {
        return None;
    }
    let found = all.of(values)?;
    let needed = offsets.len() as f64 * MIN_DEVIATIONS * MIN_DEVIATIONS;
    let plausible =
        implausible_count(model, &found.grams, &found.fit) <= implausible_count(model, grams, now);
    let is_told = found.likelihood_gain(now) > needed && plausible && found.explains_constants();
    is_told.then(|| found.change(model, sample, now))
}

/// The sum of the logarithms of the errors.
pub(super) fn log_errors(fit: &Fit) -> f64 {
    fit.errors
        .iter()
        .map(|e| libm::log(e.max(LEAST_ERROR)))
        .sum()
}

/// The factor by which the product of the errors is smaller.
fn gain_over(before: &Fit, after: &Fit) -> f64 {
    libm::exp(log_errors(before) - log_errors(after))
}

/// The unknowns of a log.
fn unknowns<M: BaseModel<f64> + ?Sized>(model: &M, sample: &Sample) -> Vec<Unknown> {
    let efforts = (0..model.info().actuated.len()).map(Unknown::Effort);
    let zeros = (0..sample.measured.len()).map(Unknown::Position);
    let late = (0..sample.measured.len()).map(Unknown::Late);
    // measured velocities tell the rate
    let rate = (!sample.has_rates).then_some(Unknown::Rate);
    efforts.chain(zeros).chain(late).chain(rate).collect()
}

/// Every `every`-th state, read with these numbers.
fn moved(sample: &Sample, every: usize, by: &[(Unknown, f64)]) -> Sample {
    let mut states = Vec::with_capacity(sample.states.len() / every + 1);
    for (place, state) in sample.states.iter().enumerate().step_by(every.max(1)) {
        let mut own: Measured = state.clone();
        let mut add = |d: usize, k: usize, x: f64| {
            let entries = own.motion[d].iter_mut().skip(k).take(1);
            entries.for_each(|own| *own += x);
        };
        let shift = |k: usize| {
            let one = |(unknown, value): &(Unknown, f64)| match unknown {
                Unknown::Late(late) if *late == k => *value,
                // efforts that are late are those of earlier motion
                Unknown::Behind => -value,
                _ => 0.0,
            };
            by.iter().map(one).sum::<f64>()
        };
        for k in 0..sample.measured.len() {
            let by = shift(k);
            if by != 0.0 {
                let more = later(&sample.states, place, k, by);
                more.into_iter().enumerate().for_each(|(d, x)| add(d, k, x));
            }
        }
        let of = |list: &mut [f64], k: usize, change: &dyn Fn(&mut f64)| {
            list.iter_mut().skip(k).take(1).for_each(change);
        };
        for (unknown, value) in by {
            if let Unknown::Ratio(k) = unknown {
                let factor = libm::exp(*value);
                (own.motion.iter_mut()).for_each(|list| of(list, *k, &|x| *x *= factor));
            }
        }
        for (unknown, value) in by {
            match unknown {
                Unknown::Effort(k) => of(&mut own.efforts, *k, &|u| *u -= value),
                Unknown::Position(k) => of(&mut own.motion[0], *k, &|q| *q += value),
                Unknown::Rate => {
                    let [_, qd, qdd] = &mut own.motion;
                    for v in qd {
                        *v /= libm::exp(*value);
                    }
                    for a in qdd {
                        *a /= libm::exp(2.0 * value);
                    }
                }
                Unknown::Late(_) | Unknown::Ratio(_) | Unknown::Behind => {}
            }
        }
        states.push(own);
    }
    Sample {
        measured: sample.measured.clone(),
        unmeasured: sample.unmeasured.clone(),
        least_errors: sample.least_errors.clone(),
        states,
        ..Sample::default()
    }
}

/// By how much the motion of a coordinate is another one some time later, interpolated between the states.
pub(super) fn later(states: &[Measured], place: usize, k: usize, by: f64) -> [f64; 3] {
    let Some(own) = states.get(place) else {
        return [0.0; 3];
    };
    let time = own.time + by;
    let next = states.partition_point(|state| state.time < time);
    let next = next.clamp(1, states.len().saturating_sub(1).max(1));
    let (Some(a), Some(b)) = (states.get(next - 1), states.get(next)) else {
        return [0.0; 3];
    };
    let step = b.time - a.time;
    let part = if step > 0.0 {
        (time - a.time) / step
    } else {
        0.0
    };
    // far from all states, as in a gap, there is nothing to interpolate
    if !(-1.0..=2.0).contains(&part) {
        return [0.0; 3];
    }
    let at = |state: &Measured, d: usize| state.motion[d].get(k).copied().unwrap_or(0.0);
    let between = |d: usize| at(a, d) + part * (at(b, d) - at(a, d));
    [0, 1, 2].map(|d| {
        // positions are curved between states
        let bend = if d == 0 {
            -0.5 * part * (1.0 - part) * step * step * between(2)
        } else {
            0.0
        };
        between(d) + bend - at(own, d)
    })
}

impl Tried {
    fn correlation(&self) -> f64 {
        correlation(&self.states, &self.grams, &self.fit)
    }

    /// Twice the logarithm of how much more likely the efforts are than after another fit, where neighbouring
    /// states count as far as they are independent.
    fn likelihood_gain(&self, before: &Fit) -> f64 {
        // states that are too far apart for it are independent
        let own = Some(self.correlation()).filter(|own| *own < 1.0);
        let own = own.unwrap_or(0.0).min(0.99);
        let states = self.grams.stored.len() as f64 * (1.0 - own) / (1.0 + own);
        2.0 * states * (log_errors(before) - log_errors(&self.fit))
    }

    /// Whether each effort that is explained better than before is explained: a motion that is read in another
    /// way can explain a little of what has another cause, unless it leaves noise, or makes a rate round that is not.
    fn explains(&self, before: &Fit, sample: &Sample) -> bool {
        let gain = gain_over(before, &self.fit);
        let mut pairs = self.fit.errors.iter().zip(&before.errors);
        let makes_round = match self.values[..] {
            [(Unknown::Rate, by)] => {
                !is_round(1.0 / sample.step) && is_round(1.0 / (sample.step * libm::exp(by)))
            }
            _ => false,
        };
        // what leaves noise is the cause
        let needed = if makes_round || self.correlation() < MAX_CORRELATION_OF_WHITE {
            MIN_GAIN
        } else {
            MIN_GAIN_OF_MOTION
        };
        // a delay of all is not that of one effort, of which noise may be left
        let is_of_all = self.values.iter().all(|own| own.0 == Unknown::Behind);
        gain >= needed
            && pairs.all(|(after, before)| {
                if is_of_all {
                    // one cause makes no effort less explained
                    *after < MIN_DOUBTED_ERROR || *after < MAX_LOSS_WITH_ALL * before
                } else {
                    *after < DOUBTED_ERROR
                        || *before < MIN_GAIN * after
                        || *before > MIN_GAIN_PER_COLUMN * after
                }
            })
    }

    /// Whether the efforts with constants are explained with them, but for noise: what leaves most of an effort is
    /// not what is wrong with it.
    fn explains_constants(&self) -> bool {
        let has = |k: usize| self.values.iter().any(|own| own.0 == Unknown::Effort(k));
        let mut errors = self.fit.errors.iter().enumerate();
        let are_explained = errors.all(|(i, error)| {
            *error < MAX_EXPLAINED_ERROR || !self.grams.only_effort(i).is_some_and(has)
        });
        are_explained || self.correlation() < MAX_CORRELATION_OF_WHITE
    }

    fn weights(&self) -> Vec<f64> {
        let pairs = self.fit.errors.iter().zip(&self.fit.spreads);
        pairs
            .map(|(error, spread)| 1.0 / (error * spread).max(f64::MIN_POSITIVE))
            .collect()
    }

    /// Whether these numbers explain more than fewer of them do, by more than chance.
    fn adds_to(&self, fewer: &Self) -> bool {
        // a constant is compared with all states in the end
        let is_constant = |own: &(Unknown, f64)| matches!(own.0, Unknown::Effort(_));
        let deviations = if fewer.values.is_empty() && self.values.iter().all(is_constant) {
            MIN_DEVIATIONS_OF_CONSTANT
        } else {
            MIN_DEVIATIONS
        };
        self.likelihood_gain(&fewer.fit) > deviations * deviations
            && gain_over(&fewer.fit, &self.fit) > MIN_GAIN
    }

    fn residuals(&self) -> Vec<f64> {
        let weights = self.weights();
        let each = self.grams.stored.iter().flat_map(|own| {
            let pairs = weights.iter().enumerate();
            pairs
                .map(|(i, weight)| weight * own.residual(i, &self.fit.values))
                .collect::<Vec<_>>()
        });
        each.collect()
    }

    fn change<M: BaseModel<f64> + ?Sized>(&self, model: &M, sample: &Sample, now: &Fit) -> Change {
        let mut out = Change::none(model.info().actuated.len(), sample.measured.len());
        for (unknown, value) in &self.values {
            match unknown {
                Unknown::Effort(k) => out
                    .offsets
                    .iter_mut()
                    .skip(*k)
                    .take(1)
                    .for_each(|own| *own = *value),
                Unknown::Position(k) => {
                    out.positions
                        .iter_mut()
                        .skip(*k)
                        .take(1)
                        .for_each(|own| own.offset = *value);
                }
                Unknown::Ratio(k) => {
                    out.positions
                        .iter_mut()
                        .skip(*k)
                        .take(1)
                        .for_each(|own| own.factor = libm::exp(*value));
                }
                Unknown::Behind => out.behind = *value,
                Unknown::Rate => out.times = libm::exp(*value),
                Unknown::Late(k) => out.late.push((*k, *value)),
            }
        }
        out.before.clone_from(&now.errors);
        out.after.clone_from(&self.fit.errors);
        out
    }
}

impl<M: BaseModel<f64> + ?Sized> Search<'_, M> {
    /// The values from which numbers are looked for that no slope leads to, those of each number.
    fn far_starts(&self, from: &Tried, unknowns: &[Unknown]) -> Vec<Vec<(Unknown, f64)>> {
        let states = &from.states.states;
        let count = states.len().max(1) as f64;
        let opens = from.grams.stored.len() < states.len();
        let swing = |k: usize| {
            let values = states
                .iter()
                .filter_map(|own| own.motion[0].get(k).copied());
            let mean = values.clone().sum::<f64>() / count;
            let square = values.map(|q| (q - mean).powi(2)).sum::<f64>() / count;
            square.sqrt()
        };
        let starts = unknowns.iter().filter_map(|unknown| {
            let values: Vec<f64> = match unknown {
                Unknown::Behind => DELAYS.to_vec(),
                Unknown::Position(k) if opens => PARTS_OF_SWING.map(|x| x * swing(*k)).to_vec(),
                _ => return None,
            };
            Some(values.into_iter().map(|value| (*unknown, value)).collect())
        });
        let starts: Vec<Vec<(Unknown, f64)>> = starts.collect();
        if opens {
            // they are beside the work of the search
            let more = starts
                .iter()
                .map(|own| own.len() + MAX_STEPS)
                .sum::<usize>()
                * states.len();
            self.left.set(self.left.get().saturating_add(more));
        }
        starts
    }

    /// The states, read with these numbers, and their sums; `None` if the loops do not close, or it was enough.
    fn sums(&self, values: &[(Unknown, f64)]) -> Option<(Sample, Grams)> {
        let count = self.sample.states.len().div_ceil(self.every);
        self.left.set(self.left.get().checked_sub(count)?);
        let own = moved(self.sample, self.every, values);
        let grams = Grams::of(self.model, &own, &Reading::plain(own.measured.len()), 1)?;
        Some((own, grams))
    }

    /// A fit with these numbers.
    fn of(&self, values: Vec<(Unknown, f64)>) -> Option<Tried> {
        let (states, grams) = self.sums(&values)?;
        let efforts = self.model.info().actuated.len();
        let mut fit = grams.fit(&Reading::plain(efforts), &[])?;
        if values.iter().any(|own| matches!(own.0, Unknown::Effort(_))) {
            // a constant may make an effort as large as one likes, and its relative error as small
            let pairs = fit.errors.iter_mut().zip(&mut fit.spreads);
            for ((error, spread), before) in pairs.zip(self.spreads) {
                *error *= *spread / before;
                *spread = *before;
            }
        }
        Some(Tried {
            values,
            states,
            grams,
            fit,
        })
    }

    /// The change of the weighted residuals with a number, without what the parameters make good.
    fn slope(&self, at: &Tried, unknown: Unknown) -> Option<Vec<f64>> {
        let weights = at.weights();
        let rows = at.grams.rows();
        let mut slopes = Vec::with_capacity(at.grams.stored.len() * rows);
        if let Unknown::Effort(k) = unknown {
            for own in &at.grams.stored {
                slopes.extend((0..rows).zip(&weights).map(|(i, weight)| {
                    -weight * own.transfer.get(k * rows + i).copied().unwrap_or(0.0)
                }));
            }
        } else {
            let mut values = at.values.clone();
            match values.iter_mut().find(|own| own.0 == unknown) {
                Some(own) => own.1 += STEP,
                None => values.push((unknown, STEP)),
            }
            let (_, ahead) = self.sums(&values)?;
            for own in &at.grams.stored {
                // a state that does not close with the step says nothing
                let other = ahead.stored.binary_search_by_key(&own.state, |o| o.state);
                let other = other
                    .ok()
                    .and_then(|place| ahead.stored.get(place))
                    .unwrap_or(own);
                slopes.extend(weights.iter().enumerate().map(|(i, weight)| {
                    let change =
                        other.residual(i, &at.fit.values) - own.residual(i, &at.fit.values);
                    weight * change / STEP
                }));
            }
        }
        let stored: Vec<&Stored> = at.grams.stored.iter().collect();
        let free = at.grams.without_parameters(&stored, &weights, &slopes)?;
        // a number that the parameters make good, as the zero of a first joint about gravity, has no slope
        (dot(&free, &free) > 1e-12 * dot(&slopes, &slopes) && dot(&free, &free) > 0.0)
            .then_some(free)
    }

    /// These numbers after a step of Gauss and Newton; `None` if it explains no more.
    fn stepped(&self, from: &Tried) -> Option<Tried> {
        let slopes = from.values.iter().map(|own| self.slope(from, own.0));
        self.along(from, &slopes.collect::<Option<Vec<_>>>()?)
    }

    /// As [`stepped`](Self::stepped), with these changes of the residuals with each number.
    fn along(&self, from: &Tried, slopes: &[Vec<f64>]) -> Option<Tried> {
        let n = slopes.len();
        let mut gram = vec![0.0; n * n];
        for (a, x) in slopes.iter().enumerate() {
            for (b, y) in slopes[..=a].iter().enumerate() {
                gram[a * n + b] = dot(x, y);
            }
        }
        let residuals = from.residuals();
        let right: Vec<f64> = slopes.iter().map(|slope| -dot(slope, &residuals)).collect();
        let steps = solve(&mut gram, &right)?;
        let ahead = |part: f64| {
            let mut values = from.values.clone();
            for (own, step) in values.iter_mut().zip(&steps) {
                let most = match own.0 {
                    Unknown::Effort(_) => f64::INFINITY,
                    Unknown::Late(_) | Unknown::Behind => 0.2 * MAX_CHANGE,
                    Unknown::Rate | Unknown::Ratio(_) => MAX_CHANGE_OF_RATE,
                    Unknown::Position(_) => MAX_CHANGE,
                };
                own.1 += (part * step).clamp(-most, most);
            }
            self.of(values).filter(|own| own.grams.closes())
        };
        let gain = |next: &Tried, from: &Tried| log_errors(&from.fit) - log_errors(&next.fit);
        let mut part = 1.0;
        for _ in 0..MAX_SHORTER {
            if let Some(mut next) = ahead(part).filter(|next| gain(next, from) > 0.0) {
                // parameters that are far off hide most of what a number explains, which makes a step too short
                for _ in 0..MAX_LONGER {
                    part *= 2.0;
                    let longer = ahead(part).filter(|own| gain(own, &next) > SETTLED);
                    let Some(longer) = longer else { break };
                    next = longer;
                }
                return Some(next);
            }
            part *= 0.3;
        }
        None
    }

    /// The numbers at their optimum.
    fn settled(&self, mut own: Tried) -> Tried {
        for _ in 0..MAX_STEPS {
            let Some(next) = self.stepped(&own) else {
                break;
            };
            let less = log_errors(&own.fit) - log_errors(&next.fit);
            own = next;
            if less < SETTLED {
                break;
            }
        }
        own
    }

    /// These numbers and one more at its optimum, the one that explains most first, where that is no chance.
    fn with_one_more(&self, from: &Tried, unknowns: &[Unknown]) -> Vec<Tried> {
        let residuals = from.residuals();
        let mut first: Vec<(f64, Unknown, Vec<f64>)> = Vec::new();
        for unknown in unknowns.iter().copied() {
            let is_known = from.values.iter().any(|own| own.0 == unknown);
            if let (false, Some(slope)) = (is_known, self.slope(from, unknown)) {
                let part = dot(&slope, &residuals).powi(2) / dot(&slope, &slope);
                first.push((part, unknown, slope));
            }
        }
        first.sort_by(|a, b| b.0.total_cmp(&a.0));
        let most = first.first().map_or(0.0, |own| own.0);
        first.retain(|(part, ..)| *part >= NEARLY * most);
        // the best of a first step are computed to the end
        let mut begun: Vec<Tried> = Vec::new();
        for (_, unknown, slope) in first.into_iter().take(TRIED) {
            let mut with = from.clone();
            with.values.push((unknown, 0.0));
            // the others stay where they are at first
            let mut slopes = vec![vec![0.0; slope.len()]; from.values.len()];
            slopes.push(slope);
            begun.extend(self.along(&with, &slopes));
        }
        begun.sort_by(|a, b| log_errors(&a.fit).total_cmp(&log_errors(&b.fit)));
        begun.truncate(SETTLED_TO_THE_END);
        let ended = begun.into_iter().map(|own| self.settled(own));
        let ended = ended.filter(|own| self.matters(own) && own.adds_to(from));
        let mut ended: Vec<Tried> = ended.collect();
        ended.sort_by(|a, b| log_errors(&a.fit).total_cmp(&log_errors(&b.fit)));
        ended
    }

    /// These numbers without those that the others make needless.
    fn without_needless(&self, mut from: Tried) -> Tried {
        while from.values.len() > 1 {
            let less = (0..from.values.len()).filter_map(|k| {
                let mut values = from.values.clone();
                values.remove(k);
                Some(self.settled(self.of(values)?))
            });
            let best = less.min_by(|a, b| log_errors(&a.fit).total_cmp(&log_errors(&b.fit)));
            match best.filter(|less| !from.adds_to(less)) {
                Some(less) => from = less,
                None => break,
            }
        }
        from
    }

    /// Whether the last number is large enough to be told, and of a possible size.
    fn matters(&self, tried: &Tried) -> bool {
        tried.values.last().is_some_and(|own| self.is_large(own))
    }

    /// Whether a number is large enough to be told, and of a possible size.
    fn is_large(&self, (unknown, value): &(Unknown, f64)) -> bool {
        let states = &self.sample.states;
        match unknown {
            Unknown::Effort(k) => {
                let squares = states
                    .iter()
                    .filter_map(|s| s.efforts.get(*k))
                    .map(|u| u * u);
                let rms = (squares.sum::<f64>() / states.len() as f64).sqrt();
                (MIN_OFFSET_PART * rms..MAX_OFFSET_PART * rms).contains(&value.abs())
            }
            Unknown::Late(_) => *value > self.sample.step && *value < MAX_LATE,
            Unknown::Behind => value.abs() > self.sample.step && value.abs() < MAX_LATE,
            Unknown::Ratio(_) => RATIOS.contains(&libm::exp(value.abs())),
            Unknown::Rate => RATES.contains(&libm::exp(value.abs())),
            Unknown::Position(_) => true,
        }
    }

    /// Numbers that are nearly round are round; `None` if a rate is not, as then it has another cause.
    fn rounded(&self, from: Tried) -> Option<Tried> {
        let mut values = from.values.clone();
        let mut is_doubted_rate = false;
        for (unknown, value) in &mut values {
            match unknown {
                Unknown::Rate => {
                    let rate = 1.0 / (self.sample.step * libm::exp(*value));
                    let near = nearest_round(rate);
                    let off = libm::log(near / rate).abs();
                    if off > MAX_OFF_ROUND {
                        return None;
                    }
                    *value = -libm::log(near * self.sample.step);
                    is_doubted_rate |= off > MAX_OFF_SURELY;
                }
                Unknown::Position(k) => {
                    let joints = self.model.info().joints;
                    let joint = self.sample.measured.get(*k).and_then(|c| joints.get(*c));
                    let quarter = core::f64::consts::FRAC_PI_2;
                    let near = quarter * (*value / quarter).round();
                    let turns = joint.is_some_and(|joint| joint.motion == Motion::Rotation);
                    if turns && near != 0.0 && (near - *value).abs() < MAX_OFF_QUARTER {
                        *value = near;
                    }
                }
                Unknown::Ratio(_) => {
                    let size = libm::exp(value.abs());
                    let turn = core::f64::consts::TAU;
                    let near = [size.round(), turn].into_iter();
                    let mut near = near.filter(|near| (near / size - 1.0).abs() < MAX_OFF_RATIO);
                    *value = near
                        .next()
                        .map_or(*value, |near| libm::log(near) * value.signum());
                }
                _ => {}
            }
        }
        if values == from.values {
            return Some(from);
        }
        let round = self.of(values)?;
        let is_as_likely = from.likelihood_gain(&round.fit) < MAX_DEVIATIONS_OF_ROUND.powi(2);
        let has_rate = from.values.iter().any(|own| own.0 == Unknown::Rate);
        if is_as_likely || (has_rate && !is_doubted_rate) {
            Some(round)
        } else {
            (!is_doubted_rate).then_some(from)
        }
    }
}

/// The round rate that is nearest to one.
fn nearest_round(rate: f64) -> f64 {
    let ten = libm::pow(10.0, libm::log10(rate).floor());
    let near = ROUND.iter().chain(&[10.0]).map(|round| round * ten);
    let off = |a: f64| libm::log(a / rate).abs();
    near.fold(
        ten,
        |best, own| if off(own) < off(best) { own } else { best },
    )
}

/// Whether a rate is round as rates of rows are, but for an error of a clock.
fn is_round(rate: f64) -> bool {
    libm::log(nearest_round(rate) / rate).abs() < MAX_OFF_CLOCK
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::super::swings_for_tests::{Swings, sample_of, swings};
    use super::*;

    /// A constant in an effort of so many noisy states, some of more: by how much more likely it makes them, and
    /// what is found.
    fn constant(
        model: &Swings,
        (states, every): (u32, usize),
        value: f64,
    ) -> (f64, f64, bool, Option<Change>) {
        let mut sample = sample_of(states, 1.0);
        sample.states = sample.states.into_iter().step_by(every).collect();
        sample.states.iter_mut().for_each(|s| s.efforts[1] += value);
        let plain = Reading::plain(3);
        let grams = Grams::of(model, &sample, &plain, 1).unwrap();
        let now = grams.fit(&plain, &[]).unwrap();
        let all = Search {
            model,
            sample: &sample,
            every: 1,
            left: Cell::new(usize::MAX),
            spreads: &now.spreads,
        };
        let none = all.of(Vec::new()).unwrap();
        let own = all.settled(all.of(vec![(Unknown::Effort(1), value)]).unwrap());
        let likelihood = own.likelihood_gain(&now);
        let gain = gain_over(&now, &own.fit);
        (
            likelihood,
            gain,
            own.adds_to(&none),
            search(model, &sample, &grams, &now),
        )
    }

    #[test]
    fn a_delay_of_all_efforts_leaves_none_of_them_less_explained() {
        let model = swings(true);
        let sample = sample_of(200, 0.1);
        let search = Search {
            model: &model,
            sample: &sample,
            every: 1,
            left: Cell::new(usize::MAX),
            spreads: &[1.0; 3],
        };
        let mut found = search.of(vec![(Unknown::Behind, 0.01)]).unwrap();
        let mut before = found.fit.clone();
        before.errors = vec![0.4, 0.4, 0.16];
        found.fit.errors = vec![0.1, 0.2, 0.16];
        assert!(found.explains(&before, &sample));
        found.fit.errors = vec![0.1, 0.2, 0.19];
        assert!(!found.explains(&before, &sample));
    }

    #[test]
    fn a_number_is_told_only_if_chance_would_have_to_be_six_deviations_large() {
        let model = swings(false);
        let (mut told, mut doubted) = (0, 0);
        for k in 1..60 {
            let (likelihood, gain, _, found) = constant(&model, (150, 1), 0.02 * f64::from(k));
            let is_certain = likelihood > MIN_DEVIATIONS * MIN_DEVIATIONS;
            assert!(found.is_none() || is_certain, "{k}: {likelihood} {gain}");
            told += usize::from(found.is_some());
            doubted += usize::from(!is_certain && gain > MIN_GAIN);
        }
        assert!(told > 5 && doubted > 0, "{told} {doubted}");
    }

    #[test]
    fn a_constant_is_looked_at_from_three_deviations_on() {
        let model = swings(false);
        let mut doubted = 0;
        for k in 1..60 {
            let (likelihood, gain, adds, _) = constant(&model, (400, 16), 0.04 * f64::from(k));
            let least = MIN_DEVIATIONS_OF_CONSTANT * MIN_DEVIATIONS_OF_CONSTANT;
            assert_eq!(
                adds,
                likelihood > least && gain > MIN_GAIN,
                "{k}: {likelihood} {gain}"
            );
            doubted += usize::from(likelihood < least && gain > MIN_GAIN);
        }
        assert!(doubted > 0);
    }

    #[test]
    fn a_constant_that_leaves_most_of_its_effort_is_not_told() {
        let model = swings(false);
        let found = |other: f64| {
            let mut sample = sample_of(400, 0.02);
            for own in &mut sample.states {
                // of another motion, slow enough to be no noise
                own.efforts[1] += 8.0 + other * (1.7 * own.time).sin();
            }
            let plain = Reading::plain(3);
            let grams = Grams::of(&model, &sample, &plain, 1).unwrap();
            let now = grams.fit(&plain, &[]).unwrap();
            let change = search(&model, &sample, &grams, &now);
            change.is_some_and(|own| own.offsets[1] != 0.0)
        };
        assert!(found(0.0) && !found(30.0));
    }

    #[test]
    fn motion_some_time_later_is_interpolated_with_its_curvature() {
        let state = |k: u32| {
            let t = 0.1 * f64::from(k);
            Measured {
                time: t,
                motion: [vec![2.0 + t - 3.0 * t * t], vec![1.0 - 6.0 * t], vec![-6.0]],
                efforts: vec![],
                ..Measured::default()
            }
        };
        let states: Vec<Measured> = (0..50).map(state).collect();
        for by in [0.013, 0.04, -0.021, 0.13] {
            let t = 2.0;
            let expected = [by - 6.0 * t * by - 3.0 * by * by, -6.0 * by, 0.0];
            let found = later(&states, 20, 0, by);
            for (own, expected) in found.iter().zip(expected) {
                assert!((own - expected).abs() < 1e-9, "{by}: {found:?}");
            }
        }
        assert!(
            later(&states, 20, 0, 100.0)
                .iter()
                .all(|own| own.abs() <= 0.0)
        );
    }
}
