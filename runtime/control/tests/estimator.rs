//! The recursive estimate against least squares on all equations at once, by nalgebra.

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use regen_control::{Estimator, Forgetting, Sample, SettingError, Settings};

const D: usize = 2;
const P: usize = 3;
const PERIOD: f64 = 0.01;
const BANDWIDTH: f64 = 20.0;
const DEVIATIONS: [f64; D] = [0.5, 2.0];

/// Momentum columns, columns of its rate, and efforts of one sample.
type Given = ([[f64; D]; P], [[f64; D]; P], [f64; D]);

fn settings(forgetting: Forgetting) -> Settings {
    Settings {
        period: PERIOD,
        bandwidth: BANDWIDTH,
        forgetting,
        block: 20.0 * PERIOD,
    }
}

fn samples() -> impl Strategy<Value = Vec<Given>> {
    let columns = || prop::array::uniform3(prop::array::uniform2(-1.0..1.0));
    let sample = (columns(), columns(), prop::array::uniform2(-5.0..5.0));
    prop::collection::vec(sample, 6..40)
}

/// The filtered, weighted equations of each sample but the first, from the definition: the
/// convolution of the low-pass with straight lines between samples, and with held efforts.
fn equations(samples: &[Given]) -> Vec<[([f64; P], f64); D]> {
    // integrals of omega exp(-omega (T - s)) over a period, with 1 and with s / T
    let turn = BANDWIDTH * PERIOD;
    let whole = 1.0 - (-turn).exp();
    let rising = 1.0 - whole / turn;
    let of = |k: usize, d: usize| {
        let after = |i: usize| (-turn * (k - i) as f64).exp();
        let smooth = |value: &dyn Fn(usize) -> f64, rate: &dyn Fn(usize) -> f64| {
            let u = |i: usize| BANDWIDTH * value(i) + rate(i);
            let sums = (1..=k).map(|i| after(i) * ((whole - rising) * u(i - 1) + rising * u(i)));
            BANDWIDTH * (value(k) - after(0) * value(0)) - sums.sum::<f64>()
        };
        let row = std::array::from_fn(|j| {
            smooth(&|i| samples[i].0[j][d], &|i| samples[i].1[j][d]) / DEVIATIONS[d]
        });
        let right: f64 = (1..=k).map(|i| after(i) * whole * samples[i].2[d]).sum();
        (row, right / DEVIATIONS[d])
    };
    (1..samples.len())
        .map(|k| std::array::from_fn(|d| of(k, d)))
        .collect()
}

fn estimator(samples: &[Given], forgetting: Forgetting) -> Estimator<f64, D, P> {
    let mut estimator = Estimator::new(&settings(forgetting), &DEVIATIONS).unwrap();
    for (k, (momentum, rate, effort)) in samples.iter().enumerate() {
        let taken = estimator.update(momentum, rate, effort);
        assert_eq!(taken, if k == 0 { Sample::First } else { Sample::Taken });
    }
    estimator
}

/// Least squares by a singular value decomposition, and the condition of the equations.
fn batch(rows: &[(Vec<f64>, f64)]) -> (DVector<f64>, f64) {
    let matrix = DMatrix::from_fn(rows.len(), P, |i, j| rows[i].0[j]);
    let right = DVector::from_fn(rows.len(), |i, _| rows[i].1);
    let svd = matrix.svd(true, true);
    let condition = svd.singular_values.max() / svd.singular_values.min();
    (svd.solve(&right, 0.0).unwrap(), condition)
}

