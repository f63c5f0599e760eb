//! Loop closure: computes all coordinates from the independent ones, on one assembly branch.
//!
//! The closure equations are f(q) = 0 (Eq. 6). A is their Jacobian (Eq. 7), and A_e its square part
//! (Eq. 8): the columns of the dependent coordinates, and as many rows, those that are not
//! redundant. Below, n is the number of all coordinates and dof that of the independent ones.
//!
//! For the same independent coordinates the closure equations of a mechanism have several
//! solutions: its assembly branches. The branch solved here is the set of states that can be
//! reached from `home` while A_e stays regular and its determinant keeps its sign. A state is found
//! by continuation along the straight line in the independent coordinates, with a predictor (the
//! velocities, Eq. 9) and a corrector (Newton's method).
//!
//! A step is accepted only if two conditions hold. First, the corrector's steps at least halve each
//! time, and together they are short compared to the predictor. Second, A_e changes by at most half
//! of what could make it singular: the largest row sum of `|A_e(old)^-1 A_e(new) - 1|` is at most
//! 1/2, after the columns of both matrices are divided by the largest entries of those of A_e(old).
//! Every matrix between the two is then regular, so that a step cannot leap over a singularity, not
//! even over one where the determinant touches zero and keeps its sign. A step that is refused is
//! halved; where no step is short enough the [`Outcome`] gives the reason.

use alloc::vec;
use alloc::vec::Vec;
use core::fmt;

use crate::{Condition, Info, Model, SizeError, Status};

mod lu;
mod newton;
mod path;
mod scaled;

use newton::Newton;
use path::Point;

/// The result of a closure solve: a numerical outcome, not an error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// The loops are closed at the requested independent coordinates.
    Closed,
    /// Newton's method found no closed state, or the line is too long for the largest number of
    /// steps.
    NotClosed {
        /// The fraction of the straight line that was reached, from 0 to 1; 0 for home.
        at: f64,
        /// The largest |f| where the solve stopped. For home, and where the end of the line was
        /// reached (`at` is 1), rows of f that are lengths are in m; where the continuation stopped
        /// before, they are in [`LoopClosure::length_unit`]. The other rows have no unit.
        residual: f64,
    },
    /// The line meets a singularity of A_e: a fold, where the branch ends, or a crossing of
    /// branches.
    Singular {
        /// The fraction of the line that was reached, from 0 to 1.
        at: f64,
        /// The condition of A_e at the last state.
        condition: Condition<f64>,
    },
    /// Even the shortest step was refused although A_e is regular at the last state: the corrector
    /// moved too far, or A_e changed too much, to be sure that the next state is on the same
    /// branch. This happens where A_e jumps along the line, so that its determinant may change its
    /// sign without a zero.
    BranchLost {
        /// The fraction of the line that was reached, from 0 to 1.
        at: f64,
    },
}

impl Outcome {
    /// Whether the loops are closed at the requested independent coordinates.
    pub fn is_closed(self) -> bool {
        self == Self::Closed
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Closed => write!(f, "closed"),
            Self::NotClosed { at, residual } => {
                write!(
                    f,
                    "not closed at {at:.3} of the way: residual {residual:.1e}"
                )
            }
            Self::Singular { at, condition } => {
                let pivot = condition.pivot;
                write!(f, "singular at {at:.3} of the way: pivot {pivot:.1e}")
            }
            Self::BranchLost { at } => write!(f, "branch lost at {at:.3} of the way"),
        }
    }
}

/// An invalid argument or an inconsistent model: an error of the caller, unlike an [`Outcome`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ClosureError {
    /// An argument's length does not fit the model.
    Size(SizeError),
    /// An entry of an argument is NaN or infinite.
    NotFinite {
        /// The argument's name.
        argument: &'static str,
        /// The index of the entry in the argument.
        index: usize,
    },
    /// The model's `Info` does not name each coordinate once as independent or dependent.
    Partition {
        /// The index of the coordinate.
        coordinate: usize,
    },
}

impl From<SizeError> for ClosureError {
    fn from(error: SizeError) -> Self {
        Self::Size(error)
    }
}

impl fmt::Display for ClosureError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size(error) => error.fmt(f),
            Self::NotFinite { argument, index } => {
                write!(f, "entry {index} of `{argument}` is not a finite number")
            }
            Self::Partition { coordinate } => write!(
                f,
                "coordinate {coordinate} is not listed once as independent or dependent"
            ),
        }
    }
}

impl core::error::Error for ClosureError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Size(error) => Some(error),
            Self::NotFinite { .. } | Self::Partition { .. } => None,
        }
    }
}

