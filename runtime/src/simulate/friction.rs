//! Friction laws at joints, linear or not (Eq. 14, 16, 17, 32).

use std::vec::Vec;

use crate::law::Law;
use crate::{Friction, Info};

/// A friction law with its coefficients, in SI units: N or N m over m/s or rad/s.
///
/// sgn(v) is replaced by tanh(v/width), so that the motion stays smooth where a joint
/// reverses; `width` is stated in the settings of the run.
///
/// ```
/// use regen_runtime::simulate::FrictionLaw;
///
/// let stribeck = FrictionLaw::Stribeck { fc: 2.0, fs: 3.0, vs: 0.1, delta: 2.0, fv: 5.0 };
/// // Far above the Stribeck velocity only Coulomb and viscous friction are left.
/// assert!((stribeck.effort(1.0, 1e-6) - 7.0).abs() < 1e-12);
/// // It opposes the motion, whatever its direction.
/// assert_eq!(stribeck.effort(-1.0, 1e-6), -stribeck.effort(1.0, 1e-6));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FrictionLaw {
    /// None.
    None,
    /// Viscous and Coulomb, with coefficients for each direction (Eq. 14).
    Linear {
        /// Viscous, forwards.
        fv_plus: f64,
        /// Coulomb, forwards.
        fc_plus: f64,
        /// Viscous, backwards.
        fv_minus: f64,
        /// Coulomb, backwards.
        fc_minus: f64,
    },
    /// `sgn(v) (Fc + (Fs - Fc) exp(-|v/vs|^delta)) + Fv v` (Eq. 32).
    Stribeck {
        /// Coulomb.
        fc: f64,
        /// Static.
        fs: f64,
        /// Stribeck velocity.
        vs: f64,
        /// Its exponent.
        delta: f64,
        /// Viscous.
        fv: f64,
    },
    /// `sgn(v) Fc + Fv1 v + Fv2 atan(Fv3 v)` (Eq. 16).
    Atan {
        /// Coulomb.
        fc: f64,
        /// Viscous.
        fv1: f64,
        /// The saturating part's size.
        fv2: f64,
        /// How fast it saturates.
        fv3: f64,
    },
    /// `Fc+ + Fv |v|^delta` forwards, `-Fc- - Fv |v|^delta` backwards (Eq. 17).
    Power {
        /// Coulomb, forwards.
        fc_plus: f64,
        /// Coulomb, backwards.
        fc_minus: f64,
        /// Coefficient.
        fv: f64,
        /// Exponent.
        delta: f64,
    },
}

impl FrictionLaw {
    /// The effort that friction takes from the joint at velocity `v`; sgn(v) is taken as
    /// tanh(v/width).
    pub fn effort(self, v: f64, width: f64) -> f64 {
        let sign = libm::tanh(v / width);
        let sum = |law: Law, shape: [f64; 2], coefficients: [f64; 3]| -> f64 {
            let columns = law.values(v, sign, shape);
            columns.iter().zip(coefficients).map(|(c, x)| c * x).sum()
        };
        match self {
            FrictionLaw::None => 0.0,
            FrictionLaw::Linear {
                fv_plus,
                fc_plus,
                fv_minus,
                fc_minus,
            } => {
                let (fv, fc) = if v > 0.0 {
                    (fv_plus, fc_plus)
                } else {
                    (fv_minus, fc_minus)
                };
                fv * v + fc * sign
            }
            FrictionLaw::Stribeck {
                fc,
                fs,
                vs,
                delta,
                fv,
            } => sum(Law::Stribeck, [vs, delta], [fc, fs - fc, fv]),
            FrictionLaw::Atan { fc, fv1, fv2, fv3 } => sum(Law::Atan, [fv3, 0.0], [fc, fv1, fv2]),
            FrictionLaw::Power {
                fc_plus,
                fc_minus,
                fv,
                delta,
            } => sum(Law::Power, [delta, 0.0], [fc_plus, fc_minus, fv]),
        }
    }

    /// The law with every force scaled; velocities and exponents stay.
    #[must_use]
    pub fn scaled(self, by: f64) -> Self {
        match self {
            FrictionLaw::None => FrictionLaw::None,
            FrictionLaw::Linear {
                fv_plus,
                fc_plus,
                fv_minus,
                fc_minus,
            } => FrictionLaw::Linear {
                fv_plus: fv_plus * by,
                fc_plus: fc_plus * by,
                fv_minus: fv_minus * by,
                fc_minus: fc_minus * by,
            },
            FrictionLaw::Stribeck {
                fc,
                fs,
                vs,
                delta,
                fv,
            } => FrictionLaw::Stribeck {
                fc: fc * by,
                fs: fs * by,
                vs,
                delta,
                fv: fv * by,
            },
            FrictionLaw::Atan { fc, fv1, fv2, fv3 } => FrictionLaw::Atan {
                fc: fc * by,
                fv1: fv1 * by,
                fv2: fv2 * by,
                fv3,
            },
            FrictionLaw::Power {
                fc_plus,
                fc_minus,
                fv,
                delta,
            } => FrictionLaw::Power {
                fc_plus: fc_plus * by,
                fc_minus: fc_minus * by,
                fv: fv * by,
                delta,
            },
        }
    }
}

/// The friction law of each coordinate from a model's nominal values, in the order of `q`; the
/// first coordinate that lacks a value is the error.
///
/// # Errors
/// The index of a coordinate and the symbol that has no nominal value.
pub fn friction_laws(info: &Info<'_>) -> Result<Vec<FrictionLaw>, (usize, &'static str)> {
    let mut laws = Vec::with_capacity(info.coordinates.len());
    for (index, joint) in info.joints.iter().enumerate() {
        let mut values = [0.0; 5];
        for ((value, nominal), symbol) in values
            .iter_mut()
            .zip(joint.nominal)
            .zip(joint.friction.symbols())
        {
            *value = nominal.ok_or((index, *symbol))?;
        }
        let [a, b, c, d, e] = values;
        let both = |fv: f64, fc: f64| FrictionLaw::Linear {
            fv_plus: fv,
            fc_plus: fc,
            fv_minus: fv,
            fc_minus: fc,
        };
        laws.push(match joint.friction {
            Friction::None => FrictionLaw::None,
            Friction::Viscous => both(a, 0.0),
            Friction::Coulomb => both(0.0, a),
            Friction::Linear => both(a, b),
            Friction::CoulombAsymmetric => FrictionLaw::Linear {
                fv_plus: a,
                fc_plus: b,
                fv_minus: a,
                fc_minus: c,
            },
            Friction::Asymmetric => FrictionLaw::Linear {
                fv_plus: a,
                fc_plus: b,
                fv_minus: c,
                fc_minus: d,
            },
            Friction::Stribeck => FrictionLaw::Stribeck {
                fc: a,
                fs: b,
                vs: c,
                delta: d,
                fv: e,
            },
            Friction::Atan => FrictionLaw::Atan {
                fc: a,
                fv1: b,
                fv2: c,
                fv3: d,
            },
            Friction::Power => FrictionLaw::Power {
                fc_plus: a,
                fc_minus: b,
                fv: c,
                delta: d,
            },
        });
    }
    Ok(laws)
}
