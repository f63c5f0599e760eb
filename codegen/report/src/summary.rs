//! What was identified, how and from what, in short.

use std::fmt::Write as _;

use regen_identify::status;

use crate::identified::Content;
use crate::mechanics;
use crate::page::{escaped, section};

/// The section of the page.
pub(super) fn html(report: &Content<'_>) -> String {
    let info = report.model.info();
    let names = |of: &[usize]| {
        let names = of.iter().filter_map(|c| info.coordinates.get(*c).copied());
        names.map(escaped).collect::<Vec<_>>().join(", ")
    };
    let counted = status::counted(report.file.parameters.iter().map(|p| p.status));
    let mut rows = vec![
        (
            "Independent coordinates",
            format!(
                "{} of {}: {}",
                info.dof(),
                info.coordinates.len(),
                names(info.independent)
            ),
        ),
        ("Actuated", names(info.actuated)),
        ("Bodies", info.bodies.len().to_string()),
        (
            "Loops",
            match info.cuts.len() {
                0 => "none".to_owned(),
                n => format!(
                    "{n}, cut at {}",
                    info.cuts
                        .iter()
                        .map(|c| escaped(c.name))
                        .collect::<Vec<_>>()
                        .join(", ")
                ),
            },
        ),
        (
            "Parameters",
            format!(
                "{}, of which {} base parameters count: {counted}",
                info.parameters.len(),
                report.model.base_info().base.len()
            ),
        ),
        ("Method", escaped(&report.file.method)),
        ("Derivatives", escaped(&report.method)),
    ];
    drop(rows.splice(4..4, mechanics::rows(report)));
    if let Some(text) = &report.file.feasibility {
        rows.push(("Feasibility", escaped(text)));
    }
    if let Some(gap) = report.file.gap {
        let words = if gap > 0.0 {
            format!("the objective is at most {gap:.1e} of itself above the optimum")
        } else {
            "none: no constraint is active".to_owned()
        };
        rows.push(("Optimality gap", words));
    }
    for errors in &report.errors {
        let title = if errors.used {
            "eps<sub>RA</sub>"
        } else {
            "eps<sub>RA</sub>, validation"
        };
        rows.push((
            title,
            format!("{:.3} % on {}", errors.all, escaped(&errors.file)),
        ));
    }
    rows.push((
        "Digest of the model",
        format!("<code>{}</code>", escaped(&report.file.model)),
    ));
    rows.extend(provenance(report));
    let mut out = String::new();
    if let Some(text) = &report.robot.description {
        let _ = writeln!(out, "<p class=\"lead\">{}</p>", escaped(text));
    }
    out.push_str("<dl>\n");
    for (title, text) in rows {
        let _ = writeln!(out, "<dt>{title}</dt><dd>{text}</dd>");
    }
    out.push_str("</dl>\n");
    out.push_str(&suspicions(report));
    section("summary", "Model", &out)
}

/// Where the values are from.
fn provenance(report: &Content<'_>) -> Vec<(&'static str, String)> {
    let file = report.file;
    let mut rows = Vec::new();
    if !file.logs.is_empty() {
        let names = file.logs.iter().map(|name| escaped(name));
        rows.push(("Identified from", names.collect::<Vec<_>>().join(", ")));
    }
    if let Some(date) = &file.date {
        rows.push(("Date", escaped(date)));
    }
    rows.push(("Made by", format!("regen {}", env!("CARGO_PKG_VERSION"))));
    if let Some(command) = report.command {
        // an option is not broken behind its hyphens
        let words = command
            .split(' ')
            .map(|word| format!("<span>{}</span>", escaped(word)));
        let words: Vec<String> = words.collect();
        rows.push(("Command", format!("<code>{}</code>", words.join(" "))));
    }
    rows
}

/// What looks wrong with the logs, as a list; empty where nothing does.
fn suspicions(report: &Content<'_>) -> String {
    if report.suspicions.is_empty() {
        return String::new();
    }
    let mut out =
        "<div class=\"doubt\">\n<p>The logs may have been misread:</p>\n<ul>\n".to_owned();
    for suspected in report.suspicions {
        let _ = writeln!(out, "<li>{}</li>", escaped(&suspected.to_string()));
    }
    out.push_str("</ul>\n</div>\n");
    out
}
