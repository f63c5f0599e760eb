//! Dual numbers: numbers with their derivatives.

use core::ops::{Add, Div, Mul, Neg, Sub};

use num_dual::DualNum;

use super::Scalar;

/// A dual number of `num-dual` as a [`Scalar`]: `Dual<Dual64>` for first derivatives,
/// `Dual<Dual2_64>` or `Dual<HyperDual64>` for second ones.
///
/// The derivative of [`sign`](Scalar::sign) is zero, also at the jump. Comparisons and
/// [`select`](Scalar::select) use the real part only.
///
/// ```
/// use num_dual::Dual64;
/// use regen_runtime::{Dual, Scalar};
///
/// let angle = Dual(Dual64::new(0.3, 1.0));
/// let (sine, _) = angle.sin_cos();
/// assert!((sine.0.eps - 0.3_f64.cos()).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<D>(
    /// The number.
    pub D,
);

macro_rules! binary {
    ($trait:ident, $method:ident) => {
        impl<D: DualNum> $trait for Dual<D> {
            type Output = Self;
            #[inline]
            fn $method(self, other: Self) -> Self {
                Self(self.0.$method(other.0))
            }
        }
    };
}
binary!(Add, add);
binary!(Sub, sub);
binary!(Mul, mul);
binary!(Div, div);

impl<D: DualNum> Neg for Dual<D> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl<D: DualNum<Primitive = f64> + Copy> Scalar for Dual<D> {
    type Mask = bool;

    #[inline]
    fn splat(self, c: f64) -> Self {
        Self(D::from(c))
    }

    #[inline]
    fn mul_add(self, a: Self, b: Self) -> Self {
        Self(self.0 * a.0 + b.0)
    }

    #[inline]
    fn abs(self) -> Self {
        Self(self.0.abs())
    }

    #[inline]
    fn sign(self) -> Self {
        self.splat(Scalar::sign(self.0.re()))
    }

    #[inline]
    fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }

    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.0.sin_cos();
        (Self(sin), Self(cos))
    }

    #[inline]
    fn less(self, other: Self) -> bool {
        self.0.re() < other.0.re()
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
