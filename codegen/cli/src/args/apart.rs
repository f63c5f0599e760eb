//! Keeps the files that a command writes apart from those that it reads, and from each other.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use clap::ArgMatches;

use crate::exit::Failure;

/// The arguments that name files which a command writes; all others are read.
const OUTPUTS: [&str; 8] = [
    "out", "report", "bodies", "rust", "c", "python", "predict", "figures",
];

/// Whether an argument of a command names a file that it writes.
fn is_output(command: &str, argument: &str) -> bool {
    OUTPUTS.contains(&argument)
        || [
            ("simulate", "controller"),
            ("simulate", "truth"),
            ("calibrate", "geometry"),
            ("calibrate", "simulate"),
        ]
        .contains(&(command, argument))
}

/// The files that a parsed command writes, by the arguments that name them.
///
/// # Errors
///
/// When two of them are one file, or one of them is read too, also by another path to it.
pub(super) fn outputs(parsed: &ArgMatches) -> Result<Vec<PathBuf>, Failure> {
    let (command, matches) = parsed.subcommand().unwrap_or(("", parsed));
    let (mut written, mut read) = (Vec::new(), Vec::new());
    // groups of options have names in capitals, and the names of options as values
    let is_group = |id: &str| id.starts_with(|c: char| c.is_ascii_uppercase());
    for id in matches.ids().filter(|id| !is_group(id.as_str())) {
        let Ok(Some(values)) = matches.try_get_raw(id.as_str()) else {
            continue;
        };
        let list = if is_output(command, id.as_str()) {
            &mut written
        } else {
            &mut read
        };
        list.extend(values.map(|value| (id.as_str().to_owned(), PathBuf::from(value))));
    }
    for (place, (name, path)) in written.iter().enumerate() {
        let own = resolved(path);
        let before = written.iter().take(place);
        if let Some((other, _)) = before
            .clone()
            .find(|(_, other)| is_same_file(own.as_deref(), other))
        {
            return Err(Failure::Usage(format!(
                "--{other} and --{name} would both write {}: give each a file of its own",
                path.display()
            )));
        }
        require_unread(path, read.iter().map(|(_, other)| other.as_path()))?;
    }
    Ok(written.into_iter().map(|(_, path)| path).collect())
}

/// Refuses a file to be written that is one of those that are read.
pub(crate) fn require_unread<'p>(
    output: &Path,
    mut read: impl Iterator<Item = &'p Path>,
) -> Result<(), Failure> {
    let own = resolved(output);
    match read.find(|other| other.is_file() && is_same_file(own.as_deref(), other)) {
        None => Ok(()),
        Some(_) => Err(Failure::Usage(format!(
            "{} would be read and overwritten: write to another file",
            output.display()
        ))),
    }
}

/// A path without links, relative parts and the present folder; `None` for what is no file, such as a
/// folder, a pipe or a device.
fn resolved(path: &Path) -> Option<PathBuf> {
    if path.exists() {
        return path.canonicalize().ok().filter(|_| path.is_file());
    }
    let folder = path.parent().filter(|p| *p != Path::new(""));
    let folder = folder.unwrap_or(Path::new("."));
    let name = path.file_name().unwrap_or(OsStr::new(""));
    // a link to a file that does not exist yet is followed
    if let Ok(target) = path.read_link() {
        return Some(folder.join(target));
    }
    let folder = folder.canonicalize().unwrap_or(folder.to_owned());
    Some(folder.join(name))
}

fn is_same_file(own: Option<&Path>, other: &Path) -> bool {
    own.is_some_and(|own| resolved(other).as_deref() == Some(own))
}
