//! Identified values in a USD file: values of properties of bodies and joints, with the schemas that make them count.

use super::Edits;
use crate::isaac::{principal, quaternion};
use crate::number::number;
use crate::pose::V3;
use crate::tree::{FileUnits, Inertia, Kind};
use crate::xml::Element;

impl Edits {
    /// Writes the properties of a body's MassAPI.
    ///
    /// - `scale`: that of the body's prim, by which the file multiplies its lengths.
    pub(crate) fn usd_inertia(
        &mut self,
        body: &Element,
        inertia: &Inertia,
        units: &FileUnits,
        scale: V3,
    ) {
        let (moments, axes) = principal(inertia.tensor);
        let own = units.kilogram * units.meter * units.meter;
        let com = [0, 1, 2].map(|k| inertia.com[k] / (units.meter * scale[k]));
        let list = |numbers: &[f64]| {
            let words: Vec<String> = numbers.iter().map(|x| number(*x)).collect();
            format!("({})", words.join(", "))
        };
        let mass = number(inertia.mass / units.kilogram);
        self.values += 10;
        self.properties(
            body,
            &[
                ("float", "physics:mass".to_owned(), mass),
                ("point3f", "physics:centerOfMass".to_owned(), list(&com)),
                (
                    "float3",
                    "physics:diagonalInertia".to_owned(),
                    list(&moments.map(|m| m / own)),
                ),
                (
                    "quatf",
                    "physics:principalAxes".to_owned(),
                    list(&quaternion(&axes)),
                ),
            ],
            "PhysicsMassAPI",
        );
    }

    /// Writes those of a joint's friction and the inertia of its drive that are given.
    ///
    /// - `values`: damping, friction and armature, SI;
    /// - `kind`: whether it turns or slides.
    pub(crate) fn usd_joint(
        &mut self,
        joint: &Element,
        values: [Option<f64>; 3],
        (kind, units): (Kind, &FileUnits),
    ) {
        let is_turning = kind == Kind::Revolute;
        let instance = match (joint.tag.as_str(), is_turning) {
            ("PhysicsJoint", _) => crate::usd::free_direction(joint).unwrap_or_default(),
            (_, true) => "angular",
            (_, false) => "linear",
        };
        let way = if is_turning {
            1_f64.to_radians()
        } else {
            units.meter
        };
        let inertia = units.kilogram
            * if is_turning {
                units.meter * units.meter
            } else {
                1.0
            };
        let effort = units.kilogram * units.meter * if is_turning { units.meter } else { 1.0 };
        let names = [
            ("viscousFrictionCoefficient", effort / way),
            ("dynamicFrictionEffort", effort),
            ("armature", inertia),
        ];
        let mut own = Vec::new();
        let mut is_own = true;
        for ((name, unit), value) in names.into_iter().zip(values) {
            let Some(value) = value else { continue };
            let value = number(value / unit);
            let plain = format!("physxJoint:{name}");
            let of_axis = format!("physxJointAxis:{instance}:{name}");
            // an armature may stand with the joint as a whole
            if joint.attribute(&of_axis).is_none() && joint.attribute(&plain).is_some() {
                own.push(("float", plain, value));
            } else {
                is_own = false;
                own.push(("float", of_axis, value));
            }
        }
        self.values += own.len();
        let schema = if is_own {
            "PhysxJointAPI".to_owned()
        } else {
            format!("PhysxJointAxisAPI:{instance}")
        };
        if !own.is_empty() {
            self.properties(joint, &own, &schema);
        }
    }

    /// Replaces the values of properties, or adds those that a prim does not have with a schema for them.
    ///
    /// - `all`: types, names and values.
    fn properties(&mut self, prim: &Element, all: &[(&str, String, String)], schema: &str) {
        let mut missing = Vec::new();
        for (kind, name, value) in all {
            match prim.attribute(name).map(|own| (own, own.place.span)) {
                // a property without a value, which stands at its name
                Some((own, span)) if own.value.is_empty() => {
                    self.changes
                        .push((span.end, span.end, format!(" = {value}")));
                }
                Some((_, span)) => self.changes.push((span.start, span.end, value.clone())),
                None => missing.push(format!("{kind} {name} = {value}")),
            }
        }
        if !missing.is_empty() {
            self.add(prim, &missing);
        }
        self.apply_schema(prim, schema);
    }

    /// Adds lines at the end of a prim.
    fn add(&mut self, prim: &Element, lines: &[String]) {
        let end = prim.span.end;
        let before = self.text.get(..end).unwrap_or_default();
        let first = self.text.get(..prim.span.start).unwrap_or_default();
        let line = first.rsplit('\n').next().unwrap_or_default();
        let blank = &line[..line.len() - line.trim_start().len()];
        let lines: Vec<String> = lines
            .iter()
            .map(|own| format!("{blank}    {own}\n"))
            .collect();
        let lines = lines.concat();
        let Some(inside) = before.strip_suffix('}') else {
            // a prim without braces
            let text = format!("\n{blank}{{\n{lines}{blank}}}");
            self.changes.push((end, end, text));
            return;
        };
        // before the blanks of the line on which the brace is, if it is the first on it
        let kept = inside.trim_end_matches([' ', '\t']);
        let at = if kept.ends_with('\n') {
            kept.len()
        } else {
            inside.len()
        };
        let text = if at == kept.len() {
            lines
        } else {
            format!("\n{lines}{blank}")
        };
        self.changes.push((at, at, text));
    }

    /// Applies a schema to a prim that does not have it.
    fn apply_schema(&mut self, prim: &Element, schema: &str) {
        if crate::usd::has_schema(prim, schema) {
            return;
        }
        if let Some(list) = prim.attribute("apiSchemas") {
            let at = list.place.span.start;
            let is_list = self
                .text
                .get(at..)
                .is_some_and(|rest| rest.starts_with('['));
            let at = at + usize::from(is_list);
            let comma = if list.value.is_empty() { "" } else { ", " };
            self.changes.push((at, at, format!("\"{schema}\"{comma}")));
            return;
        }
        // behind the name and its mark, before or within the metadata
        let at = prim.place.span.end + 1;
        let rest = self.text.get(at..).unwrap_or_default();
        let entry = format!("prepend apiSchemas = [\"{schema}\"]");
        if rest.trim_start().starts_with('(') {
            let at = at + rest.find('(').unwrap_or(0) + 1;
            self.changes.push((at, at, format!("\n{entry}\n")));
        } else {
            self.changes.push((at, at, format!(" ({entry})")));
        }
    }
}
