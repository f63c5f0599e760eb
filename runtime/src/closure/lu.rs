//! A small dense factorisation, to compare the columns of A that belong to the dependent
//! coordinates between two states.

use alloc::vec;
use alloc::vec::Vec;

use crate::Scalar;

/// P A D^-1 = L U with partial pivoting, D the columns' largest entries: the comparison of
/// two matrices below then does not depend on the units of the coordinates.
///
/// A may have more rows than columns. The pivots then choose as many rows as there are columns,
/// and those that are left follow from them in a closed state: where loops are redundant, one
/// may be at its dead centre while another one holds the bodies.
#[derive(Clone, Debug)]
pub(super) struct Lu {
    size: usize,
    /// L below the diagonal, U on and above it, row-major, of the chosen rows.
    factors: Vec<f64>,
    /// The rows of A that were chosen, in the order of the pivots.
    rows: Vec<usize>,
    scale: Vec<f64>,
}

impl Lu {
    /// Factors a row-major matrix of `size` columns and at least as many rows.
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
            rows: (0..matrix.len() / size.max(1)).collect(),
            scale,
        };
        for k in 0..size {
            lu.pivot(k);
        }
        lu.rows.truncate(size);
        lu.factors.truncate(size * size);
        lu
    }

    fn pivot(&mut self, k: usize) {
        let n = self.size;
        let best = (k..self.rows.len()).fold(k, |best, i| {
            let larger = self.factors[i * n + k].abs() > self.factors[best * n + k].abs();
            if larger { i } else { best }
        });
        if best != k {
            for j in 0..n {
                self.factors.swap(k * n + j, best * n + j);
            }
            self.rows.swap(k, best);
        }
        let pivot = self.factors[k * n + k];
        for i in k + 1..self.rows.len() {
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

    /// Replaces b by the solution of A x = b, where A is square.
    pub(super) fn solve(&self, b: &mut [f64]) {
        let ordered: Vec<f64> = self.rows.iter().map(|row| b[*row]).collect();
        b.copy_from_slice(&ordered);
        self.substitute(b);
        for (x, scale) in b.iter_mut().zip(&self.scale) {
            if *scale > 0.0 {
                *x /= scale;
            }
        }
    }

    /// Replaces b by the solution of L U x = b.
    fn substitute(&self, b: &mut [f64]) {
        let n = self.size;
        for i in 0..n {
            let known = (0..i).map(|j| self.factors[i * n + j] * b[j]).sum::<f64>();
            b[i] -= known;
        }
        for i in (0..n).rev() {
            let known = (i + 1..n)
                .map(|j| self.factors[i * n + j] * b[j])
                .sum::<f64>();
            b[i] = (b[i] - known) / self.factors[i * n + i];
        }
    }

    /// The largest row sum of |D A^-1 B D^-1 - I| over the chosen rows of both. Below 1, every
    /// matrix on the straight line from A to B is regular in these rows.
    pub(super) fn distance(&self, other: &[f64]) -> f64 {
        let n = self.size;
        let other = scaled(other, &self.scale);
        let mut sums = vec![0.0; n];
        let mut x = vec![0.0; n];
        for column in 0..n {
            for (x, row) in x.iter_mut().zip(&self.rows) {
                *x = other[row * n + column];
            }
            self.substitute(&mut x);
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
    fn the_solution_solves_the_system_in_the_units_of_its_columns() {
        let mut x = [3.0e-3, 5.0];
        Lu::new(&[0.0, 3e-3, 2.0, 1e-3], 2).solve(&mut x);
        assert!((x[0] - 2.4995).abs() < 1e-14 && (x[1] - 1.0).abs() < 1e-14);
    }

    #[test]
    fn redundant_rows_stand_in_for_a_vanishing_pivot() {
        // The first two rows alone are singular.
        let tall = [1.0, 2.0, 2.0, 4.0, 0.0, 3.0];
        let lu = Lu::new(&tall, 2);
        assert!(lu.ratio() > 0.5);
        assert!(lu.distance(&tall) < 1e-15);
        let near = tall.map(|x| 1.25 * x);
        assert!((lu.distance(&near) - 0.25).abs() < 1e-15);
        // All rows together lose a column.
        assert!(Lu::new(&[1.0, 2.0, 2.0, 4.0, 3.0, 6.0], 2).ratio() < 1e-15);
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
