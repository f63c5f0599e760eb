//! The mechanism: links, single-axis joints, spanning tree, cuts, and the order of coordinates and
//! parameters. A joint with several axes is a chain of single-axis joints with massless links
//! between them.

mod build;
mod limits;
mod parameters;
mod springs;
mod stated;

pub use build::build;
pub use limits::contradicting_limits;
pub use parameters::{FrictionColumn, INERTIAL, Parameter, ParameterKind};
pub use springs::{EffortTerm, JointSpring, PointSpring, SpringEnd, SpringPart};
pub use stated::{joints_of_coordinates, nominal};

pub use crate::spec::{EffortExpr, Function, MotionKind, SpringForce};

use crate::spec::{Axis, CutKind, Quantity};
use crate::sym::Number;

/// One elementary step of a constant placement, in the frame that the steps before it lead to.
#[derive(Clone, Debug)]
pub enum Step {
    /// A rotation about an axis, rad.
    Rotate(Axis, Quantity),
    /// A translation along an axis, m.
    Translate(Axis, Quantity),
}

/// A constant placement of one frame in another, as elementary steps.
pub type Placement = Vec<Step>;

/// The motion of a link relative to its placement.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Index of the coordinate.
    pub coordinate: usize,
    /// Whether the coordinate is an angle or a length.
    pub kind: MotionKind,
    /// The axis of the placed frame about or along which the link moves.
    pub axis: Axis,
    /// Translation along the axis per radian of rotation, m/rad; `None` if the two are not coupled.
    pub lead: Option<Quantity>,
}

impl Motion {
    /// The angle about the axis, rad, and the shift along it, m, at a value of the coordinate.
    pub fn displacement(&self, q: f64) -> (f64, f64) {
        match self.kind {
            MotionKind::Rotation => {
                let lead = self.lead.as_ref();
                (q, lead.map_or(0.0, |lead| lead.value.to_f64() * q))
            }
            MotionKind::Translation => (0.0, q),
        }
    }
}

/// A link of the spanning tree.
#[derive(Clone, Debug)]
pub struct Link {
    /// The link that carries it; `None` is the world.
    pub parent: Option<usize>,
    /// The pose of its frame in the parent's, at zero motion.
    pub placement: Placement,
    /// Its motion; `None` for a fixed link.
    pub motion: Option<Motion>,
    /// Its name for generated code: the body's label or the coordinate's name.
    pub name: String,
}

/// A coordinate: the angle or the length of a single-axis joint.
#[derive(Clone, Debug)]
pub struct Coordinate {
    /// Its name; `s1.2` is the second coordinate of the joint `s1`.
    pub name: String,
    /// The link that it moves.
    pub link: usize,
    /// Whether it is actuated.
    pub actuated: bool,
    /// Limits of its position, rad or m, if the spec gives them.
    pub position: Option<[f64; 2]>,
}

/// A body: a link with inertia.
#[derive(Clone, Debug)]
pub struct Body {
    /// The body's label.
    pub label: String,
    /// The link whose frame is the body's frame.
    pub link: usize,
}

/// One side of a cut: a frame on a link.
#[derive(Clone, Debug)]
pub struct Side {
    /// The link that carries the frame; `None` is the world.
    pub link: Option<usize>,
    /// The pose of the frame in the link's.
    pub placement: Placement,
}

/// A frame that the description names, such as a tool's.
#[derive(Clone, Debug)]
pub struct NamedFrame {
    /// Its name.
    pub name: String,
    /// The frame on its link.
    pub side: Side,
}

/// A joint at which a loop was cut; its equations close the loop.
#[derive(Clone, Debug)]
pub struct Cut {
    /// The name of the cut.
    pub name: String,
    /// The kind of joint.
    pub kind: CutKind,
    /// Translation per radian of rotation of a helical joint, m/rad; `None` for the other kinds.
    pub lead: Option<Quantity>,
    /// Frame A, then frame B.
    pub sides: [Side; 2],
}

/// A limit of the swing angle: the angle between the z axes of two frames.
#[derive(Clone, Debug)]
pub struct SwingLimit {
    /// The name of the joint or the cut.
    pub name: String,
    /// The largest swing angle, rad.
    pub greatest: Number,
    /// The two frames.
    pub sides: [Side; 2],
}

/// A coordinate that is a linear function of others: `key = constant + sum of terms`.
#[derive(Clone, Debug)]
pub struct Coupling {
    /// The coordinate that the coupling determines.
    pub key: usize,
    /// The constant part.
    pub constant: Number,
    /// The other coordinates with their factors.
    pub terms: Vec<(usize, Number)>,
}

