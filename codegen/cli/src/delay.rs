//! Delays of logged efforts behind the motion: corrected on request.

use regen_identify::data::Run;
use regen_identify::session::{Session, from_logs, settled_delays};

use crate::args::{DelayArg, IdentifyArgs, ReadingArgs};
use crate::exit::Failure;
use crate::{identify, observe};
use regen_interpreted::Interpreted;
use regen_report::results::{Summary, states_delays};

/// The options with `--delay auto` replaced by the delays estimated from the logs; `None` where
/// `--delay auto` was not given.
pub(crate) fn corrected(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
) -> Result<Option<IdentifyArgs>, Failure> {
    if !args.reading.delay.contains(&DelayArg::Auto) {
        return Ok(None);
    }
    let mut args = args.clone();
    let delays = settled_delays(session, &args.logs)?;
    let delays = delays.into_iter();
    args.reading.delay = delays.map(|(name, s)| DelayArg::Of(name, s)).collect();
    args.reading.found.delays = true;
    Ok(Some(args))
}

/// The options with the delays that `--delay auto` corrects; `None` where no delay is stated, where delays were
/// corrected or given, or where none is settled.
pub(crate) fn with_auto(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
    found: &Summary,
) -> Result<Option<IdentifyArgs>, Failure> {
    if !session.reading.delays.is_empty() || args.logs.is_empty() || !states_delays(&found.delays) {
        return Ok(None);
    }
    let mut other = args.clone();
    other.reading.delay = vec![DelayArg::Auto];
    let other = corrected(&other, session)?;
    Ok(other.filter(|other| !other.reading.delay.is_empty()))
}

/// eps_RA of least squares with these options, percent.
pub(crate) fn tried(other: &IdentifyArgs, model: &Interpreted<'_>) -> Result<Option<f64>, Failure> {
    let session = identify::session(other, model);
    let start = from_logs(&session, &mut session.open(&other.logs)?)?;
    Ok(start.relative_absolute)
}

/// The reading options with `auto` replaced by the delays that least squares finds from the logs, and
/// these delays, for commands that do not identify; the options as they are without `auto`.
pub(crate) fn with_found_delays(
    reading: &ReadingArgs,
    session: &Session<'_, Interpreted<'_>>,
    logs: &[Run],
) -> Result<(ReadingArgs, Vec<(String, f64)>), Failure> {
    let mut reading = reading.clone();
    if !reading.delay.contains(&DelayArg::Auto) {
        return Ok((reading, Vec::new()));
    }
    let found = settled_delays(session, logs)?;
    let delays = found.iter().cloned();
    reading.delay = delays.map(|(name, s)| DelayArg::Of(name, s)).collect();
    reading.found.delays = true;
    Ok((reading, found))
}

/// The same of the logs of a model that is read from a file; refused where their gains or payloads are not
/// known without it.
pub(crate) fn with_found_delays_of_model(
    reading: &ReadingArgs,
    model: &Interpreted<'_>,
    logs: &[Run],
) -> Result<(ReadingArgs, Vec<(String, f64)>), Failure> {
    let experiment = reading.experiment.as_ref();
    let has_unknowns = experiment.is_some_and(|e| !e.unknown_gains.is_empty() || e.carries());
    if has_unknowns && reading.delay.contains(&DelayArg::Auto) {
        let text = "delays are not found from logs with unknown gains or payloads: give them in seconds, \
                    --delay NAME=S";
        return Err(Failure::Usage(text.to_owned()));
    }
    with_found_delays(reading, &observe::session(model, reading), logs)
}
