//! How the text of a log is divided into columns and numbers, as the user states it or as it is
//! found from the first rows.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use csv::{ByteRecord, Reader, ReaderBuilder};

use super::number;

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
}

impl Separator {
    fn byte(self) -> u8 {
        match self {
            Self::Comma => b',',
            Self::Semicolon => b';',
            Self::Tab => b'\t',
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
    separator: u8,
    decimal_comma: bool,
    has_header: bool,
    /// The names of the columns; their numbers from 1 where the file does not name them.
    pub(super) titles: Vec<String>,
}

/// Bytes at the start of a file from which its format is found.
const SAMPLE_BYTES: u64 = 1 << 16;
/// The number of rows among these that are examined.
const SAMPLE_ROWS: usize = 20;

impl Written {
    /// Finds how a file is written from its first rows.
    pub(super) fn find(path: &Path, asked: Format) -> io::Result<Self> {
        let mut bytes = Vec::new();
        File::open(path)?
            .take(SAMPLE_BYTES)
            .read_to_end(&mut bytes)?;
        // a row that the end of the sample cuts off is not examined, unless it is the only one
        if bytes.len() as u64 == SAMPLE_BYTES
            && let Some(end) = bytes.iter().rposition(|byte| *byte == b'\n')
        {
            bytes.truncate(end + 1);
        }
        let candidates = match asked.separator {
            Some(separator) => vec![separator],
            None => vec![Separator::Semicolon, Separator::Tab, Separator::Comma],
        };
        let mut samples = candidates
            .into_iter()
            .map(|separator| (separator, records(&bytes, separator.byte())));
        // numbers may contain commas, so the other separators are tried first
        let found = samples.find(|(separator, rows)| {
            *separator == Separator::Comma || asked.separator.is_some() || agree(rows)
        });
        let (separator, rows) = found.unwrap_or((Separator::Comma, Vec::new()));
        let decimal_comma = match asked.decimal {
            Some(decimal) => decimal == Decimal::Comma,
            None => separator != Separator::Comma && has_decimal_commas(&rows),
        };
        let first = rows.first().map(Vec::as_slice).unwrap_or_default();
        let numbers = |texts: &[String]| {
            texts
                .iter()
                .all(|t| number::of_text(t, decimal_comma).is_some())
        };
        let has_header = asked.header == Header::Auto && (first.is_empty() || !numbers(first));
        let titles = if has_header {
            first.to_vec()
        } else {
            (1..=first.len()).map(|k| k.to_string()).collect()
        };
        Ok(Self {
            separator: separator.byte(),
            decimal_comma,
            has_header,
            titles,
        })
    }

    /// Whether the file names its columns.
    pub(super) fn has_header(&self) -> bool {
        self.has_header
    }

    /// The byte between columns.
    pub(super) fn separator(&self) -> u8 {
        self.separator
    }

    /// A reader of rows of any length, which ignores lines that start with `#`; with `has_header` the
    /// first row is not passed on.
    pub(super) fn reader(&self, file: File, has_header: bool) -> Reader<File> {
        builder(self.separator)
            .has_headers(has_header)
            .from_reader(file)
    }

    /// The number at the start of a line and its length, see [`number::leading`].
    pub(super) fn leading_number(&self, line: &[u8]) -> Option<(f64, usize)> {
        number::leading(line, self.separator, self.decimal_comma)
    }

    /// The number of an entry; `None` if the entry is not a number.
    pub(super) fn number(&self, entry: &[u8]) -> Option<f64> {
        number::of_bytes(entry, self.decimal_comma)
    }
}

/// The first byte of a line that is no row.
pub(super) const COMMENT: u8 = b'#';

fn builder(separator: u8) -> ReaderBuilder {
    let mut builder = ReaderBuilder::new();
    builder
        .flexible(true)
        .comment(Some(COMMENT))
        .delimiter(separator);
    builder
}

/// The first rows of a text, their entries trimmed.
fn records(bytes: &[u8], separator: u8) -> Vec<Vec<String>> {
    let mut reader = builder(separator).has_headers(false).from_reader(bytes);
    let mut record = ByteRecord::new();
    let mut rows = Vec::new();
    while rows.len() < SAMPLE_ROWS && matches!(reader.read_byte_record(&mut record), Ok(true)) {
        let text = |entry: &[u8]| String::from_utf8_lossy(entry).trim().to_owned();
        rows.push(record.iter().map(text).collect());
    }
    rows
}

/// Whether most rows have as many entries as the first one, and more than one.
fn agree(rows: &[Vec<String>]) -> bool {
    let count = rows.first().map_or(0, Vec::len);
    let same = rows.iter().filter(|row| row.len() == count).count();
    count > 1 && 2 * same > rows.len()
}

/// Whether entries are numbers with commas before the decimals, and none has a point there.
fn has_decimal_commas(rows: &[Vec<String>]) -> bool {
    let all = || rows.iter().flatten();
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
        let found = Written::find(&path, asked).unwrap();
        std::fs::remove_file(&path).unwrap();
        (
            char::from(found.separator),
            found.decimal_comma,
            found.has_header,
            found.titles,
        )
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
