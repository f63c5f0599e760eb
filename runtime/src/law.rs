//! The nonlinear friction laws (Eq. 16, 17, 32), stated once: for simulation as efforts, for
//! identification as columns that are linear in their coefficients for a shape that is not.
//!
//! The elementary functions are those of `libm`: the same digits on every machine.

#[cfg(feature = "feasibility")]
use crate::Friction;

/// The most coefficients and shape parameters that a law has.
pub(crate) const COLUMNS: usize = 3;
pub(crate) const SHAPES: usize = 2;

/// A nonlinear law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Law {
    /// `sgn(v) Fc + Fv v`, what fits with the others are compared with.
    #[cfg(feature = "feasibility")]
    Linear,
    /// `sgn(v) (Fc + (Fs - Fc) e) + Fv v`, `e = exp(-|v/vs|^delta)` (Eq. 32).
    Stribeck,
    /// `sgn(v) Fc + Fv1 v + Fv2 atan(Fv3 v)` (Eq. 16).
    Atan,
    /// `Fc+ + Fv |v|^delta` forwards, `-Fc- - Fv |v|^delta` backwards (Eq. 17).
    Power,
}

impl Law {
    /// The law of a joint's friction; `None` where that is linear.
    #[cfg(feature = "feasibility")]
    pub(crate) fn of(friction: Friction) -> Option<Self> {
        match friction {
            Friction::Stribeck => Some(Self::Stribeck),
            Friction::Atan => Some(Self::Atan),
            Friction::Power => Some(Self::Power),
            _ => None,
        }
    }

    /// What the columns' coefficients are, in their order. None is negative in a joint that
    /// dissipates; Stribeck's second is the excess of static friction over Coulomb friction.
    #[cfg(feature = "feasibility")]
    pub(crate) fn linear(self) -> &'static [&'static str] {
        match self {
            Self::Linear => &["Fc", "Fv"],
            Self::Stribeck => &["Fc", "Fs-Fc", "Fv"],
            Self::Atan => &["Fc", "Fv1", "Fv2"],
            Self::Power => &["Fc+", "Fc-", "Fv"],
        }
    }

    /// The symbols of the shape, which are positive.
    #[cfg(feature = "feasibility")]
    pub(crate) fn shape(self) -> &'static [&'static str] {
        match self {
            Self::Linear => &[],
            Self::Stribeck => &["vs", "delta"],
            Self::Atan => &["Fv3"],
            Self::Power => &["delta"],
        }
    }

    /// Coefficients and shape with which the law is linear friction of these Fc and Fv.
    #[cfg(feature = "feasibility")]
    pub(crate) fn of_linear(
        self,
        [fc, fv]: [f64; 2],
        shape: [f64; SHAPES],
    ) -> (std::vec::Vec<f64>, [f64; SHAPES]) {
        match self {
            Self::Linear => (std::vec![fc, fv], shape),
            Self::Stribeck => (std::vec![fc, 0.0, fv], shape),
            Self::Atan => (std::vec![fc, fv, 0.0], shape),
            Self::Power => (std::vec![fc, fc, fv], [1.0, shape[1]]),
        }
    }

    /// The columns at a velocity; `sign` is sgn(v), or what stands for it.
    pub(crate) fn values(self, v: f64, sign: f64, shape: [f64; SHAPES]) -> [f64; COLUMNS] {
        match self {
            #[cfg(feature = "feasibility")]
            Self::Linear => [sign, v, 0.0],
            Self::Stribeck => {
                let [vs, delta] = shape;
                let e = libm::exp(-libm::pow((v / vs).abs(), delta));
                [sign, sign * e, v]
            }
            Self::Atan => [sign, v, libm::atan(shape[0] * v)],
            Self::Power => {
                let power = libm::pow(v.abs(), shape[0]);
                [sign.max(0.0), sign.min(0.0), sign * power]
            }
        }
    }

    /// The columns' derivatives by the logarithm of each shape parameter.
    #[cfg(feature = "feasibility")]
    pub(crate) fn slopes(
        self,
        v: f64,
        sign: f64,
        shape: [f64; SHAPES],
    ) -> [[f64; COLUMNS]; SHAPES] {
        let none = [0.0; COLUMNS];
        match self {
            Self::Linear => [none; SHAPES],
            Self::Stribeck => {
                let [vs, delta] = shape;
                let ratio = (v / vs).abs();
                let power = libm::pow(ratio, delta);
                let e = libm::exp(-power);
                let by_vs = sign * e * delta * power;
                let by_delta = -sign * e * delta * times_logarithm(power, ratio);
                [[0.0, by_vs, 0.0], [0.0, by_delta, 0.0]]
            }
            Self::Atan => {
                let x = shape[0] * v;
                [[0.0, 0.0, x / (1.0 + x * x)], none]
            }
            Self::Power => {
                let delta = shape[0];
                let power = libm::pow(v.abs(), delta);
                let by_delta = sign * delta * times_logarithm(power, v.abs());
                [[0.0, 0.0, by_delta], none]
            }
        }
    }
}

