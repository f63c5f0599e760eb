//! Closed states near home, reached by small steps so that they stay on its assembly branch. The
//! states are the same in every run.

use crate::model::Model;
use crate::numeric::solve_pivoted;

use super::home::{NumericLoops, select};

/// Number of closed states, home included.
const SAMPLED_STATES: usize = 12;
/// Number of steps from home to each state.
const STEPS_PER_STATE: usize = 6;
/// Steps to states with a smaller pivot ratio of A_e, so close to a singularity, are not taken.
const MIN_PIVOT_RATIO: f64 = 1e-3;

/// A pseudorandom generator of numbers in [-1, 1), the same in every run.
pub(super) struct Random(u64);

impl Random {
    /// The generator at its start.
    pub(super) fn new() -> Self {
        Random(0x9E37_79B9_7F4A_7C15)
    }

    pub(super) fn next(&mut self) -> f64 {
        // xorshift64*, Vigna 2016
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let bits = self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11;
        bits as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// Home, and further closed states around it.
pub fn closed_states(loops: &NumericLoops<'_>, model: &Model, home: &[f64]) -> Vec<Vec<f64>> {
    let mut random = Random::new();
    let ranges: Vec<f64> = model
        .independent
        .iter()
        .map(|&c| range(loops, model, home, c))
        .collect();
    let mut states = vec![home.to_vec()];
    for _ in 1..SAMPLED_STATES {
        let target: Vec<f64> = ranges.iter().map(|r| r * random.next()).collect();
        let mut q = home.to_vec();
        for _ in 0..STEPS_PER_STATE {
            let mut next = q.clone();
            for (c, d) in model.independent.iter().zip(&target) {
                next[*c] += d / STEPS_PER_STATE as f64;
            }
            predict(loops, [&model.independent, &model.dependent], &q, &mut next);
            let (residual, _) = loops.close(&mut next, &model.dependent);
            let (_, a) = loops.normal(&next);
            let rhs = vec![vec![]; a.len()];
            let ratio = solve_pivoted(select(&a, &model.dependent), rhs).pivot_ratio;
            // the comparison also ends the path for NaN
            if !(residual < 1e-10 && ratio > MIN_PIVOT_RATIO) {
                break;
            }
            q = next;
        }
        states.push(q);
    }
    states
}

/// Moves the dependent coordinates together with the independent ones, to first order: dq_e = -X
/// dq_i.
pub(super) fn predict(
    loops: &NumericLoops<'_>,
    [independent, dependent]: [&[usize]; 2],
    from: &[f64],
    to: &mut [f64],
) {
    if dependent.is_empty() {
        return;
    }
    let (_, a) = loops.normal(from);
    let unit = &loops.units().coordinates;
    let rhs = a.iter().map(|row| {
        let moved = independent
            .iter()
            .map(|&c| row[c] * ((to[c] - from[c]) / unit[c]));
        vec![-moved.sum::<f64>()]
    });
    let solved = solve_pivoted(select(&a, dependent), rhs.collect());
    if solved.pivot_ratio > 0.0 {
        for (c, d) in dependent.iter().zip(&solved.solution) {
            to[*c] += d[0] * unit[*c];
        }
    }
}

/// The largest distance of a coordinate from home, rad or m. Usually it is 0.35 rad for an angle, a
/// fifth of its value at home for a length (at least a twentieth of the mechanism's length), and
/// for a drive what its joints' distances amount to. With limits it is the distance to the nearer
/// one, up to three times the usual distance.
fn range(loops: &NumericLoops<'_>, model: &Model, home: &[f64], c: usize) -> f64 {
    let usual = match model.form_of_drive(c) {
        Some(form) => {
            let joints = form.terms.iter();
            let each = joints.map(|(j, k)| k.to_f64().abs() * range(loops, model, home, *j));
            each.sum()
        }
        None if model.slides(c) => 0.2 * home[c].abs().max(0.25 * loops.units().length),
        None => 0.35,
    };
    match model.coordinates[c].position {
        Some([lo, hi]) if hi > lo => {
            let room = (home[c] - lo).min(hi - home[c]);
            if room > 0.0 {
                room.min(3.0 * usual)
            } else {
                usual
            }
        }
        _ => usual,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::home::close_home;
    use super::super::rows::world_equations;
    use super::*;
    use crate::diag::Source;
    use crate::kinematics::{Frames, Geometry};
    use crate::sym::Graph;

    /// The largest distance from home in the samples of a pendulum with these limits.
    fn moved(limits: &str) -> f64 {
        let text = format!(
            "name: one\nlimbs:\n  - name: arm\n    joints:\n      \
             - {{name: q1, type: revolute, body: 1, actuated: true{limits}}}\nhome: {{q1: 1/2}}\n"
        );
        let model =
            crate::model::build(&crate::spec::parse(&Source::new("one.yaml", text)).unwrap());
        let mut g = Graph::new();
        for coordinate in &model.coordinates {
            g.symbol(&coordinate.name);
        }
        let frames = Frames::new(&mut g, &model, Geometry::Values);
        let equations = world_equations(&mut g, &frames, &model, None);
        let loops = NumericLoops::new(&g, &equations, &model);
        let home = close_home(&loops, &model).unwrap();
        let states = closed_states(&loops, &model, &home);
        let farthest = states
            .iter()
            .fold(0.0, |m: f64, q| m.max((q[0] - home[0]).abs()));
        let range = range(&loops, &model, &home, 0);
        assert!(
            farthest <= range && farthest > 0.5 * range,
            "{farthest} of {range}"
        );
        range
    }

    #[test]
    fn coordinates_are_moved_within_their_limits_and_not_too_far() {
        let usual = moved("");
        assert!((0.2..0.5).contains(&usual), "{usual}");
        // the nearer limit is 0.05 from home
        let narrow = moved(", limits: {position: [-3, 0.55]}");
        assert!((narrow - 0.05).abs() < 1e-12, "{narrow}");
        // wide limits allow three times the default distance
        let wide = moved(", limits: {position: [-9, 9]}");
        assert!((wide / usual - 3.0).abs() < 1e-12, "{wide} {usual}");
        let some = moved(", limits: {position: [0, 9]}");
        assert!((some - 0.5).abs() < 1e-12, "{some}");
        // at a home on its limit, the limits are ignored
        let at_limit = moved(", limits: {position: [0.5, 2]}");
        assert!((at_limit - usual).abs() < 1e-12, "{at_limit}");
    }
}
