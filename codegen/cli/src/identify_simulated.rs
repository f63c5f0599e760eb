//! `regen identify --estimator`: the estimators that simulate the controlled robot.

mod against;
mod controllers;
mod estimator;
mod failures;

use regen_experiment::simulate::missing_values;
use regen_experiment::trajectory::FourierReference;
use regen_identify::data::{Assignment, FileReport, Run as LogRun, Track, tracks};
use regen_identify::files::ParameterFile;
use regen_identify::gains::{GainFit, LoadedLoops, Plan};
use regen_identify::identify::digest;
use regen_identify::model::{IdentifiedModel, Provenance};
use regen_identify::session::{Session, gain_options};
use regen_identify::status::EffortContributions;
use regen_interpreted::Interpreted;
use regen_report::results::{Identification, LogFile, Simulated, Summary, stem};
use regen_response::{
    Departure, DidimOptions, Run, Setup, SimulatedLoops, TrackControllers, TrackError, didim,
    didim_with_gains, fit_responses,
};
use regen_runtime::BaseModel;

use crate::args::{EstimatorArg, IdentifyArgs};
use crate::exit::Failure;
use crate::identify::Outcome;
use crate::simulate::{WHERE, require_jump, require_width};
use crate::{observe, parameters, path, table, terminal};

pub(crate) use controllers::stated_gains;
use controllers::{common, controlled, require_known, setups};
pub(crate) use estimator::{SETTLE, note_unused, with_estimator};

