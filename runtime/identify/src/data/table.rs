//! How the text of a log is divided into columns and numbers, as the user states it or as it is
//! found from the first rows.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

use csv::{Reader, ReaderBuilder};

use super::columns::file_unit;
use super::lines::{Limited, Place};
use super::start::{self, Row, Start};
use super::{dates, number};

/// Whether the first row of a log names its columns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Header {
    /// The first row names the columns unless it consists of numbers only.
    #[default]
    Auto,
    /// The first row has numbers; the columns are called by their numbers, from 1.
    None,
}

/// The character between columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Separator {
    /// `,`
    Comma,
    /// `;`
    Semicolon,
    /// A tabulator.
    Tab,
    /// One or more blanks or tabulators; those at the ends of a line separate nothing.
    Blank,
}

impl Separator {
    pub(super) fn byte(self) -> u8 {
        match self {
            Self::Comma => b',',
            Self::Semicolon => b';',
            Self::Tab => b'\t',
            Self::Blank => b' ',
        }
    }
}

/// The mark before the decimals of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decimal {
    /// `0.5`
    Point,
    /// `0,5`
    Comma,
}

/// How CSV files are written; what is not stated is found from their first rows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Format {
    /// Whether the first row names the columns.
    pub header: Header,
    /// The character between columns.
    pub separator: Option<Separator>,
    /// The mark before decimals.
    pub decimal: Option<Decimal>,
}

/// How one CSV file is written.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Written {
    separator: Separator,
    decimal_comma: bool,
    has_header: bool,
    /// Where the row of names or, without names, the first row begins.
    start: Place,
    /// The first byte of lines that are no rows.
    comment: u8,
    /// The names of the columns; their numbers from 1 where the file does not name them.
    pub(super) titles: Vec<String>,
    /// The units of the columns, of a file with a row of these behind its names.
    pub(super) units: Vec<String>,
    /// Where the first row with numbers begins, of a file with units.
    pub(super) behind_units: Option<Place>,
    /// The first date with a time of the day in it, ns since 1970; dates count from it or another one.
    pub(super) dated: Option<i64>,
    /// The first column with dates.
    pub(super) dates: Option<usize>,
    /// The lines that are no rows, at the start and the end of the file, with the reason why.
    pub(super) remarks: Vec<(String, String)>,
}

/// Bytes at the start of a file from which its format is found.
const SAMPLE_BYTES: u64 = 1 << 16;
/// Bytes at the end of a file in which comments are looked for.
const END_BYTES: u64 = 1 << 12;
/// The number of lines without rows that are told, and of the characters of each.
const MAX_REMARKS: usize = 8;
const MAX_REMARK_LENGTH: usize = 60;
/// The number of rows among these that are examined.
const SAMPLE_ROWS: usize = 20;
/// The largest number of columns.
const MAX_COLUMNS: usize = 5000;

/// The lines of a text that are no rows: those before the table, which begins at a byte, and comments.
fn remarks(bytes: &[u8], start: u64, comment: u8) -> Vec<(String, String)> {
    let (mut at, mut found, mut more) = (0, Vec::new(), 0);
    for line in bytes.split_inclusive(|byte| *byte == b'\n') {
        let is_before = at < start;
        // a row of names may be a comment of MATLAB itself
        let is_names = at == start && comment != COMMENT;
        at += line.len() as u64;
        let text = String::from_utf8_lossy(line);
        let text = text.trim_start_matches('\u{feff}').trim();
        let is_comment = text.as_bytes().first() == Some(&comment) && !is_names;
        let words =
            text.trim_matches(|own: char| own.is_ascii_punctuation() || own.is_whitespace());
        if words.is_empty() || !(is_before || is_comment) {
            continue;
        }
        if found.len() == MAX_REMARKS {
            more += 1;
            continue;
        }
        let mut shown: String = text.chars().take(MAX_REMARK_LENGTH).collect();
        if shown.len() < text.len() {
            shown.push_str("..");
        }
        let why = "it is a line without a row, which is not applied to numbers";
        found.push((shown, why.to_owned()));
    }
    if more > 0 {
        let why = "they are lines without rows, which are not applied to numbers";
        found.push((format!("{more} more lines"), why.to_owned()));
    }
    found
}

/// A unit without brackets around it.
fn unbracketed(cell: &str) -> String {
    let cell = cell.trim_matches(|own| matches!(own, '[' | ']' | '(' | ')'));
    cell.trim().to_owned()
}

