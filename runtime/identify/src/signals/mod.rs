//! Velocities and accelerations from sampled positions (section 5.1).
//!
//! Four ways with one interface: central differences (Eq. 31), differences behind a zero-phase
//! Butterworth filter (Gautier et al., 1995), the finite Fourier series refitted, with its
//! analytic derivatives (Eq. 25; Swevers et al., 1996), and local cubic regression (Page et al.,
//! 2006).

mod butterworth;
mod fourier;
mod local;
mod smoothing;

use core::fmt;
use core::ops::Range;

pub use butterworth::Butterworth;
pub use fourier::{Fourier, FourierFit};
pub use smoothing::Smoothing;

/// How positions are differentiated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Central differences of the positions as they are (Eq. 31), for any sampling. Where a log
    /// is read, positions with so little noise that the motion's own changes between samples
    /// matter more are differentiated over two or three neighbours on either side,
    /// see [`differences`].
    Central,
    /// A low-pass Butterworth filter run forward and backward, then central differences. Needs
    /// uniform sampling.
    Butterworth {
        /// The filter's order.
        order: usize,
        /// Where one pass has lost 3 dB, Hz.
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
        /// How far samples count, s on either side.
        half_width: f64,
    },
}

/// How many times as wide the filter of the states is as that of the equations.
pub const WIDER: f64 = 3.0;
/// The highest cutoff of a filter of states, of the sampling rate.
const WIDEST: f64 = 0.4;
/// The narrowest half width of a regression over states, in samples.
const NARROWEST: f64 = 4.0;

/// A signal with its derivatives, as long as the samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Derivatives {
    /// The signal, smoothed by the method.
    pub value: Vec<f64>,
    /// Its first derivative, per s.
    pub rate: Vec<f64>,
    /// Its second derivative, per s^2.
    pub acceleration: Vec<f64>,
    /// The samples that have all that the method needs on both sides; elsewhere entries mean
    /// little.
    pub valid: Range<usize>,
}

/// Why a signal was not differentiated.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum SignalError {
    /// Times and values of different lengths.
    Length {
        /// Times.
        times: usize,
        /// Values.
        values: usize,
    },
    /// A time or a value that is NaN or infinite.
    NotFinite {
        /// The sample.
        sample: usize,
    },
    /// A time that is not after the one before.
    NotIncreasing {
        /// The sample.
        sample: usize,
    },
    /// A step that differs from the mean step by more than a tenth.
    NotUniform {
        /// The sample at its end.
        sample: usize,
        /// The step, s.
        step: f64,
        /// The mean step, s.
        mean: f64,
    },
    /// Too few samples for the method.
    TooFew {
        /// Samples there are, in all or in a window.
        samples: usize,
        /// Samples the method needs there.
        needed: usize,
    },
    /// A filter's cutoff that the sampling does not allow.
    Cutoff {
        /// The cutoff, Hz.
        cutoff: f64,
        /// Half the sampling rate, Hz.
        most: f64,
    },
    /// A setting that cannot be.
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
                 Butterworth filter needs uniform sampling; local regression and Fourier series \
                 do not"
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
                // the rate comes from clocks
                (most * 1e6).round() / 1e6
            ),
            Self::Setting(what) => f.write_str(what),
        }
    }
}

impl core::error::Error for SignalError {}

