//! Nonlinear friction in logs of a slider-crank: at the crank it acts directly, at the slider
//! through the mechanism. Also the laws by themselves.

use regen_identify::feasibility::FeasibilityError;
use regen_identify::friction::{JointFit, collect, residuals};
use regen_identify::signals::Smoothing;
use regen_identify::states::{Filtering, Recorded, Source, StateSample};
use regen_identify::states::{FrictionJoint, directions};
use regen_runtime::{Friction, LoopClosure, State};

use crate::friction::force;
use crate::models::SliderCrank;

const GRAVITY: f64 = 9.81;
/// The inertia of the crank, kg m^2, its viscous friction, N m s/rad, and the mass of the slider,
/// kg.
const VALUES: [f64; 3] = [0.7, 0.4, 2.5];
const CRANK: (Friction, [f64; 5]) = (Friction::Stribeck, [0.8, 1.5, 0.2, 1.4, 0.0]);
const SLIDER: (Friction, [f64; 4]) = (Friction::Power, [3.0, 2.0, 1.1, 0.5]);

/// A log whose error type is that of an identification.
struct Log(Recorded);

impl Source for Log {
    type Error = FeasibilityError;

    fn filtering(&self) -> Filtering {
        self.0.filtering()
    }

    fn visit(
        &mut self,
        each: &mut dyn FnMut(
            &StateSample<'_>,
        ) -> Result<(), regen_identify::estimate::EstimateError>,
    ) -> Result<(), FeasibilityError> {
        Ok(self.0.visit(each)?)
    }
}

fn joints() -> Vec<JointFit> {
    let joint = |name: &str, friction, values: &[f64]| JointFit {
        name: name.to_owned(),
        friction,
        values: values.to_vec(),
    };
    vec![
        joint("crank", CRANK.0, &CRANK.1),
        joint("slider", SLIDER.0, &SLIDER.1),
    ]
}

/// States along a motion there and back.
fn states() -> Vec<State> {
    let model = SliderCrank::default();
    let mut closure = LoopClosure::new(&model).unwrap();
    (0..80)
        .map(|k| {
            let (s, c) = (0.1 * f64::from(k)).sin_cos();
            closure
                .track_state(&[0.8 + 0.6 * s], &[0.6 * c], &[-0.6 * s])
                .unwrap()
        })
        .collect()
}

/// The crank's effort by d'Alembert, with the friction of both joints.
fn effort(state: &State) -> f64 {
    let ratio = state.qd[2] / state.qd[0];
    let slide = VALUES[2] * (state.qdd[2] + GRAVITY) + force(SLIDER.0, state.qd[2], &SLIDER.1);
    VALUES[0] * state.qdd[0]
        + VALUES[1] * state.qd[0]
        + force(CRANK.0, state.qd[0], &CRANK.1)
        + ratio * slide
}

fn log(off: impl Fn(usize) -> f64) -> Log {
    let mut log = Recorded::new();
    for (k, state) in states().iter().enumerate() {
        let tau = effort(state) + off(k);
        log.push(0.1 * k as f64, &state.q, &state.qd, &state.qdd, &[tau]);
    }
    Log(log)
}

#[test]
fn residuals_are_the_efforts_that_neither_parameters_nor_laws_explain() {
    let model = SliderCrank::default();
    // every tenth effort has an error that grows with time
    let off = |k: usize| {
        if k.is_multiple_of(10) {
            0.01 * k as f64
        } else {
            0.0
        }
    };
    let found = residuals(&model, &mut log(off), &VALUES, &joints(), &[0.0], 2).unwrap();
    let found = &found.efforts()[0];
    assert_eq!(found.samples, 80);
    // efforts of size 50 and their rounding
    assert!((found.largest - 0.7).abs() < 1e-11, "{found:?}");
    let squares: f64 = (0..80).map(|k| off(k).powi(2)).sum();
    assert!((found.rms - (squares / 80.0).sqrt()).abs() < 1e-11);
    // without the laws, their friction is part of the residuals
    let bare = residuals(&model, &mut log(off), &VALUES, &[], &[0.0], 2).unwrap();
    let most = states().iter().zip(0..).fold(0.0, |m: f64, (state, k)| {
        let ratio = state.qd[2] / state.qd[0];
        let laws =
            force(CRANK.0, state.qd[0], &CRANK.1) + ratio * force(SLIDER.0, state.qd[2], &SLIDER.1);
        m.max((laws + off(k)).abs())
    });
    assert!((bare.efforts()[0].largest - most).abs() < 1e-11);
    assert!(residuals(&model, &mut log(off), &VALUES[..2], &joints(), &[0.0], 2).is_err());
}

#[test]
fn a_log_is_collected_without_its_singular_samples() {
    let model = SliderCrank::default();
    let joints: Vec<FrictionJoint> = joints()
        .into_iter()
        .map(|j| FrictionJoint {
            name: j.name,
            friction: j.friction,
        })
        .collect();
    let mut made = log(|_| 0.0);
    let (data, singular) = collect(&model, &mut made, &joints).unwrap();
    assert_eq!((data.len(), singular.singular), (80, 0));
    // the rod is perpendicular to the slider's axis: a singularity
    for _ in 0..3 {
        let across = [0.2, std::f64::consts::FRAC_PI_2 - 0.2, 1.0];
        made.0.push(9.0, &across, &[1.0; 3], &[0.0; 3], &[1.0]);
    }
    let (data, singular) = collect(&model, &mut made, &joints).unwrap();
    assert_eq!((data.len(), singular.singular), (80, 3));
    let other = FrictionJoint {
        name: "elbow".to_owned(),
        friction: Friction::Atan,
    };
    assert!(collect(&model, &mut made, &[other]).is_err());
}

