//! A singular home: the rank of A there is lower than beside it, and with it the number of degrees
//! of freedom is not the mechanism's.

use crate::model::Model;
use crate::numeric::{rank_and_columns, solve_pivoted};
use crate::sym::Number;

use super::home::{
    HomeProblem, Mismatch, NumericLoops, RegularHome, close_from_home, close_least, fits_mobility,
    select, valid_choice, without_rounding,
};
use super::samples::{Random, predict};
use super::search::within_limits;

/// Pivots below this fraction of the largest count as zero at home and beside it. Newton's method
/// ends up to a millionth away from a singular state, where they are as small.
const RANK_TOLERANCE: f64 = 1e-5;
/// The largest distance of a step beside home in each coordinate that is free, rad or units of
/// length.
const STEP: f64 = 0.02;
/// The least part of it, so that no step stays at home.
const MIN_PART: f64 = 0.2;
/// States farther from home than this many steps are not beside it.
const MAX_STEPS_AWAY: f64 = 20.0;
/// The largest residual of a closed state beside home, in the mechanism's units.
const CLOSED: f64 = 1e-11;
/// How many steps beside home are tried.
const DIRECTIONS: usize = 12;
/// How far the independent coordinates are moved to find a regular home, rad; translations by a fifth
/// of it, in units of length.
const MOVES: [f64; 6] = [0.6, -0.6, 0.3, -0.3, 1.0, -1.0];
/// How many homes are tried.
const MAX_TRIED: usize = 24;

/// Whether the mechanism moves from a closed state with all its freedoms there: a step of the
/// independent coordinates closes, and A_e is far from singular.
fn is_regular(loops: &NumericLoops<'_>, model: &Model, q: &[f64]) -> bool {
    if model.dependent.is_empty() {
        return true;
    }
    let (_, a) = loops.normal(q);
    let sides = vec![vec![]; a.len()];
    let a_e = select(&a, &model.dependent);
    if solve_pivoted(a_e, sides).pivot_ratio <= RANK_TOLERANCE {
        return false;
    }
    let groups = [model.independent.as_slice(), &model.dependent];
    let mut random = Random::new();
    let next = step(loops, q, groups, &mut random);
    next.is_some_and(|next| rank(loops, &next) == rank(loops, q))
}

/// A closed state a step from `q`: the coordinates of the first group are moved at random, those of
/// the second close the loops. `None` if they do not close nearby.
fn step(
    loops: &NumericLoops<'_>,
    q: &[f64],
    groups: [&[usize]; 2],
    random: &mut Random,
) -> Option<Vec<f64>> {
    let units = &loops.units().coordinates;
    let mut next = q.to_vec();
    for &c in groups[0] {
        let part = random.next();
        let part = part + MIN_PART.copysign(part) * (1.0 - part.abs());
        next[c] += STEP * part * units[c];
    }
    predict(loops, groups, q, &mut next);
    let (mut residual, _) = loops.close(&mut next, groups[1]);
    if residual > CLOSED {
        // where the rank differs from that at home, other coordinates follow
        let every: Vec<usize> = (0..q.len()).collect();
        (residual, _) = close_least(loops, &mut next, &every);
    }
    let moved = next.iter().zip(q).zip(units);
    let moved = moved.fold(0.0_f64, |m, ((x, y), unit)| m.max(((x - y) / unit).abs()));
    // the comparisons are also false for NaN
    let beside = (MIN_PART * STEP..=MAX_STEPS_AWAY * STEP).contains(&moved);
    (residual <= CLOSED && beside).then_some(next)
}

fn rank(loops: &NumericLoops<'_>, q: &[f64]) -> usize {
    let (_, a) = loops.normal(q);
    rank_and_columns(without_rounding(a), RANK_TOLERANCE).0
}

