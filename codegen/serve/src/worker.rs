//! The worker: a process that runs the commands for one version of a text, and ends with its
//! server.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::parts::{Part, Task};

/// The commands that a server sends to a worker, as one line of JSON.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Job {
    /// Texts that commands read in place of files, by path.
    pub(crate) texts: BTreeMap<String, String>,
    pub(crate) tasks: Vec<Task>,
}

/// What a worker reports to its server, one line of JSON per event.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Event {
    Begins(Part),
    Ends(Part, Done),
}

/// A mistake in a file, at its place.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Mistake {
    /// The file's path.
    pub file: String,
    /// The line, from 1.
    pub line: usize,
    /// The column in characters, from 1.
    pub column: usize,
    /// What is wrong.
    pub message: String,
    /// What to write instead; may be empty.
    pub hint: String,
}

/// The result of a command.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Done {
    /// The text that it printed.
    pub printed: String,
    /// The file that it would have written, where the task names one.
    pub written: Option<String>,
    /// Its messages and warnings.
    pub notes: Vec<String>,
    /// Why it failed; `None` where it did not.
    pub failure: Option<String>,
    /// The mistakes in files for which it failed.
    pub mistakes: Vec<Mistake>,
}

/// Reads a job from standard input, runs its commands, and reports their results on standard
/// output. The process exits when standard input is closed, which happens when the server ends.
///
/// - `run`: runs a command, given its words, the texts that it reads in place of files, and the
///   path of the file whose text it returns instead of writing it.
///
/// # Errors
///
/// When standard input does not begin with a job, or standard output cannot be written.
pub fn work(
    mut run: impl FnMut(&[OsString], &BTreeMap<PathBuf, String>, Option<&Path>) -> Done,
) -> io::Result<()> {
    let mut input = BufReader::new(io::stdin());
    let mut line = String::new();
    input.read_line(&mut line)?;
    let job: Job = serde_json::from_str(&line)?;
    std::thread::spawn(move || {
        let _ = input.read_to_end(&mut Vec::new());
        std::process::exit(0);
    });
    let texts = job.texts.into_iter();
    let texts = texts.map(|(path, text)| (path.into(), text)).collect();
    for task in job.tasks {
        report(&Event::Begins(task.part))?;
        let words: Vec<OsString> = task.words.iter().map(Into::into).collect();
        let done = run(&words, &texts, task.written.as_ref().map(Path::new));
        report(&Event::Ends(task.part, done))?;
    }
    Ok(())
}

fn report(event: &Event) -> io::Result<()> {
    let mut line = serde_json::to_string(event)?;
    line.push('\n');
    let mut out = io::stdout().lock();
    out.write_all(line.as_bytes())?;
    out.flush()
}
