//! What closes loops of a URDF file or ties its joints together: urdfdom's `<constraint>`, `<loop>` and
//! `<coupling>` of URDF+, Drake's constraints, SDF joints in `<gazebo>`, and a `robot.yaml` of Gepetto
//! beside the file.

use regen_codegen::diag::{Source, Span};
use serde_json::Value;

use crate::fields::Fields;
use crate::frames::axis_vector;
use crate::log::Place;
use crate::pose::{Pose, V3, cross, dot, norm, scaled, times};
use crate::sdf;
use crate::tree::{Coupling, Joint, Kind, LoopCut, Side, Spring, Tree};
use crate::xml::{Attribute, Element, Reader};

use super::{origin, origin_in, required};

/// The elements of closures and couplings, of urdfdom, of URDF+ and of its first versions.
const CLOSURES: [&str; 4] = ["constraint", "loop", "loop_constraint", "coupling"];

/// The names of the links that a closure connects: the first one, then the second one.
const SIDES: [[&str; 2]; 2] = [["predecessor", "parent"], ["successor", "child"]];

/// Directions that differ by no more than this are parallel.
const PARALLEL: f64 = 1e-6;

/// Reads all closures, couplings and springs between links.
pub(super) fn read(root: &Element, tree: &mut Tree, fields: &mut Fields<'_>) {
    for element in &root.children {
        let tag = element.tag.as_str();
        if CLOSURES.contains(&tag) {
            element.used.mark();
            if element.children.iter().any(|child| child.tag == "ratio") {
                let coupling = coupling(element, tree, fields);
                tree.couplings.extend(coupling);
            } else {
                let closure = closure(element, tree, fields);
                tree.closures.extend(closure);
            }
        }
    }
    read_drake(root, tree, fields);
    for gazebo in root.all("gazebo") {
        for joint in gazebo.all("joint") {
            let closure = sdf::closure(joint, tree, fields);
            tree.closures.extend(closure);
        }
        springs_of_gazebo(gazebo, tree, fields);
    }
}

/// Reads Drake's constraints and springs between links of a robot or model.
pub(crate) fn read_drake(root: &Element, tree: &mut Tree, fields: &mut Fields<'_>) {
    for element in &root.children {
        let tag = element.tag.as_str();
        if let Some(kind) = drake_kind(tag) {
            element.used.mark();
            let sides = drake_sides(element, tree, fields);
            tree.closures.extend(sides.map(|sides| LoopCut {
                name: element.text("name").unwrap_or("closure").to_owned(),
                kind: kind.to_owned(),
                sides,
            }));
        } else if tag == "drake:linear_spring_damper" {
            element.used.mark();
            let spring = drake_spring(element, tree, fields);
            tree.springs.extend(spring);
        }
    }
}

/// The kind of cut of a Drake constraint.
fn drake_kind(tag: &str) -> Option<&'static str> {
    match tag {
        "drake:ball_constraint" => Some("spherical"),
        "drake:weld_constraint" => Some("fixed"),
        _ => None,
    }
}

