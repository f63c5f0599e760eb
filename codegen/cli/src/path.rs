//! The reference motion of a simulation or a view: from a trajectory file, or a gentle default.

use std::path::Path;

use regen_experiment::trajectory::{FourierReference, ReferenceError, Trajectory};
use regen_interpreted::Interpreted;

use crate::exit::Failure;
use crate::{load, mistakes};

/// Reads the trajectory of a file; without a file, a gentle motion about home.
pub(crate) fn of(
    file: Option<&Path>,
    model: &Interpreted<'_>,
) -> Result<FourierReference, Failure> {
    match file {
        Some(file) => read(file, model),
        None => Ok(FourierReference::gentle(model)?),
    }
}

/// Reads the trajectory of a file.
pub(crate) fn read(file: &Path, model: &Interpreted<'_>) -> Result<FourierReference, Failure> {
    let info = model.info();
    let source = load::file(file)?;
    let trajectory = Trajectory::parse(&source.text, &info);
    let series = trajectory
        .map_err(|why| mistakes::failure(source, why, "give what `regen excite` wrote"))?
        .series()
        .map_err(ReferenceError::from)?;
    let name = file.display().to_string();
    Ok(FourierReference::new(name, series, info.dof()))
}

impl From<ReferenceError> for Failure {
    fn from(error: ReferenceError) -> Self {
        Self::Input(error.to_string())
    }
}
