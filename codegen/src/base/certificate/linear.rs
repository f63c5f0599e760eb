//! Linear algebra in multiple precision. Rows are not scaled, so that a row of rounding errors
//! remains recognisable as one.

use std::collections::BTreeMap;

use super::float320::Float320;

/// Exponent of the threshold for rounding: entries below 2^-200, or 1e-60, of the largest pivot
/// count as zero. That is far from both the rounding of 96 digits and any entry that a mechanism of
/// sane proportions has.
const ROUNDING_BITS: i32 = 200;

/// A matrix after elimination.
#[derive(Clone, Debug)]
pub(super) struct Eliminated {
    /// Pivot rows, in the order of elimination: each has zeros in the columns of earlier pivots.
    pub(super) rows: Vec<Vec<Float320>>,
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
        pairs.map(|(row, c)| row[*c].abs())
    }
}

/// From this number of columns on, pivots are chosen such that the rows stay short.
const SHORT_ROWS_MIN_COLUMNS: usize = 200;

/// A row that has not become a pivot row yet, with the data that the choice of a pivot needs.
struct OpenRow {
    row: Vec<Float320>,
    /// The column of its largest entry, and that entry.
    column: usize,
    largest: Float320,
    /// Number of its nonzero entries.
    entries: usize,
}

impl OpenRow {
    fn new(row: Vec<Float320>, free: &[usize]) -> OpenRow {
        let mut open = OpenRow {
            row,
            column: 0,
            largest: Float320::ZERO,
            entries: 0,
        };
        open.update(free);
        open
    }

    fn update(&mut self, free: &[usize]) {
        (self.column, self.largest, self.entries) = (0, Float320::ZERO, 0);
        for &c in free {
            let x = &self.row[c];
            if x.is_zero() {
                continue;
            }
            self.entries += 1;
            if x.cmp_abs(&self.largest).is_gt() {
                (self.column, self.largest) = (c, *x);
            }
        }
    }
}

/// Row and column of the largest entry; the first of equal ones.
fn largest_entry(rows: &[OpenRow]) -> Option<(usize, usize)> {
    let mut best: Option<(usize, &OpenRow)> = None;
    for (i, row) in rows.iter().enumerate() {
        if best.is_none_or(|(_, b)| row.largest.cmp_abs(&b.largest).is_gt()) {
            best = Some((i, row));
        }
    }
    best.map(|(i, row)| (i, row.column))
}

/// Returns an entry of the shortest row that has one whose binary exponent equals that of the
/// largest entry in its column: other rows are then reduced with factors below 2, so that rounding
/// errors do not grow. Entries up to `floor` are rounding.
fn entry_of_a_short_row(
    rows: &[OpenRow],
    free: &[usize],
    floor: &Float320,
) -> Option<(usize, usize)> {
    let mut order: Vec<usize> = (0..rows.len()).collect();
    order.sort_by_key(|&i| rows[i].entries);
    let mut columns: BTreeMap<usize, Float320> = BTreeMap::new();
    for &i in &order {
        let row = &rows[i].row;
        for &c in free {
            let x = &row[c];
            if x.cmp_abs(floor).is_le() {
                continue;
            }
            let largest = columns.entry(c).or_insert_with(|| {
                let entries = rows.iter().map(|r| r.row[c].abs());
                entries.fold(Float320::ZERO, Float320::max)
            });
            if x.exponent() == largest.exponent() {
                return Some((i, c));
            }
        }
    }
    None
}

/// Eliminates the first `width` columns.
///
/// Each pivot is the largest remaining entry. In matrices with many columns it is an entry close to
/// the largest of its column, from a row that is as short as possible: in a chain the energies of
/// the last bodies depend on few parameters, and rows eliminated in that order stay short, while
/// pivoting on the largest entries would fill all of them.
pub(super) fn eliminate(rows: Vec<Vec<Float320>>, width: usize) -> Eliminated {
    eliminate_in_order(rows, width, width >= SHORT_ROWS_MIN_COLUMNS)
}

