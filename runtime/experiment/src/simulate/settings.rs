//! The settings of a run: the motion to follow, the sensors, the duration and the tolerance.

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

/// The resolution and the noise of the sensors of the actuated joints' positions and efforts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sensors {
    /// The resolution of the position encoders, rad or m; 0: not quantised.
    pub position_step: f64,
    /// The standard deviation of the noise of positions, rad or m.
    pub position_noise: f64,
    /// The resolution of the measured efforts, N or N m; 0: not quantised.
    pub effort_step: f64,
    /// The standard deviation of the noise of efforts, N or N m.
    pub effort_noise: f64,
}

impl Sensors {
    /// The encoder reading of a true position, rad or m.
    pub fn position(&self, truth: f64, noise: &mut Noise) -> f64 {
        quantised(
            truth + self.position_noise * noise.normal(),
            self.position_step,
        )
    }

    /// The measured value of a true effort, N or N m.
    pub fn effort(&self, truth: f64, noise: &mut Noise) -> f64 {
        quantised(truth + self.effort_noise * noise.normal(), self.effort_step)
    }
}

/// The settings of a run.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The duration of the run, s.
    pub duration: f64,
    /// The sampling period of the controller and the log, s; the chapter's robot was controlled and
    /// measured at 100 Hz.
    pub period: f64,
    /// One controller per actuated joint, in the order of `Info::actuated`; empty for a run without
    /// control.
    pub pid: Vec<Pid>,
    /// One drive per actuated joint, or empty.
    pub drives: Vec<Drive>,
    /// Constant efforts, N or N m, to which the controllers' commands are added, one per actuated
    /// joint, or empty. The drives start with them; without control they act alone.
    pub offset: Vec<f64>,
    /// One friction law per coordinate, or empty.
    pub friction: Vec<JointFriction>,
    /// The velocity, rad/s or m/s, over which the smoothed friction of a joint changes its direction;
    /// that of a drive does where its joints have this velocity.
    pub friction_width: f64,
    /// The sensors of positions and efforts.
    pub sensors: Sensors,
    /// The seed of the sensors' noise.
    pub seed: u64,
    /// The relative tolerance of each step of the integration.
    pub tolerance: f64,
    /// Whether the log has energies and the error of their balance, which takes a fifth of the time
    /// for a robot with springs.
    pub energies: bool,
}

impl Default for Settings {
    /// 1 s at 100 Hz without control, drives, friction or noise, with a relative tolerance of 1e-9
    /// per step, and with energies.
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
            energies: true,
        }
    }
}

/// Why a run cannot be started.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum SimulationError {
    /// A list's length does not fit the model.
    Size(SizeError),
    /// The loop closure reports an error.
    Closure(ClosureError),
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
        Self::Closure(error)
    }
}

impl fmt::Display for SimulationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size(error) => error.fmt(f),
            Self::Closure(error) => error.fmt(f),
            Self::Setting(name) => write!(f, "`{name}` must be a positive finite number"),
            Self::TooLong => write!(f, "`duration` has more than 100 million of `period`"),
        }
    }
}

impl core::error::Error for SimulationError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Size(error) => Some(error),
            Self::Closure(error) => Some(error),
            Self::Setting(_) | Self::TooLong => None,
        }
    }
}

/// The nearest multiple of `step`; `x` itself for a step of 0.
fn quantised(x: f64, step: f64) -> f64 {
    if step > 0.0 {
        (x / step).round() * step
    } else {
        x
    }
}
