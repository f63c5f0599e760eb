//! Runs long work without blocking the interpreter: the work has a thread of its own, and the
//! calling thread handles signals and reports progress until it ends.

use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use pyo3::exceptions::{PyException, PyRuntimeError};
use pyo3::prelude::*;
use regen_cli::call::{CallError, CallErrorKind, Handle};

pyo3::create_exception!(
    _native,
    NativeError,
    PyException,
    "kind, message, mistakes as (file, line, column, message, hint), what was printed, messages"
);

/// The time between checks of signals and progress.
const POLL_INTERVAL: Duration = Duration::from_millis(50);
/// The stack of the working thread, large enough for deeply nested descriptions.
const STACK_BYTES: usize = 64 << 20;

/// Runs `work` in a thread of its own and returns its result with its messages. An exception of a
/// signal handler or of `progress` stops the work at its next report and is raised at once.
pub(crate) fn supervised<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Handle) -> T + Send + 'static,
) -> PyResult<(T, Vec<String>)> {
    let handle = Handle::default();
    let (sender, mut receiver) = mpsc::channel();
    let own = handle.clone();
    thread::Builder::new()
        .stack_size(STACK_BYTES)
        .spawn(move || {
            // if the caller was interrupted, nothing receives the result
            let _ = sender.send(work(&own));
        })
        .map_err(|error| PyRuntimeError::new_err(format!("no thread could be started: {error}")))?;
    loop {
        let result;
        (receiver, result) = py.detach(move || {
            let result = receiver.recv_timeout(POLL_INTERVAL);
            (receiver, result)
        });
        match result {
            Ok(result) => return Ok((result, handle.take_notes())),
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err(
                    "regen ended unexpectedly: this is a defect of regen, please report it",
                ));
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
        let checked = py.check_signals().and_then(|()| report(progress, &handle));
        if let Err(error) = checked {
            handle.stop();
            return Err(error);
        }
    }
}

/// Calls `progress` with the state of the work.
fn report(progress: Option<&Bound<'_, PyAny>>, handle: &Handle) -> PyResult<()> {
    if let (Some(progress), Some(now)) = (progress, handle.progress()) {
        progress.call1((now.what, now.done, now.all))?;
    }
    Ok(())
}

/// An error of a call as an exception, which the Python part turns into its own types.
pub(crate) fn raised(error: CallError, notes: Vec<String>) -> PyErr {
    let kind = match error.kind {
        CallErrorKind::Check => "check",
        CallErrorKind::Usage => "usage",
        CallErrorKind::Description => "description",
        CallErrorKind::Input => "input",
        CallErrorKind::Numeric => "numeric",
        CallErrorKind::Io => "io",
        CallErrorKind::Stopped => "stopped",
    };
    let mistakes: Vec<(String, usize, usize, String, String)> = error
        .mistakes
        .into_iter()
        .map(|m| (m.file, m.line, m.column, m.message, m.hint))
        .collect();
    NativeError::new_err((kind, error.message, mistakes, error.printed, notes))
}
