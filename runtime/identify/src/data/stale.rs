//! Finds columns that have a new value only every few rows, as those of a slower sensor or topic, and columns of
//! few values, as those of a coarse sensor.

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

/// The largest number of values of a column that has steps, and the smallest one.
const MAX_VALUES: usize = 64;
const MIN_STEPPED_VALUES: usize = 4;
/// The smallest number of rows that show steps.
const MIN_STEPPED_ROWS: usize = 200;
/// The smallest step over the spread of the values that matters: the error by smaller ones is below 3 % of it.
const MIN_STEP_PART: f64 = 0.1;
/// The largest distance of a value from a whole number of steps.
const MAX_ROUNDING: f64 = 1e-3;

/// Counts the rows at each value of one column that has few.
#[derive(Clone, Debug, Default)]
pub(super) struct StepFinder {
    /// The values, ascending, each with the number of its rows.
    values: Vec<(f64, usize)>,
    has_many: bool,
}

impl StepFinder {
    /// Takes the value of the next row.
    pub(super) fn push(&mut self, value: f64) {
        if self.has_many {
            return;
        }
        let value = value + 0.0; // -0 is 0
        match self.values.binary_search_by(|own| own.0.total_cmp(&value)) {
            Ok(place) => {
                if let Some((_, rows)) = self.values.get_mut(place) {
                    *rows += 1;
                }
            }
            Err(place) => {
                self.values.insert(place, (value, 1));
                self.has_many = self.values.len() > MAX_VALUES;
            }
        }
    }

    /// The step of which all values are multiples, in their unit and over the standard deviation of the rows; `None`
    /// where it is small, or there is none.
    pub(super) fn finish(&self) -> Option<(f64, f64)> {
        let rows: usize = self.values.iter().map(|own| own.1).sum();
        if self.has_many || self.values.len() < MIN_STEPPED_VALUES || rows < MIN_STEPPED_ROWS {
            return None;
        }
        let changes = self.values.windows(2).map(|pair| pair[1].0 - pair[0].0);
        let step = changes.fold(f64::INFINITY, f64::min);
        let mut from_first = (self.values.iter()).map(|own| (own.0 - self.values[0].0) / step);
        if !from_first.all(|steps| (steps - steps.round()).abs() < MAX_ROUNDING) {
            return None;
        }
        let mean_of = |of: &dyn Fn(f64) -> f64| {
            let sum: f64 = (self.values.iter())
                .map(|own| own.1 as f64 * of(own.0))
                .sum();
            sum / rows as f64
        };
        let mean = mean_of(&|value| value);
        let spread = mean_of(&|value| (value - mean).powi(2)).sqrt();
        let part = step / spread;
        (part > MIN_STEP_PART).then_some((step, part))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_of_few_values_has_their_step_and_one_of_many_has_none() {
        let of = |step: f64, noise: f64| {
            let mut finder = StepFinder::default();
            for k in 0..2000_usize {
                let own = 3.0 * (0.01 * k as f64).sin() + noise * (k * 7919 % 1009) as f64;
                finder.push((own / step).round() * step);
            }
            finder.finish()
        };
        let (step, part) = of(0.7, 0.0).unwrap();
        assert!(
            (step - 0.7).abs() < 1e-12 && (0.3..0.4).contains(&part),
            "{step} {part}"
        );
        assert_eq!(of(0.02, 0.0), None);
        assert_eq!(of(1e-9, 1e-6), None);
        // friction alone, of either sign
        assert_eq!(of(100.0, 0.0), None);
    }

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
