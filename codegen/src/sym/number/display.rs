//! Numbers as a person writes them.

use core::fmt;

use dashu_int::UBig;
use dashu_int::ops::UnsignedAbs;
use dashu_ratio::RBig;

use super::super::big_float::BigFloat;
use super::super::surd::Term;
use super::Number;

/// Fractions up to this denominator are written as fractions, `1/2` rather than `0.5`.
const MAX_FRACTION: u8 = 64;
/// Decimals of up to this number of places are written in full.
const MAX_PLACES: usize = 12;

/// A term of a number as it is written: the factors above and below the fraction line.
pub(crate) struct NumberTerm {
    pub(crate) negative: bool,
    pub(crate) above: Vec<NumberFactor>,
    pub(crate) below: Vec<NumberFactor>,
}

/// A factor of a term.
pub(crate) enum NumberFactor {
    /// Decimal digits: `3`, `0.25`, `1.5e-3`.
    Numeric(String),
    /// The square root of an integer.
    Root(u128),
    /// A power of pi.
    Pi(u32),
    /// A power of two.
    Two(i64),
}

impl Number {
    /// The terms of the exact form, starting with a positive one if there is one; of an inexact
    /// number, a single term with 17 significant digits.
    pub(crate) fn written(&self) -> Vec<NumberTerm> {
        let Some(exact) = &self.0.exact else {
            return vec![inexact(self.real())];
        };
        let terms = exact.terms();
        // a positive term comes first, as a person writes it
        let lead = terms
            .iter()
            .position(|term| !term.is_negative())
            .unwrap_or(0);
        let Some(first) = terms.get(lead) else {
            return vec![NumberTerm {
                negative: false,
                above: vec![NumberFactor::Numeric("0".to_owned())],
                below: Vec::new(),
            }];
        };
        let others = terms.iter().enumerate().filter(|(at, _)| *at != lead);
        let others = others.map(|(_, term)| written(term));
        std::iter::once(written(first)).chain(others).collect()
    }
}

/// Writes the exact form, such as `-1/2`, `0.4563`, `2*sqrt(3)/3`, `5*pi/6` or `1/4 + sqrt(5)/4`;
/// of an inexact number, 17 significant digits.
impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (k, term) in self.written().iter().enumerate() {
            f.write_str(match (k, term.negative) {
                (0, true) => "-",
                (0, false) => "",
                (_, true) => " - ",
                (_, false) => " + ",
            })?;
            factors(f, &term.above)?;
            match term.below.as_slice() {
                [] => {}
                [one] => write!(f, "/{one}")?,
                several => {
                    f.write_str("/(")?;
                    factors(f, several)?;
                    f.write_str(")")?;
                }
            }
        }
        Ok(())
    }
}

fn factors(f: &mut fmt::Formatter<'_>, all: &[NumberFactor]) -> fmt::Result {
    for (k, factor) in all.iter().enumerate() {
        let joint = if k == 0 { "" } else { "*" };
        write!(f, "{joint}{factor}")?;
    }
    Ok(())
}

impl fmt::Display for NumberFactor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NumberFactor::Numeric(digits) => f.write_str(digits),
            NumberFactor::Root(radicand) => write!(f, "sqrt({radicand})"),
            NumberFactor::Pi(1) => f.write_str("pi"),
            NumberFactor::Pi(power) => write!(f, "pi^{power}"),
            NumberFactor::Two(exponent) => write!(f, "2^{exponent}"),
        }
    }
}

impl fmt::Debug for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let relation = if self.is_exact() { "" } else { "~" };
        write!(f, "Number({relation}{self})")
    }
}

fn written(term: &Term) -> NumberTerm {
    let (mut above, mut below) = (Vec::new(), Vec::new());
    if let Some(decimal) = short_decimal(&term.coefficient) {
        above.push(NumberFactor::Numeric(decimal));
    } else {
        let numerator = term.coefficient.numerator().unsigned_abs();
        if !numerator.is_one() {
            above.push(NumberFactor::Numeric(numerator.to_string()));
        }
        if !term.coefficient.denominator().is_one() {
            let denominator = term.coefficient.denominator().to_string();
            below.push(NumberFactor::Numeric(denominator));
        }
    }
    if term.radicand > 1 {
        above.push(NumberFactor::Root(term.radicand));
    }
    let pi = NumberFactor::Pi(term.pi_power.unsigned_abs());
    match term.pi_power {
        0 => {}
        1.. => above.push(pi),
        _ => below.push(pi),
    }
    if above.is_empty() {
        above.push(NumberFactor::Numeric("1".to_owned()));
    }
    NumberTerm {
        negative: term.is_negative(),
        above,
        below,
    }
}

/// The magnitude as a decimal, if its denominator is large and it has few places.
fn short_decimal(value: &RBig) -> Option<String> {
    let denominator = value.denominator();
    if denominator <= &UBig::from(MAX_FRACTION) {
        return None;
    }
    let mut rest = denominator.clone();
    let twos = rest.remove(&UBig::from(2u8)).unwrap_or(0);
    let fives = rest.remove(&UBig::from(5u8)).unwrap_or(0);
    let places = twos.max(fives);
    if !rest.is_one() || places > MAX_PLACES {
        return None;
    }
    let scaled = value.numerator().unsigned_abs() * UBig::from(10u8).pow(places) / denominator;
    let digits = format!("{:0>width$}", scaled.to_string(), width = places + 1);
    let (whole, fraction) = digits.split_at(digits.len() - places);
    Some(format!("{whole}.{fraction}"))
}

fn inexact(value: &BigFloat) -> NumberTerm {
    let above = if let Some((digits, exponent)) = value.decimal_digits() {
        vec![NumberFactor::Numeric(decimal(
            &digits.to_string(),
            exponent,
        ))]
    } else {
        let (_, mantissa, exponent) = value.rounded(53);
        let mantissa = NumberFactor::Numeric(mantissa.to_string());
        vec![mantissa, NumberFactor::Two(exponent)]
    };
    NumberTerm {
        negative: value.is_negative(),
        above,
        below: Vec::new(),
    }
}

/// Writes digits with the decimal point after the first one, times a power of ten, as a person
/// does.
fn decimal(digits: &str, exponent: i64) -> String {
    let (first, rest) = digits.split_at(1);
    match usize::try_from(exponent) {
        Ok(whole) if whole < rest.len() => {
            let (whole, fraction) = digits.split_at(whole + 1);
            format!("{whole}.{fraction}")
        }
        Err(_) if exponent >= -5 => {
            let zeros = "0".repeat((exponent.unsigned_abs() - 1) as usize);
            format!("0.{zeros}{digits}")
        }
        _ => format!("{first}.{rest}e{exponent}"),
    }
}
