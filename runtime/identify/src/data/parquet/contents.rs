//! Finds the columns of numbers in a Parquet file, including the elements of lists, and the episodes
//! of a LeRobot data set.
//!
//! LeRobot stores `observation.state` and `action` as lists of one length, whose elements
//! `meta/info.json` names, a time in each episode, and the index of the episode.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use parquet::basic::Type;
use parquet::column::reader::ColumnReader;
use parquet::file::reader::{FileReader, SerializedFileReader};
use serde_json::Value;

use super::arrow::{self, Said};
use super::{BATCH, Kind, ParquetRows, catch_panic, column, has_dates, lists, open, unfit};
use crate::data::file_rows::Wanted;
use crate::data::problem::DataError;
use crate::document::require_regular;

/// The column of the index of the episode.
const EPISODE: &str = "episode_index";
/// Keys of metadata that libraries write by themselves.
const OF_WRITERS: [&str; 3] = [arrow::KEY, "pandas", "huggingface"];
/// The same of metadata of fields.
const OF_FIELDS: [&str; 3] = [
    "PARQUET:field_id",
    "ARROW:extension:name",
    "ARROW:extension:metadata",
];
/// The length of the longest list whose elements become columns.
const MAX_ELEMENTS: usize = 1000;
/// The largest number of episodes that an error lists.
const MAX_LISTED: usize = 20;
/// The largest size of `info.json`, in bytes.
const MAX_INFO_BYTES: u64 = 1 << 22;
/// The number of folders above a file that are searched for `meta/info.json`.
const MAX_LEVELS: usize = 4;

/// Where the numbers of a column are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::data) struct Place {
    /// The index of the column as the file counts them.
    pub(super) leaf: usize,
    /// The element, and the length of the lists.
    pub(super) element: Option<(usize, usize)>,
    /// The rate of a time in single precision, Hz, by which it is restored.
    pub(super) rate: Option<f64>,
}

/// The columns of a file, and the rows that are read.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::data) struct Contents {
    pub(super) places: Vec<Place>,
    /// The number of the first row and of the last one, from 1; `None` for all.
    pub(super) rows: Option<(u64, u64)>,
    /// The unit that the file states of each column; empty without one.
    pub(in crate::data) units: Vec<String>,
    /// Whether the type of each column is that of dates or times of the day, which are read in s.
    pub(in crate::data) clocks: Vec<bool>,
    /// The date from which dates count, ns since 1970.
    pub(super) dated: i64,
    /// What the file has besides columns, with the reasons why it is not read.
    pub(in crate::data) absent: Vec<(String, String)>,
}

/// The contents of `meta/info.json` in a folder above a file, which names features and the rate;
/// empty without such a file.
#[derive(Default)]
struct Info(Value);

impl Info {
    fn near(path: &Path) -> Self {
        let folders = path.ancestors().skip(1).take(MAX_LEVELS);
        let mut files = folders.map(|folder| folder.join("meta/info.json"));
        let text = files.find_map(|file| {
            let mut text = String::new();
            require_regular(&file).ok()?;
            let file = File::open(file).ok()?;
            file.take(MAX_INFO_BYTES).read_to_string(&mut text).ok()?;
            Some(text)
        });
        let value = text.and_then(|text| serde_json::from_str(&text).ok());
        Self(value.unwrap_or_default())
    }

    fn rate(&self) -> Option<f64> {
        let rate = self.0.get("fps")?.as_f64()?;
        (rate > 0.0 && rate.is_finite()).then_some(rate)
    }

    /// The names of the elements of a feature.
    fn names(&self, feature: &str) -> Vec<String> {
        fn texts(value: &Value, out: &mut Vec<String>) {
            match value {
                Value::String(text) => out.push(text.clone()),
                Value::Array(all) => all.iter().for_each(|value| texts(value, out)),
                Value::Object(all) => all.values().for_each(|value| texts(value, out)),
                _ => {}
            }
        }
        let mut out = Vec::new();
        let names = self.0.get("features").and_then(|all| all.get(feature));
        if let Some(names) = names.and_then(|feature| feature.get("names")) {
            texts(names, &mut out);
        }
        out
    }
}

/// The title of the column of an element of a list, from 0.
fn title(feature: &str, names: &[String], size: usize, element: usize) -> String {
    let name = names.get(element).filter(|_| names.len() == size);
    let Some(name) = name else {
        return format!("{feature}.{}", element + 1);
    };
    match feature {
        "observation.state" => name.clone(),
        "observation.velocity" => format!("qd_{name}"),
        "observation.effort" => format!("tau_{name}"),
        "action" => format!("cmd_{name}"),
        other => format!("{other}.{name}"),
    }
}

