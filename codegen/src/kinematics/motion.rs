//! Velocities and accelerations of the links in their own frames, computed from the base outward
//! (the recursion behind Eq. 1 and 4).
//!
//! Everything quadratic in the velocities is written as a symmetric bilinear form, with a second
//! set of velocities `rd`. With `rd = qd` it is the ordinary motion; with other `rd` it is the one
//! that passivity-based control needs, since the symmetric bilinear form of the Coriolis terms is
//! the one of the Christoffel symbols (Slotine and Li, 1987).

use crate::sym::{Ex, Graph, M3, Number, V3, ZERO3};

use super::{Frames, Twist};

/// Rates of the coordinates that a motion is computed for.
#[derive(Clone, Debug)]
pub struct Rates {
    /// Velocities, by coordinate.
    pub qd: Vec<Ex>,
    /// Reference velocities, by coordinate; equal to the velocities for the ordinary motion.
    pub rd: Vec<Ex>,
    /// Accelerations, by coordinate.
    pub qdd: Vec<Ex>,
    /// Whether gravity is included, as an upward acceleration of the base.
    pub gravity: bool,
}

/// The motion of a link: vectors in the link's frame, at its origin.
#[derive(Clone, Debug)]
pub struct LinkMotion {
    /// Angular velocity, rad/s.
    pub w: V3,
    /// Angular reference velocity, rad/s.
    pub wr: V3,
    /// Angular acceleration, rad/s^2.
    pub alpha: V3,
    /// Acceleration of the origin less gravity, m/s^2.
    pub a: V3,
    /// Symmetric products of the angular velocities w and wr: xx, xy, xz, yy, yz, zz.
    pub ww: [Ex; 6],
    /// eta tilde of Eq. 4: (alpha x) + (w x)(w x).
    pub eta: M3,
}

pub(super) fn half(g: &mut Graph) -> Ex {
    Number::ratio(1, 2).map_or(Ex::ONE, |h| g.constant(h))
}

/// `(x yr + xr y) / 2`.
fn polar(g: &mut Graph, x: Ex, y: Ex, xr: Ex, yr: Ex) -> Ex {
    let l = g.mul(x, yr);
    let r = g.mul(xr, y);
    let sum = g.add(l, r);
    let half = half(g);
    g.mul(half, sum)
}

/// The symmetric bilinear form of `2 w x (v qd)`, for a joint's axis v that rotates with w.
pub(super) fn carried_along(g: &mut Graph, (w, wr): (&V3, &V3), v: &V3, (qd, rd): (Ex, Ex)) -> V3 {
    let with_r = g.cross(w, v);
    let with_r = g.scale3(rd, &with_r);
    let with_q = g.cross(wr, v);
    let with_q = g.scale3(qd, &with_q);
    g.add3(&with_r, &with_q)
}

/// The motions of all links; `names` of the links, if given, name the expressions.
pub fn motions(
    g: &mut Graph,
    frames: &Frames,
    rates: &Rates,
    names: Option<&[String]>,
) -> Vec<LinkMotion> {
    let mut base = LinkMotion::rest();
    if rates.gravity {
        base.a = g.neg3(&frames.gravity);
    }
    let mut motions: Vec<LinkMotion> = Vec::new();
    for (link, frame) in frames.links.iter().enumerate() {
        let parent = frame.parent.map_or(&base, |p| &motions[p]);
        let motion = parent.carried(g, frames, link, rates);
        if let Some(names) = names {
            let name = &names[link];
            for (axis, letter) in ["x", "y", "z"].iter().enumerate() {
                g.name(motion.w[axis], || format!("w_{name}{letter}"));
                g.name(motion.alpha[axis], || format!("al_{name}{letter}"));
                g.name(motion.a[axis], || format!("a_{name}{letter}"));
            }
        }
        motions.push(motion);
    }
    motions
}

impl LinkMotion {
    /// The motion of a link at rest, without gravity.
    pub fn rest() -> Self {
        LinkMotion {
            w: ZERO3,
            wr: ZERO3,
            alpha: ZERO3,
            a: ZERO3,
            ww: [Ex::ZERO; 6],
            eta: [ZERO3; 3],
        }
    }

