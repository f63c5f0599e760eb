//! Sine and cosine in vector registers with the same bits on every machine.

use pulp::{Simd, bytemuck};

/// 1.5 * 2^52: a sum with it is rounded to an integer, whose last bits are those of the sum.
const TO_INTEGER: f64 = 6_755_399_441_055_744.0;
const TWO_OVER_PI: f64 = core::f64::consts::FRAC_2_PI;
/// The first 33 bits of pi/2, and the rest.
const HALF_PI: [f64; 2] = [1.570_796_326_734_125_6, 6.077_100_506_506_192e-11];

/// The coefficients of the sine's polynomial on -pi/4..pi/4.
const SIN: [f64; 6] = [
    -1.666_666_666_666_663_2e-1,
    8.333_333_333_322_49e-3,
    -1.984_126_982_985_795e-4,
    2.755_731_370_707_006_8e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];
/// The coefficients of the cosine's polynomial on -pi/4..pi/4, from the fourth power.
const COS: [f64; 6] = [
    4.166_666_666_666_66e-2,
    -1.388_888_888_887_411e-3,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

/// The first `f64` whose upper 32 bits are these.
const fn above(high: u32) -> f64 {
    f64::from_bits((high as u64) << 32)
}

/// Angles from here on are reduced (just above pi/4).
const REDUCED: f64 = above(0x3fe9_21fc);
/// The bounds between 1, 2, 3 and 4 quarter turns, and where rounding decides: just above 3, 5, 7
/// and 9 pi/4.
const QUARTERS: [f64; 4] = [
    above(0x4002_d97d),
    above(0x400f_6a7b),
    above(0x4015_fdbd),
    above(0x401c_463c),
];
/// From here on (2^19 pi), two parts of pi/2 are not enough.
const FAR: f64 = above(0x4139_21fb);
/// The sine of an angle below this (2^-26) is the angle.
const TINY: f64 = above(0x3e50_0000);
/// A remainder below this part of the angle needs more bits of pi/2.
const CANCELLED: f64 = 1.0 / 32_768.0;

/// Sine and cosine of each lane, with the bits of `libm::sin` and `libm::cos`, whatever the
/// instruction set: no product is fused with a sum.
///
/// It computes all cases of those functions (FreeBSD's `s_sin.c`, `e_rem_pio2.c`) at once and
/// selects one for each lane; for lanes that need more than two parts of pi/2, which are rare, it
/// calls them.
///
/// ```
/// use pulp::{Simd, WithSimd};
/// use regen_batch::sin_cos_portable;
///
/// struct One(f64);
/// impl WithSimd for One {
///     type Output = (f64, f64);
///     fn with_simd<S: Simd>(self, simd: S) -> (f64, f64) {
///         let (sin, cos) = sin_cos_portable(simd, simd.splat_f64s(self.0));
///         (simd.reduce_max_f64s(sin), simd.reduce_max_f64s(cos))
///     }
/// }
/// let (sin, cos) = pulp::Arch::new().dispatch(One(2.5));
/// assert_eq!((sin, cos), (0.5984721441039564, -0.8011436155469337));
/// ```
#[inline(always)]
pub fn sin_cos_portable<S: Simd>(simd: S, x: S::f64s) -> (S::f64s, S::f64s) {
    let splat = |c: f64| simd.splat_f64s(c);
    let add = |a, b| simd.add_f64s(a, b);
    let sub = |a, b| simd.sub_f64s(a, b);
    let mul = |a, b| simd.mul_f64s(a, b);
    let select = |mask, a, b| simd.select_f64s(mask, a, b);
    let zero = splat(0.0);
    let size = simd.abs_f64s(x);
    let near = simd.less_than_f64s(size, splat(REDUCED));

    // the number of quarter turns: by comparison up to 9 pi/4, beyond by rounding
    let to_2 = simd.less_than_f64s(size, splat(QUARTERS[0]));
    let to_3 = simd.less_than_f64s(size, splat(QUARTERS[1]));
    let to_4 = simd.less_than_f64s(size, splat(QUARTERS[2]));
    let to_5 = simd.less_than_f64s(size, splat(QUARTERS[3]));
    let few = select(to_4, splat(3.0), splat(4.0));
    let few = select(to_3, splat(2.0), few);
    let few = select(to_2, splat(1.0), few);
    let few = select(simd.less_than_f64s(x, zero), simd.neg_f64s(few), few);
    let many = sub(
        add(mul(x, splat(TWO_OVER_PI)), splat(TO_INTEGER)),
        splat(TO_INTEGER),
    );
    let turns = select(near, zero, select(to_5, few, many));

    // the remainder and its rounding error
    let first = sub(x, mul(turns, splat(HALF_PI[0])));
    let second = mul(turns, splat(HALF_PI[1]));
    let y = sub(first, second);
    let tail = sub(sub(first, y), second);

    // sine and cosine of the remainder
    let z = mul(y, y);
    let w = mul(z, z);
    let v = mul(z, y);
    // `array::map` would not be inlined
    let (s1, s2, s3) = (splat(SIN[0]), splat(SIN[1]), splat(SIN[2]));
    let (s4, s5, s6) = (splat(SIN[3]), splat(SIN[4]), splat(SIN[5]));
    let r = add(
        add(s2, mul(z, add(s3, mul(z, s4)))),
        mul(mul(z, w), add(s5, mul(z, s6))),
    );
    let whole = add(y, mul(v, add(s1, mul(z, r))));
    let inner = sub(mul(z, sub(mul(splat(0.5), tail), mul(v, r))), tail);
    let with_tail = sub(y, sub(inner, mul(v, s1)));
    let sin = select(near, whole, with_tail);
    let (c1, c2, c3) = (splat(COS[0]), splat(COS[1]), splat(COS[2]));
    let (c4, c5, c6) = (splat(COS[3]), splat(COS[4]), splat(COS[5]));
    let r = add(
        mul(z, add(c1, mul(z, add(c2, mul(z, c3))))),
        mul(mul(w, w), add(c4, mul(z, add(c5, mul(z, c6))))),
    );
    let half = mul(splat(0.5), z);
    let leading = sub(splat(1.0), half);
    let rest = add(
        sub(sub(splat(1.0), leading), half),
        sub(mul(z, r), mul(y, tail)),
    );
    let cos = add(leading, rest);

    // an odd number of quarter turns swaps both; the signs are those of the quadrant
    let bits = simd.transmute_u64s_f64s(add(turns, splat(TO_INTEGER)));
    let has = |bit: u64| {
        let bit = simd.splat_u64s(bit);
        simd.equal_u64s(simd.and_u64s(bits, bit), bit)
    };
    let (odd, lower) = (has(1), has(2));
    let (s, c) = (select(odd, cos, sin), select(odd, sin, cos));
    let s = select(lower, simd.neg_f64s(s), s);
    let c = select(simd.xor_m64s(odd, lower), simd.neg_f64s(c), c);
    let s = select(simd.less_than_f64s(size, splat(TINY)), x, s);

    // 1 where the remainder lost too many bits, or the angle is large or not a number
    let has_enough_bits = simd.less_than_f64s(mul(size, splat(CANCELLED)), simd.abs_f64s(y));
    let is_accurate = simd.or_m64s(near, has_enough_bits);
    let is_accurate = simd.and_m64s(is_accurate, simd.less_than_f64s(size, splat(FAR)));
    let by_library = select(is_accurate, zero, splat(1.0));
    if simd.reduce_max_f64s(by_library) > 0.0 {
        by_libm(x, by_library, s, c)
    } else {
        (s, c)
    }
}

/// Replaces the lanes in which `by_library` is 1 by what `libm` computes.
#[cold]
#[inline(never)]
fn by_libm<V: bytemuck::Pod>(x: V, by_library: V, mut s: V, mut c: V) -> (V, V) {
    fn lanes<V: bytemuck::Pod>(v: &V) -> &[f64] {
        bytemuck::cast_slice(core::slice::from_ref(v))
    }
    let sines = bytemuck::cast_slice_mut::<V, f64>(core::slice::from_mut(&mut s));
    let cosines = bytemuck::cast_slice_mut::<V, f64>(core::slice::from_mut(&mut c));
    for ((x, by_library), (s, c)) in lanes(&x)
        .iter()
        .zip(lanes(&by_library))
        .zip(sines.iter_mut().zip(cosines))
    {
        if *by_library > 0.0 {
            (*s, *c) = (libm::sin(*x), libm::cos(*x));
        }
    }
    (s, c)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::{Arch, WithSimd};

    struct All<'a>(&'a [f64], &'a mut [f64], &'a mut [f64]);
    impl WithSimd for All<'_> {
        type Output = ();
        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            let lanes = S::F64_LANES;
            let chunks = self.1.chunks_mut(lanes).zip(self.2.chunks_mut(lanes));
            for (x, (sin, cos)) in self.0.chunks(lanes).zip(chunks) {
                let (s, c) = sin_cos_portable(simd, simd.partial_load_f64s(x));
                simd.partial_store_f64s(sin, s);
                simd.partial_store_f64s(cos, c);
            }
        }
    }

    fn angles() -> Vec<f64> {
        let mut state = 1_u64;
        let mut random = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state
        };
        let mut all = vec![0.0, -0.0, f64::MIN_POSITIVE, f64::NAN, f64::INFINITY, 1e300];
        for scale in [1e-9, 1e-3, 1.0, 3.0, 10.0, 1e3, 1e6, 1e9] {
            all.extend((0..4000).map(|_| (random() as f64 / 2_f64.powi(63) - 1.0) * scale));
        }
        // multiples of pi/4 and the bounds between the cases, with their neighbours
        let bounds = [REDUCED, FAR, TINY, 2_f64.powi(-27)].into_iter();
        let turns = (0..200).map(|k| f64::from(k) * core::f64::consts::FRAC_PI_4);
        for bound in bounds.chain(QUARTERS).chain(turns) {
            for steps in -3..=3_i64 {
                let x = f64::from_bits(bound.to_bits().saturating_add_signed(steps));
                all.extend([x, -x, x * (1.0 + 1e-6), x * (1.0 - 1e-5)]);
            }
        }
        all.extend((0..4000).map(|_| f64::from_bits(random())));
        all
    }

    fn check(task: impl FnOnce(All<'_>)) {
        let x = angles();
        let (mut sin, mut cos) = (vec![0.0; x.len()], vec![0.0; x.len()]);
        task(All(&x, &mut sin, &mut cos));
        for ((x, sin), cos) in x.iter().zip(sin).zip(cos) {
            let same = |a: f64, b: f64| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
            assert!(same(sin, libm::sin(*x)), "sin {x:e}: {sin:e}");
            assert!(same(cos, libm::cos(*x)), "cos {x:e}: {cos:e}");
        }
    }

    #[test]
    fn sines_have_the_bits_of_libm_in_every_instruction_set() {
        check(|all| Arch::new().dispatch(all));
        check(|all| all.with_simd(pulp::Scalar));
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = pulp::x86::V3::try_new() {
            check(|all| Simd::vectorize(simd, all));
        }
    }
}
