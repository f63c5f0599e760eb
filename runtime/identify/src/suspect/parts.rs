//! Logs of two parts: one after the other, as of a payload that was picked up, or of two runs in one file, each of
//! which is explained by other parameters; or the states in which an effort is cut off, and all others.

use super::grams::{Fit, Grams, Stored, solve};
use super::{DOUBTED_ERROR, MIN_DOUBTED_ERROR, Sample, quality, worst};

/// The number of places between which a log may be divided.
const BLOCKS: usize = 16;
/// The least number of states of a part for each parameter.
const MIN_STATES_PER_PARAMETER: usize = 2;
/// The factor by which an error must be smaller in parts: a burst in one of them is no other robot.
const MIN_GAIN_OF_ONE: f64 = 4.0;
/// The same, without the states in which an effort is cut off.
const MIN_GAIN_WITHOUT: f64 = 2.0;
/// The same of the product of errors.
const MIN_GAIN: f64 = 4.0;
/// The largest error that may be left, as of an effort that is noise, and the factor by which one may grow.
const MAX_LEFT: f64 = 1.02;
const MAX_LOSS: f64 = 1.02;
/// An effort within this part of its range from its extreme may be cut off there.
const NEAR_EXTREME: f64 = 0.04;
/// The parts of the states in which an effort may be: fewer are a burst, and more are all.
const CUT_OFF_PARTS: core::ops::Range<f64> = 0.01..0.5;
/// The least part of these in which the model needs more, and how much more at least, in what is left elsewhere.
const MIN_BEYOND: f64 = 0.8;
const MIN_MORE: f64 = 3.0;

/// A log of two parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Parts {
    /// The time at which the second one begins, up to a sixteenth of the log, s.
    pub time: f64,
    /// The errors of the equations with parameters of each part, as in [`Change::after`](super::Change::after).
    pub after: Vec<f64>,
}

/// An effort that is cut off, with noise besides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutOff {
    /// The effort: an index into `Info::actuated`.
    pub effort: usize,
    /// The mean size of the values at which it is, N or N m.
    pub at: f64,
    /// The part of the states in which it is.
    pub part: f64,
    /// The size of the largest effort that the model needs in these, N or N m.
    pub needed: f64,
}

/// Sums over the states of a block, for each equation: the products of the regressor's columns and of the effort,
/// which comes last.
type Sums = Vec<Vec<f64>>;

/// Finds the place at which a log is of two parts; `None` where two sets of parameters explain little more than one.
pub(super) fn search(sample: &Sample, grams: &Grams, now: &Fit) -> Option<Parts> {
    let columns = grams.columns();
    let least = (MIN_STATES_PER_PARAMETER * columns).div_ceil(grams.rows().max(1));
    let states = grams.stored.len();
    if worst(&now.errors) < MIN_DOUBTED_ERROR || states < 2 * least.max(BLOCKS) {
        return None;
    }
    let length = states.div_ceil(BLOCKS);
    let blocks: Vec<Sums> = grams
        .stored
        .chunks(length)
        .map(|block| sums(block, grams, &|_, _| true))
        .collect();
    let weights = weights(now);
    let mut best: Option<(usize, Vec<f64>)> = None;
    for at in 1..blocks.len() {
        let place = at * length;
        if place < least || states - place < least {
            continue;
        }
        let (first, second) = blocks.split_at(at);
        let (Some(first), Some(second)) = (
            squares(first, &weights, columns),
            squares(second, &weights, columns),
        ) else {
            continue;
        };
        let pairs = first.iter().zip(&second).zip(&now.spreads);
        let errors: Vec<f64> = pairs
            .map(|((a, b), spread)| ((a + b) / states as f64).sqrt() / spread)
            .collect();
        let is_less = |best: &(usize, Vec<f64>)| quality(&errors) < quality(&best.1);
        if best.as_ref().is_none_or(is_less) {
            best = Some((place, errors));
        }
    }
    let (place, after) = best?;
    let gain = quality(&now.errors) / quality(&after);
    // noise of weak efforts, such as those of a wrist, is what no parameters explain
    let mut pairs = now.errors.iter().zip(&after);
    let is_halved =
        pairs.any(|(before, after)| *before > DOUBTED_ERROR && *before > MIN_GAIN_OF_ONE * after);
    // what is wrong with some efforts is not what makes two parts
    let mut pairs = now.errors.iter().zip(&after);
    let is_worse = pairs
        .any(|(before, after)| *after > MAX_LEFT.min(MAX_LOSS * before.max(MIN_DOUBTED_ERROR)));
    if gain < MIN_GAIN || !is_halved || is_worse {
        return None;
    }
    let state = grams.stored.get(place)?.state;
    Some(Parts {
        time: sample.states.get(state)?.time,
        after,
    })
}

