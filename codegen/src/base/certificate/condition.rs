//! The condition number of the sampled rows in the kept columns.

use std::collections::BTreeMap;

use super::rank::Samples;
use super::rows_in_motion;
use super::sparse::Row;
use crate::model::Model;

/// Larger conditions cannot be computed from scalar products in double precision, whose condition
/// is the square.
const MAX_CONDITION: f64 = 1e7;
/// If the condition is above this, the rows of the regressor in motion are added.
const POOR_CONDITION: f64 = 1000.0;
/// The number of states of these rows.
const FURTHER_STATES: usize = 56;
/// The largest number of steps of a power iteration.
const MAX_STEPS: usize = 1000;
/// The relative change of the eigenvalue at which a power iteration ends.
const MIN_CHANGE: f64 = 1e-7;

/// The condition of the kept columns of a mechanism, see [`Samples::condition_of_groups`].
///
/// The certificate samples energies at about eight states. They suffice for the rank, but a column that
/// acts weakly in all of them makes the condition poor whatever is kept, and what acts by centrifugal
/// and Coriolis forces shows in no mass matrix of one state alone. If the condition is poor, the rows of
/// W at random motions through further states count too, which a random walk from home with this
/// seed visits.
pub(in crate::base) fn condition_of_kept(
    samples: &Samples,
    model: &Model,
    (home, seed): (&[f64], u64),
    is_kept: &dyn Fn(&usize) -> bool,
    replaced: &[(usize, usize, f64)],
) -> f64 {
    let found = samples.condition_of_groups(model, is_kept, replaced);
    if found <= POOR_CONDITION {
        return found;
    }
    rows_in_motion(model, home, seed, FURTHER_STATES).map_or(found, |further| {
        samples.with_further(model, is_kept, replaced, &further)
    })
}

impl Samples {
    /// As [`condition`](Self::condition), for the kept columns of a mechanism; if its columns form
    /// several groups (payloads), the largest condition of a group.
    ///
    /// - `replaced`: the parameters that combinations of others replace; for each of these others,
    ///   the column of the replaced parameter, the other's column, and the factor in SI units by
    ///   which the first column is added to the second.
    pub(in crate::base) fn condition_of_groups(
        &self,
        model: &Model,
        is_kept: &dyn Fn(&usize) -> bool,
        replaced: &[(usize, usize, f64)],
    ) -> f64 {
        self.with_further(model, is_kept, replaced, &[])
    }

    /// As [`condition_of_groups`](Self::condition_of_groups), with rows besides those of the samples.
    fn with_further(
        &self,
        model: &Model,
        is_kept: &dyn Fn(&usize) -> bool,
        replaced: &[(usize, usize, f64)],
        further: &[Row],
    ) -> f64 {
        let groups = model.column_groups().into_iter();
        let kept = |group: Vec<usize>| group.into_iter().filter(is_kept).collect::<Vec<_>>();
        groups
            .map(|group| self.condition(&kept(group), replaced, further))
            .fold(1.0, f64::max)
    }

    /// The condition of the sampled rows in some columns, each column scaled to length 1: the
    /// largest singular value divided by the smallest. Infinite if it is above 1e7.
    fn condition(
        &self,
        columns: &[usize],
        replaced: &[(usize, usize, f64)],
        further: &[Row],
    ) -> f64 {
        let Some(factor) = cholesky(self.products(columns, replaced, further)) else {
            return f64::INFINITY;
        };
        let n = columns.len();
        let largest = power(n, |x| times(&factor, &times_transposed(&factor, x)));
        let least = power(n, |x| backward(&factor, &forward(&factor, x)));
        let condition = libm::sqrt(largest * least);
        if condition < MAX_CONDITION {
            condition.max(1.0)
        } else {
            f64::INFINITY
        }
    }

    /// The scalar products of the columns, each scaled to length 1.
    fn products(
        &self,
        columns: &[usize],
        replaced: &[(usize, usize, f64)],
        further: &[Row],
    ) -> Vec<Vec<f64>> {
        let n = columns.len();
        // for each column of the rows, the kept columns that contain it
        let mut parts: BTreeMap<usize, Vec<(usize, f64)>> = BTreeMap::new();
        for (place, c) in columns.iter().enumerate() {
            parts.entry(*c).or_default().push((place, 1.0));
            for (from, _, factor) in replaced.iter().filter(|(_, to, _)| to == c) {
                let factor = factor * self.scale_between(*from, *c);
                parts.entry(*from).or_default().push((place, factor));
            }
        }
        let mut sums = vec![vec![0.0; n]; n];
        for row in self.rows().iter().chain(further) {
            let mut own: BTreeMap<usize, f64> = BTreeMap::new();
            for (c, x) in row.entries() {
                for (place, factor) in parts.get(&c).into_iter().flatten() {
                    *own.entry(*place).or_default() += factor * x.to_f64();
                }
            }
            let entries: Vec<(usize, f64)> = own.into_iter().collect();
            for &(i, x) in &entries {
                for &(j, y) in &entries {
                    sums[i][j] += x * y;
                }
            }
        }
        let lengths: Vec<f64> = (0..n).map(|i| libm::sqrt(sums[i][i])).collect();
        for (i, row) in sums.iter_mut().enumerate() {
            for (x, length) in row.iter_mut().zip(&lengths) {
                *x /= lengths[i] * length;
            }
        }
        sums
    }
}

