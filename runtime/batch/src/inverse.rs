//! The inverse of A's dependent columns at one state, to which those of other states are compared.

use pulp::Arch;

/// The most that A may change, as the largest row sum of `A^-1 B - 1`: half of the distance at which
/// B could be singular.
pub(super) const MAX_CHANGE: f64 = 0.5;
/// A pivot below this part of the largest is too near a singularity: rounding errors of the inverse
/// would decide there. Such states are solved one by one, with a condition number.
const MIN_PIVOT_RATIO: f64 = 1e-4;

/// The inverse of as many rows of A's dependent columns as there are dependent coordinates: those
/// that pivoting selects. Rows and columns are divided by their largest entries.
#[derive(Clone, Debug)]
pub(super) struct Reference {
    /// The number of dependent coordinates.
    size: usize,
    /// The number of all coordinates.
    columns: usize,
    dependent: Vec<usize>,
    /// The selected rows of A.
    rows: Vec<usize>,
    /// The factor on each selected row, and on each dependent column.
    row_scale: Vec<f64>,
    column_scale: Vec<f64>,
    /// The inverse of the scaled rows, row-major.
    inverse: Vec<f64>,
    /// Buffer for the scaled rows of another state, column by column.
    other: Vec<f64>,
}

impl Reference {
    /// Inverts the dependent columns of `a`, row-major with `columns` entries in each row; `None` if
    /// they are nearly singular or not finite.
    pub(super) fn new(a: &[f64], columns: usize, dependent: &[usize]) -> Option<Self> {
        let n = dependent.len();
        let reciprocal = |x: f64| if x > 0.0 { 1.0 / x } else { 1.0 };
        let all: Vec<Vec<f64>> = a
            .chunks_exact(columns.max(1))
            .map(|row| dependent.iter().map(|c| row[*c]).collect())
            .collect();
        let scales: Vec<f64> = all
            .iter()
            .map(|row| reciprocal(row.iter().fold(0.0, |m, x| largest(m, x.abs()))))
            .collect();
        let column_scale: Vec<f64> = (0..n)
            .map(|c| {
                let entries = all
                    .iter()
                    .zip(&scales)
                    .map(|(row, scale)| (row[c] * scale).abs());
                reciprocal(entries.fold(0.0, largest))
            })
            .collect();
        let mut remaining: Vec<(usize, Vec<f64>)> = all
            .iter()
            .enumerate()
            .map(|(at, row)| {
                let scaled = row
                    .iter()
                    .zip(&column_scale)
                    .map(|(x, c)| x * c * scales[at]);
                (at, scaled.collect())
            })
            .collect();
        let scaled = remaining.clone();
        // elimination selects the rows
        let mut rows = Vec::with_capacity(n);
        let mut pivots = Vec::with_capacity(n);
        for k in 0..n {
            let best = (0..remaining.len()).max_by(|i, j| {
                remaining[*i].1[k]
                    .abs()
                    .total_cmp(&remaining[*j].1[k].abs())
            })?;
            let (at, top) = remaining.swap_remove(best);
            rows.push(at);
            pivots.push(top[k].abs());
            for (_, row) in &mut remaining {
                let factor = row[k] / top[k];
                for (x, y) in row.iter_mut().zip(&top) {
                    *x -= factor * y;
                }
            }
        }
        let greatest = pivots.iter().copied().fold(0.0, largest);
        let regular = pivots
            .iter()
            .all(|p| *p >= MIN_PIVOT_RATIO * greatest && p.is_finite());
        if !regular {
            return None;
        }
        let chosen: Vec<Vec<f64>> = rows
            .iter()
            .filter_map(|at| scaled.get(*at).map(|row| row.1.clone()))
            .collect();
        let inverse = inverse_of(chosen)?;
        Some(Self {
            size: n,
            columns,
            dependent: dependent.to_vec(),
            row_scale: rows.iter().map(|at| scales[*at]).collect(),
            rows,
            column_scale,
            inverse,
            other: vec![0.0; n * n],
        })
    }

    /// How far A is from this one, as the largest row sum of `A^-1 B - 1`: below 1, every matrix
    /// between the two is regular.
    pub(super) fn change(&mut self, a: &[f64]) -> f64 {
        let n = self.size;
        for ((j, c), column) in self
            .dependent
            .iter()
            .enumerate()
            .zip(self.other.chunks_exact_mut(n))
        {
            let rows = self.rows.iter().zip(&self.row_scale);
            for (x, (row, scale)) in column.iter_mut().zip(rows) {
                *x = a[row * self.columns + c] * (scale * self.column_scale[j]);
            }
        }
        let mut worst = 0.0;
        for (i, row) in self.inverse.chunks_exact(n).enumerate() {
            let mut sum = 0.0;
            for (j, column) in self.other.chunks_exact(n).enumerate() {
                let unit = if i == j { -1.0 } else { 0.0 };
                let product = row.iter().zip(column).fold(unit, |sum, (x, y)| sum + x * y);
                sum += product.abs();
            }
            worst = largest(worst, sum);
        }
        worst
    }

