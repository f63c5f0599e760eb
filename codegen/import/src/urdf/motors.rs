//! `<transmission>`s of a URDF file: which joints have motors, with ratios and rotors as drives.

use crate::fields::Fields;
use crate::tree::{Drive, Kind, Tree};
use crate::xml::{Attribute, Element};

/// A joint or a motor of a transmission, with its ratio.
struct End<'e> {
    name: &'e str,
    element: &'e Element,
    role: Option<&'e str>,
    ratio: f64,
}

/// Reads all transmissions, those of ros2_control too.
pub(super) fn read(root: &Element, tree: &mut Tree, fields: &mut Fields<'_>) {
    let mut all: Vec<&Element> = root.all("transmission").collect();
    let hardware = root.children.iter().filter(|c| c.tag == "ros2_control");
    for element in hardware {
        if element.children.iter().any(|c| c.tag == "transmission") {
            element.used.mark();
            all.extend(element.all("transmission"));
        }
    }
    for element in all {
        transmission(element, tree, fields);
    }
}

/// The number in an element's text or attribute `value`.
fn number(element: &Element, tags: &[&str], fields: &mut Fields<'_>) -> Option<f64> {
    let found = tags.iter().find_map(|tag| element.child(tag))?;
    let given: &Attribute = found.content().or_else(|| found.attribute("value"))?;
    fields.number(given)
}

/// The motor's inertia, kg m^2, by the names that are in use.
const INERTIA: [&str; 2] = ["motorInertia", "drake:rotor_inertia"];
/// The motor's ratio to its joint.
const RATIO: [&str; 3] = [
    "mechanicalReduction",
    "mechanical_reduction",
    "drake:gear_ratio",
];

fn ends<'e>(
    transmission: &'e Element,
    tag: &'static str,
    outer: f64,
    fields: &mut Fields<'_>,
) -> Vec<End<'e>> {
    let mut ends = Vec::new();
    for element in transmission.all(tag) {
        let Some(name) = element.text("name") else {
            let message = format!("a <{tag}> of a transmission without a name");
            fields
                .log
                .error(element.place, message, "write name=\"...\"");
            continue;
        };
        let role = element.attribute("role").map(|role| role.value.as_str());
        let role = role.or_else(|| element.content_of("role").map(|role| role.value.as_str()));
        ends.push(End {
            name,
            element,
            role,
            ratio: number(element, &RATIO, fields).unwrap_or(outer),
        });
    }
    // joint1 before joint2, as the roles say
    ends.sort_by_key(|end| end.role);
    ends
}

fn transmission(element: &Element, tree: &mut Tree, fields: &mut Fields<'_>) {
    let _ = element.attribute("name");
    let kind = element.content_of("type").or(element.content_of("plugin"));
    let kind = kind.or_else(|| element.attribute("type"));
    let kind = kind.map_or("SimpleTransmission", |kind| kind.value.as_str());
    let kind = kind.rsplit(['/', ':']).next().unwrap_or(kind);
    // transmissions of the PR2 have the ratio beside the motor
    let outer = number(element, &RATIO, fields).unwrap_or(1.0);
    let joints = ends(element, "joint", 1.0, fields);
    let motors = ends(element, "actuator", outer, fields);
    for joint in &joints {
        if tree.joint(joint.name).is_none() && !fields.log.failed() {
            let text = "transmissions of joints that do not move are left out: {}";
            fields.log.note_of(joint.element.place, text, joint.name);
        }
    }
    let moves = |end: &End<'_>| tree.joint(end.name).is_some();
    let term = |end: &End<'_>, factor: f64| (end.name.to_owned(), factor);
    let drives: Vec<Vec<(String, f64)>> = match (kind, joints.as_slice(), motors.as_slice()) {
        ("DifferentialTransmission", [a, b], [first, second]) if moves(a) && moves(b) => {
            let (x, y) = (a.ratio, b.ratio);
            vec![
                vec![term(a, first.ratio * x), term(b, first.ratio * y)],
                vec![term(a, second.ratio * x), term(b, -second.ratio * y)],
            ]
        }
        ("FourBarLinkageTransmission", [a, b], [first, second]) if moves(a) && moves(b) => {
            let (x, y) = (a.ratio, b.ratio);
            vec![
                vec![term(a, first.ratio * x)],
                vec![term(a, second.ratio), term(b, second.ratio * y)],
            ]
        }
        (_, [joint], [motor]) if moves(joint) => {
            if kind != "SimpleTransmission" {
                let text = "transmissions of this kind are taken as simple ones: {}";
                fields.log.note_of(element.place, text, kind);
            }
            vec![vec![term(joint, motor.ratio * joint.ratio)]]
        }
        (_, joints, motors) => {
            if motors.iter().any(|motor| motor.ratio != 1.0) || joints.len() > 1 {
                let text = "ratios of transmissions of this kind are left out: {}";
                fields.log.note_of(element.place, text, kind);
            }
            let names = joints.iter().map(|joint| joint.name.to_owned());
            tree.actuated.extend(names);
            return;
        }
    };
    for (terms, motor) in drives.into_iter().zip(&motors) {
        let inertia = number(motor.element, &INERTIA, fields).unwrap_or(0.0);
        drive(motor, terms, inertia, tree, fields);
    }
}

/// Adds a drive, or the motor of a joint that it turns without a ratio.
fn drive(
    motor: &End<'_>,
    terms: Vec<(String, f64)>,
    inertia: f64,
    tree: &mut Tree,
    fields: &mut Fields<'_>,
) {
    if terms
        .iter()
        .any(|(_, factor)| *factor == 0.0 || !factor.is_finite())
    {
        let message = format!("the motor '{}' has a ratio of 0", motor.name);
        let hint = "write how far the motor turns while its joint turns once";
        fields.log.error(motor.element.place, message, hint);
        return;
    }
    let single = match terms.as_slice() {
        [(joint, factor)] => Some((joint.clone(), *factor)),
        _ => None,
    };
    if let Some((name, 1.0)) = &single {
        let joints = tree.links.iter_mut().flat_map(|link| &mut link.joints);
        for joint in joints.filter(|joint| joint.name == *name) {
            joint.armature += inertia;
        }
        tree.actuated.push(name.clone());
        return;
    }
    let effort = single.and_then(|(name, factor)| {
        let limits = tree.joint(&name)?.effort?;
        let ends = limits.map(|effort| effort / factor);
        Some([ends[0].min(ends[1]), ends[0].max(ends[1])])
    });
    let slides = |(name, factor): &(String, f64)| {
        let slides = tree.joint(name).is_some_and(|j| j.kind == Kind::Prismatic);
        slides && factor.abs() == 1.0
    };
    tree.drives.push(Drive {
        name: motor.name.to_owned(),
        place: motor.element.place,
        slides: terms.iter().all(slides),
        terms,
        damping: 0.0,
        friction: 0.0,
        armature: inertia,
        position: None,
        effort,
    });
}
