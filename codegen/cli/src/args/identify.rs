//! The options of `regen observe`, `identify` and `validate`.

use std::path::PathBuf;

use clap::{Args, ValueEnum, ValueHint};

use super::format::Format;
use super::physical::PhysicalArgs;
use super::reading::{ReadingArgs, at_least_one, run};
use super::report::ReportOptions;
use super::simulate::gains;
use regen_experiment::simulate::Gains;
use regen_identify::data::Run;

#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Writes one triangular factor per effort, which contains all that least squares
needs of the logs, and whose size does not depend on their length. `regen
identify --from` merges the factors of any number of runs, in any order, with
the same result. The file has a digest of the model: factors of another robot or
geometry are refused.

Example:
  regen observe robots/3rps.yaml monday.csv --out monday.json \\
      --fourier 0.1333,11")]
pub(crate) struct ObserveArgs {
    /// The robot's spec
    pub(crate) file: PathBuf,
    /// Logs: CSV, Parquet, MAT, HDF5, NPY, NPZ, MDF 4, TDMS, MCAP files or ROS 2 bags; or an
    /// experiment file, YAML
    #[arg(required = true, value_name = "LOG", value_parser = run(), value_hint = ValueHint::AnyPath)]
    pub(crate) logs: Vec<Run>,
    /// Where the factors are written
    #[arg(long, value_name = "FACTORS")]
    pub(crate) out: PathBuf,
    /// How the summary is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
}

#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Columns are found by their headers: t, the names of coordinates, tau_NAME for
efforts, qd_NAME and qdd_NAME for measured velocities and accelerations. The
positions of as many coordinates as the robot has degrees of freedom suffice,
with the efforts of all actuated ones; the others follow from the loop closure.

Without an option or a key that says how positions are differentiated, a
filter is chosen from the logs: each cutoff of a grid is tried, and judged by
what noise leaves unknown and by what noise of the positions biases. Delays of
the efforts that are beyond chance are corrected, and Huber's loss is used where
outliers make squares of the residuals far less accurate. The lines `filter`,
`delay` and `loss` have the choice, the reasons and the options that repeat it;
the file of --out has it for `validate`. --delay and --estimator pin the others.

An experiment file, YAML, describes how logs are read: columns by name, number
or pattern with units, factors and gains, files to join, rows and times, filter
and checks, and which logs are for validation (used as --against). Options
override it, and if logs are given too, they replace its runs; `regen schema
experiment` describes its keys.

Examples:
  regen identify robots/3rps.yaml run.csv
  regen identify arm.yaml runs.yaml --out p.json
  regen identify robots/3rps.yaml run1.csv run2.csv --fourier 0.1333,11
  regen identify robots/fivebar.yaml run.csv --local 0.05 --huber 1.345
  regen identify robots/3rps.yaml --from monday.json tuesday.json --out p.json
  regen identify arm.yaml run.csv --column q1=angle:deg \\
      --column 'tau_q1=i:A*0.12'
  regen identify arm.yaml run.csv --column q3=constant:90:deg \\
      --column tau_q1=unmeasured
  regen identify arm.yaml poses.csv --poses
  regen identify arm.yaml run.csv --feasible --prior weighted:20 \\
      --bodies new.yaml
  regen identify arm.yaml run.csv --friction --against other.csv slow.csv
  regen identify arm.yaml run.csv --reduce --against other.csv
  regen identify arm.yaml run.csv --iv --reference t.json --pid 50,20,3
  regen identify arm.yaml run.csv --estimator didim --controller gains.yaml
  regen identify arm.yaml run.csv --estimator response --controller gains.yaml
  regen identify arm.yaml loaded.csv --payload unknown --parameters p.json

With --iv the transposed regressor of least squares is replaced by that at
another motion: of the robot simulated under PID control along --reference with
the current estimate (with physical parameters, if it is not that of bodies),
in up to five rounds; log and reference must have the same time, and the robot
had repeated the motion or begins with it. Without --reference it is the
measured motion without frequencies above a printed cutoff; noise below the
cutoff then still biases the result. The test of Durbin, Wu and Hausman shows
whether least squares is biased.

Two estimators compare the simulated robot under its controllers with the logs.
`didim` uses efforts only: least squares of them on the simulated ones, along
--reference or the columns cmd_NAME, repeated until the estimate converges.
`response` uses positions only, with commands in the columns cmd_NAME: it fits
the responses to them, starting from --start or nominal values. It can also
estimate gains in the controllers' file, `kp: {estimate: 40}`, and the delay,
gain and bias of signals, `signals: {q1: {delay: {estimate: 0}}}`. Runs of an
experiment file have their own `commands` and `controller`. Parameters that the
commands do not determine, such as the common scale of inertias and unknown
gains, are named; the exit code is then 4.

