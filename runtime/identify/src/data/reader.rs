//! Reads the rows of one run and checks them for faults.

use std::collections::{BTreeMap, VecDeque};

use super::columns::Assignment;
use super::file_rows::{Opening, Table};
use super::joined::JoinedRows;
use super::kept_rows::{KeptRows, RecordSink};
use super::layout::{ColumnLayout, Search, Unfit};
use super::policy::Keeps;
use super::problem::{DataError, Fault, Problem, median};
use super::rates::Rates;
use super::resample::Resampler;
use super::run::Run;
use super::settings::Settings;
use super::stuck::{PositionChanges, PositionHistory, Stuck};
use crate::text;
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
    /// The median time step between rows of the log, s.
    raw_step: f64,
    /// The time step between rows that are handed out, s.
    time_step: f64,
    /// The smallest and largest value of each effort, N or N m.
    extremes: Vec<(f64, f64)>,
    /// The stretches of rows in which an encoder was stuck, by the line of their first row.
    stuck: BTreeMap<u64, Vec<Stuck>>,
    /// For each measured position, the sizes of its changes between rows.
    position_changes: Vec<PositionChanges>,
}

impl Survey {
    /// The time step between rows that are handed out, s: that of the even grid, or the median one
    /// of the log.
    pub(super) fn time_step(&self) -> f64 {
        self.time_step
    }
}

/// The tables without those of publishers of which nothing is read: the first table's times are
/// those of the run. `None` if all are used, or columns are counted through them.
fn used_tables(
    tables: &[Table],
    layout: &ColumnLayout,
    assignments: &[Assignment],
) -> Option<Vec<Table>> {
    if assignments.iter().any(|own| own.number.is_some()) {
        return None;
    }
    let mut before = 0;
    let mut used = Vec::with_capacity(tables.len());
    for table in tables {
        let own = before..before + table.titles.len();
        before = own.end;
        let mut indices = layout.channels.iter().skip(1).filter_map(|c| c.index);
        used.push(indices.any(|index| own.contains(&index)));
    }
    let several = |k: usize| tables.iter().filter(|t| t.path == tables[k].path).count() > 1;
    let keep = |k: usize| used[k] || !several(k);
    if (0..tables.len()).all(keep) || !used.contains(&true) {
        return None;
    }
    let kept = tables.iter().enumerate().filter(|(k, _)| keep(*k));
    Some(kept.map(|(_, table)| table.clone()).collect())
}

/// Number of first rows from whose times the median step is computed.
const STEP_ROWS: usize = 1001;
/// A time step longer than this many median ones is a gap; a clock that goes back by more was set
/// back.
const GAP_STEPS: f64 = 1.5;
/// The same where rows are interpolated onto an even grid, which bridges uneven steps.
const RESAMPLED_GAP_STEPS: f64 = 3.0;
/// The lowest rate of an even grid over that of the log: below it, what the log has of higher
/// frequencies would appear at lower ones.
const MIN_RESAMPLED_RATE: f64 = 0.5;
/// The highest rate of an even grid over that of the log: above it, one of the two is wrong.
const MAX_RESAMPLED_RATE: f64 = 20.0;
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

/// The files of one run with their columns.
#[derive(Clone, Debug)]
pub(super) struct LogFile {
    /// The name of the run in messages.
    pub(super) name: String,
    /// The channels of the model and their columns in the files.
    pub(super) layout: ColumnLayout,
    pub(super) run: Run,
    pub(super) tables: Vec<Table>,
    /// The rate of the rows, Hz, where there is no column of time.
    pub(super) rate: Option<f64>,
    /// The rate of the even grid that rows are interpolated onto, Hz.
    resample: Option<f64>,
    /// Which doubtful rows are used.
    keeps: Keeps,
    /// The rows, once they were read.
    pub(super) kept: KeptRows,
}

impl LogFile {
    /// Opens a run whose columns are those of states of motion.
    pub(super) fn open(run: &Run, info: &Info<'_>, settings: &Settings) -> Result<Self, DataError> {
        Self::with(run, settings, |tables, search| {
            ColumnLayout::new(tables, info, search)
        })
    }

