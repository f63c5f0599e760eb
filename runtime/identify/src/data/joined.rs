//! The rows of a run: those of its files side by side, converted to SI, within the part that is
//! read.

use std::collections::VecDeque;

use super::file_rows::Wanted;
use super::layout::Channel;
use super::parsed::ParsedRows;
use super::problem::{DataError, Problem, median};
use super::reader::{EffortSet, LogFile, LogRow};
use super::resample::between;
use super::wrapped::{Unwrapper, Wrapped};

/// The number of rows at the start of a file from which its usual time step is computed.
const STEP_ROWS: usize = 1001;
/// A step longer than this many usual ones is a gap, across which nothing is interpolated.
const GAP_STEPS: f64 = 3.0;
/// Two times count as equal if they differ by no more than this, in usual steps: rounding.
const SAME_TIME: f64 = 1e-6;

/// The rows of a run, from the first one on.
pub(super) struct JoinedRows<'a> {
    file: &'a LogFile,
    sources: Vec<Source>,
    /// The number of rows of the files so far.
    count: u64,
    /// Whether the last good row was within the times that are read.
    inside: bool,
    /// The first and the last time of rows that are outside the times that are read, s.
    outside: Option<(f64, f64)>,
    /// The last row.
    row: LogRow,
    /// The numbers of one file in it.
    numbers: Vec<f64>,
    /// The number of files that are joined row by row.
    by_row: usize,
    unwrappers: Vec<Unwrapper>,
}

/// What a row of all files turned out to be.
enum Found {
    /// A row that can be used.
    Row,
    /// A row at whose time a file that is joined by time has no values.
    Nothing,
    /// A row that cannot be used.
    Fault(Problem),
}

/// The columns of one file.
struct Source {
    /// The index of the file in the run.
    place: usize,
    rows: ParsedRows,
    /// For each column that is read, its entry in a row of the run.
    entries: Vec<usize>,
    /// The rows around the current time, for a file that is joined by time and is not the first.
    track: Option<Track>,
}

/// The rows of a file around the current time.
struct Track {
    time: Channel,
    /// Times and the other numbers.
    recent: VecDeque<(f64, Vec<f64>)>,
    ended: bool,
    usual_step: f64,
}

impl<'a> JoinedRows<'a> {
    /// Opens all files of a run before their first rows.
    ///
    /// - `wrapped`: the positions that are wrapped, which follow their motion in the rows.
    pub(super) fn open(file: &'a LogFile, wrapped: &[(usize, Wrapped)]) -> Result<Self, DataError> {
        let mut sources = Vec::with_capacity(file.tables.len());
        let mut before = 0;
        for (place, table) in file.tables.iter().enumerate() {
            let own = before..before + table.titles.len();
            let (mut wanted, mut entries) = (Vec::new(), Vec::new());
            for (entry, channel) in file.layout.channels.iter().enumerate() {
                let Some(index) = channel.index.filter(|index| own.contains(index)) else {
                    continue;
                };
                wanted.push(Wanted {
                    column: index - before,
                    title: file.layout.title(entry),
                });
                entries.push(entry);
            }
            before = own.end;
            let times = file.layout.times.as_ref().filter(|_| place > 0);
            let time = times.and_then(|times| times.get(place)).copied();
            let mut track = None;
            if let Some((time, index)) = time.and_then(|time| Some((time, time.index?))) {
                let title = table.titles.get(index).cloned().unwrap_or_default();
                let first = Wanted {
                    column: index,
                    title,
                };
                wanted.insert(0, first);
                let mut clock = table.rows(&wanted)?;
                track = Some(Track {
                    time,
                    recent: VecDeque::new(),
                    ended: false,
                    usual_step: usual_step(&mut clock, time),
                });
            }
            // a file without columns of interest is not read
            if !entries.is_empty() {
                sources.push(Source {
                    place,
                    rows: table.rows(&wanted)?,
                    entries,
                    track,
                });
            }
        }
        let by_row = |source: &&Source| source.track.is_none();
        let mut paths = Vec::new();
        for source in sources.iter().filter(by_row) {
            let path = file.tables.get(source.place).map(|table| &table.path);
            if paths.contains(&path) {
                return Err(DataError::ColumnLayout {
                    file: file.name.clone(),
                    why: "its joints come from publishers of their own, whose messages belong \
                          together by their times: name the column of time, and do not join by \
                          rows"
                        .to_owned(),
                });
            }
            paths.push(path);
        }
        Ok(Self {
            file,
            sources,
            count: file.rows_before(),
            // a faulty row before the first good one counts only if all times are read
            inside: file.run.times.is_none(),
            outside: None,
            row: LogRow {
                line: 0,
                // what no source gives stays so
                values: file
                    .layout
                    .channels
                    .iter()
                    .map(|own| own.unread())
                    .collect(),
                bridged: false,
                unknown: EffortSet::default(),
            },
            numbers: Vec::new(),
            by_row: paths.len(),
            unwrappers: (wrapped.iter())
                .map(|(entry, own)| Unwrapper::new(*entry, *own))
                .collect(),
        })
    }

    /// The first and the last time of the rows so far that are outside the times that are read, s;
    /// `None` if there are none.
    pub(super) fn outside(&self) -> Option<(f64, f64)> {
        self.outside
    }

