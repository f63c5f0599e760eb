//! Ctrl-C: removes a half-written file, and lets a search end with the best result so far.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock, Mutex};

use crate::call;

/// The exit code of an interrupted program: 128 plus the signal's number.
pub(crate) const INTERRUPTED: u8 = 130;

/// The temporary file that is being written, or the folder of temporary files, or `None`.
static UNFINISHED: Mutex<Option<PathBuf>> = Mutex::new(None);
/// Whether the command ends by itself after the first interrupt.
static ENDS_BY_ITSELF: AtomicBool = AtomicBool::new(false);
/// Whether the first interrupt has come.
static INTERRUPT_SEEN: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// Installs the handler: an interrupt removes a half-written file and ends the run as a failure.
pub(crate) fn listen() {
    // where no handler can be installed, the signal itself ends the run
    let _ = ctrlc::set_handler(|| {
        if ENDS_BY_ITSELF.load(Ordering::Relaxed) && !INTERRUPT_SEEN.swap(true, Ordering::Relaxed) {
            return;
        }
        if let Ok(unfinished) = UNFINISHED.lock()
            && let Some(path) = unfinished.as_ref()
        {
            let _ = fs::remove_file(path).or_else(|_| fs::remove_dir_all(path));
        }
        std::process::exit(INTERRUPTED.into());
    });
}

/// From now on the first interrupt only sets the returned flag, and the caller ends by itself; the
/// second one ends the process. In a call from another program the flag is that of the call.
pub(crate) fn flag() -> Arc<AtomicBool> {
    call::flag().unwrap_or_else(|| {
        ENDS_BY_ITSELF.store(true, Ordering::Relaxed);
        INTERRUPT_SEEN.clone()
    })
}

/// Sets the temporary file or folder that the handler removes; `None` once it is complete.
pub(crate) fn set_unfinished(path: Option<&Path>) {
    if let Ok(mut unfinished) = UNFINISHED.lock() {
        *unfinished = path.map(Path::to_path_buf);
    }
}
