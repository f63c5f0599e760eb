//! The programs of tests of a copy: building them, their parts, and running one with a fault.

use std::collections::{BTreeMap, BTreeSet};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::{Mutex, OnceLock};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::TextResult;

/// The tests of one module at the top of a test program.
pub struct Program {
    path: PathBuf,
    /// The folder of its package.
    folder: PathBuf,
    module: String,
    tests: Vec<String>,
    /// The packages of the workspace that it links.
    links: BTreeSet<String>,
    /// The time of a run without faults.
    pub takes: Duration,
    /// Held while it runs: two runs at once would write the same files.
    alone: Mutex<()>,
    /// Whether it passes without any fault, once that is known.
    pub passes: OnceLock<bool>,
}

pub enum TestOutcome {
    Passed,
    Failed,
    Hung,
}

/// Builds the tests of some packages of the copy, as far as they compile. The output is JSON.
pub fn build(copy: &Path, packages: &[&str]) -> TextResult<Output> {
    Command::new("cargo")
        .args(["build", "--profile", &crate::profile()])
        .args(["--tests", "--keep-going", "--message-format=json"])
        .args(packages.iter().flat_map(|name| ["-p", name]))
        .current_dir(copy)
        .stderr(Stdio::inherit())
        .output()
        .map_err(|e| e.to_string())
}

/// Builds the tests of some packages and lists them, those of one module together.
pub fn programs(copy: &Path, packages: &[&str]) -> TextResult<Vec<Program>> {
    let output = build(copy, packages)?;
    if !output.status.success() {
        return Err("the tests do not build".into());
    }
    let links = links(copy)?;
    let mut programs = Vec::new();
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        let Ok(message) = serde_json::from_str::<Value>(line) else {
            continue;
        };
        let (path, manifest) = (
            message["executable"].as_str(),
            message["manifest_path"].as_str(),
        );
        let (Some(path), Some(manifest)) = (path, manifest) else {
            continue;
        };
        if message["profile"]["test"] != true {
            continue;
        }
        let folder = Path::new(manifest).parent().unwrap_or(copy);
        for (module, tests) in modules(Path::new(path), folder)? {
            programs.push(Program {
                path: path.into(),
                folder: folder.to_owned(),
                module,
                tests,
                links: links.get(manifest).cloned().unwrap_or_default(),
                takes: Duration::ZERO,
                alone: Mutex::new(()),
                passes: OnceLock::new(),
            });
        }
    }
    Ok(programs)
}

/// The tests of a program by the first part of their paths.
fn modules(program: &Path, folder: &Path) -> TextResult<BTreeMap<String, Vec<String>>> {
    let output = Command::new(program)
        .arg("--list")
        .current_dir(folder)
        .output()
        .map_err(|e| format!("{}: {e}", program.display()))?;
    let mut modules: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        if let Some(test) = line.strip_suffix(": test") {
            let module = test.split_once("::").map_or("", |t| t.0);
            modules
                .entry(module.to_owned())
                .or_default()
                .push(test.to_owned());
        }
    }
    Ok(modules)
}

/// The packages of the workspace that the tests of each link, by the path of its manifest.
fn links(copy: &Path) -> TextResult<BTreeMap<String, BTreeSet<String>>> {
    let output = Command::new("cargo")
        .args(["metadata", "--no-deps", "--format-version", "1"])
        .current_dir(copy)
        .output()
        .map_err(|e| e.to_string())?;
    let metadata: Value = serde_json::from_slice(&output.stdout).map_err(|e| e.to_string())?;
    let empty = Vec::new();
    let list = |value: &Value| value.as_array().unwrap_or(&empty).clone();
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    // those for tests, and the others
    let mut direct: BTreeMap<String, [Vec<String>; 2]> = BTreeMap::new();
    let packages = list(&metadata["packages"]);
    for package in &packages {
        let of = |dev: bool| {
            list(&package["dependencies"])
                .iter()
                .filter(|d| (d["kind"] == "dev") == dev)
                .map(|d| text(&d["name"]))
                .collect()
        };
        direct.insert(text(&package["name"]), [of(true), of(false)]);
    }
    let mut all = BTreeMap::new();
    for package in &packages {
        let name = text(&package["name"]);
        let mut reached = BTreeSet::new();
        let mut next = direct.get(&name).map_or(Vec::new(), |d| d[0].clone());
        next.push(name);
        while let Some(name) = next.pop() {
            if let Some(dependencies) = direct.get(&name)
                && reached.insert(name)
            {
                next.extend(dependencies[1].iter().cloned());
            }
        }
        all.insert(text(&package["manifest_path"]), reached);
    }
    Ok(all)
}

