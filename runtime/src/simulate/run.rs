//! A run: controller, drives, friction and sensors around the forward dynamics.

use std::vec;
use std::vec::Vec;

use core::fmt;

use super::audit::{Energy, kinetic, moments, potential};
use super::control::{Bank, Controller, Drive, Now, Pid};
use super::forward::{Forward, Freed};
use super::friction::FrictionLaw;
use super::integrate::{Integrator, Stop};
use super::noise::Noise;
use crate::{Closure, Misuse, Model, Outcome, SizeError, Status};

/// A motion to follow: the independent coordinates over time.
pub trait Reference {
    /// Fills the independent positions, velocities and accelerations (dof each; rad or m, per
    /// s, per s^2) at time t, s.
    fn at(&self, t: f64, q_i: &mut [f64], qd_i: &mut [f64], qdd_i: &mut [f64]);
}

impl<F: Fn(f64, &mut [f64], &mut [f64], &mut [f64])> Reference for F {
    fn at(&self, t: f64, q_i: &mut [f64], qd_i: &mut [f64], qdd_i: &mut [f64]) {
        self(t, q_i, qd_i, qdd_i);
    }
}

/// What the sensors make of the truth: positions of the actuated joints and their efforts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sensors {
    /// The step of the position encoders, rad or m; 0 is none.
    pub position_step: f64,
    /// Standard deviation of noise on positions, rad or m.
    pub position_noise: f64,
    /// The step of the measured efforts, N or N m; 0 is none.
    pub effort_step: f64,
    /// Standard deviation of noise on efforts, N or N m.
    pub effort_noise: f64,
}

impl Sensors {
    /// What an encoder makes of a position, rad or m.
    pub fn position(&self, truth: f64, noise: &mut Noise) -> f64 {
        quantised(
            truth + self.position_noise * noise.normal(),
            self.position_step,
        )
    }

    /// What is measured of an effort, N or N m.
    pub fn effort(&self, truth: f64, noise: &mut Noise) -> f64 {
        quantised(truth + self.effort_noise * noise.normal(), self.effort_step)
    }
}

/// How a run goes.
#[derive(Clone, Debug)]
pub struct Settings {
    /// How long, s.
    pub duration: f64,
    /// The controller's and the log's period, s; the chapter's robot was controlled and
    /// measured at 100 Hz.
    pub period: f64,
    /// One controller per actuated joint, in the order of `Info::actuated`; empty for a robot
    /// that is left to itself.
    pub pid: Vec<Pid>,
    /// One drive per actuated joint, or none.
    pub drives: Vec<Drive>,
    /// Constant efforts under the controllers', one per actuated joint, or none: N or N m. The
    /// drives start with them; without control they act alone.
    pub offset: Vec<f64>,
    /// One law per coordinate, or none.
    pub friction: Vec<FrictionLaw>,
    /// The velocity, rad/s or m/s, within which friction changes its direction.
    pub friction_width: f64,
    /// What is measured.
    pub sensors: Sensors,
    /// For the sensors' noise.
    pub seed: u64,
    /// The integration's relative tolerance of each step.
    pub tolerance: f64,
}

impl Default for Settings {
    /// 1 s at 100 Hz without control, drives, friction or noise, to 1e-9 a step.
    fn default() -> Self {
        Self {
            duration: 1.0,
            period: 0.01,
            pid: Vec::new(),
            drives: Vec::new(),
            offset: Vec::new(),
            friction: Vec::new(),
            friction_width: 1e-3,
            sensors: Sensors::default(),
            seed: 0,
            tolerance: 1e-9,
        }
    }
}

/// How a run ended. A numerical outcome.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ended {
    /// After its whole duration.
    Complete,
    /// The loops could not be kept closed: a singularity, or the end of the branch.
    Open(Outcome),
    /// The mass matrix is not positive definite: the parameters are not those of bodies.
    NoMass,
    /// No step of the integration is short enough.
    Stiff,
    /// Positions or velocities grew beyond all bounds.
    Diverged,
}

/// What happened, sample by sample: one row each, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Log {
    /// How the run ended.
    pub ended: Ended,
    /// Times, s.
    pub t: Vec<f64>,
    /// All coordinates (n a row).
    pub q: Vec<f64>,
    /// All velocities (n a row).
    pub qd: Vec<f64>,
    /// All accelerations (n a row).
    pub qdd: Vec<f64>,
    /// The efforts that the drives apply (one per actuated joint a row).
    pub effort: Vec<f64>,
    /// The positions of actuated joints as measured.
    pub measured_position: Vec<f64>,
    /// The efforts of actuated joints as measured.
    pub measured_effort: Vec<f64>,
    /// Energies.
    pub energy: Vec<Energy>,
    /// The largest constraint residual |f| of any sample, m or without unit.
    pub residual: f64,
    /// The largest imbalance of energy of any sample, J.
    pub imbalance: f64,
    /// Steps of the integration, refused ones included.
    pub steps: usize,
}

