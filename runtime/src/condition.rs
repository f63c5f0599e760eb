//! The conditioning of the linear solve with the constraint Jacobian.

use crate::Scalar;

/// A state counts as singular where the pivot (without unit) is below this or NaN: what is solved
/// there is meaningless.
pub const SINGULAR: f64 = 1e-10;

/// A state counts as nearly singular where the pivot (without unit) is below this: about four of
/// sixteen digits are lost.
pub const NEAR_SINGULAR: f64 = 1e-4;

/// The conditioning of A_e, the constraint Jacobian of the dependent coordinates (Eq. 9).
///
/// Functions that solve with the mass matrix M report the worse of the two: for M its pivots relative
/// to its diagonal, and 0 or NaN where M is not positive definite.
///
/// It is a numerical outcome, not an error: functions return it at singular states too.
///
/// ```
/// use regen_runtime::{Condition, Status};
///
/// assert_eq!(Condition { pivot: 0.3 }.status(), Status::Regular);
/// assert_eq!(Condition { pivot: 1e-7 }.status(), Status::NearSingular);
/// assert_eq!(Condition { pivot: f64::NAN }.status(), Status::Singular);
/// ```
#[must_use]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Condition<T> {
    /// The smallest pivot of A_e relative to its usual size, without unit: about 1 in the middle of
    /// the workspace, 0 at a singularity, NaN if the state is not finite.
    pub pivot: T,
}

/// The class of a [`Condition`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Status {
    /// The pivot is at least [`NEAR_SINGULAR`]: the solve is accurate.
    Regular,
    /// The pivot is below [`NEAR_SINGULAR`]: digits are lost.
    NearSingular,
    /// The pivot is below [`SINGULAR`] or NaN.
    Singular,
}

impl<T: Scalar> Condition<T> {
    /// The condition of a mechanism without loops, pivot 1, in the shape of `proto`.
    #[inline]
    pub fn regular(proto: T) -> Self {
        Self {
            pivot: proto.splat(1.0),
        }
    }

    /// The condition of a state without loops: pivot 1, but NaN in lanes where an entry is not finite.
    ///
    /// - `proto`: any value in the shape of the entries;
    /// - `state`: coordinates and their derivatives, as many lists as a function takes.
    ///
    /// ```
    /// use regen_runtime::Condition;
    ///
    /// assert!(Condition::of_state(0.0, &[&[0.1, 0.2], &[3.0, 0.0]]).is_regular());
    /// assert!(!Condition::of_state(0.0, &[&[0.1, f64::NAN]]).is_regular());
    /// assert!(!Condition::of_state(0.0, &[&[0.1], &[f64::INFINITY]]).is_regular());
    /// ```
    #[allow(
        clippy::inline_always,
        reason = "lanes keep the caller's instruction set"
    )]
    #[inline(always)]
    pub fn of_state(proto: T, state: &[&[T]]) -> Self {
        let zero = proto.splat(0.0);
        let mut sum = zero;
        for list in state {
            sum = sum + list.iter().fold(zero, |sum, x| sum + *x);
        }
        // zero times a finite sum is zero, and NaN for all others
        Self {
            pivot: sum.mul_add(zero, proto.splat(1.0)),
        }
    }

    /// The worse of two conditions, lane by lane.
    ///
    /// ```
    /// use regen_runtime::Condition;
    /// let worst = Condition { pivot: 0.3 }.worst(Condition { pivot: 0.2 });
    /// assert_eq!(worst.pivot, 0.2);
    /// ```
    #[inline]
    pub fn worst(self, other: Self) -> Self {
        Self {
            pivot: Scalar::min(self.pivot, other.pivot),
        }
    }

    /// Whether every lane is [`Status::Regular`].
    ///
    /// ```
    /// use regen_runtime::Condition;
    /// assert!(Condition::regular(0.0_f32).is_regular());
    /// assert!(!Condition { pivot: f32::NAN }.is_regular());
    /// ```
    #[inline]
    pub fn is_regular(self) -> bool {
        // unlike `status`, a pivot equal to the bound is not regular: slightly on the safe side
        T::all(self.pivot.splat(NEAR_SINGULAR).less(self.pivot))
    }
}

impl Condition<f64> {
    /// The class by [`SINGULAR`] and [`NEAR_SINGULAR`].
    pub fn status(self) -> Status {
        if self.pivot >= NEAR_SINGULAR {
            Status::Regular
        } else if self.pivot >= SINGULAR {
            Status::NearSingular
        } else {
            Status::Singular
        }
    }
}
