//! The residuals of efforts that a controller holds from row to row.
//!
//! A controller that runs at the rate of the log gives a new effort with each row, and the row has the
//! mean of the efforts before and after it. The second difference of the positions over one step h,
//! divided by `h^2`, is then the mean `a` of the accelerations on both sides exactly, and the equation of
//! motion has the mean of the other forces f over the same time:
//!
//! ```text
//! M a = tau - f - h^2/12 f''
//! ```
//!
//! Derivatives of high order, of filtered positions or of a series, take the motion for a smooth one.
//! Their acceleration is `a - h^2/12 a''`, so that the right parameters x leave a residual:
//!
//! ```text
//! tau - W x = h^2/12 (M a'' + f'') = h^2/12 tau''
//! ```
//!
//! Where velocities are measured and differentiated once, the mean acceleration is their difference over
//! 2 h, the other forces have their mean over that time, and the acceleration of high order is
//! `a - h^2/6 a''`: the residual is twice as large. With a controller that is much faster than the log
//! there are no such residuals.

use super::layout::ColumnLayout;

/// The part of `h^2 tau''` where accelerations are second derivatives of positions.
const OF_POSITIONS: f64 = 1.0 / 12.0;
/// The same where they are first derivatives of measured velocities.
const OF_VELOCITIES: f64 = 1.0 / 6.0;

/// The largest part of `h^2 tau''` that is left of the efforts of a log; 0 if all accelerations are
/// measured.
///
/// - `series`: whether the motion is that of a series fitted to the positions.
pub(super) fn held_part(layout: &ColumnLayout, series: bool) -> f64 {
    if layout.derivatives {
        return 0.0;
    }
    if series {
        return OF_POSITIONS;
    }
    let columns = layout.velocities.iter().zip(&layout.accelerations);
    let parts = columns.map(|(velocity, acceleration)| match (velocity, acceleration) {
        (_, Some(_)) => 0.0,
        (Some(_), None) => OF_VELOCITIES,
        (None, None) => OF_POSITIONS,
    });
    parts.fold(0.0, f64::max)
}

/// The second derivative of an effort at each row, times `scale`; 0 at both ends.
///
/// - `times`: s; `scale`: the part of `h^2 tau''`, s^2.
pub(super) fn held_residuals(times: &[f64], effort: &[f64], scale: f64) -> Vec<f64> {
    let mut out = vec![0.0; effort.len()];
    let windows = times.windows(3).zip(effort.windows(3));
    for (slot, (t, tau)) in out.iter_mut().skip(1).zip(windows) {
        let (&[t_a, t_b, t_c], &[a, b, c]) = (t, tau) else {
            continue;
        };
        let (before, after) = (t_b - t_a, t_c - t_b);
        let curvature = 2.0 * ((c - b) / after - (b - a) / before) / (before + after);
        if curvature.is_finite() {
            *slot = scale * curvature;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn residuals_are_second_derivatives_with_uneven_clocks_too() {
        // a parabola has the same second derivative everywhere
        let times = [0.0, 0.009, 0.021, 0.03, 0.041, 0.05];
        let effort = times.map(|t| 3.0 - 2.0 * t + 5.0 * t * t);
        let found = held_residuals(&times, &effort, 1e-4 / 12.0);
        assert!(found[0].abs() + found[5].abs() < f64::MIN_POSITIVE);
        for x in &found[1..5] {
            assert!((x / (1e-3 / 12.0) - 1.0).abs() < 1e-9, "{found:?}");
        }
    }
}
