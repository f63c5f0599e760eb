//! The closed loop of a run simulated with an estimate: the motion at which instrumental variables
//! and output errors evaluate the regressor.

use core::fmt;

use regen_identify::estimate::EstimateError;
use regen_identify::states::MotionSeries;
use regen_runtime::{Model, SizeError};

use crate::simulate::{
    Control, Drive, Gains, Log, Pid, Reference, Settings, SimulationError, Termination,
    TuningError, control, linear_friction, simulate,
};

/// The number of states of the motion at which controllers are tuned.
const TUNED_STATES: u32 = 64;
/// The tolerance of each step of the integration, relative.
const TOLERANCE: f64 = 1e-9;

/// The controllers of a simulated loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Controllers<'a> {
    /// Tuned to the robot with the present estimate, so that the simulated loop keeps its bandwidth
    /// whatever the estimate.
    Tuned {
        /// The bandwidth of controllers without given gains, Hz.
        bandwidth: f64,
        /// Gains that replace tuned ones.
        given: &'a [Gains],
    },
    /// The controllers that the robot ran with.
    Known {
        /// The controllers, in the order of `Info::actuated`.
        pid: &'a [Pid],
        /// The constant efforts that their commands are added to, N m or N; empty for none.
        offset: &'a [f64],
    },
}

/// A loop to simulate: what the robot was to follow, and its controllers.
#[derive(Clone, Copy)]
pub struct ClosedLoop<'a> {
    /// The motion to follow; its time is that of the log.
    pub reference: &'a (dyn Reference + Sync),
    /// How long before the first sample the simulation begins, s, so that its transient has
    /// decayed: a period of a periodic motion; 0 where nothing is known of the time before.
    pub lead: f64,
    /// The controllers.
    pub controllers: Controllers<'a>,
}

/// Simulates a robot in a closed loop at evenly spaced times; the samples of the lead are not in
/// the log.
///
/// - `phi`: p parameters, SI;
/// - `times`: of the samples, s; at least two.
///
/// # Errors
/// When no controllers can be tuned, or the simulation cannot begin or ends early: see
/// [`LoopError`].
///
/// ```
/// # mod models { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs")); }
/// use regen_experiment::closed_loop::{ClosedLoop, Controllers, follow};
///
/// let swing = |t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
///     (q[0], qd[0], qdd[0]) = (0.3 * t.sin(), 0.3 * t.cos(), -0.3 * t.sin());
/// };
/// let run = ClosedLoop {
///     reference: &swing,
///     lead: 6.28,
///     controllers: Controllers::Tuned { bandwidth: 5.0, given: &[] },
/// };
/// let times: Vec<f64> = (0..100).map(|k| 1.0 + 0.01 * f64::from(k)).collect();
/// let log = follow(&models::Pendulum, &run, &[0.02, 0.1], &times)?;
/// assert_eq!(log.t.len(), 100);
/// assert!((log.q[0] - 0.3 * 1.0_f64.sin()).abs() < 0.02);
/// # Ok::<(), regen_experiment::closed_loop::LoopError>(())
/// ```
pub fn follow<M: Model<f64> + ?Sized>(
    model: &M,
    closed_loop: &ClosedLoop<'_>,
    phi: &[f64],
    times: &[f64],
) -> Result<Log, LoopError> {
    let run = simulate_loop(model, closed_loop, phi, times)?;
    let (mut log, skip, stride) = (run.log, run.lead, run.stride);
    let info = model.info();
    let (n, a) = (info.coordinates.len(), info.actuated.len());
    log.energy.drain(..skip.min(log.energy.len()));
    for (list, width) in [
        (&mut log.t, 1),
        (&mut log.q, n),
        (&mut log.qd, n),
        (&mut log.qdd, n),
        (&mut log.effort, a),
        (&mut log.measured_position, a),
        (&mut log.command, a),
        (&mut log.measured_effort, a),
    ] {
        let rows = list.len() / width.max(1);
        list.drain(..skip.min(rows) * width);
        if stride > 1 {
            let asked = list.chunks_exact(width.max(1)).step_by(stride).flatten();
            *list = asked.copied().collect();
        }
    }
    // the log's own times, not those of the simulation
    log.t = times.to_vec();
    Ok(log)
}

