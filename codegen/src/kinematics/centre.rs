//! Points at which joint axes meet: the shoulder or the wrist of an arm, a universal joint.
//!
//! All joints whose axes meet at a point move a link's origin by `e x arm`, with the same arm, so
//! that their effect on the link can be computed about that point at once.

use crate::model::Model;
use crate::sym::{Ex, Graph, V3};

use super::Frames;

/// A point at which joint axes meet, in the frame of a link that these joints move.
#[derive(Clone, Debug)]
pub struct Centre {
    /// The vector from the point to the link's origin, in the link's frame, m.
    pub arm: V3,
    /// The coordinates whose axes pass through the point, from the base outward.
    pub coordinates: Vec<usize>,
}

/// For each link, the points at which axes of two or more joints before it meet. A point is found
/// if the axes of two neighbours meet; joints further out are added if their axes pass through it.
/// Only axes exactly along an axis of their frame are found.
pub fn centres(g: &mut Graph, frames: &Frames, model: &Model) -> Vec<Vec<Centre>> {
    let mut all: Vec<Vec<Centre>> = Vec::new();
    for (link, frame) in frames.links.iter().enumerate() {
        let mut own = frame.parent.map_or_else(Vec::new, |p| all[p].clone());
        for centre in &mut own {
            let arm = g.add3(&centre.arm, &frame.offset);
            centre.arm = frames.into_link(g, link, &arm);
        }
        let turn = |link: usize| {
            let joint = frames.links[link].joint?;
            let twist = joint.twist;
            (twist.turns() && !twist.slides()).then_some((joint.coordinate, twist.e))
        };
        if let Some((coordinate, axis)) = turn(link) {
            let through = |arm: &V3| {
                let beside = arm.iter().zip(&axis).filter(|(_, on)| on.is_zero());
                beside.into_iter().all(|(length, _)| length.is_zero())
            };
            for centre in own.iter_mut().filter(|c| through(&c.arm)) {
                centre.coordinates.push(coordinate);
            }
            if let Some((before, along)) = frame.parent.and_then(turn) {
                // candidate: the point of the previous axis nearest to this joint; drop the
                // component along that axis
                let mut arm = frame.offset;
                for (length, on) in arm.iter_mut().zip(&along) {
                    if !on.is_zero() {
                        *length = Ex::ZERO;
                    }
                }
                let arm = frames.into_link(g, link, &arm);
                let pair = [before, coordinate];
                let known = |c: &Centre| pair.iter().all(|p| c.coordinates.contains(p));
                if through(&arm) && !own.iter().any(known) {
                    let coordinates = pair.to_vec();
                    own.push(Centre { arm, coordinates });
                }
            }
        }
        let name = &model.links[link].name;
        for (number, centre) in own.iter().enumerate() {
            for (axis, letter) in ["x", "y", "z"].iter().enumerate() {
                g.name(centre.arm[axis], || format!("arm{number}_{name}{letter}"));
            }
        }
        all.push(own);
    }
    all
}
