//! The simulated robot that the options describe.

use regen_experiment::simulate::{
    Following, Gains, Log, Sensors, Settings, Trial, Twin, TwinError, TwinOptions, follow,
    simulate_with_progress,
};
use regen_experiment::trajectory::FourierReference;
use regen_interpreted::Interpreted;
use regen_runtime::Friction;

use super::parameters::{self, Described};
use crate::args::TwinArgs;
use crate::exit::Failure;
use crate::table;

/// The time between samples where none is given and no controllers are chosen, s.
const STEP: f64 = 0.01;

/// A simulated robot with its first run.
pub(crate) struct Tried {
    pub(crate) twin: Twin,
    /// The parameters around which those of the simulated robot are drawn.
    pub(crate) nominal: Vec<f64>,
    /// The first run; `None` where trials of controllers are shorter.
    pub(crate) first: Option<Log>,
    /// How the controllers were chosen; `None` where options or files give them.
    pub(crate) following: Option<Following>,
}

/// The simulated robot. Without `--bandwidth` and gains of all joints, its controllers are those that follow
/// the motion, with a time between samples that suits them where none is given.
///
/// - `step`: the time between samples, s, if it is given.
/// - `duration`: of the first run, s; `progress` is called with the time it has reached.
pub(crate) fn of(
    args: &TwinArgs,
    source: Described<'_>,
    model: &Interpreted<'_>,
    motion: &FourierReference,
    (step, duration): (Option<f64>, f64),
    progress: &mut dyn FnMut(f64),
) -> Result<Tried, Failure> {
    let has_friction = |model: &Interpreted<'_>| {
        let mut joints = model.info().joints.iter();
        joints.any(|joint| joint.friction != Friction::None)
    };
    if args.no_friction && !has_friction(model) {
        let text = "--no-friction has no effect here: the spec has no friction";
        return Err(Failure::Usage(text.to_owned()));
    }
    require_jump(args.friction_width, model, |law| !law.is_linear())?;
    let (nominal, fitted) = parameters::read(args, source, model)?;
    let states = motion.states();
    let made = |bandwidth: f64, step: f64| {
        let options = options(args, bandwidth, step);
        let made = Twin::new(model, &nominal, &fitted, &states, &options);
        made.map_err(|why| match why {
            TwinError::Control(why) => why.into(),
            why => Failure::Input(format!(
                "{}: {why}; state it under `friction:`, or leave friction out with --no-friction",
                source.file.display()
            )),
        })
    };
    let mut attempt = |bandwidth: f64, step: f64, duration: f64| {
        let twin = made(bandwidth, step)?;
        let settings = twin.run(args.seed, 0, duration);
        let run = simulate_with_progress(model, &twin.parameters, motion, &settings, progress);
        let run = run.map_err(|error| super::misuse(&error))?;
        Ok::<_, Failure>((twin, run))
    };
    let info = model.info();
    let is_given = args.bandwidth.is_some() || Gains::are_of_all(&args.pid, &info);
    let (twin, first, following) = if is_given {
        // controllers with gains have no bandwidth
        let bandwidth = args.bandwidth.unwrap_or(1.0);
        let (twin, first) = attempt(bandwidth, step.unwrap_or(STEP), duration)?;
        (twin, Some(first), None)
    } else {
        // the motion repeats itself
        let short = duration.min(motion.period());
        let spread = made(1.0, STEP)?.spread;
        let tried = follow(step, spread, &mut |bandwidth, step| {
            let (twin, run) = attempt(bandwidth, step, short)?;
            let drives = &twin.settings.drives;
            let trial = Trial::of((bandwidth, step), &info, drives, (&run, motion));
            Ok::<_, Failure>((trial, (twin, run)))
        })?;
        let (following, (twin, run)) = tried.map_err(|trials| unfollowed(&trials, step))?;
        (twin, (short >= duration).then_some(run), Some(following))
    };
    Ok(Tried {
        twin,
        nominal,
        first,
        following,
    })
}

/// The failure of a motion that none of the tried controllers follows, with the time between samples, s, if it
/// is given.
fn unfollowed(trials: &[Trial], step: Option<f64>) -> Failure {
    let of = |trial: &Trial| {
        let result = trial.ended.clone().unwrap_or_else(|| trial.to_string());
        format!(
            "with {} Hz every {} s {result}",
            trial.bandwidth, trial.step
        )
    };
    let mut parts: Vec<String> = trials.iter().map(of).collect();
    let parts_of_samples = trials.iter().map(|trial| trial.limited);
    let limited = parts_of_samples.fold(0.0, f64::max);
    if limited > 0.0 {
        let part = table::figure_of(2, 100.0 * limited);
        parts.push(format!(
            "an effort is at its limit in up to {part} % of the samples"
        ));
    }
    let shorter = step.map_or("", |_| "leave --step out, or ");
    Failure::Numeric(format!(
        "no controllers follow the motion: {}; {shorter}slow the motion down, or stay further from limits \
         and singularities (`excite --limit`, `--margin`); --bandwidth HZ simulates what the robot does with \
         such controllers",
        parts.join("; ")
    ))
}

/// Refuses `--friction-width` where no joint's friction jumps where its velocity turns round.
///
/// - `jumps`: which laws that are not linear jump in the simulation.
pub(crate) fn require_jump(
    width: Option<f64>,
    model: &Interpreted<'_>,
    jumps: fn(Friction) -> bool,
) -> Result<(), Failure> {
    let has_jump = model.info().joints.iter().any(|joint| {
        let law = joint.friction;
        !matches!(law, Friction::None | Friction::Viscous) && (law.is_linear() || jumps(law))
    });
    if width.is_none() || has_jump {
        return Ok(());
    }
    let text = "--friction-width has no effect here: no joint of the spec has Coulomb friction";
    Err(Failure::Usage(text.to_owned()))
}

fn options(args: &TwinArgs, bandwidth: f64, period: f64) -> TwinOptions<'_> {
    let [position_noise, effort_noise] = args.noise.unwrap_or_default();
    let [position_step, effort_step] = args.quantum.unwrap_or_default();
    TwinOptions {
        bandwidth,
        gains: &args.pid,
        period,
        lag: args.lag,
        friction: !args.no_friction,
        friction_width: args
            .friction_width
            .unwrap_or(Settings::default().friction_width),
        sensors: Sensors {
            position_step,
            position_noise,
            effort_step,
            effort_noise,
        },
        perturb: args.perturb,
        seed: args.seed,
    }
}
