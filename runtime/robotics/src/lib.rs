//! The one dependency of a program that uses regen: every library of it under a name of its own,
//! each behind a feature.
//!
//! ```toml
//! [dependencies]
//! regen-robotics = { path = "../regen/runtime/robotics", features = ["control"] }
//! ```
//!
//! A robot that is described in `arm.yaml`, a pendulum here, becomes a module when the program is
//! compiled:
//!
//! ```
//! // arm.yaml, beside Cargo.toml:
//! //   name: arm
//! //   limbs:
//! //     - {name: arm, joints: [{name: q1, type: revolute, body: 1, actuated: true}]}
//! regen_robotics::robot_model!("src/arm.yaml");
//!
//! // From rest: phi in the order of arm::PARAMETERS, in SI units; tau in N m.
//! let phi = [0.1; arm::PARAMETERS.len()];
//! let (tau, condition): ([f64; 1], _) = arm::inverse_dynamics(&[0.0], &[0.0], &[2.0], &phi);
//! assert!(condition.is_regular());
//! assert!((tau[0] - 0.2).abs() < 1e-12, "Izz(1) qdd, as gravity is along the axis");
//! ```
//!
//! | feature | what it adds |
//! |---|---|
//! | `macros` (default) | `robot_model!` |
//! | `std` (default), `closure`, `dual`, `tangent` | the same feature of [`runtime`] |
//! | `control` | `control`: what a controller calls in its cycle; neither allocates nor needs `std` |
//! | `batch` | `batch`: many states at once, in vector registers |
//! | `identify` | `identify`: parameters from logs in text; `formats` reads every other format too |
//! | `experiment` | `experiment`: exciting trajectories and simulation, with `identify` |
//! | `calibrate` | `calibrate`: kinematic calibration |
//!
//! Without default features, and with `macros` and `control`, this works in programs without the
//! standard library. `robot_model!` also works where a crate depends on `regen-runtime`; if a crate
//! depends on both, the emitted module names `regen-runtime`, whose types are the same.
#![no_std]

#[cfg(feature = "batch")]
pub use regen_batch as batch;
#[cfg(feature = "calibrate")]
pub use regen_calibrate as calibrate;
#[cfg(feature = "control")]
pub use regen_control as control;
#[cfg(feature = "experiment")]
pub use regen_experiment as experiment;
#[cfg(feature = "identify")]
pub use regen_identify as identify;
pub use regen_runtime as runtime;
#[cfg(feature = "macros")]
pub use regen_runtime::robot_model;
