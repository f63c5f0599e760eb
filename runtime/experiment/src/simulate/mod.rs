//! A simulated robot with known parameters, which gives logs like those of a real one.
//!
//! Only the independent coordinates are integrated. At every evaluation the dependent ones are
//! solved from the loop closure, on home's branch, so that the constraints hold to the accuracy of
//! that solve in runs of any duration: there is no drift to be stabilised.
//!
//! The state is q_i, qd_i, the efforts of the drives with lag, and two integrals that audit the
//! run: the work of the actuators and the loss to friction. Kinetic and potential energy are
//! computed independently of these, from the mass matrix and the poses of the bodies; the log
//! contains the error of the energy balance.

mod audit;
mod complete;
mod control;
mod csv;
mod follow;
mod forward;
mod friction;
mod integrate;
mod log;
mod missing;
mod noise;
mod robot;
mod run;
mod settings;
mod targets;
mod tuning;
mod twin;

pub use audit::Energy;
pub use control::{Controller, ControllerInput, Damping, Drive, Pid};
pub use csv::LogColumns;
pub use follow::{Following, Trial, follow};
pub use forward::{Forward, ForwardOutcome, factor_mass, solve_mass};
pub use friction::{
    MissingNominal, add_stribeck, fitted_friction, friction_width, linear_friction,
    nominal_friction, perturb_friction,
};
pub use log::{Log, Termination};
pub use missing::missing_values;
pub use noise::{Noise, perturb_parameters};
pub use run::{simulate, simulate_controlled, simulate_with_progress};
pub use settings::{Reference, Sensors, Settings, SimulationError};
pub use tuning::{Control, Gains, TuningError, control};
pub use twin::{Twin, TwinError, TwinOptions};
