//! `regen identify --estimator`: the choice, and the estimators that simulate the controlled robot.

use std::fmt::Write as _;

use regen_experiment::closed_loop::{ClosedLoop, Controllers};
use regen_experiment::simulate::{Pid, Reference};
use regen_identify::data::{FileReport, Run as LogRun, Track, tracks};
use regen_identify::estimate::Spectrum;
use regen_identify::files::ParameterFile;
use regen_identify::identify::{EquationKind, Filtering, digest};
use regen_identify::model::{IdentifiedModel, Interval, Provenance};
use regen_identify::session::Session;
use regen_identify::status::EffortContributions;
use regen_interpreted::Interpreted;
use regen_response::{
    Commanded, DidimError, DidimOptions, EffortRun, Responded, ResponseError, Run, Setup,
    TrackError, controllers, didim, efforts, respond,
};
use regen_runtime::BaseModel;
use serde::Serialize;

use crate::args::{DelayArg, EstimatorArg, IdentifyArgs, ReadingArgs};
use crate::exit::Failure;
use crate::identify::Outcome;
use crate::identify_json::{EffortJson, IdentifyJson, Summary};
use crate::{observe, parameters, path, predicted, table, terminal};

/// Huber's bound where none is given.
pub(crate) const HUBER_BOUND: f64 = 1.345;
/// Seconds at the start of each log that DIDIM leaves out where none are given.
pub(crate) const SETTLE: f64 = 0.5;

/// What the simulating estimators add to the result.
#[derive(Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum SimulatedJson {
    Didim(DidimJson),
    Response(ResponseJson),
}

/// The rounds of `didim`.
#[derive(Serialize)]
pub(crate) struct DidimJson {
    rounds: usize,
    /// eps_RA of each round, percent.
    relative_absolute: Vec<f64>,
}

/// The search of `response`.
#[derive(Serialize)]
pub(crate) struct ResponseJson {
    windows: usize,
    steps: usize,
    /// Candidates that could not be simulated.
    refused: usize,
    /// Gains and values of signals that were estimated.
    estimated: Vec<EstimatedJson>,
    undetermined: Vec<DirectionJson>,
}

#[derive(Serialize)]
struct EstimatedJson {
    label: String,
    value: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    sigma: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    interval: Option<[f64; 2]>,
}

/// A direction along which nothing changes the responses.
#[derive(Serialize)]
struct DirectionJson {
    words: String,
    terms: Vec<(String, f64)>,
}

/// The options with the estimator that they choose; refuses options that it does not take.
pub(crate) fn with_estimator(args: &IdentifyArgs) -> Result<IdentifyArgs, Failure> {
    let mut args = args.clone();
    let given = args.estimator;
    let simulated = matches!(given, Some(EstimatorArg::Didim | EstimatorArg::Response));
    let own = |wanted: EstimatorArg| given.is_none_or(|e| e == wanted);
    let mut wrong: Vec<&str> = Vec::new();
    let mut refuse = |is: bool, option: &'static str| {
        if is {
            wrong.push(option);
        }
    };
    refuse(args.huber.is_some() && !own(EstimatorArg::Huber), "--huber");
    refuse(args.iv && !own(EstimatorArg::Iv), "--iv");
    if given == Some(EstimatorArg::Iv) || simulated {
        let physical = &args.physical;
        refuse(!args.from.is_empty(), "--from");
        refuse(args.cross, "--cross");
        refuse(args.reading.energy.is_some(), "--energy");
        refuse(physical.wanted(), "--feasible or --friction");
        refuse(physical.reduce, "--reduce");
    }
    if simulated {
        refuse(!args.physical.against.is_empty(), "--against");
        refuse(!args.reading.delay.is_empty(), "--delay");
        refuse(args.reading.period.is_some(), "--period");
    }
    let along = args.iv || matches!(given, Some(EstimatorArg::Iv | EstimatorArg::Didim));
    refuse(args.reference.is_some() && !along, "--reference");
    refuse(!args.pid.is_empty() && !along, "--pid");
    let own = &args.simulated;
    refuse(own.controller.is_some() && !simulated, "--controller");
    refuse(!own.command.is_empty() && !simulated, "--command");
    refuse(own.start.is_some() && !simulated, "--start");
    if let Some(option) = wrong.first() {
        let name = given.map_or("least squares", name);
        return Err(Failure::Usage(format!(
            "{option} is of no use to {name}: leave it out, or choose another --estimator"
        )));
    }
    match given {
        Some(EstimatorArg::Huber) => args.huber = args.huber.or(Some(HUBER_BOUND)),
        Some(EstimatorArg::Iv) => args.iv = true,
        _ => {}
    }
    Ok(args)
}

