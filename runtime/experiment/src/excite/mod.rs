//! Exciting trajectories: motions from which the base parameters can be identified accurately
//! (section 3).
//!
//! The independent coordinates follow finite Fourier series (Eq. 25; Swevers et al., 1996). Their
//! coefficients minimise one of four [criteria](Criterion) of the observation matrix of the base
//! parameters, subject to all limits: positions, velocities, accelerations and jerks of all
//! coordinates, passive ones included, swing limits of spherical joints, efforts at nominal parameters, and a
//! margin from singularities. The loops stay closed on the branch of `home`.
//!
//! The search is sequential quadratic programming from random starts, with exact derivatives by
//! evaluating the robot's functions with [`Tangent`] numbers. The returned motion is within all
//! limits between samples too: it is checked on a grid of 128 points per period of the highest
//! harmonic, with a bound on the excess between these points, and reduced where needed. The same
//! seed gives the same result, on any number of threads.

mod active_set;
mod check;
mod criterion;
mod dense;
mod derivatives;
mod evaluate;
mod limits;
mod quadratic;
mod run;
mod scaled_problem;
mod search;
mod space;

use core::fmt;

pub use criterion::{Criterion, Figures};
pub use limits::{Limit, Quantity};
pub use regen_runtime::{DIRECTIONS, Tangent};
pub use run::{Excitation, Margin, Monitor, Outcome, Progress, excite};
pub use scaled_problem::{ScaledEvaluation, ScaledProblem};

use regen_identify::signals::SignalError;
use regen_runtime::{ClosureError, Info, Limits, SizeError};

/// The settings of a search: series, criterion, limits and effort of the search.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The number of harmonics.
    pub harmonics: usize,
    /// The frequency of the first harmonic, Hz.
    pub frequency: f64,
    /// The number of samples per period in the observation matrix.
    pub samples: usize,
    /// The criterion to optimise.
    pub criterion: Criterion,
    /// Whether velocities and accelerations are 0 where the period starts and ends.
    pub at_rest: bool,
    /// The limits of each coordinate, in the order of `q`. Independent coordinates must have
    /// position limits.
    pub limits: Vec<Limits>,
    /// The largest angle of each swing limit, in the order of `Info::cones`, rad.
    pub cones: Vec<f64>,
    /// The smallest accepted [`Condition::pivot`](regen_runtime::Condition) along the trajectory.
    pub singular_margin: f64,
    /// The parameters with which efforts are computed, in the order of `Info::parameters`; `None`:
    /// efforts are not limited.
    pub nominal: Option<Vec<f64>>,
    /// The standard deviation of each independent coordinate's effort, for
    /// [`Criterion::Determinant`]; empty: all 1.
    pub deviations: Vec<f64>,
    /// The seed of the random starts.
    pub seed: u64,
    /// The number of random starts.
    pub starts: usize,
    /// The number of threads; 0: as many as the machine has.
    pub threads: usize,
    /// The maximum number of steps in the last of the five stages of a start; the others have a third
    /// of it each.
    pub steps: usize,
}

impl Settings {
    /// The default settings for a robot, with its limits and nominal parameters: 11 harmonics of
    /// 1/7.5 Hz, 75 samples, a margin of 0.05 from singularities, four starts.
    ///
    /// ```
    /// use regen_runtime::Info;
    /// use regen_experiment::excite::{Criterion, Settings};
    ///
    /// let settings = Settings::of(&Info::EMPTY);
    /// assert_eq!(settings.harmonics, 11);
    /// assert_eq!(settings.criterion, Criterion::ScaledCondition);
    /// ```
    pub fn of(info: &Info<'_>) -> Self {
        let limit = |c: usize| info.joints.get(c).map_or(Limits::NONE, |j| j.limits);
        Self {
            harmonics: 11,
            frequency: 1.0 / 7.5,
            samples: 75,
            criterion: Criterion::default(),
            at_rest: false,
            limits: (0..info.coordinates.len()).map(limit).collect(),
            cones: info.cones.iter().map(|cone| cone.greatest).collect(),
            singular_margin: 0.05,
            nominal: info.nominal_parameters(),
            deviations: Vec::new(),
            seed: 1,
            starts: 4,
            threads: 0,
            steps: 180,
        }
    }
}

/// Why a search could not be started or failed.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ExciteError {
    /// An argument does not fit the model, or the model is inconsistent.
    Closure(ClosureError),
    /// A Fourier series is invalid.
    Signal(SignalError),
    /// The ends of a range are in the wrong order or not finite.
    Range {
        /// The name of the limited quantity.
        what: String,
        /// The lowest and the highest value.
        range: [f64; 2],
    },
    /// An independent coordinate has no position limits.
    Unbounded {
        /// The name of the coordinate.
        coordinate: String,
    },
    /// A setting is invalid, with the reason.
    Setting(&'static str),
    /// The robot has no base parameters.
    NoBase,
}

impl fmt::Display for ExciteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Closure(error) => error.fmt(f),
            Self::Signal(error) => error.fmt(f),
            Self::Range { what, range } => {
                let [lowest, highest] = range;
                write!(
                    f,
                    "{what}: {lowest} to {highest} is not a finite range in ascending order"
                )
            }
            Self::Unbounded { coordinate } => write!(
                f,
                "coordinate {coordinate} has no range of positions: state \
                 `limits: {{position: [LOWEST, HIGHEST]}}` of its joint"
            ),
            Self::Setting(what) => f.write_str(what),
            Self::NoBase => f.write_str("the robot has no base parameters to excite"),
        }
    }
}

impl core::error::Error for ExciteError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Closure(error) => Some(error),
            Self::Signal(error) => Some(error),
            Self::Range { .. } | Self::Unbounded { .. } | Self::Setting(_) | Self::NoBase => None,
        }
    }
}

impl From<ClosureError> for ExciteError {
    fn from(error: ClosureError) -> Self {
        Self::Closure(error)
    }
}

impl From<SizeError> for ExciteError {
    fn from(error: SizeError) -> Self {
        Self::Closure(error.into())
    }
}

impl From<SignalError> for ExciteError {
    fn from(error: SignalError) -> Self {
        Self::Signal(error)
    }
}
