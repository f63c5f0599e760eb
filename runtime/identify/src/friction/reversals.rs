//! What a filter and sampling leave unknown of the velocities near reversals, and so of friction.
//!
//! At a reversal a joint rests until the effort exceeds its static friction, and its velocity then
//! changes within milliseconds. The velocity of a filtered log turns smoothly and at another instant, so
//! that friction at low velocities is assigned to wrong ones. No residual shows this. So the fit is
//! repeated with velocities that are less resolved still: once averaged over the time that the filter of
//! the states and differences of neighbours resolve, once late and once early by a quarter of it, at least by
//! a sample. Each change counts as a standard deviation.

use super::FrictionData;
use super::fit::{FrictionFit, moved_optimum};
use crate::feasibility::{BaseMap, FeasibilityError, Options, ParameterLayout};
use crate::signals::{Method, Smoothing};

/// The changes of a fit with other velocities: of the base parameters, the coefficients of friction, and
/// the logarithms of the shape parameters. There are none without a filter.
///
/// - the other arguments: those of the fit.
///
/// # Errors
/// As [`fit`](super::fit).
pub(super) fn changes(
    data: &FrictionData,
    combinations: &BaseMap,
    layout: &ParameterLayout,
    options: &Options,
    fit: &FrictionFit,
) -> Result<Vec<Vec<f64>>, FeasibilityError> {
    let smoothing = data.filtering.smoothing;
    if smoothing.is_none() {
        return Ok(Vec::new());
    }
    let joints = data.joints.len();
    let half = |times: &[f64]| half_resolution(times, smoothing);
    let quarter = |times: &[f64]| (half(times) / 2).max(1);
    let change = |other: FrictionData, is_shift: bool| -> Result<Vec<f64>, FeasibilityError> {
        let from = &fit.point;
        let to = moved_optimum(&other, combinations, layout, options, fit)?;
        let values = to
            .values
            .iter()
            .zip(&from.values)
            .map(|(to, from)| to - from);
        // the other columns are late as well, so that only friction tells what the shift does near reversals
        let base = if is_shift {
            combinations.labels().len()
        } else {
            0
        };
        let values = core::iter::repeat_n(0.0, base).chain(values.skip(base));
        let shapes = to.shapes.iter().zip(&from.shapes).zip(&from.laws);
        let shapes = shapes.flat_map(|((to, from), law)| {
            let pairs = to.iter().zip(from).take(law.shape_symbols().len());
            pairs.map(|(to, from)| libm::log(to / from))
        });
        Ok(values.chain(shapes).collect())
    };
    let smoother = data.with_velocities(|times, qd| smooth(qd, joints, half(times)))?;
    let smoother = change(smoother, false)?;
    let late = data.with_velocities(|times, qd| delay(qd, joints, quarter(times)))?;
    let late = change(late, true)?;
    let early = data.with_velocities(|times, qd| advance(qd, joints, quarter(times)))?;
    let early = change(early, true)?;
    Ok(vec![smoother, late, early])
}

/// Half the time that the filter of the states and differences of neighbours resolve, in samples, at least
/// one. The filter resolves half a period of its cutoff, or the half width of its window.
fn half_resolution(times: &[f64], smoothing: Smoothing) -> usize {
    let step = match times {
        [first, .., last] => (last - first) / (times.len() - 1) as f64,
        _ => return 1,
    };
    let method = match smoothing {
        Smoothing::None => return 1,
        Smoothing::Butterworth { order, cutoff } => Method::Butterworth { order, cutoff },
        Smoothing::Local { half_width } => Method::Local { half_width },
    };
    let resolved = match method.of_states(step) {
        Method::Butterworth { cutoff, .. } => 0.5 / cutoff,
        Method::Local { half_width } => half_width,
        Method::Central | Method::Fourier { .. } => return 1,
    };
    let half = (0.5 * resolved / step + 1.0)
        .round()
        .min(times.len() as f64);
    #[allow(clippy::cast_sign_loss, reason = "it is not negative")]
    let samples = half as usize;
    samples.max(1)
}

/// Averages the velocities over this many samples on either side.
fn smooth(qd: &mut [f64], joints: usize, half: usize) {
    let samples = qd.len() / joints.max(1);
    let measured = qd.to_vec();
    for joint in 0..joints {
        let of = |k: usize| measured.get(k * joints + joint).copied().unwrap_or(0.0);
        let mut sum: f64 = (0..half.min(samples)).map(of).sum();
        for k in 0..samples {
            if k + half < samples {
                sum += of(k + half);
            }
            if k > half {
                sum -= of(k - half - 1);
            }
            let count = (k + half).min(samples - 1) - k.saturating_sub(half) + 1;
            if let Some(slot) = qd.get_mut(k * joints + joint) {
                *slot = sum / count as f64;
            }
        }
    }
}

/// Makes the velocities late by this many samples; the first ones stay.
fn delay(qd: &mut [f64], joints: usize, by: usize) {
    if let Some(rest) = qd.len().checked_sub(joints * by) {
        qd.copy_within(..rest, joints * by);
    }
}

/// Makes the velocities early by this many samples; the last ones stay.
fn advance(qd: &mut [f64], joints: usize, by: usize) {
    if joints * by <= qd.len() {
        qd.copy_within(joints * by.., 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn velocities_are_averaged_and_moved_by_what_the_filter_resolves() {
        let times: Vec<f64> = (0..9).map(|k| 0.005 * f64::from(k)).collect();
        // states pass a filter of 25 Hz, which resolves 20 ms, and differences over 10 ms
        let cutoff = 25.0 / 3.0;
        let filter = Smoothing::Butterworth { order: 4, cutoff };
        assert_eq!(half_resolution(&times, filter), 3);
        let mut qd: Vec<f64> = (0..9).flat_map(|k| [f64::from(k / 4 * 10), 1.0]).collect();
        smooth(&mut qd, 2, 2);
        let first: Vec<f64> = qd.iter().copied().step_by(2).collect();
        let expected = [0.0, 0.0, 2.0, 4.0, 6.0, 8.0, 12.0, 12.5, 40.0 / 3.0];
        for (found, expected) in first.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-9, "{first:?}");
        }
        assert!(
            qd.iter()
                .skip(1)
                .step_by(2)
                .all(|v| (v - 1.0).abs() < 1e-12)
        );
        let mut late = [1, 2, 3, 4, 5, 6].map(f64::from);
        delay(&mut late, 2, 1);
        assert_eq!(
            late.map(f64::to_bits),
            [1, 2, 1, 2, 3, 4].map(|x| f64::from(x).to_bits())
        );
        advance(&mut late, 2, 2);
        assert_eq!(
            late.map(f64::to_bits),
            [3, 4, 1, 2, 3, 4].map(|x| f64::from(x).to_bits())
        );
    }
}
