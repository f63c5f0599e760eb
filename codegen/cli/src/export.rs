//! `regen export`: identified parameters back into robot files of others.

use std::collections::BTreeMap;
use std::path::Path;

use regen_codegen::diag::{Diagnostic, Report, Source, Span};
use regen_import::{BodyParameters, JointParameters, Parameters};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use regen_identify::files;

use crate::args::{ExportArgs, Format};
use crate::exit::Failure;
use crate::{load, parameters, table, terminal, write};

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
    deny_unknown_fields,
    expecting = "expected an object with Fv, Fc (or Fv+, Fv-, Fc+, Fc-) and J, or some of them"
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
}

impl Joint {
    /// What URDF has of it: one value for both signs, the larger one, which is told.
    fn friction(&self, name: &str) -> JointParameters {
        let one = |symbol: &str, key: &str, both: Option<f64>, signs: [Option<f64>; 2]| {
            let [plus, minus] = signs;
            match (both, plus, minus) {
                (Some(_), _, _) => both,
                (None, Some(plus), Some(minus)) => {
                    let larger = plus.max(minus);
                    if plus.to_bits() != minus.to_bits() {
                        terminal::note(&format!(
                            "note: {key} of {name} is {larger}, the larger of {symbol}+ = {plus} \
                             and {symbol}- = {minus}: URDF has one value for both directions"
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
        }
    }
}

/// The JSON of `regen export`.
#[derive(Serialize)]
struct Exported<'a> {
    values: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    written: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    urdf: Option<&'a str>,
}

/// Runs the command.
pub(crate) fn run(args: &ExportArgs) -> Result<(), Failure> {
    let urdf = load::file(&args.urdf)?;
    let spec = load::source(&args.spec)?;
    let given = load::file(&args.parameters)?;
    let parameters = match identified(&args.parameters, &given)? {
        Some(given) => checked(given),
        None => placed(&given)?,
    };
    let exported =
        regen_import::export(&urdf, &spec, &given, &parameters).map_err(Failure::Spec)?;
    for note in &exported.notes {
        terminal::note(&format!("note: {note}"));
    }
    if let Some(out) = &args.out {
        write::atomically(out, &exported.urdf)?;
    }
    let written = args.out.as_ref().map(|out| out.display().to_string());
    let values = exported.values;
    terminal::print(&match (args.format, written) {
        (Format::Json, written) => table::json(&Exported {
            values,
            urdf: written.is_none().then_some(exported.urdf.as_str()),
            written,
        }),
        (Format::Human, Some(out)) => format!("wrote {out}, {values} values new\n"),
        (Format::Human, None) => exported.urdf,
    })
}

fn placed(source: &Source) -> Result<Parameters, Failure> {
    let given: Given = serde_json::from_str(&source.text).map_err(|error| {
        let lines = source.text.split_inclusive('\n').map(str::len);
        let before: usize = lines.take(error.line().saturating_sub(1)).sum();
        let at = before + error.column().saturating_sub(1);
        let text = error.to_string();
        let message = text.rsplit_once(" at line ").map_or(text.as_str(), |t| t.0);
        let diagnostic = Diagnostic::new(Span::new(at, at + 1), message)
            .hint("regen export --help shows what stands here");
        Failure::Spec(vec![Report::new(source.clone(), vec![diagnostic])])
    })?;
    Ok(checked(given))
}

/// What `regen identify --out` wrote, or any parameters in YAML; `None` for other JSON, whose
/// mistakes have places.
fn identified(path: &Path, source: &Source) -> Result<Option<Given>, Failure> {
    let yaml = files::Format::of(path) == files::Format::Yaml;
    let Ok(mut value) = parameters::value(path) else {
        // YAML that does not parse has its place in the message
        return if yaml {
            parameters::value(path).map(|_| None)
        } else {
            Ok(None)
        };
    };
    let wrong = |why: String| Failure::Input(format!("{}: {why}", source.name));
    if let Some(fields) = value.as_object_mut()
        && fields.contains_key("parameters")
        && fields.contains_key("method")
    {
        if !fields.contains_key("bodies") {
            let why = "these are base parameters, of which bodies cannot be made: identify with \
                       --feasible";
            return Err(wrong(why.to_owned()));
        }
        let laws = fields.get("friction").and_then(|f| f.as_array());
        for row in laws.into_iter().flatten() {
            let of = |key: &str| row.get(key).and_then(Value::as_str).unwrap_or("?");
            terminal::note(&format!(
                "warning: the friction of {} ({}) is left out: URDF has damping and friction only",
                of("joint"),
                of("law")
            ));
        }
        fields.retain(|key, _| key == "bodies" || key == "joints");
    } else if !yaml {
        return Ok(None);
    }
    serde_json::from_value(value)
        .map(Some)
        .map_err(|error| wrong(error.to_string()))
}

fn checked(given: Given) -> Parameters {
    let bodies = given.bodies.into_iter().map(|(label, body)| {
        let Body { mass, com, inertia } = body;
        (label, BodyParameters { mass, com, inertia })
    });
    let joints = given.joints.into_iter().map(|(name, joint)| {
        if joint.J.is_some() {
            terminal::note(&format!(
                "warning: J({name}) is left out: URDF has no inertia of rotors"
            ));
        }
        let parameters = joint.friction(&name);
        (name, parameters)
    });
    Parameters {
        bodies: bodies.collect(),
        joints: joints.collect(),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn of_friction_that_differs_by_direction_the_larger_is_written() {
        let of = |text: &str| serde_json::from_str::<Joint>(text).unwrap().friction("q1");
        let found = of(r#"{"Fv": 0.5, "Fc+": 2.0, "Fc-": 3.0, "J": 0.1}"#);
        assert_eq!((found.viscous, found.coulomb), (Some(0.5), Some(3.0)));
        let found = of(r#"{"Fv+": 0.5, "Fv-": 0.25, "Fc": 1.0}"#);
        assert_eq!((found.viscous, found.coulomb), (Some(0.5), Some(1.0)));
        let found = of(r#"{"J": 0.1}"#);
        assert_eq!((found.viscous, found.coulomb), (None, None));
        assert!(serde_json::from_str::<Joint>(r#"{"Fs": 1}"#).is_err());
    }
}
