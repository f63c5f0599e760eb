//! Reads the messages of a recording in the order in which they were recorded.

mod mcap_file;
mod sqlite;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::definition::short_name;
use crate::error::BagError;
use crate::folder::{self, Kind, Part};
use crate::known::Decoder;
use mcap_file::McapMessages;
use sqlite::SqliteMessages;

/// A topic with the type and encoding of its messages.
#[derive(Clone, Debug)]
pub(crate) struct Channel {
    pub(crate) topic: String,
    pub(crate) type_name: String,
    /// The decoder of its messages, or the reason why they cannot be decoded; `None` if their type
    /// is not one that is read.
    pub(crate) decoder: Option<Result<Decoder, String>>,
}

/// Whether two names are those of the same topic.
pub(crate) fn same_name(one: &str, other: &str) -> bool {
    one.trim_start_matches('/') == other.trim_start_matches('/')
}

impl Channel {
    /// - `definition`: the encoding and the text of the type's definition, if the recording has one;
    /// - `any`: the topic whose messages are read whatever their type is.
    fn new(
        topic: &str,
        type_name: &str,
        encoding: &str,
        definition: Option<(&str, &str)>,
        any: Option<&str>,
    ) -> Self {
        let stored = definition.filter(|(kind, text)| *kind == "ros2msg" && !text.is_empty());
        let stored = stored.map(|(_, text)| text);
        let mut decoder = Decoder::new(type_name, stored);
        if decoder.is_none() && any.is_some_and(|any| same_name(any, topic)) {
            decoder = Some(Decoder::of_fields(type_name, stored));
        }
        if decoder.is_some() && encoding != "cdr" {
            decoder = Some(Err(format!(
                "its messages are encoded as `{encoding}`, and only CDR is read"
            )));
        }
        Self {
            topic: topic.to_owned(),
            type_name: type_name.to_owned(),
            decoder,
        }
    }

    /// Whether the topic has this name; a leading slash makes no difference.
    pub(crate) fn is(&self, topic: &str) -> bool {
        same_name(&self.topic, topic)
    }

    /// Whether the channel has this topic and type.
    pub(crate) fn same(&self, topic: &str, type_name: &str) -> bool {
        self.topic == topic && short_name(&self.type_name) == short_name(type_name)
    }
}

/// The place of a message in its file, for errors.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Place {
    /// The byte of an MCAP file at which its record begins.
    Byte(u64),
    /// The number of a chunk from 1, the byte of the file at which it begins, and the byte of its
    /// decompressed records.
    Chunk(u64, u64, u64),
    /// The identifier of a row in the table of messages.
    Row(i64),
}

impl core::fmt::Display for Place {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Byte(byte) => write!(f, "at byte {byte}"),
            Self::Chunk(number, byte, inner) => write!(
                f,
                "in chunk {number} (at byte {byte}), byte {inner} of its records"
            ),
            Self::Row(row) => write!(f, "row {row} of the table `messages`"),
        }
    }
}

/// A message as it was recorded.
pub(crate) struct Recorded<'a> {
    /// The file that contains it.
    pub(crate) file: &'a Path,
    pub(crate) channel: &'a Channel,
    /// When it was received, ns.
    pub(crate) received: i64,
    pub(crate) data: &'a [u8],
    pub(crate) place: Place,
}

enum Storage {
    Mcap(Box<McapMessages>),
    Sqlite(SqliteMessages),
}

/// The messages of all files of a recording.
pub(crate) struct Messages {
    parts: std::vec::IntoIter<Part>,
    /// The topic that is read; `None` reads all topics with known types.
    topic: Option<String>,
    /// The topic whose messages are read whatever their type is.
    any: Option<String>,
    current: Option<Storage>,
    /// The current file.
    pub(crate) file: PathBuf,
    /// The names of what the files that were read have besides messages.
    pub(crate) beside: BTreeSet<String>,
}

impl Messages {
    /// Opens a recording, before its first message.
    ///
    /// - `topic`: the topic whose messages are wanted; [`Self::next`] may return others too;
    /// - `any`: the topic whose messages are read whatever their type is.
    pub(crate) fn open(
        path: &Path,
        topic: Option<&str>,
        any: Option<&str>,
    ) -> Result<Self, BagError> {
        let (parts, beside) = folder::parts(path)?;
        Ok(Self {
            parts: parts.into_iter(),
            topic: topic.map(str::to_owned),
            any: any.map(str::to_owned),
            current: None,
            file: path.to_path_buf(),
            beside,
        })
    }

    /// The next message; `None` after the last one.
    ///
    /// - `begun`: called for each topic of a database when the database is opened, with its number
    ///   of messages, and for each topic of an MCAP file when it ends, with 0, since the caller counts its messages.
    pub(crate) fn next(
        &mut self,
        begun: &mut dyn FnMut(&Channel, u64),
    ) -> Result<Option<Recorded<'_>>, BagError> {
        loop {
            let more = match &mut self.current {
                None => false,
                Some(Storage::Mcap(messages)) => messages.advance()?,
                Some(Storage::Sqlite(messages)) => messages.advance()?,
            };
            if more {
                break;
            }
            if let Some(Storage::Mcap(messages)) = &mut self.current {
                self.beside.append(&mut messages.beside);
                // those without a message too
                messages.channels().for_each(|channel| begun(channel, 0));
            }
            let Some(part) = self.parts.next() else {
                return Ok(None);
            };
            self.file.clone_from(&part.path);
            self.current = Some(match part.kind {
                Kind::Mcap => Storage::Mcap(Box::new(McapMessages::open(
                    &part.path,
                    self.any.as_deref(),
                )?)),
                Kind::Sqlite => {
                    let messages = SqliteMessages::open(
                        &part.path,
                        self.topic.as_deref(),
                        self.any.as_deref(),
                    )?;
                    for (channel, count) in messages.topics() {
                        begun(channel, count);
                    }
                    Storage::Sqlite(messages)
                }
            });
        }
        Ok(match &self.current {
            None => None,
            Some(Storage::Mcap(messages)) => messages.present(),
            Some(Storage::Sqlite(messages)) => messages.present(),
        })
    }
}
