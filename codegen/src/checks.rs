//! Errors that take kinematics to find, reported in the spec's terms: a home that does not close,
//! independent coordinates that do not fit the mobility, cuts that close with a half turn between
//! their frames.

mod drives;
mod home;

use crate::base::{self, Base};
use crate::constraints::{HomeProblem, agreement};
use crate::diag::{Diagnostic, Report, Sink, Source, Span, counted};
use crate::kinematics::Frames;
use crate::model::Model;
use crate::spec::{CutKind, Spec};
use crate::sym::Graph;
use crate::sym::eval::Evaluator;

fn list(names: impl Iterator<Item = String>) -> String {
    let names: Vec<String> = names.collect();
    format!("[{}]", names.join(", "))
}

/// The place of `independent` in the spec, or that of the robot's name if the spec has none.
fn independent_span(spec: &Spec) -> Span {
    spec.independent.as_ref().map_or(spec.name.span, |i| i.span)
}

/// The error of a mechanism with more parameters than the limit for deriving base parameters.
pub(crate) fn too_many_parameters(source: &Source, spec: &Spec, model: &Model) -> Report {
    let message = format!(
        "the robot has {} dynamic parameters; base parameters are derived up to {}",
        model.parameters.len(),
        base::MAX_PARAMETERS
    );
    let diagnostic = Diagnostic::new(spec.name.span, message)
        .path("name")
        .hint("kinematics and the dynamics over all parameters do not need them");
    Report::new(source.clone(), vec![diagnostic])
}

/// Refuses a graph that ran out of node indices: its expressions are wrong.
pub(crate) fn check_graph_capacity(source: &Source, spec: &Spec, g: &Graph) -> Result<(), Report> {
    let mut sink = Sink::new();
    if g.is_full() {
        let message = "the robot takes more expressions than can be told apart";
        let hint = "describe fewer bodies, or loops with fewer joints";
        sink.push(
            Diagnostic::new(spec.name.span, message)
                .path("name")
                .hint(hint),
        );
    }
    sink.finish(source)
}

/// What to do first where a spec has no home.
fn without_home(spec: &Spec) -> &'static str {
    if spec.home.is_empty() && !spec.cuts.is_empty() {
        "there is no `home`, so that all coordinates are 0: give it the driven ones of a state that the \
         robot can take; "
    } else {
        ""
    }
}

/// How many independent coordinates there are, and why these.
fn listed(spec: &Spec, count: usize, names: &str) -> String {
    let coordinates = counted(count, "coordinate", "coordinates");
    if spec.independent.is_some() {
        return format!("`independent` lists {coordinates}, {names}");
    }
    let verb = if count == 1 { "is" } else { "are" };
    format!("{coordinates} {verb} actuated, {names}, and `independent` is missing")
}

/// What may be wrong with the motors, where they decide which coordinates are independent.
fn motors(spec: &Spec, count: usize, mobility: usize) -> &'static str {
    if spec.independent.is_some() {
        ""
    } else if count < mobility {
        "give a joint with a motor `actuated: true`, or correct a joint that has too many freedoms; else "
    } else {
        "correct a joint or cut whose type leaves too few freedoms, or an `actuated: true`; else "
    }
}

/// Reports a problem at home.
pub(crate) fn home_report(
    source: &Source,
    spec: &Spec,
    model: &Model,
    problem: &HomeProblem,
) -> Report {
    if let HomeProblem::Mobility { mismatch, .. } | HomeProblem::NotIndependent { mismatch, .. } =
        problem
        && spec.independent.is_none()
    {
        let found = drives::mismatch(spec, model, mismatch);
        if !found.is_empty() {
            return Report::new(source.clone(), found);
        }
    }
    let names = |which: &[usize]| list(which.iter().map(|c| model.coordinates[*c].name.clone()));
    let independent = names(&model.independent);
    let diagnostic = match problem {
        HomeProblem::NotClosed {
            residual,
            gaps,
            near,
        } => home::not_closed(spec, model, *residual, gaps, near, &independent),
        HomeProblem::Mobility { mobility, choice, .. } => Diagnostic::new(
            independent_span(spec),
            format!(
                "the mechanism has {} at home, but {}",
                counted(*mobility, "degree of freedom", "degrees of freedom"),
                listed(spec, model.independent.len(), &independent)
            ),
        )
        .path("independent")
        .label(format!("mobility {mobility}"))
        .hint(if *mobility == 0 {
            "it cannot move at home: a cut or a coupling is too many, or home is singular".to_owned()
        } else {
            format!(
                "{}{}a valid choice is `independent: {}`",
                without_home(spec),
                motors(spec, model.independent.len(), *mobility),
                names(choice)
            )
        }),
        HomeProblem::NotIndependent { choice, .. } => Diagnostic::new(
            independent_span(spec),
            format!("the other coordinates do not follow from {independent} at home: it is singular for this choice"),
        )
        .path("independent")
        .label("not independent at home")
        .hint(format!(
            "{}a valid choice is `independent: {}`; or start from another home",
            without_home(spec),
            names(choice)
        )),
        HomeProblem::Singular { mobility, beside, remedy } => {
            home::singular(spec, model, *mobility, *beside, remedy.as_ref())
        }
    };
    Report::new(source.clone(), vec![diagnostic])
}

/// Refuses cuts whose frames differ by a half turn at home: the rows of some kinds of cut vanish
/// there too.
pub(crate) fn check_alignment_at_home(
    source: &Source,
    spec: &Spec,
    g: &mut Graph,
    frames: &Frames,
    model: &Model,
    home: &[f64],
) -> Result<(), Report> {
    let mut sink = Sink::new();
    for (cut, written) in model.cuts.iter().zip(&spec.cuts) {
        let cosines = agreement(g, frames, model, cut);
        let values = Evaluator::new(g, cosines).run(home);
        if values.iter().any(|c| *c < 0.5) {
            sink.push(
                Diagnostic::new(
                    written.span,
                    "the two frames close with a half turn between them at home",
                )
                .path(format!("cut '{}'", cut.name))
                .label("axes of A and B point in opposite directions")
                .hint(match cut.kind {
                    CutKind::Fixed | CutKind::Prismatic => {
                        "turn one of the frames by its rpy, or start from another home"
                    }
                    _ => {
                        "add pi to the first angle of the rpy of A or of B, which turns that frame half a turn \
                         about its x axis, or start from another home"
                    }
                }),
            );
        }
    }
    sink.finish(source)
}

/// Refuses `base: drop` of a parameter that is not a base parameter.
pub(crate) fn check_dropped_parameters(
    source: &Source,
    spec: &Spec,
    model: &Model,
    base: &Base,
) -> Result<(), Report> {
    let kept: Vec<&str> = base
        .parameters
        .iter()
        .map(|p| model.parameters[p.column].label.as_str())
        .collect();
    let mut sink = Sink::new();
    for label in spec
        .base
        .drop
        .iter()
        .filter(|d| !kept.contains(&d.value.as_str()))
    {
        sink.push(
            Diagnostic::new(
                label.span,
                format!("no base parameter is kept at the column {}", label.value),
            )
            .path("base, drop")
            .label("not kept")
            .hint(format!("kept are {}", kept.join(", "))),
        );
    }
    sink.finish(source)
}
