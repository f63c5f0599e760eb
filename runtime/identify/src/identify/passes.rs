//! Passes over a log that compute QR factors, estimates, residuals and covariances.

use serde::{Deserialize, Serialize};

use super::delay::{DelayFit, DelayScores, Delays};
use super::equation_builder::{EquationBuilder, EquationKind, Equations};
use super::huber::{Reweighting, partitioned, reweighted};
use super::replay::Replay;
use super::residual_passes::{andrews_bandwidth, noise_of, samples_per_independent_one, scores};
use super::rests::weighed_by_rests;
use super::slower::{OtherEquations, delays_of};
use super::stored::StoredEquations;
use super::stream::{Columns, LeftOut, equations};
use crate::estimate::huber as loss;
use crate::estimate::{
    Accumulator, Blocks, Deviations, EffortError, Estimate, FactorSet, QrFactor, Residuals,
    Weighting, bartlett_growth, bartlett_stretches,
};
use crate::states::Source;
use crate::states::nonlinear_joints;
use regen_runtime::BaseModel;

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
    /// The bandwidth, in samples, of Newey and West's (1987) covariance, which is consistent under
    /// heteroskedasticity and autocorrelation (HAC): residuals at least as far apart count as
    /// uncorrelated. `None`: the covariance of [`Deviations`].
    pub hac_bandwidth: Option<usize>,
    /// Whether the delays of efforts behind the motion are estimated too.
    pub finds_delays: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            weighting: Weighting::PerEffort,
            huber: None,
            lags: 20,
            hac_bandwidth: None,
            finds_delays: true,
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
    /// For each effort, the number of parameters that its equations contain.
    pub contained: Vec<usize>,
    /// The standard deviations that account for the residuals' correlation in time.
    pub deviations: Deviations,
    /// The scores that the deviations are computed from, for estimates of some of the parameters
    /// only.
    pub blocks: Blocks,
    /// The number of samples that count as correlated: as many as carry the information of one
    /// independent sample, or [`Options::hac_bandwidth`] if that is given.
    pub correlation_length: usize,
    /// The errors of each effort.
    pub errors: Vec<EffortError>,
    /// eps_RA over all efforts, percent (Eq. 33).
    pub relative_absolute: f64,
    /// The number of samples that gave equations ([`LeftOut::samples`]), and the numbers of samples
    /// and equations that were left out, by reason.
    pub left_out: LeftOut,
    /// The delays of the logged efforts behind the motion; none for energy balances.
    pub delays: Delays,
    /// The deviation of static friction over that of the other errors of each effort, by which equations beside
    /// rests are weighed; none where they are not.
    #[serde(skip)]
    pub(crate) static_friction: Vec<f64>,
}

impl Identified {
    /// The estimate with the covariance that accounts for the residuals' correlation in time.
    pub fn correlated(&self) -> Estimate {
        self.estimate.with_deviations(&self.deviations)
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
    let mut replay = Replay::new(model, kind, source).once();
    let set = reduce(&mut replay)?;
    Ok((set, replay.left_out().clone()))
}

/// As [`observe`], with equations that are weighed by static friction.
///
/// - `static_friction`: see [`Identified::static_friction`].
pub(crate) fn observe_weighed<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    model: &M,
    kind: EquationKind,
    source: &mut S,
    static_friction: &[f64],
) -> Result<FactorSet, S::Error> {
    let mut replay = Replay::new(model, kind, source).once();
    replay.set_static_friction(static_friction.to_vec());
    reduce(&mut replay)
}

