//! `regen rehearse`: simulates runs with known parameters, identifies from them, and scores how often
//! the parameters are found.

mod scratch;

use std::sync::atomic::Ordering;

use regen_codegen::robot::Robot;
use regen_experiment::simulate::{Twin, add_stribeck};
use regen_experiment::trajectory::FourierReference;
use regen_identify::data::{Run, Settings};
use regen_identify::identify::{EquationKind, Options};
use regen_identify::session::{NominalTrust, PriorKnowledge};
use regen_interpreted::{BaseTerms, Interpreted};
use regen_rehearse::{
    DidimSettings, Estimator, Loads, Rehearsal, RehearseError, planned, rehearse,
};
use regen_report::results::{Rehearsed, rehearsed_text};
use regen_runtime::BaseModel;

use crate::args::{
    DelayArg, EstimatorArg, Format, PayloadArg, PriorArg, ReadingArgs, RehearseArgs, SolvingArgs,
    UnmodelledArg, WeightingArg,
};
use crate::exit::Failure;
use crate::experiment::Experiment;
use crate::simulate::{self, Described};
use crate::{
    choice, experiment, identify, identify_simulated, interrupt, load, loads, observe, path,
    progress, table, terminal,
};
use scratch::Folder;

/// Runs the command.
pub(crate) fn run(args: &RehearseArgs) -> Result<(), Failure> {
    check(args)?;
    simulate::check(&args.twin)?;
    let source = load::source(&args.file)?;
    let mut logs = args.logs.clone();
    let mut reading = args.reading.clone();
    experiment::resolve_loaded(&mut logs, &mut reading, &source)?;
    if !args.logs.is_empty() {
        experiment::require_runs(&logs)?;
    }
    let simulates = matches!(
        args.solving.estimator,
        EstimatorArg::Didim | EstimatorArg::Response
    );
    let finds_delays = reading.delay.contains(&DelayArg::Auto);
    if simulates {
        identify_simulated::note_unused(args.solving.estimator, &mut reading, &[]);
    }
    reading.delay.retain(|delay| *delay != DelayArg::Auto);
    observe::require_consistent(&reading)?;

    let plan = reading.experiment.clone();
    let plan = plan.filter(|plan| plan.carries() || !plan.unknown_gains.is_empty());
    let robot = match &plan {
        Some(plan) if plan.carries() => load::with_base(&source)?,
        _ => load::loaded_with_base(&source, reading.payload)?,
    };
    if let Some((name, _)) = args.gain.first() {
        let unknown = plan.as_ref().map_or(&[][..], |plan| &plan.unknown_gains);
        if let Some(other) = args.gain.iter().find(|(own, _)| !unknown.contains(own)) {
            let name = if unknown.is_empty() { name } else { &other.0 };
            let known = if unknown.is_empty() {
                "none has".to_owned()
            } else {
                format!("these have: {}", unknown.join(", "))
            };
            return Err(Failure::Input(format!(
                "--gain {name}: its drive has no unknown gain in the experiment file (`gain: unknown`); \
                 {known}"
            )));
        }
    }
    let loads = plan.map(|plan| of_plan(args, &plan, &robot, &reading, &logs));
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    observe::require_base(&model, &robot.name)?;
    if args.solving.weighting == WeightingArg::Equal {
        identify::require_several(&model, observe::kind(&reading))?;
    }
    let motion = path::of(args.twin.trajectory.as_deref(), &model)?;
    let (durations, step) = runs(args, &logs, &reading, &model, &motion)?;
    let described = Described {
        file: &args.file,
        payload: if robot.payloads.is_empty() {
            reading.payload
        } else {
            Some(PayloadArg::Carried)
        },
    };
    let longest = durations.iter().copied().fold(0.0, f64::max);
    let span = (step, longest + args.twin.settle);
    let tried = simulate::twin(&args.twin, described, &model, &motion, span, &mut |_| ())?;
    let (mut twin, nominal) = (tried.twin, tried.nominal);
    let step = twin.settings.period;
    let unmodelled = add_unmodelled(args, &mut twin)?;
    let mut start = vec![0.0; model.rank()];
    BaseModel::<f64>::to_base(&model, &nominal, &mut start)?;

    let estimator = estimator(args, start)?;
    let folder = Folder::new(args.keep.as_deref())?;
    let rehearsal = Rehearsal {
        model: &model,
        twin: &twin,
        motion: &motion,
        durations: &durations,
        settle: args.twin.settle,
        // the simulated logs name their columns plainly
        reading: Settings {
            columns: Vec::new(),
            format: regen_identify::data::Format::default(),
            rate: None,
            topic: None,
            episode: None,
            deviations: Vec::new(),
            measured_rates: None,
            ..observe::settings(&reading)
        },
        kind: if simulates {
            EquationKind::Forces
        } else {
            observe::kind(&reading)
        },
        chooses_filter: choice::is_open(&reading),
        finds_delays,
        options: Options {
            weighting: match args.solving.weighting {
                WeightingArg::PerEffort => regen_identify::estimate::Weighting::PerEffort,
                WeightingArg::Equal => regen_identify::estimate::Weighting::Equal,
            },
            huber: huber(&args.solving),
            ..Options::default()
        },
        confidence: args.solving.confidence,
        estimator,
        loads,
        first: args.twin.seed,
        seeds: args.seeds,
        threads: args.threads,
        folder: folder.path(),
        keep: args.keep.is_some(),
    };
    let stop = interrupt::flag();
    let bar = progress::bar(args.seeds as u64, "{bar:24} {pos}/{len} seeds{left}");
    let result = rehearse(&rehearsal, &stop, &|done| bar.set_position(done as u64));
    bar.finish_and_clear();
    let score = result?;
    let interrupted = stop.load(Ordering::Relaxed) && score.seeds < score.asked;
    if score.seeds == 0 {
        let text = "interrupted before a seed was finished".to_owned();
        return Err(Failure::Interrupted(text));
    }
    let passed = score.least >= args.score;
    let json = Rehearsed {
        version: Rehearsed::VERSION,
        robot: &robot.name,
        motion: motion.name(),
        estimator: rehearsal.estimator.name(),
        durations: &durations,
        step,
        following: tried.following.as_ref(),
        seed: args.twin.seed,
        perturb: args.twin.perturb,
        unmodelled,
        interrupted,
        needed: args.score,
        passed,
        score: &score,
    };
    terminal::print(&match args.format {
        Format::Json => table::json(&json),
        Format::Human => rehearsed_text(&json),
    })?;
    if interrupted {
        return Err(Failure::Interrupted(format!(
            "interrupted after {} of {} seeds, which are scored",
            score.seeds, score.asked
        )));
    }
    if passed {
        return Ok(());
    }
    let why = match score.failed.first() {
        Some(first) if score.failed.len() == score.seeds => {
            format!(
                "no seed has an estimate, the first one because {}",
                first.why
            )
        }
        _ => format!(
            "{} is within 3 sigma of the truth in too few seeds",
            score.lowest
        ),
    };
    Err(Failure::Check(format!(
        "the score is {:.1} %, below {} %: {why}",
        score.least, args.score
    )))
}

