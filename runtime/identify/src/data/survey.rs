//! What is gathered of all rows of a run in a first pass, before they are used.

use core::cmp::Ordering;
use std::collections::BTreeMap;

use super::bursts::{BurstFinder, OffRow};
use super::dropouts::{Dropout, DropoutFinder};
use super::file_rows::Table;
use super::layout::ColumnLayout;
use super::parsed::ParsedColumns;
use super::policy::Gaps;
use super::problem::{DataError, median};
use super::rates::{ACCELERATIONS, Pair, Rates, Strictness, VELOCITIES};
use super::reader::LogFile;
use super::run::Join;
use super::sample::Spikes;
use super::spikes::{Spike, SpikeFinder, said_of};
use super::stale::{StaleFinder, StepFinder};
use super::stuck::{PositionChanges, PositionHistory, Stuck};
use super::wrapped::{WrapFinder, Wrapped};
use crate::text;
use core::f64::consts::TAU;
use regen_runtime::{Info, Joint, Motion};

/// What is gathered in a first pass over all rows of a run, however they are used later.
#[derive(Debug)]
pub(super) struct Statistics {
    /// See [`Survey`], as all that follows.
    raw_step: f64,
    extremes: Vec<(f64, f64)>,
    stuck: BTreeMap<u64, Vec<Stuck>>,
    dropouts: Vec<Dropout>,
    /// The spikes of each effort.
    spikes: Vec<Vec<Spike>>,
    position_changes: Vec<PositionChanges>,
    off_rows: BTreeMap<u64, (usize, OffRow)>,
    held: Vec<usize>,
    steps: Vec<Option<(f64, f64)>>,
    jumps: BTreeMap<u64, Vec<(usize, f64)>>,
    doubted_rate: Option<(String, String)>,
    uncut: Option<(f64, f64)>,
    wrapped: Vec<(usize, Wrapped)>,
}

/// The rows of which statistics were gathered.
#[derive(PartialEq)]
pub(super) struct Surveyed {
    tables: Vec<ParsedColumns>,
    rows: Option<(u64, u64)>,
    times: Option<(f64, f64)>,
    join: Join,
    layout: ColumnLayout,
    rate: Option<f64>,
    poses: bool,
    unwraps: bool,
}

/// Statistics of all rows of a run, with what follows from how faulty rows are used.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Survey {
    /// The median time step between rows of the log, s.
    pub(super) raw_step: f64,
    /// The time step between rows that are handed out, s.
    pub(super) time_step: f64,
    /// The smallest and largest value of each effort, N or N m; infinite where it is a step of many.
    pub(super) extremes: Vec<(f64, f64)>,
    /// The stretches of rows in which an encoder was stuck, by the line of their first row.
    pub(super) stuck: BTreeMap<u64, Vec<Stuck>>,
    /// The dropouts, and the spikes of efforts where they are bridged, by the line of their first row.
    pub(super) dropouts: BTreeMap<u64, Vec<Dropout>>,
    /// The spikes of each effort that has some.
    pub(super) spikes: Vec<Spikes>,
    /// For each measured position, the sizes of its changes between rows.
    pub(super) position_changes: Vec<PositionChanges>,
    /// For each entry of a row the number of rows after which it has a new value.
    pub(super) held: Vec<usize>,
    /// For each effort the step of which all its values are multiples, N or N m, and over their standard deviation;
    /// `None` where it is small.
    pub(super) steps: Vec<Option<(f64, f64)>>,
    /// The rows at which positions jump for good, by their lines: the entries and the changes.
    pub(super) jumps: BTreeMap<u64, Vec<(usize, f64)>>,
    /// The rows in which a position is that of a run of outliers, by their lines, with the entry.
    pub(super) off_rows: BTreeMap<u64, (usize, OffRow)>,
    /// A column of velocities or accelerations that is a multiple of the derivative, in words, and
    /// the assignment that corrects it.
    pub(super) doubted_rate: Option<(String, String)>,
    /// The first and the last time of the log, s, where all its rows are within the times that are
    /// asked for.
    pub(super) uncut: Option<(f64, f64)>,
    /// The entries of the positions that are wrapped.
    pub(super) wrapped: Vec<(usize, Wrapped)>,
}

