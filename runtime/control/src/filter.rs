//! The low-pass through which equations of motion pass, so that they need no acceleration.

use crate::outcome::SettingError;
use crate::real::Real;

/// A first-order low-pass H(s) = omega / (s + omega), sampled exactly: of inputs that are held from
/// one sample to the next, or straight lines between samples.
///
/// The equations of motion in generalised momentum, d/dt p - n = u, become
/// omega p - H (omega p + n) = H u, since s H = omega (1 - H).
#[derive(Clone, Copy, Debug)]
pub(crate) struct LowPass<T> {
    /// omega, rad/s.
    pub(crate) bandwidth: T,
    /// What is left of a state after a period.
    decay: T,
    /// The weights of both ends of a straight line.
    line: [T; 2],
}

impl<T: Real> LowPass<T> {
    /// `bandwidth` in rad/s, `period` in s.
    pub(crate) fn new(bandwidth: f64, period: f64) -> Result<Self, SettingError> {
        positive("bandwidth", bandwidth)?;
        positive("period", period)?;
        let turn = bandwidth * period;
        if turn > 1.0 {
            return Err(SettingError::Bandwidth);
        }
        let gone = -libm::expm1(-turn);
        // the mean of what has decayed over the period
        let mean = gone / turn;
        Ok(Self {
            bandwidth: T::of(bandwidth),
            decay: T::of(1.0 - gone),
            line: [T::of(mean - (1.0 - gone)), T::of(1.0 - mean)],
        })
    }

    /// The next state, for an input that is a straight line between two samples.
    #[inline]
    pub(crate) fn line(&self, state: T, before: T, now: T) -> T {
        self.decay * state + self.line[0] * before + self.line[1] * now
    }

    /// The next state, for an input that is held.
    #[inline]
    pub(crate) fn held(&self, state: T, input: T) -> T {
        input + self.decay * (state - input)
    }
}

/// Checks that a setting is positive and finite.
pub(crate) fn positive(of: &'static str, value: f64) -> Result<(), SettingError> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(SettingError::NotPositive { of })
    }
}
