//! DIDIM: direct and inverse dynamic identification models. Least squares of measured efforts on the
//! regressor at the motion of the simulated loop, repeated with the new estimate.
//!
//! The positions of the log are not used: a simulated motion has no noise, so that the regressor is
//! exact and needs no filter. The loop that is simulated must follow its commands as the robot's
//! does; where the robot's gains are not known, gains that keep a bandwidth with the present
//! estimate take their place.
//!
//! An estimate is a function G of the parameters that are simulated; the result is where both are
//! equal. Repeating finds it in a few rounds where the loop is stiff; where it is so soft that this
//! takes many, Newton's method with the slopes of G by differences takes over. The same slopes
//! belong into the deviations.

use core::fmt;

use nalgebra::{DMatrix, DVector};
use regen_experiment::closed_loop::{ClosedLoop, LoopError, follow};
use regen_experiment::simulate::Settings;
use regen_identify::estimate::EstimateError;
use regen_identify::identify::{
    EquationKind, Filtering, Identified, Options, Recorded, Source as _, StateSample, identify,
    observe,
};
use regen_identify::model::IdentifiedModel;
use regen_identify::session::{LeastSquaresStart, describe};
use regen_runtime::{BaseModel, SizeError};

/// Velocities below this many widths of the simulated friction count as rest: the sign that the
/// regressor takes is not what acted there.
const REST_WIDTHS: f64 = 4.0;

/// The efforts of a run, and the loop that made them.
#[derive(Clone, Copy)]
pub struct EffortRun<'a> {
    /// The times of the rows, s, evenly spaced.
    pub times: &'a [f64],
    /// The efforts of all actuated joints, N m or N, in the order of `Info::actuated`; one list for
    /// each.
    pub efforts: &'a [Vec<f64>],
    /// The loop of the run.
    pub closed_loop: ClosedLoop<'a>,
}

/// The settings of DIDIM.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DidimOptions {
    /// Weights, Huber's bound and bandwidth of the least squares of each round.
    pub least_squares: Options,
    /// How the equations are filtered and decimated.
    pub filtering: Filtering,
    /// Seconds at the start of each run whose efforts are not used: a simulation without lead begins
    /// at the reference, where the robot was not.
    pub settle: f64,
    /// The largest number of rounds.
    pub rounds: usize,
    /// A round is the last one if eps_RA changes by less than this part, and the estimate by less than
    /// this many standard deviations in the root mean square.
    pub tolerance: f64,
}

impl Default for DidimOptions {
    /// Twelve rounds at most, until changes are below 2 %.
    fn default() -> Self {
        Self {
            least_squares: Options::default(),
            filtering: Filtering::default(),
            settle: 0.0,
            rounds: 12,
            tolerance: 0.02,
        }
    }
}

/// The result of DIDIM.
#[derive(Clone, Debug, PartialEq)]
pub struct Didim {
    /// The least squares of the last round: estimate, statistics and deviations, which know that the
    /// motion follows from the estimate.
    pub identified: Identified,
    /// eps_RA of each round over all efforts, in percent (Eq. 33).
    pub norms: Vec<f64>,
    /// The number of rounds.
    pub rounds: usize,
    /// Whether the last round changed the estimate as little as the tolerance says. If not, the values
    /// solve nothing, and their deviations are of no use.
    pub settled: bool,
}

impl Didim {
    /// The result as the start of further estimators.
    ///
    /// - `confidence`: the level of the intervals, in (0, 1).
    pub fn start(self, confidence: f64) -> LeastSquaresStart {
        let method = format!(
            "least squares at the simulated motion, {}",
            describe(&self.identified.deviations)
        );
        LeastSquaresStart::of_identified(self.identified, confidence, method)
    }

    /// The result as an identified model.
    ///
    /// - `confidence`: the level of the intervals, in (0, 1).
    pub fn model(&self, confidence: f64) -> IdentifiedModel {
        IdentifiedModel {
            name: "DIDIM".to_owned(),
            ..self.clone().start(confidence).model()
        }
    }
}

