//! Units in which a mechanism's lengths, its gravity and the rates of its independent coordinates
//! are numbers near 1, so that the distinction between rounding and other numbers does not depend
//! on the units of the spec.
//!
//! Units are powers of 2^8: scaling by them changes no digit, and mechanisms of the usual size are
//! sampled in metres and seconds as they are. The units are computed before anything is sampled, or
//! from rates one of which is 1: a column or row that is zero up to rounding is never scaled up.

use crate::model::{FrictionColumn, Model, ParameterKind, SpringPart, Step};

use super::float320::Float320;

/// Exponents of the units are multiples of this.
const EXPONENT_STEP: f64 = 8.0;
/// Bound on the magnitude of the exponents; no real length or gravity needs more.
const MAX_EXPONENT: f64 = 4096.0;

/// Units as exponents of powers of two.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Units {
    /// Exponent of the unit of length, m.
    pub(super) length: i32,
    /// Exponent of the unit of gravity over length, 1/s^2: the inverse square of the unit of time.
    pub(super) time: i32,
}

/// Exponent of the coarse power of two near a magnitude; 0 for 0.
fn coarse(size: &Float320) -> i32 {
    if size.is_zero() {
        return 0;
    }
    let binary = size.log10() / core::f64::consts::LOG10_2;
    let steps = libm::round(binary / EXPONENT_STEP) * EXPONENT_STEP;
    steps.clamp(-MAX_EXPONENT, MAX_EXPONENT) as i32
}

fn largest(values: impl Iterator<Item = Float320>) -> Float320 {
    values.fold(Float320::ZERO, |m, x| m.max(x.abs()))
}

impl Units {
    /// Units of a mechanism, from its gravity and its greatest length: an offset, a coordinate of a
    /// spring's point, or a prismatic coordinate at home.
    pub(super) fn of(model: &Model, home: &[f64]) -> Units {
        let placements = model.links.iter().map(|l| &l.placement);
        let sides = model.cuts.iter().flat_map(|c| &c.sides);
        let steps = placements.chain(sides.map(|s| &s.placement)).flatten();
        let offsets = steps.filter_map(|step| match step {
            Step::Translate(_, quantity) => Some(Float320::from_number(&quantity.value)),
            Step::Rotate(..) => None,
        });
        let points = model.point_springs.iter().flat_map(|spring| &spring.ends);
        let points = points.flat_map(|end| &end.point);
        let points = points.map(|quantity| Float320::from_number(&quantity.value).abs());
        let slides = home.iter().enumerate().filter(|(c, _)| model.slides(*c));
        let slides = slides.map(|(_, q)| Float320::from_f64(*q));
        let length = coarse(&largest(offsets.chain(slides).chain(points)));
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

    /// The exponent of the factor for a parameter's column: the inverse of the parameter's factor
    /// in an energy. `slides` says whether a coordinate is prismatic.
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
            // the factor of an effort term may have any unit; it counts as a number
            ParameterKind::Offset { coordinate } | ParameterKind::EffortTerm { coordinate, .. } => {
                let length = if slides(coordinate) { -self.length } else { 0 };
                length + self.time
            }
            ParameterKind::JointSpring { coordinate, .. } => {
                let length = if slides(coordinate) { -self.length } else { 0 };
                2 * length + self.time
            }
            ParameterKind::PointSpring { part, .. } => match part {
                SpringPart::Stiffness => -2 * self.length + self.time,
                SpringPart::Preload | SpringPart::Pull => -self.length + self.time,
            },
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

    /// Exponent of the unit for the rate of an independent coordinate. `rates` are the rates of all
    /// coordinates for a unit rate of that coordinate, each with whether its coordinate is
    /// prismatic (the rate is then in m). The largest rate is never mere rounding, since that of
    /// the coordinate itself is 1.
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
