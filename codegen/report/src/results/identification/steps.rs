//! The steps of a reduction to the parameters that data determine.

use regen_codegen::explain::lines::columns;
use regen_identify::identifiability::{Feasibility, Reduction, Step};
use serde::Serialize;

/// A step of a reduction, as it is serialised.
#[derive(Clone, Debug, Serialize)]
pub struct ReductionStep {
    change: String,
    kept: Vec<String>,
    #[serde(rename = "well")]
    well_identified: usize,
    #[serde(skip)]
    is_feasible: bool,
    feasibility: String,
    condition: f64,
    residual: f64,
    other_residual: Option<f64>,
    relative_absolute: Option<f64>,
}

/// The steps of a reduction, with the labels of the parameters.
pub fn reduction_steps(reduction: &Reduction, labels: &[String]) -> Vec<ReductionStep> {
    let one = |step: &Step| ReductionStep {
        change: step.change.to_string(),
        kept: step
            .kept
            .iter()
            .filter_map(|k| labels.get(*k).cloned())
            .collect(),
        well_identified: step.well_identified,
        is_feasible: step.feasibility == Feasibility::Feasible,
        feasibility: step.feasibility.to_string(),
        condition: step.condition,
        residual: step.residual,
        other_residual: step.other_residual,
        relative_absolute: step.relative_absolute,
    };
    reduction.steps.iter().map(one).collect()
}

/// The steps as a table of text, at most 80 columns wide.
pub(super) fn reduction_text(steps: &[ReductionStep]) -> String {
    let figure = |x: Option<f64>| x.map_or_else(|| "-".to_owned(), |x| format!("{x:.3}"));
    let lines: Vec<Vec<String>> = steps
        .iter()
        .map(|step| {
            vec![
                step.change.clone(),
                step.kept.len().to_string(),
                if step.is_feasible {
                    step.well_identified.to_string()
                } else {
                    "-".to_owned()
                },
                step.feasibility.clone(),
                format!("{:.2e}", step.condition),
                figure(Some(step.residual)),
                figure(step.relative_absolute),
            ]
        })
        .collect();
    let head = ["step", "kept", "well", "physical", "cond", "rms", "eps_RA"];
    let mut out = columns(&head, &lines);
    out.push_str(
        "  rms in standard deviations of the noise; eps_RA in percent, on logs not used;\n  \
         well counted where a physical robot has the values\n",
    );
    out
}
