//! Conversion of a tree of links into limbs of a spec: long serial chains, branches that start from
//! bodies, frames on the joints' axes.

use std::collections::{BTreeMap, BTreeSet};

use crate::frames::{joint_frame, motion};
use crate::log::{Log, Place};
use crate::names::Names;
use crate::physical::plausible;
use crate::pose::{Pose, V3, tensor_in};
use crate::tree::{Coupling, Drive, Inertia, Joint, Kind, Link, Side, Tree};

/// The content of the spec before it is written as text.
#[derive(Clone, Debug, Default)]
pub(crate) struct Draft {
    pub(crate) limbs: Vec<DraftLimb>,
    pub(crate) cuts: Vec<DraftCut>,
    pub(crate) couplings: Vec<DraftCoupling>,
    /// The drives, with the spec's names of themselves and of their joints.
    pub(crate) drives: Vec<Drive>,
    pub(crate) springs: Vec<DraftSpring>,
    pub(crate) bodies: Vec<DraftBody>,
    /// Coordinates that are not 0 at the zero configuration of the file's robot.
    pub(crate) home: Vec<(String, f64)>,
}

/// A coupling `key = constant + sum of terms`, with the spec's names.
#[derive(Clone, Debug)]
pub(crate) struct DraftCoupling {
    pub(crate) key: String,
    pub(crate) constant: f64,
    pub(crate) terms: Vec<(String, f64)>,
}

#[derive(Clone, Debug)]
pub(crate) struct DraftLimb {
    pub(crate) name: String,
    /// The body from which the limb starts; `None` is the world.
    pub(crate) from: Option<String>,
    pub(crate) joints: Vec<DraftJoint>,
}

#[derive(Clone, Debug)]
pub(crate) struct DraftJoint {
    /// The joint's name; `None` for a fixed joint.
    pub(crate) name: Option<String>,
    pub(crate) kind: &'static str,
    /// The joint's frame in the frame before it.
    pub(crate) pose: Pose,
    /// The joint's axis, `x`, `y` or `z`; compound and fixed joints have `z`.
    pub(crate) axis: char,
    pub(crate) body: Option<String>,
    /// The joint of the file.
    pub(crate) from: Option<Joint>,
}

#[derive(Clone, Debug)]
pub(crate) struct DraftCut {
    pub(crate) name: String,
    pub(crate) kind: String,
    /// The body's label (`None` is the world) and the frame on it.
    pub(crate) sides: [(Option<String>, Pose); 2],
}

/// A spring between points of two bodies.
#[derive(Clone, Debug)]
pub(crate) struct DraftSpring {
    pub(crate) name: String,
    /// The body's label (`None` is the world) and the point in the body's frame.
    pub(crate) ends: [(Option<String>, V3); 2],
    pub(crate) length: f64,
    pub(crate) stiffness: f64,
}

#[derive(Clone, Debug)]
pub(crate) struct DraftBody {
    pub(crate) label: String,
    /// The link's name in the file.
    pub(crate) link: String,
    /// The body's frame in the link's.
    pub(crate) frame: Pose,
    /// The inertia in the body's frame.
    pub(crate) inertia: Inertia,
    /// Whether the file does not state the inertia.
    pub(crate) unknown: bool,
}

impl Draft {
    /// The coordinate of a joint, which is given by its name in the file or in the spec.
    pub(crate) fn coordinate(&self, name: &str) -> Option<String> {
        let (joint, index) = name
            .split_once('.')
            .map_or((name, None), |(j, i)| (j, Some(i)));
        let mut joints = self.limbs.iter().flat_map(|l| &l.joints);
        let found = joints.find(|j| {
            let own = j.name.as_deref() == Some(joint);
            own || j.from.as_ref().is_some_and(|f| f.name == joint)
        })?;
        let name = found.name.clone()?;
        match (found.kind, index) {
            ("spherical", Some(index @ ("1" | "2" | "3"))) => Some(format!("{name}.{index}")),
            ("spherical", _) | (_, Some(_)) => None,
            _ => Some(name),
        }
    }

