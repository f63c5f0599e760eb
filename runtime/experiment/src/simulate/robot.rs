//! The robot between samples: forward dynamics, drives, friction, and the sensors' readings.

use super::audit::{Energy, moments, offsets, spring_power, springs};
use super::complete::{Weights, complete};
use super::control::Drive;
use super::forward::Forward;
use super::friction::friction_width;
use super::log::{Log, Termination};
use super::noise::Noise;
use super::settings::{Settings, SimulationError};
use regen_batch::{PredictedClosure, eval_many};
use regen_runtime::{Arguments, Condition, Friction, Function, Model, Outcome, SizeError, Status};

/// The continuous-time robot that is integrated between samples.
pub(super) struct Robot<'m, M: ?Sized> {
    model: &'m M,
    settings: &'m Settings,
    closure: PredictedClosure<'m, M>,
    forward: Forward<'m, M>,
    moments: Vec<[f64; 4]>,
    /// The constant effort of each coordinate, N m or N.
    offsets: Vec<f64>,
    /// All parameters, 0 except for those of springs and effort terms; empty if there are none of
    /// these, or the log has no energies.
    springs: Vec<f64>,
    pub(super) dof: usize,
    dependent: Vec<usize>,
    pub(super) actuated: Vec<usize>,
    /// The velocity over which the smoothed friction of each coordinate changes its direction, rad/s
    /// or m/s.
    friction_widths: Vec<f64>,
    /// Whether a coordinate has friction.
    has_friction: bool,
    pub(super) command: Vec<f64>,
    /// The independent positions (dof) to which the next three fields belong; `None` before the first
    /// state, and if they could not be computed.
    place: Option<Vec<f64>>,
    q: Vec<f64>,
    /// dq/dq_i: the dof rates of each coordinate, one coordinate after the other.
    columns: Vec<f64>,
    /// The condition of the mass matrix that `forward` has factored.
    condition: Condition<f64>,
    /// The independent positions and velocities (2 dof) of the state to which the next fields belong;
    /// `None` before the first state, and if the state could not be computed.
    at: Option<Vec<f64>>,
    qd: Vec<f64>,
    /// The reduced efforts of friction there (dof), N m or N.
    friction: Vec<f64>,
    /// The power of friction, springs and effort terms there, W; that of friction alone if the log has
    /// no energies.
    loss: f64,
    // results of the last call of `rates`
    qdd_i: Vec<f64>,
    effort: Vec<f64>,
    pub(super) dy: Vec<f64>,
    /// The independent accelerations of the samples in the log (dof each).
    logged: Vec<f64>,
    // buffers
    reduced: Vec<f64>,
    lanes: Lanes,
}

impl<'m, M: Model<f64> + ?Sized> Robot<'m, M> {
    pub(super) fn new(
        model: &'m M,
        phi: &[f64],
        settings: &'m Settings,
    ) -> Result<Self, SimulationError> {
        let info = model.info();
        let positive = [
            ("duration", settings.duration),
            ("period", settings.period),
            ("friction_width", settings.friction_width),
            ("tolerance", settings.tolerance),
        ];
        for (name, value) in positive {
            // false for NaN
            if !(value > 0.0 && value.is_finite()) {
                return Err(SimulationError::Setting(name));
            }
        }
        let fits = |argument, got: usize, expected: usize| {
            if got == 0 || got == expected {
                return Ok(());
            }
            Err(SizeError {
                argument,
                expected,
                got,
            })
        };
        let (n, dof, a) = (info.coordinates.len(), info.dof(), info.actuated.len());
        fits("pid", settings.pid.len(), a)?;
        fits("drives", settings.drives.len(), a)?;
        fits("offset", settings.offset.len(), a)?;
        fits("friction", settings.friction.len(), n)?;
        let forward = Forward::new(model, phi)?;
        Ok(Self {
            model,
            settings,
            closure: PredictedClosure::new(model)?,
            moments: moments(&info, phi),
            offsets: offsets(&info, phi),
            springs: if settings.energies {
                springs(&info, phi)
            } else {
                Vec::new()
            },
            forward,
            dof,
            dependent: info.dependent.to_vec(),
            actuated: info.actuated.to_vec(),
            friction_widths: (0..n)
                .map(|k| friction_width(info.joints.get(k), settings.friction_width))
                .collect(),
            has_friction: settings.friction.iter().any(|f| f.law != Friction::None),
            command: if settings.offset.is_empty() {
                vec![0.0; a]
            } else {
                settings.offset.clone()
            },
            place: None,
            q: vec![0.0; n],
            columns: Vec::new(),
            condition: Condition::regular(1.0),
            at: None,
            qd: vec![0.0; n],
            friction: vec![0.0; dof],
            loss: 0.0,
            qdd_i: vec![0.0; dof],
            effort: vec![0.0; a],
            dy: vec![0.0; 2 * n + a + 2],
            logged: Vec::new(),
            reduced: vec![0.0; dof],
            lanes: Lanes::new(n, dof),
        })
    }

