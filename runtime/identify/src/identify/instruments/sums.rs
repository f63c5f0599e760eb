//! Sums over equations with instruments, and the estimate from them.

use super::InstrumentedEquations;
use crate::estimate::{Accumulator, EstimateError, FactorSet, Origin, QrFactor};
use crate::qr_update::{reduce, substitute};

/// A pivot below this part of the largest means that the instruments do not determine the
/// parameters.
const MIN_PIVOT_RATIO: f64 = 1e-10;

/// Sums over all equations of a log, effort by effort.
pub(super) struct Sums {
    /// QR factors of W.
    pub(super) factors: FactorSet,
    /// `Z^T W`, r x r, entry (i, j) of z_i and w_j at `i * r + j`.
    products: Vec<Vec<f64>>,
    /// `Z^T tau`.
    sides: Vec<Vec<f64>>,
    /// The sum of squares of each instrument.
    squares: Vec<Vec<f64>>,
}

impl Sums {
    pub(super) fn of<E: InstrumentedEquations>(
        equations: &mut E,
        origin: &Origin,
    ) -> Result<Self, E::Error> {
        let (r, efforts) = (origin.labels.len(), origin.efforts.len());
        let mut accumulated = Accumulator::new(origin);
        let mut products = vec![vec![0.0; r * r]; efforts];
        let mut sides = vec![vec![0.0; r]; efforts];
        let mut squares = vec![vec![0.0; r]; efforts];
        let mut row = vec![0.0; r];
        equations.visit(&mut |rows| {
            let count = rows.tau.len();
            let (own, instruments) = rows.w.split_at(r * count);
            for (e, (tau, weight)) in rows.tau.iter().zip(rows.weights).enumerate() {
                if *weight == 0.0 {
                    continue;
                }
                let entries = own.get(e..).unwrap_or_default();
                accumulated.push(e, entries, count, *tau, *weight)?;
                let square = weight * weight;
                for (slot, w) in row.iter_mut().zip(entries.iter().step_by(count)) {
                    *slot = w * square;
                }
                let z = instruments.iter().skip(e).step_by(count);
                let lines = products[e].chunks_exact_mut(r);
                let sums = sides[e].iter_mut().zip(&mut squares[e]);
                for ((line, (side, own)), z) in lines.zip(sums).zip(z) {
                    for (sum, w) in line.iter_mut().zip(&row) {
                        *sum += z * w;
                    }
                    *side += z * tau * square;
                    *own += z * z * square;
                }
            }
            Ok(())
        })?;
        Ok(Self {
            factors: accumulated.finish()?,
            products,
            sides,
            squares,
        })
    }

    /// The estimate with these weights of the efforts.
    pub(super) fn solve(&self, weights: &[f64]) -> Result<Solution, EstimateError> {
        let factor = self.factors.combined(weights)?;
        let least_squares = factor.solve()?;
        let r = least_squares.len();
        let summed = |parts: &[Vec<f64>]| -> Vec<f64> {
            let mut out = vec![0.0; parts.first().map_or(0, Vec::len)];
            for (part, weight) in parts.iter().zip(weights) {
                for (sum, x) in out.iter_mut().zip(part) {
                    *sum += x * weight * weight;
                }
            }
            out
        };
        let mut product = summed(&self.products);
        let mut side = summed(&self.sides);
        let norms = factor.column_norms();
        let own: Vec<f64> = summed(&self.squares).iter().map(|x| x.sqrt()).collect();
        // scales columns and instruments to length 1, as their units differ
        let unit = |x: f64| if x > 0.0 { x } else { 1.0 };
        for (i, line) in product.chunks_exact_mut(r.max(1)).enumerate() {
            let by = unit(own[i]);
            for (x, norm) in line.iter_mut().zip(&norms) {
                *x /= by * unit(*norm);
            }
            side[i] /= by;
        }
        let relevance = (0..r).map(|k| product[k * r + k]).collect();
        let square = Square::new(&product, r, self.factors.labels())?;
        let mut values = square.solve(&side)?;
        for (x, norm) in values.iter_mut().zip(&norms) {
            *x /= unit(*norm);
        }
        // (Z^T W)^-1, entry (i, j) at i * r + j
        let mut inverse = vec![0.0; r * r];
        for j in 0..r {
            let mut e = vec![0.0; r];
            e[j] = 1.0 / unit(own[j]);
            for (i, x) in square.solve(&e)?.iter().enumerate() {
                inverse[i * r + j] = x / unit(norms[i]);
            }
        }
        Ok(Solution {
            values,
            least_squares,
            relevance,
            inverse,
            factor,
        })
    }
}

