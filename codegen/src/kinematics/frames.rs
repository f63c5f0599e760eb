//! The pose of each link's frame in its parent's: a sequence of rotations about coordinate axes,
//! and an offset.
//!
//! Rotations are applied one after the other, never multiplied out into a matrix: each costs four
//! products for a vector, and none if its angle is a multiple of a quarter turn.

use crate::model::{Model, MotionKind, Placement, Step};
use crate::spec::{Axis, Quantity};
use crate::sym::{Angle, Ex, Graph, M3, Number, V3, ZERO3};

use super::{Geometry, Twist};

/// A rotation about a coordinate axis.
#[derive(Clone, Copy, Debug)]
pub struct Turn {
    axis: Axis,
    sin: Ex,
    cos: Ex,
}

/// The frame of a link in its parent's.
#[derive(Clone, Debug)]
pub struct LinkFrame {
    /// Parent link; `None` is the world.
    pub parent: Option<usize>,
    /// The rotations between the parent's and the link's frame; that of the joint is merged with a
    /// constant one about the same axis before it.
    turns: Vec<Turn>,
    /// The constant rotations of the placement alone.
    placed: Vec<Turn>,
    /// The link's origin in the parent's frame, m.
    pub offset: V3,
    /// The joint that moves it; `None` for a fixed link.
    pub joint: Option<FrameJoint>,
}

/// A joint, described in the frame of the link that it moves.
#[derive(Clone, Copy, Debug)]
pub struct FrameJoint {
    /// Index of the joint's coordinate.
    pub coordinate: usize,
    /// The velocity of the link for a unit rate of the coordinate, in the link's frame at its
    /// origin, which is on the joint's axis. It is constant.
    pub twist: Twist,
}

/// The frames of all links, as expressions of the coordinates.
#[derive(Clone, Debug)]
pub struct Frames {
    /// The frame of each link, in the order of the model.
    pub links: Vec<LinkFrame>,
    /// Gravity in the world frame, m/s^2.
    pub gravity: V3,
    geometry: Geometry,
}

/// The unit vector of an axis.
pub fn unit(axis: Axis) -> V3 {
    let mut v = ZERO3;
    v[axis.index()] = Ex::ONE;
    v
}

impl Turn {
    /// Components of `v` before the rotation, from those in the rotated frame: `R v`.
    fn out(&self, g: &mut Graph, v: &V3) -> V3 {
        let (i, j) = match self.axis {
            Axis::X => (1, 2),
            Axis::Y => (2, 0),
            Axis::Z => (0, 1),
        };
        let mut r = *v;
        let (ci, sj) = (g.mul(self.cos, v[i]), g.mul(self.sin, v[j]));
        let (si, cj) = (g.mul(self.sin, v[i]), g.mul(self.cos, v[j]));
        r[i] = g.sub(ci, sj);
        r[j] = g.add(si, cj);
        r
    }

    /// Components of `v` in the rotated frame, from those before: `R^T v`.
    fn into(&self, g: &mut Graph, v: &V3) -> V3 {
        let back = Turn {
            sin: g.neg(self.sin),
            ..*self
        };
        back.out(g, v)
    }
}

/// The rotations of a placement and of a joint; neighbours about the same axis are merged into one.
fn merged(
    g: &mut Graph,
    geometry: &Geometry,
    placement: &Placement,
    joint: Option<(Axis, Angle)>,
) -> Vec<(Axis, Angle)> {
    let mut angles: Vec<(Axis, Angle)> = Vec::new();
    let steps = placement.iter().filter_map(|step| match step {
        Step::Rotate(axis, angle) => Some((*axis, geometry.angle(g, angle))),
        Step::Translate(..) => None,
    });
    for (axis, angle) in steps.chain(joint) {
        if angle.terms.is_empty() && angle.constant.is_zero() {
            continue;
        }
        match angles.last_mut() {
            Some((last, sum)) if *last == axis => *sum = sum.plus(&angle, &Number::one()),
            _ => angles.push((axis, angle)),
        }
    }
    angles
}

fn turns(g: &mut Graph, angles: Vec<(Axis, Angle)>) -> Vec<Turn> {
    let turn = |(axis, angle): (Axis, Angle)| {
        let (sin, cos) = g.sin_cos(&angle);
        Turn { axis, sin, cos }
    };
    angles.into_iter().map(turn).collect()
}

