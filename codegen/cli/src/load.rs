//! From a file to a derived robot.

use std::fs;
use std::path::Path;

use regen_codegen::diag::Source;
use regen_codegen::pipeline::{self, BaseFrom, DeriveError};
use regen_codegen::robot::Robot;

use crate::exit::Failure;

/// Reads a text file.
pub(crate) fn text(path: &Path) -> Result<String, Failure> {
    let bytes = fs::read(path).map_err(|error| Failure::io("read", path, &error))?;
    String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        Failure::Input(format!(
            "{} is not UTF-8 text (byte {} is not)",
            path.display(),
            at + 1
        ))
    })
}

/// Reads a spec's text.
pub(crate) fn source(path: &Path) -> Result<Source, Failure> {
    Ok(Source {
        name: path.display().to_string(),
        text: text(path)?,
    })
}

/// Reads and derives one robot.
pub(crate) fn robot(path: &Path) -> Result<Robot, Failure> {
    derived(&source(path)?)
}

/// Derives one robot.
pub(crate) fn derived(source: &Source) -> Result<Robot, Failure> {
    pipeline::derive(source).map_err(|report| Failure::Spec(vec![report]))
}

/// Reads and derives one robot without its base parameters: quick for large ones too.
pub(crate) fn without_base(path: &Path) -> Result<Robot, Failure> {
    pipeline::derive_with(&source(path)?, BaseFrom::Nowhere).map_err(|error| match error {
        DeriveError::Spec(report) => Failure::Spec(vec![*report]),
        // nothing stored was asked for
        DeriveError::Store(_) | DeriveError::NotStored => {
            Failure::Input(format!("{}: stored base parameters", path.display()))
        }
    })
}
