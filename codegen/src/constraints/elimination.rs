//! Gaussian elimination of A_e in a fixed order of pivots, chosen once over sampled states of the
//! closed mechanism and then carried out on expressions.
//!
//! The order is a compromise between few operations (Markowitz's count of the fill-in) and accuracy
//! over the workspace. For the choice, each row is divided by its largest entry over all samples,
//! so that rows in metres and in radians compare. A pivot is acceptable if at every sampled state
//! it is at least a tenth of the largest remaining entry in its column, so that no multiplier of
//! scaled rows exceeds ten there, and if it has the same sign at all of them. If no entry is
//! acceptable, the one with the largest ratio is taken; [`Plan::poor_pivots`] counts these.

use crate::sym::{Ex, Graph};

/// Smallest ratio of an acceptable pivot to its column's largest entry, both in scaled rows, at all
/// samples.
const MIN_PIVOT_FRACTION: f64 = 0.1;
/// Factor on the ratio of a pivot that changes its sign among the samples: it vanishes somewhere
/// between them, so that it is not acceptable.
const SIGN_CHANGE_FACTOR: f64 = 0.01;
/// An entry below this fraction of its row's scale counts as zero and is never a pivot.
const ZERO_PIVOT: f64 = 1e-9;

/// An entry of a matrix of expressions, as [`plan`] distinguishes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Entry {
    /// The entry is identically zero.
    Zero,
    /// The entry is a number other than zero: a pivot whose division costs nothing.
    Constant,
    /// The entry depends on the coordinates.
    Varying,
}

/// A pivot of a [`Plan`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pivot {
    /// The pivot's row.
    pub row: usize,
    /// The pivot's column.
    pub column: usize,
    /// The median, over the samples, of the pivot's absolute value at its turn in the elimination.
    pub median_size: f64,
}

/// A fixed order of pivots for an elimination.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The pivots, in order; one for each column.
    pub pivots: Vec<Pivot>,
    /// The rows without a pivot. In A_e with all closure equations they are redundant: the other
    /// rows imply them wherever the mechanism moves.
    pub redundant_rows: Vec<usize>,
    /// Number of pivots that are not acceptable, because they are small or change their sign among
    /// the samples: at some states the system must be solved with another order.
    pub poor_pivots: usize,
}

/// A possible next pivot.
#[derive(Clone, Copy)]
struct Candidate {
    /// Whether `pivot_ratio` is at least [`MIN_PIVOT_FRACTION`].
    acceptable: bool,
    /// Markowitz's bound on the number of entries that become nonzero.
    fill_in: usize,
    /// Whether the entry is a constant.
    constant: bool,
    /// See [`pivot_ratio`].
    pivot_ratio: f64,
    row: usize,
    column: usize,
}

