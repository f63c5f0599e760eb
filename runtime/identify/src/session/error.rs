//! Errors of an identification session.

use core::fmt;

use regen_runtime::{ClosureError, Friction, SizeError};

use crate::data::DataError;
use crate::estimate::EstimateError;
use crate::feasibility::FeasibilityError;
use crate::gains::GainError;

/// Error of an identification session.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum SessionError {
    /// The logs cannot be used, or their equations do not determine the parameters.
    Data(DataError),
    /// The physically feasible parameters were not found.
    Feasibility(FeasibilityError),
    /// Unknown gains or payloads were not found.
    Gains(GainError),
    /// The robot of this name has no nominal values that could be priors.
    NoNominal(String),
    /// The robot of this name has no joint with nonlinear friction that could be identified.
    NoNonlinearFriction(String),
    /// Fewer than two logs were given for cross-validation.
    TooFewLogs,
    /// QR factors belong to another model.
    Digest {
        /// The index of the factors among those given.
        place: usize,
        /// The robot that the file names.
        robot: String,
        /// The digest in the file.
        found: String,
        /// The digest of the given model.
        expected: String,
    },
    /// QR factors are none that an observation of the model gives.
    Origin {
        /// The index of the factors among those given.
        place: usize,
        /// What differs: `robot`, `kind`, `efforts` or `labels`.
        what: &'static str,
        /// What the file has.
        found: String,
        /// What it has to have.
        expected: String,
    },
    /// Delays were to be estimated from energy balances, which do not determine them.
    DelaysFromEnergyBalance,
    /// No base parameter is well identified.
    NoWellIdentifiedParameter,
}

impl fmt::Display for SessionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Data(why) => write!(f, "{why}"),
            Self::Feasibility(why) => write!(f, "{why}"),
            Self::Gains(why) => write!(f, "{why}"),
            Self::NoNominal(robot) => write!(
                f,
                "{robot} has no nominal values to believe in: give `bodies:` and `nominal:` in the \
                 spec"
            ),
            Self::NoNonlinearFriction(robot) => {
                write!(
                    f,
                    "{robot} has no nonlinear friction: give joints `friction: "
                )?;
                let laws = Friction::ALL.iter().filter(|law| !law.is_linear());
                let words: Vec<&str> = laws.map(|law| law.name()).collect();
                match words.split_last() {
                    Some((last, others)) if !others.is_empty() => {
                        write!(f, "{}` or `{last}` in the spec", others.join("`, `"))
                    }
                    _ => write!(f, "{}` in the spec", words.join("")),
                }
            }
            Self::TooFewLogs => f.write_str("logs that predict each other must be two or more"),
            Self::Digest {
                robot,
                found,
                expected,
                ..
            } => write!(
                f,
                "these are factors of {robot} with the digest {found}, the spec's model has \
                 {expected}: observe again with this spec"
            ),
            Self::Origin {
                what,
                found,
                expected,
                ..
            } => write!(
                f,
                "`{what}` is `{found}` and has to be `{expected}`: observe again with this spec"
            ),
            Self::DelaysFromEnergyBalance => {
                f.write_str("delays are found from the equations of motion, not from energy")
            }
            Self::NoWellIdentifiedParameter => {
                f.write_str("no base parameter is well identified: excite the robot more")
            }
        }
    }
}

impl core::error::Error for SessionError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Data(why) => Some(why),
            Self::Feasibility(why) => Some(why),
            Self::Gains(why) => Some(why),
            _ => None,
        }
    }
}

impl From<DataError> for SessionError {
    fn from(why: DataError) -> Self {
        Self::Data(why)
    }
}

impl From<EstimateError> for SessionError {
    fn from(why: EstimateError) -> Self {
        Self::Data(why.into())
    }
}

impl From<FeasibilityError> for SessionError {
    fn from(why: FeasibilityError) -> Self {
        Self::Feasibility(why)
    }
}

impl From<GainError> for SessionError {
    /// What is wrong with the logs alone is an error of the data.
    fn from(why: GainError) -> Self {
        match why {
            GainError::Data(why) => Self::Data(why),
            other => Self::Gains(other),
        }
    }
}

impl From<ClosureError> for SessionError {
    fn from(why: ClosureError) -> Self {
        Self::Data(why.into())
    }
}

impl From<SizeError> for SessionError {
    fn from(why: SizeError) -> Self {
        Self::Data(why.into())
    }
}
