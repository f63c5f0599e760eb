//! Search for closed states if the loops do not close from home: Levenberg-Marquardt steps over the
//! dependent coordinates, from many starts about home. The starts are the same in every run.

use crate::model::Model;
use crate::numeric::solve_pivoted;

use super::home::{NumericLoops, select};
use super::samples::Random;

/// Number of starts for mechanisms with up to [`SMALL`] dependent coordinates.
const STARTS: usize = 160;
/// With more dependent coordinates than this, fewer starts are tried, since the time of each grows
/// with the cube of their number.
const SMALL: usize = 20;
/// The least number of starts.
const MIN_STARTS: usize = 24;
/// The largest distances of the starts from home in each coordinate, used in turn: rad, and units
/// of length.
const SPREADS: [f64; 4] = [0.3, 1.0, 2.0, core::f64::consts::PI];
/// Largest number of steps from a start.
const MAX_STEPS: usize = 40;
/// The norm of the residual at which Levenberg-Marquardt steps end, in the mechanism's units.
const NEAR: f64 = 1e-6;
/// The largest norm of the residual from which Newton's method is tried, if they did not reach that.
const NEWTON_RESIDUAL: f64 = 1e-3;
/// The largest residual of a closed state, in the mechanism's units.
const CLOSED: f64 = 1e-11;
/// States closer than this in every coordinate are the same.
const SAME: f64 = 1e-6;
/// The largest distance from home in each coordinate of a state that counts as being on home's
/// branch, in the mechanism's units.
const MAX_DISTANCE: f64 = 0.5;
/// No other state may then be within this distance of home in all coordinates.
const MIN_DISTANCE_OF_OTHERS: f64 = 1.0;
/// A coordinate of home larger than this determines the sign of the state's coordinate.
const MIN_SIGNED: f64 = 0.1;
/// Differences from home count up to this size, so that one badly guessed coordinate does not
/// outweigh the others.
const MAX_DIFFERENCE: f64 = 0.5;

/// Closed states with home's independent coordinates, those closest to home first.
///
/// The distance from home is the sum of the differences of the dependent coordinates, rad and units
/// of length, each counted up to 0.5.
pub(super) fn closed_states_near(loops: &NumericLoops<'_>, model: &Model) -> Vec<Vec<f64>> {
    let home: Vec<f64> = model.home.iter().map(crate::sym::Number::to_f64).collect();
    let units = &loops.units().coordinates;
    let joints = model.dependent.iter();
    let joints: Vec<usize> = joints
        .copied()
        .filter(|c| !model.drives.contains(c))
        .collect();
    let mut random = Random::new();
    let mut found: Vec<(f64, Vec<f64>)> = Vec::new();
    let cube = |n: usize| n.max(SMALL).pow(3);
    let starts = STARTS * cube(0) / cube(model.dependent.len());
    for k in 0..starts.max(MIN_STARTS) {
        let mut q = home.clone();
        for &c in &joints {
            q[c] += SPREADS[k % SPREADS.len()] * random.next() * units[c];
        }
        if !descend(loops, model, &mut q) {
            continue;
        }
        for &c in &joints {
            if !model.slides(c) {
                let turns = libm::round((q[c] - home[c]) / core::f64::consts::TAU);
                q[c] -= turns * core::f64::consts::TAU;
            }
        }
        // a coupling may not hold after whole turns were removed
        if loops.close(&mut q, &model.dependent).0 > CLOSED || !within_limits(model, &home, &q) {
            continue;
        }
        let same = |other: &[f64]| q.iter().zip(other).all(|(x, y)| (x - y).abs() < SAME);
        if found.iter().any(|(_, other)| same(other)) {
            continue;
        }
        let differences = joints.iter().map(|&c| (q[c] - home[c]).abs() / units[c]);
        let distance = differences.map(|d| d.min(MAX_DIFFERENCE)).sum();
        found.push((distance, q));
    }
    found.sort_by(|(one, _), (other, _)| one.total_cmp(other));
    let balls = balls(model);
    let mut poses: Vec<Vec<f64>> = Vec::new();
    for (_, q) in found {
        if !poses.iter().any(|other| is_same_pose(&q, other, &balls)) {
            poses.push(q);
        }
    }
    poses
}

