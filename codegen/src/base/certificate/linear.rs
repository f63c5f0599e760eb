//! Linear algebra in multiple precision. Rows are not scaled, so that a row of rounding errors
//! remains recognisable as one.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::float320::Float320;
use super::sparse::Row;

/// Exponent of the threshold for rounding: entries below 2^-200, or 1e-60, of the largest pivot
/// count as zero. This is far above the rounding errors of 96 digits, and far below any entry of a
/// mechanism with realistic proportions.
const ROUNDING_BITS: i32 = 200;

/// A matrix after elimination.
#[derive(Clone, Debug)]
pub(super) struct Eliminated {
    /// Pivot rows, in the order of elimination: each has zeros in the columns of earlier pivots.
    pub(super) rows: Vec<Row>,
    /// The pivots' columns.
    pub(super) columns: Vec<usize>,
    /// The largest entry of the matrix before elimination.
    pub(super) largest: Float320,
    /// The largest entry that remains after elimination: rounding, or 0.
    pub(super) dropped: Float320,
}

impl Eliminated {
    /// The magnitudes of the pivots.
    pub(super) fn pivots(&self) -> impl Iterator<Item = Float320> {
        let pairs = self.rows.iter().zip(&self.columns);
        pairs.map(|(row, c)| row.get(*c).abs())
    }
}

/// From this number of columns on, pivots are chosen such that the rows stay short.
const SHORT_ROWS_MIN_COLUMNS: usize = 200;

/// A row that has not become a pivot row yet, with the data that the choice of a pivot needs.
struct OpenRow {
    row: Row,
    /// The column of its largest entry, and that entry.
    column: usize,
    largest: Float320,
    /// Number of its nonzero entries.
    entries: usize,
}

impl OpenRow {
    fn new(row: Row, width: usize) -> OpenRow {
        let mut open = OpenRow {
            row,
            column: 0,
            largest: Float320::ZERO,
            entries: 0,
        };
        open.update(width);
        open
    }

    /// Counts and compares the entries of the first `width` columns.
    fn update(&mut self, width: usize) {
        (self.column, self.largest, self.entries) = (0, Float320::ZERO, 0);
        for (c, x) in self.row.entries().take_while(|(c, _)| *c < width) {
            self.entries += 1;
            if x.cmp_abs(&self.largest).is_gt() {
                (self.column, self.largest) = (c, *x);
            }
        }
    }
}

/// The rows that are not pivot rows yet.
struct OpenRows {
    /// All rows by number; those that are closed are empty.
    rows: Vec<OpenRow>,
    /// The numbers of the open rows.
    open: Vec<usize>,
    /// For each column, the numbers of all open rows that have an entry there. Numbers of rows whose
    /// entry has vanished may remain.
    with_entry: Vec<Vec<usize>>,
    /// The cached exponents of the largest entries of columns; `None` if not computed, or outdated.
    exponents: Vec<Option<i32>>,
    /// The columns that are eliminated.
    width: usize,
}

impl OpenRows {
    fn new(rows: Vec<Row>, width: usize) -> OpenRows {
        let mut with_entry = vec![Vec::new(); width];
        for (number, row) in rows.iter().enumerate() {
            for (c, _) in row.entries().take_while(|(c, _)| *c < width) {
                with_entry[c].push(number);
            }
        }
        let rows = rows.into_iter().map(|row| OpenRow::new(row, width));
        let rows: Vec<OpenRow> = rows.collect();
        OpenRows {
            open: (0..rows.len()).collect(),
            rows,
            with_entry,
            exponents: vec![None; width],
            width,
        }
    }

    fn largest(&self) -> Float320 {
        let entries = self.open.iter().map(|&i| self.rows[i].largest.abs());
        entries.fold(Float320::ZERO, Float320::max)
    }

    /// Place in `open` and column of the largest entry; the first of equal ones.
    fn largest_entry(&self) -> Option<(usize, usize)> {
        let mut best: Option<(usize, &OpenRow)> = None;
        for (place, &number) in self.open.iter().enumerate() {
            let row = &self.rows[number];
            if best.is_none_or(|(_, b)| row.largest.cmp_abs(&b.largest).is_gt()) {
                best = Some((place, row));
            }
        }
        best.map(|(place, row)| (place, row.column))
    }

