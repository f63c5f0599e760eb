//! Sums over scores in blocks of time, from which covariances are made.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::factor::size;
use super::solution::inverse_gram;
use super::{Autoregression, EstimateError, QrFactor};

/// Blocks of time at most; where there would be more, neighbours are merged.
pub const BLOCKS: usize = 128;

/// One block's sums; n x n matrices column-major.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Block {
    /// Samples.
    pub(super) samples: usize,
    /// The scores' sum: `sum g eps`, n.
    pub(super) score: Vec<f64>,
    /// How it changes with the parameters: `-sum g v^T`, entry (i, j) of g_i and v_j.
    pub(super) slope: Vec<f64>,
    /// Its variance under the noise that residuals were found to be: `sum s^2 g g^T`, lower half.
    pub(super) expected: Vec<f64>,
}

impl Block {
    fn new(n: usize) -> Self {
        Self {
            samples: 0,
            score: vec![0.0; n],
            slope: vec![0.0; n * n],
            expected: vec![0.0; n * n],
        }
    }

    fn add(&mut self, other: &Self) {
        self.samples += other.samples;
        for (own, more) in [
            (&mut self.score, &other.score),
            (&mut self.slope, &other.slope),
            (&mut self.expected, &other.expected),
        ] {
            for (a, b) in own.iter_mut().zip(more) {
                *a += b;
            }
        }
    }
}

/// Scores summed in blocks of time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Blocks {
    pub(super) parameters: usize,
    /// The parameters that the residuals were taken at.
    pub(super) values: Vec<f64>,
    #[allow(clippy::struct_field_names, reason = "the blocks are all that is kept")]
    pub(super) blocks: Vec<Block>,
    /// Of the noise of each effort: how many samples are as good as one.
    pub(super) memory: f64,
    /// `W^T W` times a change of all parameters; none where there is none.
    #[serde(default)]
    pub(super) change: Vec<f64>,
}

impl Blocks {
    /// With a change of all parameters that is the same for all samples, such as what other
    /// derivatives would make of them: it counts as one deviation more, of estimates of some of the
    /// parameters too.
    ///
    /// - `factor`: weighted, over all parameters; `change`: one for each, in its unit.
    #[must_use]
    pub fn with_change(mut self, factor: &QrFactor, change: &[f64]) -> Self {
        let n = factor.columns();
        let columns = || factor.r().chunks_exact(n.max(1));
        let mut moved = vec![0.0; n];
        for (column, x) in columns().zip(change) {
            for (sum, r) in moved.iter_mut().zip(column) {
                *sum += r * x;
            }
        }
        let score = |column: &[f64]| column.iter().zip(&moved).map(|(r, x)| r * x).sum();
        self.change = columns().map(score).collect();
        self
    }

    /// By how much the parameters of a factor would change: `(W^T W)^-1` times the scores of
    /// [`with_change`](Self::with_change); none where there are none, or the factor is singular.
    ///
    /// - `kept`: the places of the factor's parameters among all.
    pub fn change(&self, factor: &QrFactor, kept: &[usize]) -> Vec<f64> {
        let own = kept.iter().map(|k| self.change.get(*k).copied());
        let (Some(own), Some(gram)) = (own.collect::<Option<Vec<f64>>>(), inverse_gram(factor))
        else {
            return Vec::new();
        };
        let rows = gram.chunks_exact(own.len().max(1));
        rows.map(|row| row.iter().zip(&own).map(|(a, b)| a * b).sum())
            .collect()
    }

    /// The samples that were added.
    pub fn samples(&self) -> usize {
        self.blocks.iter().map(|b| b.samples).sum()
    }

    /// How many blocks there are.
    pub fn len(&self) -> usize {
        self.blocks.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.blocks.is_empty()
    }

    /// The samples that are as good as one independent sample, for the effort whose noise
    /// remembers longest.
    pub fn memory(&self) -> f64 {
        self.memory
    }
}

/// A sample that waits for those after it.
#[derive(Clone, Debug, Default)]
struct PendingSample {
    /// Efforts x n, effort by effort.
    w: Vec<f64>,
    /// The same times the slope of psi.
    v: Vec<f64>,
    psi: Vec<f64>,
}

/// Collects the scores `w psi(e)` of an estimate in order of time, in memory that does not grow.
///
/// Where the noise of an effort is an autoregression, `e = F^-1 eps` with F upper triangular (each
/// value from those after it), the sum of scores is `W^T e = (F^-T W)^T eps`: the same sum, of
/// terms `g eps` that are independent of each other. So the sum's variance is found from scores
/// that are nearly white (prewhitened, as Andrews and Monahan, 1992, do with an autoregression of
/// the scores), whatever the autoregression: it decides how white they are, not what they add
/// up to.
#[derive(Clone, Debug)]
pub struct Scores {
    n: usize,
    noise: Vec<Autoregression>,
    order: usize,
    waiting: VecDeque<PendingSample>,
    spare: Vec<PendingSample>,
    /// For each effort, the last regressors behind F^-T, the newest first.
    past: Vec<VecDeque<Vec<f64>>>,
    whitened: Vec<f64>,
    /// Samples in a full block.
    length: usize,
    current: Block,
    blocks: Vec<Block>,
}

