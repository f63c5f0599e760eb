//! Charts as SVG text.

use std::ops::Range;

use plotters::chart::MeshStyle;
use plotters::coord::Shift;
use plotters::coord::ranged1d::Ranged;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::ReportError;

/// A chart of a report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Figure {
    /// The figure's name, usable as a file name without extension: letters, digits and `-`.
    pub name: String,
    /// What the figure shows, in words.
    pub caption: String,
    /// The drawing, a complete SVG file.
    pub svg: String,
}

/// A line in a chart.
pub(super) struct Line {
    pub(super) label: String,
    /// A line ends at a point that is NaN.
    pub(super) points: Vec<(f64, f64)>,
    pub(super) dye: RGBColor,
    pub(super) look: Look,
}

/// How a series is drawn.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Look {
    Solid,
    Dashed,
    Dots,
    /// From each odd point to the next one, over the whole height.
    Bands,
}

pub(super) const BLUE: RGBColor = RGBColor(11, 98, 196);
pub(super) const ORANGE: RGBColor = RGBColor(214, 93, 14);
pub(super) const GREY: RGBColor = RGBColor(110, 117, 125);
pub(super) const RED: RGBColor = RGBColor(194, 24, 91);
const INK: RGBColor = RGBColor(28, 32, 36);
/// The colours of several lines of one kind.
pub(super) const LINE_COLOURS: [RGBColor; 6] = [
    BLUE,
    ORANGE,
    RGBColor(46, 125, 50),
    RGBColor(123, 63, 160),
    RGBColor(0, 131, 143),
    RGBColor(141, 110, 32),
];
const WIDTH: u32 = 760;
/// Drawing units per CSS pixel of the page: SVG coordinates are whole numbers, and lines would look
/// jagged in whole pixels.
const UNITS_PER_PX: u32 = 8;
const FONT: &str = "sans-serif";
/// The width left of a chart for the labels of its axis, px.
const AXIS_WIDTH_PX: u32 = 72;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), Box<dyn std::error::Error + Send + Sync>>;

/// So many dots at most are drawn larger.
const FEW_DOTS: usize = 200;

/// Draws an SVG of the page's width and this height, px.
fn drawn(height: u32, draw: impl FnOnce(&Area<'_>) -> Drawn) -> Result<String, ReportError> {
    let mut svg = String::new();
    {
        let size = (px(WIDTH), px(height));
        let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        draw(&area)
            .and_then(|()| Ok(area.present()?))
            .map_err(ReportError::Drawing)?;
    }
    let head = |w: u32, h: u32| format!("<svg width=\"{w}\" height=\"{h}\"");
    Ok(svg.replacen(&head(px(WIDTH), px(height)), &head(WIDTH, height), 1))
}

/// A length on the page, given in px, in drawing units.
fn px(length: u32) -> u32 {
    length * UNITS_PER_PX
}

/// A point of the page, given in px, in drawing units.
fn point(x: u32, y: u32) -> (i32, i32) {
    let place = |v: u32| i32::try_from(px(v)).unwrap_or(i32::MAX);
    (place(x), place(y))
}

fn letters() -> TextStyle<'static> {
    (FONT, px(12)).into_font().color(&INK)
}

/// Gives the axes and lines of a mesh the look that all charts have in common.
fn styled<'m, 'a, 'b, X: Ranged, Y: Ranged, DB: DrawingBackend>(
    mesh: &'m mut MeshStyle<'a, 'b, X, Y, DB>,
) -> &'m mut MeshStyle<'a, 'b, X, Y, DB> {
    mesh.light_line_style(TRANSPARENT)
        .bold_line_style(GREY.mix(0.18).stroke_width(px(1)))
        .axis_style(GREY.stroke_width(px(1)))
        .set_all_tick_mark_size(px(4))
        .label_style(letters())
        .axis_desc_style(letters())
}

/// The symbol of a series in a legend.
#[derive(Clone, Copy)]
enum Sign {
    Line(RGBColor),
    Dot(RGBColor),
    Ring(RGBColor),
    Band(RGBColor),
}

/// The approximate width of a text, px: letters are about seven pixels wide.
fn width(text: &str) -> u32 {
    7 * u32::try_from(text.chars().count()).unwrap_or(0)
}

/// The height of a row of a legend, px.
const ROW: u32 = 18;