/// A simulated loop from the beginning of its lead, with the controllers that it ran with.
#[derive(Clone, Debug)]
pub struct LoopRun {
    /// All samples; times are those from the beginning, s.
    pub log: Log,
    /// The number of samples before those that were asked for.
    pub lead: usize,
    /// The time between samples, s.
    pub step: f64,
    /// The number of samples from one that was asked for to the next: controllers may act more often.
    pub stride: usize,
    /// The controllers and the constant efforts, in the order of `Info::actuated`.
    pub control: Control,
    /// The independent coordinates at which controllers are tuned, rad or m: the start, and evenly spaced
    /// times.
    pub states: Vec<Vec<f64>>,
    /// The drives, in the same order.
    pub drives: Vec<Drive>,
}

/// Simulates a robot in a closed loop, as [`follow`] does; returns the samples of the lead too.
///
/// - `phi`: p parameters, SI;
/// - `times`: of the samples, s; at least two.
///
/// # Errors
/// As [`follow`].
///
/// ```
/// # mod models { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs")); }
/// use regen_experiment::closed_loop::{ClosedLoop, Controllers, follow, simulate_loop};
///
/// let swing = |t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
///     (q[0], qd[0], qdd[0]) = (0.3 * t.sin(), 0.3 * t.cos(), -0.3 * t.sin());
/// };
/// let closed_loop = ClosedLoop {
///     reference: &swing,
///     lead: 0.04,
///     controllers: Controllers::Tuned { bandwidth: 5.0, given: &[] },
/// };
/// let times = [1.0, 1.02, 1.04];
/// let run = simulate_loop(&models::Pendulum, &closed_loop, &[0.02, 0.1], &times)?;
/// assert_eq!((run.lead, run.log.t.len()), (2, 5));
/// let log = follow(&models::Pendulum, &closed_loop, &[0.02, 0.1], &times)?;
/// assert_eq!(log.q, run.log.q[2..]);
/// # Ok::<(), regen_experiment::closed_loop::LoopError>(())
/// ```
pub fn simulate_loop<M: Model<f64> + ?Sized>(
    model: &M,
    closed_loop: &ClosedLoop<'_>,
    phi: &[f64],
    times: &[f64],
) -> Result<LoopRun, LoopError> {
    let info = model.info();
    let (Some(first), Some(last), true) = (times.first(), times.last(), times.len() > 1) else {
        return Err(LoopError::TooFew);
    };
    let step = (last - first) / (times.len() - 1) as f64;
    // the step is that of rounded times: a lead of whole steps must not begin one step earlier
    let early = (closed_loop.lead / step - WHOLE_STEPS).ceil().max(0.0);
    let begin = first - early * step;
    let dof = info.dof();
    let at = |k: u32| {
        let t = begin + (last - begin) * f64::from(k) / f64::from(TUNED_STATES);
        let mut state = vec![0.0; dof];
        let reference = closed_loop.reference;
        reference.at(t, &mut state, &mut vec![0.0; dof], &mut vec![0.0; dof]);
        state
    };
    let states: Vec<Vec<f64>> = (0..TUNED_STATES).map(at).collect();
    let control = match closed_loop.controllers {
        Controllers::Tuned { bandwidth, given } => {
            let tuned = control((bandwidth, step), given, model, phi, &states);
            tuned.map_err(LoopError::Tuning)?
        }
        Controllers::Known { pid, offset } => Control {
            pid: pid.to_vec(),
            offset: offset.to_vec(),
            spread: 1.0,
        },
    };
    let acts = control.pid.iter().map(|pid| pid.acts_per_row);
    let stride = acts.max().unwrap_or(1).max(1);
    let row = step;
    let step = row / stride as f64;
    let drive = |joint: &usize| Drive {
        lag: 0.0,
        limit: info.joints.get(*joint).and_then(|j| j.limits.effort),
    };
    let drives: Vec<Drive> = info.actuated.iter().map(drive).collect();
    let settings = Settings {
        duration: last - begin,
        period: step,
        pid: control.pid.clone(),
        offset: control.offset.clone(),
        drives: drives.clone(),
        friction: linear_friction(&info, phi),
        tolerance: TOLERANCE,
        energies: false,
        ..Settings::default()
    };
    let along = |t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
        // between rows the command stays that of the row
        let t = if stride > 1 {
            row * (t / row + WHOLE_STEPS).floor()
        } else {
            t
        };
        closed_loop.reference.at(begin + t, q, qd, qdd);
    };
    let log = simulate(model, phi, &along, &settings).map_err(LoopError::Simulation)?;
    if log.ended != Termination::Complete {
        return Err(LoopError::Termination(log.ended));
    }
    #[allow(clippy::cast_sign_loss, reason = "a number of periods")]
    let lead = early as usize * stride;
    Ok(LoopRun {
        log,
        lead,
        step,
        stride,
        control,
        states,
        drives,
    })
}

