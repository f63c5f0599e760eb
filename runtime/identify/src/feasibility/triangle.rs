//! An upper triangular factor, stored row by row, to which rows that begin with zeros can be added.
#![allow(
    clippy::inline_always,
    reason = "a function that is not inlined is compiled without the token's instruction set"
)]

use pulp::Arch;

use crate::qr_update::{NOTHING, dot, reduce};

/// An upper triangular matrix R that represents `R^T R`, so that the signs of its rows are arbitrary.
#[derive(Clone, Debug)]
pub(super) struct Triangle {
    n: usize,
    /// n x n, row by row.
    rows: Vec<f64>,
}

impl Triangle {
    pub(super) fn zero(n: usize) -> Self {
        Self {
            n,
            rows: vec![0.0; n * n],
        }
    }

    /// The factor of dense rows, each times `factor`; entries after the first n are ignored.
    pub(super) fn of(rows: &[Vec<f64>], n: usize, factor: f64) -> Self {
        let tall = rows.len();
        let mut block = vec![0.0; n * tall];
        for (i, row) in rows.iter().enumerate() {
            for (column, x) in block.chunks_exact_mut(tall).zip(row) {
                column[i] = factor * x;
            }
        }
        Self::of_columns(block, n)
    }

    /// The factor of a matrix with n columns, column by column.
    pub(super) fn of_columns(mut block: Vec<f64>, n: usize) -> Self {
        let tall = block.len().checked_div(n).unwrap_or(0);
        let (mut r, mut none) = (vec![0.0; n * n], vec![0.0; n]);
        reduce(&mut r, &mut none, &mut block, &mut vec![0.0; tall], tall);
        let mut out = Self::zero(n);
        for (c, column) in r.chunks_exact(n.max(1)).enumerate() {
            for (i, x) in column.iter().enumerate() {
                out.rows[i * n + c] = *x;
            }
        }
        out
    }

    /// A factor whose rows are those of an n x n matrix from the diagonal on.
    pub(super) fn of_upper(rows: Vec<f64>, n: usize) -> Self {
        Self { n, rows }
    }

    /// Row k from its diagonal entry on.
    pub(super) fn row(&self, k: usize) -> &[f64] {
        &self.rows[k * self.n + k..(k + 1) * self.n]
    }

    /// Adds further rows.
    ///
    /// - `rows`: each with the n - first entries from column `first` on; overwritten.
    pub(super) fn add(&mut self, rows: &mut [f64], first: usize) {
        let n = self.n;
        if first < n {
            Arch::new().dispatch(
                #[inline(always)]
                || add_rows(&mut self.rows, n, rows, first),
            );
        }
    }

    /// Solves `R^T R x = g`; `None` if a diagonal entry is zero.
    pub(super) fn solve(&self, g: &[f64]) -> Option<Vec<f64>> {
        if (0..self.n).any(|k| self.row(k)[0] == 0.0) {
            return None;
        }
        let mut x = g.to_vec();
        Arch::new().dispatch(
            #[inline(always)]
            || substitute(&self.rows, self.n, &mut x),
        );
        Some(x)
    }
}

/// Solves `R^T R x = g` in place.
#[inline(always)]
fn substitute(triangle: &[f64], n: usize, x: &mut [f64]) {
    let row = |k: usize| &triangle[k * n + k..(k + 1) * n];
    for k in 0..n {
        let row = row(k);
        let (own, later) = x[k..].split_at_mut(1);
        own[0] /= row[0];
        for (y, r) in later.iter_mut().zip(&row[1..]) {
            *y -= own[0] * r;
        }
    }
    for k in (0..n).rev() {
        let row = row(k);
        let known = dot(&row[1..], &x[k + 1..]);
        x[k] = (x[k] - known) / row[0];
    }
}

#[inline(always)]
fn add_rows(triangle: &mut [f64], n: usize, rows: &mut [f64], first: usize) {
    let width = n - first;
    let mut sums = vec![0.0; width];
    for k in first..n {
        let at = k - first;
        let tail: f64 = rows.iter().skip(at).step_by(width).map(|x| x * x).sum();
        if tail < NOTHING {
            continue;
        }
        let own = &mut triangle[k * n + k..(k + 1) * n];
        let (pivot, own) = own.split_at_mut(1);
        let alpha = pivot[0];
        let norm = alpha.mul_add(alpha, tail).sqrt();
        // beta has the opposite sign of alpha, so that no digits cancel
        let beta = if alpha > 0.0 { -norm } else { norm };
        let head = alpha - beta;
        let scale = 1.0 / (-beta * head);
        pivot[0] = beta;
        let sums = &mut sums[..own.len()];
        for (sum, r) in sums.iter_mut().zip(&*own) {
            *sum = head * r;
        }
        let mut pairs = rows.chunks_exact(2 * width);
        for pair in &mut pairs {
            let (a, b) = pair.split_at(width);
            let (va, vb) = (a[at], b[at]);
            for ((sum, x), y) in sums.iter_mut().zip(&a[at + 1..]).zip(&b[at + 1..]) {
                *sum += va * x + vb * y;
            }
        }
        for row in pairs.remainder().chunks_exact(width) {
            let v = row[at];
            for (sum, x) in sums.iter_mut().zip(&row[at + 1..]) {
                *sum += v * x;
            }
        }
        for (sum, r) in sums.iter_mut().zip(own) {
            *sum *= scale;
            *r -= head * *sum;
        }
        for row in rows.chunks_exact_mut(width) {
            let v = row[at];
            for (x, sum) in row[at + 1..].iter_mut().zip(&*sums) {
                *x -= v * sum;
            }
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// Rows added one after the other, with zeros in front, give the normal equations of all rows.
    #[test]
    fn the_solution_is_that_of_the_normal_equations() {
        let n = 7;
        let entry = |i: usize, j: usize| ((3 * i + 1) as f64 * (j as f64 + 0.7)).sin();
        let dense: Vec<Vec<f64>> = (0..3)
            .map(|i| (0..n).map(|j| entry(i, j)).collect())
            .collect();
        let mut triangle = Triangle::of(&dense, n, 2.0);
        let mut all: Vec<Vec<f64>> = dense
            .iter()
            .map(|row| row.iter().map(|x| 2.0 * x).collect())
            .collect();
        for (first, count) in [(0, 3), (2, 4), (6, 1), (7, 1)] {
            let rows: Vec<Vec<f64>> = (0..count)
                .map(|i| (first..n).map(|j| entry(i + 11 * first, j)).collect())
                .collect();
            triangle.add(&mut rows.concat(), first);
            for row in rows {
                all.push([vec![0.0; first], row].concat());
            }
        }
        let g: Vec<f64> = (0..n).map(|j| entry(40, j)).collect();
        let x = triangle.solve(&g).unwrap();
        for (j, side) in g.iter().enumerate() {
            let dot = |row: &Vec<f64>| row.iter().zip(&x).map(|(a, b)| a * b).sum::<f64>();
            let product: f64 = all.iter().map(|row| row[j] * dot(row)).sum();
            assert!((product - side).abs() < 1e-10, "{product} {side}");
        }
        assert!(Triangle::zero(2).solve(&[1.0, 1.0]).is_none());
    }
}
