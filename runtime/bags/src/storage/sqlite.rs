//! Reads the messages of a rosbag2 database, [`BATCH`] at a time.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use rusqlite::{Connection, ErrorCode, OpenFlags};

use super::{Channel, Place, Recorded};
use crate::compression;
use crate::error::BagError;

/// The number of messages that are read at a time.
const BATCH: usize = 256;
/// The longest message that is read, bytes: joint states are far shorter.
const MAX_MESSAGE: i64 = 1 << 22;
/// Steps of SQLite between two looks at their number.
const STEPS_AT_A_TIME: i32 = 10_000;
/// Turns of so many steps that any file may take.
const MIN_TURNS: u64 = 100;
/// The largest number of steps of a pass per byte of the file: a row has tens of bytes, and costs tens
/// of steps.
const MAX_STEPS_PER_BYTE: u64 = 20;

/// The messages of a file.
pub(super) struct SqliteMessages {
    path: PathBuf,
    database: Connection,
    /// The topics by their identifiers, with their numbers of messages.
    channels: BTreeMap<i64, (Channel, u64)>,
    /// The query for the next messages.
    query: String,
    /// The identifier of the last message read.
    last: i64,
    /// The next messages in reverse order: identifier, topic, time of receipt in ns, data.
    batch: Vec<(i64, i64, i64, Vec<u8>)>,
    present: Option<(i64, i64, i64, Vec<u8>)>,
    ended: bool,
}

/// The path as a URI that declares the file immutable, so that SQLite creates no lock or log files
/// next to it.
fn immutable(path: &Path) -> Option<String> {
    use core::fmt::Write;
    let full = std::path::absolute(path).ok()?;
    let mut out = String::from("file:");
    for byte in full.to_str()?.bytes() {
        if byte.is_ascii_alphanumeric() || b"/._-".contains(&byte) {
            out.push(char::from(byte));
        } else {
            write!(out, "%{byte:02x}").ok()?;
        }
    }
    out.push_str("?immutable=1");
    Some(out)
}

fn connect(path: &Path) -> rusqlite::Result<Connection> {
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    // an unfinished recording has its last messages in a write-ahead log, which SQLite must read too
    let mut log = path.as_os_str().to_owned();
    log.push("-wal");
    match immutable(path).filter(|_| !Path::new(&log).exists()) {
        Some(uri) => Connection::open_with_flags(uri, flags | OpenFlags::SQLITE_OPEN_URI),
        None => Connection::open_with_flags(path, flags),
    }
}

/// The size of a database by its header, if that is valid, and the size of the file, bytes.
fn lengths(path: &Path) -> std::io::Result<(Option<u64>, u64)> {
    let mut head = Vec::new();
    let file = File::open(path)?;
    let length = file.metadata()?.len();
    file.take(100).read_to_end(&mut head)?;
    let number = |at: usize| -> Option<u32> {
        let bytes = head.get(at..at + 4)?;
        Some(u32::from_be_bytes(bytes.try_into().ok()?))
    };
    let page = || {
        let bytes = head.get(16..18)?;
        match u16::from_be_bytes(bytes.try_into().ok()?) {
            1 => Some(1 << 16),
            size => Some(u64::from(size)),
        }
    };
    // the number of pages is valid only if the last writer updated it (SQLite file format,
    // "In-header database size")
    let pages = number(28).filter(|_| number(24) == number(92));
    Ok((
        pages.and_then(|pages| Some(u64::from(pages) * page()?)),
        length,
    ))
}

/// Ends queries that take more steps than a file of `length` bytes can need, such as those of pages that
/// lead to each other in a damaged one.
fn bound_steps(database: &mut Connection, length: u64) -> rusqlite::Result<()> {
    let most =
        length.saturating_mul(MAX_STEPS_PER_BYTE) / u64::from(STEPS_AT_A_TIME.unsigned_abs());
    let mut left = most.saturating_add(MIN_TURNS);
    database.progress_handler(
        STEPS_AT_A_TIME,
        Some(move || {
            left = left.saturating_sub(1);
            left == 0
        }),
    )
}

