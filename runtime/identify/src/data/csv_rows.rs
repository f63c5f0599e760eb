//! Reads the rows of a CSV file one after another.
//!
//! Rows without quotation marks and carriage returns are divided here, as fast as numbers can be
//! read; from the first other one on, the library that knows all of CSV reads the file.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::sync::Arc;

use csv::{ByteRecord, Reader};

use super::file_rows::{FileRow, RowFault, Table, Wanted, failed, shortened};
use super::lines::{Limited, Lines, Place};
use super::problem::{DataError, Fault};
use super::table::{COMMENT, Separator, Written};

/// The rows of a CSV file.
pub(super) struct CsvRows<'a> {
    table: &'a Table,
    written: &'a Written,
    file: Arc<File>,
    records: Records,
    last_column: LastColumn,
    wanted: Vec<Wanted>,
    /// The memory of a row that has been used.
    spare: Vec<f64>,
}

/// The rest of a file, divided into rows.
enum Records {
    /// Lines, each of which is a row.
    Plain {
        lines: Lines<Arc<File>>,
        /// The entries of the present line.
        entries: Vec<Entry>,
    },
    /// Rows of any kind, by the library.
    Any {
        reader: Box<Reader<Limited<Arc<File>>>>,
        record: ByteRecord,
        /// The place where the library began.
        start: Place,
    },
}

/// An entry of a line.
#[derive(Clone, Copy, Debug)]
struct Entry {
    /// Its end in the line.
    end: usize,
    /// Its number; `None` if it is not of the usual kind that is read at once.
    number: Option<f64>,
}

impl<'a> CsvRows<'a> {
    /// The rows behind the header.
    pub(super) fn open(
        table: &'a Table,
        written: &'a Written,
        file: Arc<File>,
        wanted: Vec<Wanted>,
    ) -> Result<Self, DataError> {
        let open = || -> Result<Records, csv::Error> {
            let mut start = written.start();
            let from = |place: Place| at(&file, place);
            if let Some(first) = written.behind_units {
                start = first;
            } else if written.has_header() && written.separator() == Separator::Blank {
                let mut lines = Lines::new(from(start)?, start);
                while let Some((line, place)) = lines.next_line()? {
                    start = place;
                    // the names may stand in a comment of MATLAB
                    if !is_passed_over(line, written.separator(), COMMENT) {
                        break;
                    }
                }
            } else if written.has_header() {
                let mut reader = written.header_reader(from(start)?);
                reader.byte_headers()?;
                let length = reader.position().byte();
                // the library does not count empty lines, and leaves the second byte of an end of
                // line to the next row
                let mut names = Vec::new();
                from(start)?.take(length + 1).read_to_end(&mut names)?;
                if !names.ends_with(b"\r\n") {
                    names.truncate(usize::try_from(length).unwrap_or(usize::MAX));
                }
                start.byte += names.len() as u64;
                start.line += memchr::memchr_iter(b'\n', &names).count() as u64;
            }
            Ok(Records::Plain {
                lines: Lines::new(from(start)?, start),
                entries: Vec::new(),
            })
        };
        Ok(Self {
            table,
            written,
            records: open().map_err(|error| failed(&table.path, &error))?,
            file,
            last_column: LastColumn::default(),
            wanted,
            spare: Vec::new(),
        })
    }

    /// Takes the memory of a row back, for the next one.
    pub(super) fn reuse(&mut self, values: Vec<f64>) {
        self.spare = values;
    }

