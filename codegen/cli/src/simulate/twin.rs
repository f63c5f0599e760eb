//! The simulated robot that the options describe.

use regen_experiment::simulate::{
    Log, Sensors, Termination, Twin, TwinError, TwinOptions, default_bandwidths,
    simulate_with_progress,
};
use regen_experiment::trajectory::FourierReference;
use regen_interpreted::Interpreted;

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

/// The simulated robot. Without `--bandwidth` and `--pid` its controllers have the first of the default
/// bandwidths with which the loops stay closed in the first run; one that is not the usual one is told.
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
    let mut bandwidths = default_bandwidths(step);
    if args.bandwidth.is_some() || !args.pid.is_empty() {
        bandwidths.truncate(1);
    }
    let usual = args.bandwidth.or(bandwidths.first().copied());
    let mut best = None;
    for bandwidth in args.bandwidth.map_or(bandwidths, |given| vec![given]) {
        let (twin, nominal) = with_bandwidth(args, bandwidth, source, model, motion, step)?;
        let settings = twin.run(args.seed, 0, duration);
        let first = simulate_with_progress(model, &twin.parameters, motion, &settings, progress);
        let first = first.map_err(|error| super::misuse(&error))?;
        let opened = matches!(first.ended, Termination::Open(_));
        if best.is_none() || first.ended == Termination::Complete {
            let tried = Tried {
                twin,
                nominal,
                first,
            };
            best = Some((bandwidth, tried));
        }
        if !opened {
            break;
        }
    }
    let Some((bandwidth, tried)) = best else {
        return Err(Failure::Input("--bandwidth must be above 0".to_owned()));
    };
    if let Some(usual) = usual.filter(|usual| *usual < bandwidth) {
        terminal::note(&format!(
            "note: controllers of {usual} Hz leave the motion until the loops cannot be kept closed; these \
             have {bandwidth} Hz (--bandwidth)"
        ));
    }
    Ok(tried)
}

fn with_bandwidth(
    args: &TwinArgs,
    bandwidth: f64,
    source: Described<'_>,
    model: &Interpreted<'_>,
    motion: &FourierReference,
    step: f64,
) -> Result<(Twin, Vec<f64>), Failure> {
    let (nominal, fitted) = parameters::read(args, source, model)?;
    let [position_noise, effort_noise] = args.noise.unwrap_or_default();
    let [position_step, effort_step] = args.quantum.unwrap_or_default();
    let options = TwinOptions {
        bandwidth,
        gains: &args.pid,
        period: step,
        lag: args.lag,
        friction: !args.no_friction,
        friction_width: args.friction_width,
        sensors: Sensors {
            position_step,
            position_noise,
            effort_step,
            effort_noise,
        },
        perturb: args.perturb,
        seed: args.seed,
    };
    let start = motion.position(0.0);
    match Twin::new(model, &nominal, &fitted, &start, &options) {
        Ok(twin) => Ok((twin, nominal)),
        Err(TwinError::Control(why)) => Err(why.into()),
        Err(why) => Err(Failure::Input(format!(
            "{}: {why}; state it under `friction:`, or leave friction out with --no-friction",
            source.file.display()
        ))),
    }
}
