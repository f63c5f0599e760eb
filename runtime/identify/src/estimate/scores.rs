//! Sums of scores over blocks of time, from which covariances are computed.

use std::collections::VecDeque;

use pulp::Arch;
use serde::{Deserialize, Serialize};

use super::factor::size;
use super::products::OuterProducts;
use super::solution::inverse_gram;
use super::{Autoregression, EstimateError, FilteredNoise, QrFactor, Thinning};

/// The largest number of blocks of time; when there would be more, neighbours are merged.
pub const BLOCKS: usize = 128;

/// The variance of the level of a fitted autoregression at low frequencies, as a part of its square, for one coefficient
/// and one sample (Berk, 1974).
const FITTED_VARIANCE: f64 = 4.0;

/// The largest number of stretches of a log, between runs or gaps, that are told apart.
const MAX_STRETCHES: usize = 64;

/// The sums over one block; its n x n matrices are row by row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Block {
    /// The number of samples.
    pub(super) samples: usize,
    /// The sum of the scores: `sum g eps`, n entries.
    pub(super) score: Vec<f64>,
    /// The derivative of the sum by the parameters, negated: `sum g v^T`, entry (i, j) of g_i and v_j.
    pub(super) slope: Vec<f64>,
    /// The variance of the sum if the noise has the autocorrelation of the residuals:
    /// `sum s^2 g g^T`, lower half.
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
    /// The parameters at which the residuals were computed, SI.
    pub(super) values: Vec<f64>,
    #[allow(clippy::struct_field_names, reason = "the field is the list of blocks")]
    pub(super) blocks: Vec<Block>,
    /// The number of samples that carry as much information as one independent sample, of the
    /// effort with the longest correlation.
    pub(super) memory: f64,
    /// The part of its samples that an effort has independent ones of, the mean of all efforts.
    #[serde(default)]
    pub(super) independent_part: f64,
    /// The variance of the level of the noise at low frequencies, as a part of its square, that fitted
    /// autoregressions have; 0 where it is white, or white behind a known filter.
    #[serde(default)]
    pub(super) noise_unknown: f64,
    /// Whether the noise of an effort was found to be larger than its residuals are, by chance: no variance is then
    /// smaller than that noise makes it.
    #[serde(default)]
    pub(super) noise_is_raised: bool,
    /// The numbers of samples before each stretch of the log, that of the first one too; none where there
    /// are more than [`MAX_STRETCHES`].
    #[serde(default)]
    pub(super) starts: Vec<usize>,
    /// For each systematic change of all parameters `W^T W` times the change, n entries.
    #[serde(default)]
    pub(super) changes: Vec<Vec<f64>>,
}

impl Blocks {
    /// The number of independent ones among these equations.
    pub(crate) fn independent_of(&self, equations: usize) -> f64 {
        equations as f64 * self.independent_part
    }

    /// Adds a systematic change of all parameters that is the same for all samples, such as the
    /// effect of another differentiation method: it counts as one more standard deviation, also for
    /// estimates of some of the parameters, and beside changes that were added before.
    ///
    /// - `factor`: weighted, over all parameters; `change`: one entry for each, in its unit.
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
        self.changes.push(columns().map(score).collect());
        self
    }

    /// The systematic changes of the parameters of a factor: `(W^T W)^-1` times the scores of
    /// [`with_change`](Self::with_change); none if the factor is singular.
    ///
    /// - `kept`: the indices of the factor's parameters among all.
    pub(crate) fn changes(&self, factor: &QrFactor, kept: &[usize]) -> Vec<Vec<f64>> {
        let of_kept = |scores: &Vec<f64>| {
            let own = kept.iter().map(|k| scores.get(*k).copied());
            changed_by(factor, &own.collect::<Option<Vec<f64>>>()?)
        };
        self.changes.iter().filter_map(of_kept).collect()
    }

    /// The number of samples that were added.
    pub fn samples(&self) -> usize {
        self.blocks.iter().map(|b| b.samples).sum()
    }

    /// The number of blocks.
    pub fn len(&self) -> usize {
        self.blocks.len()
    }

    /// Whether there are no blocks.
    pub fn is_empty(&self) -> bool {
        self.blocks.is_empty()
    }

    /// The number of samples that carry as much information as one independent sample, for the
    /// effort whose noise has the longest correlation.
    pub fn correlation_length(&self) -> f64 {
        self.memory
    }
}

