//! Messages of an MCAP file, a chunk at a time.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{BufReader, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};

use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{McapError, parse_record};

use super::{Channel, Place, Recorded};
use crate::compression;
use crate::error::BagError;

/// Bytes of a record's head: what it is, and its length.
const HEAD: usize = 9;

/// The messages of a file.
pub(super) struct McapMessages {
    path: PathBuf,
    file: BufReader<File>,
    reader: LinearReader,
    length: u64,
    /// The byte of the file at which the next record begins.
    next_record: u64,
    schemas: BTreeMap<u16, (String, String, String)>,
    channels: BTreeMap<u16, Channel>,
    /// The topic whose messages are read whatever their type is.
    any: Option<String>,
    /// The records of the present chunk, or a record outside of chunks, and the next one in them.
    records: Vec<u8>,
    at: usize,
    /// The byte at which the present chunk or record begins.
    begins: u64,
    /// The number of the present chunk; `None` outside of chunks.
    chunk: Option<u64>,
    chunks: u64,
    present: Option<Present>,
    /// The names of attachments and of records of metadata so far.
    pub(super) beside: BTreeSet<String>,
}

struct Present {
    channel: u16,
    received: i64,
    data: Range<usize>,
    place: Place,
}

impl McapMessages {
    pub(super) fn open(path: &Path, any: Option<&str>) -> Result<Self, BagError> {
        let io = |source| BagError::Io {
            file: path.to_path_buf(),
            source,
        };
        let file = File::open(path).map_err(io)?;
        let length = file.metadata().map_err(io)?.len();
        let limit = usize::try_from(length).unwrap_or(usize::MAX);
        let options = LinearReaderOptions::default()
            .with_emit_chunks(true)
            .with_validate_data_section_crc(true)
            .with_record_length_limit(limit);
        Ok(Self {
            path: path.to_path_buf(),
            file: BufReader::new(file),
            reader: LinearReader::new_with_options(options),
            length,
            next_record: mcap::MAGIC.len() as u64,
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            any: any.map(str::to_owned),
            records: Vec::new(),
            at: 0,
            begins: 0,
            chunk: None,
            chunks: 0,
            present: None,
            beside: BTreeSet::new(),
        })
    }

    /// Goes on to the next message; false behind the last one.
    pub(super) fn advance(&mut self) -> Result<bool, BagError> {
        loop {
            while self.at < self.records.len() {
                if self.record()? {
                    return Ok(true);
                }
            }
            if !self.load()? {
                return Ok(false);
            }
        }
    }

    /// The channels of which a record was read.
    pub(super) fn channels(&self) -> impl Iterator<Item = &Channel> {
        self.channels.values()
    }

