//! Rehearsals: runs of a robot with known parameters are simulated and identified as real ones are,
//! seed by seed, and every estimate is compared with the truth and its interval.
//!
//! [`rehearse`] does this for a [`Rehearsal`], [`Score`] is what it returns, and [`planned`] takes
//! durations and rates from the runs of an experiment.
//!
//! The logs pass through the same files, readers and checks as those of a machine.
//!
//! Equations, tables and sections that are cited by number are those of V. Mata, N. Farhat,
//! M. Diaz-Rodriguez, A. Valera, A. Page, "Dynamic Parameter Identification for Parallel
//! Manipulators", in H. Wu (ed.), Parallel Manipulators, towards New Applications, I-Tech, 2008.

mod chance;
mod error;
mod estimate;
mod friction;
mod loads;
mod plan;
mod score;
mod seeds;
mod trial;

pub use chance::counts_by_chance;
pub use error::RehearseError;
pub use estimate::{DidimSettings, Estimator};
pub use loads::Loads;
pub use plan::{Planned, planned};
pub use score::{FailedSeed, ParameterScore, Score};
pub use seeds::{Rehearsal, rehearse};
