//! The names that a spec defines: coordinates, bodies and parameters, each list in order.

use super::expression::INERTIAL;
use super::friction::Friction;
use super::types::{Joint, JointKind, Quantity, Spec};

/// The names of a joint's coordinates, such as `q2`, or `s1.1`, `s1.2`, `s1.3`.
pub(super) fn coordinates_of(name: &str, kind: JointKind) -> Vec<String> {
    match kind.coordinates() {
        0 => Vec::new(),
        1 => vec![name.to_owned()],
        count => (1..=count).map(|index| format!("{name}.{index}")).collect(),
    }
}

/// A parameter's symbol and its owner: the label of a body, or the name of a coordinate.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ParameterName {
    pub(super) symbol: String,
    pub(super) owner: String,
}

impl ParameterName {
    fn new(symbol: &str, owner: &str) -> Self {
        Self {
            symbol: symbol.to_owned(),
            owner: owner.to_owned(),
        }
    }

    /// Splits a label that a person wrote, such as `Fc+(q2)` into `Fc+` and `q2`; the parameter may
    /// not exist.
    pub(super) fn read(label: &str) -> Option<Self> {
        let (symbol, owner) = label.strip_suffix(')')?.split_once('(')?;
        Some(Self::new(symbol, owner))
    }

    /// The parameter's label, such as `Fc+(q2)`.
    pub(super) fn label(&self) -> String {
        format!("{}({})", self.symbol, self.owner)
    }
}

/// The properties of a joint that labels depend on.
pub(super) struct JointFacts<'a> {
    pub(super) name: &'a str,
    pub(super) kind: JointKind,
    pub(super) body: Option<&'a str>,
    pub(super) friction: Friction,
    pub(super) offset: bool,
    pub(super) rotor: bool,
    pub(super) spring: bool,
    pub(super) terms: Vec<&'a str>,
}

/// The properties of a spring between points that labels depend on.
pub(super) struct SpringFacts<'a> {
    pub(super) name: &'a str,
    pub(super) symbols: &'static [&'static str],
}

/// All labels of a robot, each list in order.
pub(super) struct Inventory {
    pub(super) coordinates: Vec<String>,
    pub(super) bodies: Vec<String>,
    pub(super) parameters: Vec<ParameterName>,
}

impl Inventory {
    /// The labels that these joints and springs define.
    pub(super) fn of<'a>(
        joints: impl IntoIterator<Item = JointFacts<'a>>,
        springs: impl IntoIterator<Item = SpringFacts<'a>>,
    ) -> Self {
        let mut coordinates = Vec::new();
        let mut bodies: Vec<String> = Vec::new();
        let (mut friction, mut rotors) = (Vec::new(), Vec::new());
        let (mut joint_springs, mut terms) = (Vec::new(), Vec::new());
        for joint in joints {
            bodies.extend(joint.body.map(str::to_owned));
            for coordinate in coordinates_of(joint.name, joint.kind) {
                let symbols = joint.friction.parameters().iter();
                friction.extend(symbols.map(|symbol| ParameterName::new(symbol, &coordinate)));
                if joint.offset {
                    friction.push(ParameterName::new("Fo", &coordinate));
                }
                if joint.rotor {
                    rotors.push(ParameterName::new("J", &coordinate));
                }
                if joint.spring {
                    joint_springs.push(ParameterName::new("K", &coordinate));
                }
                let names = joint.terms.iter();
                terms.extend(names.map(|name| ParameterName::new(name, &coordinate)));
                coordinates.push(coordinate);
            }
        }
        let inertial = bodies
            .iter()
            .flat_map(|body| INERTIAL.map(|symbol| ParameterName::new(symbol, body)));
        let point_springs = springs.into_iter().flat_map(|spring| {
            let symbols = spring.symbols.iter();
            symbols.map(move |symbol| ParameterName::new(symbol, spring.name))
        });
        let parameters = inertial
            .chain(friction)
            .chain(rotors)
            .chain(joint_springs)
            .chain(terms)
            .chain(point_springs)
            .collect();
        Self {
            coordinates,
            bodies,
            parameters,
        }
    }
}

impl Joint {
    /// The names of the joint's coordinates.
    pub fn coordinates(&self) -> Vec<String> {
        let name = self.name.as_ref().map_or("", |name| name.value.as_str());
        coordinates_of(name, self.kind.value)
    }

    /// The nominal value of one of the joint's parameters; a value of `Fv` or `Fc` applies to each
    /// direction that has none of its own.
    pub fn nominal_value(&self, symbol: &str) -> Option<&Quantity> {
        let find = |wanted: &str| {
            let mut entries = self.nominal.iter();
            entries
                .find(|(name, _)| name.value == wanted)
                .map(|(_, value)| value)
        };
        find(symbol).or_else(|| find(symbol.strip_suffix(['+', '-'])?))
    }
}

impl Spec {
    fn inventory(&self) -> Inventory {
        let joints = self.limbs.iter().flat_map(|limb| &limb.joints);
        let springs = self.springs.iter().map(|spring| SpringFacts {
            name: &spring.name.value,
            symbols: spring.force.symbols(),
        });
        let joints = joints.map(|joint| JointFacts {
            name: joint.name.as_ref().map_or("", |name| name.value.as_str()),
            kind: joint.kind.value,
            body: joint.body.as_ref().map(|body| body.value.as_str()),
            friction: joint.friction,
            offset: joint.offset,
            rotor: joint.rotor_inertia,
            spring: joint.spring.is_some(),
            terms: joint
                .terms
                .iter()
                .map(|(name, _)| name.value.as_str())
                .collect(),
        });
        Inventory::of(joints, springs)
    }

    /// The coordinates' names, in the order of the limbs.
    pub fn coordinates(&self) -> Vec<String> {
        self.inventory().coordinates
    }

    /// The bodies' labels, in the order in which joints declare them.
    pub fn body_labels(&self) -> Vec<String> {
        self.inventory().bodies
    }

    /// The parameters' labels: ten per body, then friction and the offset coordinate by coordinate,
    /// then rotors, joint springs, effort terms, and springs between points.
    pub fn parameters(&self) -> Vec<String> {
        let parameters = self.inventory().parameters;
        parameters.iter().map(ParameterName::label).collect()
    }
}
