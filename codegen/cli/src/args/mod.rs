//! The command line: commands, options and the help text that clap prints of them.

mod equations;
mod excite;
mod format;
mod identify;
mod inspect;
mod physical;
mod reading;
mod rehearse;
mod report;
mod simulate;
mod view;

use std::ffi::OsString;
use std::path::PathBuf;

use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};
use regen_codegen::spec::nearest;

pub(crate) use equations::{EquationsArgs, OfArg, ParametersArg, StyleArg};
pub(crate) use excite::{CriterionArg, ExciteArgs};
pub(crate) use format::Format;
pub(crate) use identify::{EstimatorArg, IdentifyArgs, ObserveArgs, ValidateArgs, WeightingArg};
pub(crate) use inspect::InspectArgs;
pub(crate) use physical::{PhysicalArgs, PriorArg};
pub(crate) use reading::{
    DelayArg, PayloadArg, ProblemsArg, ReadingArgs, StandstillArg, VelocitiesArg,
};
pub(crate) use rehearse::{RehearseArgs, SolvingArgs, UnmodelledArg};
pub(crate) use report::ReportArgs;
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
  130  interrupted; no file is left half written";

const EXAMPLES: &str = "\
Examples:
  regen new my_arm --kind serial     a commented spec to begin with
  regen robots/3rps.yaml             derive, write the source, verify it
  regen info robots/3rps.yaml        coordinates, parameters, operations
  regen base robots/3rps.yaml        base parameters with their certificate
  regen check robots/3rps.yaml       the mechanism in words
  regen verify robots/3rps.yaml      every check, and the numeric path beside it
  regen verify --all                 the evidence for every robot, as a table
  regen generate                     every robot of the workspace
  regen generate --check             is generated/ what regen would write?
  regen eval robots/3rps.yaml --states states.json --format json
  regen import arm.urdf --out arm.yaml   a URDF or MJCF file as a spec
  regen excite robots/3rps.yaml --out t.json   a trajectory to identify from
  regen inspect log.csv              what its columns are, rate, noise, period
  regen identify robots/3rps.yaml log.csv --fourier 0.1333,11 --out p.json
  regen validate robots/3rps.yaml p.json other.csv --fourier 0.1333,11
  regen simulate robots/3rps.yaml --trajectory t.json --out log.csv
  regen rehearse robots/3rps.yaml --trajectory t.json --noise 1e-5,0.5
  regen view robots/3rps.yaml --out 3rps.html   the mechanism in 3D

A spec that does not parse is explained with line, column and what is allowed.
It has at most 256 coordinates, 384 bodies, 640 equations of cuts and couplings,
and 1 MiB of text.
What was derived is kept in the user's cache folder, by the digests of the spec
and of this program; REGEN_CACHE names another folder, or is `off`.
Results go to standard output, messages to standard error. Colour is used only
on a terminal, and never when NO_COLOR is set.";

fn after_help() -> String {
    format!("{EXAMPLES}\n\n{EXIT_CODES}")
}

/// Parses the command line. Ends the process where it asks for help or is malformed.
///
/// # Errors
///
/// A first word that is neither a command nor a file, with the nearest command as a hint.
pub(crate) fn parse() -> Result<Cli, Failure> {
    let command = with_negative_numbers(Cli::command());
    let words: Vec<OsString> = std::env::args_os().collect();
    if let Some(word) = words.get(1).and_then(|word| word.to_str())
        && let Some(why) = unknown_command(&command, word)
    {
        return Err(Failure::Usage(why));
    }
    let parsed = command.get_matches_from(words);
    Cli::from_arg_matches(&parsed).map_err(|error| Failure::Usage(error.to_string()))
}

