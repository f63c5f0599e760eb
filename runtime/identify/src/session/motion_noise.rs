//! What noise of the measured motion does to parameters: errors in variables.
//!
//! Least squares takes the regressor as exact. Noise of the positions makes its columns larger than
//! those of the motion and their parameters too small, which no residual reveals. Simulation and
//! extrapolation (Cook and Stefanski, 1994) show by how much: noise that is like the log's own is added
//! to the positions, and subtracted from them; the mean of both fits differs from the fit without it by
//! what the added noise biases, and its own part is the same.

use regen_runtime::BaseModel;

use crate::data::{DataError, Logs, NoiseLevels};
use crate::estimate::EstimateError;
use crate::identify::{EquationKind, observe};

/// The added noise over that of the log: small, so that joints rest and turn in the same rows.
const SCALE: f64 = 0.5;

/// Logs in memory, and the noise of what they measure of the motion.
pub(super) struct NoisyMotion<'l, 'm, M: ?Sized> {
    pub(super) model: &'m M,
    pub(super) kind: EquationKind,
    /// In memory, with the method that is judged, at the rate at which it is.
    pub(super) logs: &'l Logs<'m, M>,
    /// The noise levels of the columns of motion of each log.
    pub(super) levels: &'l [Vec<NoiseLevels>],
    /// The frequency up to which the equations keep noise, Hz.
    pub(super) cutoff: f64,
}

impl<M: BaseModel<f64> + ?Sized> NoisyMotion<'_, '_, M> {
    /// By how much the noise of the motion changes each least-squares parameter, SI: the values that are
    /// found less those without noise, to the first order of its variance.
    ///
    /// - `weights`: those of the efforts.
    ///
    /// # Errors
    /// When the logs do not determine the parameters.
    pub(super) fn bias(&self, weights: &[f64]) -> Result<Vec<f64>, DataError> {
        let deviations: Vec<Vec<f64>> = (self.logs.durations().iter().zip(self.levels))
            .map(|((step, _), levels)| {
                let deviation = |own: &NoiseLevels| (own.density(self.cutoff) / step).sqrt();
                levels.iter().map(deviation).collect()
            })
            .collect();
        let fit = |scale: f64| -> Result<Vec<f64>, DataError> {
            let mut logs = self.logs.disturbed(scale, &deviations);
            let (set, _) = observe(self.model, self.kind, &mut logs)?;
            Ok(set.combined(weights)?.solve()?)
        };
        let [without, added, subtracted] = [fit(0.0)?, fit(SCALE)?, fit(-SCALE)?];
        let pairs = added.iter().zip(&subtracted).zip(&without);
        Ok(pairs
            .map(|((a, b), x)| (0.5 * (a + b) - x) / (SCALE * SCALE))
            .collect())
    }
}

/// Whether an error says that logs do not determine the parameters as they are read, so that another
/// way of reading them may.
pub(super) fn is_undetermined(error: &DataError) -> bool {
    matches!(
        error,
        DataError::Signal { .. }
            | DataError::Estimate(
                EstimateError::Undetermined { .. }
                    | EstimateError::TooShort { .. }
                    | EstimateError::NoConvergence
                    | EstimateError::Signal(_)
            )
    )
}
