//! Delays of logged efforts behind the motion: corrected on request.

use regen_identify::data::Run;
use regen_identify::session::{Session, settled_delays};

use crate::args::{DelayArg, IdentifyArgs, ReadingArgs};
use crate::exit::Failure;
use regen_interpreted::Interpreted;

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
    Ok(Some(args))
}

/// The reading options with `auto` replaced by the delays that least squares finds from the logs, and
/// these delays, for commands that do not identify; the options as they are without `auto`.
pub(crate) fn found_for(
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
    Ok((reading, found))
}
