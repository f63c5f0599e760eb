//! Parameters from observations: triangular factors, least squares and its statistics.
//!
//! [`Factor`] is what remains of any number of rows of W x = tau, [`FactorSet`] holds one for
//! each effort and is what files keep, [`Estimate`] is the least-squares solution with its
//! covariance.

mod error;
mod factor;
mod residuals;
mod set;
mod solution;
mod spectrum;

pub use error::EstimateError;
pub use factor::Factor;
pub use residuals::{Autocorrelated, EffortError, Residuals, average_relative_error};
pub use set::{Accumulator, FactorSet, FileError, Origin};
pub use solution::{EffortFit, Estimate, Weighting};
pub use spectrum::{RANK_TOLERANCE, Spectrum};
