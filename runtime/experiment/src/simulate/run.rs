//! A run: integrates the forward dynamics with controller, drives, friction and sensors.

use super::control::{Controller, ControllerInput, PidBank};
use super::integrate::{Integrator, Stop};
use super::log::{Log, Termination};
use super::noise::Noise;
use super::robot::Robot;
use super::settings::{Reference, Settings, SimulationError};
use regen_runtime::{LoopClosure, Model};

/// Simulates the robot with parameters `phi` (p) along a reference, from the start of the
/// reference.
///
/// Once a period the controllers get the measured positions and those of the reference; they hold
/// their command between samples, and drives lag behind it. Motion and efforts of the log belong to
/// the same instants: see [`Log`]. The effort of friction is computed from the settings' laws
/// alone; the friction parameters in `phi` are ignored.
///
/// # Errors
/// When a length does not fit, a setting is not positive, or the reference does not start at a
/// finite state. Numerical failures are not errors: see [`Log::ended`].
///
/// ```
/// # mod models { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs")); }
/// use regen_experiment::simulate::{Termination, Settings, simulate};
///
/// // A pendulum let go at rest keeps its energy.
/// let pendulum = models::Pendulum;
/// let start = |_: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
///     (q[0], qd[0], qdd[0]) = (0.4, 0.0, 0.0);
/// };
/// let settings = Settings { duration: 2.0, ..Settings::default() };
/// let log = simulate(&pendulum, &[0.02, 0.1], &start, &settings)?;
/// assert_eq!(log.ended, Termination::Complete);
/// assert_eq!(log.t.len(), 201);
/// # Ok::<(), regen_experiment::simulate::SimulationError>(())
/// ```
pub fn simulate<M: Model<f64> + ?Sized, R: Reference + ?Sized>(
    model: &M,
    phi: &[f64],
    reference: &R,
    settings: &Settings,
) -> Result<Log, SimulationError> {
    simulate_watched(model, phi, reference, settings, &mut |_| {})
}

/// As [`simulate`]; calls `watch` with the time of each sample, s, before the sample is taken.
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
    let mut bank = PidBank::new(&settings.pid, &settings.offset, &settings.drives, &joints);
    let controller: Option<&mut dyn Controller> = if settings.pid.is_empty() {
        None
    } else {
        Some(&mut bank)
    };
    run(model, phi, reference, settings, controller, watch)
}

/// As [`simulate`], with the caller's controller instead of `settings.pid`. Its commands are
/// limited to the drives' limits; a command that is not finite ends the run as
/// [`Termination::Diverged`].
///
/// # Errors
/// As [`simulate`].
///
/// ```
/// # mod models { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs")); }
/// use regen_runtime::Model;
/// use regen_experiment::simulate::{Termination, ControllerInput, Settings, simulate_controlled};
///
/// // Gravity compensation at the measured angle holds the pendulum where it is.
/// let (pendulum, phi) = (models::Pendulum, [0.02, 0.1]);
/// let start = |_: f64, q: &mut [f64], _: &mut [f64], _: &mut [f64]| q[0] = 0.4;
/// let mut hold = |now: &ControllerInput<'_>, efforts: &mut [f64]| {
///     let _condition = pendulum.gravity(now.measured, &phi, efforts).expect("one joint");
/// };
/// let settings = Settings { duration: 0.5, ..Settings::default() };
/// let log = simulate_controlled(&pendulum, &phi, &start, &mut hold, &settings)?;
/// assert_eq!(log.ended, Termination::Complete);
/// assert!(log.q.iter().all(|q| (q - 0.4).abs() < 1e-9));
/// # Ok::<(), regen_experiment::simulate::SimulationError>(())
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
    // below 1 rad or m (per s) and 100 N, N m or J, errors are judged by absolute tolerances
    let mut scales = vec![1.0; y.len()];
    scales[2 * dof..].fill(1e2);
    let mut wanted = LoopClosure::new(model)?;
    let mut noise = Noise::new(settings.seed);
    let mut log = Log::empty();

    if let Err(stop) = robot.rates(&y)? {
        log.ended = stop;
        return Ok(log);
    }
    let mut integrator = Integrator::new(y, settings.tolerance, &scales);
    let count = samples(settings)?;
    let mut start = None;
    let mut held = robot.command.clone();
    for sample in 0..=count {
        let t = sample as f64 * settings.period;
        watch(t);
        // measure, then command
        let measured = robot.measured(&integrator.y, &mut noise)?;
        held.copy_from_slice(&robot.command);
        if let Some(controller) = controller.as_deref_mut() {
            reference.at(t, &mut q_i, &mut qd_i, &mut qdd_i);
            let target = wanted.track(&q_i)?;
            if !target.outcome.is_closed() {
                log.ended = Termination::Open(target.outcome);
                return Ok(log);
            }
            let now = ControllerInput {
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
                if let Some([lo, hi]) = drive.limit
                    && !command.is_nan()
                {
                    // a NaN is not clamped: `max` and `min` would turn it into a limit
                    *command = command.max(lo).min(hi);
                }
            }
            if robot.command.iter().any(|effort| !effort.is_finite()) {
                log.ended = Termination::Diverged;
                return Ok(log);
            }
        }
        if sample == 0 {
            // no command was held before the first sample
            held.copy_from_slice(&robot.command);
        }
        if let Err(stop) = robot.record(t, &integrator.y, &measured, &held, &mut noise, &mut log)? {
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
            Err(Stop::StepTooSmall) => {
                log.ended = Termination::StepTooSmall;
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

/// The number of periods of the run.
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
    Stop(Termination),
    Error(SimulationError),
}
