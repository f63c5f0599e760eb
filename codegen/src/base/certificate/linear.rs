//! Linear algebra in multiple precision: complete pivoting, and no scaling of
//! rows, since a row of rounding must stay one.

use super::wide::Wide;

/// What is left below this part of the largest pivot is rounding: 2^-200, or
/// 1e-60, far from both the rounding of 96 digits and anything that a mechanism
/// of sane proportions holds.
const ROUNDING: i32 = 200;

/// A matrix after elimination.
#[derive(Clone, Debug)]
pub(super) struct Eliminated {
    /// Pivot rows, in order: each has zeros at the columns of earlier pivots.
    pub(super) rows: Vec<Vec<Wide>>,
    /// The pivots' columns.
    pub(super) columns: Vec<usize>,
    /// The largest entry left over: rounding, or 0.
    pub(super) dropped: Wide,
}

impl Eliminated {
    /// The sizes of the pivots.
    pub(super) fn pivots(&self) -> impl Iterator<Item = Wide> {
        let pairs = self.rows.iter().zip(&self.columns);
        pairs.map(|(row, c)| row[*c].abs())
    }
}

/// Eliminates the first `width` columns.
pub(super) fn eliminate(mut rows: Vec<Vec<Wide>>, width: usize) -> Eliminated {
    let mut done = Eliminated {
        rows: Vec::new(),
        columns: Vec::new(),
        dropped: Wide::ZERO,
    };
    let mut free = (0..width).collect::<Vec<_>>();
    let mut first = None;
    loop {
        let mut best = (0, 0, Wide::ZERO);
        for (i, row) in rows.iter().enumerate() {
            for &c in &free {
                if row[c].cmp_abs(&best.2).is_gt() {
                    best = (i, c, row[c]);
                }
            }
        }
        let (i, column, pivot) = best;
        let floor = first.get_or_insert(pivot).abs().scaled(-ROUNDING);
        let inverse = pivot.reciprocal();
        let Some(inverse) = inverse.filter(|_| pivot.cmp_abs(&floor).is_gt()) else {
            done.dropped = pivot.abs();
            return done;
        };
        let pivot_row = rows.swap_remove(i);
        free.retain(|&c| c != column);
        let carried: Vec<usize> = free
            .iter()
            .copied()
            .chain(width..pivot_row.len())
            .filter(|&c| !pivot_row[c].is_zero())
            .collect();
        for row in &mut rows {
            if row[column].is_zero() {
                continue;
            }
            let factor = row[column] * inverse;
            row[column] = Wide::ZERO;
            for &c in &carried {
                row[c] = row[c] - factor * pivot_row[c];
            }
        }
        done.rows.push(pivot_row);
        done.columns.push(column);
    }
}

impl Eliminated {
    /// The largest number that is left of more rows, and whether it is more than rounding: then
    /// they are not in the span of those that were eliminated.
    pub(super) fn left_of(&self, rows: Vec<Vec<Wide>>) -> (Wide, bool) {
        let mut left = Wide::ZERO;
        let inverses: Vec<Option<Wide>> = self
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
                row[column] = Wide::ZERO;
            }
            left = row.iter().map(|x| x.abs()).fold(left, Wide::max);
        }
        let floor = self.pivots().next().map(|first| first.scaled(-ROUNDING));
        (
            left,
            floor.is_none_or(|f| left.cmp_abs(&f).is_gt()) && !left.is_zero(),
        )
    }
}

/// The first columns, in a given order, that do not follow from those before.
pub(super) fn independent(mut rows: Vec<Vec<Wide>>, order: &[usize]) -> Vec<usize> {
    let entries = rows.iter().flatten().map(|x| x.abs());
    let floor = entries.fold(Wide::ZERO, Wide::max).scaled(-ROUNDING);
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

/// The rank of rows whose entries are of the given size where they are more than
/// rounding, and the largest number dropped as a part of that size.
pub fn rank_of(rows: Vec<Vec<Wide>>, size: Wide) -> (usize, f64) {
    let width = rows.first().map_or(0, Vec::len);
    let done = eliminate(rows, width);
    let floor = size.scaled(-ROUNDING);
    let kept = done.pivots().filter(|p| p.cmp_abs(&floor).is_gt()).count();
    // pivots come in order of size
    let dropped = done.pivots().nth(kept).unwrap_or(done.dropped);
    let part = dropped.checked_div(size);
    (kept, part.map_or(0.0, |p| p.to_f64().abs()))
}

/// A column as a combination of others.
#[derive(Clone, Debug)]
pub struct Relation {
    /// The column.
    pub column: usize,
    /// Other columns with their factors.
    pub terms: Vec<(usize, Wide)>,
}

/// The columns that follow from those before them, in a given order; factors that
/// are rounding are left out.
pub fn relations(rows: &[Vec<Wide>], order: &[usize]) -> Vec<Relation> {
    let kept = independent(rows.to_vec(), order);
    let others: Vec<usize> = order
        .iter()
        .copied()
        .filter(|c| !kept.contains(c))
        .collect();
    let pick = |columns: &[usize]| -> Vec<Vec<Wide>> {
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
    let tiny = |x: &Wide| x.cmp_abs(&Wide::ONE.scaled(-ROUNDING)).is_le();
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

/// Solves `A Z = B` with at least as many rows as unknowns, consistent where
/// there are more; unknowns by right-hand sides. `None` where it is singular.
pub(super) fn solve(mut a: Vec<Vec<Wide>>, b: Vec<Vec<Wide>>) -> Option<Vec<Vec<Wide>>> {
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
                let z: &Vec<Wide> = &solution[c];
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

    fn wide(rows: &[&[f64]]) -> Vec<Vec<Wide>> {
        let row = |r: &&[f64]| r.iter().map(|x| Wide::from_f64(*x)).collect();
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
    fn the_columns_asked_for_first_are_kept() {
        let rows = wide(&[&[1.0, 2.0, 0.0, 1.0], &[0.0, 0.0, 3.0, 1.0]]);
        assert_eq!(independent(rows.clone(), &[0, 1, 2, 3]), [0, 2]);
        assert_eq!(independent(rows, &[3, 1, 0, 2]), [3, 1]);
    }
}
