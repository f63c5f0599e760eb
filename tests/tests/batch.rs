//! Base regressors of many samples in SIMD lanes are the same as those computed one by one.
#![allow(clippy::unwrap_used, clippy::expect_used)]
#![allow(
    clippy::inline_always,
    reason = "lanes need the instruction set of the function that dispatches"
)]

use pulp::{Simd, WithSimd};
use regen_batch::{
    Block, Consumer, Normal, Samples, base_regressors, base_regressors_on_threads, task,
};
use regen_generated::rps3::{self, Rps3};
use regen_runtime::SizeError;
use regen_tests::reference::Random;

const N: usize = 9;
const DOF: usize = 3;
const P: usize = rps3::BASE.len();

/// The number of samples: not a multiple of any number of lanes.
const COUNT: usize = 37;

type Series = [Vec<f64>; N];
type Regressor = [[f64; DOF]; P];

/// Coordinates around home, velocities, accelerations. They are not closed; the functions take
/// states as given.
fn states() -> [Series; 3] {
    let mut random = Random::new(5);
    let mut series = |size: f64, home: &[f64; N]| -> Series {
        home.map(|middle| {
            let draw = |_| random.uniform(middle - size, middle + size);
            (0..COUNT).map(draw).collect()
        })
    };
    let zero = [0.0; N];
    [
        series(0.1, &rps3::HOME),
        series(1.0, &zero),
        series(5.0, &zero),
    ]
}

fn samples([q, qd, qdd]: &[Series; 3]) -> Samples<'_, N> {
    Samples::new(borrowed(q), borrowed(qd), borrowed(qdd)).unwrap()
}

fn borrowed(all: &Series) -> [&[f64]; N] {
    all.each_ref().map(Vec::as_slice)
}

/// The regressors and conditions of all samples, computed one by one.
fn one_by_one([q, qd, qdd]: &[Series; 3]) -> Vec<(Regressor, f64)> {
    let at = |all: &Series, sample: usize| all.each_ref().map(|series| series[sample]);
    let one = |s: usize| {
        let mut w = [[0.0; DOF]; P];
        let condition = rps3::base_regressor(&at(q, s), &at(qd, s), &at(qdd, s), &mut w);
        (w, condition.pivot)
    };
    (0..COUNT).map(one).collect()
}

/// Collects index, regressor and condition of every sample.
#[derive(Default)]
struct Collected(Vec<(usize, Regressor, f64)>);

impl Consumer<DOF, P> for Collected {
    #[inline(always)]
    fn take<S: Simd>(&mut self, block: &Block<'_, S, DOF, P>) {
        for i in 0..block.len {
            let w = std::array::from_fn(|c| std::array::from_fn(|r| block.entry(c, r)[i]));
            self.0.push((block.first + i, w, block.pivots()[i]));
        }
    }
}

fn assert_close(found: &[(usize, Regressor, f64)], expected: &[(Regressor, f64)]) {
    assert_eq!(found.len(), expected.len());
    for (s, ((number, w, pivot), (expected, condition))) in found.iter().zip(expected).enumerate() {
        assert_eq!(*number, s);
        // they differ by rounding in the solve: with or without fused multiply-add, sines within an
        // ulp
        assert!((pivot - condition).abs() < 1e-12 * (1.0 + condition));
        let size = expected
            .iter()
            .flatten()
            .fold(1.0_f64, |m, x| m.max(x.abs()));
        for (x, y) in w.iter().flatten().zip(expected.iter().flatten()) {
            assert!((x - y).abs() < 1e-11 * size, "{x}, {y}");
        }
    }
}

#[test]
fn lanes_give_the_results_of_single_evaluations() {
    let states = states();
    let expected = one_by_one(&states);
    let mut found = Collected::default();
    base_regressors::<Rps3, _, N, DOF, P>(&samples(&states), &mut found);
    assert_close(&found.0, &expected);
    let mut found = Collected::default();
    task::<Rps3, _, N, DOF, P>(&samples(&states), &mut found).with_simd(pulp::Scalar);
    assert_close(&found.0, &expected);
}

#[test]
fn threads_take_parts_in_order_even_with_more_threads_than_samples() {
    let states = states();
    let expected = one_by_one(&states);
    for threads in [1, 2, 3, COUNT + 5] {
        let mut parts: Vec<Collected> = (0..threads).map(|_| Collected::default()).collect();
        base_regressors_on_threads::<Rps3, _, N, DOF, P>(&samples(&states), &mut parts);
        let all: Vec<_> = parts.into_iter().flat_map(|part| part.0).collect();
        assert_close(&all, &expected);
    }
}

#[test]
fn normal_equations_are_the_sums_of_products_of_columns() {
    let states = states();
    let mut random = Random::new(6);
    let tau: [Vec<f64>; DOF] =
        [0; DOF].map(|_| (0..COUNT).map(|_| random.uniform(-9.0, 9.0)).collect());
    let weights = [1.0, 0.25, 4.0];
    let mut found = Normal::new(tau.each_ref().map(Vec::as_slice), weights);
    base_regressors::<Rps3, _, N, DOF, P>(&samples(&states), &mut found);
    let all = one_by_one(&states);
    // entries that nearly vanish are accurate to the rounding of the largest ones
    let entries = all.iter().flat_map(|(w, _)| w.iter().flatten());
    let largest = entries.fold(1.0_f64, |m, x| m.max(x.abs()));
    for a in 0..P {
        let mut right = (0.0, largest);
        for b in 0..=a {
            let (mut sum, mut size) = (0.0, largest * largest);
            for (w, _) in &all {
                for r in 0..DOF {
                    let product = weights[r] * w[a][r] * w[b][r];
                    sum += product;
                    size += product.abs();
                }
            }
            assert!((found.gram[a][b] - sum).abs() <= 1e-11 * size);
        }
        for (s, (w, _)) in all.iter().enumerate() {
            for r in 0..DOF {
                let product = weights[r] * w[a][r] * tau[r][s];
                right = (right.0 + product, right.1 + product.abs());
            }
        }
        assert!((found.right[a] - right.0).abs() <= 1e-11 * right.1);
    }
}

#[test]
fn series_of_different_lengths_are_refused() {
    let states = states();
    let [q, qd, mut qdd] = states;
    qdd[4].pop();
    let refused = Samples::new(borrowed(&q), borrowed(&qd), borrowed(&qdd)).unwrap_err();
    let expected = SizeError {
        argument: "qdd",
        expected: COUNT,
        got: COUNT - 1,
    };
    assert_eq!(refused, expected);
}
