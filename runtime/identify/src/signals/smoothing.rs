//! Filters that act equally on many channels: on the efforts and on all columns of the regressor.

use super::{Butterworth, SignalError, local};

/// A zero-phase filter for both sides of the equations of motion.
///
/// Measured efforts `tau` and the regressor `W` fulfil `tau = W x` (Eq. 12) at every instant. The
/// same holds after a linear filter `F` of both sides, `F tau = (F W) x`, also for columns that
/// are not smooth, such as the sign of a velocity (Gautier's parallel filtering).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Smoothing {
    /// No filter.
    #[default]
    None,
    /// The low-pass filter of [`Butterworth`], forward and backward. Needs uniform sampling.
    Butterworth {
        /// The filter's order.
        order: usize,
        /// The cutoff frequency of one pass (-3 dB), Hz.
        cutoff: f64,
    },
    /// The value of a cubic polynomial fitted around each sample with tricube weights.
    Local {
        /// The half width of the window around each sample, s.
        half_width: f64,
    },
}

impl Smoothing {
    /// Whether there is no filter.
    pub fn is_none(&self) -> bool {
        *self == Self::None
    }

    /// The number of samples on either side that influence a filtered value by more than rounding.
    ///
    /// - `step`: the time between samples, s.
    ///
    /// # Errors
    /// When the settings do not fit the step.
    pub fn support(&self, step: f64) -> Result<usize, SignalError> {
        Ok(match *self {
            Self::None => 0,
            Self::Butterworth { order, cutoff } => Butterworth::new(order, cutoff, step)?.support(),
            Self::Local { half_width } => samples(half_width, step),
        })
    }

    /// The number of samples at either end of a run that must not be used, as the filter starts
    /// there with a guessed state.
    ///
    /// - `step`: the time between samples, s.
    ///
    /// # Errors
    /// When the settings do not fit the step.
    pub fn settling(&self, step: f64) -> Result<usize, SignalError> {
        Ok(match *self {
            Self::None => 0,
            Self::Butterworth { order, cutoff } => {
                Butterworth::new(order, cutoff, step)?.settling()
            }
            Self::Local { half_width } => samples(half_width, step),
        })
    }

    /// Filters several channels in place.
    ///
    /// - `times`: s, increasing, one for each sample;
    /// - `values`: sample by sample, `channels` entries each.
    ///
    /// # Errors
    /// When the sampling does not suit the filter, or there are too few samples for it.
    pub fn apply(
        &self,
        times: &[f64],
        values: &mut Vec<f64>,
        channels: usize,
    ) -> Result<(), SignalError> {
        if channels.checked_mul(times.len()) != Some(values.len()) {
            return Err(SignalError::Length {
                times: times.len(),
                values: values.len(),
            });
        }
        if channels == 0 {
            return Ok(());
        }
        match *self {
            Self::None => Ok(()),
            Self::Butterworth { order, cutoff } => {
                let step = super::mean_step(times)?;
                Butterworth::new(order, cutoff, step)?.zero_phase_channels(values, channels)
            }
            Self::Local { half_width } => {
                let mut smooth = values.clone();
                local::smooth(half_width, times, values, channels, &mut smooth)?;
                *values = smooth;
                Ok(())
            }
        }
    }

    /// The autocorrelation of white noise behind the filter at lags of `every`, `2 every`, ... samples, until it has
    /// forgotten a value.
    ///
    /// - `step`: the time between samples, s.
    ///
    /// # Errors
    /// As [`apply`](Self::apply).
    pub(crate) fn noise_autocorrelation(
        &self,
        step: f64,
        every: usize,
    ) -> Result<Vec<f64>, SignalError> {
        let support = self.support(step)?.max(self.settling(step)?);
        if support > super::MAX_RESPONSE {
            return Err(super::LONG_RESPONSE);
        }
        let count = 2 * support + 1;
        let times: Vec<f64> = (0..count).map(|k| k as f64 * step).collect();
        let mut response = vec![0.0; count];
        if let Some(middle) = response.get_mut(support) {
            *middle = 1.0;
        }
        self.apply(&times, &mut response, 1)?;
        let at = |lag: usize| -> f64 {
            let later = response.iter().skip(lag);
            response.iter().zip(later).map(|(a, b)| a * b).sum()
        };
        let lags = (1..)
            .map(|k| k * every.max(1))
            .take_while(|lag| *lag < count);
        Ok(lags.map(|lag| at(lag) / at(0)).collect())
    }

