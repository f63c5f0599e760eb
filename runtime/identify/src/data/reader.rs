//! Reads the rows of one run and checks them for faults.

use super::bridge::{Bridge, Bridged, Bridging};
use super::columns::{Assignment, Quantity};
use super::file_rows::{Opening, Table};
use super::joined::JoinedRows;
use super::layout::{ColumnLayout, Search, Unfit};
use super::policy::{Policy, UsedFaults};
use super::problem::{DataError, Problem};
use super::resample::Resampler;
use super::row_checker::RowChecker;
use super::run::Run;
use super::settings::Settings;
use super::survey::Survey;
use super::wrapped::Wrapped;
use crate::text::figure_of;
use regen_runtime::Info;

/// A row in SI, in the order of [`ColumnLayout::channels`].
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct LogRow {
    /// The line of a CSV file, or the row of a Parquet file, from 1; see [`Problem::row`].
    pub(super) line: u64,
    /// The time, s, then the other channels.
    pub(super) values: Vec<f64>,
    /// Whether some of them are interpolated across a gap or a dropout.
    pub(super) bridged: bool,
    /// The efforts whose values are not used, as they are saturated.
    pub(super) unknown: EffortSet,
}

/// Some of the first 64 efforts of a row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct EffortSet(u64);

impl EffortSet {
    /// This set with one more effort; `None` for an effort behind the first 64.
    pub(super) fn with(self, effort: usize) -> Option<Self> {
        let bit = 1_u64.checked_shl(u32::try_from(effort).ok()?)?;
        Some(Self(self.0 | bit))
    }

    /// The efforts of both sets.
    pub(super) fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    pub(super) fn contains(self, effort: usize) -> bool {
        let shift = u32::try_from(effort).unwrap_or(u32::MAX);
        self.0.checked_shr(shift).unwrap_or(0) & 1 == 1
    }

    pub(super) fn is_empty(self) -> bool {
        self.0 == 0
    }
}

/// The tables without those from which no column is read, where a file has several, such as a bag
/// with several publishers of joint states: the first table gives the times of the run. `None` if
/// all are used, or if columns are assigned by numbers, which count through all tables.
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

/// The topic that the columns name before the paths of fields, as in `/lowstate.motor_state[3].q`.
fn topic_of(columns: &[Assignment]) -> Option<&str> {
    let mut topics = columns.iter().filter_map(|own| {
        let (topic, _) = own.column.split_once('.')?;
        (own.number.is_none() && topic.starts_with('/')).then_some(topic)
    });
    topics.next()
}

/// A time step longer than this many median ones is a gap; a clock that goes back by more was set
/// back.
const GAP_STEPS: f64 = 1.5;
/// The same where rows are interpolated onto an even grid, which bridges uneven steps.
const RESAMPLED_GAP_STEPS: f64 = 3.0;
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
    /// Whether each row is a pose of its own.
    pub(super) poses: bool,
    /// The rate of the even grid that rows are interpolated onto, Hz.
    pub(super) resample: Option<f64>,
    /// Which doubtful rows are used.
    pub(super) used_faults: UsedFaults,
    /// How gaps and dropouts are bridged; `None` if the log is divided at all of them.
    pub(super) bridging: Option<Bridging>,
    /// Whether a position that repeats alone may be bridged.
    pub(super) bridges_stuck: bool,
    /// Whether wrapped positions are read without their jumps.
    pub(super) unwraps: bool,
}

