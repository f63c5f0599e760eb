//! `regen identify`: base parameters from logs or from factor files.

use regen_codegen::robot::Robot;
use regen_identify::choice::Choice;
use regen_identify::data::{Assignment, DataError, Decision, ValuesFrom};
use regen_identify::estimate::{EffortError, EstimateError, FactorSet, Weighting};
use regen_identify::files::{FrictionRow, LeastSquaresRow, ParameterFile};
use regen_identify::identify::{self, EquationKind, Options, digest};
use regen_identify::model::{Covariance, IdentifiedModel, Provenance};
use regen_identify::session::{
    self, LeastSquaresStart, Session, SessionError, from_factors, from_logs, with_friction,
};
use regen_identify::signals::Method;
use regen_identify::status::EffortContributions;
use regen_identify::text::figure_of;
use regen_interpreted::{BaseTerms, Interpreted};
use regen_report::results::{
    self, Identification, ModelErrors, Summary, identification_text, reduction_steps, stem,
};
use regen_runtime::Friction;

use crate::args::{EstimatorArg, Format, IdentifyArgs, PayloadArg, ReadingArgs, WeightingArg};
use crate::exit::Failure;
use crate::{
    choice, delay, experiment, identify_iv, identify_loads, identify_simulated, load, observe,
    outputs, parameters, physical, report, suspect, table, terminal, write,
};

/// The result of the command.
pub(crate) struct Outcome {
    pub(crate) json: Identification,
    pub(crate) identified: IdentifiedModel,
    /// The estimate that it begins from; `None` with gains and payloads, or by simulation.
    pub(crate) start: Option<LeastSquaresStart>,
}

/// The smallest bound of Huber's loss in standard deviations: below it nearly all residuals would
/// count linearly.
const MIN_HUBER_BOUND: f64 = 0.1;

/// The covariance of Newey and West needs so many times its bandwidth of samples: it is biased by the part
/// of the bandwidth in them.
const MIN_BANDWIDTHS: usize = 4;