/// Refuses a singular home, if closed states are found beside it and the rank of A is higher at all of
/// them.
///
/// # Errors
/// [`HomeProblem::Singular`], with a regular home if one is found.
pub(super) fn check_regular(
    loops: &NumericLoops<'_>,
    model: &Model,
    q: &[f64],
    is_fitting: bool,
) -> Result<(), HomeProblem> {
    if is_fitting && is_regular(loops, model, q) {
        return Ok(());
    }
    let n = model.coordinates.len();
    let (_, a) = loops.normal(q);
    let (at_home, dependent) = rank_and_columns(without_rounding(a), RANK_TOLERANCE);
    let free: Vec<usize> = (0..n).filter(|c| !dependent.contains(c)).collect();
    let mut random = Random::new();
    let tried = (0..DIRECTIONS).filter_map(|_| {
        let next = step(loops, q, [&free, &dependent], &mut random)?;
        Some((rank(loops, &next), next))
    });
    let Some((beside, state)) = tried.min_by_key(|(rank, _)| *rank) else {
        return Ok(());
    };
    if beside <= at_home {
        return Ok(());
    }
    Err(HomeProblem::Singular {
        mobility: n - at_home,
        beside: n - beside,
        remedy: regular_home(loops, model, &state, beside),
    })
}

/// A home near the spec's from which the loops close at a regular state, if one is found among a
/// few values of the independent coordinates. Those are the spec's, if they are valid at `beside`.
fn regular_home(
    loops: &NumericLoops<'_>,
    model: &Model,
    beside: &[f64],
    rank: usize,
) -> Option<RegularHome> {
    let mut model = model.clone();
    if fits_mobility(loops, &model, beside).is_err() {
        let (_, a) = loops.normal(beside);
        model.independent = valid_choice(&a, &model, rank);
        let all = 0..model.coordinates.len();
        model.dependent = all.filter(|c| !model.independent.contains(c)).collect();
    }
    let start: Vec<f64> = model.home.iter().map(Number::to_f64).collect();
    let unit = 0.2 * loops.units().length;
    let single = |moved: f64| model.independent.iter().map(move |c| (vec![*c], moved));
    let each = MOVES.into_iter().flat_map(|moved| {
        let all = (model.independent.clone(), moved);
        single(moved).chain((model.independent.len() > 1).then_some(all))
    });
    let tries: Vec<(Vec<usize>, f64)> = each.take(MAX_TRIED).collect();
    for (coordinates, moved) in tries {
        let mut home = start.clone();
        for c in coordinates {
            home[c] =
                short(home[c] + moved.signum() * model.reach(c, moved.abs(), moved.abs() * unit));
        }
        let found = match closed(loops, &mut model, &home) {
            Err(HomeProblem::NotClosed { near, .. }) => near.first().and_then(|near| {
                home = near.iter().map(|x| written(*x)).collect();
                closed(loops, &mut model, &home).ok()
            }),
            other => other.ok(),
        };
        if let Some(closed) = found.filter(|q| within_limits(&model, &start, q)) {
            return Some(RegularHome {
                home,
                closed,
                independent: model.independent,
            });
        }
    }
    None
}

/// The regular state at which the loops close from a home.
fn closed(
    loops: &NumericLoops<'_>,
    model: &mut Model,
    home: &[f64],
) -> Result<Vec<f64>, HomeProblem> {
    for (number, value) in model.home.iter_mut().zip(home) {
        if number.to_f64().to_bits() != value.to_bits()
            && let Some(value) = Number::parse_decimal(&format!("{value:.6}"))
        {
            *number = value;
        }
    }
    close_from_home(loops, model, &|q| {
        fits_mobility(loops, model, q)?;
        if is_regular(loops, model, q) {
            return Ok(());
        }
        Err(HomeProblem::NotIndependent {
            choice: model.independent.clone(),
            mismatch: Mismatch::default(),
        })
    })
}

/// A value with two digits.
fn short(x: f64) -> f64 {
    format!("{x:.1e}").parse().unwrap_or(x)
}

/// A value with six decimals, as messages have them.
fn written(x: f64) -> f64 {
    format!("{x:.6}").parse().unwrap_or(x)
}