impl Method {
    /// The signal smoothed, with its first and second derivative.
    ///
    /// - `times`: s, increasing; `values`: one for each.
    ///
    /// # Errors
    /// When lengths differ, times do not increase, or the method needs more or other samples.
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
                // what the filter leaves is smooth from sample to sample
                let mut out = differences(times, &filter.zero_phase(values)?, NEIGHBOURS)?;
                let margin = filter.settling().min(times.len() / 2);
                // the filter's start and end are guesses: what it does there is not data
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
            Self::Local { half_width } => local::fit(half_width, times, values),
        }
    }

    /// The filter that efforts and the columns of the regressor pass where positions are
    /// differentiated so: a Fourier series and central differences leave both as they are.
    pub fn smoothing(&self) -> Smoothing {
        match *self {
            Self::Butterworth { order, cutoff } => Smoothing::Butterworth { order, cutoff },
            Self::Local { half_width } => Smoothing::Local { half_width },
            Self::Central | Self::Fourier { .. } => Smoothing::None,
        }
    }

    /// The method for the states that a regressor is made of, where the equations pass
    /// [`smoothing`](Self::smoothing) afterwards.
    ///
    /// A filter changes the motion that it smooths, and a regressor of a changed motion is
    /// biased: products and signs of filtered states are not the filtered products and signs. So
    /// the states pass a filter that is [`WIDER`] times as wide, which leaves the motion as it is
    /// and takes away what is far above it; what remains of the noise is left to the filter of the
    /// equations (Gautier's parallel filtering and decimation).
    ///
    /// - `step`: the time between samples, s.
    ///
    /// ```
    /// use regen_identify::signals::Method;
    ///
    /// let asked = Method::Butterworth { order: 4, cutoff: 5.0 };
    /// assert_eq!(asked.of_states(0.01), Method::Butterworth { order: 4, cutoff: 15.0 });
    /// // a series has no noise to speak of
    /// let series = Method::Fourier { frequency: 0.1, harmonics: 5 };
    /// assert_eq!(series.of_states(0.01), series);
    /// ```
    #[must_use]
    pub fn of_states(&self, step: f64) -> Self {
        match *self {
            Self::Butterworth { order, cutoff } => Self::Butterworth {
                order,
                cutoff: (WIDER * cutoff).min(WIDEST / step).max(cutoff),
            },
            Self::Local { half_width } => Self::Local {
                half_width: (half_width / WIDER).max(NARROWEST * step).min(half_width),
            },
            Self::Central | Self::Fourier { .. } => *self,
        }
    }

    /// How many samples on either side a result depends on, to rounding; `None`: on all.
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

    /// The standard deviation of the first derivative where the samples have white noise of
    /// deviation 1; 0 for a series, which averages over all samples.
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
        let Some(support) = self.support(step)? else {
            return Ok(0.0);
        };
        // the response to a single sample of size 1
        let side = support + 2;
        let times: Vec<f64> = (0..=2 * side).map(|k| k as f64 * step).collect();
        let mut impulse = vec![0.0; times.len()];
        impulse[side] = 1.0;
        let found = self.differentiate(&times, &impulse)?;
        let rates = found.rate.iter().filter(|r| r.is_finite());
        Ok(rates.map(|r| r * r).sum::<f64>().sqrt())
    }
}

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

/// By how much a step may differ from the mean where sampling is to be uniform: clocks jitter.
const JITTER: f64 = 0.1;

fn mean_step(times: &[f64]) -> Result<f64, SignalError> {
    let (Some(first), Some(last), true) = (times.first(), times.last(), times.len() > 1) else {
        return Err(SignalError::TooFew {
            samples: times.len(),
            needed: 2,
        });
    };
    let mean = (last - first) / (times.len().max(2) - 1) as f64;
    let step = |pair: &[f64]| pair[1] - pair[0];
    let off = |pair: &[f64]| (step(pair) - mean).abs() > JITTER * mean;
    match times.windows(2).position(off) {
        Some(before) => Err(SignalError::NotUniform {
            sample: before + 1,
            step: step(&times[before..before + 2]),
            mean,
        }),
        None => Ok(mean),
    }
}

/// The most neighbours on either side that derivatives are taken from.
pub const NEIGHBOURS: usize = 3;

/// Central differences over `neighbours` samples on either side, at least one and at most
/// [`NEIGHBOURS`]: the derivatives of the polynomial through 3, 5 or 7 samples.
///
/// Three are Eq. 31, in the form that is of second order for unequal steps too. Where steps `h` are
/// alike, second derivatives of a motion of angular frequency `w` are off by `(w h)^2 / 12`,
/// `(w h)^4 / 90` and `(w h)^6 / 560` of their size; white noise of the samples gets into them 2.4,
/// 3.1 and 3.5 times over `h^2` (Fornberg, 1988, has the weights for any sampling).
///
/// - `times`: s, increasing; `values`: one for each. Fewer neighbours are taken where there are not
///   samples enough for one state.
///
/// # Errors
/// When lengths differ, times do not increase, or there are less than three samples.
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
    let mut rate = vec_of(n);
    let mut acceleration = vec_of(n);
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

/// The first and second derivative of the polynomial through samples, at the one in the middle:
/// divided differences (Newton's form), nearest samples first.
fn polynomial(times: &[f64], values: &[f64], middle: usize) -> (f64, f64) {
    const MOST: usize = 2 * NEIGHBOURS + 1;
    let n = times.len().min(MOST);
    let (mut at, mut divided) = ([0.0; MOST], [0.0; MOST]);
    for (k, (at, divided)) in at.iter_mut().zip(&mut divided).enumerate().take(n) {
        // the middle, then one to the left, one to the right, two to the left, and so on
        let away = k.div_ceil(2);
        let place = if k % 2 == 1 {
            middle - away
        } else {
            middle + away
        };
        *at = times[place] - times[middle];
        // differences from the middle keep the digits of small motions
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

fn vec_of(n: usize) -> Vec<f64> {
    vec![f64::NAN; n]
}
