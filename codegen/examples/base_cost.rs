//! What the base parameters of the given specs cost: seconds in layers 1 and 2
//! alone, with the target known, and in the certificate.
//!
//! `cargo run --release -p regen-codegen --example base_cost -- tests/oracle/3rps.yaml`

use std::time::Instant;

use regen_codegen::base::{analyse, derive};
use regen_codegen::diag::Source;
use regen_codegen::{model, pipeline, spec};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("layers  target  analysis  (ms)  rank  file");
    for path in std::env::args().skip(1) {
        let source = Source::new(path.clone(), std::fs::read_to_string(&path)?);
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
        println!("{layers:6.1} {target:7.1} {analysis:9.1}        {rank:4}  {path}");
    }
    Ok(())
}
