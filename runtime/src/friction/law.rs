//! The friction laws: columns that are linear in their coefficients, for a shape that is not.

use crate::Friction;

/// A joint's friction as columns: their values at a velocity, and what the shape changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Law {
    Stribeck,
    Atan,
    Power,
}

/// The most columns and shape parameters that a law has.
pub(super) const COLUMNS: usize = 3;
pub(super) const SHAPES: usize = 2;
/// The number of starts.
pub(super) const STARTS: usize = 5;

/// Columns and their derivatives by the logarithm of each shape parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Columns {
    pub(super) values: [f64; COLUMNS],
    pub(super) slopes: [[f64; COLUMNS]; SHAPES],
}

impl Law {
    pub(super) fn of(friction: Friction) -> Option<Self> {
        match friction {
            Friction::Stribeck => Some(Self::Stribeck),
            Friction::Atan => Some(Self::Atan),
            Friction::Power => Some(Self::Power),
            _ => None,
        }
    }

    /// The symbols of the coefficients that are linear, in the order of the columns.
    pub(super) fn linear(self) -> &'static [&'static str] {
        match self {
            Self::Stribeck => &["Fc", "Fs", "Fv"],
            Self::Atan => &["Fc", "Fv1", "Fv2"],
            Self::Power => &["Fc", "Fv"],
        }
    }

    /// The symbols of the shape, which are positive.
    pub(super) fn shape(self) -> &'static [&'static str] {
        match self {
            Self::Stribeck => &["vs", "delta"],
            Self::Atan => &["Fv3"],
            Self::Power => &["delta"],
        }
    }

    /// Shapes to start from, velocities as parts of the highest one. A power law's first is
    /// linear friction; the others have it for any shape. So no start is worse than that.
    fn starts(self) -> &'static [[f64; SHAPES]; STARTS] {
        match self {
            Self::Stribeck => &[[0.1, 1.0], [0.03, 1.5], [0.3, 1.5], [0.1, 2.0], [0.01, 1.0]],
            Self::Atan => &[
                [10.0, 1.0],
                [3.0, 1.0],
                [30.0, 1.0],
                [100.0, 1.0],
                [1.0, 1.0],
            ],
            Self::Power => &[[1.0, 1.0], [0.5, 1.0], [2.0, 1.0], [0.25, 1.0], [1.5, 1.0]],
        }
    }

    /// A start's shape in SI units.
    pub(super) fn start(self, which: usize, fastest: f64) -> [f64; SHAPES] {
        let [first, second] = self.starts()[which % STARTS];
        match self {
            Self::Stribeck => [first * fastest, second],
            Self::Atan => [first / fastest, second],
            Self::Power => [first, second],
        }
    }

    /// The columns at a velocity.
    pub(super) fn columns(self, v: f64, shape: [f64; SHAPES]) -> Columns {
        let sign = if v == 0.0 { 0.0 } else { v.signum() };
        let mut out = Columns::default();
        match self {
            // sgn(v) (Fc + (Fs - Fc) e) + Fv v, e = exp(-|v/vs|^delta) (Eq. 32)
            Self::Stribeck => {
                let [vs, delta] = shape;
                let ratio = (v / vs).abs();
                let power = ratio.powf(delta);
                let e = (-power).exp();
                out.values = [sign * (1.0 - e), sign * e, v];
                let by_vs = sign * e * delta * power;
                let by_delta = -sign * e * delta * times_logarithm(power, ratio);
                out.slopes = [[-by_vs, by_vs, 0.0], [-by_delta, by_delta, 0.0]];
            }
            // sgn(v) Fc + Fv1 v + Fv2 atan(Fv3 v) (Eq. 16)
            Self::Atan => {
                let x = shape[0] * v;
                out.values = [sign, v, x.atan()];
                out.slopes[0] = [0.0, 0.0, x / (1.0 + x * x)];
            }
            // sgn(v) (Fc + Fv |v|^delta) (Eq. 17)
            Self::Power => {
                let delta = shape[0];
                let power = v.abs().powf(delta);
                out.values = [sign, sign * power, 0.0];
                out.slopes[0] = [0.0, sign * delta * times_logarithm(power, v.abs()), 0.0];
            }
        }
        out
    }
}

/// `power ln(base)`, 0 at the base 0, where the power wins.
fn times_logarithm(power: f64, base: f64) -> f64 {
    if power > 0.0 && base > 0.0 {
        power * base.ln()
    } else {
        0.0
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_the_derivatives_by_logarithms() {
        for law in [Law::Stribeck, Law::Atan, Law::Power] {
            for v in [-1.3, -0.2, -0.01, 0.0, 0.03, 0.5, 2.0] {
                let shape = [0.3, 1.4];
                let at = law.columns(v, shape);
                for s in 0..law.shape().len() {
                    let moved = |by: f64| {
                        let mut shape = shape;
                        shape[s] *= by.exp();
                        law.columns(v, shape).values
                    };
                    let (more, less) = (moved(1e-5), moved(-1e-5));
                    for c in 0..COLUMNS {
                        let difference = (more[c] - less[c]) / 2e-5;
                        assert!(
                            (difference - at.slopes[s][c]).abs() < 1e-9,
                            "{law:?} {v} {s} {c}"
                        );
                    }
                }
            }
        }
    }
}
