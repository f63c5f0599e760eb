//! The friction laws of a model's joints, with coefficients from nominal values, parameters or fits.

use regen_identify::friction::JointFit;
use regen_runtime::friction::VALUES;
use regen_runtime::{Friction, Info, Joint, JointFriction};

use super::Noise;

/// The error that the model states no nominal value for one coefficient of a friction law.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MissingNominal {
    /// The coordinate's name.
    pub coordinate: String,
    /// The symbol of the coefficient, as in
    /// [`Friction::symbols`](regen_runtime::Friction::symbols).
    pub symbol: &'static str,
}

impl std::fmt::Display for MissingNominal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let MissingNominal { coordinate, symbol } = self;
        write!(f, "joint {coordinate} has no nominal value of {symbol}")
    }
}

impl std::error::Error for MissingNominal {}

/// The friction law of each coordinate with the model's nominal values, in the order of `q`.
///
/// # Errors
/// The first coordinate whose law has a symbol without a nominal value.
pub fn nominal_friction(info: &Info<'_>) -> Result<Vec<JointFriction>, MissingNominal> {
    let joint = |(joint, name): (&regen_runtime::Joint, &&str)| {
        let mut values = [0.0; VALUES];
        let stated = joint.friction.symbols().iter().zip(joint.nominal);
        for (value, (symbol, nominal)) in values.iter_mut().zip(stated) {
            *value = nominal.ok_or_else(|| MissingNominal {
                coordinate: (*name).to_owned(),
                symbol,
            })?;
        }
        Ok(JointFriction {
            law: joint.friction,
            values,
        })
    };
    info.joints
        .iter()
        .zip(info.coordinates)
        .map(joint)
        .collect()
}

/// The linear friction laws of the coordinates, in the order of `q`, with their coefficients from
/// the parameters `phi`, 0 where the model has no such parameter; nonlinear friction is replaced by
/// none.
///
/// ```
/// use regen_experiment::simulate::linear_friction;
/// use regen_runtime::{Friction, Info, Joint, Parameter, Symbol};
///
/// let joint = Joint { friction: Friction::Viscous, ..Joint::ROTATION };
/// let info = Info {
///     coordinates: &["q1"],
///     parameters: &[
///         Parameter::new(Symbol::Mass, "1"),
///         Parameter::new(Symbol::Friction("Fv"), "q1"),
///     ],
///     joints: &[joint],
///     ..Info::EMPTY
/// };
/// assert_eq!(linear_friction(&info, &[3.0, 0.5])[0].values[0], 0.5);
/// ```
pub fn linear_friction(info: &Info<'_>, phi: &[f64]) -> Vec<JointFriction> {
    let stated = info.joints.iter().zip(info.coordinates);
    let joints: Vec<Joint> = stated
        .map(|(joint, name)| {
            let mut joint = *joint;
            if !joint.friction.is_linear() {
                joint.friction = Friction::None;
            }
            let slots = joint.nominal.iter_mut().zip(joint.friction.symbols());
            for (slot, symbol) in slots {
                let index = info.parameter_of(&format!("{symbol}({name})"));
                *slot = index.and_then(|k| phi.get(k)).copied().or(Some(0.0));
            }
            joint
        })
        .collect();
    nominal_friction(&Info {
        joints: &joints,
        ..*info
    })
    .unwrap_or_default()
}

/// The friction law of each coordinate, in the order of `q`: linear laws with coefficients from the
/// parameters, others with fitted values or else with the model's nominal ones.
///
/// - `phi`: p parameters, SI;
/// - `fitted`: the fitted friction, joints in any order.
///
/// # Errors
/// The first coordinate whose law has a symbol without any value.
///
/// ```
/// use regen_experiment::simulate::fitted_friction;
/// use regen_runtime::{Friction, Info, Joint};
///
/// let joint = Joint { friction: Friction::Viscous, ..Joint::ROTATION };
/// let info = Info { coordinates: &["q1"], joints: &[joint], ..Info::EMPTY };
/// let error = fitted_friction(&info, &[], &[]).unwrap_err();
/// assert_eq!((error.coordinate.as_str(), error.symbol), ("q1", "Fv"));
/// ```
pub fn fitted_friction(
    info: &Info<'_>,
    phi: &[f64],
    fitted: &[JointFit],
) -> Result<Vec<JointFriction>, MissingNominal> {
    let stated = info.joints.iter().zip(info.coordinates);
    let joints: Vec<Joint> = stated
        .map(|(joint, name)| {
            let mut joint = *joint;
            if joint.friction.is_linear() {
                let slots = joint.nominal.iter_mut().zip(joint.friction.symbols());
                for (slot, symbol) in slots {
                    let index = info.parameter_of(&format!("{symbol}({name})"));
                    *slot = index.and_then(|k| phi.get(k)).copied().or(*slot);
                }
            }
            let own = |f: &&JointFit| f.name == *name && f.friction == joint.friction;
            if let Some(fit) = fitted.iter().find(own) {
                for (slot, value) in joint.nominal.iter_mut().zip(&fit.values) {
                    *slot = Some(*value);
                }
            }
            joint
        })
        .collect();
    nominal_friction(&Info {
        joints: &joints,
        ..*info
    })
}

