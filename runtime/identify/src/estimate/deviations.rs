//! The covariance of an estimate, computed from its scores, with the degrees of freedom of that
//! covariance.

use serde::{Deserialize, Serialize};

use super::cosine_sums::{Cosines, ExpectedTransforms, Sums, dot};
use super::factor::size;
use super::noise::cholesky;
use super::shrunk::shrunk;
use super::solution::inverse_gram;
use super::{Blocks, Estimate, EstimateError, LogErrors, QrFactor};

/// The largest number of cosines.
const MAX_COSINES: usize = 32;
/// When the fitted parameters leave less than this fraction of the noise variance in the cosine
/// transforms, nothing is known about the noise, and the standard deviation is infinite.
const MIN_REMAINING_PART: f64 = 1e-3;
/// A log that is shorter than this many independent samples gives standard deviations that are too
/// small, as does one with fewer of them than parameters: with 200 filtered rows of a six-joint arm
/// with 58 parameters, only 59 % of the values were within 3 standard deviations.
const MIN_INDEPENDENT_SAMPLES: f64 = 20.0;
/// The number of parts of a log of one run that are compared.
const PARTS: usize = 8;
/// Runs are compared if there are at most so many.
const MAX_RUNS: usize = 16;
/// The shortest run that is compared has this part of the mean length of all.
const MIN_RUN_PART: f64 = 0.2;
/// What runs have in common with themselves only is part of the deviations if it is larger than this many
/// standard deviations of what chance gives.
pub(super) const MIN_CHANCE: f64 = 3.0;
/// Chance has as many degrees of freedom as this part of the parameters, as far as they are independent of
/// each other.
const INDEPENDENT_PART: f64 = 0.5;
/// What sampling leaves unknown is mentioned if it increases a standard deviation by at least this part.
const MIN_MENTIONED_GROWTH: f64 = 0.1;
/// How it is mentioned, behind a description of the deviations.
pub(crate) const SAMPLING: &str = "; and what sampling leaves unknown of the motion";

/// The covariance of an estimate whose residuals are correlated in time and across efforts.
///
/// The long-run variance of the scores is the mean of the squares of their first cosine transforms
/// (Lazarus, Lewis, Stock and Watson, 2018: equal-weighted cosines), each of which is one degree of
/// freedom of Student's distribution; the scores are whitened before ([`Scores`](super::Scores)).
/// The fit makes residuals smaller than the noise. That loss is corrected, and the degrees of
/// freedom are computed, as by Bell and McCaffrey (2002): from the values that both have for noise
/// with the autocorrelation of the residuals. Their covariance is then drawn towards the one of such noise,
/// see [`root`](Self::root).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Deviations {
    /// The covariance of the n parameters, n x n, symmetric, column-major.
    pub covariance: Vec<f64>,
    /// The degrees of freedom of Student's distribution, one for each parameter.
    pub degrees_of_freedom: Vec<f64>,
    /// The number of cosines.
    pub terms: usize,
    /// The number of samples.
    pub samples: usize,
    /// The number of samples that carry as much information as one independent sample.
    pub memory: f64,
    /// What runs, or parts of one, have in common with themselves only; `None` where that is no more than
    /// chance.
    #[serde(default)]
    pub between: Option<Between>,
    /// See [`within_runs`](Self::within_runs).
    #[serde(skip)]
    within_runs: Vec<f64>,
    /// A Cholesky factor of a covariance of full rank, n x n, column-major; see
    /// [`root`](Self::root).
    root: Vec<f64>,
}

/// By how much estimates from the runs of a log, or from parts of one, differ beyond what the noise
/// within them explains: what a run has in common with itself only, such as its temperature or an
/// error of the model along its motion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Between {
    /// The number of runs or parts.
    pub count: usize,
    /// Whether they are runs, or stretches of a log between gaps; parts of equal length otherwise.
    pub are_runs: bool,
    /// The factor of the standard deviations.
    pub growth: f64,
}

impl Deviations {
    /// The deviations of an estimate whose residuals are taken as white, for use when their order
    /// in time is not known.
    pub fn white(estimate: &Estimate) -> Self {
        let n = estimate.values.len();
        Self {
            covariance: estimate.covariance.clone(),
            degrees_of_freedom: estimate.parameter_degrees_of_freedom.clone(),
            terms: estimate.degrees_of_freedom,
            samples: estimate.degrees_of_freedom + n,
            memory: 1.0,
            between: None,
            within_runs: Vec::new(),
            root: root_of(&estimate.covariance, n),
        }
    }

