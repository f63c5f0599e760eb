//! Reads and writes files of identified parameters; every error names the file.

use std::path::Path;

use regen_identify::IdentifiedModel;
use regen_identify::files::{FileError, Format, ParameterFile};
use regen_interpreted::Interpreted;
use serde_json::Value;

use crate::exit::Failure;
use crate::load;

/// The text of a parameter file, in JSON or YAML by its name.
pub(crate) fn text(file: &ParameterFile, path: &Path) -> Result<String, Failure> {
    Format::of(path).text(file).map_err(|why| wrong(path, &why))
}

/// Parses a file, JSON or YAML by its name.
pub(crate) fn value(path: &Path) -> Result<Value, Failure> {
    let text = load::text(path)?;
    let value = Format::of(path).value(&text);
    value.map_err(|why| wrong(path, &why))
}

/// Reads the identified model of a parameter file.
pub(crate) fn read(path: &Path, model: &Interpreted<'_>) -> Result<IdentifiedModel, Failure> {
    IdentifiedModel::read(&value(path)?, model).map_err(|why| wrong(path, &why))
}

fn wrong(path: &Path, why: &FileError) -> Failure {
    Failure::Input(format!("{}: {why}", path.display()))
}

impl From<FileError> for Failure {
    fn from(error: FileError) -> Self {
        match error {
            FileError::ParameterLayout(error) => error.into(),
            other => Self::Input(other.to_string()),
        }
    }
}
