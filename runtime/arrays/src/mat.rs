//! MAT files of level 5, as MATLAB writes them by `save -v6` and `-v7`, and SciPy.

use std::io;

use flate2::read::ZlibDecoder;

use crate::array::{Array, Container, Found, require_few};
use crate::error::{Read, broken, refused};
use crate::input::{Fields, Input, exactly, pass, text};
use crate::number::{Kind, Stored, of_records};

/// The length of the header.
const HEADER_BYTES: u64 = 128;
/// The deepest nesting of structs and cells.
const MAX_DEPTH: usize = 16;
/// The largest number of elements of a struct array or a cell whose contents are listed.
const MAX_ELEMENTS: usize = 1000;
/// The longest name, list of names or list of sizes, in bytes.
const MAX_NAMES: u64 = 1 << 16;
/// The largest number of arrays of arrays of one variable.
const MAX_PARTS: usize = 200_000;

/// Types of elements.
const COMPRESSED: u32 = 15;
const MATRIX: u32 = 14;

/// Whether a file begins as one of level 5.
pub(crate) fn begins(start: &[u8]) -> bool {
    start.len() >= HEADER_BYTES as usize
        && start.starts_with(b"MATLAB 5.0")
        && matches!(&start[124..128], [_, _, b'I', b'M'] | [_, _, b'M', b'I'])
}

/// How the numbers of an element's type are stored.
fn stored(kind: u32, big: bool) -> Option<Stored> {
    let (kind, size) = match kind {
        1 => (Kind::Signed, 1),
        2 => (Kind::Unsigned, 1),
        3 => (Kind::Signed, 2),
        4 => (Kind::Unsigned, 2),
        5 => (Kind::Signed, 4),
        6 => (Kind::Unsigned, 4),
        7 => (Kind::Float, 4),
        9 => (Kind::Float, 8),
        12 => (Kind::Signed, 8),
        13 => (Kind::Unsigned, 8),
        _ => return None,
    };
    Stored::new(kind, size, big)
}

/// Where the numbers of an array are.
#[derive(Clone, Copy, Debug)]
struct Place {
    /// Where the variable's content begins in the file, its length there, and whether it is compressed.
    variable: (u64, u64, bool),
    /// Where its numbers begin in the content, and their length.
    start: u64,
    length: u64,
    stored: Stored,
}

/// The variables of a file.
#[derive(Debug)]
struct Mat(Vec<Place>);

impl Container for Mat {
    fn numbers(&self, input: &mut Input, place: usize) -> Read<Vec<f64>> {
        let Some(own) = self.0.get(place) else {
            return refused("it has disappeared");
        };
        let (at, length, compressed) = own.variable;
        let bytes = if compressed {
            let mut stream = ZlibDecoder::new(input.stream(at, length)?);
            pass(&mut stream, own.start)?;
            exactly(&mut stream, own.length)?
        } else {
            input.data(at.saturating_add(own.start), own.length)?
        };
        of_records(&bytes, own.stored.size, 0, own.stored)
    }
}

/// The content of a variable while it is read.
struct Content<'a> {
    stream: Box<dyn io::Read + 'a>,
    /// The number of bytes before the next one.
    place: u64,
    big: bool,
}

/// The tag of an element.
struct Tag {
    kind: u32,
    length: u64,
    /// The data of a short element, which is in its tag.
    short: Option<Vec<u8>>,
}

