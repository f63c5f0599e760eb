//! Reads logs window by window, differentiates the positions and closes the loops, as a
//! [`Source`] of states.

use super::average::Average;
use super::bridge::Bridged;
use super::noise_levels::NoiseLevels;
use super::policy::{Policies, Policy};
use super::problem::{DataError, Problem, Problems};
use super::reader::{LogFile, LogRow, RowSink};
use super::run::Run;
use super::sample::Spikes;
use super::settings::Settings;
use super::shift;
use super::sketch::Sketch;
use super::standstill::{self, Differences, Encoder};
use super::stretch::Stretch;
use super::survey::Survey;
use super::unmeasured::Unmeasured;
use super::window::Window;
use super::wrapped::Wrapped;
use crate::estimate::EstimateError;
use crate::signals::{Fourier, FourierFit, Method, NEIGHBOURS, SignalError, Smoothing};
use crate::states::{ChangedEfforts, Completion, Filtering, MotionSeries, Source, StateSample};
use regen_runtime::{BaseModel, Info, Model};

/// Summary of reading one run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FileReport {
    /// The name of the run: its file, or files.
    pub file: String,
    /// The number of rows that can be used, on the even grid if there is one.
    pub rows: usize,
    /// The time step between them, s: that of the even grid, or the median one.
    pub step: f64,
    /// The number of states in the last pass; 0 before.
    pub states: usize,
    /// Whether velocities and accelerations were read from the file, not computed from the
    /// positions.
    pub derivatives: bool,
    /// Whether velocities were read from the file, and accelerations computed from them.
    pub velocities: bool,
    /// The names of the measured coordinates that do not move, or by no more than their noise.
    pub still: Vec<String>,
    /// Whether one of these changes by more from row to row than noise of a sensor does: the rows are separate poses.
    pub are_poses: bool,
    /// The names of the coordinates of whose squared accelerations in the last pass at least 95 % are
    /// noise of their positions; none where accelerations are not computed from positions.
    pub noisy: Vec<String>,
    /// The first and the last time of the log, s, where the times that are asked for leave out none
    /// of its rows.
    pub uncut: Option<(f64, f64)>,
    /// An earlier run that has rows of this one too, and the part of this one's rows that it has.
    pub repeats: Option<(String, f64)>,
    /// Some of its rows, by which those of other runs are known again.
    pub sketch: Sketch,
    /// The gaps and dropouts that were bridged, and the rows of spikes.
    pub bridged: Bridged,
    /// The efforts, by their columns, that jump in some rows and are back in the next ones, where these rows
    /// were bridged; the largest jump is in the unit of the column.
    pub spikes: Vec<(String, Spikes)>,
    /// The positions, by their columns, that are wrapped, and follow their motion where they are read; the spans are
    /// in the units of the columns.
    pub wrapped: Vec<(String, Wrapped)>,
    /// Where rows are missing, left out or interpolated.
    pub missing: MissingRows,
    /// The longest time without a gap or a row that is left out, s.
    pub longest: f64,
    /// The time without these at both of whose ends the filters settle, s: a shorter one gives no
    /// equation.
    pub settling: f64,
    /// What the dates of its recordings change of the times by which its files are joined, as a sentence.
    pub later: Option<String>,
    /// The titles of columns that are not read, where no assignment names columns but that of time; without those that
    /// only count or date the rows.
    pub unused: Vec<String>,
    /// The faulty rows.
    pub problems: Problems,
    /// What was done with the faulty rows.
    pub policies: Policies,
}

/// Rows of a log that are missing, left out, or interpolated as an entry of theirs is no measurement.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MissingRows {
    /// Their number.
    pub count: usize,
    /// The times of the used rows around them, s; at most [`Self::MAX_SPANS`] of these places.
    pub spans: Vec<[f64; 2]>,
    /// The time of the first row that is used, s.
    pub start: f64,
    /// The time of the last one, s.
    pub end: f64,
}

impl MissingRows {
    /// The largest number of places that are kept.
    pub const MAX_SPANS: usize = 10_000;

