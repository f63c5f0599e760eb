//! The page of a calibration.

use std::fmt::Write as _;

use regen_calibrate::{Fit, Group, Kind, Pose, Problem};
use regen_identify::text::counted;

use crate::ReportError;
use crate::charts::{self, BLUE, Figure, GREY, LINE_COLOURS, Line, Look, RED};
use crate::figures::slug;
use crate::page::{escaped, figure, four, label, section, table, terms, whole};
use crate::results::{
    Calibrated, calibration_facts, calibration_stays, combinations, group_name, measured_rows,
};

/// How many rows of the largest residuals are listed.
const WORST_ROWS: usize = 10;
/// The longest vector of a map, as a part of its width.
const VECTOR_PART: f64 = 0.1;
/// Width and height of the ground of a map, px.
const MAP_PX: [f64; 2] = [674.0, 300.0];

/// The page of a calibration, as HTML that needs no network: how well each kind of measurement is predicted with
/// the description and with what was found, the residuals of both, where the poses are, and what was found with
/// deviations and with what it stands for.
///
/// - `found`: with the doubts and factors that were added to it;
/// - `problem`: with all poses, as it was solved;
/// - `fit`: its result.
///
/// # Errors
/// When a figure cannot be drawn.
///
/// ```
/// # use nalgebra::DMatrix;
/// # use regen_calibrate::{
/// #     Amount, Axis, Chain, Geometry, Kind, Kinematics, Mounting, Problem, Sensor, Simulation, Step, Unit, Unknown,
/// # };
/// # struct Arm([Unknown; 1]);
/// # impl Geometry for Arm {
/// #     fn unknowns(&self) -> &[Unknown] { &self.0 }
/// #     fn scalars(&self, values: &[f64]) -> Option<Vec<f64>> { Some(values.to_vec()) }
/// #     fn slopes(&self, _values: &[f64]) -> DMatrix<f64> { DMatrix::identity(1, 1) }
/// # }
/// # let length = Unknown { name: "arm".to_owned(), unit: Unit::Length, nominal: 0.4 };
/// # let turn = Step { turns: true, axis: Axis::Z, amount: Amount::Coordinate(0, 1.0) };
/// # let arm = Step { turns: false, axis: Axis::X, amount: Amount::Scalar(0) };
/// # let kinematics = Kinematics {
/// #     coordinates: vec!["q1".to_owned()],
/// #     scalars: 1,
/// #     links: vec![Chain { parent: None, steps: vec![turn] }],
/// #     frames: vec![("tip".to_owned(), Chain { parent: Some(0), steps: vec![arm] })],
/// #     home: vec![0.0],
/// #     ..Kinematics::default()
/// # };
/// # let wire = Sensor {
/// #     name: "wire".to_owned(),
/// #     kind: Kind::Distance,
/// #     frame: 0,
/// #     mounting: Mounting { point: [1.0, 0.0, 0.0].into(), ..Mounting::WORLD },
/// #     noise: Some(1e-4),
/// #     noise_of_angles: None,
/// # };
/// # let problem = Problem {
/// #     kinematics: &kinematics,
/// #     geometry: &Arm([length]),
/// #     measured: &[0],
/// #     noise_of_readings: &[Some(0.0)],
/// #     sensors: &[wire],
/// #     tolerance: None,
/// #     efforts: None,
/// #     poses: &[],
/// # };
/// use regen_report::{calibrated, results::Calibrated};
///
/// // an arm whose length is found with a wire, as in the example of `regen_calibrate`
/// let what = Simulation { poses: 20, errors: 1e-2, noise: [1e-4, 1e-4], seed: 1 };
/// let (_, poses) = problem.simulate(&what)?;
/// let problem = Problem { poses: &poses, ..problem };
/// let fit = problem.calibrate(0.95)?;
/// let page = calibrated(&Calibrated::of_fit("<arm>", &problem, &fit, 0.95), &problem, &fit)?;
/// assert!(page.contains("<h1>Calibration of &lt;arm&gt;</h1>") && page.contains("20 poses"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn calibrated(
    found: &Calibrated,
    problem: &Problem<'_>,
    fit: &Fit,
) -> Result<String, ReportError> {
    let body = [
        summary(found),
        residuals(found, problem, fit)?,
        geometry(found),
        poses(problem, fit)?,
    ];
    let title = format!("Calibration of {}", escaped(&found.robot));
    Ok(whole(&title, &body.concat()))
}