fn apart(values: &[f64; P], known: &DVector<f64>) -> f64 {
    let size = known.amax().max(1.0);
    let differences = values.iter().zip(known.iter());
    differences.fold(0.0, |m, (a, b)| m.max((a - b).abs() / size))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    /// 1e-10, as the equations' condition times a rounding error stays below it.
    #[test]
    fn the_estimate_is_that_of_all_equations_at_once(samples in samples()) {
        for time in [None, Some(0.1)] {
            let forgetting = time.map_or(Forgetting::Never, Forgetting::Exponential);
            let equations = equations(&samples);
            let last = equations.len() - 1;
            let rows: Vec<(Vec<f64>, f64)> = equations.iter().enumerate().flat_map(|(k, each)| {
                let age = PERIOD * (last - k) as f64;
                let weight = time.map_or(1.0, |time| (-0.5 * age / time).exp());
                each.iter().map(move |(row, right)| {
                    (row.iter().map(|x| weight * x).collect(), weight * right)
                })
            }).collect();
            let (known, condition) = batch(&rows);
            prop_assume!(condition < 1e4);
            let values = estimator(&samples, forgetting).values().unwrap();
            let apart = apart(&values, &known);
            prop_assert!(apart < 1e-10, "{apart:e} at condition {condition:e}");
        }
    }

    /// The information matrices of Cao and Schwartz, as they stand.
    #[test]
    fn directional_forgetting_is_that_of_the_information_matrix(samples in samples()) {
        let time = 0.1;
        let keep = (-PERIOD / time).exp();
        let (prior, off) = ([0.3, -0.2, 0.1], [2.0, 1.0, 3.0]);
        let mut information = DMatrix::from_diagonal(&DVector::from_fn(P, |j, _| 1.0 / (off[j] * off[j])));
        let mut known = DVector::from_row_slice(&prior);
        for (row, right) in equations(&samples).into_iter().flatten() {
            let row = DVector::from_row_slice(&row);
            let seen = &information * &row;
            information -= (1.0 - keep) / row.dot(&seen) * &seen * seen.transpose();
            information += &row * row.transpose();
            let error = right - row.dot(&known);
            known += information.clone().cholesky().unwrap().solve(&row) * error;
        }
        let mut estimator = Estimator::<f64, D, P>::new(&settings(Forgetting::Directional(time)), &DEVIATIONS)
            .unwrap().with_prior(&prior, &off).unwrap();
        for (momentum, rate, effort) in &samples {
            prop_assert!(estimator.update(momentum, rate, effort) != Sample::Refused);
        }
        let apart = apart(&estimator.values().unwrap(), &known);
        prop_assert!(apart < 1e-10, "{apart:e}");
        let (r, _) = estimator.factor();
        let r = DMatrix::from_fn(P, P, |i, j| r[i][j]);
        let apart = (r.transpose() * &r - &information).amax() / information.amax();
        prop_assert!(apart < 1e-12, "{apart:e}");
    }

    #[test]
    fn a_refused_sample_changes_nothing(samples in samples(), at in 0_usize..6, place in 0_usize..3, bad in 0_usize..4) {
        let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300][bad];
        let mut with = Estimator::<f64, D, P>::new(&settings(Forgetting::Exponential(0.2)), &DEVIATIONS).unwrap();
        let without = estimator(&samples, Forgetting::Exponential(0.2));
        for (k, (momentum, rate, effort)) in samples.iter().enumerate() {
            if k == at {
                let (mut momentum, mut rate, mut effort) = (*momentum, *rate, *effort);
                match place {
                    0 => momentum[2][1] = bad,
                    1 => rate[0][0] = bad,
                    _ => effort[1] = bad,
                }
                prop_assert_eq!(with.update(&momentum, &rate, &effort), Sample::Refused);
            }
            prop_assert!(with.update(momentum, rate, effort) != Sample::Refused);
        }
        prop_assert_eq!(with.values(), without.values());
        prop_assert_eq!(with.deviations(), without.deviations());
    }
}

/// What an update refuses is not only what was not finite, but also what overflows in the filter.
#[test]
fn what_overflows_behind_the_filter_is_refused() {
    let mut estimator = Estimator::<f32, 1, 1>::new(&Settings::new(1e-3), &[1e-3]).unwrap();
    assert_eq!(estimator.update(&[[0.0]], &[[0.0]], &[0.0]), Sample::First);
    assert_eq!(
        estimator.update(&[[5e8]], &[[0.0]], &[0.0]),
        Sample::Refused
    );
    for _ in 0..3 {
        assert_eq!(estimator.update(&[[1.0]], &[[1.0]], &[1.0]), Sample::Taken);
    }
    assert!(estimator.values().unwrap()[0].is_finite());
}

