//! How equations are filtered and decimated on the way from the states of a log to least squares.

use crate::estimate::FilteredNoise;
use crate::signals::Smoothing;

/// How to treat equations of coordinates that rest, or move so slowly that noise determines
/// the direction of their friction.
///
/// On a joint at rest, static friction of any size up to its limit may act, which no column
/// explains. Its equation therefore cannot be used if the joint has friction that depends on the
/// direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Standstill {
    /// Equations at standstill are left out.
    #[default]
    Drop,
    /// Equations at standstill are used like all others.
    Keep,
    /// Each equation is weighted by the part of the filter's window in which its coordinate moved.
    Weigh,
}

/// How equations are processed between the states of a log and least squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filtering {
    /// The filter of efforts and regressor.
    pub smoothing: Smoothing,
    /// The decimation ratio, at least 1: one of this many filtered equations is used. An
    /// [average](Self::averaged) counts as the number of equations in it.
    pub decimation: usize,
    /// How equations at standstill are treated.
    pub standstill: Standstill,
}

/// Rate of the averages that a low-pass filter gets, divided by its cutoff: an average over a
/// fiftieth of a period reduces a sine of the cutoff's frequency by less than a thousandth.
const RATE_PER_CUTOFF: f64 = 50.0;
/// The largest number of equations that are averaged, for clocks whose first step is almost 0.
const MAX_AVERAGED: usize = 4096;

/// About so many equations in a period of the cutoff's frequency tell the noise behind a low-pass filter: what it
/// passes of noise above half their rate is below a hundredth of what it passes at low frequencies, and the
/// autoregression of more of them needs more coefficients than the filter has.
const EQUATIONS_PER_CUTOFF: f64 = 7.0;

impl Filtering {
    /// The number of consecutive equations that are averaged before the low-pass filter: a power of
    /// two, 1 where the sampling is not much faster than the filter. Both sides of the equations are
    /// averaged, so they stay equal, also where friction turns its sign within an average; the
    /// filter's work and memory then depend on its cutoff and no longer on the rate of the log.
    ///
    /// - `step`: the time between samples, s.
    ///
    /// ```
    /// use regen_identify::states::Filtering;
    /// use regen_identify::signals::Smoothing;
    ///
    /// let smoothing = Smoothing::Butterworth { order: 4, cutoff: 10.0 };
    /// let filtering = Filtering { smoothing, ..Filtering::default() };
    /// assert_eq!(filtering.averaged(1e-3), 2);
    /// assert_eq!(filtering.averaged(1e-2), 1);
    /// assert_eq!(Filtering::default().averaged(1e-3), 1);
    /// ```
    pub fn averaged(&self, step: f64) -> usize {
        let Smoothing::Butterworth { cutoff, .. } = self.smoothing else {
            return 1;
        };
        let most = 1.0 / (RATE_PER_CUTOFF * cutoff * step);
        let mut count = 1;
        while (2 * count) as f64 <= most && count < MAX_AVERAGED {
            count *= 2;
        }
        count
    }

    /// The number of samples from one equation to the next one that is used.
    ///
    /// - `step`: the time between samples, s.
    pub fn samples_between(&self, step: f64) -> usize {
        let averaged = self.averaged(step);
        averaged * self.every(averaged)
    }

    /// What the filter makes of white noise of the efforts.
    ///
    /// - `spacing`: the time between the equations that are used, s.
    pub(crate) fn noise(&self, spacing: f64) -> FilteredNoise {
        self.noise_behind(spacing)
            .unwrap_or_else(FilteredNoise::unfiltered)
    }

    /// `None` without a filter, or for a spacing that this filter does not give.
    fn noise_behind(&self, spacing: f64) -> Option<FilteredNoise> {
        let averages = core::iter::successors(Some(1), |count| Some(2 * count));
        let mut steps = averages
            .take_while(|averaged| *averaged <= MAX_AVERAGED)
            .map(|averaged| (averaged, spacing / (averaged * self.every(averaged)) as f64));
        let (averaged, step) = steps.find(|(averaged, step)| self.averaged(*step) == *averaged)?;
        let every = match self.smoothing {
            Smoothing::None => return None,
            #[allow(
                clippy::cast_sign_loss,
                reason = "a cutoff and a spacing are not negative"
            )]
            Smoothing::Butterworth { cutoff, .. } => {
                let nearest = (1.0 / (EQUATIONS_PER_CUTOFF * cutoff * spacing)).round();
                (nearest as usize).max(1)
            }
            Smoothing::Local { .. } => 1,
        };
        let step = step * averaged as f64;
        let between = every * self.every(averaged);
        let autocorrelation = self.smoothing.noise_autocorrelation(step, between).ok()?;
        Some(FilteredNoise::new(every, &autocorrelation))
    }

    /// The decimation ratio of averages.
    pub(crate) fn every(&self, averaged: usize) -> usize {
        self.decimation.div_ceil(averaged).max(1)
    }
}

impl Default for Filtering {
    /// No filter, no decimation, and equations at standstill are left out.
    fn default() -> Self {
        Self {
            smoothing: Smoothing::None,
            decimation: 1,
            standstill: Standstill::Drop,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_behind_a_filter_has_the_same_memory_at_any_spacing_of_the_equations() {
        let smoothing = Smoothing::Butterworth {
            order: 4,
            cutoff: 4.0,
        };
        let memory = |decimation: usize| {
            let filtering = Filtering {
                smoothing,
                decimation,
                ..Filtering::default()
            };
            let spacing = 1e-3 * filtering.samples_between(1e-3) as f64;
            spacing * filtering.noise(spacing).memory()
        };
        // half over the frequency range of a filter that passes all below the cutoff and nothing above
        let own = memory(1);
        assert!((0.1..0.15).contains(&own), "{own}");
        for decimation in [3, 7, 10, 20, 30] {
            assert!(
                (memory(decimation) / own - 1.0).abs() < 0.03,
                "{decimation}"
            );
        }
        // without a filter noise has no memory
        let without = Filtering::default().noise(1e-3);
        assert!(without.is_as(&FilteredNoise::unfiltered()));
    }
}
