//! `regen generate`: compares the generated files with what regen would write, and updates them.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use indicatif::ProgressBar;
use serde::Serialize;

use regen_codegen::robot::Robot;

use crate::args::{Format, GenerateArgs, TargetArg};
use crate::exit::Failure;
use crate::modules::Module;
use crate::sources::{self, Manifest};
use crate::workspace::{self, Workspace};
use crate::{c_files, load, modules, progress, table, terminal, write};

/// The state of a generated file, compared with what regen would write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum State {
    /// The file is up to date.
    Current,
    /// The file does not exist.
    Missing,
    /// The file exists with other text.
    Differs {
        /// The first line that differs, from 1.
        line: usize,
        /// That line as it is in the file; `None` where the file ends before it.
        found: Option<String>,
        /// That line as it should be; `None` where the file should end before it.
        expected: Option<String>,
    },
    /// The file belongs to a robot that is gone, or of which only a digest is stored.
    Stale,
}

/// One file of the output directory.
#[derive(Debug)]
pub(crate) struct Entry {
    pub(crate) path: PathBuf,
    pub(crate) state: State,
    /// The text that the file should have; `None` if it should not exist.
    text: Option<String>,
}

impl Entry {
    /// Writes the expected text, or removes a file that should not exist.
    pub(crate) fn write(&self) -> Result<(), Failure> {
        match (&self.state, &self.text) {
            (State::Current, _) => Ok(()),
            (_, Some(text)) => write::atomically(&self.path, text),
            (_, None) => fs::remove_file(&self.path)
                .map_err(|error| Failure::io("remove", &self.path, &error)),
        }
    }

    /// Reads the file again and compares it with the expected text.
    pub(crate) fn is_current(&self) -> Result<bool, Failure> {
        let found = read_if_there(&self.path)?;
        Ok(found.as_ref() == self.text.as_ref())
    }
}

/// Runs the command.
pub(crate) fn run(args: &GenerateArgs) -> Result<(), Failure> {
    let (files, dir, whole) = sources(args)?;
    let entries = match args.target {
        TargetArg::Rust => compare(derive(&files, modules::module)?, &dir, whole)?,
        TargetArg::C => c_files::compare(derive(&files, c_files::files)?, &dir, whole)?,
    };
    if !args.check {
        for entry in &entries {
            entry.write()?;
        }
    }
    terminal::print(&match args.format {
        Format::Human => to_text(&entries, args.check),
        Format::Json => json(&entries),
    })?;
    let wrong = entries.iter().filter(|e| e.state != State::Current).count();
    if args.check && wrong > 0 {
        return Err(Failure::Check(format!(
            "{wrong} of {} files are not what regen writes; update them with\n  {}",
            entries.len(),
            update_command(args)
        )));
    }
    Ok(())
}