/// Lays out the entries of a legend from this left margin, as many per row as fit the page: their
/// places, px, and the number of rows.
fn placed(left: u32, entries: &[(String, Sign)]) -> (Vec<(u32, u32)>, u32) {
    let (mut x, mut row) = (left, 0);
    let places = entries
        .iter()
        .map(|(text, _)| {
            let own = 24 + width(text);
            if x > left && x + own > WIDTH {
                (x, row) = (left, row + 1);
            }
            let place = (x, 11 + ROW * row);
            x += own + 20;
            place
        })
        .collect();
    (places, row + 1)
}

/// Draws a legend in rows above a chart, so that it covers nothing.
fn legend(area: &Area<'_>, left: u32, entries: &[(String, Sign)]) -> Drawn {
    let places = placed(left, entries).0;
    for ((text, sign), (x, y)) in entries.iter().zip(places) {
        match sign {
            Sign::Line(dye) => {
                let ends = vec![point(x, y), point(x + 18, y)];
                area.draw(&PathElement::new(ends, dye.stroke_width(px(2))))?;
            }
            Sign::Dot(dye) => area.draw(&Circle::new(point(x + 9, y), px(3), dye.filled()))?,
            Sign::Ring(dye) => {
                area.draw(&Circle::new(
                    point(x + 9, y),
                    px(4),
                    dye.stroke_width(px(1)),
                ))?;
            }
            Sign::Band(dye) => {
                let corners = [point(x, y.saturating_sub(6)), point(x + 18, y + 6)];
                area.draw(&Rectangle::new(corners, pale(*dye)))?;
            }
        }
        let style = letters().pos(Pos::new(HPos::Left, VPos::Center));
        area.draw_text(text, &style, point(x + 24, y))?;
    }
    Ok(())
}

/// The legend entries of lines that have a label.
fn entries(lines: &[Line]) -> Vec<(String, Sign)> {
    let named = lines.iter().filter(|l| !l.label.is_empty());
    named
        .map(|l| match l.look {
            Look::Dots => (l.label.clone(), Sign::Dot(l.dye)),
            Look::Bands => (l.label.clone(), Sign::Band(l.dye)),
            Look::Solid | Look::Dashed => (l.label.clone(), Sign::Line(l.dye)),
        })
        .collect()
}

/// A chart of lines over time or another quantity, with a legend.
pub(super) fn lines(x: &str, y: &str, height: u32, lines: &[Line]) -> Result<String, ReportError> {
    // further rows of the legend enlarge the drawing, not shrink the chart
    let more = ROW * (placed(AXIS_WIDTH_PX, &entries(lines)).1 - 1);
    drawn(height + more, |area| panel(area, x, y, lines, true))
}

/// A chart of lines, and below it another one at the same times.
pub(super) fn two_panels(
    x: &str,
    y: [&str; 2],
    above: &[Line],
    below: &[Line],
) -> Result<String, ReportError> {
    drawn(330, |area| {
        let (upper, lower) = area.split_vertically(px(215));
        panel(&upper, "", y[0], above, true)?;
        panel(&lower, x, y[1], below, false)
    })
}

fn panel(area: &Area<'_>, x: &str, y: &str, lines: &[Line], titled: bool) -> Drawn {
    let points = || lines.iter().flat_map(|l| &l.points);
    let across = range(points().map(|p| p.0), 0.0);
    let up = range(points().map(|p| p.1), 0.06);
    let digits = decimals(&up);
    let across_digits = decimals(&across);
    let entries = if titled { entries(lines) } else { Vec::new() };
    let above = match placed(AXIS_WIDTH_PX, &entries).1 {
        _ if entries.is_empty() => 8,
        rows => 8 + ROW * rows,
    };
    let mut chart = ChartBuilder::on(area)
        .margin_top(px(above))
        .margin_right(px(14))
        .x_label_area_size(px(if x.is_empty() { 10 } else { 40 }))
        .y_label_area_size(px(AXIS_WIDTH_PX))
        .build_cartesian_2d(across, up.clone())?;
    // behind everything else
    for line in lines.iter().filter(|line| line.look == Look::Bands) {
        for ends in line.points.chunks_exact(2) {
            let [(from, _), (to, _)] = ends else { continue };
            let corners = [(*from, up.start), (*to, up.end)];
            chart.draw_series([Rectangle::new(corners, pale(line.dye))])?;
            // one row of many is narrower than a pixel
            let side = vec![(*from, up.start), (*from, up.end)];
            chart.draw_series([PathElement::new(
                side,
                line.dye.mix(0.3).stroke_width(px(1)),
            )])?;
        }
    }
    styled(&mut chart.configure_mesh())
        .x_labels(if x.is_empty() { 0 } else { 10 })
        .y_labels(6)
        .x_label_formatter(&|v| number(*v, across_digits))
        .y_label_formatter(&|v| number(*v, digits))
        .x_desc(x)
        .y_desc(y)
        .draw()?;
    for line in lines {
        let style = line.dye.stroke_width(px(3) / 2);
        for part in line.points.split(|p| p.0.is_nan() || p.1.is_nan()) {
            let points = part.iter().copied();
            match line.look {
                Look::Solid => {
                    chart.draw_series(LineSeries::new(points, style))?;
                }
                Look::Dashed => {
                    chart.draw_series(DashedLineSeries::new(points, px(6), px(4), style))?;
                }
                Look::Dots => {
                    // a few dots are large enough to be told apart by colour
                    let (radius, part) = match line.points.len() {
                        0..=FEW_DOTS => (px(5) / 2, 0.8),
                        _ => (px(3) / 2, 0.6),
                    };
                    let dot = |p| Circle::new(p, radius, line.dye.mix(part).filled());
                    chart.draw_series(points.map(dot))?;
                }
                Look::Bands => {}
            }
        }
    }
    legend(area, AXIS_WIDTH_PX, &entries)
}

