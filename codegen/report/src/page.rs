//! The HTML page of a report.

use std::fmt::Write as _;

use regen_runtime::Motion;

use crate::charts::Figure;
use crate::estimators;
use crate::gather::Errors;
use crate::identified::Content;
use crate::logs;
use crate::mechanics;
use crate::residuals;
use crate::results::{Field, error_percent};
use crate::summary;
use regen_codegen::explain::table::combinations;
use regen_identify::files::ParameterRow;
use regen_identify::status::Status;

/// Escapes a text for use between HTML tags and in quotes.
pub(super) fn escaped(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;");
    text.replace('>', "&gt;").replace('"', "&quot;")
}

/// A parameter's label as HTML; a long one may break after `(` and `_` in a narrow column.
pub(super) fn label(text: &str) -> String {
    const LONG: usize = 12;
    let html = escaped(text);
    if text.len() <= LONG {
        return html;
    }
    html.replace('(', "(<wbr>").replace('_', "_<wbr>")
}

/// A number with four significant digits, with an exponent only if it is very large or small.
pub(super) fn four(value: f64) -> String {
    let size = value.abs();
    if !value.is_finite() {
        "–".to_owned()
    } else if size < 1e-15 {
        // rounding
        "0".to_owned()
    } else if (1e-3..1e5).contains(&size) {
        #[allow(clippy::cast_sign_loss, reason = "clamped")]
        let digits = (3.0 - size.log10().floor()).clamp(0.0, 6.0) as usize;
        format!("{value:.digits$}")
    } else {
        format!("{value:.3e}")
    }
}

/// The whole page of a report.
pub(super) fn html(report: &Content<'_>) -> String {
    let name = escaped(&report.robot.name);
    let mut body = String::new();
    for section in [
        summary::html(report),
        logs::html(report),
        base(report),
        motion(report),
        forces(report),
        parameters(report),
        estimators::html(report.file),
        mechanics::loads(report),
        physical(report),
        friction(report),
        residuals::html(report),
        singular(report),
        validation(report),
    ] {
        body.push_str(&section);
    }
    whole(&format!("Identification of {name}"), &body)
}

/// A self-contained page from an HTML title and an HTML body.
pub(super) fn whole(title: &str, body: &str) -> String {
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}</title>\n<link rel=\"icon\" href=\"data:,\">\n\
         <style>\n{}</style>\n</head>\n<body>\n<main>\n<h1>{title}</h1>\n\
         {body}</main>\n</body>\n</html>\n",
        include_str!("report.css")
    )
}

pub(super) fn section(id: &str, title: &str, content: &str) -> String {
    format!("<section id=\"{id}\">\n<h2>{title}</h2>\n{content}</section>\n")
}

pub(super) fn figure(figure: &Figure) -> String {
    // an SVG inside HTML needs no namespace
    let svg = figure
        .svg
        .replace(" xmlns=\"http://www.w3.org/2000/svg\"", "");
    let caption = escaped(&figure.caption);
    format!(
        "<figure id=\"{}\" role=\"img\" aria-label=\"{caption}\">\n{}\n\
         <figcaption>{caption}</figcaption>\n</figure>\n",
        figure.name,
        svg.trim_end()
    )
}

/// Labels with the texts beside them; nothing if there are none.
pub(super) fn terms(all: &[Field]) -> String {
    let mut rows: Vec<(&str, String)> = Vec::new();
    for (label, text) in all {
        match rows.last_mut() {
            Some((_, before)) if label.is_empty() => {
                let _ = write!(before, "<br>{}", escaped(text));
            }
            _ => rows.push((label, escaped(text))),
        }
    }
    let rows = rows
        .iter()
        .map(|(label, text)| format!("<dt>{label}</dt><dd>{text}</dd>\n"));
    let rows: String = rows.collect();
    if rows.is_empty() {
        return rows;
    }
    format!("<dl>\n{rows}</dl>\n")
}

