//! Small dense linear algebra in double precision, for sampling a mechanism
//! while its model is derived. Deterministic: plain arithmetic in a fixed order.

/// The outcome of [`solve_pivoted`].
#[derive(Clone, Debug)]
pub struct Solution {
    /// Unknowns by right-hand sides.
    pub solution: Vec<Vec<f64>>,
    /// Smallest over largest pivot of the scaled system; 0 where singular.
    pub pivot_ratio: f64,
}

/// Solves `A Z = B` with at least as many rows as unknowns, consistent where
/// there are more, by elimination with complete pivoting of the row-scaled
/// system.
pub fn solve_pivoted(mut a: Vec<Vec<f64>>, mut b: Vec<Vec<f64>>) -> Solution {
    let rows = a.len();
    let unknowns = a.first().map_or(0, Vec::len);
    let sides = b.first().map_or(0, Vec::len);
    scale_rows(&mut a, Some(&mut b));
    let mut column_of = (0..unknowns).collect::<Vec<_>>();
    let (mut smallest, mut largest) = (f64::INFINITY, 0.0_f64);
    for k in 0..unknowns {
        let Some((row, column, size)) = largest_entry(&a, k, rows, unknowns) else {
            smallest = 0.0;
            break;
        };
        a.swap(k, row);
        b.swap(k, row);
        for r in &mut a {
            r.swap(k, column);
        }
        column_of.swap(k, column);
        smallest = smallest.min(size);
        largest = largest.max(size);
        let (pivot_a, pivot_b) = (a[k].clone(), b[k].clone());
        for i in k + 1..rows {
            let factor = a[i][k] / pivot_a[k];
            if factor == 0.0 {
                continue;
            }
            for (x, p) in a[i].iter_mut().zip(&pivot_a).skip(k) {
                *x -= factor * p;
            }
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

/// Rows below this part of the matrix are not scaled up: a redundant row may
/// hold nothing but rounding.
const FLOOR: f64 = 1.0 / 1024.0;

/// Divides every row by its largest entry, so that metres and radians compare.
fn scale_rows(a: &mut [Vec<f64>], mut b: Option<&mut Vec<Vec<f64>>>) {
    let size = |row: &[f64]| row.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let whole = a.iter().fold(0.0_f64, |m, row| m.max(size(row)));
    for (i, row) in a.iter_mut().enumerate() {
        let size = size(row).max(FLOOR * whole);
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

fn largest_entry(
    a: &[Vec<f64>],
    from: usize,
    rows: usize,
    columns: usize,
) -> Option<(usize, usize, f64)> {
    let mut best: Option<(usize, usize, f64)> = None;
    for (i, row) in a.iter().enumerate().take(rows).skip(from) {
        for (j, x) in row.iter().enumerate().take(columns).skip(from) {
            let size = x.abs();
            if size > best.map_or(0.0, |b| b.2) {
                best = Some((i, j, size));
            }
        }
    }
    best
}

/// The rank of a matrix whose dependent part is below `tolerance` times its
/// largest scaled pivot, and the columns that carry it, preferred in the order
/// given by `preference` (the smaller, the earlier).
pub fn rank_and_columns(mut a: Vec<Vec<f64>>, tolerance: f64) -> (usize, Vec<usize>) {
    let rows = a.len();
    let columns = a.first().map_or(0, Vec::len);
    scale_rows(&mut a, None);
    let mut order = (0..columns).collect::<Vec<_>>();
    let mut largest = 0.0_f64;
    let mut rank = 0;
    while rank < rows.min(columns) {
        let Some((row, column, size)) = largest_entry(&a, rank, rows, columns) else {
            break;
        };
        largest = largest.max(size);
        if size <= tolerance * largest {
            break;
        }
        a.swap(rank, row);
        for r in &mut a {
            r.swap(rank, column);
        }
        order.swap(rank, column);
        let pivot = a[rank].clone();
        for r in a.iter_mut().skip(rank + 1) {
            let factor = r[rank] / pivot[rank];
            for (x, p) in r.iter_mut().zip(&pivot).skip(rank) {
                *x -= factor * p;
            }
        }
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
    fn a_singular_system_is_a_zero_ratio_and_no_number() {
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
