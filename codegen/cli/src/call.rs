//! Runs commands within the process of another program.
//!
//! ```
//! use std::collections::BTreeMap;
//! use regen_cli::call::{self, Handle};
//!
//! let pendulum = "name: pendulum\nlimbs:\n  - name: arm\n    joints:\n      \
//!                 - {name: q1, type: revolute, body: 1, actuated: true}\n";
//! let texts = BTreeMap::from([("pendulum.yaml".into(), pendulum.to_owned())]);
//! let words = ["info", "pendulum.yaml", "--format", "json"].map(Into::into);
//! let printed = call::run(&words, texts, &Handle::default())?;
//! assert!(printed.contains("\"dof\":1"));
//! # Ok::<(), call::CallError>(())
//! ```

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use clap::{ArgAction, CommandFactory as _};
use indicatif::ProgressBar;
use regen_codegen::diag::Source;
use regen_codegen::robot::Robot;

use crate::args::{Cli, PayloadArg, parse_words};
use crate::exit::Failure;
use crate::load;

/// The state that the caller and a running command share; it lets another thread stop the command.
#[derive(Clone, Debug, Default)]
pub struct Handle(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    stop: Arc<AtomicBool>,
    notes: Mutex<Vec<String>>,
    bar: Mutex<Option<ProgressBar>>,
}

/// The progress of a command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Progress {
    /// The current step, in words; may be empty.
    pub what: String,
    /// The number of finished parts.
    pub done: u64,
    /// The number of all parts; `None` if it is unknown.
    pub all: Option<u64>,
}

impl Handle {
    /// Ends the command at its next report of progress; [`run`] then returns an error of the kind
    /// [`CallErrorKind::Stopped`].
    pub fn stop(&self) {
        self.0.stop.store(true, Ordering::Relaxed);
    }

    /// Takes the messages and warnings that the command has written since the last call.
    pub fn take_notes(&self) -> Vec<String> {
        std::mem::take(&mut *lock(&self.0.notes))
    }

    /// The progress of the current step; `None` between long steps.
    pub fn progress(&self) -> Option<Progress> {
        let bar = lock(&self.0.bar).clone()?;
        (!bar.is_finished()).then(|| Progress {
            what: bar.message(),
            done: bar.position(),
            all: bar.length(),
        })
    }
}

/// Locks a mutex. A poisoned lock is ignored, since the values are consistent even after a panic.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The kinds of errors of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CallErrorKind {
    /// A check failed: a result is incomplete, or an error exceeds its bound.
    Check,
    /// Options that do not exist or contradict each other.
    Usage,
    /// Mistakes in a description, an experiment file or another file, with places.
    Description,
    /// Other input that is wrong: states, names, logs.
    Input,
    /// A state that cannot be closed or is singular, or parameters that the data leave undetermined.
    Numeric,
    /// A file that cannot be read or written.
    Io,
    /// The caller ended the call.
    Stopped,
}

pub use regen_serve::Mistake;

/// The error of a call.
#[derive(Clone, Debug, PartialEq)]
pub struct CallError {
    /// The kind of error.
    pub kind: CallErrorKind,
    /// The message; mistakes in files are shown with their lines and carets.
    pub message: String,
    /// The mistakes in files.
    pub mistakes: Vec<Mistake>,
    /// The text that the command printed before it failed; if only a check failed, this is the whole
    /// result.
    pub printed: String,
}

impl CallError {
    /// An error of a kind, without mistakes.
    pub fn new(kind: CallErrorKind, message: impl Into<String>) -> Self {
        Self {
            kind,
            message: message.into(),
            mistakes: Vec::new(),
            printed: String::new(),
        }
    }
}

impl fmt::Display for CallError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for CallError {}

impl From<regen_codegen::diag::Report> for CallError {
    fn from(report: regen_codegen::diag::Report) -> Self {
        Failure::from(report).into()
    }
}

