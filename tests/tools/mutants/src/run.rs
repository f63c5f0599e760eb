//! Runs the tests with each fault.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant, SystemTime};

use serde_json::{Value, json};

use crate::{TextResult, read};

/// A test program.
struct Program {
    path: PathBuf,
    package: PathBuf,
    /// The time of a run without faults.
    takes: Duration,
}

/// The number of faults that each program has caught, by the folder of the fault.
type Caught = BTreeMap<(String, usize), usize>;

enum TestOutcome {
    Passed,
    Failed,
    Hung,
}

/// Builds the tests of some crates, then runs them for every mutant that compiles, until the first
/// failure. Programs run in the order in which a failure is likely soonest: quick ones first, and
/// those that caught faults nearby. Each mutant gets a line in `results.jsonl`; if it has
/// several, the last one is its result.
///
/// Programs that take longer than `seconds` are skipped; mutants that survive the others can be
/// tried with them later, in another run with more seconds.
pub fn run(copy: &Path, drawn: &Path, seconds: &str, crates: &[&str]) -> TextResult<()> {
    let most: f64 = seconds.parse().map_err(|e| format!("seconds: {e}"))?;
    let programs = build(copy, crates)?;
    // the time of each program is stored beside the results, to continue a run; a program built
    // since is timed again, which also checks that it passes without any fault
    let times_file = copy.join("times.json");
    let timed = modified(&times_file);
    let mut times: BTreeMap<String, f64> = std::fs::read_to_string(&times_file)
        .ok()
        .and_then(|t| serde_json::from_str(&t).ok())
        .unwrap_or_default();
    let mut passing = Vec::new();
    for mut program in programs {
        let known = times.get(&program.name()).copied();
        let takes = if let Some(takes) = known.filter(|_| modified(&program.path) < timed) {
            takes
        } else {
            let before = Instant::now();
            match program.run_with(0, Duration::from_secs(900))? {
                TestOutcome::Passed => before.elapsed().as_secs_f64(),
                // a test that reads the sources fails, because it finds the switches in them
                _ => f64::NAN,
            }
        };
        if takes.is_finite() {
            times.insert(program.name(), takes);
            program.takes = Duration::from_secs_f64(takes);
            passing.push(program);
        } else {
            eprintln!("left out, fails without any fault: {}", program.name());
        }
    }
    let text = serde_json::to_string_pretty(&times).map_err(|e| e.to_string())?;
    std::fs::write(&times_file, text).map_err(|e| e.to_string())?;
    let mut programs = passing;
    programs.sort_by_key(|p| p.takes);
    for program in &programs {
        eprintln!("{:8.1} s  {}", program.takes.as_secs_f64(), program.name());
    }
    let results = copy.join("results.jsonl");
    let known = std::fs::read_to_string(&results).unwrap_or_default();
    // the time limit, s, up to which each mutant survived; infinite if it was caught
    let mut tried: BTreeMap<u64, f64> = BTreeMap::new();
    for line in known.lines() {
        let line: Value = serde_json::from_str(line).map_err(|e| format!("results: {e}"))?;
        let caught = !line["by"].is_null();
        let seconds = line["up to"].as_f64().unwrap_or(0.0);
        if let Some(number) = line["number"].as_u64() {
            tried.insert(number, if caught { f64::INFINITY } else { seconds });
        }
    }
    let before = |m: &Value| m["number"].as_u64().and_then(|n| tried.get(&n)).copied();
    let list: Vec<Value> = read(drawn)?
        .into_iter()
        .filter(|m| m["unviable"] != true && before(m).is_none_or(|b| b < most))
        .collect();
    let queue = Mutex::new(list.into_iter());
    let caught = Mutex::new(Caught::new());
    let lines = Mutex::new(known);
    std::thread::scope(|scope| {
        let work = || -> TextResult<()> {
            loop {
                let Some(mutant) = queue.lock().map_err(|e| e.to_string())?.next() else {
                    return Ok(());
                };
                let number = mutant["number"].as_u64().unwrap_or(0);
                let folder = folder(&mutant);
                let order = {
                    let caught = caught.lock().map_err(|e| e.to_string())?;
                    order(&programs, &folder, &caught)
                        .into_iter()
                        .filter(|&at| programs[at].can_reach(&folder))
                        .filter(|&at| {
                            let takes = programs[at].takes.as_secs_f64();
                            takes <= most && before(&mutant).is_none_or(|b| takes > b)
                        })
                        .collect::<Vec<_>>()
                };
                let found = caught_by(&programs, &order, number)?;
                let by = found.map(|(at, hung)| {
                    let hung = if hung { ", hung" } else { "" };
                    (at, format!("{}{hung}", programs[at].name()))
                });
                if let Some((at, _)) = by {
                    let mut caught = caught.lock().map_err(|e| e.to_string())?;
                    *caught.entry((folder, at)).or_default() += 1;
                }
                let by = by.map(|b| b.1);
                let line =
                    json!({ "number": number, "name": mutant["name"], "by": by, "up to": most });
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

/// The folder of the source file of a fault.
fn folder(mutant: &Value) -> String {
    let file = mutant["file"].as_str().unwrap_or_default();
    file.rsplit_once('/').map_or("", |f| f.0).to_owned()
}

/// The programs, those first that are likely to catch most faults per second.
fn order(programs: &[Program], folder: &str, caught: &Caught) -> Vec<usize> {
    let catches_per_second = |at: usize| {
        let near = caught.get(&(folder.to_owned(), at)).copied().unwrap_or(0);
        let all: usize = caught
            .iter()
            .filter(|((_, program), _)| *program == at)
            .map(|(_, count)| count)
            .sum();
        (near as f64 + 0.1 * all as f64 + 0.1) / (programs[at].takes.as_secs_f64() + 0.2)
    };
    let mut order: Vec<usize> = (0..programs.len()).collect();
    order.sort_by(|a, b| catches_per_second(*b).total_cmp(&catches_per_second(*a)));
    order
}

/// The program that caught a fault, if one did, and whether it did so by not terminating.
fn caught_by(
    programs: &[Program],
    order: &[usize],
    number: u64,
) -> TextResult<Option<(usize, bool)>> {
    for &at in order {
        let program = &programs[at];
        match program.run_with(number, program.takes * 6 + Duration::from_secs(20))? {
            TestOutcome::Passed => {}
            TestOutcome::Failed => return Ok(Some((at, false))),
            TestOutcome::Hung => return Ok(Some((at, true))),
        }
    }
    Ok(None)
}

/// Programs that take longer than this test the derivation, not the runtime.
const MAX_RUNTIME_TEST_TIME: Duration = Duration::from_secs(20);

impl Program {
    /// Whether the program can reach the code in a folder: one crate's own tests do not link the
    /// other.
    fn can_reach(&self, folder: &str) -> bool {
        match (folder.starts_with("runtime"), folder.starts_with("codegen")) {
            (true, _) => !self.package.ends_with("codegen") && self.takes < MAX_RUNTIME_TEST_TIME,
            (_, true) => !self.package.ends_with("runtime"),
            _ => true,
        }
    }

    /// The folder of its crate, and its name there.
    fn name(&self) -> String {
        let name = |path: &Path| {
            path.file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned()
        };
        let (package, own) = (name(&self.package), name(&self.path));
        let own = own.rsplit_once('-').map_or(&*own, |(n, _)| n);
        format!("{package}/{own}")
    }
}

/// The time at which a file was written; the epoch if there is none.
fn modified(path: &Path) -> SystemTime {
    let written = std::fs::metadata(path).and_then(|m| m.modified());
    written.unwrap_or(SystemTime::UNIX_EPOCH)
}

impl Program {
    /// Runs the program with the fault of this number, or without any for 0, for at most a time.
    fn run_with(&self, number: u64, most: Duration) -> TextResult<TestOutcome> {
        let mut child = Command::new(&self.path)
            .current_dir(&self.package)
            .env("CARGO_MANIFEST_DIR", &self.package)
            .env("REGEN_MUTANT", number.to_string())
            .env("INSTA_UPDATE", "no")
            // do not store a failing case, which the next fault would run too
            .env("PROPTEST_DISABLE_FAILURE_PERSISTENCE", "1")
            .env("RUST_TEST_THREADS", "1")
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|e| format!("{}: {e}", self.path.display()))?;
        let start = Instant::now();
        loop {
            if let Some(status) = child.try_wait().map_err(|e| e.to_string())? {
                return Ok(if status.success() {
                    TestOutcome::Passed
                } else {
                    TestOutcome::Failed
                });
            }
            let spent = processor_time(child.id()).unwrap_or_else(|| start.elapsed());
            if spent > most {
                child.kill().map_err(|e| e.to_string())?;
                child.wait().map_err(|e| e.to_string())?;
                return Ok(TestOutcome::Hung);
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

/// The processor time of a process, on Linux. It is used instead of elapsed time, so that a busy
/// machine is not mistaken for an infinite loop.
fn processor_time(process: u32) -> Option<Duration> {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // the name in brackets may contain anything; user and system time are the 14th and 15th fields
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
    let ticks: u64 = fields.next()?.parse::<u64>().ok()? + fields.next()?.parse::<u64>().ok()?;
    Some(Duration::from_millis(10 * ticks))
}

fn build(copy: &Path, crates: &[&str]) -> TextResult<Vec<Program>> {
    let mut command = Command::new("cargo");
    command.args([
        "test",
        "--profile",
        &crate::profile(),
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
