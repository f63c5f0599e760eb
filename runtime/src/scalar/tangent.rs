//! Numbers that carry derivatives in several directions at once.

use core::ops::{Add, Div, Mul, Neg, Sub};

use crate::Scalar;

/// The number of directions in which searches for trajectories and fits of responses differentiate at
/// once: position, velocity and acceleration of three coordinates.
pub const DIRECTIONS: usize = 9;

/// A number with its derivatives in `N` directions: a dual number with `N` tangents.
///
/// Unlike `Dual`, its elementary functions are those of the crate `libm` and no operation is fused,
/// so that a search that depends on the last bit gives the same result on every machine. The
/// derivative of [`sign`](Scalar::sign) is zero, also at the jump; comparisons use the value only.
///
/// ```
/// use regen_runtime::{Scalar, Tangent};
///
/// let angle = Tangent::<2>::along(0.3, 1);
/// let (sine, _) = angle.sin_cos();
/// assert_eq!(sine.rates[0], 0.0);
/// assert!((sine.rates[1] - 0.3_f64.cos()).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tangent<const N: usize> {
    /// The value.
    pub value: f64,
    /// The derivatives of the value in the N directions.
    pub rates: [f64; N],
}

impl<const N: usize> Tangent<N> {
    /// A constant: all derivatives are zero.
    pub fn constant(value: f64) -> Self {
        Self {
            value,
            rates: [0.0; N],
        }
    }

    /// A variable with derivative 1 in `direction` and 0 in the others; a constant if there is no
    /// such direction.
    pub fn along(value: f64, direction: usize) -> Self {
        let mut out = Self::constant(value);
        if let Some(rate) = out.rates.get_mut(direction) {
            *rate = 1.0;
        }
        out
    }

    /// The chain rule for a function of one number.
    #[inline]
    fn chain(self, value: f64, slope: f64) -> Self {
        Self {
            value,
            rates: self.rates.map(|rate| slope * rate),
        }
    }

    /// A function of two numbers: its value, and `rate` of the derivatives in each direction.
    #[inline]
    fn with(self, other: &Self, value: f64, rate: impl Fn(f64, f64) -> f64) -> Self {
        let mut rates = self.rates;
        for (mine, theirs) in rates.iter_mut().zip(&other.rates) {
            *mine = rate(*mine, *theirs);
        }
        Self { value, rates }
    }
}

impl<const N: usize> Add for Tangent<N> {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        self.with(&other, self.value + other.value, |a, b| a + b)
    }
}

impl<const N: usize> Sub for Tangent<N> {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        self.with(&other, self.value - other.value, |a, b| a - b)
    }
}

impl<const N: usize> Mul for Tangent<N> {
    type Output = Self;
    #[allow(clippy::suspicious_arithmetic_impl, reason = "the rule of products")]
    #[inline]
    fn mul(self, other: Self) -> Self {
        let (x, y) = (self.value, other.value);
        self.with(&other, x * y, |a, b| a * y + x * b)
    }
}

impl<const N: usize> Div for Tangent<N> {
    type Output = Self;
    #[allow(clippy::suspicious_arithmetic_impl, reason = "the rule of quotients")]
    #[inline]
    fn div(self, other: Self) -> Self {
        let y = other.value;
        let quotient = self.value / y;
        self.with(&other, quotient, |a, b| (a - quotient * b) / y)
    }
}

impl<const N: usize> Neg for Tangent<N> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        self.chain(-self.value, -1.0)
    }
}

impl<const N: usize> Scalar for Tangent<N> {
    type Mask = bool;

    #[inline]
    fn splat(self, c: f64) -> Self {
        Self::constant(c)
    }

    #[inline]
    fn mul_add(self, a: Self, b: Self) -> Self {
        self * a + b
    }

    #[inline]
    fn abs(self) -> Self {
        self.chain(self.value.abs(), Scalar::sign(self.value))
    }

    #[inline]
    fn sign(self) -> Self {
        Self::constant(Scalar::sign(self.value))
    }

    #[inline]
    fn sqrt(self) -> Self {
        let root = libm::sqrt(self.value);
        self.chain(root, 0.5 / root)
    }

    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = libm::sincos(self.value);
        (self.chain(sin, cos), self.chain(cos, -sin))
    }

    #[inline]
    fn less(self, other: Self) -> bool {
        self.value < other.value
    }

    #[inline]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }

    #[inline]
    fn all(mask: bool) -> bool {
        mask
    }
}
