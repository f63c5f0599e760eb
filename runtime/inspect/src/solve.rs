//! Linear regressions of many right-hand sides on the same columns.

use nalgebra::DMatrix;

/// The ridge term on the diagonal of the scaled normal equations: columns that depend on each other
/// then share what they explain, rather than make the equations singular.
const RIDGE: f64 = 1e-8;

/// The normal equations of some columns about their means, scaled to columns of unit rms; the first
/// column is 1.
#[derive(Clone, Debug)]
pub(crate) struct Normal {
    gram: DMatrix<f64>,
    inverse: DMatrix<f64>,
    means: Vec<f64>,
    /// The rms about the means; 0 of columns that do not change.
    scales: Vec<f64>,
}

/// The solution for one right-hand side.
#[derive(Clone, Debug)]
pub(crate) struct Solved {
    /// The solution for the scaled columns.
    values: Vec<f64>,
    /// The products of the scaled columns with the right-hand side.
    side: Vec<f64>,
    /// The mean of the right-hand side.
    mean: f64,
    /// The variance of the right-hand side.
    variance: f64,
    /// The variance that the columns do not explain.
    left: f64,
}

impl Solved {
    /// The part of the variance that the columns explain, from 0 to 1.
    pub(crate) fn explained(&self) -> f64 {
        if self.variance > 0.0 {
            1.0 - self.left / self.variance
        } else {
            0.0
        }
    }

    /// The factor of a column in units of its rms.
    pub(crate) fn scaled(&self, column: usize) -> f64 {
        self.values.get(column).copied().unwrap_or(0.0)
    }
}

