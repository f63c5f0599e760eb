//! Dynamic parameters by symbol and owner: the one place where labels are read and printed.

use core::fmt;

use crate::{Motion, friction};

/// The symbols of a body's ten inertial parameters in labels, in the order of [`Symbol::INERTIAL`].
pub const INERTIAL: [&str; 10] = [
    "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "mx", "my", "mz", "m",
];
/// The symbol of the inertia of a rotor and its drive (Eq. 18).
const ROTOR: &str = "J";
/// The symbol of the constant effort of a joint.
const OFFSET: &str = "Fo";
/// The symbols of springs: at a joint, then of those between points.
const SPRINGS: [&str; 4] = ["K", "k", "kl", "f"];

/// The kind of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Symbol<'a> {
    /// Moment of inertia of a body about the x axis of its frame.
    Ixx,
    /// Product of inertia of a body about the origin of its frame.
    Ixy,
    /// Product of inertia of a body about the origin of its frame.
    Ixz,
    /// Moment of inertia of a body about the y axis of its frame.
    Iyy,
    /// Product of inertia of a body about the origin of its frame.
    Iyz,
    /// Moment of inertia of a body about the z axis of its frame.
    Izz,
    /// First moment of a body: its mass times x of its centre of mass.
    Mx,
    /// First moment of a body: its mass times y of its centre of mass.
    My,
    /// First moment of a body: its mass times z of its centre of mass.
    Mz,
    /// Mass of a body.
    Mass,
    /// A coefficient of a joint's friction, by its symbol in [`Friction::symbols`](crate::Friction::symbols) or
    /// [`Friction::coefficients`](crate::Friction::coefficients).
    Friction(&'static str),
    /// A constant effort of a joint, of its amplifier, sensor or cable. It is there at rest too, and
    /// dissipates nothing.
    Offset,
    /// The inertia of a rotor and its drive (Eq. 18).
    Rotor,
    /// The stiffness of a spring at a joint.
    Stiffness,
    /// The coefficient of an effort term of a joint, by the name that the spec gives it.
    Term(&'a str),
    /// The stiffness of a spring between two points, N/m.
    SpringStiffness,
    /// Stiffness times relaxed length of a spring between two points, N.
    SpringPreload,
    /// The constant pull between two points, N; negative where it pushes.
    SpringPull,
}

/// The values that a parameter of a physical robot can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Sign {
    /// Zero or above: masses, moments of inertia, rotors, and friction, which takes energy out.
    Nonnegative,
    /// Both signs: first moments, products of inertia, offsets, effort terms and constant pulls.
    Any,
}

/// A dynamic parameter: its kind, and the body or coordinate that it belongs to. It prints as its
/// label.
///
/// ```
/// use regen_runtime::{Motion, Parameter, Sign, Symbol};
///
/// const MOMENT: Parameter<'static> = Parameter::new(Symbol::Mx, "3");
/// assert_eq!(MOMENT.to_string(), "mx(3)");
/// assert_eq!(MOMENT, *"mx(3)");
/// assert_eq!(MOMENT.sign(), Sign::Any);
///
/// let friction = Parameter::read("Fc+(q2)").ok_or("a label")?;
/// assert_eq!(friction, Parameter::new(Symbol::Friction("Fc+"), "q2"));
/// assert_eq!(friction.unit(Some(Motion::Rotation)), "N m");
/// assert_eq!(friction.sign(), Sign::Nonnegative);
/// let offset = Parameter::read("Fo(q2)").ok_or("a label")?;
/// assert_eq!(offset, Parameter::new(Symbol::Offset, "q2"));
/// assert_eq!(offset.unit(Some(Motion::Translation)), "N");
/// assert_eq!(offset.sign(), Sign::Any);
/// assert!(!offset.is_friction() && !offset.is_inertial());
/// let cable = Parameter::read("cable(q4)").ok_or("a label")?;
/// assert_eq!(cable.symbol, Symbol::Term("cable"));
/// assert_eq!(Parameter::read("9(1)"), None);
/// # Ok::<(), &str>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Parameter<'a> {
    /// The kind.
    pub symbol: Symbol<'a>,
    /// The label of the body, or the name of the coordinate or of the spring between points.
    pub owner: &'a str,
}

impl<'a> Symbol<'a> {
    /// A body's ten inertial parameters in order: inertia about the origin of the body's frame,
    /// first moments, mass.
    pub const INERTIAL: [Symbol<'static>; 10] = [
        Symbol::Ixx,
        Symbol::Ixy,
        Symbol::Ixz,
        Symbol::Iyy,
        Symbol::Iyz,
        Symbol::Izz,
        Symbol::Mx,
        Symbol::My,
        Symbol::Mz,
        Symbol::Mass,
    ];

    /// The symbols of springs, in the order of `SPRINGS`.
    const OF_SPRINGS: [Symbol<'static>; 4] = [
        Symbol::Stiffness,
        Symbol::SpringStiffness,
        Symbol::SpringPreload,
        Symbol::SpringPull,
    ];

    /// Finds a symbol by its text in labels; other identifiers are names of effort terms.
    fn read(text: &'a str) -> Option<Self> {
        let named = |names: &[&str], symbols: &[Symbol<'static>]| {
            let mut known = names.iter().zip(symbols);
            known.find(|(name, _)| **name == text).map(|(_, s)| *s)
        };
        match text {
            ROTOR => return Some(Symbol::Rotor),
            OFFSET => return Some(Symbol::Offset),
            _ => {}
        }
        named(&INERTIAL, &Self::INERTIAL)
            .or_else(|| named(&SPRINGS, &Self::OF_SPRINGS))
            .or_else(|| friction::symbol(text).map(Symbol::Friction))
            .or_else(|| is_identifier(text).then_some(Symbol::Term(text)))
    }

