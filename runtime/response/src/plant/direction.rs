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
    /// The direction column with the smooth sign minus that with the sign itself, and the slope of
    /// the smooth one by the velocity.
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