Currents of unknown gain (`gain: unknown` in an experiment file) and runs with a
payload (`payload: unknown`, or its known parameters) are fitted together, in
the units of measurement, by least squares, huber, iv or didim. Only a known
gain or a payload of known mass determines the scale; without one the fit is
refused. --payload unknown identifies a load on a robot whose parameters
--parameters states.

With --feasible the parameters of --out are physical: a semidefinite programme
finds all ten of each body, nonnegative friction and rotors, and offsets of
either sign. Parameters that the data do not determine are close to the spec's
nominal values. --friction adds the spec's nonlinear friction; its samples stay
in memory (--decimate). With --against, or more than one model, a table has the
eps_RA of each model on each log (Mata et al., 2008, Eq. 33 and Table 4).")]
pub(crate) struct IdentifyArgs {
    /// The robot's spec
    pub(crate) file: PathBuf,
    /// Logs: CSV, Parquet, MAT, HDF5, NPY, NPZ, MDF 4, TDMS, MCAP files or ROS 2 bags; or an
    /// experiment file, YAML
    #[arg(required_unless_present = "from", value_name = "LOG", value_parser = run(), value_hint = ValueHint::AnyPath)]
    pub(crate) logs: Vec<Run>,
    /// Merge factor files instead of reading logs
    #[arg(long, num_args = 1.., value_name = "FACTORS", conflicts_with_all = ["logs", "huber", "cross"])]
    pub(crate) from: Vec<PathBuf>,
    /// How the efforts are weighted against each other
    #[arg(long, value_enum, default_value_t, hide_short_help = true)]
    pub(crate) weighting: WeightingArg,
    /// Residuals beyond K standard deviations count linearly (Huber); 1.345 is usual
    #[arg(long, value_name = "K", hide_short_help = true)]
    pub(crate) huber: Option<f64>,
    /// Newey and West's deviations, with this number of samples over which residuals are correlated
    /// [default: from cosines of whitened scores]
    #[arg(long, value_name = "N", value_parser = at_least_one, hide_short_help = true)]
    pub(crate) bandwidth: Option<usize>,
    /// The level of the confidence intervals
    #[arg(long, value_name = "LEVEL", default_value_t = 0.95)]
    pub(crate) confidence: f64,
    /// Cross-validate: identify from all logs but one and predict that one, in turn
    #[arg(long)]
    pub(crate) cross: bool,
    /// Do not look for swapped columns, flipped signs, wrong units and the like
    #[arg(long, hide_short_help = true)]
    pub(crate) no_suspicion: bool,
    /// The estimator [default: ls, or huber where residuals have heavy tails; --huber
    /// and --iv choose theirs]
    #[arg(long, value_enum)]
    pub(crate) estimator: Option<EstimatorArg>,
    /// Use instrumental variables, which errors of the measured motion do not bias
    #[arg(long, conflicts_with_all = ["from", "huber", "cross", "energy", "physical", "reduce"])]
    pub(crate) iv: bool,
    /// The trajectory that the controllers followed, as `regen excite` writes it;
    /// instruments, or the motion of `didim`, are simulated along it
    #[arg(long, value_name = "TRAJECTORY", hide_short_help = true)]
    pub(crate) reference: Option<PathBuf>,
    /// Gains of all controllers in this simulation, or of one: [NAME=]KP,KI,KD
    /// (may be repeated) [default: from the robot's inertia, for the bandwidth at
    /// which the simulated motion is closest to the measured one]
    #[arg(long, value_name = "GAINS", value_parser = gains, hide_short_help = true)]
    pub(crate) pid: Vec<Gains>,
    /// Write the parameters for `validate` and `export`: YAML if PARAMS ends in
    /// .yaml, else JSON
    #[arg(long, value_name = "PARAMS")]
    pub(crate) out: Option<PathBuf>,
    /// The date to write into the file, since regen reads no clock
    #[arg(long, value_name = "TEXT", requires = "out", hide_short_help = true)]
    pub(crate) date: Option<String>,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
    // clap would list options declared after these flattened ones under their headings
    #[command(flatten)]
    pub(crate) before: BeforeArgs,
    #[command(flatten)]
    pub(crate) simulated: SimulatedArgs,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
    #[command(flatten)]
    pub(crate) physical: PhysicalArgs,
    #[command(flatten)]
    pub(crate) report: ReportOptions,
}

