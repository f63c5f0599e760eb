//! Hypotheses on the columns of positions: with flipped signs, exchanged, in degrees, counts or
//! millimetres. Each takes a pass over some of the states.

use super::grams::{Fit, Grams, MAX_STEPS};
use super::unknowns::log_errors;
use super::{
    Change, MAX_EXPLAINED_ERROR, MAX_LEFT_OF_WORST, MAX_POSITION_STATES, MIN_DOUBTED_ERROR,
    MIN_GAIN_PER_COLUMN, Reading, Sample, UNEXPLAINED_ERROR, implausible_count, is_beside_noise,
    least_states, quality, worst,
};
use crate::states::{Completed, Completion};
use core::f64::consts::TAU;
use regen_runtime::{BaseModel, Motion};

/// Fits whose product of errors is within this factor of the best count as equally good.
const EQUIVALENT_RATIO: f64 = 1.05;
/// A change of positions is preferred to one of efforts only if its product of errors is smaller
/// by this factor.
const MIN_GAIN_OVER_EFFORTS: f64 = 1.5;
/// The largest number of positions of which all orders are tried at once; orders of more are found by exchanges.
const MAX_ORDERED: usize = 4;
/// The largest number of changes made one after the other.
const MAX_ROUNDS: usize = 2;
/// The smallest number of states for a hypothesis.
const MIN_STATES: usize = 40;

/// The least range of a joint's motion in another unit, rad and m: nobody identifies a robot that hardly moves,
/// whose weights are constants then.
const MIN_RANGE: f64 = 0.05;
const MIN_RANGE_OF_SLIDE: f64 = 2e-3;

/// Ratios of gears from which the search for single numbers does not always find the right one, and turns.
const RATIOS: [f64; 4] = [0.5, 2.0, 0.01, TAU];

/// The range of a joint's motion, rad, beyond which it may be in counts, and the bits of these in one turn.
const MAX_RANGE: f64 = 4.0 * TAU;
const COUNTS_OF_A_TURN: [u32; 15] = [9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23];

/// The number of hypotheses that are tried at all states.
const FINALISTS: usize = 6;

/// The number of states at which measured coordinates beyond need are compared.
const COMPARED_STATES: usize = 60;
/// The part of these at which the loops must close.
const MIN_COMPARED_PART: f64 = 0.8;
/// The largest deviation of a position, over its spread, that counts as agreement.
const MAX_DEVIATION: f64 = 0.05;

/// A position that contradicts the others, which are enough without it: it is `factor` times what they
/// say, plus `offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Contradiction {
    /// The index into the measured coordinates.
    pub(super) place: usize,
    pub(super) factor: f64,
    pub(super) offset: f64,
}

/// Finds the position that contradicts the others where more are measured than needed, by the loops
/// alone, whatever the efforts are. `None` if they agree, or if no factor and offset of a single one
/// makes them agree.
pub(super) fn contradiction<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
) -> Option<Contradiction> {
    let count = sample.measured.len();
    if count <= model.info().dof() {
        return None;
    }
    let all: Vec<usize> = (0..count).collect();
    if agreeing(model, sample, &all).is_some() {
        return None;
    }
    let mut best: Option<(f64, Contradiction)> = None;
    for place in 0..count {
        let rest: Vec<usize> = all.iter().copied().filter(|k| *k != place).collect();
        let Some(states) = agreeing(model, sample, &rest) else {
            continue;
        };
        let coordinate = sample.measured.get(place)?;
        let pairs: Vec<(f64, f64)> = states
            .iter()
            .filter_map(|(k, q)| {
                let said = q.get(*coordinate)?;
                Some((*said, *sample.states.get(*k)?.motion[0].get(place)?))
            })
            .collect();
        let n = pairs.len() as f64;
        let mean = |of: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / n;
        let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
        let (xx, yy) = (mean(&|p| (p.0 - x).powi(2)), mean(&|p| (p.1 - y).powi(2)));
        let factor = mean(&|p| (p.0 - x) * (p.1 - y)) / xx;
        let offset = y - factor * x;
        let left = (mean(&|p| (p.1 - offset - factor * p.0).powi(2)) / yy).sqrt();
        if left < best.map_or(MAX_DEVIATION, |best| best.0) {
            let found = Contradiction {
                place,
                factor,
                offset,
            };
            best = Some((left, found));
        }
    }
    best.map(|best| best.1)
}

