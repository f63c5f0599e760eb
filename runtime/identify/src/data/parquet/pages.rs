//! Reads the pages of a Parquet file, after a check of the sizes in their headers.
//!
//! A page's header says how large the page is when decompressed, and how many values a
//! dictionary has; the library that decodes pages reserves that much. A few bytes could claim
//! gigabytes. The headers are therefore read here (`parquet.thrift` of the format's
//! specification, in Thrift's compact protocol), and pages are decompressed within their claims.
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

use parquet::basic::{Compression, Encoding};
use parquet::column::page::{Page, PageMetadata, PageReader};
use parquet::errors::ParquetError;
use parquet::file::metadata::ColumnChunkMetaData;

use super::decompress::decompressed;
use super::format::{BYTE, LIST, Root, STRUCTURE};

/// Longest header of a page in bytes: some numbers, and statistics of two values.
const MAX_HEADER_BYTES: u64 = 1 << 16;
/// Bytes of the smallest type of number.
const MIN_NUMBER_BYTES: i64 = 2;
/// Largest field number: readers count in 16 bits and may wrap around.
const MAX_FIELD_NUMBER: i64 = 1000;
/// Deepest nesting of structures; the format has eight.
const MAX_DEPTH: usize = 16;

/// The largest number of decompressed bytes per compressed one, and the number of bytes that any page
/// may have, however short it is.
fn limits(codec: Compression) -> (i64, i64) {
    match codec {
        // Snappy makes at most 64 bytes of 3
        Compression::UNCOMPRESSED | Compression::SNAPPY => (32, 1 << 10),
        // the others make a few bytes of a page of equal numbers
        _ => (100, 1 << 24),
    }
}

/// The pages of a column in a row group.
pub(super) struct Pages {
    file: File,
    codec: Compression,
    at: u64,
    end: u64,
}

impl Pages {
    /// - `size`: the length of the file, bytes.
    pub(super) fn new(file: File, size: u64, chunk: &ColumnChunkMetaData) -> Result<Self, String> {
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
        let (at, end) = bounds.ok_or("its pages lie outside the file")?;
        Ok(Self {
            file,
            codec: chunk.compression(),
            at,
            end,
        })
    }

    /// The number of values in all pages; an error if a page's header is implausible.
    pub(super) fn values(mut self) -> Result<u64, String> {
        let mut values = 0_u64;
        while let Some((header, body)) = self.header()? {
            self.at = body + header.length()?;
            values +=
                u64::try_from(header.values).map_err(|_| "a page claims less than no values")?;
        }
        Ok(values)
    }

    /// The next page's header, and the byte of the file behind it; `None` behind the last page.
    fn header(&mut self) -> Result<Option<(Header, u64)>, String> {
        let rest = self.end.saturating_sub(self.at);
        if rest == 0 {
            return Ok(None);
        }
        let bytes = self.bytes(self.at, MAX_HEADER_BYTES.min(rest))?;
        let (header, length) = Header::read(&bytes).ok_or("a page's header is broken")?;
        if header.length()? > rest - length {
            return Err("a page is longer than its column".to_owned());
        }
        let (ratio, small) = limits(self.codec);
        if !(0..=header.compressed * ratio + small).contains(&header.decompressed) {
            return Err(format!(
                "a page of {} bytes claims {} when decompressed",
                header.compressed, header.decompressed
            ));
        }
        if !(0..=header.decompressed / MIN_NUMBER_BYTES).contains(&header.dictionary) {
            return Err(format!(
                "a dictionary of {} bytes claims {} numbers",
                header.decompressed, header.dictionary
            ));
        }
        Ok(Some((header, self.at + length)))
    }

    fn bytes(&mut self, at: u64, count: u64) -> Result<Vec<u8>, String> {
        let mut bytes = Vec::new();
        let read = self.file.seek(SeekFrom::Start(at));
        let read = read.and_then(|_| (&mut self.file).take(count).read_to_end(&mut bytes));
        read.map_err(|error| format!("{error}"))?;
        Ok(bytes)
    }

    /// The next page of numbers or of a dictionary, and moves behind it.
    fn page(&mut self) -> Result<Option<Page>, String> {
        while let Some((header, body)) = self.header()? {
            let count = header.length()?;
            self.at = body + count;
            if ![DATA, DICTIONARY, SECOND_DATA].contains(&header.kind) {
                continue;
            }
            let bytes = self.bytes(body, count)?;
            if let Some(sum) = header.sum
                && sum.cast_unsigned() as u32 != crc32fast::hash(&bytes)
            {
                let why = format!(
                    "the check sum of the page at byte {body} is another one: it was damaged"
                );
                return Err(why);
            }
            return header.page(self.codec, &bytes).map(Some);
        }
        Ok(None)
    }
}

