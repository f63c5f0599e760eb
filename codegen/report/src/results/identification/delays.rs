//! Writes the delays between motion and logged efforts.

use regen_codegen::explain::lines::field;
use regen_identify::identify::{Delay, Delays};
use regen_identify::text::figure;

/// Lines on delays: those that were corrected, and those that differ from zero by more than three
/// of their standard deviations.
///
/// - `remedy`: how to correct them, in words.
pub(super) fn delays_text(found: &Delays, corrected: &[(String, f64)], remedy: &str) -> String {
    let mut out = corrected_delays_text(corrected);
    let line = |delay: &Delay, who: &str| {
        let side = if delay.seconds > 0.0 { "late" } else { "early" };
        let size = milliseconds(delay.seconds.abs());
        let sigma = milliseconds(delay.sigma);
        field(
            "delay",
            &format!("{who} {size} ms {side}, sigma {sigma} ms"),
        )
    };
    let whole = found.common.as_ref().filter(|d| matters(d));
    if let Some(all) = whole {
        out.push_str(&line(all, "all efforts are logged"));
    }
    for delay in &found.efforts {
        let own = match whole {
            // the common delay has already been printed
            Some(all) => {
                let apart = (delay.seconds - all.seconds).abs();
                apart > MATTERS_S && apart > 3.0 * delay.sigma
            }
            None => matters(delay),
        };
        if own {
            out.push_str(&line(delay, &format!("{} is logged", delay.effort)));
        }
    }
    if !out.is_empty() && corrected.is_empty() {
        out.push_str(&field("", remedy));
    }
    out
}

/// Shorter delays are not mentioned, s: this one changes an effort of 10 Hz by 0.06 %.
const MATTERS_S: f64 = 1e-5;

/// Whether a delay differs from zero, and by enough to be worth correcting.
fn matters(delay: &Delay) -> bool {
    delay.is_significant() && delay.seconds.abs() > MATTERS_S
}

fn milliseconds(seconds: f64) -> String {
    figure(1e3 * seconds)
}

/// Lines on the delays, s, by which efforts were corrected while reading.
pub fn corrected_delays_text(corrected: &[(String, f64)]) -> String {
    let line = |(name, seconds): &(String, f64)| {
        let text = format!("of {name} corrected by {} ms", milliseconds(*seconds));
        field("delay", &text)
    };
    corrected.iter().map(line).collect()
}