/// What the runs of an experiment file carry, and the true gains.
fn of_plan(
    args: &RehearseArgs,
    plan: &Experiment,
    robot: &Robot,
    reading: &ReadingArgs,
    logs: &[Run],
) -> Loads {
    let mut carried: Vec<_> = logs.iter().map(|run| loads::of_run(reading, run)).collect();
    // the fresh run carries what the last one does
    carried.extend(carried.last().copied());
    let gain = |name: &String| {
        let given = args.gain.iter().find(|(own, _)| own == name);
        (name.clone(), given.map_or(1.0, |(_, gain)| *gain))
    };
    Loads {
        payloads: if loads::bodies(robot).is_empty() {
            Vec::new()
        } else {
            plan.payloads.clone()
        },
        carried,
        gains: plan.unknown_gains.iter().map(gain).collect(),
    }
}

/// Refuses options that do not go together, or have no effect.
fn check(args: &RehearseArgs) -> Result<(), Failure> {
    let own = &args.solving;
    if !(0.0..=100.0).contains(&args.score) {
        let text = "--score is a percentage, from 0 to 100";
        return Err(Failure::Input(text.to_owned()));
    }
    if !(own.confidence > 0.0 && own.confidence < 1.0) {
        let text = "--confidence must be between 0 and 1, such as 0.95";
        return Err(Failure::Input(text.to_owned()));
    }
    let positive = [
        ("--window", Some(own.window)),
        ("--huber", own.huber),
        ("--loop-bandwidth", own.loop_bandwidth),
    ];
    for (name, value) in positive {
        if value.is_some_and(|v| !(v > 0.0 && v.is_finite())) {
            return Err(Failure::Input(format!("{name} must be above 0")));
        }
    }
    let reading = &args.reading;
    let is = |estimators: &[EstimatorArg]| estimators.contains(&own.estimator);
    let (ls, huber) = (EstimatorArg::Ls, EstimatorArg::Huber);
    let (iv, didim) = (EstimatorArg::Iv, EstimatorArg::Didim);
    let physical = own.feasible || own.friction;
    let unused = [
        (own.huber.is_some() && !is(&[ls, huber]), "--huber"),
        (own.feasible && !is(&[ls, huber]), "--feasible"),
        (own.friction && !is(&[ls]), "--friction"),
        (own.prior.is_some() && !physical, "--prior"),
        (own.reference && !is(&[iv, didim]), "--reference"),
        (
            own.loop_bandwidth.is_some() && !is(&[didim]),
            "--loop-bandwidth",
        ),
        (reading.energy.is_some() && !is(&[ls, huber]), "--energy"),
        (reading.energy.is_some() && own.friction, "--energy"),
    ];
    if let Some((_, option)) = unused.iter().find(|(is, _)| *is) {
        return Err(Failure::Usage(format!(
            "{option} does not apply to this estimator: leave it out, or choose another --estimator"
        )));
    }
    let of_real_logs = [
        (!reading.column.is_empty(), "--column"),
        (reading.rate.is_some(), "--rate"),
    ];
    if let Some((_, option)) = of_real_logs.iter().find(|(is, _)| *is) {
        return Err(Failure::Usage(format!(
            "{option} is for logs that come from elsewhere: the simulated ones have columns of \
             time, positions and efforts, every --step"
        )));
    }
    Ok(())
}

