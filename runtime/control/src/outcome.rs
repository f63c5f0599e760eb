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
