//! MDF files of ASAM, version 4.

use flate2::read::ZlibDecoder;
use std::collections::BTreeSet;

use crate::array::{Array, Container, Found, Remarks, require_few};
use crate::error::{Read, broken, refused};
use crate::input::{Fields, Input, exactly, text};
use crate::number::{Kind, Stored, signed};

/// The first bytes of a finished file, and of one whose recorder did not end it.
pub(crate) const MAGIC: &[u8] = b"MDF     ";
pub(crate) const UNFINISHED: &[u8] = b"UnFinMF ";
/// Where the header is.
const HEADER: u64 = 64;
/// The largest number of blocks in a list.
const MAX_BLOCKS: usize = 100_000;
/// The largest size of the numbers of a conversion, and of a text, in bytes.
const MAX_BYTES: u64 = 1 << 20;

/// The largest number of names of states that are looked at.
const MAX_STATES: usize = 16;

/// The largest number of bytes of records for each byte of the file, which compression has.
const MAX_EXPANSION: u64 = 1100;

/// A block: its links, and its data.
struct Block {
    links: Vec<u64>,
    data: Vec<u8>,
}

impl Block {
    fn link(&self, k: usize) -> Option<u64> {
        self.links.get(k).copied().filter(|at| *at > 0)
    }
}

/// The kind, length and number of links of the block at an address.
fn head(input: &mut Input, at: u64) -> Read<([u8; 4], u64, u64)> {
    let bytes = input.bytes(at, 24)?;
    let mut fields = Fields::new(&bytes, false);
    let mut kind = [0; 4];
    kind.copy_from_slice(fields.take(4)?);
    fields.skip(4)?;
    let (length, links) = (fields.u64()?, fields.u64()?);
    let least = links.checked_mul(8).and_then(|all| all.checked_add(24));
    if !kind.starts_with(b"##") || least.is_none_or(|least| least > length) {
        return broken(format!("there is no block at byte {at}"));
    }
    Ok((kind, length, links))
}

/// The block of a kind at an address.
fn block(input: &mut Input, at: u64, wanted: [u8; 4]) -> Read<Block> {
    let (kind, length, links) = head(input, at)?;
    if kind != wanted {
        return broken(format!(
            "there is a block {} at byte {at} in place of {}",
            text(&kind),
            text(&wanted)
        ));
    }
    if length > MAX_BYTES {
        return broken(format!("the block at byte {at} has {length} bytes"));
    }
    let bytes = input.bytes(at + 24, length - 24)?;
    let mut fields = Fields::new(&bytes, false);
    let mut all = Vec::new();
    for _ in 0..links {
        all.push(fields.u64()?);
    }
    Ok(Block {
        links: all,
        data: fields.rest().to_vec(),
    })
}

/// What a text says.
#[derive(Debug, Default)]
struct Said {
    /// A plain text, that of `<TX>` in XML, or a text that should be XML and is none.
    text: String,
    /// What stands in `<names>`.
    names: Vec<String>,
    /// The names of other elements that say something.
    others: Vec<String>,
}

impl Said {
    /// Nothing without an address, or where there is no text.
    fn read(input: &mut Input, at: Option<u64>) -> Read<Self> {
        let mut found = Self::default();
        let Some(at) = at else { return Ok(found) };
        let (kind, length, _) = head(input, at)?;
        if !matches!(&kind, b"##TX" | b"##MD") || length > MAX_BYTES {
            return Ok(found);
        }
        let mut bytes = input.bytes(at + 24, length - 24)?;
        for byte in bytes.iter_mut().filter(|own| own.is_ascii_whitespace()) {
            *byte = b' ';
        }
        found.text = text(&bytes);
        if kind == *b"##MD"
            && let Ok(document) = roxmltree::Document::parse(&found.text)
        {
            let mut own = Self::default();
            for node in document.descendants().filter(roxmltree::Node::is_element) {
                let words = node.text().map_or("", str::trim).to_owned();
                let around = node.parent_element();
                match node.tag_name().name() {
                    _ if words.is_empty() => {}
                    "TX" if own.text.is_empty() => own.text = words,
                    _ if around.is_some_and(|own| own.has_tag_name("names")) => {
                        own.names.push(words);
                    }
                    tag => {
                        let name = node.attribute("name").unwrap_or(tag);
                        own.others.push(name.to_owned());
                    }
                }
            }
            found = own;
        }
        Ok(found)
    }
}

