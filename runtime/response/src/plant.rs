//! The equations of motion over the independent coordinates, solved for the accelerations, with
//! exact derivatives by state, efforts and base parameters.

mod direction;
mod posture;

use regen_experiment::simulate::{factor_mass, friction_width, solve_mass};
use regen_runtime::{BaseModel, Friction, SizeError, Status};

use crate::{DIRECTIONS, Number};

pub(crate) use direction::Directed;
use direction::Side;
pub(crate) use posture::Posture;

/// The largest number of Newton steps that close the loops, from one stage of the integration to the
/// next.
const MAX_NEWTON_STEPS: usize = 12;
/// A Newton step below this, relative to 1 + the size of the coordinates, ends the iteration: the
/// remaining error is of the order of its square.
const NEWTON_TOLERANCE: f64 = 1e-9;
/// A correction of a dependent coordinate beyond this, rad or m, may leave the assembly branch.
const MAX_CORRECTION: f64 = 0.5;

/// A robot whose motion is integrated: a model whose Coulomb friction changes its sign smoothly.
pub(crate) struct Plant<'m, M: ?Sized, D: ?Sized> {
    model: &'m M,
    derivatives: &'m D,
    pub(crate) n: usize,
    pub(crate) dof: usize,
    pub(crate) columns: usize,
    pub(crate) independent: Vec<usize>,
    dependent: Vec<usize>,
    pub(crate) actuated: Vec<usize>,
    /// Whether the actuated coordinates are the independent ones in the same order.
    direct: bool,
    /// The Coulomb friction of all joints.
    pub(crate) directed: Vec<Directed>,
}

/// The accelerations of the independent coordinates and their derivatives, row by row.
#[derive(Clone, Debug, Default)]
pub(crate) struct Accelerations {
    pub(crate) values: Vec<f64>,
    /// dof x 2 dof: the derivatives by q_i, then by qd_i. Empty if no derivatives were computed, as
    /// the following two.
    pub(crate) by_state: Vec<f64>,
    /// dof x number of actuated joints.
    pub(crate) by_effort: Vec<f64>,
    /// dof x r: the derivatives by the base parameters.
    pub(crate) by_beta: Vec<f64>,
}

/// The derivatives of `G u - W beta`, column by column.
#[derive(Clone, Debug, Default)]
pub(crate) struct Gradient {
    /// G, dof x number of actuated joints.
    pub(crate) by_effort: Vec<f64>,
    /// W, dof x r: the derivatives by the base parameters with the opposite sign. Its columns of
    /// friction have the sign of the velocity.
    pub(crate) regressor: Vec<f64>,
    /// dof x 2 dof: the derivatives by q_i, then by qd_i.
    pub(crate) by_state: Vec<f64>,
}

