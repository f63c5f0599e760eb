//! Draws the figures of a report.

use regen_runtime::{Limits, Motion};

use crate::ReportError;
use crate::charts::{self, BLUE, Bar, Figure, GREY, LINE_COLOURS, Line, Look, ORANGE, RED};
use crate::gather::{LogRows, Spectra};
use regen_identify::files::ParameterFile;
use regen_identify::model::IdentifiedModel;
use regen_identify::status::{Status, WELL_IDENTIFIED_PERCENT};
use regen_identify::text::counted;
use regen_interpreted::Interpreted;

/// The largest number of points of a line: more cannot be distinguished, and makes pages large.
const MAX_POINTS: usize = 1500;
/// The number of points of a friction curve in each direction.
const CURVE_POINTS: usize = 200;

/// The axis of time.
pub(super) const TIME: &str = "time from the start, s";

/// Column `k` over time, of a row-major table with `width` columns, thinned to [`MAX_POINTS`].
///
/// - `breaks`: the rows that do not follow the one before them, between which no line is drawn.
fn column(
    t: &[f64],
    values: &[f64],
    (k, width): (usize, usize),
    breaks: &[bool],
) -> Vec<(f64, f64)> {
    let stride = t.len().div_ceil(MAX_POINTS).max(1);
    let values = values.iter().skip(k).step_by(width.max(1));
    let mut out: Vec<(f64, f64)> = Vec::new();
    let mut is_broken = false;
    for (row, (t, value)) in t.iter().zip(values).enumerate() {
        is_broken |= breaks.get(row).copied().unwrap_or(false);
        if row % stride == 0 {
            if core::mem::take(&mut is_broken) && !out.is_empty() {
                out.push((f64::NAN, f64::NAN));
            }
            out.push((*t, *value));
        }
    }
    out
}

/// Where rows are missing, as a line of a chart; none where they are not.
fn missing(rows: &LogRows) -> Option<Line> {
    let spans = &rows.missing.spans;
    let ends = rows.t.first().zip(rows.t.last());
    let near = ends.map_or(0.0, |(from, to)| (to - from) / MAX_POINTS as f64);
    let mut points: Vec<(f64, f64)> = Vec::new();
    for [from, to] in spans {
        match points.last_mut() {
            Some(last) if *from - last.0 < near => last.0 = *to,
            _ => points.extend([(*from, f64::NAN), (*to, f64::NAN)]),
        }
    }
    let missing = counted(rows.missing.count, "row", "rows");
    (!spans.is_empty()).then(|| Line {
        label: format!("{missing} missing or left out"),
        points,
        dye: RED,
        look: Look::Bands,
    })
}

/// A name with every character replaced that might be wrong in a file's name.
pub(super) fn slug(name: &str) -> String {
    let keep = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
    name.chars().map(keep).collect()
}

/// Positions and velocities of the independent coordinates with their limits; a figure for each
/// quantity and unit.
pub(super) fn motion(model: &Interpreted<'_>, rows: &LogRows) -> Result<Vec<Figure>, ReportError> {
    type Of = fn(&Limits) -> Option<[f64; 2]>;
    let info = model.info();
    let n = info.coordinates.len();
    let kinds: [(&str, &[f64], Of, [&str; 2]); 2] = [
        ("position", &rows.q, |l| l.position, ["rad", "m"]),
        ("velocity", &rows.qd, |l| l.velocity, ["rad/s", "m/s"]),
    ];
    let mut figures = Vec::new();
    for (what, values, limit, units) in kinds {
        for (unit, kind) in units
            .into_iter()
            .zip([Motion::Rotation, Motion::Translation])
        {
            let joint = |c: &usize| info.joints.get(*c);
            let own: Vec<usize> = info
                .independent
                .iter()
                .copied()
                .filter(|c| joint(c).is_some_and(|j| j.motion == kind))
                .collect();
            if own.is_empty() {
                continue;
            }
            let mut lines: Vec<Line> = own
                .iter()
                .zip(LINE_COLOURS.iter().cycle())
                .map(|(c, dye)| Line {
                    label: info.coordinates.get(*c).unwrap_or(&"?").to_string(),
                    points: column(&rows.t, values, (*c, n), &rows.breaks),
                    dye: *dye,
                    look: Look::Solid,
                })
                .collect();
            let mut bounds: Vec<f64> = own
                .iter()
                .filter_map(|c| joint(c).and_then(|j| limit(&j.limits)))
                .flatten()
                .filter(|x| x.is_finite())
                .collect();
            bounds.sort_by(f64::total_cmp);
            bounds.dedup();
            let ends = rows.t.first().zip(rows.t.last());
            for (k, bound) in bounds.iter().enumerate() {
                let Some((from, to)) = ends else { break };
                lines.push(Line {
                    label: if k == 0 { "limit" } else { "" }.to_owned(),
                    points: vec![(*from, *bound), (*to, *bound)],
                    dye: RED,
                    look: Look::Dashed,
                });
            }
            lines.extend(missing(rows));
            let (suffix, joints) = if kind == Motion::Rotation {
                ("turns", "revolute")
            } else {
                ("shifts", "prismatic")
            };
            figures.push(Figure {
                name: format!("{what}-{suffix}"),
                caption: format!(
                    "{what} of the independent coordinates of {joints} joints over {}",
                    rows.file
                ),
                svg: charts::lines(TIME, &format!("{what}, {unit}"), 250, &lines)?,
            });
        }
    }
    Ok(figures)
}