/// A sample in the look-ahead buffer: it is whitened once the next samples are known.
#[derive(Clone, Debug, Default)]
struct PendingSample {
    /// The weighted rows of the scores, efforts x n, effort by effort: those of the regressor or of
    /// the instruments.
    w: Vec<f64>,
    /// The derivatives of psi by the parameters, negated: the weighted rows of the regressor times
    /// the slope of psi. Empty where they are the same as `w`.
    v: Vec<f64>,
    /// The weighted and bounded residuals, one for each effort.
    psi: Vec<f64>,
}

impl PendingSample {
    /// The derivative of the psi of an effort by the parameters, negated, n entries.
    fn sloped(&self, effort: usize, n: usize) -> &[f64] {
        let all = if self.v.is_empty() { &self.w } else { &self.v };
        &all[effort * n..(effort + 1) * n]
    }
}

/// Collects the scores `w psi(e)` of an estimate in order of time, in memory that does not grow.
///
/// If the noise of an effort is an autoregression, `e = F^-1 eps` with F upper triangular (each
/// value from the later ones), then the sum of the scores is `W^T e = (F^-T W)^T eps`: the same
/// sum, written with terms `g eps` that are independent of each other. So the variance of the sum
/// is computed from scores that are nearly white (prewhitened, as Andrews and Monahan, 1992, do
/// with an autoregression of the scores). The sum is the same for any autoregression; the
/// autoregression only decides how white the terms are. With instrumental variables, the scores are
/// `z psi(e)`.
#[derive(Clone, Debug)]
pub struct Scores {
    n: usize,
    noise: Vec<Autoregression>,
    thinning: Thinning,
    is_raised: bool,
    order: usize,
    /// The look-ahead buffer, the oldest sample first.
    waiting: VecDeque<PendingSample>,
    /// Processed samples, whose memory is used again.
    spare: Vec<PendingSample>,
    /// For each effort, the last regressors after multiplication by F^-T, the newest first.
    past: Vec<VecDeque<Vec<f64>>>,
    whitened: Vec<f64>,
    scaled: Vec<f64>,
    /// The number of samples that were processed, and those before each stretch.
    processed: usize,
    starts: Vec<usize>,
    /// The number of samples in a full block.
    length: usize,
    /// The current block, without its matrices.
    current: Block,
    /// [`Block::slope`] and [`Block::expected`] of the current block.
    slope: OuterProducts,
    expected: OuterProducts,
    blocks: Vec<Block>,
}

impl Scores {
    /// Starts for n parameters and one effort for each autoregression, which is the model of its
    /// weighted residuals.
    pub fn new(parameters: usize, noise: &[Autoregression]) -> Self {
        let orders = noise.iter().map(|a| a.coefficients.len());
        Self {
            n: parameters,
            order: orders.max().unwrap_or(0),
            noise: noise.to_vec(),
            thinning: FilteredNoise::unfiltered().thinning(),
            is_raised: false,
            waiting: VecDeque::new(),
            spare: Vec::new(),
            past: vec![VecDeque::new(); noise.len()],
            whitened: vec![0.0; parameters],
            scaled: Vec::with_capacity(parameters),
            processed: 0,
            starts: Vec::new(),
            length: 1,
            current: Block::new(parameters),
            slope: OuterProducts::new(parameters, false),
            expected: OuterProducts::new(parameters, true),
            blocks: Vec::new(),
        }
    }

    /// The same from some of the samples, which stand for all.
    ///
    /// - `is_raised`: see [`Blocks::noise_is_raised`].
    #[must_use]
    pub(super) fn of_noise(self, thinning: Thinning, is_raised: bool) -> Self {
        Self {
            thinning,
            is_raised,
            ..self
        }
    }

    /// The same for a known number of samples, whose blocks need not be merged.
    #[must_use]
    pub(crate) fn of_samples(mut self, samples: usize) -> Self {
        let samples = samples.div_ceil(self.thinning.every());
        self.length = samples.div_ceil(BLOCKS).max(1).next_power_of_two();
        self
    }

