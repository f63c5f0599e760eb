//! The mechanism: links, single-axis joints, spanning tree, cuts, and the order
//! of coordinates and parameters. Compound joints are chains of single-axis
//! ones with massless links between them.

mod build;
mod parameters;
mod stated;

pub use build::build;
pub use parameters::{FrictionColumn, INERTIAL, Parameter, ParameterKind};
pub use stated::{joints_of_coordinates, nominal};

pub use crate::spec::MotionKind;

use crate::spec::{Axis, CutKind, Quantity};
use crate::sym::Number;

/// One elementary step of a constant placement, in the frame reached so far.
#[derive(Clone, Debug)]
pub enum Step {
    /// A turn about an axis, rad.
    Rotate(Axis, Number),
    /// A shift along an axis, m.
    Translate(Axis, Quantity),
}

/// A constant placement of one frame in another.
pub type Placement = Vec<Step>;

/// The motion of a link in the frame that its placement gives.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Index of the coordinate.
    pub coordinate: usize,
    /// Whether it is an angle or a length.
    pub kind: MotionKind,
    /// About or along which axis of the placed frame.
    pub axis: Axis,
    /// How far a rotation slides the link along the axis, m per radian; `None` where it does not.
    pub lead: Option<Quantity>,
}

impl Motion {
    /// The angle about the axis and the shift along it at a value of the coordinate.
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

/// A frame of the tree.
#[derive(Clone, Debug)]
pub struct Link {
    /// The link it stands on; `None` is the world.
    pub parent: Option<usize>,
    /// Where it stands on its parent, before the motion.
    pub placement: Placement,
    /// Its motion; `None` where it is fixed.
    pub motion: Option<Motion>,
    /// A name for generated code: body label or coordinate.
    pub name: String,
}

/// A single-axis coordinate.
#[derive(Clone, Debug)]
pub struct Coordinate {
    /// Its name, `s1.2` within compound joints.
    pub name: String,
    /// The link that it moves.
    pub link: usize,
    /// Whether it is actuated.
    pub actuated: bool,
    /// Limits of its position, where given.
    pub position: Option<[f64; 2]>,
}

/// A body: a link with inertia.
#[derive(Clone, Debug)]
pub struct Body {
    /// Its label.
    pub label: String,
    /// The link whose frame is the body's.
    pub link: usize,
}

/// One side of a cut.
#[derive(Clone, Debug)]
pub struct Side {
    /// The link that carries the frame; `None` is the world.
    pub link: Option<usize>,
    /// The frame on that link.
    pub placement: Placement,
}

/// A loop closure.
#[derive(Clone, Debug)]
pub struct Cut {
    /// Its name.
    pub name: String,
    /// The joint that was opened.
    pub kind: CutKind,
    /// How far it slides when it turns, m per radian, where the two are tied.
    pub lead: Option<Quantity>,
    /// Frame A, then frame B.
    pub sides: [Side; 2],
}

/// A limit of the angle between the z axes of two frames.
#[derive(Clone, Debug)]
pub struct SwingLimit {
    /// The joint or the cut.
    pub name: String,
    /// The greatest angle, rad.
    pub greatest: Number,
    /// The two frames.
    pub sides: [Side; 2],
}

/// A coordinate tied linearly to others: `key = constant + sum`.
#[derive(Clone, Debug)]
pub struct Coupling {
    /// The tied coordinate.
    pub key: usize,
    /// The constant part.
    pub constant: Number,
    /// Other coordinates with their factors.
    pub terms: Vec<(usize, Number)>,
}

/// A mechanism ready to be derived.
#[derive(Clone, Debug)]
pub struct Model {
    /// Gravity in the world frame, m/s^2.
    pub gravity: [Quantity; 3],
    /// Frames, parents before children.
    pub links: Vec<Link>,
    /// Coordinates in the spec's order.
    pub coordinates: Vec<Coordinate>,
    /// Bodies in the order of declaration.
    pub bodies: Vec<Body>,
    /// Loop closures in the spec's order.
    pub cuts: Vec<Cut>,
    /// Cones of joints in the order of coordinates, then of cuts.
    pub cones: Vec<SwingLimit>,
    /// Linear ties in the spec's order.
    pub couplings: Vec<Coupling>,
    /// Independent coordinates, in the order given.
    pub independent: Vec<usize>,
    /// The other coordinates, in the order of coordinates.
    pub dependent: Vec<usize>,
    /// Actuated coordinates, in the order of coordinates.
    pub actuated: Vec<usize>,
    /// Start of the closure by coordinate.
    pub home: Vec<Number>,
    /// The dynamic parameters in order.
    pub parameters: Vec<Parameter>,
}

impl Model {
    /// The links from the world's side down to `link`, itself included.
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

    /// The motion that a coordinate gives its link.
    pub fn motion(&self, coordinate: usize) -> Option<&Motion> {
        self.links[self.coordinates[coordinate].link]
            .motion
            .as_ref()
    }

    /// Whether a coordinate is a length; else it is an angle.
    pub fn slides(&self, coordinate: usize) -> bool {
        self.motion(coordinate)
            .is_some_and(|m| m.kind == MotionKind::Translation)
    }

    /// How many closure rows there are: those of all cuts, then one per coupling.
    pub fn rows(&self) -> usize {
        let cuts = self.cuts.iter().map(|cut| cut.kind.rows().len());
        cuts.sum::<usize>() + self.couplings.len()
    }

    /// Whether the mechanism has loops or ties.
    pub fn is_closed(&self) -> bool {
        !self.cuts.is_empty() || !self.couplings.is_empty()
    }
}
