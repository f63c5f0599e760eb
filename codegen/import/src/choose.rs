//! Chooses independent coordinates with the loop closure that the derivation uses.

use regen_codegen::Mechanism;
use regen_codegen::constraints::{HomeProblem, NumericLoops, close_home, world_equations};
use regen_codegen::diag::{Diagnostic, Report, Source, Span, rounded};
use regen_codegen::functions::Symbols;
use regen_codegen::kinematics::{Frames, Geometry};
use regen_codegen::model::Model;
use regen_codegen::sym::Graph;

/// The largest number of closed states that are proposed.
const MAX_PROPOSALS: usize = 3;

/// Result of the test of a choice of independent coordinates.
#[derive(Clone, Debug)]
pub(crate) enum Verdict {
    /// All other coordinates follow from the chosen ones.
    Valid,
    /// They do not; these coordinates are a choice from which they do.
    Choose(Vec<String>),
}

/// Tests the independent coordinates of a spec, which are the actuated ones if it names none.
/// `home_option` is how errors refer to the initial values for the closure.
///
/// # Errors
/// If the spec is invalid, its home does not close, or the mechanism cannot move at home.
pub(crate) fn test_independent(text: &str, home_option: &str) -> Result<Verdict, Report> {
    let source = Source::new("imported spec", text);
    let mechanism = Mechanism::open(&source)?;
    let model = mechanism.model();
    let mut g = Graph::new();
    let _ = Symbols::new(&mut g, model);
    let frames = Frames::new(&mut g, model, Geometry::Values);
    let world = world_equations(&mut g, &frames, model, None);
    let loops = NumericLoops::new(&g, &world, model);
    let names = |which: Vec<usize>| -> Vec<String> {
        let coordinates = which.into_iter().filter_map(|c| model.coordinates.get(c));
        coordinates.map(|c| c.name.clone()).collect()
    };
    match close_home(&loops, model) {
        Ok(_) => Ok(Verdict::Valid),
        Err(HomeProblem::Mobility {
            mobility, choice, ..
        }) if mobility > 0 => Ok(Verdict::Choose(names(choice))),
        Err(HomeProblem::NotIndependent { choice, .. }) => Ok(Verdict::Choose(names(choice))),
        Err(problem) => {
            let (message, hint) = match &problem {
                HomeProblem::NotClosed { near, .. } => {
                    not_closed(&mechanism, &problem, near, home_option)
                }
                HomeProblem::Singular { remedy, .. } => {
                    let (message, hint) = described(&mechanism, &problem);
                    let hint = remedy.as_ref().map_or(hint, |remedy| {
                        let home = values(model, &remedy.home);
                        format!("draw it in another pose, or give `{home_option} {home}` (tried)")
                    });
                    (message, hint)
                }
                _ => (
                    "the mechanism cannot move at home".to_owned(),
                    "a cut or a coupling is too many, or home is singular".to_owned(),
                ),
            };
            let at = text.find("\ncuts:").map_or(0, |at| at + 1);
            let diagnostic = Diagnostic::new(Span::new(at, at + 5), message).hint(hint);
            Err(Report::new(source.clone(), vec![diagnostic]))
        }
    }
}

/// The message and the hint for loops that do not close: the gaps of the cuts, and values from which
/// the loops close.
fn not_closed(
    mechanism: &Mechanism,
    problem: &HomeProblem,
    near: &[Vec<f64>],
    home_option: &str,
) -> (String, String) {
    let (message, hint) = described(mechanism, problem);
    let states = near.iter().take(MAX_PROPOSALS);
    let states =
        states.map(|state| format!("`{home_option} {}`", values(mechanism.model(), state)));
    let states: Vec<String> = states.collect();
    if states.is_empty() {
        return (message, hint);
    }
    (
        message,
        format!("the loops close from {}", states.join(", or ")),
    )
}

/// The message and the hint of a problem at home, as for a spec.
fn described(mechanism: &Mechanism, problem: &HomeProblem) -> (String, String) {
    let report = mechanism.report(problem);
    let first = report.diagnostics.into_iter().next();
    first.map_or_else(Default::default, |d| {
        (d.message, d.hint.unwrap_or_default())
    })
}

/// The coordinates that are not 0 in a state, as `NAME=VALUE,NAME=VALUE`.
fn values(model: &Model, state: &[f64]) -> String {
    let all = model.coordinates.iter().zip(state).enumerate();
    let joints = all.filter(|(c, _)| !model.drives.contains(c));
    let values = joints.map(|(_, (coordinate, value))| (&coordinate.name, rounded(*value)));
    let values = values.filter(|(_, value)| value != "0");
    let words: Vec<String> = values
        .map(|(name, value)| format!("{name}={value}"))
        .collect();
    words.join(",")
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    /// Two links from the base, whose ends are pinned together where they meet.
    const TRIANGLE: &str = "\
name: triangle
limbs:
  - name: left
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true}
  - name: right
    base: {xyz: [1, 0, 0]}
    joints:
      - {name: q2, type: revolute, body: 2}
cuts:
  - {name: pin, joint: revolute, between: [{body: 1, xyz: [1, 0, 0]}, {body: 2, xyz: [1, 0, 0]}]}
home: {q1: pi/3, q2: 2*pi/3}
";

    #[test]
    fn a_mechanism_that_cannot_move_has_no_choice_of_coordinates() {
        let error = test_independent(TRIANGLE, "--home").unwrap_err();
        let all = error.to_string();
        assert!(all.contains("the mechanism cannot move at home"), "{all}");
    }
}
