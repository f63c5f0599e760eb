//! The adopted model beside least squares.

use regen_identify::files::LeastSquaresRow;

use crate::identified::Content;
use crate::page::{escaped, four, interval, label, section, table};

/// The section of the page; empty where the adopted model is least squares.
pub(super) fn html(report: &Content<'_>) -> String {
    let file = report.file;
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
