//! What a log holds, and what it can identify, before anything is fitted.
//!
//! - [`inspect`] reads a run whose columns nobody has described: which are time, positions,
//!   velocities, efforts or currents, rate and gaps, steps of encoders, rests, saturation, spectra
//!   with the frequency where the signal meets the noise, the period, and which joint each effort
//!   follows, with which sign and how late.
//! - [`proposal`] writes that down as a first experiment file, which identification reads.
//! - [`predict`] says, for a robot's model, how well each base parameter will be determined at the
//!   noise of the efforts, on which parameters no effort depends, and how which joint would have to
//!   move to determine more.
//!
//! Logs are read row by row in a time linear in their length, and in memory that does not grow with
//! it. Everything is a judgement from the data and the names of columns: each has its reason, and
//! none is a rule for one machine's logs.

mod clock;
mod columns;
mod fft;
mod follow;
mod gather;
mod joints;
mod log;
mod motion;
mod names;
mod needs;
mod period;
mod predict;
mod proposal;
mod relations;
mod roles;
mod solve;
mod spectrum;
#[cfg(test)]
mod testing;
mod words;

pub use clock::{Clock, ClockSource, Gap};
pub use columns::Extreme;
pub use follow::Following;
pub use joints::Joint;
pub use log::{Column, LogFacts, inspect};
pub use motion::JointMotion;
pub use names::Role;
pub use needs::{Kind, Need};
pub use period::Period;
pub use predict::{EffortNoise, ExpectedStatus, PredictedParameter, Prediction, predict};
pub use proposal::proposal;
pub use relations::Derivative;
pub use spectrum::{Spectrum, amplitude_density};

/// The version of what is serialised here: a change of a name or a meaning increases it.
pub const VERSION: u32 = 2;