/// The lower triangle L with `L L^T` equal to a symmetric matrix; `None` if it is not positive
/// definite.
fn cholesky(mut a: Vec<Vec<f64>>) -> Option<Vec<Vec<f64>>> {
    for i in 0..a.len() {
        for j in 0..=i {
            let sum: f64 = a[i][..j].iter().zip(&a[j]).map(|(x, y)| x * y).sum();
            let rest = a[i][j] - sum;
            if i > j {
                a[i][j] = rest / a[j][j];
            } else if rest > 0.0 {
                a[i][i] = libm::sqrt(rest);
            } else {
                return None;
            }
        }
    }
    Some(a)
}

fn times(l: &[Vec<f64>], x: &[f64]) -> Vec<f64> {
    let rows = l.iter().enumerate();
    rows.map(|(i, row)| row[..=i].iter().zip(x).map(|(l, x)| l * x).sum())
        .collect()
}

fn times_transposed(l: &[Vec<f64>], x: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; x.len()];
    for (i, (row, x)) in l.iter().zip(x).enumerate() {
        for (y, l) in y.iter_mut().zip(&row[..=i]) {
            *y += l * x;
        }
    }
    y
}

fn forward(l: &[Vec<f64>], b: &[f64]) -> Vec<f64> {
    let mut x: Vec<f64> = Vec::with_capacity(b.len());
    for (i, row) in l.iter().enumerate() {
        let sum: f64 = row[..i].iter().zip(&x).map(|(l, x)| l * x).sum();
        x.push((b[i] - sum) / row[i]);
    }
    x
}

fn backward(l: &[Vec<f64>], b: &[f64]) -> Vec<f64> {
    let mut x = b.to_vec();
    for i in (0..l.len()).rev() {
        x[i] /= l[i][i];
        let at = x[i];
        for (x, l) in x.iter_mut().zip(&l[i][..i]) {
            *x -= l * at;
        }
    }
    x
}

/// The largest eigenvalue of a symmetric positive definite operator, by power iteration from a start
/// that no symmetry of the columns makes orthogonal to the eigenvector.
fn power(n: usize, apply: impl Fn(&[f64]) -> Vec<f64>) -> f64 {
    let mut x: Vec<f64> = (0..n).map(|i| 1.0 + (i % 7) as f64 / 7.0).collect();
    let mut value = 1.0;
    for _ in 0..MAX_STEPS {
        let size = length(&x);
        x = apply(&x.iter().map(|x| x / size).collect::<Vec<_>>());
        let before = value;
        value = length(&x);
        if (value - before).abs() <= MIN_CHANGE * value {
            break;
        }
    }
    value
}

fn length(x: &[f64]) -> f64 {
    libm::sqrt(x.iter().map(|x| x * x).sum())
}

#[cfg(test)]
mod tests {
    use super::super::float320::Float320;
    use super::super::sparse::Row;
    use super::*;

    fn samples<const N: usize>(rows: &[[f64; N]]) -> Samples {
        let rows = rows.iter().map(|row| Row::of(row.map(Float320::from_f64)));
        Samples::new(rows.collect(), vec![0; N], 1)
    }

    #[test]
    fn the_condition_does_not_depend_on_the_columns_lengths() {
        // orthogonal columns of any length
        assert!(
            (samples(&[[3.0, 0.0], [0.0, 1e-4]]).condition(&[0, 1], &[], &[]) - 1.0).abs() < 1e-9
        );
        // columns at an angle of 2 atan(1/3): the condition is the cotangent of its half
        let found = samples(&[[3.0, 3.0], [1.0, -1.0]]).condition(&[0, 1], &[], &[]);
        assert!((found - 3.0).abs() < 1e-9, "{found}");
        assert!(
            samples(&[[1.0, 1.0], [1.0, 1.0]])
                .condition(&[0, 1], &[], &[])
                .is_infinite()
        );
    }

    /// Two columns that differ in one row of the samples differ in more of the further ones.
    #[test]
    fn rows_of_further_states_count() {
        let samples = samples(&[[3.0, 3.0], [1.0, -1.0]]);
        let further = vec![Row::of([1.0, -1.0].map(Float320::from_f64)); 8];
        // the products of the columns are 9 + 9 and 9 - 9
        let found = samples.condition(&[0, 1], &[], &further);
        assert!((found - 1.0).abs() < 1e-9, "{found}");
    }

    /// The second parameter is replaced by the first one, so that its column is added to the first.
    #[test]
    fn the_column_of_a_replaced_parameter_is_added_to_that_of_the_other() {
        let samples = samples(&[[3.0, 0.0, 3.0], [1.0, -2.0, 1.0]]);
        assert!(samples.condition(&[0, 2], &[], &[]).is_infinite());
        let found = samples.condition(&[0, 2], &[(1, 0, 1.0)], &[]);
        assert!((found - 3.0).abs() < 1e-9, "{found}");
    }
}
