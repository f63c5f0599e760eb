//! Real constants, exact wherever possible.

mod bytes;
mod display;
#[cfg(test)]
mod tests;

use core::cmp::Ordering;
use core::hash::{Hash, Hasher};
use std::sync::{Arc, OnceLock};

use dashu_int::{IBig, Sign, UBig};
use dashu_ratio::RBig;

pub(crate) use display::NumberFactor;

use super::big_float::{self, AGREEMENT, BigFloat, PRECISION};
use super::surd::{Surd, cos_of_pi_times};

/// Largest decimal exponent that [`Number::parse_decimal`] accepts.
const MAX_DECIMAL_EXPONENT: i64 = 400;
/// Longest text that [`Number::parse_decimal`] accepts, in characters.
const MAX_DECIMAL_LENGTH: usize = 1000;
/// Largest exponent that [`Number::powi`] accepts.
const MAX_POWER: u64 = 1000;

/// A real constant.
///
/// Exact numbers are sums of `rational * sqrt(integer) * pi^k`: closed under addition, subtraction
/// and multiplication, with an exact zero test. A number outside that set (a sine of 0.3, a nested
/// root, a sum with too many terms) is inexact and has 320 bits.
///
/// Inexact numbers are equal if they agree to 260 bits. Accordingly a sum or difference that is 260
/// bits below its larger operand is exact zero, which is how identities between transcendental
/// constants are found, and an inexact result that agrees with a fraction of at most 32 bits over a
/// power of two becomes that fraction. An identity that holds to 260 bits by accident would be
/// taken for true; among the constants of robots that is out of the question.
///
/// Cloning is cheap.
///
/// ```
/// use regen_codegen::sym::Number;
///
/// let sixth = Number::pi().div(&Number::from_i64(6)).expect("6 is not zero");
/// let (sine, cosine) = sixth.sin_cos();
/// assert_eq!(sine.to_string(), "1/2");
/// assert_eq!(cosine.to_string(), "sqrt(3)/2");
///
/// let (s, c) = Number::parse_decimal("0.3").expect("a decimal").sin_cos();
/// assert!(s.mul(&s).add(&c.mul(&c)).is_one());
/// ```
#[derive(Clone)]
pub struct Number(Arc<Inner>);

struct Inner {
    exact: Option<Surd>,
    /// The value to 320 bits: computed on demand for an exact number, given for an inexact one.
    real: OnceLock<BigFloat>,
    /// The result of [`Number::to_f64`], computed on demand.
    double: OnceLock<f64>,
}

impl Number {
    /// 0.
    pub fn zero() -> Self {
        static ZERO: OnceLock<Number> = OnceLock::new();
        ZERO.get_or_init(|| Self::exact(Surd::zero())).clone()
    }

    /// 1.
    pub fn one() -> Self {
        static ONE: OnceLock<Number> = OnceLock::new();
        ONE.get_or_init(|| Self::from_i64(1)).clone()
    }

    /// An integer.
    pub fn from_i64(value: i64) -> Self {
        Self::from_rational(RBig::from(value))
    }

    /// A fraction; `None` if the denominator is zero.
    pub fn ratio(numerator: i64, denominator: i64) -> Option<Self> {
        (denominator != 0).then(|| {
            Self::from_rational(RBig::from_parts_signed(
                IBig::from(numerator),
                IBig::from(denominator),
            ))
        })
    }

    /// A rational number.
    pub fn from_rational(value: RBig) -> Self {
        Self::exact(Surd::rational(value))
    }

    /// The number pi.
    pub fn pi() -> Self {
        static PI: OnceLock<Number> = OnceLock::new();
        PI.get_or_init(|| Self::exact(Surd::monomial(RBig::ONE, 1, 1)))
            .clone()
    }

