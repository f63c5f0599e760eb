//! Tests of the pivoted solve on systems with known solutions.

#![allow(clippy::unwrap_used)]

use proptest::prelude::*;
use regen_runtime::solve_pivoted;

const EPS: f64 = f64::EPSILON;

/// The right-hand side A X for a known X.
fn times<const R: usize, const N: usize, const K: usize>(
    a: &[[f64; N]; R],
    x: &[[f64; K]; N],
) -> [[f64; K]; R] {
    core::array::from_fn(|i| core::array::from_fn(|k| (0..N).map(|j| a[i][j] * x[j][k]).sum()))
}

fn assert_close<const N: usize, const K: usize>(x: &[[f64; K]; N], y: &[[f64; K]; N], bound: f64) {
    for (x, y) in x.iter().flatten().zip(y.iter().flatten()) {
        assert!((x - y).abs() <= bound, "{x} is not {y} within {bound:e}");
    }
}

fn matrix<const R: usize, const N: usize>() -> impl Strategy<Value = [[f64; N]; R]> {
    prop::collection::vec(-1.0..1.0_f64, R * N)
        .prop_map(|v| core::array::from_fn(|i| core::array::from_fn(|j| v[i * N + j])))
}

proptest! {
    #[test]
    fn a_random_system_gives_its_solution(a in matrix::<5, 5>(), x in matrix::<5, 2>()) {
        let (found, ratio) = solve_pivoted(&a, &times(&a, &x));
        prop_assert!((0.0..=1.0).contains(&ratio));
        // the pivot ratio overestimates the condition by a modest factor, and so does the growth of
        // complete pivoting
        assert_close(&found, &x, 1000.0 * EPS / ratio);
    }

    #[test]
    fn redundant_rows_in_any_order_change_nothing(
        a in matrix::<3, 3>(),
        mix in matrix::<3, 3>(),
        x in matrix::<3, 2>(),
        order in Just([0_usize, 1, 2, 3, 4, 5]).prop_shuffle(),
    ) {
        let dependent = times(&mix, &a);
        let tall: [[f64; 3]; 6] = core::array::from_fn(|i| {
            if order[i] < 3 { a[order[i]] } else { dependent[order[i] - 3] }
        });
        let (found, ratio) = solve_pivoted(&tall, &times(&tall, &x));
        assert_close(&found, &x, 1000.0 * EPS / ratio);
    }

    #[test]
    fn rows_of_rounding_errors_do_not_change_the_solution(
        a in matrix::<3, 3>(),
        noise in matrix::<2, 3>(),
        sides in matrix::<2, 1>(),
        x in matrix::<3, 1>(),
    ) {
        let small = noise.map(|row| row.map(|v| 1e-17 * v));
        let tall = [small[0], a[0], a[1], small[1], a[2]];
        let b = times(&a, &x);
        let (found, ratio) = solve_pivoted(&tall, &[[1e-17 * sides[0][0]], b[0], b[1], [1e-17 * sides[1][0]], b[2]]);
        assert_close(&found, &x, 1000.0 * EPS / ratio);
        let (_, alone) = solve_pivoted(&a, &b);
        prop_assert!((ratio - alone).abs() < 1e-10, "{ratio:e} {alone:e}");
    }

    #[test]
    fn a_vanishing_row_or_column_is_singular(a in matrix::<4, 4>(), row: bool, at in 0..4_usize) {
        let mut a = a;
        for k in 0..4 {
            let (i, j) = if row { (at, k) } else { (k, at) };
            a[i][j] *= 1e-12;
        }
        let (_, ratio) = solve_pivoted(&a, &[[1.0]; 4]);
        prop_assert!(ratio < 1e-10, "{ratio:e}");
    }

    #[test]
    fn permutations_of_rows_and_columns_are_solved_exactly(
        rows in Just([0_usize, 1, 2, 3, 4, 5]).prop_shuffle(),
        sizes in prop::collection::vec(-6..6_i32, 6),
    ) {
        let mut a = [[0.0; 6]; 6];
        for (i, j) in rows.iter().enumerate() {
            a[i][*j] = 2.0_f64.powi(sizes[i]);
        }
        let x = [[1.0], [2.0], [3.0], [4.0], [5.0], [6.0]];
        let (found, ratio) = solve_pivoted(&a, &times(&a, &x));
        prop_assert_eq!(found, x);
        let (low, high) = (sizes.iter().min().unwrap(), sizes.iter().max().unwrap());
        prop_assert!((ratio - 2.0_f64.powi(low - high)).abs() < EPS);
    }

    #[test]
    fn scaling_rows_and_columns_does_not_change_the_solution(
        a in matrix::<4, 4>(),
        powers in prop::collection::vec(-5..5_i32, 8),
    ) {
        let b = [[1.0], [2.0], [3.0], [4.0]];
        let (x, ratio) = solve_pivoted(&a, &b);
        let scaled: [[f64; 4]; 4] = core::array::from_fn(|i| {
            core::array::from_fn(|j| a[i][j] * 2.0_f64.powi(powers[i] + powers[4 + j]))
        });
        let sides: [[f64; 1]; 4] = core::array::from_fn(|i| [b[i][0] * 2.0_f64.powi(powers[i])]);
        let (y, scaled_ratio) = solve_pivoted(&scaled, &sides);
        let size = x.iter().flatten().fold(1.0, |m: f64, x| m.max(x.abs()));
        for j in 0..4 {
            let back = y[j][0] * 2.0_f64.powi(powers[4 + j]);
            prop_assert!((back - x[j][0]).abs() <= 1000.0 * EPS * size / ratio.min(scaled_ratio));
        }
    }

    #[test]
    fn a_rank_deficient_matrix_has_a_vanishing_pivot_ratio(u in matrix::<5, 3>(), v in matrix::<3, 5>()) {
        let (_, ratio) = solve_pivoted(&times(&u, &v), &[[1.0]; 5]);
        prop_assert!(ratio < 1e-11, "{ratio:e}");
    }

    #[test]
    fn one_nan_or_infinity_makes_everything_nan(
        a in matrix::<4, 3>(),
        place in 0..16_usize,
        infinite: bool,
    ) {
        let value = if infinite { f64::INFINITY } else { f64::NAN };
        let (mut a, mut b) = (a, [[1.0]; 4]);
        if place < 12 { a[place / 3][place % 3] = value } else { b[place - 12][0] = value }
        let (x, ratio) = solve_pivoted(&a, &b);
        prop_assert!(ratio.is_nan());
        prop_assert!(x.iter().flatten().all(|x| x.is_nan()));
    }

    #[test]
    fn single_precision_solves_with_the_same_pivots(a in matrix::<4, 4>(), x in matrix::<4, 1>()) {
        let narrow = a.map(|row| row.map(|v| v as f32));
        let side = times(&a, &x).map(|row| row.map(|v| v as f32));
        let (found, ratio) = solve_pivoted(&narrow, &side);
        for (found, x) in found.iter().flatten().zip(x.iter().flatten()) {
            prop_assert!((f64::from(*found) - x).abs() <= f64::from(1000.0 * f32::EPSILON / ratio));
        }
    }
}

#[test]
fn a_zero_matrix_has_ratio_zero() {
    let (_, ratio) = solve_pivoted(&[[0.0_f64; 2]; 2], &[[0.0; 1]; 2]);
    assert_eq!(ratio.to_bits(), 0.0_f64.to_bits());
}

#[test]
fn the_smallest_and_largest_numbers_are_solved() {
    for size in [f64::MIN_POSITIVE, 1e-300, 1e300] {
        let (x, ratio) = solve_pivoted(&[[0.0, size], [size, 0.0]], &[[size], [2.0 * size]]);
        assert_eq!(x, [[2.0], [1.0]]);
        assert!((ratio - 1.0).abs() < EPS);
    }
}

#[test]
fn the_pivot_ratio_needs_no_right_hand_side() {
    let (_, ratio) = solve_pivoted(&[[1.0_f64, 0.0], [0.0, 3.0]], &[[], []]);
    assert!((ratio - 1.0 / 3.0).abs() < EPS);
}
