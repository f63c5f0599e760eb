//! Inspects one log: its clock, its columns and its joints.

use regen_identify::data::{DataError, Quantity, RawLog, Run, Settings, file_unit};
use regen_identify::text::{counted, figure_of};
use regen_runtime::Info;
use serde::Serialize;

use crate::clock::{Clock, ClockSource};
use crate::columns::{Extreme, Surveyed, survey};
use crate::follow::{Following, RegressionInput, Signal, follow};
use crate::gather::{Gathered, Times, gather, on_grid};
use crate::joints::{Joint, joints};
use crate::left_out;
use crate::names::{Role, meaning};
use crate::period::{Period, period};
use crate::relations::{Derivative, Relations};
use crate::roles::{Judged, Known, judge};
use crate::spectrum::Spectrum;
use crate::words;

/// The least number of rows of a log that is inspected: with fewer, no column's role can be judged.
const MIN_ROWS: usize = 64;
/// The least number of poses at rest, of which no motion is told.
const MIN_POSES: usize = 4;
/// The largest number of points of a curve in a figure.
const PICTURE_POINTS: usize = 512;
/// A column counts as time if at most this part of its rows falls.
const MAX_FALLING: f64 = 1e-3;
/// A column counts as time if at least this part of its rows rises; the rest may repeat a value.
const MIN_RISING: f64 = 0.9;
/// The highest cutoff that is proposed, as a part of the sampling rate: positions pass a filter of
/// three times the cutoff, which must be below half of the rate.
const MAX_CUTOFF_PART: f64 = 0.125;
/// The highest cutoff of the regressions that match efforts with joints, as a part of the sampling
/// rate, for the same reason.
const MAX_REGRESSION_CUTOFF_PART: f64 = 0.15;
/// The cutoff where no signal determines one, as a part of the sampling rate.
const PLAIN_CUTOFF_PART: f64 = 0.05;
/// Two rates count as the same up to this relative difference.
const SAME_RATE: f64 = 0.1;
/// A rate found from velocities is rounded to two digits if that changes it by less than this part.
const ROUND_PART: f64 = 0.01;
/// A column that rests in a larger share of the rows counts as one that stands still.
const STILL_SHARE: f64 = 0.999;
/// One degree, rad.
const DEGREE: f64 = core::f64::consts::PI / 180.0;

/// The facts found about one column.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Column {
    /// The number of the column, from 1.
    pub number: usize,
    /// The name of the column; its number where the log has no names.
    pub name: String,
    /// The role that the column is judged to have.
    pub role: Role,
    /// The reason for the role, in words.
    pub reason: String,
    /// The unit, where the name contains one.
    pub unit: Option<&'static str>,
    /// The column whose derivative this one is.
    pub derivative: Option<Derivative>,
    /// How often the column is at its smallest value.
    pub low: Extreme,
    /// How often the column is at its largest value.
    pub high: Extreme,
    /// The resolution of the encoder, in the column's unit; 0 where the values show no steps.
    pub encoder_step: f64,
    /// The standard deviation of the noise from row to row, in the column's unit, including that of
    /// the encoder's steps.
    pub noise: f64,
    /// The share of rows at which the column rests: stays within a step or the noise for 0.2 s; from
    /// 0 to 1.
    pub resting: f64,
    /// The spectrum; `None` for text, the time, constants, and logs that are too short.
    pub spectrum: Option<Spectrum>,
    /// The column thinned for a figure: time, s, and value.
    #[serde(skip)]
    pub curve: Vec<(f64, f64)>,
    /// The square root of the power spectral density for a figure: frequency, Hz, and
    /// unit/sqrt(Hz).
    #[serde(skip)]
    pub density: Vec<(f64, f64)>,
}

/// The facts found about a log.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LogFacts {
    /// The name of the run: its file, or files, and the part that was read.
    pub log: String,
    /// Whether the files name their columns.
    pub named: bool,
    /// The number of rows that can be read.
    pub rows: usize,
    /// The number of rows that cannot be read.
    pub unusable: usize,
    /// The first problems of these rows, each with its place.
    pub problems: Vec<String>,
    /// The clock.
    pub clock: Clock,
    /// All columns, in the order of the log.
    pub columns: Vec<Column>,
    /// The columns of each joint.
    pub joints: Vec<Joint>,
    /// The joint that each effort follows; empty where the motion does not show it.
    pub efforts: Vec<Following>,
    /// The cutoff of a filter above which the motion is noise, Hz.
    pub cutoff: Option<f64>,
    /// The period, where the motion repeats itself.
    pub period: Option<Period>,
    /// Sentences about what a user should know before using these data.
    pub notes: Vec<String>,
}