/// `power ln(base)`, 0 at the base 0, where the power wins.
#[cfg(feature = "feasibility")]
fn times_logarithm(power: f64, base: f64) -> f64 {
    if power > 0.0 && base > 0.0 {
        power * libm::log(base)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(feature = "feasibility")]
    const LAWS: [Law; 3] = [Law::Stribeck, Law::Atan, Law::Power];
    const VELOCITIES: [f64; 7] = [-1.3, -0.2, -0.01, 0.0, 0.03, 0.5, 2.0];

    fn sign(v: f64) -> f64 {
        if v == 0.0 { 0.0 } else { v.signum() }
    }

    #[cfg(feature = "feasibility")]
    #[test]
    fn every_law_contains_linear_friction() {
        for law in LAWS {
            let (coefficients, shape) = law.of_linear([0.7, 2.5], [0.3, 1.4]);
            for v in VELOCITIES {
                let columns = law.values(v, sign(v), shape);
                let effort: f64 = columns.iter().zip(&coefficients).map(|(c, x)| c * x).sum();
                assert!(
                    (effort - (0.7 * sign(v) + 2.5 * v)).abs() < 1e-14,
                    "{law:?} {v}"
                );
            }
        }
    }

    #[cfg(feature = "feasibility")]
    #[test]
    fn slopes_are_the_derivatives_by_logarithms() {
        for law in LAWS {
            for v in VELOCITIES {
                let shape = [0.3, 1.4];
                let slopes = law.slopes(v, sign(v), shape);
                for (s, slope) in slopes.iter().enumerate().take(law.shape().len()) {
                    let moved = |by: f64| {
                        let mut shape = shape;
                        shape[s] *= libm::exp(by);
                        law.values(v, sign(v), shape)
                    };
                    let (more, less) = (moved(1e-5), moved(-1e-5));
                    for c in 0..COLUMNS {
                        let difference = (more[c] - less[c]) / 2e-5;
                        assert!((difference - slope[c]).abs() < 1e-9, "{law:?} {v} {s} {c}");
                    }
                }
            }
        }
    }

    #[test]
    fn columns_and_coefficients_add_up_to_the_equations() {
        let shape = [0.3, 1.4];
        for v in VELOCITIES {
            let sum = |law: Law, x: [f64; 3]| -> f64 {
                let columns = law.values(v, sign(v), shape);
                columns.iter().zip(x).map(|(c, x)| c * x).sum()
            };
            let (fc, fs, fv) = (2.0, 3.5, 0.7);
            let bump = (-(v / 0.3_f64).abs().powf(1.4)).exp();
            let stribeck = sign(v) * (fc + (fs - fc) * bump) + fv * v;
            assert!((sum(Law::Stribeck, [fc, fs - fc, fv]) - stribeck).abs() < 1e-14);
            let atan = sign(v) * fc + fs * v + fv * (0.3 * v).atan();
            assert!((sum(Law::Atan, [fc, fs, fv]) - atan).abs() < 1e-14);
            let coulomb = if v > 0.0 { fc } else { fs };
            let power = sign(v) * (coulomb + fv * v.abs().powf(0.3));
            assert!((sum(Law::Power, [fc, fs, fv]) - power).abs() < 1e-14);
        }
    }
}
