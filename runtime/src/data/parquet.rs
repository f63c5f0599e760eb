//! Rows of a Parquet file, a row group's pages at a time.

use std::format;
use std::fs::File;
use std::path::Path;
use std::prelude::v1::*;
use std::vec;

use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};

use super::columns::Layout;
use super::problem::{DataError, Fault, Problem};
use super::reader::Kept;

/// Rows read at a time.
const BATCH: usize = 4096;

/// What a row becomes.
pub(super) type Each<'a> = dyn FnMut(Result<Kept, Problem>) -> Result<(), DataError> + 'a;

fn open(path: &Path) -> Result<SerializedFileReader<File>, DataError> {
    let file = File::open(path).map_err(|error| DataError::Io {
        file: path.display().to_string(),
        why: format!("{error}"),
    })?;
    SerializedFileReader::new(file).map_err(|error| failed(path, &error))
}

fn failed(path: &Path, error: &ParquetError) -> DataError {
    DataError::Io {
        file: path.display().to_string(),
        why: format!("{error}"),
    }
}

/// The names of the columns.
pub(super) fn header(path: &Path) -> Result<Vec<String>, DataError> {
    let reader = open(path)?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    Ok(schema.columns().iter().map(|c| c.path().string()).collect())
}

/// A column's batch: a number or nothing for each row.
type Entries = Vec<Option<f64>>;

fn typed<T: DataType>(
    reader: &mut ColumnReaderImpl<T>,
    rows: usize,
    deepest: i16,
    number: impl Fn(&T::T) -> f64,
) -> Result<Entries, ParquetError> {
    let (mut levels, mut values) = (Vec::new(), Vec::new());
    let mut out = Vec::with_capacity(rows);
    // a page ends a call
    while out.len() < rows {
        levels.clear();
        values.clear();
        let wanted = rows - out.len();
        let (records, ..) = reader.read_records(wanted, Some(&mut levels), None, &mut values)?;
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

fn batch(
    reader: &mut ColumnReader,
    rows: usize,
    deepest: i16,
) -> Result<Option<Entries>, ParquetError> {
    Ok(Some(match reader {
        ColumnReader::DoubleColumnReader(r) => typed(r, rows, deepest, |x| *x)?,
        ColumnReader::FloatColumnReader(r) => typed(r, rows, deepest, |x| f64::from(*x))?,
        ColumnReader::Int32ColumnReader(r) => typed(r, rows, deepest, |x| f64::from(*x))?,
        ColumnReader::Int64ColumnReader(r) => typed(r, rows, deepest, |x| *x as f64)?,
        _ => return Ok(None),
    }))
}

/// Hands over all rows in order, counted from 1.
pub(super) fn records(path: &Path, layout: &Layout, each: &mut Each<'_>) -> Result<(), DataError> {
    let wrong = |error: ParquetError| failed(path, &error);
    let unfit = |why: String| DataError::Layout {
        file: path.display().to_string(),
        why,
    };
    let reader = open(path)?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let mut line = 0;
    for group in 0..reader.num_row_groups() {
        let group = reader.get_row_group(group).map_err(wrong)?;
        let mut columns = Vec::with_capacity(layout.channels.len());
        for (entry, channel) in layout.channels.iter().enumerate() {
            let column = schema.column(channel.index);
            if column.max_rep_level() > 0 {
                let title = layout.title(entry);
                return Err(unfit(format!("column `{title}` holds lists, not numbers")));
            }
            let own = group.get_column_reader(channel.index).map_err(wrong)?;
            columns.push((own, column.max_def_level()));
        }
        let rows = group.metadata().num_rows();
        let mut left = usize::try_from(rows).unwrap_or_default();
        while left > 0 {
            let count = left.min(BATCH);
            left -= count;
            let mut entries: Vec<Entries> = vec![];
            for (entry, (column, deepest)) in columns.iter_mut().enumerate() {
                let found = batch(column, count, *deepest).map_err(wrong)?;
                let found = found.ok_or_else(|| {
                    let title = layout.title(entry);
                    unfit(format!("column `{title}` holds no numbers"))
                })?;
                if found.len() != count {
                    let title = layout.title(entry);
                    return Err(unfit(format!("column `{title}` ends before the others")));
                }
                entries.push(found);
            }
            for row in 0..count {
                line += 1;
                each(kept(layout, line, entries.iter().map(|e| e[row])))?;
            }
        }
    }
    Ok(())
}

fn kept(
    layout: &Layout,
    line: u64,
    entries: impl Iterator<Item = Option<f64>>,
) -> Result<Kept, Problem> {
    let mut values = Vec::with_capacity(layout.channels.len());
    for (entry, (channel, value)) in layout.channels.iter().zip(entries).enumerate() {
        match value {
            Some(value) if value.is_finite() => values.push(value * channel.factor),
            other => {
                let text = other.map_or_else(|| "null".to_owned(), |x| format!("{x}"));
                return Err(Problem {
                    row: line,
                    what: Fault::NotANumber {
                        column: layout.title(entry),
                        text,
                    },
                });
            }
        }
    }
    Ok(Kept { line, values })
}
