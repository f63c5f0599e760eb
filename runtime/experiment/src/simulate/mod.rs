//! A simulated robot: what a log of the real one would hold, from known parameters.
//!
//! Only the independent coordinates are integrated. At every evaluation the others are solved
//! from the loop closure, on home's branch, so that the constraints hold to the accuracy of
//! that solve however long the run is: there is no drift to be stabilised.
//!
//! The state is q_i, qd_i, the efforts that the drives have built up, and two integrals that
//! audit the run: the work of the actuators and the loss to friction. Kinetic and potential
//! energy are found apart from them, from the mass matrix and from where the bodies are; what
//! does not balance is reported.

mod audit;
mod control;
mod csv;
mod forward;
mod friction;
mod integrate;
mod log;
mod noise;
mod robot;
mod run;
mod settings;
mod tuning;

pub use audit::Energy;
pub use control::{Controller, ControllerInput, Drive, Pid};
pub use forward::{Forward, ForwardOutcome};
pub use friction::{
    MissingNominal, fitted_friction, linear_friction, nominal_friction, perturb_friction,
};
pub use log::{Log, Termination};
pub use noise::{Noise, perturbed};
pub use run::{simulate, simulate_controlled, simulate_watched};
pub use settings::{Reference, Sensors, Settings, SimulationError};
pub use tuning::{Control, Gains, TuningError, control};
