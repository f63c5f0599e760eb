//! `regen calibrate`: the geometry of a mechanism from poses that were measured.

use std::path::{Path, PathBuf};

use regen_calibrate::{
    CalibrateError, Convention, Efforts, Geometry, Kind, Mounting, Pose, Problem, Sensor,
    Simulation,
};
use regen_codegen::diag::Source;
use regen_codegen::explain::lines::columns;
use regen_codegen::pipeline::Mechanism;
use regen_codegen::robot::Robot;
use regen_codegen::spec::edit::{Spot, with_geometry, with_placements};
use regen_codegen::spec::{nearest, parse};
use regen_identify::data::{Assignment, Quantity, RawLog, Run, Settings, ValuesFrom};
use regen_identify::experiment_file::{
    Calibration, ExperimentFile, MeasuredFrame, MeasuredKind, Purpose,
};
use regen_identify::text::{counted, figure_of};
use regen_interpreted::{ChosenGeometry, Described, NominalEfforts};
use regen_report::results::{Calibrated, calibrated_text};
use regen_runtime::Info;

use crate::args::{CalibrateArgs, Format, require_unread};
use crate::exit::Failure;
use crate::{load, mistakes, table, terminal, write};

/// The hint for a file that is not an experiment.
const OTHER_FILE: &str = "an experiment file with the key `calibrate`; `regen schema experiment` \
                          describes it";

/// The angle beyond which rotations are not given in rad: a little more than a turn.
const LARGEST_ANGLE: f64 = 6.5;

/// Runs the command.
pub(crate) fn run(args: &CalibrateArgs) -> Result<(), Failure> {
    let confidence = args.confidence.unwrap_or(0.95);
    if !(confidence > 0.0 && confidence < 1.0) {
        return Err(Failure::Usage(
            "--confidence is a number between 0 and 1, such as 0.95".to_owned(),
        ));
    }
    let spec = load::source(&args.spec)?;
    let mechanism = load::mechanism(&spec)?;
    let robot = mechanism.robot(&[])?;
    let described = Described::new(mechanism.spec(), mechanism.model(), &robot);
    let (source, file) = experiment(&args.file, &mechanism)?;
    let plan = stated_plan(&args.file, &file)?;
    let own = args.file.parent().unwrap_or(Path::new(""));
    let folder = args.folder.as_deref().unwrap_or(own);
    let runs = file.runs_in(folder, Purpose::Identify);
    for output in [&args.geometry, &args.report].into_iter().flatten() {
        let files = runs.iter().flat_map(|run| &run.files);
        require_unread(output, files.map(PathBuf::as_path))?;
    }
    let sensors = sensors(&source, plan, &described)?;
    let geometry = geometry(&args.unknown, plan, &described, &sensors)?;
    let logs = match &args.simulate {
        Some(_) => None,
        None => read(&runs, &file.settings, plan, &mechanism)?,
    };
    let measured = match &logs {
        Some(logs) => logs.measured.clone(),
        None => stated(&file.settings, &mechanism),
    };
    let noise = vec![plan.noise; measured.len()];
    let held = held_robot(&mechanism, &geometry)?;
    let efforts = efforts_of(held.as_ref(), &args.spec)?;
    let problem = Problem {
        kinematics: &described.kinematics,
        geometry: &geometry,
        measured: &measured,
        noise_of_readings: &noise,
        sensors: &sensors,
        tolerance: plan.tolerance,
        efforts: efforts.as_ref().map(|own| own as &dyn Efforts),
        poses: logs.as_ref().map_or(&[], |logs| &logs.poses),
    };
    // what is wrong with the measurements is told also where nothing fits them
    let doubts = problem.doubts();
    let doubts: Vec<String> = doubts.iter().map(ToString::to_string).collect();
    let failed = |error: CalibrateError| {
        let text = format!("{}: {error}", args.file.display());
        let text = std::iter::once(text).chain(doubts.iter().cloned());
        let text = text.collect::<Vec<_>>().join("\n");
        match error {
            CalibrateError::NotClosed | CalibrateError::NoPose | CalibrateError::NoFit => {
                Failure::Numeric(text)
            }
            _ => Failure::Input(text),
        }
    };
    if let Some(out) = &args.simulate {
        return simulate(args, out, (&problem, plan, &file.settings), &robot.name);
    }
    let mut page = None;
    let result = if logs.is_some() {
        let fit = problem.calibrate(confidence).map_err(failed)?;
        let mut found = Calibrated::of_fit(&robot.name, &problem, &fit, confidence);
        found.doubts.clone_from(&doubts);
        // a cause says more than what it does
        if doubts.is_empty() {
            let doubts = problem.doubts_about(&fit);
            found.doubts = doubts.iter().map(ToString::to_string).collect();
        }
        found.set_exact(described.exact_factors(&problem, &fit.fixed));
        page = match &args.report {
            Some(out) => Some((out, regen_report::calibrated(&found, &problem, &fit)?)),
            None => None,
        };
        found
    } else {
        let unused = [
            ("geometry", args.geometry.is_some()),
            ("report", args.report.is_some()),
            ("confidence", args.confidence.is_some()),
            ("logs", args.folder.is_some()),
        ];
        if let Some((option, _)) = unused.iter().find(|(_, given)| *given) {
            return Err(Failure::Usage(format!(
                "--{option} concerns what is found, and {} has no runs",
                args.file.display()
            )));
        }
        let known = problem.known().map_err(failed)?;
        let mut found = Calibrated::of_known(&robot.name, &problem, &known, confidence);
        found.set_exact(described.exact_factors(&problem, &known.fixed));
        found
    };
    if let Some(out) = &args.geometry {
        write_geometry(out, &spec, &mechanism, &geometry, &result)?;
    }
    if let Some((out, html)) = page {
        write::atomically(out, &html)?;
        terminal::note(&format!("{}: written", out.display()));
    }
    terminal::print(&match args.format {
        Format::Human => calibrated_text(&result),
        Format::Json => table::json(&result),
    })
}

