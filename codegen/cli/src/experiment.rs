//! Experiment files among the logs of a command: their runs take the place of logs, their settings
//! are those over which options win.

use std::path::{Path, PathBuf};

use regen_codegen::diag::Source;
use regen_identify::data::{Run, Settings};
use regen_identify::experiment_file::{Delay, ExperimentFile, Purpose};
use regen_identify::identify::EquationKind;
use regen_runtime::Info;

use crate::args::{DelayArg, ReadingArgs};
use crate::exit::Failure;
use crate::{load, mistakes};

/// What an experiment file says of reading logs.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Experiment {
    pub(crate) settings: Settings,
    pub(crate) kind: EquationKind,
}

/// The hint for a file that is no experiment.
const OTHER_FILE: &str = "an experiment file has the keys columns, process, runs and others; \
                          `regen schema experiment` describes them";

/// Replaces the experiment file among the logs by its runs to identify from, and sets the reading
/// options; returns its runs to validate on. Logs beside the file are read in place of all runs.
///
/// - `spec`: the robot's description.
pub(crate) fn resolve(
    logs: &mut Vec<Run>,
    reading: &mut ReadingArgs,
    spec: &Source,
) -> Result<Vec<Run>, Failure> {
    resolve_for(logs, reading, Some(spec))
}

/// As [`resolve`]; without a robot, its coordinates are those that the file names.
pub(crate) fn resolve_for(
    logs: &mut Vec<Run>,
    reading: &mut ReadingArgs,
    spec: Option<&Source>,
) -> Result<Vec<Run>, Failure> {
    let files = logs.iter().filter_map(experiment_path);
    let path = match &files.collect::<Vec<PathBuf>>()[..] {
        [] => {
            return match reading.folder {
                None => Ok(Vec::new()),
                Some(_) => Err(Failure::Usage(
                    "--logs says where the files of an experiment file are, and none is given"
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
    let file = read(&path, spec)?;
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
    logs.retain(|run| experiment_path(run).is_none());
    let validation = if logs.is_empty() {
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
    if file.delay == Delay::Auto && reading.delay.is_empty() {
        reading.delay.push(DelayArg::Auto);
    }
    reading.experiment = Some(Box::new(Experiment {
        settings: file.settings,
        kind: file.kind,
    }));
    Ok(validation)
}

/// Refuses an experiment of which no run is for identification.
pub(crate) fn require_runs(logs: &[Run]) -> Result<(), Failure> {
    if logs.is_empty() {
        let text = "all runs of the experiment file are `use: validate`: there is nothing to \
                    identify from";
        return Err(Failure::Input(text.to_owned()));
    }
    Ok(())
}

/// The path of a run that is an experiment file, by its extension.
fn experiment_path(run: &Run) -> Option<PathBuf> {
    let [path] = &run.files[..] else { return None };
    // that of a ROS 2 bag
    if path.file_name()? == "metadata.yaml" {
        return None;
    }
    let extension = path.extension()?.to_str()?;
    ["yaml", "yml"].contains(&extension).then(|| path.clone())
}

fn read(path: &Path, spec: Option<&Source>) -> Result<ExperimentFile, Failure> {
    let source = load::file(path)?;
    let (coordinates, actuated) = match spec {
        Some(spec) => {
            let mechanism = load::mechanism(spec)?;
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
    let file = file.and_then(|file| file.require_plain().map(|()| file));
    file.map_err(|mistakes| mistakes::failure(source, mistakes, OTHER_FILE))
}
