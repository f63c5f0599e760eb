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
//! - [`Problem::choose`] says at which poses to measure.
//! - [`Problem::calibrate`] finds it, with deviations.
//!
//! Angles are in rad, lengths in m, frames in the world where nothing else is said.
//!
//! ```
//! use nalgebra::DMatrix;
//! use regen_calibrate::{
//!     Amount, Axis, Chain, Geometry, Kind, Kinematics, Mounting, Problem, Sensor, Simulation, Step, Unit,
//!     Unknown,
//! };
//!
//! // an arm of 0.4 m that turns about z; how long it is will be found
//! struct Arm([Unknown; 1]);
//! impl Geometry for Arm {
//!     fn unknowns(&self) -> &[Unknown] {
//!         &self.0
//!     }
//!     fn scalars(&self, values: &[f64]) -> Option<Vec<f64>> {
//!         Some(values.to_vec())
//!     }
//!     fn slopes(&self, _values: &[f64]) -> DMatrix<f64> {
//!         DMatrix::identity(1, 1)
//!     }
//! }
//! let length = Unknown { name: "arm".to_owned(), unit: Unit::Length, nominal: 0.4 };
//! let turn = Step { turns: true, axis: Axis::Z, amount: Amount::Coordinate(0, 1.0) };
//! let arm = Step { turns: false, axis: Axis::X, amount: Amount::Scalar(0) };
//! let kinematics = Kinematics {
//!     coordinates: vec!["q1".to_owned()],
//!     scalars: 1,
//!     links: vec![Chain { parent: None, steps: vec![turn] }],
//!     frames: vec![("tip".to_owned(), Chain { parent: Some(0), steps: vec![arm] })],
//!     home: vec![0.0],
//!     ..Kinematics::default()
//! };
//! let wire = Sensor {
//!     name: "wire".to_owned(),
//!     kind: Kind::Distance,
//!     frame: 0,
//!     mounting: Mounting { point: [1.0, 0.0, 0.0].into(), ..Mounting::WORLD },
//!     noise: Some(1e-4),
//!     noise_of_angles: None,
//! };
//! let problem = Problem {
//!     kinematics: &kinematics,
//!     geometry: &Arm([length]),
//!     measured: &[0],
//!     noise_of_readings: &[Some(0.0)],
//!     sensors: &[wire],
//!     tolerance: None,
//!     efforts: None,
//!     poses: &[],
//! };
//! let what = Simulation { poses: 20, errors: 1e-2, noise: [1e-4, 1e-4], seed: 1 };
//! let (truth, poses) = problem.simulate(&what)?;
//! let fit = Problem { poses: &poses, ..problem }.calibrate(0.95)?;
//! let found = &fit.estimates[0];
//! // sqrt(20) measurements of 0.1 mm
//! assert!((found.value - truth[0]).abs() < 4.0 * found.sigma && found.sigma < 5e-5);
//! # Ok::<(), regen_calibrate::CalibrateError>(())
//! ```

mod choose;
mod closure;
mod compliance;
mod equations;
mod fit;
mod geometry;
mod identifiable;
mod kinematics;
mod placed;
mod search;
mod sensor;
mod simulate;
mod structure;
mod suspect;
mod tried;

pub use choose::{Choice, Chosen, Design, Observability};
pub use closure::{Closure, Split};
pub use compliance::Efforts;
pub use equations::{Group, Pose, Problem};
pub use fit::{CalibrateError, Estimate, Fit, Fixed, GroupFit, PoseResiduals};
pub use geometry::{Geometry, Unit, Unknown};
pub use identifiable::{Absorbed, Selection};
pub use kinematics::{Amount, Axis, Chain, Coupling, Cut, Kinematics, Motion, Row, Step, View};
pub use sensor::{Convention, Kind, Mounting, Sensor};
pub use simulate::Simulation;
pub use structure::{Known, Why};
pub use suspect::{Doubt, OtherWay};