    /// The exact rational of a decimal such as `0.4563`, `1e-3`, `-2.5E+4`, `.5` or `3.`.
    ///
    /// `None` if the text is malformed, has an exponent beyond 400, or is longer than 1000
    /// characters.
    pub fn parse_decimal(text: &str) -> Option<Self> {
        if text.len() > MAX_DECIMAL_LENGTH {
            return None;
        }
        let (sign, unsigned) = split_sign(text);
        let (mantissa, exponent) = match unsigned.split_once(['e', 'E']) {
            None => (unsigned, 0),
            Some((mantissa, exponent)) => {
                let (sign, digits) = split_sign(exponent);
                if digits.is_empty() || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
                    return None;
                }
                let value = digits.parse::<i64>().ok()?;
                if value > MAX_DECIMAL_EXPONENT {
                    return None;
                }
                (
                    mantissa,
                    if sign == Sign::Negative {
                        -value
                    } else {
                        value
                    },
                )
            }
        };
        let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
        let digits = format!("{whole}{fraction}");
        if digits.is_empty() || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
            return None;
        }
        let digits = UBig::from_str_radix(&digits, 10).ok()?;
        let shift = exponent - i64::try_from(fraction.len()).ok()?;
        let power = UBig::from(10u8).pow(usize::try_from(shift.unsigned_abs()).ok()?);
        Some(Self::from_rational(if shift >= 0 {
            RBig::from(IBig::from_parts(sign, digits * power))
        } else {
            RBig::from_parts(IBig::from_parts(sign, digits), power)
        }))
    }

    /// Whether this is 0.
    pub fn is_zero(&self) -> bool {
        self.0.exact.as_ref().is_some_and(Surd::is_zero)
    }

    /// Whether this is 1.
    pub fn is_one(&self) -> bool {
        self.0.exact.as_ref().is_some_and(Surd::is_one)
    }

    /// Whether this is less than 0.
    pub fn is_negative(&self) -> bool {
        match self.0.exact.as_ref().and_then(Surd::obvious_sign) {
            Some(sign) => sign.is_lt(),
            None => self.real().is_negative(),
        }
    }

    /// Whether the exact value is known.
    pub fn is_exact(&self) -> bool {
        self.0.exact.is_some()
    }

    /// The value, if known to be rational.
    pub fn as_rational(&self) -> Option<RBig> {
        self.0.exact.as_ref()?.as_rational()
    }

    /// The value, if known to be an integer in range.
    pub fn as_i64(&self) -> Option<i64> {
        let value = self.as_rational()?;
        if !value.is_int() {
            return None;
        }
        i64::try_from(value.numerator()).ok()
    }

    /// The terms of an exact number: each with its coefficient, the squarefree integer whose square root
    /// multiplies it, and the power of pi; `None` of an inexact one.
    pub(crate) fn exact_terms(&self) -> Option<Vec<(RBig, u128, i32)>> {
        let surd = self.0.exact.as_ref()?;
        let terms = surd.terms().iter();
        Some(
            terms
                .map(|t| (t.coefficient.clone(), t.radicand, t.pi_power))
                .collect(),
        )
    }

    /// `Some(r)` if this is known to be exactly `r * pi`.
    pub fn pi_multiple(&self) -> Option<RBig> {
        self.0.exact.as_ref()?.pi_multiple()
    }

    /// `-self`.
    #[must_use]
    pub fn neg(&self) -> Self {
        match &self.0.exact {
            Some(exact) => Self::exact(exact.neg()),
            None => Self::inexact(self.real().neg()),
        }
    }

    /// `|self|`.
    #[must_use]
    pub fn abs(&self) -> Self {
        if self.is_negative() {
            self.neg()
        } else {
            self.clone()
        }
    }

    /// `self + other`.
    #[must_use]
    pub fn add(&self, other: &Self) -> Self {
        if self.is_zero() {
            return other.clone();
        }
        if other.is_zero() {
            return self.clone();
        }
        self.both(other, Surd::add)
            .unwrap_or_else(|| Self::inexact(self.real().add(other.real())))
    }

    /// `self - other`.
    #[must_use]
    pub fn sub(&self, other: &Self) -> Self {
        self.add(&other.neg())
    }

    /// `self * other`.
    #[must_use]
    pub fn mul(&self, other: &Self) -> Self {
        if self.is_zero() || other.is_one() {
            return self.clone();
        }
        if other.is_zero() || self.is_one() {
            return other.clone();
        }
        self.both(other, Surd::mul)
            .unwrap_or_else(|| Self::inexact(self.real().mul(other.real())))
    }

    /// `self / other`; `None` if the divisor is zero.
    pub fn div(&self, other: &Self) -> Option<Self> {
        if other.is_zero() {
            return None;
        }
        if self.is_zero() || other.is_one() {
            return Some(self.clone());
        }
        if self == other {
            return Some(Self::one());
        }
        let exact = self.both(other, |a, b| a.mul(&b.reciprocal()?));
        exact.or_else(|| Some(Self::inexact(self.real().div(other.real())?)))
    }

    /// `self^exponent`, with `x^0 = 1`; `None` for zero to a negative power and for exponents
    /// beyond 1000.
    pub fn powi(&self, exponent: i64) -> Option<Self> {
        let mut remaining = exponent.unsigned_abs();
        if remaining > MAX_POWER || (exponent < 0 && self.is_zero()) {
            return None;
        }
        let mut square = if exponent < 0 {
            Self::one().div(self)?
        } else {
            self.clone()
        };
        let mut result = Self::one();
        while remaining > 0 {
            if remaining % 2 == 1 {
                result = result.mul(&square);
            }
            remaining /= 2;
            if remaining > 0 {
                square = square.mul(&square);
            }
        }
        Some(result)
    }

    /// The nonnegative square root; `None` of a negative number.
    ///
    /// Exact for rationals whose square part bounded trial division finds, times even powers of pi,
    /// and for `a + b*sqrt(c)` whose root is a sum of two such roots.
    pub fn sqrt(&self) -> Option<Self> {
        if self.is_negative() {
            return None;
        }
        let exact = self.0.exact.as_ref().and_then(Surd::sqrt).map(Self::exact);
        exact.or_else(|| Some(Self::inexact(self.real().sqrt()?)))
    }

    /// Sine and cosine of the number as an angle in rad.
    ///
    /// Exact at multiples of pi/12, and at multiples of pi/10 where they are sums of square roots.
    pub fn sin_cos(&self) -> (Self, Self) {
        let Some(exact) = &self.0.exact else {
            let (sine, cosine) = self.real().sin_cos();
            return (Self::inexact(sine), Self::inexact(cosine));
        };
        if let Some(multiple) = exact.pi_multiple() {
            return sin_cos_of_pi_times(&multiple);
        }
        let (sine, cosine) = sin_cos_near(self, exact);
        (Self::inexact(sine), Self::inexact(cosine))
    }

    /// The tangent; `None` if the cosine is zero.
    pub fn tan(&self) -> Option<Self> {
        let (sine, cosine) = self.sin_cos();
        sine.div(&cosine)
    }

    /// The nearest `f64`, ties to even; infinite beyond its range.
    pub fn to_f64(&self) -> f64 {
        *self.0.double.get_or_init(|| match &self.0.exact {
            Some(exact) => exact.to_f64(),
            None => self.real().to_f64(),
        })
    }

    /// Whether [`Number::to_f64`] is finite.
    pub fn is_finite_f64(&self) -> bool {
        self.to_f64().is_finite()
    }

    /// The order of the values, `Equal` if and only if `==` holds.
    pub fn cmp_value(&self, other: &Self) -> Ordering {
        if self == other {
            return Ordering::Equal;
        }
        match (&self.0.exact, &other.0.exact) {
            (Some(a), Some(b)) if self.real().agrees(other.real()) => a.cmp(b),
            _ => self.real().cmp(other.real()),
        }
    }

    fn exact(value: Surd) -> Self {
        Self(Arc::new(Inner {
            exact: Some(value),
            real: OnceLock::new(),
            double: OnceLock::new(),
        }))
    }

    /// A number from a result with 320 bits; it becomes exact if it agrees with zero or a short
    /// binary fraction.
    fn inexact(value: BigFloat) -> Self {
        // largest mantissa and exponent of a binary fraction that is taken for exact
        const MAX_SHORT_BITS: usize = 32;
        const MAX_SHORT_EXPONENT: i64 = 64;
        if value.is_zero() {
            return Self::zero();
        }
        if value.top().abs() <= MAX_SHORT_EXPONENT {
            let (sign, mantissa, exponent) = value.rounded(AGREEMENT as usize);
            if mantissa < (UBig::ONE << MAX_SHORT_BITS) {
                let by = exponent.unsigned_abs() as usize;
                let mantissa = IBig::from_parts(sign, mantissa);
                return Self::from_rational(if exponent >= 0 {
                    RBig::from(mantissa << by)
                } else {
                    RBig::from_parts(mantissa, UBig::ONE << by)
                });
            }
        }
        Self(Arc::new(Inner {
            exact: None,
            real: OnceLock::from(value),
            double: OnceLock::new(),
        }))
    }

    /// The value to 320 bits: whether it is negative, an integer, and the exponent of the power of
    /// two that multiplies it.
    pub(crate) fn binary(&self) -> (bool, UBig, i64) {
        let (sign, mantissa, exponent) = self.real().rounded(PRECISION);
        (sign == Sign::Negative, mantissa, exponent)
    }

    /// The number with the parts that [`Number::binary`] gives: inexact, with 320 bits.
    pub(crate) fn from_binary(negative: bool, magnitude: UBig, exponent: i64) -> Self {
        let sign = if negative {
            Sign::Negative
        } else {
            Sign::Positive
        };
        Self::inexact(BigFloat::new(sign, magnitude, exponent))
    }

    fn real(&self) -> &BigFloat {
        self.0.real.get_or_init(|| {
            self.0
                .exact
                .as_ref()
                .map_or_else(BigFloat::zero, Surd::to_real)
        })
    }

    fn both(&self, other: &Self, operation: fn(&Surd, &Surd) -> Option<Surd>) -> Option<Self> {
        operation(self.0.exact.as_ref()?, other.0.exact.as_ref()?).map(Self::exact)
    }
}

