//! The mechanism as bodies joined by joints, cut joints among them: what
//! spanning trees are chosen from.

use crate::model::{FrictionColumn, Model, MotionKind, ParameterKind};
use crate::spec::Spec;

use super::field::{Element, Field};
use super::geometry::{Names, Placed};

/// One stage on the way from a body to the next.
#[derive(Clone, Debug)]
pub(super) enum Stage {
    /// A constant change of frame.
    Fixed(Box<Placed>),
    /// A motion about or along an axis of the frame reached.
    Moving {
        kind: MotionKind,
        axis: usize,
        /// How far a rotation slides along the axis as well, per radian.
        lead: Option<Element>,
        /// Whether it is passed from its moved side: rates change their sign.
        backward: bool,
        /// The coordinate; cuts have none.
        coordinate: Option<usize>,
        /// Column of the rotor parameter.
        rotor: Option<usize>,
        /// Columns of Fc+ and Fc-.
        coulomb: Option<(usize, usize)>,
    },
}

/// A joint between two bodies; body 0 is the ground, body i + 1 the model's i-th.
#[derive(Clone, Debug)]
pub(super) struct Edge {
    pub(super) ends: (usize, usize),
    pub(super) stages: Vec<Stage>,
    /// Whether the spec's tree has it (cuts are not in it).
    pub(super) in_spec_tree: bool,
}

/// Bodies and joints.
#[derive(Clone, Debug)]
pub(super) struct Linkage {
    pub(super) bodies: usize,
    pub(super) edges: Vec<Edge>,
    pub(super) gravity: [Element; 3],
}

fn fixed(placed: Placed) -> Stage {
    Stage::Fixed(Box::new(placed))
}

impl Linkage {
    pub(super) fn new(field: &mut Field, spec: &Spec, model: &Model) -> Self {
        let names = Names::new(field, spec);
        let gravity = model.gravity.clone().map(|q| names.element(field, &q));
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
                        rotor: rotor_column(model, motion.coordinate),
                        coulomb: coulomb_columns(model, motion.coordinate),
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
                        coulomb: None,
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
        }
    }
}

impl Edge {
    /// The stages from one end to the other.
    pub(super) fn stages_from(&self, field: &mut Field, start: usize) -> Vec<Stage> {
        if self.ends.0 == start {
            return self.stages.clone();
        }
        let reversed = self.stages.iter().rev();
        reversed
            .map(|stage| match stage {
                Stage::Fixed(placed) => fixed(placed.inverse(field)),
                // the sign of a motion does not matter to a span, but to what its
                // rate alone is weighed against
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

    /// The other end.
    pub(super) fn other(&self, end: usize) -> Option<usize> {
        match self.ends {
            (a, b) if a == end => Some(b),
            (a, b) if b == end => Some(a),
            _ => None,
        }
    }
}

fn rotor_column(model: &Model, coordinate: usize) -> Option<usize> {
    let wanted = ParameterKind::Rotor { coordinate };
    model.parameters.iter().position(|p| p.kind == wanted)
}

fn coulomb_columns(model: &Model, coordinate: usize) -> Option<(usize, usize)> {
    let find = |column| {
        let wanted = ParameterKind::Friction { coordinate, column };
        model.parameters.iter().position(|p| p.kind == wanted)
    };
    let positive = find(FrictionColumn::CoulombPositive)?;
    Some((positive, find(FrictionColumn::CoulombNegative)?))
}
