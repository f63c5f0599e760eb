//! Joints of SDF files: what they connect, their axes, and which of them close loops.

use std::collections::{BTreeMap, BTreeSet};

use crate::fields::Fields;
use crate::pose::{Pose, V3, dot, scaled, times, transposed};
use crate::tree::{Coupling, Joint, Kind, LoopCut, Side, Tree};
use crate::xml::Element;

use super::{MODEL, Names, pose};

/// A joint with what it connects.
pub(crate) struct SdfJoint<'e> {
    pub(crate) name: String,
    pub(crate) element: &'e Element,
    pub(crate) kind: &'e str,
    /// The links of its parent and its child.
    pub(crate) links: [Option<usize>; 2],
    /// Its frame in the world, as the file draws the robot.
    pub(crate) frame: Pose,
    /// Its frame on each of the two links.
    pub(crate) on: [Pose; 2],
    /// Its coordinates, with axes in the world.
    pub(crate) parts: Vec<Joint>,
    pub(crate) mimics: Vec<Coupling>,
    /// Whether it closes a loop rather than any other joint.
    pub(crate) is_closing: bool,
}

impl<'e> SdfJoint<'e> {
    /// Reads a joint; `None` after an error.
    ///
    /// - `is_old`: whether axes are given in the frame of the model by default.
    /// - `prefix`: what stands before the joint's name in names of the whole file.
    pub(super) fn read(
        element: &'e Element,
        names: &Names<'_>,
        is_old: bool,
        prefix: &str,
        fields: &mut Fields<'_>,
    ) -> Option<Self> {
        let own = element.text("name").unwrap_or("joint");
        let name = format!("{prefix}{own}");
        let kind = element.attribute("type");
        let Some(kind) = kind else {
            let message = "<joint> has no type";
            fields
                .log
                .error(element.place, message, "write type=\"...\"");
            return None;
        };
        let mut end = |tag: &str| {
            let Some(text) = element.content_of(tag) else {
                let message = format!("the joint '{own}' has no {tag}");
                let hint = format!("write <{tag}>...</{tag}> in it");
                fields.log.error(element.place, message, &hint);
                return None;
            };
            let found = names(text.value.trim());
            if found.is_none() {
                let message = format!("no link is called '{}'", text.value.trim());
                let hint = "joints connect links or frames of the same file";
                fields.log.error(text.place, message, hint);
            }
            found
        };
        let (parent, child) = (end("parent")?, end("child")?);
        let (pose, said) = pose(element, fields);
        let around = match said {
            Some(name) => {
                let found = names(name.value.trim());
                if found.is_none() {
                    let message = format!("nothing is called '{}'", name.value);
                    let hint = "poses are relative to links, joints and frames of the file";
                    fields.log.error(name.place, message, hint);
                }
                found?.1
            }
            None => child.1,
        };
        let mut joint = Self {
            name,
            element,
            kind: kind.value.as_str(),
            links: [parent.0, child.0],
            frame: around.then(&pose),
            on: [Pose::default(), pose],
            parts: Vec::new(),
            mimics: Vec::new(),
            is_closing: false,
        };
        let axes: &[(&str, Kind)] = match joint.kind {
            "fixed" => &[],
            "revolute" | "continuous" => &[("axis", Kind::Revolute)],
            "prismatic" => &[("axis", Kind::Prismatic)],
            "universal" | "revolute2" | "gearbox" => {
                &[("axis", Kind::Revolute), ("axis2", Kind::Revolute)]
            }
            "ball" => {
                let ball = Joint::new(joint.name.clone(), element.place, Kind::Spherical);
                joint.parts.push(ball);
                &[]
            }
            other => {
                let message = format!("a joint of type '{other}' cannot be expressed");
                let hint = "joints are revolute, continuous, prismatic, ball, universal, revolute2, gearbox, \
                            fixed here";
                fields.log.error(kind.place, message, hint);
                return None;
            }
        };
        for (k, (tag, kind)) in axes.iter().enumerate() {
            let name = match axes.len() {
                1 => joint.name.clone(),
                _ => format!("{}_{}", joint.name, k + 1),
            };
            let mut part = Joint::new(name, element.place, *kind);
            part.passive = axes.len() > 1;
            part.axis = joint.frame.r.map(|row| row[2]);
            if let Some(axis) = element.child(tag) {
                joint.axis(axis, &mut part, names, is_old, fields)?;
            }
            joint.parts.push(part);
        }
        Some(joint)
    }