    /// The motion of a link whose parent moves like this.
    #[must_use]
    pub fn carried(&self, g: &mut Graph, frames: &Frames, link: usize, rates: &Rates) -> Self {
        let frame = &frames.links[link];
        let shift = g.mul_mv(&self.eta, &frame.offset);
        let a_parent = g.add3(&self.a, &shift);
        let mut w = frames.into_link(g, link, &self.w);
        let mut wr = frames.into_link(g, link, &self.wr);
        let mut alpha = frames.into_link(g, link, &self.alpha);
        let mut a = frames.into_link(g, link, &a_parent);
        if let Some(joint) = frame.joint {
            let (qd, rd) = (rates.qd[joint.coordinate], rates.rd[joint.coordinate]);
            let qdd = rates.qdd[joint.coordinate];
            let Twist { e, u } = joint.twist;
            let turned = carried_along(g, (&w, &wr), &e, (qd, rd));
            let slid = carried_along(g, (&w, &wr), &u, (qd, rd));
            let half = half(g);
            alpha = g.add_scaled3(&alpha, half, &turned);
            alpha = g.add_scaled3(&alpha, qdd, &e);
            a = g.add3(&a, &slid);
            a = g.add_scaled3(&a, qdd, &u);
            w = g.add_scaled3(&w, qd, &e);
            wr = g.add_scaled3(&wr, rd, &e);
        }
        let mut product = |i: usize, j: usize| polar(g, w[i], w[j], wr[i], wr[j]);
        let ww = [
            product(0, 0),
            product(0, 1),
            product(0, 2),
            product(1, 1),
            product(1, 2),
            product(2, 2),
        ];
        if let Some(known_column) = self.field_on_axis(g, frames, link) {
            alpha = alpha_beside_axis(g, &known_column, &ww, &alpha);
        }
        let eta = eta_tilde(g, &ww, &alpha);
        LinkMotion {
            w,
            wr,
            alpha,
            a,
            ww,
            eta,
        }
    }

    /// The column of the child link's eta tilde along its joint axis, where `self` is the motion of
    /// its parent: the acceleration, relative to the child's origin, of the point at unit distance
    /// along the axis, in the child's frame. The point belongs to both links, so that the parent's
    /// column need only be rotated. `None` if the child does not rotate relative to its parent, if
    /// its axis is along none of the parent's axes, or if too few operations would be saved.
    fn field_on_axis(&self, g: &mut Graph, frames: &Frames, link: usize) -> Option<OnAxis> {
        let twist = frames.links[link].joint?.twist;
        let axis = twist.e;
        let before = frames.into_parent(g, link, &axis);
        let is_along_one_axis = before.iter().filter(|e| !e.is_zero()).count() == 1;
        // a link that rotates about an axis of the base has few operations to save
        if !twist.turns() || !is_along_one_axis || self.w.iter().any(|e| e.is_zero()) {
            return None;
        }
        let k = axis.iter().position(|e| *e == Ex::ONE)?;
        let field = g.mul_mv(&self.eta, &before);
        let field = frames.into_link(g, link, &field);
        Some(OnAxis { k, field })
    }
}

/// A column of eta tilde that is known before the angular acceleration.
struct OnAxis {
    /// Index of the column.
    k: usize,
    field: V3,
}

/// The angular acceleration: its components across the axis from the known column, the component
/// along it as given.
fn alpha_beside_axis(g: &mut Graph, known_column: &OnAxis, ww: &[Ex; 6], alpha: &V3) -> V3 {
    let [_, xy, xz, _, yz, _] = *ww;
    let (i, j) = ((known_column.k + 1) % 3, (known_column.k + 2) % 3);
    // w_i w_k and w_j w_k
    let (ik, jk) = [(xy, xz), (yz, xy), (xz, yz)][known_column.k];
    let mut beside = *alpha;
    // the column is w_i w_k + alpha_j, w_j w_k - alpha_i
    beside[j] = g.sub(known_column.field[i], ik);
    beside[i] = g.sub(jk, known_column.field[j]);
    beside
}

/// eta tilde, (alpha x) + (w x)(w x), from the symmetric products of w.
fn eta_tilde(g: &mut Graph, ww: &[Ex; 6], alpha: &V3) -> M3 {
    let [xx, xy, xz, yy, yz, zz] = *ww;
    let mut diagonal = |p: Ex, q: Ex| {
        let sum = g.add(p, q);
        g.neg(sum)
    };
    let (d0, d1, d2) = (diagonal(yy, zz), diagonal(xx, zz), diagonal(xx, yy));
    [
        [d0, g.sub(xy, alpha[2]), g.add(xz, alpha[1])],
        [g.add(xy, alpha[2]), d1, g.sub(yz, alpha[0])],
        [g.sub(xz, alpha[1]), g.add(yz, alpha[0]), d2],
    ]
}
