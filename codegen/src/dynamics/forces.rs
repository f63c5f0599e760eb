//! Inverse dynamics for given parameters without forming K: the inertial forces of the links are
//! computed from the base outward, the joint efforts inward.

use crate::kinematics::{Frames, LinkMotion, Rates, Twist};
use crate::model::Model;
use crate::sym::{Ex, Graph, V3, ZERO3};

use super::effort_column;

/// The ten inertial parameters of a body about its link's origin, in the link's frame.
#[derive(Clone, Copy, Debug)]
pub struct Inertial {
    /// Inertia tensor about the origin, kg m^2: xx xy xz yy yz zz.
    pub tensor: [Ex; 6],
    /// First moments m r, kg m.
    pub moment: V3,
    /// Mass, kg.
    pub mass: Ex,
}

impl Inertial {
    /// The parameters of a massless body.
    pub const ZERO: Inertial = Inertial {
        tensor: [Ex::ZERO; 6],
        moment: ZERO3,
        mass: Ex::ZERO,
    };

    /// The parameters of a body, taken from the vector of all parameters.
    pub fn of_body(body: usize, phi: &[Ex]) -> Self {
        let p = &phi[10 * body..10 * body + 10];
        Inertial {
            tensor: [p[0], p[1], p[2], p[3], p[4], p[5]],
            moment: [p[6], p[7], p[8]],
            mass: p[9],
        }
    }

    /// `I v`, with the inertia tensor I.
    pub fn tensor_times(&self, g: &mut Graph, v: &V3) -> V3 {
        let [xx, xy, xz, yy, yz, zz] = self.tensor;
        [
            g.dot3(&[xx, xy, xz], v),
            g.dot3(&[xy, yy, yz], v),
            g.dot3(&[xz, yz, zz], v),
        ]
    }
}

/// A force and its moment about a link's origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wrench {
    pub(super) moment: V3,
    pub(super) force: V3,
}

impl Wrench {
    pub(super) const ZERO: Wrench = Wrench {
        moment: ZERO3,
        force: ZERO3,
    };

    pub(super) fn plus(&self, g: &mut Graph, other: &Wrench) -> Wrench {
        Wrench {
            moment: g.add3(&self.moment, &other.moment),
            force: g.add3(&self.force, &other.force),
        }
    }

    /// The same wrench about the parent's origin, in the parent's frame.
    pub(super) fn on_parent(&self, g: &mut Graph, frames: &Frames, link: usize) -> Wrench {
        let force = frames.into_parent(g, link, &self.force);
        let moment = frames.into_parent(g, link, &self.moment);
        let lever = g.cross(&frames.links[link].offset, &force);
        Wrench {
            moment: g.add3(&moment, &lever),
            force,
        }
    }

    /// The power of the wrench on a joint's unit twist.
    pub(super) fn along(&self, g: &mut Graph, twist: &Twist) -> Ex {
        let turning = g.dot3(&twist.e, &self.moment);
        let sliding = g.dot3(&twist.u, &self.force);
        g.add(turning, sliding)
    }
}

/// The effort of every joint of the tree, by coordinate: K phi with friction, offsets, rotors and
/// springs, N m or N.
pub fn joint_efforts(
    g: &mut Graph,
    frames: &Frames,
    model: &Model,
    motions: &[LinkMotion],
    rates: &Rates,
    phi: &[Ex],
) -> Vec<Ex> {
    let (mut efforts, _) = inertial_efforts(g, frames, model, motions, phi);
    add_other_efforts(g, frames, model, rates, phi, &mut efforts);
    efforts
}

/// The efforts of the links' inertial forces, by coordinate; and by link the inertial wrench of the
/// link and of all that it carries, about the link's origin in its frame.
pub(super) fn inertial_efforts(
    g: &mut Graph,
    frames: &Frames,
    model: &Model,
    motions: &[LinkMotion],
    phi: &[Ex],
) -> (Vec<Ex>, Vec<Wrench>) {
    let mut wrenches = vec![Wrench::ZERO; frames.links.len()];
    for (index, body) in model.bodies.iter().enumerate() {
        let inertial = Inertial::of_body(index, phi);
        let wrench = body_wrench(g, &motions[body.link], &inertial);
        wrenches[body.link] = wrenches[body.link].plus(g, &wrench);
    }
    let mut efforts = vec![Ex::ZERO; model.coordinates.len()];
    for link in (0..frames.links.len()).rev() {
        let wrench = wrenches[link];
        let frame = &frames.links[link];
        if let Some(joint) = frame.joint {
            efforts[joint.coordinate] = wrench.along(g, &joint.twist);
        }
        if let Some(parent) = frame.parent {
            let carried = wrench.on_parent(g, frames, link);
            wrenches[parent] = wrenches[parent].plus(g, &carried);
        }
    }
    (efforts, wrenches)
}

/// Adds the efforts of the parameters that belong to no body, by coordinate.
pub(super) fn add_other_efforts(
    g: &mut Graph,
    frames: &Frames,
    model: &Model,
    rates: &Rates,
    phi: &[Ex],
    efforts: &mut [Ex],
) {
    for (parameter, value) in model.parameters.iter().zip(phi) {
        for (coordinate, factor) in effort_column(g, model, frames, rates, parameter.kind) {
            let term = g.mul(factor, *value);
            efforts[coordinate] = g.add(efforts[coordinate], term);
        }
    }
}

/// The moment I alpha + w x I w + m r x a and the force m a + eta_tilde m r of a body.
fn body_wrench(g: &mut Graph, motion: &LinkMotion, inertial: &Inertial) -> Wrench {
    let inertia_moment = {
        let [xx, xy, xz, yy, yz, zz] = motion.ww;
        let [ixx, ixy, ixz, iyy, iyz, izz] = inertial.tensor;
        let tangential = inertial.tensor_times(g, &motion.alpha);
        // w x (I w), written with the products of w that the motion contains
        let x = {
            let difference = g.sub(izz, iyy);
            let squares = g.sub(yy, zz);
            let l = g.mul(difference, yz);
            let m = g.mul(iyz, squares);
            let p = g.mul(ixz, xy);
            let q = g.mul(ixy, xz);
            let sum = g.add(l, m);
            let sum = g.add(sum, p);
            g.sub(sum, q)
        };
        let y = {
            let difference = g.sub(ixx, izz);
            let squares = g.sub(zz, xx);
            let l = g.mul(difference, xz);
            let m = g.mul(ixz, squares);
            let p = g.mul(ixy, yz);
            let q = g.mul(iyz, xy);
            let sum = g.add(l, m);
            let sum = g.add(sum, p);
            g.sub(sum, q)
        };
        let z = {
            let difference = g.sub(iyy, ixx);
            let squares = g.sub(xx, yy);
            let l = g.mul(difference, xy);
            let m = g.mul(ixy, squares);
            let p = g.mul(iyz, xz);
            let q = g.mul(ixz, yz);
            let sum = g.add(l, m);
            let sum = g.add(sum, p);
            g.sub(sum, q)
        };
        g.add3(&tangential, &[x, y, z])
    };
    let lever = g.cross(&inertial.moment, &motion.a);
    let straight = g.scale3(inertial.mass, &motion.a);
    let swing = g.mul_mv(&motion.eta, &inertial.moment);
    Wrench {
        moment: g.add3(&inertia_moment, &lever),
        force: g.add3(&straight, &swing),
    }
}
