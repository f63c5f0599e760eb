//! What the sampling of the positions leaves unknown of the parameters.

use core::slice::from_ref;
use std::fmt::Write as _;
use std::path::PathBuf;

use regen_identify::data::{Logs, Run, Settings};
use regen_identify::signals::Method;
use regen_identify::states::{MotionSeries, Source};

use crate::models::pendulum::Pendulum;

const STEP: f64 = 0.02;
/// Inertia and first moment.
const PHI: [f64; 2] = [0.5, 2.0];

/// Position, velocity and acceleration.
fn at(t: f64) -> [f64; 3] {
    let (slow, fast) = (3.0 * t, 11.0 * t);
    [
        slow.sin() + 0.2 * fast.cos(),
        3.0 * slow.cos() - 2.2 * fast.sin(),
        -9.0 * slow.sin() - 24.2 * fast.cos(),
    ]
}

/// Times of a log, s, and the time of the motion at each: it goes faster from `ahead` on.
fn times(rows: u32, ahead: f64) -> impl Iterator<Item = (f64, f64)> {
    let all = (0..rows).map(|k| STEP * f64::from(k));
    all.map(move |t| (format!("{t}").parse().unwrap(), t + ahead))
}

/// Writes a log with this noise of positions.
fn written(name: &str, rows: u32, ahead: f64, noise: f64) -> PathBuf {
    let mut text = "t,q1,tau_q1\n".to_owned();
    for (k, (time, t)) in times(rows, ahead).enumerate() {
        let [q, _, qdd] = at(t);
        let tau = PHI[0] * qdd + PHI[1] * 9.81 * q.sin();
        let own = noise * libm::sin(12.9898 * (k * k % 1009) as f64);
        writeln!(text, "{time},{},{tau}", q + own).unwrap();
    }
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&path, text).unwrap();
    path
}

/// Adds the motion of such a log, without its first and last two rows.
fn add(motion: &mut MotionSeries, rows: u32, ahead: f64) {
    let inner = times(rows, ahead).skip(2).take(rows as usize - 4);
    for (k, (time, t)) in inner.enumerate() {
        let [q, qd, qdd] = at(t);
        motion.push(time, [&[q], &[qd], &[qdd]], k > 0).unwrap();
    }
}

/// The changes of the efforts at all states of logs, along a motion or the measured one.
fn changes(logs: &[PathBuf], motion: Option<&MotionSeries>) -> Vec<f64> {
    let settings = Settings {
        method: Method::Butterworth {
            order: 4,
            cutoff: 5.0,
        },
        ..Settings::default()
    };
    let runs: Vec<Run> = logs.iter().cloned().map(Run::from).collect();
    let mut logs = Logs::open(&Pendulum, &runs, &settings).unwrap();
    let mut all = Vec::new();
    logs.changed_efforts(&PHI, motion, &mut |state| {
        all.extend_from_slice(state.change);
        Ok(())
    })
    .unwrap();
    all
}

fn rms(all: &[f64]) -> f64 {
    (all.iter().map(|x| x * x).sum::<f64>() / all.len() as f64).sqrt()
}

#[test]
fn the_change_along_the_instruments_motion_does_not_depend_on_the_noise_of_the_log() {
    let mut motion = MotionSeries::new(1);
    add(&mut motion, 1500, 0.0);
    let exact = written("sampling_exact.csv", 1500, 0.0, 0.0);
    let noisy = written("sampling_noisy.csv", 1500, 0.0, 3e-3);
    let along = changes(from_ref(&exact), Some(&motion));
    assert!(along.len() > 100 && rms(&along) > 1e-2, "{}", rms(&along));
    assert_eq!(changes(from_ref(&noisy), Some(&motion)), along);
    let measured = rms(&changes(from_ref(&exact), None));
    assert!((measured / rms(&along) - 1.0).abs() < 0.02, "{measured}");
    let measured = rms(&changes(from_ref(&noisy), None));
    assert!(measured > 2.0 * rms(&along), "{measured}");
}

#[test]
fn logs_of_the_same_times_have_each_its_own_motion() {
    // the first log is the shorter one, and its last rows have times of the second
    let sizes = [(700, 0.0), (900, 1.3), (800, 2.1)];
    let names = ["sampling_a.csv", "sampling_b.csv", "sampling_c.csv"];
    let logs: Vec<PathBuf> = names
        .iter()
        .zip(sizes)
        .map(|(name, (rows, ahead))| written(name, rows, ahead, 0.0))
        .collect();
    let mut all = MotionSeries::new(1);
    let mut separate = Vec::new();
    for (log, (rows, ahead)) in logs.iter().zip(sizes) {
        add(&mut all, rows, ahead);
        let mut own = MotionSeries::new(1);
        add(&mut own, rows, ahead);
        separate.extend(changes(from_ref(log), Some(&own)));
    }
    assert!(separate.len() > 300);
    assert_eq!(changes(&logs, Some(&all)), separate);
}

#[test]
fn rows_that_the_instruments_motion_lacks_give_no_change() {
    let log = written("sampling_elsewhere.csv", 1500, 0.0, 0.0);
    let mut elsewhere = MotionSeries::new(1);
    for (k, (time, t)) in times(1500, 0.0).enumerate() {
        let [q, qd, qdd] = at(t);
        let between = time + 0.5 * STEP;
        elsewhere
            .push(between, [&[q], &[qd], &[qdd]], k > 0)
            .unwrap();
    }
    assert!(changes(from_ref(&log), Some(&elsewhere)).is_empty());
    assert!(!changes(from_ref(&log), None).is_empty());
}
