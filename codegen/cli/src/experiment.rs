//! Experiment files among the logs of a command: their runs replace the logs, and options override
//! their settings.

use std::path::{Path, PathBuf};

use regen_codegen::diag::Source;
use regen_identify::data::{Assignment, Run, Settings};
use regen_identify::experiment_file::{Delay, ExperimentFile, Loads, PlannedRun, Purpose};
use regen_identify::files::Mistakes;
use regen_identify::gains::KnownPayload;
use regen_identify::identify::EquationKind;
use regen_response::{Setup, controllers};
use regen_runtime::Info;

use crate::args::{DelayArg, PayloadArg, ReadingArgs, require_unread};
use crate::exit::Failure;
use crate::{load, mistakes, terminal};

/// The content of an experiment file that concerns the reading of logs.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Experiment {
    pub(crate) settings: Settings,
    pub(crate) kind: EquationKind,
    /// The coordinates whose efforts are currents of unknown gain.
    pub(crate) unknown_gains: Vec<String>,
    /// The runs that are read, each with the payload that it carries.
    pub(crate) carried: Vec<(Run, Option<usize>)>,
    /// The robot's payloads with their known parameters.
    pub(crate) payloads: Vec<KnownPayload>,
    /// The runs that are read, each with its commands and controllers.
    pub(crate) controlled: Vec<(Run, Controlled)>,
}

/// The control loop of a run, as an experiment file describes it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Controlled {
    /// The columns of commanded positions.
    pub(crate) commands: Vec<Assignment>,
    /// The controllers; `None` if the file has none.
    pub(crate) setup: Option<Setup>,
}

impl Experiment {
    /// Whether a run carries a payload.
    pub(crate) fn carries(&self) -> bool {
        self.carried.iter().any(|(_, payload)| payload.is_some())
    }

    /// The commands and controllers of a run.
    pub(crate) fn controlled(&self, run: &Run) -> Option<&Controlled> {
        let found = self.controlled.iter().find(|(own, _)| own == run);
        found.map(|(_, controlled)| controlled)
    }
}

/// The hint for a file that is not an experiment.
const OTHER_FILE: &str = "an experiment file has the keys columns, process, runs and others; \
                          `regen schema experiment` describes them";

/// Replaces the experiment file among the logs by its runs for identification, and sets the reading
/// options; returns its runs for validation. If logs are given too, they are read instead of the
/// file's runs. Unknown gains and payloads are refused.
///
/// - `spec`: the robot's description.
pub(crate) fn resolve(
    logs: &mut Vec<Run>,
    reading: &mut ReadingArgs,
    spec: &Source,
) -> Result<Vec<Run>, Failure> {
    resolved(logs, reading, Some(spec), true)
}

/// As [`resolve_loaded`], with or without a robot; without one, the coordinates are those that the
/// file names, and what runs carry is not known.
pub(crate) fn resolve_for(
    logs: &mut Vec<Run>,
    reading: &mut ReadingArgs,
    spec: Option<&Source>,
) -> Result<Vec<Run>, Failure> {
    resolved(logs, reading, spec, false)
}

/// As [`resolve`], for commands that can use unknown gains and payloads.
pub(crate) fn resolve_loaded(
    logs: &mut Vec<Run>,
    reading: &mut ReadingArgs,
    spec: &Source,
) -> Result<Vec<Run>, Failure> {
    resolved(logs, reading, Some(spec), false)
}

/// As [`planned`], and refuses files of runs that the command would overwrite.
fn resolved(
    logs: &mut Vec<Run>,
    reading: &mut ReadingArgs,
    spec: Option<&Source>,
    is_plain: bool,
) -> Result<Vec<Run>, Failure> {
    let more = planned(logs, reading, spec, is_plain)?;
    for output in &reading.outputs {
        let files = logs.iter().chain(&more).flat_map(|run| &run.files);
        require_unread(output, files.map(PathBuf::as_path))?;
    }
    Ok(more)
}

