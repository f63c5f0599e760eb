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
Writes one triangular factor per effort: all that least squares needs of the
logs, of the same size whatever their length. Factors of any number of runs are
merged by `regen identify --from`, in any order, with the same result. The file
carries a digest of the model: factors of another robot or geometry are refused.

Example:
  regen observe robots/3rps.yaml monday.csv --out monday.json \\
      --fourier 0.1333,11")]
pub(crate) struct ObserveArgs {
    /// The robot's spec
    pub(crate) file: PathBuf,
    /// Logs: CSV or Parquet files, MCAP files, ROS 2 bags; or an experiment file, YAML
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
efforts, qd_NAME and qdd_NAME where velocities and accelerations are measured.
Positions of as many coordinates as the robot has degrees of freedom suffice,
with the efforts of all actuated ones; the rest comes from the loop closure.

An experiment file, YAML, says instead of options how logs are read: columns by
name, number or pattern with units, factors and gains, files side by side, rows
and times, filter and checks, and which logs validate (printed as --against).
Options win over it, and logs beside it are read in place of its runs; `regen
schema experiment` describes its keys.

Examples:
  regen identify arm.yaml runs.yaml --out p.json
  regen identify robots/3rps.yaml run1.csv run2.csv --fourier 0.1333,11
  regen identify robots/3rps.yaml run.csv --butterworth 4,20 --decimate 10
  regen identify robots/fivebar.yaml run.csv --local 0.05 --huber 1.345
  regen identify robots/3rps.yaml --from monday.json tuesday.json --out p.json
  regen identify arm.yaml run.csv --column q1=angle:deg \\
      --column 'tau_q1=i:A*0.12'
  regen identify arm.yaml run.csv --feasible --prior weighted:20 \\
      --bodies new.yaml
  regen identify arm.yaml run.csv --friction --against other.csv slow.csv
  regen identify arm.yaml run.csv --reduce --against other.csv
  regen identify arm.yaml run.csv --iv --reference t.json --pid 50,20,3
  regen identify arm.yaml run.csv --estimator didim --controller gains.yaml
  regen identify arm.yaml run.csv --estimator response --controller gains.yaml
  regen identify arm.yaml loaded.csv --payload unknown --parameters p.json

With --iv the transposed regressor of least squares is replaced by the one at
another motion: that of the robot simulated under PID control along --reference
with the present estimate, in up to five rounds; the log's time is the
reference's. Without --reference it is the measured motion without frequencies
above a printed cutoff; the noise below the cutoff then still biases the result.
The test of Durbin, Wu and Hausman says whether least squares is biased.

Two estimators compare what the robot would do under its controllers with what
it did. `didim` takes efforts alone: least squares at the simulated motion,
along --reference or the columns cmd_NAME, in rounds until nothing changes.
`response` takes positions alone, with commands in the columns cmd_NAME: it fits
what the robot answered, from --start or nominal values on. Numbers of the
controllers' file may be estimated too, `kp: {estimate: 40}`, and delay, gain
and bias of signals, `signals: {q1: {delay: {estimate: 0}}}`. Runs of experiment
files state `commands` and `controller` themselves. What commands
cannot determine, such as the common scale of inertias and unknown gains, is
named; the exit code is then 4.

Currents of unknown gain (`gain: unknown` in an experiment file) and runs with a
payload (`payload: unknown`, or what is known of it) are fitted together, in
units of measurement; only a known gain or a payload of known mass tells the
scale, and without it the fit is refused. --payload unknown weighs a load on a
robot that --parameters knows.

With --feasible the parameters of --out are physical: the semidefinite programme
finds all ten of each body, friction and rotors that are not negative, offsets
of either sign. What the data leave open is taken close to the spec's nominal
values. With --friction they have the spec's nonlinear friction too; its samples
stay in memory (--decimate). With --against, or more models than one, a table
has eps_RA (Eq. 33) of each model on each log, as the chapter's Table 4.")]
pub(crate) struct IdentifyArgs {
    /// The robot's spec
    pub(crate) file: PathBuf,
    /// Logs: CSV or Parquet files, MCAP files, ROS 2 bags; or an experiment file, YAML
    #[arg(required_unless_present = "from", value_name = "LOG", value_parser = run(), value_hint = ValueHint::AnyPath)]
    pub(crate) logs: Vec<Run>,
    /// Factor files instead of logs, merged
    #[arg(long, num_args = 1.., value_name = "FACTORS", conflicts_with_all = ["logs", "huber", "cross"])]
    pub(crate) from: Vec<PathBuf>,
    /// How the efforts are weighted against each other
    #[arg(long, value_enum, default_value_t)]
    pub(crate) weighting: WeightingArg,
    /// Residuals beyond K standard deviations count linearly; 1.345 is usual
    #[arg(long, value_name = "K")]
    pub(crate) huber: Option<f64>,
    /// Samples in which residuals are correlated [default: found from them]
    #[arg(long, value_name = "N", value_parser = at_least_one)]
    pub(crate) bandwidth: Option<usize>,
    /// The level of the confidence intervals
    #[arg(long, value_name = "LEVEL", default_value_t = 0.95)]
    pub(crate) confidence: f64,
    /// Identify from all logs but one and predict that one, each in turn
    #[arg(long)]
    pub(crate) cross: bool,
    /// Do not look for swapped columns, flipped signs, wrong units and the like
    #[arg(long)]
    pub(crate) no_suspicion: bool,
    /// The estimator [default: ls; --huber and --iv choose theirs]
    #[arg(long, value_enum)]
    pub(crate) estimator: Option<EstimatorArg>,
    /// Instrumental variables, which errors of the measured motion do not bias
    #[arg(long, conflicts_with_all = ["from", "huber", "cross", "energy", "physical", "reduce"])]
    pub(crate) iv: bool,
    /// What the controllers followed, as `regen excite` writes it: the
    /// instruments, or the motion of `didim`, come from simulating the robot
    /// along it
    #[arg(long, value_name = "TRAJECTORY")]
    pub(crate) reference: Option<PathBuf>,
    /// Gains of all controllers in this simulation, or of one: [NAME=]KP,KI,KD
    /// (may be repeated) [default: by the robot's inertia, for the bandwidth with
    /// which the motion is nearest to the measured one]
    #[arg(long, value_name = "GAINS", value_parser = gains)]
    pub(crate) pid: Vec<Gains>,
    /// Write the parameters for `validate` and `export`: YAML if PARAMS ends in
    /// .yaml, else JSON
    #[arg(long, value_name = "PARAMS")]
    pub(crate) out: Option<PathBuf>,
    /// When this was done, for the file: nothing reads a clock
    #[arg(long, value_name = "TEXT", requires = "out")]
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

/// What is known of a robot that was identified before, and what is written for later.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Loads on an identified robot")]
pub(crate) struct BeforeArgs {
    /// Identified parameters of the robot without its load: payloads are identified,
    /// and gains that PARAMS lacks. With `covariance` in it (--covariance), the
    /// deviations include its own
    #[arg(long, value_name = "PARAMS")]
    pub(crate) parameters: Option<PathBuf>,
    /// Write the covariance of base parameters and gains into the file of
    /// --out too
    #[arg(long, requires = "out")]
    pub(crate) covariance: bool,
}

/// The options of estimators that simulate the robot under its controllers.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Simulating the controlled robot (didim, response)")]
pub(crate) struct SimulatedArgs {
    /// The column of a joint's commanded position, NAME=COLUMN, with :UNIT and
    /// *FACTOR behind it where they are needed
    /// (may be repeated) [default: cmd_NAME]
    #[arg(long, value_name = "ASSIGNMENT")]
    pub(crate) command: Vec<regen_identify::data::Assignment>,
    /// The controllers, JSON or YAML: `q1: {kp: 40, kd: 2}` for each actuated
    /// joint; `regen simulate --controller` writes such a file
    #[arg(long, value_name = "FILE")]
    pub(crate) controller: Option<PathBuf>,
    /// The bandwidth of controllers without gains in `didim`, Hz [default: that with
    /// which the motion is nearest to measured positions; 3 without any]
    #[arg(long, value_name = "HZ")]
    pub(crate) loop_bandwidth: Option<f64>,
    /// Seconds at the start of each log that `didim` leaves out, where it
    /// follows columns of commands
    #[arg(long, value_name = "S", default_value_t = crate::identify_simulated::SETTLE)]
    pub(crate) settle: f64,
    /// Length of the windows of `response`, s, whose first states are estimated
    #[arg(long, value_name = "S", default_value_t = 1.0)]
    pub(crate) window: f64,
    /// The speed within which friction changes its sign in `response`, rad/s or m/s
    #[arg(long, value_name = "V", default_value_t = 1e-3)]
    pub(crate) friction_width: f64,
    /// Parameters to start from [default: the spec's nominal ones]
    #[arg(long, value_name = "PARAMS")]
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
PARAMS is a file that `regen identify --out` wrote, or an object (JSON, or YAML
if its name ends so) with the labels of all parameters or of all base parameters
as keys. The table has a row for each PARAMS and a column for each log: eps_RA
(Eq. 33) in percent.

--predict writes the efforts as they are compared, filtered and only those that
are used: t, tau_NAME and predicted_NAME for each independent coordinate, and
predicted2_NAME and so on for --beside; with several logs their number in front.

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
