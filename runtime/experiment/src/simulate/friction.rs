//! The friction laws of a model's joints, from their nominal values.

use regen_runtime::friction::VALUES;
use regen_runtime::{Info, JointFriction};

/// The error of a friction law of which the model states no nominal value for one coefficient.
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
