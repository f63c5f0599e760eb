//! What is said of base parameters, the same in every output.

use crate::base::certificate::Certificate;
use crate::base::{Analysis, Exactness, Provenance};
use crate::robot::Robot;

/// How well a layer's factors are known, as a mark behind its name.
pub(super) fn mark(exactness: Exactness) -> &'static str {
    match exactness {
        Exactness::Symbolic => "",
        Exactness::AtThisGeometry => "*",
        Exactness::Numeric => "**",
    }
}

/// Why a base is not known to be complete; `None` where it is.
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

/// What the derived null directions leave of all columns: a bound of the rank from above.
fn bound(analysis: &Analysis, certificate: &Certificate) -> usize {
    let null = analysis.base.from_trees + completed(analysis);
    certificate.columns.saturating_sub(null)
}

/// Dimension of the null space beyond what trees account for.
pub fn completed(analysis: &Analysis) -> usize {
    analysis.base.completed
}

/// How a layer is called.
pub fn layer(layer: Provenance) -> &'static str {
    match layer {
        Provenance::Derived => "derived",
        Provenance::Completed => "completed",
    }
}

/// The label of a column.
pub fn label(robot: &Robot, column: usize) -> &str {
    robot
        .parameters
        .get(column)
        .map_or("?", |p| p.label.as_str())
}

/// The certificate in a line.
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