    /// The size of each entry of the state vector below which its tolerance is absolute: 1 rad or m
    /// (per s) and 100 N, N m or J; the dependent coordinates, which are closed anew, have none.
    pub(super) fn scales(&self) -> Vec<f64> {
        let rate = [1.0, f64::INFINITY];
        let sizes = [self.dof, self.dependent.len()];
        let mut scales = Vec::with_capacity(self.dy.len());
        for _ in 0..2 {
            for (scale, size) in rate.iter().zip(sizes) {
                scales.extend(std::iter::repeat_n(*scale, size));
            }
        }
        scales.resize(self.dy.len(), 1e2);
        scales
    }

    /// The number of positions in the state vector y, which has the same number of velocities: q_i,
    /// the dependent coordinates, qd_i, their velocities, the efforts of drives with lag, work, loss.
    pub(super) fn positions(&self) -> usize {
        self.dof + self.dependent.len()
    }

    /// The state vector at these independent positions and velocities (dof each), of which the
    /// dependent coordinates are not known.
    pub(super) fn state(&self, q_i: &[f64], qd_i: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; self.dy.len()];
        let (positions, rest) = y.split_at_mut(self.positions());
        let (velocities, rest) = rest.split_at_mut(positions.len());
        let drives = self.command.len();
        positions[..self.dof].copy_from_slice(q_i);
        velocities[..self.dof].copy_from_slice(qd_i);
        rest[..drives].copy_from_slice(&self.command);
        y
    }

    /// Replaces the dependent coordinates and velocities of a state vector, which were integrated, by
    /// those of the closed loops, if they are known.
    pub(super) fn settle(&self, y: &mut [f64]) {
        if self.is_at(y) {
            let (positions, rest) = y.split_at_mut(self.positions());
            for (slots, all) in [(positions, &self.q), (rest, &self.qd)] {
                for (slot, c) in slots[self.dof..].iter_mut().zip(&self.dependent) {
                    *slot = all[*c];
                }
            }
        }
    }

    /// The independent velocities of a state vector.
    fn velocities<'y>(&self, y: &'y [f64]) -> &'y [f64] {
        &y[self.positions()..self.positions() + self.dof]
    }

    /// Whether a state vector has the positions and velocities for which `rates` was last called.
    fn is_at(&self, y: &[f64]) -> bool {
        let own = y[..self.dof].iter().chain(self.velocities(y));
        self.at.as_ref().is_some_and(|at| at.iter().eq(own))
    }

    fn drive(&self, k: usize) -> Drive {
        self.settings.drives.get(k).copied().unwrap_or_default()
    }

    /// Why a run ends if the closure fails; for a robot without loops, the motion has diverged.
    fn stopped(&self, outcome: Outcome) -> Termination {
        if self.q.len() == self.dof {
            Termination::Diverged
        } else {
            Termination::Open(outcome)
        }
    }

    /// Computes everything that depends on positions alone.
    fn move_to_place(&mut self, y: &[f64]) -> Result<Result<(), Termination>, SimulationError> {
        let dof = self.dof;
        let mut place = self.place.take().unwrap_or_default();
        let outcome = self.closure.close(&y[..dof], &y[dof..self.positions()])?;
        if !outcome.is_closed() {
            return Ok(Err(self.stopped(outcome)));
        }
        self.q.copy_from_slice(self.closure.q());
        if self.columns.is_empty() || !self.dependent.is_empty() {
            self.columns.clear();
            let columns = self.lanes.columns(self.model, &self.q)?;
            self.columns.extend(columns);
        }
        let Some(condition) = self.forward.place(&self.q)? else {
            return Ok(Err(Termination::NotPositiveDefinite));
        };
        self.condition = condition;
        place.clear();
        place.extend_from_slice(&y[..dof]);
        self.place = Some(place);
        Ok(Ok(()))
    }

    /// Computes what depends on positions and velocities alone.
    fn move_to(&mut self, y: &[f64]) -> Result<Result<(), Termination>, SimulationError> {
        let dof = self.dof;
        let mut at = self.at.take().unwrap_or_default();
        if self.place.as_deref() != Some(&y[..dof])
            && let Err(stop) = self.move_to_place(y)?
        {
            return Ok(Err(stop));
        }
        let qd_i = self.velocities(y);
        for (v, rates) in self
            .qd
            .iter_mut()
            .zip(self.columns.chunks_exact(dof.max(1)))
        {
            *v = rates.iter().zip(qd_i).map(|(rate, v)| rate * v).sum();
        }
        self.loss = 0.0;
        if self.has_friction {
            self.friction.fill(0.0);
            let laws = self.settings.friction.iter().zip(&self.friction_widths);
            let rates = self.columns.chunks_exact(dof.max(1));
            for (((law, width), v), rates) in laws.zip(&self.qd).zip(rates) {
                let effort = law.smooth_effort(*v, *width);
                self.loss += effort * v;
                for (share, rate) in self.friction.iter_mut().zip(rates) {
                    *share += rate * effort;
                }
            }
        }
        let condition = self.forward.set_velocities(&self.q, &self.qd)?;
        let condition = condition.worst(self.condition);
        if condition.status() == Status::Singular {
            let outcome = Outcome::Singular { at: 1.0, condition };
            return Ok(Err(self.stopped(outcome)));
        }
        if !self.springs.is_empty() {
            let state = [self.q.as_slice(), self.qd.as_slice(), qd_i];
            self.loss += spring_power(self.model, &self.springs, state, &mut self.reduced)?;
        }
        at.clear();
        at.extend_from_slice(&y[..dof]);
        at.extend_from_slice(qd_i);
        self.at = Some(at);
        Ok(Ok(()))
    }

    /// Computes the derivative of the state `y` into `dy`, and all coordinates, velocities,
    /// accelerations and efforts into their buffers.
    pub(super) fn rates(&mut self, y: &[f64]) -> Result<Result<(), Termination>, SimulationError> {
        let (dof, n) = (self.dof, self.positions());
        let mut known = y[..dof].iter().chain(&y[n..n + dof]).chain(&y[2 * n..]);
        if known.any(|v| !v.is_finite()) {
            return Ok(Err(Termination::Diverged));
        }
        // at a change of the command only the efforts differ
        if !self.is_at(y)
            && let Err(stop) = self.move_to(y)?
        {
            return Ok(Err(stop));
        }
        // drives: y' = (command - y) / lag
        let at = 2 * n;
        for (k, built_up) in y[at..at + self.effort.len()].iter().enumerate() {
            let lag = self.drive(k).lag;
            if lag > 0.0 {
                self.effort[k] = *built_up;
                self.dy[at + k] = (self.command[k] - built_up) / lag;
            } else {
                // its entry of y stays as it is
                self.effort[k] = self.command[k];
            }
        }
        let _condition = self
            .model
            .generalized_forces(&self.q, &self.effort, &mut self.reduced)?;
        for (reduced, share) in self.reduced.iter_mut().zip(&self.friction) {
            *reduced -= share;
        }
        self.forward.solve(&self.reduced, &mut self.qdd_i);
        let (velocities, rest) = self.dy.split_at_mut(n);
        velocities[..dof].copy_from_slice(&y[n..n + dof]);
        rest[..dof].copy_from_slice(&self.qdd_i);
        let slots = velocities[dof..].iter_mut().zip(&mut rest[dof..n]);
        for ((velocity, acceleration), c) in slots.zip(&self.dependent) {
            *velocity = self.qd[*c];
            let rates = self.columns[c * dof..(c + 1) * dof].iter();
            let own: f64 = rates.zip(&self.qdd_i).map(|(rate, a)| rate * a).sum();
            *acceleration = self.forward.without_acceleration()[*c] + own;
        }
        let joints = self.actuated.iter().zip(&self.effort);
        let power: f64 = joints.map(|(j, e)| self.qd[*j] * e).sum();
        let end = self.dy.len();
        self.dy[end - 2] = power;
        self.dy[end - 1] = self.loss;
        Ok(Ok(()))
    }

    /// The velocities of the actuated joints at the state of the last call of `rates`, rad/s or m/s.
    pub(super) fn driven_velocities(&self) -> Vec<f64> {
        self.actuated.iter().map(|j| self.qd[*j]).collect()
    }

    /// The encoder readings of the actuated joints, rad or m.
    pub(super) fn measured(
        &mut self,
        y: &[f64],
        noise: &mut Noise,
    ) -> Result<Vec<f64>, SimulationError> {
        if self.place.as_deref() != Some(&y[..self.dof]) {
            (self.place, self.at) = (None, None);
            let predicted = &y[self.dof..self.positions()];
            let _outcome = self.closure.close(&y[..self.dof], predicted)?;
            self.q.copy_from_slice(self.closure.q());
        }
        let sensors = self.settings.sensors;
        let joints = self.actuated.iter();
        Ok(joints
            .map(|j| sensors.position(self.q[*j], noise))
            .collect())
    }

    /// Adds a sample at which the command changes from `held` to `self.command`.
    ///
    /// The effort of a drive without lag jumps there. The recorded effort is the mean of the two
    /// one-sided limits, and the recorded acceleration is that of this mean: the positions one
    /// period before and after lie on parabolas with the two accelerations, so that their second
    /// difference is the mean of both.
    pub(super) fn record(
        &mut self,
        t: f64,
        y: &[f64],
        measured: &[f64],
        held: &[f64],
        noise: &mut Noise,
        log: &mut Log,
    ) -> Result<Result<(), Termination>, SimulationError> {
        let next = self.command.clone();
        for (command, held) in self.command.iter_mut().zip(held) {
            *command = f64::midpoint(*held, *command);
        }
        let rates = self.rates(y);
        self.command = next;
        if let Err(stop) = rates? {
            return Ok(Err(stop));
        }
        self.logged.extend(&self.qdd_i);
        log.t.push(t);
        log.q.extend(&self.q);
        log.qd.extend(&self.qd);
        log.effort.extend(&self.effort);
        log.measured_position.extend(measured);
        let sensors = self.settings.sensors;
        let measured_effort = self.effort.iter().map(|e| sensors.effort(*e, noise));
        log.measured_effort.extend(measured_effort);
        log.residual = log.residual.max(self.closure.residual());
        if self.settings.energies {
            log.energy.push(Energy {
                work: y[y.len() - 2],
                loss: y[y.len() - 1],
                ..Energy::default()
            });
        }
        Ok(Ok(()))
    }

    /// Completes the log with the columns that are not computed while the robot runs.
    pub(super) fn complete(&self, log: &mut Log) -> Result<(), SizeError> {
        let weights = Weights {
            phi: self.forward.phi(),
            moments: &self.moments,
            offsets: &self.offsets,
        };
        complete(self.model, &weights, &self.logged, log)
    }
}

