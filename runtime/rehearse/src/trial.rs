//! The trial of one seed: simulates logs, identifies from them, and predicts a fresh run with the
//! estimate.

use std::fs;

use regen_experiment::simulate::{LogColumns, Settings, Termination, simulate};
use regen_identify::data::Run;
use regen_identify::friction::JointFit;
use regen_identify::model::{IdentifiedModel, Interval};
use regen_identify::session::{OpenChoices, Session, Silent, chosen, compare};
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
    /// eps_RA on the fresh run, percent; `None` without such a run.
    pub(crate) error: Option<f64>,
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
    pub(crate) fn trial(&self, seed: u64, fresh: Option<&Run>) -> Result<Trial, RehearseError> {
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
        fresh: Option<&Run>,
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
        let error = match fresh {
            Some(fresh) => self.error_of(&session, fresh, &found)?,
            None => None,
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
            error,
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

    /// Simulates the fresh run, which the estimates predict, and returns it with the eps_RA of the
    /// true base parameters and friction, percent; `None` if it cannot be simulated or read to its end.
    pub(crate) fn fresh(&self, truth: &[f64]) -> Result<Option<(Run, f64)>, RehearseError> {
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
        match self.error_of(&self.session(), &run, &true_model) {
            Ok(error) => Ok(error.map(|error| (run, error))),
            Err(why) if why.is_of_one_seed() => Ok(None),
            Err(why) => Err(why),
        }
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

    /// The eps_RA of a model on the fresh run, percent; `None` if it is not defined.
    fn error_of(
        &self,
        session: &Session<'_, M>,
        run: &Run,
        model: &IdentifiedModel,
    ) -> Result<Option<f64>, RehearseError> {
        if let Some(loads) = &self.loads {
            return loads.error(session, run, self.durations.len(), model);
        }
        let errors = compare(
            session,
            None,
            (std::slice::from_ref(run), &[]),
            std::slice::from_ref(model),
        )?;
        let error = errors.first().and_then(|logs| logs.first());
        Ok(error
            .map(|log| log.relative_absolute)
            .filter(|error| error.is_finite()))
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
