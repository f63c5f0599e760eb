//! Emits the values that the spec states in addition to the mechanism: joints with their limits and
//! nominal values, swing limits, nominal parameters.

use std::fmt::Write as _;

use crate::robot::{JointInfo, MotionKind, Parameter, ParameterKind, Robot, SpringPart};

use super::super::text::wrapped;
use super::names::literal;

/// The variants of `Symbol` for a body's ten parameters, in their order.
const INERTIAL_SYMBOLS: [&str; 10] = [
    "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "Mx", "My", "Mz", "Mass",
];

/// Emits the constant `PARAMETERS`.
pub(super) fn parameters(robot: &Robot, out: &mut String) {
    let _ = writeln!(
        out,
        "/// The parameters, in the order of `phi`: the columns of the regressor."
    );
    let _ = writeln!(
        out,
        "pub const PARAMETERS: [Parameter<'static>; {}] = [",
        robot.parameters.len()
    );
    wrapped(out, robot.parameters.iter().map(parameter));
    let _ = writeln!(out, "];");
}

/// A parameter as Rust text: its symbol, and its owner, which is the label of a body or the name of
/// a coordinate or spring.
fn parameter(parameter: &Parameter) -> String {
    let symbol = match parameter.kind {
        ParameterKind::Inertial { entry, .. } => INERTIAL_SYMBOLS[entry].to_owned(),
        ParameterKind::Friction { .. } => format!("Friction({:?})", parameter.symbol()),
        ParameterKind::Offset { .. } => "Offset".to_owned(),
        ParameterKind::Rotor { .. } => "Rotor".to_owned(),
        ParameterKind::JointSpring { .. } => "Stiffness".to_owned(),
        ParameterKind::EffortTerm { .. } => format!("Term({:?})", parameter.symbol()),
        ParameterKind::PointSpring { part, .. } => match part {
            SpringPart::Stiffness => "SpringStiffness".to_owned(),
            SpringPart::Preload => "SpringPreload".to_owned(),
            SpringPart::Pull => "SpringPull".to_owned(),
        },
    };
    format!("Parameter::new(Symbol::{symbol}, {:?})", parameter.owner)
}

/// Emits the constants `JOINTS`, `CONES` and `NOMINAL`.
pub(super) fn constants(robot: &Robot, out: &mut String) {
    let _ = writeln!(
        out,
        "/// What is stated about the joint of each coordinate: units rad or m, N m or N."
    );
    let _ = writeln!(out, "pub const JOINTS: [Joint; {}] = [", robot.joints.len());
    for joint in &robot.joints {
        let _ = writeln!(out, "    {},", self::joint(joint));
    }
    let _ = writeln!(out, "];");
    let _ = writeln!(
        out,
        "/// The cones that limit joints and cuts, in the order of `cones`."
    );
    let _ = writeln!(
        out,
        "pub const CONES: [SwingLimit<'static>; {}] = [",
        robot.cones.len()
    );
    for cone in &robot.cones {
        let greatest = literal(cone.greatest);
        let _ = writeln!(
            out,
            "    SwingLimit {{ name: {:?}, greatest: {greatest} }},",
            cone.name
        );
    }
    let _ = writeln!(out, "];");
    let _ = writeln!(
        out,
        "/// Nominal values of the parameters, in the order of `PARAMETERS`, about the origins of"
    );
    let _ = writeln!(out, "/// the bodies' frames.");
    let _ = writeln!(
        out,
        "pub const NOMINAL: [Option<f64>; {}] = [",
        robot.nominal.len()
    );
    wrapped(out, robot.nominal.iter().copied().map(optional));
    let _ = writeln!(out, "];");
}

fn optional(value: Option<f64>) -> String {
    value.map_or_else(|| "None".to_owned(), |v| format!("Some({})", literal(v)))
}

/// A joint as Rust text, with the fields that the spec states.
fn joint(joint: &JointInfo) -> String {
    let bare = format!("Joint::{}", joint.motion_name().to_uppercase());
    let mut fields = Vec::new();
    if joint.friction_name() != "None" {
        fields.push(format!("friction: Friction::{}", joint.friction_name()));
    }
    let limits: Vec<String> = ["position", "velocity", "acceleration", "jerk", "effort"]
        .iter()
        .zip(&joint.limits)
        .filter_map(|(name, limit)| {
            let [lo, hi] = (*limit)?;
            Some(format!("{name}: Some([{}, {}])", literal(lo), literal(hi)))
        })
        .collect();
    match limits.len() {
        0 => {}
        5 => fields.push(format!("limits: Limits {{ {} }}", limits.join(", "))),
        _ => fields.push(format!(
            "limits: Limits {{ {}, ..Limits::NONE }}",
            limits.join(", ")
        )),
    }
    if joint.nominal.iter().any(Option::is_some) {
        let values: Vec<String> = joint.nominal.iter().copied().map(optional).collect();
        fields.push(format!("nominal: [{}]", values.join(", ")));
    }
    let of_joint = match joint.motion {
        MotionKind::Rotation => [1.0, 0.0],
        MotionKind::Translation => [0.0, 1.0],
    };
    let [turn, slide] = joint.travel.map(literal);
    if [&turn, &slide] != of_joint.map(literal).each_ref() {
        fields.push(format!("travel: [{turn}, {slide}]"));
    }
    if fields.is_empty() {
        bare
    } else {
        format!("Joint {{ {}, ..{bare} }}", fields.join(", "))
    }
}