impl From<Failure> for CallError {
    fn from(failure: Failure) -> Self {
        let kind = match &failure {
            Failure::Check(_) => CallErrorKind::Check,
            Failure::Usage(_) => CallErrorKind::Usage,
            Failure::Spec(_) => CallErrorKind::Description,
            Failure::Input(_) => CallErrorKind::Input,
            Failure::Numeric(_) => CallErrorKind::Numeric,
            Failure::Io(_) | Failure::BrokenPipe => CallErrorKind::Io,
            Failure::Interrupted(_) => CallErrorKind::Stopped,
        };
        let Failure::Spec(reports) = &failure else {
            return Self::new(kind, failure.to_string());
        };
        let texts: Vec<String> = reports.iter().map(|r| r.render(false)).collect();
        let mut error = Self::new(kind, texts.join("\n\n").trim_end());
        let places = reports.iter().flat_map(|report| {
            report.shown().map(|shown| Mistake {
                file: report.source.name.clone(),
                line: shown.line(),
                column: shown.column(),
                message: shown.diagnostic().headline(),
                hint: shown.diagnostic().hint.clone().unwrap_or_default(),
            })
        });
        error.mistakes = places.collect();
        error
    }
}

/// A call that this thread is running.
struct Running {
    shared: Arc<Shared>,
    texts: BTreeMap<PathBuf, String>,
    printed: String,
    /// The files that the command has written, if they are stored here and not on the disk.
    files: Option<BTreeMap<PathBuf, String>>,
}

thread_local! {
    static RUNNING: RefCell<Option<Running>> = const { RefCell::new(None) };
}

/// The panic payload with which a stopped call unwinds out of the command.
struct Stopped;

/// An option of a command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CommandOption {
    /// Its name, without dashes.
    pub name: String,
    /// Whether it takes a value.
    pub takes_value: bool,
    /// Whether it may be repeated.
    pub is_repeated: bool,
    /// The words that it takes; empty where it takes others.
    pub values: Vec<String>,
    /// Its help text.
    pub help: String,
}

/// The options of a command; `None` if there is no such command.
pub fn options(command: &str) -> Option<Vec<CommandOption>> {
    let all = Cli::command();
    let command = all.find_subcommand(command)?;
    let options = command.get_arguments().filter_map(|arg| {
        let action = arg.get_action();
        Some(CommandOption {
            name: arg.get_long()?.to_owned(),
            takes_value: action.takes_values(),
            is_repeated: matches!(action, ArgAction::Append),
            values: arg
                .get_possible_values()
                .iter()
                .filter(|value| action.takes_values() && !value.is_hide_set())
                .map(|value| value.get_name().to_owned())
                .collect(),
            help: arg.get_help().map(ToString::to_string).unwrap_or_default(),
        })
    });
    Some(options.collect())
}

/// Describes why a state is not closed.
pub fn reason(outcome: regen_runtime::Outcome) -> String {
    crate::closed::reason(outcome)
}

/// Derives a robot with all its functions.
///
/// - `payload`: whether the payloads of the description are carried; `None` for a description
///   without payloads.
///
/// # Errors
///
/// When the description has mistakes, or `payload` does not fit it.
pub fn derive(source: &Source, payload: Option<bool>, handle: &Handle) -> Result<Robot, CallError> {
    let payload = match payload {
        Some(true) => Some(PayloadArg::Carried),
        Some(false) => Some(PayloadArg::None),
        None => None,
    };
    load::use_cache();
    let (result, _) = as_call(BTreeMap::new(), None, handle, || {
        load::loaded_with_control(source, payload)
    });
    result
}

/// Runs a command and returns what it prints.
///
/// - `words`: the command and its options, as on a command line after `regen`;
/// - `texts`: texts that are read in place of the files with these paths.
///
/// # Errors
///
/// When the command fails or is stopped. Files that it has written by then are complete.
pub fn run(
    words: &[OsString],
    texts: BTreeMap<PathBuf, String>,
    handle: &Handle,
) -> Result<String, CallError> {
    run_with(words, texts, None, handle).0
}

