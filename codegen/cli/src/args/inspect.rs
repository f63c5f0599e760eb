//! The options of `regen inspect`.

use std::path::PathBuf;

use clap::{Args, ValueHint};

use super::format::Format;
use super::reading::{ReadingArgs, run};
use regen_identify::data::Run;

#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Finds what each column contains, from its name, its unit, and which columns are
derivatives of others; rate, jitter and gaps; encoder steps, rests and
saturation; spectra with the frequency at which the noise exceeds the signal;
the period; and which joint each effort follows, with which sign and delay. Logs
need no header, and a first look needs no option.

With --spec, columns are matched with the robot's coordinates, and the result
predicts how well each base parameter will be determined: its standard deviation
at the noise of the efforts, in percent of the nominal value if the spec has
one; parameters that affect no effort; and which motion of which joint would
determine more. Without --butterworth, --local, --fourier or an experiment file,
the proposed filter is used. Where gains of drives are not known, there are no
percentages; runs with a payload are predicted only if all carry one.

--out writes these facts as a first experiment file for `regen identify`.

Examples:
  regen inspect run.csv
  regen inspect run.csv --spec arm.yaml --report page.html --out runs.yaml
  regen inspect runs.yaml --spec arm.yaml --format json")]
pub(crate) struct InspectArgs {
    /// Logs, or an experiment file, YAML; a robot's spec may precede them
    #[arg(required = true, value_name = "LOG", value_parser = run(), value_hint = ValueHint::AnyPath)]
    pub(crate) logs: Vec<Run>,
    /// The robot's spec
    #[arg(long, value_name = "SPEC")]
    pub(crate) spec: Option<PathBuf>,
    /// Write a first experiment file; an existing file is not replaced
    #[arg(long, value_name = "YAML")]
    pub(crate) out: Option<PathBuf>,
    /// Write a page with tables and figures
    #[arg(long, value_name = "HTML")]
    pub(crate) report: Option<PathBuf>,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
}
