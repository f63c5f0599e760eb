//! Bodies, joints and sites.

use super::orientation::Classed;
use super::{InertiaFrom, Reading};
use crate::Place;
use crate::pose::{Pose, tensor_in, transposed, unit};
use crate::tree::{Inertia, Joint, Kind, Link, Side};
use crate::xml::{Attribute, Element};

/// The elements of a body, including those in nested `<frame>`s.
#[derive(Default)]
struct Content<'e> {
    geoms: Vec<(&'e Element, Option<&'e str>, Pose)>,
    joints: Vec<(&'e Element, Option<&'e str>, Pose)>,
    bodies: Vec<(&'e Element, Option<&'e str>, Pose)>,
    sites: Vec<(&'e Element, Option<&'e str>, Pose)>,
}

impl<'a> Reading<'a, '_, '_> {
    /// Reads all bodies, depth first.
    pub(super) fn bodies(&mut self) {
        for world in self.root.all("worldbody") {
            let mut content = Content::default();
            self.collect(world, None, Pose::default(), &mut content);
            self.sites(&content, None);
            for (body, inherited, around) in content.bodies {
                self.body(body, inherited, around, None);
            }
        }
        if self.tree.links.is_empty() && !self.fields.log.failed() {
            let hint =
                "a robot's bodies stand in <worldbody>, perhaps in a file that is not included";
            let place = self.root.place;
            self.fields.log.error(place, "there is no body", hint);
        }
    }

    /// Collects the elements of a body, descending into `<frame>`s.
    fn collect(
        &mut self,
        element: &'a Element,
        inherited: Option<&'a str>,
        around: Pose,
        content: &mut Content<'a>,
    ) {
        let inherited = element.text("childclass").or(inherited);
        for child in &element.children {
            self.defaults.check(child, self.fields.log);
            let entry = (child, inherited, around);
            if matches!(child.tag.as_str(), "joint" | "freejoint" | "body" | "frame") {
                child.used.mark();
            }
            match child.tag.as_str() {
                "geom" => content.geoms.push(entry),
                "joint" | "freejoint" => content.joints.push(entry),
                "body" => content.bodies.push(entry),
                "site" => content.sites.push(entry),
                "frame" => {
                    let of = Classed {
                        element: child,
                        inherited,
                    };
                    let within = around.then(&self.pose(of));
                    self.collect(child, inherited, within, content);
                }
                "composite" | "flexcomp" | "replicate" | "attach" => {
                    let message = format!("<{}> is not expanded", child.tag);
                    let hint = "save the compiled model (mj_saveLastXML) and import that";
                    self.fields.log.error(child.place, message, hint);
                }
                _ => {}
            }
        }
    }

    fn sites(&mut self, content: &Content<'a>, link: Option<usize>) {
        for (element, inherited, around) in &content.sites {
            let Some(name) = element.text("name") else {
                continue;
            };
            let of = Classed {
                element,
                inherited: *inherited,
            };
            element.used.mark();
            let pose = around.then(&self.pose(of));
            let site = (name.to_owned(), Side { link, pose });
            self.tree.frames.push(site);
        }
    }

    fn body(
        &mut self,
        element: &'a Element,
        inherited: Option<&'a str>,
        around: Pose,
        parent: Option<usize>,
    ) {
        let index = self.tree.links.len();
        let name = match element.text("name") {
            Some(name) => name.to_owned(),
            None => format!("body{}", index + 1),
        };
        if element.text("name").is_some()
            && self.tree.find(&name).is_some()
            && let Some(place) = element.attribute("name").map(|a| a.place)
        {
            let message = format!("another body is called '{name}' already");
            self.fields.log.error(place, message, "rename one of them");
        }
        let of = Classed { element, inherited };
        let pose = around.then(&self.pose(of));
        let mut content = Content::default();
        self.collect(element, inherited, Pose::default(), &mut content);
        let on_world = !self.moves(parent);
        let moves = !content.joints.is_empty() || !on_world;
        let mut inertia = self.inertia(element, &content, moves, &name);
        let unknown = self.take_has_unknown_mass();
        self.gravity_compensation(of);
        let mut joints = Vec::new();
        for (k, (joint, inherited, around)) in content.joints.iter().enumerate() {
            let unnamed = match content.joints.len() {
                1 => format!("{name}_joint"),
                _ => format!("{name}_joint{}", k + 1),
            };
            let of = Classed {
                element: joint,
                inherited: *inherited,
            };
            joints.extend(self.joint(of, around, unnamed));
        }
        self.balls(&name, on_world && !unknown, &mut joints, &mut inertia);
        self.tree.links.push(Link {
            name,
            place: element.place,
            parent,
            pose,
            joints,
            inertia,
            unknown,
        });
        self.sites(&content, Some(index));
        for (body, inherited, around) in content.bodies {
            self.body(body, inherited, around, Some(index));
        }
    }

    /// Whether there is a joint between a link and the world.
    fn moves(&self, mut link: Option<usize>) -> bool {
        while let Some(at) = link.and_then(|l| self.tree.links.get(l)) {
            if !at.joints.is_empty() {
                return true;
            }
            link = at.parent;
        }
        false
    }

    fn inertia(
        &mut self,
        body: &'a Element,
        content: &Content<'a>,
        moves: bool,
        name: &str,
    ) -> Option<Inertia> {
        let inertial = body.child("inertial");
        let wanted = self.compiler.inertia;
        match inertial.filter(|_| wanted != InertiaFrom::Geoms) {
            Some(inertial) => self.inertial(inertial),
            None if wanted == InertiaFrom::Inertials => None,
            None => self.inertia_of_geoms(&content.geoms, moves, name),
        }
    }

