//! Emits the module of a robot: constants, functions, and the type that implements `Model`.

use std::fmt::Write as _;

use crate::digest::digest;
use crate::optimize::{Operations, Output, Program};
use crate::robot::{Function, Robot};
use crate::signature::Passing;

use super::super::body::statements;
use super::super::documentation::{DIGEST, EQUATIONS, base_sizes, operations, sizes};
use super::super::elements::{adjustable_names, base_of, preferred_names};
use super::super::plan::{is_zero, reads_argument};
use super::super::text::wrapped;
use super::names::{BASE_IMPORTS, IMPORTS, literal};
use super::statements::Rust;
use super::{base, geometry, stated, trait_impl};

/// The largest number of zeros of a matrix that are stored one by one: more are code that is read
/// once and slower than a fill of the memory.
const MAX_STORED_ZEROS: usize = 1000;

/// Options for the text of a module.
#[derive(Clone, Debug)]
pub struct Options {
    /// Path of the runtime crate, such as `::regen_runtime`.
    pub runtime: String,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            runtime: "::regen_runtime".to_owned(),
        }
    }
}

/// The contents of a robot's module as Rust text, with its documentation as inner comments.
///
/// ```
/// use regen_codegen::Mechanism;
/// use regen_codegen::diag::Source;
/// use regen_codegen::emit::{Options, module};
/// use regen_codegen::robot::FunctionKind;
///
/// let text = "\
/// name: arm
/// limbs:
///   - name: arm
///     joints:
///       - {name: q1, type: revolute, body: link, actuated: true}
/// ";
/// let mechanism = Mechanism::open(&Source::new("arm.yaml", text))?;
/// let robot = mechanism.robot(&[FunctionKind::Poses])?;
/// assert!(module(&robot, &Options::default()).contains("pub fn poses<T: Scalar>"));
/// # Ok::<(), regen_codegen::diag::Report>(())
/// ```
pub fn module(robot: &Robot, options: &Options) -> String {
    let mut out = String::new();
    header(robot, &mut out);
    let runtime = &options.runtime;
    let _ = writeln!(
        out,
        "#![allow(clippy::all, clippy::pedantic, reason = \"written by a program\")]\n"
    );
    let _ = writeln!(out, "use {runtime}::{{");
    for name in IMPORTS.iter().filter(|name| imports(robot, name)) {
        let _ = write!(out, " {name},");
    }
    let _ = writeln!(out, " }};");
    if base_of(robot).is_some() {
        let names = BASE_IMPORTS.iter().filter(|name| imports(robot, name));
        let names: Vec<&str> = names.copied().collect();
        let _ = writeln!(out, "use {runtime}::{{{}}};", names.join(", "));
    }
    let _ = writeln!(out);
    constants(robot, &mut out);
    let _ = writeln!(
        out,
        "/// {DIGEST}\npub const DIGEST: u64 = 0x{:016x};",
        digest(robot)
    );
    if let Some(analysis) = base_of(robot) {
        base::constants(robot, analysis, &mut out);
    }
    for function in &robot.functions {
        write_function(robot, function, options, &mut out);
    }
    trait_impl::write(robot, options, &mut out);
    out
}

/// Whether a robot's module uses a name that modules can import.
fn imports(robot: &Robot, name: &str) -> bool {
    let mut joints = robot.joints.iter();
    match name {
        "ControlFunction" | "ControlModel" => trait_impl::has_control(robot),
        "Cut" => !robot.cuts.is_empty(),
        "Friction" => joints.any(|j| j.friction_name() != "None"),
        "Limits" => joints.any(|j| j.limits.iter().any(Option::is_some)),
        "Parameter" | "Symbol" => !robot.parameters.is_empty(),
        "Certificate" => base_of(robot).is_some_and(|a| a.certificate.is_ok()),
        _ => true,
    }
}

fn header(robot: &Robot, out: &mut String) {
    let description = robot.description.as_deref().unwrap_or("a robot model");
    // the documentation must stay on one line
    let mut description = description.replace(['\n', '\r'], " ");
    // and must not be read as links or markup
    for mark in ["[", "]", "<", ">", "`", "*"] {
        description = description.replace(mark, &format!("\\{mark}"));
    }
    let _ = writeln!(out, "//! `{}`: {description}.", robot.name);
    let _ = writeln!(out, "//!");
    let _ = writeln!(
        out,
        "//! Written by `regen` from the robot's spec; edits here are lost.\n//!"
    );
    for line in EQUATIONS {
        let _ = writeln!(out, "//! {line}");
    }
    let _ = writeln!(out, "//!\n//! {}\n//!", sizes(robot));
    if let Some(base) = base_sizes(robot) {
        let _ = writeln!(out, "//! {base}\n//!");
    }
    let has_roots = robot
        .functions
        .iter()
        .any(|function| function.program.operations().sqrt > 0);
    let [head, rule] = if has_roots {
        [" sqrt |", "---|"]
    } else {
        ["", ""]
    };
    let _ = writeln!(
        out,
        "//! | function | add | mul | div | sin and cos |{head}"
    );
    let _ = writeln!(out, "//! |---|---|---|---|---|{rule}");
    for function in &robot.functions {
        let Operations {
            add,
            mul,
            div,
            sincos,
            sqrt,
        } = function.program.operations();
        let name = function.kind.name();
        let roots = if has_roots {
            format!(" {sqrt} |")
        } else {
            String::new()
        };
        let _ = writeln!(
            out,
            "//! | [`{name}`] | {add} | {mul} | {div} | {sincos} |{roots}"
        );
    }
    let _ = writeln!(out);
}

