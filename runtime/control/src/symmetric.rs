//! Symmetric matrices of fixed size: pseudo-inertias, and the factors of positive definite ones.

use core::array::from_fn;

use regen_runtime::Scalar;

use crate::real::Real;

/// A body's parameters in the order of `Symbol::INERTIAL`, by their places; NaN beyond the end.
pub(crate) fn inertial<T: Real>(values: &[T], places: &[usize; 10]) -> [T; 10] {
    places.map(|at| values.get(at).copied().unwrap_or(T::NAN))
}

/// The pseudo-inertia of inertia about the origin, first moments and mass: second moments are half
/// the trace of the inertia less the inertia.
pub(crate) fn pseudo_inertia<T: Real>(body: &[T; 10]) -> [[T; 4]; 4] {
    let [ixx, ixy, ixz, iyy, iyz, izz, mx, my, mz, m] = *body;
    let half = T::of(0.5);
    let (x, y, z) = (
        half * (iyy + izz - ixx),
        half * (ixx + izz - iyy),
        half * (ixx + iyy - izz),
    );
    [
        [x, -ixy, -ixz, mx],
        [-ixy, y, -iyz, my],
        [-ixz, -iyz, z, mz],
        [mx, my, mz, m],
    ]
}

/// The parameters of a pseudo-inertia.
pub(crate) fn parameters<T: Real>(matrix: &[[T; 4]; 4]) -> [T; 10] {
    let [[x, xy, xz, mx], [_, y, yz, my], [_, _, z, mz], [_, _, _, m]] = *matrix;
    [y + z, -xy, -xz, x + z, -yz, x + y, mx, my, mz, m]
}

/// L with A = L L^T.
#[derive(Clone, Debug)]
pub(crate) struct Cholesky<T, const N: usize> {
    pub(crate) lower: [[T; N]; N],
}

impl<T: Real, const N: usize> Cholesky<T, N> {
    /// The factor of a symmetric matrix, of which the lower part is read; none unless it is positive
    /// definite.
    pub(crate) fn new(matrix: &[[T; N]; N]) -> Option<Self> {
        let mut lower = [[T::ZERO; N]; N];
        for i in 0..N {
            let mut row = [T::ZERO; N];
            let mut rest = matrix[i][i];
            for j in 0..i {
                let mut x = matrix[i][j];
                for (a, b) in row.iter().zip(&lower[j]).take(j) {
                    x = x - *a * *b;
                }
                row[j] = x / lower[j][j];
                rest = rest - row[j] * row[j];
            }
            // false for NaN
            let positive = rest > T::ZERO && rest.is_finite();
            if !positive {
                return None;
            }
            row[i] = Scalar::sqrt(rest);
            lower[i] = row;
        }
        Some(Self { lower })
    }

    /// The logarithm of the determinant.
    pub(crate) fn logarithm(&self) -> T {
        let logarithms = (0..N).map(|i| self.lower[i][i].ln());
        logarithms.fold(T::ZERO, |sum, x| sum + x + x)
    }

    /// The solution of L x = `b`.
    fn forward(&self, b: &[T; N]) -> [T; N] {
        let mut x = *b;
        for i in 0..N {
            for k in 0..i {
                x[i] = x[i] - self.lower[i][k] * x[k];
            }
            x[i] = x[i] / self.lower[i][i];
        }
        x
    }

    /// The solution of A x = `b`.
    pub(crate) fn solve(&self, b: &[T; N]) -> [T; N] {
        let mut x = self.forward(b);
        for i in (0..N).rev() {
            x[i] = x[i] / self.lower[i][i];
            for k in 0..i {
                x[k] = x[k] - self.lower[i][k] * x[i];
            }
        }
        x
    }

    /// L^-1 `matrix` L^-T of a symmetric matrix.
    pub(crate) fn scaled(&self, matrix: &[[T; N]; N]) -> [[T; N]; N] {
        let half: [[T; N]; N] = from_fn(|i| self.forward(&matrix[i]));
        let turned: [[T; N]; N] = from_fn(|i| from_fn(|j| half[j][i]));
        from_fn(|i| self.forward(&turned[i]))
    }
}
