//! Passes over the residuals of an estimate: errors, noise, and the scores of covariances.

use super::delay::{DelayFit, DelayScores};
use super::equation_builder::Equations;
use super::huber::Huber;
use super::passes::{Options, predictions};
use super::replay::Replay;
use crate::states::Source;
use std::collections::VecDeque;

use crate::estimate::huber::PsiSums;
use crate::estimate::{
    Autocorrelated, Blocks, EffortError, EffortNoise, Estimate, EstimateError, NoiseResiduals,
    QrFactor, Residuals, Thinning, inverse_gram,
};
use regen_runtime::BaseModel;

/// The errors of an estimate, and the noise of its efforts: that of their weighted residuals, which are
/// bounded by Huber's weight.
pub(super) fn noise_of<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    options: &Options,
    estimate: &Estimate,
    (factor, means): (&QrFactor, &[f64]),
    mut delays: Option<&mut DelayFit<'_>>,
) -> Result<(Residuals, EffortNoise), S::Error> {
    let names: Vec<String> = estimate.efforts.iter().map(|e| e.name.clone()).collect();
    let mut errors = Residuals::new(&names, means, options.lags);
    let filter = replay.filtered_noise();
    let mut thinning = filter.thinning();
    let mut residuals = NoiseResiduals::new(names.len(), filter);
    let mut weighted = WeightedResiduals::new(options, estimate);
    replay.visit(&mut |equations| {
        if !equations.follows {
            errors.interrupt();
            residuals.interrupt();
        }
        if equations.tau.is_empty() {
            return Ok(());
        }
        if let Some(delays) = &mut delays {
            delays.push(equations)?;
        }
        weighted.compute(equations);
        errors.push_used(equations.tau, &weighted.fitted, &weighted.used)?;
        residuals.push(&weighted.psi, &weighted.used)
    })?;
    let noise = residuals.noise();
    let rows: usize = errors.efforts().iter().map(|own| own.samples).sum();
    if (factor.columns() as f64) < MIN_TAKEN_PART * rows as f64 / noise.memory() {
        return Ok((errors, noise));
    }
    let taken = taken_by_fit(replay, estimate, factor, (&residuals, &mut thinning))?;
    // bounded residuals are no more the noise of the rows
    let white = if options.huber.is_none() {
        replay.white_noise()?
    } else {
        Vec::new()
    };
    let white = estimate.efforts.iter().zip(white);
    let white: Vec<f64> = white.map(|(own, x)| own.weight * own.weight * x).collect();
    Ok((errors, residuals.noise_before_fit(&taken, &white)))
}

/// What a fit takes from its residuals is put back where its parameters are at least this part of the
/// independent equations.
const MIN_TAKEN_PART: f64 = 0.02;

/// The sums of [`taken_by_fit`] are over so many equations of each effort, at least: they are means of the motion.
const MIN_ANCHORS: usize = 128;