    /// The symbol's text in labels.
    pub fn name(self) -> &'a str {
        match self {
            Symbol::Friction(symbol) | Symbol::Term(symbol) => symbol,
            Symbol::Offset => OFFSET,
            Symbol::Rotor => ROTOR,
            _ => {
                let symbols = Symbol::INERTIAL.iter().chain(&Symbol::OF_SPRINGS);
                let mut named = symbols.zip(INERTIAL.iter().chain(&SPRINGS));
                let found = named.find(|(symbol, _)| **symbol == self);
                found.map_or("", |(_, name)| name)
            }
        }
    }

    /// The SI unit. That of a joint's parameter depends on the joint's motion, a rotation or a
    /// translation; it is `SI` where the motion is unknown.
    pub fn unit(self, motion: Option<Motion>) -> &'static str {
        match self {
            Symbol::Ixx | Symbol::Ixy | Symbol::Ixz | Symbol::Iyy | Symbol::Iyz | Symbol::Izz => {
                "kg m^2"
            }
            Symbol::Mx | Symbol::My | Symbol::Mz => "kg m",
            Symbol::Mass => "kg",
            Symbol::Rotor => match motion {
                Some(Motion::Rotation) => "kg m^2",
                Some(Motion::Translation) => "kg",
                None => "SI",
            },
            Symbol::Offset => match motion {
                Some(Motion::Rotation) => "N m",
                Some(Motion::Translation) => "N",
                None => "SI",
            },
            Symbol::Friction(symbol) => friction::unit(symbol, motion),
            Symbol::Stiffness => match motion {
                Some(Motion::Rotation) => "N m/rad",
                Some(Motion::Translation) => "N/m",
                None => "SI",
            },
            Symbol::SpringStiffness => "N/m",
            Symbol::SpringPreload | Symbol::SpringPull => "N",
            Symbol::Term(_) => "SI",
        }
    }

    /// The values that the parameter can have in a physical robot.
    pub fn sign(self) -> Sign {
        match self {
            Symbol::Ixy
            | Symbol::Ixz
            | Symbol::Iyz
            | Symbol::Mx
            | Symbol::My
            | Symbol::Mz
            | Symbol::Offset
            | Symbol::Term(_)
            | Symbol::SpringPull => Sign::Any,
            Symbol::Ixx
            | Symbol::Iyy
            | Symbol::Izz
            | Symbol::Mass
            | Symbol::Friction(_)
            | Symbol::Rotor
            | Symbol::Stiffness
            | Symbol::SpringStiffness
            | Symbol::SpringPreload => Sign::Nonnegative,
        }
    }
}

impl<'a> Parameter<'a> {
    /// Creates a parameter; `owner` is the label of a body, or the name of a coordinate or of a
    /// spring between points.
    pub const fn new(symbol: Symbol<'a>, owner: &'a str) -> Self {
        Self { symbol, owner }
    }

    /// Parses a label such as `Ixx(3)`, `Fc+(q2)` or `J(q2)` that a person or a file gives; `None`
    /// if it is not a label. A symbol that no other parameter has is taken for the name of an effort
    /// term. A model lists its own parameters in [`Info`](crate::Info).
    pub fn read(label: &'a str) -> Option<Self> {
        let (symbol, owner) = label.strip_suffix(')')?.split_once('(')?;
        Some(Self::new(Symbol::read(symbol)?, owner))
    }

    /// The symbol's text in labels.
    pub fn name(&self) -> &'a str {
        self.symbol.name()
    }

    /// The label, as [`Display`](fmt::Display) prints it.
    #[cfg(feature = "closure")]
    pub fn label(&self) -> alloc::string::String {
        alloc::format!("{self}")
    }

    /// Whether the parameter belongs to a body.
    pub fn is_inertial(&self) -> bool {
        Symbol::INERTIAL.contains(&self.symbol)
    }

    /// Whether the parameter is a coefficient of a joint's friction.
    pub fn is_friction(&self) -> bool {
        matches!(self.symbol, Symbol::Friction(_))
    }

    /// Whether the parameter is a constant effort of a joint.
    pub fn is_offset(&self) -> bool {
        self.symbol == Symbol::Offset
    }

    /// Whether the parameter is of a spring, or the coefficient of an effort term.
    pub fn is_spring_or_term(&self) -> bool {
        matches!(self.symbol, Symbol::Term(_)) || Symbol::OF_SPRINGS.contains(&self.symbol)
    }

    /// Whether the parameter is the inertia of a rotor and its drive.
    pub fn is_rotor(&self) -> bool {
        self.symbol == Symbol::Rotor
    }

    /// The SI unit, see [`Symbol::unit`].
    pub fn unit(&self, motion: Option<Motion>) -> &'static str {
        self.symbol.unit(motion)
    }

    /// The values that the parameter can have in a physical robot.
    pub fn sign(&self) -> Sign {
        self.symbol.sign()
    }
}

/// Whether a text consists of letters, digits and underscores, and does not start with a digit.
fn is_identifier(text: &str) -> bool {
    let start = |c: char| c.is_ascii_alphabetic() || c == '_';
    text.starts_with(start) && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

impl fmt::Display for Parameter<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}({})", self.name(), self.owner)
    }
}

/// Compares the parameter's label with a text.
impl PartialEq<str> for Parameter<'_> {
    fn eq(&self, label: &str) -> bool {
        let rest = label.strip_prefix(self.name());
        let owner = rest.and_then(|rest| rest.strip_prefix('(')?.strip_suffix(')'));
        owner == Some(self.owner)
    }
}

/// Compares the parameter's label with a text.
impl PartialEq<&str> for Parameter<'_> {
    fn eq(&self, label: &&str) -> bool {
        *self == **label
    }
}
