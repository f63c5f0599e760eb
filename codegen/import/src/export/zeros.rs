//! Coordinates that a spec counts from another zero than the robot file does, and joints of the file
//! that the spec has locked.

use regen_codegen::model::Model;

use super::{SAME_MOTION, link_of};
use crate::frames::{self, axis_vector, joint_frame};
use crate::layout::Draft;
use crate::pose::{Pose, about, difference, norm};
use crate::tree::{Joint, Kind, Tree};

/// The positions of the file's joints where all coordinates of the spec are 0.
#[derive(Clone, Debug, Default)]
pub(super) struct Zeros {
    /// For each coordinate of the spec, its value in the robot file less its value in the spec, rad
    /// or m.
    pub(super) shifts: Vec<f64>,
    /// The joints of the file without a coordinate in the spec, each by its coordinate's name with
    /// the value at which the spec has it locked, rad or m.
    pub(super) locked: Vec<(String, f64)>,
    /// Those of them for which this cannot be told.
    pub(super) unknown: Vec<String>,
}

impl Zeros {
    /// Compares the frames of a spec with those of a file.
    ///
    /// Unless the spec has the frames that the importer chose, except for rotations about and
    /// shifts along the joints' own axes, an angle about a joint's axis may belong to the body's
    /// frame instead: zeros are then taken to be those of the file.
    pub(super) fn new(model: &Model, tree: &Tree, draft: &Draft) -> Self {
        let mut found = Self {
            shifts: vec![0.0; model.coordinates.len()],
            ..Self::default()
        };
        let comparison = Comparison { model, tree, draft };
        let has_own_frames = comparison.run(&mut found).is_none();
        if has_own_frames {
            found.shifts.fill(0.0);
            let locked = found.locked.drain(..).map(|(name, _)| name);
            found.unknown.extend(locked);
        }
        found
    }

    /// The value of a file's coordinate: that of the spec's coordinate of this name, counted from the
    /// file's zero, or that of a locked joint.
    ///
    /// - `value`: the value of the spec's coordinate.
    pub(super) fn in_file(&self, model: &Model, name: &str, value: &dyn Fn(usize) -> f64) -> f64 {
        let place = model.coordinates.iter().position(|c| c.name == name);
        if let Some(k) = place {
            return value(k) + self.shifts.get(k).copied().unwrap_or(0.0);
        }
        let own = self.locked.iter().find(|(own, _)| own == name);
        own.map_or(0.0, |(_, value)| *value)
    }
}

/// A spec and the file that it describes.
struct Comparison<'a> {
    model: &'a Model,
    tree: &'a Tree,
    draft: &'a Draft,
}

