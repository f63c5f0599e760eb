//! The simulated robot that the options describe.

use regen_experiment::simulate::{
    Log, Sensors, Settings, Termination, Twin, TwinError, TwinOptions, USUAL_BANDWIDTH,
    faster_bandwidths, simulate_with_progress,
};
use regen_experiment::trajectory::FourierReference;
use regen_interpreted::Interpreted;
use regen_runtime::Friction;

use super::parameters::{self, Described};
use crate::args::TwinArgs;
use crate::exit::Failure;
use crate::terminal;

/// A simulated robot with its first run.
pub(crate) struct Tried {
    pub(crate) twin: Twin,
    /// The parameters around which those of the simulated robot are drawn.
    pub(crate) nominal: Vec<f64>,
    pub(crate) first: Log,
}

/// The simulated robot. Without `--bandwidth` and `--pid`, where the first run with the usual bandwidth
/// opens the loops, its controllers have the first faster one with which the run is complete, and a note
/// says so.
///
/// - `step`: the time between samples, s.
/// - `duration`: of the first run, s; `progress` is called with the time it has reached.
pub(crate) fn of(
    args: &TwinArgs,
    source: Described<'_>,
    model: &Interpreted<'_>,
    motion: &FourierReference,
    (step, duration): (f64, f64),
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
    let mut attempt = |bandwidth: f64| {
        let options = options(args, bandwidth, step);
        let start = motion.position(0.0);
        let twin = match Twin::new(model, &nominal, &fitted, &start, &options) {
            Ok(twin) => twin,
            Err(TwinError::Control(why)) => return Err(why.into()),
            Err(why) => {
                return Err(Failure::Input(format!(
                    "{}: {why}; state it under `friction:`, or leave friction out with --no-friction",
                    source.file.display()
                )));
            }
        };
        let settings = twin.run(args.seed, 0, duration);
        let first = simulate_with_progress(model, &twin.parameters, motion, &settings, progress);
        let first = first.map_err(|error| super::misuse(&error))?;
        Ok((twin, first))
    };
    let usual = args.bandwidth.unwrap_or(USUAL_BANDWIDTH);
    let (mut twin, mut first) = attempt(usual)?;
    let is_open = matches!(first.ended, Termination::Open(_));
    if is_open && args.bandwidth.is_none() && args.pid.is_empty() {
        for bandwidth in faster_bandwidths(step) {
            let (faster, run) = attempt(bandwidth)?;
            if run.ended == Termination::Complete {
                terminal::note(&format!(
                    "note: controllers of {usual} Hz leave the motion until the loops cannot be kept closed; \
                     these have {bandwidth} Hz (--bandwidth)"
                ));
                (twin, first) = (faster, run);
                break;
            }
        }
    }
    Ok(Tried {
        twin,
        nominal,
        first,
    })
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
