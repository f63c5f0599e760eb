//! Where the tests of this package find the workspace, and where they build.

use std::path::{Path, PathBuf};

/// The workspace.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The folder in which crates outside the workspace are built, given the `CARGO_TARGET_TMPDIR` of a
/// test. It is the one in which the crate `trybuild` builds, so that the macro is built once.
pub fn target_folder(temporary: &str) -> PathBuf {
    Path::new(temporary).join("../tests/trybuild")
}
