//! Decompositions on slices whose lengths the caller has checked. Failures are returned as the
//! values of `info`, as `None` or as `false`.

use nalgebra::linalg::SymmetricEigen;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, LU, RealField};

use crate::multiply::{Triangle, load, load_symmetric, store};

/// Bound on the iterations of the eigenvalue and singular value algorithms; a few per row are
/// needed.
const MAX_ITERATIONS: usize = 10_000;

/// The eigenvalues to compute.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Range<T> {
    /// All eigenvalues.
    All,
    /// The eigenvalues in the interval (low, high].
    Between(T, T),
    /// The eigenvalues number `.0` to `.1` in ascending order, counted from 1.
    Places(usize, usize),
}

/// Eigenvalues and eigenvectors of a symmetric matrix: writes the eigenvalues, ascending, to `w`
/// and their vectors to the columns of `z`. Returns the number of eigenvalues, or `None` where the
/// iteration does not converge.
pub(crate) fn syevr<T: RealField + Copy>(
    a: &DMatrix<T>,
    range: Range<T>,
    w: &mut [T],
    z: Option<(&mut [T], usize)>,
) -> Option<usize> {
    let n = a.nrows();
    if a.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::try_new(a.clone(), T::default_epsilon(), MAX_ITERATIONS)?;
    let mut order: Vec<usize> = (0..n).collect();
    let values = &eigen.eigenvalues;
    order.sort_by(|&i, &j| {
        values[i]
            .partial_cmp(&values[j])
            .unwrap_or(core::cmp::Ordering::Equal)
    });
    let wanted: Vec<usize> = match range {
        Range::All => order,
        Range::Between(low, high) => {
            order.retain(|&i| values[i] > low && values[i] <= high);
            order
        }
        Range::Places(first, last) => order[first - 1..last].to_vec(),
    };
    for (slot, &i) in w.iter_mut().zip(&wanted) {
        *slot = values[i];
    }
    if let Some((z, leading)) = z {
        let vectors = DMatrix::from_fn(n, wanted.len(), |i, k| eigen.eigenvectors[(i, wanted[k])]);
        store(&vectors, z, leading);
    }
    Some(wanted.len())
}

/// Replaces one triangle by the Cholesky factor, U^T U or L L^T, and leaves the other triangle
/// unchanged. Returns 0, or the order of the first leading minor that is not positive.
pub(crate) fn potrf<T: RealField + Copy>(
    triangle: Triangle,
    n: usize,
    a: &mut [T],
    leading: usize,
) -> usize {
    let full = load_symmetric(a, triangle, n, leading);
    if let Some(factor) = Cholesky::new(full.clone()) {
        let l = factor.unpack();
        for j in 0..n {
            for i in j..n {
                let at = match triangle {
                    Triangle::Lower => j * leading + i,
                    Triangle::Upper => i * leading + j,
                };
                a[at] = l[(i, j)];
            }
        }
        return 0;
    }
    let is_not_positive =
        |k: &usize| Cholesky::new(full.view((0, 0), (*k, *k)).into_owned()).is_none();
    (1..n).find(is_not_positive).unwrap_or(n)
}

/// Solves A X = B with the factor that [`potrf`] computed; `false` where its diagonal has a zero.
pub(crate) fn potrs<T: RealField + Copy>(
    triangle: Triangle,
    n: usize,
    a: &[T],
    leading: usize,
    b: &mut DMatrix<T>,
) -> bool {
    let factor = load(a, n, n, leading);
    match triangle {
        Triangle::Lower => {
            factor.solve_lower_triangular_mut(b) && factor.tr_solve_lower_triangular_mut(b)
        }
        Triangle::Upper => {
            factor.tr_solve_upper_triangular_mut(b) && factor.solve_upper_triangular_mut(b)
        }
    }
}

/// A thin singular value decomposition.
pub(crate) struct Svd<T> {
    /// The left singular vectors, rows x k.
    pub(crate) u: DMatrix<T>,
    /// The k singular values, descending.
    pub(crate) values: Vec<T>,
    /// The right singular vectors, transposed, k x columns.
    pub(crate) v_t: DMatrix<T>,
}

