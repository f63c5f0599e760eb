//! The errors of the feasibility functions.

use core::fmt;

use crate::estimate::EstimateError;

/// Why feasible parameters could not be computed.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum FeasibilityError {
    /// A list has the wrong length.
    Size {
        /// The name of the argument.
        what: &'static str,
        /// The required length.
        expected: usize,
        /// The length that was given.
        got: usize,
    },
    /// An entry is NaN or infinite, or a unit or standard deviation is not positive.
    NotFinite {
        /// The name of the argument that contains the entry.
        what: &'static str,
        /// The index of the entry.
        index: usize,
    },
    /// A label is not among the parameters or bodies.
    Unknown {
        /// The kind of thing that the label should name, such as `parameter` or `body`.
        what: &'static str,
        /// The label.
        label: String,
    },
    /// A body lacks one of its ten parameters.
    Incomplete {
        /// The label of the body.
        body: String,
        /// The label of the missing parameter.
        missing: String,
    },
    /// A label occurs twice.
    Duplicate {
        /// The label.
        label: String,
    },
    /// A reference body of an entropic prior is not strictly physical.
    Reference {
        /// The label of the body.
        body: String,
    },
    /// A constraint contradicts the others; the text describes the constraint and its source.
    Contradiction(String),
    /// A constraint can have no effect; the text explains why.
    Idle(String),
    /// The least-squares estimate failed.
    Estimate(EstimateError),
    /// The conic solver failed; the text is its message.
    Solver(String),
}

impl fmt::Display for FeasibilityError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size {
                what,
                expected,
                got,
            } => write!(f, "{what}: {got} entries where {expected} are needed"),
            Self::NotFinite { what, index } => {
                write!(f, "{what}: entry {index} is not finite, or is not positive")
            }
            Self::Unknown { what, label } => write!(f, "there is no {what} `{label}`"),
            Self::Incomplete { body, missing } => write!(
                f,
                "body `{body}` lacks the parameter `{missing}`: feasibility needs all ten inertial \
                 parameters of a body"
            ),
            Self::Duplicate { label } => write!(f, "`{label}` occurs twice"),
            Self::Reference { body } => write!(
                f,
                "no physical body has the reference values of body `{body}`: an entropic prior \
                 needs a positive definite pseudo-inertia"
            ),
            Self::Contradiction(what) => {
                write!(
                    f,
                    "{what} cannot hold: it contradicts the rest of what is known"
                )
            }
            Self::Idle(why) => write!(f, "{why}"),
            Self::Estimate(error) => error.fmt(f),
            Self::Solver(message) => write!(f, "the conic solver failed: {message}"),
        }
    }
}

impl core::error::Error for FeasibilityError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Estimate(error) => Some(error),
            _ => None,
        }
    }
}

impl From<EstimateError> for FeasibilityError {
    fn from(error: EstimateError) -> Self {
        Self::Estimate(error)
    }
}

/// Fails unless a list has the expected length.
pub(super) fn size(
    what: &'static str,
    expected: usize,
    got: usize,
) -> Result<(), FeasibilityError> {
    if expected == got {
        return Ok(());
    }
    Err(FeasibilityError::Size {
        what,
        expected,
        got,
    })
}

/// Fails if an entry is NaN or infinite.
pub(super) fn finite(what: &'static str, values: &[f64]) -> Result<(), FeasibilityError> {
    match values.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(FeasibilityError::NotFinite { what, index }),
        None => Ok(()),
    }
}
