//! Finds the columns of a run's files that contain times, positions, velocities, accelerations and
//! efforts.

use super::columns::{Assignment, Quantity, ValuesFrom, file_unit, is_si};
use super::file_rows::{Table, shortened, unit_of};
use super::problem::DataError;
use super::run::Join;
use regen_runtime::Info;

/// The index of a column among those of all files of a run, and its conversion to SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Channel {
    /// `None` for a time that is computed from the rate, and for a constant, which is the offset.
    pub(super) index: Option<usize>,
    pub(super) factor: f64,
    pub(super) offset: f64,
    /// How old the values are at the times of their rows, s.
    pub(super) late: f64,
}

/// The settings by which columns are found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search<'a> {
    pub(super) assignments: &'a [Assignment],
    /// Whether the time is computed from the rate and not read.
    pub(super) by_rate: bool,
    /// Whether each row is a pose at rest, whose time does not matter.
    pub(super) poses: bool,
    /// Whether columns of velocities and accelerations are used.
    pub(super) rates: bool,
    pub(super) join: Join,
}

/// The columns of a run's files that are read, and their order in a row.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ColumnLayout {
    /// The titles of the columns of all files, those of the first file first.
    pub(super) header: Vec<String>,
    /// Coordinates that are measured, as indices into `Info::coordinates`.
    pub(super) measured: Vec<usize>,
    /// The columns in the order of [`LogRow::values`](super::reader::LogRow::values): time,
    /// positions, the velocities that are measured, the accelerations that are measured, efforts.
    pub(super) channels: Vec<Channel>,
    /// For each measured coordinate the entry of its velocity in a row, if it is measured.
    pub(super) velocities: Vec<Option<usize>>,
    /// The same for its acceleration.
    pub(super) accelerations: Vec<Option<usize>>,
    /// Whether all velocities and accelerations are measured.
    pub(super) derivatives: bool,
    /// The number of efforts.
    pub(super) efforts: usize,
    /// The efforts that are not measured, as indices into `Info::actuated`; their values are 0.
    pub(super) unmeasured: Vec<usize>,
    /// The column of time of each file, if several files are joined by time.
    pub(super) times: Option<Vec<Channel>>,
    /// The titles of columns that are not read though none is assigned but that of time, without those that only count
    /// or date the rows, and without rates and commands that are not needed.
    pub(super) unused: Vec<String>,
}

/// The words in titles of columns that count or date the rows.
const OF_ROWS: &str = "unnamed index idx id seq sequence row rows sample samples pose poses n nr no count t time timestamp \
                       stamp date sec nsec nanosec header frame";

/// Whether a title says that a column counts or dates the rows, or says nothing.
fn is_of_rows(title: &str) -> bool {
    let title = title
        .rsplit(['/', '.'])
        .next()
        .unwrap_or_default()
        .to_lowercase();
    let mut words = title.split(|c: char| !c.is_alphabetic());
    words.all(|word| word.is_empty() || OF_ROWS.split(' ').any(|own| own == word))
}

/// The largest number of titles of a file that a message lists.
const MAX_LISTED: usize = 40;

/// The largest number of arrays outside of a table that a message lists.
const MAX_ABSENT: usize = 8;

/// Lists the titles of columns for a message, at most [`MAX_LISTED`] of each file, or the numbers of
/// columns if a file does not name them.
fn listed(tables: &[Table]) -> String {
    let mut before = 0;
    let mut parts = Vec::new();
    for table in tables {
        let count = table.titles.len();
        if table.named {
            let titles = table.titles.iter().take(MAX_LISTED);
            let titles: Vec<String> = titles.map(|t| shortened(t)).collect();
            let more = count.saturating_sub(MAX_LISTED);
            let tail = if more > 0 {
                format!(" and {more} more")
            } else {
                String::new()
            };
            let absent = table.absent().iter().take(MAX_ABSENT);
            let absent: Vec<String> = absent.map(|(name, _)| shortened(name)).collect();
            let rest = if absent.is_empty() {
                String::new()
            } else {
                format!(" (and as no columns: {})", absent.join(", "))
            };
            parts.push(format!("{}{tail}{rest}", titles.join(", ")));
        } else {
            parts.push(format!(
                "{} to {} without names",
                before + 1,
                before + count
            ));
        }
        before += count;
    }
    parts.join(", ")
}