/// The thin singular value decomposition, k = min(rows, columns) values; `None` where the matrix is
/// not finite or the iteration does not converge.
///
/// By one-sided Jacobi rotations (Hestenes, 1958): nalgebra's algorithm has errors of 1e-12 on some
/// ordinary matrices, a thousand times more than a solver may expect.
pub(crate) fn svd<T: RealField + Copy>(a: &DMatrix<T>) -> Option<Svd<T>> {
    if a.iter().any(|x| !x.is_finite()) {
        return None;
    }
    if a.nrows() < a.ncols() {
        let Svd { u, values, v_t } = svd(&a.transpose())?;
        return Some(Svd {
            u: v_t.transpose(),
            values,
            v_t: u.transpose(),
        });
    }
    let n = a.ncols();
    let (mut u, mut v) = (a.clone(), DMatrix::identity(n, n));
    let converged = (0..MAX_ITERATIONS).any(|_| !sweep(&mut u, &mut v));
    if !converged {
        return None;
    }
    let norms: Vec<T> = (0..n).map(|j| u.column(j).norm()).collect();
    let mut order: Vec<usize> = (0..n).collect();
    let descending = |&i: &usize, &j: &usize| norms[j].partial_cmp(&norms[i]);
    order.sort_by(|i, j| descending(i, j).unwrap_or(core::cmp::Ordering::Equal));
    let values: Vec<T> = order.iter().map(|&j| norms[j]).collect();
    let mut left = DMatrix::zeros(a.nrows(), n);
    for (k, &j) in order.iter().enumerate() {
        let column = if norms[j] > T::zero() {
            u.column(j) / norms[j]
        } else {
            complement(&left.columns(0, k).into_owned())
        };
        left.set_column(k, &column);
    }
    let v_t = DMatrix::from_fn(n, n, |k, i| v[(i, order[k])]);
    Some(Svd {
        u: left,
        values,
        v_t,
    })
}

/// Rotates every pair of columns of `u` once to make them orthogonal, and `v` likewise; returns
/// whether any pair was rotated.
fn sweep<T: RealField + Copy>(u: &mut DMatrix<T>, v: &mut DMatrix<T>) -> bool {
    let n = u.ncols();
    let small = T::default_epsilon() * nalgebra::convert(u.nrows() as f64);
    let mut rotated = false;
    for i in 0..n {
        for j in i + 1..n {
            let (alpha, beta) = (u.column(i).norm_squared(), u.column(j).norm_squared());
            let gamma = u.column(i).dot(&u.column(j));
            if gamma.abs() <= small * (alpha * beta).sqrt() {
                continue;
            }
            rotated = true;
            let zeta = (beta - alpha) / (gamma + gamma);
            let one = T::one();
            let size = one / (zeta.abs() + (one + zeta * zeta).sqrt());
            let t = if zeta < T::zero() { -size } else { size };
            let c = one / (one + t * t).sqrt();
            for m in [&mut *u, &mut *v] {
                for r in 0..m.nrows() {
                    let (x, y) = (m[(r, i)], m[(r, j)]);
                    m[(r, i)] = c * (x - t * y);
                    m[(r, j)] = c * (y + t * x);
                }
            }
        }
    }
    rotated
}

/// A unit vector orthogonal to the orthonormal `columns`, of which there are fewer than rows.
fn complement<T: RealField + Copy>(columns: &DMatrix<T>) -> DVector<T> {
    let rows = columns.nrows();
    let part = |r: usize| columns.row(r).norm_squared();
    // the coordinate axis that is farthest from the span of the columns
    let best = (1..rows).fold(0, |best, r| if part(r) < part(best) { r } else { best });
    let mut axis = DVector::zeros(rows);
    axis[best] = T::one();
    for _ in 0..2 {
        let inside = columns * (columns.transpose() * &axis);
        axis -= inside;
    }
    axis.normalize()
}

/// Solves A X = B by elimination with row exchanges; `a` becomes its LU factors. Returns 0, or the
/// position, from 1, of a zero pivot, in which case B is unchanged.
pub(crate) fn gesv<T: RealField + Copy>(
    n: usize,
    a: &mut [T],
    leading: usize,
    pivots: &mut [i32],
    b: &mut DMatrix<T>,
) -> usize {
    let factors: LU<T, Dyn, Dyn> = LU::new(load(a, n, n, leading));
    let mut order = DMatrix::from_fn(n, 1, |i, _| i);
    factors.p().permute_rows(&mut order);
    // the sequence of row exchanges that leads to this order, as LAPACK's ipiv
    let mut current: Vec<usize> = (0..n).collect();
    for i in 0..n {
        let from = (i..n).find(|&k| current[k] == order[(i, 0)]).unwrap_or(i);
        current.swap(i, from);
        pivots[i] = i32::try_from(from + 1).unwrap_or(i32::MAX);
    }
    store(factors.lu_internal(), a, leading);
    if let Some(zero) = (0..n).find(|&i| factors.lu_internal()[(i, i)].is_zero()) {
        return zero + 1;
    }
    factors.solve_mut(b);
    0
}