    /// Reads an axis with its limits and what resists motion about it.
    fn axis(
        &mut self,
        axis: &Element,
        part: &mut Joint,
        names: &Names<'_>,
        is_old: bool,
        fields: &mut Fields<'_>,
    ) -> Option<()> {
        let flag = axis.content_of("use_parent_model_frame");
        let in_model = flag.map_or(is_old, |f| matches!(f.value.trim(), "true" | "1"));
        if let Some(xyz) = axis.child("xyz") {
            let direction = xyz.content().and_then(|text| fields.direction(text))?;
            let said = xyz
                .attribute("expressed_in")
                .filter(|n| !n.value.is_empty());
            let frame = match said {
                Some(name) => {
                    let found = names(name.value.trim());
                    if found.is_none() {
                        let message = format!("nothing is called '{}'", name.value);
                        let hint = "axes are expressed in frames of the file";
                        fields.log.error(name.place, message, hint);
                    }
                    found?.1
                }
                None if in_model => names(MODEL).map_or_else(Pose::default, |m| m.1),
                None => self.frame,
            };
            part.axis = times(&frame.r, direction);
        }
        let mut number = |element: Option<&Element>, tag: &str| {
            let text = element?.content_of(tag)?;
            let infinite = text.value.trim().parse().is_ok_and(f64::is_infinite);
            let value = if infinite { None } else { fields.number(text) };
            value.filter(|x| x.abs() < 1e9)
        };
        let limit = axis.child("limit");
        let ends = [number(limit, "lower"), number(limit, "upper")];
        if let [Some(lower), Some(upper)] = ends
            && lower < upper
            && self.kind != "continuous"
        {
            part.position = Some([lower, upper]);
        }
        part.velocity = number(limit, "velocity").filter(|v| *v > 0.0);
        let effort = number(limit, "effort").filter(|e| *e > 0.0);
        part.effort = effort.map(|e| [-e, e]);
        let dynamics = axis.child("dynamics");
        let mut resisting = |tag| number(dynamics, tag).unwrap_or(0.0).max(0.0);
        part.damping = resisting("damping");
        part.friction = resisting("friction");
        part.stiffness = resisting("spring_stiffness");
        part.spring_rest = number(dynamics, "spring_reference").unwrap_or(0.0);
        if let Some(mimic) = axis.child("mimic") {
            let leader = mimic.attribute("joint").map(|j| j.value.clone());
            let second = mimic.text("axis").is_some_and(|axis| axis == "axis2");
            let mut value = |tag, default| number(Some(mimic), tag).unwrap_or(default);
            let (factor, offset) = (value("multiplier", 1.0), value("offset", 0.0));
            let reference = value("reference", 0.0);
            let Some(leader) = leader else {
                let message = "<mimic> names no joint";
                fields
                    .log
                    .error(mimic.place, message, "write joint=\"...\"");
                return None;
            };
            let prefix = self.name.rfind("::").map_or("", |at| &self.name[..at + 2]);
            let leader = format!("{prefix}{leader}{}", if second { "_2" } else { "" });
            self.mimics.push(Coupling {
                joint: part.name.clone(),
                constant: offset - factor * reference,
                terms: vec![(leader, factor)],
                place: mimic.place,
            });
        }
        Some(())
    }

    /// The link at the other end than this one.
    pub(crate) fn other(&self, link: usize) -> Option<usize> {
        match self.links {
            [Some(a), b] if a == link => b,
            [a, _] => a,
        }
    }

    /// The joints that carry a link, with axes and anchors in its frame.
    pub(crate) fn moving(&self, link: usize, world: &Pose) -> Vec<Joint> {
        let back = world.inverse();
        // a link that is the joint's parent moves the other way round
        let is_reversed = self.links[1] != Some(link);
        let anchor = self.on[usize::from(!is_reversed)].p;
        let joint = |part: &Joint| {
            let axis = times(&back.r, part.axis);
            let axis = if is_reversed {
                scaled(axis, -1.0)
            } else {
                axis
            };
            Joint {
                axis,
                anchor,
                ..part.clone()
            }
        };
        let mut parts: Vec<Joint> = self.parts.iter().map(joint).collect();
        if is_reversed {
            parts.reverse();
        }
        parts
    }

