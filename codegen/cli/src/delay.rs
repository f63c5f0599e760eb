//! Delays of logged efforts behind the motion: printed where they are significant, and corrected on
//! request.

use regen_identify::identify::{Delay, Delays};
use regen_identify::session::{Session, settled_delays};

use crate::args::{DelayArg, IdentifyArgs};
use crate::exit::Failure;
use crate::table;
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

/// Lines on delays: those that were corrected, and those that differ from zero by more than three
/// of their standard deviations.
pub(crate) fn to_text(found: &Delays, corrected: &[(String, f64)]) -> String {
    let mut out = String::new();
    let milliseconds = |seconds: f64| table::figure(1e3 * seconds);
    for (name, seconds) in corrected {
        let text = format!("of {name} corrected by {} ms", milliseconds(*seconds));
        out.push_str(&table::field("delay", &text));
    }
    let line = |delay: &Delay, who: &str| {
        let side = if delay.seconds > 0.0 { "late" } else { "early" };
        let size = milliseconds(delay.seconds.abs());
        let sigma = milliseconds(delay.sigma);
        table::field(
            "delay",
            &format!("{who} {size} ms {side}, sigma {sigma} ms"),
        )
    };
    let whole = found.common.as_ref().filter(|d| d.is_significant());
    if let Some(all) = whole {
        out.push_str(&line(all, "all efforts are logged"));
    }
    for delay in &found.efforts {
        let own = match whole {
            // the common delay is printed already
            Some(all) => (delay.seconds - all.seconds).abs() > 3.0 * delay.sigma,
            None => delay.is_significant(),
        };
        if own {
            out.push_str(&line(delay, &format!("{} is logged", delay.effort)));
        }
    }
    if !out.is_empty() && corrected.is_empty() {
        out.push_str(&table::field("", "--delay auto corrects it"));
    }
    out
}