/// Chooses the order of pivots for a matrix, rows by columns. `structure` classifies its entries;
/// `samples` are its values at sampled states. `None` if the columns are linearly dependent.
pub fn plan(structure: &[Vec<Entry>], samples: &[Vec<Vec<f64>>]) -> Option<Plan> {
    let rows = structure.len();
    let columns = structure.first().map_or(0, Vec::len);
    let mut filled: Vec<Vec<bool>> = structure
        .iter()
        .map(|row| row.iter().map(|e| *e != Entry::Zero).collect())
        .collect();
    let mut constant: Vec<Vec<bool>> = structure
        .iter()
        .map(|row| row.iter().map(|e| *e == Entry::Constant).collect())
        .collect();
    // one scale per row for all samples, so that rows in metres and in radians compare
    let scale: Vec<f64> = (0..rows)
        .map(|i| {
            let entries = samples.iter().flat_map(|s| &s[i]);
            entries.fold(0.0_f64, |m, x| m.max(x.abs()))
        })
        .collect();
    // redundant rows may contain nothing but rounding errors, which must not be scaled up
    let largest_scale = scale.iter().fold(f64::MIN_POSITIVE, |m: f64, x| m.max(*x));
    let scale: Vec<f64> = scale
        .iter()
        .map(|s| s.max(largest_scale / 1024.0))
        .collect();
    let mut work = samples.to_vec();
    let mut free_rows = (0..rows).collect::<Vec<_>>();
    let mut free_columns = (0..columns).collect::<Vec<_>>();
    let mut pivots = Vec::new();
    let mut poor_pivots = 0;
    while !free_columns.is_empty() {
        let mut best: Option<Candidate> = None;
        let entries_in_rows: Vec<usize> = filled
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
                let pivot_ratio = pivot_ratio(&work, scale[r], &largest, r, c);
                if pivot_ratio <= 0.0 {
                    continue;
                }
                let candidate = Candidate {
                    acceptable: pivot_ratio >= MIN_PIVOT_FRACTION,
                    fill_in: (entries_in_rows[r] - 1) * (in_column.len() - 1),
                    constant: constant[r][c],
                    pivot_ratio,
                    row: r,
                    column: c,
                };
                if best.is_none_or(|b| is_better(&candidate, &b)) {
                    best = Some(candidate);
                }
            }
        }
        let Candidate {
            acceptable,
            row: r,
            column: c,
            ..
        } = best?;
        poor_pivots += usize::from(!acceptable);
        let mut sizes: Vec<f64> = work.iter().map(|s| s[r][c].abs()).collect();
        sizes.sort_by(f64::total_cmp);
        pivots.push(Pivot {
            row: r,
            column: c,
            median_size: sizes[sizes.len() / 2],
        });
        free_rows.retain(|&i| i != r);
        free_columns.retain(|&j| j != c);
        // the structure of the remaining rows after this step
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
        // the same step on the samples
        for sample in &mut work {
            let pivot_row = sample[r].clone();
            for &i in free_rows.iter().filter(|&&i| filled[i][c]) {
                let factor = sample[i][c] / pivot_row[c];
                for &j in free_columns.iter().filter(|&&j| filled[r][j]) {
                    sample[i][j] -= factor * pivot_row[j];
                }
            }
        }
    }
    Some(Plan {
        pivots,
        redundant_rows: free_rows,
        poor_pivots,
    })
}

/// The smallest ratio, over the samples, of the entry in row `r` and column `c` to the largest
/// remaining entry of its column, both in scaled rows; 0 if the entry vanishes at a sample. An
/// entry with both signs vanishes somewhere between the samples: its ratio is multiplied by
/// [`SIGN_CHANGE_FACTOR`], so that it is a pivot only if there is no other.
fn pivot_ratio(work: &[Vec<Vec<f64>>], scale: f64, largest: &[f64], r: usize, c: usize) -> f64 {
    let ratios = work.iter().zip(largest).map(|(sample, largest)| {
        let size = sample[r][c].abs() / scale;
        if size < ZERO_PIVOT {
            return 0.0;
        }
        size / largest
    });
    let smallest = ratios.fold(f64::INFINITY, f64::min);
    let positive = work.iter().filter(|s| s[r][c] > 0.0).count();
    let one_sign = positive == 0 || positive == work.len();
    match smallest.is_finite() {
        true if one_sign => smallest,
        true => smallest * SIGN_CHANGE_FACTOR,
        false => 0.0,
    }
}

/// Whether candidate `a` is a better pivot than `b`. Acceptable pivots come first; among them those
/// with less fill-in, then constants, then the larger; among unacceptable ones the largest.
fn is_better(a: &Candidate, b: &Candidate) -> bool {
    if a.acceptable != b.acceptable {
        return a.acceptable;
    }
    if !a.acceptable {
        return a.pivot_ratio > b.pivot_ratio;
    }
    if a.fill_in != b.fill_in {
        return a.fill_in < b.fill_in;
    }
    if a.constant != b.constant {
        return a.constant;
    }
    // the earlier candidate `b` stays unless `a` is clearly larger
    a.pivot_ratio > 1.25 * b.pivot_ratio
}

/// Classifies the entries of a matrix of expressions for [`plan`].
pub fn structure(g: &Graph, matrix: &[Vec<Ex>]) -> Vec<Vec<Entry>> {
    let entry = |e: &Ex| {
        if e.is_zero() {
            Entry::Zero
        } else if g.value(*e).is_some() {
            Entry::Constant
        } else {
            Entry::Varying
        }
    };
    matrix
        .iter()
        .map(|row| row.iter().map(entry).collect())
        .collect()
}

