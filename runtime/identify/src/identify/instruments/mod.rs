//! Instrumental variables: estimates without bias from errors of the regressor.
//!
//! Positions are measured with noise, and their derivatives have more; least squares takes the
//! regressor W as exact and is biased by its errors. With instruments Z of the same size, which
//! are correlated with the true regressor and not with the noise,
//!
//! ```text
//! beta = (Z^T W)^-1 Z^T tau
//! ```
//!
//! is consistent. Here Z is the regressor at another motion, which the caller gives for the
//! present estimate: that of a simulation of the robot under control (IDIM-IV: Janot, Vandanjon
//! and Gautier, A generic instrumental variable approach for industrial robot identification,
//! 2014), or the measured one after smoothing ([`MotionSeries::smoothed`](crate::states::MotionSeries::smoothed)). Z is filtered like W.

mod deviations;
mod hausman;
mod regressor;
mod sums;

pub(crate) use regressor::InstrumentRegressor;

use std::rc::Rc;

use deviations::{Correlated, deviations};
use hausman::{covariances, hausman};
use sums::{Solution, Sums};

use super::equation_builder::{EquationBuilder, EquationKind, Equations};
use super::held::HeldEfforts;
use super::passes::predicted;
use super::replay::Replay;
use super::sampling::ChangedParameters;
use super::stream::LeftOut;
use crate::estimate::{
    Deviations, EffortError, Estimate, EstimateError, FilteredNoise, Origin, Residuals, SAMPLING,
    Weighting, bartlett_growth, bartlett_stretches,
};
use crate::states::{MotionSeries, Source};
use regen_runtime::BaseModel;

/// Options of an estimate by instrumental variables.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InstrumentOptions {
    /// How efforts are weighted against each other.
    pub weighting: Weighting,
    /// The largest number of rounds of instruments and estimate.
    pub rounds: usize,
    /// The number of autocorrelations of the residuals to compute.
    pub lags: usize,
    /// The bandwidth, in samples, of Newey and West's (1987) covariance of whitened scores, which is
    /// consistent under heteroskedasticity and autocorrelation (HAC): those at least as far apart
    /// count as uncorrelated. `None`: the covariance is that of [`Deviations`], and in the test of the
    /// difference to least squares the bandwidth is 1 plus 3/4 of the cube root of the number of samples.
    pub hac_bandwidth: Option<usize>,
}

impl Default for InstrumentOptions {
    fn default() -> Self {
        Self {
            weighting: Weighting::PerEffort,
            rounds: 10,
            lags: 20,
            hac_bandwidth: None,
        }
    }
}

/// Result of the test of Durbin, Wu and Hausman: whether least squares differs from instrumental
/// variables by more than chance. Its covariance accounts for the residuals' correlation.
#[derive(Clone, Debug, PartialEq)]
pub struct Hausman {
    /// For each parameter, least squares minus instrumental variables over the standard deviation
    /// of this difference; 0 where the two are the same to rounding.
    pub ratios: Vec<f64>,
    /// The probability of differences at least as large if the regressor has no errors.
    pub probability: f64,
    /// Whether the probability is that of all differences together (a Wald test, as an F test with
    /// the independent stretches of the log); if not, it is that of the largest difference
    /// (Bonferroni), as there are too few stretches.
    pub is_joint_test: bool,
}

/// Least squares counts as biased if the probability of the differences is below this.
const MIN_UNBIASED_PROBABILITY: f64 = 0.01;

impl Hausman {
    /// Whether least squares is biased: differences as large come by chance in less than one of a
    /// hundred logs.
    pub fn is_biased(&self) -> bool {
        self.probability < MIN_UNBIASED_PROBABILITY
    }
}

