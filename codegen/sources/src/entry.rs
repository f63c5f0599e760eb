//! A generated file, compared with the text that it should have.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::error::SourceError;
use crate::module;
use crate::workspace;

/// The state of a generated file, compared with what regen would write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum State {
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
    /// The file belongs to a robot that no longer exists, or of which only a digest is stored.
    Stale,
}

/// One file of the output directory.
#[derive(Debug)]
pub struct Entry {
    /// The file.
    pub path: PathBuf,
    /// Its state.
    pub state: State,
    /// The text that the file should have; `None` if it should not exist.
    pub text: Option<String>,
}

impl Entry {
    /// Reads the file again and compares it with the expected text.
    ///
    /// # Errors
    ///
    /// A file that cannot be read.
    pub fn is_current(&self) -> Result<bool, SourceError> {
        let found = read_if_there(&self.path)?;
        Ok(found.as_ref() == self.text.as_ref())
    }
}

/// The entry of a file that should have this text.
///
/// # Errors
///
/// When regen did not write the file, or it cannot be read.
pub(crate) fn entry(path: PathBuf, text: String) -> Result<Entry, SourceError> {
    let found = read_if_there(&path)?;
    if let Some(found) = &found
        && !module::generated(found)
    {
        return Err(SourceError::Foreign(path));
    }
    Ok(Entry {
        state: state(found.as_deref(), &text),
        path,
        text: Some(text),
    })
}

/// The generated files in a directory that have one of these extensions and none of these names.
pub(crate) fn stale(
    dir: &Path,
    extensions: &[&str],
    names: &BTreeSet<String>,
) -> Result<Vec<Entry>, SourceError> {
    let mut found = Vec::new();
    let paths = match workspace::entries(dir) {
        Ok(paths) => paths,
        Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
        Err(error) => return Err(SourceError::io("read", dir, error)),
    };
    for path in paths {
        let extension = path.extension().and_then(|e| e.to_str());
        let ours = extension.is_some_and(|e| extensions.contains(&e)) && path.is_file();
        let expected = path
            .file_stem()
            .is_some_and(|stem| names.contains(stem.to_string_lossy().as_ref()));
        if ours && !expected && read_if_there(&path)?.is_some_and(|text| module::generated(&text)) {
            found.push(Entry {
                path,
                state: State::Stale,
                text: None,
            });
        }
    }
    Ok(found)
}

/// The text of a file; `None` if it does not exist.
pub(crate) fn read_if_there(path: &Path) -> Result<Option<String>, SourceError> {
    match fs::read(path) {
        // Text that is not UTF-8 never equals the expected text, so lossy conversion is enough.
        Ok(bytes) => Ok(Some(String::from_utf8_lossy(&bytes).into_owned())),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(SourceError::io("read", path, error)),
    }
}

/// Compares a file's text with the one that it should have.
pub(crate) fn state(found: Option<&str>, text: &str) -> State {
    let Some(found) = found else {
        return State::Missing;
    };
    if found == text {
        return State::Current;
    }
    // split at '\n' only, so that a missing last newline or a '\r' counts as a difference
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn only_generated_files_that_nothing_generates_any_more_are_stale() {
        let dir = std::env::temp_dir().join(format!("regen-stale-{}", std::process::id()));
        fs::create_dir_all(&dir).unwrap();
        let generated = format!("{}robots/a.yaml\n", module::BANNER);
        for (name, text) in [
            ("kept.rs", generated.as_str()),
            ("gone.rs", &generated),
            ("gone.c", &generated),
            ("gone.h", &generated),
            ("own.rs", "// written by hand\n"),
        ] {
            fs::write(dir.join(name), text).unwrap();
        }
        let found = stale(&dir, &["rs", "c"], &["kept".to_owned()].into());
        fs::remove_dir_all(&dir).unwrap();
        let found = found.unwrap();
        let names: Vec<_> = found.iter().filter_map(|e| e.path.file_name()).collect();
        assert_eq!(names, ["gone.c", "gone.rs"]);
        assert!(
            found
                .iter()
                .all(|e| e.state == State::Stale && e.text.is_none())
        );
        assert!(stale(&dir, &["rs"], &BTreeSet::new()).unwrap().is_empty());
    }
}
