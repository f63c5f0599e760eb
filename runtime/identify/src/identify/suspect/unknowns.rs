//! Hypotheses on single numbers that the equations determine: a constant in an effort, the zero of a
//! position, the rate of the rows, how late a position is. Those that explain the errors together are
//! found by Gauss and Newton.

use super::grams::{Fit, Grams, Stored, solve};
use super::trial::{MAX_CORRELATION_OF_NOISE, correlation};
use super::{
    Change, DOUBTED_ERROR, MIN_GAIN_PER_COLUMN, MIN_OFFSET_PART, Measured, Reading, Sample,
    implausible_count, worst,
};
use regen_runtime::BaseModel;

/// Relative errors below this are normal if what is left is noise.
const MIN_DOUBTED_ERROR: f64 = 0.03;
/// The number of states at which the effect of an unknown is computed, unless the parameters need more.
const STATES: usize = 120;
/// The step by which that is differentiated, rad, m or s.
const STEP: f64 = 1e-4;
/// The largest number of steps of Gauss and Newton.
const MAX_STEPS: usize = 8;
/// The largest change of a number in one of them, rad, m or s.
const MAX_CHANGE: f64 = 0.3;
/// The part of a number below which a step of it no longer matters.
const SETTLED: f64 = 1e-3;
/// The largest number of unknowns that are computed to the end for each that is added, the part of what the first
/// of them explains that they do, too, and the number of those that are added.
const TRIED: usize = 4;
const NEARLY: f64 = 0.8;
const MOST: usize = 3;
/// The deviations by which chance would have to explain the errors as well as an unknown does.
const MIN_DEVIATIONS: f64 = 6.0;
/// The factor by which an unknown must reduce the product of errors.
const MIN_GAIN: f64 = 1.1;
/// The same, where it changes the motion.
const MIN_GAIN_OF_MOTION: f64 = 1.5;
/// The smallest relative error that is compared.
const LEAST_ERROR: f64 = 1e-3;
/// The largest delay of a position, s; the smallest is a step of the log.
const MAX_LATE: f64 = 0.5;
/// The factors by which a rate is looked for: a clock is more exact, and more is another unit.
const RATES: core::ops::Range<f64> = 1.05..10.0;
/// Rates of rows are round: one of these times a power of ten, if it is nearer than this part.
const ROUND: [f64; 9] = [1.0, 1.2, 1.25, 2.0, 2.5, 3.0, 4.0, 5.0, 8.0];
const MAX_OFF_ROUND: f64 = 0.01;

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
}

/// Numbers that were tried.
struct Tried {
    values: Vec<(Unknown, f64)>,
    /// The states, read with them.
    states: Sample,
    grams: Grams,
    fit: Fit,
}

/// Finds the numbers that explain the errors, if that is no chance.
pub(super) fn search<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    grams: &Grams,
    now: &Fit,
) -> Option<Change> {
    let is_noise = correlation(sample, grams, now) < MAX_CORRELATION_OF_NOISE;
    if worst(&now.errors) < MIN_DOUBTED_ERROR && is_noise {
        return None;
    }
    let dof = model.info().dof().max(1);
    let least = (super::MIN_EQUATIONS_PER_PARAMETER * grams.columns()).div_ceil(dof);
    let every = sample.states.len().div_ceil(STATES.max(least)).max(1);
    let mut found = Tried::of(model, sample, every, Vec::new())?;
    for _ in 0..MOST {
        let Some(next) = found.with_one_more(model, sample, every) else {
            break;
        };
        found = next;
    }
    if found.values.is_empty() {
        return None;
    }
    // few states leave some noise in the numbers
    let all = sample
        .states
        .len()
        .div_ceil(grams.stored.len().max(1))
        .max(1);
    let found = Tried::of(model, sample, all, found.values)?;
    let found = found.stepped(model, sample, all).unwrap_or(found);
    let found = found.rounded(model, sample, all);
    let of_motion = |own: &(Unknown, f64)| !matches!(own.0, Unknown::Effort(_));
    let is_explained = !found.values.iter().any(of_motion) || found.explains(now);
    let count = found.values.len() as f64;
    let is_certain = found.likelihood_gain(now) > count * MIN_DEVIATIONS * MIN_DEVIATIONS;
    let gain = gain_over(now, &found.fit);
    let plausible =
        implausible_count(model, &found.grams, &found.fit) <= implausible_count(model, grams, now);
    (is_certain && plausible && is_explained && gain >= MIN_GAIN.powf(count))
        .then(|| found.change(model, sample, now))
}

/// The sum of the logarithms of the errors.
fn log_errors(fit: &Fit) -> f64 {
    fit.errors.iter().map(|e| e.max(LEAST_ERROR).ln()).sum()
}