/// The states at which the loops close, each with its index in the sample, if they close at most of
/// them and these measured coordinates agree there.
///
/// - `places`: indices into the measured coordinates of the sample.
fn agreeing<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    places: &[usize],
) -> Option<Vec<(usize, Vec<f64>)>> {
    let measured: Option<Vec<usize>> = places
        .iter()
        .map(|k| sample.measured.get(*k).copied())
        .collect();
    let measured = measured?;
    let ones = vec![1.0; measured.len()];
    let completion = Completion::new(model, &measured, &ones).ok()?;
    let mut completion = completion.limited(MAX_STEPS);
    let still = vec![0.0; measured.len()];
    let every = sample.states.len().div_ceil(COMPARED_STATES).max(1);
    let (mut tried, mut out) = (0_usize, Vec::new());
    // of each position: its sum, the sum of its squares, and that of the squared deviations
    let mut sums = vec![[0.0_f64; 3]; measured.len()];
    for (k, state) in sample.states.iter().enumerate().step_by(every) {
        tried += 1;
        let own: Option<Vec<f64>> = places
            .iter()
            .map(|p| state.motion[0].get(*p).copied())
            .collect();
        let own = own?;
        let Ok(Completed::State(full)) = completion.complete(&own, &still, &still) else {
            continue;
        };
        for ((sums, y), c) in sums.iter_mut().zip(&own).zip(&measured) {
            let off = y - full.q.get(*c)?;
            for (sum, more) in sums.iter_mut().zip([*y, y * y, off * off]) {
                *sum += more;
            }
        }
        out.push((k, full.q));
    }
    let n = out.len() as f64;
    let agree = sums.iter().all(|[sum, squares, off]| {
        let spread = squares / n - (sum / n).powi(2);
        off / n <= MAX_DEVIATION.powi(2) * spread
    });
    (n >= MIN_COMPARED_PART * tried as f64 && tried > 0 && agree).then_some(out)
}

/// A hypothesis on how positions and efforts are to be read.
struct Candidate {
    positions: Vec<Reading>,
    efforts: Vec<Reading>,
    /// The number of position columns that it changes.
    touched: usize,
}

/// The product of errors of a candidate, its count of implausible parameters and changed columns,
/// the candidate, and the errors of the equations.
type TriedCandidate = (f64, (usize, usize), Candidate, Vec<f64>);

