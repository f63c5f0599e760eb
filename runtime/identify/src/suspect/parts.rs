//! Logs of two parts, one after the other, as of a payload that was picked up, or of two runs in one file, each of
//! which is explained by other parameters.

use super::grams::{Fit, Grams, Stored, solve};
use super::{DOUBTED_ERROR, MIN_DOUBTED_ERROR, Reading, Sample, quality, worst};

/// The number of places between which a log may be divided.
const BLOCKS: usize = 16;
/// The least number of states of a part for each parameter.
const MIN_STATES_PER_PARAMETER: usize = 2;
/// The factor by which an error must be smaller in parts: a burst in one of them is no other robot.
const MIN_GAIN_OF_ONE: f64 = 4.0;
/// The same of the product of errors.
const MIN_GAIN: f64 = 4.0;
/// The largest error that may be left, as of an effort that is noise, and the factor by which one may grow.
const MAX_LEFT: f64 = 1.02;
const MAX_LOSS: f64 = 1.02;
/// A log of two parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Parts {
    /// The time at which the second one begins, up to a sixteenth of the log, s.
    pub time: f64,
    /// The errors of the equations with parameters of each part, as in [`Change::after`](super::Change::after).
    pub after: Vec<f64>,
}

/// Sums over the states of a block, for each equation: the products of the regressor's columns and of the effort,
/// which comes last.
pub(super) type Sums = Vec<Vec<f64>>;

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
    // a constant that the model lacks is another weight where the robot hardly moves
    let before = with_constants(grams, now);
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
    let gain = quality(&before) / quality(&after);
    // noise of weak efforts, such as those of a wrist, is what no parameters explain
    let mut pairs = before.iter().zip(&after);
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

/// The errors that one set of parameters with a constant in each effort leaves, or those without constants if these are
/// smaller.
fn with_constants(grams: &Grams, now: &Fit) -> Vec<f64> {
    let efforts: Vec<usize> = (0..grams.efforts()).collect();
    let Some(fit) = grams.fit(&Reading::plain(efforts.len()), &efforts) else {
        return now.errors.clone();
    };
    let pairs = fit.errors.iter().zip(&fit.spreads);
    let pairs = pairs.zip(now.errors.iter().zip(&now.spreads));
    pairs
        .map(|((error, size), (before, spread))| (error * size / spread).min(*before))
        .collect()
}

/// The weights of the equations: over the squares of their residuals.
pub(super) fn weights(now: &Fit) -> Vec<f64> {
    let squares = now.errors.iter().zip(&now.spreads);
    let weight = squares.map(|(error, spread)| (error * spread).powi(-2));
    weight
        .map(|own| if own.is_finite() { own } else { 0.0 })
        .collect()
}

/// The sums over these states, of the equations that are used.
pub(super) fn sums(
    block: &[Stored],
    grams: &Grams,
    is_used: &dyn Fn(usize, &Stored) -> bool,
) -> Sums {
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
pub(super) fn parameters(sums: &Sums, weights: &[f64], columns: usize) -> Option<Vec<f64>> {
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
pub(super) fn squares_of(sums: &Sums, values: &[f64]) -> Vec<f64> {
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
        // nor are constants, which are weights in a part that hardly moves
        let model = swings(false);
        let mut gentle = sample();
        let (half, mut constants) = (count / 2, [3.0, -2.0, 4.0].into_iter().cycle());
        for (k, own) in gentle.states.iter_mut().enumerate() {
            for (effort, joint) in own.efforts.iter_mut().zip(0..) {
                if k < half {
                    for of in &mut own.motion {
                        of[joint] *= 0.02;
                    }
                    *effort *= 0.02;
                }
                *effort += constants.next().unwrap();
            }
        }
        let plain = Reading::plain(3);
        let grams = Grams::of(&model, &gentle, &plain, 1).unwrap();
        let now = grams.fit(&plain, &[]).unwrap();
        assert!(worst(&now.errors) > DOUBTED_ERROR);
        assert_eq!(search(&gentle, &grams, &now), None);
        // what is wrong in the same way all along is no second part
        assert_eq!(found(|_, efforts| efforts[1] *= -1.0), None);
        assert_eq!(found(|_, efforts| efforts.swap(0, 1)), None);
    }
}
