//! Binary floating point with a fixed mantissa of 320 bits, made for speed: five words, no
//! allocation, `Copy`.
//!
//! The exact numbers use `BigFloat` instead, which has as many bits in an allocated integer and
//! treats close values as equal. Neither suits the elimination of a large matrix, where remainders
//! must stay visible.

mod functions;
#[cfg(test)]
mod tests;

use core::cmp::Ordering;
use core::ops::{Add, Mul, Neg, Sub};

use dashu_int::UBig;

use crate::sym::Number;

/// Words of a mantissa.
const WORDS: usize = 5;
/// Bits of a mantissa.
const BITS: u32 = 64 * WORDS as u32;
/// Bound on the magnitude of exponents, so that sums of a few of them never overflow.
const EXPONENT_LIMIT: i32 = 1 << 28;
/// Decimal digits of a mantissa.
pub const DIGITS: usize = 96;

/// A number `0.mantissa * 2^exponent` with a sign. The leading bit of the mantissa is set, except
/// for zero, which has the least exponent.
///
/// Results are rounded to nearest, up to an error in the last bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Float320 {
    /// Least significant word first.
    words: [u64; WORDS],
    exponent: i32,
    negative: bool,
}

/// A mantissa with an additional lowest word for rounding, least significant word first.
type Guarded = [u64; WORDS + 1];

impl Float320 {
    /// 0.
    pub const ZERO: Float320 = Float320 {
        words: [0; WORDS],
        exponent: i32::MIN,
        negative: false,
    };
    /// 1.
    pub const ONE: Float320 = Float320 {
        words: [0, 0, 0, 0, 1 << 63],
        exponent: 1,
        negative: false,
    };

    /// Whether the number is 0.
    pub fn is_zero(&self) -> bool {
        self.exponent == i32::MIN
    }

    /// The least e with `|self| < 2^e`; for 0 a value far below any other.
    pub(super) fn exponent(&self) -> i32 {
        self.exponent.max(-EXPONENT_LIMIT)
    }

    /// Whether the number is less than 0.
    pub fn is_negative(&self) -> bool {
        self.negative
    }

    /// Converts an `f64` exactly; 0 for an infinity or NaN.
    pub fn from_f64(value: f64) -> Float320 {
        let (fraction, exponent) = libm::frexp(value);
        if fraction == 0.0 || !value.is_finite() {
            return Float320::ZERO;
        }
        // 53 bits of a fraction in [1/2, 1) are an integer below 2^64
        let top = libm::ldexp(fraction.abs(), 64);
        let mut words = [0; WORDS];
        words[WORDS - 1] = as_word(top);
        Float320 {
            words,
            exponent,
            negative: value < 0.0,
        }
    }

    /// Converts an exact number, rounded.
    pub fn from_number(value: &Number) -> Float320 {
        let (negative, magnitude, exponent) = value.binary();
        let mut guarded: Guarded = [0; WORDS + 1];
        let bytes = magnitude.to_le_bytes();
        for (word, chunk) in guarded[1..].iter_mut().zip(bytes.chunks(8)) {
            let mut le = [0; 8];
            le[..chunk.len()].copy_from_slice(chunk);
            *word = u64::from_le_bytes(le);
        }
        let limit = i64::from(EXPONENT_LIMIT);
        let exponent = (exponent + i64::from(BITS)).clamp(-limit, limit);
        Float320::normalised(guarded, exponent as i32, negative)
    }

    /// The sign, an integer and the power of two by which it is multiplied.
    pub(crate) fn binary(&self) -> (bool, UBig, i64) {
        let bytes: Vec<u8> = self.words.iter().flat_map(|w| w.to_le_bytes()).collect();
        let exponent = if self.is_zero() {
            0
        } else {
            i64::from(self.exponent) - i64::from(BITS)
        };
        (self.negative, UBig::from_le_bytes(&bytes), exponent)
    }

    /// The first 192 bits of the mantissa. Numbers that agree to 57 digits have the same bits,
    /// unless a number with fewer bits lies between them (as 1 between 1 - 1e-80 and 1 + 1e-80).
    pub(crate) fn leading_bits(&self) -> [u64; 3] {
        [self.words[4], self.words[3], self.words[2]]
    }

    /// The nearest `f64`, up to an error in the last bit; infinite or 0 beyond its range.
    pub fn to_f64(&self) -> f64 {
        let magnitude = libm::ldexp(self.fraction(), self.exponent.max(-EXPONENT_LIMIT));
        if self.negative { -magnitude } else { magnitude }
    }

