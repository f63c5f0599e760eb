//! Numbers of twice the digits of `f64`, as unevaluated sums of two (Dekker, 1971).

use std::ops::{Add, Div, Mul, Neg, Sub};

use regen_runtime::Scalar;

/// The unevaluated sum of a number and its rounding error: 32 digits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Double {
    high: f64,
    low: f64,
}

/// pi / 2 minus its nearest `f64`, as a sum of two.
const HALF_PI_REST: [f64; 2] = [6.123_233_995_736_766e-17, -1.497_384_904_859_17e-33];

impl Double {
    pub(crate) fn new(value: f64) -> Self {
        Self {
            high: value,
            low: 0.0,
        }
    }

    pub(crate) fn to_f64(self) -> f64 {
        self.high + self.low
    }

    /// The exact sum of two numbers of which |a| >= |b| or a is zero.
    fn quick(a: f64, b: f64) -> Self {
        let high = a + b;
        Self {
            high,
            low: b - (high - a),
        }
    }

    /// The exact sum of any two numbers (Knuth).
    fn sum(a: f64, b: f64) -> Self {
        let high = a + b;
        let part = high - a;
        Self {
            high,
            low: (a - (high - part)) + (b - part),
        }
    }

    /// The exact product.
    fn product(a: f64, b: f64) -> Self {
        let high = a * b;
        Self {
            high,
            low: a.mul_add(b, -high),
        }
    }
}

impl Add for Double {
    type Output = Self;
    #[inline(never)]
    fn add(self, other: Self) -> Self {
        let (high, low) = (
            Self::sum(self.high, other.high),
            Self::sum(self.low, other.low),
        );
        let first = Self::quick(high.high, high.low + low.high);
        Self::quick(first.high, first.low + low.low)
    }
}

impl Neg for Double {
    type Output = Self;
    fn neg(self) -> Self {
        Self {
            high: -self.high,
            low: -self.low,
        }
    }
}

impl Sub for Double {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Double {
    type Output = Self;
    #[inline(never)]
    fn mul(self, other: Self) -> Self {
        let exact = Self::product(self.high, other.high);
        Self::quick(
            exact.high,
            exact.low + (self.high * other.low + self.low * other.high),
        )
    }
}

impl Div for Double {
    type Output = Self;
    #[inline(never)]
    fn div(self, other: Self) -> Self {
        let mut quotient = Self::new(self.high / other.high);
        for _ in 0..2 {
            let rest = self - quotient * other;
            quotient = quotient + Self::new(rest.high / other.high);
        }
        quotient
    }
}

impl Scalar for Double {
    type Mask = bool;

    fn splat(self, c: f64) -> Self {
        Self::new(c)
    }

    fn mul_add(self, a: Self, b: Self) -> Self {
        self * a + b
    }

    fn abs(self) -> Self {
        if self.high < 0.0 { -self } else { self }
    }

    fn sign(self) -> Self {
        Self::new(Scalar::sign(self.high))
    }

    fn sqrt(self) -> Self {
        let root = Self::new(self.high.sqrt());
        if root.high == 0.0 {
            return root;
        }
        // one step of Newton's method doubles the digits
        root + (self - root * root) / (root + root)
    }

    #[inline(never)]
    fn sin_cos(self) -> (Self, Self) {
        // quarter turns are subtracted, so that |rest| <= pi / 4
        let turns = (self.high / std::f64::consts::FRAC_PI_2).round();
        let parts = [
            std::f64::consts::FRAC_PI_2,
            HALF_PI_REST[0],
            HALF_PI_REST[1],
        ];
        let rest = parts
            .iter()
            .fold(self, |x, part| x - Double::product(turns, *part));
        let square = rest * rest;
        let (mut sine, mut cosine) = (Self::new(0.0), Self::new(0.0));
        // the first terms left out, rest^32 / 32! and rest^33 / 33!, are below 32 digits
        for k in (0..16_u32).rev() {
            let k = f64::from(2 * k);
            sine = Self::new(1.0) - square * sine / Self::new((k + 2.0) * (k + 3.0));
            cosine = Self::new(1.0) - square * cosine / Self::new((k + 1.0) * (k + 2.0));
        }
        let (sine, cosine) = (rest * sine, cosine);
        match turns.rem_euclid(4.0) {
            0.0 => (sine, cosine),
            1.0 => (cosine, -sine),
            2.0 => (-sine, -cosine),
            _ => (-cosine, sine),
        }
    }

    fn less(self, other: Self) -> bool {
        (self - other).high < 0.0
    }

    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }

    fn all(mask: bool) -> bool {
        mask
    }
}

#[test]
fn sines_and_quotients_have_thirty_digits() {
    let third = Double::new(1.0) / Double::new(3.0);
    assert!((third * Double::new(3.0) - Double::new(1.0)).abs().high < 1e-31);
    for k in -40..40 {
        let x = Double::new(f64::from(k) * 0.37) + Double::new(1e-18);
        let (sine, cosine) = x.sin_cos();
        assert!(
            (sine * sine + cosine * cosine - Double::new(1.0))
                .abs()
                .high
                < 1e-30
        );
        let (twice, _) = (x + x).sin_cos();
        assert!(
            (twice - Double::new(2.0) * sine * cosine).abs().high < 1e-30,
            "{k}"
        );
        assert!((sine.to_f64() - x.to_f64().sin()).abs() < 3e-16);
    }
    // sin(1) and cos(1)
    let (sine, cosine) = Double::new(1.0).sin_cos();
    let known = Double {
        high: 0.841_470_984_807_896_5,
        low: 1.776_845_092_935_536e-18,
    };
    assert!((sine - known).abs().high < 1e-31);
    assert!((cosine.high - 0.540_302_305_868_139_8).abs() < 1e-16);
}