/// The frame of the link that one of an element's sides names.
fn side(
    element: &Element,
    names: [&'static str; 2],
    tree: &Tree,
    fields: &mut Fields<'_>,
) -> Option<(Side, &'static str)> {
    let found = names
        .into_iter()
        .find_map(|name| Some((element.child(name)?, name)));
    let Some((side, which)) = found else {
        let message = format!("<{}> has no <{}>", element.tag, names[0]);
        let hint = format!("write <{} link=\"...\"/> or <{} .../>", names[0], names[1]);
        fields.log.error(element.place, message, &hint);
        return None;
    };
    let name = side.attribute("link").or_else(|| side.attribute("name"));
    let Some(name) = name else {
        let message = format!("<{which}> names no link");
        fields.log.error(side.place, message, "write link=\"...\"");
        return None;
    };
    let mut frame = named_frame(name, tree, fields)?;
    frame.pose = frame.pose.then(&origin(side, fields));
    if let Some(apart) = element.child(&format!("{which}_origin")) {
        frame.pose = frame.pose.then(&origin_in(apart, fields));
    }
    Some((frame, which))
}

/// The frame that an attribute names.
fn named_frame(name: &Attribute, tree: &Tree, fields: &mut Fields<'_>) -> Option<Side> {
    let value = name.value.trim();
    let found = tree.frame(value).or((value == "world").then(Side::default));
    if found.is_none() {
        let message = format!("no link is called '{value}'");
        let hint = "closures connect links of the same file";
        fields.log.error(name.place, message, hint);
    }
    found
}

/// The direction in an element's child of this name.
fn direction(element: &Element, tag: &str, fields: &mut Fields<'_>) -> Option<V3> {
    let axis = element.child(tag)?.attribute("xyz")?;
    fields.direction(axis)
}

/// A loop that is closed by a joint between frames on two links.
fn closure(element: &Element, tree: &Tree, fields: &mut Fields<'_>) -> Option<LoopCut> {
    let (first, first_name) = side(element, SIDES[0], tree, fields)?;
    let (second, second_name) = side(element, SIDES[1], tree, fields)?;
    let name = element.text("name").unwrap_or("closure").to_owned();
    let kind = element.attribute("type");
    let said = kind.map_or("spherical", |kind| kind.value.as_str());
    let (kind, has_axis) = match said {
        "revolute" | "continuous" => ("revolute", true),
        "prismatic" | "cylindrical" | "universal" => (said, true),
        "spherical" | "ball" | "3d" => ("spherical", false),
        "fixed" | "weld" | "6d" => ("fixed", false),
        other => {
            let message = format!("a loop cannot be closed by a joint of type '{other}'");
            let hint = "closures are revolute, continuous, prismatic, cylindrical, universal, spherical, \
                        fixed";
            let place = kind.map_or(element.place, |kind| kind.place);
            fields.log.error(place, message, hint);
            return None;
        }
    };
    if !has_axis {
        return Some(LoopCut {
            name,
            kind: kind.to_owned(),
            sides: [first, second],
        });
    }
    let both = direction(element, "axis", fields);
    let own =
        |name: &str, fields: &mut Fields<'_>| direction(element, &format!("{name}_axis"), fields);
    let axes = [own(first_name, fields), own(second_name, fields)];
    let are_both_stated = axes.iter().all(Option::is_some);
    let axes = match (both, axes) {
        (_, [Some(a), Some(b)]) => Some([a, b]),
        (_, [Some(a), None] | [None, Some(a)]) | (Some(a), _) => Some([a, a]),
        (None, [None, None]) => common_axis(tree, &[first, second]),
    };
    let (kind, sides) = match axes {
        // the first axis of a universal joint is x before it, the second one y behind it
        Some([a, b]) if kind == "universal" => {
            let [x, y] = in_world(tree, [&first, &second], [a, b]);
            if !are_both_stated || norm(cross(x, y)) <= PARALLEL {
                let message = format!("the universal closure '{name}' has one axis");
                let hint =
                    format!("write <{first_name}_axis xyz=\"...\"/> and <{second_name}_axis .../>");
                fields.log.error(element.place, message, &hint);
            }
            (kind, [first.with_axis('x', a), second.with_axis('y', b)])
        }
        Some([a, b]) => {
            // axes that point apart where the file draws them are those of the same hinge too
            let [x, y] = in_world(tree, [&first, &second], [a, b]);
            let b = if dot(x, y) < 0.0 { scaled(b, -1.0) } else { b };
            (kind, [first.with_axis('z', a), second.with_axis('z', b)])
        }
        None => {
            let text = format!(
                "the {kind} closure '{name}' states no axis, and its links turn about different ones: only \
                 its points are held together"
            );
            fields.log.note(element.place, text);
            ("spherical", [first, second])
        }
    };
    Some(LoopCut {
        name,
        kind: kind.to_owned(),
        sides,
    })
}

/// Directions in the frames of two sides, in the world where the file draws the robot.
fn in_world(tree: &Tree, sides: [&Side; 2], axes: [V3; 2]) -> [V3; 2] {
    let [first, second] = sides.map(|side| tree.at_zero(side.link).then(&side.pose).r);
    [times(&first, axes[0]), times(&second, axes[1])]
}

/// The direction about which both links turn, in each of the two frames, if it is the same one where
/// the file draws the robot.
fn common_axis(tree: &Tree, sides: &[Side; 2]) -> Option<[V3; 2]> {
    let [a, b] = sides.each_ref().map(|side| {
        let joints = &tree.links.get(side.link?)?.joints;
        let [joint] = joints.as_slice() else {
            return None;
        };
        let world = tree.at_zero(side.link);
        let frame = world.then(&side.pose);
        let axis = times(&world.r, joint.axis);
        (joint.kind == Kind::Revolute).then_some((axis, frame))
    });
    let ((axis, first), (other, second)) = a.zip(b)?;
    let is_same = norm(cross(axis, other)) <= PARALLEL;
    is_same.then(|| [first, second].map(|frame| times(&frame.inverse().r, axis)))
}

/// Joints that turn with a ratio: the angle of the successor against the link that carries both is the
/// ratio times that of the predecessor.
fn coupling(element: &Element, tree: &Tree, fields: &mut Fields<'_>) -> Option<Coupling> {
    let (first, _) = side(element, SIDES[0], tree, fields)?;
    let (second, _) = side(element, SIDES[1], tree, fields)?;
    let _ = element.attribute("name");
    let _ = element.attribute("type");
    let ratio = required(element.child("ratio")?, "value", fields)?;
    let ratio = fields.number(ratio)?;
    let path = |mut link: Option<usize>| {
        let mut path = Vec::new();
        while let Some(found) = link.and_then(|at| tree.links.get(at)) {
            path.extend(link);
            link = found.parent;
        }
        path
    };
    let (ahead, behind) = (path(first.link), path(second.link));
    let joints = |own: &[usize], other: &[usize]| -> Vec<String> {
        let own = own.iter().filter(|link| !other.contains(link));
        let joints = own.filter_map(|link| tree.links.get(*link));
        let joints = joints.flat_map(|link| &link.joints);
        joints.map(|joint| joint.name.clone()).collect()
    };
    let mut followers = joints(&behind, &ahead).into_iter();
    let Some(joint) = followers.next() else {
        let message = "no joint moves the successor against the link that carries both";
        let hint = "a coupling ties a joint of the successor to those of the predecessor";
        fields.log.error(element.place, message, hint);
        return None;
    };
    let leaders = joints(&ahead, &behind).into_iter();
    let terms = leaders.map(|name| (name, ratio));
    Some(Coupling {
        joint,
        constant: 0.0,
        terms: terms.chain(followers.map(|name| (name, -1.0))).collect(),
        place: element.place,
    })
}

/// The frames that a constraint of Drake holds together: points of bodies, or named frames.
fn drake_sides(element: &Element, tree: &Tree, fields: &mut Fields<'_>) -> Option<[Side; 2]> {
    let points = [["body_A", "p_AP"], ["body_B", "p_BQ"]];
    let [a, b] = points.map(|[body, point]| {
        let name = drake(element, body, fields)?;
        let mut side = named_frame(name, tree, fields)?;
        let part = |end: &str| {
            let part = element.child(&format!("{}_{end}", element.tag))?;
            part.attribute("value").or_else(|| part.content())
        };
        if let Some(at) = part(point) {
            side.pose = Pose::shift(fields.position(at)?);
        }
        Some(side)
    });
    Some([a?, b?])
}

/// The name of a part of a Drake element.
fn drake<'e>(element: &'e Element, part: &str, fields: &mut Fields<'_>) -> Option<&'e Attribute> {
    let tag = format!("{}_{part}", element.tag);
    let Some(found) = element.child(&tag) else {
        let message = format!("<{}> has no <{tag}>", element.tag);
        let hint = format!("write <{tag} name=\"...\"/> in it");
        fields.log.error(element.place, message, &hint);
        return None;
    };
    // a name in URDF, a text in SDF
    found.content().or_else(|| required(found, "name", fields))
}

fn drake_spring(element: &Element, tree: &Tree, fields: &mut Fields<'_>) -> Option<Spring> {
    let sides = drake_sides(element, tree, fields)?;
    let mut value = |part: &str| {
        let tag = format!("{}_{part}", element.tag);
        let part = element.child(&tag)?;
        let given = part.content().or_else(|| required(part, "value", fields))?;
        fields.number(given)
    };
    Some(Spring {
        name: element.text("name").unwrap_or("spring").to_owned(),
        place: element.place,
        ends: sides.map(|side| (side.link, side.pose.p)),
        length: value("free_length")?,
        stiffness: value("stiffness")?,
    })
}

/// Reads the spring of the joint to which a `<gazebo>` refers.
fn springs_of_gazebo(gazebo: &Element, tree: &mut Tree, fields: &mut Fields<'_>) {
    let Some(name) = gazebo.text("reference") else {
        return;
    };
    let mut joints = tree.links.iter_mut().flat_map(|link| &mut link.joints);
    let Some(joint) = joints.find(|joint| joint.name == name) else {
        return;
    };
    for (tag, value) in [
        ("springStiffness", &mut joint.stiffness),
        ("springReference", &mut joint.spring_rest),
    ] {
        if let Some(given) = gazebo.content_of(tag) {
            *value = fields.number(given).unwrap_or(0.0);
        }
    }
}

/// The name of the file beside a URDF file that closes its loops, as Gepetto's collection has it.
const BESIDE: &str = "robot.yaml";

/// The keys of it that are read.
const READ: [&str; 5] = [
    "closed_loop",
    "type",
    "name_mot",
    "joint_name",
    "joint_type",
];

/// Reads the closures, motors and joint types of a `robot.yaml` beside the file, if there is one.
pub(super) fn read_beside(tree: &mut Tree, fields: &mut Fields<'_>, reader: &mut Reader<'_>) {
    let Some(text) = reader(BESIDE).ok().and_then(|b| String::from_utf8(b).ok()) else {
        return;
    };
    let found = serde_saphyr::from_str::<Value>(&text);
    if let Err(why) = &found
        && READ.iter().any(|key| text.contains(key))
    {
        let why = why.to_string();
        let why = why.lines().next().unwrap_or_default();
        let message = format!("no YAML: {}", why.trim_start_matches("error: "));
        let file = fields.log.add(Source::new(BESIDE, text));
        let hint = "it may close loops of the URDF file: correct it, or move it elsewhere";
        fields
            .log
            .error(Place::new(file, Span::new(0, 0)), message, hint);
        return;
    }
    let all = found.ok().and_then(|all| all.as_object().cloned());
    let all = all.unwrap_or_default();
    if !all.keys().any(|key| READ.contains(&key.as_str())) {
        let file = fields.log.add(Source::new(BESIDE, text));
        let note = "not read: it closes no loops, and names no motors";
        fields.log.note(Place::new(file, Span::new(0, 0)), note);
        return;
    }
    let pairs = all.get("closed_loop").and_then(Value::as_array);
    let pairs = pairs.map(Vec::as_slice).unwrap_or_default();
    // a name may be written otherwise there, as by an escape
    let word = |key: &str| match text.find(key) {
        Some(at) => Span::new(at, at + key.len()),
        None => Span::new(0, 0),
    };
    let place_of = |file: usize, key: &str| Place::new(file, word(key));
    let file = fields.log.add(Source::new(BESIDE, text.clone()));
    let note = format!("{} loops are closed as this file says", pairs.len());
    fields.log.note(place_of(file, "closed_loop"), note);
    let strings = |key: &str| -> Vec<String> {
        let all = all.get(key).and_then(Value::as_array);
        let words = all.into_iter().flatten().filter_map(Value::as_str);
        words.map(str::to_owned).collect()
    };
    for key in ["closed_loop", "type", "joint_name", "joint_type"] {
        if all.get(key).is_some_and(|own| !own.is_array()) {
            let hint = "closed_loop, type, joint_name and joint_type are lists";
            fields
                .log
                .error(place_of(file, key), format!("{key} is no list"), hint);
        }
    }
    let kinds = strings("type");
    if kinds.len() > pairs.len() {
        let message = format!("{} types of {} closed loops", kinds.len(), pairs.len());
        let hint = "each pair of closed_loop has a type, 3d or 6d";
        fields.log.error(place_of(file, "type"), message, hint);
    }
    for (k, pair) in pairs.iter().enumerate() {
        let names = pair.as_array().map(Vec::as_slice).unwrap_or_default();
        let names: Vec<&str> = names.iter().filter_map(Value::as_str).collect();
        let [first, second] = names.as_slice() else {
            let message = "a closed loop is a pair of frames";
            let hint = "write closed_loop: [[FRAME, FRAME], ...]";
            fields
                .log
                .error(place_of(file, "closed_loop"), message, hint);
            continue;
        };
        let mut frame = |name: &str| {
            let found = tree.frame(name);
            if found.is_none() {
                let message = format!("no link is called '{name}'");
                let hint = "the frames of closed_loop are links of the URDF file";
                fields.log.error(place_of(file, name), message, hint);
            }
            found
        };
        let (Some(a), Some(b)) = (frame(first), frame(second)) else {
            continue;
        };
        let kind = match kinds.get(k).map(|kind| kind.to_ascii_lowercase()) {
            Some(kind) if kind == "3d" => "spherical",
            Some(kind) if kind == "6d" => "fixed",
            other => {
                let message = match other {
                    Some(kind) => format!("a closure of type '{kind}'"),
                    None => "a closure without a type".to_owned(),
                };
                let hint = "each pair of closed_loop has a type, 3d or 6d";
                fields.log.error(place_of(file, "type"), message, hint);
                continue;
            }
        };
        tree.closures.push(LoopCut {
            name: format!("{first}_{second}"),
            kind: kind.to_owned(),
            sides: [a, b],
        });
    }
    if all.contains_key("name_mot")
        && let Some(note) = motors(&all, &strings("name_mot"), tree)
    {
        fields.log.note(place_of(file, "name_mot"), note);
    }
    let (turned, kinds) = (strings("joint_name"), strings("joint_type"));
    if turned.len() != kinds.len() {
        let message = format!("{} types of {} joints", kinds.len(), turned.len());
        let hint = "each of joint_name has its own of joint_type";
        fields
            .log
            .error(place_of(file, "joint_type"), message, hint);
    }
    for (name, kind) in turned.iter().zip(kinds) {
        if tree.joint(name).is_none() {
            let text = "joints that the URDF file has not: {}";
            fields.log.note_each(place_of(file, name), text, name);
        } else if !turn_into(tree, name, &kind.to_ascii_uppercase()) {
            let message = format!("the joint '{name}' cannot become '{kind}'");
            let hint = "joint_name and joint_type make joints of the URDF file FIXED or SPHERICAL, or UJOINT_XY with two of \
                        the axes";
            fields.log.error(place_of(file, name), message, hint);
        }
    }
    for key in all.keys().filter(|key| !READ.contains(&key.as_str())) {
        let text = "not used in robot.yaml: {}";
        fields.log.note_each(place_of(file, key), text, key);
    }
}

/// Turns a joint into a rigid one, a ball, or two hinges about axes of its frame; whether that was possible.
fn turn_into(tree: &mut Tree, name: &str, kind: &str) -> bool {
    let has = |joint: &Joint| joint.name == name;
    let links = tree.links.iter_mut();
    let Some(link) = links.into_iter().find(|link| link.joints.iter().any(has)) else {
        return false;
    };
    let own = link.joints.clone();
    let Some(joint) = own.iter().find(|joint| has(joint)) else {
        return false;
    };
    let part = |letter: char| {
        let axis = match letter {
            'X' => 'x',
            'Y' => 'y',
            'Z' => 'z',
            _ => return None,
        };
        Some(Joint {
            name: format!("{name}_{axis}"),
            kind: Kind::Revolute,
            axis: axis_vector(axis),
            passive: true,
            position: None,
            ..joint.clone()
        })
    };
    let axes: Vec<char> = kind.strip_prefix("UJOINT_").unwrap_or("").chars().collect();
    let joints = match (kind, axes.as_slice()) {
        ("FIXED", _) => Some(Vec::new()),
        ("SPHERICAL", _) => Some(vec![Joint {
            kind: Kind::Spherical,
            position: None,
            ..joint.clone()
        }]),
        (_, [first, second]) => part(*first).zip(part(*second)).map(|(a, b)| vec![a, b]),
        _ => None,
    };
    let found = joints.is_some();
    link.joints = joints.unwrap_or(own);
    found
}

/// Takes the joints that `name_mot` lists, or all whose names contain its word, as the actuated ones; returns what is
/// left out thereby.
fn motors(
    all: &serde_json::Map<String, Value>,
    listed: &[String],
    tree: &mut Tree,
) -> Option<String> {
    let word = all.get("name_mot").and_then(Value::as_str);
    let joints = tree.links.iter().flat_map(|link| &link.joints);
    let joints = joints.map(|joint| joint.name.clone());
    let chosen =
        joints.filter(|name| listed.contains(name) || word.is_some_and(|word| name.contains(word)));
    let chosen: Vec<String> = chosen.collect();
    let missing = listed.iter().filter(|name| !chosen.contains(name));
    let missing: Vec<&str> = missing.map(String::as_str).collect();
    if chosen.is_empty() {
        return Some("no joint is called so: the motors are those of the URDF file".to_owned());
    }
    let ratios = !tree.drives.is_empty();
    tree.actuated = chosen;
    tree.drives.clear();
    match (&missing[..], ratios) {
        ([], false) => None,
        ([], true) => Some("motors at joints, without the drives of the URDF file".to_owned()),
        (missing, _) => Some(format!("no joint is called {}", missing.join(", "))),
    }
}