    /// Returns an entry of the shortest row that has one whose binary exponent equals that of the
    /// largest entry in its column: other rows are then reduced with factors below 2, so that
    /// rounding errors do not grow. Entries up to `floor` are rounding.
    fn entry_of_a_short_row(&mut self, floor: &Float320) -> Option<(usize, usize)> {
        let places = self.open.iter().enumerate();
        let mut shortest: BinaryHeap<_> = places
            .map(|(place, &number)| Reverse((self.rows[number].entries, place)))
            .collect();
        while let Some(Reverse((_, place))) = shortest.pop() {
            let row = &self.rows[self.open[place]].row;
            for (c, x) in row.entries().take_while(|(c, _)| *c < self.width) {
                if x.cmp_abs(floor).is_le() {
                    continue;
                }
                let largest = self.exponents[c].get_or_insert_with(|| {
                    let rows = self.with_entry[c].iter();
                    let entries = rows.filter_map(|&i| self.rows[i].row.entry(c));
                    entries.map(Float320::exponent).max().unwrap_or(i32::MIN)
                });
                if x.exponent() == *largest {
                    return Some((place, c));
                }
            }
        }
        None
    }

    /// Removes the row at a place in `open`, and subtracts multiples of it from the others, such that
    /// their entries in the given column become 0.
    fn eliminate(&mut self, place: usize, column: usize, inverse: Float320) -> Row {
        let pivot_row = core::mem::take(&mut self.rows[self.open.swap_remove(place)].row);
        // entries change only in the columns of this row
        for (c, _) in pivot_row.entries() {
            if let Some(exponent) = self.exponents.get_mut(c) {
                *exponent = None;
            }
        }
        let mut space = Row::default();
        for number in core::mem::take(&mut self.with_entry[column]) {
            let open = &mut self.rows[number];
            let Some(entry) = open.row.entry(column) else {
                continue;
            };
            let factor = *entry * inverse;
            let filled = |c: usize| {
                if let Some(rows) = self.with_entry.get_mut(c) {
                    rows.push(number);
                }
            };
            open.row
                .reduce(factor, &pivot_row, column, &mut space, filled);
            open.update(self.width);
        }
        pivot_row
    }

    /// Closes the rows in which only rounding errors remain, and returns their largest entry.
    fn drop_rounding(&mut self, floor: &Float320) -> Float320 {
        let mut dropped = Float320::ZERO;
        let rows = &mut self.rows;
        self.open.retain(|&number| {
            let row = &mut rows[number];
            let kept = row.largest.cmp_abs(floor).is_gt();
            if !kept {
                dropped = dropped.max(row.largest.abs());
                row.row = Row::default();
            }
            kept
        });
        dropped
    }
}

/// Eliminates the first `width` columns.
///
/// Each pivot is the largest remaining entry. In matrices with many columns it is an entry close to
/// the largest of its column, from a row that is as short as possible: in a chain the energies of
/// the last bodies depend on few parameters, and rows eliminated in that order stay short, while
/// pivoting on the largest entries would fill all of them.
pub(super) fn eliminate(rows: Vec<Row>, width: usize) -> Eliminated {
    eliminate_in_order(rows, width, width >= SHORT_ROWS_MIN_COLUMNS)
}

fn eliminate_in_order(rows: Vec<Row>, width: usize, short_first: bool) -> Eliminated {
    let mut rows = OpenRows::new(rows, width);
    let mut done = Eliminated {
        rows: Vec::new(),
        columns: Vec::new(),
        largest: rows.largest(),
        dropped: Float320::ZERO,
    };
    let floor = done.largest.scaled(-ROUNDING_BITS);
    loop {
        let chosen = if short_first {
            rows.entry_of_a_short_row(&floor)
        } else {
            rows.largest_entry()
        };
        let pivot = chosen.and_then(|(place, column)| {
            let pivot = rows.rows[rows.open[place]].row.get(column);
            let able = pivot.cmp_abs(&floor).is_gt();
            Some((place, column, pivot.reciprocal().filter(|_| able)?))
        });
        let Some((place, column, inverse)) = pivot else {
            done.dropped = done.dropped.max(rows.largest());
            return done;
        };
        done.rows.push(rows.eliminate(place, column, inverse));
        done.columns.push(column);
        if short_first {
            // a row of rounding errors has no zeros, and would cost time in every further step
            done.dropped = done.dropped.max(rows.drop_rounding(&floor));
        }
    }
}

impl Eliminated {
    /// The largest entry that remains when further rows are reduced by the pivot rows, and whether
    /// it is more than rounding: then the rows are not in the span of the eliminated ones.
    pub(super) fn remainder_of<'r>(
        &self,
        rows: impl IntoIterator<Item = &'r Row>,
    ) -> (Float320, bool) {
        let mut left = Float320::ZERO;
        let pivots = self.rows.iter().zip(&self.columns);
        let inverses: Vec<Option<Float320>> =
            pivots.map(|(row, &c)| row.get(c).reciprocal()).collect();
        let mut space = Row::default();
        for row in rows {
            let mut row = row.clone();
            let pivots = self.rows.iter().zip(&self.columns).zip(&inverses);
            for ((pivot_row, &column), inverse) in pivots {
                if let (Some(inverse), Some(entry)) = (inverse, row.entry(column)) {
                    let factor = *entry * *inverse;
                    row.reduce(factor, pivot_row, column, &mut space, |_| ());
                }
            }
            left = left.max(row.largest());
        }
        let floor = self.largest.scaled(-ROUNDING_BITS);
        (left, left.cmp_abs(&floor).is_gt())
    }
}

