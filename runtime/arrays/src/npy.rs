//! Arrays of NumPy: NPY files, and the entries of NPZ files.

use std::io;

use crate::array::{Array, Container, Found};
use crate::error::{Read, broken, refused};
use crate::input::{Fields, Input, exactly};
use crate::number::{Kind, Stored, of_records};
use crate::zip::{Entry, entries};

/// The first bytes of a NPY file.
pub(crate) const MAGIC: &[u8] = b"\x93NUMPY";
/// The longest header in bytes: enough for a thousand named fields.
const MAX_HEADER: usize = 1 << 16;
/// The deepest nesting in a header.
const MAX_DEPTH: usize = 8;

/// A value of Python that a header has.
#[derive(Clone, Debug, PartialEq)]
enum Value {
    Text(String),
    Number(u64),
    Truth(bool),
    /// A list or a tuple.
    All(Vec<Value>),
    Named(Vec<(Value, Value)>),
}

impl Value {
    /// The value at the start of a text, which keeps what follows.
    fn read(text: &mut &str, depth: usize) -> Option<Self> {
        *text = text.trim_start();
        let first = text.chars().next()?;
        let ends = |text: &mut &str, end: char| {
            *text = text.trim_start_matches(|c: char| c.is_whitespace() || c == ',');
            let rest = text.strip_prefix(end);
            *text = rest.unwrap_or(text);
            rest.is_some()
        };
        match first {
            '{' | '(' | '[' if depth < MAX_DEPTH => {
                *text = &text[1..];
                let end = match first {
                    '{' => '}',
                    '(' => ')',
                    _ => ']',
                };
                let (mut all, mut named) = (Vec::new(), Vec::new());
                while !ends(text, end) {
                    let one = Self::read(text, depth + 1)?;
                    if end == '}' {
                        *text = text.trim_start().strip_prefix(':')?;
                        named.push((one, Self::read(text, depth + 1)?));
                    } else {
                        all.push(one);
                    }
                }
                Some(if end == '}' {
                    Self::Named(named)
                } else {
                    Self::All(all)
                })
            }
            '\'' | '"' => {
                let (inside, rest) = text[1..].split_once(first)?;
                *text = rest;
                Some(Self::Text(inside.to_owned()))
            }
            _ => {
                let end = text
                    .find(|c: char| !c.is_alphanumeric())
                    .unwrap_or(text.len());
                let (word, rest) = text.split_at(end);
                *text = rest;
                match word {
                    "True" => Some(Self::Truth(true)),
                    "False" => Some(Self::Truth(false)),
                    // Python 2 wrote an L behind long numbers
                    word => word.trim_end_matches('L').parse().ok().map(Self::Number),
                }
            }
        }
    }

    fn get(&self, name: &str) -> Option<&Self> {
        let Self::Named(all) = self else { return None };
        let found = all
            .iter()
            .find(|(key, _)| *key == Self::Text(name.to_owned()));
        found.map(|(_, value)| value)
    }

    fn sizes(&self) -> Option<Vec<u64>> {
        let one = |value: &Self| match value {
            Self::Number(size) => Some(*size),
            _ => None,
        };
        match self {
            Self::All(all) => all.iter().map(one).collect(),
            one_only => one(one_only).map(|size| vec![size]),
        }
    }
}

/// A number in each record of an array.
#[derive(Clone, Debug)]
struct Field {
    /// The name of the field; empty for plain numbers.
    name: String,
    offset: usize,
    /// How it is stored; `None` for what is no number.
    stored: Option<Stored>,
    /// The unit of a date or a span of time, s, as a whole number over another, and whether it is a date.
    clock: Option<([f64; 2], bool)>,
    /// The sizes of the field's own axes.
    axes: Vec<u64>,
}

/// What the header of an array says.
#[derive(Clone, Debug)]
struct Header {
    fields: Vec<Field>,
    /// The size of a record.
    record: usize,
    columns_first: bool,
    shape: Vec<u64>,
}