#[test]
fn settings_without_meaning_are_errors() {
    let good = settings(Forgetting::Never);
    let of = |settings: Settings| Estimator::<f64, D, P>::new(&settings, &DEVIATIONS).unwrap_err();
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let positive = |of| SettingError::NotPositive { of };
        assert_eq!(
            of(Settings {
                period: bad,
                ..good
            }),
            positive("period")
        );
        assert_eq!(
            of(Settings {
                bandwidth: bad,
                ..good
            }),
            positive("bandwidth")
        );
        assert_eq!(of(Settings { block: bad, ..good }), positive("block"));
        for forgetting in [Forgetting::Exponential(bad), Forgetting::Directional(bad)] {
            assert_eq!(
                of(Settings { forgetting, ..good }),
                positive("time of forgetting")
            );
        }
        let deviations = Estimator::<f64, D, P>::new(&good, &[1.0, bad]).unwrap_err();
        assert_eq!(deviations, positive("deviation of an effort"));
        let started = Estimator::<f64, D, P>::new(&good, &DEVIATIONS).unwrap();
        let prior = started.clone().with_prior(&[0.0; P], &[1.0, 1.0, bad]);
        assert_eq!(prior.unwrap_err(), positive("deviation of the prior"));
    }
    assert_eq!(
        of(Settings {
            bandwidth: 101.0,
            ..good
        }),
        SettingError::Bandwidth
    );
    let started = Estimator::<f64, D, P>::new(&good, &DEVIATIONS).unwrap();
    let prior = started.with_prior(&[0.0, f64::NAN, 0.0], &[1.0; P]);
    assert_eq!(
        prior.unwrap_err(),
        SettingError::NotFinite { of: "prior values" }
    );
}

/// Uniform numbers between -1 and 1, the same on every machine.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        // SplitMix64
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// Of variance one, nearly normal.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.next()).sum::<f64>() / 2.0
    }
}

/// A mass with viscous and dry friction moves by two sines under efforts with noise.
fn mass(
    forgetting: Forgetting,
    noise: &mut Noise,
    alike: f64,
    seconds: usize,
) -> Estimator<f64, 1, 3> {
    let settings = Settings {
        block: 0.25,
        forgetting,
        ..Settings::new(2e-3)
    };
    let mut estimator = Estimator::new(&settings, &[1.0]).unwrap();
    let velocity = |t: f64| (2.0 * t).sin() + 0.5 * (5.3 * t).sin();
    let slope = |t: f64| 2.0 * (2.0 * t).cos() + 2.65 * (5.3 * t).cos();
    let mut error = 0.0;
    for k in 0..500 * seconds {
        let t = 2e-3 * k as f64;
        let (v, middle) = (velocity(t), t - 1e-3);
        error = alike * error + (1.0 - alike * alike).sqrt() * noise.normal();
        let u =
            2.0 * slope(middle) + 3.0 * velocity(middle) + 1.5 * velocity(middle).tanh() + error;
        let sample = estimator.update(&[[v], [0.0], [0.0]], &[[0.0], [-v], [-v.tanh()]], &[u]);
        assert_eq!(sample == Sample::First, k == 0);
    }
    estimator
}

/// Deviations are true for white noise and for noise that stays alike over 50 ms: 3 sigmas contain
/// 99 % of the errors, and 1 sigma not nearly all.
#[test]
fn errors_are_as_large_as_their_deviations_say() {
    let mut noise = Noise(1);
    for alike in [0.0, 0.96] {
        for forgetting in [
            Forgetting::Never,
            Forgetting::Exponential(5.0),
            Forgetting::Directional(5.0),
        ] {
            let (mut within, mut one, mut all) = (0, 0, 0);
            for _ in 0..40 {
                let estimator = mass(forgetting, &mut noise, alike, 8);
                let values = estimator.values().unwrap();
                let pairs = values
                    .iter()
                    .zip(estimator.deviations())
                    .zip([2.0, 3.0, 1.5]);
                for ((value, sigma), truth) in pairs {
                    let error = (value - truth).abs() / sigma;
                    within += i32::from(error < 3.0);
                    one += i32::from(error < 1.0);
                    all += 1;
                }
            }
            println!("{alike} {forgetting:?}: {within} and {one} of {all}");
            assert!(within * 100 >= 95 * all, "{within} of {all}");
            assert!(
                one * 100 < 85 * all && one * 100 > 45 * all,
                "{one} of {all}"
            );
        }
    }
}