/// The least number of rows at the value next to the largest one, and over those at the largest one, of values that
/// have steps: a smooth signal is at its last step hardly longer than at the one before.
const MIN_NEXT_ROWS: usize = 4;
const MIN_NEXT_PART: f64 = 0.25;

/// How a value compares with another one, of which the rows are counted; it is larger than none.
fn count(of: &mut Option<(f64, usize)>, value: f64) -> Ordering {
    let Some((own, rows)) = of else {
        return Ordering::Greater;
    };
    let order = value.total_cmp(own);
    *rows += usize::from(order == Ordering::Equal);
    order
}

/// The largest value of a column and the one next to it, with the number of rows at each.
#[derive(Clone, Copy, Debug, Default)]
struct Extreme {
    first: Option<(f64, usize)>,
    next: Option<(f64, usize)>,
}

impl Extreme {
    fn push(&mut self, value: f64) {
        match count(&mut self.first, value) {
            Ordering::Greater => {
                self.next = self.first;
                self.first = Some((value, 1));
            }
            Ordering::Less if count(&mut self.next, value) == Ordering::Greater => {
                self.next = Some((value, 1));
            }
            _ => {}
        }
    }

    /// The largest value, at which a signal may be cut off; infinite if it is one of the signal's steps.
    fn limit(&self) -> f64 {
        let (Some((value, rows)), next) = (self.first, self.next) else {
            return f64::NEG_INFINITY;
        };
        let next = next.map_or(0, |own| own.1);
        let has_steps = next >= MIN_NEXT_ROWS && next as f64 >= MIN_NEXT_PART * rows as f64;
        if has_steps { f64::INFINITY } else { value }
    }
}

impl Survey {
    /// The time step between rows that are handed out, s: that of the even grid, or the median one
    /// of the log.
    pub(super) fn time_step(&self) -> f64 {
        self.time_step
    }
}

/// The widest range of the positions of a joint, rad or m, with a margin for the zero of its encoder.
fn widest(joint: &Joint) -> f64 {
    match (joint.limits.position, joint.motion) {
        (Some([low, high]), _) => MAX_OF_LIMITS * (high - low),
        (None, Motion::Rotation) => MAX_TURNS * TAU,
        (None, Motion::Translation) => f64::INFINITY,
    }
}

/// A range of positions over that of its limits, and one in turns without limits, that no joint has.
const MAX_OF_LIMITS: f64 = 1.2;
const MAX_TURNS: f64 = 4.0;
/// Number of first rows from whose times the median step is computed.
const STEP_ROWS: usize = 1001;
/// Rows from one whose position is off to the next of the same burst, at most.
const MAX_BETWEEN: u64 = 4;
/// The lowest rate of an even grid over that of the log: below it, what the log has of higher
/// frequencies would appear at lower ones.
const MIN_RESAMPLED_RATE: f64 = 0.5;
/// The highest rate of an even grid over that of the log: above it, one of the two is wrong.
const MAX_RESAMPLED_RATE: f64 = 20.0;

impl LogFile {
    /// Statistics of all rows of the run, which are gathered in the first pass over them.
    ///
    /// - `info`: that of the robot.
    pub(super) fn survey(&self, info: &Info<'_>) -> Result<Survey, DataError> {
        let surveyed = Surveyed {
            tables: self.tables.iter().map(Table::parsed).cloned().collect(),
            rows: self.run.rows,
            times: self.run.times,
            join: self.run.join,
            layout: self.layout.clone(),
            rate: self.rate,
            poses: self.poses,
            unwraps: self.unwraps,
        };
        let found = (self.run.parsed).statistics(surveyed, || self.statistics(info, Vec::new()))?;
        if let Some(rate) = self.resample
            && rate * found.raw_step < MIN_RESAMPLED_RATE
        {
            let own = text::figure_of(3, 1.0 / found.raw_step);
            return Err(self.unfit(format!(
                "a grid of {rate} Hz is too coarse for rows at {own} Hz: what they have of higher \
                 frequencies would appear at lower ones; resample at about {own} Hz, and decimate \
                 behind a filter"
            )));
        }
        if let Some(rate) = self.resample
            && rate * found.raw_step > MAX_RESAMPLED_RATE
        {
            return Err(self.unfit(format!(
                "a grid of {rate} Hz has far more rows than the log, at {} Hz: is its time in \
                 another unit?",
                text::figure(1.0 / found.raw_step)
            )));
        }
        let mut stuck = found.stuck.clone();
        let mut dropouts = self.dropouts(&found.dropouts, &mut stuck);
        let spikes = self.spikes(&found.spikes, &mut dropouts);
        Ok(Survey {
            raw_step: found.raw_step,
            time_step: self.resample.map_or(found.raw_step, |rate| 1.0 / rate),
            extremes: found.extremes.clone(),
            stuck,
            dropouts,
            spikes,
            position_changes: found.position_changes.clone(),
            off_rows: found.off_rows.clone(),
            held: found.held.clone(),
            steps: found.steps.clone(),
            jumps: found.jumps.clone(),
            doubted_rate: found.doubted_rate.clone(),
            uncut: found.uncut,
            wrapped: found.wrapped.clone(),
        })
    }

