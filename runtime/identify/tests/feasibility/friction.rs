//! Nonlinear friction is recovered from exact data, and never fits worse than linear friction.

use proptest::prelude::*;
use regen_identify::feasibility::{BaseMap, Options, ParameterLayout, Scale};
use regen_identify::friction::{FrictionData, FrictionFit, fit};
use regen_identify::states::FrictionJoint;
use regen_runtime::Friction;

use crate::robots::{Robot, robot};

/// The friction laws, written from the documentation of the spec format.
pub(crate) fn force(friction: Friction, v: f64, x: &[f64]) -> f64 {
    let sign = if v == 0.0 { 0.0 } else { v.signum() };
    match (friction, x) {
        (Friction::Stribeck, [fc, fs, vs, delta, fv]) => {
            sign * (fc + (fs - fc) * (-(v / vs).abs().powf(*delta)).exp()) + fv * v
        }
        (Friction::Lugre, [fc, fs, vs, fv]) => {
            sign * (fc + (fs - fc) * (-(v / vs).powi(2)).exp()) + fv * v
        }
        (Friction::Atan, [fc, fv1, fv2, fv3]) => sign * fc + fv1 * v + fv2 * (fv3 * v).atan(),
        (Friction::Power, [forwards, backwards, fv, delta]) => {
            let fc = if v > 0.0 { forwards } else { backwards };
            sign * (fc + fv * v.abs().powf(*delta))
        }
        _ => panic!("{friction:?} has other coefficients"),
    }
}

/// Data of two joints whose friction acts on two rows, one of them through the mechanism, and of
/// the base parameters of a robot.
pub(crate) fn simulate(robot: &Robot, laws: &[(Friction, &[f64])], noise: f64) -> FrictionData {
    let own: Vec<Friction> = laws.iter().map(|(law, _)| *law).collect();
    simulate_for(&own, robot, laws, noise, 0)
}

/// The same data for a fit of other laws, with other noise for each seed.
pub(crate) fn simulate_for(
    fitted: &[Friction],
    robot: &Robot,
    laws: &[(Friction, &[f64])],
    noise: f64,
    seed: usize,
) -> FrictionData {
    let joints: Vec<FrictionJoint> = fitted
        .iter()
        .enumerate()
        .map(|(k, friction)| FrictionJoint {
            name: format!("j{k}"),
            friction: *friction,
        })
        .collect();
    let labels = robot.combinations.labels();
    let beta = robot.beta();
    let mut data = FrictionData::new(labels, &joints, 2).unwrap();
    for t in 0..300 {
        let s = t as f64 * 0.05;
        let w: Vec<f64> = (0..2 * labels.len())
            .map(|k| (0.7 * s + 1.3 * k as f64).sin() + (1.9 * s * (1.0 + 0.1 * k as f64)).cos())
            .collect();
        let qd: Vec<f64> = (0..laws.len())
            .map(|k| (s * (1.0 + 0.37 * k as f64)).sin() * 1.5)
            .collect();
        let directions: Vec<f64> = (0..laws.len())
            .flat_map(|k| [1.0 - 0.4 * k as f64, 0.3 * (s + k as f64).cos()])
            .collect();
        let tau: Vec<f64> = (0..2)
            .map(|i| {
                let body: f64 = beta.iter().enumerate().map(|(j, b)| w[2 * j + i] * b).sum();
                let friction: f64 = laws
                    .iter()
                    .enumerate()
                    .map(|(k, (law, x))| directions[2 * k + i] * force(*law, qd[k], x))
                    .sum();
                body + friction + noise * rough(t * 7919 + i * 31 + seed * 1_000_003)
            })
            .collect();
        data.push(&w, &tau, &qd, &directions, &[1.0, 1.0]).unwrap();
    }
    data
}

fn of_robot(robot: &Robot, data: &FrictionData) -> FrictionFit {
    fit(
        data,
        &robot.combinations,
        &robot.layout,
        &Options::default(),
    )
    .unwrap()
}

pub(crate) fn plain() -> Robot {
    let labels: Vec<String> = crate::robots::labels(1);
    let phi = vec![0.3, 0.01, -0.02, 0.25, 0.0, 0.4, 0.2, -0.1, 0.15, 2.0, 0.7];
    let layout = ParameterLayout::new(&labels).unwrap();
    Robot {
        layout,
        combinations: BaseMap::identity(&labels),
        phi,
    }
}

