//! Reads the rows of one file one after another, as the numbers in the file, not converted to SI.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use super::csv_rows::CsvRows;
use super::parsed::{ParsedColumns, ParsedRows};
use super::problem::{DataError, Fault};
use super::table::{Format, Written};
use crate::document::require_regular;

/// The largest number of characters of a title or an entry in a message.
const MAX_SHOWN: usize = 40;

/// Cuts a text to a length that fits into a message.
pub(super) fn shortened(text: &str) -> String {
    match text.char_indices().nth(MAX_SHOWN) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

/// A column of a file that is read.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Wanted {
    /// Its index in the file.
    pub(super) column: usize,
    /// Its title, for messages.
    pub(super) title: String,
}

/// One file of a run, and how its text is divided into columns.
#[derive(Clone, Debug)]
pub(super) struct Table {
    pub(super) path: PathBuf,
    kind: Kind,
    /// The names of the columns.
    pub(super) titles: Vec<String>,
    /// Whether the file names its columns; else they are called by their numbers.
    pub(super) named: bool,
    /// The length in bytes of a CSV file whose last line has no end of line.
    pub(super) unended_length: Option<u64>,
    /// The first and the last row that are read, from 1; `None` for all.
    pub(super) part: Option<(u64, u64)>,
    parsed: ParsedColumns,
}

/// How a file is read.
#[derive(Clone, Debug)]
enum Kind {
    /// A text, and the file until its rows are read.
    Csv(Written, Arc<Mutex<Option<Arc<File>>>>),
    #[cfg(feature = "parquet")]
    Parquet(super::parquet::Contents),
    #[cfg(feature = "bags")]
    Bag(regen_bags::Table),
    #[cfg(feature = "arrays")]
    Arrays(regen_arrays::Table),
}

/// How the files of a run are opened.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Opening<'a> {
    pub(super) format: Format,
    /// The topic of recordings.
    #[cfg_attr(not(feature = "bags"), allow(dead_code))]
    pub(super) topic: Option<&'a str>,
    /// The episode of files of LeRobot.
    pub(super) episode: Option<u64>,
    /// The column of time that is stated by its name.
    #[cfg_attr(not(feature = "arrays"), allow(dead_code))]
    pub(super) time: Option<&'a str>,
    /// The stamp from which the times of recordings count, ns: that of the first one.
    pub(super) start: Option<i64>,
    /// The same of the dates in files of other formats.
    pub(super) dated: Option<i64>,
}

/// A row of a file.
#[derive(Debug, PartialEq)]
pub(super) struct FileRow {
    /// The line of a CSV file, the row of a Parquet file or the number of a message, from 1.
    pub(super) line: u64,
    /// The numbers of the wanted columns as in the file, NaN where there is none; nothing where the whole row
    /// cannot be used.
    pub(super) values: Vec<f64>,
    /// Why it cannot be used, if it cannot.
    pub(super) faults: Vec<RowFault>,
}

/// Why a row cannot be used.
#[derive(Debug, PartialEq)]
pub(super) struct RowFault {
    /// The place of its column among the wanted ones; `None` if the whole row cannot be used.
    pub(super) column: Option<usize>,
    pub(super) why: Fault,
}

impl FileRow {
    /// A row with the entries of the wanted columns, each a number or the text that is none.
    pub(super) fn new(
        line: u64,
        wanted: &[Wanted],
        entries: impl Iterator<Item = Result<f64, String>>,
        mut values: Vec<f64>,
    ) -> Self {
        let mut faults = Vec::new();
        values.clear();
        for (place, (wanted, entry)) in wanted.iter().zip(entries).enumerate() {
            match entry {
                Ok(value) => values.push(value),
                Err(text) => {
                    values.push(f64::NAN);
                    faults.push(RowFault {
                        column: Some(place),
                        why: Fault::NotANumber {
                            column: wanted.title.clone(),
                            text,
                        },
                    });
                }
            }
        }
        Self {
            line,
            values,
            faults,
        }
    }
}

/// The rows of one file, from the first one on.
pub(super) enum FileRows<'a> {
    Csv(CsvRows<'a>),
    #[cfg(feature = "parquet")]
    Parquet(super::parquet::ParquetRows),
    #[cfg(feature = "bags")]
    Bag(Box<super::bags::BagRows>),
    #[cfg(feature = "arrays")]
    Arrays(super::arrays::ArrayRows),
}