/// The number of elements of the first list of a column; `None` if the list contains no numbers.
fn first_length(path: &Path, reader: &SerializedFileReader<File>, leaf: usize) -> Option<usize> {
    let schema = reader.metadata().file_metadata().schema_descr();
    let kind = Kind::of(&schema.column(leaf), 0);
    let length = match column(path, reader, 0, leaf).ok()? {
        ColumnReader::DoubleColumnReader(mut own) => lists::first_length(&mut own),
        ColumnReader::FloatColumnReader(mut own) => lists::first_length(&mut own),
        ColumnReader::Int32ColumnReader(mut own) => lists::first_length(&mut own),
        ColumnReader::Int64ColumnReader(mut own) => lists::first_length(&mut own),
        ColumnReader::FixedLenByteArrayColumnReader(mut own) if kind == Kind::Half => {
            lists::first_length(&mut own)
        }
        _ => return None,
    };
    length
        .ok()
        .filter(|length| (1..=MAX_ELEMENTS).contains(length))
}

/// The first date of a column in the first rows, ns since 1970.
fn first_date(path: &Path, reader: &SerializedFileReader<File>, leaf: usize) -> Option<i64> {
    let schema = reader.metadata().file_metadata().schema_descr();
    let Kind::Clock(tick, _) = Kind::of(&schema.column(leaf), 0) else {
        return None;
    };
    let ColumnReader::Int64ColumnReader(mut own) = column(path, reader, 0, leaf).ok()? else {
        return None;
    };
    let (mut levels, mut values) = (Vec::new(), Vec::new());
    catch_panic(|| own.read_records(BATCH, Some(&mut levels), None, &mut values)).ok()?;
    values.first()?.checked_mul(tick)
}

/// The titles of a file's columns and where their numbers are.
///
/// - `episode`: the index of the episode that is read, of a file that has several.
/// - `dated`: the date from which dates count, ns since 1970; the first one of this file if there is none yet.
pub(in crate::data) fn contents(
    path: &Path,
    episode: Option<u64>,
    dated: &mut Option<i64>,
) -> Result<(Vec<String>, Contents), DataError> {
    let reader = open(path)?;
    if reader.metadata().file_metadata().num_rows() == 0 {
        return Err(unfit(path, "it has no rows".to_owned()));
    }
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let plain = |name: &str| {
        schema
            .columns()
            .iter()
            .position(|c| c.path().string() == name)
    };
    let episodes = plain(EPISODE);
    let has_time = plain("t").or_else(|| plain("time")).is_some();
    let has_lists = schema.columns().iter().any(|c| c.max_rep_level() > 0);
    let info = if has_lists || episodes.is_some() {
        Info::near(path)
    } else {
        Info::default()
    };
    let (mut titles, mut places) = (Vec::new(), Vec::new());
    for (leaf, column) in schema.columns().iter().enumerate() {
        let name = column.path().string();
        let size = match column.max_rep_level() {
            1 => first_length(path, &reader, leaf),
            _ => None,
        };
        if let Some(size) = size {
            let feature = column.path().parts().first().cloned().unwrap_or_default();
            let names = info.names(&feature);
            for element in 0..size {
                titles.push(title(&feature, &names, size, element));
                places.push(Place {
                    leaf,
                    element: Some((element, size)),
                    rate: None,
                });
            }
            continue;
        }
        let is_time = name == "timestamp" && episodes.is_some() && !has_time;
        let rate = info
            .rate()
            .filter(|_| column.physical_type() == Type::FLOAT);
        titles.push(if is_time { "t".to_owned() } else { name });
        places.push(Place {
            leaf,
            element: None,
            rate: rate.filter(|_| is_time),
        });
    }
    let said = reader.metadata().file_metadata().key_value_metadata();
    let keys = said.into_iter().flatten().map(|own| own.key.clone());
    let keys = keys.filter(|key| !OF_WRITERS.contains(&key.as_str()));
    let why = "it is metadata of the file, which is not applied to numbers";
    let mut absent: Vec<(String, String)> = keys.map(|key| (key, why.to_owned())).collect();
    let of_fields = said.into_iter().flatten().find(|own| own.key == arrow::KEY);
    let of_fields = of_fields.and_then(|own| own.value.as_deref());
    let of_fields = of_fields.map(arrow::said).unwrap_or_default();
    let units = places.iter().map(|place| {
        let path = schema.column(place.leaf).path().string();
        unit(&of_fields, &path)
    });
    let units = units.collect();
    for own in of_fields.iter().filter(|own| !is_unit(own)) {
        if !OF_FIELDS.contains(&own.key.as_str()) && absent.iter().all(|(key, _)| *key != own.key) {
            let why = format!(
                "it is metadata of the column {}, which is not applied to numbers",
                own.field
            );
            absent.push((own.key.clone(), why));
        }
    }
    let clocks: Vec<bool> = places
        .iter()
        .map(|place| matches!(Kind::of(&schema.column(place.leaf), 0), Kind::Clock(..)))
        .collect();
    if dated.is_none() {
        let dates = places
            .iter()
            .filter(|own| has_dates(&schema.column(own.leaf)));
        *dated = dates
            .map(|own| own.leaf)
            .find_map(|leaf| first_date(path, &reader, leaf));
    }
    let mut contents = Contents {
        places,
        rows: None,
        units,
        clocks,
        dated: dated.unwrap_or(0),
        absent,
    };
    match (episodes, episode) {
        (None, None) => {}
        (None, Some(_)) => {
            let why = format!("it has no column `{EPISODE}`, and an episode is asked for");
            return Err(unfit(path, why));
        }
        (Some(leaf), _) => {
            // a column of lists before it counts as several
            let column = contents.places.iter().position(|place| place.leaf == leaf);
            let column = column.unwrap_or(leaf);
            contents.rows = Some(rows_of(path, &contents, column, episode)?);
        }
    }
    Ok((titles, contents))
}

