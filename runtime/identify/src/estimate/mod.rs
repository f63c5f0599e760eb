//! Parameters from observations: triangular factors, least squares and its statistics.
//!
//! [`QrFactor`] is the triangular factor of any number of rows of W x = tau, [`FactorSet`] contains
//! one for each effort and is what factor files store, [`Estimate`] is the least-squares solution
//! with its covariance.

mod cosine_sums;
mod deviations;
mod effort_noise;
mod error;
mod factor;
pub(crate) mod huber;
mod noise;
mod products;
mod residuals;
mod row_block;
mod scores;
mod set;
mod shrunk;
mod solution;
mod spectrum;

pub(crate) use deviations::SAMPLING;
pub use deviations::{Between, Deviations};
pub(crate) use effort_noise::{EffortNoise, FilteredNoise, NoiseResiduals, Thinning};
pub use error::EstimateError;
pub use factor::QrFactor;
pub use noise::{Autoregression, ORDER};
pub(crate) use noise::{cholesky, levinson};
pub(crate) use products::OuterProducts;
pub use residuals::{Autocorrelated, EffortError, Residuals, average_relative_error};
pub(crate) use residuals::{bartlett_growth, bartlett_stretches};
pub(crate) use row_block::RowBlock;
pub(crate) use scores::changed_by;
pub use scores::{BLOCKS, Blocks, Scores};
pub use set::{Accumulator, FactorSet, FileError, LogErrors, Origin};
pub use solution::{EffortFit, Estimate, Weighting};
pub(crate) use solution::{inverse_gram, quantile, weights_from};
pub use spectrum::{RANK_TOLERANCE, Spectrum};

/// Returns an error unless a length is the expected one.
pub(crate) fn require(
    what: &'static str,
    expected: usize,
    got: usize,
) -> Result<(), EstimateError> {
    if expected == got {
        return Ok(());
    }
    Err(EstimateError::Size {
        what,
        expected,
        got,
    })
}