/// Parses the words of a command, the first being the command's name; never ends the process.
///
/// # Errors
///
/// Words that clap refuses, also those that ask for help.
pub(crate) fn parse_words(words: &[OsString]) -> Result<Cli, Failure> {
    let name = OsString::from("regen");
    let command = with_negative_numbers(Cli::command());
    command
        .try_get_matches_from(std::iter::once(&name).chain(words))
        .and_then(|parsed| Cli::from_arg_matches(&parsed))
        .map_err(|error| Failure::Usage(error.to_string().trim_end().to_owned()))
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

/// Lets every option take a negative number, so that the code that knows the option's meaning, and
/// not clap, rejects it where it is wrong.
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
    /// Derive anew, and keep nothing of it for later runs
    #[arg(long, global = true)]
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
    /// Print the base parameters and what is certain about them
    Base(BaseArgs),
    /// Write equations with named terms, as text, LaTeX or SymPy
    Equations(EquationsArgs),
    /// Explain a mechanism in words: mobility, loops, how its bodies move, which
    /// parameters cannot be identified and why
    Check(CheckArgs),
    /// Check a robot against itself and its base parameters against SVD and QR
    Verify(VerifyArgs),
    /// Evaluate closure and regressor at given states
    Eval(EvalArgs),
    /// Turn a URDF or MJCF file into a spec
    Import(ImportArgs),
    /// Write identified parameters back into a robot file of your own
    Export(ExportArgs),
    /// Seek an exciting trajectory within the robot's limits
    Excite(ExciteArgs),
    /// Say what logs hold, and what they can identify, before anything is fitted
    Inspect(Box<InspectArgs>),
    /// Reduce logs to a factor file, to be merged by `identify --from`
    Observe(ObserveArgs),
    /// Identify base parameters from logs or factor files
    Identify(Box<IdentifyArgs>),
    /// Predict the forces of logs from identified parameters
    Validate(ValidateArgs),
    /// Show what was identified on one page, with tables and figures
    Report(ReportArgs),
    /// Run the robot under control, with friction and noise, and log what it does
    Simulate(SimulateArgs),
    /// Identify simulated runs of known parameters, and score how often these are
    /// found
    Rehearse(Box<RehearseArgs>),
    /// Show the mechanism in 3D, on one page for a browser
    View(ViewArgs),
    /// Print the JSON Schema of specs or experiment files, for editors
    Schema {
        /// The kind of file
        #[arg(value_enum, default_value_t)]
        of: SchemaArg,
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
    /// Whether robots that were derived before may be used: not by commands whose result is
    /// evidence of the derivation itself, or source that others build.
    pub(crate) fn may_use_kept(&self) -> bool {
        !matches!(self, Self::New(_) | Self::Generate(_) | Self::Verify(_))
    }
}

/// What the new spec describes, to begin with
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Kind {
    /// An arm: joints one behind the other
    Serial,
    /// A loop in a plane: two limbs that meet
    #[value(alias = "fivebar")]
    Planar,
    /// A platform on legs
    Parallel,
    /// Three cranks whose rods carry a platform that stays level
    Delta,
    /// A platform on six struts
    Stewart,
    /// An arm whose motors move its joints through gears, belts or a differential
    Drives,
}

#[derive(Debug, Args)]
#[command(after_help = "\
The file is a complete robot that regen derives, with a comment at every place
where specs go wrong: which Denavit-Hartenberg rows, frames of cut joints, what
home is for. It never replaces a file. --from-dh makes an arm of a table with a
line for each joint under the names alpha, a, theta, d, and where wanted joint,
type, min, max; units in brackets, as in `alpha [deg]`.

Examples:
  regen new my_arm --kind serial
  regen new my_arm --from-dh table.csv --classic
  regen new picker --kind parallel --out robots/picker.yaml")]
pub(crate) struct NewArgs {
    /// The robot's name: lower case, digits and _
    pub(crate) name: String,
    /// What it describes, to begin with
    #[arg(long, value_enum, required_unless_present = "from_dh")]
    pub(crate) kind: Option<Kind>,
    /// A serial arm from a table of Denavit and Hartenberg parameters (CSV)
    #[arg(long, value_name = "TABLE", conflicts_with = "kind")]
    pub(crate) from_dh: Option<PathBuf>,
    /// The table has classic rows, Rz Tz Tx Rx, instead of modified ones
    #[arg(long, requires = "from_dh")]
    pub(crate) classic: bool,
    /// Where it is written [default: NAME.yaml here]
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
}

#[derive(Debug, Args)]
pub(crate) struct ModelArgs {
    /// The robot's spec
    #[arg(required = true)]
    pub(crate) file: Option<PathBuf>,
    /// Where the module is written [default: generated/src of the workspace
    /// that holds FILE, or else the current directory]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// How the summary is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
}

/// A language that robots are written in
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum TargetArg {
    /// A module, generic over the type of numbers
    #[default]
    Rust,
    /// A header and a source in C99, on double and on float
    C,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Without FILES, every robots/*.yaml of the workspace is generated into its
generated/src, and modules whose robot is gone are removed. The workspace is the
nearest directory upward that holds both robots/ and generated/src/.

If DIR has a lib.rs or mod.rs with the two lines
  // <regen modules>
  // </regen modules>
the list of modules between them is kept up to date.

If the directory above DIR has a sources.txt, a robot's name per line, modules
of these robots alone are written. Of the others digests.txt beside it says what
they would be: lines, SHA-256 and the operations of each function.

With --target c a robot's functions are two files, NAME.h and NAME.c, in C99
with functions on double and, ending in _f, on float; they are written to the
current directory, or to DIR.

Examples:
  regen generate
  regen generate --check
  regen generate my_arm.yaml --out src/robots
  regen generate my_arm.yaml --target c --out firmware/src")]
pub(crate) struct GenerateArgs {
    /// Specs to generate [default: robots/*.yaml of the workspace]
    pub(crate) files: Vec<PathBuf>,
    /// Write nothing; report every file that differs, is missing or is stale,
    /// and exit with 1 if there is one
    #[arg(long)]
    pub(crate) check: bool,
    /// The language of the files
    #[arg(long, value_enum, default_value_t)]
    pub(crate) target: TargetArg,
    /// Where the files are written [default: generated/src of the workspace; for
    /// C the current directory]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// How the list of files is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  regen info robots/3rps.yaml
  regen info robots/3rps.yaml --format json

The JSON has robot, coordinates, independent, dof, parameters, cuts and
operations; the operations are those of the regressor.")]
pub(crate) struct InfoArgs {
    /// The robot's spec
    pub(crate) file: PathBuf,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
}

#[derive(Debug, Args)]
#[command(after_help = "\
IN is a JSON list. A state is given either over all coordinates, in the order
that `regen info` prints, and is then used as it is:
  [{\"q\": [0.1, ...], \"qd\": [...], \"qdd\": [...]}]
or over the independent ones, and the others are solved from `home`:
  [{\"independent\": {\"q\": [0.6, 0.6, 0.6], \"qd\": [0, 0, 0], \"qdd\": [0, 0, 0]}}]

The JSON result is a list of q, qd, qdd, residual, jacobian, bias, regressor
and base_regressor, one object per state.

Examples:
  regen eval robots/3rps.yaml --states states.json
  cat states.json | regen eval robots/3rps.yaml --states - --format json")]
pub(crate) struct EvalArgs {
    /// The robot's spec
    pub(crate) file: PathBuf,
    /// The states, a JSON file; `-` reads standard input
    #[arg(long, value_name = "IN")]
    pub(crate) states: PathBuf,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
}

/// How base parameters are printed
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum TableFormat {
    /// A table of 80 columns
    #[default]
    Human,
    /// A Markdown table
    Markdown,
    /// A LaTeX longtable, for the packages array, booktabs and longtable
    Latex,
    /// Comma-separated values
    Csv,
    /// JSON with expressions and numbers
    Json,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Each row is a kept parameter plus multiples of eliminated ones. `derived` rows
are exact consequences of the spanning trees of the mechanism; `completed` rows
were recognised in samples of many digits and verified at others. The
certificate is the rank of such samples: where it differs from what was derived,
the table is headed INCOMPLETE and the exit code is 1.

Coefficients of more than 60 characters, or with numbers of more than 6 digits,
are printed as numbers marked with ~.

Examples:
  regen base robots/3rps.yaml
  regen base robots/3rps.yaml --numbers
  regen base robots/3rps.yaml --format latex > table1.tex")]
pub(crate) struct BaseArgs {
    /// The robot's spec
    pub(crate) file: PathBuf,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: TableFormat,
    /// Coefficients as numbers of four digits
    #[arg(long, conflicts_with = "expressions")]
    pub(crate) numbers: bool,
    /// Coefficients as expressions, however long
    #[arg(long)]
    pub(crate) expressions: bool,
    /// Keep the result beside the spec, as NAME.base: robot_model! then reads it
    /// instead of deriving it in an unoptimised build
    #[arg(long)]
    pub(crate) store: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Says in words how the mechanism is understood: coordinates and mobility, what
each loop passes and which of its rows are redundant, how each body can move,
relations among coordinates and orientations on the assembly branch of home,
parameters that cannot be identified, alone or at all, and why, and where limits
and singularities trouble the numbers.

What joints and ties prove is marked as shown exactly; the rest is judged at
closed states in many digits, and says at how many and to how many digits.

Examples:
  regen check robots/3rps.yaml
  regen check robots/3rps.yaml --format json")]
pub(crate) struct CheckArgs {
    /// The robot's spec
    pub(crate) file: PathBuf,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Runs the checks of `regen FILE`, and the numeric path to the base parameters
(Gautier, 1991) beside the analytic one: the regressor over random closed
states, its columns scaled to unit length, by singular values and by a QR
decomposition with pivoting. The numeric rank is where the numbers drop most;
where double precision leaves a doubt, that is said and does not count.

With --all, the evidence: checks that share no code with what they check, each
with a bound that is computed from roundoff, operations and condition numbers.
FILES may then be several, or directories of *.yaml; without any, robots/*.yaml
of the workspace. Vectors of another program are looked for beside each spec, as
vectors/NAME.json, then in tests/fixtures/vectors of the workspace;
tests/tools/vectors/forces.py makes them with Pinocchio.

Examples:
  regen verify robots/3rps.yaml
  regen verify robots/3rps.yaml --states 200 --format json
  regen verify --all
  regen verify --all my_arm.yaml
  regen verify --all robots --format markdown")]
pub(crate) struct VerifyArgs {
    /// The robot's spec; with --all any number of specs and directories
    #[arg(required_unless_present = "all")]
    pub(crate) files: Vec<PathBuf>,
    /// Every independent check, as a table with figures
    #[arg(long)]
    pub(crate) all: bool,
    /// Random closed states of the observation matrix [default: enough for
    /// four rows per column]
    #[arg(long, value_name = "N")]
    pub(crate) states: Option<usize>,
    /// How the result is printed; markdown with --all
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: VerifyFormat,
}

/// How checks are printed
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum VerifyFormat {
    /// Tables of at most 80 columns
    #[default]
    Human,
    /// A Markdown table of the bounds kept, the same on every machine
    Markdown,
    /// JSON
    Json,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Names, limits, inertias and friction are the file's; a coordinate is 0 where it
is 0 in the file. Meshes are not read. What was decided or left out is told on
standard error, with its place in the file.

Angles that print a multiple of pi are taken as such (1.5708 is pi/2), since
axes that are nearly parallel have other base parameters than parallel ones;
--exact keeps the digits.

A loop that the format cannot express is added with --cut: the joint at which it
is open, by its name, its type and a frame on each of two bodies,
  NAME:TYPE:BODY@x,y,z[,roll,pitch,yaw]:BODY@x,y,z[,roll,pitch,yaw]
TYPE is spherical, universal, revolute, prismatic, cylindrical or fixed, along
or about the frames' z axes. Bodies are the file's links, or world; frames are
in the links' frames, angles in radians (pi/2 is allowed). Without its frame the
second body has the first one's where the file's zero configuration has it.

Examples:
  regen import arm.urdf > robots/arm.yaml
  regen import gripper.xml --out robots/gripper.yaml
  regen import fourbar.urdf --actuated crank_joint --home crank_joint=pi/3 \\
      --cut pin:revolute:coupler@0.35,0,0:rocker@0.30,0,0")]
pub(crate) struct ImportArgs {
    /// The file, URDF or MJCF
    pub(crate) file: PathBuf,
    /// Where the spec is written [default: standard output]; a file that exists
    /// is left as it is
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Replace the file of --out where it exists
    #[arg(long, requires = "out")]
    pub(crate) force: bool,
    /// The spec's name [default: the robot's in the file]
    #[arg(long, value_name = "NAME")]
    pub(crate) name: Option<String>,
    /// Close a loop: NAME:TYPE:BODY@FRAME:BODY@FRAME (may be repeated)
    #[arg(long = "cut", value_name = "CUT", allow_hyphen_values = true)]
    pub(crate) cuts: Vec<String>,
    /// Joints with motors [default: those of the file's transmissions or
    /// actuators, or else all that follow no other]
    #[arg(long, value_name = "JOINTS", value_delimiter = ',')]
    pub(crate) actuated: Vec<String>,
    /// Where loops start to be closed, as NAME=VALUE [default: 0]
    #[arg(long, value_name = "VALUES", value_delimiter = ',')]
    pub(crate) home: Vec<String>,
    /// What the root stands on [default: what the file says; the world in URDF]
    #[arg(long, value_enum, value_name = "BASE")]
    pub(crate) base: Option<Base>,
    /// Keep angles as printed, also where they print a multiple of pi
    #[arg(long)]
    pub(crate) exact: bool,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
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

/// What an imported robot's root stands on
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Base {
    /// The world; a free joint there is left out
    Fixed,
    /// Nothing: three slides and a ball, without motors
    Floating,
}

#[derive(Debug, Args)]
#[command(after_help = "\
PARAMS is what `regen identify --feasible --out` wrote, or JSON or YAML (by its
name) with values as in `bodies:` of the spec, about the centre of mass in the
body's frame, and friction by joint; each part and each entry may be missing.
  {\"bodies\": {\"forearm\": {\"mass\": 2.3, \"com\": [0, 0, 0.2],
                           \"inertia\": [0.03, 0, 0, 0.03, 0, 0.004]}},
   \"joints\": {\"elbow\": {\"Fv\": 1.2, \"Fc\": 0.4}}}
Masses, centres of mass and inertias are moved into the frames of the file and
replace the numbers there; damping and friction likewise, of Fc+ and Fc- the
larger; in MJCF also J as armature and K as stiffness. Nothing else of the file
changes. What it has no place for is told. Values that no body can have are
refused.

Examples:
  regen export --urdf arm.urdf --spec robots/arm.yaml --parameters fit.json \\
      --out arm_identified.urdf")]
pub(crate) struct ExportArgs {
    /// The robot file, URDF or MJCF
    #[arg(long, visible_alias = "mjcf", value_name = "FILE")]
    pub(crate) urdf: PathBuf,
    /// The spec that the parameters belong to
    #[arg(long, value_name = "SPEC")]
    pub(crate) spec: PathBuf,
    /// The parameters, a JSON or YAML file
    #[arg(long, value_name = "PARAMS")]
    pub(crate) parameters: PathBuf,
    /// Where the file is written [default: standard output]
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
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
