//! The result of an identification as tables.

use std::fmt::Write as _;

use regen_codegen::explain::lines::{columns, field, item};
use regen_identify::files::ParameterFile;
use regen_identify::identify::Delays;
use regen_identify::session::LogError;
use regen_identify::status::{self, Status};
use regen_identify::text::{counted, figure, figure_of};

use super::delays::delays_text;
use super::models::{error_percent, models_text};
use super::steps::reduction_text;
use super::{BiasRemedy, Identification, Simulated, Summary, filter_text, resting};

/// The largest relative standard deviation that is printed, in percent; a larger one is printed as
/// `>1000`.
const MAX_PRINTED_PERCENT: f64 = 1000.0;

/// The result of an identification as tables of at most 80 columns.
pub fn identification_text(found: &Identification) -> String {
    let (file, summary) = (&found.file, &found.summary);
    let mut out = format!(
        "{}, {} from {}\n",
        file.robot,
        counted(file.parameters.len(), "parameter", "parameters"),
        counted(summary.equations, "equation", "equations")
    );
    let condition = format!(
        "{}, with columns scaled {}",
        figure(summary.condition),
        figure(summary.scaled_condition)
    );
    out.push_str(&field("model", &file.method));
    out.push_str(&field("equations", &summary.kind));
    out.push_str(&field("condition", &condition));
    if let Some(error) = summary.relative_absolute {
        out.push_str(&field("eps_RA", &format!("{error:.3} %")));
    }
    if summary.singular > 0 {
        let text = counted(summary.singular, "state", "states") + " left out";
        out.push_str(&field("singular", &text));
    }
    if let Some(left) = &summary.left_out {
        out.push_str(&resting(left));
    }
    if !summary.unmeasured.is_empty() {
        let names = summary.unmeasured.join(", ");
        out.push_str(&field(
            "not measured",
            &format!("the equations of {names} are left out"),
        ));
    }
    out.push_str(&filter_text(file.filter.as_ref()));
    let corrected = summary
        .relative_absolute
        .zip(summary.relative_absolute_without_delays);
    // delays of a model that does not explain the efforts are those of its mistakes
    let none = Delays::default();
    let delays = if summary.explains_all() {
        &summary.delays
    } else {
        &none
    };
    out.push_str(&delays_text(delays, &summary.corrected_delays, corrected));
    if let Some(instruments) = &summary.instruments {
        out.push_str(&instruments.to_text());
    }
    if let Some(simulated) = &summary.simulated {
        out.push_str(&simulated.to_text());
    }
    out.push('\n');
    out.push_str(&efforts(summary));
    out.push('\n');
    out.push_str(&parameters(file, summary.bias_remedy.as_ref()));
    out.push_str(&loads(file));
    if let Some(simulated) = &summary.simulated {
        out.push_str(&simulated.to_tables());
    }
    if !file.physical.is_empty() || !file.friction.is_empty() {
        out.push('\n');
        out.push_str(&physical(file));
    }
    if !file.least_squares.is_empty() {
        out.push_str("\n  the least-squares estimates, for comparison\n");
        out.push_str(&least_squares(file));
    }
    if !summary.reduction.is_empty() {
        out.push_str("\n  the reduction, step by step\n");
        out.push_str(&reduction_text(&summary.reduction));
    }
    if !summary.models.is_empty() {
        out.push('\n');
        for model in &summary.models {
            out.push_str(&item(&format!("{}: {}", model.name, model.feasibility)));
        }
        let rows: Vec<(String, &[LogError])> = summary
            .models
            .iter()
            .map(|m| (m.name.clone(), m.logs.as_slice()))
            .collect();
        if summary.models.iter().any(|m| !m.logs.is_empty()) {
            out.push('\n');
            out.push_str(&models_text("eps_RA in percent", &rows));
        }
    }
    if !summary.cross.is_empty() {
        out.push_str("\n  each log predicted by parameters from the others\n");
        let lines: Vec<Vec<String>> = summary
            .cross
            .iter()
            .map(|c| vec![c.file.clone(), error_percent(c.relative_absolute)])
            .collect();
        out.push_str(&columns(&["log", "eps_RA %"], &lines));
    }
    out
}

fn efforts(json: &Summary) -> String {
    let lines: Vec<Vec<String>> = json
        .efforts
        .iter()
        .map(|e| {
            let mut line = vec![e.name.clone(), e.equations.to_string(), figure(e.sigma)];
            if let Some(error) = &e.error {
                line.push(error_percent(error.relative_absolute));
                line.push(figure(error.largest));
                line.push(match error.is_correlated() {
                    None => "unknown".to_owned(),
                    Some(true) => "correlated".to_owned(),
                    Some(false) => "white".to_owned(),
                });
            }
            line
        })
        .collect();
    let signal = match json.simulated {
        Some(Simulated::Response(_)) => "signal",
        _ => "effort",
    };
    let head = [
        signal,
        "equations",
        "sigma",
        "eps_RA %",
        "largest",
        "residuals",
    ];
    let known = json.efforts.iter().any(|e| e.error.is_some());
    columns(if known { &head } else { &head[..3] }, &lines)
}

