//! What is wrong with a log, with its rows.

use core::fmt;

use serde::{Deserialize, Serialize};

use crate::estimate::EstimateError;
use crate::signals::SignalError;
use regen_runtime::{ClosureError, SizeError};

/// A row that cannot be used, or a place where rows are missing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Problem {
    /// The line of a CSV file, from 1, its header being line 1; the row of a Parquet file, from 1.
    pub row: u64,
    /// What is wrong there.
    pub what: Fault,
}

/// What is wrong with a row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fault {
    /// More or fewer entries than the header.
    Entries {
        /// Entries there are.
        found: usize,
        /// Entries of the header.
        expected: usize,
    },
    /// An entry that is no number, NaN, infinite, empty or null.
    NotANumber {
        /// The column.
        column: String,
        /// What stands there.
        text: String,
    },
    /// The time of the row before.
    Duplicate {
        /// The time, s.
        time: f64,
    },
    /// A time before that of the row before.
    Unsorted {
        /// The time, s.
        time: f64,
    },
    /// A time far before that of the row before: a clock that was set.
    ClockBack {
        /// How far, s.
        step: f64,
    },
    /// A step much longer than usual before this row.
    Gap {
        /// The step, s.
        step: f64,
        /// The usual step, s.
        usual: f64,
    },
    /// A value far from those around it.
    Outlier {
        /// The column.
        column: String,
        /// The value in SI.
        value: f64,
        /// The median of the values around it.
        around: f64,
    },
    /// One of several rows in which an effort stands still at its largest or smallest value.
    Saturated {
        /// The column.
        column: String,
        /// The value in SI.
        value: f64,
    },
    /// The first of several rows in which a position stands exactly still though it was moving
    /// before, or moves on in a jump: the encoder was stuck.
    Stuck {
        /// The column.
        column: String,
        /// The value in SI.
        value: f64,
        /// The last of the rows.
        until: u64,
    },
    /// A last row that ends without an end of line within its last number.
    Cut {
        /// The column.
        column: String,
        /// What stands there.
        text: String,
    },
    /// A state that does not close the loops or is singular.
    Open {
        /// Why.
        why: String,
    },
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "row {}: ", self.row)?;
        match &self.what {
            Fault::Entries { found, expected } => {
                write!(f, "{found} entries, the header has {expected}")
            }
            Fault::NotANumber { column, text } if text.trim().is_empty() => {
                write!(f, "nothing stands in column `{column}`")
            }
            Fault::NotANumber { column, text } => {
                write!(f, "`{text}` in column `{column}` is no finite number")
            }
            Fault::Duplicate { time } => write!(f, "time {time} s is that of the row before"),
            Fault::Unsorted { time } => write!(f, "time {time} s is before the row before"),
            Fault::ClockBack { step } => write!(
                f,
                "the clock jumps back by {step:.6} s; rows are of no use until it has caught up"
            ),
            Fault::Gap { step, usual } => {
                write!(
                    f,
                    "a gap of {step:.6} s before it, the usual step is {usual:.6} s"
                )
            }
            Fault::Outlier {
                column,
                value,
                around,
            } => write!(
                f,
                "{value} in column `{column}` is an outlier: around it is {around}"
            ),
            Fault::Saturated { column, value } => {
                write!(
                    f,
                    "column `{column}` stands still at its extreme {value}: saturated"
                )
            }
            Fault::Stuck {
                column,
                value,
                until,
            } => write!(
                f,
                "column `{column}` stands still at {value} until row {until}, while the motion \
                 before or after does not: a stuck encoder"
            ),
            Fault::Cut { column, text } => write!(
                f,
                "the file ends without an end of line in `{text}` of column `{column}`: the row \
                 was cut short"
            ),
            Fault::Open { why } => write!(f, "{why}"),
        }
    }
}

