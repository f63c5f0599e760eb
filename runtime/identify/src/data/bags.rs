//! Reads the rows of recordings of robots: MCAP files and ROS 2 bags.

use std::path::Path;

use regen_bags::{BagError, Log, Rows, Table};

use super::file_rows::{FileRow, Wanted};
use super::problem::DataError;

/// The tables of a topic.
///
/// - `start`: the stamp from which times count, ns; that of this recording if there is none yet.
pub(super) fn tables(
    path: &Path,
    topic: Option<&str>,
    start: &mut Option<i64>,
) -> Result<Vec<Table>, DataError> {
    let log = Log::open(path, topic).map_err(|error| failed(&error))?;
    let start = *start.get_or_insert(log.start());
    Ok(log.starting_at(start).tables().to_vec())
}

/// The titles of a table; those of columns without any number say so, and name no quantity.
pub(super) fn titles(table: &Table) -> Result<Vec<String>, DataError> {
    let titles = table.titles();
    let mut empty: Vec<usize> = (0..titles.len()).collect();
    let mut rows = table.rows(&empty).map_err(|error| failed(&error))?;
    // nearly always the first message has all numbers
    while !empty.is_empty() {
        let Some(row) = rows.next_row().map_err(|error| failed(&error))? else {
            break;
        };
        let is_number = |k: &usize| {
            row.values
                .get(*k)
                .is_some_and(|x| x.is_some_and(f64::is_finite))
        };
        empty.retain(|k| !is_number(k));
    }
    let named = titles.iter().enumerate().map(|(k, title)| {
        if empty.contains(&k) {
            format!("{title} (without a number)")
        } else {
            title.clone()
        }
    });
    Ok(named.collect())
}

fn failed(error: &BagError) -> DataError {
    let (file, why) = (error.file().display().to_string(), error.reason());
    match error {
        BagError::Topic { .. } => DataError::Part {
            file,
            why,
            key: "topic",
        },
        BagError::Joints { .. } => DataError::ColumnLayout { file, why },
        _ => DataError::Io { file, why },
    }
}

/// The rows of a table of a recording.
pub(super) struct BagRows {
    rows: Rows,
    wanted: Vec<Wanted>,
}

impl BagRows {
    /// Opens a recording before its first message.
    pub(super) fn open(table: &Table, wanted: Vec<Wanted>) -> Result<Self, DataError> {
        let columns: Vec<usize> = wanted.iter().map(|wanted| wanted.column).collect();
        Ok(Self {
            rows: table.rows(&columns).map_err(|error| failed(&error))?,
            wanted,
        })
    }

    /// The next row; `None` behind the last one.
    pub(super) fn next_row(&mut self) -> Result<Option<FileRow>, DataError> {
        let Some(row) = self.rows.next_row().map_err(|error| failed(&error))? else {
            return Ok(None);
        };
        let entries = row.values.into_iter().map(|value| match value {
            Some(value) if value.is_finite() => Ok(value),
            other => Err(other.map_or_else(String::new, |x| x.to_string())),
        });
        Ok(Some(FileRow::new(
            row.number,
            &self.wanted,
            entries,
            Vec::new(),
        )))
    }
}
