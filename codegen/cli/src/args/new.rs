//! The options of `new`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::Format;

/// The robot that the new spec describes
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Kind {
    /// An arm: joints one after the other
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
The file describes a complete robot, with a comment at every place where
mistakes are common: the convention of Denavit-Hartenberg rows, the frames of
cut joints, the purpose of home. An existing file is never replaced. --from-dh
makes an arm from a table with one line per joint and the columns alpha, a,
theta, d, and optionally joint, type, min, max; units are in brackets, as in
`alpha [deg]`.

Examples:
  regen new my_arm --kind serial
  regen new my_arm --from-dh table.csv --classic
  regen new picker --kind parallel --out robots/picker.yaml")]
pub(crate) struct NewArgs {
    /// The robot's name: lower case, digits and _
    pub(crate) name: String,
    /// The robot that the spec describes at first
    #[arg(long, value_enum, required_unless_present = "from_dh")]
    pub(crate) kind: Option<Kind>,
    /// A serial arm from a table of Denavit and Hartenberg parameters (CSV)
    #[arg(long, value_name = "TABLE", conflicts_with = "kind")]
    pub(crate) from_dh: Option<PathBuf>,
    /// The table has classic rows, Rz Tz Tx Rx, instead of modified ones
    #[arg(long, requires = "from_dh")]
    pub(crate) classic: bool,
    /// Where the spec is written [default: NAME.yaml in the current directory]
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
}
