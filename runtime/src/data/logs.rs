//! Logs as a source of rows: read in windows, differentiated, completed by the closure.

use std::path::PathBuf;
use std::prelude::v1::*;
use std::vec;

use super::average::Average;
use super::columns::Assignment;
use super::problem::{DataError, Fault, Policy, Problem, Problems};
use super::reader::{Kept, LogFile, Survey};
use super::shift;
use super::standstill::{self, Differences, Encoder, resting};
use crate::estimate::EstimateError;
use crate::identify::{Completed, Completion, Filtering, Row, Source, Standstill};
use crate::signals::{
    Fourier, FourierFit, Method, NEIGHBOURS, SignalError, Smoothing, differences,
};
use crate::{Info, Model, Outcome};

/// How logs are read.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Columns whose headers do not say what they are.
    pub columns: Vec<Assignment>,
    /// How positions are differentiated, unless velocities and accelerations are measured.
    pub method: Method,
    /// What is done with rows that cannot be used.
    pub policy: Policy,
    /// Of the states found, each how many-th gives equations; at least 1.
    pub decimation: usize,
    /// The period in s of a trajectory that is run several times: the runs are averaged, their
    /// spread becomes the rows' weights.
    pub period: Option<f64>,
    /// Standard deviations of positions by coordinate, where more is measured than needed; 1
    /// for those not named.
    pub deviations: Vec<(String, f64)>,
    /// What is done with equations of coordinates that rest: whose raw positions stay within the
    /// encoder's step or noise for 0.2 s, or whose velocities are within two deviations of zero or
    /// turn round within the samples that they are made of.
    pub standstill: Standstill,
    /// Velocities below this, rad/s or m/s, count as rest too.
    pub rest_speed: f64,
    /// By how many seconds efforts are logged after the motion that they belong to, by
    /// coordinate; 0 for those not named.
    pub delays: Vec<(String, f64)>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            columns: Vec::new(),
            method: Method::Central,
            policy: Policy::Fail,
            decimation: 1,
            period: None,
            deviations: Vec::new(),
            standstill: Standstill::Drop,
            rest_speed: 0.0,
            delays: Vec::new(),
        }
    }
}

/// What was read of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FileReport {
    /// The file.
    pub file: String,
    /// Good rows.
    pub rows: usize,
    /// The usual step, s.
    pub step: f64,
    /// States that gave equations.
    pub states: usize,
    /// Whether velocities and accelerations were read from it, not found from the positions.
    pub derivatives: bool,
    /// What is wrong with it.
    pub problems: Problems,
    /// What was done with the rows that this is about.
    pub policy: Policy,
}

pub(super) struct Log {
    pub(super) file: LogFile,
    pub(super) survey: Survey,
    /// The series, where it is fitted; from the first pass on.
    pub(super) series: Option<Fourier>,
    /// What is known of each measured position's encoder.
    pub(super) encoders: Vec<Encoder>,
}

/// Rows read at a time, beside what filters need on both sides.
const WINDOW: usize = 8192;
/// The time in which a filter follows a jump, in periods of its cutoff.
const RISE: f64 = 0.3;
/// A filter that needs more rows than this on either side is none for windows.
const WIDEST: usize = 1_000_000;

/// Log files of one robot, as a [`Source`]: memory does not grow with their length.
///
/// ```
/// # mod models {
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/models/pendulum.rs"));
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/models/pendulum_base.rs"));
/// # }
/// # use models::Pendulum;
/// use regen_runtime::data::{Logs, Settings};
/// use regen_runtime::identify::{Kind, Options, identify};
/// use regen_runtime::signals::Method;
///
/// // angles and torques of a pendulum of 0.5 kg m^2 and 2 kg m, moved as q = sin(2 pi t)
/// let mut text = String::from("t,q1,tau_q1\n");
/// for k in 0..200 {
///     let t = 0.01 * f64::from(k);
///     let w = core::f64::consts::TAU;
///     let (q, qdd) = ((w * t).sin(), -w * w * (w * t).sin());
///     text += &format!("{t},{q},{}\n", 0.5 * qdd + 2.0 * 9.81 * q.sin());
/// }
/// let path = std::env::temp_dir().join(format!("pendulum-{}.csv", std::process::id()));
/// std::fs::write(&path, text)?;
/// let settings = Settings {
///     method: Method::Fourier { frequency: 1.0, harmonics: 1 },
///     ..Settings::default()
/// };
/// let mut logs = Logs::open(&Pendulum, &[path.clone()], &settings)?;
/// let found = identify(&Pendulum, Kind::Forces, &Options::default(), &mut logs)?;
/// assert!((found.estimate.values[0] - 0.5).abs() < 1e-8);
/// assert_eq!(logs.reports()[0].states, 200);
/// # std::fs::remove_file(path)?;
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub struct Logs<'m, M: ?Sized> {
    pub(super) model: &'m M,
    pub(super) settings: Settings,
    pub(super) files: Vec<Log>,
    pub(super) reports: Vec<FileReport>,
}

