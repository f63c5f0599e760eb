//! Several numbers at once in a SIMD register, with the instruction set detected at run time.

use core::ops::{Add, Div, Mul, Neg, Sub};

use pulp::{Simd, bytemuck};
use regen_runtime::Scalar;
use regen_runtime::angles::{COS, HALF_PI, MAX_ANGLE, ROUNDING_SHIFT, SIN};

/// A SIMD register of `f64`s as a [`Scalar`]: each lane belongs to another state.
///
/// The token `simd` proves that the instruction set is available. Get one from
/// `pulp::Arch::new().dispatch(...)`. Only code that is inlined into the dispatched function is
/// compiled for the instruction set; a function that is not inlined still gives the right values,
/// but each of its operations becomes a call.
///
/// Sine and cosine are polynomials within 2 ulp where the angles of all lanes are within
/// [`Lane::REACH`]; beyond, each lane is computed separately.
///
/// ```
/// use pulp::{Arch, Simd, WithSimd};
/// use regen_batch::Lane;
/// use regen_runtime::Scalar;
///
/// struct Sum<'a>(&'a [f64]);
/// impl WithSimd for Sum<'_> {
///     type Output = f64;
///     fn with_simd<S: Simd>(self, simd: S) -> f64 {
///         let (lanes, rest) = S::as_simd_f64s(self.0);
///         let whole: f64 = lanes
///             .iter()
///             .map(|v| simd.reduce_sum_f64s(Lane { simd, v: *v }.sin_cos().0.v))
///             .sum();
///         whole + rest.iter().map(|x| f64::sin(*x)).sum::<f64>()
///     }
/// }
/// let angles = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9];
/// let expected: f64 = angles.iter().map(|x| f64::sin(*x)).sum();
/// assert!((Arch::new().dispatch(Sum(&angles)) - expected).abs() < 1e-14);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Lane<S: Simd> {
    /// The token of the instruction set.
    pub simd: S,
    /// The values.
    pub v: S::f64s,
}

/// The result of a comparison of [`Lane`]s.
#[derive(Clone, Copy, Debug)]
pub struct LaneMask<S: Simd> {
    simd: S,
    mask: S::m64s,
}

impl<S: Simd> Lane<S> {
    /// The largest |angle|, in rad, for which the vector reduction is exact: 2^20.
    pub const REACH: f64 = MAX_ANGLE;

    /// A register with the same value in every lane.
    #[inline(always)]
    pub fn broadcast(simd: S, value: f64) -> Self {
        Self {
            simd,
            v: simd.splat_f64s(value),
        }
    }

    /// Applies the function to each lane separately.
    #[inline]
    #[must_use]
    pub fn map(self, function: impl Fn(f64) -> f64) -> Self {
        let mut v = self.v;
        for value in bytemuck::cast_slice_mut::<S::f64s, f64>(core::slice::from_mut(&mut v)) {
            *value = function(*value);
        }
        Self { v, ..self }
    }

    /// True in lanes that are not NaN: NaN does not equal itself.
    #[inline(always)]
    fn is_number(self) -> LaneMask<S> {
        LaneMask {
            simd: self.simd,
            mask: self.simd.equal_f64s(self.v, self.v),
        }
    }

    /// Whether products are fused with sums: -2^-60 is lost where the product is rounded. Both
    /// factors are constants, so that the compiler can evaluate this test.
    #[inline(always)]
    fn fuses(self) -> bool {
        let small = f64::EPSILON * 4_194_304.0;
        let (low, high) = (self.splat(1.0 - small), self.splat(1.0 + small));
        let lost = low.mul_add(high, self.splat(-1.0));
        bytemuck::cast_slice::<S::f64s, f64>(core::slice::from_ref(&lost.v))
            .iter()
            .any(|x| *x != 0.0)
    }

