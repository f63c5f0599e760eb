//! Least squares, by which every identification starts: from logs, from factors, or with linear
//! friction in place of friction that is not linear.

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

/// What least squares found, and what goes on from it.
pub struct Start {
    /// Which equations were used, in words.
    pub kind: String,
    /// The weighted factor that the values are the solution of.
    pub factor: QrFactor,
    /// The estimate.
    pub estimate: Estimate,
    /// The intervals of the estimate's values.
    pub intervals: Intervals,
    /// The deviations that they are made of.
    pub deviations: Deviations,
    /// The estimate with the covariance that the intervals come from.
    pub used: Estimate,
    /// The scores of the logs in order of time; none where factors are all that is known.
    pub blocks: Option<Blocks>,
    /// The samples, where friction is not linear.
    pub data: Option<FrictionData>,
    /// What is left of each effort; empty where no logs are known.
    pub errors: Vec<EffortError>,
    /// eps_RA in percent (Eq. 33), where logs are known.
    pub relative_absolute: Option<f64>,
    /// Samples in which residuals count as correlated, where logs are known.
    pub bandwidth: Option<usize>,
    /// Samples and equations that were left out, where logs are known.
    pub left_out: Option<LeftOut>,
    /// By how much efforts are logged behind the motion, where logs are known.
    pub delays: Delays,
    /// What was read of the logs.
    pub reports: Vec<FileReport>,
}

impl Start {
    /// The start as a model that was identified.
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

/// A deviation grows by this part at least where it is said that it does.
const GROWN: f64 = 0.1;
/// Passes that find the efforts' noise; two settle it to a percent.
const PASSES: usize = 3;

/// Least squares from logs.
///
/// # Errors
/// What keeps the logs from being read, or parameters that they do not determine.
pub fn from_logs<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    logs: &mut MonitoredLogs<'_, M>,
) -> Result<Start, SessionError> {
    let (model, kind) = (session.model, session.kind);
    let mut found = identify::identify(model, kind, &session.options, logs)?;
    let sampled = match kind {
        EquationKind::Forces => sampling(&mut found, logs)?,
        EquationKind::Energy { .. } => "",
    };
    let used = found.correlated();
    let method = if let Some(n) = session.options.bandwidth {
        format!("least squares, residuals correlated in {n} samples (Newey and West){sampled}")
    } else {
        format!("least squares, {}{sampled}", describe(&found.deviations))
    };
    Ok(Start {
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

/// Adds what the sampling of the positions does to parameters to their deviations; says so where
/// that is much.
fn sampling<M: BaseModel<f64> + ?Sized>(
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
    let grown = |k: usize| found.deviations.sigma(k) > (1.0 + GROWN) * before.sigma(k);
    Ok(if (0..change.len()).any(grown) {
        "; and what sampling leaves unknown of the motion"
    } else {
        ""
    })
}

/// How deviations that know of correlation were found, in words.
pub fn describe(deviations: &Deviations) -> String {
    format!(
        "residuals correlated in time ({:.0} samples are as good as one; {} cosines of whitened \
         scores)",
        deviations.memory, deviations.terms
    )
}

/// Least squares from factors of logs, merged.
///
/// # Errors
/// [`SessionError::Digest`] for factors of another model; parameters that they do not determine.
pub fn from_factors<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    sets: Vec<FactorSet>,
) -> Result<Start, SessionError> {
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

/// A start whose residuals count as white.
fn white<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    kind: String,
    factor: QrFactor,
    estimate: Estimate,
) -> Start {
    let method = "least squares, for white residuals".to_owned();
    Start {
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

/// Reads logs into memory and solves the model with linear friction at the joints whose friction
/// is not linear.
///
/// # Errors
/// [`SessionError::NoNonlinearFriction`]; what keeps the logs from being read.
pub fn with_friction<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    logs: &[PathBuf],
) -> Result<Start, SessionError> {
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
    for _ in 0..PASSES {
        let (beta, friction) = physical::linear_part(model, &joints, &estimate.values);
        let linear = IdentifiedModel {
            beta,
            friction,
            ..IdentifiedModel::default()
        };
        let found = linear.residuals(model, EquationKind::Forces, &mut logs, &means, 1)?;
        let efforts = found.efforts();
        if session.options.weighting == Weighting::PerEffort {
            // efforts without any noise are not told apart
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
    // the intervals are those of the estimate as it is weighted, without the efforts' figures
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