/// Runs the command.
pub(crate) fn run(args: &IdentifyArgs) -> Result<(), Failure> {
    if !(args.confidence > 0.0 && args.confidence < 1.0) {
        let text = "--confidence must be between 0 and 1, such as 0.95";
        return Err(Failure::Input(text.to_owned()));
    }
    if args
        .huber
        .is_some_and(|k| k.is_nan() || k < MIN_HUBER_BOUND)
    {
        let text = format!(
            "--huber counts in standard deviations, and must be at least {MIN_HUBER_BOUND}; 1.345 is \
             usual"
        );
        return Err(Failure::Input(text));
    }
    let chosen = identify_simulated::with_estimator(args)?;
    let args = &chosen;
    let source = load::source(&args.file)?;
    let mut args = args.clone();
    let planned = experiment::resolve_loaded(&mut args.logs, &mut args.reading, &source)?;
    if args.from.is_empty() {
        experiment::require_logs(&args.logs)?;
    }
    let has_loads = identify_loads::wanted(&args);
    if has_loads {
        identify_loads::require_options(&args)?;
    }
    if let Some(estimator @ (EstimatorArg::Didim | EstimatorArg::Response)) = args.estimator {
        identify_simulated::note_unused(estimator, &mut args.reading, &planned);
    } else {
        args.physical.against.extend(planned);
        let same = args.physical.against.iter();
        for run in same.filter(|run| args.logs.contains(run)) {
            terminal::note(&format!(
                "warning: {run} is identified from too: its error with --against validates nothing"
            ));
        }
    }
    let args = &args;
    let robot = if has_loads {
        identify_loads::robot(args, &source)?
    } else {
        load::loaded_with_base(&source, args.reading.payload)?
    };
    if observe::settings(&args.reading).poses && args.physical.wanted() {
        let text = "poses at rest show first moments only, and physical parameters need inertias too: \
                    leave out --feasible and --friction";
        return Err(Failure::Input(text.to_owned()));
    }
    let unseen = if has_loads {
        Vec::new()
    } else {
        unseen(args, &robot)
    };
    let robot = if unseen.is_empty() {
        robot
    } else {
        load::loaded_without(&source, args.reading.payload, &unseen)?
    };
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    observe::require_base(&model, &robot.name)?;
    if args.weighting == WeightingArg::Equal {
        require_several(&model, observe::kind(&args.reading))?;
    }
    let mut args = args.clone();
    let simulates = matches!(
        args.estimator,
        Some(EstimatorArg::Didim | EstimatorArg::Response)
    );
    let given = args.clone();
    let mut filter = if simulates {
        None
    } else if has_loads {
        choice::made_without_loads(&mut args, &source, None)?
    } else {
        let session = session(&args, &model);
        let open = choice::open(&args.reading, is_loss_open(&args));
        let made = choice::made(&mut args.reading, &session, &mut args.logs, open);
        if made.is_err() && suspect::warn_without_choice(&args, &model, &[]).is_empty() {
            suspect::warn_of_contradictions(&args, &model);
        }
        made?
    };
    args.huber = args.huber.or(filter.as_ref().and_then(Choice::huber));
    let args = &args;
    let corrected = if has_loads {
        // found together with gains and payloads
        None
    } else {
        delay::corrected(args, &session(args, &model))?
    };
    let args = corrected.as_ref().unwrap_or(args);
    let Outcome {
        mut json,
        mut identified,
        start,
    } = if has_loads {
        let (outcome, made) = identify_loads::solve(args, (&robot, &model), &source, &given)?;
        filter = made.or(filter);
        outcome
    } else {
        solve(args, &model)?
    };
    // what least squares would gain is no advice for another model, and a remedy that fails is none
    let is_least_squares = !(args.iv || args.physical.wanted() || args.physical.reduce);
    if let Some(start) = start.filter(|_| is_least_squares) {
        let on_time = delay::with_auto(args, &session(args, &model), &json.summary);
        let on_time = on_time.ok().flatten();
        let remedy = choice::bias_remedy(
            (args, &model),
            (&start, &json.file),
            filter.as_ref(),
            on_time.as_ref(),
        );
        json.summary.bias_remedy = remedy.ok().flatten();
        let tried = on_time.map(|other| delay::tried(&other, &model));
        let tried = tried.and_then(|found| found.ok().flatten());
        json.summary.relative_absolute_without_delays = tried;
    }
    // a filter that is chosen for a wrong model may leave too much noise to see what is wrong
    let is_poor = (json.summary.efforts.iter()).any(|effort| {
        effort
            .error
            .as_ref()
            .is_some_and(|error| !error.is_explained())
    });
    // what is told already comes first
    let is_open = json
        .summary
        .suspicions
        .iter()
        .all(|doubt| doubt.found.changed.is_none() && !doubt.found.remedy.gives_columns());
    if filter.is_some() && is_poor && is_open {
        let known = &json.summary.suspicions;
        let more = suspect::warn_without_choice(args, &model, known);
        json.summary.suspicions.extend(more);
    }
    json.file.filter.clone_from(&filter);
    identified.provenance.filter = filter;
    let mut written = Vec::new();
    if let Some(out) = &args.out {
        written.push((out, parameters::text(&json.file, out)?));
    }
    if let Some(out) = &args.physical.bodies {
        // a robot with payloads apart has their bodies too
        let payload = match robot.payloads[..] {
            [] => args.reading.payload,
            _ => Some(PayloadArg::Carried),
        };
        let text = outputs::spec(&source, payload, &model, &identified)?;
        written.push((out, text));
    }
    written.extend(outputs::constants(&args.physical, &model, &identified)?);
    for (out, text) in &written {
        write::atomically(out, text)?;
    }
    report::of_identified(args, &robot, &model, &json, &identified)?;
    terminal::print(&match args.format {
        Format::Json => table::document(&json),
        Format::Human => identification_text(&json),
    })?;
    for (out, _) in &written {
        terminal::note(&format!("{}: written", out.display()));
    }
    identify_simulated::require_determined(&json.summary)?;
    physical::require_optimum(&identified)
}

/// Refuses weights of efforts against each other where there is one equation.
pub(crate) fn require_several(model: &Interpreted<'_>, kind: EquationKind) -> Result<(), Failure> {
    let why = if kind != EquationKind::Forces {
        "the energy balance is one equation"
    } else if model.info().dof() < 2 {
        "there is one effort, and it has no weight against others"
    } else {
        return Ok(());
    };
    let text = format!("--weighting has no effect here: {why}");
    Err(Failure::Usage(text))
}

/// Whether no option names the loss of the residuals, and Huber's is possible.
fn is_loss_open(args: &IdentifyArgs) -> bool {
    let is_named = args.huber.is_some() || args.estimator.is_some() || args.iv;
    let is_refused = args.cross || args.bandwidth.is_some() || args.physical.reduce;
    !(is_named || is_refused || args.physical.friction)
}

