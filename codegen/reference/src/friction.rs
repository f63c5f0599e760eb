//! The friction of a joint: the regressor's columns of linear laws, and the effort of every law.
//!
//! The efforts are written as in the publications (`stribeck` is Eq. 32, `atan` Eq. 16, `power`
//! Eq. 17, `lugre` the steady state of the LuGre model). They share no code with the laws of the
//! runtime; tests compare the two.

use crate::mechanism::Mechanism;

/// The friction law of a coordinate.
#[derive(Clone, Copy, Debug)]
pub struct Friction {
    /// The law's word in the spec.
    pub word: &'static str,
    /// The symbols of its parameters, one regressor column each, such as `Fv` and `Fc`; empty for
    /// a nonlinear law.
    pub columns: &'static [&'static str],
    effort: Effort,
}

/// How the effort, N m or N, is computed from the values of the law's coefficients.
#[derive(Clone, Copy, Debug)]
enum Effort {
    /// Linear: the sum of the regressor's entries times the coefficients.
    Columns,
    /// Nonlinear: the symbols of the coefficients, and the effort as a function of their values x
    /// in this order, the velocity v, and the sign of v (-1, 0 or 1).
    Of(&'static [&'static str], fn(&[f64], f64, f64) -> f64),
}

/// All laws, with their words in the spec.
const LAWS: [Friction; 10] = [
    linear("none", &[]),
    linear("viscous", &["Fv"]),
    linear("coulomb", &["Fc"]),
    linear("linear", &["Fv", "Fc"]),
    linear("coulomb_asymmetric", &["Fv", "Fc+", "Fc-"]),
    linear("asymmetric", &["Fv+", "Fc+", "Fv-", "Fc-"]),
    nonlinear(
        "stribeck",
        &["Fc", "Fs", "vs", "delta", "Fv"],
        |x, v, sgn| sgn * (x[0] + (x[1] - x[0]) * (-(v / x[2]).abs().powf(x[3])).exp()) + x[4] * v,
    ),
    nonlinear("atan", &["Fc", "Fv1", "Fv2", "Fv3"], |x, v, sgn| {
        sgn * x[0] + x[1] * v + x[2] * (x[3] * v).atan()
    }),
    nonlinear("power", &["Fc+", "Fc-", "Fv", "delta"], |x, v, sgn| {
        let coulomb = if v > 0.0 { x[0] } else { x[1] };
        sgn * (coulomb + x[2] * v.abs().powf(x[3]))
    }),
    nonlinear("lugre", &["Fc", "Fs", "vs", "Fv"], |x, v, sgn| {
        let g = x[0] + (x[1] - x[0]) * (-(v * v) / (x[2] * x[2])).exp();
        sgn * g + x[3] * v
    }),
];

const fn linear(word: &'static str, columns: &'static [&'static str]) -> Friction {
    Friction {
        word,
        columns,
        effort: Effort::Columns,
    }
}

const fn nonlinear(
    word: &'static str,
    symbols: &'static [&'static str],
    effort: fn(&[f64], f64, f64) -> f64,
) -> Friction {
    Friction {
        word,
        columns: &[],
        effort: Effort::Of(symbols, effort),
    }
}

impl Friction {
    /// The law with this word in the spec; `None` if there is none.
    pub(crate) fn of(word: &str) -> Option<Friction> {
        LAWS.into_iter().find(|law| law.word == word)
    }

    /// Whether the effort is not linear in its coefficients.
    pub fn is_nonlinear(&self) -> bool {
        matches!(self.effort, Effort::Of(..))
    }
}

impl Mechanism {
    /// The effort, N m or N, that overcomes the friction of a coordinate at the velocity `v`, rad/s
    /// or m/s, with the spec's nominal coefficients. Where these are positive it has the sign of
    /// `v`; at rest it is zero. `None` if a coefficient is missing or there is no such coordinate.
    ///
    /// - `coordinate`: the index among all coordinates.
    pub fn friction_effort(&self, coordinate: usize, v: f64) -> Option<f64> {
        let name = self.coordinates.get(coordinate)?;
        let law = self.friction.get(coordinate)?;
        let value = |symbol: &&str| self.nominal.get(&format!("{symbol}({name})")).copied();
        let sgn = f64::from(i8::from(v > 0.0) - i8::from(v < 0.0));
        match law.effort {
            Effort::Columns => {
                let columns = law.columns.iter();
                columns
                    .map(|s| Some(value(s)? * friction_column(s, v)))
                    .sum()
            }
            Effort::Of(symbols, effort) => {
                let values: Option<Vec<f64>> = symbols.iter().map(value).collect();
                Some(effort(&values?, v, sgn))
            }
        }
    }
}

/// The regressor's entry in the column of a friction parameter and the row of its joint.
///
/// - `symbol`: one of `Fv`, `Fc`, `Fv+`, `Fv-`, `Fc+`, `Fc-`; the sign is that of the velocity at
///   which the parameter acts;
/// - `qd`: the joint's velocity, rad/s or m/s.
pub(crate) fn friction_column(symbol: &str, qd: f64) -> f64 {
    let positive = f64::from(u8::from(qd > 0.0));
    let negative = f64::from(u8::from(qd < 0.0));
    match symbol {
        "Fv" => qd,
        "Fc" => positive - negative,
        "Fv+" => qd * positive,
        "Fv-" => qd * negative,
        "Fc+" => positive,
        _ => -negative,
    }
}

#[cfg(test)]
mod tests {
    use super::{LAWS, friction_column};

    #[test]
    fn every_friction_column_has_the_sign_of_the_velocity_and_is_zero_at_rest() {
        for symbol in LAWS.iter().flat_map(|law| law.columns) {
            for qd in [-0.7, 0.7] {
                assert!(friction_column(symbol, qd) * qd >= 0.0, "{symbol} {qd}");
            }
            assert!(
                friction_column(symbol, 0.0).abs() < f64::MIN_POSITIVE,
                "{symbol}"
            );
        }
        assert!(friction_column("Fc-", -0.7) < 0.0);
        assert!(friction_column("Fv-", -0.7) < 0.0);
    }
}