/// The unit of the dates of a type such as `<M8[ns]`, or of its spans of time, `m8`, s, as a whole number over another,
/// and whether it has dates.
fn clock(descr: &str) -> Option<([f64; 2], bool)> {
    let descr = descr.trim_start_matches(['<', '>', '|', '=']);
    let is_date = descr.starts_with('M');
    let (_, unit) = descr
        .strip_prefix(['M', 'm'])?
        .strip_suffix(']')?
        .split_once('[')?;
    let letters = unit.trim_start_matches(|digit: char| digit.is_ascii_digit());
    let count = unit.strip_suffix(letters)?;
    let count: f64 = if count.is_empty() {
        1.0
    } else {
        count.parse().ok()?
    };
    let (unit, parts) = match letters {
        "W" => (604_800.0, 1.0),
        "D" => (86_400.0, 1.0),
        "h" => (3600.0, 1.0),
        "m" => (60.0, 1.0),
        "s" => (1.0, 1.0),
        "ms" => (1.0, 1e3),
        "us" => (1.0, 1e6),
        "ns" => (1.0, 1e9),
        _ => return None,
    };
    Some(([count * unit, parts], is_date))
}

/// The size of a type, and how numbers of it are stored if it is one.
fn plain(descr: &str) -> Option<(usize, Option<Stored>)> {
    let big = descr.starts_with('>');
    let descr = descr.trim_start_matches(['<', '>', '|', '=']);
    let mut letters = descr.chars();
    let letter = letters.next()?;
    // the unit of a time, such as `M8[ns]`, is behind its size
    let digits = letters.as_str().split('[').next()?;
    let size: usize = digits.parse().ok()?;
    let kind = match letter {
        'f' => Kind::Float,
        'i' | 'm' | 'M' => Kind::Signed,
        'u' | 'b' => Kind::Unsigned,
        'U' => return Some((size.checked_mul(4)?, None)),
        'S' | 'a' | 'V' | 'c' => return Some((size, None)),
        _ => return None,
    };
    Some((size, Stored::new(kind, size, big)))
}

/// Adds the fields of a type behind those before it; `None` if it has objects or is no type.
fn fields(
    descr: &Value,
    name: &str,
    axes: &[u64],
    offset: &mut usize,
    out: &mut Vec<Field>,
) -> Option<()> {
    match descr {
        Value::Text(text) => {
            let (size, stored) = plain(text)?;
            let clock = clock(text).filter(|_| axes.is_empty());
            let is_clock = text.contains('[');
            out.push(Field {
                name: name.to_owned(),
                offset: *offset,
                // months and years have no length
                stored: stored.filter(|_| clock.is_some() || !is_clock),
                clock,
                axes: axes.to_vec(),
            });
            let count = axes.iter().try_fold(1_u64, |all, n| all.checked_mul(*n))?;
            let all = usize::try_from(count).ok()?.checked_mul(size)?;
            *offset = offset.checked_add(all)?;
        }
        Value::All(all) => {
            for one in all {
                let Value::All(parts) = one else { return None };
                let [title, kind, rest @ ..] = &parts[..] else {
                    return None;
                };
                let title = match title {
                    Value::Text(title) => title.as_str(),
                    // a title and a name
                    Value::All(both) => match both.last() {
                        Some(Value::Text(title)) => title.as_str(),
                        _ => return None,
                    },
                    _ => return None,
                };
                // arrays of records are no columns
                let own = rest.first().map_or(Some(Vec::new()), Value::sizes)?;
                if !own.is_empty() && matches!(kind, Value::All(_)) {
                    return None;
                }
                let path = match (name, title) {
                    (_, "") => String::new(),
                    ("", title) => title.to_owned(),
                    (name, title) => format!("{name}.{title}"),
                };
                fields(kind, &path, &own, offset, out)?;
            }
        }
        _ => return None,
    }
    Some(())
}

impl Header {
    /// Reads a header.
    fn read(stream: &mut dyn io::Read) -> Read<Self> {
        let start = exactly(stream, 8)?;
        if !start.starts_with(MAGIC) {
            return broken("an array of it does not begin as one of NumPy");
        }
        let size = if start[6] == 1 { 2 } else { 4 };
        let bytes = exactly(stream, size)?;
        let length = Fields::new(&bytes, false).uint(size as usize)?;
        if length > MAX_HEADER as u64 {
            return broken(format!("the header of an array has {length} bytes"));
        }
        let bytes = exactly(stream, length)?;
        let text = String::from_utf8_lossy(&bytes);
        let Some(header) = Value::read(&mut &*text, 0) else {
            return broken("the header of an array is no dictionary of Python");
        };
        let shape = header.get("shape").and_then(Value::sizes);
        let (Some(shape), Some(descr)) = (shape, header.get("descr")) else {
            return broken("the header of an array has no `shape` or `descr`");
        };
        let (mut all, mut record) = (Vec::new(), 0);
        if fields(descr, "", &[], &mut record, &mut all).is_none() {
            return refused(
                "it has objects of Python or nested records, not numbers: save plain arrays \
                 (`numpy.savez`) of numbers",
            );
        }
        Ok(Self {
            fields: all,
            record,
            columns_first: header.get("fortran_order") == Some(&Value::Truth(true)),
            shape,
        })
    }

