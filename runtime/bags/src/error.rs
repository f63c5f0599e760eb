//! Errors of reading bags.

use core::error::Error;
use core::fmt;
use std::io;
use std::path::{Path, PathBuf};

use crate::log::Topic;

/// The reason why a recording cannot be read.
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
        /// The place in it, in words.
        place: String,
        /// The reason.
        source: Box<dyn Error + Send + Sync>,
    },
    /// A file or folder is not a recording in a supported format.
    NotABag {
        /// The file.
        file: PathBuf,
        /// The reason and the remedy, in words.
        why: String,
    },
    /// An MCAP file is cut off: it lacks the record that ends every recording.
    Truncated {
        /// The file.
        file: PathBuf,
        /// Its length, bytes.
        length: u64,
        /// The offset of the incomplete record, bytes from the start of the file; the length if the
        /// file ends between two records.
        record: u64,
        /// The topics, with the messages that can be read before that.
        readable: Vec<Topic>,
    },
    /// A part of a file violates its format.
    Broken {
        /// The file.
        file: PathBuf,
        /// The place in the file, in words.
        place: String,
        /// The reason, in words.
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
        /// The place in the file, in words.
        place: String,
        /// The reason, in words.
        why: String,
    },
    /// The topic to read is not determined: none was named and several have joint states, or none
    /// has, or the recording lacks the one that was named.
    Topic {
        /// The file.
        file: PathBuf,
        /// The reason and the remedy, in words.
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
        /// The reason, in words.
        why: String,
    },
}

/// The largest number of topics that an error message lists.
const MAX_LISTED: usize = 20;

/// The topics with their types and numbers of messages, one per line.
fn list(topics: &[Topic]) -> String {
    let shown = topics.iter().take(MAX_LISTED);
    let mut lines: Vec<String> = shown.map(|topic| format!("\n  {topic}")).collect();
    let more = topics.len().saturating_sub(MAX_LISTED);
    if more > 0 {
        lines.push(format!("\n  and {more} more"));
    }
    lines.concat()
}

impl BagError {
    /// The file or folder that cannot be read.
    pub fn file(&self) -> &Path {
        match self {
            Self::Io { file, .. }
            | Self::Database { file, .. }
            | Self::NotABag { file, .. }
            | Self::Truncated { file, .. }
            | Self::Broken { file, .. }
            | Self::Message { file, .. }
            | Self::Topic { file, .. }
            | Self::Joints { file, .. } => file,
        }
    }

    /// The reason and the remedy, without the file's path.
    ///
    /// ```
    /// let error = regen_bags::topics("missing.mcap".as_ref()).unwrap_err();
    /// assert_eq!(error.to_string(), format!("missing.mcap: {}", error.reason()));
    /// ```
    pub fn reason(&self) -> String {
        match self {
            Self::Io { source, .. } => source.to_string(),
            Self::Database {
                file,
                place,
                source,
            } => format!(
                "{place}: {source}; `sqlite3 {} .recover` writes what can still be read of a \
                 damaged database",
                name(file)
            ),
            Self::NotABag { why, .. } => why.clone(),
            Self::Truncated {
                file,
                length,
                record,
                readable,
            } => {
                let place = if record == length {
                    "without the end of a recording".to_owned()
                } else {
                    format!("inside the record that begins at byte {record}")
                };
                let rest = if readable.iter().all(|topic| topic.messages == 0) {
                    "; no message is whole before that".to_owned()
                } else {
                    format!(
                        "; `mcap recover {} --output recovered.mcap` keeps what is whole before \
                         that:{}",
                        name(file),
                        list(readable)
                    )
                };
                format!("this MCAP file is cut off: it ends at byte {length}, {place}{rest}")
            }
            Self::Broken { place, why, .. } => format!("{place}: {why}"),
            Self::Message {
                topic,
                number,
                place,
                why,
                ..
            } => format!("message {number} on {topic}, {place}: {why}"),
            Self::Topic { why, topics, .. } => format!("{why}{}", list(topics)),
            Self::Joints { topic, why, .. } => format!("{topic}: {why}"),
        }
    }
}

impl fmt::Display for BagError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.file().display(), self.reason())
    }
}

/// The name of a file without its folder.
fn name(file: &Path) -> String {
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
