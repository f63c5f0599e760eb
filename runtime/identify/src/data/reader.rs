//! Rows of one file, checked as they pass.

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

/// What is known of a whole file before its rows are used.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Survey {
    step: f64,
    /// The smallest and largest value of each effort.
    extremes: Vec<(f64, f64)>,
    /// Where encoders were stuck, by the first row.
    stuck: BTreeMap<u64, Vec<Stuck>>,
    /// How each position changes between rows.
    steps: Vec<Steps>,
}

impl Survey {
    /// The usual step, s.
    pub(super) fn step(&self) -> f64 {
        self.step
    }
}

/// Steps from which the usual one is found.
const STEPS: usize = 1001;
/// A step longer than this many usual ones is a gap.
const GAP: f64 = 1.5;
/// Rows around a value that tell whether it is an outlier, on either side.
const AROUND: usize = 3;
/// How many usual changes between rows a value may be away from the median of those around it:
/// smooth motion and noise stay within a few.
const OUTLIER: f64 = 30.0;
/// How many steps of the encoder a value may be away from those around it: one that rests between
/// two steps tells now the one and now the other.
const FLICKER: f64 = 2.0;
/// Rows at an extreme from which on an effort counts as saturated.
const STUCK: usize = 4;

/// One file with its columns.
#[derive(Clone, Debug)]
pub(super) struct LogFile {
    pub(super) path: PathBuf,
    pub(super) layout: ColumnLayout,
    parquet: bool,
    /// Whether rows that are told are used where they are numbers.
    pub(super) keep: bool,
    /// The length in bytes of a text whose last line has no end.
    unended: Option<u64>,
}

/// What a Parquet file starts with.
const MAGIC: [u8; 4] = *b"PAR1";

/// Whether a file is Parquet, by its first bytes; what cannot be read is told later.
fn is_parquet(path: &Path) -> bool {
    let mut start = [0; 4];
    File::open(path).is_ok_and(|mut file| file.read_exact(&mut start).is_ok()) && start == MAGIC
}