/// The three coordinates of each spherical joint.
fn balls(model: &Model) -> Vec<[usize; 3]> {
    let place = |name: &str| model.coordinates.iter().position(|c| c.name == name);
    let firsts = model.coordinates.iter().enumerate();
    let balls = firsts.filter_map(|(first, c)| {
        let joint = c.name.strip_suffix(".1")?;
        let second = place(&format!("{joint}.2"))?;
        Some([first, second, place(&format!("{joint}.3"))?])
    });
    balls.collect()
}

/// Whether two states are the same but for whole turns: the angles `(a, b, c)` of a spherical joint turn a body as
/// `(a + pi, pi - b, c + pi)` do.
fn is_same_pose(one: &[f64], other: &[f64], balls: &[[usize; 3]]) -> bool {
    use core::f64::consts::{PI, TAU};
    let turned = |x: f64, y: f64| (x - y - TAU * libm::round((x - y) / TAU)).abs() < SAME;
    let is_other_half = |ball: &[usize; 3]| {
        let [a, b, c] = ball.map(|k| (one[k], other[k]));
        turned(a.0 + PI, a.1) && turned(PI - b.0, b.1) && turned(c.0 + PI, c.1)
    };
    let of_ball = |k: usize| balls.iter().find(|ball| ball.contains(&k));
    let mut pairs = one.iter().zip(other).enumerate();
    pairs.all(|(k, (x, y))| match of_ball(k) {
        Some(ball) => ball.iter().all(|k| turned(one[*k], other[*k])) || is_other_half(ball),
        None => (x - y).abs() < SAME,
    })
}

/// The closed state on the branch that home indicates, if it indicates exactly one: see
/// [`close_home`](super::close_home).
pub(super) fn branch_of_home(
    loops: &NumericLoops<'_>,
    model: &Model,
    found: &[Vec<f64>],
) -> Option<Vec<f64>> {
    let home: Vec<f64> = model.home.iter().map(crate::sym::Number::to_f64).collect();
    let units = &loops.units().coordinates;
    let is_within = |q: &Vec<f64>, bound: f64| {
        let mut joints = model.dependent.iter();
        joints.all(|&c| model.drives.contains(&c) || (q[c] - home[c]).abs() <= bound * units[c])
    };
    let mut close = found
        .iter()
        .filter(|q| is_within(q, MIN_DISTANCE_OF_OTHERS));
    let only = close.next()?;
    let has_sign_of_home =
        |&c: &usize| home[c].abs() <= MIN_SIGNED * units[c] || same_sign(only[c], home[c]);
    let is_taken = close.next().is_none()
        && is_within(only, MAX_DISTANCE)
        && model.dependent.iter().all(has_sign_of_home);
    is_taken.then(|| only.clone())
}

/// Whether two numbers have the same sign.
fn same_sign(one: f64, other: f64) -> bool {
    (one < 0.0) == (other < 0.0)
}

/// Whether all coordinates are within their limits; a limit that home itself violates does not
/// count.
pub(super) fn within_limits(model: &Model, home: &[f64], q: &[f64]) -> bool {
    let all = model.coordinates.iter().zip(home).zip(q);
    all.into_iter()
        .all(|((coordinate, home), q)| match coordinate.position {
            Some([low, high]) if (low..=high).contains(home) => (low..=high).contains(q),
            _ => true,
        })
}

