//! URDF files: links and joints refer to each other by name; units are SI and rad.

use std::collections::BTreeMap;

use crate::fields::Fields;
use crate::log::Place;
use crate::notes::unread;
use crate::pose::{Pose, from_quaternion, tensor_in, transposed};
use crate::tree::{Coupling, Inertia, Joint, Kind, Link, Side, Tree};
use crate::unused::Row;
use crate::xml::{Attribute, Element, Reader};

pub(crate) mod closures;
mod motors;

/// What a shape consists of.
const SHAPE: &str = "name origin xyz rpy quat_xyzw geometry box size cylinder radius length sphere capsule \
                     mesh filename scale material color rgba texture verbose concave";

/// What of a URDF file has no effect on the dynamics.
pub(crate) const ROWS: &[Row] = &[
    Row::whole("visual", SHAPE),
    Row::whole("collision", SHAPE),
    Row::whole("material", SHAPE),
    Row::whole("sensor", "*"),
    Row::whole("contact", "*"),
    Row::whole("self_collision_checking", "*"),
    Row::whole(
        "safety_controller",
        "k_position k_velocity soft_lower_limit soft_upper_limit",
    ),
    Row::whole("calibration", "rising falling reference_position"),
    Row::whole("ros2_control", "*"),
    Row::whole("plugin", "*"),
    Row::whole("drake:collision_filter_group", "*"),
    Row::whole("drake:controller_gains", "*"),
    Row::parts("robot", "version"),
    Row::parts("link", "type concave"),
    // the lower triangle
    Row::parts("inertia", "iyx izx izy"),
    Row::parts("transmission", "hardwareInterface"),
    Row::parts("joint", "hardwareInterface"),
    Row::parts("actuator", "hardwareInterface"),
    Row::parts(
        "gazebo",
        "mu mu1 mu2 kp kd fdir1 selfCollide self_collide maxVel max_vel minDepth min_depth maxContacts \
         max_contacts laserRetro implicitSpringDamper provideFeedback cfmDamping fudgeFactor stopCfm stopErp \
         preserveFixedJoint disableFixedJointLumping static audio_source audio_sink",
    ),
];

/// Reads the robot of a URDF file, and what closes its loops in a file beside it; `None` if an error was
/// recorded.
pub(crate) fn read(
    root: &Element,
    fields: &mut Fields<'_>,
    reader: &mut Reader<'_>,
) -> Option<Tree> {
    if let Some(element) = find_xacro(root) {
        let hint = "expand the macros first: xacro FILE.xacro > FILE.urdf";
        fields
            .log
            .error(element.place, "a xacro macro, not yet URDF", hint);
        return None;
    }
    let mut tree = Tree {
        name: root.text("name").unwrap_or("robot").to_owned(),
        place: root.place,
        format: "URDF",
        ..Tree::default()
    };
    let links: Vec<&Element> = root.all("link").collect();
    let joints: Vec<&Element> = root.all("joint").chain(root.all("drake:joint")).collect();
    let index = names(&links, "link", fields);
    names(&joints, "joint", fields);
    // for each link, the joint to its parent
    let mut above: Vec<Option<(&Element, usize)>> = vec![None; links.len()];
    for joint in &joints {
        let parent = end(joint, "parent", &index, fields);
        let child = end(joint, "child", &index, fields);
        let (Some((parent, _)), Some((child, at))) = (parent, child) else {
            continue;
        };
        match above.get_mut(child) {
            Some(slot) if slot.is_none() => *slot = Some((joint, parent)),
            _ => fields.log.loop_error(
                at,
                "this link is the child of another joint already",
                "a URDF file is a tree: take one joint out, and close the loop with a cut",
            ),
        }
    }
    if fields.log.failed() {
        return None;
    }
    let order = ordered(root, &links, &above, fields)?;
    let position: BTreeMap<usize, usize> = order.iter().enumerate().map(|(i, l)| (*l, i)).collect();
    for link in order {
        let element = *links.get(link)?;
        let mut read = Link {
            name: element.text("name").unwrap_or_default().to_owned(),
            place: element.place,
            parent: None,
            pose: Pose::default(),
            joints: Vec::new(),
            inertia: inertia(element, fields),
            unknown: false,
        };
        if let Some((joint, parent)) = above.get(link).copied().flatten() {
            read.parent = position.get(&parent).copied();
            read.pose = origin(joint, fields);
            read.joints.extend(moving(joint, &mut tree, fields));
        }
        tree.links.push(read);
    }
    // the frame of a joint is that of the link that it carries
    for joint in &joints {
        let child = joint.child("child").and_then(|child| child.text("link"));
        let link = child.and_then(|name| tree.find(name));
        if let (Some(name), Some(link)) = (joint.text("name"), link) {
            let side = Side {
                link: Some(link),
                pose: Pose::default(),
            };
            tree.frames.push((name.to_owned(), side));
        }
    }
    motors::read(root, &mut tree, fields);
    if tree.actuated.is_empty() && tree.drives.is_empty() {
        // files of URDF+ say which coordinates the others follow from
        let independent = joints.iter().filter(|joint| {
            let said = joint.text("independent");
            said.is_some_and(|said| said.eq_ignore_ascii_case("true"))
        });
        let names = independent.filter_map(|joint| joint.text("name"));
        tree.actuated = names.map(str::to_owned).collect();
    }
    closures::read(root, &mut tree, fields);
    closures::read_beside(&mut tree, fields, reader);
    meshes(root, fields);
    (!fields.log.failed()).then_some(tree)
}

