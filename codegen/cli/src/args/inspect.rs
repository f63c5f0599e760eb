//! The options of `regen inspect`.

use std::path::PathBuf;

use clap::{Args, ValueHint};

use super::format::Format;
use super::reading::{ReadingArgs, run};
use regen_identify::data::Run;

#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Says what each column may be, by its name, its unit, and by what is a derivative
of what; rate, jitter and gaps; steps of encoders, rests and saturation; spectra
with the frequency where the signal meets the noise; the period; which joint
each effort follows, with which sign and how late. Logs need no header, and no
option is needed for a first look.

With --spec, columns are matched with the robot's coordinates, and before any
fit it says how well each base parameter will be determined: its standard
deviation at the noise of the efforts, in percent of the nominal value where the
spec has one; what stays unseen; and which joint would have to move how. Without
--butterworth, --local, --fourier or an experiment file, the proposed filter is
used.

--out writes what was found as a first experiment file for `regen identify`.

Examples:
  regen inspect run.csv
  regen inspect run.csv --spec arm.yaml --report page.html --out runs.yaml
  regen inspect runs.yaml --spec arm.yaml --format json")]
pub(crate) struct InspectArgs {
    /// Logs, or an experiment file, YAML; a robot's spec may stand before them
    #[arg(required = true, value_name = "LOG", value_parser = run(), value_hint = ValueHint::AnyPath)]
    pub(crate) logs: Vec<Run>,
    /// The robot's spec
    #[arg(long, value_name = "SPEC")]
    pub(crate) spec: Option<PathBuf>,
    /// Write a first experiment file; one that exists is left as it is
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
