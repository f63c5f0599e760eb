//! `regen generate`: compares the generated files with what regen would write, and updates them.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use indicatif::ProgressBar;
use regen_codegen::diag::counted;
use regen_codegen::robot::Robot;
use regen_sources::{
    Entry, SourceError, State, Workspace, c_files, casadi_files, compare_c, compare_modules, module,
};
use serde::Serialize;

use crate::args::{Format, GenerateArgs, TargetArg};
use crate::exit::Failure;
use crate::{load, progress, table, terminal, write};

/// Runs the command.
pub(crate) fn run(args: &GenerateArgs) -> Result<(), Failure> {
    let (files, dir, whole) = sources(args)?;
    let robot = |path: &Path| load::source_robot(path, false);
    let entries = match args.target {
        TargetArg::Rust => compare_modules(derive(&files, robot, module)?, &dir, whole)?,
        TargetArg::C => compare_c(derive(&files, robot, c_files)?, &dir, whole)?,
        TargetArg::Casadi => {
            // its Jacobians need the functions of controllers, whatever the description asks for
            let robot = |path: &Path| load::source_robot(path, true);
            compare_c(derive(&files, robot, casadi_files)?, &dir, whole)?
        }
    };
    if !args.check {
        for entry in &entries {
            put(entry)?;
        }
    }
    terminal::print(&match args.format {
        Format::Human => to_text(&entries, args.check),
        Format::Json => json(&entries),
    })?;
    let wrong = entries.iter().filter(|e| e.state != State::Current).count();
    if args.check && wrong > 0 {
        return Err(Failure::Check(format!(
            "{wrong} of {} {} not what regen writes; update with\n  {}",
            counted(entries.len(), "file", "files"),
            if wrong == 1 { "is" } else { "are" },
            update_command(args)
        )));
    }
    Ok(())
}

/// Writes the expected text of a file, or removes one that should not exist.
pub(crate) fn put(entry: &Entry) -> Result<(), Failure> {
    match (&entry.state, &entry.text) {
        (State::Current, _) => Ok(()),
        (_, Some(text)) => write::atomically(&entry.path, text),
        (_, None) => {
            fs::remove_file(&entry.path).map_err(|error| Failure::io("remove", &entry.path, &error))
        }
    }
}

/// The spec files, the output directory, and whether no other modules belong there.
fn sources(args: &GenerateArgs) -> Result<(Vec<PathBuf>, PathBuf, bool), Failure> {
    if let (false, Some(out)) = (args.files.is_empty(), &args.out) {
        return Ok((args.files.clone(), out.clone(), false));
    }
    if args.target != TargetArg::Rust {
        let robots = || Ok::<_, Failure>(Workspace::current()?.robots()?);
        return match (&args.out, args.files.is_empty()) {
            (Some(out), true) => Ok((robots()?, out.clone(), true)),
            (None, true) => Err(Failure::Usage(
                "name the directory of the C files of all robots with --out".to_owned(),
            )),
            (_, false) => Ok((args.files.clone(), PathBuf::from("."), false)),
        };
    }
    let workspace = Workspace::current()?;
    let dir = args.out.clone().unwrap_or_else(|| workspace.generated());
    if args.files.is_empty() {
        Ok((workspace.robots()?, dir, true))
    } else {
        Ok((args.files.clone(), dir, false))
    }
}

/// The command that would update the files that `--check` found out of date.
fn update_command(args: &GenerateArgs) -> String {
    let mut command = if args.files.is_empty() && args.out.is_none() {
        "cargo run --release --bin regen -- generate".to_owned()
    } else {
        "regen generate".to_owned()
    };
    for file in &args.files {
        let _ = write!(command, " {}", file.display());
    }
    command.push_str(match args.target {
        TargetArg::Rust => "",
        TargetArg::C => " --target c",
        TargetArg::Casadi => " --target casadi",
    });
    if let Some(out) = &args.out {
        let _ = write!(command, " --out {}", out.display());
    }
    command
}