/// Finds the best change of position columns; `None` if none is better than the change of efforts.
///
/// - `own`: a factor for each effort that belongs to its joint, such as a torque constant;
/// - `cannot_fit`: whether the log cannot be fitted with its columns as they are;
/// - `step`: called with the number of hypotheses tried and of all.
pub(super) fn search<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    own: &[f64],
    cannot_fit: bool,
    efforts: Option<&Change>,
    step: &mut dyn FnMut(usize, usize),
) -> Option<Change> {
    let info = model.info();
    let plain = Reading::plain(info.actuated.len());
    let mut positions = Reading::plain(sample.measured.len());
    let mut read = plain.clone();
    let all = candidates(model, sample, own, &positions, &read).len();
    let least = least_states(model);
    let states = (3 * sample.whole / all.max(1))
        .clamp(least.max(MIN_STATES), MAX_POSITION_STATES.max(least));
    let every = (sample.states.len() / states.max(1)).max(1);
    let few = (sample.states.len() / least.max(MIN_STATES)).max(1);
    let present = Grams::of(model, sample, &positions, every);
    let present = present.filter(Grams::closes);
    let start = present.as_ref().and_then(|g| g.fit(&plain, &[]));
    let start = start.filter(|_| !cannot_fit);
    // the change of efforts is fitted to the same states, with its offsets
    let rival = match (efforts, &present) {
        (Some(change), Some(grams)) => {
            let offsets = change.offsets.iter().enumerate();
            let offsets: Vec<usize> = offsets.filter(|o| *o.1 != 0.0).map(|o| o.0).collect();
            grams.fit(&change.efforts, &offsets)
        }
        _ => None,
    };
    let mut now = start.as_ref().map(|fit| quality(&fit.errors));
    let mut best_errors = None;
    for round in 0..MAX_ROUNDS {
        let mut fits: Vec<TriedCandidate> = Vec::new();
        let mut tried = candidates(model, sample, own, &positions, &read);
        let is_unexplained = |fit: &Fit| worst(&fit.errors) > UNEXPLAINED_ERROR;
        if round == 0 {
            tried.extend(as_rates(sample, &positions, &read));
        }
        if round == 0 && start.as_ref().is_some_and(is_unexplained) {
            tried.extend(ordered(model, sample, few, &positions, &read));
        }
        let mut count = 0;
        let tried = promising(model, sample, few, tried, &read, &mut || {
            count += 1;
            step(round * all + count, MAX_ROUNDS * all);
        });
        for candidate in tried {
            let Some(grams) = Grams::of_hypothesis(model, sample, &candidate.positions, every)
            else {
                continue;
            };
            if !grams.closes() {
                continue;
            }
            // the efforts' columns may change together with the positions', or not
            let mut ways = vec![(candidate.efforts.clone(), 0)];
            if candidate.efforts != read {
                ways.push((read.clone(), 0));
            }
            if read == plain {
                ways.extend(super::efforts::beside_positions(model, &grams, own));
            }
            for (efforts, more) in &ways {
                let Some(fit) = grams.fit(efforts, &[]) else {
                    continue;
                };
                let error = quality(&fit.errors);
                let fits_well = fit.errors.iter().all(|e| *e < 2.0 * UNEXPLAINED_ERROR);
                let touched = candidate.touched + more;
                let needed = MIN_GAIN_PER_COLUMN.powi(i32::try_from(touched).unwrap_or(i32::MAX));
                let explained = explained(model, sample, &positions, &candidate, &fit.errors);
                if now.is_none_or(|now| now >= needed * error)
                    && (now.is_some() && explained || fits_well)
                {
                    let weight = (implausible_count(model, &grams, &fit), touched);
                    let candidate = Candidate {
                        efforts: efforts.clone(),
                        positions: candidate.positions.clone(),
                        ..candidate
                    };
                    fits.push((error, weight, candidate, fit.errors));
                }
            }
        }
        let top = fits.iter().fold(f64::INFINITY, |m, f| m.min(f.0));
        let equivalent = fits.into_iter().filter(|f| f.0 <= top * EQUIVALENT_RATIO);
        let Some(best) =
            equivalent.reduce(|best, other| if other.1 < best.1 { other } else { best })
        else {
            break;
        };
        now = Some(best.0);
        positions = best.2.positions;
        read = best.2.efforts;
        let good = best.3.iter().all(|e| *e < UNEXPLAINED_ERROR);
        best_errors = Some(best.3);
        if good {
            break;
        }
    }
    let after = best_errors?;
    if let Some(start) = &start
        && worst(&after) > MAX_LEFT_OF_WORST * worst(&start.errors)
        && !is_beside_noise(&start.errors, &after)
    {
        return None;
    }
    // a constant explains a weight in a wrong unit as well, but is one unknown more
    let has_offsets = efforts.is_some_and(|change| change.offsets.iter().any(|o| *o != 0.0));
    let changed = |read: &[Reading]| {
        let plain = Reading::plain(read.len());
        read.iter().zip(&plain).filter(|(a, b)| a != b).count()
    };
    let is_as_simple =
        efforts.is_some_and(|change| changed(&positions) <= changed(&change.efforts));
    let needed = if has_offsets {
        1.0 / EQUIVALENT_RATIO
    } else if is_as_simple {
        EQUIVALENT_RATIO
    } else {
        MIN_GAIN_OVER_EFFORTS
    };
    if let Some(rival) = rival
        && quality(&rival.errors) < needed * quality(&after)
    {
        return None;
    }
    Some(Change {
        efforts: read,
        positions,
        before: start.map(|fit| fit.errors).unwrap_or_default(),
        after,
        ..Change::none(plain.len(), 0)
    })
}

