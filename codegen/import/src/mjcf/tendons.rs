//! Reads fixed tendons with actuators, as drives.

use super::Reading;
use super::orientation::Classed;
use crate::log::Place;
use crate::tree::{Drive, Kind};
use crate::xml::{Attribute, Element};

/// MJCF does not say whether the coefficients of a tendon over hinges are moment arms or ratios.
/// Coefficients below this count as moment arms in m, so that the tendon's coordinate is a length;
/// others count as ratios, so that it is an angle.
const MAX_MOMENT_ARM: f64 = 0.1;

impl Reading<'_, '_, '_> {
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
        let terms = self.tendon_terms(found);
        let force = self.force_range(of);
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
        let drive = self.drive(name, found, terms, force);
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
            slides &= kind == Kind::Prismatic || factor.abs() < MAX_MOMENT_ARM;
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
        let mut number = |key: &str| {
            let attribute = self.attribute(of, key);
            let value = attribute.and_then(|a| self.fields.number(&a));
            value.unwrap_or(0.0)
        };
        let [damping, friction, armature] =
            ["damping", "frictionloss", "armature"].map(&mut number);
        if number("stiffness") != 0.0 {
            let text = format!("the spring of the tendon '{name}' is left out");
            self.fields.log.note(tendon.place, text);
        }
        Some(Drive {
            name: name.to_owned(),
            place: tendon.place,
            terms,
            slides,
            damping,
            friction,
            armature,
            position: self.limit(of, "range", "limited"),
            effort,
        })
    }

    /// The range of the force or torque that an actuator applies to its joint or tendon, N or N m:
    /// its force range times its gear.
    pub(super) fn force_range(&mut self, of: Classed<'_>) -> Option<[f64; 2]> {
        let mut range = self.limit(of, "forcerange", "forcelimited");
        if of.element.tag == "motor" && range.is_none() {
            // the control signal of a <motor> is its force
            range = self.limit(of, "ctrlrange", "ctrllimited");
        }
        let [low, high] = range?;
        let gear = self.attribute(of, "gear");
        let gear = gear.and_then(|g| self.fields.numbers(&g)?.first().copied());
        let gear = gear.unwrap_or(1.0);
        let ends = [low * gear, high * gear];
        let range = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        (range[0] < range[1]).then_some(range)
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
