//! Checks the rows of a file for faults: times, stuck encoders, saturation and outliers.

use std::collections::VecDeque;

use super::bridge::{Bridging, is_even};
use super::layout::ColumnLayout;
use super::policy::{Gaps, UsedFaults};
use super::problem::{DataError, Fault, Problem, median};
use super::reader::{EffortSet, LogRow, RowSink};
use super::survey::Survey;

/// Rows on either side of a value that decide whether it is an outlier.
const OUTLIER_NEIGHBOURS: usize = 3;
/// How far a position may be from the median of those around it, in median changes between these
/// rows: smooth motion and noise stay within a few.
const OUTLIER_CHANGES: f64 = 30.0;
/// How far a position may be from the median of those around it, in steps of the encoder's
/// resolution: a joint at rest on the border of two steps changes between both.
const OUTLIER_ENCODER_STEPS: f64 = 2.0;
/// The same in standard deviations of its noise: of ten million rows, noise brings none so far away.
const OUTLIER_DEVIATIONS: f64 = 8.0;
/// Number of consecutive rows at its smallest or largest value from which on an effort counts as
/// saturated.
const SATURATED_ROWS: usize = 4;
/// A step of at most this many usual ones that is no multiple of them shows an uneven clock.
const UNEVEN_STEPS: f64 = 3.0;
/// Number of rows that an outlier is searched in: a value and its neighbours.
const OUTLIER_ROWS: usize = 2 * OUTLIER_NEIGHBOURS + 1;

/// A row in the look-ahead buffer: it is judged once the next rows have been read.
struct PendingRow {
    row: LogRow,
    /// Whether there is no gap between the row before and this one.
    follows: bool,
    /// In a box, as nearly no row has one: rows are moved in and out of the buffer.
    fault: Option<Box<Fault>>,
    /// The rows of a dropout just before it, whose missing entries are NaN.
    dropout: Vec<(LogRow, bool)>,
}

/// Checks the rows of a file for faults in a look-ahead buffer.
#[allow(
    clippy::struct_excessive_bools,
    reason = "the flags are independent of each other"
)]
pub(super) struct RowChecker<'a> {
    layout: &'a ColumnLayout,
    survey: &'a Survey,
    /// The longest time step that is not a gap, s.
    longest_step: f64,
    /// The look-ahead buffer, the oldest row first.
    queue: VecDeque<PendingRow>,
    /// Rows that have left the buffer, whose memory is used again.
    spare: Vec<LogRow>,
    /// The values of each position in the last rows of the buffer, the oldest first.
    recent: Vec<[f64; OUTLIER_ROWS]>,
    /// The time, s, of the last row that was in order of time, whether it is used or not.
    last_time: Option<f64>,
    /// The time, s, of the first row.
    first_time: Option<f64>,
    /// That the clock was set back to the time of the first row: a problem unless it goes on from there, as
    /// that of another run in the same file does.
    restarted: Option<Problem>,
    /// Whether the next row that is released does not follow the last one released.
    segment_ended: bool,
    /// Whether a gap before the next row comes from a row that was already reported.
    gap_reported: bool,
    /// The time, s, of the row before that one.
    time_before: Option<f64>,
    /// The line up to which rows are left out because an encoder is stuck.
    stuck_until: u64,
    /// Whether the rows just before the next one were left out because an encoder was stuck.
    rows_skipped: bool,
    /// For each effort, the number of consecutive rows so far at its smallest or largest value.
    rows_at_extreme: Vec<usize>,
    /// Which doubtful rows are used.
    used_faults: UsedFaults,
    /// How gaps are bridged.
    bridging: Option<Bridging>,
    /// The dropouts that go on: the last line of each, and its entries.
    missing: Vec<(u64, &'a [usize])>,
    /// The last rows, if they belong to a dropout that is bridged.
    dropout: Vec<(LogRow, bool)>,
}

impl<'a> RowChecker<'a> {
    /// A checker of a file's rows, the first of which follows no other.
    ///
    /// - `longest_step`: the longest time step that is not a gap, s;
    /// - `bridging`: how gaps and dropouts are bridged, if they are.
    pub(super) fn new(
        layout: &'a ColumnLayout,
        survey: &'a Survey,
        longest_step: f64,
        used_faults: UsedFaults,
        bridging: Option<Bridging>,
    ) -> Self {
        Self {
            layout,
            survey,
            longest_step,
            queue: VecDeque::with_capacity(OUTLIER_ROWS + 1),
            spare: Vec::new(),
            recent: vec![[0.0; OUTLIER_ROWS]; layout.positions().len()],
            last_time: None,
            first_time: None,
            restarted: None,
            segment_ended: true,
            gap_reported: true,
            time_before: None,
            stuck_until: 0,
            rows_skipped: false,
            rows_at_extreme: vec![0; layout.efforts],
            used_faults,
            bridging,
            missing: Vec::new(),
            dropout: Vec::new(),
        }
    }

