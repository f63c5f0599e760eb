//! Singular values and right singular vectors of a tall matrix, the same on every machine.

use crate::qr_update::reduce;

/// Singular values and right singular vectors of a matrix with n columns, the largest value first.
///
/// ```
/// use regen_identify::SingularValues;
///
/// // columns (3, 0) and (0, 4), one below the other
/// let found = SingularValues::new(&[3.0, 0.0, 0.0, 4.0], 2);
/// assert_eq!(found.values, [4.0, 3.0]);
/// assert_eq!(found.vectors, [0.0, 1.0, 1.0, 0.0]);
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
        Self::of_square(r, n)
    }

    /// Decomposes a square matrix of n columns, column-major.
    pub(crate) fn of_square(mut r: Vec<f64>, n: usize) -> Self {
        let mut v = vec![0.0; n * n];
        for k in 0..n {
            v[k * n + k] = 1.0;
        }
        for _ in 0..60 {
            if !sweep(&mut r, &mut v, n) {
                break;
            }
        }
        let lengths: Vec<f64> = r
            .chunks_exact(n.max(1))
            .map(|column| column.iter().map(|x| x * x).sum::<f64>().sqrt())
            .collect();
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|a, b| lengths[*b].total_cmp(&lengths[*a]));
        Self {
            values: order.iter().map(|k| lengths[*k]).collect(),
            vectors: order
                .iter()
                .flat_map(|k| v[k * n..(k + 1) * n].iter().copied())
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

/// Makes each pair of columns orthogonal in turn; returns whether any pair was not.
fn sweep(u: &mut [f64], v: &mut [f64], n: usize) -> bool {
    let mut turned = false;
    for p in 0..n {
        for q in p + 1..n {
            let (mut a, mut b, mut c) = (0.0, 0.0, 0.0);
            for i in 0..n {
                let (x, y) = (u[p * n + i], u[q * n + i]);
                a += x * x;
                b += y * y;
                c += x * y;
            }
            if c * c <= 1e-30 * a * b || c == 0.0 || !c.is_finite() {
                continue;
            }
            turned = true;
            let zeta = (b - a) / (2.0 * c);
            let tan = 1.0_f64.copysign(zeta) / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
            let cos = 1.0 / (1.0 + tan * tan).sqrt();
            let sin = cos * tan;
            for matrix in [&mut *u, &mut *v] {
                for i in 0..n {
                    let (x, y) = (matrix[p * n + i], matrix[q * n + i]);
                    matrix[p * n + i] = cos * x - sin * y;
                    matrix[q * n + i] = sin * x + cos * y;
                }
            }
        }
    }
    turned
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
