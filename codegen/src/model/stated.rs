//! Values that the spec states in addition to the mechanism: nominal values of the parameters.

use crate::spec::{BodyInertia, Joint, Spec};
use crate::sym::Number;

use super::{Model, Parameter, ParameterKind};

/// For each coordinate, the joint that it belongs to.
pub fn joints_of_coordinates(spec: &Spec) -> Vec<&Joint> {
    spec.limbs
        .iter()
        .flat_map(|limb| &limb.joints)
        .flat_map(|joint| std::iter::repeat_n(joint, joint.kind.value.coordinates()))
        .collect()
}

/// The nominal value of each parameter, in their order; `None` if the spec gives none.
pub fn nominal(spec: &Spec, model: &Model) -> Vec<Option<Number>> {
    let joints = joints_of_coordinates(spec);
    let at_joint = |coordinate: usize, symbol: &str| {
        let value = joints.get(coordinate)?.nominal_value(symbol)?;
        Some(value.value.clone())
    };
    let value = |parameter: &Parameter| match parameter.kind {
        ParameterKind::Inertial { body, entry } => {
            let label = &model.bodies.get(body)?.label;
            let given = spec.bodies.iter().find(|(l, _)| l.value == *label);
            given.map(|(_, inertia)| about_origin(inertia, entry))
        }
        ParameterKind::Friction { coordinate, column } => at_joint(coordinate, column.symbol()),
        ParameterKind::Offset { coordinate }
        | ParameterKind::Rotor { coordinate }
        | ParameterKind::JointSpring { coordinate, .. }
        | ParameterKind::EffortTerm { coordinate, .. } => at_joint(coordinate, parameter.symbol()),
        ParameterKind::PointSpring { spring, .. } => {
            let mut nominal = spec.springs.get(spring)?.nominal.iter();
            let stated = nominal.find(|(symbol, _)| symbol.value == parameter.symbol());
            stated.map(|(_, quantity)| quantity.value.clone())
        }
    };
    model.parameters.iter().map(value).collect()
}

/// One of a body's ten parameters about the frame's origin: the tensor is moved there from the
/// centre of mass (Huygens and Steiner).
fn about_origin(body: &BodyInertia, entry: usize) -> Number {
    let mass = &body.mass.value;
    let com = [0, 1, 2].map(|i: usize| &body.com[i].value);
    // the axes of Ixx Ixy Ixz Iyy Iyz Izz
    const AXES: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
    match (AXES.get(entry), entry) {
        (Some(&(i, j)), _) => {
            let mut arm = com[i].mul(com[j]).neg();
            if i == j {
                for c in com {
                    arm = arm.add(&c.mul(c));
                }
            }
            body.inertia[entry].value.add(&mass.mul(&arm))
        }
        (None, 6..=8) => mass.mul(com[entry - 6]),
        _ => mass.clone(),
    }
}