/// For each effort the sums over its equations of `w(t) (W^T W)^-1 w(t + l)^T`, l = 0, 1, ...: residuals of white
/// noise are without this part of its autocovariance. Evenly spaced equations t are taken for all.
///
/// - `factor`: the R of `W^T W`; `residuals`: of the equations, with those that they were taken from.
fn taken_by_fit<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    estimate: &Estimate,
    factor: &QrFactor,
    (residuals, thinning): (&NoiseResiduals, &mut Thinning),
) -> Result<Vec<Vec<f64>>, S::Error> {
    struct Anchored {
        every: usize,
        count: usize,
        lags: usize,
        /// `(W^T W)^-1 w(t)^T` of the last equations t that are taken, each with the number of later equations.
        waiting: VecDeque<(usize, Vec<f64>)>,
        sums: Vec<f64>,
    }
    let inverse = inverse_gram(factor).ok_or(EstimateError::NoConvergence)?;
    let n = factor.columns();
    let mut efforts: Vec<Anchored> = (residuals.efforts().iter())
        .map(|own| Anchored {
            every: (own.samples / MIN_ANCHORS).max(1),
            count: 0,
            lags: own.autocorrelation.len(),
            waiting: VecDeque::new(),
            sums: vec![0.0; own.autocorrelation.len() + 1],
        })
        .collect();
    let scale = thinning.weight();
    let mut row = Vec::with_capacity(n);
    replay.visit(&mut |equations| {
        let stride = equations.tau.len();
        if !equations.follows {
            thinning.interrupt();
        }
        if stride == 0 || !thinning.takes_next() {
            return Ok(());
        }
        for (e, own) in efforts.iter_mut().enumerate().take(stride) {
            let weight = equations.weights.get(e).copied().unwrap_or(0.0);
            if !equations.follows || weight == 0.0 {
                own.waiting.clear();
            }
            if weight == 0.0 {
                continue;
            }
            let is_taken = own.count.is_multiple_of(own.every);
            own.count += 1;
            if !is_taken && own.waiting.is_empty() {
                continue;
            }
            let weight = scale * weight * estimate.efforts.get(e).map_or(1.0, |fit| fit.weight);
            row.clear();
            let entries = equations.w.iter().skip(e).step_by(stride);
            row.extend(entries.map(|w| w * weight));
            if is_taken {
                let mut solved = vec![0.0; n];
                for (column, w) in inverse.chunks_exact(n.max(1)).zip(&row) {
                    for (sum, x) in solved.iter_mut().zip(column) {
                        *sum += x * w;
                    }
                }
                own.waiting.push_front((0, solved));
            }
            let lags = own.lags;
            own.waiting.retain_mut(|(lag, solved)| {
                let product: f64 = solved.iter().zip(&row).map(|(a, b)| a * b).sum();
                if let Some(sum) = own.sums.get_mut(*lag) {
                    *sum += product;
                }
                *lag += 1;
                *lag <= lags
            });
        }
        Ok(())
    })?;
    let scaled = efforts.into_iter().map(|own| {
        let taken = own.count.div_ceil(own.every).max(1) as f64;
        let factor = own.count as f64 / taken;
        own.sums.iter().map(|sum| factor * sum).collect()
    });
    Ok(scaled.collect())
}

/// The weighted and bounded residuals of one sample, from which scores are computed. The lists have
/// one entry per equation.
struct WeightedResiduals<'a> {
    estimate: &'a Estimate,
    /// Huber's bound in standard deviations; infinite for plain least squares.
    bound: f64,
    /// The standard deviation of each effort's residuals, N or N m, or J.
    sigmas: Vec<f64>,
    /// The predicted right-hand sides, N or N m, or J.
    fitted: Vec<f64>,
    /// Whether the equation is used: at standstill it may be left out.
    used: Vec<bool>,
    /// The factor on the equation: its own weight times that of its effort.
    weights: Vec<f64>,
    /// The residual times its factor and Huber's weight.
    psi: Vec<f64>,
    /// The derivative of psi by the weighted residual: 1 within Huber's bound, 0 beyond.
    slopes: Vec<f64>,
}

impl<'a> WeightedResiduals<'a> {
    fn new(options: &Options, estimate: &'a Estimate) -> Self {
        Self {
            estimate,
            bound: options.huber.unwrap_or(f64::INFINITY),
            sigmas: estimate.efforts.iter().map(|e| e.sigma).collect(),
            fitted: Vec::new(),
            used: Vec::new(),
            weights: Vec::new(),
            psi: Vec::new(),
            slopes: Vec::new(),
        }
    }

