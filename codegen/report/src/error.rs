//! Errors of the report and of the view of a mechanism in motion.

use std::error::Error;
use std::fmt;

use regen_identify::data::DataError;
use regen_runtime::{ClosureError, Outcome, SizeError};

/// Why a report cannot be made.
#[derive(Debug)]
#[non_exhaustive]
pub enum ReportError {
    /// There is no log to show.
    NoLog,
    /// A log cannot be read or predicted.
    Log(DataError),
    /// The model refuses a state of a log.
    Model(ClosureError),
    /// A figure cannot be drawn.
    Drawing(Box<dyn Error + Send + Sync>),
}

impl fmt::Display for ReportError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoLog => f.write_str("a report needs a log"),
            Self::Log(error) => error.fmt(f),
            Self::Model(error) => error.fmt(f),
            Self::Drawing(why) => write!(f, "cannot draw a figure: {why}"),
        }
    }
}

impl Error for ReportError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::NoLog => None,
            // these variants display the inner error itself, so its source is the next one
            Self::Log(error) => error.source(),
            Self::Model(error) => error.source(),
            Self::Drawing(why) => Some(&**why),
        }
    }
}

impl From<DataError> for ReportError {
    fn from(error: DataError) -> Self {
        Self::Log(error)
    }
}

impl From<ClosureError> for ReportError {
    fn from(error: ClosureError) -> Self {
        Self::Model(error)
    }
}

impl From<SizeError> for ReportError {
    fn from(error: SizeError) -> Self {
        Self::Model(error.into())
    }
}

/// Why a mechanism cannot be shown in motion.
#[derive(Debug)]
#[non_exhaustive]
pub enum ViewError {
    /// The loops cannot be closed along the motion.
    NotFollowed {
        /// The time of the failure, in s from the beginning.
        time: f64,
        /// How solving the loops ended.
        outcome: Outcome,
    },
    /// The model refuses a state or its sizes do not agree.
    Model(ClosureError),
}

impl fmt::Display for ViewError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFollowed { time, outcome } => write!(
                f,
                "the motion cannot be followed after {time:.2} s: {outcome}"
            ),
            Self::Model(error) => error.fmt(f),
        }
    }
}

impl Error for ViewError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::NotFollowed { .. } => None,
            Self::Model(error) => error.source(),
        }
    }
}

impl From<ClosureError> for ViewError {
    fn from(error: ClosureError) -> Self {
        Self::Model(error)
    }
}