/// Measured and predicted efforts of each independent coordinate, with the residuals below.
///
/// - `bounds`: of each effort the residual from which on Huber's loss is linear, so that it is an outlier; none
///   without this loss.
pub(super) fn forces(
    model: &Interpreted<'_>,
    rows: &LogRows,
    bounds: &[f64],
) -> Result<Vec<Figure>, ReportError> {
    let info = model.info();
    let dof = info.dof();
    let residuals: Vec<f64> = rows
        .tau
        .iter()
        .zip(&rows.predicted)
        .map(|(a, b)| a - b)
        .collect();
    let times = rows.times();
    let mut figures = Vec::with_capacity(dof);
    for (k, c) in info.independent.iter().enumerate() {
        let name = info.coordinates.get(*c).copied().unwrap_or("?");
        let shift = info
            .joints
            .get(*c)
            .is_some_and(|j| j.motion == Motion::Translation);
        let unit = if shift { "N" } else { "N m" };
        let line = |label: &str, values: &[f64], dye, look| Line {
            label: label.to_owned(),
            points: column(&times, values, (k, dof), &rows.equation_breaks),
            dye,
            look,
        };
        let mut above = vec![
            line("measured", &rows.tau, GREY, Look::Dots),
            line("predicted", &rows.predicted, BLUE, Look::Solid),
        ];
        let mut below = vec![line("", &residuals, ORANGE, Look::Solid)];
        above.extend(missing(rows));
        below.extend(missing(rows));
        if let Some(bound) = bounds.get(k) {
            let own = residuals.iter().skip(k).step_by(dof.max(1));
            let far: Vec<usize> = own
                .enumerate()
                .filter(|(_, r)| r.abs() > *bound)
                .map(|own| own.0)
                .collect();
            let every = far.len().div_ceil(MAX_POINTS).max(1);
            let outliers = |label: String, values: &[f64]| Line {
                label,
                points: (far.iter().step_by(every))
                    .filter_map(|row| Some((*times.get(*row)?, *values.get(row * dof + k)?)))
                    .collect(),
                dye: RED,
                look: Look::Dots,
            };
            let label = format!("{} of {} beyond Huber's bound", far.len(), times.len());
            above.push(outliers(label, &rows.tau));
            below.push(outliers(String::new(), &residuals));
        }
        let [up, down] = ["effort", "residual"].map(|what| format!("{what}, {unit}"));
        figures.push(Figure {
            name: format!("forces-{}", slug(name)),
            caption: format!(
                "effort of {name} over {}, and what is left of it",
                rows.file
            ),
            svg: charts::two_panels(TIME, [&up, &down], &above, &below)?,
        });
    }
    Ok(figures)
}

