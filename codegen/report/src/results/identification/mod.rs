//! The result of an identification.

mod delays;
mod instruments;
mod logs;
mod models;
mod simulated;
mod steps;
mod summary;
mod text;
mod warnings;

pub(crate) use delays::delay_fields;
pub use delays::{corrected_delays_text, states_delays};
pub use instruments::Instruments;
pub(crate) use logs::{Field, choice_fields, fields};
pub use logs::{
    LOCK_JOINTS, LogFile, READ_AS_POSES, doubts_of_log, filter_text, notes_of_logs, resting,
};
pub use models::{error_percent, stem};
pub use simulated::{EffortsOfLogs, Rounds, Search, Simulated};
pub use steps::{ReductionStep, reduction_steps};
pub use summary::{BiasRemedy, EffortSummary, Identification, ModelErrors, Summary, Suspected};
pub use text::identification_text;
pub use warnings::{
    coarse_friction, noise_alone, noisy_accelerations, too_few, too_short, unexplained,
};
