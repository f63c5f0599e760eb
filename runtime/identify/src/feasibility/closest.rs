//! The choice among parameters that fit equally well.

use super::Options;
use super::interior::{InteriorOutcome, Precision, minimise};
use super::problem::Problem;

/// The cost of the term for closeness to the reference at the first solution, as a fraction of the
/// objective. The objective may rise by twice as much.
const MAX_REFERENCE_COST: f64 = 1e-8;
/// The data count as fitted exactly when the sum of squares is at most this fraction of the
/// objective's floor.
const EXACT_FIT_PART: f64 = 1e-4;
/// With an exact fit, the largest rise of the objective for closeness to the reference, as a
/// fraction of the sum that counts as exact.
const MAX_EXACT_FIT_COST: f64 = 1e-5;

/// Among the parameters that fit equally well, those close to the reference, with their relative
/// duality gap.
///
/// Minimises the objective again with the additional term `w ||phi - reference||^2`. If that term
/// is at most `MAX_REFERENCE_COST` of the objective at the first solution, the objective cannot
/// rise by more: at the new minimum the sum of both is not larger than at the first solution.
pub(super) fn closest_to_reference(
    problem: &Problem,
    options: &Options,
    minimum: &InteriorOutcome,
) -> (Vec<f64>, f64) {
    let first = (minimum.best.x.clone(), minimum.gap.part());
    let plain = &problem.objective;
    // the squared distance from the reference: the rows after those of the objective
    let squared_distance = |x: &[f64]| {
        let pulled = problem.pulled(&options.reference, 1.0);
        let squares: f64 = pulled.residuals(x)[plain.rows.len()..]
            .iter()
            .map(|r| r * r)
            .sum();
        squares
    };
    let distance = squared_distance(&first.0);
    if distance.is_nan() || distance <= 0.0 {
        return first;
    }
    // if the data fit exactly, the cost of the additional term is of second order: its weight may
    // be larger, as long as the cost stays negligible
    let floor = EXACT_FIT_PART * plain.floor;
    let squares = plain.squares(&first.0);
    let is_exact = squares <= floor;
    let (cost_ratios, max_rise): (&[f64], f64) = if is_exact {
        (&[1e3, 1e2, 1e1, 1.0], MAX_EXACT_FIT_COST * floor)
    } else {
        (&[MAX_REFERENCE_COST], 2.0 * MAX_REFERENCE_COST * squares)
    };
    for cost_ratio in cost_ratios {
        let weight = cost_ratio * squares.max(floor) / distance;
        let again = minimise(
            &problem.pulled(&options.reference, weight),
            &problem.cones,
            &problem.reach,
            minimum.interior_point.clone(),
            (
                1e-2 * MAX_REFERENCE_COST * squares.max(floor) / minimum.gap.value,
                Precision::Full,
            ),
            &|_| false,
        );
        let Some(again) = again else { continue };
        let x = again.best.x;
        let rise = objective(problem, &x) - objective(problem, &first.0);
        if rise <= max_rise && squared_distance(&x) < distance {
            let gap = minimum.gap.complementarity + minimum.gap.unbalanced + rise.max(0.0);
            return (x, gap / minimum.gap.value);
        }
    }
    first
}

/// The objective including its logarithms, up to a constant.
pub(super) fn objective(problem: &Problem, x: &[f64]) -> f64 {
    let logarithms: f64 = problem
        .cones
        .iter()
        .filter(|cone| cone.logarithm > 0.0)
        .map(|cone| {
            let l = super::symmetric::cholesky(&cone.at(x), cone.size);
            let roots = l.map_or(f64::NAN, |l| {
                (0..4).map(|k| libm::log(l[k][k])).sum::<f64>()
            });
            2.0 * cone.logarithm * roots
        })
        .sum();
    problem.objective.squares(x) - logarithms
}
