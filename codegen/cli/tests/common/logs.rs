//! Writes logs in the formats of laboratories and recorders, byte by byte, with what a log may have besides its columns.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use parquet::data_type::{ByteArray, ByteArrayType, DoubleType};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;

/// The bytes of doubles.
pub fn doubles(numbers: &[f64]) -> Vec<u8> {
    numbers.iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// An array of NumPy with a type as NumPy writes it, such as `'<f8'`.
pub fn npy(kind: &str, rows: usize, bytes: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': {kind}, 'fortran_order': False, 'shape': ({rows},), }}\n");
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    out.extend((header.len() as u16).to_le_bytes());
    out.extend(header.as_bytes());
    out.extend(bytes);
    out
}

/// The check sum of ZIP.
fn crc(bytes: &[u8]) -> u32 {
    let mut sum = u32::MAX;
    for byte in bytes {
        sum ^= u32::from(*byte);
        for _ in 0..8 {
            sum = (sum >> 1) ^ (0xedb8_8320 * (sum & 1));
        }
    }
    !sum
}

/// A ZIP archive of entries that are stored.
pub fn zip(entries: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let (mut out, mut list) = (Vec::new(), Vec::new());
    for (name, bytes) in entries {
        let at = out.len() as u32;
        let size = bytes.len() as u32;
        let mut same = vec![20, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        same.extend([crc(bytes), size, size].map(u32::to_le_bytes).concat());
        same.extend((name.len() as u16).to_le_bytes());
        same.extend([0, 0]);
        out.extend([b"PK\x03\x04", same.as_slice(), name.as_bytes(), bytes].concat());
        list.extend([b"PK\x01\x02\x14\x00", same.as_slice(), &[0; 10]].concat());
        list.extend([&at.to_le_bytes(), name.as_bytes()].concat());
    }
    let (count, at) = (entries.len() as u16, out.len() as u32);
    out.extend(&list);
    out.extend(b"PK\x05\x06\x00\x00\x00\x00");
    out.extend([count, count].map(u16::to_le_bytes).concat());
    out.extend([list.len() as u32, at].map(u32::to_le_bytes).concat());
    out.extend([0, 0]);
    out
}

/// An element of a MAT file of level 5.
fn element(kind: u32, data: &[u8]) -> Vec<u8> {
    let mut out = [kind, data.len() as u32].map(u32::to_le_bytes).concat();
    out.extend(data);
    out.resize(out.len().next_multiple_of(8), 0);
    out
}

/// A variable of a MAT file: its class and flags, the number of its rows, and its elements of numbers.
pub fn variable(name: &str, class: u32, rows: u32, numbers: &[(u32, &[u8])]) -> Vec<u8> {
    let mut parts = element(6, &[class, 0].map(u32::to_le_bytes).concat());
    parts.extend(element(5, &[rows, 1].map(u32::to_le_bytes).concat()));
    parts.extend(element(1, name.as_bytes()));
    for (kind, data) in numbers {
        parts.extend(element(*kind, data));
    }
    element(14, &parts)
}

/// A MAT file of level 5.
pub fn mat(variables: &[Vec<u8>]) -> Vec<u8> {
    let head = format!("{:124}\0\u{1}IM", "MATLAB 5.0 MAT-file");
    [head.into_bytes(), variables.concat()].concat()
}

/// A channel of a TDMS file: its path, the code of its type, its values, and its properties with texts.
pub struct Channel<'a> {
    pub path: &'a str,
    pub kind: u32,
    pub values: Vec<Vec<u8>>,
    pub properties: &'a [(&'a str, &'a str)],
}

/// A TDMS file of one segment.
pub fn tdms(channels: &[Channel<'_>]) -> Vec<u8> {
    let text = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
    let mut list = (channels.len() as u32).to_le_bytes().to_vec();
    let mut raw = Vec::new();
    for own in channels {
        list.extend(text(own.path));
        let is_text = own.kind == 0x20;
        let head = [if is_text { 28 } else { 20 }, own.kind, 1];
        list.extend(head.map(u32::to_le_bytes).concat());
        list.extend((own.values.len() as u64).to_le_bytes());
        let before = raw.len();
        if is_text {
            // where each text ends
            let mut end = 0;
            for value in &own.values {
                end += value.len() as u32;
                raw.extend(end.to_le_bytes());
            }
        }
        raw.extend(own.values.concat());
        if is_text {
            list.extend(((raw.len() - before) as u64).to_le_bytes());
        }
        list.extend((own.properties.len() as u32).to_le_bytes());
        for (name, value) in own.properties {
            list.extend([text(name), vec![0x20, 0, 0, 0], text(value)].concat());
        }
    }
    let mut out = b"TDSm".to_vec();
    out.extend([2_u32 | 4 | 8, 4713].map(u32::to_le_bytes).concat());
    out.extend(
        [list.len() + raw.len(), list.len()]
            .map(|n| (n as u64).to_le_bytes())
            .concat(),
    );
    [out, list, raw].concat()
}

/// Blocks of an MDF 4 file, one behind the other.
pub struct Mdf(Vec<u8>);

impl Mdf {
    /// Adds a block, and returns its address.
    pub fn add(&mut self, kind: [u8; 4], links: &[u64], data: &[u8]) -> u64 {
        let at = self.0.len() as u64;
        let length = 24 + 8 * links.len() as u64 + data.len() as u64;
        self.0
            .extend([&kind[..], &[0; 4], &length.to_le_bytes()].concat());
        self.0.extend((links.len() as u64).to_le_bytes());
        self.0
            .extend(links.iter().flat_map(|own| own.to_le_bytes()));
        self.0.extend(data);
        self.0.resize(self.0.len().next_multiple_of(8), 0);
        at
    }

    pub fn text(&mut self, text: &str) -> u64 {
        self.add(*b"##TX", &[], format!("{text}\0").as_bytes())
    }

    /// A conversion of a kind without numbers; that to texts has the states off and on.
    pub fn conversion(&mut self, kind: u8) -> u64 {
        let mut data = vec![0; 24];
        data[0] = kind;
        let mut links = vec![0; 4];
        if kind == 7 {
            links.extend(["off", "on"].map(|own| self.text(own)));
            data.extend(doubles(&[0.0, 1.0]));
            data[6] = 2;
        }
        self.add(*b"##CC", &links, &data)
    }

    /// A channel of doubles at a byte of the record, with the addresses of its conversion, its unit and its
    /// comment.
    pub fn channel(
        &mut self,
        (next, name): (u64, &str),
        byte: u32,
        [conversion, unit, comment]: [u64; 3],
        flags: u32,
    ) -> u64 {
        let name_at = self.text(name);
        let is_time = u8::from(name == "t");
        let mut own = vec![2 * is_time, is_time, 4, 0];
        own.extend([byte, 64, flags].map(u32::to_le_bytes).concat());
        own.resize(72, 0);
        self.add(
            *b"##CN",
            &[next, 0, name_at, 0, conversion, 0, unit, comment],
            &own,
        )
    }

    /// A group of channels with its records, in a group of data of its own.
    pub fn group(&mut self, next: u64, name: &str, channels: u64, rows: &[Vec<f64>]) -> u64 {
        let name = self.text(name);
        let bytes = 8 * rows.first().map_or(0, Vec::len) as u32;
        let mut own = [0, rows.len() as u64, 0].map(u64::to_le_bytes).concat();
        own.extend([bytes, 0].map(u32::to_le_bytes).concat());
        let group = self.add(*b"##CG", &[0, channels, name, 0, 0, 0], &own);
        let data = self.add(*b"##DT", &[], &doubles(&rows.concat()));
        self.add(*b"##DG", &[next, group, data, 0], &[0; 8])
    }
}

/// An MDF file whose first group of data is what `fill` returns.
pub fn mdf(fill: impl FnOnce(&mut Mdf) -> u64) -> Vec<u8> {
    let mut start = b"MDF     4.10    ".to_vec();
    start.resize(28, 0);
    start.extend(410_u16.to_le_bytes());
    start.resize(64, 0);
    let mut blocks = Mdf(start);
    blocks.add(*b"##HD", &[0; 6], &[0; 32]);
    let first = fill(&mut blocks);
    blocks.0[64 + 24..64 + 32].copy_from_slice(&first.to_le_bytes());
    blocks.0
}

/// A message of the header of an object of HDF5.
fn header_message(kind: u8, data: &[u8]) -> Vec<u8> {
    [&[kind], &(data.len() as u16).to_le_bytes()[..], &[0], data].concat()
}

/// What an HDF5 file has at a path of its root.
pub enum Hdf5<'a> {
    /// Doubles, with the text of the attribute `unit`, or another attribute as `name=text`.
    Numbers(Vec<f64>, &'a str),
    Text(&'a str),
    /// A link to another path.
    Link(&'a str),
    /// Doubles that are compressed by a filter of this number.
    Filtered(u16),
}

/// An HDF5 file with these objects in its root.
pub fn hdf5(objects: &[(&str, Hdf5<'_>)]) -> Vec<u8> {
    let mut out = b"\x89HDF\r\n\x1a\n\x02\x08\x08\x00".to_vec();
    // base, extension, end and root; the check sums are not read
    out.extend([0, u64::MAX, 0, 48].map(u64::to_le_bytes).concat());
    out.extend([0; 4]);
    let header = |messages: &[Vec<u8>]| {
        let messages = messages.concat();
        let length = (messages.len() as u32).to_le_bytes();
        [b"OHDR\x02\x02", &length[..], &messages, &[0; 4]].concat()
    };
    let double = [
        &[0x11, 0x20, 0x3f, 0, 8, 0, 0, 0, 0, 0, 64, 0, 52, 11, 0, 52][..],
        &1023_u32.to_le_bytes(),
    ]
    .concat();
    let texts = |size: usize| [&[0x13, 0, 0, 0], &(size as u32).to_le_bytes()[..]].concat();
    let space = |rows: &[u64]| {
        let sizes = rows.iter().flat_map(|n| n.to_le_bytes());
        [vec![2, rows.len() as u8, 0, 1], sizes.collect()].concat()
    };
    let link = |name: &str, is_soft: bool, value: &[u8]| {
        let kind = if is_soft { vec![1, 8, 1] } else { vec![1, 0] };
        header_message(
            6,
            &[&kind, &[name.len() as u8][..], name.as_bytes(), value].concat(),
        )
    };
    // the data sets come behind the root, whose length does not depend on their addresses
    let links = |places: &[u64]| {
        let all = objects
            .iter()
            .zip(places)
            .map(|((name, own), at)| match own {
                Hdf5::Link(to) => {
                    let to = [&(to.len() as u16).to_le_bytes(), to.as_bytes()].concat();
                    link(name, true, &to)
                }
                _ => link(name, false, &at.to_le_bytes()),
            });
        header(&all.collect::<Vec<_>>())
    };
    let mut at = 48 + links(&vec![0; objects.len()]).len() as u64;
    let (mut places, mut rest) = (Vec::new(), Vec::new());
    for (_, own) in objects {
        places.push(at);
        let set = match own {
            Hdf5::Link(_) => Vec::new(),
            Hdf5::Text(text) => {
                let place = [
                    &[3, 0],
                    &(text.len() as u16).to_le_bytes()[..],
                    text.as_bytes(),
                ];
                header(&[
                    header_message(1, &space(&[])),
                    header_message(3, &texts(text.len())),
                    header_message(8, &place.concat()),
                ])
            }
            Hdf5::Filtered(number) => {
                let chunks = [vec![3, 2, 2], vec![0xff; 8], vec![4, 0, 0, 0, 8, 0, 0, 0]];
                let filter = [&[2, 1], &number.to_le_bytes()[..], &[0; 6]].concat();
                header(&[
                    header_message(1, &space(&[4])),
                    header_message(3, &double),
                    header_message(0xb, &filter),
                    header_message(8, &chunks.concat()),
                ])
            }
            Hdf5::Numbers(numbers, unit) => {
                let bytes = 8 * numbers.len() as u64;
                let (name, unit) = unit.split_once('=').unwrap_or(("unit", unit));
                let attribute = [
                    &[3, 0, name.len() as u8 + 1, 0, 8, 0, 4, 0, 0][..],
                    name.as_bytes(),
                    &[0],
                    &texts(unit.len()),
                    &space(&[]),
                    unit.as_bytes(),
                ];
                let own = |at: u64| {
                    header(&[
                        header_message(1, &space(&[numbers.len() as u64])),
                        header_message(3, &double),
                        header_message(0xc, &attribute.concat()),
                        header_message(
                            8,
                            &[&[3, 1], &at.to_le_bytes()[..], &bytes.to_le_bytes()].concat(),
                        ),
                    ])
                };
                let behind = at + own(0).len() as u64;
                [own(behind), doubles(numbers)].concat()
            }
        };
        at += set.len() as u64;
        rest.extend(set);
    }
    out.extend(links(&places));
    out.extend(rest);
    out
}

/// A record of an MCAP file.
fn record(kind: u8, body: &[u8]) -> Vec<u8> {
    [&[kind], &(body.len() as u64).to_le_bytes()[..], body].concat()
}

/// A topic of a recording: its name, the type of its messages with its definition, and the messages.
pub struct Topic<'a> {
    pub name: &'a str,
    pub kind: &'a str,
    pub definition: &'a str,
    /// Times in ns with the data in CDR.
    pub messages: Vec<(u64, Vec<u8>)>,
}

/// An MCAP file.
pub fn mcap(topics: &[Topic<'_>]) -> Vec<u8> {
    let text = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
    let mut out = b"\x89MCAP0\r\n".to_vec();
    out.extend(record(1, &[text(""), text("")].concat()));
    let mut messages = Vec::new();
    for (k, topic) in topics.iter().enumerate() {
        let id = (k as u16 + 1).to_le_bytes().to_vec();
        let schema = [text(topic.kind), text("ros2msg"), text(topic.definition)];
        out.extend(record(3, &[id.clone(), schema.concat()].concat()));
        let channel = [text(topic.name), text("cdr"), vec![0; 4]].concat();
        out.extend(record(4, &[id.clone(), id.clone(), channel].concat()));
        for (time, data) in &topic.messages {
            let times = [*time, *time].map(u64::to_le_bytes).concat();
            let body = [id.clone(), vec![0; 4], times, data.clone()].concat();
            messages.push((*time, record(5, &body)));
        }
    }
    messages.sort_by_key(|own| own.0);
    out.extend(messages.into_iter().flat_map(|own| own.1));
    out.extend(record(15, &[0; 4]));
    out.extend(record(2, &[0; 20]));
    out.extend(b"\x89MCAP0\r\n");
    out
}

/// A record of metadata without entries, as it stands behind the header of an MCAP file.
pub fn with_metadata(mut mcap: Vec<u8>, name: &str) -> Vec<u8> {
    let body = [&(name.len() as u32).to_le_bytes(), name.as_bytes(), &[0; 4]].concat();
    insert(&mut mcap, 12, &body);
    mcap
}

/// A channel without messages that has metadata of its own, as it stands behind the header of an MCAP file.
pub fn with_channel(mut mcap: Vec<u8>, metadata: &str) -> Vec<u8> {
    let text = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
    let pair = [text(metadata), text("50")].concat();
    let length = (pair.len() as u32).to_le_bytes();
    let body = [
        &[9, 0, 0, 0][..],
        &text("/other"),
        &text("cdr"),
        &length,
        &pair,
    ];
    insert(&mut mcap, 4, &body.concat());
    mcap
}

/// Inserts a record behind the header of an MCAP file.
fn insert(mcap: &mut Vec<u8>, kind: u8, body: &[u8]) {
    let behind_header = 8 + 9 + 8;
    mcap.splice(behind_header..behind_header, record(kind, body));
}

/// A message of the type `sensor_msgs/msg/JointState` in CDR: its time, ns, and joints with positions and efforts.
pub fn joint_state(time: u64, joints: &[(&str, f64, f64)]) -> Vec<u8> {
    let mut out = vec![0, 1, 0, 0];
    let word = |out: &mut Vec<u8>, word: u32| {
        out.resize(out.len().next_multiple_of(4), 0);
        out.extend(word.to_le_bytes());
    };
    let text = |out: &mut Vec<u8>, text: &str| {
        word(out, text.len() as u32 + 1);
        out.extend(text.as_bytes());
        out.push(0);
    };
    word(&mut out, (time / 1_000_000_000) as u32);
    word(&mut out, (time % 1_000_000_000) as u32);
    text(&mut out, "");
    word(&mut out, joints.len() as u32);
    for (name, ..) in joints {
        text(&mut out, name);
    }
    let positions = joints.iter().map(|own| own.1).collect();
    let efforts = joints.iter().map(|own| own.2).collect();
    for numbers in [positions, Vec::new(), efforts] {
        word(&mut out, numbers.len() as u32);
        if !numbers.is_empty() {
            // doubles begin at multiples of 8 behind the head of 4 bytes
            out.resize((out.len() - 4).next_multiple_of(8) + 4, 0);
            out.extend(doubles(&numbers));
        }
    }
    out
}

/// Writes a Parquet file with columns of doubles, of texts, and of lists of different lengths.
pub fn parquet(
    path: &Path,
    columns: &[(&str, Vec<f64>)],
    texts: &[&str],
    lists: &[&str],
    metadata: &[(&str, &str)],
) {
    let rows = columns.first().map_or(0, |own| own.1.len());
    let numbers = columns
        .iter()
        .map(|own| format!("required double {};", own.0));
    let words = texts
        .iter()
        .map(|name| format!("required binary {name} (UTF8);"));
    let pairs = lists.iter().map(|name| format!("repeated double {name};"));
    let fields: String = numbers.chain(words).chain(pairs).collect();
    let schema = parse_message_type(&format!("message log {{ {fields} }}")).unwrap();
    let file = File::create(path).unwrap();
    let said = metadata
        .iter()
        .map(|(key, value)| KeyValue::new((*key).to_owned(), (*value).to_owned()));
    let said = WriterProperties::builder().set_key_value_metadata(Some(said.collect()));
    let mut writer =
        SerializedFileWriter::new(file, Arc::new(schema), Arc::new(said.build())).unwrap();
    let mut group = writer.next_row_group().unwrap();
    for (_, values) in columns {
        let mut own = group.next_column().unwrap().unwrap();
        own.typed::<DoubleType>()
            .write_batch(values, None, None)
            .unwrap();
        own.close().unwrap();
    }
    for _ in texts {
        let mut own = group.next_column().unwrap().unwrap();
        let values = vec![ByteArray::from("auto"); rows];
        own.typed::<ByteArrayType>()
            .write_batch(&values, None, None)
            .unwrap();
        own.close().unwrap();
    }
    for _ in lists {
        // of different lengths: one, then two
        let mut own = group.next_column().unwrap().unwrap();
        let repeated: Vec<i16> = (0..rows)
            .flat_map(|k| if k == 0 { vec![0] } else { vec![0, 1] })
            .collect();
        let values = vec![1.0; repeated.len()];
        let defined = vec![1; repeated.len()];
        own.typed::<DoubleType>()
            .write_batch(&values, Some(&defined), Some(&repeated))
            .unwrap();
        own.close().unwrap();
    }
    group.close().unwrap();
    writer.close().unwrap();
}
