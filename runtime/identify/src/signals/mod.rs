//! Velocities and accelerations from sampled positions (section 5.1).
//!
//! Four methods with one interface: central differences (Eq. 31), differences of positions after
//! a zero-phase Butterworth filter (Gautier et al., 1995), a fitted finite Fourier series with its
//! analytic derivatives (Eq. 25; Swevers et al., 1996), and local cubic regression (Page et al.,
//! 2006).

mod butterworth;
mod fourier;
mod local;
mod repetition;
mod smoothing;
mod window_sums;
mod windows;

use core::fmt;
use core::ops::Range;

pub use butterworth::Butterworth;
pub use fourier::{Fourier, FourierFit};
pub use repetition::Repetition;
pub(crate) use repetition::{Sampled, fitting_series};
pub use smoothing::Smoothing;

/// How positions are differentiated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Central differences of the unfiltered positions (Eq. 31), for any sampling. When a log is
    /// read, positions whose noise is small against the truncation error of these differences are
    /// differentiated over two or three neighbours on either side, see [`differences`].
    Central,
    /// A low-pass Butterworth filter run forward and backward, then central differences. Needs
    /// uniform sampling.
    Butterworth {
        /// The filter's order.
        order: usize,
        /// The cutoff frequency of one pass (-3 dB), Hz.
        cutoff: f64,
    },
    /// The finite Fourier series (Eq. 25) fitted by least squares, for any sampling.
    Fourier {
        /// The fundamental frequency, Hz.
        frequency: f64,
        /// The number of harmonics.
        harmonics: usize,
    },
    /// A cubic polynomial fitted around each sample with tricube weights, for any sampling.
    Local {
        /// The half width of the window around each sample, s.
        half_width: f64,
    },
}

/// Ratio of the cutoff frequency of the states' filter to that of the equations' filter.
pub const WIDER: f64 = 3.0;
/// The lowest order of the filter of states: one of the second order takes 1.2 percent off a motion at the
/// equations' cutoff, this one 0.015 percent.
const MIN_STATES_ORDER: usize = 4;
/// The highest cutoff frequency of a filter of states over the sampling rate.
const MAX_CUTOFF_RATIO: f64 = 0.4;
/// The smallest half width of a local regression over states, in samples.
const MIN_HALF_WIDTH_SAMPLES: f64 = 4.0;

/// A smoothed signal and its derivatives; each list has one entry for each sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Derivatives {
    /// The signal, smoothed by the method.
    pub value: Vec<f64>,
    /// The first derivative of the signal, per s.
    pub rate: Vec<f64>,
    /// The second derivative of the signal, per s^2.
    pub acceleration: Vec<f64>,
    /// The samples that have enough neighbours for the method on both sides; the entries of other
    /// samples must not be used.
    pub valid: Range<usize>,
}

/// Error of differentiating or filtering a signal.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum SignalError {
    /// The lists of times and values have different lengths.
    Length {
        /// The number of times.
        times: usize,
        /// The number of values.
        values: usize,
    },
    /// A time or a value is NaN or infinite.
    NotFinite {
        /// The index of the sample.
        sample: usize,
    },
    /// A time is not after the one before.
    NotIncreasing {
        /// The index of the sample.
        sample: usize,
    },
    /// A time step differs from the mean step by more than a tenth.
    NotUniform {
        /// The index of the sample at the end of the step.
        sample: usize,
        /// The step, s.
        step: f64,
        /// The mean step, s.
        mean: f64,
    },
    /// There are too few samples for the method.
    TooFew {
        /// The number of samples, in all or in a window.
        samples: usize,
        /// The number of samples that the method needs there.
        needed: usize,
    },
    /// The filter's cutoff frequency is not between 0 and half the sampling rate.
    Cutoff {
        /// The cutoff frequency, Hz.
        cutoff: f64,
        /// Half the sampling rate, Hz.
        most: f64,
    },
    /// A setting is out of its range; the text names it.
    Setting(&'static str),
}

