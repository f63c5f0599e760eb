//! What `regen identify` prints for people.

use std::fmt::Write as _;

use crate::identify::Json;
use crate::predicted::{self, OnLog};
use crate::{reduce, table};

/// A probability of white residuals below which they are called correlated.
const WHITE: f64 = 0.01;

/// The result as tables of 80 columns.
pub(crate) fn human(json: &Json) -> String {
    let mut out = format!(
        "{}, {} parameters from {} equations\n",
        json.robot,
        json.parameters.len(),
        json.equations
    );
    let condition = format!(
        "{}, with columns scaled {}",
        table::figure(json.condition),
        table::figure(json.scaled_condition)
    );
    out.push_str(&table::field("equations", &json.kind));
    out.push_str(&table::field("condition", &condition));
    if let Some(error) = json.relative_absolute {
        out.push_str(&table::field("eps_RA", &format!("{error:.3} %")));
    }
    if json.singular > 0 {
        let text = format!("{} states left out", json.singular);
        out.push_str(&table::field("singular", &text));
    }
    out.push('\n');
    out.push_str(&efforts(json));
    out.push('\n');
    out.push_str(&parameters(json));
    if !json.reduction.is_empty() {
        out.push_str("\n  the reduction, step by step\n");
        out.push_str(&reduce::human(&json.reduction));
    }
    if !json.models.is_empty() {
        out.push('\n');
        for model in &json.models {
            out.push_str(&table::item(&format!(
                "{}: {}",
                model.name, model.feasibility
            )));
        }
        let rows: Vec<(String, &[OnLog])> = json
            .models
            .iter()
            .map(|m| (m.name.clone(), m.logs.as_slice()))
            .collect();
        if json.models.iter().any(|m| !m.logs.is_empty()) {
            out.push('\n');
            out.push_str(&predicted::human("eps_RA in percent", &rows));
        }
    }
    if !json.physical.is_empty() {
        out.push('\n');
        out.push_str(&physical(json));
    }
    if !json.cross.is_empty() {
        out.push_str("\n  each log predicted by parameters from the others\n");
        let lines: Vec<Vec<String>> = json
            .cross
            .iter()
            .map(|c| vec![c.file.clone(), format!("{:.3}", c.relative_absolute)])
            .collect();
        out.push_str(&table::columns(&["log", "eps_RA %"], &lines));
    }
    out
}

fn efforts(json: &Json) -> String {
    let lines: Vec<Vec<String>> = json
        .efforts
        .iter()
        .map(|e| {
            let mut line = vec![
                e.name.clone(),
                e.equations.to_string(),
                table::figure(e.sigma),
            ];
            if let Some(error) = &e.error {
                line.push(format!("{:.3}", error.relative_absolute));
                line.push(table::figure(error.largest));
                line.push(match error.white {
                    p if p.is_nan() => "unknown".to_owned(),
                    p if p < WHITE => "correlated".to_owned(),
                    _ => "white".to_owned(),
                });
            }
            line
        })
        .collect();
    let head = [
        "effort",
        "equations",
        "sigma",
        "eps_RA %",
        "largest",
        "residuals",
    ];
    let known = json.efforts.iter().any(|e| e.error.is_some());
    table::columns(if known { &head } else { &head[..3] }, &lines)
}

fn parameters(json: &Json) -> String {
    let lines: Vec<Vec<String>> = json
        .parameters
        .iter()
        .map(|p| {
            vec![
                p.label.clone(),
                table::figure(p.value),
                p.unit.clone(),
                table::figure(p.sigma),
                format!("{:.2}", p.sigma_percent.min(99_999.0)),
                if p.status.starts_with("well") {
                    "well"
                } else {
                    "poor"
                }
                .to_owned(),
            ]
        })
        .collect();
    let mut out = table::columns(
        &["parameter", "value", "unit", "sigma", "sigma %", "status"],
        &lines,
    );
    let well = json
        .parameters
        .iter()
        .filter(|p| p.status.starts_with("well"));
    let _ = writeln!(
        out,
        "\n  {} of {} have a relative deviation below 15 %",
        well.count(),
        json.parameters.len()
    );
    if json.bandwidth.is_some_and(|b| b > 1) {
        out.push_str("  sigma knows of the residuals' correlation in time (Newey and West)\n");
    }
    out
}

/// What the last model has beyond base parameters.
fn physical(json: &Json) -> String {
    let rows = json.physical.iter();
    let lines: Vec<Vec<String>> = rows
        .map(|p| vec![p.label.clone(), table::figure(p.value), p.unit.to_owned()])
        .collect();
    let mut out = table::columns(&["physical parameter", "value", "unit"], &lines);
    let friction = json.models.last().map_or(&[][..], |m| &m.friction);
    for row in friction {
        let coefficients: Vec<String> = row
            .coefficients
            .iter()
            .map(|(symbol, value)| format!("{symbol} {}", table::figure(*value)))
            .collect();
        let name = format!("{} ({})", row.joint, row.law);
        out.push_str(&table::field(&name, &coefficients.join(", ")));
    }
    out
}
