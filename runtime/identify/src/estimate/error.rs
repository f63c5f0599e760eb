//! The errors of the estimators.

use core::fmt;

use crate::signals::SignalError;
use regen_runtime::SizeError;

/// Why an estimate was not made.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum EstimateError {
    /// A slice or list has the wrong length.
    Size {
        /// The name of the argument.
        what: &'static str,
        /// The required length.
        expected: usize,
        /// The length that was given.
        got: usize,
    },
    /// A part of a factor has a value that no factor has.
    Impossible {
        /// The part, with its row where it has several.
        what: String,
        /// The reason.
        why: &'static str,
    },
    /// An entry is NaN or infinite.
    NotFinite {
        /// The name of the matrix or list that contains the entry.
        what: &'static str,
        /// The row of the entry, from 0.
        row: usize,
    },
    /// Two factors, or sets of factors, cannot be merged because they differ.
    Mismatch {
        /// What differs: `columns`, `robots`, `models`, `kinds of observation` or `efforts`.
        what: &'static str,
        /// The value of the first factor.
        left: String,
        /// The value of the other factor.
        right: String,
    },
    /// There are fewer rows than parameters.
    TooShort {
        /// The number of rows.
        rows: usize,
        /// The number of parameters to estimate.
        parameters: usize,
        /// Labels of the parameters that take part in undetermined combinations.
        labels: Vec<String>,
        /// The number of rows that were left out because joints rest there, or within the filter's
        /// memory around them.
        resting: usize,
    },
    /// The data leave some parameters undetermined.
    Undetermined {
        /// The number of independent combinations of parameters that the data determine.
        rank: usize,
        /// The number of parameters to estimate.
        parameters: usize,
        /// Labels of the parameters that take part in undetermined combinations.
        labels: Vec<String>,
        /// The smallest singular value divided by the largest, with columns scaled to unit length.
        reciprocal_condition: f64,
    },
    /// All efforts are 0 in all equations.
    NoEfforts,
    /// A matrix decomposition did not converge.
    NoConvergence,
    /// The equations cannot be filtered.
    Signal(SignalError),
}

impl EstimateError {
    /// The same error with the number of rows that rests left out, if there were too few.
    pub(crate) fn beside_rests(mut self, left_out: usize) -> Self {
        if let Self::TooShort { resting, .. } = &mut self {
            *resting = left_out;
        }
        self
    }
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
            Self::Impossible { what, why } => write!(f, "{what} {why}"),
            Self::Mismatch { what, left, right } => {
                write!(f, "the {what} differ: {left} and {right}")
            }
            Self::TooShort {
                rows,
                parameters,
                labels,
                resting,
            } => {
                write!(
                    f,
                    "{rows} equations cannot determine {parameters} parameters"
                )?;
                if !labels.is_empty() {
                    write!(f, " (undetermined: {})", labels.join(", "))?;
                }
                if *resting > 0 {
                    write!(
                        f,
                        "; {resting} more were left out because joints rest there, or within the \
                         memory of a filter, which a higher cutoff shortens"
                    )?;
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
                 trajectory, or leave them out by `base: {{drop: [LABEL, ...]}}` in the spec",
                labels.join(", ")
            ),
            Self::NoEfforts => f.write_str(
                "all efforts are 0, so that nothing can be identified: they are not measured, or their columns \
                 are others",
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