fn eliminate_in_order(rows: Vec<Vec<Float320>>, width: usize, short_first: bool) -> Eliminated {
    let mut free = (0..width).collect::<Vec<_>>();
    let mut rows: Vec<OpenRow> = rows
        .into_iter()
        .map(|row| OpenRow::new(row, &free))
        .collect();
    let largest = |rows: &[OpenRow]| {
        let entries = rows.iter().map(|r| r.largest.abs());
        entries.fold(Float320::ZERO, Float320::max)
    };
    let mut done = Eliminated {
        rows: Vec::new(),
        columns: Vec::new(),
        largest: largest(&rows),
        dropped: Float320::ZERO,
    };
    let floor = done.largest.scaled(-ROUNDING_BITS);
    loop {
        let chosen = if short_first {
            entry_of_a_short_row(&rows, &free, &floor)
        } else {
            largest_entry(&rows)
        };
        let able = chosen.filter(|&(i, c)| rows[i].row[c].cmp_abs(&floor).is_gt());
        let inverse = able.and_then(|(i, c)| Some((i, c, rows[i].row[c].reciprocal()?)));
        let Some((i, column, inverse)) = inverse else {
            done.dropped = done.dropped.max(largest(&rows));
            return done;
        };
        let pivot_row = rows.swap_remove(i).row;
        free.retain(|&c| c != column);
        let carried: Vec<usize> = free
            .iter()
            .copied()
            .chain(width..pivot_row.len())
            .filter(|&c| !pivot_row[c].is_zero())
            .collect();
        for open in &mut rows {
            let row = &mut open.row;
            if row[column].is_zero() {
                continue;
            }
            let factor = row[column] * inverse;
            row[column] = Float320::ZERO;
            for &c in &carried {
                row[c] = row[c] - factor * pivot_row[c];
            }
            open.update(&free);
        }
        if short_first {
            // a row of rounding errors has no zeros, and would cost time in every further step
            rows.retain(|r| {
                let kept = r.largest.cmp_abs(&floor).is_gt();
                if !kept {
                    done.dropped = done.dropped.max(r.largest.abs());
                }
                kept
            });
        }
        done.rows.push(pivot_row);
        done.columns.push(column);
    }
}

impl Eliminated {
    /// The largest entry that remains when further rows are reduced by the pivot rows, and whether
    /// it is more than rounding: then the rows are not in the span of the eliminated ones.
    pub(super) fn remainder_of(&self, rows: Vec<Vec<Float320>>) -> (Float320, bool) {
        let mut left = Float320::ZERO;
        let inverses: Vec<Option<Float320>> = self
            .rows
            .iter()
            .zip(&self.columns)
            .map(|(row, &c)| row[c].reciprocal())
            .collect();
        for mut row in rows {
            for ((pivot_row, &column), inverse) in
                self.rows.iter().zip(&self.columns).zip(&inverses)
            {
                let Some(inverse) = inverse.filter(|_| !row[column].is_zero()) else {
                    continue;
                };
                let factor = row[column] * inverse;
                for (x, p) in row.iter_mut().zip(pivot_row) {
                    if !p.is_zero() {
                        *x = *x - factor * *p;
                    }
                }
                row[column] = Float320::ZERO;
            }
            left = row.iter().map(|x| x.abs()).fold(left, Float320::max);
        }
        let floor = self.largest.scaled(-ROUNDING_BITS);
        (left, left.cmp_abs(&floor).is_gt())
    }
}

/// The columns, taken in the given order, that are linearly independent of the columns before them.
pub(super) fn independent(mut rows: Vec<Vec<Float320>>, order: &[usize]) -> Vec<usize> {
    let entries = rows.iter().flatten().map(|x| x.abs());
    let floor = entries
        .fold(Float320::ZERO, Float320::max)
        .scaled(-ROUNDING_BITS);
    let mut found = Vec::new();
    for (k, &column) in order.iter().enumerate() {
        let largest = (0..rows.len()).max_by(|&i, &j| rows[i][column].cmp_abs(&rows[j][column]));
        let Some(i) = largest.filter(|&i| rows[i][column].cmp_abs(&floor).is_gt()) else {
            continue;
        };
        let pivot_row = rows.swap_remove(i);
        let Some(inverse) = pivot_row[column].reciprocal() else {
            continue;
        };
        for row in &mut rows {
            if row[column].is_zero() {
                continue;
            }
            let factor = row[column] * inverse;
            for &c in &order[k + 1..] {
                if !pivot_row[c].is_zero() {
                    row[c] = row[c] - factor * pivot_row[c];
                }
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
    let done = eliminate(a, unknowns);
    if done.columns.len() < unknowns {
        return None;
    }
    let mut solution = vec![Vec::new(); unknowns];
    for k in (0..unknowns).rev() {
        let (row, column) = (&done.rows[k], done.columns[k]);
        let inverse = row[column].reciprocal()?;
        let values = (0..sides).map(|side| {
            let known = &done.columns[k + 1..];
            let rest = known.iter().fold(row[unknowns + side], |rest, &c| {
                let z: &Vec<Float320> = &solution[c];
                rest - row[c] * z[side]
            });
            rest * inverse
        });
        solution[column] = values.collect();
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
