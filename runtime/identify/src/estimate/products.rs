//! Sums of outer products, several samples at a time in vector registers.
#![allow(
    clippy::inline_always,
    reason = "a function that is not inlined is compiled without the token's instruction set"
)]

use pulp::{Arch, Simd, WithSimd};

/// The number of rows that are computed at a time. Rows and columns are padded to a multiple of it,
/// which is a multiple of the lanes of every vector register.
const ROWS: usize = 8;
/// The number of products that are collected before they are added.
const COLLECTED: usize = 64;

/// The sum of `a b^T` over many pairs of vectors, n x n.
///
/// Each entry is summed in the order of the pairs, each product rounded before it is added, so that
/// the bits are those of one pair added after the other, on any machine.
#[derive(Clone, Debug)]
pub(crate) struct OuterProducts {
    n: usize,
    /// The length of a padded row.
    stride: usize,
    /// Whether only the entries from the diagonal on are wanted.
    upper: bool,
    /// The vectors that are not yet added, padded.
    a: Vec<f64>,
    b: Vec<f64>,
    /// The sum of the pairs before them, in padded rows.
    sum: Vec<f64>,
}

impl OuterProducts {
    /// An empty sum; of a symmetric one (`upper`) only the entries from the diagonal on are
    /// computed.
    pub(crate) fn new(n: usize, upper: bool) -> Self {
        let stride = n.next_multiple_of(ROWS);
        Self {
            n,
            stride,
            upper,
            a: Vec::with_capacity(COLLECTED * stride),
            b: Vec::with_capacity(COLLECTED * stride),
            sum: vec![0.0; stride * stride],
        }
    }

    /// Adds a pair of vectors of n entries.
    pub(crate) fn push(&mut self, a: &[f64], b: &[f64]) {
        let end = self.a.len() + self.stride;
        self.a.extend_from_slice(&a[..self.n]);
        self.b.extend_from_slice(&b[..self.n]);
        self.a.resize(end, 0.0);
        self.b.resize(end, 0.0);
        if end >= COLLECTED * self.stride {
            self.add();
        }
    }

    fn add(&mut self) {
        Arch::new().dispatch(Add(self));
        self.a.clear();
        self.b.clear();
    }

    /// Returns the sum, row by row, and starts an empty one; entries before the diagonal of a
    /// symmetric sum are not filled.
    pub(crate) fn take(&mut self) -> Vec<f64> {
        self.add();
        let mut out = Vec::with_capacity(self.n * self.n);
        for row in self.sum.chunks_exact(self.stride.max(1)).take(self.n) {
            out.extend_from_slice(&row[..self.n]);
        }
        self.sum.fill(0.0);
        out
    }

    /// Continues a sum that [`take`](Self::take) returned.
    pub(super) fn set(&mut self, sum: &[f64]) {
        self.a.clear();
        self.b.clear();
        self.sum.fill(0.0);
        let rows = self.sum.chunks_exact_mut(self.stride.max(1));
        for (own, row) in rows.zip(sum.chunks_exact(self.n.max(1))) {
            own[..self.n].copy_from_slice(row);
        }
    }
}

/// The collected products as a task for one instruction set.
struct Add<'a>(&'a mut OuterProducts);

impl WithSimd for Add<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let OuterProducts {
            stride,
            upper,
            a,
            b,
            sum,
            ..
        } = self.0;
        let (stride, words) = (*stride, *stride / S::F64_LANES);
        if stride == 0 {
            return;
        }
        let (b, _) = S::as_simd_f64s(b);
        let (sum, _) = S::as_mut_simd_f64s(sum);
        for (block, rows) in sum.chunks_exact_mut(ROWS * words).enumerate() {
            let first = block * ROWS;
            let start = if *upper { first / S::F64_LANES } else { 0 };
            for word in start..words {
                let mut sums = [simd.splat_f64s(0.0); ROWS];
                for row in 0..ROWS {
                    sums[row] = rows[row * words + word];
                }
                for (a, b) in a.chunks_exact(stride).zip(b.chunks_exact(words)) {
                    let Some(a) = a[first..].first_chunk::<ROWS>() else {
                        continue;
                    };
                    let b = b[word];
                    for row in 0..ROWS {
                        let product = simd.mul_f64s(simd.splat_f64s(a[row]), b);
                        sums[row] = simd.add_f64s(sums[row], product);
                    }
                }
                for row in 0..ROWS {
                    rows[row * words + word] = sums[row];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_have_the_bits_of_one_pair_after_the_other() {
        for n in [1, 4, 7, 8, 34] {
            let value = |k: usize, i: usize| ((k * 31 + i * 17) as f64).sin();
            let mut sums = OuterProducts::new(n, false);
            let mut upper = OuterProducts::new(n, true);
            let (mut all, mut symmetric) = (vec![0.0; n * n], vec![0.0; n * n]);
            for k in 0..150 {
                let (a, b) = (|i| value(k, i), |i| value(k + 1000, i));
                let (first, second): (Vec<f64>, Vec<f64>) = (0..n).map(|i| (a(i), b(i))).unzip();
                sums.push(&first, &second);
                upper.push(&first, &first);
                for i in 0..n {
                    for j in 0..n {
                        all[i * n + j] += a(i) * b(j);
                        symmetric[i * n + j] += a(i) * a(j);
                    }
                }
                if k == 70 {
                    // after `take`, `set` continues the sum
                    let own = sums.take();
                    sums.set(&own);
                }
            }
            assert_eq!(sums.take(), all);
            let found = upper.take();
            for i in 0..n {
                assert_eq!(
                    found[i * n + i..(i + 1) * n],
                    symmetric[i * n + i..(i + 1) * n]
                );
            }
            assert!(sums.take().iter().all(|x| *x == 0.0));
        }
    }
}
