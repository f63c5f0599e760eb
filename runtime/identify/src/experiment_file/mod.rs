//! The experiment file: one YAML that describes how the logs of a robot are read, and their purpose.
//!
//! ```yaml
//! columns:
//!   q*: {column: "pos_*", unit: deg, factor: 1/45, offset: -0.3}  # (raw * unit) * factor + offset
//!   tau_*: {column: "i*", unit: A, gain: 10.0956}                 # a current needs a gain
//! rate: 200                                # Hz, if no column has the time
//! process:
//!   resample: 100                          # Hz, onto an even grid
//!   filter: {butterworth: {order: 4, cutoff: 20}}
//!   standstill: {velocity: 0.02, effort: leave-out}
//!   delay: auto
//! checks: {outliers: tell, stuck: tell}
//! runs:
//!   - {files: [pos1.csv, curr1.csv], rows: [355, 5090]}
//!   - {files: [run3.csv], use: validate}
//!   - {files: [run5.csv], commands: {q*: "cmd_*"}, controller: {q1: {kp: 40, kd: 2}}}
//! ```
//!
//! [`schema`] describes all keys. [`ExperimentFile::read`] reports every mistake of a file at once,
//! each with its place and a remedy.

mod addition;
mod calibration;
mod columns;
mod keys;
mod keys_of_calibration;
mod keys_of_runs;
mod process;
mod quantity_kind;
mod runs;
mod shape;
#[cfg(test)]
mod tests;

pub use addition::with_process;
pub use calibration::{Calibration, MeasuredFrame, MeasuredKind};

use std::path::Path;

use regen_runtime::Info;
use serde_json::{Value, json};

use crate::data::{Assignment, Run, Settings};
use crate::document::{Mistakes, Node};
use crate::gains::KnownPayload;
use crate::identify::EquationKind;
use shape::{Shape, Sink};

/// Largest size of a file, bytes.
pub const MAX_BYTES: usize = 1 << 20;

/// The content of an experiment file.
#[derive(Clone, Debug, PartialEq)]
pub struct ExperimentFile {
    /// How logs are read and processed. A current of unknown gain has an assignment without a gain,
    /// with which no log can be read until the gain is set.
    pub settings: Settings,
    /// The equations that are set up.
    pub kind: EquationKind,
    /// Whether delays of the efforts are estimated, besides those that the settings state.
    pub delay: Delay,
    /// The runs, in the order of the file.
    pub runs: Vec<PlannedRun>,
    /// The coordinates whose efforts are currents of unknown gains.
    pub unknown_gains: Vec<String>,
    /// What is measured of the geometry; `None` if the file does not say it.
    pub calibration: Option<Calibration>,
    /// The places of unknown gains.
    gain_places: Vec<usize>,
    /// For each run, the places of its payload and its controller.
    places: Vec<runs::Places>,
}

/// Where the delays of efforts behind the motion come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Delay {
    /// The settings state the delays.
    #[default]
    Stated,
    /// The identification finds the delays from the logs.
    Auto,
}

/// A run and its purpose.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedRun {
    /// The files, as the experiment file names them, and the part that is read.
    pub run: Run,
    /// Whether the run is for identification or for validation.
    pub purpose: Purpose,
    /// The payload that the robot carries in the run.
    pub payload: Payload,
    /// The columns of the commanded positions, as positions of the joints.
    pub commands: Vec<Assignment>,
    /// The controllers in the form of a controller file, with a key for each joint; `None` if the
    /// run states none.
    pub controller: Option<Value>,
}

/// The purpose of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Purpose {
    /// Parameters are identified from the run.
    #[default]
    Identify,
    /// Its efforts are predicted with parameters that were identified from other runs.
    Validate,
}

/// The payload of the robot in a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Payload {
    /// The robot carries nothing.
    #[default]
    None,
    /// A body; its unknown parameters are `None`.
    Carried {
        /// The label of its body in the spec; `None` if the spec has only one payload.
        body: Option<String>,
        /// Its mass, kg.
        mass: Option<f64>,
        /// Its centre of mass in the frame of the payload's body, m.
        com: Option<[f64; 3]>,
        /// Ixx, Ixy, Ixz, Iyy, Iyz, Izz about its centre of mass, kg m^2.
        inertia: Option<[f64; 6]>,
    },
}

/// The payloads of the robot, and the one that each run of a file carries.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Loads {
    /// For each run of the file, the index of the payload that is carried.
    pub carried: Vec<Option<usize>>,
    /// The payloads of the robot with the parameters that the runs state.
    pub payloads: Vec<KnownPayload>,
}

impl PlannedRun {
    /// The run with its files looked up in a folder.
    pub fn placed(&self, folder: &Path) -> Run {
        let files = self.run.files.iter();
        Run {
            files: files.map(|file| folder.join(file)).collect(),
            ..self.run.clone()
        }
    }
}

