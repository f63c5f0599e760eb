//! The number types of a control cycle.

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
    /// The largest magnitude that an equation or a measurement may have: products of four such
    /// numbers are finite.
    const LARGE: Self;

    /// The nearest number to this value.
    #[must_use]
    fn of(value: f64) -> Self;

    /// Whether it is neither NaN nor infinite.
    #[must_use]
    fn is_finite(self) -> bool;

    /// The exponential function.
    #[must_use]
    fn exp(self) -> Self;

    /// The natural logarithm.
    #[must_use]
    fn ln(self) -> Self;
}

macro_rules! real {
    ($float:ident, $large:literal, $exp:path, $ln:path) => {
        impl Real for $float {
            const EPSILON: Self = $float::EPSILON;
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const INFINITY: Self = $float::INFINITY;
            const NAN: Self = $float::NAN;
            const LARGE: Self = $large;

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

            fn exp(self) -> Self {
                $exp(self)
            }

            fn ln(self) -> Self {
                $ln(self)
            }
        }
    };
}

real!(f64, 1e75, libm::exp, libm::log);
real!(f32, 1e9, libm::expf, libm::logf);

/// The largest absolute value; NaN if any is NaN.
pub(crate) fn largest<T: Real>(values: impl IntoIterator<Item = T>) -> T {
    let values = values.into_iter();
    values.fold(T::ZERO, |m, x| Scalar::max(m, Scalar::abs(x)))
}

/// Whether all are finite and none exceeds [`Real::LARGE`].
pub(crate) fn moderate<'a, T: Real + 'a>(values: impl IntoIterator<Item = &'a T>) -> bool {
    let mut values = values.into_iter();
    values.all(|x| Scalar::abs(*x) <= T::LARGE)
}