fn strings(out: &mut String, doc: &str, name: &str, items: &[String]) {
    let _ = writeln!(out, "/// {doc}");
    let _ = writeln!(out, "pub const {name}: [&str; {}] = [", items.len());
    wrapped(out, items.iter().map(|s| format!("{s:?}")));
    let _ = writeln!(out, "];");
}

fn indices(out: &mut String, doc: &str, name: &str, items: &[usize]) {
    let _ = writeln!(out, "/// {doc}");
    let list: Vec<String> = items.iter().map(usize::to_string).collect();
    let _ = writeln!(
        out,
        "pub const {name}: [usize; {}] = [{}];",
        items.len(),
        list.join(", ")
    );
}

fn constants(robot: &Robot, out: &mut String) {
    strings(
        out,
        "Names of the coordinates, in the order of `q`.",
        "COORDINATES",
        &robot.coordinates,
    );
    indices(
        out,
        "The independent coordinates, as indices: the rows of the regressor.",
        "INDEPENDENT",
        &robot.independent,
    );
    indices(
        out,
        "The other coordinates, as indices.",
        "DEPENDENT",
        &robot.dependent,
    );
    indices(
        out,
        "The actuated coordinates, as indices.",
        "ACTUATED",
        &robot.actuated,
    );
    stated::parameters(robot, out);
    strings(out, "Labels of the bodies.", "BODIES", &robot.bodies);
    if !robot.frames.is_empty() {
        strings(out, "Names of the frames.", "FRAMES", &robot.frames);
    }
    let _ = writeln!(
        out,
        "/// The home configuration, closed; it picks the assembly branch."
    );
    let _ = writeln!(out, "pub const HOME: [f64; {}] = [", robot.home.len());
    wrapped(out, robot.home.iter().copied().map(literal));
    let _ = writeln!(out, "];");
    stated::constants(robot, out);
    geometry::write(robot, out);
    let _ = writeln!(out, "/// Names, sizes, and what is stated about joints.");
    let _ = writeln!(out, "pub const INFO: Info<'static> = Info {{");
    let _ = writeln!(out, "    name: {:?},", robot.name);
    for (field, constant) in [
        ("coordinates", "COORDINATES"),
        ("independent", "INDEPENDENT"),
        ("dependent", "DEPENDENT"),
        ("actuated", "ACTUATED"),
        ("parameters", "PARAMETERS"),
        ("bodies", "BODIES"),
    ] {
        let _ = writeln!(out, "    {field}: &{constant},");
    }
    let cuts: Vec<String> = robot
        .cuts
        .iter()
        .map(|c| format!("Cut {{ name: {:?}, rows: {} }}", c.name, c.rows))
        .collect();
    let _ = writeln!(out, "    cuts: &[{}],", cuts.join(", "));
    let frames = if robot.frames.is_empty() {
        "[]"
    } else {
        "FRAMES"
    };
    let _ = writeln!(out, "    frames: &{frames},");
    let _ = writeln!(out, "    home: &HOME,");
    let [x, y, z] = robot.gravity.map(literal);
    let _ = writeln!(out, "    gravity: [{x}, {y}, {z}],");
    let _ = writeln!(out, "    rows: {},", robot.rows);
    let _ = writeln!(out, "    joints: &JOINTS,");
    let _ = writeln!(out, "    cones: &CONES,");
    let _ = writeln!(out, "    nominal: &NOMINAL,");
    let _ = writeln!(out, "}};");
}

/// The type of an array of this shape.
pub(super) fn array_type(shape: &[usize]) -> String {
    match shape {
        [outer, inner] => format!("[[T; {inner}]; {outer}]"),
        [len] => format!("[T; {len}]"),
        _ => "T".to_owned(),
    }
}