/// As [`run`], but the texts that the command would write are returned, by path.
pub fn run_in_memory(
    words: &[OsString],
    texts: BTreeMap<PathBuf, String>,
    handle: &Handle,
) -> (Result<String, CallError>, BTreeMap<PathBuf, String>) {
    let (result, files) = run_with(words, texts, Some(BTreeMap::new()), handle);
    (result, files.unwrap_or_default())
}

type Files = Option<BTreeMap<PathBuf, String>>;

fn run_with(
    words: &[OsString],
    texts: BTreeMap<PathBuf, String>,
    files: Files,
    handle: &Handle,
) -> (Result<String, CallError>, Files) {
    let (result, after) = as_call(texts, files, handle, || crate::run(parse_words(words)?));
    let (printed, files) = after.map_or_else(Default::default, |call| (call.printed, call.files));
    match result {
        Ok(()) => (Ok(printed), files),
        Err(error) => (Err(CallError { printed, ..error }), files),
    }
}

/// Runs `work` in this thread as a call; also returns what was printed and written.
fn as_call<T>(
    texts: BTreeMap<PathBuf, String>,
    files: Files,
    handle: &Handle,
    work: impl FnOnce() -> Result<T, Failure>,
) -> (Result<T, CallError>, Option<Running>) {
    let running = Running {
        shared: handle.0.clone(),
        texts,
        printed: String::new(),
        files,
    };
    let before = RUNNING.replace(Some(running));
    let result = catch_unwind(AssertUnwindSafe(work));
    let after = RUNNING.replace(before);
    *lock(&handle.0.bar) = None;
    let result = match result {
        Ok(result) => result.map_err(CallError::from),
        Err(payload) if payload.is::<Stopped>() => {
            Err(CallError::new(CallErrorKind::Stopped, "stopped"))
        }
        Err(payload) => resume_unwind(payload),
    };
    (result, after)
}

/// Applies `run` to the call of this thread; `None` if the command runs from a command line.
fn in_running_call<T>(run: impl FnOnce(&mut Running) -> T) -> Option<T> {
    RUNNING.with_borrow_mut(|running| running.as_mut().map(run))
}

/// Unwinds out of a call that was stopped. Every report of progress, messages and results checks
/// this.
pub(crate) fn leave_if_stopped() {
    if in_running_call(|call| call.shared.stop.load(Ordering::Relaxed)) == Some(true) {
        resume_unwind(Box::new(Stopped));
    }
}

/// Adds to the printed text of a call; returns whether there is a call.
pub(crate) fn print(text: &str) -> bool {
    leave_if_stopped();
    in_running_call(|call| call.printed.push_str(text)).is_some()
}

/// Stores a text that would be written to a path; returns whether the call stores such texts.
pub(crate) fn store(path: &Path, text: &str) -> bool {
    let stored = in_running_call(|call| {
        let files = call.files.as_mut()?;
        files.insert(path.to_owned(), text.to_owned());
        Some(())
    });
    stored.flatten().is_some()
}

/// Adds a message of a call; returns whether there is a call.
pub(crate) fn note(text: &str) -> bool {
    leave_if_stopped();
    in_running_call(|call| lock(&call.shared.notes).push(text.to_owned())).is_some()
}

/// A progress bar that the caller can read; `None` without a call.
pub(crate) fn bar(length: Option<u64>) -> Option<ProgressBar> {
    leave_if_stopped();
    in_running_call(|call| {
        let bar = ProgressBar::hidden();
        if let Some(length) = length {
            bar.set_length(length);
        } else {
            bar.unset_length();
        }
        *lock(&call.shared.bar) = Some(bar.clone());
        bar
    })
}

/// The flag that stops a call.
pub(crate) fn flag() -> Option<Arc<AtomicBool>> {
    in_running_call(|call| call.shared.stop.clone())
}

/// The text that a call provides in place of a file.
pub(crate) fn text(path: &Path) -> Option<String> {
    in_running_call(|call| call.texts.get(path).cloned()).flatten()
}
