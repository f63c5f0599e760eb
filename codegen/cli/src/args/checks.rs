//! The options of `check` and `verify`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::Format;

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