impl Column {
    /// Whether the column is that of a joint that stands still: its value never changes, or at most
    /// by its noise.
    pub(crate) fn is_still(&self) -> bool {
        self.low.value >= self.high.value || self.resting > STILL_SHARE
    }
}

impl LogFacts {
    /// The column of a number, counted from 1; `None` if there is no such column.
    pub fn column(&self, number: usize) -> Option<&Column> {
        self.columns.get(number.checked_sub(1)?)
    }
}

/// The unit of a time and its factor to s, from the usual step: the unit in which the step is one
/// that logs of controllers have.
fn unit_of_time(step: f64) -> (&'static str, f64) {
    match step {
        step if step <= 0.3 => ("s", 1.0),
        step if step <= 300.0 => ("ms", 1e-3),
        step if step <= 3e5 => ("us", 1e-6),
        _ => ("ns", 1e-9),
    }
}

/// How the time of each row is found.
struct Reading {
    source: ClockSource,
    times: Times,
    /// The usual step from row to row, s.
    usual: f64,
    /// The unit of the column of time.
    unit: &'static str,
    /// The index of the column among those that have numbers.
    column: Option<usize>,
}

/// Finds the time: the column that is assigned or named as time, else the stated rate, else the
/// first column that grows.
fn clock(log: &RawLog, settings: &Settings, surveyed: &Surveyed) -> Reading {
    let rise = |entry: usize| {
        let survey = surveyed.columns.get(entry);
        survey.map_or(0.0, |s| s.usual_rise)
    };
    let of = |entry: usize, column: Option<usize>, stated: Option<&'static str>| {
        let named = column.and_then(|k| log.numbers().get(k)).and_then(|i| {
            let title = log.titles().get(*i)?;
            let stated = log.unit(*i).and_then(file_unit);
            meaning(title).unit.or(stated)
        });
        let known = named.filter(|unit| ["ms", "us", "ns"].contains(unit));
        let (unit, factor) = match (stated, known) {
            // the reader has converted it
            (Some(unit), _) => (unit, 1.0),
            (None, Some("ms")) => ("ms", 1e-3),
            (None, Some("us")) => ("us", 1e-6),
            (None, Some(_)) => ("ns", 1e-9),
            (None, None) => unit_of_time(rise(entry)),
        };
        Reading {
            source: ClockSource::Column,
            times: Times::Entry(entry, factor),
            usual: rise(entry) * factor,
            unit,
            column,
        }
    };
    if let Some(index) = log.time() {
        let column = log.numbers().iter().position(|i| *i == index);
        let given = settings.columns.iter();
        let mut given = given.filter(|a| a.quantity == Quantity::Time);
        // a stated unit replaces that of the name
        let stated = given.next().map(|a| a.unit.unwrap_or("s"));
        return of(0, column, stated);
    }
    if let Some(rate) = settings.rate {
        return Reading {
            source: ClockSource::Rate,
            times: Times::Rate(rate),
            usual: 1.0 / rate,
            unit: "s",
            column: None,
        };
    }
    let grows = |k: &usize| {
        let survey = surveyed.columns.get(k + 1);
        let rises = survey.is_some_and(|s| s.falling <= MAX_FALLING && s.rising >= MIN_RISING);
        let title = log.numbers().get(*k).and_then(|i| log.titles().get(*i));
        let title = title.map_or("", String::as_str);
        let role = meaning(title).role;
        rises && (!log.is_named() || matches!(role, Role::Time | Role::Other))
    };
    match (0..log.numbers().len()).find(grows) {
        Some(k) => of(k + 1, Some(k), None),
        None => Reading {
            source: ClockSource::Unknown,
            times: Times::Rate(1.0),
            usual: 1.0,
            unit: "s",
            column: None,
        },
    }
}

