//! The options of `regen report` and of `regen identify --report`.

use std::path::PathBuf;

use clap::{Args, ValueHint};

use super::reading::{ReadingArgs, run};
use regen_identify::data::Run;

#[derive(Clone, Debug, Args)]
#[command(after_help = "\
The page shows the model and its base parameters, how the logs are read and why,
the motion and its limits, measured and predicted forces with the rows that are
missing and the outliers, the parameters with their standard deviations,
friction, the singular values of the regressor with the certificate of the base
parameters, and the errors on every log. It is one file that needs no network,
and can be printed.

Examples:
  regen report robots/3rps.yaml p.json run1.csv --fourier 0.1333,11 \\
      --against run2.csv --out report.html --figures figures")]
pub(crate) struct ReportArgs {
    /// The robot's spec
    pub(crate) file: PathBuf,
    /// The parameters that `regen identify --out` wrote
    pub(crate) params: PathBuf,
    /// The logs that it was identified from, or an experiment file; forces are
    /// shown for the first
    #[arg(required = true, value_name = "LOG", value_parser = run(), value_hint = ValueHint::AnyPath)]
    pub(crate) logs: Vec<Run>,
    /// Where the page is written
    #[arg(long, value_name = "HTML")]
    pub(crate) out: PathBuf,
    /// Logs that were not used for identification
    #[arg(long, value_name = "LOG", num_args = 1.., value_parser = run(), value_hint = ValueHint::AnyPath)]
    pub(crate) against: Vec<Run>,
    /// Write each figure as an SVG file into this folder
    #[arg(long, value_name = "DIR", hide_short_help = true)]
    pub(crate) figures: Option<PathBuf>,
    /// The command line as a shell reads it, which the page shows.
    #[arg(skip)]
    pub(crate) command: Option<String>,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
}

/// The options of `regen identify` that ask for a report.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Report")]
pub(crate) struct ReportOptions {
    /// Write a page with tables and figures of the result, and of the logs of
    /// --against; see `regen report`
    #[arg(long, value_name = "HTML", conflicts_with = "from")]
    pub(crate) report: Option<PathBuf>,
    /// Write each figure of the page as an SVG file into this folder
    #[arg(long, value_name = "DIR", requires = "report", hide_short_help = true)]
    pub(crate) figures: Option<PathBuf>,
    /// The command line as a shell reads it, which the page shows.
    #[arg(skip)]
    pub(crate) command: Option<String>,
}
