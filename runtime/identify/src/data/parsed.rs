//! The rows of the files of a run in memory, column by column, so that each file is read once.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::file_rows::{FileRow, Opening, RowFault, Table, Wanted};
use super::memory::Room;
use super::problem::{DataError, Fault};
use super::survey::{Statistics, Surveyed};
use super::table::Format;

/// What has been read of the files of runs. Clones share it, so that a file is read once however often
/// its run is opened; what changes in the file in the meantime is not noticed.
///
/// ```
/// use regen_identify::data::{RawLog, Run, Settings};
///
/// let path = std::env::temp_dir().join(format!("parsed-{}.csv", std::process::id()));
/// std::fs::write(&path, "t,q1\n0,0.5\n0.1,0.6\n")?;
/// let run = Run::from(path.as_path());
/// let count = |run: &Run| -> Result<usize, Box<dyn core::error::Error>> {
///     let mut rows = 0;
///     RawLog::open(run, &Settings::default())?.visit(&mut |_| rows += 1)?;
///     Ok(rows)
/// };
/// assert_eq!(count(&run)?, 2);
/// std::fs::remove_file(&path)?;
/// assert_eq!(count(&run.clone())?, 2, "the file is not needed any more");
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Clone, Default)]
pub struct ParsedFiles {
    known: Arc<Mutex<Vec<Known>>>,
    surveyed: Arc<Mutex<Vec<SurveyedRows>>>,
}

/// Rows and their statistics.
type SurveyedRows = (Surveyed, Arc<Statistics>);

/// The tables of a file, and how it was opened.
struct Known {
    opened: Opened,
    tables: Vec<Table>,
    /// The stamps of [`Opening::start`] and [`Opening::dated`] after it was opened.
    stamps: [Option<i64>; 2],
}

/// A file, and all that tells how it is opened.
#[derive(PartialEq)]
struct Opened {
    path: PathBuf,
    format: Format,
    topic: Option<String>,
    episode: Option<u64>,
    time: Option<String>,
    stamps: [Option<i64>; 2],
}

impl ParsedFiles {
    /// The tables of a file, which is opened if it was not opened so before.
    pub(super) fn tables(
        &self,
        path: &Path,
        opening: &mut Opening<'_>,
    ) -> Result<Vec<Table>, DataError> {
        let opened = Opened {
            path: path.to_path_buf(),
            format: opening.format,
            topic: opening.topic.map(str::to_owned),
            episode: opening.episode,
            time: opening.time.map(str::to_owned),
            stamps: [opening.start, opening.dated],
        };
        let mut known = locked(&self.known);
        if let Some(found) = known.iter().find(|own| own.opened == opened) {
            [opening.start, opening.dated] = found.stamps;
            return Ok(found.tables.clone());
        }
        let tables = opening.tables(path)?;
        known.push(Known {
            opened,
            tables: tables.clone(),
            stamps: [opening.start, opening.dated],
        });
        Ok(tables)
    }

    /// The statistics of all rows of a run, gathered if they are not known.
    pub(super) fn statistics(
        &self,
        surveyed: Surveyed,
        gather: impl FnOnce() -> Result<Statistics, DataError>,
    ) -> Result<Arc<Statistics>, DataError> {
        let mut known = locked(&self.surveyed);
        if let Some((_, found)) = known.iter().find(|(own, _)| *own == surveyed) {
            return Ok(Arc::clone(found));
        }
        let found = Arc::new(gather()?);
        known.push((surveyed, Arc::clone(&found)));
        Ok(found)
    }
}

impl PartialEq for ParsedFiles {
    /// What has been read of files does not distinguish runs.
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl fmt::Debug for ParsedFiles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ParsedFiles").finish_non_exhaustive()
    }
}

fn locked<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    // a panic while a file was read leaves what was known before
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The columns of a table that have been read; clones share them.
#[derive(Clone, Default)]
pub(super) struct ParsedColumns {
    /// Those of each part that was read, see [`Table::part`].
    parts: Arc<Mutex<Vec<Part>>>,
}

/// The first and the last row of a part, and its columns.
type Part = (Option<(u64, u64)>, Columns);

/// The columns that have been read, all with as many rows.
#[derive(Default)]
struct Columns {
    lines: Arc<Lines>,
    by_place: BTreeMap<usize, Arc<Vec<f64>>>,
    unusable: Arc<Vec<Unusable>>,
}

/// A row that cannot be used.
#[derive(Clone)]
struct Unusable {
    row: usize,
    /// The column of the table whose entry is no number; `None` if the whole row cannot be used.
    column: Option<usize>,
    why: Fault,
}

/// The lines of the rows of a table.
#[derive(Default)]
struct Lines {
    rows: usize,
    /// The rows behind which lines are missing and the first one: their indices, and their lines.
    starts: Vec<(usize, u64)>,
}

impl Lines {
    fn push(&mut self, line: u64) {
        let next = self
            .starts
            .last()
            .map(|(row, first)| first + (self.rows - row) as u64);
        if next != Some(line) {
            self.starts.push((self.rows, line));
        }
        self.rows += 1;
    }
}

impl PartialEq for ParsedColumns {
    /// Whether the columns are those of the same table.
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.parts, &other.parts)
    }
}

