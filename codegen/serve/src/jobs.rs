//! Computes the parts of the page for the newest texts, with one worker at a time, which is killed
//! when a newer text arrives or the time limit is exceeded.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::parts::{Part, tasks};
use crate::worker::{Done, Event, Job, Mistake};

/// The time between checks whether a running worker's result is still wanted.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// The largest number of bytes that a worker may write; more are not read.
const MAX_OUTPUT: u64 = 256 << 20;

/// The program that is started as a worker; it must call [`work`](crate::work).
#[derive(Clone, Debug)]
pub struct Program {
    /// The program's file.
    pub path: PathBuf,
    /// Its arguments.
    pub words: Vec<OsString>,
}

/// The last result of a part.
#[derive(Clone, Debug)]
struct Made {
    /// Increases when the result's text changes.
    version: u64,
    /// The number of the texts that it was made from.
    edit: u64,
    text: String,
    notes: Vec<String>,
}

/// The newest texts and what was computed from them.
#[derive(Debug)]
struct State {
    /// The number of the newest texts.
    edit: u64,
    /// The newest texts.
    texts: Vec<String>,
    /// Whether no worker has been started for them yet.
    is_waiting: bool,
    /// Whether their computation has not ended.
    is_busy: bool,
    /// The part that the worker computes now.
    doing: Option<Part>,
    /// The start of the computation.
    since: Instant,
    /// The duration of the last computation, s.
    seconds: f64,
    /// The last result of each part; it may be of older texts.
    made: BTreeMap<Part, Made>,
    /// The mistakes in the newest texts.
    mistakes: Vec<Mistake>,
    /// Other failures, each with the part that failed.
    failures: Vec<(Option<Part>, String)>,
}

/// The computations behind a page.
#[derive(Debug)]
pub(crate) struct Jobs {
    paths: Vec<String>,
    program: Program,
    limit: Duration,
    state: Mutex<State>,
    changed: Condvar,
}

impl Jobs {
    /// Starts the thread that computes the parts for the files with these paths, for at most `limit`
    /// per submission.
    pub(crate) fn start(paths: Vec<String>, program: Program, limit: Duration) -> Arc<Self> {
        let state = State {
            edit: 0,
            texts: Vec::new(),
            is_waiting: false,
            is_busy: false,
            doing: None,
            since: Instant::now(),
            seconds: 0.0,
            made: BTreeMap::new(),
            mistakes: Vec::new(),
            failures: Vec::new(),
        };
        let jobs = Arc::new(Self {
            paths,
            program,
            limit,
            state: Mutex::new(state),
            changed: Condvar::new(),
        });
        let worker = jobs.clone();
        std::thread::spawn(move || {
            loop {
                worker.next();
            }
        });
        jobs
    }

    /// Locks the state. A poisoned lock is ignored, since every change below leaves the state
    /// consistent even if the thread panics.
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Replaces the texts, one for each file, and returns the number of the new ones. If the same
    /// texts are being computed already, their computation continues.
    pub(crate) fn submit(&self, texts: Vec<String>) -> u64 {
        let mut state = self.state();
        if state.is_busy && state.texts == texts {
            return state.edit;
        }
        state.edit += 1;
        state.texts = texts;
        state.is_waiting = true;
        state.is_busy = true;
        self.changed.notify_all();
        state.edit
    }

    /// The state of the computation as JSON for the page.
    pub(crate) fn status(&self) -> Value {
        let state = self.state();
        let made = state.made.iter().map(|(part, made)| {
            let value = json!({
                "version": made.version,
                "current": made.edit == state.edit,
                "notes": made.notes,
            });
            (part.name().to_owned(), value)
        });
        let mistakes = state.mistakes.iter().map(|mistake| {
            json!({
                "file": self.paths.iter().position(|path| *path == mistake.file),
                "name": mistake.file,
                "line": mistake.line,
                "column": mistake.column,
                "message": mistake.message,
                "hint": mistake.hint,
            })
        });
        let failures = state
            .failures
            .iter()
            .map(|(part, why)| json!({"part": part.map(Part::name), "message": why}));
        json!({
            "edit": state.edit,
            "busy": state.is_busy,
            "doing": state.doing.map(Part::name),
            "seconds": if state.is_busy { state.since.elapsed().as_secs_f64() } else { state.seconds },
            "parts": made.collect::<serde_json::Map<_, _>>(),
            "mistakes": mistakes.collect::<Vec<_>>(),
            "failures": failures.collect::<Vec<_>>(),
        })
    }

