//! Errors of reading files of arrays.

use core::error::Error;
use core::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// The reason why a file or an array cannot be read.
#[derive(Debug)]
pub struct ArrayError {
    file: PathBuf,
    why: Why,
}

/// The reason, before the file is known.
#[derive(Debug)]
pub(crate) enum Why {
    /// The file system refuses it.
    Io(io::Error),
    /// The file violates its format, in words.
    Broken(String),
    /// The file is sound, and what is asked for is not read; a sentence with the remedy.
    Refused(String),
}

/// What is read, or why not.
pub(crate) type Read<T> = Result<T, Why>;

impl From<io::Error> for Why {
    fn from(error: io::Error) -> Self {
        // decompression reports damage and an early end by these
        match error.kind() {
            io::ErrorKind::InvalidData | io::ErrorKind::InvalidInput => {
                Self::Broken(format!("its compressed data is damaged ({error})"))
            }
            io::ErrorKind::UnexpectedEof => Self::Broken("its data ends early".to_owned()),
            _ => Self::Io(error),
        }
    }
}

/// The error of a violated format.
pub(crate) fn broken<T>(why: impl Into<String>) -> Read<T> {
    Err(Why::Broken(why.into()))
}

/// The error of sound content that is not read.
pub(crate) fn refused<T>(why: impl Into<String>) -> Read<T> {
    Err(Why::Refused(why.into()))
}

impl ArrayError {
    pub(crate) fn new(file: &Path, why: Why) -> Self {
        Self {
            file: file.to_path_buf(),
            why,
        }
    }

    /// The file that cannot be read.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Whether the file is sound, and its content is none that is read.
    pub fn is_refused(&self) -> bool {
        matches!(self.why, Why::Refused(_))
    }

    /// The reason and the remedy, without the file's path.
    pub fn reason(&self) -> String {
        match &self.why {
            Why::Io(error) => error.to_string(),
            Why::Broken(why) => format!("this file is broken: {why}"),
            Why::Refused(why) => why.clone(),
        }
    }
}

impl fmt::Display for ArrayError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.file.display(), self.reason())
    }
}

impl Error for ArrayError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match &self.why {
            Why::Io(error) => Some(error),
            _ => None,
        }
    }
}