/// An estimate by instrumental variables.
#[derive(Clone, Debug, PartialEq)]
pub struct Instrumental {
    /// The parameters with the covariance for white residuals. The residuals include the errors of
    /// the regressor and those of the efforts.
    pub estimate: Estimate,
    /// The covariance that accounts for the residuals' correlation in time, and for what the sampling of
    /// the motion leaves unknown.
    pub deviations: Deviations,
    /// Whether the sampling of the motion increases a standard deviation by more than a tenth.
    pub is_coarsely_sampled: bool,
    /// The least-squares parameters of the same equations with the same weights, SI.
    pub least_squares: Vec<f64>,
    /// The test whether both estimates differ.
    pub test: Hausman,
    /// The correlation of each instrument with its column of the regressor: 1 at best, much less
    /// for weak instruments.
    pub relevance: Vec<f64>,
    /// The number of rounds.
    pub rounds: usize,
    /// Whether the last round changed the estimate by less than a hundredth of its standard
    /// deviations for white residuals.
    pub converged: bool,
    /// The errors of each effort at the measured motion.
    pub errors: Vec<EffortError>,
    /// eps_RA over all efforts in percent (Eq. 33), at the measured motion.
    pub relative_absolute: f64,
    /// The same with efforts predicted at the motion of the instruments, which has less noise.
    pub at_instruments: f64,
    /// The bandwidth of Newey and West's covariance in samples; `None` where the deviations are from
    /// cosines, see [`InstrumentOptions::hac_bandwidth`].
    pub hac_bandwidth: Option<usize>,
    /// The samples and equations that were left out, by reason.
    pub left_out: LeftOut,
}

impl Instrumental {
    /// The estimate with the covariance that accounts for the residuals' correlation in time.
    pub fn correlated(&self) -> Estimate {
        self.estimate.with_deviations(&self.deviations)
    }

    /// The same with further errors that are the same for all samples, such as those of delays: by how much each
    /// moves each parameter, in its unit.
    #[must_use]
    pub fn with_changes(self, changes: &[Vec<f64>]) -> Self {
        let deviations = changes
            .iter()
            .fold(self.deviations, |sum, own| sum.with_change(own));
        Self { deviations, ..self }
    }

    /// The number of consecutive samples that carry the information of one independent sample, or the
    /// bandwidth if it was given.
    pub fn correlation_length(&self) -> usize {
        #[allow(clippy::cast_sign_loss, reason = "it is at least 1")]
        let found = self.deviations.memory.round() as usize;
        self.hac_bandwidth.unwrap_or(found)
    }

    /// Describes how the standard deviations account for the residuals' correlation.
    pub fn covariance_in_words(&self) -> String {
        let of = self.hac_bandwidth.map_or_else(
            || self.deviations.in_words(),
            |bandwidth| {
                format!("whitened scores correlated in {bandwidth} samples (Newey and West)")
            },
        );
        let sampling = if self.is_coarsely_sampled {
            SAMPLING
        } else {
            ""
        };
        format!("{of}{sampling}")
    }

    /// The index of the parameter whose instrument has the smallest correlation with its column,
    /// the first of several; `None` if there are no parameters.
    pub fn weakest(&self) -> Option<usize> {
        let all = self.relevance.iter().enumerate();
        let least = all.min_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        least.map(|(parameter, _)| parameter)
    }

    /// Whether the instrument of a parameter is weak: the F statistic of the instrument and its
    /// column is below 10 (Staiger and Stock, 1997).
    pub fn is_weak(&self, parameter: usize) -> bool {
        let equations: usize = self.estimate.efforts.iter().map(|e| e.rows).sum();
        let square = self.relevance.get(parameter).map_or(0.0, |r| r * r);
        square / (1.0 - square) * (equations as f64) < WEAK_F_STATISTIC
    }
}

/// An instrument is called weak if the F statistic of its regression is below this (Staiger and
/// Stock, 1997).
const WEAK_F_STATISTIC: f64 = 10.0;
/// A round that changes the estimate by less than this many standard deviations for white residuals is the
/// last one.
const TOLERANCE_DEVIATIONS: f64 = 1e-2;
/// The number of rounds with a motion of their own. A simulated motion depends on the estimate, and the
/// directions of its slow velocities may go on changing from round to round. Any motion without the
/// log's noise is a valid instrument, so that the last one is then kept.
const MOTIONS: usize = 5;
/// The motion is kept only if the last change was below this many of these standard deviations: a larger
/// one is of weak instruments.
const KEPT_DEVIATIONS: f64 = 1.0;

