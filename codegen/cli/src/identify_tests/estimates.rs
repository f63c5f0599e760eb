//! Tests of differentiation methods, kinds of equations, noise, outliers, windows and fusion.

use std::fs;

use regen_identify::data::{Logs, Settings};
use regen_identify::estimate::{Estimate, Weighting};
use regen_identify::identify::{EquationKind, Identified, Options, identify, observe};
use regen_identify::signals::{Derivatives, Method, differences};
use regen_identify::states::{Completed, Completion, Recorded, Source, Standstill};

use super::{Bench, FREQUENCY, HARMONICS, csv, normal, run, scratch, with, worst};
use regen_reference::Random;

/// The chapter's comparison of differentiation methods (section 5.1), and of the integral method
/// (section 2), on one log.
#[test]
fn all_methods_and_both_kinds_of_equations_agree_on_one_log() {
    Bench::new().with(5001, 0.001, |model, rows, beta| {
        let path = scratch("methods.csv", &csv(model, &rows));
        let energy = EquationKind::Energy { window: 0.05 };
        // the bounds are the methods' truncation errors: of differences over 1 ms at 1 Hz, of a
        // cutoff 60 times that, of cubics over a fiftieth of the shortest period, of the
        // trapezoidal rule; all magnified by the weakest excited parameter
        for (method, kind, bound) in [
            (Method::Central, EquationKind::Forces, 1e-3),
            (
                Method::Butterworth {
                    order: 4,
                    cutoff: 60.0,
                },
                EquationKind::Forces,
                1e-2,
            ),
            (
                Method::Local { half_width: 0.01 },
                EquationKind::Forces,
                5e-2,
            ),
            (
                Method::Fourier {
                    frequency: FREQUENCY,
                    harmonics: HARMONICS,
                },
                EquationKind::Forces,
                1e-8,
            ),
            (
                Method::Fourier {
                    frequency: FREQUENCY,
                    harmonics: HARMONICS,
                },
                energy,
                1e-2,
            ),
            (Method::Central, energy, 1e-2),
        ] {
            let found = run(model, &path, &with(method), kind);
            let off = worst(&found.estimate.values, beta);
            assert!(off < bound, "{method:?} {kind:?}: {off:e}");
        }
        fs::remove_file(path).unwrap();
    });
}

#[test]
fn noise_is_estimated_and_errors_agree_with_their_standard_deviations() {
    Bench::new().with(800, 0.00625, |model, rows, beta| {
        let mut random = Random::new(7);
        let runs = 40;
        let n = beta.len();
        let mut mean = vec![0.0; n];
        let mut variance = vec![0.0; n];
        let mut standard = 0.0;
        for _ in 0..runs {
            let mut source = Recorded::new();
            for row in &rows {
                let tau = [
                    row.tau[0] + 0.05 * normal(&mut random),
                    row.tau[1] + 0.20 * normal(&mut random),
                ];
                source.push(row.time, &row.q, &row.qd, &row.qdd, &tau);
            }
            let (set, _) = observe(model, EquationKind::Forces, &mut source).unwrap();
            let found = Estimate::new(&set, Weighting::PerEffort).unwrap();
            for (effort, sigma) in found.efforts.iter().zip([0.05, 0.20]) {
                // the estimate from 800 samples is within five of its standard deviations
                assert!((effort.sigma / sigma - 1.0).abs() < 5.0 / 1600_f64.sqrt());
            }
            for k in 0..n {
                let off = found.values[k] - beta[k];
                mean[k] += off / f64::from(runs);
                variance[k] += found.sigma(k).powi(2) / f64::from(runs);
                standard += (off / found.sigma(k)).powi(2) / (n as f64 * f64::from(runs));
            }
        }
        for k in 0..n {
            // the mean of 40 runs is within four of its standard deviations
            assert!(mean[k].abs() < 4.0 * (variance[k] / f64::from(runs)).sqrt());
        }
        // errors are as large as their deviations state: the mean of 440 correlated squares is 1
        assert!((standard - 1.0).abs() < 0.35, "{standard}");
    });
}

#[test]
fn hubers_weights_limit_the_effect_of_outliers() {
    Bench::new().with(800, 0.00625, |model, rows, beta| {
        let mut random = Random::new(8);
        let mut source = Recorded::new();
        for row in &rows {
            // a tenth of the samples is wrong, all to one side
            let hit = if random.signed() < -0.8 { 8.0 } else { 0.0 };
            let tau: Vec<f64> = row
                .tau
                .iter()
                .map(|t| t + 0.05 * normal(&mut random) + hit)
                .collect();
            source.push(row.time, &row.q, &row.qd, &row.qdd, &tau);
        }
        let plain = identify(
            model,
            EquationKind::Forces,
            &Options::default(),
            &mut source,
        )
        .unwrap();
        let options = Options {
            huber: Some(1.345),
            ..Options::default()
        };
        let robust = identify(model, EquationKind::Forces, &options, &mut source).unwrap();
        let error = |found: &Identified| -> f64 {
            let pairs = found.estimate.values.iter().zip(beta);
            pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
        };
        assert!(
            error(&robust) < 0.2 * error(&plain),
            "{} {}",
            error(&robust),
            error(&plain)
        );
        for effort in &robust.estimate.efforts {
            // a tenth of outliers, each bounded to 1.345 sigma, adds 15 % to the mean of squares
            assert!((effort.sigma / 0.05 - 1.0).abs() < 0.3, "{}", effort.sigma);
        }
        for (k, exact) in beta.iter().enumerate() {
            let off = (robust.estimate.values[k] - exact).abs();
            // outliers that are all on one side still bias the estimate a little
            assert!(off < 8.0 * robust.estimate.sigma(k), "{k}");
        }
    });
}