    /// The present message.
    pub(super) fn present(&self) -> Option<Recorded<'_>> {
        let present = self.present.as_ref()?;
        Some(Recorded {
            file: &self.path,
            channel: self.channels.get(&present.channel)?,
            received: present.received,
            data: self.records.get(present.data.clone())?,
            place: present.place,
        })
    }

    /// Loads the next chunk, or the next record outside of chunks; false at the end of the file.
    fn load(&mut self) -> Result<bool, BagError> {
        loop {
            let event = match self.reader.next_event() {
                None => return Ok(false),
                Some(Ok(event)) => event,
                Some(Err(error)) => return Err(self.failed(&error)),
            };
            match event {
                LinearReadEvent::ReadRequest(need) => {
                    let space = self.reader.insert(need);
                    let read = self.file.read(space).map_err(|source| BagError::Io {
                        file: self.path.clone(),
                        source,
                    })?;
                    self.reader.notify_read(read);
                }
                LinearReadEvent::Record { data, opcode } => {
                    self.begins = self.next_record;
                    self.next_record += (HEAD + data.len()) as u64;
                    self.at = 0;
                    self.records.clear();
                    self.chunk = None;
                    match opcode {
                        op::CHUNK => {
                            self.chunks += 1;
                            self.chunk = Some(self.chunks);
                            let found = chunk(data).map_err(|why| BagError::Broken {
                                file: self.path.clone(),
                                place: format!("chunk {} at byte {}", self.chunks, self.begins),
                                why,
                            })?;
                            self.records = found;
                            return Ok(true);
                        }
                        op::SCHEMA | op::CHANNEL | op::MESSAGE => {
                            self.records.push(opcode);
                            let length = (data.len() as u64).to_le_bytes();
                            self.records.extend_from_slice(&length);
                            self.records.extend_from_slice(data);
                            return Ok(true);
                        }
                        op::ATTACHMENT | op::METADATA => match parse_record(opcode, data) {
                            Ok(Record::Attachment { header, .. }) => {
                                self.beside.insert(header.name);
                            }
                            // ROS 2 writes one of this name by itself
                            Ok(Record::Metadata(own)) if own.name != "rosbag2" => {
                                self.beside.insert(own.name);
                            }
                            _ => {}
                        },
                        // indices and the summary
                        _ => {}
                    }
                }
            }
        }
    }

    /// The error of a file whose records do not follow each other.
    fn failed(&self, error: &McapError) -> BagError {
        match error {
            // the file ends, or has less bytes in all than a record claims
            McapError::UnexpectedEof | McapError::RecordTooLarge { .. } => BagError::Truncated {
                file: self.path.clone(),
                length: self.length,
                record: self.next_record.min(self.length),
                readable: Vec::new(),
            },
            other => BagError::Broken {
                file: self.path.clone(),
                place: format!("the record at byte {}", self.next_record),
                why: other.to_string(),
            },
        }
    }

    /// Reads the next record of the present chunk; whether it is a message.
    fn record(&mut self) -> Result<bool, BagError> {
        let start = self.at;
        let place = match self.chunk {
            Some(number) => Place::Chunk(number, self.begins, start as u64),
            None => Place::Byte(self.begins),
        };
        let wrong = |why: String| BagError::Broken {
            file: self.path.clone(),
            place: format!("the record {place}"),
            why,
        };
        let cut = || wrong("it ends before its length".to_owned());
        let (head, rest) = self.records[start..]
            .split_at_checked(HEAD)
            .ok_or_else(cut)?;
        let mut length = [0; 8];
        length.copy_from_slice(&head[1..]);
        let length = usize::try_from(u64::from_le_bytes(length)).unwrap_or(usize::MAX);
        let body = rest.get(..length).ok_or_else(cut)?;
        self.at = start + HEAD + length;
        if ![op::SCHEMA, op::CHANNEL, op::MESSAGE].contains(&head[0]) {
            return Ok(false);
        }
        match parse_record(head[0], body).map_err(|error| wrong(error.to_string()))? {
            Record::Schema { header, data } => {
                let text = String::from_utf8_lossy(&data).into_owned();
                self.schemas
                    .insert(header.id, (header.name, header.encoding, text));
                Ok(false)
            }
            Record::Channel(channel) => {
                // publishers write their channel again in each chunk
                if !self.channels.contains_key(&channel.id) {
                    let schema = self.schemas.get(&channel.schema_id);
                    let definition = schema.map(|(_, kind, text)| (kind.as_str(), text.as_str()));
                    let type_name = schema.map_or("", |(name, ..)| name.as_str());
                    let own = Channel::new(
                        &channel.topic,
                        type_name,
                        &channel.message_encoding,
                        definition,
                        self.any.as_deref(),
                    );
                    self.channels.insert(channel.id, own);
                    // ROS 2 writes these by itself
                    let by_itself =
                        |own: &String| matches!(&**own, "offered_qos_profiles" | "topic_type_hash");
                    let said = channel.metadata.into_keys().filter(|own| !by_itself(own));
                    self.beside.extend(said);
                }
                Ok(false)
            }
            Record::Message { header, data } => {
                if !self.channels.contains_key(&header.channel_id) {
                    return Err(wrong(format!(
                        "a message on channel {}, which is not defined before",
                        header.channel_id
                    )));
                }
                self.present = Some(Present {
                    channel: header.channel_id,
                    received: i64::try_from(header.log_time).unwrap_or(i64::MAX),
                    data: self.at - data.len()..self.at,
                    place,
                });
                Ok(true)
            }
            _ => Ok(false),
        }
    }
}

/// The records of a chunk, decompressed and checked.
fn chunk(data: &[u8]) -> Result<Vec<u8>, String> {
    let found = parse_record(op::CHUNK, data).map_err(|error| error.to_string())?;
    let Record::Chunk { header, data } = found else {
        return Err("it is not a chunk".to_owned());
    };
    let records = compression::records(&header.compression, &data, header.uncompressed_size)?;
    let sum = crc32fast::hash(&records);
    if header.uncompressed_crc != 0 && sum != header.uncompressed_crc {
        return Err(format!(
            "its check sum is {sum:08x} and not {:08x}: it was damaged",
            header.uncompressed_crc
        ));
    }
    Ok(records)
}
