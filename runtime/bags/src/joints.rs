//! Assigns the numbers of a message to joints.

use std::collections::BTreeSet;

use crate::definition::{Message, Value};
use crate::known::{Arrangement, Decoder};

/// The joint and quantity that each number of a message belongs to.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Shape {
    /// The names of the joints.
    pub(crate) joints: Vec<String>,
    /// For each number the quantity, as a prefix of the joint's name, and the index of the joint.
    pub(crate) entries: Vec<(String, usize)>,
}

/// The joints, stamp and values of one message.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Sample {
    /// The stamp of the header, ns.
    pub(crate) stamp: i64,
    pub(crate) shape: Shape,
    /// The numbers, in the order of [`Shape::entries`].
    pub(crate) values: Vec<f64>,
}

/// The lists of a `JointTrajectoryPoint` in a controller's state, with the prefixes of their
/// columns.
const LISTS: [(&str, &str); 4] = [
    ("positions", ""),
    ("velocities", "qd_"),
    ("accelerations", "qdd_"),
    ("effort", "tau_"),
];

/// The points of a controller's state: the field's name, its name in earlier versions of the
/// message, and the prefix of its columns.
const POINTS: [(&str, &str, &str); 3] = [
    ("feedback", "actual", ""),
    ("reference", "desired", "cmd_"),
    ("output", "output", "out_"),
];

/// The largest number of numbers of a message of any type.
const MAX_NUMBERS: usize = 2000;

/// The prefix of the columns of a `ros2_control` interface.
pub(crate) fn interface_prefix(name: &str) -> String {
    match name {
        "position" => String::new(),
        "velocity" => "qd_".to_owned(),
        "acceleration" => "qdd_".to_owned(),
        "effort" => "tau_".to_owned(),
        other => format!("{other}_"),
    }
}

impl Sample {
    /// Decodes a message.
    pub(crate) fn read(decoder: &Decoder, data: &[u8]) -> Result<Self, String> {
        Self::of(decoder.arrangement, &decoder.decode(data)?)
    }

    /// The sample of a message.
    pub(crate) fn of(arrangement: Arrangement, message: &Message) -> Result<Self, String> {
        let lacks = |name: &str| format!("it has no field `{name}` of the expected type");
        let stamp = message.message("header").and_then(|h| h.message("stamp"));
        if arrangement == Arrangement::Fields && stamp.is_none() {
            return Self::of_fields(message);
        }
        let stamp = stamp.ok_or_else(|| lacks("header"))?;
        // whole numbers of 32 bits in ROS; the type that a recording describes may be another one
        let part = |name: &str| {
            let value = stamp.number(name).ok_or_else(|| lacks(name))?;
            let is_whole = value.abs() <= f64::from(u32::MAX) && value.fract() == 0.0;
            let refused = || {
                format!("the field `{name}` of its stamp is {value}, no whole number of 32 bits")
            };
            is_whole.then_some(value as i64).ok_or_else(refused)
        };
        let (seconds, rest) = (part("sec")?, part("nanosec")?);
        let mut out = Self {
            stamp: seconds * 1_000_000_000 + rest,
            ..Self::default()
        };
        if arrangement == Arrangement::Fields {
            return Ok(Self {
                stamp: out.stamp,
                ..Self::of_fields(message)?
            });
        }
        let names = match arrangement {
            Arrangement::State => "name",
            Arrangement::Controller => "joint_names",
            Arrangement::Interfaces(field) => field,
            Arrangement::Fields => "",
        };
        let joints = message.texts(names).ok_or_else(|| lacks(names))?;
        out.shape.joints = joints.to_vec();
        let mut sorted: Vec<&String> = joints.iter().collect();
        sorted.sort_unstable();
        let mut pairs = sorted.iter().zip(sorted.iter().skip(1));
        if let Some((twice, _)) = pairs.find(|(one, next)| one == next) {
            return Err(format!("it names the joint `{twice}` twice"));
        }
        match arrangement {
            Arrangement::State => {
                for (field, prefix) in [("position", ""), ("velocity", "qd_"), ("effort", "tau_")] {
                    let values = message.numbers(field).ok_or_else(|| lacks(field))?;
                    out.add(prefix, values, field)?;
                }
            }
            Arrangement::Controller => {
                for (point, earlier, prefix) in POINTS {
                    let found = message.message(point).or_else(|| message.message(earlier));
                    let Some(found) = found else { continue };
                    for (list, quantity) in LISTS {
                        let values = found.numbers(list).ok_or_else(|| lacks(list))?;
                        let what = format!("{point}.{list}");
                        out.add(&format!("{prefix}{quantity}"), values, &what)?;
                    }
                }
            }
            Arrangement::Interfaces(_) => out.interfaces(message)?,
            Arrangement::Fields => {}
        }
        Ok(out)
    }

    /// All numbers of a message of any type, as those of one joint without a name.
    fn of_fields(message: &Message) -> Result<Self, String> {
        let mut out = Self::default();
        out.shape.joints.push(String::new());
        out.fields("", message)?;
        Ok(out)
    }

