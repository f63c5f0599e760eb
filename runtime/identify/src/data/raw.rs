//! Reads all columns of a run as unconverted numbers, to inspect a log whose content is unknown.

use super::columns::{Assignment, Quantity};
use super::file_rows::{Table, Wanted, unit_of};
use super::joined::JoinedRows;
use super::layout::{Channel, ColumnLayout, Finder, Search, Unfit};
use super::problem::{DataError, Problem};
use super::reader::LogFile;
use super::run::Run;
use super::settings::Settings;
use super::wrapped::{WrapFinder, Wrapped};
use regen_runtime::Info;

/// The number of rows of a file that decide whether a column has numbers.
const PROBED_ROWS: usize = 200;

/// A row: its line (see [`Problem::row`]) and its values, which are the time in s and then the columns
/// that have numbers; or the problem for which it cannot be used.
pub type RawRow<'a> = Result<(u64, &'a [f64]), &'a Problem>;

/// A run whose columns are read without knowing their quantities.
///
/// ```
/// use regen_identify::data::{RawLog, Run, Settings};
///
/// let path = std::env::temp_dir().join(format!("raw-{}.csv", std::process::id()));
/// std::fs::write(&path, "t;mode;angle\n0;idle;0,1\n0,01;run;0,11\n0,02;run;x\n")?;
/// let log = RawLog::open(&Run::from(path.as_path()), &Settings::default())?;
/// assert_eq!(log.titles(), ["t", "mode", "angle"]);
/// assert_eq!((log.numbers(), log.time()), (&[0, 2][..], Some(0)));
/// let (mut rows, mut problems) = (Vec::new(), Vec::new());
/// log.visit(&mut |row| match row {
///     Ok((line, values)) => rows.push((line, values.to_vec())),
///     Err(problem) => problems.push(problem.to_string()),
/// })?;
/// // the time in s, then the columns of numbers
/// assert_eq!(rows[1], (3, vec![0.01, 0.01, 0.11]));
/// assert_eq!(problems, ["row 4: `x` in column `angle` is not a finite number"]);
/// # std::fs::remove_file(path)?;
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct RawLog {
    file: LogFile,
    named: bool,
    numbers: Vec<usize>,
    wrapped: Vec<(usize, Wrapped)>,
}

impl RawLog {
    /// Opens a run, and determines from its first rows which columns have numbers.
    ///
    /// - `settings`: the format of the files, their rate, and the assignment of the time are used;
    ///   other settings are ignored. Without a rate, and if no column is assigned to the time or
    ///   named `t` or `time`, rows count as one second apart.
    ///
    /// # Errors
    /// When a file cannot be read, is empty, or lacks the column assigned to the time.
    pub fn open(run: &Run, settings: &Settings) -> Result<Self, DataError> {
        let times = settings.columns.iter();
        let times: Vec<Assignment> = times
            .filter(|given| given.quantity == Quantity::Time)
            .cloned()
            .collect();
        let mut found = Settings {
            resample: None,
            ..settings.clone()
        };
        let mut numbers = Vec::new();
        let mut named = false;
        let mut failure = None;
        let mut counted = false;
        let opened = LogFile::with(run, &found, |tables, search| {
            let search = Search {
                assignments: &times,
                ..search
            };
            let finder = Finder::new(tables, &Info::EMPTY, search, &[])?;
            let (time, each) = match finder.times() {
                Ok(found) => found,
                Err(unfit) if !times.is_empty() => return Err(unfit),
                Err(_) => {
                    counted = true;
                    let time = Channel {
                        index: None,
                        factor: 1.0,
                        offset: 0.0,
                        late: 0.0,
                    };
                    (time, None)
                }
            };
            match numeric(tables) {
                Ok(found) => numbers = found,
                Err(error) => {
                    failure = Some(error);
                    return Err(Unfit::from(String::new()));
                }
            }
            named = tables.iter().all(|table| table.named);
            let plain = numbers.iter().map(|index| Channel {
                index: Some(*index),
                factor: 1.0,
                offset: 0.0,
                late: 0.0,
            });
            let channels: Vec<Channel> = std::iter::once(time).chain(plain).collect();
            let count = numbers.len();
            Ok(ColumnLayout {
                unused: Vec::new(),
                header: finder.header,
                measured: (0..count).collect(),
                channels,
                velocities: vec![None; count],
                accelerations: vec![None; count],
                derivatives: false,
                efforts: 0,
                unmeasured: Vec::new(),
                times: each,
            })
        });
        let mut file = match failure {
            Some(error) => return Err(error),
            None => opened?,
        };
        if counted {
            found.rate = Some(1.0);
            file.rate = found.rate;
        }
        Ok(Self {
            file,
            named,
            numbers,
            wrapped: Vec::new(),
        })
    }