fn summary(found: &Calibrated) -> String {
    let mut rows = vec![("measured", counted(found.poses, "pose", "poses"))];
    rows.extend(calibration_facts(found));
    let mut out = terms(&rows);
    if !found.doubts.is_empty() {
        out.push_str(
            "<div class=\"doubt\">\n<p>The measurements may have been misread:</p>\n<ul>\n",
        );
        for doubt in &found.doubts {
            let _ = writeln!(out, "<li>{}</li>", escaped(doubt));
        }
        out.push_str("</ul>\n</div>\n");
    }
    section("summary", "What was measured", &out)
}

/// The poses that were used, in the order of their residuals, as indices into the problem's: rows of several logs
/// have the same numbers.
fn used_poses(problem: &Problem<'_>, fit: &Fit) -> Vec<usize> {
    let mut rest = problem.poses.iter().enumerate();
    let own = fit.residuals.iter();
    own.filter_map(|own| Some(rest.find(|(_, pose)| pose.row == own.row)?.0))
        .collect()
}

/// The numbers of one kind at a pose that was used.
struct AtPose<'p> {
    pose: &'p Pose,
    before: Vec<f64>,
    after: Vec<f64>,
}

/// The residuals of one kind, pose by pose.
fn of_group<'p>(problem: &Problem<'p>, fit: &Fit, group: Group) -> Vec<AtPose<'p>> {
    let used = used_poses(problem, fit);
    let own = fit.residuals.iter().zip(&used).filter_map(|(own, k)| {
        let of = |values: &[f64]| -> Vec<f64> {
            let own = own.groups.iter().zip(values);
            own.filter(|(own, _)| **own == group)
                .map(|(_, x)| *x)
                .collect()
        };
        Some(AtPose {
            pose: problem.poses.get(*k)?,
            before: of(&own.before),
            after: of(&own.after),
        })
    });
    own.filter(|at| !at.after.is_empty()).collect()
}

fn is_length(group: Group) -> bool {
    matches!(group, Group::Lengths(_) | Group::ReadLengths)
}

fn residuals(found: &Calibrated, problem: &Problem<'_>, fit: &Fit) -> Result<String, ReportError> {
    let (head, rows) = measured_rows(found);
    let rows: Vec<Vec<String>> = rows
        .iter()
        .map(|row| row.iter().map(|cell| escaped(cell)).collect())
        .collect();
    let caption = "Root mean squares of the residuals: before, with the description, where only the instruments were \
                   placed; after, with what was found; unseen, of fits without the pose at which they count";
    let mut out = table(caption, &head, &rows);
    for own in &fit.groups {
        let name = group_name(problem, own.group);
        let poses = of_group(problem, fit, own.group);
        let unit = if is_length(own.group) { "mm" } else { "mrad" };
        let drawn = |of: for<'a> fn(&'a AtPose<'_>) -> &'a [f64]| -> Vec<Line> {
            let count = poses.iter().map(|pose| of(pose).len()).max().unwrap_or(0);
            let axes = if count == 3 { ["x", "y", "z"] } else { [""; 3] };
            let dyes = LINE_COLOURS.iter().cycle();
            let lines = (0..count).zip(dyes).map(|(k, dye)| Line {
                label: axes.get(k).copied().unwrap_or_default().to_owned(),
                points: (poses.iter())
                    .filter_map(|pose| Some((pose.pose.row as f64, 1e3 * of(pose).get(k)?)))
                    .collect(),
                dye: *dye,
                look: Look::Dots,
            });
            lines.collect()
        };
        let [above, below] = ["before", "after"].map(|what| format!("{what}, {unit}"));
        let (before, after) = (drawn(|own| &own.before), drawn(|own| &own.after));
        out.push_str(&figure(&Figure {
            name: format!("residuals-{}", slug(&name)),
            caption: format!("residuals of {name}, pose by pose: predicted less measured"),
            svg: charts::two_panels("row of the log", [&above, &below], &before, &after)?,
        }));
    }
    for (k, sensor) in problem.sensors.iter().enumerate() {
        if matches!(sensor.kind, Kind::Pose | Kind::Point) {
            out.push_str(&maps(problem, fit, k)?);
        }
    }
    out.push_str(&worst(problem, fit));
    Ok(section("residuals", "Residuals before and after", &out))
}

