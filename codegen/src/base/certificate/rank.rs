//! The rank of the sampled rows, and queries on their null space.

use super::float320::{DIGITS, Float320};
use super::linear::{Eliminated, eliminate, independent_of, solve_rows};
use super::sparse::Row;

/// The least ratio between the smallest pivot and the largest number dropped, without unit; a
/// smaller gap leaves the rank open.
const MIN_GAP: f64 = 1e20;

/// The largest number that may be dropped, as a part of the largest entry. It must be rounding of
/// 96 digits: a larger number may be the effect of a tiny part of the mechanism.
const MAX_DROPPED: f64 = 1e-72;

/// The rank of the parameters' columns over sampled states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Certificate {
    /// Number of parameters.
    pub columns: usize,
    /// Number of base parameters.
    pub rank: usize,
    /// Number of closed states sampled.
    pub states: usize,
    /// Decimal digits carried.
    pub digits: usize,
    /// The smallest pivot, as a part of the largest entry of all rows.
    pub smallest_pivot: f64,
    /// The largest remainder dropped as rounding, as a part of the largest entry; 0 if none was
    /// dropped.
    pub largest_remainder: f64,
}

impl Certificate {
    /// Whether all pivots are far above the rounding of 96 digits, so that the true rank is at
    /// least `rank`; it may be larger.
    pub fn has_sure_pivots(&self) -> bool {
        self.smallest_pivot >= MAX_DROPPED
    }

    /// Whether the gap between pivots and dropped numbers leaves no doubt about the rank.
    pub fn is_certain(&self) -> bool {
        // nothing is dropped where all columns are pivots' columns, nor where all are 0
        self.largest_remainder == 0.0
            || self.largest_remainder <= MAX_DROPPED
                && self.smallest_pivot >= MIN_GAP * self.largest_remainder
    }
}

/// Sampled rows, with one entry per parameter.
#[derive(Clone, Debug)]
pub struct Samples {
    /// The rows in scaled units.
    rows: Vec<Row>,
    /// The magnitude of the largest entry of the rows.
    largest: Float320,
    /// For each column, the exponent of the power of two by which it is scaled in the rows.
    units: Vec<i32>,
    /// A basis of the span of the rows.
    basis: Eliminated,
    certificate: Certificate,
}

impl Samples {
    pub(super) fn new(rows: Vec<Row>, units: Vec<i32>, states: usize) -> Samples {
        let columns = units.len();
        let done = eliminate(rows.clone(), columns);
        let part = |x: Float320| {
            let quotient = x.checked_div(done.largest);
            quotient.map_or(0.0, |q| q.to_f64())
        };
        let smallest = done.pivots().reduce(|a, b| if b < a { b } else { a });
        let certificate = Certificate {
            columns,
            rank: done.rows.len(),
            states,
            digits: DIGITS,
            smallest_pivot: smallest.map_or(0.0, part),
            largest_remainder: part(done.dropped),
        };
        Samples {
            largest: rows
                .iter()
                .map(Row::largest)
                .fold(Float320::ZERO, Float320::max),
            rows,
            units,
            basis: done,
            certificate,
        }
    }

    /// Adds the rows of further states; `states` is the total number of states. Returns whether the
    /// rank grew.
    pub(super) fn extend(&mut self, fresh: Vec<Row>, states: usize) -> bool {
        let (remainder, grown) = self.basis.remainder_of(&fresh);
        self.largest = fresh
            .iter()
            .map(Row::largest)
            .fold(self.largest, Float320::max);
        self.rows.extend(fresh);
        if grown {
            let rows = core::mem::take(&mut self.rows);
            *self = Samples::new(rows, core::mem::take(&mut self.units), states);
        } else {
            let part = remainder.checked_div(self.basis.largest);
            let dropped = part.map_or(0.0, |p| p.to_f64());
            self.certificate.largest_remainder = self.certificate.largest_remainder.max(dropped);
            self.certificate.states = states;
        }
        grown
    }

    /// Adds the rows of another sample of the same mechanism. Returns whether the rank grew, which
    /// it does only if the states of this sample were special.
    pub fn join(&mut self, other: Samples) -> bool {
        let states = self.certificate.states + other.certificate.states;
        self.extend(other.rows, states)
    }