    /// The same log, in which columns that are wrapped by whole turns go on without jumps, as [`Logs`](super::Logs)
    /// reads positions.
    ///
    /// # Errors
    /// When a file cannot be read.
    pub fn unwrapped(mut self) -> Result<Self, DataError> {
        if self.file.poses {
            return Ok(self);
        }
        let mut finders = vec![WrapFinder::default(); self.numbers.len()];
        self.visit(&mut |row| match row {
            Ok((_, values)) => {
                for (finder, value) in finders.iter_mut().zip(values.iter().skip(1)) {
                    finder.push(*value);
                }
            }
            Err(_) => finders.iter_mut().for_each(WrapFinder::pause),
        })?;
        let found = finders.into_iter().map(WrapFinder::finish).enumerate();
        let found = found.filter_map(|(place, own)| Some((place + 1, own?)));
        self.wrapped = found.filter(|(_, own)| own.is_turn()).collect();
        Ok(self)
    }

    /// The columns that go on without jumps: the indices of their titles, and how they are wrapped.
    pub fn wrapped(&self) -> impl Iterator<Item = (usize, Wrapped)> {
        let index = |place: &usize| self.numbers.get(place - 1).copied();
        (self.wrapped.iter()).filter_map(move |(place, own)| Some((index(place)?, *own)))
    }

    /// The name of the run in messages.
    pub fn name(&self) -> &str {
        &self.file.name
    }

    /// The titles of all columns, those of the first file first; their numbers from 1 if the files do
    /// not name them.
    pub fn titles(&self) -> &[String] {
        &self.file.layout.header
    }

    /// Whether the files name their columns.
    pub fn is_named(&self) -> bool {
        self.named
    }

    /// The indices of the columns that have numbers, ascending.
    pub fn numbers(&self) -> &[usize] {
        &self.numbers
    }

    /// The index of the column of time, if it was assigned or found by its name.
    pub fn time(&self) -> Option<usize> {
        self.file.layout.channels.first().and_then(|c| c.index)
    }

    /// The unit that the file states of a column beside its title.
    ///
    /// - `index`: that of the title.
    pub fn unit(&self, index: usize) -> Option<&str> {
        unit_of(&self.file.tables, index)
    }

    /// What the files have and no column has, such as texts, arrays of other lengths and other topics, with the
    /// reasons.
    pub fn left_out(&self) -> Vec<(String, String)> {
        let mut all: Vec<(String, String)> = Vec::new();
        for own in self.file.tables.iter().flat_map(Table::absent) {
            if !all.contains(own) {
                all.push(own.clone());
            }
        }
        all
    }

    /// The titles of the columns of time by which the tables of a file are joined; none if each file has one table.
    pub fn clocks(&self) -> Vec<&str> {
        if self.file.tables.len() == self.file.run.files.len() {
            return Vec::new();
        }
        let times = self.file.layout.times.as_deref().unwrap_or_default();
        let titles = times.iter().zip(&self.file.tables);
        let titles = titles.filter_map(|(time, table)| table.titles.get(time.index?));
        titles.map(String::as_str).collect()
    }

    /// What the dates of its recordings change of the times by which its files are joined, as a sentence.
    pub fn later(&self) -> Option<String> {
        self.file.later()
    }

    /// Passes each row to `each`.
    ///
    /// # Errors
    /// When a file cannot be read.
    pub fn visit(&self, each: &mut dyn FnMut(RawRow<'_>)) -> Result<(), DataError> {
        let mut rows = JoinedRows::open(&self.file, &self.wrapped)?;
        while let Some(row) = rows.next_row()? {
            match &row {
                Ok(row) => each(Ok((row.line, &row.values))),
                Err(problem) => each(Err(problem)),
            }
        }
        Ok(())
    }
}

/// The columns of all files in which at least half of the first rows have numbers.
fn numeric(tables: &[Table]) -> Result<Vec<usize>, DataError> {
    let mut out = Vec::new();
    let mut before = 0;
    for table in tables {
        let all: Vec<Wanted> = (table.titles.iter().cloned().enumerate())
            .map(|(column, title)| Wanted { column, title })
            .collect();
        // a column that the format cannot read as numbers has none, and would be an error beside others
        let parts: Vec<Vec<Wanted>> = if table.is_text() {
            vec![all]
        } else {
            all.into_iter().map(|own| vec![own]).collect()
        };
        for wanted in parts {
            let columns: Vec<usize> = wanted.iter().map(|own| own.column).collect();
            let Ok(mut rows) = table.stream(wanted) else {
                continue;
            };
            let (mut bad, mut all) = (vec![0; columns.len()], 0);
            while all < PROBED_ROWS {
                let row = match rows.next_row() {
                    Ok(Some(row)) => row,
                    Ok(None) => break,
                    // a column of texts, or of lists of different lengths
                    Err(DataError::ColumnLayout { .. }) if !table.is_text() => {
                        (bad, all) = (vec![1; columns.len()], 1);
                        break;
                    }
                    Err(error) => return Err(error),
                };
                all += 1;
                for fault in row.faults {
                    match fault.column.and_then(|place| bad.get_mut(place)) {
                        Some(count) => *count += 1,
                        None => bad.iter_mut().for_each(|count| *count += 1),
                    }
                }
            }
            let pairs = columns.iter().zip(bad);
            out.extend(pairs.filter_map(|(c, bad)| (2 * bad <= all).then_some(before + c)));
        }
        before += table.titles.len();
    }
    Ok(out)
}
