//! Reads the rows of a Parquet file, one row group after another.

mod contents;
mod format;
mod guard;
mod lists;
mod pages;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};

use self::contents::Place;
pub(super) use self::contents::{Contents, contents};
use self::guard::catch_panic;
use super::file_rows::{FileRow, Wanted};
use super::problem::{DataError, Fault};

/// Rows decoded at a time.
const BATCH: usize = 4096;
/// Longest footer in bytes: enough for hundreds of columns in thousands of row groups.
const MAX_FOOTER_BYTES: u64 = 1 << 24;
/// Deepest nesting of groups of columns.
const MAX_NESTING: usize = 32;
/// The largest number of rows per byte of a file: equal numbers and equal steps are encoded in a
/// few bytes, but time and forces differ from row to row.
const MAX_ROWS_PER_BYTE: u64 = 1000;

fn open(path: &Path) -> Result<SerializedFileReader<File>, DataError> {
    let io = |error: std::io::Error| DataError::Io {
        file: path.display().to_string(),
        why: format!("{error}"),
    };
    let mut file = File::open(path).map_err(io)?;
    let mut tail = [0; 8];
    let size = file.metadata().map_err(io)?.len();
    if size >= 12 {
        file.seek(SeekFrom::End(-8)).map_err(io)?;
        file.read_exact(&mut tail).map_err(io)?;
        let footer = u64::from(u32::from_le_bytes([tail[0], tail[1], tail[2], tail[3]]));
        if footer > MAX_FOOTER_BYTES {
            return Err(broken(path, &format!("its footer claims {footer} bytes")));
        }
        if let Some(start) = (size - 8).checked_sub(footer) {
            let mut bytes = Vec::new();
            file.seek(SeekFrom::Start(start)).map_err(io)?;
            let mut text = file.by_ref().take(footer);
            text.read_to_end(&mut bytes).map_err(io)?;
            if pages::nesting(&bytes).is_none_or(|deep| deep > MAX_NESTING) {
                let why =
                    format!("its footer is none, or has groups nested deeper than {MAX_NESTING}");
                return Err(broken(path, &why));
            }
        }
    }
    catch_panic(|| SerializedFileReader::new(file)).map_err(|error| failed(path, &error))
}

fn broken(path: &Path, why: &str) -> DataError {
    DataError::Io {
        file: path.display().to_string(),
        why: format!("this is a broken Parquet file: {why}"),
    }
}

fn failed(path: &Path, error: &ParquetError) -> DataError {
    DataError::Io {
        file: path.display().to_string(),
        why: format!("{error}"),
    }
}

/// A batch of a column: for each row its number, or `None` for null; of lists the numbers of all
/// elements.
type Entries = Vec<Option<f64>>;

fn typed<T: DataType>(
    reader: &mut ColumnReaderImpl<T>,
    rows: usize,
    deepest: i16,
    number: impl Fn(&T::T) -> f64,
) -> Result<Entries, ParquetError> {
    let (mut levels, mut values) = (Vec::new(), Vec::new());
    let mut out = Vec::with_capacity(rows);
    // one call reads at most to the end of a page
    while out.len() < rows {
        levels.clear();
        values.clear();
        let wanted = rows - out.len();
        let (records, ..) =
            catch_panic(|| reader.read_records(wanted, Some(&mut levels), None, &mut values))?;
        if records == 0 {
            break;
        }
        let mut numbers = values.iter().map(&number);
        if deepest == 0 {
            out.extend(numbers.map(Some));
        } else {
            let entry = |level: &i16| {
                if *level == deepest {
                    numbers.next()
                } else {
                    None
                }
            };
            out.extend(levels.iter().map(entry));
        }
    }
    Ok(out)
}

