//! How far the simulated motion of DIDIM is from the measured one.

use regen_experiment::closed_loop::{LoopRun, simulate_loop};
use regen_runtime::{BaseModel, Info, SizeError};

use crate::didim::{DidimError, EffortRun};
use crate::rounds::parameters;

/// How far the simulated motion of a coordinate is from its measured positions.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Departure {
    /// The coordinate's name.
    pub name: String,
    /// The root mean square of the difference, in percent of that of the measured motion about its
    /// mean.
    pub percent: f64,
}

impl Departure {
    /// Whether the simulated loop differs so much from the robot's that the estimate is biased:
    /// above 0.3 %. In simulated logs of a six-joint arm with known controllers, all departures are
    /// below 0.1 %.
    pub fn is_far(&self) -> bool {
        self.percent > FAR_PERCENT
    }
}

/// The difference of simulated and measured motion in percent above which they are not the same.
const FAR_PERCENT: f64 = 0.3;

/// How far the motion simulated with parameters is from the runs' measured positions, for each
/// measured coordinate that moves; empty if no position is measured.
///
/// - `settle`: seconds at the start of each run that do not count;
/// - `values`: for each run its base parameters, r.
///
/// # Errors
/// When the loop cannot be simulated, or a list does not fit the model.
///
/// ```
/// # mod models {
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs"));
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum_base.rs"));
/// # }
/// use regen_experiment::closed_loop::{ClosedLoop, Controllers, follow};
/// use regen_response::{EffortRun, departures};
///
/// let swing = |t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
///     (q[0], qd[0], qdd[0]) = (t.sin(), t.cos(), -t.sin());
/// };
/// let at = |bandwidth: f64| ClosedLoop {
///     reference: &swing,
///     lead: 0.0,
///     controllers: Controllers::Tuned { bandwidth, given: &[] },
/// };
/// let times: Vec<f64> = (0..300).map(|k| 0.01 * f64::from(k)).collect();
/// let log = follow(&models::Pendulum, &at(4.0), &[0.5, 2.0], &times)?;
/// let off = |bandwidth: f64| {
///     let run = EffortRun {
///         times: &times,
///         efforts: &[],
///         positions: &[(0, log.q.clone())],
///         closed_loop: at(bandwidth),
///     };
///     departures(&models::Pendulum, &[run], 0.0, &[vec![0.5, 2.0]])
/// };
/// assert!(off(4.0)?[0].percent < 1e-3 && off(2.0)?[0].is_far());
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn departures<M: BaseModel<f64> + ?Sized + Sync>(
    model: &M,
    runs: &[EffortRun<'_>],
    settle: f64,
    values: &[Vec<f64>],
) -> Result<Vec<Departure>, DidimError> {
    if runs.iter().all(|run| run.positions.is_empty()) {
        return Ok(Vec::new());
    }
    if values.len() != runs.len() {
        return Err(DidimError::Size(SizeError {
            argument: "values",
            expected: runs.len(),
            got: values.len(),
        }));
    }
    let simulated = |(run, values): (&EffortRun<'_>, &Vec<f64>)| {
        let phi = parameters(model, values)?;
        simulate_loop(model, &run.closed_loop, &phi, run.times).map_err(DidimError::from)
    };
    let loops: Result<Vec<LoopRun>, _> = runs.iter().zip(values).map(simulated).collect();
    Ok(of_loops(&model.info(), runs, &loops?, settle))
}

/// How far the motion simulated with these base parameters is from the measured one: the sum of the
/// squares of all [`departures`]; `None` where it cannot be simulated or no position is measured.
///
/// - `settle`: seconds at the start of each run that do not count;
/// - `values`: for each run its base parameters, r.
///
/// ```
/// # mod models {
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs"));
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum_base.rs"));
/// # }
/// use regen_response::motion_distance;
///
/// assert_eq!(motion_distance(&models::Pendulum, &[], 0.0, &[]), None);
/// ```
pub fn motion_distance<M: BaseModel<f64> + ?Sized + Sync>(
    model: &M,
    runs: &[EffortRun<'_>],
    settle: f64,
    values: &[Vec<f64>],
) -> Option<f64> {
    let found = departures(model, runs, settle, values).ok()?;
    let squares = found.iter().map(|own| own.percent * own.percent);
    (!found.is_empty()).then(|| squares.sum())
}

/// The departures of loops that are simulated already, one for each run.
pub(crate) fn of_loops(
    info: &Info<'_>,
    runs: &[EffortRun<'_>],
    loops: &[LoopRun],
    settle: f64,
) -> Vec<Departure> {
    let n = info.coordinates.len();
    // for each coordinate the squares of differences and of the motion
    let mut squares = vec![[0.0; 2]; n];
    for (run, simulated) in runs.iter().zip(loops) {
        let first = run.times.first().copied().unwrap_or(0.0);
        let skip = run.times.iter();
        let skip = skip.take_while(|t| *t - first < settle).count();
        for (c, measured) in run.positions {
            let Some(sums) = squares.get_mut(*c) else {
                continue;
            };
            let used = measured.get(skip..).unwrap_or_default();
            let mean = used.iter().sum::<f64>() / used.len().max(1) as f64;
            for (k, x) in used.iter().enumerate() {
                let row = simulated.lead + (skip + k) * simulated.stride;
                let own = simulated.log.q.get(row * n + c).copied().unwrap_or(*x);
                sums[0] += (x - own) * (x - own);
                sums[1] += (x - mean) * (x - mean);
            }
        }
    }
    let named = info.coordinates.iter().zip(&squares);
    let moving = named.filter(|(_, [_, motion])| *motion > 0.0);
    moving
        .map(|(name, [difference, motion])| Departure {
            name: (*name).to_owned(),
            percent: 100.0 * (difference / motion).sqrt(),
        })
        .collect()
}