impl<'m, M: Model<f64> + ?Sized> Logs<'m, M> {
    /// Opens files, reads each once for its sampling and twice where it is checked for
    /// [`Policy::Fail`].
    ///
    /// # Errors
    /// When a file cannot be read, lacks columns, or has rows that cannot be used.
    pub fn open(model: &'m M, paths: &[PathBuf], settings: &Settings) -> Result<Self, DataError> {
        let info = model.info();
        let mut files = Vec::with_capacity(paths.len());
        let mut reports = Vec::with_capacity(paths.len());
        for path in paths {
            let mut file = LogFile::open(path, &info, &settings.columns)?;
            file.keep = settings.policy.keeps();
            let survey = file.survey()?;
            let mut problems = Problems::default();
            let mut rows = 0;
            let mut fit = match settings.method {
                Method::Fourier {
                    frequency,
                    harmonics,
                } if !file.layout.derivatives => Some(
                    FourierFit::new(frequency, harmonics, file.layout.measured.len())
                        .map_err(|why| signal(&file, why))?,
                ),
                _ => None,
            };
            let mut differences = vec![Differences::default(); file.layout.measured.len()];
            file.rows(
                &survey,
                &mut |problem| problems.add(problem),
                &mut |row, follows| {
                    rows += 1;
                    let positions = &row.values[file.layout.positions()];
                    for (all, value) in differences.iter_mut().zip(positions) {
                        all.push(*value, follows);
                    }
                    if let Some(fit) = &mut fit {
                        fit.push(row.values[0], &row.values[file.layout.positions()])
                            .map_err(|why| signal(&file, why))?;
                    }
                    Ok(())
                },
            )?;
            let name = path.display().to_string();
            if settings.policy == Policy::Fail && problems.total() > 0 {
                return Err(DataError::Problems {
                    file: name,
                    problems,
                });
            }
            if rows < 2 {
                return Err(signal(
                    &file,
                    SignalError::TooFew {
                        samples: rows,
                        needed: 2,
                    },
                ));
            }
            let series = match fit {
                Some(fit) => Some(fit.finish().map_err(|why| signal(&file, why))?),
                None => None,
            };
            reports.push(FileReport {
                file: name,
                rows,
                step: survey.step(),
                states: 0,
                derivatives: file.layout.derivatives,
                problems,
                policy: settings.policy,
            });
            files.push(Log {
                file,
                survey,
                series,
                encoders: differences.into_iter().map(Differences::finish).collect(),
            });
        }
        Ok(Self {
            model,
            settings: settings.clone(),
            files,
            reports,
        })
    }

    /// What was read of each file; states and their problems after a pass.
    pub fn reports(&self) -> &[FileReport] {
        &self.reports
    }
}

fn signal(file: &LogFile, why: SignalError) -> DataError {
    DataError::Signal {
        file: file.path.display().to_string(),
        why,
    }
}