/// Whether a row between the names and the first numbers has units.
fn are_units(names: &Row, units: &Row, first: &Row, decimal_comma: bool) -> bool {
    let is_number = |cell: &String| number::is_one(cell, decimal_comma);
    names.cells.len() == units.cells.len()
        && !units.cells.iter().any(is_number)
        && units
            .cells
            .iter()
            .any(|own| file_unit(&unbracketed(own)).is_some())
        && first.cells.iter().any(is_number)
}

impl Written {
    /// Finds how a file is written from its first rows.
    pub(super) fn find(mut file: &File, asked: Format) -> io::Result<Self> {
        let mut bytes = Vec::new();
        file.seek(SeekFrom::Start(0))?;
        file.take(SAMPLE_BYTES).read_to_end(&mut bytes)?;
        // a row that the end of the sample cuts off is not examined, unless it is the only one
        if bytes.len() as u64 == SAMPLE_BYTES
            && let Some(end) = bytes.iter().rposition(|byte| *byte == b'\n')
        {
            bytes.truncate(end + 1);
        }
        let candidates = match asked.separator {
            Some(separator) => vec![separator],
            None => vec![
                Separator::Semicolon,
                Separator::Tab,
                Separator::Blank,
                Separator::Comma,
            ],
        };
        let mut samples = candidates.into_iter().map(|separator| {
            let mut rows = start::rows(&bytes, separator);
            let start = Start::find(&rows, asked.header);
            rows.drain(..start.row.min(rows.len()));
            rows.truncate(SAMPLE_ROWS);
            (separator, start.comment, rows)
        });
        // numbers may contain commas, so the other separators are tried first
        let found = samples.find(|(separator, _, rows)| match separator {
            _ if asked.separator.is_some() => true,
            Separator::Comma => true,
            Separator::Blank => agree(rows) && are_numbers(rows),
            Separator::Semicolon | Separator::Tab => agree(rows),
        });
        let (separator, comment, rows) = found.unwrap_or((Separator::Comma, COMMENT, Vec::new()));
        let decimal_comma = match asked.decimal {
            Some(decimal) => decimal == Decimal::Comma,
            None => separator != Separator::Comma && has_decimal_commas(&rows),
        };
        let first = rows.first().map(|row| row.cells.as_slice());
        let first = first.unwrap_or_default();
        if first.len() > MAX_COLUMNS {
            let why = format!(
                "its first row has {} columns or more; the limit is {MAX_COLUMNS}",
                first.len()
            );
            return Err(io::Error::new(io::ErrorKind::InvalidData, why));
        }
        let numbers = |texts: &[String]| texts.iter().all(|t| number::is_one(t, decimal_comma));
        let has_header = asked.header == Header::Auto && (first.is_empty() || !numbers(first));
        let units = match rows.get(..3) {
            Some([names, units, first])
                if has_header && are_units(names, units, first, decimal_comma) =>
            {
                Some((units, first.place))
            }
            _ => None,
        };
        let titles = if has_header {
            first.to_vec()
        } else {
            (1..=first.len()).map(|k| k.to_string()).collect()
        };
        // what is before the first row is read with it, as long as it is no more than comments
        let beginning = Place { byte: 0, line: 1 };
        let start = rows.first().map_or(beginning, |row| row.place);
        let mut lines = remarks(&bytes, start.byte, comment);
        if bytes.len() as u64 == SAMPLE_BYTES {
            let mut end = Vec::new();
            let length = file.seek(SeekFrom::End(0))?;
            file.seek(SeekFrom::Start(
                length.saturating_sub(END_BYTES).max(SAMPLE_BYTES),
            ))?;
            file.take(END_BYTES).read_to_end(&mut end)?;
            // what is before the first end of a line is a part of one
            let whole = memchr::memchr(b'\n', &end).unwrap_or(0);
            lines.extend(remarks(end.get(whole..).unwrap_or_default(), 0, comment));
        }
        let date = rows
            .iter()
            .flat_map(|row| row.cells.iter().enumerate())
            .find_map(|(k, text)| Some((k, dates::nanoseconds(text.as_bytes())?)));
        Ok(Self {
            separator,
            decimal_comma,
            has_header,
            start,
            comment,
            units: units.map_or_else(Vec::new, |(own, _)| {
                own.cells.iter().map(|own| unbracketed(own)).collect()
            }),
            behind_units: units.map(|own| own.1),
            titles,
            remarks: lines,
            dated: date.map(|own| own.1),
            dates: date.map(|own| own.0),
        })
    }

