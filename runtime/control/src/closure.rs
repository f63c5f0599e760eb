//! The closure that a control cycle calls.

use core::array::from_fn;

use regen_runtime::{Condition, Info, Model, Motion as Kind, SINGULAR, Scalar};

use crate::factored::Factored;
use crate::outcome::{ClosureError, Outcome};
use crate::real::{Real, largest};

/// The most that a coordinate moves in one predictor step, rad or typical lengths.
const MAX_MOVE: f64 = 0.25;
/// The most that Newton's method may move after a predictor step, relative to that step.
const MAX_CORRECTION: f64 = 0.25;
/// The most that A_e may change in one step, as [`Factored::distance`]: half of what could make it
/// singular.
const MAX_CHANGE: f64 = 0.5;
/// The loops count as closed if the largest |f| is at most this many roundings of the terms of its
/// row.
const CLOSED_ROUNDINGS: f64 = 256.0;
/// The shortest step, in roundings of the independent coordinates.
const SHORTEST_ROUNDINGS: f64 = 4096.0;
/// The most Newton steps that closing the loops at home may take.
const HOME_STEPS: usize = 20;

/// Velocities and accelerations of all coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion<T, const N: usize> {
    /// The velocities (Eq. 9), rad/s or m/s.
    pub qd: [T; N],
    /// The accelerations (Eq. 7), rad/s^2 or m/s^2.
    pub qdd: [T; N],
    /// The condition of A_e at the state: velocities and accelerations have no meaning where it is
    /// singular.
    pub condition: Condition<T>,
}

/// How Newton's method ended.
enum Correction<T> {
    /// Closed, with this condition of A_e.
    Converged(Condition<T>),
    /// It moved too far or converged too slowly, or closure rows that it does not solve are not
    /// satisfied.
    Refused,
    /// The allowed number of Newton steps is used up.
    Spent,
}

/// Follows one assembly branch of a model from cycle to cycle.
///
/// `N` coordinates, of which `DOF` are independent and `E` dependent, and `ROWS` closure rows:
/// [`closure!`](crate::closure) takes them from a generated module.
///
/// A step along the straight line to the requested independent coordinates is a predictor (the
/// velocities, Eq. 9) and a corrector (Newton's method on the rows that the model selects). It is
/// accepted if Newton's steps at least halve each time and are together at most a quarter of the
/// predictor, if all rows are closed, and if A_e changes by at most half of what could make it
/// singular; so it cannot leap over a singularity. A step that is refused is halved.
///
/// Unlike `regen_runtime::LoopClosure`, it does not search for a closed home far from the model's,
/// does not continue where the selected rows of a mechanism with redundant loops lose rank although
/// all rows together do not, and does not find the mechanism's size by itself.
#[derive(Clone, Debug)]
pub struct Closure<
    'm,
    T,
    const N: usize,
    const DOF: usize,
    const E: usize,
    const ROWS: usize,
    M: ?Sized,
> {
    model: &'m M,
    independent: [usize; DOF],
    dependent: [usize; E],
    /// The unit of each coordinate in which steps are measured: 1 rad, or the typical length in m.
    units: [T; N],
    home: State<T, N, E>,
    last: State<T, N, E>,
    /// The most that a coordinate moves in the next predictor step, in its unit: less than
    /// [`MAX_MOVE`] after calls whose steps did not suffice.
    stride: T,
}

/// A closed state with its A_e.
#[derive(Clone, Debug)]
struct State<T, const N: usize, const E: usize> {
    q: [T; N],
    factored: Factored<T, E>,
}

impl<'m, T, const N: usize, const DOF: usize, const E: usize, const ROWS: usize, M>
    Closure<'m, T, N, DOF, E, ROWS, M>