impl Scores {
    /// Starts for n parameters and efforts whose weighted residuals are such noise.
    pub fn new(parameters: usize, noise: &[Autoregression]) -> Self {
        let orders = noise.iter().map(|a| a.coefficients.len());
        Self {
            n: parameters,
            order: orders.max().unwrap_or(0),
            noise: noise.to_vec(),
            waiting: VecDeque::new(),
            spare: Vec::new(),
            past: vec![VecDeque::new(); noise.len()],
            whitened: vec![0.0; parameters],
            length: 1,
            current: Block::new(parameters),
            blocks: Vec::new(),
        }
    }

    /// Adds a sample.
    ///
    /// - `w`: the regressor, efforts x n, column by column;
    /// - `weights`: what each effort's row and residual are multiplied by; 0 leaves it out;
    /// - `psi`: the weighted residuals, bounded where Huber bounds them;
    /// - `slopes`: the derivative of psi by the weighted residual: 1, or 0 beyond Huber's bound.
    ///
    /// # Errors
    /// When a length does not fit.
    pub fn push(
        &mut self,
        w: &[f64],
        weights: &[f64],
        psi: &[f64],
        slopes: &[f64],
    ) -> Result<(), EstimateError> {
        let efforts = self.noise.len();
        size("w", efforts * self.n, w.len())?;
        size("weights", efforts, weights.len())?;
        size("psi", efforts, psi.len())?;
        size("slopes", efforts, slopes.len())?;
        let mut next = self.spare.pop().unwrap_or_default();
        next.w.clear();
        next.v.clear();
        for (effort, (weight, slope)) in weights.iter().zip(slopes).enumerate() {
            let row = w.iter().skip(effort).step_by(efforts);
            next.w.extend(row.map(|x| x * weight));
            let start = effort * self.n;
            let own = next.w.get(start..).unwrap_or_default();
            next.v.extend(own.iter().map(|x| x * slope));
        }
        next.psi.clear();
        let used = psi.iter().zip(weights);
        next.psi
            .extend(used.map(|(x, weight)| if *weight == 0.0 { 0.0 } else { *x }));
        self.waiting.push_back(next);
        if self.waiting.len() > self.order {
            self.settle();
        }
        Ok(())
    }

    /// Tells that the next sample does not follow the last one in time.
    pub fn interrupt(&mut self) {
        while !self.waiting.is_empty() {
            self.settle();
        }
        for past in &mut self.past {
            past.clear();
        }
    }

    /// Takes the sample that waits longest, and those after it as far as there are any.
    fn settle(&mut self) {
        let n = self.n;
        for (e, (noise, past)) in self.noise.iter().zip(&mut self.past).enumerate() {
            let order = noise.coefficients.len();
            let waiting = &self.waiting;
            let ahead = |lag: usize| waiting.get(lag);
            let eps = noise.innovation_of(|lag| ahead(lag).map_or(0.0, |s| s.psi[e]));
            let mut g = if past.len() > order {
                past.pop_back().unwrap_or_default()
            } else {
                Vec::new()
            };
            g.clear();
            if let Some(sample) = waiting.front() {
                g.extend_from_slice(&sample.w[e * n..(e + 1) * n]);
                self.whitened.copy_from_slice(&sample.v[e * n..(e + 1) * n]);
            }
            for (a, before) in noise.coefficients.iter().zip(past.iter()) {
                for (sum, x) in g.iter_mut().zip(before) {
                    *sum += a * x;
                }
            }
            for (a, after) in noise.coefficients.iter().zip(waiting.iter().skip(1)) {
                for (sum, x) in self.whitened.iter_mut().zip(&after.v[e * n..(e + 1) * n]) {
                    *sum -= a * x;
                }
            }
            let block = &mut self.current;
            for (i, gi) in g.iter().enumerate() {
                block.score[i] += gi * eps;
                // row i of the slope is column i of its transpose: both run along memory
                let slope = &mut block.slope[i * n..(i + 1) * n];
                for (sum, v) in slope.iter_mut().zip(&self.whitened) {
                    *sum += gi * v;
                }
                let by = gi * noise.innovation;
                let expected = &mut block.expected[i * n..(i + 1) * n];
                for (sum, x) in expected.iter_mut().zip(&g).skip(i) {
                    *sum += by * x;
                }
            }
            past.push_front(g);
        }
        if let Some(done) = self.waiting.pop_front() {
            self.spare.push(done);
        }
        self.current.samples += 1;
        if self.current.samples == self.length {
            self.end_block();
        }
    }

    fn end_block(&mut self) {
        if self.current.samples == 0 {
            return;
        }
        let full = core::mem::replace(&mut self.current, Block::new(self.n));
        self.blocks.push(full);
        if self.blocks.len() > BLOCKS {
            let last = self.blocks.pop();
            let mut pairs = Vec::with_capacity(BLOCKS);
            for pair in self.blocks.chunks_exact(2) {
                let mut sum = pair[0].clone();
                sum.add(&pair[1]);
                pairs.push(sum);
            }
            self.blocks = pairs;
            self.length *= 2;
            if let Some(last) = last {
                self.current = last;
            }
        }
    }

    /// The sums.
    ///
    /// - `values`: the parameters that the residuals were taken at.
    ///
    /// # Errors
    /// When the length does not fit.
    pub fn finish(mut self, values: &[f64]) -> Result<Blocks, EstimateError> {
        size("values", self.n, values.len())?;
        self.interrupt();
        self.end_block();
        let memory = self.noise.iter().map(Autoregression::memory);
        Ok(Blocks {
            parameters: self.n,
            values: values.to_vec(),
            blocks: self.blocks,
            memory: memory.fold(1.0, f64::max),
            change: Vec::new(),
        })
    }
}