impl Normal {
    /// The normal equations of these rows of `width` columns; `None` without rows, or if the
    /// equations cannot be solved.
    pub(crate) fn new<'r>(
        width: usize,
        rows: impl Iterator<Item = &'r Vec<f64>> + Clone,
    ) -> Option<Self> {
        let mut means = vec![0.0; width];
        let mut count = 0.0;
        for row in rows.clone() {
            count += 1.0;
            for (mean, x) in means.iter_mut().zip(row) {
                *mean += x;
            }
        }
        if count == 0.0 {
            return None;
        }
        for mean in &mut means {
            *mean /= count;
        }
        let mut gram = DMatrix::<f64>::zeros(width, width);
        let mut off = vec![0.0; width];
        for row in rows {
            for (o, (x, mean)) in off.iter_mut().zip(row.iter().zip(&means)) {
                *o = x - mean;
            }
            for (j, x) in off.iter().enumerate() {
                for (i, y) in off.iter().enumerate().take(j + 1) {
                    gram[(i, j)] += x * y;
                }
            }
        }
        let scales: Vec<f64> = (0..width)
            .map(|k| {
                let rms = (gram[(k, k)] / count).sqrt();
                // a smaller rms is rounding of a constant column
                if rms > 1e-9 * means[k].abs() {
                    rms
                } else {
                    0.0
                }
            })
            .collect();
        for j in 0..width {
            for i in 0..=j {
                let scale = scales[i] * scales[j] * count;
                let value = if scale > 0.0 {
                    gram[(i, j)] / scale
                } else {
                    0.0
                };
                gram[(i, j)] = value;
                gram[(j, i)] = value;
            }
            gram[(j, j)] = if scales[j] > 0.0 {
                gram[(j, j)] + RIDGE
            } else {
                1.0
            };
        }
        let inverse = gram.clone().cholesky()?.inverse();
        Some(Self {
            gram,
            inverse,
            means,
            scales,
        })
    }

    /// An entry of a row relative to its column's mean, in units of the column's rms.
    fn scaled(&self, row: &[f64], column: usize) -> f64 {
        if self.scales[column] > 0.0 {
            (row[column] - self.means[column]) / self.scales[column]
        } else {
            0.0
        }
    }

    /// Solves for a right-hand side, given with the rows that the equations were made from.
    pub(crate) fn solve<'r>(
        &self,
        rows: impl Iterator<Item = &'r Vec<f64>>,
        values: impl Iterator<Item = &'r f64> + Clone,
    ) -> Solved {
        let (mut sum, mut count) = (0.0, 0.0);
        for value in values.clone() {
            sum += value;
            count += 1.0;
        }
        let mean = sum / f64::max(count, 1.0);
        let width = self.means.len();
        let mut side = vec![0.0; width];
        let mut variance = 0.0;
        for (row, value) in rows.zip(values) {
            let y = value - mean;
            variance += y * y;
            for (k, s) in side.iter_mut().enumerate() {
                *s += self.scaled(row, k) * y;
            }
        }
        let n = f64::max(count, 1.0);
        variance /= n;
        for s in &mut side {
            *s /= n;
        }
        let value = |k: usize| (0..width).map(|i| self.inverse[(k, i)] * side[i]).sum();
        let found: Vec<f64> = (0..width).map(value).collect();
        let explained: f64 = found.iter().zip(&side).map(|(x, s)| x * s).sum();
        Solved {
            left: (variance - explained).max(0.0),
            values: found,
            side,
            mean,
            variance,
        }
    }

    /// The value that a solution predicts for a row.
    pub(crate) fn predict(&self, solved: &Solved, row: &[f64]) -> f64 {
        let parts = solved.values.iter().enumerate();
        solved.mean + parts.map(|(k, x)| x * self.scaled(row, k)).sum::<f64>()
    }

    /// The correlation of what some columns contribute to a fit with one of them, both less what the
    /// fit's other columns explain of them. Of the candidates, that column is taken of which most is
    /// left: a column that others nearly make up may have any factor.
    ///
    /// - `fitted`: the columns of the fit, all others are left out; `columns`, `candidates`: some of
    ///   them.
    ///
    /// Returns 0 where this is not defined.
    pub(crate) fn own_correlation(
        &self,
        solved: &Solved,
        fitted: &[usize],
        columns: &[usize],
        candidates: &[usize],
    ) -> f64 {
        let (n, m) = (fitted.len(), columns.len());
        let gram = DMatrix::from_fn(n, n, |i, j| self.gram[(fitted[i], fitted[j])]);
        let Some(inverse) = gram.cholesky().map(|c| c.inverse()) else {
            return 0.0;
        };
        let places: Option<Vec<usize>> = columns
            .iter()
            .map(|k| fitted.iter().position(|own| own == k))
            .collect();
        let Some(places) = places else {
            return 0.0;
        };
        let factors = places.iter().map(|place| {
            let sides = fitted.iter().enumerate();
            sides
                .map(|(i, k)| inverse[(*place, i)] * solved.side[*k])
                .sum::<f64>()
        });
        let factors = DMatrix::from_iterator(m, 1, factors);
        // the products of what the other columns leave of these
        let block = DMatrix::from_fn(m, m, |i, j| inverse[(places[i], places[j])]);
        let Some(left) = block.cholesky().map(|c| c.inverse()) else {
            return 0.0;
        };
        let own = (0..m).filter(|k| candidates.contains(&columns[*k]));
        let most = own.max_by(|a, b| left[(*a, *a)].total_cmp(&left[(*b, *b)]));
        let products = &left * &factors;
        let square = products.dot(&factors);
        match most {
            Some(k) if square > 0.0 && left[(k, k)] > 0.0 => {
                products[(k, 0)] / (square * left[(k, k)]).sqrt()
            }
            _ => 0.0,
        }
    }

    /// The increase of the unexplained part of the variance if these columns are left out and the
    /// others are fitted again.
    pub(crate) fn share(&self, solved: &Solved, columns: &[usize]) -> f64 {
        let m = columns.len();
        let block = DMatrix::from_fn(m, m, |i, j| self.inverse[(columns[i], columns[j])]);
        let values: Vec<f64> = columns.iter().map(|k| solved.scaled(*k)).collect();
        let side = DMatrix::from_column_slice(m, 1, &values);
        let Some(solution) = block.cholesky().map(|c| c.solve(&side)) else {
            return 0.0;
        };
        let more: f64 = solution.iter().zip(&values).map(|(a, b)| a * b).sum();
        if solved.variance > 0.0 {
            more / solved.variance
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_of_a_column_is_what_is_left_without_it() {
        let mut noise = crate::testing::Noise::new(1);
        let rows: Vec<Vec<f64>> = (0..4000)
            .map(|_| vec![1.0, noise.normal(), noise.normal(), 5.0])
            .collect();
        let values: Vec<f64> = rows.iter().map(|r| 2.0 + 3.0 * r[1] - r[2]).collect();
        let normal = Normal::new(4, rows.iter()).unwrap();
        let solved = normal.solve(rows.iter(), values.iter());
        assert!((solved.explained() - 1.0).abs() < 1e-6);
        assert!((normal.share(&solved, &[1]) - 0.9).abs() < 0.02);
        assert!((normal.share(&solved, &[2]) - 0.1).abs() < 0.02);
        let all = [0, 1, 2, 3];
        assert!(normal.own_correlation(&solved, &all, &[2], &[2]) < -0.99);
        let found = normal.own_correlation(&solved, &all, &[1, 2], &[1]);
        assert!((found - 0.9_f64.sqrt()).abs() < 0.02);
        assert!(solved.scaled(2) < 0.0 && normal.share(&solved, &[3]).abs() < 1e-12);
        // without the other column its part is noise
        let found = normal.own_correlation(&solved, &[0, 2], &[2], &[2]);
        assert!(found < -0.99, "{found}");
        assert!((normal.predict(&solved, &rows[7]) - values[7]).abs() < 1e-6);
    }

    /// The second column is the first one and little noise, the third one has what both lack.
    #[test]
    fn the_column_that_others_do_not_make_up_decides() {
        let mut noise = crate::testing::Noise::new(2);
        let rows: Vec<Vec<f64>> = (0..4000)
            .map(|_| {
                let [a, b] = [noise.normal(), noise.normal()];
                vec![1.0, a, a + 1e-3 * noise.normal(), b]
            })
            .collect();
        // an error that looks like the difference of the first two
        let values: Vec<f64> = rows
            .iter()
            .map(|r| r[2] + 0.5 * r[3] - 300.0 * (r[2] - r[1]))
            .collect();
        let normal = Normal::new(4, rows.iter()).unwrap();
        let solved = normal.solve(rows.iter(), values.iter());
        assert!(solved.scaled(2) < -100.0);
        let all = [0, 1, 2, 3];
        let found =
            |candidates: &[usize]| normal.own_correlation(&solved, &all, &[2, 3], candidates);
        assert!(found(&[2]) < 0.0 && found(&[3]) > 0.8, "{}", found(&[3]));
        assert!((found(&[2, 3]) - found(&[3])).abs() < 1e-12);
        assert!(normal.own_correlation(&solved, &[0, 1], &[2], &[2]).abs() < 1e-12);
    }
}
