//! Checks payloads: bodies that are not always there, so that nothing else may hang on them.

use super::super::raw::RawJoint;
use super::super::types::JointKind;
use super::{Checker, joint_path};
use crate::diag::Diagnostic;

impl Checker<'_> {
    pub(super) fn payloads(&mut self) {
        let raw = self.raw;
        for limb in &raw.limbs {
            for (index, joint) in limb.joints.iter().enumerate() {
                if !joint.payload.value {
                    continue;
                }
                let path = joint_path(limb, index);
                self.payload(joint, &path);
                if let Some(next) = limb.joints.get(index + 1) {
                    // a second payload behind the first one is meant to be at the same flange
                    let carrier = limb.joints.get(..index).unwrap_or_default();
                    let carrier = carrier.iter().rev().find_map(|own| own.body.as_ref());
                    let carrier = carrier.map_or("BODY", |body| body.0.text.as_str());
                    let hint = if next.payload.value {
                        format!(
                            "each payload has a limb of its own, from the body that carries it: \
                             `- name: second`, `from: {carrier}`, `joints: [{{type: fixed, body: \
                             LOAD, payload: true}}]`"
                        )
                    } else {
                        "without the payload nothing would carry the joint".to_owned()
                    };
                    self.sink.push(
                        Diagnostic::new(joint.payload.span, "a payload ends its limb")
                            .path(path)
                            .secondary(next.span, "this joint is on it")
                            .hint(hint),
                    );
                }
            }
        }
    }

    fn payload(&mut self, joint: &RawJoint, path: &str) {
        let raw = self.raw;
        let place = joint.payload.span;
        if joint.kind.value != JointKind::Fixed {
            self.sink.push(
                Diagnostic::new(place, "a payload is attached by a fixed joint")
                    .path(path)
                    .secondary(joint.kind.span, "this joint moves")
                    .hint("add a joint `type: fixed` behind it that carries the payload"),
            );
        }
        let Some(body) = &joint.body else {
            self.sink.push(
                Diagnostic::new(place, "a payload without a body")
                    .path(path)
                    .hint("label it with `body:`"),
            );
            return;
        };
        let label = &body.0.text;
        let limbs = raw.limbs.iter().map(|limb| &limb.from.0);
        let cuts = raw.cuts.iter().flatten();
        let sides = cuts.flat_map(|cut| cut.between.iter().map(|side| &side.body.0));
        for user in limbs.chain(sides).filter(|word| word.text == *label) {
            self.sink.push(
                user.error(format!("'{label}' is a payload, and carries nothing"))
                    .secondary(place, "a payload here")
                    .hint("name the body that carries the payload instead"),
            );
        }
    }
}
