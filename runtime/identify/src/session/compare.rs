//! Compares models on logs, as in the chapter's Table 4.

use regen_runtime::BaseModel;
use serde::Serialize;

use super::{Session, SessionError};
use crate::data::Run;
use crate::estimate::Residuals;
use crate::identify;
use crate::model::IdentifiedModel;

/// The error of a model on one log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LogError {
    /// The log's file.
    pub log: String,
    /// eps_RA in percent (Eq. 33).
    pub relative_absolute: f64,
}

/// Computes eps_RA of each model on each log; returns a list for each model.
///
/// # Errors
/// When a log cannot be read or predicted.
pub fn compare<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    logs: &[Run],
    models: &[IdentifiedModel],
) -> Result<Vec<Vec<LogError>>, SessionError> {
    let mut out = vec![Vec::with_capacity(logs.len()); models.len()];
    for run in logs {
        let mut log = session.open(std::slice::from_ref(run))?;
        let means = identify::observe(session.model, session.kind, &mut log)?
            .0
            .means();
        for (one, row) in models.iter().zip(&mut out) {
            let residuals = one.residuals(session.model, session.kind, &mut log, &means, 1)?;
            row.push(LogError {
                log: run.to_string(),
                relative_absolute: residuals.relative_absolute(),
            });
        }
    }
    Ok(out)
}

/// Computes the residuals' statistics of a model on all logs together, with `lags`
/// autocorrelations.
///
/// # Errors
/// When a log cannot be read or predicted.
pub fn residuals_of<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    logs: &[Run],
    model: &IdentifiedModel,
    lags: usize,
) -> Result<Residuals, SessionError> {
    let mut log = session.open(logs)?;
    let means = identify::observe(session.model, session.kind, &mut log)?
        .0
        .means();
    Ok(model.residuals(session.model, session.kind, &mut log, &means, lags)?)
}
