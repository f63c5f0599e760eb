//! Equalities of fixed tendons as couplings of joints: the length of such a tendon is a linear form
//! of coordinates.

use super::Reading;
use crate::tree::{Coupling, Joint, Kind};
use crate::xml::{Attribute, Element};

impl Reading<'_, '_, '_> {
    /// Converts `length1 - ref1 = c0 + c1 (length2 - ref2)`, where the references are the lengths as
    /// drawn, into a coupling that gives the coordinate of one of the joints.
    pub(super) fn tendon_coupling(&mut self, element: &Element) -> Option<Coupling> {
        let Some(first) = element.attribute("tendon1") else {
            let message = "<tendon> has no tendon1";
            let hint = "write tendon1=\"...\"";
            self.fields.log.error(element.place, message, hint);
            return None;
        };
        let [constant, factor] = self.linear_factors(element)?;
        let mut form = self.fixed_tendon(first)?;
        if let Some(second) = element.attribute("tendon2") {
            for (joint, coefficient) in self.fixed_tendon(second)? {
                let change = -factor * coefficient;
                match form.iter_mut().find(|(name, _)| *name == joint) {
                    Some((_, sum)) => *sum += change,
                    None => form.push((joint, change)),
                }
            }
        }
        form.retain(|(_, coefficient)| *coefficient != 0.0);
        let mut constant = constant;
        for (name, coefficient) in &form {
            let reference = self.single(name).map(|joint| joint.reference);
            let Some(reference) = reference else {
                let message = format!("no hinge or slide is called '{name}'");
                let hint = "a fixed tendon runs over hinges and slides";
                self.fields.log.error(first.place, message, hint);
                return None;
            };
            constant += coefficient * reference;
        }
        // among the joints that do not follow others yet, prefer the last one without a motor
        let follows = |name: &String| self.tree.couplings.iter().any(|c| c.joint == *name);
        let free = form.iter().rev().filter(|(name, _)| !follows(name));
        let passive = |name: &String| !self.tree.actuated.contains(name);
        let key = free
            .clone()
            .find(|(name, _)| passive(name))
            .or_else(|| free.clone().next())
            .cloned();
        let Some((joint, own)) = key else {
            let message = "all joints of this tendon already follow others";
            let hint = "remove one of the equalities";
            self.fields.log.error(element.place, message, hint);
            return None;
        };
        let others = form.into_iter().filter(|(name, _)| *name != joint);
        Some(Coupling {
            constant: constant / own,
            terms: others.map(|(name, k)| (name, -k / own)).collect(),
            joint,
            place: element.place,
        })
    }

    /// The joints of a fixed tendon with their coefficients; an error for any other tendon.
    fn fixed_tendon(&mut self, name: &Attribute) -> Option<Vec<(String, f64)>> {
        let root = self.root;
        let mut fixed = root.all("tendon").flat_map(|section| section.all("fixed"));
        let Some(found) = fixed.find(|f| f.text("name") == Some(name.value.as_str())) else {
            let message = format!("no fixed tendon is called '{}'", name.value);
            let hint = "an equality of spatial tendons cannot be expressed: take it out, or set \
                        active=\"false\" in it";
            self.fields.log.error(name.place, message, hint);
            return None;
        };
        Some(self.tendon_terms(found))
    }

    /// The hinge or slide of a name.
    fn single(&self, name: &str) -> Option<&Joint> {
        let joints = self.tree.links.iter().flat_map(|l| &l.joints);
        let mut single = joints.filter(|j| matches!(j.kind, Kind::Revolute | Kind::Prismatic));
        single.find(|j| j.name == name)
    }
}
