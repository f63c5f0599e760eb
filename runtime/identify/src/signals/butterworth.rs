//! The digital Butterworth low-pass filter, run forward and backward.

#![allow(
    clippy::inline_always,
    reason = "a function that is not inlined is compiled without the token's instruction set"
)]

use std::f64::consts::PI;

use pulp::Arch;

use super::SignalError;

/// The part of an initial error to which the filter has decayed once it counts as settled.
const SETTLED_PART: f64 = 1e-3;
/// The part of a sample to which its effect has decayed once it counts as rounding.
const FORGOTTEN_PART: f64 = 1e-16;

/// A filter section of order two (or one, where the last coefficients are 0): numerator
/// `b[0] + b[1] z^-1 + b[2] z^-2`, denominator `1 + a[0] z^-1 + a[1] z^-2`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Section {
    b: [f64; 3],
    a: [f64; 2],
}

/// A digital low-pass Butterworth filter in second-order sections, by the bilinear transformation
/// with a prewarped cutoff frequency.
///
/// ```
/// use regen_identify::signals::Butterworth;
///
/// let filter = Butterworth::new(4, 10.0, 0.001)?;
/// let constant = filter.zero_phase(&[2.0; 100])?;
/// assert!(constant.iter().all(|x| (x - 2.0).abs() < 1e-12));
/// # Ok::<(), regen_identify::signals::SignalError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Butterworth {
    order: usize,
    sections: Vec<Section>,
    /// The magnitude of the slowest pole.
    slowest: f64,
}

impl Butterworth {
    /// Designs a filter.
    ///
    /// - `cutoff`: the cutoff frequency of one pass (-3 dB), Hz; `step`: the time between samples,
    ///   s.
    ///
    /// # Errors
    /// When the order is not 1 to 20, or the cutoff is not between 0 and half the sampling rate.
    pub fn new(order: usize, cutoff: f64, step: f64) -> Result<Self, SignalError> {
        if !(1..=20).contains(&order) {
            return Err(SignalError::Setting("the filter's order must be 1 to 20"));
        }
        if !(cutoff > 0.0 && step > 0.0 && cutoff * step < 0.5) {
            return Err(SignalError::Cutoff {
                cutoff,
                most: 0.5 / step,
            });
        }
        // analogue poles w (-sin, +-cos)(angle), z = (2 + s) / (2 - s) with s in units of 1/step
        let w = 2.0 * libm::tan(PI * cutoff * step);
        let mut sections = Vec::new();
        let mut slowest = 0.0_f64;
        if order % 2 == 1 {
            let pole = (2.0 - w) / (2.0 + w);
            slowest = slowest.max(pole.abs());
            let gain = w / (2.0 + w);
            sections.push(Section {
                b: [gain, gain, 0.0],
                a: [-pole, 0.0],
            });
        }
        for k in 0..order / 2 {
            let angle = PI * (2 * k + 1) as f64 / (2 * order) as f64;
            let damping = 2.0 * libm::sin(angle);
            // (4 + 2 d w + w^2) + 2 (w^2 - 4) z^-1 + (4 - 2 d w + w^2) z^-2
            let lead = 4.0 + 2.0 * damping * w + w * w;
            let a = [
                2.0 * (w * w - 4.0) / lead,
                (4.0 - 2.0 * damping * w + w * w) / lead,
            ];
            slowest = slowest.max(a[1].sqrt());
            let gain = w * w / lead;
            sections.push(Section {
                b: [gain, 2.0 * gain, gain],
                a,
            });
        }
        Ok(Self {
            order,
            sections,
            slowest,
        })
    }

    /// Filters forward and backward, so that the signal is not delayed; both passes together have
    /// twice the order.
    ///
    /// Both ends are extended by 3 (order + 1) samples, mirrored at the end point, and each
    /// pass starts in the steady state of its first sample.
    ///
    /// # Errors
    /// When there are not more samples than one such extension has.
    pub fn zero_phase(&self, values: &[f64]) -> Result<Vec<f64>, SignalError> {
        let mut all = values.to_vec();
        self.zero_phase_channels(&mut all, 1)?;
        Ok(all)
    }