impl<'m, M, D> Plant<'m, M, D>
where
    M: BaseModel<f64> + ?Sized,
    D: BaseModel<Number> + ?Sized,
{
    /// - `width`: the velocity over which the smoothed sign of a joint changes, rad/s or m/s.
    ///
    /// Nonlinear friction, whose coefficients are not base parameters, is left out.
    pub(crate) fn new(model: &'m M, derivatives: &'m D, width: f64) -> Result<Self, SizeError> {
        let info = model.info();
        let base = model.base_info();
        let (columns, p) = (base.base.len(), info.parameters.len());
        let free = vec![0.0; base.free.len()];
        let mut of_base = Vec::with_capacity(columns);
        for k in 0..columns {
            let mut unit = vec![0.0; columns];
            unit[k] = 1.0;
            let mut phi = vec![0.0; p];
            model.parameters_from_base(&unit, &free, &mut phi)?;
            of_base.push(phi);
        }
        let mut directed = Vec::new();
        for (coordinate, (joint, name)) in info.joints.iter().zip(info.coordinates).enumerate() {
            if joint.friction == Friction::None || !joint.friction.is_linear() {
                continue;
            }
            let width = friction_width(Some(joint), width);
            for (symbol, side) in [
                ("Fc", Side::Both),
                ("Fc+", Side::Forward),
                ("Fc-", Side::Backward),
            ] {
                let Some(place) = info.parameter_of(&format!("{symbol}({name})")) else {
                    continue;
                };
                directed.push(Directed {
                    coordinate,
                    side,
                    width,
                    combination: of_base.iter().map(|phi| phi[place]).collect(),
                });
            }
        }
        Ok(Self {
            model,
            derivatives,
            n: info.coordinates.len(),
            dof: info.dof(),
            columns,
            independent: info.independent.to_vec(),
            dependent: info.dependent.to_vec(),
            actuated: info.actuated.to_vec(),
            direct: info.actuated == info.independent,
            directed,
        })
    }

    /// The largest derivative of friction with respect to velocity, N m s/rad or N s/m, over all
    /// joints that reverse at this posture, or may reverse in the next `step` seconds with these
    /// accelerations.
    pub(crate) fn steepest(
        &self,
        posture: &Posture,
        accelerations: &[f64],
        step: f64,
        beta: &[f64],
    ) -> f64 {
        /// Beyond this many widths the smoothed sign differs from the sign by less than a
        /// thousandth.
        const REACH_WIDTHS: f64 = 4.0;
        /// The factor by which accelerations may grow in a step.
        const GROWTH: f64 = 1.5;
        let near = |d: &&Directed| {
            let shares = posture.row(d.coordinate).zip(accelerations);
            let change: f64 = shares.map(|(share, a)| share * a).sum();
            let reach = REACH_WIDTHS * d.width + GROWTH * step * change.abs();
            posture.qd[d.coordinate].abs() < reach
        };
        let slopes = self.directed.iter().filter(near).map(|d| {
            let coefficient = d.coefficient(beta);
            coefficient.abs() / d.width
        });
        slopes.fold(0.0, f64::max)
    }

    /// Closes the loops at `q_i` by Newton's method from the dependent coordinates in `q`; false if
    /// they do not close nearby.
    fn close(&self, q: &mut [f64], q_i: &[f64]) -> Result<bool, SizeError> {
        for (place, x) in self.independent.iter().zip(q_i) {
            q[*place] = *x;
        }
        if self.dependent.is_empty() {
            return Ok(true);
        }
        let mut step = vec![0.0; self.dependent.len()];
        let mut last = MAX_CORRECTION;
        for _ in 0..MAX_NEWTON_STEPS {
            let condition = self.model.newton_step(q, &mut step)?;
            let size = largest(&step);
            if condition.status() == Status::Singular || size.is_nan() || size > last {
                return Ok(false);
            }
            for (place, x) in self.dependent.iter().zip(&step) {
                q[*place] += x;
            }
            if size <= NEWTON_TOLERANCE * (1.0 + largest(q)) {
                return Ok(true);
            }
            last = 0.5 * size;
        }
        Ok(false)
    }

    /// All coordinates and velocities at a state; `None` if the loops do not close.
    ///
    /// - `near`: all coordinates at a state nearby, on the assembly branch to stay on;
    /// - `derived`: whether to compute derivatives.
    pub(crate) fn posture(
        &self,
        near: &[f64],
        state: &[f64],
        derived: bool,
    ) -> Result<Option<Posture>, SizeError> {
        let (q_i, qd_i) = state.split_at(self.dof);
        let mut q = near.to_vec();
        if !state.iter().all(|x| x.is_finite()) || !self.close(&mut q, q_i)? {
            return Ok(None);
        }
        let (n, dof) = (self.n, self.dof);
        let mut reach = vec![0.0; n * dof];
        let mut unit = vec![0.0; dof];
        for (k, column) in reach.chunks_exact_mut(n.max(1)).enumerate() {
            unit.fill(0.0);
            unit[k] = 1.0;
            if self.dependent.is_empty() {
                column[self.independent[k]] = 1.0;
            } else {
                let condition = self.model.velocities(&q, &unit, column)?;
                if condition.status() == Status::Singular {
                    return Ok(None);
                }
            }
        }
        let qd = combined(&reach, qd_i, n);
        let mut out = Posture {
            q,
            qd,
            reach,
            ..Posture::default()
        };
        if derived {
            self.differentiate(&mut out, qd_i)?;
        }
        Ok(Some(out))
    }

    /// Adds the coordinates and velocities with their derivatives by the state.
    fn differentiate(&self, posture: &mut Posture, qd_i: &[f64]) -> Result<(), SizeError> {
        let (n, dof) = (self.n, self.dof);
        posture.turning = vec![0.0; n * dof];
        for first in (0..2 * dof).step_by(DIRECTIONS) {
            let mut q: Vec<Number> = posture.q.iter().map(|x| Number::constant(*x)).collect();
            for k in first..dof.min(first + DIRECTIONS) {
                let column = &posture.reach[k * n..(k + 1) * n];
                for (q, rate) in q.iter_mut().zip(column) {
                    q.rates[k - first] = *rate;
                }
            }
            let rate = |(k, v): (usize, &f64)| Number::along(*v, (dof + k).wrapping_sub(first));
            let rates: Vec<Number> = qd_i.iter().enumerate().map(rate).collect();
            let mut qd = vec![Number::constant(0.0); n];
            let _condition = self.derivatives.velocities(&q, &rates, &mut qd)?;
            for k in first..dof.min(first + DIRECTIONS) {
                for (c, v) in qd.iter().enumerate() {
                    posture.turning[k * n + c] = v.rates[k - first];
                }
            }
            posture.numbers.push([q, qd]);
        }
        Ok(())
    }

    /// The accelerations under these efforts; `None` if the mass matrix is not positive definite.
    /// Their derivatives are computed if the posture has derivatives.
    pub(crate) fn accelerations(
        &self,
        posture: &Posture,
        efforts: &[f64],
        beta: &[f64],
    ) -> Result<Option<Accelerations>, SizeError> {
        let (n, dof) = (self.n, self.dof);
        let (q, qd) = (&posture.q, &posture.qd);
        let still = vec![0.0; dof];
        let mut drift = vec![0.0; n];
        let _condition = self.model.accelerations(q, qd, &still, &mut drift)?;
        let mut opposed = vec![0.0; dof];
        let _condition = self
            .model
            .base_inverse_dynamics(q, qd, &drift, beta, &mut opposed)?;
        let mut mass = vec![0.0; dof * dof];
        let _condition = self.model.base_mass_matrix(q, beta, &mut mass)?;
        if !factor_mass(&mut mass, dof) {
            return Ok(None);
        }
        let mut values = self.applied(q, efforts)?;
        for (x, y) in values.iter_mut().zip(&opposed) {
            *x -= y;
        }
        for d in &self.directed {
            let coefficient = d.coefficient(beta);
            let (soft, _) = d.side.softening(qd[d.coordinate], d.width);
            for (x, share) in values.iter_mut().zip(posture.row(d.coordinate)) {
                *x -= share * soft * coefficient;
            }
        }
        solve_mass(&mass, &mut values);
        if !values.iter().all(|x| x.is_finite()) {
            return Ok(None);
        }
        let mut out = Accelerations {
            values,
            ..Accelerations::default()
        };
        if !posture.numbers.is_empty() {
            self.slopes(posture, efforts, beta, &mass, &drift, &mut out)?;
        }
        Ok(Some(out))
    }

    /// The efforts of the actuated joints, reduced to the independent coordinates.
    fn applied(&self, q: &[f64], efforts: &[f64]) -> Result<Vec<f64>, SizeError> {
        if self.direct {
            return Ok(efforts.to_vec());
        }
        let mut out = vec![0.0; self.dof];
        let _condition = self.model.generalized_forces(q, efforts, &mut out)?;
        Ok(out)
    }

    /// Derivatives of the accelerations, by implicit differentiation: the derivative of
    /// `G u - W beta - f` at constant accelerations, multiplied by the inverse of the mass matrix.
    fn slopes(
        &self,
        posture: &Posture,
        efforts: &[f64],
        beta: &[f64],
        mass: &[f64],
        drift: &[f64],
        out: &mut Accelerations,
    ) -> Result<(), SizeError> {
        let dof = self.dof;
        let mut qdd = combined(&posture.reach, &out.values, self.n);
        for (x, y) in qdd.iter_mut().zip(drift) {
            *x += y;
        }
        let mut found = self.gradient(posture, &qdd, efforts, beta, true)?;
        for d in &self.directed {
            let (soft, _) = d.side.softening(posture.qd[d.coordinate], d.width);
            let shares: Vec<f64> = posture.row(d.coordinate).collect();
            let columns = found.regressor.chunks_exact_mut(dof.max(1));
            for (column, factor) in columns.zip(&d.combination) {
                for (x, share) in column.iter_mut().zip(&shares) {
                    *x += share * soft * factor;
                }
            }
        }
        // row by row, as accelerations
        let accelerated = |columns: &mut [f64], sign: f64| -> Vec<f64> {
            let width = columns.len() / dof.max(1);
            let mut rows = vec![0.0; columns.len()];
            for (k, column) in columns.chunks_exact_mut(dof.max(1)).enumerate() {
                solve_mass(mass, column);
                for (i, x) in column.iter().enumerate() {
                    rows[i * width + k] = sign * x;
                }
            }
            rows
        };
        out.by_effort = accelerated(&mut found.by_effort, 1.0);
        out.by_beta = accelerated(&mut found.regressor, -1.0);
        out.by_state = accelerated(&mut found.by_state, 1.0);
        Ok(())
    }

    /// The derivatives of `G u - W beta` at constant independent accelerations, for a posture with
    /// derivatives.
    ///
    /// - `qdd`: the accelerations of all coordinates, n; `efforts`: u;
    /// - `softened`: whether the derivatives by the state have those of smoothed friction; otherwise
    ///   friction is constant in each direction.
    pub(crate) fn gradient(
        &self,
        posture: &Posture,
        qdd: &[f64],
        efforts: &[f64],
        beta: &[f64],
        softened: bool,
    ) -> Result<Gradient, SizeError> {
        let (n, dof, a) = (self.n, self.dof, efforts.len());
        let width = 2 * dof;
        let mut out = Gradient {
            by_effort: Vec::with_capacity(dof * a),
            regressor: vec![0.0; dof * self.columns],
            by_state: vec![0.0; dof * width],
        };
        let mut unit = vec![0.0; a];
        for k in 0..a {
            unit.fill(0.0);
            unit[k] = 1.0;
            out.by_effort.extend(self.applied(&posture.q, &unit)?);
        }
        let _condition =
            self.model
                .base_regressor(&posture.q, &posture.qd, qdd, &mut out.regressor)?;
        let constants = |values: &[f64]| -> Vec<Number> {
            values.iter().map(|x| Number::constant(*x)).collect()
        };
        let independent = self.independent.iter().map(|c| qdd[*c]);
        let qdd_i: Vec<Number> = independent.map(Number::constant).collect();
        let beta_n = constants(beta);
        for (chunk, [q, qd]) in posture.numbers.iter().enumerate() {
            let first = chunk * DIRECTIONS;
            let mut qdd = vec![Number::constant(0.0); n];
            let _condition = self.derivatives.accelerations(q, qd, &qdd_i, &mut qdd)?;
            let mut tau = vec![Number::constant(0.0); dof];
            let _condition = self
                .derivatives
                .base_inverse_dynamics(q, qd, &qdd, &beta_n, &mut tau)?;
            if softened {
                self.add_softening(q, qd, beta, &mut tau)?;
            }
            let mut applied = vec![Number::constant(0.0); dof];
            if !self.direct {
                let efforts = constants(efforts);
                let _condition = self
                    .derivatives
                    .generalized_forces(q, &efforts, &mut applied)?;
            }
            for k in first..width.min(first + DIRECTIONS) {
                let column = &mut out.by_state[k * dof..(k + 1) * dof];
                for (x, (g, t)) in column.iter_mut().zip(applied.iter().zip(&tau)) {
                    *x = g.rates[k - first] - t.rates[k - first];
                }
            }
        }
        Ok(out)
    }

    /// Adds the difference between friction with the smoothed sign and friction with the sign.
    fn add_softening(
        &self,
        q: &[Number],
        qd: &[Number],
        beta: &[f64],
        tau: &mut [Number],
    ) -> Result<(), SizeError> {
        if self.directed.is_empty() {
            return Ok(());
        }
        let zero = Number::constant(0.0);
        let mut reach: Vec<Vec<Number>> = Vec::new();
        if self
            .directed
            .iter()
            .any(|d| self.dependent.contains(&d.coordinate))
        {
            for k in 0..self.dof {
                let mut unit = vec![zero; self.dof];
                unit[k] = Number::constant(1.0);
                let mut column = vec![zero; self.n];
                let _condition = self.derivatives.velocities(q, &unit, &mut column)?;
                reach.push(column);
            }
        }
        for d in &self.directed {
            let coefficient = d.coefficient(beta);
            let v = qd[d.coordinate];
            let (value, slope) = d.side.softening(v.value, d.width);
            let friction = Number {
                value: coefficient * value,
                rates: v.rates.map(|x| coefficient * slope * x),
            };
            if let Some(k) = self.independent.iter().position(|c| *c == d.coordinate) {
                tau[k] = tau[k] + friction;
                continue;
            }
            for (tau, column) in tau.iter_mut().zip(&reach) {
                *tau = *tau + column[d.coordinate] * friction;
            }
        }
        Ok(())
    }

    /// The trace of the inverse mass matrix of the independent coordinates at a posture; `None` if
    /// the mass matrix is not positive definite. It bounds the largest eigenvalue of the inverse, and
    /// so, times a stiffness or damping, the rates of the controlled robot.
    pub(crate) fn mobility(&self, q: &[f64], beta: &[f64]) -> Result<Option<f64>, SizeError> {
        let dof = self.dof;
        let mut mass = vec![0.0; dof * dof];
        let _condition = self.model.base_mass_matrix(q, beta, &mut mass)?;
        if !factor_mass(&mut mass, dof) {
            return Ok(None);
        }
        let mut trace: f64 = 0.0;
        for k in 0..dof {
            let mut unit = vec![0.0; dof];
            unit[k] = 1.0;
            solve_mass(&mass, &mut unit);
            trace += unit[k];
        }
        Ok(Some(trace))
    }
}

/// A combination of the columns of an n-row matrix.
fn combined(columns: &[f64], factors: &[f64], n: usize) -> Vec<f64> {
    let mut out = vec![0.0; n];
    for (column, factor) in columns.chunks_exact(n.max(1)).zip(factors) {
        for (sum, x) in out.iter_mut().zip(column) {
            *sum += x * factor;
        }
    }
    out
}

/// The largest absolute value; NaN if any is NaN.
fn largest(values: &[f64]) -> f64 {
    values
        .iter()
        .map(|x| x.abs())
        .fold(0.0, |m, x| if x <= m { m } else { x })
}