    /// Counts what is missing between two rows that are used.
    ///
    /// - `step`: the usual one, s.
    fn between(&mut self, before: f64, time: f64, step: f64) {
        let rows = ((time - before) / step).round() - 1.0;
        if rows >= 1.0 {
            #[allow(clippy::cast_sign_loss, reason = "at least 1")]
            let rows = rows as usize;
            // a clock may jump by any number of steps
            self.count = self.count.saturating_add(rows);
            if self.spans.len() < Self::MAX_SPANS {
                self.spans.push([before, time]);
            }
        }
    }
}

/// One opened log file, with the results of its first passes.
#[derive(Clone)]
pub(super) struct Log {
    pub(super) file: LogFile,
    pub(super) survey: Survey,
    /// The Fourier series of the positions, with [`Method::Fourier`].
    pub(super) series: Option<Fourier>,
    /// The resolution and noise of each measured position's encoder.
    pub(super) encoders: Vec<Encoder>,
    /// The same of each measured velocity; nothing where it is not measured or not used alone.
    pub(super) velocity_noise: Vec<Encoder>,
    /// Whether gaps or rows that are left out divide it.
    pub(super) divided: bool,
    /// Whether all rows of the file are used as they are, each following the one before.
    pub(super) is_whole: bool,
    /// The noise of each effort, once it was computed from rows as they are in the file.
    pub(super) effort_levels: Option<Vec<NoiseLevels>>,
    /// Rows in memory that take the place of those of the file, one list for each stretch without a
    /// gap.
    pub(super) kept: Option<Vec<Vec<LogRow>>>,
}

impl Log {
    /// By how much each entry of a row is late, s.
    pub(super) fn late(&self) -> impl Iterator<Item = f64> {
        self.file.layout.channels.iter().map(|own| own.late)
    }

    /// Passes the usable rows to `each`, as [`LogFile::rows`] does, or those in memory.
    pub(super) fn rows(
        &self,
        problem: &mut dyn FnMut(Problem),
        each: &mut RowSink<'_>,
    ) -> Result<(), DataError> {
        let Some(kept) = &self.kept else {
            if self.is_whole {
                return self.file.unchecked_rows(&self.survey, each);
            }
            self.file.rows(&self.survey, problem, each)?;
            return Ok(());
        };
        for stretch in kept {
            for (k, row) in stretch.iter().enumerate() {
                each(row, k > 0)?;
            }
        }
        Ok(())
    }
}

/// The largest number of rows on either side that a filter may need, as a window with them is held
/// in memory.
const MAX_SUPPORT_ROWS: usize = 1_000_000;
/// The part of the squared accelerations of a coordinate from which on their noise is told: inertia that
/// acts through them is then found twenty times too small.
const NOISE_PART: f64 = 0.95;
/// Rise time of a low-pass filter after a step, in periods of its cutoff frequency.
const RISE_TIME_PERIODS: f64 = 0.3;
/// A position that goes on as noise does but changes from row to row by more than this, rad or m, is that of
/// separate poses.
const MIN_POSE_TRAVEL: f64 = 0.02;
/// The part of a coordinate's rms speed below which it may stick; a swing spends one part in forty of
/// its time there.
const STICKING_PART: f64 = 0.05;

/// Log files of one robot, as a [`Source`] of states; their columns are held in memory, see
/// [`ParsedFiles`](super::ParsedFiles).
///
/// ```
/// # mod models {
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs"));
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum_base.rs"));
/// # }
/// # use models::Pendulum;
/// use regen_identify::data::{Logs, Settings};
/// use regen_identify::identify::{EquationKind, Options, identify};
/// use regen_identify::signals::Method;
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
/// let found = identify(&Pendulum, EquationKind::Forces, &Options::default(), &mut logs)?;
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
    /// The number of rows to one state.
    pub(super) states_every: usize,
}

