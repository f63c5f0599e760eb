//! Faults of a log's rows, and the errors of reading logs.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::policy::{GAP_KINDS, Policies, Policy, SATURATION, USABLE_KINDS};
use crate::estimate::EstimateError;
use crate::signals::SignalError;
use regen_runtime::{ClosureError, SizeError};

/// A row that cannot be used, or a place where rows are missing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Problem {
    /// The line of a CSV file, from 1, its header being line 1; the row of a Parquet file or the
    /// number of a message on its topic, from 1.
    pub row: u64,
    /// The fault of this row.
    pub what: Fault,
    /// The last of consecutive rows with this fault; `None` where only this row has it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub last: Option<u64>,
}

/// A fault of a row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fault {
    /// The row has more or fewer entries than the header.
    Entries {
        /// The number of entries of the row.
        found: usize,
        /// The number of entries of the header.
        expected: usize,
    },
    /// An entry is not a number, NaN, infinite, empty or null.
    NotANumber {
        /// The header of the column.
        column: String,
        /// The text of the entry.
        text: String,
    },
    /// The row has the same time as the row before.
    Duplicate {
        /// The time, s.
        time: f64,
    },
    /// The time of the row is earlier than that of the row before.
    Unsorted {
        /// The time, s.
        time: f64,
    },
    /// The time of the row is far earlier than that of the row before: the clock was set back, and a
    /// segment begins.
    ClockBack {
        /// By how much time goes back, s.
        step: f64,
    },
    /// Positions jump at this row and do not come back, and a segment begins: an encoder lost its count, or
    /// another run begins.
    Jump {
        /// The headers of the columns.
        columns: Vec<String>,
        /// The change of the first of them, in SI.
        by: f64,
    },
    /// The time step before this row is much longer than usual.
    Gap {
        /// The step before this row, s.
        step: f64,
        /// The median step of the log, s.
        usual: f64,
    },
    /// The time step before this row is longer than usual, and no multiple of the usual one.
    Uneven {
        /// The step before this row, s.
        step: f64,
        /// The median step of the log, s.
        usual: f64,
    },
    /// The row repeats the one before in these columns, although what they measure went on, and with
    /// it the following rows.
    Dropout {
        /// The headers of the columns.
        columns: Vec<String>,
    },
    /// A position is far from those in the rows around it.
    Outlier {
        /// The header of the column.
        column: String,
        /// The value in SI.
        value: f64,
        /// The median of the values around it.
        around: f64,
    },
    /// An effort stays at its largest or smallest value over several rows, of which this is one.
    Saturated {
        /// The header of the column.
        column: String,
        /// The value in SI.
        value: f64,
    },
    /// A position repeats exactly over several rows, of which this is the first, although it was
    /// moving before or then goes on with a jump: the encoder was stuck.
    Stuck {
        /// The header of the column.
        column: String,
        /// The value in SI.
        value: f64,
        /// The last of the rows.
        until: u64,
    },
    /// The last row has no end of line, and its last number is shorter than in the rows before.
    Cut {
        /// The header of the last column.
        column: String,
        /// The text of the last entry.
        text: String,
    },
    /// The loops cannot be closed at this row's state, or the state is singular.
    Open {
        /// The reason, as a sentence.
        why: String,
    },
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.last {
            Some(last) => write!(f, "rows {} to {last}: ", self.row)?,
            None => write!(f, "row {}: ", self.row)?,
        }
        match &self.what {
            Fault::Entries { found, expected } => {
                write!(f, "{found} entries, the header has {expected}")
            }
            Fault::NotANumber { column, text } if text.trim().is_empty() => {
                write!(f, "column `{column}` is empty")
            }
            Fault::NotANumber { column, text } => {
                write!(f, "`{text}` in column `{column}` is not a finite number")
            }
            Fault::Duplicate { time } => write!(f, "time {time} s is that of the row before"),
            Fault::Unsorted { time } => write!(f, "time {time} s is before the row before"),
            Fault::ClockBack { step } => write!(f, "the clock jumps back by {step:.6} s"),
            Fault::Jump { columns, by } => {
                let s = if columns.len() == 1 { "s" } else { "" };
                write_columns(f, columns)?;
                write!(
                    f,
                    " jump{s} by {by:.6} and do{es} not come back: an encoder lost its count, or another run \
                     begins",
                    es = if s.is_empty() { "" } else { "es" }
                )
            }
            Fault::Gap { step, usual } => {
                write!(
                    f,
                    "a gap of {step:.6} s before it, the usual step is {usual:.6} s"
                )
            }
            Fault::Uneven { step, usual } => write!(
                f,
                "an uneven step of {step:.6} s before it, the usual step is {usual:.6} s"
            ),
            Fault::Dropout { columns } => {
                write_columns(f, columns)?;
                write!(f, " as in the row before: a dropout")
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

/// Names the first of some columns.
fn write_columns(f: &mut fmt::Formatter<'_>, columns: &[String]) -> fmt::Result {
    let named = columns.iter().take(MAX_NAMED_COLUMNS);
    let named: Vec<String> = named.map(|c| format!("`{c}`")).collect();
    let s = if columns.len() == 1 { "" } else { "s" };
    write!(f, "column{s} {}", named.join(", "))?;
    if let Some(more @ 1..) = columns.len().checked_sub(MAX_NAMED_COLUMNS) {
        write!(f, " and {more} more")?;
    }
    Ok(())
}

impl Problem {
    /// A fault of one row.
    pub fn of(row: u64, what: Fault) -> Self {
        Self {
            row,
            what,
            last: None,
        }
    }

    /// The number of rows with this fault.
    pub fn rows(&self) -> usize {
        let last = match &self.what {
            Fault::Stuck { until, .. } => *until,
            _ => self.last.unwrap_or(self.row),
        };
        usize::try_from(last.saturating_sub(self.row)).map_or(1, |rows| rows + 1)
    }

    /// Extends this problem by the next row if that has the same fault; returns whether it does.
    fn extend_if_same(&mut self, next: &Self) -> bool {
        let follows = self.last.unwrap_or(self.row).checked_add(1) == Some(next.row);
        let same = follows && self.what == next.what && !matches!(self.what, Fault::Stuck { .. });
        if same {
            self.last = Some(next.row);
        }
        same
    }
}

impl Fault {
    /// The name of the kind of fault, for counting.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Entries { .. } => "wrong number of entries",
            Self::NotANumber { .. } => "not a number",
            Self::Duplicate { .. } => "duplicate time",
            Self::Unsorted { .. } => "unsorted time",
            Self::ClockBack { .. } => "clock set back",
            Self::Jump { .. } => "jump",
            Self::Gap { .. } => "gap",
            Self::Uneven { .. } => "uneven step",
            Self::Dropout { .. } => "dropout",
            Self::Outlier { .. } => "outlier",
            Self::Saturated { .. } => SATURATION,
            Self::Stuck { .. } => "stuck encoder",
            Self::Cut { .. } => "cut short",
            Self::Open { .. } => "not closed",
        }
    }
}

