//! Expressions as a person writes them, in the spec's grammar:
//! `-2*sqrt(3)/(3*a)`, `a^2`, `d4^2 + a3^2`.

use dashu_int::IBig;
#[cfg(test)]
use dashu_ratio::RBig;

use crate::sym::Number;

use super::polynomial::Monomial;
use super::{Polynomial, Ratio, Variables};

/// The factors of a monomial.
fn factors(monomial: &Monomial, variables: &Variables) -> Vec<String> {
    monomial
        .iter()
        .enumerate()
        .filter(|(_, e)| **e > 0)
        .map(|(i, e)| {
            let name = variables.name(i);
            if *e == 1 { name } else { format!("{name}^{e}") }
        })
        .collect()
}

/// A positive coefficient as what stands above and below a fraction line.
fn split(value: &Number) -> (String, String) {
    let text = value.to_string();
    if let Some(rational) = value.as_rational() {
        let (numerator, denominator) = (rational.numerator(), rational.denominator());
        let short = |n: &IBig| n.to_string().len() <= 4;
        if *denominator != dashu_int::UBig::ONE && short(numerator) {
            return (numerator.to_string(), denominator.to_string());
        }
        return (text, String::new());
    }
    // `2*sqrt(3)/3`: the part behind the line is an integer
    if !text.contains(' ')
        && let Some((above, below)) = text.split_once('/')
        && below.bytes().all(|b| b.is_ascii_digit())
    {
        return (above.to_owned(), below.to_owned());
    }
    (text, String::new())
}

/// Whether any of these signs stands outside of parentheses.
fn has_outside(text: &str, signs: &[char]) -> bool {
    let mut depth = 0_usize;
    text.chars().any(|c| {
        match c {
            '(' => depth += 1,
            ')' => depth = depth.saturating_sub(1),
            _ => {}
        }
        depth == 0 && signs.contains(&c)
    })
}

/// A sum needs parentheses as a factor, and behind a minus.
fn guarded(text: String) -> String {
    if has_outside(&text, &[' ']) {
        format!("({text})")
    } else {
        text
    }
}

/// One term without its sign, over a denominator's factors.
fn term(
    coefficient: &Number,
    monomial: &Monomial,
    below: &[String],
    variables: &Variables,
) -> String {
    let (above_number, below_number) = split(&coefficient.abs());
    let mut above = Vec::new();
    let names = factors(monomial, variables);
    if above_number != "1" || names.is_empty() {
        let alone = names.is_empty() && below.is_empty() && below_number.is_empty();
        above.push(if alone && !coefficient.is_negative() {
            above_number
        } else {
            guarded(above_number)
        });
    }
    above.extend(names);
    let mut under: Vec<String> = Vec::new();
    if !below_number.is_empty() {
        under.push(below_number);
    }
    under.extend(below.iter().cloned());
    let above = above.join("*");
    match under.as_slice() {
        [] => above,
        [one] if !has_outside(one, &['*', '/', ' ']) => format!("{above}/{one}"),
        _ => format!("{above}/({})", under.join("*")),
    }
}

/// A polynomial over a denominator's factors, positive terms first.
fn sum(p: &Polynomial, below: &[String], variables: &Variables) -> String {
    let mut terms: Vec<(&Monomial, &Number)> = p.terms.iter().rev().collect();
    terms.sort_by_key(|(_, c)| c.is_negative());
    let mut text = String::new();
    for (monomial, coefficient) in terms {
        let negative = coefficient.is_negative();
        text.push_str(match (text.is_empty(), negative) {
            (true, true) => "-",
            (true, false) => "",
            (false, true) => " - ",
            (false, false) => " + ",
        });
        text.push_str(&term(coefficient, monomial, below, variables));
    }
    if text.is_empty() {
        "0".to_owned()
    } else {
        text
    }
}

/// A polynomial over a monomial: each term in its lowest terms.
fn over_monomial(p: &Polynomial, below: &Monomial, variables: &Variables) -> String {
    let mut terms: Vec<(&Monomial, &Number)> = p.terms.iter().rev().collect();
    terms.sort_by_key(|(_, c)| c.is_negative());
    let mut text = String::new();
    for (monomial, coefficient) in terms {
        let (mut above, mut under) = (monomial.clone(), below.clone());
        for (a, u) in above.iter_mut().zip(&mut under) {
            let common = (*a).min(*u);
            *a -= common;
            *u -= common;
        }
        text.push_str(match (text.is_empty(), coefficient.is_negative()) {
            (true, true) => "-",
            (true, false) => "",
            (false, true) => " - ",
            (false, false) => " + ",
        });
        let under = factors(&under, variables);
        text.push_str(&term(coefficient, &above, &under, variables));
    }
    text
}

/// A quotient.
pub(super) fn ratio(r: &Ratio, variables: &Variables) -> String {
    let (n, d) = (r.numerator(), r.denominator());
    if d.as_constant().is_some() {
        return sum(n, &[], variables);
    }
    if d.terms.len() == 1 {
        let below = d.terms.keys().next().cloned().unwrap_or_default();
        return over_monomial(n, &below, variables);
    }
    let bottom = format!("({})", sum(d, &[], variables));
    if n.terms.len() == 1 {
        return sum(n, &[bottom], variables);
    }
    format!("({})/{bottom}", sum(n, &[], variables))
}

/// A polynomial that is zero by value only, as an equation.
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
        sum(&part(false), &[], variables),
        sum(&part(true), &[], variables)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fractions_split_at_their_line() {
        let two_thirds = Number::from_rational(RBig::from_parts(2.into(), 3u8.into()));
        assert_eq!(split(&two_thirds), ("2".into(), "3".into()));
        assert_eq!(split(&Number::from_i64(5)), ("5".into(), String::new()));
    }
}
