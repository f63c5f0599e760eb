//! Why nothing can be served.

use std::fmt;
use std::io;
use std::path::PathBuf;

/// Why [`Server::bind`](crate::Server::bind) failed.
#[derive(Debug)]
#[non_exhaustive]
pub enum ServeError {
    /// The port cannot be opened.
    Port {
        /// The port that was asked for; 0 for any.
        port: u16,
        /// The system's error.
        source: io::Error,
    },
    /// A file cannot be read.
    File {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A file is longer than the editor takes.
    Long {
        /// The file.
        path: PathBuf,
        /// The limit in bytes.
        limit: usize,
    },
    /// The system gives no random numbers, so that no token can be made.
    NoRandom,
}

impl fmt::Display for ServeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Port { port: 0, source } => write!(f, "no port can be opened: {source}"),
            Self::Port { port, source } => write!(f, "port {port} cannot be opened: {source}"),
            Self::File { path, source } => write!(f, "cannot read {}: {source}", path.display()),
            Self::Long { path, limit } => write!(
                f,
                "{} has more than {limit} bytes, the limit of the editor",
                path.display()
            ),
            Self::NoRandom => f.write_str("the system gives no random numbers for a token"),
        }
    }
}

impl std::error::Error for ServeError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Port { source, .. } | Self::File { source, .. } => Some(source),
            Self::Long { .. } | Self::NoRandom => None,
        }
    }
}
