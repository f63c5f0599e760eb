//! `regen inspect`: describes logs, and predicts what they can identify, before any fit.

use std::path::Path;

use regen_codegen::diag::Source;
use regen_codegen::robot::Robot;
use regen_identify::choice::Choice;
use regen_identify::data::{Assignment, Checks, DataError, Policy, Run, Settings};
use regen_identify::experiment_file::ExperimentFile;
use regen_identify::session::chosen as filter_of;
use regen_identify::signals::Method;
use regen_identify::suspect::Remedy;
use regen_inspect::{
    ClockSource, LogFacts, Prediction, VERSION, completed, delays_by_model, inspect, predict,
    proposal,
};
use regen_interpreted::{BaseTerms, Interpreted};
use regen_report::results::{Inspection, Suspected, inspection_text};
use regen_runtime::Info;
use serde::Serialize;

use crate::args::{Format, InspectArgs, PayloadArg, ReadingArgs};
use crate::exit::Failure;
use crate::suspect::OtherSpecs;
use crate::{choice, experiment, load, loads, mistakes, observe, suspect, table, terminal, write};

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
    let experiment = args.logs.iter().find_map(experiment::yaml_path);
    let source = args.spec.as_deref().map(load::source).transpose()?;
    let validation = experiment::resolve_for(&mut args.logs, &mut args.reading, source.as_ref())?;
    let validation_count = validation.len();
    args.logs.extend(validation);
    let chosen = Chosen::new(&args, args.logs.len() - validation_count);
    let robot = match &source {
        Some(source) => Some(load::loaded_derived(source, chosen.payload)?),
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
    if settings.rate.is_some()
        && let Some((log, column)) = logs.iter().find_map(|log| {
            let mut columns = log.columns.iter();
            let time = columns.find(|column| ["t", "time"].contains(&column.name.as_str()))?;
            Some((&log.log, &time.name))
        })
    {
        return Err(Failure::Input(format!(
            "{log}: the column `{column}` has the time of the rows, and a rate is stated too: leave out \
             the rate, or rename the column if it is no time in s"
        )));
    }
    let mut filter = None;
    let (prediction, doubts, unpredicted) = match (&model, &robot) {
        (Some(model), Some(robot)) => {
            let as_found = logs.clone();
            let mut out = predicted(model, robot, &args, &chosen, (&mut logs, &mut filter))?;
            // what is proposed and predicted of angles in degrees holds if they are read so
            let doubts = out.as_ref().ok().map(|(_, doubts)| doubts);
            let turned = doubts.and_then(|doubts| with_degrees(&as_found, doubts));
            if let (Some((read, note)), None) = (turned, &args.reading.experiment) {
                (logs, filter) = (read, None);
                out = predicted(model, robot, &args, &chosen, (&mut logs, &mut filter))?;
                if let Ok((found, _)) = &mut out {
                    found.notes.push(note);
                }
            }
            match out {
                Ok((found, doubts)) => (Some(found), doubts, None),
                Err(why) => (None, Vec::new(), Some(why)),
            }
        }
        _ => (None, Vec::new(), None),
    };
    let relative = relative_to(&args.logs, args.out.as_deref());
    let stated = match &experiment {
        Some(path) => stated(path, args.out.as_deref(), &logs, filter.as_ref())?,
        None => None,
    };
    let proposed = stated.or_else(|| {
        let text = proposal(&relative, &logs, robot.is_some(), filter.as_ref())?;
        let lost = "# what the inspected experiment file states besides is not copied\n";
        Some(if experiment.is_some() {
            text + lost
        } else {
            text
        })
    });
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
    if let (Some(out), Some(text)) = (&args.out, &proposed) {
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
    })?;
    // what was found is printed first, since it shows why
    if args.out.is_some() && proposed.is_none() {
        return Err(Failure::Input(nothing_to_propose(found.robot)));
    }
    Ok(())
}

/// The experiment file that was inspected, with what it states, and what the logs propose beside it; `None`
/// where it takes no further keys.
fn stated(
    path: &Path,
    out: Option<&Path>,
    logs: &[LogFacts],
    filter: Option<&Choice>,
) -> Result<Option<String>, Failure> {
    let text = load::text(path)?;
    let Some(text) = completed(&text, logs, filter) else {
        return Ok(None);
    };
    let folder = |path: &Path| path.parent().map(Path::to_path_buf).unwrap_or_default();
    let name = path
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let own = folder(path);
    let place = match out.map(folder) {
        Some(other) if other != own => {
            format!(
                "; read it with --logs {}",
                if own.as_os_str().is_empty() {
                    Path::new(".")
                } else {
                    &own
                }
                .display()
            )
        }
        _ => String::new(),
    };
    Ok(Some(format!(
        "# {name} with what its logs propose: check it before it is used{place}.\n{text}"
    )))
}

