//! Least squares, with which every identification starts: from logs, from QR factors, or with
//! linear friction in place of nonlinear friction.

use std::path::PathBuf;

use regen_runtime::BaseModel;

use super::{MonitoredLogs, Session, SessionError, physical};
use crate::data::FileReport;
use crate::estimate::{
    Blocks, Deviations, EffortError, EffortFit, Estimate, FactorSet, QrFactor, Weighting,
};
use crate::friction::{FrictionData, collect, nonlinear_joints};
use crate::identify::{self, Delays, EquationKind, Identified, LeftOut, digest};
use crate::model::{IdentifiedModel, Intervals};

/// The result of least squares, and the data that further estimators need.
pub struct LeastSquaresStart {
    /// The kind of equations, in words.
    pub kind: String,
    /// The weighted QR factor whose solution the values are.
    pub factor: QrFactor,
    /// The estimate, with the covariance for white residuals.
    pub estimate: Estimate,
    /// The confidence intervals of the estimate's values.
    pub intervals: Intervals,
    /// The standard deviations of the estimate, as draws of the parameters need them.
    pub deviations: Deviations,
    /// The estimate with the covariance of the intervals.
    pub used: Estimate,
    /// The scores of the logs in order of time; `None` for a start from QR factors or with
    /// nonlinear friction.
    pub blocks: Option<Blocks>,
    /// The samples, for nonlinear friction.
    pub data: Option<FrictionData>,
    /// The residuals' statistics of each effort; empty for a start from QR factors.
    pub errors: Vec<EffortError>,
    /// eps_RA in percent (Eq. 33); `None` for a start from QR factors.
    pub relative_absolute: Option<f64>,
    /// The number of samples in which residuals count as correlated; `None` where they count as
    /// white.
    pub bandwidth: Option<usize>,
    /// The samples and equations that were left out; `None` for a start from QR factors.
    pub left_out: Option<LeftOut>,
    /// The delays of efforts behind the motion; empty unless the start is from logs.
    pub delays: Delays,
    /// The summaries of the logs; empty for a start from QR factors.
    pub reports: Vec<FileReport>,
}

impl LeastSquaresStart {
    /// The least-squares parameters as an identified model.
    pub fn model(&self) -> IdentifiedModel {
        IdentifiedModel {
            name: "least squares".to_owned(),
            beta: self.estimate.values.clone(),
            feasibility: "not judged".to_owned(),
            intervals: self.intervals.clone(),
            ..IdentifiedModel::default()
        }
    }
}

/// Least relative growth of a standard deviation by the sampling error at which the error is
/// mentioned.
const MIN_MENTIONED_GROWTH: f64 = 0.1;
/// Passes that estimate the efforts' noise; two settle it to a percent.
const NOISE_PASSES: usize = 3;

/// Solves least squares from logs.
///
/// # Errors
/// When the logs cannot be read, or do not determine the parameters.
pub fn from_logs<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    logs: &mut MonitoredLogs<'_, M>,
) -> Result<LeastSquaresStart, SessionError> {
    let (model, kind) = (session.model, session.kind);
    let mut found = identify::identify(model, kind, &session.options, logs)?;
    let sampled = match kind {
        EquationKind::Forces => add_sampling_error(&mut found, logs)?,
        EquationKind::Energy { .. } => "",
    };
    let used = found.correlated();
    let method = if let Some(n) = session.options.bandwidth {
        format!("least squares, residuals correlated in {n} samples (Newey and West){sampled}")
    } else {
        format!("least squares, {}{sampled}", describe(&found.deviations))
    };
    Ok(LeastSquaresStart {
        kind: kind.name(),
        factor: found.factor,
        intervals: Intervals::of(&found.estimate, &used, session.confidence, method),
        estimate: found.estimate,
        deviations: found.deviations,
        used,
        blocks: Some(found.blocks),
        data: None,
        errors: found.errors,
        relative_absolute: Some(found.relative_absolute),
        bandwidth: Some(found.bandwidth),
        left_out: Some(found.left_out),
        delays: found.delays,
        reports: logs.logs().reports().to_vec(),
    })
}

/// Adds the error that comes from the sampling of the positions to the parameters' standard
/// deviations; returns a text that mentions it where it is large.
fn add_sampling_error<M: BaseModel<f64> + ?Sized>(
    found: &mut Identified,
    logs: &MonitoredLogs<'_, M>,
) -> Result<&'static str, SessionError> {
    let weights: Vec<f64> = found.estimate.efforts.iter().map(|e| e.weight).collect();
    let values = &found.estimate.values;
    let change = logs
        .logs()
        .discretisation(values, &weights, &found.factor)?;
    let blocks = found.blocks.clone().with_change(&found.factor, &change);
    let changed = found.deviations.with_change(&change);
    let before = std::mem::replace(&mut found.deviations, changed);
    found.blocks = blocks;
    let grown =
        |k: usize| found.deviations.sigma(k) > (1.0 + MIN_MENTIONED_GROWTH) * before.sigma(k);
    Ok(if (0..change.len()).any(grown) {
        "; and what sampling leaves unknown of the motion"
    } else {
        ""
    })
}