    /// The deviations of an estimate whose errors are known from its logs.
    pub(crate) fn of_logs(errors: &LogErrors) -> Self {
        let n = errors.degrees_of_freedom.len();
        Self {
            covariance: errors.covariance.clone(),
            degrees_of_freedom: errors.degrees_of_freedom.clone(),
            terms: errors.terms,
            samples: errors.samples,
            memory: errors.memory,
            between: None,
            within_runs: Vec::new(),
            root: root_of(&errors.covariance, n),
        }
    }

    /// The covariance without the factors for what the fit takes from the memory of its residuals, and for
    /// what runs have in common with themselves only.
    pub(crate) fn within_runs(&self) -> &[f64] {
        &self.within_runs
    }

    /// Describes how the standard deviations account for the residuals' correlation.
    pub fn in_words(&self) -> String {
        let between = self.between.map_or_else(String::new, |own| {
            let what = if own.are_runs {
                "runs"
            } else {
                "parts of the log"
            };
            format!(
                "; and what differs between {} {what}, by which they are {:.1} times larger",
                own.count, own.growth
            )
        });
        format!(
            "residuals correlated in time ({:.0} samples count as one; {} cosines of whitened \
             scores){between}",
            self.memory, self.terms
        )
    }

    /// The standard deviation of a parameter; NaN if there is none of that index.
    pub fn sigma(&self, parameter: usize) -> f64 {
        let n = self.degrees_of_freedom.len();
        let variance = self.covariance.get(parameter * n + parameter);
        variance.map_or(f64::NAN, |v| v.sqrt())
    }

    /// The same with another covariance, with the same degrees of freedom for all parameters.
    #[must_use]
    pub fn with_covariance(&self, covariance: Vec<f64>, degrees_of_freedom: f64) -> Self {
        let n = self.degrees_of_freedom.len();
        Self {
            degrees_of_freedom: vec![degrees_of_freedom; n],
            root: root_of(&covariance, n),
            covariance,
            between: None,
            ..self.clone()
        }
    }

    /// The same with an additional systematic error that is the same for all samples, such as that
    /// of derivatives computed from samples: it counts as one standard deviation.
    ///
    /// - `change`: the error of each parameter, in its unit.
    #[must_use]
    pub(crate) fn with_change(&self, change: &[f64]) -> Self {
        let n = self.degrees_of_freedom.len();
        if change.iter().all(|x| *x == 0.0) {
            return self.clone();
        }
        let at = |k: usize| change.get(k).copied().unwrap_or_default();
        let square = (0..n * n).map(|k| at(k % n.max(1)) * at(k / n.max(1)));
        self.with_added(&square.collect::<Vec<f64>>())
    }

    /// The same with what sampling leaves unknown of the motion, and words for it: empty where no standard
    /// deviation grows by a tenth.
    ///
    /// - `changes`: by how much each parameter would change, in its unit, with other derivatives of the
    ///   positions, and with efforts that are held between the rows.
    #[must_use]
    pub(crate) fn with_sampling(&self, changes: &[Vec<f64>]) -> (Self, &'static str) {
        let found = changes
            .iter()
            .fold(self.clone(), |sum, own| sum.with_change(own));
        let grows = |k: usize| found.sigma(k) > (1.0 + MIN_MENTIONED_GROWTH) * self.sigma(k);
        let words = if (0..self.degrees_of_freedom.len()).any(grows) {
            SAMPLING
        } else {
            ""
        };
        (found, words)
    }

    /// The same with a further covariance, of errors that are independent of the noise.
    ///
    /// - `more`: n x n, symmetric, in the products of the units.
    #[must_use]
    pub(crate) fn with_added(&self, more: &[f64]) -> Self {
        let n = self.degrees_of_freedom.len();
        let add = |matrix: &[f64]| -> Vec<f64> {
            let more = more.iter().copied().chain(core::iter::repeat(0.0));
            matrix.iter().zip(more).map(|(x, y)| x + y).collect()
        };
        let mut product = vec![0.0; n * n];
        for column in self.root.chunks_exact(n.max(1)) {
            for (k, x) in product.iter_mut().enumerate() {
                *x += column[k % n] * column[k / n];
            }
        }
        Self {
            covariance: add(&self.covariance),
            root: cholesky(&add(&product), n).unwrap_or_else(|| self.root.clone()),
            ..self.clone()
        }
    }

