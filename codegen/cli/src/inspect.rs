//! `regen inspect`: describes logs, and predicts what they can identify, before any fit.

use std::path::Path;

use regen_codegen::diag::Source;
use regen_codegen::robot::Robot;
use regen_identify::data::{Checks, Policy, Run, Settings};
use regen_identify::experiment_file::ExperimentFile;
use regen_identify::signals::Method;
use regen_inspect::{
    ClockSource, LogFacts, Prediction, VERSION, delays_by_model, inspect, predict, proposal,
};
use regen_interpreted::{BaseTerms, Interpreted};
use regen_report::results::{Inspection, Suspected, inspection_text};
use regen_runtime::Info;
use serde::Serialize;

use crate::args::{Format, InspectArgs, ReadingArgs};
use crate::exit::Failure;
use crate::{experiment, load, mistakes, observe, suspect, table, terminal, write};

/// The JSON of `regen inspect`.
#[derive(Serialize)]
struct InspectJson<'a> {
    version: u32,
    robot: Option<&'a str>,
    logs: &'a [LogFacts],
    prediction: Option<&'a Prediction>,
    /// The contradictions between the logs and the robot.
    doubts: &'a [Suspected],
    /// Why there is no prediction although a robot is given.
    unpredicted: Option<&'a str>,
    /// The text of the proposed experiment file.
    proposal: Option<&'a str>,
}

/// Runs the command.
pub(crate) fn run(args: &InspectArgs) -> Result<(), Failure> {
    let mut args = args.clone();
    take_spec(&mut args)?;
    let source = args.spec.as_deref().map(load::source).transpose()?;
    let validation = experiment::resolve_for(&mut args.logs, &mut args.reading, source.as_ref())?;
    args.logs.extend(validation);
    let robot = match &source {
        Some(source) => Some(load::loaded_derived(source, args.reading.payload)?),
        None => None,
    };
    let settings = observe::settings(&args.reading);
    let terms = robot.as_ref().map(BaseTerms::new);
    let model = robot
        .as_ref()
        .zip(terms.as_ref())
        .map(|(robot, terms)| Interpreted::with_terms(robot, terms));
    let info = model.as_ref().map(Interpreted::info);
    let mut logs = args
        .logs
        .iter()
        .map(|run| inspect(run, &settings, info.as_ref()))
        .collect::<Result<Vec<LogFacts>, _>>()?;
    let (prediction, doubts, unpredicted) = match (&model, &robot) {
        (Some(model), Some(robot)) => match predicted(model, robot, &args, &mut logs)? {
            Ok((found, doubts)) => (Some(found), doubts, None),
            Err(why) => (None, Vec::new(), Some(why)),
        },
        _ => (None, Vec::new(), None),
    };
    let relative = relative_to(&args.logs, args.out.as_deref());
    let proposed = proposal(&relative, &logs, robot.is_some());
    let doubt_texts: Vec<String> = doubts.iter().map(ToString::to_string).collect();
    let found = Inspection {
        robot: robot.as_ref().map(|robot| robot.name.as_str()),
        logs: &logs,
        prediction: prediction.as_ref(),
        doubts: &doubt_texts,
        unpredicted: unpredicted.as_deref(),
    };
    if let Some(out) = &args.report {
        let page = regen_report::inspected(found.robot, &logs, found.prediction)?;
        write::atomically(out, &page)?;
        terminal::note(&format!("{}: written", out.display()));
    }
    if let Some(out) = &args.out {
        let text = proposed.as_deref().ok_or_else(|| {
            Failure::Input(
                "no positions were found in the logs, so there is nothing to propose: name them \
                 with --column, and give --spec"
                    .to_owned(),
            )
        })?;
        write::create(out, text, "give another name to --out, or remove it")?;
        terminal::note(&format!("{}: written", out.display()));
    }
    terminal::print(&match args.format {
        Format::Json => table::json(&InspectJson {
            version: VERSION,
            robot: found.robot,
            logs: &logs,
            prediction: found.prediction,
            doubts: &doubts,
            unpredicted: found.unpredicted,
            proposal: proposed.as_deref(),
        }),
        Format::Human => inspection_text(&found),
    })
}

