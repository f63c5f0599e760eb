//! Prints the independent checks of several robots as tables and JSON.
//!
//! Figures are rounded up to one digit. In Markdown, which is checked in, a cell is the power of
//! ten above both the figure and its bound, so that it is the same on every machine.

use std::fmt::Write as _;

use regen_codegen::explain::lines::{columns, field};
use serde::Serialize;

use super::to_json;
use crate::{Check, INDEPENDENT, Report, Verdict};

/// The independent checks of one of several robots.
#[derive(Clone, Debug)]
pub struct OfFile {
    /// The name of the robot's description.
    pub file: String,
    /// What [`independent`](crate::independent) found.
    pub report: Report,
}

/// A number rounded up to one digit.
fn rounded_up(value: f64) -> f64 {
    if !value.is_finite() || value <= 0.0 {
        return value;
    }
    // rounded in decimal, as printed: `9.5e-3` becomes `1e-2`
    let text = format!("{value:.15e}");
    let Some((mantissa, exponent)) = text.split_once('e') else {
        return value;
    };
    let mantissa: f64 = mantissa.parse().unwrap_or(9.0);
    format!("{}e{exponent}", mantissa.ceil())
        .parse()
        .unwrap_or(value)
}

fn digits(value: f64) -> String {
    if value == 0.0 {
        "0".to_owned()
    } else {
        format!("{:.0e}", rounded_up(value))
    }
}

fn cell(check: &Check) -> String {
    match check.verdict {
        Verdict::Failed => "FAILED".to_owned(),
        Verdict::Undecided => "open".to_owned(),
        Verdict::NotApplicable => check.note.clone(),
        Verdict::Passed if check.what.key == "rank" => check.note.clone(),
        Verdict::Passed => digits(check.worst),
    }
}

/// The checks of one robot in full; of several robots a table, with those that failed in full
/// below.
pub fn several_text(all: &[OfFile]) -> String {
    let mut out = String::new();
    if let [one] = all {
        let _ = writeln!(out, "{}, from {}:", one.report.robot, one.file);
        return out + &in_full(&one.report);
    }
    let head: Vec<&str> = std::iter::once("robot")
        .chain(INDEPENDENT.iter().map(|c| c.heading))
        .collect();
    let table: Vec<Vec<String>> = all
        .iter()
        .map(|one| {
            let cells = one.report.checks.iter().map(cell);
            std::iter::once(one.report.robot.clone())
                .chain(cells)
                .collect()
        })
        .collect();
    out.push_str(&columns(&head, &table));
    out.push('\n');
    for check in &INDEPENDENT {
        out.push_str(&field(check.heading, check.statement));
    }
    for one in all.iter().filter(|o| o.report.failed().count() > 0) {
        let _ = write!(out, "\n{}:\n{}", one.report.robot, in_full(&one.report));
    }
    out
}

fn in_full(report: &Report) -> String {
    let table: Vec<Vec<String>> = report
        .checks
        .iter()
        .map(|check| {
            let (figure, bound) = match check.verdict {
                Verdict::NotApplicable => (check.note.clone(), String::new()),
                _ if check.what.key == "rank" => (check.note.clone(), String::new()),
                _ => (digits(check.worst), digits(check.bound)),
            };
            let verdict = match check.verdict {
                Verdict::Passed => "ok",
                Verdict::Failed => "FAILED",
                Verdict::NotApplicable => "-",
                Verdict::Undecided => "open",
            };
            vec![
                check.what.statement.to_owned(),
                figure,
                bound,
                verdict.to_owned(),
            ]
        })
        .collect();
    columns(&["check", "figure", "bound", ""], &table)
}

/// A Markdown table with one robot per row.
pub fn several_markdown(all: &[OfFile]) -> String {
    let mut out = String::from("| robot |");
    for check in &INDEPENDENT {
        let _ = write!(out, " {} |", check.heading);
    }
    out.push_str("\n|---|");
    out.push_str(&"---|".repeat(INDEPENDENT.len()));
    out.push('\n');
    for one in all {
        let _ = write!(out, "| {} |", one.report.robot);
        for check in &one.report.checks {
            let cell = match check.verdict {
                Verdict::Passed if check.what.key == "rank" => check.note.clone(),
                Verdict::Passed => decade(check.worst.max(shown(check))),
                _ => cell(check),
            };
            let _ = write!(out, " {cell} |");
        }
        out.push('\n');
    }
    out
}

/// The number that Markdown compares with the figure: the bound; for the gap of the certificate the
/// figure itself, since the certificate is computed exactly and its bound is far away.
fn shown(check: &Check) -> f64 {
    if check.what.key == "gap" {
        check.worst
    } else {
        check.bound
    }
}

/// The power of ten above a number, as text.
fn decade(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let text = format!("{value:.15e}");
    let exponent = text.split_once('e').and_then(|t| t.1.parse::<i32>().ok());
    exponent.map_or(text, |e| format!("1e{}", e + 1))
}

/// A verdict's word in JSON.
fn word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Passed => "holds",
        Verdict::Failed => "fails",
        Verdict::NotApplicable => "absent",
        Verdict::Undecided => "open",
    }
}

#[derive(Serialize)]
struct Row<'a> {
    check: &'a str,
    verdict: &'static str,
    figure: Option<f64>,
    bound: Option<f64>,
    note: &'a str,
}

#[derive(Serialize)]
struct RobotJson<'a> {
    robot: &'a str,
    file: &'a str,
    ok: bool,
    checks: Vec<Row<'a>>,
}

/// A JSON list with one object per robot.
pub fn several_json(all: &[OfFile]) -> String {
    let objects: Vec<RobotJson<'_>> = all
        .iter()
        .map(|one| RobotJson {
            robot: &one.report.robot,
            file: &one.file,
            ok: one.report.failed().count() == 0,
            checks: one
                .report
                .checks
                .iter()
                .map(|check| {
                    let there = check.verdict != Verdict::NotApplicable;
                    Row {
                        check: check.what.key,
                        verdict: word(check.verdict),
                        figure: there.then(|| rounded_up(check.worst)),
                        bound: there.then(|| rounded_up(check.bound)),
                        note: &check.note,
                    }
                })
                .collect(),
        })
        .collect();
    to_json(&objects)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_up_to_one_digit() {
        for (value, shown) in [
            (3.2e-14, "4e-14"),
            (9.5e-3, "1e-2"),
            (2.0, "2e0"),
            (0.0, "0"),
            (4e-16, "4e-16"),
        ] {
            assert_eq!(digits(value), shown);
            assert!(rounded_up(value) >= value);
        }
        assert_eq!(digits(f64::NAN), "NaN");
        assert_eq!(
            (decade(3e-14), decade(9.9e-3)),
            ("1e-13".into(), "1e-2".into())
        );
    }

    #[test]
    fn a_check_that_does_not_apply_shows_its_reason_without_figures() {
        let report = Report {
            robot: "arm".to_owned(),
            states: 1,
            checks: vec![Check::not_applicable(INDEPENDENT[0], "no loops")],
        };
        let text = in_full(&report);
        let line = text.lines().find(|l| l.contains("no loops"));
        let words: Vec<&str> = line.unwrap_or_default().split_whitespace().collect();
        assert!(words.ends_with(&["no", "loops", "-"]), "{text}");
    }
}
