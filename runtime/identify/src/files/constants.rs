//! Writes identified parameters as Rust constants for a controller.

use std::fmt::Write as _;

use regen_runtime::{BaseModel, Info};

use super::FileError;
use crate::feasibility::{self, ParameterLayout, unit};
use crate::identify::digest;
use crate::model::IdentifiedModel;

/// Writes Rust source with the constants of an identified model: base parameters, all parameters
/// of a physically feasible model, and nonlinear friction.
///
/// - `module`: the path of the robot's generated module. The constants compile only together with
///   the module of this model: its `DIGEST` is compared at compile time.
///
/// # Errors
/// When parameters of the model have labels that no body or joint has.
pub fn rust_constants<M: BaseModel<f64> + ?Sized>(
    model: &M,
    found: &IdentifiedModel,
    module: Option<&str>,
) -> Result<String, FileError> {
    let info = model.info();
    let base = model.base_info().base;
    let mut out = String::new();
    // writing to a String cannot fail
    if let Some(module) = module {
        let _ = write!(
            out,
            "// Compiles with the model that the parameters were identified for only.\n\
             const _: () = assert!(\n    {module}::DIGEST == 0x{},\n    \
             \"these parameters are of another model: identify again\"\n);\n\n",
            digest(model)
        );
    }
    let _ = write!(
        out,
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
        let layout = ParameterLayout::of(info.parameters)?;
        out.push('\n');
        out.push_str(&feasibility::rust_constants(&layout, phi, &info)?);
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

/// A coordinate's name as part of a constant's name.
fn constant(name: &str, info: &Info<'_>) -> String {
    let plain = |c: char| {
        if c.is_ascii_alphanumeric() {
            c.to_ascii_uppercase()
        } else {
            '_'
        }
    };
    let made: String = name.chars().map(plain).collect();
    // names that differ only in characters that a constant cannot have get their index
    let same = |other: &&&str| other.chars().map(plain).collect::<String>() == made;
    if info.coordinates.iter().filter(same).count() > 1 {
        return format!("{made}_{}", info.index_of(name).unwrap_or_default());
    }
    made
}