/// The text at an address; empty without one.
fn name(input: &mut Input, at: Option<u64>) -> Read<String> {
    Ok(Said::read(input, at)?.text)
}

/// How the number in a record becomes the quantity.
#[derive(Clone, Debug)]
enum Conversion {
    None,
    Linear(f64, f64),
    /// A quotient of polynomials of the second degree, the highest power first.
    Rational([f64; 6]),
    /// Pairs of a number and its quantity; whether there are values between them.
    Pairs(Vec<(f64, f64)>, bool),
}

impl Conversion {
    /// A sentence for those that are not read.
    fn read(block: Option<&Block>) -> Read<Result<Self, &'static str>> {
        let Some(own) = block else {
            return Ok(Ok(Self::None));
        };
        let mut fields = Fields::new(&own.data, false);
        let kind = fields.u8()?;
        fields.skip(5)?;
        let count = fields.u16()?;
        fields.skip(16)?;
        let mut values = Vec::new();
        for _ in 0..count {
            values.push(fields.f64()?);
        }
        Ok(match (kind, &values[..]) {
            // states with names are numbers all the same
            (0 | 7 | 8, _) => Ok(Self::None),
            (1, [offset, factor]) => Ok(Self::Linear(*offset, *factor)),
            (2, [a, b, c, d, e, f]) => Ok(Self::Rational([*a, *b, *c, *d, *e, *f])),
            (4 | 5, all) if all.len() >= 2 => {
                let mut pairs: Vec<(f64, f64)> =
                    all.chunks_exact(2).map(|own| (own[0], own[1])).collect();
                pairs.sort_by(|one, other| one.0.total_cmp(&other.0));
                Ok(Self::Pairs(pairs, kind == 4))
            }
            (1 | 2 | 4 | 5, _) => return broken("a conversion has too few numbers"),
            (3, _) => Err("its conversion is a formula"),
            _ => Err("its conversion is to or from text"),
        })
    }

    fn convert(&self, x: f64) -> f64 {
        match self {
            Self::None => x,
            Self::Linear(offset, factor) => offset + factor * x,
            Self::Rational([a, b, c, d, e, f]) => (a * x * x + b * x + c) / (d * x * x + e * x + f),
            Self::Pairs(all, between) => {
                let above = all.partition_point(|(from, _)| *from < x);
                let (low, high) = (all.get(above.saturating_sub(1)), all.get(above));
                match (low.or(high), high.or(low)) {
                    (Some((a, from)), Some((b, to))) if *between && b > a => {
                        from + (to - from) * ((x - a) / (b - a)).clamp(0.0, 1.0)
                    }
                    (Some((a, from)), Some((b, to))) => {
                        if (x - a).abs() <= (b - x).abs() {
                            *from
                        } else {
                            *to
                        }
                    }
                    _ => f64::NAN,
                }
            }
        }
    }
}

/// Where a channel's numbers are in a record.
#[derive(Clone, Debug)]
enum Bits {
    /// Whole bytes.
    Whole(Stored),
    /// So many bits from one on, signed or not.
    Part {
        first: u32,
        count: u32,
        signed: bool,
        big: bool,
    },
    /// The number of the record itself.
    Counted,
}

/// A channel.
#[derive(Clone, Debug)]
struct Channel {
    group: usize,
    offset: usize,
    bits: Bits,
    /// The bit of the record that says whether the value is none.
    invalid: Option<usize>,
    conversion: Conversion,
    /// Whether it is the time in s since the recording began.
    counts_seconds: bool,
}

/// The records of a group of channels.
#[derive(Clone, Debug)]
struct Group {
    data: Option<u64>,
    /// The bytes of the number of a group before each record, and all groups that share the data:
    /// their numbers, with the lengths of their records, or `None` for those with lengths of their own.
    number_bytes: usize,
    others: Vec<(u64, Option<usize>)>,
    number: u64,
    /// The length of a record, with the bytes of bits that say whether values are none.
    record: usize,
    /// Where these begin.
    flags: usize,
    rows: u64,
}