/// A change of the signs of efforts with the signs of positions instead, of all or of one of them, if that explains
/// more: the motion of one joint alone does not tell one from the other.
pub(super) fn signs<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    efforts: &Change,
) -> Option<Change> {
    let info = model.info();
    let plain = Reading::plain(efforts.efforts.len());
    let pairs = efforts.efforts.iter().zip(&plain).enumerate();
    let turned = |(k, (own, plain)): (usize, (&Reading, &Reading))| -> Option<(usize, usize)> {
        let flipped = Reading {
            factor: -1.0,
            ..*plain
        };
        let place = sample
            .measured
            .iter()
            .position(|c| info.actuated.get(k) == Some(c));
        (*own == flipped).then_some((k, place?))
    };
    let turned: Vec<(usize, usize)> = pairs.filter_map(turned).collect();
    let are_signs = efforts
        .efforts
        .iter()
        .zip(&plain)
        .filter(|(a, b)| a != b)
        .count()
        == turned.len();
    if turned.is_empty() || !are_signs || worst(&efforts.after) < MIN_DOUBTED_ERROR {
        return None;
    }
    let every = (sample.states.len() / MAX_POSITION_STATES).max(1);
    let mut tried = vec![turned.clone()];
    if turned.len() > 1 {
        tried.extend(turned.iter().map(|own| vec![*own]));
    }
    let fit = |positions: &[Reading], read: &[Reading]| {
        let grams = Grams::of_hypothesis(model, sample, positions, every);
        grams.filter(Grams::closes)?.fit(read, &[])
    };
    let mut least = log_errors(&fit(
        &Reading::plain(sample.measured.len()),
        &efforts.efforts,
    )?);
    let mut best: Option<Change> = None;
    for places in tried {
        let mut positions = Reading::plain(sample.measured.len());
        let mut read = efforts.efforts.clone();
        for (effort, place) in places {
            positions[place].factor = -1.0;
            read[effort].factor = 1.0;
        }
        let Some(fit) = fit(&positions, &read) else {
            continue;
        };
        if log_errors(&fit) + libm::log(EQUIVALENT_RATIO) < least {
            least = log_errors(&fit);
            best = Some(Change {
                efforts: read,
                positions,
                after: fit.errors,
                ..efforts.clone()
            });
        }
    }
    best
}

/// The sign of one position, with that of its effort or without, that explains more than numbers do: positions of
/// another sign may be explained so well that nothing else doubts them.
pub(super) fn sign_for_numbers<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    numbers: &Change,
) -> Option<Change> {
    let plain = Reading::plain(numbers.efforts.len());
    if numbers.number_count() == 0
        || numbers.efforts != plain
        || worst(&numbers.after) < MIN_DOUBTED_ERROR
    {
        return None;
    }
    let every = (sample.states.len() / MAX_POSITION_STATES).max(1);
    let flipped = |list: &[Reading], k: usize| {
        let mut out = list.to_vec();
        out.iter_mut()
            .skip(k)
            .take(1)
            .for_each(|own| own.factor = -1.0);
        out
    };
    let one = |place: usize| -> Option<Change> {
        let positions = flipped(&Reading::plain(sample.measured.len()), place);
        let grams = Grams::of_hypothesis(model, sample, &positions, every)?;
        let grams = Some(grams).filter(Grams::closes)?;
        let coordinate = sample.measured.get(place)?;
        let effort = (model.info().actuated.iter()).position(|own| own == coordinate);
        let turned = effort.map(|k| flipped(&plain, k));
        let fits = [Some(plain.clone()), turned].into_iter().flatten();
        let fits = fits.filter_map(|efforts| Some((grams.fit(&efforts, &[])?.errors, efforts)));
        let (after, efforts) = fits.min_by(|a, b| quality(&a.0).total_cmp(&quality(&b.0)))?;
        Some(Change {
            efforts,
            positions,
            before: numbers.before.clone(),
            after,
            ..Change::none(plain.len(), 0)
        })
    };
    let best = (0..sample.measured.len()).filter_map(one);
    let best = best.min_by(|a, b| quality(&a.after).total_cmp(&quality(&b.after)))?;
    let is_better = MIN_GAIN_OVER_EFFORTS * quality(&best.after) < quality(&numbers.after);
    (is_better && !best.harms()).then_some(best)
}

/// The hypotheses with the smallest product of errors at a few states, in their order.
fn promising<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    every: usize,
    tried: Vec<Candidate>,
    read: &[Reading],
    step: &mut dyn FnMut(),
) -> Vec<Candidate> {
    let mut errors = Vec::with_capacity(tried.len());
    for candidate in &tried {
        step();
        errors.push(error_at(model, sample, every, candidate, read));
    }
    let mut sorted = errors.clone();
    sorted.sort_by(f64::total_cmp);
    let most = sorted.get(FINALISTS - 1).copied().unwrap_or(f64::INFINITY);
    let pairs = tried.into_iter().zip(errors);
    pairs
        .filter(|(_, error)| error.is_finite() && *error <= most)
        .map(|(candidate, _)| candidate)
        .collect()
}

