//! The command line: commands, options, and the help text that clap prints for them.

mod apart;
mod calibrate;
mod checks;
mod derived;
mod effects;
mod equations;
mod excite;
mod format;
mod generate;
mod identify;
mod inspect;
mod new;
mod physical;
mod reading;
mod rehearse;
mod report;
mod robot_files;
mod serve;
mod simulate;
mod view;

use std::ffi::OsString;

use clap::builder::PossibleValuesParser;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};
use regen_codegen::spec::nearest;
use regen_report::documents::Document;

pub(crate) use apart::require_unread;
pub(crate) use calibrate::CalibrateArgs;
pub(crate) use checks::{CheckArgs, VerifyArgs, VerifyFormat};
pub(crate) use derived::{BaseArgs, EvalArgs, InfoArgs, ModelArgs, TableFormat};
pub(crate) use effects::unused_keys;
pub(crate) use equations::{EquationsArgs, OfArg, ParametersArg, StyleArg};
pub(crate) use excite::{CriterionArg, ExciteArgs};
pub(crate) use format::Format;
pub(crate) use generate::{GenerateArgs, TargetArg};
pub(crate) use identify::{EstimatorArg, IdentifyArgs, ObserveArgs, ValidateArgs, WeightingArg};
pub(crate) use inspect::InspectArgs;
pub(crate) use new::{Kind, NewArgs};
pub(crate) use physical::{PhysicalArgs, PriorArg};
pub(crate) use reading::{
    DelayArg, PayloadArg, ProblemsArg, ReadingArgs, StandstillArg, VelocitiesArg,
};
pub(crate) use rehearse::{RehearseArgs, SolvingArgs, UnmodelledArg};
pub(crate) use report::ReportArgs;
pub(crate) use robot_files::{Base, ExportArgs, ExportTarget, ImportArgs};
pub(crate) use serve::ServeArgs;
pub(crate) use simulate::{SimulateArgs, TwinArgs};
pub(crate) use view::ViewArgs;

use crate::exit::Failure;

const EXIT_CODES: &str = "\
Exit codes:
  0  done; with --check: everything is up to date
  1  a check failed: generated source is not up to date or not verified, or the
     base parameters are incomplete, or a rehearsal is below its score
  2  the command line is wrong
  3  the spec, the states or another file that was given is wrong
  4  a state could not be closed, or is singular; data that leave parameters
      undetermined; a physical fit that is not proven to be the optimum
  5  a file could not be read or written
  130  interrupted; no file is left half written, and searches keep their best";

const EXAMPLES: &str = "\
Examples:
  regen new my_arm --kind serial     a commented spec to begin with
  regen robots/3rps.yaml             derive, write the source, verify it
  regen info robots/3rps.yaml        coordinates, parameters, operations
  regen base robots/3rps.yaml        base parameters with their certificate
  regen check robots/3rps.yaml       an explanation of the mechanism
  regen verify robots/3rps.yaml      checks, and numerical base parameters
  regen verify --all                 independent checks of every robot
  regen generate                     every robot of the workspace
  regen generate --check             is generated/ what regen would write?
  regen eval robots/3rps.yaml --states states.json --format json
  regen import arm.urdf --out arm.yaml   a URDF, SDF, MJCF or USD file as a spec
  regen excite robots/3rps.yaml --out t.json   an exciting trajectory
  regen inspect log.csv              its columns, rate, noise and period
  regen identify robots/3rps.yaml log.csv --fourier 0.1333,11 --out p.json
  regen validate robots/3rps.yaml p.json other.csv --fourier 0.1333,11
  regen simulate robots/3rps.yaml --trajectory t.json --out log.csv
  regen rehearse robots/3rps.yaml --trajectory t.json --noise 1e-5,0.5
  regen calibrate robots/3rps.yaml poses.yaml   its geometry, from poses
  regen view robots/3rps.yaml --out 3rps.html   the mechanism in 3D
  regen serve robots/3rps.yaml       edit it in a browser, results as you type

A spec that does not parse is explained with line, column and what is allowed.
It has at most 256 coordinates, 384 bodies, 640 equations of cuts and couplings,
and 1 MiB of text.
Results are cached in the user's cache folder, by the digests of the spec and of
this program; REGEN_CACHE names another folder, or is `off`.
Results go to standard output, messages to standard error. Colour is used only
on a terminal, and never when NO_COLOR is set.";

fn after_help() -> String {
    format!("{EXAMPLES}\n\n{EXIT_CODES}")
}

