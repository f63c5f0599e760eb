//! A run: integrates the forward dynamics with controller, drives, friction and sensors.
//!
//! The state vector y has 2 n + a + 2 entries for a actuated joints: the independent and dependent
//! positions (rad or m), their velocities (rad/s or m/s), the efforts that drives with lag have built
//! up (N or N m), the work of the efforts and the energy lost to friction (J). The dependent
//! coordinates are only predictions, from which the loops are closed anew at every state.

use super::control::{Controller, ControllerInput, Pid, PidControllers};
use super::integrate::{Integrator, Stop};
use super::log::{Log, Termination};
use super::noise::Noise;
use super::robot::Robot;
use super::settings::{Reference, Settings, SimulationError};
use super::targets::Targets;
use regen_runtime::Model;

/// Simulates the robot with parameters `phi` (p) along a reference, from the start of the
/// reference.
///
/// Once a period the controllers receive the measured positions and those of the reference. Their
/// commands are constant until the next sample (zero-order hold), and drives lag behind them.
/// Motion and efforts of the log belong to the same instants: see [`Log`]. The effort of friction
/// is computed from the settings' laws alone; the friction parameters in `phi` are ignored.
///
/// # Errors
/// - [`SimulationError::Size`]: the length of `phi` or of a list in the settings does not fit;
/// - [`SimulationError::Setting`]: a setting is not a positive finite number;
/// - [`SimulationError::TooLong`]: the run has more than 100 million samples;
/// - [`SimulationError::Closure`]: the model's `Info` is inconsistent, or with a controller the
///   reference is not finite at a later sample than the first.
///
/// Numerical failures are not errors: see [`Log::ended`]. A reference that does not start at a
/// finite state ends the run as [`Termination::Diverged`].
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
/// assert!(log.imbalance < 1e-6, "J");
/// # Ok::<(), regen_experiment::simulate::SimulationError>(())
/// ```
pub fn simulate<M: Model<f64> + ?Sized, R: Reference + ?Sized>(
    model: &M,
    phi: &[f64],
    reference: &R,
    settings: &Settings,
) -> Result<Log, SimulationError> {
    simulate_with_progress(model, phi, reference, settings, &mut |_| {})
}

/// As [`simulate`]; calls `progress` with the time of each sample, s, before the sample is taken.
///
/// # Errors
/// As [`simulate`].
pub fn simulate_with_progress<M: Model<f64> + ?Sized, R: Reference + ?Sized>(
    model: &M,
    phi: &[f64],
    reference: &R,
    settings: &Settings,
    progress: &mut dyn FnMut(f64),
) -> Result<Log, SimulationError> {
    let joints = model.info().actuated.to_vec();
    let mut pid_controllers =
        PidControllers::new(&settings.pid, &settings.offset, &settings.drives, &joints);
    let controller: Option<&mut dyn Controller> = if settings.pid.is_empty() {
        None
    } else {
        Some(&mut pid_controllers)
    };
    run(model, phi, reference, settings, controller, progress)
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

/// Simulates with the given controller, or without one.
fn run<'a, M: Model<f64> + ?Sized, R: Reference + ?Sized>(
    model: &'a M,
    phi: &[f64],
    reference: &'a R,
    settings: &'a Settings,
    controller: Option<&'a mut dyn Controller>,
    progress: &mut dyn FnMut(f64),
) -> Result<Log, SimulationError> {
    let mut robot = Robot::new(model, phi, settings)?;
    let mut log = Log::empty();
    let given = (model, reference, settings);
    log.ended = integrate(given, &mut robot, controller, progress, &mut log)?;
    robot.complete(&mut log)?;
    Ok(log)
}

