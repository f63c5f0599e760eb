//! Writes identified parameters as the bodies of a spec and as constants of programs.

use std::path::PathBuf;

use regen_codegen::diag::Source;
use regen_codegen::emit::c;
use regen_codegen::spec::{self, BodyInertia, Quantity, edit};
use regen_identify::IdentifiedModel;
use regen_identify::feasibility::{ParameterLayout, bodies_yaml};
use regen_identify::files::{c_constants, python_constants, rust_constants};

use crate::args::{PayloadArg, PhysicalArgs};
use crate::exit::Failure;
use crate::{load, terminal};
use regen_interpreted::Interpreted;

/// The constants that the options ask for, in Rust, C and Python, each with its file.
pub(crate) fn constants<'a>(
    args: &'a PhysicalArgs,
    model: &Interpreted<'_>,
    found: &IdentifiedModel,
) -> Result<Vec<(&'a PathBuf, String)>, Failure> {
    let robot = model.info().name;
    let mut written = Vec::new();
    if let Some(out) = &args.rust {
        let beside = format!("super::{robot}");
        let module = args.module.as_deref().unwrap_or(&beside);
        written.push((out, rust_constants(model, found, Some(module))?));
    }
    if let Some(out) = &args.c {
        written.push((out, c_constants(model, found, &c::prefix(robot))?));
    }
    if let Some(out) = &args.python {
        written.push((out, python_constants(model, found)?));
    }
    Ok(written)
}

/// The largest difference, relative to the largest parameter, between a value and the same value
/// read back from the written spec: moments are converted to the centre of mass and back.
const MAX_RELATIVE_DIFFERENCE: f64 = 1e-9;

/// The spec's text with `bodies:` and the joints' `nominal:` values replaced by those of a physical
/// model; the rest of the text stays.
///
/// The result is parsed again and its nominal values are compared before it is returned. A value
/// that a spec cannot express is noted on standard error.
pub(crate) fn spec(
    source: &Source,
    payload: Option<PayloadArg>,
    model: &Interpreted<'_>,
    found: &IdentifiedModel,
) -> Result<String, Failure> {
    let info = model.info();
    let layout = ParameterLayout::of(info.parameters)?;
    let phi = found.phi.as_deref().unwrap_or_default();
    let written = spec::parse(source).map_err(|report| Failure::Spec(vec![report]))?;
    let known = |coordinate: &str, symbol: &str| -> Option<f64> {
        if let Some(k) = info.parameter_of(&format!("{symbol}({coordinate})")) {
            return phi.get(k).copied();
        }
        let place = info.index_of(coordinate)?;
        let law = info.joints.get(place)?.friction;
        let fit = found.friction.iter().find(|f| f.name == coordinate);
        let fit = fit.filter(|f| f.friction == law)?;
        let k = law.symbols().iter().position(|s| *s == symbol)?;
        fit.values.get(k).copied()
    };
    let (text, mut notes) = edit::with_nominal(&source.text, &written, &known);
    for (joint, name) in info.joints.iter().zip(info.coordinates) {
        if !joint.friction.is_linear() && !found.friction.iter().any(|f| f.name == *name) {
            notes.push(format!(
                "the nonlinear friction of {name} stays as it is in the spec: --friction \
                 identifies it"
            ));
        }
    }
    let mut bodies = bodies_yaml(&layout, phi)?;
    // bodies that the model lacks are payloads that were not carried: the spec's values stay
    for (label, inertia) in &written.bodies {
        if !info.bodies.contains(&label.value.as_str()) {
            bodies.push_str(&body_as_given(&label.value, inertia));
        }
    }
    let text = edit::with_bodies(&text, &bodies);
    let wrong = |why: String| {
        Failure::Input(format!(
            "{}: the spec could not be filled ({why}): write `bodies:` as a block of its own, with \
             each body indented, and `nominal:` of a joint behind its `type:`",
            source.name
        ))
    };
    let filled = Source {
        name: source.name.clone(),
        text: text.clone(),
    };
    // names and nominal values suffice: no function is derived
    let robot = load::loaded(&filled, payload)
        .and_then(|mechanism| Ok(mechanism.robot(&[])?))
        .map_err(|failure| wrong(failure.to_string()))?;
    let largest = phi.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    // the notes name values that a joint of several coordinates cannot state for each of them
    let is_noted = |label: &str| notes.iter().any(|note| note.starts_with(label));
    for (k, (parameter, exact)) in info.parameters.iter().zip(phi).enumerate() {
        let value = robot.nominal.get(k).copied().flatten();
        let skipped =
            parameter.owner.contains('.') && is_noted(&format!("{} of ", parameter.name()));
        if !skipped
            && !value.is_some_and(|v| (v - exact).abs() <= MAX_RELATIVE_DIFFERENCE * largest)
        {
            return Err(wrong(format!("{parameter} reads back as {value:?}")));
        }
    }
    for fit in &found.friction {
        let joint = info.index_of(&fit.name).and_then(|k| robot.joints.get(k));
        let back = joint.map_or(&[][..], |j| &j.nominal);
        let same = fit.values.iter().zip(back).all(|(x, y)| Some(*x) == *y);
        if !same && !fit.name.contains('.') {
            return Err(wrong(format!(
                "the friction of {} reads back as {back:?}",
                fit.name
            )));
        }
    }
    for note in notes {
        terminal::note(&format!("note: {note}"));
    }
    Ok(text)
}

/// An entry of `bodies:` with the values that the spec gives.
fn body_as_given(label: &str, inertia: &BodyInertia) -> String {
    let list = |values: &[Quantity]| -> String {
        let values: Vec<String> = values
            .iter()
            .map(|value| format!("{:?}", value.value.to_f64()))
            .collect();
        format!("[{}]", values.join(", "))
    };
    format!(
        "  {label}: {{mass: {:?}, com: {}, inertia: {}}}\n",
        inertia.mass.value.to_f64(),
        list(&inertia.com),
        list(&inertia.inertia)
    )
}