fn name(estimator: EstimatorArg) -> &'static str {
    match estimator {
        EstimatorArg::Ls => "least squares",
        EstimatorArg::Huber => "Huber's estimate",
        EstimatorArg::Iv => "instrumental variables",
        EstimatorArg::Didim => "DIDIM",
        EstimatorArg::Response => "the fit to responses",
    }
}

/// Tells what of an experiment file an estimator that simulates has no use for, and leaves it out.
///
/// - `planned`: the runs to validate on, which may lack efforts or positions.
pub(crate) fn note_unused(estimator: EstimatorArg, reading: &mut ReadingArgs, planned: &[LogRun]) {
    let Some(experiment) = &reading.experiment else {
        return;
    };
    let settings = &experiment.settings;
    let is_auto = reading.delay.contains(&DelayArg::Auto);
    let unused = [
        (is_auto || !settings.delays.is_empty(), "delay"),
        (settings.period.is_some(), "period"),
        (experiment.kind != EquationKind::Forces, "energy"),
        (!planned.is_empty(), "runs to validate on"),
    ];
    let unused: Vec<&str> = unused.iter().filter(|u| u.0).map(|u| u.1).collect();
    reading.delay.clear();
    if !unused.is_empty() {
        terminal::note(&format!(
            "{} leaves out of the experiment file: {}",
            name(estimator),
            unused.join(", ")
        ));
    }
}

/// Identifies by an estimator that simulates the controlled robot.
pub(crate) fn solve(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
) -> Result<Outcome, Failure> {
    let (all, reports) = read(args, session)?;
    observe::note_problems(&reports);
    let start = start(args, session.model)?;
    let (mut identified, summary, shares) = if args.estimator == Some(EstimatorArg::Didim) {
        of_efforts(args, session, &all, &start)?
    } else {
        of_responses(args, session, &all, &start)?
    };
    let mut logs: Vec<String> = args
        .logs
        .iter()
        .map(|run| predicted::stem(&run.to_string()))
        .collect();
    logs.sort();
    identified.provenance = Provenance {
        model: digest(session.model),
        logs,
        date: args.date.clone(),
    };
    let summary = Summary {
        files: reports.iter().map(observe::FileJson::new).collect(),
        ..summary
    };
    let file = ParameterFile::new(
        session.model,
        &identified,
        &shares,
        Vec::new(),
        args.confidence,
    )?;
    let json = IdentifyJson { file, summary };
    Ok(Outcome { json, identified })
}

/// The tracks of all logs.
fn read(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
) -> Result<(Vec<Track>, Vec<FileReport>), Failure> {
    let info = session.model.info();
    let (mut all, mut reports) = (Vec::new(), Vec::new());
    let reading = &session.reading;
    for run in &args.logs {
        let (own, report) = tracks(run, &info, reading, &args.simulated.command)?;
        let usable = own.into_iter().filter(|track| track.times.len() > 1);
        all.extend(usable);
        reports.push(report);
    }
    Ok((all, reports))
}