/// The filling of a band.
fn pale(dye: RGBColor) -> ShapeStyle {
    dye.mix(0.14).filled()
}

/// Singular values by their number, on a logarithmic axis, with the certified rank.
pub(super) fn spectrum(
    all: &[f64],
    base: &[f64],
    rank: Option<usize>,
) -> Result<String, ReportError> {
    /// The smallest value drawn: smaller ones are rounding.
    const FLOOR: f64 = 1e-18;
    drawn(300, |area| {
        let count = all.len().max(base.len()).max(1);
        let mut chart = ChartBuilder::on(area)
            .margin_top(px(26))
            .margin_right(px(14))
            .x_label_area_size(px(40))
            .y_label_area_size(px(AXIS_WIDTH_PX))
            .build_cartesian_2d(0.0..(count + 1) as f64, (FLOOR..3.0).log_scale())?;
        styled(&mut chart.configure_mesh())
            .x_labels(12)
            .x_label_formatter(&|v| format!("{v:.0}"))
            .y_labels(7)
            .y_label_formatter(&|v| format!("1e{:.0}", v.log10()))
            .x_desc("number of the singular value")
            .y_desc("part of the largest")
            .draw()?;
        let dots = |values: &[f64]| -> Vec<(f64, f64)> {
            let values = values.iter().enumerate();
            values
                .map(|(k, v)| ((k + 1) as f64, v.max(FLOOR)))
                .collect()
        };
        let ring = |p| Circle::new(p, px(4), GREY.stroke_width(px(1)));
        chart.draw_series(dots(all).into_iter().map(ring))?;
        let dot = |p| Circle::new(p, px(2), BLUE.filled());
        chart.draw_series(dots(base).into_iter().map(dot))?;
        let mut entries = vec![
            ("all parameters".to_owned(), Sign::Ring(GREY)),
            ("base parameters".to_owned(), Sign::Dot(BLUE)),
        ];
        if let Some(rank) = rank {
            let end = rank as f64 + 0.5;
            let cut = [(end, FLOOR), (end, 3.0)];
            let style = RED.stroke_width(px(3) / 2);
            chart.draw_series(DashedLineSeries::new(cut, px(5), px(4), style))?;
            entries.push((format!("certified rank {rank}"), Sign::Line(RED)));
        }
        legend(area, AXIS_WIDTH_PX, &entries)
    })
}