    /// Whether A at each of `len` states is so near that every matrix between the two is regular.
    /// `a` has one series for each entry.
    pub(super) fn is_near(&self, a: &[f64], len: usize) -> Vec<bool> {
        let n = self.size;
        let mut worst = vec![0.0; len];
        let mut sums = vec![0.0; n * len];
        let mut entries = vec![0.0; n * len];
        Arch::new().dispatch(
            #[inline(always)]
            || {
                for (j, c) in self.dependent.iter().enumerate() {
                    // column j of the scaled matrix
                    for (k, row) in self.rows.iter().enumerate() {
                        let at = (row * self.columns + c) * len;
                        let scale = self.row_scale[k] * self.column_scale[j];
                        let own = a[at..at + len].iter();
                        for (slot, x) in entries[k * len..(k + 1) * len].iter_mut().zip(own) {
                            *slot = x * scale;
                        }
                    }
                    for i in 0..n {
                        let unit = if i == j { -1.0 } else { 0.0 };
                        let row = &self.inverse[i * n..(i + 1) * n];
                        add_products(unit, row, &entries, &mut sums[i * len..(i + 1) * len]);
                    }
                }
                for sums in sums.chunks_exact(len) {
                    for (worst, sum) in worst.iter_mut().zip(sums) {
                        *worst = largest(*worst, *sum);
                    }
                }
            },
        );
        worst
            .into_iter()
            .map(|change| change <= MAX_CHANGE)
            .collect()
    }
}

/// Adds to each sum the size of `unit` plus the product of the row with the state's column, whose
/// entries are series of as many states.
#[inline(always)]
fn add_products(unit: f64, row: &[f64], column: &[f64], sums: &mut [f64]) {
    /// States at a time, whose products stay in registers.
    const STATES: usize = 16;
    let len = sums.len();
    let (whole, rest) = sums.as_chunks_mut::<STATES>();
    let first = whole.len() * STATES;
    for (block, sums) in whole.iter_mut().enumerate() {
        let at = block * STATES;
        let mut products = [unit; STATES];
        for (factor, series) in row.iter().zip(column.chunks_exact(len)) {
            let Some(series) = series[at..].first_chunk::<STATES>() else {
                continue;
            };
            for (sum, x) in products.iter_mut().zip(series) {
                *sum += factor * x;
            }
        }
        for (sum, x) in sums.iter_mut().zip(&products) {
            *sum += x.abs();
        }
    }
    for (state, sum) in rest.iter_mut().enumerate() {
        let entries = column.iter().skip(first + state).step_by(len);
        let product = row.iter().zip(entries);
        *sum += product
            .fold(unit, |sum, (factor, x)| sum + factor * x)
            .abs();
    }
}

/// The larger of two sizes; NaN if one of them is.
#[inline(always)]
pub(super) fn largest(a: f64, b: f64) -> f64 {
    if b <= a || a.is_nan() { a } else { b }
}

/// The inverse of a square matrix by elimination with pivoting, row-major.
fn inverse_of(mut a: Vec<Vec<f64>>) -> Option<Vec<f64>> {
    let n = a.len();
    let mut b: Vec<Vec<f64>> = (0..n)
        .map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect())
        .collect();
    for k in 0..n {
        let best = (k..n).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs()))?;
        a.swap(k, best);
        b.swap(k, best);
        let pivot = a[k][k];
        if pivot == 0.0 {
            return None;
        }
        for row in [&mut a[k], &mut b[k]] {
            for x in row.iter_mut() {
                *x /= pivot;
            }
        }
        let (top, right) = (a[k].clone(), b[k].clone());
        for (i, (row, solved)) in a.iter_mut().zip(&mut b).enumerate() {
            let factor = row[k];
            if i == k {
                continue;
            }
            for (x, y) in row.iter_mut().zip(&top) {
                *x -= factor * y;
            }
            for (x, y) in solved.iter_mut().zip(&right) {
                *x -= factor * y;
            }
        }
    }
    Some(b.into_iter().flatten().collect())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn states_are_near_exactly_where_the_change_of_each_is_small() {
        // rows and columns of different sizes; the first column is not dependent
        let home = [9.0, 200.0, 3.0, 7.0, -10.0, 0.2];
        let mut reference = Reference::new(&home, 3, &[1, 2]).unwrap();
        let factors = [1.0, 1.2, 1.45, 1.55, 3.0, 0.6, 0.4, -1.0];
        let states: Vec<Vec<f64>> = factors
            .iter()
            .map(|factor| {
                let mut state = home.to_vec();
                state[1] *= factor;
                state
            })
            .collect();
        let series: Vec<f64> = (0..home.len())
            .flat_map(|entry| states.iter().map(move |state| state[entry]))
            .collect();
        let near = reference.is_near(&series, states.len());
        let one_by_one: Vec<bool> = states
            .iter()
            .map(|state| reference.change(state) <= MAX_CHANGE)
            .collect();
        assert_eq!(near, one_by_one);
        assert!(near[0] && !near[4]);
        let change = reference.change(&home);
        assert!(change < 1e-12, "{change}");
    }
}
