//! A chain of links observed from one frame: positions, axes, and the accelerations at zero
//! accelerations of the coordinates. The closure equations are written with these.

use crate::sym::{Ex, Graph, IDENTITY, M3, V3, ZERO3};

use super::motion::{carried_along, half};
use super::{Frames, Rates, Twist};

/// The pose of the chain's first parent in the observing frame.
#[derive(Clone, Debug)]
pub struct Start {
    /// Rotation of the first parent's frame.
    pub rotation: M3,
    /// Origin of the first parent's frame.
    pub origin: V3,
}

impl Start {
    /// The pose if the first parent itself is the observing frame.
    pub fn own() -> Self {
        Start {
            rotation: IDENTITY,
            origin: ZERO3,
        }
    }
}

/// A joint of the chain in the observing frame.
#[derive(Clone, Copy, Debug)]
pub struct ChainJoint {
    /// Index of the joint's coordinate.
    pub coordinate: usize,
    /// The angular velocity of the links beyond the joint, and the velocity of their point at
    /// `origin`, for a unit rate.
    pub twist: Twist,
    /// Origin of the link that the joint moves, a point on the joint's axis.
    pub origin: V3,
}

/// The last link of a chain and its joints, in the observing frame.
#[derive(Clone, Debug)]
pub struct Chain {
    /// Rotation of the last link.
    pub rotation: M3,
    /// Origin of the last link.
    pub origin: V3,
    /// Joints from the base outward.
    pub joints: Vec<ChainJoint>,
    /// Angular velocity of the last link.
    pub w: V3,
    /// Angular reference velocity of the last link.
    pub wr: V3,
    /// Velocity of the last link's origin.
    pub v: V3,
    /// Reference velocity of the last link's origin.
    pub vr: V3,
    /// Angular acceleration of the last link at zero accelerations of the coordinates.
    pub alpha: V3,
    /// Acceleration of the last link's origin at zero accelerations of the coordinates.
    pub a: V3,
}

impl Chain {
    /// Follows `path`, a list of links each of which is the parent of the next. `rates` may be
    /// `None` if only the pose and the axes are needed.
    pub fn follow(
        g: &mut Graph,
        frames: &Frames,
        path: &[usize],
        start: &Start,
        rates: Option<&Rates>,
    ) -> Chain {
        let mut chain = Chain {
            rotation: start.rotation,
            origin: start.origin,
            joints: Vec::new(),
            w: ZERO3,
            wr: ZERO3,
            v: ZERO3,
            vr: ZERO3,
            alpha: ZERO3,
            a: ZERO3,
        };
        for &link in path {
            let frame = &frames.links[link];
            let arm = g.mul_mv(&chain.rotation, &frame.offset);
            let origin = g.add3(&chain.origin, &arm);
            let rotation = frames.rotate_columns(g, link, &chain.rotation);
            let (point_v, point_vr, point_a) = chain.point(g, &arm);
            chain.origin = origin;
            chain.rotation = rotation;
            (chain.v, chain.vr, chain.a) = (point_v, point_vr, point_a);
            let Some(joint) = frame.joint else {
                continue;
            };
            let coordinate = joint.coordinate;
            let twist = Twist {
                e: g.mul_mv(&chain.rotation, &joint.twist.e),
                u: g.mul_mv(&chain.rotation, &joint.twist.u),
            };
            chain.joints.push(ChainJoint {
                coordinate,
                twist,
                origin,
            });
            if let Some(rates) = rates {
                chain.move_joint(g, &twist, rates.qd[coordinate], rates.rd[coordinate]);
            }
        }
        chain
    }

    fn move_joint(&mut self, g: &mut Graph, Twist { e, u }: &Twist, qd: Ex, rd: Ex) {
        let turned = carried_along(g, (&self.w, &self.wr), e, (qd, rd));
        let slid = carried_along(g, (&self.w, &self.wr), u, (qd, rd));
        let half = half(g);
        self.alpha = g.add_scaled3(&self.alpha, half, &turned);
        self.w = g.add_scaled3(&self.w, qd, e);
        self.wr = g.add_scaled3(&self.wr, rd, e);
        self.a = g.add3(&self.a, &slid);
        self.v = g.add_scaled3(&self.v, qd, u);
        self.vr = g.add_scaled3(&self.vr, rd, u);
    }

    /// Velocity, reference velocity, and acceleration at zero accelerations of the coordinates, of
    /// the point of the last link that is `arm` away from its origin.
    pub fn point(&self, g: &mut Graph, arm: &V3) -> (V3, V3, V3) {
        let swing = g.cross(&self.w, arm);
        let swing_r = g.cross(&self.wr, arm);
        let v = g.add3(&self.v, &swing);
        let vr = g.add3(&self.vr, &swing_r);
        let tangential = g.cross(&self.alpha, arm);
        let a = g.add3(&self.a, &tangential);
        let centripetal = centripetal(g, &self.w, &self.wr, arm);
        let a = g.add3(&a, &centripetal);
        (v, vr, a)
    }
}

/// The symmetric bilinear form of w x (w x r) in w and wr.
pub fn centripetal(g: &mut Graph, w: &V3, wr: &V3, r: &V3) -> V3 {
    let inner = g.cross(wr, r);
    let one = g.cross(w, &inner);
    if w == wr {
        return one;
    }
    let inner = g.cross(w, r);
    let two = g.cross(wr, &inner);
    let sum = g.add3(&one, &two);
    let half = half(g);
    g.scale3(half, &sum)
}