impl<M: Model<f64> + ?Sized> Source for Logs<'_, M> {
    type Error = DataError;

    fn visit(
        &mut self,
        each: &mut dyn FnMut(&Row<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), DataError> {
        let info = self.model.info();
        for (log, report) in self.files.iter().zip(&mut self.reports) {
            let deviation = |&c: &usize| {
                let name = info.coordinates.get(c).copied().unwrap_or_default();
                let given = self.settings.deviations.iter().find(|(n, _)| n == name);
                given.map_or(1.0, |(_, d)| *d)
            };
            let measured = &log.file.layout.measured;
            let deviations: Vec<f64> = measured.iter().map(deviation).collect();
            // states found by an earlier pass are told once
            let mut fresh = Problems::default();
            let mut window = Window {
                log,
                settings: &self.settings,
                completion: Completion::new(self.model, measured, &deviations)?,
                model: self.model,
                support: support(log, &self.settings)?,
                unsure: unsure(log, &self.settings)?,
                delays: delays(&info, &self.settings),
                rows: Vec::new(),
                weights: Vec::new(),
                before: 0,
                count: 0,
                follows: false,
                states: 0,
                problems: &mut fresh,
                each,
            };
            let mut average = self
                .settings
                .period
                .map(|period| Average::new(period, log.survey.step(), &log.file.layout))
                .transpose()
                .map_err(|why| DataError::Layout {
                    file: report.file.clone(),
                    why,
                })?;
            log.file.rows(
                &log.survey,
                &mut |_| {},
                &mut |row, follows| match &mut average {
                    Some(average) => {
                        average.push(&row.values);
                        Ok(())
                    }
                    None => window.take(row, None, follows),
                },
            )?;
            if let Some(average) = average {
                let means = average.finish().map_err(|why| DataError::Layout {
                    file: report.file.clone(),
                    why,
                })?;
                for (k, (values, weights)) in means.into_iter().enumerate() {
                    let row = Kept { line: 0, values };
                    window.take(row, Some(weights), k > 0)?;
                }
            }
            window.finish()?;
            report.states = window.states;
            if self.settings.policy == Policy::Fail && fresh.total() > 0 {
                return Err(DataError::Problems {
                    file: report.file.clone(),
                    problems: fresh,
                });
            }
            report.problems.replace_open(&fresh);
        }
        Ok(())
    }

    fn filtering(&self) -> Filtering {
        Filtering {
            smoothing: self.settings.method.smoothing(),
            decimation: self.settings.decimation,
            standstill: self.settings.standstill,
        }
    }
}

/// The delay of each actuated joint's effort, s.
fn delays(info: &Info<'_>, settings: &Settings) -> Vec<f64> {
    let of = |c: &usize| {
        let name = info.coordinates.get(*c).copied().unwrap_or_default();
        let given = settings.delays.iter().find(|(n, _)| n == name);
        given.map_or(0.0, |(_, delay)| *delay)
    };
    info.actuated.iter().map(of).collect()
}

/// The velocity of each measured coordinate below which its direction is not sure: noise of the
/// encoder through the differentiation, twice its deviation.
fn unsure(log: &Log, settings: &Settings) -> Result<Vec<f64>, DataError> {
    let gain = if log.file.layout.derivatives || log.series.is_some() {
        0.0
    } else {
        let step = log.survey.step();
        settings
            .method
            .of_states(step)
            .rate_gain(step)
            .map_err(|why| signal(&log.file, why))?
    };
    let encoders = log.encoders.iter();
    Ok(encoders
        .map(|e| settings.rest_speed.max(2.0 * gain * e.noise))
        .collect())
}

/// How many rows on either side a state depends on.
fn support(log: &Log, settings: &Settings) -> Result<usize, DataError> {
    let step = log.survey.step();
    let longest = settings
        .delays
        .iter()
        .fold(0.0, |m: f64, d| m.max(d.1.abs()));
    #[allow(clippy::cast_sign_loss, reason = "neither is negative")]
    let shifted = if longest > 0.0 {
        (longest / step).ceil() as usize + shift::NEIGHBOURS
    } else {
        0
    };
    let least = standstill::context(step).max(shifted);
    if log.file.layout.derivatives || log.series.is_some() {
        return Ok(least);
    }
    let support = settings
        .method
        .of_states(step)
        .support(step)
        .map_err(|why| signal(&log.file, why))?;
    let support = match settings.method {
        Method::Central => support.max(Some(NEIGHBOURS)),
        _ => support,
    };
    match support.map(|rows| rows.max(least)) {
        Some(rows) if rows <= WIDEST => Ok(rows),
        _ => Err(signal(
            &log.file,
            SignalError::Setting("the filter is too slow for this sampling: raise its cutoff"),
        )),
    }
}

/// Rows of one file on their way to states.
struct Window<'a, 'm, M: ?Sized> {
    log: &'a Log,
    settings: &'a Settings,
    completion: Completion<'m, M>,
    model: &'m M,
    support: usize,
    /// Velocities of measured coordinates below which their direction is not sure.
    unsure: Vec<f64>,
    /// Of each actuated joint's effort, s.
    delays: Vec<f64>,
    rows: Vec<Kept>,
    weights: Vec<Option<Vec<f64>>>,
    /// Rows at the start that are there for the filter only; 0 at the start of a segment.
    before: usize,
    /// States of the segment so far, for decimation.
    count: usize,
    /// Whether the next state follows the last.
    follows: bool,
    states: usize,
    problems: &'a mut Problems,
    each: &'a mut dyn FnMut(&Row<'_>) -> Result<(), EstimateError>,
}

