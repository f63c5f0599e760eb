//! DIDIM: direct and inverse dynamic identification models. Least squares of measured efforts on
//! those of the simulated loop.
//!
//! The positions of the log are not used: a simulated motion has no noise, so that the equations are
//! exact and need no filter. The simulated loop must follow its commands as the robot's does; if the
//! robot's gains are unknown, they are tuned to a bandwidth with the current estimate.
//!
//! At the simulated motion the efforts are the regressor times the parameters, `W beta`. If the loop
//! is stiff, the motion hardly depends on the parameters, and W is nearly the derivative of the
//! efforts, with which the method was published. If it is soft, the controllers answer a change of
//! the parameters by another motion, and rounds with W approach slowly or diverge. So the derivatives
//! J of the whole loop are used, from the loop linearised along its motion (`effort_slopes.rs`), in
//! Gauss's and Newton's method, with steps that are damped where the efforts would fit worse
//! (Levenberg and Marquardt). The standard deviations are those of J.
//!
//! If the simulated loop is not the robot's, its motion differs, which biases the estimate. Measured
//! positions, which the estimate does not use, show how far the simulated motion is from the robot's.

use core::fmt;

use regen_experiment::closed_loop::{ClosedLoop, LoopError};
use regen_identify::data::DataError;
use regen_identify::estimate::EstimateError;
use regen_identify::gains::GainError;
use regen_identify::identify::{EquationKind, Identified, Options, identify};
use regen_identify::model::IdentifiedModel;
use regen_identify::session::LeastSquaresStart;
use regen_identify::states::Filtering;
use regen_identify::status::EffortContributions;
use regen_runtime::{BaseModel, SizeError};

use crate::Number;
use crate::departure::{self, Departure};
use crate::rounds::{Round, RoundKind, Rounds, Simulated, deviations_from, is_same};

/// The efforts of a run, and the control loop that produced them.
#[derive(Clone, Copy)]
pub struct EffortRun<'a> {
    /// The times of the rows, s, evenly spaced.
    pub times: &'a [f64],
    /// The efforts of all actuated joints, N m or N (currents of unknown gain for
    /// [`didim_with_gains`](crate::didim_with_gains), A), in the order of `Info::actuated`; one list for
    /// each.
    pub efforts: &'a [Vec<f64>],
    /// Measured positions by coordinate, rad or m; empty for none. They show how close the simulated
    /// motion is, and do not affect the estimate.
    pub positions: &'a [(usize, Vec<f64>)],
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
    /// The time at the start of each run whose efforts are not used, s: a simulation without lead
    /// begins on the reference, where the robot was not.
    pub settle: f64,
    /// The largest number of rounds.
    pub rounds: usize,
    /// A round is the last one if eps_RA changes by less than this part, and the estimate by an rms of
    /// less than this many standard deviations; of less than five times as many, where the simulation is
    /// not accurate enough to come nearer.
    pub tolerance: f64,
}

impl Default for DidimOptions {
    /// At most twenty rounds, until changes are below 2 %.
    fn default() -> Self {
        Self {
            least_squares: Options::default(),
            filtering: Filtering::default(),
            settle: 0.0,
            rounds: 20,
            tolerance: 0.02,
        }
    }
}

/// The result of DIDIM.
#[derive(Clone, Debug, PartialEq)]
pub struct Didim {
    /// The least squares of the last round: estimate, statistics and standard deviations, which
    /// account for the dependence of the motion on the estimate.
    pub identified: Identified,
    /// The contributions of the parameters to the efforts at the last simulated motion.
    pub contributions: EffortContributions,
    /// eps_RA of each round over all efforts, in percent (Eq. 33).
    pub norms: Vec<f64>,
    /// The number of rounds.
    pub rounds: usize,
    /// Whether the rounds converged within the tolerance. If not, the values are not a solution, and
    /// their standard deviations have no meaning.
    pub converged: bool,
    /// How far the last simulated motion is from the measured positions, if there are any.
    pub departures: Vec<Departure>,
}

