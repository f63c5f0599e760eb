//! Expressions in the spec's grammar, as a person writes them: `-2*sqrt(3)/(3*a)`, `a^2`, `d4^2 +
//! a3^2`.

use dashu_int::IBig;
#[cfg(test)]
use dashu_ratio::RBig;

use crate::base::Coefficient;
use crate::sym::Number;

use super::polynomial::{Monomial, lowest};
use super::{Polynomial, Ratio, Variables};

/// The factors of a monomial: powers of variables.
fn factors(monomial: &Monomial, variables: &Variables) -> Vec<Coefficient> {
    monomial
        .iter()
        .enumerate()
        .filter(|(_, e)| **e > 0)
        .map(|(i, e)| {
            let name = variables.name(i);
            if *e == 1 {
                name
            } else {
                name.raised(Coefficient::integer(e))
            }
        })
        .collect()
}

/// Splits a positive number into what is printed above the fraction line, and the integer below it
/// if there is one.
fn split(value: &Number) -> (Coefficient, Option<Coefficient>) {
    if let Some(rational) = value.as_rational() {
        let (numerator, denominator) = (rational.numerator(), rational.denominator());
        let short = |n: &IBig| n.to_string().len() <= 4;
        if *denominator != dashu_int::UBig::ONE && short(numerator) {
            let above = Coefficient::integer(numerator);
            return (above, Some(Coefficient::integer(denominator)));
        }
        return (value.into(), None);
    }
    match value.into() {
        // `2*sqrt(3)/3`
        Coefficient::Quotient(above, below) if matches!(*below, Coefficient::Number(_)) => {
            (*above, Some(*below))
        }
        whole => (whole, None),
    }
}

/// One term without its sign, divided by the factors in `below`.
fn term(
    coefficient: &Number,
    monomial: &Monomial,
    below: &[Coefficient],
    variables: &Variables,
) -> Coefficient {
    let (number, divisor) = split(&coefficient.abs());
    let names = factors(monomial, variables);
    let written = !number.is_one() || names.is_empty();
    let above = written.then_some(number).into_iter().chain(names);
    let below = divisor.into_iter().chain(below.iter().cloned());
    let above = above.reduce(Coefficient::times);
    let above = above.unwrap_or_else(|| Coefficient::integer(1));
    match below.reduce(Coefficient::times) {
        Some(below) => above.over(below),
        None => above,
    }
}

/// The sum of a polynomial's terms, each printed by `print`, positive terms first.
fn sum(p: &Polynomial, print: impl Fn(&Number, &Monomial) -> Coefficient) -> Coefficient {
    let mut terms: Vec<(&Monomial, &Number)> = p.terms.iter().rev().collect();
    terms.sort_by_key(|(_, c)| c.is_negative());
    let terms = terms.into_iter();
    Coefficient::sum(terms.map(|(m, c)| (c.is_negative(), print(c, m))))
}

/// A polynomial divided by the factors in `below`, term by term.
fn over(p: &Polynomial, below: &[Coefficient], variables: &Variables) -> Coefficient {
    sum(p, |c, m| term(c, m, below, variables))
}

/// A polynomial divided by a monomial, each term in lowest terms.
fn over_monomial(p: &Polynomial, below: &Monomial, variables: &Variables) -> Coefficient {
    sum(p, |coefficient, monomial| {
        let (above, under) = lowest(monomial, below);
        let under = factors(&under, variables);
        term(coefficient, &above, &under, variables)
    })
}

/// How long a polynomial is: its number of terms, and the sum of all powers.
fn size(p: &Polynomial) -> (usize, u32) {
    let powers = p.terms.keys().flatten();
    (p.terms.len(), powers.map(|e| u32::from(*e)).sum())
}

/// A polynomial with other functions of named angles wherever these make it shorter: sin^2 in place of
/// 1 - cos^2, and sines of twice an angle in place of products, which are added to the variables.
fn shortest(p: &Polynomial, variables: &mut Variables) -> Polynomial {
    let mut best = p.clone();
    let used = p.variables_used();
    let angles: Vec<(usize, usize)> = variables
        .named_sines()
        .filter(|(sine, cosine)| used.contains(sine) || used.contains(cosine))
        .collect();
    for (sine, cosine) in angles {
        let squares = best.with_squares_of_sine(cosine, sine);
        let mut own = best.clone();
        if size(&squares) < size(&own) {
            own = squares;
        }
        if own.terms.len() > 1
            && let Some((double_sine, double_cosine)) = variables.doubled(sine)
        {
            let doubled = best.with_double_angle([sine, cosine], [double_sine, double_cosine]);
            let squares = doubled.with_squares_of_sine(double_cosine, double_sine);
            for other in [doubled, squares] {
                if other.terms.len() < own.terms.len() {
                    own = other;
                }
            }
        }
        best = own;
    }
    best
}

/// A quotient as it is printed.
pub(super) fn ratio(r: &Ratio, variables: &Variables) -> Coefficient {
    let (n, d) = (r.numerator(), r.denominator());
    let mut variables = variables.clone();
    let (n, d) = (shortest(n, &mut variables), shortest(d, &mut variables));
    let variables = &variables;
    // the leading coefficient of the denominator is 1 again
    let inverse = d.leading().and_then(|(_, lead)| Number::one().div(lead));
    let inverse = inverse.unwrap_or_else(Number::one);
    let (n, d) = &(n.scaled(&inverse), d.scaled(&inverse));
    if d.as_constant().is_some() {
        return over(n, &[], variables);
    }
    if d.terms.len() == 1 {
        let below = d.terms.keys().next().cloned().unwrap_or_default();
        return over_monomial(n, &below, variables);
    }
    let bottom = over(d, &[], variables);
    if n.terms.len() == 1 {
        return over(n, &[bottom], variables);
    }
    over(n, &[], variables).over(bottom)
}

/// The equation for a polynomial that is zero by value only, such as `l1 = l2`.
pub(super) fn coincidence(p: &Polynomial, variables: &Variables) -> String {
    let p = p.without(&p.common_monomial());
    let p = match p.leading().and_then(|(_, c)| Number::one().div(c)) {
        Some(inverse) => p.scaled(&inverse),
        None => p,
    };
    let part = |negative: bool| -> Polynomial {
        let mut part = Polynomial::default();
        for (m, c) in p.terms.iter().filter(|(_, c)| c.is_negative() == negative) {
            part.terms.insert(m.clone(), c.abs());
        }
        part
    };
    format!(
        "{} = {}",
        over(&part(false), &[], variables),
        over(&part(true), &[], variables)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fractions_split_at_their_line() {
        let two_thirds = Number::from_rational(RBig::from_parts(2.into(), 3u8.into()));
        let integer = |n: u8| Coefficient::integer(n);
        assert_eq!(split(&two_thirds), (integer(2), Some(integer(3))));
        assert_eq!(split(&Number::from_i64(5)), (integer(5), None));
    }
}
