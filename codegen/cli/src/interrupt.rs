//! Ctrl-C: nothing is left half written, and a search may end with the best so far.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// The exit code of a program that was interrupted: 128 and the signal's number.
const INTERRUPTED: i32 = 130;

/// The temporary file that is being written, if one is.
static UNFINISHED: Mutex<Option<PathBuf>> = Mutex::new(None);
/// Whether a run ends by itself when it is asked to.
static WINDS_DOWN: AtomicBool = AtomicBool::new(false);
/// Whether it was asked to.
static ASKED: AtomicBool = AtomicBool::new(false);

/// Lets an interrupt remove what was half written, and end the run as a failure.
pub(crate) fn listen() {
    // where there is no such handler, the run ends at the signal itself
    let _ = ctrlc::set_handler(|| {
        if WINDS_DOWN.load(Ordering::Relaxed) && !ASKED.swap(true, Ordering::Relaxed) {
            return;
        }
        if let Ok(unfinished) = UNFINISHED.lock()
            && let Some(path) = unfinished.as_ref()
        {
            let _ = fs::remove_file(path);
        }
        std::process::exit(INTERRUPTED);
    });
}

/// From now on the first interrupt only asks, through what is returned; the second one ends the
/// run.
pub(crate) fn asks() -> &'static AtomicBool {
    WINDS_DOWN.store(true, Ordering::Relaxed);
    &ASKED
}

/// Names the file that would be half written, or none.
pub(crate) fn unfinished(path: Option<&Path>) {
    if let Ok(mut unfinished) = UNFINISHED.lock() {
        *unfinished = path.map(Path::to_path_buf);
    }
}
