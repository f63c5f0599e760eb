//! The limits of a trajectory, each as a number that is at most zero within the limit.

use core::fmt;

use super::{ExciteError, Settings};
use regen_runtime::Info;

/// The quantity that a limit bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// A coordinate's position.
    Position,
    /// A coordinate's velocity.
    Velocity,
    /// A coordinate's acceleration.
    Acceleration,
    /// The rate of a coordinate's acceleration.
    Jerk,
    /// An actuator's effort.
    Effort,
    /// The swing angle of a spherical or universal joint, or of a cut.
    SwingLimit,
    /// The distance from singularities: the pivot of A_e.
    Singularity,
}

/// One limit: a lower or upper bound of a quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    /// The bounded quantity.
    pub quantity: Quantity,
    /// The name of the coordinate or the swing limit; empty for the distance from singularities.
    pub name: String,
    /// The bound, in SI units and rad; an angle for swing limits.
    pub bound: f64,
    /// Whether this is an upper bound; otherwise it is a lower bound.
    pub upper: bool,
    /// The index of the coordinate, the actuated joint or the swing limit.
    at: usize,
    /// The divisor that makes values comparable: half the range between the limits.
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
            Quantity::Jerk => write!(f, "jerk of {name} {side} {bound}"),
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

impl Limit {
    /// A limit of a coordinate for tests.
    #[cfg(test)]
    pub(super) fn of(quantity: Quantity, name: &str, upper: bool) -> Self {
        Self {
            quantity,
            name: name.to_owned(),
            bound: 1.0,
            upper,
            at: 0,
            size: 1.0,
        }
    }

    /// The index of the coordinate, the actuated joint or the swing limit.
    pub(super) fn index(&self) -> usize {
        self.at
    }

    /// The excess over the limit in units of half its range, at most zero within the limit, for a
    /// value of the limited quantity; of swing limits, the cosine of the angle.
    pub(super) fn excess(&self, value: f64) -> f64 {
        if self.quantity == Quantity::SwingLimit {
            // within the limit the cosine of the angle is at least that of the bound
            return ((1.0 - self.size) - value) / self.size;
        }
        let beyond = value - self.bound;
        (if self.upper { beyond } else { -beyond }) / self.size
    }

    /// The derivative of the excess, for that of the limited quantity.
    pub(super) fn rate(&self, rate: f64) -> f64 {
        let rises = self.upper && self.quantity != Quantity::SwingLimit;
        (if rises { rate } else { -rate }) / self.size
    }
}

/// All limits of the settings that can be checked; limits of efforts only if `efforts` is set.
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
            (Quantity::Jerk, joint.jerk, Some(c)),
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
