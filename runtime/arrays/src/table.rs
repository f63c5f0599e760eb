//! Makes tables of arrays: those of the same length as a time are its columns.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::array::{Array, Container, Found};
use crate::error::{ArrayError, Read, Why, broken};
use crate::input::Input;

/// The largest number of columns of a table.
const MAX_COLUMNS: usize = 5000;

/// Arrays of the same length as columns of a table.
#[derive(Clone, Debug)]
pub struct Table {
    path: PathBuf,
    container: Arc<dyn Container>,
    arrays: Arc<Vec<Array>>,
    rows: usize,
    titles: Vec<String>,
    columns: Vec<Column>,
    time: Option<usize>,
    /// The date from which its times count in the file, ns since 1970.
    date: Option<i64>,
    /// What is added to these times, s.
    shift: f64,
    absent: Vec<(String, String)>,
    matrices: Vec<Matrix>,
}

/// The numbers of an array that are a column: every `step`-th one from `first` on.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Column {
    array: usize,
    first: usize,
    step: usize,
}

/// Neighbouring columns that are one matrix in the file, or a vector.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Matrix {
    /// Its path.
    pub name: String,
    /// The index of its first column in the table.
    pub first: usize,
    /// The number of its columns.
    pub count: usize,
}

impl Matrix {
    /// The last part of its path.
    pub fn last_name(&self) -> &str {
        last_part(&self.name)
    }
}

/// The last part of a path.
fn last_part(name: &str) -> &str {
    let start = name.rfind(['.', '/']).map_or(0, |dot| dot + 1);
    name.get(start..).unwrap_or(name)
}

/// The number of parts that two paths have in common.
fn common(one: &str, other: &str) -> usize {
    let parts = |name: &str| -> Vec<String> { name.split(['.', '/']).map(str::to_owned).collect() };
    let (one, other) = (parts(one), parts(other));
    one.iter().zip(&other).take_while(|(a, b)| a == b).count()
}

/// The length of an array that is one row or column of numbers.
fn vector(array: &Array) -> Option<u64> {
    let mut long = array.shape.iter().filter(|n| **n != 1);
    let length = long.next().copied().unwrap_or(1);
    (long.next().is_none() && length > 0).then_some(length)
}

/// The index of the axis along which an array has so many rows.
fn axis(array: &Array, rows: u64) -> Option<usize> {
    // of a scalar every axis has one
    array.shape.iter().position(|n| *n == rows)
}

/// The path of an array without the indices of a column behind it.
fn without_indices(name: &str) -> &str {
    match name.rfind('[') {
        Some(start) if name.ends_with(']') && name[start..].contains(':') => &name[..start],
        _ => name,
    }
}

/// The array that is called so: by its path, a path that starts with `/`, or the last part of one.
fn named(arrays: &[Array], name: &str) -> Option<usize> {
    let name = name.trim_start_matches('/');
    let exact = |name: &str| arrays.iter().position(|own| own.name == name);
    let mut last = arrays
        .iter()
        .enumerate()
        .filter(|(_, own)| last_part(&own.name) == name);
    exact(name)
        .or_else(|| exact(without_indices(name)))
        .or_else(|| match (last.next(), last.next()) {
            (Some((only, _)), None) => Some(only),
            _ => None,
        })
}

/// A sentence about the shape of an array.
fn shape(array: &Array) -> String {
    let sizes: Vec<String> = array.shape.iter().map(u64::to_string).collect();
    match &sizes[..] {
        [] => "one number".to_owned(),
        [one] => format!("{one} numbers"),
        _ => format!("{} numbers", sizes.join(" x ")),
    }
}