/// The numbers of the next rows; `None` for a column without numbers.
fn batch(column: &mut Column, rows: usize) -> Result<Option<Entries>, ParquetError> {
    fn of<T: DataType>(
        reader: &mut ColumnReaderImpl<T>,
        rows: usize,
        (width, deepest): (Option<usize>, i16),
        number: impl Fn(&T::T) -> f64,
    ) -> Result<Entries, ParquetError> {
        match width {
            Some(width) => lists::typed(reader, rows, width, deepest, number),
            None => typed(reader, rows, deepest, number),
        }
    }
    let kind = (column.width, column.deepest);
    Ok(Some(match &mut column.reader {
        ColumnReader::DoubleColumnReader(r) => of(r, rows, kind, |x| *x)?,
        ColumnReader::FloatColumnReader(r) => of(r, rows, kind, |x| f64::from(*x))?,
        ColumnReader::Int32ColumnReader(r) => of(r, rows, kind, |x| f64::from(*x))?,
        ColumnReader::Int64ColumnReader(r) => of(r, rows, kind, |x| *x as f64)?,
        _ => return Ok(None),
    }))
}

/// A column of the present row group.
struct Column {
    reader: ColumnReader,
    /// The length of its lists; `None` for numbers.
    width: Option<usize>,
    /// Its largest definition level, that of entries which are not null.
    deepest: i16,
}

/// A column of the file that is read, of which several elements may be wanted.
struct Leaf {
    index: usize,
    title: String,
    width: Option<usize>,
}

/// The number of rows of each row group, after a check that its pages' headers are plausible.
fn rows(
    path: &Path,
    reader: &SerializedFileReader<File>,
    leaves: &[Leaf],
) -> Result<Vec<usize>, DataError> {
    let io = |error: std::io::Error| DataError::Io {
        file: path.display().to_string(),
        why: format!("{error}"),
    };
    let mut file = File::open(path).map_err(io)?;
    let size = file.metadata().map_err(io)?.len();
    let mut out = Vec::new();
    let mut total = 0_u64;
    for group in reader.metadata().row_groups() {
        let rows = u64::try_from(group.num_rows())
            .map_err(|_| broken(path, "it claims less than no rows"))?;
        total = total.saturating_add(rows);
        if total > size.saturating_mul(MAX_ROWS_PER_BYTE) {
            return Err(broken(
                path,
                &format!(
                    "{size} bytes claim {total} rows; the limit is {MAX_ROWS_PER_BYTE} rows a byte"
                ),
            ));
        }
        for Leaf { index, title, .. } in leaves {
            let chunk = group.columns().get(*index);
            let chunk = chunk
                .ok_or_else(|| broken(path, &format!("a row group has no column `{title}`")))?;
            let values = pages::values(&mut file, size, chunk)
                .map_err(|why| broken(path, &format!("column `{title}`: {why}")))?;
            if values < rows {
                return Err(unfit(
                    path,
                    format!("column `{title}` ends before the others"),
                ));
            }
        }
        out.push(usize::try_from(rows).unwrap_or_default());
    }
    Ok(out)
}

fn unfit(path: &Path, why: String) -> DataError {
    DataError::ColumnLayout {
        file: path.display().to_string(),
        why,
    }
}

/// The rows of a Parquet file, numbered from 1.
pub(super) struct ParquetRows {
    path: PathBuf,
    wanted: Vec<Wanted>,
    /// For each wanted column the index of its leaf, and its place there.
    places: Vec<(usize, Place)>,
    leaves: Vec<Leaf>,
    /// The first and the last row that is read, from 1.
    span: Option<(u64, u64)>,
    reader: SerializedFileReader<File>,
    /// The number of rows of each row group.
    groups: Vec<usize>,
    /// The next row group.
    group: usize,
    /// The columns of the present row group.
    columns: Vec<Column>,
    /// Rows of the present row group that are not decoded yet.
    undecoded: usize,
    /// Decoded rows, column by column.
    entries: Vec<Entries>,
    /// The next decoded row, and the number of decoded rows.
    place: (usize, usize),
    line: u64,
}