/// Moves a robot's description that precedes the logs, as in other commands, to `--spec`.
fn take_spec(args: &mut InspectArgs) -> Result<(), Failure> {
    let [first, _, ..] = &args.logs[..] else {
        return Ok(());
    };
    if let (None, Some(path)) = (&args.spec, experiment::yaml_path(first))
        && load::has_key(&load::text(&path)?, "limbs")
    {
        args.spec = Some(path);
        args.logs.remove(0);
    }
    Ok(())
}

/// The runs with paths relative to the folder of the experiment file `out`; files outside it have
/// absolute paths.
fn relative_to(runs: &[Run], out: Option<&Path>) -> Vec<Run> {
    let folder = out
        .and_then(Path::parent)
        .filter(|f| !f.as_os_str().is_empty());
    let place = |file: &std::path::PathBuf| match folder {
        None => file.clone(),
        Some(folder) => match file.strip_prefix(folder) {
            Ok(rest) => rest.to_path_buf(),
            Err(_) => std::path::absolute(file).unwrap_or_else(|_| file.clone()),
        },
    };
    runs.iter()
        .map(|run| Run {
            files: run.files.iter().map(place).collect(),
            ..run.clone()
        })
        .collect()
}

/// The settings for reading the logs for the prediction: those of the options and the experiment
/// file and, for what they leave open, those of the proposed experiment file.
fn reading(
    reading: &ReadingArgs,
    logs: &[LogFacts],
    robot: &Robot,
    info: &Info<'_>,
    runs: &[Run],
) -> Result<Settings, Failure> {
    let mut settings = observe::settings(reading);
    if reading.experiment.is_some() {
        return Ok(settings);
    }
    let Some(text) = proposal(runs, logs, true) else {
        return Ok(settings);
    };
    let file = ExperimentFile::read(&text, info).map_err(|wrong| {
        let source = Source {
            name: format!("the proposed experiment file for {}", robot.name),
            text: text.clone(),
        };
        mistakes::failure(source, wrong, "")
    })?;
    let given = settings.columns.iter().map(|a| a.quantity.clone());
    let given: Vec<_> = given.collect();
    let proposed = file.settings.columns.into_iter();
    settings
        .columns
        .extend(proposed.filter(|a| !given.contains(&a.quantity)));
    settings.rate = settings.rate.or(file.settings.rate);
    settings.resample = settings.resample.or(file.settings.resample);
    if settings.method == Method::Central {
        settings.method = file.settings.method;
    }
    Ok(settings)
}

/// The prediction of what the logs can identify, and the contradictions between logs and robot; adds
/// delays to the efforts in `logs` if none has one. The inner error is the reason why the logs cannot
/// be read for this robot, in words.
fn predicted(
    model: &Interpreted<'_>,
    robot: &Robot,
    args: &InspectArgs,
    logs: &mut [LogFacts],
) -> Result<Result<(Prediction, Vec<Suspected>), String>, Failure> {
    if model.base_info().base.is_empty() {
        return Ok(Err(format!("{} has no base parameters", robot.name)));
    }
    if logs
        .iter()
        .all(|log| log.clock.source == ClockSource::Unknown)
    {
        return Ok(Err(
            "the time of the rows is unknown: state their rate with --rate HZ".to_owned(),
        ));
    }
    let mut session = observe::session(model, &args.reading);
    session.reading = reading(&args.reading, logs, robot, &model.info(), &args.logs)?;
    // faulty rows are reported, and do not prevent the inspection
    if args.reading.problems.is_none() && args.reading.experiment.is_none() {
        session.reading.policy = Policy::Drop;
        session.reading.checks = Checks {
            outliers: Some(Policy::Keep),
            saturated: Some(Policy::Keep),
            stuck: Some(Policy::Keep),
        };
    }
    let mut opened = match session.open(&args.logs) {
        Ok(opened) => opened,
        Err(error) => return Ok(Err(Failure::from(error).to_string())),
    };
    let reports = opened.logs().reports();
    let rows = reports.iter().map(|report| report.rows).sum();
    let step = reports.first().map_or(1.0, |report| report.step);
    let found = match predict(model, session.kind, &mut opened, rows, step) {
        Ok(found) => found,
        Err(error) => return Ok(Err(error.to_string())),
    };
    delays_by_model(&session, &args.logs, logs);
    let doubts = suspect::doubts(model, opened.logs(), &session.reading.columns, None);
    Ok(Ok((found, doubts)))
}
