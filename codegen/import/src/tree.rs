//! The content of robot files: a tree of links with joints, with couplings and loop closures.

use crate::frames::axis_vector;
use crate::log::Place;
use crate::pose::{Pose, UNIT, V3, about, onto, product};

/// A robot as described by its file.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tree {
    pub(crate) name: String,
    /// The place of the root element.
    pub(crate) place: Place,
    /// The format's name in the header of the spec.
    pub(crate) format: &'static str,
    pub(crate) gravity: Option<V3>,
    /// The links, parents before children.
    pub(crate) links: Vec<Link>,
    pub(crate) closures: Vec<LoopCut>,
    pub(crate) couplings: Vec<Coupling>,
    /// Actuated joints; empty if the file names none.
    pub(crate) actuated: Vec<String>,
    pub(crate) drives: Vec<Drive>,
    pub(crate) springs: Vec<Spring>,
    /// Frames with names of their own on links or on the world.
    pub(crate) frames: Vec<(String, Side)>,
    /// The units of the file, if it has others than SI.
    pub(crate) units: FileUnits,
}

/// The units of a USD file.
#[derive(Clone, Debug, Default)]
pub(crate) struct FileUnits {
    /// m of the file's length, and kg of its mass.
    pub(crate) meter: f64,
    pub(crate) kilogram: f64,
    /// For each link the scale of its prim.
    pub(crate) scales: Vec<V3>,
}

/// A spring between points of two links.
#[derive(Clone, Debug)]
pub(crate) struct Spring {
    pub(crate) name: String,
    pub(crate) place: Place,
    /// The two links (`None` is the world) with the points in their frames.
    pub(crate) ends: [(Option<usize>, V3); 2],
    /// The length of the relaxed spring, m.
    pub(crate) length: f64,
    /// N/m.
    pub(crate) stiffness: f64,
}

/// A motor whose coordinate is the sum of these multiples of joints' coordinates.
#[derive(Clone, Debug)]
pub(crate) struct Drive {
    pub(crate) name: String,
    pub(crate) place: Place,
    pub(crate) terms: Vec<(String, f64)>,
    /// Whether its coordinate is a length.
    pub(crate) slides: bool,
    /// Viscous friction, N m s/rad or N s/m.
    pub(crate) damping: f64,
    /// Coulomb friction, N m or N.
    pub(crate) friction: f64,
    /// Inertia on the motor's side, kg m^2 or kg.
    pub(crate) armature: f64,
    pub(crate) position: Option<[f64; 2]>,
    pub(crate) effort: Option<[f64; 2]>,
}

/// A link, and the joints between it and its parent.
#[derive(Clone, Debug)]
pub(crate) struct Link {
    pub(crate) name: String,
    pub(crate) place: Place,
    /// The parent's index; `None` is the world.
    pub(crate) parent: Option<usize>,
    /// The link's frame in the parent's, at zero.
    pub(crate) pose: Pose,
    /// The joints from the parent outwards; without joints the link is fixed.
    pub(crate) joints: Vec<Joint>,
    pub(crate) inertia: Option<Inertia>,
    /// Whether the link has mass that the file does not state: that of its meshes.
    pub(crate) unknown: bool,
}

impl Link {
    /// Whether the link has mass or inertia.
    pub(crate) fn is_massive(&self) -> bool {
        self.unknown || self.inertia.is_some_and(|inertia| !inertia.is_zero())
    }
}

/// The type of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Revolute,
    Prismatic,
    Spherical,
    /// Six degrees of freedom.
    Free,
    /// Two translations perpendicular to the axis and the rotation about it.
    Planar,
}

/// A joint; its axis and anchor are given in its link's frame.
#[derive(Clone, Debug)]
pub(crate) struct Joint {
    pub(crate) name: String,
    pub(crate) place: Place,
    pub(crate) kind: Kind,
    /// The axis as a unit vector.
    pub(crate) axis: V3,
    /// A point on the axis.
    pub(crate) anchor: V3,
    /// The value of the coordinate in the pose that the file draws, rad or m: MJCF's `ref`, 0 in
    /// URDF.
    pub(crate) reference: f64,
    pub(crate) position: Option<[f64; 2]>,
    pub(crate) velocity: Option<f64>,
    pub(crate) acceleration: Option<f64>,
    pub(crate) jerk: Option<f64>,
    pub(crate) effort: Option<[f64; 2]>,
    /// Viscous friction, N m s/rad or N s/m.
    pub(crate) damping: f64,
    /// Coulomb friction, N m or N.
    pub(crate) friction: f64,
    /// The stiffness of a spring at the joint, N m/rad or N/m; 0 without one.
    pub(crate) stiffness: f64,
    /// The value of the coordinate, counted as in the file, at which the spring is relaxed.
    pub(crate) spring_rest: f64,
    /// Inertia of rotor and drive, reflected to the joint, kg m^2 or kg.
    pub(crate) armature: f64,
    /// Whether the joint is part of one with several degrees of freedom; these are not actuated.
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
            acceleration: None,
            jerk: None,
            effort: None,
            damping: 0.0,
            friction: 0.0,
            stiffness: 0.0,
            spring_rest: 0.0,
            armature: 0.0,
            passive: false,
        }
    }

    /// Decomposes the joint into spherical joints and joints with one degree of freedom.
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
                Joint {
                    damping: 0.0,
                    friction: 0.0,
                    armature: 0.0,
                    ..part("_turn", Kind::Spherical, z)
                },
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