/// Problems of a log: the first 20, where consecutive rows with one fault count as one, and the number
/// of rows of each kind.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Problems {
    /// The first problems found, at most 20.
    pub first: Vec<Problem>,
    /// The kinds of faults with their numbers of rows, in order of appearance.
    pub counts: Vec<(String, usize)>,
}

/// The kinds of faults that leave out no row.
const WITHOUT_ROWS: [&str; 4] = ["gap", "uneven step", "clock set back", "jump"];
/// The largest number of columns of a dropout that are named.
const MAX_NAMED_COLUMNS: usize = 4;
/// The largest number of problems that are listed one by one.
const MAX_LISTED_PROBLEMS: usize = 20;

impl Problems {
    pub(super) fn add(&mut self, problem: Problem) {
        let kind = problem.what.kind();
        match self.counts.iter_mut().find(|(k, _)| k == kind) {
            Some((_, count)) => *count += problem.rows(),
            None => self.counts.push((kind.to_owned(), problem.rows())),
        }
        let last = self.first.last_mut();
        let is_listed = last.is_some_and(|last| last.extend_if_same(&problem));
        if !is_listed && self.first.len() < MAX_LISTED_PROBLEMS {
            self.first.push(problem);
        }
    }

    /// Replaces the problems of states that do not close by those of a later pass.
    pub(super) fn replace_open(&mut self, fresh: &Self) {
        let open = Fault::Open { why: String::new() }.kind();
        self.counts.retain(|(kind, _)| kind != open);
        self.first.retain(|problem| problem.what.kind() != open);
        self.counts.extend(fresh.counts.iter().cloned());
        self.first.extend(fresh.first.iter().cloned());
    }

    /// Whether there are rows at whose states the loops do not close.
    pub fn has_open(&self) -> bool {
        let open = Fault::Open { why: String::new() }.kind();
        self.counts.iter().any(|(kind, _)| kind == open)
    }

    /// Whether there are rows in which an effort is saturated.
    pub fn has_saturated(&self) -> bool {
        self.counts.iter().any(|(kind, _)| kind == SATURATION)
    }

    /// The number of rows with problems, over all kinds.
    pub fn total(&self) -> usize {
        self.counts.iter().map(|(_, count)| count).sum()
    }