impl fmt::Debug for ParsedColumns {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ParsedColumns").finish_non_exhaustive()
    }
}

impl ParsedColumns {
    /// The rows of some columns of a table, from the first row on; columns that are not in memory are read.
    pub(super) fn rows(&self, table: &Table, wanted: &[Wanted]) -> Result<ParsedRows, DataError> {
        let mut parts = locked(&self.parts);
        let place = parts.iter().position(|(part, _)| *part == table.part);
        let place = place.unwrap_or_else(|| {
            parts.push((table.part, Columns::default()));
            parts.len() - 1
        });
        let Some((_, own)) = parts.get_mut(place) else {
            return Ok(ParsedRows::default());
        };
        let is_missing = |wanted: &&Wanted| !own.by_place.contains_key(&wanted.column);
        let missing: Vec<Wanted> = wanted.iter().filter(is_missing).cloned().collect();
        if !missing.is_empty() {
            own.read(table, missing)?;
        }
        let columns = wanted
            .iter()
            .map(|wanted| (wanted.column, own.by_place.get(&wanted.column).cloned()));
        Ok(ParsedRows {
            columns: columns
                .filter_map(|(place, column)| Some((place, column?)))
                .collect(),
            lines: own.lines.clone(),
            unusable: own.unusable.clone(),
            row: 0,
            start: 0,
            next_unusable: 0,
        })
    }
}

impl Columns {
    /// Reads columns of a table in one pass over its file.
    fn read(&mut self, table: &Table, mut wanted: Vec<Wanted>) -> Result<(), DataError> {
        wanted.sort_by_key(|own| own.column);
        wanted.dedup_by_key(|own| own.column);
        let places: Vec<usize> = wanted.iter().map(|own| own.column).collect();
        let mut columns: Vec<Vec<f64>> = vec![Vec::new(); places.len()];
        let (mut lines, mut unusable) = (Lines::default(), Vec::new());
        let room = Room::new(&table.path);
        let (first, last) = table.part.unwrap_or((1, u64::MAX));
        let mut count = 0;
        let mut rows = table.stream(wanted)?;
        while count < last
            && let Some(found) = rows.next_row()?
        {
            count += 1;
            if count < first {
                rows.reuse(found.values);
                continue;
            }
            room.reserve(&mut columns)?;
            let FileRow { values, faults, .. } = found;
            // of a row that cannot be used there may be no values
            let entries = values.iter().copied().chain(core::iter::repeat(f64::NAN));
            for (column, value) in columns.iter_mut().zip(entries) {
                column.push(value);
            }
            for RowFault { column, why } in faults {
                unusable.push(Unusable {
                    row: lines.rows,
                    column: column.and_then(|own| places.get(own).copied()),
                    why,
                });
            }
            lines.push(found.line);
            rows.reuse(values);
        }
        // rows that cannot be used whatever the columns are found in each pass
        let known = self.unusable.iter().filter(|own| own.column.is_some());
        unusable.extend(known.cloned());
        unusable.sort_by_key(|own| (own.row, own.column));
        let found = columns.into_iter().map(Arc::new);
        self.by_place.extend(places.into_iter().zip(found));
        (self.lines, self.unusable) = (Arc::new(lines), Arc::new(unusable));
        Ok(())
    }
}

/// The rows of some columns of a table in memory.
#[derive(Default)]
pub(super) struct ParsedRows {
    /// The index of each column in the table, and its numbers.
    columns: Vec<(usize, Arc<Vec<f64>>)>,
    lines: Arc<Lines>,
    unusable: Arc<Vec<Unusable>>,
    /// The next row, the last of the starts of lines, and the next of the unusable rows.
    row: usize,
    start: usize,
    next_unusable: usize,
}

impl ParsedRows {
    /// Fills `values` with the numbers of the next row; returns its line, and why it cannot be used where
    /// it cannot. `None` behind the last row.
    pub(super) fn next_row(&mut self, values: &mut Vec<f64>) -> Option<(u64, Option<&Fault>)> {
        let row = self.row;
        if row >= self.lines.rows {
            return None;
        }
        self.row += 1;
        let starts = &self.lines.starts;
        while starts
            .get(self.start + 1)
            .is_some_and(|(first, _)| *first <= row)
        {
            self.start += 1;
        }
        let (first, line) = starts.get(self.start).copied().unwrap_or((0, 1));
        values.clear();
        for (_, column) in &self.columns {
            values.push(column.get(row).copied().unwrap_or(f64::NAN));
        }
        // of several faults that of the first of the wanted columns counts, that of the row before all
        let mut found: Option<(usize, usize)> = None;
        while let Some(own) = self
            .unusable
            .get(self.next_unusable)
            .filter(|own| own.row == row)
        {
            let order = match own.column {
                None => Some(0),
                Some(column) => {
                    let mut wanted = self.columns.iter();
                    wanted.position(|wanted| wanted.0 == column).map(|k| k + 1)
                }
            };
            if let Some(order) = order.filter(|own| found.is_none_or(|(least, _)| *own < least)) {
                found = Some((order, self.next_unusable));
            }
            self.next_unusable += 1;
        }
        let why = found.and_then(|(_, place)| Some(&self.unusable.get(place)?.why));
        Some((line + (row - first) as u64, why))
    }
}
