//! Constants in Python.

use std::fmt::Write as _;

use regen_runtime::BaseModel;

use super::{lists, one_line};
use crate::files::FileError;
use crate::identify::digest;
use crate::model::IdentifiedModel;

/// Writes a Python module with the constants of an identified model: what
/// [`rust_constants`](super::rust_constants) writes, as dictionaries of labels to numbers in their
/// order, with `DIGEST`, `METHOD`, `LOGS`, `DATE` and a function `check`, which refuses another
/// model's digest.
///
/// # Errors
/// When parameters of the model have labels that no body or joint has.
pub fn python_constants<M: BaseModel<f64> + ?Sized>(
    model: &M,
    identified: &IdentifiedModel,
) -> Result<String, FileError> {
    let logs: Vec<String> = identified
        .provenance
        .logs
        .iter()
        .map(|log| text(log))
        .collect();
    let date = identified.provenance.date.as_deref();
    let mut out = format!(
        "\"\"\"Identified parameters of a robot, SI units.\n\n\
         Call check(digest) with the digest of the model that they are used with.\"\"\"\n\n\
         ROBOT = {}\nDIGEST = \"{}\"\nMETHOD = {}\nLOGS = [{}]\nDATE = {}\n\n\n\
         def check(digest):\n    \
             \"\"\"Raises ValueError unless a model's digest, a number or its hexadecimal text, is that of\n    \
             these parameters.\"\"\"\n    \
             given = f\"{{digest:016x}}\" if isinstance(digest, int) else str(digest)\n    \
             if given.lower().removeprefix(\"0x\") != DIGEST:\n        \
                 raise ValueError(f\"the parameters are of model {{DIGEST}}, not of {{given}}: identify again\")\n",
        text(model.info().name),
        digest(model),
        text(&identified.name),
        logs.join(", "),
        date.map_or_else(|| "None".to_owned(), text),
    );
    for list in lists(model, identified)? {
        let _ = write!(out, "\n# {}\n{} = {{\n", one_line(&list.doc), list.name);
        for (value, label, unit) in &list.values {
            let unit = if unit.is_empty() {
                String::new()
            } else {
                format!("  # {unit}")
            };
            let _ = writeln!(out, "    {}: {},{unit}", text(label), number(*value));
        }
        out.push_str("}\n");
    }
    Ok(out)
}

/// A text as Python reads it back.
fn text(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => {
                out.push('\\');
                out.push(c);
            }
            // breaks of lines and other control characters
            c if c.is_control() || matches!(c, '\u{2028}' | '\u{2029}') => {
                let _ = write!(out, "\\u{:04x}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

/// A number as Python reads it back.
fn number(value: f64) -> String {
    if value.is_finite() {
        format!("{value:?}")
    } else {
        format!("float(\"{value}\")")
    }
}