    /// Takes the next row of the file, or the problem with it, and passes on the row that is
    /// judged by now.
    pub(super) fn take(
        &mut self,
        row: Result<&LogRow, Problem>,
        problem: &mut dyn FnMut(Problem),
        each: &mut RowSink<'_>,
    ) -> Result<(), DataError> {
        match row {
            Ok(row) => self.check(row, problem),
            Err(found) => {
                problem(found);
                self.gap_reported = true;
            }
        }
        if self.queue.len() > OUTLIER_ROWS {
            self.release(problem, each)?;
        }
        Ok(())
    }

    /// Passes on the rows that are left at the end of the file.
    pub(super) fn finish(
        mut self,
        problem: &mut dyn FnMut(Problem),
        each: &mut RowSink<'_>,
    ) -> Result<(), DataError> {
        if let Some(found) = self.restarted.take() {
            problem(found);
        }
        while !self.queue.is_empty() {
            self.release(problem, each)?;
        }
        Ok(())
    }

    /// Checks the time of a row and adds it to the buffer.
    fn check(&mut self, row: &LogRow, problem: &mut dyn FnMut(Problem)) {
        let time = row.values.first().copied().unwrap_or(f64::NAN);
        let first_time = *self.first_time.get_or_insert(time);
        if let (Some(found), Some(last)) = (self.restarted.take(), self.last_time)
            && !(time > last && time - last <= self.longest_step)
        {
            problem(found);
        }
        let mut report = |what| {
            problem(Problem::of(row.line, what));
        };
        let mut follows = true;
        if let Some(last_time) = self.last_time {
            let step = time - last_time;
            let longest_step = self.longest_step;
            if step <= 0.0 && -step <= longest_step {
                // the gap that this row leaves is not reported as well
                self.gap_reported = true;
                report(if step < 0.0 {
                    Fault::Unsorted { time }
                } else {
                    Fault::Duplicate { time }
                });
                return;
            }
            if step <= 0.0 {
                // Rows behind a clock that was set back are a segment of their own; but if they
                // continue the rows before the last one, the time of that one alone is wrong.
                follows = false;
                let fault = Fault::ClockBack { step: -step };
                let goes_on = self.time_before.is_some_and(|before| {
                    (0.0..=UNEVEN_STEPS * self.survey.raw_step).contains(&(time - before))
                });
                match self.queue.back_mut() {
                    Some(last) if goes_on && !last.follows => last.fault = Some(Box::new(fault)),
                    _ if (time - first_time).abs() <= self.survey.raw_step => {
                        self.restarted = Some(Problem::of(row.line, fault));
                    }
                    _ => report(fault),
                }
            }
            if step > longest_step {
                follows = false;
                let usual = self.survey.raw_step;
                let is_bridged = self
                    .bridging
                    .is_some_and(|own| own.missing_rows(step, usual).is_some());
                if !self.gap_reported && !is_bridged {
                    let is_short = self.used_faults.gaps == Gaps::Bridge
                        && step <= UNEVEN_STEPS * usual
                        && !is_even(step, usual);
                    report(if is_short {
                        Fault::Uneven { step, usual }
                    } else {
                        Fault::Gap { step, usual }
                    });
                }
            }
        }
        if let Some(jumps) = self.survey.jumps.get(&row.line)
            && let Some((_, by)) = jumps.first()
        {
            follows = false;
            let columns = jumps.iter().map(|(entry, _)| self.layout.title(*entry));
            report(Fault::Jump {
                columns: columns.collect(),
                by: *by,
            });
        }
        for stuck in self.survey.stuck.get(&row.line).into_iter().flatten() {
            if !self.used_faults.stuck {
                self.stuck_until = self.stuck_until.max(stuck.last);
            }
            report(Fault::Stuck {
                column: self.layout.title(stuck.entry),
                value: row.values[stuck.entry],
                until: stuck.last,
            });
        }
        for dropout in self.survey.dropouts.get(&row.line).into_iter().flatten() {
            let is_bridged = self.bridging.is_some_and(|own| own.spans(dropout.seconds));
            if !is_bridged {
                let columns = dropout.entries.iter();
                problem(Problem {
                    row: dropout.first,
                    what: Fault::Dropout {
                        columns: columns.map(|entry| self.layout.title(*entry)).collect(),
                    },
                    last: (dropout.last > dropout.first).then_some(dropout.last),
                });
            }
            if is_bridged && self.bridging.is_some_and(|own| own.interpolates) {
                self.missing.push((dropout.last, &dropout.entries));
            } else {
                self.stuck_until = self.stuck_until.max(dropout.last);
            }
        }
        self.missing.retain(|(last, _)| row.line <= *last);
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
        self.time_before = self.last_time.replace(time);
        if !self.missing.is_empty() {
            let mut own = row.clone();
            for entry in self.missing.iter().flat_map(|(_, entries)| entries.iter()) {
                if let Some(value) = own.values.get_mut(*entry) {
                    *value = f64::NAN;
                }
            }
            self.dropout.push((own, follows));
            return;
        }
        let efforts = self.layout.efforts();
        let saturated = self.saturated_efforts(&row.values[efforts.clone()]);
        let positions = self.layout.positions().map(|entry| row.values[entry]);
        for (recent, value) in self.recent.iter_mut().zip(positions) {
            recent.rotate_left(1);
            recent[OUTLIER_ROWS - 1] = value;
        }
        let mut own = self.spare.pop().unwrap_or_default();
        own.line = row.line;
        (own.bridged, own.unknown) = (row.bridged, EffortSet::default());
        own.values.clone_from(&row.values);
        let off = self.survey.off_rows.get(&row.line);
        let fault = off.map(|(entry, off)| {
            Box::new(Fault::Outlier {
                column: self.layout.title(*entry),
                value: off.value,
                around: off.around,
            })
        });
        self.queue.push_back(PendingRow {
            row: own,
            follows,
            fault,
            dropout: core::mem::take(&mut self.dropout),
        });
        for (k, count) in saturated {
            // when the limit is reached, the rows before this one are marked as saturated too
            let marked_rows = if count == SATURATED_ROWS {
                SATURATED_ROWS
            } else {
                1
            };
            for pending in self.queue.iter_mut().rev().take(marked_rows) {
                if !self.used_faults.saturated {
                    match pending.row.unknown.with(k) {
                        Some(unknown) => pending.row.unknown = unknown,
                        // a row without a place for this effort gives no equation
                        None => pending.row.bridged = true,
                    }
                }
                // a row that is off as a whole stays so
                if matches!(
                    pending.fault.as_deref(),
                    None | Some(Fault::Saturated { .. })
                ) {
                    pending.fault = Some(Box::new(Fault::Saturated {
                        column: self.layout.title(efforts.start + k),
                        value: pending.row.values[efforts.start + k],
                    }));
                }
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
        let first = self.layout.efforts().start;
        for (k, ((value, extreme), count)) in values.iter().zip(extremes).zip(counts).enumerate() {
            // a column with a new value every few rows holds its largest one for these
            let held = self.survey.held.get(first + k).copied().unwrap_or(1);
            let (low, high) = *extreme;
            let is_at_extreme = (*value >= high || *value <= low) && low < high;
            *count = if is_at_extreme { *count + 1 } else { 0 };
            if *count >= SATURATED_ROWS && (held < 2 || *count > 2 * held) {
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
            let values = self.recent[entry - first];
            let middle = values[OUTLIER_NEIGHBOURS];
            // relative to the median change between these rows, so that fast motion does not count
            // as an outlier
            let mut changes = [0.0; OUTLIER_ROWS - 1];
            for (change, pair) in changes.iter_mut().zip(values.windows(2)) {
                *change = (pair[1] - pair[0]).abs();
            }
            // changes as large as regular ones elsewhere in the log, or as a few encoder steps or
            // deviations of its noise, are allowed too
            let log_changes = self.survey.position_changes.get(entry - first);
            let allowed = log_changes.map_or(0.0, |c| {
                (OUTLIER_ENCODER_STEPS * c.encoder)
                    .max(c.regular)
                    .max(OUTLIER_DEVIATIONS * c.noise)
            });
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
                self.queue[start + OUTLIER_NEIGHBOURS].fault = Some(Box::new(Fault::Outlier {
                    column: self.layout.title(entry),
                    value: middle,
                    around,
                }));
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
        for (row, follows) in &pending.dropout {
            let follows = *follows && !core::mem::take(&mut self.segment_ended);
            each(row, follows)?;
        }
        if let Some(what) = pending.fault {
            // of a saturated effort the equations are left out, and the motion goes on
            let keep = self.used_faults.uses(&what) || matches!(*what, Fault::Saturated { .. });
            problem(Problem::of(pending.row.line, *what));
            if !keep {
                self.segment_ended = true;
                self.spare.push(pending.row);
                return Ok(());
            }
        }
        let follows = pending.follows && !self.segment_ended;
        self.segment_ended = false;
        each(&pending.row, follows)?;
        self.spare.push(pending.row);
        Ok(())
    }
}