    /// Notes what a cut has not.
    pub(crate) fn note_cut(&self, fields: &mut Fields<'_>) {
        let text = "joints that close loops have no coordinate, friction or limits in the spec: {}";
        let place = self.element.place;
        fields.log.note_each(place, text, &self.name);
        if !self.mimics.is_empty() {
            let hint = "let another joint of the loop follow";
            let message = format!(
                "'{}' closes a loop, and cannot follow another joint",
                self.name
            );
            fields.log.error(place, message, hint);
        }
    }

    /// The cut that the joint is between two links of a tree.
    pub(crate) fn cut(&self, links: [Option<usize>; 2]) -> LoopCut {
        let kind = match self.kind {
            "revolute" | "continuous" => "revolute",
            "ball" => "spherical",
            "revolute2" => "universal",
            other => other,
        };
        let axis = |k: usize| self.parts.get(k).map(|part| part.axis);
        let side = |k: usize, letter: char, axis: Option<V3>| {
            let (link, pose) = (links[k], self.on[k]);
            let own = axis.map(|axis| times(&transposed(&self.frame.r), axis));
            let side = Side { link, pose };
            own.map_or(side, |axis| side.with_axis(letter, axis))
        };
        let sides = match kind {
            "universal" => [side(0, 'x', axis(0)), side(1, 'y', axis(1))],
            "revolute" | "prismatic" => [side(0, 'z', axis(0)), side(1, 'z', axis(0))],
            _ => [side(0, 'z', None), side(1, 'z', None)],
        };
        LoopCut {
            name: self.name.clone(),
            kind: kind.to_owned(),
            sides,
        }
    }
}

/// Which of the joints form a tree: rigid ones first, then those with coordinates that others name, and
/// balls last, since a loop is best opened where three coordinates are saved.
///
/// - `actuated`: more names of joints whose coordinates count.
pub(crate) fn spanning(joints: &[SdfJoint<'_>], links: usize, actuated: &[String]) -> Vec<bool> {
    let named: BTreeSet<&str> = joints
        .iter()
        .flat_map(|joint| &joint.mimics)
        .flat_map(|mimic| {
            mimic
                .terms
                .iter()
                .map(|t| t.0.as_str())
                .chain([mimic.joint.as_str()])
        })
        .chain(actuated.iter().map(String::as_str))
        .collect();
    let rank = |joint: &SdfJoint<'_>| {
        let is_named = joint
            .parts
            .iter()
            .any(|part| named.contains(part.name.as_str()));
        match joint.parts.first().map(|part| part.kind) {
            _ if joint.is_closing => 5,
            None => 0,
            Some(_) if is_named => 1,
            Some(Kind::Spherical) => 4,
            Some(_) if joint.parts.len() > 1 => 3,
            Some(_) => 2,
        }
    };
    let mut order: Vec<usize> = (0..joints.len()).collect();
    order.sort_by_key(|k| rank(&joints[*k]));
    // the group of each link, and of the world behind them
    let mut group: Vec<usize> = (0..=links).collect();
    let mut kept = vec![false; joints.len()];
    for k in order {
        let joint = &joints[k];
        let [a, b] = joint.links.map(|link| group[link.unwrap_or(links)]);
        if joint.kind == "gearbox" || a == b {
            continue;
        }
        kept[k] = true;
        for own in &mut group {
            if *own == b {
                *own = a;
            }
        }
    }
    kept
}