/// `R v` for a sequence of rotations.
fn apply_out(g: &mut Graph, turns: &[Turn], v: &V3) -> V3 {
    turns.iter().rev().fold(*v, |v, turn| turn.out(g, &v))
}

impl Frames {
    /// Builds the frames of a mechanism in the graph `g`.
    pub fn new(g: &mut Graph, model: &Model, geometry: Geometry) -> Self {
        let gravity = {
            let [x, y, z] = &model.gravity;
            [x, y, z].map(|q| geometry.length(g, q))
        };
        let mut frames = Frames {
            links: Vec::new(),
            gravity,
            geometry,
        };
        for link in &model.links {
            let name = |c: usize| model.coordinates[c].name.as_str();
            let joint = link.motion.as_ref().map(|m| FrameJoint {
                coordinate: m.coordinate,
                twist: Twist::of_motion(g, m, &frames.geometry),
            });
            let turning = link.motion.as_ref().and_then(|m| {
                (m.kind == MotionKind::Rotation).then(|| {
                    (
                        m.axis,
                        g.coordinate_angle(name(m.coordinate), &Number::zero()),
                    )
                })
            });
            let (fixed, mut offset) = frames.placement(g, &link.placement);
            if let Some(joint) = joint
                && joint.twist.slides()
            {
                let q = g.symbol(name(joint.coordinate));
                let slide = g.scale3(q, &joint.twist.u);
                let slide = apply_out(g, &fixed, &slide);
                offset = g.add3(&offset, &slide);
            }
            let angles = merged(g, &frames.geometry, &link.placement, turning);
            frames.links.push(LinkFrame {
                parent: link.parent,
                turns: turns(g, angles),
                placed: fixed,
                offset,
                joint,
            });
        }
        frames
    }

    /// Rotation and translation of a constant placement.
    fn placement(&self, g: &mut Graph, placement: &Placement) -> (Vec<Turn>, V3) {
        let mut offset = ZERO3;
        let mut so_far: Placement = Vec::new();
        for step in placement {
            match step {
                Step::Rotate(..) => so_far.push(step.clone()),
                Step::Translate(axis, quantity) => {
                    let shift = self.length(g, quantity);
                    let shift = g.scale3(shift, &unit(*axis));
                    let reached = merged(g, &self.geometry, &so_far, None);
                    let reached = turns(g, reached);
                    let shift = apply_out(g, &reached, &shift);
                    offset = g.add3(&offset, &shift);
                }
            }
        }
        let angles = merged(g, &self.geometry, &so_far, None);
        (turns(g, angles), offset)
    }

    /// Rotation matrix and translation of a constant placement.
    pub fn constant(&self, g: &mut Graph, placement: &Placement) -> (M3, V3) {
        let (turns, offset) = self.placement(g, placement);
        let columns = [Axis::X, Axis::Y, Axis::Z].map(|axis| apply_out(g, &turns, &unit(axis)));
        (crate::sym::transposed(&columns), offset)
    }

    /// Rotation matrix of a link in its parent's frame at zero motion of its joint.
    pub fn placed(&self, g: &mut Graph, link: usize) -> M3 {
        let turns = &self.links[link].placed;
        let columns = [Axis::X, Axis::Y, Axis::Z].map(|axis| apply_out(g, turns, &unit(axis)));
        crate::sym::transposed(&columns)
    }

    /// A length of the spec as an expression.
    pub fn length(&self, g: &mut Graph, quantity: &Quantity) -> Ex {
        self.geometry.length(g, quantity)
    }

    /// Components in the link's frame of a vector given in the parent's.
    pub fn into_link(&self, g: &mut Graph, link: usize, v: &V3) -> V3 {
        let turns = &self.links[link].turns;
        turns.iter().fold(*v, |v, turn| turn.into(g, &v))
    }

    /// Components in the parent's frame of a vector given in the link's.
    pub fn into_parent(&self, g: &mut Graph, link: usize, v: &V3) -> V3 {
        apply_out(g, &self.links[link].turns, v)
    }

    /// `M R`, with the rotation R of the link in its parent's frame.
    pub fn rotate_columns(&self, g: &mut Graph, link: usize, m: &M3) -> M3 {
        m.map(|row| self.into_link(g, link, &row))
    }
}