fn find_xacro(element: &Element) -> Option<&Element> {
    if element.tag.starts_with("xacro:") {
        return Some(element);
    }
    element.children.iter().find_map(find_xacro)
}

/// The index of each element by its name; errors for missing and duplicate names.
fn names(elements: &[&Element], what: &str, fields: &mut Fields<'_>) -> BTreeMap<String, usize> {
    let mut index = BTreeMap::new();
    for (at, element) in elements.iter().enumerate() {
        match element.attribute("name") {
            None => {
                let message = format!("a {what} without a name");
                fields
                    .log
                    .error(element.place, message, "write name=\"...\"");
            }
            Some(name) => {
                if index.insert(name.value.clone(), at).is_some() {
                    let message = format!("another {what} is called '{}' already", name.value);
                    fields.log.error(name.place, message, "rename one of them");
                }
            }
        }
    }
    index
}

/// The index of the link that a joint's `parent` or `child` names.
fn end(
    joint: &Element,
    which: &str,
    index: &BTreeMap<String, usize>,
    fields: &mut Fields<'_>,
) -> Option<(usize, Place)> {
    let name = joint.child(which).and_then(|e| e.attribute("link"));
    let Some(name) = name else {
        let message = format!("the joint has no {which}");
        let hint = format!("write <{which} link=\"...\"/> in it");
        fields.log.error(joint.place, message, &hint);
        return None;
    };
    let found = index.get(&name.value);
    if found.is_none() {
        let message = format!("no link is called '{}'", name.value);
        let hint = "joints connect links of the same file";
        fields.log.error(name.place, message, hint);
    }
    found.map(|link| (*link, name.place))
}