/// Callback that returns the motion of the instruments for base parameters, or `None` if it is the
/// same as in the last call.
pub type MotionSource<'a, E> = dyn FnMut(&[f64]) -> Result<Option<MotionSeries>, E> + 'a;

/// Equations whose columns are those of the regressor W, and then those of the instruments Z.
pub(crate) trait InstrumentedEquations {
    /// The error of reading a log or of computing a motion.
    type Error: From<EstimateError>;

    /// The labels of the unknowns, and the names of the efforts.
    fn origin(&self) -> Origin;

    /// Replaces the instruments by those for these values of the unknowns. Returns false if they
    /// are the same as before.
    fn renew(&mut self, values: &[f64]) -> Result<bool, Self::Error>;

    /// Linearises the equations at these values. Returns false if they are linear.
    fn linearise(&mut self, values: &[f64]) -> bool;

    /// Passes the equations of all samples to `each`, in order of time.
    fn visit(
        &mut self,
        each: &mut dyn FnMut(&Equations<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), Self::Error>;

    /// What the filter makes of white noise of the efforts, at the equations of the last pass.
    fn filtered_noise(&self) -> FilteredNoise;

    /// Adds the equations of the instruments' motion with other derivatives, see
    /// [`Source::changed_efforts`].
    ///
    /// - `weights`: of the efforts.
    fn changed(
        &mut self,
        values: &[f64],
        weights: &[f64],
        out: &mut ChangedParameters,
    ) -> Result<(), Self::Error>;

    /// Adds the equations of all samples, with the columns of the instruments.
    ///
    /// - `weights`: of the efforts.
    fn held(&mut self, weights: &[f64], out: &mut HeldEfforts) -> Result<(), Self::Error>;
}

/// The equations of the base parameters.
struct BaseEquations<'a, 'f, M: ?Sized, S: Source + ?Sized> {
    model: &'a M,
    replay: Replay<'a, M, S>,
    motion: &'f mut MotionSource<'f, S::Error>,
    /// The present motion of the instruments.
    last: Option<Rc<MotionSeries>>,
}

impl<M: BaseModel<f64> + ?Sized, S: Source + ?Sized> InstrumentedEquations
    for BaseEquations<'_, '_, M, S>
{
    type Error = S::Error;

    fn origin(&self) -> Origin {
        EquationBuilder::new(self.model, EquationKind::Forces).origin()
    }

    fn renew(&mut self, values: &[f64]) -> Result<bool, S::Error> {
        let Some(motion) = (self.motion)(values)? else {
            return Ok(false);
        };
        let motion = Rc::new(motion);
        let columns = InstrumentRegressor::new(self.model, motion.clone())?;
        self.replay.set_columns(Box::new(columns));
        self.last = Some(motion);
        Ok(true)
    }

    fn linearise(&mut self, _: &[f64]) -> bool {
        false
    }

    fn visit(
        &mut self,
        each: &mut dyn FnMut(&Equations<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), S::Error> {
        self.replay.visit(&mut |rows| {
            if rows.tau.is_empty() {
                return Ok(());
            }
            each(rows)
        })
    }

    fn filtered_noise(&self) -> FilteredNoise {
        self.replay.filtered_noise()
    }

    fn changed(
        &mut self,
        values: &[f64],
        weights: &[f64],
        out: &mut ChangedParameters,
    ) -> Result<(), S::Error> {
        let motion = self.last.as_deref();
        let mut w = Vec::new();
        let source = self.replay.source();
        source.changed_efforts(values, motion, &mut |state| {
            w.clear();
            w.extend_from_slice(state.w);
            out.push((&mut w, state.change), weights, state.rows)
        })
    }

    fn held(&mut self, weights: &[f64], out: &mut HeldEfforts) -> Result<(), S::Error> {
        self.replay.visit(&mut |rows| {
            let (_, w) = rows.w.split_at(rows.w.len() / 2);
            out.push(&Equations { w, ..*rows }, weights);
            Ok(())
        })
    }
}

/// Identifies base parameters by instrumental variables.
///
/// - `start`: base parameters to begin with, those of least squares, SI;
/// - `motion`: returns the motion of the instruments for base parameters; `None` if it is the
///   same as in the last call. Samples of the log that it lacks give no equation. It is called in the
///   first five rounds, and in later ones while the estimate changes by more than its errors.
///
/// # Errors
/// When the log cannot be read or does not fit the model, or the instruments do not determine all
/// parameters; the errors of `motion`.
pub fn instrumental<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    model: &M,
    options: &InstrumentOptions,
    source: &mut S,
    start: &[f64],
    motion: &mut MotionSource<'_, S::Error>,
) -> Result<Instrumental, S::Error> {
    let none = Rc::new(MotionSeries::new(model.info().dof()));
    let none = InstrumentRegressor::new(model, none)?;
    let mut equations = BaseEquations {
        model,
        replay: Replay::with_columns(model, EquationKind::Forces, source, Box::new(none)),
        motion: &mut |values| motion(values),
        last: None,
    };
    let found = instrumental_of(&mut equations, options, start, None)?;
    Ok(Instrumental {
        left_out: equations.replay.left_out().clone(),
        ..found
    })
}

/// Identifies the unknowns of equations by instrumental variables; what is left out of the logs is
/// not counted.
///
/// - `weights`: those of the efforts in the first round; `None`: those of least squares.
pub(crate) fn instrumental_of<E: InstrumentedEquations>(
    equations: &mut E,
    options: &InstrumentOptions,
    start: &[f64],
    mut weights: Option<Vec<f64>>,
) -> Result<Instrumental, E::Error> {
    let origin = equations.origin();
    let mut values = start.to_vec();
    let mut sums: Option<Sums> = None;
    let mut rounds = 0;
    let mut moved = f64::INFINITY;
    let (sums, mut found, converged) = loop {
        let keeps_motion = rounds >= MOTIONS && moved < KEPT_DEVIATIONS;
        if !keeps_motion && equations.renew(&values)? {
            sums = None;
        }
        let now = match sums.take() {
            Some(now) => now,
            None => Sums::of(equations, &origin)?,
        };
        let own = if let Some(weights) = weights.take() {
            weights
        } else {
            let first = Estimate::new(&now.factors, options.weighting)?;
            first.efforts.iter().map(|e| e.weight).collect()
        };
        let solution = now.solve(&own)?;
        moved = solution.change_from(&values)?;
        rounds += 1;
        values.clone_from(&solution.values);
        let is_linear = !equations.linearise(&values);
        let (measured, smooth) = residuals(equations, options, &now, &values)?;
        let efforts = measured.efforts();
        let round = RoundResult {
            solution,
            relative_absolute: measured.relative_absolute(),
            at_instruments: smooth.relative_absolute(),
            weights: own,
            efforts,
        };
        // the weights come from the residuals of the previous round, so the first round never
        // converges
        let converged = rounds > 1 && moved < TOLERANCE_DEVIATIONS;
        if converged || rounds >= options.rounds.max(1) {
            break (now, round, converged);
        }
        weights = Some(round.next_weights(options.weighting));
        sums = is_linear.then_some(now);
    };
    let rows = found.efforts.iter().map(|e| e.samples).max().unwrap_or(0);
    // whitened scores need a short bandwidth only: Stock and Watson's rule
    #[allow(clippy::cast_sign_loss, reason = "a cube root of a count")]
    let whitened = 1 + (0.75 * (rows as f64).cbrt()) as usize;
    let bandwidth = options.hac_bandwidth.unwrap_or(whitened);
    let bandwidth = bandwidth.clamp(1, rows.max(1));
    let covariance = covariances(equations, &found, bandwidth)?;
    let Correlated {
        mut deviations,
        white,
    } = deviations(equations, &found)?;
    let mut estimate = Estimate::of(&found.solution.factor)?;
    estimate.labels.clone_from(&origin.labels);
    estimate.values.clone_from(&found.solution.values);
    estimate.efforts = Estimate::new(&sums.factors, options.weighting)?.efforts;
    let errors = found.efforts.iter().zip(&found.weights);
    for (fit, (error, weight)) in estimate.efforts.iter_mut().zip(errors) {
        fit.sigma = error.rms;
        fit.weight = *weight;
    }
    let estimate = estimate.with_covariance(white)?;
    if options.hac_bandwidth.is_some() {
        let freedom = bartlett_stretches(rows, bandwidth);
        let freedom = freedom.min(estimate.degrees_of_freedom as f64);
        let growth = bartlett_growth(rows, bandwidth);
        let grown = covariance.instrumental.iter().map(|c| c * growth);
        deviations = deviations.with_covariance(grown.collect(), freedom);
    }
    let mut changed = ChangedParameters::new(origin.labels.clone());
    equations.changed(&found.solution.values, &found.weights, &mut changed)?;
    let mut held = HeldEfforts::new(origin.labels.len());
    equations.held(&found.weights, &mut held)?;
    let changes = [
        changed.finish(&found.solution.factor),
        found.solution.changed_by(&held.into_scores()),
    ];
    let (deviations, sampling) = deviations.with_sampling(&changes);
    let test = hausman(
        &found.solution.least_squares,
        &found.solution.values,
        &covariance.difference,
        bartlett_stretches(rows, bandwidth),
    );
    Ok(Instrumental {
        estimate,
        deviations,
        is_coarsely_sampled: !sampling.is_empty(),
        test,
        relevance: core::mem::take(&mut found.solution.relevance),
        least_squares: found.solution.least_squares,
        rounds,
        converged,
        errors: found.efforts,
        relative_absolute: found.relative_absolute,
        at_instruments: found.at_instruments,
        hac_bandwidth: options.hac_bandwidth.is_some().then_some(bandwidth),
        left_out: LeftOut::default(),
    })
}

/// The estimate of one round, with its weights and errors.
struct RoundResult {
    solution: Solution,
    weights: Vec<f64>,
    efforts: Vec<EffortError>,
    relative_absolute: f64,
    at_instruments: f64,
}

impl RoundResult {
    /// The weights of the efforts for the next round.
    fn next_weights(&self, weighting: Weighting) -> Vec<f64> {
        let pairs = self.efforts.iter().zip(&self.weights);
        let weight = |(error, old): (&EffortError, &f64)| match weighting {
            Weighting::Equal => 1.0,
            Weighting::PerEffort if error.rms > 0.0 => 1.0 / error.rms,
            Weighting::PerEffort => *old,
        };
        pairs.map(weight).collect()
    }
}

/// The residuals at the measured motion and at that of the instruments.
fn residuals<E: InstrumentedEquations>(
    equations: &mut E,
    options: &InstrumentOptions,
    sums: &Sums,
    values: &[f64],
) -> Result<(Residuals, Residuals), E::Error> {
    let means = sums.factors.means();
    let names = sums.factors.efforts.clone();
    let mut measured = Residuals::new(&names, &means, options.lags);
    let mut smooth = measured.clone();
    let (mut fitted, mut other, mut used) = (Vec::new(), Vec::new(), Vec::new());
    equations.visit(&mut |rows| {
        if !rows.follows {
            measured.interrupt();
            smooth.interrupt();
        }
        let count = rows.tau.len();
        let (_, instruments) = rows.w.split_at(values.len() * count);
        let at = Equations {
            w: instruments,
            ..*rows
        };
        fitted.clear();
        fitted.extend((0..count).map(|e| predicted(rows, e, values)));
        other.clear();
        other.extend((0..count).map(|e| predicted(&at, e, values)));
        used.clear();
        used.extend(rows.weights.iter().map(|w| *w > 0.0));
        measured.push_used(rows.tau, &fitted, &used)?;
        smooth.push_used(rows.tau, &other, &used)
    })?;
    Ok((measured, smooth))
}