impl<M: Model<f64> + ?Sized> Window<'_, '_, M> {
    fn take(
        &mut self,
        row: Kept,
        weights: Option<Vec<f64>>,
        follows: bool,
    ) -> Result<(), DataError> {
        if !follows && !self.bridged(&row) {
            self.process(true)?;
        }
        self.rows.push(row);
        self.weights.push(weights);
        if self.rows.len() >= self.before + WINDOW + self.support {
            self.process(false)?;
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<(), DataError> {
        self.process(true)
    }

    /// Whether the method sees over a gap: a series does, and a regression over short ones.
    fn bridged(&self, row: &Kept) -> bool {
        let Some(last) = self.rows.last() else {
            return true;
        };
        match self.settings.method {
            _ if self.log.file.layout.derivatives || self.log.series.is_some() => false,
            Method::Local { half_width } => row.values[0] - last.values[0] < 0.5 * half_width,
            _ => false,
        }
    }

    /// For how long around a turn derivatives are those of neither side, s: as long as they reach
    /// before and after a sample, and a step at least, as the turn itself is between samples.
    fn reach(&self, encoder: Encoder) -> f64 {
        let step = self.log.survey.step();
        if self.log.file.layout.derivatives || self.log.series.is_some() {
            return step;
        }
        match self.settings.method.of_states(step) {
            Method::Butterworth { cutoff, .. } => (RISE / cutoff).max(2.0 * step),
            Method::Local { half_width } => (0.5 * half_width).max(2.0 * step),
            _ => encoder.neighbours.max(1) as f64 * step,
        }
    }

    /// Makes states of the rows that have all they need; `end` of a segment or of a window.
    fn process(&mut self, end: bool) -> Result<(), DataError> {
        let n = self.rows.len();
        let layout = &self.log.file.layout;
        let m = layout.measured.len();
        let mut valid = self.before..if end { n } else { n - self.support };
        let times: Vec<f64> = self.rows.iter().map(|r| r.values[0]).collect();
        let column =
            |entry: usize| -> Vec<f64> { self.rows.iter().map(|r| r.values[entry]).collect() };
        // for each measured coordinate: position, velocity, acceleration
        let mut motion: Vec<[Vec<f64>; 3]> = Vec::with_capacity(m);
        let mut efforts: Vec<Vec<f64>> = layout.efforts().map(&column).collect();
        let file = &self.log.file;
        if n > 0 && layout.derivatives {
            for entry in layout.positions() {
                motion.push([column(entry), column(entry + m), column(entry + 2 * m)]);
            }
        } else if let (Some(series), true) = (&self.log.series, n > 0) {
            for k in 0..m {
                let at: Vec<[f64; 3]> = times.iter().map(|t| series.at(k, *t)).collect();
                motion.push([0, 1, 2].map(|d| at.iter().map(|p| p[d]).collect()));
            }
        } else if n > 0 {
            let method = self.settings.method.of_states(self.log.survey.step());
            for (entry, encoder) in layout.positions().zip(&self.log.encoders) {
                let found = match method {
                    Method::Central => differences(&times, &column(entry), encoder.neighbours),
                    _ => method.differentiate(&times, &column(entry)),
                };
                match found {
                    Ok(found) => {
                        // at a window's edge the support says what is valid
                        let start = if self.before > 0 {
                            0
                        } else {
                            found.valid.start
                        };
                        let stop = if end { found.valid.end } else { n };
                        valid = valid.start.max(start)..valid.end.min(stop);
                        motion.push([found.value, found.rate, found.acceleration]);
                    }
                    // a piece between two faults may be too short, a log may not
                    Err(SignalError::TooFew { .. }) if self.settings.policy != Policy::Fail => {
                        valid = 0..0;
                        break;
                    }
                    Err(why) => return Err(signal(file, why)),
                }
            }
        }
        for (effort, delay) in efforts.iter_mut().zip(&self.delays) {
            if *delay != 0.0 && !valid.is_empty() {
                let inside = shift::later(&times, effort, *delay);
                // at a window's edge the support says what is valid
                let start = if self.before > 0 { 0 } else { inside.start };
                let stop = if end { inside.end } else { n };
                valid = valid.start.max(start)..valid.end.min(stop);
            }
        }
        let mut still: Vec<Vec<bool>> = Vec::with_capacity(m);
        let entries = layout.positions().zip(&self.log.encoders);
        for ((entry, encoder), [_, rate, acceleration]) in entries.zip(&mut motion) {
            let mut rests = resting(&times, &column(entry), *encoder);
            for (k, rests) in rests.iter().enumerate() {
                if *rests {
                    (rate[k], acceleration[k]) = (0.0, 0.0);
                }
            }
            let slowest = self.unsure.get(still.len()).copied().unwrap_or(0.0);
            let reach = self.reach(*encoder);
            for ((rests, rate), acceleration) in rests.iter_mut().zip(rate).zip(acceleration) {
                // derivatives from samples on both sides of a turn are those of neither
                *rests |= rate.abs() < slowest.max(acceleration.abs() * reach);
            }
            still.push(rests);
        }
        // equations that pass a filter are decimated behind it
        let every = match self.settings.method.smoothing() {
            Smoothing::None => self.settings.decimation.max(1),
            _ => 1,
        };
        for k in valid {
            self.count += 1;
            if (self.count - 1).is_multiple_of(every) {
                self.emit(k, &motion, &efforts, &still)?;
            }
        }
        if end {
            self.rows.clear();
            self.weights.clear();
            self.before = 0;
            self.count = 0;
            self.follows = false;
        } else {
            let keep = (2 * self.support).min(n);
            self.rows.drain(..n - keep);
            self.weights.drain(..n - keep);
            self.before = keep - self.support.min(keep);
        }
        Ok(())
    }

    fn emit(
        &mut self,
        k: usize,
        motion: &[[Vec<f64>; 3]],
        efforts: &[Vec<f64>],
        still: &[Vec<bool>],
    ) -> Result<(), DataError> {
        let pick = |d: usize| -> Vec<f64> { motion.iter().map(|m| m[d][k]).collect() };
        let completed = self.completion.complete(&pick(0), &pick(1), &pick(2))?;
        let state = match completed {
            Completed::State(state) => state,
            Completed::Open(outcome) => {
                self.skip(k, &outcome);
                return Ok(());
            }
            Completed::Unmeasured => {
                return Err(DataError::Layout {
                    file: self.log.file.path.display().to_string(),
                    why: "the measured coordinates do not determine the robot's state: log the \
                          actuated ones"
                        .to_owned(),
                });
            }
        };
        let actuated: Vec<f64> = efforts.iter().map(|e| e[k]).collect();
        let dof = self.model.info().dof();
        let mut tau = vec![0.0; dof];
        let condition = self.model.efforts(&state.q, &actuated, &mut tau)?;
        if condition.status() == crate::Status::Singular {
            self.skip(k, &Outcome::Singular { at: 1.0, condition });
            return Ok(());
        }
        let info = self.model.info();
        // the spread of an effort weighs the equation of its own coordinate
        let weight = |c: &usize| {
            let given = self.weights[k].as_ref();
            let place = info.actuated.iter().position(|a| a == c);
            given
                .zip(place)
                .and_then(|(w, p)| w.get(p).copied())
                .unwrap_or(1.0)
        };
        let weights: Vec<f64> = info.independent.iter().map(weight).collect();
        // what is not measured rests where all that is measured does
        let all = still.iter().all(|rests| rests[k]);
        let mut rests = vec![all; info.coordinates.len()];
        for (c, own) in self.log.file.layout.measured.iter().zip(still) {
            rests[*c] = own[k];
        }
        let row = Row {
            time: self.rows[k].values[0],
            q: &state.q,
            qd: &state.qd,
            qdd: &state.qdd,
            tau: &tau,
            efforts: &actuated,
            still: &rests,
            weights: &weights,
            follows: self.follows,
        };
        (self.each)(&row)?;
        self.follows = true;
        self.states += 1;
        Ok(())
    }

    fn skip(&mut self, k: usize, outcome: &Outcome) {
        self.follows = false;
        self.problems.add(Problem {
            row: self.rows[k].line,
            what: Fault::Open {
                why: match outcome {
                    Outcome::NotClosed { .. } => "the loops cannot be closed there".to_owned(),
                    Outcome::Singular { .. } => "the robot is singular there".to_owned(),
                    _ => "the assembly branch is lost there".to_owned(),
                },
            },
        });
    }
}