impl Payload {
    /// A payload without known parameters.
    pub const UNKNOWN: Self = Self::Carried {
        body: None,
        mass: None,
        com: None,
        inertia: None,
    };
}

impl ExperimentFile {
    /// Reads the text of a file for the robot whose coordinates `info` names.
    ///
    /// # Errors
    /// All mistakes in the text with their places.
    ///
    /// ```
    /// use std::path::{Path, PathBuf};
    ///
    /// use regen_identify::data::Quantity;
    /// use regen_identify::experiment_file::{ExperimentFile, Purpose};
    /// use regen_runtime::Info;
    ///
    /// let info = Info {
    ///     name: "arm",
    ///     coordinates: &["q1", "q2"],
    ///     independent: &[0, 1],
    ///     actuated: &[0, 1],
    ///     ..Info::EMPTY
    /// };
    /// let text = r#"
    /// columns:
    ///   q*: {column: "pos_*", unit: mm, factor: -1/2}
    ///   tau_*: {column: 3..4, unit: A, gain: [10.1, 8.4]}
    /// rate: 200
    /// runs:
    ///   - {files: [a.csv, b.csv], rows: [10, 400]}
    ///   - {files: c.csv, use: validate}
    /// "#;
    /// let file = ExperimentFile::read(text, &info)?;
    /// let [q1, _, _, tau2] = &file.settings.columns[..] else { panic!() };
    /// assert_eq!((q1.column.as_str(), q1.factor), ("pos_1", -0.5e-3));
    /// assert_eq!(tau2.quantity, Quantity::Effort("q2".to_owned()));
    /// assert_eq!((tau2.number, tau2.gain), (Some(4), Some(8.4)));
    /// let runs = file.runs_in(Path::new("logs"), Purpose::Identify);
    /// assert_eq!(runs[0].files[1], PathBuf::from("logs/b.csv"));
    /// assert_eq!(runs[0].rows, Some((10, 400)));
    ///
    /// let wrong = ExperimentFile::read("colums: {}\nrate: -1\n", &info).unwrap_err();
    /// assert_eq!(wrong.0[0].message, "unknown key 'colums'; did you mean 'columns'?");
    /// assert_eq!((wrong.0[1].at, &*wrong.0[1].path), (17, "`rate`"));
    /// # Ok::<(), regen_identify::files::Mistakes>(())
    /// ```
    pub fn read(text: &str, info: &Info<'_>) -> Result<Self, Mistakes> {
        let mut sink = Sink::default();
        if text.len() > MAX_BYTES {
            let message = format!(
                "the file has {} bytes; the limit is {MAX_BYTES}",
                text.len()
            );
            sink.push(0, "", message, "");
            return Err(Mistakes(sink.mistakes));
        }
        let root = Node::parse(text).map_err(|mistake| Mistakes(vec![mistake]))?;
        Shape::Record(&keys::FILE).check(&root, "", &mut sink);
        let columns = columns::read(&root, info, &mut sink);
        let process = process::read(&root, info, &mut sink);
        let runs = runs::read(&root, info, &mut sink);
        let calibration = root.get("calibrate");
        let calibration = calibration.map(|node| calibration::read(node, &mut sink));
        if !sink.mistakes.is_empty() {
            let mut mistakes = sink.mistakes;
            mistakes.sort_by_key(|mistake| mistake.at);
            return Err(Mistakes(mistakes));
        }
        Ok(Self {
            settings: Settings {
                columns: columns.assignments,
                ..process.settings
            },
            kind: process.kind,
            delay: process.delay,
            calibration,
            places: runs.iter().map(|(_, at)| *at).collect(),
            runs: runs.into_iter().map(|(run, _)| run).collect(),
            gain_places: columns.unknown_gains.iter().map(|gain| gain.1).collect(),
            unknown_gains: columns
                .unknown_gains
                .into_iter()
                .map(|gain| gain.0)
                .collect(),
        })
    }

