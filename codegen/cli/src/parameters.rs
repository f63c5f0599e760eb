//! Reads and writes files of identified parameters; every error names the file, and the line and column of
//! what is wrong in it.

use std::path::Path;

use regen_codegen::diag::Source;
use regen_identify::IdentifiedModel;
use regen_identify::files::{FileError, Format, Mistake, Mistakes, ParameterFile, Remedy, part_at};
use regen_interpreted::Interpreted;
use serde_json::Value;

use crate::exit::Failure;
use crate::{load, mistakes};

/// The text of a parameter file, in JSON or YAML by its name.
pub(crate) fn text(file: &ParameterFile, path: &Path) -> Result<String, Failure> {
    Format::of(path).text(file).map_err(|why| wrong(path, &why))
}

/// Parses a file, JSON or YAML by its name.
pub(crate) fn value(path: &Path) -> Result<Value, Failure> {
    parsed(&load::file(path)?, path)
}

fn parsed(source: &Source, path: &Path) -> Result<Value, Failure> {
    let value = Format::of(path).value(&source.text);
    value.map_err(|why| wrong(path, &why))
}

/// Reads the identified model of a parameter file.
pub(crate) fn read(path: &Path, model: &Interpreted<'_>) -> Result<IdentifiedModel, Failure> {
    let source = load::file(path)?;
    let found = IdentifiedModel::read(&parsed(&source, path)?, model);
    found.map_err(|why| match (why.at(&source.text), &why) {
        (Some(at), FileError::Content { place, why }) => at_place(source, at, place, why, None),
        (Some(at), _) => at_place(source, at, "", &why.to_string(), None),
        (None, _) => wrong(path, &why),
    })
}

/// The failure of a part of a file, at its line and column, with a remedy.
///
/// - `part`: the words that lead to it, such as `q1.kp`.
pub(crate) fn wrong_part(path: &Path, part: &str, why: &str, remedy: &str) -> Failure {
    let Ok(source) = load::file(path) else {
        return Failure::Input(format!("{}: {part}: {why}", path.display()));
    };
    match part_at(&source.text, part) {
        Some(at) => at_place(source, at, part, why, Some(remedy)),
        None => Failure::Input(format!("{}: {part}: {why}; {remedy}", path.display())),
    }
}

fn at_place(source: Source, at: usize, part: &str, why: &str, remedy: Option<&str>) -> Failure {
    let mistake = Mistake {
        at,
        path: part.to_owned(),
        message: why.to_owned(),
        remedy: remedy.map(|words| Remedy::Words(words.to_owned())),
    };
    mistakes::failure(source, Mistakes(vec![mistake]), "")
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