    /// The next row, or why it cannot be used; `None` after the last one.
    pub(super) fn next_row(&mut self) -> Result<Option<Result<&LogRow, Problem>>, DataError> {
        loop {
            if self
                .file
                .run
                .rows
                .is_some_and(|(_, last)| self.count >= last)
            {
                return Ok(None);
            }
            let Some(found) = self.read_all()? else {
                return Ok(None);
            };
            self.count += 1;
            if self
                .file
                .run
                .rows
                .is_some_and(|(first, _)| self.count < first)
            {
                continue;
            }
            // another file has no values at this time
            if let Found::Nothing = found {
                continue;
            }
            if let Some((start, end)) = self.file.run.times {
                if let Found::Row = found {
                    let time = self.row.values.first().copied().unwrap_or(f64::NAN);
                    self.inside = (start..=end).contains(&time);
                    if !self.inside {
                        let (first, last) = self.outside.unwrap_or((time, time));
                        self.outside = Some((first.min(time), last.max(time)));
                    }
                }
                if !self.inside {
                    continue;
                }
            }
            if let Found::Fault(problem) = found {
                return Ok(Some(Err(problem)));
            }
            let LogRow {
                values, bridged, ..
            } = &mut self.row;
            *bridged = false;
            for unwrapper in &mut self.unwrappers {
                *bridged |= unwrapper.apply(values);
            }
            return Ok(Some(Ok(&self.row)));
        }
    }

    /// Reads the next row of all files; `None` behind the last one.
    fn read_all(&mut self) -> Result<Option<Found>, DataError> {
        let channels = &self.file.layout.channels;
        let LogRow { line, values, .. } = &mut self.row;
        *line = 0;
        let mut fault = None;
        let mut lacking = false;
        let mut ended = Vec::new();
        for (order, source) in self.sources.iter_mut().enumerate() {
            if let Some(track) = &mut source.track {
                if fault.is_none() && !lacking {
                    let time = values.first().copied().unwrap_or(f64::NAN);
                    match track.at(&mut source.rows, time) {
                        Some(found) => fill(values, channels, &source.entries, &found),
                        None => lacking = true,
                    }
                }
                continue;
            }
            let Some((own, why)) = source.rows.next_row(&mut self.numbers) else {
                ended.push(source.place);
                continue;
            };
            if order == 0 {
                *line = own;
            }
            match why {
                None => fill(values, channels, &source.entries, &self.numbers),
                Some(what) => {
                    fault.get_or_insert_with(|| Problem::of(own, what.clone()));
                }
            }
        }
        if !ended.is_empty() {
            return if ended.len() == self.by_row {
                Ok(None)
            } else {
                Err(self.unequal(&ended))
            };
        }
        if self.by_row == 0 {
            return Ok(None);
        }
        if let Some(rate) = self.file.rate {
            values[0] = self.count as f64 / rate;
        }
        Ok(Some(match fault {
            Some(problem) => Found::Fault(problem),
            None if lacking => Found::Nothing,
            None => Found::Row,
        }))
    }

    /// The error that some of the files, which are joined row by row, end before the others.
    fn unequal(&self, ended: &[usize]) -> DataError {
        let name = |place: &usize| {
            let table = self.file.tables.get(*place);
            table.map_or_else(String::new, |table| table.path.display().to_string())
        };
        let names: Vec<String> = ended.iter().map(name).collect();
        DataError::ColumnLayout {
            file: self.file.name.clone(),
            why: format!(
                "files side by side are joined row by row, and {} ends after {} rows, before the \
                 others: join them by time, or cut them to the same rows",
                names.join(" and "),
                self.count
            ),
        }
    }
}

/// Converts numbers of a file to SI and puts them into a row.
fn fill(values: &mut [f64], channels: &[Channel], entries: &[usize], found: &[f64]) {
    for (entry, number) in entries.iter().zip(found) {
        if let (Some(value), Some(channel)) = (values.get_mut(*entry), channels.get(*entry)) {
            *value = channel.convert(*number);
        }
    }
}

/// The median time step of a file's first rows, s.
fn usual_step(rows: &mut ParsedRows, time: Channel) -> f64 {
    let (mut times, mut values) = (Vec::new(), Vec::new());
    while times.len() < STEP_ROWS
        && let Some((_, why)) = rows.next_row(&mut values)
    {
        if why.is_none() {
            times.extend(values.first().map(|t| time.convert(*t)));
        }
    }
    let steps = times.windows(2).map(|pair| pair[1] - pair[0]);
    let steps: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
    median(&steps)
}

impl Track {
    /// The numbers of the file at a time, s; `None` outside the file's times and within a gap. Times
    /// must not decrease from call to call.
    fn at(&mut self, rows: &mut ParsedRows, time: f64) -> Option<Vec<f64>> {
        // keep the last two rows before the current time, and read two after it
        let mut passed;
        loop {
            passed = self.recent.iter().take_while(|row| row.0 <= time).count();
            while passed > 2 {
                self.recent.pop_front();
                passed -= 1;
            }
            if self.ended || self.recent.len() >= passed + 2 {
                break;
            }
            self.read(rows);
        }
        let left = passed.checked_sub(1)?;
        let (before, values) = self.recent.get(left)?;
        if (time - before).abs() <= SAME_TIME * self.usual_step {
            return Some(values.clone());
        }
        let (after, next) = self.recent.get(left + 1)?;
        if (after - time).abs() <= SAME_TIME * self.usual_step {
            return Some(next.clone());
        }
        if after - before > GAP_STEPS * self.usual_step {
            return None;
        }
        Some(between(&self.recent, left, time))
    }

    /// Reads the next usable row; rows whose times are out of order are not usable.
    fn read(&mut self, rows: &mut ParsedRows) {
        loop {
            let mut values = Vec::new();
            let Some((_, why)) = rows.next_row(&mut values) else {
                self.ended = true;
                return;
            };
            if why.is_some() || values.is_empty() {
                continue;
            }
            let time = self.time.convert(values.remove(0));
            if self.recent.back().is_none_or(|last| time > last.0) {
                self.recent.push_back((time, values));
                return;
            }
        }
    }
}
