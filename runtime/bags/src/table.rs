//! The messages of a topic as rows of numbers.

use std::path::{Path, PathBuf};

use crate::error::BagError;
use crate::joints::{Sample, Shape};
use crate::known::Arrangement;
use crate::storage::Messages;
use crate::survey::TopicSurvey;

/// One nanosecond, s.
const NANO: f64 = 1e-9;
/// The largest number of lists of joints that an error contains.
const MAX_LISTED: usize = 5;

/// The content of a column.
#[derive(Clone, Debug, PartialEq)]
enum Column {
    /// The stamp of the header.
    Stamp,
    /// The time at which the message was received.
    Received,
    /// A quantity, given by its prefix, of a joint.
    Of(String, String),
}

/// The columns of a topic for joints that are sent together.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    path: PathBuf,
    topic: String,
    type_name: String,
    /// The stamp from which the times count, ns.
    pub(crate) start: i64,
    /// The time at which the first message was received, ns.
    first_received: i64,
    columns: Vec<Column>,
    titles: Vec<String>,
    /// The lists of joints that messages have, with the numbers of messages.
    joints: Vec<(Vec<String>, u64)>,
    /// What the recording has besides, with the reasons why it is in no column.
    pub(crate) absent: Vec<(String, String)>,
}

/// A row.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The number of the message on its topic, from 1.
    pub number: u64,
    /// The values of the requested columns; `None` if the message has the joint but lacks the
    /// quantity.
    pub values: Vec<Option<f64>>,
}

/// The tables of a topic, that with the most messages first. Joints are in the same table if any
/// message has both.
pub(crate) fn tables(path: &Path, found: &TopicSurvey) -> Result<Vec<Table>, BagError> {
    let mut groups: Vec<Vec<&(Shape, u64)>> = Vec::new();
    for shape in found.shapes.iter().filter(|own| !own.0.entries.is_empty()) {
        let mut own = vec![shape];
        let shares = |group: &Vec<&(Shape, u64)>| {
            let mut all = group.iter().flat_map(|other| &other.0.joints);
            all.any(|joint| shape.0.joints.contains(joint))
        };
        // the groups that the new message type connects, the earliest first
        let (mut joined, rest): (Vec<_>, Vec<_>) = groups.into_iter().partition(shares);
        groups = rest;
        if let Some(first) = joined.first_mut() {
            first.append(&mut own);
            own = joined.concat();
        }
        groups.push(own);
    }
    let is_known = Arrangement::of(&found.topic.type_name).is_some();
    if groups.is_empty() {
        return Err(BagError::Joints {
            file: path.to_path_buf(),
            topic: found.topic.name.clone(),
            why: if is_known {
                "its messages have no numbers: all lists of joints are empty".to_owned()
            } else {
                "its messages have no joint states by name and no field that is a number".to_owned()
            },
        });
    }
    let table = |group: Vec<&(Shape, u64)>| {
        let mut prefixes: Vec<&String> = Vec::new();
        let mut names: Vec<&String> = Vec::new();
        for (shape, _) in &group {
            for (prefix, joint) in &shape.entries {
                let name = &shape.joints[*joint];
                if !prefixes.contains(&prefix) {
                    prefixes.push(prefix);
                }
                if !names.contains(&name) {
                    names.push(name);
                }
            }
        }
        let mut columns = Vec::new();
        // a topic without stamps has the times of receipt only
        if found.stamped {
            columns.push(Column::Stamp);
        }
        columns.push(Column::Received);
        for prefix in prefixes {
            for name in &names {
                let has = |shape: &Shape| {
                    let mut all = shape.entries.iter();
                    all.any(|own| own.0 == *prefix && shape.joints[own.1] == **name)
                };
                if group.iter().any(|(shape, _)| has(shape)) {
                    columns.push(Column::Of(prefix.clone(), (*name).clone()));
                }
            }
        }
        let titles = columns.iter().map(|column| match column {
            Column::Stamp => "t".to_owned(),
            // messages of any type without stamps are those of recordings that need none
            Column::Received if !found.stamped && !is_known => "t".to_owned(),
            Column::Received => "t_received".to_owned(),
            Column::Of(prefix, joint) => format!("{prefix}{joint}"),
        });
        let mut joints: Vec<(Vec<String>, u64)> = Vec::new();
        for (shape, count) in &group {
            let mut own = shape.joints.clone();
            own.sort_unstable();
            match joints.iter_mut().find(|other| other.0 == own) {
                Some(other) => other.1 += count,
                None => joints.push((own, *count)),
            }
        }
        let absent = lacking(&joints);
        Table {
            path: path.to_path_buf(),
            topic: found.topic.name.clone(),
            type_name: found.topic.type_name.clone(),
            start: found.first_stamp.unwrap_or_default(),
            first_received: found.first_received,
            titles: titles.collect(),
            columns,
            joints,
            absent,
        }
    };
    let mut all: Vec<Table> = groups.into_iter().map(table).collect();
    let count = |table: &Table| table.joints.iter().map(|(_, count)| *count).sum::<u64>();
    all.sort_by_key(|table| std::cmp::Reverse(count(table)));
    Ok(all)
}

/// The messages that lack joints of others, with the reason why they are left out.
///
/// - `joints`: the lists of joints that messages have, sorted, with the numbers of messages.
fn lacking(joints: &[(Vec<String>, u64)]) -> Vec<(String, String)> {
    let mut names: Vec<&String> = joints.iter().flat_map(|own| &own.0).collect();
    names.sort_unstable();
    names.dedup();
    let all: u64 = joints.iter().map(|own| own.1).sum();
    let of_name = |name: &String| {
        let lack = joints.iter().filter(|own| !own.0.contains(name));
        let lack: u64 = lack.map(|own| own.1).sum();
        let why = format!("they lack the joint {name}, and are no rows where it is read");
        (lack > 0).then(|| (format!("{lack} of {all} messages"), why))
    };
    names.into_iter().filter_map(of_name).collect()
}

