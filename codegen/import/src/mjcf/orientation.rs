//! Reads rotations in the five notations of MJCF.

use std::f64::consts::PI;

use super::Reading;
use crate::pose::{
    M3, Pose, ROUNDING_TOLERANCE, UNIT, V3, about, cross, difference, dot, from_quaternion, onto,
    product, scaled, transposed, unit,
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
            "quat" => return self.quaternion(&attribute),
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

    fn quaternion(&mut self, attribute: &Attribute) -> Option<M3> {
        let q = self.fields.array::<4>(attribute)?;
        let Some(r) = from_quaternion(q) else {
            let hint = "write w x y z of a rotation";
            let message = "a quaternion of length zero";
            self.fields.log.error(attribute.place, message, hint);
            return None;
        };
        let meant = printed_rotation(&r, q, &attribute.value);
        let Some((meant, words)) = meant.filter(|_| !self.fields.exact) else {
            return Some(r);
        };
        if !crate::pose::same_rotation(&meant, &r) {
            let item = format!("'{}'", attribute.value.trim());
            let text = format!("took {{}} as {words}");
            self.fields.log.note_digits(attribute.place, text, &item);
        }
        Some(meant)
    }
}

/// The exact rotation that a quaternion with few digits stands for: about a coordinate axis by a
/// multiple of pi/12, or one that maps coordinate axes to coordinate axes.
fn printed_rotation(r: &M3, q: [f64; 4], text: &str) -> Option<(M3, String)> {
    let decimals = text
        .split_whitespace()
        .map(|w| w.split_once('.').map_or(0, |(_, f)| f.len()))
        .max()?;
    // a quaternion whose norm is far from 1 is not a rounded unit quaternion
    let rounded =
        (4..12).contains(&decimals) && (q.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-2;
    let unit_in_last = libm::pow(10.0, -f64::from(i32::try_from(decimals).ok()?));
    let tolerance = if rounded {
        6.0 * unit_in_last
    } else {
        ROUNDING_TOLERANCE
    };
    let [w, x, y, z] = q;
    let axes = [
        ([1.0, 0.0, 0.0], x, [y, z], "x"),
        ([0.0, 1.0, 0.0], y, [x, z], "y"),
        ([0.0, 0.0, 1.0], z, [x, y], "z"),
    ];
    for (axis, part, others, name) in axes {
        if others != [0.0; 2] {
            continue;
        }
        let angle = 2.0 * libm::atan2(part, w);
        let multiple = libm::round(angle * 12.0 / PI) * PI / 12.0;
        if (angle - multiple).abs() <= tolerance {
            let words = format!("a turn of {} about {name}", crate::number::angle(multiple));
            return Some((about(axis, multiple), words));
        }
    }
    let nearest = r.map(|row| row.map(libm::round));
    let near = r.iter().flatten().zip(nearest.iter().flatten());
    let near = near.into_iter().all(|(a, b)| (a - b).abs() <= tolerance);
    let is_rotation = product(&nearest, &transposed(&nearest)) == UNIT;
    (near && is_rotation).then(|| (nearest, "a turn of axes onto axes".to_owned()))
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