/// Identifies a model from the logs or factor files of the options; of several models the last one
/// is adopted.
pub(crate) fn solve(args: &IdentifyArgs, model: &Interpreted<'_>) -> Result<Outcome, Failure> {
    let session = session(args, model);
    if let Some(EstimatorArg::Didim | EstimatorArg::Response) = args.estimator {
        return identify_simulated::solve(args, &session);
    }
    let (start, mut summary) = if args.physical.friction {
        observe::require_consistent(&args.reading)?;
        let start = with_friction(&session, &args.logs)?;
        observe::note_problems(&start.reports);
        let mut summary = Summary::of(&start);
        summary.corrected_delays = observe::settings(&args.reading).delays;
        (start, summary)
    } else {
        physical::note_friction(model);
        if args.from.is_empty() {
            logs(args, &session)?
        } else {
            factors(args, &session)?
        }
    };
    let (mut identified, more) = models(args, &session, &start, &mut summary)?;
    let logs = args.logs.iter().map(ToString::to_string);
    let factors = args.from.iter().map(|path| path.display().to_string());
    let logs = logs.chain(factors).map(|name| stem(&name));
    let mut logs: Vec<String> = logs.collect();
    // sorted, so that the order of the logs on the command line does not change the file
    logs.sort();
    identified.provenance = Provenance {
        model: digest(model),
        logs,
        date: args.date.clone(),
        filter: None,
    };
    if identified.intervals.bias.is_empty() && !args.iv {
        identified.intervals.bias.clone_from(&start.intervals.bias);
    }
    if args.before.covariance {
        identified.covariance = Some(covariance(&start, more)?);
    }
    physical::note_unbounded(&identified, &model.info());
    let least = if more {
        LeastSquaresRow::all(&start.estimate, &start.intervals.base, &model.info())
    } else {
        Vec::new()
    };
    let shares = EffortContributions::of(&start.factor);
    let file = ParameterFile::new(model, &identified, &shares, least, args.confidence)?;
    let json = Identification { file, summary };
    let start = Some(start);
    Ok(Outcome {
        json,
        identified,
        start,
    })
}

/// The covariance of the least-squares parameters.
///
/// # Errors
/// When another model was adopted, to whose values the covariance does not belong.
fn covariance(start: &LeastSquaresStart, more: bool) -> Result<Covariance, Failure> {
    if more {
        return Err(Failure::Usage(
            "--covariance needs least squares: leave out the options that adopt another model"
                .to_owned(),
        ));
    }
    Ok(Covariance {
        labels: start.estimate.labels.clone(),
        values: start.estimate_for_intervals.covariance.clone(),
    })
}

/// The identification session with the settings of the options.
pub(crate) fn session<'m>(
    args: &IdentifyArgs,
    model: &'m Interpreted<'m>,
) -> Session<'m, Interpreted<'m>> {
    Session {
        options: options(args),
        confidence: args.confidence,
        ..observe::session(model, &args.reading)
    }
}

