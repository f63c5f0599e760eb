//! The options for reading logs, shared by all commands that read them.

use std::path::PathBuf;

use clap::builder::{OsStringValueParser, TypedValueParser, ValueParser};
use clap::{Args, ValueEnum};
use regen_identify::data::Run;

use crate::experiment::Experiment;

/// What of the options a command found from the logs.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FoundFromLogs {
    /// The filter.
    pub(crate) filter: bool,
    /// The delays.
    pub(crate) delays: bool,
}

/// How logs are read and differentiated.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Reading logs")]
pub(crate) struct ReadingArgs {
    /// Where the files of an experiment file are [default: its own folder]
    #[arg(long = "logs", id = "folder", value_name = "DIR")]
    pub(crate) folder: Option<PathBuf>,
    /// Assign a column to a quantity: Q=COLUMN, followed by :UNIT, *FACTOR,
    /// :offset:VALUE and :late:S if needed; COLUMN is a header or a number. q3=constant:90:deg is
    /// a position that stays, tau_q3=unmeasured an effort whose equations are left out
    #[arg(long, value_name = "ASSIGNMENT")]
    pub(crate) column: Vec<regen_identify::data::Assignment>,
    /// The topic to read from MCAP files and ROS 2 bags [default: the only one with
    /// joint states]
    #[arg(long, value_name = "NAME", hide_short_help = true)]
    pub(crate) topic: Option<String>,
    /// The index of the episode to read from LeRobot files [default: the only one]
    #[arg(long, value_name = "INDEX", hide_short_help = true)]
    pub(crate) episode: Option<u64>,
    /// Each row is a pose at rest, with efforts that were averaged there: no time is read,
    /// velocities and accelerations are 0
    #[arg(long, group = "method", hide_short_help = true, conflicts_with_all = [
        "rate", "resample", "velocities", "decimate", "period", "delay", "energy",
    ])]
    pub(crate) poses: bool,
    /// The rate of the rows in Hz, if no column has their time
    #[arg(long, value_name = "HZ", value_parser = positive)]
    pub(crate) rate: Option<f64>,
    /// Interpolate rows with an uneven clock onto an even grid of this rate in Hz
    #[arg(long, value_name = "HZ", value_parser = positive, hide_short_help = true)]
    pub(crate) resample: Option<f64>,
    /// The velocities to use; measured ones unless the choice finds those computed
    /// from positions better. They pass the filter of the positions, and
    /// accelerations are their derivative; --fourier uses positions only
    #[arg(long, value_enum, hide_short_help = true)]
    pub(crate) velocities: Option<VelocitiesArg>,
    /// Differentiate the finite Fourier series of this frequency in Hz and
    /// number of harmonics
    #[arg(long, value_name = "HZ,N", value_parser = pair, group = "method", hide_short_help = true)]
    pub(crate) fourier: Option<(f64, usize)>,
    /// Filter efforts and regressor by a zero-phase Butterworth low-pass of this
    /// order and cutoff in Hz; positions by one three times as wide, then take
    /// central differences
    #[arg(long, value_name = "ORDER,HZ", value_parser = flipped, group = "method")]
    pub(crate) butterworth: Option<(f64, usize)>,
    /// Fit cubic polynomials within this time in s on either side
    #[arg(long, value_name = "S", value_parser = positive, group = "method", hide_short_help = true)]
    pub(crate) local: Option<f64>,
    /// Use no filter, but central differences of the positions as they are, for logs that
    /// were filtered before
    #[arg(long, group = "method", hide_short_help = true)]
    pub(crate) no_filter: bool,
    /// Use only every N-th state, after filtering
    #[arg(long, value_name = "N", value_parser = at_least_one, hide_short_help = true)]
    pub(crate) decimate: Option<usize>,
    /// Average over the repetitions of a trajectory with this period in s
    #[arg(long, value_name = "S", value_parser = positive, hide_short_help = true)]
    pub(crate) period: Option<f64>,
    /// Whether the payloads of the spec are carried in all logs; required if it has
    /// payloads, here or for each run of an experiment file
    #[arg(long, value_enum)]
    pub(crate) payload: Option<PayloadArg>,
    /// The standard deviation of a measured coordinate, which weights it if more are
    /// measured than needed: NAME=VALUE
    #[arg(long, value_name = "NAME=VALUE", value_parser = name_and_number, hide_short_help = true)]
    pub(crate) deviation: Vec<(String, f64)>,
    /// The treatment of faulty rows [default: fail, but short gaps and repeated rows
    /// are bridged, and long ones divide the log]
    #[arg(long, value_enum)]
    pub(crate) problems: Option<ProblemsArg>,
    /// The treatment of equations of joints at rest, where friction is static: whose
    /// encoders stay within a step or their noise for 0.2 s, or whose velocity does
    /// not differ significantly from zero [default: drop]
    #[arg(long, value_enum, hide_short_help = true)]
    pub(crate) standstill: Option<StandstillArg>,
    /// Velocities below this, rad/s or m/s, also count as rest
    #[arg(long, value_name = "V", value_parser = not_negative, hide_short_help = true)]
    pub(crate) rest_speed: Option<f64>,
    /// The delay in s of an effort, which is logged later than its motion: NAME=S
    /// (0: none); `auto` corrects those that least squares of these logs finds
    /// [default: corrected where a filter is chosen and they are beyond chance]
    #[arg(long, value_name = "NAME=S|auto")]
    pub(crate) delay: Vec<DelayArg>,
    /// Use the energy balance over windows of this length in s instead of the
    /// equations of motion, which needs no accelerations
    #[arg(long, value_name = "S", value_parser = positive, hide_short_help = true)]
    pub(crate) energy: Option<f64>,
    /// The content of the experiment file, which the options override.
    #[arg(skip)]
    pub(crate) experiment: Option<Box<Experiment>>,
    /// What the command found from the logs and set here.
    #[arg(skip)]
    pub(crate) found: FoundFromLogs,
    /// The files that the command writes, which no log may be.
    #[arg(skip)]
    pub(crate) outputs: Vec<PathBuf>,
}

