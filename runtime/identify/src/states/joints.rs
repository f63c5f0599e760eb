//! What a model says of the friction of its joints.

use regen_runtime::{BaseModel, Condition, Friction, Joint, Model, SizeError};

/// Whether a joint has friction that depends on the direction of its motion.
pub(crate) fn depends_on_direction(joint: &Joint) -> bool {
    !matches!(joint.friction, Friction::None | Friction::Viscous)
}

/// A joint with nonlinear friction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrictionJoint {
    /// The coordinate's name.
    pub name: String,
    /// Its friction law, one that is nonlinear in some of its values.
    pub friction: Friction,
}

/// The joints of a model whose friction law is nonlinear.
pub fn nonlinear_joints<M: BaseModel<f64> + ?Sized>(model: &M) -> Vec<FrictionJoint> {
    let info = model.info();
    let pairs = info.coordinates.iter().zip(info.joints);
    pairs
        .filter(|(_, joint)| !joint.friction.is_linear())
        .map(|(name, joint)| FrictionJoint {
            name: (*name).to_owned(),
            friction: joint.friction,
        })
        .collect()
}

/// How friction at joints acts on the rows of the reduced model: column k is the derivative of the
/// velocity of joint k by the independent velocities, which is a unit vector for an independent
/// joint and a row of -X for a dependent one (Eq. 10).
///
/// - `q`: n coordinates, rad or m; `joints`: indices of coordinates;
/// - returns: dof x joints, column by column, and the worst condition of the linear solves.
///
/// # Errors
/// When a length does not fit.
pub fn directions<M: Model<f64> + ?Sized>(
    model: &M,
    q: &[f64],
    joints: &[usize],
) -> Result<(Vec<f64>, Condition<f64>), SizeError> {
    let info = model.info();
    let (n, dof) = (info.coordinates.len(), info.dof());
    let mut out = vec![0.0; dof * joints.len()];
    let mut unit = vec![0.0; dof];
    let mut qd = vec![0.0; n];
    let mut worst: Option<Condition<f64>> = None;
    for i in 0..dof {
        unit.fill(0.0);
        unit[i] = 1.0;
        let condition = model.velocities(q, &unit, &mut qd)?;
        if worst.is_none_or(|w| condition.pivot < w.pivot) {
            worst = Some(condition);
        }
        for (k, joint) in joints.iter().enumerate() {
            out[k * dof + i] = qd.get(*joint).copied().ok_or(SizeError {
                argument: "joints",
                expected: n,
                got: joint + 1,
            })?;
        }
    }
    match worst {
        Some(condition) => Ok((out, condition)),
        None => Ok((out, model.velocities(q, &unit, &mut qd)?)),
    }
}
