//! `observe`, `identify` and `validate`: from logs to parameters.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{Format, PhysicalArgs};
use crate::report::ReportOptions;
use crate::simulate::gains;
use regen_experiment::simulate::Gains;

#[derive(Debug, Args)]
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
    /// Logs, CSV or Parquet files
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
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

Examples:
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

With --iv the regressor at another motion takes the place of the regressor's
transpose: that of the robot simulated under PID control along --reference with
the present estimate, in up to five rounds; the log's time is the reference's.
Without --reference it is the measured motion, smoothed as far as it has
nothing but noise: then the noise below the cutoff that is told still counts.
The test of Durbin, Wu and Hausman says whether least squares is biased.

With --feasible the parameters of --out are physical: the semidefinite programme
finds all ten of each body, friction and rotors that are not negative. What the
data leave open is taken close to the spec's nominal values. With --friction
they have the spec's nonlinear friction too; its samples stay in memory
(--decimate). With --against, or more models than one, a table has eps_RA
(Eq. 33) of each model on each log, as the chapter's Table 4.")]
pub(crate) struct IdentifyArgs {
    /// The robot's spec
    pub(crate) file: PathBuf,
    /// Logs, CSV or Parquet files
    #[arg(required_unless_present = "from", value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
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
    /// Instrumental variables, which errors of the measured motion do not bias
    #[arg(long, conflicts_with_all = ["from", "huber", "cross", "energy", "physical", "reduce"])]
    pub(crate) iv: bool,
    /// What the controllers followed, as `regen excite` writes it: the
    /// instruments come from simulating the robot along it
    #[arg(long, value_name = "TRAJECTORY", requires = "iv")]
    pub(crate) reference: Option<PathBuf>,
    /// Gains of all controllers in this simulation, or of one: [NAME=]KP,KI,KD
    /// (may be repeated) [default: by the robot's inertia, for 3 Hz]
    #[arg(long, value_name = "GAINS", requires = "reference", value_parser = gains)]
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
    // options behind these would come under their headings
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
    #[command(flatten)]
    pub(crate) physical: PhysicalArgs,
    #[command(flatten)]
    pub(crate) report: ReportOptions,
}

#[derive(Debug, Args)]
#[command(after_help = "\
PARAMS is a file that `regen identify --out` wrote, or an object (JSON, or YAML
if its name ends so) with the labels of all parameters or of all base parameters
as keys. The table has a row for each PARAMS and a column for each log: eps_RA
(Eq. 33) in percent.

Examples:
  regen validate robots/3rps.yaml p.json run3.csv run4.csv --fourier 0.1333,11
  regen validate robots/3rps.yaml lsm.json run3.csv run4.csv \\
      --beside feasible.json nonlinear.yaml --fourier 0.1333,11")]
pub(crate) struct ValidateArgs {
    /// The robot's spec
    pub(crate) file: PathBuf,
    /// Identified parameters
    pub(crate) params: PathBuf,
    /// Logs that were not used for identification
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// Further parameters to compare with
    #[arg(long, value_name = "PARAMS", num_args = 1..)]
    pub(crate) beside: Vec<PathBuf>,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
}