/// The spec files, the output directory, and whether no other modules belong there.
fn sources(args: &GenerateArgs) -> Result<(Vec<PathBuf>, PathBuf, bool), Failure> {
    if let (false, Some(out)) = (args.files.is_empty(), &args.out) {
        return Ok((args.files.clone(), out.clone(), false));
    }
    if args.target == TargetArg::C {
        let robots = || Workspace::current()?.robots();
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
    if args.target == TargetArg::C {
        command.push_str(" --target c");
    }
    if let Some(out) = &args.out {
        let _ = write!(command, " --out {}", out.display());
    }
    command
}

/// Derives each robot and returns what `make` writes of it by the robot's name; errors of all files
/// are reported together.
fn derive<M>(
    files: &[PathBuf],
    make: impl Fn(&Robot, &Path) -> Result<M, Failure>,
) -> Result<BTreeMap<String, M>, Failure> {
    let bar = match files.len() {
        0 | 1 => ProgressBar::hidden(),
        many => progress::bar(many as u64, "{bar:24} {pos}/{len} {msg}"),
    };
    let mut modules = BTreeMap::new();
    let mut reports = Vec::new();
    for file in files {
        bar.set_message(file.display().to_string());
        match load::robot(file) {
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

/// Compares the files of the directory, and the digests next to it, with these modules. `whole`: no
/// other modules belong there.
pub(crate) fn compare(
    mut modules: BTreeMap<String, Module>,
    dir: &Path,
    whole: bool,
) -> Result<Vec<Entry>, Failure> {
    let mut entries = Vec::new();
    if let Some(manifest) = Manifest::of(dir)? {
        if whole {
            manifest.names_only(&modules)?;
        }
        let digests = manifest.take_others(&mut modules);
        let path = manifest.digests();
        let found = read_if_there(&path)?;
        let text = sources::digests(if whole { None } else { found.as_deref() }, digests);
        entries.push(Entry {
            state: state(found.as_deref(), &text),
            path,
            text: Some(text),
        });
    }
    let mut names: BTreeSet<String> = modules.keys().cloned().collect();
    for (name, Module { text, .. }) in modules {
        entries.push(entry(dir.join(format!("{name}.rs")), text)?);
    }
    if whole {
        entries.extend(stale(dir, &["rs"], &names)?);
    }
    entries.extend(list(dir, &mut names, whole)?);
    entries.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(entries)
}

/// The entry of a file that shall have this text.
///
/// # Errors
///
/// A file of that name that regen did not write.
pub(crate) fn entry(path: PathBuf, text: String) -> Result<Entry, Failure> {
    let found = read_if_there(&path)?;
    if let Some(found) = &found
        && !modules::generated(found)
    {
        return Err(Failure::Input(format!(
            "{} was not written by regen and is left alone; move it away, or name another \
             directory with --out",
            path.display()
        )));
    }
    Ok(Entry {
        state: state(found.as_deref(), &text),
        path,
        text: Some(text),
    })
}

/// Generated files with these extensions in the directory whose names are not among these.
pub(crate) fn stale(
    dir: &Path,
    extensions: &[&str],
    names: &BTreeSet<String>,
) -> Result<Vec<Entry>, Failure> {
    let mut found = Vec::new();
    let paths = match workspace::entries(dir) {
        Ok(paths) => paths,
        Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
        Err(error) => return Err(Failure::io("read", dir, &error)),
    };
    for path in paths {
        let extension = path.extension().and_then(|e| e.to_str());
        let ours = extension.is_some_and(|e| extensions.contains(&e)) && path.is_file();
        let expected = path
            .file_stem()
            .is_some_and(|stem| names.contains(stem.to_string_lossy().as_ref()));
        if ours && !expected && modules::generated(&load::text(&path)?) {
            found.push(Entry {
                path,
                state: State::Stale,
                text: None,
            });
        }
    }
    Ok(found)
}

/// The entry of the file that lists the directory's modules, if there is one.
fn list(dir: &Path, names: &mut BTreeSet<String>, whole: bool) -> Result<Option<Entry>, Failure> {
    for file in ["lib.rs", "mod.rs"] {
        let path = dir.join(file);
        let Some(found) = read_if_there(&path)? else {
            continue;
        };
        let Some(listed) = modules::listed(&found) else {
            continue;
        };
        if !whole {
            names.extend(listed);
        }
        let text = modules::relisted(&found, names).unwrap_or_else(|| found.clone());
        return Ok(Some(Entry {
            state: state(Some(&found), &text),
            path,
            text: Some(text),
        }));
    }
    Ok(None)
}

fn read_if_there(path: &Path) -> Result<Option<String>, Failure> {
    match fs::read(path) {
        // Text that is not UTF-8 never equals the expected text, so lossy conversion is enough.
        Ok(bytes) => Ok(Some(String::from_utf8_lossy(&bytes).into_owned())),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(Failure::io("read", path, &error)),
    }
}

fn state(found: Option<&str>, text: &str) -> State {
    let Some(found) = found else {
        return State::Missing;
    };
    if found == text {
        return State::Current;
    }
    // Split at '\n' alone, so that a missing last newline and a '\r' count as differences.
    let mut have = found.split('\n');
    let mut want = text.split('\n');
    let mut line = 1;
    loop {
        match (have.next(), want.next()) {
            (Some(a), Some(b)) if a == b => line += 1,
            (a, b) => {
                return State::Differs {
                    line,
                    found: a.map(str::to_owned),
                    expected: b.map(str::to_owned),
                };
            }
        }
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
