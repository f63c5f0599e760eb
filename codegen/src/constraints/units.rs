//! Units in which a mechanism's lengths are numbers near 1, so that what counts as closed or as
//! dependent does not depend on the units of the spec: metres, millimetres, or a mechanism that
//! is a millionth of a metre long.
//!
//! The unit is a power of 2^8. It changes no digit, and mechanisms between a sixteenth and sixteen
//! units of the spec stay as they are.

use crate::model::{Model, Step};

use super::rows::lengths_of;

/// Sizes up to this times the unit, or one over it, keep the unit.
const USUAL: f64 = 16.0;
const STEP: f64 = 256.0;
/// What is beyond so many steps is no length.
const MOST: usize = 120;

/// The units of coordinates and of closure rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Units {
    /// The unit of length, in the spec's.
    pub length: f64,
    /// By coordinate: `length` where it slides, 1 where it turns.
    pub coordinates: Vec<f64>,
    /// By row: cuts in the spec's order, then couplings.
    pub rows: Vec<f64>,
}

impl Units {
    /// From the longest offset and the longest slide at home.
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
        let homes = model.home.iter().zip(&slides);
        let homes = homes.filter(|h| *h.1).map(|h| h.0.to_f64());
        let size = offsets.chain(homes).fold(0.0_f64, |m, x| m.max(x.abs()));
        let length = coarse(size);
        let unit = |is_length: bool| if is_length { length } else { 1.0 };
        let cuts = model.cuts.iter().flat_map(|cut| lengths_of(cut.kind));
        let couplings = model.couplings.iter().map(|c| slides[c.key]);
        Units {
            length,
            rows: cuts.chain(couplings).map(unit).collect(),
            coordinates: slides.into_iter().map(unit).collect(),
        }
    }
}

/// The coarse power of two near a size; 1 for nothing.
fn coarse(size: f64) -> f64 {
    let mut unit = 1.0;
    if size > 0.0 && size.is_finite() {
        for _ in 0..MOST {
            if size > USUAL * unit {
                unit *= STEP;
            } else if size < unit / USUAL {
                unit /= STEP;
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
        // up to the bounds themselves, a sixteenth and sixteen
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
