//! `regen identify --estimator`: the choice, and the estimators that simulate the controlled robot.

use regen_experiment::closed_loop::{ClosedLoop, Controllers, nearest_bandwidth};
use regen_experiment::simulate::{Gains, Pid, Reference};
use regen_identify::data::{Assignment, FileReport, Run as LogRun, Track, tracks};
use regen_identify::files::ParameterFile;
use regen_identify::identify::{EquationKind, Filtering, digest};
use regen_identify::model::{IdentifiedModel, Provenance};
use regen_identify::session::Session;
use regen_identify::status::EffortContributions;
use regen_interpreted::Interpreted;
use regen_report::results::{Identification, LogFile, Simulated, Summary, stem};
use regen_response::{
    Action, Commanded, Damping, Departure, DidimError, DidimOptions, EffortRun, Law, ResponseError,
    Run, Setup, TrackError, controllers, departures, didim, efforts, respond,
};
use regen_runtime::{BaseModel, Info};

use crate::args::{DelayArg, EstimatorArg, IdentifyArgs, ReadingArgs};
use crate::exit::Failure;
use crate::experiment::Controlled;
use crate::identify::Outcome;
use crate::{observe, parameters, path, table, terminal};

/// Huber's bound where none is given.
pub(crate) const HUBER_BOUND: f64 = 1.345;
/// Seconds at the start of each log that DIDIM leaves out where none are given.
pub(crate) const SETTLE: f64 = 0.5;

/// The bandwidth of controllers where neither gains nor measured positions are known, Hz.
const BANDWIDTH_HZ: f64 = 3.0;

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
    let setups = setups(args, session.model)?;
    let (all, places, reports) = read(args, session)?;
    observe::note_problems(&reports);
    let start = start(args, session.model)?;
    let (mut identified, summary, shares) = if args.estimator == Some(EstimatorArg::Didim) {
        let of_track = |place: &usize| setups.get(*place).and_then(Option::as_ref);
        let known: Vec<Option<&Setup>> = places.iter().map(of_track).collect();
        of_efforts(args, session, (&all, &known), &start)?
    } else {
        of_responses(args, session, &all, common(args, setups)?, &start)?
    };
    let mut logs: Vec<String> = args.logs.iter().map(|run| stem(&run.to_string())).collect();
    logs.sort();
    identified.provenance = Provenance {
        model: digest(session.model),
        logs,
        date: args.date.clone(),
    };
    let summary = Summary {
        files: reports.iter().map(LogFile::new).collect(),
        ..summary
    };
    let file = ParameterFile::new(
        session.model,
        &identified,
        &shares,
        Vec::new(),
        args.confidence,
    )?;
    let json = Identification { file, summary };
    Ok(Outcome { json, identified })
}

/// The tracks of all logs, the place of each one's log among the options, and what was found in the
/// logs.
type Tracks = (Vec<Track>, Vec<usize>, Vec<FileReport>);

fn read(args: &IdentifyArgs, session: &Session<'_, Interpreted<'_>>) -> Result<Tracks, Failure> {
    let info = session.model.info();
    let (mut all, mut places, mut reports) = (Vec::new(), Vec::new(), Vec::new());
    let reading = &session.reading;
    for (place, run) in args.logs.iter().enumerate() {
        // options win over the experiment file
        let mut commands = args.simulated.command.clone();
        let said = controlled(args, run).map(|own| own.commands.as_slice());
        let more = said.unwrap_or_default().iter();
        let more = more.filter(|own| !commands.iter().any(|a| a.quantity == own.quantity));
        let more: Vec<Assignment> = more.cloned().collect();
        commands.extend(more);
        let (own, report) = tracks(run, &info, reading, &commands)?;
        let usable = own.into_iter().filter(|track| track.times.len() > 1);
        all.extend(usable);
        places.resize(all.len(), place);
        reports.push(report);
    }
    Ok((all, places, reports))
}

/// What the experiment file says of the loop of a run.
fn controlled<'a>(args: &'a IdentifyArgs, run: &LogRun) -> Option<&'a Controlled> {
    args.reading.experiment.as_ref()?.controlled(run)
}

/// The controllers of each log: those of the options, else those of the experiment file.
fn setups(args: &IdentifyArgs, model: &Interpreted<'_>) -> Result<Vec<Option<Setup>>, Failure> {
    if let Some(own) = setup(args, model)? {
        return Ok(vec![Some(own); args.logs.len()]);
    }
    if !args.pid.is_empty() {
        return Ok(vec![None; args.logs.len()]);
    }
    let of_run = |run: &LogRun| controlled(args, run).and_then(|own| own.setup.clone());
    Ok(args.logs.iter().map(of_run).collect())
}

