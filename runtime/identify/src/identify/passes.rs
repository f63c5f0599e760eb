//! Passes over a log that compute QR factors, estimates, residuals and covariances.

use serde::{Deserialize, Serialize};
use statrs::distribution::{Continuous, ContinuousCDF, Normal};

use super::delay::{Delays, delays};
use super::equation_builder::{EquationBuilder, EquationKind, Equations, StateSample};
use super::replay::Replay;
use super::stream::{Filtering, LeftOut};
use crate::estimate::{
    Accumulator, Autocorrelated, Autoregression, Blocks, Deviations, EffortError, Estimate,
    EstimateError, FactorSet, ORDER, QrFactor, Residuals, Scores, Weighting,
};
use regen_runtime::BaseModel;

/// A log that can be read any number of times.
pub trait Source {
    /// The error of reading the log.
    type Error: From<EstimateError>;

    /// Passes all rows to `each` in order of time.
    ///
    /// # Errors
    /// When the log cannot be read, and the errors of `each`.
    fn visit(
        &mut self,
        each: &mut dyn FnMut(&StateSample<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), Self::Error>;

    /// How the equations of the rows are filtered, decimated and left out at standstill.
    fn filtering(&self) -> Filtering;
}

/// Options of a least-squares estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// How efforts are weighted against each other.
    pub weighting: Weighting,
    /// Huber's bound in standard deviations, beyond which the cost of a residual is linear: 1.345
    /// keeps 95 % of the efficiency on normal noise. `None`: plain least squares.
    pub huber: Option<f64>,
    /// The number of autocorrelations of the residuals to compute.
    pub lags: usize,
    /// Number of samples in which residuals are correlated: the covariance is then Newey and
    /// West's (1987) with this bandwidth. `None`: the covariance of [`Deviations`].
    pub bandwidth: Option<usize>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            weighting: Weighting::PerEffort,
            huber: None,
            lags: 20,
            bandwidth: None,
        }
    }
}

/// An estimate with its residuals' statistics and its covariance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Identified {
    /// The parameters, with the covariance for white residuals.
    pub estimate: Estimate,
    /// The QR factor whose solution the estimate is: all efforts with their weights, and Huber's.
    pub factor: QrFactor,
    /// The standard deviations that account for the residuals' correlation in time.
    pub deviations: Deviations,
    /// The scores that the deviations are computed from, for estimates of some of the parameters
    /// only.
    pub blocks: Blocks,
    /// The number of samples that count as correlated: as many as carry the information of one
    /// independent sample, or [`Options::bandwidth`] if that is given.
    pub bandwidth: usize,
    /// The errors of each effort.
    pub errors: Vec<EffortError>,
    /// eps_RA over all efforts, percent (Eq. 33).
    pub relative_absolute: f64,
    /// The samples and equations that were left out, by reason.
    pub left_out: LeftOut,
    /// The delays of the logged efforts behind the motion; none for energy balances.
    pub delays: Delays,
}

impl Identified {
    /// The estimate with the covariance that accounts for the residuals' correlation in time.
    pub fn correlated(&self) -> Estimate {
        self.estimate.with_deviations(&self.deviations)
    }
}

/// Most passes of Huber's reweighting.
const MAX_HUBER_PASSES: usize = 50;
/// The reweighting ends once no parameter changes by more than this many standard deviations.
const HUBER_TOLERANCE_DEVIATIONS: f64 = 1e-6;

/// The estimate that Huber's weights are computed from.
struct Huber<'a> {
    values: &'a [f64],
    sigmas: &'a [f64],
    bound: f64,
}

impl Huber<'_> {
    /// Huber's weight of a residual: 1 within the bound, less beyond.
    fn weight(&self, effort: usize, residual: f64) -> f64 {
        let sigma = self.sigmas.get(effort).copied().unwrap_or(1.0);
        let size = residual.abs() / sigma;
        if size > self.bound {
            self.bound / size
        } else {
            1.0
        }
    }
}

/// Reduces a log to one QR factor for each effort; also returns what was left out.
///
/// # Errors
/// When the log cannot be read or does not fit the model.
pub fn observe<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    model: &M,
    kind: EquationKind,
    source: &mut S,
) -> Result<(FactorSet, LeftOut), S::Error> {
    let mut replay = Replay::new(model, kind, source);
    let (set, _) = reduce_weighted(&mut replay, None)?;
    Ok((set, replay.left().clone()))
}

