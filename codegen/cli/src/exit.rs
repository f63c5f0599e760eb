//! The failures that end a run, and their exit codes.

use std::fmt;
use std::io;
use std::path::Path;

use regen_codegen::diag::Report;
use regen_runtime::{ClosureError, SizeError};

use crate::interrupt;

/// A failure that ended a run early.
#[derive(Debug)]
pub(crate) enum Failure {
    /// Generated source is not up to date, or an error exceeds its bound; the details are on
    /// standard output.
    Check(String),
    /// Arguments that contradict each other.
    Usage(String),
    /// Errors in specs.
    Spec(Vec<Report>),
    /// Other input that is wrong: states, names, logs.
    Input(String),
    /// A state that cannot be closed or is singular.
    Numeric(String),
    /// A file or stream that cannot be read or written.
    Io(String),
    /// Ctrl-C ended the work early; the text says which results were saved.
    Interrupted(String),
    /// The reader of standard output closed the pipe: the run ends without a message.
    BrokenPipe,
}

impl Failure {
    /// A failed operation on a file; `doing` is an infinitive, as in `cannot read x: ...`.
    pub(crate) fn io(doing: &str, path: &Path, error: &io::Error) -> Self {
        Self::Io(format!("cannot {doing} {}: {error}", path.display()))
    }

    /// The process's exit code, as documented in `--help`.
    pub(crate) fn code(&self) -> u8 {
        match self {
            Self::BrokenPipe => 0,
            Self::Check(_) => 1,
            Self::Usage(_) => 2,
            Self::Spec(_) | Self::Input(_) => 3,
            Self::Numeric(_) => 4,
            Self::Io(_) => 5,
            Self::Interrupted(_) => interrupt::INTERRUPTED,
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Check(text)
            | Self::Usage(text)
            | Self::Input(text)
            | Self::Numeric(text)
            | Self::Io(text)
            | Self::Interrupted(text) => f.write_str(text),
            Self::Spec(reports) => reports.iter().try_for_each(|report| write!(f, "{report}")),
            Self::BrokenPipe => Ok(()),
        }
    }
}

impl std::error::Error for Failure {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Spec(reports) => reports.first().map(|report| report as _),
            _ => None,
        }
    }
}

impl From<Report> for Failure {
    fn from(report: Report) -> Self {
        Self::Spec(vec![report])
    }
}

impl From<SizeError> for Failure {
    fn from(error: SizeError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<ClosureError> for Failure {
    fn from(error: ClosureError) -> Self {
        Self::Input(error.to_string())
    }
}
