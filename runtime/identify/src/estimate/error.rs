//! What keeps an estimate from being made.

use core::fmt;

use crate::signals::SignalError;
use regen_runtime::SizeError;

/// Why an estimate was not made.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum EstimateError {
    /// Slices or lists whose lengths do not fit each other.
    Size {
        /// What has the wrong length.
        what: &'static str,
        /// The length it must have.
        expected: usize,
        /// The length it had.
        got: usize,
    },
    /// An entry that is NaN or infinite.
    NotFinite {
        /// What holds it.
        what: &'static str,
        /// Its row, from 0.
        row: usize,
    },
    /// Factors that do not belong together.
    Mismatch {
        /// What differs: `columns`, `efforts`, `model`.
        what: &'static str,
        /// What the first has.
        left: String,
        /// What the other has.
        right: String,
    },
    /// Fewer rows than parameters.
    TooShort {
        /// Rows there are.
        rows: usize,
        /// Parameters asked for.
        parameters: usize,
        /// Labels of the parameters that have a part in what is not determined.
        labels: Vec<String>,
    },
    /// The data leave parameters undetermined.
    Undetermined {
        /// How many independent combinations the data determine.
        rank: usize,
        /// How many parameters were asked for.
        parameters: usize,
        /// Labels of the parameters that have a part in what is not determined.
        labels: Vec<String>,
        /// The smallest singular value as a part of the largest, columns scaled.
        reciprocal_condition: f64,
    },
    /// A decomposition that did not converge.
    NoConvergence,
    /// Equations that cannot be filtered.
    Signal(SignalError),
}

impl fmt::Display for EstimateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size {
                what,
                expected,
                got,
            } => write!(f, "{what}: {got} entries where {expected} are needed"),
            Self::NotFinite { what, row } => {
                write!(f, "{what}: row {row} holds a value that is not finite")
            }
            Self::Mismatch { what, left, right } => {
                write!(f, "the {what} differ: {left} and {right}")
            }
            Self::TooShort {
                rows,
                parameters,
                labels,
            } => {
                write!(
                    f,
                    "{rows} equations cannot determine {parameters} parameters"
                )?;
                if !labels.is_empty() {
                    write!(f, " (undetermined: {})", labels.join(", "))?;
                }
                f.write_str(": give a longer log")
            }
            Self::Undetermined {
                rank,
                parameters,
                labels,
                reciprocal_condition,
            } => write!(
                f,
                "the data determine {rank} of {parameters} parameters (reciprocal condition \
                 {reciprocal_condition:.1e}); undetermined: {}. Excite these by another \
                 trajectory, or leave them out",
                labels.join(", ")
            ),
            Self::NoConvergence => f.write_str("the singular values were not found"),
            Self::Signal(why) => write!(f, "{why}"),
        }
    }
}

impl core::error::Error for EstimateError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Signal(error) => Some(error),
            _ => None,
        }
    }
}

impl From<SizeError> for EstimateError {
    fn from(error: SizeError) -> Self {
        Self::Size {
            what: error.argument,
            expected: error.expected,
            got: error.got,
        }
    }
}

impl From<SignalError> for EstimateError {
    fn from(error: SignalError) -> Self {
        Self::Signal(error)
    }
}
