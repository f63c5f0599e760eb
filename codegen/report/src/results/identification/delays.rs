//! Writes the delays between motion and logged efforts.

use regen_identify::identify::{Delay, Delays};
use regen_identify::text::figure;

use super::logs::{Field, fields};

/// The lines on delays, see [`delay_fields`].
pub(super) fn delays_text(
    found: &Delays,
    corrected: &[(String, f64)],
    errors: Option<(f64, f64)>,
) -> String {
    fields(&delay_fields(found, corrected, errors))
}

/// What is said of delays: those that were corrected, and those that differ from zero by more than chance
/// explains. One that slower motion contradicts is not stated, but the first such
/// one is named with the reason. Efforts that seem to be early may be those of a controller that
/// answers the noise of measured positions: they are correlated with noise that came before.
///
/// - `errors`: eps_RA with the delays and with `--delay auto`, percent, where that was tried.
pub(crate) fn delay_fields(
    found: &Delays,
    corrected: &[(String, f64)],
    errors: Option<(f64, f64)>,
) -> Vec<Field> {
    let mut out = corrected_fields(corrected);
    let already = out.len();
    let mut early = false;
    let mut line = |delay: &Delay, who: &str| {
        early |= delay.seconds < 0.0;
        let side = if delay.seconds > 0.0 { "late" } else { "early" };
        let size = milliseconds(delay.seconds.abs());
        let sigma = milliseconds(delay.sigma);
        let text = format!("{who} {size} ms {side}, sigma {sigma} ms");
        ("delay", text)
    };
    let whole = found.common.as_ref().filter(|d| matters(d));
    if let Some(all) = whole {
        out.push(line(all, "all efforts are logged"));
    }
    for delay in &found.efforts {
        let own = match whole {
            // the common delay has already been printed
            Some(all) => {
                let apart = (delay.seconds - all.seconds).abs();
                apart > MATTERS_S && delay.differs_from(all.seconds)
            }
            None => matters(delay),
        };
        if own {
            out.push(line(delay, &format!("{} is logged", delay.effort)));
        }
    }
    let is_stated = out.len() > already;
    if let Some((with, without)) = errors
        && is_stated
        && corrected.is_empty()
    {
        let text = if without < with {
            format!("--delay auto corrects it: eps_RA {with:.3} to {without:.3} % (tried)")
        } else {
            "--delay auto does not make eps_RA smaller (tried)".to_owned()
        };
        out.push(("", text));
    }
    if early {
        let text = "efforts of a controller that answers noise of positions seem early too";
        out.push(("", text.to_owned()));
    }
    let mut all = found.common.iter().chain(&found.efforts);
    if let Some((seconds, slower)) = all.find_map(contradicted)
        && !is_stated
    {
        let text = format!(
            "none: {} here, but {} in other equations;",
            sided(seconds),
            sided(slower)
        );
        out.push(("delay", text));
        let text = "the controller may answer noise, or the model lack a part";
        out.push(("", text.to_owned()));
    }
    out
}

/// Whether delays are stated, so that a correction is worth trying.
pub fn states_delays(found: &Delays) -> bool {
    found.common.iter().chain(&found.efforts).any(matters)
}

/// Shorter delays are not mentioned, s: this one changes an effort of 10 Hz by 0.06 %.
const MATTERS_S: f64 = 1e-5;

/// Whether a delay differs from zero, and by enough to be worth correcting.
fn matters(delay: &Delay) -> bool {
    delay.is_significant() && delay.seconds.abs() > MATTERS_S
}

/// A delay that would be stated if other equations did not contradict it, s, and that of these.
fn contradicted(delay: &Delay) -> Option<(f64, f64)> {
    let slower = delay.slower?;
    (delay.seconds.abs() > MATTERS_S).then_some((delay.seconds, slower))
}

/// A delay in words.
fn sided(seconds: f64) -> String {
    let side = if seconds > 0.0 { "late" } else { "early" };
    format!("{:.2} ms {side}", 1e3 * seconds.abs())
}

fn milliseconds(seconds: f64) -> String {
    figure(1e3 * seconds)
}

/// Lines on the delays, s, by which efforts were corrected while reading.
pub fn corrected_delays_text(corrected: &[(String, f64)]) -> String {
    fields(&corrected_fields(corrected))
}

fn corrected_fields(corrected: &[(String, f64)]) -> Vec<Field> {
    let line = |(name, seconds): &(String, f64)| {
        let text = format!("of {name} corrected by {} ms", milliseconds(*seconds));
        ("delay", text)
    };
    corrected.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn efforts_that_seem_early_may_be_those_of_a_controller_that_answers_noise() {
        let text = |seconds: f64| {
            let common = Delay {
                effort: "all".to_owned(),
                seconds,
                sigma: 1e-4,
                degrees_of_freedom: 50.0,
                slower: None,
            };
            let found = Delays {
                efforts: Vec::new(),
                common: Some(common),
                ..Delays::default()
            };
            delays_text(&found, &[], Some((3.0, 2.5)))
        };
        let late = text(1.5e-3);
        assert!(late.contains("late") && !late.contains("noise"), "{late}");
        let early = text(-1.5e-3);
        assert!(early.contains("ms early, sigma"), "{early}");
        assert!(early.contains("answers noise of positions"), "{early}");
        assert_eq!(text(2e-4), "");
    }

    #[test]
    fn a_delay_that_slower_motion_contradicts_is_named_with_the_reason_and_without_a_remedy() {
        let mut common = Delay {
            effort: "all".to_owned(),
            seconds: -2.1e-3,
            sigma: 1e-4,
            degrees_of_freedom: 50.0,
            slower: Some(2e-4),
        };
        let text = |common: &Delay| {
            let found = Delays {
                efforts: Vec::new(),
                common: Some(common.clone()),
                ..Delays::default()
            };
            delays_text(&found, &[], Some((3.0, 2.5)))
        };
        let found = text(&common);
        assert!(
            found.contains("none: 2.10 ms early here, but 0.20 ms late"),
            "{found}"
        );
        assert!(!found.contains("--delay auto"), "{found}");
        assert_eq!(found.lines().count(), 2, "{found}");
        common.seconds = -2e-6;
        assert_eq!(text(&common), "");
    }
}