    /// `self - quarters * pi/2` as a value and its rounding error.
    #[inline(always)]
    fn reduced(self, quarters: Self) -> (Self, Self) {
        if self.fuses() {
            // exact: a multiple of the last place of x or of pi/2, and below one
            let first = (-quarters).mul_add(self.splat(core::f64::consts::FRAC_PI_2), self);
            let low = self.splat(HALF_PI_LOW);
            let second = quarters * low;
            let (y, error) = two_sum(first, -second);
            let rounded = quarters.mul_add(low, -second);
            let last = quarters.mul_add(self.splat(HALF_PI_LAST), rounded);
            (y, error - last)
        } else {
            // the three leading parts of pi/2 have 33 bits, so that their products with an
            // integer of 20 bits are exact (Cody and Waite); two_sum returns the rounding errors
            let first = self - quarters * self.splat(HALF_PI[0]);
            let (second, error_2) = two_sum(first, -(quarters * self.splat(HALF_PI[1])));
            let (third, error_3) = two_sum(second, -(quarters * self.splat(HALF_PI[2])));
            let rest = (error_2 + error_3) - quarters * self.splat(HALF_PI[3]);
            let y = third + rest;
            (y, (third - y) + rest)
        }
    }

    /// Sine and cosine of y + tail, |y| up to pi/4, plus the number of quarter turns that is in the
    /// last bits of `shifted`.
    #[inline(always)]
    fn turned(self, tail: Self, shifted: Self) -> (Self, Self) {
        let (simd, y) = (self.simd, self);
        let z = y * y;
        let half = z * y.splat(0.5);
        // sin(y + tail) = y + (y^3 S(y^2) + tail cos y)
        let leading = y.splat(1.0) - half;
        let sin = y + (y * z).mul_add(polynomial(z, &SIN), tail * leading);
        // cos(y + tail) = 1 - y^2/2 + (y^4 C(y^2) - y tail), with the rounding error of 1 - y^2/2
        // added back
        let lost = (y.splat(1.0) - leading) - half;
        let cos = leading + (z * z).mul_add(polynomial(z, &COS), (-y).mul_add(tail, lost));

        // an odd number of quarter turns swaps sine and cosine; the sign of the sine is the second
        // last bit, that of the cosine the exclusive or of the last two
        let bits = simd.transmute_u64s_f64s(shifted.v);
        let has = |bit: u64| {
            let bit = simd.splat_u64s(bit);
            simd.equal_u64s(simd.and_u64s(bits, bit), bit)
        };
        let (last, second) = (has(1), has(2));
        let (odd, sin_negative, cos_negative) = (
            LaneMask { simd, mask: last },
            LaneMask { simd, mask: second },
            LaneMask {
                simd,
                mask: simd.xor_m64s(second, last),
            },
        );
        let (s, c) = (Self::select(odd, cos, sin), Self::select(odd, sin, cos));
        (
            Self::select(sin_negative, -s, s),
            Self::select(cos_negative, -c, c),
        )
    }
}

const TWO_OVER_PI: f64 = core::f64::consts::FRAC_2_PI;

/// pi/2 minus its nearest `f64`.
const HALF_PI_LOW: f64 = 6.123_233_995_736_766e-17;
/// pi/2 minus its nearest `f64` and [`HALF_PI_LOW`].
const HALF_PI_LAST: f64 = -1.497_384_904_859_183_3e-33;

/// Sines and cosines of angles within [`Lane::REACH`]. Each loop is short enough for the compiler
/// to unroll it, so that the angles stay in registers and are computed side by side.
#[inline(always)]
fn sin_cos_near<S: Simd, const N: usize>(angles: [Lane<S>; N]) -> [(Lane<S>, Lane<S>); N] {
    let mut shifted = angles;
    for x in &mut shifted {
        // the sum rounds to an integer of quarter turns
        *x = x.mul_add(x.splat(TWO_OVER_PI), x.splat(ROUNDING_SHIFT));
    }
    let mut reduced = angles.map(|x| (x, x));
    for ((y, tail), (x, shifted)) in reduced.iter_mut().zip(angles.iter().zip(&shifted)) {
        (*y, *tail) = x.reduced(*shifted - x.splat(ROUNDING_SHIFT));
    }
    for ((y, tail), shifted) in reduced.iter_mut().zip(&shifted) {
        (*y, *tail) = y.turned(*tail, *shifted);
    }
    reduced
}

