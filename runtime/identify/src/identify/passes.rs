//! Passes over a log that compute QR factors, estimates, residuals and covariances.

use serde::{Deserialize, Serialize};
use statrs::distribution::{Continuous, ContinuousCDF, Normal};

use super::delay::{DelayFit, DelayScores, Delays};
use super::equation_builder::{EquationBuilder, EquationKind, Equations, StateSample};
use super::huber::{Huber, Reweighting};
use super::replay::Replay;
use super::stream::{Filtering, LeftOut};
use crate::estimate::{
    Accumulator, Autocorrelated, Autoregression, Blocks, Deviations, EffortError, Estimate,
    EstimateError, FactorSet, ORDER, QrFactor, Residuals, Scores, Weighting,
};
use regen_runtime::BaseModel;

/// A log that can be read any number of times: each pass of the identification reads it once.
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
    /// The number of autocorrelations of the residuals to compute, at lags of 1, 2, ... samples.
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
    /// The QR factor whose solution the estimate is: the equations of all efforts with the weights
    /// of the efforts and, with [`Options::huber`], Huber's weights.
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
    /// The number of samples that gave equations ([`LeftOut::samples`]), and the numbers of samples
    /// and equations that were left out, by reason.
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

/// Largest number of passes of Huber's reweighting.
const MAX_HUBER_PASSES: usize = 50;
/// The reweighting ends once no parameter changes by more than this many standard deviations.
const HUBER_TOLERANCE_DEVIATIONS: f64 = 1e-6;

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
    let set = reduce(&mut replay)?;
    Ok((set, replay.left().clone()))
}

/// Reduces a log to one QR factor for each effort.
fn reduce<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
) -> Result<FactorSet, S::Error> {
    let origin = EquationBuilder::new(replay.model(), replay.kind()).origin();
    let mut rows = Accumulator::new(&origin);
    replay.visit(&mut |equations| {
        let count = equations.tau.len();
        for (effort, (tau, weight)) in equations.tau.iter().zip(equations.weights).enumerate() {
            if *weight != 0.0 {
                rows.push(effort, &equations.w[effort..], count, *tau, *weight)?;
            }
        }
        Ok(())
    })?;
    Ok(rows.finish()?)
}

/// The right-hand side of equation `effort` that base parameters (SI) predict: N or N m, or J for
/// energy balances.
pub(super) fn predicted(equations: &Equations<'_>, effort: usize, values: &[f64]) -> f64 {
    let stride = equations.tau.len().max(1);
    let entries = equations.w.iter().skip(effort).step_by(stride);
    entries.zip(values).map(|(w, x)| w * x).sum()
}

