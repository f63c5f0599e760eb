//! Prints the identities and the numeric path of one robot as tables and JSON.

use regen_codegen::base::Analysis;
use regen_codegen::explain::lines::{columns, paragraph};
use regen_codegen::explain::table::doubt;
use serde::Serialize;

use super::to_json;
use crate::{Check, NumericPath, Rank, Report};

/// The identities of one robot and its numeric path as tables of at most 80 columns.
///
/// - `analysis`: that of the base parameters, whose certificate is a row of the table.
pub fn one_text(report: &Report, numeric: &NumericPath, analysis: Option<&Analysis>) -> String {
    format!(
        "{}\n{}\n{}",
        paragraph(&report.robot),
        identities_text(report),
        compare_numeric(numeric, analysis)
    )
}

/// The identities as a table of at most 80 columns.
pub fn identities_text(report: &Report) -> String {
    format!(
        "verified at {} random closed states, relative errors:\n{}",
        report.states,
        identity_table(report)
    )
}

fn identity_table(report: &Report) -> String {
    let row = |check: &Check| {
        vec![
            check.what.statement.to_owned(),
            size(2, check.worst),
            size(1, check.bound),
            if check.fails() { "FAILED" } else { "ok" }.to_owned(),
        ]
    };
    let rows: Vec<Vec<String>> = report.checks.iter().map(row).collect();
    columns(&["identity", "largest", "bound", ""], &rows)
}

fn compare_numeric(numeric: &NumericPath, analysis: Option<&Analysis>) -> String {
    let mut rows: Vec<Vec<String>> = Vec::new();
    let mut row = |name: &str, columns: usize, rank: usize, kept: Option<(f64, f64)>| {
        let mut cells = vec![name.to_owned(), columns.to_string(), rank.to_string()];
        if let Some((kept, dropped)) = kept {
            let gap = match dropped {
                0.0 => String::new(),
                dropped => format!("{:.0e}", kept / dropped),
            };
            cells.extend([format!("{kept:.1e}"), format!("{dropped:.1e}"), gap]);
        }
        rows.push(cells);
    };
    let numbers = |r: Rank| Some((r.last_kept, r.first_dropped));
    let reduced_columns = numeric
        .reduced
        .as_ref()
        .map_or(numeric.columns, |r| r.columns);
    if let Some(Ok(c)) = analysis.map(|a| &a.certificate) {
        let kept = Some((c.smallest_pivot, c.largest_remainder));
        row("certificate", c.columns, c.rank, kept);
    }
    row(
        "SVD",
        numeric.columns,
        numeric.svd.count,
        numbers(numeric.svd),
    );
    row(
        "QR with pivoting",
        numeric.columns,
        numeric.qr.count,
        numbers(numeric.qr),
    );
    row("analytic", reduced_columns, numeric.analytic, None);
    if let Some(reduced) = &numeric.reduced {
        row(
            "SVD",
            reduced_columns,
            reduced.svd.count,
            numbers(reduced.svd),
        );
        row(
            "QR with pivoting",
            reduced_columns,
            reduced.qr.count,
            numbers(reduced.qr),
        );
    }
    let mut out = paragraph(&format!(
        "base parameters beside the numeric path, {} random closed states, {} rows:",
        numeric.report.states, numeric.rows
    ));
    let head = [
        "rank by",
        "columns",
        "rank",
        "last kept",
        "first dropped",
        "gap",
    ];
    out.push_str(&columns(&head, &rows));
    if numeric.is_doubtful() {
        out.push('\n');
        out.push_str(&paragraph(
            "Double precision leaves a doubt: the first number dropped is more than rounding, or no \
             gap stands out. A rank found so is not held against the analytic one.",
        ));
    }
    out.push('\n');
    out.push_str(&identity_table(&numeric.report));
    if let Some(why) = analysis.and_then(doubt) {
        out.push('\n');
        out.push_str(&paragraph(&format!("INCOMPLETE: {why}.")));
    }
    out
}

/// A check as it is serialised.
#[derive(Serialize)]
pub struct CheckJson {
    name: &'static str,
    /// The largest error; NaN (`null` in JSON) where it could not be evaluated.
    largest: f64,
    bound: f64,
    ok: bool,
}

/// The checks of a report, to be serialised.
pub fn checks(report: &Report) -> Vec<CheckJson> {
    let json = |check: &Check| CheckJson {
        name: check.what.statement,
        largest: check.worst,
        bound: check.bound,
        ok: !check.fails(),
    };
    report.checks.iter().map(json).collect()
}

#[derive(Serialize)]
struct OneJson<'a> {
    version: u32,
    robot: &'a str,
    ok: bool,
    failed: &'a [&'a str],
    states: usize,
    checks: Vec<CheckJson>,
    base: NumericJson,
}

#[derive(Serialize)]
struct NumericJson {
    states: usize,
    rows: usize,
    columns: usize,
    certificate: Option<usize>,
    analytic: usize,
    svd: RankJson,
    qr: RankJson,
    reduced: Option<ReducedJson>,
    doubt: bool,
    checks: Vec<CheckJson>,
}

#[derive(Serialize)]
struct ReducedJson {
    columns: usize,
    svd: RankJson,
    qr: RankJson,
}

#[derive(Serialize)]
struct RankJson {
    rank: usize,
    last_kept: f64,
    first_dropped: f64,
    certain: bool,
}

impl From<Rank> for RankJson {
    fn from(found: Rank) -> Self {
        Self {
            rank: found.count,
            last_kept: found.last_kept,
            first_dropped: found.first_dropped,
            certain: found.certain,
        }
    }
}

/// The statements that were found false.
fn failed<'a>(
    report: &'a Report,
    numeric: &'a NumericPath,
) -> impl Iterator<Item = &'static str> + 'a {
    report.failed().chain(numeric.report.failed())
}

/// The identities of one robot and its numeric path as JSON.
pub fn one_json(report: &Report, numeric: &NumericPath) -> String {
    let failed: Vec<&str> = failed(report, numeric).collect();
    to_json(&OneJson {
        version: 1,
        robot: &report.robot,
        ok: failed.is_empty(),
        failed: &failed,
        states: report.states,
        checks: checks(report),
        base: NumericJson {
            states: numeric.report.states,
            rows: numeric.rows,
            columns: numeric.columns,
            certificate: numeric.certificate,
            analytic: numeric.analytic,
            svd: numeric.svd.into(),
            qr: numeric.qr.into(),
            reduced: numeric.reduced.map(|r| ReducedJson {
                columns: r.columns,
                svd: r.svd.into(),
                qr: r.qr.into(),
            }),
            doubt: numeric.is_doubtful(),
            checks: checks(&numeric.report),
        },
    })
}

/// A number in exponent notation with `digits` significant digits; zero prints as `0`.
fn size(digits: usize, value: f64) -> String {
    if value == 0.0 {
        "0".to_owned()
    } else {
        format!("{value:.*e}", digits.max(1) - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_printed_with_their_exponent() {
        assert_eq!(size(2, 0.0), "0");
        assert_eq!(size(2, 1.23e-16), "1.2e-16");
        assert_eq!(size(1, 1.0), "1e0");
    }
}
