//! Errors in a directory of generated sources.

use std::error::Error;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// Files or names that keep generated sources from being compared.
#[derive(Debug)]
#[non_exhaustive]
pub enum SourceError {
    /// A file or directory that cannot be read or removed.
    Io {
        /// The attempted operation, as an infinitive.
        doing: &'static str,
        /// The file or directory.
        path: PathBuf,
        /// The reason of the failure.
        source: io::Error,
    },
    /// A robot whose module would have the name of one of the crate's own files.
    ModuleName {
        /// The robot's description.
        spec: PathBuf,
        /// Its name.
        robot: String,
    },
    /// A robot whose C header would have the name of one of the C library's.
    HeaderName {
        /// The robot's description.
        spec: PathBuf,
        /// Its name.
        robot: String,
    },
    /// A robot with adjustable geometry, which functions for `CasADi` do not take.
    Adjustable {
        /// The robot's description.
        spec: PathBuf,
    },
    /// Two robots whose C functions would have the same name.
    SameSymbol {
        /// One robot.
        first: String,
        /// The other one.
        second: String,
        /// The name that both would have.
        symbol: String,
    },
    /// A file with the name of a generated one that regen did not write.
    Foreign(PathBuf),
    /// The list of whole sources names a robot that does not exist.
    UnknownRobot {
        /// The list.
        file: PathBuf,
        /// The name in it.
        robot: String,
    },
    /// No directory from the current one upward has robots and generated sources.
    NoWorkspace,
    /// A directory without descriptions of robots.
    NoRobots(PathBuf),
}

impl SourceError {
    pub(crate) fn io(doing: &'static str, path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        Self::Io {
            doing,
            path,
            source,
        }
    }
}

impl fmt::Display for SourceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Io {
                doing,
                path,
                source,
            } => write!(f, "cannot {doing} {}: {source}", path.display()),
            Self::ModuleName { spec, robot } => write!(
                f,
                "{}: a robot named `{robot}` cannot have a module file of that name",
                spec.display()
            ),
            Self::HeaderName { spec, robot } => write!(
                f,
                "{}: a robot named `{robot}` cannot have a header of that name, which is one of \
                 the C library's",
                spec.display()
            ),
            Self::Adjustable { spec } => write!(
                f,
                "{}: functions for CasADi take no geometry; leave out `adjustable` for them",
                spec.display()
            ),
            Self::SameSymbol {
                first,
                second,
                symbol,
            } => write!(
                f,
                "the robots `{first}` and `{second}` would both have a `{symbol}` in C; give one \
                 of them another name"
            ),
            Self::Foreign(path) => write!(
                f,
                "{} was not written by regen and is left alone",
                path.display()
            ),
            Self::UnknownRobot { file, robot } => {
                write!(f, "{}: no robot is named `{robot}`", file.display())
            }
            Self::NoWorkspace => {
                f.write_str("no directory from here upward holds both robots/ and generated/src/")
            }
            Self::NoRobots(dir) => write!(f, "no *.yaml in {}", dir.display()),
        }
    }
}

impl Error for SourceError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::Io { source, .. } => Some(source),
            _ => None,
        }
    }
}
