//! What a run is told: the motion to follow, the sensors, and how long and how exactly.

use core::fmt;

use super::control::{Drive, Pid};
use super::noise::Noise;
use regen_runtime::{ClosureError, JointFriction, SizeError};

/// A motion to follow: the independent coordinates over time.
pub trait Reference {
    /// Fills the independent positions, velocities and accelerations (dof each; rad or m, per
    /// s, per s^2) at time t, s.
    fn at(&self, t: f64, q_i: &mut [f64], qd_i: &mut [f64], qdd_i: &mut [f64]);
}

impl<F: Fn(f64, &mut [f64], &mut [f64], &mut [f64])> Reference for F {
    fn at(&self, t: f64, q_i: &mut [f64], qd_i: &mut [f64], qdd_i: &mut [f64]) {
        self(t, q_i, qd_i, qdd_i);
    }
}

/// What the sensors make of the truth: positions of the actuated joints and their efforts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sensors {
    /// The step of the position encoders, rad or m; 0 is none.
    pub position_step: f64,
    /// Standard deviation of noise on positions, rad or m.
    pub position_noise: f64,
    /// The step of the measured efforts, N or N m; 0 is none.
    pub effort_step: f64,
    /// Standard deviation of noise on efforts, N or N m.
    pub effort_noise: f64,
}

impl Sensors {
    /// What an encoder makes of a position, rad or m.
    pub fn position(&self, truth: f64, noise: &mut Noise) -> f64 {
        quantised(
            truth + self.position_noise * noise.normal(),
            self.position_step,
        )
    }

    /// What is measured of an effort, N or N m.
    pub fn effort(&self, truth: f64, noise: &mut Noise) -> f64 {
        quantised(truth + self.effort_noise * noise.normal(), self.effort_step)
    }
}

/// How a run goes.
#[derive(Clone, Debug)]
pub struct Settings {
    /// How long, s.
    pub duration: f64,
    /// The controller's and the log's period, s; the chapter's robot was controlled and
    /// measured at 100 Hz.
    pub period: f64,
    /// One controller per actuated joint, in the order of `Info::actuated`; empty for a robot
    /// that is left to itself.
    pub pid: Vec<Pid>,
    /// One drive per actuated joint, or none.
    pub drives: Vec<Drive>,
    /// Constant efforts under the controllers', one per actuated joint, or none: N or N m. The
    /// drives start with them; without control they act alone.
    pub offset: Vec<f64>,
    /// One law per coordinate, or none.
    pub friction: Vec<JointFriction>,
    /// The velocity, rad/s or m/s, within which friction changes its direction.
    pub friction_width: f64,
    /// What is measured.
    pub sensors: Sensors,
    /// For the sensors' noise.
    pub seed: u64,
    /// The integration's relative tolerance of each step.
    pub tolerance: f64,
}

impl Default for Settings {
    /// 1 s at 100 Hz without control, drives, friction or noise, to 1e-9 a step.
    fn default() -> Self {
        Self {
            duration: 1.0,
            period: 0.01,
            pid: Vec::new(),
            drives: Vec::new(),
            offset: Vec::new(),
            friction: Vec::new(),
            friction_width: 1e-3,
            sensors: Sensors::default(),
            seed: 0,
            tolerance: 1e-9,
        }
    }
}

/// A run that cannot be started.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum SimulationError {
    /// A list's length does not fit the model.
    Size(SizeError),
    /// The closure refuses the call.
    ClosureError(ClosureError),
    /// A setting is not a positive finite number.
    Setting(&'static str),
    /// More than 100 million samples.
    TooLong,
}

impl From<SizeError> for SimulationError {
    fn from(error: SizeError) -> Self {
        Self::Size(error)
    }
}

impl From<ClosureError> for SimulationError {
    fn from(error: ClosureError) -> Self {
        Self::ClosureError(error)
    }
}

impl fmt::Display for SimulationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size(error) => error.fmt(f),
            Self::ClosureError(error) => error.fmt(f),
            Self::Setting(name) => write!(f, "`{name}` must be a positive finite number"),
            Self::TooLong => write!(f, "`duration` has more than 100 million of `period`"),
        }
    }
}

impl core::error::Error for SimulationError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Size(error) => Some(error),
            Self::ClosureError(error) => Some(error),
            Self::Setting(_) | Self::TooLong => None,
        }
    }
}

fn quantised(x: f64, step: f64) -> f64 {
    if step > 0.0 {
        (x / step).round() * step
    } else {
        x
    }
}