    /// Adds a sample.
    ///
    /// - `w`: the regressor, efforts x n, column by column;
    /// - `weights`: the factor of each effort's row and residual; 0 leaves the effort out;
    /// - `psi`: the weighted residuals, clipped at Huber's bound if one is used;
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
        if !self.thinning.takes_next() {
            return Ok(());
        }
        let scale = self.thinning.weight();
        let mut next = self.spare.pop().unwrap_or_default();
        next.w.clear();
        next.v.clear();
        // without Huber's bound all slopes are 1
        let sloped = slopes
            .iter()
            .any(|slope| slope.to_bits() != 1.0_f64.to_bits());
        for (effort, (weight, slope)) in weights.iter().zip(slopes).enumerate() {
            let columns = w.chunks_exact(efforts);
            let scaled = weight * scale;
            next.w.extend(columns.map(|column| column[effort] * scaled));
            if sloped {
                let start = effort * self.n;
                let own = next.w.get(start..).unwrap_or_default();
                next.v.extend(own.iter().map(|x| x * slope));
            }
        }
        self.push_pending(next, weights, psi);
        Ok(())
    }

    /// Adds a sample of an estimate by instrumental variables, whose scores are `z psi(e)`.
    ///
    /// - `z`: the instruments, efforts x n, column by column;
    /// - `w`, `weights`, `psi`: as in [`push`](Self::push), without a bound.
    ///
    /// # Errors
    /// When a length does not fit.
    pub(crate) fn push_with_instruments(
        &mut self,
        (z, w): (&[f64], &[f64]),
        weights: &[f64],
        psi: &[f64],
    ) -> Result<(), EstimateError> {
        let efforts = self.noise.len();
        size("z", efforts * self.n, z.len())?;
        size("w", efforts * self.n, w.len())?;
        size("weights", efforts, weights.len())?;
        size("psi", efforts, psi.len())?;
        if !self.thinning.takes_next() {
            return Ok(());
        }
        let scale = self.thinning.weight();
        let mut next = self.spare.pop().unwrap_or_default();
        for (columns, rows) in [(z, &mut next.w), (w, &mut next.v)] {
            rows.clear();
            for (effort, weight) in weights.iter().enumerate() {
                let columns = columns.chunks_exact(efforts);
                let scaled = weight * scale;
                rows.extend(columns.map(|column| column[effort] * scaled));
            }
        }
        self.push_pending(next, weights, psi);
        Ok(())
    }

    /// Adds a sample with its rows to the look-ahead buffer.
    fn push_pending(&mut self, mut next: PendingSample, weights: &[f64], psi: &[f64]) {
        next.psi.clear();
        let used = psi.iter().zip(weights);
        let scale = self.thinning.weight();
        let of_used = |(x, weight): (&f64, &f64)| if *weight == 0.0 { 0.0 } else { x * scale };
        next.psi.extend(used.map(of_used));
        self.waiting.push_back(next);
        if self.waiting.len() > self.order {
            self.process_oldest();
        }
    }

    /// Ends the run: the next sample does not follow the last one in time.
    pub fn interrupt(&mut self) {
        self.thinning.interrupt();
        while !self.waiting.is_empty() {
            self.process_oldest();
        }
        for past in &mut self.past {
            past.clear();
        }
        if self.starts.last() != Some(&self.processed) && self.starts.len() <= MAX_STRETCHES {
            self.starts.push(self.processed);
        }
    }

    /// Adds the oldest sample of the buffer to the current block, whitened by the samples after it
    /// (as many as there are).
    fn process_oldest(&mut self) {
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
                self.whitened.copy_from_slice(sample.sloped(e, n));
            }
            let (whitened, score) = (&mut self.whitened, &mut self.current.score);
            let scaled = &mut self.scaled;
            scaled.clear();
            Arch::new().dispatch(
                #[inline(always)]
                || {
                    for (a, before) in noise.coefficients.iter().zip(past.iter()) {
                        for (sum, x) in g.iter_mut().zip(before) {
                            *sum += a * x;
                        }
                    }
                    for (a, after) in noise.coefficients.iter().zip(waiting.iter().skip(1)) {
                        for (sum, x) in whitened.iter_mut().zip(after.sloped(e, n)) {
                            *sum -= a * x;
                        }
                    }
                    for (sum, g) in score.iter_mut().zip(&g) {
                        *sum += g * eps;
                    }
                    scaled.extend(g.iter().map(|g| g * noise.innovation));
                },
            );
            self.slope.push(&g, &self.whitened);
            self.expected.push(&self.scaled, &g);
            past.push_front(g);
        }
        if let Some(done) = self.waiting.pop_front() {
            self.spare.push(done);
        }
        self.current.samples += 1;
        self.processed += 1;
        if self.current.samples == self.length {
            self.end_block();
        }
    }

    fn end_block(&mut self) {
        if self.current.samples == 0 {
            return;
        }
        let mut full = core::mem::replace(&mut self.current, Block::new(self.n));
        full.slope = self.slope.take();
        full.expected = self.expected.take();
        self.blocks.push(full);
        if self.blocks.len() > BLOCKS {
            let last = self.blocks.pop();
            let mut pairs = Vec::with_capacity(BLOCKS);
            for pair in self.blocks.as_chunks::<2>().0 {
                let mut sum = pair[0].clone();
                sum.add(&pair[1]);
                pairs.push(sum);
            }
            self.blocks = pairs;
            self.length *= 2;
            if let Some(last) = last {
                self.slope.set(&last.slope);
                self.expected.set(&last.expected);
                self.current = last;
            }
        }
    }

    /// Processes the buffered samples and returns the blocks.
    ///
    /// - `values`: the parameters at which the residuals were computed, SI.
    ///
    /// # Errors
    /// When the length does not fit.
    pub fn finish(mut self, values: &[f64]) -> Result<Blocks, EstimateError> {
        size("values", self.n, values.len())?;
        self.interrupt();
        // the last block of too many is the current one again
        while self.current.samples > 0 {
            self.end_block();
        }
        let every = self.thinning.every();
        let memory = self.noise.iter().map(Autoregression::correlation_length);
        let memory = memory.map(|length| every as f64 * length);
        let parts = memory.clone().map(|length| 1.0 / length.max(1.0));
        let efforts = self.noise.len().max(1) as f64;
        // the end is no start, and that of the first stretch may not have been told
        let mut starts = self.starts;
        starts.retain(|start| *start < self.processed);
        if starts.first() != Some(&0) {
            starts.insert(0, 0);
        }
        if starts.len() > MAX_STRETCHES {
            starts.clear();
        }
        let fitted = self.noise.iter().map(|noise| noise.fitted as f64);
        let noise_unknown = FITTED_VARIANCE * fitted.sum::<f64>() / efforts;
        for start in &mut starts {
            *start *= every;
        }
        let mut blocks = self.blocks;
        for block in &mut blocks {
            block.samples *= every;
        }
        Ok(Blocks {
            starts,
            noise_is_raised: self.is_raised,
            independent_part: parts.sum::<f64>() / efforts,
            noise_unknown: noise_unknown / self.processed.max(1) as f64,
            parameters: self.n,
            values: values.to_vec(),
            blocks,
            memory: memory.fold(1.0, f64::max),
            changes: Vec::new(),
        })
    }
}

