//! Constants in C.

use std::fmt::Write as _;

use regen_runtime::BaseModel;

use super::{lists, one_line, origin};
use crate::files::FileError;
use crate::identify::digest;
use crate::model::IdentifiedModel;

/// Writes a C header with the constants of an identified model as initialisers, which take the type
/// of their numbers: `static const float beta[] = RPS3_BETA(float);`. It contains the same
/// constants as [`rust_constants`](super::rust_constants), with method, logs and date.
///
/// - `prefix`: what the names of the robot's C functions begin with. The header includes the
///   robot's header `PREFIX.h` and does not compile with that of another model, because it compares
///   the digests.
///
/// # Errors
/// When parameters of the model have labels that no body or joint has.
pub fn c_constants<M: BaseModel<f64> + ?Sized>(
    model: &M,
    identified: &IdentifiedModel,
    prefix: &str,
) -> Result<String, FileError> {
    let macros = prefix.to_ascii_uppercase();
    let digest = digest(model);
    let mut out = format!(
        "/* Identified parameters of {}.\n",
        comment(model.info().name)
    );
    // writing to a String cannot fail
    for line in origin(identified) {
        let _ = writeln!(out, "   {}", comment(&line));
    }
    let _ = write!(
        out,
        "   The argument of each initialiser is the type of its numbers. */\n\
         #ifndef {macros}_IDENTIFIED_H_INCLUDED\n#define {macros}_IDENTIFIED_H_INCLUDED\n\n\
         #include \"{prefix}.h\"\n\n\
         #if {macros}_DIGEST != 0x{digest}ULL\n\
         #error \"these parameters are of another model: identify again\"\n\
         #endif\n"
    );
    for list in lists(model, identified)? {
        let _ = write!(
            out,
            "\n/* {} */\n#define {macros}_{}(NUMBER) {{ \\\n",
            comment(&list.doc),
            list.name
        );
        for (value, label, unit) in &list.values {
            let comma = if unit.is_empty() { "" } else { ", " };
            let label = comment(label);
            let _ = writeln!(out, "    (NUMBER){value:?}, /* {label}{comma}{unit} */ \\");
        }
        out.push_str("}\n");
    }
    let _ = writeln!(out, "\n#endif /* {macros}_IDENTIFIED_H_INCLUDED */");
    Ok(out)
}

/// A text within a comment: it neither ends the comment, nor opens one, nor continues a line.
fn comment(text: &str) -> String {
    let text = one_line(text).replace("*/", "* /").replace("/*", "/ *");
    // trigraphs and backslashes may continue a line
    text.replace('\\', "/").replace("??", "? ?")
}
