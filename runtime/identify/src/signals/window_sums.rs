//! Weighted sums of many channels over windows of samples, in vector registers.
//!
//! Each sum has the operations of one window and channel alone, in the same order, so that the results
//! have the same bits however many are formed at a time.
#![allow(
    clippy::inline_always,
    reason = "a function that is not inlined is compiled without the token's instruction set"
)]

use pulp::Simd;

/// Windows whose sums are formed at a time: each sample is read once for them.
const TILE: usize = 4;

/// Sums of the channels of windows of equally many samples, each window one sample later than the one
/// before: `sum_k weights[k, window] values[window + k]`.
#[derive(Clone, Copy)]
pub(super) struct WindowSums<'a, S> {
    pub(super) simd: S,
    /// From the first sample of the first window on, `channels` entries each.
    pub(super) values: &'a [f64],
    pub(super) channels: usize,
    /// For each sample of a window its weights, `stride` entries of which the first are of the windows.
    pub(super) weights: &'a [f64],
    pub(super) stride: usize,
}

impl<S: Simd> WindowSums<'_, S> {
    /// Writes the sums of the windows one after the other; there are as many as `out` has room for.
    #[inline(always)]
    pub(super) fn write(self, out: &mut [f64]) {
        for (tile, out) in out.chunks_mut(TILE * self.channels).enumerate() {
            if out.len() == TILE * self.channels {
                self.windows::<TILE>(tile * TILE, out);
                continue;
            }
            for (window, out) in out.chunks_exact_mut(self.channels).enumerate() {
                self.windows::<1>(tile * TILE + window, out);
            }
        }
    }

    /// The sums of some windows from `first` on.
    #[inline(always)]
    fn windows<const WINDOWS: usize>(self, first: usize, out: &mut [f64]) {
        let lanes = self.channels / S::F64_LANES;
        // as many sums at a time as there are registers for
        let most = if WINDOWS == 1 || S::F64_LANES >= 8 {
            5
        } else {
            3
        };
        let mut register = 0;
        while register < lanes {
            let at = register * S::F64_LANES;
            register += match most.min(lanes - register) {
                5 => self.registers::<WINDOWS, 5>(first, at, out),
                3.. => self.registers::<WINDOWS, 3>(first, at, out),
                _ => self.registers::<WINDOWS, 1>(first, at, out),
            };
        }
        if lanes * S::F64_LANES < self.channels {
            self.rest::<WINDOWS>(first, lanes * S::F64_LANES, out);
        }
    }

    /// The samples of some windows from `first` on, each with its values.
    #[inline(always)]
    fn samples(&self, first: usize, windows: usize) -> impl Iterator<Item = (usize, &[f64])> {
        let from = self.values.get(first * self.channels..).unwrap_or_default();
        let count = self.weights.len() / self.stride + windows - 1;
        from.chunks_exact(self.channels).take(count).enumerate()
    }

    /// The weight of a sample, counted from the first of these windows, in one of them; `None` if it is
    /// not in that window.
    #[inline(always)]
    fn weight(&self, first: usize, sample: usize, window: usize) -> Option<S::f64s> {
        let own = sample.checked_sub(window)?;
        let weight = self.weights.get(own * self.stride + first + window)?;
        Some(self.simd.splat_f64s(*weight))
    }

    /// The sums of the channels in some registers from `at` on; returns how many registers.
    #[inline(always)]
    fn registers<const WINDOWS: usize, const REGISTERS: usize>(
        self,
        first: usize,
        at: usize,
        out: &mut [f64],
    ) -> usize {
        let simd = self.simd;
        let width = REGISTERS * S::F64_LANES;
        let mut sums = [[simd.splat_f64s(0.0); REGISTERS]; WINDOWS];
        for (sample, values) in self.samples(first, WINDOWS) {
            // read once for all windows
            let mut own = [simd.splat_f64s(0.0); REGISTERS];
            own.copy_from_slice(S::as_simd_f64s(&values[at..at + width]).0);
            for (window, sums) in sums.iter_mut().enumerate() {
                if let Some(weight) = self.weight(first, sample, window) {
                    for (sum, x) in sums.iter_mut().zip(&own) {
                        *sum = simd.add_f64s(*sum, simd.mul_f64s(weight, *x));
                    }
                }
            }
        }
        for (out, sums) in out.chunks_exact_mut(self.channels).zip(sums) {
            let (slots, _) = S::as_mut_simd_f64s(&mut out[at..at + width]);
            slots.copy_from_slice(&sums);
        }
        REGISTERS
    }

    /// The sums of the channels from `at` on, which do not fill a register.
    #[inline(always)]
    fn rest<const WINDOWS: usize>(self, first: usize, at: usize, out: &mut [f64]) {
        let simd = self.simd;
        let mut sums = [simd.splat_f64s(0.0); WINDOWS];
        for (sample, values) in self.samples(first, WINDOWS) {
            let own = simd.partial_load_f64s(&values[at..]);
            for (window, sum) in sums.iter_mut().enumerate() {
                if let Some(weight) = self.weight(first, sample, window) {
                    *sum = simd.add_f64s(*sum, simd.mul_f64s(weight, own));
                }
            }
        }
        for (out, sum) in out.chunks_exact_mut(self.channels).zip(sums) {
            simd.partial_store_f64s(&mut out[at..], sum);
        }
    }
}

#[cfg(test)]
mod tests {
    use pulp::{Arch, WithSimd};

    use super::*;

    /// Sums with weights that depend on the sample and the window, as a task for the machine's
    /// instruction set.
    struct Task<'a> {
        values: &'a [f64],
        channels: usize,
        weights: &'a [f64],
        stride: usize,
        out: &'a mut [f64],
    }

    fn weight(sample: usize, window: usize) -> f64 {
        (1.0 + sample as f64 * 0.7 + window as f64 * 1.3).sin()
    }

    impl WithSimd for Task<'_> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            WindowSums {
                simd,
                values: self.values,
                channels: self.channels,
                weights: self.weights,
                stride: self.stride,
            }
            .write(self.out);
        }
    }

    #[test]
    fn sums_of_any_number_of_windows_and_channels_have_the_bits_of_one_after_the_other() {
        let samples = 7;
        for windows in 1..=9 {
            // more weights than there are windows, as of lanes of a register
            let stride = windows + windows % 2;
            let at = |k: usize| weight(k / stride, k % stride);
            let weights: Vec<f64> = (0..samples * stride).map(at).collect();
            for channels in [1, 3, 7, 8, 23, 24, 41, 81] {
                let count = (samples + windows - 1) * channels;
                let values: Vec<f64> = (0..count).map(|k| (0.37 * k as f64).cos()).collect();
                let mut out = vec![f64::NAN; windows * channels];
                Arch::new().dispatch(Task {
                    values: &values,
                    channels,
                    weights: &weights,
                    stride,
                    out: &mut out,
                });
                for (at, found) in out.iter().enumerate() {
                    let (window, channel) = (at / channels, at % channels);
                    let mut sum = 0.0;
                    for sample in 0..samples {
                        let value = values[(window + sample) * channels + channel];
                        sum += weight(sample, window) * value;
                    }
                    assert_eq!(
                        found.to_bits(),
                        f64::to_bits(sum),
                        "{windows} {channels} {at}"
                    );
                }
            }
        }
    }
}