    /// Replaces the residuals by those of a sample's equations.
    fn compute(&mut self, equations: &Equations<'_>) {
        predictions(equations, &self.estimate.values, &mut self.fitted);
        self.used.clear();
        self.weights.clear();
        self.psi.clear();
        self.slopes.clear();
        let huber = Huber {
            values: &self.estimate.values,
            sigmas: &self.sigmas,
            bound: self.bound,
        };
        let rows = equations.tau.iter().zip(equations.weights);
        for (e, ((tau, equation_weight), fitted)) in rows.zip(&self.fitted).enumerate() {
            let effort_weight = self.estimate.efforts.get(e).map_or(1.0, |fit| fit.weight);
            let weight = equation_weight * effort_weight;
            let huber_weight = huber.weight(e, (tau - fitted) * equation_weight);
            self.used.push(*equation_weight > 0.0);
            self.weights.push(weight);
            self.psi.push((tau - fitted) * weight * huber_weight);
            self.slopes.push(if huber_weight < 1.0 { 0.0 } else { 1.0 });
        }
    }
}

/// The sums over the scores (regressor rows times psi) for the covariance that accounts for
/// correlation in time; for a given bandwidth also those of Newey and West; and the sums over psi.
pub(super) fn scores<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    options: &Options,
    estimate: &Estimate,
    noise: &EffortNoise,
    bandwidth: Option<usize>,
    mut delays: Option<&mut DelayScores<'_>>,
) -> Result<(Blocks, Option<Autocorrelated>, PsiSums), S::Error> {
    let n = estimate.values.len();
    let mut scores = noise.scores(n).of_samples(replay.left_out().samples);
    let mut newey_west = bandwidth.map(|b| Autocorrelated::new(n, b));
    let mut psi_sums = PsiSums::default();
    let mut score = vec![0.0; n];
    let mut weighted = WeightedResiduals::new(options, estimate);
    replay.visit(&mut |equations| {
        if !equations.follows {
            scores.interrupt();
            if let Some(newey_west) = &mut newey_west {
                newey_west.interrupt();
            }
        }
        let count = equations.tau.len();
        if count == 0 {
            return Ok(());
        }
        if let Some(delays) = &mut delays {
            delays.push(equations)?;
        }
        weighted.compute(equations);
        for (e, used) in weighted.used.iter().enumerate() {
            if *used {
                psi_sums.squares += weighted.psi[e].powi(2);
                psi_sums.within_bound += usize::from(weighted.slopes[e] > 0.0);
                psi_sums.equations += 1;
            }
        }
        let WeightedResiduals {
            weights,
            psi,
            slopes,
            ..
        } = &weighted;
        scores.push(equations.w, weights, psi, slopes)?;
        let Some(newey_west) = &mut newey_west else {
            return Ok(());
        };
        score.fill(0.0);
        for (e, (weight, psi)) in weights.iter().zip(psi).enumerate() {
            let entries = equations.w.iter().skip(e).step_by(count);
            for (s, w) in score.iter_mut().zip(entries) {
                *s += w * weight * psi;
            }
        }
        newey_west.push(&score)
    })?;
    Ok((scores.finish(&estimate.values)?, newey_west, psi_sums))
}

/// How many consecutive samples carry the information of one independent sample, rounded.
pub(crate) fn samples_per_independent_one(blocks: &Blocks) -> usize {
    #[allow(clippy::cast_sign_loss, reason = "it is at least 1")]
    let samples = blocks.correlation_length().round() as usize;
    samples
}

/// Bartlett's bandwidth from the autocorrelation at lag 1 (Andrews, 1991), for the effort with
/// the strongest one; 1 for white residuals.
pub(super) fn andrews_bandwidth(efforts: &[EffortError], rows: usize) -> usize {
    let strongest = efforts
        .iter()
        .filter_map(|e| e.autocorrelation.first())
        .fold(0.0, |m: f64, r| m.max(r.abs()));
    // a larger correlation would make the bandwidth as long as the log
    let rho = strongest.min(0.999);
    let alpha = 4.0 * rho * rho / (1.0 - rho * rho).powi(2);
    let lags = 1.1447 * (alpha * rows as f64).cbrt();
    #[allow(clippy::cast_sign_loss, reason = "it is not negative")]
    let lags = lags as usize;
    1 + lags.min(rows / 4)
}