/// The base parameters to start from.
fn start(args: &IdentifyArgs, model: &Interpreted<'_>) -> Result<Vec<f64>, Failure> {
    if let Some(path) = &args.simulated.start {
        return Ok(parameters::read(path, model)?.beta);
    }
    let info = model.info();
    let Some(phi) = info.nominal_parameters() else {
        return Err(Failure::Input(format!(
            "{} has no nominal values to start from: give `bodies:` and `nominal:` in the spec, or \
             identified parameters with --start",
            args.file.display()
        )));
    };
    let mut beta = vec![0.0; model.rank()];
    BaseModel::<f64>::to_base(model, &phi, &mut beta)?;
    Ok(beta)
}

/// The controllers of the options' file.
fn setup(args: &IdentifyArgs, model: &Interpreted<'_>) -> Result<Option<Setup>, Failure> {
    let Some(path) = &args.simulated.controller else {
        return Ok(None);
    };
    let found = controllers(&parameters::value(path)?, &model.info());
    match found {
        Ok(found) => Ok(Some(found)),
        Err(why) => Err(Failure::Input(format!("{}: {why}", path.display()))),
    }
}

/// DIDIM from the efforts of the tracks.
fn of_efforts(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
    all: &[Track],
    start: &[f64],
) -> Result<(IdentifiedModel, Summary, EffortContributions), Failure> {
    let model = session.model;
    let info = model.info();
    let bandwidth = args.simulated.loop_bandwidth;
    if !(bandwidth > 0.0 && bandwidth.is_finite()) {
        let text = "--loop-bandwidth must be above 0";
        return Err(Failure::Input(text.to_owned()));
    }
    let known = setup(args, model)?;
    let laws = known.as_ref().map(|known| known.laws.as_slice());
    if laws.is_some() && !args.pid.is_empty() {
        let text = "--pid and --controller say the same: give one of them";
        return Err(Failure::Usage(text.to_owned()));
    }
    let laws = laws.unwrap_or_default();
    if laws
        .iter()
        .any(|law| law.gains().iter().any(|g| g.is_estimated()))
    {
        let text = "didim takes gains as they are: leave `estimate` out, or give no --controller, \
                    then the loop keeps the bandwidth of --loop-bandwidth";
        return Err(Failure::Input(text.to_owned()));
    }
    let pid: Vec<Pid> = laws
        .iter()
        .map(|law| Pid {
            kp: law.kp.value,
            ki: law.ki.value,
            kd: law.kd.value,
        })
        .collect();
    let offset: Vec<f64> = laws.iter().map(|law| law.offset.value).collect();
    let loop_controllers = if known.is_some() {
        Controllers::Known {
            pid: &pid,
            offset: &offset,
        }
    } else {
        Controllers::Tuned {
            bandwidth,
            given: &args.pid,
        }
    };
    let file = args.reference.as_deref();
    let trajectory = file.map(|file| path::read(file, model)).transpose()?;
    let mut references: Vec<Commanded> = Vec::new();
    if trajectory.is_none() {
        for track in all {
            references.push(Commanded::new(model, track)?);
        }
    }
    let measured: Result<Vec<Vec<Vec<f64>>>, TrackError> =
        all.iter().map(|track| efforts(track, &info)).collect();
    let measured = measured?;
    let mut runs: Vec<EffortRun<'_>> = Vec::with_capacity(all.len());
    for (k, (track, efforts)) in all.iter().zip(&measured).enumerate() {
        let (reference, lead): (&(dyn Reference + Sync), f64) =
            match (&trajectory, references.get(k)) {
                (Some(series), _) => (series, series.period()),
                (None, Some(commanded)) => (commanded, 0.0),
                (None, None) => continue,
            };
        runs.push(EffortRun {
            times: &track.times,
            efforts,
            closed_loop: ClosedLoop {
                reference,
                lead,
                controllers: loop_controllers,
            },
        });
    }
    let reading = &session.reading;
    let options = DidimOptions {
        least_squares: session.options,
        filtering: Filtering {
            smoothing: reading.method.smoothing(),
            decimation: reading.decimation,
            standstill: reading.standstill,
        },
        settle: if trajectory.is_some() {
            0.0
        } else {
            args.simulated.settle
        },
        ..DidimOptions::default()
    };
    session.watch.work("simulating the controlled robot");
    let found = didim(model, &runs, &options, start);
    session.watch.rest();
    let found = found?;
    if !found.settled {
        return Err(Failure::Numeric(format!(
            "DIDIM did not converge in {} rounds (eps_RA of the last one {:.3} %), so there is no \
             estimate: take a motion that excites more, give the robot's own gains with \
             --controller, or start nearer with --start",
            found.rounds,
            found.norms.last().copied().unwrap_or(f64::NAN)
        )));
    }
    let identified = found.model(args.confidence);
    let json = DidimJson {
        rounds: found.rounds,
        relative_absolute: found.norms.clone(),
    };
    let start = found.start(args.confidence);
    let summary = Summary {
        simulated: Some(SimulatedJson::Didim(json)),
        ..Summary::of(&start)
    };
    Ok((identified, summary, EffortContributions::of(&start.factor)))
}

