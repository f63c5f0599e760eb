//! Emits the type of the robot and its `Model` implementation, which checks the lengths of slices
//! and calls the functions over arrays.

use std::fmt::Write as _;

use crate::robot::{Function, Robot};
use crate::signature::{Argument, FunctionKind, GEOMETRY, Passing, Trait};

use super::super::elements::base_of;
use super::module::Options;
use super::names::type_name;

pub(super) fn write(robot: &Robot, options: &Options, out: &mut String) {
    let name = type_name(&robot.name);
    let runtime = &options.runtime;
    let _ = writeln!(out);
    let _ = writeln!(out, "/// The robot as a `Model`, over slices.");
    if robot.adjustable.is_empty() {
        let _ = writeln!(out, "#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]");
        let _ = writeln!(out, "pub struct {name};\n");
    } else {
        let _ = writeln!(out, "#[derive(Clone, Copy, Debug, Default, PartialEq)]");
        let _ = writeln!(out, "pub struct {name} {{");
        let _ = writeln!(out, "    /// The geometry that its functions are given.");
        let _ = writeln!(out, "    pub geometry: Geometry,");
        let _ = writeln!(out, "}}\n");
    }
    let _ = writeln!(out, "impl<T: Scalar> Model<T> for {name} {{");
    let _ = writeln!(out, "    fn info(&self) -> Info<'_> {{");
    let _ = writeln!(out, "        INFO");
    let _ = writeln!(out, "    }}");
    eval(robot, "eval", "Function", Trait::Model, runtime, out);
    let _ = writeln!(out, "}}");
    if has_control(robot) {
        let _ = writeln!(out, "\nimpl<T: Scalar> ControlModel<T> for {name} {{");
        eval(
            robot,
            "eval_control",
            "ControlFunction",
            Trait::ControlModel,
            runtime,
            out,
        );
        let _ = writeln!(out, "}}");
    }
    let Some(analysis) = base_of(robot) else {
        return;
    };
    let _ = writeln!(out);
    let _ = writeln!(out, "impl<T: Scalar> BaseModel<T> for {name} {{");
    let _ = writeln!(out, "    fn base_info(&self) -> BaseInfo<'_> {{");
    let _ = writeln!(out, "        BASE_INFO");
    let _ = writeln!(out, "    }}");
    if super::base::has_zeros(analysis) {
        let _ = writeln!(out, "\n    fn zeros(&self) -> &[BaseParameter<'_>] {{");
        let _ = writeln!(out, "        &ZEROS");
        let _ = writeln!(out, "    }}");
    }
    eval(
        robot,
        "eval_base",
        "BaseFunction",
        Trait::BaseModel,
        runtime,
        out,
    );
    let _ = writeln!(out, "}}");
    if let Some(function) = robot.function(FunctionKind::BaseRegressor) {
        kernel(robot, function, &name, out);
    }
}

/// Whether the robot has functions for controllers.
pub(super) fn has_control(robot: &Robot) -> bool {
    let mut functions = robot.functions.iter();
    functions.any(|function| function.kind.signature().of == Trait::ControlModel)
}

/// Emits `BaseKernel`: the base regressor over arrays, for samples in SIMD lanes.
fn kernel(robot: &Robot, function: &Function, name: &str, out: &mut String) {
    let n = robot.coordinates.len();
    let [columns, dof] = function.program.output.shape[..] else {
        return;
    };
    let _ = writeln!(out);
    let _ = writeln!(out, "impl BaseKernel<{n}, {dof}, {columns}> for {name} {{");
    let _ = writeln!(out, "    #[inline(always)]");
    let _ = writeln!(
        out,
        "    fn base_entries<T: Scalar>(q: &[T; {n}], qd: &[T; {n}], qdd: &[T; {n}], w: &mut [[T; {dof}]; {columns}]) -> Condition<T> {{"
    );
    let _ = writeln!(out, "        base_regressor_entries(q, qd, qdd, w)");
    let _ = writeln!(out, "    }}\n}}");
}