/// The length of a file whose last line has no end; what cannot be read is told later.
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

    /// Reads the file once for what needs all of it.
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
                if let (true, Some(&time)) = (times.len() < STEPS, row.values.first()) {
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

    /// Hands over the good rows, each with whether it follows the one before without a break;
    /// problems go to the other hand.
    pub(super) fn rows(
        &self,
        survey: &Survey,
        problem: &mut dyn FnMut(Problem),
        each: &mut dyn FnMut(LogRow, bool) -> Result<(), DataError>,
    ) -> Result<(), DataError> {
        let mut cleaner = Cleaner {
            layout: &self.layout,
            survey,
            queue: VecDeque::with_capacity(SPAN + 1),
            last: None,
            broken: true,
            known: true,
            raw: None,
            jumped: false,
            until: 0,
            lost: false,
            stuck: vec![0; self.layout.efforts],
            keep: self.keep,
        };
        self.records(&mut |row| {
            match row {
                Ok(row) => cleaner.take(row, problem),
                Err(found) => {
                    problem(found);
                    cleaner.known = true;
                }
            }
            if cleaner.queue.len() > SPAN {
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

/// Rows that are looked at together.
const SPAN: usize = 2 * AROUND + 1;

/// A row that waits for those after it.
struct PendingRow {
    row: LogRow,
    /// Whether time goes on without a gap from the row before.
    follows: bool,
    fault: Option<Fault>,
}

#[allow(
    clippy::struct_excessive_bools,
    reason = "each is about one thing and any may hold with any"
)]
struct Cleaner<'a> {
    layout: &'a ColumnLayout,
    survey: &'a Survey,
    queue: VecDeque<PendingRow>,
    last: Option<f64>,
    /// Whether the next row that is released starts anew.
    broken: bool,
    /// Whether a gap before the next row is due to one that was told already.
    known: bool,
    /// The time of the row before, kept or not.
    raw: Option<f64>,
    /// The last row in which an encoder is stuck.
    until: u64,
    /// Whether rows before this one were left out.
    lost: bool,
    /// Whether the clock has been set back and has not caught up.
    jumped: bool,
    /// Rows since which each effort has stood at an extreme.
    stuck: Vec<usize>,
    /// Whether rows that are told are used.
    keep: bool,
}

impl Cleaner<'_> {
    fn take(&mut self, row: LogRow, problem: &mut dyn FnMut(Problem)) {
        let time = row.values.first().copied().unwrap_or(f64::NAN);
        let mut tell = |what| {
            problem(Problem {
                row: row.line,
                what,
            });
        };
        let mut follows = true;
        let raw = self.raw.replace(time).unwrap_or(time);
        if let Some(before) = self.last {
            let step = time - before;
            if step <= 0.0 {
                let far = GAP * self.survey.step;
                // a clock that was set goes on from there, and that was told
                if !(self.jumped && (0.0..=far).contains(&(time - raw))) {
                    self.jumped = -step > far;
                    tell(if self.jumped {
                        Fault::ClockBack { step: -step }
                    } else if step < 0.0 {
                        Fault::Unsorted { time }
                    } else {
                        Fault::Duplicate { time }
                    });
                }
                // a row that should have stood here is not missed again
                self.known = true;
                return;
            }
            if step > GAP * self.survey.step {
                follows = false;
                if !self.known {
                    let usual = self.survey.step;
                    tell(Fault::Gap { step, usual });
                }
            }
        }
        for stuck in self.survey.stuck.get(&row.line).into_iter().flatten() {
            if !self.keep {
                self.until = self.until.max(stuck.last);
            }
            tell(Fault::Stuck {
                column: self.layout.title(stuck.entry),
                value: row.values[stuck.entry],
                until: stuck.last,
            });
        }
        if row.line <= self.until {
            // a gap is told no more, and the rows after it start anew
            self.known = true;
            self.last = Some(time);
            self.lost = true;
            return;
        }
        if core::mem::take(&mut self.lost) {
            follows = false;
        }
        self.known = false;
        self.jumped = false;
        self.last = Some(time);
        let efforts = self.layout.efforts();
        let standing = self.standing(&row.values[efforts.clone()]);
        self.queue.push_back(PendingRow {
            row,
            follows,
            fault: None,
        });
        for (k, count) in standing {
            // when it is known to be stuck, so are the rows that led there
            let back = if count == STUCK { STUCK } else { 1 };
            for waiting in self.queue.iter_mut().rev().take(back) {
                waiting.fault = Some(Fault::Saturated {
                    column: self.layout.title(efforts.start + k),
                    value: waiting.row.values[efforts.start + k],
                });
            }
        }
        if self.queue.len() >= SPAN {
            self.judge();
        }
    }

    /// The efforts that have stood at an extreme for too long, with the number of rows.
    fn standing(&mut self, values: &[f64]) -> Vec<(usize, usize)> {
        let mut out = Vec::new();
        let extremes = self.survey.extremes.iter();
        for (k, ((value, extreme), count)) in
            values.iter().zip(extremes).zip(&mut self.stuck).enumerate()
        {
            let (low, high) = *extreme;
            let at = (*value >= high || *value <= low) && low < high;
            *count = if at { *count + 1 } else { 0 };
            if *count >= STUCK {
                out.push((k, *count));
            }
        }
        out
    }

    /// Looks for outliers among the positions in the middle of the last rows.
    fn judge(&mut self) {
        let start = self.queue.len() - SPAN;
        for entry in self.layout.positions() {
            let values: Vec<f64> = self
                .queue
                .iter()
                .skip(start)
                .map(|w| w.row.values[entry])
                .collect();
            let middle = values[AROUND];
            // what a straight line through the neighbours leaves, so that motion is no spread
            let steps: Vec<f64> = values
                .windows(2)
                .map(|pair| (pair[1] - pair[0]).abs())
                .collect();
            let usual = median(&steps);
            let around = median(&values);
            let steps = self.survey.steps.get(entry - self.layout.positions().start);
            // nor is what the robot moves between two rows anywhere else
            let allowed = steps.map_or(0.0, |s| (FLICKER * s.encoder).max(s.regular));
            let allowed = allowed.max(OUTLIER * usual.max(f64::EPSILON * middle.abs()));
            // steps are sums of rounded numbers
            if (middle - around).abs() > allowed * (1.0 + 1e-9) && usual > 0.0 {
                self.queue[start + AROUND].fault = Some(Fault::Outlier {
                    column: self.layout.title(entry),
                    value: middle,
                    around,
                });
            }
        }
    }

    /// Lets the oldest row go.
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
                self.broken = true;
                return Ok(());
            }
        }
        let follows = waiting.follows && !self.broken;
        self.broken = false;
        each(waiting.row, follows)
    }
}

/// Rows before an unended one that tell how long its last entry should be.
const ROWS: usize = 20;

/// The lengths of the last column's entries.
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

    /// Whether an entry that nothing ends is shorter than all before it.
    fn cut(&self, record: &ByteRecord) -> bool {
        self.rows >= ROWS && Self::length(record) < self.shortest
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
