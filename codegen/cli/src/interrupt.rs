//! Ctrl-C, and the signals that end a program: remove a half-written file, and let a search end with
//! the best result so far.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError};

use crate::call;

/// The exit code of an interrupted program: 128 plus the signal's number.
pub(crate) const INTERRUPTED: u8 = 130;

/// The files that are being written, with the empty one that reserves a name, and folders of temporary
/// files.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());
/// Whether the command ends by itself after the first interrupt.
static ENDS_BY_ITSELF: AtomicBool = AtomicBool::new(false);
/// Whether the first interrupt has come.
static INTERRUPT_SEEN: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

fn unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Installs the handler: an interrupt removes a half-written file and ends the run as a failure.
pub(crate) fn listen() {
    // where no handler can be installed, the signal itself ends the run
    let _ = ctrlc::set_handler(|| {
        if ENDS_BY_ITSELF.load(Ordering::Relaxed) && !INTERRUPT_SEEN.swap(true, Ordering::Relaxed) {
            return;
        }
        // held until the process ends, so that nothing is created any more
        let unfinished = unfinished();
        for path in unfinished.iter() {
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

/// Creates a file or folder, which the handler removes from then on; it never comes in between.
pub(crate) fn creating<T>(path: &Path, create: impl FnOnce() -> io::Result<T>) -> io::Result<T> {
    let mut unfinished = unfinished();
    let made = create()?;
    unfinished.push(path.to_path_buf());
    Ok(made)
}

/// From now on the handler leaves this file or folder.
pub(crate) fn finish(path: &Path) {
    unfinished().retain(|own| own != path);
}