/// Identifies base parameters from efforts, by simulating the closed loop.
///
/// - `start`: base parameters of a robot that can be simulated, r; nominal ones, or those of least
///   squares.
///
/// # Errors
/// When lists do not fit the model, the loop cannot be simulated with an estimate or near the last
/// one, or the efforts leave parameters undetermined: see [`DidimError`].
///
/// ```
/// # mod models {
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs"));
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum_base.rs"));
/// # }
/// use regen_experiment::closed_loop::{ClosedLoop, Controllers, follow};
/// use regen_experiment::simulate::Pid;
/// use regen_response::{DidimOptions, EffortRun, didim};
///
/// let swing = |t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
///     let w = 3.0;
///     (q[0], qd[0], qdd[0]) =
///         ((w * t).sin(), w * (w * t).cos(), -w * w * (w * t).sin());
/// };
/// let closed_loop = ClosedLoop {
///     reference: &swing,
///     lead: 0.0,
///     controllers: Controllers::Known { pid: &[Pid { kp: 80.0, ki: 0.0, kd: 9.0 }], offset: &[] },
/// };
/// let times: Vec<f64> = (0..300).map(|k| 0.01 * f64::from(k)).collect();
/// // the log of a pendulum of 0.5 kg m^2 and 2 kg m; the estimate starts 30 % off
/// let log = follow(&models::Pendulum, &closed_loop, &[0.5, 2.0], &times)?;
/// let run = EffortRun { times: &times, efforts: &[log.effort.clone()], closed_loop };
/// let found = didim(&models::Pendulum, &[run], &DidimOptions::default(), &[0.65, 1.5])?;
/// assert!((found.identified.estimate.values[0] - 0.5).abs() < 1e-3);
/// assert!(found.settled);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn didim<M: BaseModel<f64> + ?Sized + Sync>(
    model: &M,
    runs: &[EffortRun<'_>],
    options: &DidimOptions,
    start: &[f64],
) -> Result<Didim, DidimError> {
    let info = model.info();
    for run in runs {
        let fits = |expected, got| {
            if expected == got {
                return Ok(());
            }
            Err(DidimError::Size(SizeError {
                argument: "efforts",
                expected,
                got,
            }))
        };
        fits(info.actuated.len(), run.efforts.len())?;
        for efforts in run.efforts {
            fits(run.times.len(), efforts.len())?;
        }
    }
    let mut rounds = Rounds {
        model,
        runs,
        options,
        slopes: None,
        resting: None,
    };
    let mut values = start.to_vec();
    let mut log = rounds.simulated(&values)?;
    let mut norms: Vec<f64> = Vec::new();
    loop {
        let found = identify(
            model,
            EquationKind::Forces,
            &options.least_squares,
            &mut log,
        )?;
        let moved = moved(&found, &values)?;
        let before = norms.last().copied();
        norms.push(found.relative_absolute);
        let quiet = before.is_some_and(|b| {
            let now = found.relative_absolute;
            (now - b).abs() <= options.tolerance * b.max(f64::MIN_POSITIVE)
        });
        let settled =
            quiet && moved <= options.tolerance || is_same(&found.estimate.values, &values);
        let last = settled || norms.len() >= options.rounds.max(1);
        if moved < NEAR_DEVIATIONS && rounds.resting.is_none() {
            rounds.rest(&mut log)?;
        }
        if last || norms.len() == PLAIN_ROUNDS && moved < NEAR_DEVIATIONS {
            match rounds.differentiate(&found, &values) {
                Ok(()) => {}
                // where the robot cannot be simulated nearby, rounds go on without slopes; a result
                // without them would have deviations that are not its own
                Err(DidimError::Loop(_)) if !last => {}
                Err(other) => return Err(other),
            }
        }
        if last {
            return Ok(Didim {
                identified: rounds.propagated(found),
                rounds: norms.len(),
                norms,
                settled,
            });
        }
        let wanted = rounds.next(&found, &values);
        (values, log) = rounds.simulable(&values, wanted)?;
    }
}

/// Below this change in standard deviations the rows that rest are those of the result.
const NEAR_DEVIATIONS: f64 = 1.0;
/// The relative change at which values count as the same; simulated motion has a few digits more.
const SAME_DIGITS: f64 = 1e-5;
/// The number of rounds that take the estimate as it is; later ones take Newton's step.
const PLAIN_ROUNDS: usize = 7;
/// The change of the efforts of all rows together, in standard deviations of one, over which slopes
/// are computed.
const STEP_DEVIATIONS: f64 = 5.0;
/// How often a change of the estimate is halved until the robot can be simulated with it.
const MAX_HALVINGS: usize = 8;

/// The rounds of one identification.
struct Rounds<'a, 'r, M: ?Sized> {
    model: &'a M,
    runs: &'a [EffortRun<'r>],
    options: &'a DidimOptions,
    /// `1 - dG/dbeta`, r x r, where G is the estimate as a function of the parameters that are
    /// simulated: column-major.
    slopes: Option<DMatrix<f64>>,
    /// For each row, which coordinates rest, once the slopes are known: rows that come and go would
    /// make the estimate jump.
    resting: Option<Vec<Vec<bool>>>,
}

