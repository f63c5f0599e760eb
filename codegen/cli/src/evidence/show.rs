//! Evidence as tables and JSON.
//!
//! Figures are rounded up to one digit. In Markdown, which is kept, a cell is the power of ten that
//! both the figure and its bound stay below: the same on every machine.

use std::fmt::Write as _;

use serde::Serialize;

use crate::table;

use super::Evidence;
use super::finding::{CHECKS, Check, Finding, Verdict};

/// A number rounded up to one digit.
fn up(value: f64) -> f64 {
    if !value.is_finite() || value <= 0.0 {
        return value;
    }
    // what prints as `9.5e-3` is `1e-2`
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
        format!("{:.0e}", up(value))
    }
}

/// A robot's checks with their findings.
fn rows(evidence: &Evidence) -> impl Iterator<Item = (&'static Check, &Finding)> {
    CHECKS.iter().zip(&evidence.findings)
}

/// What failed, in words.
pub(super) fn failures(evidence: &Evidence) -> Vec<String> {
    let failed = rows(evidence).filter(|(_, f)| f.verdict == Verdict::Fails);
    failed
        .map(|(check, _)| format!("{}: {}", evidence.robot, check.title))
        .collect()
}

fn cell(check: &Check, finding: &Finding) -> String {
    match finding.verdict {
        Verdict::Fails => "FAILED".to_owned(),
        Verdict::Open => "open".to_owned(),
        Verdict::Absent => finding.word.clone(),
        Verdict::Holds if check.key == "rank" => finding.word.clone(),
        Verdict::Holds => digits(finding.figure),
    }
}

/// One robot in full, several as a table with what failed below.
pub(super) fn human(all: &[Evidence]) -> String {
    let mut out = String::new();
    if let [one] = all {
        let _ = writeln!(out, "{}, from {}:", one.robot, one.file);
        return out + &in_full(one);
    }
    let head: Vec<&str> = std::iter::once("robot")
        .chain(CHECKS.iter().map(|c| c.head))
        .collect();
    let table: Vec<Vec<String>> = all
        .iter()
        .map(|evidence| {
            let cells = rows(evidence).map(|(check, finding)| cell(check, finding));
            std::iter::once(evidence.robot.clone())
                .chain(cells)
                .collect()
        })
        .collect();
    out.push_str(&table::columns(&head, &table));
    out.push('\n');
    for check in &CHECKS {
        out.push_str(&table::field(check.head, check.title));
    }
    for evidence in all.iter().filter(|e| !failures(e).is_empty()) {
        let _ = write!(out, "\n{}:\n{}", evidence.robot, in_full(evidence));
    }
    out
}

fn in_full(evidence: &Evidence) -> String {
    let table: Vec<Vec<String>> = rows(evidence)
        .map(|(check, finding)| {
            let (figure, bound) = match finding.verdict {
                Verdict::Absent => (finding.word.clone(), String::new()),
                _ if check.key == "rank" => (finding.word.clone(), String::new()),
                _ => (digits(finding.figure), digits(finding.bound)),
            };
            let verdict = match finding.verdict {
                Verdict::Holds => "ok",
                Verdict::Fails => "FAILED",
                Verdict::Absent => "-",
                Verdict::Open => "open",
            };
            vec![check.title.to_owned(), figure, bound, verdict.to_owned()]
        })
        .collect();
    table::columns(&["check", "figure", "bound", ""], &table)
}

/// A table with one robot in a row.
pub(super) fn markdown(all: &[Evidence]) -> String {
    let mut out = String::from("| robot |");
    for check in &CHECKS {
        let _ = write!(out, " {} |", check.head);
    }
    out.push_str("\n|---|");
    out.push_str(&"---|".repeat(CHECKS.len()));
    out.push('\n');
    for evidence in all {
        let _ = write!(out, "| {} |", evidence.robot);
        for (check, finding) in rows(evidence) {
            let cell = match finding.verdict {
                Verdict::Holds if check.key == "rank" => finding.word.clone(),
                Verdict::Holds => decade(finding.figure.max(shown(check, finding))),
                _ => cell(check, finding),
            };
            let _ = write!(out, " {cell} |");
        }
        out.push('\n');
    }
    out
}

/// What Markdown shows beside the figure: the bound, but for the certificate, whose numbers are
/// exact and its bound far away.
fn shown(check: &Check, finding: &Finding) -> f64 {
    if check.key == "gap" {
        finding.figure
    } else {
        finding.bound
    }
}

/// The power of ten above a number.
fn decade(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let text = format!("{value:.15e}");
    let exponent = text.split_once('e').and_then(|t| t.1.parse::<i32>().ok());
    exponent.map_or(text, |e| format!("1e{}", e + 1))
}

#[derive(Serialize)]
struct Row<'a> {
    check: &'a str,
    verdict: Verdict,
    figure: Option<f64>,
    bound: Option<f64>,
    note: &'a str,
}

#[derive(Serialize)]
struct Json<'a> {
    robot: &'a str,
    file: &'a str,
    ok: bool,
    checks: Vec<Row<'a>>,
}

/// A list with one object per robot.
pub(super) fn json(all: &[Evidence]) -> String {
    let objects: Vec<Json<'_>> = all
        .iter()
        .map(|evidence| Json {
            robot: &evidence.robot,
            file: &evidence.file,
            ok: failures(evidence).is_empty(),
            checks: rows(evidence)
                .map(|(check, finding)| {
                    let there = finding.verdict != Verdict::Absent;
                    Row {
                        check: check.key,
                        verdict: finding.verdict,
                        figure: there.then(|| up(finding.figure)),
                        bound: there.then(|| up(finding.bound)),
                        note: &finding.word,
                    }
                })
                .collect(),
        })
        .collect();
    table::json(&objects)
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
            assert!(up(value) >= value);
        }
        assert_eq!(digits(f64::NAN), "NaN");
        assert_eq!(
            (decade(3e-14), decade(9.9e-3)),
            ("1e-13".into(), "1e-2".into())
        );
    }
}