where
    T: Real,
    M: Model<T> + ?Sized,
{
    /// A closure at the model's home, for a mechanism whose links are about a metre long.
    ///
    /// # Errors
    /// When the const arguments are not the model's sizes, or the loops cannot be closed near home.
    pub fn new(model: &'m M) -> Result<Self, ClosureError> {
        Self::with_length(model, T::ONE)
    }

    /// As [`new`](Self::new) with the typical length of the mechanism's links, m: the bounds of
    /// steps measure prismatic coordinates in it.
    ///
    /// # Errors
    /// As [`new`](Self::new), and when the length is not positive and finite.
    pub fn with_length(model: &'m M, length: T) -> Result<Self, ClosureError> {
        if !(length > T::ZERO && length.is_finite()) {
            return Err(ClosureError::Length);
        }
        let info = model.info();
        check(&info, [N, DOF, E, ROWS])?;
        let mut units = [T::ONE; N];
        for (unit, joint) in units.iter_mut().zip(info.joints) {
            if joint.motion == Kind::Translation {
                *unit = length;
            }
        }
        let place = |list: &[usize], k: usize| list.get(k).copied().unwrap_or(N);
        let independent = from_fn(|k| place(info.independent, k));
        let dependent = from_fn(|k| place(info.dependent, k));
        let q = from_fn(|k| T::of(info.home.get(k).copied().unwrap_or(f64::NAN)));
        let state = State {
            q,
            factored: Factored::new(&[[T::ZERO; E]; E]),
        };
        let mut closure = Self {
            model,
            independent,
            dependent,
            units,
            home: state.clone(),
            last: state,
            stride: T::of(MAX_MOVE),
        };
        let mut q = q;
        let mut left = HOME_STEPS;
        let closed = closure.correct(&mut q, T::of(MAX_MOVE), &mut left);
        let Correction::Converged(condition) = closed else {
            return Err(ClosureError::Home);
        };
        let state = closure.state(q).ok_or(ClosureError::Home)?;
        if !regular(&state, condition) {
            return Err(ClosureError::Home);
        }
        closure.home = state.clone();
        closure.last = state;
        Ok(closure)
    }

    /// All coordinates of the last closed state, rad or m.
    pub fn q(&self) -> &[T; N] {
        &self.last.q
    }

    /// The independent coordinates of the last closed state, rad or m.
    pub fn q_i(&self) -> [T; DOF] {
        self.independent.map(|at| entry(&self.last.q, at))
    }

    /// Goes back to home.
    pub fn restart(&mut self) {
        self.stride = T::of(MAX_MOVE);
        self.last = self.home.clone();
    }

    /// Goes to a state that is closed already, such as one that a start-up routine found on home's
    /// branch: all coordinates, rad or m. Returns false, and changes nothing, if the loops are not
    /// closed at `q` or it is singular.
    #[must_use]
    pub fn resume(&mut self, q: &[T; N]) -> bool {
        let mut closed = *q;
        let reach = T::of(MAX_CORRECTION) * T::of(1e-3);
        let correction = self.correct(&mut closed, reach, &mut 3);
        let Correction::Converged(condition) = correction else {
            return false;
        };
        match self.state(closed).filter(|s| regular(s, condition)) {
            Some(state) => {
                self.last = state;
                true
            }
            None => false,
        }
    }

    /// Closes the loops at `q_i` (rad or m), along the straight line from the last closed state,
    /// with at most `steps` Newton steps.
    ///
    /// Small motions from cycle to cycle take two or three steps; with fewer than two, a call may
    /// make no progress. Each step calls the model's `newton_step` once, and its `velocities`,
    /// `dependent_jacobian`, `constraints` and `jacobian` at most once, which bounds the time of
    /// the call.
    pub fn track(&mut self, q_i: &[T; DOF], steps: usize) -> Outcome<T> {
        if !q_i.iter().all(|x| x.is_finite()) {
            return Outcome::NotFinite;
        }
        let from = self.q_i();
        let mut line = *q_i;
        for (line, from) in line.iter_mut().zip(&from) {
            *line = *line - *from;
        }
        let size = T::ONE + Scalar::max(largest(*q_i), largest(from));
        let length = largest(line);
        let rounding = T::of(SHORTEST_ROUNDINGS) * T::EPSILON * size;
        let shortest = if length > rounding {
            rounding / length
        } else {
            T::ONE
        };
        let (mut at, mut proposed, mut left) = (T::ZERO, T::ONE, steps);
        loop {
            let mut tangent = [T::ZERO; N];
            let known = self.model.velocities(&self.last.q, &line, &mut tangent);
            let speed = self.size(&tangent);
            if known.is_err() || !speed.is_finite() {
                return Outcome::Singular { at };
            }
            let rest = T::ONE - at;
            let mut part = least(proposed, self.stride / most(speed, self.stride));
            // a remainder shorter than the shortest step is taken with this one
            let last = rest - part < shortest;
            if last {
                part = rest;
            }
            let mut q = self.last.q;
            for (q, tangent) in q.iter_mut().zip(&tangent) {
                *q = *q + part * *tangent;
            }
            for (k, place) in self.independent.iter().enumerate() {
                if let Some(q) = q.get_mut(*place) {
                    *q = if last {
                        q_i[k]
                    } else {
                        from[k] + (at + part) * line[k]
                    };
                }
            }
            let reach = T::of(MAX_CORRECTION) * part * speed;
            match self.step(q, reach, &mut left) {
                Step::Taken { .. } if last => return Outcome::Closed,
                Step::Taken { change } => {
                    at = at + part;
                    if left > 1 {
                        self.stride = least(self.stride + self.stride, T::of(MAX_MOVE));
                    }
                    let far = change >= T::of(0.5 * MAX_CHANGE);
                    proposed = if far { part } else { part + part };
                }
                Step::Spent => {
                    if at == T::ZERO {
                        // no progress: the next call starts with a shorter step
                        let quarter = T::of(0.25) * least(self.stride, part * speed);
                        self.stride = most(quarter, rounding);
                    }
                    return Outcome::Unfinished { at };
                }
                Step::Singular => return Outcome::Singular { at },
                Step::Refused => {
                    proposed = T::of(0.5) * part;
                    if proposed < shortest {
                        return Outcome::Lost { at };
                    }
                }
            }
        }
    }

    /// Velocities and accelerations of all coordinates at the last closed state, from those of the
    /// independent ones (rad/s or m/s, rad/s^2 or m/s^2).
    pub fn motion(&self, qd_i: &[T; DOF], qdd_i: &[T; DOF]) -> Motion<T, N> {
        let (mut qd, mut qdd) = ([T::NAN; N], [T::NAN; N]);
        let q = &self.last.q;
        let singular = Condition { pivot: T::NAN };
        let first = self.model.velocities(q, qd_i, &mut qd);
        let second = self.model.accelerations(q, &qd, qdd_i, &mut qdd);
        let condition = first.unwrap_or(singular).worst(second.unwrap_or(singular));
        Motion { qd, qdd, condition }
    }

    /// One step from the last state to `q`, the result of the predictor. Newton's method moves by
    /// at most `reach`; `left` is the number of Newton steps that are left.
    fn step(&mut self, mut q: [T; N], reach: T, left: &mut usize) -> Step<T> {
        let condition = match self.correct(&mut q, reach, left) {
            Correction::Converged(condition) => condition,
            Correction::Refused => return Step::Refused,
            Correction::Spent => return Step::Spent,
        };
        let Some(matrix) = self.matrix(&q) else {
            return Step::Refused;
        };
        let change = self.last.factored.distance(&matrix);
        // false for NaN
        let near = change <= T::of(MAX_CHANGE);
        if !near {
            return Step::Refused;
        }
        let state = State {
            q,
            factored: Factored::new(&matrix),
        };
        if !regular(&state, condition) {
            return Step::Singular;
        }
        self.last = state;
        Step::Taken { change }
    }

    /// Newton's method on the selected rows from `q`, then the check of all rows. The lengths of
    /// all steps together are at most `reach`, rad or typical lengths.
    fn correct(&self, q: &mut [T; N], reach: T, left: &mut usize) -> Correction<T> {
        // the error that remains after a step is of the order of its square
        let floor = T::of(4.0) * Scalar::sqrt(T::EPSILON) * (T::ONE + self.size(q));
        let (mut moved, mut before) = (T::ZERO, T::INFINITY);
        loop {
            if *left == 0 {
                return Correction::Spent;
            }
            *left -= 1;
            let mut step = [T::NAN; E];
            let Ok(condition) = self.model.newton_step(q, &mut step) else {
                return Correction::Refused;
            };
            let mut length = T::ZERO;
            for (at, step) in self.dependent.iter().zip(step) {
                length = Scalar::max(length, Scalar::abs(step / entry(&self.units, *at)));
                if let Some(q) = q.get_mut(*at) {
                    *q = *q + step;
                }
            }
            moved = moved + length;
            // false for NaN
            let small = moved <= reach + floor && length <= T::of(0.5) * before;
            if !small {
                return Correction::Refused;
            }
            if length <= floor {
                let closed = self.closes(q);
                return if closed {
                    Correction::Converged(condition)
                } else {
                    Correction::Refused
                };
            }
            before = length;
        }
    }

    /// Whether all closure rows are satisfied at `q` to within rounding. Newton's method has solved
    /// the selected rows, so that only a mechanism with redundant rows needs the check.
    fn closes(&self, q: &[T; N]) -> bool {
        if ROWS == E {
            return q.iter().all(|x| x.is_finite());
        }
        let mut f = [T::NAN; ROWS];
        let mut a = [[T::NAN; N]; ROWS];
        let known = self.model.constraints(q, &mut f).is_ok()
            && self.model.jacobian(q, a.as_flattened_mut()).is_ok();
        let terms = |row: &[T; N]| {
            let terms = row.iter().zip(q).zip(&self.units);
            terms.fold(T::ZERO, |sum, ((a, q), unit)| {
                sum + Scalar::abs(*a) * most(Scalar::abs(*q), *unit)
            })
        };
        let size = largest(a.iter().map(terms));
        known && largest(f) <= T::of(CLOSED_ROUNDINGS) * T::EPSILON * size
    }

    /// The closed state at `q`, if the model computes its A_e.
    fn state(&self, q: [T; N]) -> Option<State<T, N, E>> {
        let factored = Factored::new(&self.matrix(&q)?);
        Some(State { q, factored })
    }

    /// A_e at `q`.
    fn matrix(&self, q: &[T; N]) -> Option<[[T; E]; E]> {
        let mut matrix = [[T::NAN; E]; E];
        let out = matrix.as_flattened_mut();
        self.model.dependent_jacobian(q, out).ok()?;
        Some(matrix)
    }

    /// The largest entry of a vector over all coordinates, in their units.
    fn size(&self, vector: &[T; N]) -> T {
        largest(vector.iter().zip(&self.units).map(|(x, unit)| *x / *unit))
    }
}

