//! The decompositions and solves of LAPACK.

use core::ffi::{c_char, c_int};
use core::slice::{from_raw_parts, from_raw_parts_mut};

use super::{argument, extent, info_of, leading, read, size};
use crate::decompose::{self, Range};
use crate::multiply::{Triangle, load, load_symmetric, store};

macro_rules! decompositions {
    ($T:ty: $syevr:ident $potrf:ident $potrs:ident $gesdd:ident $gesvd:ident $gesv:ident) => {
        /// Eigenvalues and, for the job `V`, eigenvectors of a symmetric matrix.
        ///
        /// # Safety
        /// As LAPACK's `syevr`: pointers to storage of the sizes that the other arguments state.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $syevr(
            jobz: *const c_char,
            range: *const c_char,
            uplo: *const c_char,
            n: *const c_int,
            a: *mut $T,
            lda: *const c_int,
            vl: *const $T,
            vu: *const $T,
            il: *const c_int,
            iu: *const c_int,
            _abstol: *const $T,
            m: *mut c_int,
            w: *mut $T,
            z: *mut $T,
            ldz: *const c_int,
            isuppz: *mut c_int,
            work: *mut $T,
            lwork: *const c_int,
            iwork: *mut c_int,
            liwork: *const c_int,
            info: *mut c_int,
        ) {
            // SAFETY: `info` points to one value that may be written.
            let info = unsafe { &mut *info };
            *info = 0;
            read!(
                jobz, range, uplo, n, lda, vl, vu, il, iu, ldz, lwork, liwork
            );
            let vectors = argument!(job(jobz), 1, info);
            let kind = range.to_ne_bytes()[0].to_ascii_uppercase();
            argument!(b"AVI".contains(&kind).then_some(()), 2, info);
            let triangle = argument!(Triangle::of(uplo.to_ne_bytes()[0]), 3, info);
            let n = argument!(size(n), 4, info);
            let lda = argument!(leading(lda, n), 6, info);
            let ldz = argument!(leading(ldz, if vectors { n } else { 1 }), 15, info);
            if lwork == -1 || liwork == -1 {
                // SAFETY: in a query for workspace sizes both workspaces have at least one entry.
                unsafe {
                    *work = 1.0;
                    *iwork = 1;
                }
                return;
            }
            let wanted = match kind {
                b'V' => {
                    argument!((n == 0 || vl < vu).then_some(()), 8, info);
                    Range::Between(vl, vu)
                }
                b'I' if n > 0 => {
                    let first = argument!(size(il).filter(|&i| (1..=n).contains(&i)), 9, info);
                    let last = argument!(size(iu).filter(|&i| (first..=n).contains(&i)), 10, info);
                    Range::Places(first, last)
                }
                _ => Range::All,
            };
            // SAFETY: `m` points to one value that may be written.
            let m = unsafe { &mut *m };
            *m = 0;
            if n == 0 {
                return;
            }
            // SAFETY: `a` has n columns lda apart and `w` has n entries. `z` has as many columns
            // as eigenvalues may be found; nothing overlaps.
            let (a, w) = unsafe {
                (
                    from_raw_parts(a.cast_const(), extent(n, n, lda)),
                    from_raw_parts_mut(w, n),
                )
            };
            let columns = match wanted {
                Range::Places(first, last) => last - first + 1,
                _ => n,
            };
            let z = vectors.then(|| {
                // SAFETY: as above; without the job `V`, `z` is not accessed.
                let z = unsafe { from_raw_parts_mut(z, extent(n, columns, ldz)) };
                (z, ldz)
            });
            let full = load_symmetric(a, triangle, n, lda);
            match decompose::syevr(&full, wanted, w, z) {
                Some(found) => {
                    *m = info_of(found);
                    if vectors {
                        for k in 0..found {
                            // SAFETY: `isuppz` has two entries per eigenvalue; every vector
                            // may have entries in all rows.
                            unsafe {
                                *isuppz.add(2 * k) = 1;
                                *isuppz.add(2 * k + 1) = info_of(n);
                            }
                        }
                    }
                }
                None => *info = 1,
            }
        }

        /// The Cholesky factor of a symmetric matrix, in place.
        ///
        /// # Safety
        /// As LAPACK's `potrf`: pointers to storage of the sizes that the other arguments state.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $potrf(
            uplo: *const c_char,
            n: *const c_int,
            a: *mut $T,
            lda: *const c_int,
            info: *mut c_int,
        ) {
            // SAFETY: `info` points to one value that may be written.
            let info = unsafe { &mut *info };
            *info = 0;
            read!(uplo, n, lda);
            let triangle = argument!(Triangle::of(uplo.to_ne_bytes()[0]), 1, info);
            let n = argument!(size(n), 2, info);
            let lda = argument!(leading(lda, n), 4, info);
            if n == 0 {
                return;
            }
            // SAFETY: `a` has n columns lda apart.
            let a = unsafe { from_raw_parts_mut(a, extent(n, n, lda)) };
            *info = info_of(decompose::potrf(triangle, n, a, lda));
        }

        /// Solves A X = B from the factor of `potrf`, in place of B.
        ///
        /// # Safety
        /// As LAPACK's `potrs`: pointers to storage of the sizes that the other arguments state.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $potrs(
            uplo: *const c_char,
            n: *const c_int,
            nrhs: *const c_int,
            a: *const $T,
            lda: *const c_int,
            b: *mut $T,
            ldb: *const c_int,
            info: *mut c_int,
        ) {
            // SAFETY: `info` points to one value that may be written.
            let info = unsafe { &mut *info };
            *info = 0;
            read!(uplo, n, nrhs, lda, ldb);
            let triangle = argument!(Triangle::of(uplo.to_ne_bytes()[0]), 1, info);
            let n = argument!(size(n), 2, info);
            let columns = argument!(size(nrhs), 3, info);
            let lda = argument!(leading(lda, n), 5, info);
            let ldb = argument!(leading(ldb, n), 7, info);
            if n == 0 || columns == 0 {
                return;
            }
            // SAFETY: `a` has n columns lda apart, `b` nrhs columns ldb apart; they do not
            // overlap.
            let (a, b) = unsafe {
                (
                    from_raw_parts(a, extent(n, n, lda)),
                    from_raw_parts_mut(b, extent(n, columns, ldb)),
                )
            };
            let mut x = load(b, n, columns, ldb);
            // LAPACK divides by the zero on the diagonal and returns infinities; here NaN
            if !decompose::potrs(triangle, n, a, lda, &mut x) {
                x.fill(<$T>::NAN);
            }
            store(&x, b, ldb);
        }

        /// The singular value decomposition.
        ///
        /// # Safety
        /// As LAPACK's `gesdd`: pointers to storage of the sizes that the other arguments state.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $gesdd(
            jobz: *const c_char,
            m: *const c_int,
            n: *const c_int,
            a: *mut $T,
            lda: *const c_int,
            s: *mut $T,
            u: *mut $T,
            ldu: *const c_int,
            vt: *mut $T,
            ldvt: *const c_int,
            work: *mut $T,
            lwork: *const c_int,
            _iwork: *mut c_int,
            info: *mut c_int,
        ) {
            // SAFETY: the arguments are those of `gesvd` with one job less, so that the positions
            // in a negative `info` are one less too.
            unsafe {
                $gesvd(
                    jobz, jobz, m, n, a, lda, s, u, ldu, vt, ldvt, work, lwork, info,
                );
                if *info < -1 {
                    *info += 1;
                }
            }
        }

        /// The singular value decomposition, with separate jobs for the left and right vectors.
        ///
        /// # Safety
        /// As LAPACK's `gesvd`: pointers to storage of the sizes that the other arguments state.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $gesvd(
            jobu: *const c_char,
            jobvt: *const c_char,
            m: *const c_int,
            n: *const c_int,
            a: *mut $T,
            lda: *const c_int,
            s: *mut $T,
            u: *mut $T,
            ldu: *const c_int,
            vt: *mut $T,
            ldvt: *const c_int,
            work: *mut $T,
            lwork: *const c_int,
            info: *mut c_int,
        ) {
            // SAFETY: `info` points to one value that may be written.
            let info = unsafe { &mut *info };
            *info = 0;
            read!(jobu, jobvt, m, n, lda, ldu, ldvt, lwork);
            let rows = argument!(size(m), 3, info);
            let columns = argument!(size(n), 4, info);
            let left = argument!(side(jobu, rows <= columns), 1, info);
            let right = argument!(side(jobvt, columns <= rows), 2, info);
            let lda = argument!(leading(lda, rows), 6, info);
            let ldu = argument!(leading(ldu, if left { rows } else { 1 }), 9, info);
            let least = rows.min(columns);
            let ldvt = argument!(leading(ldvt, if right { least } else { 1 }), 11, info);
            if lwork == -1 {
                // SAFETY: in a query for the workspace size the workspace has at least one entry.
                unsafe { *work = 1.0 };
                return;
            }
            if least == 0 {
                return;
            }
            // SAFETY: `a` has n columns lda apart, `s` as many entries as there are singular
            // values.
            let (a, s) = unsafe {
                (
                    from_raw_parts(a.cast_const(), extent(rows, columns, lda)),
                    from_raw_parts_mut(s, least),
                )
            };
            let Some(svd) = decompose::svd(&load(a, rows, columns, lda)) else {
                *info = 1;
                return;
            };
            s.copy_from_slice(&svd.values);
            if left {
                // SAFETY: the job wants left vectors, so `u` has a column for each singular value.
                let u = unsafe { from_raw_parts_mut(u, extent(rows, least, ldu)) };
                store(&svd.u, u, ldu);
            }
            if right {
                // SAFETY: the job wants right vectors, so `vt` has n columns ldvt apart.
                let vt = unsafe { from_raw_parts_mut(vt, extent(least, columns, ldvt)) };
                store(&svd.v_t, vt, ldvt);
            }
        }

        /// Solves A X = B, in place of B.
        ///
        /// # Safety
        /// As LAPACK's `gesv`: pointers to storage of the sizes that the other arguments state.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $gesv(
            n: *const c_int,
            nrhs: *const c_int,
            a: *mut $T,
            lda: *const c_int,
            ipiv: *mut c_int,
            b: *mut $T,
            ldb: *const c_int,
            info: *mut c_int,
        ) {
            // SAFETY: `info` points to one value that may be written.
            let info = unsafe { &mut *info };
            *info = 0;
            read!(n, nrhs, lda, ldb);
            let n = argument!(size(n), 1, info);
            let columns = argument!(size(nrhs), 2, info);
            let lda = argument!(leading(lda, n), 4, info);
            let ldb = argument!(leading(ldb, n), 7, info);
            if n == 0 {
                return;
            }
            // SAFETY: `a` has n columns lda apart, `ipiv` n entries, `b` nrhs columns ldb apart;
            // they do not overlap. Without columns the pointer of `b` need not be valid, so no
            // slice is made of it.
            let (a, pivots) = unsafe {
                (
                    from_raw_parts_mut(a, extent(n, n, lda)),
                    from_raw_parts_mut(ipiv, n),
                )
            };
            let b = if columns == 0 {
                &mut []
            } else {
                // SAFETY: as above.
                unsafe { from_raw_parts_mut(b, extent(n, columns, ldb)) }
            };
            let mut x = load(b, n, columns, ldb);
            *info = info_of(decompose::gesv(n, a, lda, pivots, &mut x));
            store(&x, b, ldb);
        }
    };
}

/// Reads the argument `jobz` of `syevr`: whether eigenvectors are wanted (`V`) or not (`N`).
fn job(character: c_char) -> Option<bool> {
    match character.to_ne_bytes()[0].to_ascii_uppercase() {
        b'N' => Some(false),
        b'V' => Some(true),
        _ => None,
    }
}

/// Reads a job of `gesvd`: whether singular vectors of one side are wanted (`S`, or `A` where the
/// thin decomposition has all of them) or not (`N`).
fn side(character: c_char, thin_is_all: bool) -> Option<bool> {
    match character.to_ne_bytes()[0].to_ascii_uppercase() {
        b'N' => Some(false),
        b'S' => Some(true),
        b'A' if thin_is_all => Some(true),
        _ => None,
    }
}

decompositions!(f64: dsyevr_ dpotrf_ dpotrs_ dgesdd_ dgesvd_ dgesv_);
decompositions!(f32: ssyevr_ spotrf_ spotrs_ sgesdd_ sgesvd_ sgesv_);