/// Writes simulated poses in the columns of the file.
fn simulate(
    args: &CalibrateArgs,
    out: &Path,
    (problem, plan, settings): (&Problem<'_>, &Calibration, &Settings),
    robot: &str,
) -> Result<(), Failure> {
    if !(args.perturb >= 0.0 && args.perturb < 1.0) {
        return Err(Failure::Usage(
            "--perturb is a number from 0 to 1, rad and m".to_owned(),
        ));
    }
    let what = Simulation {
        poses: args.poses,
        errors: args.perturb,
        noise: crate::choose::NOISE,
        seed: args.seed,
    };
    let simulated = problem.simulate(&what);
    let (truth, poses) = simulated.map_err(|error| Failure::Numeric(error.to_string()))?;
    let readings = reading_columns(problem, settings);
    let mut titles: Vec<String> = readings.iter().map(|own| own.0.clone()).collect();
    for measured in &plan.measured {
        titles.extend(measured.columns.iter().cloned());
        titles.extend(
            measured
                .rotation
                .iter()
                .flat_map(|(_, columns)| columns.clone()),
        );
    }
    let mut text = titles.join(",") + "\n";
    for pose in &poses {
        let own = pose.readings.iter().zip(&readings);
        let mut row: Vec<String> = own
            .map(|(x, (_, factor, offset))| format!("{:.9}", (x - offset) / factor))
            .collect();
        for (measured, values) in plan.measured.iter().zip(&pose.values) {
            let Some(values) = values else { continue };
            let (rotation, lengths) = match measured.kind {
                MeasuredKind::Pose => values.split_at(9),
                _ => (&[][..], &values[..]),
            };
            let factor = length_unit(measured);
            let lengths = lengths.iter().take(measured.columns.len());
            row.extend(lengths.map(|x| format!("{:.9}", x / factor)));
            if let Some((word, _)) = &measured.rotation {
                let convention = convention(word);
                let numbers = convention.numbers(rotation);
                let factor = rotation_unit(measured, convention);
                row.extend(numbers.iter().map(|x| format!("{:.9}", x / factor)));
            }
        }
        text += &(row.join(",") + "\n");
    }
    write::atomically(out, &text)?;
    terminal::note(&format!("{}: written", out.display()));
    let known = problem
        .known()
        .map_err(|error| Failure::Numeric(error.to_string()))?;
    let mut found = Calibrated::of_known(robot, problem, &known, 0.95);
    found.poses = poses.len();
    for (estimate, value) in found.estimates.iter_mut().zip(truth) {
        estimate.value = Some(value);
    }
    terminal::print(&match args.format {
        Format::Human => {
            let rows = found.estimates.iter().map(|own| {
                let value = own.value.unwrap_or(f64::NAN);
                let change = figure_of(3, value - own.nominal);
                vec![
                    own.name.clone(),
                    figure_of(6, value),
                    change,
                    own.unit.to_owned(),
                ]
            });
            columns(
                &["unknown", "true", "change", "unit"],
                &rows.collect::<Vec<_>>(),
            )
        }
        Format::Json => table::json(&found),
    })
}

/// The known word that is meant by a misspelt one, as a question; else what `others` says.
fn near_or<'k>(
    word: &str,
    known: impl Iterator<Item = &'k str>,
    others: impl FnOnce() -> String,
) -> String {
    match nearest(word, known) {
        Some(near) => format!("did you mean '{near}'?"),
        None => others(),
    }
}

