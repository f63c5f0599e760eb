//! The steps of `regen identify --reduce`, as JSON and as a table.

use regen_identify::identifiability::{Reduction, Step};
use serde::Serialize;

/// A step in JSON.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct StepJson {
    pub(crate) change: String,
    pub(crate) kept: Vec<String>,
    pub(crate) well: usize,
    pub(crate) feasibility: String,
    pub(crate) condition: f64,
    pub(crate) residual: f64,
    pub(crate) other_residual: Option<f64>,
    pub(crate) relative_absolute: Option<f64>,
}

/// The steps in JSON.
pub(crate) fn json(reduction: &Reduction, labels: &[String]) -> Vec<StepJson> {
    let one = |step: &Step| StepJson {
        change: step.change.to_string(),
        kept: step
            .kept
            .iter()
            .filter_map(|k| labels.get(*k).cloned())
            .collect(),
        well: step.well,
        feasibility: step.feasibility.to_string(),
        condition: step.condition,
        residual: step.residual,
        other_residual: step.other_residual,
        relative_absolute: step.relative_absolute,
    };
    reduction.steps.iter().map(one).collect()
}

/// The steps for people, in 80 columns.
pub(crate) fn to_text(steps: &[StepJson]) -> String {
    let figure = |x: Option<f64>| x.map_or_else(|| "-".to_owned(), |x| format!("{x:.3}"));
    let lines: Vec<Vec<String>> = steps
        .iter()
        .map(|step| {
            vec![
                step.change.clone(),
                step.kept.len().to_string(),
                step.well.to_string(),
                step.feasibility.clone(),
                format!("{:.2e}", step.condition),
                figure(Some(step.residual)),
                figure(step.relative_absolute),
            ]
        })
        .collect();
    let head = ["step", "kept", "well", "physical", "cond", "rms", "eps_RA"];
    let mut out = crate::table::columns(&head, &lines);
    out.push_str("  rms in standard deviations of the noise; eps_RA in percent, on --against\n");
    out
}