/// First bytes of a Parquet file.
const PARQUET_MAGIC: [u8; 4] = *b"PAR1";

/// Bytes at the start of a file by which its format is known.
const START_BYTES: u64 = 1024;

/// The first bytes of a file.
fn start(mut file: &File) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    file.take(START_BYTES).read_to_end(&mut bytes)?;
    file.seek(SeekFrom::Start(0))?;
    Ok(bytes)
}

/// The length in bytes of a file whose last line has no end of line; `None` for other files and
/// where it cannot be read, which a later read reports.
fn unended_length(mut file: &File) -> Option<u64> {
    let length = file.seek(SeekFrom::End(0)).ok()?;
    let mut last = [0];
    file.seek(SeekFrom::End(-1)).ok()?;
    file.read_exact(&mut last).ok()?;
    (!b"\r\n".contains(&last[0])).then_some(length)
}

#[cfg(not(all(feature = "arrays", feature = "parquet", feature = "bags")))]
fn unsupported(path: &Path, what: &str, feature: &str) -> DataError {
    DataError::ColumnLayout {
        file: path.display().to_string(),
        why: format!("this is a {what}: build with the feature `{feature}`"),
    }
}

/// Whether a path is a recording, by its extension; recordings with other extensions are recognised
/// only with the feature `bags`.
#[cfg(not(feature = "bags"))]
fn is_bag(path: &Path) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str());
    path.is_dir() || matches!(extension, Some("mcap" | "db3"))
}

/// Whether a path is a file of arrays, by its extension.
#[cfg(not(feature = "arrays"))]
fn is_arrays(path: &Path) -> bool {
    const EXTENSIONS: [&str; 7] = ["npy", "npz", "mat", "h5", "hdf5", "mf4", "tdms"];
    let extension = path.extension().and_then(|extension| extension.to_str());
    extension.is_some_and(|own| EXTENSIONS.contains(&own))
}

impl Opening<'_> {
    /// Finds the format of a file. A recording has several tables if several publishers send
    /// different joints.
    pub(super) fn tables(&mut self, path: &Path) -> Result<Vec<Table>, DataError> {
        let io = |error: io::Error| DataError::Io {
            file: path.display().to_string(),
            why: error.to_string(),
        };
        require_regular(path).map_err(io)?;
        // what cannot be read is no file of these formats, and the error that of reading it as a text
        let file = if path.is_dir() {
            None
        } else {
            File::open(path).ok()
        };
        let first = file.as_ref().and_then(|file| start(file).ok());
        let first = first.unwrap_or_default();
        #[cfg(feature = "bags")]
        if regen_bags::is_bag(path, &first) {
            let tables = super::bags::tables(path, self.topic, &mut self.start)?;
            let table = |own: regen_bags::Table| {
                Ok(Table {
                    path: path.to_path_buf(),
                    titles: super::bags::titles(&own)?,
                    named: true,
                    unended_length: None,
                    part: None,
                    parsed: ParsedColumns::default(),
                    kind: Kind::Bag(own),
                })
            };
            return tables.into_iter().map(table).collect();
        }
        #[cfg(not(feature = "bags"))]
        if is_bag(path) {
            return Err(unsupported(path, "recording", "bags"));
        }
        #[cfg(feature = "arrays")]
        if regen_arrays::is_arrays(&first) {
            let tables = super::arrays::tables(path, self.time, &mut self.dated)?;
            let table = |own: regen_arrays::Table| Table {
                path: path.to_path_buf(),
                titles: own.titles().to_vec(),
                named: true,
                unended_length: None,
                part: None,
                parsed: ParsedColumns::default(),
                kind: Kind::Arrays(own),
            };
            return Ok(tables.into_iter().map(table).collect());
        }
        #[cfg(not(feature = "arrays"))]
        if is_arrays(path) {
            return Err(unsupported(path, "file of arrays", "arrays"));
        }
        if first.starts_with(&PARQUET_MAGIC) {
            #[cfg(feature = "parquet")]
            {
                let (titles, contents) =
                    super::parquet::contents(path, self.episode, &mut self.dated)?;
                return Ok(vec![Table {
                    path: path.to_path_buf(),
                    titles,
                    named: true,
                    unended_length: None,
                    part: None,
                    parsed: ParsedColumns::default(),
                    kind: Kind::Parquet(contents),
                }]);
            }
            #[cfg(not(feature = "parquet"))]
            return Err(unsupported(path, "Parquet file", "parquet"));
        }
        let file = match file {
            Some(file) => file,
            None => File::open(path).map_err(io)?,
        };
        let mut written = Written::find(&file, self.format).map_err(io)?;
        if let Some(own) = written.dated {
            written.dated = Some(*self.dated.get_or_insert(own));
        }
        Ok(vec![Table {
            path: path.to_path_buf(),
            titles: written.titles.clone(),
            named: written.has_header(),
            unended_length: unended_length(&file),
            part: None,
            parsed: ParsedColumns::default(),
            kind: Kind::Csv(written, Arc::new(Mutex::new(Some(Arc::new(file))))),
        }])
    }
}

