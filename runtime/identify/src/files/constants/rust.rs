//! Constants in Rust.

use std::fmt::Write as _;

use regen_runtime::BaseModel;

use super::{lists, one_line, origin};
use crate::files::FileError;
use crate::identify::digest;
use crate::model::IdentifiedModel;

/// Writes Rust source with the constants of an identified model: base parameters, all parameters
/// of a physically feasible model, and nonlinear friction, with method, logs and date.
///
/// - `module`: the path of the robot's generated module. The constants compile only together with
///   the module of this model: its `DIGEST` is compared at compile time.
///
/// # Errors
/// When parameters of the model have labels that no body or joint has.
pub fn rust_constants<M: BaseModel<f64> + ?Sized>(
    model: &M,
    identified: &IdentifiedModel,
    module: Option<&str>,
) -> Result<String, FileError> {
    let mut out = format!(
        "// Identified parameters of {}.\n",
        one_line(model.info().name)
    );
    // writing to a String cannot fail
    for line in origin(identified) {
        let _ = writeln!(out, "// {line}");
    }
    if let Some(module) = module {
        let _ = write!(
            out,
            "\n// Compiles with the model that the parameters were identified for only.\n\
             const _: () = assert!(\n    {module}::DIGEST == 0x{},\n    \
             \"these parameters are of another model: identify again\"\n);\n",
            digest(model)
        );
    }
    for list in lists(model, identified)? {
        let _ = write!(
            out,
            "\n/// {}\npub const {}: [f64; {}] = [\n",
            list.doc,
            list.name,
            list.values.len()
        );
        for (value, label, unit) in &list.values {
            let comma = if unit.is_empty() { "" } else { ", " };
            let _ = writeln!(out, "    {value:?}, // {label}{comma}{unit}");
        }
        out.push_str("];\n");
    }
    Ok(out)
}