/// The reason why a header is not that of a log of this robot, and the assignment that would help, if
/// there is one; `why` is then a sentence that ends before it.
#[derive(Debug)]
pub(super) struct Unfit {
    pub(super) why: String,
    pub(super) assignment: Option<String>,
}

impl From<String> for Unfit {
    fn from(why: String) -> Self {
        Self {
            why,
            assignment: None,
        }
    }
}

impl Unfit {
    /// The error of a run with this name.
    pub(super) fn of(self, name: &str) -> DataError {
        let (file, why) = (name.to_owned(), self.why);
        match self.assignment {
            Some(assignment) => DataError::Columns {
                file,
                why,
                assignment,
            },
            None => DataError::ColumnLayout { file, why },
        }
    }
}

/// Refuses files whose columns cannot be distinguished, currents without torque constants, and names
/// that are not coordinates.
fn check<'a>(
    tables: &[Table],
    assignments: impl IntoIterator<Item = &'a Assignment>,
    info: &Info<'_>,
) -> Result<(), Unfit> {
    for assignment in assignments {
        if assignment.is_current() && assignment.gain.is_none() {
            let Assignment {
                quantity, column, ..
            } = assignment;
            let unit = assignment.unit.unwrap_or("A");
            return Err(Unfit {
                why: format!(
                    "{quantity} is a current in {unit}, which is not an effort: give the torque \
                     constant of the joint, in N m/A or N/A with the gear, such as"
                ),
                assignment: Some(format!("{quantity}={column}:{unit}*0.12")),
            });
        }
        if let Some(name) = assignment.quantity.coordinate()
            && info.index_of(name).is_none()
        {
            let all = info.coordinates.join(" ");
            return Err(format!("`{name}` is not a coordinate of {}: {all}", info.name).into());
        }
    }
    let mut titles = tables.iter().flat_map(|t| &t.titles);
    // letters beyond ASCII may be of any encoding; UTF-16 and binary files have control characters
    if titles.any(|title| title.contains(char::is_control)) {
        let why = "it is no text in UTF-8, and in none of the formats of logs (Parquet, MAT of level 4, 5 or 7.3, HDF5, \
             NPY, NPZ, MDF 4, TDMS, MCAP, ROS 2): save it as CSV in UTF-8 (a file in UTF-16 can be converted)";
        return Err(why.to_owned().into());
    }
    if tables.iter().any(|t| t.titles.iter().all(String::is_empty)) {
        let why = "it is empty; its first row must name the columns";
        return Err(why.to_owned().into());
    }
    if let [whole] = tables.iter().flat_map(|t| &t.titles).collect::<Vec<_>>()[..]
        && whole.contains(' ')
    {
        let why = "its columns seem to be separated by blanks, but the names of columns contain \
                   blanks too, or the rows have not as many entries as names: with `header: none` \
                   columns are called by their numbers, from 1; or separate them by commas, \
                   semicolons or tabs";
        return Err(why.to_owned().into());
    }
    Ok(())
}

/// The index of the column with a number from 1, if it is among `count` columns.
fn place_of(number: usize, count: usize) -> Option<usize> {
    number.checked_sub(1).filter(|index| *index < count)
}

/// The index of a column whose name is not a title but a number.
fn by_number(given: &Assignment, count: usize) -> Option<usize> {
    place_of(given.column.parse().ok()?, count)
}

