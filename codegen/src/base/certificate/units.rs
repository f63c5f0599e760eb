//! Units in which a mechanism's lengths, its gravity and the rates of its
//! independent coordinates are numbers near 1, so that what is rounding and what
//! is not does not depend on the units of the spec.
//!
//! Units are powers of 2^8: they change no digit, and mechanisms of the usual
//! size are sampled in metres and seconds as they are. They are known before
//! anything is sampled, or taken from rates one of which is 1: a column or row
//! that is zero up to rounding is never scaled up to something.

use crate::model::{FrictionColumn, Model, ParameterKind, Step};

use super::float320::Float320;

/// Exponents are multiples of this.
const COARSE: f64 = 8.0;
/// Exponents stay within this: what is beyond is no length.
const LARGEST: f64 = 4096.0;

/// Units as powers of two.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Units {
    /// Of lengths, m.
    pub(super) length: i32,
    /// Of gravity over lengths, 1/s^2: the square of the unit of time, inverted.
    pub(super) time: i32,
}

/// The coarse power of two near a size, 0 for nothing.
fn coarse(size: &Float320) -> i32 {
    if size.is_zero() {
        return 0;
    }
    let binary = size.log10() / core::f64::consts::LOG10_2;
    let steps = libm::round(binary / COARSE) * COARSE;
    steps.clamp(-LARGEST, LARGEST) as i32
}

fn largest(values: impl Iterator<Item = Float320>) -> Float320 {
    values.fold(Float320::ZERO, |m, x| m.max(x.abs()))
}

impl Units {
    /// The units of a mechanism: its longest offset, and gravity.
    pub(super) fn of(model: &Model, home: &[f64]) -> Units {
        let placements = model.links.iter().map(|l| &l.placement);
        let sides = model.cuts.iter().flat_map(|c| &c.sides);
        let steps = placements.chain(sides.map(|s| &s.placement)).flatten();
        let offsets = steps.filter_map(|step| match step {
            Step::Translate(_, quantity) => Some(Float320::from_number(&quantity.value)),
            Step::Rotate(..) => None,
        });
        let slides = home.iter().enumerate().filter(|(c, _)| model.slides(*c));
        let slides = slides.map(|(_, q)| Float320::from_f64(*q));
        let length = coarse(&largest(offsets.chain(slides)));
        let gravity = largest(
            model
                .gravity
                .iter()
                .map(|q| Float320::from_number(&q.value)),
        );
        Units {
            length,
            time: if gravity.is_zero() {
                0
            } else {
                coarse(&gravity.scaled(-length))
            },
        }
    }

    /// The unit of length in m.
    pub(super) fn metres(self) -> f64 {
        libm::ldexp(1.0, self.length)
    }

    /// The power of two that a parameter's column is multiplied by: 1 over its
    /// unit's share in an energy. `slides` tells of a coordinate.
    pub(super) fn column(self, kind: ParameterKind, slides: impl Fn(usize) -> bool) -> i32 {
        match kind {
            ParameterKind::Inertial { entry, .. } => match entry {
                0..6 => 0,
                6..9 => -self.length,
                _ => -2 * self.length,
            },
            ParameterKind::Rotor { coordinate } => {
                if slides(coordinate) {
                    -2 * self.length
                } else {
                    0
                }
            }
            ParameterKind::Friction { coordinate, column } => {
                let length = if slides(coordinate) { -self.length } else { 0 };
                match column {
                    FrictionColumn::Viscous
                    | FrictionColumn::ViscousPositive
                    | FrictionColumn::ViscousNegative => 2 * length,
                    FrictionColumn::Coulomb
                    | FrictionColumn::CoulombPositive
                    | FrictionColumn::CoulombNegative => length + self.time,
                }
            }
        }
    }

    /// The unit for the rate of an independent coordinate, from the rates of all
    /// coordinates with it (turns, and slides in m): the largest is not rounding,
    /// since its own is 1.
    pub(super) fn rate(self, rates: impl Iterator<Item = (bool, Float320)>) -> i32 {
        let lengths = rates.map(|(slides, rate)| {
            if slides {
                rate.scaled(-self.length)
            } else {
                rate
            }
        });
        coarse(&largest(lengths))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_sizes_stay_in_metres_and_seconds() {
        for size in [0.1, 0.4563, 1.0, 9.81, 15.0] {
            assert_eq!(coarse(&Float320::from_f64(size)), 0, "{size}");
        }
        assert_eq!(coarse(&Float320::ZERO), 0);
        assert_eq!(coarse(&Float320::from_f64(1e-6)), -16);
        assert_eq!(coarse(&Float320::from_f64(1e200)), 664);
    }
}