/// The result of an elimination.
#[derive(Clone, Debug)]
pub struct Eliminated {
    /// The solution Z, unknowns by right-hand sides.
    pub solution: Vec<Vec<Ex>>,
    /// The pivots, each with its [`Pivot::median_size`].
    pub pivots: Vec<(Ex, f64)>,
}

/// Solves `A Z = B` on expressions, by elimination in the plan's order: one division per pivot, no
/// square roots. The redundant rows of A and B are not used.
///
/// `matrix` is A, equations by unknowns; `rhs` is B, equations by right-hand sides.
pub fn eliminate(g: &mut Graph, matrix: &[Vec<Ex>], rhs: &[Vec<Ex>], plan: &Plan) -> Eliminated {
    let rhs_count = rhs.first().map_or(0, Vec::len);
    let columns = matrix.first().map_or(0, Vec::len);
    let mut a = matrix.to_vec();
    let mut b = rhs.to_vec();
    // the rows whose pivots are still to come
    let mut rows: Vec<usize> = plan.pivots.iter().map(|p| p.row).collect();
    let mut inverses = Vec::new();
    let mut pivots = Vec::new();
    for (k, planned) in plan.pivots.iter().enumerate() {
        let (r, c) = (planned.row, planned.column);
        rows.retain(|&i| i != r);
        let pivot = a[r][c];
        g.name(pivot, || format!("pivot_{}", k + 1));
        // a plan never chooses a pivot that is identically zero
        let inverse = g.div(Ex::ONE, pivot).unwrap_or(Ex::ZERO);
        g.name(inverse, || format!("inv_pivot_{}", k + 1));
        inverses.push(inverse);
        pivots.push((pivot, planned.median_size));
        for &i in &rows {
            if a[i][c].is_zero() {
                continue;
            }
            let factor = g.mul(a[i][c], inverse);
            for j in plan.pivots[k + 1..].iter().map(|p| p.column) {
                let product = g.mul(factor, a[r][j]);
                a[i][j] = g.sub(a[i][j], product);
            }
            let pivot_rhs = b[r].clone();
            for (entry, from) in b[i].iter_mut().zip(pivot_rhs) {
                let product = g.mul(factor, from);
                *entry = g.sub(*entry, product);
            }
        }
    }
    // back substitution
    let mut solution = vec![vec![Ex::ZERO; rhs_count]; columns];
    for (k, planned) in plan.pivots.iter().enumerate().rev() {
        let (r, c) = (planned.row, planned.column);
        for s in 0..rhs_count {
            let mut value = b[r][s];
            for j in plan.pivots[k + 1..].iter().map(|p| p.column) {
                let product = g.mul(a[r][j], solution[j][s]);
                value = g.sub(value, product);
            }
            solution[c][s] = g.mul(value, inverses[k]);
        }
    }
    Eliminated { solution, pivots }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// The plan from these samples of a matrix whose entries may all vary.
    fn planned(samples: &[[[f64; 2]; 2]]) -> Plan {
        let structure = vec![vec![Entry::Varying; 2]; 2];
        let samples: Vec<Vec<Vec<f64>>> = samples
            .iter()
            .map(|rows| rows.iter().map(|row| row.to_vec()).collect())
            .collect();
        plan(&structure, &samples).unwrap()
    }

    #[test]
    fn pivots_that_are_small_or_change_their_sign_are_counted() {
        let steady = planned(&[[[2.0, 0.1], [0.1, 1.0]], [[1.5, -0.1], [0.1, 2.0]]]);
        assert_eq!(steady.poor_pivots, 0);
        // the second pivot changes its sign between the samples
        let turning = planned(&[[[2.0, 0.0], [0.0, 1.0]], [[2.0, 0.0], [0.0, -1.0]]]);
        assert_eq!(turning.poor_pivots, 1);
        // both pivots change their sign
        let both = planned(&[[[2.0, 0.0], [0.0, 1.0]], [[-2.0, 0.0], [0.0, -1.0]]]);
        assert_eq!(both.poor_pivots, 2);
        // each entry of the first column is small at one of the samples
        let small = planned(&[[[1.0, 0.0], [0.01, 1.0]], [[0.01, 1.0], [1.0, 0.0]]]);
        assert!(small.poor_pivots >= 1);
    }
}
