//! Misuse of the feasibility functions.

use core::fmt;

use crate::estimate::EstimateError;

/// Why a question about feasibility could not be asked.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum FeasibilityError {
    /// A list whose length does not fit.
    Size {
        /// What has the wrong length.
        what: &'static str,
        /// The length it must have.
        expected: usize,
        /// The length it had.
        got: usize,
    },
    /// An entry that is NaN or infinite, or a unit or deviation that is not positive.
    NotFinite {
        /// What holds it.
        what: &'static str,
        /// Which entry.
        index: usize,
    },
    /// A label that is not among the parameters or bodies.
    Unknown {
        /// `parameter` or `body`.
        what: &'static str,
        /// The label.
        label: String,
    },
    /// A body without all of its ten parameters.
    Incomplete {
        /// The body.
        body: String,
        /// The parameter that is missing.
        missing: String,
    },
    /// A label twice.
    Duplicate {
        /// The label.
        label: String,
    },
    /// A reference body, for an entropic prior, that is not strictly physical.
    Reference {
        /// The body.
        body: String,
    },
    /// What is asked for contradicts the rest: who asks for it.
    Contradiction(String),
    /// Something that is asked for can have no effect: why.
    Idle(String),
    /// Least squares on the way failed.
    Estimate(EstimateError),
    /// The solver refused the problem.
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
                write!(f, "{what}: entry {index} is not a number that can be used")
            }
            Self::Unknown { what, label } => write!(f, "there is no {what} `{label}`"),
            Self::Incomplete { body, missing } => write!(
                f,
                "body `{body}` has no parameter `{missing}`: feasibility is about all ten"
            ),
            Self::Duplicate { label } => write!(f, "`{label}` is there twice"),
            Self::Reference { body } => write!(
                f,
                "the reference values of body `{body}` are of no physical body: an entropic \
                 prior needs a positive definite pseudo-inertia"
            ),
            Self::Contradiction(what) => {
                write!(
                    f,
                    "{what} cannot hold: it contradicts the rest of what is known"
                )
            }
            Self::Idle(why) => write!(f, "{why}"),
            Self::Estimate(error) => error.fmt(f),
            Self::Solver(message) => write!(f, "the conic solver refused: {message}"),
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

pub(super) fn finite(what: &'static str, values: &[f64]) -> Result<(), FeasibilityError> {
    match values.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(FeasibilityError::NotFinite { what, index }),
        None => Ok(()),
    }
}
