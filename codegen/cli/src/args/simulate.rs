//! The options of `regen simulate`.

use std::path::PathBuf;

use clap::Args;
use regen_experiment::simulate::Gains;

use super::PayloadArg;
use super::format::Format;
use super::reading::count;

#[derive(Debug, Args)]
#[command(after_help = "\
Every actuated joint has a PID controller, sampled every --step, plus the
constant effort that balances gravity at the start. Without --pid, the gains
follow from the bandwidth and the robot's inertia along the motion, such that no
mode is faster than the bandwidth. Without --bandwidth, bandwidths from 3 to 96
Hz are tried on one period, with a --step that suits them, and the first is used
with which every joint stays within 5 % of its range of the motion, or else the
closest one; if none stays within 20 %, the exit code is 4. Friction is that of
the spec, with its nominal coefficients; efforts are limited as in the spec.

Without --trajectory each independent coordinate oscillates about home, at 0.1
Hz and multiples of it, by at most 40 % of the range that limits and loops
allow.

The log has t, the measured positions of the actuated joints and their efforts
as tau_NAME, which is what `regen identify` reads. Positions and efforts of a
row belong to the same instant: where a command changes, the effort is the mean
of those that the drive applies just before and just after. With --exact the log
has the true positions, velocities and accelerations of all coordinates, without
noise and encoder steps; the accelerations are those of the effort in their row.

PARAMS is an object of labels with values, JSON or YAML, which override the
nominal ones, such as a file of --truth, or a file of `regen identify --out`.

Examples:
  regen simulate robots/3rps.yaml --out log.csv
  regen simulate robots/3rps.yaml --trajectory t.json --noise 1e-5,0.5 \\
      --quantum 1e-6 --runs 10 --seed 7 --out log.csv
  regen simulate robots/fivebar.yaml --pid 50,20,3 --lag 0.002 --out log.csv")]
pub(crate) struct SimulateArgs {
    /// The robot's spec
    pub(crate) file: PathBuf,
    /// Whether the payloads of the spec are carried; required if it has payloads
    #[arg(long, value_enum)]
    pub(crate) payload: Option<PayloadArg>,
    /// Where the log is written; with --runs, a number is inserted before .csv
    #[arg(long, value_name = "LOG")]
    pub(crate) out: PathBuf,
    /// The number of runs, which differ in their noise
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = count::<0, 10_000>)]
    pub(crate) runs: usize,
    /// Also log the commanded positions, as cmd_NAME
    #[arg(long, conflicts_with = "exact")]
    pub(crate) commands: bool,
    /// Write the controllers' gains here, for `identify --controller`: YAML if
    /// FILE ends in .yaml, else JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) controller: Option<PathBuf>,
    /// Write the true parameters here, as --parameters reads them: YAML if FILE
    /// ends in .yaml, else JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) truth: Option<PathBuf>,
    /// Log the true positions, velocities and accelerations of all coordinates
    #[arg(long)]
    pub(crate) exact: bool,
    /// How the summary is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
    #[command(flatten)]
    pub(crate) twin: TwinArgs,
}

/// The options of a simulated robot and its runs, shared with `regen rehearse`.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "The simulated robot and its runs")]
pub(crate) struct TwinArgs {
    /// The trajectory to follow, as `regen excite` writes it
    #[arg(long, value_name = "TRAJECTORY")]
    pub(crate) trajectory: Option<PathBuf>,
    /// The robot's true parameters [default: the spec's nominal ones]
    #[arg(long, value_name = "PARAMS")]
    pub(crate) parameters: Option<PathBuf>,
    /// Change the parameters of each body, and all others, at random by up to this
    /// part
    #[arg(long, value_name = "PART", default_value_t = 0.0)]
    pub(crate) perturb: f64,
    /// The duration of a run in s [default: one period]
    #[arg(long, value_name = "S")]
    pub(crate) duration: Option<f64>,
    /// The time at the start that is left out of the log, s
    #[arg(long, value_name = "S", default_value_t = 0.0)]
    pub(crate) settle: f64,
    /// Time between samples of the controller and of the log, s [default: 0.01, or
    /// less if controllers need it to follow the motion]
    #[arg(long, value_name = "S")]
    pub(crate) step: Option<f64>,
    /// Gains of all controllers, or of one: [NAME=]KP,KI,KD (may be repeated)
    #[arg(long, value_name = "GAINS", value_parser = gains)]
    pub(crate) pid: Vec<Gains>,
    /// The bandwidth of controllers without --pid, Hz [default: the first with
    /// which the robot follows the motion]
    #[arg(long, value_name = "HZ")]
    pub(crate) bandwidth: Option<f64>,
    /// Time constant of the drives, s
    #[arg(long, value_name = "S", default_value_t = 0.0)]
    pub(crate) lag: f64,
    /// Simulate without friction
    #[arg(long)]
    pub(crate) no_friction: bool,
    /// The width of the smoothed sign of Coulomb friction, rad/s or m/s
    /// [default: 0.001]
    #[arg(long, value_name = "V")]
    pub(crate) friction_width: Option<f64>,
    /// Standard deviations of measured positions (rad or m) and efforts
    #[arg(long, value_name = "Q,TAU", value_parser = two)]
    pub(crate) noise: Option<[f64; 2]>,
    /// The resolution of measured positions and, if given, of efforts
    #[arg(long, value_name = "Q[,TAU]", value_parser = one_or_two)]
    pub(crate) quantum: Option<[f64; 2]>,
    /// The seed of noise and perturbation: the same seed gives the same logs
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub(crate) seed: u64,
}

/// Parses the controller gains of an option.
pub(super) fn gains(text: &str) -> Result<Gains, String> {
    let (name, rest) = match text.rsplit_once('=') {
        Some((name, rest)) => (Some(name.trim().to_owned()), rest),
        None => (None, text),
    };
    match numbers(rest)?[..] {
        [kp, ki, kd] => Ok(Gains {
            name,
            values: [kp, ki, kd],
        }),
        _ => Err("three gains with commas are needed: KP,KI,KD".to_owned()),
    }
}

fn two(text: &str) -> Result<[f64; 2], String> {
    match numbers(text)?[..] {
        [a, b] => Ok([a, b]),
        _ => Err("two numbers with a comma are needed".to_owned()),
    }
}

fn one_or_two(text: &str) -> Result<[f64; 2], String> {
    match numbers(text)?[..] {
        [a] => Ok([a, 0.0]),
        [a, b] => Ok([a, b]),
        _ => Err("one number, or two with a comma, are needed".to_owned()),
    }
}

/// Parses a comma-separated list of numbers of at least 0.
fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let number = |part: &str| {
        let x: f64 = part.trim().parse().map_err(|e| format!("{part}: {e}"))?;
        if x >= 0.0 && x.is_finite() {
            Ok(x)
        } else {
            Err(format!("{part} is not a finite number of at least 0"))
        }
    };
    text.split(',').map(number).collect()
}
