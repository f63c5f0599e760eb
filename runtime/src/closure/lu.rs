//! A small dense factorisation, to compare A_e between two states.

use alloc::vec;
use alloc::vec::Vec;

use crate::Scalar;

/// P A D^-1 = L U with partial pivoting, D the columns' largest entries: the comparison of
/// two matrices below then does not depend on the units of the coordinates.
#[derive(Clone, Debug)]
pub(super) struct Lu {
    size: usize,
    /// L below the diagonal, U on and above it, row-major.
    factors: Vec<f64>,
    rows: Vec<usize>,
    scale: Vec<f64>,
    /// -1, 0 or 1: the sign of det A.
    sign: f64,
}

impl Lu {
    /// Factors a row-major square matrix.
    pub(super) fn new(matrix: &[f64], size: usize) -> Self {
        let mut scale = vec![0.0_f64; size];
        for row in matrix.chunks_exact(size.max(1)) {
            for (largest, entry) in scale.iter_mut().zip(row) {
                *largest = largest.max(entry.abs());
            }
        }
        let mut lu = Self {
            size,
            factors: scaled(matrix, &scale),
            rows: (0..size).collect(),
            scale,
            sign: 1.0,
        };
        for k in 0..size {
            lu.pivot(k);
        }
        lu
    }

    fn pivot(&mut self, k: usize) {
        let n = self.size;
        let best = (k..n).fold(k, |best, i| {
            let larger = self.factors[i * n + k].abs() > self.factors[best * n + k].abs();
            if larger { i } else { best }
        });
        if best != k {
            for j in 0..n {
                self.factors.swap(k * n + j, best * n + j);
            }
            self.rows.swap(k, best);
            self.sign = -self.sign;
        }
        let pivot = self.factors[k * n + k];
        self.sign *= if pivot == 0.0 { 0.0 } else { pivot.signum() };
        for i in k + 1..n {
            let factor = self.factors[i * n + k] / pivot;
            self.factors[i * n + k] = factor;
            for j in k + 1..n {
                self.factors[i * n + j] -= factor * self.factors[k * n + j];
            }
        }
    }

    /// The smallest over the largest pivot; 1 without any, NaN where the matrix is not finite.
    pub(super) fn ratio(&self) -> f64 {
        let pivots = || (0..self.size).map(|k| self.factors[k * self.size + k].abs());
        let largest = pivots().fold(0.0, f64::max);
        pivots().fold(1.0, |m, pivot| Scalar::min(m, pivot / largest))
    }

    /// The sign of the determinant: -1, 0 or 1, NaN where the matrix is not finite.
    pub(super) fn sign(&self) -> f64 {
        self.sign
    }

    /// The largest row sum of |D A^-1 B D^-1 - I|. Below 1, every matrix on the straight line
    /// from A to B is regular.
    pub(super) fn distance(&self, other: &[f64]) -> f64 {
        let n = self.size;
        let other = scaled(other, &self.scale);
        let mut sums = vec![0.0; n];
        let mut x = vec![0.0; n];
        for column in 0..n {
            for i in 0..n {
                let known = (0..i).map(|j| self.factors[i * n + j] * x[j]).sum::<f64>();
                x[i] = other[self.rows[i] * n + column] - known;
            }
            for i in (0..n).rev() {
                let known = (i + 1..n)
                    .map(|j| self.factors[i * n + j] * x[j])
                    .sum::<f64>();
                x[i] = (x[i] - known) / self.factors[i * n + i];
            }
            x[column] -= 1.0;
            for (sum, x) in sums.iter_mut().zip(&x) {
                *sum += x.abs();
            }
        }
        // NaN must not pass for a small distance.
        sums.into_iter()
            .fold(0.0, |m, sum| if sum <= m { m } else { sum })
    }
}

/// The matrix with its columns divided by a scale; zero columns are left.
fn scaled(matrix: &[f64], scale: &[f64]) -> Vec<f64> {
    let mut scaled = matrix.to_vec();
    for row in scaled.chunks_exact_mut(scale.len().max(1)) {
        for (entry, scale) in row.iter_mut().zip(scale) {
            if *scale > 0.0 {
                *entry /= scale;
            }
        }
    }
    scaled
}

#[cfg(test)]
mod tests {
    use super::Lu;

    #[test]
    fn the_sign_is_that_of_the_determinant() {
        assert!(Lu::new(&[0.0, 1.0, 1.0, 0.0], 2).sign() < 0.0);
        assert!(Lu::new(&[0.0, -2.0, 1.0, 0.0], 2).sign() > 0.0);
        // Three cyclic swaps, then one entry negative.
        let cyclic = [0.0, 5.0, 1.0, 1e-9, 0.0, 2.0, 3.0, 7.0, 0.0];
        let det = 5.0 * 2.0 * 3.0 + 1.0 * 1e-9 * 7.0;
        assert!(Lu::new(&cyclic, 3).sign() * det > 0.0);
        assert!(Lu::new(&[1.0, 2.0, 2.0, 4.0], 2).sign().abs() < 0.5);
        assert!(Lu::new(&[f64::NAN, 2.0, 2.0, 4.0], 2).sign().is_nan());
        assert!(Lu::new(&[], 0).sign() > 0.0);
    }

    #[test]
    fn the_ratio_vanishes_with_the_determinant() {
        let ratio = |matrix: &[f64]| Lu::new(matrix, 2).ratio();
        assert!((ratio(&[0.0, 3.0, 2.0, 0.0]) - 1.0).abs() < 1e-15);
        assert!(ratio(&[1.0, 2.0, 2.0, 4.0 + 1e-12]) < 1e-11);
        assert!(ratio(&[0.0; 4]).is_nan());
        assert!(ratio(&[f64::NAN, 1.0, 1.0, 0.0]).is_nan());
        assert!((Lu::new(&[], 0).ratio() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn the_distance_is_relative_and_without_units() {
        let a = [0.0, 3.0, 2.0, 1.0];
        let lu = Lu::new(&a, 2);
        assert!(lu.distance(&a) < 1e-15);
        let near = a.map(|x| 1.25 * x);
        assert!((lu.distance(&near) - 0.25).abs() < 1e-15);
        // A pivot that vanishes is at distance 1 at least.
        assert!(lu.distance(&[0.0, 3.0, 0.0, 1.0]) >= 1.0 - 1e-15);
        // The second coordinate in millimetres.
        let b = [0.1, 3.0, 2.0, 0.8];
        let (small, other) = ([0.0, 3e-3, 2.0, 1e-3], [0.1, 3e-3, 2.0, 0.8e-3]);
        assert!((Lu::new(&small, 2).distance(&other) - lu.distance(&b)).abs() < 1e-14);
        assert!(lu.distance(&[f64::NAN; 4]).is_nan());
    }
}
