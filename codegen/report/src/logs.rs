//! The logs: how they are read and why, what is doubtful in them, and the samples that were not used.

use std::fmt::Write as _;

use regen_identify::data::{MissingRows, Run};
use regen_identify::session::{LeastSquaresStart, Session, from_logs};
use regen_interpreted::Interpreted;

use crate::gather::Errors;
use crate::identified::Content;
use crate::page::{escaped, section, table, terms};
use crate::results::{choice_fields, delay_fields};

/// Least squares on the logs, for what they alone tell: delays, and the noise of each effort; `None` where they
/// do not determine the parameters.
pub(super) fn least_squares(
    session: &Session<'_, Interpreted<'_>>,
    logs: &[Run],
) -> Option<LeastSquaresStart> {
    from_logs(session, &mut session.open(logs).ok()?).ok()
}

/// The section of the page.
pub(super) fn html(report: &Content<'_>) -> String {
    let mut rows = choice_fields(report.file.filter.as_ref());
    rows.extend(delay_fields(&report.delays, report.corrected, None));
    let mut out = terms(&rows);
    for errors in report.errors.iter().filter(|own| !own.doubts.is_empty()) {
        let _ = writeln!(out, "<p>In {}:</p>\n<ul>", escaped(&errors.file));
        for doubt in &errors.doubts {
            let _ = writeln!(out, "<li>{}</li>", escaped(doubt));
        }
        out.push_str("</ul>\n");
    }
    let rows: Vec<Vec<String>> = report.errors.iter().map(left_out).collect();
    let caption = "Samples: missing ones are no rows of the log, or were left out, with a bar from its start to its end \
                   that marks where; used ones gave equations; in interpolated ones an entry is no measurement; \
                   singular ones have no reduced efforts; unsettled ones are at the ends of filtered runs; resting \
                   are equations of efforts whose joints stood still";
    let head = [
        "log",
        "missing",
        "used",
        "interpolated",
        "singular",
        "unsettled",
        "resting",
    ];
    out.push_str(&table(caption, &head, &rows));
    section("logs", "Logs, and how they are read", &out)
}

fn left_out(errors: &Errors) -> Vec<String> {
    let left = &errors.left_out;
    let counts = [
        left.samples - left.bridged.min(left.samples),
        left.bridged,
        left.singular,
        left.unsettled,
        left.resting.iter().sum(),
    ];
    let counts = counts.iter().map(ToString::to_string);
    [escaped(&errors.file), missing(&errors.missing)]
        .into_iter()
        .chain(counts)
        .collect()
}

/// How many rows are missing, and where in the log.
fn missing(rows: &MissingRows) -> String {
    // one row of many stays visible
    const NARROWEST: f64 = 0.01;
    let Some(whole) = Some(rows.end - rows.start).filter(|whole| *whole > 0.0 && rows.count > 0)
    else {
        return rows.count.to_string();
    };
    let mut out = format!(
        "{}<span class=\"track\"><svg viewBox=\"0 0 1 1\" preserveAspectRatio=\"none\"><path d=\"",
        rows.count
    );
    let mut drawn = 0.0;
    for [from, to] in &rows.spans {
        let [from, to] = [from, to].map(|t| (t - rows.start) / whole);
        let to = to.max(from + NARROWEST);
        if to > drawn {
            drawn = to;
            let _ = write!(out, "M{from:.3} 0v1H{to:.3}v-1z");
        }
    }
    out + "\"/></svg></span>"
}
