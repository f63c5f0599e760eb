//! Replacement of numbers in the text of a robot file, and insertion of what is missing for them.

use crate::fields::Fields;
use crate::log::Log;
use crate::number::number;
use crate::pose::{Pose, tensor_in};
use crate::tree::Inertia;
use crate::xml::Element;

mod mjcf;
mod sdf;
mod usd;

/// Changes of a text, by position.
#[derive(Debug)]
pub(crate) struct Edits {
    text: String,
    /// Start and end in bytes, replacement.
    changes: Vec<(usize, usize, String)>,
    values: usize,
}

impl Edits {
    pub(crate) fn new(text: &str) -> Self {
        Self {
            text: text.to_owned(),
            changes: Vec::new(),
            values: 0,
        }
    }

    /// How many numbers are replaced or inserted.
    pub(crate) fn len(&self) -> usize {
        self.values
    }

    /// Applies the changes to the text.
    pub(crate) fn apply(mut self, text: &str) -> String {
        self.changes.sort_by_key(|change| (change.0, change.1));
        let mut out = String::with_capacity(text.len());
        let mut at = 0;
        for (start, end, replacement) in self.changes {
            out.push_str(text.get(at..start).unwrap_or_default());
            out.push_str(&replacement);
            at = end;
        }
        out.push_str(text.get(at..).unwrap_or_default());
        out
    }

    /// Writes a link's `<inertial>`. The rotation of its frame is kept, and the tensor is
    /// converted to the frame's axes.
    pub(crate) fn inertia(&mut self, link: &Element, inertia: &Inertia) {
        let Some(inertial) = link.child("inertial") else {
            let content = whole(inertia);
            self.insert(link, &content);
            self.values += 10;
            return;
        };
        // errors in this attribute have been reported by the reader already
        let mut ignored_log = Log::default();
        let mut fields = Fields {
            log: &mut ignored_log,
            exact: true,
        };
        let rpy = inertial.child("origin").and_then(|o| o.attribute("rpy"));
        let rpy = rpy.and_then(|a| fields.array::<3>(a)).unwrap_or_default();
        let turned = if rpy == [0.0; 3] {
            Pose::default()
        } else {
            Pose::from_rpy([0.0; 3], rpy)
        };
        let tensor = tensor_in(inertia.tensor, &turned.r);
        let com = inertia.com.map(number).join(" ");
        let mut missing = Vec::new();
        match inertial.child("origin") {
            Some(origin) => self.attribute(origin, "xyz", &com),
            None if inertia.com == [0.0; 3] => {}
            None => missing.push(format!("<origin xyz=\"{com}\"/>")),
        }
        self.values += 3;
        let mass = number(inertia.mass);
        match inertial.child("mass") {
            Some(element) => self.attribute(element, "value", &mass),
            None => missing.push(format!("<mass value=\"{mass}\"/>")),
        }
        self.values += 1;
        match inertial.child("inertia") {
            Some(element) => {
                for ((name, mirrored), value) in ENTRIES.into_iter().zip(tensor) {
                    let value = number(value);
                    self.attribute(element, name, &value);
                    // some tools write the tensor's lower triangle too
                    if element.attribute(mirrored).is_some() && mirrored != name {
                        self.attribute(element, mirrored, &value);
                    }
                }
            }
            None => missing.push(tensor_element(tensor)),
        }
        self.values += 6;
        if !missing.is_empty() {
            self.insert(inertial, &missing.concat());
        }
    }

    /// Writes those values of a joint's `<dynamics>` that are given.
    pub(crate) fn dynamics(&mut self, joint: &Element, values: [(&str, Option<f64>); 2]) {
        let given = values
            .iter()
            .filter_map(|(key, v)| Some((*key, number((*v)?))));
        let given: Vec<(&str, String)> = given.collect();
        if given.is_empty() {
            return;
        }
        self.values += given.len();
        if let Some(element) = joint.child("dynamics") {
            for (key, value) in given {
                self.attribute(element, key, &value);
            }
            return;
        }
        let fields: Vec<String> = given.iter().map(|(k, v)| format!("{k}=\"{v}\"")).collect();
        self.insert(joint, &format!("<dynamics {}/>", fields.join(" ")));
    }

    /// Replaces an attribute's value, or inserts the attribute after the tag's name.
    fn attribute(&mut self, element: &Element, name: &str, value: &str) {
        let change = if let Some(attribute) = element.attribute(name) {
            let span = attribute.place.span;
            (span.start, span.end, value.to_owned())
        } else {
            let at = element.place.span.end;
            (at, at, format!(" {name}=\"{value}\""))
        };
        self.changes.push(change);
    }

    /// Inserts an element into another one, before its first child.
    fn insert(&mut self, element: &Element, content: &str) {
        let end = self.end_of_start_tag(element);
        let tag = element.tag.clone();
        if self.text.get(..end).is_some_and(|t| t.ends_with("/>")) {
            let closed = format!(">{content}</{tag}>");
            self.changes.push((end - 2, end, closed));
        } else {
            // on a separate line if the next element is on one
            let rest = self.text.get(end..).unwrap_or_default();
            let blank = rest.len() - rest.trim_start().len();
            let blank = rest.get(..blank).unwrap_or_default();
            self.changes.push((end, end, format!("{blank}{content}")));
        }
    }

    /// Position behind the `>` of the start tag.
    fn end_of_start_tag(&self, element: &Element) -> usize {
        let start = element.span.start;
        let mut quote = None;
        for (at, c) in self.text.get(start..).unwrap_or_default().char_indices() {
            match (quote, c) {
                (None, '"' | '\'') => quote = Some(c),
                (Some(open), c) if c == open => quote = None,
                (None, '>') => return start + at + 1,
                _ => {}
            }
        }
        self.text.len()
    }
}

/// The tensor's attributes, with the names of the mirrored entries.
const ENTRIES: [(&str, &str); 6] = [
    ("ixx", "ixx"),
    ("ixy", "iyx"),
    ("ixz", "izx"),
    ("iyy", "iyy"),
    ("iyz", "izy"),
    ("izz", "izz"),
];

fn tensor_element(tensor: [f64; 6]) -> String {
    let entries = ENTRIES.iter().zip(tensor);
    let fields: Vec<String> = entries
        .map(|((name, _), value)| format!("{name}=\"{}\"", number(value)))
        .collect();
    format!("<inertia {}/>", fields.join(" "))
}

fn whole(inertia: &Inertia) -> String {
    format!(
        "<inertial><origin xyz=\"{}\"/><mass value=\"{}\"/>{}</inertial>",
        inertia.com.map(number).join(" "),
        number(inertia.mass),
        tensor_element(inertia.tensor)
    )
}