#[derive(Debug)]
struct Mdf {
    /// When the recording began, ns since 1970.
    start: Option<i64>,
    groups: Vec<Group>,
    channels: Vec<Channel>,
}

/// Adds the bytes of a block of data, or of a list of blocks.
fn data(input: &mut Input, at: u64, seen: &mut BTreeSet<u64>, out: &mut Vec<u8>) -> Read<()> {
    let mut next = Some(at);
    while let Some(at) = next {
        next = None;
        if !seen.insert(at) || seen.len() > MAX_BLOCKS {
            return broken("its blocks of data refer to each other without end");
        }
        let (kind, length, links) = head(input, at)?;
        match &kind {
            b"##DT" => out.extend(input.data(at + 24, length - 24)?),
            b"##DZ" => out.extend(unpacked(input, at, length)?),
            b"##HL" => next = block(input, at, *b"##HL")?.link(0),
            b"##DL" => {
                let bytes = input.bytes(at + 24, links * 8)?;
                let mut fields = Fields::new(&bytes, false);
                let following = fields.u64()?;
                for _ in 1..links {
                    match fields.u64()? {
                        0 => {}
                        own => {
                            let (kind, ..) = head(input, own)?;
                            if !matches!(&kind, b"##DT" | b"##DZ") {
                                return broken("a list of its data lists something else");
                            }
                            data(input, own, seen, out)?;
                        }
                    }
                }
                next = Some(following).filter(|at| *at > 0);
            }
            b"##LD" | b"##DV" => {
                return refused(
                    "its data is in columns: save it as MDF 4.1 (asammdf: `MDF(..).convert('4.10')`)",
                );
            }
            other => return broken(format!("there is a block {} in place of data", text(other))),
        }
    }
    Ok(())
}

/// The bytes of a compressed block.
fn unpacked(input: &mut Input, at: u64, length: u64) -> Read<Vec<u8>> {
    let head = input.bytes(at + 24, 24)?;
    let mut fields = Fields::new(&head, false);
    fields.skip(2)?;
    let kind = fields.u8()?;
    fields.skip(1)?;
    let columns = fields.u32()? as usize;
    let (whole, packed) = (fields.u64()?, fields.u64()?);
    if packed > length.saturating_sub(48) {
        return broken(format!(
            "the compressed block at byte {at} is longer than itself"
        ));
    }
    let stream = input.stream(at + 48, packed)?;
    let bytes = exactly(&mut ZlibDecoder::new(stream), whole)?;
    match kind {
        0 => Ok(bytes),
        1 if columns > 0 => {
            // first came all first bytes of the records, then all second ones, and so on
            let count = bytes.len() / columns;
            let mut out = Vec::with_capacity(bytes.len());
            for row in 0..count {
                out.extend((0..columns).map(|byte| bytes[byte * count + row]));
            }
            out.extend(&bytes[count * columns..]);
            Ok(out)
        }
        _ => refused(
            "its data is compressed in an unknown way: save it without (asammdf: `compression=0`)",
        ),
    }
}

impl Group {
    /// The records of this group.
    fn records(&self, input: &mut Input) -> Read<Vec<u8>> {
        let mut all = Vec::new();
        if let Some(at) = self.data {
            data(input, at, &mut BTreeSet::new(), &mut all)?;
        }
        let wanted = (self.rows as usize).saturating_mul(self.record);
        let out = if self.number_bytes == 0 {
            all
        } else {
            let mut out = Vec::new();
            let mut fields = Fields::new(&all, false);
            while fields.rest().len() >= self.number_bytes && out.len() < wanted {
                let number = fields.uint(self.number_bytes)?;
                let found = self.others.iter().find(|(own, _)| *own == number);
                let Some((_, length)) = found else {
                    return broken(format!(
                        "a record belongs to group {number}, which it does not have"
                    ));
                };
                let length = match length {
                    Some(length) => *length,
                    None => fields.u32()? as usize,
                };
                let record = fields.take(length)?;
                if number == self.number {
                    out.extend(record);
                }
            }
            out
        };
        if out.len() < wanted {
            return broken(format!(
                "it is cut off: a group has {} bytes of {wanted}",
                out.len()
            ));
        }
        Ok(out)
    }
}