/// A configuration found by [`LoopClosure`].
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// All n coordinates, rad or m: the closed state at the target if `outcome` is
    /// [`Outcome::Closed`], else the last state reached on the branch.
    pub q: Vec<f64>,
    /// The largest |f| (Eq. 6) at `q` over all constraint rows, in m or without unit.
    pub residual: f64,
    /// The condition of A_e at `q`.
    pub condition: Condition<f64>,
    /// Whether the loops were closed, or why not.
    pub outcome: Outcome,
    /// The number of continuation steps, refused ones included; for home, the number of Newton
    /// steps.
    pub steps: usize,
}

/// A state of motion found by [`LoopClosure`].
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// All n coordinates, rad or m, as [`Solution::q`].
    pub q: Vec<f64>,
    /// All n velocities (Eq. 9), rad/s or m/s; NaN unless the outcome is [`Outcome::Closed`].
    pub qd: Vec<f64>,
    /// All n accelerations (Eq. 7), rad/s^2 or m/s^2; NaN unless the outcome is
    /// [`Outcome::Closed`].
    pub qdd: Vec<f64>,
    /// The largest |f| (Eq. 6) at `q`, in m or without unit.
    pub residual: f64,
    /// The condition of A_e at `q`. A pivot below 0.1 is replaced by the reciprocal condition
    /// number of A_e with scaled columns, if that is smaller. The rounding errors of `q` are
    /// amplified in the velocities by up to the inverse of this pivot, and in the accelerations by
    /// up to the cube of the inverse.
    pub condition: Condition<f64>,
    /// Whether the loops were closed, or why not.
    pub outcome: Outcome,
}

/// Solves the loop closure of one model, starting from its home or, along a trajectory, from
/// the last solution.
///
/// Mechanisms without loops need no solve, but the same methods work for them.
///
/// ```
/// # mod models { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/models/slider_crank.rs")); }
/// # use models::SliderCrank;
/// use regen_runtime::{LoopClosure, Outcome};
///
/// // Crank 1 m, rod 2 m; q = (crank angle, rod angle, slider), home at crank angle 0.
/// let model = SliderCrank::default();
/// let mut closure = LoopClosure::new(&model)?;
/// let top = closure.solve(&[core::f64::consts::FRAC_PI_2])?;
/// assert_eq!(top.outcome, Outcome::Closed);
/// assert!((top.q[2] - 3.0_f64.sqrt()).abs() < 1e-14);
///
/// // At crank speed 1 rad/s the slider there moves as fast as the crank's end.
/// let state = closure.solve_state(&[core::f64::consts::FRAC_PI_2], &[1.0], &[0.0])?;
/// assert!((state.qd[2] + 1.0).abs() < 1e-14);
/// # Ok::<(), regen_runtime::ClosureError>(())
/// ```
#[derive(Debug)]
pub struct LoopClosure<'m, M: ?Sized> {
    newton: Newton<'m, M>,
    home: Solution,
    /// The states at which lines start: home, and the last closed solution of a `track` call;
    /// `None` if home is not closed or is singular.
    starts: Option<(Point, Point)>,
    /// The largest number of continuation steps to a state.
    max_steps: usize,
    /// The number of continuation steps of all solves.
    taken: usize,
    /// The number of solves that ended because they would have taken more steps.
    given_up: usize,
}

/// The state at which a line in the independent coordinates starts.
#[derive(Clone, Copy)]
enum Start {
    /// The home configuration.
    Home,
    /// The last closed solution of a `track` call, or home before the first.
    Last,
}

impl<'m, M: Model<f64> + ?Sized> LoopClosure<'m, M> {
    /// Closes the loops at the model's home: the independent coordinates keep their values, the
    /// dependent ones are solved by damped Newton iterations. [`home`](LoopClosure::home) returns
    /// the result: a home that does not close, or is singular, is not an error here but an outcome.
    ///
    /// # Errors
    /// When the model's `Info` is inconsistent: [`ClosureError::Size`] for a home of other than n
    /// entries or other wrong lengths, [`ClosureError::NotFinite`] for a home that is not finite,
    /// [`ClosureError::Partition`] for a coordinate that is not listed once.
    pub fn new(model: &'m M) -> Result<Self, ClosureError> {
        let info = model.info();
        check_info(&info)?;
        let mut newton = Newton::new(model)?;
        let mut q = newton.model.to_scaled(info.home);
        let steps = newton.close(&mut q)?;
        let polished_residual = newton.polish(&mut q)?;
        let point = Point::new(&mut newton, q)?;
        let closes = polished_residual <= newton.tolerance(&point.q)?;
        let q = newton.model.to_model_units(&point.q);
        let residual = newton.model_residual(&q)?;
        let condition = point.worst_condition();
        let outcome = if !closes {
            Outcome::NotClosed { at: 0.0, residual }
        } else if condition.status() == Status::Singular {
            Outcome::Singular { at: 0.0, condition }
        } else {
            Outcome::Closed
        };
        let home = Solution {
            q,
            residual,
            condition: point.condition,
            outcome,
            steps,
        };
        let starts = outcome.is_closed().then(|| (point.clone(), point));
        Ok(Self {
            newton,
            home,
            starts,
            max_steps: path::MAX_STEPS,
            taken: 0,
            given_up: 0,
        })
    }

