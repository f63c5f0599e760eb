//! Reads the rows of one file and checks them for faults.

use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use csv::{ByteRecord, Reader};

use super::columns::{Assignment, ColumnLayout, Unfit, shortened};
use super::problem::{DataError, Fault, Problem, median};
use super::rates::Rates;
use super::stuck::{PositionChanges, PositionHistory, Stuck};
use regen_runtime::Info;

/// A row in SI, in the order of [`ColumnLayout::channels`].
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LogRow {
    /// The line of a CSV file, or the row of a Parquet file, from 1; see [`Problem::row`].
    pub(super) line: u64,
    /// The time, s, then the other channels.
    pub(super) values: Vec<f64>,
}

/// Statistics of a whole log file, gathered in a first pass before its rows are used.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Survey {
    /// The median time step between rows, s.
    time_step: f64,
    /// The smallest and largest value of each effort, N or N m.
    extremes: Vec<(f64, f64)>,
    /// The stretches of rows in which an encoder was stuck, by the line of their first row.
    stuck: BTreeMap<u64, Vec<Stuck>>,
    /// For each measured position, the sizes of its changes between rows.
    position_changes: Vec<PositionChanges>,
}

impl Survey {
    /// The median time step between rows, s.
    pub(super) fn time_step(&self) -> f64 {
        self.time_step
    }
}

/// Number of first rows from whose times the median step is computed.
const STEP_ROWS: usize = 1001;
/// A time step longer than this many median ones is a gap; a clock that goes back by more was set
/// back.
const GAP_STEPS: f64 = 1.5;
/// Rows on either side of a value that decide whether it is an outlier.
const OUTLIER_NEIGHBOURS: usize = 3;
/// How far a position may be from the median of those around it, in median changes between these
/// rows: smooth motion and noise stay within a few.
const OUTLIER_CHANGES: f64 = 30.0;
/// How far a position may be from the median of those around it, in steps of the encoder's
/// resolution: a joint at rest on the border of two steps changes between both.
const OUTLIER_ENCODER_STEPS: f64 = 2.0;
/// Number of consecutive rows at its smallest or largest value from which on an effort counts as
/// saturated.
const SATURATED_ROWS: usize = 4;

/// One log file with its columns.
#[derive(Clone, Debug)]
pub(super) struct LogFile {
    pub(super) path: PathBuf,
    /// The channels of the model and their columns in the file.
    pub(super) layout: ColumnLayout,
    /// Whether the file is Parquet; else CSV.
    parquet: bool,
    /// Whether outliers, saturated efforts and rows of stuck encoders are used.
    pub(super) keep: bool,
    /// The length in bytes of a CSV file whose last line has no end of line.
    unended_length: Option<u64>,
}

/// First bytes of a Parquet file.
const PARQUET_MAGIC: [u8; 4] = *b"PAR1";

/// Whether a file is Parquet, by its first bytes; false if it cannot be read, which a later read
/// reports.
fn is_parquet(path: &Path) -> bool {
    let mut start = [0; 4];
    File::open(path).is_ok_and(|mut file| file.read_exact(&mut start).is_ok())
        && start == PARQUET_MAGIC
}

/// The length in bytes of a file whose last line has no end of line; `None` for other files and
/// where it cannot be read, which a later read reports.
fn unended_length(path: &Path) -> Option<u64> {
    let mut file = File::open(path).ok()?;
    let length = file.seek(SeekFrom::End(0)).ok()?;
    let mut last = [0];
    file.seek(SeekFrom::End(-1)).ok()?;
    file.read_exact(&mut last).ok()?;
    (!b"\r\n".contains(&last[0])).then_some(length)
}

#[cfg(not(feature = "parquet"))]
fn unsupported(path: &Path) -> DataError {
    DataError::ColumnLayout {
        file: path.display().to_string(),
        why: "this is a Parquet file: build with the feature `parquet`".to_owned(),
    }
}

impl LogFile {
    pub(super) fn open(
        path: &Path,
        info: &Info<'_>,
        assignments: &[Assignment],
    ) -> Result<Self, DataError> {
        Self::with(path, |header| ColumnLayout::new(header, info, assignments))
    }