/// Finds columns among those of all files of a run.
pub(super) struct Finder<'a> {
    tables: &'a [Table],
    pub(super) header: Vec<String>,
    search: Search<'a>,
    /// The names of the coordinates, and the indices of those with efforts.
    coordinates: Vec<&'a str>,
    actuated: Vec<usize>,
}

impl<'a> Finder<'a> {
    /// A finder for these files.
    ///
    /// - `more`: assignments besides those of the search.
    ///
    /// # Errors
    /// If files or assignments are refused by [`check`].
    pub(super) fn new(
        tables: &'a [Table],
        info: &Info<'a>,
        search: Search<'a>,
        more: &[Assignment],
    ) -> Result<Self, Unfit> {
        check(tables, search.assignments.iter().chain(more), info)?;
        Ok(Self {
            tables,
            header: tables.iter().flat_map(|t| t.titles.clone()).collect(),
            search,
            coordinates: info.coordinates.to_vec(),
            actuated: info.actuated.to_vec(),
        })
    }

    /// The index of a title; an error if two columns have it.
    fn place(&self, name: &str) -> Result<Option<usize>, String> {
        let Some(index) = self.header.iter().position(|h| h == name) else {
            let mut all = self.in_each(|table| table.respelled(name));
            return match (all.next(), all.next()) {
                (Some(_), Some(_)) => Err(format!(
                    "several columns end in `{name}`: write the whole name of one; there are: {}",
                    listed(self.tables)
                )),
                (only, _) => Ok(only),
            };
        };
        if self.header.iter().skip(index + 1).any(|h| h == name) {
            return Err(format!("the header names two columns `{name}`: rename one"));
        }
        Ok(Some(index))
    }

    /// The columns that are found in each table, as indices among the columns of all.
    fn in_each(&self, find: impl Fn(&Table) -> Option<usize>) -> impl Iterator<Item = usize> {
        let mut before = 0;
        self.tables.iter().filter_map(move |table| {
            let start = before;
            before += table.titles.len();
            find(table).map(|own| start + own)
        })
    }

    /// The column of a quantity in a matrix with one column for each coordinate, or for each effort.
    fn in_matrix(&self, quantity: &Quantity) -> Option<usize> {
        let names: &[&str] = match quantity {
            Quantity::Time => return None,
            Quantity::Position(_) => &["q"],
            Quantity::Velocity(_) => &["qd", "dq"],
            Quantity::Acceleration(_) => &["qdd", "ddq"],
            Quantity::Effort(_) => &["tau"],
        };
        let name = quantity.coordinate()?;
        let coordinate = self.coordinates.iter().position(|own| *own == name)?;
        let effort = self.actuated.iter().position(|own| *own == coordinate);
        let orders = [
            (self.coordinates.len(), Some(coordinate)),
            (self.actuated.len(), effort),
        ];
        orders.into_iter().find_map(|(count, place)| {
            let first = self.in_each(|table| table.matrix(names, count)).next()?;
            Some(first + place?)
        })
    }

    pub(super) fn given(&self, quantity: &Quantity) -> Option<&Assignment> {
        let assignments = self.search.assignments.iter();
        assignments.into_iter().find(|a| a.quantity == *quantity)
    }

    /// The column of a quantity; `None` if it has none.
    pub(super) fn find(&self, quantity: &Quantity) -> Result<Option<Channel>, String> {
        let given = self.given(quantity);
        let found = self.find_as(given, &quantity.to_string())?;
        let found = found.or_else(|| self.in_matrix(quantity).map(Channel::plain));
        // a factor replaces the unit of the file, as a unit does
        let is_stated = given.is_some_and(|own| {
            own.unit.is_some() || own.gain.is_some() || (own.factor - 1.0).abs() > 0.0
        });
        if let (Some(index), false) = (found.and_then(|own| own.index), is_stated) {
            self.require_si(quantity, index)?;
        }
        Ok(found)
    }

