//! Partial velocities: the velocity of each link for a unit rate of a coordinate. In the
//! Gibbs-Appell equations these are the derivatives of the links' accelerations with respect to the
//! coordinate's acceleration (Eq. 1).

use crate::model::{Model, Motion, MotionKind};
use crate::sym::{Graph, V3, ZERO3};

use super::{Frames, Geometry, unit};

/// The velocity of a link for a unit rate of a coordinate, in the link's frame at its origin.
#[derive(Clone, Copy, Debug)]
pub struct Twist {
    /// Angular velocity per unit rate.
    pub e: V3,
    /// Velocity of the link's origin per unit rate.
    pub u: V3,
}

impl Twist {
    /// The unit twist of a motion in the frame of the link that it moves.
    pub fn of_motion(g: &mut Graph, motion: &Motion, geometry: &Geometry) -> Twist {
        let axis = unit(motion.axis);
        match (motion.kind, &motion.lead) {
            (MotionKind::Rotation, None) => Twist { e: axis, u: ZERO3 },
            (MotionKind::Rotation, Some(lead)) => {
                let lead = geometry.length(g, lead);
                let u = g.scale3(lead, &axis);
                Twist { e: axis, u }
            }
            (MotionKind::Translation, _) => Twist { e: ZERO3, u: axis },
        }
    }

    /// Whether the link rotates.
    pub fn turns(&self) -> bool {
        self.e != ZERO3
    }

    /// Whether the link's origin moves.
    pub fn slides(&self) -> bool {
        self.u != ZERO3
    }

    /// The twist at the origin and in the frame of a child link.
    #[must_use]
    pub fn carried(&self, g: &mut Graph, frames: &Frames, link: usize) -> Twist {
        let lever = g.cross(&self.e, &frames.links[link].offset);
        let u = g.add3(&self.u, &lever);
        Twist {
            e: frames.into_link(g, link, &self.e),
            u: frames.into_link(g, link, &u),
        }
    }
}

/// For each link, the coordinates that move it, from the base outward, and a twist of each, carried to the
/// link.
///
/// - `of_joint`: the twist of a link's own joint, in the link's frame, from the link and its unit twist.
pub fn carried_outward(
    g: &mut Graph,
    frames: &Frames,
    mut of_joint: impl FnMut(&mut Graph, usize, &Twist) -> Twist,
) -> Vec<Vec<(usize, Twist)>> {
    let mut all: Vec<Vec<(usize, Twist)>> = Vec::new();
    for (link, frame) in frames.links.iter().enumerate() {
        let inherited = frame.parent.map_or_else(Vec::new, |p| all[p].clone());
        let mut own: Vec<(usize, Twist)> = inherited
            .into_iter()
            .map(|(c, t)| (c, t.carried(g, frames, link)))
            .collect();
        if let Some(joint) = frame.joint {
            own.push((joint.coordinate, of_joint(g, link, &joint.twist)));
        }
        all.push(own);
    }
    all
}

/// For each link, the coordinates that move it, from the base outward, and their unit twists.
pub fn twists(g: &mut Graph, frames: &Frames, model: &Model) -> Vec<Vec<(usize, Twist)>> {
    let all = carried_outward(g, frames, |_, _, twist| *twist);
    for (link, own) in all.iter().enumerate() {
        for (coordinate, twist) in own {
            let (link, coordinate) = (
                &model.links[link].name,
                &model.coordinates[*coordinate].name,
            );
            for (axis, letter) in ["x", "y", "z"].iter().enumerate() {
                g.name(twist.e[axis], || format!("e_{link}_{coordinate}{letter}"));
                g.name(twist.u[axis], || format!("u_{link}_{coordinate}{letter}"));
            }
        }
    }
    all
}
