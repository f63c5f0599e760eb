//! The wording about base parameters that all outputs share.

use crate::base::certificate::Certificate;
use crate::base::{Analysis, Exactness, Provenance};
use crate::robot::Robot;

/// The mark that follows a layer's name where factors are not exact functions of the geometry
/// names.
pub(super) fn mark(exactness: Exactness) -> &'static str {
    match exactness {
        Exactness::Symbolic => "",
        Exactness::AtThisGeometry => "*",
        Exactness::Numeric => "**",
    }
}

/// Why the base parameters are not known to be complete; `None` where they are.
pub fn doubt(analysis: &Analysis) -> Option<String> {
    if analysis.complete {
        return None;
    }
    Some(match &analysis.certificate {
        Err(why) => format!("there is no certificate: {why}"),
        Ok(c) if !c.is_certain() => {
            format!(
                "the certificate leaves the rank open, with {:.1e} the smallest number kept and \
                 {:.1e} the largest dropped",
                c.smallest_kept, c.largest_dropped
            )
        }
        Ok(_) if analysis.base.refuted > 0 => format!(
            "{} derived directions are not null at sampled states",
            analysis.base.refuted
        ),
        Ok(c) => format!(
            "the directions derived leave {} parameters, the certified rank is {}",
            bound(analysis, c),
            c.rank
        ),
    })
}

/// What is said about payloads in a table; nothing where there is none.
pub(super) fn payloads(robot: &Robot) -> Option<(&'static str, String)> {
    let labels = robot.payloads.iter().filter_map(|b| robot.bodies.get(*b));
    let labels: Vec<&str> = labels.map(String::as_str).collect();
    let text = format!(
        "{} carried in some runs only: these tell its parameters from the robot's, and the rank is \
         that of both groups of columns apart",
        labels.join(" ")
    );
    (!labels.is_empty()).then_some(("payload", text))
}

/// The number of columns less the derived null directions: an upper bound of the rank.
fn bound(analysis: &Analysis, certificate: &Certificate) -> usize {
    let null = analysis.base.from_trees + completed(analysis);
    certificate.columns.saturating_sub(null)
}

/// The number of null directions beyond those derived from spanning trees.
pub fn completed(analysis: &Analysis) -> usize {
    analysis.base.completed
}

/// The name of a layer.
pub fn layer(layer: Provenance) -> &'static str {
    match layer {
        Provenance::Derived => "derived",
        Provenance::Completed => "completed",
    }
}

/// The label of the parameter of a column.
pub fn label(robot: &Robot, column: usize) -> &str {
    robot
        .parameters
        .get(column)
        .map_or("?", |p| p.label.as_str())
}

/// The certificate in one line.
pub fn certificate(analysis: &Analysis) -> String {
    match &analysis.certificate {
        Err(why) => format!("none: {why}"),
        Ok(c) => format!(
            "{} columns have rank {} at {} closed states in {} digits; smallest kept {:.1e}, \
             largest dropped {}",
            c.columns,
            c.rank,
            c.states,
            c.digits,
            c.smallest_kept,
            if c.largest_dropped == 0.0 {
                "0".to_owned()
            } else {
                format!("{:.1e}", c.largest_dropped)
            }
        ),
    }
}