    /// The last result of a part, which may be of older texts.
    pub(crate) fn part(&self, part: Part) -> Option<String> {
        self.state().made.get(&part).map(|made| made.text.clone())
    }

    /// Waits for new texts, and computes all their parts.
    fn next(&self) {
        let mut state = self.state();
        while !state.is_waiting {
            let woken = self.changed.wait(state);
            state = woken.unwrap_or_else(PoisonError::into_inner);
        }
        state.is_waiting = false;
        let (edit, texts) = (state.edit, state.texts.clone());
        state.since = Instant::now();
        state.doing = None;
        state.mistakes.clear();
        state.failures.clear();
        drop(state);
        let why = self.make(edit, &texts).err();
        let mut state = self.state();
        if state.edit != edit {
            return;
        }
        if let Some(why) = why {
            let part = state.doing;
            state.failures.push((part, why));
        }
        state.seconds = state.since.elapsed().as_secs_f64();
        state.is_busy = false;
        state.doing = None;
    }

    /// Runs a worker on the texts until it ends or newer texts arrive.
    ///
    /// # Errors
    ///
    /// The reason why some parts were not computed: the worker cannot be started, ended early, or
    /// took too long.
    fn make(&self, edit: u64, texts: &[String]) -> Result<(), String> {
        let job = Job {
            texts: self
                .paths
                .iter()
                .cloned()
                .zip(texts.iter().cloned())
                .collect(),
            tasks: match &self.paths[..] {
                [] => Vec::new(),
                [spec, rest @ ..] => tasks(spec, rest.first().map(String::as_str)),
            },
        };
        let count = job.tasks.len();
        let mut child = Command::new(&self.program.path)
            .args(&self.program.words)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|error| format!("the worker cannot be started: {error}"))?;
        let result = self.follow(edit, &mut child, &job, count);
        // killing a worker that has ended fails, which does no harm
        let _ = child.kill();
        let _ = child.wait();
        result
    }

    fn follow(&self, edit: u64, child: &mut Child, job: &Job, count: usize) -> Result<(), String> {
        let mut line = serde_json::to_vec(job).map_err(|error| error.to_string())?;
        line.push(b'\n');
        // kept open until this function returns, since a worker exits when its input is closed
        let mut input = child.stdin.take();
        if let Some(input) = &mut input {
            input
                .write_all(&line)
                .map_err(|error| format!("the worker does not read its job: {error}"))?;
        }
        let events = lines(child);
        let since = Instant::now();
        let mut ended = 0;
        while ended < count {
            match events.recv_timeout(POLL_INTERVAL) {
                Ok(Event::Begins(part)) => self.if_newest(edit, |state| state.doing = Some(part)),
                Ok(Event::Ends(part, done)) => {
                    ended += 1;
                    self.if_newest(edit, |state| state.take(edit, part, done));
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    return Err("the computation ended before its result".to_owned());
                }
            }
            if self.state().edit != edit {
                return Ok(());
            }
            if since.elapsed() > self.limit {
                return Err(format!(
                    "stopped after {} s, the limit; --limit changes it",
                    self.limit.as_secs_f64()
                ));
            }
        }
        Ok(())
    }

    fn if_newest(&self, edit: u64, change: impl FnOnce(&mut State)) {
        let mut state = self.state();
        if state.edit == edit {
            change(&mut state);
        }
    }
}

impl State {
    /// Stores the result of a part; a failure without a result leaves the previous one.
    fn take(&mut self, edit: u64, part: Part, done: Done) {
        let text = if part.is_page() {
            done.written
        } else {
            (!done.printed.is_empty()).then_some(done.printed)
        };
        if let Some(text) = text {
            let before = self.made.get(&part);
            let version = match before {
                Some(before) if before.text == text => before.version,
                Some(before) => before.version + 1,
                None => 1,
            };
            let notes = done.notes;
            let made = Made {
                version,
                edit,
                text,
                notes,
            };
            self.made.insert(part, made);
        }
        let is_placed = !done.mistakes.is_empty();
        for mistake in done.mistakes {
            if !self.mistakes.contains(&mistake) {
                self.mistakes.push(mistake);
            }
        }
        if let Some(why) = done.failure
            && !is_placed
            && self.failures.iter().all(|(_, before)| *before != why)
        {
            self.failures.push((Some(part), why));
        }
    }
}

