//! `regen identify --iv`: instrumental variables.

use regen_experiment::closed_loop::LoopError;
use regen_experiment::instruments::{InstrumentError, instrumental, instrumental_with_gains};
use regen_experiment::simulate::Gains;
use regen_experiment::trajectory::FourierReference;
use regen_identify::data::{FileReport, Run};
use regen_identify::gains::{GainFit, Plan};
use regen_identify::identify::Instrumental;
use regen_report::results::{self, Instruments};

use crate::args::IdentifyArgs;
use crate::exit::Failure;
use crate::simulate::reason;
use crate::{identify_simulated, observe, path, terminal};
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
    let own = reference(args, session)?;
    let reference = own.as_ref().map(|(path, gains)| (path, gains.as_slice()));
    let found = instrumental(session, start, &args.logs, reference)?;
    let how = (found.cutoff, found.controller_bandwidth);
    let json = converged(&found.instrumental, how)?;
    let short = results::too_short(&found.instrumental.deviations);
    if let Some(text) = short.filter(|_| args.bandwidth.is_none()) {
        terminal::note(&text);
    }
    let correlated = found.instrumental.correlation_length();
    Ok((found.model, json, correlated))
}

/// Instrumental variables with unknown gains and payloads.
pub(crate) fn with_gains(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
    plan: &Plan,
    runs: &[(Run, Option<usize>)],
) -> Result<(GainFit, Instruments, Vec<FileReport>), Failure> {
    let own = reference(args, session)?;
    let reference = own.as_ref().map(|(path, gains)| (path, gains.as_slice()));
    let all = instrumental_with_gains(session, plan, runs, reference)?;
    let how = (all.cutoff, all.controller_bandwidth);
    let json = converged(&all.found.instrumental, how)?;
    Ok((all.found.fit, json, all.reports))
}

/// The motion along which instruments are simulated, and the gains of the controllers.
fn reference(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
) -> Result<Option<(FourierReference, Vec<Gains>)>, Failure> {
    let Some(file) = args.reference.as_deref() else {
        return Ok(None);
    };
    let stated = identify_simulated::stated_gains(args, &session.model.info());
    let gains = match stated {
        Some(stated) if args.pid.is_empty() => stated,
        _ => args.pid.clone(),
    };
    Ok(Some((path::read(file, session.model)?, gains)))
}

/// The JSON of an estimate; refuses one that has not converged.
fn converged(
    found: &Instrumental,
    (cutoff, bandwidth): (Option<f64>, Option<f64>),
) -> Result<Instruments, Failure> {
    if !found.converged {
        return Err(Failure::Numeric(format!(
            "--iv did not converge in {} rounds, so there is no estimate: the instruments are weak; \
             take a motion that excites more, or {}",
            found.rounds,
            match (cutoff, bandwidth) {
                (Some(_), _) => "give the commanded one by --reference",
                (None, Some(_)) => {
                    "give the robot's own gains by --pid, or as `controller` in an experiment file"
                }
                (None, None) => "check the gains of the controllers",
            }
        )));
    }
    let motion = if cutoff.is_some() {
        "measured and smoothed, for no --reference is given"
    } else {
        "simulated along the reference"
    };
    Ok(Instruments::new(found, cutoff, bandwidth, motion))
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
            InstrumentError::Gains(error) => error.into(),
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