impl Table {
    /// The tables of the arrays of a file, that with most columns first.
    ///
    /// - `time`: the array of times that the user names.
    pub(crate) fn all(path: &Path, found: Found, time: Option<&str>) -> Vec<Self> {
        let Found {
            arrays,
            mut unread,
            container,
        } = found;
        let is_time = |own: &Array| {
            own.is_time || own.group.is_none() && matches!(last_part(&own.name), "t" | "time")
        };
        let asked = time.and_then(|name| named(&arrays, name));
        let times: Vec<usize> = match asked {
            Some(own) => vec![own],
            None => (0..arrays.len())
                .filter(|k| is_time(&arrays[*k]) && vector(&arrays[*k]).is_some())
                .collect(),
        };
        // the number of rows of each table, and its time
        let mut all: Vec<(u64, Option<usize>)> = Vec::new();
        for own in times {
            let length = arrays[own].shape.iter().copied().max().unwrap_or(1);
            all.push((length, Some(own)));
        }
        if all.is_empty() {
            all.push((usual_length(&arrays), None));
        }
        let mut members: Vec<Vec<usize>> = vec![Vec::new(); all.len()];
        for (k, array) in arrays.iter().enumerate() {
            let fits = |(rows, time): &(u64, Option<usize>)| {
                let own_part = time.is_none_or(|time| arrays[time].group == array.group);
                own_part && axis(array, *rows).is_some()
            };
            let near = |time: Option<usize>| match time {
                // a time belongs to its own table
                Some(time) if time == k => usize::MAX,
                Some(time) => common(&arrays[time].name, &array.name),
                None => 0,
            };
            let mut best: Option<(usize, usize)> = None;
            for (place, own) in all.iter().enumerate().filter(|(_, own)| fits(own)) {
                let nearness = near(own.1);
                if best.is_none_or(|(_, so_far)| nearness > so_far) {
                    best = Some((place, nearness));
                }
            }
            match best {
                Some((place, _)) => members[place].push(k),
                None => unread.push((array.name.clone(), told(array, &arrays, &all))),
            }
        }
        let arrays = Arc::new(arrays);
        let container: Arc<dyn Container> = Arc::from(container);
        let tables = all.iter().zip(members).map(|((rows, time), members)| {
            let mut table = Self {
                path: path.to_path_buf(),
                container: Arc::clone(&container),
                arrays: Arc::clone(&arrays),
                rows: usize::try_from(*rows).unwrap_or(usize::MAX),
                titles: Vec::new(),
                columns: Vec::new(),
                time: None,
                date: None,
                shift: 0.0,
                absent: unread.clone(),
                matrices: Vec::new(),
            };
            for own in members {
                table.add(own, *rows, *time == Some(own));
            }
            table
        });
        let mut tables: Vec<Self> = tables.collect();
        tables.sort_by_key(|table| std::cmp::Reverse(table.titles.len()));
        tables
    }

    /// Adds the columns of an array.
    fn add(&mut self, place: usize, rows: u64, is_time: bool) {
        let array = &self.arrays[place];
        let (Some(along), Some(count)) = (axis(array, rows), array.count()) else {
            return;
        };
        let others = count.checked_div(self.rows).unwrap_or(0);
        if self.titles.len().saturating_add(others) > MAX_COLUMNS {
            let why = format!(
                "it has {}, and the limit is {MAX_COLUMNS} columns of a table",
                shape(array)
            );
            self.absent.push((array.name.clone(), why));
            return;
        }
        let step = |axis: usize| -> usize {
            let inner = if array.columns_first {
                &array.shape[..axis]
            } else {
                &array.shape[axis + 1..]
            };
            inner.iter().product::<u64>() as usize
        };
        if is_time {
            self.time = Some(self.titles.len());
        }
        if !is_time {
            self.matrices.push(Matrix {
                name: array.name.clone(),
                first: self.titles.len(),
                count: others,
            });
        }
        for k in 0..others {
            // the indices along the other axes, the last one fastest
            let mut rest = k as u64;
            let mut indices = vec![0; array.shape.len()];
            for axis in (0..array.shape.len()).rev().filter(|axis| *axis != along) {
                indices[axis] = rest % array.shape[axis];
                rest /= array.shape[axis];
            }
            let mut title = array.name.clone();
            if others > 1 {
                let index = |axis: usize| match axis {
                    axis if axis == along => ":".to_owned(),
                    axis => indices[axis].to_string(),
                };
                let all: Vec<String> = (0..indices.len()).map(index).collect();
                let _ = write!(title, "[{}]", all.join(","));
            }
            let first = (0..indices.len()).map(|axis| indices[axis] as usize * step(axis));
            self.columns.push(Column {
                array: place,
                first: first.sum(),
                step: step(along),
            });
            self.titles.push(title);
        }
    }