/// The motion of the independent coordinates in the simulated loop, at the sample times of a
/// measured motion; runs of a single sample have no motion and are NaN.
///
/// # Errors
/// As [`follow`].
pub fn motion<M: Model<f64> + ?Sized>(
    model: &M,
    closed_loop: &ClosedLoop<'_>,
    phi: &[f64],
    measured: &MotionSeries,
) -> Result<MotionSeries, LoopError> {
    let info = model.info();
    let n = info.coordinates.len();
    let mut out = MotionSeries::new(info.dof());
    for run in measured.runs() {
        let times = measured.times().get(run).unwrap_or_default();
        if times.len() < 2 {
            out.push_unknown(times);
            continue;
        }
        let log = follow(model, closed_loop, phi, times)?;
        for (k, time) in times.iter().enumerate() {
            let pick = |all: &[f64]| -> Vec<f64> {
                let row = all.get(k * n..(k + 1) * n).unwrap_or_default();
                let independent = info.independent.iter();
                independent.filter_map(|c| row.get(*c).copied()).collect()
            };
            let [q, qd, qdd] = [&log.q, &log.qd, &log.qdd].map(|all| pick(all));
            out.push(*time, [&q, &qd, &qdd], k > 0)?;
        }
    }
    Ok(out)
}

/// A lead that exceeds a whole number of steps by less than this part of one is that number of steps.
const WHOLE_STEPS: f64 = 1e-6;
/// The range in which the bandwidth of a robot's controllers is searched, Hz; its upper end is at
/// most a tenth of the rate of the samples.
const BANDWIDTHS_HZ: [f64; 2] = [0.5, 100.0];
/// The number of bandwidths, in equal proportions, that are tried first.
const COARSE_TRIALS: usize = 9;
/// The number of golden-section steps between the neighbours of the best of these.
const GOLDEN_STEPS: usize = 8;