/// The unit of a measurement's lengths in m; directions of gravity have none.
fn length_unit(measured: &MeasuredFrame) -> f64 {
    match measured.kind {
        MeasuredKind::Gravity => 1.0,
        _ => measured.length_factor,
    }
}

/// The unit of the numbers of a measured rotation in rad; 1 where they are no angles.
fn rotation_unit(measured: &MeasuredFrame, convention: Convention) -> f64 {
    match convention {
        Convention::Rpy | Convention::Vector => measured.angle_factor,
        _ => 1.0,
    }
}

fn convention(word: &str) -> Convention {
    match word {
        "quaternion_wxyz" => Convention::QuaternionWxyz,
        "quaternion_xyzw" => Convention::QuaternionXyzw,
        "rpy" => Convention::Rpy,
        "vector" => Convention::Vector,
        _ => Convention::Matrix,
    }
}

/// What the file says of a calibration.
pub(crate) fn stated_plan<'f>(
    path: &Path,
    file: &'f ExperimentFile,
) -> Result<&'f Calibration, Failure> {
    file.calibration.as_ref().ok_or_else(|| {
        Failure::Input(format!(
            "{}: it has no key `calibrate`, which says what is measured; `regen schema experiment` \
             describes it",
            path.display()
        ))
    })
}

/// The columns of readings, each with its title and the factor and offset that convert it to SI.
pub(crate) fn reading_columns(
    problem: &Problem<'_>,
    settings: &Settings,
) -> Vec<(String, f64, f64)> {
    let columns = problem.measured.iter().map(|c| {
        let name = &problem.kinematics.coordinates[*c];
        let quantity = Quantity::Position(name.clone());
        let assigned = settings.columns.iter().find(|own| own.quantity == quantity);
        assigned.map_or((name.clone(), 1.0, 0.0), |own| {
            (own.column.clone(), own.factor, own.offset)
        })
    });
    columns.collect()
}

/// Reads the experiment file.
pub(crate) fn experiment(
    path: &Path,
    mechanism: &Mechanism,
) -> Result<(Source, ExperimentFile), Failure> {
    let source = load::file(path)?;
    let model = mechanism.model();
    let coordinates: Vec<&str> = model.coordinates.iter().map(|c| c.name.as_str()).collect();
    let info = Info {
        name: "the robot",
        coordinates: &coordinates,
        actuated: &model.actuated,
        ..Info::EMPTY
    };
    match ExperimentFile::read(&source.text, &info) {
        Ok(file) => Ok((source, file)),
        Err(found) => Err(mistakes::failure(source, found, OTHER_FILE)),
    }
}

/// The sensors of a plan.
pub(crate) fn sensors(
    source: &Source,
    plan: &Calibration,
    described: &Described,
) -> Result<Vec<Sensor>, Failure> {
    let frames = &described.kinematics.frames;
    let mut out = Vec::new();
    for (k, measured) in plan.measured.iter().enumerate() {
        let Some(frame) = frames.iter().position(|(name, _)| *name == measured.frame) else {
            let names = || frames.iter().map(|(name, _)| name.as_str());
            let hint = near_or(&measured.frame, names(), || {
                let all = names().collect::<Vec<_>>();
                format!("its frames and bodies are {}", all.join(", "))
            });
            let mistake = regen_identify::files::Mistake {
                at: measured.at,
                path: "`calibrate`, `measure`".to_owned(),
                message: format!("'{}' is no frame and no body of the robot", measured.frame),
                remedy: Some(regen_identify::files::Remedy::Words(hint)),
            };
            let all = regen_identify::files::Mistakes(vec![mistake]);
            return Err(mistakes::failure(source.clone(), all, OTHER_FILE));
        };
        let kind = match measured.kind {
            MeasuredKind::Pose => Kind::Pose,
            MeasuredKind::Point => Kind::Point,
            MeasuredKind::Distance => Kind::Distance,
            MeasuredKind::Plane => Kind::Plane,
            MeasuredKind::Gravity => Kind::Gravity,
        };
        let alike = |own: &&MeasuredFrame| own.frame == measured.frame && own.kind == measured.kind;
        let name = format!("{} of {}", word(measured.kind), measured.frame);
        let several = plan.measured.iter().filter(alike).count() > 1;
        let before = plan.measured[..k].iter().filter(alike).count();
        out.push(Sensor {
            name: if several {
                format!("{name} ({})", before + 1)
            } else {
                name
            },
            kind,
            frame,
            mounting: Mounting {
                unknown: measured.unknown_instrument && kind != Kind::Gravity,
                ..Mounting::at(measured.from, measured.normal)
            },
            noise: measured.noise,
            noise_of_angles: measured.noise_of_angles,
        });
    }
    Ok(out)
}