/// The durations of the runs of a seed and their time step, s, if it is given.
fn runs(
    args: &RehearseArgs,
    logs: &[Run],
    reading: &ReadingArgs,
    model: &Interpreted<'_>,
    motion: &FourierReference,
) -> Result<(Vec<f64>, Option<f64>), Failure> {
    let settings = observe::settings(reading);
    let mut steps = Vec::new();
    let mut durations = Vec::new();
    for log in logs {
        let found = planned(log, &model.info(), &settings)?;
        durations.push(found.duration);
        steps.extend(found.step);
    }
    if logs.is_empty() {
        durations.resize(args.runs.unwrap_or(1), None);
    }
    let known = |own: &Option<f64>| args.twin.duration.or(*own).unwrap_or(motion.period());
    let durations = durations.iter().map(known).collect();
    let step = args.twin.step.or(steps.first().copied());
    let on_grid = settings.resample.map(|rate| 1.0 / rate);
    Ok((durations, step.or(on_grid)))
}

/// Adds to the simulated robot what the model has not; returns it in words.
fn add_unmodelled(args: &RehearseArgs, twin: &mut Twin) -> Result<Option<String>, Failure> {
    let Some(UnmodelledArg::Stribeck { part, speed }) = args.unmodelled else {
        return Ok(None);
    };
    if add_stribeck(&mut twin.settings.friction, part, speed) == 0 {
        let text = "--unmodelled stribeck has nothing to add to: no joint has `friction: coulomb` \
                    or `linear`";
        return Err(Failure::Input(text.to_owned()));
    }
    Ok(Some(format!(
        "static friction {} % above Coulomb's, up to about {} rad/s or m/s",
        table::figure_of(3, 100.0 * part),
        table::figure_of(3, speed)
    )))
}

/// Huber's bound, if residuals are to be bounded.
fn huber(own: &SolvingArgs) -> Option<f64> {
    let usual =
        (own.estimator == EstimatorArg::Huber).then_some(regen_identify::session::HUBER_BOUND);
    own.huber.or(usual)
}

/// The estimator of the options; `start` are the base parameters before they are perturbed.
fn estimator(args: &RehearseArgs, start: Vec<f64>) -> Result<Estimator, Failure> {
    let own = &args.solving;
    Ok(match own.estimator {
        EstimatorArg::Ls | EstimatorArg::Huber if own.feasible || own.friction => {
            if own.draws == 0 {
                let text = "--draws 0 leaves no intervals to compare with the truth";
                return Err(Failure::Input(text.to_owned()));
            }
            Estimator::Physical {
                knowledge: PriorKnowledge {
                    trust: match own.prior {
                        None => NominalTrust::Open,
                        Some(PriorArg::Entropic(weight)) => NominalTrust::Entropic(weight),
                        Some(PriorArg::Weighted(part)) => NominalTrust::Weighted(part),
                    },
                    ..PriorKnowledge::default()
                },
                draws: own.draws,
                friction: own.friction,
            }
        }
        EstimatorArg::Ls | EstimatorArg::Huber => Estimator::LeastSquares,
        EstimatorArg::Iv => Estimator::Instrumental {
            along: own.reference,
        },
        EstimatorArg::Didim => Estimator::Didim(DidimSettings {
            along: own.reference,
            bandwidth: own.loop_bandwidth,
            settle: identify_simulated::SETTLE,
            start,
        }),
        EstimatorArg::Response => Estimator::Response {
            window: own.window,
            start,
        },
    })
}

impl From<RehearseError> for Failure {
    fn from(error: RehearseError) -> Self {
        match error {
            RehearseError::Io { .. } => Self::Io(error.to_string()),
            RehearseError::Session(error) => error.into(),
            RehearseError::Instruments(error) => error.into(),
            RehearseError::Didim(error) => error.into(),
            RehearseError::Response(error) => error.into(),
            RehearseError::Track(error) => error.into(),
            RehearseError::Setting("the time to settle", _) => {
                Self::Input(format!("--settle: {error}"))
            }
            other => Self::Input(other.to_string()),
        }
    }
}
