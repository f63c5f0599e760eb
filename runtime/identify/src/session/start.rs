//! The least-squares estimate with which every identification starts: from logs, from QR factors,
//! or with linear friction in place of nonlinear friction.

use regen_runtime::BaseModel;

use super::cutoffs::{Trial, moved_by_cutoff};
use super::motion_noise::{motion_bias, size_of};
use super::{MonitoredLogs, Session, SessionError, physical};
use crate::data::{Decision, FileReport, Run, Settings};
use crate::estimate::{
    Blocks, Deviations, EffortError, EffortFit, Estimate, FactorSet, LogErrors, QrFactor,
    Residuals, Weighting,
};
use crate::friction::{self, FrictionData, collect};
use crate::identify::{
    self, Delays, EquationBuilder, EquationKind, Equations, HeldEfforts, Identified, LeftOut,
    NoColumns, StoredEquations, digest,
};
use crate::model::{IdentifiedModel, Intervals};
use crate::signals::Method;
use crate::states::nonlinear_joints;

/// The result of least squares, and the data that further estimators need.
pub struct LeastSquaresStart {
    /// The name of the kind of equations, see [`EquationKind::name`].
    pub kind: String,
    /// The QR factor of the weighted equations, whose least-squares solution is `estimate.values`.
    pub factor: QrFactor,
    /// The estimate, with the covariance for white residuals.
    pub estimate: Estimate,
    /// The confidence intervals of the estimate's values.
    pub intervals: Intervals,
    /// The covariance of the estimate that accounts for the correlation of the residuals, with a
    /// Cholesky factor from which random parameters are drawn.
    pub deviations: Deviations,
    /// The estimate with the covariance and degrees of freedom that `intervals` are computed from.
    pub estimate_for_intervals: Estimate,
    /// The scores (contributions of the residuals to the gradient of least squares), summed over
    /// blocks of consecutive samples; `None` for a start from QR factors.
    pub score_blocks: Option<Blocks>,
    /// The samples of all logs; `None` unless the start is for nonlinear friction.
    pub data: Option<FrictionData>,
    /// The equations of all logs, which residuals of other models are computed from; `None` where
    /// they were too many to be stored, and for other starts than those from logs.
    pub equations: Option<StoredEquations>,
    /// The residuals' statistics of each effort; empty for a start from QR factors.
    pub errors: Vec<EffortError>,
    /// eps_RA in percent (Eq. 33); `None` for a start from QR factors.
    pub relative_absolute: Option<f64>,
    /// The number of consecutive samples over which residuals count as correlated; `None` where
    /// they count as white.
    pub correlation_length: Option<usize>,
    /// The samples and equations that were left out; `None` for a start from QR factors.
    pub left_out: Option<LeftOut>,
    /// The estimated delays of the efforts behind the motion; empty unless the start is from logs.
    pub delays: Delays,
    /// For each effort, the number of parameters that its equations contain; empty where that is not
    /// known.
    pub contained: Vec<usize>,
    /// The summaries of the logs; empty for a start from QR factors.
    pub reports: Vec<FileReport>,
    /// What was added to each parameter since noise of the motion biases it; empty where that is not known.
    pub correction: Vec<f64>,
}

impl LeastSquaresStart {
    /// Whether all equations of an effort are left out, and not because its joint rests: an effort acts
    /// on them that is not measured.
    pub fn is_unmeasured(&self, effort: usize) -> bool {
        let rows = self.estimate.efforts.get(effort).map(|e| e.rows);
        let resting = self
            .left_out
            .as_ref()
            .and_then(|left| left.resting.get(effort));
        rows == Some(0) && resting == Some(&0)
    }

    /// The residuals' statistics of the efforts that are measured.
    pub fn measured_errors(&self) -> Vec<EffortError> {
        let errors = self.errors.iter().enumerate();
        let measured = errors.filter(|(k, _)| !self.is_unmeasured(*k));
        measured.map(|(_, error)| error.clone()).collect()
    }

    /// Whether the model explains all efforts but for noise.
    pub fn explains_all(&self) -> bool {
        let mut errors = self.measured_errors().into_iter();
        errors.all(|error| error.of_means().is_explained())
    }

