//! Evaluation of a trajectory: limits and observation matrix.

use super::limits::{Limit, Quantity};
use super::space::{ORDERS, Row, Space};
use super::{Criterion, DIRECTIONS, ExciteError, Tangent};
use regen_batch::{TrackedStates, TrajectoryClosure, eval_base_many, eval_many};
use regen_runtime::{
    Arguments, BaseFunction, BaseModel, ClosureError, Function, Info, Scalar, SizeError,
};

/// The number type with which derivatives are computed.
pub(super) type Number = Tangent<DIRECTIONS>;

/// The fixed data of a search: model, limits, criterion, variables and grid.
pub(super) struct Problem<'m, M, D> {
    pub(super) model: &'m M,
    pub(super) derivatives: &'m D,
    pub(super) info: Info<'m>,
    pub(super) limits: Vec<Limit>,
    /// The nominal parameters, if efforts are limited and can be computed.
    pub(super) nominal: Option<Vec<f64>>,
    pub(super) criterion: Criterion,
    /// 1 over the standard deviation of each independent coordinate's effort.
    pub(super) weights: Vec<f64>,
    /// The number of base parameters.
    pub(super) columns: usize,
    pub(super) space: Space,
    /// The grid points at which limits are checked during the search.
    pub(super) grid: Vec<Row>,
    /// Every `stride`-th grid point is a sample of the observation matrix.
    pub(super) stride: usize,
}

/// The observation matrix of a trajectory, column-major, without and with weighted rows.
pub(super) struct Observed {
    pub(super) w: Vec<f64>,
    pub(super) weighted: Vec<f64>,
}