impl fmt::Display for SignalError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Length { times, values } => {
                write!(f, "{times} times but {values} values")
            }
            Self::NotFinite { sample } => write!(f, "sample {sample} is not finite"),
            Self::NotIncreasing { sample } => {
                write!(f, "the time of sample {sample} is not after the one before")
            }
            Self::NotUniform { sample, step, mean } => write!(
                f,
                "the step of {step} s before sample {sample} is not the usual {mean} s: the \
                 Butterworth filter needs uniform sampling, onto which rows can be resampled; local \
                 regression and Fourier series do not"
            ),
            Self::TooFew { samples, needed } => write!(
                f,
                "{samples} samples where the method needs {needed}: give a longer log or a wider \
                 window"
            ),
            Self::Cutoff { cutoff, most } => write!(
                f,
                "the cutoff of {cutoff} Hz must be above 0 and below half the sampling rate, \
                 {} Hz",
                // rounded, as the sampling rate is computed from measured times
                (most * 1e6).round() / 1e6
            ),
            Self::Setting(what) => f.write_str(what),
        }
    }
}

impl core::error::Error for SignalError {}

impl Method {
    /// Smooths a signal and computes its first and second derivative.
    ///
    /// - `times`: s, increasing; `values`: one for each time.
    ///
    /// # Errors
    /// When the lengths differ, the times do not increase, or the method needs more samples or
    /// uniform ones.
    ///
    /// ```
    /// use regen_identify::signals::Method;
    ///
    /// let times: Vec<f64> = (0..100).map(|k| 0.01 * f64::from(k)).collect();
    /// let cubic: Vec<f64> = times.iter().map(|t| t * t * t).collect();
    /// let fit = Method::Local { half_width: 0.08 }.differentiate(&times, &cubic)?;
    /// assert_eq!(fit.valid, 8..92);
    /// assert!((fit.rate[50] - 3.0 * 0.25).abs() < 1e-12);
    /// assert!((fit.acceleration[50] - 6.0 * 0.5).abs() < 1e-9);
    /// # Ok::<(), regen_identify::signals::SignalError>(())
    /// ```
    pub fn differentiate(&self, times: &[f64], values: &[f64]) -> Result<Derivatives, SignalError> {
        check(times, values)?;
        match *self {
            Self::Central => differences(times, values, 1),
            Self::Butterworth { order, cutoff } => {
                let filter = Butterworth::new(order, cutoff, mean_step(times)?)?;
                // filtered samples have little noise: more neighbours reduce the truncation error
                let mut out = differences(times, &filter.zero_phase(values)?, NEIGHBOURS)?;
                let margin = filter.settling().min(times.len() / 2);
                // at both ends the filter's initial state is guessed, so its output is not valid
                out.valid = out.valid.start.max(margin)..out.valid.end.min(times.len() - margin);
                Ok(out)
            }
            Self::Fourier {
                frequency,
                harmonics,
            } => {
                let mut fit = FourierFit::new(frequency, harmonics, 1)?;
                for (t, x) in times.iter().zip(values) {
                    fit.push(*t, &[*x])?;
                }
                let series = fit.finish()?;
                let at: Vec<[f64; 3]> = times.iter().map(|t| series.at(0, *t)).collect();
                Ok(Derivatives {
                    value: at.iter().map(|p| p[0]).collect(),
                    rate: at.iter().map(|p| p[1]).collect(),
                    acceleration: at.iter().map(|p| p[2]).collect(),
                    valid: 0..times.len(),
                })
            }
            Self::Local { .. } => {
                let mut of_all = self.differentiate_all(times, &[values])?;
                of_all.pop().ok_or(SignalError::TooFew {
                    samples: 0,
                    needed: 1,
                })
            }
        }
    }