    /// Opens a file whose columns `layout` finds by its header.
    pub(super) fn with(
        path: &Path,
        layout: impl FnOnce(Vec<String>) -> Result<ColumnLayout, Unfit>,
    ) -> Result<Self, DataError> {
        let parquet = is_parquet(path);
        let header = if parquet {
            #[cfg(feature = "parquet")]
            {
                super::parquet::header(path)?
            }
            #[cfg(not(feature = "parquet"))]
            {
                return Err(unsupported(path));
            }
        } else {
            let mut reader = reader(path)?;
            let titles = reader.headers().map_err(|error| failed(path, &error))?;
            titles.iter().map(|title| title.trim().to_owned()).collect()
        };
        let layout = layout(header).map_err(|unfit| {
            let (file, why) = (path.display().to_string(), unfit.why);
            match unfit.assignment {
                Some(assignment) => DataError::Columns {
                    file,
                    why,
                    assignment,
                },
                None => DataError::ColumnLayout { file, why },
            }
        })?;
        Ok(Self {
            path: path.to_path_buf(),
            layout,
            parquet,
            keep: false,
            unended_length: if parquet { None } else { unended_length(path) },
        })
    }

    /// Reads the file once for the statistics of all its rows.
    pub(super) fn survey(&self) -> Result<Survey, DataError> {
        let mut times: Vec<f64> = Vec::new();
        let mut extremes = vec![(f64::INFINITY, f64::NEG_INFINITY); self.layout.efforts];
        let positions = self.layout.positions();
        let mut histories = vec![PositionHistory::default(); positions.len()];
        let mut rates = Rates::default();
        let mut last_time = None;
        self.records(&mut |row| {
            let Ok(row) = row else {
                last_time = None;
                return Ok(());
            };
            {
                if let (true, Some(&time)) = (times.len() < STEP_ROWS, row.values.first()) {
                    times.push(time);
                }
                for (extreme, value) in extremes.iter_mut().zip(&row.values[self.layout.efforts()])
                {
                    *extreme = (extreme.0.min(*value), extreme.1.max(*value));
                }
                let time = row.values[0];
                if last_time.is_none_or(|last| time <= last) {
                    histories.iter_mut().for_each(PositionHistory::pause);
                    rates.pause();
                }
                last_time = Some(time);
                let row_positions = &row.values[positions.clone()];
                for (history, value) in histories.iter_mut().zip(row_positions) {
                    history.push(row.line, *value);
                }
                if self.layout.derivatives {
                    rates.push(positions.len(), &row.values);
                }
            }
            Ok(())
        })?;
        if let Some(why) = rates.judge(&|entry| self.layout.title(entry)) {
            return Err(DataError::ColumnLayout {
                file: self.path.display().to_string(),
                why,
            });
        }
        let mut stuck = BTreeMap::<u64, Vec<Stuck>>::new();
        let mut position_changes = Vec::with_capacity(positions.len());
        for (history, entry) in histories.into_iter().zip(positions) {
            let (stretches, changes) = history.finish(entry);
            position_changes.push(changes);
            for stretch in stretches {
                stuck.entry(stretch.first).or_default().push(stretch);
            }
        }
        let time_steps = times.windows(2).map(|pair| pair[1] - pair[0]);
        let time_steps: Vec<f64> = time_steps.filter(|step| *step > 0.0).collect();
        Ok(Survey {
            time_step: median(&time_steps),
            extremes,
            stuck,
            position_changes,
        })
    }

    /// Passes each row, or why it cannot be used, to `each`.
    fn records(
        &self,
        each: &mut dyn FnMut(Result<LogRow, Problem>) -> Result<(), DataError>,
    ) -> Result<(), DataError> {
        if self.parquet {
            #[cfg(feature = "parquet")]
            return super::parquet::records(&self.path, &self.layout, each);
            #[cfg(not(feature = "parquet"))]
            return Err(unsupported(&self.path));
        }
        let mut reader = reader(&self.path)?;
        let mut record = ByteRecord::new();
        let mut last_column = LastColumn::default();
        while reader
            .read_byte_record(&mut record)
            .map_err(|error| failed(&self.path, &error))?
        {
            let line = record.position().map_or(0, csv::Position::line);
            let is_unended_line = self
                .unended_length
                .is_some_and(|length| reader.position().byte() >= length);
            let is_cut = is_unended_line && last_column.is_cut(&record);
            last_column.push(&record);
            each(match self.parse(line, &record) {
                Ok(_) if is_cut => Err(self.cut_problem(line, &record)),
                row => row,
            })?;
        }
        Ok(())
    }

