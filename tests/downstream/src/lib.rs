//! Where the tests of this package find the workspace, what cargo says of it, and where they build.
#![allow(clippy::unwrap_used, reason = "a tool of tests: what fails ends them")]

use std::path::{Path, PathBuf};
use std::process::Command;

/// The workspace.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The folder in which crates outside the workspace are built, given the `CARGO_TARGET_TMPDIR` of a
/// test. It is the one in which the crate `trybuild` builds, so that the macro is built once.
pub fn target_folder(temporary: &str) -> PathBuf {
    Path::new(temporary).join("../tests/trybuild")
}

/// The standard output of cargo in the workspace.
///
/// # Panics
/// When cargo fails.
#[track_caller]
pub fn cargo(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO"))
        .args(arguments)
        .current_dir(root())
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// A line for each crate that is built for a package, itself included, without dev-dependencies:
/// name, version, and where it is from.
///
/// - `flags`: further arguments, such as features.
#[track_caller]
pub fn tree(package: &str, flags: &[&str]) -> Vec<String> {
    let base = ["tree", "--locked", "--edges", "normal,build"];
    let form = ["--prefix", "none", "--format", "{p}", "--package", package];
    let lines = cargo(&[&base[..], &form, flags].concat());
    let lines = lines.lines().filter(|line| !line.is_empty());
    lines.map(str::to_owned).collect()
}