    /// Returns an error if the file has unknown gains or payloads, for estimators that use neither.
    ///
    /// # Errors
    /// One mistake for each of them, at its place.
    ///
    /// ```
    /// use regen_identify::experiment_file::ExperimentFile;
    /// use regen_runtime::Info;
    ///
    /// let text = "runs:\n  - {files: a.csv, payload: {m: 2.8}}\n";
    /// let file = ExperimentFile::read(text, &Info::EMPTY)?;
    /// let refused = file.require_plain().unwrap_err();
    /// assert_eq!(refused.0[0].path, "`runs`, entry 1, `payload`");
    /// # Ok::<(), regen_identify::files::Mistakes>(())
    /// ```
    pub fn require_plain(&self) -> Result<(), Mistakes> {
        let mut unused = Sink::default();
        for (name, at) in self.unknown_gains.iter().zip(&self.gain_places) {
            let path = format!("`columns`, the effort of {name}");
            let message = "this command or estimator does not identify unknown gains: least \
                           squares does, from all runs together"
                .to_owned();
            let remedy = "give the torque constant with the gear, in N m/A or N/A";
            unused.push(*at, &path, message, remedy);
        }
        for (k, (run, at)) in self.runs.iter().zip(&self.places).enumerate() {
            if run.payload != Payload::None {
                let path = format!("`runs`, entry {}, `payload`", k + 1);
                let message = "this command or estimator does not support runs with a payload: \
                               least squares does, from all runs together"
                    .to_owned();
                let remedy = "leave the run out";
                unused.push(at.payload, &path, message, remedy);
            }
        }
        unused.into_result()
    }

    /// Whether there are unknown gains, or runs with a payload.
    pub fn has_unknowns(&self) -> bool {
        !self.unknown_gains.is_empty() || self.runs.iter().any(|run| run.payload != Payload::None)
    }

    /// The payload that each run carries, and the known parameters of all payloads. Runs that carry
    /// the same body carry the same load; runs to identify from state the same of it.
    ///
    /// - `bodies`: the labels of the robot's payloads.
    ///
    /// # Errors
    /// One mistake for each run that names no payload of the robot, does not name one of several, or
    /// states other parameters than another run with the same payload, or none where that states some.
    ///
    /// ```
    /// use regen_identify::experiment_file::ExperimentFile;
    /// use regen_runtime::Info;
    ///
    /// let text = "
    /// runs:
    ///   - {files: a.csv}
    ///   - {files: b.csv, payload: {m: 2.8}}
    ///   - {files: c.csv, payload: unknown, use: validate}
    /// ";
    /// let file = ExperimentFile::read(text, &Info::EMPTY)?;
    /// let found = file.loads(&["load".to_owned()])?;
    /// assert_eq!(found.carried, [None, Some(0), Some(0)]);
    /// assert_eq!(found.payloads[0].mass, Some(2.8));
    /// let refused = file.loads(&[]).unwrap_err();
    /// assert_eq!(refused.0[0].path, "`runs`, entry 2, `payload`");
    /// # Ok::<(), regen_identify::files::Mistakes>(())
    /// ```
    pub fn loads(&self, bodies: &[String]) -> Result<Loads, Mistakes> {
        let mut sink = Sink::default();
        let mut out = Loads {
            carried: Vec::new(),
            payloads: bodies
                .iter()
                .map(|body| KnownPayload {
                    body: body.clone(),
                    ..KnownPayload::default()
                })
                .collect(),
        };
        // whether the first run to identify from with each payload states something of it
        let mut is_stated: Vec<Option<bool>> = vec![None; bodies.len()];
        for (k, (run, at)) in self.runs.iter().zip(&self.places).enumerate() {
            let Payload::Carried {
                body,
                mass,
                com,
                inertia,
            } = &run.payload
            else {
                out.carried.push(None);
                continue;
            };
            let path = format!("`runs`, entry {}, `payload`", k + 1);
            let place = match (body, bodies.len()) {
                (None, 1) => Some(0),
                (None, _) => None,
                (Some(body), _) => bodies.iter().position(|own| own == body),
            };
            out.carried.push(place);
            let Some(own) = place.and_then(|place| out.payloads.get_mut(place)) else {
                let listed = bodies.join(" ");
                let (message, remedy) = match body {
                    _ if bodies.is_empty() => (
                        "the spec has no body that is a payload".to_owned(),
                        "mark the body `payload: true`, on a fixed joint that ends its limb"
                            .to_owned(),
                    ),
                    Some(body) => (
                        format!("'{body}' is not a payload of the spec"),
                        format!("its payloads are {listed}"),
                    ),
                    None => (
                        format!("the spec has several payloads: {listed}"),
                        "name one, `payload: {body: NAME}`".to_owned(),
                    ),
                };
                sink.push(at.payload, &path, message, &remedy);
                continue;
            };
            let is_same = agree(&mut own.mass, *mass)
                & agree(&mut own.com, *com)
                & agree(&mut own.inertia, *inertia);
            if !is_same {
                let message = format!("another run states other parameters of '{}'", own.body);
                let remedy = "runs with the same body carry the same load; another load is another \
                              body of the spec";
                sink.push(at.payload, &path, message, remedy);
            }
            let states = mass.is_some() || com.is_some() || inertia.is_some();
            let first = place.and_then(|place| is_stated.get_mut(place));
            if let Some(first) = first.filter(|_| run.purpose == Purpose::Identify)
                && *first.get_or_insert(states) != states
            {
                let message = format!(
                    "of '{}' one run states parameters, and another one says that it is unknown",
                    own.body
                );
                let remedy = "runs with the same body carry the same load: state the same in both; an \
                              unknown load beside a known one is another body of the spec, in a limb of \
                              its own, and runs name it, `payload: {body: NAME}`";
                sink.push(at.payload, &path, message, remedy);
            }
        }
        sink.into_result().map(|()| out)
    }