    /// The start from equations of motion that were solved with their statistics.
    ///
    /// - `confidence`: the level of the intervals, in (0, 1); `method`: how they were computed, in
    ///   words.
    pub fn of_identified(identified: Identified, confidence: f64, method: String) -> Self {
        let estimate_for_intervals = identified.correlated();
        Self {
            kind: EquationKind::Forces.name(),
            factor: identified.factor,
            intervals: Intervals::of(
                &identified.estimate,
                &estimate_for_intervals,
                confidence,
                method,
            ),
            estimate: identified.estimate,
            deviations: identified.deviations,
            estimate_for_intervals,
            score_blocks: Some(identified.blocks),
            data: None,
            equations: None,
            errors: identified.errors,
            relative_absolute: Some(identified.relative_absolute),
            correlation_length: Some(identified.correlation_length),
            left_out: Some(identified.left_out),
            delays: identified.delays,
            contained: identified.contained,
            reports: Vec::new(),
            correction: Vec::new(),
        }
    }

    /// The errors of the estimate, for factors of the same logs; `None` for a start from factors, which knows none.
    pub fn log_errors(&self) -> Option<LogErrors> {
        self.score_blocks.as_ref()?;
        let n = self.estimate.values.len();
        let filled = |own: &[f64]| {
            let mut out = own.to_vec();
            out.resize(n, 0.0);
            out
        };
        let deviations = &self.deviations;
        Some(LogErrors {
            weights: self.estimate.efforts.iter().map(|e| e.weight).collect(),
            covariance: deviations.covariance.clone(),
            degrees_of_freedom: deviations.degrees_of_freedom.clone(),
            correction: filled(&self.correction),
            bias: filled(&self.intervals.bias),
            terms: deviations.terms,
            samples: deviations.samples,
            memory: deviations.memory,
        })
    }

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

/// How deviations name that they contain what noise of the motion biases.
pub(super) const MOTION_NOISE: &str = "; and what noise of the measured motion biases";

/// Number of passes that estimate the efforts' noise; it converges to a percent in two.
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
    let (mut identified, equations) =
        identify::identify_and_store(model, kind, &session.options, logs)?;
    let sampling_note = match kind {
        EquationKind::Forces => {
            add_sampling_error(session.model, &mut identified, equations.as_ref(), logs)?
        }
        EquationKind::Energy { .. } => "",
    };
    let late = delay_changes(&session.reading, &identified.delays);
    let is_late = identified.delays.are_significant();
    for change in &late {
        add_change(change, &mut identified);
    }
    let motion = add_motion_noise(session, logs, &mut identified)?;
    let noise_note = match &motion {
        Some(own) if own.is_mentioned => MOTION_NOISE,
        _ => "",
    };
    let method = if let Some(n) = session.options.hac_bandwidth {
        format!(
            "least squares, residuals correlated in {n} samples (Newey and West){sampling_note}{noise_note}"
        )
    } else {
        format!(
            "least squares, {}{sampling_note}{noise_note}",
            identified.deviations.in_words()
        )
    };
    let moved = match (&motion, session.reading.method) {
        (Some(_), Method::Butterworth { cutoff, .. })
            if session.reading.method_by == Decision::Given =>
        {
            let given = Trial::of_corrected(&identified, cutoff);
            moved_by_cutoff(session, logs.logs(), given)?
        }
        _ => None,
    };
    if let Some(change) = &moved {
        add_change(change, &mut identified);
    }
    let mut start = LeastSquaresStart::of_identified(identified, session.confidence, method);
    if let Some(own) = motion {
        (start.intervals.bias, start.correction) = (own.size, own.correction);
    }
    if let Some(change) = moved {
        add_bias(&[change], &mut start.intervals.bias);
    }
    if is_late {
        add_bias(&late, &mut start.intervals.bias);
    }
    Ok(LeastSquaresStart {
        kind: kind.name(),
        equations,
        reports: logs.logs().reports().to_vec(),
        ..start
    })
}

/// By how much delays move the parameters, SI: the errors of those that were found from the same logs and
/// corrected, and last what the equations still have.
pub fn delay_changes(reading: &Settings, found: &Delays) -> Vec<Vec<f64>> {
    // a single value of all efforts has one cause
    let mut pairs = reading.delays.windows(2);
    let is_one = reading.delays.len() == found.efforts.len()
        && found.efforts.len() > 1
        && pairs.all(|own| matches!(own, [(_, a), (_, b)] if a.to_bits() == b.to_bits()));
    let mut changes = match (reading.are_delays_found, is_one) {
        (false, _) => Vec::new(),
        (true, true) => vec![found.common_change.clone()],
        (true, false) => found.changes.clone(),
    };
    changes.push(found.left_change(reading.are_delays_found && !is_one));
    changes
}

