//! The worker: a process that makes the parts of one text, and ends with its server.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::parts::{Part, Task};

/// What a server asks of a worker, in one line of JSON.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Job {
    /// Texts that are read in place of files, by path.
    pub(crate) texts: BTreeMap<String, String>,
    pub(crate) tasks: Vec<Task>,
}

/// What a worker tells, in one line of JSON each.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Told {
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

/// What came of a command.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Done {
    /// What it printed.
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

/// Does the job that stands on standard input, and tells on standard output what comes of it; ends
/// the process when standard input ends, which it does with the server.
///
/// - `run`: runs a command. It is given its words, the texts that are read in place of files, and
///   the path of the file that the command writes and that is to be returned instead.
///
/// # Errors
///
/// When standard input is not a job, or standard output cannot be written.
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
        tell(&Told::Begins(task.part))?;
        let words: Vec<OsString> = task.words.iter().map(Into::into).collect();
        let done = run(&words, &texts, task.written.as_ref().map(Path::new));
        tell(&Told::Ends(task.part, done))?;
    }
    Ok(())
}

fn tell(told: &Told) -> io::Result<()> {
    let mut line = serde_json::to_string(told)?;
    line.push('\n');
    let mut out = io::stdout().lock();
    out.write_all(line.as_bytes())?;
    out.flush()
}
