//! The options of `check` and `verify`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::Format;
use super::reading::count;

#[derive(Debug, Args)]
#[command(after_help = "\
Explains how regen understands the mechanism: coordinates and mobility, the
joints of each loop and its redundant rows, how each body can move, relations
among coordinates and orientations on the assembly branch of home, parameters
that cannot be identified, alone or at all, and why, and where limits and
singularities degrade the numerical results.

Statements that follow from the joints and couplings are marked as exact; the
others are found at closed states in many digits, and state how many states and
digits were used.

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
Runs the checks of `regen FILE`, and compares the analytic base parameters with
numerical ones (Gautier, 1991): singular values, and a QR decomposition with
pivoting, of the regressor over random closed states, its columns scaled to unit
length. The numerical rank is at the largest drop of the singular values; if
double precision does not determine it, the table says so and it does not count.

With --all, runs checks that share no code with what they check, each with a
bound computed from roundoff, operations and condition numbers. FILES may then
be several specs, or directories of *.yaml; the default is robots/*.yaml of the
workspace. Test vectors of another program are read from vectors/NAME.json
beside each spec, or from tests/fixtures/vectors of the workspace;
tests/tools/vectors/forces.py makes them with Pinocchio.

Examples:
  regen verify robots/3rps.yaml
  regen verify robots/3rps.yaml --states 200 --format json
  regen verify --all
  regen verify --all my_arm.yaml
  regen verify --all robots --format markdown")]
pub(crate) struct VerifyArgs {
    /// The robot's spec; with --all any number of specs and directories, whose
    /// experiment files are left out
    #[arg(required_unless_present = "all")]
    pub(crate) files: Vec<PathBuf>,
    /// Run every independent check, and print a table of errors and bounds
    #[arg(long)]
    pub(crate) all: bool,
    /// Random closed states of the observation matrix [default: enough for
    /// four rows per column]
    #[arg(long, value_name = "N", value_parser = count::<0, 1_000_000>)]
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
    /// A Markdown table of the bounds that hold, the same on every machine
    Markdown,
    /// JSON
    Json,
}
