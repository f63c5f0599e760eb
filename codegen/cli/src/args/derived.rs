//! The options of commands that print what was derived: `regen FILE`, `info`, `eval` and `base`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::Format;

#[derive(Debug, Args)]
pub(crate) struct ModelArgs {
    /// The robot's spec
    #[arg(required = true)]
    pub(crate) file: Option<PathBuf>,
    /// Where the module is written [default: generated/src of the workspace
    /// that contains FILE, or else the current directory]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// How the summary is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  regen info robots/3rps.yaml
  regen info robots/3rps.yaml --format json

The JSON has robot, coordinates, independent, home, dof, parameters, cuts and
operations; home is closed, the operations are those of the regressor.")]
pub(crate) struct InfoArgs {
    /// The robot's spec
    pub(crate) file: PathBuf,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
}

#[derive(Debug, Args)]
#[command(after_help = "\
IN is a JSON list. A state has either all coordinates, in the order that `regen
info` prints, and is used without change:
  [{\"q\": [0.1, ...], \"qd\": [...], \"qdd\": [...]}]
or the independent ones, and the others are solved for, starting from `home`:
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
    /// A LaTeX table of pages or columns, for the packages array, booktabs and xtab
    Latex,
    /// Comma-separated values
    Csv,
    /// JSON with expressions and numbers
    Json,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Each row is a kept parameter plus multiples of eliminated ones. `derived` rows
are exact consequences of the spanning trees of the mechanism; `proven` rows
were recognised in samples of many digits, and hold at exact random points for
all values of the names; `completed` rows were recognised and verified only. The
certificate is the rank of such samples: if it differs from the number of rows,
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
    /// Print coefficients as numbers of four digits
    #[arg(long, conflicts_with = "expressions")]
    pub(crate) numbers: bool,
    /// The table at another value of a name of `geometry`: NAME=VALUE (may be repeated)
    #[arg(long, value_name = "NAME=VALUE", conflicts_with = "store")]
    pub(crate) at: Vec<String>,
    /// Print coefficients as expressions, however long
    #[arg(long)]
    pub(crate) expressions: bool,
    /// Store the result beside the spec, as NAME.base: robot_model! then reads it
    /// instead of deriving it in an unoptimised build
    #[arg(long)]
    pub(crate) store: bool,
}
