//! Joints between two bodies, with a frame on each, and what drives and resists them.

use crate::pose::{Pose, V3};
use crate::sdf::SdfJoint;
use crate::tree::{Coupling, Joint, Kind};
use crate::xml::{Attribute, Element};

use super::{Reading, has_schema, is_true};

const DIRECTIONS: [&str; 6] = ["transX", "transY", "transZ", "rotX", "rotY", "rotZ"];

/// The instances of limits, drives and frictions of a joint with one direction of turn or shift.
const TURN: &[&str] = &["angular", "rotX", "rotY", "rotZ"];
const SHIFT: &[&str] = &["linear", "transX", "transY", "transZ"];

/// Numbers from this one on stand for infinity: the largest of single precision is 3.4e38.
const UNLIMITED: f64 = 1e30;
/// The velocity that PhysX takes as no limit, in degrees or units of length per second.
const UNLIMITED_VELOCITY: f64 = 1e6;

/// A motion of a joint: its kind, the letter of its axis, and the instances that its limits, drives and frictions
/// have.
type Motion<'s> = (Kind, String, &'s [&'static str]);

impl<'a> Reading<'a, '_, '_> {
    /// Reads a joint; `None` if it is left out, or after an error.
    pub(super) fn joint(&mut self, path: &str, element: &'a Element) -> Option<SdfJoint<'a>> {
        let name = self.name(path);
        if element
            .text("physics:jointEnabled")
            .is_some_and(|text| !is_true(text))
        {
            let text = "joints that are not enabled are left out: {}";
            self.fields.log.note_each(element.place, text, &name);
            element.set_aside();
            return None;
        }
        let axis = element.text("physics:axis").unwrap_or("X").to_owned();
        let (kind, parts): (&str, Vec<Motion<'_>>) = match element.tag.as_str() {
            "PhysicsFixedJoint" => ("fixed", Vec::new()),
            "PhysicsRevoluteJoint" => ("revolute", vec![(Kind::Revolute, axis, TURN)]),
            "PhysicsPrismaticJoint" => ("prismatic", vec![(Kind::Prismatic, axis, SHIFT)]),
            "PhysicsSphericalJoint" => ("ball", vec![(Kind::Spherical, axis, &[])]),
            "PhysicsJoint" => self.free_directions(element)?,
            other => {
                let message = format!("'{name}' is a {other}, which cannot be expressed");
                let hint = format!(
                    "joints are revolute, prismatic, spherical and fixed here; `--ignore {other}` leaves it out"
                );
                self.fields.log.error(element.place, message, &hint);
                return None;
            }
        };
        let (links, on) = self.ends(element, &name)?;
        if links == [None, None] {
            let text = "joints between parts of the world are left out: {}";
            self.fields.log.note_each(element.place, text, &name);
            return None;
        }
        if links[0] == links[1] {
            let message = format!("'{name}' connects a body with itself");
            self.fields
                .log
                .error(element.place, message, "write body0 and body1 of it");
            return None;
        }
        let mut joint = SdfJoint {
            name: name.clone(),
            element,
            kind,
            links,
            frame: Pose::default(),
            on,
            parts: Vec::new(),
            mimics: Vec::new(),
            is_closing: element
                .text("physics:excludeFromArticulation")
                .is_some_and(is_true),
        };
        for (kind, axis, instances) in parts {
            let mut part = Joint::new(name.clone(), element.place, kind);
            part.axis = match axis.as_str() {
                "X" => [1.0, 0.0, 0.0],
                "Y" => [0.0, 1.0, 0.0],
                "Z" => [0.0, 0.0, 1.0],
                other => {
                    let message = format!("the axis of '{name}' is {other}");
                    self.fields
                        .log
                        .error(element.place, message, "it is X, Y or Z");
                    return None;
                }
            };
            if kind != Kind::Spherical {
                self.limits(element, &mut part, instances);
                joint.mimics.extend(self.mimic(element, &name));
            }
            joint.parts.push(part);
        }
        if joint.mimics.is_empty() && !joint.parts.is_empty() && self.is_driven(element) {
            self.tree.actuated.push(name);
        }
        Some(joint)
    }

    /// The kind of a joint of which all directions are free that no limit locks.
    fn free_directions(
        &mut self,
        element: &Element,
    ) -> Option<(&'static str, Vec<Motion<'static>>)> {
        let free = free_of(element);
        let one_way = |kind: Kind, free: &'static str| {
            let axis = free.chars().last().unwrap_or('X').to_string();
            let own = DIRECTIONS.iter().position(|name| *name == free);
            let instances = own.and_then(|k| DIRECTIONS.get(k..=k));
            vec![(kind, axis, instances.unwrap_or_default())]
        };
        Some(match free.as_slice() {
            [] => ("fixed", Vec::new()),
            [one] if one.starts_with("rot") => ("revolute", one_way(Kind::Revolute, one)),
            [one] => ("prismatic", one_way(Kind::Prismatic, one)),
            ["rotX", "rotY", "rotZ"] => ("ball", vec![(Kind::Spherical, "X".to_owned(), &[])]),
            all => {
                let message = format!(
                    "a joint that leaves {} free cannot be expressed",
                    all.join(", ")
                );
                let hint = "joints leave one direction, three turns or nothing free; `--ignore PhysicsJoint` leaves \
                            such joints out";
                self.fields.log.error(element.place, message, hint);
                return None;
            }
        })
    }

    /// The bodies at both ends, with the frames on them.
    fn ends(&mut self, element: &Element, name: &str) -> Option<([Option<usize>; 2], [Pose; 2])> {
        let (mut links, mut on) = ([None, None], [Pose::default(), Pose::default()]);
        for k in 0..2 {
            let position = element.attribute(&format!("physics:localPos{k}"));
            let position = position.and_then(|a| self.vector(a)).unwrap_or_default();
            let turn = element.attribute(&format!("physics:localRot{k}"));
            let turn = turn.and_then(|a| self.quaternion(a));
            let body = element.attribute(&format!("physics:body{k}"));
            let body = body.filter(|a| !matches!(a.value.as_str(), "" | "None"));
            let drawn = body.map(|a| (a, self.prims.get(&a.value).copied()));
            if let Some((at, None)) = drawn {
                let message = format!(
                    "'{name}' is at '{}', which this file does not define",
                    at.value
                );
                let hint = "joints connect prims of the same file";
                self.fields.log.error(at.place, message, hint);
                return None;
            }
            let drawn = drawn.and_then(|(_, drawn)| drawn);
            let scale = drawn.map_or([1.0; 3], |drawn| drawn.scale);
            let p: V3 = [0, 1, 2].map(|i| position[i] * scale[i] * self.meter);
            let own = turn.map_or_else(|| Pose::shift(p), |r| Pose::new(p, r));
            links[k] = drawn.and_then(|drawn| drawn.body);
            let world = drawn.map_or_else(Pose::default, |drawn| drawn.world);
            on[k] = match links[k] {
                Some(body) => self.drawn(body).world.inverse().then(&world).then(&own),
                None => world.then(&own),
            };
            // the frame of a body itself, with its digits
            if links[k].is_some_and(|body| self.bodies[body].path == body_path(element, k)) {
                on[k] = own;
            }
        }
        Some((links, on))
    }

    /// A number of a joint; none where it is infinite, or as large as writers mean by that.
    fn number(&mut self, attribute: Option<&Attribute>) -> Option<f64> {
        let attribute = attribute.filter(|a| !a.value.is_empty())?;
        let value = attribute.value.parse::<f64>();
        if value.as_ref().is_ok_and(|x| x.abs() >= UNLIMITED) {
            return None;
        }
        self.fields.number(attribute)
    }

    /// Limits, friction and the inertia of the drive.
    fn limits(&mut self, element: &Element, part: &mut Joint, instances: &[&str]) {
        let is_turning = part.kind == Kind::Revolute;
        let length = self.meter;
        // of angles and lengths, and of efforts
        let way = if is_turning {
            1_f64.to_radians()
        } else {
            length
        };
        let effort = self.kilogram * length * if is_turning { length } else { 1.0 };
        let ends = ["lower", "upper"].map(|end| {
            let own = element.attribute(&format!("physics:{end}Limit"));
            let bound = if end == "lower" { "low" } else { "high" };
            own.or_else(|| of(element, "limit:", instances, &format!(":physics:{bound}")))
        });
        match ends.map(|end| self.number(end).map(|x| x * way)) {
            [Some(lower), Some(upper)] if lower < upper => part.position = Some([lower, upper]),
            [None, None] => {}
            _ => {
                let text = "limits without a range are left out: {}";
                let item = format!("'{}'", part.name);
                self.fields.log.note_each(element.place, text, &item);
            }
        }
        let axis = |name: &str| of(element, "physxJointAxis:", instances, &format!(":{name}"));
        let both =
            |name: &str| axis(name).or_else(|| element.attribute(&format!("physxJoint:{name}")));
        let velocity = self.number(both("maxJointVelocity"));
        let velocity = velocity.filter(|v| *v > 0.0 && *v < UNLIMITED_VELOCITY);
        part.velocity = velocity.map(|v| v * way);
        let most = of(element, "drive:", instances, ":physics:maxForce");
        let most = self.number(most);
        part.effort = most.filter(|e| *e > 0.0).map(|e| [-e * effort, e * effort]);
        let inertia = effort;
        let mut resisting =
            |name: Option<&Attribute>, unit: f64| self.number(name).unwrap_or(0.0).max(0.0) * unit;
        part.armature = resisting(
            both("armature"),
            if is_turning {
                inertia
            } else {
                inertia / length
            },
        );
        part.friction = resisting(axis("dynamicFrictionEffort"), effort);
        part.damping = resisting(axis("viscousFrictionCoefficient"), effort / way);
        if let Some(friction) = element.attribute("physxJoint:jointFriction")
            && friction.value.parse() != Ok(0.0)
        {
            let text = "friction that PhysX takes as a part of the force in the joint is no effort, and left out: {}";
            let item = format!("'{}'", part.name);
            self.fields.log.note_each(friction.place, text, &item);
        }
    }

    /// Whether a motor drives the joint.
    fn is_driven(&mut self, element: &Element) -> bool {
        let driven = has_schema(element, "PhysicsDriveAPI:");
        let most = of(
            element,
            "drive:",
            &[TURN, SHIFT].concat(),
            ":physics:maxForce",
        );
        let is_weak = most.is_some_and(|most| most.value.parse() == Ok(0.0));
        for attribute in &element.attributes {
            if attribute.name.starts_with("drive:") && !attribute.used.is_marked() {
                attribute.used.mark();
                let text = "what its controller does is no part of a robot's dynamics: {}";
                self.fields
                    .log
                    .note_each(attribute.place, text, &attribute.name);
            }
        }
        driven && !is_weak
    }

    /// The joint that it follows: its position, and the gearing times that of the other, add up to minus the offset.
    fn mimic(&mut self, element: &Element, name: &str) -> Option<Coupling> {
        if !has_schema(element, "PhysxMimicJointAPI:") {
            return None;
        }
        let prefix = "physxMimicJoint:";
        let own = |end: &str| of(element, prefix, &DIRECTIONS, end);
        let leader = own(":referenceJoint");
        let _ = own(":referenceJointAxis");
        let other = leader.and_then(|a| self.joints.iter().find(|(path, _)| *path == a.value));
        let Some((path, other)) = other.cloned() else {
            let message = format!("'{name}' follows a joint that this file does not define");
            let hint = "write the path of a joint as referenceJoint";
            self.fields
                .log
                .error(leader.map_or(element.place, |a| a.place), message, hint);
            return None;
        };
        if other.tag != element.tag {
            let message = format!("'{name}' follows a joint of another kind");
            let hint = "an angle follows an angle, a way a way";
            self.fields.log.error(element.place, message, hint);
            return None;
        }
        let gearing = self.number(own(":gearing")).unwrap_or(1.0);
        let offset = self.number(own(":offset")).unwrap_or(0.0);
        let way = if element.tag == "PhysicsPrismaticJoint" {
            self.meter
        } else {
            1_f64.to_radians()
        };
        Some(Coupling {
            joint: name.to_owned(),
            constant: if offset == 0.0 { 0.0 } else { -offset * way },
            terms: vec![(self.name(&path), -gearing)],
            place: element.place,
        })
    }
}

/// The directions of a joint that no limit locks.
fn free_of(element: &Element) -> Vec<&'static str> {
    let is_free = |direction: &&str| {
        let end = |end: &str| {
            let end = element.attribute(&format!("limit:{direction}:physics:{end}"));
            end.and_then(|a| a.value.parse::<f64>().ok())
        };
        !matches!((end("low"), end("high")), (Some(low), Some(high)) if low > high)
    };
    DIRECTIONS.into_iter().filter(is_free).collect()
}

/// The only direction of a joint that no limit locks.
pub(crate) fn free_direction(element: &Element) -> Option<&'static str> {
    match free_of(element).as_slice() {
        [one] => Some(one),
        _ => None,
    }
}

fn body_path(element: &Element, k: usize) -> &str {
    element
        .text(&format!("physics:body{k}"))
        .unwrap_or_default()
}

/// The attribute of a schema that has this name behind that of the first of the instances which has one.
fn of<'e>(
    element: &'e Element,
    begin: &str,
    instances: &[&str],
    end: &str,
) -> Option<&'e Attribute> {
    let mut all = instances.iter();
    all.find_map(|instance| element.attribute(&format!("{begin}{instance}{end}")))
}
