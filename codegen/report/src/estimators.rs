//! The adopted model beside least squares.

use regen_identify::files::{LeastSquaresRow, ParameterFile};

use crate::page::{escaped, four, interval, label, section, table};

/// The section of the page; empty where the adopted model is least squares.
pub(super) fn html(file: &ParameterFile) -> String {
    let row = |least: &LeastSquaresRow| {
        let own = file.parameters.iter().find(|p| p.label == least.label)?;
        // without a standard deviation, the difference cannot be expressed in deviations
        let moved = Some((own.value - least.value) / least.sigma).filter(|x| x.is_finite());
        Some(vec![
            label(&least.label),
            four(own.value),
            four(least.value),
            escaped(&least.unit),
            four(least.sigma),
            interval([least.low, least.high]),
            moved.map_or_else(|| "–".to_owned(), four),
        ])
    };
    let rows: Vec<Vec<String>> = file.least_squares.iter().filter_map(row).collect();
    if rows.is_empty() {
        return String::new();
    }
    let head = [
        "parameter",
        "adopted",
        "least squares",
        "unit",
        "σ",
        "interval",
        "difference, σ",
    ];
    let caption = format!(
        "The adopted model “{}” beside least squares on the same logs, with the deviations and \
         intervals of least squares",
        escaped(&file.method)
    );
    section("estimators", "Estimators", &table(&caption, &head, &rows))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn differences_are_counted_in_deviations_of_least_squares_to_either_side() {
        let adopted = |label: &str, value: f64| {
            format!(
                r#"{{"label": "{label}", "combination": "{label}", "unit": "kg", "value": {value},
                    "sigma": null, "sigma_percent": null, "low": null, "high": null,
                    "status": "well"}}"#
            )
        };
        let least = |label: &str, value: f64, sigma: &str| {
            format!(
                r#"{{"label": "{label}", "unit": "kg", "value": {value}, "sigma": {sigma},
                    "sigma_white": null, "low": null, "high": null}}"#
            )
        };
        let text = format!(
            r#"{{"robot": "arm", "model": "", "method": "feasible", "confidence": 0.95,
                "parameters": [{}, {}, {}], "least_squares": [{}, {}, {}]}}"#,
            adopted("m(1)", 5.0),
            adopted("m(2)", 5.0),
            adopted("m(3)", 5.0),
            least("m(1)", 4.0, "0.4"),
            least("m(2)", 6.0, "0.5"),
            least("m(3)", 4.0, "null"),
        );
        let file: ParameterFile = serde_json::from_str(&text).unwrap();
        let page = html(&file);
        let last: Vec<&str> = page
            .lines()
            .filter(|line| line.starts_with("<tr><td "))
            .filter_map(|line| {
                line.strip_suffix("</td></tr>")?
                    .rsplit_once('>')
                    .map(|row| row.1)
            })
            .collect();
        assert_eq!(last, ["2.500", "-2.000", "–"], "{page}");
        let alone = ParameterFile {
            least_squares: Vec::new(),
            ..file
        };
        assert_eq!(html(&alone), "");
    }
}
