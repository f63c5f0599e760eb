//! The files on the disk that the editor reads and saves.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::ServeError;

/// The largest file of the editor, in bytes: a description has at most 1 MiB.
pub(crate) const MAX_FILE: usize = 2 << 20;

/// How a text was saved.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Saved {
    Yes,
    /// Another program has changed the file since it was read: nothing was written.
    Changed,
    /// Why nothing was written.
    No(String),
}

/// A file, and the text that it had when this program last read or saved it.
#[derive(Debug)]
pub(crate) struct Edited {
    path: PathBuf,
    known: Mutex<String>,
}

impl Edited {
    /// Reads a file. A file that is not UTF-8 is an error: saving its text would change other bytes.
    pub(crate) fn open(path: &Path) -> Result<Self, ServeError> {
        let text = read(path).map_err(|source| ServeError::File {
            path: path.to_owned(),
            source,
        })?;
        if text.len() > MAX_FILE {
            return Err(ServeError::Long {
                path: path.to_owned(),
                limit: MAX_FILE,
            });
        }
        Ok(Self {
            path: path.to_owned(),
            known: Mutex::new(text),
        })
    }

    /// Its path as it was given.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Its text when it was last read or saved.
    pub(crate) fn text(&self) -> String {
        let known = self.known.lock();
        known.unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Writes a text by calling `write`, unless another program has changed the file since it was
    /// last read or saved; with `is_over`, overwrites such changes.
    pub(crate) fn save(
        &self,
        text: &str,
        is_over: bool,
        write: impl FnOnce(&Path, &str) -> Result<(), String>,
    ) -> Saved {
        if text.len() > MAX_FILE {
            return Saved::No(format!(
                "more than {MAX_FILE} bytes, the limit of the editor"
            ));
        }
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let has_changed = match read(&self.path) {
            Ok(now) => now != *known && now != text,
            // a file that cannot be read, such as one that was removed, has no changes to lose
            Err(error) => error.kind() == io::ErrorKind::InvalidData,
        };
        if has_changed && !is_over {
            return Saved::Changed;
        }
        match write(&self.path, text) {
            Ok(()) => {
                text.clone_into(&mut known);
                Saved::Yes
            }
            Err(why) => Saved::No(why),
        }
    }
}

/// Reads a file, up to one byte more than the limit, which may end inside a character.
fn read(path: &Path) -> io::Result<String> {
    let mut bytes = Vec::new();
    let file = File::open(path)?;
    file.take(MAX_FILE as u64 + 1).read_to_end(&mut bytes)?;
    if bytes.len() > MAX_FILE {
        return Ok(String::from_utf8_lossy(&bytes).into_owned());
    }
    String::from_utf8(bytes).map_err(|_| {
        io::Error::new(
            io::ErrorKind::InvalidData,
            "the file is not a text in UTF-8",
        )
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use std::fs;

    use super::*;

    fn plainly(path: &Path, text: &str) -> Result<(), String> {
        fs::write(path, text).map_err(|error| error.to_string())
    }

    #[test]
    fn what_another_program_wrote_is_not_lost() {
        let path = std::env::temp_dir().join(format!("regen-serve-files-{}", std::process::id()));
        fs::write(&path, "first").unwrap();
        let file = Edited::open(&path).unwrap();
        assert_eq!(file.save("second", false, plainly), Saved::Yes);
        fs::write(&path, "another's").unwrap();
        assert_eq!(file.save("third", false, plainly), Saved::Changed);
        assert_eq!(fs::read_to_string(&path).unwrap(), "another's");
        assert_eq!(file.save("third", true, plainly), Saved::Yes);
        assert_eq!(fs::read_to_string(&path).unwrap(), "third");
        fs::write(&path, b"\xff, of another encoding").unwrap();
        assert_eq!(file.save("fourth", false, plainly), Saved::Changed);
        assert!(Edited::open(&path).is_err());
        fs::write(&path, "third").unwrap();
        let long = "x".repeat(MAX_FILE + 1);
        assert!(matches!(file.save(&long, true, plainly), Saved::No(_)));
        fs::write(&path, long).unwrap();
        assert!(matches!(Edited::open(&path), Err(ServeError::Long { .. })));
        fs::remove_file(&path).unwrap();
        assert!(matches!(Edited::open(&path), Err(ServeError::File { .. })));
    }

    #[test]
    fn a_file_is_too_long_from_one_byte_more_than_the_limit_wherever_its_characters_end() {
        let path = std::env::temp_dir().join(format!("regen-serve-long-{}", std::process::id()));
        let long = "\u{e9}".repeat(MAX_FILE / 2);
        assert_eq!(long.len(), MAX_FILE);
        fs::write(&path, &long).unwrap();
        assert!(Edited::open(&path).is_ok());
        // the byte behind the limit is the first of two, or the last character is of one byte
        for more in ["\u{e9}", "e"] {
            fs::write(&path, long.clone() + more).unwrap();
            assert!(matches!(Edited::open(&path), Err(ServeError::Long { .. })));
        }
        fs::remove_file(&path).unwrap();
    }
}