impl Container for Mdf {
    fn numbers(&self, input: &mut Input, place: usize) -> Read<Vec<f64>> {
        let own = self.channels.get(place);
        let Some((own, group)) = own.and_then(|own| Some((own, self.groups.get(own.group)?)))
        else {
            return refused("it has disappeared");
        };
        if matches!(own.bits, Bits::Counted) {
            return Ok((0..group.rows)
                .map(|k| own.conversion.convert(k as f64))
                .collect());
        }
        let records = group.records(input)?;
        let all = records
            .chunks_exact(group.record.max(1))
            .take(group.rows as usize);
        Ok(all.map(|record| own.value(record, group.flags)).collect())
    }

    fn date(&self, _: &mut Input, place: usize) -> Read<Option<i64>> {
        let counts = self
            .channels
            .get(place)
            .is_some_and(|own| own.counts_seconds);
        Ok(self.start.filter(|_| counts))
    }
}

impl Channel {
    /// The value in a record.
    fn value(&self, record: &[u8], flags: usize) -> f64 {
        if let Some(bit) = self.invalid
            && record
                .get(flags + bit / 8)
                .is_some_and(|byte| byte >> (bit % 8) & 1 == 1)
        {
            return f64::NAN;
        }
        let bytes = record.get(self.offset..).unwrap_or_default();
        let number = match &self.bits {
            Bits::Whole(stored) => stored.number(bytes),
            Bits::Part {
                first,
                count,
                signed: is_signed,
                big,
            } => {
                let needed = (first + count).div_ceil(8) as usize;
                let own = bytes.get(..needed).unwrap_or_default();
                let join = |all: u128, byte: &u8| all << 8 | u128::from(*byte);
                let bits = if *big {
                    own.iter().fold(0, join)
                } else {
                    own.iter().rev().fold(0, join)
                };
                let mask = u128::MAX >> (128 - count);
                let bits = (bits >> first & mask) as u64;
                if *is_signed {
                    signed(bits, *count) as f64
                } else {
                    bits as f64
                }
            }
            Bits::Counted => f64::NAN,
        };
        self.conversion.convert(number)
    }
}

/// The file while it is read.
struct Reader<'a> {
    input: &'a mut Input,
    mdf: Mdf,
    arrays: Vec<Array>,
    unread: Vec<(String, String)>,
    remarks: Remarks,
    blocks: usize,
}

