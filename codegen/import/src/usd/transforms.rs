//! Where prims stand: the operations of a prim in their order, and scales of what is within it.

use crate::log::Place;
use crate::pose::{M3, Pose, UNIT, V3, about, from_quaternion, norm, product, scaled, transposed};
use crate::xml::{Attribute, Element};

use super::{Drawn, Reading};

/// Components below this part of a vector's length are rounding errors of single precision.
const SINGLE: f64 = 2.4e-7;

impl Reading<'_, '_, '_> {
    /// A point or a direction; components that are rounding errors of single precision become 0.
    pub(super) fn vector(&mut self, attribute: &Attribute) -> Option<V3> {
        let vector = self.fields.array::<3>(attribute)?;
        Some(self.cleared(vector, attribute.place))
    }

    fn cleared<const N: usize>(&mut self, numbers: [f64; N], place: Place) -> [f64; N] {
        let size = libm::sqrt(numbers.iter().map(|x| x * x).sum());
        numbers.map(|x| {
            let is_small = x.abs() < SINGLE * size && x != 0.0 && !self.fields.exact;
            if is_small {
                let item = format!("{x:e}");
                self.fields.log.note_digits(place, "took {} as 0", &item);
            }
            if is_small { 0.0 } else { x }
        })
    }

    /// A rotation as a quaternion w, x, y, z of single precision.
    pub(super) fn quaternion(&mut self, attribute: &Attribute) -> Option<M3> {
        let numbers = self.fields.array::<4>(attribute)?;
        let kept = self.cleared(numbers, attribute.place);
        let words = attribute.value.split_whitespace().zip(&kept);
        let words: Vec<&str> = words
            .map(|(word, x)| if *x == 0.0 { "0" } else { word })
            .collect();
        let own = Attribute {
            value: words.join(" "),
            ..attribute.clone()
        };
        self.fields.quaternion(&own)
    }

    /// Where a prim stands, within another one.
    pub(super) fn placed(&mut self, element: &Element, around: Drawn) -> Drawn {
        let mut drawn = around;
        let order = element.text("xformOpOrder").unwrap_or_default().to_owned();
        for name in order.split_whitespace() {
            if name == "!resetXformStack!" {
                drawn = Drawn {
                    world: Pose::default(),
                    scale: [1.0; 3],
                    is_sheared: false,
                    ..around
                };
                continue;
            }
            let (name, is_inverted) = match name.strip_prefix("!invert!") {
                Some(name) => (name, true),
                None => (name, false),
            };
            let Some(attribute) = element.attribute(name) else {
                let message = format!("xformOpOrder names {name}, which the prim does not have");
                let hint = "write it, or take it out of the order";
                self.fields.log.error(element.place, message, hint);
                continue;
            };
            let kind = name.split(':').nth(1).unwrap_or_default();
            let Some((pose, scale)) = self.operation(kind, attribute) else {
                continue;
            };
            let pose = if is_inverted { pose.inverse() } else { pose };
            let scale = scale.map(|s| if is_inverted { 1.0 / s } else { s });
            let scaled = |all: V3| [0, 1, 2].map(|k| all[k] * scale[k]);
            // of an operation that moves and scales, the inverse scales first
            if is_inverted {
                drawn.scale = scaled(drawn.scale);
            }
            let at = [0, 1, 2].map(|k| pose.p[k] * drawn.scale[k] * self.meter);
            let is_uniform = drawn.scale.iter().all(|s| *s == drawn.scale[0]);
            drawn.is_sheared |= pose.r != UNIT && !is_uniform || scale.iter().any(|s| *s <= 0.0);
            drawn.world = drawn.world.then(&Pose::shift(at));
            if pose.r != UNIT {
                drawn.world = drawn.world.then(&Pose::turn(pose.r));
            }
            if !is_inverted {
                drawn.scale = scaled(drawn.scale);
            }
        }
        drawn
    }

    /// One of the operations, as a pose and a scale, in the units of the file.
    fn operation(&mut self, kind: &str, attribute: &Attribute) -> Option<(Pose, V3)> {
        let one = [1.0; 3];
        let axis = |letter: char| match letter {
            'X' => [1.0, 0.0, 0.0],
            'Y' => [0.0, 1.0, 0.0],
            _ => [0.0, 0.0, 1.0],
        };
        match kind {
            "translate" => Some((Pose::shift(self.vector(attribute)?), one)),
            "scale" => Some((Pose::default(), self.fields.array(attribute)?)),
            "orient" => Some((Pose::turn(self.quaternion(attribute)?), one)),
            "transform" => self.matrix(attribute),
            _ => {
                let letters: Vec<char> = kind
                    .strip_prefix("rotate")
                    .unwrap_or_default()
                    .chars()
                    .collect();
                let angles = self.fields.numbers(attribute)?;
                let is_one = matches!(letters.as_slice(), ['X' | 'Y' | 'Z']);
                let is_order = letters.len() == 3 && "XYZ".chars().all(|c| letters.contains(&c));
                if !(is_one || is_order) || angles.len() != letters.len() {
                    let message = format!("{} is not known here", attribute.name);
                    let hint =
                        "poses are given by translate, orient, rotateXYZ, scale or transform";
                    self.fields.log.error(attribute.place, message, hint);
                    return None;
                }
                let mut r = UNIT;
                // the first letter turns first; angles are those of x, y and z
                for letter in letters {
                    let k = if angles.len() == 1 {
                        0
                    } else {
                        "XYZ".find(letter).unwrap_or(0)
                    };
                    let angle = angles.get(k).copied().unwrap_or(0.0).to_radians();
                    r = product(&about(axis(letter), angle), &r);
                }
                Some((Pose::turn(r), one))
            }
        }
    }

    /// A matrix by which rows are multiplied, with the translation in its last row.
    fn matrix(&mut self, attribute: &Attribute) -> Option<(Pose, V3)> {
        let m = self.fields.array::<16>(attribute)?;
        let rows = [0, 4, 8].map(|k| [m[k], m[k + 1], m[k + 2]]);
        let scale = rows.map(norm);
        let unit = [0, 1, 2].map(|k| scaled(rows[k], 1.0 / scale[k]));
        let r = transposed(&unit);
        let p = [m[12], m[13], m[14]];
        let off = product(&unit, &r);
        let off = off.iter().flatten().zip(UNIT.iter().flatten());
        // rows of single precision
        let is_rotation = off.into_iter().all(|(a, b)| (a - b).abs() < 1e-5);
        let is_right = crate::pose::dot(crate::pose::cross(unit[0], unit[1]), unit[2]) > 0.0;
        if !(is_rotation && is_right) {
            let message = format!("{} is no rotation with a scale", attribute.name);
            let hint = "write it as translate, orient and scale";
            self.fields.log.error(attribute.place, message, hint);
            return None;
        }
        // exactly a rotation, by way of its quaternion
        let r = if r == UNIT {
            Some(r)
        } else {
            from_quaternion(crate::isaac::quaternion(&r))
        };
        Some((Pose::new(p, r?), scale))
    }
}
