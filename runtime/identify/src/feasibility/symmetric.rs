//! Symmetric matrices of up to four rows, as in the semidefinite cones of bodies.

/// A matrix of up to four rows, of which only the first rows and columns are used.
pub(super) type Square = [[f64; 4]; 4];

pub(super) const ZERO: Square = [[0.0; 4]; 4];

/// The identity.
pub(super) const ONE: Square = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
    [0.0, 0.0, 0.0, 1.0],
];

/// A matrix of one row.
pub(super) fn one(x: f64) -> Square {
    let mut m = ZERO;
    m[0][0] = x;
    m
}

/// The row and column of each entry of the upper triangle, column by column.
pub(super) fn upper(size: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..size).flat_map(|c| (0..=c).map(move |r| (r, c)))
}

/// The inner product: the sum of the products of corresponding entries.
pub(super) fn inner(a: &Square, b: &Square) -> f64 {
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    pairs.map(|(x, y)| x * y).sum()
}

/// `a + factor b`.
pub(super) fn plus(a: &Square, b: &Square, factor: f64) -> Square {
    let mut out = *a;
    for (row, other) in out.iter_mut().zip(b) {
        for (x, y) in row.iter_mut().zip(other) {
            *x += factor * y;
        }
    }
    out
}

pub(super) fn product(a: &Square, b: &Square) -> Square {
    let mut out = ZERO;
    for (row, left) in out.iter_mut().zip(a) {
        for (factor, right) in left.iter().zip(b) {
            if *factor != 0.0 {
                for (x, y) in row.iter_mut().zip(right) {
                    *x += factor * y;
                }
            }
        }
    }
    out
}

pub(super) fn transposed(a: &Square) -> Square {
    let mut out = ZERO;
    for (r, row) in a.iter().enumerate() {
        for (c, x) in row.iter().enumerate() {
            out[c][r] = *x;
        }
    }
    out
}

/// `a m a^T` for a symmetric m, symmetric to the last bit.
pub(super) fn congruence(a: &Square, m: &Square, size: usize) -> Square {
    if size == 1 {
        return one(a[0][0] * m[0][0] * a[0][0]);
    }
    let mut out = product(&product(a, m), &transposed(a));
    for (r, c) in upper(4) {
        let mean = 0.5 * (out[r][c] + out[c][r]);
        out[r][c] = mean;
        out[c][r] = mean;
    }
    out
}

/// The lower triangular L with `m = L L^T`; `None` unless the matrix is positive definite.
pub(super) fn cholesky(m: &Square, size: usize) -> Option<Square> {
    let mut l = ZERO;
    for c in 0..size {
        for r in c..size {
            let sum: f64 = (0..c).map(|k| l[r][k] * l[c][k]).sum();
            let rest = m[r][c] - sum;
            if r > c {
                l[r][c] = rest / l[c][c];
            } else if rest > 0.0 && rest.is_finite() {
                l[c][c] = rest.sqrt();
            } else {
                return None;
            }
        }
    }
    Some(l)
}

/// The inverse of a lower triangular matrix.
pub(super) fn inverse(l: &Square, size: usize) -> Square {
    let mut out = ZERO;
    for c in 0..size {
        out[c][c] = 1.0 / l[c][c];
        for r in c + 1..size {
            let sum: f64 = (c..r).map(|k| l[r][k] * out[k][c]).sum();
            out[r][c] = -sum / l[r][r];
        }
    }
    out
}