/// Parses the command line. Exits the process if it asks for help or is malformed.
///
/// # Errors
///
/// When the first word is neither a command nor a file; the nearest command is the hint.
pub(crate) fn parse() -> Result<Cli, Failure> {
    let command = with_negative_numbers(Cli::command());
    let words: Vec<OsString> = std::env::args_os().collect();
    if let Some(word) = words.get(1).and_then(|word| word.to_str())
        && let Some(why) = unknown_command(&command, word)
    {
        return Err(Failure::Usage(why));
    }
    let parsed = command.get_matches_from(&words);
    let mut cli =
        Cli::from_arg_matches(&parsed).map_err(|error| Failure::Usage(error.to_string()))?;
    cli.check(&parsed)?;
    match &mut cli.command {
        Some(Command::Identify(args)) => args.report.command = Some(command_line(&words)),
        Some(Command::Report(args)) => args.command = Some(command_line(&words)),
        _ => {}
    }
    Ok(cli)
}

/// The command line, quoted for a shell. The program and absolute paths are written without their
/// folders, so that a report is the same wherever its files are.
fn command_line(words: &[OsString]) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./=,:@%+".contains(c);
    let quoted = words.iter().skip(1).map(|word| {
        let path = std::path::Path::new(word);
        let name = path.file_name().filter(|_| path.is_absolute());
        let word = name.unwrap_or(word).to_string_lossy();
        if !word.is_empty() && word.chars().all(plain) {
            word.into_owned()
        } else {
            format!("'{}'", word.replace('\'', r"'\''"))
        }
    });
    let words: Vec<String> = std::iter::once("regen".to_owned()).chain(quoted).collect();
    words.join(" ")
}

/// Parses the words of a command, of which the first is the command's name; never exits the process.
///
/// # Errors
///
/// When clap refuses the words, or they ask for help.
pub(crate) fn parse_words(words: &[OsString]) -> Result<Cli, Failure> {
    let name = OsString::from("regen");
    let parsed = with_negative_numbers(Cli::command())
        .try_get_matches_from(std::iter::once(&name).chain(words))
        .and_then(|parsed| Ok((Cli::from_arg_matches(&parsed)?, parsed)));
    let (mut cli, parsed) =
        parsed.map_err(|error| Failure::Usage(error.to_string().trim_end().to_owned()))?;
    cli.check(&parsed)?;
    Ok(cli)
}

impl Cli {
    /// Checks that every option has an effect and that no file is written that is read or written too, and
    /// tells the reading of logs, which an experiment file may name, what is written.
    fn check(&mut self, parsed: &clap::ArgMatches) -> Result<(), Failure> {
        effects::require_effect(parsed)?;
        let outputs = apart::outputs(parsed)?;
        let reading = match &mut self.command {
            Some(Command::Observe(args)) => &mut args.reading,
            Some(Command::Identify(args)) => &mut args.reading,
            Some(Command::Validate(args)) => &mut args.reading,
            Some(Command::Inspect(args)) => &mut args.reading,
            Some(Command::Rehearse(args)) => &mut args.reading,
            Some(Command::Report(args)) => &mut args.reading,
            _ => return Ok(()),
        };
        reading.outputs = outputs;
        Ok(())
    }
}

/// The error message for a first word that looks like a command but is neither a command nor a
/// file; `None` for any other word.
fn unknown_command(command: &clap::Command, word: &str) -> Option<String> {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    let looks = word.starts_with(|c: char| c.is_ascii_alphabetic()) && word.chars().all(plain);
    if !looks || word == "help" || command.find_subcommand(word).is_some() || exists(word) {
        return None;
    }
    let known = command.get_subcommands().map(clap::Command::get_name);
    let near = match nearest(word, known) {
        Some(near) => format!("did you mean '{near}'?"),
        None => "`regen --help` lists the commands".to_owned(),
    };
    Some(format!("there is no command and no file '{word}'; {near}"))
}

fn exists(word: &str) -> bool {
    std::path::Path::new(word).exists()
}

/// Lets every option take a negative number, so that invalid ones are rejected with a message that
/// says why, and not by clap as an unknown option.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    let takes = |arg: clap::Arg| {
        let values = arg.get_action().takes_values() && !arg.is_positional();
        arg.allow_negative_numbers(values)
    };
    let command = command.mut_args(takes);
    command.mut_subcommands(|sub| sub.mut_args(takes))
}

