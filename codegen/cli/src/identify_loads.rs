//! `regen identify` with unknown drive gains, and with payloads in some of the runs.

use regen_codegen::diag::Source;
use regen_codegen::robot::Robot;
use regen_identify::choice::Choice;
use regen_identify::data::{Assignment, Quantity, Run};
use regen_identify::estimate::Estimate;
use regen_identify::files::{FileError, ParameterFile};
use regen_identify::gains::{GainError, GainFit, KnownPayload, KnownRobot, Plan};
use regen_identify::identify::digest;
use regen_identify::model::{IdentifiedModel, Provenance};
use regen_identify::session::{
    LoadedFits, LogError, Session, from_logs, loaded_residuals, settled_delays, with_gains,
};
use regen_identify::suspect::{Remedy, Suspicion};
use regen_identify::text::figure_of;
use regen_interpreted::{BaseTerms, Interpreted};
use regen_report::results::{self, Identification, LogFile, ModelErrors, Summary, Suspected, stem};

use crate::args::{DelayArg, EstimatorArg, IdentifyArgs, PayloadArg, ReadingArgs};
use crate::exit::Failure;
use crate::identify::{Outcome, note_unexplained};
use crate::suspect::{self, OtherSpecs};
use crate::{
    choice, identify, identify_iv, identify_simulated, load, loads, observe, parameters, physical,
    terminal,
};

/// The number of alternations between estimating gains at given delays and delays at given gains,
/// since errors of either bias the other.
const DELAY_ROUNDS: usize = 3;
/// The largest number of alternations between estimating gains and choosing with them how logs are read; more than
/// one are needed only where efforts are late.
const CHOICE_ROUNDS: usize = 5;
/// Delays that change by a smaller part of themselves are settled.
const SETTLED_PART: f64 = 0.02;

/// Whether gains or payloads are to be identified.
pub(crate) fn wanted(args: &IdentifyArgs) -> bool {
    let experiment = args.reading.experiment.as_ref();
    experiment.is_some_and(|e| !e.unknown_gains.is_empty() || e.carries())
        || args.reading.payload == Some(PayloadArg::Unknown)
        || args.before.parameters.is_some()
}

/// Refuses options that this fit does not support.
pub(crate) fn require_options(args: &IdentifyArgs) -> Result<(), Failure> {
    let physical = &args.physical;
    let responds = args.estimator == Some(EstimatorArg::Response);
    let wrong = [
        (!args.from.is_empty(), "--from"),
        (responds, "--estimator response"),
        (args.cross, "--cross"),
        (args.bandwidth.is_some(), "--bandwidth"),
        (args.reading.energy.is_some(), "--energy"),
        (physical.friction, "--friction"),
        (physical.reduce, "--reduce"),
        (!physical.against.is_empty(), "--against"),
    ];
    if let Some((_, option)) = wrong.iter().find(|wrong| wrong.0) {
        return Err(Failure::Usage(format!(
            "{option} does not work with unknown gains or payloads, which are identified from all \
             runs: leave it out"
        )));
    }
    if physical.feasible && args.before.covariance {
        return Err(Failure::Usage(
            "--covariance needs least squares: leave out --feasible".to_owned(),
        ));
    }
    if physical.bodies.is_some() && args.before.parameters.is_some() {
        return Err(Failure::Usage(
            "--bodies needs a robot to be identified, but --parameters states it".to_owned(),
        ));
    }
    Ok(())
}

/// Derives the robot; with separate payloads if a run carries one.
pub(crate) fn robot(args: &IdentifyArgs, source: &Source) -> Result<Robot, Failure> {
    let experiment = args.reading.experiment.as_ref();
    let is_unknown = args.reading.payload == Some(PayloadArg::Unknown);
    if is_unknown || experiment.is_some_and(|e| e.carries()) {
        return load::with_base(source);
    }
    load::loaded_with_base(source, args.reading.payload)
}

/// The runs, each with the index of the payload that it carries, and the robot's payloads with their
/// known parameters.
type Loaded = (Vec<(Run, Option<usize>)>, Vec<KnownPayload>);

