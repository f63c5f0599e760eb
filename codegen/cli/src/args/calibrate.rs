//! The options of `regen calibrate`.

use std::path::PathBuf;

use clap::{Args, ValueHint};

use super::format::Format;
use super::reading::count;

#[derive(Clone, Debug, Args)]
#[command(after_help = "\
FILE is an experiment file with the key `calibrate`, which says what is measured
at each pose: poses or points of frames, distances, planes that are touched, the
direction of gravity. Each row of its runs is a pose at rest, with the readings
of the coordinates; coordinates with columns beyond the mechanism's freedoms are
measurements too, and alone they calibrate a loop that has them.

Every placement of a joint, a cut and an observed frame has six errors: alpha,
a, theta, d and beta and b about and along y (Hayati) where a
Denavit-Hartenberg row states it, x, y, z, rx, ry and rz at its end elsewhere.
--unknown chooses among them, the names of `geometry`, q3.scale: what the
reading of q3 is multiplied by, the ratio of a gear or the scale of an encoder,
and q3.compliance: how far q3 yields to the effort that holds the robot, which
follows from the values of SPEC. A * stands for any part of a name without dots.
Errors that cannot be told apart are found as one: the table says which of them
stand for others, and why others stay at their nominal values. Where instruments
stand is found too. --geometry writes names of `geometry` in their places,
errors of joints as fixed joints before them, and those of cuts and frames
there.

Without runs in FILE, only what such measurements can tell is printed.
--simulate writes poses to try it with; sensors whose noise FILE does not state
have 0.05 mm and 0.1 mrad.

Examples:
  regen calibrate arm.yaml poses.yaml
  regen calibrate arm.yaml poses.yaml --simulate poses.csv --poses 60
  regen calibrate delta.yaml probe.yaml --unknown a,b,q1.theta
  regen calibrate arm.yaml poses.yaml --unknown 'q*,q*.compliance'
  regen calibrate delta.yaml probe.yaml --unknown a,b --geometry new.yaml")]
pub(crate) struct CalibrateArgs {
    /// The robot's spec
    pub(crate) spec: PathBuf,
    /// An experiment file, YAML, with the key `calibrate`
    #[arg(value_hint = ValueHint::FilePath)]
    pub(crate) file: PathBuf,
    /// What is unknown: names of `geometry`, errors such as q3.alpha, or what such names begin with
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) unknown: Vec<String>,
    /// The folder of the logs in FILE [default: that of FILE]
    #[arg(long = "logs", value_name = "FOLDER")]
    pub(crate) folder: Option<PathBuf>,
    /// The level of the confidence intervals [default: 0.95]
    #[arg(long, value_name = "LEVEL", conflicts_with = "simulate")]
    pub(crate) confidence: Option<f64>,
    /// Write the spec with the geometry that was found; its comments stay
    #[arg(long, value_name = "YAML")]
    pub(crate) geometry: Option<PathBuf>,
    /// Write a page with the residuals before and after, the poses and what was found
    #[arg(long, value_name = "HTML")]
    pub(crate) report: Option<PathBuf>,
    /// Write simulated poses of a mechanism with errors instead, in the columns that FILE names, and
    /// print the true values
    #[arg(long, value_name = "CSV", conflicts_with_all = ["geometry", "report", "folder"])]
    pub(crate) simulate: Option<PathBuf>,
    /// The number of simulated poses
    #[arg(long, value_name = "N", default_value_t = 60, requires = "simulate", value_parser = count::<1, 100_000>)]
    pub(crate) poses: usize,
    /// The deviation of the simulated errors, rad and m; of compliances, of what the largest effort does
    #[arg(
        long,
        value_name = "SIZE",
        default_value_t = 1e-3,
        requires = "simulate"
    )]
    pub(crate) perturb: f64,
    /// The seed of simulated errors and noise
    #[arg(long, value_name = "N", default_value_t = 1, requires = "simulate")]
    pub(crate) seed: u64,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
}
