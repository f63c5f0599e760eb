//! Passes over a log: to a factor, to an estimate, and to what its residuals say.

use std::prelude::v1::*;
use std::vec;

use serde::{Deserialize, Serialize};
use statrs::distribution::{Continuous, ContinuousCDF, Normal};

use super::delay::{Delays, delays};
use super::observer::{Equations, Kind, Observer, Row};
use super::replay::Replay;
use super::stream::{Filtering, LeftOut};
use crate::BaseModel;
use crate::estimate::{
    Accumulator, Autocorrelated, EffortError, Estimate, EstimateError, Factor, FactorSet,
    Residuals, Weighting,
};

/// A log that can be read any number of times.
pub trait Source {
    /// What can go wrong in reading it.
    type Error: From<EstimateError>;

    /// Hands over all rows in order.
    ///
    /// # Errors
    /// Its own, and those of `each`.
    fn visit(
        &mut self,
        each: &mut dyn FnMut(&Row<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), Self::Error>;

    /// What happens to the equations of its rows before they count.
    fn filtering(&self) -> Filtering;
}

/// How an estimate is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// How efforts are weighted against each other.
    pub weighting: Weighting,
    /// Huber's bound in standard deviations, beyond which residuals count linearly: 1.345 keeps
    /// 95 % of the efficiency on normal noise. `None`: plain least squares.
    pub huber: Option<f64>,
    /// Autocorrelations that are found of the residuals.
    pub lags: usize,
    /// Samples in which residuals are correlated, for the corrected covariance; `None`: chosen
    /// from their autocorrelation (Andrews, 1991).
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

/// An estimate with what the residuals say of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Identified {
    /// Values, and the covariance for white residuals.
    pub estimate: Estimate,
    /// The factor that it is the solution of: all efforts with their weights, and Huber's.
    pub factor: Factor,
    /// The covariance that knows of the residuals' correlation, n x n.
    pub correlated_covariance: Vec<f64>,
    /// The samples it counts as correlated.
    pub bandwidth: usize,
    /// The errors of each effort.
    pub errors: Vec<EffortError>,
    /// eps_RA over all efforts, percent (Eq. 33).
    pub relative_absolute: f64,
    /// What gave no equation, and why.
    pub left_out: LeftOut,
    /// By how much efforts are logged behind the motion; none where equations are of energy.
    pub delays: Delays,
}

/// Passes of Huber's reweighting at most.
const PASSES: usize = 50;
/// Parameters that change by less than this part of their deviation have settled.
const SETTLED: f64 = 1e-6;

/// What Huber's weights are taken from.
struct Huber<'a> {
    values: &'a [f64],
    sigmas: &'a [f64],
    bound: f64,
}

impl Huber<'_> {
    /// The weight of a residual.
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

/// Reduces a log to its factors; also returns what gave no equation.
///
/// # Errors
/// When the log cannot be read or does not fit the model.
pub fn observe<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    model: &M,
    kind: Kind,
    source: &mut S,
) -> Result<(FactorSet, LeftOut), S::Error> {
    let mut replay = Replay::new(model, kind, source);
    let (set, _) = reduce_weighted(&mut replay, None)?;
    Ok((set, replay.left().clone()))
}

/// The factors, and the sums of squares of the bounded residuals of each effort.
fn reduce_weighted<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    huber: Option<&Huber<'_>>,
) -> Result<(FactorSet, Vec<f64>), S::Error> {
    let origin = Observer::new(replay.model(), replay.kind()).origin();
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

/// The effort that base parameters predict, N or N m.
pub(super) fn predicted(equations: &Equations<'_>, effort: usize, values: &[f64]) -> f64 {
    let stride = equations.tau.len().max(1);
    let entries = equations.w.iter().skip(effort).step_by(stride);
    entries.zip(values).map(|(w, x)| w * x).sum()
}

/// Identifies base parameters from a log: estimate, residuals, and the covariance that knows
/// of their correlation. Reads the log three times; with Huber's weights once more per pass.
///
/// # Errors
/// When the log cannot be read or does not fit the model, or leaves parameters undetermined.
///
/// ```
/// # mod models {
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/models/pendulum.rs"));
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/models/pendulum_base.rs"));
/// # }
/// # use models::Pendulum;
/// use regen_runtime::identify::{Kind, Options, Recorded, identify};
///
/// // a pendulum of 0.5 kg m^2 and 2 kg m about its axis, moved as q = sin(t)
/// let mut log = Recorded::new();
/// for k in 0..100 {
///     let t = 0.05 * f64::from(k);
///     let (q, qd, qdd) = (t.sin(), t.cos(), -t.sin());
///     let tau = 0.5 * qdd + 2.0 * 9.81 * q.sin();
///     log.push(t, &[q], &[qd], &[qdd], &[tau]);
/// }
/// let found = identify(&Pendulum, Kind::Forces, &Options::default(), &mut log)?;
/// assert_eq!(found.estimate.labels, ["Izz(1)", "mx(1)"]);
/// assert!((found.estimate.values[0] - 0.5).abs() < 1e-9);
/// assert!((found.estimate.values[1] - 2.0).abs() < 1e-9);
/// assert!(found.relative_absolute < 1e-6, "percent");
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn identify<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    model: &M,
    kind: Kind,
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
        for _ in 0..PASSES {
            let (next, own) = reweighted(&mut replay, &estimate, bound, options.weighting)?;
            let deviation = |k: usize| next.sigma(k).max(f64::MIN_POSITIVE);
            let pairs = next.values.iter().zip(&estimate.values).enumerate();
            let moved = pairs.fold(0.0, |m: f64, (k, (a, b))| {
                m.max((a - b).abs() / deviation(k))
            });
            (estimate, factor) = (next, own);
            if moved < SETTLED {
                break;
            }
        }
    }
    let means = plain.means();
    let errors = residuals_of(&mut replay, &estimate.values, &means, options.lags)?;
    let efforts = errors.efforts();
    let rows = efforts.iter().map(|e| e.samples).max().unwrap_or(0);
    let bandwidth = options
        .bandwidth
        .unwrap_or_else(|| automatic(&efforts, rows))
        .clamp(1, rows.max(1));
    let (correlated, spread) = scores(&mut replay, options, &estimate, bandwidth)?;
    let weights: Vec<f64> = estimate.efforts.iter().map(|e| e.weight).collect();
    let whole = plain.combined(&weights)?;
    let mut correlated_covariance = correlated.covariance(&whole)?;
    if options.huber.is_some() {
        // Huber (1973): (W^T W)^-1 times the mean of psi^2 over the squared part within bounds
        let gram = Estimate::of(&whole)?;
        let spare = gram.degrees_of_freedom.max(1) as f64;
        let unit = whole.squared_residual(&gram.values)? / spare;
        let inside = spread.inside as f64 / spread.rows.max(1) as f64;
        let variance = spread.squares / spare / (inside * inside);
        let scale = if unit > 0.0 { variance / unit } else { 0.0 };
        estimate.covariance = gram.covariance.iter().map(|c| c * scale).collect();
        for c in &mut correlated_covariance {
            *c /= inside * inside;
        }
    }
    let delays = match kind {
        Kind::Forces => {
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
        Kind::Energy { .. } => Delays::default(),
    };
    Ok(Identified {
        relative_absolute: errors.relative_absolute(),
        errors: efforts,
        estimate,
        factor,
        correlated_covariance,
        bandwidth,
        left_out,
        delays,
    })
}

