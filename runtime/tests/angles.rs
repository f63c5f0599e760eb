//! Compares sines and cosines of several angles at once with a reference in double-double
//! arithmetic.
#![cfg(feature = "std")]

use core::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use proptest::prelude::*;
use regen_runtime::Scalar;

/// A number as an unevaluated sum of two `f64`, with some 106 bits (Dekker, 1971).
#[derive(Clone, Copy)]
struct Double(f64, f64);

fn two_sum(a: f64, b: f64) -> Double {
    let sum = a + b;
    let from_b = sum - a;
    Double(sum, (a - (sum - from_b)) + (b - from_b))
}

fn two_product(a: f64, b: f64) -> Double {
    let product = a * b;
    Double(product, f64::mul_add(a, b, -product))
}

impl Double {
    fn plus(self, other: Double) -> Double {
        let (high, low) = (two_sum(self.0, other.0), two_sum(self.1, other.1));
        let middle = two_sum(high.0, high.1 + low.0);
        two_sum(middle.0, middle.1 + low.1)
    }

    fn times(self, other: Double) -> Double {
        let product = two_product(self.0, other.0);
        two_sum(product.0, product.1 + (self.0 * other.1 + self.1 * other.0))
    }

    fn over(self, divisor: f64) -> Double {
        let quotient = self.0 / divisor;
        let back = two_product(quotient, -divisor);
        let rest = self.plus(back);
        two_sum(quotient, (rest.0 + rest.1) / divisor)
    }
}

/// Sine and cosine by reduction with 159 bits of pi/2 and the power series.
fn reference(x: f64) -> (Double, Double) {
    const HALF_PI: [f64; 3] = [
        FRAC_PI_2,
        6.123_233_995_736_766e-17,
        -1.497_384_904_859_183_3e-33,
    ];
    let quarters = (x / FRAC_PI_2).round();
    let y = HALF_PI.iter().fold(Double(x, 0.0), |rest, part| {
        rest.plus(two_product(-quarters, *part))
    });
    let square = y.times(y);
    let series = |first: Double, start: f64| {
        let (mut sum, mut term, mut n) = (first, first, start);
        while n < 40.0 {
            term = term.times(square).over(-(n + 1.0) * (n + 2.0));
            sum = sum.plus(term);
            n += 2.0;
        }
        sum
    };
    let (sin, cos) = (series(y, 1.0), series(Double(1.0, 0.0), 0.0));
    let minus = |d: Double| Double(-d.0, -d.1);
    #[allow(clippy::cast_sign_loss, reason = "0 to 3")]
    match quarters.rem_euclid(4.0) as u8 {
        0 => (sin, cos),
        1 => (cos, minus(sin)),
        2 => (minus(sin), minus(cos)),
        _ => (minus(cos), sin),
    }
}

/// The error of a result, in units of the last place of the exact one.
fn ulps(found: f64, exact: Double) -> f64 {
    let size = exact.0.abs();
    let ulp = f64::from_bits(size.to_bits() + 1) - size;
    ((found - exact.0) - exact.1).abs() / ulp
}

fn worst(angles: [f64; 5]) -> f64 {
    let results = f64::sin_cos_all(angles);
    let errors = angles.iter().zip(results).map(|(x, (sin, cos))| {
        let exact = reference(*x);
        ulps(sin, exact.0).max(ulps(cos, exact.1))
    });
    errors.fold(0.0, f64::max)
}

#[test]
fn the_reference_is_accurate_near_a_multiple_of_pi() {
    // 355 is 3.0e-5 above 113 pi: sin 355 = -3.0144353359488449e-5
    let (sin, cos) = reference(355.0);
    assert!((sin.0 + 3.014_435_335_948_845e-5).abs() < 1e-20);
    assert!((cos.0 + (1.0 - sin.0 * sin.0).sqrt()).abs() < 1e-15);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn sine_and_cosine_are_within_one_ulp_up_to_two_to_the_twentieth(
        small in -FRAC_PI_4..FRAC_PI_4,
        usual in -10.0..10.0_f64,
        wide in -1_048_576.0..1_048_576.0_f64,
        quarters in -667_000..667_000_i32,
        off in -3..=3_i64,
    ) {
        let near = f64::from(quarters) * FRAC_PI_2;
        let near = f64::from_bits(near.to_bits().wrapping_add_signed(if quarters == 0 { 0 } else { off }));
        let error = worst([small, usual, wide, near, small * 1e-9]);
        prop_assert!(error <= 1.0, "{error} ulp");
    }
}

#[test]
fn beyond_their_range_sine_and_cosine_are_those_of_the_standard_library() {
    let angles = [1e22, -3e7, 0.5, f64::MAX];
    for (found, x) in f64::sin_cos_all(angles).iter().zip(angles) {
        assert_eq!(*found, Scalar::sin_cos(x));
    }
    let [(sin, cos), (other, _)] = f64::sin_cos_all([f64::NAN, 1.0]);
    assert!(sin.is_nan() && cos.is_nan());
    assert!((other - 1.0_f64.sin()).abs() < 1e-15);
}

/// Incomplete registers are padded with zeros; the result of an angle must not depend on how many
/// angles there are, or on its position among them.
#[test]
fn an_angle_gives_the_same_among_any_number_of_others() {
    fn check<const N: usize>() {
        let angles: [f64; N] = std::array::from_fn(|i| 0.37 * (i as f64 + 1.0) - 2.0);
        for (x, found) in angles.iter().zip(f64::sin_cos_all(angles)) {
            assert_eq!(found, f64::sin_cos_all([*x])[0], "{x} among {N}");
            assert!((found.0 - x.sin()).abs() < 1e-15 && (found.1 - x.cos()).abs() < 1e-15);
        }
    }
    check::<2>();
    check::<4>();
    check::<5>();
    check::<7>();
    check::<8>();
    check::<9>();
    check::<13>();
    check::<17>();
    assert_eq!(f64::sin_cos_all([]), []);
}

/// Draws two hundred thousand angles, or two million in `.ci/full`; prints the largest error.
#[test]
fn largest_error() {
    let rounds = match std::env::var_os("REGEN_FULL") {
        Some(_) => 400_000,
        None => 40_000,
    };
    let mut most = 0.0_f64;
    let mut state = 1_u64;
    for _ in 0..rounds {
        let angles = [7.0, 0.8, 100.0, 1e4, 1_048_575.0].map(|size| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            size * ((state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0)
        });
        most = most.max(worst(angles));
    }
    println!("{most} ulp");
    assert!(most <= 1.0);
}
