//! Identified values in an SDF file: texts of elements within links' `<inertial>` and joints' axes.

use super::{ENTRIES, Edits};
use crate::fields::Fields;
use crate::log::Log;
use crate::number::number;
use crate::pose::tensor_in;
use crate::sdf;
use crate::tree::Inertia;
use crate::xml::Element;

impl Edits {
    /// Writes a link's `<inertial>`. The rotation of its frame is kept, and the tensor is converted to
    /// the frame's axes.
    pub(crate) fn sdf_inertia(&mut self, link: &Element, inertia: &Inertia) {
        self.values += 10;
        let com = inertia.com.map(number).join(" ");
        let Some(inertial) = link.child("inertial") else {
            let tensor = texts(inertia.tensor);
            let mass = number(inertia.mass);
            let content = format!(
                "<inertial><pose>{com} 0 0 0</pose><mass>{mass}</mass><inertia>{tensor}</inertia></inertial>"
            );
            self.insert(link, &content);
            return;
        };
        // errors in this pose have been reported by the reader already
        let mut ignored_log = Log::default();
        let mut fields = Fields {
            log: &mut ignored_log,
            exact: true,
        };
        let (frame, _) = sdf::pose(inertial, &mut fields);
        let tensor = tensor_in(inertia.tensor, &frame.r);
        let mut missing = Vec::new();
        match inertial.content_of("pose") {
            Some(pose) => {
                let turned: Vec<&str> = pose.value.split_whitespace().skip(3).collect();
                let span = pose.place.span;
                let text = format!("{com} {}", turned.join(" "));
                self.changes.push((span.start, span.end, text));
            }
            None => missing.push(format!("<pose>{com} 0 0 0</pose>")),
        }
        self.content(inertial, "mass", inertia.mass, &mut missing);
        match inertial.child("inertia") {
            Some(element) => {
                let mut missing = Vec::new();
                for ((name, _), value) in ENTRIES.into_iter().zip(tensor) {
                    self.content(element, name, value, &mut missing);
                }
                self.insert_all(element, &missing);
            }
            None => missing.push(format!("<inertia>{}</inertia>", texts(tensor))),
        }
        self.insert_all(inertial, &missing);
    }

    /// Writes those values of an axis' `<dynamics>` that are given.
    pub(crate) fn sdf_dynamics(&mut self, axis: &Element, values: &[(&str, Option<f64>)]) {
        let given = values
            .iter()
            .filter_map(|(tag, value)| Some((*tag, (*value)?)));
        let given: Vec<(&str, f64)> = given.collect();
        self.values += given.len();
        let mut missing = Vec::new();
        let dynamics = axis.child("dynamics");
        for (tag, value) in given {
            match dynamics {
                Some(element) => self.content(element, tag, value, &mut missing),
                None => missing.push(format!("<{tag}>{}</{tag}>", number(value))),
            }
        }
        match dynamics {
            Some(element) => self.insert_all(element, &missing),
            None if missing.is_empty() => {}
            None => self.insert(axis, &format!("<dynamics>{}</dynamics>", missing.concat())),
        }
    }

    /// Replaces the text of a child element; adds the element to `missing` if there is none.
    fn content(&mut self, element: &Element, tag: &str, value: f64, missing: &mut Vec<String>) {
        let value = number(value);
        match element.child(tag).map(Element::content) {
            Some(Some(text)) => {
                let span = text.place.span;
                self.changes.push((span.start, span.end, value));
            }
            // an empty element means its default
            Some(None) => {}
            None => missing.push(format!("<{tag}>{value}</{tag}>")),
        }
    }

    fn insert_all(&mut self, element: &Element, missing: &[String]) {
        if !missing.is_empty() {
            self.insert(element, &missing.concat());
        }
    }
}

fn texts(tensor: [f64; 6]) -> String {
    let entries = ENTRIES.iter().zip(tensor);
    let texts = entries.map(|((tag, _), value)| format!("<{tag}>{}</{tag}>", number(value)));
    texts.collect()
}