fn loaded(args: &IdentifyArgs, bodies: &[String], source: &Source) -> Result<Loaded, Failure> {
    let reading = &args.reading;
    if reading.payload == Some(PayloadArg::Unknown) {
        let [body] = bodies else {
            let name = &source.name;
            let text = if bodies.is_empty() {
                format!(
                    "{name} has no payload: mark a body on a fixed joint `payload: true` for \
                     --payload unknown"
                )
            } else {
                format!(
                    "{name} has the payloads {}: state in an experiment file which of them each run \
                     carries, `payload: {{body: NAME}}`",
                    bodies.join(", ")
                )
            };
            return Err(Failure::Input(text));
        };
        if args.before.parameters.is_none() {
            return Err(Failure::Usage(
                "--payload unknown needs the parameters of the robot without it, --parameters \
                 PARAMS; or an experiment file with both runs that carry it and runs that carry \
                 nothing"
                    .to_owned(),
            ));
        }
        let runs = args.logs.iter().map(|run| (run.clone(), Some(0)));
        let known = KnownPayload {
            body: body.clone(),
            ..KnownPayload::default()
        };
        return Ok((runs.collect(), vec![known]));
    }
    let carried = |run: &Run| (run.clone(), loads::of_run(reading, run));
    let payloads = match &reading.experiment {
        Some(experiment) if !bodies.is_empty() => experiment.payloads.clone(),
        _ => Vec::new(),
    };
    Ok((args.logs.iter().map(carried).collect(), payloads))
}

/// The robot that was identified before.
fn known_robot(
    args: &IdentifyArgs,
    model: &Interpreted<'_>,
    source: &Source,
) -> Result<Option<KnownRobot>, Failure> {
    let Some(path) = &args.before.parameters else {
        return Ok(None);
    };
    let value = parameters::value(path)?;
    match IdentifiedModel::read(&value, model) {
        Ok(found) => Ok(Some(KnownRobot::new(model, model, &found)?)),
        Err(FileError::Digest { .. }) if load::mechanism(source)?.payloads().next().is_some() => {
            // the parameters may have been identified without the payload
            let bare = load::loaded_with_base(source, Some(PayloadArg::None))?;
            let terms = BaseTerms::new(&bare);
            let bare = Interpreted::with_terms(&bare, &terms);
            let found = parameters::read(path, &bare)?;
            Ok(Some(KnownRobot::new(model, &bare, &found)?))
        }
        Err(_) => Err(parameters::read(path, model)
            .err()
            .unwrap_or_else(|| Failure::Input(format!("{}: it cannot be read", path.display())))),
    }
}