#[test]
fn the_shapes_of_every_law_are_recovered_from_exact_data() {
    let robot = plain();
    let stribeck: &[f64] = &[2.0, 3.5, 0.12, 1.3, 1.1];
    let atan: &[f64] = &[0.8, 0.5, 2.0, 14.0];
    let power: &[f64] = &[1.5, 0.9, 2.2, 0.6];
    let lugre: &[f64] = &[1.4, 2.3, 0.2, 0.8];
    for laws in [
        [(Friction::Lugre, lugre), (Friction::Power, power)],
        [(Friction::Stribeck, stribeck), (Friction::Atan, atan)],
        [(Friction::Power, power), (Friction::Stribeck, stribeck)],
    ] {
        let found = of_robot(&robot, &simulate(&robot, &laws, 0.0));
        assert!(found.converged, "{found:?}");
        for (joint, (friction, values)) in found.joints.iter().zip(laws) {
            assert_eq!(joint.friction, friction);
            for (a, b) in joint.values.iter().zip(values) {
                assert!(
                    (a - b).abs() < 1e-6 * b.abs(),
                    "{:?} {values:?}",
                    joint.values
                );
            }
        }
        for (a, b) in found.beta.iter().zip(&robot.phi) {
            assert!((a - b).abs() < 1e-6, "{:?}", found.beta);
        }
        assert!(
            found.linear_squared_residual > 1.0,
            "linear friction does not explain it"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3))]

    #[test]
    fn nonlinear_friction_is_never_worse_than_linear_friction(robot in robot(), noise in 0.0..20.0_f64, fc in 0.0..3.0_f64) {
        let laws: [(Friction, &[f64]); 2] =
            [(Friction::Stribeck, &[fc, 1.0, 0.2, 1.5, 0.4]), (Friction::Power, &[fc, fc, 1.0, 1.0])];
        let found = of_robot(&robot, &simulate(&robot, &laws, noise));
        prop_assert!(found.squared_residual <= found.linear_squared_residual * (1.0 + 1e-6) + 1e-9);
        let check = robot.layout.check(&found.phi, Scale::default()).unwrap();
        prop_assert!(check.is_physical());
        prop_assert!(found.joints.iter().all(|j| j.values.iter().all(|v| *v >= 0.0)));
        let stribeck = &found.joints[0].values;
        prop_assert!(stribeck[1] >= stribeck[0], "static below Coulomb friction: {:?}", stribeck);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4))]

    #[test]
    fn a_law_never_ends_above_one_that_it_contains(
        excess in 0.5..6.0_f64,
        // near the highest velocity, 1.5, where friction looks viscous and the search was stuck
        vs in 1.0..3.5_f64,
        delta in 1.5..3.0_f64,
        noise in prop::sample::select(vec![0.01, 0.1, 1.0]),
    ) {
        let robot = plain();
        let mut truths = vec![[0.0, excess, vs, delta, 0.7], [0.0, 1.0, 1.5, 2.0, 0.7]];
        truths.push([0.0, 5.0, 3.0, 3.0, 0.7]);
        for (truth, noise) in truths.iter().zip([noise, 0.01, 0.01]) {
            let laws = [(Friction::Stribeck, &truth[..]), (Friction::Stribeck, &truth[..])];
            let cost = |law: Friction| {
                of_robot(&robot, &simulate_for(&[law, law], &robot, &laws, noise, 0)).squared_residual
            };
            let [whole, part] = [Friction::Stribeck, Friction::Lugre].map(cost);
            prop_assert!(whole <= part * (1.0 + 1e-7) + 1e-9, "{truth:?}: {whole} {part}");
        }
    }
}

#[test]
fn a_law_with_columns_of_its_own_is_refused() {
    let joint = FrictionJoint {
        name: "q1".to_owned(),
        friction: Friction::Linear,
    };
    assert!(FrictionData::new(&[], &[joint], 1).is_err());
}

#[test]
fn weighing_stored_rows_equals_weighing_them_when_they_are_added() {
    let labels = crate::robots::labels(1);
    let joints = [FrictionJoint {
        name: "j0".to_owned(),
        friction: Friction::Stribeck,
    }];
    // powers of two, so that the order of multiplications does not change the bits
    let weights = [0.5, 4.0];
    let filled = |when: &[f64; 2]| {
        let mut data = FrictionData::new(&labels, &joints, 2).unwrap();
        for t in 0..40 {
            let entry = |k: usize| (0.3 * f64::from(t) + 1.7 * k as f64).sin();
            let w: Vec<f64> = (0..2 * labels.len()).map(entry).collect();
            data.push(
                &w,
                &[entry(50), entry(51)],
                &[entry(52)],
                &[1.0, 0.25],
                when,
            )
            .unwrap();
        }
        data
    };
    let mut later = filled(&[1.0, 1.0]);
    later.weigh(&weights).unwrap();
    assert_eq!(
        later.linear_factor().unwrap(),
        filled(&weights).linear_factor().unwrap()
    );
    assert!(later.weigh(&[1.0]).is_err() && later.weigh(&[1.0, 0.0]).is_err());
}

/// A number from -1 to 1 whose digits look random (SplitMix64), the same on every machine.
fn rough(k: usize) -> f64 {
    let mut x = (k as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ (x >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}