impl Content<'_> {
    fn take(&mut self, count: u64) -> Read<Vec<u8>> {
        let bytes = exactly(&mut self.stream, count)?;
        self.place += count;
        Ok(bytes)
    }

    fn pass(&mut self, count: u64) -> Read<()> {
        pass(&mut self.stream, count)?;
        self.place += count;
        Ok(())
    }

    fn tag(&mut self) -> Read<Tag> {
        let bytes = self.take(8)?;
        let mut fields = Fields::new(&bytes, self.big);
        let first = fields.u32()?;
        if first >> 16 > 0 {
            let length = first >> 16;
            return match fields.rest().get(..length as usize) {
                Some(short) => Ok(Tag {
                    kind: first & 0xffff,
                    length: u64::from(length),
                    short: Some(short.to_vec()),
                }),
                None => broken("a short element of it is longer than 4 bytes"),
            };
        }
        let length = u64::from(fields.u32()?);
        Ok(Tag {
            kind: first,
            length,
            short: None,
        })
    }

    /// The data of a small element.
    fn small(&mut self) -> Read<Vec<u8>> {
        let tag = self.tag()?;
        if let Some(short) = tag.short {
            return Ok(short);
        }
        if tag.length > MAX_NAMES {
            return broken(format!(
                "a name or a list of sizes in it has {} bytes",
                tag.length
            ));
        }
        let bytes = self.take(tag.length)?;
        self.pass(padding(tag.length))?;
        Ok(bytes)
    }
}

/// The bytes behind an element that make its length a multiple of 8.
fn padding(length: u64) -> u64 {
    length.wrapping_neg() & 7
}

/// The arrays of a file while it is read.
#[derive(Default)]
struct Reader {
    arrays: Vec<Array>,
    places: Vec<Place>,
    unread: Vec<(String, String)>,
    /// The arrays of arrays of the present variable.
    parts: usize,
}

impl Reader {
    fn leave(&mut self, name: String, why: &str) -> Read<()> {
        self.unread.push((name, why.to_owned()));
        require_few(self.unread.len())
    }

    /// Reads the next array, with its tag.
    ///
    /// - `name`: its path; that in the file if there is none.
    fn matrix(
        &mut self,
        content: &mut Content<'_>,
        variable: (u64, u64, bool),
        name: Option<String>,
        depth: usize,
    ) -> Read<()> {
        let tag = content.tag()?;
        if tag.kind != MATRIX {
            return broken(format!(
                "it has an element of type {} in place of an array",
                tag.kind
            ));
        }
        if tag.length == 0 {
            return Ok(());
        }
        self.parts += 1;
        if self.parts > MAX_PARTS || depth > MAX_DEPTH {
            return refused(format!(
                "a variable has more than {MAX_PARTS} arrays in structs and cells, or more than \
                 {MAX_DEPTH} in each other: save the log as plain arrays"
            ));
        }
        let end = content.place.saturating_add(tag.length);
        let flags = content.small()?;
        let class = Fields::new(&flags, content.big).u32()?;
        let (class, complex) = (class & 0xff, class & 0x800 != 0);
        if class == 17 {
            // objects have their name in place of the sizes
            let own = text(&content.small()?);
            self.leave(
                name.unwrap_or(own),
                "it is an object of MATLAB, such as a table or a timeseries: save its numbers as plain \
                 arrays, such as `q = out.q.Data; t = out.q.Time`",
            )?;
            return skip_to(content, end);
        }
        let sizes = content.small()?;
        let mut sizes_of = Fields::new(&sizes, content.big);
        let mut shape = Vec::new();
        while !sizes_of.rest().is_empty() {
            shape.push(u64::from(sizes_of.u32()?));
        }
        let own = text(&content.small()?);
        let name = name.unwrap_or(own);
        let count = shape.iter().try_fold(1_u64, |all, n| all.checked_mul(*n));
        match class {
            6..=15 if complex => self.leave(name, "it has complex numbers")?,
            6..=15 => {
                let tag = content.tag()?;
                // few numbers are in the tag, behind its first 4 bytes
                let start = match tag.short {
                    Some(_) => content.place - 4,
                    None => content.place,
                };
                let Some(stored) = stored(tag.kind, content.big) else {
                    return broken(format!("{name} has numbers of type {}", tag.kind));
                };
                let bytes = count.and_then(|count| count.checked_mul(stored.size as u64));
                if bytes != Some(tag.length) {
                    return broken(format!(
                        "{name} has {} bytes for {shape:?} numbers",
                        tag.length
                    ));
                }
                self.arrays.push(Array {
                    columns_first: true,
                    place: self.places.len(),
                    ..Array::new(name, shape)
                });
                self.places.push(Place {
                    variable,
                    start,
                    length: tag.length,
                    stored,
                });
                require_few(self.places.len())?;
            }
            1 => {
                for k in 0..count.unwrap_or(u64::MAX) {
                    if content.place >= end {
                        return broken(format!("the cells of {name} end early"));
                    }
                    if k as usize == MAX_ELEMENTS {
                        self.leave(name, "it has too many cells")?;
                        break;
                    }
                    self.matrix(content, variable, Some(format!("{name}[{k}]")), depth + 1)?;
                }
            }
            2 | 3 => {
                if class == 3 {
                    content.small()?;
                }
                let length = content.small()?;
                let length = Fields::new(&length, content.big).u32()? as usize;
                let names = content.small()?;
                if length == 0 {
                    return broken(format!("the fields of {name} have no names"));
                }
                let names: Vec<String> = names.chunks(length).map(text).collect();
                for k in 0..count.unwrap_or(u64::MAX) {
                    if names.is_empty() || content.place >= end {
                        break;
                    }
                    if k as usize == MAX_ELEMENTS {
                        self.leave(name, "it has too many elements with fields")?;
                        break;
                    }
                    let path = match count {
                        Some(1) => name.clone(),
                        _ => format!("{name}[{k}]"),
                    };
                    for field in &names {
                        self.matrix(
                            content,
                            variable,
                            Some(format!("{path}.{field}")),
                            depth + 1,
                        )?;
                    }
                }
            }
            4 => self.leave(name, "it has text")?,
            5 => self.leave(name, "it is a sparse matrix: save `full` of it")?,
            _ => self.leave(name, "it is a function or an object of MATLAB, not numbers")?,
        }
        skip_to(content, end)
    }
}

