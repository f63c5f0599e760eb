//! Parameters from observations: triangular factors and least squares.
//!
//! [`Factor`] is what remains of any number of rows of W x = tau.

mod error;
mod factor;
mod kernel;
mod spectrum;

pub use error::EstimateError;
pub use factor::Factor;
pub use spectrum::{RANK_TOLERANCE, Spectrum};