impl SqliteMessages {
    /// Opens a database.
    ///
    /// - `topic`: the topic that is read; `None` for all topics of known types;
    /// - `any`: the topic whose messages are read whatever their type is.
    pub(super) fn open(
        path: &Path,
        topic: Option<&str>,
        any: Option<&str>,
    ) -> Result<Self, BagError> {
        let (stated, length) = lengths(path).map_err(|source| BagError::Io {
            file: path.to_path_buf(),
            source,
        })?;
        if let Some(stated) = stated.filter(|stated| *stated > length) {
            return Err(BagError::Broken {
                file: path.to_path_buf(),
                place: format!("byte {length}"),
                why: format!(
                    "the database ends here and should have {stated} bytes: it was cut off; \
                     `sqlite3 {} .recover` writes what can still be read",
                    path.file_name().unwrap_or_default().display()
                ),
            });
        }
        let failed = |place: &str, error| failed(path, place, error);
        let mut database = connect(path).map_err(|e| failed("the database", e))?;
        bound_steps(&mut database, length).map_err(|e| failed("the database", e))?;
        if let Some(view) = view(&database).map_err(|e| failed("the list of tables", e))? {
            return Err(BagError::Broken {
                file: path.to_path_buf(),
                place: format!("`{view}`"),
                why: "this is a view, whose rows are computed and may have no end: a bag has a table here; \
                      `ros2 bag convert` writes a bag with tables"
                    .to_owned(),
            });
        }
        let definitions = definitions(&database);
        let topics = topics(&database).map_err(|e| failed("the table `topics`", e))?;
        let counts = counts(&database).map_err(|e| failed("the table `messages`", e))?;
        let channels: BTreeMap<i64, (Channel, u64)> = topics
            .into_iter()
            .map(|(id, name, kind, encoding)| {
                let definition = definitions.get(&kind);
                let definition = definition.map(|(way, text)| (way.as_str(), text.as_str()));
                let channel = Channel::new(&name, &kind, &encoding, definition, any);
                (id, (channel, counts.get(&id).copied().unwrap_or_default()))
            })
            .collect();
        let wanted = channels.iter().filter(|(_, (channel, _))| match topic {
            Some(topic) => channel.is(topic),
            None => channel.decoder.is_some(),
        });
        let wanted: Vec<String> = wanted.map(|(id, _)| id.to_string()).collect();
        let query = format!(
            "SELECT id, topic_id, timestamp, length(data), \
             CASE WHEN length(data) <= {MAX_MESSAGE} THEN CAST(data AS BLOB) END \
             FROM messages WHERE id > ?1 AND topic_id IN ({}) ORDER BY id LIMIT {BATCH}",
            wanted.join(",")
        );
        Ok(Self {
            path: path.to_path_buf(),
            database,
            ended: wanted.is_empty(),
            channels,
            query,
            last: i64::MIN,
            batch: Vec::new(),
            present: None,
        })
    }

    /// All topics with their numbers of messages.
    pub(super) fn topics(&self) -> impl Iterator<Item = (&Channel, u64)> {
        self.channels
            .values()
            .map(|(channel, count)| (channel, *count))
    }

    /// Moves to the next message; returns false after the last one.
    pub(super) fn advance(&mut self) -> Result<bool, BagError> {
        if self.batch.is_empty() && !self.ended {
            let last = self.last;
            let disordered = self.read().map_err(|error| {
                let place = match last {
                    i64::MIN => "the first messages".to_owned(),
                    id => format!("the messages behind row {id} of the table `messages`"),
                };
                failed(&self.path, &place, error)
            })?;
            if let Some(id) = disordered {
                return Err(BagError::Broken {
                    file: self.path.clone(),
                    place: Place::Row(id).to_string(),
                    why: format!(
                        "the rows of the table `messages` are out of order, so that some would be read \
                         again: the database is damaged; `sqlite3 {} .recover` writes what can still be \
                         read",
                        self.path.file_name().unwrap_or_default().display()
                    ),
                });
            }
        }
        self.present = self.batch.pop();
        if let Some((id, _, _, data)) = &mut self.present {
            let wrong = |why: String| BagError::Broken {
                file: self.path.clone(),
                place: Place::Row(*id).to_string(),
                why,
            };
            if data.len() as u64 > MAX_MESSAGE.unsigned_abs() {
                return Err(wrong("a message of joints with more than 4 MiB".to_owned()));
            }
            if compression::is_zstd(data) {
                let limit = MAX_MESSAGE.unsigned_abs();
                *data = compression::zstd(data, limit).map_err(wrong)?;
            }
        }
        Ok(self.present.is_some())
    }