/// The columns, taken in the given order, that are linearly independent of the columns before them.
pub(super) fn independent(rows: Vec<Vec<Float320>>, order: &[usize]) -> Vec<usize> {
    let rows: Vec<Row> = rows.into_iter().map(Row::of).collect();
    independent_of(&rows, order)
}

/// As [`independent`], of rows that are stored without their zeros.
pub(super) fn independent_of(rows: &[Row], order: &[usize]) -> Vec<usize> {
    let largest = rows.iter().map(Row::largest);
    let floor = largest
        .fold(Float320::ZERO, Float320::max)
        .scaled(-ROUNDING_BITS);
    let mut rows: Vec<Row> = rows.iter().map(|row| row.of_columns(order)).collect();
    let mut found = Vec::new();
    let mut space = Row::default();
    for (k, &column) in order.iter().enumerate() {
        let mut largest: Option<(usize, &Float320)> = None;
        for (i, row) in rows.iter().enumerate() {
            if let Some(x) = row.entry(k)
                && largest.is_none_or(|(_, y)| x.cmp_abs(y).is_ge())
            {
                largest = Some((i, x));
            }
        }
        let able = largest.filter(|(_, x)| x.cmp_abs(&floor).is_gt());
        let Some((i, inverse)) = able.and_then(|(i, x)| Some((i, x.reciprocal()?))) else {
            continue;
        };
        let pivot_row = rows.swap_remove(i).starting_at(k);
        for row in &mut rows {
            if let Some(entry) = row.entry(k) {
                let factor = *entry * inverse;
                row.reduce(factor, &pivot_row, k, &mut space, |_| ());
            }
        }
        found.push(column);
    }
    found
}

/// The rank of rows whose significant entries are about of magnitude `size`, and the largest entry
/// that was treated as zero, in proportion to `size`.
pub fn rank_of(rows: Vec<Vec<Float320>>, size: Float320) -> (usize, f64) {
    let width = rows.first().map_or(0, Vec::len);
    // largest entries first, so that pivots come in order of magnitude
    let rows = rows.into_iter().map(Row::of).collect();
    let done = eliminate_in_order(rows, width, false);
    let floor = size.scaled(-ROUNDING_BITS);
    let kept = done.pivots().filter(|p| p.cmp_abs(&floor).is_gt()).count();
    let dropped = done.pivots().nth(kept).unwrap_or(done.dropped);
    let part = dropped.checked_div(size);
    (kept, part.map_or(0.0, |p| p.to_f64().abs()))
}

/// A column as a linear combination of others.
#[derive(Clone, Debug)]
pub struct Relation {
    /// The column.
    pub column: usize,
    /// The other columns with their factors.
    pub terms: Vec<(usize, Float320)>,
}

/// The columns, taken in the given order, that are linear combinations of the columns before them;
/// factors that are rounding are left out.
pub fn relations(rows: &[Vec<Float320>], order: &[usize]) -> Vec<Relation> {
    let kept = independent(rows.to_vec(), order);
    let others: Vec<usize> = order
        .iter()
        .copied()
        .filter(|c| !kept.contains(c))
        .collect();
    let pick = |columns: &[usize]| -> Vec<Vec<Float320>> {
        rows.iter()
            .map(|row| columns.iter().map(|&c| row[c]).collect())
            .collect()
    };
    let factors = if kept.is_empty() {
        Some(Vec::new())
    } else {
        solve(pick(&kept), pick(&others))
    };
    let Some(factors) = factors else {
        return Vec::new();
    };
    let tiny = |x: &Float320| x.cmp_abs(&Float320::ONE.scaled(-ROUNDING_BITS)).is_le();
    let relation = |(k, column): (usize, &usize)| Relation {
        column: *column,
        terms: kept
            .iter()
            .zip(&factors)
            .filter(|(_, row)| !tiny(&row[k]))
            .map(|(c, row)| (*c, row[k]))
            .collect(),
    };
    others.iter().enumerate().map(relation).collect()
}

