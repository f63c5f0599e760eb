//! Reads the rows of one file and checks them for faults.

use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use csv::{ByteRecord, Reader};

use super::columns::{Assignment, ColumnLayout, shortened};
use super::problem::{DataError, Fault, Problem, median};
use super::rates::Rates;
use super::stuck::{PositionHistory, Steps, Stuck};
use regen_runtime::Info;

/// A row in SI, in the order of [`ColumnLayout::channels`].
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LogRow {
    pub(super) line: u64,
    pub(super) values: Vec<f64>,
}

/// Statistics of a whole log file, gathered in a first pass before its rows are used.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Survey {
    /// The median time step, s.
    step: f64,
    /// The smallest and largest value of each effort.
    extremes: Vec<(f64, f64)>,
    /// The rows in which encoders were stuck, by the first of them.
    stuck: BTreeMap<u64, Vec<Stuck>>,
    /// The sizes of each position's changes between rows.
    steps: Vec<Steps>,
}

impl Survey {
    /// The median time step, s.
    pub(super) fn step(&self) -> f64 {
        self.step
    }
}

/// Number of first rows from whose times the median step is computed.
const STEP_ROWS: usize = 1001;
/// A time step longer than this many median ones is a gap.
const GAP_STEPS: f64 = 1.5;
/// Rows on either side of a value that decide whether it is an outlier.
const OUTLIER_NEIGHBOURS: usize = 3;
/// How far a value may be from the median of those around it, in median changes between those
/// rows: smooth motion and noise stay within a few.
const OUTLIER_CHANGES: f64 = 30.0;
/// How far a value may be from the median of those around it, in steps of the encoder: at rest
/// between two steps, an encoder changes between both.
const OUTLIER_ENCODER_STEPS: f64 = 2.0;
/// Number of consecutive rows at an extreme from which on an effort counts as saturated.
const SATURATED_ROWS: usize = 4;

/// One file with its columns.
#[derive(Clone, Debug)]
pub(super) struct LogFile {
    pub(super) path: PathBuf,
    pub(super) layout: ColumnLayout,
    parquet: bool,
    /// Whether outliers, saturated efforts and rows of stuck encoders are used.
    pub(super) keep: bool,
    /// The length in bytes of a CSV file whose last line has no end of line.
    unended: Option<u64>,
}

/// First bytes of a Parquet file.
const MAGIC: [u8; 4] = *b"PAR1";

/// Whether a file is Parquet, by its first bytes; false if it cannot be read, which a later read
/// reports.
fn is_parquet(path: &Path) -> bool {
    let mut start = [0; 4];
    File::open(path).is_ok_and(|mut file| file.read_exact(&mut start).is_ok()) && start == MAGIC
}

