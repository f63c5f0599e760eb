//! Tests of one model with every scalar type, of the relations between its methods, and of wrong
//! lengths.

#![cfg(feature = "closure")]
#![allow(clippy::unwrap_used, unreachable_pub)]
#![allow(clippy::doc_markdown, reason = "formulas")]

use proptest::prelude::*;
use regen_runtime::{Condition, LoopClosure, Model, Scalar, SizeError, State};

use crate::slider_crank::SliderCrank;

const MODEL: SliderCrank = SliderCrank {
    crank: 1.0,
    rod: 1.6,
    offset: 0.3,
    home: [0.0, 0.19, 2.57],
};
const PHI: [f64; 3] = [0.7, 0.3, 2.5];

fn state(angle: f64, qd: f64, qdd: f64) -> State {
    let state = LoopClosure::new(&MODEL)
        .unwrap()
        .solve_state(&[angle], &[qd], &[qdd])
        .unwrap();
    assert!(state.outcome.is_closed());
    state
}

/// The only entry that a model's method writes.
fn one<T: Scalar>(proto: T, fill: impl FnOnce(&mut [T]) -> Result<Condition<T>, SizeError>) -> T {
    let mut out = [proto];
    let condition = fill(&mut out).unwrap();
    assert!(condition.is_regular());
    out[0]
}

/// Concatenates the regressor, the inverse dynamics and the velocities at a state.
fn evaluate<T: Scalar>(proto: T, state: &State) -> Vec<T> {
    let splat = |values: &[f64]| values.iter().map(|x| proto.splat(*x)).collect::<Vec<_>>();
    let (q, qd, qdd, phi) = (
        splat(&state.q),
        splat(&state.qd),
        splat(&state.qdd),
        splat(&PHI),
    );
    let mut all = vec![proto; 7];
    let _ = MODEL.regressor(&q, &qd, &qdd, &mut all[..3]).unwrap();
    let _ = MODEL
        .inverse_dynamics(&q, &qd, &qdd, &phi, &mut all[3..4])
        .unwrap();
    let _ = MODEL.velocities(&q, &qd[..1], &mut all[4..]).unwrap();
    all
}

proptest! {
    #[test]
    fn the_parts_of_the_dynamics_add_up(angle in -3.0..3.0_f64, qd in -2.0..2.0_f64, qdd in -9.0..9.0_f64) {
        let State { q, qd: rates, qdd: all, .. } = state(angle, qd, qdd);
        let mut w = [0.0; 3];
        let _ = MODEL.regressor(&q, &rates, &all, &mut w).unwrap();
        let tau = one(0.0, |out| MODEL.inverse_dynamics(&q, &rates, &all, &PHI, out));
        let mass = one(0.0, |out| MODEL.mass_matrix(&q, &PHI, out));
        let bias = one(0.0, |out| MODEL.bias_forces(&q, &rates, &PHI, out));
        let product: f64 = w.iter().zip(&PHI).map(|(w, phi)| w * phi).sum();
        let size = 1.0 + tau.abs() + (mass * qdd).abs();
        prop_assert!((tau - product).abs() < 1e-13 * size);
        prop_assert!((tau - mass * qdd - bias).abs() < 1e-12 * size);
        let still = one(0.0, |out| MODEL.bias_forces(&q, &[0.0; 3], &PHI, out));
        prop_assert!((one(0.0, |out| MODEL.gravity(&q, &PHI, out)) - still).abs() < 1e-13 * size);

        // with the motion itself as reference, Slotine and Li's regressor equals the regressor
        let mut y = [0.0; 3];
        let _ = MODEL.adaptive_regressor(&q, &rates, &[qd], &[qdd], &mut y).unwrap();
        for (y, w) in y.iter().zip(&w) {
            prop_assert!((y - w).abs() < 1e-11 * size);
        }
    }

    #[test]
    fn efforts_do_the_same_work_on_either_side(angle in -3.0..3.0_f64, crank in -9.0..9.0_f64, slider in -9.0..9.0_f64) {
        let State { q, qd, .. } = state(angle, 1.0, 0.0);
        let effort = one(0.0, |out| MODEL.generalized_forces(&q, &[crank, slider], out));
        prop_assert!((effort * qd[0] - (crank * qd[0] + slider * qd[2])).abs() < 1e-12);
    }

    #[test]
    fn single_precision_agrees(angle in -3.0..3.0_f64, qd in -2.0..2.0_f64, qdd in -9.0..9.0_f64) {
        let state = state(angle, qd, qdd);
        for (narrow, wide) in evaluate(0.0_f32, &state).iter().zip(evaluate(0.0_f64, &state)) {
            prop_assert!((f64::from(*narrow) - wide).abs() < 1e-4 * (1.0 + wide.abs()));
        }
    }
}

