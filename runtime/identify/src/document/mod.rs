//! Texts of files that people write: their parts with places, and what is wrong with them. It knows nothing of what
//! they mean.

mod mistakes;
mod tree;

pub use mistakes::{Mistake, Mistakes, Remedy};
pub(crate) use tree::{Key, Node, NodeKind, shorten};

/// Refuses pipes and devices, before they are opened: they may never end, and cannot be read twice. For
/// logs, and for every file that another one names.
///
/// # Errors
/// If the file is neither a regular one nor a folder, or does not exist.
///
/// ```
/// use regen_identify::files::require_regular;
///
/// assert!(require_regular(&std::env::temp_dir()).is_ok());
/// # #[cfg(unix)]
/// assert!(require_regular("/dev/null".as_ref()).is_err());
/// ```
pub fn require_regular(path: &std::path::Path) -> std::io::Result<()> {
    let found = std::fs::metadata(path)?;
    if found.is_file() || found.is_dir() {
        return Ok(());
    }
    Err(std::io::Error::other(
        "this is a pipe or a device, which can be read only once or never ends: save it as a file",
    ))
}
