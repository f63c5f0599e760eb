//! Binary floating point of fixed, high precision.
//!
//! A [`BigFloat`] has [`PRECISION`] bits, more than five times those of an `f64`. It is the value
//! of every constant that has no exact form, and decides the order of constants that have one.

use core::cmp::Ordering;
use std::sync::OnceLock;

use dashu_int::ops::{BitTest, DivRem, SquareRoot};
use dashu_int::{Sign, UBig};

/// Number of bits of a mantissa.
pub(super) const PRECISION: usize = 320;

/// Two inexact values count as equal if their difference is at least this many bits below the
/// larger one.
///
/// The 60 bits between this and [`PRECISION`] absorb the rounding errors of all operations before.
pub(super) const AGREEMENT: i64 = 260;

/// Largest exponent, so that sums of a few exponents do not overflow.
pub(super) const EXPONENT_LIMIT: i64 = 1 << 60;

/// Angles with more integer bits are not reduced.
const ANGLE_LIMIT: i64 = 1 << 13;

/// `sign * magnitude * 2^exponent`; the magnitude has exactly [`PRECISION`] bits, or is zero.
#[derive(Clone, Debug)]
pub(super) struct BigFloat {
    sign: Sign,
    magnitude: UBig,
    exponent: i64,
}

impl BigFloat {
    pub(super) fn zero() -> Self {
        Self {
            sign: Sign::Positive,
            magnitude: UBig::ZERO,
            exponent: 0,
        }
    }

    pub(super) fn one() -> Self {
        Self::new(Sign::Positive, UBig::ONE, 0)
    }

    /// The nearest value to `sign * magnitude * 2^exponent`.
    pub(super) fn new(sign: Sign, magnitude: UBig, exponent: i64) -> Self {
        let bits = magnitude.bit_len();
        if bits == 0 {
            return Self::zero();
        }
        let (magnitude, exponent) = match bits.cmp(&PRECISION) {
            Ordering::Equal => (magnitude, exponent),
            Ordering::Less => {
                let shift = PRECISION - bits;
                (magnitude << shift, exponent - signed(shift))
            }
            Ordering::Greater => {
                let shift = bits - PRECISION;
                let (rounded, exponent) =
                    (shift_rounded(&magnitude, shift), exponent + signed(shift));
                if rounded.bit_len() > PRECISION {
                    (rounded >> 1, exponent + 1)
                } else {
                    (rounded, exponent)
                }
            }
        };
        Self {
            sign,
            magnitude,
            exponent: exponent.clamp(-EXPONENT_LIMIT, EXPONENT_LIMIT),
        }
    }

    /// Sign, magnitude and exponent, from which [`BigFloat::new`] makes the same value.
    pub(super) fn parts(&self) -> (Sign, &UBig, i64) {
        (self.sign, &self.magnitude, self.exponent)
    }

    pub(super) fn is_zero(&self) -> bool {
        self.magnitude.is_zero()
    }

    pub(super) fn is_negative(&self) -> bool {
        self.sign == Sign::Negative
    }

    /// The smallest `t` with `|self| < 2^t`.
    pub(super) fn top(&self) -> i64 {
        self.exponent + signed(PRECISION)
    }

    pub(super) fn neg(&self) -> Self {
        let sign = if self.is_zero() {
            self.sign
        } else {
            -self.sign
        };
        Self {
            sign,
            magnitude: self.magnitude.clone(),
            exponent: self.exponent,
        }
    }

    /// The sum, or zero if it is [`AGREEMENT`] bits below the larger operand.
    pub(super) fn add(&self, other: &Self) -> Self {
        if self.is_zero() {
            return other.clone();
        }
        if other.is_zero() {
            return self.clone();
        }
        let (high, low) = if self.exponent >= other.exponent {
            (self, other)
        } else {
            (other, self)
        };
        let gap = high.exponent.abs_diff(low.exponent);
        if gap > PRECISION as u64 + 2 {
            return high.clone();
        }
        let aligned = &high.magnitude << gap as usize;
        let sum = if high.sign == low.sign {
            Self::new(high.sign, aligned + &low.magnitude, low.exponent)
        } else if aligned >= low.magnitude {
            Self::new(high.sign, aligned - &low.magnitude, low.exponent)
        } else {
            Self::new(low.sign, &low.magnitude - aligned, low.exponent)
        };
        if sum.is_zero() || sum.top() <= high.top() - AGREEMENT {
            return Self::zero();
        }
        sum
    }