    /// Refuses a column that is in another unit than SI, as its file states, where the user states none.
    fn require_si(&self, quantity: &Quantity, index: usize) -> Result<(), String> {
        let unit = unit_of(self.tables, index).and_then(file_unit);
        let unit = unit.filter(|unit| quantity.units().contains(unit) && !is_si(unit));
        let Some((unit, title)) = unit.zip(self.header.get(index)) else {
            return Ok(());
        };
        let (gain, si) = match unit {
            "A" | "mA" => ("*0.12", "Nm"),
            _ => ("", quantity.units().first().copied().unwrap_or_default()),
        };
        Err(format!(
            "its file states that `{title}` is in {unit}: assign it with this unit, such as \
             `{quantity}={title}:{unit}{gain}`, or with {si} if the file is wrong"
        ))
    }

    /// Refuses a unit or a factor of times that are in s by their type, such as dates.
    fn require_seconds(&self) -> Result<(), String> {
        let Some(given) = self.given(&Quantity::Time) else {
            return Ok(());
        };
        let own = |table: &Table| {
            self.time_in(table)?
                .index
                .filter(|own| table.is_clock(*own))
        };
        let is_clock = self.tables.iter().any(|table| own(table).is_some());
        if is_clock && (given.factor - 1.0).abs() > 0.0 {
            return Err(format!(
                "`{column}` has dates or spans of time, which are read in s: assign it without a unit, `t={column}`",
                column = given.column
            ));
        }
        Ok(())
    }

    /// The column of an assignment or, if there is no assignment or its optional column is missing,
    /// the column with a title; `None` if there is neither.
    pub(super) fn find_as(
        &self,
        given: Option<&Assignment>,
        title: &str,
    ) -> Result<Option<Channel>, String> {
        if let Some(given) = given {
            if given.from != ValuesFrom::Column {
                return Ok(Some(Channel::constant(given.offset)));
            }
            let index = match given.number {
                Some(number) => place_of(number, self.header.len()),
                None => self
                    .place(&given.column)?
                    .or_else(|| by_number(given, self.header.len())),
            };
            if self.search.poses && given.late != 0.0 {
                let column = &given.column;
                return Err(format!(
                    "poses at rest have no time at which `{column}` could be late"
                ));
            }
            if index.is_some() || !given.optional {
                let index = index.ok_or_else(|| self.lacks(given, title))?;
                return Ok(Some(Channel {
                    index: Some(index),
                    factor: given.factor,
                    offset: given.offset,
                    late: given.late,
                }));
            }
        }
        Ok(self.place(title)?.map(Channel::plain))
    }

    fn lacks(&self, given: &Assignment, title: &str) -> String {
        let (column, all) = (&given.column, listed(self.tables));
        let mut reasons = self
            .tables
            .iter()
            .filter_map(|table| table.why_absent(column));
        if let Some(why) = reasons.next() {
            return format!("`{column}` is no column for {title}: {why}; there are: {all}");
        }
        format!("there is no column `{column}` for {title}; there are: {all}")
    }

