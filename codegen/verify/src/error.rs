//! Errors that prevent a robot from being checked.

use std::fmt;

use regen_runtime::{ClosureError, Outcome, SizeError};

/// The reason why a robot could not be checked.
#[derive(Debug)]
#[non_exhaustive]
pub enum VerifyError {
    /// The sizes of a robot's functions contradict its description.
    Size(SizeError),
    /// Loop closure is not possible for the robot.
    LoopClosure(ClosureError),
    /// No closed state was found near home.
    NotClosed {
        /// The robot.
        robot: String,
        /// The result of the last attempt.
        outcome: Outcome,
    },
    /// The robot was derived without base parameters.
    NoBase {
        /// The robot.
        robot: String,
        /// Number of dynamic parameters of the robot.
        parameters: usize,
    },
    /// An observation matrix over the given number of states has fewer rows than columns.
    TooFewStates {
        /// The robot.
        robot: String,
        /// The given number of states.
        states: usize,
        /// The number of rows that these states give.
        rows: usize,
        /// The number of columns of the matrix.
        columns: usize,
        /// The least number of states that gives enough rows.
        least: usize,
    },
    /// The regressor is not finite at a random closed state.
    NotFinite {
        /// The robot.
        robot: String,
    },
    /// The iteration for the singular values of the observation matrix did not converge.
    NoSingularValues {
        /// The robot.
        robot: String,
    },
    /// The second derivation cannot read the robot's spec.
    UnreadableSpec(String),
    /// The coordinates or parameters of the second derivation are not those of the robot.
    DifferentNames {
        /// The robot.
        robot: String,
    },
    /// The second derivation cannot compute the forces at a state.
    ReferenceFailed(String),
    /// The reference vectors cannot be read.
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
            Self::UnreadableSpec(why) => write!(f, "the second derivation cannot read this: {why}"),
            Self::DifferentNames { robot } => write!(
                f,
                "{robot}: the second derivation reads other coordinates or parameters in this spec"
            ),
            Self::ReferenceFailed(why) => write!(f, "second derivation: {why}"),
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
