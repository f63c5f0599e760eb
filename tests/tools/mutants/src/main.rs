//! Mutation testing in hours instead of days: the faults that cargo-mutants lists are planted
//! together in one copy of the sources, each behind a switch that an environment variable sets,
//! so that the tests are built once and only run for each of them.
//!
//! ```sh
//! cargo mutants --list --json -f 'codegen/src/base/**' ... > all.json
//! regen-mutants draw all.json SEED COUNT LEAST > drawn.json
//! regen-mutants plant COPY drawn.json          # rewrites the copy's sources
//! regen-mutants check COPY drawn.json CRATE... # which of them compile
//! regen-mutants run COPY drawn.json SECONDS CRATE... # tests each, one line of JSON a mutant
//! ```

mod check;
mod draw;
mod plant;
mod programs;
mod run;

use std::path::Path;
use std::process::ExitCode;

/// A result whose error is a message.
type TextResult<T> = Result<T, String>;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let done = match words[..] {
        ["draw", list, seed, count, least] => draw::draw(Path::new(list), seed, count, least),
        ["plant", copy, drawn] => plant::plant(Path::new(copy), Path::new(drawn)),
        ["check", copy, drawn, ref crates @ ..] => check::check(Path::new(copy), Path::new(drawn), crates),
        ["run", copy, drawn, seconds, ref crates @ ..] => {
            run::run(Path::new(copy), Path::new(drawn), seconds, crates)
        }
        _ => Err(
            "draw LIST SEED COUNT LEAST | plant COPY DRAWN | check COPY DRAWN CRATE... | run COPY DRAWN SECONDS CRATE..."
                .into(),
        ),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

/// The profile of cargo in which the planted sources are checked and tested: `release`, or the one
/// that the environment names.
fn profile() -> String {
    std::env::var("REGEN_MUTANTS_PROFILE").unwrap_or_else(|_| "release".to_owned())
}

/// Reads a JSON file that contains a list.
fn read(path: &Path) -> TextResult<Vec<serde_json::Value>> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    serde_json::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))
}