/// A run that cannot be started.
#[derive(Clone, Debug, PartialEq)]
pub enum SimulationError {
    /// A list's length does not fit the model.
    Size(SizeError),
    /// The closure refuses the call.
    Misuse(Misuse),
    /// A setting is not a positive finite number.
    Setting(&'static str),
    /// More than 100 million samples.
    TooLong,
}

impl From<SizeError> for SimulationError {
    fn from(error: SizeError) -> Self {
        Self::Size(error)
    }
}

impl From<Misuse> for SimulationError {
    fn from(error: Misuse) -> Self {
        Self::Misuse(error)
    }
}

impl fmt::Display for SimulationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size(error) => error.fmt(f),
            Self::Misuse(error) => error.fmt(f),
            Self::Setting(name) => write!(f, "`{name}` must be a positive finite number"),
            Self::TooLong => write!(f, "`duration` has more than 100 million of `period`"),
        }
    }
}

impl core::error::Error for SimulationError {}

/// Runs the robot with parameters `phi` (p) along a reference, from the reference's start.
///
/// Controllers see the measured positions and the reference's, sample the period and hold
/// their command between samples; drives lag behind it. The effort of friction comes from the
/// settings' laws alone: friction columns of `phi` count nothing.
///
/// # Errors
/// When a length does not fit, a setting is not positive, or the reference starts at no finite
/// state. What happens numerically is in [`Log::ended`].
///
/// ```
/// # mod models { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/models/pendulum.rs")); }
/// use regen_runtime::simulate::{Ended, Settings, simulate};
///
/// // A pendulum let go at rest keeps its energy.
/// let pendulum = models::Pendulum;
/// let start = |_: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
///     (q[0], qd[0], qdd[0]) = (0.4, 0.0, 0.0);
/// };
/// let settings = Settings { duration: 2.0, ..Settings::default() };
/// let log = simulate(&pendulum, &[0.02, 0.1], &start, &settings)?;
/// assert_eq!(log.ended, Ended::Complete);
/// assert_eq!(log.t.len(), 201);
/// # Ok::<(), regen_runtime::simulate::SimulationError>(())
/// ```
pub fn simulate<M: Model<f64> + ?Sized, R: Reference + ?Sized>(
    model: &M,
    phi: &[f64],
    reference: &R,
    settings: &Settings,
) -> Result<Log, SimulationError> {
    simulate_watched(model, phi, reference, settings, &mut |_| {})
}

/// As [`simulate`]; `watch` is called with the time of each sample, s, before it is taken.
///
/// # Errors
/// As [`simulate`].
pub fn simulate_watched<M: Model<f64> + ?Sized, R: Reference + ?Sized>(
    model: &M,
    phi: &[f64],
    reference: &R,
    settings: &Settings,
    watch: &mut dyn FnMut(f64),
) -> Result<Log, SimulationError> {
    let joints = model.info().actuated.to_vec();
    let mut bank = Bank::new(&settings.pid, &settings.offset, &settings.drives, &joints);
    let controller: Option<&mut dyn Controller> = if settings.pid.is_empty() {
        None
    } else {
        Some(&mut bank)
    };
    run(model, phi, reference, settings, controller, watch)
}

/// As [`simulate`], under a controller of your own instead of `settings.pid`. What it commands is
/// held within the drives' limits; a command that is not finite ends the run as
/// [`Ended::Diverged`].
///
/// # Errors
/// As [`simulate`].
///
/// ```
/// # mod models { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/models/pendulum.rs")); }
/// use regen_runtime::Model;
/// use regen_runtime::simulate::{Ended, Now, Settings, simulate_controlled};
///
/// // The pendulum's own weight, at the angle that is measured, holds it where it is.
/// let (pendulum, phi) = (models::Pendulum, [0.02, 0.1]);
/// let start = |_: f64, q: &mut [f64], _: &mut [f64], _: &mut [f64]| q[0] = 0.4;
/// let mut hold = |now: &Now<'_>, efforts: &mut [f64]| {
///     let _condition = pendulum.gravity(now.measured, &phi, efforts).expect("one joint");
/// };
/// let settings = Settings { duration: 0.5, ..Settings::default() };
/// let log = simulate_controlled(&pendulum, &phi, &start, &mut hold, &settings)?;
/// assert_eq!(log.ended, Ended::Complete);
/// assert!(log.q.iter().all(|q| (q - 0.4).abs() < 1e-9));
/// # Ok::<(), regen_runtime::simulate::SimulationError>(())
/// ```
pub fn simulate_controlled<M: Model<f64> + ?Sized, R: Reference + ?Sized>(
    model: &M,
    phi: &[f64],
    reference: &R,
    controller: &mut dyn Controller,
    settings: &Settings,
) -> Result<Log, SimulationError> {
    run(
        model,
        phi,
        reference,
        settings,
        Some(controller),
        &mut |_| {},
    )
}