#[cfg(feature = "dual")]
proptest! {
    #[test]
    fn derivatives_of_the_closure_are_its_jacobian_and_bias(angle in -3.0..3.0_f64, qd in -2.0..2.0_f64) {
        use num_dual::Dual2_64;
        use regen_runtime::Dual;

        // Along q + t qd: f' = A qd = 0, f'' = -b.
        let State { q, qd, .. } = state(angle, qd, 0.0);
        let path: Vec<_> = q.iter().zip(&qd).map(|(q, qd)| Dual(Dual2_64::new(*q, *qd, 0.0))).collect();
        let (mut f, mut b) = ([path[0]; 2], [0.0; 2]);
        MODEL.constraints(&path, &mut f).unwrap();
        MODEL.bias(&q, &qd, &mut b).unwrap();
        for (f, b) in f.iter().zip(b) {
            prop_assert!(f.0.re.abs() < 1e-13 && f.0.v1.abs() < 1e-13);
            prop_assert!((f.0.v2 + b).abs() < 1e-13 * (1.0 + b.abs()));
        }
        let plain = evaluate(0.0, &state(angle, 1.0, 2.0));
        for (dual, plain) in evaluate(path[0], &state(angle, 1.0, 2.0)).iter().zip(plain) {
            prop_assert!((dual.0.re - plain).abs() < 1e-12 * (1.0 + plain.abs()));
        }
    }
}

mod lanes {
    use super::*;
    use pulp::{Arch, Simd, WithSimd, bytemuck};
    use regen_batch::Lane;

    struct Agree<'a>(&'a [f64]);
    impl WithSimd for Agree<'_> {
        type Output = ();
        fn with_simd<S: Simd>(self, simd: S) {
            let states: Vec<State> = self.0.iter().map(|angle| state(*angle, 1.0, 2.0)).collect();
            let pack = |get: fn(&State, usize) -> f64, k: usize| {
                let values: Vec<f64> = states.iter().map(|state| get(state, k)).collect();
                Lane {
                    simd,
                    v: simd.partial_load_f64s(&values[..S::F64_LANES]),
                }
            };
            let q: Vec<_> = (0..3).map(|k| pack(|state, k| state.q[k], k)).collect();
            let qd: Vec<_> = (0..3).map(|k| pack(|state, k| state.qd[k], k)).collect();
            let qdd: Vec<_> = (0..3).map(|k| pack(|state, k| state.qdd[k], k)).collect();
            let mut w = [q[0]; 3];
            assert!(MODEL.regressor(&q, &qd, &qdd, &mut w).unwrap().is_regular());
            for (i, state) in states.iter().take(S::F64_LANES).enumerate() {
                let mut alone = [0.0; 3];
                let _ = MODEL
                    .regressor(&state.q, &state.qd, &state.qdd, &mut alone)
                    .unwrap();
                for (together, alone) in w.iter().zip(alone) {
                    let together = bytemuck::cast_slice::<S::f64s, f64>(&[together.v])[i];
                    assert!((together - alone).abs() < 1e-12 * (1.0 + alone.abs()));
                }
            }
        }
    }

    proptest! {
        #[test]
        fn every_lane_is_a_state_of_its_own(angles in prop::collection::vec(-3.0..3.0_f64, 8)) {
            Arch::new().dispatch(Agree(&angles));
        }
    }
}
