//! MAT files of level 5, as MATLAB writes them by `save -v6` and `-v7`, and SciPy.

use std::io;

use flate2::read::ZlibDecoder;

use crate::array::{Array, Container, Found, require_few};
use crate::error::{Read, broken, refused};
use crate::input::{Fields, Input, exactly, pass, text};
use crate::number::{Kind, Stored, index, of_records};

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
/// The most numbers of all sparse matrices of a file, which are filled with zeros: 64 MB.
pub(crate) const MAX_FILLED: u64 = 1 << 23;

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
    /// The rows and columns of a sparse matrix, of which `start` is the list of rows.
    sparse: Option<[u64; 2]>,
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
        if let Some(shape) = own.sparse {
            let mut stream = stream(input, own.variable)?;
            pass(&mut stream, own.start)?;
            return Content {
                stream,
                place: own.start,
                big: own.stored.big,
            }
            .sparse(shape);
        }
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
        Ok(self.element(MAX_NAMES)?.1)
    }

    /// The type and the data of an element of at most so many bytes.
    fn element(&mut self, most: u64) -> Read<(u32, Vec<u8>)> {
        let tag = self.tag()?;
        if let Some(short) = tag.short {
            return Ok((tag.kind, short));
        }
        if tag.length > most {
            return broken(format!(
                "a name or a list of sizes in it has {} bytes",
                tag.length
            ));
        }
        let bytes = self.take(tag.length)?;
        self.pass(padding(tag.length))?;
        Ok((tag.kind, bytes))
    }

    /// The numbers of a sparse matrix: the row of each entry, the number of entries before each column, the entries.
    fn sparse(&mut self, shape: [u64; 2]) -> Read<Vec<f64>> {
        let most = 8 * MAX_FILLED;
        let list = |content: &mut Self| -> Read<Vec<f64>> {
            let (kind, bytes) = content.element(most)?;
            match stored(kind, content.big) {
                Some(stored) => of_records(&bytes, stored.size, 0, stored),
                None => broken(format!("a sparse matrix of it has numbers of type {kind}")),
            }
        };
        let (rows, before, values) = (list(self)?, list(self)?, list(self)?);
        let mut places = Vec::new();
        for (j, ends) in before.windows(2).enumerate() {
            if let [from, to] = ends {
                // what is negative or no number becomes 0
                let count = index(to - from) as usize;
                if count > values.len() - places.len() {
                    return broken("a sparse matrix of it has numbers outside of it");
                }
                places.extend(std::iter::repeat_n(j as u64, count));
            }
        }
        if places.len() > rows.len() {
            return broken("a sparse matrix of it has fewer rows than numbers");
        }
        let entries = rows.iter().zip(places).zip(values);
        filled(shape, entries.map(|((i, j), value)| (index(*i), j, value)))
    }
}

/// Takes the numbers of a sparse matrix, zeros included, from those that a file may still have; why not, if there
/// are too many.
pub(crate) fn take_filled(shape: &[u64], left: &mut u64) -> Option<String> {
    let count = shape.iter().try_fold(1_u64, |all, n| all.checked_mul(*n));
    match count.and_then(|count| left.checked_sub(count)) {
        Some(rest) => *left = rest,
        None => {
            return Some(format!(
                "it is a sparse matrix of {shape:?} numbers, and those of a file may have {MAX_FILLED}, zeros \
                 included: save `full` of the columns of the log"
            ));
        }
    }
    None
}

/// The numbers of a sparse matrix by columns, with zeros where it has no entry.
///
/// - `entries`: row and column from 0, and the number.
pub(crate) fn filled(
    [rows, columns]: [u64; 2],
    entries: impl Iterator<Item = (u64, u64, f64)>,
) -> Read<Vec<f64>> {
    let count = rows.saturating_mul(columns);
    let mut out = vec![0.0; count.min(MAX_FILLED) as usize];
    for (i, j, value) in entries {
        let inside = i < rows && j < columns;
        let place = j.saturating_mul(rows).saturating_add(i);
        match out.get_mut(place as usize).filter(|_| inside) {
            Some(own) => *own = value,
            None => return broken("a sparse matrix of it has numbers outside of it"),
        }
    }
    Ok(out)
}

/// The content of a variable, decompressed.
fn stream(
    input: &mut Input,
    (at, length, compressed): (u64, u64, bool),
) -> Read<Box<dyn io::Read + '_>> {
    let stream = input.stream(at, length)?;
    Ok(if compressed {
        Box::new(ZlibDecoder::new(stream))
    } else {
        Box::new(stream)
    })
}

/// The bytes behind an element that make its length a multiple of 8.
fn padding(length: u64) -> u64 {
    length.wrapping_neg() & 7
}

/// The arrays of a file while it is read.
struct Reader {
    arrays: Vec<Array>,
    places: Vec<Place>,
    unread: Vec<(String, String)>,
    /// The arrays of arrays of the present variable.
    parts: usize,
    /// The numbers that sparse matrices may still have.
    left: u64,
}

impl Reader {
    fn leave(&mut self, name: String, why: &str) -> Read<()> {
        self.unread.push((name, why.to_owned()));
        require_few(self.unread.len())
    }

    /// Keeps an array whose numbers are at a place.
    fn keep(&mut self, array: Array, place: Place) -> Read<()> {
        self.arrays.push(Array {
            columns_first: true,
            place: self.places.len(),
            ..array
        });
        self.places.push(place);
        require_few(self.places.len())
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
        if depth == 0 && name.is_empty() {
            // what objects of MATLAB consist of
            return skip_to(content, end);
        }
        match class {
            5..=15 if complex => self.leave(name, "it has complex numbers")?,
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
                let length = tag.length;
                let sparse = None;
                let place = Place {
                    variable,
                    start,
                    length,
                    stored,
                    sparse,
                };
                self.keep(Array::new(name, shape), place)?;
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
            5 => {
                let (Ok(sparse), Some(stored)) = (
                    <[u64; 2]>::try_from(shape.as_slice()),
                    stored(9, content.big),
                ) else {
                    return broken(format!("{name} is a sparse matrix of {} axes", shape.len()));
                };
                if let Some(why) = take_filled(&shape, &mut self.left) {
                    self.leave(name, &why)?;
                    return skip_to(content, end);
                }
                let (start, length) = (content.place, 0);
                let sparse = Some(sparse);
                let place = Place {
                    variable,
                    start,
                    length,
                    stored,
                    sparse,
                };
                self.keep(Array::new(name, shape), place)?;
            }
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
    let mut reader = Reader {
        arrays: Vec::new(),
        places: Vec::new(),
        unread: Vec::new(),
        parts: 0,
        left: MAX_FILLED,
    };
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
        let mut content = Content {
            stream: stream(input, variable)?,
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
