//! A small dense LU factorisation, to compare the columns of A that belong to the dependent
//! coordinates between two states.

use alloc::vec;
use alloc::vec::Vec;

use crate::Scalar;

/// P A D^-1 = L U with partial pivoting. D holds the largest entry of each column, so that
/// comparing two matrices does not depend on the units of the coordinates.
///
/// A may have more rows than columns. The pivots then select as many rows as there are columns; in
/// a closed state the other rows depend on these. With redundant loops, one loop may be at its dead
/// centre while another one still holds the bodies.
#[derive(Clone, Debug)]
pub(super) struct Lu {
    size: usize,
    /// L below the diagonal, U on and above it, row-major, of the chosen rows.
    factors: Vec<f64>,
    /// The rows of A that the pivots selected, in the order of the pivots.
    rows: Vec<usize>,
    scale: Vec<f64>,
}

impl Lu {
    /// Factors a row-major matrix of `size` columns and at least as many rows.
    pub(super) fn new(matrix: &[f64], size: usize) -> Self {
        let mut scale = vec![0.0_f64; size];
        for row in rows(matrix, size) {
            for (largest, entry) in scale.iter_mut().zip(row) {
                *largest = largest.max(entry.abs());
            }
        }
        let mut lu = Self {
            size,
            factors: scaled(matrix, &scale),
            rows: (0..rows(matrix, size).count()).collect(),
            scale,
        };
        for k in 0..size {
            lu.pivot(k);
        }
        lu.rows.truncate(size);
        lu.factors.truncate(size * size);
        lu
    }

    /// An entry of the factors; NaN if it does not exist.
    fn at(&self, i: usize, j: usize) -> f64 {
        entry(&self.factors, i * self.size + j)
    }

    fn pivot(&mut self, k: usize) {
        let n = self.size;
        let best = (k..self.rows.len()).fold(k, |best, i| {
            let larger = self.at(i, k).abs() > self.at(best, k).abs();
            if larger { i } else { best }
        });
        if best > k {
            for j in 0..n {
                exchange(&mut self.factors, k * n + j, best * n + j);
            }
            exchange(&mut self.rows, k, best);
        }
        let pivot = self.at(k, k);
        let Some((done, open)) = self.factors.split_at_mut_checked((k + 1) * n) else {
            return;
        };
        let first = done.get(k * n..).unwrap_or_default();
        for row in rows_mut(open, n) {
            let (Some(head), Some(top)) = (row.get_mut(k..), first.get(k..)) else {
                return;
            };
            let (Some((entry, rest)), Some((_, top))) = (head.split_first_mut(), top.split_first())
            else {
                return;
            };
            *entry /= pivot;
            for (x, y) in rest.iter_mut().zip(top) {
                *x -= *entry * y;
            }
        }
    }

    /// The ratio of the smallest to the largest pivot; 1 for an empty matrix, NaN if the matrix is
    /// not finite.
    pub(super) fn ratio(&self) -> f64 {
        let pivots = || (0..self.size).map(|k| self.at(k, k).abs());
        let largest = pivots().fold(0.0, f64::max);
        pivots().fold(1.0, |m, pivot| Scalar::min(m, pivot / largest))
    }

    /// The reciprocal condition number in the largest row sum of the selected rows with scaled
    /// columns: 1 at best, 0 or NaN where they are singular. It may be small although no pivot is.
    pub(super) fn reciprocal_condition(&self) -> f64 {
        let n = self.size;
        let (mut sums, mut sizes) = (vec![0.0; n], vec![0.0; n]);
        let mut x = vec![0.0; n];
        for column in 0..n {
            // column of A D^-1, computed as L U e, and column of its inverse
            for (i, size) in sizes.iter_mut().enumerate() {
                let known = (0..i.min(column + 1)).map(|k| self.at(i, k) * self.at(k, column));
                let own = if i <= column { self.at(i, column) } else { 0.0 };
                *size += (known.sum::<f64>() + own).abs();
            }
            x.fill(0.0);
            if let Some(x) = x.get_mut(column) {
                *x = 1.0;
            }
            self.substitute(&mut x);
            for (sum, x) in sums.iter_mut().zip(&x) {
                *sum += x.abs();
            }
        }
        let largest = |m: f64, x: f64| if x <= m || m.is_nan() { m } else { x };
        let norms = sums.into_iter().fold(0.0, largest) * sizes.into_iter().fold(0.0, largest);
        if n == 0 { 1.0 } else { 1.0 / norms }
    }

    /// Replaces b by the solution of A x = b, where A is square.
    pub(super) fn solve(&self, b: &mut [f64]) {
        let ordered: Vec<f64> = self.rows.iter().map(|row| entry(b, *row)).collect();
        for (b, ordered) in b.iter_mut().zip(&ordered) {
            *b = *ordered;
        }
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
        for (i, row) in rows(&self.factors, n).enumerate() {
            let known = row
                .iter()
                .zip(b.iter())
                .take(i)
                .map(|(l, x)| l * x)
                .sum::<f64>();
            if let Some(x) = b.get_mut(i) {
                *x -= known;
            }
        }
        for i in (0..n).rev() {
            let row = self.factors.iter().skip(i * n).take(n);
            let known = row
                .zip(b.iter())
                .skip(i + 1)
                .map(|(u, x)| u * x)
                .sum::<f64>();
            let pivot = self.at(i, i);
            if let Some(x) = b.get_mut(i) {
                *x = (*x - known) / pivot;
            }
        }
    }

