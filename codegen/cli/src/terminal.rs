//! Standard output and standard error.

use std::io::{self, IsTerminal, Write};

use crate::call;
use crate::exit::Failure;

/// Writes a result to standard output.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    if call::print(text) {
        return Ok(());
    }
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes())
        .and_then(|()| out.flush())
        .map_err(|error| match error.kind() {
            io::ErrorKind::BrokenPipe => Failure::BrokenPipe,
            _ => Failure::Io(format!("cannot write to standard output: {error}")),
        })
}

/// Writes a message to standard error; a failure to write is ignored, since nothing can be done.
pub(crate) fn note(text: &str) {
    if call::note(text) {
        return;
    }
    let _ = writeln!(io::stderr(), "{text}");
}

/// Prints on standard error why the run ended.
pub(crate) fn complain(failure: &Failure) {
    let color = colored();
    match failure {
        Failure::BrokenPipe => {}
        Failure::Interrupted(text) => note(text),
        Failure::Spec(reports) => {
            for report in reports {
                note(report.render(color).trim_end());
            }
        }
        other if color => note(&format!("\x1b[1;31merror\x1b[0m\x1b[1m:\x1b[0m {other}")),
        other => note(&format!("error: {other}")),
    }
}

/// Whether messages are coloured: on a terminal that supports it, unless `NO_COLOR` is set.
fn colored() -> bool {
    let wanted = std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    let supported = std::env::var_os("TERM").is_none_or(|term| term != "dumb");
    wanted && supported && io::stderr().is_terminal()
}