/// Identifies base parameters from a log: the estimate, its residuals, and the covariance that
/// accounts for their correlation. This takes several passes over the equations; a log whose
/// equations are too many to be stored (64 MiB) is read again in each.
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
    let plain = reduce(&mut replay)?;
    let left_out = replay.left().clone();
    let mut estimate = Estimate::new(&plain, options.weighting)?;
    let weights: Vec<f64> = estimate.efforts.iter().map(|e| e.weight).collect();
    let mut factor = plain.combined(&weights)?;
    if let Some(bound) = options.huber {
        let mut passes = Reweighting::default();
        for _ in 0..MAX_HUBER_PASSES {
            let (next, next_factor) = reweighted(
                &mut replay,
                &mut passes,
                &estimate,
                bound,
                options.weighting,
            )?;
            let deviation = |k: usize| next.sigma(k).max(f64::MIN_POSITIVE);
            let pairs = next.values.iter().zip(&estimate.values).enumerate();
            let largest_change = pairs.fold(0.0, |m: f64, (k, (a, b))| {
                m.max((a - b).abs() / deviation(k))
            });
            (estimate, factor) = (next, next_factor);
            if largest_change < HUBER_TOLERANCE_DEVIATIONS {
                break;
            }
        }
    }
    let means = plain.means();
    let names: Vec<String> = estimate.efforts.iter().map(|e| e.name.clone()).collect();
    let weights: Vec<f64> = estimate.efforts.iter().map(|e| e.weight).collect();
    let mut delays = (kind == EquationKind::Forces)
        .then(|| DelayFit::new(&estimate.labels, &estimate.values, &names, &weights));
    let (errors, noise) = noise_of(&mut replay, options, &estimate, &means, delays.as_mut())?;
    let efforts = errors.efforts();
    // the equations with the weights of the efforts, but without Huber's
    let effort_weighted = plain.combined(&weights)?;
    let rows = efforts.iter().map(|e| e.samples).max().unwrap_or(0);
    let given_bandwidth = options.bandwidth.map(|b| b.clamp(1, rows.max(1)));
    let bandwidth = given_bandwidth.unwrap_or_else(|| andrews_bandwidth(&efforts, rows));
    let mut delays = match delays {
        Some(delays) => delays.finish(bandwidth)?,
        None => None,
    };
    let (blocks, newey_west, psi_sums) = scores(
        &mut replay,
        options,
        &estimate,
        &noise,
        given_bandwidth,
        delays.as_mut(),
    )?;
    let delays = delays.map_or_else(Delays::default, DelayScores::finish);
    let fraction_within_bound = match options.huber {
        Some(_) => psi_sums.within_bound as f64 / psi_sums.equations.max(1) as f64,
        None => 1.0,
    };
    let all_columns: Vec<usize> = (0..estimate.values.len()).collect();
    let mut deviations = blocks.deviations(
        &effort_weighted,
        &all_columns,
        &estimate.values,
        fraction_within_bound,
    )?;
    if let Some(newey_west) = newey_west {
        let covariance = newey_west.covariance(&effort_weighted)?;
        let covariance = covariance
            .iter()
            .map(|c| c / (fraction_within_bound * fraction_within_bound));
        deviations = deviations.with_covariance(covariance.collect(), estimate.degrees_of_freedom);
    }
    if options.huber.is_some() {
        // Huber (1973): (W^T W)^-1 times the mean of psi^2 over the squared fraction of residuals
        // within the bound; the covariance of least squares is (W^T W)^-1 times the variance of its
        // residuals, which is replaced here
        let least_squares = Estimate::of(&effort_weighted)?;
        let degrees_of_freedom = least_squares.degrees_of_freedom.max(1) as f64;
        let least_squares_variance =
            effort_weighted.squared_residual(&least_squares.values)? / degrees_of_freedom;
        let variance =
            psi_sums.squares / degrees_of_freedom / (fraction_within_bound * fraction_within_bound);
        let scale = if least_squares_variance > 0.0 {
            variance / least_squares_variance
        } else {
            0.0
        };
        let covariance = least_squares.covariance.iter();
        estimate.covariance = covariance.map(|c| c * scale).collect();
    }
    Ok(Identified {
        relative_absolute: errors.relative_absolute(),
        errors: efforts,
        estimate,
        factor,
        bandwidth: given_bandwidth.unwrap_or_else(|| samples_per_independent_one(&blocks)),
        deviations,
        blocks,
        left_out,
        delays,
    })
}