/// A parameter that the motion stops to excite: exponential forgetting loses it, directional does
/// not.
#[test]
fn directional_forgetting_keeps_what_is_not_excited() {
    let deviation = |forgetting| {
        let mut estimator = mass(forgetting, &mut Noise(3), 0.0, 10);
        for _ in 0..20_000 {
            assert_eq!(
                estimator.update(&[[1.0], [0.0], [0.0]], &[[0.0], [-1.0], [-0.8]], &[4.2]),
                Sample::Taken
            );
        }
        (estimator.factor().0[0][0], estimator.values())
    };
    let (kept, values) = deviation(Forgetting::Directional(1.0));
    let (lost, _) = deviation(Forgetting::Exponential(1.0));
    assert!(kept > 1.0 && lost < 1e-6 * kept, "{kept} {lost:e}");
    assert!((values.unwrap()[0] - 2.0).abs() < 0.1, "{values:?}");
}

/// Dry friction that wears in by 40 % while the mass is known: an estimate of friction alone, beside the
/// known momentum, lags by at most five of its time constants, since each equation forgets one direction only (four
/// were measured), and stays where the robot rests.
#[test]
fn friction_that_grows_is_followed_beside_a_known_robot() {
    const GROWTH: f64 = 0.01;
    let follow = |forgetting: Forgetting| {
        let mut noise = Noise(11);
        let settings = Settings {
            forgetting,
            ..Settings::new(2e-3)
        };
        let mut estimator = Estimator::<f64, 1, 2>::new(&settings, &[1.0]).unwrap();
        let velocity = |t: f64| (2.0 * t).sin() + 0.5 * (5.3 * t).sin();
        let slope = |t: f64| 2.0 * (2.0 * t).cos() + 2.65 * (5.3 * t).cos();
        let dry = |t: f64| 1.5 + GROWTH * t;
        for k in 0..30_000 {
            let t = 2e-3 * f64::from(k);
            let (v, middle) = (velocity(t), t - 1e-3);
            let u = 2.0 * slope(middle)
                + 3.0 * velocity(middle)
                + dry(middle) * velocity(middle).tanh()
                + 0.1 * noise.normal();
            let columns = [[-v], [-v.tanh()]];
            let sample =
                estimator.update_beside(&[2.0 * v], &[0.0], &[[0.0], [0.0]], &columns, &[u]);
            assert_ne!(sample, Sample::Refused);
        }
        let (moved, sigma) = (estimator.values().unwrap(), estimator.deviations());
        estimator.interrupt();
        for _ in 0..30_000 {
            let rest = [[0.0]; 2];
            let _ = estimator.update_beside(&[0.0], &[0.0], &rest, &rest, &[0.0]);
        }
        (moved, sigma, estimator.values())
    };
    let last = 1.5 + 60.0 * GROWTH;
    let time = 5.0;
    let ([_, dry], [_, sigma], rested) = follow(Forgetting::Directional(time));
    let lag = last - dry;
    println!("{dry} of {last}, sigma {sigma}");
    assert!(
        sigma < 0.05 && lag.abs() < 5.0 * GROWTH * time,
        "{dry} {sigma}"
    );
    assert!((rested.unwrap()[1] - dry).abs() < 1e-9, "{rested:?}");
    // without forgetting it is the mean
    let ([_, mean], [_, sigma], _) = follow(Forgetting::Never);
    println!("mean {mean}, sigma {sigma}");
    assert!(
        (mean - 1.8).abs() < 0.1 && last - mean > lag + 0.05,
        "{mean} {sigma}"
    );
}

/// Deviations are unknown, not zero, before there are errors to judge by.
#[test]
fn deviations_are_infinite_until_blocks_tell_them() {
    let short = mass(Forgetting::Never, &mut Noise(5), 0.0, 1);
    assert!(short.deviations().iter().all(|sigma| sigma.is_infinite()));
    let longer = mass(Forgetting::Never, &mut Noise(5), 0.0, 3);
    assert!(
        longer
            .deviations()
            .iter()
            .all(|sigma| sigma.is_finite() && *sigma > 0.0)
    );
    let empty = Estimator::<f64, 1, 3>::new(&Settings::new(1e-3), &[1.0]).unwrap();
    assert_eq!(empty.values(), None);
}
