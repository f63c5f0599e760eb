//! The final check of limits, between samples too, and the reduction of motions that exceed them.

use super::ExciteError;
use super::evaluate::{Number, Problem};
use super::space::Row;
use regen_batch::TrajectoryClosure;
use regen_runtime::BaseModel;

/// The number of grid points in each period of the highest harmonic.
pub(super) const POINTS_PER_PERIOD: usize = 128;

/// The largest value of a limit over a period, and where it occurs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Worst {
    /// The index of the limit.
    pub(super) limit: usize,
    /// The index of the point of the dense grid.
    pub(super) point: usize,
    /// The value in units of half the limit's range, above 0 where the limit is exceeded; it
    /// includes a bound on the excess between grid points.
    pub(super) value: f64,
}

/// An upper bound of each limit's value over the period, from its values at the grid points.
///
/// Between two points a function is at most the larger of both values plus an eighth of its
/// greatest second difference. Twice that is added, with the greatest second difference at the
/// point and its two neighbours.
fn bounds(values: &[f64], limits: usize) -> Vec<Worst> {
    let points = values.len().checked_div(limits).unwrap_or(0);
    let at = |point: usize, limit: usize| values[(point % points) * limits + limit];
    let bend = |point: usize, limit: usize| {
        let (before, after) = (at(point + points - 1, limit), at(point + 1, limit));
        (before - 2.0 * at(point, limit) + after).abs()
    };
    (0..limits)
        .map(|limit| {
            let mut worst = Worst {
                limit,
                point: 0,
                value: f64::NEG_INFINITY,
            };
            for point in 0..points {
                let bends = [point + points - 1, point, point + 1].map(|p| bend(p, limit));
                let value = at(point, limit) + 0.25 * bends.into_iter().fold(0.0, f64::max);
                // NaN is worse than any number
                if value > worst.value || value.is_nan() {
                    worst = Worst {
                        limit,
                        point,
                        value,
                    };
                }
            }
            worst
        })
        .collect()
}

/// A motion within all limits: its variables and the bound of each limit's value.
pub(super) struct MotionWithinLimits {
    pub(super) y: Vec<f64>,
    pub(super) bounds: Vec<Worst>,
}

/// The largest part by which a motion is reduced: what is left of it still moves. Standing still is
/// within the limits of most poses, and excites nothing.
const MAX_CUT: f64 = 0.99;

/// Returns the motion `y` or, if it exceeds a limit, a smaller motion of the same shape about one
/// of the `poses` that is within all limits. Otherwise returns the limit that the last motion tried
/// exceeds most, or `None` if no tried motion could be closed.
pub(super) fn shrink_to_limits<M, D>(
    problem: &Problem<'_, M, D>,
    closure: &mut TrajectoryClosure<'_, M>,
    dense: &[Row],
    poses: &[Vec<f64>],
    y: &[f64],
) -> Result<Result<MotionWithinLimits, Option<Worst>>, ExciteError>
where
    M: BaseModel<f64>,
    D: BaseModel<Number>,
{
    let mut most_exceeded = None;
    let limits = problem.limits.len();
    for pose in poses {
        let mut cut = 0.0;
        loop {
            let trial = problem.space.between(pose, y, 1.0 - cut);
            let values = problem.values(closure, dense, &trial)?;
            let mut worst = 0.0;
            if let Some(values) = values {
                let bounds = bounds(&values, limits);
                let most = bounds
                    .iter()
                    .copied()
                    .max_by(|a, b| a.value.total_cmp(&b.value));
                match most {
                    Some(most) if most.value > 0.0 || most.value.is_nan() => {
                        most_exceeded = Some(most);
                        worst = most.value;
                    }
                    _ => return Ok(Ok(MotionWithinLimits { y: trial, bounds })),
                }
            }
            if cut >= MAX_CUT {
                break;
            }
            let more = if worst.is_finite() { 1.2 * worst } else { 0.0 };
            // at most half of what is left: a motion of useful size may be in between
            cut = (cut + more.max(1e-4).max(0.5 * cut)).min(0.5 * (1.0 + cut));
        }
    }
    Ok(Err(most_exceeded))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_is_above_a_peak_between_points() {
        // a sine whose peak is halfway between two points
        let points = 16;
        let values: Vec<f64> = (0..points)
            .map(|k| libm::cos(core::f64::consts::TAU * (f64::from(k) + 0.5) / f64::from(points)))
            .collect();
        let largest_sample = values.iter().copied().fold(0.0, f64::max);
        let bound = bounds(&values, 1)[0].value;
        assert!(
            largest_sample < 0.99 && (1.0..1.03).contains(&bound),
            "{largest_sample} {bound}"
        );
    }
}
