//! Cross-validation: each log predicted from all others.

use std::path::PathBuf;

use regen_runtime::BaseModel;
use serde::Serialize;

use super::{Session, SessionError};
use crate::estimate::{EffortError, Estimate, FactorSet};
use crate::identify;

/// A log predicted from the others.
#[derive(Clone, Debug, Serialize)]
pub struct CrossValidation {
    /// The log's file.
    pub file: String,
    /// eps_RA in percent (Eq. 33).
    pub relative_absolute: f64,
    /// Effort by effort.
    pub efforts: Vec<EffortError>,
}

/// Each log predicted by least squares from all others.
///
/// # Errors
/// [`SessionError::OneLog`] for fewer than two; what keeps a log from being read.
pub fn cross<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    logs: &[PathBuf],
) -> Result<Vec<CrossValidation>, SessionError> {
    if logs.len() < 2 {
        return Err(SessionError::OneLog);
    }
    let (model, kind) = (session.model, session.kind);
    let one = |path: &PathBuf| session.open(std::slice::from_ref(path));
    // without Huber's weights a log's factor is all that is needed of it
    let mut sets = Vec::with_capacity(logs.len());
    for path in logs {
        sets.push(identify::observe(model, kind, &mut one(path)?)?.0);
    }
    let mut out = Vec::with_capacity(sets.len());
    for (k, path) in logs.iter().enumerate() {
        let values = if session.options.huber.is_some() {
            let others = logs.iter().enumerate().filter(|(j, _)| *j != k);
            let others: Vec<PathBuf> = others.map(|(_, path)| path.clone()).collect();
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
        let residuals = identify::residuals(model, kind, &mut one(path)?, &values, &means, 1)?;
        out.push(CrossValidation {
            file: path.display().to_string(),
            relative_absolute: residuals.relative_absolute(),
            efforts: residuals.efforts(),
        });
    }
    Ok(out)
}
