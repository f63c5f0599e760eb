//! Numbers as a person writes them.

use core::fmt;

use dashu_int::UBig;
use dashu_int::ops::UnsignedAbs;
use dashu_ratio::RBig;

use super::super::real::Real;
use super::super::surd::Term;
use super::Number;

/// Fractions up to this denominator stay fractions, `1/2` rather than `0.5`.
const MAX_FRACTION: u8 = 64;
/// Decimals up to this many places are written out.
const MAX_PLACES: usize = 12;

/// The exact form, such as `-1/2`, `0.4563`, `2*sqrt(3)/3`, `5*pi/6` or `1/4 + sqrt(5)/4`;
/// of an inexact number 17 significant digits.
impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(exact) = &self.0.exact else {
            return f.write_str(&inexact_text(self.real()));
        };
        let terms = exact.terms();
        // a positive term first reads best
        let lead = terms
            .iter()
            .position(|term| !term.is_negative())
            .unwrap_or(0);
        let Some(first) = terms.get(lead) else {
            return f.write_str("0");
        };
        let minus = if first.is_negative() { "-" } else { "" };
        write!(f, "{minus}{}", unsigned_term(first))?;
        for (_, term) in terms.iter().enumerate().filter(|(index, _)| *index != lead) {
            let sign = if term.is_negative() { '-' } else { '+' };
            write!(f, " {sign} {}", unsigned_term(term))?;
        }
        Ok(())
    }
}

impl fmt::Debug for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let relation = if self.is_exact() { "" } else { "~" };
        write!(f, "Number({relation}{self})")
    }
}

fn unsigned_term(term: &Term) -> String {
    let (mut factors, mut divisors) = (Vec::new(), Vec::new());
    if let Some(decimal) = short_decimal(&term.coefficient) {
        factors.push(decimal);
    } else {
        let numerator = term.coefficient.numerator().unsigned_abs();
        if !numerator.is_one() {
            factors.push(numerator.to_string());
        }
        if !term.coefficient.denominator().is_one() {
            divisors.push(term.coefficient.denominator().to_string());
        }
    }
    if term.radicand > 1 {
        factors.push(format!("sqrt({})", term.radicand));
    }
    let pi = match term.pi_power.unsigned_abs() {
        1 => "pi".to_owned(),
        power => format!("pi^{power}"),
    };
    match term.pi_power {
        0 => {}
        1.. => factors.push(pi),
        _ => divisors.push(pi),
    }
    if factors.is_empty() {
        factors.push("1".to_owned());
    }
    let numerator = factors.join("*");
    match divisors.as_slice() {
        [] => numerator,
        [divisor] => format!("{numerator}/{divisor}"),
        _ => format!("{numerator}/({})", divisors.join("*")),
    }
}

/// The magnitude, if its denominator is large and it ends within a few places.
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

fn inexact_text(value: &Real) -> String {
    let minus = if value.is_negative() { "-" } else { "" };
    let Some((digits, exponent)) = value.decimal_digits() else {
        let (_, mantissa, exponent) = value.rounded(53);
        return format!("{minus}{mantissa}*2^{exponent}");
    };
    let digits = digits.to_string();
    let (first, rest) = digits.split_at(1);
    match usize::try_from(exponent) {
        Ok(whole) if whole < rest.len() => {
            let (whole, fraction) = digits.split_at(whole + 1);
            format!("{minus}{whole}.{fraction}")
        }
        Err(_) if exponent >= -5 => {
            let zeros = "0".repeat((exponent.unsigned_abs() - 1) as usize);
            format!("{minus}0.{zeros}{digits}")
        }
        _ => format!("{minus}{first}.{rest}e{exponent}"),
    }
}
