//! Kinematic calibration: the geometry of a mechanism with or without loops from what is measured of
//! it at rest.
//!
//! Every placement and every joint is a chain of turns and shifts ([`Kinematics`]), so that what an
//! error of any of them does to any frame is a screw: a column of one Jacobian beside those of the
//! coordinates. Loops are closed again at each step of the search, and dependent coordinates follow
//! the errors by A_e dq_e = -f_x dx (Eq. 8 with the unknowns x in place of the independent
//! coordinates).
//!
//! - [`Problem::known`] tells what measurements can determine, before any is made.
//! - [`Problem::calibrate`] finds it, with deviations.
//!
//! Angles are in rad, lengths in m, frames in the world where nothing else is said.

mod closure;
mod equations;
mod fit;
mod geometry;
mod identifiable;
mod kinematics;
mod sensor;
mod simulate;
mod structure;
mod suspect;

pub use closure::{Closure, Split};
pub use equations::{Group, Pose, Problem};
pub use fit::{CalibrateError, Estimate, Fit, Fixed, GroupFit, PoseResiduals};
pub use geometry::{Geometry, Unit, Unknown};
pub use identifiable::{Absorbed, Selection};
pub use kinematics::{Amount, Axis, Chain, Coupling, Cut, Kinematics, Motion, Row, Step, View};
pub use sensor::{Convention, Kind, Mounting, Sensor};
pub use simulate::Simulation;
pub use structure::{Known, Why};
pub use suspect::{Doubt, OtherWay};
