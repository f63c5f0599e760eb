//! The options for reading logs, shared by all commands that read them.

use std::path::PathBuf;

use clap::builder::{OsStringValueParser, TypedValueParser, ValueParser};
use clap::{Args, ValueEnum};
use regen_identify::data::Run;

use crate::experiment::Experiment;

/// How logs are read and differentiated.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Reading logs")]
pub(crate) struct ReadingArgs {
    /// Where the files of an experiment file are [default: its own folder]
    #[arg(long = "logs", id = "folder", value_name = "DIR")]
    pub(crate) folder: Option<PathBuf>,
    /// A column whose header does not say what it is: Q=COLUMN, and
    /// behind it :UNIT and *FACTOR where they are needed; COLUMN may be its number
    #[arg(long, value_name = "ASSIGNMENT")]
    pub(crate) column: Vec<regen_identify::data::Assignment>,
    /// The topic of MCAP files and ROS 2 bags [default: the only one with joint states]
    #[arg(long, value_name = "NAME")]
    pub(crate) topic: Option<String>,
    /// The episode of Parquet files of LeRobot, by its index [default: the only one]
    #[arg(long, value_name = "INDEX")]
    pub(crate) episode: Option<u64>,
    /// The rate of the rows in Hz, where no column has their time
    #[arg(long, value_name = "HZ", value_parser = positive)]
    pub(crate) rate: Option<f64>,
    /// Interpolate the rows onto an even grid of this rate in Hz, where the steps of
    /// their clock are uneven
    #[arg(long, value_name = "HZ", value_parser = positive)]
    pub(crate) resample: Option<f64>,
    /// Which velocities are used. Measured ones pass the filter of the positions, and
    /// accelerations are their derivative; --fourier uses positions only
    #[arg(long, value_enum)]
    pub(crate) velocities: Option<VelocitiesArg>,
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
    #[arg(long, value_name = "N", value_parser = at_least_one)]
    pub(crate) decimate: Option<usize>,
    /// Average the runs of a trajectory of this period in s
    #[arg(long, value_name = "S")]
    pub(crate) period: Option<f64>,
    /// Whether the payloads of the description are carried in all these logs; required
    /// where it has a payload, here or for each run of an experiment file
    #[arg(long, value_enum)]
    pub(crate) payload: Option<PayloadArg>,
    /// The standard deviation of a measured coordinate, where more are measured
    /// than needed: NAME=VALUE
    #[arg(long, value_name = "NAME=VALUE", value_parser = named)]
    pub(crate) deviation: Vec<(String, f64)>,
    /// What is done with rows that cannot be used [default: fail]
    #[arg(long, value_enum)]
    pub(crate) problems: Option<ProblemsArg>,
    /// What is done with equations of joints at rest, which static friction holds:
    /// those whose encoders stay within a step or their noise for 0.2 s, or whose
    /// velocity is not sure to differ from zero [default: drop]
    #[arg(long, value_enum)]
    pub(crate) standstill: Option<StandstillArg>,
    /// Velocities below this, rad/s or m/s, count as rest too
    #[arg(long, value_name = "V", value_parser = not_negative)]
    pub(crate) rest_speed: Option<f64>,
    /// By how many seconds an effort is logged after the motion that it belongs to:
    /// NAME=S. Every `identify` estimates it; `auto` corrects what least squares
    /// of these logs finds
    #[arg(long, value_name = "NAME=S|auto")]
    pub(crate) delay: Vec<DelayArg>,
    /// Use the balance of energy over windows of this length in s instead of
    /// the equations of motion: no accelerations are needed
    #[arg(long, value_name = "S")]
    pub(crate) energy: Option<f64>,
    /// What the experiment file says, over which the options win.
    #[arg(skip)]
    pub(crate) experiment: Option<Box<Experiment>>,
}

/// Parses the path of a log or an experiment file.
pub(crate) fn run() -> ValueParser {
    ValueParser::new(OsStringValueParser::new().map(|path| Run::from(PathBuf::from(path))))
}

/// Which velocities are used
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum VelocitiesArg {
    /// Those of the log's columns, where it has any: the default
    Measured,
    /// Those computed from the positions
    Computed,
}

/// Whether the bodies that a description marks as payloads are carried
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PayloadArg {
    /// The robot without them: they have no parameters
    None,
    /// They are bodies like all others
    Carried,
    /// Carried and to be identified, by `identify` with the robot's --parameters
    Unknown,
}

/// What is done with rows that cannot be used
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProblemsArg {
    /// List them and stop
    Fail,
    /// Go on without them; the log is cut there
    Drop,
    /// Go on with them where they are numbers: outliers, saturated efforts,
    /// encoders that look stuck
    Keep,
    /// As keep, and list them
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
        let (name, seconds) = named(text)?;
        if !seconds.is_finite() {
            return Err(format!("{seconds} is not a finite number of seconds"));
        }
        Ok(Self::Of(name, seconds))
    }
}

/// What is done with equations of joints at rest
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum StandstillArg {
    /// Leave them out
    Drop,
    /// Use them as all others
    Keep,
    /// Let each count by the part of the filter's memory in which its joint moved
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

fn named(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("NAME=VALUE is needed")?;
    let value = value.trim().parse().map_err(|e| format!("{value}: {e}"))?;
    Ok((name.trim().to_owned(), value))
}
