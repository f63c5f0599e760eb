//! Compares every scalar type with `f64`, and tests the propagation of NaN.

#![allow(clippy::float_cmp, reason = "these values are exact")]

use proptest::prelude::*;
use regen_runtime::Scalar;

/// All operations on a pair of values, in a fixed order.
fn operations<T: Scalar>(x: T, y: T) -> [T; 13] {
    let (sin, cos) = x.sin_cos();
    [
        x + y,
        x - y,
        x * y,
        x / y,
        -x,
        x.splat(0.1),
        x.mul_add(y, x),
        Scalar::abs(x),
        x.sign(),
        sin,
        cos,
        Scalar::min(x, y),
        Scalar::max(x, y),
    ]
}

/// The same operations with the standard library.
fn reference(x: f64, y: f64) -> [f64; 13] {
    [
        x + y,
        x - y,
        x * y,
        x / y,
        -x,
        0.1,
        x * y + x,
        x.abs(),
        if x == 0.0 { x } else { x.signum() },
        x.sin(),
        x.cos(),
        x.min(y),
        x.max(y),
    ]
}

/// Compares within rounding errors: `mul_add` may be fused, a sum may have two rounding errors, and
/// sines may be 2 ulp off.
fn assert_like(found: &[f64; 13], x: f64, y: f64, epsilon: f64) {
    let size = 1.0 + x.abs() + (x * y).abs();
    for (i, (found, expected)) in found.iter().zip(reference(x, y)).enumerate() {
        let scale = if i == 6 { size } else { expected.abs() };
        assert!(
            (found - expected).abs() <= 4.0 * epsilon * scale,
            "operation {i} at {x}, {y}: {found} is not {expected}"
        );
    }
}

fn values() -> impl Strategy<Value = f64> {
    prop_oneof![-10.0..10.0_f64, -1e-3..1e-3_f64, -1e5..1e5_f64].prop_filter("zero", |x| *x != 0.0)
}

proptest! {
    #[test]
    fn double_precision_gives_the_results_of_the_standard_library(x in values(), y in values()) {
        assert_like(&operations(x, y), x, y, f64::EPSILON);
    }

    #[test]
    fn single_precision_is_double_precision_rounded(x in -10.0..10.0_f32, y in 0.1..10.0_f32) {
        prop_assume!(x != 0.0);
        // near multiples of pi/2 both get the same argument, so that the relative error is small
        let found = operations(x, y).map(f64::from);
        assert_like(&found, f64::from(x), f64::from(y), f64::from(f32::EPSILON));
    }

    #[test]
    fn comparisons_select_a_value(x in values(), y in values()) {
        prop_assert_eq!(f64::select(x.less(y), 1.0, 2.0), if x < y { 1.0 } else { 2.0 });
        prop_assert_eq!(f64::all(x.less(y)), x < y);
    }
}

/// Checks the propagation of NaN for one type; `get` extracts the value.
fn nan_rules<T: Scalar>(proto: T, get: impl Fn(T) -> f64) {
    let nan = proto.splat(f64::NAN);
    let one = proto.splat(1.0);
    for value in operations(nan, one)
        .into_iter()
        .enumerate()
        .filter_map(|(i, v)| {
            // only the result of `splat` does not depend on the value
            (i != 5).then_some(v)
        })
    {
        assert!(get(value).is_nan());
    }
    for value in [Scalar::min(one, nan), Scalar::max(one, nan), one * nan] {
        assert!(get(value).is_nan());
    }
    assert!(!T::all(nan.less(one)));
    assert!(!T::all(one.less(nan)));
    assert!(!T::all(nan.less(nan)));
    let zero = proto.splat(0.0);
    assert!(get(zero.sign()) == 0.0 && get((-zero).sign()) == 0.0);
    let infinite = proto.splat(f64::INFINITY);
    assert_eq!(get(Scalar::min(infinite, infinite)), f64::INFINITY);
    assert_eq!(get(Scalar::max(-infinite, infinite)), f64::INFINITY);
}

#[test]
fn nan_passes_through_everything_but_comparisons() {
    nan_rules(0.0_f64, |x| x);
    nan_rules(0.0_f32, f64::from);
}

#[cfg(feature = "dual")]
mod dual {
    use super::*;
    use num_dual::{Dual2_64, Dual64};
    use regen_runtime::Dual;

