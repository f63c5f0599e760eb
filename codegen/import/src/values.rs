//! Reads parameters of bodies and joints from JSON.

use std::collections::BTreeMap;

use regen_codegen::diag::{Diagnostic, Report, Source, Span};
use serde::Deserialize;
use serde_json::Value;

use crate::export::{BodyParameters, JointParameters, Parameters};

/// The JSON of parameters.
#[derive(Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "expected an object with bodies, joints or both"
)]
struct Given {
    #[serde(default)]
    bodies: BTreeMap<String, Body>,
    #[serde(default)]
    joints: BTreeMap<String, Joint>,
}

#[derive(Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "expected an object with mass, com and inertia"
)]
struct Body {
    mass: f64,
    #[serde(default)]
    com: [f64; 3],
    inertia: [f64; 6],
}

#[derive(Deserialize)]
#[serde(
    expecting = "expected an object with Fv, Fc (or Fv+, Fv-, Fc+, Fc-), Fo, J and K, or some of them"
)]
#[allow(non_snake_case, reason = "the symbols of the parameters")]
struct Joint {
    Fv: Option<f64>,
    Fc: Option<f64>,
    #[serde(rename = "Fv+")]
    forward_viscous: Option<f64>,
    #[serde(rename = "Fv-")]
    backward_viscous: Option<f64>,
    #[serde(rename = "Fc+")]
    forward_coulomb: Option<f64>,
    #[serde(rename = "Fc-")]
    backward_coulomb: Option<f64>,
    J: Option<f64>,
    K: Option<f64>,
    /// Symbols that robot files cannot express.
    #[serde(flatten)]
    others: BTreeMap<String, f64>,
}

impl Joint {
    /// The parameters that robot files have. They have one value for both directions: the larger one
    /// is used, with a note.
    fn parameters(self, name: &str, notes: &mut Vec<String>) -> JointParameters {
        let mut one = |symbol: &str, key: &str, both: Option<f64>, signs: [Option<f64>; 2]| {
            let [plus, minus] = signs;
            match (both, plus, minus) {
                (Some(_), _, _) => both,
                (None, Some(plus), Some(minus)) => {
                    let larger = plus.max(minus);
                    if plus.to_bits() != minus.to_bits() {
                        notes.push(format!(
                            "note: {key} of {name} is {larger}, the larger of {symbol}+ = {plus} \
                             and {symbol}- = {minus}: robot files have one value for both directions"
                        ));
                    }
                    Some(larger)
                }
                (None, plus, minus) => plus.or(minus),
            }
        };
        JointParameters {
            viscous: one(
                "Fv",
                "damping",
                self.Fv,
                [self.forward_viscous, self.backward_viscous],
            ),
            coulomb: one(
                "Fc",
                "friction",
                self.Fc,
                [self.forward_coulomb, self.backward_coulomb],
            ),
            armature: self.J,
            stiffness: self.K,
            others: self.others.into_keys().collect(),
        }
    }
}

impl Parameters {
    /// Parameters from the text of a JSON file, as `bodies:` and `nominal:` of a spec have them:
    /// `{"bodies": {LABEL: {"mass", "com", "inertia"}}, "joints": {NAME: {"Fv", "Fc", "J", "K"}}}`,
    /// SI, with `Fv+`, `Fv-`, `Fc+` and `Fc-` in place of `Fv` and `Fc`. Also returns a note for each
    /// value that differs by direction.
    ///
    /// # Errors
    /// The first mistake with its place.
    ///
    /// ```
    /// use regen_codegen::diag::Source;
    /// use regen_import::Parameters;
    ///
    /// let text = r#"{"joints": {"elbow": {"Fv": 1.2, "Fc+": 0.4, "Fc-": 0.5, "J": 0.1}}}"#;
    /// let (found, notes) = Parameters::from_json(&Source::new("p.json", text))?;
    /// assert_eq!(found.joints[0].1.coulomb, Some(0.5));
    /// assert_eq!(notes.len(), 1);
    /// let wrong = Parameters::from_json(&Source::new("p.json", r#"{"joints": 3}"#));
    /// assert_eq!(wrong.unwrap_err().shown().next().map(|m| m.line()), Some(1));
    /// # Ok::<(), regen_codegen::diag::Report>(())
    /// ```
    pub fn from_json(source: &Source) -> Result<(Self, Vec<String>), Report> {
        let given: Given = serde_json::from_str(&source.text).map_err(|error| {
            let lines = source.text.split_inclusive('\n').map(str::len);
            let before: usize = lines.take(error.line().saturating_sub(1)).sum();
            let at = before + error.column().saturating_sub(1);
            let text = error.to_string();
            let message = text.rsplit_once(" at line ").map_or(text.as_str(), |t| t.0);
            let diagnostic = Diagnostic::new(Span::new(at, at + 1), message);
            Report::new(source.clone(), vec![diagnostic])
        })?;
        Ok(checked(given))
    }

    /// As [`from_json`](Self::from_json), from a parsed value.
    ///
    /// # Errors
    /// The first mistake.
    pub fn from_value(value: Value) -> Result<(Self, Vec<String>), serde_json::Error> {
        serde_json::from_value(value).map(checked)
    }
}

/// The values that robot files can express, with notes about those that are changed.
fn checked(given: Given) -> (Parameters, Vec<String>) {
    let mut notes = Vec::new();
    let bodies = given.bodies.into_iter().map(|(label, body)| {
        let Body { mass, com, inertia } = body;
        (label, BodyParameters { mass, com, inertia })
    });
    let joints = given.joints.into_iter().map(|(name, joint)| {
        let parameters = joint.parameters(&name, &mut notes);
        (name, parameters)
    });
    let parameters = Parameters {
        bodies: bodies.collect(),
        joints: joints.collect(),
    };
    (parameters, notes)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn of_friction_that_differs_by_direction_the_larger_is_written() {
        let of = |text: &str| {
            serde_json::from_str::<Joint>(text)
                .unwrap()
                .parameters("q1", &mut Vec::new())
        };
        let found = of(r#"{"Fv": 0.5, "Fc+": 2.0, "Fc-": 3.0, "J": 0.1}"#);
        assert_eq!((found.viscous, found.coulomb), (Some(0.5), Some(3.0)));
        let found = of(r#"{"Fv+": 0.5, "Fv-": 0.25, "Fc": 1.0}"#);
        assert_eq!((found.viscous, found.coulomb), (Some(0.5), Some(1.0)));
        let found = of(r#"{"J": 0.1}"#);
        assert_eq!((found.viscous, found.coulomb), (None, None));
        assert_eq!(found.armature, Some(0.1));
        let found = of(r#"{"K": 3, "Fo": 1}"#);
        assert_eq!(
            (found.stiffness, found.others),
            (Some(3.0), vec!["Fo".to_owned()])
        );
        assert!(serde_json::from_str::<Joint>(r#"{"Fs": "high"}"#).is_err());
    }

    #[test]
    fn a_mistake_is_shown_on_its_line() {
        let text = "{\"bodies\": {},\n \"joints\": 3}";
        let wrong = Parameters::from_json(&Source::new("p.json", text)).unwrap_err();
        let lines: Vec<usize> = wrong.shown().map(|m| m.line()).collect();
        assert_eq!(lines, [2]);
    }
}
