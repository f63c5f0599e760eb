//! Writes files atomically, so that a reader never finds half of one.

use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use crate::exit::Failure;
use crate::{call, interrupt};

/// The largest number of names tried for a temporary file: names may be taken by other runs.
const MAX_TRIES: u32 = 1000;
/// The number of characters of the file's name used in the temporary file's: names are 255 bytes
/// long at most.
const MAX_NAME_CHARS: usize = 50;

/// Replaces a file's content by renaming a temporary file next to it, so that at every moment the
/// file is the old one or the new one, also when several runs write it. A symbolic link is followed
/// and its target is replaced; a pipe, a device or anything else that is not a regular file is
/// written to directly.
pub(crate) fn atomically(path: &Path, text: &str) -> Result<(), Failure> {
    if call::store(path, text) {
        return Ok(());
    }
    replace(path, text).map_err(|error| Failure::io("write", path, &error))
}

/// Writes a file that does not exist yet, safely also where another run creates it at the same
/// moment.
///
/// # Errors
///
/// A file of this name exists; it is not changed, and the message ends with `remedy`.
pub(crate) fn create(path: &Path, text: &str, remedy: &str) -> Result<(), Failure> {
    if let Some(dir) = path.parent().filter(|dir| !dir.as_os_str().is_empty()) {
        fs::create_dir_all(dir).map_err(|error| Failure::io("create", dir, &error))?;
    }
    // An empty file reserves the name, and is then replaced as a whole.
    interrupt::creating(path, || File::create_new(path)).map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists => Failure::Io(format!(
            "{} exists already and is left as it is: {remedy}",
            path.display()
        )),
        _ => Failure::io("write", path, &error),
    })?;
    let written = atomically(path, text).inspect_err(|_| {
        // Remove the empty file made above; the first error is the one to report.
        let _ = fs::remove_file(path);
    });
    interrupt::finish(path);
    written
}

fn replace(path: &Path, text: &str) -> io::Result<()> {
    let before = fs::metadata(path).ok();
    if before.as_ref().is_some_and(|found| !found.is_file()) {
        let mut place = OpenOptions::new().write(true).open(path)?;
        place.write_all(text.as_bytes())?;
        return place.flush();
    }
    let behind = if before.is_some() {
        fs::canonicalize(path).ok()
    } else {
        // a link to a file that does not exist yet
        let target = fs::read_link(path).ok();
        target.map(|target| path.parent().unwrap_or(Path::new("")).join(target))
    };
    let path = behind.as_deref().unwrap_or(path);
    let dir = path.parent().unwrap_or(Path::new(""));
    if !dir.as_os_str().is_empty() {
        fs::create_dir_all(dir)?;
    }
    let (temporary, mut file) = temporary(dir, path)?;
    let written = file
        .write_all(text.as_bytes())
        .and_then(|()| match &before {
            Some(before) => file.set_permissions(before.permissions()),
            None => Ok(()),
        })
        .and_then(|()| file.sync_all())
        .and_then(|()| fs::rename(&temporary, path));
    if written.is_err() {
        // The first error is the one to report.
        let _ = fs::remove_file(&temporary);
    }
    interrupt::finish(&temporary);
    written
}

/// Creates a new temporary file. Names are tried in turn: a run that was killed may have left its
/// file, and a process on another machine may have the same process number.
fn temporary(dir: &Path, path: &Path) -> io::Result<(PathBuf, File)> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let name: String = name.chars().take(MAX_NAME_CHARS).collect();
    let mut number = 0;
    loop {
        let temporary = dir.join(format!(".{name}.{}.{number}.tmp", std::process::id()));
        match interrupt::creating(&temporary, || File::create_new(&temporary)) {
            Ok(file) => return Ok((temporary, file)),
            Err(error) if error.kind() == ErrorKind::AlreadyExists && number < MAX_TRIES => {
                number += 1;
            }
            Err(error) => return Err(error),
        }
    }
}
