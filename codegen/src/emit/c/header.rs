//! The header: what the robot is, constants, and the documented prototypes.

use std::fmt::Write as _;

use crate::digest::digest;
use crate::robot::{Function, Robot};

use super::super::documentation::{DIGEST, EQUATIONS, base_sizes, operations, sizes};
use super::close;
use super::constants;
use super::functions::{Functions, guard, prototype};
use super::names::{comment, literal};
use super::statements::Precision;
use super::words::Spelling;

/// The contents of the header.
pub(super) fn text(robot: &Robot, names: &Spelling, functions: &Functions) -> String {
    let Spelling { macros, .. } = names;
    let mut out = String::new();
    description(robot, names, &mut out);
    let _ = write!(
        out,
        "#ifndef {macros}_H_INCLUDED\n#define {macros}_H_INCLUDED\n\n\
         #ifdef __cplusplus\nextern \"C\" {{\n#endif\n\n\
         /* Arrays that functions take do not overlap. */\n\
         #ifndef {macros}_RESTRICT\n\
         #if defined(__GNUC__) || defined(_MSC_VER)\n\
         #define {macros}_RESTRICT __restrict\n\
         #elif !defined(__cplusplus)\n\
         #define {macros}_RESTRICT restrict\n\
         #else\n\
         #define {macros}_RESTRICT\n\
         #endif\n#endif\n\n\
         /* {DIGEST} */\n\
         #define {macros}_DIGEST 0x{:016x}ULL\n\n\
         /* A state is singular where a returned condition is not at least the first number (nothing that\n   \
         is solved there has a meaning), and nearly singular where it is not at least the second. */\n\
         #define {macros}_SINGULAR {}\n#define {macros}_NEAR_SINGULAR {}\n",
        digest(robot),
        literal(super::SINGULAR),
        literal(super::NEAR_SINGULAR),
    );
    constants::declarations(robot, names, &mut out);
    out.push_str(
        "\n/* Functions allocate nothing, keep nothing between calls, and call no function of the C library\n   \
         but sin and cos, and sqrt where their count of operations has square roots. Angles are in rad,\n   \
         lengths in m. The stack that is stated is what a function and its helpers take, without what\n   \
         the C library's functions take. */\n",
    );
    for function in &robot.functions {
        out.push('\n');
        documentation(function, names, functions, &mut out);
        for precision in Precision::ALL {
            let guard = guard(macros, precision);
            let prototype = prototype(function, precision, names);
            let _ = writeln!(out, "#ifndef {guard}\n{prototype};\n#endif");
        }
    }
    close::declarations(robot, names, functions, &mut out);
    let _ = write!(
        out,
        "\n#ifdef __cplusplus\n}}\n#endif\n\n#endif /* {macros}_H_INCLUDED */\n"
    );
    out
}

fn description(robot: &Robot, names: &Spelling, out: &mut String) {
    let Spelling { prefix, macros } = names;
    let description = robot.description.as_deref().unwrap_or("a robot model");
    let _ = write!(
        out,
        "/* {}: {}.\n\n   \
         {}\n\n   {}\n",
        comment(&robot.name),
        comment(description),
        EQUATIONS.join("\n   "),
        sizes(robot),
    );
    if let Some(base) = base_sizes(robot) {
        let _ = writeln!(out, "   {base}");
    }
    let _ = write!(
        out,
        "\n   Names begin with {prefix}_. Those of functions on float end in _f. Define {macros}_NO_DOUBLE or\n   \
         {macros}_NO_FLOAT to leave one set out. C99, and C++ by extern \"C\". */\n"
    );
}

/// The comment above a function's prototypes.
fn documentation(function: &Function, names: &Spelling, functions: &Functions, out: &mut String) {
    let Function { kind, program } = function;
    let signature = kind.signature();
    let inner = program.output.shape.get(1).copied();
    let _ = writeln!(
        out,
        "/* {}\n",
        comment(&names.spell(signature.formula, None))
    );
    for argument in &program.arguments {
        let doc = comment(&names.spell(&argument.doc, None));
        let _ = writeln!(out, "   {}[{}]: {doc}", argument.name, argument.len);
    }
    let output = &program.output;
    let doc = comment(&names.spell(&output.doc, inner));
    let length: usize = output.shape.iter().product();
    let _ = writeln!(out, "   {}[{length}], written: {doc}", output.name);
    if signature.has_condition {
        let _ = writeln!(
            out,
            "   Returns the condition: the smallest pivot of A_e relative to its usual size, 1 without loops,\n   \
             NaN where an argument that is not a parameter or an effort is not finite."
        );
    }
    let operations = operations(program.operations());
    let [double, float] = Precision::ALL.map(|p| functions.stack(*kind, p));
    let _ = writeln!(
        out,
        "\n   {operations}\n   \
         Stack: at most {double} bytes on double, {float} on float. */"
    );
}