/// The product of errors of a hypothesis, with its efforts or with these; infinite where it cannot be fitted.
fn error_at<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    every: usize,
    candidate: &Candidate,
    read: &[Reading],
) -> f64 {
    let grams = Grams::of_hypothesis(model, sample, &candidate.positions, every);
    let Some(grams) = grams.filter(Grams::closes) else {
        return f64::INFINITY;
    };
    let error = |efforts: &[Reading]| {
        let fit = grams.fit(efforts, &[]);
        fit.map_or(f64::INFINITY, |fit| quality(&fit.errors))
    };
    error(&candidate.efforts).min(error(read))
}

/// The order of many positions that exchanges of two, each of which explains more than the last, lead to; `None`
/// if that is an exchange of two itself.
fn ordered<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    every: usize,
    positions: &[Reading],
    efforts: &[Reading],
) -> Option<Candidate> {
    let count = sample.measured.len();
    if count <= MAX_ORDERED {
        return None;
    }
    let joints = model.info().joints;
    let kind = |k: usize| {
        sample
            .measured
            .get(k)
            .and_then(|c| joints.get(*c))
            .map(|j| j.motion)
    };
    let of = |positions: Vec<Reading>| Candidate {
        positions,
        efforts: efforts.to_vec(),
        touched: 0,
    };
    let mut now = of(positions.to_vec());
    let mut least = error_at(model, sample, every, &now, efforts);
    for _ in 1..count {
        let mut best = None;
        for k in 0..count {
            for l in (0..k).filter(|l| kind(*l) == kind(k)) {
                let mut swapped = of(now.positions.clone());
                swapped.positions.swap(k, l);
                let error = error_at(model, sample, every, &swapped, efforts);
                if error < least {
                    (least, best) = (error, Some(swapped));
                }
            }
        }
        let Some(best) = best else { break };
        now = best;
    }
    let pairs = now.positions.iter().zip(positions);
    now.touched = pairs.filter(|(a, b)| a != b).count();
    (now.touched > 2).then_some(now)
}

/// The order of positions with which velocities are read from their own columns, if they are not: they were given
/// others as they are the derivatives, which does not tell which of both are in the wrong order.
fn as_rates(sample: &Sample, positions: &[Reading], efforts: &[Reading]) -> Option<Candidate> {
    let own = |k: usize| sample.rates_of.iter().position(|from| *from == k);
    let order: Option<Vec<usize>> = (0..sample.rates_of.len()).map(own).collect();
    let order = order?;
    let read = order.iter().map(|from| positions.get(*from).copied());
    let read: Option<Vec<Reading>> = read.collect();
    let touched = order
        .iter()
        .enumerate()
        .filter(|(k, from)| k != *from)
        .count();
    (touched > 0).then_some(Candidate {
        positions: read?,
        efforts: efforts.to_vec(),
        touched,
    })
}

/// Whether the changed positions explain the efforts of their joints: a fit cannot decide between
/// two columns that explain next to nothing.
fn explained<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    before: &[Reading],
    candidate: &Candidate,
    errors: &[f64],
) -> bool {
    let info = model.info();
    let pairs = before.iter().zip(&candidate.positions);
    let mut changed = sample
        .measured
        .iter()
        .zip(pairs)
        .filter(|(_, (a, b))| a != b);
    changed.all(|(coordinate, _)| {
        let equation = info.independent.iter().position(|c| c == coordinate);
        let error = equation.and_then(|i| errors.get(i));
        error.is_none_or(|error| *error < MAX_EXPLAINED_ERROR)
    })
}

/// The least and the largest value of a measured coordinate.
pub(super) fn range(sample: &Sample, k: usize) -> (f64, f64) {
    let values = sample.states.iter().filter_map(|s| s.motion[0].get(k));
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
        (low.min(*x), high.max(*x))
    })
}

/// Whether a measured coordinate moves: another unit of one that does not is only another posture.
fn moves(sample: &Sample, k: usize) -> bool {
    let (low, high) = range(sample, k);
    // a filter leaves rounding errors
    high - low > 1e-9 * low.abs().max(high.abs())
}

