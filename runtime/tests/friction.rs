//! Friction laws follow their equations, contain linear friction, and have the slopes they state.

use regen_runtime::friction::{COEFFICIENTS, SHAPES, VALUES};
use regen_runtime::{Friction, JointFriction};

const VELOCITIES: [f64; 7] = [-1.3, -0.2, -0.01, 0.0, 0.03, 0.5, 2.0];
const SHAPE: [f64; SHAPES] = [0.3, 1.4];

fn sign(v: f64) -> f64 {
    if v == 0.0 { 0.0 } else { v.signum() }
}

fn nonlinear() -> impl Iterator<Item = Friction> {
    Friction::ALL.into_iter().filter(|law| !law.is_linear())
}

#[test]
fn every_nonlinear_law_contains_linear_friction() {
    for law in nonlinear() {
        let (coefficients, shape) = law.of_linear([0.7, 2.5], SHAPE);
        for v in VELOCITIES {
            let columns = law.columns(v, sign(v), shape);
            let effort: f64 = columns.iter().zip(&coefficients).map(|(c, x)| c * x).sum();
            assert!(
                (effort - (0.7 * sign(v) + 2.5 * v)).abs() < 1e-14,
                "{law:?} {v}"
            );
        }
    }
}

#[test]
fn slopes_are_the_derivatives_by_logarithms() {
    for law in Friction::ALL {
        for v in VELOCITIES {
            let slopes = law.slopes(v, sign(v), SHAPE);
            for (s, slope) in slopes.iter().enumerate() {
                let moved = |by: f64| {
                    let mut shape = SHAPE;
                    shape[s] *= libm::exp(by);
                    law.columns(v, sign(v), shape)
                };
                let (more, less) = (moved(1e-5), moved(-1e-5));
                for c in 0..COEFFICIENTS {
                    let difference = (more[c] - less[c]) / 2e-5;
                    assert!((difference - slope[c]).abs() < 1e-9, "{law:?} {v} {s} {c}");
                }
            }
        }
    }
}

#[test]
fn values_are_split_and_joined_without_loss() {
    for law in Friction::ALL {
        let count = law.symbols().len();
        let mut values = [0.0; VALUES];
        for (k, value) in values.iter_mut().enumerate().take(count) {
            *value = 0.75 + 0.5 * k as f64;
        }
        let (coefficients, shape) = law.split(&values);
        for (joined, value) in law.join(&coefficients, shape).into_iter().zip(values) {
            assert!((joined - value).abs() < 1e-15, "{law:?}");
        }
        assert_eq!(law.coefficients().len() + law.shape_symbols().len(), count);
    }
}

/// At v = vs the excess over Coulomb friction is 1/e of its value at rest.
#[test]
fn lugre_friction_falls_from_static_to_coulomb() {
    let law = JointFriction {
        law: Friction::Lugre,
        values: [2.0, 5.0, 0.1, 4.0, 0.0],
    };
    assert!((law.effort(1e-9) - 5.0).abs() < 1e-8);
    assert!((law.effort(0.1) - (2.0 + 3.0 * 0.367_879_441_171_442_33 + 0.4)).abs() < 1e-14);
    assert!((law.effort(-1.0) + 6.0).abs() < 1e-14);
    // Stribeck's law is the same at delta = 2
    let stribeck = JointFriction {
        law: Friction::Stribeck,
        values: [2.0, 5.0, 0.1, 2.0, 4.0],
    };
    for v in VELOCITIES {
        assert!((law.effort(v) - stribeck.effort(v)).abs() < 1e-14, "{v}");
    }
}

#[test]
fn efforts_follow_the_equations() {
    for v in VELOCITIES {
        let s = sign(v);
        let plus = v > 0.0;
        let bump = (-(v / 0.4_f64).abs().powf(1.4)).exp();
        let gauss = (-(v / 0.4_f64).powi(2)).exp();
        let expected: [(Friction, &[f64], f64); 10] = [
            (Friction::None, &[], 0.0),
            (Friction::Viscous, &[0.7], 0.7 * v),
            (Friction::Coulomb, &[2.0], 2.0 * s),
            (Friction::Linear, &[0.7, 2.0], 0.7 * v + 2.0 * s),
            (
                Friction::CoulombAsymmetric,
                &[0.7, 2.0, 3.5],
                0.7 * v + if plus { 2.0 } else { 3.5 } * s,
            ),
            (
                Friction::Asymmetric,
                &[0.7, 2.0, 0.9, 3.5],
                if plus {
                    0.7 * v + 2.0 * s
                } else {
                    0.9 * v + 3.5 * s
                },
            ),
            (
                Friction::Stribeck,
                &[2.0, 3.5, 0.4, 1.4, 0.7],
                s * (2.0 + 1.5 * bump) + 0.7 * v,
            ),
            (
                Friction::Atan,
                &[2.0, 3.5, 0.7, 0.3],
                s * 2.0 + 3.5 * v + 0.7 * (0.3 * v).atan(),
            ),
            (
                Friction::Power,
                &[2.0, 3.5, 0.7, 0.3],
                s * (if plus { 2.0 } else { 3.5 } + 0.7 * v.abs().powf(0.3)),
            ),
            (
                Friction::Lugre,
                &[2.0, 3.5, 0.4, 0.7],
                s * (2.0 + 1.5 * gauss) + 0.7 * v,
            ),
        ];
        for (law, values, effort) in expected {
            let mut all = [0.0; VALUES];
            all[..values.len()].copy_from_slice(values);
            let joint = JointFriction { law, values: all };
            assert!((joint.effort(v) - effort).abs() < 1e-14, "{law:?} {v}");
            assert!(
                (joint.scaled(2.0).effort(v) - 2.0 * effort).abs() < 1e-13,
                "{law:?} {v}"
            );
            // where the velocity is many widths, tanh equals the sign
            assert!(
                (joint.smooth_effort(v, 1e-6) - effort).abs() < 1e-13,
                "{law:?} {v}"
            );
        }
    }
}

/// Far above a steep transition the power overflows, and its exponential is 0.
#[test]
fn slopes_of_steep_shapes_are_finite() {
    for law in nonlinear() {
        for v in VELOCITIES {
            let slopes = law.slopes(v, sign(v), [1e-4, 300.0]);
            assert!(
                slopes.iter().flatten().all(|x| x.is_finite()),
                "{law:?} {v} {slopes:?}"
            );
        }
    }
}