impl Reader<'_> {
    fn count(&mut self) -> Read<()> {
        self.blocks += 1;
        if self.blocks > MAX_BLOCKS {
            return broken(format!("it has more than {MAX_BLOCKS} groups and channels"));
        }
        Ok(())
    }

    /// Reads the groups of channels that share data.
    fn data_group(&mut self, own: &Block) -> Read<()> {
        let number_bytes = usize::from(Fields::new(&own.data, false).u8()?);
        if !matches!(number_bytes, 0 | 1 | 2 | 4 | 8) {
            return broken(format!("its records have numbers of {number_bytes} bytes"));
        }
        let (mut next, mut all) = (own.link(1), Vec::new());
        while let Some(at) = next {
            self.count()?;
            let group = block(self.input, at, *b"##CG")?;
            next = group.link(0);
            all.push(group);
        }
        let mut heads = Vec::new();
        for group in &all {
            let mut fields = Fields::new(&group.data, false);
            let (number, rows) = (fields.u64()?, fields.u64()?);
            let flags = fields.u16()?;
            fields.skip(6)?;
            let (bytes, more) = (fields.u32()? as usize, fields.u32()? as usize);
            let record = bytes.checked_add(more).filter(|_| flags & 1 == 0);
            heads.push((number, rows, record, bytes));
        }
        let others: Vec<(u64, Option<usize>)> = heads.iter().map(|own| (own.0, own.2)).collect();
        for (group, (number, rows, record, bytes)) in all.iter().zip(heads) {
            // the group of values of different lengths has no table
            let Some(record) = record else { continue };
            let mut title = name(self.input, group.link(2))?;
            if title.is_empty()
                && let Some(source) = group.link(3)
            {
                let source = block(self.input, source, *b"##SI")?;
                title = name(self.input, source.link(0))?;
            }
            let place = self.mdf.groups.len();
            if title.is_empty() {
                title = format!("group{place}");
            }
            self.mdf.groups.push(Group {
                data: own.link(2),
                number_bytes,
                others: others.clone(),
                number,
                record,
                flags: bytes,
                rows,
            });
            self.comment(group.link(5), &title)?;
            self.source(group.link(3), &title)?;
            let mut channel = group.link(1);
            while let Some(at) = channel {
                self.count()?;
                let block = block(self.input, at, *b"##CN")?;
                channel = block.link(0);
                self.channel(&block, place, &title)?;
            }
        }
        Ok(())
    }

    /// Keeps what is said of a channel, a group or the file; returns its other names.
    fn comment(&mut self, at: Option<u64>, of: &str) -> Read<Vec<String>> {
        let said = Said::read(self.input, at)?;
        // what asammdf writes by itself
        if said.text != "Python" {
            self.remarks.add("a comment", &said.text, of);
        }
        for own in &said.names {
            self.remarks.add("another name", own, of);
        }
        for own in &said.others {
            self.remarks.add("a property", own, of);
        }
        Ok(said.names)
    }

    /// Keeps what a conversion says beside its numbers: a comment, and names of states.
    fn states(&mut self, conversion: &Block, of: &str) -> Read<()> {
        self.comment(conversion.link(2), of)?;
        let mut fields = Fields::new(&conversion.data, false);
        // 7: a number has a name, 8: a range of numbers
        let step = match fields.u8()? {
            7 => 8,
            8 => 16,
            _ => return Ok(()),
        };
        fields.skip(23)?;
        let mut states = Vec::new();
        let numbers = fields.rest().chunks_exact(step).take(MAX_STATES);
        for (k, bytes) in numbers.enumerate() {
            let name = name(self.input, conversion.link(4 + k))?;
            states.push((Fields::new(bytes, false).f64()?, name));
        }
        states.retain(|own| !own.1.is_empty());
        self.remarks.add_states(&states, of);
        Ok(())
    }

    /// Keeps what a person wrote about a source of signals.
    fn source(&mut self, at: Option<u64>, of: &str) -> Read<()> {
        let Some(at) = at else { return Ok(()) };
        let source = block(self.input, at, *b"##SI")?;
        self.comment(source.link(2), of)?;
        Ok(())
    }

    fn channel(&mut self, own: &Block, group: usize, title: &str) -> Read<()> {
        let name = name(self.input, own.link(2))?;
        let path = format!("{title}/{name}");
        let other_names = self.comment(own.link(7), &path)?;
        self.source(own.link(3), &path)?;
        let (record, bytes, rows) = {
            let own = &self.mdf.groups[group];
            (own.record, own.flags, own.rows)
        };
        let mut fields = Fields::new(&own.data, false);
        let (kind, clock, data) = (fields.u8()?, fields.u8()?, fields.u8()?);
        let first = u32::from(fields.u8()?);
        let offset = fields.u32()? as usize;
        let count = fields.u32()?;
        let flags = fields.u32()?;
        let invalid = fields.u32()? as usize;
        let mut why = match kind {
            0 | 2 | 3 | 6 => None,
            4 => Some("it is a clock of another recording, such as a film"),
            _ => Some("its values have different lengths"),
        };
        let size = (count / 8) as usize;
        let whole = first == 0 && count % 8 == 0;
        let big = matches!(data, 1 | 3 | 5);
        let bits = match (kind, data) {
            (3 | 6, _) => Some(Bits::Counted),
            (_, 4 | 5) if whole => Stored::new(Kind::Float, size, big).map(Bits::Whole),
            (_, 0..=3) if whole && size <= 8 => {
                let kind = if data < 2 {
                    Kind::Unsigned
                } else {
                    Kind::Signed
                };
                Stored::new(kind, size, big).map(Bits::Whole)
            }
            (_, 0..=3) if (1..=64).contains(&count) && first < 8 => Some(Bits::Part {
                first,
                count,
                signed: data >= 2,
                big,
            }),
            _ => None,
        };
        if bits.is_none() {
            why = why.or(Some("it has text, bytes or times of the day"));
        }
        if own.link(1).is_some() {
            why = why.or(Some("it is a structure or an array"));
        }
        let needed = (u64::from(first) + u64::from(count)).div_ceil(8);
        if kind < 3 && (offset as u64).saturating_add(needed) > bytes as u64 {
            return broken(format!("the channel {path} is not within its record"));
        }
        // rows that do not exist would take memory for their numbers
        let claimed = rows.saturating_mul(record.max(1) as u64);
        if claimed > self.input.len().saturating_mul(MAX_EXPANSION) {
            why = Some("it claims more rows than the file has bytes");
        }
        if flags & 1 != 0 {
            why = why.or(Some("the file says that none of its values is valid"));
        }
        let conversion = own.link(4).map(|at| block(self.input, at, *b"##CC"));
        let conversion = conversion.transpose()?;
        if let Some(own) = &conversion {
            self.states(own, &path)?;
        }
        // the unit of the quantity is with the conversion, or else with the channel
        let unit = conversion.as_ref().and_then(|own| own.link(1));
        let unit = self::name(self.input, unit.or_else(|| own.link(6)))?;
        let conversion = Conversion::read(conversion.as_ref())?;
        let conversion = conversion
            .map_err(|own| why = why.or(Some(own)))
            .unwrap_or(Conversion::None);
        let (None, Some(bits)) = (why, bits) else {
            self.unread
                .push((path, why.unwrap_or("it has no numbers").to_owned()));
            return require_few(self.unread.len());
        };
        let is_time = matches!(kind, 2 | 3) && clock <= 1;
        let counts_seconds = is_time && matches!(unit.trim(), "" | "s");
        self.arrays.push(Array {
            place: self.mdf.channels.len(),
            group: Some(group),
            is_time,
            unit,
            other_names,
            ..Array::new(path, vec![rows])
        });
        self.mdf.channels.push(Channel {
            group,
            offset,
            bits,
            // 2: a bit says so
            invalid: (flags & 2 != 0).then_some(invalid),
            conversion,
            counts_seconds,
        });
        require_few(self.arrays.len())
    }
}

