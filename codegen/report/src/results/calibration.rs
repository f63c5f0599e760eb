//! A calibration as text, and its JSON.

use std::fmt::Write as _;

use regen_calibrate::{Fit, Fixed, Group, Kind, Known, Problem, Unit, Why};
use regen_codegen::explain::lines::{columns, field};
use regen_identify::text::figure_of;
use serde::Serialize;

/// What a calibration found, or what its measurements could tell.
#[derive(Clone, Debug, Serialize)]
pub struct Calibrated {
    /// The version of the JSON: [`Self::VERSION`].
    pub version: usize,
    /// The robot's name.
    pub robot: String,
    /// The number of poses that were used; 0 where there were no runs.
    pub poses: usize,
    /// The rows of poses that were left out because they do not fit the others.
    pub outliers: Vec<u64>,
    /// The rows of poses that the mechanism cannot reach.
    pub unreachable: Vec<u64>,
    /// The confidence of the intervals.
    pub confidence: f64,
    /// How well each kind of measurement is predicted.
    pub measured: Vec<MeasuredFit>,
    /// What was found; of `known`, the names alone.
    pub estimates: Vec<FoundNumber>,
    /// What stays at its nominal value.
    pub fixed: Vec<FixedNumber>,
    /// Pairs of estimates that determine each other, with their correlation.
    pub correlated: Vec<(String, String, f64)>,
    /// Where the instruments are that were found.
    pub instruments: Vec<Instrument>,
    /// The sum of the squared residuals over their variances, where all noise is stated.
    pub chi_square: Option<f64>,
    /// Its degrees of freedom.
    pub degrees_of_freedom: Option<usize>,
    /// Whether the search ended at a minimum; `None` where there were no runs.
    pub converged: Option<bool>,
    /// What is wrong with the measurements.
    pub doubts: Vec<String>,
}

/// How well measurements of one kind are predicted.
#[derive(Clone, Debug, Serialize)]
pub struct MeasuredFit {
    /// What was measured.
    pub what: String,
    /// m or rad.
    pub unit: &'static str,
    /// How many numbers.
    pub numbers: usize,
    /// The standard deviation of their noise.
    pub sigma: f64,
    /// Whether it was stated.
    pub stated: bool,
    /// The rms of the residuals with the nominal geometry.
    pub before: f64,
    /// The rms of the residuals of the fit.
    pub after: f64,
    /// The rms of what a fit without the pose would leave at it.
    pub unseen: f64,
}

/// A number of the geometry.
#[derive(Clone, Debug, Serialize)]
pub struct FoundNumber {
    /// Its name.
    pub name: String,
    /// rad, m, or nothing.
    pub unit: &'static str,
    /// The value of the description.
    pub nominal: f64,
    /// The value that fits best; `None` where there were no runs.
    pub value: Option<f64>,
    /// Its standard deviation.
    pub sigma: Option<f64>,
    /// Its interval.
    pub interval: Option<[f64; 2]>,
}

/// A number that stays at its nominal value.
#[derive(Clone, Debug, Serialize)]
pub struct FixedNumber {
    /// Its name.
    pub name: String,
    /// Why, in a word.
    pub why: &'static str,
    /// The found numbers that its error changes, each with the change for a unit error.
    pub by: Vec<(String, f64)>,
}

/// Where an instrument is.
#[derive(Clone, Debug, Serialize)]
pub struct Instrument {
    /// The frame that it observes.
    pub frame: String,
    /// Its axes in the world, row by row.
    pub axes: [f64; 9],
    /// Its origin in the world, m.
    pub point: [f64; 3],
}

impl Calibrated {
    /// The version of the JSON.
    pub const VERSION: usize = 1;