    /// The rank and the evidence for it.
    pub fn certificate(&self) -> Certificate {
        self.certificate
    }

    /// The rank of a subset of the columns, and the evidence for it.
    pub fn certificate_of(&self, columns: &[usize]) -> Certificate {
        let chosen = self.rows_of(columns);
        let units = columns.iter().map(|&c| self.units[c]).collect();
        Samples::new(chosen.collect(), units, self.certificate.states).certificate
    }

    /// The sampled rows of some columns, in scaled units.
    pub(super) fn rows_of(&self, columns: &[usize]) -> impl Iterator<Item = Row> {
        self.rows.iter().map(|row| row.of_columns(columns))
    }

    /// All sampled rows, in scaled units.
    pub(super) fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// The factor from the scaled unit of one column to that of another.
    pub(super) fn scale_between(&self, from: usize, to: usize) -> f64 {
        libm::ldexp(1.0, self.units[to] - self.units[from])
    }

    /// How strongly each parameter acts at the sampled states: the length of its column, in the
    /// energy's unit per SI unit of the parameter.
    pub(in crate::base) fn lengths(&self) -> Vec<f64> {
        let mut squares = vec![0.0; self.units.len()];
        for row in &self.rows {
            for (c, x) in row.entries() {
                let x = x.to_f64();
                squares[c] += x * x;
            }
        }
        let columns = squares.iter().zip(&self.units);
        columns
            .map(|(square, unit)| libm::ldexp(libm::sqrt(*square), -unit))
            .collect()
    }

    /// The rank of a subset of the columns.
    pub fn rank_of(&self, columns: &[usize]) -> usize {
        let rows = self.basis.rows.iter();
        let chosen = rows.map(|row| row.of_columns(columns));
        eliminate(chosen.collect(), columns.len()).rows.len()
    }

    /// The columns, taken in the given order, that are linearly independent of the columns before
    /// them: the choice of base parameters that prefers early columns.
    pub fn independent(&self, order: &[usize]) -> Vec<usize> {
        independent_of(&self.basis.rows, order)
    }

    /// The largest product of a row and a direction in the space of the parameters, relative to the
    /// largest term of such products: rounding for a null direction, and of order 1 for a random
    /// direction.
    pub fn residual(&self, direction: &[Float320]) -> f64 {
        let direction = self.in_units(direction);
        let (mut largest, mut worst) = (Float320::ZERO, Float320::ZERO);
        for row in &self.rows {
            let mut sum = Float320::ZERO;
            for (c, x) in row.entries() {
                let term = *x * direction[c];
                sum = sum + term;
                largest = largest.max(term.abs());
            }
            worst = worst.max(sum.abs());
        }
        worst.checked_div(largest).map_or(0.0, |part| part.to_f64())
    }

    /// The largest product of a row and a direction, relative to the largest entry of all rows and
    /// of the direction: rounding for a null direction, also for one whose columns are all zero.
    pub fn scaled_residual(&self, direction: &[Float320]) -> f64 {
        let nonzero = direction.iter().enumerate().filter(|(_, x)| !x.is_zero());
        self.scaled_residual_of(&nonzero.map(|(c, x)| (c, *x)).collect::<Vec<_>>())
    }

    /// As [`scaled_residual`](Self::scaled_residual), of a direction's nonzero entries with their columns.
    pub(in crate::base) fn scaled_residual_of(&self, direction: &[(usize, Float320)]) -> f64 {
        let entries = direction.iter();
        let direction: Vec<(usize, Float320)> = entries
            .map(|(c, x)| (*c, x.scaled(-self.units[*c])))
            .collect();
        let entries = direction.iter().map(|(_, x)| x.abs());
        let largest = self.largest * entries.fold(Float320::ZERO, Float320::max);
        // the pivots' rows span all rows
        let sums = self.basis.rows.iter().map(|row| {
            let terms = direction.iter();
            let terms = terms.filter_map(|(c, x)| Some(*row.entry(*c)? * *x));
            terms.fold(Float320::ZERO, |sum, term| sum + term).abs()
        });
        let worst = sums.fold(Float320::ZERO, Float320::max);
        worst.checked_div(largest).map_or(0.0, |part| part.to_f64())
    }