    /// Adds the numbers in the fields of a message, by their paths.
    fn fields(&mut self, path: &str, message: &Message) -> Result<(), String> {
        for (name, value) in message.iter() {
            let own = match path {
                // its stamp is the time
                "" if name == "header" && matches!(value, Value::Message(_)) => continue,
                "" => name.to_owned(),
                path => format!("{path}.{name}"),
            };
            match value {
                Value::Number(number) => self.one(own, *number)?,
                Value::Numbers(all) => {
                    for (k, number) in all.iter().enumerate() {
                        self.one(format!("{own}[{k}]"), *number)?;
                    }
                }
                Value::Message(inner) => self.fields(&own, inner)?,
                Value::Messages(all) => {
                    for (k, inner) in all.iter().enumerate() {
                        self.fields(&format!("{own}[{k}]"), inner)?;
                    }
                }
                Value::Text(_) | Value::Texts(_) => {}
            }
        }
        Ok(())
    }

    /// Adds a number of a field.
    fn one(&mut self, path: String, number: f64) -> Result<(), String> {
        if self.values.len() == MAX_NUMBERS {
            return Err(format!(
                "it has more than {MAX_NUMBERS} numbers, which is no state of a robot"
            ));
        }
        self.shape.entries.push((path, 0));
        self.values.push(number);
        Ok(())
    }

    /// Adds a list with one number for each joint; an empty list adds nothing.
    fn add(&mut self, prefix: &str, values: &[f64], what: &str) -> Result<(), String> {
        let joints = self.shape.joints.len();
        if values.is_empty() {
            return Ok(());
        }
        if values.len() != joints {
            return Err(format!(
                "{} numbers in `{what}` for {joints} joints",
                values.len()
            ));
        }
        let entries = (0..joints).map(|joint| (prefix.to_owned(), joint));
        self.shape.entries.extend(entries);
        self.values.extend(values);
        Ok(())
    }

    /// Adds the interfaces of each joint.
    fn interfaces(&mut self, message: &Message) -> Result<(), String> {
        let all = message
            .messages("interface_values")
            .ok_or("it has no field `interface_values` of the expected type")?;
        if all.len() != self.shape.joints.len() {
            return Err(format!(
                "{} lists of interfaces for {} joints",
                all.len(),
                self.shape.joints.len()
            ));
        }
        for (joint, interfaces) in all.iter().enumerate() {
            let names = interfaces.texts("interface_names").unwrap_or_default();
            let values = interfaces.numbers("values").unwrap_or_default();
            if names.len() != values.len() {
                return Err(format!(
                    "{} numbers for {} interfaces of `{}`",
                    values.len(),
                    names.len(),
                    self.shape.joints[joint]
                ));
            }
            for (k, name) in names.iter().enumerate() {
                if names[..k].contains(name) {
                    return Err(format!(
                        "it names the interface `{name}` of `{}` twice",
                        self.shape.joints[joint]
                    ));
                }
                self.shape.entries.push((interface_prefix(name), joint));
            }
            self.values.extend(values);
        }
        Ok(())
    }
}

impl Arrangement {
    /// Whether a sample has what is at a path of a message, or follows from what it has.
    fn reads(self, path: &[&str], is_number: bool) -> bool {
        match (self, path) {
            (_, ["header", "stamp", _] | ["header", "seq"])
            | (Self::State, ["name" | "position" | "velocity" | "effort"])
            // differences of two other points, and the time within a trajectory that a state has not
            | (
                Self::Controller,
                ["joint_names"]
                | ["error" | "multi_dof_error", ..]
                | [_, "time_from_start", _],
            )
            | (Self::Interfaces(_), ["interface_values", "interface_names" | "values"]) => true,
            (Self::Controller, [point, list]) => {
                let is_point = POINTS.iter().any(|own| own.0 == *point || own.1 == *point);
                is_point && LISTS.iter().any(|own| own.0 == *list)
            }
            (Self::Interfaces(names), [name]) => *name == names,
            (Self::Fields, ["header", _, ..]) => false,
            (Self::Fields, _) => is_number,
            _ => false,
        }
    }

    /// Adds what a message has and its sample lacks, by paths, with the reasons; empty texts and lists say nothing.
    pub(crate) fn unread<'m>(
        self,
        message: &'m Message,
        path: &mut Vec<&'m str>,
        out: &mut BTreeSet<(String, &'static str)>,
    ) {
        for (name, value) in message.iter() {
            path.push(name);
            let (is_number, is_empty) = match value {
                Value::Number(_) => (true, false),
                Value::Numbers(all) => (true, all.is_empty()),
                Value::Text(text) => (false, text.is_empty()),
                Value::Texts(all) => (false, all.iter().all(String::is_empty)),
                Value::Message(_) | Value::Messages(_) => (false, true),
            };
            if !is_empty && !self.reads(path, is_number) {
                let why = if is_number {
                    "its numbers are no states of joints"
                } else {
                    "it has text"
                };
                out.insert((path.join("."), why));
            }
            let inner = match value {
                Value::Message(inner) => core::slice::from_ref(inner),
                Value::Messages(all) => all,
                _ => &[],
            };
            for inner in inner {
                self.unread(inner, path, out);
            }
            path.pop();
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_stamp_counts_whole_seconds_and_nanoseconds() {
        let decoder = Decoder::new("sensor_msgs/msg/JointState", None)
            .unwrap()
            .unwrap();
        // seconds, nanoseconds, an empty frame (its length with the final zero), four empty lists
        let mut data = vec![0, 1, 0, 0];
        for word in [3_u32, 5, 1, 0, 0, 0, 0, 0] {
            data.extend(word.to_le_bytes());
        }
        let sample = Sample::read(&decoder, &data).unwrap();
        assert_eq!(sample.stamp, 3_000_000_005);
    }
}