    /// The deviations of linear combinations of the n parameters.
    ///
    /// - `map`: the factors of each combination, n of them; at least n combinations, so that the
    ///   [`root`](Self::root) can be filled up with zeros.
    pub(crate) fn mapped(&self, map: &[Vec<f64>]) -> Self {
        let (n, m) = (self.degrees_of_freedom.len(), map.len());
        let mut covariance = vec![0.0; m * m];
        for (a, left) in map.iter().enumerate() {
            let rows = self.covariance.chunks_exact(n.max(1));
            let half: Vec<f64> = rows.map(|row| dot(row, left)).collect();
            for (b, right) in map.iter().enumerate() {
                covariance[a * m + b] = dot(&half, right);
            }
        }
        let mut root = vec![0.0; m * m.max(n)];
        let columns = self.root.chunks_exact(n.max(1));
        for (column, into) in columns.zip(root.chunks_exact_mut(m.max(1))) {
            for (x, row) in into.iter_mut().zip(map) {
                *x = dot(column, row);
            }
        }
        let freedom = map.iter().map(|row| {
            let used = row.iter().zip(&self.degrees_of_freedom);
            let used = used.filter(|(f, _)| **f != 0.0).map(|(_, d)| *d);
            used.fold(f64::INFINITY, f64::min)
        });
        Self {
            degrees_of_freedom: freedom.collect(),
            covariance,
            root,
            ..self.clone()
        }
    }

    /// Whether the log is too short for the correlation time of its noise (less than 20 independent
    /// samples, or than there are parameters): the standard deviations are then likely to be too
    /// small.
    pub fn short(&self) -> bool {
        let parameters = self.degrees_of_freedom.len() as f64;
        (self.samples as f64) < parameters.max(MIN_INDEPENDENT_SAMPLES) * self.memory
    }

    /// A Cholesky factor L of the covariance, n x n, column-major, for drawing all parameters
    /// together: `L L^T` has full rank.
    ///
    /// With fewer cosines than parameters their covariance is singular, and each variance of it is known
    /// to a quarter only. `L L^T` is therefore a weighted mean of it and of the covariance that noise with
    /// the autocorrelation of the residuals has; the weight is the part of their difference that is due
    /// to chance (Ledoit and Wolf, 2004).
    pub fn root(&self) -> &[f64] {
        &self.root
    }

    /// The degrees of freedom of the covariance as a whole: the number of cosines.
    pub fn joint_degrees_of_freedom(&self) -> f64 {
        self.terms as f64
    }
}

impl Blocks {
    /// The covariance and degrees of freedom of an estimate.
    ///
    /// - `factor`: weighted, over the parameters of these scores or some of them;
    /// - `kept`: the indices of the factor's parameters among those of the scores;
    /// - `values`: the parameters of the factor, SI; those not in `kept` are zero;
    /// - `inside`: the fraction of the residuals within Huber's bound, 1 for least squares.
    ///
    /// # Errors
    /// When sizes do not fit or the factor is singular.
    ///
    /// ```
    /// use regen_identify::estimate::{Autoregression, QrFactor, Scores};
    ///
    /// // the mean of 400 values in equal pairs: 200 of them are independent
    /// let value = |t: usize| (12.9898 * (t / 2 * t / 2) as f64).sin();
    /// let mut factor = QrFactor::new(vec!["mean".to_owned()]);
    /// factor.push_block(&[1.0; 400], &(0..400).map(value).collect::<Vec<_>>())?;
    /// let mean = factor.solve()?;
    ///
    /// let noise = Autoregression::fit(0.5, &[0.5, 0.0], 400);
    /// let mut scores = Scores::new(1, &[noise]);
    /// for t in 0..400 {
    ///     scores.push(&[1.0], &[1.0], &[value(t) - mean[0]], &[1.0])?;
    /// }
    /// let found = scores.finish(&mean)?.deviations(&factor, &[0], &mean, 1.0)?;
    /// let exact = (0.5_f64 / 200.0).sqrt();
    /// assert!((0.6..1.6).contains(&(found.sigma(0) / exact)));
    /// assert!(found.degrees_of_freedom[0] > 10.0 && !found.short());
    /// # Ok::<(), regen_identify::estimate::EstimateError>(())
    /// ```
    pub fn deviations(
        &self,
        factor: &QrFactor,
        kept: &[usize],
        values: &[f64],
        inside: f64,
    ) -> Result<Deviations, EstimateError> {
        let inverse: Vec<f64> = inverse_gram(factor)
            .ok_or(EstimateError::NoConvergence)?
            .into_iter()
            .map(|x| x / inside)
            .collect();
        let bread = Bread {
            inverse: &inverse,
            rows: factor.rows(),
        };
        let found = self.deviations_with(&bread, kept, values)?;
        let changes = self.changes(factor, kept);
        Ok(changes.iter().fold(found, |sum, own| sum.with_change(own)))
    }