/// Identifies by an estimator that simulates the controlled robot.
pub(crate) fn solve(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
) -> Result<Outcome, Failure> {
    // the fit to responses leaves out laws that are not linear
    require_jump(args.simulated.friction_width, session.model, |_| false)?;
    require_width(args.simulated.friction_width)?;
    let setups = setups(args, session.model)?;
    let (all, places, reports) = read(args, session)?;
    observe::note_problems(&reports);
    let start = start(args, session.model)?;
    let (mut identified, summary, shares) = if args.estimator == Some(EstimatorArg::Didim) {
        let of_track = |place: &usize| setups.get(*place).and_then(Option::as_ref);
        let known: Vec<Option<&Setup>> = places.iter().map(of_track).collect();
        of_efforts(args, session, (&all, &known), &start)?
    } else {
        let setup = common(args, setups)?;
        let (found, mut summary, shares) =
            of_responses(args, session, &all, setup.clone(), &start)?;
        let efforts = against::Efforts::of(args, session.model);
        let errors = efforts.as_ref().and_then(|own| own.errors(&found));
        if let (Some(efforts), Some(errors)) = (&efforts, errors)
            && against::contradicts(errors)
        {
            let other = efforts.nearest_loop(&all, &setup);
            let better = other.and_then(|other| {
                let least = efforts.least_squares();
                let fitted = of_responses(args, session, &all, other.clone(), least).ok()?;
                Some((other, efforts.errors(&fitted.0)?))
            });
            terminal::note(&against::warning(errors, better.as_ref()));
        }
        summary.simulated = summary.simulated.map(|own| own.with_efforts(errors));
        (found, summary, shares)
    };
    let mut logs: Vec<String> = args.logs.iter().map(|run| stem(&run.to_string())).collect();
    logs.sort();
    identified.provenance = Provenance {
        model: digest(session.model),
        logs,
        date: args.date.clone(),
        filter: None,
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
    let rows = file.parameters.iter();
    let rows = rows.map(|row| {
        (
            row.label.as_str(),
            row.combination.as_str(),
            row.value,
            row.sigma,
        )
    });
    let negative = impossible(rows);
    if !negative.is_empty() {
        terminal::note(&format!(
            "warning: no joint has such values below zero: {}. The loop that was simulated is not that of \
             the log: look at the controllers, whether their action is sampled, the delays of signals and the \
             commands, and compare with least squares from the logged efforts (--estimator ls)",
            negative.join(", ")
        ));
    }
    let json = Identification { file, summary };
    Ok(Outcome { json, identified })
}

/// So many standard deviations below zero, a value is not there by chance.
const IMPOSSIBLE_DEVIATIONS: f64 = 5.0;

/// The labels of friction and inertia of drives alone that are far below zero, which no joint has.
///
/// - `rows`: label, combination, value and standard deviation of each parameter.
fn impossible<'r>(rows: impl Iterator<Item = (&'r str, &'r str, f64, f64)>) -> Vec<&'r str> {
    let is_alone = |label: &str, combination: &str| {
        let mut kinds = ["Fv(", "Fc(", "J("].iter();
        label == combination && kinds.any(|kind| label.starts_with(kind))
    };
    let below = rows.filter(|(label, combination, value, sigma)| {
        is_alone(label, combination) && *value < -IMPOSSIBLE_DEVIATIONS * sigma
    });
    below.map(|(label, ..)| label).collect()
}

/// The tracks of all logs; for each track, the index of its log among the options; and for each log,
/// the report of its reader.
type Tracks = (Vec<Track>, Vec<usize>, Vec<FileReport>);

/// The coordinate whose commands are its positions in all rows, if there is one.
fn commanded_by_itself(tracks: &[Track]) -> Option<usize> {
    let position = |track: &Track, joint: usize| {
        let mut own = track.positions.iter();
        own.find(|(c, _)| *c == joint)
            .map(|(_, values)| values.clone())
    };
    let (coordinate, _) = tracks.first()?.commands.iter().find(|(joint, _)| {
        tracks.iter().all(|track| {
            let mut own = track.commands.iter();
            let command = own.find(|(c, _)| c == joint).map(|(_, values)| values);
            // a joint that is held may be where it is told to be
            let moves = |values: &Vec<f64>| values.iter().any(|x| Some(x) != values.first());
            command.is_some_and(moves) && command == position(track, *joint).as_ref()
        })
    })?;
    Some(*coordinate)
}

/// Reads the tracks of all logs that have more than one sample.
fn read(args: &IdentifyArgs, session: &Session<'_, Interpreted<'_>>) -> Result<Tracks, Failure> {
    let info = session.model.info();
    let (mut all, mut places, mut reports) = (Vec::new(), Vec::new(), Vec::new());
    let reading = &session.reading;
    for (place, run) in args.logs.iter().enumerate() {
        // options take precedence over the experiment file
        let mut commands = args.simulated.command.clone();
        let planned = controlled(args, run).map(|own| own.commands.as_slice());
        let more = planned.unwrap_or_default().iter();
        let more = more.filter(|own| !commands.iter().any(|a| a.quantity == own.quantity));
        let more: Vec<Assignment> = more.cloned().collect();
        commands.extend(more);
        let (own, report) = tracks(run, &info, reading, &commands)?;
        if let Some(name) = commanded_by_itself(&own).and_then(|c| info.coordinates.get(c)) {
            return Err(Failure::Input(format!(
                "{run}: the commands of {name} are its measured positions, so that its controller \
                 would never act: give the column of the commands, --command {name}=COLUMN"
            )));
        }
        let usable = own.into_iter().filter(|track| track.times.len() > 1);
        all.extend(usable);
        places.resize(all.len(), place);
        reports.push(report);
    }
    Ok((all, places, reports))
}

/// The base parameters to start from: those of `--start`, or else of the spec's nominal values.
fn start(args: &IdentifyArgs, model: &Interpreted<'_>) -> Result<Vec<f64>, Failure> {
    if let Some(path) = &args.simulated.start {
        return Ok(parameters::read(path, model)?.beta);
    }
    let info = model.info();
    let Some(phi) = info.nominal_parameters() else {
        let mut values = info.nominal.to_vec();
        values.resize(info.parameters.len(), None);
        return Err(Failure::Input(format!(
            "{}: no nominal values to start from, of {}; {WHERE}, or give identified parameters with \
             --start",
            args.file.display(),
            missing_values(&info, &values).join(", ")
        )));
    };
    let mut beta = vec![0.0; model.rank()];
    BaseModel::<f64>::to_base(model, &phi, &mut beta)?;
    Ok(beta)
}

/// Identifies by DIDIM from the efforts of the tracks.
///
/// - `all` and `known`: the tracks and, for each, its controllers if they are known.
fn of_efforts(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
    (all, known): (&[Track], &[Option<&Setup>]),
    start: &[f64],
) -> Result<(IdentifiedModel, Summary, EffortContributions), Failure> {
    let model = session.model;
    let loops = Loops::of(args, session, known)?;
    let loops = loops.choose(session, all, &vec![start.to_vec(); all.len()])?;
    let options = options(session, &loops);
    let found = didim(model, model, &loops.runs(), &options, start);
    session.watch.finished();
    let found = found?;
    let norms = &found.norms;
    let simulated = rounds(norms, found.converged, &found.departures, loops.bandwidth())?;
    let identified = found.model(args.confidence);
    let contributions = found.contributions.clone();
    let start = found.start(args.confidence);
    let summary = Summary {
        simulated: Some(simulated),
        ..Summary::of(&start)
    };
    Ok((identified, summary, contributions))
}

/// What is known of the loops that DIDIM simulates.
struct Loops<'a> {
    args: &'a IdentifyArgs,
    controllers: TrackControllers<'a>,
    trajectory: Option<FourierReference>,
}