fn word(kind: MeasuredKind) -> &'static str {
    match kind {
        MeasuredKind::Pose => "pose",
        MeasuredKind::Point => "point",
        MeasuredKind::Distance => "distance",
        MeasuredKind::Plane => "plane",
        MeasuredKind::Gravity => "gravity",
    }
}

/// What is unknown: as the options say, else the file, else every error of a placement.
pub(crate) fn geometry<'d>(
    unknown: &[String],
    plan: &Calibration,
    described: &'d Described,
    sensors: &[Sensor],
) -> Result<ChosenGeometry<'d>, Failure> {
    let wanted = if unknown.is_empty() {
        &plan.unknown
    } else {
        unknown
    };
    if wanted.is_empty() {
        let observed: Vec<usize> = sensors.iter().map(|sensor| sensor.frame).collect();
        return Ok(described.with_all_errors(&observed));
    }
    described.with(wanted).map_err(|name| {
        let known = described.names();
        let hint = near_or(name, known.iter().copied(), || {
            let plain = known.iter().copied().filter(|own| !own.contains('.'));
            let owners = known.iter().filter_map(|own| Some(own.rsplit_once('.')?.0));
            let mut names: Vec<&str> = plain.chain(owners).collect();
            names.dedup();
            format!("these can be unknown: {}", names.join(", "))
        });
        Failure::Input(format!("'{name}' is nothing of the geometry; {hint}"))
    })
}

/// The robot with what its efforts at rest need, where a compliance is unknown.
pub(crate) fn held_robot(
    mechanism: &Mechanism,
    geometry: &ChosenGeometry<'_>,
) -> Result<Option<Robot>, Failure> {
    let mut unknowns = geometry.unknowns().iter();
    if unknowns.any(|unknown| unknown.unit.is_compliance()) {
        Ok(Some(mechanism.robot(&NominalEfforts::KINDS)?))
    } else {
        Ok(None)
    }
}

/// The efforts at rest of the robot that [`held_robot`] returns.
pub(crate) fn efforts_of<'r>(
    robot: Option<&'r Robot>,
    spec: &Path,
) -> Result<Option<NominalEfforts<'r>>, Failure> {
    let efforts = robot.map(NominalEfforts::new).transpose();
    efforts.map_err(|error| Failure::Input(format!("{}: {error}", spec.display())))
}

/// The coordinates that are measured according to the columns, or the actuated ones.
pub(crate) fn stated(settings: &Settings, mechanism: &Mechanism) -> Vec<usize> {
    let model = mechanism.model();
    let names = settings
        .columns
        .iter()
        .filter_map(|column| match &column.quantity {
            Quantity::Position(name) => Some(name),
            _ => None,
        });
    let mut found: Vec<usize> = names
        .filter_map(|name| model.coordinates.iter().position(|c| c.name == *name))
        .collect();
    found.sort_unstable();
    if found.is_empty() {
        model.actuated.clone()
    } else {
        found
    }
}

/// The poses of the runs, with the coordinates that are measured.
struct Poses {
    measured: Vec<usize>,
    poses: Vec<Pose>,
}