/// Derives each robot by `load` and returns what `make` writes of it by the robot's name; errors of all files
/// are reported together.
fn derive<M>(
    files: &[PathBuf],
    load: impl Fn(&Path) -> Result<Robot, Failure>,
    make: impl Fn(&Robot, &Path) -> Result<M, SourceError>,
) -> Result<BTreeMap<String, M>, Failure> {
    let bar = match files.len() {
        0 | 1 => ProgressBar::hidden(),
        many => progress::bar(many as u64, "{bar:24} {pos}/{len} {msg}"),
    };
    let mut modules = BTreeMap::new();
    let mut reports = Vec::new();
    for file in files {
        bar.set_message(file.display().to_string());
        match load(file) {
            Ok(robot) => {
                let module = make(&robot, file)?;
                if modules.insert(robot.name.clone(), module).is_some() {
                    return Err(Failure::Input(format!(
                        "{}: another of these files has `name: {}` too; modules need names of \
                         their own",
                        file.display(),
                        robot.name
                    )));
                }
            }
            Err(Failure::Spec(more)) => reports.extend(more),
            Err(other) => return Err(other),
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    if reports.is_empty() {
        Ok(modules)
    } else {
        Err(Failure::Spec(reports))
    }
}

fn to_text(entries: &[Entry], check: bool) -> String {
    let mut out = String::new();
    for entry in entries {
        let path = entry.path.display();
        let _ = match (&entry.state, check) {
            (State::Current, _) => writeln!(out, "{path}: up to date"),
            (State::Missing | State::Differs { .. }, false) => {
                writeln!(out, "{path}: written")
            }
            (State::Stale, false) => {
                writeln!(out, "{path}: removed, no robot has a source of this name")
            }
            (State::Missing, true) => writeln!(out, "{path}: missing"),
            (State::Stale, true) => {
                writeln!(out, "{path}: stale, no robot has a source of this name")
            }
            (
                State::Differs {
                    line,
                    found,
                    expected,
                },
                true,
            ) => writeln!(
                out,
                "{path}: differs from line {line} on\n    is:        {}\n    should be: {}",
                excerpt(found.as_deref()),
                excerpt(expected.as_deref())
            ),
        };
    }
    out
}

/// A line cut to the table's width, with control characters escaped.
fn excerpt(line: Option<&str>) -> String {
    let Some(line) = line else {
        return "(the file ends)".to_owned();
    };
    let mut shown: String = line.trim_start().escape_debug().take(61).collect();
    if line.trim_start().escape_debug().count() > 61 {
        shown.push_str("...");
    }
    shown
}

/// The JSON of the files with their states before anything was written; absent fields are null.
fn json(entries: &[Entry]) -> String {
    #[derive(Serialize)]
    struct Row<'a> {
        file: String,
        state: &'static str,
        line: Option<usize>,
        found: Option<&'a str>,
        expected: Option<&'a str>,
    }
    let file = |entry: &Entry, state| Row {
        file: entry.path.display().to_string(),
        state,
        line: None,
        found: None,
        expected: None,
    };
    let files: Vec<Row<'_>> = entries
        .iter()
        .map(|entry| match &entry.state {
            State::Current => file(entry, "current"),
            State::Missing => file(entry, "missing"),
            State::Stale => file(entry, "stale"),
            State::Differs {
                line,
                found,
                expected,
            } => Row {
                line: Some(*line),
                found: found.as_deref(),
                expected: expected.as_deref(),
                ..file(entry, "differs")
            },
        })
        .collect();
    table::json(&files)
}

impl From<SourceError> for Failure {
    fn from(error: SourceError) -> Self {
        match error {
            SourceError::Io { .. } => Self::Io(error.to_string()),
            SourceError::Foreign(_) => Self::Input(format!(
                "{error}; move it away, or name another directory with --out"
            )),
            SourceError::NoWorkspace => Self::Input(format!(
                "{error}; name the FILES, and --out DIR where they are to be generated"
            )),
            other => Self::Input(other.to_string()),
        }
    }
}
