//! Random draws that are the same on every machine.

use super::LeastSquares;
use crate::estimate::Deviations;
use crate::feasibility::Known;

/// Decimals of the least-squares parameters that seed the draws: the same log gives the same
/// intervals on every machine, and another log other draws, so that the chance of some draws
/// is not the same for all logs.
const SEED_DECIMALS: usize = 6;

/// How draws are made.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Draws<'a> {
    pub(crate) replicates: usize,
    /// The seed of the random numbers, which should depend on the log alone.
    pub(crate) seed: u64,
    /// What the fit of the data themselves found, if it is known.
    pub(crate) known: Option<&'a Known>,
}

impl Draws<'_> {
    /// Draws that are seeded by the least-squares parameters.
    pub(crate) fn new(data: LeastSquares<'_>, replicates: usize) -> Self {
        Self {
            replicates,
            seed: seed(data.values),
            known: None,
        }
    }
}

/// A seed from the decimals of the parameters (FNV-1a hash).
pub(crate) fn seed(values: &[f64]) -> u64 {
    let texts = values.iter().map(|x| format!("{x:.SEED_DECIMALS$e}"));
    texts
        .flat_map(String::into_bytes)
        .fold(0xcbf2_9ce4_8422_2325, |hash: u64, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        })
}

/// Generator of random numbers that are the same on every machine (SplitMix64; Box and Muller).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    /// A uniform number between 0 and 1, neither included.
    pub(crate) fn part(&mut self) -> f64 {
        ((self.bits() >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    /// A standard normal number.
    pub(crate) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * libm::log(self.part())).sqrt();
        radius * libm::cos(core::f64::consts::TAU * self.part())
    }

    /// Draws of the difference between other logs' least-squares parameters and these, from
    /// Student's distribution, as the covariance is itself an estimate.
    ///
    /// As many draws as there are parameters have orthogonal directions, uniformly distributed:
    /// each draw alone is distributed as without that, and together they scatter alike in all
    /// directions, so that a standard deviation varies less.
    pub(crate) fn steps(
        &mut self,
        deviations: &Deviations,
        n: usize,
        count: usize,
    ) -> Vec<Vec<f64>> {
        // with more than a hundred degrees of freedom it is almost normal
        let freedom = deviations.terms.clamp(1, 100);
        let mut block: Vec<Vec<f64>> = Vec::with_capacity(n);
        let mut out = Vec::with_capacity(count);
        while out.len() < count {
            if block.len() >= n {
                block.clear();
            }
            let squares: f64 = (0..freedom).map(|_| self.normal().powi(2)).sum();
            let by = (freedom as f64 / squares).sqrt();
            let mut normal: Vec<f64> = (0..n).map(|_| self.normal()).collect();
            let length = norm(&normal);
            // twice, so that rounding leaves nothing of the earlier directions
            for _ in 0..2 {
                for earlier in &block {
                    let along: f64 = normal.iter().zip(earlier).map(|(x, y)| x * y).sum();
                    for (x, y) in normal.iter_mut().zip(earlier) {
                        *x -= along * y;
                    }
                }
            }
            let left = norm(&normal);
            for x in &mut normal {
                *x /= left;
            }
            let mut step = vec![0.0; n];
            for (column, x) in deviations.root().chunks_exact(n.max(1)).zip(&normal) {
                for (sum, l) in step.iter_mut().zip(column) {
                    *sum += l * (by * length * x);
                }
            }
            block.push(normal);
            out.push(step);
        }
        out
    }
}

/// Euclid's norm.
fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}
