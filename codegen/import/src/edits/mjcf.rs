//! Identified values in an MJCF file: attributes of bodies' `<inertial>` and of joints.

use super::Edits;
use crate::number::number;
use crate::tree::Inertia;
use crate::xml::Element;

/// The attributes of `<inertial>` that `fullinertia` replaces: a tensor in the body's own axes needs
/// no orientation, and MuJoCo refuses both together.
const REPLACED: [&str; 6] = [
    "diaginertia",
    "quat",
    "axisangle",
    "xyaxes",
    "zaxis",
    "euler",
];

impl Edits {
    /// Writes a body's `<inertial>`, with the tensor in the body's axes.
    pub(crate) fn mjcf_inertia(&mut self, body: &Element, inertia: &Inertia) {
        let [xx, xy, xz, yy, yz, zz] = inertia.tensor;
        let fields = [
            ("pos", inertia.com.map(number).join(" ")),
            ("mass", number(inertia.mass)),
            (
                "fullinertia",
                [xx, yy, zz, xy, xz, yz].map(number).join(" "),
            ),
        ];
        self.values += 10;
        let Some(inertial) = body.child("inertial") else {
            let fields = fields.map(|(name, value)| format!("{name}=\"{value}\""));
            self.insert(body, &format!("<inertial {}/>", fields.join(" ")));
            return;
        };
        for (name, value) in fields {
            self.attribute(inertial, name, &value);
        }
        for name in REPLACED {
            self.remove(inertial, name);
        }
    }

    /// Writes those of a joint's attributes that are given.
    pub(crate) fn mjcf_joint(&mut self, joint: &Element, values: &[(&str, Option<f64>)]) {
        for (name, value) in values {
            if let Some(value) = value {
                self.attribute(joint, name, &number(*value));
                self.values += 1;
            }
        }
    }

    /// Removes an attribute, with the blanks before it.
    fn remove(&mut self, element: &Element, name: &str) {
        let Some(attribute) = element.attribute(name) else {
            return;
        };
        let value = attribute.place.span;
        let before = self.text.get(..value.start).unwrap_or_default();
        let Some(start) = before.rfind(name) else {
            return;
        };
        let blank = before.get(..start).unwrap_or_default().trim_end().len();
        self.changes.push((blank, value.end + 1, String::new()));
    }
}
