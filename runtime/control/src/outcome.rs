//! The outcomes of a call, and the errors of the constructor.

use core::fmt;

/// The result of a call: a numerical outcome, not an error. Unless it is [`Outcome::Closed`], the
/// closure stays at the last closed state that it reached.
#[must_use]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome<T> {
    /// The loops are closed at the requested independent coordinates.
    Closed,
    /// The allowed number of Newton steps is used up. The loops are closed at the fraction `at` of
    /// the way, and the next call continues from there.
    Unfinished {
        /// The fraction of the straight line that was reached, from 0 to 1.
        at: T,
    },
    /// A_e is singular at the last state, or becomes so: a fold of the branch or a crossing of
    /// branches.
    Singular {
        /// The fraction of the straight line that was reached, from 0 to 1.
        at: T,
    },
    /// Even the shortest step was refused although A_e is regular: Newton's method did not
    /// converge, or A_e changed too much to be sure of the branch.
    Lost {
        /// The fraction of the straight line that was reached, from 0 to 1.
        at: T,
    },
    /// A requested coordinate is NaN or infinite.
    NotFinite,
}

impl<T> Outcome<T> {
    /// Whether the loops are closed at the requested independent coordinates.
    pub fn is_closed(&self) -> bool {
        matches!(self, Self::Closed)
    }
}

/// The reason why a closure cannot be made for a model: sizes that are not the model's, a home near
/// which the loops cannot be closed, or a length that is not positive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ClosureError {
    /// A const argument of the closure differs from the model's size.
    Size {
        /// What the argument counts.
        of: &'static str,
        /// The number that the model has.
        expected: usize,
        /// The number that the closure has.
        got: usize,
    },
    /// The model's `Info` does not name each coordinate once as independent or dependent.
    Partition,
    /// Newton's method does not close the loops within 0.25 rad or typical lengths of home, or A_e
    /// is singular there.
    Home,
    /// The typical length is not positive and finite.
    Length,
}

impl fmt::Display for ClosureError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size { of, expected, got } => {
                write!(f, "the closure has {got} {of}, the model has {expected}")
            }
            Self::Partition => {
                write!(
                    f,
                    "a coordinate is not listed once as independent or dependent"
                )
            }
            Self::Home => write!(f, "the loops cannot be closed at home, or home is singular"),
            Self::Length => write!(f, "the typical length is not positive and finite"),
        }
    }
}

impl core::error::Error for ClosureError {}

/// The reason why a setting is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SettingError {
    /// A value must be positive and finite.
    NotPositive {
        /// What the value is.
        of: &'static str,
    },
    /// A value must be zero or above, and finite.
    Negative {
        /// What the value is.
        of: &'static str,
    },
    /// A value must be finite, and not so large that its products overflow.
    NotFinite {
        /// What the value is.
        of: &'static str,
    },
    /// The bandwidth times the period is above 1: the filter would be faster than the cycle.
    Bandwidth,
    /// The block is shorter than four time constants of the filter.
    Block,
    /// A probability is 1 or above.
    Probability,
    /// The parameters do not list ten inertial parameters of each of as many bodies as are expected.
    Bodies,
    /// The values to start from are not those of a physical body: a pseudo-inertia is not positive
    /// definite, or a value that cannot be negative is not positive.
    Start,
}

impl fmt::Display for SettingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotPositive { of } => write!(f, "the {of} must be positive and finite"),
            Self::Negative { of } => write!(f, "the {of} must be zero or above, and finite"),
            Self::NotFinite { of } => write!(f, "the {of} must be finite, and not as large"),
            Self::Bandwidth => write!(
                f,
                "the bandwidth (rad/s) times the period (s) is above 1: choose a slower filter or a \
                 shorter period"
            ),
            Self::Block => write!(
                f,
                "a block (s) times the bandwidth (rad/s) is below 4: choose longer blocks"
            ),
            Self::Probability => write!(f, "a probability must be below 1"),
            Self::Bodies => write!(
                f,
                "the parameters do not list ten inertial parameters of each expected body"
            ),
            Self::Start => write!(
                f,
                "the values to start from are not physical: choose masses and inertias of solid \
                 bodies, and friction and rotors above zero"
            ),
        }
    }
}

impl core::error::Error for SettingError {}

/// What a call did with its measurements.
#[must_use]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sample {
    /// The first sample: filters start from it, and it says nothing yet.
    First,
    /// The sample counts.
    Taken,
    /// A number is NaN, infinite or so large that its products overflow. Nothing has changed.
    Refused,
}
