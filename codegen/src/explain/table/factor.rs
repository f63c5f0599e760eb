//! The factors of combinations as they are printed, with the sign apart, so that terms can be
//! joined.

use crate::base::{Coefficient, Term};

/// The longest expression that [`Style::Short`] prints, in characters.
const MAX_EXPRESSION_CHARS: usize = 60;
/// The longest number that [`Style::Short`] prints within an expression, in digits: longer ones,
/// such as 632337041/115162534, say nothing to a reader.
const MAX_NUMBER_DIGITS: usize = 6;
/// The number of significant digits printed, as in the tables of papers.
const DIGITS: usize = 4;
/// The number of significant digits of a number in place of an expression.
const DIGITS_INSTEAD: usize = 6;

/// How a coefficient is printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// As an expression; long ones as numbers.
    Short,
    /// As an expression of any length.
    Expressions,
    /// Every factor as a number.
    Numbers,
}

/// The absolute value of a coefficient.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Factor {
    /// 1, which is not printed.
    One,
    /// An expression, printed in full.
    Expression(Coefficient),
    /// A number, because [`Style::Numbers`] was chosen.
    Number(String),
    /// A number in place of a long expression.
    Instead(String),
}

/// A coefficient: whether it is subtracted, and its absolute value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Signed {
    pub(super) negative: bool,
    pub(super) factor: Factor,
}

impl Signed {
    /// The coefficient of a term.
    pub(super) fn new(term: &Term, style: Style) -> Self {
        let (negative, expression) = term.coefficient.unsigned();
        let number = |places| digits(term.value.to_f64().abs(), places);
        let factor = match style {
            _ if expression.is_one() => Factor::One,
            Style::Numbers => Factor::Number(number(DIGITS)),
            Style::Short if is_long(&expression.to_string()) => {
                Factor::Instead(number(DIGITS_INSTEAD))
            }
            Style::Short | Style::Expressions => Factor::Expression(expression),
        };
        let negative = match factor {
            Factor::Number(_) | Factor::Instead(_) => term.value.is_negative(),
            Factor::One | Factor::Expression(_) => negative,
        };
        Self { negative, factor }
    }
}

/// Whether an expression is too long to be read, or contains a number that is.
fn is_long(text: &str) -> bool {
    text.chars().count() > MAX_EXPRESSION_CHARS || has_long_number(text)
}

/// Whether an expression contains a whole number with too many digits.
fn has_long_number(text: &str) -> bool {
    let mut runs = text.split(|c: char| !c.is_ascii_digit());
    runs.any(|run| run.len() > MAX_NUMBER_DIGITS)
}

/// A number in this many significant digits, or fewer where it has no more. The shortest decimal that
/// reads back to the double is rounded, not the binary value: 0.22815 becomes 0.2282, as on paper.
fn digits(value: f64, count: usize) -> String {
    let whole = format!("{value:e}");
    let (mantissa, exponent) = whole.split_once('e').unwrap_or((&whole, "0"));
    let all: Vec<u8> = mantissa.bytes().filter(u8::is_ascii_digit).collect();
    let mut exponent: i32 = exponent.parse().unwrap_or(0);
    let mut kept: Vec<u8> = all.iter().copied().take(count).collect();
    if all.get(count).is_some_and(|&next| next >= b'5') {
        let nines = kept.iter().rev().take_while(|&&d| d == b'9').count();
        let end = kept.len() - nines;
        for digit in kept.iter_mut().skip(end) {
            *digit = b'0';
        }
        if let Some(digit) = kept.get_mut(end.wrapping_sub(1)) {
            *digit += 1;
        } else {
            kept.rotate_right(1);
            if let Some(first) = kept.first_mut() {
                *first = b'1';
            }
            exponent += 1;
        }
    }
    let mut text: String = kept.iter().map(|&d| char::from(d)).collect();
    match usize::try_from(exponent) {
        Ok(places) if places < count => {
            // digits before the point
            while text.len() <= places {
                text.push('0');
            }
            if text.len() > places + 1 {
                text.insert(places + 1, '.');
            }
            text
        }
        Err(_) if exponent >= -4 => {
            let zeros = usize::try_from(-1 - exponent).unwrap_or(0);
            format!("0.{}{text}", "0".repeat(zeros))
        }
        _ => {
            if text.len() > 1 {
                text.insert(1, '.');
            }
            format!("{text}e{exponent}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sym::Number;

    fn expression(text: &str) -> Factor {
        Factor::Expression(Coefficient::parse(text).unwrap())
    }

    fn signed(coefficient: &str, value: Number, style: Style) -> Signed {
        let term = Term {
            column: 0,
            coefficient: Coefficient::parse(coefficient).unwrap(),
            value,
        };
        Signed::new(&term, style)
    }

    #[test]
    fn numbers_have_four_digits_unless_they_need_fewer() {
        for (value, text) in [
            (2.530_66, "2.531"),
            (0.208_209_7, "0.2082"),
            (0.456_3, "0.4563"),
            (0.228_15, "0.2282"),
            (0.5, "0.5"),
            (0.0, "0"),
            (20.0, "20"),
            (9.9999, "10.00"),
            (9_999.9, "1.000e4"),
            (2.0, "2"),
            (1.999_96, "2.000"),
            (99.999, "100.0"),
            (12_346.0, "1.235e4"),
            (1000.0, "1000"),
            (0.000_123_456, "0.0001235"),
            (0.000_012_345_6, "1.235e-5"),
        ] {
            assert_eq!(digits(value, DIGITS), text);
        }
    }

    #[test]
    fn long_expressions_become_numbers_unless_expressions_are_asked_for() {
        let long = format!("-{}a", "b*".repeat(30));
        let half = Number::ratio(-1, 2).unwrap_or_else(Number::zero);
        let instead = signed(&long, half.clone(), Style::Short);
        assert!(instead.negative);
        assert_eq!(instead.factor, Factor::Instead("0.5".to_owned()));
        let full = signed(&long, half.clone(), Style::Expressions);
        assert_eq!(full.factor, expression(&long[1..]));
        let sixty = format!("{}ab", "b*".repeat(29));
        assert_eq!((sixty.len(), long.len()), (60, 62));
        let just = signed(&format!("-{sixty}"), half, Style::Short);
        assert_eq!(just.factor, expression(&sixty));
    }

    #[test]
    fn fractions_of_long_numbers_become_decimals() {
        let ratio = Number::ratio(632_337_041, 115_162_534).unwrap_or_else(Number::zero);
        let short = signed("632337041/115162534", ratio.clone(), Style::Short);
        assert_eq!(short.factor, Factor::Instead("5.49082".to_owned()));
        let full = signed("632337041/115162534", ratio, Style::Expressions);
        assert_eq!(full.factor, expression("632337041/115162534"));
        assert!(!has_long_number("123456/654321*a"));
    }

    #[test]
    fn one_is_not_printed_but_a_number_that_rounds_to_it_is() {
        let one = signed("-1", Number::from_i64(-1), Style::Numbers);
        assert_eq!((one.negative, one.factor), (true, Factor::One));
        let near = Number::ratio(1_000_001, 1_000_000).unwrap_or_else(Number::zero);
        let near = signed("a", near, Style::Numbers);
        assert_eq!(near.factor, Factor::Number("1.000".to_owned()));
    }
}
