//! Checks the sizes in a Parquet file's page headers before memory is reserved for them.
//!
//! A page's header says how large the page is when decompressed, and how many values a
//! dictionary has; the library that decodes pages reserves that much. A few bytes could claim
//! gigabytes. The headers are therefore read here first (`parquet.thrift` of the format's
//! specification, in Thrift's compact protocol), without their pages.
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

use parquet::file::metadata::ColumnChunkMetaData;

use super::format::{BYTE, LIST, Root, STRUCTURE};

/// Longest header of a page in bytes: some numbers, and statistics of two values.
const MAX_HEADER_BYTES: u64 = 1 << 16;
/// The largest number of decompressed bytes per compressed one: Snappy makes at most 64 bytes of 3.
const MAX_COMPRESSION_RATIO: i64 = 32;
/// Decompressed bytes that any page may have, however short it is.
const SMALL_PAGE_BYTES: i64 = 1 << 10;
/// Bytes of the smallest type of number.
const MIN_NUMBER_BYTES: i64 = 4;
/// Largest field number: readers count in 16 bits and may wrap around.
const MAX_FIELD_NUMBER: i64 = 1000;
/// Deepest nesting of structures; the format has eight.
const MAX_DEPTH: usize = 16;

/// The number of values in the pages of a column; an error if a page's header is implausible.
pub(super) fn values(
    file: &mut File,
    size: u64,
    chunk: &ColumnChunkMetaData,
) -> Result<u64, String> {
    let first = chunk
        .dictionary_page_offset()
        .map_or(chunk.data_page_offset(), |offset| {
            offset.min(chunk.data_page_offset())
        });
    let bounds = u64::try_from(first)
        .ok()
        .zip(u64::try_from(chunk.compressed_size()).ok())
        .and_then(|(start, length)| Some((start, start.checked_add(length)?)))
        .filter(|(_, end)| *end <= size);
    let Some((mut at, end)) = bounds else {
        return Err("its pages lie outside the file".to_owned());
    };
    let mut values = 0_u64;
    let mut bytes = Vec::new();
    while at < end {
        bytes.clear();
        let read = file.seek(SeekFrom::Start(at)).and_then(|_| {
            file.take(MAX_HEADER_BYTES.min(end - at))
                .read_to_end(&mut bytes)
        });
        read.map_err(|error| format!("{error}"))?;
        let (page, length) = Page::read(&bytes).ok_or("a page's header is broken")?;
        at += length;
        let body = u64::try_from(page.compressed).ok();
        let Some(body) = body.filter(|body| *body <= end - at) else {
            return Err("a page is longer than its column".to_owned());
        };
        at += body;
        if !(0..=page.compressed * MAX_COMPRESSION_RATIO + SMALL_PAGE_BYTES)
            .contains(&page.decompressed)
        {
            return Err(format!(
                "a page of {} bytes claims {} when decompressed",
                page.compressed, page.decompressed
            ));
        }
        if !(0..=page.decompressed / MIN_NUMBER_BYTES).contains(&page.dictionary) {
            return Err(format!(
                "a dictionary of {} bytes claims {} numbers",
                page.decompressed, page.dictionary
            ));
        }
        values += u64::try_from(page.values).map_err(|_| "a page claims less than no values")?;
    }
    Ok(values)
}

/// How deep groups of columns are nested; `None` if the bytes are not a valid footer.
///
/// The library builds and drops the tree of groups by recursion, and it skips the elements of
/// unknown fields without checking that they exist.
pub(super) fn nesting(footer: &[u8]) -> Option<usize> {
    let mut input = Compact {
        bytes: footer,
        at: 0,
        root: Root::Footer,
    };
    // number of children still to be read of each open group, from the root inwards
    let mut open: Vec<i64> = Vec::new();
    let mut deepest = 0;
    let mut children = 0;
    input.fields(&mut Vec::new(), &mut |path, value| match path {
        // schema elements, each group before its children
        [2, 5] => children = value,
        [2, END] => {
            while open.last().is_some_and(|unread| *unread <= 0) {
                open.pop();
            }
            if let Some(unread) = open.last_mut() {
                *unread -= 1;
            }
            if children > 0 {
                open.push(children);
            }
            children = 0;
            deepest = deepest.max(open.len());
        }
        _ => {}
    })?;
    Some(deepest)
}

/// The sizes in a page's header.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Page {
    compressed: i64,
    decompressed: i64,
    /// Number of values in a dictionary page.
    dictionary: i64,
    /// Number of values in a data page.
    values: i64,
}

impl Page {
    /// Reads a header, and returns it with its length in bytes; `None` if it is invalid.
    fn read(bytes: &[u8]) -> Option<(Self, u64)> {
        let mut page = Self::default();
        let mut input = Compact {
            bytes,
            at: 0,
            root: Root::Page,
        };
        input.fields(&mut Vec::new(), &mut |path, value| match path {
            [2] => page.decompressed = value,
            [3] => page.compressed = value,
            // data pages of versions 1 and 2
            [5 | 8, 1] => page.values = value,
            [7, 1] => page.dictionary = value,
            _ => {}
        })?;
        Some((page, u64::try_from(input.at).ok()?))
    }
}

/// Marks the end of a structure in a path of field numbers, which are never negative.
const END: i64 = -1;

/// Reader of Thrift's compact protocol: every integer is a varint, every structure a list of
/// fields that ends with 0.
struct Compact<'a> {
    bytes: &'a [u8],
    at: usize,
    root: Root,
}