/// The largest number of columns that stand side by side on a narrow screen.
const MAX_NARROW_COLUMNS: usize = 6;

/// A table, whose rows stand in several lines with the titles at their cells on a screen that is too narrow for
/// so many columns.
pub(super) fn table(caption: &str, head: &[&str], rows: &[Vec<String>]) -> String {
    let is_stacked = head.len() > MAX_NARROW_COLUMNS;
    let class = if is_stacked { " class=\"stacked\"" } else { "" };
    let mut out = format!("<table{class}>\n<caption><span>{caption}</span></caption>\n<thead><tr>");
    for title in head {
        let _ = write!(out, "<th scope=\"col\">{title}</th>");
    }
    out.push_str("</tr></thead>\n<tbody>\n");
    for row in rows {
        out.push_str("<tr>");
        for (cell, title) in row.iter().zip(head) {
            if is_stacked {
                let title = title.replace("<sub>", "").replace("</sub>", "");
                let _ = write!(out, "<td data-title=\"{title}\">{cell}</td>");
            } else {
                let _ = write!(out, "<td>{cell}</td>");
            }
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody>\n</table>\n");
    out
}

fn base(report: &Content<'_>) -> String {
    let analysis = report.robot.analysis.as_ref();
    let combinations = analysis.map_or_else(Vec::new, |a| combinations(report.robot, a));
    let rows: Vec<Vec<String>> = (combinations.iter().enumerate())
        .map(|(k, text)| vec![(k + 1).to_string(), escaped(text)])
        .collect();
    let caption = "Table 1. Base parameters: the combinations on which the forces depend";
    section(
        "base",
        "Base parameters",
        &table(caption, &["", "combination"], &rows),
    )
}

fn motion(report: &Content<'_>) -> String {
    let info = report.model.info();
    let (n, dof) = (info.coordinates.len(), info.dof());
    let ends = |values: &[f64], k: usize, width: usize| {
        let column = values.iter().skip(k).step_by(width.max(1));
        column.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], x| {
            [lo.min(*x), hi.max(*x)]
        })
    };
    let cell = |[lo, hi]: [f64; 2], limit: Option<[f64; 2]>| {
        let reached = format!("{} … {}", four(lo), four(hi));
        let Some([least, most]) = limit else {
            return reached;
        };
        let over = lo < least || hi > most;
        let class = if over { " class=\"over\"" } else { "" };
        format!(
            "<span{class}>{reached}</span><br><small>{} … {}</small>",
            four(least),
            four(most)
        )
    };
    let seen = &report.seen;
    let rows: Vec<Vec<String>> = info
        .independent
        .iter()
        .enumerate()
        .map(|(k, c)| {
            let joint = info.joints.get(*c);
            let limits = joint.map(|j| j.limits).unwrap_or_default();
            let shift = joint.is_some_and(|j| j.motion == Motion::Translation);
            vec![
                format!(
                    "{} <small>{}</small>",
                    escaped(info.coordinates.get(*c).unwrap_or(&"?")),
                    if shift { "m, N" } else { "rad, N m" }
                ),
                cell(ends(&seen.q, *c, n), limits.position),
                cell(ends(&seen.qd, *c, n), limits.velocity),
                cell(ends(&seen.qdd, *c, n), limits.acceleration),
                cell(ends(&seen.tau, k, dof), limits.effort),
            ]
        })
        .collect();
    let caption = "Reached by the independent coordinates, and below it the limits";
    let head = [
        "coordinate",
        "position",
        "velocity",
        "acceleration",
        "effort",
    ];
    let mut out = table(caption, &head, &rows);
    report.motion.iter().for_each(|f| out.push_str(&figure(f)));
    section("motion", "Motion and limits", &out)
}

fn forces(report: &Content<'_>) -> String {
    let figures: String = report.forces.iter().map(figure).collect();
    section("forces", "Forces", &figures)
}