impl<M, D> Problem<'_, M, D>
where
    M: BaseModel<f64>,
    D: BaseModel<Number>,
{
    pub(super) fn dof(&self) -> usize {
        self.info.dof()
    }

    /// Solves for the efforts of the actuated joints from the generalized forces `tau` of the
    /// independent coordinates; there are as many actuated joints as independent coordinates.
    pub(super) fn of_actuators<T: Scalar, E: BaseModel<T>>(
        &self,
        e: &E,
        q: &[T],
        tau: Vec<T>,
        proto: T,
    ) -> Result<Vec<T>, SizeError> {
        if self.info.actuated == self.info.independent {
            return Ok(tau);
        }
        let n = tau.len();
        let zero = proto.splat(0.0);
        let mut a = vec![zero; n * n];
        for k in 0..n {
            let mut unit = vec![zero; n];
            unit[k] = proto.splat(1.0);
            let mut column = vec![zero; n];
            let _condition = e.generalized_forces(q, &unit, &mut column)?;
            for (i, x) in column.iter().enumerate() {
                a[i * n + k] = *x;
            }
        }
        let mut b = tau;
        for k in 0..n {
            // partial pivoting by `select`, which needs no branch on values
            for i in k + 1..n {
                let swap = a[k * n + k].abs().less(a[i * n + k].abs());
                for j in 0..n {
                    let (x, y) = (a[k * n + j], a[i * n + j]);
                    a[k * n + j] = T::select(swap, y, x);
                    a[i * n + j] = T::select(swap, x, y);
                }
                let (x, y) = (b[k], b[i]);
                b[k] = T::select(swap, y, x);
                b[i] = T::select(swap, x, y);
            }
            for i in k + 1..n {
                let factor = a[i * n + k] / a[k * n + k];
                for j in k..n {
                    a[i * n + j] = a[i * n + j] - factor * a[k * n + j];
                }
                b[i] = b[i] - factor * b[k];
            }
        }
        for k in (0..n).rev() {
            for j in k + 1..n {
                b[k] = b[k] - a[k * n + j] * b[j];
            }
            b[k] = b[k] / a[k * n + k];
        }
        Ok(b)
    }

    /// Positions, velocities, accelerations and jerks of the independent coordinates at these grid
    /// points.
    pub(super) fn series<'a>(
        &self,
        rows: impl ExactSizeIterator<Item = &'a Row>,
        y: &[f64],
    ) -> [Vec<f64>; ORDERS] {
        let count = rows.len();
        let mut series = [(); ORDERS].map(|()| vec![0.0; self.dof() * count]);
        for (state, row) in rows.enumerate() {
            for (series, values) in series.iter_mut().zip(row.at(y)) {
                let slots = series.iter_mut().skip(state).step_by(count);
                for (slot, value) in slots.zip(values) {
                    *slot = value;
                }
            }
        }
        series
    }

    /// The closed states of the grid: where possible each from the same state of a trajectory
    /// nearby, `from`, else from home; `None` where the loops do not stay closed.
    pub(super) fn closed_grid(
        &self,
        closure: &mut TrajectoryClosure<'_, M>,
        y: &[f64],
        from: Option<&TrackedStates>,
    ) -> Result<Option<TrackedStates>, ClosureError> {
        if let Some(from) = from {
            let [q_i, qd_i, qdd_i, _] = self.series(self.grid.iter(), y);
            let moved = closure.moved(from, &q_i, &qd_i, &qdd_i)?;
            if moved.is_some() {
                return Ok(moved);
            }
        }
        self.closed(closure, self.grid.iter(), y)
    }

    /// The closed states at these grid points; `None` where the loops do not stay closed.
    pub(super) fn closed<'a>(
        &self,
        closure: &mut TrajectoryClosure<'_, M>,
        rows: impl ExactSizeIterator<Item = &'a Row>,
        y: &[f64],
    ) -> Result<Option<TrackedStates>, ClosureError> {
        let count = rows.len();
        let [q_i, qd_i, qdd_i, _] = self.series(rows, y);
        closure.restart();
        let states = closure.track(count, &q_i, &qd_i, &qdd_i)?;
        let closes = states.outcomes.iter().all(|outcome| outcome.is_closed());
        Ok(closes.then_some(states))
    }

    /// Divides the rows of `w` by the standard deviations of the efforts.
    pub(super) fn weigh(&self, w: &mut [f64]) {
        for chunk in w.chunks_exact_mut(self.weights.len().max(1)) {
            for (x, weight) in chunk.iter_mut().zip(&self.weights) {
                *x *= weight;
            }
        }
    }

    /// The values of all limits at each of these grid points; `None` where the loops do not stay
    /// closed.
    pub(super) fn values(
        &self,
        closure: &mut TrajectoryClosure<'_, M>,
        rows: &[Row],
        y: &[f64],
    ) -> Result<Option<Vec<f64>>, ExciteError> {
        let Some(states) = self.closed(closure, rows.iter(), y)? else {
            return Ok(None);
        };
        let zero = vec![0.0; self.dof() * states.len()];
        let (_, pivots) = self.velocities(&states, &zero)?;
        Ok(Some(self.limit_values(&states, rows, y, &pivots)?))
    }

    /// The velocities of all coordinates at closed states for those of the independent ones, and the
    /// pivots, which do not depend on these.
    pub(super) fn velocities(
        &self,
        states: &TrackedStates,
        qd_i: &[f64],
    ) -> Result<(Vec<f64>, Vec<f64>), SizeError> {
        let arguments = Arguments {
            q: &states.q,
            qd_i,
            ..Arguments::EMPTY
        };
        let mut qd = vec![0.0; states.q.len()];
        let mut pivots = vec![1.0; states.len()];
        let (function, count) = (Function::Velocities, states.len());
        eval_many(self.model, function, count, arguments, &mut qd, &mut pivots)?;
        Ok((qd, pivots))
    }

    /// Whether a limit of a jerk depends on the loops.
    pub(super) fn is_jerk_of_loop(&self, limit: &Limit) -> bool {
        limit.quantity == Quantity::Jerk && !self.info.independent.contains(&limit.index())
    }

    /// The jerks of all coordinates at the closed states of these grid points; empty where none is
    /// limited.
    ///
    /// The accelerations are a function of the positions and velocities and of the independent
    /// accelerations, so that numbers with one derivative, by the time, give the jerks.
    fn jerks(
        &self,
        states: &TrackedStates,
        rows: &[Row],
        y: &[f64],
    ) -> Result<Vec<f64>, SizeError> {
        let jerk = |limit: &Limit| limit.quantity == Quantity::Jerk;
        if !self.limits.iter().any(jerk) {
            return Ok(Vec::new());
        }
        let count = states.len();
        let [.., jerk_i] = self.series(rows.iter(), y);
        let mut out = vec![0.0; states.q.len()];
        for (k, c) in self.info.independent.iter().enumerate() {
            out[c * count..(c + 1) * count].copy_from_slice(&jerk_i[k * count..(k + 1) * count]);
        }
        if !self.limits.iter().any(|limit| self.is_jerk_of_loop(limit)) {
            return Ok(out);
        }
        let moving = |values: &[f64], rates: &[f64], state: usize| -> Vec<Number> {
            let rates = states.at(rates, state);
            let pairs = states.at(values, state).zip(rates);
            let number = |(value, rate)| {
                let mut number = Number::constant(value);
                number.rates[0] = rate;
                number
            };
            pairs.map(number).collect()
        };
        for state in 0..count {
            let q = moving(&states.q, &states.qd, state);
            let qd = moving(&states.qd, &states.qdd, state);
            let all = moving(&states.qdd, &out, state);
            let qdd_i: Vec<Number> = self.info.independent.iter().map(|c| all[*c]).collect();
            let mut qdd = vec![Number::constant(0.0); q.len()];
            let _condition = self.derivatives.accelerations(&q, &qd, &qdd_i, &mut qdd)?;
            for c in self.info.dependent {
                out[c * count + state] = qdd[*c].rates[0];
            }
        }
        Ok(out)
    }

    /// The values of all limits at the closed states of these grid points, state by state; `pivots`:
    /// those of the velocities.
    pub(super) fn limit_values(
        &self,
        states: &TrackedStates,
        rows: &[Row],
        y: &[f64],
        pivots: &[f64],
    ) -> Result<Vec<f64>, SizeError> {
        let count = states.len();
        let mut unused = vec![1.0; count];
        let mut cones = vec![0.0; self.info.cones.len() * count];
        let arguments = Arguments {
            q: &states.q,
            qd: &states.qd,
            qdd: &states.qdd,
            phi: self.nominal.as_deref().unwrap_or_default(),
            ..Arguments::EMPTY
        };
        let model = self.model;
        eval_many(
            model,
            Function::Cones,
            count,
            arguments,
            &mut cones,
            &mut unused,
        )?;
        let mut efforts = Vec::new();
        if self.nominal.is_some() {
            efforts.resize(self.dof() * count, 0.0);
            let function = Function::InverseDynamics;
            eval_many(model, function, count, arguments, &mut efforts, &mut unused)?;
        }
        if self.info.actuated != self.info.independent && self.nominal.is_some() {
            for state in 0..count {
                let q: Vec<f64> = states.at(&states.q, state).collect();
                let tau = states.at(&efforts, state).collect();
                let own = self.of_actuators(model, &q, tau, 0.0)?;
                let slots = efforts.iter_mut().skip(state).step_by(count);
                for (slot, effort) in slots.zip(own) {
                    *slot = effort;
                }
            }
        }
        let jerks = self.jerks(states, rows, y)?;
        let each = self.limits.len();
        let mut out = vec![0.0; count * each];
        for (l, limit) in self.limits.iter().enumerate() {
            let (series, at) = match limit.quantity {
                Quantity::Position => (&states.q[..], limit.index()),
                Quantity::Velocity => (&states.qd[..], limit.index()),
                Quantity::Acceleration => (&states.qdd[..], limit.index()),
                Quantity::Jerk => (&jerks[..], limit.index()),
                Quantity::Effort => (&efforts[..], limit.index()),
                Quantity::SwingLimit => (&cones[..], limit.index()),
                Quantity::Singularity => (pivots, 0),
            };
            let series = series.get(at * count..(at + 1) * count).unwrap_or(&[]);
            for (slot, value) in out.iter_mut().skip(l).step_by(each).zip(series) {
                *slot = limit.excess(*value);
            }
        }
        Ok(out)
    }

    /// The observation matrix of a trajectory; `None` where the loops do not stay closed.
    pub(super) fn observed(
        &self,
        closure: &mut TrajectoryClosure<'_, M>,
        y: &[f64],
    ) -> Result<Option<Observed>, ExciteError> {
        let samples = self.grid.iter().step_by(self.stride);
        let Some(states) = self.closed(closure, samples, y)? else {
            return Ok(None);
        };
        let w = self.observation_matrix(&states)?;
        let mut weighted = w.clone();
        self.weigh(&mut weighted);
        Ok(Some(Observed { w, weighted }))
    }

    /// The rows of the observation matrix at closed states, column-major.
    pub(super) fn observation_matrix(&self, states: &TrackedStates) -> Result<Vec<f64>, SizeError> {
        let dof = self.dof();
        let count = states.len();
        let mut blocks = vec![0.0; dof * self.columns * count];
        let arguments = Arguments {
            q: &states.q,
            qd: &states.qd,
            qdd: &states.qdd,
            ..Arguments::EMPTY
        };
        let mut pivots = vec![1.0; count];
        eval_base_many(
            self.model,
            BaseFunction::BaseRegressor,
            count,
            arguments,
            &mut blocks,
            &mut pivots,
        )?;
        // entry k is that of row k % dof of column k / dof at each sample
        let rows = count * dof;
        let mut w = vec![0.0; rows * self.columns];
        for (k, series) in blocks.chunks_exact(count.max(1)).enumerate() {
            let column = w.iter_mut().skip((k / dof) * rows + k % dof).step_by(dof);
            for (slot, entry) in column.zip(series) {
                *slot = *entry;
            }
        }
        Ok(w)
    }
}
