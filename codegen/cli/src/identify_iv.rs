//! `regen identify --iv`: instrumental variables.

use regen_experiment::closed_loop::LoopError;
use regen_experiment::instruments::{InstrumentError, instrumental};
use regen_report::results::Instruments;

use crate::args::IdentifyArgs;
use crate::exit::Failure;
use crate::simulate::reason;
use crate::{identify_simulated, observe, path};
use regen_identify::model::IdentifiedModel;
use regen_identify::session::{LeastSquaresStart, Session};
use regen_interpreted::Interpreted;

/// Instrumental variables: the model, its JSON, and in how many samples scores count as correlated.
pub(crate) fn run(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
    start: &LeastSquaresStart,
) -> Result<(IdentifiedModel, Instruments, usize), Failure> {
    observe::require_consistent(&args.reading)?;
    let file = args.reference.as_deref();
    let reference = file
        .map(|file| path::read(file, session.model))
        .transpose()?;
    let stated = identify_simulated::stated_gains(args, &session.model.info());
    let gains = match stated {
        Some(stated) if args.pid.is_empty() => stated,
        _ => args.pid.clone(),
    };
    let reference = reference.as_ref().map(|path| (path, gains.as_slice()));
    let found = instrumental(session, start, &args.logs, reference)?;
    if !found.instrumental.converged {
        return Err(Failure::Numeric(format!(
            "--iv did not converge in {} rounds, so there is no estimate: the instruments are weak; \
             take a motion that excites more, or {}",
            found.instrumental.rounds,
            if found.controller_bandwidth.is_some() {
                "give the robot's own gains by --pid, or as `controller` in an experiment file"
            } else {
                "give the commanded one by --reference"
            }
        )));
    }
    let motion = if found.cutoff.is_some() {
        "measured and smoothed, for no --reference is given"
    } else {
        "simulated along the reference"
    };
    let json = Instruments::new(
        &found.instrumental,
        found.cutoff,
        found.controller_bandwidth,
        motion,
    );
    Ok((found.model, json, found.instrumental.hac_bandwidth))
}

impl From<InstrumentError> for Failure {
    fn from(error: InstrumentError) -> Self {
        let not_simulated = |why: String| {
            Self::Numeric(format!(
                "--iv: the robot cannot be simulated with the present estimate: {why}; leave out \
                 --reference, then the measured motion is used"
            ))
        };
        match error {
            InstrumentError::Data(error) => error.into(),
            InstrumentError::Unsmoothed(_) => Self::Input(format!("--iv: {error}")),
            InstrumentError::Loop(LoopError::Tuning(why)) => not_simulated(why.to_string()),
            InstrumentError::Loop(LoopError::Simulation(why)) => not_simulated(why.to_string()),
            InstrumentError::Loop(LoopError::Termination(how)) => {
                not_simulated(reason(how).unwrap_or_default())
            }
            other => Self::Input(other.to_string()),
        }
    }
}
