//! Reads rotations in the five notations of MJCF.

use std::f64::consts::PI;

use super::Reading;
use crate::pose::{
    M3, Pose, UNIT, V3, about, cross, difference, dot, onto, product, scaled, transposed, unit,
};
use crate::xml::{Attribute, Element};

/// An element with the class of defaults it inherits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Classed<'e> {
    pub(super) element: &'e Element,
    pub(super) inherited: Option<&'e str>,
}

impl Reading<'_, '_, '_> {
    /// An attribute of the element, or else the default of its class.
    pub(super) fn attribute(&self, of: Classed<'_>, name: &str) -> Option<Attribute> {
        let found = self.defaults.attribute(of.element, of.inherited, name);
        found.cloned()
    }

    /// The pose given by `pos` and one of the orientation attributes.
    pub(super) fn pose(&mut self, of: Classed<'_>) -> Pose {
        let position = self.attribute(of, "pos");
        let p = position.and_then(|a| self.fields.position(&a));
        let p = p.unwrap_or_default();
        match self.orientation(of) {
            Some(r) if r != UNIT => Pose::new(p, r),
            _ => Pose::shift(p),
        }
    }

    /// The rotation of an element; `None` without one, or after an error.
    fn orientation(&mut self, of: Classed<'_>) -> Option<M3> {
        // attributes of the element take precedence over those of its class
        let own = ["quat", "axisangle", "euler", "xyaxes", "zaxis"]
            .into_iter()
            .find(|name| of.element.attribute(name).is_some());
        let by_class = || {
            ["quat", "axisangle", "euler", "xyaxes", "zaxis"]
                .into_iter()
                .find(|name| self.attribute(of, name).is_some())
        };
        let name = own.or_else(by_class)?;
        let attribute = self.attribute(of, name)?;
        let rotation = match name {
            "quat" => return self.fields.quaternion(&attribute),
            "axisangle" => {
                let [x, y, z, _] = self.fields.array::<4>(&attribute)?;
                let angle = self.last_angle(&attribute)?;
                unit([x, y, z]).map(|axis| about(axis, angle))
            }
            "euler" => {
                let angles = self.angles::<3>(&attribute)?;
                return Some(euler(angles, self.compiler.sequence));
            }
            "xyaxes" => {
                let [a, b, c, d, e, f] = self.fields.array::<6>(&attribute)?;
                from_axes([a, b, c], [d, e, f])
            }
            _ => {
                let z = self.fields.array::<3>(&attribute)?;
                unit(z).map(onto)
            }
        };
        if rotation.is_none() {
            let message = format!("{name} gives no direction");
            let hint = "write vectors that are neither zero nor parallel";
            self.fields.log.error(attribute.place, message, hint);
        }
        rotation
    }

    /// Angles in the file's unit, converted to rad.
    pub(super) fn angles<const N: usize>(&mut self, attribute: &Attribute) -> Option<[f64; N]> {
        if self.compiler.degrees {
            let degrees = self.fields.array::<N>(attribute)?;
            return Some(degrees.map(|a| a / 180.0 * PI));
        }
        self.fields.angles(attribute)
    }

    /// The angle of an `axisangle`, its fourth number, in rad.
    fn last_angle(&mut self, attribute: &Attribute) -> Option<f64> {
        let word = attribute.value.split_whitespace().last()?;
        let alone = Attribute {
            value: word.to_owned(),
            ..attribute.clone()
        };
        self.angles::<1>(&alone).map(|[angle]| angle)
    }
}

fn euler(angles: V3, sequence: [char; 3]) -> M3 {
    let mut r = UNIT;
    for (angle, axis) in angles.into_iter().zip(sequence) {
        let vector = match axis.to_ascii_lowercase() {
            'x' => [1.0, 0.0, 0.0],
            'y' => [0.0, 1.0, 0.0],
            _ => [0.0, 0.0, 1.0],
        };
        let turn = about(vector, angle);
        // small letters are axes that rotate along
        r = if axis.is_ascii_lowercase() {
            product(&r, &turn)
        } else {
            product(&turn, &r)
        };
    }
    r
}

/// The rotation with the given axes x and y, where y is made perpendicular to x.
fn from_axes(x: V3, y: V3) -> Option<M3> {
    let x = unit(x)?;
    let y = unit(difference(y, scaled(x, dot(x, y))))?;
    Some(transposed(&[x, y, cross(x, y)]))
}