/// Searches for the bandwidth of tuned controllers with which the simulated motion is nearest to
/// the measured one; `None` where none can be simulated.
///
/// - `step`: the time between samples, s;
/// - `difference`: computes the difference between the simulated and the measured motion at a
///   bandwidth in Hz, in any measure; `None` where the loop cannot be simulated.
///
/// ```
/// use regen_experiment::closed_loop::nearest_bandwidth;
///
/// let found = nearest_bandwidth(0.002, &mut |hz| Some((hz - 7.0).abs()));
/// assert!(found.is_some_and(|hz| (hz - 7.0).abs() < 0.1));
/// assert_eq!(nearest_bandwidth(0.002, &mut |_| None), None);
/// ```
pub fn nearest_bandwidth(step: f64, difference: &mut dyn FnMut(f64) -> Option<f64>) -> Option<f64> {
    let [low, high] = BANDWIDTHS_HZ;
    let high = high.min(0.1 / step).max(2.0 * low);
    let ratio = libm::log(high / low);
    let at = |part: f64| low * libm::exp(ratio * part);
    let mut measure = |part: f64| {
        let value = difference(at(part)).filter(|x| x.is_finite());
        value.unwrap_or(f64::INFINITY)
    };
    let mut best = (f64::INFINITY, 0.0);
    let width = 1.0 / (COARSE_TRIALS - 1) as f64;
    for k in 0..COARSE_TRIALS {
        let part = k as f64 * width;
        let value = measure(part);
        if value < best.0 {
            best = (value, part);
        }
    }
    if best.0 == f64::INFINITY {
        return None;
    }
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let (mut from, mut to) = ((best.1 - width).max(0.0), (best.1 + width).min(1.0));
    let inner = |from: f64, to: f64| [to - GOLDEN * (to - from), from + GOLDEN * (to - from)];
    let [mut a, mut b] = inner(from, to);
    let (mut at_a, mut at_b) = (measure(a), measure(b));
    for _ in 0..GOLDEN_STEPS {
        if at_a < at_b {
            (to, b, at_b) = (b, a, at_a);
            [a, _] = inner(from, to);
            at_a = measure(a);
        } else {
            (from, a, at_a) = (a, b, at_b);
            [_, b] = inner(from, to);
            at_b = measure(b);
        }
    }
    let inner = if at_a < at_b { (at_a, a) } else { (at_b, b) };
    Some(at(if inner.0 < best.0 { inner.1 } else { best.1 }))
}

/// Why a loop cannot be simulated with an estimate.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum LoopError {
    /// Fewer than two samples.
    TooFew,
    /// No controllers can be tuned for the robot with the estimate.
    Tuning(TuningError),
    /// The robot with the estimate cannot be simulated.
    Simulation(SimulationError),
    /// The run ended before its time.
    Termination(Termination),
    /// The simulated motion does not fit the model.
    Samples(EstimateError),
    /// The estimate and the model differ in size.
    Size(SizeError),
}

impl fmt::Display for LoopError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const NOT_SIMULATED: &str = "the robot cannot be simulated with the present estimate";
        match self {
            Self::TooFew => f.write_str("a run to simulate needs two samples"),
            Self::Tuning(why) => write!(f, "{NOT_SIMULATED}: {why}"),
            Self::Simulation(why) => write!(f, "{NOT_SIMULATED}: {why}"),
            Self::Termination(how) => write!(f, "{NOT_SIMULATED}: {how}"),
            Self::Samples(why) => why.fmt(f),
            Self::Size(why) => why.fmt(f),
        }
    }
}

impl core::error::Error for LoopError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Tuning(why) => Some(why),
            Self::Simulation(why) => Some(why),
            Self::Samples(why) => Some(why),
            Self::Size(why) => Some(why),
            Self::TooFew | Self::Termination(_) => None,
        }
    }
}

impl From<EstimateError> for LoopError {
    fn from(why: EstimateError) -> Self {
        Self::Samples(why)
    }
}

impl From<SizeError> for LoopError {
    fn from(why: SizeError) -> Self {
        Self::Size(why)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_bandwidth_is_found_anywhere_between_its_bounds() {
        for k in 0..20 {
            let wanted = 0.6 * 1.23_f64.powi(k);
            let found = nearest_bandwidth(0.002, &mut |hz| Some((hz - wanted).abs()));
            let near = found.is_some_and(|hz| (hz / wanted - 1.0).abs() < 0.01);
            assert!(near, "{wanted} {found:?}");
        }
    }
}
