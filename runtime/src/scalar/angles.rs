//! Sines and cosines of several `f64` at once: a polynomial without branches, so that the
//! compiler puts the angles into vector registers. Its coefficients are public for scalar types
//! of other crates.

/// The largest |angle|, in rad, for which the reduction by quarter turns is exact: 2^20.
pub const MAX_ANGLE: f64 = 1_048_576.0;

/// pi/2 as a sum of three parts of 33 bits and a remainder.
///
/// The three leading parts times an integer of 20 bits are exact (Cody and Waite, 1980).
pub const HALF_PI: [f64; 4] = [
    1.570_796_326_734_125_6,
    6.077_100_506_303_966e-11,
    2.022_266_248_711_166_5e-21,
    8.478_427_660_368_9e-32,
];

/// (sin y - y) / y^3 in powers of y^2 up to |y| = pi/4, interpolated at Chebyshev nodes.
pub const SIN: [f64; 6] = [
    -0.166_666_666_666_666_66,
    0.008_333_333_333_330_943,
    -0.000_198_412_698_367_495_6,
    2.755_731_609_787_775e-6,
    -2.505_113_087_096_829_7e-8,
    1.591_805_913_698_281e-10,
];

/// (cos y - 1 + y^2/2) / y^4 in powers of y^2, up to the same |y|, interpolated at Chebyshev nodes.
pub const COS: [f64; 6] = [
    0.041_666_666_666_666_664,
    -0.001_388_888_888_888_739_3,
    2.480_158_729_876_004_8e-5,
    -2.755_731_726_880_539e-7,
    2.087_614_565_905_934_4e-9,
    -1.138_258_853_535_252_6e-11,
];

/// 1.5 * 2^52: adding it rounds a number to an integer, which is then in the last bits of the sum.
pub const ROUNDING_SHIFT: f64 = 6_755_399_441_055_744.0;

/// Sine and cosine of every angle, each within one ulp; `None` where an angle is beyond
/// [`MAX_ANGLE`] or NaN.
#[inline(always)]
#[allow(
    clippy::inline_always,
    reason = "a call would return its results in memory: 10 ns of an arm's evaluation"
)]
pub(super) fn sin_cos_all<const N: usize>(angles: &[f64; N]) -> Option<[(f64, f64); N]> {
    let mut within = true;
    for x in angles {
        within &= x.abs() < MAX_ANGLE;
    }
    if !within {
        return None;
    }
    let mut all = [(0.0, 0.0); N];
    // incomplete registers are padded with zeros: computing five angles in two full registers takes
    // half as long as four in a register and one separately
    let (head, rest) = angles.as_chunks::<8>();
    let (out, out_rest) = all.as_chunks_mut::<8>();
    for (angles, out) in head.iter().zip(out) {
        together::<8>(angles, out);
    }
    match rest.len() {
        0 => {}
        1..=4 => together::<4>(rest, out_rest),
        _ => together::<8>(rest, out_rest),
    }
    Some(all)
}

/// Sine and cosine of up to L angles within [`MAX_ANGLE`], computed together.
#[inline(always)]
#[allow(clippy::inline_always, reason = "as for `near`")]
fn together<const L: usize>(angles: &[f64], out: &mut [(f64, f64)]) {
    let mut all = [0.0; L];
    for (x, angle) in all.iter_mut().zip(angles) {
        *x = *angle;
    }
    let (mut sines, mut cosines) = ([0.0; L], [0.0; L]);
    #[cfg(all(feature = "std", target_feature = "fma"))]
    let done = quick_all(&all, &mut sines, &mut cosines);
    #[cfg(not(all(feature = "std", target_feature = "fma")))]
    let done = false;
    if !done {
        for ((x, s), c) in all.iter().zip(&mut sines).zip(&mut cosines) {
            (*s, *c) = near(*x);
        }
    }
    for ((pair, s), c) in out.iter_mut().zip(sines).zip(cosines) {
        *pair = (s, c);
    }
}