/// Identifies gains and payloads; returns the choice that is made of how logs are read once gains are known, too.
///
/// - `given`: the options before a choice was made, whose filter `args` pin.
pub(crate) fn solve(
    args: &IdentifyArgs,
    (robot, model): (&Robot, &Interpreted<'_>),
    source: &Source,
    given: &IdentifyArgs,
) -> Result<(Outcome, Option<Choice>), Failure> {
    let mut args = args.clone();
    let finds_delays = args.reading.delay.contains(&DelayArg::Auto);
    let mut stated = args.reading.clone();
    stated.delay.retain(|delay| *delay != DelayArg::Auto);
    observe::require_consistent(&stated)?;
    physical::note_friction(model);
    let bodies = loads::bodies(robot);
    let (runs, payloads) = loaded(&args, &bodies, source)?;
    let experiment = args.reading.experiment.iter();
    let plan = Plan {
        unknown_gains: experiment.flat_map(|e| e.unknown_gains.clone()).collect(),
        payloads,
        robot: known_robot(&args, model, source)?,
    };
    let knowledge = physical::knowledge(&args.physical);
    let draws = physical::draws(&args.physical, args.confidence)?;
    let knowledge = (args.physical.feasible).then_some((&knowledge, draws));
    let simulates = args.estimator == Some(EstimatorArg::Didim);
    let chooses = !simulates && choice::is_open(&given.reading) && !plan.unknown_gains.is_empty();
    let first = knowledge.filter(|_| !finds_delays && !chooses);
    let (mut instruments, mut simulated) = (None, None);
    let session = &identify::session(&args, model);
    let mut fits = if simulates {
        let (free, rounds, reports) = identify_simulated::with_gains(&args, session, &plan, &runs)?;
        simulated = Some(rounds);
        LoadedFits {
            free,
            physical: None,
            reports,
        }
    } else {
        with_gains(session, &plan, &runs, first)?
    };
    let mut made: Option<Choice> = None;
    let rounds = if chooses { CHOICE_ROUNDS } else { 0 };
    for round in 1..=rounds {
        let mut other = given.clone();
        let Some(choice) = choice::made_without_loads(&mut other, source, Some(&fits.free.model))?
        else {
            break;
        };
        // delays are as wrong as the gains that they are found with
        let is_last = round == rounds || !is_moved(&args.reading, &choice.delays);
        args = other;
        made = Some(choice);
        let session = identify::session(&args, model);
        fits = with_gains(
            &session,
            &plan,
            &runs,
            knowledge.filter(|_| is_last && !finds_delays),
        )?;
        if is_last {
            break;
        }
    }
    let args = &args;
    let session = &identify::session(args, model);
    let mut settled = Session {
        reading: session.reading.clone(),
        ..*session
    };
    let mut corrected_delays = session.reading.delays.clone();
    let rounds = if finds_delays { DELAY_ROUNDS } else { 0 };
    for round in 1..=rounds {
        corrected_delays = delays(args, session, source, (&runs, &fits.free))?;
        settled.reading.delays.clone_from(&corrected_delays);
        let own = if round == rounds { knowledge } else { None };
        fits = with_gains(&settled, &plan, &runs, own)?;
    }
    let session = &settled;
    if args.iv {
        let (free, own, reports) = identify_iv::with_gains(args, session, &plan, &runs)?;
        (fits.free, fits.reports, instruments) = (free, reports, Some(own));
    }
    let (found, reports) = (&fits.free, &fits.reports);
    observe::note_problems(reports);
    if let Some(text) = results::too_short(&found.deviations) {
        terminal::note(&text);
    }
    let suspicions = doubts(args, session, source, (&runs, found));
    for suspicion in &suspicions {
        terminal::note(&format!("warning: {suspicion}"));
    }
    note_unexplained(session.model, &found.errors, !suspicions.is_empty());
    if let (true, Some(path)) = (found.is_robot_exact, &args.before.parameters) {
        terminal::note(&format!(
            "note: {} has no covariance, so its parameters count as exact, and deviations are too \
             small; `regen identify --covariance --out` writes it",
            path.display()
        ));
    }
    let mut identified = match &fits.physical {
        Some(physical) => physical.model.clone(),
        None => found.model.clone(),
    };
    physical::note_unbounded(&identified, &model.info());
    identified.provenance = Provenance {
        model: digest(model),
        logs: {
            let names = args.logs.iter().map(|run| stem(&run.to_string()));
            let mut names: Vec<String> = names.collect();
            names.sort();
            names
        },
        date: args.date.clone(),
        filter: None,
    };
    if !args.before.covariance {
        identified.covariance = None;
    } else if identified.covariance.is_none() {
        return Err(Failure::Usage(
            "--covariance needs a robot to be identified, but --parameters states it".to_owned(),
        ));
    }
    let mut summary = Summary {
        instruments,
        simulated,
        suspicions,
        ..Summary::of_gains(found, session.kind.name())
    };
    if let Some(physical) = &fits.physical {
        summary.relative_absolute = Some(physical.relative_absolute);
        for (effort, error) in summary.efforts.iter_mut().zip(&physical.errors) {
            effort.error = Some(error.clone());
        }
    }
    summary.files = reports.iter().map(LogFile::new).collect();
    summary.corrected_delays = corrected_delays;
    let mut compared = vec![&found.model];
    compared.extend(fits.physical.as_ref().map(|physical| &physical.model));
    let against = &args.physical.against;
    if compared.len() > 1 || !against.is_empty() {
        for model in compared {
            let logs = errors(args, session, model, &bodies)?;
            summary.models.push(ModelErrors {
                name: model.name.clone(),
                feasibility: model.feasibility.clone(),
                gap: model.gap,
                base: model.beta.clone(),
                friction: Vec::new(),
                logs,
            });
        }
    }
    let shares = &found.shares;
    let file = ParameterFile::new(model, &identified, shares, Vec::new(), args.confidence)?;
    let json = Identification { file, summary };
    let outcome = Outcome {
        json,
        identified,
        start: None,
    };
    Ok((outcome, made))
}

/// Whether delays differ from those of the options by so much that gains are estimated again.
fn is_moved(reading: &ReadingArgs, delays: &[(String, f64)]) -> bool {
    let before = observe::settings(reading).delays;
    let of = |all: &[(String, f64)], name: &str| {
        let own = all.iter().find(|(other, _)| other == name);
        own.map_or(0.0, |(_, seconds)| *seconds)
    };
    let mut names = before.iter().chain(delays).map(|(name, _)| name.as_str());
    names.any(|name| {
        let (old, new) = (of(&before, name), of(delays, name));
        (new - old).abs() > SETTLED_PART * old.abs().max(new.abs())
    })
}

/// The error of a model on each run that `--against` names.
fn errors(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
    found: &IdentifiedModel,
    bodies: &[String],
) -> Result<Vec<LogError>, Failure> {
    let mut logs = Vec::new();
    for run in &args.physical.against {
        let carried = loads::of_run(&args.reading, run).and_then(|k| bodies.get(k));
        let carried = carried.map(String::as_str);
        let (errors, _, _) = loaded_residuals(session, run, found, bodies, carried)?;
        logs.push(LogError {
            log: run.to_string(),
            relative_absolute: errors.relative_absolute(),
            repeats: None,
        });
    }
    Ok(logs)
}

/// Estimates the delays of the efforts from the runs without a payload, whose currents are converted
/// to efforts by the gains of a previous fit.
fn delays(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
    source: &Source,
    (runs, found): (&[(Run, Option<usize>)], &GainFit),
) -> Result<Vec<(String, f64)>, Failure> {
    let bare = without_payload(runs);
    if bare.is_empty() {
        return Err(Failure::Usage(
            "delays are estimated from runs without a payload, but all runs carry one: state the \
             delays in seconds"
                .to_owned(),
        ));
    }
    let robot = bare_robot(source)?;
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    Ok(settled_delays(
        &in_newtons(args, session, &model, found),
        &bare,
    )?)
}

/// The runs that carry no payload.
fn without_payload(runs: &[(Run, Option<usize>)]) -> Vec<Run> {
    let bare = runs.iter().filter(|(_, carried)| carried.is_none());
    bare.map(|(run, _)| run.clone()).collect()
}

/// The robot without its payloads.
fn bare_robot(source: &Source) -> Result<Robot, Failure> {
    let has_payloads = load::mechanism(source)?.payloads().next().is_some();
    load::loaded_with_base(source, has_payloads.then_some(PayloadArg::None))
}

/// The session that reads currents as efforts, by the gains that were found.
fn in_newtons<'m>(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
    model: &'m Interpreted<'m>,
    found: &GainFit,
) -> Session<'m, Interpreted<'m>> {
    let gains = found.model.gains.iter();
    let gains: Vec<(String, f64)> = gains.map(|g| (g.effort.clone(), g.value)).collect();
    Session {
        reading: session.reading.clone().with_gains(&gains),
        options: session.options,
        confidence: args.confidence,
        ..observe::session(model, &args.reading)
    }
}

