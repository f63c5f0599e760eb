//! Recognition of exact numbers from their leading digits.
//!
//! A fraction is recognised by its continued fraction: if numerator and denominator are short and
//! still agree to 60 digits, no other number is plausible. Sums with square roots are recognised in
//! the same way by an integer relation.

use dashu_int::{IBig, Sign, UBig};
use dashu_ratio::RBig;

use crate::base::certificate::Float320;
use crate::sym::Number;

use super::relation::relation;

/// Number of bits to which a fraction must agree with the value: 60 digits.
const AGREEMENT_BITS: usize = 200;
/// Largest total number of bits of numerator and denominator.
const MAX_FRACTION_BITS: usize = 100;

/// Whether a value is zero up to rounding.
pub(super) fn is_rounding(value: &Float320) -> bool {
    value.log10() < -60.0
}

/// Recognises an exact number from its digits: a fraction, a fraction times a square root, a
/// fraction times or divided by pi or pi^2, or a sum of fractions times square roots of small
/// integers. `None` if no such number agrees.
pub fn recognise(value: &Float320) -> Option<Number> {
    if is_rounding(value) {
        return Some(Number::zero());
    }
    if let Some(found) = fraction(value) {
        return Some(Number::from_rational(found));
    }
    if let Some(found) = of_pi(value) {
        return Some(found);
    }
    if let Some(square) = fraction(&(*value * *value)) {
        let root = Number::from_rational(square).sqrt()?;
        if root.is_exact()
            && agree(
                value,
                &if value.is_negative() {
                    root.neg()
                } else {
                    root.clone()
                },
            )
        {
            return Some(if value.is_negative() {
                root.neg()
            } else {
                root
            });
        }
    }
    const ROOTS: [&[i64]; 4] = [&[3], &[2], &[5], &[2, 3, 6]];
    ROOTS.iter().find_map(|roots| {
        let mut constants = vec![Number::one()];
        for root in *roots {
            constants.push(Number::from_i64(*root).sqrt()?);
        }
        combination(value, &constants)
    })
}

/// A fraction times or divided by pi or pi^2, such as the leads of screws introduce.
fn of_pi(value: &Float320) -> Option<Number> {
    let pi = Number::pi();
    let square = pi.mul(&pi);
    [pi, square].into_iter().find_map(|power| {
        let wide = Float320::from_number(&power);
        if let Some(found) = fraction(&(*value * wide)) {
            return Number::from_rational(found).div(&power);
        }
        let found = fraction(&value.checked_div(wide)?)?;
        Some(Number::from_rational(found).mul(&power))
    })
}

/// A value as a linear combination of constants with short fractions as factors.
pub(super) fn combination(value: &Float320, constants: &[Number]) -> Option<Number> {
    let factors = factors(value, constants)?;
    let mut sum = Number::zero();
    for (factor, constant) in factors.into_iter().zip(constants) {
        sum = sum.add(&Number::from_rational(factor).mul(constant));
    }
    agree(value, &sum).then_some(sum)
}

/// The factors of a value as a linear combination of constants.
pub(super) fn factors(value: &Float320, constants: &[Number]) -> Option<Vec<RBig>> {
    let all: Vec<Float320> = std::iter::once(*value)
        .chain(constants.iter().map(Float320::from_number))
        .collect();
    let integers = relation(&all)?;
    let (first, rest) = integers.split_first()?;
    if *first == IBig::ZERO {
        return None;
    }
    let factor = |n: &IBig| RBig::from(-n.clone()) / RBig::from(first.clone());
    Some(rest.iter().map(factor).collect())
}

/// Whether an exact number agrees with the value to 58 digits.
pub(super) fn agree(value: &Float320, exact: &Number) -> bool {
    let off = *value - Float320::from_number(exact);
    off.is_zero() || off.log10() < value.log10().max(-10.0) - 58.0
}

/// A short fraction that agrees with the value to 60 digits.
fn fraction(value: &Float320) -> Option<RBig> {
    let (negative, magnitude, exponent) = value.binary();
    // value = n / d exactly
    let shift = usize::try_from(exponent.unsigned_abs()).ok()?;
    if shift > 2000 {
        return None;
    }
    let (n, d) = if exponent < 0 {
        (magnitude, UBig::ONE << shift)
    } else {
        (magnitude << shift, UBig::ONE)
    };
    let (mut a, mut b) = (n.clone(), d.clone());
    // convergents p / q of the continued fraction
    let (mut p0, mut q0) = (UBig::ZERO, UBig::ONE);
    let (mut p1, mut q1) = (UBig::ONE, UBig::ZERO);
    while b != UBig::ZERO {
        let quotient = &a / &b;
        let rest = &a - &quotient * &b;
        (a, b) = (b, rest);
        let (p2, q2) = (&quotient * &p1 + &p0, &quotient * &q1 + &q0);
        (p0, q0, p1, q1) = (p1, q1, p2, q2);
        if bits(&p1) + bits(&q1) > MAX_FRACTION_BITS {
            return None;
        }
        // |n/d - p/q| < 2^-200 n/d
        let (left, right) = (&n * &q1, &p1 * &d);
        let off = if left > right {
            &left - &right
        } else {
            &right - &left
        };
        if (off << AGREEMENT_BITS) < left {
            let sign = if negative {
                Sign::Negative
            } else {
                Sign::Positive
            };
            return Some(RBig::from_parts(IBig::from_parts(sign, p1), q1));
        }
    }
    None
}

fn bits(n: &UBig) -> usize {
    use dashu_int::ops::BitTest;
    n.bit_len()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn recognised(exact: &Number) -> Option<Number> {
        recognise(&Float320::from_number(exact))
    }

    #[test]
    fn fractions_and_roots_are_recognised_by_their_digits() {
        let root = |n: i64| Number::from_i64(n).sqrt().unwrap();
        let third = Number::ratio(-1, 3).unwrap();
        let decimal = Number::parse_decimal("12.345").unwrap();
        for exact in [
            Number::zero(),
            third.clone(),
            decimal.clone(),
            root(7).mul(&decimal),
            third.mul(&root(3)).add(&decimal),
            third.mul(&root(6)).sub(&root(2)),
            third.mul(&Number::pi()),
            // the square of a lead of 0.05 m per turn
            Number::ratio(1, 1600).unwrap().div(&pi_to(2)).unwrap(),
        ] {
            assert_eq!(recognised(&exact), Some(exact));
        }
    }

    fn pi_to(power: i64) -> Number {
        Number::pi().powi(power).unwrap()
    }

    #[test]
    fn other_numbers_are_not_taken_for_fractions() {
        assert_eq!(recognised(&pi_to(3)), None);
        assert_eq!(recognised(&Number::pi().add(&Number::one())), None);
        assert_eq!(recognised(&Number::ratio(3, 10).unwrap().sin_cos().0), None);
    }

    #[test]
    fn digits_agree_to_fifty_eight_places_and_no_fewer() {
        let third = Number::ratio(1, 3).unwrap();
        let off = |digits: i32| {
            let ten = Float320::from_f64(10.0).reciprocal().unwrap();
            let small = (0..digits).fold(Float320::ONE, |x, _| x * ten);
            Float320::from_number(&third) + small
        };
        assert!(agree(&Float320::from_number(&third), &third));
        assert!(agree(&off(70), &third));
        assert!(!agree(&off(50), &third) && !agree(&off(3), &third));
    }
}
