//! What both formats describe: a tree of links with joints, and what ties them
//! beyond the tree.

use crate::log::Place;
use crate::pose::{Pose, V3};

/// A robot as its file has it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tree {
    pub(crate) name: String,
    /// The root element.
    pub(crate) place: Place,
    /// How the header of the spec calls the format.
    pub(crate) format: &'static str,
    pub(crate) gravity: Option<V3>,
    /// Parents before children.
    pub(crate) links: Vec<Link>,
    pub(crate) closures: Vec<LoopCut>,
    pub(crate) couplings: Vec<Coupling>,
    /// Joints that a motor moves; empty where the file does not say.
    pub(crate) actuated: Vec<String>,
}

/// A link, and the joints between it and its parent.
#[derive(Clone, Debug)]
pub(crate) struct Link {
    pub(crate) name: String,
    pub(crate) place: Place,
    /// `None` is the world.
    pub(crate) parent: Option<usize>,
    /// Its frame in the parent's, at zero.
    pub(crate) pose: Pose,
    /// From the parent's side; none: fixed.
    pub(crate) joints: Vec<Joint>,
    pub(crate) inertia: Option<Inertia>,
}

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Revolute,
    Prismatic,
    Spherical,
    /// All six freedoms.
    Free,
    /// Two slides across the axis and the turn about it.
    Planar,
}

/// A joint, given in its link's frame.
#[derive(Clone, Debug)]
pub(crate) struct Joint {
    pub(crate) name: String,
    pub(crate) place: Place,
    pub(crate) kind: Kind,
    /// A unit vector.
    pub(crate) axis: V3,
    /// A point of the axis.
    pub(crate) anchor: V3,
    /// The coordinate's value at zero.
    pub(crate) reference: f64,
    pub(crate) position: Option<[f64; 2]>,
    pub(crate) velocity: Option<f64>,
    pub(crate) effort: Option<[f64; 2]>,
    /// Viscous friction.
    pub(crate) damping: f64,
    /// Coulomb friction.
    pub(crate) friction: f64,
    /// Inertia of rotor and drive at the joint.
    pub(crate) armature: f64,
    /// Part of a joint of several freedoms, which have no motors.
    pub(crate) passive: bool,
}

impl Joint {
    pub(crate) fn new(name: String, place: Place, kind: Kind) -> Self {
        Self {
            name,
            place,
            kind,
            axis: [0.0, 0.0, 1.0],
            anchor: [0.0; 3],
            reference: 0.0,
            position: None,
            velocity: None,
            effort: None,
            damping: 0.0,
            friction: 0.0,
            armature: 0.0,
            passive: false,
        }
    }

    /// The joints with at most one freedom, or a spherical one, that it is made of.
    pub(crate) fn parts(&self) -> Vec<Joint> {
        let part = |suffix: &str, kind: Kind, axis: V3| Joint {
            name: format!("{}{suffix}", self.name),
            kind,
            axis,
            passive: true,
            ..self.clone()
        };
        let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        match self.kind {
            Kind::Free => vec![
                part("_x", Kind::Prismatic, x),
                part("_y", Kind::Prismatic, y),
                part("_z", Kind::Prismatic, z),
                part("_turn", Kind::Spherical, z),
            ],
            Kind::Planar => {
                let [across, along] = across(self.axis);
                vec![
                    part("_x", Kind::Prismatic, across),
                    part("_y", Kind::Prismatic, along),
                    part("_turn", Kind::Revolute, self.axis),
                ]
            }
            _ => vec![self.clone()],
        }
    }
}

/// Two unit vectors that make a right-handed frame with a unit normal; the
/// coordinate axes where it is one.
fn across(normal: V3) -> [V3; 2] {
    use crate::pose::{cross, unit};
    let [x, y, z] = normal.map(f64::abs);
    let start = if z >= x && z >= y {
        [1.0, 0.0, 0.0]
    } else if x >= y {
        [0.0, 1.0, 0.0]
    } else {
        [0.0, 0.0, 1.0]
    };
    let second = unit(cross(normal, start)).unwrap_or(start);
    [cross(second, normal), second]
}

/// Inertia in the link's frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Inertia {
    pub(crate) mass: f64,
    pub(crate) com: V3,
    /// `xx xy xz yy yz zz` about the centre of mass, in the link's axes.
    pub(crate) tensor: [f64; 6],
}

impl Inertia {
    /// Whether there is nothing to move.
    pub(crate) fn is_zero(&self) -> bool {
        self.mass == 0.0 && self.tensor == [0.0; 6]
    }
}

/// A loop that is closed.
#[derive(Clone, Debug)]
pub(crate) struct LoopCut {
    pub(crate) name: String,
    /// The cut's joint type in the spec.
    pub(crate) kind: String,
    pub(crate) sides: [Side; 2],
}

/// A frame on a link, or on the world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Side {
    pub(crate) link: Option<usize>,
    pub(crate) pose: Pose,
}

/// `joint = constant + sum`.
#[derive(Clone, Debug)]
pub(crate) struct Coupling {
    pub(crate) joint: String,
    pub(crate) constant: f64,
    pub(crate) terms: Vec<(String, f64)>,
    pub(crate) place: Place,
}

impl Tree {
    /// A link's frame in the world at zero.
    pub(crate) fn at_zero(&self, link: Option<usize>) -> Pose {
        let mut pose = Pose::default();
        let mut at = link;
        while let Some(link) = at.and_then(|i| self.links.get(i)) {
            pose = link.pose.then(&pose);
            at = link.parent;
        }
        pose
    }

    pub(crate) fn find(&self, name: &str) -> Option<usize> {
        self.links.iter().position(|l| l.name == name)
    }
}
