//! The limits that a trajectory keeps, each a number that is at most zero.

use core::fmt;

use super::{ExciteError, Settings};
use regen_runtime::{Info, Scalar};

/// What a limit is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// A coordinate's position.
    Position,
    /// A coordinate's velocity.
    Velocity,
    /// A coordinate's acceleration.
    Acceleration,
    /// An actuator's effort.
    Effort,
    /// The angle of a cone.
    SwingLimit,
    /// The distance from singularities.
    Singularity,
}

/// One limit: a quantity that may not pass a bound to one side.
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    /// What it is about.
    pub quantity: Quantity,
    /// The coordinate or the cone; empty for the distance from singularities.
    pub name: String,
    /// The bound: SI units, rad; an angle for cones.
    pub bound: f64,
    /// Whether the quantity may not be above the bound; otherwise not below.
    pub upper: bool,
    /// Which entry of the quantity.
    at: usize,
    /// What the limit is divided by: half the range.
    size: f64,
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let side = if self.upper { "at most" } else { "at least" };
        let Self { name, bound, .. } = self;
        match self.quantity {
            Quantity::Position => write!(f, "position of {name} {side} {bound}"),
            Quantity::Velocity => write!(f, "velocity of {name} {side} {bound}"),
            Quantity::Acceleration => write!(f, "acceleration of {name} {side} {bound}"),
            Quantity::Effort => write!(f, "effort of {name} {side} {bound}"),
            Quantity::SwingLimit => write!(f, "cone angle of {name} {side} {bound}"),
            Quantity::Singularity => {
                write!(
                    f,
                    "distance from singularities (pivot of A_e) {side} {bound}"
                )
            }
        }
    }
}

/// What limits look at in one state.
pub(super) struct LimitInputs<'a, T> {
    pub(super) q: &'a [T],
    pub(super) qd: &'a [T],
    pub(super) qdd: &'a [T],
    /// Of the actuators, in the order of `Info::actuated`.
    pub(super) efforts: &'a [T],
    /// Cosines.
    pub(super) cones: &'a [T],
    pub(super) pivot: T,
}

impl Limit {
    /// At most zero where the limit is kept; in units of half the range.
    pub(super) fn value<T: Scalar>(&self, seen: &LimitInputs<'_, T>) -> T {
        let entry = |values: &[T]| values.get(self.at).copied().unwrap_or(seen.pivot);
        let value = match self.quantity {
            Quantity::Position => entry(seen.q),
            Quantity::Velocity => entry(seen.qd),
            Quantity::Acceleration => entry(seen.qdd),
            Quantity::Effort => entry(seen.efforts),
            Quantity::Singularity => seen.pivot,
            Quantity::SwingLimit => {
                // the cosine is at least the bound's
                let cosine = entry(seen.cones);
                return (cosine.splat(libm::cos(self.bound)) - cosine) / cosine.splat(self.size);
            }
        };
        let beyond = value - value.splat(self.bound);
        let beyond = if self.upper { beyond } else { -beyond };
        beyond / value.splat(self.size)
    }
}

/// Every limit that is stated and can be checked.
pub(super) fn limits(
    info: &Info<'_>,
    settings: &Settings,
    efforts: bool,
) -> Result<Vec<Limit>, ExciteError> {
    let mut out = Vec::new();
    let name = |c: usize| info.coordinates.get(c).copied().unwrap_or("?");
    for (c, joint) in settings.limits.iter().enumerate() {
        let actuator = info.actuated.iter().position(|a| *a == c);
        let ranges = [
            (Quantity::Position, joint.position, Some(c)),
            (Quantity::Velocity, joint.velocity, Some(c)),
            (Quantity::Acceleration, joint.acceleration, Some(c)),
            (Quantity::Effort, joint.effort, actuator.filter(|_| efforts)),
        ];
        for (quantity, range, at) in ranges {
            let (Some([lowest, highest]), Some(at)) = (range, at) else {
                continue;
            };
            let size = 0.5 * (highest - lowest);
            if !(size > 0.0 && size.is_finite()) {
                return Err(ExciteError::Range {
                    what: format!("{quantity:?} of {}", name(c)).to_lowercase(),
                    range: [lowest, highest],
                });
            }
            for (bound, upper) in [(lowest, false), (highest, true)] {
                out.push(Limit {
                    quantity,
                    name: name(c).to_owned(),
                    bound,
                    upper,
                    at,
                    size,
                });
            }
        }
    }
    for (at, (cone, greatest)) in info.cones.iter().zip(&settings.cones).enumerate() {
        if !(*greatest > 0.0 && *greatest <= core::f64::consts::PI) {
            return Err(ExciteError::Range {
                what: format!("cone angle of {}", cone.name),
                range: [0.0, *greatest],
            });
        }
        out.push(Limit {
            quantity: Quantity::SwingLimit,
            name: cone.name.to_owned(),
            bound: *greatest,
            upper: true,
            at,
            size: 1.0 - libm::cos(*greatest),
        });
    }
    if !info.dependent.is_empty() {
        out.push(Limit {
            quantity: Quantity::Singularity,
            name: String::new(),
            bound: settings.singular_margin,
            upper: false,
            at: 0,
            size: 1.0,
        });
    }
    Ok(out)
}