    /// The columns that [`ColumnLayout::unused`] names, beside those that are read.
    fn unused<'c>(&self, read: impl Iterator<Item = &'c Channel>, info: &Info<'_>) -> Vec<String> {
        let mut given = self.search.assignments.iter();
        if given.any(|own| own.quantity != Quantity::Time) {
            return Vec::new();
        }
        let mut known: Vec<usize> = read.filter_map(|own| own.index).collect();
        for name in info.coordinates {
            for quantity in [
                Quantity::Velocity((*name).to_owned()),
                Quantity::Acceleration((*name).to_owned()),
            ] {
                let found = self.find(&quantity).ok().flatten();
                known.extend(found.and_then(|own| own.index));
            }
            let command = self.place(&format!("cmd_{name}"));
            known.extend(command.ok().flatten());
        }
        let is_clock = |index: usize| {
            let mut before = 0;
            let mut tables = self.tables.iter();
            tables.any(|table| {
                let start = before;
                before += table.titles.len();
                let own = (start..before).contains(&index).then(|| index - start);
                own.is_some_and(|own| table.is_clock(own) || table.time() == Some(own))
            })
        };
        let all = self.header.iter().enumerate();
        let unused = all.filter(|(index, title)| {
            !known.contains(index) && !is_of_rows(title) && !is_clock(*index)
        });
        unused.map(|(_, title)| title.clone()).collect()
    }

    /// The column of time of one file, with its index among the columns of this file; `None` if it
    /// has none.
    fn time_in(&self, table: &Table) -> Option<Channel> {
        let place = |name: &str| {
            let exact = table.titles.iter().position(|title| title == name);
            exact.or_else(|| table.respelled(name))
        };
        let Some(given) = self.given(&Quantity::Time) else {
            let stated = table.time().or_else(|| place("t"));
            return stated.or_else(|| place("time")).map(Channel::plain);
        };
        let index = match given.number {
            Some(number) => place_of(number, table.titles.len()),
            None => place(&given.column).or_else(|| by_number(given, table.titles.len())),
        };
        index.map(|index| Channel {
            index: Some(index),
            factor: given.factor,
            offset: given.offset,
            late: 0.0,
        })
    }

    /// The column of time of the run, and those of all files if they are joined by time.
    pub(super) fn times(&self) -> Result<(Channel, Option<Vec<Channel>>), Unfit> {
        let missing = || self.missing(&Quantity::Time, "time in s");
        self.require_seconds()?;
        let each: Option<Vec<Channel>> = self.tables.iter().map(|t| self.time_in(t)).collect();
        let several = self.tables.len() > 1;
        if self.search.poses {
            if self.search.join == Join::Time {
                let why = "its files are to be joined by time, and no time is read of poses";
                return Err(why.to_owned().into());
            }
            return Ok((Channel::constant(0.0), None));
        }
        // in other files, the column with the same number may contain something else
        let named = self
            .given(&Quantity::Time)
            .is_none_or(|given| given.number.is_none());
        let by_time = match self.search.join {
            Join::Auto => several && named && each.is_some() && !self.search.by_rate,
            Join::Rows => false,
            Join::Time => several,
        };
        if by_time {
            if self.search.by_rate {
                let why =
                    "its files are to be joined by time, but with a stated rate no time is read";
                return Err(why.to_owned().into());
            }
            let each = each.ok_or_else(missing)?;
            let first = each.first().copied().ok_or_else(missing)?;
            return Ok((first, Some(each)));
        }
        if self.search.by_rate {
            let named = |name: &&&str| self.header.iter().any(|title| title == **name);
            if let Some(title) = ["t", "time"].iter().find(named) {
                let why = format!(
                    "the column `{title}` has the time of the rows, and a rate is stated too: leave out \
                     the rate, or rename the column if it is no time in s"
                );
                return Err(why.into());
            }
            let counted = Channel {
                index: None,
                factor: 1.0,
                offset: 0.0,
                late: 0.0,
            };
            return Ok((counted, None));
        }
        if let (Some(given), Some(table)) = (self.given(&Quantity::Time), self.tables.first())
            && self.time_in(table).is_none()
        {
            return Err(self.lacks(given, "t").into());
        }
        let first = self.tables.first().and_then(|table| self.time_in(table));
        let first = first.ok_or_else(missing)?;
        if self
            .given(&Quantity::Time)
            .is_none_or(|given| given.number.is_none())
            && let (false, Some(title)) = (several, first.index.and_then(|i| self.header.get(i)))
        {
            self.place(title)?;
        }
        Ok((first, None))
    }

    /// The error that a quantity has no column.
    fn missing(&self, quantity: &Quantity, what: &str) -> Unfit {
        let all = listed(self.tables);
        let column = self.given(quantity).map_or_else(
            || quantity.to_string(),
            // an assignment by a pattern
            |given| given.column.clone(),
        );
        Unfit {
            why: format!(
                "there is no column `{column}` ({what}); there are: {all}. `regen inspect SPEC LOG --out \
                 runs.yaml` proposes columns{}, or name it with",
                match quantity {
                    Quantity::Time =>
                        ", rows that are poses at rest need none with `--poses`".to_owned(),
                    Quantity::Effort(_) => format!(
                        ", `--column {quantity}=unmeasured` leaves out the equations of an effort that was \
                         not measured"
                    ),
                    _ => String::new(),
                }
            ),
            assignment: Some(format!("{quantity}=COLUMN")),
        }
    }
}