/// The logs with the unit of the columns that look in degrees, and a sentence that names these; `None` if there
/// are none.
fn with_degrees(logs: &[LogFacts], doubts: &[Suspected]) -> Option<(Vec<LogFacts>, String)> {
    let mut logs = logs.to_vec();
    let mut names: Vec<String> = Vec::new();
    for doubt in doubts {
        let Remedy::Read { columns, .. } = &doubt.found.remedy else {
            continue;
        };
        let turned = columns.iter().filter(|to| {
            let degrees = to.factor.abs().to_degrees();
            (degrees - 1.0).abs() < 1e-9
        });
        for to in turned {
            let columns = logs.iter_mut().flat_map(|log| &mut log.columns);
            for column in columns.filter(|own| own.name == to.column && own.unit.is_none()) {
                column.unit = Some("deg");
                let name = format!("`{}`", to.column);
                if !names.contains(&name) {
                    names.push(name);
                }
            }
        }
    }
    let note = format!(
        "read as degrees, which they look to be in: {}",
        names.join(", ")
    );
    (!names.is_empty()).then_some((logs, note))
}

/// Why no experiment file is proposed.
fn nothing_to_propose(robot: Option<&str>) -> String {
    match robot {
        None => "no positions were found in the logs, so there is nothing to propose: name them \
                 with --column, and give --spec"
            .to_owned(),
        Some(robot) => format!(
            "no positions of {robot} were found in the logs, so there is nothing to propose: name \
             the column of each with --column COORDINATE=COLUMN"
        ),
    }
}

/// The runs from which a prediction is made, which are those without a payload if there are any.
struct Chosen {
    /// Their indices.
    runs: Vec<usize>,
    /// The number of runs that are not for validation, which come first.
    fitted: usize,
    /// Whether the robot carries its payloads in them.
    payload: Option<PayloadArg>,
    /// What is left out, in words.
    note: Option<String>,
    /// Why none can be chosen, in words.
    why: Option<String>,
}

