//! Finds columns that have a new value only every few rows, as those of a slower sensor or topic.

/// The largest number of rows for which a value is held, and that of changes that are kept.
const MAX_HELD: usize = 64;
const MAX_CHANGES: usize = 4096;
/// The smallest number of values of such a column.
const MIN_VALUES: usize = 20;
/// The part of the values that are held for the same number of rows.
const MIN_SAME_PART: f64 = 0.7;
/// The median change over the smallest one: those of an encoder's steps are one.
const MIN_CHANGE_RATIO: f64 = 3.0;

/// Counts for how many rows each value of one column is held.
#[derive(Clone, Debug)]
pub(super) struct StaleFinder {
    last: Option<f64>,
    rows: usize,
    /// For each number of rows the values that are held for it; the last entry has all longer ones.
    held: Vec<usize>,
    changes: Vec<f64>,
}

impl Default for StaleFinder {
    fn default() -> Self {
        Self {
            last: None,
            rows: 0,
            held: vec![0; MAX_HELD + 1],
            changes: Vec::new(),
        }
    }
}

impl StaleFinder {
    /// Takes the value of the next row.
    pub(super) fn push(&mut self, value: f64) {
        let last = self.last.replace(value);
        let change = last.map_or(0.0, |last| (value - last).abs());
        if change > 0.0 {
            if let Some(count) = self.held.get_mut(self.rows.min(MAX_HELD)) {
                *count += 1;
            }
            if self.changes.len() < MAX_CHANGES {
                self.changes.push(change);
            }
            self.rows = 0;
        }
        self.rows += 1;
    }

    /// The number of rows after which there is a new value; 1 for a usual column.
    pub(super) fn finish(mut self) -> usize {
        let all: usize = self.held.iter().sum();
        let most = (0..MAX_HELD).max_by_key(|rows| self.held.get(*rows).copied().unwrap_or(0));
        let rows = most.unwrap_or(1);
        let same = self.held.get(rows).copied().unwrap_or(0) as f64;
        if rows < 2 || all < MIN_VALUES || same < MIN_SAME_PART * all as f64 {
            return 1;
        }
        self.changes.sort_by(f64::total_cmp);
        let smallest = self.changes.first().copied().unwrap_or(0.0);
        let median = self
            .changes
            .get(self.changes.len() / 2)
            .copied()
            .unwrap_or(0.0);
        // the steps of an encoder come as regularly in a steady motion
        if median > MIN_CHANGE_RATIO * smallest {
            rows
        } else {
            1
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_that_are_held_are_told_from_steps_and_noise() {
        let found = |of: &dyn Fn(usize) -> f64| {
            let mut finder = StaleFinder::default();
            (0..2000).for_each(|row| finder.push(of(row)));
            finder.finish()
        };
        let swing = |row: usize| (0.013 * row as f64).sin();
        assert_eq!(found(&swing), 1);
        for every in [2, 3, 7, 15] {
            assert_eq!(found(&|row| swing(row / every * every)), every);
        }
        // steps of an encoder in a steady motion, and in a swing
        assert_eq!(found(&|row| (row / 5) as f64), 1);
        assert_eq!(found(&|row| (300.0 * swing(row)).round()), 1);
    }
}
