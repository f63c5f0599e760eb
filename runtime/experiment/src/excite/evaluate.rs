//! Evaluation of a trajectory: limits and observation matrix, with their derivatives.

use super::criterion::Objective;
use super::limits::{Limit, LimitInputs};
use super::space::{Row, Space};
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

/// Objective, limits and their derivatives at one candidate trajectory.
#[derive(Clone, Debug)]
pub(super) struct Evaluation {
    pub(super) objective: f64,
    pub(super) gradient: Vec<f64>,
    /// The values of all limits, grid point by grid point.
    pub(super) values: Vec<f64>,
    /// The derivatives of each value by q, qd, qdd of the independent coordinates (3 dof each).
    pub(super) slopes: Vec<f64>,
}

/// The observation matrix of a trajectory, column-major, without and with weighted rows.
pub(super) struct Observed {
    pub(super) w: Vec<f64>,
    pub(super) weighted: Vec<f64>,
}

/// The quantities of one state, besides q, on which limits and regressor depend.
struct Motion<T> {
    qd: Vec<T>,
    qdd: Vec<T>,
    efforts: Vec<T>,
    cones: Vec<T>,
    pivot: T,
}

impl<M, D> Problem<'_, M, D>
where
    M: BaseModel<f64>,
    D: BaseModel<Number>,
{
    fn dof(&self) -> usize {
        self.info.dof()
    }

    /// Computes rates, efforts and the cosines of swing angles at the closed state `q`.
    fn motion<T: Scalar, E: BaseModel<T>>(
        &self,
        e: &E,
        q: &[T],
        qd_i: &[T],
        qdd_i: &[T],
        proto: T,
    ) -> Result<Motion<T>, SizeError> {
        let zero = proto.splat(0.0);
        let mut qd = vec![zero; q.len()];
        let mut qdd = vec![zero; q.len()];
        let pivot = e.velocities(q, qd_i, &mut qd)?.pivot;
        let _condition = e.accelerations(q, &qd, qdd_i, &mut qdd)?;
        let mut cones = vec![zero; self.info.cones.len()];
        e.cones(q, &mut cones)?;
        let efforts = match &self.nominal {
            None => Vec::new(),
            Some(phi) => {
                let phi: Vec<T> = phi.iter().map(|p| proto.splat(*p)).collect();
                let mut tau = vec![zero; self.dof()];
                let _condition = e.inverse_dynamics(q, &qd, &qdd, &phi, &mut tau)?;
                self.of_actuators(e, q, tau, proto)?
            }
        };
        Ok(Motion {
            qd,
            qdd,
            efforts,
            cones,
            pivot,
        })
    }

    /// Solves for the efforts of the actuated joints from the generalized forces `tau` of the
    /// independent coordinates; there are as many actuated joints as independent coordinates.
    fn of_actuators<T: Scalar, E: BaseModel<T>>(
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

    /// The value of each limit in one state.
    fn limit_values<T: Scalar>(&self, q: &[T], motion: &Motion<T>) -> Vec<T> {
        let inputs = LimitInputs {
            q,
            qd: &motion.qd,
            qdd: &motion.qdd,
            efforts: &motion.efforts,
            cones: &motion.cones,
            pivot: motion.pivot,
        };
        self.limits.iter().map(|l| l.value(&inputs)).collect()
    }

    /// The closed states at these grid points; `None` where the loops do not stay closed.
    fn closed<'a>(
        &self,
        closure: &mut TrajectoryClosure<'_, M>,
        rows: impl ExactSizeIterator<Item = &'a Row>,
        y: &[f64],
    ) -> Result<Option<TrackedStates>, ClosureError> {
        let (count, dof) = (rows.len(), self.dof());
        let mut series = [(); 3].map(|()| vec![0.0; dof * count]);
        for (state, row) in rows.enumerate() {
            for (series, values) in series.iter_mut().zip(row.at(y)) {
                let slots = series.iter_mut().skip(state).step_by(count);
                for (slot, value) in slots.zip(values) {
                    *slot = value;
                }
            }
        }
        closure.restart();
        let [q_i, qd_i, qdd_i] = series;
        let states = closure.track(count, &q_i, &qd_i, &qdd_i)?;
        let closes = states.outcomes.iter().all(|outcome| outcome.is_closed());
        Ok(closes.then_some(states))
    }

    /// Computes objective and limits with their derivatives at the variables `y`; `None` where the
    /// loops do not stay closed.
    pub(super) fn evaluate(
        &self,
        closure: &mut TrajectoryClosure<'_, M>,
        y: &[f64],
        sharpness: f64,
    ) -> Result<Option<Evaluation>, ExciteError> {
        let dof = self.dof();
        let (directions, entries) = (3 * dof, dof * self.columns);
        let samples = self.grid.len() / self.stride;
        let rows = samples * dof;
        let mut values = Vec::with_capacity(self.grid.len() * self.limits.len());
        let mut slopes = vec![0.0; self.grid.len() * self.limits.len() * directions];
        let mut w = vec![0.0; rows * self.columns];
        let mut rates = vec![0.0; samples * entries * directions];
        let zero = Number::constant(0.0);
        let mut step = vec![zero; self.info.dependent.len()];
        let mut block = vec![zero; entries];
        let Some(states) = self.closed(closure, self.grid.iter(), y)? else {
            return Ok(None);
        };
        for (g, row) in self.grid.iter().enumerate() {
            let at = row.at(y);
            for first in (0..directions).step_by(DIRECTIONS) {
                let part = |order: usize, c: usize| {
                    let direction = (order * dof + c).wrapping_sub(first);
                    Number::along(at[order][c], direction)
                };
                let closed = states.at(&states.q, g);
                let mut q: Vec<Number> = closed.map(Number::constant).collect();
                for (c, place) in self.info.independent.iter().enumerate() {
                    q[*place] = part(0, c);
                }
                // one Newton step from a closed state gives exact first derivatives
                let _condition = self.derivatives.newton_step(&q, &mut step)?;
                for (place, step) in self.info.dependent.iter().zip(&step) {
                    q[*place] = q[*place] + *step;
                }
                let qd_i: Vec<Number> = (0..dof).map(|c| part(1, c)).collect();
                let qdd_i: Vec<Number> = (0..dof).map(|c| part(2, c)).collect();
                let motion = self.motion(self.derivatives, &q, &qd_i, &qdd_i, zero)?;
                let count = DIRECTIONS.min(directions - first);
                for (l, value) in self.limit_values(&q, &motion).iter().enumerate() {
                    if first == 0 {
                        values.push(value.value);
                    }
                    let start = (g * self.limits.len() + l) * directions + first;
                    slopes[start..start + count].copy_from_slice(&value.rates[..count]);
                }
                if g % self.stride == 0 {
                    let s = g / self.stride;
                    let _condition =
                        self.derivatives
                            .base_regressor(&q, &motion.qd, &motion.qdd, &mut block)?;
                    for (k, entry) in block.iter().enumerate() {
                        w[(k / dof) * rows + s * dof + k % dof] = entry.value;
                        let start = (s * entries + k) * directions + first;
                        rates[start..start + count].copy_from_slice(&entry.rates[..count]);
                    }
                }
            }
        }
        if !w.iter().chain(&values).all(|x| x.is_finite()) {
            return Ok(None);
        }
        if self.criterion.is_weighted() {
            self.weigh(&mut w);
        }
        let Objective { value, mut slope } = self.criterion.objective(&w, self.columns, sharpness);
        if self.criterion.is_weighted() {
            self.weigh(&mut slope);
        }
        let mut gradient = vec![0.0; y.len()];
        let mut by_state = vec![0.0; directions];
        for s in 0..samples {
            by_state.fill(0.0);
            for k in 0..entries {
                let factor = slope[(k / dof) * rows + s * dof + k % dof];
                let start = (s * entries + k) * directions;
                for (b, r) in by_state.iter_mut().zip(&rates[start..start + directions]) {
                    *b += factor * r;
                }
            }
            self.grid[s * self.stride].pull(&by_state, &mut gradient);
        }
        Ok(Some(Evaluation {
            objective: value,
            gradient,
            values,
            slopes,
        }))
    }

    /// Divides the rows of `w` by the standard deviations of the efforts.
    fn weigh(&self, w: &mut [f64]) {
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
        let count = states.len();
        let mut pivots = vec![1.0; count];
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
            &mut pivots,
        )?;
        let mut efforts = Vec::new();
        if self.nominal.is_some() {
            efforts.resize(self.dof() * count, 0.0);
            let function = Function::InverseDynamics;
            eval_many(model, function, count, arguments, &mut efforts, &mut pivots)?;
        }
        // last, since the pivots that count are those of the velocities
        let independent = self.info.independent.iter();
        let qd_i: Vec<f64> = independent
            .flat_map(|c| &states.qd[c * count..(c + 1) * count])
            .copied()
            .collect();
        let rates = Arguments {
            q: &states.q,
            qd_i: &qd_i,
            ..Arguments::EMPTY
        };
        let mut qd = vec![0.0; states.qd.len()];
        eval_many(
            model,
            Function::Velocities,
            count,
            rates,
            &mut qd,
            &mut pivots,
        )?;
        let mut out = Vec::with_capacity(count * self.limits.len());
        let at = |series: &[f64], state: usize| states.at(series, state).collect::<Vec<f64>>();
        for (state, pivot) in pivots.iter().enumerate() {
            let q = at(&states.q, state);
            let efforts = match self.nominal {
                None => Vec::new(),
                Some(_) => self.of_actuators(model, &q, at(&efforts, state), 0.0)?,
            };
            let motion = Motion {
                qd: at(&qd, state),
                qdd: at(&states.qdd, state),
                efforts,
                cones: at(&cones, state),
                pivot: *pivot,
            };
            out.extend(self.limit_values(&q, &motion));
        }
        Ok(Some(out))
    }

    /// The observation matrix of a trajectory; `None` where the loops do not stay closed.
    pub(super) fn observed(
        &self,
        closure: &mut TrajectoryClosure<'_, M>,
        y: &[f64],
    ) -> Result<Option<Observed>, ExciteError> {
        let dof = self.dof();
        let samples = self.grid.iter().step_by(self.stride);
        let Some(states) = self.closed(closure, samples, y)? else {
            return Ok(None);
        };
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
        let mut weighted = w.clone();
        self.weigh(&mut weighted);
        Ok(Some(Observed { w, weighted }))
    }

    /// The derivatives by the variables of one entry of [`Evaluation::values`].
    pub(super) fn slope(&self, evaluation: &Evaluation, limit: usize) -> Vec<f64> {
        let directions = 3 * self.dof();
        let mut out = vec![0.0; self.space.size()];
        let start = limit * directions;
        let slope = &evaluation.slopes[start..start + directions];
        self.grid[limit / self.limits.len().max(1)].pull(slope, &mut out);
        out
    }

    /// The first-order change of each limit's value along a step of the variables.
    pub(super) fn changes(&self, evaluation: &Evaluation, step: &[f64]) -> Vec<f64> {
        let directions = 3 * self.dof();
        let each = self.limits.len();
        let mut out = Vec::with_capacity(evaluation.values.len());
        for (g, row) in self.grid.iter().enumerate() {
            let moved = row.at(step).concat();
            for l in 0..each {
                let start = (g * each + l) * directions;
                let slope = &evaluation.slopes[start..start + directions];
                out.push(super::space::dot(slope, &moved));
            }
        }
        out
    }
}