/// Adds what delays that are beyond chance bias, the last of their changes, to the biases of the parameters.
fn add_bias(late: &[Vec<f64>], biases: &mut Vec<f64>) {
    let left = late.last().map_or(&[][..], Vec::as_slice);
    biases.resize(biases.len().max(left.len()), 0.0);
    for (bias, change) in biases.iter_mut().zip(left) {
        *bias = bias.hypot(*change);
    }
}

/// Adds what something moves, whose size is known and whose sign is not, to the deviations.
fn add_change(change: &[f64], identified: &mut Identified) {
    if change.iter().all(|x| *x == 0.0) {
        return;
    }
    identified.deviations = identified.deviations.with_change(change);
    let blocks = identified.blocks.clone();
    identified.blocks = blocks.with_change(&identified.factor, change);
}

/// What was done about the noise of the measured motion.
struct MotionNoise {
    /// What it biases of each parameter, in its unit.
    size: Vec<f64>,
    /// What was added to each.
    correction: Vec<f64>,
    /// Whether a deviation grows enough for it to be mentioned.
    is_mentioned: bool,
}

/// Corrects the parameters for what noise of the measured motion biases, and adds the size of the
/// correction to their deviations: noise is known from the log alone; `None` where no motion is differentiated.
fn add_motion_noise<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    logs: &MonitoredLogs<'_, M>,
    identified: &mut Identified,
) -> Result<Option<MotionNoise>, SessionError> {
    session.watch.phase("adding noise to the motion");
    let efforts = identified.estimate.efforts.iter();
    let weights: Vec<f64> = efforts.map(|e| e.weight).collect();
    let covariance = identified.deviations.covariance.clone();
    let given = (weights.as_slice(), identified.static_friction.as_slice());
    let found = motion_bias(session, logs.logs(), given, &covariance, false);
    session.watch.finished();
    let Some(bias) = found? else {
        return Ok(None);
    };
    let (increased, words) = identified.deviations.with_sampling(&bias.changes);
    identified.deviations = increased;
    let blocks = identified.blocks.clone();
    let changes = bias.changes.iter();
    identified.blocks = changes.fold(blocks, |blocks, change| {
        blocks.with_change(&identified.factor, change)
    });
    let change: Vec<f64> = bias.correction.iter().map(|x| -x).collect();
    identified.factor = identified.factor.moved_by(&change);
    for (value, change) in identified.estimate.values.iter_mut().zip(&change) {
        *value += change;
    }
    let size = size_of(&bias.changes, bias.correction.len());
    Ok(Some(MotionNoise {
        size,
        correction: change,
        is_mentioned: !words.is_empty(),
    }))
}

/// Adds the errors that come from the sampling of the positions, and from efforts that are held between
/// rows, to the parameters' standard deviations; returns a text for the name of the method, empty where
/// they are small.
///
/// - `equations`: those of the logs, `None` if they were too many to be stored.
fn add_sampling_error<M: BaseModel<f64> + ?Sized>(
    model: &M,
    identified: &mut Identified,
    equations: Option<&StoredEquations>,
    logs: &mut MonitoredLogs<'_, M>,
) -> Result<&'static str, SessionError> {
    let weights: Vec<f64> = identified
        .estimate
        .efforts
        .iter()
        .map(|e| e.weight)
        .collect();
    let values = &identified.estimate.values;
    let change = logs
        .logs()
        .discretisation(values, &weights, &identified.factor)?;
    let mut held = HeldEfforts::new(values.len());
    let mut each = |rows: &Equations<'_>| {
        held.push(rows, &weights);
        Ok(())
    };
    if let Some(stored) = equations {
        stored.visit(&mut each)?;
    } else {
        let none = &mut NoColumns;
        identify::equations(model, EquationKind::Forces, logs, none, &mut each)?;
    }
    let changes = [change, held.change(&identified.factor)];
    let (increased, words) = identified.deviations.with_sampling(&changes);
    identified.deviations = increased;
    let blocks = identified.blocks.clone();
    let add = |blocks: Blocks, change| blocks.with_change(&identified.factor, change);
    identified.blocks = changes.iter().map(Vec::as_slice).fold(blocks, add);
    Ok(words)
}