/// The factor by which the product of the errors is smaller.
fn gain_over(before: &Fit, after: &Fit) -> f64 {
    (log_errors(before) - log_errors(after)).exp()
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
        for (unknown, value) in by {
            match unknown {
                Unknown::Effort(k) => own
                    .efforts
                    .iter_mut()
                    .skip(*k)
                    .take(1)
                    .for_each(|u| *u -= value),
                Unknown::Position(k) => {
                    own.motion[0]
                        .iter_mut()
                        .skip(*k)
                        .take(1)
                        .for_each(|q| *q += value);
                }
                Unknown::Rate => {
                    own.motion[1].iter_mut().for_each(|v| *v /= value.exp());
                    own.motion[2]
                        .iter_mut()
                        .for_each(|a| *a /= (2.0 * value).exp());
                }
                Unknown::Late(k) => {
                    for (d, x) in later(&sample.states, place, *k, *value)
                        .into_iter()
                        .enumerate()
                    {
                        own.motion[d]
                            .iter_mut()
                            .skip(*k)
                            .take(1)
                            .for_each(|own| *own += x);
                    }
                }
            }
        }
        states.push(own);
    }
    Sample {
        measured: sample.measured.clone(),
        unmeasured: sample.unmeasured.clone(),
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
    /// A fit with these numbers; `None` if the loops do not close.
    fn of<M: BaseModel<f64> + ?Sized>(
        model: &M,
        sample: &Sample,
        every: usize,
        values: Vec<(Unknown, f64)>,
    ) -> Option<Self> {
        let (states, grams) = sums(model, sample, every, &values)?;
        let fit = grams.fit(&Reading::plain(model.info().actuated.len()), &[])?;
        Some(Self {
            values,
            states,
            grams,
            fit,
        })
    }

    fn correlation(&self) -> f64 {
        correlation(&self.states, &self.grams, &self.fit)
    }

    /// Twice the logarithm of how much more likely the efforts are than after another fit, where neighbouring
    /// states count as far as they are independent.
    fn likelihood_gain(&self, before: &Fit) -> f64 {
        let own = self.correlation().min(0.99);
        let states = self.grams.stored.len() as f64 * (1.0 - own) / (1.0 + own);
        2.0 * states * (log_errors(before) - log_errors(&self.fit))
    }

    /// Whether each effort that is explained better than before is explained: a motion that is read in another
    /// way can explain a little of what has another cause.
    fn explains(&self, before: &Fit) -> bool {
        let gain = gain_over(before, &self.fit);
        let mut pairs = self.fit.errors.iter().zip(&before.errors);
        gain >= MIN_GAIN_OF_MOTION
            && pairs.all(|(after, before)| {
                *after < DOUBTED_ERROR
                    || *before < MIN_GAIN * after
                    || *before > MIN_GAIN_PER_COLUMN * after
            })
    }

    fn weights(&self) -> Vec<f64> {
        let pairs = self.fit.errors.iter().zip(&self.fit.spreads);
        pairs
            .map(|(error, spread)| 1.0 / (error * spread).max(f64::MIN_POSITIVE))
            .collect()
    }

    /// The weighted residuals and their change with a number, without what the parameters make good.
    fn slope<M: BaseModel<f64> + ?Sized>(
        &self,
        model: &M,
        sample: &Sample,
        every: usize,
        unknown: Unknown,
    ) -> Option<Vec<f64>> {
        let weights = self.weights();
        let rows = self.grams.rows();
        let mut slopes = Vec::with_capacity(self.grams.stored.len() * rows);
        if let Unknown::Effort(k) = unknown {
            for own in &self.grams.stored {
                slopes.extend((0..rows).zip(&weights).map(|(i, weight)| {
                    -weight * own.transfer.get(k * rows + i).copied().unwrap_or(0.0)
                }));
            }
        } else {
            let mut values = self.values.clone();
            match values.iter_mut().find(|own| own.0 == unknown) {
                Some(own) => own.1 += STEP,
                None => values.push((unknown, STEP)),
            }
            let (_, ahead) = sums(model, sample, every, &values)?;
            for own in &self.grams.stored {
                // a state that does not close with the step says nothing
                let other = ahead.stored.binary_search_by_key(&own.state, |o| o.state);
                let other = other
                    .ok()
                    .and_then(|place| ahead.stored.get(place))
                    .unwrap_or(own);
                slopes.extend(weights.iter().enumerate().map(|(i, weight)| {
                    let change =
                        other.residual(i, &self.fit.values) - own.residual(i, &self.fit.values);
                    weight * change / STEP
                }));
            }
        }
        let stored: Vec<&Stored> = self.grams.stored.iter().collect();
        let free = self.grams.without_parameters(&stored, &weights, &slopes)?;
        // a number that the parameters make good, as the zero of a first joint about gravity, has no slope
        (dot(&free, &free) > 1e-12 * dot(&slopes, &slopes) && dot(&free, &free) > 0.0)
            .then_some(free)
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

    /// These numbers after a step of Gauss and Newton; `None` if it explains no more.
    fn stepped<M: BaseModel<f64> + ?Sized>(
        &self,
        model: &M,
        sample: &Sample,
        every: usize,
    ) -> Option<Self> {
        let slopes: Option<Vec<Vec<f64>>> = self
            .values
            .iter()
            .map(|own| self.slope(model, sample, every, own.0))
            .collect();
        let slopes = slopes?;
        let n = slopes.len();
        let mut gram = vec![0.0; n * n];
        for (a, x) in slopes.iter().enumerate() {
            for (b, y) in slopes[..=a].iter().enumerate() {
                gram[a * n + b] = dot(x, y);
            }
        }
        let residuals = self.residuals();
        let right: Vec<f64> = slopes.iter().map(|slope| -dot(slope, &residuals)).collect();
        let steps = solve(&mut gram, &right)?;
        let mut part = 1.0;
        for _ in 0..4 {
            let mut values = self.values.clone();
            for (own, step) in values.iter_mut().zip(&steps) {
                let step = part * step;
                own.1 += match own.0 {
                    Unknown::Effort(_) => step,
                    Unknown::Late(_) => step.clamp(-0.3 * MAX_CHANGE, 0.3 * MAX_CHANGE),
                    _ => step.clamp(-MAX_CHANGE, MAX_CHANGE),
                };
            }
            if let Some(next) = Self::of(model, sample, every, values)
                && next.grams.closes()
                && log_errors(&next.fit) < log_errors(&self.fit)
            {
                return Some(next);
            }
            part *= 0.3;
        }
        None
    }

    /// These numbers and the one more that explains most, if that is no chance.
    fn with_one_more<M: BaseModel<f64> + ?Sized>(
        &self,
        model: &M,
        sample: &Sample,
        every: usize,
    ) -> Option<Self> {
        let residuals = self.residuals();
        let whole = dot(&residuals, &residuals);
        let mut first: Vec<(f64, Unknown)> = Vec::new();
        for unknown in unknowns(model, sample) {
            let is_known = self.values.iter().any(|own| own.0 == unknown);
            if let (false, Some(slope)) = (is_known, self.slope(model, sample, every, unknown)) {
                let along = dot(&slope, &residuals);
                first.push((along * along / (dot(&slope, &slope) * whole), unknown));
            }
        }
        first.sort_by(|a, b| b.0.total_cmp(&a.0));
        let most = first.first()?.0;
        first.retain(|(part, _)| *part >= NEARLY * most);
        let mut best: Option<Self> = None;
        for (_, unknown) in first.into_iter().take(TRIED) {
            let mut values = self.values.clone();
            values.push((unknown, 0.0));
            let mut own = Self::of(model, sample, every, values)?;
            for _ in 0..MAX_STEPS {
                let Some(next) = own.stepped(model, sample, every) else {
                    break;
                };
                let mut pairs = next.values.iter().zip(&own.values);
                let is_settled = pairs.all(|(a, b)| (a.1 - b.1).abs() < SETTLED * a.1.abs());
                own = next;
                if is_settled {
                    break;
                }
            }
            if best
                .as_ref()
                .is_none_or(|best| log_errors(&own.fit) < log_errors(&best.fit))
            {
                best = Some(own);
            }
        }
        let best = best?;
        let (unknown, value) = *best.values.last()?;
        let matters = match unknown {
            Unknown::Effort(k) => {
                let squares = sample
                    .states
                    .iter()
                    .filter_map(|s| s.efforts.get(k))
                    .map(|u| u * u);
                let rms = (squares.sum::<f64>() / sample.states.len() as f64).sqrt();
                value.abs() > MIN_OFFSET_PART * rms
            }
            Unknown::Late(_) => value > sample.step && value < MAX_LATE,
            Unknown::Rate => RATES.contains(&value.abs().exp()),
            Unknown::Position(_) => true,
        };
        let less = gain_over(&self.fit, &best.fit) > MIN_GAIN;
        (matters && less).then_some(best)
    }

    /// A rate that is nearly round is round.
    fn rounded<M: BaseModel<f64> + ?Sized>(self, model: &M, sample: &Sample, every: usize) -> Self {
        let mut values = self.values.clone();
        for own in values.iter_mut().filter(|own| own.0 == Unknown::Rate) {
            let rate = 1.0 / (sample.step * own.1.exp());
            let ten = 10.0_f64.powf(rate.log10().floor());
            let near = ROUND.iter().chain(&[10.0]).map(|round| round * ten);
            let near = near.min_by(|a, b| (a / rate).ln().abs().total_cmp(&(b / rate).ln().abs()));
            if let Some(near) = near.filter(|near| (near / rate).ln().abs() < MAX_OFF_ROUND) {
                own.1 = -(near * sample.step).ln();
            }
        }
        if values == self.values {
            return self;
        }
        Self::of(model, sample, every, values).unwrap_or(self)
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
                Unknown::Rate => out.times = value.exp(),
                Unknown::Late(k) => out.late.push((*k, *value)),
            }
        }
        out.before.clone_from(&now.errors);
        out.after.clone_from(&self.fit.errors);
        out
    }
}

fn sums<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    every: usize,
    values: &[(Unknown, f64)],
) -> Option<(Sample, Grams)> {
    let own = moved(sample, every, values);
    let grams = Grams::of(model, &own, &Reading::plain(own.measured.len()), 1)?;
    Some((own, grams))
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}