/// Reads a worker's events in a thread of its own, until the worker ends or writes a line that is
/// no event.
fn lines(child: &mut Child) -> Receiver<Event> {
    let (send, receive) = mpsc::channel();
    if let Some(output) = child.stdout.take() {
        std::thread::spawn(move || {
            for line in BufReader::new(output.take(MAX_OUTPUT)).lines() {
                let Ok(line) = line else { return };
                let Ok(event) = serde_json::from_str(&line) else {
                    return;
                };
                if send.send(event).is_err() {
                    return;
                }
            }
        });
    }
    receive
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    /// Runs jobs with a shell script as their worker until they end.
    fn run(script: &str, limit: Duration) -> (Arc<Jobs>, Value) {
        let program = Program {
            path: "sh".into(),
            words: vec!["-c".into(), script.into()],
        };
        let jobs = Jobs::start(vec!["a.yaml".to_owned()], program, limit);
        jobs.submit(vec!["name: a\n".to_owned()]);
        (jobs.clone(), wait(&jobs))
    }

    fn wait(jobs: &Jobs) -> Value {
        loop {
            let status = jobs.status();
            if status["busy"] == false {
                return status;
            }
            std::thread::sleep(POLL_INTERVAL);
        }
    }

    const LONG: Duration = Duration::from_mins(1);

    #[test]
    #[cfg(unix)]
    fn a_worker_that_does_not_end_is_stopped() {
        let begun = Instant::now();
        let script = r#"echo '{"Begins":"base"}'; sleep 1000"#;
        let (jobs, status) = run(script, Duration::from_millis(200));
        let failure = &status["failures"][0];
        assert_eq!(failure["part"], "base");
        assert!(
            failure["message"]
                .as_str()
                .unwrap()
                .starts_with("stopped after 0.2 s")
        );
        assert!(begun.elapsed() < LONG / 2);
        assert_eq!(jobs.part(Part::Base), None);
    }

    #[test]
    #[cfg(unix)]
    fn a_worker_that_fails_or_writes_nonsense_is_reported() {
        for script in ["exit 7", "kill -9 $$", "cat", "echo nonsense; sleep 1000"] {
            let (_, status) = run(script, LONG);
            let why = status["failures"][0]["message"].as_str().unwrap();
            assert!(
                why == "the computation ended before its result"
                    || why.contains("does not read its job"),
                "{script}: {why}"
            );
        }
    }

    #[test]
    #[cfg(unix)]
    fn a_newer_text_ends_the_older_ones_worker() {
        let program = Program {
            path: "sh".into(),
            words: vec![
                "-c".into(),
                "read job; case \"$job\" in *slow*) sleep 1000;; esac".into(),
            ],
        };
        let jobs = Jobs::start(vec!["a.yaml".to_owned()], program, LONG);
        jobs.submit(vec!["slow".to_owned()]);
        std::thread::sleep(5 * POLL_INTERVAL);
        let newer = jobs.submit(vec!["quick".to_owned()]);
        let begun = Instant::now();
        assert_eq!(wait(&jobs)["edit"], newer);
        assert!(begun.elapsed() < LONG / 2);
    }

    #[test]
    fn a_failed_part_leaves_what_was_there() {
        let program = Program {
            path: "absent program".into(),
            words: Vec::new(),
        };
        let jobs = Jobs::start(vec!["a.yaml".to_owned()], program, LONG);
        let good = Done {
            printed: "as it was".to_owned(),
            ..Done::default()
        };
        jobs.state().take(0, Part::Check, good.clone());
        jobs.state().take(0, Part::Check, good);
        assert_eq!(
            jobs.status()["parts"]["check"],
            json!({"version": 1, "current": true, "notes": []})
        );
        let mistake = Mistake {
            file: "a.yaml".to_owned(),
            line: 3,
            ..Mistake::default()
        };
        let failure = Some("text".to_owned());
        let bad = Done {
            failure,
            mistakes: vec![mistake],
            ..Done::default()
        };
        jobs.state().edit = 1;
        jobs.state().take(1, Part::Check, bad.clone());
        jobs.state().take(1, Part::View, bad);
        let told = jobs.status();
        assert_eq!(told["parts"]["check"]["current"], false);
        assert_eq!(told["mistakes"].as_array().unwrap().len(), 1);
        assert_eq!(
            (&told["mistakes"][0]["file"], &told["mistakes"][0]["line"]),
            (&json!(0), &json!(3))
        );
        assert_eq!(told["failures"], json!([]));
        assert_eq!(jobs.part(Part::Check).unwrap(), "as it was");
        jobs.submit(vec![String::new()]);
        let why = wait(&jobs)["failures"][0]["message"].to_string();
        assert!(why.contains("cannot be started"), "{why}");
    }
}