/// The point that a sensor measured at a pose, in its own frame, m.
fn seen(pose: &Pose, sensor: usize) -> Option<[f64; 3]> {
    let values = pose.values.get(sensor)?.as_ref()?;
    values.last_chunk().copied()
}

/// A magnification of one digit by which no vector is longer than wanted.
fn magnified(longest: f64, wanted: f64) -> f64 {
    let most = wanted / longest;
    let decade = libm::pow(10.0, libm::floor(libm::log10(most)));
    let digit = [5.0, 2.0, 1.0]
        .into_iter()
        .find(|digit| digit * decade <= most);
    match digit.unwrap_or(1.0) * decade {
        factor if factor.is_finite() => factor.max(1.0),
        _ => 1.0,
    }
}

/// Points that a sensor measured with the vectors of their residuals, from above and from the side.
fn maps(problem: &Problem<'_>, fit: &Fit, sensor: usize) -> Result<String, ReportError> {
    let mut out = String::new();
    let used = used_poses(problem, fit);
    let points = |is_wanted: bool| -> Vec<[f64; 3]> {
        let poses = problem.poses.iter().enumerate();
        let own = poses.filter(|(k, _)| used.contains(k) == is_wanted);
        own.filter_map(|(_, pose)| seen(pose, sensor)).collect()
    };
    let (kept, left_out) = (points(true), points(false));
    let arrows: Vec<([f64; 3], [[f64; 3]; 2])> = (of_group(problem, fit, Group::Lengths(sensor))
        .iter())
    .filter_map(|own| {
        let both = [own.before.first_chunk()?, own.after.first_chunk()?];
        Some((seen(own.pose, sensor)?, both.map(|vector| *vector)))
    })
    .collect();
    let ends = |k: usize| {
        let all = kept.iter().chain(&left_out);
        let own = all.map(|point| point[k]).filter(|x| x.is_finite());
        own.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], x| {
            [lo.min(x), hi.max(x)]
        })
    };
    let spans: [[f64; 2]; 3] = core::array::from_fn(ends);
    let widest = spans
        .iter()
        .fold(0.0_f64, |most, [lo, hi]| most.max(hi - lo));
    let longest = |which: usize| {
        let own = arrows.iter().map(|(_, both)| {
            let squares = both.get(which).into_iter().flatten().map(|x| x * x);
            libm::sqrt(squares.sum())
        });
        own.fold(0.0, f64::max)
    };
    let factors = [0, 1].map(|which| magnified(longest(which), VECTOR_PART * widest));
    let name = problem
        .sensors
        .get(sensor)
        .map_or("", |own| own.name.as_str());
    for (across, up) in [(0, 1), (0, 2)] {
        let vectors = |which: usize, dye| {
            let factor = factors[which];
            let what = ["before", "after"][which];
            let mut points = Vec::new();
            for (from, both) in &arrows {
                let Some(vector) = both.get(which) else {
                    continue;
                };
                points.push((from[across], from[up]));
                points.push((
                    from[across] + factor * vector[across],
                    from[up] + factor * vector[up],
                ));
                points.push((f64::NAN, f64::NAN));
            }
            Line {
                label: format!("{what}, {factor} times"),
                points,
                dye,
                look: Look::Solid,
            }
        };
        let dots = |points: &[[f64; 3]], label: &str, dye| Line {
            label: label.to_owned(),
            points: (points.iter())
                .map(|point| (point[across], point[up]))
                .collect(),
            dye,
            look: Look::Dots,
        };
        let mut lines = vec![
            vectors(0, GREY),
            vectors(1, BLUE),
            dots(&kept, "measured point", BLUE),
            ground(&spans[across], &spans[up]),
        ];
        if !left_out.is_empty() {
            lines.push(dots(&left_out, "left out", RED));
        }
        let [x, y] = [across, up].map(|k| ["x, m", "y, m", "z, m"][k]);
        out.push_str(&figure(&Figure {
            name: format!("map-{}-{}", slug(name), ["xy", "xz"][up - 1]),
            caption: format!(
                "points of {name} in the frame of the instrument, with the vectors from where they were measured to \
                 where they are predicted"
            ),
            svg: charts::lines(x, y, 366, &lines)?,
        }));
    }
    Ok(out)
}