    pub(super) fn sub(&self, other: &Self) -> Self {
        self.add(&other.neg())
    }

    pub(super) fn mul(&self, other: &Self) -> Self {
        Self::new(
            self.sign * other.sign,
            &self.magnitude * &other.magnitude,
            self.exponent + other.exponent,
        )
    }

    /// The quotient; `None` if the divisor is zero.
    pub(super) fn div(&self, other: &Self) -> Option<Self> {
        if other.is_zero() {
            return None;
        }
        const EXTRA: usize = PRECISION + 2;
        Some(Self::new(
            self.sign * other.sign,
            (&self.magnitude << EXTRA) / &other.magnitude,
            self.exponent - other.exponent - signed(EXTRA),
        ))
    }

    /// The square root; `None` of a negative value.
    pub(super) fn sqrt(&self) -> Option<Self> {
        if self.is_zero() {
            return Some(Self::zero());
        }
        if self.is_negative() {
            return None;
        }
        // make the exponent even, and compute with twice the bits of the root
        let shift = PRECISION + 4 + usize::from(self.exponent.rem_euclid(2) == 1);
        let root = (&self.magnitude << shift).sqrt();
        Some(Self::new(
            Sign::Positive,
            root,
            (self.exponent - signed(shift)).div_euclid(2),
        ))
    }

    /// Whether the two agree to [`AGREEMENT`] bits.
    pub(super) fn agrees(&self, other: &Self) -> bool {
        if self.is_zero() || other.is_zero() {
            return self.is_zero() && other.is_zero();
        }
        self.sign == other.sign
            && self.exponent.abs_diff(other.exponent) <= 1
            && self.sub(other).is_zero()
    }

    pub(super) fn cmp(&self, other: &Self) -> Ordering {
        match (self.signum(), other.signum()) {
            (a, b) if a != b => a.cmp(&b),
            (0, _) => Ordering::Equal,
            (sign, _) => {
                let order = (self.exponent.cmp(&other.exponent))
                    .then_with(|| self.magnitude.cmp(&other.magnitude));
                if sign < 0 { order.reverse() } else { order }
            }
        }
    }

    fn signum(&self) -> i8 {
        match (self.is_zero(), self.sign) {
            (true, _) => 0,
            (_, Sign::Positive) => 1,
            (_, Sign::Negative) => -1,
        }
    }

    /// Sign, mantissa rounded to `bits` without trailing zeros, and its exponent.
    pub(super) fn rounded(&self, bits: usize) -> (Sign, UBig, i64) {
        let shift = PRECISION.saturating_sub(bits);
        let rounded = shift_rounded(&self.magnitude, shift);
        let zeros = rounded.trailing_zeros().unwrap_or(0);
        (
            self.sign,
            rounded >> zeros,
            self.exponent + signed(shift) + signed(zeros),
        )
    }

    /// The nearest `f64`, ties to even.
    pub(super) fn to_f64(&self) -> f64 {
        nearest_f64(self.sign, &self.magnitude, self.exponent, false)
    }

    /// Sine and cosine of the value as an angle in rad; zero where they are no larger than the
    /// angle's own rounding error.
    pub(super) fn sin_cos(&self) -> (Self, Self) {
        sin_cos(self, true, |scale| {
            let shift = self.exponent + signed(scale);
            shifted(self.magnitude.clone(), shift)
        })
    }

    /// The first 17 significant digits as an integer, with the decimal exponent of the first one.
    ///
    /// `None` for zero and for exponents beyond 2^16.
    pub(super) fn decimal_digits(&self) -> Option<(UBig, i64)> {
        if self.is_zero() || self.exponent.abs() > 1 << 16 {
            return None;
        }
        let ten = UBig::from(10u8);
        let limit = ten.pow(17);
        // the decimal exponent by the ratio log10(2), at most one off over the allowed exponents
        let mut first = (self.top() - 1) * 30_103 / 100_000;
        for _ in 0..4 {
            let power = 16 - first;
            let scale = ten.pow(power.unsigned_abs() as usize);
            let value = if power >= 0 {
                let scaled = &self.magnitude * &scale;
                if self.exponent >= 0 {
                    scaled << unsigned(self.exponent)
                } else {
                    shift_rounded(&scaled, self.exponent.unsigned_abs() as usize)
                }
            } else {
                let divisor = scale << unsigned(-self.exponent);
                ((&self.magnitude << unsigned(self.exponent)) + (&divisor >> 1)) / divisor
            };
            if value >= limit {
                first += 1;
            } else if &value * &ten < limit {
                first -= 1;
            } else {
                return Some((value, first));
            }
        }
        None
    }
}

