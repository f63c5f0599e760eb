//! Errors of reading and writing files of parameters.

use core::fmt;

use regen_runtime::SizeError;

use crate::feasibility::FeasibilityError;

/// Error of reading or writing a file of parameters.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum FileError {
    /// The text is not valid JSON or YAML: the reason, with line and column.
    Syntax(String),
    /// The content is neither a file of identified parameters, for this reason, nor an object of
    /// labels with numbers.
    NoParameters(String),
    /// A part of the file is none that belongs to the model.
    Content {
        /// The part, such as `parameters, row 3`.
        place: String,
        /// The reason.
        why: String,
    },
    /// The parameters belong to another model.
    Digest {
        /// The robot that the file names.
        robot: String,
        /// The digest in the file.
        found: String,
        /// The digest of the given model.
        expected: String,
    },
    /// Base parameters have no value; their labels.
    Missing(Vec<String>),
    /// The friction of a joint has an unknown law or lacks a coefficient.
    Friction {
        /// The joint.
        joint: String,
        /// The reason.
        why: String,
    },
    /// The covariance is not a triangle of finite numbers with a row for each label.
    Covariance,
    /// The model's parameters have labels that no body or joint has.
    ParameterLayout(FeasibilityError),
    /// The number of values does not fit the model.
    Size(SizeError),
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Syntax(why) => f.write_str(why),
            Self::NoParameters(why) => write!(
                f,
                "is neither a file of identified parameters ({why}) nor an object of labels with \
                 numbers"
            ),
            Self::Digest {
                robot,
                found,
                expected,
            } => write!(
                f,
                "these are parameters of {robot} with the digest {found}, the spec's model has \
                 {expected}: identify again with this spec"
            ),
            Self::Content { place, why } => write!(f, "{place}: {why}"),
            Self::Covariance => f.write_str(
                "`covariance` is not a triangle of finite numbers with a row for each of its labels",
            ),
            Self::Missing(labels) => write!(f, "values are missing for {}", labels.join(", ")),
            Self::Friction { joint, why } => write!(f, "friction of {joint}: {why}"),
            Self::ParameterLayout(why) => write!(f, "{why}"),
            Self::Size(why) => write!(f, "{why}"),
        }
    }
}

impl core::error::Error for FileError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::ParameterLayout(why) => Some(why),
            Self::Size(why) => Some(why),
            _ => None,
        }
    }
}

impl From<FeasibilityError> for FileError {
    fn from(why: FeasibilityError) -> Self {
        Self::ParameterLayout(why)
    }
}

impl From<SizeError> for FileError {
    fn from(why: SizeError) -> Self {
        Self::Size(why)
    }
}