fn run<M: Model<f64> + ?Sized, R: Reference + ?Sized>(
    model: &M,
    phi: &[f64],
    reference: &R,
    settings: &Settings,
    mut controller: Option<&mut dyn Controller>,
    watch: &mut dyn FnMut(f64),
) -> Result<Log, SimulationError> {
    let mut robot = Robot::new(model, phi, settings)?;
    let dof = robot.dof;
    let (mut q_i, mut qd_i, mut qdd_i) = (vec![0.0; dof], vec![0.0; dof], vec![0.0; dof]);
    reference.at(0.0, &mut q_i, &mut qd_i, &mut qdd_i);
    let mut y = q_i.clone();
    y.extend(&qd_i);
    y.extend(&robot.command);
    y.resize(robot.size(), 0.0);
    // the scales of positions, velocities, efforts, energies where they are small
    let mut scales = vec![1.0; y.len()];
    scales[2 * dof..].fill(1e2);
    let mut wanted = Closure::new(model)?;
    let mut noise = Noise::new(settings.seed);
    let mut log = Log::empty();

    if let Err(stop) = robot.rates(&y)? {
        log.ended = stop;
        return Ok(log);
    }
    let mut integrator = Integrator::new(y, settings.tolerance, &scales);
    let count = samples(settings)?;
    let mut start = None;
    for sample in 0..=count {
        let t = sample as f64 * settings.period;
        watch(t);
        // measure, then command
        let measured = robot.measured(&integrator.y, &mut noise)?;
        if let Some(controller) = controller.as_deref_mut() {
            reference.at(t, &mut q_i, &mut qd_i, &mut qdd_i);
            let target = wanted.track(&q_i)?;
            if !target.outcome.is_closed() {
                log.ended = Ended::Open(target.outcome);
                return Ok(log);
            }
            let now = Now {
                t,
                period: settings.period,
                q: &target.q,
                q_i: &q_i,
                qd_i: &qd_i,
                qdd_i: &qdd_i,
                measured: &measured,
            };
            controller.efforts(&now, &mut robot.command);
            for (drive, command) in settings.drives.iter().zip(&mut robot.command) {
                if let Some([lo, hi]) = drive.limit {
                    *command = command.max(lo).min(hi);
                }
            }
            if robot.command.iter().any(|effort| !effort.is_finite()) {
                log.ended = Ended::Diverged;
                return Ok(log);
            }
        }
        if let Err(stop) = robot.record(t, &integrator.y, &measured, &mut noise, &mut log)? {
            log.ended = stop;
            return Ok(log);
        }
        if let Some(energy) = log.energy.last() {
            let start = *start.get_or_insert(*energy);
            log.imbalance = log.imbalance.max(energy.imbalance(start).abs());
        }
        if sample == count {
            break;
        }
        let end = (sample + 1) as f64 * settings.period;
        let went = integrator.advance(end, |_, y, dy| {
            match robot.rates(y) {
                Err(error) => return Err(Refusal::Error(error)),
                Ok(Err(stop)) => return Err(Refusal::Stop(stop)),
                Ok(Ok(())) => {}
            }
            dy.copy_from_slice(&robot.dy);
            Ok(())
        });
        log.steps = integrator.steps;
        match went {
            Ok(()) => {}
            Err(Stop::Stiff) => {
                log.ended = Ended::Stiff;
                return Ok(log);
            }
            Err(Stop::Refused(Refusal::Stop(stop))) => {
                log.ended = stop;
                return Ok(log);
            }
            Err(Stop::Refused(Refusal::Error(error))) => return Err(error),
        }
    }
    Ok(log)
}

/// How many periods the run has.
fn samples(settings: &Settings) -> Result<usize, SimulationError> {
    let count = (settings.duration / settings.period).round();
    if count > 1e8 {
        return Err(SimulationError::TooLong);
    }
    // both are positive
    #[allow(clippy::cast_sign_loss, reason = "checked when the robot was made")]
    Ok(count as usize)
}

enum Refusal {
    Stop(Ended),
    Error(SimulationError),
}