    /// What a fit found.
    pub fn of_fit(robot: &str, problem: &Problem<'_>, fit: &Fit, confidence: f64) -> Self {
        let measured = fit.groups.iter().map(|group| MeasuredFit {
            what: group_name(problem, group.group),
            unit: match group.group {
                Group::Lengths(_) | Group::ReadLengths => "m",
                Group::Angles(_) | Group::ReadAngles => "rad",
            },
            numbers: group.count,
            sigma: group.sigma,
            stated: group.is_stated,
            before: group.before,
            after: group.after,
            unseen: group.unseen,
        });
        let estimates = fit.estimates.iter().map(|found| FoundNumber {
            name: found.name.clone(),
            unit: unit(found.unit),
            nominal: found.nominal,
            value: Some(found.value),
            sigma: Some(found.sigma),
            interval: Some(found.interval),
        });
        let sensors = problem.sensors.iter().zip(&fit.mountings);
        let instruments = sensors
            .filter(|(sensor, _)| sensor.mounting.unknown && sensor.kind != Kind::Gravity)
            .map(|(sensor, mounting)| Instrument {
                frame: sensor.name.clone(),
                axes: core::array::from_fn(|k| mounting.axes[(k / 3, k % 3)]),
                point: mounting.point.into(),
            });
        Self {
            version: Self::VERSION,
            robot: robot.to_owned(),
            poses: fit.poses,
            outliers: fit.outliers.clone(),
            unreachable: fit.unreachable.clone(),
            confidence,
            measured: measured.collect(),
            estimates: estimates.collect(),
            fixed: fixed(&fit.fixed),
            correlated: fit.correlated.clone(),
            instruments: instruments.collect(),
            chi_square: fit.chi_square.map(|(value, _)| value),
            degrees_of_freedom: fit.chi_square.map(|(_, degrees)| degrees),
            converged: Some(fit.converged),
            doubts: Vec::new(),
        }
    }

    /// What measurements could tell.
    pub fn of_known(robot: &str, problem: &Problem<'_>, known: &Known, confidence: f64) -> Self {
        let unknowns = problem.geometry.unknowns().iter();
        let kept = unknowns.filter(|unknown| known.kept.contains(&unknown.name));
        Self {
            version: Self::VERSION,
            robot: robot.to_owned(),
            poses: 0,
            outliers: Vec::new(),
            unreachable: Vec::new(),
            confidence,
            measured: Vec::new(),
            estimates: kept
                .map(|unknown| FoundNumber {
                    name: unknown.name.clone(),
                    unit: unit(unknown.unit),
                    nominal: unknown.nominal,
                    value: None,
                    sigma: None,
                    interval: None,
                })
                .collect(),
            fixed: fixed(&known.fixed),
            correlated: Vec::new(),
            instruments: Vec::new(),
            chi_square: None,
            degrees_of_freedom: None,
            converged: None,
            doubts: Vec::new(),
        }
    }
}

fn unit(unit: Unit) -> &'static str {
    match unit {
        Unit::Angle => "rad",
        Unit::Length => "m",
        Unit::Plain => "",
    }
}

fn group_name(problem: &Problem<'_>, group: Group) -> String {
    let of = |k: usize| problem.sensors.get(k).map_or("", |s| s.name.as_str());
    match group {
        Group::Lengths(k) => format!("{}, lengths", of(k)),
        Group::Angles(k) => format!("{}, angles", of(k)),
        Group::ReadAngles => "readings of angles".to_owned(),
        Group::ReadLengths => "readings of lengths".to_owned(),
    }
}

fn fixed(all: &[Fixed]) -> Vec<FixedNumber> {
    let each = all.iter().map(|fixed| FixedNumber {
        name: fixed.name.clone(),
        why: match fixed.why {
            Why::Silent => "silent",
            Why::Absorbed if fixed.by.is_empty() => "instrument",
            Why::Absorbed => "absorbed",
            Why::LoopsFixed => "loops",
            Why::NotShown => "not shown",
        },
        by: fixed.by.clone(),
    });
    each.collect()
}

/// A label with words in lines that fit beside it.
fn listed(label: &str, words: &[String]) -> String {
    let mut lines = vec![String::new()];
    for word in words {
        let line = lines.last().map_or(0, String::len);
        if line > 0 && line + word.len() + 2 > 60 {
            lines.push(String::new());
        }
        if let Some(line) = lines.last_mut() {
            if !line.is_empty() {
                line.push_str(", ");
            }
            line.push_str(word);
        }
    }
    field(label, &lines.join("\n"))
}

