//! Parsing of attribute values, with errors at the attribute.

use std::f64::consts::PI;

use crate::log::Log;
use crate::number::printed_multiple;
use crate::pose::{
    M3, ROUNDING_TOLERANCE, UNIT, V3, about, from_quaternion, product, same_rotation, transposed,
};
use crate::xml::Attribute;

/// Parses values, and decides whether angles keep their printed digits.
#[derive(Debug)]
pub(crate) struct Fields<'a> {
    pub(crate) log: &'a mut Log,
    /// Whether numbers keep their printed digits.
    pub(crate) exact: bool,
}

impl Fields<'_> {
    /// The numbers of an attribute, of any count.
    pub(crate) fn numbers(&mut self, attribute: &Attribute) -> Option<Vec<f64>> {
        let mut numbers = Vec::new();
        for word in attribute.value.split_whitespace() {
            match word.parse::<f64>() {
                Ok(number) if number.is_finite() => numbers.push(number),
                _ => {
                    let message = format!("{}: '{word}' is not a finite number", attribute.name);
                    let hint = "write decimal numbers, separated by blanks";
                    self.log.error(attribute.place, message, hint);
                    return None;
                }
            }
        }
        Some(numbers)
    }

    /// Exactly `N` numbers.
    pub(crate) fn array<const N: usize>(&mut self, attribute: &Attribute) -> Option<[f64; N]> {
        let numbers = self.numbers(attribute)?;
        let count = numbers.len();
        let array = numbers.try_into().ok();
        if array.is_none() {
            let message = format!("{} has {count} numbers, not {N}", attribute.name);
            let hint = format!("{N} decimal numbers stand here, separated by blanks");
            self.log.error(attribute.place, message, &hint);
        }
        array
    }

    pub(crate) fn number(&mut self, attribute: &Attribute) -> Option<f64> {
        self.array::<1>(attribute).map(|[x]| x)
    }

    /// Exactly `N` angles in rad. A printed multiple of pi is replaced by its exact value, unless
    /// `exact` is set.
    pub(crate) fn angles<const N: usize>(&mut self, attribute: &Attribute) -> Option<[f64; N]> {
        let mut angles = self.array::<N>(attribute)?;
        if self.exact {
            return Some(angles);
        }
        let words = attribute.value.split_whitespace();
        for (angle, word) in angles.iter_mut().zip(words) {
            if let Some(multiple) = printed_multiple(word) {
                if (multiple - *angle).abs() > crate::pose::ROUNDING_TOLERANCE {
                    let text = format!("took {{}} as {}", crate::number::angle(multiple));
                    self.log.note_digits(attribute.place, text, word);
                }
                *angle = multiple;
            } else if let Some(off) = off_a_right_angle(*angle) {
                let text = format!(
                    "{{}} is {off:.0e} rad off a right angle, and stays: axes that are \
                             nearly parallel have badly determined parameters"
                );
                self.log.note_of(attribute.place, text, word);
            }
        }
        Some(angles)
    }

    /// A position. Components that are negligible compared with its length are rounding errors of
    /// the tool that wrote the file, and become 0 unless `exact` is set.
    pub(crate) fn position(&mut self, attribute: &Attribute) -> Option<V3> {
        /// Components below this fraction of the length are negligible: nobody intends or could
        /// manufacture them.
        const NEGLIGIBLE_FRACTION: f64 = 1e-9;
        let position = self.array::<3>(attribute)?;
        if self.exact {
            return Some(position);
        }
        let size = crate::pose::norm(position);
        let cleared = position.map(|x| {
            if x.abs() < NEGLIGIBLE_FRACTION * size {
                0.0
            } else {
                x
            }
        });
        if cleared != position {
            let pairs = position.iter().zip(&cleared);
            for (x, _) in pairs.filter(|(x, y)| x != y) {
                let item = format!("{x:e}");
                self.log.note_digits(attribute.place, "took {} as 0", &item);
            }
        }
        Some(cleared)
    }

    /// A direction as a unit vector.
    pub(crate) fn direction(&mut self, attribute: &Attribute) -> Option<V3> {
        let vector = self.array::<3>(attribute)?;
        let unit = crate::pose::unit(vector);
        if unit.is_none() {
            let message = format!("{} has no direction", attribute.name);
            self.log
                .error(attribute.place, message, "write a vector that is not zero");
        }
        unit
    }

    /// The rotation of a quaternion w, x, y, z. Few digits stand for the exact rotation, unless `exact` is set.
    pub(crate) fn quaternion(&mut self, attribute: &Attribute) -> Option<M3> {
        let q = self.array::<4>(attribute)?;
        let Some(r) = from_quaternion(q) else {
            let hint = "write w x y z of a rotation";
            let message = "a quaternion of length zero";
            self.log.error(attribute.place, message, hint);
            return None;
        };
        let meant = printed_rotation(&r, q, &attribute.value);
        let Some((meant, words)) = meant.filter(|_| !self.exact) else {
            return Some(r);
        };
        if !same_rotation(&meant, &r) {
            let item = format!("'{}'", attribute.value.trim());
            let text = format!("took {{}} as {words}");
            self.log.note_digits(attribute.place, text, &item);
        }
        Some(meant)
    }
}

/// How far an angle is from the next multiple of a right angle, if it is close to one but 0, rad.
fn off_a_right_angle(angle: f64) -> Option<f64> {
    /// The largest distance that is more often a careless digit than meant, rad.
    const CLOSE_RAD: f64 = 1e-3;
    let quarter = std::f64::consts::FRAC_PI_2;
    let turns = libm::round(angle / quarter);
    let off = (angle - turns * quarter).abs();
    (turns != 0.0 && off > 0.0 && off < CLOSE_RAD).then_some(off)
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
