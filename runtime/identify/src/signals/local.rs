//! Local regression: a cubic polynomial around each sample.

use super::{Derivatives, SignalError, nans};
use crate::qr_update::{reduce, substitute};

/// Number of coefficients of a cubic polynomial.
const TERMS: usize = 4;
/// Least number of samples of a window: one more than the coefficients.
const MIN_SAMPLES: usize = TERMS + 1;

/// Fits a polynomial around each sample; samples whose window lies within the data are valid.
pub(super) fn fit(
    half_width: f64,
    times: &[f64],
    values: &[f64],
) -> Result<Derivatives, SignalError> {
    let n = times.len();
    if !(half_width > 0.0 && half_width.is_finite()) {
        return Err(SignalError::Setting("the half width must be positive"));
    }
    let (Some(&start), Some(&end)) = (times.first(), times.last()) else {
        return Err(SignalError::TooFew {
            samples: 0,
            needed: MIN_SAMPLES,
        });
    };
    let mut out = Derivatives {
        value: nans(n),
        rate: nans(n),
        acceleration: nans(n),
        valid: 0..0,
    };
    // a window that ends at a sample includes it in spite of rounded times
    let slack = 1e-9 * half_width;
    let valid = |t: f64| t - half_width >= start - slack && t + half_width <= end + slack;
    let first = times.iter().position(|t| valid(*t)).unwrap_or(n);
    let last = times
        .iter()
        .rposition(|t| valid(*t))
        .map_or(first, |k| k + 1);
    if first == last {
        return Err(SignalError::TooFew {
            samples: n,
            needed: n + 1,
        });
    }
    let (mut low, mut high) = (0, 0);
    let mut block = Vec::new();
    let mut side = Vec::new();
    for k in first..last {
        let t = times[k];
        while times[low] < t - half_width - slack {
            low += 1;
        }
        while high < n && times[high] <= t + half_width + slack {
            high += 1;
        }
        let rows = high - low;
        block.clear();
        block.resize(TERMS * rows, 0.0);
        side.clear();
        let mut inside = 0;
        for (i, (time, x)) in times[low..high].iter().zip(&values[low..high]).enumerate() {
            let s = (time - t) / half_width;
            let tricube = (1.0 - s.abs().min(1.0).powi(3)).powi(3);
            inside += usize::from(tricube > 0.0);
            let root = tricube.sqrt();
            let mut power = root;
            for column in block.chunks_exact_mut(rows) {
                column[i] = power;
                power *= s;
            }
            side.push(root * x);
        }
        let few = SignalError::TooFew {
            samples: inside,
            needed: MIN_SAMPLES,
        };
        if inside < MIN_SAMPLES {
            return Err(few);
        }
        let (mut r, mut z) = (vec![0.0; TERMS * TERMS], vec![0.0; TERMS]);
        reduce(&mut r, &mut z, &mut block, &mut side, rows);
        let c = substitute(&r, &z).ok_or(few)?;
        out.value[k] = c[0];
        out.rate[k] = c[1] / half_width;
        out.acceleration[k] = 2.0 * c[2] / (half_width * half_width);
    }
    out.valid = first..last;
    Ok(out)
}

/// Smooths several channels: each value becomes that of the cubic polynomial around its sample.
///
/// - `values`: sample by sample, `channels` entries each.
///
/// Samples whose window does not lie within the data keep their values.
pub(super) fn smooth(
    half_width: f64,
    times: &[f64],
    values: &[f64],
    channels: usize,
) -> Result<Vec<f64>, SignalError> {
    if !(half_width > 0.0 && half_width.is_finite()) {
        return Err(SignalError::Setting("the half width must be positive"));
    }
    let mut out = values.to_vec();
    let n = times.len();
    let slack = 1e-9 * half_width;
    let (mut low, mut high) = (0, 0);
    let mut weights = Vec::new();
    for (k, slot) in out.chunks_exact_mut(channels.max(1)).enumerate() {
        let t = times[k];
        while times[low] < t - half_width - slack {
            low += 1;
        }
        while high < n && times[high] <= t + half_width + slack {
            high += 1;
        }
        if low == 0 && t - half_width < times[0] - slack
            || high == n && t + half_width > times[n - 1] + slack
        {
            continue;
        }
        kernel(half_width, t, &times[low..high], &mut weights)?;
        slot.fill(0.0);
        let samples = values[low * channels..high * channels].chunks_exact(channels);
        for (sample, weight) in samples.zip(&weights) {
            for (sum, x) in slot.iter_mut().zip(sample) {
                *sum += weight * x;
            }
        }
    }
    Ok(out)
}

/// The weight of each sample of a window in the fitted polynomial's value at `t`.
fn kernel(
    half_width: f64,
    t: f64,
    times: &[f64],
    weights: &mut Vec<f64>,
) -> Result<(), SignalError> {
    let rows = times.len();
    let mut block = vec![0.0; TERMS * rows];
    weights.clear();
    let mut inside = 0;
    for (i, time) in times.iter().enumerate() {
        let s = (time - t) / half_width;
        let tricube = (1.0 - s.abs().min(1.0).powi(3)).powi(3);
        inside += usize::from(tricube > 0.0);
        let root = tricube.sqrt();
        let mut power = root;
        for column in block.chunks_exact_mut(rows) {
            column[i] = power;
            power *= s;
        }
        weights.push(tricube);
    }
    let few = SignalError::TooFew {
        samples: inside,
        needed: MIN_SAMPLES,
    };
    if inside < MIN_SAMPLES {
        return Err(few);
    }
    let (mut r, mut z) = (vec![0.0; TERMS * TERMS], vec![0.0; TERMS]);
    reduce(&mut r, &mut z, &mut block, &mut vec![0.0; rows], rows);
    // the polynomial's constant is e_1^T (R^T R)^-1 X^T y: solve R^T u = e_1, then R a = u
    let mut u = [0.0; TERMS];
    for k in 0..TERMS {
        let before: f64 = (0..k).map(|i| r[k * TERMS + i] * u[i]).sum();
        let side = if k == 0 { 1.0 } else { 0.0 };
        u[k] = (side - before) / r[k * TERMS + k];
    }
    let a = substitute(&r, &u).ok_or(few)?;
    for (weight, time) in weights.iter_mut().zip(times) {
        let s = (time - t) / half_width;
        *weight *= a.iter().rev().fold(0.0, |sum, c| sum * s + c);
    }
    Ok(())
}