impl Didim {
    /// The result as the start of further estimators.
    ///
    /// - `confidence`: the level of the intervals, in (0, 1).
    pub fn start(self, confidence: f64) -> LeastSquaresStart {
        let method = format!(
            "least squares on simulated efforts, {}",
            self.identified.deviations.in_words()
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
/// - `derivatives`: the same model for numbers with derivatives;
/// - `start`: base parameters of a robot that can be simulated, r; nominal ones, or those of least
///   squares.
///
/// # Errors
/// When lists do not fit the model, the loop cannot be simulated with an estimate or linearised, or the
/// efforts leave parameters undetermined: see [`DidimError`].
///
/// ```
/// # mod models {
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs"));
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum_base.rs"));
/// #     base_of_the_pendulum!(regen_response::Number);
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
///     controllers: Controllers::Known { pid: &[Pid { kp: 80.0, ki: 0.0, kd: 9.0, ..Pid::default() }], offset: &[] },
/// };
/// let times: Vec<f64> = (0..300).map(|k| 0.01 * f64::from(k)).collect();
/// // the log of a pendulum of 0.5 kg m^2 and 2 kg m; the estimate starts 30 % off
/// let log = follow(&models::Pendulum, &closed_loop, &[0.5, 2.0], &times)?;
/// let run = EffortRun {
///     times: &times,
///     efforts: &[log.effort.clone()],
///     positions: &[(0, log.q.clone())],
///     closed_loop,
/// };
/// let (model, options) = (&models::Pendulum, DidimOptions::default());
/// let found = didim(model, model, &[run], &options, &[0.65, 1.5])?;
/// assert!((found.identified.estimate.values[0] - 0.5).abs() < 1e-3);
/// assert!(found.converged && !found.departures[0].is_far());
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn didim<M, D>(
    model: &M,
    derivatives: &D,
    runs: &[EffortRun<'_>],
    options: &DidimOptions,
    start: &[f64],
) -> Result<Didim, DidimError>
where
    M: BaseModel<f64> + ?Sized + Sync,
    D: BaseModel<Number> + ?Sized + Sync,
{
    let mut rounds = Rounds {
        model,
        derivatives,
        runs,
        options,
        loads: None,
        resting: None,
    };
    let mut ended = iterate(&mut rounds, start.to_vec())?;
    let RoundKind::Base(found) = ended.found.kind else {
        return Err(EstimateError::NoConvergence.into());
    };
    let mut found = *found;
    // at the motion as it is
    let kind = EquationKind::Forces;
    let plain = identify(model, kind, &options.least_squares, &mut ended.now.log).ok();
    let contributions = EffortContributions::of(match &plain {
        Some(plain) => &plain.factor,
        None => &found.factor,
    });
    found.delays = plain.map(|plain| plain.delays).unwrap_or_default();
    Ok(Didim {
        contributions,
        departures: departure::of_loops(&model.info(), runs, &ended.now.loops, options.settle),
        identified: found,
        rounds: ended.norms.len(),
        norms: ended.norms,
        converged: ended.converged,
    })
}

/// The last round.
pub(crate) struct Ended {
    pub(crate) found: Round,
    /// The unknowns with which the loops were simulated in it.
    pub(crate) values: Vec<f64>,
    pub(crate) now: Simulated,
    /// eps_RA of each round, percent.
    pub(crate) norms: Vec<f64>,
    pub(crate) converged: bool,
}

/// Goes from round to round until the estimate stays as it is.
///
/// - `values`: the unknowns to begin with.
pub(crate) fn iterate<M, D>(
    rounds: &mut Rounds<'_, '_, M, D>,
    mut values: Vec<f64>,
) -> Result<Ended, DidimError>
where
    M: BaseModel<f64> + ?Sized + Sync,
    D: BaseModel<Number> + ?Sized + Sync,
{
    let options = rounds.options;
    rounds.require_sizes()?;
    let mut now = rounds.simulated(&values)?;
    let mut norms: Vec<f64> = Vec::new();
    let mut damping = 0.0;
    loop {
        let found = rounds.estimate(&mut now, &values)?;
        let moved = deviations_from(&found, &values)?;
        let before = norms.last().copied();
        norms.push(found.relative_absolute);
        let quiet = before.is_some_and(|b| {
            let now = found.relative_absolute;
            (now - b).abs() <= options.tolerance * b.max(f64::MIN_POSITIVE)
        });
        let mut converged = quiet && moved <= options.tolerance || is_same(&found.values, &values);
        let mut next = None;
        if !converged && norms.len() < options.rounds.max(1) {
            if moved < NEAR_DEVIATIONS && rounds.resting.is_none() {
                rounds.rest(&mut now.log)?;
            }
            next = rounds.step(&found, &values, now.misfit, &mut damping)?;
            // where the next step fits by far less better than the linearised efforts promise, or no step
            // does, the simulation is not accurate enough for a smaller change
            let after = next.as_ref().map_or(now.misfit, |(_, there)| there.misfit);
            let rows = found.factor.rows().max(1) as f64;
            let promised = 0.5 * values.len() as f64 * moved * moved / rows;
            if now.misfit - after < LEAST_PART * promised
                && moved <= STUCK_TOLERANCES * options.tolerance
            {
                converged = true;
                next = None;
            }
        }
        let Some((moved_to, simulated)) = next else {
            return Ok(Ended {
                found,
                values,
                now,
                norms,
                converged,
            });
        };
        (values, now) = (moved_to, simulated);
    }
}

/// If a round changes the estimate by less than this many standard deviations, the rows at rest of
/// its motion are used for the result.
const NEAR_DEVIATIONS: f64 = 1.0;
/// The part of the promised fall of the misfit below which a step fits no better.
const LEAST_PART: f64 = 0.1;
/// Where no step fits better, the rounds have converged if the estimate changes by at most this many
/// tolerances.
const STUCK_TOLERANCES: f64 = 5.0;

/// The reason why DIDIM found no parameters.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum DidimError {
    /// The length of a list does not fit the model.
    Size(SizeError),
    /// The loop cannot be simulated with an estimate.
    Loop(LoopError),
    /// The simulated loop cannot be linearised along its motion.
    NotLinearised {
        /// The time after the first row of the log, s; negative in the lead.
        after: f64,
        /// The reason, in words.
        why: &'static str,
    },
    /// The efforts leave parameters undetermined.
    Estimate(EstimateError),
    /// The efforts leave gains or payloads undetermined.
    Gains(GainError),
}

impl fmt::Display for DidimError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size(why) => why.fmt(f),
            Self::Loop(why) => why.fmt(f),
            Self::NotLinearised { after, why } => write!(
                f,
                "the simulated loop cannot be linearised {after} s after the first row: {why}"
            ),
            Self::Estimate(why) => why.fmt(f),
            Self::Gains(why) => why.fmt(f),
        }
    }
}

impl core::error::Error for DidimError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Size(why) => Some(why),
            Self::Loop(why) => Some(why),
            Self::NotLinearised { .. } => None,
            Self::Estimate(why) => Some(why),
            Self::Gains(why) => Some(why),
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

impl From<GainError> for DidimError {
    fn from(why: GainError) -> Self {
        match why {
            GainError::Data(DataError::Estimate(why)) => Self::Estimate(why),
            why => Self::Gains(why),
        }
    }
}

impl From<EstimateError> for DidimError {
    fn from(why: EstimateError) -> Self {
        Self::Estimate(why)
    }
}

#[cfg(test)]
mod tests {
    use core::error::Error;

    use regen_runtime::ClosureError;

    use super::*;
    use crate::TrackError;

    #[test]
    fn errors_that_pass_on_another_name_it_as_their_source() {
        let why = DidimError::Estimate(EstimateError::NoConvergence);
        assert_eq!(
            why.source().map(ToString::to_string),
            Some(EstimateError::NoConvergence.to_string())
        );
        let size = SizeError {
            argument: "q",
            expected: 2,
            got: 1,
        };
        let why = TrackError::from(ClosureError::from(size));
        assert!(why.source().is_some());
    }
}