fn write_function(robot: &Robot, function: &Function, options: &Options, out: &mut String) {
    let Function { kind, program } = function;
    let signature = kind.signature();
    let (name, has_condition) = (signature.name, signature.has_condition);
    let output = &program.output;
    let result = array_type(&output.shape);
    let _ = writeln!(out);
    let _ = writeln!(out, "/// {}", signature.formula);
    let _ = writeln!(out, "///");
    for argument in &program.arguments {
        let _ = writeln!(out, "/// - `{}`: {}", argument.name, argument.doc);
    }
    let _ = writeln!(out, "/// - `{}`: {}", output.name, output.doc);
    let operations = operations(program.operations());
    let _ = writeln!(out, "///\n/// {operations}");
    let mut parameters: Vec<String> = program
        .arguments
        .iter()
        .map(|a| format!("{}: &[T; {}]", a.name, a.len))
        .collect();
    let through = signature.passing == Passing::Written;
    if through {
        parameters.push(format!("{}: &mut {result}", output.name));
    }
    let returned = match (has_condition, through) {
        (true, true) => "Condition<T>".to_owned(),
        (true, false) => format!("({result}, Condition<T>)"),
        (false, _) => result.clone(),
    };
    let parameters = parameters.join(", ");
    let _ = writeln!(
        out,
        "pub fn {name}<T: Scalar>({parameters}) -> {returned} {{"
    );
    if through {
        let mut calls: Vec<&str> = program.arguments.iter().map(|a| a.name.as_str()).collect();
        calls.push(&output.name);
        write_zeros(program, calls[0], out);
        let _ = writeln!(out, "    {name}_entries({})\n}}\n", calls.join(", "));
        let _ = writeln!(
            out,
            "/// The entries of [`{name}`] that are not zero at every state; the others are left as they are."
        );
        let _ = writeln!(out, "///");
        let _ = writeln!(
            out,
            "/// Inlined where it is called, so that lanes keep the caller's instruction set."
        );
        let _ = writeln!(out, "#[inline(always)]");
        let _ = writeln!(
            out,
            "pub fn {name}_entries<T: Scalar>({parameters}) -> {returned} {{"
        );
    }
    let arguments = signature.arguments.iter();
    let names: Vec<Vec<String>> = arguments
        .map(|a| preferred_names(robot, *a))
        .chain([adjustable_names(robot)])
        .collect();
    let language = Rust {
        runtime: &options.runtime,
        has_condition,
    };
    let body = statements(program, &language, &names);
    let body = mark_unused(program, body);
    if through {
        out.push_str(&body);
    } else {
        // after `proto` is bound, on the body's first line
        let (first, rest) = body.split_once('\n').unwrap_or((body.as_str(), ""));
        let _ = writeln!(out, "{first}");
        let zeros = zeros(program);
        let _ = writeln!(out, "    let mut {} = {zeros};", output.name);
        out.push_str(rest);
    }
    let condition = if program.solves() {
        "Condition { pivot: condition }"
    } else {
        "condition"
    };
    let _ = match (has_condition, through) {
        (true, true) => writeln!(out, "    {condition}"),
        (true, false) => writeln!(out, "    ({}, {condition})", output.name),
        (false, _) => writeln!(out, "    {}", output.name),
    };
    let _ = writeln!(out, "}}");
}

/// Mentions once the arguments that the program does not use, so that the compiler does not warn
/// about them.
fn mark_unused(program: &Program, mut body: String) -> String {
    for (index, argument) in program.arguments.iter().enumerate().skip(1) {
        if !reads_argument(program, index) {
            let _ = writeln!(body, "    let _ = {};", argument.name);
        }
    }
    body
}

/// Writes stores of the entries that are zero at every state, one by one where they are few:
/// consecutive stores are merged by the compiler, and most columns have few zeros. Of a tree of many
/// joints most entries are zero, so the whole matrix is filled first.
fn write_zeros(program: &Program, proto: &str, out: &mut String) {
    let Output { name, shape, .. } = &program.output;
    let inner = shape.get(1).copied().unwrap_or(1).max(1);
    let zeros = program.outputs.iter().filter(|o| is_zero(o)).count();
    if zeros == 0 {
        return;
    }
    let _ = writeln!(out, "    let zero = {proto}[0].splat(0.0);");
    if zeros > MAX_STORED_ZEROS {
        let _ = writeln!(out, "    {name}.fill([zero; {inner}]);");
        return;
    }
    for (outer, entries) in program.outputs.chunks(inner).enumerate() {
        if entries.iter().all(is_zero) {
            let _ = writeln!(out, "    {name}[{outer}] = [zero; {inner}];");
            continue;
        }
        let zeros = entries.iter().enumerate().filter(|(_, o)| is_zero(o));
        let zeros: Vec<String> = zeros
            .map(|(at, _)| format!("{name}[{outer}][{at}] = zero;"))
            .collect();
        if !zeros.is_empty() {
            let _ = writeln!(out, "    {}", zeros.join(" "));
        }
    }
}

fn zeros(program: &Program) -> String {
    match program.output.shape.as_slice() {
        [outer, inner] => format!("[[proto.splat(0.0); {inner}]; {outer}]"),
        [len] => format!("[proto.splat(0.0); {len}]"),
        _ => "proto.splat(0.0)".to_owned(),
    }
}