/// Computes the models that the options ask for after least squares (physical parameters,
/// instrumental variables, reduction). Returns the last one, which is adopted, and whether it is
/// another one than least squares.
fn models(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
    start: &LeastSquaresStart,
    summary: &mut Summary,
) -> Result<(IdentifiedModel, bool), Failure> {
    let least = IdentifiedModel {
        feasibility: "feasibility not judged; --feasible does".to_owned(),
        ..start.model()
    };
    let mut found = Vec::new();
    if args.physical.wanted() {
        let draws = physical::draws(&args.physical, args.confidence)?;
        session.watch.phase("solving for physical parameters");
        let knowledge = physical::knowledge(&args.physical);
        let result = session::physical(session, &knowledge, start, draws);
        session.watch.finished();
        found = result?;
        if start.data.is_none()
            && let Some(first) = found.first_mut()
        {
            first.copy_intervals_if_equal(&least);
        }
        if let Some(last) = found.last() {
            let known = last.intervals.friction.iter().flatten();
            let known = known.flatten().next().is_some();
            let smoothing = session.reading.method.smoothing();
            let warning =
                results::coarse_friction(&last.friction, known, smoothing, &start.reports);
            if let Some(text) = warning {
                terminal::note(&text);
            }
        }
    } else {
        found.push(least);
        if args.iv {
            let (model, json, bandwidth) = identify_iv::run(args, session, start)?;
            found.push(model);
            summary.correlation_length = Some(bandwidth);
            summary.instruments = Some(json);
        }
        if args.physical.reduce {
            let reduction = session::reduction(session, start, &args.physical.against)?;
            summary.reduction = reduction_steps(&reduction, &start.estimate.labels);
            let columns = start.estimate.labels.len();
            let correlated = start.score_blocks.is_some();
            found.push(session::adopt(
                &reduction,
                columns,
                args.confidence,
                correlated,
            )?);
        }
    }
    let more = found.len() > 1;
    if more || !args.physical.against.is_empty() {
        let logs = (args.logs.as_slice(), args.physical.against.as_slice());
        let errors = session::compare(session, Some(start), logs, &found)?;
        for log in errors.first().into_iter().flatten() {
            // the same file is told before anything is read
            let is_named = args.logs.iter().any(|run| run.to_string() == log.log);
            if let Some((known, part)) = log.repeats.as_ref().filter(|_| !is_named) {
                terminal::note(&format!(
                    "warning: {}: {} % of its rows are rows of {known}, which is identified from: its error with \
                     --against validates nothing",
                    log.log,
                    figure_of(3, 100.0 * part)
                ));
            }
        }
        summary.models = found
            .iter()
            .zip(errors)
            .map(|(f, logs)| ModelErrors {
                name: f.name.clone(),
                feasibility: f.feasibility.clone(),
                gap: f.gap,
                base: f.beta.clone(),
                friction: f.friction.iter().map(FrictionRow::new).collect(),
                logs,
            })
            .collect();
    }
    let last = found.pop();
    let last = last.ok_or_else(|| Failure::Input("no model was found".to_owned()))?;
    if more && !args.logs.is_empty() {
        let lags = Options::default().lags;
        let errors = session::residuals_of(session, start, &args.logs, &last, lags)?;
        summary.relative_absolute = Some(errors.relative_absolute());
        for error in errors.efforts() {
            let mut efforts = summary.efforts.iter_mut();
            // those that are not measured are not in the summary
            if let Some(effort) = efforts.find(|own| own.name == error.name) {
                effort.error = Some(error);
            }
        }
    }
    Ok((last, more))
}

pub(crate) fn weighting(args: &IdentifyArgs) -> Weighting {
    match args.weighting {
        WeightingArg::PerEffort => Weighting::PerEffort,
        WeightingArg::Equal => Weighting::Equal,
    }
}

pub(crate) fn options(args: &IdentifyArgs) -> Options {
    Options {
        weighting: weighting(args),
        huber: args.huber,
        hac_bandwidth: args.bandwidth,
        ..Options::default()
    }
}

/// Least squares from factor files.
fn factors(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
) -> Result<(LeastSquaresStart, Summary), Failure> {
    let mut sets = Vec::with_capacity(args.from.len());
    for path in &args.from {
        let set = FactorSet::from_text(&load::text(path)?);
        let set = set.map_err(|e| Failure::Input(format!("{}: {e}", path.display())))?;
        let known = args.from.iter().zip(&sets);
        if let Some((other, _)) = known
            .into_iter()
            .find(|(_, known)| set.is_of_logs_of(known))
        {
            terminal::note(&format!(
                "warning: {}: it has the equations of {} again: as they count twice, deviations are too small; leave \
                 one of them out",
                path.display(),
                other.display()
            ));
        }
        sets.push(set);
    }
    let start = from_factors(session, sets).map_err(|error| match &error {
        SessionError::Digest { place, .. } | SessionError::Origin { place, .. } => {
            let path = args.from.get(*place).map(|p| p.display().to_string());
            Failure::Input(format!("{}: {error}", path.unwrap_or_default()))
        }
        _ => error.into(),
    })?;
    let summary = Summary::of(&start);
    Ok((start, summary))
}

/// The base parameters that act in no equation of the logs, because of what the user says that was not
/// measured or does not move; says how the spec leaves them out too. Empty where nothing is said, or where
/// the logs cannot be read, which is told later.
fn unseen(args: &IdentifyArgs, robot: &Robot) -> Vec<String> {
    let settings = observe::settings(&args.reading);
    let stated = |own: &Assignment| own.from != ValuesFrom::Column;
    let stated = settings.poses || settings.columns.iter().any(stated);
    if args.logs.is_empty() || !stated {
        return Vec::new();
    }
    let terms = BaseTerms::new(robot);
    let model = Interpreted::with_terms(robot, &terms);
    let reading = ReadingArgs {
        // how efforts are shifted changes no column of the regressor
        delay: Vec::new(),
        ..args.reading.clone()
    };
    let opened = observe::open(&model, &args.logs, &reading);
    let found = opened.ok().and_then(|mut logs| {
        let found = identify::unseen(&model, &mut logs).ok()?;
        let base = model.base_info().base;
        let labels = found.into_iter().filter_map(|k| base.get(k));
        let labels: Vec<String> = labels.map(|own| own.label.to_owned()).collect();
        // with nothing left the logs are wrong
        (labels.len() < base.len()).then_some(labels)
    });
    let labels = found.unwrap_or_default();
    if !labels.is_empty() {
        terminal::note(&format!(
            "note: these parameters act in no equation of the logs and are left out: {}",
            labels.join(", ")
        ));
        if args.physical.wanted() {
            terminal::note(
                "warning: physical models take the parameters that are left out as 0, so that bodies that \
                 have only some of theirs are wrong",
            );
        }
    }
    labels
}

