//! The physical values that fit best, by a barrier and a bounded number of Newton's steps.

use core::array::from_fn;

use regen_runtime::{Parameter, Scalar, Sign, Symbol};

use crate::outcome::SettingError;
use crate::real::{Real, moderate};
use crate::symmetric::{Cholesky, inertial, pseudo_inertia};
use crate::triangle::{Triangle, dot};

/// The decrement below which a Newton step is the whole one and stays inside.
const NEAR: f64 = 0.25;
/// By how much the barrier shrinks from centre to centre.
const SHRINK: f64 = 0.1;
/// The most times that a step is halved.
const HALVINGS: usize = 40;

/// The values that `P` parameters of a physical robot can have: the pseudo-inertia of each of `B`
/// bodies is positive definite, and masses, rotors and friction are positive. Offsets and the like
/// are free.
///
/// The 4 by 4 pseudo-inertia has the second moments of a body's mass, its first moments and its mass
/// (P. Wensing, S. Kim, J.-J. Slotine, "Linear matrix inequalities for physically consistent
/// inertial parameter identification", IEEE Robotics and Automation Letters 3(1), 2018).
///
/// ```
/// use regen_control::{Physical, Search};
/// use regen_runtime::{Parameter, Symbol};
///
/// let body = Physical::<10, 1>::new(&Symbol::INERTIAL.map(|s| Parameter::new(s, "load")))?;
/// let ball = [0.1, 0.0, 0.0, 0.1, 0.0, 0.1, 0.0, 0.0, 0.0, 2.0];
/// // equations that a negative moment of inertia fits best
/// let mut rows = [[0.0; 10]; 10];
/// (0..10).for_each(|k| rows[k][k] = 10.0);
/// let mut right = ball.map(|value| 10.0 * value);
/// right[0] = -1.0;
/// let found = body.closest((&rows, &right), &ball, 60, 1e-6)?;
/// assert_eq!(found.status, Search::Reached);
/// assert!(body.contains(&found.values) && found.values[0] > 0.0 && found.values[9] > 1.9);
/// # Ok::<(), regen_control::SettingError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Physical<const P: usize, const B: usize> {
    /// The places of each body's parameters, in the order of [`Symbol::INERTIAL`].
    pub(crate) bodies: [[usize; 10]; B],
    /// Which of the others are positive.
    pub(crate) positive: [bool; P],
}

/// What [`Physical::closest`] found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projected<T, const P: usize> {
    /// Values inside the set, in the units of the parameters.
    pub values: [T; P],
    /// How far half the weighted sum of squares is above its minimum over the set, at most.
    pub gap: T,
    /// How the search ended. Values are inside the set in every case.
    pub status: Search,
}

/// How a search ended.
#[must_use]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Search {
    /// The gap is within the tolerance.
    Reached,
    /// The allowed number of steps is used up; the next call can start from the values.
    Unfinished,
    /// Rounding errors prevent a better result, or the equations do not determine a parameter that is
    /// free.
    Stuck,
}

