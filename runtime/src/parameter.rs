//! Dynamic parameters by what they are: the one place where labels are read and printed.

use core::fmt;

use crate::{Friction, Motion};

/// The symbols of a body's ten parameters, in their order: inertia about the origin of the body's
/// frame, first moments, mass.
pub const INERTIAL: [&str; 10] = [
    "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "mx", "my", "mz", "m",
];
/// The symbol of the inertia of a rotor and its drive (Eq. 18).
const ROTOR: &str = "J";

/// What a parameter is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Symbol<'a> {
    /// One of the ten of a body, by its place in [`INERTIAL`].
    Inertial(usize),
    /// A coefficient of a joint's friction, by its symbol in [`Friction::symbols`] or
    /// [`Friction::coefficients`].
    Friction(&'a str),
    /// The inertia of a rotor and its drive (Eq. 18).
    Rotor,
}

/// A dynamic parameter: what it is, and of which body or coordinate.
///
/// ```
/// use regen_runtime::{Motion, Parameter, Symbol};
///
/// let friction = Parameter::read("Fc+(q2)").ok_or("a label")?;
/// assert_eq!(friction.owner, "q2");
/// assert_eq!(friction.symbol, Symbol::Friction("Fc+"));
/// assert_eq!(friction.unit(Some(Motion::Rotation)), "N m");
/// assert_eq!(friction.to_string(), "Fc+(q2)");
/// assert_eq!(Parameter::read("Q(1)"), None);
/// # Ok::<(), &str>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Parameter<'a> {
    /// What it is.
    pub symbol: Symbol<'a>,
    /// The label of the body, or the name of the coordinate.
    pub owner: &'a str,
}

impl<'a> Parameter<'a> {
    /// The parameter that a label such as `Ixx(3)`, `Fc+(q2)` or `J(q2)` stands for.
    pub fn read(label: &'a str) -> Option<Self> {
        let (symbol, owner) = label.strip_suffix(')')?.split_once('(')?;
        let symbol = if let Some(place) = INERTIAL.iter().position(|s| *s == symbol) {
            Symbol::Inertial(place)
        } else if symbol == ROTOR {
            Symbol::Rotor
        } else {
            let known = |law: &Friction| {
                law.symbols().contains(&symbol) || law.coefficients().contains(&symbol)
            };
            Friction::ALL
                .iter()
                .any(known)
                .then_some(Symbol::Friction(symbol))?
        };
        Some(Self { symbol, owner })
    }

    /// The symbol as labels print it.
    pub fn name(&self) -> &'a str {
        match self.symbol {
            Symbol::Inertial(place) => INERTIAL.get(place).copied().unwrap_or_default(),
            Symbol::Friction(symbol) => symbol,
            Symbol::Rotor => ROTOR,
        }
    }

    /// Whether it is of a body.
    pub fn is_inertial(&self) -> bool {
        matches!(self.symbol, Symbol::Inertial(_))
    }

    /// Whether it is of a joint's friction.
    pub fn is_friction(&self) -> bool {
        matches!(self.symbol, Symbol::Friction(_))
    }

    /// Its SI unit. That of a joint's parameter depends on how the joint moves, and is `SI` where
    /// this is not known.
    pub fn unit(&self, motion: Option<Motion>) -> &'static str {
        let by = |turn, shift| match motion {
            Some(Motion::Rotation) => turn,
            Some(Motion::Translation) => shift,
            None => "SI",
        };
        match self.symbol {
            Symbol::Inertial(0..=5) => "kg m^2",
            Symbol::Inertial(6..=8) => "kg m",
            Symbol::Inertial(_) => "kg",
            Symbol::Rotor => by("kg m^2", "kg"),
            Symbol::Friction(symbol) if symbol.starts_with("Fv") => by("N m s/rad", "N s/m"),
            Symbol::Friction(symbol) if symbol.starts_with('F') => by("N m", "N"),
            Symbol::Friction(_) => "SI",
        }
    }
}

impl fmt::Display for Parameter<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}({})", self.name(), self.owner)
    }
}