/// How one step along the line ended.
enum Step<T> {
    /// The state is the next one; A_e changed by `change`.
    Taken { change: T },
    /// It was refused; a shorter one may be accepted.
    Refused,
    /// The allowed number of Newton steps is used up.
    Spent,
    /// A_e is singular at the new state.
    Singular,
}

/// Whether A_e is regular both by the model's condition and by the pivots of its factors.
fn regular<T: Real, const N: usize, const E: usize>(
    state: &State<T, N, E>,
    condition: Condition<T>,
) -> bool {
    let least = most(T::of(SINGULAR), T::of(4.0) * T::EPSILON);
    condition.pivot >= least && state.factored.ratio() >= least
}

/// Checks the const arguments against the model, and that each coordinate is listed once.
fn check(info: &Info<'_>, got: [usize; 4]) -> Result<(), ClosureError> {
    let counts = [
        ("coordinates", info.coordinates.len()),
        ("independent coordinates", info.independent.len()),
        ("dependent coordinates", info.dependent.len()),
        ("closure rows", info.rows),
    ];
    for ((of, expected), got) in counts.into_iter().zip(got) {
        if expected != got {
            return Err(ClosureError::Size { of, expected, got });
        }
    }
    let listed = |k: &usize| {
        let all = info.independent.iter().chain(info.dependent);
        all.filter(|at| *at == k).count() == 1
    };
    let count = info.coordinates.len();
    let whole = info.independent.len() + info.dependent.len() == count;
    if !(whole && info.home.len() == count && (0..count).all(|k| listed(&k))) {
        return Err(ClosureError::Partition);
    }
    Ok(())
}

/// The entry at an index; NaN beyond the end.
fn entry<T: Real>(values: &[T], at: usize) -> T {
    values.get(at).copied().unwrap_or(T::NAN)
}

/// The larger of two numbers; the second where the first is NaN.
fn most<T: Real>(a: T, b: T) -> T {
    if a > b { a } else { b }
}

/// The smaller of two numbers; the second where the first is NaN.
fn least<T: Real>(a: T, b: T) -> T {
    if a < b { a } else { b }
}
