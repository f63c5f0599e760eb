//! Consecutive rows of a log, column by column.

use core::ops::Range;

use super::reader::{EffortSet, LogRow};
use super::shift;
use crate::signals::{Butterworth, SignalError};

/// Consecutive rows; their columns are those of [`LogRow::values`].
#[derive(Clone, Debug, Default)]
pub(super) struct Stretch {
    lines: Vec<u64>,
    bridged: Vec<bool>,
    unknown: Vec<EffortSet>,
    columns: Vec<Vec<f64>>,
}

impl Stretch {
    /// Adds the next row, which has as many entries as the ones before.
    pub(super) fn push(&mut self, row: &LogRow) {
        if self.columns.len() < row.values.len() {
            self.columns.resize(row.values.len(), Vec::new());
        }
        for (column, value) in self.columns.iter_mut().zip(&row.values) {
            column.push(*value);
        }
        self.lines.push(row.line);
        self.bridged.push(row.bridged);
        self.unknown.push(row.unknown);
    }

    /// Whether a row has entries that are interpolated across a gap.
    pub(super) fn bridged(&self) -> &[bool] {
        &self.bridged
    }

    /// For each row, whether it is near one that is interpolated across a gap: within a third of the
    /// gap's rows, and within `most` rows.
    pub(super) fn near_bridged(&self, most: usize) -> Vec<bool> {
        let mut out = vec![false; self.len()];
        let mut start = 0;
        for gap in self.bridged.chunk_by(|a, b| a == b) {
            let end = start + gap.len();
            if gap.first() == Some(&true) {
                let rows = (gap.len() / 3).min(most);
                let near = start.saturating_sub(rows)..(end + rows).min(out.len());
                out.get_mut(near).unwrap_or_default().fill(true);
            }
            start = end;
        }
        out
    }

    /// For each row, whether an effort is not known there, or at one of `most` rows before or behind it; empty where
    /// it is known at all rows.
    pub(super) fn near_unknown(&self, effort: usize, most: usize) -> Vec<bool> {
        let unknown: Vec<bool> = self
            .unknown
            .iter()
            .map(|own| own.contains(effort))
            .collect();
        if !unknown.contains(&true) {
            return Vec::new();
        }
        spread(&unknown, most)
    }

    /// The number of rows.
    pub(super) fn len(&self) -> usize {
        self.lines.len()
    }

    /// The times of the rows, s.
    pub(super) fn times(&self) -> &[f64] {
        self.column(0)
    }

    /// One entry of every row.
    pub(super) fn column(&self, entry: usize) -> &[f64] {
        self.columns.get(entry).map_or(&[], Vec::as_slice)
    }

    /// The line of a row; 0 if there is no such row.
    pub(super) fn line(&self, row: usize) -> u64 {
        self.lines.get(row).copied().unwrap_or(0)
    }

    /// The rows with all their entries but the time behind a filter.
    ///
    /// # Errors
    /// When there are too few rows for it.
    pub(super) fn passed(&self, filter: &Butterworth) -> Result<Self, SignalError> {
        let columns = self.columns.iter().enumerate();
        let passed = columns.map(|(entry, column)| match entry {
            0 => Ok(column.clone()),
            _ => filter.zero_phase(column),
        });
        Ok(Self {
            columns: passed.collect::<Result<_, _>>()?,
            lines: self.lines.clone(),
            bridged: self.bridged.clone(),
            unknown: self.unknown.clone(),
        })
    }

    /// The rows with each entry at the times at which it was measured, and those of them of which all entries are
    /// known; `None` if no entry is late. Beyond these, entries that are late go on along a line, as a jump there would
    /// be motion to a filter.
    ///
    /// - `late`: by how much each entry is late, s.
    pub(super) fn on_time(&self, late: impl Iterator<Item = f64>) -> Option<(Self, Range<usize>)> {
        let mut moved: Option<Self> = None;
        let mut known = 0..self.len();
        for (entry, late) in late.enumerate().filter(|(_, late)| *late != 0.0) {
            let own = moved.get_or_insert_with(|| self.clone());
            if let Some(column) = own.columns.get_mut(entry) {
                let inside = shift::later(self.times(), column, late);
                shift::extend(self.times(), column, &inside);
                known = known.start.max(inside.start)..known.end.min(inside.end);
            }
        }
        moved.map(|own| (own, known))
    }

    /// Forgets all rows but the last ones.
    pub(super) fn keep_last(&mut self, rows: usize) {
        let first = self.len().saturating_sub(rows);
        self.lines.drain(..first);
        self.bridged.drain(..first);
        self.unknown.drain(..first);
        for column in &mut self.columns {
            column.drain(..first);
        }
    }

    /// Forgets all rows.
    pub(super) fn clear(&mut self) {
        self.keep_last(0);
    }
}

/// Whether one of the rows up to `reach` before or behind each row is marked.
pub(super) fn spread(marked: &[bool], reach: usize) -> Vec<bool> {
    let near = |k: usize| marked.get(k.saturating_sub(reach)..(k + reach + 1).min(marked.len()));
    let rows = 0..marked.len();
    rows.map(|k| near(k).unwrap_or_default().contains(&true))
        .collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn the_last_rows_remain_with_their_lines_and_columns() {
        let mut rows = Stretch::default();
        for k in 0..5_u32 {
            rows.push(&LogRow {
                line: u64::from(k) + 2,
                values: vec![0.1 * f64::from(k), f64::from(k)],
                bridged: k == 3,
                ..LogRow::default()
            });
        }
        rows.keep_last(2);
        assert_eq!((rows.len(), rows.line(0), rows.line(1)), (2, 5, 6));
        assert_eq!(rows.times(), [0.1 * 3.0, 0.1 * 4.0]);
        assert_eq!(rows.column(1), [3.0, 4.0]);
        assert_eq!(rows.bridged(), [true, false]);

        rows.keep_last(7);
        assert_eq!(rows.len(), 2);
        rows.clear();
        assert!(rows.bridged().is_empty());
        assert_eq!((rows.len(), rows.times().len(), rows.line(0)), (0, 0, 0));
    }

    #[test]
    fn late_entries_are_moved_to_the_times_of_the_others() {
        let mut rows = Stretch::default();
        for k in 0..20 {
            let t = 0.1 * f64::from(k);
            rows.push(&LogRow {
                values: vec![t, t * t, 3.0 - t],
                ..LogRow::default()
            });
        }
        assert!(rows.on_time([0.0; 3].into_iter()).is_none());
        let (moved, known) = rows.on_time([0.0, 0.35, 0.0].into_iter()).unwrap();
        assert_eq!(
            (moved.times(), moved.column(2)),
            (rows.times(), rows.column(2))
        );
        assert!(known.len() > 12 && known.end < 17, "{known:?}");
        for k in known {
            let expected = (rows.times()[k] + 0.35).powi(2);
            assert!((moved.column(1)[k] - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn a_third_of_a_gap_is_left_out_on_either_side_of_it() {
        let mut rows = Stretch::default();
        for k in 0..30 {
            rows.push(&LogRow {
                line: k,
                values: vec![0.1 * k as f64],
                bridged: (4..13).contains(&k) || (20..22).contains(&k),
                ..LogRow::default()
            });
        }
        let near = |most: usize| {
            let near = rows.near_bridged(most).into_iter().enumerate();
            near.filter(|own| own.1)
                .map(|own| own.0)
                .collect::<Vec<_>>()
        };
        assert_eq!(near(10), (1..16).chain(20..22).collect::<Vec<_>>());
        assert_eq!(near(2), (2..15).chain(20..22).collect::<Vec<_>>());
    }
}