impl<M: BaseModel<f64> + ?Sized + Sync> Rounds<'_, '_, M> {
    /// The log of the measured efforts at the motion of the loop simulated with these parameters.
    fn simulated(&self, values: &[f64]) -> Result<Recorded, DidimError> {
        let (model, options) = (self.model, self.options);
        let info = model.info();
        let (n, dof) = (info.coordinates.len(), info.dof());
        let mut phi = vec![0.0; info.parameters.len()];
        let free = vec![0.0; model.base_info().free.len()];
        model.parameters_from_base(values, &free, &mut phi)?;
        let slow = REST_WIDTHS * Settings::default().friction_width;
        let mut out = Recorded::new().filtered(options.filtering);
        let weights = vec![1.0; dof];
        let mut tau = vec![0.0; dof];
        for run in self.runs {
            let log = follow(model, &run.closed_loop, &phi, run.times)?;
            let first = run.times.first().copied().unwrap_or(0.0);
            let mut follows = false;
            for (k, time) in run.times.iter().enumerate() {
                if time - first < options.settle {
                    continue;
                }
                let row = |all: &[f64]| all.get(k * n..(k + 1) * n).unwrap_or_default().to_vec();
                let [q, qd, qdd] = [&log.q, &log.qd, &log.qdd].map(|all| row(all));
                let efforts: Vec<f64> = run.efforts.iter().map(|e| e[k]).collect();
                let _condition = model.generalized_forces(&q, &efforts, &mut tau)?;
                let known = self.resting.as_ref().and_then(|all| all.get(out.len()));
                let still = match known {
                    Some(known) => known.clone(),
                    None => qd.iter().map(|v| v.abs() < slow).collect(),
                };
                out.push_row(&StateSample {
                    time: *time,
                    q: &q,
                    qd: &qd,
                    qdd: &qdd,
                    tau: &tau,
                    efforts: &efforts,
                    at_standstill: &still,
                    weights: &weights,
                    follows,
                });
                follows = true;
            }
        }
        Ok(out)
    }

    /// The parameters to simulate next: the estimate, or once the slopes are known, Newton's step
    /// to the parameters that are their own estimate.
    fn next(&self, found: &Identified, values: &[f64]) -> Vec<f64> {
        let estimate = &found.estimate.values;
        let change = estimate.iter().zip(values).map(|(a, b)| a - b);
        let change = DVector::from_iterator(values.len(), change);
        let step = self
            .slopes
            .as_ref()
            .and_then(|s| s.clone().lu().solve(&change));
        let step = step.unwrap_or(change);
        values.iter().zip(step.iter()).map(|(x, d)| x + d).collect()
    }

    /// Simulates with these parameters, or with some between them and the last ones if that cannot
    /// be simulated.
    fn simulable(
        &self,
        values: &[f64],
        mut wanted: Vec<f64>,
    ) -> Result<(Vec<f64>, Recorded), DidimError> {
        for _ in 0..MAX_HALVINGS {
            match self.simulated(&wanted) {
                Ok(log) => return Ok((wanted, log)),
                Err(DidimError::Loop(_)) => {
                    for (x, old) in wanted.iter_mut().zip(values) {
                        *x = f64::midpoint(*x, *old);
                    }
                }
                Err(other) => return Err(other),
            }
        }
        let log = self.simulated(&wanted)?;
        Ok((wanted, log))
    }

    /// Keeps the rows that rest in a log for all later ones.
    fn rest(&mut self, log: &mut Recorded) -> Result<(), DidimError> {
        let mut resting = Vec::new();
        log.visit(&mut |row| {
            resting.push(row.at_standstill.to_vec());
            Ok(())
        })?;
        self.resting = Some(resting);
        Ok(())
    }

