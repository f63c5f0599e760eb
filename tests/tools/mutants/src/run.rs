//! Runs the tests with each fault.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Mutex;
use std::time::{Duration, Instant, SystemTime};

use serde_json::{Value, json};

use crate::programs::{Program, TestOutcome, programs};
use crate::{TextResult, read};

/// The number of faults that each program has caught, by the folder of the fault.
type Caught = BTreeMap<(String, usize), usize>;

/// The beginnings of names of programs that are tried for the faults of each package.
type Only = BTreeMap<String, Vec<String>>;

/// Builds the tests of some crates, then runs them for every mutant that compiles, until the first
/// failure. Programs run in the order in which a failure is likely soonest: quick ones first, and
/// those that caught faults nearby. Each mutant gets a line in `results.jsonl`; if it has
/// several, the last one is its result.
///
/// Programs that take longer than `seconds` are skipped; mutants that survive the others can be
/// tried with them later, in another run with more seconds. `REGEN_MUTANTS_ONLY` names a file
/// of JSON with beginnings of names of programs for each package with faults: then these alone are
/// run for its faults, again if they were before.
pub fn run(copy: &Path, drawn: &Path, seconds: &str, crates: &[&str]) -> TextResult<()> {
    let most: f64 = seconds.parse().map_err(|e| format!("seconds: {e}"))?;
    let only: Option<Only> = match std::env::var("REGEN_MUTANTS_ONLY") {
        Err(_) => None,
        Ok(file) => {
            let text = std::fs::read_to_string(&file).map_err(|e| format!("{file}: {e}"))?;
            Some(serde_json::from_str(&text).map_err(|e| format!("{file}: {e}"))?)
        }
    };
    let list = read(drawn)?;
    let may_catch = |program: &Program, package: &str| {
        let chosen = only.as_ref().is_none_or(|only| {
            let starts = only.get(package).map_or(&[][..], Vec::as_slice);
            starts.iter().any(|start| program.name().starts_with(start))
        });
        chosen && program.links(package)
    };
    let mut programs = programs(copy, crates)?;
    programs.retain(|program| {
        let mut packages = list.iter().filter_map(|m| m["package"].as_str());
        packages.any(|package| may_catch(program, package))
    });
    let mut programs = timed(copy, programs, Duration::from_secs_f64(4.0 * most))?;
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
    let left = |m: &Value| {
        let limit = if only.is_some() { f64::INFINITY } else { most };
        m["unviable"] != true && before(m).is_none_or(|b| b < limit)
    };
    let list: Vec<Value> = list.into_iter().filter(left).collect();
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
                let package = mutant["package"].as_str().unwrap_or_default();
                let order = {
                    let caught = caught.lock().map_err(|e| e.to_string())?;
                    order(&programs, &folder, &caught)
                        .into_iter()
                        .filter(|&at| may_catch(&programs[at], package))
                        .filter(|&at| {
                            let takes = programs[at].takes.as_secs_f64();
                            let new = only.is_some() || before(&mutant).is_none_or(|b| takes > b);
                            takes <= most && new
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
                let up_to = before(&mutant).map_or(most, |b| b.max(most));
                let line =
                    json!({ "number": number, "name": mutant["name"], "by": by, "up to": up_to });
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

/// The programs that pass without any fault, with their times; those that take longer than `most`
/// are not known to pass yet. Times are stored beside the results, negative for the latter, to
/// continue a run; a program built since is timed again.
fn timed(copy: &Path, programs: Vec<Program>, most: Duration) -> TextResult<Vec<Program>> {
    let file = copy.join("times.json");
    let written = modified(&file);
    let known: BTreeMap<String, f64> = std::fs::read_to_string(&file)
        .ok()
        .and_then(|t| serde_json::from_str(&t).ok())
        .unwrap_or_default();
    let queue = Mutex::new(programs.into_iter());
    let times = Mutex::new(known.clone());
    let passing = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        let work = || -> TextResult<()> {
            loop {
                let Some(mut program) = queue.lock().map_err(|e| e.to_string())?.next() else {
                    return Ok(());
                };
                let name = program.name();
                let before = known.get(&name).copied();
                let start = Instant::now();
                let takes = match before.filter(|_| modified(program.path()) < written) {
                    Some(takes) => takes,
                    None => match program.run_with(0, most, most)? {
                        TestOutcome::Passed => start.elapsed().as_secs_f64(),
                        // what was ended takes at least this time
                        TestOutcome::Hung => -start.elapsed().as_secs_f64(),
                        // a test that reads the sources fails, because it finds the switches
                        TestOutcome::Failed => f64::NEG_INFINITY,
                    },
                };
                if takes == f64::NEG_INFINITY {
                    eprintln!("left out, fails without any fault: {name}");
                    continue;
                }
                if takes > 0.0 {
                    program.passes = true.into();
                }
                times.lock().map_err(|e| e.to_string())?.insert(name, takes);
                let takes = takes.abs();
                program.takes = Duration::from_secs_f64(takes);
                passing.lock().map_err(|e| e.to_string())?.push(program);
            }
        };
        let workers = [scope.spawn(work), scope.spawn(work)];
        workers
            .into_iter()
            .try_for_each(|w| w.join().map_err(|_| "a worker died".to_owned())?)
    })?;
    let times = times.into_inner().map_err(|e| e.to_string())?;
    let text = serde_json::to_string_pretty(&times).map_err(|e| e.to_string())?;
    std::fs::write(&file, text).map_err(|e| e.to_string())?;
    passing.into_inner().map_err(|e| e.to_string())
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
        let most = program.takes * 6 + Duration::from_secs(10);
        let hung = match program.run_with(number, most, most * 4)? {
            TestOutcome::Passed => continue,
            TestOutcome::Failed => false,
            TestOutcome::Hung => true,
        };
        let passes = match program.passes.get() {
            Some(passes) => *passes,
            None => {
                let without = program.run_with(0, most, most * 4)?;
                let passes = matches!(without, TestOutcome::Passed);
                *program.passes.get_or_init(|| passes)
            }
        };
        if passes {
            return Ok(Some((at, hung)));
        }
        eprintln!("fails without any fault: {}", program.name());
    }
    Ok(None)
}

/// The time at which a file was written; the epoch if there is none.
fn modified(path: &Path) -> SystemTime {
    let written = std::fs::metadata(path).and_then(|m| m.modified());
    written.unwrap_or(SystemTime::UNIX_EPOCH)
}