/// Reduces a log to one QR factor for each effort.
pub(super) fn reduce<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
) -> Result<FactorSet, S::Error> {
    let origin = replay.origin();
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

/// The right-hand sides of all equations of a sample that base parameters predict, see [`predicted`].
pub(super) fn predictions(equations: &Equations<'_>, values: &[f64], out: &mut Vec<f64>) {
    let count = equations.tau.len();
    out.clear();
    // sums of few equations stay in registers
    match count {
        1 => out.extend(products::<1>(equations.w, values)),
        2 => out.extend(products::<2>(equations.w, values)),
        3 => out.extend(products::<3>(equations.w, values)),
        4 => out.extend(products::<4>(equations.w, values)),
        5 => out.extend(products::<5>(equations.w, values)),
        6 => out.extend(products::<6>(equations.w, values)),
        7 => out.extend(products::<7>(equations.w, values)),
        _ => {
            out.resize(count, 0.0);
            for (column, x) in equations.w.chunks_exact(count.max(1)).zip(values) {
                for (sum, w) in out.iter_mut().zip(column) {
                    *sum += w * x;
                }
            }
        }
    }
}

/// The products of N rows, column by column, with the values.
fn products<const N: usize>(w: &[f64], values: &[f64]) -> [f64; N] {
    let mut sums = [0.0; N];
    for (column, x) in w.as_chunks::<N>().0.iter().zip(values) {
        for (sum, w) in sums.iter_mut().zip(column) {
            *sum += w * x;
        }
    }
    sums
}

/// Identifies base parameters from a log: the estimate, its residuals, and the covariance that
/// accounts for their correlation. This takes several passes over the equations; a log whose
/// equations are too many to be stored (512 MiB) is read again in each.
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
/// use regen_identify::identify::{EquationKind, Options, identify};
/// use regen_identify::states::{Recorded};
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
    Ok(identify_and_store(model, kind, options, source)?.0)
}

/// As [`identify`]; also returns the equations, unless they are too many to be stored.
pub(crate) fn identify_and_store<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    model: &M,
    kind: EquationKind,
    options: &Options,
    source: &mut S,
) -> Result<(Identified, Option<StoredEquations>), S::Error> {
    let mut replay = Replay::new(model, kind, source);
    // friction that is not in the equations changes with the velocity, and looks like a delay
    let is_whole = nonlinear_joints(model).is_empty();
    let with_delays = is_whole && kind == EquationKind::Forces;
    let identified = identify_replayed(&mut replay, options, with_delays)?;
    Ok((identified, replay.into_stored()))
}

/// As [`identify`] from the equations of motion, with further parameters behind the base parameters.
///
/// - `columns`, `labels`: those of the further parameters, as many.
pub(crate) fn identify_with_columns<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    model: &M,
    options: &Options,
    source: &mut S,
    columns: Box<dyn Columns + '_>,
    labels: &[String],
) -> Result<Identified, S::Error> {
    crate::estimate::require("labels", columns.count(), labels.len())?;
    let mut replay = Replay::with_parameters(model, source, columns, labels);
    identify_replayed(&mut replay, options, true)
}

/// As [`observe_weighed`] from the equations of motion, with further parameters behind the base parameters.
///
/// - `columns`, `labels`: those of the further parameters, as many.
pub(crate) fn observe_with_columns<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    model: &M,
    source: &mut S,
    columns: Box<dyn Columns + '_>,
    labels: &[String],
    static_friction: &[f64],
) -> Result<FactorSet, S::Error> {
    crate::estimate::require("labels", columns.count(), labels.len())?;
    let mut replay = Replay::with_parameters(model, source, columns, labels).once();
    replay.set_static_friction(static_friction.to_vec());
    reduce(&mut replay)
}

