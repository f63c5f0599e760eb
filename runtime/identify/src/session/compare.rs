//! Compares models on logs, as in the chapter's Table 4.

use regen_runtime::BaseModel;
use serde::Serialize;

use super::{LeastSquaresStart, MonitoredLogs, Session, SessionError};
use crate::data::{Assignment, Run};
use crate::estimate::{Estimate, Residuals};
use crate::identify::{self, EquationBuilder, EquationKind};
use crate::model::IdentifiedModel;

/// The error of a model on one log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LogError {
    /// The log's file.
    pub log: String,
    /// eps_RA in percent (Eq. 33).
    pub relative_absolute: f64,
    /// A log that was identified from and has rows of this one, which is another one, and the part of its rows.
    #[serde(skip)]
    pub repeats: Option<(String, f64)>,
}

/// Computes eps_RA of each model on each log; returns a list for each model.
///
/// - `start`: the one that was identified from `logs`, if it is at hand;
/// - `against`: further logs.
///
/// # Errors
/// When a log cannot be read or predicted.
pub fn compare<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    start: Option<&LeastSquaresStart>,
    (logs, against): (&[Run], &[Run]),
    models: &[IdentifiedModel],
) -> Result<Vec<Vec<LogError>>, SessionError> {
    let mut out = vec![Vec::with_capacity(logs.len() + against.len()); models.len()];
    for (place, run) in logs.iter().chain(against).enumerate() {
        // the equations that are stored are those of all logs together
        let stored = logs.len() == 1 && out.iter().all(Vec::is_empty);
        let mut read = None;
        let mut repeats = None;
        for (one, row) in models.iter().zip(&mut out) {
            let known = start.filter(|_| stored);
            let known = known.and_then(|start| stored_residuals(session, start, one, 1));
            let residuals = if let Some(residuals) = known {
                residuals?
            } else {
                let log = match read.take() {
                    Some(log) => log,
                    None => observed(session, std::slice::from_ref(run))?,
                };
                let (log, means) = read.insert(log);
                if let (Some(start), [own], true) =
                    (start, log.logs().reports(), place >= logs.len())
                {
                    repeats = own.repeated_of(&start.reports);
                }
                one.residuals(session.model, session.kind, log, means, 1)?
            };
            row.push(LogError {
                log: run.to_string(),
                relative_absolute: residuals.relative_absolute(),
                repeats: repeats.clone(),
            });
        }
    }
    Ok(out)
}

/// Computes the residuals' statistics of a model on all logs that `start` was identified from
/// together, with `lags` autocorrelations.
///
/// # Errors
/// When a log cannot be read or predicted.
pub fn residuals_of<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    start: &LeastSquaresStart,
    logs: &[Run],
    model: &IdentifiedModel,
    lags: usize,
) -> Result<Residuals, SessionError> {
    if let Some(found) = stored_residuals(session, start, model, lags) {
        return found;
    }
    let (mut log, means) = observed(session, logs)?;
    Ok(model.residuals(session.model, session.kind, &mut log, &means, lags)?)
}

/// Fits one log by least squares with some of its columns read in another way, and returns for each effort the rms of
/// the residuals over its own about its mean, percent, with its name.
///
/// - `columns`: assignments that take the place of those of the session.
///
/// # Errors
/// When the log cannot be read so, or does not determine the parameters.
pub fn errors_with_columns<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    run: &Run,
    columns: &[Assignment],
) -> Result<Vec<(String, f64)>, SessionError> {
    let mut reading = session.reading.clone();
    reading.columns.splice(..0, columns.iter().cloned());
    let session = session.with_reading(reading);
    let mut log = session.open(std::slice::from_ref(run))?;
    let (set, _) = identify::observe(session.model, session.kind, &mut log)?;
    let values = Estimate::new(&set, session.options.weighting)?.values;
    let errors = set.relative_errors(&values)?;
    Ok(set.efforts.into_iter().zip(errors).collect())
}

/// Opens runs, and reads the means of their efforts.
fn observed<'a, M: BaseModel<f64> + ?Sized>(
    session: &Session<'a, M>,
    runs: &[Run],
) -> Result<(MonitoredLogs<'a, M>, Vec<f64>), SessionError> {
    let mut log = session.open(runs)?;
    let means = identify::observe(session.model, session.kind, &mut log)?
        .0
        .means();
    Ok((log, means))
}

/// The residuals' statistics of a model on the equations that `start` has stored; `None` if it has
/// stored none that the model predicts.
fn stored_residuals<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    start: &LeastSquaresStart,
    model: &IdentifiedModel,
    lags: usize,
) -> Option<Result<Residuals, SessionError>> {
    let efforts = EquationBuilder::new(session.model, session.kind)
        .origin()
        .efforts;
    let found = match (&start.data, &start.equations) {
        (Some(data), _) if session.kind == EquationKind::Forces => {
            data.residuals(&efforts, &model.beta, &model.friction, lags)
        }
        (None, Some(equations)) if model.friction.is_empty() => {
            equations.residuals(&efforts, &model.beta, lags)
        }
        _ => return None,
    };
    Some(found.map_err(SessionError::from))
}