/// Sine and cosine of an angle near `near`; `fixed(w)` is `|angle| * 2^w` to within a few units.
///
/// For an inexact angle the sine or cosine is zero if the angle agrees with a multiple of pi/2; for
/// an exact one the reduction is repeated with more bits instead. An angle of more than 2^13 bits,
/// far outside `f64`, has no meaningful direction and counts as zero.
pub(super) fn sin_cos(
    near: &BigFloat,
    inexact: bool,
    fixed: impl Fn(usize) -> UBig,
) -> (BigFloat, BigFloat) {
    // angles below 2^TINY are their own sine
    const TINY: i64 = -200;
    // fractional bits of the computation, at least
    const WORK: usize = 400;
    if near.is_zero() || near.top() > ANGLE_LIMIT {
        return (BigFloat::zero(), BigFloat::one());
    }
    if near.top() < TINY {
        // the next term of either series is below the last bit
        return (near.clone(), BigFloat::one());
    }
    let whole_bits = unsigned(near.top());
    let mut scale = WORK + near.top().unsigned_abs() as usize;
    let (quadrant, rest, before) = loop {
        let half_pi = pi_fixed(scale + 1) >> 2;
        let (quotient, rest) = fixed(scale).div_rem(&half_pi);
        let quadrant = u8::from(quotient.bit(0)) + 2 * u8::from(quotient.bit(1));
        let before = &rest << 1 > half_pi;
        let (quadrant, rest) = if before {
            ((quadrant + 1) % 4, half_pi - rest)
        } else {
            (quadrant, rest)
        };
        let reduced = before || !quotient.is_zero();
        let known = rest.bit_len();
        if inexact && reduced && known + AGREEMENT as usize <= scale + whole_bits {
            break (quadrant, UBig::ZERO, before);
        }
        let wanted = whole_bits + PRECISION + 10;
        if inexact || known >= wanted || scale > 1 << 15 {
            break (quadrant, rest, before);
        }
        scale += (wanted - known).max(64);
    };
    let leading_zeros = scale - rest.bit_len().min(scale);
    let (sine, cosine) = if rest.is_zero() {
        (BigFloat::zero(), BigFloat::one())
    } else if signed(leading_zeros) > -TINY {
        (
            BigFloat::new(Sign::Positive, rest, -signed(scale)),
            BigFloat::one(),
        )
    } else {
        let working = WORK + leading_zeros;
        let rest = shifted(rest, signed(working) - signed(scale));
        let (sine, cosine) = sin_cos_fixed(&rest, working);
        (
            BigFloat::new(Sign::Positive, sine, -signed(working)),
            BigFloat::new(Sign::Positive, cosine, -signed(working)),
        )
    };
    let sine = if before { sine.neg() } else { sine };
    let (sine, cosine) = match quadrant {
        0 => (sine, cosine),
        1 => (cosine, sine.neg()),
        2 => (sine.neg(), cosine.neg()),
        _ => (cosine.neg(), sine),
    };
    if near.is_negative() {
        (sine.neg(), cosine)
    } else {
        (sine, cosine)
    }
}

/// Sine and cosine in units of `2^-scale`, of an angle in `[0, pi/4]` in the same units: the Taylor
/// series of the angle, halved several times, then doubled as often.
fn sin_cos_fixed(angle: &UBig, scale: usize) -> (UBig, UBig) {
    // number of times that the angle is halved, for a shorter series
    const HALVINGS: usize = 7;
    const GUARD: usize = 2 * HALVINGS + 8;
    let work = scale + GUARD;
    let one = UBig::ONE << work;
    let angle = angle << (GUARD - HALVINGS);
    let square = (&angle * &angle) >> work;
    let series = |first: UBig, mut index: u32| {
        let (mut plus, mut minus) = (first.clone(), UBig::ZERO);
        let (mut term, mut negative) = (first, true);
        loop {
            term = ((term * &square) >> work) / (index * (index + 1));
            if term.is_zero() {
                return plus - minus;
            }
            if negative {
                minus += &term;
            } else {
                plus += &term;
            }
            negative = !negative;
            index += 2;
        }
    };
    let mut cosine = series(one.clone(), 1);
    let mut sine = series(angle, 2);
    for _ in 0..HALVINGS {
        let doubled = (&sine * &cosine) >> (work - 1);
        cosine = &one - ((&sine * &sine) >> (work - 1));
        sine = doubled;
    }
    (sine >> GUARD, cosine >> GUARD)
}