/// Spectral densities on logarithmic axes, with a mark at a frequency.
pub(super) fn densities(
    y: &str,
    lines: &[Line],
    mark: Option<(f64, &str)>,
) -> Result<String, ReportError> {
    let ends = |of: fn(&(f64, f64)) -> f64| {
        let values = lines.iter().flat_map(|l| &l.points).map(of);
        let (mut lo, mut hi) = (f64::INFINITY, 0.0_f64);
        for v in values.filter(|v| *v > 0.0 && v.is_finite()) {
            (lo, hi) = (lo.min(v), hi.max(v));
        }
        if lo < hi { lo..hi } else { 0.1..1.0 }
    };
    let across = ends(|p| p.0);
    let up = ends(|p| p.1);
    // what is far below the rest is rounding
    let up = up.start.max(1e-12 * up.end)..up.end * 1.5;
    let labels = round_numbers(&across);
    let mut entries = entries(lines);
    entries.extend(mark.map(|(_, name)| (name.to_owned(), Sign::Line(RED))));
    let rows = placed(AXIS_WIDTH_PX, &entries).1;
    drawn(250 + ROW * (rows - 1), |area| {
        let mut chart = ChartBuilder::on(area)
            .margin_top(px(8 + ROW * rows))
            .margin_right(px(14))
            .x_label_area_size(px(40))
            .y_label_area_size(px(AXIS_WIDTH_PX))
            .build_cartesian_2d(
                across.log_scale().with_key_points(labels),
                up.clone().log_scale(),
            )?;
        styled(&mut chart.configure_mesh())
            .y_labels(7)
            .x_label_formatter(&|v| number(*v, 3))
            .y_label_formatter(&|v| format!("{v:.0e}"))
            .x_desc("frequency, Hz")
            .y_desc(y)
            .draw()?;
        for line in lines {
            let shown = line.points.iter().filter(|p| p.0 > 0.0 && p.1 >= up.start);
            let style = line.dye.stroke_width(px(3) / 2);
            chart.draw_series(LineSeries::new(shown.copied(), style))?;
        }
        if let Some((frequency, _)) = mark {
            let ends = [(frequency, up.start), (frequency, up.end)];
            let style = RED.stroke_width(px(3) / 2);
            chart.draw_series(DashedLineSeries::new(ends, px(5), px(4), style))?;
        }
        legend(area, AXIS_WIDTH_PX, &entries)
    })
}

/// The labels of a logarithmic axis: powers of ten, with twice and five times them on a short one. The
/// labels that the library would choose have powers of ten twice, which looks bold.
fn round_numbers(range: &Range<f64>) -> Vec<f64> {
    let (first, last) = (range.start.log10().floor(), range.end.log10().floor());
    let parts: &[f64] = if last - first > 2.0 {
        &[1.0]
    } else {
        &[1.0, 2.0, 5.0]
    };
    std::iter::successors(Some(first), |power| Some(power + 1.0))
        .take_while(|power| *power <= last)
        .flat_map(|power| parts.iter().map(move |part| part * 10_f64.powf(power)))
        .filter(|v| range.contains(v))
        .collect()
}

/// A bar of a relative standard deviation.
pub(super) struct Bar {
    pub(super) label: String,
    /// The deviation in percent; NaN where it is unknown, and no bar is drawn.
    pub(super) percent: f64,
    pub(super) dye: RGBColor,
}

/// A bar chart of relative standard deviations in percent, on a logarithmic axis, with the bound
/// below which parameters are well identified.
pub(super) fn deviations(rows: &[Bar], bound: f64) -> Result<String, ReportError> {
    let height = u32::try_from(60 + 17 * rows.len()).unwrap_or(u32::MAX / UNITS_PER_PX);
    let longest = rows.iter().map(|row| width(&row.label)).max().unwrap_or(0);
    // the bars have at least half of the page, however long the names are
    let margin = (12 + longest).clamp(96, WIDTH / 2);
    drawn(height, |area| {
        let (lo, hi) = (0.01, 1e4);
        let mut chart = ChartBuilder::on(area)
            .margin_top(px(6))
            .margin_right(px(24))
            .x_label_area_size(px(40))
            .y_label_area_size(px(margin))
            .build_cartesian_2d((lo..hi).log_scale(), rows.len() as f64..0.0)?;
        styled(&mut chart.configure_mesh())
            .disable_y_mesh()
            .disable_y_axis()
            .x_labels(7)
            .x_label_formatter(&|v| number(*v, 2))
            .x_desc("standard deviation, percent of the value")
            .draw()?;
        for (k, row) in rows.iter().enumerate() {
            if !row.percent.is_nan() {
                let end = row.percent.clamp(lo, hi);
                let corners = [(lo, k as f64 + 0.2), (end, k as f64 + 0.8)];
                chart.draw_series([Rectangle::new(corners, row.dye.filled())])?;
            }
            let (x, y) = chart.backend_coord(&(lo, k as f64 + 0.5));
            let style = letters().pos(Pos::new(HPos::Right, VPos::Center));
            area.draw_text(&row.label, &style, (x - point(6, 0).0, y))?;
        }
        let line = [(bound, 0.0), (bound, rows.len() as f64)];
        let style = RED.stroke_width(px(3) / 2);
        chart.draw_series(DashedLineSeries::new(line, px(5), px(4), style))?;
        Ok(())
    })
}

