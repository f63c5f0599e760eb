//! Writes Figures 2 to 4 as CSV and SVG.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use plotters::prelude::*;

/// A curve: its name and a value for each time.
pub(crate) struct Curve {
    pub(crate) name: String,
    pub(crate) values: Vec<f64>,
    /// Whether it is drawn as points.
    pub(crate) points: bool,
}

/// One panel of a figure.
pub(crate) struct Panel {
    pub(crate) label: String,
    pub(crate) curves: Vec<Curve>,
}

/// Writes NAME.csv and NAME.svg.
pub(crate) fn write(dir: &Path, name: &str, title: &str, times: &[f64], panels: &[Panel]) {
    fs::create_dir_all(dir).expect("a directory");
    let mut csv = String::from("t");
    for curve in panels.iter().flat_map(|panel| &panel.curves) {
        let _ = write!(csv, ",{}", curve.name);
    }
    csv.push('\n');
    for (k, t) in times.iter().enumerate() {
        let _ = write!(csv, "{t}");
        for curve in panels.iter().flat_map(|panel| &panel.curves) {
            let _ = write!(csv, ",{}", curve.values[k]);
        }
        csv.push('\n');
    }
    fs::write(dir.join(format!("{name}.csv")), csv).expect("a file");

    let path = dir.join(format!("{name}.svg"));
    let height = 60 + 240 * u32::try_from(panels.len()).expect("few panels");
    let root = SVGBackend::new(&path, (860, height)).into_drawing_area();
    root.fill(&WHITE).expect("a drawing");
    let root = root.titled(title, ("sans-serif", 20)).expect("a title");
    let last = times.last().copied().unwrap_or(1.0);
    for (area, panel) in root.split_evenly((panels.len(), 1)).iter().zip(panels) {
        let all = panel.curves.iter().flat_map(|curve| &curve.values);
        let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
            (l.min(*v), h.max(*v))
        });
        let room = 0.08 * (high - low).max(1e-9);
        let mut chart = ChartBuilder::on(area)
            .margin(8)
            .x_label_area_size(32)
            .y_label_area_size(64)
            .build_cartesian_2d(0.0..1.15 * last, low - room..high + room)
            .expect("axes");
        chart
            .configure_mesh()
            .x_desc("t, s")
            .y_desc(&panel.label)
            .light_line_style(WHITE)
            .draw()
            .expect("a mesh");
        for (k, curve) in panel.curves.iter().enumerate() {
            let colour = [BLACK, RED, BLUE][k % 3];
            let points = times.iter().copied().zip(curve.values.iter().copied());
            if curve.points {
                let marks = points.map(|at| Circle::new(at, 2, colour.stroke_width(1)));
                chart.draw_series(marks).expect("points");
            } else {
                let line = LineSeries::new(points, colour.stroke_width(1));
                chart
                    .draw_series(line)
                    .expect("a line")
                    .label(&curve.name)
                    .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour));
            }
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .background_style(WHITE.mix(0.8))
            .draw()
            .expect("labels");
    }
    root.present().expect("a file");
}
