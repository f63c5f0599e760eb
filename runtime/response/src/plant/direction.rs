//! Friction that depends on the direction of motion, made smooth.

/// A friction coefficient that multiplies the direction of a joint's motion.
#[derive(Clone, Debug)]
pub(super) struct Directed {
    pub(super) coordinate: usize,
    /// The directions of motion in which the coefficient counts.
    pub(super) side: Side,
    /// The coefficient as a linear combination of base parameters.
    pub(super) combination: Vec<f64>,
}

/// The directions of motion in which a coefficient counts.
#[derive(Clone, Copy, Debug)]
pub(super) enum Side {
    Both,
    Forward,
    Backward,
}

impl Side {
    /// The smoothed sign of the velocity `v` minus its sign, and the derivative of the smoothed sign
    /// by `v`; both are 0 in a direction in which the coefficient does not count.
    ///
    /// - `width`: the velocity at which the smoothed sign is tanh(1), rad/s or m/s.
    pub(super) fn softening(self, v: f64, width: f64) -> (f64, f64) {
        let soft = libm::tanh(v / width);
        let slope = (1.0 - soft * soft) / width;
        let hard = if v == 0.0 { 0.0 } else { v.signum() };
        let absent = match self {
            Self::Both => false,
            Self::Forward => v < 0.0,
            Self::Backward => v > 0.0,
        };
        if absent {
            (0.0, 0.0)
        } else {
            (soft - hard, slope)
        }
    }
}
