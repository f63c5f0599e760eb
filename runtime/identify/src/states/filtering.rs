//! How equations are filtered and decimated on the way from the states of a log to least squares.

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
