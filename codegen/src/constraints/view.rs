//! Kinematics of one side of a cut, expressed in an observing frame.

use crate::kinematics::{Chain, Frames, LinkMotion, Rates, Start, Twist};
use crate::model::Side;
use crate::sym::{Graph, M3, V3, ZERO3, transposed};

/// The velocities of a side's points for a unit rate of one coordinate.
#[derive(Clone, Copy, Debug)]
pub struct Column {
    /// Angular velocity, and linear velocity at the point `through`.
    twist: Twist,
    through: V3,
}

impl Column {
    /// The angular velocity for a unit rate.
    pub fn angular(&self) -> V3 {
        self.twist.e
    }

    /// The velocity of a point of the side for a unit rate.
    pub fn at(&self, g: &mut Graph, point: &V3) -> V3 {
        let Twist { e, u } = self.twist;
        if !self.twist.turns() {
            return u;
        }
        let arm = g.sub3(point, &self.through);
        let swing = g.cross(&e, &arm);
        g.add3(&u, &swing)
    }
}

/// One side of a cut, expressed in the observing frame.
#[derive(Clone, Debug)]
pub struct View {
    /// Origin of the cut's frame.
    pub point: V3,
    /// Axes of the cut's frame, one per row.
    pub axes: [V3; 3],
    /// The motion for a unit rate of each coordinate that moves the side.
    pub columns: Vec<(usize, Column)>,
    /// Angular velocity.
    pub w: V3,
    /// Angular reference velocity.
    pub wr: V3,
    /// Velocity of the point.
    pub v: V3,
    /// Reference velocity of the point.
    pub vr: V3,
    /// Angular acceleration at zero accelerations of the coordinates.
    pub alpha: V3,
    /// Acceleration of the point at zero accelerations of the coordinates.
    pub a: V3,
}

impl View {
    /// Expresses the side in the frame in which the first link's parent has the pose `start`.
    pub fn along(
        g: &mut Graph,
        frames: &Frames,
        path: &[usize],
        side: &Side,
        start: &Start,
        rates: Option<&Rates>,
    ) -> View {
        let (turn, shift) = frames.constant(g, &side.placement);
        let chain = Chain::follow(g, frames, path, start, rates);
        let arm = g.mul_mv(&chain.rotation, &shift);
        let rotation = g.mul_mm(&chain.rotation, &turn);
        let (v, vr, a) = chain.point(g, &arm);
        View {
            point: g.add3(&chain.origin, &arm),
            axes: transposed(&rotation),
            columns: chain
                .joints
                .iter()
                .map(|joint| {
                    let column = Column {
                        twist: joint.twist,
                        through: joint.origin,
                    };
                    (joint.coordinate, column)
                })
                .collect(),
            w: chain.w,
            wr: chain.wr,
            v,
            vr,
            alpha: chain.alpha,
            a,
        }
    }

    /// Expresses the side in the frame of its own link.
    pub fn own(
        g: &mut Graph,
        frames: &Frames,
        path: &[usize],
        side: &Side,
        rates: Option<&Rates>,
    ) -> View {
        let (turn, point) = frames.constant(g, &side.placement);
        let mut twists: Vec<(usize, Twist)> = Vec::new();
        let mut motion = LinkMotion::rest();
        for &link in path {
            twists = twists
                .into_iter()
                .map(|(c, t)| (c, t.carried(g, frames, link)))
                .collect();
            if let Some(joint) = frames.links[link].joint {
                twists.push((joint.coordinate, joint.twist));
            }
            if let Some(rates) = rates {
                motion = motion.carried(g, frames, link, rates);
            }
        }
        let columns: Vec<(usize, Column)> = twists
            .into_iter()
            .map(|(c, twist)| {
                let through = ZERO3;
                (c, Column { twist, through })
            })
            .collect();
        let (mut v, mut vr) = (ZERO3, ZERO3);
        if let Some(rates) = rates {
            for (coordinate, column) in &columns {
                let at = column.at(g, &point);
                v = g.add_scaled3(&v, rates.qd[*coordinate], &at);
                vr = g.add_scaled3(&vr, rates.rd[*coordinate], &at);
            }
        }
        let shift = g.mul_mv(&motion.eta, &point);
        View {
            point,
            axes: transposed(&turn),
            columns,
            w: motion.w,
            wr: motion.wr,
            v,
            vr,
            alpha: motion.alpha,
            a: g.add3(&motion.a, &shift),
        }
    }

    /// The pose of the first link's parent in the frame of the last link.
    pub fn back(g: &mut Graph, frames: &Frames, path: &[usize]) -> Start {
        let chain = Chain::follow(g, frames, path, &Start::own(), None);
        let rotation: M3 = transposed(&chain.rotation);
        let origin = g.mul_mv(&rotation, &chain.origin);
        Start {
            rotation,
            origin: g.neg3(&origin),
        }
    }
}
