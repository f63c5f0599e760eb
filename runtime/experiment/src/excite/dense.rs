//! Dense matrices in vector registers, for the quadratic programmes: every sum has its terms in the
//! same order on any processor, as the sums of different entries are side by side.
#![allow(
    clippy::inline_always,
    reason = "a function that is not inlined is compiled without the token's instruction set"
)]

use pulp::Arch;

/// Rows whose multiples are added to a matrix at a time, so that each entry is loaded and stored
/// once for all of them.
const ROWS: usize = 4;

/// A matrix, column by column.
pub(super) struct Columns {
    entries: Vec<f64>,
    height: usize,
}

impl Columns {
    /// The matrix of these rows, of n entries each.
    pub(super) fn of_rows(rows: &[Vec<f64>], n: usize) -> Self {
        let height = rows.len();
        let mut entries = vec![0.0; n * height];
        for (r, row) in rows.iter().enumerate() {
            for (slot, x) in entries.iter_mut().skip(r).step_by(height).zip(row) {
                *slot = *x;
            }
        }
        Self { entries, height }
    }

    /// The matrix times `x`.
    pub(super) fn times(&self, x: &[f64]) -> Vec<f64> {
        times(&self.entries, self.height, x)
    }
}

/// A matrix times `x`; `columns`: those of the matrix, of `height` entries each.
pub(super) fn times(columns: &[f64], height: usize, x: &[f64]) -> Vec<f64> {
    // sums start from -0 as those of iterators do, so that a first term of -0 keeps its sign
    let mut out = vec![-0.0; height];
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for (column, x) in columns.chunks_exact(height.max(1)).zip(x) {
                add(&mut out, column, *x);
            }
        },
    );
    out
}

/// Adds the rows, each times its factor, to `sums`.
pub(super) fn add_rows(sums: &mut [f64], rows: &[Vec<f64>], factors: &[f64]) {
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for (row, factor) in rows.iter().zip(factors) {
                add(sums, row, *factor);
            }
        },
    );
}

/// `sums + factor x`
#[inline(always)]
fn add(sums: &mut [f64], x: &[f64], factor: f64) {
    for (sum, x) in sums.iter_mut().zip(x) {
        *sum += factor * x;
    }
}

/// `sums + factor x`, for as many entries as `sums` has.
pub(super) fn add_scaled(sums: &mut [f64], x: &[f64], factor: f64) {
    Arch::new().dispatch(
        #[inline(always)]
        || add(sums, x, factor),
    );
}

/// The columns of the inverse of `L^T`, where `L L^T` is the symmetric matrix `m` of n x n entries;
/// `None` where it is not positive definite.
pub(super) fn inverse_factor(m: &[f64], n: usize) -> Option<Vec<Vec<f64>>> {
    let mut columns = m.to_vec();
    Arch::new().dispatch(
        #[inline(always)]
        || {
            if !factor(&mut columns, n) {
                return None;
            }
            let mut out: Vec<Vec<f64>> = (0..n).map(|_| vec![0.0; n]).collect();
            // row i of the inverse of L: that of the unit matrix minus the rows before, over L's
            // diagonal
            for i in 0..n {
                let (before, rest) = out.split_at_mut(i);
                let own = &mut rest[0];
                own[i] = 1.0;
                for (k, row) in before.iter().enumerate() {
                    add(&mut own[..=k], &row[..=k], -columns[k * n + i]);
                }
                let diagonal = columns[i * n + i];
                for x in &mut own[..=i] {
                    *x /= diagonal;
                }
            }
            Some(out)
        },
    )
}

/// The Cholesky factor of a matrix.
pub(super) struct Cholesky {
    /// The columns of the lower triangle, `size` entries each, of which those above the diagonal are
    /// not used.
    columns: Vec<f64>,
    size: usize,
}

impl Cholesky {
    /// Factors the matrix whose lower triangle has these columns, plus the sum of `w r r^T` of all
    /// rows r with their weights w; `None` where it is not positive definite.
    ///
    /// - `columns`: `size` entries each; those above the diagonal are not used;
    /// - `rows`: of `size` entries.
    pub(super) fn new(
        mut columns: Vec<f64>,
        size: usize,
        rows: &[Vec<f64>],
        weights: &[f64],
    ) -> Option<Self> {
        let regular = Arch::new().dispatch(
            #[inline(always)]
            || {
                add_squares(&mut columns, size, rows, weights);
                factor(&mut columns, size)
            },
        );
        regular.then_some(Self { columns, size })
    }

    /// Solves for `side` in place.
    pub(super) fn solve(&self, side: &mut [f64]) {
        Arch::new().dispatch(
            #[inline(always)]
            || self.substitute(side),
        );
    }