    /// The names of all coordinates.
    pub(crate) fn coordinates(&self) -> Vec<String> {
        let joints = self.limbs.iter().flat_map(|l| &l.joints);
        let names = joints.flat_map(|joint| {
            let name = joint.name.clone();
            let count = if joint.kind == "spherical" { 3 } else { 1 };
            (1..=count).filter_map(move |k| match count {
                1 => name.clone(),
                _ => name.as_ref().map(|n| format!("{n}.{k}")),
            })
        });
        names.collect()
    }
}

/// A link that is about to become part of a limb.
struct Node {
    /// The link that carries it; `None` is the world.
    parent: Option<usize>,
    /// The link's frame in the frame of the link that carries it, at zero.
    pose: Pose,
    joints: Vec<(Joint, Pose)>,
    /// The body's frame in the link's.
    frame: Pose,
    children: Vec<usize>,
    alive: bool,
    /// Number of joints on the longest chain outwards.
    depth: usize,
    label: Option<String>,
}

/// Converts a tree of links into limbs.
pub(crate) fn lay_out(tree: &Tree, log: &mut Log) -> Draft {
    let mut layout = LimbLayout::new(tree, log);
    layout.prune();
    layout.label();
    layout.limbs();
    layout.cuts_and_couplings();
    layout.drives();
    layout.springs();
    layout.renamed.write_note(layout.log);
    layout.draft
}

struct LimbLayout<'a> {
    tree: &'a Tree,
    log: &'a mut Log,
    /// For each link: the link that carries it (`None` is the world), and its pose on that link.
    carriers: Vec<(Option<usize>, Pose)>,
    nodes: BTreeMap<usize, Node>,
    /// The coordinate of each joint of the file, by name.
    joints: BTreeMap<String, String>,
    renamed: Renamed,
    draft: Draft,
}

impl<'a> LimbLayout<'a> {
    fn new(tree: &'a Tree, log: &'a mut Log) -> Self {
        let mut layout = Self {
            tree,
            log,
            carriers: Vec::new(),
            nodes: BTreeMap::new(),
            joints: BTreeMap::new(),
            renamed: Renamed::default(),
            draft: Draft::default(),
        };
        let mut still: Vec<&Link> = Vec::new();
        for (index, link) in tree.links.iter().enumerate() {
            let (carrier, pose) = match link.parent.and_then(|p| layout.carriers.get(p)) {
                Some((carrier, pose)) => (*carrier, pose.then(&link.pose)),
                None => (None, link.pose),
            };
            let massive = link.is_massive();
            if link.joints.is_empty() && (carrier.is_none() || !massive) {
                if massive {
                    still.push(link);
                }
                layout.carriers.push((carrier, pose));
                continue;
            }
            let joints: Vec<(Joint, Pose)> = link
                .joints
                .iter()
                .flat_map(Joint::parts)
                .map(|joint| {
                    let frame = joint_frame(&joint).0;
                    (joint, frame)
                })
                .collect();
            let frame = joints.last().map_or_else(Pose::default, |j| j.1);
            layout.nodes.insert(
                index,
                Node {
                    parent: carrier,
                    pose,
                    joints,
                    frame,
                    children: Vec::new(),
                    alive: massive,
                    depth: 0,
                    label: None,
                },
            );
            if let Some(above) = carrier.and_then(|c| layout.nodes.get_mut(&c)) {
                above.children.push(index);
            }
            layout.carriers.push((Some(index), Pose::default()));
        }
        if let Some(first) = still.first() {
            let names: Vec<String> = still.iter().map(|l| format!("'{}'", l.name)).collect();
            let text = format!(
                "inertias of links that do not move have no effect: {}",
                names.join(", ")
            );
            layout.log.note(first.place, text);
        }
        layout
    }