/// Reads the poses; `None` without runs.
fn read(
    runs: &[Run],
    settings: &Settings,
    plan: &Calibration,
    mechanism: &Mechanism,
) -> Result<Option<Poses>, Failure> {
    let mut out: Option<Poses> = None;
    for run in runs {
        if let Some(missing) = run.missing() {
            return Err(Failure::Io(missing));
        }
        let log = RawLog::open(run, settings)?;
        let layout = Layout::new(&log, settings, plan, mechanism)?;
        let measured: Vec<usize> = layout.readings.iter().map(|own| own.coordinate).collect();
        let out = out.get_or_insert_with(|| Poses {
            measured: measured.clone(),
            poses: Vec::new(),
        });
        if out.measured != measured {
            return Err(Failure::Input(format!(
                "{}: it has columns of other coordinates than the runs before it",
                log.name()
            )));
        }
        let mut wrong: Option<String> = None;
        let mut unusable: Vec<String> = Vec::new();
        log.visit(&mut |row| match row {
            Ok((line, values)) => match layout.pose(line, values.get(1..).unwrap_or_default()) {
                Ok(pose) => out.poses.push(pose),
                Err(why) => {
                    wrong.get_or_insert_with(|| format!("{}: row {line}: {why}", log.name()));
                }
            },
            Err(problem) => unusable.push(problem.to_string()),
        })?;
        if let Some(first) = unusable.first() {
            terminal::note(&format!(
                "note: {}: {} left out: {first}",
                log.name(),
                counted(unusable.len(), "row is", "rows are")
            ));
        }
        if let Some(wrong) = wrong {
            return Err(Failure::Input(wrong));
        }
    }
    Ok(out)
}

/// A sensor's plan, and the places of its columns and of its rotation's.
type Places<'p> = (
    &'p MeasuredFrame,
    Vec<usize>,
    Option<(Convention, Vec<usize>)>,
);

/// Where the readings of a coordinate are among the numbers of a row; `place` is `None` for a constant.
struct Reading {
    coordinate: usize,
    place: Option<usize>,
    factor: f64,
    offset: f64,
}

/// Where a log has what is measured.
struct Layout<'p> {
    readings: Vec<Reading>,
    sensors: Vec<Places<'p>>,
}

impl<'p> Layout<'p> {
    fn new(
        log: &RawLog,
        settings: &Settings,
        plan: &'p Calibration,
        mechanism: &Mechanism,
    ) -> Result<Self, Failure> {
        let model = mechanism.model();
        let place = |name: &str| place(log, name, None);
        let mut readings = Vec::new();
        for (c, coordinate) in model.coordinates.iter().enumerate() {
            let is_own =
                |own: &&Assignment| own.quantity == Quantity::Position(coordinate.name.clone());
            let assigned = settings.columns.iter().find(is_own);
            let (place, factor, offset) = match assigned {
                Some(own) if own.from == ValuesFrom::Constant => (None, 0.0, own.offset),
                Some(own) if own.late != 0.0 => {
                    return Err(Failure::Input(format!(
                        "poses at rest have no time at which `{}` could be late",
                        own.column
                    )));
                }
                Some(own) => {
                    let place = self::place(log, &own.column, own.number)?;
                    (Some(place), own.factor, own.offset)
                }
                None if log.titles().contains(&coordinate.name) => {
                    (Some(place(&coordinate.name)?), 1.0, 0.0)
                }
                None => continue,
            };
            readings.push(Reading {
                coordinate: c,
                place,
                factor,
                offset,
            });
        }
        if readings.is_empty() {
            return Err(Failure::Input(format!(
                "{}: no column is named as a coordinate, and `columns` assigns none",
                log.name()
            )));
        }
        let mut sensors = Vec::new();
        for measured in &plan.measured {
            let columns = measured.columns.iter();
            let columns: Vec<usize> = columns.map(|name| place(name)).collect::<Result<_, _>>()?;
            let rotation = match &measured.rotation {
                None => None,
                Some((word, names)) => {
                    let convention = convention(word);
                    let places = names.iter().map(|name| place(name));
                    Some((convention, places.collect::<Result<Vec<_>, _>>()?))
                }
            };
            sensors.push((measured, columns, rotation));
        }
        Ok(Self { readings, sensors })
    }

