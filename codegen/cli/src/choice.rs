//! The filter that is chosen from the logs where no option names one.

use regen_identify::data::Run;
use regen_identify::session::{Choice, Session, chosen};
use regen_identify::signals::Method;
use regen_interpreted::Interpreted;

use crate::args::ReadingArgs;
use crate::exit::Failure;
use crate::observe;

/// Whether neither an option nor the experiment file says how positions are differentiated.
pub(crate) fn is_open(reading: &ReadingArgs) -> bool {
    !reading.no_filter && observe::settings(reading).method == Method::Central
}

/// Chooses a filter from the logs where none is given, and sets the options that pin it; returns the
/// choice.
pub(crate) fn made(
    reading: &mut ReadingArgs,
    session: &Session<'_, Interpreted<'_>>,
    logs: &[Run],
) -> Result<Option<Choice>, Failure> {
    if !is_open(reading) || logs.is_empty() {
        return Ok(None);
    }
    let choice = chosen(session, logs)?;
    if let Some(choice) = &choice {
        pin(choice, reading);
    }
    Ok(choice)
}

/// Sets the options that pin a choice; a decimation or an even grid that is given stays.
pub(crate) fn pin(choice: &Choice, reading: &mut ReadingArgs) {
    let settings = observe::settings(reading);
    reading.butterworth = Some((choice.cutoff, choice.order));
    if settings.decimation == 1 {
        reading.decimate = Some(choice.decimation);
    }
    reading.resample = settings.resample.or(choice.resample);
}
