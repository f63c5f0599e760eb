//! The options of `generate`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::Format;

/// A language that robots are written in
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum TargetArg {
    /// A module, generic over the type of numbers
    #[default]
    Rust,
    /// A header and a source in C99, on double and on float
    C,
    /// As c, and a source with functions for casadi.external
    Casadi,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Without FILES, every robots/*.yaml of the workspace is generated into its
generated/src, and modules of robots that no longer exist are removed. The
workspace is the nearest parent directory with both robots/ and generated/src/.

If DIR has a lib.rs or mod.rs with the two lines
  // <regen modules>
  // </regen modules>
the list of modules between them is kept up to date.

If the directory above DIR has a sources.txt with one robot's name per line,
only the modules of these robots are written. digests.txt beside it records the
others: lines, SHA-256 and the operations of each function.

With --target c each robot has two files in C99, NAME.h and NAME.c, with
functions on double and, with names that end in _f, on float; they are written
to the current directory, or to DIR. With --target casadi there is a third,
NAME_casadi.c: functions of the independent coordinates with exact Jacobians,
which casadi.external finds in the shared library of the files.

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
    /// C and CasADi the current directory]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// How the list of files is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
}