    /// The next row; `None` behind the last one.
    pub(super) fn next_row(&mut self) -> Result<Option<FileRow>, DataError> {
        let failed = |error: csv::Error| failed(&self.table.path, &error);
        let expected = self.table.titles.len();
        if let Records::Plain { lines, entries } = &mut self.records {
            // as in the library, the comments before a row are its first lines
            let start = lines.place();
            let before = start.byte;
            loop {
                let (line, place) = match lines.next_line() {
                    Ok(Some(found)) => found,
                    Ok(None) => return Ok(None),
                    Err(why) => return Err(failed(why.into())),
                };
                if is_passed_over(line, self.written.separator(), self.written.comment()) {
                    continue;
                }
                let is_blank = self.written.separator() == Separator::Blank;
                let marked = before == 0 && line.starts_with(BYTE_ORDER_MARK);
                let line = match line.strip_prefix(BYTE_ORDER_MARK) {
                    Some(rest) if marked && is_blank => rest,
                    _ => line,
                };
                let marked = marked && !is_blank;
                if marked || !divide(line, self.written, entries) {
                    break;
                }
                let count = entries.len();
                let entry = |column: usize| {
                    let begin = match column.checked_sub(1) {
                        Some(previous) => entries.get(previous)?.end + 1,
                        None => 0,
                    };
                    line.get(begin..entries.get(column)?.end)
                };
                let number = |column: usize| entries.get(column)?.number;
                let spare = core::mem::take(&mut self.spare);
                let (wanted, written) = (&self.wanted, self.written);
                let counts = [expected, count];
                let mut row = numbers(start.line, wanted, written, counts, entry, number, spare);
                let last = count.checked_sub(1).and_then(entry).unwrap_or_default();
                if self.last_column.is_cut(last, self.table, place.byte) {
                    row.refuse(self.table.cut_problem(last));
                }
                return Ok(Some(row));
            }
            self.records = self.all_from(start).map_err(|why| failed(why.into()))?;
        }
        let Records::Any {
            reader,
            record,
            start,
        } = &mut self.records
        else {
            return Ok(None);
        };
        let first = start.line + reader.position().line() - 1;
        reader.get_mut().renew(first);
        if !reader.read_byte_record(record).map_err(failed)? {
            return Ok(None);
        }
        let position = record.position();
        let line = start.line + position.map_or(1, csv::Position::line) - 1;
        let end = start.byte + reader.position().byte();
        let entry = |column: usize| record.get(column);
        let counts = [expected, record.len()];
        let spare = core::mem::take(&mut self.spare);
        let (wanted, written) = (&self.wanted, self.written);
        let mut row = numbers(line, wanted, written, counts, entry, |_| None, spare);
        let last = record.iter().next_back().unwrap_or_default();
        if self.last_column.is_cut(last, self.table, end) {
            row.refuse(self.table.cut_problem(last));
        }
        Ok(Some(row))
    }

    /// All that follows a place at the beginning of a line, divided by the library.
    fn all_from(&self, start: Place) -> io::Result<Records> {
        Ok(Records::Any {
            reader: Box::new(self.written.reader(at(&self.file, start)?)),
            record: ByteRecord::new(),
            start,
        })
    }
}

/// The file, to be read from a place on.
fn at(file: &Arc<File>, place: Place) -> io::Result<Arc<File>> {
    file.as_ref().seek(SeekFrom::Start(place.byte))?;
    Ok(Arc::clone(file))
}

impl FileRow {
    /// Refuses the whole row, unless an entry is refused already.
    fn refuse(&mut self, why: Fault) {
        if self.faults.is_empty() {
            self.faults.push(RowFault { column: None, why });
        }
    }
}

/// What some programs write at the beginning of a text in UTF-8.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Whether a line is empty or a comment.
fn is_passed_over(line: &[u8], separator: Separator, comment: u8) -> bool {
    let line = match separator {
        Separator::Blank => line.trim_ascii(),
        _ => line,
    };
    line.is_empty() || line.first() == Some(&comment)
}

/// Divides a line at its blanks. An entry has those before it.
fn divide_at_blanks(line: &[u8], written: &Written, entries: &mut Vec<Entry>) {
    entries.clear();
    let mut begin = 0;
    loop {
        let rest = line.get(begin..).unwrap_or_default();
        let Some(blanks) = rest.iter().position(|byte| !byte.is_ascii_whitespace()) else {
            return;
        };
        begin += blanks;
        let rest = rest.get(blanks..).unwrap_or_default();
        let (number, length) = if let Some((number, length)) = written.leading_number(rest) {
            (Some(number), length)
        } else {
            let end = rest.iter().position(u8::is_ascii_whitespace);
            (None, end.unwrap_or(rest.len()))
        };
        begin += length;
        entries.push(Entry { end: begin, number });
    }
}

/// Divides a line at the separators; false if it may be divided otherwise, or is no whole row.
fn divide(line: &[u8], written: &Written, entries: &mut Vec<Entry>) -> bool {
    if written.separator() == Separator::Blank {
        divide_at_blanks(line, written, entries);
        return true;
    }
    let separator = written.separator().byte();
    entries.clear();
    let mut begin = 0;
    loop {
        let rest = line.get(begin..).unwrap_or_default();
        let (number, length) = if let Some((number, length)) = written.leading_number(rest) {
            (Some(number), length)
        } else {
            let length = memchr::memchr(separator, rest).unwrap_or(rest.len());
            let entry = rest.get(..length).unwrap_or_default();
            if memchr::memchr2(b'"', b'\r', entry).is_some() {
                return false;
            }
            (None, length)
        };
        let end = begin + length;
        entries.push(Entry { end, number });
        if end >= line.len() {
            return true;
        }
        begin = end + 1;
    }
}