/// The controllers that all logs have in common.
fn common(args: &IdentifyArgs, setups: Vec<Option<Setup>>) -> Result<Setup, Failure> {
    let mut found: Option<(usize, Setup)> = None;
    for (k, setup) in setups.into_iter().enumerate() {
        let Some(setup) = setup else {
            let run = args.logs.get(k).map(ToString::to_string);
            return Err(Failure::Usage(format!(
                "--estimator response needs the gains of the controllers of {}: --controller FILE \
                 with `q1: {{kp: 40, kd: 2}}` for each actuated joint, `kp: {{estimate: 40}}` where \
                 they are not known, or the same as `controller` of the run in an experiment file",
                run.unwrap_or_default()
            )));
        };
        match &found {
            Some((first, own)) if *own != setup => {
                let run = |k: usize| args.logs.get(k).map(ToString::to_string);
                return Err(Failure::Input(format!(
                    "{} and {} have different controllers, and responses are fitted with one: \
                     fit them apart",
                    run(*first).unwrap_or_default(),
                    run(k).unwrap_or_default()
                )));
            }
            Some(_) => {}
            None => found = Some((k, setup)),
        }
    }
    found
        .map(|(_, setup)| setup)
        .ok_or_else(|| Failure::Input("there is no log".to_owned()))
}

/// The gains that the experiment file says of the controllers, where all runs have the same and all
/// are known: for instruments.
pub(crate) fn stated_gains(args: &IdentifyArgs, info: &Info<'_>) -> Option<Vec<Gains>> {
    let mut found: Option<&Setup> = None;
    for run in &args.logs {
        let own = controlled(args, run)?.setup.as_ref()?;
        if found.is_some_and(|other| other.laws != own.laws) {
            return None;
        }
        found = Some(own);
    }
    let laws = &found?.laws;
    let is_known = laws
        .iter()
        .all(|law| !law.gains().iter().any(|g| g.is_estimated()));
    let named = info.actuated.iter().zip(laws).map(|(joint, law)| Gains {
        name: info.coordinates.get(*joint).map(|name| (*name).to_owned()),
        values: [law.kp.value, law.ki.value, law.kd.value],
    });
    is_known.then(|| named.collect())
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

/// Refuses controllers that `didim` does not simulate.
fn require_known(setup: &Setup) -> Result<(), Failure> {
    let is_any = |is: fn(&Law) -> bool| setup.laws.iter().any(is);
    let wrong = if is_any(|law| law.gains().iter().any(|g| g.is_estimated())) {
        "gains as they are: leave `estimate` out, or say no controllers, then the loop keeps the \
         bandwidth of --loop-bandwidth"
    } else if is_any(|law| law.damping != Damping::OfError) {
        "controllers whose kd multiplies the rate of the error: leave out `damping: velocity`, or \
         choose --estimator response"
    } else if setup.action != Action::Sampled {
        "controllers that act at the rows of the log: leave out `action: continuous`, or choose \
         --estimator response"
    } else if !setup.signals.is_empty() {
        "signals as they are logged: leave `signals` out, or choose --estimator response"
    } else {
        return Ok(());
    };
    Err(Failure::Input(format!("didim takes {wrong}")))
}

/// DIDIM from the efforts of the tracks.
///
/// - `all`: the tracks, each with its controllers, if they are known.
fn of_efforts(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
    (all, known): (&[Track], &[Option<&Setup>]),
    start: &[f64],
) -> Result<(IdentifiedModel, Summary, EffortContributions), Failure> {
    let model = session.model;
    let info = model.info();
    let wanted = args.simulated.loop_bandwidth;
    if wanted.is_some_and(|bandwidth| !(bandwidth > 0.0 && bandwidth.is_finite())) {
        let text = "--loop-bandwidth must be above 0";
        return Err(Failure::Input(text.to_owned()));
    }
    if args.simulated.controller.is_some() && !args.pid.is_empty() {
        let text = "--pid and --controller say the same: give one of them";
        return Err(Failure::Usage(text.to_owned()));
    }
    for setup in known.iter().copied().flatten() {
        require_known(setup)?;
    }
    let laws = |setup: Option<&Setup>| setup.map_or(Vec::new(), |own| own.laws.clone());
    let pids: Vec<Vec<Pid>> = known
        .iter()
        .map(|setup| laws(*setup).iter().map(pid_of).collect())
        .collect();
    let offsets: Vec<Vec<f64>> = known
        .iter()
        .map(|setup| laws(*setup).iter().map(|law| law.offset.value).collect())
        .collect();
    let controllers_of =
        |k: usize, bandwidth: f64| match (known.get(k), pids.get(k), offsets.get(k)) {
            (Some(Some(_)), Some(pid), Some(offset)) => Controllers::Known { pid, offset },
            _ => Controllers::Tuned {
                bandwidth,
                given: &args.pid,
            },
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
    let runs_at = |bandwidth: f64| -> Vec<EffortRun<'_>> {
        let mut runs = Vec::with_capacity(all.len());
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
                positions: &track.positions,
                closed_loop: ClosedLoop {
                    reference,
                    lead,
                    controllers: controllers_of(k, bandwidth),
                },
            });
        }
        runs
    };
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
    let is_tuned = known.iter().any(Option::is_none);
    let step = all.first().and_then(|track| {
        let [first, second, ..] = track.times[..] else {
            return None;
        };
        Some(second - first)
    });
    let chosen = match (wanted, step) {
        (None, Some(step)) if is_tuned => nearest_bandwidth(step, &mut |bandwidth| {
            let found = departures(model, &runs_at(bandwidth), options.settle, start).ok()?;
            (!found.is_empty()).then(|| found.iter().map(|own| own.percent * own.percent).sum())
        }),
        _ => None,
    };
    let bandwidth = wanted.or(chosen).unwrap_or(BANDWIDTH_HZ);
    let found = didim(model, &runs_at(bandwidth), &options, start);
    session.watch.rest();
    let found = found?;
    note_departures(&found.departures, known.iter().all(Option::is_some));
    if !found.settled {
        return Err(Failure::Numeric(format!(
            "DIDIM did not converge in {} rounds (eps_RA of the last one {:.3} %), so there is no \
             estimate: take a motion that excites more, give the robot's own gains \
             (--controller, or `controller` in an experiment file), or start nearer with --start",
            found.rounds,
            found.norms.last().copied().unwrap_or(f64::NAN)
        )));
    }
    let identified = found.model(args.confidence);
    let simulated = Simulated::didim(&found, is_tuned.then_some(bandwidth));
    let start = found.start(args.confidence);
    let summary = Summary {
        simulated: Some(simulated),
        ..Summary::of(&start)
    };
    Ok((identified, summary, EffortContributions::of(&start.factor)))
}

