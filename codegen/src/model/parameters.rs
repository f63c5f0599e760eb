//! The dynamic parameters and their order.

use crate::spec::{Friction, Spec};

use super::springs::{EffortTerm, JointSpring, PointSpring, SpringPart, owner};
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
    /// The stiffness of a spring at a coordinate.
    JointSpring {
        /// Index in [`Model::joint_springs`](super::Model::joint_springs).
        spring: usize,
        /// Index of the coordinate.
        coordinate: usize,
    },
    /// The coefficient of an effort term.
    EffortTerm {
        /// Index in [`Model::effort_terms`](super::Model::effort_terms).
        term: usize,
        /// Index of the coordinate.
        coordinate: usize,
    },
    /// A parameter of a spring between points.
    PointSpring {
        /// Index in [`Model::point_springs`](super::Model::point_springs).
        spring: usize,
        /// The part of the spring's force.
        part: SpringPart,
    },
}

/// The symbol of the constant effort of a joint.
const OFFSET: &str = "Fo";
/// The symbol of the inertia of a rotor and its drive (Eq. 18).
const ROTOR: &str = "J";
/// The symbol of the stiffness of a spring at a joint.
const STIFFNESS: &str = "K";

/// A dynamic parameter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// The kind, with the index of the body or coordinate.
    pub kind: ParameterKind,
    /// The label of the body, or the name of the coordinate or of the spring between points.
    pub owner: String,
    /// The label, such as `Ixx(3)`, `Fc+(q2)`, `J(q2)`, `k(counter)`, made of the symbol and the
    /// owner.
    pub label: String,
}

impl ParameterKind {
    /// The symbol that labels begin with; `None` for an effort term, which has a name of its own.
    fn symbol(self) -> Option<&'static str> {
        Some(match self {
            ParameterKind::Inertial { entry, .. } => INERTIAL.get(entry).copied()?,
            ParameterKind::Friction { column, .. } => column.symbol(),
            ParameterKind::Offset { .. } => OFFSET,
            ParameterKind::Rotor { .. } => ROTOR,
            ParameterKind::JointSpring { .. } => STIFFNESS,
            ParameterKind::PointSpring { part, .. } => part.symbol(),
            ParameterKind::EffortTerm { .. } => return None,
        })
    }
}

impl Parameter {
    /// Creates a parameter; `owner` is the label of its body, or the name of its coordinate or of
    /// its spring between points. An effort term is created by [`of_term`](Self::of_term).
    pub fn new(kind: ParameterKind, owner: &str) -> Self {
        Self::with_symbol(kind, kind.symbol().unwrap_or("?"), owner)
    }

    /// Creates the parameter of an effort term of this name at the coordinate `owner`.
    pub fn of_term(kind: ParameterKind, name: &str, owner: &str) -> Self {
        Self::with_symbol(kind, name, owner)
    }

    fn with_symbol(kind: ParameterKind, symbol: &str, owner: &str) -> Self {
        Parameter {
            kind,
            owner: owner.to_owned(),
            label: format!("{symbol}({owner})"),
        }
    }

    /// The symbol that the label begins with; for an effort term, its name.
    pub fn symbol(&self) -> &str {
        let end = self.label.len().saturating_sub(self.owner.len() + 2);
        self.label.get(..end).unwrap_or_default()
    }

    /// Whether it is the constant effort of a joint.
    pub fn is_offset(&self) -> bool {
        matches!(self.kind, ParameterKind::Offset { .. })
    }

    /// Whether it is of a spring, or the coefficient of an effort term.
    pub fn is_spring_or_term(&self) -> bool {
        matches!(
            self.kind,
            ParameterKind::JointSpring { .. }
                | ParameterKind::EffortTerm { .. }
                | ParameterKind::PointSpring { .. }
        )
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

/// The parameters of springs at joints, of effort terms, and of springs between points, in order.
pub(super) fn of_springs(
    coordinates: &[Coordinate],
    joint_springs: &[JointSpring],
    effort_terms: &[EffortTerm],
    point_springs: &[PointSpring],
) -> Vec<Parameter> {
    let joint_springs = joint_springs.iter().enumerate().map(|(spring, of)| {
        let coordinate = of.coordinate;
        let kind = ParameterKind::JointSpring { spring, coordinate };
        Parameter::new(kind, owner(coordinates, coordinate))
    });
    let effort_terms = effort_terms.iter().enumerate().map(|(term, of)| {
        let coordinate = of.coordinate;
        let kind = ParameterKind::EffortTerm { term, coordinate };
        Parameter::of_term(kind, &of.name, owner(coordinates, coordinate))
    });
    let point_springs = point_springs.iter().enumerate().flat_map(|(spring, of)| {
        let parts = SpringPart::of(&of.force).iter();
        parts
            .map(move |&part| Parameter::new(ParameterKind::PointSpring { spring, part }, &of.name))
    });
    joint_springs
        .chain(effort_terms)
        .chain(point_springs)
        .collect()
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
