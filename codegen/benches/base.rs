//! The time to derive base parameters, in milliseconds: layers 1 and 2 alone, with the
//! target known, and the whole analysis with its certificate.
//!
//! ```sh
//! cargo bench -p regen-codegen --bench base
//! ```
//!
//! The aim: 3-RPS, PUMA 560 and a 7R arm each under 500 ms in all. A longer time does not
//! fail the run.
//!
//! Also under 5 s for a 6-UPS and under 10 s for a Delta.
//!
//! Measured on a virtual core of an AMD EPYC, Rust 1.95: 13, 8 and 15 ms in all;
//! the Stewart platform 158 ms. With the machine busy otherwise: hexapod 0.50 s,
//! Delta 0.57 s, with a fourth leg 1.1 s, four legs of five joints 3.3 s.

use std::time::Instant;

use regen_codegen::base::{analyse, derive};
use regen_codegen::diag::Source;
use regen_codegen::{model, pipeline, spec};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("layers  target  analysis  (ms)  rank  file");
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for name in [
        "robots/3rps.yaml",
        "robots/puma560.yaml",
        "robots/panda.yaml",
        "robots/stewart.yaml",
        "robots/palletiser.yaml",
        "tests/fixtures/mechanisms/hexapod.yaml",
        "tests/fixtures/mechanisms/delta.yaml",
        "tests/fixtures/base/delta4.yaml",
        "tests/fixtures/base/schoenflies.yaml",
    ] {
        let path = root.join(name);
        let source = Source::new(name, std::fs::read_to_string(&path)?);
        let parsed = spec::parse(&source)?;
        let model = model::build(&parsed);
        let seconds = |run: &dyn Fn() -> usize| {
            // the quickest of several runs is the one that was disturbed least
            let times = (0..5).map(|_| {
                let start = Instant::now();
                let rank = run();
                (start.elapsed().as_secs_f64() * 1e3, rank)
            });
            times.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default()
        };
        let (layers, rank) = seconds(&|| derive(&parsed, &model, None).rank());
        let dropped = derive(&parsed, &model, None).from_trees;
        let (target, _) = seconds(&|| derive(&parsed, &model, Some(dropped)).rank());
        let home = pipeline::derive(&source)?.home;
        let (analysis, _) = seconds(&|| analyse(&parsed, &model, &home).base.rank());
        println!("{layers:6.1} {target:7.1} {analysis:9.1}        {rank:4}  {name}");
    }
    Ok(())
}