impl<'m, M: Model<f64> + ?Sized> Logs<'m, M> {
    /// Opens runs, or the paths of whole files, and reads each twice: first for the statistics of
    /// all its rows, then for its faulty rows, its encoders' resolution and its Fourier series.
    ///
    /// # Errors
    /// When a file cannot be read, lacks columns, has fewer than two usable rows, or has faulty
    /// rows under [`Policy::Fail`].
    pub fn open<R: Clone + Into<Run>>(
        model: &'m M,
        runs: &[R],
        settings: &Settings,
    ) -> Result<Self, DataError> {
        let info = model.info();
        let policies = settings.policies();
        let mut files = Vec::with_capacity(runs.len());
        let mut reports = Vec::with_capacity(runs.len());
        for run in runs {
            let file = LogFile::open(&run.clone().into(), &info, settings)?;
            require_names(&file.name, &info, settings)?;
            require_measured(&file, &info, settings)?;
            let survey = file.survey(&info)?;
            let mut problems = Problems::default();
            let (mut rows, mut rows_in_all) = (0, 0);
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
            // velocities beside accelerations are used as they are
            let both = file
                .layout
                .velocities
                .iter()
                .zip(&file.layout.accelerations);
            let velocities: Vec<Option<usize>> =
                both.map(|(v, a)| v.filter(|_| a.is_none())).collect();
            let mut of_velocities = differences.clone();
            let mut sketch = Sketch::default();
            let mut was_bridged = false;
            let (mut missing, mut last, step) = (MissingRows::default(), None, survey.time_step());
            let (mut start, mut longest, mut segments) = (0.0, 0.0_f64, 0_usize);
            let bridged = file.rows(
                &survey,
                &mut |problem| problems.add(problem),
                &mut |row, follows| {
                    let time = row.values.first().copied().unwrap_or(0.0);
                    rows_in_all += 1;
                    if !follows {
                        start = time;
                        segments += 1;
                    }
                    longest = longest.max(time - start);
                    // what is interpolated tells nothing of an encoder
                    let follows = !core::mem::replace(&mut was_bridged, row.bridged) && follows;
                    if row.bridged {
                        return Ok(());
                    }
                    rows += 1;
                    match last.replace(time) {
                        Some(before) => missing.between(before, time, step),
                        None => missing.start = time,
                    }
                    missing.end = time;
                    sketch.push(row.values.get(1..).unwrap_or_default());
                    let positions = &row.values[file.layout.positions()];
                    for (all, value) in differences.iter_mut().zip(positions) {
                        all.push(*value, follows);
                    }
                    for (all, entry) in of_velocities.iter_mut().zip(&velocities) {
                        if let Some(value) = entry.and_then(|entry| row.values.get(entry)) {
                            all.push(*value, follows);
                        }
                    }
                    if let Some(fit) = &mut fit {
                        fit.push(row.values[0], &row.values[file.layout.positions()])
                            .map_err(|why| signal(&file, why))?;
                    }
                    Ok(())
                },
            )?;
            let name = file.name.clone();
            let refused = problems.treated(&policies, Policy::Fail);
            if refused.total() > 0 {
                return Err(DataError::Problems {
                    file: name,
                    problems: refused,
                });
            }
            // without rows, what is wrong with all of them is the reason
            if rows < 2 && problems.total() > 0 {
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
            let finish = |all: Vec<Differences>| -> Vec<Encoder> {
                all.into_iter().map(Differences::finish).collect()
            };
            let (encoders, velocity_noise) = (finish(differences), finish(of_velocities));
            // noise and rest are told by how a position goes on from row to row
            let read = |entry: &usize| !(file.layout.is_constant(*entry) || settings.poses);
            let entries = file.layout.positions().zip(&file.layout.measured);
            let constant = entries.zip(&encoders);
            let constant = constant.filter(|((entry, _), encoder)| encoder.still && read(entry));
            let are_poses = (constant.clone()).any(|(_, encoder)| encoder.travel > MIN_POSE_TRAVEL);
            let still = constant.filter_map(|((_, c), _)| info.coordinates.get(*c));
            let repeats = repeated(&sketch, &reports);
            let is_whole = segments == 1
                && rows_in_all == rows
                && problems.total() == 0
                && settings.resample.is_none();
            reports.push(FileReport {
                repeats,
                sketch,
                still: still.map(|name| (*name).to_owned()).collect(),
                are_poses,
                noisy: Vec::new(),
                uncut: survey.uncut,
                file: name,
                rows,
                step: survey.time_step(),
                states: 0,
                derivatives: file.layout.derivatives,
                velocities: velocities
                    .iter()
                    .zip(file.layout.positions())
                    .all(|(v, entry)| v.is_some() || !read(&entry))
                    && series.is_none(),
                bridged,
                spikes: if file.bridges_spikes() {
                    let one = |own: &Spikes| {
                        let entry = file.layout.efforts().nth(own.effort)?;
                        let factor = file.layout.channels.get(entry)?.factor;
                        let largest = (own.largest / factor).abs();
                        Some((file.layout.title(entry), Spikes { largest, ..*own }))
                    };
                    survey.spikes.iter().filter_map(one).collect()
                } else {
                    Vec::new()
                },
                wrapped: (survey.wrapped.iter())
                    .map(|(entry, own)| {
                        let factor = file.layout.channels.get(*entry).map_or(1.0, |c| c.factor);
                        let span = (own.span / factor).abs();
                        (file.layout.title(*entry), Wrapped { span, ..*own })
                    })
                    .collect(),
                missing,
                longest,
                settling: settling(&file, &survey, settings),
                later: file.later(),
                unused: file.layout.unused.clone(),
                problems,
                policies,
            });
            files.push(Log {
                file,
                survey,
                series,
                encoders,
                velocity_noise,
                effort_levels: None,
                kept: None,
                is_whole,
                divided: segments > 1,
            });
        }
        Ok(Self {
            model,
            settings: settings.clone(),
            files,
            reports,
            states_every: 1,
        })
    }

    /// How the logs are read.
    pub(crate) fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Summaries of the files, in the order of the paths; the number of states and the states that
    /// do not close are those of the last pass.
    pub fn reports(&self) -> &[FileReport] {
        &self.reports
    }
}

/// The run that has most rows of another one, and the part of that one's rows that it has; `None` if none has many.
fn repeated(sketch: &Sketch, earlier: &[FileReport]) -> Option<(String, f64)> {
    let parts = earlier
        .iter()
        .filter_map(|own| Some((own.file.clone(), sketch.part_in(&own.sketch)?)));
    parts.max_by(|a, b| a.1.total_cmp(&b.1))
}

impl FileReport {
    /// The run of some earlier ones that has most rows of this one, and the part of this one's rows that it has.
    pub fn repeated_of(&self, earlier: &[Self]) -> Option<(String, f64)> {
        repeated(&self.sketch, earlier)
    }
}

pub(super) fn signal(file: &LogFile, why: SignalError) -> DataError {
    DataError::Signal {
        file: file.name.clone(),
        why,
    }
}

impl<M: BaseModel<f64> + ?Sized> Source for Logs<'_, M> {
    type Error = DataError;

