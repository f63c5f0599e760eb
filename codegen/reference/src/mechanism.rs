//! The mechanism: a tree of single-axis motions, the cuts that close it, and its names.

use std::collections::BTreeMap;

use crate::friction::Friction;
use crate::scalar::Mat4;

/// `Ixx Ixy Ixz Iyy Iyz Izz mx my mz m` about the body frame's origin in its axes.
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
    /// Its place in a vector.
    pub fn index(self) -> usize {
        match self {
            Axis::X => 0,
            Axis::Y => 1,
            Axis::Z => 2,
        }
    }
}

/// What a coordinate does to the frame of its node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointMotion {
    /// The axis of both its parts.
    pub axis: Axis,
    /// The index of the coordinate.
    pub coordinate: usize,
    /// The angle about the axis per unit of the coordinate: 1, or 0 where it is a distance.
    pub turn: f64,
    /// The shift along the axis per unit of the coordinate.
    pub slide: f64,
}

/// A frame of the tree: a constant offset from its parent, then at most one motion.
#[derive(Clone, Debug)]
pub struct Node {
    /// The node it moves on; `None` is the world. Parents come first.
    pub parent: Option<usize>,
    /// The constant placement in the parent's frame.
    pub offset: Mat4<f64>,
    /// The motion after it; `None` is rigid.
    pub motion: Option<JointMotion>,
}

/// A body and the node that carries it.
#[derive(Clone, Debug)]
pub struct Body {
    /// Its label.
    pub label: String,
    /// Its node: the body's frame is the moved frame.
    pub node: usize,
    /// Nominal parameters, if the spec gives them.
    pub nominal: Option<[f64; PARAMETERS_PER_BODY]>,
}

/// The joint that a cut opens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CutKind {
    /// 3 rows.
    Spherical,
    /// 4 rows.
    Universal,
    /// 5 rows.
    Revolute,
    /// 5 rows.
    Prismatic,
    /// 5 rows.
    Helical,
    /// 4 rows.
    Cylindrical,
    /// 6 rows.
    Fixed,
}

impl CutKind {
    /// The number of its constraint rows.
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
    /// `None` is the world.
    pub node: Option<usize>,
    /// The placement on it.
    pub offset: Mat4<f64>,
}

/// A loop closure.
#[derive(Clone, Debug)]
pub struct Cut {
    /// Its name.
    pub name: String,
    /// What it opens.
    pub kind: CutKind,
    /// Shift per turn of a helical cut.
    pub pitch: f64,
    /// Frames A and B.
    pub sides: [CutSide; 2],
}

/// A limit of the angle between two z axes.
#[derive(Clone, Debug)]
pub struct SwingLimit {
    /// The joint or the cut.
    pub name: String,
    /// The greatest angle.
    pub greatest: f64,
    /// The two frames.
    pub sides: [CutSide; 2],
}

/// `key = constant + sum of coefficients times coordinates`.
#[derive(Clone, Debug)]
pub struct Coupling {
    /// The coordinate that is tied.
    pub key: usize,
    /// The constant.
    pub constant: f64,
    /// One per coordinate.
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
}

/// A mechanism as its spec describes it.
#[derive(Clone, Debug)]
pub struct Mechanism {
    /// The spec's name.
    pub name: String,
    /// Gravity in the world.
    pub gravity: [f64; 3],
    /// All coordinates by name.
    pub coordinates: Vec<String>,
    /// The tree.
    pub nodes: Vec<Node>,
    /// Bodies in the order declared.
    pub bodies: Vec<Body>,
    /// Cuts in the order of the file.
    pub cuts: Vec<Cut>,
    /// Cones of joints, then of cuts.
    pub cones: Vec<SwingLimit>,
    /// Couplings in the order of the file.
    pub couplings: Vec<Coupling>,
    /// The independent coordinates.
    pub independent: Vec<usize>,
    /// The other coordinates, in order.
    pub dependent: Vec<usize>,
    /// The actuated coordinates, in order.
    pub actuated: Vec<usize>,
    /// Friction by coordinate.
    pub friction: Vec<Friction>,
    /// Whether there is a constant effort, by coordinate.
    pub offset: Vec<bool>,
    /// Rotor by coordinate.
    pub rotor: Vec<bool>,
    /// What each column of the regressor means.
    pub parameters: Vec<Parameter>,
    /// Start of the closure solve.
    pub home_guess: Vec<f64>,
    /// Nominal friction and rotor values by label, as given.
    pub nominal: BTreeMap<String, f64>,
}

const INERTIAL: [&str; PARAMETERS_PER_BODY] = [
    "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "mx", "my", "mz", "m",
];

impl Mechanism {
    /// The label of a column.
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
        }
    }

    /// The labels of all columns.
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

    /// The number of constraint rows, couplings included.
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