impl Channel {
    /// The SI value of a number in the file.
    pub(super) fn convert(self, number: f64) -> f64 {
        number * self.factor + self.offset
    }

    /// A quantity that is the same throughout, SI.
    fn constant(value: f64) -> Self {
        Self {
            index: None,
            factor: 1.0,
            offset: value,
            late: 0.0,
        }
    }

    /// The value where no column is read.
    pub(super) fn unread(self) -> f64 {
        match self.index {
            None => self.offset,
            Some(_) => 0.0,
        }
    }

    fn plain(index: usize) -> Self {
        Self {
            index: Some(index),
            factor: 1.0,
            offset: 0.0,
            late: 0.0,
        }
    }
}

/// The coordinates that are missing: the actuated ones that are not measured, as robots usually
/// measure these, and all others too where these are not enough.
///
/// - `measured`: those that are measured, as indices.
fn not_measured<'i>(info: &Info<'i>, measured: &[usize]) -> Vec<&'i str> {
    let missing = |k: &usize| !measured.contains(k);
    let actuated = info.actuated.iter().copied().filter(missing);
    let mut wanted: Vec<usize> = actuated.collect();
    if measured.len() + wanted.len() < info.dof() {
        wanted = (0..info.coordinates.len()).filter(missing).collect();
    }
    let names = wanted.into_iter();
    names
        .filter_map(|k| info.coordinates.get(k).copied())
        .collect()
}

impl ColumnLayout {
    /// The title of the column that times are read from.
    pub(super) fn time_column(&self) -> Option<&str> {
        let index = self.channels.first()?.index?;
        self.header.get(index).map(String::as_str)
    }