/// The sampling rate at which the integrals of velocities are the changes of positions, Hz; `None`
/// if fewer than half of the velocities agree on one, or it is at most 1 Hz.
///
/// - `judged`: the columns, with derivatives per row instead of per second.
fn rate_of(judged: &[Judged]) -> Option<f64> {
    let factors: Vec<f64> = judged
        .iter()
        .filter(|j| j.role == Role::Velocity)
        .filter_map(|j| j.derivative.map(|d| 1.0 / d.factor))
        .collect();
    let middle = crate::clock::median(&factors);
    let same = factors
        .iter()
        .filter(|rate| (*rate / middle - 1.0).abs() < SAME_RATE);
    // clocks have round rates
    let rounded = |digits| figure_of(digits, middle).parse().unwrap_or(middle);
    let two: f64 = rounded(2);
    let round = if (two / middle - 1.0).abs() < ROUND_PART {
        two
    } else {
        rounded(3)
    };
    (middle > 1.0 && 2 * same.count() > factors.len()).then_some(round)
}

/// Inspects a run: reads it twice, a third time where the rate is found from velocities, and two more
/// times where its clock is uneven or has gaps.
///
/// - `settings`: how its files are read: format, rate, and the column of time;
/// - `robot`: the robot whose coordinates the columns are matched with.
///
/// # Errors
/// When a file cannot be read, or the run has fewer than 64 rows of numbers.
///
/// ```
/// use regen_identify::data::{Run, Settings};
/// use regen_inspect::{Role, inspect};
///
/// // a joint on an encoder of 1 mrad, and its motor's current, without a header
/// let mut text = String::new();
/// for k in 0..4000 {
///     let t = 0.005 * f64::from(k);
///     let (q, qd, qdd) = ((2.0 * t).sin(), 2.0 * (2.0 * t).cos(), -4.0 * (2.0 * t).sin());
///     let current = 0.3 * qdd + 0.5 * qd.signum();
///     text += &format!("{t},{},{qd},{current}\n", (1e3 * q).round() / 1e3);
/// }
/// let path = std::env::temp_dir().join(format!("inspected-{}.csv", std::process::id()));
/// std::fs::write(&path, text)?;
/// let found = inspect(&Run::from(path.as_path()), &Settings::default(), None)?;
/// let roles: Vec<Role> = found.columns.iter().map(|column| column.role).collect();
/// assert_eq!(roles, [Role::Time, Role::Position, Role::Velocity, Role::Effort]);
/// assert!((found.clock.rate - 200.0).abs() < 1e-3);
/// assert!((found.columns[1].encoder_step - 1e-3).abs() < 1e-9);
/// assert!((found.period.unwrap().seconds - std::f64::consts::PI).abs() < 1e-2);
/// # std::fs::remove_file(path)?;
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn inspect(
    run: &Run,
    settings: &Settings,
    robot: Option<&Info<'_>>,
) -> Result<LogFacts, DataError> {
    let log = RawLog::open(run, settings)?.unwrapped()?;
    let mut surveyed = survey(&log)?;
    let least = if settings.poses { MIN_POSES } else { MIN_ROWS };
    if surveyed.rows < least {
        let first = surveyed.problems.first().map(ToString::to_string);
        // parts that are joined end where the first of them ends
        let read = format!(
            "{} of its rows can be read, and {least} are needed",
            surveyed.rows
        );
        let why: Vec<String> = [read]
            .into_iter()
            .chain(left_out::joined(&log))
            .chain(first)
            .collect();
        return Err(DataError::ColumnLayout {
            file: log.name().to_owned(),
            why: why.join("; "),
        });
    }
    let owned = |names: &[&str]| names.iter().map(|n| (*n).to_owned()).collect();
    let coordinates: Vec<String> = robot
        .map(|info| owned(info.coordinates))
        .unwrap_or_default();
    let mut reading = clock(&log, settings, &surveyed);
    if !(reading.usual > 0.0 && reading.usual.is_finite()) {
        reading.times = Times::Rate(1.0);
        reading.usual = 1.0;
        reading.source = ClockSource::Unknown;
    }
    let mut gathered = gather(&log, &surveyed, (reading.times, reading.usual), None)?;
    let found = &gathered.clock;
    let is_whole = found.even && found.gaps == 0 && found.backwards == 0;
    if reading.source == ClockSource::Column && !is_whole && found.rate > 0.0 {
        // noise and spectra are those on the even grid onto which identification brings the rows: at
        // uneven times a motion looks like noise
        let times = (reading.times, reading.usual);
        let grid = on_grid(&log, times, 1.0 / found.rate)?;
        for (survey, noise) in surveyed.columns.iter_mut().skip(1).zip(&grid.noise) {
            // steps have the noise of rounding, also where rests hide it
            survey.encoder.noise = noise.max(survey.encoder.step / libm::sqrt(12.0));
        }
        gathered = gather(&log, &surveyed, times, Some(&grid))?;
    }
    let units: Vec<Option<&'static str>> = (0..log.titles().len())
        .map(|index| log.unit(index).and_then(file_unit))
        .collect();
    let mut known = Known {
        assignments: &settings.columns,
        timed: reading.source != ClockSource::Unknown,
        titles: log.titles(),
        units: &units,
        named: log.is_named(),
        numbers: log.numbers(),
        time: reading.column,
        surveyed: &surveyed,
        coordinates: &coordinates,
        actuated: robot.map_or(&[], |info| info.actuated),
    };
    let count = log.numbers().len();
    let step = known.timed.then_some(gathered.step);
    let mut relations = Relations::new(&gathered.stretches, count, step);
    let mut judged = judge(&known, &relations);
    if reading.source == ClockSource::Unknown
        && let Some(rate) = rate_of(&judged)
    {
        reading.source = ClockSource::Velocities;
        gathered = gather(&log, &surveyed, (Times::Rate(rate), 1.0 / rate), None)?;
        relations = Relations::new(&gathered.stretches, count, Some(gathered.step));
        known.timed = true;
        judged = judge(&known, &relations);
    }
    let joints = joints(&known, &judged);
    let mut out = LogFacts {
        log: log.name().to_owned(),
        named: log.is_named(),
        rows: surveyed.rows,
        unusable: surveyed.unusable,
        problems: surveyed.problems.clone(),
        clock: Clock {
            source: reading.source,
            column: reading
                .column
                .and_then(|k| log.numbers().get(k))
                .map(|i| i + 1),
            unit: reading.unit,
            ..gathered.clock.clone()
        },
        columns: columns(&log, &surveyed, &gathered, &judged),
        joints,
        ..LogFacts::default()
    };
    out.cutoff = cutoff(&out);
    let entries = |number: Option<usize>| log.numbers().iter().position(|i| Some(i + 1) == number);
    let positions: Vec<usize> = out
        .joints
        .iter()
        .filter_map(|j| out.column(j.position?))
        .filter(|column| !column.is_still())
        .filter_map(|column| entries(Some(column.number)))
        .collect();
    out.period = period(&gathered.trace, &positions);
    let signal = |number: Option<usize>| {
        let column = entries(number)?;
        let judged = judged.get(column)?;
        let degrees = judged.role == Role::Position && in_degrees(&out, number);
        let factor = if judged.unit.is_none() && degrees {
            DEGREE
        } else {
            judged.unit_factor()
        };
        Some(Signal { column, factor })
    };
    let moving: Vec<(Signal, String)> = out
        .joints
        .iter()
        .filter_map(|j| Some((signal(j.position)?, j.name.clone())))
        .collect();
    let efforts = out.joints.iter().filter_map(|joint| {
        let place = moving.iter().position(|(_, name)| *name == joint.name)?;
        Some((signal(joint.effort)?, place, joint.effort?))
    });
    let motion = RegressionInput {
        efforts: efforts.collect(),
        joints: moving,
        stretches: &gathered.stretches,
        step: gathered.step,
        cutoff: out
            .cutoff
            .unwrap_or(PLAIN_CUTOFF_PART * out.clock.rate)
            .min(MAX_REGRESSION_CUTOFF_PART / gathered.step),
    };
    out.efforts = follow(&motion);
    out.notes = words::notes(&out);
    out.notes.extend(left_out::notes(&log, &out));
    out.notes.extend(words::wrapped(&log, &out));
    if let Some(info) = robot
        && !out.joints.is_empty()
    {
        out.notes
            .extend(left_out::efforts_of_others(&out, info.name));
    } else if let Some(info) = robot {
        let found = out.columns.iter().filter(|c| c.role == Role::Position);
        let found = match found.count() {
            1 => "1 column looks like a position".to_owned(),
            count => format!("{count} columns look like positions"),
        };
        out.notes.push(format!(
            "{found}, and {} has {}, {} of them actuated: assign their columns",
            info.name,
            counted(info.coordinates.len(), "coordinate", "coordinates"),
            info.actuated.len()
        ));
    }
    Ok(out)
}