    /// The problems whose kinds are treated in this way.
    #[must_use]
    pub fn treated(&self, policies: &Policies, policy: Policy) -> Self {
        let own = |kind: &str| policies.of(kind) == policy;
        let first = self.first.iter().filter(|p| own(p.what.kind()));
        let counts = self.counts.iter().filter(|(kind, _)| own(kind));
        Self {
            first: first.cloned().collect(),
            counts: counts.cloned().collect(),
        }
    }

    /// The kinds of faults whose rows are left out, with their numbers of rows, in order of
    /// appearance.
    ///
    /// ```
    /// use regen_identify::data::{Policy, Problems};
    ///
    /// let problems = Problems {
    ///     counts: vec![("outlier".to_owned(), 3), ("not a number".to_owned(), 1)],
    ///     ..Problems::default()
    /// };
    /// assert_eq!(problems.left_out(&Policy::Drop.into()).len(), 2);
    /// assert_eq!(problems.left_out(&Policy::Keep.into()), [("not a number", 1)]);
    /// ```
    pub fn left_out(&self, policies: &Policies) -> Vec<(&str, usize)> {
        let counts = self.counts.iter().map(|(kind, n)| (kind.as_str(), *n));
        counts
            .filter(|(kind, _)| {
                let usable = USABLE_KINDS.contains(kind) || GAP_KINDS.contains(kind);
                let used = policies.of(kind).uses_doubtful_rows() && usable;
                // of a row with a saturated effort only the equations of that are left out
                !WITHOUT_ROWS.contains(kind) && !used && *kind != SATURATION
            })
            .collect()
    }
}

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for problem in &self.first {
            writeln!(f, "  {problem}")?;
        }
        if self.total() > self.first.iter().map(Problem::rows).sum::<usize>() {
            let kinds = self
                .counts
                .iter()
                .map(|(kind, count)| format!("{count} x {kind}"));
            let kinds: Vec<String> = kinds.collect();
            writeln!(f, "  ... in all: {}", kinds.join(", "))?;
        }
        Ok(())
    }
}

/// Error of reading logs and of computing states and equations from them.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum DataError {
    /// The file cannot be read.
    Io {
        /// The file.
        file: String,
        /// The reason.
        why: String,
    },
    /// The columns do not fit this robot.
    ColumnLayout {
        /// The file.
        file: String,
        /// The reason, and what to do.
        why: String,
    },
    /// The part of the file that is to be read is not determined, or the file lacks it.
    Part {
        /// The file.
        file: String,
        /// What is wrong, and which parts there are.
        why: String,
        /// What the part is called: `topic` or `episode`.
        key: &'static str,
    },
    /// The file does not name its columns as the robot names its coordinates.
    Columns {
        /// The file.
        file: String,
        /// The reason: a sentence that ends with the assignment.
        why: String,
        /// The [`Assignment`](super::Assignment) that would help, in its text form; of several, one on each
        /// line.
        assignment: String,
    },
    /// The file has faulty rows, under [`Policy::Fail`](super::Policy::Fail).
    Problems {
        /// The file.
        file: String,
        /// The faulty rows.
        problems: Problems,
    },
    /// The positions cannot be differentiated.
    Signal {
        /// The file.
        file: String,
        /// The reason.
        why: SignalError,
    },
    /// The model's loops cannot be closed, or its sizes do not fit.
    Model(ClosureError),
    /// The equations do not fit or do not determine the parameters.
    Estimate(EstimateError),
    /// Parameters with nonlinear friction, which predict forces, were to be used in an energy
    /// balance.
    NonlinearFrictionInEnergyBalance,
    /// The nonlinear friction does not fit the model.
    Feasibility(crate::feasibility::FeasibilityError),
}

impl fmt::Display for DataError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Io { file, why } => write!(f, "cannot read {file}: {why}"),
            Self::ColumnLayout { file, why } | Self::Part { file, why, .. } => {
                write!(f, "{file}: {why}")
            }
            Self::Columns {
                file,
                why,
                assignment,
            } => write!(f, "{file}: {why} `{}`", assignment.replace('\n', "`, `")),
            Self::Problems { file, problems } => write!(
                f,
                "{file}: {} {} cannot be used\n{problems}",
                problems.total(),
                if problems.total() == 1 { "row" } else { "rows" }
            ),
            Self::Signal { file, why } => write!(f, "{file}: {why}"),
            Self::Model(why) => write!(f, "{why}"),
            Self::Estimate(why) => write!(f, "{why}"),
            Self::NonlinearFrictionInEnergyBalance => {
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
            | Self::Part { .. }
            | Self::Problems { .. }
            | Self::NonlinearFrictionInEnergyBalance => None,
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

/// The median; NaN of an empty slice.
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