fn parameters(report: &Content<'_>) -> String {
    let base = report.model.base_info().base;
    let rows: Vec<Vec<String>> = report
        .file
        .parameters
        .iter()
        .map(|p| {
            let place = base.iter().position(|b| b.label == p.label);
            let nominal = place.and_then(|k| report.nominal.get(k).copied().flatten());
            vec![
                format!(
                    "<span title=\"{}\">{}</span>",
                    escaped(&p.combination),
                    label(&p.label)
                ),
                four(p.value),
                escaped(&p.unit),
                four(p.sigma),
                bar(p),
                interval([p.low, p.high]),
                part(p.share),
                nominal.map_or_else(|| "–".to_owned(), four),
                match p.status {
                    Status::Poor => "<b>poor</b>".to_owned(),
                    Status::Unknown => "–".to_owned(),
                    other => other.word().to_owned(),
                },
            ]
        })
        .collect();
    let head = [
        "parameter",
        "value",
        "unit",
        "σ",
        "σ, %",
        "interval",
        "share, %",
        "nominal",
        "identified",
    ];
    let caption = format!(
        "Values of the model “{}”, with deviations and intervals of {} % confidence; nominal ones \
         are the spec's. The bars' ends are 0.1 % and 100 %. Share: the root mean square of the parameter's column times its \
         value over that of the efforts. Zero: may be zero, and what its deviation leaves open is \
         below 1 % of the efforts",
        escaped(&report.file.method),
        100.0 * report.file.confidence
    );
    let mut out = table(&caption, &head, &rows);
    if !report.file.deviations.is_empty() {
        let text = escaped(&report.file.deviations);
        let _ = writeln!(out, "<p>Deviations: {text}.</p>");
    }
    out.push_str(&figure(&report.deviations));
    section("parameters", "Parameters", &out)
}

/// The ends of a confidence interval; a dash if there is none.
pub(super) fn interval(ends: [f64; 2]) -> String {
    if ends.iter().any(|end| !end.is_finite()) {
        return "–".to_owned();
    }
    let [low, high] = ends.map(four);
    format!("{low} … {high}")
}

/// A relative standard deviation with its bar, from 0.1 to 100 percent on a logarithmic scale.
fn bar(row: &ParameterRow) -> String {
    if !row.sigma.is_finite() {
        return "–".to_owned();
    }
    let decades = (row.sigma_percent / 0.1).log10() / 3.0;
    let width = 100.0
        * if decades.is_finite() {
            decades.clamp(0.02, 1.0)
        } else {
            1.0
        };
    let class = match row.status {
        Status::Well => "well",
        Status::Zero => "zero",
        _ => "poor",
    };
    format!(
        "{}<span class=\"track\"><span class=\"{class}\" style=\"width:{width:.0}%\"></span></span>",
        part(row.sigma_percent)
    )
}

/// A percentage as text; a dash if it is unknown.
fn part(percent: f64) -> String {
    if !percent.is_finite() {
        "–".to_owned()
    } else if percent > 1000.0 {
        "&gt; 1000".to_owned()
    } else {
        format!("{percent:.2}")
    }
}

/// The parameters of all bodies and joints, if the model has physical parameters.
fn physical(report: &Content<'_>) -> String {
    let file = report.file;
    if file.physical.is_empty() {
        return String::new();
    }
    let info = report.model.info();
    let rows: Vec<Vec<String>> = file
        .physical
        .iter()
        .enumerate()
        .map(|(k, p)| {
            let nominal = info.nominal.get(k).copied().flatten();
            vec![
                label(&p.label),
                four(p.value),
                escaped(&p.unit),
                four(p.sigma),
                nominal.map_or_else(|| "–".to_owned(), four),
            ]
        })
        .collect();
    let head = ["parameter", "value", "unit", "σ", "nominal"];
    let caption = "All parameters of a physical robot that has these base parameters, about the \
                   origins of the bodies' frames. What the data leave open is a choice";
    section(
        "physical",
        "Physical parameters",
        &table(caption, &head, &rows),
    )
}

