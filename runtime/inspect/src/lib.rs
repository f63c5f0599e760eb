//! Describes logs, and predicts what they can identify, before any fit.
//!
//! - [`inspect`] analyses a run whose columns are not described: which are time, positions,
//!   velocities, efforts or currents; rate and gaps, encoder steps, rows at rest, saturation, spectra
//!   with the frequency at which the noise exceeds the signal, the period, and which joint each
//!   effort follows, with which sign and delay.
//! - [`proposal`] writes these facts as a first experiment file, which identification reads.
//! - [`delays_by_model`] finds the delays of efforts again with a robot's model.
//! - [`predict`] predicts, for a robot's model, how well each base parameter will be determined at
//!   the noise of the efforts, which parameters affect no effort, and which motion of which joint
//!   would determine more.
//!
//! Logs are read row by row, in a time linear in their length and in memory that does not grow with
//! it. All judgements are made from the data and the names of columns; each states its reason, and
//! none is specific to one machine's logs.

mod clock;
mod columns;
mod delay;
mod fft;
mod follow;
mod gather;
mod joints;
mod left_out;
mod log;
mod motion;
mod names;
mod needs;
mod period;
mod predict;
mod proposal;
mod regrid;
mod relations;
mod roles;
mod solve;
mod spectrum;
#[cfg(test)]
mod testing;
mod words;

pub use clock::{Clock, ClockSource, Gap};
pub use columns::Extreme;
pub use delay::delays_by_model;
pub use follow::Following;
pub use joints::Joint;
pub use log::{Column, LogFacts, inspect};
pub use motion::JointMotion;
pub use names::Role;
pub use needs::{Kind, Need};
pub use period::Period;
pub use predict::{EffortNoise, ExpectedStatus, PredictedParameter, Prediction, predict};
pub use proposal::{completed, proposal};
pub use relations::Derivative;
pub use spectrum::{Spectrum, amplitude_density};

/// The version of the serialised form of [`LogFacts`] and [`Prediction`]: a change of a name or a
/// meaning increases it.
pub const VERSION: u32 = 2;
