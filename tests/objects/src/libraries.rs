//! The object files to read: the image of all robots, and fixtures.

use std::path::{Path, PathBuf};
use std::process::Command;

/// The folder of the workspace.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A command of cargo whose release builds are those of a user's workspace: this one turns link-time
/// optimisation off, and optimises most of it for size. The macro, which these builds only run, is optimised less, since that builds in
/// less time and on all processors.
pub fn cargo(name: &str, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO"));
    command
        .arg(name)
        .args(arguments)
        .env("CARGO_PROFILE_RELEASE_LTO", "false")
        .env("CARGO_PROFILE_RELEASE_OPT_LEVEL", "3");
    for setting in ["opt-level=1", "codegen-units=16"] {
        let setting = format!("profile.release.package.regen-codegen.{setting}");
        command.args(["--config", &setting]);
    }
    command
}

/// Whether every robot is read (`.ci/full`), or only those whose source is checked in, for which no
/// macro is built.
pub fn full() -> bool {
    std::env::var_os("REGEN_FULL").is_some()
}

/// The features of `regen-image` with these robots, the closure and the control cycle.
pub fn features() -> &'static str {
    if full() {
        "derived,closure,control"
    } else {
        "robots,closure,control"
    }
}

/// Builds `regen-image` with some features, in release or in the profile that
/// `REGEN_IMAGE_PROFILE` names, and returns the libraries of it and of what it depends on.
pub fn image(features: &str) -> Vec<PathBuf> {
    let profile = std::env::var("REGEN_IMAGE_PROFILE").unwrap_or_else(|_| "release".to_owned());
    let output = cargo(
        "build",
        &["--package", "regen-image", "--features", features],
    )
    .args(["--message-format", "json-render-diagnostics", "--profile"])
    .arg(profile)
    .current_dir(env!("CARGO_MANIFEST_DIR"))
    .output()
    .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let text = String::from_utf8(output.stdout).unwrap();
    // the messages are JSON, in which file names are quoted strings; these need no escapes
    let libraries: Vec<PathBuf> = text
        .split('"')
        .map(PathBuf::from)
        .filter(|path| path.extension().is_some_and(|e| e == "rlib"))
        .collect();
    for part in [
        "regen_image",
        "regen_generated",
        "regen_robots",
        "regen_runtime",
        "regen_control",
        "libm",
    ] {
        let named = |path: &PathBuf| path.to_string_lossy().contains(part);
        assert!(
            libraries.iter().any(named),
            "no library of {part} in {text}"
        );
    }
    libraries
}

/// Compiles the text of one file, optimised, to a library in `dir`.
pub fn fixture(dir: &Path, name: &str, source: &str) -> PathBuf {
    let (file, library) = (
        dir.join(format!("{name}.rs")),
        dir.join(format!("lib{name}.rlib")),
    );
    std::fs::write(&file, source).unwrap();
    let output = Command::new(std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into()))
        .args(["--edition", "2024", "--crate-type", "rlib"])
        .args(["--crate-name", name, "-O", "-o"])
        .args([&library, &file])
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    library
}
