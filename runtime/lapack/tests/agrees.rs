//! Compares the exported symbols with nalgebra and with the equations that define each result, over
//! random sizes.
#![allow(clippy::unwrap_used, clippy::expect_used)]
#![allow(
    clippy::undocumented_unsafe_blocks,
    reason = "each calls a routine with vectors of the sizes that the call states"
)]
#![allow(
    clippy::borrow_as_ptr,
    reason = "the interface takes every scalar by reference"
)]
#![allow(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small sizes; whole numbers are exact"
)]

use std::ffi::c_char;

use nalgebra::DMatrix;
use proptest::prelude::*;
use regen_lapack::{
    dgemm_, dgemv_, dgesdd_, dgesv_, dgesvd_, dpotrf_, dpotrs_, dsyevr_, dsymv_, dsyr2k_, dsyrk_,
    sgemm_, spotrf_, ssyevr_,
};

/// Bound of the rounding errors of sums over a dozen numbers of size 1.
const CLOSE: f64 = 1e-12;

fn ch(c: char) -> c_char {
    c_char::try_from(u32::from(c)).unwrap()
}

fn int(n: usize) -> i32 {
    i32::try_from(n).unwrap()
}

prop_compose! {
    fn matrix(most: usize)(m in 1..=most, n in 1..=most)
        (entries in prop::collection::vec(-1.0..1.0_f64, m * n), m in Just(m), n in Just(n))
        -> DMatrix<f64> { DMatrix::from_vec(m, n, entries) }
}

prop_compose! {
    fn symmetric(most: usize)(n in 1..=most)
        (entries in prop::collection::vec(-1.0..1.0_f64, n * n), n in Just(n))
        -> DMatrix<f64> { let a = DMatrix::from_vec(n, n, entries); &a + a.transpose() }
}

/// Stores a matrix with the leading dimension `ld`, NaN where the routine must not read.
fn stored(a: &DMatrix<f64>, ld: usize, used: impl Fn(usize, usize) -> bool) -> Vec<f64> {
    let mut out = vec![f64::NAN; ld * a.ncols()];
    for j in 0..a.ncols() {
        for i in 0..a.nrows() {
            if used(i, j) {
                out[j * ld + i] = a[(i, j)];
            }
        }
    }
    out
}

fn from_stored(a: &[f64], rows: usize, columns: usize, ld: usize) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |i, j| a[j * ld + i])
}

fn in_triangle(uplo: char) -> impl Fn(usize, usize) -> bool {
    move |i, j| if uplo == 'U' { i <= j } else { i >= j }
}

struct Eigen {
    found: usize,
    values: Vec<f64>,
    vectors: DMatrix<f64>,
    info: i32,
}

fn syevr(
    a: &DMatrix<f64>,
    jobz: char,
    range: char,
    uplo: char,
    v: (f64, f64),
    i: (i32, i32),
) -> Eigen {
    let n = a.nrows();
    let lda = n + 2;
    let mut a = stored(a, lda, in_triangle(uplo));
    let (mut m, mut info) = (0, 0);
    let (mut w, mut z) = (vec![f64::NAN; n], vec![f64::NAN; n * n]);
    let mut support = vec![0; 2 * n];
    let (mut work, mut iwork, mut lwork) = (vec![0.0], vec![0], -1);
    for _ in 0..2 {
        unsafe {
            dsyevr_(
                &ch(jobz),
                &ch(range),
                &ch(uplo),
                &int(n),
                a.as_mut_ptr(),
                &int(lda),
                &v.0,
                &v.1,
                &i.0,
                &i.1,
                &-1.0,
                &mut m,
                w.as_mut_ptr(),
                z.as_mut_ptr(),
                &int(n),
                support.as_mut_ptr(),
                work.as_mut_ptr(),
                &lwork,
                iwork.as_mut_ptr(),
                &lwork,
                &mut info,
            );
        }
        lwork = work[0] as i32;
        assert!(lwork >= 1 && iwork[0] >= 1, "a query states sizes");
        work.resize(lwork as usize, 0.0);
        iwork.resize(lwork as usize, 0);
    }
    Eigen {
        found: usize::try_from(m).unwrap(),
        values: w,
        vectors: DMatrix::from_vec(n, n, z),
        info,
    }
}

