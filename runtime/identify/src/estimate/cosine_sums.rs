//! Sums of scores over blocks of time, multiplied by cosines: what the covariance of an estimate is made of.
#![allow(
    clippy::inline_always,
    reason = "a function that is not inlined is compiled without the token's instruction set"
)]

use core::f64::consts::{PI, SQRT_2};

use pulp::Arch;

use super::scores::Block;

/// cos(pi m s) at the middle s of each block, m = 0, 1, ..., with s from 0 to 1 over the log.
pub(super) struct Cosines {
    count: usize,
    values: Vec<f64>,
}

impl Cosines {
    pub(super) fn new(blocks: &[Block], samples: usize, most: usize) -> Self {
        let count = blocks.len();
        let mut values = vec![0.0; count * (most + 1)];
        let mut before = 0;
        for (b, block) in blocks.iter().enumerate() {
            let middle = (before as f64 + 0.5 * block.samples as f64) / samples as f64;
            for m in 0..=most {
                values[m * count + b] = libm::cos(PI * m as f64 * middle);
            }
            before += block.samples;
        }
        Self { count, values }
    }

    fn of_order(&self, m: usize) -> &[f64] {
        &self.values[m * self.count..(m + 1) * self.count]
    }
}

/// The blocks with the cosines and B, by which the sum of the scores gives the error of the estimate, over
/// the parameters of an estimate.
pub(super) struct Sums<'a> {
    pub(super) blocks: &'a [Block],
    /// The number of parameters of the blocks.
    pub(super) n: usize,
    /// The indices of the estimate's k parameters among those of the blocks.
    pub(super) kept: &'a [usize],
    /// B, k x k, row by row.
    pub(super) bread: &'a [f64],
    pub(super) cosines: &'a Cosines,
}

impl Sums<'_> {
    /// The cosine transforms of the parameters: `sqrt(2) B sum cos_j score`, j from 1; one list of
    /// k entries for each cosine.
    pub(super) fn transforms(&self, terms: usize, step: &[f64]) -> Vec<Vec<f64>> {
        let k = self.kept.len();
        let mut out = vec![vec![0.0; k]; terms];
        for (b, block) in self.blocks.iter().enumerate() {
            let score = self.score(block, step);
            for (j, sum) in out.iter_mut().enumerate() {
                let cosine = SQRT_2 * self.cosines.of_order(j + 1)[b];
                for (x, own) in sum.iter_mut().zip(&score) {
                    *x += cosine * own;
                }
            }
        }
        for x in &mut out {
            *x = self.solved(x);
        }
        out
    }

    /// The sum of the scores of a block, of the kept parameters, after a step of all parameters.
    pub(super) fn score(&self, block: &Block, step: &[f64]) -> Vec<f64> {
        let own = self.kept.iter().map(|&i| {
            let slope = &block.slope[i * self.n..(i + 1) * self.n];
            let moved: f64 = slope.iter().zip(step).map(|(s, x)| s * x).sum();
            block.score[i] - moved
        });
        own.collect()
    }

    /// B x.
    pub(super) fn solved(&self, x: &[f64]) -> Vec<f64> {
        let rows = self.bread.chunks_exact(self.kept.len().max(1));
        rows.map(|row| dot(row, x)).collect()
    }

    /// `B sum cos_m P B^T` with the expected variance P of each block: entry (a, b) at a k + b.
    pub(super) fn expected(&self, m: usize) -> Vec<f64> {
        let k = self.kept.len();
        let mut transposed = vec![0.0; k * k];
        for (i, row) in self.bread.chunks_exact(k.max(1)).enumerate() {
            for (j, x) in row.iter().enumerate() {
                transposed[j * k + i] = *x;
            }
        }
        product(&self.half_expected(m), &transposed, k)
    }

    /// The diagonal of [`expected`](Self::expected), in less time.
    pub(super) fn expected_variances(&self, m: usize) -> Vec<f64> {
        let k = self.kept.len().max(1);
        let half = self.half_expected(m);
        let rows = half.chunks_exact(k).zip(self.bread.chunks_exact(k));
        rows.map(|(half, row)| dot(half, row)).collect()
    }

    /// `B sum cos_m P`.
    fn half_expected(&self, m: usize) -> Vec<f64> {
        let sum = self.sum(m, |block| &block.expected, |i, j| (i.min(j), i.max(j)));
        product(self.bread, &sum, self.kept.len())
    }

    /// `sqrt(2) B sum cos_j D`, with D the slope of each block: the change of the transform with
    /// the fitted parameters.
    pub(super) fn removed(&self, j: usize) -> Vec<f64> {
        let mut sum = self.sum(j, |block| &block.slope, |i, l| (i, l));
        for x in &mut sum {
            *x *= SQRT_2;
        }
        product(self.bread, &sum, self.kept.len())
    }

    /// The sum over the blocks of cos_m times one of their matrices, of the kept parameters, k x k, row by row.
    ///
    /// - `place`: where an entry is stored.
    fn sum(
        &self,
        m: usize,
        matrix: impl Fn(&Block) -> &[f64],
        place: impl Fn(usize, usize) -> (usize, usize),
    ) -> Vec<f64> {
        let mut all = vec![0.0; self.n * self.n];
        for (block, cosine) in self.blocks.iter().zip(self.cosines.of_order(m)) {
            add_scaled(&mut all, *cosine, matrix(block));
        }
        let mut out = Vec::with_capacity(self.kept.len() * self.kept.len());
        for &i in self.kept {
            out.extend(self.kept.iter().map(|&j| {
                let (row, column) = place(i, j);
                all[row * self.n + column]
            }));
        }
        out
    }
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// The product of two k x k matrices, both row by row.
fn product(a: &[f64], b: &[f64], k: usize) -> Vec<f64> {
    let mut out = vec![0.0; k * k];
    for (row, into) in a.chunks_exact(k.max(1)).zip(out.chunks_exact_mut(k.max(1))) {
        for (x, other) in row.iter().zip(b.chunks_exact(k.max(1))) {
            add_scaled(into, *x, other);
        }
    }
    out
}

