//! The residuals of the efforts: their spectra, the delays of the efforts, and the samples that
//! were not used.

use std::fmt::Write as _;

use regen_identify::data::Run;
use regen_identify::identify::{Delay, Delays};
use regen_identify::session::{Session, from_logs};
use regen_identify::text;
use regen_inspect::amplitude_density;
use regen_interpreted::Interpreted;
use regen_runtime::Motion;

use crate::ReportError;
use crate::charts::{self, Figure, GREY, Line, Look, ORANGE};
use crate::figures::slug;
use crate::gather::{Errors, LogRows};
use crate::identified::Content;
use crate::page::{escaped, figure, section, table};

/// The spectra of each effort and of its residual; none for logs with few samples.
pub(super) fn spectra(model: &Interpreted<'_>, seen: &LogRows) -> Result<Vec<Figure>, ReportError> {
    let info = model.info();
    let dof = info.dof();
    let times = seen.times();
    let mut figures = Vec::new();
    for (k, c) in info.independent.iter().enumerate() {
        let own = |values: &[f64]| -> Vec<f64> {
            values.iter().skip(k).step_by(dof.max(1)).copied().collect()
        };
        let (measured, predicted) = (own(&seen.tau), own(&seen.predicted));
        let residual: Vec<f64> = measured
            .iter()
            .zip(&predicted)
            .map(|(a, b)| a - b)
            .collect();
        let curves = [&measured, &residual].map(|values| amplitude_density(&times, values));
        if curves.iter().all(Vec::is_empty) {
            continue;
        }
        let name = info.coordinates.get(*c).copied().unwrap_or("?");
        let joint = info.joints.get(*c);
        let shift = joint.is_some_and(|j| j.motion == Motion::Translation);
        let looks = [("measured effort", GREY), ("residual", ORANGE)];
        let lines: Vec<Line> = (curves.into_iter().zip(looks))
            .map(|(points, (label, dye))| Line {
                label: label.to_owned(),
                points,
                dye,
                look: Look::Solid,
            })
            .collect();
        let unit = if shift { "N" } else { "N m" };
        figures.push(Figure {
            name: format!("spectrum-{}", slug(name)),
            caption: format!(
                "root of the power spectral density of the effort of {name} over {}, and of what is \
                 left of it, by Welch's method",
                seen.file
            ),
            svg: charts::densities(&format!("{unit} / root Hz"), &lines, None)?,
        });
    }
    Ok(figures)
}

/// The delays of efforts behind the motion, estimated with the base parameters; `None` where this
/// estimate does not apply to the logs.
pub(super) fn delays(session: &Session<'_, Interpreted<'_>>, logs: &[Run]) -> Option<Delays> {
    let mut logs = session.open(logs).ok()?;
    let start = from_logs(session, &mut logs).ok()?;
    (!start.delays.efforts.is_empty()).then_some(start.delays)
}

/// The section of the page.
pub(super) fn html(report: &Content<'_>) -> String {
    let mut out = String::new();
    if let Some(delays) = &report.delays {
        let one = |delay: &Delay| {
            let [size, sigma] = [delay.seconds, delay.sigma].map(|s| text::figure(1e3 * s));
            let note = match delay.slower {
                _ if delay.is_significant() => ", beyond its error".to_owned(),
                Some(s) => format!(", but {} ms in slower motion: none", text::figure(1e3 * s)),
                None => String::new(),
            };
            format!("{size} ms (σ {sigma} ms{note})")
        };
        let all = delays.efforts.iter();
        let all = all.map(|delay| format!("{}: {}", escaped(&delay.effort), one(delay)));
        let all: Vec<String> = all.collect();
        let _ = writeln!(
            out,
            "<p>Delay of the efforts behind the motion beyond what was corrected in reading, estimated \
             with the base parameters by least squares: {}.</p>",
            all.join("; ")
        );
    }
    let rows: Vec<Vec<String>> = report.errors.iter().map(left_out).collect();
    let caption = "Samples: used ones gave equations; singular ones have no reduced efforts; \
                   unsettled ones are at the ends of filtered runs; resting are equations of \
                   efforts whose joints stood still";
    let head = ["log", "used", "singular", "unsettled", "resting"];
    out.push_str(&table(caption, &head, &rows));
    report
        .residuals
        .iter()
        .for_each(|f| out.push_str(&figure(f)));
    section("residuals", "Residuals", &out)
}

fn left_out(errors: &Errors) -> Vec<String> {
    let left = &errors.left_out;
    let counts = [
        left.samples,
        left.singular,
        left.unsettled,
        left.resting.iter().sum(),
    ];
    let counts = counts.iter().map(ToString::to_string);
    std::iter::once(escaped(&errors.file))
        .chain(counts)
        .collect()
}