fn parameters(file: &ParameterFile, remedy: Option<&BiasRemedy>) -> String {
    let lines: Vec<Vec<String>> = file
        .parameters
        .iter()
        .map(|p| {
            vec![
                p.label.clone(),
                figure(p.value),
                p.unit.clone(),
                deviation(p.sigma),
                percent(p.sigma_percent),
                percent(p.share),
                p.status.word().to_owned(),
            ]
        })
        .collect();
    let head = [
        "parameter",
        "value",
        "unit",
        "sigma",
        "sigma %",
        "share %",
        "status",
    ];
    let mut out = columns(&head, &lines);
    let statuses = status::counted(file.parameters.iter().map(|p| p.status));
    let parameters = counted(file.parameters.len(), "parameter", "parameters");
    let _ = writeln!(out, "\n  {parameters}: {statuses}");
    if !file.deviations.is_empty() {
        out.push_str(&field("sigma", &file.deviations));
    }
    let known = "rms of the parameter's column times its value over rms of the efforts";
    out.push_str(&field("share", known));
    if file.parameters.iter().any(|p| p.status == Status::Zero) {
        let text = "may be zero, and its sigma is below 1 % of the efforts; or no value within its \
                    uncertainty is above 0.01 % of them";
        out.push_str(&field("zero", text));
    }
    if file.parameters.iter().any(|p| p.status == Status::Biased) {
        let text = "noise of the measured motion, or a delay that is not corrected, may move it by more than all \
                    other errors do; its sigma \
                    contains that";
        out.push_str(&field("biased", text));
        if let Some(remedy) = remedy {
            out.push_str(&field("", &remedy.to_text()));
        }
    }
    out
}

/// Tables of the gains of drives and of the payloads.
fn loads(file: &ParameterFile) -> String {
    let mut out = String::new();
    let relative = |value: f64, sigma: f64| percent(100.0 * sigma / value.abs());
    if !file.gains.is_empty() {
        let lines: Vec<Vec<String>> = file
            .gains
            .iter()
            .map(|gain| {
                vec![
                    gain.effort.clone(),
                    figure(gain.value),
                    gain.unit.clone(),
                    deviation(gain.sigma),
                    relative(gain.value, gain.sigma),
                ]
            })
            .collect();
        out.push('\n');
        out.push_str(&columns(
            &["gain", "value", "unit", "sigma", "sigma %"],
            &lines,
        ));
    }
    for payload in &file.payloads {
        let lines: Vec<Vec<String>> = payload
            .values
            .iter()
            .map(|row| {
                let (sigma, part) = if row.known {
                    ("given".to_owned(), "-".to_owned())
                } else {
                    (deviation(row.sigma), relative(row.value, row.sigma))
                };
                let value = figure(row.value);
                vec![row.name.clone(), value, row.unit.clone(), sigma, part]
            })
            .collect();
        let title = format!("payload {}", payload.body);
        out.push('\n');
        out.push_str(&columns(
            &[&title, "value", "unit", "sigma", "sigma %"],
            &lines,
        ));
        if lines.len() < 10 {
            let text = "values that are not listed have no effect of their own on the efforts";
            out.push_str(&field("", text));
        }
    }
    out
}

/// A standard deviation; a dash where it is unknown.
fn deviation(sigma: f64) -> String {
    if sigma.is_finite() {
        figure_of(3, sigma)
    } else {
        "-".to_owned()
    }
}

/// A percentage with two decimals; a dash where it is unknown.
fn percent(value: f64) -> String {
    if !value.is_finite() {
        "-".to_owned()
    } else if value > MAX_PRINTED_PERCENT {
        format!(">{MAX_PRINTED_PERCENT:.0}")
    } else {
        format!("{value:.2}")
    }
}

/// The least-squares estimates where another model was adopted, and its distance from them in
/// standard deviations.
fn least_squares(file: &ParameterFile) -> String {
    let lines: Vec<Vec<String>> = file
        .least_squares
        .iter()
        .map(|row| {
            let adopted = file.parameters.iter().find(|p| p.label == row.label);
            let moved = adopted.map_or(f64::NAN, |p| (p.value - row.value) / row.sigma);
            vec![
                row.label.clone(),
                figure(row.value),
                row.unit.clone(),
                deviation(row.sigma),
                if moved.is_finite() {
                    // the sum of 0 and a rounded -0 has no sign
                    format!("{:.1}", (10.0 * moved).round() / 10.0 + 0.0)
                } else {
                    "-".to_owned()
                },
            ]
        })
        .collect();
    let head = ["parameter", "value", "unit", "sigma", "moved by sigmas"];
    columns(&head, &lines)
}

/// The physical parameters and the friction of the adopted model.
fn physical(file: &ParameterFile) -> String {
    let known = file.physical.iter().any(|p| p.sigma.is_finite());
    let rows = file.physical.iter();
    let lines: Vec<Vec<String>> = rows
        .map(|p| {
            let mut line = vec![p.label.clone(), figure(p.value), p.unit.clone()];
            if known {
                line.push(deviation(p.sigma));
            }
            line
        })
        .collect();
    let head = ["physical parameter", "value", "unit", "sigma"];
    let mut out = String::new();
    if !lines.is_empty() {
        out = columns(if known { &head } else { &head[..3] }, &lines);
    }
    for row in &file.friction {
        let coefficients: Vec<String> = row
            .coefficients
            .iter()
            .map(|(symbol, value)| {
                let own = row.intervals.get(symbol).filter(|i| i.sigma.is_finite());
                let sigma =
                    own.map_or_else(String::new, |i| format!(" +- {}", figure_of(3, i.sigma)));
                format!("{symbol} {}{sigma}", figure(*value))
            })
            .collect();
        let name = format!("{} ({})", row.joint, row.law);
        out.push_str(&field(&name, &coefficients.join(", ")));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviations_that_say_nothing_are_not_printed_as_figures() {
        assert_eq!(percent(14.996), "15.00");
        assert_eq!(percent(99_999.0), ">1000");
        assert_eq!(percent(f64::INFINITY), "-");
        assert_eq!(percent(f64::NAN), "-");
        assert_eq!(deviation(f64::NAN), "-");
        assert_eq!(deviation(0.012_345), "0.0123");
    }
}