fn general(why: String) -> ParquetError {
    ParquetError::General(why)
}

impl Iterator for Pages {
    type Item = Result<Page, ParquetError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}

impl PageReader for Pages {
    fn get_next_page(&mut self) -> Result<Option<Page>, ParquetError> {
        self.page().map_err(general)
    }

    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>, ParquetError> {
        let found = self.header().map_err(general)?;
        let number = |value: i64| usize::try_from(value).ok();
        Ok(found.map(|(header, _)| PageMetadata {
            num_rows: number(header.rows).filter(|_| header.kind == SECOND_DATA),
            num_levels: number(header.values).filter(|_| header.kind != DICTIONARY),
            is_dict: header.kind == DICTIONARY,
        }))
    }

    fn skip_next_page(&mut self) -> Result<(), ParquetError> {
        if let Some((header, body)) = self.header().map_err(general)? {
            self.at = body + header.length().map_err(general)?;
        }
        Ok(())
    }
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

/// The kinds of pages that are read: of numbers, of version 1, of a dictionary, of numbers, of version 2.
const DATA: i64 = 0;
const DICTIONARY: i64 = 2;
const SECOND_DATA: i64 = 3;

/// A page's header.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Header {
    kind: i64,
    compressed: i64,
    decompressed: i64,
    /// The check sum of the compressed bytes.
    sum: Option<i64>,
    /// Number of values in a dictionary page.
    dictionary: i64,
    /// Number of values in a data page.
    values: i64,
    encoding: i64,
    /// The encodings of definition and repetition levels, of version 1.
    levels: [i64; 2],
    /// The lengths of definition and repetition levels, of version 2.
    lengths: [i64; 2],
    nulls: i64,
    rows: i64,
    /// Whether the values are left as they are, of version 2.
    plain: bool,
}

impl Header {
    /// Reads a header, and returns it with its length in bytes; `None` if it is invalid.
    fn read(bytes: &[u8]) -> Option<(Self, u64)> {
        let mut page = Self::default();
        let mut input = Compact {
            bytes,
            at: 0,
            root: Root::Page,
        };
        input.fields(&mut Vec::new(), &mut |path, value| match path {
            [1] => page.kind = value,
            [2] => page.decompressed = value,
            [3] => page.compressed = value,
            [4] => page.sum = Some(value),
            // data pages of versions 1 and 2
            [5 | 8, 1] => page.values = value,
            [5 | 7, 2] | [8, 4] => page.encoding = value,
            [5, 3] => page.levels[0] = value,
            [5, 4] => page.levels[1] = value,
            [8, 2] => page.nulls = value,
            [8, 3] => page.rows = value,
            [8, 5] => page.lengths[0] = value,
            [8, 6] => page.lengths[1] = value,
            [8, 7] => page.plain = value == 0,
            [7, 1] => page.dictionary = value,
            _ => {}
        })?;
        Some((page, u64::try_from(input.at).ok()?))
    }

    /// The number of bytes of the page behind its header.
    fn length(&self) -> Result<u64, String> {
        u64::try_from(self.compressed).map_err(|_| "a page claims less than no bytes".to_owned())
    }

    /// The page of these bytes.
    fn page(&self, codec: Compression, bytes: &[u8]) -> Result<Page, String> {
        let count = |value: i64| {
            let value = u32::try_from(value);
            value.map_err(|_| "a page's header claims less than nothing".to_owned())
        };
        // levels of version 2 are not compressed
        let [definitions, repetitions] = self.lengths;
        let (definitions, repetitions) = (count(definitions)?, count(repetitions)?);
        let before = usize::try_from(u64::from(definitions) + u64::from(repetitions));
        let before = before.unwrap_or(usize::MAX);
        let size = usize::try_from(self.decompressed).unwrap_or_default();
        let levels = bytes.get(..before).filter(|_| before <= size);
        let levels = levels.ok_or("the levels of a page are longer than the page")?;
        let values = &bytes[before..];
        let buf = match size - before {
            _ if self.plain => bytes.to_vec(),
            // of nulls only, for which some writers compress nothing and others an empty text
            0 => levels.to_vec(),
            rest if before == 0 => decompressed(codec, values, rest)?,
            rest => [levels, &decompressed(codec, values, rest)?].concat(),
        };
        let (buf, encoding) = (buf.into(), encoding(self.encoding)?);
        let num_values = count(self.values)?;
        Ok(match self.kind {
            DICTIONARY => Page::DictionaryPage {
                buf,
                num_values: count(self.dictionary)?,
                encoding,
                is_sorted: false,
            },
            DATA => Page::DataPage {
                buf,
                num_values,
                encoding,
                def_level_encoding: self::encoding(self.levels[0])?,
                rep_level_encoding: self::encoding(self.levels[1])?,
                statistics: None,
            },
            _ => Page::DataPageV2 {
                buf,
                num_values,
                encoding,
                num_nulls: count(self.nulls)?,
                num_rows: count(self.rows)?,
                def_levels_byte_len: definitions,
                rep_levels_byte_len: repetitions,
                is_compressed: !self.plain,
                statistics: None,
            },
        })
    }
}

