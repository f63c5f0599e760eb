//! The trial of one seed: simulates logs, identifies from them, and predicts a fresh run with the
//! estimate.

use std::fs;

use regen_experiment::simulate::{LogColumns, Settings, Termination, simulate};
use regen_identify::data::Run;
use regen_identify::friction::JointFit;
use regen_identify::model::{IdentifiedModel, Interval};
use regen_identify::session::{LogError, OpenChoices, Session, Silent, chosen, compare};
use regen_response::Number;
use regen_runtime::{BaseModel, Model};

use crate::error::RehearseError;
use crate::estimate::{Estimator, Made, estimate};
use crate::friction;
use crate::loads::Loads;
use crate::seeds::Rehearsal;

/// The estimate of a seed.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    /// The base parameters, r, then nonlinear friction, then gains and payloads.
    pub(crate) values: Vec<f64>,
    /// Their intervals; `None` where the data do not determine a value.
    pub(crate) intervals: Vec<Option<Interval>>,
    /// eps_RA on the fresh run, percent: of the estimate, and of the true parameters, which read the
    /// run alike; `None` without such a run.
    pub(crate) errors: Option<[f64; 2]>,
}

/// A run that is not used for identification, and the model that simulated it.
pub(crate) struct FreshRun {
    pub(crate) run: Run,
    pub(crate) true_model: IdentifiedModel,
}

/// The result of a seed: an estimate, or the reason why there is none, in words.
#[derive(Clone, Debug)]
pub(crate) struct Trial {
    pub(crate) seed: u64,
    pub(crate) outcome: Result<Fit, String>,
}