    /// The titles of the columns: the paths of vectors, and of matrices those with an index such as
    /// `q[:,2]`, from 0.
    pub fn titles(&self) -> &[String] {
        &self.titles
    }

    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The index of the column of time: the named one, one of the name `t` or `time`, or what the
    /// format says.
    pub fn time(&self) -> Option<usize> {
        self.time
    }

    /// The date from which its times count, ns since 1970: that of the first one, if the file has dates, or that of the
    /// recording, if the file says it.
    pub fn date(&self) -> Option<i64> {
        self.date
    }

    /// The same table, whose dates count from another one, ns since 1970.
    #[must_use]
    pub fn counting_from(mut self, date: i64) -> Self {
        let own = self.date.unwrap_or(date);
        self.shift = (i128::from(own) - i128::from(date)) as f64 / 1e9;
        self
    }

    /// How much later than the times of others, s, its own begin to count by the dates of their recordings; 0 where
    /// the times are dates themselves.
    pub fn later(&self) -> f64 {
        match self.time {
            Some(own) if self.is_clock(own) => 0.0,
            _ => self.shift,
        }
    }

    /// Finds the date from which its times count.
    pub(crate) fn find_date(&mut self, input: &mut Input) -> Read<()> {
        let time = self.time.and_then(|own| self.columns.get(own));
        if let Some(own) = time.and_then(|own| self.arrays.get(own.array))
            && (own.is_clock || own.is_time)
        {
            input.renew();
            self.date = self.container.date(input, own.place)?;
        }
        Ok(())
    }

    /// The matrices whose columns are in the table.
    pub fn matrices(&self) -> &[Matrix] {
        &self.matrices
    }

    /// The unit that the file states of a column, such as `deg`; numbers are not converted.
    pub fn unit(&self, column: usize) -> Option<&str> {
        let array = self.arrays.get(self.columns.get(column)?.array)?;
        Some(array.unit.trim()).filter(|unit| !unit.is_empty())
    }

    /// Whether the numbers of a column are dates or spans of time by their type, and thus in s.
    pub fn is_clock(&self, column: usize) -> bool {
        let array = self.columns.get(column).map(|own| own.array);
        array.is_some_and(|own| self.arrays.get(own).is_some_and(|own| own.is_clock))
    }

    /// Why the file has an array of this path, and the table has no such column; `None` for paths that
    /// the file does not have.
    pub fn why_absent(&self, name: &str) -> Option<&str> {
        let name = without_indices(name.trim_start_matches('/'));
        let own = |(path, _): &&(String, String)| path == name || last_part(path) == name;
        self.absent.iter().find(own).map(|(_, why)| why.as_str())
    }

    /// What the file has besides the columns, with the reasons.
    pub fn absent(&self) -> &[(String, String)] {
        &self.absent
    }

