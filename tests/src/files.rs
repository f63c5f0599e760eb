//! The folders of the spec files.

use std::path::{Path, PathBuf};

use crate::reference::Mechanism;

/// The folder of this package.
pub fn package() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The folder of the robots that are shipped.
pub fn robots() -> PathBuf {
    package().join("../robots")
}

/// The folder of the input files of tests: mechanisms, files from other programs, and numbers that
/// other programs computed.
pub fn fixtures() -> PathBuf {
    package().join("fixtures")
}

/// The folder of the mechanisms for the harder checks.
pub fn mechanisms() -> PathBuf {
    fixtures().join("mechanisms")
}

/// The folder of the published vectors and their specs.
pub fn oracle() -> PathBuf {
    fixtures().join("oracle")
}

/// The folder of mechanisms with several specs: one folder per mechanism, whose files cut it at
/// different joints.
pub fn pairs() -> PathBuf {
    fixtures().join("pairs")
}

/// The files of a folder with an extension, by name.
///
/// # Errors
/// When the folder cannot be read or contains none.
pub fn list(folder: &Path, extension: &str) -> Result<Vec<PathBuf>, String> {
    let entries = std::fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut files: Vec<PathBuf> = entries
        .filter_map(Result::ok)
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|e| e == extension))
        .collect();
    files.sort();
    if files.is_empty() {
        return Err(format!("{}: no *.{extension}", folder.display()));
    }
    Ok(files)
}

/// The folders within a folder, by name.
///
/// # Errors
/// When the folder cannot be read or contains none.
pub fn folders(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let entries = std::fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut found: Vec<PathBuf> = entries
        .filter_map(Result::ok)
        .map(|entry| entry.path())
        .filter(|path| path.is_dir())
        .collect();
    found.sort();
    if found.is_empty() {
        return Err(format!("{}: no folders", folder.display()));
    }
    Ok(found)
}

/// Reads a mechanism from a spec file.
///
/// # Errors
/// When the file cannot be read or is not a spec; the message names the file.
pub fn mechanism(path: &Path) -> Result<Mechanism, String> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    Mechanism::from_yaml(&text).map_err(|e| format!("{}: {e}", path.display()))
}