/// How logs are read and differentiated.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Reading logs")]
pub(crate) struct ReadingArgs {
    /// A column whose header does not say what it is: Q=COLUMN, and
    /// behind it :UNIT and *FACTOR where they are needed
    #[arg(long, value_name = "ASSIGNMENT")]
    pub(crate) column: Vec<regen_identify::data::Assignment>,
    /// Differentiate the finite Fourier series of this frequency in Hz and
    /// number of harmonics
    #[arg(long, value_name = "HZ,N", value_parser = pair, group = "method")]
    pub(crate) fourier: Option<(f64, usize)>,
    /// Filter efforts and regressor by a zero-phase Butterworth low-pass of this
    /// order and cutoff in Hz; positions by one three times as wide, then take
    /// central differences
    #[arg(long, value_name = "ORDER,HZ", value_parser = flipped, group = "method")]
    pub(crate) butterworth: Option<(f64, usize)>,
    /// Fit cubic polynomials within this time in s on either side
    #[arg(long, value_name = "S", group = "method")]
    pub(crate) local: Option<f64>,
    /// Take only each N-th state, after filtering
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = at_least_one)]
    pub(crate) decimate: usize,
    /// Average the runs of a trajectory of this period in s
    #[arg(long, value_name = "S")]
    pub(crate) period: Option<f64>,
    /// The standard deviation of a measured coordinate, where more are measured
    /// than needed: NAME=VALUE
    #[arg(long, value_name = "NAME=VALUE", value_parser = named)]
    pub(crate) deviation: Vec<(String, f64)>,
    /// What is done with rows that cannot be used
    #[arg(long, value_enum, default_value_t)]
    pub(crate) problems: ProblemsArg,
    /// What is done with equations of joints at rest, which static friction holds:
    /// those whose encoders stay within a step or their noise for 0.2 s, or whose
    /// velocity is not sure to differ from zero
    #[arg(long, value_enum, default_value_t)]
    pub(crate) standstill: StandstillArg,
    /// Velocities below this, rad/s or m/s, count as rest too
    #[arg(long, value_name = "V", default_value_t = 0.0, value_parser = not_negative)]
    pub(crate) rest_speed: f64,
    /// By how many seconds an effort is logged after the motion that it belongs to:
    /// NAME=S. Every `identify` estimates it; `auto` corrects what it finds
    #[arg(long, value_name = "NAME=S|auto")]
    pub(crate) delay: Vec<DelayArg>,
    /// Use the balance of energy over windows of this length in s instead of
    /// the equations of motion: no accelerations are needed
    #[arg(long, value_name = "S")]
    pub(crate) energy: Option<f64>,
}

/// What is done with rows that cannot be used
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProblemsArg {
    /// List them and stop
    #[default]
    Fail,
    /// Go on without them; the log is cut there
    Drop,
    /// Go on with them where they are numbers: outliers, saturated efforts,
    /// encoders that look stuck
    Keep,
    /// As keep, and list them
    Tell,
}

/// By how much efforts are logged late
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum DelayArg {
    /// By as much as is found.
    Auto,
    /// The delay of one joint's effort, by its name, s.
    Of(String, f64),
}

impl std::str::FromStr for DelayArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let (name, seconds) = named(text)?;
        if !seconds.is_finite() {
            return Err(format!("{seconds} is not a finite number of seconds"));
        }
        Ok(Self::Of(name, seconds))
    }
}

/// What is done with equations of joints at rest
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum StandstillArg {
    /// Leave them out
    #[default]
    Drop,
    /// Use them as all others
    Keep,
    /// Let each count by the part of the filter's memory in which its joint moved
    Weigh,
}

/// How efforts are weighted against each other
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum WeightingArg {
    /// By the standard deviations of their residuals
    #[default]
    PerEffort,
    /// All alike
    Equal,
}

fn pair(text: &str) -> Result<(f64, usize), String> {
    let (a, b) = text.split_once(',').ok_or("two numbers with a comma")?;
    let number = a.trim().parse().map_err(|e| format!("{a}: {e}"))?;
    let count = b.trim().parse().map_err(|e| format!("{b}: {e}"))?;
    Ok((number, count))
}

fn flipped(text: &str) -> Result<(f64, usize), String> {
    let (a, b) = text.split_once(',').ok_or("two numbers with a comma")?;
    pair(&format!("{b},{a}"))
}

fn at_least_one(text: &str) -> Result<usize, String> {
    match text.trim().parse::<usize>() {
        Ok(value) if value > 0 => Ok(value),
        _ => Err(format!("`{text}` is not a whole number of at least 1")),
    }
}

fn not_negative(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() && value >= 0.0 => Ok(value),
        _ => Err(format!("`{text}` is not a finite number of at least 0")),
    }
}

fn named(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("NAME=VALUE is needed")?;
    let value = value.trim().parse().map_err(|e| format!("{value}: {e}"))?;
    Ok((name.trim().to_owned(), value))
}