proptest! {
    #[test]
    fn eigenvectors_rebuild_the_matrix_from_either_triangle(a in symmetric(9), upper: bool) {
        let n = a.nrows();
        let e = syevr(&a, 'V', 'A', if upper { 'U' } else { 'L' }, (0.0, 0.0), (0, 0));
        prop_assert_eq!((e.info, e.found), (0, n));
        prop_assert!(e.values.windows(2).all(|p| p[0] <= p[1]), "ascending: {:?}", e.values);
        let v = &e.vectors;
        let diagonal = DMatrix::from_fn(n, n, |i, j| if i == j { e.values[i] } else { 0.0 });
        prop_assert!((v * diagonal * v.transpose() - &a).amax() < CLOSE);
        prop_assert!((v.transpose() * v - DMatrix::identity(n, n)).amax() < CLOSE);
    }

    #[test]
    fn parts_of_the_eigenvalues_are_those_of_the_whole(a in symmetric(7), first in 0..7_usize, more in 0..7_usize) {
        let n = a.nrows();
        let all = syevr(&a, 'N', 'A', 'U', (0.0, 0.0), (0, 0));
        prop_assert_eq!(all.info, 0);
        let (first, last) = (first % n, (first % n + more).min(n - 1));
        let some = syevr(&a, 'V', 'I', 'L', (0.0, 0.0), (int(first + 1), int(last + 1)));
        prop_assert_eq!((some.info, some.found), (0, last - first + 1));
        for (k, value) in some.values[..some.found].iter().enumerate() {
            prop_assert!((value - all.values[first + k]).abs() < CLOSE);
            let v = some.vectors.column(k);
            prop_assert!((&a * v - v * *value).amax() < CLOSE);
        }
        let between = syevr(&a, 'N', 'V', 'U', (-0.5, 0.5), (0, 0));
        let expected = all.values.iter().filter(|v| **v > -0.5 && **v <= 0.5).count();
        prop_assert_eq!(between.found, expected);
    }

    #[test]
    fn cholesky_factors_rebuild_and_solve(a in matrix(8), right in 1..4_usize, upper: bool) {
        let n = a.nrows();
        let uplo = if upper { 'U' } else { 'L' };
        let spd = &a * a.transpose() + DMatrix::identity(n, n);
        let lda = n + 1;
        let mut factor = stored(&spd, lda, in_triangle(uplo));
        let mut info = -9;
        unsafe { dpotrf_(&ch(uplo), &int(n), factor.as_mut_ptr(), &int(lda), &mut info) };
        prop_assert_eq!(info, 0);
        let f = from_stored(&factor, n, n, lda);
        let f = DMatrix::from_fn(n, n, |i, j| if in_triangle(uplo)(i, j) { f[(i, j)] } else { 0.0 });
        let rebuilt = if upper { f.transpose() * &f } else { &f * f.transpose() };
        prop_assert!((rebuilt - &spd).amax() < CLOSE);
        let b = DMatrix::from_fn(n, right, |i, j| (i + 2 * j) as f64);
        let ldb = n + 3;
        let mut x = stored(&b, ldb, |_, _| true);
        unsafe {
            dpotrs_(&ch(uplo), &int(n), &int(right), factor.as_ptr(), &int(lda), x.as_mut_ptr(), &int(ldb), &mut info);
        }
        prop_assert_eq!(info, 0);
        prop_assert!((&spd * from_stored(&x, n, right, ldb) - b).amax() < 1e-10);
    }

    #[test]
    fn cholesky_reports_the_first_leading_minor_that_is_not_positive(n in 1..8_usize, negative in 0..8_usize, upper: bool) {
        let negative = negative % n;
        let a = DMatrix::from_fn(n, n, |i, j| match (i == j, i == negative) {
            (true, true) => -1.0,
            (true, false) => 4.0,
            _ => 0.1,
        });
        let uplo = if upper { 'U' } else { 'L' };
        let mut stored = stored(&a, n, in_triangle(uplo));
        let mut info = 0;
        unsafe { dpotrf_(&ch(uplo), &int(n), stored.as_mut_ptr(), &int(n), &mut info) };
        prop_assert_eq!(info, int(negative + 1));
    }

    #[test]
    fn singular_vectors_rebuild_the_matrix(a in matrix(8), divide: bool, double: bool) {
        // a repeated column makes a singular value zero
        let a = if double { let mut b = a.clone(); b.set_column(0, &a.column(a.ncols() - 1)); b } else { a };
        let (m, n) = a.shape();
        let k = m.min(n);
        let (lda, ldu, ldvt) = (m + 1, m + 2, k + 3);
        let mut work_a = stored(&a, lda, |_, _| true);
        let (mut s, mut u, mut vt) = (vec![0.0; k], vec![0.0; ldu * k], vec![0.0; ldvt * n]);
        let (mut work, mut iwork, mut info, mut lwork) = (vec![0.0], vec![0; 8 * k], -9, -1);
        for _ in 0..2 {
            unsafe {
                if divide {
                    dgesdd_(
                        &ch('S'), &int(m), &int(n), work_a.as_mut_ptr(), &int(lda), s.as_mut_ptr(),
                        u.as_mut_ptr(), &int(ldu), vt.as_mut_ptr(), &int(ldvt), work.as_mut_ptr(),
                        &lwork, iwork.as_mut_ptr(), &mut info,
                    );
                } else {
                    dgesvd_(
                        &ch('S'), &ch('S'), &int(m), &int(n), work_a.as_mut_ptr(), &int(lda),
                        s.as_mut_ptr(), u.as_mut_ptr(), &int(ldu), vt.as_mut_ptr(), &int(ldvt),
                        work.as_mut_ptr(), &lwork, &mut info,
                    );
                }
            }
            prop_assert_eq!(info, 0);
            lwork = work[0] as i32;
        }
        prop_assert!(s.windows(2).all(|p| p[0] >= p[1]), "descending: {:?}", s);
        let u = from_stored(&u, m, k, ldu);
        let vt = from_stored(&vt, k, n, ldvt);
        let middle = DMatrix::from_fn(k, k, |i, j| if i == j { s[i] } else { 0.0 });
        prop_assert!((&u * middle * &vt - &a).amax() < CLOSE);
        prop_assert!((u.transpose() * &u - DMatrix::identity(k, k)).amax() < CLOSE);
        prop_assert!((&vt * vt.transpose() - DMatrix::identity(k, k)).amax() < CLOSE);
    }

    #[test]
    fn elimination_solves_and_its_factors_rebuild(a in matrix(8), right in 0..4_usize) {
        let n = a.nrows();
        let a = DMatrix::from_fn(n, n, |i, j| a[(i, j % a.ncols())] + if (i + 1) % n == j { 3.0 } else { 0.0 });
        prop_assume!(a.clone().lu().determinant().abs() > 1e-3);
        let lda = n + 1;
        let mut factors = stored(&a, lda, |_, _| true);
        let b = DMatrix::from_fn(n, right, |i, j| 1.0 + (i * (j + 1)) as f64);
        let mut x = stored(&b, n, |_, _| true);
        let (mut pivots, mut info) = (vec![0; n], -9);
        unsafe {
            dgesv_(&int(n), &int(right), factors.as_mut_ptr(), &int(lda), pivots.as_mut_ptr(), x.as_mut_ptr(), &int(n), &mut info);
        }
        prop_assert_eq!(info, 0);
        prop_assert!((&a * from_stored(&x, n, right, n) - &b).iter().all(|e| e.abs() < 1e-9));
        let f = from_stored(&factors, n, n, lda);
        let l = DMatrix::from_fn(n, n, |i, j| match i.cmp(&j) {
            std::cmp::Ordering::Less => 0.0,
            std::cmp::Ordering::Equal => 1.0,
            std::cmp::Ordering::Greater => f[(i, j)],
        });
        let mut exchanged = a.clone();
        for (i, pivot) in pivots.iter().enumerate() {
            exchanged.swap_rows(i, usize::try_from(*pivot).unwrap() - 1);
        }
        prop_assert!((l * f.upper_triangle() - exchanged).amax() < CLOSE);
    }

    #[test]
    fn products_agree_with_nalgebra(
        (m, n, k) in (1..7_usize, 1..7_usize, 0..7_usize), ta: bool, tb: bool,
        alpha in -2.0..2.0_f64, beta in prop_oneof![Just(0.0), -2.0..2.0_f64],
        seed in prop::collection::vec(-1.0..1.0_f64, 49 * 3),
    ) {
        let take = |start: usize, rows, columns| DMatrix::from_fn(rows, columns, |i, j| seed[start + 7 * j + i]);
        let (a, b, c) = (take(0, m, k), take(49, k, n), take(98, m, n));
        let t = |flag: bool, x: &DMatrix<f64>| if flag { x.transpose() } else { x.clone() };
        let letter = |flag: bool| ch(if flag { 'T' } else { 'N' });
        let (sa, sb) = (t(ta, &a), t(tb, &b));
        let (lda, ldb, ldc) = (sa.nrows() + 1, sb.nrows() + 2, m + 3);
        let (fa, fb) = (stored(&sa, lda, |_, _| true), stored(&sb, ldb, |_, _| true));
        // entries that are multiplied by zero may be NaN
        let mut out = stored(&c, ldc, |_, _| beta != 0.0);
        unsafe {
            dgemm_(
                &letter(ta), &letter(tb), &int(m), &int(n), &int(k), &alpha, fa.as_ptr(), &int(lda),
                fb.as_ptr(), &int(ldb), &beta, out.as_mut_ptr(), &int(ldc),
            );
        }
        let expected = &a * &b * alpha + &c * beta;
        prop_assert!((from_stored(&out, m, n, ldc) - expected).amax() < CLOSE);
    }

    #[test]
    fn products_with_vectors_agree_with_nalgebra(
        a in matrix(7), t: bool, upper: bool, (incx, incy) in (prop_oneof![-3..0, 1..4], prop_oneof![-3..0, 1..4]),
        alpha in -2.0..2.0_f64, beta in prop_oneof![Just(0.0), -2.0..2.0_f64],
    ) {
        let spread = |v: &[f64], inc: i32| {
            let step = inc.unsigned_abs() as usize;
            let mut out = vec![f64::NAN; (v.len() - 1) * step + 1];
            for (k, x) in v.iter().enumerate() {
                out[if inc < 0 { (v.len() - 1 - k) * step } else { k * step }] = *x;
            }
            out
        };
        let (m, n) = a.shape();
        let (rows, columns) = if t { (n, m) } else { (m, n) };
        let x: Vec<f64> = (0..columns).map(|k| 1.0 - k as f64).collect();
        let y: Vec<f64> = (0..rows).map(|k| 0.5 + k as f64).collect();
        let (fx, mut fy) = (spread(&x, incx), spread(&y, incy));
        let fa = stored(&a, m + 1, |_, _| true);
        unsafe {
            dgemv_(&ch(if t { 'T' } else { 'N' }), &int(m), &int(n), &alpha, fa.as_ptr(), &int(m + 1), fx.as_ptr(), &incx, &beta, fy.as_mut_ptr(), &incy);
        }
        let op = if t { a.transpose() } else { a.clone() };
        let expected = op * DMatrix::from_vec(columns, 1, x) * alpha + DMatrix::from_vec(rows, 1, y) * beta;
        for (a, b) in fy.iter().zip(spread(expected.as_slice(), incy)) {
            prop_assert!((a - b).abs() < CLOSE || a.is_nan() && b.is_nan());
        }

        let s = DMatrix::from_fn(m, m, |i, j| a[(i, j % n)] + a[(j, i % n)]);
        let uplo = if upper { 'U' } else { 'L' };
        let fs = stored(&s, m + 2, in_triangle(uplo));
        let x: Vec<f64> = (0..m).map(|k| 2.0 - k as f64).collect();
        let y: Vec<f64> = (0..m).map(|k| 0.25 * k as f64).collect();
        let (fx, mut fy) = (spread(&x, incx), spread(&y, incy));
        unsafe {
            dsymv_(&ch(uplo), &int(m), &alpha, fs.as_ptr(), &int(m + 2), fx.as_ptr(), &incx, &beta, fy.as_mut_ptr(), &incy);
        }
        let expected = s * DMatrix::from_vec(m, 1, x) * alpha + DMatrix::from_vec(m, 1, y) * beta;
        for (a, b) in fy.iter().zip(spread(expected.as_slice(), incy)) {
            prop_assert!((a - b).abs() < CLOSE || a.is_nan() && b.is_nan());
        }
    }

    #[test]
    fn rank_updates_touch_one_triangle(
        a in matrix(6), t: bool, upper: bool, alpha in -2.0..2.0_f64, beta in prop_oneof![Just(0.0), -2.0..2.0_f64],
    ) {
        let op = if t { a.transpose() } else { a.clone() };
        let (n, k) = op.shape();
        let b = op.map(|x| 1.0 - x * x);
        let fb = if t { b.transpose() } else { b.clone() };
        let ld = a.nrows();
        let uplo = if upper { 'U' } else { 'L' };
        let c = DMatrix::from_fn(n, n, |i, j| (1 + i + j) as f64);
        let mut one = stored(&c, n, in_triangle(uplo));
        let mut two = one.clone();
        let letter = ch(if t { 'T' } else { 'N' });
        unsafe {
            dsyrk_(&ch(uplo), &letter, &int(n), &int(k), &alpha, a.as_ptr(), &int(ld), &beta, one.as_mut_ptr(), &int(n));
            dsyr2k_(&ch(uplo), &letter, &int(n), &int(k), &alpha, a.as_ptr(), &int(ld), fb.as_ptr(), &int(ld), &beta, two.as_mut_ptr(), &int(n));
        }
        let expected_one = &op * op.transpose() * alpha + &c * beta;
        let expected_two = (&op * b.transpose() + &b * op.transpose()) * alpha + &c * beta;
        for j in 0..n {
            for i in 0..n {
                let (x, y) = (one[j * n + i], two[j * n + i]);
                if in_triangle(uplo)(i, j) {
                    prop_assert!((x - expected_one[(i, j)]).abs() < CLOSE);
                    prop_assert!((y - expected_two[(i, j)]).abs() < CLOSE);
                } else {
                    prop_assert!(x.is_nan() && y.is_nan(), "the other triangle is not touched");
                }
            }
        }
    }
}