/// What to do about gains that contradict the logs or the nominal bodies.
const GAINS_REMEDY: &str = "The gains follow from the payloads that the runs state and from the gains that are \
                            given: compare the masses (kg) and centres of mass (m, in the body's frame) of the \
                            payloads, and which runs carry them";

/// How many times the nominal values parameters may be: nominal bodies are rough.
const MAX_SCALE: f64 = 5.0;
/// A parameter that is this many standard deviations from zero is compared with its nominal value.
const COMPARED_DEVIATIONS: f64 = 5.0;
/// The least number of parameters that are compared.
const MIN_COMPARED: usize = 3;

/// By how many times parameters differ from their nominal values, in the middle of them all, where it is more than
/// nominal bodies differ from real ones, or negative.
fn scale(model: &Interpreted<'_>, estimate: &Estimate) -> Option<f64> {
    let info = model.info();
    let nominal = |label: &str| info.parameter_of(label).and_then(|k| *info.nominal.get(k)?);
    let base = model.base_info().base.iter();
    let rows = base.zip(estimate.values.iter().enumerate());
    let mut ratios: Vec<f64> = rows
        .filter_map(|(row, (k, value))| {
            let own = row.terms.iter();
            let own: Option<f64> = own
                .map(|term| Some(term.value * nominal(term.parameter)?))
                .sum();
            let is_known = value.abs() > COMPARED_DEVIATIONS * estimate.sigma(k);
            own.filter(|own| is_known && *own != 0.0)
                .map(|own| value / own)
        })
        .filter(|ratio| ratio.is_finite())
        .collect();
    ratios.sort_by(f64::total_cmp);
    let middle = *ratios.get(ratios.len() / 2)?;
    let is_far = !(1.0 / MAX_SCALE..=MAX_SCALE).contains(&middle);
    (ratios.len() >= MIN_COMPARED && is_far).then_some(middle)
}

