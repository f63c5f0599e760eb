//! The singular value decomposition that all other files use.

use nalgebra::{DMatrix, Dyn, SVD};

/// Largest number of iterations.
const MAX_ITERATIONS: usize = 10_000;
/// A column shorter than this, relative to the longest, is a rounding error.
const NEGLIGIBLE_COLUMN_RATIO: f64 = 1e-12;

/// The singular value decomposition of a matrix, with singular vectors if `vectors` is set; `None`
/// if the iteration does not converge.
pub(crate) fn svd(matrix: DMatrix<f64>, vectors: bool) -> Option<SVD<f64, Dyn, Dyn>> {
    matrix.try_svd(vectors, vectors, f64::EPSILON, MAX_ITERATIONS)
}

/// The singular values of a matrix whose columns are scaled to unit length, in decreasing order and
/// relative to the largest. Columns that are rounding errors count as 0. Empty if an entry is not
/// finite or the iteration does not converge.
pub fn scaled_singular_values(mut matrix: DMatrix<f64>) -> Vec<f64> {
    if matrix.is_empty() || matrix.iter().any(|x| !x.is_finite()) {
        return Vec::new();
    }
    let norms: Vec<f64> = matrix.column_iter().map(|c| c.norm()).collect();
    let longest = norms.iter().copied().fold(0.0, f64::max);
    for (mut column, norm) in matrix.column_iter_mut().zip(norms) {
        if norm > NEGLIGIBLE_COLUMN_RATIO * longest {
            column /= norm;
        } else {
            column.fill(0.0);
        }
    }
    let Some(svd) = svd(matrix.qr().r(), false) else {
        return Vec::new();
    };
    let mut values: Vec<f64> = svd.singular_values.iter().copied().collect();
    values.sort_by(|a, b| b.total_cmp(a));
    let largest = values.first().copied().unwrap_or(1.0);
    values.iter().map(|v| v / largest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn singular_values_do_not_know_the_columns_units() {
        // the third column is the sum of the others, in other units
        let a = |r: usize| (r as f64).sin();
        let b = |r: usize| 1e4 * (0.7 * r as f64).cos();
        let w = DMatrix::from_fn(12, 4, |r, c| match c {
            0 => a(r),
            1 => b(r),
            2 => 1e3 * (a(r) + b(r) / 1e4),
            _ => 0.0,
        });
        let values = scaled_singular_values(w);
        assert_eq!(values.len(), 4);
        assert!((values[0] - 1.0).abs() < 1e-15);
        assert!(values[1] > 0.1 && values[2] < 1e-14 && values[3] < 1e-14);
    }
}