impl<M> Rehearsal<'_, M>
where
    M: BaseModel<f64> + BaseModel<Number> + ?Sized + Sync,
{
    /// Simulates and identifies one seed; failures that belong to the seed are part of the result.
    ///
    /// - `fresh`: a run that is not used for identification; the estimate predicts it.
    pub(crate) fn trial(
        &self,
        seed: u64,
        fresh: Option<&FreshRun>,
    ) -> Result<Trial, RehearseError> {
        let mut files = Vec::new();
        let outcome = self.outcome(seed, fresh, &mut files);
        self.tidy(&files);
        let outcome = match outcome {
            Err(why) if why.is_of_one_seed() => Err(why.to_string()),
            other => other?,
        };
        Ok(Trial { seed, outcome })
    }

    fn outcome(
        &self,
        seed: u64,
        fresh: Option<&FreshRun>,
        runs: &mut Vec<Run>,
    ) -> Result<Result<Fit, String>, RehearseError> {
        for (number, duration) in self.durations.iter().enumerate() {
            let name = format!("seed{seed}-run{}.csv", number + 1);
            match self.log(seed, number, *duration, &name)? {
                Ok(run) => runs.push(run),
                Err(why) => return Ok(Err(why)),
            }
        }
        let made = Made {
            motion: self.motion,
            settle: self.settle,
            settings: &self.twin.settings,
        };
        let mut session = self.session();
        // another motion does not repeat itself as this one does
        let mut of_other_motions = None;
        if self.chooses_filter && self.estimator.reads_motion() {
            let open = OpenChoices {
                delays: session.reading.delays.is_empty() && !self.finds_delays,
                loss: self.estimator.has_open_loss(),
                series: self.loads.is_none(),
            };
            if let Some(choice) = chosen(&session, runs, open)? {
                *runs = choice.runs(runs);
                of_other_motions = Some(choice.without_series());
                session.reading = choice.applied(&session.reading);
                session.options.huber = session.options.huber.or(choice.huber());
            }
        }
        let found = match &self.loads {
            Some(loads) => loads.estimate(&session, runs, &self.estimator, &made)?,
            None => estimate(
                &self.estimator,
                &mut session,
                runs,
                &made,
                self.finds_delays,
            )?,
        };
        let found = match found {
            Ok(found) => found,
            Err(why) => return Ok(Err(why)),
        };
        if let Some(choice) = of_other_motions {
            session.reading.method = choice.method();
            if session.reading.decimation == 1 {
                session.reading.decimation = choice.equation_decimation();
            }
        }
        let errors = match fresh.map(|fresh| self.errors(&session, fresh, &found)) {
            // the estimate is scored without them
            Some(Err(why)) if !why.is_of_one_seed() => return Err(why),
            errors => errors.and_then(Result::ok).flatten(),
        };
        let friction = friction::estimated(&self.sought_friction(), &found);
        let loads = self.loads.as_ref().map(|loads| loads.found(&found));
        let (mut values, mut intervals) = (found.beta, found.intervals.base);
        intervals.resize(values.len(), None);
        for (own, of_own) in core::iter::once(friction).chain(loads) {
            values.extend(own);
            intervals.extend(of_own);
        }
        Ok(Ok(Fit {
            values,
            intervals,
            errors,
        }))
    }

    /// The true parameters, with the known values of payloads.
    pub(crate) fn parameters(&self) -> Vec<f64> {
        let parameters = &self.twin.parameters;
        match &self.loads {
            Some(loads) => loads.known(&Model::<f64>::info(self.model), parameters),
            None => parameters.clone(),
        }
    }

    /// The nonlinear friction of the simulated robot.
    fn true_friction(&self) -> Vec<JointFit> {
        let info = Model::<f64>::info(self.model);
        friction::true_friction(&info, &self.twin.settings.friction)
    }

    /// The nonlinear friction that the estimator identifies, with its true values.
    pub(crate) fn sought_friction(&self) -> Vec<JointFit> {
        match self.estimator {
            Estimator::Physical { friction: true, .. } => self.true_friction(),
            _ => Vec::new(),
        }
    }

    /// Simulates the fresh run, which the estimates predict; `None` if it ended early.
    pub(crate) fn fresh(&self, truth: &[f64]) -> Result<Option<FreshRun>, RehearseError> {
        let longest = self.durations.iter().fold(0.0, |a: f64, b| a.max(*b));
        let number = self.durations.len();
        let Ok(run) = self.log(self.first, number, longest, "fresh.csv")? else {
            return Ok(None);
        };
        let mut true_model = match &self.loads {
            Some(loads) => loads.true_model(truth),
            None => IdentifiedModel {
                beta: truth.to_vec(),
                ..IdentifiedModel::default()
            },
        };
        true_model.friction = self.true_friction();
        Ok(Some(FreshRun { run, true_model }))
    }

    /// Removes the files of logs, unless the user asked to keep them.
    pub(crate) fn tidy(&self, runs: &[Run]) {
        if self.keep {
            return;
        }
        for file in runs.iter().flat_map(|run| &run.files) {
            // a log that cannot be removed does not affect the result
            let _ = fs::remove_file(file);
        }
    }

    /// The eps_RA of an estimate and of the true parameters on the fresh run, percent; `None` if one
    /// is not defined.
    fn errors(
        &self,
        session: &Session<'_, M>,
        fresh: &FreshRun,
        estimate: &IdentifiedModel,
    ) -> Result<Option<[f64; 2]>, RehearseError> {
        let models = [estimate, &fresh.true_model];
        let errors: Vec<f64> = if let Some(loads) = &self.loads {
            let number = self.durations.len();
            let error = |model| loads.error(session, &fresh.run, number, model);
            models.into_iter().map(error).collect::<Result<_, _>>()?
        } else {
            let run = std::slice::from_ref(&fresh.run);
            let errors = compare(session, None, (run, &[]), &models.map(Clone::clone))?;
            let of_model = |logs: &Vec<LogError>| Some(logs.first()?.relative_absolute);
            errors.iter().filter_map(of_model).collect()
        };
        let errors = <[f64; 2]>::try_from(errors).ok();
        Ok(errors.filter(|errors| errors.iter().all(|error| error.is_finite())))
    }

    fn session(&self) -> Session<'_, M> {
        let mut reading = self.reading.clone();
        let currents = self.loads.iter().flat_map(Loads::columns);
        reading.columns.extend(currents);
        Session {
            model: self.model,
            reading,
            kind: self.kind,
            options: self.options,
            confidence: self.confidence,
            watch: &Silent,
        }
    }

    /// Simulates a run and writes its log; the inner error says why the run ended early.
    fn log(
        &self,
        seed: u64,
        number: usize,
        duration: f64,
        name: &str,
    ) -> Result<Result<Run, String>, RehearseError> {
        let info = Model::<f64>::info(self.model);
        let settings = Settings {
            energies: false,
            ..self.twin.run(seed, number, self.settle + duration)
        };
        let mut parameters = self.parameters();
        if let Some(loads) = &self.loads {
            parameters = loads.carrying(&info, &parameters, number);
        }
        let log = simulate(self.model, &parameters, self.motion, &settings)?;
        if log.ended != Termination::Complete {
            let at = log.t.last().copied().unwrap_or(0.0);
            let text = format!("the simulated run ended after {at} s: {}", log.ended);
            return Ok(Err(text));
        }
        let text = log.csv(&info, &settings, self.settle, LogColumns::Commanded);
        let file = self.folder.join(name);
        fs::write(&file, text).map_err(|why| RehearseError::Io {
            file: file.display().to_string(),
            why,
        })?;
        Ok(Ok(file.into()))
    }
}