    /// log10 of the magnitude; minus infinity for 0.
    pub fn log10(&self) -> f64 {
        if self.is_zero() {
            return f64::NEG_INFINITY;
        }
        libm::log10(self.fraction()) + f64::from(self.exponent) * core::f64::consts::LOG10_2
    }

    /// The mantissa as an `f64` in [1/2, 1]; 0 for 0.
    fn fraction(&self) -> f64 {
        let [.., low, high] = self.words;
        libm::ldexp(high as f64, -64) + libm::ldexp(low as f64, -128)
    }

    /// `|self|`.
    #[must_use]
    pub fn abs(self) -> Float320 {
        Float320 {
            negative: false,
            ..self
        }
    }

    /// `self * 2^power`.
    #[must_use]
    pub fn scaled(self, power: i32) -> Float320 {
        if self.is_zero() {
            return self;
        }
        Float320 {
            exponent: self.exponent + power,
            ..self
        }
    }

    /// Compares the magnitudes.
    pub fn cmp_abs(&self, other: &Float320) -> Ordering {
        self.exponent
            .cmp(&other.exponent)
            .then_with(|| self.words.iter().rev().cmp(other.words.iter().rev()))
    }

    /// Builds a number from a mantissa that may have leading zeros.
    fn normalised(guarded: Guarded, exponent: i32, negative: bool) -> Float320 {
        let Some(top) = guarded.iter().rposition(|w| *w != 0) else {
            return Float320::ZERO;
        };
        let zeros = guarded[top].leading_zeros();
        let shift = 64 * (WORDS - top) as u32 + zeros;
        let guarded = if shift == 0 {
            guarded
        } else {
            shifted_left(&guarded, shift)
        };
        Float320::rounded(guarded, exponent - shift.cast_signed(), negative)
    }

    /// Builds a number from a mantissa whose leading bit is set.
    #[inline]
    fn rounded(guarded: Guarded, exponent: i32, negative: bool) -> Float320 {
        let mut words = [0; WORDS];
        words.copy_from_slice(&guarded[1..]);
        let mut exponent = exponent;
        let mut carry = guarded[0] >> 63 != 0;
        for word in &mut words {
            let (sum, over) = word.overflowing_add(u64::from(carry));
            (*word, carry) = (sum, over);
        }
        if carry {
            words[WORDS - 1] = 1 << 63;
            exponent += 1;
        }
        if exponent < -EXPONENT_LIMIT {
            return Float320::ZERO;
        }
        Float320 {
            words,
            exponent: exponent.min(EXPONENT_LIMIT),
            negative,
        }
    }

    fn guarded(&self) -> Guarded {
        let [a, b, c, d, e] = self.words;
        [0, a, b, c, d, e]
    }
}

/// Converts an `f64` in [2^63, 2^64) to the integer of the same value.
fn as_word(value: f64) -> u64 {
    let bits = value.to_bits();
    let mantissa = (bits & ((1 << 52) - 1)) | (1 << 52);
    // the exponent is known from the range
    mantissa << 11
}

/// `value / 2^shift`, for shifts below 384.
#[inline]
fn shifted_right(value: &Guarded, shift: u32) -> Guarded {
    let mut padded = [0; 16];
    padded[..=WORDS].copy_from_slice(value);
    let (words, bits) = ((shift / 64) as usize & 7, shift % 64);
    core::array::from_fn(|i| {
        let (low, high) = (padded[i + words], padded[i + words + 1]);
        // two shifts, since a single shift by 64 bits is not allowed
        (low >> bits) | ((high << 1) << (63 - bits))
    })
}

/// `value * 2^shift`, for shifts below 384.
#[inline]
fn shifted_left(value: &Guarded, shift: u32) -> Guarded {
    let mut padded = [0; 16];
    padded[8..=8 + WORDS].copy_from_slice(value);
    let (words, bits) = ((shift / 64) as usize & 7, shift % 64);
    core::array::from_fn(|i| {
        let (high, low) = (padded[8 + i - words], padded[7 + i - words]);
        (high << bits) | ((low >> 1) >> (63 - bits))
    })
}

