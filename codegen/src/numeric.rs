//! Small dense linear algebra in double precision, for sampling a mechanism during the derivation.
//! Deterministic: plain arithmetic in a fixed order.

/// The result of [`solve_pivoted`].
#[derive(Clone, Debug)]
pub struct Solution {
    /// Unknowns by right-hand sides; NaN if the system is singular.
    pub solution: Vec<Vec<f64>>,
    /// Ratio of the smallest to the largest pivot of the scaled system; 0 if it is singular.
    pub pivot_ratio: f64,
}

/// Solves `A Z = B` by elimination with complete pivoting of the row-scaled system. A has at least
/// as many rows as unknowns; if it has more, the system must be consistent.
///
/// ```
/// use regen_codegen::numeric::solve_pivoted;
///
/// // x + y = 3 and x - y = 1
/// let a = vec![vec![1.0, 1.0], vec![1.0, -1.0]];
/// let solved = solve_pivoted(a, vec![vec![3.0], vec![1.0]]);
/// assert_eq!(solved.solution, [[2.0], [1.0]]);
/// assert_eq!(solved.pivot_ratio, 0.5);
/// ```
pub fn solve_pivoted(mut a: Vec<Vec<f64>>, mut b: Vec<Vec<f64>>) -> Solution {
    let rows = a.len();
    let unknowns = a.first().map_or(0, Vec::len);
    let sides = b.first().map_or(0, Vec::len);
    scale_rows(&mut a, Some(&mut b));
    let mut column_of = (0..unknowns).collect::<Vec<_>>();
    let (mut smallest, mut largest) = (f64::INFINITY, 0.0_f64);
    let mut sizes = RowSizes::of(&a);
    for k in 0..unknowns {
        let Some((row, column, size)) = sizes.largest_entry(&a, k) else {
            smallest = 0.0;
            break;
        };
        a.swap(k, row);
        b.swap(k, row);
        sizes.swap(k, row);
        for r in &mut a {
            r.swap(k, column);
        }
        column_of.swap(k, column);
        smallest = smallest.min(size);
        largest = largest.max(size);
        let pivot_b = b[k].clone();
        let changed_rows = eliminate(&mut a, k, &mut sizes);
        for (i, factor) in changed_rows {
            for (x, p) in b[i].iter_mut().zip(&pivot_b) {
                *x -= factor * p;
            }
        }
    }
    let mut solution = vec![vec![f64::NAN; sides]; unknowns];
    if smallest > 0.0 && rows >= unknowns {
        for k in (0..unknowns).rev() {
            for side in 0..sides {
                let known: f64 = (k + 1..unknowns)
                    .map(|j| a[k][j] * solution[column_of[j]][side])
                    .sum();
                solution[column_of[k]][side] = (b[k][side] - known) / a[k][k];
            }
        }
    }
    let pivot_ratio = if unknowns == 0 {
        1.0
    } else {
        smallest / largest
    };
    Solution {
        solution,
        pivot_ratio: if pivot_ratio.is_finite() {
            pivot_ratio
        } else {
            0.0
        },
    }
}

/// Smallest fraction of the matrix's largest entry that rows are scaled by: a redundant row may
/// consist of rounding errors and is not scaled up.
const MIN_ROW_SCALE: f64 = 1.0 / 1024.0;

/// The largest absolute value in a row; NaN counts as zero.
fn size(row: &[f64]) -> f64 {
    row.iter().fold(0.0_f64, |m, x| m.max(x.abs()))
}

/// Divides every row by its largest absolute value, so that rows in metres and in radians compare.
fn scale_rows(a: &mut [Vec<f64>], mut b: Option<&mut Vec<Vec<f64>>>) {
    let whole = a.iter().fold(0.0_f64, |m, row| m.max(size(row)));
    for (i, row) in a.iter_mut().enumerate() {
        let size = size(row).max(MIN_ROW_SCALE * whole);
        if size > 0.0 && size.is_finite() {
            for x in row.iter_mut() {
                *x /= size;
            }
            if let Some(b) = &mut b {
                for x in &mut b[i] {
                    *x /= size;
                }
            }
        }
    }
}

/// The largest absolute value of each row during an elimination, among the remaining columns. Loops
/// share few coordinates, so most rows do not change from pivot to pivot.
struct RowSizes(Vec<f64>);

impl RowSizes {
    fn of(a: &[Vec<f64>]) -> RowSizes {
        RowSizes(a.iter().map(|row| size(row)).collect())
    }