/// A fit to the responses of the tracks.
fn of_responses(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
    all: &[Track],
    start: &[f64],
) -> Result<(IdentifiedModel, Summary, EffortContributions), Failure> {
    let model = session.model;
    let info = model.info();
    let Some(mut setup) = setup(args, model)? else {
        let text = "--estimator response needs the gains of the controllers: --controller FILE \
                    with `q1: {kp: 40, kd: 2}` for each actuated joint, `kp: {estimate: 40}` where \
                    they are not known";
        return Err(Failure::Usage(text.to_owned()));
    };
    setup.window = args.simulated.window;
    setup.friction_width = args.simulated.friction_width;
    let runs: Result<Vec<Run>, TrackError> = all
        .iter()
        .map(|track| Run::of_track(track, &info))
        .collect();
    let runs = runs?;
    let watch = session.watch;
    watch.work("simulating the controlled robot");
    let mut progress = |step: usize, squares: f64| {
        let text = format!(
            "step {step}, squared residuals {}",
            table::figure_of(3, squares)
        );
        watch.work(&text);
    };
    let level = args.confidence;
    let found = respond(model, model, &runs, &setup, start, level, &mut progress);
    watch.rest();
    let found = found?;
    if !found.settled {
        return Err(Failure::Numeric(format!(
            "the fit did not converge in {} steps, so there is no estimate: start nearer with \
             --start, or shorten the windows with --window",
            found.steps
        )));
    }
    let summary = summary(&found);
    let shares = EffortContributions::of(&found.factor);
    Ok((found.model, summary, shares))
}

fn summary(found: &Responded) -> Summary {
    let spectrum = found.factor.spectrum().ok();
    let equations: usize = found.errors.iter().map(|e| e.samples).sum();
    let efforts = found.errors.iter().map(|e| EffortJson {
        name: e.name.clone(),
        equations: e.samples,
        sigma: e.rms,
        weight: if e.rms > 0.0 { 1.0 / e.rms } else { 1.0 },
        error: Some(e.clone()),
    });
    let estimated = found.estimated.iter().map(|e| EstimatedJson {
        label: e.label.clone(),
        value: e.value,
        sigma: e.interval.map(|i| i.sigma),
        interval: e.interval.map(|i: Interval| [i.low, i.high]),
    });
    let undetermined = found.undetermined.iter().map(|d| DirectionJson {
        words: d.to_string(),
        terms: d.terms.clone(),
    });
    Summary {
        kind: "responses to commands".to_owned(),
        equations,
        degrees_of_freedom: found.factor.rows().saturating_sub(found.factor.columns()),
        condition: spectrum.as_ref().map_or(f64::NAN, Spectrum::condition),
        scaled_condition: spectrum
            .as_ref()
            .map_or(f64::NAN, Spectrum::scaled_condition),
        efforts: efforts.collect(),
        relative_absolute: None,
        bandwidth: None,
        singular: 0,
        left_out: None,
        delays: regen_identify::identify::Delays::default(),
        corrected_delays: Vec::new(),
        cross: Vec::new(),
        reduction: Vec::new(),
        models: Vec::new(),
        files: Vec::new(),
        instruments: None,
        simulated: Some(SimulatedJson::Response(ResponseJson {
            windows: found.windows,
            steps: found.steps,
            refused: found.refused,
            estimated: estimated.collect(),
            undetermined: undetermined.collect(),
        })),
        suspicions: Vec::new(),
    }
}