    /// [`zero_phase`](Self::zero_phase) of several channels at once, in place.
    ///
    /// - `values`: sample by sample, `channels` entries each.
    pub(super) fn zero_phase_channels(
        &self,
        values: &mut [f64],
        channels: usize,
    ) -> Result<(), SignalError> {
        let edge = 3 * (self.order + 1);
        let n = values.len() / channels.max(1);
        if n <= edge {
            return Err(SignalError::TooFew {
                samples: n,
                needed: edge + 1,
            });
        }
        let mut all = Vec::with_capacity((n + 2 * edge) * channels);
        let mirrored = |all: &mut Vec<f64>, end: usize, other: usize| {
            let (end, other) = (end * channels, other * channels);
            all.extend((0..channels).map(|c| 2.0 * values[end + c] - values[other + c]));
        };
        for k in (1..=edge).rev() {
            mirrored(&mut all, 0, k);
        }
        all.extend_from_slice(values);
        for k in 1..=edge {
            mirrored(&mut all, n - 1, n - 1 - k);
        }
        self.pass(all.chunks_exact_mut(channels), channels);
        self.pass(all.chunks_exact_mut(channels).rev(), channels);
        values.copy_from_slice(&all[edge * channels..(edge + n) * channels]);
        Ok(())
    }

    /// Runs the filter once over samples of several channels, from the steady state of the first
    /// sample.
    fn pass<'v>(&self, samples: impl Iterator<Item = &'v mut [f64]>, channels: usize) {
        Arch::new().dispatch(
            #[inline(always)]
            || self.pass_in(samples, channels),
        );
    }

    /// [`pass`](Self::pass), compiled for each set of instructions.
    #[inline(always)]
    fn pass_in<'v>(&self, samples: impl Iterator<Item = &'v mut [f64]>, channels: usize) {
        // by section: the two states of direct form 2 transposed, of all channels
        let mut states: Vec<(Vec<f64>, Vec<f64>)> = Vec::with_capacity(self.sections.len());
        for sample in samples {
            if states.is_empty() {
                for Section { b, a } in &self.sections {
                    // each section has gain 1 for a constant
                    let second: Vec<f64> = sample.iter().map(|x| (b[2] - a[1]) * x).collect();
                    let pairs = sample.iter().zip(&second);
                    let first = pairs.map(|(x, s)| (b[1] - a[0]) * x + s).collect();
                    states.push((first, second));
                }
            }
            for (Section { b, a }, (first, second)) in self.sections.iter().zip(&mut states) {
                let (first, second) = (&mut first[..channels], &mut second[..channels]);
                for ((x, first), second) in sample.iter_mut().zip(first).zip(second) {
                    let input = *x;
                    let y = b[0].mul_add(input, *first);
                    *first = b[1] * input - a[0] * y + *second;
                    *second = b[2] * input - a[1] * y;
                    *x = y;
                }
            }
        }
    }

    /// The number of samples after which a sample has no effect, to rounding.
    pub fn support(&self) -> usize {
        self.reach(FORGOTTEN_PART)
    }

    /// The number of samples at either end that the filter's initial state dominates.
    pub fn settling(&self) -> usize {
        self.reach(SETTLED_PART)
    }

    /// The number of samples after which the filter's response has decayed to this part.
    fn reach(&self, part: f64) -> usize {
        if self.slowest <= 0.0 {
            return 3 * (self.order + 1);
        }
        // two passes and poles of equal magnitude make the decay slightly slower than the pole's
        let samples = 1.2 * part.ln() / self.slowest.ln();
        #[allow(clippy::cast_sign_loss, reason = "both logarithms are negative")]
        let samples = samples.ceil() as usize;
        samples + 3 * (self.order + 1)
    }
}