    /// The covariance and degrees of freedom of an estimate by instrumental variables, over all
    /// parameters of these scores.
    ///
    /// - `inverse`: `(Z^T W)^-1`, n x n, row by row, of the weighted instruments and regressor;
    /// - `rows`: the number of equations.
    ///
    /// # Errors
    /// When the size does not fit.
    pub(crate) fn deviations_of_instruments(
        &self,
        inverse: &[f64],
        rows: usize,
    ) -> Result<Deviations, EstimateError> {
        let n = self.parameters;
        size("inverse", n * n, inverse.len())?;
        let all: Vec<usize> = (0..n).collect();
        let bread = Bread { inverse, rows };
        self.deviations_with(&bread, &all, &self.values)
    }

    /// The index of the run or part of each block, the number of these, and whether they are runs; `None`
    /// where they are too short.
    fn clusters(&self) -> Option<(Vec<usize>, usize, bool)> {
        let samples = self.samples() as f64;
        let mut middles = Vec::with_capacity(self.blocks.len());
        let mut before = 0;
        for block in &self.blocks {
            middles.push(before as f64 + 0.5 * block.samples as f64);
            before += block.samples;
        }
        let runs = self.starts.len();
        let least = MIN_RUN_PART * samples / runs.max(1) as f64;
        let ends = self.starts.iter().skip(1).map(|end| *end as f64);
        let lengths = ends.chain([samples]).zip(&self.starts);
        let are_runs = (2..=MAX_RUNS).contains(&runs)
            && lengths
                .map(|(end, start)| end - *start as f64)
                .all(|n| n >= least);
        let count = if are_runs { runs } else { PARTS };
        let of_block = |middle: &f64| {
            if are_runs {
                self.starts
                    .iter()
                    .filter(|start| **start as f64 <= *middle)
                    .count()
                    .max(1)
                    - 1
            } else {
                #[allow(clippy::cast_sign_loss, reason = "it is not negative")]
                let part = (middle / samples * PARTS as f64) as usize;
                part.min(PARTS - 1)
            }
        };
        let of_blocks: Vec<usize> = middles.iter().map(of_block).collect();
        let is_filled = (0..count).all(|own| of_blocks.contains(&own));
        let is_long =
            samples >= MIN_INDEPENDENT_SAMPLES * self.memory && samples >= 4.0 * count as f64;
        (is_filled && is_long).then_some((of_blocks, count, are_runs))
    }

    /// What runs, or parts of one, have in common with themselves only: the sum of the squares of their
    /// sums of scores (Liang and Zeger, 1986: clusters), over that of the cosine transforms, both in the
    /// metric of the covariance that noise with the autocorrelation of the residuals has, for all parameters
    /// together. `None` where it is not larger than chance.
    fn between(
        &self,
        sum: &Sums<'_>,
        transforms: &[Vec<f64>],
        expected: &[f64],
        step: &[f64],
    ) -> Option<Between> {
        let k = sum.kept.len();
        let (of_blocks, count, are_runs) = self.clusters()?;
        let lower = cholesky(expected, k)?;
        // the square of L^-1 x
        let square = |x: &[f64]| {
            let mut y = x.to_vec();
            for j in 0..k {
                let own =
                    y.get(j).copied().unwrap_or(0.0) / lower.get(j * k + j).copied().unwrap_or(1.0);
                for i in j + 1..k {
                    if let (Some(y), Some(l)) = (y.get_mut(i), lower.get(j * k + i)) {
                        *y -= l * own;
                    }
                }
                if let Some(y) = y.get_mut(j) {
                    *y = own;
                }
            }
            y.iter().map(|y| y * y).sum::<f64>()
        };
        let mut of_clusters = vec![vec![0.0; k]; count];
        for (block, cluster) in self.blocks.iter().zip(&of_blocks) {
            if let Some(own) = of_clusters.get_mut(*cluster) {
                for (x, y) in own.iter_mut().zip(sum.score(block, step)) {
                    *x += y;
                }
            }
        }
        let clusters = of_clusters.iter().map(|own| square(&sum.solved(own)));
        let correction = count as f64 / (count - 1) as f64;
        let found = correction * clusters.sum::<f64>();
        let usual =
            transforms.iter().map(|x| square(x)).sum::<f64>() / transforms.len().max(1) as f64;
        let freedom = (count - 1) as f64 * (INDEPENDENT_PART * k as f64).max(1.0);
        let ratio = found / usual;
        (ratio > 1.0 + MIN_CHANCE * (2.0 / freedom).sqrt()).then(|| Between {
            count,
            are_runs,
            growth: ratio.sqrt(),
        })
    }