/// `floor(pi * 2^bits)`, to within one.
pub(super) fn pi_fixed(bits: usize) -> UBig {
    // number of bits of pi that are computed only once
    const STORED_BITS: usize = 1024;
    static PI: OnceLock<UBig> = OnceLock::new();
    if bits <= STORED_BITS {
        return PI.get_or_init(|| machin(STORED_BITS)) >> (STORED_BITS - bits);
    }
    machin(bits)
}

/// The same by Machin's formula, `pi = 16 atan(1/5) - 4 atan(1/239)`.
fn machin(bits: usize) -> UBig {
    const GUARD: usize = 32;
    let one = UBig::ONE << (bits + GUARD);
    let arctangent = |inverse: u32| {
        let square = inverse * inverse;
        let mut power = &one / inverse;
        let (mut plus, mut minus) = (power.clone(), UBig::ZERO);
        let (mut odd, mut negative) = (3u32, true);
        loop {
            power /= square;
            if power.is_zero() {
                return plus - minus;
            }
            let term = &power / odd;
            if negative {
                minus += term;
            } else {
                plus += term;
            }
            negative = !negative;
            odd += 2;
        }
    };
    ((arctangent(5) << 4) - (arctangent(239) << 2)) >> GUARD
}

/// The `f64` nearest to `sign * (magnitude + rest) * 2^exponent`, ties to even; `rest` is in
/// `(0, 1)` if `inexact`, else 0.
pub(super) fn nearest_f64(sign: Sign, magnitude: &UBig, exponent: i64, inexact: bool) -> f64 {
    let bits = signed(magnitude.bit_len());
    let leading = exponent + bits - 1;
    let unsigned = if bits == 0 || leading < -1075 {
        0.0
    } else if leading > 1023 {
        f64::INFINITY
    } else {
        let kept = (leading + 1075).min(53);
        let shift = bits - kept;
        let truncated = shifted(magnitude.clone(), -shift);
        let up = shift > 0 && {
            let half = unsigned(shift) - 1;
            let odd = truncated.bit(0);
            magnitude.bit(half)
                && (odd || inexact || magnitude.trailing_zeros().is_some_and(|zeros| zeros < half))
        };
        let mantissa = u64::try_from(truncated).unwrap_or(0) + u64::from(up);
        // a carry out of the mantissa increases the exponent, as it should
        let biased = (leading + 1022).max(0).unsigned_abs();
        f64::from_bits(if leading >= -1022 {
            (biased << 52) + mantissa
        } else {
            mantissa
        })
    };
    match sign {
        Sign::Positive => unsigned,
        Sign::Negative => -unsigned,
    }
}

/// `magnitude * 2^shift`, rounded down.
pub(super) fn shifted(magnitude: UBig, shift: i64) -> UBig {
    let by = shift.unsigned_abs() as usize;
    if shift >= 0 {
        magnitude << by
    } else {
        magnitude >> by
    }
}

/// `magnitude / 2^shift` to the nearest integer.
fn shift_rounded(magnitude: &UBig, shift: usize) -> UBig {
    if shift == 0 {
        return magnitude.clone();
    }
    let rounded = magnitude >> shift;
    if magnitude.bit(shift - 1) {
        rounded + 1u8
    } else {
        rounded
    }
}

/// A number of bits as an exponent.
pub(super) fn signed(bits: usize) -> i64 {
    i64::try_from(bits).unwrap_or(i64::MAX >> 2)
}

/// An exponent as a number of bits; zero for a negative one.
pub(super) fn unsigned(bits: i64) -> usize {
    usize::try_from(bits).unwrap_or(0)
}