    /// Limits the number of continuation steps to a state; one that takes more is
    /// [`Outcome::NotClosed`]. A path of thousands of rad is followed without a limit.
    pub fn limit_steps(&mut self, steps: usize) {
        self.max_steps = steps.min(path::MAX_STEPS);
    }

    /// The number of continuation steps of all solves so far, refused ones included.
    pub fn steps_taken(&self) -> usize {
        self.taken
    }

    /// The number of solves so far that ended because they would have taken more steps than
    /// [`limit_steps`](Self::limit_steps) allows.
    pub fn given_up(&self) -> usize {
        self.given_up
    }

    /// The unit of length, m, in which residuals and steps are measured: 256^k m with an integer k,
    /// within a factor of 16 of the mechanism's size; so 1 m for mechanisms between a sixteenth of
    /// a metre and 16 m.
    ///
    /// A state counts as closed if every |f| is at most 1e-12 times the size of the terms of the
    /// largest row, the sum of `|A| max(1, |q|)`, in this unit, so that a mechanism of micrometres
    /// is closed as accurately as one of metres.
    pub fn length_unit(&self) -> f64 {
        self.newton.model.length
    }

    /// The closed home, or in its `outcome` the reason why it could not be closed.
    pub fn home(&self) -> &Solution {
        &self.home
    }

    /// Closes the loops at `q_i` (dof, rad or m) on home's branch, along the straight line from
    /// home.
    ///
    /// The result depends on `q_i` alone, not on earlier calls. If home is not closed or is
    /// singular, the result is [`home`](LoopClosure::home) with its outcome, whatever `q_i`.
    ///
    /// # Errors
    /// When `q_i` has a wrong length or an entry that is not finite.
    pub fn solve(&mut self, q_i: &[f64]) -> Result<Solution, ClosureError> {
        Ok(self.solve_from(q_i, Start::Home)?.0)
    }

    /// As [`solve`](LoopClosure::solve), but along the straight line from the last solution of a
    /// `track` call that closed; the first call starts from home.
    ///
    /// For trajectories: short lines cost few steps, and the branch is followed along the path
    /// itself. If home is not closed or is singular, the result is home, as for
    /// [`solve`](LoopClosure::solve).
    ///
    /// # Errors
    /// When `q_i` has a wrong length or an entry that is not finite.
    pub fn track(&mut self, q_i: &[f64]) -> Result<Solution, ClosureError> {
        let (solution, point) = self.solve_from(q_i, Start::Last)?;
        if let (Some(point), Some((_, last))) = (point, &mut self.starts) {
            *last = point;
        }
        Ok(solution)
    }

    /// Makes the next [`track`](LoopClosure::track) or [`track_state`](LoopClosure::track_state)
    /// call start from home again.
    pub fn restart(&mut self) {
        if let Some((home, last)) = &mut self.starts {
            last.clone_from(home);
        }
    }

    /// Makes the next `track` call start from a closed state `q` (n, rad or m) on home's branch,
    /// for callers that have followed the branch themselves. Returns false, and changes nothing,
    /// where `q` is not closed or is singular, or home is.
    ///
    /// # Errors
    /// When `q` has a wrong length or an entry that is not finite.
    pub fn resume(&mut self, q: &[f64]) -> Result<bool, ClosureError> {
        check("q", q, self.home.q.len())?;
        let Some((_, last)) = &mut self.starts else {
            return Ok(false);
        };
        let scaled = self.newton.model.to_scaled(q);
        let closes = self.newton.residual(&scaled)? <= self.newton.tolerance(&scaled)?;
        let point = Point::new(&mut self.newton, scaled)?;
        let usable = closes && point.worst_condition().status() != Status::Singular;
        if usable {
            *last = point;
        }
        Ok(usable)
    }

    /// The units in which steps and residuals are measured: of the n coordinates (1 rad,
    /// [`length_unit`](Self::length_unit) or, for drives, about what one unit of their joints
    /// takes), and of the rows of f.
    pub fn units(&self) -> (&[f64], &[f64]) {
        self.newton.model.units()
    }