    fn changed_efforts(
        &mut self,
        beta: &[f64],
        motion: Option<&MotionSeries>,
        each: &mut dyn FnMut(&ChangedEfforts<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), DataError> {
        self.visit_changed_efforts(beta, motion, each)
    }

    fn visit(
        &mut self,
        each: &mut dyn FnMut(&StateSample<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), DataError> {
        let info = self.model.info();
        let one = |log: &Log| Ok((self.fewer_states(log)?, self.support(log)?));
        let spans: Result<Vec<_>, DataError> = self.files.iter().map(one).collect();
        let files = self.files.iter().zip(&mut self.reports);
        for ((log, report), (fewer, support)) in files.zip(spans?) {
            let deviation = |&c: &usize| {
                let name = info.coordinates.get(c).copied().unwrap_or_default();
                let given = self.settings.deviations.iter().find(|(n, _)| n == name);
                given.map_or(1.0, |(_, d)| *d)
            };
            let measured = &log.file.layout.measured;
            let deviations: Vec<f64> = measured.iter().map(deviation).collect();
            // problems of states replace those of an earlier pass
            let mut fresh = Problems::default();
            let mut window = Window {
                log,
                settings: &self.settings,
                completion: Completion::new(self.model, measured, &deviations)?,
                model: self.model,
                fewer,
                support,
                sign_thresholds: sign_thresholds(log, &self.settings)?,
                unmeasured: Unmeasured::all(self.model, measured)?,
                left_out: vec![false; info.dof()],
                delays: delays(&info, &self.settings),
                rows: Stretch::default(),
                weights: Vec::new(),
                before: 0,
                count: 0,
                follows: false,
                states: 0,
                accelerations: vec![0.0; log.encoders.len()],
                rows_moved: 0,
                problems: &mut fresh,
                each,
            };
            let mut average = self
                .settings
                .period
                .map(|period| Average::new(period, log.survey.time_step(), &log.file.layout))
                .transpose()
                .map_err(|why| DataError::ColumnLayout {
                    file: report.file.clone(),
                    why,
                })?;
            log.rows(&mut |_| {}, &mut |row, follows| match &mut average {
                Some(average) => {
                    if row.unknown.is_empty() {
                        average.push(&row.values);
                    }
                    Ok(())
                }
                None => window.take(row, None, follows),
            })?;
            if let Some(average) = average {
                let means = average.finish().map_err(|why| DataError::ColumnLayout {
                    file: report.file.clone(),
                    why,
                })?;
                for (k, (values, weights)) in means.into_iter().enumerate() {
                    let row = LogRow {
                        line: 0,
                        values,
                        ..LogRow::default()
                    };
                    window.take(&row, Some(weights), k > 0)?;
                }
            }
            window.finish()?;
            report.states = window.states;
            let noisy = noisy(
                log,
                &self.settings,
                &window.accelerations,
                window.rows_moved,
            )?;
            let noisy = noisy.iter().filter_map(|c| info.coordinates.get(*c));
            report.noisy = noisy.map(|name| (*name).to_owned()).collect();
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

    fn allow_fewer_states(&mut self, are_allowed: bool) -> usize {
        self.states_every = if are_allowed { self.fewest_states() } else { 1 };
        self.states_every
    }

    fn effort_densities(&self) -> Result<Vec<f64>, DataError> {
        match self.settings.period {
            // the equations are means of periods
            Some(_) => Ok(Vec::new()),
            None => self.densities_of_efforts(),
        }
    }

    fn filtering(&self) -> Filtering {
        Filtering {
            decimation: (self.settings.decimation / self.states_every).max(1),
            ..self.settings.filtering()
        }
    }
}

impl<M: BaseModel<f64> + ?Sized> Logs<'_, M> {
    /// The number of rows on either side that a state depends on.
    fn support(&self, log: &Log) -> Result<usize, DataError> {
        let fewer = self.fewer_states(log)?;
        let least = fewer.map_or(0, |own| own.filter.support());
        Ok(support(log, &self.settings)?.max(least))
    }
}

/// The delay of each actuated joint's effort, s.
pub(super) fn delays(info: &Info<'_>, settings: &Settings) -> Vec<f64> {
    let of = |c: &usize| {
        let name = info.coordinates.get(*c).copied().unwrap_or_default();
        let given = settings.delays.iter().find(|(n, _)| n == name);
        given.map_or(0.0, |(_, delay)| *delay)
    };
    info.actuated.iter().map(of).collect()
}

/// The time over which derivatives mix samples, s.
///
/// - `method`: how positions are differentiated.
pub(super) fn reach(log: &Log, method: Method, encoder: Encoder) -> f64 {
    let step = log.survey.time_step();
    if log.file.layout.derivatives || log.series.is_some() {
        return step;
    }
    match method {
        Method::Butterworth { cutoff, .. } => (RISE_TIME_PERIODS / cutoff).max(2.0 * step),
        Method::Local { half_width } => (0.5 * half_width).max(2.0 * step),
        _ => encoder.neighbours.max(1) as f64 * step,
    }
}

/// The speed of each measured coordinate below which its friction may not be that of sliding, rad/s
/// or m/s: twice the standard deviation of the differentiated encoder noise, which may turn its
/// sign, at least `rest_speed`, and at least a part of its rms speed: a joint that sticks while it
/// reverses creeps, and its friction is anywhere between that of both directions.
pub(super) fn sign_thresholds(log: &Log, settings: &Settings) -> Result<Vec<f64>, DataError> {
    let gain = if log.file.layout.derivatives || log.series.is_some() {
        0.0
    } else {
        let step = log.survey.time_step();
        settings
            .method
            .of_states(step)
            .rate_gain(step)
            .map_err(|why| signal(&log.file, why))?
    };
    // differences over more neighbours pass more noise
    let more = |encoder: &Encoder| match (settings.method, encoder.neighbours) {
        (Method::Central, 2) => 130_f64.sqrt() / 72_f64.sqrt(),
        (Method::Central, 3) => 4214_f64.sqrt() / 1800_f64.sqrt(),
        _ => 1.0,
    };
    let measured = log.file.layout.velocities.iter();
    let encoders = log.encoders.iter().zip(&log.velocity_noise);
    let noise = encoders
        .zip(measured)
        .map(|((position, velocity), measured)| match measured {
            Some(_) if log.series.is_none() => velocity.noise,
            _ => gain * more(position) * position.noise,
        });
    let usual = log
        .encoders
        .iter()
        .map(|encoder| encoder.speed(log.survey.time_step()));
    Ok(noise
        .zip(usual)
        .map(|(noise, usual)| {
            settings
                .rest_speed
                .max(2.0 * noise)
                .max(STICKING_PART * usual)
        })
        .collect())
}

/// Refuses settings of coordinates and efforts that the robot does not have.
fn require_names(file: &str, info: &Info<'_>, settings: &Settings) -> Result<(), DataError> {
    let efforts = info
        .actuated
        .iter()
        .filter_map(|k| info.coordinates.get(*k));
    let efforts: Vec<&str> = efforts.copied().collect();
    let refuse = |name: &str, what: &str, all: &[&str]| DataError::ColumnLayout {
        file: file.to_owned(),
        why: format!(
            "`{name}`, whose {what} is given, is none of {}",
            all.join(" ")
        ),
    };
    for (name, _) in &settings.deviations {
        if !info.coordinates.contains(&name.as_str()) {
            return Err(refuse(name, "standard deviation", info.coordinates));
        }
    }
    for (name, _) in &settings.delays {
        if !efforts.contains(&name.as_str()) {
            return Err(refuse(name, "delay", &efforts));
        }
    }
    Ok(())
}

/// Refuses settings of signals that a log does not have.
fn require_measured(file: &LogFile, info: &Info<'_>, settings: &Settings) -> Result<(), DataError> {
    let layout = &file.layout;
    let unfit = |why: String| DataError::ColumnLayout {
        file: file.name.clone(),
        why,
    };
    if settings.measured_rates == Some(true) && layout.velocities.iter().all(Option::is_none) {
        return Err(unfit(
            "measured velocities are asked for, and it has none: name their columns (`qd_NAME`), or \
             leave `velocities` out"
                .to_owned(),
        ));
    }
    if let Some((name, _)) = settings.deviations.first()
        && layout.measured.len() <= info.independent.len()
    {
        return Err(unfit(format!(
            "the standard deviation of `{name}` has no effect: it weights coordinates where more are \
             measured than needed, and {} are needed and measured; leave it out",
            layout.measured.len()
        )));
    }
    let is_measured = |name: &str| {
        let place = info.index_of(name);
        place.is_some_and(|c| layout.measured.contains(&c))
    };
    match settings
        .deviations
        .iter()
        .find(|(name, _)| !is_measured(name))
    {
        None => Ok(()),
        Some((name, _)) => Err(unfit(format!(
            "the standard deviation of `{name}` has no effect: it has no column of it; leave it out"
        ))),
    }
}

/// The indices of the measured coordinates of whose accelerations at least [`NOISE_PART`] is noise of
/// their positions.
///
/// - `squares`: the sum of the squares of each one's accelerations over `rows` rows.
fn noisy(
    log: &Log,
    settings: &Settings,
    squares: &[f64],
    rows: usize,
) -> Result<Vec<usize>, DataError> {
    let layout = &log.file.layout;
    if rows == 0 || layout.derivatives || log.series.is_some() || settings.period.is_some() {
        return Ok(Vec::new());
    }
    let method = settings.method.of_states(log.survey.time_step());
    let noise = motion_noise(log, method).map_err(|why| signal(&log.file, why))?;
    let coordinates = layout.measured.iter().zip(&log.encoders);
    let coordinates = coordinates.zip(&layout.velocities);
    let found = coordinates.zip(noise.iter().zip(squares));
    let found = found.filter(|(((_, encoder), velocity), ([_, noise], square))| {
        let is_noise = noise * noise > NOISE_PART * *square / rows as f64;
        velocity.is_none() && !encoder.still && is_noise
    });
    Ok(found.map(|(((c, _), _), _)| *c).collect())
}

/// The standard deviations of the noise of the velocity and of the acceleration of each measured coordinate; 0
/// for those that are measured, or follow from a series.
///
/// - `method`: how positions are differentiated.
pub(super) fn motion_noise(log: &Log, method: Method) -> Result<Vec<[f64; 2]>, SignalError> {
    let layout = &log.file.layout;
    if layout.derivatives || log.series.is_some() {
        return Ok(vec![[0.0; 2]; layout.measured.len()]);
    }
    let step = log.survey.time_step();
    let gains = method.gains(step)?;
    let is_central = method == Method::Central;
    let one = |(place, encoder): (usize, &Encoder)| {
        let is_measured = |of: &[Option<usize>]| of.get(place).copied().flatten().is_some();
        let of_velocity = log.velocity_noise.get(place).map_or(0.0, |own| own.noise);
        let rate = if is_measured(&layout.velocities) {
            0.0
        } else {
            gains[0] * encoder.noise
        };
        let acceleration = if is_measured(&layout.accelerations) {
            0.0
        } else if is_measured(&layout.velocities) {
            gains[0] * of_velocity
        } else if is_central {
            encoder.acceleration_noise(step)
        } else {
            gains[1] * encoder.noise
        };
        [rate, acceleration]
    };
    Ok(log.encoders.iter().enumerate().map(one).collect())
}

/// The time that the filters of states and equations need to settle at both ends of a segment, s.
fn settling(file: &LogFile, survey: &Survey, settings: &Settings) -> f64 {
    let step = survey.time_step();
    let settles = |smoothing: Smoothing| smoothing.settling(step).unwrap_or(0);
    let of_states = if file.layout.derivatives {
        Smoothing::None
    } else {
        settings.method.of_states(step).smoothing()
    };
    let rows = settles(of_states).saturating_add(settles(settings.method.smoothing()));
    2.0 * step * rows as f64
}

/// The number of rows on either side that the motion at a row and its effort depend on.
fn support(log: &Log, settings: &Settings) -> Result<usize, DataError> {
    let step = log.survey.time_step();
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
    let late = log.late().fold(0.0, |m: f64, own| m.max(own.abs()));
    #[allow(clippy::cast_sign_loss, reason = "neither is negative")]
    let late = if late > 0.0 {
        (late / step).ceil() as usize + shift::NEIGHBOURS
    } else {
        0
    };
    let least = standstill::context(step).max(shifted) + late;
    if log.file.layout.derivatives || log.series.is_some() {
        return Ok(least);
    }
    // check the method as the user gave it first, so that an error names the user's own numbers
    let asked = settings.method.support(step);
    asked.map_err(|why| signal(&log.file, why))?;
    let support = settings
        .method
        .of_states(step)
        .support(step)
        .map_err(|why| signal(&log.file, why))?;
    let support = match settings.method {
        Method::Central => support.max(Some(NEIGHBOURS)),
        _ => support,
    };
    // of what is read late, rows on either side are filtered
    match support.map(|rows| (rows + late).max(least)) {
        Some(rows) if rows <= MAX_SUPPORT_ROWS => Ok(rows),
        _ => Err(signal(
            &log.file,
            SignalError::Setting("the filter is too slow for this sampling: raise its cutoff"),
        )),
    }
}