/// An encoding by its number in the format.
fn encoding(number: i64) -> Result<Encoding, String> {
    Ok(match number {
        0 => Encoding::PLAIN,
        2 => Encoding::PLAIN_DICTIONARY,
        3 => Encoding::RLE,
        #[allow(deprecated, reason = "old writers name it where there are no levels")]
        4 => Encoding::BIT_PACKED,
        5 => Encoding::DELTA_BINARY_PACKED,
        6 => Encoding::DELTA_LENGTH_BYTE_ARRAY,
        7 => Encoding::DELTA_BYTE_ARRAY,
        8 => Encoding::RLE_DICTIONARY,
        9 => Encoding::BYTE_STREAM_SPLIT,
        other => return Err(format!("a page has the unknown encoding {other}")),
    })
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
            1 | 2 => visit(path, i64::from(kind == 1)),
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
    use std::sync::Arc;

    use parquet::basic::ZstdLevel;
    use parquet::schema::parser::parse_message_type;
    use parquet::schema::types::SchemaDescriptor;

    use super::*;

    #[test]
    fn a_header_is_read_with_the_fields_in_its_structures() {
        // type 0, 100 bytes, 40 compressed, data page {8 values, ...}, without a v2 header
        let bytes = [
            0x15, 0x00, 0x15, 0xc8, 0x01, 0x15, 0x50, 0x2c, 0x15, 0x10, 0x15, 0x00, 0x00, 0x00, 9,
        ];
        let page = Header {
            compressed: 40,
            decompressed: 100,
            values: 8,
            ..Header::default()
        };
        assert_eq!(Header::read(&bytes), Some((page, 14)));
        // a header that is cut anywhere is invalid
        for end in 0..14 {
            assert_eq!(Header::read(&bytes[..end]), None, "{end}");
        }
    }

    /// The outcome for a file of one page of 100 bytes that claims `size` when decompressed.
    fn claiming(size: u64, codec: Compression) -> Result<u64, String> {
        let mut bytes = vec![0x15, 0x00, 0x15];
        let mut rest = 2 * size;
        while rest > 0x7f {
            bytes.push(rest as u8 | 0x80);
            rest >>= 7;
        }
        bytes.extend([
            rest as u8, 0x15, 0xc8, 0x01, 0x2c, 0x15, 0x10, 0x15, 0, 0, 0,
        ]);
        bytes.extend([0; 100]);
        let length = bytes.len() as u64;
        let name = format!("regen-page-{}-{size}-{codec}", std::process::id());
        let path = std::env::temp_dir().join(name);
        std::fs::write(&path, bytes).unwrap();
        let schema = parse_message_type("message log { required double q; }").unwrap();
        let schema = SchemaDescriptor::new(Arc::new(schema));
        let chunk = ColumnChunkMetaData::builder(schema.column(0))
            .set_compression(codec)
            .set_total_compressed_size(length.cast_signed())
            .set_data_page_offset(0)
            .build()
            .unwrap();
        let pages = Pages::new(File::open(&path).unwrap(), length, &chunk);
        std::fs::remove_file(&path).unwrap();
        pages.and_then(Pages::values)
    }

    #[test]
    fn a_page_that_claims_more_than_its_bytes_can_give_is_refused() {
        let zstd = Compression::ZSTD(ZstdLevel::default());
        for (size, codec, fits) in [
            (3000, Compression::SNAPPY, true),
            (5000, Compression::SNAPPY, false),
            (1 << 24, zstd, true),
            (1 << 25, zstd, false),
            (1 << 40, Compression::LZ4_RAW, false),
        ] {
            let found = claiming(size, codec);
            assert_eq!(found.is_ok(), fits, "{size} {codec}: {found:?}");
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
        assert_eq!(Header::read(&[&[0xcc][..], &[0x1c; 100]].concat()), None);
        assert_eq!(Header::read(&[&[0x15][..], &[0xff; 100]].concat()), None);
        let long = [0x18, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x7f, 0];
        assert_eq!(Header::read(&long), None);
    }
}
