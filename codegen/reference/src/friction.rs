//! The friction of a joint: the columns of linear laws, and the effort of every law, written as its
//! source prints it.

use crate::mechanism::Mechanism;

/// The friction law of a coordinate.
#[derive(Clone, Copy, Debug)]
pub struct Friction {
    /// The law's word in the spec.
    pub word: &'static str,
    /// The symbols of its columns; empty for a law that is not linear.
    pub columns: &'static [&'static str],
    effort: Effort,
}

/// How the effort is computed from the values of the symbols.
#[derive(Clone, Copy, Debug)]
enum Effort {
    /// The sum of the columns times their values.
    Columns,
    /// Another function of the values of these symbols, the velocity and its sign.
    Of(&'static [&'static str], fn(&[f64], f64, f64) -> f64),
}

/// All laws.
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
    /// The law of a word in the spec.
    pub(crate) fn of(word: &str) -> Option<Friction> {
        LAWS.into_iter().find(|law| law.word == word)
    }

    /// Whether the effort is not linear in its coefficients.
    pub fn is_nonlinear(&self) -> bool {
        matches!(self.effort, Effort::Of(..))
    }
}

impl Mechanism {
    /// The effort, N m or N, that friction takes from a coordinate at the velocity `v`, rad/s or
    /// m/s, with the spec's nominal values: positive where it opposes a positive velocity. `None`
    /// where a value is missing.
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

/// The regressor's entry of a friction parameter in the row of its joint.
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
    fn every_friction_parameter_opposes_the_motion_and_vanishes_at_rest() {
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