    /// The pose of a row of numbers.
    fn pose(&self, row: u64, values: &[f64]) -> Result<Pose, String> {
        let at = |place: &usize| values.get(*place).copied().unwrap_or(f64::NAN);
        let readings = self.readings.iter();
        let readings =
            readings.map(|own| own.place.as_ref().map_or(0.0, at) * own.factor + own.offset);
        let mut sensors = Vec::new();
        for (measured, columns, rotation) in &self.sensors {
            let mut numbers = Vec::new();
            if let Some((convention, places)) = rotation {
                let factor = rotation_unit(measured, *convention);
                let own: Vec<f64> = places.iter().map(|place| at(place) * factor).collect();
                let titles = || {
                    let rotation = measured.rotation.as_ref();
                    rotation.map_or(String::new(), |(_, titles)| titles.join(", "))
                };
                let is_angle = matches!(convention, Convention::Rpy | Convention::Vector);
                if is_angle && own.iter().any(|x| x.abs() > LARGEST_ANGLE) {
                    return Err(format!(
                        "the columns {} are angles beyond a turn: give the measurement `angles: deg`",
                        titles()
                    ));
                }
                if own.iter().all(|x| x.is_finite()) {
                    let matrix = convention.matrix(&own).ok_or_else(|| {
                        format!(
                            "the columns {} are no rotation: look at the order and at the convention",
                            titles()
                        )
                    })?;
                    numbers.extend(matrix);
                } else {
                    numbers.extend([f64::NAN; 9]);
                }
            }
            let factor = length_unit(measured);
            numbers.extend(columns.iter().map(|place| at(place) * factor));
            if measured.kind == MeasuredKind::Plane && columns.is_empty() {
                numbers.push(0.0);
            }
            // where a sensor saw nothing its entries are empty
            let seen = numbers.iter().all(|x| x.is_finite());
            sensors.push(seen.then_some(numbers));
        }
        Ok(Pose {
            row,
            readings: readings.collect(),
            values: sensors,
        })
    }
}

/// The place of a column among the numbers of a row.
fn place(log: &RawLog, name: &str, number: Option<usize>) -> Result<usize, Failure> {
    let titles = log.titles();
    let number = number.or_else(|| {
        name.parse()
            .ok()
            .filter(|_| !titles.iter().any(|t| t == name))
    });
    let index = match number {
        Some(number) => number.checked_sub(1).filter(|k| *k < titles.len()),
        None => titles.iter().position(|title| title == name),
    };
    let missing = || {
        let hint = near_or(name, titles.iter().map(String::as_str), || {
            format!("its columns are {}", titles.join(", "))
        });
        Failure::Input(format!("{}: it has no column '{name}'; {hint}", log.name()))
    };
    let index = index.ok_or_else(missing)?;
    let numbers = log.numbers().iter().position(|own| *own == index);
    numbers.ok_or_else(|| {
        Failure::Input(format!(
            "{}: the column '{name}' has no numbers",
            log.name()
        ))
    })
}

/// Writes the spec with the geometry that was found: constants by their names, errors of placements as
/// fixed joints or in the placements of frames and cuts.
fn write_geometry(
    out: &Path,
    source: &Source,
    mechanism: &Mechanism,
    geometry: &ChosenGeometry<'_>,
    result: &Calibrated,
) -> Result<(), Failure> {
    let unknowns = geometry.unknowns().iter();
    let values: Vec<f64> = unknowns
        .map(|unknown| {
            let mut found = result.estimates.iter();
            let found = found.find(|own| own.name == unknown.name);
            found.and_then(|own| own.value).unwrap_or(unknown.nominal)
        })
        .collect();
    let (placements, unheld) = geometry.placements(&values);
    let constants = geometry.constants();
    let constants: Vec<(&str, String)> = constants
        .filter(|(_, name)| result.estimates.iter().any(|own| own.name == *name))
        .map(|(k, name)| (name, format!("{:?}", values[k])))
        .collect();
    let lacking = "a description has no place for them; the errors of a body have one where a name in \
                   `frames` is observed instead";
    if placements.is_empty() && constants.is_empty() {
        return Err(Failure::Usage(format!(
            "--geometry has nothing to write: found are {}, and {lacking}",
            unheld.join(", ")
        )));
    }
    let pairs: Vec<(&str, &str)> = constants
        .iter()
        .map(|(name, text)| (*name, text.as_str()))
        .collect();
    let named = with_geometry(&source.text, mechanism.spec(), &pairs)
        .map_err(|name| Failure::Input(format!("'{name}' is not written in the spec itself")))?;
    let named = Source::new(&source.name, named);
    let spec = parse(&named)?;
    let text = with_placements(&named.text, &spec, &placements).map_err(|spot| {
        let place = match spot {
            Spot::Before(joint) => format!("joint '{joint}'"),
            Spot::Side(cut, _) => format!("cut {}", cut + 1),
            Spot::Frame(name) => format!("frame '{name}'"),
        };
        Failure::Input(format!(
            "{}: the errors of {place} cannot be written where it is: write it as an entry of its own",
            source.name
        ))
    })?;
    write::atomically(out, &text)?;
    terminal::note(&format!("{}: written", out.display()));
    if !unheld.is_empty() {
        let text = unheld.join(", ");
        terminal::note(&format!("note: not written are {text}: {lacking}"));
    }
    Ok(())
}