/// One step of Huber's estimate of values and scales (his second proposal) from the `previous` one:
/// the scales, one standard deviation for each effort, are such that the bounded residuals have the
/// variance they would have for normal noise.
fn reweighted<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    passes: &mut Reweighting,
    previous: &Estimate,
    bound: f64,
    weighting: Weighting,
) -> Result<(Estimate, QrFactor), S::Error> {
    let sigmas: Vec<f64> = previous.efforts.iter().map(|e| e.sigma).collect();
    let huber = Huber {
        values: &previous.values,
        sigmas: &sigmas,
        bound,
    };
    let (set, psi_squares) = passes.reduce(replay, &huber)?;
    let normal = Normal::standard();
    // the expectation of psi^2 for standard normal residuals: that of u^2 within the bound, and
    // bound^2 in both tails
    let tail_probability = normal.sf(bound);
    let square_within_bound = 1.0 - 2.0 * tail_probability - 2.0 * bound * normal.pdf(bound);
    let expected_square = (2.0 * bound * bound).mul_add(tail_probability, square_within_bound);
    let equations: usize = set.factors().iter().map(QrFactor::rows).sum();
    // degrees of freedom per equation
    let freedom_ratio = 1.0 - previous.values.len() as f64 / equations.max(1) as f64;
    let scales = psi_squares.iter().zip(set.factors()).zip(&sigmas);
    let scales = scales.map(|((squares, factor), old)| {
        let variance = squares / (expected_square * freedom_ratio * factor.rows() as f64);
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
    next.efforts.clone_from(&previous.efforts);
    for (effort, (sigma, weight)) in next.efforts.iter_mut().zip(scales.iter().zip(&weights)) {
        effort.sigma = *sigma;
        effort.weight = *weight;
    }
    Ok((next, factor))
}

/// Computes the residuals of given parameters on a log.
///
/// - `values`: base parameters, SI;
/// - `means`: the means of the efforts on this log, N or N m, or J, for eps_RA; see
///   [`FactorSet::means`];
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
    let mut residuals = Residuals::new(&origin.efforts, means, lags);
    let mut fitted = Vec::new();
    let mut used = Vec::new();
    replay.visit(&mut |equations| {
        if !equations.follows {
            residuals.interrupt();
        }
        if equations.tau.is_empty() {
            return Ok(());
        }
        fitted.clear();
        fitted.extend((0..equations.tau.len()).map(|e| predicted(equations, e, values)));
        used.clear();
        used.extend(equations.weights.iter().map(|w| *w > 0.0));
        residuals.push_used(equations.tau, &fitted, &used)
    })?;
    Ok(residuals)
}

/// Sums over psi, the weighted residuals that are bounded by Huber's weight.
#[derive(Default)]
struct PsiSums {
    /// The sum of psi^2.
    squares: f64,
    /// The number of equations whose residual is within Huber's bound.
    within_bound: usize,
    /// The number of equations.
    equations: usize,
}

/// The errors of an estimate, and for each effort an autoregression of its weighted residuals,
/// which are bounded by Huber's weight.
fn noise_of<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    options: &Options,
    estimate: &Estimate,
    means: &[f64],
    mut delays: Option<&mut DelayFit<'_>>,
) -> Result<(Residuals, Vec<Autoregression>), S::Error> {
    let names: Vec<String> = estimate.efforts.iter().map(|e| e.name.clone()).collect();
    let mut errors = Residuals::new(&names, means, options.lags);
    let zeros = vec![0.0; names.len()];
    let mut noise = Residuals::new(&names, &zeros, ORDER);
    let mut weighted = WeightedResiduals::new(options, estimate);
    replay.visit(&mut |equations| {
        if !equations.follows {
            errors.interrupt();
            noise.interrupt();
        }
        if equations.tau.is_empty() {
            return Ok(());
        }
        if let Some(delays) = &mut delays {
            delays.push(equations)?;
        }
        weighted.compute(equations);
        errors.push_used(equations.tau, &weighted.fitted, &weighted.used)?;
        noise.push_used(&weighted.psi, &zeros, &weighted.used)
    })?;
    let noise = noise.efforts();
    let fits = noise
        .iter()
        .map(|e| Autoregression::fit(e.rms * e.rms, &e.autocorrelation, e.samples));
    Ok((errors, fits.collect()))
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
        let rows = equations.tau.iter().zip(equations.weights);
        for (e, (tau, equation_weight)) in rows.enumerate() {
            let fitted = predicted(equations, e, &self.estimate.values);
            let effort_weight = self.estimate.efforts.get(e).map_or(1.0, |fit| fit.weight);
            let weight = equation_weight * effort_weight;
            let huber_weight = huber.weight(e, (tau - fitted) * equation_weight);
            self.fitted.push(fitted);
            self.used.push(*equation_weight > 0.0);
            self.weights.push(weight);
            self.psi.push((tau - fitted) * weight * huber_weight);
            self.slopes.push(if huber_weight < 1.0 { 0.0 } else { 1.0 });
        }
    }
}

/// The sums over the scores (regressor rows times psi) for the covariance that accounts for
/// correlation in time; for a given bandwidth also those of Newey and West; and the sums over psi.
fn scores<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    options: &Options,
    estimate: &Estimate,
    noise: &[Autoregression],
    bandwidth: Option<usize>,
    mut delays: Option<&mut DelayScores<'_>>,
) -> Result<(Blocks, Option<Autocorrelated>, PsiSums), S::Error> {
    let n = estimate.values.len();
    let mut scores = Scores::new(n, noise);
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
fn samples_per_independent_one(blocks: &Blocks) -> usize {
    #[allow(clippy::cast_sign_loss, reason = "it is at least 1")]
    let samples = blocks.correlation_length().round() as usize;
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