/// The links from the root outwards, siblings in the order of the file.
fn ordered(
    root: &Element,
    links: &[&Element],
    above: &[Option<(&Element, usize)>],
    fields: &mut Fields<'_>,
) -> Option<Vec<usize>> {
    let roots: Vec<usize> = (0..links.len())
        .filter(|l| above.get(*l).is_some_and(Option::is_none))
        .collect();
    let [first] = roots.as_slice() else {
        match roots.get(1).and_then(|l| links.get(*l)) {
            Some(second) => fields.log.error(
                second.place,
                "a second link that no joint carries",
                "a robot has one root: connect this link by a joint, or take it out",
            ),
            None => fields.log.loop_error(
                root.place,
                "no link is the root: the joints go round in a circle, or there is no link",
                "take one joint out, and close the loop with a cut",
            ),
        }
        return None;
    };
    let mut order = Vec::new();
    let mut waiting = vec![*first];
    while let Some(link) = waiting.pop() {
        order.push(link);
        let children = (0..links.len()).filter(|l| {
            above
                .get(*l)
                .is_some_and(|a| a.is_some_and(|a| a.1 == link))
        });
        let mut children: Vec<usize> = children.collect();
        children.reverse();
        waiting.extend(children);
    }
    if order.len() == links.len() {
        return Some(order);
    }
    let lost = (0..links.len()).find(|l| !order.contains(l));
    if let Some(link) = lost.and_then(|l| links.get(l)) {
        fields.log.loop_error(
            link.place,
            "this link is part of a circle of joints that does not reach the root",
            "take one joint out, and close the loop with a cut",
        );
    }
    None
}

/// The pose in an element's `<origin>`; the identity if it is missing.
fn origin(element: &Element, fields: &mut Fields<'_>) -> Pose {
    let origin = element.child("origin");
    origin.map_or_else(Pose::default, |origin| origin_in(origin, fields))
}

/// The pose that an `<origin>` or an element like it states.
fn origin_in(origin: &Element, fields: &mut Fields<'_>) -> Pose {
    let xyz = origin.attribute("xyz").and_then(|a| fields.position(a));
    let xyz = xyz.unwrap_or_default();
    if let Some(turn) = origin.attribute("quat_xyzw") {
        let Some([x, y, z, w]) = fields.array::<4>(turn) else {
            return Pose::default();
        };
        if let Some(r) = from_quaternion([w, x, y, z]) {
            return Pose::new(xyz, r);
        }
        let message = "a quaternion of length zero";
        fields
            .log
            .error(turn.place, message, "write x y z w of a rotation");
    }
    let rpy = origin.attribute("rpy").and_then(|a| fields.angles::<3>(a));
    match rpy {
        Some(rpy) if rpy != [0.0; 3] => Pose::from_rpy(xyz, rpy),
        _ => Pose::shift(xyz),
    }
}

fn required<'a>(
    element: &'a Element,
    name: &str,
    fields: &mut Fields<'_>,
) -> Option<&'a Attribute> {
    let found = element.attribute(name);
    if found.is_none() {
        let message = format!("<{}> has no {name}", element.tag);
        let hint = format!("write {name}=\"...\"");
        fields.log.error(element.place, message, &hint);
    }
    found
}

fn inertia(link: &Element, fields: &mut Fields<'_>) -> Option<Inertia> {
    let inertial = link.child("inertial")?;
    let pose = origin(inertial, fields);
    let mass = match inertial.child("mass") {
        Some(mass) => {
            let value = required(mass, "value", fields)?;
            let mass = fields.number(value)?;
            if mass < 0.0 {
                let hint = "a mass is zero or above";
                fields.log.error(value.place, "a negative mass", hint);
            }
            mass
        }
        None => 0.0,
    };
    let mut tensor = [0.0; 6];
    if let Some(entries) = inertial.child("inertia") {
        let names = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];
        for (entry, name) in tensor.iter_mut().zip(names) {
            let value = required(entries, name, fields)?;
            *entry = fields.number(value)?;
        }
    }
    Some(Inertia {
        mass,
        com: pose.p,
        tensor: tensor_in(tensor, &transposed(&pose.r)),
    })
}