/// The mistakes that the runs without a payload show with the gains that were found: those that are looked for
/// with known gains.
fn doubts(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
    source: &Source,
    (runs, found): (&[(Run, Option<usize>)], &GainFit),
) -> Vec<Suspected> {
    let bare = without_payload(runs);
    if args.no_suspicion || bare.is_empty() || found.model.gains.is_empty() {
        return Vec::new();
    }
    let Ok(robot) = bare_robot(source) else {
        return Vec::new();
    };
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let session = in_newtons(args, session, &model, found);
    let Ok(mut logs) = session.open(&bare) else {
        return Vec::new();
    };
    let start = from_logs(&session, &mut logs).ok();
    let scale = start
        .as_ref()
        .and_then(|own| scale(&model, &own.estimate_for_intervals));
    if let (Some(scale), Some(log)) = (scale, logs.logs().reports().first()) {
        let what = format!(
            "with these gains the parameters are about {} times those of the nominal bodies",
            figure_of(2, scale)
        );
        return vec![Suspected {
            found: Suspicion {
                file: log.file.clone(),
                what,
                error: None,
                changed: None,
                left_in_sample: None,
                efforts: Vec::new(),
                remedy: Remedy::Physical,
            },
            remedy: GAINS_REMEDY.to_owned(),
        }];
    }
    let has_payloads = load::mechanism(source).is_ok_and(|own| own.payloads().next().is_some());
    let spec = OtherSpecs::new(&args.file, has_payloads.then_some(PayloadArg::None));
    let estimate = start.as_ref().map(|own| &own.estimate_for_intervals);
    let mut out = suspect::doubts(&session, &bare, logs.logs(), estimate, &spec);
    let is_of_gain = |column: &Assignment| {
        let gains = found.model.gains.iter();
        matches!(&column.quantity, Quantity::Effort(name) if gains.clone().any(|own| own.effort == *name))
    };
    for doubt in &mut out {
        let concerns_gains = match &doubt.found.remedy {
            Remedy::Read { columns, .. } => columns.iter().any(is_of_gain),
            Remedy::Physical => true,
            _ => false,
        };
        if concerns_gains {
            GAINS_REMEDY.clone_into(&mut doubt.remedy);
        }
    }
    out
}

impl From<GainError> for Failure {
    fn from(error: GainError) -> Self {
        match error {
            GainError::Data(error) => error.into(),
            GainError::Undetermined { .. } | GainError::NotConverged => {
                Self::Numeric(error.to_string())
            }
            other => Self::Input(other.to_string()),
        }
    }
}