    /// Finds the columns of a run's files.
    pub(super) fn new(
        tables: &[Table],
        info: &Info<'_>,
        search: Search<'_>,
    ) -> Result<Self, Unfit> {
        let finder = Finder::new(tables, info, search, &[])?;
        let (time, times) = finder.times()?;
        if let (Some(index), None) = (time.index, finder.given(&Quantity::Time)) {
            finder.require_si(&Quantity::Time, index)?;
        }
        let mut measured = Vec::new();
        let mut positions = Vec::new();
        let mut rates = Vec::new();
        for (k, name) in info.coordinates.iter().enumerate() {
            let Some(position) = finder.find(&Quantity::Position((*name).to_owned()))? else {
                continue;
            };
            measured.push(k);
            positions.push(position);
            rates.push(if search.poses {
                (Some(Channel::constant(0.0)), Some(Channel::constant(0.0)))
            } else if position.index.is_some() && search.rates {
                (
                    finder.find(&Quantity::Velocity((*name).to_owned()))?,
                    finder.find(&Quantity::Acceleration((*name).to_owned()))?,
                )
            } else {
                (None, None)
            });
        }
        if measured.len() < info.dof() {
            return Err(Unfit {
                why: format!(
                    "{} of {} positions that are needed; missing: {}; columns: {}. Give one that is the same \
                     throughout as `COORDINATE=constant:VALUE`, and name the others with",
                    measured.len(),
                    info.dof(),
                    not_measured(info, &measured).join(" "),
                    listed(tables)
                ),
                assignment: Some("COORDINATE=COLUMN".to_owned()),
            });
        }
        // what is constant needs no differentiation where the others need none
        let read = || {
            let all = rates.iter().zip(&positions);
            all.filter(|(_, position)| position.index.is_some())
        };
        if read().count() > 0 && read().all(|(own, _)| own.0.is_some() && own.1.is_some()) {
            for (own, position) in rates.iter_mut().zip(&positions) {
                if position.index.is_none() {
                    *own = (Some(Channel::constant(0.0)), Some(Channel::constant(0.0)));
                }
            }
        }
        let mut channels = Vec::from([time]);
        channels.extend(positions);
        let mut entry = |channel: Option<Channel>| {
            channel.map(|channel| {
                channels.push(channel);
                channels.len() - 1
            })
        };
        let velocities: Vec<Option<usize>> = rates.iter().map(|rate| entry(rate.0)).collect();
        let accelerations: Vec<Option<usize>> = rates.iter().map(|rate| entry(rate.1)).collect();
        let mut unmeasured = Vec::new();
        for (place, &k) in info.actuated.iter().enumerate() {
            let name = info.coordinates.get(k).copied().unwrap_or_default();
            let effort = Quantity::Effort(name.to_owned());
            let given = finder.given(&effort);
            if given.is_some_and(|given| given.from == ValuesFrom::Unmeasured) {
                unmeasured.push(place);
            }
            let found = finder.find(&effort)?;
            channels.push(found.ok_or_else(|| finder.missing(&effort, "an effort"))?);
        }
        let same = |a: &Channel, b: &Channel| {
            let changes =
                (a.factor - b.factor).abs() + (a.offset - b.offset).abs() + (a.late - b.late).abs();
            a.index.is_some() && a.index == b.index && changes <= 0.0
        };
        for (place, channel) in channels.iter().enumerate() {
            if channels
                .iter()
                .take(place)
                .any(|other| same(other, channel))
            {
                let title = channel.index.and_then(|i| finder.header.get(i));
                let why = format!(
                    "the column `{}` is read as two quantities: name another one for one of them",
                    title.map_or("", String::as_str)
                );
                return Err(why.into());
            }
        }
        let unused = finder.unused(channels.iter().chain(times.iter().flatten()), info);
        let mut all = velocities.iter().chain(&accelerations);
        Ok(Self {
            unused,
            measured,
            channels,
            derivatives: all.all(Option::is_some),
            velocities,
            accelerations,
            efforts: info.actuated.len(),
            unmeasured,
            times,
            header: finder.header,
        })
    }

    /// The indices of the positions in a row.
    pub(super) fn positions(&self) -> core::ops::Range<usize> {
        1..1 + self.measured.len()
    }

    /// Whether the value of an entry is stated and not read.
    pub(super) fn is_constant(&self, entry: usize) -> bool {
        entry > 0 && self.channels.get(entry).is_some_and(|c| c.index.is_none())
    }

    /// The indices of the efforts in a row.
    pub(super) fn efforts(&self) -> core::ops::Range<usize> {
        self.channels.len() - self.efforts..self.channels.len()
    }

    /// The header of the column of a row's entry.
    pub(super) fn title(&self, entry: usize) -> String {
        let index = self.channels.get(entry).and_then(|c| c.index);
        let title = index.and_then(|i| self.header.get(i));
        title.cloned().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_without_motors_are_named_where_motors_are_too_few() {
        let info = Info {
            coordinates: &["x", "y", "turn", "q1", "q2"],
            independent: &[0, 1, 2, 3, 4],
            actuated: &[3, 4],
            ..Info::EMPTY
        };
        assert_eq!(not_measured(&info, &[3, 4]), ["x", "y", "turn"]);
        assert_eq!(not_measured(&info, &[0, 1, 2, 4]), ["q1"]);
    }
}
