//! The error of a home from which the loops do not close: which cut gapes, and what closes.

use crate::constraints::{Gap, RegularHome};
use crate::diag::{Diagnostic, counted, rounded};
use crate::model::Model;
use crate::spec::Spec;

/// Gaps below this are none, m and rad.
const TINY: f64 = 1e-6;
/// Gaps below this are of rounded lengths and angles, m and rad.
const NEARLY: f64 = 1e-3;
/// The largest number of gaps in a message, the widest first.
const MAX_SAID: usize = 6;
/// Independent coordinates that differ more from home than this were moved, rad and m.
const MOVED: f64 = 1e-6;

/// Describes the gaps at the end of the closure solve, and closed states that were found.
///
/// - `independent`: the names of the independent coordinates.
pub(super) fn not_closed(
    spec: &Spec,
    model: &Model,
    residual: f64,
    gaps: &[Gap],
    near: &[Vec<f64>],
    independent: &str,
) -> Diagnostic {
    let span = spec.home_span.unwrap_or(spec.name.span);
    let gaping = gaps.iter().take(MAX_SAID).map(|gap| said(model, gap));
    let mut gaping: Vec<String> = gaping.collect();
    if gaps.len() > MAX_SAID {
        gaping.push(format!("and {} more", gaps.len() - MAX_SAID));
    }
    let reason = if gaping.is_empty() {
        format!(" (residual {residual:.2e}, in m and rad)")
    } else {
        format!(": {}", gaping.join(", "))
    };
    let message = format!("the loops do not close from here{reason}");
    let lines: Vec<String> = near.iter().map(|home| line(spec, model, home)).collect();
    let moved = near.first().is_some_and(|found| {
        let values = model
            .independent
            .iter()
            .map(|&c| (found[c], model.home[c].to_f64()));
        values
            .into_iter()
            .any(|(x, given)| (x - given).abs() > MOVED)
    });
    let hint = if lines.is_empty() {
        let mend = match gaps.first() {
            Some(gap) if gap.metres.max(gap.radians) > NEARLY => remedy(gap),
            _ => {
                "They close almost: where a loop closes for some lengths and angles only, write these as expressions, \
                 or with more digits"
            }
        };
        format!(
            "no closed state was found from many starts, with the values of {independent} as in home. {mend}"
        )
    } else if moved {
        format!(
            "with these values of {independent} no closed state was found; with others the loops close: {}",
            lines.join(", or ")
        )
    } else {
        format!(
            "with these values of {independent} the loops close elsewhere, closest to home first: {}",
            lines.join(", or ")
        )
    };
    let missing = super::without_home(spec);
    let hint = format!("{missing}{hint}; `regen view` draws the gaps");
    Diagnostic::new(span, message)
        .path("home")
        .label("start of the closure solve")
        .hint(hint)
}

/// Describes a singular home, and a regular one that was tried.
pub(super) fn singular(
    spec: &Spec,
    model: &Model,
    mobility: usize,
    beside: usize,
    remedy: Option<&RegularHome>,
) -> Diagnostic {
    let message = format!(
        "home is singular: the mechanism has {} there, and {beside} beside it",
        counted(mobility, "degree of freedom", "degrees of freedom"),
    );
    let hint = match remedy {
        None => {
            "the loops are stretched, folded or flat there: give `home` the driven coordinates of a state \
             that the robot takes at work; none of a few that were tried closes and is regular"
                .to_owned()
        }
        Some(remedy) => {
            let names = |which: &[usize]| {
                super::list(which.iter().map(|c| model.coordinates[*c].name.clone()))
            };
            let choice = if remedy.independent == model.independent {
                String::new()
            } else {
                format!(" with `independent: {}`", names(&remedy.independent))
            };
            let follow = model.coordinates.iter().zip(&remedy.closed).enumerate();
            let follow = follow.filter(|(c, _)| {
                !remedy.independent.contains(c) && !model.drives.contains(c)
            });
            let follow = follow.map(|(_, (c, value))| format!("{} {}", c.name, rounded(*value)));
            format!(
                "give a home beside it, for instance {}{choice}, which closes at {} and is regular (tried)",
                line(spec, model, &remedy.home),
                follow.collect::<Vec<_>>().join(", ")
            )
        }
    };
    Diagnostic::new(spec.home_span.unwrap_or(spec.name.span), message)
        .path("home")
        .label(format!("mobility {beside} beside it"))
        .hint(hint)
}

/// What would mend a gap where no state closes.
fn remedy(gap: &Gap) -> &'static str {
    /// Gaps of this size, m, are more often millimetres that are read as metres.
    const HUGE_M: f64 = 20.0;
    match (gap.metres > TINY, gap.radians > TINY) {
        (true, _) if gap.metres > HUGE_M => "Lengths are in m: are some given in mm?",
        (true, false) => {
            "The axes agree and the points do not meet: check the lengths, and xyz of the cut's frames"
        }
        (false, true) => {
            "The points meet and the axes do not agree: check axis of the joints, and rpy of the cut's frames"
        }
        _ => "Check the bodies and the frames of the cut, and where the limbs stand",
    }
}

fn said(model: &Model, gap: &Gap) -> String {
    let name = &model.cuts[gap.cut].name;
    let metres = format!("{} m", rounded(gap.metres));
    let radians = format!("{} rad", rounded(gap.radians));
    let width = match (gap.metres > TINY, gap.radians > TINY) {
        (true, true) => format!("{metres} and {radians}"),
        (false, true) => radians,
        _ => metres,
    };
    format!("cut '{name}' gapes by {width}")
}

/// The line of a spec for a home: what home names already, every dependent coordinate, and what moved.
fn line(spec: &Spec, model: &Model, home: &[f64]) -> String {
    let written = |name: &str| spec.home.iter().any(|(named, _)| named.value == name);
    let entries = model.coordinates.iter().zip(home).enumerate();
    let entries = entries.filter(|(c, (coordinate, _))| {
        let moved = (home[*c] - model.home[*c].to_f64()).abs() > MOVED;
        !model.drives.contains(c) && (moved || written(&coordinate.name))
    });
    let entries = entries.filter_map(|(_, (coordinate, value))| {
        let value = rounded(*value);
        (value != "0" || written(&coordinate.name)).then(|| format!("{}: {value}", coordinate.name))
    });
    format!("`home: {{{}}}`", entries.collect::<Vec<_>>().join(", "))
}