/// A step of Gauss's and Newton's method: identifies base parameters from the equations
/// `e + J at = J x`, where e is the difference of the measured right-hand sides and those that are
/// predicted with the base parameters `at`, and J are the derivatives of the predicted ones. J differs
/// from the regressor where the motion follows from the parameters too, as that of a simulation does.
///
/// - `linearised`: the columns of J, as many as base parameters, then e;
/// - `difference`: e alone;
/// - `at`: r, SI.
///
/// In the result, errors and eps_RA are those of e beside the measured right-hand sides, and there are no
/// delays.
///
/// # Errors
/// As [`identify`].
///
/// ```
/// # mod models {
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs"));
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum_base.rs"));
/// # }
/// # use models::Pendulum;
/// use regen_identify::estimate::EstimateError;
/// use regen_identify::identify::{Columns, Options, identify_linearised};
/// use regen_identify::states::{Recorded, StateSample};
///
/// const AT: [f64; 2] = [0.4, 2.5];
///
/// /// Derivatives and difference where the motion does not depend on the parameters.
/// struct Linearised {
///     derivatives: usize,
/// }
///
/// impl Columns for Linearised {
///     fn count(&self) -> usize {
///         self.derivatives + 1
///     }
///
///     fn fill(
///         &mut self,
///         row: &StateSample<'_>,
///         w: &[f64],
///         out: &mut [f64],
///     ) -> Result<bool, EstimateError> {
///         let predicted: f64 = w.iter().zip(AT).map(|(w, x)| w * x).sum();
///         out[..self.derivatives].copy_from_slice(&w[..self.derivatives]);
///         out[self.derivatives] = row.tau[0] - predicted;
///         Ok(true)
///     }
/// }
///
/// // a pendulum of 0.5 kg m^2 and 2 kg m about its axis, moved as q = sin(t)
/// let mut log = Recorded::new();
/// for k in 0..100 {
///     let t = 0.05 * f64::from(k);
///     let (q, qd, qdd) = (t.sin(), t.cos(), -t.sin());
///     let tau = 0.5 * qdd + 2.0 * 9.81 * q.sin();
///     log.push(t, &[q], &[qd], &[qdd], &[tau]);
/// }
/// let found = identify_linearised(
///     &Pendulum,
///     &Options::default(),
///     &mut log,
///     Box::new(Linearised { derivatives: 2 }),
///     &mut Linearised { derivatives: 0 },
///     &AT,
/// )?;
/// assert!((found.estimate.values[0] - 0.5).abs() < 1e-9);
/// assert!(found.relative_absolute > 10.0, "of the parameters at which it is linearised");
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn identify_linearised<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    model: &M,
    options: &Options,
    source: &mut S,
    linearised: Box<dyn Columns + '_>,
    difference: &mut dyn Columns,
    at: &[f64],
) -> Result<Identified, S::Error> {
    let base = model.base_info().base.len();
    crate::estimate::require("columns", base + 1, linearised.count())?;
    crate::estimate::require("base parameters", base, at.len())?;
    let found = {
        let replay = Replay::with_columns(model, EquationKind::Forces, &mut *source, linearised);
        identify_replayed(&mut replay.linearised(at), options, false)?
    };
    let errors = errors_of_prediction(model, source, difference, options.lags)?;
    Ok(Identified {
        errors: errors.efforts(),
        relative_absolute: errors.relative_absolute(),
        ..found
    })
}

/// The errors of a prediction that is not that of the regressor: of the difference of the measured and
/// the predicted right-hand sides, filtered as equations are.
///
/// - `difference`: one column, e;
/// - `lags`: the number of autocorrelations to compute.
///
/// # Errors
/// When the log cannot be read or does not fit the model.
pub fn errors_of_prediction<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    model: &M,
    source: &mut S,
    difference: &mut dyn Columns,
    lags: usize,
) -> Result<Residuals, S::Error> {
    let kind = EquationKind::Forces;
    crate::estimate::require("columns", 1, difference.count())?;
    let mut rows = StoredEquations::default();
    let mut sums = vec![[0.0; 2]; model.info().dof()];
    equations(model, kind, source, difference, &mut |found| {
        let own = found.tau.iter().zip(found.weights);
        for (sums, (tau, weight)) in sums.iter_mut().zip(own) {
            if *weight != 0.0 {
                sums[0] += tau;
                sums[1] += 1.0;
            }
        }
        let own = found.w.len().saturating_sub(found.tau.len());
        let w = found.w.get(own..).unwrap_or_default();
        rows.push(&Equations { w, ..*found });
        Ok(())
    })?;
    let means: Vec<f64> = sums.iter().map(|[sum, n]| sum / n.max(1.0)).collect();
    let origin = EquationBuilder::new(model, kind).origin();
    let mut residuals = Residuals::new(&origin.efforts, &means, lags);
    rows.visit(&mut |found| {
        if !found.follows {
            residuals.interrupt();
        }
        let fitted: Vec<f64> = found.tau.iter().zip(found.w).map(|(t, e)| t - e).collect();
        let used: Vec<bool> = found.weights.iter().map(|w| *w > 0.0).collect();
        if found.tau.is_empty() {
            return Ok(());
        }
        residuals.push_used(found.tau, &fitted, &used)
    })?;
    Ok(residuals)
}