/// Whether a position is in degrees: its derivative is a velocity in rad/s times 180/pi.
fn in_degrees(found: &LogFacts, number: Option<usize>) -> bool {
    let velocities = found.columns.iter().filter_map(|column| column.derivative);
    let mut own = velocities.filter(|d| Some(d.of) == number);
    own.any(|d| (d.factor * DEGREE - 1.0).abs() < SAME_RATE)
}

/// Thins a curve to at most [`PICTURE_POINTS`] points.
fn thinned(times: &[f64], values: &[f64]) -> Vec<(f64, f64)> {
    let every = times.len().div_ceil(PICTURE_POINTS).max(1);
    let pairs = times.iter().copied().zip(values.iter().copied());
    pairs.step_by(every).collect()
}

fn columns(
    log: &RawLog,
    surveyed: &Surveyed,
    gathered: &Gathered,
    judged: &[Judged],
) -> Vec<Column> {
    let one = |(index, title): (usize, &String)| {
        let mut out = Column {
            number: index + 1,
            name: title.clone(),
            role: Role::Text,
            ..Column::default()
        };
        let Some(k) = log.numbers().iter().position(|i| *i == index) else {
            return out;
        };
        let (Some(survey), Some(judged)) = (surveyed.columns.get(k + 1), judged.get(k)) else {
            return out;
        };
        out.role = judged.role;
        out.reason.clone_from(&judged.reason);
        out.unit = judged.unit;
        (out.low, out.high) = (survey.low, survey.high);
        if judged.role == Role::Time {
            return out;
        }
        out.derivative = judged.derivative;
        out.encoder_step = survey.encoder.step;
        out.noise = survey.encoder.noise;
        out.resting = gathered.resting.get(k).copied().unwrap_or(0.0);
        if let Some(density) = gathered.densities.get(k).and_then(Option::as_ref)
            && !survey.is_constant()
        {
            let order = match judged.role {
                Role::Position | Role::Command => 2,
                Role::Velocity => 1,
                _ => 0,
            };
            out.spectrum = Some(density.judge(order));
            out.density = density.picture();
        }
        let trace = &gathered.trace;
        let values = trace.columns.get(k).map_or(&[][..], Vec::as_slice);
        out.curve = thinned(&trace.times, values);
        out
    };
    log.titles().iter().enumerate().map(one).collect()
}

