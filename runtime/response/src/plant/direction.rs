//! Friction that depends on the direction of motion, made smooth.

/// A friction coefficient that multiplies the direction of a joint's motion.
#[derive(Clone, Debug)]
pub(crate) struct Directed {
    pub(crate) coordinate: usize,
    /// The directions of motion in which the coefficient counts.
    pub(crate) side: Side,
    /// The velocity over which the smoothed sign changes, rad/s or m/s.
    pub(crate) width: f64,
    /// The coefficient as a linear combination of base parameters.
    pub(crate) combination: Vec<f64>,
}

/// The directions of motion in which a coefficient counts.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Side {
    Both,
    Forward,
    Backward,
}

impl Side {
    /// The smoothed sign of the velocity `v` minus its sign, and the derivative of the smoothed sign
    /// by `v`; both are 0 in a direction in which the coefficient does not count.
    ///
    /// - `width`: the velocity at which the smoothed sign is tanh(1), rad/s or m/s.
    pub(crate) fn softening(self, v: f64, width: f64) -> (f64, f64) {
        let soft = libm::tanh(v / width);
        let slope = (1.0 - soft * soft) / width;
        let hard = if v == 0.0 { 0.0 } else { v.signum() };
        if self.counts(v) {
            (soft - hard, slope)
        } else {
            (0.0, 0.0)
        }
    }

    /// Whether the coefficient counts at a velocity.
    fn counts(self, v: f64) -> bool {
        match self {
            Self::Both => true,
            Self::Forward => v >= 0.0,
            Self::Backward => v <= 0.0,
        }
    }
}

impl Directed {
    /// The coefficient at these base parameters, N m or N.
    pub(crate) fn coefficient(&self, beta: &[f64]) -> f64 {
        self.combination.iter().zip(beta).map(|(a, b)| a * b).sum()
    }

    /// The sign of the velocity `v`; 0 in a direction in which the coefficient does not count.
    pub(crate) fn sign(&self, v: f64) -> f64 {
        if v == 0.0 || !self.side.counts(v) {
            0.0
        } else {
            v.signum()
        }
    }

    /// The mean of the smoothed sign while the velocity changes evenly from `from` to `to`, and its
    /// mean derivative by the velocity.
    pub(crate) fn between(&self, from: f64, to: f64) -> [f64; 2] {
        /// Velocities nearer than this part of the width count as equal.
        const EQUAL: f64 = 1e-3;
        let (soft, integral) = (|v| self.soft(v), |v| self.integral(v));
        let change = to - from;
        if change.abs() > EQUAL * self.width {
            return [
                (integral(to) - integral(from)) / change,
                (soft(to) - soft(from)) / change,
            ];
        }
        let mean = f64::midpoint(from, to);
        let half = 0.5 * EQUAL * self.width;
        let slope = (soft(mean + half) - soft(mean - half)) / (2.0 * half);
        [soft(mean), slope]
    }

    fn soft(&self, v: f64) -> f64 {
        if self.side.counts(v) {
            libm::tanh(v / self.width)
        } else {
            0.0
        }
    }

    /// The integral of the smoothed sign from 0, the logarithm of a hyperbolic cosine.
    fn integral(&self, v: f64) -> f64 {
        if !self.side.counts(v) {
            return 0.0;
        }
        let x = (v / self.width).abs();
        self.width * (x + libm::log1p(libm::exp(-2.0 * x)) - core::f64::consts::LN_2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against sums over many short parts, at reversals, beside them and in one direction.
    #[test]
    fn means_of_the_smoothed_sign_are_those_of_short_parts() {
        for side in [Side::Both, Side::Forward, Side::Backward] {
            let joint = Directed {
                coordinate: 0,
                side,
                width: 1e-3,
                combination: vec![1.0],
            };
            for (from, to) in [
                (-2e-3, 5e-3),
                (1e-4, 3e-2),
                (0.3, -0.1),
                (4e-4, 4e-4),
                (-1.0, -0.9),
            ] {
                let parts = 20_000;
                let at = |k: i32| from + (to - from) * (f64::from(k) + 0.5) / f64::from(parts);
                let mut sums = [0.0; 2];
                for k in 0..parts {
                    sums[0] += joint.soft(at(k));
                    sums[1] += side.softening(at(k), joint.width).1;
                }
                let [mean, slope] = sums.map(|sum| sum / f64::from(parts));
                let found = joint.between(from, to);
                // one part may lie on both sides of rest, where only one of them counts
                let one = 1.0 / f64::from(parts);
                assert!((found[0] - mean).abs() < one, "{from} {to}");
                let steepest = 1.0 / joint.width;
                assert!((found[1] - slope).abs() < one * steepest, "{from} {to}");
            }
        }
    }
}