/// Two points that are not drawn, by which lengths are as long across as up.
fn ground(across: &[f64; 2], up: &[f64; 2]) -> Line {
    let size = |[lo, hi]: &[f64; 2]| (1.0 + 2.0 * VECTOR_PART) * (hi - lo).max(1e-6);
    let unit = (size(across) / MAP_PX[0]).max(size(up) / MAP_PX[1]);
    let end = |[lo, hi]: &[f64; 2], px: f64, side: f64| 0.5 * (lo + hi) + side * 0.5 * unit * px;
    let corner = |side| (end(across, MAP_PX[0], side), end(up, MAP_PX[1], side));
    Line {
        label: String::new(),
        points: vec![corner(-1.0), (f64::NAN, f64::NAN), corner(1.0)],
        dye: GREY,
        look: Look::Solid,
    }
}

/// The poses of the largest residuals, each with its largest.
fn worst(problem: &Problem<'_>, fit: &Fit) -> String {
    let sigma = |group: Group| {
        let own = fit.groups.iter().find(|own| own.group == group);
        own.map_or(f64::NAN, |own| own.sigma)
    };
    let mut all: Vec<(f64, Vec<String>)> = Vec::new();
    for pose in &fit.residuals {
        let numbers = pose.groups.iter().zip(pose.before.iter().zip(&pose.after));
        let sized = numbers.map(|(group, (before, after))| {
            ((after / sigma(*group)).abs(), *group, *before, *after)
        });
        let Some((size, group, before, after)) = sized.max_by(|a, b| a.0.total_cmp(&b.0)) else {
            continue;
        };
        let unit = if is_length(group) { "mm" } else { "mrad" };
        let cells = vec![
            pose.row.to_string(),
            escaped(&group_name(problem, group)),
            four(1e3 * before),
            four(1e3 * after),
            unit.to_owned(),
            format!("{size:.2}"),
        ];
        all.push((size, cells));
    }
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    all.truncate(WORST_ROWS);
    let rows: Vec<Vec<String>> = all.into_iter().map(|(_, cells)| cells).collect();
    let caption = "The poses of the largest residuals, each with its largest, and that in deviations of its noise";
    table(
        caption,
        &["row", "measured", "before", "after", "unit", "deviations"],
        &rows,
    )
}