/// The range of the finite values, widened by a margin; never empty, also for a single value.
fn range(values: impl Iterator<Item = f64>, margin: f64) -> Range<f64> {
    let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
    for v in values.filter(|v| v.is_finite()) {
        (lo, hi) = (lo.min(v), hi.max(v));
    }
    if lo > hi {
        return 0.0..1.0;
    }
    let size = hi - lo;
    if size <= 1e-9 * lo.abs().max(hi.abs()) {
        let pad = (0.1 * lo.abs()).max(1e-3);
        return lo - pad..hi + pad;
    }
    lo - margin * size..hi + margin * size
}

/// The decimals needed to distinguish the labels of an axis.
fn decimals(range: &Range<f64>) -> usize {
    let step = (range.end - range.start) / 8.0;
    #[allow(clippy::cast_sign_loss, reason = "clamped")]
    let digits = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
    digits
}

fn number(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    // no negative zero
    let text = if text
        .trim_start_matches('-')
        .chars()
        .all(|c| c == '0' || c == '.')
    {
        text.trim_start_matches('-').to_owned()
    } else {
        text
    };
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn a_legend_too_long_for_one_row_takes_several() {
        let entry = |name: &str| (name.to_owned(), Sign::Dot(BLUE));
        let short: Vec<_> = ["q1", "q2", "q3"].map(entry).to_vec();
        assert_eq!(placed(AXIS_WIDTH_PX, &short).1, 1);
        let long = vec![entry("shoulder_pan_joint"); 7];
        let (places, rows) = placed(AXIS_WIDTH_PX, &long);
        assert!(rows > 1);
        let end = |(x, _): &(u32, u32)| x + 24 + width("shoulder_pan_joint");
        assert!(places.iter().all(|place| end(place) <= WIDTH));
        assert!(places.iter().zip(&places[1..]).all(|(a, b)| a != b));
    }

    #[test]
    fn labels_have_just_enough_digits_to_differ() {
        assert_eq!(decimals(&(0.0..100.0)), 0);
        assert_eq!(number(20.0, decimals(&(0.0..100.0))), "20");
        assert_eq!(number(0.65, decimals(&(0.6..0.8))), "0.65");
        assert_eq!(number(-0.0, 2), "0");
        assert_eq!(range([3.0, f64::NAN, 5.0].into_iter(), 0.0), 3.0..5.0);
        assert_eq!(range(std::iter::empty(), 0.1), 0.0..1.0);
        let one = range([2.0].into_iter(), 0.1);
        assert!(one.start < 2.0 && one.end > 2.0);
    }

    #[test]
    fn no_label_of_spectra_is_drawn_twice_at_its_place() {
        for ends in [(0.5, 12.0), (0.9, 50.0), (0.05, 250.0)] {
            let line = Line {
                label: String::new(),
                points: vec![(ends.0, 1.0), (ends.1, 0.01)],
                dye: BLUE,
                look: Look::Solid,
            };
            let svg = densities("unit", &[line], None).unwrap();
            let labels: Vec<&str> = svg.split("<text").skip(1).collect();
            let different: std::collections::BTreeSet<_> = labels.iter().collect();
            assert_eq!(labels.len(), different.len(), "{ends:?}: {svg}");
        }
        assert_eq!(round_numbers(&(0.5..12.0)), [0.5, 1.0, 2.0, 5.0, 10.0]);
        assert_eq!(round_numbers(&(0.05..250.0)), [0.1, 1.0, 10.0, 100.0]);
    }

    #[test]
    fn the_dashes_of_the_bound_are_longer_than_they_are_wide() {
        let row = Bar {
            label: "m(1)".to_owned(),
            percent: 3.0,
            dye: BLUE,
        };
        let svg = deviations(&[row], 15.0).unwrap();
        let RGBColor(r, g, b) = RED;
        let colour = format!("stroke=\"#{r:02X}{g:02X}{b:02X}\"");
        let red: Vec<&str> = svg.split('<').filter(|e| e.contains(&colour)).collect();
        assert!(!red.is_empty(), "{svg}");
        for element in red {
            let (_, rest) = element.split_once("stroke-width=\"").unwrap();
            let width: u32 = rest.split('"').next().unwrap().parse().unwrap();
            assert!((1..px(5)).contains(&width), "{element}");
        }
    }
}