    /// The problem of a last row that was cut short.
    fn cut_problem(&self, line: u64, record: &ByteRecord) -> Problem {
        let text = record
            .get(record.len().saturating_sub(1))
            .unwrap_or_default();
        Problem {
            row: line,
            what: Fault::Cut {
                column: self.layout.header.last().cloned().unwrap_or_default(),
                text: shortened(&String::from_utf8_lossy(text)),
            },
        }
    }

    /// Converts the entries of a row to SI.
    fn parse(&self, line: u64, record: &ByteRecord) -> Result<LogRow, Problem> {
        let expected = self.layout.header.len();
        if record.len() != expected {
            return Err(Problem {
                row: line,
                what: Fault::Entries {
                    found: record.len(),
                    expected,
                },
            });
        }
        let mut values = Vec::with_capacity(self.layout.channels.len());
        for (entry, channel) in self.layout.channels.iter().enumerate() {
            let text = core::str::from_utf8(record.get(channel.index).unwrap_or_default());
            let text = text.unwrap_or("?").trim();
            match text.parse::<f64>() {
                Ok(value) if value.is_finite() => values.push(value * channel.factor),
                _ => {
                    return Err(Problem {
                        row: line,
                        what: Fault::NotANumber {
                            column: self.layout.title(entry),
                            text: shortened(text),
                        },
                    });
                }
            }
        }
        Ok(LogRow { line, values })
    }

    /// Passes the good rows to `each`, each with whether it follows the one before without a gap,
    /// and the faulty ones to `problem`.
    pub(super) fn rows(
        &self,
        survey: &Survey,
        problem: &mut dyn FnMut(Problem),
        each: &mut dyn FnMut(LogRow, bool) -> Result<(), DataError>,
    ) -> Result<(), DataError> {
        let mut checker = RowChecker {
            layout: &self.layout,
            survey,
            queue: VecDeque::with_capacity(OUTLIER_ROWS + 1),
            last_time: None,
            segment_ended: true,
            gap_reported: true,
            previous_time: None,
            clock_set_back: false,
            stuck_until: 0,
            rows_skipped: false,
            rows_at_extreme: vec![0; self.layout.efforts],
            keep: self.keep,
        };
        self.records(&mut |row| {
            match row {
                Ok(row) => checker.take(row, problem),
                Err(found) => {
                    problem(found);
                    checker.gap_reported = true;
                }
            }
            if checker.queue.len() > OUTLIER_ROWS {
                checker.release(problem, each)?;
            }
            Ok(())
        })?;
        while !checker.queue.is_empty() {
            checker.release(problem, each)?;
        }
        Ok(())
    }
}

/// Number of rows that an outlier is searched in: a value and its neighbours.
const OUTLIER_ROWS: usize = 2 * OUTLIER_NEIGHBOURS + 1;

/// A row in the look-ahead buffer: it is judged once the next rows have been read.
struct PendingRow {
    row: LogRow,
    /// Whether there is no gap between the row before and this one.
    follows: bool,
    fault: Option<Fault>,
}

#[allow(
    clippy::struct_excessive_bools,
    reason = "the flags are independent of each other"
)]
/// Checks the rows of a file for faults in a look-ahead buffer.
struct RowChecker<'a> {
    layout: &'a ColumnLayout,
    survey: &'a Survey,
    /// The look-ahead buffer, the oldest row first.
    queue: VecDeque<PendingRow>,
    /// The time, s, of the last row that was in order of time, whether it is used or not.
    last_time: Option<f64>,
    /// Whether the next row that is released does not follow the last one released.
    segment_ended: bool,
    /// Whether a gap before the next row comes from a row that was already reported.
    gap_reported: bool,
    /// The time, s, of the row before, in order or not, used or not.
    previous_time: Option<f64>,
    /// The line up to which rows are left out because an encoder is stuck.
    stuck_until: u64,
    /// Whether the rows just before the next one were left out because an encoder was stuck.
    rows_skipped: bool,
    /// Whether the clock was set back and has not yet caught up.
    clock_set_back: bool,
    /// For each effort, the number of consecutive rows so far at its smallest or largest value.
    rows_at_extreme: Vec<usize>,
    /// Whether outliers, saturated efforts and rows of stuck encoders are used.
    keep: bool,
}