/// Emits the trait's primitive method, with one arm for each of the trait's functions.
///
/// The method is inlined everywhere, so that a named method, which passes a constant, compiles to
/// the call in one arm.
fn eval(robot: &Robot, method: &str, functions: &str, of: Trait, runtime: &str, out: &mut String) {
    let _ = writeln!(out, "\n    #[inline(always)]");
    let _ = writeln!(
        out,
        "    fn {method}(&self, function: {functions}, arguments: Arguments<'_, T>, out: &mut [T]) -> Result<Condition<T>, SizeError> {{"
    );
    let _ = writeln!(out, "        match function {{");
    let kinds = FunctionKind::ALL.into_iter();
    for kind in kinds.filter(|kind| kind.signature().of == of) {
        let _ = writeln!(out, "            {functions}::{kind:?} => {{");
        match robot.function(kind) {
            Some(function) => emit_call(function, runtime, out),
            None => emit_missing(robot, kind, runtime, out),
        }
        let _ = writeln!(out, "            }}");
    }
    let _ = writeln!(out, "        }}\n    }}");
}

/// Emits the check that an argument has the given length; returns the argument's name.
fn checked(argument: Argument, length: usize, runtime: &str, out: &mut String) -> &'static str {
    let name = argument.row().runtime_name;
    let _ = writeln!(
        out,
        "                let {name} = {runtime}::array::<T, {length}>(arguments.{name}, {name:?})?;"
    );
    name
}

/// Emits the call of a function that the robot has.
fn emit_call(function: &Function, runtime: &str, out: &mut String) {
    let Function { kind, program } = function;
    let signature = kind.signature();
    let arguments = signature.arguments.iter().zip(&program.arguments);
    let mut names: Vec<&str> = arguments
        .map(|(argument, program)| checked(*argument, program.len, runtime, out))
        .collect();
    let proto = names.first().copied().unwrap_or("q");
    let shape = &program.output.shape;
    let target = match shape.as_slice() {
        // a matrix without columns is passed as an empty array
        [outer, inner] if *inner > 0 => {
            format!("{runtime}::matrix_mut::<T, {outer}, {inner}>(out, \"out\")?")
        }
        _ => format!(
            "{runtime}::array_mut::<T, {}>(out, \"out\")?",
            shape.iter().product::<usize>()
        ),
    };
    let mut line = |text: String| {
        let _ = writeln!(out, "                {text}");
    };
    if program.arguments.len() > signature.arguments.len() {
        line(format!("let geometry = &self.geometry.splat({proto}[0]);"));
        names.push(GEOMETRY.name);
    }
    line(format!("let out = {target};"));
    let name = signature.name;
    match (signature.passing, signature.has_condition) {
        (Passing::Written, _) => {
            names.push("out");
            line(format!("Ok({name}({}))", names.join(", ")));
        }
        (Passing::Returned, true) => {
            line(format!(
                "let (value, condition) = {name}({});",
                names.join(", ")
            ));
            line("*out = value;".to_owned());
            line("Ok(condition)".to_owned());
        }
        (Passing::Returned, false) => {
            line(format!("*out = {name}({});", names.join(", ")));
            line(format!("Ok(Condition::regular({proto}[0]))"));
        }
    }
}

/// Emits the arm of a function that the robot does not have, such as those of loop closure for a
/// tree, or swing limits. The arm checks the lengths of the arguments and writes nothing.
fn emit_missing(robot: &Robot, kind: FunctionKind, runtime: &str, out: &mut String) {
    let arguments = kind.signature().arguments.iter();
    let names: Vec<&str> = arguments
        .map(|argument| checked(*argument, robot.length(argument.row().size), runtime, out))
        .collect();
    for name in names.iter().skip(1) {
        let _ = writeln!(out, "                let _ = {name};");
    }
    let proto = names.first().copied().unwrap_or("q");
    let _ = writeln!(
        out,
        "                let _ = {runtime}::array_mut::<T, 0>(out, \"out\")?;"
    );
    let condition = if kind.signature().has_condition {
        let motion: Vec<&str> = names
            .iter()
            .copied()
            .filter(|n| n.starts_with('q'))
            .collect();
        format!("Condition::of_state({proto}[0], &[{}])", motion.join(", "))
    } else {
        format!("Condition::regular({proto}[0])")
    };
    let _ = writeln!(out, "                Ok({condition})");
}