/// A row with the numbers of the wanted columns.
///
/// - `counts`: the number of columns, and that of entries of this row;
/// - `entry`: the bytes of an entry; `number`: its number, where it is known;
/// - `values`: filled with the numbers.
fn numbers<'e>(
    line: u64,
    wanted: &[Wanted],
    written: &Written,
    [expected, found]: [usize; 2],
    entry: impl Fn(usize) -> Option<&'e [u8]>,
    number: impl Fn(usize) -> Option<f64>,
    values: Vec<f64>,
) -> FileRow {
    // some programs end each row, but not the header, with a separator
    let is_blank = |entry: &[u8]| entry.trim_ascii().is_empty();
    let ends_blank = found == expected + 1 && entry(expected).is_some_and(is_blank);
    if found != expected && !ends_blank {
        let why = Fault::Entries { found, expected };
        return FileRow {
            line,
            values: Vec::new(),
            faults: vec![RowFault { column: None, why }],
        };
    }
    let entries = wanted.iter().map(|wanted| {
        if let Some(value) = number(wanted.column) {
            return Ok(value);
        }
        let entry = entry(wanted.column).unwrap_or_default();
        match written.number(entry) {
            Some(value) if value.is_finite() => Ok(value),
            _ => {
                let text = core::str::from_utf8(entry).unwrap_or("?");
                Err(shortened(text.trim()))
            }
        }
    });
    FileRow::new(line, wanted, entries, values)
}

/// Least number of rows before a last line without an end of line that show the usual length of
/// its last entry.
const MIN_ROWS_BEFORE_CUT: usize = 20;

/// The lengths of the last entries of the rows so far.
#[derive(Default)]
struct LastColumn {
    /// The number of rows.
    rows: usize,
    /// The length of the shortest last entry, bytes.
    shortest: usize,
}

impl LastColumn {
    /// Whether a row without an end of line has a last entry that is shorter than all before it;
    /// takes that entry up into the lengths.
    ///
    /// - `end`: the number of bytes of the file up to the end of the row.
    fn is_cut(&mut self, last: &[u8], table: &Table, end: u64) -> bool {
        let is_unended_line = table.unended_length.is_some_and(|length| end >= length);
        let enough = self.rows >= MIN_ROWS_BEFORE_CUT;
        let is_cut = is_unended_line && enough && last.len() < self.shortest;
        self.shortest = match self.rows {
            0 => last.len(),
            _ => self.shortest.min(last.len()),
        };
        self.rows += 1;
        is_cut
    }
}

