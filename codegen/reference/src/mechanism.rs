//! The mechanism: a tree of single-axis motions, the cuts that close its loops, and its names.

use std::collections::BTreeMap;

use crate::friction::Friction;
use crate::scalar::Mat4;
use crate::springs::{EffortTerm, Spring};

/// The number of inertial parameters of a body, `Ixx Ixy Ixz Iyy Iyz Izz mx my mz m`, about the
/// origin of the body's frame and in its axes.
pub const PARAMETERS_PER_BODY: usize = 10;

/// An axis of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// x
    X,
    /// y
    Y,
    /// z
    Z,
}

impl Axis {
    /// The axis's index in a vector.
    pub fn index(self) -> usize {
        match self {
            Axis::X => 0,
            Axis::Y => 1,
            Axis::Z => 2,
        }
    }
}

/// The motion of a node's frame with a coordinate: a rotation, a translation or both, by one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointMotion {
    /// The axis of the rotation and of the translation.
    pub axis: Axis,
    /// The index of the coordinate.
    pub coordinate: usize,
    /// The angle about the axis per unit of the coordinate: 1, or 0 where the coordinate is a
    /// distance.
    pub turn: f64,
    /// The translation along the axis per unit of the coordinate: m/rad, or 1 where it is a
    /// distance.
    pub slide: f64,
}

/// A frame of the tree: a constant offset from its parent, then at most one motion.
#[derive(Clone, Debug)]
pub struct Node {
    /// The node that this one is placed on; `None` is the world. Parents precede their children.
    pub parent: Option<usize>,
    /// The constant placement in the parent's frame.
    pub offset: Mat4<f64>,
    /// The motion that follows the placement; `None` if the node is fixed on its parent.
    pub motion: Option<JointMotion>,
}

/// A body and the node that carries it.
#[derive(Clone, Debug)]
pub struct Body {
    /// The body's label.
    pub label: String,
    /// The index of its node; the body's frame is the node's frame after the motion.
    pub node: usize,
    /// Nominal parameters, if the spec gives them.
    pub nominal: Option<[f64; PARAMETERS_PER_BODY]>,
}

/// The type of the joint that a cut opens, with the number of its closure equations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CutKind {
    /// 3 equations.
    Spherical,
    /// 4 equations.
    Universal,
    /// 5 equations.
    Revolute,
    /// 5 equations.
    Prismatic,
    /// 5 equations.
    Helical,
    /// 4 equations.
    Cylindrical,
    /// 6 equations.
    Fixed,
}

impl CutKind {
    /// The number of closure equations.
    pub fn rows(self) -> usize {
        match self {
            CutKind::Spherical => 3,
            CutKind::Universal | CutKind::Cylindrical => 4,
            CutKind::Revolute | CutKind::Prismatic | CutKind::Helical => 5,
            CutKind::Fixed => 6,
        }
    }
}

/// A frame on a node or on the world.
#[derive(Clone, Debug)]
pub struct CutSide {
    /// The node's index; `None` is the world.
    pub node: Option<usize>,
    /// The constant placement in the frame of the node or the world.
    pub offset: Mat4<f64>,
}

/// A cut: a joint opened to obtain the tree, whose closure equations close the loop.
#[derive(Clone, Debug)]
pub struct Cut {
    /// The cut's name.
    pub name: String,
    /// The type of the opened joint.
    pub kind: CutKind,
    /// The translation per turn of a helical cut, m; 0 for other types.
    pub pitch: f64,
    /// The frames A and B.
    pub sides: [CutSide; 2],
}

/// A limit of the angle between the z axes of two frames.
#[derive(Clone, Debug)]
pub struct SwingLimit {
    /// The name of the joint or the cut.
    pub name: String,
    /// The greatest angle, rad.
    pub greatest: f64,
    /// The two frames.
    pub sides: [CutSide; 2],
}

/// `key = constant + sum of coefficients times coordinates`.
#[derive(Clone, Debug)]
pub struct Coupling {
    /// The index of the coordinate on the left side.
    pub key: usize,
    /// The constant, rad or m.
    pub constant: f64,
    /// The coefficients, one per coordinate.
    pub coefficients: Vec<f64>,
}

/// A dynamic parameter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Parameter {
    /// Entry 0..10 of the body of this index.
    Inertial(usize, usize),
    /// The named friction parameter (`Fv`, `Fc+`, ...) of the coordinate of this index.
    Friction(usize, &'static str),
    /// The constant effort at the coordinate of this index.
    Offset(usize),
    /// The rotor at the coordinate of this index.
    Rotor(usize),
    /// The parameter of the spring of this index.
    Spring(usize),
    /// The coefficient of the effort term of this index.
    Term(usize),
}