impl<'a> Loops<'a> {
    fn of(
        args: &'a IdentifyArgs,
        session: &Session<'_, Interpreted<'_>>,
        known: &[Option<&Setup>],
    ) -> Result<Self, Failure> {
        let wanted = args.simulated.loop_bandwidth;
        if wanted.is_some_and(|bandwidth| !(bandwidth > 0.0 && bandwidth.is_finite())) {
            let text = "--loop-bandwidth must be above 0";
            return Err(Failure::Input(text.to_owned()));
        }
        if args.simulated.controller.is_some() && !args.pid.is_empty() {
            let text = "--pid and --controller both give the controllers: use one of them";
            return Err(Failure::Usage(text.to_owned()));
        }
        if wanted.is_some() && known.iter().all(Option::is_some) {
            let text = "--loop-bandwidth has no effect here: the gains of the controllers of all logs are \
                        given";
            return Err(Failure::Usage(text.to_owned()));
        }
        for setup in known.iter().copied().flatten() {
            require_known(setup)?;
        }
        let file = args.reference.as_deref();
        Ok(Self {
            args,
            controllers: TrackControllers::new(known, &args.pid, &session.model.info()),
            trajectory: file
                .map(|file| path::read(file, session.model))
                .transpose()?,
        })
    }

    fn choose<'b>(
        &'b self,
        session: &Session<'_, Interpreted<'_>>,
        all: &'b [Track],
        values: &[Vec<f64>],
    ) -> Result<SimulatedLoops<'b>, TrackError> {
        let known = self.trajectory.as_ref();
        let known = known.map(|series| (series as _, series.period()));
        let own = &self.args.simulated;
        let (wanted, settle) = (own.loop_bandwidth, own.settle);
        let (model, controllers) = (session.model, &self.controllers);
        session.watch.phase("choosing how the robot is simulated");
        let found = SimulatedLoops::choose(model, all, known, controllers, wanted, settle, values);
        session.watch.finished();
        found
    }
}

/// The options of DIDIM, which it announces.
fn options(session: &Session<'_, Interpreted<'_>>, loops: &SimulatedLoops<'_>) -> DidimOptions {
    session.watch.phase("simulating the controlled robot");
    DidimOptions {
        least_squares: session.options,
        filtering: session.reading.filtering(),
        settle: loops.settle,
        ..DidimOptions::default()
    }
}

/// The rounds of DIDIM, with a warning where they are those of another motion.
///
/// - `bandwidth`: of controllers that are not known, Hz.
fn rounds(
    norms: &[f64],
    has_converged: bool,
    departures: &[Departure],
    bandwidth: Option<f64>,
) -> Result<Simulated, Failure> {
    note_departures(departures, bandwidth.is_none());
    if has_converged {
        return Ok(Simulated::didim(norms, departures, bandwidth));
    }
    Err(Failure::Numeric(format!(
        "DIDIM did not converge in {} rounds (eps_RA of the last one {:.3} %), so there is no \
         estimate: take a motion that excites more, give the robot's own gains \
         (--controller, or `controller` in an experiment file), or start nearer with --start",
        norms.len(),
        norms.last().copied().unwrap_or(f64::NAN)
    )))
}