/// A step of Huber's estimate of values and scales (his second proposal): the scales are such
/// that the bounded residuals have the variance they have in normal noise.
fn reweighted<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    last: &Estimate,
    bound: f64,
    weighting: Weighting,
) -> Result<(Estimate, Factor), S::Error> {
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
    let all: usize = set.factors().iter().map(Factor::rows).sum();
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

/// The residuals of given parameters on a log.
///
/// - `means`: of the efforts on this log, for eps_RA; see [`FactorSet::means`].
///
/// # Errors
/// When the log cannot be read or does not fit the model.
pub fn residuals<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    model: &M,
    kind: Kind,
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
    let origin = Observer::new(replay.model(), replay.kind()).origin();
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

/// Sums of psi over standardised residuals.
#[derive(Default)]
struct Spread {
    squares: f64,
    inside: usize,
    rows: usize,
}

/// The sums over scores, for the covariance that knows of correlation.
fn scores<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    options: &Options,
    estimate: &Estimate,
    bandwidth: usize,
) -> Result<(Autocorrelated, Spread), S::Error> {
    let n = estimate.values.len();
    let mut out = Autocorrelated::new(n, bandwidth);
    let mut spread = Spread::default();
    let mut score = vec![0.0; n];
    let sigmas: Vec<f64> = estimate.efforts.iter().map(|e| e.sigma).collect();
    let huber = Huber {
        values: &estimate.values,
        sigmas: &sigmas,
        bound: options.huber.unwrap_or(f64::INFINITY),
    };
    replay.visit(&mut |equations| {
        if !equations.follows {
            out.interrupt();
        }
        let count = equations.tau.len();
        if count == 0 {
            return Ok(());
        }
        score.fill(0.0);
        for (e, (tau, own)) in equations.tau.iter().zip(equations.weights).enumerate() {
            if *own == 0.0 {
                continue;
            }
            let weight = own * estimate.efforts.get(e).map_or(1.0, |fit| fit.weight);
            let residual = tau - predicted(equations, e, &estimate.values);
            let robust = huber.weight(e, residual * own);
            let psi = residual * weight * robust;
            spread.squares += psi * psi;
            spread.inside += usize::from(robust >= 1.0);
            spread.rows += 1;
            let entries = equations.w.iter().skip(e).step_by(count);
            for (s, w) in score.iter_mut().zip(entries) {
                *s += w * weight * psi;
            }
        }
        out.push(&score)
    })?;
    Ok((out, spread))
}

/// Bartlett's bandwidth by the autocorrelation at lag 1 (Andrews, 1991), for the effort with
/// most of it; 1 for white residuals.
fn automatic(efforts: &[EffortError], rows: usize) -> usize {
    let strongest = efforts
        .iter()
        .filter_map(|e| e.autocorrelation.first())
        .fold(0.0, |m: f64, r| m.max(r.abs()));
    // beyond this a sum over all samples would be taken
    let rho = strongest.min(0.999);
    let alpha = 4.0 * rho * rho / (1.0 - rho * rho).powi(2);
    let lags = 1.1447 * (alpha * rows as f64).cbrt();
    #[allow(clippy::cast_sign_loss, reason = "it is not negative")]
    let lags = lags as usize;
    1 + lags.min(rows / 4)
}
