//! SDF files: links, joints and frames with poses relative to each other. Joints form a graph: a
//! spanning tree of them is kept, the others close loops.

mod joints;

use std::collections::BTreeMap;

use crate::fields::Fields;
use crate::log::Place;
use crate::pose::{Pose, from_quaternion, tensor_in, transposed};
use crate::tree::{Inertia, Link, Side, Tree};
use crate::unused::Row;
use crate::urdf::closures;
use crate::xml::{Attribute, Element};

pub(crate) use joints::closure;
use joints::gearbox;
pub(crate) use joints::{SdfJoint, order, spanning};

/// What of an SDF file has no effect on the dynamics.
pub(crate) const ROWS: &[Row] = &[
    Row::whole("visual", "*"),
    Row::whole("collision", "*"),
    Row::whole("sensor", "*"),
    Row::whole("plugin", "*"),
    Row::whole("physics", "*"),
    Row::whole("light", "*"),
    Row::whole("scene", "*"),
    Row::whole("gui", "*"),
    Row::whole("audio_sink", "*"),
    Row::whole("audio_source", "*"),
    Row::whole("battery", "*"),
    Row::whole("particle_emitter", "*"),
    Row::whole("projector", "*"),
    Row::whole("spherical_coordinates", "*"),
    Row::whole("magnetic_field", "*"),
    Row::whole("atmosphere", "*"),
    Row::whole("wind", "*"),
    Row::whole("state", "*"),
    Row::parts(
        "model",
        "self_collide enable_wind allow_auto_disable canonical_link static",
    ),
    Row::parts(
        "joint",
        "thread_pitch screw_thread_pitch gearbox_ratio gearbox_reference_body",
    ),
    Row::parts("link", "self_collide enable_wind must_be_base_link"),
    Row::parts("world", "name"),
    Row::parts("limit", "stiffness dissipation"),
];

/// The link and the pose in the world of a name.
type Names<'a> = dyn Fn(&str) -> Option<(Option<usize>, Pose)> + 'a;

/// Reads the robot of an SDF file; `None` if an error was recorded.
pub(crate) fn read(root: &Element, fields: &mut Fields<'_>) -> Option<Tree> {
    let version = root.attribute("version").map_or("", |v| v.value.trim());
    let [major, minor] = [0, 1].map(|k| version.split('.').nth(k)?.parse::<u32>().ok());
    // before SDF 1.5, axes are given in the frame of the model
    let is_old = major == Some(1) && minor.is_some_and(|minor| minor < 5);
    let worlds: Vec<&Element> = root.all("world").collect();
    let all = root.all("model");
    let all = all.chain(worlds.iter().flat_map(|world| world.all("model")));
    let all: Vec<&Element> = all.collect();
    for around in std::iter::once(root).chain(worlds.iter().copied()) {
        refuse_includes(around, fields);
    }
    let has_joints = |model: &&&Element| model.children.iter().any(|c| c.tag == "joint");
    let with_joints: Vec<&Element> = all.iter().filter(has_joints).copied().collect();
    let model = match (with_joints.as_slice(), all.as_slice()) {
        ([model], _) | ([], [model]) => *model,
        (several, all) => {
            let place = several
                .first()
                .or(all.first())
                .map_or(root.place, |m| m.place);
            let names: Vec<&str> = all.iter().filter_map(|m| m.text("name")).collect();
            let message = match names.as_slice() {
                [] => "there is no model".to_owned(),
                names => format!("which of the models is the robot: {}?", names.join(", ")),
            };
            let hint = "a file has one <model> with joints: take the others out";
            fields.log.error(place, message, hint);
            return None;
        }
    };
    for other in all.iter().filter(|other| !std::ptr::eq(**other, model)) {
        let name = other.text("name").unwrap_or_default();
        let text = "models without joints are left out: {}";
        fields.log.note_each(other.place, text, name);
        other.set_aside();
    }
    let gravity = worlds.iter().find_map(|world| world.content_of("gravity"));
    let mut reading = Reading {
        fields,
        is_old,
        links: Vec::new(),
        joints: Vec::new(),
        poses: BTreeMap::new(),
        tree: Tree {
            name: model.text("name").unwrap_or("robot").to_owned(),
            place: root.place,
            format: "SDF",
            ..Tree::default()
        },
    };
    reading.tree.gravity = gravity.and_then(|g| reading.fields.array(g));
    reading.collect(model, "", None);
    reading.build(model);
    let failed = reading.fields.log.failed();
    (!failed).then_some(reading.tree)
}

