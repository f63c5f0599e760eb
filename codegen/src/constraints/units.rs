//! Units in which a mechanism's lengths are numbers near 1, so that the tolerances of closure and
//! rank do not depend on the units of the spec: metres, millimetres, or a mechanism that is a
//! millionth of a metre long.
//!
//! The unit is a power of 2^8: scaling by it changes no digit. Mechanisms between a sixteenth and
//! sixteen of the spec's units are not scaled.

use crate::model::{Model, Step};

use super::rows::lengths_of;

/// A unit fits sizes from its sixteenth (1/16) to sixteen times the unit.
const MAX_SIZE_IN_UNITS: f64 = 16.0;
/// Ratio of neighbouring units: a power of two, so that scaling changes no digit.
const UNIT_RATIO: f64 = 256.0;
/// Largest number of steps to the unit; a size beyond them is not a length.
const MAX_UNIT_STEPS: usize = 120;

/// The units of coordinates and of closure rows, as multiples of the spec's units.
#[derive(Clone, Debug, PartialEq)]
pub struct Units {
    /// The unit of length.
    pub length: f64,
    /// By coordinate: `length` for a translation, 1 for a rotation, and for a drive a unit near the
    /// distance that it covers where its joints move by theirs.
    pub coordinates: Vec<f64>,
    /// By row (cuts in the spec's order, then couplings): `length` for a length, else 1; that of
    /// its coordinate for a drive.
    pub rows: Vec<f64>,
}

impl Units {
    /// Chooses the unit by the longest offset and the longest translation at home.
    pub fn of(model: &Model) -> Units {
        let slides: Vec<bool> = (0..model.coordinates.len())
            .map(|c| model.slides(c))
            .collect();
        let placements = model.links.iter().map(|l| &l.placement);
        let sides = model.cuts.iter().flat_map(|c| &c.sides);
        let steps = placements.chain(sides.map(|s| &s.placement)).flatten();
        let offsets = steps.filter_map(|step| match step {
            Step::Translate(_, quantity) => Some(quantity.value.to_f64()),
            Step::Rotate(..) => None,
        });
        let homes = (0..slides.len()).filter(|c| slides[*c] && !model.drives.contains(c));
        let homes = homes.map(|c| model.home[c].to_f64());
        let size = offsets.chain(homes).fold(0.0_f64, |m, x| m.max(x.abs()));
        let length = coarse(size);
        let unit = |is_length: bool| if is_length { length } else { 1.0 };
        let mut coordinates: Vec<f64> = slides.into_iter().map(unit).collect();
        for &drive in &model.drives {
            coordinates[drive] = coarse(model.reach(drive, 1.0, length));
        }
        let cuts = model.cuts.iter().flat_map(|cut| lengths_of(cut.kind));
        let couplings = model.couplings.iter().map(|c| coordinates[c.key]);
        Units {
            length,
            rows: cuts.map(unit).chain(couplings).collect(),
            coordinates,
        }
    }
}

/// The power of 2^8 that fits a size; 1 for zero and for values that are not finite.
fn coarse(size: f64) -> f64 {
    let mut unit = 1.0;
    if size > 0.0 && size.is_finite() {
        for _ in 0..MAX_UNIT_STEPS {
            if size > MAX_SIZE_IN_UNITS * unit {
                unit *= UNIT_RATIO;
            } else if size < unit / MAX_SIZE_IN_UNITS {
                unit /= UNIT_RATIO;
            }
        }
    }
    unit
}

#[cfg(test)]
mod tests {
    #![allow(clippy::float_cmp, reason = "powers of two")]
    use super::*;

    #[test]
    fn usual_sizes_stay_as_they_are_and_others_end_within_sixteen_of_their_unit() {
        // the bounds of a sixteenth and sixteen are included
        for size in [
            0.0625,
            0.07,
            0.4563,
            1.0,
            15.0,
            16.0,
            0.0,
            f64::NAN,
            f64::INFINITY,
        ] {
            assert_eq!(coarse(size), 1.0, "{size}");
        }
        for size in [1e-9, 4e-5, 0.01, 456.3, 1e6, 3e11, 1e-200, 1e200] {
            let part = size / coarse(size);
            assert!((1.0 / 16.0..=16.0).contains(&part), "{size} {part}");
        }
    }
}