    /// A direction's entries in the scaled units of the rows.
    fn in_units(&self, direction: &[Float320]) -> Vec<Float320> {
        let entries = direction.iter().zip(&self.units);
        entries.map(|(x, unit)| x.scaled(-unit)).collect()
    }

    /// The null direction whose nonzero entries are all in the given columns, with 1 at the first
    /// of them and entries in the given order; `None` if there is none or more than one.
    pub fn circuit(&self, columns: &[usize]) -> Option<Vec<Float320>> {
        let (first, others) = columns.split_first()?;
        let order: Vec<usize> = others.iter().chain([first]).copied().collect();
        if self.independent(&order) != others {
            return None;
        }
        if others.is_empty() {
            return Some(vec![Float320::ONE]);
        }
        let rows = self.basis.rows.iter();
        let rows = rows.map(|row| row.of_columns(&order)).collect();
        let solution = solve_rows(rows, others.len(), 1)?;
        let found = solution.iter().zip(others).map(|(row, &c)| {
            let unit = self.units[c] - self.units[*first];
            -row[0].scaled(unit)
        });
        Some(std::iter::once(Float320::ONE).chain(found).collect())
    }

    /// Writes every column as a combination of the kept ones: for each column, the coefficients in
    /// the order of `kept`. `None` if `kept` is not a basis.
    ///
    /// The coefficients of a kept column are a unit vector.
    pub fn combinations(&self, kept: &[usize]) -> Option<Vec<Vec<Float320>>> {
        let all: Vec<usize> = (0..self.certificate.columns).collect();
        self.combinations_of(kept, &all)
    }

    /// As [`combinations`](Self::combinations), of these columns only.
    pub(in crate::base) fn combinations_of(
        &self,
        kept: &[usize],
        columns: &[usize],
    ) -> Option<Vec<Vec<Float320>>> {
        if kept.len() != self.basis.rows.len() {
            return None;
        }
        let rows = self.basis.rows.iter().map(|row| {
            let mut extended = row.of_columns(kept);
            extended.append(kept.len(), &row.of_columns(columns));
            extended
        });
        let by_kept = solve_rows(rows.collect(), kept.len(), columns.len())?;
        let unit = |k: usize, at: usize| {
            if k == at {
                Float320::ONE
            } else {
                Float320::ZERO
            }
        };
        let true_size = |x: Float320, k: usize, c: usize| x.scaled(self.units[k] - self.units[c]);
        let column = |(side, &c): (usize, &usize)| -> Vec<Float320> {
            if let Some(at) = kept.iter().position(|&k| k == c) {
                return (0..kept.len()).map(|k| unit(k, at)).collect();
            }
            let factors = by_kept.iter().zip(kept);
            factors
                .map(|(row, &k)| true_size(row[side], k, c))
                .collect()
        };
        Some(columns.iter().enumerate().map(column).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn certificate(diagonal: &[f64]) -> Certificate {
        let n = diagonal.len();
        let rows = diagonal.iter().enumerate().map(|(i, x)| {
            let mut row = vec![Float320::ZERO; n];
            row[i] = Float320::from_f64(*x);
            Row::of(row)
        });
        Samples::new(rows.collect(), vec![0; n], 1).certificate()
    }

    #[test]
    fn a_row_of_rounding_adds_no_rank() {
        let found = certificate(&[1.0, 1e-6, 3e-96]);
        assert_eq!(found.rank, 2);
        assert!((found.smallest_pivot - 1e-6).abs() < 1e-18);
        assert!((found.largest_remainder - 3e-96).abs() < 1e-108);
        assert!(found.is_certain());
    }

    #[test]
    fn a_narrow_gap_is_not_certain() {
        assert!(!certificate(&[1.0, 1e-50, 1e-62]).is_certain());
        assert!(certificate(&[1.0, 1e-30]).is_certain());
    }

    #[test]
    fn a_zero_column_leaves_no_dropped_number() {
        let found = certificate(&[2.0, 0.0]);
        assert_eq!((found.rank, found.largest_remainder.to_bits()), (1, 0));
        assert!(found.is_certain());
    }
}