#[test]
fn a_singular_matrix_is_reported_with_its_pivot_and_the_right_side_is_unchanged() {
    let mut a = [1.0, 2.0, 2.0, 4.0];
    let mut b = [3.0, 5.0];
    let (mut pivots, mut info) = ([0; 2], 0);
    unsafe {
        dgesv_(
            &2,
            &1,
            a.as_mut_ptr(),
            &2,
            pivots.as_mut_ptr(),
            b.as_mut_ptr(),
            &2,
            &mut info,
        );
    };
    assert_eq!((info, b), (2, [3.0, 5.0]));
}

#[test]
fn numbers_that_are_not_finite_end_in_a_code_and_not_in_a_loop() {
    let a = DMatrix::from_element(4, 4, f64::NAN);
    assert!(syevr(&a, 'V', 'A', 'U', (0.0, 0.0), (0, 0)).info > 0);
    let mut m = [f64::INFINITY; 4];
    let (mut s, mut info) = ([0.0; 2], 0);
    let (mut u, mut vt, mut work, mut iwork) = ([0.0; 4], [0.0; 4], [0.0], [0; 16]);
    unsafe {
        dgesdd_(
            &ch('S'),
            &2,
            &2,
            m.as_mut_ptr(),
            &2,
            s.as_mut_ptr(),
            u.as_mut_ptr(),
            &2,
            vt.as_mut_ptr(),
            &2,
            work.as_mut_ptr(),
            &1,
            iwork.as_mut_ptr(),
            &mut info,
        );
    }
    assert!(info > 0);
}

