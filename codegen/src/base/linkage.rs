//! The mechanism as a graph of bodies connected by joints, cut joints included, from which spanning
//! trees are chosen.

use crate::model::{Model, MotionKind};
use crate::spec::Spec;

use super::field::{Element, Field};
use super::geometry::{Names, Placed};
use super::rates;
use super::span::Vector;

/// One element of the connection between two bodies.
#[derive(Clone, Debug)]
pub(super) enum Stage {
    /// A constant change of frame.
    Fixed(Box<Placed>),
    /// A motion about or along an axis of the frame before it.
    Moving {
        kind: MotionKind,
        axis: usize,
        /// Translation along the axis per radian of rotation, of a helical joint.
        lead: Option<Element>,
        /// Whether the joint is passed from its moving side, so that its rate changes sign.
        backward: bool,
        /// The coordinate; `None` for cut joints.
        coordinate: Option<usize>,
        /// The direction in the parameters in which only the rotor's inertia at the joint grows.
        rotor: Option<Vector>,
        /// The direction in the parameters in which only the joint's constant effort grows.
        offset: Option<Vector>,
    },
}

/// A connection between two bodies; body 0 is the ground, body i + 1 the model's i-th.
#[derive(Clone, Debug)]
pub(super) struct Edge {
    pub(super) ends: (usize, usize),
    pub(super) stages: Vec<Stage>,
    /// Whether the connection belongs to the tree of the spec; cut joints do not.
    pub(super) in_spec_tree: bool,
}

/// The graph of bodies and connections.
#[derive(Clone, Debug)]
pub(super) struct Linkage {
    pub(super) bodies: usize,
    pub(super) edges: Vec<Edge>,
    pub(super) gravity: [Element; 3],
    /// The velocity constraint of each coupling: the sum of these factors times rates is 0.
    pub(super) couplings: Vec<Vector>,
    /// The constant part of each coupling, in rad or m.
    pub(super) coupling_constants: Vec<Element>,
    /// The geometry names.
    pub(super) names: Names,
}

fn fixed(placed: Placed) -> Stage {
    Stage::Fixed(Box::new(placed))
}

impl Linkage {
    pub(super) fn new(field: &mut Field, spec: &Spec, model: &Model) -> Self {
        let names = Names::new(field, spec);
        let gravity = model.gravity.clone().map(|q| names.element(field, &q));
        let mut couplings = Vec::new();
        let mut coupling_constants = Vec::new();
        for (coupling, (_, written)) in model.couplings.iter().zip(&spec.couplings) {
            let mut constraint = Vector::from([(coupling.key, Element::one())]);
            for ((coordinate, _), (_, factor)) in coupling.terms.iter().zip(&written.terms) {
                constraint.insert(*coordinate, names.element(field, factor).neg());
            }
            couplings.push(constraint);
            coupling_constants.push(names.element(field, &written.constant));
        }
        let node = |link: Option<usize>| -> usize {
            let body = link.and_then(|l| model.bodies.iter().position(|b| b.link == l));
            body.map_or(0, |b| b + 1)
        };
        let mut edges = Vec::new();
        for (index_of_body, body) in model.bodies.iter().enumerate() {
            // inward to the next body or the ground
            let mut chain = vec![body.link];
            let mut at = model.links[body.link].parent;
            while let Some(link) = at {
                if node(Some(link)) != 0 {
                    break;
                }
                chain.push(link);
                at = model.links[link].parent;
            }
            let mut stages = Vec::new();
            for link in chain.into_iter().rev() {
                let link = &model.links[link];
                stages.push(fixed(Placed::new(field, &names, &link.placement)));
                if let Some(motion) = &link.motion {
                    stages.push(Stage::Moving {
                        kind: motion.kind,
                        axis: motion.axis.index(),
                        lead: motion.lead.as_ref().map(|lead| names.element(field, lead)),
                        backward: false,
                        coordinate: Some(motion.coordinate),
                        rotor: rates::rotor(field, model, &couplings, motion.coordinate),
                        offset: rates::offset(field, model, &couplings, motion.coordinate),
                    });
                }
            }
            edges.push(Edge {
                ends: (node(at), index_of_body + 1),
                stages,
                in_spec_tree: true,
            });
        }
        for cut in &model.cuts {
            let [a, b] = &cut.sides;
            let mut stages = vec![fixed(Placed::new(field, &names, &a.placement))];
            stages.extend(
                cut.kind
                    .joint()
                    .motions()
                    .iter()
                    .map(|(kind, axis)| Stage::Moving {
                        kind: *kind,
                        axis: axis.index(),
                        lead: cut.lead.as_ref().map(|lead| names.element(field, lead)),
                        backward: false,
                        coordinate: None,
                        rotor: None,
                        offset: None,
                    }),
            );
            let last = Placed::new(field, &names, &b.placement).inverse(field);
            stages.push(fixed(last));
            edges.push(Edge {
                ends: (node(a.link), node(b.link)),
                stages,
                in_spec_tree: false,
            });
        }
        Linkage {
            bodies: model.bodies.len(),
            edges,
            gravity,
            couplings,
            coupling_constants,
            names,
        }
    }
}

impl Edge {
    /// The elements of the connection in the order in which they are met from the end `start`.
    pub(super) fn stages_from(&self, field: &mut Field, start: usize) -> Vec<Stage> {
        if self.ends.0 == start {
            return self.stages.clone();
        }
        let reversed = self.stages.iter().rev();
        reversed
            .map(|stage| match stage {
                Stage::Fixed(placed) => fixed(placed.inverse(field)),
                // the span of a motion does not depend on its sign, but terms linear in its rate do
                moving @ Stage::Moving { .. } => {
                    let mut moving = moving.clone();
                    if let Stage::Moving { backward, .. } = &mut moving {
                        *backward = !*backward;
                    }
                    moving
                }
            })
            .collect()
    }

    /// The body at the other end; `None` where `end` is neither of the two.
    pub(super) fn other(&self, end: usize) -> Option<usize> {
        match self.ends {
            (a, b) if a == end => Some(b),
            (a, b) if b == end => Some(a),
            _ => None,
        }
    }
}