impl Chosen {
    fn new(args: &InspectArgs, fitted: usize) -> Self {
        let carried = args
            .logs
            .iter()
            .map(|run| loads::of_run(&args.reading, run));
        let carried: Vec<Option<usize>> = carried.collect();
        let of = |is_carried: bool| -> Vec<usize> {
            let all = carried.iter().enumerate();
            let some = all.filter(|(_, own)| own.is_some() == is_carried);
            some.map(|(k, _)| k).collect()
        };
        let (bare, loaded) = (of(false), of(true));
        let experiment = args.reading.experiment.as_ref();
        if !experiment.is_some_and(|e| e.carries()) {
            return Self {
                runs: bare,
                fitted,
                payload: args.reading.payload,
                note: None,
                why: None,
            };
        }
        if !bare.is_empty() {
            let count = loaded.len();
            return Self {
                note: (count > 0).then(|| {
                    format!(
                        "predicted for the robot without a payload, from the runs without one: \
                         {count} of {} carry one and are left out",
                        carried.len()
                    )
                }),
                runs: bare,
                fitted,
                payload: Some(PayloadArg::None),
                why: None,
            };
        }
        let bodies = experiment.map_or(0, |e| e.payloads.len());
        Self {
            runs: loaded,
            fitted,
            payload: Some(PayloadArg::Carried),
            note: Some(
                "predicted for the robot with its payload, which all runs carry: the parameters \
                 are those of both together"
                    .to_owned(),
            ),
            why: (bodies > 1).then(|| {
                "all runs carry one of several payloads: a prediction needs a run without one"
                    .to_owned()
            }),
        }
    }
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
/// file and, for what they leave open, those of the proposed experiment file; and whether an effort
/// is a current whose gain nobody stated, which is then read with a gain of 1.
fn reading(
    reading: &ReadingArgs,
    logs: &[LogFacts],
    robot: &Robot,
    info: &Info<'_>,
    runs: &[Run],
) -> Result<(Settings, bool), Failure> {
    let mut settings = observe::settings(reading);
    let is_open = |settings: &Settings| {
        let mut all = settings.columns.iter();
        all.any(|column| column.is_current() && column.gain.is_none())
    };
    let mut has_placeholders = is_open(&settings);
    if reading.experiment.is_some() {
        return Ok((settings.with_gains(&[]), has_placeholders));
    }
    // signs are those of the log, so that the doubts tell which are wrong
    let as_logged = |log: &LogFacts| {
        let mut log = log.clone();
        for effort in &mut log.efforts {
            effort.reversed = false;
        }
        log
    };
    let logs: Vec<LogFacts> = logs.iter().map(as_logged).collect();
    let Some(text) = proposal(runs, &logs, true, None) else {
        return Ok((settings.with_gains(&[]), has_placeholders));
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
    let proposed: Vec<_> = proposed.filter(|a| !given.contains(&a.quantity)).collect();
    // a gain of 1 is proposed for one current
    has_placeholders |= proposed.iter().any(Assignment::is_current);
    settings.columns.extend(proposed);
    settings.rate = settings.rate.or(file.settings.rate);
    settings.resample = settings.resample.or(file.settings.resample);
    if settings.method == Method::Central {
        settings.method = file.settings.method;
    }
    Ok((settings.with_gains(&[]), has_placeholders))
}

/// The prediction of what the logs can identify, and the contradictions between logs and robot; adds
/// delays to the efforts in `logs` if none has one, and gives the filter that was chosen. The inner error is
/// the reason why the logs cannot be read for this robot, in words.
fn predicted(
    model: &Interpreted<'_>,
    robot: &Robot,
    args: &InspectArgs,
    chosen: &Chosen,
    (logs, filter): (&mut [LogFacts], &mut Option<Choice>),
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
    if let Some(why) = &chosen.why {
        return Ok(Err(why.clone()));
    }
    let runs = chosen.runs.iter().filter_map(|k| args.logs.get(*k));
    let mut runs: Vec<Run> = runs.cloned().collect();
    let mut session = observe::session(model, &args.reading);
    let (settings, has_placeholders) =
        reading(&args.reading, logs, robot, &model.info(), &args.logs)?;
    session.reading = settings;
    let proposed = session.reading.method;
    // faulty rows are reported, and do not prevent the inspection
    if args.reading.problems.is_none() && args.reading.experiment.is_none() {
        session.reading.policy = Policy::Drop;
        session.reading.checks = Checks {
            outliers: Some(Policy::Keep),
            saturated: Some(Policy::Keep),
            stuck: Some(Policy::Keep),
            gaps: session.reading.checks.gaps,
        };
    }
    if choice::is_open(&args.reading) {
        let open = Settings {
            method: Method::Central,
            ..session.reading.clone()
        };
        session.reading = open;
        // a log whose motion determines nothing keeps the filter that its spectrum proposes
        let fitted = chosen.runs.iter().filter(|k| **k < chosen.fitted);
        let fitted: Vec<Run> = fitted.filter_map(|k| args.logs.get(*k)).cloned().collect();
        if let Ok(Some(choice)) = filter_of(&session, &fitted, choice::open(&args.reading, true)) {
            session.reading = choice.applied(&session.reading);
            runs = choice.runs(&runs);
            *filter = Some(choice.clone());
            for k in &chosen.runs {
                if let Some(log) = logs.get_mut(*k) {
                    log.cutoff = Some(choice.cutoff);
                }
            }
        } else {
            session.reading.method = proposed;
        }
    }
    let mut opened = match session.open(&runs) {
        Ok(opened) => opened,
        Err(error) => {
            // what the log lacks for an option is no fact of the log
            let own = &args.reading;
            let is_asked =
                own.velocities.is_some() || !(own.deviation.is_empty() && own.delay.is_empty());
            let is_refused = matches!(error, DataError::ColumnLayout { .. });
            let failure = Failure::from(error);
            if is_asked && is_refused {
                return Err(failure);
            }
            return Ok(Err(failure.to_string()));
        }
    };
    let reports = opened.logs().reports();
    let rows = reports.iter().map(|report| report.rows).sum();
    let step = reports.first().map_or(1.0, |report| report.step);
    let mut found = match predict(model, session.kind, &mut opened, rows, step) {
        Ok(found) => found,
        Err(error) => return Ok(Err(error.to_string())),
    };
    found.notes.extend(chosen.note.clone());
    if has_placeholders {
        found.without_nominal(
            "gains of drives are not known, so sigmas are in units of current (or %) and are not compared \
             with nominal values in SI"
                .to_owned(),
        );
    }
    // the equations of one joint share parameters with those of others, and so do not fit currents of
    // unknown gains: delays found without a model are then better
    if !has_placeholders {
        let own = chosen.runs.iter().filter_map(|k| logs.get(*k).cloned());
        let mut own: Vec<LogFacts> = own.collect();
        delays_by_model(&session, &runs, &mut own);
        for (k, own) in chosen.runs.iter().zip(own) {
            if let Some(log) = logs.get_mut(*k) {
                *log = own;
            }
        }
    }
    let specs = match &args.spec {
        Some(path) => OtherSpecs::new(path, chosen.payload),
        None => OtherSpecs::default(),
    };
    let doubts = suspect::doubts(&session, &runs, opened.logs(), None, &specs);
    Ok(Ok((found, doubts)))
}
