//! The number types with which loops are closed.

use regen_runtime::Scalar;

/// `f64` or `f32`.
pub trait Real: Scalar + PartialOrd {
    /// The distance from 1 to the next number.
    const EPSILON: Self;
    /// Zero.
    const ZERO: Self;
    /// One.
    const ONE: Self;
    /// Positive infinity.
    const INFINITY: Self;
    /// Not a number.
    const NAN: Self;

    /// The nearest number to this value.
    #[must_use]
    fn of(value: f64) -> Self;

    /// Whether it is neither NaN nor infinite.
    #[must_use]
    fn is_finite(self) -> bool;
}

macro_rules! real {
    ($float:ident) => {
        impl Real for $float {
            const EPSILON: Self = $float::EPSILON;
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const INFINITY: Self = $float::INFINITY;
            const NAN: Self = $float::NAN;

            #[inline]
            #[allow(clippy::cast_possible_truncation, reason = "rounded to the nearest")]
            #[allow(clippy::cast_lossless, reason = "the macro serves both widths")]
            fn of(value: f64) -> Self {
                value as $float
            }

            #[inline]
            fn is_finite(self) -> bool {
                $float::is_finite(self)
            }
        }
    };
}

real!(f64);
real!(f32);

/// The largest absolute value; NaN if any is NaN.
pub(crate) fn largest<T: Real>(values: impl IntoIterator<Item = T>) -> T {
    let values = values.into_iter();
    values.fold(T::ZERO, |m, x| Scalar::max(m, Scalar::abs(x)))
}