    fn deviations_with(
        &self,
        bread: &Bread<'_>,
        kept: &[usize],
        values: &[f64],
    ) -> Result<Deviations, EstimateError> {
        let k = values.len();
        size("kept", k, kept.len())?;
        size("inverse", k * k, bread.inverse.len())?;
        if let Some(&beyond) = kept.iter().find(|c| **c >= self.parameters) {
            size("kept", self.parameters, beyond + 1)?;
        }
        let mut step: Vec<f64> = self.values.iter().map(|x| -x).collect();
        for (place, value) in kept.iter().zip(values) {
            step[*place] += value;
        }
        let samples = self.samples();
        let usual = 0.4 * libm::cbrt((samples as f64).powi(2));
        #[allow(clippy::cast_sign_loss, reason = "it is not negative")]
        let usual = usual as usize;
        let terms = usual.min(MAX_COSINES).min(self.len() / 2).max(1);
        let cosines = Cosines::new(&self.blocks, samples, 2 * terms);
        let sum = Sums {
            blocks: &self.blocks,
            n: self.parameters,
            kept,
            bread: bread.inverse,
            cosines: &cosines,
        };
        let transforms = sum.transforms(terms, &step);
        let expected = ExpectedTransforms::new(&sum, terms);
        let whole = expected.covariance();

        let mut scale = vec![1.0; k];
        let mut degrees_of_freedom = vec![terms as f64; k];
        for a in 0..k {
            let whole = whole[a * k + a];
            if whole.is_nan() || whole <= 0.0 {
                continue;
            }
            let omega = expected.covariance_of_transforms(a);
            let trace: f64 = (0..terms).map(|j| omega[j * terms + j]).sum();
            let squares: f64 = omega.iter().map(|x| x * x).sum();
            if trace > MIN_REMAINING_PART * terms as f64 * whole {
                scale[a] = terms as f64 * whole / trace;
                degrees_of_freedom[a] = trace * trace / squares;
            } else {
                scale[a] = f64::INFINITY;
                degrees_of_freedom[a] = 1.0;
            }
        }
        let between = self.between(&sum, &transforms, whole, &step);
        let runs = between.map_or(1.0, |own| own.growth * own.growth);
        let growth = runs * growth(self.independent_of(bread.rows), k, bread.rows);
        let mut within_runs = covariance_of(&transforms, &scale);
        for (scale, degrees_of_freedom) in scale.iter_mut().zip(&mut degrees_of_freedom) {
            *scale *= growth;
            if growth.is_infinite() {
                *degrees_of_freedom = 1.0;
            }
        }
        let mut covariance = covariance_of(&transforms, &scale);
        let shrunk = shrunk(&transforms, &scale, whole, k);
        let root = if let Some(mut shrunk) = shrunk {
            if growth.is_finite() {
                let independent = self.independent_of(bread.rows) - k as f64;
                // a variance with these degrees of freedom is known to this part of its square
                let independent = independent.min(2.0 / self.noise_unknown);
                shrunk.keep_what_is_beyond_chance(&covariance, &degrees_of_freedom);
                if self.noise_is_raised {
                    shrunk.raise_to_expected(whole);
                }
                for own in &mut degrees_of_freedom {
                    *own = shrunk.degrees_of_freedom(*own).min(independent).max(*own);
                }
                covariance = shrunk.covariance();
                within_runs = covariance.iter().map(|x| x / growth).collect();
            }
            shrunk.root
        } else {
            // the correlation of the parameters is not known: assume that there is none
            let mut diagonal = vec![0.0; k * k];
            for a in 0..k {
                diagonal[a * k + a] = covariance[a * k + a].sqrt();
            }
            diagonal
        };
        Ok(Deviations {
            covariance,
            degrees_of_freedom,
            terms,
            samples,
            memory: self.memory.min(samples as f64),
            between,
            within_runs,
            root,
        })
    }
}

