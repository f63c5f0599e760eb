//! Frames of joints, in the links of a file and as Denavit-Hartenberg rows of a spec.

use crate::layout::{Draft, DraftJoint};
use crate::pose::{Pose, ROUNDING_TOLERANCE, V3, about, clean, norm, times, unit};
use crate::tree::{Joint, Kind, Tree};

/// The joint's frame in its link's frame, with the origin on the anchor, and the coordinate axis
/// that is the joint's axis.
pub(crate) fn joint_frame(joint: &Joint) -> (Pose, char) {
    let shift = Pose::shift(joint.anchor);
    if joint.kind == Kind::Spherical {
        return (shift, 'z');
    }
    let [x, y, z] = joint.axis;
    let small = |a: f64, b: f64| a.abs() < ROUNDING_TOLERANCE && b.abs() < ROUNDING_TOLERANCE;
    // a half turn, which reverses the axis
    let half = |axis: V3| Pose::turn(about(axis, std::f64::consts::PI));
    let turn = |roll: f64, yaw: f64| Pose::from_rpy([0.0; 3], [roll, 0.0, yaw]);
    let pi = std::f64::consts::PI;
    let (turned, axis) = if small(x, y) {
        (
            if z > 0.0 {
                Pose::default()
            } else {
                turn(pi, 0.0)
            },
            'z',
        )
    } else if small(x, z) {
        (
            if y > 0.0 {
                Pose::default()
            } else {
                turn(pi, 0.0)
            },
            'y',
        )
    } else if small(y, z) {
        (
            if x > 0.0 {
                Pose::default()
            } else {
                turn(0.0, pi)
            },
            'x',
        )
    } else {
        // the shortest rotation of z onto the axis
        let across = unit([-y, x, 0.0]);
        let angle = libm::atan2(libm::hypot(x, y), z);
        let turned = across.map_or_else(|| half([1.0, 0.0, 0.0]), |a| Pose::turn(about(a, angle)));
        (turned, 'z')
    };
    (shift.then(&turned), axis)
}

/// The unit vector of an axis.
pub(crate) fn axis_vector(axis: char) -> V3 {
    match axis {
        'x' => [1.0, 0.0, 0.0],
        'y' => [0.0, 1.0, 0.0],
        _ => [0.0, 0.0, 1.0],
    }
}

/// The displacement of a joint for a value of its coordinate (rad or m), in the joint's frame.
pub(crate) fn motion(kind: Kind, axis: char, q: f64) -> Pose {
    match kind {
        _ if q == 0.0 => Pose::default(),
        Kind::Prismatic => Pose::shift(axis_vector(axis).map(|a| a * q)),
        Kind::Revolute if axis == 'z' => Pose::from_rpy([0.0; 3], [0.0, 0.0, q]),
        Kind::Revolute => Pose::turn(about(axis_vector(axis), q)),
        _ => Pose::default(),
    }
}

/// The pose of a link in the world, for the values (rad or m) of the spec's coordinates.
pub(crate) fn at(tree: &Tree, draft: &Draft, link: usize, value: &dyn Fn(&str) -> f64) -> Pose {
    let mut chain = Vec::new();
    let mut next = Some(link);
    while let Some(link) = next.and_then(|l| tree.links.get(l)) {
        chain.push(link);
        next = link.parent;
    }
    let drawn: Vec<&DraftJoint> = draft.limbs.iter().flat_map(|l| &l.joints).collect();
    let coordinate = |joint: &Joint| {
        let found = drawn
            .iter()
            .find(|d| d.from.as_ref().is_some_and(|f| f.name == joint.name));
        found.and_then(|d| d.name.as_deref())
    };
    let mut pose = Pose::default();
    for link in chain.into_iter().rev() {
        pose = pose.then(&link.pose);
        for joint in link.joints.iter().flat_map(Joint::parts) {
            let (frame, axis) = joint_frame(&joint);
            let q =
                |suffix: &str| coordinate(&joint).map_or(0.0, |n| value(&format!("{n}{suffix}")));
            let moved = if joint.kind == Kind::Spherical {
                Pose::turn(crate::pose::from_rpy([q(".3"), q(".2"), q(".1")]))
            } else {
                motion(joint.kind, axis, q("") - joint.reference)
            };
            pose = pose.then(&frame).then(&moved).then(&frame.inverse());
        }
    }
    pose
}

/// The pose as a modified Denavit-Hartenberg row alpha, a, d, theta; `None` if no such row gives it.
pub(crate) fn denavit_hartenberg(pose: &Pose) -> Option<[f64; 4]> {
    let r = &pose.r;
    // R = Rx(alpha) Rz(theta)
    if r[0][2].abs() > ROUNDING_TOLERANCE {
        return None;
    }
    let alpha = libm::atan2(-r[1][2], r[2][2]);
    let theta = libm::atan2(-r[0][1], r[0][0]);
    // p = Rx(alpha) (a, 0, d)
    let back = times(&about([1.0, 0.0, 0.0], -alpha), pose.p);
    let [a, across, d] = clean(back, norm(pose.p));
    (across.abs() <= ROUNDING_TOLERANCE * norm(pose.p)).then(|| match pose.rpy() {
        // a single rotation keeps the angle that the file gives, without the rounding of atan2
        [roll, 0.0, 0.0] => [roll, a, d, 0.0],
        [0.0, 0.0, yaw] => [0.0, a, d, yaw],
        _ => [alpha, a, d, theta],
    })
}
