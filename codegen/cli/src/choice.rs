//! The filter that is chosen from the logs where no option names one.

use regen_identify::session::{Choice, Session, chosen};
use regen_identify::signals::Method;
use regen_interpreted::Interpreted;

use crate::args::{IdentifyArgs, ReadingArgs};
use crate::exit::Failure;
use crate::observe;

/// The reading options with what is chosen from the logs, and the choice; `None` where an option or the
/// experiment file names a method, or there is nothing to choose.
pub(crate) fn made(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
) -> Result<Option<(IdentifyArgs, Choice)>, Failure> {
    if session.reading.method != Method::Central {
        return Ok(None);
    }
    let Some(choice) = chosen(session, &args.logs)? else {
        return Ok(None);
    };
    let mut args = args.clone();
    apply(&choice, &mut args.reading);
    Ok(Some((args, choice)))
}

/// Sets the options that pin a choice.
pub(crate) fn apply(choice: &Choice, reading: &mut ReadingArgs) {
    if let Method::Butterworth { order, cutoff } = choice.method {
        reading.butterworth = Some((cutoff, order));
    }
    let settings = observe::settings(reading);
    if settings.decimation == 1 {
        reading.decimate = Some(choice.decimation);
    }
    reading.resample = choice.resample.or(reading.resample);
}