/// Evaluates the polynomial with these coefficients, lowest power first.
#[inline(always)]
fn polynomial<S: Simd>(z: Lane<S>, coefficients: &[f64; 6]) -> Lane<S> {
    let [c0, c1, c2, c3, c4, c5] = coefficients.map(|c| z.splat(c));
    // Estrin's scheme: half as deep as Horner's
    let square = z * z;
    let high = c5.mul_add(z, c4).mul_add(square, c3.mul_add(z, c2));
    high.mul_add(square, c1.mul_add(z, c0))
}

/// The rounded sum and its exact rounding error (Knuth).
#[inline(always)]
fn two_sum<S: Simd>(a: Lane<S>, b: Lane<S>) -> (Lane<S>, Lane<S>) {
    let sum = a + b;
    let from_b = sum - a;
    let from_a = sum - from_b;
    (sum, (a - from_a) + (b - from_b))
}

macro_rules! binary {
    ($trait:ident, $method:ident, $operation:ident) => {
        impl<S: Simd> $trait for Lane<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self {
                    v: self.simd.$operation(self.v, other.v),
                    ..self
                }
            }
        }
    };
}
binary!(Add, add, add_f64s);
binary!(Sub, sub, sub_f64s);
binary!(Mul, mul, mul_f64s);
binary!(Div, div, div_f64s);

impl<S: Simd> Neg for Lane<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self {
            v: self.simd.neg_f64s(self.v),
            ..self
        }
    }
}

impl<S: Simd> Scalar for Lane<S> {
    type Mask = LaneMask<S>;

    #[inline(always)]
    fn splat(self, c: f64) -> Self {
        Self::broadcast(self.simd, c)
    }

    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        Self {
            v: self.simd.mul_add_e_f64s(self.v, a.v, b.v),
            ..self
        }
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self {
            v: self.simd.abs_f64s(self.v),
            ..self
        }
    }

    #[inline(always)]
    fn sign(self) -> Self {
        let zero = self.splat(0.0);
        let negative = Self::select(self.less(zero), self.splat(-1.0), self);
        Self::select(zero.less(self), self.splat(1.0), negative)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self {
            v: self.simd.sqrt_f64s(self.v),
            ..self
        }
    }

    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let [both] = Self::sin_cos_all([self]);
        both
    }

    #[inline(always)]
    fn sin_cos_all<const N: usize>(angles: [Self; N]) -> [(Self, Self); N] {
        let [first, ..] = angles.as_slice() else {
            return angles.map(|x| (x, x));
        };
        let simd = first.simd;
        let mut within = first.abs().less(first.splat(Self::REACH)).mask;
        for x in &angles {
            within = simd.and_m64s(within, x.abs().less(x.splat(Self::REACH)).mask);
        }
        if Self::all(LaneMask { simd, mask: within }) {
            sin_cos_near(angles)
        } else {
            angles.map(sin_cos_each)
        }
    }

    #[inline(always)]
    fn less(self, other: Self) -> LaneMask<S> {
        LaneMask {
            simd: self.simd,
            mask: self.simd.less_than_f64s(self.v, other.v),
        }
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        let smaller = Self::select(self.less(other), self, other);
        Self::select(self.is_number(), smaller, self)
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        let larger = Self::select(other.less(self), self, other);
        Self::select(self.is_number(), larger, self)
    }

    #[inline(always)]
    fn select(mask: LaneMask<S>, yes: Self, no: Self) -> Self {
        Self {
            simd: mask.simd,
            v: mask.simd.select_f64s(mask.mask, yes.v, no.v),
        }
    }

    #[inline(always)]
    fn all(mask: LaneMask<S>) -> bool {
        let simd = mask.simd;
        let truth = simd.select_f64s(mask.mask, simd.splat_f64s(1.0), simd.splat_f64s(0.0));
        simd.reduce_min_f64s(truth) > 0.5
    }
}

/// Sine and cosine of each lane, computed separately.
#[cold]
#[inline(never)]
fn sin_cos_each<S: Simd>(x: Lane<S>) -> (Lane<S>, Lane<S>) {
    (
        x.map(|value| Scalar::sin_cos(value).0),
        x.map(|value| Scalar::sin_cos(value).1),
    )
}
