//! Derivatives of objective and limits by the variables.
//!
//! Values are computed at blocks of states. Derivatives by dual numbers are computed state by state
//! and take many times as long, so they are computed only of the observation matrix at its samples
//! and of the quantities that are near a limit. The derivatives of the coordinates by the
//! independent ones, which are also those of their velocities and accelerations by the independent
//! ones', are the velocities when one independent coordinate has velocity 1 and the others stand
//! still.

use super::criterion::Objective;
use super::evaluate::{Number, Problem};
use super::limits::{Limit, Quantity};
use super::space::ORDERS;
use super::{DIRECTIONS, ExciteError};
use regen_batch::{TrackedStates, TrajectoryClosure};
use regen_runtime::{BaseModel, SizeError};

/// The step in time of a difference, relative to a radian of the highest harmonic: the error of the
/// difference is of its square, 1e-8, and that of rounding 1e-12.
const JERK_STEP: f64 = 1e-4;

/// Objective, limits and their derivatives at one candidate trajectory.
#[derive(Clone, Debug)]
pub(super) struct Evaluation {
    pub(super) objective: f64,
    pub(super) gradient: Vec<f64>,
    /// The values of all limits, grid point by grid point.
    pub(super) values: Vec<f64>,
    /// The derivatives of each value by position, velocity, acceleration and jerk of the independent
    /// coordinates (4 dof each); 0 where the value is far below 0.
    pub(super) slopes: Vec<f64>,
    /// The indices of the values whose derivatives were computed.
    pub(super) near: Vec<usize>,
    /// The closed states of the grid.
    states: TrackedStates,
}

/// The closed states of the grid, with the rates of the coordinates.
struct Grid {
    states: TrackedStates,
    /// For each independent coordinate the derivatives of all n coordinates by it, series over the
    /// states.
    rates: Vec<Vec<f64>>,
}

/// The rates of a state that are needed with derivatives; each needs those before it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Rates {
    None,
    /// Velocities, with the distance from singularities.
    Velocities,
    Accelerations,
    Efforts,
}

/// The quantities of a state that are needed with derivatives.
#[derive(Clone, Copy)]
struct Needed {
    rates: Rates,
    cones: bool,
}

/// Quantities of one state with their derivatives in some directions; empty where not needed.
struct Motion {
    qd: Vec<Number>,
    qdd: Vec<Number>,
    efforts: Vec<Number>,
    cones: Vec<Number>,
    pivot: Number,
}

