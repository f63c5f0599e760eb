//! A calibration as text, and its JSON.

use std::fmt::Write as _;

use regen_calibrate::{Chosen, Fit, Fixed, Group, Kind, Known, Problem, Unit, Why};
use regen_codegen::explain::lines::{columns, field};
use regen_identify::text::{counted, figure_of};
use serde::Serialize;

use super::identification::{Field, fields};

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
    /// How well poses that were chosen show the geometry.
    pub choice: Option<ChosenPoses>,
}

/// How well poses that were chosen show the geometry.
#[derive(Clone, Debug, Serialize)]
pub struct ChosenPoses {
    /// The columns of the measured coordinates.
    pub columns: Vec<String>,
    /// The poses in these columns and their units, in the order in which they are taken.
    pub rows: Vec<Vec<f64>>,
    /// The number of poses from which they were chosen.
    pub candidates: usize,
    /// The rows of poses that are not reached from the one before them, but from home.
    pub from_home: Vec<u64>,
    /// The observability indices O1 to O5 and the logarithm of the determinant.
    pub indices: Vec<Compared>,
    /// The deviation of each number that is found, with as many poses at random.
    pub random_sigmas: Vec<f64>,
}

/// A measure of poses that were chosen, and of as many at random.
#[derive(Clone, Debug, Serialize)]
pub struct Compared {
    /// Its name.
    pub name: &'static str,
    /// Of the chosen poses.
    pub chosen: f64,
    /// Of the set of the median determinant among those at random.
    pub random: f64,
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
    /// rad, m, rad/(N m), m/N, or nothing.
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
    /// The found numbers that its error changes, each with the change for a unit error, and that as an
    /// expression where it is one of lengths of the description.
    pub by: Vec<(String, f64, Option<String>)>,
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
            choice: None,
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
            choice: None,
        }
    }

    /// States factors as expressions: one for each entry of each number that stays.
    pub fn set_exact(&mut self, exact: Vec<Vec<Option<String>>>) {
        for (fixed, exact) in self.fixed.iter_mut().zip(exact) {
            for (by, exact) in fixed.by.iter_mut().zip(exact) {
                by.2 = exact;
            }
        }
    }

    /// What is to be expected of poses that were chosen.
    ///
    /// - `chosen`: with the titles of the coordinates' columns, and the poses in these and their units.
    pub fn of_chosen(
        robot: &str,
        problem: &Problem<'_>,
        known: &Known,
        (chosen, columns, rows): (&Chosen, Vec<String>, Vec<Vec<f64>>),
    ) -> Self {
        let mut out = Self::of_known(robot, problem, known, 0.95);
        out.poses = chosen.states.len();
        for (row, sigma) in out.estimates.iter_mut().zip(&chosen.design.sigmas) {
            row.sigma = Some(*sigma);
        }
        let (own, random) = (&chosen.design, &chosen.random);
        let [o, p] = [own.observability, random.observability];
        let indices = [
            ("O1", o.mean, p.mean),
            ("O2", o.inverse_condition, p.inverse_condition),
            ("O3", o.smallest, p.smallest),
            ("O4", o.noise_amplification, p.noise_amplification),
            ("O5", o.harmonic, p.harmonic),
            ("log det", own.log_determinant, random.log_determinant),
        ];
        let indices = indices.map(|(name, chosen, random)| Compared {
            name,
            chosen,
            random,
        });
        out.choice = Some(ChosenPoses {
            columns,
            rows,
            candidates: chosen.candidates,
            // the first row of a file has titles
            from_home: chosen.from_home.iter().map(|k| *k as u64 + 2).collect(),
            indices: indices.into(),
            random_sigmas: random.sigmas.clone(),
        });
        out
    }
}

/// What is to be expected of chosen poses, in tables.
pub fn chosen_text(found: &Calibrated) -> String {
    let Some(choice) = &found.choice else {
        return String::new();
    };
    let mut out = format!(
        "{}, {} of {}\n",
        found.robot,
        counted(found.poses, "pose", "poses"),
        choice.candidates
    );
    if !choice.from_home.is_empty() {
        out.push_str(&field("from home", &listed(&choice.from_home)));
    }
    let rows = choice.indices.iter().map(|own| {
        let [chosen, random] = [own.chosen, own.random].map(|x| figure_of(3, x));
        vec![own.name.to_owned(), chosen, random]
    });
    out.push('\n');
    out.push_str(&columns(
        &["index", "chosen", "at random"],
        &rows.collect::<Vec<_>>(),
    ));
    let rows = found.estimates.iter().zip(&choice.random_sigmas);
    let rows = rows.map(|(own, random)| {
        let [chosen, random] = [own.sigma.unwrap_or(f64::NAN), *random].map(|x| figure_of(2, x));
        vec![own.name.clone(), chosen, random, own.unit.to_owned()]
    });
    out.push('\n');
    out.push_str(&columns(
        &["sigma of", "chosen", "at random", "unit"],
        &rows.collect::<Vec<_>>(),
    ));
    out
}

fn unit(unit: Unit) -> &'static str {
    match unit {
        Unit::Angle => "rad",
        Unit::Length => "m",
        Unit::AngleByEffort => "rad/(N m)",
        Unit::LengthByEffort => "m/N",
        Unit::Plain => "",
    }
}