impl Table {
    /// The fault of a last row that is cut off within an entry.
    fn cut_problem(&self, last: &[u8]) -> Fault {
        Fault::Cut {
            column: self.titles.last().cloned().unwrap_or_default(),
            text: shortened(&String::from_utf8_lossy(last)),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::data::file_rows::Opening;
    use crate::data::table::Format;

    /// All rows of a text, divided here as far as it can be, and divided by the library.
    fn both_ways(text: &str) -> [Vec<FileRow>; 2] {
        let thread = std::thread::current().id();
        let name = format!("regen-rows-{}-{thread:?}", std::process::id());
        let path = std::env::temp_dir().join(name);
        std::fs::write(&path, text).unwrap();
        let table = Opening::default().tables(&path).unwrap().remove(0);
        let file = Arc::new(std::fs::File::open(&path).unwrap());
        let written = Written::find(&file, Format::default()).unwrap();
        let wanted = |column| Wanted {
            column,
            title: column.to_string(),
        };
        let found = [false, true].map(|by_library| {
            let wanted = vec![wanted(1), wanted(0)];
            let mut rows = CsvRows::open(&table, &written, Arc::clone(&file), wanted).unwrap();
            if by_library && let Records::Plain { lines, .. } = &rows.records {
                rows.records = rows.all_from(lines.place()).unwrap();
            }
            core::iter::from_fn(|| rows.next_row().unwrap()).collect()
        });
        std::fs::remove_file(&path).unwrap();
        found
    }

    #[test]
    fn rows_behind_a_quotation_mark_or_a_carriage_return_are_read_too() {
        for text in [
            "a,b\n1,2\n3,4\n",
            "# c\n1,2\n\n#\n3,4",
            "1,2\n\"3\",4\n",
            "1,2\r\n3,4\r\n",
            "1,2\n3,\"4\"\r\n",
            "a,b\n1,2,\n3,4, \n",
        ] {
            for rows in both_ways(text) {
                assert!(rows.iter().all(|row| row.faults.is_empty()), "{text}");
                let values: Vec<_> = rows.into_iter().map(|row| row.values).collect();
                assert_eq!(values, [[2.0, 1.0], [4.0, 3.0]], "{text}");
            }
        }
    }

    /// The numbers of all rows of a text, each with its line.
    fn read(text: &str) -> Vec<(u64, Vec<f64>)> {
        let path = std::env::temp_dir().join(format!(
            "regen-read-{}-{:?}",
            std::process::id(),
            std::thread::current().id()
        ));
        std::fs::write(&path, text).unwrap();
        let table = Opening::default().tables(&path).unwrap().remove(0);
        let count = table.titles.len();
        let wanted = (0..count).map(|column| Wanted {
            column,
            title: column.to_string(),
        });
        let mut rows = table.rows(&wanted.collect::<Vec<_>>()).unwrap();
        let next = || {
            let mut values = Vec::new();
            let (line, fault) = rows.next_row(&mut values)?;
            assert_eq!(fault, None);
            Some((line, values))
        };
        let found = core::iter::from_fn(next).collect();
        std::fs::remove_file(&path).unwrap();
        found
    }

    #[test]
    fn rows_behind_lines_of_metadata_are_read_with_their_lines() {
        for (text, first) in [
            ("Robot;X\nRate;9 Hz\n\nt;a;b\n1;2,5;3\n4;5;6\n", 5),
            (
                "Robot;X\r\nRate;9 Hz\r\n\r\nt;a;b\r\n1;2,5;3\r\n4;5;6\r\n",
                5,
            ),
            ("% made by hand\n1,2.5,3\n% pause\n4,5,6\n", 2),
            ("% t, a, b\n1,2.5,3\n4,5,6\n", 2),
        ] {
            let rows = read(text);
            assert_eq!(
                rows.iter().map(|row| row.1.clone()).collect::<Vec<_>>(),
                [[1.0, 2.5, 3.0], [4.0, 5.0, 6.0]],
                "{text}"
            );
            assert_eq!(rows[0].0, first, "{text}");
        }
    }

    #[test]
    fn dates_with_times_of_the_day_are_seconds_from_the_first_one() {
        for text in [
            "stamp,q\n2026-12-31T23:59:59.875Z,1\n2027-01-01T00:00:00.125Z,2\n",
            "2026-12-31 23:59:59.875,1\n2027-01-01 00:00:00.125,2\n",
            "stamp;q\n\"2027-01-01T00:59:59,875+01:00\";1\n2027-01-01T01:00:00,125+0100;2\n",
        ] {
            let rows: Vec<_> = read(text).into_iter().map(|row| row.1).collect();
            assert_eq!(rows, [[0.0, 1.0], [0.25, 2.0]], "{text}");
        }
    }

    #[test]
    fn any_number_of_blanks_separates_and_those_at_the_ends_do_not() {
        for text in [
            "  1.0e+00   2.5\n -4 5.0  \n",
            "a b\n1\t2.5\r\n   \n\n-4 \t 5\r\n",
            "\u{feff}1 2,5\n-4 5",
            "% made by hand\n% a b\n 1 2.5\n % pause\n-4 5\n",
        ] {
            let rows: Vec<_> = read(text).into_iter().map(|row| row.1).collect();
            assert_eq!(rows, [[1.0, 2.5], [-4.0, 5.0]], "{text}");
        }
    }

    proptest! {
        #[test]
        fn rows_and_their_lines_are_those_of_the_library(
            text in "(\u{feff})?([ab,12.\"#]{0,4}[,\n]|[0-9]{1,3},[0-9]{1,3}\r?\n){0,9}[,1\r\n]{0,2}"
        ) {
            // of a comment that ends with the file, the library makes an empty row
            let last = text.rsplit('\n').next().unwrap_or_default();
            prop_assume!(!last.starts_with('#'));
            // no NaN equals another one, as the texts of both do
            let [here, library] = both_ways(&text).map(|rows| format!("{rows:?}"));
            prop_assert_eq!(here, library);
        }
    }
}