impl RowChecker<'_> {
    /// Checks the time of a row and adds it to the buffer.
    fn take(&mut self, row: LogRow, problem: &mut dyn FnMut(Problem)) {
        let time = row.values.first().copied().unwrap_or(f64::NAN);
        let mut report = |what| {
            problem(Problem {
                row: row.line,
                what,
            });
        };
        let mut follows = true;
        let previous_time = self.previous_time.replace(time).unwrap_or(time);
        if let Some(last_time) = self.last_time {
            let step = time - last_time;
            let longest_step = GAP_STEPS * self.survey.time_step;
            if step <= 0.0 {
                // A row that is not after the last one in order is not used. If its time is behind
                // by more than `longest_step`, the clock was set back; by less, the rows are
                // unsorted; by nothing, the time is a duplicate. After the clock was set back,
                // which is reported once, rows that go on regularly from there are not reported.
                let follows_previous = (0.0..=longest_step).contains(&(time - previous_time));
                if !(self.clock_set_back && follows_previous) {
                    self.clock_set_back = -step > longest_step;
                    report(if self.clock_set_back {
                        Fault::ClockBack { step: -step }
                    } else if step < 0.0 {
                        Fault::Unsorted { time }
                    } else {
                        Fault::Duplicate { time }
                    });
                }
                // the gap that this row leaves is not reported as well
                self.gap_reported = true;
                return;
            }
            if step > longest_step {
                follows = false;
                if !self.gap_reported {
                    let usual = self.survey.time_step;
                    report(Fault::Gap { step, usual });
                }
            }
        }
        for stuck in self.survey.stuck.get(&row.line).into_iter().flatten() {
            if !self.keep {
                self.stuck_until = self.stuck_until.max(stuck.last);
            }
            report(Fault::Stuck {
                column: self.layout.title(stuck.entry),
                value: row.values[stuck.entry],
                until: stuck.last,
            });
        }
        if row.line <= self.stuck_until {
            // the gap that these rows leave is not reported, and the next row starts a segment
            self.gap_reported = true;
            self.last_time = Some(time);
            self.rows_skipped = true;
            return;
        }
        if core::mem::take(&mut self.rows_skipped) {
            follows = false;
        }
        self.gap_reported = false;
        self.clock_set_back = false;
        self.last_time = Some(time);
        let efforts = self.layout.efforts();
        let saturated = self.saturated_efforts(&row.values[efforts.clone()]);
        self.queue.push_back(PendingRow {
            row,
            follows,
            fault: None,
        });
        for (k, count) in saturated {
            // when the limit is reached, the rows before this one are marked as saturated too
            let marked_rows = if count == SATURATED_ROWS {
                SATURATED_ROWS
            } else {
                1
            };
            for pending in self.queue.iter_mut().rev().take(marked_rows) {
                pending.fault = Some(Fault::Saturated {
                    column: self.layout.title(efforts.start + k),
                    value: pending.row.values[efforts.start + k],
                });
            }
        }
        if self.queue.len() >= OUTLIER_ROWS {
            self.check_outliers();
        }
    }

    /// Counts the rows for which each effort has been at its smallest or largest value; returns the
    /// efforts with [`SATURATED_ROWS`] or more, each with its count.
    fn saturated_efforts(&mut self, values: &[f64]) -> Vec<(usize, usize)> {
        let mut saturated = Vec::new();
        let extremes = self.survey.extremes.iter();
        let counts = self.rows_at_extreme.iter_mut();
        for (k, ((value, extreme), count)) in values.iter().zip(extremes).zip(counts).enumerate() {
            let (low, high) = *extreme;
            let is_at_extreme = (*value >= high || *value <= low) && low < high;
            *count = if is_at_extreme { *count + 1 } else { 0 };
            if *count >= SATURATED_ROWS {
                saturated.push((k, *count));
            }
        }
        saturated
    }

    /// Checks the positions of the row in the middle of the last [`OUTLIER_ROWS`] for outliers.
    fn check_outliers(&mut self) {
        let start = self.queue.len() - OUTLIER_ROWS;
        for entry in self.layout.positions() {
            let values: Vec<f64> = self
                .queue
                .iter()
                .skip(start)
                .map(|pending| pending.row.values[entry])
                .collect();
            let middle = values[OUTLIER_NEIGHBOURS];
            // relative to the median change between these rows, so that fast motion is no outlier
            let changes: Vec<f64> = values
                .windows(2)
                .map(|pair| (pair[1] - pair[0]).abs())
                .collect();
            let usual = median(&changes);
            let around = median(&values);
            let first = self.layout.positions().start;
            let log_changes = self.survey.position_changes.get(entry - first);
            // changes as large as regular ones elsewhere in the log, or as a few encoder steps,
            // are allowed too
            let allowed =
                log_changes.map_or(0.0, |c| (OUTLIER_ENCODER_STEPS * c.encoder).max(c.regular));
            let allowed = allowed.max(OUTLIER_CHANGES * usual.max(f64::EPSILON * middle.abs()));
            // with a tolerance, as encoder steps are sums of rounded numbers
            if (middle - around).abs() > allowed * (1.0 + 1e-9) && usual > 0.0 {
                self.queue[start + OUTLIER_NEIGHBOURS].fault = Some(Fault::Outlier {
                    column: self.layout.title(entry),
                    value: middle,
                    around,
                });
            }
        }
    }

    /// Removes the oldest row from the buffer, and passes it to `each`, or its fault to `problem`.
    fn release(
        &mut self,
        problem: &mut dyn FnMut(Problem),
        each: &mut dyn FnMut(LogRow, bool) -> Result<(), DataError>,
    ) -> Result<(), DataError> {
        let Some(pending) = self.queue.pop_front() else {
            return Ok(());
        };
        if let Some(what) = pending.fault {
            problem(Problem {
                row: pending.row.line,
                what,
            });
            if !self.keep {
                self.segment_ended = true;
                return Ok(());
            }
        }
        let follows = pending.follows && !self.segment_ended;
        self.segment_ended = false;
        each(pending.row, follows)
    }
}