/// Adds `factor x` to a sum, several entries at a time; products are rounded before they are added, so that
/// the bits are the same on any machine.
fn add_scaled(sum: &mut [f64], factor: f64, x: &[f64]) {
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for (sum, x) in sum.iter_mut().zip(x) {
                *sum += factor * x;
            }
        },
    );
}

/// What the transforms of noise with the autocorrelation of the residuals are expected to be.
pub(super) struct ExpectedTransforms {
    k: usize,
    terms: usize,
    /// [`Sums::expected`] of orders 0 to `terms`.
    expected: Vec<Vec<f64>>,
    /// [`Sums::expected_variances`] of orders 0 to 2 `terms`.
    variances: Vec<Vec<f64>>,
    /// [`Sums::removed`] of orders 1 to `terms`.
    removed: Vec<Vec<f64>>,
    /// The same times the covariance of all parameters.
    through: Vec<Vec<f64>>,
}

impl ExpectedTransforms {
    pub(super) fn new(sums: &Sums<'_>, terms: usize) -> Self {
        let k = sums.kept.len();
        let expected: Vec<Vec<f64>> = (0..=terms).map(|m| sums.expected(m)).collect();
        let diagonal = |matrix: &Vec<f64>| matrix.iter().step_by(k + 1).copied().collect();
        let known = expected.iter().map(diagonal);
        let more = (terms + 1..=2 * terms).map(|m| sums.expected_variances(m));
        let variances = known.chain(more).collect();
        let removed: Vec<Vec<f64>> = (1..=terms).map(|j| sums.removed(j)).collect();
        let through = removed.iter().map(|own| match expected.first() {
            Some(covariance) => product(own, covariance, k),
            None => Vec::new(),
        });
        Self {
            k,
            terms,
            through: through.collect(),
            expected,
            variances,
            removed,
        }
    }

    /// The covariance of all parameters, k x k.
    pub(super) fn covariance(&self) -> &[f64] {
        self.expected.first().map_or(&[], |own| own)
    }

    /// The covariance of the transforms of parameter `a` that the fit leaves; terms x terms.
    pub(super) fn covariance_of_transforms(&self, a: usize) -> Vec<f64> {
        let Self { k, terms, .. } = *self;
        let row = |matrix: &'_ [f64]| -> Vec<f64> { matrix[a * k..(a + 1) * k].to_vec() };
        let rows = |matrices: &[Vec<f64>]| -> Vec<Vec<f64>> {
            matrices.iter().map(|matrix| row(matrix)).collect()
        };
        let slopes = rows(&self.removed);
        let own = rows(&self.expected[1..]);
        // the loss by the fit, times the covariance of all parameters
        let through = rows(&self.through);
        let at = |m: usize| self.variances[m][a];
        let mut out = vec![0.0; terms * terms];
        for i in 0..terms {
            for j in 0..=i {
                // sqrt(2) cos i sqrt(2) cos j = cos (i - j) + cos (i + j)
                let plain = at(i - j) + at(i + j + 2);
                let crossed = SQRT_2 * (dot(&slopes[i], &own[j]) + dot(&slopes[j], &own[i]));
                let value = plain - crossed + dot(&slopes[i], &through[j]);
                out[i * terms + j] = value;
                out[j * terms + i] = value;
            }
        }
        out
    }
}
