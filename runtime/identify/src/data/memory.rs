//! How much memory is left for the rows of logs.

use std::fs;
use std::path::Path;

use super::problem::DataError;

/// The number of rows that there is room for at first.
const FIRST_ROWS: usize = 1 << 12;
/// Columns that take less than this, bytes, are not compared with the memory that is free.
const SMALL: usize = 1 << 26;
/// The memory that equations and states of the rows take over that of their columns.
const OF_EQUATIONS: f64 = 1.2;

/// Room for the columns of a file, which grows with their rows.
pub(super) struct Room<'a> {
    path: &'a Path,
}

impl<'a> Room<'a> {
    pub(super) fn new(path: &'a Path) -> Self {
        Self { path }
    }

    /// Makes room for another row.
    ///
    /// - `columns`: all with as many rows.
    ///
    /// # Errors
    /// When the memory does not suffice.
    pub(super) fn reserve(&self, columns: &mut [Vec<f64>]) -> Result<(), DataError> {
        let Some(first) = columns.first() else {
            return Ok(());
        };
        let rows = first.len();
        if rows < first.capacity() {
            return Ok(());
        }
        let more = (rows / 2).max(FIRST_ROWS);
        let bytes = (rows + more) * columns.len() * size_of::<f64>();
        let needed = (more * columns.len() * size_of::<f64>()) as f64 + OF_EQUATIONS * bytes as f64;
        if bytes > SMALL
            && let Some(free) = free()
            && needed > free
        {
            return Err(self.too_large(rows, columns.len(), free));
        }
        for column in columns.iter_mut() {
            if column.try_reserve_exact(more).is_err() {
                let (rows, count) = (column.len(), columns.len());
                return Err(self.too_large(rows, count, free().unwrap_or(0.0)));
            }
        }
        Ok(())
    }

    fn too_large(&self, rows: usize, columns: usize, free: f64) -> DataError {
        let gigabytes = |bytes: f64| format!("{:.1} GB", 1e-9 * bytes);
        let read = (rows * columns * size_of::<f64>()) as f64;
        DataError::Io {
            file: self.path.display().to_string(),
            why: format!(
                "its first {rows} rows take {}, and the {} of memory that are left do not suffice for the others \
                 and their equations: observe it in pieces, each with some of its rows, and identify from \
                 their factors",
                gigabytes(read),
                gigabytes(free)
            ),
        }
    }
}

/// The memory that this process may still use, bytes: what the machine has free, and what limits of the process
/// and of its group leave. `None` where the system does not tell.
fn free() -> Option<f64> {
    let text = |path: &str| fs::read_to_string(path).ok();
    let machine = text("/proc/meminfo").and_then(|all| available(&all));
    let process = text("/proc/self/limits")
        .and_then(|all| address_space(&all))
        .zip(text("/proc/self/status").and_then(|all| in_kilobytes(&all, "VmSize:")))
        .map(|(limit, used)| limit - used);
    let number = |path: &str| text(path)?.trim().parse::<f64>().ok();
    let group = number("/sys/fs/cgroup/memory.max")
        .zip(number("/sys/fs/cgroup/memory.current"))
        .map(|(limit, used)| limit - used);
    [machine, process, group]
        .into_iter()
        .flatten()
        .reduce(f64::min)
        .map(|free| free.max(0.0))
}

/// The memory that is available, bytes, of the text of `/proc/meminfo`.
fn available(text: &str) -> Option<f64> {
    in_kilobytes(text, "MemAvailable:")
}

/// A number of kB in a text of lines with names and numbers, in bytes.
fn in_kilobytes(text: &str, name: &str) -> Option<f64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    let number: f64 = line.split_whitespace().next()?.parse().ok()?;
    Some(1024.0 * number)
}

/// The limit of the address space, bytes, of the text of `/proc/self/limits`; `None` if there is none.
fn address_space(text: &str) -> Option<f64> {
    let line = text
        .lines()
        .find_map(|line| line.strip_prefix("Max address space"))?;
    line.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn the_system_s_words_for_memory_are_read() {
        let text = "MemTotal:       24602320 kB\nMemAvailable:   1000 kB\n";
        assert_eq!(available(text), Some(1_024_000.0));
        let text = "Limit  Soft Limit  Hard Limit  Units\nMax address space         2048000000           \
                    unlimited            bytes\n";
        assert_eq!(address_space(text), Some(2_048_000_000.0));
        assert_eq!(
            address_space(
                "Max address space         unlimited            unlimited            bytes"
            ),
            None
        );
    }

    #[test]
    fn room_for_a_row_is_there_whenever_one_is_added() {
        let room = Room::new(Path::new("log.csv"));
        let mut columns = vec![Vec::new(), Vec::new()];
        for k in 0..3 * FIRST_ROWS {
            room.reserve(&mut columns).unwrap();
            for column in &mut columns {
                assert!(column.capacity() > column.len());
                column.push(k as f64);
            }
        }
    }

    #[test]
    fn a_log_that_is_too_large_is_refused_with_what_to_do() {
        let error = Room::new(Path::new("log.csv")).too_large(2_000_000, 10, 3e8);
        let text = error.to_string();
        assert!(text.starts_with(
            "cannot read log.csv: its first 2000000 rows take 0.2 GB, and the 0.3 GB"
        ));
        assert!(text.contains("in pieces"), "{text}");
    }
}
