//! What the sampling of the positions leaves unknown of the parameters.

use std::fmt::Write as _;

use regen_identify::data::{Logs, Run, Settings};
use regen_identify::identify::{EquationKind, MotionSeries, Options, Source, identify};
use regen_identify::signals::Method;

use crate::models::pendulum::Pendulum;

const STEP: f64 = 0.02;
/// Inertia and first moment.
const PHI: [f64; 2] = [0.5, 2.0];

/// Position, velocity and acceleration.
fn motion(t: f64) -> [f64; 3] {
    let (slow, fast) = (3.0 * t, 11.0 * t);
    [
        slow.sin() + 0.2 * fast.cos(),
        3.0 * slow.cos() - 2.2 * fast.sin(),
        -9.0 * slow.sin() - 24.2 * fast.cos(),
    ]
}

/// A log with this noise of positions, and its exact motion.
fn log(name: &str, noise: f64) -> (std::path::PathBuf, MotionSeries) {
    let mut text = "t,q1,tau_q1\n".to_owned();
    let mut exact = MotionSeries::new(1);
    for k in 0..1500_u32 {
        let t = STEP * f64::from(k);
        let [q, qd, qdd] = motion(t);
        let tau = PHI[0] * qdd + PHI[1] * 9.81 * q.sin();
        let own = noise * libm::sin(12.9898 * f64::from(k * k % 1009));
        writeln!(text, "{t},{},{tau}", q + own).unwrap();
        let time = format!("{t}").parse().unwrap();
        exact.push(time, [&[q], &[qd], &[qdd]], k > 0).unwrap();
    }
    let path = std::path::PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&path, text).unwrap();
    (path, exact)
}

/// The change of both parameters by other derivatives of the measured positions, and by those of the
/// exact motion.
fn changes(name: &str, noise: f64) -> [Vec<f64>; 2] {
    let (path, exact) = log(name, noise);
    let settings = Settings {
        method: Method::Butterworth {
            order: 4,
            cutoff: 5.0,
        },
        ..Settings::default()
    };
    let mut logs = Logs::open(&Pendulum, &[Run::from(path)], &settings).unwrap();
    let options = Options::default();
    let found = identify(&Pendulum, EquationKind::Forces, &options, &mut logs).unwrap();
    [None, Some(&exact)].map(|motion| {
        logs.discretisation(&PHI, &[1.0], &found.factor, motion)
            .unwrap()
    })
}

#[test]
fn the_change_along_the_instruments_motion_does_not_depend_on_the_noise_of_the_log() {
    let [measured, along] = changes("sampling_exact.csv", 0.0);
    assert!(along[0].abs() > 1e-3, "{along:?}");
    let near = |a: &[f64], b: &[f64], part: f64| {
        a.iter()
            .zip(b)
            .all(|(a, b)| (a - b).abs() <= part * b.abs())
    };
    assert!(near(&measured, &along, 1e-9), "{measured:?} {along:?}");
    let [noisy, still] = changes("sampling_noisy.csv", 1e-3);
    assert!(near(&still, &along, 1e-2), "{still:?} {along:?}");
    assert!(!near(&noisy, &along, 0.1), "{noisy:?} {along:?}");
}

#[test]
fn rows_that_the_instruments_motion_lacks_give_no_change() {
    let (path, _) = log("sampling_elsewhere.csv", 0.0);
    let settings = Settings {
        method: Method::Butterworth {
            order: 4,
            cutoff: 5.0,
        },
        ..Settings::default()
    };
    let mut logs = Logs::open(&Pendulum, &[Run::from(path)], &settings).unwrap();
    let mut elsewhere = MotionSeries::new(1);
    for k in 0..1500_u32 {
        let t = STEP * (f64::from(k) + 0.5);
        let [q, qd, qdd] = motion(t);
        elsewhere.push(t, [&[q], &[qd], &[qdd]], k > 0).unwrap();
    }
    let mut states = 0;
    let mut count = |_: &regen_identify::identify::ChangedEfforts<'_>| states += 1;
    logs.changed_efforts(&PHI, Some(&elsewhere), &mut count)
        .unwrap();
    assert_eq!(states, 0);
    let mut count = |_: &regen_identify::identify::ChangedEfforts<'_>| states += 1;
    logs.changed_efforts(&PHI, None, &mut count).unwrap();
    assert!(states > 100);
}
