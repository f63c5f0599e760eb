//! What the sampling of the positions leaves unknown of their derivatives, and so of the
//! parameters.

use crate::estimate::require;
use crate::estimate::{EstimateError, QrFactor};

/// Weight of the whole log's QR factor against the equations of the sampled states: it decides
/// only where these contain little information.
const WHOLE_LOG_WEIGHT: f64 = 1e-3;

/// Computes by how much parameters would change with other derivatives.
///
/// To first order the change `d` solves `W d = tau - tau_1` (Eq. 12) by least squares, where
/// `tau_1` are the efforts that the parameters predict with the other derivatives.
#[derive(Debug)]
pub(crate) struct ChangedParameters {
    factor: QrFactor,
    /// The number of the log's equations for which these stand.
    equations: f64,
}

impl ChangedParameters {
    /// - `labels`: those of the parameters.
    pub(crate) fn new(labels: Vec<String>) -> Self {
        Self {
            factor: QrFactor::new(labels),
            equations: 0.0,
        }
    }

    /// Adds the equations of one state; they are left out if they are not finite.
    ///
    /// - `w`: n x parameters, column-major; weighted in place; `change`, `weights`: of each of the n
    ///   equations;
    /// - `rows`: the number of rows of the log for which the state stands.
    ///
    /// # Errors
    /// When the size of `w` does not fit.
    pub(crate) fn push(
        &mut self,
        (w, change): (&mut [f64], &[f64]),
        weights: &[f64],
        rows: f64,
    ) -> Result<(), EstimateError> {
        let n = change.len();
        require("w", n * self.factor.columns(), w.len())?;
        let root = rows.sqrt();
        let weight = |i: usize| root * weights.get(i).copied().unwrap_or(1.0);
        for column in w.chunks_exact_mut(n.max(1)) {
            for (i, entry) in column.iter_mut().enumerate() {
                *entry *= weight(i);
            }
        }
        let side = change.iter().enumerate().map(|(i, x)| weight(i) * x);
        if self
            .factor
            .push_block(w, &side.collect::<Vec<f64>>())
            .is_ok()
        {
            self.equations += rows * n as f64;
        }
        Ok(())
    }

    /// The change of each parameter, in its unit; 0 where there were no equations.
    ///
    /// - `whole`: the weighted QR factor of the whole log.
    pub(crate) fn finish(mut self, whole: &QrFactor) -> Vec<f64> {
        let n = whole.labels().len();
        let part = self.equations / whole.rows().max(1) as f64;
        let scale = (WHOLE_LOG_WEIGHT * part).sqrt();
        let rows: Vec<f64> = whole.r().iter().map(|x| scale * x).collect();
        let solved = self.factor.push_block(&rows, &vec![0.0; n]);
        match solved.and_then(|()| self.factor.solve()) {
            Ok(change) if part > 0.0 => change,
            _ => vec![0.0; n],
        }
    }
}
