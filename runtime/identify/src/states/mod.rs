//! States of motion: completes measured coordinates by the loop closure, smooths whole motions, and states what the
//! later steps read of a log. It knows neither files nor parameters.

mod completion;
mod filtering;
mod fusion;
mod joints;
mod recorded;
mod series;
mod source;
mod tracked;

pub use completion::{Completed, CompletedStates, Completeness, Completion};
pub use filtering::{Filtering, Standstill};
pub(crate) use joints::depends_on_direction;
pub use joints::{FrictionJoint, directions, nonlinear_joints};
pub use recorded::Recorded;
pub use series::MotionSeries;
pub use source::{ChangedEfforts, Source, StateSample};
pub(crate) use tracked::TrackedMotion;