/// Parses the path of a log or an experiment file.
pub(crate) fn run() -> ValueParser {
    ValueParser::new(OsStringValueParser::new().map(|path| Run::from(PathBuf::from(path))))
}

/// The velocities to use
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum VelocitiesArg {
    /// The measured ones, if the log has them (default)
    Measured,
    /// Derivatives of the positions
    Computed,
}

/// Whether the bodies that a spec marks as payloads are carried
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PayloadArg {
    /// Not carried: they have no parameters
    None,
    /// Carried, as bodies like all others
    Carried,
    /// Carried, and identified by `identify` with the robot's --parameters
    Unknown,
}

/// The treatment of faulty rows
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProblemsArg {
    /// List them and stop, also at gaps and repeated rows
    Fail,
    /// Leave them out; the log is cut there, but for saturated efforts, of which
    /// the equations are left out
    Drop,
    /// Use those that are numbers: outliers, saturated efforts, encoders that look
    /// stuck
    Keep,
    /// Use them as `keep` does, and list them
    Tell,
}

/// The delay of logged efforts, as given with `--delay`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum DelayArg {
    /// The delays are estimated from the logs.
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
        let (name, seconds) = name_and_number(text)?;
        if !seconds.is_finite() {
            return Err(format!("{seconds} is not a finite number of seconds"));
        }
        Ok(Self::Of(name, seconds))
    }
}

/// The treatment of equations of joints at rest
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum StandstillArg {
    /// Leave them out
    Drop,
    /// Use them like all others
    Keep,
    /// Weight each by the part of the filter's memory in which its joint moved
    Weigh,
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

pub(super) fn at_least_one(text: &str) -> Result<usize, String> {
    match text.trim().parse::<usize>() {
        Ok(value) if value > 0 => Ok(value),
        _ => Err(format!("`{text}` is not a whole number of at least 1")),
    }
}

/// A whole number between two bounds; larger ones would take the machine's memory or run for days.
pub(super) fn count<const LEAST: usize, const MOST: usize>(text: &str) -> Result<usize, String> {
    match text.trim().parse::<usize>() {
        Ok(value) if value > MOST => Err(format!("`{text}` is more than {MOST}")),
        Ok(value) if value >= LEAST => Ok(value),
        _ => Err(format!(
            "`{text}` is not a whole number of at least {LEAST}"
        )),
    }
}

fn positive(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err(format!("`{text}` is not a finite number above 0")),
    }
}

fn not_negative(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() && value >= 0.0 => Ok(value),
        _ => Err(format!("`{text}` is not a finite number of at least 0")),
    }
}

fn name_and_number(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("NAME=VALUE is needed")?;
    let value = value.trim().parse().map_err(|e| format!("{value}: {e}"))?;
    Ok((name.trim().to_owned(), value))
}