/// Finds the efforts that are cut off: without the states in which one is near its largest or smallest value, it is
/// explained far better, and in these the model needs more.
pub(super) fn cut_off(sample: &Sample, grams: &Grams, now: &Fit) -> Vec<CutOff> {
    let columns = grams.columns();
    let weights = weights(now);
    let one = |(i, sides): (usize, [bool; 2])| -> Option<CutOff> {
        let effort = grams.only_effort(i)?;
        let value = |own: &Stored| sample.states.get(own.state)?.efforts.get(effort).copied();
        let values: Vec<f64> = grams.stored.iter().filter_map(value).collect();
        let most = values.iter().fold(f64::NEG_INFINITY, |m, u| m.max(*u));
        let least = values.iter().fold(f64::INFINITY, |m, u| m.min(*u));
        let near = NEAR_EXTREME * (most - least);
        // the direction in which an effort is cut off in a state; 0 where it is not
        let side = |own: &Stored| match value(own) {
            Some(u) if sides[1] && u >= most - near => 1.0,
            Some(u) if sides[0] && u <= least + near => -1.0,
            _ => 0.0,
        };
        let states = grams.stored.len() as f64;
        let at: Vec<&Stored> = (grams.stored.iter())
            .filter(|own| side(own) != 0.0)
            .collect();
        let count = at.len().max(1) as f64;
        let part = at.len() as f64 / states;
        let error = now.errors.get(i)? * now.spreads.get(i)?;
        if *now.errors.get(i)? < MIN_DOUBTED_ERROR || !CUT_OFF_PARTS.contains(&part) {
            return None;
        }
        let rest = sums(&grams.stored, grams, &|k, own| k != i || side(own) == 0.0);
        let values = parameters(&rest, &weights, columns)?;
        let left = *squares_of(&rest, &values).get(i)? / (states - at.len() as f64);
        let usual = left.sqrt();
        // how much more the model needs in these states than there is
        let more: Vec<f64> = (at.iter())
            .map(|own| {
                let transfer = own.transfer.get(effort * grams.rows() + i);
                let turn = transfer.map_or(1.0, |own| own.signum());
                -turn * side(own) * own.residual(i, &values)
            })
            .collect();
        let beyond = more.iter().filter(|x| **x > 0.0).count() as f64;
        let mean = more.iter().sum::<f64>() / count;
        let is_cut = usual * MIN_GAIN_WITHOUT < error
            && beyond > MIN_BEYOND * count
            && mean > MIN_MORE * usual;
        let size = |own: &&Stored| value(own).map_or(0.0, f64::abs);
        let at = at.iter().map(size).sum::<f64>() / count;
        let largest = more.iter().fold(0.0, |m: f64, x| m.max(*x));
        is_cut.then_some(CutOff {
            effort,
            at,
            part,
            needed: at + largest,
        })
    };
    let of_sides = |i: usize| {
        let all = [[true, true], [false, true], [true, false]];
        all.into_iter().find_map(|sides| one((i, sides)))
    };
    (0..grams.rows()).filter_map(of_sides).collect()
}

/// The weights of the equations: over the squares of their residuals.
fn weights(now: &Fit) -> Vec<f64> {
    let squares = now.errors.iter().zip(&now.spreads);
    let weight = squares.map(|(error, spread)| (error * spread).powi(-2));
    weight
        .map(|own| if own.is_finite() { own } else { 0.0 })
        .collect()
}

/// The sums over these states, of the equations that are used.
fn sums(block: &[Stored], grams: &Grams, is_used: &dyn Fn(usize, &Stored) -> bool) -> Sums {
    let size = grams.columns() + 1;
    let mut sums = vec![vec![0.0; size * size]; grams.rows()];
    for own in block {
        for (i, (sum, tau)) in sums.iter_mut().zip(&own.tau).enumerate() {
            if !is_used(i, own) {
                continue;
            }
            let row = own.w.iter().skip(i).step_by(grams.rows().max(1));
            let row: Vec<f64> = row.copied().chain([*tau]).collect();
            for (a, x) in row.iter().enumerate() {
                for (b, y) in row[..=a].iter().enumerate() {
                    sum[a * size + b] += x * y;
                }
            }
        }
    }
    sums
}