/// Passes over the rest of an element.
fn skip_to(content: &mut Content<'_>, end: u64) -> Read<()> {
    match end.checked_sub(content.place) {
        Some(rest) => content.pass(rest),
        None => broken("an element of it is longer than the one that it is in"),
    }
}

/// Opens a file.
pub(crate) fn open(input: &mut Input, start: &[u8]) -> Read<Found> {
    let big = start.get(126) == Some(&b'M');
    let mut reader = Reader::default();
    let mut at = HEADER_BYTES;
    while at < input.len() {
        // some writers fill up the end
        let tag = input.up_to(at, 8)?;
        if tag.iter().all(|byte| *byte == 0) {
            break;
        }
        let mut fields = Fields::new(&tag, big);
        let (kind, length) = (fields.u32()?, u64::from(fields.u32()?));
        let begin = at + 8;
        at = begin.saturating_add(length);
        if at > input.len() {
            return broken(format!(
                "it is cut off: a variable ends at byte {at}, and the file at byte {}",
                input.len()
            ));
        }
        reader.parts = 0;
        let is_compressed = kind == COMPRESSED;
        // the tag of an array that is not compressed belongs to it
        let variable = match kind {
            COMPRESSED => (begin, length, true),
            MATRIX => (begin - 8, length + 8, false),
            other => {
                return broken(format!(
                    "it has an element of type {other} in place of a variable"
                ));
            }
        };
        let stream = input.stream(variable.0, variable.1)?;
        let stream: Box<dyn io::Read> = if is_compressed {
            Box::new(ZlibDecoder::new(stream))
        } else {
            Box::new(stream)
        };
        let mut content = Content {
            stream,
            place: 0,
            big,
        };
        reader.matrix(&mut content, variable, None, 0)?;
    }
    Ok(Found {
        arrays: reader.arrays,
        unread: reader.unread,
        container: Box::new(Mat(reader.places)),
    })
}