/// Eigenvalues, and eigenvectors as the columns of a matrix, by Jacobi's rotations, which compute
/// small eigenvalues of definite matrices to full relative accuracy.
pub(super) fn eigen(m: &Square, size: usize) -> ([f64; 4], Square) {
    /// The largest number of sweeps over all pairs; convergence is quadratic, so that few are
    /// needed.
    const MAX_SWEEPS: usize = 32;
    if size == 1 {
        return ([m[0][0], m[1][1], m[2][2], m[3][3]], ONE);
    }
    let mut a = *m;
    let mut v = ONE;
    for _ in 0..MAX_SWEEPS {
        let mut turned = false;
        for (p, q) in upper(size).filter(|(p, q)| p != q) {
            let off = a[p][q];
            // false for a NaN
            let small = f64::EPSILON * 0.25 * (a[p][p].abs() * a[q][q].abs()).sqrt();
            let counts = off.abs() > small && off.abs() > f64::MIN_POSITIVE;
            if !counts {
                continue;
            }
            turned = true;
            let theta = 0.5 * (a[q][q] - a[p][p]) / off;
            let t = theta.signum() / (theta.abs() + theta.mul_add(theta, 1.0).sqrt());
            let c = 1.0 / t.mul_add(t, 1.0).sqrt();
            let s = t * c;
            let (pp, qq) = (a[p][p] - t * off, a[q][q] + t * off);
            for k in 0..size {
                let (x, y) = (a[k][p], a[k][q]);
                a[k][p] = c * x - s * y;
                a[k][q] = s * x + c * y;
                a[p][k] = a[k][p];
                a[q][k] = a[k][q];
                let (x, y) = (v[k][p], v[k][q]);
                v[k][p] = c * x - s * y;
                v[k][q] = s * x + c * y;
            }
            a[p][p] = pp;
            a[q][q] = qq;
            a[p][q] = 0.0;
            a[q][p] = 0.0;
        }
        if !turned {
            break;
        }
    }
    ([a[0][0], a[1][1], a[2][2], a[3][3]], v)
}

/// The smallest eigenvalue.
pub(super) fn smallest(m: &Square, size: usize) -> f64 {
    if size == 1 {
        return m[0][0];
    }
    let (values, _) = eigen(m, size);
    let least = |m: f64, x: &f64| if *x >= m { m } else { *x };
    values.iter().take(size).fold(f64::INFINITY, least)
}

/// The nearest positive semidefinite matrix.
pub(super) fn clipped(m: &Square, size: usize) -> Square {
    if size == 1 {
        return one(m[0][0].max(0.0));
    }
    let (values, v) = eigen(m, size);
    let mut diagonal = ZERO;
    for k in 0..size {
        diagonal[k][k] = values[k].max(0.0);
    }
    congruence(&v, &diagonal, size)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    const M: Square = [
        [4.0, 1.0, 0.5, 0.2],
        [1.0, 3.0, 0.1, 0.7],
        [0.5, 0.1, 2.0, 0.3],
        [0.2, 0.7, 0.3, 1.0],
    ];

    #[test]
    fn factors_and_eigenvectors_give_the_matrix_back() {
        let l = cholesky(&M, 4).unwrap();
        let back = product(&l, &transposed(&l));
        let (values, v) = eigen(&M, 4);
        let mut diagonal = ZERO;
        (0..4).for_each(|k| diagonal[k][k] = values[k]);
        let turned = congruence(&v, &diagonal, 4);
        let unit = product(&l, &inverse(&l, 4));
        for (r, c) in upper(4) {
            assert!((back[r][c] - M[r][c]).abs() < 1e-14);
            assert!((turned[r][c] - M[r][c]).abs() < 1e-13);
            assert!((unit[c][r] - ONE[c][r]).abs() < 1e-15);
        }
        assert!(cholesky(&plus(&M, &ONE, -1.0), 4).is_none());
    }

    #[test]
    fn clipping_takes_only_the_negative_part() {
        let shifted = plus(&M, &ONE, -1.5);
        assert!(smallest(&shifted, 4) < 0.0);
        let kept = clipped(&shifted, 4);
        assert!(smallest(&kept, 4) > -1e-15);
        // the removed part is semidefinite too, and orthogonal to the rest
        let taken = plus(&kept, &shifted, -1.0);
        assert!(smallest(&taken, 4) > -1e-15 && inner(&kept, &taken).abs() < 1e-14);
    }
}