fn is_unit(said: &Said) -> bool {
    matches!(&*said.key.to_lowercase(), "unit" | "units")
}

/// The unit of a column: that of its field, or else of the one around it.
fn unit(said: &[Said], column: &str) -> String {
    let around = |own: &&Said| {
        let rest = column.strip_prefix(own.field.as_str());
        is_unit(own) && rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
    };
    let found = said.iter().filter(around);
    let found = found.max_by_key(|own| own.field.len());
    found.map_or_else(String::new, |own| own.value.trim().to_owned())
}

/// The rows of an episode.
fn rows_of(
    path: &Path,
    contents: &Contents,
    column: usize,
    episode: Option<u64>,
) -> Result<(u64, u64), DataError> {
    let wanted = vec![Wanted {
        column,
        title: EPISODE.to_owned(),
    }];
    let mut rows = ParquetRows::open(path, contents, wanted)?;
    let mut all: Vec<(i64, u64, u64)> = Vec::new();
    while let Some(row) = rows.next_row()? {
        let Some(index) = row.values.first().filter(|index| index.is_finite()) else {
            continue;
        };
        let index = index.round() as i64;
        match all.last_mut() {
            Some(last) if last.0 == index => last.2 = row.line,
            _ => all.push((index, row.line, row.line)),
        }
    }
    let part = |why: String| DataError::Part {
        file: path.display().to_string(),
        why,
        key: "episode",
    };
    let listed = || {
        let shown: Vec<String> = all
            .iter()
            .take(MAX_LISTED)
            .map(|e| e.0.to_string())
            .collect();
        let more = all.len().saturating_sub(MAX_LISTED);
        let tail = if more > 0 {
            format!(" and {more} more")
        } else {
            String::new()
        };
        format!("{}{tail}", shown.join(", "))
    };
    match (episode, &all[..]) {
        (None, []) => Ok((1, 0)),
        (None, [(_, first, last)]) => Ok((*first, *last)),
        (None, _) => Err(part(format!(
            "it has several episodes, so one must be named: {}",
            listed()
        ))),
        (Some(index), _) => {
            let mut own = all.iter().filter(|e| u64::try_from(e.0) == Ok(index));
            match (own.next(), own.next()) {
                (Some((_, first, last)), None) => Ok((*first, *last)),
                (None, _) => Err(part(format!(
                    "it has no episode {index}; there are {}",
                    listed()
                ))),
                (Some(_), Some(_)) => Err(unfit(
                    path,
                    format!("the rows of episode {index} are not consecutive"),
                )),
            }
        }
    }
}

/// A time in s, restored to the whole number of steps at `rate`, Hz, that rounds to it in single
/// precision; unchanged if there is none.
pub(super) fn restored(time: f64, rate: f64) -> f64 {
    let full = (time * rate).round() / rate;
    #[allow(
        clippy::cast_possible_truncation,
        clippy::float_cmp,
        reason = "the stored time is exactly the rounded one"
    )]
    let same = f64::from(full as f32) == time;
    if same { full } else { time }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_in_single_precision_are_restored_where_they_are_steps_of_the_rate() {
        for k in 0..10_000 {
            let exact = f64::from(k) / 30.0;
            #[allow(clippy::cast_possible_truncation)]
            let stored = f64::from(exact as f32);
            assert_eq!(restored(stored, 30.0).to_bits(), exact.to_bits());
        }
        assert_eq!(restored(0.0125, 30.0).to_bits(), 0.0125_f64.to_bits());
    }

    #[test]
    fn elements_are_called_by_their_names_and_else_by_their_numbers() {
        let names = ["a".to_owned(), "b".to_owned()];
        assert_eq!(title("observation.state", &names, 2, 1), "b");
        assert_eq!(title("action", &names, 2, 0), "cmd_a");
        assert_eq!(
            title("observation.state", &names, 3, 2),
            "observation.state.3"
        );
        assert_eq!(title("wrench", &names, 2, 0), "wrench.a");
    }
}