fn geometry(found: &Calibrated) -> String {
    let rows: Vec<Vec<String>> = found
        .estimates
        .iter()
        .map(|own| {
            let value = own.value.unwrap_or(f64::NAN);
            vec![
                label(&own.name),
                six(own.nominal),
                six(value),
                four(value - own.nominal),
                four(own.sigma.unwrap_or(f64::NAN)),
                (own.interval).map_or_else(|| "–".to_owned(), |ends| ends.map(six).join(" … ")),
                own.unit.to_owned(),
            ]
        })
        .collect();
    let caption = format!(
        "What was found, with standard deviations and intervals of {} % confidence",
        100.0 * found.confidence
    );
    let head = [
        "unknown", "nominal", "found", "change", "σ", "interval", "unit",
    ];
    let mut out = table(&caption, &head, &rows);
    let (sums, has_numbers) = combinations(found);
    if !sums.is_empty() {
        let of_this = if has_numbers {
            "; factors in digits are of this geometry alone"
        } else {
            ""
        };
        let _ = writeln!(out, "<p>Not told apart, found as one{of_this}:</p>\n<ul>");
        for sum in sums {
            let _ = writeln!(out, "<li>{}</li>", escaped(&sum));
        }
        out.push_str("</ul>\n");
    }
    out.push_str(&terms(&calibration_stays(found)));
    let rows: Vec<Vec<String>> = found
        .instruments
        .iter()
        .map(|own| {
            let mut cells = vec![escaped(&own.frame)];
            cells.extend(own.point.iter().map(|x| six(*x)));
            let [x, y, z] = [0, 1, 2].map(|k| {
                let axis = own.axes.iter().skip(k).step_by(3);
                axis.map(|x| four(*x)).collect::<Vec<_>>().join(", ")
            });
            cells.extend([x, y, z]);
            cells
        })
        .collect();
    if !rows.is_empty() {
        out.push_str(&table(
            "Where the instruments are: origin in the world, m, and axes",
            &["instrument", "x", "y", "z", "x axis", "y axis", "z axis"],
            &rows,
        ));
    }
    section("geometry", "Geometry", &out)
}

/// A number with six digits behind the point, which show what is found of it.
fn six(value: f64) -> String {
    if value.is_finite() && value.abs() < 1e3 {
        format!("{value:.6}")
    } else {
        four(value)
    }
}

/// The readings of all poses, with those that were left out.
fn poses(problem: &Problem<'_>, fit: &Fit) -> Result<String, ReportError> {
    let mut out = String::new();
    let used = used_poses(problem, fit);
    for (turns, name, unit) in [(true, "turns", "rad"), (false, "shifts", "m")] {
        let own: Vec<usize> = (0..problem.measured.len())
            .filter(|k| {
                problem
                    .measured
                    .get(*k)
                    .is_some_and(|c| problem.turns(*c) == turns)
            })
            .collect();
        if own.is_empty() {
            continue;
        }
        let points = |k: usize, left_out: bool| -> Vec<(f64, f64)> {
            let poses = problem.poses.iter().enumerate();
            let poses = poses.filter(|(at, _)| used.contains(at) != left_out);
            poses
                .filter_map(|(_, pose)| Some((pose.row as f64, *pose.readings.get(k)?)))
                .collect()
        };
        let of = |k: usize| {
            let c = problem.measured.get(k).copied();
            let name = c.and_then(|c| problem.kinematics.coordinates.get(c));
            name.cloned().unwrap_or_default()
        };
        let dyes = LINE_COLOURS.iter().cycle();
        let mut lines: Vec<Line> = (own.iter().zip(dyes))
            .map(|(k, dye)| Line {
                label: of(*k),
                points: points(*k, false),
                dye: *dye,
                look: Look::Dots,
            })
            .collect();
        let left_out: Vec<(f64, f64)> = own.iter().flat_map(|k| points(*k, true)).collect();
        if !left_out.is_empty() {
            lines.push(Line {
                label: "left out".to_owned(),
                points: left_out,
                dye: RED,
                look: Look::Dots,
            });
        }
        out.push_str(&figure(&Figure {
            name: format!("poses-{name}"),
            caption: "readings of the measured coordinates, pose by pose".to_owned(),
            svg: charts::lines("row of the log", &format!("reading, {unit}"), 250, &lines)?,
        }));
    }
    Ok(section("poses", "Poses", &out))
}