    /// Reads the next messages. Returns the number of a row that is not behind the one before it, as in
    /// damaged databases: the next query, for rows behind the last one, would begin with old rows.
    fn read(&mut self) -> rusqlite::Result<Option<i64>> {
        let mut statement = self.database.prepare(&self.query)?;
        let mut rows = statement.query([self.last])?;
        while let Some(row) = rows.next()? {
            let data: Option<Vec<u8>> = row.get(4)?;
            let length: Option<i64> = row.get(3)?;
            // zeros of that length stand in for the message, which `advance` then refuses
            let too_long = length.is_some_and(|length| length > MAX_MESSAGE);
            let data = match data {
                None if too_long => vec![0; MAX_MESSAGE as usize + 1],
                data => data.unwrap_or_default(),
            };
            let id = row.get(0)?;
            if id <= self.last {
                return Ok(Some(id));
            }
            self.last = id;
            self.batch.push((self.last, row.get(1)?, row.get(2)?, data));
            if too_long {
                break;
            }
        }
        self.ended = self.batch.is_empty();
        self.batch.reverse();
        Ok(None)
    }

    /// The current message.
    pub(super) fn present(&self) -> Option<Recorded<'_>> {
        let (id, topic, received, data) = self.present.as_ref()?;
        let (channel, _) = self.channels.get(topic)?;
        Some(Recorded {
            file: &self.path,
            channel,
            received: *received,
            data,
            place: Place::Row(*id),
        })
    }
}

/// The error of a database that cannot be read at a place.
fn failed(path: &Path, place: &str, error: rusqlite::Error) -> BagError {
    let (file, place) = (path.to_path_buf(), place.to_owned());
    if error.sqlite_error_code() == Some(ErrorCode::OperationInterrupted) {
        return BagError::Broken {
            why: format!(
                "reading goes on for longer than a file of this size can need: the database is damaged; \
                 `sqlite3 {} .recover` writes what can still be read",
                path.file_name().unwrap_or_default().display()
            ),
            file,
            place,
        };
    }
    let source = Box::new(error);
    BagError::Database {
        file,
        place,
        source,
    }
}

/// The name of a view where a bag has a table.
fn view(database: &Connection) -> rusqlite::Result<Option<String>> {
    let query = "SELECT name FROM sqlite_schema WHERE type = 'view' \
                 AND lower(name) IN ('topics', 'messages', 'message_definitions')";
    let mut statement = database.prepare(query)?;
    let mut names = statement.query_map([], |row| row.get(0))?;
    names.next().transpose()
}

type Topic = (i64, String, String, String);

fn topics(database: &Connection) -> rusqlite::Result<Vec<Topic>> {
    let query = "SELECT id, name, type, serialization_format FROM topics ORDER BY id";
    let mut statement = database.prepare(query)?;
    let rows = statement.query_map([], |row| {
        Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?))
    })?;
    rows.collect()
}

fn counts(database: &Connection) -> rusqlite::Result<BTreeMap<i64, u64>> {
    let query = "SELECT topic_id, COUNT(*) FROM messages GROUP BY topic_id";
    let mut statement = database.prepare(query)?;
    let rows = statement.query_map([], |row| {
        Ok((row.get(0)?, row.get::<_, i64>(1)?.unsigned_abs()))
    })?;
    rows.collect()
}

/// The encoding and the definition of each message type; empty for databases of early versions.
fn definitions(database: &Connection) -> BTreeMap<String, (String, String)> {
    let query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions";
    let read = || -> rusqlite::Result<_> {
        let mut statement = database.prepare(query)?;
        let rows = statement.query_map([], |row| Ok((row.get(0)?, (row.get(1)?, row.get(2)?))))?;
        rows.collect()
    };
    read().unwrap_or_default()
}
