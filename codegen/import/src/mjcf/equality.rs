//! Reads MJCF's equality constraints, as loop cuts and couplings of coordinates, and its actuators,
//! which tell the actuated joints.

use super::Reading;
use super::orientation::Classed;
use crate::pose::{Pose, from_quaternion};
use crate::tree::{Coupling, Kind, LoopCut, Side};
use crate::xml::{Attribute, Element};

/// An error that is already in the log.
struct Reported;

impl Reading<'_, '_, '_> {
    /// Reads `<equality>`.
    pub(super) fn equalities(&mut self) {
        let is_in_force = self.has_equalities();
        let elements: Vec<&Element> = self
            .root
            .all("equality")
            .flat_map(|section| &section.children)
            .collect();
        for element in elements {
            let of = Classed {
                element,
                inherited: None,
            };
            element.used.mark();
            if !is_in_force {
                element.set_aside();
                continue;
            }
            self.defaults.check(element, self.fields.log);
            let inactive = self.attribute(of, "active");
            if inactive.is_some_and(|a| a.value == "false") {
                element.set_aside();
                let text = format!("an inactive <{}> is left out", element.tag);
                self.fields.log.note(element.place, text);
                continue;
            }
            match element.tag.as_str() {
                "connect" | "weld" => {
                    let closure = self.closure(element);
                    self.tree.closures.extend(closure);
                }
                "joint" => {
                    let coupling = self.coupling(element);
                    self.tree.couplings.extend(coupling);
                }
                "tendon" => {
                    let coupling = self.tendon_coupling(element);
                    self.tree.couplings.extend(coupling);
                }
                other => {
                    let message = format!("a <{other}> equality cannot be expressed");
                    let hint = "connect, weld, joint and tendon can; take this one out, or set \
                                active=\"false\" in it";
                    self.fields.log.error(element.place, message, hint);
                }
            }
        }
    }

    /// Converts `connect` into a spherical cut, and `weld` into a fixed one; `None` after an error.
    fn closure(&mut self, element: &Element) -> Option<LoopCut> {
        let welded = element.tag == "weld";
        let sides = if element.attribute("site1").is_some() {
            [self.site(element, "site1")?, self.site(element, "site2")?]
        } else {
            self.sides_of_bodies(element, welded)?
        };
        let side = |side: &Side| match side.link {
            Some(link) => self
                .tree
                .links
                .get(link)
                .map_or("world", |l| l.name.as_str()),
            None => "world",
        };
        let name = match element.text("name") {
            Some(name) => name.to_owned(),
            None => format!("{}_{}", side(&sides[0]), side(&sides[1])),
        };
        let kind = if welded { "fixed" } else { "spherical" };
        Some(LoopCut {
            name,
            kind: kind.to_owned(),
            sides,
        })
    }

    /// The side of a cut at the site that the attribute `which` names.
    fn site(&mut self, element: &Element, which: &str) -> Option<Side> {
        let name = required(element, which, self)?;
        let mut sites = self.tree.frames.iter();
        let found = sites.find(|s| s.0 == name.value).map(|s| s.1);
        if found.is_none() {
            let message = format!("no site is called '{}'", name.value);
            let hint = "an equality names sites of bodies or of the world";
            self.fields.log.error(name.place, message, hint);
        }
        found
    }

    /// The index of the link that an attribute names; `None` for the world.
    fn body_of(&mut self, name: &Attribute) -> Result<Option<usize>, Reported> {
        if name.value == "world" {
            return Ok(None);
        }
        let found = self.tree.find(&name.value);
        if found.is_none() {
            let message = format!("no body is called '{}'", name.value);
            let hint = "an equality names bodies of the same model, or world";
            self.fields.log.error(name.place, message, hint);
        }
        found.map(Some).ok_or(Reported)
    }

    /// The sides of a cut between two bodies. MJCF gives their relative pose, or the anchor in the
    /// first body (m); the rest follows from the poses of the bodies as the file draws them.
    fn sides_of_bodies(&mut self, element: &Element, welded: bool) -> Option<[Side; 2]> {
        let first = required(element, "body1", self)?;
        let first = self.body_of(first).ok()?;
        let second = match element.attribute("body2") {
            Some(name) => self.body_of(name).ok()?,
            None => None,
        };
        let anchor = match element.attribute("anchor") {
            Some(anchor) => self.fields.position(anchor)?,
            None => [0.0; 3],
        };
        let (a, b) = (self.tree.at_zero(first), self.tree.at_zero(second));
        let mut poses = if welded {
            // the pose of the second body in the first, as drawn
            [a.inverse().then(&b), Pose::default()]
        } else {
            // the position of the anchor in the second body, as drawn
            let shift = Pose::shift(anchor);
            let point = b.inverse().then(&a).point(anchor);
            [shift, Pose::shift(point)]
        };
        if welded && let Some(relative) = element.attribute("relpose") {
            let [x, y, z, w, i, j, k] = self.fields.array::<7>(relative)?;
            // MJCF ignores a relpose whose quaternion is zero
            if let Some(r) = from_quaternion([w, i, j, k]) {
                poses[0] = Pose::new([x, y, z], r);
            }
        }
        let [a, b] = poses;
        Some([
            Side {
                link: first,
                pose: a,
            },
            Side {
                link: second,
                pose: b,
            },
        ])
    }

    /// Converts `joint1 - ref1 = c0 + c1 (joint2 - ref2)`.
    fn coupling(&mut self, element: &Element) -> Option<Coupling> {
        let joint = required(element, "joint1", self)?;
        let other = element.attribute("joint2");
        let [constant, factor] = self.linear_factors(element)?;
        let reference = self.reference(joint)?;
        let (constant, terms) = match other {
            Some(other) => (
                constant + reference - factor * self.reference(other)?,
                vec![(other.value.clone(), factor)],
            ),
            None => (constant + reference, Vec::new()),
        };
        Some(Coupling {
            joint: joint.value.clone(),
            constant,
            terms,
            place: joint.place,
        })
    }

    /// The constant and linear coefficients of `polycoef`, which defaults to `0 1`; an error if a
    /// coefficient of higher order is not 0.
    pub(super) fn linear_factors(&mut self, element: &Element) -> Option<[f64; 2]> {
        let mut factors = [0.0, 1.0];
        if let Some(polynomial) = element.attribute("polycoef") {
            let given = self.fields.numbers(polynomial)?;
            if given.iter().skip(2).any(|c| *c != 0.0) {
                let message = "a coupling that is not linear";
                let hint = "only the first two coefficients may differ from zero";
                self.fields.log.error(polynomial.place, message, hint);
                return None;
            }
            for (factor, given) in factors.iter_mut().zip(given) {
                *factor = given;
            }
        }
        Some(factors)
    }

    /// The attribute `ref` of a hinge or slide: its coordinate (rad or m) in the pose that the file
    /// draws.
    fn reference(&mut self, name: &Attribute) -> Option<f64> {
        let joints = self.tree.links.iter().flat_map(|l| &l.joints);
        let mut single = joints.filter(|j| matches!(j.kind, Kind::Revolute | Kind::Prismatic));
        let found = single.find(|j| j.name == name.value).map(|j| j.reference);
        if found.is_none() {
            let message = format!("no hinge or slide is called '{}'", name.value);
            let hint = "an equality of joints names hinges and slides";
            self.fields.log.error(name.place, message, hint);
        }
        found
    }

    /// Reads `<actuator>`: the actuated joints, and the force limits of their motors (N or N m).
    pub(super) fn actuators(&mut self) {
        let elements: Vec<&Element> = self
            .root
            .all("actuator")
            .flat_map(|section| &section.children)
            .collect();
        for element in elements {
            let of = Classed {
                element,
                inherited: None,
            };
            self.defaults.check(element, self.fields.log);
            let joint = element.text("joint").or(element.text("jointinparent"));
            let tendon = element.attribute("tendon");
            if joint.is_some() || tendon.is_some() {
                element.used.mark();
            }
            if let Some(joint) = joint {
                self.motor(of, joint);
            } else if let Some(tendon) = tendon {
                self.pull(of, tendon);
            } else {
                let text = "this actuator is left out: it acts on no joint";
                self.fields.log.note(element.place, text);
            }
        }
    }
}

/// The attribute of this name; logs an error and returns `None` if the element lacks it.
fn required<'e>(
    element: &'e Element,
    name: &str,
    reading: &mut Reading<'_, '_, '_>,
) -> Option<&'e Attribute> {
    let found = element.attribute(name);
    if found.is_none() {
        let message = format!("<{}> has no {name}", element.tag);
        let hint = format!("write {name}=\"...\"");
        reading.fields.log.error(element.place, message, &hint);
    }
    found
}