    /// The links at which closures or springs hold.
    fn held(&self) -> Vec<usize> {
        let closures = self.tree.closures.iter().flat_map(|c| &c.sides);
        let springs = self.tree.springs.iter().flat_map(|s| &s.ends);
        let links = closures.map(|side| side.link);
        let links = links.chain(springs.map(|end| end.0));
        links
            .filter_map(|link| self.carriers.get(link?)?.0)
            .collect()
    }

    /// Removes joints that move no mass, and are in no loop or coupling.
    fn prune(&mut self) {
        let mut coupled_joints: Vec<&str> = Vec::new();
        for coupling in &self.tree.couplings {
            coupled_joints.push(&coupling.joint);
            coupled_joints.extend(coupling.terms.iter().map(|t| t.0.as_str()));
        }
        for drive in &self.tree.drives {
            coupled_joints.extend(drive.terms.iter().map(|t| t.0.as_str()));
        }
        let in_loops = self.held();
        let order: Vec<usize> = self.nodes.keys().rev().copied().collect();
        for index in order {
            let Some(node) = self.nodes.get(&index) else {
                continue;
            };
            let is_coupled = node
                .joints
                .iter()
                .any(|(j, _)| coupled_joints.contains(&j.name.as_str()));
            let children: Vec<&Node> = node
                .children
                .iter()
                .filter_map(|c| self.nodes.get(c))
                .collect();
            let alive = node.alive
                || is_coupled
                || in_loops.contains(&index)
                || children.iter().any(|c| c.alive);
            let below = children.iter().map(|c| c.depth).max().unwrap_or(0);
            let depth = below + node.joints.len();
            let names: Vec<&str> = node.joints.iter().map(|j| j.0.name.as_str()).collect();
            if let (false, Some(name), Some(link)) =
                (alive, names.first(), self.tree.links.get(index))
            {
                let text = format!("joint '{name}' moves no mass: left out");
                self.log.note(link.place, text);
            }
            if let Some(node) = self.nodes.get_mut(&index) {
                (node.alive, node.depth) = (alive, depth);
            }
        }
        self.nodes.retain(|_, node| node.alive);
        let left: Vec<usize> = self.nodes.keys().copied().collect();
        for node in self.nodes.values_mut() {
            node.children.retain(|c| left.contains(c));
        }
    }

    /// Gives labels to links with mass, and to links at which limbs or cuts start.
    fn label(&mut self) {
        let mut names = Names::default();
        let in_loops = self.held();
        let order: Vec<usize> = self.nodes.keys().copied().collect();
        for index in order {
            let (Some(link), Some(node)) = (self.tree.links.get(index), self.nodes.get(&index))
            else {
                continue;
            };
            let massive = link.is_massive();
            let needed = node.children.len() > 1 || in_loops.contains(&index);
            if !massive && !needed {
                continue;
            }
            let label = names.give(&link.name);
            self.renamed.note(&link.name, &label, link.place);
            if !massive {
                let text = format!(
                    "'{}' has no mass, and is a body only because others start from it",
                    link.name
                );
                self.log.note(link.place, text);
            }
            let frame = node.frame;
            let inertia = plausible(link, self.log);
            let com = frame.inverse().point(inertia.com);
            self.draft.bodies.push(DraftBody {
                label: label.clone(),
                link: link.name.clone(),
                frame,
                unknown: link.unknown,
                inertia: Inertia {
                    mass: inertia.mass,
                    com,
                    tensor: tensor_in(inertia.tensor, &frame.r),
                },
            });
            if let Some(node) = self.nodes.get_mut(&index) {
                node.label = Some(label);
            }
        }
    }

