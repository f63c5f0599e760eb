//! The spectra of the efforts' residuals.

use regen_inspect::amplitude_density;
use regen_interpreted::Interpreted;
use regen_runtime::Motion;

use crate::ReportError;
use crate::charts::{self, Figure, GREY, Line, Look, ORANGE};
use crate::figures::slug;
use crate::gather::LogRows;
use crate::identified::Content;
use crate::page::{figure, section};

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

/// The section of the page.
pub(super) fn html(report: &Content<'_>) -> String {
    let figures: String = report.residuals.iter().map(figure).collect();
    section("residuals", "Residuals", &figures)
}
