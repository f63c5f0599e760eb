//! Errors of reading bags.

use core::error::Error;
use core::fmt;
use std::io;
use std::path::PathBuf;

use crate::log::Topic;

/// Why a recording cannot be read.
#[derive(Debug)]
#[non_exhaustive]
pub enum BagError {
    /// The file system refuses a file.
    Io {
        /// The file.
        file: PathBuf,
        /// The reason.
        source: io::Error,
    },
    /// The database of a bag cannot be read.
    Database {
        /// The file.
        file: PathBuf,
        /// Where in it, in words.
        place: String,
        /// The reason.
        source: Box<dyn Error + Send + Sync>,
    },
    /// A file or folder is no recording that is read here.
    NotABag {
        /// The file.
        file: PathBuf,
        /// What it is or lacks, and what to do.
        why: String,
    },
    /// An MCAP file ends before its end.
    Truncated {
        /// The file.
        file: PathBuf,
        /// Its length, bytes.
        length: u64,
        /// Where the record begins that is cut, bytes from the start of the file; the length where
        /// the file ends between two records.
        record: u64,
        /// What can be read before that.
        readable: Vec<Topic>,
    },
    /// A part of a file is not what the format says.
    Broken {
        /// The file.
        file: PathBuf,
        /// Where, in words.
        place: String,
        /// What is wrong.
        why: String,
    },
    /// A message cannot be decoded.
    Message {
        /// The file.
        file: PathBuf,
        /// Its topic.
        topic: String,
        /// Its number on the topic, from 1.
        number: u64,
        /// Where it is, in words.
        place: String,
        /// What is wrong.
        why: String,
    },
    /// The topic to read is not determined: none was named and several have joint states, or none
    /// has, or the recording lacks the one that was named.
    Topic {
        /// The file.
        file: PathBuf,
        /// What is wrong, and what to do.
        why: String,
        /// All topics of the recording.
        topics: Vec<Topic>,
    },
    /// The messages of a topic do not make a table.
    Joints {
        /// The file.
        file: PathBuf,
        /// The topic.
        topic: String,
        /// What is wrong.
        why: String,
    },
}

/// Most topics in a message.
const MAX_LISTED: usize = 20;

/// Topics with types and counts, one a line.
fn list(f: &mut fmt::Formatter<'_>, topics: &[Topic]) -> fmt::Result {
    for topic in topics.iter().take(MAX_LISTED) {
        write!(f, "\n  {topic}")?;
    }
    match topics.len().saturating_sub(MAX_LISTED) {
        0 => Ok(()),
        more => write!(f, "\n  and {more} more"),
    }
}

impl fmt::Display for BagError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Io { file, source } => write!(f, "{}: {source}", file.display()),
            Self::Database {
                file,
                place,
                source,
            } => write!(
                f,
                "{}: {place}: {source}; `sqlite3 {} .recover` writes what can still be read of a \
                 damaged database",
                file.display(),
                name(file)
            ),
            Self::NotABag { file, why } => write!(f, "{}: {why}", file.display()),
            Self::Truncated {
                file,
                length,
                record,
                readable,
            } => {
                write!(f, "{}: this MCAP file is cut off: ", file.display())?;
                if record == length {
                    write!(f, "it ends at byte {length} without the end of a recording")?;
                } else {
                    write!(
                        f,
                        "it ends at byte {length}, inside the record that begins at byte {record}"
                    )?;
                }
                if readable.iter().all(|topic| topic.messages == 0) {
                    return f.write_str("; no message is whole before that");
                }
                write!(
                    f,
                    ". `mcap recover {} --output recovered.mcap` keeps what is whole before that:",
                    name(file)
                )?;
                list(f, readable)
            }
            Self::Broken { file, place, why } => {
                write!(f, "{}: {place}: {why}", file.display())
            }
            Self::Message {
                file,
                topic,
                number,
                place,
                why,
            } => write!(
                f,
                "{}: message {number} on {topic}, {place}: {why}",
                file.display()
            ),
            Self::Topic { file, why, topics } => {
                write!(f, "{}: {why}", file.display())?;
                list(f, topics)
            }
            Self::Joints { file, topic, why } => {
                write!(f, "{}: {topic}: {why}", file.display())
            }
        }
    }
}

/// The name of a file without its folder.
fn name(file: &std::path::Path) -> String {
    let name = file.file_name().unwrap_or(file.as_os_str());
    name.display().to_string()
}

impl Error for BagError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::Io { source, .. } => Some(source),
            Self::Database { source, .. } => Some(&**source),
            _ => None,
        }
    }
}
