//! Gaussian elimination of A_e in a fixed order of pivots, chosen once over sampled states of the
//! closed mechanism and then carried out on expressions.
//!
//! The order is a compromise between few operations (Markowitz's count of the fill-in) and accuracy
//! over the workspace: at every sampled state a pivot must be at least a tenth of the largest
//! remaining entry in its column, so that no multiplier exceeds ten there.

use crate::sym::{Ex, Graph};

/// Smallest ratio of an acceptable pivot to its column's largest entry, at all samples.
const MIN_PIVOT_FRACTION: f64 = 0.1;
/// Factor on the quality of a pivot that changes its sign among the samples.
const SIGN_CHANGE_FACTOR: f64 = 0.01;
/// Scaled pivots below this are taken for zero: their rows are redundant.
const ZERO_PIVOT: f64 = 1e-9;

/// A fixed order of pivots for an elimination.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Row, column and median absolute value (over the samples) of each pivot, in order.
    pub pivots: Vec<(usize, usize, f64)>,
    /// Rows without a pivot: redundant on the mechanism's motion.
    pub left_out: Vec<usize>,
    /// Number of pivots that are small, or change their sign, among the samples, so that the order
    /// is unfit at some states.
    pub unfit: usize,
}

/// Chooses the order of pivots for a matrix. `structure` tells for each entry whether it is
/// identically zero (`None`) or else whether it is constant; `samples` are values of the matrix.
/// `None` if the columns are linearly dependent.
pub fn plan(structure: &[Vec<Option<bool>>], samples: &[Vec<Vec<f64>>]) -> Option<Plan> {
    let rows = structure.len();
    let columns = structure.first().map_or(0, Vec::len);
    let mut filled: Vec<Vec<bool>> = structure
        .iter()
        .map(|row| row.iter().map(Option::is_some).collect())
        .collect();
    let mut constant: Vec<Vec<bool>> = structure
        .iter()
        .map(|row| row.iter().map(|e| *e == Some(true)).collect())
        .collect();
    // one scale per row for all samples, so that rows in metres and in radians compare
    let scale: Vec<f64> = (0..rows)
        .map(|i| {
            let entries = samples.iter().flat_map(|s| &s[i]);
            entries.fold(0.0_f64, |m, x| m.max(x.abs()))
        })
        .collect();
    // rows of rounding errors, in redundant rows, are not scaled up
    let whole = scale.iter().fold(f64::MIN_POSITIVE, |m: f64, x| m.max(*x));
    let scale: Vec<f64> = scale.iter().map(|s| s.max(whole / 1024.0)).collect();
    let mut work = samples.to_vec();
    let mut free_rows = (0..rows).collect::<Vec<_>>();
    let mut free_columns = (0..columns).collect::<Vec<_>>();
    let mut pivots = Vec::new();
    let mut unfit = 0;
    while !free_columns.is_empty() {
        let mut best: Option<(bool, usize, bool, f64, usize, usize)> = None;
        let in_rows: Vec<usize> = filled
            .iter()
            .map(|row| free_columns.iter().filter(|&&j| row[j]).count())
            .collect();
        for &c in &free_columns {
            let in_column: Vec<usize> = free_rows
                .iter()
                .copied()
                .filter(|&r| filled[r][c])
                .collect();
            let largest: Vec<f64> = work
                .iter()
                .map(|sample| {
                    let sizes = in_column.iter().map(|&i| sample[i][c].abs() / scale[i]);
                    sizes.fold(0.0, f64::max)
                })
                .collect();
            for &r in &in_column {
                let quality = quality(&work, scale[r], &largest, r, c);
                if quality <= 0.0 {
                    continue;
                }
                let good = quality >= MIN_PIVOT_FRACTION;
                let fill = (in_rows[r] - 1) * (in_column.len() - 1);
                let candidate = (good, fill, constant[r][c], quality, r, c);
                if best.is_none_or(|b| better(&candidate, &b)) {
                    best = Some(candidate);
                }
            }
        }
        let (good, .., r, c) = best?;
        unfit += usize::from(!good);
        let mut sizes: Vec<f64> = work.iter().map(|s| s[r][c].abs()).collect();
        sizes.sort_by(f64::total_cmp);
        pivots.push((r, c, sizes[sizes.len() / 2]));
        free_rows.retain(|&i| i != r);
        free_columns.retain(|&j| j != c);
        for &i in &free_rows {
            if !filled[i][c] {
                continue;
            }
            for &j in &free_columns {
                if filled[r][j] {
                    let (from, factor) = (constant[r][j], constant[i][c] && constant[r][c]);
                    constant[i][j] = (constant[i][j] || !filled[i][j]) && from && factor;
                    filled[i][j] = true;
                }
            }
        }
        for sample in &mut work {
            let pivot = sample[r].clone();
            for &i in free_rows.iter().filter(|&&i| filled[i][c]) {
                let factor = sample[i][c] / pivot[c];
                for &j in free_columns.iter().filter(|&&j| filled[r][j]) {
                    sample[i][j] -= factor * pivot[j];
                }
            }
        }
    }
    Some(Plan {
        pivots,
        left_out: free_rows,
        unfit,
    })
}

