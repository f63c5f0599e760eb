//! The robot between samples: forward dynamics, drives, friction, and the sensors' readings.

use super::audit::{Energy, kinetic, moments, offsets, potential, spring_power, springs};
use super::control::Drive;
use super::forward::{Forward, ForwardOutcome};
use super::log::{Log, Termination};
use super::noise::Noise;
use super::settings::{Settings, SimulationError};
use regen_runtime::{Joint, LoopClosure, Model, Outcome, SizeError, Status};

/// The continuous-time robot that is integrated between samples.
pub(super) struct Robot<'m, M: ?Sized> {
    model: &'m M,
    settings: &'m Settings,
    closure: LoopClosure<'m, M>,
    forward: Forward<'m, M>,
    moments: Vec<[f64; 4]>,
    /// The constant effort of each coordinate, N m or N.
    offsets: Vec<f64>,
    /// The parameters of springs and effort terms, all others 0; empty without any.
    springs: Vec<f64>,
    gravity: [f64; 3],
    pub(super) dof: usize,
    independent: Vec<usize>,
    pub(super) actuated: Vec<usize>,
    /// The velocity over which the smoothed friction of each coordinate changes its direction.
    friction_widths: Vec<f64>,
    pub(super) command: Vec<f64>,
    // results of the last call of `rates`
    q: Vec<f64>,
    qd: Vec<f64>,
    qdd_i: Vec<f64>,
    effort: Vec<f64>,
    pub(super) dy: Vec<f64>,
    residual: f64,
    // buffers
    reduced: Vec<f64>,
    column: Vec<f64>,
    unit: Vec<f64>,
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
            closure: LoopClosure::new(model)?,
            moments: moments(&info, phi),
            offsets: offsets(&info, phi),
            springs: springs(&info, phi),
            gravity: info.gravity,
            forward,
            dof,
            independent: info.independent.to_vec(),
            actuated: info.actuated.to_vec(),
            friction_widths: (0..n)
                .map(|k| friction_width(info.joints.get(k), settings.friction_width))
                .collect(),
            command: if settings.offset.is_empty() {
                vec![0.0; a]
            } else {
                settings.offset.clone()
            },
            q: vec![0.0; n],
            qd: vec![0.0; n],
            qdd_i: vec![0.0; dof],
            effort: vec![0.0; a],
            dy: vec![0.0; 2 * dof + a + 2],
            residual: 0.0,
            reduced: vec![0.0; dof],
            column: vec![0.0; n],
            unit: vec![0.0; dof],
        })
    }

    /// The length of the state vector y: q_i, qd_i, the efforts of drives with lag, work, loss.
    pub(super) fn size(&self) -> usize {
        2 * self.dof + self.actuated.len() + 2
    }

    fn drive(&self, k: usize) -> Drive {
        self.settings.drives.get(k).copied().unwrap_or_default()
    }

    /// Why a run ends where the closure has no result: a robot without loops ran away.
    fn stopped(&self, outcome: Outcome) -> Termination {
        if self.q.len() == self.dof {
            Termination::Diverged
        } else {
            Termination::Open(outcome)
        }
    }

    /// Computes the derivative of the state `y` into `dy`, and all coordinates, velocities,
    /// accelerations and efforts into their buffers.
    pub(super) fn rates(&mut self, y: &[f64]) -> Result<Result<(), Termination>, SimulationError> {
        let (q_i, rest) = y.split_at(self.dof);
        let (qd_i, rest) = rest.split_at(self.dof);
        let (built_up, _) = rest.split_at(self.actuated.len());
        if y.iter().any(|v| !v.is_finite()) {
            return Ok(Err(Termination::Diverged));
        }
        let closed = self.closure.track(q_i)?;
        if !closed.outcome.is_closed() {
            return Ok(Err(self.stopped(closed.outcome)));
        }
        self.residual = closed.residual;
        self.q.copy_from_slice(&closed.q);
        let _condition = self.model.velocities(&self.q, qd_i, &mut self.qd)?;
        // drives: y' = (command - y) / lag
        let at = 2 * self.dof;
        for (k, built_up) in built_up.iter().enumerate() {
            let lag = self.drive(k).lag;
            if lag > 0.0 {
                self.effort[k] = *built_up;
                self.dy[at + k] = (self.command[k] - built_up) / lag;
            } else {
                self.effort[k] = self.command[k];
                self.dy[at + k] = 0.0;
            }
        }
        let _condition = self
            .model
            .generalized_forces(&self.q, &self.effort, &mut self.reduced)?;
        let mut loss = 0.0;
        if !self.settings.friction.is_empty() {
            let laws = self.settings.friction.iter().zip(&self.friction_widths);
            let friction: Vec<f64> = laws
                .zip(&self.qd)
                .map(|((law, width), v)| law.smooth_effort(*v, *width))
                .collect();
            loss = friction.iter().zip(&self.qd).map(|(f, v)| f * v).sum();
            // column k of dq/dq_i: all velocities at unit velocity of q_i[k]
            for k in 0..self.dof {
                self.unit.fill(0.0);
                self.unit[k] = 1.0;
                let _condition = self
                    .model
                    .velocities(&self.q, &self.unit, &mut self.column)?;
                let share: f64 = self.column.iter().zip(&friction).map(|(c, f)| c * f).sum();
                self.reduced[k] -= share;
            }
        }
        match self
            .forward
            .accelerations(&self.q, &self.qd, &self.reduced, &mut self.qdd_i)?
        {
            ForwardOutcome::NotPositiveDefinite => {
                return Ok(Err(Termination::NotPositiveDefinite));
            }
            ForwardOutcome::Solved(condition) if condition.status() == Status::Singular => {
                let outcome = Outcome::Singular { at: 1.0, condition };
                return Ok(Err(self.stopped(outcome)));
            }
            ForwardOutcome::Solved(_) => {}
        }
        if !self.springs.is_empty() {
            let state = [self.q.as_slice(), self.qd.as_slice(), qd_i];
            loss += spring_power(self.model, &self.springs, state, &mut self.unit)?;
        }
        self.dy[..self.dof].copy_from_slice(qd_i);
        self.dy[self.dof..at].copy_from_slice(&self.qdd_i);
        let joints = self.actuated.iter().zip(&self.effort);
        let power: f64 = joints.map(|(j, e)| self.qd[*j] * e).sum();
        let end = self.dy.len();
        self.dy[end - 2] = power;
        self.dy[end - 1] = loss;
        Ok(Ok(()))
    }

    /// The encoder readings of the actuated joints, rad or m.
    pub(super) fn measured(
        &mut self,
        y: &[f64],
        noise: &mut Noise,
    ) -> Result<Vec<f64>, SimulationError> {
        let closed = self.closure.track(&y[..self.dof])?;
        let sensors = self.settings.sensors;
        let joints = self.actuated.iter();
        Ok(joints
            .map(|j| sensors.position(closed.q[*j], noise))
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
        let mut qdd = vec![0.0; self.q.len()];
        let _condition = self
            .model
            .accelerations(&self.q, &self.qd, &self.qdd_i, &mut qdd)?;
        let qd_i: Vec<f64> = self.independent.iter().map(|c| self.qd[*c]).collect();
        log.t.push(t);
        log.q.extend(&self.q);
        log.qd.extend(&self.qd);
        log.qdd.extend(&qdd);
        log.effort.extend(&self.effort);
        log.measured_position.extend(measured);
        let sensors = self.settings.sensors;
        let measured_effort = self.effort.iter().map(|e| sensors.effort(*e, noise));
        log.measured_effort.extend(measured_effort);
        log.residual = log.residual.max(self.residual);
        let phi = self.forward.phi();
        log.energy.push(Energy {
            kinetic: kinetic(self.model, phi, &self.q, &qd_i)?,
            potential: potential(
                self.model,
                self.gravity,
                &self.moments,
                &self.offsets,
                &self.q,
            )?,
            work: y[y.len() - 2],
            loss: y[y.len() - 1],
        });
        Ok(Ok(()))
    }
}

/// The width of the smoothed friction: of a drive, the velocity at which its joints have theirs.
fn friction_width(joint: Option<&Joint>, of_joints: f64) -> f64 {
    let drive = joint.filter(|joint| joint.is_drive());
    drive.map_or(of_joints, |drive| drive.reach(of_joints, of_joints))
}
