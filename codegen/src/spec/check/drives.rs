//! Checks drives: their names, their forms and their values by symbol.

use super::super::shape::Word;
use super::{Checker, joint_name};
use crate::diag::Diagnostic;

impl Checker<'_> {
    pub(super) fn drives(&mut self) {
        let raw = self.raw;
        for (name, drive) in raw.drives() {
            if self.sink.is_full() {
                break;
            }
            self.drive_name(&name.0);
            if let Some(cone) = drive
                .limits
                .as_ref()
                .and_then(|limits| limits.cone.as_ref())
            {
                self.sink.push(
                    Diagnostic::new(cone.ast.span, "a drive takes no cone")
                        .path(&*cone.path)
                        .hint("only spherical and universal joints do; use `position`"),
                );
            }
            self.nominal(&drive.joint(name), "drive");
            let form = &drive.of.value.0;
            let mut faults = Vec::new();
            form.ast.names(&mut |ast, used| {
                if !self.sink.is_full() {
                    faults.extend(self.coupling_name(ast, used, form));
                }
            });
            for fault in faults {
                self.sink.push(fault);
            }
        }
    }

    /// Refuses a drive with the name of a joint, a body or a constant: their coordinates or
    /// parameters would have the same names.
    fn drive_name(&mut self, name: &Word) {
        let raw = self.raw;
        let joints = || raw.limbs.iter().flat_map(|limb| &limb.joints);
        let joint = joints().find(|joint| joint_name(joint) == name.text);
        let joint = joint.and_then(|joint| joint.name.as_ref());
        let mut bodies = joints().filter_map(|joint| joint.body.as_ref());
        let body = bodies.find(|body| body.0.text == name.text);
        let mut constants = raw.geometry.iter().flat_map(|geometry| &geometry.0);
        let constant = constants.find(|(constant, _)| constant.0.text == name.text);
        let others = [
            joint.map(|joint| ("a joint", joint.0.span)),
            body.map(|body| ("a body", body.0.span)),
            constant.map(|(constant, _)| ("a geometry constant", constant.0.span)),
        ];
        for (what, span) in others.into_iter().flatten() {
            let message = format!("drive '{}' has the name of {what}", name.text);
            self.sink.push(
                name.error(message)
                    .secondary(span, format!("{what} of this name"))
                    .hint("rename one of them"),
            );
        }
    }

    /// The error about a drive in a place where only coordinates of joints are allowed: the key or
    /// the form of a coupling, or the form of a drive.
    pub(super) fn drive_in_coupling(&self, word: &Word) -> Option<Diagnostic> {
        let place = *self.drives.get(word.text.as_str())?;
        let message = format!("'{}' is a drive, not the coordinate of a joint", word.text);
        Some(
            word.error(message)
                .secondary(place, "the drive")
                .hint("drives follow joints: write its form in their coordinates under `of:`"),
        )
    }

    /// The names of the coordinates that are not drives.
    pub(super) fn joint_coordinates(&self) -> Vec<String> {
        let all = self.inventory.coordinates.iter();
        let joints = all.filter(|name| !self.drives.contains_key(name.as_str()));
        joints.cloned().collect()
    }
}