/// Least number of rows before a last line without an end of line that show the usual length of
/// its last entry.
const MIN_ROWS_BEFORE_CUT: usize = 20;

/// The lengths of the last entries of the rows so far.
#[derive(Default)]
struct LastColumn {
    /// The number of rows.
    rows: usize,
    /// The length of the shortest last entry, bytes.
    shortest: usize,
}

impl LastColumn {
    /// The length of the last entry of a row, bytes.
    fn length(record: &ByteRecord) -> usize {
        record
            .get(record.len().saturating_sub(1))
            .map_or(0, <[u8]>::len)
    }

    fn push(&mut self, record: &ByteRecord) {
        let length = Self::length(record);
        self.shortest = if self.rows == 0 {
            length
        } else {
            self.shortest.min(length)
        };
        self.rows += 1;
    }

    /// Whether the last entry of a row without an end of line is shorter than all before it.
    fn is_cut(&self, record: &ByteRecord) -> bool {
        self.rows >= MIN_ROWS_BEFORE_CUT && Self::length(record) < self.shortest
    }
}

/// A CSV reader that ignores lines starting with `#` and accepts rows of any length.
fn reader(path: &Path) -> Result<Reader<File>, DataError> {
    csv::ReaderBuilder::new()
        .flexible(true)
        .comment(Some(b'#'))
        .from_path(path)
        .map_err(|error| failed(path, &error))
}

/// The error of a file that cannot be read.
fn failed(path: &Path, error: &csv::Error) -> DataError {
    DataError::Io {
        file: path.display().to_string(),
        why: format!("{error}"),
    }
}