/// The mean of the outer products of the transforms, k x k, scaled for each parameter.
pub(super) fn covariance_of(transforms: &[Vec<f64>], scale: &[f64]) -> Vec<f64> {
    let k = scale.len();
    let terms = transforms.len() as f64;
    let mut covariance = vec![0.0; k * k];
    for a in 0..k {
        for b in 0..=a {
            let own: f64 = transforms.iter().map(|x| x[a] * x[b]).sum();
            let own = own / terms * (scale[a] * scale[b]).sqrt();
            covariance[a * k + b] = own;
            covariance[b * k + a] = own;
        }
    }
    covariance
}

/// The factor of the covariance for what its correction leaves: the fit makes the residuals smaller and
/// the memory that is computed from them shorter, by the part of the independent equations that its
/// parameters use up, and the correction is computed from that memory. Infinite where there are no more
/// independent equations than parameters, or less than three equations for two parameters.
fn growth(independent: f64, parameters: usize, rows: usize) -> f64 {
    let part = parameters as f64 / independent.max(1.0);
    if part < 1.0 && 2 * rows >= 3 * parameters {
        1.0 / (1.0 - part * part)
    } else {
        f64::INFINITY
    }
}

/// A Cholesky factor of a covariance, n x n; without correlations where it has none.
fn root_of(covariance: &[f64], n: usize) -> Vec<f64> {
    cholesky(covariance, n).unwrap_or_else(|| {
        let mut diagonal = vec![0.0; n * n];
        for k in 0..n {
            diagonal[k * n + k] = covariance[k * n + k].sqrt();
        }
        diagonal
    })
}