impl<const P: usize, const B: usize> Physical<P, B> {
    /// The set of these parameters, a generated module's `PARAMETERS` or a part of it.
    ///
    /// # Errors
    /// When they are not ten inertial parameters for each of `B` bodies beside others.
    pub fn new(parameters: &[Parameter<'_>; P]) -> Result<Self, SettingError> {
        let mut bodies = [[P; 10]; B];
        let mut owners = [None; B];
        let mut positive = [false; P];
        for (at, parameter) in parameters.iter().enumerate() {
            let place = Symbol::INERTIAL.iter().position(|s| *s == parameter.symbol);
            let Some(place) = place else {
                positive[at] = parameter.sign() == Sign::Nonnegative;
                continue;
            };
            let owner = Some(parameter.owner);
            let mut each = owners.iter_mut().zip(&mut bodies);
            let body = each.find(|(known, _)| known.is_none() || **known == owner);
            let (known, body) = body.ok_or(SettingError::Bodies)?;
            *known = owner;
            match body.get_mut(place) {
                Some(entry) if *entry == P => *entry = at,
                _ => return Err(SettingError::Bodies),
            }
        }
        if bodies.as_flattened().contains(&P) {
            return Err(SettingError::Bodies);
        }
        Ok(Self { bodies, positive })
    }

    /// Whether values are inside the set.
    pub fn contains<T: Real>(&self, values: &[T; P]) -> bool {
        moderate(values) && self.barrier(values).is_some()
    }

    /// The values in the set that fit equations R phi = z best, such as those of
    /// [`Estimator::factor`](crate::Estimator::factor) of an estimator over these parameters with a
    /// prior for what the motion does not tell: they minimise |R phi - z|^2 / 2.
    ///
    /// - `start`: values inside the set, such as nominal ones or those of the last call.
    /// - `steps`: the most steps of Newton's method; each takes about P^3 / 6 + 40 P^2 + 3000 B
    ///   multiplications at most. 40 to 60 steps reach the tolerance from far.
    /// - `tolerance`: the gap at which the search ends. The weighted distance from the minimum is at
    ///   most the square root of twice the gap: 0.005 leaves a tenth of a deviation.
    ///
    /// Values that solve the equations and are inside the set are returned as they are.
    ///
    /// # Errors
    /// When `start` is outside the set, or the tolerance is not positive and finite.
    pub fn closest<T: Real>(
        &self,
        (rows, right): (&[[T; P]; P], &[T; P]),
        start: &[T; P],
        steps: usize,
        tolerance: T,
    ) -> Result<Projected<T, P>, SettingError> {
        if !(tolerance > T::ZERO && tolerance <= T::LARGE) {
            return Err(SettingError::NotPositive { of: "tolerance" });
        }
        if !moderate(rows.as_flattened()) || !moderate(right) {
            return Err(SettingError::NotFinite { of: "equations" });
        }
        if !self.contains(start) {
            return Err(SettingError::Start);
        }
        let equations = Triangle {
            rows: *rows,
            right: *right,
        };
        if equations.is_regular() {
            let values = equations.back(right);
            if self.contains(&values) {
                return Ok(Projected {
                    values,
                    gap: T::ZERO,
                    status: Search::Reached,
                });
            }
        }
        Ok(self.follow(&equations, *start, steps, tolerance))
    }

    /// Follows the central path from `values`.
    fn follow<T: Real>(
        &self,
        equations: &Triangle<T, P>,
        mut values: [T; P],
        steps: usize,
        tolerance: T,
    ) -> Projected<T, P> {
        let degree = T::of((4 * B + self.positive.iter().filter(|p| **p).count()) as f64);
        let mut gap = T::INFINITY;
        let mut best = values;
        let mut weight = Scalar::max(squares(equations, &values), tolerance) / degree;
        let mut status = Search::Unfinished;
        let mut information = [[T::ZERO; P]; P];
        for row in &equations.rows {
            for (out, a) in information.iter_mut().zip(row) {
                for (out, b) in out.iter_mut().zip(row) {
                    *out = *out + *a * *b;
                }
            }
        }
        for _ in 0..steps {
            let residual: [T; P] = {
                let product = equations.times(&values);
                from_fn(|i| product[i] - equations.right[i])
            };
            let mut gradient = equations.transposed_times(&residual);
            let mut hessian = information;
            self.bend(&values, weight, &mut gradient, &mut hessian);
            let Some(factor) = Cholesky::new(&hessian) else {
                status = Search::Stuck;
                break;
            };
            let step = factor.solve(&gradient).map(|x| -x);
            let decrement = Scalar::sqrt(Scalar::max(-dot(&gradient, &step), T::ZERO) / weight);
            if !decrement.is_finite() {
                status = Search::Stuck;
                break;
            }
            if decrement < T::of(NEAR) {
                let root = Scalar::sqrt(degree);
                let bound = degree + (root + decrement) * decrement / (T::ONE - decrement);
                let reached = weight * bound;
                if reached < gap {
                    (gap, best) = (reached, values);
                }
                if gap <= tolerance {
                    status = Search::Reached;
                    break;
                }
            }
            let Some(next) = self.advance(equations, &values, &step, decrement, weight) else {
                status = Search::Stuck;
                break;
            };
            values = next;
            if decrement < T::of(NEAR) {
                weight = Scalar::max(weight * T::of(SHRINK), T::of(0.5) * tolerance / degree);
            }
        }
        if !gap.is_finite() {
            best = values;
        }
        Projected {
            values: best,
            gap,
            status,
        }
    }

    /// The next values along a step: all of it near the centre, else the largest part by halves that
    /// lowers the function enough.
    fn advance<T: Real>(
        &self,
        equations: &Triangle<T, P>,
        values: &[T; P],
        step: &[T; P],
        decrement: T,
        weight: T,
    ) -> Option<[T; P]> {
        let at = |part: T| from_fn(|j| values[j] + part * step[j]);
        let merit = |values: &[T; P]| {
            let barrier = self.barrier(values)?;
            Some(squares(equations, values) - weight * barrier)
        };
        if decrement < T::of(NEAR) {
            let next = at(T::ONE);
            return self.barrier(&next).map(|_| next);
        }
        let before = merit(values)?;
        let slope = weight * decrement * decrement;
        let mut part = T::ONE;
        for _ in 0..HALVINGS {
            let next = at(part);
            if let Some(after) = merit(&next)
                && after <= before - T::of(0.1) * part * slope
            {
                return Some(next);
            }
            part = T::of(0.5) * part;
        }
        None
    }

    /// The logarithms of the determinants and of the positive values; none outside the set.
    fn barrier<T: Real>(&self, values: &[T; P]) -> Option<T> {
        let mut sum = T::ZERO;
        for body in &self.bodies {
            let factor = Cholesky::new(&pseudo_inertia(&inertial(values, body)))?;
            sum = sum + factor.logarithm();
        }
        for (value, positive) in values.iter().zip(self.positive) {
            if positive {
                if *value <= T::ZERO {
                    return None;
                }
                sum = sum + value.ln();
            }
        }
        sum.is_finite().then_some(sum)
    }

    /// Adds gradient and Hessian of the barrier with its weight, for values inside the set.
    fn bend<T: Real>(
        &self,
        values: &[T; P],
        weight: T,
        gradient: &mut [T; P],
        hessian: &mut [[T; P]; P],
    ) {
        for body in &self.bodies {
            let Some(factor) = Cholesky::new(&pseudo_inertia(&inertial(values, body))) else {
                continue;
            };
            // L^-1 E_k L^-T of each parameter's own matrix E_k
            let scaled: [[[T; 4]; 4]; 10] = from_fn(|k| {
                let unit = from_fn(|j| if j == k { T::ONE } else { T::ZERO });
                factor.scaled(&pseudo_inertia(&unit))
            });
            for (a, at) in scaled.iter().zip(body) {
                let trace = (0..4).fold(T::ZERO, |sum, i| sum + a[i][i]);
                if let Some(out) = gradient.get_mut(*at) {
                    *out = *out - weight * trace;
                }
                let Some(row) = hessian.get_mut(*at) else {
                    continue;
                };
                for (b, at) in scaled.iter().zip(body) {
                    let products = a.as_flattened().iter().zip(b.as_flattened());
                    let trace = products.fold(T::ZERO, |sum, (a, b)| sum + *a * *b);
                    if let Some(out) = row.get_mut(*at) {
                        *out = *out + weight * trace;
                    }
                }
            }
        }
        for j in 0..P {
            if self.positive[j] {
                let inverse = T::ONE / values[j];
                gradient[j] = gradient[j] - weight * inverse;
                hessian[j][j] = hessian[j][j] + weight * inverse * inverse;
            }
        }
    }
}

/// |R phi - z|^2 / 2.
fn squares<T: Real, const P: usize>(equations: &Triangle<T, P>, values: &[T; P]) -> T {
    let product = equations.times(values);
    let residual: [T; P] = from_fn(|i| product[i] - equations.right[i]);
    T::of(0.5) * dot(&residual, &residual)
}
