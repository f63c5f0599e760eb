//! The output formats of the commands.

use clap::ValueEnum;

/// How results are printed
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// Tables of at most 80 columns
    #[default]
    Human,
    /// JSON, numbers in the shortest form that reads back to the same double
    Json,
}
