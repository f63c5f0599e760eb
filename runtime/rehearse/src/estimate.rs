//! Identifies from the logs of one seed with the rehearsed estimator.

use regen_experiment::closed_loop::Controllers;
use regen_experiment::instruments::instrumental;
use regen_experiment::simulate::{Gains, Pid, Reference, Settings as Simulated};
use regen_experiment::trajectory::FourierReference;
use regen_identify::data::{Run, Track, tracks};
use regen_identify::feasibility::MAX_OPTIMAL_GAP;
use regen_identify::gains::{LoadedLoops, Plan};
use regen_identify::model::IdentifiedModel;
use regen_identify::session::{
    LeastSquaresStart, PriorKnowledge, Session, from_logs, gain_options, physical, settled_delays,
    with_friction,
};
use regen_response::{
    DidimError, DidimOptions, EffortTracks, KnownReference, Law, Number, Run as Response, Setup,
    Value, didim, didim_with_gains, fit_responses,
};
use regen_runtime::{BaseModel, Info, Model};

use crate::error::RehearseError;

/// The rehearsed estimator with its settings.
#[derive(Clone, Debug)]
pub enum Estimator {
    /// Least squares, with Huber's weights if the session's options have them.
    LeastSquares,
    /// Physically feasible parameters from least squares.
    Physical {
        /// The prior knowledge of parameters.
        knowledge: PriorKnowledge,
        /// The number of draws from which intervals are computed, not 0.
        draws: usize,
        /// Whether the nonlinear friction of the description is identified.
        friction: bool,
    },
    /// Instrumental variables, from the smoothed measured motion or from a simulated one.
    Instrumental {
        /// Whether the instruments are simulated along the reference motion, with the gains of the
        /// controllers.
        along: bool,
    },
    /// Efforts at the motion of the simulated loop.
    Didim(DidimSettings),
    /// Responses to commands, with known controllers.
    Response {
        /// The length of windows, s.
        window: f64,
        /// The base parameters to start from, r.
        start: Vec<f64>,
    },
}

impl Estimator {
    /// The estimator's name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::LeastSquares => "least squares",
            Self::Physical {
                friction: false, ..
            } => "physically feasible least squares",
            Self::Physical { friction: true, .. } => "feasible least squares with friction",
            Self::Instrumental { .. } => "instrumental variables",
            Self::Didim(_) => "DIDIM",
            Self::Response { .. } => "responses to commands",
        }
    }

    /// Whether residuals have a loss that may be chosen.
    pub(crate) fn has_open_loss(&self) -> bool {
        matches!(
            self,
            Self::LeastSquares
                | Self::Physical {
                    friction: false,
                    ..
                }
        )
    }

    /// Whether equations are set up from the measured motion.
    pub(crate) fn reads_motion(&self) -> bool {
        !matches!(self, Self::Didim(_) | Self::Response { .. })
    }
}

/// An estimate, or the reason why there is none, in words.
pub(crate) type Estimated = Result<IdentifiedModel, String>;

/// The motion and the settings with which the runs of a seed were simulated; an estimator may be
/// given a part of them.
pub(crate) struct Made<'a> {
    pub(crate) motion: &'a FourierReference,
    /// The start of the logs in the motion's time, s.
    pub(crate) settle: f64,
    pub(crate) settings: &'a Simulated,
}

/// Identifies from the logs of a seed.
pub(crate) fn estimate<M>(
    estimator: &Estimator,
    session: &mut Session<'_, M>,
    runs: &[Run],
    made: &Made<'_>,
    finds_delays: bool,
) -> Result<Estimated, RehearseError>
where
    M: BaseModel<f64> + BaseModel<Number> + ?Sized + Sync,
{
    if finds_delays && estimator.reads_motion() {
        session.reading.delays = settled_delays(session, runs)?;
        session.reading.are_delays_found = true;
    }
    match estimator {
        Estimator::LeastSquares => Ok(Ok(least_squares(session, runs)?.model())),
        Estimator::Physical {
            knowledge,
            draws,
            friction,
        } => {
            let start = if *friction {
                with_friction(session, runs)?
            } else {
                least_squares(session, runs)?
            };
            let found = physical(session, knowledge, &start, *draws)?;
            Ok(match found.into_iter().last() {
                Some(last) if last.gap.is_some_and(|gap| gap <= MAX_OPTIMAL_GAP) => Ok(last),
                _ => Err("the physical fit is not proven to be the optimum".to_owned()),
            })
        }
        Estimator::Instrumental { along } => {
            let start = least_squares(session, runs)?;
            let gains = gains(&Model::<f64>::info(session.model), &made.settings.pid);
            let reference = along.then_some((made.motion, gains.as_slice()));
            let found = instrumental(session, &start, runs, reference)?;
            Ok(converged(
                found.model,
                found.instrumental.converged,
                found.instrumental.rounds,
            ))
        }
        Estimator::Didim(settings) => settings.estimate(session, &read(session, runs)?, made, None),
        Estimator::Response { window, start } => {
            let all = read(session, runs)?;
            from_responses(session, &all, made, *window, start)
        }
    }
}