/// Solves `A Z = B`, which has at least as many rows as unknowns, and is consistent if it has more.
/// The result has one row per unknown, one column per right-hand side; `None` if A does not have
/// full column rank.
pub(super) fn solve(
    mut a: Vec<Vec<Float320>>,
    b: Vec<Vec<Float320>>,
) -> Option<Vec<Vec<Float320>>> {
    let unknowns = a.first().map_or(0, Vec::len);
    let sides = b.first().map_or(0, Vec::len);
    for (row, rhs) in a.iter_mut().zip(b) {
        row.extend(rhs);
    }
    solve_rows(a.into_iter().map(Row::of).collect(), unknowns, sides)
}

/// As [`solve`]; each row contains a row of A, then one of B.
pub(super) fn solve_rows(
    rows: Vec<Row>,
    unknowns: usize,
    sides: usize,
) -> Option<Vec<Vec<Float320>>> {
    let done = eliminate(rows, unknowns);
    if done.columns.len() < unknowns {
        return None;
    }
    let mut places = vec![0; unknowns];
    for (k, &column) in done.columns.iter().enumerate() {
        places[column] = k;
    }
    let mut solution = vec![Vec::new(); unknowns];
    for k in (0..unknowns).rev() {
        let (row, column) = (&done.rows[k], done.columns[k]);
        let inverse = row.get(column).reciprocal()?;
        let mut values = vec![Float320::ZERO; sides];
        // the unknowns that are already solved, in the order in which their columns were eliminated
        let mut known: Vec<(usize, usize, Float320)> = Vec::new();
        for (c, x) in row.entries() {
            match c.checked_sub(unknowns) {
                Some(side) => values[side] = *x,
                None if c != column => known.push((places[c], c, *x)),
                None => {}
            }
        }
        known.sort_by_key(|(place, ..)| *place);
        for (_, c, x) in known {
            let z: &Vec<Float320> = &solution[c];
            for (rest, z) in values.iter_mut().zip(z) {
                *rest = *rest - x * *z;
            }
        }
        solution[column] = values.into_iter().map(|rest| rest * inverse).collect();
    }
    Some(solution)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    fn wide(rows: &[&[f64]]) -> Vec<Vec<Float320>> {
        let row = |r: &&[f64]| r.iter().map(|x| Float320::from_f64(*x)).collect();
        rows.iter().map(row).collect()
    }

    #[test]
    fn a_consistent_system_with_a_redundant_row_is_solved() {
        let a = wide(&[&[0.0, 2.0], &[3.0, 4.0], &[3.0, 6.0]]);
        let b = wide(&[&[-2.0, 2.0], &[-1.0, 7.0], &[-3.0, 9.0]]);
        let expected = wide(&[&[1.0, 1.0], &[-1.0, 1.0]]);
        for (found, expected) in solve(a, b).unwrap().iter().zip(&expected) {
            for (x, y) in found.iter().zip(expected) {
                assert!((*x - *y).log10() < -95.0);
            }
        }
    }

    #[test]
    fn a_singular_system_has_no_solution() {
        let a = wide(&[&[1.0, 2.0], &[2.0, 4.0]]);
        assert!(solve(a, wide(&[&[1.0], &[2.0]])).is_none());
    }

    #[test]
    fn short_rows_first_find_the_rank_that_the_largest_entries_find() {
        // rows of a chain: they begin at different columns, and some combinations of them
        let width = 40;
        let mut number = 0.37_f64;
        let mut next = || {
            number = (number * 997.13 + 0.71).fract();
            Float320::from_f64(number - 0.5)
        };
        let mut rows: Vec<Vec<Float320>> = (0..60)
            .map(|i| {
                let mut row = vec![Float320::ZERO; width];
                row.iter_mut().skip(i % 30).for_each(|x| *x = next());
                row
            })
            .collect();
        // three columns are combinations of others
        for row in &mut rows {
            row[35] = row[33] + row[34];
            row[36] = row[32] - row[34].scaled(1);
            row[39] = Float320::ZERO;
        }
        let rows: Vec<Row> = rows.into_iter().map(Row::of).collect();
        let complete = eliminate_in_order(rows.clone(), width, false);
        let short = eliminate_in_order(rows, width, true);
        assert_eq!((complete.rows.len(), short.rows.len()), (37, 37));
        let part = |x: Float320| x.checked_div(short.largest).unwrap().log10();
        assert!(part(short.dropped) < -88.0, "{}", part(short.dropped));
        assert!(short.pivots().all(|p| part(p) > -6.0));
    }

    #[test]
    fn the_columns_asked_for_first_are_kept() {
        let rows = wide(&[&[1.0, 2.0, 0.0, 1.0], &[0.0, 0.0, 3.0, 1.0]]);
        assert_eq!(independent(rows.clone(), &[0, 1, 2, 3]), [0, 2]);
        assert_eq!(independent(rows, &[3, 1, 0, 2]), [3, 1]);
    }
}