/// The QR factors, and for each effort the sum of the squared residuals times Huber's weights.
fn reduce_weighted<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    huber: Option<&Huber<'_>>,
) -> Result<(FactorSet, Vec<f64>), S::Error> {
    let origin = EquationBuilder::new(replay.model(), replay.kind()).origin();
    let mut rows = Accumulator::new(&origin);
    let mut squares = vec![0.0; origin.efforts.len()];
    replay.visit(&mut |equations| {
        let count = equations.tau.len();
        for (effort, (tau, weight)) in equations.tau.iter().zip(equations.weights).enumerate() {
            if *weight == 0.0 {
                continue;
            }
            let entries = &equations.w[effort..];
            let robust = huber.map_or(1.0, |h| {
                let residual = (tau - predicted(equations, effort, h.values)) * weight;
                let share = h.weight(effort, residual);
                if let Some(sum) = squares.get_mut(effort) {
                    *sum += (share * residual).powi(2);
                }
                share.sqrt()
            });
            rows.push(effort, entries, count, *tau, weight * robust)?;
        }
        Ok(())
    })?;
    Ok((rows.finish()?, squares))
}

/// The right-hand side of equation `effort` that base parameters predict, N or N m.
pub(super) fn predicted(equations: &Equations<'_>, effort: usize, values: &[f64]) -> f64 {
    let stride = equations.tau.len().max(1);
    let entries = equations.w.iter().skip(effort).step_by(stride);
    entries.zip(values).map(|(w, x)| w * x).sum()
}

/// Identifies base parameters from a log: the estimate, its residuals, and the covariance that
/// accounts for their correlation. Several passes over the equations; logs whose equations do not
/// fit into memory are read in each.
///
/// # Errors
/// When the log cannot be read or does not fit the model, or leaves parameters undetermined.
///
/// ```
/// # mod models {
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs"));
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum_base.rs"));
/// # }
/// # use models::Pendulum;
/// use regen_identify::identify::{EquationKind, Options, Recorded, identify};
///
/// // a pendulum of 0.5 kg m^2 and 2 kg m about its axis, moved as q = sin(t)
/// let mut log = Recorded::new();
/// for k in 0..100 {
///     let t = 0.05 * f64::from(k);
///     let (q, qd, qdd) = (t.sin(), t.cos(), -t.sin());
///     let tau = 0.5 * qdd + 2.0 * 9.81 * q.sin();
///     log.push(t, &[q], &[qd], &[qdd], &[tau]);
/// }
/// let found = identify(&Pendulum, EquationKind::Forces, &Options::default(), &mut log)?;
/// assert_eq!(found.estimate.labels, ["Izz(1)", "mx(1)"]);
/// assert!((found.estimate.values[0] - 0.5).abs() < 1e-9);
/// assert!((found.estimate.values[1] - 2.0).abs() < 1e-9);
/// assert!(found.relative_absolute < 1e-6, "percent");
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn identify<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    model: &M,
    kind: EquationKind,
    options: &Options,
    source: &mut S,
) -> Result<Identified, S::Error> {
    let mut replay = Replay::new(model, kind, source);
    let (plain, _) = reduce_weighted(&mut replay, None)?;
    let left_out = replay.left().clone();
    let mut estimate = Estimate::new(&plain, options.weighting)?;
    let weights: Vec<f64> = estimate.efforts.iter().map(|e| e.weight).collect();
    let mut factor = plain.combined(&weights)?;
    if let Some(bound) = options.huber {
        for _ in 0..MAX_HUBER_PASSES {
            let (next, own) = reweighted(&mut replay, &estimate, bound, options.weighting)?;
            let deviation = |k: usize| next.sigma(k).max(f64::MIN_POSITIVE);
            let pairs = next.values.iter().zip(&estimate.values).enumerate();
            let moved = pairs.fold(0.0, |m: f64, (k, (a, b))| {
                m.max((a - b).abs() / deviation(k))
            });
            (estimate, factor) = (next, own);
            if moved < HUBER_TOLERANCE_DEVIATIONS {
                break;
            }
        }
    }
    let means = plain.means();
    let (errors, noise) = noise_of(&mut replay, options, &estimate, &means)?;
    let efforts = errors.efforts();
    let weights: Vec<f64> = estimate.efforts.iter().map(|e| e.weight).collect();
    let whole = plain.combined(&weights)?;
    let rows = efforts.iter().map(|e| e.samples).max().unwrap_or(0);
    let given = options.bandwidth.map(|b| b.clamp(1, rows.max(1)));
    let (blocks, stated, spread) = scores(&mut replay, options, &estimate, &noise, given)?;
    let inside = match options.huber {
        Some(_) => spread.inside as f64 / spread.rows.max(1) as f64,
        None => 1.0,
    };
    let all: Vec<usize> = (0..estimate.values.len()).collect();
    let mut deviations = blocks.deviations(&whole, &all, &estimate.values, inside)?;
    if let Some(stated) = stated {
        let covariance = stated.covariance(&whole)?;
        let covariance = covariance.iter().map(|c| c / (inside * inside));
        deviations = deviations.with_covariance(covariance.collect(), estimate.degrees_of_freedom);
    }
    if options.huber.is_some() {
        // Huber (1973): (W^T W)^-1 times the mean of psi^2 over the squared part within bounds
        let gram = Estimate::of(&whole)?;
        let spare = gram.degrees_of_freedom.max(1) as f64;
        let unit = whole.squared_residual(&gram.values)? / spare;
        let variance = spread.squares / spare / (inside * inside);
        let scale = if unit > 0.0 { variance / unit } else { 0.0 };
        estimate.covariance = gram.covariance.iter().map(|c| c * scale).collect();
    }
    let bandwidth = given.unwrap_or_else(|| andrews_bandwidth(&efforts, rows));
    let delays = match kind {
        EquationKind::Forces => {
            let names: Vec<String> = estimate.efforts.iter().map(|e| e.name.clone()).collect();
            let labels = &estimate.labels;
            delays(
                &mut replay,
                labels,
                &estimate.values,
                &names,
                &weights,
                bandwidth,
            )?
        }
        EquationKind::Energy { .. } => Delays::default(),
    };
    Ok(Identified {
        relative_absolute: errors.relative_absolute(),
        errors: efforts,
        estimate,
        factor,
        bandwidth: given.unwrap_or_else(|| samples_per_independent_one(&blocks)),
        deviations,
        blocks,
        left_out,
        delays,
    })
}