/// The squared residuals of each equation over some blocks, with the parameters that fit these best.
fn squares(blocks: &[Sums], weights: &[f64], columns: usize) -> Option<Vec<f64>> {
    let size = columns + 1;
    let mut sums: Sums = vec![vec![0.0; size * size]; weights.len()];
    for block in blocks {
        for (sum, own) in sums.iter_mut().zip(block) {
            sum.iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
        }
    }
    let values = parameters(&sums, weights, columns)?;
    Some(squares_of(&sums, &values))
}

/// The parameters that fit sums best.
fn parameters(sums: &Sums, weights: &[f64], columns: usize) -> Option<Vec<f64>> {
    let size = columns + 1;
    let all = |a: usize, b: usize| -> f64 {
        let pairs = sums.iter().zip(weights);
        pairs.map(|(own, weight)| weight * own[a * size + b]).sum()
    };
    let mut gram = vec![0.0; columns * columns];
    for a in 0..columns {
        for b in 0..=a {
            gram[a * columns + b] = all(a, b);
        }
    }
    let right: Vec<f64> = (0..columns).map(|a| all(columns, a)).collect();
    solve(&mut gram, &right)
}

/// The squared residuals of each equation with these parameters.
fn squares_of(sums: &Sums, values: &[f64]) -> Vec<f64> {
    let size = values.len() + 1;
    let factors: Vec<f64> = values.iter().map(|x| -x).chain([1.0]).collect();
    let left = |own: &Vec<f64>| {
        let mut sum = 0.0;
        for (a, x) in factors.iter().enumerate() {
            for (b, y) in factors[..=a].iter().enumerate() {
                sum += if a == b { 1.0 } else { 2.0 } * x * y * own[a * size + b];
            }
        }
        sum.max(0.0)
    };
    sums.iter().map(left).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::super::Reading;
    use super::super::swings_for_tests::{sample, swings};
    use super::*;

    fn found(changed: impl Fn(usize, &mut Vec<f64>)) -> Option<Parts> {
        let model = swings(false);
        let mut sample = sample();
        let states = sample.states.iter_mut().enumerate();
        states.for_each(|(k, state)| changed(k, &mut state.efforts));
        let plain = Reading::plain(3);
        let grams = Grams::of(&model, &sample, &plain, 1).unwrap();
        let now = grams.fit(&plain, &[]).unwrap();
        search(&sample, &grams, &now)
    }

    #[test]
    fn a_log_of_two_parts_with_other_parameters_is_divided_where_the_second_begins() {
        let all = sample();
        let (count, length) = (all.states.len(), all.states.len().div_ceil(BLOCKS));
        assert_eq!(found(|_, _| ()), None);
        for (place, factor) in [(count / 2, -1.0), (count / 3, 2.0), (count / 4, 1e3)] {
            let own = found(|k, efforts| {
                if k >= place {
                    for u in efforts {
                        *u *= factor;
                    }
                }
            });
            let time = own.unwrap().time;
            let block = all.states[length].time - all.states[0].time;
            assert!((time - all.states[place].time).abs() <= block, "{time}");
        }
        // what is wrong in the same way all along is no second part
        assert_eq!(found(|_, efforts| efforts[1] *= -1.0), None);
        assert_eq!(found(|_, efforts| efforts.swap(0, 1)), None);
    }

    #[test]
    fn an_effort_that_is_cut_off_with_noise_besides_is_found_with_what_it_needs() {
        let model = swings(false);
        let cut = |least: f64, bound: f64| {
            let mut sample = sample();
            let mut noise = crate::intervals::Random(3);
            for state in &mut sample.states {
                state.efforts[1] = state.efforts[1].clamp(least, bound) + 0.005 * noise.normal();
            }
            let plain = Reading::plain(3);
            let grams = Grams::of(&model, &sample, &plain, 1).unwrap();
            let now = grams.fit(&plain, &[]).unwrap();
            cut_off(&sample, &grams, &now)
        };
        let most = sample()
            .states
            .iter()
            .fold(0.0, |m: f64, s| m.max(s.efforts[1]));
        assert_eq!(cut(-2.0 * most, 2.0 * most), []);
        // on one side, or on both
        assert_eq!(cut(-0.6 * most, 0.6 * most).len(), 1);
        let found = cut(-2.0 * most, 0.6 * most);
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0].effort, 1);
        assert!((found[0].at / (0.6 * most) - 1.0).abs() < 0.05, "{found:?}");
        assert!((found[0].needed / most - 1.0).abs() < 0.2, "{found:?}");
    }
}
