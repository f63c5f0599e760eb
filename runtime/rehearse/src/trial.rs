//! One seed: simulated logs, the estimate from them, and its prediction of a fresh run.

use std::fs;

use regen_experiment::simulate::{LogColumns, Termination, simulate};
use regen_identify::data::Run;
use regen_identify::model::{IdentifiedModel, Interval};
use regen_identify::session::{Session, Silent, compare};
use regen_response::Number;
use regen_runtime::{BaseModel, Model};

use crate::error::RehearseError;
use crate::estimate::{Made, estimate};
use crate::seeds::Rehearsal;

/// The estimate of a seed.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    /// The base parameters, r.
    pub(crate) values: Vec<f64>,
    /// Their intervals; `None` where the data do not determine a value.
    pub(crate) intervals: Vec<Option<Interval>>,
    /// eps_RA on a fresh run, percent: of the estimate, and of the true parameters.
    pub(crate) errors: [f64; 2],
}

/// What came of a seed: an estimate, or why there is none, in words.
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
    pub(crate) fn trial(&self, seed: u64, truth: &[f64]) -> Result<Trial, RehearseError> {
        let mut files = Vec::new();
        let outcome = self.outcome(seed, truth, &mut files);
        if !self.keep {
            for file in files.iter().flat_map(|run: &Run| &run.files) {
                // the folder goes too; what cannot be removed does no harm to the result
                let _ = fs::remove_file(file);
            }
        }
        let outcome = match outcome {
            Err(why) if why.is_of_one_seed() => Err(why.to_string()),
            other => other?,
        };
        Ok(Trial { seed, outcome })
    }

    fn outcome(
        &self,
        seed: u64,
        truth: &[f64],
        files: &mut Vec<Run>,
    ) -> Result<Result<Fit, String>, RehearseError> {
        let mut session = Session {
            model: self.model,
            reading: self.reading.clone(),
            kind: self.kind,
            options: self.options,
            confidence: self.confidence,
            watch: &Silent,
        };
        // the last one is not identified from
        let fresh = self.durations.iter().max_by(|a, b| a.total_cmp(b)).copied();
        for (number, duration) in self.durations.iter().copied().chain(fresh).enumerate() {
            if let Err(why) = self.log(seed, number, duration, files)? {
                return Ok(Err(why));
            }
        }
        let (fresh, runs) = match files.split_last() {
            Some((fresh, runs)) if !runs.is_empty() => (fresh.clone(), runs),
            _ => {
                return Err(RehearseError::Setting(
                    "durations",
                    "must have one at least",
                ));
            }
        };
        let made = Made {
            motion: self.motion,
            settle: self.settle,
            settings: &self.twin.settings,
        };
        let found = estimate(
            &self.estimator,
            &mut session,
            runs,
            &made,
            self.finds_delays,
        )?;
        let found = match found {
            Ok(found) => found,
            Err(why) => return Ok(Err(why)),
        };
        let true_model = IdentifiedModel {
            beta: truth.to_vec(),
            ..IdentifiedModel::default()
        };
        let models = [found, true_model];
        let errors = compare(&session, &[fresh], &models)?;
        let error = |k: usize| {
            let log = errors.get(k).and_then(|logs| logs.first());
            log.map_or(f64::NAN, |log| log.relative_absolute)
        };
        let errors = [error(0), error(1)];
        let [found, _] = models;
        let mut intervals = found.intervals.base;
        intervals.resize(found.beta.len(), None);
        Ok(Ok(Fit {
            values: found.beta,
            intervals,
            errors,
        }))
    }

    /// Simulates a run and writes its log; the inner error says why the run ended early.
    fn log(
        &self,
        seed: u64,
        number: usize,
        duration: f64,
        files: &mut Vec<Run>,
    ) -> Result<Result<(), String>, RehearseError> {
        let info = Model::<f64>::info(self.model);
        let settings = self.twin.run(seed, number, self.settle + duration);
        let log = simulate(self.model, &self.twin.parameters, self.motion, &settings)?;
        if log.ended != Termination::Complete {
            let at = log.t.last().copied().unwrap_or(0.0);
            let text = format!("the simulated run ended after {at} s: {}", log.ended);
            return Ok(Err(text));
        }
        let text = log.csv(&info, &settings, self.settle, LogColumns::Commanded);
        let file = self
            .folder
            .join(format!("seed{seed}-run{}.csv", number + 1));
        fs::write(&file, text).map_err(|why| RehearseError::Io {
            file: file.display().to_string(),
            why,
        })?;
        files.push(file.into());
        Ok(Ok(()))
    }
}