/// |a| + |b|, where the exponent of a is at least that of b.
#[inline]
fn sum(a: &Float320, b: &Float320, negative: bool) -> Float320 {
    let gap = a.exponent.wrapping_sub(b.exponent).cast_unsigned();
    if gap > BITS + 1 {
        return Float320 { negative, ..*a };
    }
    let shifted = shifted_right(&b.guarded(), gap);
    let mut total = a.guarded();
    let mut carry = false;
    for (x, y) in total.iter_mut().zip(&shifted) {
        (*x, carry) = add_with_carry(*x, *y, carry);
    }
    if !carry {
        return Float320::rounded(total, a.exponent, negative);
    }
    let mut total = shifted_right(&total, 1);
    total[WORDS] |= 1 << 63;
    Float320::rounded(total, a.exponent + 1, negative)
}

/// |a| - |b|, where |a| is at least |b|.
#[inline]
fn difference(a: &Float320, b: &Float320, negative: bool) -> Float320 {
    let gap = a.exponent.wrapping_sub(b.exponent).cast_unsigned();
    if gap > BITS + 1 {
        return Float320 { negative, ..*a };
    }
    let shifted = shifted_right(&b.guarded(), gap);
    let mut rest = a.guarded();
    let mut borrow = false;
    for (x, y) in rest.iter_mut().zip(&shifted) {
        let (first, one) = x.overflowing_sub(*y);
        let (second, two) = first.overflowing_sub(u64::from(borrow));
        (*x, borrow) = (second, one || two);
    }
    if rest[WORDS] >> 63 != 0 {
        return Float320::rounded(rest, a.exponent, negative);
    }
    Float320::normalised(rest, a.exponent, negative)
}

#[inline]
fn add_with_carry(x: u64, y: u64, carry: bool) -> (u64, bool) {
    let (first, one) = x.overflowing_add(y);
    let (second, two) = first.overflowing_add(u64::from(carry));
    (second, one || two)
}

impl Add for Float320 {
    type Output = Float320;

    #[inline]
    fn add(self, other: Float320) -> Float320 {
        if other.is_zero() {
            return self;
        }
        if self.is_zero() {
            return other;
        }
        if self.negative == other.negative {
            return if self.exponent >= other.exponent {
                sum(&self, &other, self.negative)
            } else {
                sum(&other, &self, self.negative)
            };
        }
        if self.cmp_abs(&other) == Ordering::Less {
            difference(&other, &self, other.negative)
        } else {
            difference(&self, &other, self.negative)
        }
    }
}

impl Sub for Float320 {
    type Output = Float320;

    #[inline]
    fn sub(self, other: Float320) -> Float320 {
        self + -other
    }
}

impl Neg for Float320 {
    type Output = Float320;

    #[inline]
    fn neg(self) -> Float320 {
        Float320 {
            negative: !self.negative && !self.is_zero(),
            ..self
        }
    }
}

impl Mul for Float320 {
    type Output = Float320;

    #[inline]
    fn mul(self, other: Float320) -> Float320 {
        if self.is_zero() || other.is_zero() {
            return Float320::ZERO;
        }
        let mut product = [0u64; 2 * WORDS];
        for i in 0..WORDS {
            let mut carry = 0u64;
            for j in 0..WORDS {
                let term = u128::from(self.words[i]) * u128::from(other.words[j])
                    + u128::from(product[i + j])
                    + u128::from(carry);
                product[i + j] = term as u64;
                carry = (term >> 64) as u64;
            }
            product[i + WORDS] = carry;
        }
        let mut guarded: Guarded = [0; WORDS + 1];
        guarded.copy_from_slice(&product[WORDS - 1..]);
        let mut exponent = self.exponent + other.exponent;
        if guarded[WORDS] >> 63 == 0 {
            guarded = shifted_left_by_one(&guarded);
            exponent -= 1;
        }
        Float320::rounded(guarded, exponent, self.negative != other.negative)
    }
}

#[inline]
fn shifted_left_by_one(value: &Guarded) -> Guarded {
    core::array::from_fn(|i| {
        let low = if i == 0 { 0 } else { value[i - 1] };
        (value[i] << 1) | (low >> 63)
    })
}

impl PartialOrd for Float320 {
    fn partial_cmp(&self, other: &Float320) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Float320 {
    fn cmp(&self, other: &Float320) -> Ordering {
        match (self.negative, other.negative) {
            (false, true) => Ordering::Greater,
            (true, false) => Ordering::Less,
            (false, false) => self.cmp_abs(other),
            (true, true) => other.cmp_abs(self),
        }
    }
}
