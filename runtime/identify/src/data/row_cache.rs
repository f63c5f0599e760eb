//! The rows of a log that fits into memory, so that it is parsed once.

use std::sync::OnceLock;

use super::problem::{DataError, Problem};
use super::reader::LogRow;

/// The largest number of values that are cached for all runs together: 64 MiB. Longer logs are read
/// again in each pass, so that memory does not grow with their length.
pub(super) const MAX_NUMBERS: usize = 1 << 23;

/// The cached rows of a run; a clone starts empty.
#[derive(Debug)]
pub(super) struct RowCache {
    /// The largest number of values that are cached.
    capacity: usize,
    /// The rows after the first pass; `None` if they are too many.
    rows: OnceLock<Option<Rows>>,
}

impl Clone for RowCache {
    fn clone(&self) -> Self {
        Self::with_capacity(self.capacity)
    }
}

#[derive(Debug, Default)]
struct Rows {
    /// The numbers of all good rows.
    values: Vec<f64>,
    /// The number of channels of a row.
    width: usize,
    /// The line of each good row.
    lines: Vec<u64>,
    /// The faulty rows, each with the number of good rows before it.
    problems: Vec<(usize, Problem)>,
}

impl Rows {
    fn push(&mut self, row: &Result<&LogRow, Problem>) {
        match row {
            Ok(row) => {
                self.width = row.values.len();
                self.values.extend_from_slice(&row.values);
                self.lines.push(row.line);
            }
            Err(problem) => self.problems.push((self.lines.len(), problem.clone())),
        }
    }

    /// About how much memory the rows take, in numbers of 8 bytes.
    fn numbers(&self) -> usize {
        self.values.len() + self.lines.len() + 16 * self.problems.len()
    }
}

/// Receives each row, or the problem for which it cannot be used.
pub(super) type RecordSink<'a> = dyn FnMut(Result<&LogRow, Problem>) -> Result<(), DataError> + 'a;

impl RowCache {
    /// An empty cache that holds at most `capacity` numbers.
    pub(super) fn with_capacity(capacity: usize) -> Self {
        Self {
            capacity,
            rows: OnceLock::new(),
        }
    }

    /// How many numbers are cached.
    pub(super) fn numbers(&self) -> usize {
        self.rows
            .get()
            .and_then(Option::as_ref)
            .map_or(0, Rows::numbers)
    }

    /// Passes all rows to `each`: the cached ones or, if there are none, those that `read` reads,
    /// which are cached if there is room for all of them.
    ///
    /// # Errors
    /// The errors of `each`, and those of reading the rows.
    pub(super) fn visit(
        &self,
        each: &mut RecordSink<'_>,
        read: impl FnOnce(&mut RecordSink<'_>) -> Result<(), DataError>,
    ) -> Result<(), DataError> {
        let known = self.rows.get();
        if let Some(Some(rows)) = known {
            let mut problems = rows.problems.iter().peekable();
            let values = rows.values.chunks_exact(rows.width.max(1));
            let mut row = LogRow::default();
            for (index, (line, values)) in rows.lines.iter().zip(values).enumerate() {
                while let Some((_, problem)) = problems.next_if(|p| p.0 <= index) {
                    each(Err(problem.clone()))?;
                }
                row.line = *line;
                row.values.clear();
                row.values.extend_from_slice(values);
                each(Ok(&row))?;
            }
            for (_, problem) in problems {
                each(Err(problem.clone()))?;
            }
            return Ok(());
        }
        if known.is_some() {
            return read(each);
        }
        let mut cached = Some(Rows::default());
        read(&mut |row| {
            if let Some(rows) = &mut cached {
                rows.push(&row);
                if rows.numbers() > self.capacity {
                    cached = None;
                }
            }
            each(row)
        })?;
        // if another thread's pass ended first, it has cached the same rows
        let _ = self.rows.set(cached);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::problem::Fault;

    /// The good rows and the lines of the problems that a pass over three rows and a faulty one gives,
    /// and whether they were read.
    fn pass(cache: &RowCache) -> (Vec<LogRow>, Vec<u64>, bool) {
        let (mut rows, mut problems, mut is_read) = (Vec::new(), Vec::new(), false);
        let mut each = |row: Result<&LogRow, Problem>| {
            match row {
                Ok(row) => rows.push(row.clone()),
                Err(problem) => problems.push(problem.row),
            }
            Ok(())
        };
        let read = |each: &mut RecordSink<'_>| {
            is_read = true;
            for line in [2, 3, 5] {
                if line == 5 {
                    each(Err(Problem::of(4, Fault::Duplicate { time: 0.0 })))?;
                }
                let values = vec![0.1 * line as f64, 1.0];
                each(Ok(&LogRow {
                    line,
                    values,
                    bridged: false,
                }))?;
            }
            Ok(())
        };
        cache.visit(&mut each, read).unwrap();
        (rows, problems, is_read)
    }

    #[test]
    fn each_pass_gives_the_same_rows_and_only_too_many_are_read_again() {
        for (capacity, fits) in [(100, true), (5, false)] {
            let cache = RowCache::with_capacity(capacity);
            let (rows, problems, is_read) = pass(&cache);
            assert!(is_read && rows.len() == 3 && problems == [4]);
            for _ in 0..2 {
                assert_eq!(pass(&cache), (rows.clone(), problems.clone(), !fits));
            }
            assert_eq!(cache.numbers() > 0, fits);
        }
    }
}