impl ParquetRows {
    /// Opens a file before its first row.
    pub(super) fn open(
        path: &Path,
        contents: &Contents,
        wanted: Vec<Wanted>,
    ) -> Result<Self, DataError> {
        let reader = open(path)?;
        let schema = reader.metadata().file_metadata().schema_descr_ptr();
        let mut places = Vec::with_capacity(wanted.len());
        let mut leaves: Vec<Leaf> = Vec::new();
        for Wanted { column, title } in &wanted {
            let place = contents.places.get(*column).copied();
            let place = place.filter(|place| place.leaf < schema.num_columns());
            let place =
                place.ok_or_else(|| unfit(path, format!("column `{title}` has disappeared")))?;
            let width = place.element.map(|(_, width)| width);
            if schema.column(place.leaf).max_rep_level() != i16::from(width.is_some()) {
                let why = format!("column `{title}` holds lists, not numbers");
                return Err(unfit(path, why));
            }
            let known = leaves.iter().position(|own| own.index == place.leaf);
            let index = known.unwrap_or_else(|| {
                leaves.push(Leaf {
                    index: place.leaf,
                    title: title.clone(),
                    width,
                });
                leaves.len() - 1
            });
            places.push((index, place));
        }
        Ok(Self {
            path: path.to_path_buf(),
            groups: rows(path, &reader, &leaves)?,
            wanted,
            places,
            leaves,
            span: contents.rows,
            reader,
            group: 0,
            columns: Vec::new(),
            undecoded: 0,
            entries: Vec::new(),
            place: (0, 0),
            line: 0,
        })
    }

    /// The next row; `None` behind the last one.
    pub(super) fn next_row(&mut self) -> Result<Option<FileRow>, DataError> {
        let (first, last) = self.span.unwrap_or((1, u64::MAX));
        while self.line < last
            && let Some(row) = self.advance()?
        {
            if row >= first {
                return Ok(Some(FileRow {
                    line: row,
                    values: self.values(),
                }));
            }
        }
        Ok(None)
    }

    /// Advances to the next row of the file, whether it is wanted or not; returns its number, or
    /// `None` after the last one.
    fn advance(&mut self) -> Result<Option<u64>, DataError> {
        while self.place.0 == self.place.1 {
            if self.undecoded == 0 {
                let Some(rows) = self.groups.get(self.group) else {
                    return Ok(None);
                };
                self.undecoded = *rows;
                self.open_group()?;
                self.group += 1;
            } else {
                self.decode()?;
            }
        }
        self.place.0 += 1;
        self.line += 1;
        Ok(Some(self.line))
    }

    /// Opens the columns of the next row group.
    fn open_group(&mut self) -> Result<(), DataError> {
        let wrong = |error: ParquetError| failed(&self.path, &error);
        let schema = self.reader.metadata().file_metadata().schema_descr_ptr();
        let group = catch_panic(|| self.reader.get_row_group(self.group)).map_err(wrong)?;
        self.columns.clear();
        for Leaf { index, width, .. } in &self.leaves {
            let reader = catch_panic(|| group.get_column_reader(*index)).map_err(wrong)?;
            self.columns.push(Column {
                reader,
                width: *width,
                deepest: schema.column(*index).max_def_level(),
            });
        }
        Ok(())
    }

    /// Decodes the next rows of the present row group.
    fn decode(&mut self) -> Result<(), DataError> {
        let count = self.undecoded.min(BATCH);
        self.undecoded -= count;
        self.entries.clear();
        for (column, Leaf { title, .. }) in self.columns.iter_mut().zip(&self.leaves) {
            let decoded = batch(column, count).map_err(|e| failed(&self.path, &e))?;
            let decoded = decoded
                .ok_or_else(|| unfit(&self.path, format!("column `{title}` holds no numbers")))?;
            if decoded.len() != count.saturating_mul(column.width.unwrap_or(1)) {
                let why = format!("column `{title}` ends before the others");
                return Err(unfit(&self.path, why));
            }
            self.entries.push(decoded);
        }
        self.place = (0, count);
        Ok(())
    }

    /// The numbers of the present row.
    fn values(&self) -> Result<Vec<f64>, Fault> {
        let row = self.place.0 - 1;
        let mut values = Vec::with_capacity(self.wanted.len() + 1);
        for (wanted, (leaf, place)) in self.wanted.iter().zip(&self.places) {
            let (element, width) = place.element.unwrap_or((0, 1));
            let entry = self.entries.get(*leaf);
            let entry = entry.and_then(|all| all.get(row * width + element));
            match entry.copied().flatten() {
                Some(value) if value.is_finite() => values.push(match place.rate {
                    Some(rate) => contents::restored(value, rate),
                    None => value,
                }),
                other => {
                    let text = other.map_or_else(|| "null".to_owned(), |x| format!("{x}"));
                    return Err(Fault::NotANumber {
                        column: wanted.title.clone(),
                        text,
                    });
                }
            }
        }
        Ok(values)
    }
}