    /// As [`differentiate`](Self::differentiate) for several signals with the same times; where a
    /// polynomial is fitted around each sample, the work that depends on the times is done once.
    ///
    /// # Errors
    /// As [`differentiate`](Self::differentiate), for the first signal that has one.
    ///
    /// ```
    /// use regen_identify::signals::Method;
    ///
    /// let times: Vec<f64> = (0..100).map(|k| 0.01 * f64::from(k)).collect();
    /// let squares: Vec<f64> = times.iter().map(|t| t * t).collect();
    /// let method = Method::Local { half_width: 0.08 };
    /// let both = method.differentiate_all(&times, &[&times, &squares])?;
    /// assert!((both[1].acceleration[50] - 2.0).abs() < 1e-9);
    /// assert!((both[0].rate[50] - 1.0).abs() < 1e-12);
    /// # Ok::<(), regen_identify::signals::SignalError>(())
    /// ```
    pub fn differentiate_all(
        &self,
        times: &[f64],
        signals: &[&[f64]],
    ) -> Result<Vec<Derivatives>, SignalError> {
        if let Self::Local { half_width } = *self {
            for values in signals {
                check(times, values)?;
            }
            return local::fit(half_width, times, signals);
        }
        let each = signals.iter();
        each.map(|values| self.differentiate(times, values))
            .collect()
    }

    /// The filter that is applied to the efforts and to the columns of the regressor with this
    /// method: none with a Fourier series and with central differences.
    pub fn smoothing(&self) -> Smoothing {
        match *self {
            Self::Butterworth { order, cutoff } => Smoothing::Butterworth { order, cutoff },
            Self::Local { half_width } => Smoothing::Local { half_width },
            Self::Central | Self::Fourier { .. } => Smoothing::None,
        }
    }

    /// The method that computes the states of the regressor, where the equations are filtered by
    /// [`smoothing`](Self::smoothing) afterwards.
    ///
    /// A filter changes the motion that it smooths, and a regressor of a changed motion is
    /// biased: products and signs of filtered states are not the filtered products and signs. So
    /// the states pass a filter with [`WIDER`] times the cutoff frequency, which does not change
    /// the motion and removes noise of far higher frequency; the filter of the equations removes
    /// the rest of the noise (Gautier's parallel filtering and decimation).
    ///
    /// - `step`: the time between samples, s.
    ///
    /// ```
    /// use regen_identify::signals::Method;
    ///
    /// let asked = Method::Butterworth { order: 4, cutoff: 5.0 };
    /// assert_eq!(asked.of_states(0.01), Method::Butterworth { order: 4, cutoff: 15.0 });
    /// // a filter of lower order would bend the motion at the equations' cutoff
    /// let low = Method::Butterworth { order: 2, cutoff: 5.0 };
    /// assert_eq!(low.of_states(0.01), Method::Butterworth { order: 4, cutoff: 15.0 });
    /// // a series averages the noise away and needs no filter
    /// let series = Method::Fourier { frequency: 0.1, harmonics: 5 };
    /// assert_eq!(series.of_states(0.01), series);
    /// ```
    #[must_use]
    pub fn of_states(&self, step: f64) -> Self {
        match *self {
            Self::Butterworth { order, cutoff } => Self::Butterworth {
                order: order.max(MIN_STATES_ORDER),
                cutoff: (WIDER * cutoff).min(MAX_CUTOFF_RATIO / step).max(cutoff),
            },
            Self::Local { half_width } => Self::Local {
                half_width: (half_width / WIDER)
                    .max(MIN_HALF_WIDTH_SAMPLES * step)
                    .min(half_width),
            },
            Self::Central | Self::Fourier { .. } => *self,
        }
    }

    /// The number of samples on either side that a result depends on, to rounding; `None` if it
    /// depends on all.
    ///
    /// - `step`: the time between samples, s.
    ///
    /// # Errors
    /// When the method's settings do not fit the step.
    pub fn support(&self, step: f64) -> Result<Option<usize>, SignalError> {
        Ok(match *self {
            Self::Central => Some(1),
            Self::Butterworth { order, cutoff } => {
                let support = Butterworth::new(order, cutoff, step)?.support();
                Some(support.saturating_add(NEIGHBOURS))
            }
            Self::Fourier { .. } => None,
            Self::Local { half_width } => {
                #[allow(clippy::cast_sign_loss, reason = "a negative width gives 0")]
                let samples = (half_width / step).ceil() as usize;
                Some(samples.saturating_add(1))
            }
        })
    }