#[test]
fn reading_a_log_in_windows_gives_the_estimate_of_the_whole_log() {
    // the log has more rows than a window
    Bench::new().with(20_000, 0.0005, |model, rows, _| {
        let path = scratch("windows.csv", &csv(model, &rows));
        for method in [
            Method::Central,
            Method::Butterworth {
                order: 2,
                cutoff: 40.0,
            },
            Method::Local { half_width: 0.01 },
        ] {
            let settings = Settings {
                decimation: 7,
                standstill: Standstill::Keep,
                ..with(method)
            };
            let mut logs = Logs::open(model, std::slice::from_ref(&path), &settings).unwrap();
            let (set, _) = observe(model, EquationKind::Forces, &mut logs).unwrap();
            // the same rows filtered as a whole; differences of noiseless positions need three
            // neighbours
            let times: Vec<f64> = rows.iter().map(|r| r.time).collect();
            let whole: Vec<_> = [0, 2]
                .iter()
                .map(|&c| {
                    let values: Vec<f64> = rows.iter().map(|r| r.q[c]).collect();
                    match method.of_states(0.0005) {
                        Method::Central => differences(&times, &values, 3).unwrap(),
                        states => states.differentiate(&times, &values).unwrap(),
                    }
                })
                .collect();
            let mut completion = Completion::new(model, &[0, 2], &[1.0; 2]).unwrap();
            let filtering = logs.filtering();
            // without a filter, rows are decimated before they are differentiated
            let every = if filtering.smoothing.is_none() { 7 } else { 1 };
            let mut source = Recorded::new().filtered(filtering);
            for k in whole[0].valid.clone().step_by(every) {
                let pick = |part: fn(&Derivatives) -> &Vec<f64>| -> Vec<f64> {
                    whole.iter().map(|w| part(w)[k]).collect()
                };
                let completed = completion
                    .complete(
                        &pick(|w| &w.value),
                        &pick(|w| &w.rate),
                        &pick(|w| &w.acceleration),
                    )
                    .unwrap();
                let Completed::State(s) = completed else {
                    panic!("{completed:?}");
                };
                source.push(times[k], &s.q, &s.qd, &s.qdd, &rows[k].tau);
            }
            let (expected, _) = observe(model, EquationKind::Forces, &mut source).unwrap();
            assert_eq!(
                set.factors()[0].rows(),
                expected.factors()[0].rows(),
                "{method:?}"
            );
            let a = Estimate::new(&set, Weighting::Equal).unwrap();
            let b = Estimate::new(&expected, Weighting::Equal).unwrap();
            let off = worst(&a.values, &b.values);
            // differences over 0.5 ms magnify rounding of the positions by 1.4e7
            assert!(off < 1e-6, "{method:?}: {off:e}");
        }
        fs::remove_file(path).unwrap();
    });
}

#[test]
fn redundant_measured_coordinates_are_fused() {
    Bench::new().with(50, 0.05, |model, rows, _| {
        // two measured coordinates with a passive one, all of them, and three in another order
        for measured in [vec![0, 1], vec![0, 1, 2, 3], vec![3, 0, 2]] {
            let deviations = vec![0.5; measured.len()];
            let mut completion = Completion::new(model, &measured, &deviations).unwrap();
            for row in &rows {
                let pick = |v: &[f64]| -> Vec<f64> { measured.iter().map(|&m| v[m]).collect() };
                let found = completion
                    .complete(&pick(&row.q), &pick(&row.qd), &pick(&row.qdd))
                    .unwrap();
                let Completed::State(state) = found else {
                    panic!("{measured:?}: {found:?}");
                };
                for k in 0..4 {
                    assert!((state.q[k] - row.q[k]).abs() < 1e-11);
                    assert!((state.qd[k] - row.qd[k]).abs() < 1e-9);
                    assert!((state.qdd[k] - row.qdd[k]).abs() < 1e-7);
                }
            }
        }
        // where measurements contradict each other, those with smaller deviations have more weight
        let row = &rows[10];
        let off = |deviations: &[f64]| {
            let mut completion = Completion::new(model, &[0, 1, 2, 3], deviations).unwrap();
            let mut q = row.q.clone();
            q[1] += 0.01;
            match completion.complete(&q, &row.qd, &row.qdd).unwrap() {
                Completed::State(state) => (state.q[1] - row.q[1]).abs(),
                other => panic!("{other:?}"),
            }
        };
        assert!(off(&[1e-4, 1.0, 1e-4, 1e-4]) < 1e-6);
        assert!(off(&[1.0, 1e-4, 1.0, 1.0]) > 5e-3);
        assert!(Completion::new(model, &[0], &[1.0]).is_err());
        assert!(Completion::new(model, &[0, 0], &[1.0, 1.0]).is_err());
        assert!(Completion::new(model, &[0, 9], &[1.0, 1.0]).is_err());
        assert!(Completion::new(model, &[0, 1], &[1.0, 0.0]).is_err());
    });
}
