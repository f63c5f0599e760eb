//! Writes identified friction, rotor inertias and spring stiffnesses into the joints of robot files.

use regen_codegen::spec::Spec;

use super::{Export, FileFormat, JointParameters, RobotFile};
use crate::edits::Edits;
use crate::log::Place;
use crate::tree::Joint;
use crate::xml::Element;

/// Two rest positions of a spring that differ by no more than this count as equal, rad or m.
const REST_TOLERANCE: f64 = 1e-9;

impl Export<'_> {
    /// Writes the parameters of one joint of the spec into the element of the file that it came
    /// from.
    pub(super) fn joint(
        &mut self,
        (name, values): (&str, &JointParameters),
        spec: &Spec,
        file: &RobotFile,
        edits: &mut Edits,
    ) {
        let mut drawn = file.draft.limbs.iter().flat_map(|limb| &limb.joints);
        let from = drawn.find(|joint| joint.name.as_deref() == Some(name));
        let from = from.and_then(|joint| joint.from.as_ref());
        let found = from.and_then(|from| Some((from, file.element(from.place)?)));
        let Some((from, element)) = found else {
            self.without_element(name, spec, file);
            return;
        };
        if element.place.file != file.root.place.file {
            let message = format!("joint '{name}' is in an included file");
            self.parameter_error(name, message, "export into one file without <include>");
            return;
        }
        let fields = [
            ("damping", values.viscous),
            (file.format.friction(), values.coulomb),
            ("armature", values.armature),
            (file.format.stiffness(), values.stiffness),
        ];
        for (key, value) in fields {
            if value.is_some_and(|v| !v.is_finite() || v < 0.0) {
                let message = format!("the {key} is negative or not finite");
                let hint = "damping, friction, armature and stiffness must be finite and >= 0";
                self.parameter_error(name, message, hint);
            }
        }
        self.left_out(name, values, spec, (file, element.place));
        match file.format {
            FileFormat::Urdf => {
                let [damping, friction, ..] = fields;
                let fields = [damping, friction];
                self.note_unchanged(name, element.child("dynamics"), &fields);
                edits.dynamics(element, fields);
            }
            FileFormat::Sdf => {
                let [damping, friction, _, stiffness] = fields;
                let fields = [damping, friction, stiffness];
                let second = format!("{}_2", element.text("name").unwrap_or_default());
                let tag = if from.name.ends_with(&second) {
                    "axis2"
                } else {
                    "axis"
                };
                let Some(axis) = element.child(tag) else {
                    self.without_element(name, spec, file);
                    return;
                };
                self.note_unchanged(name, axis.child("dynamics"), &fields);
                if values.stiffness.is_some() {
                    self.note_rest(name, spec, from, element.place);
                }
                edits.sdf_dynamics(axis, &fields);
            }
            FileFormat::Mjcf => {
                self.note_unchanged(name, Some(element), &fields);
                if values.stiffness.is_some() {
                    self.note_rest(name, spec, from, element.place);
                }
                edits.mjcf_joint(element, &fields);
            }
            FileFormat::Usd => {
                let values = [values.viscous, values.coulomb, values.armature];
                let keys = [
                    "viscousFrictionCoefficient",
                    "dynamicFrictionEffort",
                    "armature",
                ];
                let fields: Vec<(&str, Option<f64>)> = keys
                    .into_iter()
                    .zip(values)
                    .map(|(key, value)| {
                        let mut all = element.attributes.iter();
                        let old = all.find(|a| a.name.ends_with(&format!(":{key}")));
                        (old.map_or(key, |a| a.name.as_str()), value)
                    })
                    .collect();
                self.note_unchanged(name, Some(element), &fields);
                edits.usd_joint(element, values, (from.kind, &file.tree.units));
            }
        }
    }

    /// Reports a name for which the file has no joint: a note if the spec has the name, an error
    /// otherwise.
    fn without_element(&mut self, name: &str, spec: &Spec, file: &RobotFile) {
        let format = file.format.name();
        if spec.coordinates().iter().any(|own| own == name) {
            // a drive or a massless coordinate of the spec has no joint in the file
            let is_drive = spec.drives.iter().any(|drive| drive.value == name);
            let what = if is_drive { "drive" } else { "coordinate" };
            let text = format!(
                "the {format} file has no joint for the {what} '{name}': its parameters are left \
                 out"
            );
            self.log.note(file.root.place, text);
            return;
        }
        if spec.springs.iter().any(|spring| spring.name.value == name) {
            let text = format!("the spring '{name}' is left out: it is not a joint");
            self.log.note(file.root.place, text);
            return;
        }
        let message = format!("no joint of the {format} file is called '{name}'");
        self.parameter_error(name, message, "joints are named as in the spec");
    }

    /// Notes parameters that the format of the file cannot express, and refuses those that the joint
    /// of the spec does not have.
    fn left_out(
        &mut self,
        name: &str,
        values: &JointParameters,
        spec: &Spec,
        (file, place): (&RobotFile, Place),
    ) {
        let format = file.format.name();
        let mut joints = spec.limbs.iter().flat_map(|limb| &limb.joints);
        let own = joints.find(|joint| joint.name.as_ref().is_some_and(|n| n.value == name));
        for symbol in &values.others {
            let mut terms = own.into_iter().flat_map(|joint| &joint.terms);
            let what = if symbol == "Fo" {
                "constant efforts"
            } else if terms.any(|(term, _)| term.value == *symbol) {
                "effort terms"
            } else {
                let message = format!("the joint has no parameter '{symbol}'");
                let hint = "Fv, Fc, Fv+, Fv-, Fc+, Fc-, Fo, J, K and the names of its terms";
                self.parameter_error(name, message, hint);
                continue;
            };
            let text = format!("{symbol}({name}) is left out: {format} has no {what}");
            self.log.note(place, text);
        }
        let has_rotors = matches!(file.format, FileFormat::Mjcf | FileFormat::Usd);
        let has_springs = matches!(file.format, FileFormat::Mjcf | FileFormat::Sdf);
        for (symbol, value, what) in [
            (
                "J",
                values.armature.filter(|_| !has_rotors),
                "inertia of rotors",
            ),
            ("K", values.stiffness.filter(|_| !has_springs), "springs"),
        ] {
            if value.is_some() {
                let text = format!("{symbol}({name}) is left out: {format} has no {what}");
                self.log.note(place, text);
            }
        }
    }

    /// Notes values of the file that stay although other parameters of the same joint are replaced:
    /// the joint then mixes old and new values.
    fn note_unchanged(
        &mut self,
        name: &str,
        element: Option<&Element>,
        values: &[(&str, Option<f64>)],
    ) {
        let Some(element) = element else {
            return;
        };
        if values.iter().all(|(_, value)| value.is_none()) {
            return;
        }
        for (key, value) in values {
            let old = || element.content_of(key).map(|text| text.value.as_str());
            if let (None, Some(old)) = (value, element.text(key).or_else(old)) {
                let text = format!("{key}=\"{old}\" of joint '{name}' stays: no new one is given");
                self.log.note(element.place, text);
            }
        }
    }

    /// Notes that the file's spring keeps its rest position, if the spec has another one.
    fn note_rest(&mut self, name: &str, spec: &Spec, from: &Joint, place: Place) {
        let mut joints = spec.limbs.iter().flat_map(|limb| &limb.joints);
        let own = joints.find(|joint| joint.name.as_ref().is_some_and(|n| n.value == name));
        let Some(spring) = own.and_then(|joint| joint.spring.as_ref()) else {
            return;
        };
        let rest = spring.rest.value.to_f64();
        if (rest - from.spring_rest).abs() > REST_TOLERANCE {
            let text = format!(
                "the spring of joint '{name}' is relaxed at {} by the file's springref, which \
                 stays; the spec says {rest}",
                from.spring_rest
            );
            self.log.note(place, text);
        }
    }
}
