//! The dynamic parameters and their order.

use crate::spec::{Friction, Spec};

use super::{Body, Coordinate};

/// A column of linear friction: its entry in the row of its joint, as a function of the velocity
/// qd.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrictionColumn {
    /// `Fv`: qd.
    Viscous,
    /// `Fc`: sgn(qd).
    Coulomb,
    /// `Fv+`: qd where qd > 0.
    ViscousPositive,
    /// `Fv-`: qd where qd < 0.
    ViscousNegative,
    /// `Fc+`: 1 where qd > 0.
    CoulombPositive,
    /// `Fc-`: -1 where qd < 0.
    CoulombNegative,
}

impl FrictionColumn {
    const ALL: [FrictionColumn; 6] = [
        FrictionColumn::Viscous,
        FrictionColumn::Coulomb,
        FrictionColumn::ViscousPositive,
        FrictionColumn::ViscousNegative,
        FrictionColumn::CoulombPositive,
        FrictionColumn::CoulombNegative,
    ];

    /// The columns of a friction law, in order (Eq. 14, 15); none for a law that is not linear.
    pub fn of(law: Friction) -> impl Iterator<Item = FrictionColumn> {
        let symbols = law.parameters().iter();
        symbols.filter_map(|symbol| Self::ALL.into_iter().find(|c| c.symbol() == *symbol))
    }

    /// The symbol with which labels begin.
    pub fn symbol(self) -> &'static str {
        match self {
            FrictionColumn::Viscous => "Fv",
            FrictionColumn::Coulomb => "Fc",
            FrictionColumn::ViscousPositive => "Fv+",
            FrictionColumn::ViscousNegative => "Fv-",
            FrictionColumn::CoulombPositive => "Fc+",
            FrictionColumn::CoulombNegative => "Fc-",
        }
    }
}

/// The symbols of a body's ten inertial parameters, about the origin of its frame and in its axes:
/// moments and products of inertia in kg m^2, first moments in kg m, mass in kg.
pub const INERTIAL: [&str; 10] = [
    "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "mx", "my", "mz", "m",
];

/// The kind of a parameter, with the body or the coordinate that it belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterKind {
    /// One of the ten inertial parameters of a body.
    Inertial {
        /// Index of the body.
        body: usize,
        /// Index in [`INERTIAL`].
        entry: usize,
    },
    /// A friction coefficient at a coordinate.
    Friction {
        /// Index of the coordinate.
        coordinate: usize,
        /// The column of the friction law.
        column: FrictionColumn,
    },
    /// A constant effort at a coordinate, of either sign: of the amplifier, the sensor or a cable.
    Offset {
        /// Index of the coordinate.
        coordinate: usize,
    },
    /// The inertia of rotor and drive at a coordinate (Eq. 18).
    Rotor {
        /// Index of the coordinate.
        coordinate: usize,
    },
}

/// The symbol of the constant effort of a joint.
const OFFSET: &str = "Fo";
/// The symbol of the inertia of a rotor and its drive (Eq. 18).
const ROTOR: &str = "J";

/// A dynamic parameter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// The kind, with the index of the body or coordinate.
    pub kind: ParameterKind,
    /// The label of the body, or the name of the coordinate.
    pub owner: String,
    /// The label, such as `Ixx(3)`, `Fc+(q2)`, `J(q2)`, made of the symbol and the owner.
    pub label: String,
}

impl ParameterKind {
    /// The symbol that labels begin with.
    pub fn symbol(self) -> &'static str {
        match self {
            ParameterKind::Inertial { entry, .. } => INERTIAL.get(entry).copied().unwrap_or("?"),
            ParameterKind::Friction { column, .. } => column.symbol(),
            ParameterKind::Offset { .. } => OFFSET,
            ParameterKind::Rotor { .. } => ROTOR,
        }
    }
}

impl Parameter {
    /// Creates a parameter; `owner` is the label of its body or the name of its coordinate.
    pub fn new(kind: ParameterKind, owner: &str) -> Self {
        Parameter {
            kind,
            owner: owner.to_owned(),
            label: format!("{}({owner})", kind.symbol()),
        }
    }

    /// The symbol that the label begins with.
    pub fn symbol(&self) -> &'static str {
        self.kind.symbol()
    }

    /// Whether it is a coefficient of a joint's friction.
    pub fn is_friction(&self) -> bool {
        matches!(self.kind, ParameterKind::Friction { .. })
    }
}

/// All parameters in order: ten per body, then friction and the offset coordinate by coordinate,
/// then rotors (Eq. 20).
pub(super) fn list(spec: &Spec, bodies: &[Body], coordinates: &[Coordinate]) -> Vec<Parameter> {
    let mut parameters = Vec::new();
    for (index, body) in bodies.iter().enumerate() {
        for entry in 0..INERTIAL.len() {
            let kind = ParameterKind::Inertial { body: index, entry };
            parameters.push(Parameter::new(kind, &body.label));
        }
    }
    let joints = super::joints_of_coordinates(spec);
    for (index, (coordinate, joint)) in coordinates.iter().zip(&joints).enumerate() {
        for column in FrictionColumn::of(joint.friction) {
            let kind = ParameterKind::Friction {
                coordinate: index,
                column,
            };
            parameters.push(Parameter::new(kind, &coordinate.name));
        }
        if joint.offset {
            let kind = ParameterKind::Offset { coordinate: index };
            parameters.push(Parameter::new(kind, &coordinate.name));
        }
    }
    for (index, (coordinate, joint)) in coordinates.iter().zip(&joints).enumerate() {
        if joint.rotor_inertia {
            let kind = ParameterKind::Rotor { coordinate: index };
            parameters.push(Parameter::new(kind, &coordinate.name));
        }
    }
    parameters
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_parameter_of_a_law_has_a_column() {
        for law in Friction::ALL {
            let columns: Vec<&str> = FrictionColumn::of(*law)
                .map(FrictionColumn::symbol)
                .collect();
            assert_eq!(columns, law.parameters(), "{law:?}");
        }
    }
}