fn refuse_includes(around: &Element, fields: &mut Fields<'_>) {
    for include in around.all("include") {
        let uri = include
            .content_of("uri")
            .map_or("", |uri| uri.value.as_str());
        let message = format!("the model '{uri}' is in another file");
        let hint = "write all into one file first (gz sdf -p FILE.sdf > WHOLE.sdf), or --ignore include if it is no \
                    part of the robot";
        fields.log.error(include.place, message, hint);
    }
}

/// A pose that is relative to a name.
struct Relative {
    place: Place,
    /// The full name that it is relative to; `None` is the world.
    to: Option<String>,
    pose: Pose,
    /// The full name of what it is attached to; `None` for links, joints and models.
    attached: Option<String>,
    /// The link that it is.
    link: Option<usize>,
}

struct Reading<'a, 'f, 'l> {
    fields: &'f mut Fields<'l>,
    is_old: bool,
    /// The links with their full names.
    links: Vec<(String, &'a Element)>,
    /// The joints with the prefix of the names around them.
    joints: Vec<(String, &'a Element)>,
    poses: BTreeMap<String, Relative>,
    tree: Tree,
}

fn is_world(name: &str) -> bool {
    name == "world" || name.ends_with("::world")
}

/// The name of a model's own frame.
const MODEL: &str = "__model__";

impl<'a> Reading<'a, '_, '_> {
    /// Collects links, joints and frames of a model, and of those within it.
    fn collect(&mut self, model: &'a Element, prefix: &str, around: Option<&str>) {
        refuse_includes(model, self.fields);
        let own = format!("{prefix}{MODEL}");
        let around = around.map(|around| format!("{around}{MODEL}"));
        let relative = self.relative(model, prefix, around, None);
        self.define(&own, relative);
        let name = |element: &Element| element.text("name").unwrap_or_default().to_owned();
        for link in model.all("link") {
            let full = format!("{prefix}{}", name(link));
            let mut relative = self.relative(link, prefix, Some(own.clone()), None);
            relative.link = Some(self.links.len());
            if link.text("name").is_none() || self.poses.contains_key(&full) {
                let message = format!("a link without a name of its own: '{full}'");
                self.fields
                    .log
                    .error(link.place, message, "write name=\"...\"");
            }
            self.define(&full, relative);
            self.links.push((full, link));
        }
        for frame in model.all("frame") {
            let full = format!("{prefix}{}", name(frame));
            let attached = frame.text("attached_to").filter(|text| !text.is_empty());
            let attached = attached.map_or(own.clone(), |text| format!("{prefix}{text}"));
            let relative = self.relative(frame, prefix, Some(attached.clone()), Some(attached));
            self.define(&full, relative);
        }
        for joint in model.all("joint") {
            let full = format!("{prefix}{}", name(joint));
            let child = joint
                .content_of("child")
                .map(|c| format!("{prefix}{}", c.value.trim()));
            let relative = self.relative(joint, prefix, child.clone(), child);
            self.define(&full, relative);
            self.joints.push((prefix.to_owned(), joint));
        }
        for inner in model.all("model") {
            let within = format!("{prefix}{}::", name(inner));
            let frame = format!("{within}{MODEL}");
            let relative = Relative {
                place: inner.place,
                to: Some(frame.clone()),
                pose: Pose::default(),
                attached: Some(frame),
                link: None,
            };
            self.define(&format!("{prefix}{}", name(inner)), relative);
            self.collect(inner, &within, Some(prefix));
        }
    }

    fn define(&mut self, name: &str, relative: Relative) {
        self.poses.entry(name.to_owned()).or_insert(relative);
    }

    /// The pose of an element, with what it is relative to unless it says so.
    fn relative(
        &mut self,
        element: &Element,
        prefix: &str,
        to: Option<String>,
        attached: Option<String>,
    ) -> Relative {
        let (pose, said) = pose(element, self.fields);
        let outer = prefix
            .trim_end_matches("::")
            .rfind("::")
            .map_or("", |at| &prefix[..at + 2]);
        // the pose of a model is given in the names around it
        let scope = if element.tag == "model" && to.is_some() && prefix.ends_with("::") {
            outer
        } else {
            prefix
        };
        let said = said.map(|name| format!("{scope}{}", name.value.trim()));
        Relative {
            place: element.place,
            to: said.or(to),
            pose,
            attached,
            link: None,
        }
    }

    /// A name and those that its pose is relative to, up to the world; an error if they go round in a
    /// circle or are unknown.
    fn chain(&mut self, name: &str) -> Option<Vec<String>> {
        let mut chain: Vec<String> = Vec::new();
        let mut next = Some(name.to_owned());
        let mut place = self.tree.place;
        while let Some(name) = next.take().filter(|name| !is_world(name)) {
            let seen = chain.contains(&name);
            let Some(relative) = self.poses.get(&name).filter(|_| !seen) else {
                let message = if seen {
                    format!("the pose of '{name}' is relative to itself")
                } else {
                    format!("nothing is called '{name}'")
                };
                let hint = "poses are relative to links, joints, frames and models of the file";
                self.fields.log.error(place, message, hint);
                return None;
            };
            place = relative.place;
            next.clone_from(&relative.to);
            chain.push(name);
        }
        Some(chain)
    }

    /// The pose of a name in the frame of another one, without what both are relative to: the numbers of
    /// the file stay as they are where they say it.
    fn pose_in(&mut self, frame: &str, name: &str) -> Option<Pose> {
        let [mut own, mut other] = [self.chain(name)?, self.chain(frame)?];
        while own.last().is_some() && own.last() == other.last() {
            own.pop();
            other.pop();
        }
        let [own, other] = [own, other].map(|chain| {
            let poses = chain.iter().filter_map(|name| self.poses.get(name));
            poses.fold(None, |inner: Option<Pose>, outer| {
                Some(inner.map_or(outer.pose, |inner| outer.pose.then(&inner)))
            })
        });
        Some(match (own, other) {
            (own, None) => own.unwrap_or_default(),
            (None, Some(other)) => other.inverse(),
            (Some(own), Some(other)) => other.inverse().then(&own),
        })
    }

    /// The link that carries a name, and the pose of the name in the world.
    fn carried(&mut self, name: &str) -> Option<(Option<usize>, Pose)> {
        if is_world(name) {
            return Some((None, Pose::default()));
        }
        let world = self.pose_in("world", name)?;
        let mut at = name.to_owned();
        for _ in 0..=self.poses.len() {
            let relative = self.poses.get(&at)?;
            if relative.link.is_some() {
                return Some((relative.link, world));
            }
            let Some(next) = &relative.attached else {
                // what is attached to a model moves with its first link
                let prefix = at.trim_end_matches(MODEL);
                let mut links = self.links.iter();
                let first = links.position(|(name, _)| name.starts_with(prefix));
                return Some((first, world));
            };
            at.clone_from(next);
        }
        None
    }

    /// Builds the tree from what was collected.
    fn build(&mut self, model: &Element) {
        let names: Vec<String> = self.poses.keys().cloned().collect();
        let mut known = BTreeMap::new();
        for name in names {
            if let Some(found) = self.carried(&name) {
                known.insert(name, found);
            }
        }
        if self.links.is_empty() {
            let hint = "a robot has links and joints within <model>";
            self.fields
                .log
                .error(model.place, "the model has no link", hint);
        }
        let mut joints = Vec::new();
        for (prefix, element) in self.joints.clone() {
            let names = |name: &str| {
                if name == "world" {
                    return Some((None, Pose::default()));
                }
                known.get(&format!("{prefix}{name}")).copied()
            };
            let joint = SdfJoint::read(element, &names, self.is_old, &prefix, self.fields);
            let Some(mut joint) = joint else { continue };
            joint.on = joint.links.map(|link| {
                let link = link.and_then(|l| self.links.get(l));
                let link = link.map_or_else(|| "world".to_owned(), |(name, _)| name.clone());
                self.pose_in(&link, &joint.name).unwrap_or_default()
            });
            joints.push(joint);
        }
        if self.fields.log.failed() {
            return;
        }
        let worlds: Vec<Pose> = (self.links.iter())
            .map(|(name, _)| known.get(name).map_or_else(Pose::default, |k| k.1))
            .collect();
        let in_tree = spanning(&joints, self.links.len(), &[]);
        let fixed = model.content_of("static");
        let is_static = fixed.is_some_and(|s| matches!(s.value.trim(), "true" | "1"));
        if let Some(own) = fixed.filter(|_| is_static && !joints.is_empty()) {
            let text =
                "the model is static, so that Gazebo moves no joint of it: the spec's joints move";
            self.fields.log.note(own.place, text);
        }
        let first = model.text("canonical_link");
        let root = first.and_then(|name| self.links.iter().position(|(own, _)| own == name));
        let order = order(
            &joints,
            &in_tree,
            &self.links,
            (root, is_static),
            self.fields,
        );
        let mut index: BTreeMap<usize, usize> = BTreeMap::new();
        for (link, by) in order {
            let Some((name, element)) = self.links.get(link).cloned() else {
                continue;
            };
            let world = worlds[link];
            let joint = by.and_then(|k| joints.get(k));
            let carrier = joint.and_then(|j| j.other(link));
            let around = carrier.and_then(|c| self.links.get(c));
            let around = around.map_or_else(|| "world".to_owned(), |(name, _)| name.clone());
            let pose = self.pose_in(&around, &name).unwrap_or_default();
            let (inertia, unknown) = self.inertia(element, &name);
            let read = Link {
                name,
                place: element.place,
                parent: carrier.and_then(|c| index.get(&c).copied()),
                pose,
                joints: joint.map_or_else(Vec::new, |j| j.moving(link, &world)),
                inertia,
                unknown,
            };
            index.insert(link, self.tree.links.len());
            self.tree.links.push(read);
        }
        for (name, (link, world)) in &known {
            let link = link.and_then(|l| index.get(&l).copied());
            let pose = self.tree.at_zero(link).inverse().then(world);
            self.tree.frames.push((name.clone(), Side { link, pose }));
        }
        for (joint, in_tree) in joints.iter().zip(&in_tree) {
            if joint.kind == "gearbox" {
                let coupling = gearbox(joint, &joints, &self.tree, &known, self.fields);
                self.tree.couplings.extend(coupling);
            } else if !in_tree {
                let text = "joints that close loops have no coordinate, friction or limits in the spec: {}";
                self.fields
                    .log
                    .note_each(joint.element.place, text, &joint.name);
                let links = joint.links.map(|link| index.get(&link?).copied());
                self.tree.closures.push(joint.cut(links));
            } else {
                self.tree.couplings.extend(joint.mimics.iter().cloned());
            }
        }
        closures::read_drake(model, &mut self.tree, self.fields);
    }

    /// The inertia of a link, and whether the file does not state it.
    fn inertia(&mut self, link: &Element, name: &str) -> (Option<Inertia>, bool) {
        let mut defaults = Vec::new();
        let inertial = link.child("inertial");
        if let Some(inertial) = inertial
            && inertial
                .text("auto")
                .is_some_and(|auto| auto.trim() == "true")
        {
            let text = "inertias that SDF computes from collisions are not known here: {}";
            self.fields.log.note_each(inertial.place, text, name);
            inertial.set_aside();
            return (None, true);
        }
        let mut number = |element: Option<&Element>, tag: &'static str, default: f64| {
            let given = element.and_then(|e| e.content_of(tag));
            if given.is_none() && default != 0.0 {
                defaults.push(tag);
            }
            given.map_or(default, |text| self.fields.number(text).unwrap_or(default))
        };
        let mass = number(inertial, "mass", 1.0);
        let tensor = inertial.and_then(|i| i.child("inertia"));
        let entries = [
            ("ixx", 1.0),
            ("ixy", 0.0),
            ("ixz", 0.0),
            ("iyy", 1.0),
            ("iyz", 0.0),
            ("izz", 1.0),
        ];
        let tensor = entries.map(|(tag, default)| number(tensor, tag, default));
        if !defaults.is_empty() {
            let text = "1 kg or 1 kg m^2 by SDF's default, where the file states none: {}";
            let item = format!("'{name}'");
            self.fields.log.note_each(link.place, text, &item);
        }
        let (frame, said) = inertial.map_or((Pose::default(), None), |i| pose(i, self.fields));
        if let Some(said) = said {
            let hint = "the pose of <inertial> is given in the frame of its link";
            let message = "an inertial pose relative to another frame";
            self.fields.log.error(said.place, message, hint);
        }
        if mass < 0.0 {
            let hint = "a mass is zero or above";
            self.fields.log.error(link.place, "a negative mass", hint);
        }
        let inertia = Inertia {
            mass,
            com: frame.p,
            tensor: tensor_in(tensor, &transposed(&frame.r)),
        };
        (Some(inertia), false)
    }
}

