//! Confidence intervals contain the true values as often as stated, for residuals that are
//! correlated in time.
//!
//! A small version of `tests/examples/coverage.rs`, which counts 1,000 logs for every estimator.

use regen_identify::identify::{EquationKind, Options, identify};
use regen_identify::states::Recorded;

use crate::models::pendulum::Pendulum;
use crate::robust::Random;

const TRUTH: [f64; 2] = [0.5, 2.0];
const RHO: f64 = 0.9;
const LOGS: u64 = 200;
/// 16 s at 50 Hz, which correspond to 800 / 19 = 42 independent samples.
const SAMPLES: usize = 800;

/// A motion of three harmonics with noise of an autoregression on the effort.
fn log(seed: u64) -> Recorded {
    let mut random = Random(seed);
    let mut noise = 0.0;
    for _ in 0..100 {
        noise = RHO * noise + 0.05 * random.normal();
    }
    let mut log = Recorded::new();
    for k in 0..SAMPLES {
        let t = 0.02 * k as f64;
        let (mut q, mut qd, mut qdd) = (0.3, 0.0, 0.0);
        for (h, amplitude) in [(1.0_f64, 0.8), (2.0, 0.3), (3.0, -0.2)] {
            let (s, c) = (1.3 * h * t).sin_cos();
            q += amplitude * s;
            qd += amplitude * 1.3 * h * c;
            qdd -= amplitude * (1.3 * h).powi(2) * s;
        }
        noise = RHO * noise + 0.05 * random.normal();
        let tau = TRUTH[0] * qdd + TRUTH[1] * 9.81 * q.sin() + noise;
        log.push(t, &[q], &[qd], &[qdd], &[tau]);
    }
    log
}

/// In 200 logs, a 95 % interval contains the true value 190 times on average, with a standard
/// deviation of 3.1: a count outside of 180 to 198 would occur once in 500 times with new seeds.
/// Intervals for white residuals contain it less than 110 times.
#[test]
fn intervals_contain_the_true_values_in_95_of_100_logs_with_correlated_residuals() {
    for huber in [None, Some(1.345)] {
        let options = Options {
            huber,
            ..Options::default()
        };
        let (mut covered, mut white) = ([0; 2], [0; 2]);
        for seed in 0..LOGS {
            let found =
                identify(&Pendulum, EquationKind::Forces, &options, &mut log(seed)).unwrap();
            let used = found.correlated();
            for k in 0..2 {
                let off = (used.values[k] - TRUTH[k]).abs();
                covered[k] += usize::from(off <= used.half_width(k, 0.95));
                white[k] += usize::from(off <= found.estimate.half_width(k, 0.95));
            }
        }
        for k in 0..2 {
            assert!((180..=198).contains(&covered[k]), "{huber:?}: {covered:?}");
            assert!(white[k] < 150, "{white:?}");
        }
    }
}
