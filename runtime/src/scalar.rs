//! The number type over which generated code is generic.

use core::fmt::Debug;
use core::ops::{Add, Div, Mul, Neg, Sub};

pub mod angles;
#[cfg(feature = "dual")]
mod dual;
mod real;
#[cfg(feature = "tangent")]
mod tangent;

#[cfg(feature = "dual")]
pub use dual::Dual;
#[cfg(feature = "tangent")]
pub use tangent::{DIRECTIONS, Tangent};

/// A real number, a number with derivatives, or several numbers at once.
///
/// Generated functions are straight-line code over this trait: they have no branch that depends on
/// a value; every choice is a [`select`](Scalar::select). The same source therefore serves `f64`,
/// `f32`, dual numbers and SIMD lanes.
///
/// # Constants are made from an existing value
///
/// There is no `from_f64`. [`splat`](Scalar::splat) makes a constant in the shape of an existing
/// value. A SIMD lane carries a token which proves that its instruction set, detected at run time,
/// is available; a constant without an existing value would need a token that only `unsafe` code
/// could make.
///
/// # `[f64; N]` is not a `Scalar`
///
/// Arrays of `f64` do not implement this trait. The compiler splits such values into single
/// numbers, and in functions of thousands of operations it spills registers instead of vectorising:
/// slower than one call per state, and many times slower to compile. Use `Lane` of `regen-batch`.
///
/// # `mul_add` follows the hardware
///
/// [`mul_add`](Scalar::mul_add) is fused only where hardware for it is known to exist: for `f64`
/// and `f32` under `cfg!(target_feature = "fma")`, for `Lane` of `regen-batch` where its token proves it. Elsewhere
/// it is a product and a sum, because a software routine for the fused result would be a hundred
/// times slower. Results may thus differ in the last bits between targets.
///
/// # NaN
///
/// Every operation propagates NaN, including [`sign`](Scalar::sign), [`min`](Scalar::min) and
/// [`max`](Scalar::max). Only [`less`](Scalar::less) does not: a comparison with NaN is false.
///
/// ```
/// use regen_runtime::Scalar;
///
/// fn coulomb<T: Scalar>(qd: T) -> T {
///     qd.sign() * qd.splat(228.0)
/// }
/// assert_eq!(coulomb(-0.3), -228.0);
/// assert_eq!(coulomb(0.0_f32), 0.0);
/// ```
pub trait Scalar:
    Copy
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The result of a comparison: one truth value per lane.
    type Mask: Copy;

    /// The constant `c` in the shape of `self`, whose value does not matter.
    #[must_use]
    fn splat(self, c: f64) -> Self;

    /// `self * a + b`, fused where the hardware is known to fuse.
    #[must_use]
    fn mul_add(self, a: Self, b: Self) -> Self;

    /// The absolute value.
    #[must_use]
    fn abs(self) -> Self;

    /// -1, 0 or 1 by the sign; 0 at both zeros, NaN at NaN.
    #[must_use]
    fn sign(self) -> Self;

    /// The square root, correctly rounded where the type is a float; NaN below 0.
    #[must_use]
    fn sqrt(self) -> Self;

    /// Sine and cosine of an angle in radians.
    #[must_use]
    fn sin_cos(self) -> (Self, Self);

    /// Sine and cosine of several angles in radians at once.
    ///
    /// For `f64` this is a polynomial in vector registers where all angles are within 2^20 rad,
    /// each result within one ulp; otherwise, and for other types, it calls
    /// [`sin_cos`](Scalar::sin_cos). `Lane` computes all angles together too, after one check of
    /// their size.
    ///
    /// ```
    /// use regen_runtime::Scalar;
    ///
    /// let [(sine, _), (_, cosine)] = f64::sin_cos_all([0.5, 1.0]);
    /// assert!((sine - 0.5_f64.sin()).abs() < 1e-15);
    /// assert!((cosine - 1.0_f64.cos()).abs() < 1e-15);
    /// ```
    #[inline]
    #[must_use]
    fn sin_cos_all<const N: usize>(angles: [Self; N]) -> [(Self, Self); N] {
        angles.map(Self::sin_cos)
    }

    /// `self < other` in each lane; false at NaN.
    fn less(self, other: Self) -> Self::Mask;

    /// `yes` where the mask is true, `no` elsewhere. Both are evaluated.
    #[must_use]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;

    /// Whether the mask is true in every lane.
    fn all(mask: Self::Mask) -> bool;

    /// The smaller of two values; NaN if either is NaN.
    ///
    /// On a concrete `f64`, `x.min(y)` calls the inherent method, which ignores NaN; write
    /// `Scalar::min(x, y)`.
    #[inline]
    #[must_use]
    fn min(self, other: Self) -> Self {
        let smaller = Self::select(self.less(other), self, other);
        Self::select(is_number(self), smaller, self)
    }

    /// The larger of two values; NaN if either is NaN. See [`min`](Scalar::min).
    #[inline]
    #[must_use]
    fn max(self, other: Self) -> Self {
        let larger = Self::select(other.less(self), self, other);
        Self::select(is_number(self), larger, self)
    }
}

/// True in lanes that are not NaN: the sign of a number is below two, and NaN is below nothing.
#[inline]
fn is_number<T: Scalar>(value: T) -> T::Mask {
    value.sign().less(value.splat(2.0))
}
