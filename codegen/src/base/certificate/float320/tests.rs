#![allow(clippy::unwrap_used, clippy::expect_used)]

use dashu_ratio::RBig;
use proptest::prelude::*;

use super::Float320;
use crate::sym::Number;

/// The exact value of a number.
fn rational(x: &Float320) -> RBig {
    let base = Number::from_i64(2);
    let power = |e: i32| base.powi(i64::from(e)).unwrap();
    let mut sum = Number::zero();
    for (word, place) in x.words.iter().rev().zip(1..) {
        let place = power(x.exponent.max(-600) - 64 * place);
        let high = Number::from_i64((word >> 32).cast_signed()).mul(&power(32));
        let low = Number::from_i64((word & 0xffff_ffff).cast_signed());
        sum = sum.add(&high.add(&low).mul(&place));
    }
    let sum = if x.is_negative() { sum.neg() } else { sum };
    sum.as_rational().unwrap()
}

/// Whether `x` equals `exact` up to `ulps` units in the last of 320 bits.
fn close(x: &Float320, exact: &RBig, ulps: u32) -> bool {
    let unit = Number::from_i64(2)
        .powi(-319)
        .unwrap()
        .as_rational()
        .unwrap();
    let abs = |r: RBig| if r < RBig::ZERO { -r } else { r };
    let error = abs(rational(x) - exact);
    error <= abs(exact.clone()) * unit * RBig::from(ulps)
}

/// Values that use all bits, with different exponents.
fn wide() -> impl Strategy<Value = Float320> {
    let parts = (any::<[u64; 5]>(), -100..100i32, any::<bool>(), 0..4usize);
    parts.prop_map(|(mut words, exponent, negative, zeros)| {
        // some with many trailing zeros, so that sums cancel and carry
        words.iter_mut().take(zeros).for_each(|w| *w = 0);
        words[4] |= 1 << 63;
        Float320 {
            words,
            exponent,
            negative,
        }
    })
}

proptest! {
    #[test]
    fn sums_and_differences_are_rounded_exact_ones(a in wide(), b in wide()) {
        prop_assert!(close(&(a + b), &(rational(&a) + rational(&b)), 1));
        prop_assert!(close(&(a - b), &(rational(&a) - rational(&b)), 1));
    }

    #[test]
    fn a_cancelling_difference_is_exact(a in wide(), low in any::<u64>(), shift in 0..200i32) {
        let b = a + Float320 { words: [0, 0, 0, low, 1 << 63], exponent: a.exponent - shift, negative: false };
        prop_assert!(close(&(b - a), &(rational(&b) - rational(&a)), 1));
        prop_assert!((a - a).is_zero());
    }

    #[test]
    fn products_and_quotients_are_rounded_exact_ones(a in wide(), b in wide()) {
        prop_assert!(close(&(a * b), &(rational(&a) * rational(&b)), 1));
        prop_assert!(close(&a.checked_div(b).unwrap(), &(rational(&a) / rational(&b)), 2));
    }

    #[test]
    fn a_root_squared_is_the_value(a in wide()) {
        let root = a.abs().sqrt().unwrap();
        let exact = rational(&root);
        prop_assert!(close(&a.abs(), &(exact.clone() * exact), 8));
    }

    #[test]
    fn order_is_that_of_the_values(a in wide(), b in wide()) {
        prop_assert_eq!(a.cmp(&b), rational(&a).cmp(&rational(&b)));
    }

    #[test]
    fn doubles_are_converted_there_and_back_without_change(x in any::<f64>()) {
        if x.is_normal() {
            prop_assert_eq!(Float320::from_f64(x).to_f64().to_bits(), x.to_bits());
        }
    }

    #[test]
    fn sine_and_cosine_are_those_of_exact_numbers(n in -40_000..40_000i64, d in 1..4000i64) {
        let angle = Number::ratio(n, d).unwrap();
        let (sine, cosine) = angle.sin_cos();
        let (s, c) = Float320::from_number(&angle).sin_cos();
        for (x, exact) in [(s, sine), (c, cosine)] {
            let error = (x - Float320::from_number(&exact)).log10();
            prop_assert!(error < -88.0, "{n}/{d}: 1e{error}");
        }
    }
}

#[test]
fn numbers_keep_320_bits() {
    let root = Number::from_i64(2).sqrt().unwrap();
    let x = Float320::from_number(&root);
    assert!((x * x - Float320::from_f64(2.0)).log10() < -95.0);
    assert_eq!(
        Float320::from_number(&Number::from_i64(-3)),
        Float320::from_f64(-3.0)
    );
    assert!(Float320::from_number(&Number::zero()).is_zero());
    let tiny = Number::parse_decimal("1e-300").unwrap();
    assert!((Float320::from_number(&tiny).log10() + 300.0).abs() < 1e-9);
}

#[test]
fn zero_has_no_inverse_and_minus_one_no_root() {
    assert!(Float320::ZERO.reciprocal().is_none());
    assert!(Float320::ONE.checked_div(Float320::ZERO).is_none());
    assert!((-Float320::ONE).sqrt().is_none());
}