    /// A mistake in the controllers of a run, at their place.
    ///
    /// - `run`: the index of the run;
    /// - `keys`: the keys below `controller` that lead to the mistake, such as `q1.kp`; may be empty;
    /// - `message`: the mistake, and what would be correct.
    ///
    /// ```
    /// use regen_identify::experiment_file::ExperimentFile;
    /// use regen_runtime::Info;
    ///
    /// let info = Info { coordinates: &["q1", "q2"], actuated: &[0, 1], ..Info::EMPTY };
    /// let text = "runs:\n  - {files: a.csv, commands: {q*: goal_*}, controller: {q*: {kp: 40}}}\n";
    /// let file = ExperimentFile::read(text, &info)?;
    /// assert_eq!(file.runs[0].commands[1].column, "goal_2");
    /// assert_eq!(file.runs[0].controller.as_ref().map(|c| c["q2"]["kp"].as_f64()), Some(Some(40.0)));
    /// let found = file.controller_mistake(0, "q1", "something is wrong".to_owned());
    /// assert_eq!(found.0[0].path, "`runs`, entry 1, `controller`, `q1`");
    /// assert!(text[found.0[0].at..].starts_with("{q*: {kp"));
    /// # Ok::<(), regen_identify::files::Mistakes>(())
    /// ```
    pub fn controller_mistake(&self, run: usize, keys: &str, message: String) -> Mistakes {
        let mut sink = Sink::default();
        let mut path = format!("`runs`, entry {}, `controller`", run + 1);
        for key in keys.split('.').filter(|key| !key.is_empty()) {
            path = shape::below(&path, key);
        }
        let at = self.places.get(run).map_or(0, |places| places.controller);
        sink.push(at, &path, message, "");
        Mistakes(sink.mistakes)
    }

    /// The coordinates that the columns of a file name, for reading it without a robot. A pattern
    /// with numbers of columns names `q1`, `q2`, and so on, one for each number; one with names of
    /// columns names no coordinates, since only a log has these names.
    ///
    /// # Errors
    /// When the text is not YAML.
    ///
    /// ```
    /// use regen_identify::experiment_file::ExperimentFile;
    ///
    /// let names = |text: &str| ExperimentFile::coordinates(text);
    /// let text = "columns: {elbow: a, tau_elbow: b, qd_wrist: c, tau2: d}";
    /// assert_eq!(names(text)?, ["elbow", "wrist", "q2"]);
    /// assert_eq!(names("columns: {\"*\": {column: 2..4}, tau_*: {column: 8..10}}")?, ["q1", "q2", "q3"]);
    /// # Ok::<(), regen_identify::files::Mistakes>(())
    /// ```
    pub fn coordinates(text: &str) -> Result<Vec<String>, Mistakes> {
        let root = Node::parse(text).map_err(|mistake| Mistakes(vec![mistake]))?;
        Ok(columns::coordinates(&root))
    }

    /// The runs for a purpose, with their files looked up in a folder.
    pub fn runs_in(&self, folder: &Path, purpose: Purpose) -> Vec<Run> {
        let runs = self.runs.iter().filter(|run| run.purpose == purpose);
        runs.map(|planned| planned.placed(folder)).collect()
    }
}

/// Stores the first stated value in `known`; returns false if `stated` contradicts it.
fn agree<T: PartialEq>(known: &mut Option<T>, stated: Option<T>) -> bool {
    match (&known, stated) {
        (_, None) => true,
        (None, stated) => {
            *known = stated;
            true
        }
        (Some(known), Some(stated)) => *known == stated,
    }
}

/// The JSON Schema of experiment files (draft 2020-12), the same text in every run.
///
/// ```
/// let schema = regen_identify::experiment_file::schema();
/// let value: serde_json::Value = serde_json::from_str(&schema)?;
/// assert_eq!(value["properties"]["rate"]["exclusiveMinimum"], 0);
/// # Ok::<(), serde_json::Error>(())
/// ```
pub fn schema() -> String {
    let mut root = keys::FILE.schema();
    if let Value::Object(root) = &mut root {
        let draft = "https://json-schema.org/draft/2020-12/schema";
        root.insert("$schema".to_owned(), json!(draft));
        root.insert("title".to_owned(), json!("Experiment file"));
    }
    let mut text = serde_json::to_string_pretty(&root).unwrap_or_default();
    text.push('\n');
    text
}