impl Program {
    /// Whether the program links a package.
    pub fn links(&self, package: &str) -> bool {
        self.links.contains(package)
    }

    /// The folder of its package, its name there, and the module of its tests.
    pub fn name(&self) -> String {
        let name = |path: &Path| {
            path.file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned()
        };
        let (folder, own) = (name(&self.folder), name(&self.path));
        let own = own.rsplit_once('-').map_or(&*own, |(n, _)| n);
        format!("{folder}/{own} {}", self.module)
            .trim_end()
            .to_owned()
    }

    /// The file that was built.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Runs the tests with the fault of this number, or without any for 0, for at most a time of
    /// the processor, and at most another by the clock.
    pub fn run_with(
        &self,
        number: u64,
        most: Duration,
        by_the_clock: Duration,
    ) -> TextResult<TestOutcome> {
        let _alone = self.alone.lock().map_err(|e| e.to_string())?;
        // a fault may also ask for memory or write without end; in units of 1024 and 512 bytes
        let mut child = Command::new("sh")
            .args([
                "-c",
                "ulimit -v 12000000; ulimit -f 4000000; exec \"$0\" \"$@\"",
            ])
            .arg(&self.path)
            .arg("--exact")
            .args(&self.tests)
            .current_dir(&self.folder)
            .env("CARGO_MANIFEST_DIR", &self.folder)
            .env("REGEN_MUTANT", number.to_string())
            .env("INSTA_UPDATE", "no")
            // do not store a failing case, which the next fault would run too
            .env("PROPTEST_DISABLE_FAILURE_PERSISTENCE", "1")
            .env("RUST_TEST_THREADS", "1")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .process_group(0)
            .spawn()
            .map_err(|e| format!("{}: {e}", self.path.display()))?;
        let start = Instant::now();
        let outcome = loop {
            if let Some(status) = child.try_wait().map_err(|e| e.to_string())? {
                break if status.success() {
                    TestOutcome::Passed
                } else {
                    TestOutcome::Failed
                };
            }
            // programs that it started and waits for are seen by the clock alone
            let spent = processor_time(child.id()).unwrap_or_else(|| start.elapsed());
            if spent > most || start.elapsed() > by_the_clock {
                break TestOutcome::Hung;
            }
            std::thread::sleep(Duration::from_millis(10));
        };
        if !matches!(outcome, TestOutcome::Passed) {
            // with the programs that it started
            Command::new("kill")
                .args(["-KILL", "--", &format!("-{}", child.id())])
                .stderr(Stdio::null())
                .status()
                .map_err(|e| e.to_string())?;
            child.wait().map_err(|e| e.to_string())?;
        }
        Ok(outcome)
    }
}

/// The processor time of a process, on Linux. It is used beside elapsed time, so that a busy
/// machine is not mistaken for an infinite loop.
fn processor_time(process: u32) -> Option<Duration> {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // the name in brackets may contain anything; user and system time are the 14th and 15th fields
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
    let ticks: u64 = fields.next()?.parse::<u64>().ok()? + fields.next()?.parse::<u64>().ok()?;
    Some(Duration::from_millis(10 * ticks))
}
