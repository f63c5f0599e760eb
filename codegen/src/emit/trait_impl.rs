//! The type that stands for the robot, and its `Model`: slices checked once,
//! then the functions over arrays.

use std::fmt::Write as _;

use crate::robot::{Function, FunctionKind, Robot};

use super::module::{Options, base_of, has_condition, writes_through};
use super::names::type_name;

/// The trait's arguments that are not named as in the functions.
fn trait_argument(name: &str) -> &str {
    match name {
        "qd_r" => "qd_r_i",
        "qdd_r" => "qdd_r_i",
        "tau" => "tau_actuated",
        other => other,
    }
}

/// The arguments of a trait method, by its function's or, where the robot has
/// none, by the trait.
fn arguments(kind: FunctionKind) -> &'static [&'static str] {
    match kind {
        FunctionKind::Bias => &["q", "qd"],
        FunctionKind::Velocities => &["q", "qd_i"],
        FunctionKind::Accelerations => &["q", "qd", "qdd_i"],
        FunctionKind::Regressor | FunctionKind::BaseRegressor => &["q", "qd", "qdd"],
        FunctionKind::InverseDynamics => &["q", "qd", "qdd", "phi"],
        FunctionKind::Gravity | FunctionKind::MassMatrix => &["q", "phi"],
        FunctionKind::BiasForces => &["q", "qd", "phi"],
        FunctionKind::SlotineLi => &["q", "qd", "qd_r_i", "qdd_r_i"],
        FunctionKind::Efforts => &["q", "tau_actuated"],
        FunctionKind::Constraints
        | FunctionKind::Jacobian
        | FunctionKind::NewtonStep
        | FunctionKind::DependentJacobian
        | FunctionKind::Poses
        | FunctionKind::Cones => &["q"],
        FunctionKind::ToBase => &["phi"],
        FunctionKind::FromBase => &["beta", "free"],
        FunctionKind::BaseInverseDynamics => &["q", "qd", "qdd", "beta"],
        FunctionKind::BaseGravity | FunctionKind::BaseMassMatrix => &["q", "beta"],
        FunctionKind::BaseBiasForces => &["q", "qd", "beta"],
    }
}

pub(super) fn write(robot: &Robot, options: &Options, out: &mut String) {
    let name = type_name(&robot.name);
    let runtime = &options.runtime;
    let _ = writeln!(out);
    let _ = writeln!(out, "/// The robot as a `Model`, over slices.");
    let _ = writeln!(out, "#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]");
    let _ = writeln!(out, "pub struct {name};\n");
    let _ = writeln!(out, "impl<T: Scalar> Model<T> for {name} {{");
    let _ = writeln!(out, "    fn info(&self) -> Info<'_> {{");
    let _ = writeln!(out, "        INFO");
    let _ = writeln!(out, "    }}");
    for kind in FunctionKind::ALL.into_iter().filter(|k| !k.needs_base()) {
        if kind == FunctionKind::Cones && robot.cones.is_empty() {
            // the trait's own serves
            continue;
        }
        trait_method(robot, kind, runtime, out);
    }
    let _ = writeln!(out, "}}");
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
    for kind in FunctionKind::ALL.into_iter().filter(|k| k.needs_base()) {
        trait_method(robot, kind, runtime, out);
    }
    let _ = writeln!(out, "}}");
    if let Some(function) = robot.function(FunctionKind::BaseRegressor) {
        kernel(robot, function, &name, out);
    }
}

/// The base regressor over arrays, for samples in lanes.
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

fn trait_method(robot: &Robot, kind: FunctionKind, runtime: &str, out: &mut String) {
    let mut parameters = vec!["&self".to_owned()];
    parameters.extend(arguments(kind).iter().map(|a| format!("{a}: &[T]")));
    parameters.push("out: &mut [T]".to_owned());
    let result = if has_condition(kind) {
        "Condition<T>"
    } else {
        "()"
    };
    let _ = writeln!(out);
    let _ = writeln!(
        out,
        "    fn {}({}) -> Result<{result}, SizeError> {{",
        kind.name(),
        parameters.join(", ")
    );
    match robot.function(kind) {
        Some(function) => method(function, runtime, out),
        None => without_loops(robot, kind, runtime, out),
    }
    let _ = writeln!(out, "    }}");
}

fn method(function: &Function, runtime: &str, out: &mut String) {
    let kind = function.kind;
    let program = &function.program;
    let mut calls = Vec::new();
    for argument in &program.arguments {
        let name = trait_argument(&argument.name);
        let _ = writeln!(
            out,
            "        let {name} = {runtime}::array::<T, {}>({name}, {name:?})?;",
            argument.len
        );
        calls.push(name.to_owned());
    }
    let shape = &program.output.shape;
    let target = match shape.as_slice() {
        // no columns to write through
        [outer, inner] if *inner > 0 => {
            format!("{runtime}::matrix_mut::<T, {outer}, {inner}>(out, \"out\")?")
        }
        _ => format!(
            "{runtime}::array_mut::<T, {}>(out, \"out\")?",
            shape.iter().product::<usize>()
        ),
    };
    let _ = writeln!(out, "        let out = {target};");
    let name = kind.name();
    if writes_through(kind) {
        calls.push("out".to_owned());
        let _ = writeln!(out, "        Ok({name}({}))", calls.join(", "));
    } else if has_condition(kind) {
        let _ = writeln!(
            out,
            "        let (value, condition) = {name}({});",
            calls.join(", ")
        );
        let _ = writeln!(out, "        *out = value;");
        let _ = writeln!(out, "        Ok(condition)");
    } else {
        let _ = writeln!(out, "        *out = {name}({});", calls.join(", "));
        let _ = writeln!(out, "        Ok(())");
    }
}

/// Nothing is solved without dependent coordinates, and a tree has no rows: the lengths are checked,
/// nothing is written.
fn without_loops(robot: &Robot, kind: FunctionKind, runtime: &str, out: &mut String) {
    let n = robot.coordinates.len();
    for name in arguments(kind) {
        let binding = if *name == "q" && has_condition(kind) {
            "q"
        } else {
            "_"
        };
        let _ = writeln!(
            out,
            "        let {binding} = {runtime}::array::<T, {n}>({name}, {name:?})?;"
        );
    }
    let _ = writeln!(
        out,
        "        let _ = {runtime}::array_mut::<T, 0>(out, \"out\")?;"
    );
    if has_condition(kind) {
        let _ = writeln!(out, "        Ok(Condition::regular(q[0]))");
    } else {
        let _ = writeln!(out, "        Ok(())");
    }
}
