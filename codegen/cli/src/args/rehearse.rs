//! The options of `regen rehearse`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, ValueHint};
use regen_identify::data::Run;
use regen_identify::intervals::DEFAULT_DRAWS;

use super::format::Format;
use super::identify::{EstimatorArg, WeightingArg};
use super::physical::{PriorArg, draws, value};
use super::reading::{ReadingArgs, count, run};
use super::simulate::TwinArgs;

#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Draws true parameters once (--perturb, --seed). Then, for each seed, simulates
the runs as `regen simulate` does, identifies from their logs as `regen
identify` does with the same options, and compares every base parameter with the
truth. The seeds differ in the noise. The table has for each parameter the
truth, the mean estimate, the rms error and the mean sigma in percent of the
truth, the percentages of seeds whose interval contains the truth and whose
error is within 3 sigma, and the mean error in mean sigmas; ! marks intervals
that contain the truth less often than chance explains. A further run, from
which nothing is identified, is predicted: eps_RA.

The score is the percentage of seeds within 3 sigma of the truth, for the
parameter where it is lowest; a seed without an estimate counts as a miss. The
exit code is 1 if the score is below --score. Ctrl-C ends the rehearsal with the
seeds that are finished.

RUNS is an experiment file. Its filter, standstill, delay and checks apply to
the simulated logs. Its runs for identification determine the number, duration
and rate of the simulated ones, from their logs if these exist, or else from
rows, times and rate. Simulated logs have positions, commands and efforts under
plain names, so that its columns, units and gains have no effect, except `gain:
unknown`: gains and payloads are identified and scored as in `identify`, and the
stated parameters of a payload are those of the simulated one; the noise is in
N m or N. Without RUNS there is one run of one period. A log in place of RUNS
determines duration and rate too.

`didim` and `response` are given the controllers, and start from the parameters
before --perturb; with --loop-bandwidth didim tunes its own. --reference gives
iv (with the controllers' gains) and didim the trajectory, as in `identify`.

--unmodelled stribeck=PART adds an effect that the model lacks to joints with
`friction: coulomb` or `linear`: static friction exceeds Coulomb friction by
this part of it, fading with the speed v as exp(-(v/SPEED)^2); SPEED is 0.1
rad/s or m/s by default.

Examples:
  regen rehearse arm.yaml --trajectory t.json --noise 1e-5,0.01 --perturb 0.1 \\
      --butterworth 4,20
  regen rehearse arm.yaml runs.yaml --trajectory t.json --noise 1e-5,0.01 \\
      --quantum 1e-4 --estimator iv --reference --seeds 200 --score 95
  regen rehearse arm.yaml --trajectory t.json --noise 1e-5,0.01 \\
      --butterworth 4,20 --unmodelled stribeck=0.3 --format json")]
pub(crate) struct RehearseArgs {
    /// The robot's spec
    pub(crate) file: PathBuf,
    /// An experiment file, YAML, whose runs are rehearsed; or logs
    #[arg(value_name = "RUNS", value_parser = run(), value_hint = ValueHint::AnyPath)]
    pub(crate) logs: Vec<Run>,
    /// The number of seeds, beginning with --seed
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = count::<1, 100_000>)]
    pub(crate) seeds: usize,
    /// The least score for exit code 0, percent
    #[arg(long, value_name = "PERCENT", default_value_t = 90.0)]
    pub(crate) score: f64,
    /// The number of runs per seed to identify from [default: 1]
    #[arg(long, value_name = "N", value_parser = count::<1, 1000>, conflicts_with = "logs")]
    pub(crate) runs: Option<usize>,
    /// An effect that the simulated robot has and the model lacks: stribeck=PART or
    /// stribeck=PART,SPEED
    #[arg(long, value_name = "KIND")]
    pub(crate) unmodelled: Option<UnmodelledArg>,
    /// The true gain of a drive whose gain is unknown in RUNS, N m/A or N/A:
    /// NAME=VALUE (may be repeated) [default: 1]
    #[arg(long, value_name = "GAIN", value_parser = value)]
    pub(crate) gain: Vec<(String, f64)>,
    /// Keep the simulated logs in this folder
    #[arg(long, value_name = "DIR")]
    pub(crate) keep: Option<PathBuf>,
    /// The number of threads, on which the result does not depend [default: all]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true, value_parser = count::<0, 1024>)]
    pub(crate) threads: usize,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
    #[command(flatten)]
    pub(crate) solving: SolvingArgs,
    #[command(flatten)]
    pub(crate) twin: TwinArgs,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
}

/// How parameters are identified from the simulated logs; the options are those of `regen identify`.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Identifying, as `regen identify` does")]
pub(crate) struct SolvingArgs {
    /// The estimator
    #[arg(long, value_enum, default_value = "ls")]
    pub(crate) estimator: EstimatorArg,
    /// How the efforts are weighted against each other
    #[arg(long, value_enum, default_value_t)]
    pub(crate) weighting: WeightingArg,
    /// Residuals beyond K standard deviations count linearly [default: 1.345 with
    /// --estimator huber]
    #[arg(long, value_name = "K")]
    pub(crate) huber: Option<f64>,
    /// The level of the confidence intervals
    #[arg(long, value_name = "LEVEL", default_value_t = 0.95)]
    pub(crate) confidence: f64,
    /// Identify physically feasible parameters
    #[arg(long)]
    pub(crate) feasible: bool,
    /// Also identify the nonlinear friction of the spec
    #[arg(long)]
    pub(crate) friction: bool,
    /// Use the spec's nominal values as a prior: weighted, weighted:PERCENT,
    /// entropic or entropic:WEIGHT
    #[arg(long, value_name = "KIND")]
    pub(crate) prior: Option<PriorArg>,
    /// The number of draws for the intervals of feasible parameters
    #[arg(long, value_name = "N", default_value_t = DEFAULT_DRAWS, value_parser = draws)]
    pub(crate) draws: usize,
    /// Give iv and didim the trajectory
    #[arg(long)]
    pub(crate) reference: bool,
    /// Replace the robot's controllers in didim by ones of this bandwidth in Hz
    #[arg(long, value_name = "HZ")]
    pub(crate) loop_bandwidth: Option<f64>,
    /// Length of the windows of `response`, s
    #[arg(long, value_name = "S", default_value_t = 1.0)]
    pub(crate) window: f64,
}

/// An effect that the simulated robot has and the model lacks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum UnmodelledArg {
    /// Static friction exceeds Coulomb friction by `part` of it, fading over `speed`, rad/s or m/s.
    Stribeck { part: f64, speed: f64 },
}

/// The default speed over which the Stribeck effect fades, rad/s or m/s.
const STRIBECK_SPEED: f64 = 0.1;

impl FromStr for UnmodelledArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let Some(("stribeck", figures)) = text.split_once('=') else {
            return Err(format!(
                "`{text}` is not stribeck=PART or stribeck=PART,SPEED"
            ));
        };
        let number = |text: &str| match text.trim().parse::<f64>() {
            Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
            _ => Err(format!("`{text}` is not a finite number above 0")),
        };
        let (part, speed) = match figures.split_once(',') {
            Some((part, speed)) => (number(part)?, number(speed)?),
            None => (number(figures)?, STRIBECK_SPEED),
        };
        Ok(Self::Stribeck { part, speed })
    }
}