/// At 500 samples per second and a cutoff of 2 Hz the equations of four samples are averaged. Samples in
/// a bridged gap have no influence on either, whatever they are, nor have efforts without a weight.
#[test]
fn friction_is_averaged_over_samples_as_its_equations_are() {
    let gaps = |k: i32| k % 700 < 45 || k % 333 == 7;
    averaged_friction(|_| false, |_| false);
    averaged_friction(gaps, |_| false);
    averaged_friction(|_| false, gaps);
}

/// - `bridged`: whether a sample lies in a gap;
/// - `unknown`: whether its effort has no value.
fn averaged_friction(bridged: impl Fn(i32) -> bool, unknown: impl Fn(i32) -> bool) {
    let model = SliderCrank::default();
    let filtering = Filtering {
        smoothing: Smoothing::Butterworth {
            order: 4,
            cutoff: 2.0,
        },
        ..Filtering::default()
    };
    let step = 2e-3;
    assert_eq!(filtering.averaged(step), 4);
    let mut closure = LoopClosure::new(&model).unwrap();
    let mut log = Recorded::new().filtered(filtering);
    // a multiple of four and two samples more, which no average has
    for k in 0..4002 {
        let t = step * f64::from(k);
        let (s, c) = (1.5 * t).sin_cos();
        let state = closure
            .track_state(&[0.8 + 0.6 * s], &[0.9 * c], &[-1.35 * s])
            .unwrap();
        let is_bridged = bridged(k);
        let tau = if is_bridged || unknown(k) {
            -20.0
        } else {
            effort(&state)
        };
        let qdd = state.qdd.iter().map(|x| if is_bridged { 3.0 } else { *x });
        log.push_row(&StateSample {
            time: t,
            q: &state.q,
            qd: &state.qd,
            qdd: &qdd.collect::<Vec<f64>>(),
            tau: &[tau],
            efforts: &[],
            held: &[],
            at_standstill: &[],
            weights: &[f64::from(!unknown(k))],
            follows: k > 0,
            bridged: is_bridged,
        });
    }
    let laws: Vec<FrictionJoint> = joints()
        .into_iter()
        .map(|j| FrictionJoint {
            name: j.name,
            friction: j.friction,
        })
        .collect();
    let (data, _) = collect(&model, &mut Log(log), &laws).unwrap();
    assert!(data.len() > 500 && data.len() <= 1000, "{}", data.len());
    let efforts = ["crank".to_owned()];
    let found = data.residuals(&efforts, &VALUES, &joints(), 1).unwrap();
    // efforts of size 50 and their rounding
    assert!(found.efforts()[0].largest < 1e-11, "{found:?}");
}

#[test]
fn friction_of_a_passive_joint_acts_through_its_velocity_ratio_to_the_crank() {
    let model = SliderCrank::default();
    for state in states() {
        let (d, condition) = directions(&model, &state.q, &[0, 2, 1]).unwrap();
        assert!(condition.is_regular());
        let exact = [1.0, state.qd[2] / state.qd[0], state.qd[1] / state.qd[0]];
        for (a, b) in d.iter().zip(exact) {
            assert!((a - b).abs() < 1e-12, "{d:?} {exact:?}");
        }
    }
}

/// Eq. 14, 16, 17 and 32 and the linear laws, in both directions and at rest.
#[test]
fn every_law_opposes_the_motion_by_its_equation() {
    let effort = |friction: Friction, values: &[f64], v: f64| {
        let joint = JointFit {
            name: "q".to_owned(),
            friction,
            values: values.to_vec(),
        };
        joint.effort(v)
    };
    for (friction, values) in [
        (Friction::Stribeck, &[2.0, 3.5, 0.12, 1.3, 1.1][..]),
        (Friction::Atan, &[0.8, 0.5, 2.0, 14.0]),
        (Friction::Power, &[1.5, 0.9, 2.2, 0.6]),
        (Friction::Lugre, &[1.4, 2.3, 0.2, 0.8]),
    ] {
        for v in [-2.0, -0.3, -0.01, 0.01, 0.1, 1.7] {
            let (a, b) = (effort(friction, values, v), force(friction, v, values));
            assert!((a - b).abs() < 1e-14 * b.abs(), "{friction:?} {v}: {a} {b}");
            assert!(a * v > 0.0);
        }
        let rest = effort(friction, values, 0.0).abs();
        assert!(rest < f64::MIN_POSITIVE, "{friction:?} at rest: {rest}");
    }
    let (fv, fc) = (2.0, 0.5);
    let (forwards, backwards) = ([2.0, 0.5], [3.0, 0.25]);
    for v in [-1.5, -0.1, 0.0, 0.2, 3.0] {
        let sign = if v == 0.0 { 0.0 } else { f64::signum(v) };
        let [fv_own, fc_own] = if v > 0.0 { forwards } else { backwards };
        for (friction, values, exact) in [
            (Friction::None, &[][..], 0.0),
            (Friction::Viscous, &[fv], fv * v),
            (Friction::Coulomb, &[fc], fc * sign),
            (Friction::Linear, &[fv, fc], fv * v + fc * sign),
            (
                Friction::CoulombAsymmetric,
                &[fv, forwards[1], backwards[1]],
                fv * v + fc_own * sign,
            ),
            (
                Friction::Asymmetric,
                &[forwards[0], forwards[1], backwards[0], backwards[1]],
                fv_own * v + fc_own * sign,
            ),
        ] {
            let found = effort(friction, values, v);
            assert!(
                (found - exact).abs() <= 1e-15 * exact.abs(),
                "{friction:?} {v}: {found} {exact}"
            );
        }
    }
}
