//! Runs of the compiled binary.
#![allow(
    dead_code,
    unreachable_pub,
    reason = "each test binary uses a part of this"
)]
#![allow(clippy::unwrap_used, clippy::expect_used)]

pub mod driven;
pub mod logs;
pub mod shape;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use regen_report::documents::Document;
use serde_json::Value;

/// The results of a run.
pub struct Run {
    pub code: i32,
    pub out: String,
    pub err: String,
}

impl Run {
    /// Standard output as JSON.
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.out)
            .unwrap_or_else(|e| panic!("{e}\n{}\n{}", self.out, self.err))
    }

    /// Asserts that the run ended with the given exit code; the message contains all output of the
    /// run.
    #[track_caller]
    pub fn ended(self, code: i32) -> Self {
        assert_eq!(self.code, code, "out:\n{}\nerr:\n{}", self.out, self.err);
        self
    }
}

pub fn command(dir: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_regen"));
    command.current_dir(dir).args(args).env_remove("NO_COLOR");
    // What one test derives the others read; no test may depend on the user's cache.
    let derived = Path::new(env!("CARGO_TARGET_TMPDIR")).join("derived");
    command.env("REGEN_CACHE", derived);
    command
}

pub fn regen(dir: &Path, args: &[&str]) -> Run {
    regen_with(dir, args, "")
}

/// Runs `regen` with a text on standard input.
pub fn regen_with(dir: &Path, args: &[&str], input: &str) -> Run {
    let mut child = command(dir, args)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // A run that fails early does not read its input.
    let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
    let output = child.wait_with_output().unwrap();
    let run = Run {
        code: output.status.code().unwrap(),
        out: String::from_utf8(output.stdout).unwrap(),
        err: String::from_utf8(output.stderr).unwrap(),
    };
    if args.windows(2).any(|pair| pair == ["--format", "json"]) {
        assert_fits_schema(args, &run);
    }
    run
}

/// Asserts that JSON, where a run printed any, fits the schema of its command.
fn assert_fits_schema(args: &[&str], run: &Run) {
    let Ok(value) = serde_json::from_str::<Value>(&run.out) else {
        return;
    };
    let document = match args {
        ["excite", ..] if args.contains(&"--calibrate") => Document::Calibrate,
        _ => Document::of(args[0]).unwrap_or(Document::Model),
    };
    let schema = serde_json::from_str(document.schema()).unwrap();
    let misfits = shape::misfits(&schema, &value);
    assert!(misfits.is_empty(), "{args:?}: {misfits:#?}");
}

/// The repository's root.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .canonicalize()
        .unwrap()
}

/// The path of a file in `tests/fixtures/oracle`.
pub fn oracle(file: &str) -> String {
    root()
        .join("tests/fixtures/oracle")
        .join(file)
        .display()
        .to_string()
}

/// The path of a spec in `tests/fixtures/mechanisms`.
pub fn mechanism(file: &str) -> String {
    let dir = root().join("tests/fixtures/mechanisms");
    dir.join(file).display().to_string()
}

/// An empty directory for a test, outside the repository's workspace.
pub fn scratch(test: &str) -> PathBuf {
    let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join(test);
    if dir.exists() {
        fs::remove_dir_all(&dir).unwrap();
    }
    fs::create_dir_all(&dir).unwrap();
    dir
}

/// A workspace with the one-joint robots `names`, a marked list and no modules yet.
pub fn workspace(test: &str, names: &[&str]) -> PathBuf {
    let dir = scratch(test);
    fs::create_dir_all(dir.join("robots")).unwrap();
    fs::create_dir_all(dir.join("generated/src")).unwrap();
    let list = "//! Robots.\n// <regen modules>\n// </regen modules>\n";
    fs::write(dir.join("generated/src/lib.rs"), list).unwrap();
    for name in names {
        fs::write(dir.join(format!("robots/{name}.yaml")), pendulum(name)).unwrap();
    }
    dir
}

/// A robot of one joint, which is quick to derive.
pub fn pendulum(name: &str) -> String {
    format!(
        "name: {name}\nlimbs:\n  - name: arm\n    base: {{rpy: [-pi/2, 0, 0]}}\n    joints:\n      \
         - {{name: q1, type: revolute, body: 1, actuated: true}}\n"
    )
}