/// The robot between samples.
struct Robot<'m, M: ?Sized> {
    model: &'m M,
    settings: &'m Settings,
    closure: Closure<'m, M>,
    forward: Forward<'m, M>,
    moments: Vec<[f64; 4]>,
    gravity: [f64; 3],
    dof: usize,
    independent: Vec<usize>,
    actuated: Vec<usize>,
    command: Vec<f64>,
    // what `rates` leaves
    q: Vec<f64>,
    qd: Vec<f64>,
    qdd_i: Vec<f64>,
    effort: Vec<f64>,
    dy: Vec<f64>,
    residual: f64,
    // scratch
    reduced: Vec<f64>,
    column: Vec<f64>,
    unit: Vec<f64>,
}

impl<'m, M: Model<f64> + ?Sized> Robot<'m, M> {
    fn new(model: &'m M, phi: &[f64], settings: &'m Settings) -> Result<Self, SimulationError> {
        let info = model.info();
        let positive = [
            ("duration", settings.duration),
            ("period", settings.period),
            ("friction_width", settings.friction_width),
            ("tolerance", settings.tolerance),
        ];
        for (name, value) in positive {
            // NaN too
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
            closure: Closure::new(model)?,
            moments: moments(&info, phi),
            gravity: info.gravity,
            forward,
            dof,
            independent: info.independent.to_vec(),
            actuated: info.actuated.to_vec(),
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

    /// q_i, qd_i, efforts of lagging drives, work, loss.
    fn size(&self) -> usize {
        2 * self.dof + self.actuated.len() + 2
    }

    fn drive(&self, k: usize) -> Drive {
        self.settings.drives.get(k).copied().unwrap_or_default()
    }

    /// The state's rate in `dy`, and the whole motion beside it.
    fn rates(&mut self, y: &[f64]) -> Result<Result<(), Ended>, SimulationError> {
        let (q_i, rest) = y.split_at(self.dof);
        let (qd_i, rest) = rest.split_at(self.dof);
        let (built_up, _) = rest.split_at(self.actuated.len());
        if y.iter().any(|v| !v.is_finite()) {
            return Ok(Err(Ended::Diverged));
        }
        let closed = self.closure.track(q_i)?;
        if !closed.outcome.is_closed() {
            return Ok(Err(Ended::Open(closed.outcome)));
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
            .efforts(&self.q, &self.effort, &mut self.reduced)?;
        let mut loss = 0.0;
        if !self.settings.friction.is_empty() {
            let width = self.settings.friction_width;
            let laws = self.settings.friction.iter().zip(&self.qd);
            let friction: Vec<f64> = laws.map(|(law, v)| law.effort(*v, width)).collect();
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
            Freed::NoMass => return Ok(Err(Ended::NoMass)),
            Freed::Moves(condition) if condition.status() == Status::Singular => {
                let outcome = Outcome::Singular { at: 1.0, condition };
                return Ok(Err(Ended::Open(outcome)));
            }
            Freed::Moves(_) => {}
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

    /// The positions of the actuated joints as the encoders give them.
    fn measured(&mut self, y: &[f64], noise: &mut Noise) -> Result<Vec<f64>, SimulationError> {
        let closed = self.closure.track(&y[..self.dof])?;
        let sensors = self.settings.sensors;
        let joints = self.actuated.iter();
        Ok(joints
            .map(|j| sensors.position(closed.q[*j], noise))
            .collect())
    }

    fn record(
        &mut self,
        t: f64,
        y: &[f64],
        measured: &[f64],
        noise: &mut Noise,
        log: &mut Log,
    ) -> Result<Result<(), Ended>, SimulationError> {
        if let Err(stop) = self.rates(y)? {
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
        let seen = self.effort.iter().map(|e| sensors.effort(*e, noise));
        log.measured_effort.extend(seen);
        log.residual = log.residual.max(self.residual);
        let phi = self.forward.phi();
        log.energy.push(Energy {
            kinetic: kinetic(self.model, phi, &self.q, &qd_i)?,
            potential: potential(self.model, self.gravity, &self.moments, &self.q)?,
            work: y[y.len() - 2],
            loss: y[y.len() - 1],
        });
        Ok(Ok(()))
    }
}

impl Log {
    fn empty() -> Self {
        Self {
            ended: Ended::Complete,
            t: Vec::new(),
            q: Vec::new(),
            qd: Vec::new(),
            qdd: Vec::new(),
            effort: Vec::new(),
            measured_position: Vec::new(),
            measured_effort: Vec::new(),
            energy: Vec::new(),
            residual: 0.0,
            imbalance: 0.0,
            steps: 0,
        }
    }
}

fn quantised(x: f64, step: f64) -> f64 {
    if step > 0.0 {
        (x / step).round() * step
    } else {
        x
    }
}