    fn inertial(&mut self, element: &Element) -> Option<Inertia> {
        let Some(mass) = element.attribute("mass") else {
            let message = "<inertial> has no mass";
            let hint = "write mass=\"...\" in kg";
            self.fields.log.error(element.place, message, hint);
            return None;
        };
        let of = Classed {
            element,
            inherited: None,
        };
        let place = mass.place;
        let mass = self.fields.number(mass)?;
        if mass < 0.0 {
            let hint = "a mass is zero or above";
            self.fields.log.error(place, "a negative mass", hint);
        }
        let pose = self.pose(of);
        let tensor = if let Some(full) = element.attribute("fullinertia") {
            let [xx, yy, zz, xy, xz, yz] = self.fields.array::<6>(full)?;
            [xx, xy, xz, yy, yz, zz]
        } else if let Some(diagonal) = element.attribute("diaginertia") {
            let [x, y, z] = self.fields.array::<3>(diagonal)?;
            [x, 0.0, 0.0, y, 0.0, z]
        } else {
            [0.0; 6]
        };
        Some(Inertia {
            mass,
            com: pose.p,
            tensor: tensor_in(tensor, &transposed(&pose.r)),
        })
    }

    fn joint(&mut self, of: Classed<'_>, around: &Pose, unnamed: String) -> Option<Joint> {
        let element = of.element;
        let name = element.text("name").map_or(unnamed, str::to_owned);
        let kind = match self.attribute(of, "type") {
            _ if element.tag == "freejoint" => Kind::Free,
            None => Kind::Revolute,
            Some(kind) => match kind.value.as_str() {
                "hinge" => Kind::Revolute,
                "slide" => Kind::Prismatic,
                "ball" => Kind::Spherical,
                "free" => Kind::Free,
                other => {
                    let message = format!("unknown joint type '{other}'");
                    let hint = "joints are hinge, slide, ball or free in MJCF";
                    self.fields.log.error(kind.place, message, hint);
                    return None;
                }
            },
        };
        let mut joint = Joint::new(name, element.place, kind);
        if kind == Kind::Free {
            let text = format!(
                "free joint '{}' is written as three slides and a ball: x, y, z, yaw, pitch, roll \
                 from where the file has the body, singular at a pitch of a quarter turn",
                joint.name
            );
            self.fields.log.note(element.place, text);
            // <freejoint> takes no defaults
            if element.tag == "joint" {
                self.resistance(of, &mut joint);
            }
            return Some(joint);
        }
        let anchor = self.attribute(of, "pos");
        let anchor = anchor.and_then(|a| self.fields.position(&a));
        joint.anchor = around.point(anchor.unwrap_or_default());
        if let Some(axis) = self.attribute(of, "axis") {
            joint.axis = self.fields.direction(&axis)?;
        }
        joint.axis = unit(crate::pose::times(&around.r, joint.axis))?;
        self.resistance(of, &mut joint);
        self.spring(of, element.place, &mut joint);
        self.range(of, &mut joint);
        joint.effort = self.limit(of, "actuatorfrcrange", "actuatorfrclimited");
        Some(joint)
    }

    /// Reads where the spring of a hinge or a slide is relaxed; a ball has no such coordinate.
    fn spring(&mut self, of: Classed<'_>, place: Place, joint: &mut Joint) {
        if joint.stiffness == 0.0 {
            return;
        }
        match joint.kind {
            Kind::Revolute | Kind::Prismatic => {
                if let Some(rest) = self.attribute(of, "springref") {
                    let value = if joint.kind == Kind::Revolute {
                        self.angles::<1>(&rest).map(|[a]| a)
                    } else {
                        self.fields.number(&rest)
                    };
                    joint.spring_rest = value.unwrap_or(0.0);
                }
            }
            _ => {
                joint.stiffness = 0.0;
                let text = format!("the spring of the ball '{}' is left out", joint.name);
                self.fields.log.note(place, text);
            }
        }
    }

    /// Reads range and reference of a joint; those of hinges are in the file's unit of angles.
    fn range(&mut self, of: Classed<'_>, joint: &mut Joint) {
        let turns = joint.kind == Kind::Revolute;
        let unit = if turns && self.compiler.degrees {
            std::f64::consts::PI / 180.0
        } else {
            1.0
        };
        if joint.kind != Kind::Spherical {
            let range = self.limit(of, "range", "limited");
            joint.position = range.map(|range| range.map(|x| x * unit));
            if let Some(reference) = self.attribute(of, "ref") {
                let value = if turns {
                    self.angles::<1>(&reference).map(|[a]| a)
                } else {
                    self.fields.number(&reference)
                };
                joint.reference = value.unwrap_or(0.0);
            }
        }
    }

    /// The range of a limit, if it is in force.
    pub(super) fn limit(&mut self, of: Classed<'_>, name: &str, flag: &str) -> Option<[f64; 2]> {
        let range = self.attribute(of, name)?;
        let flag = self.attribute(of, flag);
        let said = |flag: &Attribute| match flag.value.as_str() {
            "true" => Some(true),
            "false" => Some(false),
            _ => None,
        };
        let in_force = flag.as_ref().and_then(said);
        if !in_force.unwrap_or(self.compiler.autolimits) {
            return None;
        }
        let [low, high] = self.fields.array::<2>(&range)?;
        (low < high).then_some([low, high])
    }
}
