//! Delays of efforts behind the motion that they belong to: told where they are found, and
//! corrected on request.

use regen_identify::identify::{self, Delay, Delays, Options};

use crate::args::{DelayArg, IdentifyArgs};
use crate::exit::Failure;
use crate::{observe, table};
use regen_interpreted::Interpreted;

/// Rounds in which delays are corrected at most; two or three settle them.
const ROUNDS: usize = 6;

/// The options with the delays that the logs show in place of `--delay auto`; `None` where
/// that was not asked for.
///
/// A delay is corrected where it differs from zero by more than three of its deviations. As the
/// estimate is of first order, it is repeated until nothing significant is left.
pub(crate) fn corrected(
    args: &IdentifyArgs,
    model: &Interpreted<'_>,
) -> Result<Option<IdentifyArgs>, Failure> {
    if !args.reading.delay.contains(&DelayArg::Auto) {
        return Ok(None);
    }
    if args.reading.energy.is_some() {
        let text = "--delay auto needs the equations of motion: leave out --energy";
        return Err(Failure::Input(text.to_owned()));
    }
    let mut args = args.clone();
    args.reading.delay.retain(|d| *d != DelayArg::Auto);
    let options = Options {
        weighting: crate::identify::weighting(&args),
        ..Options::default()
    };
    for _ in 0..ROUNDS {
        let kind = observe::kind(&args.reading);
        let mut logs = observe::open(model, &args.logs, &args.reading)?;
        let found = identify::identify(model, kind, &options, &mut logs)?;
        let late = found.delays.efforts.iter().filter(|d| d.is_significant());
        let late: Vec<(String, f64)> = late.map(|d| (d.effort.clone(), d.seconds)).collect();
        if late.is_empty() {
            break;
        }
        for (name, seconds) in late {
            let known = args.reading.delay.iter_mut().find_map(|d| match d {
                DelayArg::Of(own, seconds) if *own == name => Some(seconds),
                _ => None,
            });
            match known {
                Some(known) => *known += seconds,
                None => args.reading.delay.push(DelayArg::Of(name, seconds)),
            }
        }
    }
    Ok(Some(args))
}

/// What is said of delays: those that were corrected, and those that differ from zero by more
/// than three of their deviations.
pub(crate) fn human(found: &Delays, corrected: &[(String, f64)]) -> String {
    let mut out = String::new();
    let milliseconds = |seconds: f64| table::figure(1e3 * seconds);
    for (name, seconds) in corrected {
        let text = format!("of {name} corrected by {} ms", milliseconds(*seconds));
        out.push_str(&table::field("delay", &text));
    }
    let told = |delay: &Delay, who: &str| {
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
        out.push_str(&told(all, "all efforts are logged"));
    }
    for delay in &found.efforts {
        let own = match whole {
            // the one of all is told already
            Some(all) => (delay.seconds - all.seconds).abs() > 3.0 * delay.sigma,
            None => delay.is_significant(),
        };
        if own {
            out.push_str(&told(delay, &format!("{} is logged", delay.effort)));
        }
    }
    if !out.is_empty() && corrected.is_empty() {
        out.push_str(&table::field("", "--delay auto corrects it"));
    }
    out
}