/// Integrates the robot from sample to sample, and logs it; returns how the run ended.
fn integrate<M: Model<f64> + ?Sized, R: Reference + ?Sized>(
    (model, reference, settings): (&M, &R, &Settings),
    robot: &mut Robot<'_, M>,
    mut controller: Option<&mut dyn Controller>,
    progress: &mut dyn FnMut(f64),
    log: &mut Log,
) -> Result<Termination, SimulationError> {
    let dof = robot.dof;
    let (mut q_i, mut qd_i, mut qdd_i) = (vec![0.0; dof], vec![0.0; dof], vec![0.0; dof]);
    reference.at(0.0, &mut q_i, &mut qd_i, &mut qdd_i);
    let scales = robot.scales();
    let mut y = robot.state(&q_i, &qd_i);
    let mut noise = Noise::new(settings.seed);

    if let Err(stop) = robot.rates(&y)? {
        return Ok(stop);
    }
    robot.settle(&mut y);
    let mut integrator = Integrator::new(y, robot.positions(), settings.tolerance, &scales);
    let count = period_count(settings)?;
    let mut targets = Targets::new(model, reference, settings.period, count)?;
    // the command of the last period, which the drives apply up to the sample
    let mut held_command = robot.command.clone();
    for sample in 0..=count {
        let t = sample as f64 * settings.period;
        progress(t);
        // measure, then command
        let measured = robot.measured(&integrator.y, &mut noise)?;
        held_command.copy_from_slice(&robot.command);
        if let Some(controller) = controller.as_deref_mut() {
            let target = targets.at(sample)?;
            if !target.outcome.is_closed() {
                return Ok(Termination::Open(target.outcome));
            }
            let mut velocities = Vec::new();
            if settings.pid.iter().any(Pid::needs_velocity) {
                if let Err(stop) = robot.rates(&integrator.y)? {
                    return Ok(stop);
                }
                velocities = robot.driven_velocities();
            }
            let [q_i, qd_i, qdd_i] = target.independent;
            let now = ControllerInput {
                t,
                period: settings.period,
                q: target.q,
                q_i,
                qd_i,
                qdd_i,
                measured: &measured,
                velocities: &velocities,
            };
            controller.efforts(&now, &mut robot.command);
            let followed = robot.actuated.iter().filter_map(|c| target.q.get(*c));
            log.command.extend(followed);
            for (drive, command) in settings.drives.iter().zip(&mut robot.command) {
                if let Some([lo, hi]) = drive.limit
                    && !command.is_nan()
                {
                    // a NaN is not clamped: `max` and `min` would turn it into a limit
                    *command = command.max(lo).min(hi);
                }
            }
            if robot.command.iter().any(|effort| !effort.is_finite()) {
                return Ok(Termination::Diverged);
            }
        }
        if sample == 0 {
            // there is no command before the first sample
            held_command.copy_from_slice(&robot.command);
        }
        let recorded = robot.record(t, &integrator.y, &measured, &held_command, &mut noise, log)?;
        if let Err(stop) = recorded {
            return Ok(stop);
        }
        if sample == count {
            break;
        }
        let end = (sample + 1) as f64 * settings.period;
        let advanced = integrator.advance(end, |_, y, dy| {
            match robot.rates(y) {
                Err(error) => return Err(RatesFailure::Error(error)),
                Ok(Err(stop)) => return Err(RatesFailure::Stop(stop)),
                Ok(Ok(())) => {}
            }
            dy.copy_from_slice(&robot.dy);
            Ok(())
        });
        log.steps = integrator.steps;
        match advanced {
            Ok(()) => robot.settle(&mut integrator.y),
            Err(Stop::StepTooSmall) => return Ok(Termination::StepTooSmall),
            Err(Stop::Refused(RatesFailure::Stop(stop))) => return Ok(stop),
            Err(Stop::Refused(RatesFailure::Error(error))) => return Err(error),
        }
    }
    Ok(Termination::Complete)
}

/// The number of periods of the run.
fn period_count(settings: &Settings) -> Result<usize, SimulationError> {
    let count = (settings.duration / settings.period).round();
    if count > 1e8 {
        return Err(SimulationError::TooLong);
    }
    // both are positive
    #[allow(clippy::cast_sign_loss, reason = "checked when the robot was made")]
    Ok(count as usize)
}

/// The reason why the derivative of the state vector could not be computed.
enum RatesFailure {
    /// A numerical failure, which ends the run.
    Stop(Termination),
    /// An error of the caller.
    Error(SimulationError),
}
