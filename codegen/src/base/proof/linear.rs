//! Linear algebra modulo a prime.

use super::mechanism::Scalar;
use super::residue::Residue;

/// The reduced rows with the columns of their pivots, among the first `width` columns.
fn reduced<const P: u64>(
    mut rows: Vec<Vec<Residue<P>>>,
    width: usize,
) -> (Vec<Vec<Residue<P>>>, Vec<usize>) {
    let mut pivots = Vec::new();
    for column in 0..width {
        let done = pivots.len();
        let found = (done..rows.len()).find(|&row| !rows[row][column].is_zero());
        let Some(found) = found else { continue };
        rows.swap(done, found);
        let mut pivot = rows[done].clone();
        let Some(inverse) = pivot[column].inverse() else {
            continue;
        };
        for x in &mut pivot {
            *x = *x * inverse;
        }
        for (place, row) in rows.iter_mut().enumerate() {
            let factor = row[column];
            if place == done || factor.is_zero() {
                continue;
            }
            for (x, own) in row.iter_mut().zip(&pivot) {
                *x = *x - factor * *own;
            }
        }
        rows[done] = pivot;
        pivots.push(column);
    }
    (rows, pivots)
}

pub(super) fn rank<const P: u64>(rows: Vec<Vec<Residue<P>>>) -> usize {
    let width = rows.first().map_or(0, Vec::len);
    reduced(rows, width).1.len()
}

/// A random solution of linear equations; each row has one entry per unknown, then its right-hand side. `None` if
/// there is none.
pub(super) fn solve<const P: u64>(
    rows: Vec<Vec<Residue<P>>>,
    unknowns: usize,
    mut random: impl FnMut() -> Residue<P>,
) -> Option<Vec<Residue<P>>> {
    let (rows, pivots) = reduced(rows, unknowns);
    let mut left = rows.iter().skip(pivots.len());
    if left.any(|row| !row[unknowns].is_zero()) {
        return None;
    }
    let mut solution: Vec<Residue<P>> = (0..unknowns).map(|_| random()).collect();
    for pivot in &pivots {
        solution[*pivot] = Residue::ZERO;
    }
    let free = solution.clone();
    for (row, pivot) in rows.iter().zip(&pivots) {
        let taken = super::dot(&row[..unknowns], &free);
        solution[*pivot] = row[unknowns] - taken;
    }
    Some(solution)
}

/// A basis of the vectors that all rows, of this width, map to 0.
pub(super) fn kernel<const P: u64>(
    rows: Vec<Vec<Residue<P>>>,
    width: usize,
) -> Vec<Vec<Residue<P>>> {
    let (rows, pivots) = reduced(rows, width);
    let free = (0..width).filter(|column| !pivots.contains(column));
    let vector = |column: usize| {
        let mut out = vec![Residue::ZERO; width];
        out[column] = Residue::ONE;
        for (row, pivot) in rows.iter().zip(&pivots) {
            out[*pivot] = -row[column];
        }
        out
    };
    free.map(vector).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::PRIMES;
    use super::*;

    #[test]
    fn solutions_and_kernels_satisfy_the_equations() {
        let of = Residue::<{ PRIMES[0] }>::new;
        let rows: Vec<Vec<_>> = [[1, 2, 3, 6], [2, 4, 7, 13], [3, 6, 10, 19]]
            .iter()
            .map(|row| row.iter().map(|x| of(*x)).collect())
            .collect();
        let left: Vec<Vec<_>> = rows.iter().map(|row| row[..3].to_vec()).collect();
        assert_eq!(rank(left.clone()), 2);
        let mut next = 40;
        let x = solve(rows.clone(), 3, || {
            next += 1;
            of(next)
        });
        for row in &rows {
            assert_eq!(super::super::dot(&row[..3], x.as_ref().unwrap()), row[3]);
        }
        let basis = kernel(left.clone(), 3);
        assert_eq!(basis.len(), 1);
        assert!(
            left.iter()
                .all(|row| super::super::dot(row, &basis[0]).is_zero())
        );
        let mut contradicting = rows;
        contradicting[2][3] = of(20);
        assert!(solve(contradicting, 3, || of(1)).is_none());
    }
}