    /// The largest row sum of |D A^-1 B D^-1 - I| over the selected rows of both. Below 1, every
    /// matrix on the straight line from A to B is regular in these rows.
    pub(super) fn distance(&self, other: &[f64]) -> f64 {
        let n = self.size;
        let other = scaled(other, &self.scale);
        let mut sums = vec![0.0; n];
        let mut x = vec![0.0; n];
        for column in 0..n {
            for (x, row) in x.iter_mut().zip(&self.rows) {
                *x = entry(&other, row * n + column);
            }
            self.substitute(&mut x);
            if let Some(x) = x.get_mut(column) {
                *x -= 1.0;
            }
            for (sum, x) in sums.iter_mut().zip(&x) {
                *sum += x.abs();
            }
        }
        // a fold that keeps NaN: it must not count as a small distance
        sums.into_iter()
            .fold(0.0, |m, sum| if sum <= m || m.is_nan() { m } else { sum })
    }
}

/// The matrix with its columns divided by `scale`; zero columns stay zero.
fn scaled(matrix: &[f64], scale: &[f64]) -> Vec<f64> {
    let mut scaled = matrix.to_vec();
    for row in rows_mut(&mut scaled, scale.len()) {
        for (entry, scale) in row.iter_mut().zip(scale) {
            if *scale > 0.0 {
                *entry /= scale;
            }
        }
    }
    scaled
}

/// The entry at an index; NaN if there is none, so that a wrong index cannot give a solution.
pub(super) fn entry(values: &[f64], at: usize) -> f64 {
    values.get(at).copied().unwrap_or(f64::NAN)
}

/// The rows of a row-major matrix of `size` columns; none where `size` is 0.
///
/// Used instead of `chunks_exact`, whose check of the chunk size stays in the compiled code of some
/// controllers.
pub(super) fn rows(matrix: &[f64], size: usize) -> impl Iterator<Item = &[f64]> {
    let mut rest = matrix;
    core::iter::from_fn(move || {
        let (row, below) = rest
            .split_at_checked(size)
            .filter(|(row, _)| !row.is_empty())?;
        rest = below;
        Some(row)
    })
}

/// As [`rows`], mutable.
pub(super) fn rows_mut(matrix: &mut [f64], size: usize) -> impl Iterator<Item = &mut [f64]> {
    let mut rest = matrix;
    core::iter::from_fn(move || {
        let all = core::mem::take(&mut rest);
        let (row, below) = all
            .split_at_mut_checked(size)
            .filter(|(row, _)| !row.is_empty())?;
        rest = below;
        Some(row)
    })
}

fn exchange<T>(values: &mut [T], i: usize, j: usize) {
    if i < values.len() && j < values.len() {
        values.swap(i, j);
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;
    use core::cmp::Ordering;

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
        // The columns of all three rows are dependent.
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
    fn the_condition_sees_what_no_single_pivot_shows() {
        let of = |matrix: &[f64], size| Lu::new(matrix, size).reciprocal_condition();
        assert!((of(&[0.0, 3.0, 2.0, 0.0], 2) - 1.0).abs() < 1e-15);
        assert!((of(&[], 0) - 1.0).abs() < 1e-15);
        // Scaled, [1 1; 1 -0.5]: norms 2 and 4/3.
        assert!((of(&[2.0, 3.0, 2.0, -1.5], 2) - 0.375).abs() < 1e-15);
        assert!(of(&[1.0, 2.0, 2.0, 4.0], 2).abs() < 1e-15);
        assert!(of(&[f64::NAN, 1.0, 1.0, 0.0], 2).is_nan());
        // Kahan's example: a triangle whose pivots are all 1, and which is nearly singular.
        let n = 20;
        let entry = |i: usize, j: usize| match i.cmp(&j) {
            Ordering::Equal => 1.0,
            Ordering::Less => -1.0,
            Ordering::Greater => 0.0,
        };
        let triangle: Vec<f64> = (0..n * n).map(|k| entry(k / n, k % n)).collect();
        assert!(Lu::new(&triangle, n).ratio() > 0.9);
        assert!(of(&triangle, n) < 1e-6);
    }

    #[test]
    fn the_distance_is_relative_and_without_units() {
        let a = [0.0, 3.0, 2.0, 1.0];
        let lu = Lu::new(&a, 2);
        assert!(lu.distance(&a) < 1e-15);
        let near = a.map(|x| 1.25 * x);
        assert!((lu.distance(&near) - 0.25).abs() < 1e-15);
        // A matrix with a zero pivot has a distance of at least 1.
        assert!(lu.distance(&[0.0, 3.0, 0.0, 1.0]) >= 1.0 - 1e-15);
        // The second coordinate in millimetres.
        let b = [0.1, 3.0, 2.0, 0.8];
        let (small, other) = ([0.0, 3e-3, 2.0, 1e-3], [0.1, 3e-3, 2.0, 0.8e-3]);
        assert!((Lu::new(&small, 2).distance(&other) - lu.distance(&b)).abs() < 1e-14);
        assert!(lu.distance(&[f64::NAN; 4]).is_nan());
    }
}
