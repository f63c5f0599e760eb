//! Reads the rows of files of arrays: NPY, NPZ, MAT, HDF5, MDF 4 and TDMS.

use std::path::Path;

use regen_arrays::{ArrayError, Table};

use super::file_rows::{FileRow, Wanted};
use super::problem::DataError;

/// The tables of a file.
///
/// - `time`: the column of time that the user states.
/// - `dated`: the date from which dates count, ns since 1970; the first one of this file if there is none yet.
pub(super) fn tables(
    path: &Path,
    time: Option<&str>,
    dated: &mut Option<i64>,
) -> Result<Vec<Table>, DataError> {
    let all = regen_arrays::open(path, time).map_err(|error| failed(&error))?;
    let counted = all.into_iter().map(|own| match own.date() {
        Some(date) => own.counting_from(*dated.get_or_insert(date)),
        None => own,
    });
    Ok(counted.collect())
}

fn failed(error: &ArrayError) -> DataError {
    let (file, why) = (error.file().display().to_string(), error.reason());
    if error.is_refused() {
        DataError::ColumnLayout { file, why }
    } else {
        DataError::Io { file, why }
    }
}

/// The rows of a table of arrays.
pub(super) struct ArrayRows {
    wanted: Vec<Wanted>,
    columns: Vec<Vec<f64>>,
    rows: usize,
    /// The number of rows that were handed out.
    given: usize,
}

impl ArrayRows {
    /// Reads the columns.
    pub(super) fn open(table: &Table, wanted: Vec<Wanted>) -> Result<Self, DataError> {
        let places: Vec<usize> = wanted.iter().map(|wanted| wanted.column).collect();
        Ok(Self {
            columns: table.columns(&places).map_err(|error| failed(&error))?,
            wanted,
            rows: table.rows(),
            given: 0,
        })
    }

    /// The next row; `None` behind the last one.
    pub(super) fn next_row(&mut self) -> Option<FileRow> {
        if self.given == self.rows {
            return None;
        }
        let row = self.given;
        self.given += 1;
        let entries = self.columns.iter().map(|column| match column.get(row) {
            Some(value) if value.is_finite() => Ok(*value),
            other => Err(other.map_or_else(String::new, f64::to_string)),
        });
        Some(FileRow::new(
            self.given as u64,
            &self.wanted,
            entries,
            Vec::new(),
        ))
    }
}