/// Whether a measured coordinate is within its limits only with the other sign.
pub(super) fn is_mirrored<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    k: usize,
) -> bool {
    let joints = model.info().joints;
    let joint = sample.measured.get(k).and_then(|c| joints.get(*c));
    let Some([low, high]) = joint.and_then(|joint| joint.limits.position) else {
        return false;
    };
    let within = |sign: f64| {
        let values = sample.states.iter().filter_map(|s| s.motion[0].get(k));
        let inside = values.filter(|q| (low..=high).contains(&(sign * **q)));
        2 * inside.count() > sample.states.len()
    };
    !within(1.0) && within(-1.0)
}

/// The factors that make an angle of counts of an encoder, of as many as a power of two in one turn, where it is beyond
/// the angles of joints and is one of up to a turn with them.
fn counts_of(sample: &Sample, positions: &[Reading], k: usize) -> impl Iterator<Item = f64> {
    let (low, high) = range(sample, k);
    let read = positions.get(k).map_or(1.0, |own| own.factor.abs());
    let width = (high - low) * read;
    let factors = COUNTS_OF_A_TURN.map(|bits| TAU / f64::from(1_u32 << bits));
    let is_angle = move |factor: &f64| (MIN_RANGE..TAU).contains(&(width * factor));
    factors
        .into_iter()
        .filter(move |factor| width > MAX_RANGE && is_angle(factor))
}