impl Comparison<'_> {
    /// Finds all shifts and locked joints; `None` for a spec with frames of its own.
    fn run(&self, found: &mut Zeros) -> Option<()> {
        let mut result = Some(());
        // parents come before their links, so that their shifts are known
        for (index, link) in self.tree.links.iter().enumerate() {
            let [joint] = link.joints.as_slice() else {
                continue;
            };
            let Some(name) = self.name(joint) else {
                continue;
            };
            match self.coordinate(name) {
                Some(k) => {
                    let (frame, axis) = joint_frame(joint);
                    let in_file = self.in_file(index, found).then(&frame);
                    let moved = in_file.inverse().then(&self.in_spec(self.link_of(k)?));
                    match along(joint.kind, axis, &moved) {
                        Some(shift) if shift.abs() > SAME_MOTION => {
                            *found.shifts.get_mut(k)? = shift;
                        }
                        Some(_) => {}
                        None => result = None,
                    }
                }
                None => match self.locked_at(index, joint, found) {
                    Some(value) if value.abs() > SAME_MOTION => {
                        found.locked.push((name.to_owned(), value));
                    }
                    Some(_) => {}
                    None => found.unknown.push(name.to_owned()),
                },
            }
        }
        result
    }

    /// The name of the coordinate of a hinge or slide of the file.
    fn name(&self, joint: &Joint) -> Option<&str> {
        if !matches!(joint.kind, Kind::Revolute | Kind::Prismatic) {
            return None;
        }
        let mut drawn = self.draft.limbs.iter().flat_map(|limb| &limb.joints);
        let own = drawn.find(|d| d.from.as_ref().is_some_and(|f| f.name == joint.name));
        own.and_then(|d| d.name.as_deref())
    }

    /// The index of a coordinate of the spec.
    fn coordinate(&self, name: &str) -> Option<usize> {
        self.model.coordinates.iter().position(|c| c.name == name)
    }

    fn link_of(&self, coordinate: usize) -> Option<usize> {
        self.model.coordinates.get(coordinate).map(|c| c.link)
    }

    /// The pose of a link of the file at the zeros found so far.
    fn in_file(&self, link: usize, found: &Zeros) -> Pose {
        let value = |name: &str| found.in_file(self.model, name, &|_| 0.0);
        frames::at(self.tree, self.draft, link, &value)
    }

    fn in_spec(&self, link: usize) -> Pose {
        link_of(self.model, link, &vec![0.0; self.model.coordinates.len()])
    }

    /// The value at which the spec has a joint of the file locked: that which brings the next frame of
    /// the file to its place in the spec, a joint's or else a body's. `None` where the joint's motion
    /// alone brings none there, 0 where there is none to compare.
    fn locked_at(&self, index: usize, joint: &Joint, found: &Zeros) -> Option<f64> {
        let (frame, axis) = joint_frame(joint);
        let own = self.in_file(index, found).then(&frame);
        let pairs = self.behind(index, found);
        let moved = |(file, spec): &(Pose, Pose)| {
            let by = own.inverse().then(spec).then(&file.inverse()).then(&own);
            along(joint.kind, axis, &by)
        };
        match pairs.as_slice() {
            // of two locked joints without a body between, each may be at any value
            [] if self.is_before_locked(index) => None,
            [] => Some(0.0),
            pairs => pairs.iter().find_map(moved),
        }
    }

    /// Whether a joint without a coordinate in the spec is directly behind a link.
    fn is_before_locked(&self, index: usize) -> bool {
        let behind = self
            .tree
            .links
            .iter()
            .filter(|link| link.parent == Some(index));
        let mut joints = behind.flat_map(|link| &link.joints);
        joints.any(|joint| {
            self.name(joint)
                .is_some_and(|name| self.coordinate(name).is_none())
        })
    }

    /// The poses, in the file and in the spec, of the frames that move rigidly with a link: first those
    /// of joints behind it, then those of bodies.
    fn behind(&self, index: usize, found: &Zeros) -> Vec<(Pose, Pose)> {
        let mut rigid = vec![index];
        let (mut joints, mut bodies) = (Vec::new(), Vec::new());
        for (place, link) in self.tree.links.iter().enumerate().skip(index) {
            let is_behind = link.parent.is_some_and(|parent| rigid.contains(&parent));
            if place != index && !is_behind {
                continue;
            }
            if place != index && !link.joints.is_empty() {
                if let [joint] = link.joints.as_slice()
                    && let Some(k) = self.name(joint).and_then(|name| self.coordinate(name))
                    && let Some(own) = self.link_of(k)
                {
                    let file = self.in_file(place, found).then(&joint_frame(joint).0);
                    joints.push((file, self.in_spec(own)));
                }
                continue;
            }
            if place != index {
                rigid.push(place);
            }
            let label = self.draft.bodies.iter().find(|body| body.link == link.name);
            let own = self
                .model
                .bodies
                .iter()
                .find(|body| label.is_some_and(|label| label.label == body.label));
            if let Some(own) = own {
                bodies.push((self.in_file(place, found), self.in_spec(own.link)));
            }
        }
        joints.extend(bodies);
        joints
    }
}

/// The value of a joint's coordinate at which its motion is this pose; `None` if the pose is no
/// motion of the joint.
fn along(kind: Kind, axis: char, pose: &Pose) -> Option<f64> {
    let direction = axis_vector(axis);
    let by = if kind == Kind::Prismatic {
        pose.p.iter().zip(direction).map(|(p, a)| p * a).sum()
    } else {
        let (i, j) = match axis {
            'x' => (1, 2),
            'y' => (2, 0),
            _ => (0, 1),
        };
        libm::atan2(pose.r[j][i], pose.r[i][i])
    };
    let moved = if kind == Kind::Prismatic {
        Pose::shift(direction.map(|a| a * by))
    } else {
        Pose::turn(about(direction, by))
    };
    let turned = pose.r.iter().flatten().zip(moved.r.iter().flatten());
    let deviation = turned.fold(norm(difference(pose.p, moved.p)), |most: f64, (a, b)| {
        most.max((a - b).abs())
    });
    (deviation <= SAME_MOTION).then_some(by)
}