    /// The number of bytes behind the header.
    fn bytes(&self) -> Read<u64> {
        let mut sizes = self.shape.iter().copied().chain([self.record as u64]);
        match sizes.try_fold(1_u64, u64::checked_mul) {
            Some(bytes) => Ok(bytes),
            None => broken("an array claims more bytes than there are addresses"),
        }
    }

    /// The numbers of a field.
    fn numbers(&self, bytes: &[u8], field: usize) -> Read<Vec<f64>> {
        let Some(Field {
            offset,
            stored: Some(stored),
            axes,
            clock,
            ..
        }) = self.fields.get(field)
        else {
            return refused("it has no numbers");
        };
        if let Some((unit, is_date)) = clock {
            let records = bytes.chunks_exact(self.record.max(1));
            return times(records, *offset, *stored, *unit, *is_date);
        }
        if axes.is_empty() {
            return of_records(bytes, self.record, *offset, *stored);
        }
        let count = axes.iter().product::<u64>() as usize;
        let inside = bytes.chunks_exact(self.record.max(1)).flat_map(|record| {
            let own = record.get(*offset..).unwrap_or_default();
            own.chunks_exact(stored.size).take(count)
        });
        Ok(inside.map(|bytes| stored.number(bytes)).collect())
    }

    /// The first date of a field, ns since 1970.
    fn date(&self, bytes: &[u8], field: usize) -> Option<i64> {
        let own = self.fields.get(field)?;
        let (unit, is_date) = own.clock?;
        let records = bytes.chunks_exact(self.record.max(1));
        let date = || first_date(records, own.offset, own.stored?.big, unit);
        is_date.then(date).flatten()
    }

    /// Lists the arrays of numbers of these records under a name.
    fn list(
        &self,
        name: &str,
        mut add: impl FnMut(Array, usize),
        unread: &mut Vec<(String, String)>,
    ) {
        for (k, field) in self.fields.iter().enumerate() {
            let path = match (name, field.name.as_str()) {
                (name, "") => name.to_owned(),
                ("", own) => own.to_owned(),
                (name, own) => format!("{name}.{own}"),
            };
            if field.stored.is_none() {
                unread.push((path, "it has texts or complex numbers".to_owned()));
                continue;
            }
            let mut shape = self.shape.clone();
            shape.extend(&field.axes);
            add(
                Array {
                    is_time: field.clock.is_some_and(|own| own.1),
                    is_clock: field.clock.is_some(),
                    unit: field.clock.map_or("", |_| "s").to_owned(),
                    columns_first: self.columns_first && field.axes.is_empty(),
                    ..Array::new(path, shape)
                },
                k,
            );
        }
    }
}

/// The first date in ns since 1970; `None` without any, and of one that so many ns do not reach.
fn first_date<'a>(
    mut records: impl Iterator<Item = &'a [u8]>,
    offset: usize,
    big: bool,
    [unit, parts]: [f64; 2],
) -> Option<i64> {
    let count =
        records.find_map(|record| ticks(record, offset, big).filter(|own| *own > i64::MIN))?;
    // units are whole numbers of ns
    let tick = (unit * 1e9 / parts) as i64;
    count.checked_mul(tick)
}

/// The count of a date or a span of time in a record.
fn ticks(record: &[u8], offset: usize, big: bool) -> Option<i64> {
    let bytes = *record.get(offset..)?.first_chunk::<8>()?;
    Some(if big {
        i64::from_be_bytes(bytes)
    } else {
        i64::from_le_bytes(bytes)
    })
}

/// Times in s. Dates count from the first one, since those since 1970 in ns have more digits than a number.
fn times<'a>(
    records: impl Iterator<Item = &'a [u8]>,
    offset: usize,
    stored: Stored,
    [unit, parts]: [f64; 2],
    is_date: bool,
) -> Read<Vec<f64>> {
    let mut first = None;
    let mut out = Vec::new();
    for record in records {
        let Some(count) = ticks(record, offset, stored.big) else {
            return broken("a field is not within its record");
        };
        // NumPy's mark for no time
        if count == i64::MIN {
            out.push(f64::NAN);
            continue;
        }
        let from = if is_date {
            *first.get_or_insert(count)
        } else {
            0
        };
        let ticks = (i128::from(count) - i128::from(from)) as f64;
        out.push(ticks * unit / parts);
    }
    Ok(out)
}

