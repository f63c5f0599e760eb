//! The simulated robot that the options describe.

use regen_experiment::simulate::{Sensors, Twin, TwinError, TwinOptions};
use regen_experiment::trajectory::FourierReference;
use regen_interpreted::Interpreted;

use super::parameters::{self, Described};
use crate::args::TwinArgs;
use crate::exit::Failure;

/// The simulated robot, and the nominal parameters around which its own are drawn.
///
/// - `step`: the time between samples, s.
pub(crate) fn of(
    args: &TwinArgs,
    source: Described<'_>,
    model: &Interpreted<'_>,
    motion: &FourierReference,
    step: f64,
) -> Result<(Twin, Vec<f64>), Failure> {
    let (nominal, fitted) = parameters::read(args, source, model)?;
    let [position_noise, effort_noise] = args.noise.unwrap_or_default();
    let [position_step, effort_step] = args.quantum.unwrap_or_default();
    let options = TwinOptions {
        bandwidth: args.bandwidth,
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