impl<M, D> Problem<'_, M, D>
where
    M: BaseModel<f64>,
    D: BaseModel<Number>,
{
    /// Computes objective and limits at the variables `y`, with the derivatives of the objective and
    /// of those limits whose value is above `-near`; `None` where the loops do not stay closed.
    ///
    /// - `from`: the evaluation at variables nearby, if there is one.
    pub(super) fn evaluate(
        &self,
        closure: &mut TrajectoryClosure<'_, M>,
        y: &[f64],
        sharpness: f64,
        near: f64,
        from: Option<&Evaluation>,
    ) -> Result<Option<Evaluation>, ExciteError> {
        let dof = self.dof();
        let (directions, width) = (3 * dof, ORDERS * dof);
        let from = from.map(|from| &from.states);
        let Some(states) = self.closed_grid(closure, y, from)? else {
            return Ok(None);
        };
        let (rates, pivots) = self.coordinate_rates(&states)?;
        let values = self.limit_values(&states, &self.grid, y, &pivots)?;
        let mut w = self.observation_matrix(&self.samples(&states))?;
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
        let grid = Grid { states, rates };
        let each = self.limits.len();
        let above = values.iter().enumerate();
        let above = above.filter_map(|(k, value)| (*value > -near).then_some(k));
        let above: Vec<usize> = above.collect();
        let mut slopes = vec![0.0; values.len() * width];
        let mut gradient = vec![0.0; y.len()];
        let mut by_state = vec![0.0; width];
        let mut block = vec![Number::constant(0.0); dof * self.columns];
        let rows = slope.len() / self.columns.max(1);
        for (g, row) in self.grid.iter().enumerate() {
            let own = &values[g * each..(g + 1) * each];
            let mut needed = self.needed(own, near);
            let own = own.iter().map(|value| *value > -near);
            let own: Vec<bool> = own.collect();
            let is_sample = g % self.stride == 0;
            let slopes = &mut slopes[g * each * width..(g + 1) * each * width];
            self.fill_linear(&grid, g, &own, slopes);
            if is_sample {
                needed.rates = needed.rates.max(Rates::Accelerations);
            }
            if needed.rates == Rates::None && !needed.cones {
                continue;
            }
            by_state.fill(0.0);
            for first in (0..directions).step_by(DIRECTIONS) {
                let count = DIRECTIONS.min(directions - first);
                let q = grid.duals(g, first);
                let motion = self.motion(&grid, g, first, &q, needed)?;
                self.fill_duals(&motion, &own, first, slopes);
                if is_sample {
                    let s = g / self.stride;
                    let _condition =
                        self.derivatives
                            .base_regressor(&q, &motion.qd, &motion.qdd, &mut block)?;
                    for (k, entry) in block.iter().enumerate() {
                        let factor = slope[(k / dof) * rows + s * dof + k % dof];
                        let by_state = &mut by_state[first..first + count];
                        for (b, rate) in by_state.iter_mut().zip(&entry.rates) {
                            *b += factor * rate;
                        }
                    }
                }
            }
            self.fill_jerks(&grid, g, &row.at(y), &own, slopes)?;
            if is_sample {
                row.pull(&by_state, &mut gradient);
            }
        }
        Ok(Some(Evaluation {
            objective: value,
            gradient,
            values,
            slopes,
            near: above,
            states: grid.states,
        }))
    }

    /// The states of the samples of the observation matrix, among those of the grid.
    fn samples(&self, states: &TrackedStates) -> TrackedStates {
        let count = states.len();
        let thin = |series: &[f64]| -> Vec<f64> {
            let each = series.chunks_exact(count.max(1));
            each.flat_map(|series| series.iter().step_by(self.stride))
                .copied()
                .collect()
        };
        TrackedStates {
            q: thin(&states.q),
            qd: thin(&states.qd),
            qdd: thin(&states.qdd),
            outcomes: states
                .outcomes
                .iter()
                .step_by(self.stride)
                .copied()
                .collect(),
        }
    }

    /// For each independent coordinate, the derivatives of all coordinates by it at all states; and
    /// the pivots.
    fn coordinate_rates(
        &self,
        states: &TrackedStates,
    ) -> Result<(Vec<Vec<f64>>, Vec<f64>), SizeError> {
        let (dof, count) = (self.dof(), states.len());
        let mut pivots = vec![1.0; count];
        let mut out = Vec::with_capacity(dof);
        for k in 0..dof {
            let mut unit = vec![0.0; dof * count];
            unit[k * count..(k + 1) * count].fill(1.0);
            let (rates, own) = self.velocities(states, &unit)?;
            pivots = own;
            out.push(rates);
        }
        Ok((out, pivots))
    }

    /// The quantities of a state whose limits have values above `-near`, except for those whose
    /// derivatives the rates of the coordinates give.
    fn needed(&self, values: &[f64], near: f64) -> Needed {
        let mut out = Needed {
            rates: Rates::None,
            cones: false,
        };
        for (limit, value) in self.limits.iter().zip(values) {
            if *value <= -near {
                continue;
            }
            let depends = !self.info.independent.contains(&limit.index());
            let rates = match limit.quantity {
                Quantity::Velocity if depends => Rates::Velocities,
                Quantity::Acceleration | Quantity::Jerk if depends => Rates::Accelerations,
                Quantity::Position
                | Quantity::Velocity
                | Quantity::Acceleration
                | Quantity::Jerk => Rates::None,
                Quantity::Effort => Rates::Efforts,
                Quantity::SwingLimit => {
                    out.cones = true;
                    Rates::None
                }
                Quantity::Singularity => Rates::Velocities,
            };
            out.rates = out.rates.max(rates);
        }
        out
    }

    /// Fills the derivatives that the rates of the coordinates give: those of positions, of
    /// velocities by the independent velocities, and of accelerations and jerks by the independent
    /// ones.
    fn fill_linear(&self, grid: &Grid, g: usize, near: &[bool], slopes: &mut [f64]) {
        let (dof, count) = (self.dof(), grid.states.len());
        let each = slopes.chunks_exact_mut(ORDERS * dof);
        for ((limit, near), slopes) in self.limits.iter().zip(near).zip(each) {
            let order = match limit.quantity {
                Quantity::Position => 0,
                Quantity::Velocity => 1,
                Quantity::Acceleration => 2,
                Quantity::Jerk => 3,
                _ => continue,
            };
            if !near {
                continue;
            }
            let own = &mut slopes[order * dof..(order + 1) * dof];
            for (slot, rates) in own.iter_mut().zip(&grid.rates) {
                *slot = limit.rate(rates[limit.index() * count + g]);
            }
        }
    }

    /// Computes what is needed at the closed state `q`, with derivatives in the directions from
    /// `first` on.
    fn motion(
        &self,
        grid: &Grid,
        g: usize,
        first: usize,
        q: &[Number],
        needed: Needed,
    ) -> Result<Motion, SizeError> {
        let (e, dof) = (self.derivatives, self.dof());
        let zero = Number::constant(0.0);
        let mut out = Motion {
            qd: Vec::new(),
            qdd: Vec::new(),
            efforts: Vec::new(),
            cones: Vec::new(),
            pivot: zero,
        };
        let independent = |order: usize, series: &[f64]| -> Vec<Number> {
            let count = grid.states.len();
            let places = self.info.independent.iter().enumerate();
            places
                .map(|(k, c)| {
                    let direction = (order * dof + k).wrapping_sub(first);
                    Number::along(series[c * count + g], direction)
                })
                .collect()
        };
        if needed.cones {
            out.cones = vec![zero; self.info.cones.len()];
            e.cones(q, &mut out.cones)?;
        }
        if needed.rates >= Rates::Velocities {
            let qd_i = independent(1, &grid.states.qd);
            out.qd = vec![zero; q.len()];
            out.pivot = e.velocities(q, &qd_i, &mut out.qd)?.pivot;
        }
        if needed.rates >= Rates::Accelerations {
            let qdd_i = independent(2, &grid.states.qdd);
            out.qdd = vec![zero; q.len()];
            let _condition = e.accelerations(q, &out.qd, &qdd_i, &mut out.qdd)?;
        }
        if needed.rates >= Rates::Efforts
            && let Some(phi) = &self.nominal
        {
            let phi: Vec<Number> = phi.iter().map(|p| Number::constant(*p)).collect();
            let mut tau = vec![zero; dof];
            let _condition = e.inverse_dynamics(q, &out.qd, &out.qdd, &phi, &mut tau)?;
            out.efforts = self.of_actuators(e, q, tau, zero)?;
        }
        Ok(out)
    }

    /// Fills the derivatives that dual numbers give, in the directions from `first` on; for jerks of
    /// dependent coordinates those of the acceleration, of which `fill_jerks` makes theirs.
    fn fill_duals(&self, motion: &Motion, near: &[bool], first: usize, slopes: &mut [f64]) {
        let directions = 3 * self.dof();
        let count = DIRECTIONS.min(directions - first);
        let each = slopes.chunks_exact_mut(ORDERS * self.dof());
        for ((limit, near), slopes) in self.limits.iter().zip(near).zip(each) {
            let number = match limit.quantity {
                Quantity::Position => None,
                Quantity::Velocity => motion.qd.get(limit.index()),
                Quantity::Jerk if !self.is_jerk_of_loop(limit) => None,
                Quantity::Acceleration | Quantity::Jerk => motion.qdd.get(limit.index()),
                Quantity::Effort => motion.efforts.get(limit.index()),
                Quantity::SwingLimit => motion.cones.get(limit.index()),
                Quantity::Singularity => Some(&motion.pivot),
            };
            let Some(number) = number.filter(|_| *near) else {
                continue;
            };
            let slopes = &mut slopes[first..first + count];
            for (slot, rate) in slopes.iter_mut().zip(&number.rates) {
                *slot = limit.rate(*rate);
            }
        }
    }

    /// Makes derivatives of the jerks of dependent coordinates of those of their accelerations.
    ///
    /// Along a motion `qdd = J qdd_i + H(qd_i, qd_i)` and `qddd = J qddd_i + 3 H(qd_i, qdd_i) +
    /// T(qd_i, qd_i, qd_i)`, where J, H and T are the derivatives of the coordinates by the independent
    /// ones. So `d qddd/d qdd_i = 3/2 d qdd/d qd_i`, `d qddd/d qd_i = 3 d qdd/d q_i`, and
    /// `d qddd/d q_i` is the rate of `d qdd/d q_i` along the motion, here a difference of two exact
    /// derivatives beside the state.
    ///
    /// - `independent`: position, velocity, acceleration and jerk of the independent coordinates.
    fn fill_jerks(
        &self,
        grid: &Grid,
        g: usize,
        independent: &[Vec<f64>; ORDERS],
        near: &[bool],
        slopes: &mut [f64],
    ) -> Result<(), SizeError> {
        let dof = self.dof();
        let is_wanted = |(limit, near): (&Limit, &bool)| *near && self.is_jerk_of_loop(limit);
        if !self.limits.iter().zip(near).any(is_wanted) {
            return Ok(());
        }
        let step = self.space.shortest() * JERK_STEP;
        let mut rates = vec![Vec::new(); 2];
        for (rates, h) in rates.iter_mut().zip([-step, step]) {
            *rates = self.acceleration_rates(grid, g, independent, h)?;
        }
        let [before, after] = &rates[..] else {
            return Ok(());
        };
        let each = slopes.chunks_exact_mut(ORDERS * dof);
        for ((limit, near), slopes) in self.limits.iter().zip(near).zip(each) {
            if !is_wanted((limit, near)) {
                continue;
            }
            for k in 0..dof {
                slopes[2 * dof + k] = 1.5 * slopes[dof + k];
                slopes[dof + k] = 3.0 * slopes[k];
                let at = k * self.info.coordinates.len() + limit.index();
                slopes[k] = limit.rate((after[at] - before[at]) / (2.0 * step));
            }
        }
        Ok(())
    }

    /// The derivatives of all accelerations by each independent coordinate, one after the other, at the
    /// state to which the motion goes on from a grid point in the time `h`, s. It closes the loops to
    /// the second order of `h`, which a difference of two such states does not see.
    fn acceleration_rates(
        &self,
        grid: &Grid,
        g: usize,
        independent: &[Vec<f64>; ORDERS],
        h: f64,
    ) -> Result<Vec<f64>, SizeError> {
        let (dof, states) = (self.dof(), &grid.states);
        let ahead = |values: &[f64], rates: &[f64]| -> Vec<f64> {
            let pairs = values.iter().zip(rates);
            pairs.map(|(value, rate)| value + h * rate).collect()
        };
        let q: Vec<f64> = states.at(&states.q, g).collect();
        let qd: Vec<f64> = states.at(&states.qd, g).collect();
        let q = ahead(&q, &qd);
        let [_, qd_i, qdd_i, jerk_i] = independent;
        let constants = |values: Vec<f64>| -> Vec<Number> {
            values.into_iter().map(Number::constant).collect()
        };
        let rates_i = constants(ahead(qd_i, qdd_i));
        let accelerations_i = constants(ahead(qdd_i, jerk_i));
        let mut out = vec![0.0; dof * q.len()];
        for first in (0..dof).step_by(DIRECTIONS) {
            let mut along = constants(q.clone());
            for k in first..dof.min(first + DIRECTIONS) {
                let mut unit = vec![0.0; dof];
                unit[k] = 1.0;
                let mut column = vec![0.0; q.len()];
                let _condition = self.model.velocities(&q, &unit, &mut column)?;
                for (number, rate) in along.iter_mut().zip(column) {
                    number.rates[k - first] = rate;
                }
            }
            let mut qd = vec![Number::constant(0.0); q.len()];
            let _condition = self.derivatives.velocities(&along, &rates_i, &mut qd)?;
            let mut qdd = vec![Number::constant(0.0); q.len()];
            let _condition =
                self.derivatives
                    .accelerations(&along, &qd, &accelerations_i, &mut qdd)?;
            for k in first..dof.min(first + DIRECTIONS) {
                for (slot, number) in out[k * q.len()..].iter_mut().zip(&qdd) {
                    *slot = number.rates[k - first];
                }
            }
        }
        Ok(out)
    }

    /// The derivatives by the variables of one entry of [`Evaluation::values`].
    pub(super) fn slope(&self, evaluation: &Evaluation, limit: usize) -> Vec<f64> {
        let directions = ORDERS * self.dof();
        let mut out = vec![0.0; self.space.size()];
        let start = limit * directions;
        let slope = &evaluation.slopes[start..start + directions];
        self.grid[limit / self.limits.len().max(1)].pull(slope, &mut out);
        out
    }

    /// The first-order change along a step of the variables of each value in
    /// [`near`](Evaluation::near).
    pub(super) fn changes(&self, evaluation: &Evaluation, step: &[f64]) -> Vec<f64> {
        let directions = ORDERS * self.dof();
        let each = self.limits.len().max(1);
        let mut moved: Option<(usize, Vec<f64>)> = None;
        let mut out = Vec::with_capacity(evaluation.near.len());
        for k in &evaluation.near {
            let g = k / each;
            let (_, along) = match moved.take() {
                Some(own) if own.0 == g => moved.insert(own),
                _ => moved.insert((g, self.grid[g].at(step).concat())),
            };
            let slope = &evaluation.slopes[k * directions..(k + 1) * directions];
            out.push(super::space::dot(slope, along));
        }
        out
    }
}

impl Grid {
    /// The coordinates at one state with their derivatives in the directions from `first` on.
    fn duals(&self, g: usize, first: usize) -> Vec<Number> {
        let count = self.states.len();
        let values = self.states.at(&self.states.q, g).map(Number::constant);
        let mut q: Vec<Number> = values.collect();
        for (k, rates) in self.rates.iter().enumerate() {
            let Some(direction) = k.checked_sub(first).filter(|d| *d < DIRECTIONS) else {
                continue;
            };
            for (q, rate) in q.iter_mut().zip(rates.iter().skip(g).step_by(count)) {
                q.rates[direction] = *rate;
            }
        }
        q
    }
}
