//! The options of `new`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::Format;

/// What the new spec describes, to begin with
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Kind {
    /// An arm: joints one after the other
    Serial,
    /// A loop in a plane: two limbs that meet
    Planar,
    /// A platform on legs
    Parallel,
    /// An arm whose motors move its joints through gears, belts or a differential
    Drives,
}

#[derive(Debug, Args)]
#[command(after_help = "\
The file is a complete robot that regen derives, with a comment at every place
where specs go wrong: which Denavit-Hartenberg rows, frames of cut joints, what
home is for. It never replaces a file.

Examples:
  regen new my_arm --kind serial
  regen new picker --kind parallel --out robots/picker.yaml")]
pub(crate) struct NewArgs {
    /// The robot's name: lower case, digits and _
    pub(crate) name: String,
    /// What it describes, to begin with
    #[arg(long, value_enum)]
    pub(crate) kind: Kind,
    /// Where it is written [default: NAME.yaml here]
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
}