    /// Opens a run whose columns `layout` finds.
    pub(super) fn with(
        run: &Run,
        settings: &Settings,
        mut layout: impl FnMut(&[Table], Search<'_>) -> Result<ColumnLayout, Unfit>,
    ) -> Result<Self, DataError> {
        let name = run.to_string();
        let unfit = |why: &str| DataError::ColumnLayout {
            file: name.clone(),
            why: why.to_owned(),
        };
        if run.files.is_empty() {
            return Err(unfit("a run has no file"));
        }
        for (what, rate) in [
            ("rate", settings.rate),
            ("resampling rate", settings.resample),
        ] {
            if rate.is_some_and(|rate| !(rate > 0.0 && rate.is_finite())) {
                return Err(unfit(&format!("the {what} must be above 0 Hz")));
            }
        }
        let mut opening = Opening {
            format: settings.format,
            topic: settings.topic.as_deref().or(run.topic.as_deref()),
            episode: settings.episode.or(run.episode),
            start: None,
        };
        let mut tables = Vec::with_capacity(run.files.len());
        for path in &run.files {
            tables.extend(opening.tables(path)?);
        }
        if let (Some(topic), None) = (&run.topic, opening.start) {
            return Err(unfit(&format!(
                "the topic {topic} is named, and none of its files is a recording with topics"
            )));
        }
        let search = Search {
            assignments: &settings.columns,
            by_rate: settings.rate.is_some(),
            rates: settings.measured_rates,
            join: run.join,
        };
        let mut found = layout(&tables, search).map_err(|unfit| unfit.of(&name))?;
        if let Some(used) = used_tables(&tables, &found, search.assignments) {
            tables = used;
            found = layout(&tables, search).map_err(|unfit| unfit.of(&name))?;
        }
        Ok(Self {
            name,
            layout: found,
            run: run.clone(),
            tables,
            rate: settings.rate,
            resample: settings.resample,
            keeps: settings.keeps(),
            kept: KeptRows::with_room(0),
        })
    }

    /// Reads the file once for the statistics of all its rows.
    ///
    /// - `names`: the names of all coordinates.
    pub(super) fn survey(&self, names: &[String]) -> Result<Survey, DataError> {
        let mut times: Vec<f64> = Vec::new();
        let mut extremes = vec![(f64::INFINITY, f64::NEG_INFINITY); self.layout.efforts];
        let positions = self.layout.positions();
        let mut histories = vec![PositionHistory::default(); positions.len()];
        let mut rates = Rates::default();
        let velocities = positions.clone().zip(&self.layout.velocities);
        let with_rates: Vec<(usize, usize)> = velocities
            .filter_map(|(entry, v)| Some((entry, (*v)?)))
            .collect();
        let mut rate_row = Vec::new();
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
                if !with_rates.is_empty() {
                    rate_row.clear();
                    rate_row.push(time);
                    rate_row.extend(with_rates.iter().map(|pair| row.values[pair.0]));
                    rate_row.extend(with_rates.iter().map(|pair| row.values[pair.1]));
                    rates.push(with_rates.len(), &rate_row);
                }
            }
            Ok(())
        })?;
        let pairs = with_rates.iter().map(|(position, velocity)| {
            let place = position - positions.start;
            let coordinate = self.layout.measured.get(place).and_then(|c| names.get(*c));
            let name = coordinate.cloned().unwrap_or_default();
            [
                name,
                self.layout.title(*position),
                self.layout.title(*velocity),
            ]
        });
        let pairs: Vec<[String; 3]> = pairs.collect();
        if let Some(unfit) = rates.judge(&pairs, &self.layout.title(0)) {
            return Err(unfit.of(&self.name));
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
        let raw_step = median(&time_steps);
        if let Some(rate) = self.resample
            && rate * raw_step < MIN_RESAMPLED_RATE
        {
            let own = text::figure_of(3, 1.0 / raw_step);
            return Err(self.unfit(format!(
                "a grid of {rate} Hz is too coarse for rows at {own} Hz: what they have of higher \
                 frequencies would appear at lower ones; resample at about {own} Hz, and decimate \
                 behind a filter"
            )));
        }
        if let Some(rate) = self.resample
            && rate * raw_step > MAX_RESAMPLED_RATE
        {
            return Err(self.unfit(format!(
                "a grid of {rate} Hz has far more rows than the log, at {} Hz: is its time in \
                 another unit?",
                text::figure(1.0 / raw_step)
            )));
        }
        Ok(Survey {
            raw_step,
            time_step: self.resample.map_or(raw_step, |rate| 1.0 / rate),
            extremes,
            stuck,
            position_changes,
        })
    }

    fn unfit(&self, why: String) -> DataError {
        DataError::ColumnLayout {
            file: self.name.clone(),
            why,
        }
    }

    /// Passes each row, or why it cannot be used, to `each`.
    fn records(&self, each: &mut RecordSink<'_>) -> Result<(), DataError> {
        self.kept.visit(each, |each| {
            let mut rows = JoinedRows::open(self)?;
            while let Some(row) = rows.next_row()? {
                each(row)?;
            }
            Ok(())
        })
    }

    /// Passes the good rows to `each`, on the even grid if there is one, each with whether it
    /// follows the one before without a gap, and the faulty ones to `problem`.
    pub(super) fn rows(
        &self,
        survey: &Survey,
        problem: &mut dyn FnMut(Problem),
        each: &mut RowSink<'_>,
    ) -> Result<(), DataError> {
        let Some(rate) = self.resample else {
            return self.checked_rows(survey, problem, each);
        };
        let mut resampler = Resampler::new(rate);
        self.checked_rows(survey, problem, &mut |row, follows| {
            resampler.push(row, follows, each)
        })?;
        resampler.finish(each)
    }

    fn checked_rows(
        &self,
        survey: &Survey,
        problem: &mut dyn FnMut(Problem),
        each: &mut RowSink<'_>,
    ) -> Result<(), DataError> {
        let gap_steps = match self.resample {
            Some(_) => RESAMPLED_GAP_STEPS,
            None => GAP_STEPS,
        };
        let mut checker = RowChecker {
            layout: &self.layout,
            survey,
            longest_step: gap_steps * survey.raw_step,
            queue: VecDeque::with_capacity(OUTLIER_ROWS + 1),
            last_time: None,
            segment_ended: true,
            gap_reported: true,
            previous_time: None,
            clock_set_back: false,
            stuck_until: 0,
            rows_skipped: false,
            rows_at_extreme: vec![0; self.layout.efforts],
            keeps: self.keeps,
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

/// Receives each row with whether it follows the one before without a gap.
pub(super) type RowSink<'a> = dyn FnMut(LogRow, bool) -> Result<(), DataError> + 'a;

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
    /// The longest time step that is no gap, s.
    longest_step: f64,
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
    /// Which doubtful rows are used.
    keeps: Keeps,
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
            let longest_step = self.longest_step;
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
                    let usual = self.survey.raw_step;
                    report(Fault::Gap { step, usual });
                }
            }
        }
        for stuck in self.survey.stuck.get(&row.line).into_iter().flatten() {
            if !self.keeps.stuck {
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
        let first = self.layout.positions().start;
        for entry in self.layout.positions() {
            let mut values = [0.0; OUTLIER_ROWS];
            for (value, pending) in values.iter_mut().zip(self.queue.iter().skip(start)) {
                *value = pending.row.values[entry];
            }
            let middle = values[OUTLIER_NEIGHBOURS];
            // relative to the median change between these rows, so that fast motion is no outlier
            let mut changes = [0.0; OUTLIER_ROWS - 1];
            for (change, pair) in changes.iter_mut().zip(values.windows(2)) {
                *change = (pair[1] - pair[0]).abs();
            }
            // changes as large as regular ones elsewhere in the log, or as a few encoder steps,
            // are allowed too
            let log_changes = self.survey.position_changes.get(entry - first);
            let allowed =
                log_changes.map_or(0.0, |c| (OUTLIER_ENCODER_STEPS * c.encoder).max(c.regular));
            // no value is farther from the median than from all others, and no median is below
            // the smallest change: nearly all rows are judged so, without sorting
            let least = changes.iter().copied().fold(f64::INFINITY, f64::min);
            let farthest = values
                .iter()
                .fold(0.0, |m: f64, x| m.max((x - middle).abs()));
            if farthest <= allowed.max(OUTLIER_CHANGES * least) {
                continue;
            }
            let usual = median(&changes);
            let around = median(&values);
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
        each: &mut RowSink<'_>,
    ) -> Result<(), DataError> {
        let Some(pending) = self.queue.pop_front() else {
            return Ok(());
        };
        if let Some(what) = pending.fault {
            let keep = self.keeps.uses(&what);
            problem(Problem {
                row: pending.row.line,
                what,
            });
            if !keep {
                self.segment_ended = true;
                return Ok(());
            }
        }
        let follows = pending.follows && !self.segment_ended;
        self.segment_ended = false;
        each(pending.row, follows)
    }
}
