//! Coordinates that a spec counts from another zero than the robot file does.

use regen_codegen::model::Model;

use super::{SAME_MOTION, link_of};
use crate::frames::{self, axis_vector, joint_frame};
use crate::layout::Draft;
use crate::pose::{Pose, about, difference, norm};
use crate::tree::{Kind, Tree};

/// For each coordinate of the spec, its value in the robot file less its value in the spec, rad or
/// m.
///
/// `None` unless the spec has the frames that the importer chose, except for rotations about and
/// shifts along the joints' own axes. In a spec with other frames, an angle about a joint's axis
/// may belong to the body's frame instead; its zeros are then taken to be those of the file.
pub(super) fn shifts(model: &Model, tree: &Tree, draft: &Draft) -> Option<Vec<f64>> {
    let mut shifts = vec![0.0; model.coordinates.len()];
    let rest = vec![0.0; model.coordinates.len()];
    let names: Vec<&str> = model.coordinates.iter().map(|c| c.name.as_str()).collect();
    for (index, link) in tree.links.iter().enumerate() {
        let [joint] = link.joints.as_slice() else {
            continue;
        };
        if !matches!(joint.kind, Kind::Revolute | Kind::Prismatic) {
            continue;
        }
        let mut drawn = draft.limbs.iter().flat_map(|limb| &limb.joints);
        let own = drawn.find(|d| d.from.as_ref().is_some_and(|f| f.name == joint.name));
        let name = own.and_then(|d| d.name.as_deref());
        let Some(k) = names.iter().position(|n| Some(*n) == name) else {
            continue;
        };
        // parents come before their links, so that their shifts are known
        let at = |name: &str| {
            let place = names.iter().position(|n| *n == name);
            place.and_then(|k| shifts.get(k)).copied().unwrap_or(0.0)
        };
        let (frame, axis) = joint_frame(joint);
        let in_file = frames::at(tree, draft, index, &at).then(&frame);
        let in_spec = link_of(model, model.coordinates.get(k)?.link, &rest);
        let shift = along(joint.kind, axis, &in_file.inverse().then(&in_spec))?;
        if let Some(own) = shifts.get_mut(k)
            && shift.abs() > SAME_MOTION
        {
            *own = shift;
        }
    }
    Some(shifts)
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