/// A mechanism as its spec describes it.
#[derive(Clone, Debug)]
pub struct Mechanism {
    /// The spec's name.
    pub name: String,
    /// Gravity in the world frame, m/s^2.
    pub gravity: [f64; 3],
    /// The names of all coordinates.
    pub coordinates: Vec<String>,
    /// The frames of the tree, parents first.
    pub nodes: Vec<Node>,
    /// The bodies, in the order in which joints declare them.
    pub bodies: Vec<Body>,
    /// Cuts in the order of the file.
    pub cuts: Vec<Cut>,
    /// Cones of joints, then of cuts.
    pub cones: Vec<SwingLimit>,
    /// Couplings in the order of the file, then the forms of the drives.
    pub couplings: Vec<Coupling>,
    /// The indices of the coordinates of drives; the last couplings are theirs, in this order.
    pub drives: Vec<usize>,
    /// The indices of the independent coordinates.
    pub independent: Vec<usize>,
    /// The indices of the other coordinates, ascending.
    pub dependent: Vec<usize>,
    /// The indices of the actuated coordinates, ascending.
    pub actuated: Vec<usize>,
    /// The friction law of each coordinate.
    pub friction: Vec<Friction>,
    /// Whether each coordinate has a constant effort among its parameters.
    pub offset: Vec<bool>,
    /// Whether each coordinate has a rotor parameter.
    pub rotor: Vec<bool>,
    /// Springs, one entry per parameter.
    pub springs: Vec<Spring>,
    /// Effort terms.
    pub terms: Vec<EffortTerm>,
    /// The parameter of each column of the regressor.
    pub parameters: Vec<Parameter>,
    /// The coordinates at which the closure solve starts, rad or m.
    pub home_guess: Vec<f64>,
    /// Nominal values of the parameters of coordinates and springs by label, such as `Fv(q1)`.
    pub nominal: BTreeMap<String, f64>,
}

const INERTIAL: [&str; PARAMETERS_PER_BODY] = [
    "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "mx", "my", "mz", "m",
];

impl Mechanism {
    /// The label of a parameter.
    pub fn label(&self, parameter: &Parameter) -> String {
        match parameter {
            Parameter::Inertial(body, k) => {
                format!("{}({})", INERTIAL[*k], self.bodies[*body].label)
            }
            Parameter::Friction(coordinate, symbol) => {
                format!("{symbol}({})", self.coordinates[*coordinate])
            }
            Parameter::Offset(coordinate) => format!("Fo({})", self.coordinates[*coordinate]),
            Parameter::Rotor(coordinate) => format!("J({})", self.coordinates[*coordinate]),
            Parameter::Spring(index) => self.springs[*index].label.clone(),
            Parameter::Term(index) => self.terms[*index].label.clone(),
        }
    }

    /// The labels of all parameters, in the order of the regressor's columns.
    pub fn labels(&self) -> Vec<String> {
        self.parameters.iter().map(|p| self.label(p)).collect()
    }

    /// The number of coordinates.
    pub fn n(&self) -> usize {
        self.coordinates.len()
    }

    /// The number of independent coordinates.
    pub fn dof(&self) -> usize {
        self.independent.len()
    }

    /// The number of closure equations, couplings included.
    pub fn rows(&self) -> usize {
        self.cuts.iter().map(|c| c.kind.rows()).sum::<usize>() + self.couplings.len()
    }

    /// Whether a coordinate is a distance.
    pub fn slides(&self, coordinate: usize) -> bool {
        self.nodes
            .iter()
            .filter_map(|n| n.motion)
            .any(|m| m.coordinate == coordinate && m.turn.abs() < 0.5)
    }

    /// How far a coordinate may move where every joint turns by `turn` (rad) or slides by `slide`
    /// (m): a joint's coordinate as far as the joint, a drive's as far as all its joints together,
    /// each times the magnitude of its factor.
    pub(crate) fn travel(&self, coordinate: usize, turn: f64, slide: f64) -> f64 {
        let of_joint = |k: usize| if self.slides(k) { slide } else { turn };
        if !self.drives.contains(&coordinate) {
            return of_joint(coordinate);
        }
        let own = self.couplings.iter().filter(|c| c.key == coordinate);
        own.flat_map(|c| c.coefficients.iter().enumerate())
            .map(|(k, factor)| factor.abs() * of_joint(k))
            .sum()
    }

    /// The nominal parameter vector, if the spec gives every value.
    pub fn nominal_parameters(&self) -> Option<Vec<f64>> {
        self.nominal_values().into_iter().collect()
    }

    /// The nominal value of each parameter that has one.
    pub fn nominal_values(&self) -> Vec<Option<f64>> {
        self.parameters
            .iter()
            .map(|p| match p {
                Parameter::Inertial(body, k) => self.bodies[*body].nominal.map(|v| v[*k]),
                _ => self.nominal.get(&self.label(p)).copied(),
            })
            .collect()
    }
}
