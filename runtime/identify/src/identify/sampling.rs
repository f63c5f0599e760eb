//! What the sampling of the positions leaves unknown of their derivatives, and so of the
//! parameters.

use crate::estimate::QrFactor;

/// Weight of the whole log's QR factor against the equations of the sampled states: it decides
/// only where these contain little information.
const WHOLE_LOG_WEIGHT: f64 = 1e-3;

/// A state at which positions were differentiated in two ways.
#[derive(Clone, Copy, Debug)]
pub struct ChangedEfforts<'a> {
    /// The positions of all coordinates, rad or m.
    pub q: &'a [f64],
    /// The base regressor, dof x r, column-major.
    pub w: &'a [f64],
    /// The predicted efforts less those with the other derivatives, dof, N m or N.
    pub change: &'a [f64],
}

/// Sums up by how much parameters would change with other derivatives.
///
/// To first order the change `d` solves `W d = tau - tau_1` (Eq. 12) by least squares, where
/// `tau_1` are the efforts that the parameters predict with the other derivatives.
#[derive(Debug)]
pub(crate) struct ChangedParameters {
    factor: QrFactor,
}

impl ChangedParameters {
    /// - `labels`: those of the parameters.
    pub(crate) fn new(labels: Vec<String>) -> Self {
        Self {
            factor: QrFactor::new(labels),
        }
    }

    /// Adds the equations of one state.
    ///
    /// - `w`: n x parameters, column-major; weighted in place;
    /// - `change`, `weights`: of each of the n equations.
    pub(crate) fn push(&mut self, w: &mut [f64], change: &[f64], weights: &[f64]) {
        let n = change.len();
        let weight = |i: usize| weights.get(i).copied().unwrap_or(1.0);
        for column in w.chunks_exact_mut(n.max(1)) {
            for (i, entry) in column.iter_mut().enumerate() {
                *entry *= weight(i);
            }
        }
        let side = change.iter().enumerate().map(|(i, x)| weight(i) * x);
        // equations that are not finite are left out
        let _ = self.factor.push_block(w, &side.collect::<Vec<f64>>());
    }

    /// The change of each parameter; 0 where there were no equations.
    ///
    /// - `whole`: the weighted QR factor of the whole log.
    pub(crate) fn finish(mut self, whole: &QrFactor) -> Vec<f64> {
        let n = whole.labels().len();
        let part = self.factor.rows() as f64 / whole.rows().max(1) as f64;
        let scale = (WHOLE_LOG_WEIGHT * part).sqrt();
        let rows: Vec<f64> = whole.r().iter().map(|x| scale * x).collect();
        let solved = self.factor.push_block(&rows, &vec![0.0; n]);
        match solved.and_then(|()| self.factor.solve()) {
            Ok(change) if part > 0.0 => change,
            _ => vec![0.0; n],
        }
    }
}