/// Reads a joint and adds its coupling to the tree; `None` for fixed joints and after errors.
fn moving(joint: &Element, tree: &mut Tree, fields: &mut Fields<'_>) -> Option<Joint> {
    let kind = required(joint, "type", fields)?;
    let (kind, limited) = match kind.value.as_str() {
        "fixed" => {
            // tools write them for joints that do not move too
            for tag in ["axis", "limit", "dynamics", "joint_properties"] {
                joint.all(tag).for_each(Element::set_aside);
            }
            return None;
        }
        "revolute" => (Kind::Revolute, true),
        "continuous" => (Kind::Revolute, false),
        "prismatic" => (Kind::Prismatic, true),
        "floating" => (Kind::Free, false),
        "planar" => (Kind::Planar, false),
        "ball" | "spherical" => (Kind::Spherical, false),
        other => {
            let message = format!("unknown joint type '{other}'");
            let hint =
                "joints are revolute, continuous, prismatic, fixed, floating, planar, ball in URDF";
            fields.log.error(kind.place, message, hint);
            return None;
        }
    };
    let name = joint.text("name").unwrap_or_default().to_owned();
    let mut read = Joint::new(name.clone(), joint.place, kind);
    if matches!(kind, Kind::Revolute | Kind::Prismatic | Kind::Planar) {
        let axis = joint.child("axis").and_then(|a| a.attribute("xyz"));
        read.axis = match axis {
            Some(axis) => fields.direction(axis)?,
            None => [1.0, 0.0, 0.0],
        };
    }
    if let Some(limit) = joint.child("limit") {
        limits(limit, limited, &mut read, fields);
    }
    // some exporters write the name of the first versions of URDF
    let dynamics = joint.child("dynamics");
    if let Some(dynamics) = dynamics.or_else(|| joint.child("joint_properties")) {
        let mut value = |key| {
            let attribute = dynamics.attribute(key)?;
            let value = fields.number(attribute)?;
            if value < 0.0 {
                let text = format!("{key} {value} of '{name}' is negative: left out");
                fields.log.note(attribute.place, text);
            }
            Some(value.max(0.0))
        };
        read.damping = value("damping").unwrap_or(0.0);
        read.friction = value("friction").unwrap_or(0.0);
    }
    if let Some(mimic) = joint.child("mimic") {
        let other = required(mimic, "joint", fields)?;
        let mut value = |name, missing| match mimic.attribute(name) {
            Some(attribute) => fields.number(attribute),
            None => Some(missing),
        };
        let multiplier = value("multiplier", 1.0)?;
        let constant = value("offset", 0.0)?;
        tree.couplings.push(Coupling {
            joint: name,
            constant,
            terms: vec![(other.value.clone(), multiplier)],
            place: other.place,
        });
    }
    Some(read)
}

/// Reads limits; zeros and infinities mean that there is none.
fn limits(limit: &Element, limited: bool, joint: &mut Joint, fields: &mut Fields<'_>) {
    let mut value = |name| {
        let attribute = limit.attribute(name)?;
        // common readers accept "inf"
        let infinite = attribute.value.trim().parse().is_ok_and(f64::is_infinite);
        let number = if infinite {
            None
        } else {
            fields.number(attribute)
        };
        number.filter(|x| x.abs() < 1e9)
    };
    let (lower, upper) = (value("lower"), value("upper"));
    joint.velocity = value("velocity").filter(|v| *v > 0.0);
    let acceleration = value("acceleration").or_else(|| value("drake:acceleration"));
    joint.acceleration = acceleration.filter(|a| *a > 0.0);
    joint.jerk = value("jerk").filter(|j| *j > 0.0);
    let effort = value("effort").filter(|e| *e > 0.0);
    joint.effort = effort.map(|e| [-e, e]);
    if !limited {
        return;
    }
    if let (Some(lower), Some(upper)) = (lower, upper) {
        if lower < upper {
            joint.position = Some([lower, upper]);
        } else {
            let note = format!("the limits of '{}' leave no range: left out", joint.name);
            fields.log.note(limit.place, note);
        }
    }
}

fn meshes(root: &Element, fields: &mut Fields<'_>) {
    fn count(element: &Element) -> usize {
        usize::from(element.tag == "mesh") + element.children.iter().map(count).sum::<usize>()
    }
    let meshes = count(root);
    if meshes > 0 {
        let note = unread(meshes);
        fields.log.note(root.place, note);
    }
}
