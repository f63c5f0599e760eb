//! A rehearsal: simulates and identifies runs, over many seeds and threads.

use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use regen_experiment::simulate::Twin;
use regen_experiment::trajectory::FourierReference;
use regen_identify::data::Settings;
use regen_identify::identify::{EquationKind, Options};
use regen_response::Number;
use regen_runtime::{BaseModel, Model};

use crate::error::RehearseError;
use crate::estimate::Estimator;
use crate::friction;
use crate::loads::Loads;
use crate::score::Score;
use crate::trial::{Fit, Trial};

/// The settings of simulation and identification.
pub struct Rehearsal<'a, M: ?Sized> {
    /// The model of the robot that identification uses.
    pub model: &'a M,
    /// The simulated robot. Its settings may have friction that the model lacks.
    pub twin: &'a Twin,
    /// The motion that its controllers follow.
    pub motion: &'a FourierReference,
    /// The durations of the runs of each seed, s. A further run, as long as the longest, is simulated
    /// once and predicted with every estimate.
    pub durations: &'a [f64],
    /// The time at the start of each run that is left out of its log, s.
    pub settle: f64,
    /// How the logs are read and processed.
    pub reading: Settings,
    /// The equations of least squares.
    pub kind: EquationKind,
    /// Whether a filter is chosen from the logs of each seed, in place of the method of `reading`, as
    /// for logs of machines.
    pub chooses_filter: bool,
    /// Whether delays of efforts are estimated and corrected, as for logs of machines.
    pub finds_delays: bool,
    /// The options of least squares.
    pub options: Options,
    /// The level of the intervals, in (0, 1).
    pub confidence: f64,
    /// The estimator.
    pub estimator: Estimator,
    /// Unknown gains and payloads, which [`Estimator::LeastSquares`] and [`Estimator::Physical`]
    /// without friction can identify; `None` without any.
    pub loads: Option<Loads>,
    /// The seed of the first trial; the others follow it.
    pub first: u64,
    /// The number of seeds.
    pub seeds: usize,
    /// The number of threads; 0: as many as the machine has. The result does not depend on it.
    pub threads: usize,
    /// An existing folder for the simulated logs.
    pub folder: &'a Path,
    /// Whether the logs are kept there.
    pub keep: bool,
}