/// The frequency above which the motion of every joint is below its noise, Hz, rounded to two
/// digits and at most [`MAX_CUTOFF_PART`] of the rate; `None` if no joint moves.
fn cutoff(found: &LogFacts) -> Option<f64> {
    let ends = found.joints.iter().filter_map(|joint| {
        let of = |number: Option<usize>| found.column(number?);
        let (position, velocity) = (of(joint.position), of(joint.velocity));
        // a joint that does not move has only noise
        if position.or(velocity).is_none_or(Column::is_still) {
            return None;
        }
        let spectrum = position.and_then(|column| column.spectrum);
        Some(spectrum.or_else(|| velocity?.spectrum)?.ends)
    });
    let most = ends
        .fold(0.0, f64::max)
        .min(MAX_CUTOFF_PART * found.clock.rate);
    (most > 0.0).then(|| figure_of(2, most).parse().unwrap_or(most))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::relations::Derivative;

    #[test]
    fn a_position_is_in_degrees_if_its_velocity_is_in_radians() {
        // the change of the first column over the integral of the second
        let found = |factor: f64| LogFacts {
            columns: vec![
                Column::default(),
                Column {
                    derivative: Some(Derivative {
                        of: 1,
                        factor,
                        correlation: 1.0,
                    }),
                    ..Column::default()
                },
            ],
            ..LogFacts::default()
        };
        // a turn is 360 degrees and 2 pi radians
        let degrees = found(360.0 / core::f64::consts::TAU);
        assert!(in_degrees(&degrees, Some(1)));
        assert!(!in_degrees(&degrees, Some(2)) && !in_degrees(&degrees, None));
        assert!(!in_degrees(&found(1.0), Some(1)));
    }
}
