//! Identification by output errors: the robot is simulated under its controllers, and what it would
//! have shown is compared with what was measured.
//!
//! - [`fit_responses`] needs no efforts: it fits base parameters to the positions with which a robot
//!   answered to commands, given its controllers or estimating their gains, and names what commands
//!   alone do not determine.
//! - [`didim`] needs efforts alone: least squares of measured efforts on those of the simulated loop (Gautier, Janot and Vandanjon, A new closed-loop output error method for
//!   parameter identification of robot dynamics, 2013).
//!
//! Both work for robots with and without loops, on the independent coordinates.
//!
//! Equations, tables and sections that are cited by number are those of V. Mata, N. Farhat,
//! M. Diaz-Rodriguez, A. Valera, A. Page, "Dynamic Parameter Identification for Parallel
//! Manipulators", in H. Wu (ed.), Parallel Manipulators, towards New Applications, I-Tech, 2008.
#![allow(
    clippy::doc_markdown,
    reason = "q_i and qdd_i are formulas, written as in the equations"
)]

mod commanded;
mod control;
mod departure;
mod didim;
mod effort_slopes;
mod effort_tracks;
mod error;
mod files;
mod fit;
mod linear_step;
mod loaded_didim;
mod logs;
mod parameters;
mod plant;
mod rank;
mod residuals;
mod rounds;
mod search;
mod setup;
mod simulated_loops;
mod start;
mod statistics;
mod threads;
mod track_controllers;
mod window;

pub use commanded::Commanded;
pub use departure::{Departure, departures, motion_distance};
pub use didim::{Didim, DidimError, DidimOptions, EffortRun, didim};
pub use effort_tracks::{EffortTracks, KnownReference};
pub use error::ResponseError;
pub use files::{ControllerError, controllers};
pub use fit::{Estimated, ResponseFit, fit_responses};
pub use loaded_didim::{LoadedDidim, didim_with_gains};
pub use logs::{TrackError, efforts};
pub use rank::Direction;
pub use setup::{Action, Damping, Law, Run, Setup, SignalKind, SignalModel, Value};
pub use simulated_loops::SimulatedLoops;
pub use track_controllers::TrackControllers;

pub use regen_runtime::DIRECTIONS;

/// The number type with which a model is differentiated.
pub type Number = regen_runtime::Tangent<DIRECTIONS>;
