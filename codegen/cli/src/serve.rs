//! `regen serve`: an editor in a browser, and its workers.

use std::time::Duration;

use regen_serve::{Done, Options, Program, ServeError, Server};

use crate::args::ServeArgs;
use crate::call::{self, Handle};
use crate::exit::Failure;
use crate::{terminal, write};

/// Runs the command: a server, or one of its workers.
pub(crate) fn run(args: &ServeArgs, no_cache: bool) -> Result<(), Failure> {
    if args.worker {
        return regen_serve::work(|words, texts, written| {
            let handle = Handle::default();
            let mut words = words.to_vec();
            words.extend(no_cache.then(|| "--no-cache".into()));
            let (result, mut files) = call::run_in_memory(&words, texts.clone(), &handle);
            let mut done = Done {
                written: written.and_then(|path| files.remove(path)),
                notes: handle.take_notes(),
                ..Done::default()
            };
            match result {
                Ok(printed) => done.printed = printed,
                Err(error) => {
                    done.printed = error.printed;
                    done.failure = Some(error.message);
                    done.mistakes = error.mistakes;
                }
            }
            done
        })
        .map_err(|error| Failure::Io(format!("the server does not listen: {error}")));
    }
    let program = std::env::current_exe()
        .map_err(|error| Failure::Io(format!("this program is not found: {error}")))?;
    let mut words = vec!["serve".into(), "--worker".into(), "-".into()];
    if no_cache {
        words.push("--no-cache".into());
    }
    let server = Server::bind(Options {
        spec: args.file.clone(),
        runs: args.runs.clone(),
        port: args.port,
        limit: Duration::from_secs(args.limit.into()),
        program: Program {
            path: program,
            words,
        },
        save: |path, text| write::atomically(path, text).map_err(|error| error.to_string()),
    })?;
    terminal::print(&format!("{}\n", server.url()))?;
    terminal::note("open this address in a browser on this machine; Ctrl-C ends the server");
    server.run()
}

impl From<ServeError> for Failure {
    fn from(error: ServeError) -> Self {
        Self::Io(error.to_string())
    }
}
