//! Processor time and peak memory from the text of a spec to the text of a module, without the
//! base parameters, which `base.rs` measures.
//!
//! ```sh
//! cargo bench -p regen-codegen --bench derive                  # optimised, as the command is
//! cargo bench -p regen-codegen --bench derive --profile dev    # not, as macros are built
//! ```
//!
//! The aim: the 3-RPS under 0.2 s and 200 MB, optimised. A larger value does not fail the run.
//! Linux reports both; elsewhere the elapsed time is printed, and no memory.
//!
//! Measured on a virtual core of an AMD EPYC, Rust 1.95: the 3-RPS in 0.013 s and 6 MB, not
//! optimised 0.10 s and 8 MB; the hexapod in 0.10 s and 14 MB, not optimised 0.84 s.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs::read_to_string;
use std::path::Path;
use std::time::Instant;

use regen_codegen::diag::Source;
use regen_codegen::emit::{Options, module};
use regen_codegen::pipeline::{BaseSource, derive_with};

/// From small to large, so that the peak so far is the robot's own.
const FILES: [&str; 5] = [
    "robots/fourbar.yaml",
    "robots/fivebar.yaml",
    "robots/puma560.yaml",
    "robots/3rps.yaml",
    "tests/fixtures/mechanisms/hexapod.yaml",
];

/// Seconds that this process has run on a processor.
fn processor_time() -> Option<f64> {
    let text = read_to_string("/proc/self/schedstat").ok()?;
    let nanoseconds: f64 = text.split_whitespace().next()?.parse().ok()?;
    Some(nanoseconds * 1e-9)
}

/// The most memory that this process has held so far, in MB.
fn peak_memory() -> Option<f64> {
    let text = read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: f64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kilobytes / 1024.0)
}

fn main() {
    let optimised = if cfg!(debug_assertions) { "not " } else { "" };
    println!("{optimised}optimised");
    for file in FILES {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(file);
        let source = Source::new(file, read_to_string(path).unwrap());
        let (clock, before) = (Instant::now(), processor_time());
        let (mut text, mut runs) = (String::new(), 0.0);
        // the system counts processor time in steps of some milliseconds
        while clock.elapsed().as_secs_f64() < 0.5 {
            let robot = derive_with(&source, BaseSource::Skip)
                .unwrap_or_else(|problem| panic!("{problem:?}"));
            text = module(&robot, &Options::default());
            runs += 1.0;
        }
        let wall = clock.elapsed().as_secs_f64();
        let total = match (before, processor_time()) {
            (Some(before), Some(after)) => after - before,
            _ => wall,
        };
        let seconds = total / runs;
        let memory = peak_memory().map_or_else(String::new, |mb| format!("{mb:6.1} MB"));
        let kilobytes = text.len() / 1000;
        println!("{file:32} {seconds:7.3} s {memory}   {kilobytes:5} kB of source");
    }
}