/// Two unit vectors that form a right-handed frame with a unit normal; coordinate axes if the
/// normal is one.
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

/// Mass, centre of mass and inertia tensor in the link's frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Inertia {
    pub(crate) mass: f64,
    pub(crate) com: V3,
    /// `xx xy xz yy yz zz` about the centre of mass, in the link's axes, kg m^2.
    pub(crate) tensor: [f64; 6],
}

impl Inertia {
    /// No mass and no inertia.
    pub(crate) const NONE: Inertia = Inertia {
        mass: 0.0,
        com: [0.0; 3],
        tensor: [0.0; 6],
    };

    /// Whether mass and inertia tensor are zero.
    pub(crate) fn is_zero(&self) -> bool {
        self.mass == 0.0 && self.tensor == [0.0; 6]
    }
}

/// A loop closure between two links.
#[derive(Clone, Debug)]
pub(crate) struct LoopCut {
    pub(crate) name: String,
    /// The cut's joint type in the spec.
    pub(crate) kind: String,
    pub(crate) sides: [Side; 2],
}

/// A frame on a link or on the world.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Side {
    pub(crate) link: Option<usize>,
    pub(crate) pose: Pose,
}

/// A coupling `joint = constant + sum of terms`.
#[derive(Clone, Debug)]
pub(crate) struct Coupling {
    pub(crate) joint: String,
    pub(crate) constant: f64,
    pub(crate) terms: Vec<(String, f64)>,
    pub(crate) place: Place,
}

impl Side {
    /// A frame that is given in this one.
    pub(crate) fn then(self, pose: &Pose) -> Self {
        Self {
            pose: self.pose.then(pose),
            ..self
        }
    }

    /// The same point of a link, with one of the frame's axes in a direction given in this frame.
    pub(crate) fn with_axis(self, axis: char, direction: V3) -> Self {
        if direction == axis_vector(axis) {
            return self;
        }
        let quarter = std::f64::consts::FRAC_PI_2;
        let onto_z = match axis {
            'x' => about([0.0, 1.0, 0.0], -quarter),
            'y' => about([1.0, 0.0, 0.0], quarter),
            _ => UNIT,
        };
        let turned = Pose::turn(product(&onto(direction), &onto_z));
        let pose = self.pose.then(&turned);
        Self { pose, ..self }
    }
}

impl Tree {
    /// The pose of a link in the world as the file draws the robot: at zero coordinates in URDF, at
    /// each joint's `ref` in MJCF.
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

    /// The frame of a name: that of a link, or one on a link.
    pub(crate) fn frame(&self, name: &str) -> Option<Side> {
        let link = self.find(name).map(|link| Side {
            link: Some(link),
            pose: Pose::default(),
        });
        let frames = || self.frames.iter().find(|(own, _)| own == name);
        link.or_else(|| frames().map(|(_, side)| *side))
    }

    /// The joint of a name.
    pub(crate) fn joint(&self, name: &str) -> Option<&Joint> {
        let mut joints = self.links.iter().flat_map(|link| &link.joints);
        joints.find(|joint| joint.name == name)
    }
}

#[cfg(test)]
mod tests {
    use super::across;
    use crate::pose::{cross, dot};

    #[test]
    fn any_normal_gets_a_right_handed_frame() {
        for normal in [
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.6, 0.8, 0.0],
            [0.0, -0.6, 0.8],
            [0.48, 0.6, 0.64],
        ] {
            let [first, second] = across(normal);
            assert!((dot(first, first) - 1.0).abs() < 1e-12, "{normal:?}");
            let third = cross(first, second);
            for (a, b) in third.iter().zip(normal) {
                assert!((a - b).abs() < 1e-12, "{normal:?}");
            }
        }
    }
}