/// Solves least squares from the QR factors of one or more logs.
///
/// # Errors
/// [`SessionError::Digest`] for factors of another model, [`SessionError::Origin`] for those that no
/// observation of this one gives; when the factors do not determine the
/// parameters.
pub fn from_factors<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    sets: Vec<FactorSet>,
) -> Result<LeastSquaresStart, SessionError> {
    let expected_digest = digest(session.model);
    for (place, set) in sets.iter().enumerate() {
        if set.model != expected_digest {
            return Err(SessionError::Digest {
                place,
                robot: set.robot.clone(),
                found: set.model.clone(),
                expected: expected_digest,
            });
        }
        require_origin(session.model, place, set)?;
    }
    let set = FactorSet::merged(sets)?;
    let estimate = Estimate::new(&set, session.options.weighting)?;
    let weights: Vec<f64> = estimate.efforts.iter().map(|e| e.weight).collect();
    let start = white(session, set.kind.clone(), set.combined(&weights)?, estimate);
    // they are the errors of the estimate with weights by effort
    let errors = set
        .errors()
        .filter(|_| session.options.weighting == Weighting::PerEffort);
    Ok(match errors {
        Some(errors) => of_log_errors(start, session.confidence, errors),
        None => start,
    })
}

/// The start from factors with the errors that their logs tell.
fn of_log_errors(
    start: LeastSquaresStart,
    confidence: f64,
    errors: &LogErrors,
) -> LeastSquaresStart {
    let mut estimate = start.estimate;
    for (value, change) in estimate.values.iter_mut().zip(&errors.correction) {
        *value += change;
    }
    let deviations = Deviations::of_logs(errors);
    let estimate_for_intervals = estimate.with_deviations(&deviations);
    let method = format!(
        "least squares, {}, as the logs of the factors tell",
        deviations.in_words()
    );
    let mut intervals = Intervals::of(&estimate, &estimate_for_intervals, confidence, method);
    intervals.bias.clone_from(&errors.bias);
    LeastSquaresStart {
        factor: start.factor.moved_by(&errors.correction),
        intervals,
        deviations,
        estimate_for_intervals,
        estimate,
        ..start
    }
}

/// Refuses factors whose robot, kind, efforts or labels are not those of the model's equations.
fn require_origin<M: BaseModel<f64> + ?Sized>(
    model: &M,
    place: usize,
    set: &FactorSet,
) -> Result<(), SessionError> {
    let kind = EquationKind::of_name(&set.kind);
    let expected = EquationBuilder::new(model, kind.unwrap_or_default()).origin();
    let kinds = "forces` or `energy over 0.5 s".to_owned();
    let lists = |all: &[String]| all.join(", ");
    let pairs = [
        ("robot", set.robot.clone(), expected.robot),
        (
            "kind",
            set.kind.clone(),
            kind.map_or(kinds, EquationKind::name),
        ),
        ("efforts", lists(&set.efforts), lists(&expected.efforts)),
        ("labels", lists(set.labels()), lists(&expected.labels)),
    ];
    match pairs.into_iter().find(|(_, found, own)| found != own) {
        None => Ok(()),
        Some((what, found, expected)) => Err(SessionError::Origin {
            place,
            what,
            found,
            expected,
        }),
    }
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
        estimate_for_intervals: estimate.clone(),
        estimate,
        score_blocks: None,
        data: None,
        equations: None,
        errors: Vec::new(),
        relative_absolute: None,
        correlation_length: None,
        left_out: None,
        delays: Delays::default(),
        contained: Vec::new(),
        reports: Vec::new(),
        correction: Vec::new(),
    }
}

