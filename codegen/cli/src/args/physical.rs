//! The options of `regen identify` for physical parameters, friction and model reduction.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{ArgGroup, Args, ValueHint};
use regen_identify::data::Run;
use regen_identify::intervals::DEFAULT_DRAWS;

use super::reading::run;

#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Physical parameters")]
#[command(group(ArgGroup::new("physical").multiple(true)))]
pub(crate) struct PhysicalArgs {
    /// Decide whether any physical robot has the least-squares parameters, then find
    /// the physical parameters that fit best: all ten of every body
    #[arg(long, group = "physical")]
    pub(crate) feasible: bool,
    /// Identify the nonlinear friction of the spec (atan, power, stribeck, lugre)
    /// together with all other parameters, which are physical (Eq. 29)
    #[arg(long, group = "physical", conflicts_with_all = ["from", "huber", "energy", "cross", "bandwidth"])]
    pub(crate) friction: bool,
    /// Eliminate base parameters that are zero within their errors, as long as
    /// the fit gets no worse than chance explains, and make the rest physically
    /// feasible; every step is printed
    #[arg(long, conflicts_with_all = ["physical", "huber"])]
    pub(crate) reduce: bool,
    /// Logs to predict with every model, and to cross-validate --reduce with
    #[arg(long, value_name = "LOG", num_args = 1.., value_parser = run(), value_hint = ValueHint::AnyPath)]
    pub(crate) against: Vec<Run>,
    /// Use the spec's nominal values as a prior: `weighted` or `weighted:PERCENT`,
    /// with standard deviations in percent of them [default 30], or `entropic` or
    /// `entropic:WEIGHT`, with the divergence of pseudo-inertias [default 1]
    #[arg(
        long,
        value_name = "KIND",
        requires = "physical",
        hide_short_help = true
    )]
    pub(crate) prior: Option<PriorArg>,
    /// A parameter's value, SI: LABEL=VALUE, such as 'm(3)=6.05'
    #[arg(long, value_name = "LABEL=VALUE", requires = "physical", value_parser = value, hide_short_help = true)]
    pub(crate) known: Vec<(String, f64)>,
    /// A parameter's limits, SI: LABEL=LOW..HIGH, either may be missing
    #[arg(long, value_name = "LABEL=RANGE", requires = "physical", value_parser = range)]
    pub(crate) bound: Vec<(String, f64, f64)>,
    /// A known sum: 'm(1),m(2),m(3)=12.5'
    #[arg(long, value_name = "LABELS=VALUE", requires = "physical", value_parser = value, hide_short_help = true)]
    pub(crate) total: Vec<(String, f64)>,
    /// Bodies that are the same, in frames that correspond: 1,4,6
    #[arg(
        long,
        value_name = "BODIES",
        requires = "physical",
        hide_short_help = true
    )]
    pub(crate) identical: Vec<String>,
    /// The number of random draws for the intervals of constrained values, each of
    /// which takes a small fit; at least 5, or 0 for no intervals
    #[arg(long, value_name = "N", default_value_t = DEFAULT_DRAWS, requires = "physical", value_parser = draws, hide_short_help = true)]
    pub(crate) draws: usize,
    /// Write the spec with the physical values in `bodies:` and in the joints'
    /// `nominal:`; the rest of its text stays
    #[arg(long, value_name = "SPEC", requires = "physical")]
    pub(crate) bodies: Option<PathBuf>,
    /// Write the parameters as Rust constants for a controller
    #[arg(long, value_name = "FILE")]
    pub(crate) rust: Option<PathBuf>,
    /// Write the parameters as a C header of initialisers; it includes the robot's
    /// header, and compiles with that of this model only
    #[arg(long, value_name = "FILE")]
    pub(crate) c: Option<PathBuf>,
    /// Write the parameters as a Python module, with a check of the model
    #[arg(long, value_name = "FILE", hide_short_help = true)]
    pub(crate) python: Option<PathBuf>,
    /// The Rust path of the robot's generated module, seen from the constants, which
    /// compile with that model only [default: super::ROBOT]
    #[arg(long, value_name = "PATH", requires = "rust", hide_short_help = true)]
    pub(crate) module: Option<String>,
}

impl PhysicalArgs {
    /// Whether an option asks for physical parameters.
    pub(crate) fn wanted(&self) -> bool {
        self.feasible || self.friction
    }
}

/// The trust in nominal values, as given with `--prior`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum PriorArg {
    /// Each nominal value has a standard deviation of this part of itself.
    Weighted(f64),
    /// The log-det divergence of each body from its nominal one, with this weight.
    Entropic(f64),
}

impl FromStr for PriorArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (kind, figure) = match text.split_once(':') {
            Some((kind, figure)) => (kind, Some(positive(figure)?)),
            None => (text, None),
        };
        match kind {
            "weighted" => Ok(Self::Weighted(figure.unwrap_or(30.0) / 100.0)),
            "entropic" => Ok(Self::Entropic(figure.unwrap_or(1.0))),
            other => Err(format!("`{other}` is neither `weighted` nor `entropic`")),
        }
    }
}

fn positive(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err(format!("`{text}` is not a number above 0")),
    }
}

fn number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(format!("`{text}` is not a number")),
    }
}

/// The smallest number of draws that gives an interval.
const MIN_DRAWS: usize = 5;

/// The largest number of draws: each is a fit, and all of them are kept.
const MAX_DRAWS: usize = 100_000;

pub(super) fn draws(text: &str) -> Result<usize, String> {
    match text.trim().parse::<usize>() {
        Ok(value) if value == 0 || (MIN_DRAWS..=MAX_DRAWS).contains(&value) => Ok(value),
        _ => Err(format!(
            "`{text}` is neither 0 nor a whole number from {MIN_DRAWS} to {MAX_DRAWS}"
        )),
    }
}

pub(super) fn value(text: &str) -> Result<(String, f64), String> {
    let (label, value) = text.split_once('=').ok_or("LABEL=VALUE is needed")?;
    Ok((label.trim().to_owned(), number(value)?))
}

fn range(text: &str) -> Result<(String, f64, f64), String> {
    let wanted = "LABEL=LOW..HIGH is needed";
    let (label, limits) = text.split_once('=').ok_or(wanted)?;
    let (low, high) = limits.split_once("..").ok_or(wanted)?;
    let limit = |text: &str, none: f64| match text.trim() {
        "" => Ok(none),
        text => number(text),
    };
    let low = limit(low, f64::NEG_INFINITY)?;
    let high = limit(high, f64::INFINITY)?;
    if low > high {
        return Err(format!("{low} is above {high}"));
    }
    Ok((label.trim().to_owned(), low, high))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn priors_and_ranges_are_read_and_their_mistakes_reported() {
        assert_eq!("weighted:20".parse(), Ok(PriorArg::Weighted(0.2)));
        assert_eq!("entropic".parse(), Ok(PriorArg::Entropic(1.0)));
        assert!("entropic:-1".parse::<PriorArg>().is_err());
        assert!("cad".parse::<PriorArg>().unwrap_err().contains("cad"));
        assert_eq!(
            range("m(3)=..2"),
            Ok(("m(3)".to_owned(), f64::NEG_INFINITY, 2.0))
        );
        assert!(range("m(3)=2..1").is_err() && range("m(3)=2").is_err());
        assert_eq!(value("m(1),m(2)=3"), Ok(("m(1),m(2)".to_owned(), 3.0)));
        assert!(value("m(1)=heavy").is_err());
    }
}
