//! An LU factorisation of a square matrix of fixed size, which compares A_e at two states.

use core::array::from_fn;

use regen_runtime::Scalar;

use crate::real::{Real, largest};

/// P A D^-1 = L U with partial pivoting; D holds the largest entry of each column, so that
/// comparisons do not depend on the units of the coordinates.
#[derive(Clone, Debug)]
pub(crate) struct Factored<T, const E: usize> {
    /// L below the diagonal, U on and above it.
    factors: [[T; E]; E],
    /// The row of A that each pivot selected.
    rows: [usize; E],
    /// The diagonal of D.
    scale: [T; E],
}

impl<T: Real, const E: usize> Factored<T, E> {
    pub(crate) fn new(matrix: &[[T; E]; E]) -> Self {
        let mut scale = [T::ZERO; E];
        for row in matrix {
            for (scale, x) in scale.iter_mut().zip(row) {
                *scale = Scalar::max(*scale, Scalar::abs(*x));
            }
        }
        let mut factors = scaled(matrix, &scale);
        let mut rows: [usize; E] = from_fn(|row| row);
        for k in 0..E {
            let mut best = k;
            for i in k + 1..E {
                if Scalar::abs(factors[i][k]) > Scalar::abs(factors[best][k]) {
                    best = i;
                }
            }
            factors.swap(k, best);
            rows.swap(k, best);
            let (done, open) = factors.split_at_mut(k + 1);
            let top = &done[k];
            for row in open {
                let factor = row[k] / top[k];
                row[k] = factor;
                for (x, y) in row.iter_mut().zip(top).skip(k + 1) {
                    *x = *x - factor * *y;
                }
            }
        }
        Self {
            factors,
            rows,
            scale,
        }
    }

    /// The ratio of the smallest to the largest pivot; 1 for an empty matrix, 0 or NaN if the matrix
    /// is singular or not finite.
    pub(crate) fn ratio(&self) -> T {
        let pivots = || (0..E).map(|k| Scalar::abs(self.factors[k][k]));
        let most = largest(pivots());
        pivots().fold(T::ONE, |m, pivot| Scalar::min(m, pivot / most))
    }

    /// The largest row sum of |D A^-1 B D^-1 - I|. Below 1, every matrix on the straight line from
    /// A to B is regular.
    pub(crate) fn distance(&self, other: &[[T; E]; E]) -> T {
        let other = scaled(other, &self.scale);
        let mut sums = [T::ZERO; E];
        for column in 0..E {
            let mut x = [T::NAN; E];
            for (x, row) in x.iter_mut().zip(self.rows) {
                if let Some(row) = other.get(row) {
                    *x = row[column];
                }
            }
            self.substitute(&mut x);
            x[column] = x[column] - T::ONE;
            for (sum, x) in sums.iter_mut().zip(x) {
                *sum = *sum + Scalar::abs(x);
            }
        }
        largest(sums)
    }

    /// Replaces b by the solution of L U x = b.
    fn substitute(&self, b: &mut [T; E]) {
        for i in 0..E {
            for k in 0..i {
                b[i] = b[i] - self.factors[i][k] * b[k];
            }
        }
        for i in (0..E).rev() {
            for k in i + 1..E {
                b[i] = b[i] - self.factors[i][k] * b[k];
            }
            b[i] = b[i] / self.factors[i][i];
        }
    }
}

/// The matrix with its columns divided by `scale`; zero columns stay zero.
fn scaled<T: Real, const E: usize>(matrix: &[[T; E]; E], scale: &[T; E]) -> [[T; E]; E] {
    let mut scaled = *matrix;
    for row in &mut scaled {
        for (entry, scale) in row.iter_mut().zip(scale) {
            if *scale > T::ZERO {
                *entry = *entry / *scale;
            }
        }
    }
    scaled
}

#[cfg(test)]
mod tests {
    use super::Factored;

    #[test]
    fn the_distance_is_relative_and_without_units() {
        let a = [[0.0, 3.0], [2.0, 1.0]];
        let factored = Factored::new(&a);
        assert!(factored.distance(&a) < 1e-15);
        let near = a.map(|row| row.map(|x| 1.25 * x));
        assert!((factored.distance(&near) - 0.25_f64).abs() < 1e-15);
        // a matrix without a regular path to it is at least 1 away
        assert!(factored.distance(&[[0.0, 3.0], [0.0, 1.0]]) >= 1.0 - 1e-15);
        assert!(factored.distance(&[[f64::NAN; 2]; 2]).is_nan());
        // the second coordinate in millimetres
        let (small, other) = ([[0.0, 3e-3], [2.0, 1e-3]], [[0.1, 3e-3], [2.0, 0.8e-3]]);
        let in_metres = factored.distance(&[[0.1, 3.0], [2.0, 0.8]]);
        assert!((Factored::new(&small).distance(&other) - in_metres).abs() < 1e-14);
    }

    #[test]
    fn the_ratio_vanishes_with_the_determinant() {
        assert!((Factored::new(&[[0.0, 3.0], [2.0, 0.0]]).ratio() - 1.0_f64).abs() < 1e-15);
        assert!(Factored::new(&[[1.0, 2.0], [2.0, 4.0 + 1e-12]]).ratio() < 1e-11);
        assert!(Factored::new(&[[0.0_f64; 2]; 2]).ratio().is_nan());
        assert!((Factored::<f32, 0>::new(&[]).ratio() - 1.0).abs() < 1e-15);
    }
}