/// Unknown gains and payloads by DIDIM, and its rounds.
///
/// - `runs`: those of the plan, with their payloads.
pub(crate) fn with_gains(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
    plan: &Plan,
    runs: &[(LogRun, Option<usize>)],
) -> Result<(GainFit, Simulated, Vec<FileReport>), Failure> {
    let setups = setups(args, session.model)?;
    let (all, places, reports) = read(args, &session.in_amperes())?;
    let of_track = |place: &usize| setups.get(*place).and_then(Option::as_ref);
    let known: Vec<Option<&Setup>> = places.iter().map(of_track).collect();
    let carried = places
        .iter()
        .map(|place| runs.get(*place).and_then(|run| run.1));
    let carried: Vec<Option<usize>> = carried.collect();
    let (model, start) = (session.model, start(args, session.model)?);
    let loads = LoadedLoops::new(model, &gain_options(session), plan, &carried, &start)?;
    let loops = Loops::of(args, session, &known)?;
    let values = loads.start(&vec![1.0; model.info().actuated.len()]);
    let values: Vec<Vec<f64>> = (0..all.len()).map(|k| loads.base(&values, k)).collect();
    let loops = loops.choose(session, &all, &values)?;
    let options = options(session, &loops);
    let found = didim_with_gains(model, model, &loops.runs(), &loads, &options);
    session.watch.finished();
    let found = found?;
    let bandwidth = loops.bandwidth();
    let simulated = rounds(&found.norms, found.converged, &found.departures, bandwidth)?;
    Ok((found.fit, simulated, reports))
}

/// Warns where the simulated motion is far from the measured one: the simulated efforts then belong to
/// another motion than the measured ones.
fn note_departures(found: &[Departure], is_known: bool) {
    let far = found.iter().filter(|own| own.is_far());
    let far: Vec<String> = far
        .map(|own| format!("{} ({} %)", own.name, table::figure_of(2, own.percent)))
        .collect();
    if far.is_empty() {
        return;
    }
    let remedy = if is_known {
        "check the gains of the controllers, and that they followed these commands"
    } else {
        "give the robot's own gains (--controller, or `controller` in an experiment file)"
    };
    terminal::note(&format!(
        "warning: the simulated motion differs from the measured one in {}: the parameters are \
         biased by more than their standard deviations suggest; {remedy}, or choose --estimator ls \
         or iv",
        far.join(", ")
    ));
}

/// Identifies by fitting the simulated responses to the positions of the tracks.
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
    if let Some(width) = args.simulated.friction_width {
        setup.friction_width = width;
    }
    let runs: Result<Vec<Run>, TrackError> = all
        .iter()
        .map(|track| Run::of_track(track, &info))
        .collect();
    let runs = runs?;
    let watch = session.watch;
    watch.phase("simulating the controlled robot");
    let mut progress = |step: usize, squares: f64| {
        let text = format!(
            "step {step}, squared residuals {}",
            table::figure_of(3, squares)
        );
        watch.phase(&text);
    };
    let level = args.confidence;
    let found = fit_responses(model, model, &runs, &setup, start, level, &mut progress);
    watch.finished();
    let found = found?;
    if !found.converged {
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

/// Fails if the commands alone leave something undetermined. The result has already been printed and
/// written by then.
pub(crate) fn require_determined(summary: &Summary) -> Result<(), Failure> {
    let words = summary.undetermined();
    if words.is_empty() {
        return Ok(());
    }
    Err(Failure::Numeric(format!(
        "responses to these commands do not determine {}: along these combinations the values stay \
         at the start; give a gain that is known, or move the joints that are at rest",
        words.join("; nor ")
    )))
}

#[cfg(test)]
mod tests {
    use super::impossible;

    #[test]
    fn friction_and_drives_far_below_zero_are_impossible_and_moments_are_not() {
        let rows = [
            ("Fv(q1)", "Fv(q1)", -480.0, 12.0),
            ("Fc(q1)", "Fc(q1)", -2.0, 1.0),
            ("J(q2)", "J(q2) + Izz(2)", -9.0, 0.1),
            ("J(q3)", "J(q3)", -9.0, 0.1),
            ("mx(1)", "mx(1)", -9.0, 0.1),
        ];
        assert_eq!(impossible(rows.into_iter()), ["Fv(q1)", "J(q3)"]);
        assert!(impossible([("Fv(q1)", "Fv(q1)", -4.0, f64::NAN)].into_iter()).is_empty());
    }
}