    /// The index of the column that is called so: by its title, a path that starts with `/`, the
    /// title without its first parts, if no other column has the same, the column of a matrix whose
    /// rows are the columns of the table, the only column of a vector, or a vector by another name of it in
    /// the file.
    pub fn place(&self, name: &str) -> Option<usize> {
        let name = name.trim_start_matches('/');
        let only = |is_own: &dyn Fn(&str) -> bool| {
            let mut all = (0..self.titles.len()).filter(|k| is_own(&self.titles[*k]));
            all.next().filter(|_| all.next().is_none())
        };
        let ends = |title: &str, name: &str| {
            let before = title.strip_suffix(name);
            before.is_some_and(|before| before.is_empty() || before.ends_with(['.', '/']))
        };
        let turned = || {
            let inside = name.strip_suffix(']')?;
            let (path, index) = inside.rsplit_once("[:,")?;
            Some(format!("{path}[{index},:]"))
        };
        // a vector, by another name
        let other = || {
            let mut all = (0..self.columns.len()).filter(|k| {
                let array = &self.arrays[self.columns[*k].array];
                array.other_names.iter().any(|own| own == name)
            });
            all.next().filter(|_| all.next().is_none())
        };
        // the only column of a vector
        let bare = || name.strip_suffix("[:,0]").map(str::to_owned);
        let found = |name: &str| {
            let whole = only(&|title| title == name);
            whole.or_else(|| only(&|title| ends(title, name)))
        };
        found(name)
            .or_else(|| found(&turned()?))
            .or_else(|| found(&bare()?))
            .or_else(other)
    }

    /// The numbers of some columns.
    ///
    /// # Errors
    /// When the file can no longer be read, or is broken.
    pub fn columns(&self, wanted: &[usize]) -> Result<Vec<Vec<f64>>, ArrayError> {
        let failed = |why: Why| ArrayError::new(&self.path, why);
        let mut input = Input::open(&self.path).map_err(|error| failed(error.into()))?;
        self.read(&mut input, wanted).map_err(failed)
    }

    fn read(&self, input: &mut Input, wanted: &[usize]) -> Read<Vec<Vec<f64>>> {
        let mut out = vec![Vec::new(); wanted.len()];
        for place in 0..wanted.len() {
            let Some(own) = wanted.get(place).and_then(|k| self.columns.get(*k)) else {
                return broken("a column has disappeared");
            };
            if !out[place].is_empty() {
                continue;
            }
            // an array is read once for all of its columns
            let array = &self.arrays[own.array];
            input.renew();
            let numbers = self.container.numbers(input, array.place)?;
            if array.count() != Some(numbers.len()) {
                return broken(format!(
                    "{} has {} in place of {}",
                    array.name,
                    numbers.len(),
                    shape(array)
                ));
            }
            for (k, column) in wanted.iter().zip(&mut out) {
                if let Some(other) = self.columns.get(*k)
                    && other.array == own.array
                {
                    let from = numbers.get(other.first..).unwrap_or_default();
                    let own = from.iter().step_by(other.step.max(1));
                    column.extend(own.take(self.rows));
                    if self.time == Some(*k) && self.shift.abs() > 0.0 {
                        for x in column.iter_mut() {
                            *x += self.shift;
                        }
                    }
                }
            }
        }
        Ok(out)
    }
}

/// The length that most columns have, the longest of several.
fn usual_length(arrays: &[Array]) -> u64 {
    let mut counts: Vec<(u64, u64)> = Vec::new();
    for array in arrays {
        let longest = array.shape.iter().copied().max().unwrap_or(1);
        let columns = (array.count().unwrap_or(0) as u64)
            .checked_div(longest)
            .unwrap_or(0);
        // single numbers are settings
        if longest < 2 || columns > MAX_COLUMNS as u64 {
            continue;
        }
        match counts.iter_mut().find(|own| own.1 == longest) {
            Some(own) => own.0 += columns,
            None => counts.push((columns, longest)),
        }
    }
    counts.into_iter().max().map_or(0, |(_, length)| length)
}

/// Why an array is in no table.
fn told(array: &Array, arrays: &[Array], all: &[(u64, Option<usize>)]) -> String {
    let times = all.iter().map(|(rows, time)| match time {
        Some(time) => format!("the time `{}` has {rows}", arrays[*time].name),
        None => format!("most others have {rows}"),
    });
    let times: Vec<String> = times.take(3).collect();
    format!("it has {}, and {}", shape(array), times.join(", "))
}
