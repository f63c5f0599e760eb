//! What sampling leaves unknown of the efforts, and so of the parameters.

use super::equation_builder::Equations;
use crate::estimate::{QrFactor, changed_by};

/// Sums the scores of the residuals that efforts have if the controller holds them from row to row, see
/// [`Equations::held`]. With a controller that is much faster than the log these residuals are 0. As
/// residuals with noise seldom tell which it is, the change of the parameters counts as one standard
/// deviation.
#[derive(Debug)]
pub(crate) struct HeldEfforts {
    /// `W^T e` with these residuals `e`; with instruments `Z^T e`.
    scores: Vec<f64>,
}

impl HeldEfforts {
    /// - `parameters`: their number.
    pub(crate) fn new(parameters: usize) -> Self {
        Self {
            scores: vec![0.0; parameters],
        }
    }

    /// Adds the equations of a sample.
    ///
    /// - `equations`: with columns of the regressor or of the instruments;
    /// - `weights`: of the efforts.
    pub(crate) fn push(&mut self, equations: &Equations<'_>, weights: &[f64]) {
        let count = equations.tau.len();
        let rows = equations.held.iter().zip(equations.weights).zip(weights);
        for (i, ((held, row), effort)) in rows.enumerate() {
            let weighted = (row * effort).powi(2) * held;
            if weighted == 0.0 {
                continue;
            }
            let entries = equations.w.iter().skip(i).step_by(count.max(1));
            for (sum, w) in self.scores.iter_mut().zip(entries) {
                *sum += weighted * w;
            }
        }
    }

    /// The scores, one for each parameter.
    pub(crate) fn into_scores(self) -> Vec<f64> {
        self.scores
    }

    /// The change of each parameter, in its unit: `(W^T W)^-1 W^T e`; 0 if the factor is singular.
    ///
    /// - `factor`: the weighted QR factor of W.
    pub(crate) fn change(self, factor: &QrFactor) -> Vec<f64> {
        changed_by(factor, &self.scores).unwrap_or_else(|| vec![0.0; self.scores.len()])
    }
}
