//! `f64` and `f32`. Sines and cosines come from `libm`, so that every machine computes the same
//! digits, with the standard library or without it.

use super::Scalar;

/// Implements [`Scalar`] for one float type.
macro_rules! scalar {
    ($float:ident, $sincos:ident, $sqrt:ident, { $($all:item)* }) => {
        impl Scalar for $float {
            type Mask = bool;

            #[inline]
            #[allow(clippy::cast_lossless, reason = "the macro serves both widths")]
            fn splat(self, c: f64) -> Self {
                c as $float
            }

            #[inline]
            fn mul_add(self, a: Self, b: Self) -> Self {
                // Without std there is no fused operation that the compiler maps to hardware.
                #[cfg(all(feature = "std", target_feature = "fma"))]
                {
                    $float::mul_add(self, a, b)
                }
                #[cfg(not(all(feature = "std", target_feature = "fma")))]
                {
                    self * a + b
                }
            }

            #[inline]
            fn abs(self) -> Self {
                $float::abs(self)
            }

            #[inline]
            fn sign(self) -> Self {
                if self > 0.0 {
                    1.0
                } else if self < 0.0 {
                    -1.0
                } else {
                    self
                }
            }

            #[inline]
            fn sqrt(self) -> Self {
                // both are correctly rounded; that of std is one instruction
                #[cfg(feature = "std")]
                {
                    $float::sqrt(self)
                }
                #[cfg(not(feature = "std"))]
                {
                    libm::$sqrt(self)
                }
            }

            #[inline]
            fn sin_cos(self) -> (Self, Self) {
                libm::$sincos(self)
            }

            $($all)*

            #[inline]
            fn less(self, other: Self) -> bool {
                self < other
            }

            #[inline]
            fn min(self, other: Self) -> Self {
                if self < other || self.is_nan() {
                    self
                } else {
                    other
                }
            }

            #[inline]
            fn max(self, other: Self) -> Self {
                if other < self || self.is_nan() {
                    self
                } else {
                    other
                }
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
    };
}

scalar!(f64, sincos, sqrt, {
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "the results shall stay in registers")]
    fn sin_cos_all<const N: usize>(angles: [Self; N]) -> [(Self, Self); N] {
        match super::angles::sin_cos_all(&angles) {
            Some(all) => all,
            None => angles.map(Scalar::sin_cos),
        }
    }
});
scalar!(f32, sincosf, sqrtf, {});