/// Describes in words how the standard deviations account for the residuals' correlation.
pub fn describe(deviations: &Deviations) -> String {
    format!(
        "residuals correlated in time ({:.0} samples are as good as one; {} cosines of whitened \
         scores)",
        deviations.memory, deviations.terms
    )
}

/// Solves least squares from the QR factors of one or more logs.
///
/// # Errors
/// [`SessionError::Digest`] for factors of another model; when the factors do not determine the
/// parameters.
pub fn from_factors<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    sets: Vec<FactorSet>,
) -> Result<LeastSquaresStart, SessionError> {
    let own = digest(session.model);
    for (place, set) in sets.iter().enumerate() {
        if set.model != own {
            return Err(SessionError::Digest {
                place,
                robot: set.robot.clone(),
                found: set.model.clone(),
                expected: own,
            });
        }
    }
    let set = FactorSet::merged(sets)?;
    let estimate = Estimate::new(&set, session.options.weighting)?;
    let weights: Vec<f64> = estimate.efforts.iter().map(|e| e.weight).collect();
    Ok(white(
        session,
        set.kind.clone(),
        set.combined(&weights)?,
        estimate,
    ))
}

/// Builds a start whose intervals assume white residuals.
fn white<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    kind: String,
    factor: QrFactor,
    estimate: Estimate,
) -> LeastSquaresStart {
    let method = "least squares, for white residuals".to_owned();
    LeastSquaresStart {
        kind,
        factor,
        intervals: Intervals::of(&estimate, &estimate, session.confidence, method),
        deviations: Deviations::white(&estimate),
        used: estimate.clone(),
        estimate,
        blocks: None,
        data: None,
        errors: Vec::new(),
        relative_absolute: None,
        bandwidth: None,
        left_out: None,
        delays: Delays::default(),
        reports: Vec::new(),
    }
}

/// Reads logs into memory and solves least squares with linear friction at the joints with
/// nonlinear friction.
///
/// # Errors
/// [`SessionError::NoNonlinearFriction`] for a robot without such joints; when the logs cannot be
/// read.
pub fn with_friction<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    logs: &[PathBuf],
) -> Result<LeastSquaresStart, SessionError> {
    let model = session.model;
    let info = model.info();
    let joints = nonlinear_joints(model);
    if joints.is_empty() {
        return Err(SessionError::NoNonlinearFriction(info.name.to_owned()));
    }
    let mut logs = session.open(logs)?;
    let means = identify::observe(model, EquationKind::Forces, &mut logs)?
        .0
        .means();
    let (mut data, left_out) = collect(model, &mut logs, &joints)?;

    let mut weights = vec![1.0; info.dof()];
    let mut factor = data.linear_factor()?;
    let mut estimate = Estimate::of(&factor)?;
    let mut errors = None;
    for _ in 0..NOISE_PASSES {
        let (beta, friction) = physical::linear_part(model, &joints, &estimate.values);
        let linear = IdentifiedModel {
            beta,
            friction,
            ..IdentifiedModel::default()
        };
        let found = linear.residuals(model, EquationKind::Forces, &mut logs, &means, 1)?;
        let efforts = found.efforts();
        if session.options.weighting == Weighting::PerEffort {
            // a lower bound on the noise, so that the weights are finite
            let largest = efforts.iter().fold(f64::MIN_POSITIVE, |m, e| m.max(e.rms));
            let next: Vec<f64> = efforts
                .iter()
                .map(|e| 1.0 / e.rms.max(1e-9 * largest))
                .collect();
            let by: Vec<f64> = next.iter().zip(&weights).map(|(n, w)| n / w).collect();
            data.weigh(&by)?;
            weights = next;
            factor = data.linear_factor()?;
            estimate = Estimate::of(&factor)?;
        }
        errors = Some(found);
    }
    // the efforts' figures are added after the intervals, which must not depend on them
    let mut start = white(session, EquationKind::Forces.name(), factor, estimate);
    if let Some(found) = errors {
        let pairs = found.efforts().into_iter().zip(&weights);
        start.estimate.efforts = pairs
            .map(|(error, weight)| EffortFit {
                name: error.name,
                rows: error.samples,
                sigma: error.rms,
                weight: *weight,
            })
            .collect();
        start.errors = found.efforts();
        start.relative_absolute = Some(found.relative_absolute());
    }
    start.left_out = Some(left_out);
    start.data = Some(data);
    start.reports = logs.logs().reports().to_vec();
    Ok(start)
}
