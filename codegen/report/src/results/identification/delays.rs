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
    let whole = found.common.as_ref().filter(|d| d.is_significant());
    if let Some(all) = whole {
        out.push_str(&line(all, "all efforts are logged"));
    }
    for delay in &found.efforts {
        let own = match whole {
            // the common delay has already been printed
            Some(all) => (delay.seconds - all.seconds).abs() > 3.0 * delay.sigma,
            None => delay.is_significant(),
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