/// Identifies base parameters from equations that can be visited any number of times.
///
/// - `with_delays`: whether to estimate the delays of the efforts behind the motion.
fn identify_replayed<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    options: &Options,
    with_delays: bool,
) -> Result<Identified, S::Error> {
    let (plain, mut estimate) = weighed_by_rests(replay, options.weighting)?;
    let left_out = replay.left_out().clone();
    let weights: Vec<f64> = estimate.efforts.iter().map(|e| e.weight).collect();
    let mut factor = plain.combined(&weights)?;
    if let Some(bound) = options.huber {
        let mut passes = Reweighting::default();
        let start = partitioned(replay, &mut passes, &estimate, bound, options.weighting)?;
        estimate = start.unwrap_or(estimate);
        for _ in 0..loss::MAX_PASSES {
            let (next, next_factor) =
                reweighted(replay, &mut passes, &estimate, bound, options.weighting)?;
            let deviation = |k: usize| next.sigma(k).max(f64::MIN_POSITIVE);
            let pairs = next.values.iter().zip(&estimate.values).enumerate();
            let largest_change = pairs.fold(0.0, |m: f64, (k, (a, b))| {
                m.max((a - b).abs() / deviation(k))
            });
            (estimate, factor) = (next, next_factor);
            if largest_change < loss::TOLERANCE_DEVIATIONS {
                break;
            }
        }
    }
    let means = plain.means();
    let names: Vec<String> = estimate.efforts.iter().map(|e| e.name.clone()).collect();
    let weights: Vec<f64> = estimate.efforts.iter().map(|e| e.weight).collect();
    let mut delays = (with_delays && options.finds_delays)
        .then(|| DelayFit::new(&estimate.labels, &estimate.values, &names, &weights));
    // the equations with the weights of the efforts, but without Huber's
    let effort_weighted = plain.combined(&weights)?;
    let given = (&effort_weighted, means.as_slice());
    let (errors, noise) = noise_of(replay, options, &estimate, given, delays.as_mut())?;
    let efforts = errors.efforts();
    let rows = efforts.iter().map(|e| e.samples).max().unwrap_or(0);
    let given_bandwidth = options.hac_bandwidth.map(|b| b.clamp(1, rows.max(1)));
    let bandwidth = given_bandwidth.unwrap_or_else(|| andrews_bandwidth(&efforts, rows));
    let mut delays = match delays {
        Some(delays) => delays.finish(bandwidth)?.map(|own| own.in_noise(&noise)),
        None => None,
    };
    let (blocks, newey_west, psi_sums) = scores(
        replay,
        options,
        &estimate,
        &noise,
        given_bandwidth,
        delays.as_mut(),
    )?;
    let step = delays.as_ref().map_or(0.0, DelayScores::step);
    let mut delays = delays.map_or_else(Delays::default, DelayScores::finish);
    if delays.may_be_more_than_chance() {
        let solved = (&estimate, names.as_slice(), weights.as_slice());
        if let Some(slower) = delays_of(OtherEquations::Slower, replay, solved, bandwidth, step) {
            delays.compare(&slower);
        }
        let rests = replay.left_out().resting.iter().any(|count| *count > 0);
        let away = OtherEquations::AwayFromReversals;
        if rests && let Some(away) = delays_of(away, replay, solved, bandwidth, step) {
            delays.compare_away(&away);
        }
    }
    let fraction_within_bound = match options.huber {
        Some(_) => psi_sums.fraction_within_bound(),
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
        // it has been corrected for what the parameters take of equations that are all independent; as many
        // are as the given bandwidth says
        let (all, used) = (effort_weighted.rows() as f64, estimate.values.len() as f64);
        let independent = blocks.independent_of(effort_weighted.rows());
        let independent = independent.max(all / bandwidth as f64);
        let left = (independent - used).max(1.0);
        let growth = bartlett_growth(rows, bandwidth) * (independent / left) * (1.0 - used / all);
        let growth = growth.max(1.0) / (fraction_within_bound * fraction_within_bound);
        let covariance = covariance.iter().map(|c| c * growth);
        let freedom = bartlett_stretches(rows, bandwidth).min(left);
        deviations = deviations.with_covariance(covariance.collect(), freedom);
    }
    if options.huber.is_some() {
        estimate.covariance = psi_sums.covariance(&effort_weighted)?;
    }
    Ok(Identified {
        relative_absolute: errors.relative_absolute(),
        errors: efforts,
        estimate,
        factor,
        contained: plain.factors().iter().map(QrFactor::contained).collect(),
        correlation_length: given_bandwidth.unwrap_or_else(|| samples_per_independent_one(&blocks)),
        deviations,
        blocks,
        left_out,
        delays,
        static_friction: replay.static_friction().to_vec(),
    })
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
    let mut replay = Replay::new(model, kind, source).once();
    residuals_of(&mut replay, values, means, lags)
}

fn residuals_of<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    values: &[f64],
    means: &[f64],
    lags: usize,
) -> Result<Residuals, S::Error> {
    let origin = replay.origin();
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
        predictions(equations, values, &mut fitted);
        used.clear();
        used.extend(equations.weights.iter().map(|w| *w > 0.0));
        residuals.push_used(equations.tau, &fitted, &used)
    })?;
    Ok(residuals)
}