/// The parameters that solve `W^T W x = scores`; `None` if the factor is singular.
pub(crate) fn changed_by(factor: &QrFactor, scores: &[f64]) -> Option<Vec<f64>> {
    let gram = inverse_gram(factor)?;
    let rows = gram.chunks_exact(scores.len().max(1));
    let products = rows.map(|row| row.iter().zip(scores).map(|(a, b)| a * b).sum());
    Some(products.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_of_a_known_number_of_samples_are_those_that_merging_gives() {
        let noise = [Autoregression::fit(0.5, &[0.5, 0.2], 400)];
        for samples in [1, 100, 128, 129, 130, 256, 257, 1000] {
            let value = |k: usize, factor: f64| libm::sin(factor * k as f64);
            let collected = |mut scores: Scores| -> Option<Blocks> {
                for k in 0..samples {
                    let w = [1.0, value(k, 0.7)];
                    scores.push(&w, &[1.0], &[value(k, 3.3)], &[1.0]).ok()?;
                }
                scores.finish(&[0.0, 0.0]).ok()
            };
            let merged = collected(Scores::new(2, &noise));
            let known = collected(Scores::new(2, &noise).of_samples(samples));
            let (Some(merged), Some(known)) = (merged, known) else {
                panic!("{samples}");
            };
            // no sample is lost where the last block is one too many
            assert_eq!((merged.samples(), known.samples()), (samples, samples));
            assert_eq!(merged.len(), known.len(), "{samples}");
            for (a, b) in merged.blocks.iter().zip(&known.blocks) {
                assert_eq!(a.samples, b.samples, "{samples}");
                let pairs = a
                    .score
                    .iter()
                    .zip(&b.score)
                    .chain(a.slope.iter().zip(&b.slope));
                assert!(
                    pairs.into_iter().all(|(x, y)| (x - y).abs() < 1e-12),
                    "{samples}"
                );
            }
        }
    }

    #[test]
    fn the_independent_part_is_the_mean_of_that_of_the_efforts() {
        let correlated = Autoregression::fit(1.0, &[0.8], 400);
        let length = correlated.correlation_length();
        let noise = [Autoregression::fit(1.0, &[0.0], 400), correlated];
        let found = Scores::new(1, &noise).finish(&[0.0]);
        let expected = 0.5 * (1.0 + 1.0 / length);
        assert!(length > 2.0);
        assert!(found.is_ok_and(|own| (own.independent_part / expected - 1.0).abs() < 1e-9));
    }
}