/// Exact values compare exactly, others are equal if they agree to 260 bits.
impl PartialEq for Number {
    fn eq(&self, other: &Self) -> bool {
        if Arc::ptr_eq(&self.0, &other.0) {
            return true;
        }
        match (&self.0.exact, &other.0.exact) {
            (Some(a), Some(b)) => a == b,
            _ => self.real().agrees(other.real()),
        }
    }
}

impl Eq for Number {}

/// Hashes the sign, the exponent and the first 96 bits, rounded.
///
/// Two inexact numbers that agree hash differently only if a rounding boundary of 96 bits falls
/// between them, one chance in 2^160; then both are stored, and nothing else is lost.
impl Hash for Number {
    fn hash<H: Hasher>(&self, state: &mut H) {
        let (sign, mantissa, exponent) = self.real().rounded(96);
        (sign == Sign::Negative).hash(state);
        u128::try_from(mantissa).unwrap_or(0).hash(state);
        exponent.hash(state);
    }
}

fn split_sign(text: &str) -> (Sign, &str) {
    if let Some(rest) = text.strip_prefix('-') {
        (Sign::Negative, rest)
    } else {
        (Sign::Positive, text.strip_prefix('+').unwrap_or(text))
    }
}

/// Sine and cosine of an exact angle, reduced with as many bits as necessary.
fn sin_cos_near(angle: &Number, exact: &Surd) -> (BigFloat, BigFloat) {
    let near = angle.real();
    big_float::sin_cos(near, false, |scale| {
        let bits = big_float::signed(scale) + near.top();
        let (_, magnitude, exponent) = exact.approximate(big_float::unsigned(bits));
        big_float::shifted(magnitude, exponent + big_float::signed(scale))
    })
}

fn sin_cos_of_pi_times(multiple: &RBig) -> (Number, Number) {
    let two = RBig::from(2u8);
    let wrap = |turn: RBig| &turn - &two * RBig::from((&turn / &two).floor());
    let turn = wrap(multiple.clone());
    // sin(x) = cos(pi/2 - x)
    let co_turn = wrap(RBig::from_parts(IBig::ONE, UBig::from(2u8)) - multiple);
    let sine = cos_of_pi_times(&co_turn).map(Number::exact);
    let cosine = cos_of_pi_times(&turn).map(Number::exact);
    match (sine, cosine) {
        (Some(sine), Some(cosine)) => (sine, cosine),
        (sine, cosine) => {
            // reduce to (-1, 1] half turns, so that opposite angles give opposite sines
            let nearest = if turn > RBig::ONE { turn - two } else { turn };
            let surd = Surd::monomial(nearest, 1, 1);
            let angle = Number::exact(surd.clone());
            let (near_sine, near_cosine) = sin_cos_near(&angle, &surd);
            (
                sine.unwrap_or_else(|| Number::inexact(near_sine)),
                cosine.unwrap_or_else(|| Number::inexact(near_cosine)),
            )
        }
    }
}