#[test]
fn arguments_that_are_not_allowed_are_named_by_place() {
    let mut a = [1.0];
    let mut info = 0;
    for (uplo, n, lda, place) in [('X', 1, 1, -1), ('U', -1, 1, -2), ('U', 1, 0, -4)] {
        unsafe { dpotrf_(&ch(uplo), &n, a.as_mut_ptr(), &lda, &mut info) };
        assert_eq!(info, place);
    }
    let (mut s, mut u, mut vt, mut work, mut iwork) = ([0.0], [0.0], [0.0], [0.0], [0; 8]);
    for (job, m, lda, ldu, ldvt, place) in [
        ('Q', 1, 1, 1, 1, -1),
        ('S', -1, 1, 1, 1, -2),
        ('S', 1, 0, 1, 1, -5),
        ('S', 1, 1, 0, 1, -8),
        ('S', 1, 1, 1, 0, -10),
    ] {
        unsafe {
            dgesdd_(
                &ch(job),
                &m,
                &1,
                a.as_mut_ptr(),
                &lda,
                s.as_mut_ptr(),
                u.as_mut_ptr(),
                &ldu,
                vt.as_mut_ptr(),
                &ldvt,
                work.as_mut_ptr(),
                &1,
                iwork.as_mut_ptr(),
                &mut info,
            );
        }
        assert_eq!(info, place);
    }
}