fn planned(
    logs: &mut Vec<Run>,
    reading: &mut ReadingArgs,
    spec: Option<&Source>,
    is_plain: bool,
) -> Result<Vec<Run>, Failure> {
    let files = logs.iter().filter_map(yaml_path);
    let path = match &files.collect::<Vec<PathBuf>>()[..] {
        [] => {
            return match reading.folder {
                None => Ok(Vec::new()),
                Some(_) => Err(Failure::Usage(
                    "--logs names the folder of an experiment file's logs, but none is given"
                        .to_owned(),
                )),
            };
        }
        [path] => path.clone(),
        [first, second, ..] => {
            return Err(Failure::Usage(format!(
                "one experiment file at a time: {} and {} are two",
                first.display(),
                second.display()
            )));
        }
    };
    let (file, mut loads, mut controlled) = read(&path, spec, is_plain)?;
    if file.calibration.is_some() {
        terminal::note(&format!(
            "note: {}: `calibrate` is not used here; `regen calibrate` finds the geometry",
            path.display()
        ));
    }
    if let Some(run) = file
        .runs
        .iter()
        .find(|planned| planned.run.files.is_empty())
    {
        return Err(Failure::Input(format!(
            "{}: {} has no file",
            path.display(),
            run.run
        )));
    }
    let own = path.parent().unwrap_or(Path::new(""));
    let folder = reading.folder.as_deref().unwrap_or(own);
    logs.retain(|run| yaml_path(run).is_none());
    let planned = logs.is_empty();
    let validation = if planned {
        *logs = file.runs_in(folder, Purpose::Identify);
        file.runs_in(folder, Purpose::Validate)
    } else {
        Vec::new()
    };
    if logs.is_empty() && validation.is_empty() {
        return Err(Failure::Input(format!(
            "{}: it has no `runs`, and no log is given",
            path.display()
        )));
    }
    if !planned {
        loads.carried.clear();
        controlled.clear();
    } else if loads.carried.iter().any(Option::is_some) {
        if reading.payload.is_some() {
            let text = "the experiment file names the payload of each run: leave out --payload";
            return Err(Failure::Usage(text.to_owned()));
        }
    } else if !loads.payloads.is_empty() {
        // a run of the file without `payload` carries nothing
        reading.payload = reading.payload.or(Some(PayloadArg::None));
    }
    let runs = file.runs.iter().map(|run| run.placed(folder));
    let carried = runs.clone().zip(loads.carried).collect();
    let controlled = runs.zip(controlled).collect();
    if file.delay == Delay::Auto && reading.delay.is_empty() {
        reading.delay.push(DelayArg::Auto);
    }
    reading.experiment = Some(Box::new(Experiment {
        settings: file.settings,
        kind: file.kind,
        unknown_gains: file.unknown_gains,
        carried,
        payloads: loads.payloads,
        controlled,
    }));
    Ok(validation)
}

/// Refuses logs that do not exist, and an experiment without runs for identification.
pub(crate) fn require_logs(logs: &[Run]) -> Result<(), Failure> {
    let missing = logs.iter().find_map(Run::missing);
    missing.map_or_else(|| require_runs(logs), |text| Err(Failure::Io(text)))
}

/// Refuses an experiment without runs for identification.
pub(crate) fn require_runs(logs: &[Run]) -> Result<(), Failure> {
    if logs.is_empty() {
        let text = "all runs of the experiment file have `use: validate`: there is nothing to \
                    identify from";
        return Err(Failure::Input(text.to_owned()));
    }
    Ok(())
}

/// The path of a run that is an experiment file, which its extension shows.
pub(crate) fn yaml_path(run: &Run) -> Option<PathBuf> {
    let [path] = &run.files[..] else { return None };
    // the metadata of a ROS 2 bag
    if path.file_name()? == "metadata.yaml" {
        return None;
    }
    let extension = path.extension()?.to_str()?;
    ["yaml", "yml"].contains(&extension).then(|| path.clone())
}

fn read(
    path: &Path,
    spec: Option<&Source>,
    is_plain: bool,
) -> Result<(ExperimentFile, Loads, Vec<Controlled>), Failure> {
    let source = load::file(path)?;
    let mut bodies: Vec<String> = Vec::new();
    let (coordinates, actuated) = match spec {
        Some(spec) => {
            let mechanism = load::mechanism(spec)?;
            bodies.extend(mechanism.payloads().map(str::to_owned));
            let model = mechanism.model();
            let names = model.coordinates.iter().map(|c| c.name.clone());
            (names.collect(), model.actuated.clone())
        }
        None => match ExperimentFile::coordinates(&source.text) {
            Ok(names) => {
                let all = (0..names.len()).collect();
                (names, all)
            }
            Err(mistakes) => return Err(mistakes::failure(source, mistakes, OTHER_FILE)),
        },
    };
    let coordinates: Vec<&str> = coordinates.iter().map(String::as_str).collect();
    let info = Info {
        name: "the robot",
        coordinates: &coordinates,
        actuated: &actuated,
        ..Info::EMPTY
    };
    let file = ExperimentFile::read(&source.text, &info);
    let found = file.and_then(|file| {
        // only the robot's description says which bodies may be carried
        let loads = match spec {
            Some(_) => file.loads(&bodies)?,
            None => Loads {
                carried: vec![None; file.runs.len()],
                payloads: Vec::new(),
            },
        };
        if is_plain {
            file.require_plain()?;
        }
        // only the robot's description says which joints are actuated and need a controller
        let controlled = match spec {
            Some(_) => controlled(&file, &info)?,
            None => Vec::new(),
        };
        Ok((file, loads, controlled))
    });
    found.map_err(|mistakes| mistakes::failure(source, mistakes, OTHER_FILE))
}

/// The commands and controllers of all runs.
fn controlled(file: &ExperimentFile, info: &Info<'_>) -> Result<Vec<Controlled>, Mistakes> {
    let one = |(k, planned): (usize, &PlannedRun)| {
        let setup = match &planned.controller {
            Some(stated) => Some(
                controllers(stated, info)
                    .map_err(|wrong| file.controller_mistake(k, &wrong.place, wrong.why))?,
            ),
            None => None,
        };
        Ok(Controlled {
            commands: planned.commands.clone(),
            setup,
        })
    };
    file.runs.iter().enumerate().map(one).collect()
}