    /// As [`solve`](LoopClosure::solve), and computes all velocities and accelerations from the
    /// independent ones (dof each; rad/s or m/s, rad/s^2 or m/s^2).
    ///
    /// # Errors
    /// When an argument has a wrong length or an entry that is not finite.
    pub fn solve_state(
        &mut self,
        q_i: &[f64],
        qd_i: &[f64],
        qdd_i: &[f64],
    ) -> Result<State, ClosureError> {
        self.check_rates(qd_i, qdd_i)?;
        let solution = self.solve(q_i)?;
        self.motion(solution, qd_i, qdd_i)
    }

    /// As [`track`](LoopClosure::track), and computes all velocities and accelerations from the
    /// independent ones (dof each; rad/s or m/s, rad/s^2 or m/s^2).
    ///
    /// # Errors
    /// When an argument has a wrong length or an entry that is not finite.
    pub fn track_state(
        &mut self,
        q_i: &[f64],
        qd_i: &[f64],
        qdd_i: &[f64],
    ) -> Result<State, ClosureError> {
        self.check_rates(qd_i, qdd_i)?;
        let solution = self.track(q_i)?;
        self.motion(solution, qd_i, qdd_i)
    }

    /// Follows the branch from `start` to `q_i`; returns the solution and, if it is closed, the
    /// state to track from next.
    fn solve_from(
        &mut self,
        q_i: &[f64],
        start: Start,
    ) -> Result<(Solution, Option<Point>), ClosureError> {
        check("q_i", q_i, self.newton.independent.len())?;
        let Some((home, last)) = &self.starts else {
            return Ok((self.home.clone(), None));
        };
        let start = match start {
            Start::Home => home,
            Start::Last => last,
        };
        let scaled = self
            .newton
            .model
            .to_scaled_of(&self.newton.independent, q_i);
        let (mut point, mut outcome, steps) =
            path::follow(&mut self.newton, start, &scaled, self.max_steps)?;
        self.taken += steps.taken;
        self.given_up += usize::from(steps.cut);
        let polished_residual = self.newton.polish(&mut point.q)?;
        let closes = polished_residual <= self.newton.tolerance(&point.q)?;
        let q = self.newton.model.to_model_units(&point.q);
        let residual = self.newton.model_residual(&q)?;
        if outcome.is_closed() && !closes {
            outcome = Outcome::NotClosed { at: 1.0, residual };
        }
        let solution = Solution {
            q,
            residual,
            condition: point.condition,
            outcome,
            steps: steps.taken,
        };
        Ok((solution, outcome.is_closed().then_some(point)))
    }

    /// Checks that the independent velocities and accelerations have dof finite entries each.
    fn check_rates(&self, qd_i: &[f64], qdd_i: &[f64]) -> Result<(), ClosureError> {
        check("qd_i", qd_i, self.newton.independent.len())?;
        check("qdd_i", qdd_i, self.newton.independent.len())
    }

    /// Adds velocities and accelerations to a solution; NaN unless it is closed.
    fn motion(
        &mut self,
        solution: Solution,
        qd_i: &[f64],
        qdd_i: &[f64],
    ) -> Result<State, ClosureError> {
        let Solution {
            q,
            residual,
            condition,
            outcome,
            ..
        } = solution;
        let mut qd = vec![f64::NAN; q.len()];
        let mut qdd = vec![f64::NAN; q.len()];
        let mut worst = condition;
        let model = self.newton.model.model;
        if outcome.is_closed() {
            worst = worst.worst(model.velocities(&q, qd_i, &mut qd)?);
            worst = worst.worst(model.accelerations(&q, &qd, qdd_i, &mut qdd)?);
            let scaled = self.newton.model.to_scaled(&q);
            worst = path::refine_condition(&mut self.newton, &scaled, worst)?;
        }
        Ok(State {
            q,
            qd,
            qdd,
            residual,
            condition: worst,
            outcome,
        })
    }
}

/// Checks that the argument has the expected length and finite entries.
fn check(argument: &'static str, values: &[f64], expected: usize) -> Result<(), ClosureError> {
    if values.len() != expected {
        let got = values.len();
        return Err(ClosureError::Size(SizeError {
            argument,
            expected,
            got,
        }));
    }
    match values.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(ClosureError::NotFinite { argument, index }),
        None => Ok(()),
    }
}

/// Checks that home has n entries and that each coordinate is listed once as independent or
/// dependent.
fn check_info(info: &Info<'_>) -> Result<(), ClosureError> {
    let n = info.coordinates.len();
    check("home", info.home, n)?;
    let mut times = vec![0_usize; n];
    for coordinate in info.independent.iter().chain(info.dependent) {
        match times.get_mut(*coordinate) {
            Some(times) => *times += 1,
            None => {
                return Err(ClosureError::Partition {
                    coordinate: *coordinate,
                });
            }
        }
    }
    match times.iter().position(|times| *times != 1) {
        Some(coordinate) => Err(ClosureError::Partition { coordinate }),
        None => Ok(()),
    }
}