/// Opens a file.
pub(crate) fn open(input: &mut Input, start: &[u8]) -> Read<Found> {
    let mut fields = Fields::new(start, false);
    fields.skip(28)?;
    let version = fields.u16()?;
    if start.starts_with(UNFINISHED) {
        return refused(
            "the recorder did not finish this MDF file: let its own tool or `asammdf` save it again",
        );
    }
    if version < 400 {
        return refused(format!(
            "this is MDF {}.{:02}: convert it to MDF 4 (asammdf: `MDF(FILE).convert('4.10').save(..)`)",
            version / 100,
            version % 100
        ));
    }
    let head = block(input, HEADER, *b"##HD")?;
    let began = Fields::new(&head.data, false).u64()?;
    let mut reader = Reader {
        input,
        mdf: Mdf {
            start: i64::try_from(began).ok().filter(|own| *own > 0),
            groups: Vec::new(),
            channels: Vec::new(),
        },
        arrays: Vec::new(),
        unread: Vec::new(),
        remarks: Remarks::default(),
        blocks: 0,
    };
    for (place, name) in [(2, "a hierarchy"), (3, "attachments"), (4, "events")] {
        if head.link(place).is_some() {
            let why = "they stand beside the channels, and are not read".to_owned();
            reader.unread.push((name.to_owned(), why));
        }
    }
    reader.comment(head.link(5), "")?;
    let mut next = head.link(0);
    while let Some(at) = next {
        reader.count()?;
        let own = block(reader.input, at, *b"##DG")?;
        next = own.link(0);
        reader.comment(own.link(3), "")?;
        reader.data_group(&own)?;
    }
    reader.remarks.tell(&mut reader.unread);
    Ok(Found {
        arrays: reader.arrays,
        unread: reader.unread,
        container: Box::new(reader.mdf),
    })
}