/// The unit that its file states of a column beside its title.
///
/// - `column`: its number, which counts through all tables.
pub(super) fn unit_of(tables: &[Table], column: usize) -> Option<&str> {
    let mut before = 0;
    tables.iter().find_map(|table| {
        let own = column.checked_sub(before)?;
        before += table.titles.len();
        table.unit(own)
    })
}

impl Table {
    /// The index of the column that is called so in other words than its title, such as a path without
    /// its first parts, or a field behind its topic.
    #[cfg_attr(
        not(any(feature = "arrays", feature = "bags")),
        allow(unused_variables, clippy::unused_self)
    )]
    pub(super) fn respelled(&self, name: &str) -> Option<usize> {
        match &self.kind {
            #[cfg(feature = "arrays")]
            Kind::Arrays(table) => table.place(name),
            #[cfg(feature = "bags")]
            Kind::Bag(table) => {
                let topic = table.topic().trim_start_matches('/');
                let name = name.trim_start_matches('/').strip_prefix(topic)?;
                let name = name.strip_prefix('.')?;
                self.titles.iter().position(|title| title == name)
            }
            _ => None,
        }
    }

    /// The index of the column of time that the format states.
    #[cfg_attr(not(feature = "arrays"), allow(clippy::unused_self))]
    pub(super) fn time(&self) -> Option<usize> {
        match &self.kind {
            #[cfg(feature = "arrays")]
            Kind::Arrays(table) => table.time(),
            _ => None,
        }
    }

    /// How much later than that of the first file its recording began, s, by the dates that both state beside their times.
    pub(super) fn later(&self) -> f64 {
        match &self.kind {
            #[cfg(feature = "arrays")]
            Kind::Arrays(table) => table.later(),
            _ => 0.0,
        }
    }

    /// The index of the first column of a matrix with so many columns.
    #[cfg_attr(not(feature = "arrays"), allow(unused_variables, clippy::unused_self))]
    pub(super) fn matrix(&self, names: &[&str], count: usize) -> Option<usize> {
        match &self.kind {
            #[cfg(feature = "arrays")]
            Kind::Arrays(table) => {
                let mut all = table.matrices().iter().filter(|own| own.count == count);
                let is_named = |own: &&regen_arrays::Matrix| names.contains(&own.last_name());
                all.find(is_named).map(|own| own.first)
            }
            _ => None,
        }
    }

    /// What the file has and the table lacks, with the reasons.
    pub(super) fn absent(&self) -> &[(String, String)] {
        match &self.kind {
            #[cfg(feature = "arrays")]
            Kind::Arrays(table) => table.absent(),
            #[cfg(feature = "bags")]
            Kind::Bag(table) => table.absent(),
            #[cfg(feature = "parquet")]
            Kind::Parquet(contents) => &contents.absent,
            Kind::Csv(written, _) => &written.remarks,
        }
    }

    /// The unit that the file states of a column beside its title.
    fn unit(&self, column: usize) -> Option<&str> {
        match &self.kind {
            #[cfg(feature = "arrays")]
            Kind::Arrays(table) => table.unit(column),
            #[cfg(feature = "parquet")]
            Kind::Parquet(contents) => {
                let unit = contents.units.get(column).map(String::as_str);
                unit.filter(|unit| !unit.is_empty())
            }
            #[cfg(feature = "bags")]
            Kind::Bag(_) => None,
            Kind::Csv(written, _) => {
                let unit = written.units.get(column).map(String::as_str);
                unit.filter(|unit| !unit.is_empty())
            }
        }
    }

    /// Whether the numbers of a column are dates or spans of time by their type, and thus in s.
    pub(super) fn is_clock(&self, column: usize) -> bool {
        match &self.kind {
            #[cfg(feature = "arrays")]
            Kind::Arrays(table) => table.is_clock(column),
            #[cfg(feature = "bags")]
            Kind::Bag(_) => matches!(
                self.titles.get(column).map(String::as_str),
                Some("t" | "t_received")
            ),
            #[cfg(feature = "parquet")]
            Kind::Parquet(contents) => contents.clocks.get(column).is_some_and(|own| *own),
            Kind::Csv(written, _) => written.dates == Some(column),
        }
    }

    /// Why the file has something of this name that is no column.
    #[cfg_attr(not(feature = "arrays"), allow(unused_variables, clippy::unused_self))]
    pub(super) fn why_absent(&self, name: &str) -> Option<&str> {
        match &self.kind {
            #[cfg(feature = "arrays")]
            Kind::Arrays(table) => table.why_absent(name),
            _ => None,
        }
    }

    /// Whether the file is a Parquet file, which may have episodes.
    pub(super) fn is_parquet(&self) -> bool {
        match &self.kind {
            #[cfg(feature = "parquet")]
            Kind::Parquet(_) => true,
            _ => false,
        }
    }

    /// Whether the file is a text.
    pub(super) fn is_text(&self) -> bool {
        matches!(self.kind, Kind::Csv(..))
    }

    /// The columns in memory.
    pub(super) fn parsed(&self) -> &ParsedColumns {
        &self.parsed
    }

    /// The rows of some columns, from the first row of [`part`](Self::part) on; what of them is not in memory
    /// is read before.
    pub(super) fn rows(&self, wanted: &[Wanted]) -> Result<ParsedRows, DataError> {
        self.parsed.rows(self, wanted)
    }

    /// The rows of some columns as they are in the file, from the first row of the file on.
    pub(super) fn stream(&self, wanted: Vec<Wanted>) -> Result<FileRows<'_>, DataError> {
        match &self.kind {
            #[cfg(feature = "parquet")]
            Kind::Parquet(contents) => Ok(FileRows::Parquet(super::parquet::ParquetRows::open(
                &self.path, contents, wanted,
            )?)),
            #[cfg(feature = "bags")]
            Kind::Bag(table) => Ok(FileRows::Bag(Box::new(super::bags::BagRows::open(
                table, wanted,
            )?))),
            #[cfg(feature = "arrays")]
            Kind::Arrays(table) => Ok(FileRows::Arrays(super::arrays::ArrayRows::open(
                table, wanted,
            )?)),
            Kind::Csv(written, opened) => {
                let opened = opened.lock().unwrap_or_else(PoisonError::into_inner).take();
                let file = match opened {
                    Some(file) => file,
                    None => Arc::new(File::open(&self.path).map_err(|error| DataError::Io {
                        file: self.path.display().to_string(),
                        why: error.to_string(),
                    })?),
                };
                Ok(FileRows::Csv(CsvRows::open(self, written, file, wanted)?))
            }
        }
    }
}

impl FileRows<'_> {
    /// Takes the memory of a row back, for the next one.
    pub(super) fn reuse(&mut self, values: Vec<f64>) {
        #[cfg_attr(
            not(any(feature = "arrays", feature = "parquet", feature = "bags")),
            allow(irrefutable_let_patterns)
        )]
        if let Self::Csv(rows) = self {
            rows.reuse(values);
        }
    }

    /// The next row; `None` behind the last one.
    pub(super) fn next_row(&mut self) -> Result<Option<FileRow>, DataError> {
        match self {
            Self::Csv(rows) => rows.next_row(),
            #[cfg(feature = "parquet")]
            Self::Parquet(rows) => rows.next_row(),
            #[cfg(feature = "bags")]
            Self::Bag(rows) => rows.next_row(),
            #[cfg(feature = "arrays")]
            Self::Arrays(rows) => Ok(rows.next_row()),
        }
    }
}

/// The error of a file that cannot be read.
pub(super) fn failed(path: &Path, error: &csv::Error) -> DataError {
    DataError::Io {
        file: path.display().to_string(),
        why: format!("{error}"),
    }
}