/// The velocity over which the smoothed friction of a joint changes its direction, rad/s or m/s; that of
/// a drive is the velocity at which its joints reach theirs.
///
/// - `joint`: `None` stands for a joint that is no drive;
/// - `of_joints`: the velocity for joints.
///
/// ```
/// use regen_experiment::simulate::friction_width;
/// use regen_runtime::Joint;
///
/// // a motor with a gear of ratio 45
/// let motor = Joint { travel: [45.0, 0.0], ..Joint::ROTATION };
/// assert_eq!(friction_width(Some(&motor), 1e-3), 45e-3);
/// assert_eq!(friction_width(Some(&Joint::ROTATION), 1e-3), 1e-3);
/// ```
pub fn friction_width(joint: Option<&Joint>, of_joints: f64) -> f64 {
    let drive = joint.filter(|joint| joint.is_drive());
    drive.map_or(of_joints, |drive| drive.reach(of_joints, of_joints))
}

/// Multiplies each nonlinear friction law by a random factor between 1 - `part` and 1 + `part`.
/// Coefficients of linear laws are parameters, which
/// [`perturb_parameters`](super::perturb_parameters) changes.
pub fn perturb_friction(laws: &mut [JointFriction], part: f64, chance: &mut Noise) {
    for law in laws.iter_mut().filter(|law| !law.law.is_linear()) {
        *law = law.scaled(1.0 + part * (2.0 * chance.uniform() - 1.0));
    }
}

/// Adds the Stribeck effect to laws that do not have it: static friction exceeds Coulomb friction by
/// `part` of it, and the excess decays as `exp(-(v/speed)^2)`. Laws `coulomb` and `linear` become
/// `lugre` with the same Coulomb and viscous friction; all others stay as they are. Returns the
/// number of laws that have changed.
///
/// - `speed`: rad/s or m/s, above 0.
///
/// ```
/// use regen_experiment::simulate::add_stribeck;
/// use regen_runtime::{Friction, JointFriction};
///
/// let linear = JointFriction { law: Friction::Linear, values: [0.5, 2.0, 0.0, 0.0, 0.0] };
/// let mut laws = [linear, JointFriction::NONE];
/// assert_eq!(add_stribeck(&mut laws, 0.3, 0.1), 1);
/// assert!((laws[0].effort(1e-9) - 2.6).abs() < 1e-6, "static friction");
/// assert!((laws[0].effort(1.0) - linear.effort(1.0)).abs() < 1e-12, "far above the speed");
/// ```
pub fn add_stribeck(laws: &mut [JointFriction], part: f64, speed: f64) -> usize {
    let mut changed = 0;
    for joint in laws {
        let (fc, fv) = match joint.law {
            Friction::Coulomb => (joint.values[0], 0.0),
            // the symbols of linear friction are in the order Fv, Fc
            Friction::Linear => (joint.values[1], joint.values[0]),
            _ => continue,
        };
        let (coefficients, shape) = ([fc, part * fc, fv], [speed, 0.0]);
        *joint = JointFriction {
            law: Friction::Lugre,
            values: Friction::Lugre.join(&coefficients, shape),
        };
        changed += 1;
    }
    changed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nonlinear_friction_changes_by_at_most_the_stated_part_and_linear_friction_not_at_all() {
        let coulomb = JointFriction {
            law: Friction::Coulomb,
            values: [2.0, 0.0, 0.0, 0.0, 0.0],
        };
        let mut stribeck = [coulomb];
        add_stribeck(&mut stribeck, 0.3, 0.1);
        let before = [coulomb, stribeck[0]];
        let mut chance = Noise::new(5);
        let mut range = [f64::INFINITY, 0.0_f64];
        for _ in 0..200 {
            let mut laws = before;
            perturb_friction(&mut laws, 0.2, &mut chance);
            assert_eq!(laws[0], coulomb);
            for v in [1e-3, 0.1, 3.0] {
                let by = laws[1].effort(v) / before[1].effort(v);
                range = [range[0].min(by), range[1].max(by)];
            }
        }
        // two hundred draws reach near both ends
        assert!(0.8 - 1e-12 < range[0] && range[0] < 0.82, "{range:?}");
        assert!(1.18 < range[1] && range[1] < 1.2 + 1e-12, "{range:?}");
    }
}
