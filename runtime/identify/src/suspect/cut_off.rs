//! Efforts that are cut off with noise besides, so that their extremes are not equal.

use super::grams::{Fit, Grams, Stored};
use super::parts::{parameters, squares_of, sums, weights};
use super::{MIN_DOUBTED_ERROR, Sample};

/// The factor by which an error must be smaller without the states in which an effort is cut off.
const MIN_GAIN_WITHOUT: f64 = 2.0;
/// An effort within this part of its range from its extreme may be cut off there.
const NEAR_EXTREME: f64 = 0.04;
/// The parts of the states in which an effort may be: fewer are a burst, and more are all.
const CUT_OFF_PARTS: core::ops::Range<f64> = 0.01..0.5;
/// The least part of these in which the model needs more, and how much more at least, in what is left elsewhere.
const MIN_BEYOND: f64 = 0.8;
const MIN_MORE: f64 = 3.0;

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

/// Finds the efforts that are cut off: without the states in which one is near its largest or smallest value, it is
/// explained far better, and in these the model needs more.
pub(super) fn search(sample: &Sample, grams: &Grams, now: &Fit) -> Vec<CutOff> {
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::super::Reading;
    use super::super::swings_for_tests::{sample, swings};
    use super::*;

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
            search(&sample, &grams, &now)
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
