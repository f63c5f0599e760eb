//! The covariance of the estimate by instrumental variables: as for least squares, from cosine
//! transforms of whitened scores, see [`Deviations`].

use nalgebra::DMatrix;

use super::{InstrumentedEquations, RoundResult};
use crate::estimate::{Autoregression, Deviations, ORDER, OuterProducts, Residuals, Scores};
use crate::identify::equation_builder::Equations;
use crate::identify::passes::predicted;

/// The deviations of an estimate, and its covariance for white residuals.
pub(super) struct Correlated {
    pub(super) deviations: Deviations,
    /// n x n, symmetric.
    pub(super) white: Vec<f64>,
}

/// Computes the deviations from the scores `z e`, with `e = tau - W beta` at the estimate.
pub(super) fn deviations<E: InstrumentedEquations>(
    equations: &mut E,
    round: &RoundResult,
) -> Result<Correlated, E::Error> {
    let solution = &round.solution;
    let n = solution.values.len();
    let noise = noise(equations, round)?;
    let mut scores = Scores::new(n, &noise);
    let mut squares = OuterProducts::new(n, true);
    let mut weighted = Weighted::default();
    let (mut square, mut line) = (0.0, Vec::with_capacity(n));
    equations.visit(&mut |rows| {
        if !rows.follows {
            scores.interrupt();
        }
        weighted.compute(rows, round);
        let count = rows.tau.len();
        let (w, z) = rows.w.split_at(n * count);
        for (effort, (weight, psi)) in weighted.weights.iter().zip(&weighted.psi).enumerate() {
            if *weight == 0.0 {
                continue;
            }
            square += psi * psi;
            line.clear();
            let column = z.iter().skip(effort).step_by(count);
            line.extend(column.map(|z| z * weight));
            squares.push(&line, &line);
        }
        scores.push_with_instruments((z, w), &weighted.weights, &weighted.psi)
    })?;
    let blocks = scores.finish(&solution.values)?;
    let factor = &solution.factor;
    let deviations =
        blocks.deviations_of_instruments(&solution.inverse, factor.has_too_few_rows())?;
    let variance = if factor.has_too_few_rows() {
        f64::INFINITY
    } else {
        square / factor.rows().saturating_sub(n).max(1) as f64
    };
    let white = sandwich(&solution.inverse, &squares.take(), variance);
    Ok(Correlated { deviations, white })
}

/// `variance B S B^T`, n x n.
///
/// - `inverse`: B; `squares`: the entries of S from the diagonal on; both n x n, row by row.
fn sandwich(inverse: &[f64], squares: &[f64], variance: f64) -> Vec<f64> {
    let n = inverse.len().isqrt();
    let bread = DMatrix::from_row_slice(n, n, inverse);
    let mut squares = DMatrix::from_row_slice(n, n, squares);
    squares.fill_lower_triangle_with_upper_triangle();
    let covariance = &bread * squares * bread.transpose() * variance;
    covariance.as_slice().to_vec()
}

/// Models the noise of each effort's weighted residuals.
fn noise<E: InstrumentedEquations>(
    equations: &mut E,
    round: &RoundResult,
) -> Result<Vec<Autoregression>, E::Error> {
    let names: Vec<String> = round.efforts.iter().map(|e| e.name.clone()).collect();
    let zeros = vec![0.0; names.len()];
    let mut noise = Residuals::new(&names, &zeros, ORDER);
    let mut weighted = Weighted::default();
    equations.visit(&mut |rows| {
        if !rows.follows {
            noise.interrupt();
        }
        weighted.compute(rows, round);
        noise.push_used(&weighted.psi, &zeros, &weighted.used)
    })?;
    let efforts = noise.efforts();
    let fits = efforts
        .iter()
        .map(|e| Autoregression::fit(e.rms * e.rms, &e.autocorrelation, e.samples));
    Ok(fits.collect())
}

/// The weighted residuals of one sample, one for each effort.
#[derive(Default)]
struct Weighted {
    weights: Vec<f64>,
    psi: Vec<f64>,
    /// Whether the equation is used.
    used: Vec<bool>,
}

impl Weighted {
    fn compute(&mut self, rows: &Equations<'_>, round: &RoundResult) {
        self.weights.clear();
        self.psi.clear();
        self.used.clear();
        for (e, (tau, own)) in rows.tau.iter().zip(rows.weights).enumerate() {
            let weight = own * round.weights.get(e).copied().unwrap_or(1.0);
            self.weights.push(weight);
            self.psi
                .push(weight * (tau - predicted(rows, e, &round.solution.values)));
            self.used.push(*own > 0.0);
        }
    }
}