fn least_squares<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    runs: &[Run],
) -> Result<LeastSquaresStart, RehearseError> {
    let mut logs = session.open(runs)?;
    Ok(from_logs(session, &mut logs)?)
}

/// The gains of controllers, by the names of their joints.
pub(crate) fn gains(info: &Info<'_>, pid: &[Pid]) -> Vec<Gains> {
    let named = info.actuated.iter().zip(pid).map(|(joint, pid)| Gains {
        name: info.coordinates.get(*joint).map(|name| (*name).to_owned()),
        values: [pid.kp, pid.ki, pid.kd],
    });
    named.collect()
}

pub(crate) fn converged(model: IdentifiedModel, has_converged: bool, rounds: usize) -> Estimated {
    if has_converged {
        return Ok(model);
    }
    Err(format!("no convergence in {rounds} rounds"))
}

/// The tracks of all runs.
pub(crate) fn read<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    runs: &[Run],
) -> Result<Vec<Track>, RehearseError> {
    let info = session.model.info();
    let mut all = Vec::new();
    for run in runs {
        let (own, _) = tracks(run, &info, &session.reading, &[])?;
        all.extend(own.into_iter().filter(|track| track.times.len() > 1));
    }
    Ok(all)
}

/// What is given to DIDIM.
#[derive(Clone, Debug)]
pub struct DidimSettings {
    /// Whether the reference motion is given to the estimator; otherwise it uses the log's
    /// commands.
    pub along: bool,
    /// The bandwidth of the simulated controllers, Hz; `None` for the robot's own controllers.
    pub bandwidth: Option<f64>,
    /// The time at the start of each log that is left out if the commands are the log's, s.
    pub settle: f64,
    /// The base parameters to start from, r.
    pub start: Vec<f64>,
}

impl DidimSettings {
    /// Identifies from the efforts of tracks.
    ///
    /// - `loads`: unknown gains and payloads, and what is carried in each track.
    pub(crate) fn estimate<M>(
        &self,
        session: &Session<'_, M>,
        all: &[Track],
        made: &Made<'_>,
        loads: Option<(&Plan, &[Option<usize>])>,
    ) -> Result<Estimated, RehearseError>
    where
        M: BaseModel<f64> + BaseModel<Number> + ?Sized + Sync,
    {
        let (model, start) = (session.model, self.start.as_slice());
        let controllers = match self.bandwidth {
            Some(bandwidth) => Controllers::Tuned {
                bandwidth,
                given: &[],
            },
            None => Controllers::Known {
                pid: &made.settings.pid,
                offset: &made.settings.offset,
            },
        };
        let motion = |t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
            made.motion.at(made.settle + t, q, qd, qdd);
        };
        // the simulated robot began with the motion, and its log later
        let known: KnownReference<'_> = (&motion, made.settle);
        let tracks = EffortTracks::new(model, all, self.along.then_some(known))?;
        let runs = tracks.runs(|_| controllers);
        let options = DidimOptions {
            least_squares: session.options,
            filtering: session.reading.filtering(),
            settle: if self.along { 0.0 } else { self.settle },
            ..DidimOptions::default()
        };
        if let Some((plan, carried)) = loads {
            let own = gain_options(session);
            let loads = LoadedLoops::new(model, &own, plan, carried, start);
            let loads = loads.map_err(DidimError::from)?;
            let found = didim_with_gains(model, model, &runs, &loads, &options)?;
            let rounds = found.norms.len();
            return Ok(converged(found.fit.model, found.converged, rounds));
        }
        let found = didim(model, model, &runs, &options, start)?;
        Ok(converged(
            found.model(session.confidence),
            found.converged,
            found.rounds,
        ))
    }
}

fn from_responses<M>(
    session: &Session<'_, M>,
    all: &[Track],
    made: &Made<'_>,
    window: f64,
    start: &[f64],
) -> Result<Estimated, RehearseError>
where
    M: BaseModel<f64> + BaseModel<Number> + ?Sized + Sync,
{
    let model = session.model;
    let info: Info<'_> = Model::<f64>::info(model);
    let settings = made.settings;
    let laws = settings.pid.iter().enumerate().map(|(k, pid)| Law {
        ki: Value::known(pid.ki),
        offset: Value::known(settings.offset.get(k).copied().unwrap_or(0.0)),
        limit: settings.drives.get(k).and_then(|drive| drive.limit),
        ..Law::pd(pid.kp, pid.kd)
    });
    let setup = Setup {
        window,
        friction_width: settings.friction_width,
        // the seeds already run in parallel
        threads: 1,
        ..Setup::new(laws.collect())
    };
    let mut runs = Vec::with_capacity(all.len());
    for track in all {
        runs.push(Response::of_track(track, &info)?);
    }
    let level = session.confidence;
    let found = fit_responses(model, model, &runs, &setup, start, level, &mut |_, _| {})?;
    Ok(converged(found.model, found.converged, found.steps))
}