    proptest! {
        #[test]
        fn the_real_part_is_the_value(x in values(), y in values()) {
            let found = operations(Dual(Dual64::new(x, 1.0)), Dual(Dual64::new(y, 0.0)));
            assert_like(&found.map(|v| v.0.re), x, y, f64::EPSILON);
        }

        #[test]
        fn the_derivative_is_that_of_differences(x in 0.2..3.0_f64, y in 3.5..5.0_f64) {
            let h = 1e-6;
            let found = operations(Dual(Dual64::new(x, 1.0)), Dual(Dual64::new(y, 0.0)));
            let (after, before) = (reference(x + h, y), reference(x - h, y));
            for (i, found) in found.iter().enumerate() {
                let difference = (after[i] - before[i]) / (2.0 * h);
                prop_assert!((found.0.eps - difference).abs() < 1e-7, "operation {}", i);
            }
        }
    }

    #[test]
    fn second_derivatives_work_too() {
        let x = Dual(Dual2_64::from_re(0.4).derivative());
        let sine = x.sin_cos().0.0;
        assert!((sine.v2 + 0.4_f64.sin()).abs() < 1e-15);
    }

    #[test]
    fn nan_rules_are_satisfied() {
        nan_rules(Dual(Dual64::from_re(0.0)), |x| x.0.re);
    }
}

mod lane {
    use super::*;
    use pulp::{Arch, Simd, WithSimd, bytemuck};
    use regen_batch::Lane;
    use regen_runtime::solve_pivoted;

    fn lanes<S: Simd>(simd: S, values: &[f64]) -> Lane<S> {
        Lane {
            simd,
            v: simd.partial_load_f64s(&values[..S::F64_LANES]),
        }
    }

    fn values_of<S: Simd>(lane: Lane<S>) -> Vec<f64> {
        bytemuck::cast_slice::<S::f64s, f64>(&[lane.v]).to_vec()
    }

    /// Runs a check with every available instruction set, and without any.
    fn everywhere<F: WithSimd<Output = ()> + Copy>(check: F) {
        Arch::new().dispatch(check);
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = pulp::x86::V3::try_new() {
            Simd::vectorize(simd, check);
        }
        check.with_simd(pulp::Scalar);
    }