impl Table {
    /// The topic.
    pub fn topic(&self) -> &str {
        &self.topic
    }

    /// The titles of the columns.
    pub fn titles(&self) -> &[String] {
        &self.titles
    }

    /// What the recording has and no column has, with the reasons: other topics, texts and further fields of
    /// messages, and messages that lack a joint of others.
    pub fn absent(&self) -> &[(String, String)] {
        &self.absent
    }

    /// The rows of some columns, in the order of the recording: the messages that have all joints of
    /// these columns.
    ///
    /// - `columns`: indices of titles.
    ///
    /// # Errors
    /// When a file cannot be opened, or there is no such column.
    pub fn rows(&self, columns: &[usize]) -> Result<Rows, BagError> {
        let wanted = columns.iter().map(|column| {
            let found = self.columns.get(*column).cloned();
            found.ok_or_else(|| self.refused(format!("it has no column {}", column + 1)))
        });
        let wanted = wanted.collect::<Result<Vec<Column>, _>>()?;
        let mut joints = Vec::new();
        for column in &wanted {
            if let Column::Of(_, joint) = column
                && !joints.contains(joint)
            {
                joints.push(joint.clone());
            }
        }
        Ok(Rows {
            messages: Messages::open(&self.path, Some(&self.topic), Some(&self.topic))?,
            table: self.clone(),
            wanted,
            joints,
            shape: None,
            places: None,
            number: 0,
            given: 0,
        })
    }

    fn refused(&self, why: String) -> BagError {
        BagError::Joints {
            file: self.path.clone(),
            topic: self.topic.clone(),
            why,
        }
    }
}

/// The rows of a table, from the first one on.
pub struct Rows {
    messages: Messages,
    table: Table,
    wanted: Vec<Column>,
    /// The joints that a message must have.
    joints: Vec<String>,
    /// The shape of the last message.
    shape: Option<Shape>,
    /// For each requested column the index of its value in such a message; `None` if the message is
    /// not a row.
    places: Option<Vec<Option<usize>>>,
    /// The number of the last message on the topic.
    number: u64,
    /// The number of rows so far.
    given: u64,
}

impl Rows {
    /// The next row; `None` after the last one.
    ///
    /// # Errors
    /// When the recording can no longer be read, or after its last message if no message has all
    /// joints of the requested columns.
    pub fn next_row(&mut self) -> Result<Option<Row>, BagError> {
        loop {
            let table = &self.table;
            let Some(recorded) = self.messages.next(&mut |_, _| {})? else {
                return if self.given == 0 {
                    Err(self.apart())
                } else {
                    Ok(None)
                };
            };
            if !recorded.channel.same(&table.topic, &table.type_name) {
                continue;
            }
            self.number += 1;
            let (received, place) = (recorded.received, recorded.place);
            let read = match &recorded.channel.decoder {
                Some(Ok(decoder)) => Sample::read(decoder, recorded.data),
                Some(Err(why)) => Err(why.clone()),
                None => continue,
            };
            let sample = read.map_err(|why| BagError::Message {
                file: recorded.file.to_path_buf(),
                topic: table.topic.clone(),
                number: self.number,
                place: place.to_string(),
                why,
            })?;
            if self.shape.as_ref() != Some(&sample.shape) {
                self.places = self.places_in(&sample.shape);
                self.shape = Some(sample.shape);
            }
            let Some(places) = &self.places else {
                continue;
            };
            // differences of integers, since seconds since 1970 as a double do not resolve nanoseconds
            let since = |time: i64, start: i64| time.saturating_sub(start) as f64 * NANO;
            let value = |(column, place): (&Column, &Option<usize>)| match column {
                Column::Stamp => Some(since(sample.stamp, self.table.start)),
                Column::Received => Some(since(received, self.table.first_received)),
                Column::Of(..) => sample.values.get((*place)?).copied(),
            };
            self.given += 1;
            return Ok(Some(Row {
                number: self.number,
                values: self.wanted.iter().zip(places).map(value).collect(),
            }));
        }
    }

    /// The indices of the requested columns in messages of a shape; `None` if these are not rows.
    fn places_in(&self, shape: &Shape) -> Option<Vec<Option<usize>>> {
        let own = |joint: &String| shape.joints.contains(joint);
        let mut all = self.table.joints.iter().flat_map(|(joints, _)| joints);
        if !self.joints.iter().all(own) || !all.any(own) {
            return None;
        }
        let place = |column: &Column| match column {
            Column::Of(prefix, joint) => shape
                .entries
                .iter()
                .position(|entry| entry.0 == *prefix && shape.joints[entry.1] == *joint),
            _ => None,
        };
        Some(self.wanted.iter().map(place).collect())
    }

    /// The error that no message has all requested joints.
    fn apart(&self) -> BagError {
        let lists = self.table.joints.iter().take(MAX_LISTED);
        let lists: Vec<String> = lists
            .map(|(joints, count)| format!("{} ({count} times)", joints.join(" ")))
            .collect();
        let more = self.table.joints.len().saturating_sub(MAX_LISTED);
        let tail = if more > 0 {
            format!(", and {more} more")
        } else {
            String::new()
        };
        self.table.refused(format!(
            "no message has all of the joints {}; the messages have {}{tail}",
            self.joints.join(" "),
            lists.join(", ")
        ))
    }
}