impl Problem {
    /// How many rows it is about.
    pub fn rows(&self) -> usize {
        match &self.what {
            Fault::Stuck { until, .. } => {
                usize::try_from(until.saturating_sub(self.row)).map_or(1, |rows| rows + 1)
            }
            _ => 1,
        }
    }
}

/// The kinds of faults whose rows are numbers in the order of time all the same.
const NUMBERS: [&str; 3] = ["outlier", "saturation", "stuck encoder"];

impl Fault {
    /// Its kind, for counting.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Entries { .. } => "wrong number of entries",
            Self::NotANumber { .. } => "not a number",
            Self::Duplicate { .. } => "duplicate time",
            Self::Unsorted { .. } => "unsorted time",
            Self::ClockBack { .. } => "clock set back",
            Self::Gap { .. } => "gap",
            Self::Outlier { .. } => "outlier",
            Self::Saturated { .. } => "saturation",
            Self::Stuck { .. } => "stuck encoder",
            Self::Cut { .. } => "cut short",
            Self::Open { .. } => "not closed",
        }
    }
}

/// What a user wants done with rows that cannot be used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Policy {
    /// To be told of all of them, and nothing computed.
    #[default]
    Fail,
    /// To go on without them; the log is cut there.
    Drop,
    /// To go on with them where they are numbers in the order of time: outliers, saturated efforts
    /// and encoders that look stuck count as any row. What is no number is left out.
    Keep,
    /// As `Keep`, and to be told of all of them.
    Tell,
}

impl Policy {
    /// Whether rows are used though something is said of them.
    ///
    /// ```
    /// use regen_identify::data::Policy;
    ///
    /// assert!(Policy::Keep.keeps() && Policy::Tell.keeps());
    /// assert!(!Policy::Fail.keeps() && !Policy::Drop.keeps());
    /// ```
    pub fn keeps(self) -> bool {
        matches!(self, Self::Keep | Self::Tell)
    }
}

/// Problems of a log: the first ones, and how many of each kind.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Problems {
    /// The first ones.
    pub first: Vec<Problem>,
    /// Kinds with their numbers, in order of appearance.
    pub counts: Vec<(String, usize)>,
}

/// Problems that are told one by one.
const TOLD: usize = 20;

impl Problems {
    pub(super) fn add(&mut self, problem: Problem) {
        let kind = problem.what.kind();
        match self.counts.iter_mut().find(|(k, _)| k == kind) {
            Some((_, count)) => *count += problem.rows(),
            None => self.counts.push((kind.to_owned(), problem.rows())),
        }
        if self.first.len() < TOLD {
            self.first.push(problem);
        }
    }

    /// Replaces what an earlier pass said of states that do not close.
    pub(super) fn replace_open(&mut self, fresh: &Self) {
        let open = Fault::Open { why: String::new() }.kind();
        self.counts.retain(|(kind, _)| kind != open);
        self.first.retain(|problem| problem.what.kind() != open);
        self.counts.extend(fresh.counts.iter().cloned());
        self.first.extend(fresh.first.iter().cloned());
    }

    /// How many there are.
    pub fn total(&self) -> usize {
        self.counts.iter().map(|(_, count)| count).sum()
    }

    /// The kinds of those that a policy leaves out, with their numbers, in order of appearance.
    ///
    /// ```
    /// use regen_identify::data::{Policy, Problems};
    ///
    /// let problems = Problems {
    ///     counts: vec![("outlier".to_owned(), 3), ("not a number".to_owned(), 1)],
    ///     ..Problems::default()
    /// };
    /// assert_eq!(problems.left_out(Policy::Drop).len(), 2);
    /// assert_eq!(problems.left_out(Policy::Keep), [("not a number", 1)]);
    /// ```
    pub fn left_out(&self, policy: Policy) -> Vec<(&str, usize)> {
        let counts = self.counts.iter().map(|(kind, n)| (kind.as_str(), *n));
        counts
            // the rows on both sides of a gap are there
            .filter(|(kind, _)| *kind != "gap" && !(policy.keeps() && NUMBERS.contains(kind)))
            .collect()
    }
}

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for problem in &self.first {
            writeln!(f, "  {problem}")?;
        }
        if self.total() > self.first.len() {
            let kinds = self
                .counts
                .iter()
                .map(|(kind, count)| format!("{count} x {kind}"));
            let kinds: Vec<String> = kinds.collect();
            writeln!(f, "  ... in all {}", kinds.join(", "))?;
        }
        Ok(())
    }
}