/// One step of Huber's estimate of values and scales (his second proposal): the scales are such
/// that the bounded residuals have the variance they would have for normal noise.
fn reweighted<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    last: &Estimate,
    bound: f64,
    weighting: Weighting,
) -> Result<(Estimate, QrFactor), S::Error> {
    let sigmas: Vec<f64> = last.efforts.iter().map(|e| e.sigma).collect();
    let huber = Huber {
        values: &last.values,
        sigmas: &sigmas,
        bound,
    };
    let (set, squares) = reduce_weighted(replay, Some(&huber))?;
    let normal = Normal::standard();
    let beyond = normal.sf(bound);
    let inside = 1.0 - 2.0 * beyond - 2.0 * bound * normal.pdf(bound);
    let expected = (2.0 * bound * bound).mul_add(beyond, inside);
    let all: usize = set.factors().iter().map(QrFactor::rows).sum();
    let free = 1.0 - last.values.len() as f64 / all.max(1) as f64;
    let scales = squares.iter().zip(set.factors()).zip(&sigmas);
    let scales = scales.map(|((squares, factor), old)| {
        let variance = squares / (expected * free * factor.rows() as f64);
        if variance > 0.0 {
            variance.sqrt()
        } else {
            *old
        }
    });
    let scales: Vec<f64> = scales.collect();
    let weights: Vec<f64> = scales
        .iter()
        .map(|sigma| match weighting {
            Weighting::Equal => 1.0,
            Weighting::PerEffort => 1.0 / sigma,
        })
        .collect();
    let factor = set.combined(&weights)?;
    let mut next = Estimate::of(&factor)?;
    next.efforts.clone_from(&last.efforts);
    for (effort, (sigma, weight)) in next.efforts.iter_mut().zip(scales.iter().zip(&weights)) {
        effort.sigma = *sigma;
        effort.weight = *weight;
    }
    Ok((next, factor))
}

/// Computes the residuals of given parameters on a log.
///
/// - `values`: base parameters, SI;
/// - `means`: of the efforts on this log, for eps_RA; see [`FactorSet::means`];
/// - `lags`: the number of autocorrelations to compute.
///
/// # Errors
/// When the log cannot be read or does not fit the model.
pub fn residuals<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    model: &M,
    kind: EquationKind,
    source: &mut S,
    values: &[f64],
    means: &[f64],
    lags: usize,
) -> Result<Residuals, S::Error> {
    residuals_of(&mut Replay::new(model, kind, source), values, means, lags)
}

fn residuals_of<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    values: &[f64],
    means: &[f64],
    lags: usize,
) -> Result<Residuals, S::Error> {
    let origin = EquationBuilder::new(replay.model(), replay.kind()).origin();
    let mut out = Residuals::new(&origin.efforts, means, lags);
    let mut fitted = Vec::new();
    let mut used = Vec::new();
    replay.visit(&mut |equations| {
        if !equations.follows {
            out.interrupt();
        }
        if equations.tau.is_empty() {
            return Ok(());
        }
        fitted.clear();
        fitted.extend((0..equations.tau.len()).map(|e| predicted(equations, e, values)));
        used.clear();
        used.extend(equations.weights.iter().map(|w| *w > 0.0));
        out.push_used(equations.tau, &fitted, &used)
    })?;
    Ok(out)
}

/// Sums over the weighted residuals bounded by Huber (psi), and how many are within the bound.
#[derive(Default)]
struct Spread {
    squares: f64,
    inside: usize,
    rows: usize,
}