/// The length in bytes of a file whose last line has no end of line; `None` for other files and
/// where it cannot be read, which a later read reports.
fn unended(path: &Path) -> Option<u64> {
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
        let layout = ColumnLayout::new(header, info, assignments).map_err(|unfit| {
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
            unended: if parquet { None } else { unended(path) },
        })
    }

    /// Reads the file once for the statistics of all its rows.
    pub(super) fn survey(&self) -> Result<Survey, DataError> {
        let mut times: Vec<f64> = Vec::new();
        let mut extremes = vec![(f64::INFINITY, f64::NEG_INFINITY); self.layout.efforts];
        let positions = self.layout.positions();
        let mut watches = vec![PositionHistory::default(); positions.len()];
        let mut rates = Rates::default();
        let mut last = None;
        self.records(&mut |row| {
            let Ok(row) = row else {
                last = None;
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
                if last.is_none_or(|last| time <= last) {
                    watches.iter_mut().for_each(PositionHistory::pause);
                    rates.pause();
                }
                last = Some(time);
                for (watch, value) in watches.iter_mut().zip(&row.values[positions.clone()]) {
                    watch.push(row.line, *value);
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
        let mut steps_of = Vec::with_capacity(positions.len());
        for (watch, entry) in watches.into_iter().zip(positions) {
            let (found, steps) = watch.finish(entry);
            steps_of.push(steps);
            for found in found {
                stuck.entry(found.first).or_default().push(found);
            }
        }
        let steps = times.windows(2).map(|pair| pair[1] - pair[0]);
        let steps: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
        Ok(Survey {
            step: median(&steps),
            extremes,
            stuck,
            steps: steps_of,
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
        let mut last = LastColumn::default();
        while reader
            .read_byte_record(&mut record)
            .map_err(|error| failed(&self.path, &error))?
        {
            let line = record.position().map_or(0, csv::Position::line);
            let ends = self
                .unended
                .is_some_and(|end| reader.position().byte() >= end);
            let cut = ends && last.cut(&record);
            last.push(&record);
            each(match self.parse(line, &record) {
                Ok(_) if cut => Err(self.cut(line, &record)),
                row => row,
            })?;
        }
        Ok(())
    }

    fn cut(&self, line: u64, record: &ByteRecord) -> Problem {
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
        let mut cleaner = Cleaner {
            layout: &self.layout,
            survey,
            queue: VecDeque::with_capacity(OUTLIER_ROWS + 1),
            last: None,
            segment_ended: true,
            gap_reported: true,
            previous_time: None,
            clock_set_back: false,
            until: 0,
            rows_skipped: false,
            stuck: vec![0; self.layout.efforts],
            keep: self.keep,
        };
        self.records(&mut |row| {
            match row {
                Ok(row) => cleaner.take(row, problem),
                Err(found) => {
                    problem(found);
                    cleaner.gap_reported = true;
                }
            }
            if cleaner.queue.len() > OUTLIER_ROWS {
                cleaner.release(problem, each)?;
            }
            Ok(())
        })?;
        while !cleaner.queue.is_empty() {
            cleaner.release(problem, each)?;
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
/// Look-ahead buffer that checks rows for faults as they pass.
struct Cleaner<'a> {
    layout: &'a ColumnLayout,
    survey: &'a Survey,
    queue: VecDeque<PendingRow>,
    /// The time of the last row in order of time.
    last: Option<f64>,
    /// Whether the next row that is released does not follow the last one released.
    segment_ended: bool,
    /// Whether a gap before the next row comes from a row that was already reported.
    gap_reported: bool,
    /// The time of the row before, whether it is used or not.
    previous_time: Option<f64>,
    /// The last row in which an encoder is stuck.
    until: u64,
    /// Whether rows before this one were left out.
    rows_skipped: bool,
    /// Whether the clock was set back and has not yet caught up.
    clock_set_back: bool,
    /// For how many rows each effort has been at an extreme.
    stuck: Vec<usize>,
    /// Whether outliers, saturated efforts and rows of stuck encoders are used.
    keep: bool,
}

impl Cleaner<'_> {
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
        if let Some(before) = self.last {
            let step = time - before;
            if step <= 0.0 {
                let far = GAP_STEPS * self.survey.step;
                // after a clock was set back, which is reported, it goes on from there
                if !(self.clock_set_back && (0.0..=far).contains(&(time - previous_time))) {
                    self.clock_set_back = -step > far;
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
            if step > GAP_STEPS * self.survey.step {
                follows = false;
                if !self.gap_reported {
                    let usual = self.survey.step;
                    report(Fault::Gap { step, usual });
                }
            }
        }
        for stuck in self.survey.stuck.get(&row.line).into_iter().flatten() {
            if !self.keep {
                self.until = self.until.max(stuck.last);
            }
            report(Fault::Stuck {
                column: self.layout.title(stuck.entry),
                value: row.values[stuck.entry],
                until: stuck.last,
            });
        }
        if row.line <= self.until {
            // the gap that these rows leave is not reported, and the next row starts a segment
            self.gap_reported = true;
            self.last = Some(time);
            self.rows_skipped = true;
            return;
        }
        if core::mem::take(&mut self.rows_skipped) {
            follows = false;
        }
        self.gap_reported = false;
        self.clock_set_back = false;
        self.last = Some(time);
        let efforts = self.layout.efforts();
        let standing = self.standing(&row.values[efforts.clone()]);
        self.queue.push_back(PendingRow {
            row,
            follows,
            fault: None,
        });
        for (k, count) in standing {
            // the first time the limit is reached, all rows up to here are saturated
            let back = if count == SATURATED_ROWS {
                SATURATED_ROWS
            } else {
                1
            };
            for waiting in self.queue.iter_mut().rev().take(back) {
                waiting.fault = Some(Fault::Saturated {
                    column: self.layout.title(efforts.start + k),
                    value: waiting.row.values[efforts.start + k],
                });
            }
        }
        if self.queue.len() >= OUTLIER_ROWS {
            self.judge();
        }
    }

    /// The efforts that have been at an extreme for [`SATURATED_ROWS`] or more, with the number of
    /// rows.
    fn standing(&mut self, values: &[f64]) -> Vec<(usize, usize)> {
        let mut out = Vec::new();
        let extremes = self.survey.extremes.iter();
        for (k, ((value, extreme), count)) in
            values.iter().zip(extremes).zip(&mut self.stuck).enumerate()
        {
            let (low, high) = *extreme;
            let at = (*value >= high || *value <= low) && low < high;
            *count = if at { *count + 1 } else { 0 };
            if *count >= SATURATED_ROWS {
                out.push((k, *count));
            }
        }
        out
    }

    /// Checks the positions of the row in the middle of the last [`OUTLIER_ROWS`] for outliers.
    fn judge(&mut self) {
        let start = self.queue.len() - OUTLIER_ROWS;
        for entry in self.layout.positions() {
            let values: Vec<f64> = self
                .queue
                .iter()
                .skip(start)
                .map(|w| w.row.values[entry])
                .collect();
            let middle = values[OUTLIER_NEIGHBOURS];
            // relative to the median change between these rows, so that fast motion is no outlier
            let steps: Vec<f64> = values
                .windows(2)
                .map(|pair| (pair[1] - pair[0]).abs())
                .collect();
            let usual = median(&steps);
            let around = median(&values);
            let steps = self.survey.steps.get(entry - self.layout.positions().start);
            // changes as large as regular ones elsewhere in the log, or as a few encoder steps,
            // are allowed too
            let allowed = steps.map_or(0.0, |s| (OUTLIER_ENCODER_STEPS * s.encoder).max(s.regular));
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

    /// Removes the oldest row from the buffer and passes it on.
    fn release(
        &mut self,
        problem: &mut dyn FnMut(Problem),
        each: &mut dyn FnMut(LogRow, bool) -> Result<(), DataError>,
    ) -> Result<(), DataError> {
        let Some(waiting) = self.queue.pop_front() else {
            return Ok(());
        };
        if let Some(what) = waiting.fault {
            problem(Problem {
                row: waiting.row.line,
                what,
            });
            if !self.keep {
                self.segment_ended = true;
                return Ok(());
            }
        }
        let follows = waiting.follows && !self.segment_ended;
        self.segment_ended = false;
        each(waiting.row, follows)
    }
}

/// Least number of rows before a last line without an end of line that show the usual length of
/// its last entry.
const MIN_ROWS_BEFORE_CUT: usize = 20;

/// The number of rows and the shortest last entry among them, in bytes.
#[derive(Default)]
struct LastColumn {
    rows: usize,
    shortest: usize,
}

impl LastColumn {
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
    fn cut(&self, record: &ByteRecord) -> bool {
        self.rows >= MIN_ROWS_BEFORE_CUT && Self::length(record) < self.shortest
    }
}

fn reader(path: &Path) -> Result<Reader<File>, DataError> {
    csv::ReaderBuilder::new()
        .flexible(true)
        .comment(Some(b'#'))
        .from_path(path)
        .map_err(|error| failed(path, &error))
}

fn failed(path: &Path, error: &csv::Error) -> DataError {
    DataError::Io {
        file: path.display().to_string(),
        why: format!("{error}"),
    }
}