    #[inline(always)]
    fn substitute(&self, side: &mut [f64]) {
        let size = self.size;
        let mut sums = vec![-0.0; size];
        for (i, column) in self.columns.chunks_exact(size).enumerate() {
            side[i] = (side[i] - sums[i]) / column[i];
            add(&mut sums[i + 1..], &column[i + 1..], side[i]);
        }
        for i in (0..size).rev() {
            let (above, rest) = side.split_at_mut(i);
            rest[0] /= self.columns[i * size + i];
            let row = self.columns.iter().skip(i).step_by(size);
            for (x, l) in above.iter_mut().zip(row) {
                *x -= l * rest[0];
            }
        }
    }
}

/// Adds `w r r^T` of all rows r, in their order, to the lower triangle.
#[inline(always)]
fn add_squares(columns: &mut [f64], size: usize, rows: &[Vec<f64>], weights: &[f64]) {
    let mut scaled = vec![0.0; ROWS * size];
    let groups = rows.chunks(ROWS).zip(weights.chunks(ROWS));
    for (rows, weights) in groups {
        let each = scaled.chunks_exact_mut(size).zip(rows).zip(weights);
        for ((scaled, row), weight) in each {
            for (s, x) in scaled.iter_mut().zip(row) {
                *s = weight * x;
            }
        }
        for (j, column) in columns.chunks_exact_mut(size).enumerate() {
            let own = &mut column[j..];
            if let [a, b, c, d] = rows {
                let [a, b, c, d] = [a[j], b[j], c[j], d[j]];
                let (s0, rest) = scaled.split_at(size);
                let (s1, rest) = rest.split_at(size);
                let (s2, s3) = rest.split_at(size);
                let first = s0[j..].iter().zip(&s1[j..]);
                let last = s2[j..].iter().zip(&s3[j..]);
                for ((sum, (s0, s1)), (s2, s3)) in own.iter_mut().zip(first).zip(last) {
                    *sum = *sum + s0 * a + s1 * b + s2 * c + s3 * d;
                }
            } else {
                for (scaled, row) in scaled.chunks_exact(size).zip(rows) {
                    add(own, &scaled[j..], row[j]);
                }
            }
        }
    }
}

/// Replaces the lower triangle by its Cholesky factor; false where it is not positive definite.
#[inline(always)]
fn factor(columns: &mut [f64], size: usize) -> bool {
    let mut diagonal: Vec<f64> = (0..size).map(|j| columns[j * size + j]).collect();
    let mut sums = vec![0.0; size];
    for j in 0..size {
        let pivot = diagonal[j];
        if pivot.is_nan() || pivot <= 0.0 {
            return false;
        }
        let root = pivot.sqrt();
        let (done, open) = columns.split_at_mut(j * size);
        let below = &mut sums[j + 1..];
        below.fill(-0.0);
        for column in done.chunks_exact(size) {
            add(below, &column[j + 1..], column[j]);
        }
        let (own, _) = open.split_at_mut(size);
        own[j] = root;
        let rest = own[j + 1..].iter_mut().zip(&*below);
        for ((x, sum), diagonal) in rest.zip(&mut diagonal[j + 1..]) {
            *x = (*x - sum) / root;
            *diagonal -= *x * *x;
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The factor solves the system, and each entry is that of sums one after the other.
    #[test]
    fn the_factor_solves_and_sums_keep_their_order() {
        let mut seed = 5_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 33) as f64 / 2_f64.powi(30) - 1.0
        };
        for (n, count) in [(1, 1), (7, 9), (12, 30)] {
            let mut list = |n: usize| (0..n).map(|_| random()).collect::<Vec<f64>>();
            let rows: Vec<Vec<f64>> = (0..count).map(|_| list(n)).collect();
            let (weights, x) = (
                list(count).iter().map(|w| w.abs()).collect::<Vec<f64>>(),
                list(n),
            );
            let found = Columns::of_rows(&rows, n).times(&x);
            for (row, found) in rows.iter().zip(found) {
                let sum: f64 = row.iter().zip(&x).map(|(a, b)| a * b).sum();
                assert_eq!(sum.to_bits(), found.to_bits());
            }
            let mut own = vec![0.0; n * n];
            (0..n).for_each(|k| own[k * n + k] = 0.5);
            let mut side = vec![0.0; n];
            for i in 0..n {
                for j in 0..n {
                    let squares = rows
                        .iter()
                        .zip(&weights)
                        .map(|(row, w)| w * row[i] * row[j]);
                    let entry: f64 = squares.sum::<f64>() + own[i * n + j];
                    side[i] += entry * x[j];
                }
            }
            let factor = Cholesky::new(own, n, &rows, &weights).unwrap();
            factor.solve(&mut side);
            for (found, x) in side.iter().zip(&x) {
                assert!((found - x).abs() < 1e-12, "{found} {x}");
            }
        }
        assert!(Cholesky::new(vec![-1.0], 1, &[], &[]).is_none());
    }
}