    /// The standard deviation of the first derivative, in 1/s, where the samples have white noise
    /// of standard deviation 1; 0 for a series, which averages over all samples.
    ///
    /// - `step`: the time between samples, s.
    ///
    /// # Errors
    /// When the method's settings do not fit the step.
    ///
    /// ```
    /// use regen_identify::signals::Method;
    ///
    /// // half the difference of two values that are 2 h apart
    /// let gain = Method::Central.rate_gain(0.01)?;
    /// assert!((gain - 0.5_f64.sqrt() / 0.01).abs() < 1e-9);
    /// assert!(Method::Butterworth { order: 4, cutoff: 5.0 }.rate_gain(0.01)? < 0.3 * gain);
    /// # Ok::<(), regen_identify::signals::SignalError>(())
    /// ```
    pub fn rate_gain(&self, step: f64) -> Result<f64, SignalError> {
        Ok(self.gains(step)?[0])
    }

    /// The standard deviations of the first and the second derivative where the samples have white
    /// noise of standard deviation 1; 0 for a series. See [`rate_gain`](Self::rate_gain).
    pub(crate) fn gains(&self, step: f64) -> Result<[f64; 2], SignalError> {
        let Some(support) = self.support(step)? else {
            return Ok([0.0; 2]);
        };
        if support > MAX_RESPONSE {
            return Err(LONG_RESPONSE);
        }
        // the response to a single sample of size 1
        let side = support + 2;
        let times: Vec<f64> = (0..=2 * side).map(|k| k as f64 * step).collect();
        let mut impulse = vec![0.0; times.len()];
        impulse[side] = 1.0;
        let response = self.differentiate(&times, &impulse)?;
        let size = |values: &[f64]| {
            let finite = values.iter().filter(|x| x.is_finite());
            finite.map(|x| x * x).sum::<f64>().sqrt()
        };
        Ok([size(&response.rate), size(&response.acceleration)])
    }
}

/// The largest number of samples on either side of one, for its effect to be computed.
const MAX_RESPONSE: usize = 1 << 24;
/// What is told beyond.
const LONG_RESPONSE: SignalError =
    SignalError::Setting("a filter must not reach over more than 16 million samples");

fn check(times: &[f64], values: &[f64]) -> Result<(), SignalError> {
    if times.len() != values.len() {
        return Err(SignalError::Length {
            times: times.len(),
            values: values.len(),
        });
    }
    let finite = |(t, x): (&f64, &f64)| t.is_finite() && x.is_finite();
    if let Some(sample) = times.iter().zip(values).position(|pair| !finite(pair)) {
        return Err(SignalError::NotFinite { sample });
    }
    match times.windows(2).position(|pair| pair[1] <= pair[0]) {
        Some(before) => Err(SignalError::NotIncreasing { sample: before + 1 }),
        None => Ok(()),
    }
}

/// The largest difference of a step from the mean step, as a part of it, at which sampling counts
/// as uniform: the times of a real clock jitter.
const MAX_JITTER: f64 = 0.1;

fn mean_step(times: &[f64]) -> Result<f64, SignalError> {
    let (Some(first), Some(last), true) = (times.first(), times.last(), times.len() > 1) else {
        return Err(SignalError::TooFew {
            samples: times.len(),
            needed: 2,
        });
    };
    let mean = (last - first) / (times.len().max(2) - 1) as f64;
    let step = |pair: &[f64]| pair[1] - pair[0];
    let off = |pair: &[f64]| (step(pair) - mean).abs() > MAX_JITTER * mean;
    match times.windows(2).position(off) {
        Some(before) => Err(SignalError::NotUniform {
            sample: before + 1,
            step: step(&times[before..before + 2]),
            mean,
        }),
        None => Ok(mean),
    }
}