    /// Whether the file names its columns.
    pub(super) fn has_header(&self) -> bool {
        self.has_header
    }

    /// What stands between columns.
    pub(super) fn separator(&self) -> Separator {
        self.separator
    }

    /// Where the row of names or, without names, the first row begins, with the comments before it.
    pub(super) fn start(&self) -> Place {
        self.start
    }

    /// The first byte of lines that are no rows.
    pub(super) fn comment(&self) -> u8 {
        self.comment
    }

    /// A reader of rows of any length, which ignores comments.
    pub(super) fn reader<R: Read>(&self, file: R) -> Reader<Limited<R>> {
        builder(self.separator.byte(), self.comment)
            .has_headers(false)
            .from_reader(Limited::new(file))
    }

    /// A reader of the row of names, which may stand in a comment of MATLAB.
    pub(super) fn header_reader<R: Read>(&self, file: R) -> Reader<Limited<R>> {
        builder(self.separator.byte(), COMMENT).from_reader(Limited::new(file))
    }

    /// The number at the start of a line and its length, see [`number::leading`].
    pub(super) fn leading_number(&self, line: &[u8]) -> Option<(f64, usize)> {
        number::leading(line, self.separator.byte(), self.decimal_comma)
    }

    /// The number of an entry, that of a date in s from [`Self::dated`]; `None` if the entry is neither.
    pub(super) fn number(&self, entry: &[u8]) -> Option<f64> {
        number::of_bytes(entry, self.decimal_comma).or_else(|| {
            let own = dates::nanoseconds(entry.trim_ascii())?;
            // differences of integers: seconds since 1970 as doubles do not resolve a microsecond
            Some(own.saturating_sub(self.dated.unwrap_or(0)) as f64 * 1e-9)
        })
    }
}

/// The first byte of a line that is no row.
pub(super) const COMMENT: u8 = b'#';

pub(super) fn builder(separator: u8, comment: u8) -> ReaderBuilder {
    let mut builder = ReaderBuilder::new();
    builder
        .flexible(true)
        .comment(Some(comment))
        .delimiter(separator);
    builder
}

/// Whether most rows have as many entries as the first one, and more than one.
fn agree(rows: &[Row]) -> bool {
    let count = rows.first().map_or(0, |row| row.cells.len());
    let same = rows.iter().filter(|row| row.cells.len() == count).count();
    count > 1 && 2 * same > rows.len()
}

/// Whether most rows behind the first one have numbers only, or the first one where it is the only one.
fn are_numbers(rows: &[Row]) -> bool {
    let behind = rows.get(1..).filter(|behind| !behind.is_empty());
    let rows = behind.unwrap_or(rows);
    2 * rows.iter().filter(|row| row.is_numbers()).count() > rows.len()
}