/// The velocities at one state at the unit velocity of each independent coordinate.
struct Lanes {
    q: Vec<f64>,
    /// One series of dof values per independent coordinate.
    qd_i: Vec<f64>,
    out: Vec<f64>,
    pivots: Vec<f64>,
}

impl Lanes {
    fn new(n: usize, dof: usize) -> Self {
        let mut qd_i = vec![0.0; dof * dof];
        for k in 0..dof {
            qd_i[k * dof + k] = 1.0;
        }
        Self {
            q: vec![0.0; n * dof],
            qd_i,
            out: vec![0.0; n * dof],
            pivots: vec![1.0; dof],
        }
    }

    /// For each coordinate, its dof velocities at unit velocities.
    fn columns<M: Model<f64> + ?Sized>(
        &mut self,
        model: &M,
        q: &[f64],
    ) -> Result<&[f64], SizeError> {
        let lanes = self.pivots.len();
        for (series, q) in self.q.chunks_exact_mut(lanes.max(1)).zip(q) {
            series.fill(*q);
        }
        let arguments = Arguments {
            q: &self.q,
            qd_i: &self.qd_i,
            ..Arguments::EMPTY
        };
        eval_many(
            model,
            Function::Velocities,
            lanes,
            arguments,
            &mut self.out,
            &mut self.pivots,
        )?;
        Ok(&self.out)
    }
}