/// The matrix by which the sum of the scores gives the error of the estimate.
struct Bread<'a> {
    /// `(W^T W)^-1`, or `(Z^T W)^-1` with instruments; row by row.
    inverse: &'a [f64],
    /// The number of equations.
    rows: usize,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::{Autoregression, FilteredNoise, Scores};
    use crate::intervals::Random;

    const ROWS: usize = 400;

    /// The mean and the slope over time of runs of white noise of 0.1, with means that differ between them
    /// by this deviation.
    fn deviations(runs: usize, wander: f64, seed: u64) -> Deviations {
        let mut random = Random(seed);
        let mut rows = Vec::new();
        for _ in 0..runs {
            let mean = wander * random.normal();
            for k in 0..ROWS {
                let phase = k as f64 / ROWS as f64 - 0.5;
                rows.push(([1.0, phase], mean + 0.1 * random.normal()));
            }
        }
        let mut factor = QrFactor::new(vec!["mean".to_owned(), "slope".to_owned()]);
        let columns = [0, 1].map(|c| rows.iter().map(move |(w, _)| w[c]));
        let w: Vec<f64> = columns.into_iter().flatten().collect();
        let tau: Vec<f64> = rows.iter().map(|(_, y)| *y).collect();
        factor.push_block(&w, &tau).unwrap();
        let values = factor.solve().unwrap();
        let mut scores = Scores::new(2, &[Autoregression::fit(0.01, &[0.0], rows.len())]);
        for (k, (w, y)) in rows.iter().enumerate() {
            if k % ROWS == 0 {
                scores.interrupt();
            }
            let residual = y - w[0] * values[0] - w[1] * values[1];
            scores.push(w, &[1.0], &[residual], &[1.0]).unwrap();
        }
        let blocks = scores.finish(&values).unwrap();
        blocks.deviations(&factor, &[0, 1], &values, 1.0).unwrap()
    }

    #[test]
    fn what_differs_between_runs_is_in_the_deviations() {
        // cosines contain a part of it, so that not every log needs more
        let (mut ratios, mut told) = (0.0, 0);
        for seed in 1..=20 {
            let found = deviations(4, 0.05, seed);
            ratios += found.sigma(0) / (0.05 / 2.0) / 20.0;
            if let Some(between) = found.between {
                assert!(between.are_runs && between.count == 4, "{between:?}");
                assert!(found.in_words().contains("between 4 runs"));
                told += 1;
            }
        }
        assert!(
            told >= 12 && (0.6..1.6).contains(&ratios),
            "{told} {ratios}"
        );
        // one run that wanders shows it by its parts
        let mut random = Random(5);
        let mut wander = 0.0;
        let mut factor = QrFactor::new(vec!["mean".to_owned()]);
        let values = (0..2000).map(|_| {
            wander += 0.01 * random.normal();
            wander + 0.1 * random.normal()
        });
        let values: Vec<f64> = values.collect();
        factor.push_block(&vec![1.0; 2000], &values).unwrap();
        let mean = factor.solve().unwrap();
        let mut scores = Scores::new(1, &[Autoregression::fit(0.01, &[0.0], 2000)]);
        for y in &values {
            scores.push(&[1.0], &[1.0], &[y - mean[0]], &[1.0]).unwrap();
        }
        let blocks = scores.finish(&mean).unwrap();
        let found = blocks.deviations(&factor, &[0], &mean, 1.0).unwrap();
        assert!(
            found
                .between
                .is_some_and(|own| !own.are_runs && own.count == 8)
        );
    }

    #[test]
    fn runs_that_differ_by_their_noise_only_do_not_add_to_the_deviations() {
        let added = (1..=100).filter(|seed| deviations(4, 0.0, *seed).between.is_some());
        assert!(added.count() <= 3);
    }

    #[test]
    fn what_is_told_of_runs_is_beyond_chance_with_one_degree_of_freedom_less_than_runs() {
        let least = 1.0 + MIN_CHANCE * (2.0_f64 / 3.0).sqrt();
        let told = (1..=200).filter_map(|seed| deviations(4, 0.012, seed).between);
        let growths: Vec<f64> = told.map(|own| own.growth * own.growth).collect();
        assert!(growths.len() > 20 && growths.iter().all(|own| *own > least));
    }

    #[test]
    fn runs_of_few_independent_samples_are_not_compared() {
        let mut scores = Scores::new(1, &[Autoregression::fit(0.01, &[0.0], 400)]);
        for k in 0..400 {
            if k % 100 == 0 {
                scores.interrupt();
            }
            scores
                .push(&[1.0], &[1.0], &[libm::sin(f64::from(k))], &[1.0])
                .unwrap();
        }
        let mut blocks = scores.finish(&[0.0]).unwrap();
        assert!(blocks.clusters().is_some_and(|own| own.1 == 4 && own.2));
        blocks.memory = 19.0;
        assert!(blocks.clusters().is_some());
        blocks.memory = 21.0;
        assert!(blocks.clusters().is_none());
    }

    /// The deviations of parameters beside so many sines in white noise.
    fn fitted(rows: usize, parameters: usize) -> Deviations {
        let mut random = Random(11);
        let labels = (0..parameters).map(|k| k.to_string()).collect();
        let mut factor = QrFactor::new(labels);
        let row = |t: usize| -> Vec<f64> {
            let wave = |k: usize| libm::sin((0.3 + 0.7 * k as f64) * t as f64);
            (0..parameters).map(wave).collect()
        };
        let tau: Vec<f64> = (0..rows).map(|_| random.normal()).collect();
        for (t, tau) in tau.iter().enumerate() {
            factor.push_block(&row(t), &[*tau]).unwrap();
        }
        let values = factor.solve().unwrap();
        let noise = Autoregression::fit(1.0, &[0.0], rows);
        let mut scores = Scores::new(parameters, &[noise]);
        for (t, tau) in tau.iter().enumerate() {
            let own: f64 = row(t).iter().zip(&values).map(|(w, x)| w * x).sum();
            scores.push(&row(t), &[1.0], &[tau - own], &[1.0]).unwrap();
        }
        let all: Vec<usize> = (0..parameters).collect();
        let blocks = scores.finish(&values).unwrap();
        blocks.deviations(&factor, &all, &values, 1.0).unwrap()
    }

    #[test]
    fn what_a_fit_takes_from_the_memory_of_its_residuals_makes_deviations_larger() {
        let found = fitted(60, 20);
        assert!(found.between.is_none());
        for (whole, within) in found.covariance.iter().zip(found.within_runs()) {
            assert!((whole / within - 1.125).abs() < 1e-9, "{whole} {within}");
        }
    }

    #[test]
    fn no_variance_is_smaller_than_that_of_noise_that_was_raised() {
        let (n, rows) = (8, 60);
        let mut random = Random(7);
        let labels = (0..n).map(|k| k.to_string()).collect();
        let mut factor = QrFactor::new(labels);
        let mut all = Vec::new();
        for _ in 0..rows {
            let row: Vec<f64> = (0..n).map(|_| random.normal()).collect();
            all.push((row, random.normal()));
        }
        for (row, tau) in &all {
            factor.push_block(row, &[*tau]).unwrap();
        }
        let values = factor.solve().unwrap();
        let of = |level: f64, is_raised: bool| {
            let noise = [Autoregression::white(level)];
            let scores = Scores::new(n, &noise);
            let mut scores = scores.of_noise(FilteredNoise::unfiltered().thinning(), is_raised);
            for (row, tau) in &all {
                let own: f64 = row.iter().zip(&values).map(|(w, x)| w * x).sum();
                scores.push(row, &[1.0], &[tau - own], &[1.0]).unwrap();
            }
            let kept: Vec<usize> = (0..n).collect();
            let blocks = scores.finish(&values).unwrap();
            blocks.deviations(&factor, &kept, &values, 1.0).unwrap()
        };
        let inverse = inverse_gram(&factor).unwrap();
        let (plain, raised) = (of(9.0, false), of(9.0, true));
        for k in 0..n {
            let least = 3.0 * inverse[k * n + k].sqrt();
            assert!(plain.sigma(k) < 0.7 * least);
            assert!(raised.sigma(k) > 0.999 * least);
        }
    }

    #[test]
    fn of_less_than_three_equations_for_two_parameters_no_value_is_known() {
        let found = fitted(4, 3);
        let diagonal = |matrix: &[f64]| (0..3).all(|k| matrix[4 * k].is_infinite());
        assert!(diagonal(&found.covariance) && diagonal(found.root()));
        assert!(fitted(40, 3).covariance.iter().all(|x| x.is_finite()));
    }

    #[test]
    fn further_errors_are_in_the_covariance_and_in_what_is_drawn_from() {
        let found = deviations(2, 0.0, 3);
        let change = [0.02, -0.05];
        let with = found.with_change(&change);
        let drawn = |own: &Deviations, i: usize, j: usize| -> f64 {
            let columns = own.root().chunks_exact(2);
            columns.map(|column| column[i] * column[j]).sum()
        };
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let more = change[i] * change[j];
            let covariance = with.covariance[2 * j + i] - found.covariance[2 * j + i];
            assert!((covariance - more).abs() < 1e-12, "{i} {j}");
            let root = drawn(&with, i, j) - drawn(&found, i, j);
            assert!((root - more).abs() < 1e-12, "{i} {j}");
        }
        // what sampling adds is told where it matters
        let small: Vec<f64> = (0..2).map(|k| 0.1 * found.sigma(k)).collect();
        assert_eq!(found.with_sampling(&[small]).1, "");
        assert_eq!(
            found.with_sampling(&[vec![0.0, found.sigma(1)]]).1,
            SAMPLING
        );
    }

    #[test]
    fn a_covariance_that_is_none_is_drawn_from_without_correlations() {
        assert_eq!(root_of(&[4.0, 9.0, 9.0, 9.0], 2), [2.0, 0.0, 0.0, 3.0]);
    }

    #[test]
    fn scores_of_other_parameters_tell_the_same_after_the_step_to_an_estimate() {
        let mut random = Random(2);
        let rows: Vec<([f64; 2], f64)> = (0..300)
            .map(|k| {
                let row = [1.0, libm::sin(0.05 * f64::from(k))];
                (row, 3.0 * row[0] - row[1] + random.normal())
            })
            .collect();
        let mut factor = QrFactor::new(vec!["a".to_owned(), "b".to_owned()]);
        for (row, y) in &rows {
            factor.push_block(row, &[*y]).unwrap();
        }
        let values = factor.solve().unwrap();
        let from = |start: [f64; 2]| {
            let mut scores = Scores::new(2, &[Autoregression::fit(1.0, &[0.0], 300)]);
            for (row, y) in &rows {
                let residual = y - row[0] * start[0] - row[1] * start[1];
                scores.push(row, &[1.0], &[residual], &[1.0]).unwrap();
            }
            let blocks = scores.finish(&start).unwrap();
            blocks.deviations(&factor, &[0, 1], &values, 1.0).unwrap()
        };
        let (own, other) = (from([values[0], values[1]]), from([0.0, 5.0]));
        for (a, b) in own.covariance.iter().zip(&other.covariance) {
            assert!((a - b).abs() < 1e-9 * own.covariance[0], "{a} {b}");
        }
    }
}