    fn swap(&mut self, i: usize, j: usize) {
        self.0.swap(i, j);
    }

    /// Row, column and absolute value of the first of the largest entries, row by row, at and after
    /// row and column `from`; `None` if all are zero.
    fn largest_entry(&self, a: &[Vec<f64>], from: usize) -> Option<(usize, usize, f64)> {
        let mut best: Option<(usize, f64)> = None;
        for (i, &size) in self.0.iter().enumerate().skip(from) {
            if size > best.map_or(0.0, |b| b.1) {
                best = Some((i, size));
            }
        }
        let (row, size) = best?;
        let column = a[row][from..].iter().position(|x| x.abs() >= size)?;
        Some((row, from + column, size))
    }
}

/// Subtracts multiples of row `k` from the rows below it so that column `k` is zero there; returns
/// the rows that changed with their factors.
fn eliminate(a: &mut [Vec<f64>], k: usize, sizes: &mut RowSizes) -> Vec<(usize, f64)> {
    let pivot = a[k].clone();
    let filled: Vec<usize> = (k..pivot.len()).filter(|&j| pivot[j] != 0.0).collect();
    let mut changed_rows = Vec::new();
    for (i, row) in a.iter_mut().enumerate().skip(k + 1) {
        if row[k] == 0.0 {
            continue;
        }
        let factor = row[k] / pivot[k];
        for &j in &filled {
            row[j] -= factor * pivot[j];
        }
        sizes.0[i] = size(&row[k + 1..]);
        changed_rows.push((i, factor));
    }
    changed_rows
}

/// The rank of a matrix, and a set of as many independent columns. Pivots of the row-scaled matrix
/// of at most `tolerance` times the largest pivot count as zero.
///
/// ```
/// use regen_codegen::numeric::rank_and_columns;
///
/// // the second column is twice the first
/// let a = vec![vec![1.0, 2.0, 0.0], vec![2.0, 4.0, 1.0]];
/// assert_eq!(rank_and_columns(a, 1e-9), (2, vec![1, 2]));
/// ```
pub fn rank_and_columns(mut a: Vec<Vec<f64>>, tolerance: f64) -> (usize, Vec<usize>) {
    let rows = a.len();
    let columns = a.first().map_or(0, Vec::len);
    scale_rows(&mut a, None);
    let mut order = (0..columns).collect::<Vec<_>>();
    let mut largest = 0.0_f64;
    let mut rank = 0;
    let mut sizes = RowSizes::of(&a);
    while rank < rows.min(columns) {
        let Some((row, column, size)) = sizes.largest_entry(&a, rank) else {
            break;
        };
        largest = largest.max(size);
        if size <= tolerance * largest {
            break;
        }
        a.swap(rank, row);
        sizes.swap(rank, row);
        for r in &mut a {
            r.swap(rank, column);
        }
        order.swap(rank, column);
        eliminate(&mut a, rank, &mut sizes);
        rank += 1;
    }
    order.truncate(rank);
    (rank, order)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_consistent_system_with_a_redundant_row_is_solved() {
        let a = vec![vec![1.0, 2.0], vec![2.0, 4.0], vec![0.0, -3.0]];
        let x = [0.25, -2.0];
        let b = a
            .iter()
            .map(|r: &Vec<f64>| vec![r[0] * x[0] + r[1] * x[1]])
            .collect();
        let s = solve_pivoted(a, b);
        assert!((s.solution[0][0] - x[0]).abs() < 1e-15 && (s.solution[1][0] - x[1]).abs() < 1e-15);
        assert!(s.pivot_ratio > 0.1);
    }

    #[test]
    fn a_singular_system_has_a_pivot_ratio_of_zero() {
        let s = solve_pivoted(
            vec![vec![1.0, 2.0], vec![2.0, 4.0]],
            vec![vec![1.0], vec![2.0]],
        );
        assert!(s.pivot_ratio < 1e-15);
    }

    #[test]
    fn a_row_of_rounding_adds_no_rank() {
        let a = vec![vec![1.0, 2.0], vec![3e-17, -1e-17]];
        assert_eq!(rank_and_columns(a, 1e-8).0, 1);
    }

    #[test]
    fn rank_counts_independent_columns() {
        let a = vec![
            vec![1.0, 2.0, 3.0],
            vec![2.0, 4.0, 6.1],
            vec![3.0, 6.0, 9.1],
        ];
        let (rank, columns) = rank_and_columns(a, 1e-9);
        assert_eq!(rank, 2);
        assert!(columns.contains(&2));
    }
}