    fn limbs(&mut self) {
        let mut given = Names::default();
        let mut coordinates = Names::default();
        let grounded = self.nodes.iter().filter(|(_, n)| n.parent.is_none());
        let mut waiting: Vec<usize> = grounded.map(|(i, _)| *i).collect();
        waiting.reverse();
        let only = waiting.len() == 1 && self.nodes.values().all(|n| n.children.len() < 2);
        while let Some(start) = waiting.pop() {
            let mut limb = DraftLimb {
                name: String::new(),
                from: self.carrier_label(start),
                joints: Vec::new(),
            };
            let mut branches = Vec::new();
            let mut at = Some(start);
            // from the body frame of the carrying link to its link frame
            let mut before = self.carrier_frame(start).inverse();
            let mut tip = start;
            while let Some(index) = at {
                let Some(node) = self.nodes.get(&index) else {
                    break;
                };
                tip = index;
                before = before.then(&node.pose);
                let joints = node.joints.clone();
                let (label, frame) = (node.label.clone(), node.frame);
                if joints.is_empty() {
                    limb.joints.push(DraftJoint {
                        name: None,
                        kind: "fixed",
                        pose: before,
                        axis: 'z',
                        body: label,
                        from: None,
                    });
                } else {
                    let last = joints.len() - 1;
                    for (k, (joint, joint_pose)) in joints.into_iter().enumerate() {
                        let axis = joint_frame(&joint).1;
                        let back = motion(joint.kind, axis, -joint.reference);
                        let name = coordinates.give(&joint.name);
                        self.renamed.note(&joint.name, &name, joint.place);
                        self.joints.insert(joint.name.clone(), name.clone());
                        if joint.reference != 0.0 {
                            self.draft.home.push((name.clone(), joint.reference));
                        }
                        limb.joints.push(DraftJoint {
                            name: Some(name),
                            kind: match joint.kind {
                                Kind::Revolute => "revolute",
                                Kind::Prismatic => "prismatic",
                                _ => "spherical",
                            },
                            pose: before.then(&joint_pose).then(&back),
                            axis,
                            body: label.clone().filter(|_| k == last),
                            from: Some(joint),
                        });
                        before = joint_pose.inverse();
                    }
                }
                before = frame.inverse();
                let node = self.nodes.get(&index);
                let children = node.map_or_else(Vec::new, |n| n.children.clone());
                // the limb continues along the longest chain, the first of equal ones
                let depth = |c: &usize| self.nodes.get(c).map_or(0, |n| n.depth);
                let longest = children.iter().map(depth).max();
                at = children.iter().copied().find(|c| Some(depth(c)) == longest);
                branches.extend(children.iter().copied().filter(|c| Some(*c) != at));
            }
            branches.reverse();
            waiting.extend(branches);
            let tip = self.tree.links.get(tip).map_or("limb", |l| l.name.as_str());
            limb.name = given.give(if only { "arm" } else { tip });
            self.draft.limbs.push(limb);
        }
        self.in_order();
    }

    /// Sorts the bodies by the order in which joints declare them.
    fn in_order(&mut self) {
        let joints = self.draft.limbs.iter().flat_map(|l| &l.joints);
        let order: Vec<String> = joints.filter_map(|j| j.body.clone()).collect();
        let at = |body: &DraftBody| order.iter().position(|l| *l == body.label);
        self.draft.bodies.sort_by_key(at);
    }

    fn carrier_label(&self, index: usize) -> Option<String> {
        let parent = self.nodes.get(&index)?.parent?;
        self.nodes.get(&parent)?.label.clone()
    }

    fn carrier_frame(&self, index: usize) -> Pose {
        let parent = self.nodes.get(&index).and_then(|n| n.parent);
        let carrier = parent.and_then(|p| self.nodes.get(&p));
        carrier.map_or_else(Pose::default, |c| c.frame)
    }

    /// The label of the body that carries a frame (`None` is the world), and the frame on it.
    fn on_body(&self, side: Side) -> (Option<String>, Pose) {
        let carried = side.link.and_then(|l| self.carriers.get(l));
        let Some((carrier, pose)) = carried else {
            return (None, side.pose);
        };
        let pose = pose.then(&side.pose);
        match carrier.and_then(|c| self.nodes.get(&c)) {
            Some(node) => (node.label.clone(), node.frame.inverse().then(&pose)),
            None => (None, pose),
        }
    }

