//! The wording about base parameters that all outputs share.

use crate::base::certificate::Certificate;
use crate::base::{Analysis, BaseParameter, Exactness, Provenance, Term};
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
                c.smallest_pivot, c.largest_remainder
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
        Provenance::Proven => "proven",
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

/// The term with the largest coefficient beside a kept parameter, with its base parameter; `None`
/// where all base parameters are single parameters.
pub fn largest_term(analysis: &Analysis) -> Option<(&Term, &BaseParameter)> {
    let all = analysis.base.parameters.iter();
    let terms = all.flat_map(|p| p.terms.iter().skip(1).map(move |term| (term, p)));
    let size = |term: &Term| term.value.to_f64().abs();
    terms.reduce(|a, b| if size(b.0) > size(a.0) { b } else { a })
}

/// The largest coefficient, as a line of the table.
pub(super) fn largest_coefficient(
    robot: &Robot,
    analysis: &Analysis,
) -> Option<(&'static str, String)> {
    let (term, parameter) = largest_term(analysis)?;
    let text = format!(
        "coefficient {}, of {} beside {}",
        significant(term.value.to_f64().abs()),
        label(robot, term.column),
        label(robot, parameter.column)
    );
    Some(("largest", text))
}

/// The condition of the sampled rows, as a line of the table.
pub(super) fn condition(analysis: &Analysis) -> Option<(&'static str, String)> {
    let condition = analysis.condition?;
    let number = if condition.is_finite() {
        significant(condition)
    } else {
        "more than 1e7".to_owned()
    };
    let text = format!("{number} of the rows sampled, their kept columns scaled to length 1");
    Some(("condition", text))
}

/// A number in three significant digits.
fn significant(x: f64) -> String {
    let rounded: f64 = format!("{x:.2e}").parse().unwrap_or(x);
    if (1e-3..1e6).contains(&rounded) {
        format!("{rounded}")
    } else {
        format!("{rounded:e}")
    }
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
            c.smallest_pivot,
            if c.largest_remainder == 0.0 {
                "0".to_owned()
            } else {
                format!("{:.1e}", c.largest_remainder)
            }
        ),
    }
}
