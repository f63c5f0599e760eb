//! Reads the rows of one file one after another, as the numbers in the file, not converted to SI.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::csv_rows::CsvRows;
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
}

/// How a file is read.
#[derive(Clone, Debug)]
enum Kind {
    Csv(Written),
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
    /// The same of the dates in CSV files.
    pub(super) dated: Option<i64>,
}

/// A row of a file.
#[derive(Debug, PartialEq)]
pub(super) struct FileRow {
    /// The line of a CSV file, the row of a Parquet file or the number of a message, from 1.
    pub(super) line: u64,
    /// The numbers of the wanted columns as in the file, or why they cannot be used.
    pub(super) values: Result<Vec<f64>, Fault>,
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

/// Whether a file is Parquet, by its first bytes; false if it cannot be read, which a later read
/// reports.
fn is_parquet(path: &Path) -> bool {
    let mut start = [0; 4];
    File::open(path).is_ok_and(|mut file| file.read_exact(&mut start).is_ok())
        && start == PARQUET_MAGIC
}

/// The length in bytes of a file whose last line has no end of line; `None` for other files and
/// where it cannot be read, which a later read reports.
fn unended_length(path: &Path) -> Option<u64> {
    let mut file = File::open(path).ok()?;
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
        require_regular(path).map_err(|error| DataError::Io {
            file: path.display().to_string(),
            why: error.to_string(),
        })?;
        #[cfg(feature = "bags")]
        if regen_bags::is_bag(path) {
            let tables = super::bags::tables(path, self.topic, &mut self.start)?;
            let table = |own: regen_bags::Table| {
                Ok(Table {
                    path: path.to_path_buf(),
                    titles: super::bags::titles(&own)?,
                    named: true,
                    unended_length: None,
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
        if regen_arrays::is_arrays(path) {
            let tables = super::arrays::tables(path, self.time)?;
            let table = |own: regen_arrays::Table| Table {
                path: path.to_path_buf(),
                titles: own.titles().to_vec(),
                named: true,
                unended_length: None,
                kind: Kind::Arrays(own),
            };
            return Ok(tables.into_iter().map(table).collect());
        }
        #[cfg(not(feature = "arrays"))]
        if is_arrays(path) {
            return Err(unsupported(path, "file of arrays", "arrays"));
        }
        Ok(vec![self.table(path)?])
    }

    /// Finds the format of a CSV or Parquet file.
    fn table(&mut self, path: &Path) -> Result<Table, DataError> {
        if is_parquet(path) {
            #[cfg(feature = "parquet")]
            {
                let (titles, contents) = super::parquet::contents(path, self.episode)?;
                return Ok(Table {
                    path: path.to_path_buf(),
                    titles,
                    named: true,
                    unended_length: None,
                    kind: Kind::Parquet(contents),
                });
            }
            #[cfg(not(feature = "parquet"))]
            return Err(unsupported(path, "Parquet file", "parquet"));
        }
        let mut written = Written::find(path, self.format).map_err(|error| DataError::Io {
            file: path.display().to_string(),
            why: error.to_string(),
        })?;
        if let Some(own) = written.dated {
            written.dated = Some(*self.dated.get_or_insert(own));
        }
        Ok(Table {
            path: path.to_path_buf(),
            titles: written.titles.clone(),
            named: written.has_header(),
            unended_length: unended_length(path),
            kind: Kind::Csv(written),
        })
    }
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
    #[cfg_attr(not(feature = "arrays"), allow(clippy::unused_self))]
    pub(super) fn absent(&self) -> &[(String, String)] {
        match &self.kind {
            #[cfg(feature = "arrays")]
            Kind::Arrays(table) => table.absent(),
            _ => &[],
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
        !matches!(self.kind, Kind::Csv(_)) && is_parquet(&self.path)
    }

    /// The rows of some columns, from the first row on.
    pub(super) fn rows(&self, wanted: Vec<Wanted>) -> Result<FileRows<'_>, DataError> {
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
            Kind::Csv(written) => Ok(FileRows::Csv(CsvRows::open(self, written, wanted)?)),
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
