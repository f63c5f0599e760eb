//! The matrix products of BLAS.

use core::ffi::{c_char, c_int};
use core::slice::{from_raw_parts, from_raw_parts_mut};

use super::{extent, leading, read, size};
use crate::multiply::{self, Triangle, load_symmetric, operand, transposed};

/// The storage length of a vector of n entries with an increment.
fn vector_length(n: usize, increment: isize) -> usize {
    if n == 0 {
        0
    } else {
        (n - 1) * increment.unsigned_abs() + 1
    }
}

/// Converts an increment; `None` if it is zero.
fn increment(value: c_int) -> Option<isize> {
    isize::try_from(value).ok().filter(|&i| i != 0)
}

/// Unwraps the value of an argument; an argument that is not allowed stops the program, as in the
/// reference implementation, since products have no `info`.
macro_rules! product_argument {
    ($value:expr, $routine:literal, $place:literal) => {
        match $value {
            Some(value) => value,
            None => panic!("argument {} of {} is not allowed", $place, $routine),
        }
    };
}

macro_rules! products {
    ($T:ty: $gemm:ident $gemv:ident $symv:ident $syrk:ident $syr2k:ident) => {
        /// `C := alpha op(A) op(B) + beta C`.
        ///
        /// # Safety
        /// As BLAS's `gemm`: pointers to storage of the sizes that the other arguments state.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $gemm(
            transa: *const c_char,
            transb: *const c_char,
            m: *const c_int,
            n: *const c_int,
            k: *const c_int,
            alpha: *const $T,
            a: *const $T,
            lda: *const c_int,
            b: *const $T,
            ldb: *const c_int,
            beta: *const $T,
            c: *mut $T,
            ldc: *const c_int,
        ) {
            read!(transa, transb, m, n, k, alpha, lda, ldb, beta, ldc);
            let ta = product_argument!(transposed(transa.to_ne_bytes()[0]), "gemm", 1);
            let tb = product_argument!(transposed(transb.to_ne_bytes()[0]), "gemm", 2);
            let m = product_argument!(size(m), "gemm", 3);
            let n = product_argument!(size(n), "gemm", 4);
            let k = product_argument!(size(k), "gemm", 5);
            let lda = product_argument!(leading(lda, if ta { k } else { m }), "gemm", 8);
            let ldb = product_argument!(leading(ldb, if tb { n } else { k }), "gemm", 10);
            let ldc = product_argument!(leading(ldc, m), "gemm", 13);
            if m == 0 || n == 0 {
                return;
            }
            // SAFETY: the matrices have their columns the leading dimensions apart; `c` overlaps
            // neither factor. An empty factor gets an empty slice that needs no storage.
            let (a, b, c) = unsafe {
                let (ra, ca) = if ta { (k, m) } else { (m, k) };
                let (rb, cb) = if tb { (n, k) } else { (k, n) };
                (
                    if k == 0 {
                        &[][..]
                    } else {
                        from_raw_parts(a, extent(ra, ca, lda))
                    },
                    if k == 0 {
                        &[][..]
                    } else {
                        from_raw_parts(b, extent(rb, cb, ldb))
                    },
                    from_raw_parts_mut(c, extent(m, n, ldc)),
                )
            };
            let (a, b) = (operand(a, ta, m, k, lda), operand(b, tb, k, n, ldb));
            multiply::gemm(alpha, &a, &b, beta, c, ldc);
        }

        /// `y := alpha op(A) x + beta y`.
        ///
        /// # Safety
        /// As BLAS's `gemv`: pointers to storage of the sizes that the other arguments state.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $gemv(
            trans: *const c_char,
            m: *const c_int,
            n: *const c_int,
            alpha: *const $T,
            a: *const $T,
            lda: *const c_int,
            x: *const $T,
            incx: *const c_int,
            beta: *const $T,
            y: *mut $T,
            incy: *const c_int,
        ) {
            read!(trans, m, n, alpha, lda, incx, beta, incy);
            let t = product_argument!(transposed(trans.to_ne_bytes()[0]), "gemv", 1);
            let m = product_argument!(size(m), "gemv", 2);
            let n = product_argument!(size(n), "gemv", 3);
            let lda = product_argument!(leading(lda, m), "gemv", 6);
            let incx = product_argument!(increment(incx), "gemv", 8);
            let incy = product_argument!(increment(incy), "gemv", 11);
            if m == 0 || n == 0 {
                return;
            }
            let (rows, columns) = if t { (n, m) } else { (m, n) };
            // SAFETY: the matrix has n columns lda apart; the vectors have as many stored entries
            // as their lengths and increments need; `y` overlaps neither `a` nor `x`.
            let (a, x, y) = unsafe {
                (
                    from_raw_parts(a, extent(m, n, lda)),
                    from_raw_parts(x, vector_length(columns, incx)),
                    from_raw_parts_mut(y, vector_length(rows, incy)),
                )
            };
            let a = operand(a, t, rows, columns, lda);
            multiply::gemv(alpha, &a, (x, incx), beta, (y, incy));
        }

        /// `y := alpha A x + beta y` for a symmetric matrix, of which one triangle is read.
        ///
        /// # Safety
        /// As BLAS's `symv`: pointers to storage of the sizes that the other arguments state.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $symv(
            uplo: *const c_char,
            n: *const c_int,
            alpha: *const $T,
            a: *const $T,
            lda: *const c_int,
            x: *const $T,
            incx: *const c_int,
            beta: *const $T,
            y: *mut $T,
            incy: *const c_int,
        ) {
            read!(uplo, n, alpha, lda, incx, beta, incy);
            let triangle = product_argument!(Triangle::of(uplo.to_ne_bytes()[0]), "symv", 1);
            let n = product_argument!(size(n), "symv", 2);
            let lda = product_argument!(leading(lda, n), "symv", 5);
            let incx = product_argument!(increment(incx), "symv", 7);
            let incy = product_argument!(increment(incy), "symv", 10);
            if n == 0 {
                return;
            }
            // SAFETY: as for `gemv`.
            let (a, x, y) = unsafe {
                (
                    from_raw_parts(a, extent(n, n, lda)),
                    from_raw_parts(x, vector_length(n, incx)),
                    from_raw_parts_mut(y, vector_length(n, incy)),
                )
            };
            let a = load_symmetric(a, triangle, n, lda);
            multiply::gemv(alpha, &a, (x, incx), beta, (y, incy));
        }

        /// `C := alpha A A^T + beta C`, or with A^T A if `trans` is `T`; for one triangle of C.
        ///
        /// # Safety
        /// As BLAS's `syrk`: pointers to storage of the sizes that the other arguments state.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $syrk(
            uplo: *const c_char,
            trans: *const c_char,
            n: *const c_int,
            k: *const c_int,
            alpha: *const $T,
            a: *const $T,
            lda: *const c_int,
            beta: *const $T,
            c: *mut $T,
            ldc: *const c_int,
        ) {
            read!(uplo, trans, n, k, alpha, lda, beta, ldc);
            let triangle = product_argument!(Triangle::of(uplo.to_ne_bytes()[0]), "syrk", 1);
            let t = product_argument!(transposed(trans.to_ne_bytes()[0]), "syrk", 2);
            let n = product_argument!(size(n), "syrk", 3);
            let k = product_argument!(size(k), "syrk", 4);
            let (rows, columns) = if t { (k, n) } else { (n, k) };
            let lda = product_argument!(leading(lda, rows), "syrk", 7);
            let ldc = product_argument!(leading(ldc, n), "syrk", 10);
            if n == 0 {
                return;
            }
            // SAFETY: as for `gemm`.
            let (a, c) = unsafe {
                (
                    if k == 0 {
                        &[][..]
                    } else {
                        from_raw_parts(a, extent(rows, columns, lda))
                    },
                    from_raw_parts_mut(c, extent(n, n, ldc)),
                )
            };
            let a = operand(a, t, n, k, lda);
            multiply::update_triangle(alpha, &(&a * a.transpose()), beta, triangle, c, ldc);
        }

        /// `C := alpha (A B^T + B A^T) + beta C`, or with A^T B + B^T A if `trans` is `T`; for one
        /// triangle of C.
        ///
        /// # Safety
        /// As BLAS's `syr2k`: pointers to storage of the sizes that the other arguments state.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $syr2k(
            uplo: *const c_char,
            trans: *const c_char,
            n: *const c_int,
            k: *const c_int,
            alpha: *const $T,
            a: *const $T,
            lda: *const c_int,
            b: *const $T,
            ldb: *const c_int,
            beta: *const $T,
            c: *mut $T,
            ldc: *const c_int,
        ) {
            read!(uplo, trans, n, k, alpha, lda, ldb, beta, ldc);
            let triangle = product_argument!(Triangle::of(uplo.to_ne_bytes()[0]), "syr2k", 1);
            let t = product_argument!(transposed(trans.to_ne_bytes()[0]), "syr2k", 2);
            let n = product_argument!(size(n), "syr2k", 3);
            let k = product_argument!(size(k), "syr2k", 4);
            let (rows, columns) = if t { (k, n) } else { (n, k) };
            let lda = product_argument!(leading(lda, rows), "syr2k", 7);
            let ldb = product_argument!(leading(ldb, rows), "syr2k", 9);
            let ldc = product_argument!(leading(ldc, n), "syr2k", 12);
            if n == 0 {
                return;
            }
            // SAFETY: as for `gemm`.
            let (a, b, c) = unsafe {
                (
                    if k == 0 {
                        &[][..]
                    } else {
                        from_raw_parts(a, extent(rows, columns, lda))
                    },
                    if k == 0 {
                        &[][..]
                    } else {
                        from_raw_parts(b, extent(rows, columns, ldb))
                    },
                    from_raw_parts_mut(c, extent(n, n, ldc)),
                )
            };
            let (a, b) = (operand(a, t, n, k, lda), operand(b, t, n, k, ldb));
            let half = &a * b.transpose();
            multiply::update_triangle(alpha, &(&half + half.transpose()), beta, triangle, c, ldc);
        }
    };
}

products!(f64: dgemm_ dgemv_ dsymv_ dsyrk_ dsyr2k_);
products!(f32: sgemm_ sgemv_ ssymv_ ssyrk_ ssyr2k_);