    /// Computes the slopes by differences.
    fn differentiate(&mut self, found: &Identified, values: &[f64]) -> Result<(), DidimError> {
        let n = values.len();
        let weights: Vec<f64> = found.estimate.efforts.iter().map(|e| e.weight).collect();
        if self.resting.is_none() {
            let mut log = self.simulated(values)?;
            self.rest(&mut log)?;
        }
        let this = &*self;
        let estimate = |values: &[f64]| -> Result<Vec<f64>, DidimError> {
            let mut log = this.simulated(values)?;
            let (set, _) = observe(this.model, EquationKind::Forces, &mut log)?;
            Ok(set.combined(&weights)?.solve()?)
        };
        let here = estimate(values)?;
        // so much that the efforts of all rows together change by a few standard deviations
        let norms = found.factor.column_norms();
        let step = |k: usize| {
            let norm = norms.get(k).copied().unwrap_or(0.0);
            if norm > 0.0 {
                STEP_DEVIATIONS / norm
            } else {
                1e-6
            }
        };
        let column = |k: usize| -> Result<Vec<f64>, DidimError> {
            let moved = |by: f64| {
                let mut moved = values.to_vec();
                moved[k] += by;
                estimate(&moved)
            };
            // the other direction where this one cannot be simulated
            let (h, there) = match moved(step(k)) {
                Ok(there) => (step(k), there),
                Err(_) => (-step(k), moved(-step(k))?),
            };
            Ok(there.iter().zip(&here).map(|(a, b)| (a - b) / h).collect())
        };
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let threads = threads.min(n).max(1);
        let work = |first: usize| -> Vec<(usize, Result<Vec<f64>, DidimError>)> {
            (first..n)
                .step_by(threads)
                .map(|k| (k, column(k)))
                .collect()
        };
        let work = &work;
        let mut columns = std::thread::scope(|scope| {
            let all: Vec<_> = (0..threads).map(|t| scope.spawn(move || work(t))).collect();
            let mut out = Vec::new();
            for thread in all {
                match thread.join() {
                    Ok(part) => out.extend(part),
                    Err(panic) => std::panic::resume_unwind(panic),
                }
            }
            out
        });
        columns.sort_by_key(|(k, _)| *k);
        let mut slopes = DMatrix::identity(n, n);
        for (k, column) in columns {
            for (i, slope) in column?.iter().enumerate() {
                slopes[(i, k)] -= slope;
            }
        }
        self.slopes = Some(slopes);
        Ok(())
    }

    /// The estimate whose deviations know that the simulated motion follows from it: an error of the
    /// efforts moves the parameters, these move the motion, and that moves the parameters again.
    fn propagated(&self, mut found: Identified) -> Identified {
        let Some(inverse) = self.slopes.as_ref().and_then(|s| s.clone().try_inverse()) else {
            return found;
        };
        let n = inverse.nrows();
        let through = |covariance: &[f64]| -> Vec<f64> {
            let inner = DMatrix::from_column_slice(n, n, covariance);
            let whole = &inverse * inner * inverse.transpose();
            (0.5 * (&whole + whole.transpose())).as_slice().to_vec()
        };
        found.estimate.covariance = through(&found.estimate.covariance);
        let freedom = found.deviations.degrees_of_freedom.clone();
        let whole = through(&found.deviations.covariance);
        found.deviations = found.deviations.with_covariance(whole, 0);
        found.deviations.degrees_of_freedom = freedom;
        found
    }
}

/// Whether two lists of values agree to the digits that simulation gives. Efforts without noise leave
/// hardly any deviations, which changes could be compared with.
fn is_same(found: &[f64], values: &[f64]) -> bool {
    let largest = found.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let mut both = found.iter().zip(values);
    both.all(|(a, b)| (a - b).abs() <= SAME_DIGITS * a.abs().max(SAME_DIGITS * largest))
}

/// By how many standard deviations an estimate differs from values: the root mean square over all
/// directions.
fn moved(found: &Identified, values: &[f64]) -> Result<f64, DidimError> {
    let n = values.len().max(1) as f64;
    let (rows, factor) = (found.factor.rows(), &found.factor);
    let spare = rows.saturating_sub(values.len()).max(1) as f64;
    let variance = (factor.rss() / spare).max(f64::MIN_POSITIVE);
    let more = factor.squared_residual(values)? - factor.rss();
    Ok((more.max(0.0) / variance / n).sqrt())
}

/// Why DIDIM found no parameters.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum DidimError {
    /// A list does not fit the model.
    Size(SizeError),
    /// The loop cannot be simulated with an estimate.
    Loop(LoopError),
    /// The efforts leave parameters undetermined.
    Estimate(EstimateError),
}

impl fmt::Display for DidimError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size(why) => why.fmt(f),
            Self::Loop(why) => why.fmt(f),
            Self::Estimate(why) => why.fmt(f),
        }
    }
}

impl core::error::Error for DidimError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Size(why) => Some(why),
            Self::Loop(why) => Some(why),
            Self::Estimate(why) => Some(why),
        }
    }
}

impl From<SizeError> for DidimError {
    fn from(why: SizeError) -> Self {
        Self::Size(why)
    }
}

impl From<LoopError> for DidimError {
    fn from(why: LoopError) -> Self {
        Self::Loop(why)
    }
}

impl From<EstimateError> for DidimError {
    fn from(why: EstimateError) -> Self {
        Self::Estimate(why)
    }
}