/// Whether entries are numbers with commas before the decimals, and none has a point there.
fn has_decimal_commas(rows: &[Row]) -> bool {
    let all = || rows.iter().flat_map(|row| &row.cells);
    let with = |mark: char, comma: bool| {
        all().any(|text| text.contains(mark) && number::of_text(text, comma).is_some())
    };
    with(',', true) && !with('.', false)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How a text is found to be written, as separator, decimal comma, header and titles.
    fn found(text: &str, asked: Format) -> (char, bool, bool, Vec<String>) {
        let name = format!("regen-table-{}-{}", std::process::id(), text.len());
        let path = std::env::temp_dir().join(name);
        std::fs::write(&path, text).unwrap();
        let found = Written::find(&File::open(&path).unwrap(), asked).unwrap();
        std::fs::remove_file(&path).unwrap();
        (
            char::from(found.separator.byte()),
            found.decimal_comma,
            found.has_header,
            found.titles,
        )
    }

    #[test]
    fn a_table_begins_behind_lines_of_other_lengths() {
        let cases: [(&str, char, u64, &[&str]); 9] = [
            // a spreadsheet of a controller
            (
                "Robot;KX20\nRate;250 Hz\n\nt;q1;q2\n0,1;2,5;3\n0,2;2,5;3\n0,3;2,5;4\n",
                ';',
                4,
                &["t", "q1", "q2"],
            ),
            // lines that are filled up, and a row of units
            (
                "Robot,KX20,,,\n,,,,\nt,q1,q2,q3,q4\ns,rad,rad,rad,rad\n0,1,2,3,4\n1,1,2,3,4\n",
                ',',
                3,
                &["t", "q1", "q2", "q3", "q4"],
            ),
            // comments of MATLAB, without and with the names of the columns
            ("% arm, 250 Hz\n0,1,2\n1,2,3\n", ',', 2, &["1", "2", "3"]),
            ("% arm\n% t, q1\n0,1\n1,2\n", ',', 2, &["t", "q1"]),
            ("%time,q1\n0,1\n1,2\n", ',', 1, &["%time", "q1"]),
            // blanks
            ("  1.5e0 -2.0\n -1.5e0  2.0\n", ' ', 1, &["1", "2"]),
            (
                "made by this hand\n t  q1 tau\n 0 1 2\n 1 2 3\n",
                ' ',
                2,
                &["t", "q1", "tau"],
            ),
            ("0,5 1,25\n0,6 1,5\n", ' ', 1, &["1", "2"]),
            // fewer names than numbers are no line before the table
            ("t,q1\n0,1,2\n1,2,3\n", ',', 1, &["t", "q1"]),
        ];
        for (text, separator, line, titles) in cases {
            let path = std::env::temp_dir().join(format!(
                "regen-start-{}-{}",
                std::process::id(),
                text.len()
            ));
            std::fs::write(&path, text).unwrap();
            let found = Written::find(&File::open(&path).unwrap(), Format::default()).unwrap();
            std::fs::remove_file(&path).unwrap();
            assert_eq!(char::from(found.separator.byte()), separator, "{text}");
            // empty lines and comments before the first row count to it
            let place = text.get(found.start.byte as usize..).unwrap();
            let passed = place.lines().take_while(|line| line.is_empty()).count();
            assert_eq!(found.start.line + passed as u64, line, "{text}");
            assert_eq!(found.titles, titles, "{text}");
        }
    }

    #[test]
    fn more_columns_than_any_log_has_are_refused() {
        let name = format!("regen-wide-{}", std::process::id());
        let path = std::env::temp_dir().join(name);
        std::fs::write(&path, "1,".repeat(MAX_COLUMNS)).unwrap();
        let error = Written::find(&File::open(&path).unwrap(), Format::default()).unwrap_err();
        std::fs::remove_file(&path).unwrap();
        assert!(error.to_string().contains("5001 columns"), "{error}");
    }

    #[test]
    fn separators_decimals_and_headers_are_found_from_the_first_rows() {
        let auto = Format::default();
        let titles = |texts: &[&str]| texts.iter().map(|t| (*t).to_owned()).collect::<Vec<_>>();
        let cases = [
            ("t,q1\n0,1.5\n", (',', false, true, titles(&["t", "q1"]))),
            (
                "# made by hand\n0,1.5\n1,-2e-3\n",
                (',', false, false, titles(&["1", "2"])),
            ),
            ("t;q1\n0,1;1,5\n", (';', true, true, titles(&["t", "q1"]))),
            (
                "0,1;1,5\n0,2;2,5\n",
                (';', true, false, titles(&["1", "2"])),
            ),
            ("t; q1\n0.1;1\n", (';', false, true, titles(&["t", "q1"]))),
            (
                "t\tq1\n0,1\t1,5\n",
                ('\t', true, true, titles(&["t", "q1"])),
            ),
            // titles with another separator in them
            (
                "t,q;1\n0,1\n0,2\n",
                (',', false, true, titles(&["t", "q;1"])),
            ),
            (
                "\"t;s\",\"q;1\"\n0,1\n",
                (',', false, true, titles(&["t;s", "q;1"])),
            ),
        ];
        for (text, expected) in cases {
            assert_eq!(found(text, auto), expected, "{text}");
        }
        let none = Format {
            header: Header::None,
            ..auto
        };
        assert_eq!(found("t,q1\n0,1\n", none).3, ["1", "2"]);
        let stated = Format {
            separator: Some(Separator::Comma),
            decimal: Some(Decimal::Point),
            ..auto
        };
        assert_eq!(found("a;b,c\n1,2\n", stated).3, ["a;b", "c"]);
    }
}