fn pid_of(law: &Law) -> Pid {
    Pid {
        kp: law.kp.value,
        ki: law.ki.value,
        kd: law.kd.value,
    }
}

/// Warns where the simulated motion is not the measured one: then the regressor is not at the motion
/// to which the efforts belong.
fn note_departures(found: &[Departure], is_known: bool) {
    let far = found.iter().filter(|own| own.is_far());
    let far: Vec<String> = far
        .map(|own| format!("{} ({} %)", own.name, table::figure_of(2, own.percent)))
        .collect();
    if far.is_empty() {
        return;
    }
    let remedy = if is_known {
        "check the controllers' gains, or that they followed these commands"
    } else {
        "give the robot's own gains (--controller, or `controller` in an experiment file)"
    };
    terminal::note(&format!(
        "warning: the simulated motion differs from the measured one in {}: parameters are biased \
         by more than their deviations say; {remedy}, or choose --estimator ls or iv",
        far.join(", ")
    ));
}

/// A fit to the responses of the tracks.
fn of_responses(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
    all: &[Track],
    mut setup: Setup,
    start: &[f64],
) -> Result<(IdentifiedModel, Summary, EffortContributions), Failure> {
    let model = session.model;
    let info = model.info();
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
    let summary = Summary::of_responses(&found);
    let shares = EffortContributions::of(&found.factor);
    Ok((found.model, summary, shares))
}

/// Fails where commands alone left something undetermined; the result is printed and written
/// already.
pub(crate) fn require_determined(summary: &Summary) -> Result<(), Failure> {
    let words = summary.undetermined();
    if words.is_empty() {
        return Ok(());
    }
    Err(Failure::Numeric(format!(
        "responses to these commands do not determine {}: the values stay where they started along \
         this; give a gain that is known, or move what is at rest",
        words.join("; nor ")
    )))
}

impl From<TrackError> for Failure {
    fn from(error: TrackError) -> Self {
        let text = match &error {
            TrackError::Missing {
                what: "command",
                joint,
            } => format!(
                "{error}: name its column with --command {joint}=COLUMN or with `commands` in an \
                 experiment file, or give what the controllers followed to didim by --reference"
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