/// The smallest ratio, over the samples, of a pivot to its column's largest entry; 0 if the pivot
/// vanishes. A pivot with both signs vanishes somewhere between the samples, and is taken only if
/// there is no other.
fn quality(work: &[Vec<Vec<f64>>], scale: f64, largest: &[f64], r: usize, c: usize) -> f64 {
    let parts = work.iter().zip(largest).map(|(sample, largest)| {
        let size = sample[r][c].abs() / scale;
        if size < ZERO_PIVOT {
            return 0.0;
        }
        size / largest
    });
    let least = parts.fold(f64::INFINITY, f64::min);
    let positive = work.iter().filter(|s| s[r][c] > 0.0).count();
    let steady = positive == 0 || positive == work.len();
    match least.is_finite() {
        true if steady => least,
        true => least * SIGN_CHANGE_FACTOR,
        false => 0.0,
    }
}

type Candidate = (bool, usize, bool, f64, usize, usize);

/// Whether candidate `a` is a better pivot than `b`. Acceptable pivots come first; among them those
/// with less fill-in, then constants, then the larger; among unacceptable ones the largest.
fn better(a: &Candidate, b: &Candidate) -> bool {
    if a.0 != b.0 {
        return a.0;
    }
    if !a.0 {
        return a.3 > b.3;
    }
    if a.1 != b.1 {
        return a.1 < b.1;
    }
    if a.2 != b.2 {
        return a.2;
    }
    // keep the earlier one unless the other is clearly larger
    a.3 > 1.25 * b.3
}

/// For each entry, `None` if it is identically zero, else whether it is constant.
pub fn structure(g: &Graph, matrix: &[Vec<Ex>]) -> Vec<Vec<Option<bool>>> {
    let entry = |e: &Ex| (!e.is_zero()).then(|| g.value(*e).is_some());
    matrix
        .iter()
        .map(|row| row.iter().map(entry).collect())
        .collect()
}

/// The result of an elimination.
#[derive(Clone, Debug)]
pub struct Eliminated {
    /// Unknowns by right-hand sides.
    pub solution: Vec<Vec<Ex>>,
    /// The pivots with the absolute values that they usually have.
    pub pivots: Vec<(Ex, f64)>,
    /// The eliminated right-hand sides of the rows without a pivot.
    pub left: Vec<Vec<Ex>>,
}

/// Solves `A Z = B` on expressions, by elimination in the plan's order: one division per pivot, no
/// square roots.
pub fn eliminate(g: &mut Graph, matrix: &[Vec<Ex>], rhs: &[Vec<Ex>], plan: &Plan) -> Eliminated {
    let sides = rhs.first().map_or(0, Vec::len);
    let columns = matrix.first().map_or(0, Vec::len);
    let mut a = matrix.to_vec();
    let mut b = rhs.to_vec();
    let mut rows: Vec<usize> = plan.pivots.iter().map(|p| p.0).collect();
    let mut inverses = Vec::new();
    let mut pivots = Vec::new();
    for (k, &(r, c, size)) in plan.pivots.iter().enumerate() {
        rows.retain(|&i| i != r);
        let pivot = a[r][c];
        g.name(pivot, || format!("pivot_{}", k + 1));
        // a plan never chooses a pivot that is identically zero
        let inverse = g.div(Ex::ONE, pivot).unwrap_or(Ex::ZERO);
        g.name(inverse, || format!("inv_pivot_{}", k + 1));
        inverses.push(inverse);
        pivots.push((pivot, size));
        for &i in &rows {
            if a[i][c].is_zero() {
                continue;
            }
            let factor = g.mul(a[i][c], inverse);
            for &(_, j, _) in &plan.pivots[k + 1..] {
                let product = g.mul(factor, a[r][j]);
                a[i][j] = g.sub(a[i][j], product);
            }
            let pivot_side = b[r].clone();
            for (entry, from) in b[i].iter_mut().zip(pivot_side) {
                let product = g.mul(factor, from);
                *entry = g.sub(*entry, product);
            }
        }
    }
    let mut solution = vec![vec![Ex::ZERO; sides]; columns];
    for (k, &(r, c, _)) in plan.pivots.iter().enumerate().rev() {
        for s in 0..sides {
            let mut value = b[r][s];
            for &(_, j, _) in &plan.pivots[k + 1..] {
                let product = g.mul(a[r][j], solution[j][s]);
                value = g.sub(value, product);
            }
            solution[c][s] = g.mul(value, inverses[k]);
        }
    }
    let left = rows.into_iter().map(|i| b[i].clone()).collect();
    Eliminated {
        solution,
        pivots,
        left,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// The plan from these samples of a matrix whose entries may all vary.
    fn planned(samples: &[[[f64; 2]; 2]]) -> Plan {
        let structure = vec![vec![Some(false); 2]; 2];
        let samples: Vec<Vec<Vec<f64>>> = samples
            .iter()
            .map(|rows| rows.iter().map(|row| row.to_vec()).collect())
            .collect();
        plan(&structure, &samples).unwrap()
    }

    #[test]
    fn pivots_that_are_small_or_change_their_sign_are_counted() {
        let steady = planned(&[[[2.0, 0.1], [0.1, 1.0]], [[1.5, -0.1], [0.1, 2.0]]]);
        assert_eq!(steady.unfit, 0);
        // the second pivot changes its sign between the samples
        let turning = planned(&[[[2.0, 0.0], [0.0, 1.0]], [[2.0, 0.0], [0.0, -1.0]]]);
        assert_eq!(turning.unfit, 1);
        // both pivots change their sign
        let both = planned(&[[[2.0, 0.0], [0.0, 1.0]], [[-2.0, 0.0], [0.0, -1.0]]]);
        assert_eq!(both.unfit, 2);
        // each entry of the first column is small at one of the samples
        let small = planned(&[[[1.0, 0.0], [0.01, 1.0]], [[0.01, 1.0], [1.0, 0.0]]]);
        assert!(small.unfit >= 1);
    }
}