    /// Gathers the statistics of all rows of the run, again if positions turn out to be wrapped.
    ///
    /// - `wrapped`: the entries of the positions that are known to be.
    fn statistics(
        &self,
        info: &Info<'_>,
        wrapped: Vec<(usize, Wrapped)>,
    ) -> Result<Statistics, DataError> {
        let mut times: Vec<f64> = Vec::new();
        let mut extremes = vec![[Extreme::default(); 2]; self.layout.efforts];
        let positions = self.layout.positions();
        let mut histories = vec![PositionHistory::default(); positions.len()];
        let mut bursts = vec![BurstFinder::default(); positions.len()];
        let mut effort_bursts = vec![BurstFinder::default(); self.layout.efforts().len()];
        let mut stale = vec![StaleFinder::default(); self.layout.channels.len()];
        let mut steps = vec![StepFinder::default(); self.layout.efforts().len()];
        let mut finder = DropoutFinder::default();
        let mut spikes = SpikeFinder::new(self.layout.efforts().len());
        let mut rates = Rates::default();
        let velocities = positions.clone().zip(&self.layout.velocities);
        let with_rates: Vec<(usize, usize)> = velocities
            .filter_map(|(entry, v)| Some((entry, (*v)?)))
            .filter(|(entry, _)| !self.layout.is_constant(*entry))
            .collect();
        let mut accelerations = Rates::default();
        let entries = self
            .layout
            .velocities
            .iter()
            .zip(&self.layout.accelerations);
        let with_accelerations: Vec<(usize, usize, usize)> = entries
            .enumerate()
            .filter_map(|(k, (v, a))| Some((k, (*v)?, (*a)?)))
            .filter(|(_, v, _)| !self.layout.is_constant(*v))
            .collect();
        let mut rate_row = Vec::new();
        let mut last_time = None;
        let mut range: Option<(f64, f64)> = None;
        let looks_for_wraps = wrapped.is_empty() && self.unwraps;
        let mut wraps =
            vec![WrapFinder::default(); if looks_for_wraps { positions.len() } else { 0 }];
        let outside = self.records(&wrapped, &mut |row| {
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
                    let [low, high] = extreme;
                    low.push(-value);
                    high.push(*value);
                }
                let time = row.values[0];
                let (first, last) = range.unwrap_or((time, time));
                range = Some((first.min(time), last.max(time)));
                if self.poses || last_time.is_none_or(|last| time <= last) {
                    histories.iter_mut().for_each(PositionHistory::pause);
                    bursts.iter_mut().for_each(BurstFinder::pause);
                    wraps.iter_mut().for_each(WrapFinder::pause);
                    effort_bursts.iter_mut().for_each(BurstFinder::pause);
                    finder.pause();
                    spikes.pause();
                    rates.pause();
                    accelerations.pause();
                }
                // of rows with the same time one is used
                if last_time != Some(time) {
                    for (stale, value) in stale.iter_mut().zip(&row.values) {
                        stale.push(*value);
                    }
                }
                finder.push(row.line, &row.values);
                spikes.push(row.line, time, &row.values[self.layout.efforts()]);
                last_time = Some(time);
                let row_positions = &row.values[positions.clone()];
                for (wrap, value) in wraps.iter_mut().zip(row_positions) {
                    wrap.push(*value);
                }
                for (history, value) in histories.iter_mut().zip(row_positions) {
                    history.push(row.line, *value);
                }
                for (burst, value) in bursts.iter_mut().zip(row_positions) {
                    burst.push(row.line, time, *value);
                }
                let efforts = &row.values[self.layout.efforts()];
                for (step, value) in steps.iter_mut().zip(efforts) {
                    step.push(*value);
                }
                for (burst, value) in effort_bursts.iter_mut().zip(efforts) {
                    burst.push(row.line, time, *value);
                }
                if !with_rates.is_empty() {
                    rate_row.clear();
                    rate_row.push(time);
                    rate_row.extend(with_rates.iter().map(|pair| row.values[pair.0]));
                    rate_row.extend(with_rates.iter().map(|pair| row.values[pair.1]));
                    rates.push(with_rates.len(), &rate_row);
                }
                if !with_accelerations.is_empty() {
                    rate_row.clear();
                    rate_row.push(time);
                    rate_row.extend(with_accelerations.iter().map(|pair| row.values[pair.1]));
                    rate_row.extend(with_accelerations.iter().map(|pair| row.values[pair.2]));
                    accelerations.push(with_accelerations.len(), &rate_row);
                }
            }
            Ok(())
        })?;
        if let (Some((start, end)), Some((first, last)), None) = (self.run.times, outside, range) {
            return Err(self.unfit(format!(
                "no row has a time from {start} s to {end} s: those of the log are from {first} s to \
                 {last} s; `times` are in s, whatever the unit of the column of time is"
            )));
        }
        let found = positions.clone().zip(wraps);
        let found = found.filter_map(|(entry, wrap)| Some((entry, wrap.finish()?)));
        let found: Vec<(usize, Wrapped)> = found.collect();
        if !found.is_empty() {
            return self.statistics(info, found);
        }
        let uncut = range.filter(|_| self.run.times.is_some() && outside.is_none());
        let pair = |coordinate: usize, position: usize, velocity: usize| {
            let coordinate = self.layout.measured.get(coordinate);
            let factor = |entry: usize| {
                let channel = self.layout.channels.get(entry);
                channel.map_or(1.0, |c| c.factor)
            };
            Pair {
                name: coordinate
                    .and_then(|c| info.coordinates.get(*c))
                    .map_or_else(String::new, |name| (*name).to_owned()),
                widest: (coordinate.and_then(|c| info.joints.get(*c)))
                    .map_or(f64::INFINITY, widest),
                position: self.layout.title(position),
                velocity: self.layout.title(velocity),
                factors: [factor(position), factor(velocity)],
            }
        };
        let pairs: Vec<Pair> = with_rates
            .iter()
            .map(|(position, velocity)| pair(position - positions.start, *position, *velocity))
            .collect();
        let pairs_of_accelerations: Vec<Pair> = with_accelerations
            .iter()
            .map(|(k, velocity, own)| pair(*k, *velocity, *own))
            .collect();
        // a wrong clock changes accelerations as it does velocities
        let both = rates.common_factor().zip(accelerations.common_factor());
        let is_clock = with_accelerations.is_empty()
            || both.is_some_and(|(v, a)| (v / a - 1.0).abs() < 0.1)
            || rates.common_factor().is_none();
        let clock = if is_clock {
            self.layout.title(0)
        } else {
            String::new()
        };
        let mistake = |strictness: Strictness| {
            rates
                .judge(&pairs, &clock, VELOCITIES, strictness)
                .or_else(|| {
                    accelerations.judge(&pairs_of_accelerations, "", ACCELERATIONS, strictness)
                })
        };
        if let Some(unfit) = mistake(Strictness::Refused) {
            return Err(unfit.of(&self.name));
        }
        let doubted_rate = mistake(Strictness::Doubted).and_then(|unfit| {
            let (what, advice) = unfit.why.rsplit_once(". ")?;
            let remedy = unfit.assignment.unwrap_or_else(|| advice.to_owned());
            Some((what.to_owned(), remedy))
        });
        let mut stuck = BTreeMap::<u64, Vec<Stuck>>::new();
        let mut position_changes = Vec::with_capacity(positions.len());
        let mut off_rows = BTreeMap::<u64, (usize, OffRow)>::new();
        let mut between = BTreeMap::new();
        let mut jumps = BTreeMap::<u64, Vec<(usize, f64)>>::new();
        for ((history, burst), entry) in histories.into_iter().zip(bursts).zip(positions) {
            let (stretches, changes) = history.finish(entry);
            let (off, own_jumps) = burst.finish(changes.regular);
            off_rows.extend(off.into_iter().map(|row| (row.line, (entry, row))));
            for jump in own_jumps {
                jumps.entry(jump.line).or_default().push((entry, jump.by));
            }
            position_changes.push(changes);
            for stretch in stretches {
                stuck.entry(stretch.first).or_default().push(stretch);
            }
        }
        // an effort may jump where no position does, but not between two rows whose positions are off
        for (burst, entry) in effort_bursts.into_iter().zip(self.layout.efforts()) {
            for row in burst.finish(0.0).0 {
                let around = |range| off_rows.range(range).next().is_some();
                let within = around(row.line.saturating_sub(MAX_BETWEEN)..row.line)
                    && around(row.line..row.line.saturating_add(MAX_BETWEEN + 1));
                if within {
                    between.insert(row.line, (entry, row));
                }
            }
        }
        for (line, off) in between {
            off_rows.entry(line).or_insert(off);
        }
        let time_steps = times.windows(2).map(|pair| pair[1] - pair[0]);
        let time_steps: Vec<f64> = time_steps.filter(|step| *step > 0.0).collect();
        Ok(Statistics {
            raw_step: median(&time_steps),
            extremes: (extremes.iter())
                .map(|[low, high]| (-low.limit(), high.limit()))
                .collect(),
            stuck,
            dropouts: finder.finish(self.layout.efforts()),
            spikes: spikes.finish(),
            position_changes,
            off_rows,
            held: stale.into_iter().map(StaleFinder::finish).collect(),
            steps: steps.iter().map(StepFinder::finish).collect(),
            jumps,
            doubted_rate,
            uncut,
            wrapped,
        })
    }

    /// The dropouts that are not used like any rows, by the lines of their first rows, without a single encoder that is stuck for longer
    /// than a gap that is bridged; of stuck encoders those remain that are no dropout.
    fn dropouts(
        &self,
        found: &[Dropout],
        stuck: &mut BTreeMap<u64, Vec<Stuck>>,
    ) -> BTreeMap<u64, Vec<Dropout>> {
        let positions = self.layout.positions();
        let mut out = BTreeMap::<u64, Vec<Dropout>>::new();
        for dropout in found {
            let is_position = dropout
                .entries
                .iter()
                .any(|entry| positions.contains(entry));
            let is_bridged = self.bridging.is_some_and(|own| own.spans(dropout.seconds));
            if dropout.alone && is_position && !(is_bridged && self.bridges_stuck) {
                continue;
            }
            for (_, stretches) in stuck.range_mut(dropout.first..=dropout.last) {
                stretches.retain(|own| own.last > dropout.last);
            }
            if self.used_faults.gaps != Gaps::Keep {
                out.entry(dropout.first).or_default().push(dropout.clone());
            }
        }
        out
    }

    /// The spikes of each effort that has some. Where a filter runs over gaps, which it would spread the spikes
    /// over, they are added to the dropouts: the efforts of these rows count as missing.
    fn spikes(
        &self,
        found: &[Vec<Spike>],
        dropouts: &mut BTreeMap<u64, Vec<Dropout>>,
    ) -> Vec<Spikes> {
        if self.bridges_spikes() {
            for (entry, spikes) in self.layout.efforts().zip(found) {
                for spike in spikes {
                    dropouts.entry(spike.line).or_default().push(Dropout {
                        first: spike.line,
                        last: spike.line,
                        entries: vec![entry],
                        seconds: spike.seconds,
                        alone: true,
                    });
                }
            }
        }
        let each = found.iter().enumerate();
        each.filter_map(|(effort, own)| said_of(effort, own))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::Extreme;

    #[test]
    fn the_last_of_many_steps_is_no_limit() {
        let limit = |cut: f64, step: f64| {
            let mut out = Extreme::default();
            for k in 0..1000 {
                let value = (3.0 * (0.02 * f64::from(k)).sin()).min(cut);
                out.push(if step > 0.0 {
                    (value / step).round() * step
                } else {
                    value
                });
            }
            out.limit()
        };
        assert!(limit(2.0, 0.0) <= 2.0);
        assert!(limit(2.0, 0.05) <= 2.0);
        assert!(limit(9.0, 0.2).is_infinite());
        assert!(limit(9.0, 0.0) <= 3.0);
    }
}