pub(crate) fn group_name(problem: &Problem<'_>, group: Group) -> String {
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
        by: fixed
            .by
            .iter()
            .map(|(name, factor)| (name.clone(), *factor, None))
            .collect(),
    });
    each.collect()
}

/// A factor of a combination, and the name of what it multiplies.
fn term(name: &str, factor: f64, exact: Option<&str>) -> String {
    let sign = if factor < 0.0 { "-" } else { "+" };
    let size = exact.map(|exact| exact.trim_start_matches('-'));
    // the expression may be negative where its value is not
    let sign = exact.map_or(sign, |own| if own.starts_with('-') { "-" } else { "+" });
    match size.map(|size| (size, size.split_once('/'))) {
        None => format!("{sign} {} {name}", figure_of(4, factor.abs())),
        Some(("1", _)) => format!("{sign} {name}"),
        Some((_, Some(("1", below)))) => format!("{sign} {name}/{below}"),
        Some((size, Some(_))) if !size.starts_with('(') => format!("{sign} ({size}) {name}"),
        Some((size, _)) => format!("{sign} {size} {name}"),
    }
}

/// What is said of the whole fit.
pub(crate) fn facts(found: &Calibrated) -> Vec<Field> {
    let mut out = Vec::new();
    for (label, rows) in [
        ("left out", &found.outliers),
        ("not reached", &found.unreachable),
    ] {
        if !rows.is_empty() {
            out.push((label, listed(rows)));
        }
    }
    if let (Some(chi), Some(degrees)) = (found.chi_square, found.degrees_of_freedom) {
        let degrees = counted(degrees, "degree of freedom", "degrees of freedom");
        let text = format!("{} with {degrees}", figure_of(4, chi));
        out.push(("chi-square", text));
    }
    if found.converged == Some(false) {
        let text = "did not end at a minimum: the values are not those that fit best";
        out.push(("search", text.to_owned()));
    }
    out
}

/// The titles and the rows of the table of what was measured.
pub(crate) fn measured_rows(found: &Calibrated) -> ([&'static str; 7], Vec<Vec<String>>) {
    let head = [
        "measured", "numbers", "noise", "before", "after", "unseen", "unit",
    ];
    let rows = found.measured.iter().map(|row| {
        let noise = figure_of(3, row.sigma);
        vec![
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
        ]
    });
    (head, rows.collect())
}

/// The sums of errors that are found as one, and whether any of their factors holds for this geometry alone.
pub(crate) fn combinations(found: &Calibrated) -> (Vec<String>, bool) {
    let mut has_numbers = false;
    let mut stands: Vec<(&str, String)> = Vec::new();
    for fixed in &found.fixed {
        for (name, factor, exact) in &fixed.by {
            has_numbers |= exact.is_none();
            let text = term(&fixed.name, *factor, exact.as_deref());
            match stands.iter_mut().find(|(own, _)| own == name) {
                Some((_, sum)) => sum.push_str(&(" ".to_owned() + &text)),
                None => stands.push((name, format!("{name} {text}"))),
            }
        }
    }
    (
        stands.into_iter().map(|(_, sum)| sum).collect(),
        has_numbers,
    )
}

/// What stays at its nominal value, why, and what is correlated.
pub(crate) fn stays(found: &Calibrated) -> Vec<Field> {
    let mut out = Vec::new();
    for (why, label) in [
        ("silent", "no effect"),
        ("instrument", "as the instrument"),
        ("loops", "held by loops"),
        ("not shown", "not shown"),
    ] {
        let names = found.fixed.iter().filter(|fixed| fixed.why == why);
        let names: Vec<&str> = names.map(|fixed| fixed.name.as_str()).collect();
        if !names.is_empty() {
            out.push((label, listed(&names)));
        }
    }
    for (a, b, value) in &found.correlated {
        let text = format!("{a} and {b} by {}", figure_of(3, *value));
        out.push(("correlated", text));
    }
    out
}

fn listed<T: ToString>(all: &[T]) -> String {
    let all: Vec<String> = all.iter().map(T::to_string).collect();
    all.join(", ")
}

/// The tables of a calibration.
pub fn calibrated_text(found: &Calibrated) -> String {
    let mut out = match found.poses {
        0 => format!("{}: what such measurements can tell\n", found.robot),
        poses => format!("{}, {}\n", found.robot, counted(poses, "pose", "poses")),
    };
    out.push_str(&fields(&facts(found)));
    if !found.measured.is_empty() {
        let (head, rows) = measured_rows(found);
        out.push('\n');
        out.push_str(&columns(&head, &rows));
    }
    out.push('\n');
    if found.poses == 0 {
        let names: Vec<&str> = found.estimates.iter().map(|e| e.name.as_str()).collect();
        out.push_str(&field("found", &listed(&names)));
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
    let (sums, has_numbers) = combinations(found);
    if !sums.is_empty() {
        out.push_str("\nnot told apart, found as one");
        out.push_str(if has_numbers {
            "; factors in digits are of this geometry alone\n"
        } else {
            "\n"
        });
        for sum in &sums {
            let _ = writeln!(out, "  {sum}");
        }
    }
    out.push('\n');
    out.push_str(&fields(&stays(found)));
    for doubt in &found.doubts {
        let _ = writeln!(out, "warning: {doubt}");
    }
    out
}