/// Fails where commands alone left something undetermined; the result is printed and written
/// already.
pub(crate) fn require_determined(summary: &Summary) -> Result<(), Failure> {
    let Some(SimulatedJson::Response(found)) = &summary.simulated else {
        return Ok(());
    };
    if found.undetermined.is_empty() {
        return Ok(());
    }
    let words: Vec<&str> = found
        .undetermined
        .iter()
        .map(|d| d.words.as_str())
        .collect();
    Err(Failure::Numeric(format!(
        "responses to these commands do not determine {}: the values stay where they started along \
         this; give a gain that is known, or move what is at rest",
        words.join("; nor ")
    )))
}

impl SimulatedJson {
    /// The lines above the tables.
    pub(crate) fn to_text(&self) -> String {
        match self {
            Self::Didim(found) => {
                let errors: Vec<String> = found
                    .relative_absolute
                    .iter()
                    .map(|e| format!("{e:.3}"))
                    .collect();
                let text = format!("{}; eps_RA {} %", found.rounds, errors.join(", "));
                table::field("rounds", &text)
            }
            Self::Response(found) => {
                let mut text = format!("{} in {} windows", found.steps, found.windows);
                if found.refused > 0 {
                    let _ = write!(
                        text,
                        "; {} candidates could not be simulated",
                        found.refused
                    );
                }
                table::field("steps", &text)
            }
        }
    }

    /// The tables behind that of the parameters.
    pub(crate) fn to_tables(&self) -> String {
        let Self::Response(found) = self else {
            return String::new();
        };
        let mut out = String::new();
        if !found.estimated.is_empty() {
            let lines: Vec<Vec<String>> = found
                .estimated
                .iter()
                .map(|e| {
                    vec![
                        e.label.clone(),
                        table::figure(e.value),
                        e.sigma
                            .map_or_else(|| "-".to_owned(), |s| table::figure_of(3, s)),
                    ]
                })
                .collect();
            out.push('\n');
            out.push_str(&table::columns(
                &["estimated too", "value", "sigma"],
                &lines,
            ));
        }
        for direction in &found.undetermined {
            out.push_str(&table::field("undetermined", &direction.words));
        }
        out
    }
}

impl From<TrackError> for Failure {
    fn from(error: TrackError) -> Self {
        let text = match &error {
            TrackError::Missing {
                what: "command",
                joint,
            } => format!(
                "{error}: name its column with --command {joint}=COLUMN, or give what the \
                 controllers followed to didim by --reference"
            ),
            TrackError::Missing { joint, .. } => {
                format!("{error}: name its column with --column tau_{joint}=COLUMN")
            }
            _ => error.to_string(),
        };
        Self::Input(text)
    }
}

impl From<DidimError> for Failure {
    fn from(error: DidimError) -> Self {
        match error {
            DidimError::Estimate(error) => error.into(),
            DidimError::Loop(_) => Self::Numeric(format!(
                "didim: {error}; start from other parameters (--start), or check the gains"
            )),
            other => Self::Input(other.to_string()),
        }
    }
}

impl From<ResponseError> for Failure {
    fn from(error: ResponseError) -> Self {
        match error {
            ResponseError::Estimate(error) => error.into(),
            ResponseError::Start { .. } => Self::Numeric(error.to_string()),
            ResponseError::Setting("window") => Self::Input("--window must be above 0".to_owned()),
            ResponseError::Setting("friction width") => {
                Self::Input("--friction-width must be above 0".to_owned())
            }
            other => Self::Input(other.to_string()),
        }
    }
}
