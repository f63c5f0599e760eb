//! Errors that take kinematics to find, reported in the spec's terms: a home that does not close,
//! independent coordinates that do not fit the mobility, cuts that close with a half turn between
//! their frames.

mod drives;

use crate::base::{self, Base};
use crate::constraints::{HomeProblem, agreement};
use crate::diag::{Diagnostic, Report, Sink, Source, Span};
use crate::kinematics::Frames;
use crate::model::{Cut, Model};
use crate::spec::Spec;
use crate::sym::Graph;
use crate::sym::eval::Evaluator;

/// The smallest gap of a cut that is told, m or rad.
const LEAST_SHOWN_GAP: f64 = 1e-6;
/// The largest number of cuts that are told with their gaps.
const MAX_SHOWN_GAPS: usize = 3;

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
    let given = if spec.independent.is_some() {
        "`independent` lists"
    } else {
        "the actuated coordinates are the default, and they are"
    };
    let independent = names(&model.independent);
    let diagnostic = match problem {
        HomeProblem::NotClosed { residual, gaps } => {
            let span = spec.home_span.unwrap_or(spec.name.span);
            Diagnostic::new(
                span,
                format!(
                    "the loops do not close from here (residual {residual:.2e}, in m and rad){}",
                    open_cuts(model, gaps)
                ),
            )
            .path("home")
            .label("start of the closure solve")
            .hint(format!(
                "the independent coordinates {independent} keep home's values and the others are solved from home's: \
                 give values close to a closed configuration, and check the cuts' frames; `regen view` shows the gaps"
            ))
        }
        HomeProblem::Mobility { mobility, choice, .. } => Diagnostic::new(
            independent_span(spec),
            format!(
                "the mechanism has {mobility} degrees of freedom at home, but {given} {} coordinates, {independent}",
                model.independent.len()
            ),
        )
        .path("independent")
        .label(format!("mobility {mobility}"))
        .hint(if *mobility == 0 {
            "it cannot move at home: a cut or a coupling is too many, or home is singular".to_owned()
        } else {
            format!("a valid choice is `independent: {}`", names(choice))
        }),
        HomeProblem::NotIndependent { choice, .. } => Diagnostic::new(
            independent_span(spec),
            format!("the other coordinates do not follow from {independent} at home: it is singular for this choice"),
        )
        .path("independent")
        .label("not independent at home")
        .hint(format!(
            "a valid choice is `independent: {}`; or start from another home",
            names(choice)
        )),
    };
    Report::new(source.clone(), vec![diagnostic])
}

/// The cuts that are open after the closure solve, the widest first, with what is open of each.
fn open_cuts(model: &Model, gaps: &[(f64, f64)]) -> String {
    let size = |&(length, angle): &(f64, f64)| length.max(angle);
    let mut open: Vec<_> = model.cuts.iter().zip(gaps).collect();
    open.retain(|(_, gap)| size(gap) > LEAST_SHOWN_GAP);
    open.sort_by(|a, b| size(b.1).total_cmp(&size(a.1)));
    let one = |&(cut, &(length, angle)): &(&Cut, &(f64, f64))| {
        let distance = format!("by {length:.3e} m");
        let turn = format!("by {:.1} degrees between its axes", angle.to_degrees());
        let what = match (length > LEAST_SHOWN_GAP, angle > LEAST_SHOWN_GAP) {
            (true, true) => format!("{distance} and {turn}"),
            (true, false) => distance,
            _ => turn,
        };
        format!("cut '{}' {what}", cut.name)
    };
    let shown: Vec<String> = open.iter().take(MAX_SHOWN_GAPS).map(one).collect();
    if shown.is_empty() {
        return String::new();
    }
    let more = open.len().saturating_sub(MAX_SHOWN_GAPS);
    let more = if more > 0 {
        format!(", and {more} more")
    } else {
        String::new()
    };
    format!(": what stays open is {}{more}", shown.join(", "))
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
                .hint("turn one of the frames by its rpy, or start from another home"),
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