/// The largest number of neighbours on either side that [`differences`] uses.
pub const NEIGHBOURS: usize = 3;

/// Central differences over `neighbours` samples on either side, at least one and at most
/// [`NEIGHBOURS`]: the derivatives of the polynomial through 3, 5 or 7 samples.
///
/// With three samples this is Eq. 31, in the form that is of second order for unequal steps too.
/// With equal steps `h`, second derivatives of a motion of angular frequency `w` have relative
/// errors of `(w h)^2 / 12`, `(w h)^4 / 90` and `(w h)^6 / 560`, and white noise of the samples is
/// amplified by 2.4, 3.1 and 3.5 over `h^2` (Fornberg, 1988, has the weights for any sampling).
///
/// - `times`: s, increasing; `values`: one for each time. Fewer neighbours are used where there are
///   too few samples for a single result.
///
/// # Errors
/// When the lengths differ, the times do not increase, or there are less than three samples.
///
/// ```
/// use regen_identify::signals::differences;
///
/// let times: Vec<f64> = (0..100).map(|k| 0.02 * f64::from(k)).collect();
/// let wave: Vec<f64> = times.iter().map(|t| (3.0 * t).sin()).collect();
/// let off = |neighbours| -> Result<f64, regen_identify::signals::SignalError> {
///     let found = differences(&times, &wave, neighbours)?;
///     Ok((found.acceleration[50] / (-9.0 * wave[50]) - 1.0).abs())
/// };
/// assert!((off(1)? / (0.06_f64.powi(2) / 12.0) - 1.0).abs() < 0.01);
/// assert!((off(2)? / (0.06_f64.powi(4) / 90.0) - 1.0).abs() < 0.01);
/// assert!(off(3)? < 1e-9);
/// # Ok::<(), regen_identify::signals::SignalError>(())
/// ```
pub fn differences(
    times: &[f64],
    values: &[f64],
    neighbours: usize,
) -> Result<Derivatives, SignalError> {
    check(times, values)?;
    let n = times.len();
    if n < 3 {
        return Err(SignalError::TooFew {
            samples: n,
            needed: 3,
        });
    }
    let side = neighbours.clamp(1, NEIGHBOURS).min((n - 1) / 2);
    let mut rate = nans(n);
    let mut acceleration = nans(n);
    let even = even_step(times);
    for k in side..n - side {
        let around = k - side..=k + side;
        (rate[k], acceleration[k]) = if side == 1 {
            let (before, after) = (times[k] - times[k - 1], times[k + 1] - times[k]);
            let (down, up) = (values[k] - values[k - 1], values[k + 1] - values[k]);
            let all = before * after * (before + after);
            (
                (before * before * up + after * after * down) / all,
                2.0 * (before * up - after * down) / all,
            )
        } else if let Some(step) = even {
            even_polynomial(&values[around], side, step)
        } else {
            polynomial(&times[around.clone()], &values[around], side)
        };
    }
    Ok(Derivatives {
        value: values.to_vec(),
        rate,
        acceleration,
        valid: side..n - side,
    })
}

/// Times count as equally spaced if each is within this part of a step of its place.
const EVEN: f64 = 1e-9;

/// The step of equally spaced times; `None` if they are not.
fn even_step(times: &[f64]) -> Option<f64> {
    let (first, last) = (times.first()?, times.last()?);
    let step = (last - first) / (times.len().max(2) - 1) as f64;
    let mut places = times.iter().enumerate();
    let is_even = places.all(|(k, t)| (t - first - k as f64 * step).abs() <= EVEN * step);
    is_even.then_some(step)
}

