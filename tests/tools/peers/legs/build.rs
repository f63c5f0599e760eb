//! Generates platforms on three to twelve UPS legs.

#[path = "../../../src/platform.rs"]
#[allow(clippy::all, clippy::pedantic, reason = "linted where it belongs")]
mod platform;

use std::fmt::Write as _;

use regen_codegen::diag::Source;
use regen_codegen::emit::{Options, module};
use regen_codegen::pipeline::{BaseSource, derive_with};

/// The numbers of legs, the same as in `src/main.rs`.
const LEGS: [usize; 7] = [3, 4, 5, 6, 8, 10, 12];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=../../../src/platform.rs");
    let mut all = String::new();
    for legs in LEGS {
        let source = Source::new("ups.yaml", &platform::ups(legs));
        let robot = derive_with(&source, BaseSource::Skip).map_err(|e| format!("{e:?}"))?;
        let text = module(&robot, &Options::default());
        writeln!(all, "pub mod ups{legs} {{\n{text}\n}}")?;
    }
    let out = std::env::var("OUT_DIR")?;
    std::fs::write(std::path::Path::new(&out).join("platforms.rs"), all)?;
    Ok(())
}
