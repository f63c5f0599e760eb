//! The tests against each fault.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::{Told, read};

/// A program of tests.
struct Program {
    path: PathBuf,
    package: PathBuf,
    takes: Duration,
}

enum Went {
    Passed,
    Failed,
    Hung,
}

/// Builds the tests of some crates, then runs them for every mutant that compiles, quick ones
/// first and up to the first failure; mutants that have a line in `results.jsonl` are left out.
pub fn run(copy: &Path, drawn: &Path, crates: &[&str]) -> Told<()> {
    let mut programs = build(copy, crates)?;
    for program in &mut programs {
        let before = Instant::now();
        match program.went(0, Duration::from_secs(900))? {
            Went::Passed => program.takes = before.elapsed(),
            _ => {
                return Err(format!(
                    "{} fails without any fault",
                    program.path.display()
                ));
            }
        }
    }
    programs.sort_by_key(|p| p.takes);
    let whole: Duration = programs.iter().map(|p| p.takes).sum();
    eprintln!(
        "{} programs, {:.1} s without faults",
        programs.len(),
        whole.as_secs_f64()
    );
    let results = copy.join("results.jsonl");
    let known = std::fs::read_to_string(&results).unwrap_or_default();
    let done: BTreeSet<u64> = known
        .lines()
        .filter_map(|l| serde_json::from_str::<Value>(l).ok()?["number"].as_u64())
        .collect();
    let list: Vec<Value> = read(drawn)?
        .into_iter()
        .filter(|m| {
            m["unviable"] != true && !m["number"].as_u64().is_some_and(|n| done.contains(&n))
        })
        .collect();
    let queue = Mutex::new(list.into_iter());
    let lines = Mutex::new(known);
    std::thread::scope(|scope| {
        let work = || -> Told<()> {
            loop {
                let Some(mutant) = queue.lock().map_err(|e| e.to_string())?.next() else {
                    return Ok(());
                };
                let number = mutant["number"].as_u64().unwrap_or(0);
                let by = judged(&programs, number)?;
                let line = json!({ "number": number, "name": mutant["name"], "by": by });
                let mut lines = lines.lock().map_err(|e| e.to_string())?;
                lines.push_str(&format!("{line}\n"));
                std::fs::write(&results, &*lines).map_err(|e| e.to_string())?;
                eprintln!("{line}");
            }
        };
        let workers = [scope.spawn(work), scope.spawn(work)];
        workers
            .into_iter()
            .try_for_each(|w| w.join().map_err(|_| "a worker died".to_owned())?)
    })
}

/// The program that caught a fault, if one did.
fn judged(programs: &[Program], number: u64) -> Told<Option<String>> {
    for program in programs {
        let how = match program.went(number, program.takes * 6 + Duration::from_secs(20))? {
            Went::Passed => continue,
            Went::Failed => "",
            Went::Hung => ", hung",
        };
        let name = program
            .path
            .file_name()
            .unwrap_or_default()
            .to_string_lossy();
        let name = name.rsplit_once('-').map_or(&*name, |(name, _)| name);
        return Ok(Some(format!("{name}{how}")));
    }
    Ok(None)
}

impl Program {
    fn went(&self, number: u64, most: Duration) -> Told<Went> {
        let mut child = Command::new(&self.path)
            .current_dir(&self.package)
            .env("CARGO_MANIFEST_DIR", &self.package)
            .env("REGEN_MUTANT", number.to_string())
            .env("INSTA_UPDATE", "no")
            .env("RUST_TEST_THREADS", "1")
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|e| format!("{}: {e}", self.path.display()))?;
        let start = Instant::now();
        loop {
            if let Some(status) = child.try_wait().map_err(|e| e.to_string())? {
                return Ok(if status.success() {
                    Went::Passed
                } else {
                    Went::Failed
                });
            }
            if start.elapsed() > most {
                child.kill().map_err(|e| e.to_string())?;
                child.wait().map_err(|e| e.to_string())?;
                return Ok(Went::Hung);
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

fn build(copy: &Path, crates: &[&str]) -> Told<Vec<Program>> {
    let mut command = Command::new("cargo");
    command.args([
        "test",
        "--release",
        "--no-run",
        "--tests",
        "--message-format=json",
    ]);
    command.args(crates.iter().flat_map(|name| ["-p", name]));
    let output = command
        .current_dir(copy)
        .stderr(Stdio::inherit())
        .output()
        .map_err(|e| e.to_string())?;
    if !output.status.success() {
        return Err("the tests do not build".into());
    }
    let mut programs = Vec::new();
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        let Ok(message) = serde_json::from_str::<Value>(line) else {
            continue;
        };
        let (path, manifest) = (
            message["executable"].as_str(),
            message["manifest_path"].as_str(),
        );
        if let (Some(path), Some(manifest)) = (path, manifest)
            && message["profile"]["test"] == true
        {
            programs.push(Program {
                path: path.into(),
                package: Path::new(manifest)
                    .parent()
                    .map(Path::to_owned)
                    .unwrap_or_default(),
                takes: Duration::ZERO,
            });
        }
    }
    Ok(programs)
}
