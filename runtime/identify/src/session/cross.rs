//! Cross-validation: predicts each log with the parameters identified from all others.

use regen_runtime::BaseModel;
use serde::Serialize;

use super::{Session, SessionError};
use crate::data::Run;
use crate::estimate::{EffortError, Estimate, FactorSet};
use crate::identify;

/// The errors of the prediction of one log with the parameters from all others.
#[derive(Clone, Debug, Serialize)]
pub struct CrossValidation {
    /// The log's file.
    pub file: String,
    /// eps_RA in percent (Eq. 33).
    pub relative_absolute: f64,
    /// The errors of each effort.
    pub efforts: Vec<EffortError>,
}

/// Predicts each log with the least-squares parameters of all others.
///
/// # Errors
/// [`SessionError::TooFewLogs`] for fewer than two logs; when a log cannot be read.
pub fn cross<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    logs: &[Run],
) -> Result<Vec<CrossValidation>, SessionError> {
    if logs.len() < 2 {
        return Err(SessionError::TooFewLogs);
    }
    let (model, kind) = (session.model, session.kind);
    let one = |run: &Run| session.open(std::slice::from_ref(run));
    // without Huber's weights, the QR factors of the logs suffice
    let mut sets = Vec::with_capacity(logs.len());
    for run in logs {
        sets.push(identify::observe(model, kind, &mut one(run)?)?.0);
    }
    let mut out = Vec::with_capacity(sets.len());
    for (k, run) in logs.iter().enumerate() {
        let values = if session.options.huber.is_some() {
            let others = logs.iter().enumerate().filter(|(j, _)| *j != k);
            let others: Vec<Run> = others.map(|(_, run)| run.clone()).collect();
            let mut others = session.open(&others)?;
            identify::identify(model, kind, &session.options, &mut others)?
                .estimate
                .values
        } else {
            let others = sets.iter().enumerate().filter(|(j, _)| *j != k);
            let merged = FactorSet::merged(others.map(|(_, set)| set.clone()).collect())?;
            Estimate::new(&merged, session.options.weighting)?.values
        };
        let means = sets.get(k).map(FactorSet::means).unwrap_or_default();
        let residuals = identify::residuals(model, kind, &mut one(run)?, &values, &means, 1)?;
        out.push(CrossValidation {
            file: run.to_string(),
            relative_absolute: residuals.relative_absolute(),
            efforts: residuals.efforts(),
        });
    }
    Ok(out)
}