/// All hypotheses on the units, the signs and the exchange of positions, starting from these
/// readings.
fn candidates<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    own: &[f64],
    positions: &[Reading],
    efforts: &[Reading],
) -> Vec<Candidate> {
    let info = model.info();
    let degree = core::f64::consts::PI / 180.0;
    let motion = |c: usize| info.joints.get(c).map_or(Motion::Rotation, |j| j.motion);
    let actuator = |c: usize| info.actuated.iter().position(|a| *a == c);
    let unit = |c: usize| {
        if motion(c) == Motion::Rotation {
            degree
        } else {
            1e-3
        }
    };
    let mut out = Vec::new();
    let plain = |positions: Vec<Reading>, touched: usize| Candidate {
        positions,
        efforts: efforts.to_vec(),
        touched,
    };
    let scaled = |which: &dyn Fn(usize) -> bool| -> Vec<Reading> {
        let pairs = sample.measured.iter().zip(positions);
        let one = |(c, r): (&usize, &Reading)| Reading {
            factor: if which(*c) {
                r.factor * unit(*c)
            } else {
                r.factor
            },
            ..*r
        };
        pairs.map(one).collect()
    };
    let least = |c: usize| {
        if motion(c) == Motion::Rotation {
            MIN_RANGE
        } else {
            MIN_RANGE_OF_SLIDE
        }
    };
    let moves_in_unit = |k: usize, c: usize| {
        let (low, high) = range(sample, k);
        let read = positions.get(k).map_or(1.0, |own| own.factor.abs());
        (high - low) * read * unit(c) > least(c)
    };
    for kind in [Motion::Rotation, Motion::Translation] {
        let mut own = sample.measured.iter().enumerate();
        if own.any(|(k, c)| motion(*c) == kind && moves_in_unit(k, *c)) {
            out.push(plain(scaled(&|c| motion(c) == kind), 1));
        }
    }
    if (3..=MAX_ORDERED).contains(&sample.measured.len()) {
        for order in super::efforts::permutations(sample.measured.len()) {
            let moved = order
                .iter()
                .enumerate()
                .filter(|(k, from)| k != *from)
                .count();
            // exchanges of two are below
            if moved > 2 {
                let mut ordered = plain(positions.to_vec(), moved);
                for (k, from) in order.iter().enumerate() {
                    ordered.positions[k] = positions[*from];
                }
                out.push(ordered);
            }
        }
    }
    for (k, span) in &sample.wrapped {
        for spans in [-2.0, -1.0, 1.0, 2.0] {
            let mut shifted = plain(positions.to_vec(), 1);
            if let Some(own) = shifted.positions.iter_mut().find(|own| own.from == *k) {
                own.offset += spans * span * own.factor;
                out.push(shifted);
            }
        }
    }
    let mirrored: Vec<usize> = (0..sample.measured.len())
        .filter(|k| is_mirrored(model, sample, *k))
        .collect();
    if mirrored.len() > 1 {
        let mut flipped = plain(positions.to_vec(), mirrored.len());
        for k in mirrored {
            flipped.positions[k].factor *= -1.0;
            if let Some(a) = actuator(sample.measured[k]) {
                flipped.efforts[a].factor *= -1.0;
            }
        }
        out.push(flipped);
    }
    for (k, c) in sample
        .measured
        .iter()
        .enumerate()
        .filter(|(k, _)| moves(sample, *k))
    {
        if sample.measured.len() > 1 && moves_in_unit(k, *c) {
            out.push(plain(scaled(&|other| other == *c), 1));
        }
        for ratio in RATIOS {
            let mut geared = plain(positions.to_vec(), 1);
            geared.positions[k].factor *= ratio;
            out.push(geared);
        }
        for counts in counts_of(sample, positions, k).filter(|_| motion(*c) == Motion::Rotation) {
            let mut counted = plain(positions.to_vec(), 1);
            counted.positions[k].factor *= counts;
            out.push(counted);
        }
        let mut flipped = plain(positions.to_vec(), 1);
        flipped.positions[k].factor *= -1.0;
        if let Some(a) = actuator(*c) {
            flipped.efforts[a].factor *= -1.0;
        }
        out.push(flipped);
        for (l, other) in sample.measured[..k].iter().enumerate() {
            if motion(*c) != motion(*other) {
                continue;
            }
            let mut swapped = plain(positions.to_vec(), 2);
            swapped.positions.swap(k, l);
            if let (Some(a), Some(b)) = (actuator(*c), actuator(*other)) {
                swapped.efforts.swap(a, b);
                if let (Some(x), Some(y)) = (own.get(a), own.get(b)) {
                    swapped.efforts[a].factor *= x / y;
                    swapped.efforts[b].factor *= y / x;
                }
            }
            out.push(swapped);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::swings_for_tests::{sample, scale, swings, with};
    use super::*;

    #[test]
    fn the_sign_of_a_position_is_found_where_it_explains_more_than_a_number() {
        let model = swings(false);
        let constant_leaves = |left: f64| {
            let mut out = Change::none(3, 3);
            out.offsets[0] = 1.0;
            (out.before, out.after) = (vec![2.0 * left, 0.01, 0.01], vec![left, 0.01, 0.01]);
            out
        };
        let sign = |sample: &Sample, numbers: &Change| -> Option<Vec<f64>> {
            let found = sign_for_numbers(&model, sample, numbers)?;
            assert_eq!(found.efforts, Reading::plain(3));
            Some(found.positions.iter().map(|own| own.factor).collect())
        };
        let flipped = with(|s| scale(s, 0, -1.0));
        let constant = constant_leaves(0.04);
        assert_eq!(sign(&flipped, &constant), Some(vec![-1.0, 1.0, 1.0]));
        assert_eq!(sign(&with(|s| s.efforts[0] += 2.0), &constant), None);
        // what a constant explains needs no other reason
        assert_eq!(sign(&flipped, &constant_leaves(0.02)), None);
        let mut another = constant;
        another.efforts[1].factor = -1.0;
        assert_eq!(sign(&flipped, &another), None);
    }

    #[test]
    fn hypotheses_on_positions_take_the_efforts_of_their_joints_with_them() {
        let (model, own) = (swings(true), [2.0, 5.0, 0.7]);
        let plain = Reading::plain(3);
        // a motion that would be none in another unit is not tried in it
        let small = candidates(&model, &sample(), &own, &plain, &plain);
        let wide = with(|s| s.motion[0].iter_mut().for_each(|q| *q *= 5.0));
        let mut all = candidates(&model, &wide, &own, &plain, &plain);
        assert!(small.len() < all.len());
        let count = all.len();
        let is_ratio = |own: &Reading| RATIOS.contains(&own.factor);
        all.retain(|own| !own.positions.iter().any(is_ratio));
        assert_eq!(count - all.len(), 3 * RATIOS.len());
        let degree = core::f64::consts::PI / 180.0;
        let (mut scaled, mut turned, mut exchanged) = (Vec::new(), 0, 0);
        for candidate in &all {
            let changed = (0..3).filter(|k| candidate.positions[*k] != plain[*k]);
            let changed: Vec<usize> = changed.collect();
            let kinds = changed.iter().filter(|k| **k == 2).count();
            for k in &changed {
                let (position, effort) = (candidate.positions[*k], candidate.efforts[*k]);
                if position.from != *k && effort.from != *k {
                    exchanged += 1;
                    assert_eq!(position.from, effort.from);
                    assert!((effort.factor - own[*k] / own[effort.from]).abs() < 1e-12);
                } else if position.factor < 0.0 {
                    turned += 1;
                    assert!((position.factor + 1.0).abs() + (effort.factor + 1.0).abs() < 1e-12);
                } else if position.from == *k {
                    let unit = if *k == 2 { 1e-3 } else { degree };
                    assert!((position.factor / unit - 1.0).abs() < 1e-12);
                    assert!(kinds == 0 || kinds == changed.len());
                    assert_eq!(effort, plain[*k]);
                }
            }
            if changed
                .iter()
                .all(|k| (0.0..1.0).contains(&candidate.positions[*k].factor))
            {
                scaled.push(changed);
            }
        }
        // both rotations, the slide, and each alone
        assert_eq!(scaled, [vec![0, 1], vec![2], vec![0], vec![1], vec![2]]);
        assert_eq!((turned, exchanged), (3, 2));
    }

    #[test]
    fn the_zero_of_a_wrapped_position_may_be_off_by_multiples_of_its_span() {
        let (model, plain) = (swings(true), Reading::plain(3));
        let log = Sample {
            wrapped: vec![(1, 0.3)],
            ..sample()
        };
        let all = candidates(&model, &log, &[1.0; 3], &plain, &plain);
        let offsets = all.iter().map(|own| own.positions[1].offset);
        let offsets: Vec<f64> = offsets.filter(|own| *own != 0.0).collect();
        assert_eq!(offsets, [-0.6, -0.3, 0.3, 0.6]);
    }

    #[test]
    fn a_position_beyond_the_angles_of_joints_may_be_in_counts_of_as_many_as_a_power_of_two() {
        let (model, plain) = (swings(true), Reading::plain(3));
        let counted = |by: f64| -> Vec<f64> {
            let log = with(|s| s.motion[0][1] *= by);
            let all = candidates(&model, &log, &[1.0; 3], &plain, &plain);
            let changed = all.iter().filter(|own| own.positions[0] == plain[0]);
            let factors = changed.map(|own| own.positions[1].factor);
            let degree = core::f64::consts::PI / 180.0;
            let is_counts = |own: &f64| {
                (0.0..0.4).contains(own)
                    && (own / degree - 1.0).abs() > 0.1
                    && !RATIOS.contains(own)
            };
            factors.filter(is_counts).collect()
        };
        assert_eq!(counted(1.0), [0.0; 0]);
        let found = counted(4096.0 / TAU);
        assert!(
            found.contains(&(TAU / 4096.0)) && found.len() < 9,
            "{found:?}"
        );
    }

    #[test]
    fn a_position_is_mirrored_if_most_rows_are_within_limits_only_with_the_other_sign() {
        let mut model = swings(false);
        model.joints[0].limits.position = Some([0.5, 3.0]);
        let is = |q: fn(f64) -> f64| {
            let moved = with(|s| s.motion[0][0] = q(s.time / 8.0));
            is_mirrored(&model, &moved, 0)
        };
        assert!(is(|part| -1.0 - part) && !is(|part| 1.0 + part));
        // a few rows beyond, which may be noise
        assert!(is(|part| if part < 0.3 { 0.0 } else { -1.0 }));
        assert!(!is(|part| if part < 0.7 { 0.0 } else { -1.0 }));
        assert!(!is_mirrored(&model, &sample(), 1));
    }

    #[test]
    fn positions_that_are_all_mirrored_are_turned_together_with_their_efforts() {
        let mut model = swings(false);
        for joint in model.joints.iter_mut().take(2) {
            joint.limits.position = Some([0.5, 3.0]);
        }
        let moved = with(|s| {
            let q = -1.0 - (2.0 * s.time).sin().powi(2);
            s.motion[0][..2].fill(q);
        });
        let plain = Reading::plain(3);
        let all = candidates(&model, &moved, &[1.0; 3], &plain, &plain);
        let factors =
            |read: &[Reading]| -> Vec<f64> { read.iter().map(|own| own.factor).collect() };
        let together = all
            .iter()
            .filter(|own| own.touched == 2 && own.positions[0].from == 0);
        let together: Vec<_> = together
            .map(|own| (factors(&own.positions), factors(&own.efforts)))
            .collect();
        let turned = vec![-1.0, -1.0, 1.0];
        assert_eq!(together, [(turned.clone(), turned)]);
    }
}