/// One array of NumPy.
#[derive(Debug)]
struct Npy(Header);

impl Container for Npy {
    fn numbers(&self, input: &mut Input, array: usize) -> Read<Vec<f64>> {
        let bytes = self.0.bytes()?;
        let start = input.len().saturating_sub(bytes);
        let data = input.data(start, bytes)?;
        self.0.numbers(&data, array)
    }

    fn date(&self, input: &mut Input, array: usize) -> Read<Option<i64>> {
        let bytes = self.0.bytes()?;
        let start = input.len().saturating_sub(bytes);
        Ok(self.0.date(&input.data(start, bytes)?, array))
    }
}

/// Opens a NPY file; its array has the name of the file.
pub(crate) fn open(input: &mut Input, name: &str) -> Read<Found> {
    let length = input.len();
    let mut stream = input.stream(0, length)?;
    let header = Header::read(&mut stream)?;
    let (bytes, rest) = (header.bytes()?, stream.limit());
    if bytes != rest {
        return broken(format!("its array has {rest} bytes in place of {bytes}"));
    }
    let (mut arrays, mut unread) = (Vec::new(), Vec::new());
    // the fields of records have names of their own
    let name = if header.fields.len() > 1 { "" } else { name };
    let add = |array, field| {
        arrays.push(Array {
            place: field,
            ..array
        });
    };
    header.list(name, add, &mut unread);
    Ok(Found {
        arrays,
        unread,
        container: Box::new(Npy(header)),
    })
}

/// The arrays of a NPZ file.
#[derive(Debug)]
struct Npz {
    entries: Vec<(Entry, Header)>,
    /// The entry and the field of each array.
    places: Vec<(usize, usize)>,
}

impl Npz {
    /// The header, the content and the field of an array.
    fn content(&self, input: &mut Input, array: usize) -> Read<(&Header, Vec<u8>, usize)> {
        let found = self.places.get(array);
        let found = found.and_then(|(entry, field)| Some((self.entries.get(*entry)?, *field)));
        let Some(((entry, header), field)) = found else {
            return refused("it has disappeared");
        };
        let bytes = entry.content(input)?;
        let wanted = header.bytes()?;
        let start = (bytes.len() as u64).checked_sub(wanted);
        let Some(start) = start else {
            return broken(format!("{} of it ends early", entry.name));
        };
        Ok((header, bytes[start as usize..].to_vec(), field))
    }
}

impl Container for Npz {
    fn numbers(&self, input: &mut Input, array: usize) -> Read<Vec<f64>> {
        let (header, bytes, field) = self.content(input, array)?;
        header.numbers(&bytes, field)
    }

    fn date(&self, input: &mut Input, array: usize) -> Read<Option<i64>> {
        let (header, bytes, field) = self.content(input, array)?;
        Ok(header.date(&bytes, field))
    }
}

/// Opens a NPZ file.
pub(crate) fn open_zip(input: &mut Input) -> Read<Found> {
    let all = entries(input)?;
    let (mut arrays, mut unread) = (Vec::new(), Vec::new());
    let (mut kept, mut places, mut others) = (Vec::new(), Vec::new(), Vec::new());
    for entry in all {
        let Some(name) = entry.name.strip_suffix(".npy") else {
            others.push((entry.name, "it is no array of NumPy (`.npy`)".to_owned()));
            continue;
        };
        let header = match entry.stream(input).and_then(|mut stream| {
            let header = Header::read(&mut stream)?;
            Ok(header)
        }) {
            Ok(header) => header,
            Err(crate::error::Why::Refused(why)) => {
                unread.push((name.to_owned(), why));
                continue;
            }
            Err(other) => return Err(other),
        };
        if header.bytes()? > entry.size {
            return broken(format!("its array {name} is larger than its entry"));
        }
        let own = kept.len();
        let add = |array, field| {
            arrays.push(Array {
                place: places.len(),
                ..array
            });
            places.push((own, field));
        };
        header.list(name, add, &mut unread);
        kept.push((entry, header));
    }
    if kept.is_empty() && unread.is_empty() {
        return refused(
            "this is a ZIP archive without arrays of NumPy (`.npy`): unpack it, and name the log in it",
        );
    }
    unread.extend(others);
    Ok(Found {
        arrays,
        unread,
        container: Box::new(Npz {
            entries: kept,
            places,
        }),
    })
}
