//! Finds where the table of a text begins: behind lines that tell of the robot or the recording,
//! which many controllers write before the names of the columns.

use csv::ByteRecord;

use super::lines::Place;
use super::number;
use super::table::{COMMENT, Header, Separator, builder};

/// The first byte of comments of MATLAB, which some other programs write before the names of columns.
const PERCENT: u8 = b'%';

/// The number of rows of a sample that are examined.
const SAMPLE_ROWS: usize = 400;

/// A row at the start of a text.
#[derive(Debug)]
pub(super) struct Row {
    /// Its entries, trimmed; of a row that begins with `%` and a blank without these.
    pub(super) cells: Vec<String>,
    /// Where it begins, with the comments before it.
    pub(super) place: Place,
    /// Whether an empty line is before it.
    apart: bool,
    /// Whether it begins with `%`.
    percent: bool,
}

/// Where a table begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Start {
    /// The index of its first row among those of the sample.
    pub(super) row: usize,
    /// The first byte of lines that are no rows.
    pub(super) comment: u8,
}

/// The first rows of a text.
pub(super) fn rows(bytes: &[u8], separator: Separator) -> Vec<Row> {
    if separator == Separator::Blank {
        return blank_rows(bytes);
    }
    let mut reader = builder(separator.byte(), COMMENT)
        .has_headers(false)
        .from_reader(bytes);
    let mut record = ByteRecord::new();
    let mut rows = Vec::new();
    let (mut line, mut counted) = (1, 0);
    while rows.len() < SAMPLE_ROWS && matches!(reader.read_byte_record(&mut record), Ok(true)) {
        let text = |entry: &[u8]| String::from_utf8_lossy(entry).trim().to_owned();
        let cells = record.iter().map(text).collect();
        let position = record.position();
        let byte = position.map_or(0, csv::Position::byte);
        let mut begin = usize::try_from(byte).unwrap_or_default();
        // the library leaves the second byte of an end of line to the next row
        let end_before = begin
            .checked_sub(1)
            .and_then(|before| bytes.get(before..=begin));
        begin += usize::from(end_before == Some(b"\r\n"));
        // the library does not count empty lines
        let passed = bytes.get(counted..begin).unwrap_or_default();
        line += memchr::memchr_iter(b'\n', passed).count() as u64;
        counted = begin;
        let place = Place {
            byte: begin as u64,
            line,
        };
        let before = bytes.get(begin..).unwrap_or_default();
        let mut lines = before.split(|byte| *byte == b'\n');
        let apart = lines
            .find(|line| line.first() != Some(&COMMENT))
            .is_some_and(|line| line.trim_ascii().is_empty());
        rows.push(Row::new(cells, place, apart));
    }
    rows
}

/// The same of a text whose entries are separated by blanks.
fn blank_rows(bytes: &[u8]) -> Vec<Row> {
    let mut rows = Vec::new();
    let mut place = Place { byte: 0, line: 1 };
    let mut apart = false;
    for line in bytes.split_inclusive(|byte| *byte == b'\n') {
        if rows.len() == SAMPLE_ROWS {
            break;
        }
        let text = String::from_utf8_lossy(line);
        let text = text.trim_start_matches('\u{feff}').trim();
        if text.is_empty() {
            apart = true;
        } else if !text.as_bytes().starts_with(&[COMMENT]) {
            let cells = text.split_ascii_whitespace().map(str::to_owned).collect();
            rows.push(Row::new(cells, place, apart));
            apart = false;
        }
        place.byte += line.len() as u64;
        place.line += 1;
    }
    rows
}

impl Row {
    fn new(mut cells: Vec<String>, place: Place, apart: bool) -> Self {
        let percent = cells.first().is_some_and(|cell| cell.starts_with('%'));
        if percent && let Some(first) = cells.first_mut() {
            // `% t` names a column `t`; `%time` is the name that recordings of ROS 1 have
            if let Some(rest) = first.strip_prefix("% ") {
                *first = rest.trim().to_owned();
            } else if first == "%" && cells.len() > 1 {
                cells.remove(0);
            }
        }
        Self {
            cells,
            place,
            apart,
            percent,
        }
    }

    /// Whether more than half of its entries are numbers.
    fn has_numbers(&self) -> bool {
        let numbers = self.cells.iter().filter(|cell| is_number(cell));
        2 * numbers.count() > self.cells.len()
    }

    /// Whether all its entries are numbers.
    pub(super) fn is_numbers(&self) -> bool {
        self.cells.iter().all(|cell| is_number(cell))
    }

    /// Whether more than half of its entries are empty, as those of lines before a table that a
    /// spreadsheet fills up with separators.
    fn is_filled_up(&self) -> bool {
        let empty = self.cells.iter().filter(|cell| cell.is_empty());
        2 * empty.count() > self.cells.len()
    }
}

/// Whether a text is a number with a point or a comma before its decimals, or a date. A comma at its end or at
/// its start stands between columns.
fn is_number(text: &str) -> bool {
    !text.ends_with(',') && !text.starts_with(',') && number::is_one(text, true)
}

/// The number of entries that the rows of the second half have most often.
fn usual_count(rows: &[Row]) -> Option<usize> {
    let second = rows.get(rows.len() / 2..)?;
    let counts = || second.iter().map(|row| row.cells.len());
    counts().max_by_key(|count| counts().filter(|own| own == count).count())
}

impl Start {
    /// Finds the row that names the columns, or the first row of numbers. It is not the first row of
    /// the text only if rows of numbers follow that have as many entries as it, and others do not.
    pub(super) fn find(rows: &[Row], header: Header) -> Self {
        let first = Self {
            row: 0,
            comment: COMMENT,
        };
        let Some(count) = usual_count(rows) else {
            return first;
        };
        let of_table = |row: &Row| row.cells.len() == count;
        let data = rows
            .iter()
            .position(|row| of_table(row) && !row.percent && row.has_numbers());
        let Some(data) = data.filter(|data| *data > 0) else {
            return first;
        };
        let before = rows.get(..data).unwrap_or_default();
        // names and units may have an empty line between them, where nothing else is before the numbers
        let are_all_names = before
            .iter()
            .all(|row| of_table(row) && !row.percent && !row.is_filled_up());
        if are_all_names {
            return first;
        }
        // the rows of text directly before the numbers, the last one first
        let mut block: Vec<usize> = Vec::new();
        for (k, row) in before.iter().enumerate().rev() {
            if !of_table(row) || row.percent && !block.is_empty() {
                break;
            }
            block.push(k);
            if row.apart || row.percent {
                break;
            }
        }
        // a row of units may follow the names
        let names = block.iter().rev().find(|k| {
            let row = before.get(**k);
            row.is_some_and(|row| !row.is_filled_up())
        });
        let row = match names {
            Some(names) => *names,
            // lines before numbers that are not as many as these are no names
            None if before.iter().all(|row| row.percent) => data,
            None if header == Header::None && !before.iter().any(of_table) => data,
            None => 0,
        };
        // a name such as `%time` is no comment, and `#` stays the first byte of those behind it
        let is_comment = |(k, own): (usize, &Row)| {
            let is_name = k == row && own.cells.first().is_some_and(|cell| cell.starts_with('%'));
            own.percent && !is_name
        };
        let mut passed = rows.iter().enumerate().take(row + 1);
        let comment = if passed.any(is_comment) {
            PERCENT
        } else {
            COMMENT
        };
        Self { row, comment }
    }
}
