//! Identified parameters as a spec's bodies and as Rust constants.

use std::fmt::Write as _;

use regen_codegen::diag::Source;
use regen_codegen::pipeline::{self, BaseFrom};
use regen_runtime::feasibility::{Layout, bodies_yaml, rust_constants, unit};
use regen_runtime::{BaseModel, Info, Model};

use crate::exit::Failure;
use crate::identified::IdentifiedModel;
use regen_interpreted::Interpreted;

/// What a spec that was written may differ by from the values it was written for: sums about the
/// centre of mass and back.
const KEPT: f64 = 1e-9;

/// The spec with `bodies:` of these physical parameters; everything else of its text stays.
///
/// The result is read back, and its nominal values are compared, before it is handed out.
pub(crate) fn spec(source: &Source, layout: &Layout, phi: &[f64]) -> Result<String, Failure> {
    let text = with_bodies(&source.text, &bodies_yaml(layout, phi)?);
    let wrong = |why: String| {
        Failure::Input(format!(
            "{}: `bodies:` could not be replaced ({why}): write it as a block of its own, with \
             each body indented",
            source.name
        ))
    };
    let read = Source {
        name: source.name.clone(),
        text: text.clone(),
    };
    let robot = pipeline::derive_with(&read, BaseFrom::Nowhere).map_err(|error| {
        wrong(match error {
            pipeline::DeriveError::Spec(report) => report.to_string(),
            other => format!("{other:?}"),
        })
    })?;
    let largest = phi.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    for column in layout.bodies().iter().flat_map(|body| body.columns) {
        let value = robot.nominal.get(column).copied().flatten();
        let exact = phi.get(column).copied().unwrap_or(f64::NAN);
        if !value.is_some_and(|v| (v - exact).abs() <= KEPT * largest) {
            let label = layout.labels().get(column).cloned().unwrap_or_default();
            return Err(wrong(format!("{label} reads back as {value:?}")));
        }
    }
    Ok(text)
}

/// A text with its top-level key `bodies` replaced, or added at the end.
fn with_bodies(text: &str, block: &str) -> String {
    let mut out = String::with_capacity(text.len() + block.len());
    let mut inside = false;
    let mut placed = false;
    // comments and blank lines before the next key belong to that
    let mut held = String::new();
    for line in text.split_inclusive('\n') {
        let starts = line.starts_with(|c: char| !c.is_whitespace() && c != '#');
        if line.starts_with("bodies:") {
            inside = true;
            placed = true;
            held.clear();
            out.push_str(block);
        } else if inside && !starts {
            if line.trim().is_empty() || line.starts_with('#') {
                held.push_str(line);
            } else {
                held.clear();
            }
        } else {
            inside = false;
            out.push_str(&std::mem::take(&mut held));
            out.push_str(line);
        }
    }
    out.push_str(&held);
    if !placed {
        if !out.ends_with('\n') {
            out.push('\n');
        }
        out.push('\n');
        out.push_str(block);
    }
    out
}

/// Constants for a controller: base parameters, physical ones where they are known, friction.
pub(crate) fn rust(model: &Interpreted<'_>, found: &IdentifiedModel) -> Result<String, Failure> {
    let info = model.info();
    let base = model.base_info().base;
    let mut out = format!(
        "/// Identified base parameters of {}, in the order of `BASE`: {}.\n\
         pub const BETA: [f64; {}] = [\n",
        info.name,
        found.name,
        base.len()
    );
    for (parameter, value) in base.iter().zip(&found.beta) {
        let unit = unit(parameter.label, &info);
        let _ = writeln!(out, "    {value:?}, // {}, {unit}", parameter.label);
    }
    out.push_str("];\n");
    if let Some(phi) = &found.phi {
        let layout = Layout::new(info.parameters)?;
        out.push('\n');
        out.push_str(&rust_constants(&layout, phi, &info)?);
    }
    for joint in &found.friction {
        let symbols = joint.friction.symbols();
        let _ = write!(
            out,
            "\n/// Friction of {} ({:?}): {}.\npub const FRICTION_{}: [f64; {}] = [{}];\n",
            joint.name,
            joint.friction,
            symbols.join(", "),
            constant(&joint.name, &info),
            symbols.len(),
            joint
                .values
                .iter()
                .map(|v| format!("{v:?}"))
                .collect::<Vec<_>>()
                .join(", ")
        );
    }
    Ok(out)
}

/// A coordinate's name in a constant's.
fn constant(name: &str, info: &Info<'_>) -> String {
    let plain = |c: char| {
        if c.is_ascii_alphanumeric() {
            c.to_ascii_uppercase()
        } else {
            '_'
        }
    };
    let made: String = name.chars().map(plain).collect();
    // names that only differ in what a constant cannot hold are told apart by their place
    let same = |other: &&&str| other.chars().map(plain).collect::<String>() == made;
    if info.coordinates.iter().filter(same).count() > 1 {
        return format!("{made}_{}", info.index_of(name).unwrap_or_default());
    }
    made
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_bodies_of_a_text_are_replaced() {
        let text =
            "name: x\nbodies:\n  1: {mass: 1,\n      com: [0, 0, 0]}\n\n# about home\nhome: {}\n";
        assert_eq!(
            with_bodies(text, "bodies:\n  1: new\n"),
            "name: x\nbodies:\n  1: new\n\n# about home\nhome: {}\n"
        );
        assert_eq!(
            with_bodies("name: x", "bodies:\n  1: new\n"),
            "name: x\n\nbodies:\n  1: new\n"
        );
    }
}