/// The estimates by instrumental variables and by least squares.
pub(super) struct Solution {
    pub(super) values: Vec<f64>,
    pub(super) least_squares: Vec<f64>,
    pub(super) relevance: Vec<f64>,
    /// `(Z^T W)^-1`, row by row.
    pub(super) inverse: Vec<f64>,
    /// The QR factor of the weighted W.
    pub(super) factor: QrFactor,
}

impl Solution {
    /// The values that solve `Z^T W x = scores`.
    pub(super) fn changed_by(&self, scores: &[f64]) -> Vec<f64> {
        let rows = self.inverse.chunks_exact(scores.len().max(1));
        rows.map(|row| row.iter().zip(scores).map(|(a, b)| a * b).sum())
            .collect()
    }

    /// The difference of the values to others, in standard deviations for white residuals whose
    /// size is the inverse of the weights: the root mean square over all directions.
    pub(super) fn change_from(&self, others: &[f64]) -> Result<f64, EstimateError> {
        let n = self.values.len();
        let changes: Vec<f64> = self.values.iter().zip(others).map(|(a, b)| a - b).collect();
        let moved: f64 = (0..n)
            .map(|i| {
                let entries = (i..n).map(|k| self.factor.r()[k * n + i] * changes[k]);
                entries.sum::<f64>().powi(2)
            })
            .sum();
        if moved.is_finite() {
            Ok((moved / n.max(1) as f64).sqrt())
        } else {
            Err(EstimateError::NoConvergence)
        }
    }
}

/// A square matrix, solved by its QR factor.
struct Square<'a> {
    rows: &'a [f64],
    n: usize,
}

impl<'a> Square<'a> {
    /// Checks that the matrix is regular.
    ///
    /// - `rows`: n x n, row-major; `labels`: those of the parameters, for the error.
    fn new(rows: &'a [f64], n: usize, labels: &[String]) -> Result<Self, EstimateError> {
        let square = Self { rows, n };
        let (r, _) = square.reduced(&vec![0.0; n]);
        let pivots: Vec<f64> = (0..n).map(|k| r[k * n + k].abs()).collect();
        let largest = pivots.iter().copied().fold(0.0, f64::max);
        let least = pivots.iter().copied().fold(f64::INFINITY, f64::min);
        let floor = MIN_PIVOT_RATIO * largest;
        let small = |pivot: f64| pivot.is_nan() || pivot <= floor;
        if small(least) {
            let weak = |k: &usize| small(pivots[*k]);
            let weak: Vec<usize> = (0..n).filter(weak).collect();
            return Err(EstimateError::Undetermined {
                rank: n - weak.len(),
                parameters: n,
                labels: weak
                    .iter()
                    .filter_map(|k| labels.get(*k).cloned())
                    .collect(),
                reciprocal_condition: if largest > 0.0 { least / largest } else { 0.0 },
            });
        }
        Ok(square)
    }

    fn reduced(&self, side: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let n = self.n;
        let (mut r, mut z) = (vec![0.0; n * n], vec![0.0; n]);
        let mut block = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..n {
                block[j * n + i] = self.rows[i * n + j];
            }
        }
        reduce(&mut r, &mut z, &mut block, &mut side.to_vec(), n);
        (r, z)
    }

    fn solve(&self, side: &[f64]) -> Result<Vec<f64>, EstimateError> {
        let (r, z) = self.reduced(side);
        substitute(&r, &z).ok_or(EstimateError::NoConvergence)
    }
}