/// As [`polynomial`] through equally spaced samples, with the weights of Fornberg (1988).
fn even_polynomial(values: &[f64], middle: usize, step: f64) -> (f64, f64) {
    // those of the first and of the second derivative, nearest samples first
    let weights: &[(f64, f64)] = match middle {
        2 => &[(2.0 / 3.0, 4.0 / 3.0), (-1.0 / 12.0, -1.0 / 12.0)],
        _ => &[(0.75, 1.5), (-0.15, -0.15), (1.0 / 60.0, 1.0 / 90.0)],
    };
    let (before, after) = values.split_at(middle.min(values.len()));
    let Some((own, after)) = after.split_first() else {
        return (f64::NAN, f64::NAN);
    };
    let (mut rate, mut acceleration) = (0.0, 0.0);
    for ((first, second), (left, right)) in weights.iter().zip(before.iter().rev().zip(after)) {
        // relative to the middle value, so that small motions lose no digits
        let (down, up) = (own - left, right - own);
        rate += first * (up + down);
        acceleration += second * (up - down);
    }
    (rate / step, acceleration / (step * step))
}

/// The first and second derivative of the polynomial through all samples, at the middle sample:
/// divided differences (Newton's form), nearest samples first.
fn polynomial(times: &[f64], values: &[f64], middle: usize) -> (f64, f64) {
    const MAX_SAMPLES: usize = 2 * NEIGHBOURS + 1;
    let n = times.len().min(MAX_SAMPLES);
    let (mut at, mut divided) = ([0.0; MAX_SAMPLES], [0.0; MAX_SAMPLES]);
    for (k, (at, divided)) in at.iter_mut().zip(&mut divided).enumerate().take(n) {
        // the middle, then one to the left, one to the right, two to the left, and so on
        let away = k.div_ceil(2);
        let place = if k % 2 == 1 {
            middle - away
        } else {
            middle + away
        };
        *at = times[place] - times[middle];
        // relative to the middle value, so that small motions lose no digits
        *divided = values[place] - values[middle];
    }
    for order in 1..n {
        for k in (order..n).rev() {
            divided[k] = (divided[k] - divided[k - 1]) / (at[k] - at[k - order]);
        }
    }
    // p = d0 + d1 t + d2 t (t - t1) + d3 t (t - t1) (t - t2) + ..., by t, at t = 0
    let (mut rate, mut acceleration) = (0.0, 0.0);
    // the product's value, first and second derivative at t = 0
    let mut product = [1.0, 0.0, 0.0];
    for k in 0..n {
        rate += divided[k] * product[1];
        acceleration += divided[k] * product[2];
        let [p, dp, ddp] = product;
        product = [
            -p * at[k],
            dp.mul_add(-at[k], p),
            ddp.mul_add(-at[k], 2.0 * dp),
        ];
    }
    (rate, acceleration)
}

fn nans(n: usize) -> Vec<f64> {
    vec![f64::NAN; n]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_at_equal_steps_are_those_of_any_steps() {
        let (step, shift) = (0.01, 1e-6);
        let even: Vec<f64> = (0..60).map(|k| step * f64::from(k)).collect();
        // no step is equal to another, so that divided differences are used
        let uneven: Vec<f64> = (even.iter().enumerate())
            .map(|(k, t)| t + shift * step * libm::sin(k as f64))
            .collect();
        assert!(even_step(&even).is_some() && even_step(&uneven).is_none());
        let wave =
            |times: &[f64]| -> Vec<f64> { times.iter().map(|t| libm::sin(9.0 * t)).collect() };
        for neighbours in [2, 3] {
            let one = differences(&even, &wave(&even), neighbours);
            let other = differences(&uneven, &wave(&uneven), neighbours);
            let (Ok(one), Ok(other)) = (one, other) else {
                panic!("{neighbours}");
            };
            for k in neighbours..60 - neighbours {
                assert!((one.rate[k] - other.rate[k]).abs() < 1e-5, "{k}");
                assert!(
                    (one.acceleration[k] - other.acceleration[k]).abs() < 1e-4,
                    "{k}"
                );
            }
        }
    }
}
