//! Singular values and right singular vectors of a tall matrix, the same on every machine.

#![allow(
    clippy::inline_always,
    reason = "a function that is not inlined is compiled without the token's instruction set"
)]

use pulp::{Arch, Simd, WithSimd};

use crate::qr_update::reduce;

/// Singular values and right singular vectors of a matrix with n columns, the largest value first.
///
/// ```
/// use regen_identify::SingularValues;
///
/// // columns (3, 0) and (0, 4), one below the other
/// let decomposed = SingularValues::new(&[3.0, 0.0, 0.0, 4.0], 2);
/// assert_eq!(decomposed.values, [4.0, 3.0]);
/// assert_eq!(decomposed.vectors, [0.0, 1.0, 1.0, 0.0]);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct SingularValues {
    /// The n singular values, largest first.
    pub values: Vec<f64>,
    /// The right singular vectors in the same order, n x n: vector k starts at `k * n`.
    pub vectors: Vec<f64>,
}

impl SingularValues {
    /// Decomposes a matrix with `n` columns, column-major. Householder reflections reduce it to a
    /// triangle, then one-sided rotations (Hestenes, 1958) find small values with the same relative
    /// accuracy as large ones.
    pub fn new(w: &[f64], n: usize) -> Self {
        let rows = w.len().checked_div(n).unwrap_or(0);
        let mut r = vec![0.0; n * n];
        let (mut z, mut side) = (vec![0.0; n], vec![0.0; rows]);
        reduce(&mut r, &mut z, &mut w.to_vec(), &mut side, rows);
        Self::of_square(&r, n)
    }

    /// Decomposes a square matrix of n columns, column-major.
    pub(crate) fn of_square(r: &[f64], n: usize) -> Self {
        // columns are padded by zeros, which rotations do not change
        let stride = n.next_multiple_of(LANES);
        let mut u = vec![0.0; n * stride];
        let mut v = vec![0.0; n * stride];
        for k in 0..n {
            u[k * stride..k * stride + n].copy_from_slice(&r[k * n..(k + 1) * n]);
            v[k * stride + k] = 1.0;
        }
        for _ in 0..60 {
            if !Arch::new().dispatch(Sweep(&mut u, &mut v, stride)) {
                break;
            }
        }
        let lengths: Vec<f64> = u
            .chunks_exact(stride.max(1))
            .map(|column| column.iter().map(|x| x * x).sum::<f64>().sqrt())
            .collect();
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|a, b| lengths[*b].total_cmp(&lengths[*a]));
        Self {
            values: order.iter().map(|k| lengths[*k]).collect(),
            vectors: order
                .iter()
                .flat_map(|k| v[k * stride..k * stride + n].iter().copied())
                .collect(),
        }
    }

    /// The condition number: the largest singular value over the smallest; infinite where the
    /// smallest is 0.
    pub fn condition(&self) -> f64 {
        match (self.values.first(), self.values.last()) {
            (Some(&largest), Some(&smallest)) if smallest > 0.0 => largest / smallest,
            _ => f64::INFINITY,
        }
    }
}

/// The number of partial sums of each sum: the same for every instruction set, so that all give the
/// same bits.
const LANES: usize = 8;

/// A sweep as a task for one instruction set: the matrix, the rotations, and the padded length of
/// their columns.
struct Sweep<'a>(&'a mut [f64], &'a mut [f64], usize);

impl WithSimd for Sweep<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> bool {
        sweep(self.0, self.1, self.2)
    }
}

/// Makes each pair of columns orthogonal in turn; returns whether any pair had to be rotated.
#[inline(always)]
fn sweep(u: &mut [f64], v: &mut [f64], stride: usize) -> bool {
    let mut rotated = false;
    let columns = u.len().checked_div(stride).unwrap_or(0);
    for p in 0..columns {
        for q in p + 1..columns {
            let (a, b, c) = products(
                &u[p * stride..(p + 1) * stride],
                &u[q * stride..(q + 1) * stride],
            );
            if c * c <= 1e-30 * a * b || c == 0.0 || !c.is_finite() {
                continue;
            }
            rotated = true;
            let zeta = (b - a) / (2.0 * c);
            let tan = 1.0_f64.copysign(zeta) / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
            let cos = 1.0 / (1.0 + tan * tan).sqrt();
            let sin = cos * tan;
            for matrix in [&mut *u, &mut *v] {
                let (first, second) = matrix.split_at_mut(q * stride);
                let (x, y) = (
                    &mut first[p * stride..(p + 1) * stride],
                    &mut second[..stride],
                );
                for i in 0..x.len().min(y.len()) {
                    let (a, b) = (x[i], y[i]);
                    x[i] = cos * a - sin * b;
                    y[i] = sin * a + cos * b;
                }
            }
        }
    }
    rotated
}

/// The squared lengths of two columns, and their product.
#[inline(always)]
fn products(x: &[f64], y: &[f64]) -> (f64, f64, f64) {
    let (mut a, mut b, mut c) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    let ((x, _), (y, _)) = (x.as_chunks::<LANES>(), y.as_chunks::<LANES>());
    for k in 0..x.len().min(y.len()) {
        for l in 0..LANES {
            let (x, y) = (x[k][l], y[k][l]);
            a[l] += x * x;
            b[l] += y * y;
            c[l] += x * y;
        }
    }
    (a.iter().sum(), b.iter().sum(), c.iter().sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_and_vectors_are_those_of_the_matrix() {
        // columns of lengths 3, 1e-9 and 2 along rotated axes
        let (c, s) = (0.8, 0.6);
        let w = [
            3.0 * c,
            3.0 * s,
            0.0,
            0.0, //
            -1e-9 * s,
            1e-9 * c,
            0.0,
            0.0, //
            0.0,
            0.0,
            0.0,
            2.0,
        ];
        let found = SingularValues::new(&w, 3);
        for (value, known) in found.values.iter().zip([3.0, 2.0, 1e-9]) {
            assert!((value / known - 1.0).abs() < 1e-6, "{value}");
        }
        assert!((found.vectors[0].abs() - 1.0).abs() < 1e-12);
        assert!((found.condition() / 3e9 - 1.0).abs() < 1e-6);
        // a matrix of rank 1
        assert!(SingularValues::new(&[1.0, 2.0, 2.0, 4.0], 2).condition() > 1e15);
    }
}