/// As [`near`] for several angles, with a shorter reduction by fused products; false where an angle
/// is closer than [`MIN_REMAINDER`] to a multiple of a quarter turn other than zero.
#[cfg(all(feature = "std", target_feature = "fma"))]
#[inline(always)]
#[allow(clippy::inline_always, reason = "as for `near`")]
fn quick_all<const L: usize>(
    angles: &[f64; L],
    sines: &mut [f64; L],
    cosines: &mut [f64; L],
) -> bool {
    let mut accurate = true;
    for ((x, s), c) in angles.iter().zip(sines).zip(cosines) {
        let shifted = fused(*x, core::f64::consts::FRAC_2_PI, ROUNDING_SHIFT);
        let quarters = shifted - ROUNDING_SHIFT;
        // exact: a multiple of the last place of x or of pi/2, and below one
        let first = fused(-quarters, core::f64::consts::FRAC_PI_2, *x);
        // where `accurate`, |first| is well above quarters * HALF_PI_LOW
        let y = fused(-quarters, HALF_PI_LOW, first);
        let tail = fused(-quarters, HALF_PI_LOW, first - y);
        accurate &= (y.abs() >= MIN_REMAINDER) | (quarters == 0.0);
        (*s, *c) = turned(y, tail, shifted.to_bits());
    }
    accurate
}

/// pi/2 minus its nearest `f64`.
#[cfg(all(feature = "std", target_feature = "fma"))]
const HALF_PI_LOW: f64 = 6.123_233_995_736_766e-17;

/// Least remainder, in rad, for the short reduction: 2^-24, a million times what the third part of
/// pi/2 can amount to, relative to the last place.
#[cfg(all(feature = "std", target_feature = "fma"))]
const MIN_REMAINDER: f64 = 5.960_464_477_539_063e-8;

/// Sine and cosine for |x| up to [`MAX_ANGLE`].
#[inline(always)]
#[allow(
    clippy::inline_always,
    reason = "a call would keep the loop around it from being vectorised"
)]
fn near(x: f64) -> (f64, f64) {
    let shifted = fused(x, core::f64::consts::FRAC_2_PI, ROUNDING_SHIFT);
    let turns = shifted.to_bits();
    let quarters = shifted - ROUNDING_SHIFT;

    // y + tail = x - quarters * pi/2; two_sum returns the rounding errors of the sums
    let first = x - quarters * HALF_PI[0];
    let (second, error_2) = two_sum(first, -(quarters * HALF_PI[1]));
    let (third, error_3) = two_sum(second, -(quarters * HALF_PI[2]));
    let rest = (error_2 + error_3) - quarters * HALF_PI[3];
    let y = third + rest;
    turned(y, (third - y) + rest, turns)
}

/// Sine and cosine of y + tail, |y| up to pi/4, plus `turns` quarter turns, of which only the last
/// two bits matter.
#[inline(always)]
#[allow(clippy::inline_always, reason = "as for `near`")]
fn turned(y: f64, tail: f64, turns: u64) -> (f64, f64) {
    let z = y * y;
    let half = z * 0.5;
    // sin(y + tail) = y + (y^3 S(y^2) + tail cos y)
    let sin = y + fused(y * z, polynomial(z, &SIN), tail * (1.0 - half));
    // cos(y + tail) = 1 - y^2/2 + (y^4 C(y^2) - y tail), with the rounding error of 1 - y^2/2 added
    // back
    let leading = 1.0 - half;
    let lost = (1.0 - leading) - half;
    let cos = leading + (lost + fused(z * z, polynomial(z, &COS), -(y * tail)));

    // an odd number of quarter turns swaps sine and cosine; then each gets its sign
    let swap = 0_u64.wrapping_sub(turns & 1);
    let (s, c) = (sin.to_bits(), cos.to_bits());
    let exchanged = (s ^ c) & swap;
    let (s_sign, c_sign) = ((turns & 2) << 62, (turns.wrapping_add(1) & 2) << 62);
    (
        f64::from_bits((s ^ exchanged) ^ s_sign),
        f64::from_bits((c ^ exchanged) ^ c_sign),
    )
}

#[inline(always)]
#[allow(clippy::inline_always, reason = "as for `near`")]
fn fused(a: f64, b: f64, c: f64) -> f64 {
    super::Scalar::mul_add(a, b, c)
}

#[inline(always)]
#[allow(clippy::inline_always, reason = "as for `near`")]
fn polynomial(z: f64, [c0, c1, c2, c3, c4, c5]: &[f64; 6]) -> f64 {
    // Estrin's scheme: half as deep as Horner's
    let low = fused(*c1, z, *c0);
    let middle = fused(*c3, z, *c2);
    let high = fused(*c5, z, *c4);
    let square = z * z;
    fused(fused(high, square, middle), square, low)
}

/// The rounded sum and its exact rounding error (Knuth).
#[inline(always)]
#[allow(clippy::inline_always, reason = "as for `near`")]
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let from_b = sum - a;
    let from_a = sum - from_b;
    (sum, (a - from_a) + (b - from_b))
}