/// Simulates and identifies every seed, and scores the estimates.
///
/// - `stop`: once it is true, no further seed is begun, and the finished ones are scored;
/// - `progress`: called with the number of finished seeds.
///
/// # Errors
/// When the settings are invalid for every seed, or a log cannot be written. Seeds whose estimate does
/// not converge, whose simulation ends early or whose logs are refused count as missed in the score.
///
/// ```
/// use std::sync::atomic::AtomicBool;
///
/// use regen_experiment::simulate::{Sensors, Twin, TwinOptions};
/// use regen_experiment::trajectory::FourierReference;
/// use regen_identify::{data, identify, signals::Fourier};
/// use regen_rehearse::{Estimator, Rehearsal, rehearse};
/// use regen_runtime::{BaseModel, Model};
///
/// regen_runtime::robot_model!("tests/swing.yaml");
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let robot = swing::Swing;
/// let nominal = Model::<f64>::info(&robot).nominal_parameters().ok_or("no nominal values")?;
/// // 0.5 Hz about -0.4 rad
/// let series = Fourier::of_positions(0.5, &[(-0.4, vec![0.5, 0.1], vec![0.3, -0.2])])?;
/// let motion = FourierReference::new("swing".to_owned(), series, 1);
/// let options = TwinOptions {
///     bandwidth: 8.0,
///     gains: &[],
///     period: 0.005,
///     lag: 0.0,
///     friction: true,
///     friction_width: 1e-3,
///     sensors: Sensors { position_noise: 1e-5, effort_noise: 0.01, ..Sensors::default() },
///     perturb: 0.1,
///     seed: 1,
/// };
/// let twin = Twin::new(&robot, &nominal, &[], &motion.states(), &options)?;
/// let folder = std::env::temp_dir().join(format!("rehearse-{}", std::process::id()));
/// std::fs::create_dir_all(&folder)?;
/// let rehearsal = Rehearsal {
///     model: &robot,
///     twin: &twin,
///     motion: &motion,
///     durations: &[4.0],
///     settle: 0.0,
///     reading: data::Settings {
///         method: regen_identify::signals::Method::Butterworth { order: 4, cutoff: 15.0 },
///         ..data::Settings::default()
///     },
///     kind: identify::EquationKind::Forces,
///     chooses_filter: false,
///     finds_delays: false,
///     options: identify::Options::default(),
///     confidence: 0.95,
///     estimator: Estimator::LeastSquares,
///     loads: None,
///     first: 1,
///     seeds: 6,
///     threads: 2,
///     folder: &folder,
///     keep: false,
/// };
/// let score = rehearse(&rehearsal, &AtomicBool::new(false), &|_| {})?;
/// assert_eq!((score.seeds, score.failed.len()), (6, 0));
/// assert!(score.least > 80.0, "percent of the seeds within 3 sigma, in every parameter");
/// # std::fs::remove_dir_all(folder)?;
/// # Ok(())
/// # }
/// ```
pub fn rehearse<M>(
    rehearsal: &Rehearsal<'_, M>,
    stop: &AtomicBool,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<Score, RehearseError>
where
    M: BaseModel<f64> + BaseModel<Number> + ?Sized + Sync,
{
    check(rehearsal)?;
    let model = rehearsal.model;
    let base = BaseModel::<f64>::base_info(model);
    let mut labels: Vec<String> = base.base.iter().map(|b| b.label.to_owned()).collect();
    let mut truth = vec![0.0; labels.len()];
    let known = rehearsal.parameters();
    BaseModel::<f64>::to_base(model, &known, &mut truth)?;
    let fresh = rehearsal.fresh(&truth)?;
    let (more, values) = friction::truth(&rehearsal.sought_friction());
    labels.extend(more);
    truth.extend(values);
    if let Some(loads) = &rehearsal.loads {
        let (more, values) = loads.truth(&Model::<f64>::info(model), &known);
        labels.extend(more);
        truth.extend(values);
    }
    let next = AtomicUsize::new(0);
    let failed = AtomicBool::new(false);
    let done: Mutex<Vec<(usize, Result<Trial, RehearseError>)>> = Mutex::new(Vec::new());
    let work = || loop {
        let k = next.fetch_add(1, Ordering::Relaxed);
        let ends = stop.load(Ordering::Relaxed) || failed.load(Ordering::Relaxed);
        if k >= rehearsal.seeds || ends {
            return;
        }
        let trial = rehearsal.trial(rehearsal.first.wrapping_add(k as u64), fresh.as_ref());
        if trial.is_err() {
            failed.store(true, Ordering::Relaxed);
        }
        if let Ok(mut done) = done.lock() {
            done.push((k, trial));
            progress(done.len());
        }
    };
    let threads = match rehearsal.threads {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        given => given,
    };
    std::thread::scope(|scope| {
        for _ in 0..threads.min(rehearsal.seeds) {
            scope.spawn(work);
        }
    });
    rehearsal.tidy(
        fresh
            .as_ref()
            .map_or(&[], |fresh| std::slice::from_ref(&fresh.run)),
    );
    let mut done = done
        .into_inner()
        .unwrap_or_else(std::sync::PoisonError::into_inner);
    done.sort_by_key(|(k, _)| *k);
    let trials: Result<Vec<Trial>, RehearseError> =
        done.into_iter().map(|(_, trial)| trial).collect();
    let mut trials = trials?;
    if rehearsal.loads.is_some() || labels.len() > base.base.len() {
        // shapes of friction and parameters of payloads that are given, or that no fit determines, are
        // not scored
        let fits = || {
            trials
                .iter()
                .filter_map(|trial| trial.outcome.as_ref().ok())
        };
        let is_sought = |k: usize| {
            let has = |fit: &Fit| fit.intervals.get(k).is_some_and(Option::is_some);
            fits().next().is_none() || fits().any(has)
        };
        let sought: Vec<bool> = (0..labels.len()).map(is_sought).collect();
        retain(&mut labels, &sought);
        retain(&mut truth, &sought);
        for fit in trials
            .iter_mut()
            .filter_map(|trial| trial.outcome.as_mut().ok())
        {
            retain(&mut fit.values, &sought);
            retain(&mut fit.intervals, &sought);
        }
    }
    let labels: Vec<&str> = labels.iter().map(String::as_str).collect();
    Ok(Score::new(
        &labels,
        &truth,
        &trials,
        rehearsal.seeds,
        rehearsal.confidence,
    ))
}

/// Keeps the entries that are sought.
fn retain<T>(list: &mut Vec<T>, sought: &[bool]) {
    let mut sought = sought.iter();
    list.retain(|_| sought.next().copied().unwrap_or(false));
}

fn check<M: BaseModel<f64> + ?Sized>(rehearsal: &Rehearsal<'_, M>) -> Result<(), RehearseError> {
    let wrong = |name, must| Err(RehearseError::Setting(name, must));
    if rehearsal.seeds == 0 {
        return wrong("the number of seeds", "must be at least 1");
    }
    if !(rehearsal.confidence > 0.0 && rehearsal.confidence < 1.0) {
        return wrong("the level of the intervals", "must be between 0 and 1");
    }
    if !(rehearsal.settle >= 0.0 && rehearsal.settle.is_finite()) {
        return wrong("the time to settle", "must be at least 0");
    }
    let step = rehearsal.twin.settings.period;
    let is_long = |duration: &f64| duration.is_finite() && *duration >= step;
    if rehearsal.durations.is_empty() || !rehearsal.durations.iter().all(is_long) {
        return wrong("the duration of a run", "must be at least one time step");
    }
    if let Some(loads) = &rehearsal.loads {
        let takes = match &rehearsal.estimator {
            Estimator::LeastSquares | Estimator::Instrumental { .. } | Estimator::Didim(_) => true,
            Estimator::Physical { friction, .. } => !friction,
            Estimator::Response { .. } => false,
        };
        if !takes || rehearsal.finds_delays || rehearsal.kind != EquationKind::Forces {
            return wrong(
                "the estimator of gains and payloads",
                "must be least squares, with or without physical constraints, instrumental \
                 variables or DIDIM from the equations of motion, without delays to find",
            );
        }
        if loads.gains.iter().any(|(_, gain)| !gain.is_normal()) {
            return wrong("the gain of a drive", "must be a number other than 0");
        }
    }
    if let Estimator::Physical { draws: 0, .. } = rehearsal.estimator {
        return wrong(
            "the number of draws",
            "must not be 0: there would be no interval",
        );
    }
    if let Estimator::Instrumental { along: true } = rehearsal.estimator {
        let periods = rehearsal.settle / rehearsal.motion.period();
        if (periods - periods.round()).abs() > 1e-9 * periods.max(1.0) {
            return wrong(
                "the time to settle",
                "must be whole periods of the motion that instruments are simulated along",
            );
        }
    }
    Ok(())
}