/// Reduces the residual by Levenberg-Marquardt steps, then by Newton's method; returns whether the
/// loops are closed.
fn descend(loops: &NumericLoops<'_>, model: &Model, q: &mut Vec<f64>) -> bool {
    let size = |f: &[f64]| f.iter().map(|x| x * x).sum::<f64>();
    let units = &loops.units().coordinates;
    let mut damping = 1e-3;
    let (mut f, mut a) = loops.normal(q);
    for _ in 0..MAX_STEPS {
        let before = size(&f);
        if before < NEAR * NEAR {
            break;
        }
        let j = select(&a, &model.dependent);
        let n = model.dependent.len();
        let mut normal = vec![vec![0.0; n]; n];
        let mut gradient = vec![vec![0.0]; n];
        for (row, f) in j.iter().zip(&f) {
            for (i, x) in row.iter().enumerate().filter(|(_, x)| **x != 0.0) {
                gradient[i][0] -= x * f;
                for (sum, y) in normal[i].iter_mut().zip(row) {
                    *sum += x * y;
                }
            }
        }
        for (i, row) in normal.iter_mut().enumerate() {
            row[i] += damping * (1.0 + row[i]);
        }
        let step = solve_pivoted(normal, gradient).solution;
        let mut next = q.clone();
        for (c, step) in model.dependent.iter().zip(&step) {
            next[*c] += step[0] * units[*c];
        }
        let (nf, na) = loops.normal(&next);
        // the comparison is also false for NaN
        if size(&nf) < before {
            (*q, f, a) = (next, nf, na);
            damping *= 0.3;
        } else {
            damping *= 4.0;
            if damping > 1e6 {
                break;
            }
        }
    }
    size(&f) < NEWTON_RESIDUAL * NEWTON_RESIDUAL && loops.close(q, &model.dependent).0 <= CLOSED
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::constraints::{Closed, HomeProblem, world_equations};
    use crate::diag::Source;
    use crate::kinematics::{Frames, Geometry};
    use crate::sym::Graph;

    fn frames(text: &str) -> (Model, Graph, Frames) {
        let spec = crate::spec::parse(&Source::new("test.yaml", text)).unwrap();
        let model = crate::model::build(&spec);
        let mut g = Graph::new();
        for coordinate in &model.coordinates {
            g.symbol(&coordinate.name);
        }
        let frames = Frames::new(&mut g, &model, Geometry::Values);
        (model, g, frames)
    }

    /// A 3-PRS whose legs are guessed near where they are, and whose platform is 2 rad off.
    #[test]
    fn one_bad_guess_does_not_hide_the_state_that_the_others_indicate() {
        let text = include_str!("../../../tests/fixtures/mechanisms/prs3.yaml");
        let closed = "home: {q1: 0.57693, s1.3: -0.57693, q2: 0.57693, q3: 0.57693}";
        let guessed = "home: {q1: 0.6, s1.1: 1.2, s1.3: 1.4, q2: 0.6, q3: 0.6}";
        assert!(text.contains(closed));
        let (model, mut g, frames) = frames(&text.replace(closed, guessed));
        let equations = world_equations(&mut g, &frames, &model, None);
        let loops = NumericLoops::new(&g, &equations, &model);
        let found = closed_states_near(&loops, &model);
        let first = found.first().unwrap();
        for (coordinate, q) in model.coordinates.iter().zip(first) {
            if coordinate.name.starts_with('q') {
                assert!((q - 0.57693).abs() < 1e-4, "{} {q}", coordinate.name);
            }
        }
        for home in &found {
            assert!(loops.at(home).0.iter().all(|f| f.abs() < 1e-10));
        }
        // the angles of a spherical joint give each pose twice
        let balls = balls(&model);
        assert_eq!(balls.len(), 1);
        let second = |home: &[f64]| libm::cos(home[balls[0][1]]);
        let angles = |home: &[f64]| balls[0].map(|k| home[k]);
        for (k, home) in found.iter().enumerate() {
            for other in &found[..k] {
                assert!(
                    second(home) * second(other) > 0.0 || !is_same_pose(home, other, &balls),
                    "{:?} {:?}",
                    angles(home),
                    angles(other)
                );
            }
        }
        let mut again = first.clone();
        let [a, b, c] = balls[0];
        again[a] += core::f64::consts::PI;
        again[b] = core::f64::consts::PI - again[b];
        again[c] -= core::f64::consts::PI;
        assert!(is_same_pose(first, &again, &balls));
        again[c] += 0.1;
        assert!(!is_same_pose(first, &again, &balls));
    }

    #[test]
    fn if_nothing_closes_the_gap_is_reported_and_nothing_proposed() {
        // cranks at a distance of 1 with links of 1 and 9
        let text = "name: fourbar\nlimbs:\n  - name: left\n    joints:\n      \
                    - {name: q1, type: revolute, body: 1, actuated: true}\n      \
                    - {name: q2, type: revolute, dh: {a: 1}, body: 2}\n  - name: right\n    \
                    base: {xyz: [1, 0, 0]}\n    joints:\n      \
                    - {name: q3, type: revolute, body: 3}\ncuts:\n  - {name: pin, joint: revolute, \
                    between: [{body: 2, xyz: [1, 0, 0]}, {body: 3, xyz: [9, 0, 0]}]}\n\
                    home: {q1: 1.5, q2: -1.5, q3: 1.5}\n";
        let (model, mut g, frames) = frames(text);
        match Closed::new(&mut g, &frames, &model) {
            Err(HomeProblem::NotClosed { near, gaps, .. }) => {
                assert!(near.is_empty());
                assert!(gaps[0].metres > 1.0 && gaps[0].radians < 1e-6, "{gaps:?}");
            }
            other => panic!("{other:?}"),
        }
    }
}