impl LogFile {
    /// What the dates of its recordings change of the times by which its files are joined.
    pub(super) fn later(&self) -> Option<String> {
        self.layout.times.as_ref()?;
        let first = self.tables.first()?.path.display();
        let mut all = Vec::new();
        for own in self.tables.iter().filter(|own| own.later().abs() > 0.0) {
            let (path, by) = (own.path.display(), own.later());
            let when = if by > 0.0 { "after" } else { "before" };
            let text = format!("{path} began {} s {when} {first}", figure_of(4, by.abs()));
            if !all.contains(&text) {
                all.push(text);
            }
        }
        (!all.is_empty()).then(|| {
            let all = all.join(", ");
            format!(
                "recordings are joined by their dates: {all}; if these are dates of saving, save them with the same one"
            )
        })
    }

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
        let time = settings
            .columns
            .iter()
            .find(|given| given.quantity == Quantity::Time && given.number.is_none());
        let time = time.map(|given| given.column.as_str());
        let topic = settings.topic.as_deref().or(run.topic.as_deref());
        let mut opening = Opening {
            format: settings.format,
            topic: topic.or_else(|| topic_of(&settings.columns)),
            episode: settings.episode.or(run.episode),
            time: time.filter(|_| settings.rate.is_none() && !settings.poses),
            start: None,
            dated: None,
        };
        let mut tables = Vec::with_capacity(run.files.len());
        for path in &run.files {
            tables.extend(run.parsed.tables(path, &mut opening)?);
        }
        if let (Some(topic), None) = (topic, opening.start) {
            return Err(unfit(&format!(
                "the topic {topic} is named, and none of its files is a recording with topics"
            )));
        }
        if let Some(episode) = opening
            .episode
            .filter(|_| !tables.iter().any(Table::is_parquet))
        {
            return Err(unfit(&format!(
                "the episode {episode} is named, and none of its files is one of LeRobot, with episodes"
            )));
        }
        let search = Search {
            assignments: &settings.columns,
            by_rate: settings.rate.is_some(),
            poses: settings.poses,
            rates: settings.measured_rates.unwrap_or(true),
            join: run.join,
        };
        let mut found = layout(&tables, search).map_err(|unfit| unfit.of(&name))?;
        if let Some(used) = used_tables(&tables, &found, search.assignments) {
            tables = used;
            let unused = core::mem::take(&mut found.unused);
            found = layout(&tables, search).map_err(|unfit| unfit.of(&name))?;
            found.unused = unused;
        }
        if let [table] = &mut tables[..] {
            table.part = run.rows;
        }
        Ok(Self {
            name,
            layout: found,
            run: run.clone(),
            tables,
            rate: if settings.poses {
                Some(1.0)
            } else {
                settings.rate
            },
            poses: settings.poses,
            resample: settings.resample,
            used_faults: settings.used_faults(),
            bridging: settings.bridging(),
            bridges_stuck: !settings.checks.stuck.is_some_and(|own| own != Policy::Drop)
                && !settings.used_faults().stuck,
            // poses at rest follow no motion, and outliers that are kept are used as they are
            unwraps: !(settings.poses || settings.used_faults().outliers),
        })
    }

    /// Whether spikes of efforts are bridged like dropouts.
    pub(super) fn bridges_spikes(&self) -> bool {
        self.bridging.is_some_and(|own| own.interpolates) && !self.used_faults.outliers
    }

    pub(super) fn unfit(&self, why: String) -> DataError {
        DataError::ColumnLayout {
            file: self.name.clone(),
            why,
        }
    }

    /// Passes each row, or why it cannot be used, to `each`.
    ///
    /// - `wrapped`: the positions that are wrapped, which follow their motion in the rows.
    ///
    /// Returns the first and the last time, s, of the rows outside the times that are asked for; `None` if
    /// there are none.
    pub(super) fn records(
        &self,
        wrapped: &[(usize, Wrapped)],
        each: &mut RecordSink<'_>,
    ) -> Result<Option<(f64, f64)>, DataError> {
        let mut rows = JoinedRows::open(self, wrapped)?;
        while let Some(row) = rows.next_row()? {
            each(row)?;
        }
        Ok(rows.outside())
    }

    /// The number of rows before the first one in memory.
    pub(super) fn rows_before(&self) -> u64 {
        let part = match &self.tables[..] {
            [table] => table.part,
            _ => None,
        };
        part.map_or(0, |(first, _)| first.saturating_sub(1))
    }

    /// Passes the rows to `each` as they are in the files, each but the first following the one before: of a run in
    /// which [`rows`](Self::rows) found nothing to treat.
    pub(super) fn unchecked_rows(
        &self,
        survey: &Survey,
        each: &mut RowSink<'_>,
    ) -> Result<(), DataError> {
        let mut rows = JoinedRows::open(self, &survey.wrapped)?;
        let mut follows = false;
        while let Some(row) = rows.next_row()? {
            if let Ok(row) = row {
                each(row, follows)?;
                follows = true;
            }
        }
        Ok(())
    }

    /// Passes the good rows to `each`, on the even grid if there is one, each with whether it
    /// follows the one before without a gap, and the faulty ones to `problem`.
    pub(super) fn rows(
        &self,
        survey: &Survey,
        problem: &mut dyn FnMut(Problem),
        each: &mut RowSink<'_>,
    ) -> Result<Bridged, DataError> {
        let Some(rate) = self.resample else {
            return self.bridged_rows(survey, problem, each);
        };
        let mut resampler = Resampler::new(rate);
        let bridged = self.bridged_rows(survey, problem, &mut |row, follows| {
            resampler.push(row, follows, each)
        })?;
        resampler.finish(each)?;
        Ok(bridged)
    }

    /// The checked rows, with those that are interpolated across gaps and dropouts.
    fn bridged_rows(
        &self,
        survey: &Survey,
        problem: &mut dyn FnMut(Problem),
        each: &mut RowSink<'_>,
    ) -> Result<Bridged, DataError> {
        let Some(bridging) = self.bridging else {
            self.checked_rows(survey, problem, each)?;
            return Ok(Bridged::default());
        };
        if bridging.interpolates {
            let motion = 1..self.layout.efforts().start;
            let mut bridge = Bridge::new(bridging, survey.raw_step, motion);
            self.checked_rows(survey, problem, &mut |row, follows| {
                // no motion leads across a jump
                if survey.jumps.contains_key(&row.line) {
                    bridge.divide(each)?;
                }
                bridge.push(row, follows, each)
            })?;
            return bridge.finish(each);
        }
        let mut found = Bridged {
            longest: bridging.longest,
            ..Bridged::default()
        };
        let mut last: Option<f64> = None;
        self.checked_rows(survey, problem, &mut |row, follows| {
            let time = row.values.first().copied();
            if let (false, Some((time, last))) = (follows, time.zip(last)) {
                match bridging.missing_rows(time - last, survey.raw_step) {
                    Some(missing) => found.add(missing),
                    None => found.cuts += usize::from(time > last),
                }
            }
            last = time;
            each(row, follows)
        })?;
        Ok(found)
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
        let longest_step = gap_steps * survey.raw_step;
        let mut checker = RowChecker::new(
            &self.layout,
            survey,
            longest_step,
            self.used_faults,
            self.bridging,
        );
        self.records(&survey.wrapped, &mut |row| checker.take(row, problem, each))?;
        checker.finish(problem, each)
    }
}

/// Receives each row, or the problem for which it cannot be used.
type RecordSink<'a> = dyn FnMut(Result<&LogRow, Problem>) -> Result<(), DataError> + 'a;

/// Receives each row with whether it follows the one before without a gap.
pub(super) type RowSink<'a> = dyn FnMut(&LogRow, bool) -> Result<(), DataError> + 'a;
