//! `regen`: derives a robot's dynamics from its YAML spec, writes them as Rust source, evaluates
//! and verifies them, and identifies the parameters from logs.
//!
//! [`main`] is the program. [`call::run`] runs one of its commands for another program in the same
//! process, and returns what the command would print.

mod args;
mod base;
mod calibrate;
pub mod call;
mod check;
mod choice;
mod choose;
mod closed;
mod delay;
mod equations;
mod eval;
mod excite;
mod exit;
mod experiment;
mod export;
mod generate;
mod identify;
mod identify_iv;
mod identify_loads;
mod identify_simulated;
#[cfg(test)]
mod identify_tests;
mod import;
mod info;
mod inspect;
mod interrupt;
mod load;
mod loads;
mod man;
mod mistakes;
mod model;
mod new;
mod observe;
mod outputs;
mod parameters;
mod path;
mod physical;
mod progress;
mod rehearse;
mod report;
mod serve;
mod simulate;
mod suspect;
mod table;
mod terminal;
mod validate;
mod verify;
mod view;
mod watch;
mod write;

use std::process::ExitCode;

use clap::CommandFactory as _;

use args::{Cli, Command, SchemaArg};
use exit::Failure;
use regen_report::documents::Document;

/// Runs the command line of this process, and returns its exit code.
pub fn main() -> ExitCode {
    interrupt::listen();
    match args::parse().and_then(run) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            terminal::complain(&failure);
            ExitCode::from(failure.code())
        }
    }
}

fn run(cli: Cli) -> Result<(), Failure> {
    if !cli.no_cache && cli.command.as_ref().is_some_and(Command::may_use_cache) {
        load::use_cache();
    }
    match cli.command {
        Some(Command::New(args)) => new::run(&args),
        Some(Command::Generate(args)) => generate::run(&args),
        Some(Command::Info(args)) => info::run(&args),
        Some(Command::Base(args)) => base::run(&args),
        Some(Command::Equations(args)) => equations::run(&args),
        Some(Command::Check(args)) => check::run(&args),
        Some(Command::Verify(args)) => verify::run(&args),
        Some(Command::Eval(args)) => eval::run(&args),
        Some(Command::Import(args)) => import::run(&args),
        Some(Command::Export(args)) => export::run(&args),
        Some(Command::Excite(args)) => excite::run(&args),
        Some(Command::Calibrate(args)) => calibrate::run(&args),
        Some(Command::Inspect(args)) => inspect::run(&args),
        Some(Command::Observe(args)) => observe::run(&args),
        Some(Command::Identify(args)) => identify::run(&args),
        Some(Command::Validate(args)) => validate::run(&args),
        Some(Command::Simulate(args)) => simulate::run(&args),
        Some(Command::Rehearse(args)) => rehearse::run(&args),
        Some(Command::View(args)) => view::run(&args),
        Some(Command::Serve(args)) => serve::run(&args, cli.no_cache),
        Some(Command::Report(args)) => report::run(&args),
        Some(Command::Schema { of, printed }) => {
            let document = printed.as_deref().and_then(Document::of);
            terminal::print(&match (document, of) {
                (Some(document), _) => document.schema().to_owned(),
                (None, SchemaArg::Spec) => regen_codegen::spec::schema(),
                (None, SchemaArg::Experiment) => regen_identify::experiment_file::schema(),
            })
        }
        Some(Command::Man { command }) => man::run(command.as_deref()),
        Some(Command::Completions { shell }) => {
            let mut text = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "regen", &mut text);
            terminal::print(&String::from_utf8_lossy(&text))
        }
        None => model::run(&cli.model),
    }
}
