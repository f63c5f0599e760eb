//! Local regression: a cubic polynomial around each sample.
#![allow(
    clippy::inline_always,
    reason = "a function that is not inlined is compiled without the token's instruction set"
)]

use core::ops::Range;

use pulp::{Arch, Simd, WithSimd, bytemuck};

use super::window_sums::WindowSums;
use super::windows::{Bounds, Windows, are_alike};
use super::{Derivatives, SignalError, nans};
use crate::qr_update::{reduce, substitute};

/// Number of coefficients of a cubic polynomial.
pub(super) const TERMS: usize = 4;
/// Least number of samples of a window: one more than the coefficients.
pub(super) const MIN_SAMPLES: usize = TERMS + 1;

/// Fits a polynomial around each sample of each series; samples whose window lies within the data
/// are valid.
pub(super) fn fit(
    half_width: f64,
    times: &[f64],
    series: &[&[f64]],
) -> Result<Vec<Derivatives>, SignalError> {
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
    let empty = |_: &&[f64]| Derivatives {
        value: nans(n),
        rate: nans(n),
        acceleration: nans(n),
        valid: first..last,
    };
    let mut out: Vec<Derivatives> = series.iter().map(empty).collect();
    let task = Fit {
        half_width,
        times,
        series,
        bounds: &bounds(half_width, times, first..last),
        first,
        out: &mut out,
    };
    Arch::new().dispatch(task)?;
    Ok(out)
}

/// The samples in the window of each of these samples.
fn bounds(half_width: f64, times: &[f64], samples: Range<usize>) -> Vec<Bounds> {
    let n = times.len();
    let slack = 1e-9 * half_width;
    let (mut low, mut high) = (0, 0);
    let window = |k: usize| {
        let t = times[k];
        while times[low] < t - half_width - slack {
            low += 1;
        }
        while high < n && times[high] <= t + half_width + slack {
            high += 1;
        }
        (low, high)
    };
    samples.map(window).collect()
}

/// The polynomials of consecutive samples as a task for one instruction set. All series have the same
/// windows, whose columns are reduced once.
struct Fit<'a> {
    half_width: f64,
    times: &'a [f64],
    series: &'a [&'a [f64]],
    bounds: &'a [Bounds],
    /// The sample that the first window belongs to.
    first: usize,
    out: &'a mut [Derivatives],
}

impl WithSimd for Fit<'_> {
    type Output = Result<(), SignalError>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Fit {
            half_width, times, ..
        } = self;
        let set = |out: &mut Derivatives, k: usize, c: [f64; TERMS]| {
            out.value[k] = c[0];
            out.rate[k] = c[1] / half_width;
            out.acceleration[k] = 2.0 * c[2] / (half_width * half_width);
        };
        let mut windows = Windows::new(simd, half_width);
        for (group, bounds) in self.bounds.chunks(S::F64_LANES).enumerate() {
            let k = self.first + group * S::F64_LANES;
            let alike = bounds.len() == S::F64_LANES
                && are_alike(bounds)
                && windows.fill(times, k, bounds[0])
                && windows.reduce();
            for (values, out) in self.series.iter().zip(&mut *self.out) {
                if alike {
                    let c = windows.coefficients(values, bounds[0].0);
                    for lane in 0..S::F64_LANES {
                        set(out, k + lane, c.map(|c| Windows::<S>::lanes(&c)[lane]));
                    }
                    continue;
                }
                for (k, bounds) in (k..).zip(bounds) {
                    set(out, k, coefficients(half_width, times, values, k, *bounds)?);
                }
            }
        }
        Ok(())
    }
}

/// The coefficients of the polynomial around sample `k`.
fn coefficients(
    half_width: f64,
    times: &[f64],
    values: &[f64],
    k: usize,
    (low, high): Bounds,
) -> Result<[f64; TERMS], SignalError> {
    let (t, rows) = (times[k], high - low);
    let mut block = vec![0.0; TERMS * rows];
    let mut side = Vec::with_capacity(rows);
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
    let c = substitute(&r, &z).ok_or(few.clone())?;
    c.try_into().map_err(|_| few)
}

/// Smooths several channels: each value becomes that of the cubic polynomial around its sample.
///
/// - `values`: sample by sample, `channels` entries each; `out`: as many entries.
///
/// Samples whose window does not lie within the data keep their values.
pub(super) fn smooth(
    half_width: f64,
    times: &[f64],
    values: &[f64],
    channels: usize,
    out: &mut [f64],
) -> Result<(), SignalError> {
    if !(half_width > 0.0 && half_width.is_finite()) {
        return Err(SignalError::Setting("the half width must be positive"));
    }
    let (Some(start), Some(end)) = (times.first(), times.last()) else {
        return Ok(());
    };
    let bounds = bounds(half_width, times, 0..times.len());
    let slack = 1e-9 * half_width;
    let cut = |k: usize| {
        bounds[k].0 == 0 && times[k] - half_width < start - slack
            || bounds[k].1 == times.len() && times[k] + half_width > end + slack
    };
    // only windows at both ends are cut off by them
    let first = (0..times.len()).find(|k| !cut(*k)).unwrap_or(times.len());
    let last = (first..times.len()).rfind(|k| !cut(*k));
    let last = last.map_or(first, |k| k + 1);
    for kept in [0..first * channels, last * channels..values.len()] {
        if let (Some(out), Some(values)) = (out.get_mut(kept.clone()), values.get(kept)) {
            out.copy_from_slice(values);
        }
    }
    let task = Smooth {
        half_width,
        times,
        values,
        channels,
        bounds: bounds.get(first..last).unwrap_or_default(),
        first,
        out,
    };
    Arch::new().dispatch(task)
}

/// The smoothing of consecutive samples as a task for one instruction set.
struct Smooth<'a> {
    half_width: f64,
    times: &'a [f64],
    values: &'a [f64],
    channels: usize,
    bounds: &'a [Bounds],
    /// The sample that the first window belongs to.
    first: usize,
    out: &'a mut [f64],
}

impl WithSimd for Smooth<'_> {
    type Output = Result<(), SignalError>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Smooth {
            half_width,
            times,
            values,
            channels,
            first,
            out,
            ..
        } = self;
        let mut windows = Windows::new(simd, half_width);
        let mut side_by_side = Vec::new();
        let mut weights = Vec::new();
        for (group, bounds) in self.bounds.chunks(S::F64_LANES).enumerate() {
            let k = first + group * S::F64_LANES;
            let alike = bounds.len() == S::F64_LANES
                && are_alike(bounds)
                && windows.fill(times, k, bounds[0])
                && windows.reduce();
            if alike {
                windows.weights(&mut side_by_side);
                WindowSums {
                    simd,
                    values: &values[bounds[0].0 * channels..],
                    channels,
                    weights: bytemuck::cast_slice::<S::f64s, f64>(&side_by_side),
                    stride: S::F64_LANES,
                }
                .write(&mut out[k * channels..(k + bounds.len()) * channels]);
                continue;
            }
            for (k, (low, high)) in (k..).zip(bounds) {
                kernel(half_width, times[k], &times[*low..*high], &mut weights)?;
                WindowSums {
                    simd,
                    values: &values[low * channels..high * channels],
                    channels,
                    weights: &weights,
                    stride: 1,
                }
                .write(&mut out[k * channels..(k + 1) * channels]);
            }
        }
        Ok(())
    }
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