/// Dynamics of robots with closed loops, from a YAML spec to specialised Rust
///
/// `regen FILE` derives the robot, prints a summary, writes the source of its
/// module and verifies it at random closed states.
#[derive(Debug, Parser)]
#[command(
    name = "regen",
    version,
    max_term_width = 80,
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    arg_required_else_help = true,
    after_help = after_help()
)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Option<Command>,
    #[command(flatten)]
    pub(crate) model: ModelArgs,
    /// Neither read nor write the cache of derived robots
    #[arg(long, global = true, hide_short_help = true)]
    pub(crate) no_cache: bool,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Write a commented spec to begin with
    New(NewArgs),
    /// Write the source of every robot, or check that it is up to date
    Generate(GenerateArgs),
    /// Print a robot's coordinates, parameters, cuts and operation counts
    Info(InfoArgs),
    /// Print the base parameters with their certificate
    Base(BaseArgs),
    /// Write equations with named terms, as text, LaTeX or SymPy
    Equations(EquationsArgs),
    /// Explain a mechanism: mobility, loops, how its bodies move, which parameters
    /// cannot be identified and why
    Check(CheckArgs),
    /// Check a robot against itself and its base parameters against SVD and QR
    Verify(VerifyArgs),
    /// Evaluate closure and regressor at given states
    Eval(EvalArgs),
    /// Convert a URDF, SDF, MJCF or USD file to a spec
    Import(ImportArgs),
    /// Write identified parameters into a URDF, SDF, MJCF or USD file
    Export(ExportArgs),
    /// Find an exciting trajectory within the robot's limits
    Excite(ExciteArgs),
    /// Find a mechanism's geometry from poses that were measured, or what they can tell
    Calibrate(CalibrateArgs),
    /// Describe logs and predict what they can identify, before any fit
    Inspect(Box<InspectArgs>),
    /// Reduce logs to a factor file, for `identify --from`
    Observe(ObserveArgs),
    /// Identify base parameters from logs or factor files
    Identify(Box<IdentifyArgs>),
    /// Predict the forces of logs from identified parameters
    Validate(ValidateArgs),
    /// Write a page with tables and figures of an identified model
    Report(ReportArgs),
    /// Simulate the robot under control, with friction and noise, and write its log
    Simulate(SimulateArgs),
    /// Identify from simulated runs, and score how often the known true parameters
    /// are found
    Rehearse(Box<RehearseArgs>),
    /// Write a page that shows the mechanism in 3D
    View(ViewArgs),
    /// Edit a spec in a browser on this machine; mistakes, view and tables update as
    /// you type
    Serve(ServeArgs),
    /// Print the JSON Schema of specs, of experiment files, or of what a command
    /// prints as JSON
    #[command(
        after_help = "Examples:\n  regen schema > spec.schema.json\n  regen schema experiment\n  regen schema --of identify"
    )]
    Schema {
        /// The kind of file
        #[arg(value_enum, default_value_t)]
        of: SchemaArg,
        /// The command whose `--format json` is described; `model` for `regen FILE`
        #[arg(
            long = "of",
            value_name = "COMMAND",
            conflicts_with = "of",
            value_parser = PossibleValuesParser::new(Document::ALL.iter().map(|d| d.name()))
        )]
        printed: Option<String>,
    },
    /// Print a manual page, of regen or of one of its commands
    #[command(
        after_help = "Examples:\n  regen man | man -l -\n  regen man identify > regen-identify.1"
    )]
    Man {
        /// The command [default: regen itself]
        command: Option<String>,
    },
    /// Print a completion script, to be sourced by your shell
    #[command(after_help = "Example:\n  regen completions bash \\\n      \
        > ~/.local/share/bash-completion/completions/regen")]
    Completions {
        /// The shell to complete for
        shell: clap_complete::Shell,
    },
}

impl Command {
    /// Whether the command may use cached derivations. It may not if its result is evidence for the
    /// derivation itself, or source that others build.
    pub(crate) fn may_use_cache(&self) -> bool {
        !matches!(self, Self::New(_) | Self::Generate(_) | Self::Verify(_))
    }
}

/// The kind of file that a schema describes
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum SchemaArg {
    /// The description of a robot
    #[default]
    Spec,
    /// How logs are read
    Experiment,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_help_are_not_broken_anew() {
        let cli = Cli::command();
        let all = std::iter::once(&cli).chain(cli.get_subcommands());
        for command in all {
            let Some(help) = command.get_after_help() else {
                continue;
            };
            for line in help.to_string().lines() {
                let name = command.get_name();
                assert!(
                    line.chars().count() <= crate::table::WIDTH,
                    "{name}: {line}"
                );
            }
        }
    }

    #[test]
    fn options_of_estimation_do_not_stand_under_the_headings_of_others() {
        let cli = Cli::command();
        for command in cli.get_subcommands() {
            let own = ["format", "out", "huber", "confidence", "cross"];
            for arg in command.get_arguments() {
                if own.contains(&arg.get_id().as_str()) {
                    // `rehearse` has those of identification under a heading of their own
                    let heading = arg.get_help_heading();
                    let fits = heading.is_none_or(|h| h.starts_with("Identifying"));
                    assert!(fits, "{} {}: {heading:?}", command.get_name(), arg.get_id());
                }
            }
        }
    }
}