/// The pose of an element, and the name that it is relative to.
pub(crate) fn pose<'e>(
    element: &'e Element,
    fields: &mut Fields<'_>,
) -> (Pose, Option<&'e Attribute>) {
    let Some(given) = element.child("pose") else {
        return (Pose::default(), None);
    };
    let said = given
        .attribute("relative_to")
        .or_else(|| given.attribute("frame"));
    let said = said.filter(|name| !name.value.trim().is_empty());
    let format = given.attribute("rotation_format");
    let is_quaternion = format.is_some_and(|f| f.value.trim() == "quat_xyzw");
    let degrees = given.attribute("degrees");
    let is_degrees = degrees.is_some_and(|d| matches!(d.value.trim(), "true" | "1"));
    let Some(text) = given.content() else {
        return (Pose::default(), said);
    };
    // numbers of the pose, as an attribute of their own
    let part = |from: usize, to: usize| {
        let words: Vec<&str> = text.value.split_whitespace().collect();
        let words = words.get(from..to.min(words.len())).unwrap_or_default();
        Attribute {
            value: words.join(" "),
            ..text.clone()
        }
    };
    let count = if is_quaternion { 7 } else { 6 };
    if text.value.split_whitespace().count() != count {
        let message = format!("a pose of {count} numbers stands here");
        let hint = "write x y z roll pitch yaw";
        fields.log.error(text.place, message, hint);
        return (Pose::default(), said);
    }
    let p = fields.position(&part(0, 3)).unwrap_or_default();
    let pose = if is_quaternion {
        let turn = fields.array::<4>(&part(3, 7));
        let turn = turn.and_then(|[x, y, z, w]| from_quaternion([w, x, y, z]));
        turn.map_or_else(|| Pose::shift(p), |r| Pose::new(p, r))
    } else {
        let angles = if is_degrees {
            let degrees = fields.array::<3>(&part(3, 6));
            degrees.map(|degrees| degrees.map(f64::to_radians))
        } else {
            fields.angles::<3>(&part(3, 6))
        };
        match angles {
            Some(rpy) if rpy != [0.0; 3] => Pose::from_rpy(p, rpy),
            _ => Pose::shift(p),
        }
    };
    (pose, said)
}