/// Parameters of a robot that was identified before, and the covariance that later fits need.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Loads on an identified robot")]
pub(crate) struct BeforeArgs {
    /// Identified parameters of the robot without its load: only payloads are
    /// identified, and gains that PARAMS lacks. If PARAMS has a `covariance`
    /// (--covariance), standard deviations include it
    #[arg(long, value_name = "PARAMS", hide_short_help = true)]
    pub(crate) parameters: Option<PathBuf>,
    /// Also write the covariance of base parameters and gains to the file of --out
    #[arg(long, requires = "out", hide_short_help = true)]
    pub(crate) covariance: bool,
}

/// The options of estimators that simulate the robot under its controllers.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Simulating the controlled robot (didim, response)")]
pub(crate) struct SimulatedArgs {
    /// The column of a joint's commanded position: NAME=COLUMN, followed by :UNIT
    /// and *FACTOR if needed (may be repeated) [default: cmd_NAME]
    #[arg(long, value_name = "ASSIGNMENT", hide_short_help = true)]
    pub(crate) command: Vec<regen_identify::data::Assignment>,
    /// The controllers, JSON or YAML: `q1: {kp: 40, kd: 2}` for each actuated
    /// joint; `regen simulate --controller` writes such a file
    #[arg(long, value_name = "FILE", hide_short_help = true)]
    pub(crate) controller: Option<PathBuf>,
    /// The bandwidth of controllers without gains in `didim`, Hz [default: that at
    /// which the motion is closest to measured positions; 3 without those]
    #[arg(long, value_name = "HZ", hide_short_help = true)]
    pub(crate) loop_bandwidth: Option<f64>,
    /// The time at the start of each log that `didim` leaves out if it follows
    /// columns of commands, s
    #[arg(long, value_name = "S", default_value_t = crate::identify_simulated::SETTLE, hide_short_help = true)]
    pub(crate) settle: f64,
    /// Length of the windows of `response`, s, whose first states are estimated
    #[arg(long, value_name = "S", default_value_t = 1.0, hide_short_help = true)]
    pub(crate) window: f64,
    /// The width of the smoothed sign of Coulomb friction in `response`, rad/s or m/s,
    /// of joints; of a drive, the velocity at which its joints reach it [default: 0.001]
    #[arg(long, value_name = "V", hide_short_help = true)]
    pub(crate) friction_width: Option<f64>,
    /// Parameters to start from [default: the spec's nominal ones]
    #[arg(long, value_name = "PARAMS", hide_short_help = true)]
    pub(crate) start: Option<PathBuf>,
}

/// How parameters are estimated
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum EstimatorArg {
    /// Least squares
    Ls,
    /// Least squares with Huber's weights for outliers
    Huber,
    /// Instrumental variables
    Iv,
    /// Efforts at the motion of the simulated loop; no measured motion is used
    Didim,
    /// Responses to commands; no efforts are used
    Response,
}

#[derive(Clone, Debug, Args)]
#[command(after_help = "\
PARAMS is a file that `regen identify --out` wrote, or a JSON or YAML object, by
its extension, with the labels of all parameters or of all base parameters as
keys. The table has a row for each PARAMS and a column for each log: eps_RA (Eq.
33) in percent.

--predict writes the filtered efforts that are compared: t, tau_NAME and
predicted_NAME for each independent coordinate, and predicted2_NAME and so on
for --beside; with several logs, the first column is the log's number.

Examples:
  regen validate robots/3rps.yaml p.json run3.csv run4.csv --fourier 0.1333,11
  regen validate robots/3rps.yaml lsm.json run3.csv run4.csv \\
      --beside feasible.json nonlinear.yaml --fourier 0.1333,11")]
pub(crate) struct ValidateArgs {
    /// The robot's spec
    pub(crate) file: PathBuf,
    /// Identified parameters
    pub(crate) params: PathBuf,
    /// Logs that were not used for identification; or an experiment file, YAML
    #[arg(required = true, value_name = "LOG", value_parser = run(), value_hint = ValueHint::AnyPath)]
    pub(crate) logs: Vec<Run>,
    /// Further parameters to compare with
    #[arg(long, value_name = "PARAMS", num_args = 1..)]
    pub(crate) beside: Vec<PathBuf>,
    /// Write measured and predicted efforts of all logs here, CSV
    #[arg(long, value_name = "FILE")]
    pub(crate) predict: Option<PathBuf>,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
}

/// How efforts are weighted against each other
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum WeightingArg {
    /// By the standard deviations of their residuals
    #[default]
    PerEffort,
    /// All efforts have the same weight
    Equal,
}
