//! The minimum-norm solution of linear equations that may be singular.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Singular values below this fraction of the largest count as zero.
const RANK_TOLERANCE: f64 = 1e-11;

/// The rank of a matrix, and its pseudo-inverse.
pub(super) struct PseudoInverse {
    pub(super) rank: usize,
    inverse: DMatrix<f64>,
}

impl PseudoInverse {
    /// Computes both from the eigenvectors of `[0 A^T; A 0]`, whose eigenvalues are the singular
    /// values with both signs; those of A^T A would square the condition number.
    pub(super) fn of(a: &DMatrix<f64>) -> Self {
        let (m, n) = a.shape();
        let mut both = DMatrix::zeros(m + n, m + n);
        both.view_mut((n, 0), (m, n)).copy_from(a);
        both.view_mut((0, n), (n, m)).copy_from(&a.transpose());
        let eigen = SymmetricEigen::new(both);
        let largest = eigen.eigenvalues.amax();
        let mut inverse = DMatrix::zeros(n, m);
        let mut rank = 0;
        for (k, value) in eigen.eigenvalues.iter().enumerate() {
            if *value > RANK_TOLERANCE * largest {
                // v and u have length 1/sqrt(2) each
                let column = eigen.eigenvectors.column(k);
                let (v, u) = (
                    column.rows(0, n).into_owned(),
                    column.rows(n, m).into_owned(),
                );
                inverse += &v * u.transpose() * (2.0 / value);
                rank += 1;
            }
        }
        Self { rank, inverse }
    }

    pub(super) fn solve(&self, side: &DVector<f64>) -> DVector<f64> {
        &self.inverse * side
    }
}
