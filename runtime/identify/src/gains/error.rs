//! Errors of fits with unknown gains and payloads.

use core::fmt;

use crate::data::DataError;
use crate::estimate::EstimateError;
use crate::feasibility::FeasibilityError;
use regen_runtime::SizeError;

/// The largest number of names of unknowns that a message lists.
const MAX_NAMED: usize = 12;

/// A direction in which all unknowns may change together without any effect on the runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Free {
    /// The unknowns that change.
    pub names: Vec<String>,
    /// Whether gains are among them: then the direction is a scale that nothing determines.
    pub is_scale: bool,
}

/// Error of a fit with unknown gains and payloads.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum GainError {
    /// The logs cannot be used.
    Data(DataError),
    /// The runs leave unknowns undetermined.
    Undetermined {
        /// The number of independent combinations of unknowns that the runs determine.
        rank: usize,
        /// The number of unknowns.
        unknowns: usize,
        /// The undetermined directions.
        free: Vec<Free>,
    },
    /// The robot has more or fewer drives than degrees of freedom: the errors of the currents cannot
    /// be separated.
    Drives {
        /// The number of actuated coordinates.
        actuated: usize,
        /// The degrees of freedom.
        dof: usize,
    },
    /// The plan has an unknown gain of a coordinate without an effort.
    NoEffort(String),
    /// The current of this coordinate is 0 throughout, so that it has no gain.
    NoCurrent(String),
    /// The gain of this coordinate that another identification found is 0 or not finite.
    NoGain(String),
    /// The model has no separate base parameters of a body with this label.
    NoPayload(String),
    /// The inertia of this payload is given without its mass or its centre of mass: its parameters
    /// are then not a convex set.
    InertiaAlone(String),
    /// The physical parameters were not found.
    Feasibility(FeasibilityError),
    /// Everything is known.
    NothingUnknown,
    /// The search did not converge.
    NotConverged,
    /// The equations are energy balances, in which the gains of the efforts cannot be separated.
    EnergyBalance,
}

impl fmt::Display for GainError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Data(why) => write!(f, "{why}"),
            Self::Undetermined {
                rank,
                unknowns,
                free,
            } => {
                write!(f, "the runs determine {rank} of {unknowns} unknowns")?;
                for direction in free {
                    let named = direction.names.iter().take(MAX_NAMED);
                    let named: Vec<&str> = named.map(String::as_str).collect();
                    let more = match direction.names.len().saturating_sub(MAX_NAMED) {
                        0 => String::new(),
                        count => format!(" and {count} more"),
                    };
                    let what = if direction.is_scale {
                        "nothing determines the scale of"
                    } else {
                        "undetermined:"
                    };
                    write!(f, "; {what} {}{more}", named.join(", "))?;
                }
                if free.iter().any(|direction| direction.is_scale) {
                    f.write_str(
                        ". A known gain would determine it, or a run with a payload of known mass",
                    )
                } else {
                    f.write_str(". Excite these by another trajectory")
                }
            }
            Self::Drives { actuated, dof } => write!(
                f,
                "{actuated} drives for {dof} degrees of freedom: unknown gains and payloads are \
                 identified only if both numbers are equal"
            ),
            Self::NoEffort(name) => write!(f, "`{name}` has no effort whose gain could be unknown"),
            Self::NoCurrent(name) => {
                write!(f, "the current of `{name}` is 0 throughout: it has no gain")
            }
            Self::NoGain(name) => write!(f, "the known gain of `{name}` is 0 or not a number"),
            Self::NoPayload(label) => write!(
                f,
                "the model has no base parameters of the body `{label}` alone: it is not a payload, \
                 or no effort depends on it"
            ),
            Self::InertiaAlone(body) => write!(
                f,
                "the inertia of `{body}` is given without its mass or its centre of mass: for \
                 --feasible give these too, or leave the inertia out"
            ),
            Self::Feasibility(why) => write!(f, "{why}"),
            Self::NothingUnknown => {
                f.write_str("the parameters of the robot are given, and neither a payload nor a gain is unknown: there is \
                     nothing to identify")
            }
            Self::NotConverged => f.write_str(
                "the search for gains and payload did not converge: state a gain, or more known \
                 parameters of the payload",
            ),
            Self::EnergyBalance => f.write_str(
                "gains and payloads are identified from the equations of motion, not from energy",
            ),
        }
    }
}

impl core::error::Error for GainError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Data(why) => Some(why),
            Self::Feasibility(why) => Some(why),
            _ => None,
        }
    }
}

impl From<DataError> for GainError {
    fn from(why: DataError) -> Self {
        Self::Data(why)
    }
}

impl From<FeasibilityError> for GainError {
    fn from(why: FeasibilityError) -> Self {
        match why {
            FeasibilityError::Estimate(why) => why.into(),
            why => Self::Feasibility(why),
        }
    }
}

impl From<EstimateError> for GainError {
    fn from(why: EstimateError) -> Self {
        Self::Data(why.into())
    }
}

impl From<SizeError> for GainError {
    fn from(why: SizeError) -> Self {
        Self::Data(EstimateError::from(why).into())
    }
}
