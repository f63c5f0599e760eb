//! `regen verify`: checks the identities of a robot and compares its base parameters with the
//! numeric path; with `--all`, runs the independent checks of any number of robots.

use std::path::{Path, PathBuf};

use indicatif::ProgressBar;
use regen_codegen::robot::Robot;
use regen_sources::{Workspace, is_up_to_date};
use regen_verify::print::{self, OfFile};
use regen_verify::{Check, Report, Statement, Vectors, VerifyError};

use crate::args::{VerifyArgs, VerifyFormat};
use crate::exit::Failure;
use crate::{closed, load, progress, terminal};

/// The check that the source on disk equals what the emitter writes now.
const SAME_SOURCE: Statement = Statement::identity("source on disk is what was emitted");

/// Runs the command.
pub(crate) fn run(args: &VerifyArgs) -> Result<(), Failure> {
    if args.all {
        return run_all(args);
    }
    let [file] = args.files.as_slice() else {
        return Err(Failure::Usage(
            "several specs are verified with --all".to_owned(),
        ));
    };
    let source = load::source(file)?;
    // sources on disk have the functions that the description asks for, and all are verified
    let robot = load::with_base_and_control(&source)?;
    let same = is_up_to_date(&load::source_robot(file, false)?, file)?;
    let report = checked(&robot, same)?;
    let numeric = regen_verify::numeric_path(&robot, args.states)?;
    terminal::print(&match args.format {
        VerifyFormat::Markdown => {
            // refused before, as an option without effect
            return Err(Failure::Usage("--format markdown needs --all".to_owned()));
        }
        VerifyFormat::Human => print::one_text(&report, &numeric, robot.analysis.as_ref()),
        VerifyFormat::Json => print::one_json(&report, &numeric),
    })?;
    let failed: Vec<&str> = report.failed().chain(numeric.report.failed()).collect();
    if failed.is_empty() {
        Ok(())
    } else {
        Err(not_verified(&robot.name, &failed))
    }
}

/// Checks a robot's identities; `same` is the result of the check of its source on disk, if there is
/// one.
pub(crate) fn checked(robot: &Robot, same: Option<bool>) -> Result<Report, Failure> {
    let mut report = regen_verify::identities(robot)?;
    let source = same.map(|same| Check::truth(SAME_SOURCE, same));
    report.checks.extend(source);
    Ok(report)
}

/// The failure that names the statements that were found false.
pub(crate) fn not_verified(robot: &str, failed: &[&str]) -> Failure {
    Failure::Check(format!("{robot} is not verified: {}", failed.join("; ")))
}

fn run_all(args: &VerifyArgs) -> Result<(), Failure> {
    let files = files(&args.files)?;
    let progress = match files.len() {
        0 | 1 => ProgressBar::hidden(),
        many => progress::bar(many as u64, "{bar:24} {pos}/{len} {msg}"),
    };
    let mut all = Vec::new();
    for file in &files {
        progress.set_message(file.display().to_string());
        all.push(independent(file)?);
        progress.inc(1);
    }
    progress.finish_and_clear();
    terminal::print(&match args.format {
        VerifyFormat::Human => print::several_text(&all),
        VerifyFormat::Markdown => print::several_markdown(&all),
        VerifyFormat::Json => print::several_json(&all),
    })?;
    let failed: Vec<String> = all
        .iter()
        .map(|one| &one.report)
        .flat_map(|r| r.failed().map(|check| format!("{}: {check}", r.robot)))
        .collect();
    if failed.is_empty() {
        Ok(())
    } else {
        Err(Failure::Check(format!(
            "not verified: {}",
            failed.join("; ")
        )))
    }
}

/// The spec files to verify: the given ones and those in given directories or, without arguments, all
/// of the workspace.
fn files(named: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    if named.is_empty() {
        return Ok(Workspace::current()?.robots()?);
    }
    let mut files = Vec::new();
    for path in named {
        if !path.is_dir() {
            files.push(path.clone());
            continue;
        }
        let mut inside =
            regen_sources::entries(path).map_err(|error| Failure::io("read", path, &error))?;
        let is_yaml = |p: &Path| p.extension().is_some_and(|e| e == "yaml") && p.is_file();
        inside.retain(|p| is_yaml(p) && !is_experiment(p));
        if inside.is_empty() {
            return Err(Failure::Input(format!("no *.yaml in {}", path.display())));
        }
        files.extend(inside);
    }
    Ok(files)
}

/// Whether a file has runs and no robot, as experiment files have that stand beside their specs.
fn is_experiment(file: &Path) -> bool {
    let is = |text: String| load::has_key(&text, "runs") && !load::has_key(&text, "limbs");
    load::text(file).is_ok_and(is)
}

fn independent(file: &Path) -> Result<OfFile, Failure> {
    let source = load::source(file)?;
    let robot = load::with_base_and_control(&source)?;
    let vectors = vectors(file)?;
    let report = regen_verify::independent(&robot, &source.text, vectors.as_ref());
    Ok(OfFile {
        file: file.display().to_string(),
        report: report.map_err(|error| match error {
            VerifyError::UnreadableSpec(_) => {
                Failure::Check(format!("{}: {error}", file.display()))
            }
            error => Failure::from(error),
        })?,
    })
}

/// The folders in which test vectors of a spec are looked for, relative to the spec's folder: next to
/// it, or among the fixtures of the workspace that contains it.
const FOLDERS: [&str; 2] = ["vectors", "../tests/fixtures/vectors"];

/// Reads the vectors computed by another program for a spec, from a file `vectors/NAME.json`;
/// `None` where there is no such file.
fn vectors(spec: &Path) -> Result<Option<Vectors>, Failure> {
    let Some(stem) = spec.file_stem() else {
        return Ok(None);
    };
    let mut files = FOLDERS.iter().map(|folder| {
        let mut file = spec.with_file_name(folder).join(stem);
        file.as_mut_os_string().push(".json");
        file
    });
    let Some(file) = files.find(|file| file.is_file()) else {
        return Ok(None);
    };
    Vectors::parse(&load::text(&file)?)
        .map(Some)
        .map_err(|error| {
            Failure::Input(format!(
                "{}: {error}; tests/tools/vectors/forces.py writes such files",
                file.display()
            ))
        })
}

impl From<VerifyError> for Failure {
    fn from(error: VerifyError) -> Self {
        match error {
            VerifyError::Size(error) => error.into(),
            VerifyError::LoopClosure(error) => error.into(),
            VerifyError::NotClosed { robot, outcome } => Self::Numeric(format!(
                "{robot}: no closed state was found near home: {}",
                closed::reason(outcome)
            )),
            VerifyError::TooFewStates {
                ref robot,
                states,
                rows,
                columns,
                least,
            } => Self::Input(format!(
                "{states} states give {rows} rows, fewer than the {columns} columns of {robot}: \
                 name at least --states {least}"
            )),
            VerifyError::NotFinite { .. }
            | VerifyError::NoSingularValues { .. }
            | VerifyError::ReferenceFailed(_) => Self::Numeric(error.to_string()),
            VerifyError::Vectors(_) => Self::Input(error.to_string()),
            _ => Self::Check(error.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn source_that_was_not_written_fails() {
        let robot = load::robot(Path::new("../../robots/fourbar.yaml")).unwrap();
        let report = checked(&robot, Some(false)).unwrap();
        let failed: Vec<_> = report.failed().collect();
        assert_eq!(failed, ["source on disk is what was emitted"]);
        assert_eq!(checked(&robot, Some(true)).unwrap().failed().count(), 0);
    }
}
