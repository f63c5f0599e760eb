//! The native part of the Python package `regen-robotics`: evaluation of models over arrays of
//! states, and calls of the commands of `regen`. The package's Python files wrap both in its public
//! interface.

#![allow(
    clippy::needless_pass_by_value,
    reason = "pyo3 converts the arguments of Python to owned values"
)]

mod evaluate;
mod model;
mod supervise;

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::PathBuf;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use regen_cli::call;
use regen_identify::estimate::FactorSet;

use model::Derived;
use supervise::{NativeError, raised, supervised};

/// Runs a command of `regen` without holding the interpreter's lock.
///
/// - `words`: the command and its options; `texts`: texts read in place of files, by path;
/// - `progress`: called with the name of the current step, the number of parts done, and the number
///   of parts.
///
/// Returns what the command prints to the standard output, and its messages.
#[pyfunction]
#[pyo3(signature = (words, texts, progress=None))]
fn call_command(
    py: Python<'_>,
    words: Vec<OsString>,
    texts: BTreeMap<PathBuf, String>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(String, Vec<String>)> {
    let (result, notes) = supervised(py, progress, move |handle| call::run(&words, texts, handle))?;
    match result {
        Ok(printed) => Ok((printed, notes)),
        Err(error) => Err(raised(error, notes)),
    }
}

/// An option: name, whether it takes a value, whether it may be repeated, the words that it takes (none
/// where it takes others), and help.
type OptionRow = (String, bool, bool, Vec<String>, String);

/// The options of a command.
#[pyfunction]
fn options(command: &str) -> PyResult<Vec<OptionRow>> {
    let found = call::options(command)
        .ok_or_else(|| PyValueError::new_err(format!("there is no command '{command}'")))?;
    let rows = found
        .into_iter()
        .map(|o| (o.name, o.takes_value, o.is_repeated, o.values, o.help));
    Ok(rows.collect())
}

/// Merges the texts of factor files; the result does not depend on their order.
#[pyfunction]
fn merge_factors(py: Python<'_>, texts: Vec<String>) -> PyResult<String> {
    py.detach(|| {
        let sets: Result<Vec<FactorSet>, _> = texts
            .iter()
            .map(|text| FactorSet::from_text(text))
            .collect();
        let sets = sets.map_err(|error| format!("a text of factors {error}"))?;
        FactorSet::merged(sets)
            .map(|set| set.to_text())
            .map_err(|error| error.to_string())
    })
    .map_err(PyValueError::new_err)
}

/// The module `regen._native`.
#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Derived>()?;
    module.add("NativeError", module.py().get_type::<NativeError>())?;
    module.add_function(wrap_pyfunction!(call_command, module)?)?;
    module.add_function(wrap_pyfunction!(options, module)?)?;
    module.add_function(wrap_pyfunction!(merge_factors, module)?)?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))
}