    /// Converts springs between points.
    fn springs(&mut self) {
        let mut names = Names::default();
        for spring in &self.tree.springs {
            let ends = spring.ends.map(|(link, point)| {
                let pose = Pose::shift(point);
                let (body, pose) = self.on_body(Side { link, pose });
                (body, pose.p)
            });
            if ends[0].0 == ends[1].0 {
                let text = format!(
                    "the spring '{}' is left out: it moves no joint",
                    spring.name
                );
                self.log.note(spring.place, text);
                continue;
            }
            let name = names.give(&spring.name);
            self.renamed.note(&spring.name, &name, spring.place);
            self.draft.springs.push(DraftSpring {
                name,
                ends,
                length: spring.length,
                stiffness: spring.stiffness,
            });
        }
    }

    /// Converts cuts and couplings.
    fn cuts_and_couplings(&mut self) {
        let mut names = Names::default();
        for closure in &self.tree.closures {
            let sides = closure.sides.map(|side| self.on_body(side));
            let name = names.give(&closure.name);
            self.draft.cuts.push(DraftCut {
                name,
                kind: closure.kind.clone(),
                sides,
            });
        }
        for coupling in &self.tree.couplings {
            let Coupling {
                joint,
                constant,
                terms,
                place,
            } = coupling;
            let find = |name: &String| self.joints.get(name).cloned();
            let missing = std::iter::once(joint)
                .chain(terms.iter().map(|t| &t.0))
                .find(|name| find(name).is_none());
            if let Some(missing) = missing {
                let message = format!("no joint with one coordinate is called '{missing}'");
                let hint = "a joint can follow a revolute or a prismatic one";
                self.log.error(*place, message, hint);
                continue;
            }
            let terms = terms
                .iter()
                .filter_map(|(name, factor)| Some((find(name)?, *factor)));
            let terms = terms.collect();
            if let Some(joint) = find(joint) {
                self.draft.couplings.push(DraftCoupling {
                    key: joint,
                    constant: *constant,
                    terms,
                });
            }
        }
    }

    /// Converts drives; a drive may not have the name of a joint or a body.
    fn drives(&mut self) {
        let mut names = Names::default();
        let joints = self.draft.limbs.iter().flat_map(|limb| &limb.joints);
        let taken: BTreeSet<&String> = joints
            .flat_map(|joint| [&joint.name, &joint.body])
            .flatten()
            .collect();
        for name in taken {
            names.give(name);
        }
        for drive in &self.tree.drives {
            let found = drive.terms.iter().map(|(joint, factor)| {
                let joint = self.joints.get(joint)?;
                Some((joint.clone(), *factor))
            });
            let Some(terms) = found.collect::<Option<Vec<_>>>() else {
                let text = format!("the drive '{}' is left out: it moves no mass", drive.name);
                self.log.note(drive.place, text);
                continue;
            };
            self.draft.drives.push(Drive {
                name: names.give(&drive.name),
                terms,
                ..drive.clone()
            });
        }
    }
}

/// Names that had to be changed for the spec, reported together.
#[derive(Default)]
struct Renamed(Vec<(Place, String)>);

impl Renamed {
    fn note(&mut self, name: &str, given: &str, place: Place) {
        if name != given {
            self.0.push((place, format!("'{name}' is {given}")));
        }
    }

    fn write_note(&self, log: &mut Log) {
        /// The largest number of examples in the note.
        const MAX_EXAMPLES: usize = 4;
        let Some((place, _)) = self.0.first() else {
            return;
        };
        let shown: Vec<&str> = self
            .0
            .iter()
            .take(MAX_EXAMPLES)
            .map(|r| r.1.as_str())
            .collect();
        let more = match self.0.len().saturating_sub(MAX_EXAMPLES) {
            0 => String::new(),
            n => format!(", and {n} more"),
        };
        let text = format!("names differ in the spec: {}{more}", shown.join(", "));
        log.note(*place, text);
    }
}