/// Friction of each independent coordinate that has friction coefficients, linear or not: the
/// identified curve over the velocities reached, and the measured efforts less the rest of the
/// model.
pub(super) fn friction(
    model: &Interpreted<'_>,
    rows: &LogRows,
    identified: &IdentifiedModel,
) -> Result<Vec<Figure>, ReportError> {
    let info = model.info();
    let base = model.base_info().base;
    let (n, dof) = (info.coordinates.len(), info.dof());
    let times = rows.times();
    let mut figures = Vec::new();
    for (k, c) in info.independent.iter().enumerate() {
        let name = info.coordinates.get(*c).copied().unwrap_or("?");
        let of = |symbol: &str| {
            let label = format!("{symbol}({name})");
            let place = base.iter().position(|b| b.label == label)?;
            identified.beta.get(place).copied()
        };
        let found = ["Fv", "Fc", "Fv+", "Fc+", "Fv-", "Fc-"].map(of);
        let fit = identified.friction.iter().find(|f| f.name == name);
        if found.iter().all(Option::is_none) && fit.is_none() {
            continue;
        }
        let [fv, fc, fv_plus, fc_plus, fv_minus, fc_minus] = found;
        let curve = |v: f64| {
            if let Some(fit) = fit {
                return fit.effort(v);
            }
            let (own_v, own_c) = if v > 0.0 {
                (fv_plus, fc_plus)
            } else {
                (fv_minus, fc_minus)
            };
            let viscous = fv.or(own_v).unwrap_or(0.0);
            let coulomb = fc.or(own_c).unwrap_or(0.0);
            // no friction at rest
            let sign = if v > 0.0 {
                1.0
            } else if v < 0.0 {
                -1.0
            } else {
                0.0
            };
            viscous * v + coulomb * sign
        };
        let places = rows.places.iter().map(|row| row * n + *c);
        let own = places.map(|k| rows.qd.get(k).copied().unwrap_or(0.0));
        let velocities = column(&times, &own.collect::<Vec<f64>>(), (0, 1), &[]);
        let tau = column(&times, &rows.tau, (k, dof), &[]);
        let predicted = column(&times, &rows.predicted, (k, dof), &[]);
        let cloud: Vec<(f64, f64)> = velocities
            .iter()
            .zip(tau.iter().zip(&predicted))
            .map(|((_, v), ((_, tau), (_, predicted)))| (*v, tau - predicted + curve(*v)))
            .collect();
        let widest = cloud.iter().fold(0.0_f64, |m, p| m.max(p.0.abs()));
        let ends = |from: f64, to: f64| -> Vec<(f64, f64)> {
            let part = |j: usize| from + (to - from) * j as f64 / CURVE_POINTS as f64;
            (0..=CURVE_POINTS)
                .map(|j| (part(j), curve(part(j))))
                .collect()
        };
        let near = 1e-9 * widest.max(1e-9);
        let line = |label: &str, points| Line {
            label: label.to_owned(),
            points,
            dye: BLUE,
            look: Look::Solid,
        };
        let lines = [
            Line {
                label: "effort less the rest of the model".to_owned(),
                points: cloud,
                dye: GREY,
                look: Look::Dots,
            },
            line("identified friction", ends(-widest, -near)),
            line("", ends(near, widest)),
        ];
        let shift = info
            .joints
            .get(*c)
            .is_some_and(|j| j.motion == Motion::Translation);
        let (x, y) = if shift {
            ("velocity, m/s", "friction, N")
        } else {
            ("velocity, rad/s", "friction, N m")
        };
        figures.push(Figure {
            name: format!("friction-{}", slug(name)),
            caption: format!("friction of {name} over the velocities of {}", rows.file),
            svg: charts::lines(x, y, 260, &lines)?,
        });
    }
    Ok(figures)
}

/// The singular values of the regressor, with the certified rank.
pub(super) fn spectrum(model: &Interpreted<'_>, spectra: &Spectra) -> Result<Figure, ReportError> {
    let rank = model.base_info().certificate.map(|c| c.rank);
    Ok(Figure {
        name: "singular-values".to_owned(),
        caption: "singular values of the regressor over the log, columns scaled to unit length"
            .to_owned(),
        svg: charts::spectrum(&spectra.all, &spectra.base, rank)?,
    })
}

/// The relative standard deviations of the parameters.
pub(super) fn deviations(file: &ParameterFile) -> Result<Figure, ReportError> {
    let rows: Vec<Bar> = file
        .parameters
        .iter()
        .map(|p| Bar {
            label: p.label.clone(),
            percent: p.sigma_percent,
            dye: match p.status {
                Status::Well => BLUE,
                Status::Zero => GREY,
                _ => ORANGE,
            },
        })
        .collect();
    Ok(Figure {
        name: "deviations".to_owned(),
        caption: format!(
            "relative standard deviations; the dashed line is {WELL_IDENTIFIED_PERCENT:.0} %, below which a \
             parameter counts as well identified; grey: zero within its error"
        ),
        svg: charts::deviations(&rows, WELL_IDENTIFIED_PERCENT)?,
    })
}
