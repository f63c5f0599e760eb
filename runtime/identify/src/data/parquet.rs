//! Reads the rows of a Parquet file, one row group after another.

mod arrow;
mod contents;
mod decompress;
mod format;
mod guard;
mod lists;
mod pages;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use parquet::basic::{ConvertedType, LogicalType, TimeUnit, TimestampType};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl, get_column_reader};
use parquet::data_type::{DataType, FixedLenByteArray};
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use self::contents::Place;
pub(super) use self::contents::{Contents, contents};
use self::guard::catch_panic;
use self::pages::Pages;
use super::file_rows::{FileRow, Wanted};
use super::problem::DataError;

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
        why: words(error),
    }
}

/// An error in words, without the name of the library's type.
fn words(error: &ParquetError) -> String {
    match error {
        ParquetError::General(why) => why.clone(),
        other => other.to_string(),
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

/// How the bits of a column are read as numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Plain,
    /// Integers without a sign, which the file's types lack.
    Unsigned,
    /// Integers of so many parts of one, a power of ten.
    Decimal(f64),
    /// Half precision, in two bytes.
    Half,
    /// Counts of so many ns, of dates from a date on, ns.
    Clock(i64, i64),
}

/// Whether a column has dates, and no times of the day.
fn has_dates(column: &ColumnDescriptor) -> bool {
    let converted = column.converted_type();
    matches!(column.logical_type_ref(), Some(LogicalType::Timestamp(_)))
        || matches!(
            converted,
            ConvertedType::TIMESTAMP_MILLIS | ConvertedType::TIMESTAMP_MICROS
        )
}

impl Kind {
    /// - `dated`: the date from which dates count, ns since 1970.
    fn of(column: &ColumnDescriptor, dated: i64) -> Self {
        let tick = |unit| match unit {
            TimeUnit::MILLIS => 1_000_000,
            TimeUnit::MICROS => 1000,
            TimeUnit::NANOS => 1,
        };
        let dated = if has_dates(column) { dated } else { 0 };
        match (column.logical_type_ref(), column.converted_type()) {
            (
                Some(
                    LogicalType::Timestamp(TimestampType { unit, .. })
                    | LogicalType::Time(TimestampType { unit, .. }),
                ),
                _,
            ) => Self::Clock(tick(*unit), dated),
            (_, ConvertedType::TIMESTAMP_MILLIS | ConvertedType::TIME_MILLIS) => {
                Self::Clock(tick(TimeUnit::MILLIS), dated)
            }
            (_, ConvertedType::TIMESTAMP_MICROS | ConvertedType::TIME_MICROS) => {
                Self::Clock(tick(TimeUnit::MICROS), dated)
            }
            (Some(LogicalType::Float16), _) => Self::Half,
            (Some(LogicalType::Integer(int)), _) if !int.is_signed => Self::Unsigned,
            (_, ConvertedType::UINT_32 | ConvertedType::UINT_64) => Self::Unsigned,
            (Some(LogicalType::Decimal(_)), _) | (_, ConvertedType::DECIMAL) => {
                Self::Decimal(10_f64.powi(column.type_scale()))
            }
            _ => Self::Plain,
        }
    }

    fn int32(self, x: i32) -> f64 {
        match self {
            Self::Unsigned => f64::from(x.cast_unsigned()),
            Self::Decimal(parts) => f64::from(x) / parts,
            Self::Clock(..) => self.int64(i64::from(x)),
            _ => f64::from(x),
        }
    }

    fn int64(self, x: i64) -> f64 {
        match self {
            Self::Unsigned => x.cast_unsigned() as f64,
            Self::Decimal(parts) => x as f64 / parts,
            // differences of integers, which seconds since 1970 do not resolve
            Self::Clock(tick, from) => {
                (i128::from(x) * i128::from(tick) - i128::from(from)) as f64 / 1e9
            }
            _ => x as f64,
        }
    }
}

/// The number of two bytes in half precision; NaN for other lengths.
fn half(bytes: &FixedLenByteArray) -> f64 {
    let bytes = bytes.data().first_chunk::<2>();
    bytes.map_or(f64::NAN, |bytes| half::f16::from_le_bytes(*bytes).to_f64())
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
    let (levels, kind) = ((column.width, column.deepest), column.kind);
    Ok(Some(match &mut column.reader {
        ColumnReader::DoubleColumnReader(r) => of(r, rows, levels, |x| *x)?,
        ColumnReader::FloatColumnReader(r) => of(r, rows, levels, |x| f64::from(*x))?,
        ColumnReader::Int32ColumnReader(r) => of(r, rows, levels, |x| kind.int32(*x))?,
        ColumnReader::Int64ColumnReader(r) => of(r, rows, levels, |x| kind.int64(*x))?,
        ColumnReader::FixedLenByteArrayColumnReader(r) if kind == Kind::Half => {
            of(r, rows, levels, half)?
        }
        _ => return Ok(None),
    }))
}

/// A column of the present row group.
struct Column {
    reader: ColumnReader,
    kind: Kind,
    /// The length of its lists; `None` for numbers.
    width: Option<usize>,
    /// Its largest definition level, that of entries which are not null.
    deepest: i16,
}

/// A reader of a column of a row group; the error says what is wrong in words.
fn column(
    path: &Path,
    reader: &SerializedFileReader<File>,
    group: usize,
    leaf: usize,
) -> Result<ColumnReader, String> {
    let (metadata, file) = (reader.metadata(), File::open(path));
    let file = file.map_err(|error| error.to_string())?;
    let size = file.metadata().map_err(|error| error.to_string())?.len();
    let chunk = metadata
        .row_groups()
        .get(group)
        .and_then(|all| all.columns().get(leaf));
    let chunk = chunk.ok_or("a row group lacks it")?;
    let pages = Pages::new(file, size, chunk)?;
    let found = catch_panic(|| Ok(get_column_reader(chunk.column_descr_ptr(), Box::new(pages))));
    found.map_err(|error| words(&error))
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
    let file = File::open(path).map_err(io)?;
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
        // of a group without rows, some writers store no page
        for Leaf { index, title, .. } in leaves.iter().filter(|_| rows > 0) {
            let chunk = group.columns().get(*index);
            let chunk = chunk
                .ok_or_else(|| broken(path, &format!("a row group has no column `{title}`")))?;
            let values = Pages::new(file.try_clone().map_err(io)?, size, chunk)
                .and_then(Pages::values)
                .map_err(|why| broken(path, &in_column(title, &why)))?;
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

fn in_column(title: &str, why: &str) -> String {
    format!("column `{title}`: {why}")
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
    /// The date from which dates count, ns since 1970.
    dated: i64,
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
            dated: contents.dated,
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
                return Ok(Some(self.row(row)));
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
        let schema = self.reader.metadata().file_metadata().schema_descr_ptr();
        self.columns.clear();
        for Leaf {
            index,
            title,
            width,
        } in &self.leaves
        {
            let reader = column(&self.path, &self.reader, self.group, *index);
            let reader = reader.map_err(|why| broken(&self.path, &in_column(title, &why)))?;
            let column = schema.column(*index);
            self.columns.push(Column {
                reader,
                kind: Kind::of(&column, self.dated),
                width: *width,
                deepest: column.max_def_level(),
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
            let decoded = batch(column, count)
                .map_err(|error| broken(&self.path, &in_column(title, &words(&error))))?;
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

    /// The present row.
    fn row(&self, line: u64) -> FileRow {
        let row = self.place.0 - 1;
        let entries = self.places.iter().map(|(leaf, place)| {
            let (element, width) = place.element.unwrap_or((0, 1));
            let entry = self.entries.get(*leaf);
            let entry = entry.and_then(|all| all.get(row * width + element));
            match entry.copied().flatten() {
                Some(value) if value.is_finite() => Ok(match place.rate {
                    Some(rate) => contents::restored(value, rate),
                    None => value,
                }),
                other => Err(other.map_or_else(|| "null".to_owned(), |x| format!("{x}"))),
            }
        });
        FileRow::new(line, &self.wanted, entries, Vec::new())
    }
}