    #[derive(Clone, Copy)]
    struct Agree<'a>(&'a [f64], &'a [f64]);
    impl WithSimd for Agree<'_> {
        type Output = ();
        fn with_simd<S: Simd>(self, simd: S) {
            let found = operations(lanes(simd, self.0), lanes(simd, self.1)).map(values_of);
            for (i, (x, y)) in self.0.iter().zip(self.1).take(S::F64_LANES).enumerate() {
                let at = core::array::from_fn(|k| found[k][i]);
                assert_like(&at, *x, *y, f64::EPSILON);
            }
        }
    }

    /// The size of the last bit of a number.
    fn ulp(x: f64) -> f64 {
        let next = f64::from_bits(x.abs().to_bits() + 1);
        next - x.abs()
    }

    #[derive(Clone, Copy)]
    struct Angles<'a>(&'a [f64]);
    impl WithSimd for Angles<'_> {
        type Output = ();
        fn with_simd<S: Simd>(self, simd: S) {
            let (sin, cos) = lanes(simd, self.0).sin_cos();
            let (sin, cos) = (values_of(sin), values_of(cos));
            for i in 0..S::F64_LANES {
                let x = self.0[i];
                for (found, expected) in [(sin[i], x.sin()), (cos[i], x.cos())] {
                    // the reference itself has an error of up to one ulp
                    let error = (found - expected).abs();
                    assert!(
                        error <= 2.0 * ulp(expected),
                        "{x:e}: {found:e}, {expected:e}"
                    );
                }
            }
        }
    }

    #[derive(Clone, Copy)]
    struct Together<'a>(&'a [f64]);
    impl WithSimd for Together<'_> {
        type Output = ();
        fn with_simd<S: Simd>(self, simd: S) {
            let angles: [Lane<S>; 3] = core::array::from_fn(|i| lanes(simd, &self.0[8 * i..]));
            let bits = |(sin, cos): (Lane<S>, Lane<S>)| {
                [sin, cos].map(|x| {
                    values_of(x)
                        .into_iter()
                        .map(f64::to_bits)
                        .collect::<Vec<_>>()
                })
            };
            let within = |x: &Lane<S>| values_of(*x).iter().all(|x| x.abs() < Lane::<S>::REACH);
            let together = Lane::sin_cos_all(angles);
            if angles.iter().all(within) {
                assert_eq!(together.map(bits), angles.map(|x| bits(x.sin_cos())));
            } else {
                let library = |x: Lane<S>| {
                    bits((
                        x.map(|x| Scalar::sin_cos(x).0),
                        x.map(|x| Scalar::sin_cos(x).1),
                    ))
                };
                assert_eq!(together.map(bits), angles.map(library));
            }
        }
    }

    #[derive(Clone, Copy)]
    struct Systems<'a>(&'a [f64]);
    impl WithSimd for Systems<'_> {
        type Output = ();
        fn with_simd<S: Simd>(self, simd: S) {
            const L: usize = 8;
            let entry = |i: usize, j: usize| lanes(simd, &self.0[(4 * i + j) * L..]);
            let a: [[_; 3]; 4] = core::array::from_fn(|i| core::array::from_fn(|j| entry(i, j)));
            let b: [[_; 1]; 4] = core::array::from_fn(|i| [entry(i, 3)]);
            let (x, ratio) = solve_pivoted(&a, &b);
            for lane in 0..S::F64_LANES {
                let a = a.map(|row| row.map(|v| values_of(v)[lane]));
                let b = b.map(|row| row.map(|v| values_of(v)[lane]));
                let (alone, alone_ratio) = solve_pivoted(&a, &b);
                assert!((values_of(ratio)[lane] - alone_ratio).abs() < 1e-13);
                for (together, alone) in x.iter().flatten().zip(alone.iter().flatten()) {
                    let together = values_of(*together)[lane];
                    let bound = 1e-13 * (1.0 + alone.abs()) / alone_ratio;
                    assert!((together - alone).abs() < bound, "{together}, {alone}");
                }
            }
        }
    }

    #[derive(Clone, Copy)]
    struct NanRules;
    impl WithSimd for NanRules {
        type Output = ();
        fn with_simd<S: Simd>(self, simd: S) {
            nan_rules(Lane::broadcast(simd, 0.0), |x| {
                values_of(x)[S::F64_LANES - 1]
            });
        }
    }

    proptest! {
        #[test]
        fn every_lane_is_double_precision(
            x in prop::collection::vec(values(), 8),
            y in prop::collection::vec(values(), 8),
        ) {
            everywhere(Agree(&x, &y));
        }

        #[test]
        fn sine_and_cosine_are_within_two_ulp(
            x in prop::collection::vec(prop_oneof![
                -10.0..10.0_f64,
                -Lane::<pulp::Scalar>::REACH..Lane::<pulp::Scalar>::REACH,
                -1e-300..1e-300_f64,
            ], 8),
        ) {
            everywhere(Angles(&x));
        }

        #[test]
        fn multiples_of_a_quarter_turn_keep_their_digits(
            n in prop::collection::vec(-667_543..667_543_i32, 8),
            off in -3..=3_i64,
        ) {
            let x: Vec<f64> = n
                .iter()
                .map(|n| f64::from(*n) * core::f64::consts::FRAC_PI_2)
                .map(|x| f64::from_bits(x.to_bits().wrapping_add_signed(if x == 0.0 { 0 } else { off })))
                .collect();
            everywhere(Angles(&x));
        }

        #[test]
        fn angles_beyond_the_reach_are_computed_one_by_one(
            x in prop::collection::vec(-1e300..1e300_f64, 7),
        ) {
            everywhere(Angles(&[x.as_slice(), &[0.5]].concat()));
        }

        #[test]
        fn angles_computed_together_are_those_computed_one_by_one(
            mut x in prop::collection::vec(-1e5..1e5_f64, 24),
            far in prop::option::of(0..24_usize),
        ) {
            if let Some(far) = far {
                x[far] = 3e6;
            }
            everywhere(Together(&x));
        }

        #[test]
        fn every_lane_pivots_on_its_own(v in prop::collection::vec(-1.0..1.0_f64, 16 * 8)) {
            everywhere(Systems(&v));
        }
    }

    #[test]
    fn nan_rules_are_satisfied() {
        everywhere(NanRules);
    }
}