/// Both precisions have the same code; this checks the types of the single-precision symbols.
#[test]
fn single_precision_does_the_same() {
    let mut c = [f32::NAN; 4];
    let (a, b) = ([1.0_f32, 2.0, 3.0, 4.0], [0.0_f32, 1.0, 1.0, 0.0]);
    unsafe {
        sgemm_(
            &ch('N'),
            &ch('N'),
            &2,
            &2,
            &2,
            &1.0,
            a.as_ptr(),
            &2,
            b.as_ptr(),
            &2,
            &0.0,
            c.as_mut_ptr(),
            &2,
        );
    };
    assert_eq!(c, [3.0, 4.0, 1.0, 2.0]);
    let mut spd = [4.0_f32, 2.0, 2.0, 5.0];
    let mut info = -9;
    unsafe { spotrf_(&ch('L'), &2, spd.as_mut_ptr(), &2, &mut info) };
    assert_eq!((info, spd[0], spd[1], spd[3]), (0, 2.0, 1.0, 2.0));
    let mut s = [2.0_f32, 1.0, 1.0, 2.0];
    let (mut m, mut w, mut z, mut support) = (0, [0.0_f32; 2], [0.0_f32; 4], [0; 4]);
    let (mut work, mut iwork) = ([0.0_f32], [0]);
    unsafe {
        ssyevr_(
            &ch('N'),
            &ch('A'),
            &ch('U'),
            &2,
            s.as_mut_ptr(),
            &2,
            &0.0,
            &0.0,
            &0,
            &0,
            &-1.0,
            &mut m,
            w.as_mut_ptr(),
            z.as_mut_ptr(),
            &2,
            support.as_mut_ptr(),
            work.as_mut_ptr(),
            &1,
            iwork.as_mut_ptr(),
            &1,
            &mut info,
        );
    }
    assert_eq!((info, m), (0, 2));
    assert!((w[0] - 1.0).abs() < 1e-6 && (w[1] - 3.0).abs() < 1e-6);
}
