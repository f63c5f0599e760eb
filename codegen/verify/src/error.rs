//! Why a robot could not be checked.

use std::fmt;

use regen_runtime::{ClosureError, Outcome, SizeError};

/// Why a robot could not be checked.
#[derive(Debug)]
#[non_exhaustive]
pub enum VerifyError {
    /// A robot's functions do not have the sizes that its own description states.
    Size(SizeError),
    /// A robot that loop closure cannot work with.
    LoopClosure(ClosureError),
    /// No closed state was found near home.
    NotClosed {
        /// The robot.
        robot: String,
        /// How the last try ended.
        outcome: Outcome,
    },
    /// The robot was derived without base parameters.
    NoBase {
        /// The robot.
        robot: String,
        /// How many dynamic parameters it has.
        parameters: usize,
    },
    /// An observation matrix over so few states has fewer rows than columns.
    TooFewStates {
        /// The robot.
        robot: String,
        /// The states.
        states: usize,
        /// The rows of so many states.
        rows: usize,
        /// The matrix's columns.
        columns: usize,
        /// The states that give enough rows.
        least: usize,
    },
    /// The regressor is not finite at a random closed state.
    NotFinite {
        /// The robot.
        robot: String,
    },
    /// The singular values of the observation matrix were not found.
    NoSingularValues {
        /// The robot.
        robot: String,
    },
    /// The second derivation cannot read the description.
    Unread(String),
    /// The second derivation reads other coordinates or parameters in the description.
    OtherNames {
        /// The robot.
        robot: String,
    },
    /// The second derivation finds no forces at a state.
    NoForces(String),
    /// Reference vectors that cannot be read.
    Vectors(serde_json::Error),
}

impl fmt::Display for VerifyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size(error) => error.fmt(f),
            Self::LoopClosure(error) => error.fmt(f),
            Self::NotClosed { robot, outcome } => {
                write!(f, "{robot}: no closed state was found near home: {outcome}")
            }
            Self::NoBase { robot, parameters } => write!(
                f,
                "{robot} has {parameters} dynamic parameters, and no base parameters were derived"
            ),
            Self::TooFewStates {
                robot,
                states,
                rows,
                columns,
                least,
            } => write!(
                f,
                "{states} states give {rows} rows, fewer than the {columns} columns of {robot}: \
                 at least {least} states are needed"
            ),
            Self::NotFinite { robot } => write!(
                f,
                "{robot}: the regressor is not finite at a random closed state"
            ),
            Self::NoSingularValues { robot } => {
                write!(f, "{robot}: no singular values were found")
            }
            Self::Unread(why) => write!(f, "the second derivation cannot read this: {why}"),
            Self::OtherNames { robot } => write!(
                f,
                "{robot}: the second derivation reads other coordinates or parameters in this spec"
            ),
            Self::NoForces(why) => write!(f, "second derivation: {why}"),
            Self::Vectors(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for VerifyError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Size(error) => Some(error),
            Self::LoopClosure(error) => Some(error),
            Self::Vectors(error) => Some(error),
            _ => None,
        }
    }
}

impl From<SizeError> for VerifyError {
    fn from(error: SizeError) -> Self {
        Self::Size(error)
    }
}

impl From<ClosureError> for VerifyError {
    fn from(error: ClosureError) -> Self {
        Self::LoopClosure(error)
    }
}
