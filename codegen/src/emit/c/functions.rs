//! The functions: their prototypes, their text in both precisions, and the stack that they take.

use std::cell::Cell;
use std::fmt::Write as _;

use crate::optimize::{Op, Program};
use crate::robot::{Function, Robot};
use crate::signature::FunctionKind;

use super::super::body::statements;
use super::super::elements::{adjustable_names, preferred_names};
use super::super::plan::{is_zero, reads_argument};
use super::close;
use super::constants;
use super::statements::{C, Precision};
use super::support::Helpers;
use super::words::Spelling;

/// Bytes of stack that a function takes besides its values: saved registers, addresses, and the
/// frames of the helpers for sines, cosines and systems.
const FRAME: usize = 1536;

/// Entries above which a run of zeros is written by a loop: compilers store short runs faster where
/// they see each entry.
const LONG_RUN: usize = 64;

/// A function in one precision.
struct Emitted {
    kind: FunctionKind,
    precision: Precision,
    text: String,
    /// A bound of the bytes of stack that it and its helpers take.
    stack: usize,
}

/// All functions of a robot with their helpers.
pub(super) struct Functions {
    emitted: Vec<Emitted>,
    /// The text of the helpers, by precision.
    helpers: [String; 2],
}

/// The names of a robot's functions, of both precisions.
pub(super) fn symbols<'r>(
    robot: &'r Robot,
    names: &'r Spelling,
) -> impl Iterator<Item = String> + 'r {
    let both = |f: &'r Function| Precision::ALL.map(|p| name(f.kind, p, names));
    robot.functions.iter().flat_map(both)
}

fn name(kind: FunctionKind, precision: Precision, names: &Spelling) -> String {
    format!("{}_{}{}", names.prefix, kind.name(), precision.suffix())
}

impl Functions {
    pub(super) fn of(robot: &Robot, names: &Spelling) -> Self {
        let mut emitted = Vec::new();
        let helpers = Precision::ALL.map(|precision| {
            let helpers = Helpers::default();
            for function in &robot.functions {
                emitted.push(write(robot, function, precision, names, &helpers));
            }
            helpers.text(&names.prefix, precision)
        });
        Self { emitted, helpers }
    }

    /// The bound of the stack that a function takes, bytes.
    pub(super) fn stack(&self, kind: FunctionKind, precision: Precision) -> usize {
        let mut all = self.emitted.iter();
        let found = all.find(|e| e.kind == kind && e.precision == precision);
        found.map_or(0, |e| e.stack)
    }

    /// The contents of the source file.
    pub(super) fn text(&self, robot: &Robot, names: &Spelling) -> String {
        let Spelling { prefix, macros } = names;
        let mut out =
            format!("#include \"{prefix}.h\"\n\n#include <math.h>\n#include <stdint.h>\n");
        constants::definitions(robot, names, &mut out);
        for (precision, helpers) in Precision::ALL.into_iter().zip(&self.helpers) {
            let guard = guard(macros, precision);
            let _ = writeln!(out, "\n#ifndef {guard}");
            out.push_str(helpers);
            for function in self.emitted.iter().filter(|e| e.precision == precision) {
                out.push('\n');
                out.push_str(&function.text);
            }
            out.push_str(&close::definition(robot, names, precision));
            let _ = writeln!(out, "\n#endif /* {guard} */");
        }
        out
    }
}

/// The macro that leaves the functions of a precision out.
pub(super) fn guard(macros: &str, precision: Precision) -> String {
    format!("{macros}_NO_{}", precision.type_name().to_ascii_uppercase())
}

/// The head of a function, without semicolon or body.
pub(super) fn prototype(function: &Function, precision: Precision, names: &Spelling) -> String {
    let Function { kind, program } = function;
    let number = precision.type_name();
    let restrict = format!("{}_RESTRICT", names.macros);
    let returned = if kind.signature().has_condition {
        number
    } else {
        "void"
    };
    let inputs = program.arguments.iter();
    let mut parameters: Vec<String> = inputs
        .map(|a| format!("const {number} *{restrict} {}", a.name))
        .collect();
    parameters.push(format!("{number} *{restrict} {}", program.output.name));
    let name = name(*kind, precision, names);
    let flat = format!("{returned} {name}({})", parameters.join(", "));
    if flat.len() <= 100 {
        return flat;
    }
    format!("{returned} {name}(\n    {})", parameters.join(",\n    "))
}

fn write(
    robot: &Robot,
    function: &Function,
    precision: Precision,
    names: &Spelling,
    helpers: &Helpers,
) -> Emitted {
    let Function { kind, program } = function;
    let language = C {
        prefix: &names.prefix,
        precision,
        has_condition: kind.signature().has_condition,
        helpers,
        numbered: Cell::new(0),
        entries: Cell::new(0),
    };
    let arguments = kind.signature().arguments.iter();
    let preferred: Vec<Vec<String>> = arguments
        .map(|a| preferred_names(robot, *a))
        .chain([adjustable_names(robot)])
        .collect();
    let body = statements(program, &language, &preferred);
    let mut text = prototype(function, precision, names);
    text.push_str("\n{\n");
    for (index, argument) in program.arguments.iter().enumerate() {
        if !reads_argument(program, index) {
            let _ = writeln!(text, "    (void){};", argument.name);
        }
    }
    write_zeros(program, precision, &mut text);
    text.push_str(&body);
    if kind.signature().has_condition {
        text.push_str("    return condition;\n");
    }
    text.push_str("}\n");
    let bytes = match precision {
        Precision::Double => 8,
        Precision::Float => 4,
    };
    // rounded up to a multiple that is easy to read
    let stack = (FRAME + bytes * language.entries.get() + helper_arrays(program, bytes))
        .next_multiple_of(64);
    Emitted {
        kind: *kind,
        precision,
        text,
        stack,
    }
}

/// Bytes of the matrices and right-hand sides that a function passes to the pivoting solver, where
/// the fixed order of pivots is unsuitable; compilers keep copies of them on the stack.
fn helper_arrays(program: &Program, bytes: usize) -> usize {
    let systems = program.steps.iter().filter_map(|step| match &step.op {
        Op::Solve(solve) => Some(
            solve
                .matrix
                .iter()
                .chain(&solve.rhs)
                .map(Vec::len)
                .sum::<usize>(),
        ),
        _ => None,
    });
    bytes * systems.sum::<usize>()
}

/// Writes stores of the entries that are zero at every state.
fn write_zeros(program: &Program, precision: Precision, text: &mut String) {
    let zero = precision.literal(0.0);
    let name = &program.output.name;
    let zeros: Vec<usize> = (0..program.outputs.len())
        .filter(|entry| is_zero(&program.outputs[*entry]))
        .collect();
    for run in zeros.chunk_by(|a, b| a + 1 == *b) {
        match run {
            [first, .., last] if run.len() > LONG_RUN => {
                let _ = writeln!(
                    text,
                    "    for (int i_ = {first}; i_ <= {last}; i_++) {{\n        {name}[i_] = {zero};\n    }}"
                );
            }
            _ => {
                for entry in run {
                    let _ = writeln!(text, "    {name}[{entry}] = {zero};");
                }
            }
        }
    }
}