impl Compact<'_> {
    fn byte(&mut self) -> Option<u8> {
        let byte = self.bytes.get(self.at).copied();
        self.at += 1;
        byte
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0_u64;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    /// Reads a signed integer in zigzag encoding: 0, -1, 1, -2, ...
    fn integer(&mut self) -> Option<i64> {
        let value = self.varint()?;
        Some((value >> 1).cast_signed() ^ -(value & 1).cast_signed())
    }

    fn skip(&mut self, count: u64) -> Option<()> {
        let at = self.at.checked_add(usize::try_from(count).ok()?)?;
        (at <= self.bytes.len()).then(|| self.at = at)
    }

    /// Reads the head of a list: the type and the number of its elements.
    fn list(&mut self) -> Option<(u8, u64)> {
        let head = self.byte()?;
        let count = match head >> 4 {
            15 => self.varint()?,
            count => u64::from(count),
        };
        let remaining = self.bytes.len().saturating_sub(self.at) as u64;
        let kind = head & 0x0f;
        // An element has a byte or more. The format has no lists of booleans, which some readers
        // take to have no bytes, and no lists of lists, which could be nested without end.
        let known = (BYTE..LIST).contains(&kind) || kind == STRUCTURE;
        (count == 0 || (known && count <= remaining)).then_some((kind, count))
    }

    /// Reads a structure and calls `visit` with the path of field numbers and the value of each of
    /// its integers, and at its end.
    fn fields(&mut self, path: &mut Vec<i64>, visit: &mut dyn FnMut(&[i64], i64)) -> Option<()> {
        if path.len() >= MAX_DEPTH {
            return None;
        }
        let mut field = 0_i64;
        loop {
            let head = self.byte()?;
            let kind = head & 0x0f;
            if kind == 0 {
                path.push(END);
                visit(path, 0);
                path.pop();
                return Some(());
            }
            field = match head >> 4 {
                0 => self.integer()?,
                step => field.checked_add(i64::from(step))?,
            };
            path.push(field);
            if !(0..=MAX_FIELD_NUMBER).contains(&field) || !self.root.fits(path, kind) {
                return None;
            }
            self.value(kind, path, visit)?;
            path.pop();
        }
    }

    fn value(
        &mut self,
        kind: u8,
        path: &mut Vec<i64>,
        visit: &mut dyn FnMut(&[i64], i64),
    ) -> Option<()> {
        match kind {
            // the value of a boolean is its type
            1 | 2 => {}
            3 => drop(self.byte()?),
            4..=6 => {
                let value = self.integer()?;
                visit(path, value);
            }
            7 => self.skip(8)?,
            8 => {
                let length = self.varint()?;
                self.skip(length)?;
            }
            12 => self.fields(path, visit)?,
            LIST | 10 => {
                let (kind, count) = self.list()?;
                if count > 0 && !self.root.fits_elements(path, kind) {
                    return None;
                }
                for _ in 0..count {
                    self.value(kind, path, visit)?;
                }
            }
            // the format has no maps
            _ => return None,
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {

    use super::*;

    #[test]
    fn a_header_is_read_with_the_fields_in_its_structures() {
        // type 0, 100 bytes, 40 compressed, data page {8 values, ...}, without a v2 header
        let bytes = [
            0x15, 0x00, 0x15, 0xc8, 0x01, 0x15, 0x50, 0x2c, 0x15, 0x10, 0x15, 0x00, 0x00, 0x00, 9,
        ];
        let page = Page {
            compressed: 40,
            decompressed: 100,
            dictionary: 0,
            values: 8,
        };
        assert_eq!(Page::read(&bytes), Some((page, 14)));
        // a header that is cut anywhere is invalid
        for end in 0..14 {
            assert_eq!(Page::read(&bytes[..end]), None, "{end}");
        }
    }

    #[test]
    fn groups_in_groups_are_counted() {
        // version 1; schema: a root of two children, a group of one, a number in it, a number
        let element = |children: u8| -> Vec<u8> {
            match children {
                0 => vec![0x15, 0x0a, 0x38, 1, b'x', 0],
                n => vec![0x48, 1, b'x', 0x15, 2 * n, 0],
            }
        };
        let elements = [element(2), element(1), element(0), element(0)].concat();
        let footer = [&[0x15, 2, 0x19, 0x4c][..], &elements, &[0x16, 20, 0]].concat();
        assert_eq!(nesting(&footer), Some(2));
        assert_eq!(nesting(&footer[..footer.len() - 3]), None);
        let chain = [
            &[0x15, 2, 0x19, 0xfc, 100][..],
            &element(1).repeat(100),
            &[0],
        ]
        .concat();
        assert_eq!(nesting(&chain), Some(100));
        // an unknown field with billions of booleans
        let bomb = [0xf9, 0xf1, 0xff, 0xff, 0xff, 0xff, 0x07, 0];
        let footer = [&footer[..footer.len() - 1], &bomb].concat();
        assert_eq!(nesting(&footer), None);
    }

    #[test]
    fn a_header_that_does_not_end_is_invalid() {
        // structures in structures, a varint without end, a text longer than the file
        assert_eq!(Page::read(&[&[0xcc][..], &[0x1c; 100]].concat()), None);
        assert_eq!(Page::read(&[&[0x15][..], &[0xff; 100]].concat()), None);
        let long = [0x18, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x7f, 0];
        assert_eq!(Page::read(&long), None);
    }
}