/// Reads logs into memory and solves least squares for a robot with nonlinear friction. The
/// equations are the equations of motion, also in a session for energy balances, and joints with
/// nonlinear friction have linear friction at first.
///
/// # Errors
/// [`SessionError::NoNonlinearFriction`] for a robot without such joints; when the logs cannot be
/// read.
pub fn with_friction<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    logs: &[Run],
) -> Result<LeastSquaresStart, SessionError> {
    let model = session.model;
    let info = model.info();
    let joints = nonlinear_joints(model);
    if joints.is_empty() {
        return Err(SessionError::NoNonlinearFriction(info.name.to_owned()));
    }
    let mut logs = session.open(logs)?;
    let (mut data, left_out) = collect(model, &mut logs, &joints)?;

    let efforts = EquationBuilder::new(model, EquationKind::Forces)
        .origin()
        .efforts;
    let mut weights = vec![1.0; info.dof()];
    // residuals are computed from the equations as they were read, so that weights round nothing
    let unweighted = data.clone();
    let mut factor = data.linear_factor()?;
    let mut estimate = Estimate::of(&factor)?;
    let mut residuals = None;
    for _ in 0..NOISE_PASSES {
        let (beta, friction) = physical::linear_part(model, &joints, &estimate.values);
        let statistics = unweighted.residuals(&efforts, &beta, &friction, 1)?;
        let effort_errors = statistics.efforts();
        if session.options.weighting == Weighting::PerEffort {
            // the lower bound of 1e-9 of the largest noise keeps the weights finite
            let largest_rms = effort_errors
                .iter()
                .fold(f64::MIN_POSITIVE, |m, e| m.max(e.rms));
            let new_weights: Vec<f64> = effort_errors
                .iter()
                .map(|e| 1.0 / e.rms.max(1e-9 * largest_rms))
                .collect();
            let weight_ratios: Vec<f64> = new_weights
                .iter()
                .zip(&weights)
                .map(|(n, w)| n / w)
                .collect();
            data.weigh(&weight_ratios)?;
            weights = new_weights;
            factor = data.linear_factor()?;
            estimate = Estimate::of(&factor)?;
        }
        residuals = Some(statistics);
    }
    let delays = {
        let options = identify::Options {
            weighting: session.options.weighting,
            ..identify::Options::default()
        };
        super::delays::identified(session, &options, &mut logs)?.delays
    };
    let late = delay_changes(&session.reading, &delays);
    let by_noise;
    let (deviations, blocks, sampling_note, changes) = {
        let blocks = data.linear_scores(&estimate.values)?;
        let all: Vec<usize> = (0..estimate.values.len()).collect();
        let found = blocks.deviations(&factor, &all, &estimate.values, 1.0)?;
        let values = &estimate.values;
        session.watch.phase("adding noise to the motion");
        let motion = motion_bias(
            session,
            logs.logs(),
            (&weights, &[]),
            &found.covariance,
            true,
        );
        session.watch.finished();
        let by_motion = motion?.map(|bias| bias.changes).unwrap_or_default();
        by_noise = if by_motion.is_empty() {
            Vec::new()
        } else {
            size_of(&by_motion, values.len())
        };
        let mut changes = vec![
            friction::discretisation(model, &mut logs, values, &weights, &factor)?,
            data.linear_change_if_held(&factor)?,
        ];
        changes.extend(by_motion);
        let (found, words) = found.with_sampling(&changes);
        let found = late
            .iter()
            .fold(found, |sum, change| sum.with_change(change));
        changes.extend(late.iter().filter(|change| !change.is_empty()).cloned());
        let add = |blocks: Blocks, change| blocks.with_change(&factor, change);
        let blocks = changes.iter().map(Vec::as_slice).fold(blocks, add);
        (found, blocks, words, changes)
    };
    let estimate_for_intervals = estimate.with_deviations(&deviations);
    let method = format!("least squares, {}{sampling_note}", deviations.in_words());
    let confidence = session.confidence;
    // the intervals are those of the estimate of the weighted rows, so they come before its efforts
    // get their own statistics
    let mut intervals = Intervals::of(&estimate, &estimate_for_intervals, confidence, method);
    intervals.bias = by_noise;
    if delays.are_significant() {
        add_bias(&late, &mut intervals.bias);
    }
    if let Some(statistics) = &residuals {
        let errors_and_weights = statistics.efforts().into_iter().zip(&weights);
        estimate.efforts = errors_and_weights
            .map(|(error, weight)| EffortFit {
                name: error.name,
                rows: error.samples,
                sigma: error.rms,
                weight: *weight,
            })
            .collect();
    }
    Ok(LeastSquaresStart {
        kind: EquationKind::Forces.name(),
        factor,
        intervals,
        deviations,
        estimate_for_intervals,
        correlation_length: Some(identify::samples_per_independent_one(&blocks)),
        score_blocks: Some(blocks),
        estimate,
        equations: None,
        errors: residuals
            .as_ref()
            .map(Residuals::efforts)
            .unwrap_or_default(),
        relative_absolute: residuals.as_ref().map(Residuals::relative_absolute),
        left_out: Some(left_out),
        data: Some(data.with_changes(&changes)),
        delays,
        contained: Vec::new(),
        reports: logs.logs().reports().to_vec(),
        correction: Vec::new(),
    })
}