/// The links in order from the root, each with the joint that carries it.
///
/// - `root`: the link that is the root if no joint holds one to the world, and whether the file says that it is
///   fixed there.
pub(crate) fn order(
    joints: &[SdfJoint<'_>],
    in_tree: &[bool],
    links: &[(String, &Element)],
    (root, is_static): (Option<usize>, bool),
    fields: &mut Fields<'_>,
) -> Vec<(usize, Option<usize>)> {
    let mut order: Vec<(usize, Option<usize>)> = Vec::new();
    let mut reached = vec![false; links.len()];
    let kept = || (0..joints.len()).filter(|k| in_tree.get(*k) == Some(&true));
    for k in kept() {
        if let [None, Some(link)] | [Some(link), None] = joints[k].links {
            reached[link] = true;
            order.push((link, Some(k)));
        }
    }
    let root = root.unwrap_or(0);
    if order.is_empty()
        && let Some((name, link)) = links.get(root)
    {
        reached[root] = true;
        order.push((root, None));
        if !is_static {
            let text = format!(
                "nothing fixes '{name}' to the world: it is taken as fixed, unless its base floats"
            );
            fields.log.note(link.place, text);
        }
    }
    let mut at = 0;
    while let Some((link, _)) = order.get(at).copied() {
        at += 1;
        for k in kept() {
            if let Some(other) = joints[k].other(link)
                && joints[k].links.contains(&Some(link))
                && !reached[other]
            {
                reached[other] = true;
                order.push((other, Some(k)));
            }
        }
    }
    for ((name, link), _) in links.iter().zip(&reached).filter(|(_, r)| !**r) {
        let message = format!("no joint connects '{name}' to the rest of the robot");
        let hint = "connect this link by a joint, or take it out";
        fields.log.error(link.place, message, hint);
    }
    order
}

/// The coupling of a gearbox: the angle of its child against the reference body is the ratio times that
/// of its parent, the other way round.
pub(super) fn gearbox(
    joint: &SdfJoint<'_>,
    all: &[SdfJoint<'_>],
    tree: &Tree,
    known: &BTreeMap<String, (Option<usize>, Pose)>,
    fields: &mut Fields<'_>,
) -> Option<Coupling> {
    let element = joint.element;
    let place = element.place;
    let mut error = |message: String| {
        let hint = "a gearbox has a gearbox_ratio, and a gearbox_reference_body that carries its parent and its \
                    child by a hinge each";
        fields.log.error(place, message, hint);
        None
    };
    let prefix = joint
        .name
        .rfind("::")
        .map_or("", |at| &joint.name[..at + 2]);
    let Some(body) = element.content_of("gearbox_reference_body") else {
        return error("the gearbox has no reference body".to_owned());
    };
    let reference = known.get(&format!("{prefix}{}", body.value.trim()));
    let Some((reference, _)) = reference else {
        return error(format!("no link is called '{}'", body.value));
    };
    // the hinge between the reference body and a link, and whether it turns in an axis' direction
    let hinge = |link: Option<usize>, axis: V3| {
        let joint = all.iter().find(|other| {
            other.kind != "gearbox" && other.parts.len() == 1 && {
                let [a, b] = other.links;
                (a == *reference && b == link) || (b == *reference && a == link)
            }
        })?;
        let own = joint.parts.first()?;
        tree.joint(&own.name)?;
        // the angle of the child against the parent, or the other way round
        let turned = if joint.links[0] == *reference {
            1.0
        } else {
            -1.0
        };
        let along = if dot(own.axis, axis) < 0.0 { -1.0 } else { 1.0 };
        Some((own.name.clone(), turned * along))
    };
    let [first, second] = joint.parts.as_slice() else {
        return None;
    };
    let a = hinge(joint.links[0], first.axis);
    let b = hinge(joint.links[1], second.axis);
    let (Some((leader, x)), Some((follower, y))) = (a, b) else {
        return error("no hinge connects the reference body to both links".to_owned());
    };
    let ratio = element.content_of("gearbox_ratio");
    let ratio = ratio.map_or(Some(1.0), |text| fields.number(text))?;
    Some(Coupling {
        joint: follower,
        constant: 0.0,
        terms: vec![(leader, -ratio * x * y)],
        place,
    })
}

/// The cut of an SDF joint between links of a tree that was read, as `<gazebo>` in URDF has it.
pub(crate) fn closure(element: &Element, tree: &Tree, fields: &mut Fields<'_>) -> Option<LoopCut> {
    let names = |name: &str| {
        if name == "world" {
            return Some((None, Pose::default()));
        }
        let side = tree.frame(name)?;
        Some((side.link, tree.at_zero(side.link).then(&side.pose)))
    };
    let mut joint = SdfJoint::read(element, &names, false, "", fields)?;
    let pose_on = |link| tree.at_zero(link).inverse().then(&joint.frame);
    let [parent, child] = joint.links.map(pose_on);
    // where the file states the pose on the child, its numbers stay
    let is_stated = element
        .child("pose")
        .is_none_or(|pose| pose.attribute("relative_to").is_none());
    let named = element
        .content_of("child")
        .and_then(|c| tree.find(c.value.trim()));
    joint.on[0] = parent;
    if !is_stated || named.is_none() {
        joint.on[1] = child;
    }
    if joint.kind == "gearbox" {
        let hint = "write it as <mimic> of the joint that follows";
        let message = "a gearbox in <gazebo> cannot be expressed";
        fields.log.error(element.place, message, hint);
        return None;
    }
    joint.note_cut(fields);
    Some(joint.cut(joint.links))
}
