//! Errors of fits to responses.

use core::fmt;

use regen_identify::estimate::EstimateError;
use regen_runtime::{ClosureError, SizeError};

/// Why responses cannot be fitted.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ResponseError {
    /// A list does not fit the model, or the others.
    Size {
        /// The list.
        what: &'static str,
        /// The length it must have, or the least one.
        expected: usize,
        /// The length it has.
        got: usize,
    },
    /// A setting of this name is not a positive finite number.
    Setting(&'static str),
    /// A joint of this name has nonlinear friction.
    NonlinearFriction(String),
    /// The runs have no window with enough rows.
    NoRows,
    /// A signal or a command is NaN or infinite.
    NotFinite,
    /// Times do not ascend.
    Times,
    /// The robot cannot be simulated with the first values.
    Start {
        /// The time at which the window begins, s.
        time: f64,
        /// The reason, in words.
        why: &'static str,
    },
    /// The loops of the model cannot be closed, or an argument does not fit the model.
    Closure(ClosureError),
    /// Rows do not make an estimate.
    Estimate(EstimateError),
}

impl fmt::Display for ResponseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size {
                what,
                expected,
                got,
            } => write!(f, "{what}: {got} where {expected} are needed"),
            Self::Setting(what) => write!(f, "the {what} must be a positive finite number"),
            Self::NonlinearFriction(joint) => write!(
                f,
                "{joint} has nonlinear friction, which responses are not fitted with: give it \
                 `friction: linear` or another law that is linear in its coefficients"
            ),
            Self::NoRows => f.write_str("there are too few rows for a window"),
            Self::NotFinite => f.write_str("a signal or a command is not a finite number"),
            Self::Times => f.write_str("the times of a run must ascend"),
            Self::Start { time, why } => write!(
                f,
                "the robot cannot be simulated with the first values from {time} s on: {why}; \
                 start from parameters of a robot that can exist"
            ),
            Self::Closure(why) => why.fmt(f),
            Self::Estimate(why) => why.fmt(f),
        }
    }
}

impl core::error::Error for ResponseError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Closure(why) => Some(why),
            Self::Estimate(why) => Some(why),
            _ => None,
        }
    }
}

impl From<SizeError> for ResponseError {
    fn from(why: SizeError) -> Self {
        Self::Closure(ClosureError::Size(why))
    }
}

impl From<ClosureError> for ResponseError {
    fn from(why: ClosureError) -> Self {
        Self::Closure(why)
    }
}

impl From<EstimateError> for ResponseError {
    fn from(why: EstimateError) -> Self {
        Self::Estimate(why)
    }
}