/// A factor of a combination, and the name of what it multiplies.
fn term(name: &str, factor: f64) -> String {
    let size = factor.abs();
    let sign = if factor < 0.0 { "-" } else { "+" };
    if (size - 1.0).abs() < 1e-9 {
        format!("{sign} {name}")
    } else {
        format!("{sign} {} {name}", figure_of(4, size))
    }
}

/// The tables of a calibration.
pub fn calibrated_text(found: &Calibrated) -> String {
    let mut out = match found.poses {
        0 => format!("{}: what such measurements can tell\n", found.robot),
        poses => format!("{}, {poses} poses\n", found.robot),
    };
    for (label, rows) in [
        ("left out", &found.outliers),
        ("not reached", &found.unreachable),
    ] {
        if !rows.is_empty() {
            let rows: Vec<String> = rows.iter().map(u64::to_string).collect();
            out.push_str(&listed(label, &rows));
        }
    }
    if let (Some(chi), Some(degrees)) = (found.chi_square, found.degrees_of_freedom) {
        let text = format!("{} with {degrees} degrees of freedom", figure_of(4, chi));
        out.push_str(&field("chi-square", &text));
    }
    if !found.measured.is_empty() {
        let head = [
            "measured", "numbers", "noise", "before", "after", "unseen", "unit",
        ];
        let mut table = Vec::new();
        for row in &found.measured {
            let noise = figure_of(3, row.sigma);
            table.push(vec![
                row.what.clone(),
                row.numbers.to_string(),
                if row.stated {
                    noise
                } else {
                    format!("{noise} found")
                },
                figure_of(3, row.before),
                figure_of(3, row.after),
                figure_of(3, row.unseen),
                row.unit.to_owned(),
            ]);
        }
        out.push('\n');
        out.push_str(&columns(&head, &table));
    }
    out.push('\n');
    if found.poses == 0 {
        let names: Vec<String> = found.estimates.iter().map(|e| e.name.clone()).collect();
        out.push_str(&listed("found", &names));
    } else {
        let head = ["unknown", "nominal", "found", "change", "sigma", "unit"];
        let mut table = Vec::new();
        for row in &found.estimates {
            let value = row.value.unwrap_or(f64::NAN);
            table.push(vec![
                row.name.clone(),
                figure_of(6, row.nominal),
                figure_of(6, value),
                figure_of(3, value - row.nominal),
                figure_of(2, row.sigma.unwrap_or(f64::NAN)),
                row.unit.to_owned(),
            ]);
        }
        out.push_str(&columns(&head, &table));
    }
    let mut stands: Vec<(String, Vec<String>)> = Vec::new();
    for fixed in &found.fixed {
        for (name, factor) in &fixed.by {
            let text = term(&fixed.name, *factor);
            match stands.iter_mut().find(|(own, _)| own == name) {
                Some((_, terms)) => terms.push(text),
                None => stands.push((name.clone(), vec![text])),
            }
        }
    }
    if !stands.is_empty() {
        out.push_str("\nnot told apart, found as one\n");
        for (name, terms) in &stands {
            let _ = writeln!(out, "  {name} {}", terms.join(" "));
        }
    }
    out.push('\n');
    for (why, label) in [
        ("silent", "no effect"),
        ("instrument", "as the instrument"),
        ("loops", "held by loops"),
        ("not shown", "not shown"),
    ] {
        let names = found.fixed.iter().filter(|fixed| fixed.why == why);
        let names: Vec<String> = names.map(|fixed| fixed.name.clone()).collect();
        if !names.is_empty() {
            out.push_str(&listed(label, &names));
        }
    }
    for (a, b, value) in &found.correlated {
        let text = format!("{a} and {b} by {}", figure_of(3, *value));
        out.push_str(&field("correlated", &text));
    }
    if found.converged == Some(false) {
        out.push_str(
            "the search did not end at a minimum: the values are not those that fit best\n",
        );
    }
    for doubt in &found.doubts {
        let _ = writeln!(out, "warning: {doubt}");
    }
    out
}