/// Why a log was not read.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum DataError {
    /// The file cannot be read.
    Io {
        /// The file.
        file: String,
        /// Why.
        why: String,
    },
    /// The file is no log of this robot.
    ColumnLayout {
        /// The file.
        file: String,
        /// Why, and what to do.
        why: String,
    },
    /// Columns that the file does not name as the robot does.
    Columns {
        /// The file.
        file: String,
        /// Why: a sentence that ends with the assignment.
        why: String,
        /// The [`Assignment`](super::Assignment) that would help, as it is written.
        assignment: String,
    },
    /// Rows that cannot be used, under [`Policy::Fail`].
    Problems {
        /// The file.
        file: String,
        /// They.
        problems: Problems,
    },
    /// Positions that cannot be differentiated.
    Signal {
        /// The file.
        file: String,
        /// Why.
        why: SignalError,
    },
    /// A model that cannot be closed, or does not fit.
    Model(ClosureError),
    /// Equations that do not fit or do not determine the parameters.
    Estimate(EstimateError),
    /// A balance of energy was asked of parameters with nonlinear friction, which predict forces.
    FrictionOfEnergy,
    /// Nonlinear friction that does not fit the model.
    Feasibility(crate::feasibility::FeasibilityError),
}

impl fmt::Display for DataError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Io { file, why } => write!(f, "cannot read {file}: {why}"),
            Self::ColumnLayout { file, why } => write!(f, "{file}: {why}"),
            Self::Columns {
                file,
                why,
                assignment,
            } => write!(f, "{file}: {why} `{assignment}`"),
            Self::Problems { file, problems } => write!(
                f,
                "{file}: {} {} cannot be used\n{problems}",
                problems.total(),
                if problems.total() == 1 { "row" } else { "rows" }
            ),
            Self::Signal { file, why } => write!(f, "{file}: {why}"),
            Self::Model(why) => write!(f, "{why}"),
            Self::Estimate(why) => write!(f, "{why}"),
            Self::FrictionOfEnergy => {
                f.write_str("parameters with nonlinear friction predict forces, not energy")
            }
            Self::Feasibility(why) => write!(f, "{why}"),
        }
    }
}

impl core::error::Error for DataError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Signal { why, .. } => Some(why),
            Self::Model(why) => Some(why),
            Self::Estimate(why) => Some(why),
            Self::Feasibility(why) => Some(why),
            Self::Io { .. }
            | Self::ColumnLayout { .. }
            | Self::Columns { .. }
            | Self::Problems { .. }
            | Self::FrictionOfEnergy => None,
        }
    }
}

impl From<EstimateError> for DataError {
    fn from(error: EstimateError) -> Self {
        Self::Estimate(error)
    }
}

impl From<crate::feasibility::FeasibilityError> for DataError {
    fn from(error: crate::feasibility::FeasibilityError) -> Self {
        Self::Feasibility(error)
    }
}

impl From<ClosureError> for DataError {
    fn from(error: ClosureError) -> Self {
        Self::Model(error)
    }
}

impl From<SizeError> for DataError {
    fn from(error: SizeError) -> Self {
        Self::Model(ClosureError::Size(error))
    }
}

/// A median of few values; NaN of none.
pub(super) fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    match n {
        0 => f64::NAN,
        _ if n % 2 == 1 => sorted[n / 2],
        _ => 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]),
    }
}
