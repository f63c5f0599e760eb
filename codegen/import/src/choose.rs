//! Choice of independent coordinates, by the loop closure that the derivation uses.

use regen_codegen::constraints::{HomeProblem, NumericLoops, close_home, world_equations};
use regen_codegen::diag::{Diagnostic, Report, Source, Span};
use regen_codegen::functions::Symbols;
use regen_codegen::kinematics::{Frames, Geometry};
use regen_codegen::sym::Graph;
use regen_codegen::{model, spec};

/// Result of the test of a choice of independent coordinates.
#[derive(Clone, Debug)]
pub(crate) enum Verdict {
    /// All other coordinates follow from the chosen ones.
    Valid,
    /// They do not; these coordinates are a choice from which they do.
    Choose(Vec<String>),
}

/// Tests the independent coordinates of a spec, which are the actuated ones if it names none.
///
/// # Errors
/// If the spec is invalid, its home does not close, or the mechanism cannot move at home.
pub(crate) fn test_independent(text: &str) -> Result<Verdict, Report> {
    let source = Source::new("imported spec", text);
    let spec = spec::parse(&source)?;
    let model = model::build(&spec);
    let mut g = Graph::new();
    let _ = Symbols::new(&mut g, &model);
    let frames = Frames::new(&mut g, &model, Geometry::Values);
    let world = world_equations(&mut g, &frames, &model, None);
    let loops = NumericLoops::new(&g, &world, &model);
    let names = |which: Vec<usize>| -> Vec<String> {
        let coordinates = which.into_iter().filter_map(|c| model.coordinates.get(c));
        coordinates.map(|c| c.name.clone()).collect()
    };
    match close_home(&loops, &model) {
        Ok(_) => Ok(Verdict::Valid),
        Err(HomeProblem::Mobility {
            mobility, choice, ..
        }) if mobility > 0 => Ok(Verdict::Choose(names(choice))),
        Err(HomeProblem::NotIndependent { choice, .. }) => Ok(Verdict::Choose(names(choice))),
        Err(problem) => {
            let (message, hint) = match problem {
                HomeProblem::NotClosed { residual, .. } => (
                    format!("the loops do not close (residual {residual:.2e}, in m and rad)"),
                    "check the frames of the cuts, and give `home` close to a closed configuration",
                ),
                _ => (
                    "the mechanism cannot move at home".to_owned(),
                    "a cut or a coupling is too many, or home is singular",
                ),
            };
            let at = text.find("\ncuts:").map_or(0, |at| at + 1);
            let diagnostic = Diagnostic::new(Span::new(at, at + 5), message).hint(hint);
            Err(Report::new(source.clone(), vec![diagnostic]))
        }
    }
}