/// Least squares from logs; warns of columns that look wrong.
fn logs(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
) -> Result<(LeastSquaresStart, Summary), Failure> {
    let model = session.model;
    let mut logs = observe::open(model, &args.logs, &args.reading)?;
    let start = from_logs(session, &mut logs);
    let start = start.map_err(|error| {
        // loops that do not close may be caused by two swapped columns
        let unusable = matches!(
            error,
            SessionError::Data(DataError::Problems { .. } | DataError::Signal { .. })
        );
        // an effort that is not measured has no error to weight its equation by
        let is_unsolved = matches!(
            error,
            SessionError::Data(DataError::Estimate(
                EstimateError::NoConvergence | EstimateError::NoEfforts
            ))
        );
        let is_undetermined = matches!(
            error,
            SessionError::Data(DataError::Estimate(
                EstimateError::Undetermined { .. } | EstimateError::TooShort { .. }
            ))
        );
        if !(unusable || is_unsolved) {
            observe::note_problems(logs.logs().reports());
        }
        // so may loops that leave too few states, where their rows are left out
        if unusable || is_unsolved || is_undetermined {
            suspect::warn(args, model, logs.logs(), None);
        }
        let failure = Failure::from(error);
        if is_undetermined {
            observe::with_still(failure, logs.logs().reports())
        } else {
            failure
        }
    })?;
    if let Some(bandwidth) = args.bandwidth
        && MIN_BANDWIDTHS * bandwidth > start.deviations.samples
    {
        let text = format!(
            "--bandwidth {bandwidth} is too long for {} samples: it needs {MIN_BANDWIDTHS} times as many",
            start.deviations.samples
        );
        return Err(Failure::Input(text));
    }
    observe::note_problems(&start.reports);
    let short = results::too_short(&start.deviations).filter(|_| args.bandwidth.is_none());
    let few = results::too_few(&start);
    // the choice of a filter weighs what noise of the motion biases
    let noisy = results::noisy_accelerations(&start.reports)
        .filter(|_| session.reading.method_by != Decision::Chosen);
    for text in noisy.iter().chain(&few).chain(&short) {
        terminal::note(text);
    }
    let mut errors = start.measured_errors();
    if session.reading.poses {
        // no weight acts along some axes, whose efforts are noise then
        let acts = |name: &str| {
            let efforts = start.estimate.efforts.iter().zip(&start.contained);
            efforts
                .filter(|(own, _)| own.name == name)
                .all(|(_, n)| *n > 0)
        };
        errors.retain(|error| acts(&error.name));
    }
    if matches!(session.reading.method, Method::Fourier { .. }) {
        // no filter takes noise out of the equations of a series
        errors = errors.iter().map(EffortError::of_means).collect();
    }
    let mut summary = Summary::of(&start);
    summary.corrected_delays = observe::settings(&args.reading).delays;
    summary.suspicions = suspect::warn(
        args,
        model,
        logs.logs(),
        Some(&start.estimate_for_intervals),
    );
    let errors = suspect::without_noise(model, logs.logs(), errors);
    note_unexplained(model, &errors, !summary.suspicions.is_empty());
    if args.cross {
        summary.cross = session::cross(session, &args.logs)?;
    }
    Ok((start, summary))
}

/// Warns of efforts that the model hardly explains.
///
/// - `has_remedy`: whether what may help was tried and is told.
pub(crate) fn note_unexplained(model: &Interpreted<'_>, errors: &[EffortError], has_remedy: bool) {
    let mut joints = model.info().joints.iter();
    let has_friction = joints.any(|joint| joint.friction != Friction::None);
    if let Some(text) = results::unexplained(errors, has_friction, has_remedy) {
        terminal::note(&text);
    }
}
