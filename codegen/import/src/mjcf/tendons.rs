//! Reads fixed tendons with actuators, as drives.

use super::Reading;
use super::orientation::Classed;
use crate::log::Place;
use crate::pose::{difference, norm};
use crate::tree::{Drive, Kind, Spring};
use crate::xml::{Attribute, Element};

/// MJCF does not say whether the coefficients of a tendon over hinges are moment arms or ratios.
/// Coefficients below this count as moment arms in m, so that the tendon's coordinate is a length;
/// others count as ratios, so that it is an angle.
const MAX_MOMENT_ARM: f64 = 0.1;

impl Reading<'_, '_, '_> {
    /// Converts the actuator of a joint into its motor, or into a drive if it has a gear.
    pub(super) fn motor(&mut self, of: Classed<'_>, joint: &str) {
        let (place, gear) = (of.element.place, self.gear(of));
        let force = self.own_force_range(of);
        let kind = self.tree.joint(joint).map(|joint| joint.kind);
        if gear == 1.0 || !matches!(kind, Some(Kind::Revolute | Kind::Prismatic)) {
            self.actuated(joint, place);
            self.limit_effort(joint, force);
            return;
        }
        if gear == 0.0 {
            let text = "actuators with a gear of 0 are left out: they move nothing";
            self.fields.log.note(place, text);
            return;
        }
        let is_of_joint = |drive: &&mut Drive| drive.terms.iter().all(|(own, _)| own == joint);
        let mut drives = self.tree.drives.iter_mut();
        let other = drives.find(is_of_joint).map(|drive| drive.terms[0].1);
        if other.is_some() || self.tree.actuated.iter().any(|own| own == joint) {
            // a motor may be two actuators, as for its position and its velocity
            if other != Some(gear) {
                let text = "a second actuator with another gear is left out, of {}";
                self.fields.log.note_each(place, text, joint);
            }
            return;
        }
        let name = of.element.text("name");
        let name = name.map_or_else(|| format!("{joint}_motor"), str::to_owned);
        self.tree.drives.push(Drive {
            name,
            place,
            terms: vec![(joint.to_owned(), gear)],
            slides: kind == Some(Kind::Prismatic),
            damping: 0.0,
            friction: 0.0,
            armature: 0.0,
            position: None,
            effort: force,
        });
    }

    /// Converts the actuator of a fixed tendon into a drive, or into the motor of a joint if the
    /// tendon runs over this joint alone with coefficient 1.
    pub(super) fn pull(&mut self, of: Classed<'_>, tendon: &Attribute) {
        let root = self.root;
        let mut fixed = root.all("tendon").flat_map(|section| section.all("fixed"));
        let Some(found) = fixed.find(|f| f.text("name") == Some(tendon.value.as_str())) else {
            let text = "this actuator is left out: its tendon is not a fixed one";
            self.fields.log.note(of.element.place, text);
            return;
        };
        let mut terms = self.tendon_terms(found);
        let force = self.own_force_range(of);
        let gear = self.gear(of);
        for (_, factor) in &mut terms {
            *factor *= gear;
        }
        if let [(joint, factor)] = terms.as_slice()
            && (factor - 1.0).abs() < f64::EPSILON
        {
            self.actuated(joint, of.element.place);
            self.limit_effort(joint, force);
            return;
        }
        let name = tendon.value.as_str();
        if self.tree.drives.iter().any(|drive| drive.name == name) {
            return;
        }
        let drive = self.drive(name, found, gear, terms, force);
        self.tree.drives.extend(drive);
    }

    /// The joints of a fixed tendon with their coefficients.
    pub(super) fn tendon_terms(&mut self, tendon: &Element) -> Vec<(String, f64)> {
        let mut terms = Vec::new();
        for joint in tendon.all("joint") {
            let coefficient = joint.attribute("coef");
            let coefficient = coefficient.and_then(|c| self.fields.number(c));
            if let Some(name) = joint.text("joint") {
                terms.push((name.to_owned(), coefficient.unwrap_or(0.0)));
            }
        }
        terms
    }

    /// The drive of a fixed tendon; `None` if it moves nothing, or after an error.
    fn drive(
        &mut self,
        name: &str,
        tendon: &Element,
        gear: f64,
        terms: Vec<(String, f64)>,
        effort: Option<[f64; 2]>,
    ) -> Option<Drive> {
        let mut slides = !terms.is_empty();
        for (joint, factor) in &terms {
            let joints = self.tree.links.iter().flat_map(|l| &l.joints);
            let kind = joints
                .filter(|j| j.name == *joint)
                .map(|j| j.kind)
                .find(|kind| matches!(kind, Kind::Revolute | Kind::Prismatic));
            let Some(kind) = kind else {
                let message = format!("no hinge or slide is called '{joint}'");
                let hint = "a fixed tendon runs over hinges and slides";
                self.fields.log.error(tendon.place, message, hint);
                return None;
            };
            slides &= kind == Kind::Prismatic || (factor / gear).abs() < MAX_MOMENT_ARM;
        }
        if terms.iter().all(|(_, factor)| *factor == 0.0) {
            let text = format!("the tendon '{name}' is left out: it moves no joint");
            self.fields.log.note(tendon.place, text);
            return None;
        }
        let of = Classed {
            element: tendon,
            inherited: None,
        };
        let [damping, friction, armature] =
            ["damping", "frictionloss", "armature"].map(|key| self.coefficient(of, key, name));
        if self.coefficient(of, "stiffness", name) != 0.0 {
            let text = format!("the spring of the tendon '{name}' is left out");
            self.fields.log.note(tendon.place, text);
        }
        // what the tendon resists at its own coordinate, at the motor's
        let [damping, friction, armature] = [
            damping / (gear * gear),
            friction / gear.abs(),
            armature / (gear * gear),
        ];
        let position = self.limit(of, "range", "limited").map(|ends| {
            let ends = ends.map(|end| end * gear);
            [ends[0].min(ends[1]), ends[0].max(ends[1])]
        });
        Some(Drive {
            name: name.to_owned(),
            place: tendon.place,
            terms,
            slides,
            damping,
            friction,
            armature,
            position,
            effort,
        })
    }

    /// Converts spatial tendons with springs between two sites.
    pub(super) fn springs(&mut self) {
        let root = self.root;
        // a fixed tendon to which nothing refers only has a length
        let fixed = root.all("tendon").flat_map(|section| section.all("fixed"));
        fixed
            .flat_map(|tendon| tendon.all("joint"))
            .for_each(|joint| {
                let _ = (joint.attribute("joint"), joint.attribute("coef"));
            });
        let sections = root.all("tendon").flat_map(|section| &section.children);
        for (k, tendon) in sections.filter(|c| c.tag == "spatial").enumerate() {
            let name = tendon.text("name");
            let name = name.map_or_else(|| format!("spring{}", k + 1), str::to_owned);
            match self.spring_between(tendon, name) {
                Ok(spring) => {
                    tendon.used.mark();
                    self.tree.springs.extend(spring);
                }
                Err(why) => {
                    let text = format!("spatial tendons are left out: {{}}, {why}");
                    let name = tendon.text("name").unwrap_or("one without a name");
                    self.fields.log.note_each(tendon.place, text, name);
                }
            }
        }
    }

    /// The spring that a spatial tendon is; the error says why it is none.
    fn spring_between(
        &mut self,
        tendon: &Element,
        name: String,
    ) -> Result<Option<Spring>, &'static str> {
        let of = Classed {
            element: tendon,
            inherited: None,
        };
        let stiffness = self.coefficient(of, "stiffness", &name);
        if stiffness == 0.0 {
            return Err("since it has no spring");
        }
        let [first, second] = tendon.children.as_slice() else {
            return Err("since it is no line between two points");
        };
        let mut end = |element: &Element| {
            let site = element
                .attribute("site")
                .filter(|_| element.tag == "site")?;
            element.used.mark();
            let found = self.tree.frames.iter().find(|(own, _)| *own == site.value);
            if found.is_none() {
                let message = format!("no site is called '{}'", site.value);
                let hint = "a tendon runs over sites of bodies or of the world";
                self.fields.log.error(site.place, message, hint);
            }
            found.map(|(_, side)| *side)
        };
        let (Some(a), Some(b)) = (end(first), end(second)) else {
            return Err("since it is no line between two points");
        };
        let points = [a, b].map(|side| self.tree.at_zero(side.link).point(side.pose.p));
        let rest = self.attribute(of, "springlength");
        let rest = rest
            .and_then(|a| self.fields.numbers(&a))
            .unwrap_or_default();
        let length = match rest.as_slice() {
            [low, high] if low != high => return Err("since it is slack over a range of lengths"),
            [length, ..] if *length >= 0.0 => *length,
            // relaxed where the file draws the robot
            _ => norm(difference(points[0], points[1])),
        };
        Ok(Some(Spring {
            name,
            place: tendon.place,
            ends: [(a.link, a.pose.p), (b.link, b.pose.p)],
            length,
            stiffness,
        }))
    }

    /// The range of an actuator's own force or torque, N or N m.
    fn own_force_range(&mut self, of: Classed<'_>) -> Option<[f64; 2]> {
        let mut range = self.limit(of, "forcerange", "forcelimited");
        if of.element.tag == "motor" && range.is_none() {
            // the control signal of a <motor> is its force
            range = self.limit(of, "ctrlrange", "ctrllimited");
        }
        range
    }

    /// How far an actuator moves while its joint or tendon moves by one.
    fn gear(&mut self, of: Classed<'_>) -> f64 {
        let gear = self.attribute(of, "gear");
        let gear = gear.and_then(|g| self.fields.numbers(&g)?.first().copied());
        gear.unwrap_or(1.0)
    }

    /// Sets the effort limit of a joint, unless it already has one.
    pub(super) fn limit_effort(&mut self, joint: &str, range: Option<[f64; 2]>) {
        let mut joints = self.tree.links.iter_mut().flat_map(|l| &mut l.joints);
        if let Some(joint) = joints.find(|j| j.name == joint && j.effort.is_none()) {
            joint.effort = range;
        }
    }

    /// Records that a joint is actuated; an error if there is no such joint.
    pub(super) fn actuated(&mut self, joint: &str, place: Place) {
        let known = self.tree.links.iter().flat_map(|l| &l.joints);
        if !known.into_iter().any(|j| j.name == joint) {
            let message = format!("no joint is called '{joint}'");
            let hint = "an actuator names a joint of the same model";
            self.fields.log.error(place, message, hint);
        }
        if !self.tree.actuated.iter().any(|j| j == joint) {
            self.tree.actuated.push(joint.to_owned());
        }
    }
}