/// A mechanism, ready for the derivation.
#[derive(Clone, Debug)]
pub struct Model {
    /// Gravity in the world frame, m/s^2.
    pub gravity: [Quantity; 3],
    /// The links of the tree, parents before children.
    pub links: Vec<Link>,
    /// Coordinates in the spec's order.
    pub coordinates: Vec<Coordinate>,
    /// Bodies in the order of declaration.
    pub bodies: Vec<Body>,
    /// The bodies that are payloads, as indices: carried in some runs only.
    pub payloads: Vec<usize>,
    /// Cut joints in the spec's order.
    pub cuts: Vec<Cut>,
    /// Swing limits: those of joints in the order of coordinates, then those of cuts.
    pub cones: Vec<SwingLimit>,
    /// Named frames in the spec's order.
    pub frames: Vec<NamedFrame>,
    /// Couplings in the spec's order.
    pub couplings: Vec<Coupling>,
    /// Springs at joints, in the order of coordinates.
    pub joint_springs: Vec<JointSpring>,
    /// Effort terms, coordinate by coordinate.
    pub effort_terms: Vec<EffortTerm>,
    /// Springs between points, in the spec's order.
    pub point_springs: Vec<PointSpring>,
    /// The coordinates that are drives: each is the key of a coupling, and moves no body.
    pub drives: Vec<usize>,
    /// Independent coordinates, in the order of the spec.
    pub independent: Vec<usize>,
    /// The other coordinates, in the order of coordinates.
    pub dependent: Vec<usize>,
    /// Actuated coordinates, in the order of coordinates.
    pub actuated: Vec<usize>,
    /// The home position of each coordinate, from which the loops are closed.
    pub home: Vec<Number>,
    /// The dynamic parameters, in the order of phi.
    pub parameters: Vec<Parameter>,
}

impl Model {
    /// The links from the base outward to `link`, which is the last one.
    pub fn path(&self, link: Option<usize>) -> Vec<usize> {
        let mut path = Vec::new();
        let mut at = link;
        while let Some(i) = at {
            path.push(i);
            at = self.links[i].parent;
        }
        path.reverse();
        path
    }

    /// The motion of the link that a coordinate moves.
    pub fn motion(&self, coordinate: usize) -> Option<&Motion> {
        self.links[self.coordinates[coordinate].link]
            .motion
            .as_ref()
    }

    /// Whether a coordinate is a length (m) rather than an angle (rad).
    pub fn slides(&self, coordinate: usize) -> bool {
        self.motion(coordinate)
            .is_some_and(|m| m.kind == MotionKind::Translation)
    }

    /// How far a coordinate is expected to move if joints turn by `turn` (rad) and slide by `slide`
    /// (m): by the same amount, or for a drive by the sum over its joints, times the sizes of the
    /// factors.
    pub fn reach(&self, coordinate: usize, turn: f64, slide: f64) -> f64 {
        let of_joint = |c: usize| if self.slides(c) { slide } else { turn };
        match self.form_of_drive(coordinate) {
            Some(form) => form
                .terms
                .iter()
                .map(|(c, factor)| factor.to_f64().abs() * of_joint(*c))
                .sum(),
            None => of_joint(coordinate),
        }
    }

    /// The form of a drive's coordinate; `None` for the coordinates of joints.
    pub fn form_of_drive(&self, coordinate: usize) -> Option<&Coupling> {
        let mut couplings = self.couplings.iter();
        let form = couplings.find(|coupling| coupling.key == coordinate);
        form.filter(|_| self.drives.contains(&coordinate))
    }

    /// The columns of the parameters in groups whose efforts are measured apart: those of the robot,
    /// then those of each payload. One group where there is no payload.
    pub fn column_groups(&self) -> Vec<Vec<usize>> {
        let payload = |column: &usize| match self.parameters[*column].kind {
            ParameterKind::Inertial { body, .. } => self.payloads.iter().position(|p| *p == body),
            _ => None,
        };
        let mut groups = vec![Vec::new(); 1 + self.payloads.len()];
        for column in 0..self.parameters.len() {
            groups[payload(&column).map_or(0, |k| k + 1)].push(column);
        }
        groups
    }

    /// Number of closure rows: those of all cuts, then one per coupling.
    pub fn rows(&self) -> usize {
        let cuts = self.cuts.iter().map(|cut| cut.kind.rows().len());
        cuts.sum::<usize>() + self.couplings.len()
    }

    /// Whether the mechanism has cuts or couplings.
    pub fn is_closed(&self) -> bool {
        !self.cuts.is_empty() || !self.couplings.is_empty()
    }
}
