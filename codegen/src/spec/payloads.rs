//! Payloads: bodies that are carried only in some runs of an experiment.

use super::types::{NamedFrame, Spec};

/// Which robot a spec with payloads describes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Payloads {
    /// The robot with and without its payloads, whose base parameters are separate from the robot's.
    #[default]
    Apart,
    /// The robot without its payloads: they have no parameters.
    Absent,
    /// The robot that always carries its payloads: they are bodies like any others.
    Carried,
}

impl Spec {
    /// The labels of the payloads, in the order of the joints.
    pub fn payloads(&self) -> Vec<String> {
        let joints = self.limbs.iter().flat_map(|limb| &limb.joints);
        let bodies = joints.filter(|joint| joint.payload);
        bodies
            .filter_map(|joint| Some(joint.body.as_ref()?.value.clone()))
            .collect()
    }

    /// The spec of the robot that `payloads` selects.
    #[must_use]
    pub fn with_payloads(mut self, payloads: Payloads) -> Self {
        if payloads == Payloads::Apart {
            return self;
        }
        let labels = self.payloads();
        for joint in self.limbs.iter_mut().flat_map(|limb| &mut limb.joints) {
            if joint.payload && payloads == Payloads::Absent {
                joint.body = None;
            }
            joint.payload = false;
        }
        if payloads == Payloads::Carried {
            return self;
        }
        let is_payload = |label: &str| labels.iter().any(|payload| payload == label);
        let of_payload = |parameter: &str| {
            let owner = parameter.split_once('(').map_or("", |(_, owner)| owner);
            is_payload(owner.trim_end_matches(')'))
        };
        self.bodies.retain(|(label, _)| !is_payload(&label.value));
        let on_payload = |frame: &NamedFrame| {
            let body = frame.on.body.as_ref();
            body.is_some_and(|body| is_payload(&body.value))
        };
        self.frames.retain(|frame| !on_payload(frame));
        let base = &mut self.base;
        base.eliminate.retain(|label| !of_payload(&label.value));
        base.drop.retain(|label| !of_payload(&label.value));
        for form in &mut base.zero {
            form.terms.retain(|(label, _)| !of_payload(&label.value));
        }
        base.zero.retain(|form| !form.terms.is_empty());
        for group in &mut base.equal {
            group.retain(|label| !is_payload(&label.value));
        }
        base.equal.retain(|group| group.len() > 1);
        self
    }
}