fn friction(report: &Content<'_>) -> String {
    if report.friction.is_empty() {
        let text = "<p>No friction coefficient of an independent coordinate is among the base \
                    parameters.</p>\n";
        return section("friction", "Friction", text);
    }
    let mut figures = String::new();
    let rows: Vec<Vec<String>> = report
        .file
        .friction
        .iter()
        .map(|row| {
            let values = row.coefficients.iter();
            let values: Vec<String> = values
                .map(|(symbol, value)| format!("{} = {}", escaped(symbol), four(*value)))
                .collect();
            vec![label(&row.joint), escaped(&row.law), values.join(", ")]
        })
        .collect();
    if !rows.is_empty() {
        let caption = "Friction that has no columns, in SI units";
        figures = table(caption, &["joint", "law", "coefficients"], &rows);
    }
    report
        .friction
        .iter()
        .for_each(|f| figures.push_str(&figure(f)));
    section("friction", "Friction", &figures)
}

fn singular(report: &Content<'_>) -> String {
    let info = report.model.base_info();
    let mut out = figure(&report.spectrum);
    let condition = |values: &[f64]| values.last().map(|last| 1.0 / last);
    if let Some(condition) = condition(&report.spectra.base) {
        let _ = writeln!(
            out,
            "<p>Condition number of the base regressor with scaled columns over this log: \
             <b>{}</b>.</p>",
            four(condition)
        );
    }
    match info.certificate {
        Some(c) => {
            let _ = writeln!(
                out,
                "<p>Certificate: the regressor's {} columns have rank <b>{}</b> at {} random \
                 closed states in {} digits; the smallest number that counted is {:.0e} of the \
                 largest, the largest that did not {:.0e}. {}</p>",
                c.columns,
                c.rank,
                c.states,
                c.digits,
                c.smallest_pivot,
                c.largest_remainder,
                if info.complete {
                    "The base parameters are as many: there are no fewer."
                } else {
                    "The base parameters are INCOMPLETE."
                }
            );
        }
        None => out.push_str("<p>The base has no certificate.</p>\n"),
    }
    section("singular", "Singular values and certificate", &out)
}

fn validation(report: &Content<'_>) -> String {
    let cells = |errors: &Errors| -> Vec<Vec<String>> {
        let of = errors.efforts.iter().map(|e| {
            vec![
                escaped(&errors.file),
                if errors.used {
                    "identification"
                } else {
                    "validation"
                }
                .to_owned(),
                escaped(&e.name),
                e.samples.to_string(),
                error_percent(e.relative_absolute),
                four(e.rms),
                four(e.largest),
            ]
        });
        of.collect()
    };
    let rows: Vec<Vec<String>> = report.errors.iter().flat_map(cells).collect();
    let head = [
        "log",
        "used for",
        "effort",
        "samples",
        "eps<sub>RA</sub>, %",
        "rms",
        "largest",
    ];
    let caption = "Errors of the predicted efforts, relative to the efforts' own spread (Eq. 33)";
    section("validation", "Validation", &table(caption, &head, &rows))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_have_four_digits_and_no_needless_exponent() {
        assert_eq!(four(12.345_67), "12.35");
        assert_eq!(four(0.001_234_5), "0.001234");
        assert_eq!(four(98_765.4), "98765");
        assert_eq!(four(-1.5e-7), "-1.500e-7");
        assert_eq!(four(f64::NAN), "–");
    }

    #[test]
    fn text_cannot_become_tags() {
        assert_eq!(escaped("a<b & \"c\">"), "a&lt;b &amp; &quot;c&quot;&gt;");
        assert_eq!(label("Izz(link_1)"), "Izz(link_1)");
        assert_eq!(label("Fc(left_elbow)"), "Fc(<wbr>left_<wbr>elbow)");
    }
}