    /// As [`apply`](Self::apply), but leaves the values as they are; `out` is overwritten.
    ///
    /// # Errors
    /// As [`apply`](Self::apply).
    pub(crate) fn apply_to(
        &self,
        times: &[f64],
        values: &[f64],
        channels: usize,
        out: &mut Vec<f64>,
    ) -> Result<(), SignalError> {
        match *self {
            Self::Local { half_width }
                if channels > 0 && channels.checked_mul(times.len()) == Some(values.len()) =>
            {
                // every entry is overwritten
                out.resize(values.len(), 0.0);
                local::smooth(half_width, times, values, channels, out)
            }
            _ => {
                out.clear();
                out.extend_from_slice(values);
                self.apply(times, out, channels)
            }
        }
    }
}

/// The number of samples on either side that a window can reach, rounded up.
fn samples(half_width: f64, step: f64) -> usize {
    #[allow(clippy::cast_sign_loss, reason = "a negative width gives 0")]
    let samples = (half_width / step).ceil() as usize;
    samples.saturating_add(1)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn channels_are_filtered_as_signals_by_themselves() {
        let times: Vec<f64> = (0..400).map(|k| 0.01 * f64::from(k)).collect();
        let signal = |c: usize, t: f64| (3.0 * t + c as f64).sin() + (60.0 * t).cos() * c as f64;
        for filter in [
            Smoothing::Butterworth {
                order: 5,
                cutoff: 7.0,
            },
            Smoothing::Local { half_width: 0.08 },
        ] {
            let mut values: Vec<f64> = times
                .iter()
                .flat_map(|t| [0, 1, 2].map(|c| signal(c, *t)))
                .collect();
            filter.apply(&times, &mut values, 3).unwrap();
            for c in 0..3 {
                let mut one: Vec<f64> = times.iter().map(|t| signal(c, *t)).collect();
                filter.apply(&times, &mut one, 1).unwrap();
                let own: Vec<f64> = values.iter().skip(c).step_by(3).copied().collect();
                assert_eq!(own, one, "{filter:?} {c}");
            }
        }
    }

    #[test]
    fn a_filter_keeps_sums_of_columns() {
        // parallel filtering needs linearity: F(W x) = (F W) x
        let times: Vec<f64> = (0..300).map(|k| 0.01 * f64::from(k)).collect();
        let x = [0.7, -2.0];
        let filter = Smoothing::Butterworth {
            order: 4,
            cutoff: 5.0,
        };
        let columns = |t: f64| [(2.0 * t).sin().signum(), (5.0 * t).cos()];
        let mut w: Vec<f64> = times.iter().flat_map(|t| columns(*t)).collect();
        let mut tau: Vec<f64> = times
            .iter()
            .map(|t| columns(*t).iter().zip(x).map(|(w, x)| w * x).sum())
            .collect();
        filter.apply(&times, &mut w, 2).unwrap();
        filter.apply(&times, &mut tau, 1).unwrap();
        for (w, tau) in w.chunks_exact(2).zip(&tau) {
            // rounding of the filter's sections, run twice over values near 2
            assert!((w[0] * x[0] + w[1] * x[1] - tau).abs() < 1e-12);
        }
    }

    #[test]
    fn a_constant_stays_to_the_last_digit() {
        let times: Vec<f64> = (0..200).map(|k| 0.01 * f64::from(k)).collect();
        let filter = Smoothing::Local { half_width: 0.05 };
        let mut values = vec![3.25; 200];
        filter.apply(&times, &mut values, 1).unwrap();
        assert!(values.iter().all(|x| (x - 3.25).abs() < 1e-12));
    }
}