/// The errors of an estimate, and for each effort an autoregression of its weighted residuals,
/// bounded where Huber bounds them.
fn noise_of<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    options: &Options,
    estimate: &Estimate,
    means: &[f64],
) -> Result<(Residuals, Vec<Autoregression>), S::Error> {
    let names: Vec<String> = estimate.efforts.iter().map(|e| e.name.clone()).collect();
    let mut errors = Residuals::new(&names, means, options.lags);
    let none = vec![0.0; names.len()];
    let mut noise = Residuals::new(&names, &none, ORDER);
    let mut weighed = Weighed::new(options, estimate);
    replay.visit(&mut |equations| {
        if !equations.follows {
            errors.interrupt();
            noise.interrupt();
        }
        if equations.tau.is_empty() {
            return Ok(());
        }
        weighed.take(equations);
        errors.push_used(equations.tau, &weighed.fitted, &weighed.used)?;
        noise.push_used(&weighed.psi, &none, &weighed.used)
    })?;
    let noise = noise.efforts();
    let fits = noise
        .iter()
        .map(|e| Autoregression::fit(e.rms * e.rms, &e.autocorrelation, e.samples));
    Ok((errors, fits.collect()))
}

/// The weighted and bounded residuals of one sample, as scores need them.
struct Weighed<'a> {
    estimate: &'a Estimate,
    bound: f64,
    sigmas: Vec<f64>,
    fitted: Vec<f64>,
    used: Vec<bool>,
    weights: Vec<f64>,
    psi: Vec<f64>,
    slopes: Vec<f64>,
}

impl<'a> Weighed<'a> {
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

    fn take(&mut self, equations: &Equations<'_>) {
        self.fitted.clear();
        self.used.clear();
        self.weights.clear();
        self.psi.clear();
        self.slopes.clear();
        let huber = Huber {
            values: &self.estimate.values,
            sigmas: &self.sigmas,
            bound: self.bound,
        };
        for (e, (tau, own)) in equations.tau.iter().zip(equations.weights).enumerate() {
            let fitted = predicted(equations, e, &self.estimate.values);
            let weight = own * self.estimate.efforts.get(e).map_or(1.0, |fit| fit.weight);
            let robust = huber.weight(e, (tau - fitted) * own);
            self.fitted.push(fitted);
            self.used.push(*own > 0.0);
            self.weights.push(weight);
            self.psi.push((tau - fitted) * weight * robust);
            self.slopes.push(if robust < 1.0 { 0.0 } else { 1.0 });
        }
    }
}

/// The sums over scores for the covariance that accounts for correlation; for a given bandwidth
/// also those of Newey and West.
fn scores<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    options: &Options,
    estimate: &Estimate,
    noise: &[Autoregression],
    bandwidth: Option<usize>,
) -> Result<(Blocks, Option<Autocorrelated>, Spread), S::Error> {
    let n = estimate.values.len();
    let mut out = Scores::new(n, noise);
    let mut stated = bandwidth.map(|b| Autocorrelated::new(n, b));
    let mut spread = Spread::default();
    let mut score = vec![0.0; n];
    let mut weighed = Weighed::new(options, estimate);
    replay.visit(&mut |equations| {
        if !equations.follows {
            out.interrupt();
            if let Some(stated) = &mut stated {
                stated.interrupt();
            }
        }
        let count = equations.tau.len();
        if count == 0 {
            return Ok(());
        }
        weighed.take(equations);
        for (e, used) in weighed.used.iter().enumerate() {
            if *used {
                spread.squares += weighed.psi[e].powi(2);
                spread.inside += usize::from(weighed.slopes[e] > 0.0);
                spread.rows += 1;
            }
        }
        let Weighed {
            weights,
            psi,
            slopes,
            ..
        } = &weighed;
        out.push(equations.w, weights, psi, slopes)?;
        let Some(stated) = &mut stated else {
            return Ok(());
        };
        score.fill(0.0);
        for (e, (weight, psi)) in weights.iter().zip(psi).enumerate() {
            let entries = equations.w.iter().skip(e).step_by(count);
            for (s, w) in score.iter_mut().zip(entries) {
                *s += w * weight * psi;
            }
        }
        stated.push(&score)
    })?;
    Ok((out.finish(&estimate.values)?, stated, spread))
}

/// How many consecutive samples carry the information of one independent sample, rounded.
fn samples_per_independent_one(blocks: &Blocks) -> usize {
    #[allow(clippy::cast_sign_loss, reason = "it is at least 1")]
    let samples = blocks.memory().round() as usize;
    samples
}

/// Bartlett's bandwidth from the autocorrelation at lag 1 (Andrews, 1991), for the effort with
/// the strongest one; 1 for white residuals.
fn andrews_bandwidth(efforts: &[EffortError], rows: usize) -> usize {
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
